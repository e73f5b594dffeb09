"""The flight that the receiver is to follow: its own airframe as its flight control knows it, flown in still air.

A rigid body with the on-board aerodynamics, first-order actuators without limits and thrust along x:

    m dv/dt = R (F + T e_x) + m g,     dR/dt = R [w]x,     J dw/dt = M + M_rotor - w x J w               (1)
    d(surface)/dt = a (command - surface),     dT/dt = (command - T) / tau                                (2)

integrated semi-implicitly, a tick at a time. It flies large banks as the airframe does, lift lost and sideslip
included; a linear model would ask the aircraft for a flight that it cannot fly.
Not modelled: limits of actuators (whoever commands keeps inside them), the slow part of the engine's lag.
"""

import numpy as np
from numba import njit

from dockair.rotations import Array
from dockair.sim.air.atmosphere import STANDARD_GRAVITY_M_S2
from dockair.sim.aircraft.airframe import AirframeData


class ModelFlight:
    """Eqs. (1) and (2), one tick at a time.

    Args:
        airframe: the on-board model.
        step_s: length of a tick.
    """

    def __init__(self, airframe: AirframeData, step_s: float) -> None:
        inertia, lags = airframe.inertia_B, np.full(4, airframe.actuator_bandwidth_rad_s)
        lags[3] = 1.0 / airframe.engine_time_constant_s
        constants = np.array([step_s, airframe.mass_kg, airframe.rotor_momentum_kg_m2_s])
        self.R_WB: Array = np.eye(3)  #: all moved in place
        self.velocity_W: Array = np.zeros(3)  #: inertial [m/s]
        self.w_WB_B: Array = np.zeros(3)
        self.actuators: Array = np.zeros(4)  #: elevator, aileron, rudder [rad], thrust per mass [m/s^2]
        state = (self.R_WB, self.velocity_W, self.w_WB_B, self.actuators)
        self._arguments = (*state, inertia, np.asarray(np.linalg.inv(inertia)), lags, constants)

    def start(self, R_WB: Array, velocity_W: Array, w_WB_B: Array, actuators: Array) -> None:
        """Begin in this state."""
        self.R_WB[:], self.velocity_W[:], self.w_WB_B[:], self.actuators[:] = R_WB, velocity_W, w_WB_B, actuators

    def step(self, wrench_B: Array, commands: Array) -> None:
        """Advance by one tick.

        Args:
            wrench_B: (6,) force and moment of the air on it as it flies, body axes [N, N m].
            commands: (4,) to the actuators.
        """
        _advance(wrench_B, commands, *self._arguments)


@njit(cache=True)
def _advance(wrench, commands, R, v, w, actuators, J, J_inverse, lags, k):  # type: ignore[no-untyped-def]
    step, mass, h, force, moment = k[0], k[1], k[2], wrench[:3], wrench[3:]
    L = (
        J[0, 0] * w[0] + J[0, 1] * w[1] + J[0, 2] * w[2],
        J[1, 0] * w[0] + J[1, 1] * w[1] + J[1, 2] * w[2],
        J[2, 0] * w[0] + J[2, 1] * w[1] + J[2, 2] * w[2],
    )
    torque = (
        moment[0] - w[1] * L[2] + w[2] * L[1],
        moment[1] - w[2] * L[0] + w[0] * L[2] - h * w[2],
        moment[2] - w[0] * L[1] + w[1] * L[0] + h * w[1],
    )
    push = (force[0] / mass + actuators[3], force[1] / mass, force[2] / mass)
    for i in range(3):
        v[i] += step * (R[i, 0] * push[0] + R[i, 1] * push[1] + R[i, 2] * push[2])
        w[i] += step * (J_inverse[i, 0] * torque[0] + J_inverse[i, 1] * torque[1] + J_inverse[i, 2] * torque[2])
    v[2] -= step * STANDARD_GRAVITY_M_S2
    _turn(R, step * w[0], step * w[1], step * w[2])
    for i in range(4):
        actuators[i] += step * lags[i] * (commands[i] - actuators[i])


@njit(cache=True)
def _turn(R, x, y, z):  # type: ignore[no-untyped-def]
    """R <- R exp(rotation vector), in place (Rodrigues)."""
    t2 = x * x + y * y + z * z
    t = np.sqrt(t2)
    a, b = (1.0, 0.5) if t < 1e-8 else (np.sin(t) / t, (1.0 - np.cos(t)) / t2)
    c = 1.0 - b * t2
    for i in range(3):
        p, q, r = R[i, 0], R[i, 1], R[i, 2]
        R[i, 0] = p * (c + b * x * x) + q * (b * x * y + a * z) + r * (b * x * z - a * y)
        R[i, 1] = p * (b * x * y - a * z) + q * (c + b * y * y) + r * (b * y * z + a * x)
        R[i, 2] = p * (b * x * z + a * y) + q * (b * y * z - a * x) + r * (c + b * z * z)
