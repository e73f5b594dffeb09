"""Velocity over the ground as the receiver's own inertial navigation gives it: true plus a drift.

    db = -b / T dt + sigma sqrt(2 / T) dw   per axis, stationary from t = 0                  (1)

advanced exactly from tick to tick. Without it a plant that regulates its velocity would hand over a noise-free velocity
relative to the tanker.
Not modelled: Schuler oscillation, noise of the accelerometers, correlation between the axes.
"""

import numpy as np

from dockair.rotations import Array


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
        self._decay = float(np.exp(-step_s / correlation_time_s))
        self._kick_m_s = sigma_m_s * float(np.sqrt(-np.expm1(-2.0 * step_s / correlation_time_s)))
        self.drift_m_s: Array = sigma_m_s * rng.standard_normal(3)

    def step(self, velocity_m_s: Array) -> Array:
        """(3,) measured velocity [m/s] of a true one (3,), in the same axes; advances the drift by one tick."""
        self.drift_m_s = self._decay * self.drift_m_s + self._kick_m_s * self._rng.standard_normal(3)
        return np.asarray(velocity_m_s + self.drift_m_s)
