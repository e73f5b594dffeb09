"""The electronics' kernels: random numbers that are a function of the pixel's place, and rows of pixels made with them.

    key(row) = SplitMix64 of (key, frame, row);   bits(column) = lowbias32(low half + column x odd high half)     (1)
    z(bits): sign, and the normal quantile of p = (31 bits + 1/2)/2^32 as a polynomial in sqrt(-2 ln p)            (2)

All is IEEE single precision, with every fused multiply-add written out and no reassociation allowed, so that the
compiler's vectors, its remainder loops and single pixels give the same bits. The equations are those of `electronics`.
A row is done with one normal number a pixel; a second pass puts right the pixels near full well, if it has any.

Not modelled: more than 6.3 standard deviations, where 31 bits end.
Sources: Steele, Lea & Flood 2014 (SplitMix64); C. Wellons, hash-prospector (lowbias32); the polynomials are minimax
fits made for this module.
"""

from typing import Any, NamedTuple

import numpy as np
from numba import types
from numba.extending import intrinsic
from numpy.typing import NDArray
from scipy.stats import poisson

from dockair.kernels import njit
from dockair.rotations import Array

Reals = NDArray[np.float32]
Bytes = NDArray[np.int8]
Levels = NDArray[np.unsignedinteger]
Real = float | np.float32
Place = tuple[int, int]  #: row and column on the sensor, or rows and columns

EXACT_BELOW_E = 4.0  #: read noise [e-] under which shot noise is drawn from the exact law
POISSON_LIMIT = 30.0  #: electrons above which the exact law gives way to a normal number with the right skew
_STEPS = 4  # tabled Poisson laws per electron
LANES = 64  #: pixels that are worked on at once
_GUIDE = 64  # cells of the guide into each tabled law

#: ln(1 + m) on [sqrt(1/2) - 1, sqrt(2) - 1] to 9e-6; highest power first.
_LOGARITHM = tuple(np.float32(a) for a in (0.17595085, -0.27520533, 0.33756348, -0.49901286, 0.99989904, -6.4225908e-6))
#: Normal quantile against t = sqrt(-2 ln p), 2^-33 < p <= 1/2, to 4.5e-4, and 3e-5 in p with the logarithm's error.
_QUANTILE = tuple(
    np.float32(a)
    for a in (3.3606274e-5, -1.0027991e-3, 1.2607127e-2, -8.7266771e-2, 0.36601241, -0.97220293, 2.702126, -2.2893636)
)


class Chain(NamedTuple):
    """Eqs. (1) to (4); the rows are done in single precision."""

    dark_e: Real
    full_well_e: Real
    near_e: Real  #: from here to the next both noises are drawn
    far_e: Real
    read_noise_e: Real
    variance_e2: Real  #: of the read noise
    gain_step: Real
    offset_step_e: Real
    gain_dn_e: Real
    black_dn: Real  #: half a level included, for the rounding
    top_dn: Real
    shift: int | np.int32


def _poisson_tables() -> tuple[Array, NDArray[np.int16]]:
    lam = np.arange(int(POISSON_LIMIT * _STEPS) + 1)[:, None] / _STEPS
    counts = np.arange(int(POISSON_LIMIT + 12.0 * np.sqrt(POISSON_LIMIT)))
    cdf = poisson.cdf(counts, lam)
    cdf[:, -1] = 1.0  # sentinel: the search always ends
    edges = np.arange(_GUIDE) / _GUIDE
    guide = np.array([np.searchsorted(row, edges, side="right") for row in cdf], dtype=np.int16)
    return cdf, guide


POISSON_CDF, POISSON_GUIDE = _poisson_tables()


def _fused_multiply_add(typing_context: Any, a: Any, b: Any, c: Any) -> Any:
    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        return builder.fma(*arguments)

    return types.float32(types.float32, types.float32, types.float32), generate


