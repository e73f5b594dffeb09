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
frame, and no frame depends on which were taken before it.

Not modelled: non-linearity below full well; dark current while a row waits; motion of the scene while it waits; the
wait is that of the row's place in a full read-out (a window's rows wait less: this is the upper bound).
Sources: EMVA 1288 release 4.0 (linear model); CMV2000 data sheet v3.8; Cornish & Fisher 1938; hashes: Steele, Lea &
Flood 2014 (SplitMix64, rows), C. Wellons, hash-prospector (lowbias32, pixels).
"""

import math

import numpy as np
from numpy.typing import NDArray

from dockair.errors import DockairError
from dockair.sim.camera.fixed_pattern import FixedPattern
from dockair.sim.camera.normals_ahead import NOTHING_AHEAD, NormalsAhead
from dockair.sim.camera.pixel_noise import EXACT_BELOW_E, POISSON_CDF, POISSON_GUIDE, Chain, digitise_rows
from dockair.sim.camera.readout import overhead_time_s, row_time_s
from dockair.sim.camera.sheets import SensorParameters

OUTPUT_BITS = 8  #: of CameraFrame.pixels
_STATED_BITS = 10  # that the sheet's gain and black level are stated for
_REACH = 6.0  # standard deviations of shot noise around full well within which both noises are drawn


def dark_current_e_s(sensor: SensorParameters) -> float:
    """D of Eq. (1) at the sensor's temperature [e-/s]."""
    doublings = (sensor.temperature_c - sensor.dark_reference_c) / sensor.dark_doubling_k
    return sensor.dark_current_e_s * 2.0**doublings


def _chain(sensor: SensorParameters, pattern: FixedPattern, exposure_s: float, bits: int) -> Chain:
    full_well, reach = sensor.full_well_e, _REACH * math.sqrt(sensor.full_well_e)
    return Chain(
        dark_e=dark_current_e_s(sensor) * exposure_s,
        full_well_e=full_well,
        near_e=full_well - reach,
        far_e=full_well + reach,
        read_noise_e=sensor.read_noise_e,
        variance_e2=sensor.read_noise_e**2,
        gain_step=pattern.gain_step,
        offset_step_e=pattern.offset_step_e,
        gain_dn_e=output_gain(sensor, sensor.converter_bits),
        black_dn=output_black(sensor, sensor.converter_bits) + 0.5,
        top_dn=2.0**sensor.converter_bits - 1.0,
        shift=sensor.converter_bits - bits,
    )


def _check(
    window: tuple[int, ...], start: tuple[int, int], whole: tuple[int, int], sensor: SensorParameters, bits: int
) -> None:
    if bits not in (OUTPUT_BITS, sensor.converter_bits):
        exists = [str(OUTPUT_BITS), str(sensor.converter_bits)]
        raise DockairError("digitise.bits", expected="the output's or the converter's", got=bits, exists=exists)
    row, column = start
    if not (0 <= row <= whole[0] - window[0] and 0 <= column <= whole[1] - window[1]):
        expected = f"{window[0]} x {window[1]} pixels inside the sensor's {whole[0]} x {whole[1]}"
        raise DockairError("digitise.start", expected=expected, got=start)


def digitise(
    expected: NDArray[np.float32],
    sensor: SensorParameters,
    pattern: FixedPattern,
    key: int,
    frame_number: int,
    start: tuple[int, int],
    exposure_s: float,
    bits: int = OUTPUT_BITS,
    ahead: NormalsAhead | None = None,
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
        ahead: normal numbers of the same key that may be known already; they change no bit.

    Raises:
        DockairError: other bits; pixels outside the pattern.
    """
    _check(expected.shape, start, pattern.shape, sensor, bits)
    exact = sensor.read_noise_e < EXACT_BELOW_E
    rows, columns = expected.shape
    normals, normals_start = NOTHING_AHEAD if ahead is None or exact else ahead.of(frame_number, start, (rows, columns))
    out = np.empty(expected.shape, dtype=np.uint8 if bits == OUTPUT_BITS else np.uint16)
    digitise_rows(
        np.ascontiguousarray(expected, dtype=np.float32),
        pattern.gain_map,
        pattern.offset_map,
        pattern.column_e,
        out,
        np.uint64(key),
        frame_number,
        start,
        (sensor.parasitic_light_sensitivity, exposure_s, overhead_time_s(sensor), row_time_s(sensor)),
        _chain(sensor, pattern, exposure_s, bits),
        exact,
        POISSON_CDF,
        POISSON_GUIDE,
        normals,
        normals_start,
    )
    return out


def output_gain(sensor: SensorParameters, bits: int = OUTPUT_BITS) -> float:
    """Grey levels per electron of an output of so many bits."""
    return sensor.conversion_gain_dn_e * 2.0 ** (bits - _STATED_BITS)


def output_black(sensor: SensorParameters, bits: int = OUTPUT_BITS) -> float:
    """Grey level of no light, of an output of so many bits, before the converter's lowest bits are cut off.

    Cut off, an output of 8 bits reads 3/8 of a level less in the mean, 15/32 with 12 bits, with light and without.
    """
    return sensor.black_level_dn * 2.0 ** (bits - _STATED_BITS)
