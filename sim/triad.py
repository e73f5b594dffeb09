"""Three inertial sensors of a kind at one place: gyros or accelerometers with all their errors.

    y_m = q round( clip( L[(I + S + M) y + G x] + b_0 + b_GM + b_RW + n, range ) / q )                           (1)
    L: second-order low-pass, w_c^2/(s^2 + 2 z w_c s + w_c^2), solved exactly for an input that is linear
       between samples (first-order hold)                                                                       (2)
    at switch-on:  S = diag N(0, s_S^2),  M N(0, s_M^2) off the diagonal,  G N(0, s_G^2),  b_0 ~ N(0, s_0^2)     (3)
    n_k ~ N(0, N^2/dt)                                              white noise, density N                      (4)
    b_GM <- e b_GM + s sqrt(1 - e^2) N(0, 1),  e = exp(-dt/T),  s = B/0.6174      bias instability B            (5)
    b_RW <- b_RW + K sqrt(dt) N(0, 1),  0 at switch-on                            random walk K                 (6)

y is what they should feel, x what they should not (for gyros the specific force).

N, B and K are Allan coefficients: their parts of the Allan deviation at t are N/sqrt(t), at most B, K sqrt(t/3). B is
what a data sheet calls in-run bias stability, the floor of the curve: a Gauss-Markov process of standard deviation s
has its highest Allan deviation, 0.6174 s, at 1.893 T. (sqrt(2 ln 2/pi) = 0.664 belongs to 1/f noise.)

Samples are joined by straight lines, which by itself passes sinc^2(f dt): near half the sample rate the hold, not the
filter, sets the gain. w_c = 2 pi bandwidth for a damping z of 0.707 (elsewhere the -3 dB point moves). The noise comes
after the filter.

Not modelled: non-linearity, temperature, dead time, vibration rectification, the noise's own bandwidth.
Sources: IEEE Std 952-1997, annex C (noise terms); Franklin, Powell & Workman, Digital Control, section 6.3 (hold).
"""

import math
from dataclasses import dataclass

import numpy as np
from scipy.signal import cont2discrete

from dockair.kernels import njit
from dockair.rotations import Array

_BLOCK = 64  # samples whose random numbers are drawn at a time, at least
GAUSS_MARKOV_PEAK = 0.617364283  # highest Allan deviation of Eq. (5) over its standard deviation


@dataclass(frozen=True, slots=True, kw_only=True)
class TriadParameters:
    """Half of an IMU's sheet, in the sensors' own unit."""

    noise_density: float
    bias_instability: float
    bias_correlation_s: float
    random_walk: float
    turn_on_bias_sigma: float
    scale_factor_sigma: float
    misalignment_sigma: float
    cross_sensitivity_sigma: float
    bandwidth_hz: float
    damping_ratio: float
    range: float
    quantum: float


