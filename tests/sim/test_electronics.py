"""The chain's laws against closed forms, and the noise's addressing.

Statistical bounds are 4.5 standard errors, a false alarm in 1.5e5 for each; keys are fixed.
Photon transfer is in `test_emva1288.py`, the noise's laws in `test_pixel_noise.py`.
"""

from dataclasses import replace

import numpy as np
import pytest
from scipy import stats

from dockair.errors import DockairError
from dockair.parameters import load_parameters
from dockair.sim.camera.electronics import (
    dark_current_e_s,
    digitise,
    output_black,
    output_gain,
)
from dockair.sim.camera.fixed_pattern import FixedPattern
from dockair.sim.camera.readout import readout_time_s
from dockair.sim.camera.sheets import OUTPUTS_OF_BITS, SensorParameters

SENSOR = load_parameters("sensor", SensorParameters)
EVEN = replace(
    SENSOR, photo_response_nonuniformity=0.0, dark_signal_nonuniformity_e=0.0, column_pattern_e=0.0,
    dark_current_e_s=0.0, parasitic_light_sensitivity=0.0,
)  # fmt: skip
#: One level an electron, 12 bits.
FINE = replace(EVEN, converter_bits=12, outputs=4, clock_hz=40e6, conversion_gain_dn_e=0.25, black_level_dn=50.0)
FULL = (1088, 2048)
EXPOSURE_S = 20e-6
PATTERN = FixedPattern(SENSOR, 99, *FULL)
NO_PATTERN = FixedPattern(EVEN, 99, *FULL)


def _read(
    image: np.ndarray,
    sensor: SensorParameters,
    key: int,
    frame: int = 0,
    start: tuple[int, int] = (0, 0),
    bits: int = 8,
) -> np.ndarray:
    pattern = NO_PATTERN if sensor.photo_response_nonuniformity == 0.0 else PATTERN
    return digitise(image, sensor, pattern, key, frame, start, EXPOSURE_S, bits)


def _flat(electrons: float, shape: tuple[int, int] = (400, 500)) -> np.ndarray:
    return np.full(shape, electrons, dtype=np.float32)


def _levels(electrons: float, sensor: SensorParameters, key: int, shape: tuple[int, int] = (400, 500)) -> np.ndarray:
    return _read(_flat(electrons, shape), sensor, key, bits=sensor.converter_bits).astype(float)


@pytest.mark.parametrize(
    ("electrons", "read_noise_e", "full_well_e"),
    [
        (0.0, 13.0, 13500.0),
        (40.0, 13.0, 13500.0),
        (2500.0, 13.0, 13500.0),
        (32.0, 4.0, 13500.0),
        (118.0, 4.0, 200.0),
        (3.2, 2.0, 13500.0),
        (12.9, 2.0, 13500.0),
    ],
)
def test_shot_and_read_noise_together_have_the_exact_first_three_cumulants(
    electrons: float, read_noise_e: float, full_well_e: float
) -> None:
    """Mean e, variance e + s^2 + 1/12, third cumulant e; the last to 4.5 sqrt(6/n) of the deviation cubed.

    Of two full frames: the skew term is tested to 6 % by 32 e- and 4 e-, where it is largest. 118 e- are seven
    deviations below a well of 200 e-, where both noises are drawn apart; below 4 e- electrons are counted.
    """
    sensor = replace(FINE, read_noise_e=read_noise_e, full_well_e=full_well_e)
    m = (
        np.concatenate([_read(_flat(electrons, FULL), sensor, 15, frame, bits=12) for frame in (0, 1)]).astype(float)
        - 200.0
    )
    v = electrons + read_noise_e**2 + 1.0 / 12.0
    assert m.mean() == pytest.approx(electrons, abs=4.5 * np.sqrt(v / m.size))
    assert m.var() == pytest.approx(v, rel=4.5 * np.sqrt(2.0 / m.size) + 5e-4)
    third = ((m - m.mean()) ** 3).mean()
    assert third == pytest.approx(electrons, abs=4.5 * np.sqrt(6.0 / m.size) * v**1.5)


