"""The log of attempts on hand-made truths: when each begins and ends, how, and where the tip was."""

import dataclasses

import numpy as np
import pytest

from dockair.rotations import exp
from dockair.scenarios.judgement.attempts import Attempt, first_attempt_succeeded, is_good_contact, succeeded
from dockair.scenarios.judgement.referee import Outcome, Referee
from dockair.scenarios.loop import Flight
from dockair.scenarios.schema import load_scenario
from dockair.sim.truth import Truth

AFT = (-3.0, 0.0, 0.0)


class Pilot:
    """Leads a tip through places and phases, one hundredth of a second each, and keeps the referee informed."""

    def __init__(self, make_truth):
        self.referee, self.time_s, self._make_truth = Referee(), 0.0, make_truth

    def fly(self, phase, *places, reason="", v_tip=(1.2, 0.0, 0.0), **truth):
        for place in places:
            self.time_s = round(self.time_s + 0.01, 2)
            now = self._make_truth(self.time_s, p_WP=np.array(place), v_WP=np.array(v_tip), **truth)
            self.referee.watch(now)
            self.outcome = self.referee.judge(now, phase, 600.0, reason=reason)
        return self

    def log(self, outcome=None):
        return self.referee.attempt_log(self.time_s, outcome)


@pytest.fixture
def pilot(make_truth):
    """A new one at every call."""
    return lambda: Pilot(make_truth)


def outcomes(pilot, outcome=None):
    return [(attempt.number, attempt.outcome) for attempt in pilot.log(outcome)]


def test_before_the_first_approach_there_is_no_attempt(pilot):
    assert pilot().fly("join_up", AFT).fly("pre_contact", AFT, AFT).log() == ()


def test_three_attempts_of_one_flight_are_three_entries_each_with_its_own_end_and_reason(pilot):
    one = pilot().fly("pre_contact", AFT).fly("approach", AFT, (-2.0, 0.2, 0.0))
    one.fly("back_off", (-2.1, 0.3, 0.0), AFT, reason="predicted miss 0.31 m").fly("pre_contact", AFT)
    one.fly("approach", AFT, (-1.0, 0.0, 0.0)).fly("breakaway", (-1.1, 0.0, 0.0), reason="track lost").fly(
        "pre_contact", AFT
    )
    one.fly("approach", AFT, (-0.1, 0.04, 0.03), (0.1, 0.04, 0.03), (0.3, 0.0, 0.0))
    one.fly("contact", (0.3, 0.0, 0.0), latched=True).fly("hold", (0.3, 0.0, 0.0), latched=True).fly("clear", AFT)
    assert outcomes(one) == [(1, "given_up"), (2, "breakaway"), (3, "contact")]
    assert [attempt.reason for attempt in one.log()] == ["predicted miss 0.31 m", "track lost", ""]
    assert [(a.begun_s, a.ended_s) for a in one.log()] == [(0.02, 0.04), (0.07, 0.09), (0.11, 0.15)]


def test_what_the_probe_strikes_while_it_is_being_called_back_belongs_to_the_attempt(pilot):
    one = pilot().fly("approach", AFT, (-0.3, 0.3, 0.0)).fly("back_off", (-0.05, 0.24, 0.0), probe_touches_drogue=True)
    assert outcomes(one) == [(1, "rim_strike")]
    assert one.log()[0].ended_s == 0.03  # for the navigation it was over before
    assert outcomes(one.fly("back_off", (0.01, 0.3, 0.0)).fly("pre_contact", AFT)) == [(1, "rim_strike")]


def test_going_from_contact_back_to_approach_is_no_new_attempt(pilot):
    one = pilot().fly("approach", AFT).fly("contact", (0.2, 0.0, 0.0)).fly("approach", (0.2, 0.0, 0.0))
    assert len(one.log()) == 1


def test_an_attempt_that_nobody_announced_begins_with_the_first_touch_or_in_the_rings_plane(pilot):
    touched = (
        pilot()
        .fly("pre_contact", AFT, (-0.01, 0.24, 0.0))
        .fly("pre_contact", (-0.01, 0.24, 0.0), probe_touches_drogue=True)
    )
    crossed = pilot().fly("pre_contact", AFT, (-0.01, 0.4, 0.0), (0.01, 0.4, 0.0))
    assert outcomes(touched) == [(1, "rim_strike")] and touched.log()[0].begun_s == 0.03
    assert outcomes(crossed) == [(1, "miss")] and crossed.log()[0].begun_s == 0.03


def test_the_offset_of_a_miss_is_the_smallest_of_its_crossings_and_that_of_one_called_off_where_it_came_nearest(pilot):
    missed = pilot().fly(
        "approach", (-0.1, 0.5, 0.0), (0.1, 0.5, 0.0), (-0.1, 0.3, 0.4), (0.1, 0.24, -0.32), (0.5, 0.0, 0.0),
        (-0.1, 0.0, 0.0), (0.1, 0.45, 0.0),
    )  # fmt: skip
    (attempt,) = missed.fly("back_off", AFT).log()
    assert attempt.outcome == "miss"
    assert (attempt.left_m, attempt.up_m) == (0.24, -0.32) and attempt.radial_offset_m == pytest.approx(0.4)
    assert attempt.decided_s == 0.04
    called_off = pilot().fly("approach", AFT, (-1.0, 0.3, 0.4), (-2.0, 0.0, 0.0)).fly("back_off", AFT)
    assert called_off.log()[0].radial_offset_m == pytest.approx(0.5)
    called_off.fly("pre_contact", (-0.9, 0.0, 0.0))  # blown nearer while it waits for its next attempt
    assert called_off.log()[0].radial_offset_m == pytest.approx(0.5)


