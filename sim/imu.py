"""Rate gyro: bias, bandwidth, white noise, range, quantum.

    w_m = q round( clip( L[w] + b_0 + b + n, range ) / q )                                                       (1)
    L: second-order low-pass, w_c^2/(s^2 + 2 z w_c s + w_c^2), solved exactly for a rate that is linear
       between samples (first-order hold)                                                                        (2)
    n_k ~ N(0, N^2/dt) white,   b_0 ~ N(0, s_0^2) once at switch-on                                              (3)
    b_{k+1} = exp(-dt/tau) b_k + s_b sqrt(1 - exp(-2 dt/tau)) N(0, 1)      first-order Gauss-Markov               (4)

Between samples the rate is joined by straight lines, which by itself passes sinc^2(f dt): near half the sample rate the
hold, not the filter, sets the gain. N is the noise density in rad/s/sqrt(Hz); w_c = 2 pi bandwidth for a damping z of
0.707 (elsewhere the -3 dB point moves). The noise is added after the filter: a data sheet's density holds in the band.

Not modelled: scale factor, misalignment between the axes, g-sensitivity, rate random walk, time-stamp jitter.
Sources: IEEE Std 952-1997, annex C (noise terms); Franklin, Powell & Workman, Digital Control, section 6.3 (hold).
"""

import math
from dataclasses import dataclass

import numpy as np
from scipy.signal import cont2discrete

from dockair.errors import DockairError
from dockair.messages import ImuSample
from dockair.rotations import Array


@dataclass(frozen=True, slots=True, kw_only=True)
class GyroParameters:
    """Sheet `gyro`."""

    noise_density_rad_s_rthz: float
    turn_on_bias_sigma_rad_s: float
    bias_instability_rad_s: float
    bias_correlation_s: float
    bandwidth_hz: float
    damping_ratio: float
    range_rad_s: float
    quantum_rad_s: float


class Gyro:
    """Three rate gyros. Its state is the filter's, the bias and the generator's."""

    def __init__(
        self, parameters: GyroParameters, rate_hz: float, rng: np.random.Generator, R_BI: Array | None = None
    ) -> None:
        """Switch the gyro on: draw its turn-on bias.

        Args:
            parameters: sheet.
            rate_hz: at which `step` is called.
            rng: the stream "gyro".
            R_BI: (3, 3) its axes in the body's, as built; the body's own by default.

        Raises:
            DockairError: rate not positive.
        """
        if not rate_hz > 0.0:
            raise DockairError("gyro.rate_hz", expected="a rate > 0 Hz", got=rate_hz)
        self._p, self._rng = parameters, rng
        self._R_BI = np.eye(3) if R_BI is None else np.array(R_BI)
        dt = 1.0 / rate_hz
        self._A, self._B, self._C, self._D = low_pass(parameters.bandwidth_hz, parameters.damping_ratio, dt)
        self._x: Array | None = None  # (2, 3), of the filter; at rest in its first input
        self._turn_on_bias = parameters.turn_on_bias_sigma_rad_s * rng.standard_normal(3)
        self._drift = parameters.bias_instability_rad_s * rng.standard_normal(3)
        self._noise_sigma = parameters.noise_density_rad_s_rthz / math.sqrt(dt)
        self._decay = math.exp(-dt / parameters.bias_correlation_s)

    @property
    def bias_I(self) -> Array:
        """(3,) true bias at the last sample, gyro axes [rad/s]: truth, for logs and tests."""
        return np.asarray(self._turn_on_bias + self._drift)

    def step(self, time_s: float, w_WB_B: Array) -> ImuSample:
        """Return the sample at a time, Eq. (1).

        Args:
            time_s: becomes its stamp.
            w_WB_B: (3,) true angular velocity at that time, body axes [rad/s].
        """
        p = self._p
        w_I = self._R_BI.T @ np.asarray(w_WB_B, dtype=float)
        if self._x is None:
            self._x = np.linalg.solve(np.eye(2) - self._A, self._B) * w_I
        filtered = (self._C @ self._x + self._D * w_I)[0]
        self._x = self._A @ self._x + self._B * w_I
        white, walk = self._rng.standard_normal((2, 3))
        measured = filtered + self._turn_on_bias + self._drift + self._noise_sigma * white
        self._drift = self._decay * self._drift + p.bias_instability_rad_s * math.sqrt(1.0 - self._decay**2) * walk
        clipped = np.clip(measured, -p.range_rad_s, p.range_rad_s)
        return ImuSample(time_stamp_s=time_s, angular_rate_rad_s=p.quantum_rad_s * np.round(clipped / p.quantum_rad_s))


def low_pass(bandwidth_hz: float, damping_ratio: float, dt: float) -> tuple[Array, Array, Array, Array]:
    """Return A (2, 2), B (2, 1), C (1, 2), D (1, 1) of Eq. (2): y_k = C x_k + D u_k, x_{k+1} = A x_k + B u_k."""
    w = 2.0 * math.pi * bandwidth_hz
    a = np.array([[0.0, 1.0], [-(w**2), -2.0 * damping_ratio * w]])
    b, c, d = np.array([[0.0], [w**2]]), np.array([[1.0, 0.0]]), np.array([[0.0]])
    A, B, C, D, _ = cont2discrete((a, b, c, d), dt, method="foh")
    return A, B, C, D
