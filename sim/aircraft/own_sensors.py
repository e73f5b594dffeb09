"""What the receiver's flight control is told: attitude, rates, specific force and airspeed with their lag and noise.

    d(y)/dt = (x - y) / tau,     measured = y + sigma n                                                     (1)

for rates and specific force (tau of the inertial unit) and the airspeed (tau of the air data); the attitude is late by
the same time, R exp(-w tau), and off by a small rotation. n is drawn anew every `SAMPLE_S` and held, so that the noise
is the same function of time whatever the physics step.
Not modelled: biases (they act like a drift of the inertial velocity), scale factors, the air data's position error.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from dockair.kernels import njit
from dockair.rotations import Array

SAMPLE_S = 0.01

_MEMORY = np.dtype(
    [
        ("lag_s", float),  # of the inertial unit
        ("shares", float, 7),  # of a tick, in tau: rates, specific force, airspeed
        ("lagged", float, 7),  # y, likewise; not a number until the first sample
        ("noise", float, 13),  # sigma n: attitude, rates, specific force, velocity, airspeed
    ]
)


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
        self._memory: NDArray[np.void] = np.zeros((), _MEMORY)
        m, lag_s = self._memory, parameters.inertial_lag_s
        m["lag_s"], m["lagged"] = lag_s, np.nan
        m["shares"] = [_share(lag_s, step_s)] * 6 + [_share(parameters.air_data_lag_s, step_s)]
        self._measured = np.empty((3, 3)), np.empty(3), np.empty(3), np.empty(3)
        self._ticks, self._drawn = 0, -1

    def step(
        self, R_WB: Array, w_WB_B: Array, specific_force_B: Array, velocity_W: Array, airspeed_m_s: float
    ) -> tuple[Array, Array, Array, Array, float]:
        """All five as measured, in the order and the axes of the arguments; advances by one tick.

        The arrays are overwritten by the next step.
        """
        sample = int(self._ticks * self._step_s / SAMPLE_S + 1e-6)
        if sample > self._drawn:
            self._memory["noise"], self._drawn = self._sigmas * self._rng.standard_normal(13), sample
        self._ticks += 1
        R, w, f, v = self._measured
        airspeed = _measure(self._memory, R_WB, w_WB_B, specific_force_B, velocity_W, airspeed_m_s, R, w, f, v)
        return R, w, f, v, airspeed


def _share(lag_s: float, step_s: float) -> float:
    return -float(np.expm1(-step_s / lag_s)) if lag_s > 0.0 else 1.0


@njit(cache=True)
def _measure(memory, R_WB, w, f, v, airspeed, R_out, w_out, f_out, v_out):  # type: ignore[no-untyped-def]
    """Write what is measured; return the airspeed."""
    m = memory[()]
    lag, shares, lagged, noise = m.lag_s, m.shares, m.lagged, m.noise
    settled = not np.isnan(lagged[6])
    for i in range(7):
        now = w[i] if i < 3 else f[i - 3] if i < 6 else airspeed
        if not settled:  # the first sample has settled
            lagged[i] = now
        lagged[i] += shares[i] * (now - lagged[i])
    for i in range(3):
        w_out[i], f_out[i] = lagged[i] + noise[3 + i], lagged[3 + i] + noise[6 + i]
        v_out[i] = v[i] + noise[9 + i]
    turn = _exp(noise[0] - lag * w[0], noise[1] - lag * w[1], noise[2] - lag * w[2])
    for i in range(3):
        for j in range(3):
            R_out[i, j] = R_WB[i, 0] * turn[j] + R_WB[i, 1] * turn[3 + j] + R_WB[i, 2] * turn[6 + j]
    return lagged[6] + noise[12]


@njit(cache=True)
def _exp(x, y, z):  # type: ignore[no-untyped-def]
    """Rotation matrix, row by row, of a rotation vector (Rodrigues)."""
    t2 = x * x + y * y + z * z
    t = np.sqrt(t2)
    a, b = (1.0, 0.5) if t < 1e-8 else (np.sin(t) / t, (1.0 - np.cos(t)) / t2)
    c = 1.0 - b * t2
    return (
        c + b * x * x, b * x * y - a * z, b * x * z + a * y,
        b * x * y + a * z, c + b * y * y, b * y * z - a * x,
        b * x * z - a * y, b * y * z + a * x, c + b * z * z,
    )  # fmt: skip
