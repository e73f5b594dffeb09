"""Accidental rings and impostors."""

from dataclasses import replace

import numpy as np
import pytest

from dockair.calibration import Camera
from dockair.nav.identify.chance import (
    box_area_px2,
    densities_px2,
    log10_false_rings,
    log10_false_rings_of_one,
    member_odds,
)
from dockair.nav.identify.perspective import fit_ring

CAMERA = Camera()
TILT = {"tolerance_px": 0.4, "tolerance_per_radius": 0.0}


def fitted(scene):
    slots = np.full(8, -1)
    for index, number in enumerate(scene.numbers):
        if number >= 0:
            slots[number] = index
    return fit_ring(scene.points, slots, CAMERA.focal_length_px, CAMERA.principal_point_px, **TILT)


@pytest.mark.parametrize(("count", "ways"), [(3, 1), (4, 5), (5, 10), (6, 10), (7, 5), (8, 1)])
def test_false_rings_are_hypotheses_times_ways_times_chance(count, ways):
    assert log10_false_rings(1000, count, 1e-3) == pytest.approx(np.log10(1000 * ways * 1e-3 ** (count - 3)))
    assert log10_false_rings_of_one(1000, count, 1e-3) == pytest.approx(float(log10_false_rings(1000, count, 1e-3)))


@pytest.mark.parametrize("tested", [0, 1, 1000])
@pytest.mark.parametrize("p", [0.0, 1e-13, 2.0])
def test_false_rings_are_finite_without_hypotheses_and_without_clutter(tested, p):
    """At least one hypothesis and a chance of 1e-12, at most of 1."""
    expected = np.log10(max(tested, 1) * 10 * min(max(p, 1e-12), 1.0) ** 2)
    assert log10_false_rings(tested, 5, p) == pytest.approx(expected)
    assert log10_false_rings_of_one(tested, 5, p) == pytest.approx(expected)


def test_a_box_that_the_ring_overfills_counts_as_the_ring_and_members_are_clutter_to_an_accident_alone(ring_scene):
    """Five LEDs on one side; then all eight, and forty blobs far away."""
    scene = ring_scene(np.random.default_rng(5), visible=8, clutter=0, tilt_deg=0.0, range_m=(8.0, 9.0))
    order = np.argsort(scene.numbers)
    points = scene.points[order]
    candidate = np.where(np.arange(8) < 5, np.arange(8), -1)
    part = fit_ring(points, candidate, CAMERA.focal_length_px, CAMERA.principal_point_px, **TILT)
    area = np.pi * part.radius_px**2
    assert densities_px2(points[:5], part)[0] == pytest.approx(2.0 / area)
    far = points.mean(axis=0) + np.random.default_rng(6).uniform(3.0, 5.0, (40, 2)) * part.radius_px
    blobs = np.vstack([points, far])
    whole = fit_ring(blobs, np.arange(8), CAMERA.focal_length_px, CAMERA.principal_point_px, **TILT)
    assert whole.count == 8
    area = box_area_px2(blobs)
    assert densities_px2(blobs, whole) == pytest.approx((45.0 / area, 40.0 / area))


def test_the_odds_of_a_member_far_off_are_finite():
    scene_px = np.array([900.0, 500.0]) - 100.0 * np.exp(1j * np.pi / 4 * np.arange(8)).view(float).reshape(8, 2)
    fit = fit_ring(scene_px, np.arange(8), CAMERA.focal_length_px, CAMERA.principal_point_px, **TILT)
    scene_px[3] += 50.0
    odds = member_odds(scene_px, fit, 1e-6, 4.0)
    assert odds[3] == odds.max() > 1e6 and np.isfinite(odds).all()


def test_a_box_has_its_area_and_no_box_one_pixel():
    assert box_area_px2(np.array([[1.0, 2.0], [4.0, 9.0]])) == 21.0
    assert box_area_px2(np.zeros((5, 2))) == 1.0


def test_clutter_near_the_ring_counts_more_than_the_same_far_away(ring_scene):
    scene = ring_scene(np.random.default_rng(51), range_m=(9.0, 10.0), tilt_deg=1.0)
    fit = fitted(scene)
    far = np.vstack([scene.points, [[0.0, 0.0], [2047.0, 1087.0], [0.0, 1087.0]]])
    near = np.vstack([scene.points, fit.centre_px + fit.radius_px * np.array([[0.2, 0.1], [-0.3, 0.4], [1.4, 0.0]])])
    near = np.vstack([near, [[0.0, 0.0], [2047.0, 1087.0]]])
    neighbourhood = np.pi * (1.6 * fit.radius_px) ** 2
    assert densities_px2(near, fit)[0] == pytest.approx(3 / neighbourhood)
    assert densities_px2(near, fit)[1] == pytest.approx(3.2 / neighbourhood)
    assert densities_px2(far, fit)[0] == pytest.approx(8 / (2047.0 * 1087.0))


def test_the_odds_are_the_formulas_and_grow_with_the_residual(ring_scene):
    """Eq. (2) by hand for six LEDs: g = 2, h = 1/2; the most doubtful is the one farthest off."""
    scene = ring_scene(np.random.default_rng(52), visible=6, range_m=(9.0, 10.0))
    fit = fitted(scene)
    assert fit.count == 6
    odds = member_odds(scene.points, fit, 1e-4, 4.0)
    filled = np.flatnonzero(fit.candidate >= 0)
    d2 = ((scene.points[fit.candidate[filled]] - fit.slots_px[filled]) ** 2).sum(axis=1)
    np.testing.assert_allclose(odds[filled], 0.5 * 1e-4 * 2 * np.pi * 0.01 * 2 * np.exp(d2 * 2 / 0.02), rtol=1e-9)
    assert (odds[fit.candidate < 0] == 0.0).all()
    assert filled[np.argmax(d2)] == np.argmax(odds)


def test_fewer_leds_are_more_doubtful_with_the_same_residuals(ring_scene):
    scene = ring_scene(np.random.default_rng(53), sigma_px=0.0, range_m=(9.0, 10.0))
    whole = fitted(scene)
    odds = []
    for hidden in ([], [0], [0, 1], [0, 1, 2]):
        part = whole.candidate.copy()
        part[hidden] = -1
        odds.append(member_odds(scene.points, replace(whole, candidate=part), 1e-4, 4.0)[7])
    assert (np.diff(odds) > 0.0).all()
