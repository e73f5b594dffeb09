"""Intervals and tails of a count of successes."""

import math

import numpy as np
import pytest
from scipy.special import ndtri
from scipy.stats import binomtest

from dockair.scenarios.statistics import (
    largest_rejected_count,
    probability_of_at_most,
    sign_test,
    trials_to_reject_none,
    wilson_interval,
)


@pytest.mark.parametrize(
    ("successes", "trials", "low", "high"),
    [(81, 263, 0.2553, 0.3662), (15, 148, 0.0624, 0.1605), (0, 20, 0.0000, 0.1611), (1, 29, 0.0061, 0.1718)],
)
def test_the_interval_is_that_of_the_published_table(successes, trials, low, high):
    # [Newcombe 1998, Statistics in Medicine 17, 857, table I, method 3]
    assert wilson_interval(successes, trials) == pytest.approx((low, high), abs=5e-5)


@pytest.mark.parametrize("confidence", [0.8, 0.95, 0.999])
def test_at_both_limits_the_count_is_as_far_off_as_the_confidence_says(confidence):
    z = ndtri(0.5 + 0.5 * confidence)
    for successes, trials in ((1, 7), (30, 60), (199, 200)):
        for limit in wilson_interval(successes, trials, confidence):
            assert abs(successes / trials - limit) == pytest.approx(z * math.sqrt(limit * (1 - limit) / trials))


def test_none_and_all_leave_no_room_on_their_side_and_no_trial_says_nothing():
    for trials in range(1, 100):  # exactly, where rounding would leave some 1e-17
        assert wilson_interval(0, trials)[0] == 0.0
        assert wilson_interval(trials, trials)[1] == 1.0
    assert wilson_interval(0, 0) == (0.0, 1.0)


def test_the_tail_is_the_sum_of_the_binomial_terms():
    for trials, rate in ((1, 0.5), (12, 0.9), (40, 0.03)):
        terms = [math.comb(trials, k) * rate**k * (1 - rate) ** (trials - k) for k in range(trials + 1)]
        for k in range(trials):
            assert probability_of_at_most(k, trials, rate) == pytest.approx(sum(terms[: k + 1]), rel=1e-12)
    assert probability_of_at_most(-1, 12, 0.9) == 0.0
    assert probability_of_at_most(12, 12, 0.9) == 1.0


def test_the_rejected_count_is_the_last_that_is_too_unlikely():
    for trials in (1, 5, 20, 60, 200):
        for rate in (0.3, 0.7, 0.95, 1.0):
            for false_alarm in (0.05, 1e-3):
                count = largest_rejected_count(trials, rate, false_alarm)
                assert probability_of_at_most(count, trials, rate) < false_alarm
                assert count == trials - 1 or probability_of_at_most(count + 1, trials, rate) >= false_alarm
    assert largest_rejected_count(3, 0.7, 0.02) == -1  # 0.3 ** 3 is 0.027: three failures of three are no proof


@pytest.mark.parametrize("rate", [1e-3, 0.3, 0.5, 0.9, 0.999, 1.0])
@pytest.mark.parametrize("false_alarm", [0.4, 0.05, 1e-3, 1e-9])
def test_the_trials_that_reject_no_success_are_the_fewest_that_do(rate, false_alarm):
    needed = int(trials_to_reject_none(rate, false_alarm))
    assert probability_of_at_most(0, needed, rate) < false_alarm
    assert needed == 1 or probability_of_at_most(0, needed - 1, rate) >= false_alarm


def test_the_trials_of_a_rate_near_nothing_are_told_at_once():
    assert trials_to_reject_none(1e-9, 1e-3) == pytest.approx(math.log(1e3) * 1e9, rel=1e-8)
    assert trials_to_reject_none(5e-324, 1e-3) == math.inf


def test_ninety_five_of_a_hundred_intervals_hold_the_rate():
    generator, trials = np.random.default_rng(3), 60
    for rate in (0.5, 0.8, 0.95):
        held = [
            low <= rate <= high
            for low, high in (wilson_interval(int(k), trials) for k in generator.binomial(trials, rate, 2000))
        ]
        assert 0.92 <= np.mean(held) <= 0.985  # coverage of a discrete count; 2000 trials leave a sigma of 0.005


@pytest.mark.parametrize(("one", "other"), [(0, 0), (3, 1), (1, 3), (5, 5), (0, 9), (121, 59)])
def test_the_sign_test_is_the_exact_two_sided_binomial_test(one, other):
    expected = binomtest(one, one + other, 0.5).pvalue if one + other else 1.0
    assert sign_test(one, other) == pytest.approx(expected)
