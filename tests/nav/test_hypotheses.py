"""Rings that candidates may form, and how likely each is by accident."""

from dataclasses import replace
from math import comb
from types import SimpleNamespace

import numpy as np
import pytest

from dockair.calibration import Camera
from dockair.nav.identify import hypotheses
from dockair.nav.identify.brightness import brightness_model
from dockair.nav.identify.hypotheses import (
    METHODS,
    Candidates,
    IdentifySettings,
    _contained,
    _keys,
    _octagons,
    _tested,
    _triples_of,
    ring_fits,
    without_impostors,
)
from dockair.nav.identify.perspective import fit_ring
from dockair.nav.identify.prior import make_prior

SETTINGS = IdentifySettings()
OPEN = make_prior(SETTINGS.radius_range_px, 1.0, 0.25, None, None, None, None, None)
both_methods = pytest.mark.parametrize("method", METHODS)


def candidates_at(points, flux=None):
    brightness = None if flux is None else brightness_model(flux, SETTINGS.brightness)
    return Candidates(points=points, sigma_px=0.1, brightness=brightness)


def fits_of(points, method="three_point", flux=None):
    return ring_fits(candidates_at(points, flux), method, OPEN, Camera(), SETTINGS, 1e-3)


@both_methods
def test_both_methods_propose_every_triple_of_a_frontal_ring(method, ring_scene):
    scene = ring_scene(np.random.default_rng(41), tilt_deg=1.0, clutter=10, range_m=(3.0, 8.0))
    proposed = {tuple(sorted(triple)) for triple in _triples_of(scene.points, method, OPEN).tolist()}
    leds = np.flatnonzero(scene.numbers >= 0).tolist()
    assert all((a, b, c) in proposed for a in leds for b in leds for c in leds if a < b < c)
    assert len(proposed) == len(_triples_of(scene.points, method, OPEN))  # none twice


@both_methods
def test_a_true_ring_comes_first_and_only_once(method, ring_scene):
    rng = np.random.default_rng(42)
    for _ in range(10):
        scene = ring_scene(rng, clutter=8)
        fits = fits_of(scene.points, method)
        np.testing.assert_array_equal(np.sort(fits[0].fit.candidate), np.sort(np.flatnonzero(scene.numbers >= 0)))
        assert sum(one.fit.count == 8 for one in fits) == 1
        assert all(b.log10_false_rings >= a.log10_false_rings for a, b in zip(fits, fits[1:], strict=False))


def test_the_expected_number_of_accidental_rings_is_the_formulas(ring_scene):
    """Eq. (1) of `chance` by hand, from the fit's own tolerance and the number of hypotheses that were looked up."""
    scene = ring_scene(np.random.default_rng(43), visible=6, clutter=12, range_m=(5.0, 8.0))
    best = fits_of(scene.points)[0]
    assert best.fit.count == 6
    tested = _octagons(candidates_at(scene.points), "three_point", OPEN, Camera(), SETTINGS).tested_right_angles
    distance = np.hypot(*(scene.points - best.fit.centre_px).T)
    near = np.count_nonzero(distance[scene.numbers < 0] < 1.6 * best.fit.radius_px)
    crowd = near / (np.pi * (1.6 * best.fit.radius_px) ** 2)
    p = max((18 - 3) / np.prod(np.ptp(scene.points, axis=0)), crowd) * np.pi * best.fit.tolerance_px**2
    assert best.log10_false_rings == pytest.approx(np.log10(tested * comb(5, 3) * p**3), abs=1e-6)


def test_two_rings_of_eight_are_both_fitted(ring_scene):
    """Each has up to 112 hypotheses that find it whole; told apart from one another only by who is next to whom."""
    rng = np.random.default_rng(44)
    tried = 0
    while tried < 12:
        first, second = (ring_scene(rng, range_m=span) for span in ((6.0, 8.0), (3.5, 4.5)))
        if np.hypot(*(first.centre_px - second.centre_px)) > 1.2 * (first.radius_px + second.radius_px):
            fits = fits_of(np.vstack([first.points, second.points]))
            assert sorted(one.fit.count for one in fits)[-2:] == [8, 8]
            tried += 1


def test_hypotheses_have_one_key_exactly_when_they_are_the_same_up_to_the_symmetry():
    rng = np.random.default_rng(45)
    rows = np.array([rng.permutation(np.r_[rng.choice(60, 5, replace=False), -1, -1, -1]) for _ in range(2000)])
    keys = _keys(rows)
    assert len(np.unique(keys)) == len(
        np.unique([min(np.roll(row, k).tolist() for k in range(8)) for row in rows], axis=0)
    )
    for turn in range(8):
        np.testing.assert_array_equal(_keys(np.roll(rows, turn, axis=1)), keys)


