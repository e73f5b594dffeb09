"""What the belief foretells wrongly while it coasts, and what that adds to protection levels."""

import numpy as np
import pytest
from scipy.stats import chi2

from dockair.errors import DockairError
from dockair.nav.integrity.coasting import CoastingError, CoastingSettings
from dockair.nav.integrity.levels import ProtectionLevels

FRAME = ProtectionLevels(range_m=0.02, lateral_m=0.005)
HORIZON_S = CoastingSettings().horizon_s


def asked(sigma_m, seconds=60.0, age_s=HORIZON_S, seed=0):
    """A belief that was asked every 0.1 s, its errors of these sigmas (3,) at that age."""
    coasting, rng = CoastingError(), np.random.default_rng(seed)
    for time_s in np.arange(0.1, seconds, 0.1):
        assert coasting.due(time_s)
        coasting.take(rng.normal(0.0, sigma_m, 3), age_s, time_s)
    return coasting


def test_the_sigma_at_the_horizon_is_that_of_the_errors():
    # 6 s of memory hold about 120 squares: sigma is good to 1 / sqrt(240) = 6 %
    assert asked(np.array([0.01, 0.03, 0.06])).sigma_m(HORIZON_S) == pytest.approx([0.01, 0.03, 0.06], rel=0.25)


def test_of_one_answer_the_assumption_is_half():
    coasting = CoastingError()
    coasting.take(np.zeros(3), HORIZON_S, 10.0)
    assert coasting.sigma_m(HORIZON_S) == pytest.approx(CoastingSettings().sigma_m / np.sqrt(2.0), rel=0.02)


def test_it_grows_as_by_white_acceleration_and_then_as_by_one_that_changes_at_random():
    coasting = asked(np.full(3, 0.02))
    h = coasting.sigma_m(HORIZON_S)
    assert coasting.sigma_m(0.25 * HORIZON_S) == pytest.approx(h / 8.0)
    assert coasting.sigma_m(2.0 * HORIZON_S) == pytest.approx(2.0**2.5 * h)


@pytest.mark.parametrize("power", [3.2, 3.7, 4.1])
@pytest.mark.parametrize("ratio", [0.8, 1.0, 1.2, 1.5])
def test_errors_of_another_age_do_not_make_it_smaller_than_it_is(power, ratio):
    """They grow by powers of the age between Eq. (1)'s two, as on flights."""
    at_age = asked(np.full(3, 0.02 * ratio ** (power / 2.0)), age_s=ratio * HORIZON_S).sigma_m(HORIZON_S)
    assert (at_age >= 0.999 * asked(np.full(3, 0.02)).sigma_m(HORIZON_S)).all()


@pytest.mark.parametrize(("ratio", "power"), [(0.5, 5), (2.0, 3)])
def test_an_error_of_another_age_is_brought_to_the_horizon_by_the_larger_variance_of_the_two_powers(ratio, power):
    at_horizon, other = asked(np.full(3, 0.02)), asked(np.full(3, 0.02), age_s=ratio * HORIZON_S)
    prior = np.exp(-59.8 / CoastingSettings().memory_s)  # what is assumed before anything is measured has faded to that
    share = other.sigma_m(HORIZON_S) ** 2 / at_horizon.sigma_m(HORIZON_S) ** 2
    np.testing.assert_allclose(share, ratio**-power, rtol=30.0 * prior)


def test_stronger_gusts_are_known_within_the_memory():
    coasting = asked(np.full(3, 0.01), seconds=30.0)
    calm = coasting.sigma_m(HORIZON_S).max()
    rng = np.random.default_rng(1)
    for time_s in np.arange(30.0, 36.0, 0.1):
        coasting.take(rng.normal(0.0, 0.1, 3), HORIZON_S, time_s)
    assert calm < 0.015 and coasting.sigma_m(HORIZON_S).min() > 0.06