fma: Any = intrinsic(_fused_multiply_add)  #: of three float32, a b + c rounded once


@njit(cache=True)
def row_key(key: np.uint64, frame_number: int, row: int) -> np.uint64:
    """Return 64 random bits of a row (SplitMix64's finaliser, once for each counter)."""
    x = np.uint64(key)
    for counter in (frame_number, row):
        x += np.uint64(counter + 1) * np.uint64(0x9E3779B97F4A7C15)
        x = (x ^ (x >> np.uint64(30))) * np.uint64(0xBF58476D1CE4E5B9)
        x = (x ^ (x >> np.uint64(27))) * np.uint64(0x94D049BB133111EB)
        x ^= x >> np.uint64(31)
    return x


@njit(cache=True)
def mix(x: np.uint32) -> np.uint32:
    """Return 32 random bits for 32 bits that differ: lowbias32."""
    x = np.uint32(np.uint32(x ^ (x >> np.uint32(16))) * np.uint32(0x7FEB352D))
    x = np.uint32(np.uint32(x ^ (x >> np.uint32(15))) * np.uint32(0x846CA68B))
    return np.uint32(x ^ (x >> np.uint32(16)))


@njit(cache=True)
def normal_from_bits(bits: np.uint32) -> np.float32:
    """Return a standard normal number from 32 random bits: one of sign, 31 through the quantile. |z| < 6.4."""
    f = np.float32(np.float32(np.int32(bits & np.uint32(0x7FFFFFFF))) + np.float32(0.5))  # 2^32 p
    shifted = np.int32(f.view(np.int32) - np.int32(0x3F3504F3))  # 0x3F3504F3 is sqrt(1/2): f = (1 + m) 2^k
    k = np.float32(shifted >> np.int32(23))
    m = np.int32((shifted & np.int32(0x7FFFFF)) + np.int32(0x3F3504F3)).view(np.float32) - np.float32(1.0)
    log = _LOGARITHM[0]
    for a in _LOGARITHM[1:]:
        log = fma(log, m, a)
    log = fma(np.float32(0.6931472), k - np.float32(32.0), log)
    t = np.sqrt(np.float32(-2.0) * log)
    z = _QUANTILE[0]
    for a in _QUANTILE[1:]:
        z = fma(z, t, a)
    sign = np.int32(bits & np.uint32(0x80000000))
    return np.int32(np.float32(z).view(np.int32) ^ sign).view(np.float32)


@njit(cache=True)
def poisson_from_uniforms(expected: float, u0: float, u1: float, cdf: Array, guide: NDArray[np.int16]) -> int:
    """Return a Poisson number of mean `expected` in [0, 30) from two uniform numbers in [0, 1)."""
    j = int(expected * 4.0)
    n = int(guide[j, int(u0 * 64.0)])
    while u0 >= cdf[j, n]:
        n += 1
    rest = expected - 0.25 * j
    if u1 >= 1.0 - rest:  # exp(-d) >= 1 - d: below it the second part is 0, most of the time
        p = np.exp(-rest)
        total, k = p, 0
        while u1 >= total and k < 20:
            k += 1
            p *= rest / k
            total += p
        n += k
    return n


@njit(cache=True)
def count_from_normal(expected: float, z: float) -> float:
    """Return a whole number with a Poisson law's mean, variance and skew, for `expected` >= 30."""
    # Rounding adds 1/12 to the variance, the term in z^2 another 1/18.
    return np.rint(expected + np.sqrt(expected - 5.0 / 36.0) * z + (z * z - 1.0) / 6.0)


@njit(cache=True)
def _electrons(x: np.float32, g: np.int8, row_gain: np.float32, chain: Chain) -> np.float32:
    """Expected electrons of a pixel, Eq. (1)."""
    return fma(x, fma(np.float32(row_gain * chain.gain_step), np.float32(g), row_gain), chain.dark_e)


