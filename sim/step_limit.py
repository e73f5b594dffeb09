"""Which physics step a world can bear, found out before it flies.

Semi-implicit integration of y'' = -c y' - w^2 y, the damping explicit, is stable while

    4 - 2 c dt - w^2 dt^2 > 0                                                                             (1)

(Schur's condition on its step; without damping w dt < 2). A chain of links of mass m and length l moves fastest when
its joints go up and down by turns: then each joint moves m/3, and the tow is bounded by the sum of what each part does,

    w^2 <= max eig(M^-1 K)  +  12 T/(m l)  +  15 k_g/m                                                    (2)
    c    = (6 + 24/sqrt(3)) z_g sqrt(k_g/m)                                                               (3)

bending (M, K: mass and hinge stiffness of the chain), tension T, and the tube in the pod, which holds each joint by
k_g, its stiffness times l, with a damping ratio z_g, and turns each link by k_g l^2 (`hose.reel.guide_loads`). It is
the bound of an endless chain in the tube: whatever length of hose is wound in, it holds. Contacts and stops as soft
springs need two steps in their time constant, or MuJoCo makes them softer in silence. The reel's brake and its motor, a
force F that comes in or falls off over a band v_b of speed, and the drum's damping d act on all that the reel moves;
Eq. (1) without a spring,

    (F/v_b + d) dt < 2 m,      m = drum + hose + drogue                                                  (4)

where F is the brake's, or what the motor pulls a slack hose with, (1 + k) f T at most (`hose.reel`).

The air damps the drogue's turning and its motion across, explicitly, which a wide and light one feels most: with J_w
and J_v the Jacobians of its turning and of its canopy's motion across by the hinges, the coefficients of `hose.loads`,

    max eig(M^-1 C) dt < 2,      C = 1/2 rho V (S d^2 C_q J_w'J_w + S_c C_S J_v'J_v)                     (5)

The lock of a dead reel, a spring k_l with a damper d_l (`hose.reel`), acts on what of the hose it moves, the drum's
inertia taking no part: of a straight one all, of one that has been pushed in and folds much less. With links of mass m
that lie across the pod's axis, an endless chain of them counts as m/sqrt(12) against being drawn in; the first of them
lying along the axis, as m (1 + 1/sqrt(12)). Of that the link itself is relied on: Eq. (1) with

    c = d_l/m,     w^2 = k_l/m                                                                            (6)

Not modelled: the damping of hinges, which is implicit, and that of the air on the hose, which is explicit but slower;
a hose that folds in the exit itself while its reel is dead, which moves less than a link.
Source: Hairer, Lubich & Wanner, Geometric Numerical Integration, ch. I; MuJoCo's documentation on solver parameters;
Eqs. (2), (3) and (6) derived from the chain's kinetic and potential energy in those motions.
"""

import mujoco
import numpy as np
from scipy.linalg import eigh

from dockair.errors import DockairError
from dockair.rotations import Array
from dockair.sim.parts import WorldParameters

_STEPS_IN_CONTACT = 2


def check_step(model: mujoco.MjModel, parameters: WorldParameters, root_tension_n: float) -> None:
    """Refuse a step that is too long.

    Raises:
        DockairError: with the lowest physics rate that would do.
    """
    step_s, p = float(model.opt.timestep), parameters
    softest = {
        "parameters.drogue.contact_time_constant_s": p.drogue.contact_time_constant_s,
        "parameters.coupling.latch_time_constant_s": p.coupling.latch_time_constant_s,
        "parameters.reel.stop_time_constant_s": p.reel.stop_time_constant_s,
    }
    key = min(softest, key=lambda name: softest[name])
    needed_hz = {key: _STEPS_IN_CONTACT / softest[key]}
    needed_hz["hose and reel"] = lowest_rate_hz(model, parameters, root_tension_n)
    slack_n = (1.0 + p.reel.tension_gain) * p.reel.set_point_fraction * root_tension_n
    for name, force_n in (("brake_force_n", p.reel.brake_force_n), ("tension_gain", slack_n)):
        needed_hz[f"parameters.reel.{name} over speed_band_m_s"] = lowest_rate_of_reel_hz(p, force_n)
    needed_hz["parameters.reel.lock_damping_n_s_m and lock_stiffness_n_m"] = lowest_rate_of_lock_hz(p)
    needed_hz["parameters.drogue.rate_damping_coefficient and inertia_kg_m2"] = lowest_rate_in_air_hz(model, parameters)
    cause = max(needed_hz, key=lambda name: needed_hz[name])
    if step_s * needed_hz[cause] > 1.0 + 1e-9:  # rounding of a step that just fits
        lowest = int(np.ceil(needed_hz[cause] - 1e-9))
        expected = f"at least {lowest} Hz, because of {cause}"
        raise DockairError("rates.physics_hz", expected=expected, got=round(1.0 / step_s))


