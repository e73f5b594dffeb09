"""Likelihood ratios of brightnesses."""

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.stats import norm

from dockair.nav.identify.brightness import BrightnessSettings, brightness_model

SETTINGS = BrightnessSettings()


def ratios(flux, *rings, spread=0.0):
    table = np.full((len(rings), 8), -1)
    for row, ring in zip(table, rings, strict=True):
        row[: len(ring)] = ring
    return brightness_model(np.asarray(flux, dtype=float), SETTINGS, spread).likelihood_ratios(table)


@pytest.mark.parametrize("members", [3, 5, 8])
def test_the_ratio_is_the_integral_of_the_formula(members):
    """Eq. (1) by quadrature, q from its definition."""
    rng = np.random.default_rng(61)
    x = np.concatenate([rng.normal(2.0, 0.3, members), rng.uniform(-1.0, 4.0, 9)])
    s = SETTINGS
    q = (s.prior_weight / s.prior_range + norm.pdf(x[:members, None], x[members:], s.kernel).sum(axis=1)) / (
        s.prior_weight + 9
    )

    def integrand(mu):
        return np.prod(s.outliers + (1.0 - s.outliers) * norm.pdf(x[:members], mu, s.sigma) / q) / s.mean_range

    margin = 2.0 * s.sigma  # far from the candidates the integrand is that of outliers alone
    expected = quad(integrand, x.min() - margin, x.max() + margin, limit=200, epsrel=1e-9)[0]
    assert ratios(np.exp(x), range(members))[0][0] == pytest.approx(expected, rel=2e-3)


def test_the_integral_holds_also_where_no_candidate_is_brighter_or_fainter_than_the_ring():
    """Eight LEDs alike and nothing else: q is that of the prior, and the integrand ends a sigma from them."""
    s = SETTINGS

    def integrand(mu):
        r = s.outliers + (1.0 - s.outliers) * norm.pdf(mu, 0.0, s.sigma) * s.prior_range
        return r**8 / s.mean_range

    expected = quad(integrand, -6.0 * s.sigma, 6.0 * s.sigma, epsrel=1e-9)[0]
    assert ratios(np.full(8, 50.0), range(8))[0][0] == pytest.approx(expected, rel=2e-3)


def test_the_integral_goes_on_beyond_a_ring_of_few_leds_that_are_alike():
    """Three: at a standard deviation from them the integrand is still a quarter of its height."""
    s = SETTINGS

    def integrand(mu):
        return (s.outliers + (1.0 - s.outliers) * norm.pdf(mu, 0.0, s.sigma) * s.prior_range) ** 3 / s.mean_range

    expected = quad(integrand, -6.0 * s.sigma, 6.0 * s.sigma, epsrel=1e-9)[0]
    assert ratios(np.full(3, 50.0), range(3))[0][0] == pytest.approx(expected, rel=0.01)


def test_the_sheet_s_spread_and_that_of_the_bins_add_as_independent_ones():
    flux, rings = np.array([1.0, 1.6, 0.7, 1.2, 2.5, 0.05, 40.0]), np.array([[0, 1, 2, 3, 4, -1, -1, -1]])
    wider = brightness_model(flux, BrightnessSettings(sigma=0.5), 0.0).likelihood_ratios(rings)
    both = brightness_model(flux, BrightnessSettings(sigma=0.3), 0.4).likelihood_ratios(rings)
    np.testing.assert_allclose(both[0], wider[0])
    np.testing.assert_allclose(both[1], wider[1])


@pytest.mark.parametrize("ends", [(-7.0, 7.0), (-30.0, 7.0), (-7.0, 30.0)])
def test_a_blob_farther_off_than_the_range_of_means_counts_as_at_its_end(ends):
    """About the median; so the ring's own ratio does not depend on how far off it is."""
    ring = np.random.default_rng(7).normal(0.0, 0.3, 9)
    ring -= np.median(ring)
    L, L_i = ratios(np.exp([*ring, *ends]), range(9)[:8])
    expected, expected_i = ratios(np.exp([*ring, -7.0, 7.0]), range(9)[:8])
    assert L[0] == pytest.approx(expected[0]) and L[0] > 10.0
    np.testing.assert_allclose(L_i, expected_i)