@pytest.mark.parametrize("read_noise_e", [13.0, 2.0])
@pytest.mark.parametrize("electrons", [1700.0, 1740.0, 1950.0, 2000.0, 2060.0, 2260.0, 2300.0, 1e8])
def test_the_well_clips_shot_noise_and_not_read_noise(electrons: float, read_noise_e: float) -> None:
    """Mean and variance of min(Poisson(e), 2000) + N(0, s^2), on both sides of where noises are drawn together."""
    sensor = replace(FINE, full_well_e=2000.0, read_noise_e=read_noise_e)
    m = _levels(electrons, sensor, 19, (600, 1000)) - 200.0
    n = np.arange(0, 3500)
    p = stats.poisson.pmf(n, electrons) if electrons < 1e6 else 1.0 * (n == 2000)
    kept = np.minimum(n, 2000.0)
    mean = (p * kept).sum() / p.sum()
    variance = (p * (kept - mean) ** 2).sum() / p.sum() + read_noise_e**2 + 1.0 / 12.0
    assert m.mean() == pytest.approx(mean, abs=4.5 * np.sqrt(variance / m.size))
    kurtosis = ((m - m.mean()) ** 4).mean() / variance**2  # the clipped law's own
    assert m.var() == pytest.approx(variance, rel=4.5 * np.sqrt((kurtosis - 1.0) / m.size))


@pytest.mark.parametrize("read_noise_e", [13.0, 2.0])
def test_every_window_reads_what_the_full_frame_reads_there(read_noise_e: float) -> None:
    """71 first columns, all widths up to 70: whole vectors, remainders, both; dark, bright, near and over full well."""
    sensor = replace(SENSOR, read_noise_e=read_noise_e)
    rng = np.random.default_rng(1)
    image = rng.choice(np.array([0.0, 3.0, 200.0, 13000.0, 13500.0, 1e8]), (40, 160)).astype(np.float32)
    image *= rng.uniform(0.9, 1.1, image.shape).astype(np.float32)
    full = _read(image, sensor, 23, 5, (500, 300), bits=10)
    for column in range(71):
        for width in range(1, 71):
            row = (7 * column + width) % 39
            part = image[row : row + 2, column : column + width]
            read = _read(part, sensor, 23, 5, (500 + row, 300 + column), bits=10)
            assert np.array_equal(read, full[row : row + 2, column : column + width])


def test_a_pixel_does_not_see_its_neighbours_light() -> None:
    """A row with and without a pixel at full well: the others read the same."""
    image = np.random.default_rng(1).uniform(0.0, 400.0, (3, 300)).astype(np.float32)
    lit = image.copy()
    lit[1, 150:160] = 13500.0
    differs = _read(image, SENSOR, 29, bits=10) != _read(lit, SENSOR, 29, bits=10)
    assert differs[1, 150:160].all()
    assert differs.sum() == 10


def test_the_noise_repeats_with_key_and_frame_and_changes_with_either() -> None:
    image = _flat(300.0, (50, 50))
    frame = _read(image, SENSOR, 2**64 - 1, 3)
    assert np.array_equal(frame, _read(image, SENSOR, 2**64 - 1, 3))
    assert not np.array_equal(frame, _read(image, SENSOR, 2**64 - 2, 3))
    assert not np.array_equal(frame, _read(image, SENSOR, 2**64 - 1, 4))


def test_prnu_scales_light_and_dark_offsets_do_not_depend_on_it() -> None:
    """Averages of 32 frames against the truth maps: slopes 1, and 0 across, to 4.5 standard errors."""
    sensor = replace(
        SENSOR, parasitic_light_sensitivity=0.0, conversion_gain_dn_e=0.25, converter_bits=12, outputs=4, clock_hz=40e6
    )
    part, count, light = (slice(200, 300), slice(300, 700)), 32, 2000.0

    def average_e(electrons: float) -> np.ndarray:
        image = _flat(electrons, (100, 400))
        frames = [_read(image, sensor, 37, i, (200, 300), bits=12).astype(float) for i in range(count)]
        return np.mean(frames, axis=0) - output_black(sensor, 12)

    dark, bright = average_e(0.0), average_e(light)
    gain, offset = (m[part].astype(float) for m in (PATTERN.gain - 1.0, PATTERN.offset_e))
    light_alone = bright - dark
    for found, truth, slope in (
        (dark, offset, 1.0),
        (dark, gain, 0.0),
        (light_alone, gain, light),
        (light_alone, offset, 0.0),
    ):
        fit = stats.linregress(truth.ravel(), found.ravel())
        assert fit.slope == pytest.approx(slope, abs=4.5 * fit.stderr)
        assert fit.stderr < 0.02 * (dark.std() if found is dark else light_alone.std()) / truth.std()