@njit(cache=True)
def _level(m: np.float32, o: np.int8, c: np.float32, chain: Chain) -> np.int32:
    """Output for electrons without their offsets, Eqs. (3) and (4)."""
    with_offsets = fma(chain.offset_step_e, np.float32(o), np.float32(m + c))
    y = fma(chain.gain_dn_e, with_offsets, chain.black_dn)
    return np.int32(min(max(y, np.float32(0.0)), chain.top_dn)) >> chain.shift


@njit(cache=True)
def fill_normals(out: Reals, key: np.uint64, frame_number: int, start: Place) -> None:
    """Fill (rows, columns) from a place of the sensor on with z of a frame's pixels, Eq. (2)."""
    for r in range(out.shape[0]):
        seed, step = _row_bits(key, frame_number, start[0] + r, start[1])
        _fill_row(out[r], seed, step)


@njit(cache=True)
def _fill_row(out: Reals, seed: np.uint32, step: np.uint32) -> None:
    """Fill a row; seed and step are `_row_bits`'."""
    for i in range(out.size):
        out[i] = normal_from_bits(mix(np.uint32(seed + np.uint32(i) * step)))


@njit(cache=True)
def _row_bits(key: np.uint64, frame_number: int, row: int, first: int) -> tuple[np.uint32, np.uint32]:
    """Return what the bits of a row's pixels from column `first` on begin at, and their step, Eq. (1)."""
    bits = row_key(key, frame_number, row)
    step = np.uint32(bits >> np.uint64(32)) | np.uint32(1)  # odd: no two columns alike
    return np.uint32(np.uint32(bits & np.uint64(0xFFFFFFFF)) + np.uint32(first) * step), step


@njit(cache=True, error_model="numpy")
def _row(
    x: Reals,
    z: Reals,
    gain: Bytes,
    offset: Bytes,
    column: Reals,
    out: Levels,
    row_gain: np.float32,
    chain: Chain,
) -> np.int32:
    """Digitise a row away from full well by Eq. (5), and beyond it: one normal number a pixel.

    Returns the bits of the most expected electrons: of numbers that are not negative they rise as these do.
    """
    highest = np.int32(0)
    for i in range(out.size):
        e = _electrons(x[i], gain[i], row_gain, chain)
        highest = max(highest, np.float32(e).view(np.int32))
        kept = min(e, chain.full_well_e)
        shot = e if e < chain.far_e else np.float32(0.0)
        v = np.float32(shot + chain.variance_e2)
        skew = np.float32(np.float32(0.16666667) * shot / v)
        m = fma(skew, fma(z[i], z[i], np.float32(-1.0)), fma(np.sqrt(v), z[i], kept))
        out[i] = _level(m, offset[i], column[i], chain)
    return highest


@njit(cache=True)
def _row_near_full_well(
    x: Reals,
    gain: Bytes,
    offset: Bytes,
    column: Reals,
    out: Levels,
    seed: np.uint32,
    step: np.uint32,
    row_gain: np.float32,
    chain: Chain,
) -> None:
    """Put right the row's pixels where the well clips some of the shot noise: two normal numbers each."""
    for i in range(out.size):
        bits = mix(np.uint32(seed + np.uint32(i) * step))
        z = normal_from_bits(bits)
        e = _electrons(x[i], gain[i], row_gain, chain)
        n = fma(np.sqrt(e), z, fma(np.float32(0.16666667), fma(z, z, np.float32(-1.0)), e))
        r = normal_from_bits(mix(np.uint32(bits ^ np.uint32(0x9E3779B9))))
        level = _level(fma(chain.read_noise_e, r, min(n, chain.full_well_e)), offset[i], column[i], chain)
        out[i] = level if chain.near_e <= e < chain.far_e else out[i]