def test_equal_brightness_lowers_accidents_and_odds_by_their_likelihood_ratios(ring_scene):
    scene = ring_scene(np.random.default_rng(47), visible=6, clutter=12, clutter_box_radii=1.5, range_m=(5.0, 8.0))
    flux = np.where(scene.numbers >= 0, 100.0, np.geomspace(1.0, 1e4, len(scene.numbers)))
    by_place, by_both = fits_of(scene.points)[0], fits_of(scene.points, flux=flux)[0]
    np.testing.assert_array_equal(by_place.fit.candidate, by_both.fit.candidate)
    L, L_i = brightness_model(flux, SETTINGS.brightness).likelihood_ratios(by_both.fit.candidate[None])
    assert L[0] > 10.0
    assert by_place.log10_false_rings - by_both.log10_false_rings == pytest.approx(np.log10(L[0]))
    np.testing.assert_allclose(by_place.odds / L_i[0], by_both.odds)


def test_unequal_brightness_makes_no_ring_an_accident(ring_scene):
    """Markov's bound says nothing of an L below 1."""
    scene = ring_scene(np.random.default_rng(48), clutter=5, range_m=(5.0, 8.0))
    flux = np.geomspace(1.0, 1e4, len(scene.numbers))
    assert fits_of(scene.points)[0].log10_false_rings == fits_of(scene.points, flux=flux)[0].log10_false_rings


@both_methods
def test_no_more_is_fitted_than_the_settings_allow_and_nothing_after_two_whole_rings(method, ring_scene, monkeypatch):
    """Five blobs about each LED of one ring are 8^5 rings; two apart from one another settle it."""
    fits = []
    monkeypatch.setattr(hypotheses, "fit_ring", lambda *a, **k: fits.append(fit_ring(*a, **k)) or fits[-1])
    scene = ring_scene(np.random.default_rng(49), range_m=(8.0, 9.0))
    crowd = np.vstack([scene.led_px] * 5) + 1.5 * np.random.default_rng(50).standard_normal((40, 2))
    fits_of(crowd, method)
    assert 3 < len(fits) <= SETTINGS.max_fits
    fits.clear()
    three = np.vstack([scene.led_px + 3.0 * scene.radius_px * np.array([k, 0.0]) for k in range(3)])
    fits_of(three, method)
    assert len(fits) == 2


def test_a_doubtful_member_is_left_out_and_two_are_too_many(ring_scene):
    best = fits_of(ring_scene(np.random.default_rng(46)).points)[0]
    worst = int(np.argmax(best.odds))
    most = float(best.odds.sum())
    assert without_impostors(best, most) is best.fit
    fewer = without_impostors(best, most - 0.5 * best.odds[worst])
    assert fewer.count == 7 and fewer.candidate[worst] == -1
    assert without_impostors(best, 0.1 * most) is None


def test_no_impostor_is_taken_out_of_four_leds_or_where_the_rest_is_doubtful_too(ring_scene):
    best = fits_of(ring_scene(np.random.default_rng(46)).points)[0]
    odds = np.zeros(8)
    odds[2] = 1.0
    for seen, taken in ((range(5), True), (range(4), False)):
        candidate = np.where(np.isin(np.arange(8), seen), best.fit.candidate, -1)
        few = replace(best, fit=replace(best.fit, candidate=candidate), odds=odds)
        assert (without_impostors(few, 0.5) is not None) == taken
    alike = replace(best, odds=np.full(8, 0.4))  # 2.8 less the worst
    assert without_impostors(alike, 2.79) is None and without_impostors(alike, 2.81).count == 7


def test_every_ring_of_five_leds_is_found_by_right_angles_and_one_of_four_by_all_patterns():
    tested = SimpleNamespace(tested_right_angles=30, tested=210)
    np.testing.assert_array_equal(_tested(tested, np.array([4, 5, 8])), [210, 30, 30])


@pytest.mark.parametrize(("sigma_px", "tolerance_px"), [(0.02, 1.0), (0.1, 1.0), (0.3, 3.0)])
def test_octagons_are_looked_up_within_two_and_a_half_tolerances_and_at_least_a_pixel(
    sigma_px, tolerance_px, monkeypatch
):
    told = {}
    monkeypatch.setattr(hypotheses, "find_octagons", lambda *_, **keys: told.update(keys))
    candidates = Candidates(points=np.random.default_rng(9).uniform(0.0, 1000.0, (6, 2)), sigma_px=sigma_px)
    _octagons(candidates, "three_point", OPEN, Camera(), SETTINGS)
    assert told["tolerance_px"] == pytest.approx(tolerance_px)


def test_a_hypothesis_lies_in_another_up_to_the_rings_symmetry():
    whole = np.arange(8)
    parts = np.array(
        [
            [2, 3, -1, -1, 6, -1, 0, 1],  # turned by two places, with gaps
            [0, 1, 2, 3, 4, 5, 6, 7],
            [1, 0, 2, 3, 4, 5, 6, 7],  # two exchanged
            [7, 6, 5, 4, 3, 2, 1, 0],  # the other way round
        ]
    )
    assert _contained(whole, parts).tolist() == [True, True, False, False]
