"""From expected electrons to grey levels: shot noise, full well, read noise, gain, conversion, read-out time.

    n ~ Poisson(e)                  by inversion below 30 e-, normal above                                       (1)
    m = min(n, full well) + r,      r ~ N(0, read noise)                                                         (2)
    raw = floor(K m + black level + 1/2), clipped to [0, 2^bits - 1];   output = raw >> (bits - 8)               (3)
    time = row_clocks T_clk (16/outputs) rows + (overhead + 2 x 16/outputs) row_clocks T_clk                     (4)

Every random number is a hash of (key, frame, row, column), so a pixel reads the same in a window and in the full
frame, and no frame depends on which were taken before it.
The Poisson law is exact: e = j/4 + d, and a Poisson(j/4) from a table plus a Poisson(d), d < 1/4, add up to Poisson(e).
The normal law above 30 e- ignores the skew (0.18 at 30 e-), which the read noise hides.

Not modelled: dark current (0.0025 e- in 20 us), fixed-pattern noise, parasitic light, non-linearity near full well.
Sources: EMVA 1288 release 3.1, eqs 3 to 12; CMV2000 data sheet v3.8 (read-out); hash: Steele, Lea & Flood 2014
(SplitMix64), its finaliser applied to a counter.
"""

import math

import numpy as np
from numba import njit
from numpy.typing import NDArray
from scipy.special import ndtri
from scipy.stats import poisson

from dockair.messages import Window
from dockair.rotations import Array
from dockair.sim.camera.radiometry import CameraParameters

OUTPUT_BITS = 8  #: of CameraFrame.pixels
POISSON_LIMIT = 30.0  #: electrons above which shot noise is drawn from a normal law
_OUTPUTS = 16  # that row_clocks is stated for
_CELLS = 2048  # of one level of the normal quantile's table
_ZOOM = 128  # each further level covers the first 1/128 of the one before
_LEVELS = 3
_STEPS = 4  # tabled Poisson laws per electron
_GUIDE = 64  # cells of the guide into each tabled law


def _normal_table() -> NDArray[np.float32]:
    p = 0.5 * np.arange(_CELLS + 1) / _CELLS
    p[0] = p[1] / 8.0  # the quantile of 0 is minus infinity; the cell is met once in 3e7 numbers
    levels = [ndtri(p / _ZOOM**level) for level in range(_LEVELS)]
    return np.array(levels, dtype=np.float32)


def _poisson_tables() -> tuple[Array, NDArray[np.int16]]:
    lam = np.arange(int(POISSON_LIMIT * _STEPS) + 1)[:, None] / _STEPS
    counts = np.arange(int(POISSON_LIMIT + 12.0 * np.sqrt(POISSON_LIMIT)))
    cdf = poisson.cdf(counts, lam)
    cdf[:, -1] = 1.0  # sentinel: the search always ends
    edges = np.arange(_GUIDE) / _GUIDE
    guide = np.array([np.searchsorted(row, edges, side="right") for row in cdf], dtype=np.int16)
    return cdf, guide


_NORMAL = _normal_table()
_POISSON_CDF, _POISSON_GUIDE = _poisson_tables()


@njit(cache=True)
def mix(x: np.uint64) -> np.uint64:
    """Return the SplitMix64 finaliser of a 64-bit number."""
    x = np.uint64(x)
    x = (x ^ (x >> np.uint64(30))) * np.uint64(0xBF58476D1CE4E5B9)
    x = (x ^ (x >> np.uint64(27))) * np.uint64(0x94D049BB133111EB)
    return x ^ (x >> np.uint64(31))


@njit(cache=True)
def normal_from_bits(bits: np.uint32, table: NDArray[np.float32]) -> float:
    """Return a standard normal number from 32 random bits: one of sign, 31 through the tabled quantile."""
    level = 0
    x = np.uint64(bits & np.uint32(0x7FFFFFFF))
    while level < 2 and x < np.uint64(1 << 24):  # the first 1/128 of a level is the whole of the next
        x = x << np.uint64(7)
        level += 1
    cell = x >> np.uint64(20)
    fraction = float(x & np.uint64(0xFFFFF)) * (1.0 / 1048576.0)
    z = table[level, cell] + fraction * (table[level, cell + 1] - table[level, cell])
    return -z if bits >> np.uint32(31) else z