def test_the_ratio_of_one_member_is_that_of_the_ring_with_and_without_it_at_the_same_clutter():
    """Eq. (2). A blob whose flux is unknown is in no q, so that it can be taken out without another effect."""
    flux = np.array([1.0, 1.1, 0.9, 1.2, 4.0, 0.1, 20.0, 0.5])
    L, L_i = ratios(flux, range(5))
    assert (L_i[0, :4] > 1.0).all() and L_i[0, 4] < 0.2
    assert (L_i[0, 5:] == 1.0).all()
    without = flux.copy()
    without[4] = np.nan
    # one member fewer and one blob fewer: q at the others is the same
    assert L[0] / ratios(without, range(5))[0][0] == pytest.approx(L_i[0, 4])


def test_a_candidate_in_two_slots_is_one_blob():
    """Where a look-up is wider than half the way to the next LED; counted twice it would leave less than no clutter."""
    flux = np.full(12, 3.0)
    L, L_i = ratios(flux, range(6))
    twice, twice_i = ratios(flux, [*range(6), 0, 1])
    assert twice[0] == L[0]
    np.testing.assert_array_equal(twice_i, L_i)


def test_clutter_has_a_mean_ratio_of_one_at_most_and_so_exceeds_a_hundred_in_less_than_one_of_a_hundred():
    """2000 rings of five blobs among thirty, ln flux uniform: the mean's error is 0.1 to 0.2, its tail is heavy."""
    rng = np.random.default_rng(62)
    L = np.array([ratios(np.exp(rng.uniform(0.0, 4.6, 30)), range(5))[0][0] for _ in range(2000)])
    assert L.mean() < 1.5
    assert np.count_nonzero(L > 100.0) <= 20


def test_leds_of_two_to_one_bins_are_told_from_clutter_spread_over_a_hundred_to_one():
    """The median ring of five among twenty is ten times likelier LEDs; clutter as equal as LEDs says nothing."""
    rng = np.random.default_rng(63)
    leds = rng.uniform(2.0 / 3.0, 4.0 / 3.0, (300, 5))
    spread = np.exp(rng.uniform(-2.3, 2.3, (300, 20)))
    alike = rng.uniform(2.0 / 3.0, 4.0 / 3.0, (300, 20))
    medians = [np.median([ratios(row, range(5))[0][0] for row in np.hstack([leds, x])]) for x in (spread, alike)]
    assert medians[0] > 10.0
    assert medians[1] < 1.0


def test_the_unit_does_not_matter_and_nothing_known_is_one():
    flux = np.random.default_rng(64).uniform(1.0, 50.0, 12)
    for a, b in zip(ratios(flux, range(5), range(4, 12)), ratios(7e5 * flux, range(5), range(4, 12)), strict=True):
        np.testing.assert_allclose(a, b, rtol=1e-9)
    for nothing in (np.full(12, np.nan), np.zeros(12), np.full(12, -3.0), np.full(12, np.inf)):
        L, L_i = ratios(nothing, range(5))
        assert L[0] == 1.0 and (L_i == 1.0).all()


def test_a_blob_a_million_times_brighter_costs_no_more_than_one_a_thousand_times():
    flux = np.ones(20)
    flux[-1] = 1e300
    model = brightness_model(flux, SETTINGS)
    assert model.led.shape[1] < 100
    assert np.isfinite(model.likelihood_ratios(np.arange(12, 20)[None])[0]).all()


def test_a_coded_rings_own_spread_makes_its_bright_led_less_odd():
    flux = np.array([1.0, 1.0, 1.0, 1.0, 2.5, 0.05, 40.0])
    assert ratios(flux, range(5), spread=0.35)[1][0, 4] > 1.5 * ratios(flux, range(5))[1][0, 4]
