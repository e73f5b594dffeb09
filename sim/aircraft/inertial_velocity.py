"""Velocity over the ground as the receiver's own inertial navigation gives it: true plus a drift.

    db = -b / T dt + sigma sqrt(2 / T) dw   per axis, stationary from t = 0                  (1)

drawn exactly at knots `KNOT_S` apart and linear in between: T is hundreds of times longer, and so the drift is the same
function of time whatever the physics step. Without it a plant that regulates its velocity would hand over a noise-free
velocity relative to the tanker.
Not modelled: Schuler oscillation, noise of the accelerometers, correlation between the axes.
"""

import numpy as np

from dockair.rotations import Array

KNOT_S = 1.0


class InertialVelocity:
    """The drift b, one tick at a time.

    Args:
        sigma_m_s: standard deviation of each component.
        correlation_time_s: T.
        step_s: length of a tick.
        rng: the stream "inertial_velocity".
    """

    def __init__(self, sigma_m_s: float, correlation_time_s: float, step_s: float, rng: np.random.Generator) -> None:
        self._rng = rng
        self._decay = float(np.exp(-KNOT_S / correlation_time_s))
        self._kick_m_s = sigma_m_s * float(np.sqrt(-np.expm1(-2.0 * KNOT_S / correlation_time_s)))
        self._step_s, self._time_s, self._knot = step_s, 0.0, 0
        self._before: Array = sigma_m_s * rng.standard_normal(3)
        self._after: Array = self._drawn(self._before)
        self.drift_m_s: Array = self._before.copy()

    def step(self, velocity_m_s: Array) -> Array:
        """(3,) measured velocity [m/s] of a true one (3,), in the same axes; advances the drift by one tick."""
        self._time_s += self._step_s
        while self._time_s >= (self._knot + 1) * KNOT_S:
            self._knot += 1
            self._before, self._after = self._after, self._drawn(self._after)
        share = self._time_s / KNOT_S - self._knot
        self.drift_m_s = (1.0 - share) * self._before + share * self._after
        return np.asarray(velocity_m_s + self.drift_m_s)

    def _drawn(self, knot_m_s: Array) -> Array:
        return np.asarray(self._decay * knot_m_s + self._kick_m_s * self._rng.standard_normal(3))
