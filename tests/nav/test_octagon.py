"""Octagons looked up from three candidates and the slots they may take."""

from itertools import combinations

import numpy as np
import pytest

from dockair.calibration import Camera
from dockair.nav.identify.octagon import _KEPT, RIGHT_ANGLES, SLOTS, _looked_up, find_octagons

ANGLE = np.arange(8) * np.pi / 4
CENTRE, RADIUS = np.array([900.0, 500.0]), 100.0
# so long a lens that projection is parallel; the ring on its axis
OPEN = {
    "focal_length_px": 1e6,
    "principal_point_px": (900.0, 500.0),
    "radius_range_px": (12.0, 700.0),
    "centre_gate": (0.0, 0.0, 1e6),
    "roll_gate": (0.0, np.pi),
    "min_axis_ratio": np.cos(np.deg2rad(40.0)),
    "tolerance_px": 1.0,
    "tolerance_per_radius": 0.01,
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


@pytest.mark.parametrize("hidden", list(combinations(range(8), 3)))
def test_right_angles_alone_find_any_five_leds(hidden):
    """Two of the eight parities share three of any five LEDs: 56 ways to hide three."""
    points = np.delete(octagon(), hidden, axis=0)
    triples = np.array(list(combinations(range(5), 3)))
    assert find_octagons(points, triples, RIGHT_ANGLES, **OPEN).count.max() == 5


@pytest.mark.parametrize(("range_m", "share"), [((2.0, 2.5), 0.98), ((3.0, 6.0), 0.99), ((10.0, 30.0), 1.0)])
def test_a_near_ring_anywhere_in_the_frame_is_looked_up_whole(range_m, share, ring_scene):
    """Perspective moves LEDs by 40 px at 2 m; three LEDs at right angles still say where the other five are."""
    rng, camera = np.random.default_rng(3), Camera()
    gates = OPEN | {"focal_length_px": camera.focal_length_px, "principal_point_px": camera.principal_point_px}
    triples = np.array(list(combinations(range(8), 3)))
    whole = 0
    for _ in range(200):
        points = ring_scene(rng, range_m=range_m, tilt_deg=20.0).points
        found = find_octagons(points, triples, RIGHT_ANGLES, **gates)
        whole += bool((found.count == 8).any())
    assert whole >= share * 200


def test_a_look_up_at_twenty_degrees_off_axis_is_as_narrow_as_the_noise(ring_scene):
    """At 15 m a blob 2.5 px beside a hidden LED's place is not taken for it by any three LEDs."""
    rng, camera = np.random.default_rng(4), Camera()
    gates = OPEN | {"focal_length_px": camera.focal_length_px, "principal_point_px": camera.principal_point_px}
    triples = np.array(list(combinations(range(7), 3)))
    for _ in range(30):
        scene = ring_scene(rng, range_m=(14.0, 16.0), sigma_px=0.0)
        angle = rng.uniform(-np.pi, np.pi)
        points = np.vstack([scene.led_px[:7], scene.led_px[7] + 4.0 * np.array([np.cos(angle), np.sin(angle)])])
        found = find_octagons(points, triples, RIGHT_ANGLES, **gates)
        assert found.count.max() == 7


def test_the_number_of_hypotheses_is_counted_apart_for_right_angles():
    points = np.vstack([octagon(), np.random.default_rng(2).uniform(300.0, 1500.0, (12, 2))])
    triples = np.array(list(combinations(range(20), 3)))
    every, right = find_octagons(points, triples, **OPEN), find_octagons(points, triples, RIGHT_ANGLES, **OPEN)
    assert every.tested_right_angles == right.tested_right_angles == right.tested
    assert every.tested > 3 * right.tested


def test_what_no_gate_lets_through_is_not_looked_up():
    shut = look_up(octagon(), centre_gate=(5000.0, 500.0, 1.0))
    assert shut.tested == shut.tested_right_angles == len(shut.count) == 0


def test_radius_and_tolerance_are_in_pixels():
    """Through so long a lens a ring of 100 px is found in any slots; its look-ups are 1 px and 1 % of that wide."""
    found = look_up(octagon(tilt_rad=0.6))
    whole = found.count == 8
    assert whole.sum() >= 56
    np.testing.assert_allclose(found.radius_px[whole], RADIUS, rtol=1e-6)
    np.testing.assert_allclose(found.tolerance_px[whole], 1.0 + 0.01 * RADIUS, atol=0.02)


def test_of_too_many_octagons_the_first_are_kept():
    count = _KEPT + 10
    ring = np.array([[1.0, 0.0, 0.0], [0.0, -0.1, 0.0], [0.0, 0.0, -0.1]])
    points = -0.1 * np.column_stack([np.cos(ANGLE), np.sin(ANGLE)])
    plausible, patterns = np.array([[0, 2, 4, 0]], np.int16), np.array([[2, 4]])
    row, found, candidate = _looked_up(
        points, plausible, patterns, np.zeros(count, np.int32), np.tile(ring, (count, 1, 1)), np.full((count, 2), 0.01)
    )
    assert row.tolist() == list(range(_KEPT)) and (found == 8).all()
    np.testing.assert_array_equal(candidate, np.tile(np.arange(8), (_KEPT, 1)))


@pytest.mark.parametrize("tolerance", [0.02, 0.06, 0.3])
def test_the_grid_finds_what_a_search_through_all_candidates_finds(tolerance):
    """Random rings over a crowd, look-ups up to a quarter, one and four cells wide; of two in one place the first."""
    rng = np.random.default_rng(6)
    points = rng.uniform(-1.0, 1.0, (30, 2))
    points = np.vstack([points, points[10:20]])
    count = 2000
    rings = np.empty((count, 3, 3))
    rings[:, 0] = np.column_stack([np.ones(count), rng.uniform(-1.0, 1.0, (count, 2))])
    rings[:, 1:] = rng.uniform(-0.4, 0.4, (count, 2, 3))
    size = np.column_stack([np.ones(count), rng.choice([0.5 * tolerance, tolerance], count)])
    plausible, patterns = np.array([[0, 1, 2, 0]], np.int16), np.array([[2, 4]])
    row, found, candidate = _looked_up(points, plausible, patterns, np.zeros(count, np.int32), rings, size)
    expected = {}
    for k, (ring, (_, reach)) in enumerate(zip(rings, size, strict=True)):
        X = ring[0] + np.column_stack([np.cos(ANGLE), np.sin(ANGLE)]) @ ring[1:]
        distance = np.linalg.norm(X[:, None, 1:] / X[:, None, :1] - points, axis=2)
        slots = np.where(distance.min(axis=1) < reach, distance.argmin(axis=1), -1)
        slots[[0, 2, 4]] = 0, 1, 2
        if (slots >= 0).sum() >= 4:
            expected[k] = slots
    assert 20 < len(expected) < count
    assert row.tolist() == list(expected)
    np.testing.assert_array_equal(candidate, np.array(list(expected.values())))
    np.testing.assert_array_equal(found, (candidate >= 0).sum(axis=1))
    assert candidate.shape[1] == SLOTS
