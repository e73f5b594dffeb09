"""The maps' laws, and that they belong to the place on the sensor.

Statistical bounds are 4.5 standard errors, a false alarm in 1.5e5 for each; keys are fixed.
"""

from dataclasses import replace

import numpy as np
import pytest
from scipy import stats

from dockair.parameters import load_parameters
from dockair.sim.camera.fixed_pattern import FixedPattern
from dockair.sim.camera.sheets import SensorParameters

SENSOR = load_parameters("sensor", SensorParameters)
SHAPE = (600, 800)
PATTERN = FixedPattern(SENSOR, 3, *SHAPE)
PIXELS_E = PATTERN.offset_e - PATTERN.column_e


def test_the_maps_have_the_sheets_standard_deviations_and_no_mean() -> None:
    n = SHAPE[0] * SHAPE[1]
    for found, mean, sigma in (
        (PATTERN.gain, 1.0, SENSOR.photo_response_nonuniformity),
        (PIXELS_E, 0.0, SENSOR.dark_signal_nonuniformity_e),
        (PATTERN.column_e, 0.0, SENSOR.column_pattern_e),
    ):
        found = found.astype(float)
        assert found.std() == pytest.approx(sigma, rel=4.5 / np.sqrt(2 * found.size))
        assert found.mean() == pytest.approx(mean, abs=4.5 * sigma / np.sqrt(found.size))
    assert n == PATTERN.gain.size


def test_pixels_gains_are_normal_as_far_as_the_bytes_reach() -> None:
    """By Kolmogorov and Smirnov at 1e-5, the steps filled by uniform numbers."""
    rng = np.random.default_rng(0)
    for steps in (PATTERN.gain_map, PATTERN.offset_map):
        z = (
            (steps.ravel() + rng.uniform(-0.5, 0.5, steps.size))
            * PATTERN.gain_step
            / SENSOR.photo_response_nonuniformity
        )
        assert stats.kstest(z, "norm").pvalue > 1e-5
        assert 4.2 < np.abs(z).max() < 4.4


def test_gain_and_offset_neighbours_and_columns_are_uncorrelated() -> None:
    gain, offset = (np.asarray(m, dtype=float) for m in (PATTERN.gain_map, PATTERN.offset_map))
    pairs = [(gain, offset), (gain[:, 1:], gain[:, :-1]), (gain[1:], gain[:-1]), (offset[1:], gain[:-1])]
    pairs += [(offset.mean(axis=0), PATTERN.column_e), (gain.mean(axis=0), PATTERN.column_e)]
    for a, b in pairs:
        assert abs(np.corrcoef(a.ravel(), b.ravel())[0, 1]) < 4.5 / np.sqrt(a.size)


def test_a_pixel_does_not_depend_on_how_large_the_sensor_is() -> None:
    corner = FixedPattern(SENSOR, 3, 31, 77)
    assert np.array_equal(corner.gain_map, PATTERN.gain_map[:31, :77])
    assert np.array_equal(corner.offset_e, PATTERN.offset_e[:31, :77])
    assert corner.shape == (31, 77)


def test_another_key_is_another_sensor_and_the_same_key_the_same() -> None:
    again, other = FixedPattern(SENSOR, 3, *SHAPE), FixedPattern(SENSOR, 4, *SHAPE)
    assert np.array_equal(again.gain_map, PATTERN.gain_map) and np.array_equal(again.offset_e, PATTERN.offset_e)
    for a, b in ((other.gain_map, PATTERN.gain_map), (other.column_e, PATTERN.column_e)):
        assert abs(np.corrcoef(a.ravel(), b.ravel())[0, 1]) < 4.5 / np.sqrt(a.size)


def test_a_pattern_that_has_been_drawn_stays_as_it_is() -> None:
    for array in (PATTERN.gain_map, PATTERN.offset_map, PATTERN.column_e):
        with pytest.raises(ValueError, match="read-only"):
            array[0] = 0


def test_an_even_sensor_has_no_pattern() -> None:
    even = FixedPattern(
        replace(SENSOR, photo_response_nonuniformity=0.0, dark_signal_nonuniformity_e=0.0, column_pattern_e=0.0),
        3,
        9,
        9,
    )
    assert np.all(even.gain == 1.0) and np.all(even.offset_e == 0.0)
