"""From expected electrons to grey levels: pattern, dark current, shot noise, full well, read noise, gain, conversion.

    e = (1 + g) (1 + P w/t) x + D t,   D = D_ref 2^((T - T_ref)/T_d)                                             (1)
    n ~ Poisson(e)                                                                                               (2)
    m = min(n, full well) + o + c + r,   r ~ N(0, s^2)                                                           (3)
    raw = floor(K m + black level + 1/2), clipped to [0, 2^bits - 1];   output = raw >> (bits - 8)               (4)

x expected photo-electrons, t exposure, P parasitic light sensitivity, w the row's wait for its read-out; g, o, c the
fixed pattern; s the read noise; K at 10 bits, four times as much at 12.

Away from full well, n + r is one number: its first three cumulants are e + s^2 = v, and the skew e of the Poisson law,

    n + r = e + sqrt(v) z + e/(6 v) (z^2 - 1),   z ~ N(0, 1)   (Cornish and Fisher)                              (5)

off by at most 5e-5 in distribution for 13 e- of read noise, 3e-4 for 4 e-. Within 6 standard deviations of full well
shot and read noise are drawn apart. For less than 4 e- of read noise n is a whole number: a Poisson(j/4) from a table
plus a Poisson(d), d < 1/4, add up to Poisson(j/4 + d); above 30 e- Eq. (5) with s = 0, rounded (1e-3 in distribution).

Every random number is a hash of (key, frame, row, column), so a pixel reads the same in a window and in the full
frame, and no frame depends on which were taken before it. The kernels use IEEE single precision with every fused
multiply-add written out, so that the compiler's vectors and its remainder loops give the same bits.

Not modelled: non-linearity below full well; dark current while a row waits; motion of the scene while it waits; the
wait is that of the row's place in a full read-out (a window's rows wait less: this is the upper bound).
Sources: EMVA 1288 release 4.0 (linear model); CMV2000 data sheet v3.8; Cornish & Fisher 1938; hashes: Steele, Lea &
Flood 2014 (SplitMix64, rows), C. Wellons, hash-prospector (lowbias32, pixels).
"""

from typing import NamedTuple

import numpy as np
from numba import njit, types
from numba.extending import intrinsic
from numpy.typing import NDArray
from scipy.stats import poisson

from dockair.errors import DockairError
from dockair.rotations import Array
from dockair.sim.camera.fixed_pattern import FixedPattern
from dockair.sim.camera.readout import overhead_time_s, row_time_s
from dockair.sim.camera.sheets import SensorParameters

OUTPUT_BITS = 8  #: of CameraFrame.pixels
EXACT_BELOW_E = 4.0  #: read noise [e-] under which shot noise is drawn from the exact law
POISSON_LIMIT = 30.0  #: electrons above which the exact law gives way to Eq. (5)
_STATED_BITS = 10  # that the sheet's gain and black level are stated for
_REACH = 6.0  # standard deviations of shot noise around full well within which both noises are drawn
_STEPS = 4  # tabled Poisson laws per electron
_GUIDE = 64  # cells of the guide into each tabled law

#: ln(1 + m) on [sqrt(1/2) - 1, sqrt(2) - 1], minimax, 9e-6; highest power first.
_LOGARITHM = tuple(np.float32([0.17595085, -0.27520533, 0.33756348, -0.49901286, 0.99989904, -6.4225908e-6]))
#: Normal quantile of p against t = sqrt(-2 ln p), p in [2^-33, 1/2], minimax weighted by the density, 2.3e-5 in p (3e-5 with the logarithm's).
_QUANTILE = tuple(
    np.float32(
        [3.3606274e-5, -1.0027991e-3, 1.2607127e-2, -8.7266771e-2, 3.6601241e-1, -9.7220293e-1, 2.702126, -2.2893636]
    )
)


class _Chain(NamedTuple):
    """Eqs. (1) to (4) in single precision."""

    dark_e: np.float32
    full_well_e: np.float32
    near_e: np.float32  #: from here to the next both noises are drawn
    far_e: np.float32
    read_noise_e: np.float32
    variance_e2: np.float32  #: of the read noise
    gain_step: np.float32
    offset_step_e: np.float32
    gain_dn_e: np.float32
    black_dn: np.float32  #: half a level included, for the rounding
    top_dn: np.float32
    shift: np.int32


