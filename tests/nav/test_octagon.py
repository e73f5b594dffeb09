"""Octagons looked up from three candidates and the slots they may take."""

from itertools import combinations

import numpy as np
import pytest

from dockair.nav.identify.octagon import find_octagons

ANGLE = np.arange(8) * np.pi / 4
CENTRE, RADIUS = np.array([900.0, 500.0]), 100.0
OPEN = {
    "radius_range_px": (12.0, 700.0),
    "centre_gate": (0.0, 0.0, 1e6),
    "roll_gate": (0.0, np.pi),
    "min_axis_ratio": np.cos(np.deg2rad(40.0)),
    "tolerance_px": 1.0,
    "tolerance_per_radius": 0.01,
    "perspective_per_radius_squared": 0.0,
    "capacity": 256,
}


def octagon(tilt_rad=0.5, axis_rad=0.7, roll_rad=0.2):
    """(8, 2) parallel projection of LEDs 0 to 7 of a ring tilted about an axis in the image."""
    led = -RADIUS * np.column_stack([np.cos(ANGLE + roll_rad), np.sin(ANGLE + roll_rad)])
    turn = np.array([[np.cos(axis_rad), -np.sin(axis_rad)], [np.sin(axis_rad), np.cos(axis_rad)]])
    return CENTRE + led @ turn @ np.diag([1.0, np.cos(tilt_rad)]) @ turn.T


def look_up(points, **gates):
    triples = np.array(list(combinations(range(len(points)), 3)))
    return find_octagons(points, triples, **(OPEN | gates))


def is_turned(candidate, expected):
    """Whether every slot holds the LED that is as many places on."""
    return any(np.array_equal(candidate, np.roll(expected, k)) for k in range(8))


def test_any_three_leds_of_an_affine_octagon_find_the_other_five_in_their_slots():
    order = np.random.default_rng(1).permutation(8)
    points = np.empty((8, 2))
    points[order] = octagon()
    for triple in combinations(range(8), 3):
        found = find_octagons(points, np.array([triple]), **OPEN)
        whole = found.count == 8
        assert whole.any()
        assert all(is_turned(candidate, order) for candidate in found.candidate[whole])


def test_a_missing_led_leaves_its_slot_empty():
    points = np.delete(octagon(), 5, axis=0)
    found = look_up(points)
    assert found.count.max() == 7
    best = found.candidate[found.count == 7][0]
    assert is_turned(best, np.array([0, 1, 2, 3, 4, -1, 5, 6]))


def test_a_ring_tilted_beyond_the_limit_is_no_octagon():
    assert look_up(octagon(tilt_rad=np.deg2rad(38.0))).count.max() == 8
    assert not (look_up(octagon(tilt_rad=np.deg2rad(50.0))).count == 8).any()


@pytest.mark.parametrize(
    ("gate", "closed"),
    [
        ("radius_range_px", (105.0, 700.0)),
        ("radius_range_px", (12.0, 95.0)),
        ("centre_gate", (920.0, 500.0, 15.0)),
        ("roll_gate", (0.2 + np.pi / 8, 0.1)),
    ],
)
def test_each_gate_shuts_the_ring_out(gate, closed):
    assert not (look_up(octagon(), **{gate: closed}).count >= 6).any()


@pytest.mark.parametrize(
    ("gate", "ajar"),
    [
        ("radius_range_px", (95.0, 105.0)),
        ("centre_gate", (905.0, 500.0, 15.0)),
        ("roll_gate", (0.2, 0.1)),
        ("roll_gate", (0.2 + np.pi / 4, 0.1)),
    ],
)
def test_each_gate_lets_the_ring_through(gate, ajar):
    assert look_up(octagon(), **{gate: ajar}).count.max() == 8


def test_the_hypotheses_kept_are_those_with_most_leds():
    points = np.vstack([octagon(), np.random.default_rng(2).uniform(300.0, 1500.0, (20, 2))])
    every, few = look_up(points, capacity=4096), look_up(points, capacity=5)
    assert few.count.tolist() == sorted(every.count.tolist(), reverse=True)[:5]
    assert few.tested == every.tested
