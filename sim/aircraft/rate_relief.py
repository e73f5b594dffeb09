"""Takes the reference back when a surface meets its rate limit or comes near its stop, before lag feeds on haste.

A surface at its rate limit answers late; a loop that then asks for more drives it to the next stop, and an airframe
that is not stable by itself departs. b is the part of the time, over T, for which some surface has been asked for more
than its rate:

    b' = (busy - b) / T,     busy = 1 where a |command - surface| > rate limit or |command| > c stop      (1)
    share = 1 - (1 - least) h                                                                             (2)
    h = min(b / b_0, 1)                                                                                   (3)

a is the actuators' bandwidth; both the aircraft's surfaces and those of the model flight that it follows count, for the
model says early what the aircraft will be asked for. The reference's limits of acceleration are multiplied by the
share, and the feedback goes over to gains that ask for less by h (`flight_control`).
Not modelled: a cause other than haste; surfaces that are busy with gusts alone take the reference back, too.
Source: the idea of relieving a rate-limited loop is common practice against pilot-induced oscillations [Duda 1998,
Flight control system design considering rate saturation, Aerospace Science and Technology 2(4)]; this form is our own.
"""

import math
from dataclasses import dataclass

import numpy as np
from numba import njit

from dockair.rotations import Array


@dataclass(frozen=True, slots=True, kw_only=True)
class RateReliefParameters:
    """Constants of Eqs. (1) to (3)."""

    time_s: float  #: T
    busy_share: float  #: b_0
    least: float
    stop_share: float  #: c


class RateRelief:
    """Eqs. (1) to (3), one tick at a time.

    Args:
        parameters: constants.
        bandwidth_rad_s: a.
        rate_limits_rad_s: (3,) of elevator, aileron and rudder.
        stops_rad: (3,) beyond which they do not go.
        step_s: length of a tick.
    """

    def __init__(
        self,
        parameters: RateReliefParameters,
        bandwidth_rad_s: float,
        rate_limits_rad_s: Array,
        stops_rad: Array,
        step_s: float,
    ) -> None:
        self._parameters = parameters
        largest = [float(rate) / bandwidth_rad_s for rate in rate_limits_rad_s]
        self._limits = np.array([largest, [parameters.stop_share * float(stop) for stop in stops_rad]])
        self._keep = math.exp(-step_s / parameters.time_s)
        self._busy = 0.0
        self.haste = 0.0  #: Eq. (3)

    def step(self, commands_rad: Array, surfaces_rad: Array, modelled_rad: Array) -> float:
        """Return the share after a tick: commands to the surfaces (3,), where these and the model's (3,) were."""
        busy = _is_busy(commands_rad, surfaces_rad, modelled_rad, self._limits)
        self._busy = self._keep * self._busy + (1.0 - self._keep if busy else 0.0)
        self.haste = min(self._busy / self._parameters.busy_share, 1.0)
        return 1.0 - (1.0 - self._parameters.least) * self.haste


@njit(cache=True)
def _is_busy(commands, surfaces, modelled, limits):  # type: ignore[no-untyped-def]
    """Eq. (1)'s condition."""
    for i in range(3):
        near_stop = max(abs(commands[i]), abs(modelled[i])) > limits[1, i]
        if near_stop or abs(commands[i] - surfaces[i]) > limits[0, i]:
            return True
    return False
