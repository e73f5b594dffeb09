"""Noise that was made ahead: the same bits as made at once, wherever the window goes meanwhile."""

from dataclasses import replace

import numpy as np
import pytest

from dockair.parameters import load_parameters
from dockair.sim.camera.electronics import digitise
from dockair.sim.camera.fixed_pattern import FixedPattern
from dockair.sim.camera.normals_ahead import NOTHING_AHEAD, NormalsAhead
from dockair.sim.camera.sheets import SensorParameters

SENSOR = load_parameters("sensor", SensorParameters)
SIZE, KEY, EXPOSURE_S = (1088, 2048), 4711, 20e-6
PATTERN = FixedPattern(SENSOR, 99, *SIZE)


def read(start, shape, frame_number, ahead, sensor=SENSOR):
    """A window from dark to beyond full well."""
    electrons = np.linspace(0.0, 1.3 * SENSOR.full_well_e, shape[0] * shape[1], dtype=np.float32).reshape(shape)
    return digitise(electrons, sensor, PATTERN, KEY, frame_number, start, EXPOSURE_S, ahead=ahead)


def held(ahead, start, shape, frame_number):
    return ahead.of(frame_number, start, shape)[0].size > 0


@pytest.mark.parametrize(
    ("before", "start", "shape"),
    [
        ((300, 500), (300, 500), (200, 300)),  # as it was
        ((300, 500), (284, 516), (200, 300)),  # moved
        ((300, 500), (284, 484), (232, 332)),  # grown
        ((0, 0), (0, 0), (216, 316)),  # in the corners
        ((888, 1748), (872, 1732), (216, 316)),
    ],
)
def test_a_window_that_moves_or_grows_by_sixteen_pixels_finds_its_numbers_and_reads_the_same(before, start, shape):
    ahead = NormalsAhead(KEY, SIZE)
    read(before, (200, 300), 5, ahead)
    assert ahead.work_ahead() and not ahead.work_ahead()
    assert held(ahead, start, shape, 6)
    assert np.array_equal(read(start, shape, 6, ahead), read(start, shape, 6, None))


@pytest.mark.parametrize(
    ("start", "shape", "frame_number"),
    [
        ((283, 500), (200, 300), 6),  # too far up, left, down, right
        ((300, 483), (200, 300), 6),
        ((317, 500), (200, 300), 6),
        ((300, 600), (200, 300), 6),
        ((300, 500), (200, 300), 7),  # a frame later: one was left out
        ((300, 500), (200, 300), 5),  # the same frame again
        ((0, 0), SIZE, 6),
    ],
)
def test_what_was_not_made_is_made_at_once(start, shape, frame_number):
    ahead = NormalsAhead(KEY, SIZE)
    read((300, 500), (200, 300), 5, ahead)
    ahead.work_ahead()
    assert ahead.of(frame_number, start, shape) is NOTHING_AHEAD
    assert np.array_equal(read(start, shape, frame_number, ahead), read(start, shape, frame_number, None))


def test_a_window_whose_last_lanes_reach_beyond_what_was_made_is_made_at_once():
    """Rows are worked on 64 pixels at once: 321 from 516 on take the columns up to 900, and 880 are there."""
    ahead = NormalsAhead(KEY, SIZE)
    read((300, 500), (200, 300), 5, ahead)
    ahead.work_ahead()
    for columns, is_held in ((316, True), (320, True), (321, False), (364, False)):
        assert held(ahead, (300, 516), (200, columns), 6) == is_held
        assert np.array_equal(read((300, 516), (200, columns), 6, ahead), read((300, 516), (200, columns), 6, None))


def test_nothing_is_made_before_a_frame_nor_for_a_sensor_that_counts_electrons():
    ahead, counts = NormalsAhead(KEY, SIZE), replace(SENSOR, read_noise_e=2.0)
    assert not ahead.work_ahead()
    read((300, 500), (20, 30), 5, ahead, counts)
    assert not ahead.work_ahead()


def test_frame_after_frame_reads_the_same_with_a_window_that_wanders():
    rng, ahead = np.random.default_rng(1), NormalsAhead(KEY, SIZE)
    start, found = np.array([400, 900]), 0
    for number in range(40):
        start = np.clip(start + rng.integers(-20, 21, 2), 0, (800, 1700))
        shape = (int(rng.integers(180, 220)), int(rng.integers(180, 300)))
        where = int(start[0]), int(start[1])
        found += held(ahead, where, shape, number)
        assert np.array_equal(read(where, shape, number, ahead), read(where, shape, number, None))
        ahead.work_ahead()
    assert 0 < found < 40