@njit(cache=True)
def _row_exact(
    x: Reals,
    gain: Bytes,
    offset: Bytes,
    column: Reals,
    out: Levels,
    seed: np.uint32,
    step: np.uint32,
    row_gain: np.float32,
    chain: Chain,
    cdf: Array,
    guide: NDArray[np.int16],
) -> None:
    """Digitise a row whose read noise does not hide that electrons are counted."""
    for i in range(out.size):
        bits = mix(np.uint32(seed + np.uint32(i) * step))
        more = mix(np.uint32(bits ^ np.uint32(0x9E3779B9)))
        e = _electrons(x[i], gain[i], row_gain, chain)
        if e < 30.0:
            u1 = mix(np.uint32(more ^ np.uint32(0x9E3779B9))) / 4294967296.0
            n = np.float32(poisson_from_uniforms(float(e), bits / 4294967296.0, u1, cdf, guide))
        else:
            n = np.float32(count_from_normal(float(e), float(normal_from_bits(bits))))
        m = fma(chain.read_noise_e, normal_from_bits(more), min(n, chain.full_well_e))
        out[i] = _level(m, offset[i], column[i], chain)


@njit(cache=True)
def _single(a: Chain) -> Chain:
    f = np.float32
    return Chain(
        *(f(a.dark_e), f(a.full_well_e), f(a.near_e), f(a.far_e), f(a.read_noise_e), f(a.variance_e2)),
        *(f(a.gain_step), f(a.offset_step_e), f(a.gain_dn_e), f(a.black_dn), f(a.top_dn), np.int32(a.shift)),
    )


@njit(cache=True)
def digitise_rows(
    x: Reals,
    gain: Bytes,
    offset: Bytes,
    column: Reals,
    out: Levels,
    key: np.uint64,
    frame_number: int,
    start: Place,
    parasitic: tuple[float, float, float, float],
    in_double: Chain,
    exact: bool,
    cdf: Array,
    guide: NDArray[np.int16],
    ahead: Reals,
    ahead_start: Place,
) -> None:
    """Fill `out` with the levels of a window that starts at `start`; gain, offset and column are the sensor's.

    `parasitic` are P, t, the first row's wait and a row's time, of Eq. (1) there. `ahead` (rows, columns) are normal
    numbers of this frame that are known already, from `ahead_start` on the sensor; none if they do not hold the window.
    """
    rows, columns = x.shape
    first, chain = start[1], _single(in_double)
    # A row goes on into the next, whose turn is later, up to whole lanes: single pixels take ten times as long
    padded = padded_columns(columns, first, gain.shape[1])
    flat, levels, line = x.ravel(), out.ravel(), np.empty(padded, np.float32)
    near = np.float32(chain.near_e).view(np.int32)
    sensitivity, exposure_s, overhead_s, row_s = parasitic
    down, right = start[0] - ahead_start[0], first - ahead_start[1]
    for r in range(rows):
        waits_s = overhead_s + (start[0] + r) * row_s
        row_gain = np.float32(1.0 + sensitivity * waits_s / exposure_s)
        seed, step = _row_bits(key, frame_number, r + start[0], first)
        begin, end = r * columns, min(r * columns + padded, flat.size)
        last = first + end - begin
        g, o, c = gain[r + start[0], first:last], offset[r + start[0], first:last], column[first:last]
        if exact:
            _row_exact(x[r], g, o, c, out[r], seed, step, row_gain, chain, cdf, guide)
            continue
        z = line[: end - begin]
        if ahead.size > 0:
            z = ahead[r + down, right : right + end - begin]
        else:
            _fill_row(z, seed, step)
        highest = _row(flat[begin:end], z, g, o, c, levels[begin:end], row_gain, chain)
        if highest >= near:
            _row_near_full_well(x[r], g, o, c, out[r], seed, step, row_gain, chain)


@njit(cache=True)
def padded_columns(columns: int, first: int, sensor_columns: int) -> int:
    """How many pixels of a row are worked on: whole lanes, as far as the sensor goes."""
    return min((columns + LANES - 1) // LANES * LANES, sensor_columns - first)