@pytest.mark.parametrize(("temperature_c", "factor"), [(25.0, 1.0), (31.3, 2.0), (18.7, 0.5), (43.9, 8.0)])
def test_dark_current_doubles_every_6_3_k_and_makes_shot_noise(temperature_c: float, factor: float) -> None:
    sensor = replace(FINE, temperature_c=temperature_c, dark_current_e_s=5e4)
    electrons = 5e4 * factor * 2e-3
    assert dark_current_e_s(sensor) == pytest.approx(5e4 * factor, rel=1e-12)
    raw = digitise(_flat(0.0), sensor, NO_PATTERN, 41, 0, (0, 0), 2e-3, 12).astype(float) - 200.0
    v = electrons + sensor.read_noise_e**2 + 1.0 / 12.0
    assert raw.mean() == pytest.approx(electrons, abs=4.5 * np.sqrt(v / raw.size))
    assert raw.var() == pytest.approx(v, rel=4.5 * np.sqrt(2.0 / raw.size))


def test_parasitic_light_adds_to_each_row_in_proportion_to_its_wait() -> None:
    """P w/t of the light: 0.01 x (32 us + row x 2.7 us)/20 us; a mean of a row is good to 1.4 e- of up to 3000."""
    sensor = replace(EVEN, parasitic_light_sensitivity=0.01)
    image = _flat(2000.0, FULL)
    levels = _read(image, sensor, 43, bits=10).astype(float)
    rows = np.array([0, 1, 100, 543, 1087])
    found = (levels[rows].mean(axis=1) - sensor.black_level_dn) / sensor.conversion_gain_dn_e
    wait_s = np.array([readout_time_s(int(row), sensor) for row in rows])
    expected = 2000.0 * (1.0 + 0.01 * wait_s / EXPOSURE_S)
    error = np.sqrt((expected + 169.0 + 1.0 / (12.0 * 0.075**2)) / FULL[1])
    assert np.all(np.abs(found - expected) < 4.5 * error)
    assert found[-1] > found[0] + 2500.0


def test_light_that_gets_to_a_waiting_row_is_scaled_by_its_pixels_gain_too() -> None:
    """(1 + g)(1 + P w/t) x: with P = 0.01 and the last rows' wait of 13 ms 7.7 times x; to 4.5 standard errors."""
    sensor = replace(FINE, parasitic_light_sensitivity=0.01, photo_response_nonuniformity=0.01)
    raw = digitise(_flat(300.0, (100, 2048)), sensor, PATTERN, 47, 0, (988, 0), EXPOSURE_S, 12).astype(float)
    found = raw - raw.mean(axis=1, keepdims=True)  # the wait's own rise from row to row taken off
    fit = stats.linregress((PATTERN.gain[988:] - 1.0).ravel(), found.ravel())
    light = 300.0 * (1.0 + 0.01 * readout_time_s(1038, sensor) / EXPOSURE_S)
    assert fit.slope == pytest.approx(light, abs=4.5 * fit.stderr)
    assert fit.stderr < 0.01 * light and light > 7.0 * 300.0


def test_a_full_well_reads_full_scale_and_no_more_light_adds_to_it() -> None:
    at, over = (_read(_flat(e, (20, 20)), SENSOR, 1) for e in (20000.0, 1e9))
    assert np.all(at >= 253)
    assert np.array_equal(at, over)
    below = _read(_flat(0.9 * SENSOR.full_well_e, (20, 20)), EVEN, 1)
    assert below.max() < 240


