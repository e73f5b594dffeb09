"""Takes the reference back when a surface meets its rate limit or comes near its stop, before lag feeds on haste.

A surface at its rate limit answers late; a loop that then asks for more drives it to the next stop, and an airframe
that is not stable by itself departs. b of the elevator, and of ailerons and rudder together, is the part of the time,
over T, for which one of them has been asked for more than its rate:

    b' = (busy - b) / T,     busy = 1 where a |command - surface| > rate limit or |command| > c stop      (1)
    share = 1 - (1 - least) h                                                                             (2)
    h = min(b / b_0, 1)                                                                                   (3)

a is the actuators' bandwidth; both the aircraft's surfaces and those of the model flight that it follows count, for the
model says early what the aircraft will be asked for. The reference's limits of acceleration are multiplied by the
elevator's share, to the left by the smaller of both: a receiver whose rudder is late can still be led up and down, but
one that rolls behind a late elevator departs. The feedback, which couples all surfaces, goes over to gains that ask for
less by the larger h (`flight_control`).
Not modelled: a cause other than haste; surfaces that are busy with gusts alone take the reference back, too.
Source: the idea of relieving a rate-limited loop is common practice against pilot-induced oscillations [Duda 1998,
Flight control system design considering rate saturation, Aerospace Science and Technology 2(4)]; this form is our own.
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from dockair.rotations import Array
from dockair.sim.aircraft.control_law import relieve

_MEMORY = np.dtype(
    [
        ("busy", float, 2),  # b of the elevator, of ailerons and rudder
        ("haste", float),  # the larger h of Eq. (3)
        ("misses_rad", float, 3),  # of surfaces behind their commands, at the rate limit
        ("stops_rad", float, 3),  # beyond which a surface counts as busy
        ("keep", float),  # share of b that a tick leaves
        ("busy_share", float),
        ("least", float),
    ]
)


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
        self.memory: NDArray[np.void] = np.zeros((), _MEMORY)  #: state and constants, for `control_law`
        m = self.memory
        m["misses_rad"] = [float(rate) / bandwidth_rad_s for rate in rate_limits_rad_s]
        m["stops_rad"] = [parameters.stop_share * float(stop) for stop in stops_rad]
        m["keep"], m["busy_share"] = math.exp(-step_s / parameters.time_s), parameters.busy_share
        m["least"] = parameters.least

    @property
    def haste(self) -> float:
        """The larger of Eq. (3)."""
        return float(self.memory["haste"])

    def step(self, commands_rad: Array, surfaces_rad: Array, modelled_rad: Array) -> Array:
        """Return the shares (3,) forward, left, up after a tick.

        Args:
            commands_rad: (3,) to the surfaces.
            surfaces_rad: (3,) where they were.
            modelled_rad: (3,) where the model's were.
        """
        return np.array(relieve(commands_rad, surfaces_rad, modelled_rad, self.memory))