def _poisson_tables() -> tuple[Array, NDArray[np.int16]]:
    lam = np.arange(int(POISSON_LIMIT * _STEPS) + 1)[:, None] / _STEPS
    counts = np.arange(int(POISSON_LIMIT + 12.0 * np.sqrt(POISSON_LIMIT)))
    cdf = poisson.cdf(counts, lam)
    cdf[:, -1] = 1.0  # sentinel: the search always ends
    edges = np.arange(_GUIDE) / _GUIDE
    guide = np.array([np.searchsorted(row, edges, side="right") for row in cdf], dtype=np.int16)
    return cdf, guide


_POISSON_CDF, _POISSON_GUIDE = _poisson_tables()


@intrinsic
def fma(typing_context, a, b, c):  # type: ignore[no-untyped-def]
    """a b + c in single precision, rounded once."""

    def generate(context, builder, signature, arguments):  # type: ignore[no-untyped-def]
        return builder.fma(*arguments)

    return types.float32(types.float32, types.float32, types.float32), generate


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
def _electrons(x: np.float32, g: np.int8, row_gain: np.float32, chain: _Chain) -> np.float32:
    """e of Eq. (1)."""
    return fma(x, fma(np.float32(row_gain * chain.gain_step), np.float32(g), row_gain), chain.dark_e)


@njit(cache=True)
def _level(m: np.float32, o: np.int8, c: np.float32, chain: _Chain) -> np.int32:
    """Output for electrons without their offsets, Eqs. (3) and (4)."""
    y = fma(chain.gain_dn_e, fma(chain.offset_step_e, np.float32(o), np.float32(m + c)), chain.black_dn)
    return np.int32(min(max(y, np.float32(0.0)), chain.top_dn)) >> chain.shift


@njit(cache=True, error_model="numpy")
def _row(x, gain, offset, column, out, seed, step, row_gain, chain) -> None:  # type: ignore[no-untyped-def]
    """Digitise a row away from full well by Eq. (5), and beyond it: one normal number a pixel."""
    for i in range(out.size):
        z = normal_from_bits(mix(np.uint32(seed + np.uint32(i) * step)))
        e = _electrons(x[i], gain[i], row_gain, chain)
        kept = min(e, chain.full_well_e)
        shot = e if e < chain.far_e else np.float32(0.0)
        v = np.float32(shot + chain.variance_e2)
        skew = np.float32(np.float32(0.16666667) * shot / v)
        m = fma(skew, fma(z, z, np.float32(-1.0)), fma(np.sqrt(v), z, kept))
        out[i] = _level(m, offset[i], column[i], chain)


@njit(cache=True)
def _row_near_full_well(x, gain, offset, column, out, seed, step, row_gain, chain) -> None:  # type: ignore[no-untyped-def]
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
def _row_exact(  # type: ignore[no-untyped-def]
    x, gain, offset, column, out, seed, step, row_gain, chain, cdf, guide
) -> None:
    """Digitise a row whose read noise does not hide that electrons are counted."""
    for i in range(out.size):
        bits = mix(np.uint32(seed + np.uint32(i) * step))
        more = mix(np.uint32(bits ^ np.uint32(0x9E3779B9)))
        e = _electrons(x[i], gain[i], row_gain, chain)
        if e < 30.0:
            u1 = mix(np.uint32(more ^ np.uint32(0x9E3779B9))) / 4294967296.0
            n = np.float32(poisson_from_uniforms(e, bits / 4294967296.0, u1, cdf, guide))
        else:
            z = normal_from_bits(bits)  # rounding adds 1/12 to the variance
            n = np.float32(np.rint(e + np.sqrt(e - 1.0 / 12.0) * z + (z * z - 1.0) / 6.0))
        m = fma(chain.read_noise_e, normal_from_bits(more), min(n, chain.full_well_e))
        out[i] = _level(m, offset[i], column[i], chain)


@njit(cache=True)
def _count_between(x, low: np.float32, high: np.float32) -> int:  # type: ignore[no-untyped-def]
    count = 0
    for i in range(x.size):
        count += (x[i] > low) & (x[i] < high)
    return count


@njit(cache=True)
def _digitise(  # type: ignore[no-untyped-def]
    x, gain, offset, column, out, key, frame_number, start, row_gain, chain, exact, cdf, guide
) -> None:
    rows, columns = x.shape
    first, last = start[1], start[1] + columns
    for r in range(rows):
        bits = row_key(key, frame_number, r + start[0])
        step = np.uint32(bits >> np.uint64(32)) | np.uint32(1)  # odd: no two columns alike
        seed = np.uint32(np.uint32(bits & np.uint64(0xFFFFFFFF)) + np.uint32(first) * step)
        g, o, c = gain[r + start[0], first:last], offset[r + start[0], first:last], column[first:last]
        if exact:
            _row_exact(x[r], g, o, c, out[r], seed, step, row_gain[r], chain, cdf, guide)
            continue
        _row(x[r], g, o, c, out[r], seed, step, row_gain[r], chain)
        widest = np.float32(1.0) + np.float32(128.0) * chain.gain_step
        low = (chain.near_e - chain.dark_e) / (row_gain[r] * widest) - np.float32(1.0)
        high = chain.far_e / (row_gain[r] * (np.float32(2.0) - widest)) + np.float32(1.0)
        if _count_between(x[r], low, high) > 0:
            _row_near_full_well(x[r], g, o, c, out[r], seed, step, row_gain[r], chain)


