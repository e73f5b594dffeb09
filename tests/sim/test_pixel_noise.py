"""The random numbers' laws, against SciPy's, and their independence.

Statistical bounds are 4.5 standard errors, a false alarm in 1.5e5 for each; keys are fixed.
"""

from dataclasses import replace

import numpy as np
import pytest
from scipy import stats
from scipy.special import ndtri

from dockair.parameters import load_parameters
from dockair.sim.camera.electronics import digitise
from dockair.sim.camera.fixed_pattern import FixedPattern
from dockair.sim.camera.pixel_noise import (
    EXACT_BELOW_E,
    LANES,
    _row_bits,
    count_from_normal,
    mix,
    normal_from_bits,
    padded_columns,
)
from dockair.sim.camera.sheets import SensorParameters

#: No pattern, no dark current, one level an electron, 12 bits.
FINE = replace(
    load_parameters("sensor", SensorParameters), photo_response_nonuniformity=0.0, dark_signal_nonuniformity_e=0.0,
    column_pattern_e=0.0, dark_current_e_s=0.0, parasitic_light_sensitivity=0.0, converter_bits=12, outputs=4,
    clock_hz=40e6, conversion_gain_dn_e=0.25, black_level_dn=50.0,
)  # fmt: skip
COUNTING = replace(FINE, read_noise_e=0.0, black_level_dn=0.0)
FULL = (1088, 2048)
PATTERN = FixedPattern(FINE, 99, *FULL)


def _levels(
    electrons: float, sensor: SensorParameters, key: int, frame: int = 0, shape: tuple[int, int] = (400, 500)
) -> np.ndarray:
    image = np.full(shape, electrons, dtype=np.float32)
    return digitise(image, sensor, PATTERN, key, frame, (0, 0), 20e-6, 12).astype(float)


def test_normal_numbers_are_the_quantiles_of_their_bits_to_5e_4_and_3e_5_in_distribution() -> None:
    """All magnitudes of the 31 bits, from the smallest to all ones, both signs; against SciPy's quantile."""
    magnitudes = np.unique(np.r_[np.arange(64), np.geomspace(64, 2**31 - 1, 4000).astype(np.int64)])
    for sign in (0, 1):
        bits = (magnitudes + (sign << 31)).astype(np.uint32)
        z = np.array([normal_from_bits(b) for b in bits], dtype=float)
        exact = (1.0 - 2.0 * sign) * -ndtri((magnitudes + 0.5) / 2.0**32)
        assert np.abs(z - exact).max() < 5e-4
        assert np.abs(stats.norm.cdf(z) - stats.norm.cdf(exact)).max() < 3e-5
    assert 6.2 < np.abs(z).max() < 6.4


def test_the_hash_gives_every_bit_to_half_of_consecutive_numbers_and_flips_half_for_a_flipped_bit() -> None:
    x = np.arange(20000, dtype=np.uint32)
    hashed = np.array([mix(i) for i in x], dtype=np.uint32)
    bound = 4.5 * 0.5 / np.sqrt(x.size)
    for bit in range(32):
        assert ((hashed >> np.uint32(bit)) & 1).mean() == pytest.approx(0.5, abs=bound)
    for bit in (0, 7, 20, 31):
        flipped = np.array([mix(i ^ np.uint32(1 << bit)) for i in x[:2000]], dtype=np.uint32)
        changed = np.bitwise_count(hashed[:2000] ^ flipped)
        assert changed.mean() == pytest.approx(16.0, abs=4.5 * np.sqrt(8.0 / 2000))


def test_the_numbers_along_a_row_go_on_by_an_odd_step_from_whatever_column() -> None:
    """Odd, so that 2^32 columns would have as many numbers; one column on is one step on, modulo 2^32."""
    for row in range(40):
        begin, step = _row_bits(np.uint64(5), 3, row, 0)
        assert int(step) % 2 == 1
        assert int(_row_bits(np.uint64(5), 3, row, 700)[0]) == (int(begin) + 700 * int(step)) % 2**32


@pytest.mark.parametrize(
    ("columns", "first", "worked_on"),
    [(1, 0, LANES), (LANES, 0, LANES), (LANES + 1, 100, 2 * LANES), (58, 1990, 58), (30, 2000, 48), (2048, 0, 2048)],
)
def test_a_rows_pixels_are_worked_on_in_whole_lanes_as_far_as_the_sensor_goes(
    columns: int, first: int, worked_on: int
) -> None:
    assert padded_columns(columns, first, 2048) == worked_on


@pytest.mark.parametrize("electrons", [0.1, 0.7, 3.3, 12.9, 29.99, 30.01, 300.0])
def test_counted_electrons_have_the_mean_and_the_variance_of_their_poisson_law(electrons: float) -> None:
    n = _levels(electrons, COUNTING, 11)
    assert n.mean() == pytest.approx(electrons, abs=4.5 * np.sqrt(electrons / n.size))
    variance_error = np.sqrt((electrons + 2.0 * electrons**2) / n.size)
    assert n.var() == pytest.approx(electrons, abs=4.5 * variance_error)


