"""Hose and drogue at rest in steady air: their shape and the tension along them.

Each rigid link is in balance about its front joint under the pull F of what hangs at its rear end, its weight w and
its air load a(t), both acting at its middle:

    t = - (F + (w + a(t)) / 2) / | ... |,        F' = F + w + a(t)                                        (1)

with t the unit vector along the link toward the tanker and F' the pull on the next link forward. Eq. (1) is solved
link by link from the drogue up. The drogue turns about the hose's end until the air's force D, at its canopy, and its
weight, at its centre of mass, balance:

    t_D = - (x_m W + x_d D(t_D)) / | ... |  (x_m, x_d: distances aft of the hose's end)                    (2)

Both are of the form t = f(t), solved by fixed-point iteration. What an iteration leaves of the way is |a|/|F| for a
link, a few per cent where links are short, and |C_S S_c - C_D S|/(C_D S) for a drogue, nothing for the sheet's, which
has no lift. Where that exceeds a half, as with a canopy of much lift or a long link ahead of a drogue of little drag,
the iteration would creep or swing ever wider: then t goes a share of the way, found from what is left of the last,

    share <- share / (1 - d'd_before / |d_before|^2),        d = f(t) - t                                   (3)

Not modelled: bending stiffness (the tension straightens the hose within sqrt(EI/T) = 0.1 m of a joint).
Frame: W, origin at the hose's exit from the pod, x forward, z up. Full trail is along -x.
Source of Eq. (3): Irons and Tuck, A version of the Aitken accelerator for computer iteration, Int. J. Numer. Methods
Eng. 1(3), 1969.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from dockair.rotations import Array
from dockair.sim.air.atmosphere import STANDARD_GRAVITY_M_S2
from dockair.sim.hose.chain import DrogueParameters, HoseParameters
from dockair.sim.hose.loads import drogue_force, hose_load_per_length, load_coefficients

_FIXED_POINT_ITERATIONS = 60
_SLOW = 0.5  # of the way still left after an iteration
_SETTLED = 1e-9  # way below which what is left of it is mostly rounding


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class RestShape:
    """Hose and drogue at rest."""

    t_W: Array  #: (links, 3) unit vectors along the links, toward the tanker
    t_D_W: Array  #: (3,) the drogue's x axis
    p_WH: Array  #: (links + 1, 3) joints, from the exit to the hose's end [m]
    root_tension_n: float
    drogue_tension_n: float

    def p_WD(self, drogue: DrogueParameters) -> Array:
        """(3,) centre of the LED ring [m]."""
        return np.asarray(self.p_WH[-1] - drogue.hose_joint_x_m * self.t_D_W)

    def air_places_W(self, drogue: DrogueParameters) -> Array:
        """(links + 1, 3) where the air acts: the links' middles and the drogue's canopy [m]."""
        canopy = self.p_WD(drogue) + drogue.drag_centre_x_m * self.t_D_W
        return np.vstack([0.5 * (self.p_WH[:-1] + self.p_WH[1:]), canopy])


def rest_shape(
    hose: HoseParameters, drogue: DrogueParameters, wind_W: Array, density_kg_m3: float, viscosity_m2_s: float
) -> RestShape:
    """Shape at rest in a steady stream, Eqs. (1) and (2).

    Args:
        hose: the hose's sheet.
        drogue: the drogue's sheet.
        wind_W: velocity of the air in W [m/s], (3,) where it is uniform, or (links + 1, 3) at each link and the drogue.
        density_kg_m3: of the air.
        viscosity_m2_s: kinematic viscosity of the air.
    """
    gravity = np.array([0.0, 0.0, -STANDARD_GRAVITY_M_S2])
    coefficients = load_coefficients(hose, drogue, density_kg_m3, viscosity_m2_s)
    weight = drogue.mass_kg * gravity
    mass_arm = drogue.hose_joint_x_m - drogue.centre_of_mass_x_m
    drag_arm = drogue.hose_joint_x_m - drogue.drag_centre_x_m
    winds = np.ascontiguousarray(np.broadcast_to(wind_W, (hose.links + 1, 3)))
    at_drogue = winds[-1]
    t_D = _unit(-at_drogue) if at_drogue.any() else _unit(-gravity)
    t_D, _ = _balanced(t_D, mass_arm * weight, drag_arm, lambda t: drogue_force(t, at_drogue, coefficients))  # Eq. (2)

    pull = drogue_force(t_D, at_drogue, coefficients) + weight
    drogue_tension = float(np.linalg.norm(pull))
    directions = np.empty((hose.links, 3))
    for i in reversed(range(hose.links)):

        def load_at(t: Array, wind: Array = winds[i]) -> Array:
            return hose.link_mass_kg * gravity + hose.link_length_m * hose_load_per_length(t, wind, coefficients)

        directions[i], load = _balanced(_unit(-pull), pull, 0.5, load_at)  # Eq. (1)
        pull = pull + load
    joints = np.vstack([np.zeros(3), np.cumsum(-hose.link_length_m * directions, axis=0)])
    return RestShape(
        t_W=directions,
        t_D_W=t_D,
        p_WH=joints,
        root_tension_n=float(np.linalg.norm(pull)),
        drogue_tension_n=drogue_tension,
    )


def hinge_angles(t_W: Array) -> Array:
    """Hinge angles of the chain, first about y then about z in the turned axes, of its links' directions.

    Args:
        t_W: (n, 3) unit vectors along link 0, 1, ... in W.

    Returns:
        (n, 2) angles about y and z [rad], each relative to the link before (link 0: to W).
    """
    R_WH = np.eye(3)
    angles = np.empty((len(t_W), 2))
    for i, direction in enumerate(t_W):
        x, y, z = R_WH.T @ direction
        about_y, about_z = float(np.arctan2(-z, x)), float(np.arctan2(y, np.hypot(x, z)))
        angles[i] = about_y, about_z
        c_y, s_y, c_z, s_z = np.cos(about_y), np.sin(about_y), np.cos(about_z), np.sin(about_z)
        R_y = np.array([[c_y, 0.0, s_y], [0.0, 1.0, 0.0], [-s_y, 0.0, c_y]])
        R_z = np.array([[c_z, -s_z, 0.0], [s_z, c_z, 0.0], [0.0, 0.0, 1.0]])
        R_WH = R_WH @ R_y @ R_z
    return angles


def _balanced(t: Array, carried: Array, arm: float, load_at: Callable[[Array], Array]) -> tuple[Array, Array]:
    """Return t = - (carried + arm load(t)) / | ... |, from a first guess on, and the load there."""
    share, before = 1.0, np.zeros(3)
    for _ in range(_FIXED_POINT_ITERATIONS):
        load = load_at(t)
        wanted = _unit(-(carried + arm * load))
        way = wanted - t
        squared = float(before @ before)
        if squared > _SETTLED**2 and abs(left := float(way @ before) / squared) > _SLOW:
            share /= max(1.0 - left, 0.1)  # Eq. (3)
        before, t = way, wanted if share == 1.0 else _unit(t + share * way)
    return t, load


def _unit(v: Array) -> Array:
    return np.asarray(v / np.linalg.norm(v))