@njit(cache=True)
def poisson_from_uniforms(expected: float, u0: float, u1: float, cdf: Array, guide: NDArray[np.int16]) -> int:
    """Return a Poisson number of mean `expected` in [0, 30) from two uniform numbers in [0, 1)."""
    j = int(expected * 4.0)
    n = int(guide[j, int(u0 * 64.0)])
    while u0 >= cdf[j, n]:
        n += 1
    rest = expected - 0.25 * j
    if u1 >= 1.0 - rest:  # exp(-d) >= 1 - d: below it the second part is 0, most of the time
        p = math.exp(-rest)
        total, k = p, 0
        while u1 >= total and k < 20:
            k += 1
            p *= rest / k
            total += p
        n += k
    return n


@njit(cache=True)
def _digitise(
    expected: NDArray[np.float32],
    out: NDArray[np.unsignedinteger],
    seed: np.uint64,
    start: tuple[int, int],
    sensor: tuple[float, float, float, float, float],
    shift: int,
    normal: NDArray[np.float32],
    cdf: Array,
    guide: NDArray[np.int16],
) -> None:
    full_well, read_noise, gain, black, top = sensor
    to_unit = 1.0 / 4294967296.0
    for r in range(expected.shape[0]):
        row_seed = mix(seed + np.uint64(r + start[0]) * np.uint64(0x9E3779B97F4A7C15))
        for c in range(expected.shape[1]):
            bits = mix(row_seed + np.uint64(c + start[1] + 1) * np.uint64(0x9E3779B97F4A7C15))
            low, high = np.uint32(bits & np.uint64(0xFFFFFFFF)), np.uint32(bits >> np.uint64(32))
            e = expected[r, c]
            if e < 30.0:
                second = mix(bits + np.uint64(0xD1B54A32D192ED03)) >> np.uint64(32)
                n = float(poisson_from_uniforms(e, low * to_unit, second * to_unit, cdf, guide))
            else:
                n = e + math.sqrt(e) * normal_from_bits(low, normal)
            m = min(n, full_well) + read_noise * normal_from_bits(high, normal)
            out[r, c] = int(min(max(gain * m + black + 0.5, 0.0), top)) >> shift


def digitise(
    expected: NDArray[np.float32],
    parameters: CameraParameters,
    key: int,
    frame_number: int,
    start: tuple[int, int],
    bits: int = OUTPUT_BITS,
) -> NDArray[np.unsignedinteger]:
    """Return (rows, columns) grey levels of one exposure, Eqs. (1) to (3).

    Args:
        expected: (rows, columns) expected electrons >= 0.
        parameters: noise, well, gain, converter.
        key: of `dockair.streams.counter_key`.
        frame_number: >= 0; frames of one key differ.
        start: (row, column) on the sensor of the first pixel.
        bits: of the result; 8 (uint8), or the converter's own (uint16: the raw frame).
    """
    out = np.empty(expected.shape, dtype=np.uint8 if bits == OUTPUT_BITS else np.uint16)
    sensor = (
        parameters.full_well_e,
        parameters.read_noise_e,
        parameters.conversion_gain_dn_e,
        parameters.black_level_dn,
        float(2**parameters.converter_bits - 1),
    )
    seed = np.uint64(mix(np.uint64(mix(np.uint64(key)) ^ frame_number)))
    shift = parameters.converter_bits - bits
    _digitise(expected, out, seed, start, sensor, shift, _NORMAL, _POISSON_CDF, _POISSON_GUIDE)
    return out


def output_gain(parameters: CameraParameters, bits: int = OUTPUT_BITS) -> float:
    """Grey levels of the output per electron."""
    return parameters.conversion_gain_dn_e / float(2 ** (parameters.converter_bits - bits))


def readout_time_s(rows: int, parameters: CameraParameters) -> float:
    """Time [s] to read `rows` rows out of the sensor, Eq. (4): columns cost nothing."""
    slot = parameters.row_clocks / parameters.clock_hz
    share = _OUTPUTS / parameters.outputs
    return slot * (share * rows + parameters.overhead_setting + 2.0 * share)


def latency_s(window: Window, parameters: CameraParameters) -> float:
    """Time [s] from the middle of the exposure until the frame has arrived."""
    return 0.5 * parameters.exposure_s + readout_time_s(window.shape[0], parameters) + parameters.transfer_s