class Triad:
    """Its state is the filter's, the biases' and the generator's."""

    def __init__(self, sheet: TriadParameters, rate_hz: float, rng: np.random.Generator) -> None:
        """Switch on: draw what stays as it is, Eq. (3), and the first b_GM."""
        self._rng, self._range = rng, sheet.range
        dt = 1.0 / rate_hz
        drawn = rng.standard_normal((8, 3))  # the same numbers are drawn whatever the sigmas
        M = sheet.misalignment_sigma * drawn[:3]
        np.fill_diagonal(M, sheet.scale_factor_sigma * np.diag(drawn[:3]))
        self._gain = np.eye(3) + M
        self._cross = sheet.cross_sensitivity_sigma * drawn[3:6]
        self._turn_on = sheet.turn_on_bias_sigma * drawn[6]
        sigma = sheet.bias_instability / GAUSS_MARKOV_PEAK
        decay = math.exp(-dt / sheet.bias_correlation_s)
        self._laws = np.array([
            sheet.noise_density / math.sqrt(dt),
            decay,
            sigma * math.sqrt(1.0 - decay**2),
            sheet.random_walk * math.sqrt(dt),
            sheet.quantum,
        ])  # fmt: skip
        A, B, C, D = low_pass(sheet.bandwidth_hz, sheet.damping_ratio, dt)
        self._filter = np.block([[A, B], [C, D]])
        self._at_rest = np.linalg.solve(np.eye(2) - A, B)[:, 0]  # filter's state per unit of a steady input
        self._state = np.zeros((4, 3))  # filter (2), b_GM, b_RW
        self._state[2] = sigma * drawn[7]
        self._started = False
        self._normal, self._used = np.empty((0, 3, 3)), 0  # numbers drawn ahead, in the order of use

    @property
    def bias(self) -> Array:
        """(3,) b_0 + b_GM + b_RW of the last sample."""
        return np.asarray(self._turn_on + self._state[2] + self._state[3])

    def sense(self, main: Array, other: Array, extra_bias: Array | None = None, limit: float = math.inf) -> Array:
        """(n, 3) samples of n inputs, Eq. (1).

        Args:
            main: (n, 3) y.
            other: (n, 3) x.
            extra_bias: (3,) of a fault.
            limit: of a fault: range that holds where it is less than the sheet's.
        """
        z = self._drawn(len(main))
        bias = self._turn_on if extra_bias is None else self._turn_on + extra_bias
        if not self._started:
            first = self._gain @ main[0] + self._cross @ other[0]
            self._state[:2] = np.outer(self._at_rest, first)
            self._started = True
        limit = min(limit, self._range)
        return _sense(main, other, z, bias, limit, self._gain, self._cross, self._filter, self._laws, self._state)

    def _drawn(self, n: int) -> Array:
        """(n, 3, 3) standard normal numbers, the same however many are asked for at a time."""
        if self._used + n > len(self._normal):
            new = self._rng.standard_normal((max(n, _BLOCK), 3, 3))
            self._normal, self._used = np.concatenate([self._normal[self._used :], new]), 0
        self._used += n
        z: Array = self._normal[self._used - n : self._used]
        return z


@njit(cache=True)
def _sense(
    main: Array,
    other: Array,
    z: Array,
    constant_bias: Array,
    limit: float,
    gain: Array,
    cross: Array,
    low: Array,
    laws: Array,
    state: Array,
) -> Array:
    """(n, 3) samples, Eqs. (1), (4) to (6); z (n, 3, 3) are standard normal numbers, state (4, 3) moves on."""
    sigma, decay, kick, walk, quantum = laws
    out = np.empty_like(main)
    for k in range(len(main)):
        for i in range(3):
            u = 0.0
            for a in range(3):
                u += gain[i, a] * main[k, a] + cross[i, a] * other[k, a]
            x0, x1 = state[0, i], state[1, i]
            y = low[2, 0] * x0 + low[2, 1] * x1 + low[2, 2] * u
            state[0, i] = low[0, 0] * x0 + low[0, 1] * x1 + low[0, 2] * u
            state[1, i] = low[1, 0] * x0 + low[1, 1] * x1 + low[1, 2] * u
            state[2, i] = decay * state[2, i] + kick * z[k, 1, i]
            state[3, i] += walk * z[k, 2, i]
            m = y + constant_bias[i] + state[2, i] + state[3, i] + sigma * z[k, 0, i]
            out[k, i] = quantum * np.rint(min(max(m, -limit), limit) / quantum)
    return out


def low_pass(bandwidth_hz: float, damping_ratio: float, dt: float) -> tuple[Array, Array, Array, Array]:
    """Return A (2, 2), B (2, 1), C (1, 2), D (1, 1) of Eq. (2): y_k = C x_k + D u_k, x_{k+1} = A x_k + B u_k."""
    w = 2.0 * math.pi * bandwidth_hz
    a = np.array([[0.0, 1.0], [-(w**2), -2.0 * damping_ratio * w]])
    b, c, d = np.array([[0.0], [w**2]]), np.array([[1.0, 0.0]]), np.array([[0.0]])
    A, B, C, D, _ = cont2discrete((a, b, c, d), dt, method="foh")
    return A, B, C, D
