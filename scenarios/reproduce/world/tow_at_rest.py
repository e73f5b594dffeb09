"""Hose and drogue at rest in air that differs from place to place: the balance of `sim.hose.rest`, link by link.

With the loads a_i of the present shape and place, the pull at the rear end of each link and then its direction,

    F_i = sum of w_j + a_j behind link i,       t_i = - (F_i + (w_i + a_i)/2) / | ... |                   (1)

are taken over and over, half way each time, until no joint moves: no time, no MuJoCo, an independent witness of what
a settled world shows.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from dockair.rotations import Array
from dockair.sim.air.atmosphere import STANDARD_GRAVITY_M_S2, Air
from dockair.sim.hose.chain import DrogueParameters, HoseParameters
from dockair.sim.hose.loads import drogue_force, hose_load_per_length, load_coefficients
from dockair.sim.hose.rest import rest_shape

AirField = Callable[[Array], Array]  #: places (n, 3) in W -> velocity of the air there beyond the wind (n, 3)

_SWEEPS, _SHARE, _STILL_M = 4000, 0.5, 1e-9
_GRAVITY = np.array([0.0, 0.0, -STANDARD_GRAVITY_M_S2])


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class TowAtRest:
    """Where everything hangs."""

    p_WH: Array  #: (links + 1, 3) joints from the exit to the hose's end [m]
    p_WD: Array  #: (3,) middle of the LED ring [m]
    root_tension_n: float
    drogue_tension_n: float


def tow_at_rest(
    hose: HoseParameters, drogue: DrogueParameters, wind_W: Array, air: Air, motion: AirField, *, on_hose: bool = True
) -> TowAtRest:
    """Solve Eq. (1) from the shape in undisturbed air.

    Args:
        hose: sheet.
        drogue: sheet.
        wind_W: (3,) undisturbed air in W [m/s].
        air: its density and viscosity.
        motion: what is added to the wind.
        on_hose: False: it is added at the drogue alone.
    """
    rho, nu = air.density_kg_m3, air.kinematic_viscosity_m2_s
    k, start = load_coefficients(hose, drogue, rho, nu), rest_shape(hose, drogue, wind_W, rho, nu)
    t, t_D, joints = start.t_W, start.t_D_W, start.p_WH
    mass_arm = drogue.hose_joint_x_m - drogue.centre_of_mass_x_m
    drag_arm = drogue.hose_joint_x_m - drogue.drag_centre_x_m
    weight, link_weight = drogue.mass_kg * _GRAVITY, hose.link_mass_kg * _GRAVITY
    for _ in range(_SWEEPS):
        places = np.vstack([0.5 * (joints[:-1] + joints[1:]), joints[-1] - drag_arm * t_D])
        u = wind_W + motion(places)
        if not on_hose:
            u[:-1] = wind_W
        force = drogue_force(t_D, u[-1], k)
        loads = link_weight + hose.link_length_m * np.array(
            [hose_load_per_length(t[i], u[i], k) for i in range(hose.links)]
        )
        behind = np.cumsum(np.vstack([force + weight, loads[::-1]]), axis=0)[::-1]  # pull at joint 0, 1, ..., the end
        t = _towards(t, -(behind[1:] + 0.5 * loads))
        t_D = _towards(t_D[None], -(mass_arm * weight + drag_arm * force)[None])[0]
        before, joints = joints, np.vstack([np.zeros(3), np.cumsum(-hose.link_length_m * t, axis=0)])
        if np.abs(joints - before).max() < _STILL_M:
            break
    else:
        raise ArithmeticError("hose and drogue find no rest")
    root, end = (float(np.linalg.norm(pull)) for pull in (behind[0], behind[-1]))
    return TowAtRest(
        p_WH=joints, p_WD=joints[-1] - drogue.hose_joint_x_m * t_D, root_tension_n=root, drogue_tension_n=end
    )


def _towards(t: Array, wanted: Array) -> Array:
    """Unit vectors a share of the way from t to the directions wanted."""
    wanted = wanted / np.linalg.norm(wanted, axis=1)[:, None]
    mixed = t + _SHARE * (wanted - t)
    return np.asarray(mixed / np.linalg.norm(mixed, axis=1)[:, None])
