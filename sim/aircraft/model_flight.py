"""The flight that the receiver is to follow: its own airframe as its flight control knows it, flown in still air.

A rigid body with the on-board aerodynamics, first-order actuators without limits and thrust along x:

    m dv/dt = R (F + T e_x) + m g,     dR/dt = R [w]x,     J dw/dt = M + M_rotor - w x J w               (1)
    d(surface)/dt = a (command - surface),     dT/dt = (command - T) / tau                                (2)

integrated semi-implicitly, a tick at a time. It flies large banks as the airframe does, lift lost and sideslip
included; a linear model would ask the aircraft for a flight that it cannot fly.
Not modelled: limits of actuators (whoever commands keeps inside them), the slow part of the engine's lag.
"""

import numpy as np
from numpy.typing import NDArray

from dockair.rotations import Array
from dockair.sim.aircraft.airframe import AirframeData
from dockair.sim.aircraft.control_law import advance_model

_MEMORY = np.dtype(
    [
        ("R_WB", float, (3, 3)),
        ("velocity_W", float, 3),
        ("w_WB_B", float, 3),
        ("actuators", float, 4),
        ("inertia", float, (3, 3)),
        ("inverse_inertia", float, (3, 3)),
        ("lags_1_s", float, 4),
        ("step_s", float),
        ("mass_kg", float),
        ("rotor_momentum", float),
    ]
)


class ModelFlight:
    """Eqs. (1) and (2), one tick at a time.

    Args:
        airframe: the on-board model.
        step_s: length of a tick.
    """

    def __init__(self, airframe: AirframeData, step_s: float) -> None:
        self.memory: NDArray[np.void] = np.zeros((), _MEMORY)  #: state and constants, for `control_law`
        m, inertia = self.memory, airframe.inertia_B
        m["inertia"], m["inverse_inertia"] = inertia, np.linalg.inv(inertia)
        m["lags_1_s"] = [*[airframe.actuator_bandwidth_rad_s] * 3, 1.0 / airframe.engine_time_constant_s]
        m["step_s"], m["mass_kg"], m["rotor_momentum"] = step_s, airframe.mass_kg, airframe.rotor_momentum_kg_m2_s
        m["R_WB"] = np.eye(3)

    @property
    def R_WB(self) -> Array:
        """(3, 3) attitude; moved in place, as all of the state."""
        return np.asarray(self.memory["R_WB"])

    @property
    def velocity_W(self) -> Array:
        """(3,) inertial [m/s]."""
        return np.asarray(self.memory["velocity_W"])

    @property
    def w_WB_B(self) -> Array:
        """(3,) angular velocity [rad/s]."""
        return np.asarray(self.memory["w_WB_B"])

    @property
    def actuators(self) -> Array:
        """(4,) elevator, aileron, rudder [rad], thrust per mass [m/s^2]."""
        return np.asarray(self.memory["actuators"])

    def start(self, R_WB: Array, velocity_W: Array, w_WB_B: Array, actuators: Array) -> None:
        """Begin in this state."""
        m = self.memory
        m["R_WB"], m["velocity_W"], m["w_WB_B"], m["actuators"] = R_WB, velocity_W, w_WB_B, actuators

    def step(self, wrench_B: Array, commands: Array) -> None:
        """Advance by one tick.

        Args:
            wrench_B: (6,) force and moment of the air on it as it flies, body axes [N, N m].
            commands: (4,) to the actuators.
        """
        advance_model(wrench_B, commands, self.memory)