def dark_current_e_s(sensor: SensorParameters) -> float:
    """D of Eq. (1) at the sensor's temperature [e-/s]."""
    doublings = (sensor.temperature_c - sensor.dark_reference_c) / sensor.dark_doubling_k
    return sensor.dark_current_e_s * 2.0**doublings


def _chain(sensor: SensorParameters, pattern: FixedPattern, exposure_s: float, bits: int) -> _Chain:
    f = np.float32
    full_well, reach = sensor.full_well_e, _REACH * float(np.sqrt(sensor.full_well_e))
    return _Chain(
        dark_e=f(dark_current_e_s(sensor) * exposure_s),
        full_well_e=f(full_well),
        near_e=f(full_well - reach),
        far_e=f(full_well + reach),
        read_noise_e=f(sensor.read_noise_e),
        variance_e2=f(sensor.read_noise_e**2),
        gain_step=f(pattern.gain_step),
        offset_step_e=f(pattern.offset_step_e),
        gain_dn_e=f(output_gain(sensor, sensor.converter_bits)),
        black_dn=f(output_black(sensor, sensor.converter_bits) + 0.5),
        top_dn=f(2**sensor.converter_bits - 1),
        shift=np.int32(sensor.converter_bits - bits),
    )


def digitise(
    expected: NDArray[np.float32],
    sensor: SensorParameters,
    pattern: FixedPattern,
    key: int,
    frame_number: int,
    start: tuple[int, int],
    exposure_s: float,
    bits: int = OUTPUT_BITS,
) -> NDArray[np.unsignedinteger]:
    """Return (rows, columns) grey levels of one exposure, Eqs. (1) to (4).

    Args:
        expected: (rows, columns) expected photo-electrons of the mean pixel >= 0.
        sensor: noise, well, gain, converter.
        pattern: of the whole sensor.
        key: of `dockair.streams.counter_key`.
        frame_number: >= 0; frames of one key differ.
        start: (row, column) on the sensor of the first pixel.
        exposure_s: during which `expected` was collected.
        bits: of the result; 8 (uint8), or the converter's own (uint16: the raw frame).

    Raises:
        DockairError: other bits; pixels outside the pattern.
    """
    if bits not in (OUTPUT_BITS, sensor.converter_bits):
        exists = [str(OUTPUT_BITS), str(sensor.converter_bits)]
        raise DockairError("digitise.bits", expected="the output's or the converter's", got=bits, exists=exists)
    (rows, columns), (height, width) = expected.shape, pattern.shape
    if not (0 <= start[0] <= height - rows and 0 <= start[1] <= width - columns):
        expected_text = f"{rows} x {columns} pixels inside the sensor's {height} x {width}"
        raise DockairError("digitise.start", expected=expected_text, got=start)
    wait_s = overhead_time_s(sensor) + (start[0] + np.arange(rows)) * row_time_s(sensor)
    row_gain = (1.0 + sensor.parasitic_light_sensitivity * wait_s / exposure_s).astype(np.float32)
    out = np.empty(expected.shape, dtype=np.uint8 if bits == OUTPUT_BITS else np.uint16)
    _digitise(
        np.ascontiguousarray(expected, dtype=np.float32),
        pattern.gain_map,
        pattern.offset_map,
        pattern.column_e,
        out,
        np.uint64(key),
        frame_number,
        start,
        row_gain,
        _chain(sensor, pattern, exposure_s, bits),
        sensor.read_noise_e < EXACT_BELOW_E,
        _POISSON_CDF,
        _POISSON_GUIDE,
    )
    return out


def output_gain(sensor: SensorParameters, bits: int = OUTPUT_BITS) -> float:
    """Grey levels per electron of an output of so many bits."""
    return sensor.conversion_gain_dn_e * 2.0 ** (bits - _STATED_BITS)


def output_black(sensor: SensorParameters, bits: int = OUTPUT_BITS) -> float:
    """Grey level of no light, of an output of so many bits."""
    return sensor.black_level_dn * 2.0 ** (bits - _STATED_BITS)
