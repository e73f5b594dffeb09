"""The flight that the receiver is to follow: its own airframe as its flight control knows it, flown in still air.

A rigid body with the on-board aerodynamics, first-order actuators without limits and thrust along x:

    m dv/dt = R (F + T e_x) + m g,     dR/dt = R [w]x,     J dw/dt = M + M_rotor - w x J w               (1)
    d(surface)/dt = a (command - surface),     dT/dt = (command - T) / tau                                (2)

integrated semi-implicitly, a tick at a time. It flies large banks as the airframe does, lift lost and sideslip
included; a linear model would ask the aircraft for a flight that it cannot fly.
Not modelled: limits of actuators (whoever commands keeps inside them), the slow part of the engine's lag.
"""

import numpy as np

from dockair.rotations import Array
from dockair.sim.aircraft.airframe import AirframeData
from dockair.sim.aircraft.control_law import advance_model


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
        #: all that `control_law` moves it with, in its order
        self.memory = (*state, inertia, np.asarray(np.linalg.inv(inertia)), lags, constants)

    def start(self, R_WB: Array, velocity_W: Array, w_WB_B: Array, actuators: Array) -> None:
        """Begin in this state."""
        self.R_WB[:], self.velocity_W[:], self.w_WB_B[:], self.actuators[:] = R_WB, velocity_W, w_WB_B, actuators

    def step(self, wrench_B: Array, commands: Array) -> None:
        """Advance by one tick.

        Args:
            wrench_B: (6,) force and moment of the air on it as it flies, body axes [N, N m].
            commands: (4,) to the actuators.
        """
        advance_model(wrench_B, commands, *self.memory)
