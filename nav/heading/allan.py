"""Allan deviation of a gyro that stands still, and the noise terms that make it.

With the angle x_k = T (y_1 + ... + y_k) of rates y and t = m T, over all overlapping triples:

    var(t) = mean( (x_{k+2m} - 2 x_{k+m} + x_k)^2 ) / (2 t^2)                              (1)
    var(t) = 3 Q^2/t^2 + N^2/t + (B/0.6174)^2 G(t/T_B) + K^2 t/3                           (2)
    G(r)   = (2/r) (1 - (3 - 4 exp(-r) + exp(-2 r)) / (2 r))                               (3)

Q quantisation [rad], N angle random walk [rad/s/rt(Hz)], B bias instability [rad/s]: the floor of a first-order
Gauss-Markov bias, which lies at 1.893 T_B; K rate random walk [rad/s/rt(s)]. (2) is linear in the squares, which are
fitted by non-negative least squares; each t counts by its number of independent intervals, and T_B, where not given,
is the one that fits best.

Valid for a record that stands still, of at least some ten T_B: below T_B the terms of B and K have the same slope, and
a record that short cannot tell them apart. Several units' records, side by side, are averaged.
Sources: IEEE Std 952-1997, annex C; Riley, Handbook of Frequency Stability Analysis, NIST SP 1065 (1).
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike
from scipy.optimize import nnls

from dockair.errors import DockairError
from dockair.rotations import Array

__all__ = ["AllanCurve", "GyroNoise", "allan_deviation", "identify_gyro_noise"]

_FLOOR = 0.617364283  # highest Allan deviation of a Gauss-Markov process over its standard deviation
_LARGEST = 1e9  # of a sample, in any unit of a rate: above it stands a mark for a missing one, and squares overflow
_FEWEST_INTERVALS = 3  # of the longest averaging time, by default
_PER_DECADE = 10
_ROUNDS = 8  # of re-weighting by the model
_CORRELATIONS_PER_DECADE = 12
_LEAST_SHARE = 1e-30  # of the largest variance: of samples that cancel none is left, and its weight would be infinite
_LEAST_VARIANCE = 1e-100  # of a record that does not change at all: the square of a weight is still a number
_SMALL = 0.01  # r below which the next term of the series of G is a share of 1e-12


@dataclass(frozen=True, slots=True, eq=False)
class AllanCurve:
    """Overlapping Allan deviation, Eq. (1)."""

    taus_s: Array  #: (t,) averaging times
    deviation: Array  #: (t,) in the record's unit; of several records the root of the mean variance
    intervals: Array  #: (t,) how many independent pairs of averages fit into the records


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class GyroNoise:
    """Terms of Eq. (2), SI; a term that was not found is 0."""

    quantisation_rad: float
    noise_density_rad_s_rthz: float
    bias_instability_rad_s: float
    bias_correlation_s: float  #: T_B, NaN without bias instability
    rate_random_walk_rad_s_rts: float
    curve: AllanCurve
    fitted_rad_s: Array  #: (t,) Allan deviation of the terms at the curve's times


def allan_deviation(rates: ArrayLike, sample_rate_hz: float, taus_s: ArrayLike | None = None) -> AllanCurve:
    """Overlapping Allan deviation of one or several records of equal length.

    Args:
        rates: (n,) or (n, m) samples of m records, any unit.
        sample_rate_hz: of the samples.
        taus_s: averaging times, taken to the nearest whole number of samples; by default ten a decade, from one sample
            up to a third of the record.

    Raises:
        DockairError: fewer than three samples, a sample that is not finite or larger than any rate, a time that does
            not fit twice.
    """
    y = np.asarray(rates, dtype=float)
    y = y[:, None] if y.ndim == 1 else y
    if y.ndim != 2 or y.shape[0] < 3 or y.shape[1] == 0:
        raise DockairError("rates", expected="(n,) or (n, m) samples, n >= 3", got=f"shape {np.shape(rates)}")
    if not np.isfinite(y).all():
        raise DockairError("rates", expected="finite samples", got=f"{np.count_nonzero(~np.isfinite(y))} that are not")
    if not np.abs(y).max() < _LARGEST:
        raise DockairError("rates", expected=f"samples below {_LARGEST:g} in size", got=float(np.abs(y).max()))
    if not (np.isfinite(sample_rate_hz) and sample_rate_hz > 0.0):
        raise DockairError("sample_rate_hz", expected="a rate > 0", got=sample_rate_hz)
    counts = _counts(taus_s, len(y), sample_rate_hz)
    x = np.vstack([np.zeros(y.shape[1]), np.cumsum(y - y.mean(axis=0), axis=0)]) / sample_rate_hz
    taus = counts / sample_rate_hz
    variance = np.array([np.mean((x[2 * m :] - 2.0 * x[m:-m] + x[: -2 * m]) ** 2) for m in counts]) / (2.0 * taus**2)
    return AllanCurve(taus, np.sqrt(variance), y.shape[1] * (len(y) / counts - 1.0))


def identify_gyro_noise(
    rates_rad_s: ArrayLike, sample_rate_hz: float, *, bias_correlation_s: float | None = None, terms: str = "QNBK"
) -> GyroNoise:
    """Noise terms of a gyro that stood still, Eqs. (2) and (3).

    Args:
        rates_rad_s: (n,) or (n, m) records.
        sample_rate_hz: of the samples.
        bias_correlation_s: T_B where it is known from the data sheet.
        terms: which of Q, N, B, K to look for.

    Raises:
        DockairError: see `allan_deviation`; terms that do not exist; a record that never changes.
    """
    if not terms or set(terms) - set("QNBK") or len(set(terms)) < len(terms):
        raise DockairError("terms", expected="letters of the terms, each once", got=terms, exists=tuple("QNBK"))
    if bias_correlation_s is not None and not 0.0 < bias_correlation_s < _LARGEST:
        raise DockairError("bias_correlation_s", expected=f"a time > 0, below {_LARGEST:g} s", got=bias_correlation_s)
    curve = allan_deviation(rates_rad_s, sample_rate_hz)
    if not np.ptp(np.asarray(rates_rad_s, dtype=float), axis=0).all():
        raise DockairError("rates", expected="records of gyros that are on", got="one whose samples are all alike")
    candidates = [bias_correlation_s] if bias_correlation_s is not None else _correlations(curve.taus_s)
    if "B" not in terms:
        candidates = [1.0]
    fits = [(*_fit(curve, float(T), terms), float(T)) for T in candidates]
    squares, variance, _, T = min(fits, key=lambda fit: fit[2])
    found = dict(zip(terms, np.sqrt(squares), strict=True))
    return GyroNoise(
        quantisation_rad=float(found.get("Q", 0.0)),
        noise_density_rad_s_rthz=float(found.get("N", 0.0)),
        bias_instability_rad_s=float(found.get("B", 0.0)),
        bias_correlation_s=T if found.get("B", 0.0) > 0.0 else float("nan"),
        rate_random_walk_rad_s_rts=float(found.get("K", 0.0)),
        curve=curve,
        fitted_rad_s=np.sqrt(variance),
    )


def _counts(taus_s: ArrayLike | None, samples: int, rate_hz: float) -> Array:
    """(t,) samples of each averaging time."""
    if taus_s is None:
        most = max(samples // _FEWEST_INTERVALS, 1)
        return np.unique(np.round(np.geomspace(1, most, int(_PER_DECADE * np.log10(most)) + 1)).astype(int))
    counts = np.unique(np.round(np.atleast_1d(np.asarray(taus_s, dtype=float)) * rate_hz).astype(int))
    if counts.size == 0 or counts[0] < 1 or 2 * counts[-1] > samples:
        expected = f"times from {1.0 / rate_hz:g} to {samples // 2 / rate_hz:g} s"
        raise DockairError("taus_s", expected=expected, got=list(np.atleast_1d(taus_s)))
    return counts


def _correlations(taus_s: Array) -> Array:
    decades = np.log10(taus_s[-1] / taus_s[0])
    return np.geomspace(taus_s[0], taus_s[-1], int(_CORRELATIONS_PER_DECADE * decades) + 1)


def _gauss_markov(r: Array) -> Array:
    """G of Eq. (3); of a small r by its series, since the difference is r^2/3 and would be lost in rounding."""
    near = r * (2.0 / 3.0 - r * (1.0 / 2.0 - r * (7.0 / 30.0 - r * (1.0 / 12.0 - r * 31.0 / 1260.0))))
    return np.where(r < _SMALL, near, 2.0 / r * (1.0 - (3.0 - 4.0 * np.exp(-r) + np.exp(-2.0 * r)) / (2.0 * r)))


def _fit(curve: AllanCurve, T: float, terms: str) -> tuple[Array, Array, float]:
    """Squares of the terms, the variance they make, and how badly it fits (log-likelihood of chi-square variances)."""
    t, variance = curve.taus_s, curve.deviation**2
    columns = {"Q": 3.0 / t**2, "N": 1.0 / t, "B": _gauss_markov(t / T) / _FLOOR**2, "K": t / 3.0}
    A = np.column_stack([columns[term] for term in terms])
    least = max(_LEAST_SHARE * float(variance.max()), _LEAST_VARIANCE)
    model = np.maximum(variance, least)
    squares = np.zeros(len(terms))
    for _ in range(_ROUNDS):
        weight = np.sqrt(curve.intervals) / model
        scale = np.linalg.norm(A * weight[:, None], axis=0)
        squares = nnls(A * weight[:, None] / scale, variance * weight)[0] / scale
        model = np.maximum(A @ squares, least)
    misfit = float(np.sum(curve.intervals * (np.log(model) + variance / model)))
    return squares, model, misfit