def test_the_full_well_clips_before_the_gain() -> None:
    half_gain = replace(EVEN, read_noise_e=0.0, conversion_gain_dn_e=0.0375)
    raw = _read(_flat(1e6, (20, 20)), half_gain, 1, bits=10)
    assert np.all(raw == int(13500 * 0.0375 + 10.5))


def test_the_dark_is_not_cut_off() -> None:
    raw = _read(_flat(0.0), SENSOR, 31, bits=10)
    assert raw.min() > 0
    truth = SENSOR.black_level_dn + SENSOR.conversion_gain_dn_e * PATTERN.offset_e[:400, :500].mean()
    assert raw.mean() == pytest.approx(truth, abs=4.5 * 1.02 / np.sqrt(raw.size))


@pytest.mark.parametrize(
    "sensor", [SENSOR, replace(SENSOR, converter_bits=12, outputs=4, clock_hz=40e6)], ids=["10 bit", "12 bit"]
)
def test_the_output_is_the_converters_upper_eight_bits(sensor: SensorParameters) -> None:
    image = np.linspace(0.0, 14500.0, 10000, dtype=np.float32).reshape(100, 100)
    raw = _read(image, sensor, 37, bits=sensor.converter_bits)
    assert raw.dtype == np.uint16 and raw.max() == 2**sensor.converter_bits - 1
    output = _read(image, sensor, 37)
    assert output.dtype == np.uint8
    assert np.array_equal(output, raw >> (sensor.converter_bits - 8))


def test_twelve_bits_have_four_times_the_levels_of_ten_and_the_output_the_same() -> None:
    twelve = replace(SENSOR, converter_bits=12, outputs=4, clock_hz=40e6)
    assert output_gain(twelve, 12) == 4.0 * output_gain(SENSOR, 10) == 4.0 * SENSOR.conversion_gain_dn_e
    assert output_gain(twelve) == output_gain(SENSOR) == SENSOR.conversion_gain_dn_e / 4.0
    assert output_black(twelve, 12) == 4.0 * SENSOR.black_level_dn


@pytest.mark.parametrize(("bits", "outputs"), [(12, 16), (12, 8), (10, 3), (10, 1)])
def test_outputs_that_cannot_read_so_many_bits_are_refused_with_those_that_can(bits: int, outputs: int) -> None:
    with pytest.raises(DockairError, match=f"sensor.outputs.* {bits} bits, got {outputs}; exists") as refusal:
        replace(SENSOR, converter_bits=bits, outputs=outputs)
    assert refusal.value.exists == tuple(str(n) for n in OUTPUTS_OF_BITS[bits])


def test_a_scenario_that_asks_for_twelve_bits_alone_is_refused() -> None:
    with pytest.raises(DockairError, match="sensor.outputs.*got 16; exists: 2, 4"):
        load_parameters("sensor", SensorParameters, {"converter_bits": 12})
    with pytest.raises(DockairError, match=r"sensor.clock_hz: expected up to 4e\+07 Hz, .* 12 bits, got 48000000.0"):
        load_parameters("sensor", SensorParameters, {"converter_bits": 12, "outputs": 4})
    twelve = {"converter_bits": 12, "outputs": 4, "clock_hz": 40e6}
    assert load_parameters("sensor", SensorParameters, twelve).outputs == 4


def test_a_converter_of_eleven_bits_is_refused() -> None:
    with pytest.raises(DockairError, match="sensor.converter_bits.*10, 12"):
        replace(SENSOR, converter_bits=11)
    with pytest.raises(DockairError, match="parameters.sensor.converter_bits"):
        load_parameters("sensor", SensorParameters, {"converter_bits": 14})


def test_bits_that_nothing_reads_and_pixels_outside_the_sensor_are_refused() -> None:
    with pytest.raises(DockairError, match="digitise.bits.*got 12; exists: 8, 10"):
        _read(_flat(1.0, (3, 3)), SENSOR, 1, bits=12)
    for start in ((1086, 0), (0, 2046), (-1, 0)):
        with pytest.raises(DockairError, match=r"digitise.start.*3 x 3.*1088 x 2048"):
            _read(_flat(1.0, (3, 3)), SENSOR, 1, start=start)