def lowest_rate_hz(model: mujoco.MjModel, parameters: WorldParameters, root_tension_n: float) -> float:
    """Physics rate at which Eq. (1) is just met, with hose in the tube."""
    hose, reel = parameters.hose, parameters.reel
    hinges, M, _ = _chain(model)
    stiffness = np.array([model.jnt_stiffness[j].ravel()[0] for j in model.dof_jntid[hinges]])
    bending = eigh(np.diag(stiffness), M, eigvals_only=True)[-1]
    string = 12.0 * root_tension_n / (hose.link_mass_kg * hose.link_length_m)
    tube = reel.guide_stiffness_n_m2 / hose.line_density_kg_m
    squared = bending + string + 15.0 * tube  # Eq. (2)
    damping = (6.0 + 24.0 / np.sqrt(3.0)) * reel.guide_damping_ratio * np.sqrt(tube)  # Eq. (3)
    return _just_met_hz(damping, squared)


def lowest_rate_of_lock_hz(parameters: WorldParameters) -> float:
    """Physics rate at which Eq. (1) is just met with a dead reel's lock on a folded hose, Eq. (6)."""
    reel, moved_kg = parameters.reel, parameters.hose.link_mass_kg
    return _just_met_hz(reel.lock_damping_n_s_m / moved_kg, reel.lock_stiffness_n_m / moved_kg)


def lowest_rate_of_reel_hz(parameters: WorldParameters, force_n: float) -> float:
    """Physics rate at which Eq. (4) is just met with a force of the brake or the motor."""
    hose, reel = parameters.hose, parameters.reel
    moved_kg = reel.drum_mass_kg + hose.line_density_kg_m * hose.length_m + parameters.drogue.mass_kg
    return float(0.5 * (force_n / reel.speed_band_m_s + reel.drum_damping_n_s_m) / moved_kg)


def lowest_rate_in_air_hz(model: mujoco.MjModel, parameters: WorldParameters) -> float:
    """Physics rate at which Eq. (5) is just met."""
    p, drogue, body = parameters, parameters.drogue, model.body("drogue").id
    hinges, M, data = _chain(model)
    across, turning = np.zeros((2, 3, model.nv))
    canopy = data.xpos[body] + drogue.drag_centre_x_m * data.xmat[body].reshape(3, 3)[:, 0]
    mujoco.mj_jac(model, data, across, turning, canopy, body)
    J_v, J_w = across[1:, hinges], turning[:, hinges]
    against_turning = drogue.drag_area_m2 * drogue.drag_diameter_m**2 * drogue.rate_damping_coefficient
    sideways = drogue.canopy_area_m2 * drogue.canopy_side_coefficient
    C = 0.5 * p.air.density_kg_m3 * p.airspeed_m_s * (against_turning * J_w.T @ J_w + sideways * J_v.T @ J_v)
    return float(0.5 * eigh(C, M, eigvals_only=True)[-1])


def _just_met_hz(damping: float, squared: float) -> float:
    """Rate at which Eq. (1) is just met, of c [1/s] and w^2 [1/s^2]."""
    return float(0.25 * (damping + np.sqrt(damping**2 + 4.0 * squared)))


def _chain(model: mujoco.MjModel) -> tuple[slice, Array, mujoco.MjData]:
    """Return the hinges among the degrees of freedom, their mass matrix where all is straight, and that state."""
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    M = np.zeros((model.nv, model.nv))
    mujoco.mj_fullM(model, data, M)
    hinges = slice(model.joint("hose_0_y").dofadr[0], model.joint("drogue_z").dofadr[0] + 1)
    return hinges, M[hinges, hinges], data
