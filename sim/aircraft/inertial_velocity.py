"""Velocity over the ground as the receiver's own inertial navigation gives it: true plus a drift.

    db = -b / T dt + sigma sqrt(2 / T) dw   per axis, stationary from t = 0                  (1)

drawn exactly at knots `KNOT_S` apart and linear in between: T is a thousand times longer, and so the drift is the same
function of time whatever the physics step. Without it a plant that regulates its velocity would hand over a noise-free
velocity relative to the tanker.
Not modelled: Schuler oscillation, noise of the accelerometers, correlation between the axes.
"""

import numpy as np

from dockair.kernels import njit
from dockair.rotations import Array

KNOT_S = 1.0


class InertialVelocity:
    """The drift b, one tick at a time.

    Args:
        sigma_m_s: standard deviation of each component.
        correlation_time_s: T.
        step_s: length of a tick.
        rng: the stream "inertial_velocity".
        frame_velocity_m_s: (3,) over the ground, of the frame in which velocities are handed in; at rest by default.
    """

    def __init__(
        self,
        sigma_m_s: float,
        correlation_time_s: float,
        step_s: float,
        rng: np.random.Generator,
        frame_velocity_m_s: Array | None = None,
    ) -> None:
        self._rng = rng
        self._decay = float(np.exp(-KNOT_S / correlation_time_s))
        self._kick_m_s = sigma_m_s * float(np.sqrt(-np.expm1(-2.0 * KNOT_S / correlation_time_s)))
        self._step_s, self._time_s, self._knot = step_s, 0.0, 0
        self._measured: Array = np.empty(3)
        self._rows = np.zeros((4, 3))  # drift at the knots before and after now, the frame's velocity, drift
        self._rows[0] = sigma_m_s * rng.standard_normal(3)
        self._rows[1] = self._drawn(self._rows[0])
        if frame_velocity_m_s is not None:
            self._rows[2] = frame_velocity_m_s
        self._rows[3] = self._rows[0]

    def step(self, velocity_m_s: Array) -> Array:
        """(3,) measured velocity over the ground [m/s] of a true one (3,), same axes; advances by one tick.

        The array is overwritten by the next step.
        """
        self._time_s += self._step_s
        while self._time_s >= (self._knot + 1) * KNOT_S:
            self._knot += 1
            self._rows[0], self._rows[1] = self._rows[1], self._drawn(self._rows[1])
        _measure(self._rows, self._time_s / KNOT_S - self._knot, velocity_m_s, self._measured)
        return self._measured

    @property
    def drift_m_s(self) -> Array:
        """(3,) b at the last step."""
        return np.array(self._rows[3])

    def _drawn(self, knot_m_s: Array) -> Array:
        return np.asarray(self._decay * knot_m_s + self._kick_m_s * self._rng.standard_normal(3))


@njit(cache=True)
def _measure(rows, share, velocity, measured):  # type: ignore[no-untyped-def]
    """Write the drift between two knots, and the velocity with it."""
    for i in range(3):
        rows[3, i] = (1.0 - share) * rows[0, i] + share * rows[1, i]
        measured[i] = velocity[i] + rows[2, i] + rows[3, i]
