"""Rings in space through three candidates."""

from itertools import combinations

import numpy as np
import pytest
from scipy.linalg import polar

from dockair.calibration import Camera, LedRing
from dockair.nav.identify.octagon import _INVERSES, ALL_PATTERNS
from dockair.nav.identify.posit import rings_through
from dockair.rotations import matrix_from_yaw_pitch_roll

CAMERA = Camera()
OPEN = (0.0, 1.0, 0.0, 0.0, 1e6, 0.0, np.pi, np.cos(np.deg2rad(40.0)))
ANY_TILT = (*OPEN[:7], -1.0)
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


def count_passing(points, *, k, u, v, roll):
    """Rings through points in slots 0, 2, 4 that pass gates of 8 % in size, 0.01 in place and 4 degrees in roll."""
    return len(rings_of(points, (0, 2, 4), (0.92 * k, 1.08 * k, u, v, 0.01, roll, np.deg2rad(4.0), -1.0))[0])


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
        rings, size = rings_of(relative(scene.led_px)[list(slots)], slots)
        assert len(rings) > 0
        for ring, k in zip(rings, size[:, 0], strict=True):
            a, b = ring[1:]
            assert a @ b == pytest.approx(0.0, abs=1e-9)
            assert a @ a == pytest.approx(b @ b, rel=1e-9) == pytest.approx(k * k, rel=1e-9)


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


@pytest.mark.parametrize(("range_m", "share", "peak"), [(2.5, 0.96, 0.8), (4.0, 1.0, 0.45)])
def test_what_two_steps_leave_is_within_the_tolerance_and_not_far_within(range_m, share, peak, ring_scene):
    """Exact projections and no room for noise: the worst LED of the better ring over the tolerance, for three tilts."""
    rng = np.random.default_rng(37)
    ratios = []
    for tilt_deg in (3.0, 10.0, 20.0):
        for _ in range(60):
            leds = relative(ring_scene(rng, range_m=(range_m, range_m + 0.1), sigma_px=0.0, tilt_deg=tilt_deg).led_px)
            for slots in ((0, 2, 4), (0, 2, 6), (0, 4, 6)):
                rings, size = rings_of(leds[list(slots)], slots, ANY_TILT, tol=0.0, tol_k=0.0)
                off = [np.hypot(*(images_of(ring)[:8] - leds).T).max() for ring in rings]
                ratios.append(min(off / size[:, 1]))
    assert np.mean(np.array(ratios) <= 1.0) >= share
    assert np.reshape(ratios, (3, -1)).max(axis=1).min() > peak


def test_the_tolerance_is_what_the_caller_gives_and_what_the_steps_leave():
    """Seen along its axis a ring is one ring, which needs no step; tilted, each of two has as much room more."""
    led = -0.0625 * np.column_stack([np.cos(ANGLE), np.sin(ANGLE)])
    _, frontal = rings_of(led[[0, 2, 4]], (0, 2, 4), tol=1e-3, tol_k=0.02)
    np.testing.assert_allclose(frontal, [[0.0625, 1e-3 + 0.02 * 0.0625]], rtol=1e-3)
    tilted = (led * [1.0, np.cos(0.5)])[[0, 2, 4]]
    _, bare = rings_of(tilted, (0, 2, 4), tol=0.0, tol_k=0.0)
    _, roomy = rings_of(tilted, (0, 2, 4), tol=1e-3, tol_k=0.02)
    assert len(bare) == 2
    np.testing.assert_allclose(roomy[:, 1] - bare[:, 1], 1e-3 + 0.02 * bare[:, 0], rtol=1e-9)


def test_the_gate_on_the_tilt_keeps_the_rings_whose_axis_is_near_the_camera_s(ring_scene):
    """Anywhere in the frame, so that the aimed camera's is another. Of the limit 0.9 times the cosine counts."""
    rng = np.random.default_rng(38)
    kept = left_out = 0
    for _ in range(60):
        leds = relative(ring_scene(rng, range_m=(6.0, 9.0), sigma_px=0.0, tilt_deg=35.0).led_px)
        every, size = rings_of(leds[[0, 2, 4]], (0, 2, 4), ANY_TILT)
        cosine = np.cross(every[:, 1], every[:, 2])[:, 0] / size[:, 0] ** 2
        gated, _ = rings_of(leds[[0, 2, 4]], (0, 2, 4), (*ANY_TILT[:7], np.cos(np.deg2rad(25.0))))
        inside = cosine >= 0.9 * np.cos(np.deg2rad(25.0))
        np.testing.assert_allclose(gated, every[inside])
        kept, left_out = kept + inside.sum(), left_out + (~inside).sum()
    assert kept > 20 and left_out > 20


def test_the_gates_are_on_the_ring_as_the_camera_has_it_far_off_its_axis():
    """Size over the depth along the camera's axis, place, and roll of the image, here by differences: 36 deg off."""
    rng = np.random.default_rng(39)
    for _ in range(40):
        R, p = matrix_from_yaw_pitch_roll(*rng.uniform(-0.4, 0.4, 3)), 8.0 * np.array([1.0, 0.6, -0.4])
        steps = 1e-3 * R[:, 1:].T
        image = relative(CAMERA.pixels_from_points(p + np.vstack([steps, -steps, np.zeros(3)])))
        turn, _ = polar((image[:2] - image[2:4]).T)
        true = {"k": 0.25 / p[0], "u": image[4, 0], "v": image[4, 1], "roll": np.arctan2(turn[1, 0], turn[0, 0])}
        leds = relative(CAMERA.pixels_from_points(p + LedRing().positions_D @ R.T))[[0, 2, 4]]
        assert count_passing(leds, **true) > 0
        for name, off in (("k", 0.2 * true["k"]), ("u", 0.02), ("v", 0.02), ("roll", 0.15)):
            for sign in (-1.0, 1.0):
                assert count_passing(leds, **(true | {name: true[name] + sign * off})) == 0, name


def test_a_roll_tolerance_of_less_than_half_a_place_is_a_gate():
    """22.5 degrees are the farthest that a ring of eight can be turned from a roll; 20 are beyond 15."""
    leds = -0.0625 * np.column_stack([np.cos(ANGLE), np.sin(ANGLE)])[[0, 2, 4]]
    for roll_deg, tolerance_deg, passes in ((20.0, 15.0, False), (20.0, 21.0, True), (22.4, 22.5, True)):
        gates = (*OPEN[:5], np.deg2rad(roll_deg), np.deg2rad(tolerance_deg), OPEN[7])
        assert (len(rings_of(leds, (0, 2, 4), gates)[0]) > 0) == passes


def test_all_patterns_are_the_ways_to_seat_two_more():
    assert len(ALL_PATTERNS) == 21
    assert (ALL_PATTERNS[:, 0] < ALL_PATTERNS[:, 1]).all()
