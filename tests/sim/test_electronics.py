"""Photon transfer, the noise's laws and its addressing.

Statistical bounds are 4.5 standard errors, a false alarm in 1.5e5 for each; keys are fixed.
"""

from dataclasses import replace

import numpy as np
import pytest
from scipy import stats

from dockair.messages import Window
from dockair.parameters import load_parameters
from dockair.sim.camera.electronics import digitise, latency_s, output_gain, readout_time_s
from dockair.sim.camera.radiometry import CameraParameters

CAMERA = load_parameters("camera", CameraParameters)
COUNTING = replace(CAMERA, read_noise_e=0.0, conversion_gain_dn_e=1.0, black_level_dn=0.0, converter_bits=12)
RAW = 10


def _flat(electrons: float, shape: tuple[int, int] = (400, 500)) -> np.ndarray:
    return np.full(shape, electrons, dtype=np.float32)


def test_photon_transfer_recovers_gain_and_read_noise_from_flat_fields() -> None:
    """EMVA 1288: the variance of raw levels is a line in their mean, slope K, offset K^2 s^2 + 1/12.

    Differences of two frames of one level. 2e5 pixels make a variance good to 0.32 %, the slope to 0.3 %.
    """
    means, variances = [], []
    for i, electrons in enumerate(np.linspace(0.0, 8000.0, 9)):
        a, b = (digitise(_flat(electrons), CAMERA, 7, 2 * i + j, (0, 0), RAW).astype(float) for j in (0, 1))
        means.append(0.5 * (a + b).mean())
        variances.append(0.5 * np.var(a - b))
    slope = np.polyfit(np.array(means) - CAMERA.black_level_dn, variances, 1, w=1.0 / np.array(variances))[0]
    dark_noise_e = np.sqrt(variances[0] - 1.0 / 12.0) / CAMERA.conversion_gain_dn_e
    assert slope == pytest.approx(CAMERA.conversion_gain_dn_e, rel=0.02)
    assert dark_noise_e == pytest.approx(CAMERA.read_noise_e, rel=0.02)


@pytest.mark.parametrize("electrons", [0.1, 0.7, 3.3, 12.9, 29.99, 30.01, 300.0])
def test_shot_noise_has_the_mean_and_the_variance_of_its_poisson_law(electrons: float) -> None:
    n = digitise(_flat(electrons), COUNTING, 11, 0, (0, 0), 12).astype(float)
    mean_error = np.sqrt(electrons / n.size)
    variance_error = np.sqrt((electrons + 2.0 * electrons**2) / n.size)
    rounding = 1.0 / 12.0 if electrons > 30.0 else 0.0
    assert n.mean() == pytest.approx(electrons, abs=4.5 * mean_error)
    assert n.var() == pytest.approx(electrons + rounding, abs=4.5 * variance_error)


@pytest.mark.parametrize("electrons", [0.2, 2.6, 17.3])
def test_few_electrons_follow_the_exact_poisson_law(electrons: float) -> None:
    """Chi-squared of the counts against the law; refused below 1e-5."""
    n = digitise(_flat(electrons), COUNTING, 13, 0, (0, 0), 12).ravel()
    k = np.arange(n.max() + 1)
    expected = stats.poisson.pmf(k, electrons) * n.size
    kept = expected > 20.0
    observed = np.bincount(n, minlength=len(k))
    observed, expected = (np.append(x[kept], n.size - x[kept].sum()) for x in (observed, expected))
    assert stats.chisquare(observed, expected).pvalue > 1e-5


def test_the_read_noise_is_normal_out_to_its_tails() -> None:
    """Without shot noise: levels of a noise wide enough to be unrounded, by Kolmogorov and Smirnov at 1e-5."""
    wide = replace(CAMERA, read_noise_e=300.0, conversion_gain_dn_e=1.0, black_level_dn=2000.0, converter_bits=12)
    raw = digitise(_flat(0.0), wide, 17, 0, (0, 0), 12).ravel()
    z = (raw + np.random.default_rng(0).uniform(-0.5, 0.5, raw.size) - 2000.0) / 300.0
    assert stats.kstest(z, "norm").pvalue > 1e-5
    beyond = int((np.abs(z) > 3.5).sum())
    assert stats.binomtest(beyond, z.size, 2.0 * stats.norm.sf(3.5)).pvalue > 1e-5


def test_a_window_reads_what_the_full_frame_reads_there() -> None:
    image = np.random.default_rng(1).uniform(0.0, 400.0, (300, 400)).astype(np.float32)
    full = digitise(image, CAMERA, 23, 5, (0, 0))
    part = digitise(np.ascontiguousarray(image[40:90, 111:222]), CAMERA, 23, 5, (40, 111))
    assert np.array_equal(part, full[40:90, 111:222])