@pytest.mark.parametrize("electrons", [30.0, 45.2, 800.0])
def test_counts_above_the_exact_law_keep_its_mean_variance_and_skew_and_are_off_by_1e_3_in_distribution(
    electrons: float,
) -> None:
    """Integrals over two million equal shares of the normal law."""
    z = ndtri((np.arange(2_000_000) + 0.5) / 2_000_000)
    n = count_from_normal.py_func(electrons, z)
    assert n.mean() == pytest.approx(electrons, abs=2e-3)
    assert n.var() == pytest.approx(electrons, rel=5e-4)
    assert ((n - n.mean()) ** 3).mean() == pytest.approx(electrons, rel=0.03)
    k, counts = np.unique(n, return_counts=True)
    assert np.abs(np.cumsum(counts) / n.size - stats.poisson.cdf(k, electrons)).max() < 1e-3


@pytest.mark.parametrize("electrons", [0.2, 2.6, 17.3])
def test_few_electrons_follow_the_exact_poisson_law(electrons: float) -> None:
    """Chi-squared of the counts against the law; refused below 1e-5."""
    n = _levels(electrons, COUNTING, 13).ravel().astype(int)
    k = np.arange(n.max() + 1)
    expected = stats.poisson.pmf(k, electrons) * n.size
    kept = expected > 20.0
    observed = np.bincount(n, minlength=len(k))
    observed, expected = (np.append(x[kept], n.size - x[kept].sum()) for x in (observed, expected))
    assert stats.chisquare(observed, expected).pvalue > 1e-5


@pytest.mark.parametrize(("read_noise_e", "bound"), [(13.0, 5e-5), (EXACT_BELOW_E, 3e-4)])
def test_the_law_that_joins_shot_and_read_noise_is_their_convolution_within_its_stated_bound(
    read_noise_e: float, bound: float
) -> None:
    """Eq. (5) against the sum over the Poisson law, in distribution, where a pixel can be."""
    z = np.linspace(-5.0, 5.0, 201)
    for e in np.geomspace(0.1, 13000.0, 40):
        v = e + read_noise_e**2
        x = e + np.sqrt(v) * z + e / (6.0 * v) * (z**2 - 1.0)
        n = np.arange(max(0, int(e - 9.0 * np.sqrt(e) - 9)), int(e + 9.0 * np.sqrt(e) + 25))
        exact = stats.norm.cdf((x[:, None] - n) / read_noise_e) @ stats.poisson.pmf(n, e)
        assert np.abs(exact - stats.norm.cdf(z)).max() < bound


def test_the_read_noise_is_normal_out_to_5_standard_deviations() -> None:
    """Without light, a noise so wide that levels are fine: Kolmogorov and Smirnov, and the tails counted, at 1e-5."""
    wide = replace(FINE, read_noise_e=300.0, black_level_dn=500.0)
    rng = np.random.default_rng(0)
    raw = np.concatenate([_levels(0.0, wide, 17, frame, FULL).ravel() for frame in range(4)])
    z = (raw + rng.uniform(-0.5, 0.5, raw.size) - 2000.0) / 300.0
    assert stats.kstest(z[:500000], "norm").pvalue > 1e-5
    for limit in (3.5, 4.5, 5.0):
        beyond = int((np.abs(z) > limit).sum())
        assert stats.binomtest(beyond, z.size, 2.0 * stats.norm.sf(limit)).pvalue > 1e-5


def test_noise_is_uncorrelated_between_neighbours_rows_and_frames() -> None:
    """Of shifted frames; and the largest of 124750 pairs of rows, below 6.5 standard errors, a false alarm in 1e5."""
    a, b = (_levels(300.0, FINE, 29, i, (500, 2000)) for i in (0, 1))
    for x, y in ((a[:, 1:], a[:, :-1]), (a[1:], a[:-1]), (a, b), (a[1:, 1:], a[:-1, :-1]), (a[1:], b[:-1])):
        assert abs(np.corrcoef(x.ravel(), y.ravel())[0, 1]) < 4.5 / np.sqrt(x.size)
    rows = np.corrcoef(a) - np.eye(500)
    assert np.abs(rows).max() < 6.5 / np.sqrt(2000)


def test_means_of_rows_columns_and_frames_scatter_as_independent_pixels_do() -> None:
    """The variance of n means of m pixels is the pixels' over m, to 4.5 sqrt(2/n); frames' to 9 deviations."""
    frames = np.array([_levels(300.0, FINE, 31, i, FULL).astype(np.float32) for i in range(4)])
    v = float(frames[0].var())
    for means, averaged in ((frames[0].mean(0), FULL[0]), (frames[0].mean(1), FULL[1])):
        assert means.astype(float).var() == pytest.approx(v / averaged, rel=4.5 * np.sqrt(2.0 / means.size))
    of_frames = frames.reshape(4, -1).mean(axis=1, dtype=float)
    assert of_frames.max() - of_frames.min() < 2.0 * 4.5 * np.sqrt(v / (FULL[0] * FULL[1]))


def test_no_two_rows_of_three_frames_share_a_run_of_noise() -> None:
    """Runs of five levels of a wide noise, those that begin within 20 levels of its middle.

    2e5 of 6.7e6 runs: two are alike by chance once in 6e4 such tests, and two rows that ran alike would share dozens.
    """
    wide = replace(FINE, read_noise_e=300.0, black_level_dn=500.0)
    alike = []
    for frame in range(3):
        levels = _levels(0.0, wide, 33, frame, FULL).astype(np.int64)
        row, column = np.nonzero(np.abs(levels[:, :-4] - 2000) <= 10)
        alike.append(sum(levels[row, column + k] << (12 * k) for k in range(5)))
    runs = np.concatenate(alike)
    assert runs.size > 150000
    assert np.unique(runs).size == runs.size