def test_levels_are_exceeded_as_often_as_they_say():
    """Errors as they were measured: the level across beyond that of the frame is exceeded by `risk` of them."""
    settings = CoastingSettings(risk=0.05, memory_s=1e4)
    coasting, rng = CoastingError(settings), np.random.default_rng(2)
    errors = rng.normal(0.0, 0.03, (4000, 3))
    for k, error in enumerate(errors):
        coasting.take(error, HORIZON_S, 0.1 * (k + 1))
    level = coasting.added(ProtectionLevels(range_m=0.0, lateral_m=0.0), HORIZON_S, np.zeros(3))
    beyond_m = np.abs(errors[:, 0]) > level.range_m, np.hypot(errors[:, 1], errors[:, 2]) > level.lateral_m
    for beyond in beyond_m:  # three sigmas of the binomial: 0.05 +- 0.010
        assert np.mean(beyond) == pytest.approx(settings.risk, abs=0.011)


def test_the_worse_of_the_two_axes_across_counts():
    coasting = asked(np.array([0.001, 0.01, 0.05]))
    up = float(coasting.sigma_m(HORIZON_S)[2])
    k = float(np.sqrt(chi2.isf(CoastingSettings().risk, 2)))
    assert coasting.added(FRAME, HORIZON_S, np.zeros(3)).lateral_m == pytest.approx(FRAME.lateral_m + k * up)


def test_a_frame_of_now_adds_nothing_and_no_frame_at_all_promises_nothing():
    coasting = asked(np.full(3, 0.02))
    assert coasting.added(FRAME, 0.0, np.zeros(3)) == FRAME
    for age_s in (np.nan, -0.01):
        nothing = coasting.added(FRAME, age_s, np.zeros(3))
        assert nothing.range_m == nothing.lateral_m == np.inf


def test_a_belief_that_is_less_sure_of_itself_promises_no_more_than_that():
    coasting = asked(np.full(3, 0.001))
    one, two = np.sqrt(chi2.isf(CoastingSettings().risk, [1, 2]))
    added = coasting.added(FRAME, HORIZON_S, np.array([0.0, 0.04, 0.02]))
    assert added.lateral_m == pytest.approx(FRAME.lateral_m + two * 0.04)
    assert added.range_m < FRAME.range_m + 0.005
    along = coasting.added(FRAME, HORIZON_S, np.array([0.03, 0.0, 0.0]))
    assert along.range_m == pytest.approx(FRAME.range_m + one * 0.03)
    assert along.lateral_m < FRAME.lateral_m + 0.006


def test_only_a_belief_that_was_asked_lately_is_like_those_that_were():
    assert not CoastingError().is_of(0.0)
    coasting = asked(np.full(3, 0.02), seconds=10.0)
    asked_s = 9.9  # the last time
    assert coasting.is_of(asked_s + 0.99 * HORIZON_S) and not coasting.is_of(asked_s + 1.01 * HORIZON_S)
    assert not coasting.due(9.95) and coasting.due(10.0)  # 9.9 s was the last


def test_what_was_measured_fades_also_while_nothing_is():
    coasting = asked(np.full(3, 0.01), seconds=30.0)
    coasting.take(np.full(3, 0.1), HORIZON_S, 90.0)
    assert coasting.sigma_m(HORIZON_S) == pytest.approx(0.1, rel=0.01)


def test_an_answer_after_a_pause_weighs_no_more_than_one_of_the_horizon():
    """The answer before it, and the assumption, have faded to 1/e of two horizons: the prior is as long as one."""
    settings, coasting = CoastingSettings(), CoastingError()
    coasting.take(np.zeros(3), HORIZON_S, 10.0)
    coasting.take(np.full(3, 0.1), HORIZON_S, 10.0 + settings.memory_s)
    kept_s = (settings.prior_s + HORIZON_S) / np.e
    squares = settings.prior_s / np.e * settings.sigma_m**2 + HORIZON_S * 0.1**2
    assert coasting.sigma_m(HORIZON_S) ** 2 == pytest.approx(squares / (kept_s + HORIZON_S))


def test_what_was_not_foretold_says_nothing():
    coasting = asked(np.full(3, 0.02))
    before = coasting.sigma_m(HORIZON_S)
    coasting.take(np.full(3, np.nan), np.nan, 100.0)
    assert np.array_equal(coasting.sigma_m(HORIZON_S), before) and coasting.due(100.0)


@pytest.mark.parametrize("wrong", [{"horizon_s": 0.0}, {"risk": 0.5}, {"risk": 0.0}, {"sigma_m": float("nan")}])
def test_settings_that_cannot_be(wrong):
    with pytest.raises(DockairError, match=rf"coasting\.{next(iter(wrong))}"):
        CoastingSettings(**wrong)