def test_the_noise_repeats_with_key_and_frame_and_changes_with_either() -> None:
    image = _flat(300.0, (50, 50))
    frame = digitise(image, CAMERA, 2**64 - 1, 3, (0, 0))
    assert np.array_equal(frame, digitise(image, CAMERA, 2**64 - 1, 3, (0, 0)))
    assert not np.array_equal(frame, digitise(image, CAMERA, 2**64 - 2, 3, (0, 0)))
    assert not np.array_equal(frame, digitise(image, CAMERA, 2**64 - 1, 4, (0, 0)))


def test_noise_is_uncorrelated_between_neighbours_and_between_frames() -> None:
    a, b = (digitise(_flat(300.0), CAMERA, 29, i, (0, 0), RAW).astype(float) for i in (0, 1))
    limit = 4.5 / np.sqrt(a.size)
    for x, y in ((a[:, 1:], a[:, :-1]), (a[1:], a[:-1]), (a, b), (a[1:, 1:], a[:-1, :-1])):
        assert abs(np.corrcoef(x.ravel(), y.ravel())[0, 1]) < 1.05 * limit


def test_a_full_well_reads_full_scale_and_no_more_light_adds_to_it() -> None:
    quiet = replace(CAMERA, read_noise_e=0.0)
    at, over = (digitise(_flat(e, (20, 20)), quiet, 1, 0, (0, 0)) for e in (20000.0, 1e7))
    assert np.all(at == 255)
    assert np.array_equal(at, over)
    below = digitise(_flat(0.9 * CAMERA.full_well_e, (20, 20)), quiet, 1, 0, (0, 0))
    assert below.max() < 240


def test_the_full_well_clips_before_the_gain() -> None:
    half_gain = replace(CAMERA, read_noise_e=0.0, conversion_gain_dn_e=0.0375)
    raw = digitise(_flat(1e6, (20, 20)), half_gain, 1, 0, (0, 0), RAW)
    assert np.all(raw == int(13500 * 0.0375 + 10.5))


def test_the_dark_is_not_cut_off() -> None:
    raw = digitise(_flat(0.0), CAMERA, 31, 0, (0, 0), RAW)
    assert raw.min() > 0
    assert raw.mean() == pytest.approx(CAMERA.black_level_dn, abs=0.02)


def test_the_output_is_the_converters_upper_eight_bits() -> None:
    image = np.linspace(0.0, 13000.0, 10000, dtype=np.float32).reshape(100, 100)
    raw = digitise(image, CAMERA, 37, 0, (0, 0), RAW)
    assert np.array_equal(digitise(image, CAMERA, 37, 0, (0, 0)), raw >> 2)
    assert output_gain(CAMERA) == CAMERA.conversion_gain_dn_e / 4.0


def test_a_full_frame_is_read_in_2_96_ms_and_a_window_in_proportion_to_its_rows() -> None:
    """129/48 MHz x (1088 + 12) = 2.956 ms: 338 frames per second."""
    assert readout_time_s(1088, CAMERA) == pytest.approx(129.0 / 48e6 * 1100.0, rel=1e-12)
    assert 1.0 / readout_time_s(1088, CAMERA) == pytest.approx(338.0, abs=0.5)
    per_row = (readout_time_s(600, CAMERA) - readout_time_s(100, CAMERA)) / 500.0
    assert per_row == pytest.approx(129.0 / 48e6, rel=1e-9)
    assert readout_time_s(500, replace(CAMERA, outputs=4)) > 3.9 * readout_time_s(500, CAMERA)


def test_latency_counts_rows_and_not_columns() -> None:
    narrow, wide, tall = Window(0, 300, 0, 10), Window(0, 300, 0, 2048), Window(0, 600, 0, 10)
    assert latency_s(narrow, CAMERA) == latency_s(wide, CAMERA) < latency_s(tall, CAMERA)
    assert latency_s(Window(0, 1088, 0, 2048), CAMERA) == pytest.approx(10e-3, abs=1e-4)


def test_latency_counts_from_the_middle_of_the_exposure() -> None:
    window = Window(0, 300, 0, 10)
    longer = replace(CAMERA, exposure_s=CAMERA.exposure_s + 400e-6)
    assert latency_s(window, longer) - latency_s(window, CAMERA) == pytest.approx(200e-6, rel=1e-9)
    after_exposure = readout_time_s(300, CAMERA) + CAMERA.transfer_s
    assert latency_s(window, CAMERA) - after_exposure == pytest.approx(0.5 * CAMERA.exposure_s, rel=1e-9)
