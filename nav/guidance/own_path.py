"""Where the receiver's own commands have brought it, and where those already given still will.

The tip answers a command that comes with its rate a response time later, axis by axis:

    v(t) = u(t - tau),      y_r(t) = integral of v                                                       (1)

y_r is a scale of the receiver's own, which drifts against any other with the bias of its inertial velocity.

Not modelled: a gain other than one and whatever else the response is besides a delay. What the tip does differently
shows as motion of the drogue on this scale, and is followed as such.
"""

from collections import deque

import numpy as np

from dockair.rotations import Array


class OwnPath:
    """Eq. (1), axes forward, left, up."""

    def __init__(self, response_s: Array, step_s: float) -> None:
        self._step_s = step_s
        self._ticks = np.maximum(np.round(np.asarray(response_s) / step_s).astype(int), 1)
        length = int(self._ticks.max()) + 1
        self._places: deque[Array] = deque([np.zeros(3)] * length, maxlen=length)  # newest last
        self._velocities: deque[Array] = deque([np.zeros(3)] * length, maxlen=length)

    def step(self, velocity_m_s: Array) -> None:
        """Take note of the velocity (3,) commanded for the next period."""
        self._places.append(self._places[-1] + velocity_m_s * self._step_s)
        self._velocities.append(velocity_m_s)

    @property
    def place_m(self) -> Array:
        """(3,) y_r now."""
        return np.array([self._places[-1 - n][i] for i, n in enumerate(self._ticks)])

    @property
    def velocity_m_s(self) -> Array:
        """(3,) v now."""
        return np.array([self._velocities[-1 - n][i] for i, n in enumerate(self._ticks)])

    @property
    def place_ahead_m(self) -> Array:
        """(3,) y_r after the response time of each axis, by the commands given so far."""
        return self._places[-1]
