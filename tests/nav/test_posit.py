"""Rings in space through three candidates."""

from itertools import combinations

import numpy as np
import pytest

from dockair.calibration import Camera
from dockair.nav.identify.octagon import _INVERSES, ALL_PATTERNS
from dockair.nav.identify.posit import rings_through

CAMERA = Camera()
OPEN = (0.0, 1.0, 0.0, 0.0, 1e6, 0.0, np.pi, np.cos(np.deg2rad(40.0)))
ANGLE = np.arange(8) * np.pi / 4


def relative(points):
    return np.ascontiguousarray((points - np.array(CAMERA.principal_point_px)) / CAMERA.focal_length_px)


def rings_of(points, slots, gates=OPEN, tol=1e-4, tol_k=0.01):
    """Rings through points (3, 2) in slots a < b < c, turned so that the first has slot 0."""
    a, b, c = slots
    pattern = np.array([[b - a, c - a]])
    row, rings, size = rings_through(
        np.ascontiguousarray(points), np.array([[0, 1, 2, 0]], np.int16), pattern,
        _INVERSES[pattern[:, 0], pattern[:, 1]], gates, tol, tol_k,
    )  # fmt: skip
    assert (row == 0).all()
    return rings, size


def images_of(ring):
    """(9, 2) slots and centre."""
    X = ring[0] + np.vstack([np.column_stack([np.cos(ANGLE), np.sin(ANGLE)]) @ ring[1:], np.zeros(3)])
    return X[:, 1:] / X[:, :1]


@pytest.mark.parametrize("range_m", [2.5, 4.0, 8.0, 25.0])
def test_of_at_most_two_rings_one_has_every_led_within_its_tolerance(range_m, ring_scene):
    """Exact projections anywhere in the frame, any three LEDs but of short arcs. Slots go on from the first."""
    rng = np.random.default_rng(11)
    missed = 0
    for _ in range(60):
        scene = ring_scene(rng, range_m=(range_m, range_m + 0.1), sigma_px=0.0)
        slots = [(0, 2, 4), (0, 2, 6), (0, 3, 5), (0, 1, 4)][rng.integers(4)]
        leds = relative(scene.led_px)
        rings, size = rings_of(leds[list(slots)], slots)
        assert 1 <= len(rings) <= 2
        off = [np.hypot(*(images_of(ring)[:8] - leds).T).max() for ring in rings]
        missed += min(off / size[:, 1]) > 1.0
    assert missed <= 1


def test_the_three_leds_are_on_the_ring_and_its_size_and_centre_are_the_true_ones(ring_scene):
    """Through the three to half a pixel at 8 m, radius to 2 %, centre to a pixel: what two steps leave."""
    rng = np.random.default_rng(12)
    for _ in range(40):
        scene = ring_scene(rng, range_m=(8.0, 9.0), sigma_px=0.0)
        slots = (0, 2, 4)
        rings, size = rings_of(relative(scene.led_px)[list(slots)], slots)
        images = [images_of(ring) * CAMERA.focal_length_px + CAMERA.principal_point_px for ring in rings]
        best = int(np.argmin([np.abs(image[:8] - scene.led_px).max() for image in images]))
        np.testing.assert_allclose(images[best][list(slots)], scene.led_px[list(slots)], atol=0.5)
        np.testing.assert_allclose(images[best][8], scene.centre_px, atol=1.0)
        # k is the radius over the distance along the aimed axis, the ring's over its depth
        k = np.linalg.norm(rings[best][1]) / rings[best][0, 0]
        assert k * CAMERA.focal_length_px == pytest.approx(scene.radius_px, rel=0.02)
        assert size[best, 1] > 0.0


def test_axes_are_equally_long_and_perpendicular(ring_scene):
    """Eq. (2): what makes the affine map a ring in space."""
    rng = np.random.default_rng(13)
    scene = ring_scene(rng, range_m=(3.0, 4.0), sigma_px=0.0)
    for slots in combinations(range(5), 3):
        rings = rings_of(relative(scene.led_px)[list(slots)], slots)[0]
        assert len(rings) > 0
        for ring in rings:
            a, b = ring[1:]
            assert a @ b == pytest.approx(0.0, abs=1e-9)
            assert a @ a == pytest.approx(b @ b, rel=1e-9)


@pytest.mark.parametrize(
    ("place", "value"), [(0, 0.08), (1, 0.05), (2, 0.3), (5, np.pi / 8)], ids=["k_min", "k_max", "centre", "roll"]
)
def test_each_gate_shuts_a_ring_out(place, value):
    """A frontal ring of k = 0.0625 on the axis, LED 0 at the left, the first slot's LED there."""
    leds = -0.0625 * np.column_stack([np.cos(ANGLE), np.sin(ANGLE)])
    gates = list(OPEN)
    if place in (2, 5):
        gates[4 if place == 2 else 6] = 0.05
    assert len(rings_of(leds[[0, 2, 4]], (0, 2, 4), tuple(gates))[0]) >= 1
    gates[place] = value
    assert len(rings_of(leds[[0, 2, 4]], (0, 2, 4), tuple(gates))[0]) == 0


def test_all_patterns_are_the_ways_to_seat_two_more():
    assert len(ALL_PATTERNS) == 21
    assert (ALL_PATTERNS[:, 0] < ALL_PATTERNS[:, 1]).all()
