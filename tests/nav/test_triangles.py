"""The first look at triples."""

from itertools import combinations, permutations

import numpy as np
import pytest

from dockair.calibration import Camera
from dockair.nav.identify.octagon import _INVERSES, ALL_PATTERNS, RIGHT_ANGLES
from dockair.nav.identify.triangles import plausible_maps
from dockair.rotations import exp

CAMERA = Camera()
COSINE_40 = float(np.cos(np.deg2rad(40.0)))


def plausible(points, triples, patterns=ALL_PATTERNS, k_min=1e-4, k_max=1.0, min_ratio=COSINE_40):
    relative = np.ascontiguousarray((points - np.array(CAMERA.principal_point_px)) / CAMERA.focal_length_px)
    inverses = _INVERSES[patterns[:, 0], patterns[:, 1]]
    return plausible_maps(relative, np.array(triples), inverses, k_min, k_max, min_ratio)


def three_of_a_small_ring(off_axis_deg, tilt_deg, *, k=1e-3, other_off_axis_deg=None):
    """(3, 2) LEDs 0, 2 and 4 of a ring tilted against its line of sight, away from the camera's axis.

    Another candidate, at another angle from the camera's axis, may come fourth.
    """
    towards, turn = (exp(np.array([0.0, 0.0, np.deg2rad(angle)])) for angle in (off_axis_deg, tilt_deg))
    axes = (towards @ turn)[:, 1:]
    p = towards[:, 0] / towards[0, 0]
    X = p + k / towards[0, 0] * np.array([axes[:, 0], axes[:, 1], -axes[:, 0]])
    if other_off_axis_deg is not None:
        X = np.vstack([X, [1.0, 0.0, np.tan(np.deg2rad(other_off_axis_deg))]])
    return CAMERA.pixels_from_points(X)


def is_kept(points, **limits):
    """Whether LEDs 0, 2 and 4 are plausible in their own slots; all other patterns are tried beside."""
    sought = [0, 1, 2, int(np.flatnonzero((ALL_PATTERNS == (2, 4)).all(axis=1))[0])]
    return sought in plausible(points, [(0, 1, 2)], **limits).tolist()


@pytest.mark.parametrize("range_m", [(2.2, 3.0), (4.0, 30.0)])
def test_no_three_leds_of_a_ring_are_turned_away(range_m, ring_scene):
    """Any tilt up to 30 degrees anywhere in the frame, in whatever order the three come."""
    rng = np.random.default_rng(14)
    for _ in range(40):
        scene = ring_scene(rng, range_m=range_m, sigma_px=0.0, tilt_deg=17.0)
        for triple in combinations(range(8), 3):
            order = list(permutations(triple))[rng.integers(6)]
            kept = {tuple(row) for row in plausible(scene.led_px, [order]).tolist()}
            sought = set()
            for a, b, c in (triple, triple[1:] + triple[:1], triple[2:] + triple[:2]):
                pattern = ((b - a) % 8, (c - a) % 8)
                sought.add((a, b, c, int(np.flatnonzero((ALL_PATTERNS == pattern).all(axis=1))[0])))
            assert kept & sought, triple


def test_triples_go_round_in_the_sense_of_the_numbers():
    rng = np.random.default_rng(15)
    points = rng.uniform([200.0, 200.0], [1800.0, 900.0], (10, 2))
    rows = plausible(points, list(combinations(range(10), 3)))
    e, f = points[rows[:, 1]] - points[rows[:, 0]], points[rows[:, 2]] - points[rows[:, 0]]
    assert len(rows) > 0
    assert (e[:, 0] * f[:, 1] - e[:, 1] * f[:, 0] > 0.0).all()


def test_lines_and_rings_too_large_drop_out(ring_scene):
    line = np.column_stack([np.linspace(500.0, 900.0, 3), np.linspace(300.0, 500.0, 3)])
    assert len(plausible(line, [(0, 1, 2)])) == 0
    scene = ring_scene(np.random.default_rng(16), range_m=(4.0, 5.0), sigma_px=0.0, tilt_deg=5.0)
    k = scene.radius_px / CAMERA.focal_length_px
    assert len(plausible(scene.led_px, [(0, 2, 4)], RIGHT_ANGLES, k_max=k)) >= 1
    assert len(plausible(scene.led_px, [(0, 2, 4)], RIGHT_ANGLES, k_max=0.4 * k)) == 0


@pytest.mark.parametrize(
    ("off_axis_deg", "limit_deg"), [(0.0, 46.4), (10.0, 54.6), (25.0, 67.6), (60.0, 84.8)], ids=lambda angle: f"{angle}"
)
@pytest.mark.parametrize("other_off_axis_deg", [None, 0.0, 30.0])
def test_the_tilt_may_be_larger_by_the_angle_off_the_axis(off_axis_deg, limit_deg, other_off_axis_deg):
    """Of 40 degrees against the camera's axis: arccos(0.9 cos(40 deg + angle)), or of 0.09 where that is less.

    How far off another candidate is makes no difference.
    """
    for tilt_deg, kept in ((limit_deg - 0.5, True), (limit_deg + 0.5, False), (limit_deg + 3.0, False)):
        points = three_of_a_small_ring(off_axis_deg, tilt_deg, other_off_axis_deg=other_off_axis_deg)
        assert is_kept(points) == kept, tilt_deg


@pytest.mark.parametrize("tilt_deg", [0.0, 40.0, 75.0])
def test_a_ring_as_large_as_allowed_is_kept_and_one_much_larger_or_smaller_is_not(tilt_deg):
    """The squared size is between half the trace and the trace: 0.7 and 3 of it leave perspective some room."""
    points, trace = three_of_a_small_ring(0.0, tilt_deg), 1.0 + np.cos(np.deg2rad(tilt_deg)) ** 2
    least, most = np.sqrt(trace / 0.7) * 1e-3, np.sqrt(trace / 3.0) * 1e-3
    lenient = {"min_ratio": np.cos(np.deg2rad(78.0))}
    assert is_kept(points, k_min=1e-3, k_max=1e-3, **lenient)
    assert is_kept(points, k_min=0.99 * least, **lenient) and not is_kept(points, k_min=1.01 * least, **lenient)
    assert is_kept(points, k_max=1.01 * most, **lenient) and not is_kept(points, k_max=0.99 * most, **lenient)


def test_most_of_what_clutter_offers_is_turned_away():
    rng = np.random.default_rng(17)
    points = rng.uniform([0.0, 0.0], [2047.0, 1087.0], (30, 2))
    triples = list(combinations(range(30), 3))
    assert len(plausible(points, triples, RIGHT_ANGLES)) < 0.1 * 3 * len(triples)