def test_of_a_contact_offset_and_speed_are_those_of_the_last_crossing_and_the_angle_that_of_the_latch(pilot):
    one = pilot().fly("approach", (-0.1, 0.02, 0.0), (0.1, 0.02, 0.0), (-0.1, 0.0, 0.0))  # bounced off and came again
    one.fly("approach", (0.02, 0.0, 0.09), v_tip=(1.1, 0.0, 0.0))
    one.fly("contact", (0.3, 0.0, 0.0), latched=True, v_tip=(0.1, 0.0, 0.0), R_WB=exp(np.radians([0.0, 3.0, 0.0])))
    one.fly("disconnect", (-0.1, 0.3, 0.0), (0.1, 0.3, 0.0))  # a probe that is free again swings through the plane
    (attempt,) = one.log()
    assert attempt.radial_offset_m == pytest.approx(0.09)
    assert attempt.closure_speed_m_s == pytest.approx(1.1)
    assert attempt.angle_deg == pytest.approx(3.0)
    contact = one.referee.contact
    assert (contact.radial_offset_m, contact.closure_speed_m_s) == (attempt.radial_offset_m, attempt.closure_speed_m_s)


@pytest.mark.parametrize(
    ("phase", "expected"), [("breakaway", "breakaway"), ("back_off", "given_up"), ("clear", "given_up")]
)
def test_only_who_breaks_away_has_broken_away_and_who_goes_back_or_clear_has_given_up(pilot, phase, expected):
    assert outcomes(pilot().fly("approach", AFT).fly(phase, AFT)) == [(1, expected)]


def test_a_probe_that_is_held_after_it_was_called_back_has_docked_when_it_is_held(pilot):
    late = (
        pilot().fly("approach", (-0.1, 0.0, 0.0), (0.2, 0.0, 0.0)).fly("back_off", (0.25, 0.0, 0.0), reason="too far")
    )
    (attempt,) = late.fly("back_off", (0.3, 0.0, 0.0), latched=True).log()
    assert (attempt.outcome, attempt.ended_s, attempt.reason) == ("contact", 0.04, "too far")


def test_the_number_of_the_attempt_is_that_which_goes_on_or_was_the_last(pilot):
    one, numbers = pilot(), []
    for phase in ("join_up", "approach", "back_off", "pre_contact", "approach", "contact", "hold", "clear"):
        numbers.append(one.fly(phase, AFT).referee.attempt)
    assert numbers == [1, 1, 1, 1, 2, 2, 2, 2]


@pytest.mark.parametrize(
    ("outcome", "hit", "expected"),
    [(Outcome.TIMEOUT, "", "timeout"), (Outcome.DIVERGED, "", "diverged"), (Outcome.COLLISION, "hose_3", "collision")],
)
def test_an_attempt_that_the_flight_did_not_outlive_says_so(pilot, outcome, hit, expected):
    one = pilot().fly("approach", AFT, AFT, receiver_touches=hit)
    assert outcomes(one, outcome) == [(1, expected)]
    assert one.log(outcome)[0].ended_s == 0.02


GOOD = Attempt(
    number=1, begun_s=3.0, ended_s=7.0, outcome="contact", radial_offset_m=0.15, closure_speed_m_s=2.6, angle_deg=10.0,
    left_m=0.0, up_m=0.15, decided_s=6.9,
)  # fmt: skip


@pytest.mark.parametrize(
    "change",
    [{"radial_offset_m": 0.151}, {"closure_speed_m_s": 2.61}, {"angle_deg": 10.1}, {"outcome": "rim_strike"},
     {"radial_offset_m": float("nan")}],
)  # fmt: skip
def test_a_contact_beyond_any_limit_is_no_success(change):
    assert is_good_contact(GOOD)
    assert not is_good_contact(dataclasses.replace(GOOD, **change))


def test_success_counts_any_attempt_and_the_first_attempt_only_the_first():
    bad = dataclasses.replace(GOOD, outcome="miss")
    assert succeeded([bad, GOOD]) and not first_attempt_succeeded([bad, GOOD])
    assert succeeded([GOOD, bad]) and first_attempt_succeeded([GOOD, bad])
    assert not succeeded([]) and not first_attempt_succeeded([])


def test_the_loop_tells_the_referee_phase_and_reason_of_the_navigation_and_whether_its_solution_is_usable():
    flight = Flight(load_scenario("truth_navigation"), 0)
    says = iter([("pre_contact", ""), ("approach", "steady for 3 s"), ("back_off", "predicted miss"), ("clear", "")])
    whole = flight.navigator.step

    def step(imu, frame):
        phase, reason = next(says)
        return dataclasses.replace(whole(imu, frame), phase=phase, phase_reason=reason, contact_usable=False)

    flight.navigator.step = step
    ended = [flight.step().outcome for _ in range(4)]
    assert ended == [None, None, None, Outcome.ABORT]
    (attempt,) = flight.referee.attempt_log(flight.truth.time_s, Outcome.ABORT)
    assert (attempt.outcome, attempt.reason) == ("given_up", "predicted miss")
    assert (attempt.begun_s, attempt.ended_s) == pytest.approx((0.02, 0.03))
    flight.referee.watch(dataclasses.replace(plain(flight.truth), latched=True))
    assert flight.referee.unsafe == ("contact on a solution marked unusable",)


def plain(truth):
    """A truth of its own fields."""
    return Truth(**{f.name: getattr(truth, f.name) for f in dataclasses.fields(Truth)})
