"""The first look at triples."""

from itertools import combinations, permutations

import numpy as np
import pytest

from dockair.calibration import Camera
from dockair.nav.identify.octagon import _INVERSES, ALL_PATTERNS, RIGHT_ANGLES
from dockair.nav.identify.triangles import plausible_maps

CAMERA = Camera()
COSINE_40 = float(np.cos(np.deg2rad(40.0)))


def plausible(points, triples, patterns=ALL_PATTERNS, k_max=1.0):
    relative = np.ascontiguousarray((points - np.array(CAMERA.principal_point_px)) / CAMERA.focal_length_px)
    inverses = _INVERSES[patterns[:, 0], patterns[:, 1]]
    return plausible_maps(relative, np.array(triples), inverses, 1e-4, k_max, COSINE_40)


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


def test_most_of_what_clutter_offers_is_turned_away():
    rng = np.random.default_rng(17)
    points = rng.uniform([0.0, 0.0], [2047.0, 1087.0], (30, 2))
    triples = list(combinations(range(30), 3))
    assert len(plausible(points, triples, RIGHT_ANGLES)) < 0.1 * 3 * len(triples)
