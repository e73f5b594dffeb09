"""What the receiver's flight control is told: attitude, rates, specific force and airspeed with their lag and noise.

    d(y)/dt = (x - y) / tau,     measured = y + sigma n                                                     (1)

for rates and specific force (tau of the inertial unit) and the airspeed (tau of the air data); the attitude is late by
the same time, R exp(-w tau), and off by a small rotation. n is drawn anew every `SAMPLE_S` and held, so that the noise
is the same function of time whatever the physics step.
Not modelled: biases (they act like a drift of the inertial velocity), scale factors, the air data's position error.
"""

from dataclasses import dataclass

import numpy as np
from numba import njit

from dockair.rotations import Array

SAMPLE_S = 0.01


@dataclass(frozen=True, slots=True, kw_only=True)
class OwnSensorsParameters:
    """Lags and standard deviations of one sample."""

    inertial_lag_s: float
    air_data_lag_s: float
    attitude_sigma_rad: float
    rate_sigma_rad_s: float
    specific_force_sigma_m_s2: float
    velocity_sigma_m_s: float
    airspeed_sigma_m_s: float

    @property
    def sigmas(self) -> Array:
        """(13,) attitude, rates, specific force, velocity, airspeed."""
        inertial = (self.attitude_sigma_rad, self.rate_sigma_rad_s, self.specific_force_sigma_m_s2)
        return np.append(np.repeat([*inertial, self.velocity_sigma_m_s], 3), self.airspeed_sigma_m_s)


class OwnSensors:
    """Eq. (1), one tick at a time.

    Args:
        parameters: lags and noise.
        step_s: length of a tick.
        rng: its own stream.
    """

    def __init__(self, parameters: OwnSensorsParameters, step_s: float, rng: np.random.Generator) -> None:
        self._rng, self._sigmas, self._step_s = rng, parameters.sigmas, step_s
        self._lag_s = parameters.inertial_lag_s
        self._shares = np.array([_share(self._lag_s, step_s)] * 6 + [_share(parameters.air_data_lag_s, step_s)])
        self._lagged = np.full(7, np.nan)  # rates, specific force, airspeed
        self._noise, self._ticks, self._drawn = np.zeros(13), 0, -1

    def step(
        self, R_WB: Array, w_WB_B: Array, specific_force_B: Array, velocity_W: Array, airspeed_m_s: float
    ) -> tuple[Array, Array, Array, Array, float]:
        """All five as measured, in the order and the axes of the arguments; advances by one tick."""
        sample = int(self._ticks * self._step_s / SAMPLE_S + 1e-6)
        if sample > self._drawn:
            self._noise, self._drawn = self._sigmas * self._rng.standard_normal(13), sample
        self._ticks += 1
        R, rest = _measure(
            self._lagged, self._shares, self._noise, self._lag_s, R_WB, w_WB_B, specific_force_B, airspeed_m_s
        )
        return R, rest[:3], rest[3:6], velocity_W + self._noise[9:12], float(rest[6])


def _share(lag_s: float, step_s: float) -> float:
    return -float(np.expm1(-step_s / lag_s)) if lag_s > 0.0 else 1.0


@njit(cache=True)
def _measure(lagged, shares, noise, lag, R_WB, w, f, airspeed):  # type: ignore[no-untyped-def]
    now, out = np.empty(7), np.empty(7)
    now[:3], now[3:6], now[6] = w, f, airspeed
    if np.isnan(lagged[6]):  # the first sample has settled
        lagged[:] = now
    for i in range(7):
        lagged[i] += shares[i] * (now[i] - lagged[i])
    out[:6], out[6] = lagged[:6] + noise[3:9], lagged[6] + noise[12]
    return R_WB @ _exp(noise[:3] - lag * w), out


@njit(cache=True)
def _exp(phi):  # type: ignore[no-untyped-def]
    """(3, 3) rotation matrix of a rotation vector (Rodrigues)."""
    t = np.sqrt(phi[0] * phi[0] + phi[1] * phi[1] + phi[2] * phi[2])
    a, b = (1.0, 0.5) if t < 1e-8 else (np.sin(t) / t, (1.0 - np.cos(t)) / (t * t))
    x, y, z = phi
    W = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    return np.eye(3) + a * W + b * (W @ W)
