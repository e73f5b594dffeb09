"""Where the receiver's own commands have brought it, and where those already given still will.

The tip answers a command that comes with its rate a response time later, axis by axis:

    v(t) = u(t - tau),      y_r(t) = integral of v                                                       (1)

y_r is a scale of the receiver's own, which drifts against any other with the bias of its inertial velocity.

Not modelled: a gain other than one and whatever else the response is besides a delay. What the tip does differently
shows as motion of the drogue on this scale, and is followed as such.
"""

import numpy as np

from dockair.rotations import Array


class OwnPath:
    """Eq. (1), axes forward, left, up."""

    def __init__(self, response_s: Array, step_s: float) -> None:
        self._step_s = step_s
        self._ticks = np.maximum(np.round(np.asarray(response_s) / step_s).astype(int), 1)
        self._length = int(self._ticks.max()) + 1
        self._axes, self._newest = np.arange(3), 0
        self._places, self._velocities = np.zeros((self._length, 3)), np.zeros((self._length, 3))  # rings

    def step(self, velocity_m_s: Array) -> None:
        """Take note of the velocity (3,) commanded for the next period."""
        before, self._newest = self._newest, (self._newest + 1) % self._length
        self._places[self._newest] = self._places[before] + velocity_m_s * self._step_s
        self._velocities[self._newest] = velocity_m_s

    @property
    def place_m(self) -> Array:
        """(3,) y_r now."""
        return np.asarray(self._places[self._newest - self._ticks, self._axes])

    @property
    def velocity_m_s(self) -> Array:
        """(3,) v now."""
        return np.asarray(self._velocities[self._newest - self._ticks, self._axes])

    @property
    def place_ahead_m(self) -> Array:
        """(3,) y_r after the response time of each axis, by the commands given so far."""
        return np.array(self._places[self._newest])
