"""Which physics step a world can bear, found out before it flies.

Semi-implicit integration of an oscillation of angular frequency w is stable while w dt < 2; the fastest of the tow is
bounded by the sum of the squares of what would be fastest alone,

    w^2 <= max eig(M^-1 K)  +  4 T/(m l)  +  4 k_g/m                                                      (1)

bending (M, K: mass and hinge stiffness of the chain), tension T of a string of masses m at distances l, and the tube in
the pod of stiffness k_g. Contacts and stops as soft springs need two steps in their time constant, or MuJoCo makes them
softer in silence.
Not modelled: the damping of hinges, which is implicit, and of air and tube, which is explicit but slower.
Source: Hairer, Lubich & Wanner, Geometric Numerical Integration, ch. I; MuJoCo's documentation on solver parameters.
"""

import mujoco
import numpy as np
from scipy.linalg import eigh

from dockair.errors import DockairError
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
    needed_hz["hose and reel"] = 0.5 * fastest_rad_s(model, parameters, root_tension_n)
    cause = max(needed_hz, key=lambda name: needed_hz[name])
    if step_s * needed_hz[cause] > 1.0 + 1e-9:  # rounding of a step that just fits
        lowest = int(np.ceil(needed_hz[cause] - 1e-9))
        expected = f"at least {lowest} Hz, because of {cause}"
        raise DockairError("rates.physics_hz", expected=expected, got=round(1.0 / step_s))


def fastest_rad_s(model: mujoco.MjModel, parameters: WorldParameters, root_tension_n: float) -> float:
    """Bound of Eq. (1) on the tow's angular frequencies."""
    hose, reel = parameters.hose, parameters.reel
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    M = np.zeros((model.nv, model.nv))
    mujoco.mj_fullM(model, data, M)
    first, last = model.joint("hose_0_y").dofadr[0], model.joint("drogue_z").dofadr[0]
    hinges = slice(first, last + 1)
    stiffness = np.array([model.jnt_stiffness[j].ravel()[0] for j in model.dof_jntid[hinges]])
    bending = eigh(np.diag(stiffness), M[hinges, hinges], eigvals_only=True)[-1]
    string = 4.0 * root_tension_n / (hose.link_mass_kg * hose.link_length_m)
    tube = 4.0 * reel.guide_stiffness_n_m / hose.link_mass_kg
    return float(np.sqrt(bending + string + tube))
