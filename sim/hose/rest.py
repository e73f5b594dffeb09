"""Hose and drogue at rest in steady air: their shape and the tension along them.

Each rigid link is in balance about its front joint under the pull F of what hangs at its rear end, its weight w and
its air load a(t), both acting at its middle:

    t = - (F + (w + a(t)) / 2) / | ... |,        F' = F + w + a(t)                                        (1)

with t the unit vector along the link toward the tanker and F' the pull on the next link forward. Eq. (1) is solved
link by link from the drogue up, by fixed-point iteration (its contraction is |a|/|F|, a few per cent). The drogue
turns about the hose's end until the air's force D, at its canopy, and its weight, at its centre of mass, balance:

    t_D = - (x_m W + x_d D(t_D)) / | ... |  (x_m, x_d: distances aft of the hose's end)                    (2)

Not modelled: bending stiffness (the tension straightens the hose within sqrt(EI/T) = 0.1 m of a joint).
Frame: W, origin at the hose's exit from the pod, x forward, z up. Full trail is along -x.
"""

from dataclasses import dataclass

import numpy as np

from dockair.rotations import Array
from dockair.sim.air.atmosphere import STANDARD_GRAVITY_M_S2
from dockair.sim.hose.chain import DrogueParameters, HoseParameters
from dockair.sim.hose.loads import drogue_force, hose_load_per_length, load_coefficients

_FIXED_POINT_ITERATIONS = 60


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
    for _ in range(_FIXED_POINT_ITERATIONS):
        force = drogue_force(t_D, at_drogue, coefficients)
        t_D = _unit(-(mass_arm * weight + drag_arm * force))  # Eq. (2)

    pull = drogue_force(t_D, at_drogue, coefficients) + weight
    drogue_tension = float(np.linalg.norm(pull))
    directions = np.empty((hose.links, 3))
    for i in reversed(range(hose.links)):
        t = _unit(-pull)
        for _ in range(_FIXED_POINT_ITERATIONS):
            load = hose.link_mass_kg * gravity + hose.link_length_m * hose_load_per_length(t, winds[i], coefficients)
            t = _unit(-(pull + 0.5 * load))  # Eq. (1)
        directions[i] = t
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


def _unit(v: Array) -> Array:
    return np.asarray(v / np.linalg.norm(v))
