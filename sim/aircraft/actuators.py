"""Receiver's control surfaces and engine lever: first-order lags with limits of position and rate.

    d(surface)/dt = sat(a (sat(command) - surface)),     dT/dt = (sat(T_c) - T) lag          (1)

advanced exactly over a tick while no rate limit is met; the engine's lag is Eq. (3) of `engine`, held over the tick.
Not modelled: dead zones, hysteresis, hinge moments.
Source: Stevens, Lewis & Johnson, Aircraft Control and Simulation, chapters 4 and 5.
"""

import numpy as np

from dockair.kernels import njit
from dockair.rotations import Array
from dockair.sim.aircraft.airframe import AirframeData
from dockair.sim.aircraft.engine import engine_lag_1_s
from dockair.sim.aircraft.trim import Trim


class Actuators:
    """Surfaces and thrust, from trim on.

    Args:
        parameters: lags and limits.
        trim: where they start, and the thrust range.
        step_s: length of a tick.
    """

    def __init__(self, parameters: AirframeData, trim: Trim, step_s: float) -> None:
        largest_step_rad = np.array(parameters.surface_rate_limits_rad_s) * step_s
        self._limits_rad = np.vstack([parameters.surface_limits_rad, largest_step_rad])  # of position, of a tick's move
        self._surface_share = -float(np.expm1(-parameters.actuator_bandwidth_rad_s * step_s))
        self._quick_share = -float(np.expm1(-step_s / parameters.engine_time_constant_s))
        self._engine, self._step_s = parameters, step_s
        self._range = trim.thrust_range
        self.surfaces_rad: Array = trim.surfaces_rad  #: (3,) elevator, aileron, rudder; moved in place
        self.thrust_n = float(trim.thrust_n)
        self.throttle = trim.thrust_range.throttle(trim.thrust_n)  #: as commanded, after its limits

    def step(self, surfaces_command_rad: Array, thrust_command_n: float) -> None:
        """Advance by one tick toward the commands (3,) [rad] and [N]."""
        _follow(self.surfaces_rad, surfaces_command_rad, self._limits_rad, self._surface_share)
        span = self._range
        command_n = min(max(thrust_command_n, span.idle_n), span.military_n)
        self.throttle = span.throttle(command_n)
        rise = self.throttle - span.throttle(self.thrust_n)
        share = self._quick_share
        if rise > self._engine.engine_quick_rise:
            share = -float(np.expm1(-engine_lag_1_s(self._engine, rise) * self._step_s))
        self.thrust_n += share * (command_n - self.thrust_n)


@njit(cache=True)
def _follow(surfaces, commands, limits, share):  # type: ignore[no-untyped-def]
    for i in range(3):
        command = min(max(commands[i], -limits[0, i]), limits[0, i])
        move = share * (command - surfaces[i])
        surfaces[i] += min(max(move, -limits[1, i]), limits[1, i])
