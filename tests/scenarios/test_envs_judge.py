"""Attempts judged from the truth: each way an attempt can end is told from the others."""

from types import SimpleNamespace

import pytest

from dockair.scenarios.envs.judge import AttemptJudge, AttemptLimits
from dockair.scenarios.judgement.attempts import RefereeLimits
from dockair.scenarios.judgement.referee import Outcome


def _watch(judge: AttemptJudge, *xs: float, aside: float = 0.0, touches: bool = False, latched: bool = False):
    for x in xs:
        failed, outcome = judge.watch(SimpleNamespace(p_DP=(x, 0.6 * aside, 0.8 * aside), latched=latched), touches)
    return failed, outcome


def test_a_tip_that_stays_behind_the_ring_tries_nothing():
    assert _watch(AttemptJudge(1), -4.0, -0.1, -3.0, -0.01, -2.0) == (False, None)


def test_a_tip_that_crosses_and_goes_back_has_missed_half_a_metre_behind():
    judge = AttemptJudge(1)
    assert _watch(judge, -0.1, 0.2, -0.49) == (False, None)
    assert _watch(judge, -0.51) == (True, Outcome.MISS)


def test_a_tip_that_flies_past_has_missed_a_metre_ahead():
    judge = AttemptJudge(1)
    assert _watch(judge, -0.1, 0.99) == (False, None)
    assert _watch(judge, 1.01) == (True, Outcome.MISS)


def test_a_tip_that_goes_aside_has_missed_a_metre_off_the_axis():
    judge = AttemptJudge(1)
    assert _watch(judge, -0.1, 0.2, aside=0.99) == (False, None)
    assert _watch(judge, 0.2, aside=1.01) == (True, Outcome.MISS)


def test_a_tip_that_crosses_the_plane_more_than_a_metre_off_the_axis_passes_by_and_may_come_back_to_try():
    judge = AttemptJudge(1)
    assert _watch(judge, -0.1, 0.2, 3.0, aside=3.0) == (False, None)
    assert judge.unfinished is None
    assert _watch(judge, 3.0, -0.6, -0.1, 0.2, aside=1.01) == (False, None)
    assert _watch(judge, -0.6, -0.1, 0.2, aside=0.99) == (False, None)
    assert judge.unfinished is Outcome.MISS


def test_who_crosses_at_the_limit_itself_tries_and_has_not_failed_yet():
    judge = AttemptJudge(1)
    assert _watch(judge, -0.1, 0.2, aside=1.0) == (False, None)
    assert judge.unfinished is Outcome.MISS


@pytest.mark.parametrize(("x", "over"), [(-0.5, True), (-0.4999, False), (0.9999, False), (1.0, True)])
def test_at_the_limits_along_the_axis_themselves_an_attempt_is_over(x, over):
    judge = AttemptJudge(1)
    assert _watch(judge, -0.1, 0.2, x) == ((True, Outcome.MISS) if over else (False, None))


def test_a_tip_in_the_plane_itself_has_crossed_it_and_from_there_on_is_not_behind_it():
    judge = AttemptJudge(1)
    _watch(judge, -0.1, 0.0)
    assert judge.unfinished is Outcome.MISS
    assert _watch(AttemptJudge(1), 0.0, 0.1, 3.0) == (False, None)


def test_the_coupling_ends_an_attempt_that_nobody_saw_begin():
    assert _watch(AttemptJudge(1), 0.3, latched=True) == (False, Outcome.CONTACT)


def test_who_tries_and_who_passes_by_is_told_as_by_the_flights_referee():
    assert AttemptLimits().aside_m == RefereeLimits().aside_m


@pytest.mark.parametrize(("touches", "outcome"), [(True, Outcome.RIM_STRIKE), (False, Outcome.MISS)])
def test_an_attempt_that_goes_on_when_time_is_over_has_failed(touches, outcome):
    judge = AttemptJudge(1)
    assert judge.unfinished is None
    _watch(judge, -0.1, 0.1, touches=touches)
    assert judge.unfinished is outcome
    _watch(judge, -0.6)
    assert judge.unfinished is None


def test_a_probe_that_touched_and_went_back_struck_the_rim():
    judge = AttemptJudge(1)
    _watch(judge, -0.05, touches=True)
    assert _watch(judge, -0.6) == (True, Outcome.RIM_STRIKE)


def test_a_touch_is_not_over_while_it_lasts():
    judge = AttemptJudge(1)
    assert _watch(judge, -0.1, 0.1, -0.7, touches=True) == (False, None)


def test_the_coupling_ends_it():
    judge = AttemptJudge(1)
    _watch(judge, -0.1, 0.2)
    assert _watch(judge, 0.3, latched=True) == (False, Outcome.CONTACT)


@pytest.mark.parametrize("attempts", [1, 2, 3])
def test_the_last_attempt_has_the_outcome_and_those_before_only_fail(attempts):
    judge = AttemptJudge(attempts)
    ends = [_watch(judge, -0.1, 0.2, -0.6) for _ in range(attempts)]
    assert ends == [(True, None)] * (attempts - 1) + [(True, Outcome.MISS)]
    assert judge.number == attempts


def test_a_strike_in_one_attempt_is_not_held_against_the_next():
    judge = AttemptJudge(2)
    _watch(judge, -0.05, touches=True)
    _watch(judge, -0.6)
    assert _watch(judge, -0.1, 0.2, -0.6) == (True, Outcome.MISS)


def test_a_flight_that_begins_ahead_of_the_ring_has_not_crossed_it():
    assert _watch(AttemptJudge(1), 0.5, 2.0) == (False, None)
