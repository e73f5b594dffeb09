"""The referee on hand-made truths: a probe tip led through the ring's plane."""

import dataclasses
import functools

import numpy as np
import pytest

from dockair.rotations import exp
from dockair.scenarios.judgement.attempts import RefereeLimits
from dockair.scenarios.judgement.referee import Outcome, Referee
from dockair.sim.truth import Truth


def truth_at(time_s, tip_D, v_tip=(1.2, 0.0, 0.0), *, latched=False, touches=False, hit="", R_WB=None):
    """Drogue at rest at the world's origin, so that the tip in drogue axes is the tip in W."""
    zero, unit = np.zeros(3), np.eye(3)
    values = {f.name: 0.0 for f in dataclasses.fields(Truth)}
    vectors = ("p_", "v_", "w_", "a_", "alpha_", "specific_force_", "gust")
    values |= {name: zero for name in values if name.startswith(vectors)}
    values |= {"R_WB": unit if R_WB is None else R_WB, "R_WD": unit, "R_WT": unit, "p_WH": np.zeros((2, 3))}
    values |= {"tick": round(time_s * 1000), "time_s": time_s, "p_WP": np.array(tip_D), "v_WP": np.array(v_tip)}
    values |= {"latched": latched, "probe_touches_drogue": touches, "receiver_touches": hit}
    return Truth(**values)


def through(referee, lateral, *, latch=False, touches=False, speed=1.2):
    for k, x in enumerate(np.arange(-0.5, 1.2, 0.01)):
        held = latch and x > 0.3
        truth = truth_at(
            k * 0.01 / speed, (x, lateral, 0.0), (speed, 0, 0), latched=held, touches=touches and 0 < x < 0.04
        )
        referee.watch(truth)
        if held:
            return truth
    return truth


def test_contact_reports_offset_and_speed_at_the_ring_and_the_angle_at_the_latch():
    referee = Referee()
    for k, x in enumerate(np.arange(-0.5, 0.31, 0.01)):
        speed = 1.3 if x < 0.005 else 0.2  # slowed by the funnel afterwards
        referee.watch(truth_at(k * 0.01, (x, 0.06, 0.08), (speed, 0, 0), touches=x > 0))
    referee.watch(truth_at(5.0, (0.3, 0, 0), latched=True, R_WB=exp(np.radians([0, 0, 5.0]))))
    assert referee.contact is not None
    assert referee.contact.radial_offset_m == pytest.approx(0.1)
    assert referee.contact.closure_speed_m_s == pytest.approx(1.3)
    assert referee.contact.angle_deg == pytest.approx(5.0)
    assert referee.contact.time_s == 5.0


def test_the_largest_pull_is_that_of_the_first_hold_the_tick_at_which_it_let_go_included():
    referee = Referee()
    for k, (held, pull_n) in enumerate([(False, 9e3), (True, -50.0), (True, 700.0), (False, 1913.0), (True, 4e3)]):
        referee.watch(dataclasses.replace(truth_at(0.001 * k, (0.3, 0, 0), latched=held), coupling_force_n=pull_n))
    assert referee.pull_max_n == 1913.0


def judged(referee, truth, phase="approach"):
    return referee.judge(truth, phase, 60.0)


def test_probe_that_is_held_has_made_contact_also_when_it_touched_the_basket_on_its_way():
    for touches in (False, True):
        referee = Referee()
        truth = through(referee, 0.15, latch=True, touches=touches)
        assert judged(referee, truth) is None  # it is held: the flight goes on
        assert judged(referee, truth, "clear") is Outcome.CONTACT


def test_probe_that_was_held_and_let_go_has_made_contact_and_only_its_first_counts():
    referee = Referee()
    through(referee, 0.05, latch=True)
    first = referee.contact
    referee.watch(truth_at(3.0, (0.3, 0.0, 0.0)))
    referee.watch(truth_at(4.0, (0.3, 0.0, 0.0), latched=True))
    assert referee.contact is first
    assert judged(referee, truth_at(9.0, (-3.0, 0.0, 0.0)), "clear") is Outcome.CONTACT


def test_probe_that_passes_beside_the_basket_and_touches_nothing_has_missed_and_the_flight_goes_on():
    referee = Referee()
    truth = through(referee, 0.4)
    assert judged(referee, truth) is None
    assert judged(referee, truth_at(9.0, (-3.0, 0.0, 0.0)), "clear") is Outcome.MISS


def test_probe_that_touches_the_drogue_and_is_not_held_has_struck_it_from_ahead_or_behind_the_rings_plane():
    passed, backed_off = Referee(), Referee()
    through(passed, 0.25, touches=True)
    backed_off.watch(truth_at(1.0, (-0.02, 0.27, 0.0), touches=True))
    for referee in (passed, backed_off):
        assert judged(referee, truth_at(9.0, (-3.0, 0.0, 0.0)), "clear") is Outcome.RIM_STRIKE


def test_a_strike_in_one_attempt_outweighs_a_clean_breakaway_in_the_next_and_contact_outweighs_both():
    referee = Referee()
    judged(referee, truth_at(0.0, (-3.0, 0.0, 0.0)), "approach")
    through(referee, 0.25, touches=True)
    judged(referee, truth_at(3.0, (-3.0, 0.0, 0.0)), "approach")
    judged(referee, truth_at(4.0, (-2.0, 0.0, 0.0)), "breakaway")
    assert judged(referee, truth_at(5.0, (-4.0, 0.0, 0.0)), "clear") is Outcome.RIM_STRIKE
    judged(referee, truth_at(6.0, (-3.0, 0.0, 0.0)), "approach")
    through(referee, 0.05, latch=True)
    assert judged(referee, truth_at(9.0, (-4.0, 0.0, 0.0)), "clear") is Outcome.CONTACT


def test_anything_else_of_the_receiver_that_touches_ends_the_flight_whatever_went_before():
    for held_before in (False, True):
        referee = Referee()
        truth = through(referee, 0.05, latch=held_before)
        referee.watch(truth_at(truth.time_s + 1.0, (-3.0, 0.0, 0.0), hit="hose_3"))
        assert judged(referee, truth_at(truth.time_s + 1.1, (-3.0, 0.0, 0.0))) is Outcome.COLLISION
        assert referee.collided_with == "hose_3"


def test_receiver_that_departs_from_controlled_flight_was_unsafe_and_the_flight_runs_out():
    referee = Referee()
    for k in range(100):
        falling = truth_at(0.1 * k, (-4.0, 0.0, -1.0 * max(k - 50, 0)))
        assert judged(referee, falling, "pre_contact") is None
    assert referee.unsafe == ("departed from controlled flight at 7.1 s",)
    assert judged(referee, truth_at(60.0, (-4.0, 0.0, -500.0)), "pre_contact") is Outcome.TIMEOUT


def test_receiver_that_breaks_away_behind_the_rings_plane_has_aborted_and_one_that_waits_has_run_out_of_time():
    assert judged(Referee(), truth_at(20.0, (-3.0, 0.0, 0.0)), "clear") is Outcome.ABORT
    assert judged(Referee(), truth_at(60.0, (-3.0, 0.0, 0.0)), "pre_contact") is Outcome.TIMEOUT


def test_a_flight_goes_on_until_something_ends_it():
    referee = Referee()
    assert referee.judge(truth_at(20.0, (-3.0, 0, 0)), "approach", 60.0) is None
    assert referee.judge(truth_at(20.0, (0.3, 0, 0), latched=True), "hold", 60.0) is None


def test_offset_and_closure_are_seen_from_the_drogue_also_when_it_moves_and_turns():
    """Closure is the rate of the tip's place in drogue axes: with the drogue's velocity, and w x p of its turning."""
    R_WD, w, v_WD = exp(np.array([0.4, -0.3, 0.5])), np.array([0.2, 1.0, -1.5]), np.array([0.3, -0.2, 0.1])
    lateral, closure = np.array([0.0, 0.07, -0.04]), 1.1
    referee = Referee()
    for k, x in enumerate((-1e-4, 1e-4)):
        p_DP = lateral + [x, 0.0, 0.0]
        v_WP = v_WD + R_WD @ (np.array([closure, 0.2, 0.3]) + np.cross(w, p_DP))
        p_WD = np.array([-15.0, 1.0, -3.0])
        truth = truth_at(float(k), p_WD + R_WD @ p_DP, v_WP)
        referee.watch(dataclasses.replace(truth, R_WD=R_WD, p_WD=p_WD, v_WD=v_WD, w_WD_D=w))
    referee.watch(truth_at(2.0, (0.3, 0.0, 0.0), latched=True))
    assert referee.contact is not None
    assert referee.contact.radial_offset_m == pytest.approx(np.hypot(0.07, 0.04))
    assert referee.contact.closure_speed_m_s == pytest.approx(closure)


@pytest.mark.parametrize("turn", [(0.0, 0.0, 0.0), (1.3, -0.3, 0.5), (0.2, 0.7, -2.0), (-0.4, 1.1, 0.9)])
def test_the_angle_is_that_between_probe_and_axis_whichever_way_both_stand_in_the_world(turn):
    """A roll of the receiver about its probe is none; probe and axis in one line are, whatever rounding says, 0."""
    R_WD = exp(np.array(turn))
    for yaw_deg in (0.0, 5.0):
        referee = Referee()
        R_WB = R_WD @ exp(np.radians([0.0, 0.0, yaw_deg])) @ exp(np.radians([30.0, 0.0, 0.0]))
        held = truth_at(1.0, R_WD @ [0.3, 0.0, 0.0], latched=True, R_WB=R_WB)
        referee.watch(dataclasses.replace(held, R_WD=R_WD))
        assert referee.contact is not None
        assert referee.contact.angle_deg == pytest.approx(yaw_deg, abs=2e-6)


def unsafe_of(referee, lateral, *, speed=1.2, latch=False, touches=True, usable=(True, True)):
    """Fly through the ring's plane with the navigation's word before it and after it; return what was unsafe."""
    judge = functools.partial(referee.judge, phase="approach", duration_s=60.0)
    judge(truth_at(0.0, (-0.6, lateral, 0.0)), usable=usable[0])
    for k, x in enumerate(np.arange(-0.5, 0.4, 0.01)):
        held = latch and x > 0.3
        tick = truth_at(0.01 * k, (x, lateral, 0.0), (speed, 0, 0), latched=held, touches=touches and 0.02 < x < 0.04)
        referee.watch(tick)
        judge(tick, usable=usable[int(x > 0.1)])
    return referee.unsafe


def test_a_contact_inside_every_limit_is_safe():
    assert unsafe_of(Referee(), 0.05, latch=True) == ()


@pytest.mark.parametrize(("speed", "expected"), [(2.6, ()), (2.61, ("touch at 2.61 m/s",))])
def test_a_touch_at_more_than_five_knots_is_unsafe_whether_it_is_held_or_not(speed, expected):
    for latch in (False, True):
        assert unsafe_of(Referee(), 0.1, speed=speed, latch=latch) == expected


def test_a_touch_with_the_tip_beyond_the_rim_is_unsafe_and_told_once_with_the_farthest_place():
    assert unsafe_of(Referee(), 0.24) == ()
    assert unsafe_of(Referee(), 0.26) == ("touch outside the basket, 0.26 m off the axis",)
    assert unsafe_of(Referee(RefereeLimits(rim_radius_m=0.305)), 0.26) == ()
    assert unsafe_of(Referee(), 0.40, touches=False) == ()  # a miss is none
    referee = Referee()
    for time_s, lateral in ((1.0, 0.27), (1.1, 0.34), (1.2, 0.28)):
        referee.watch(truth_at(time_s, (0.0, lateral, 0.0), touches=True))
    assert referee.unsafe == ("touch outside the basket, 0.34 m off the axis",)


@pytest.mark.parametrize(
    ("tip", "speed", "expected"),
    [
        ((0.4, 0.3, 0.0), 0.5, ("touch outside the basket, 0.30 m off the axis",)),
        ((0.3, 0.05, 0.0), 2.7, ("touch at 2.70 m/s",)),
        ((0.3, 0.05, 0.0), -5.0, ()),
    ],
)
def test_a_drogue_that_the_coupling_has_let_go_may_still_strike(tip, speed, expected):
    """As one on a hose that whips; but what strikes a probe that was held is no rim strike."""
    referee = Referee()
    through(referee, 0.05, latch=True)
    referee.watch(truth_at(3.0, tip, (speed, 0.0, 0.0), touches=True))
    assert referee.unsafe == expected
    assert judged(referee, truth_at(9.0, (-3.0, 0.0, 0.0)), "clear") is Outcome.CONTACT


@pytest.mark.parametrize(
    ("tip", "outside"),
    [
        ((0.02, 0.24, 0.0), False),
        ((0.02, 0.253, 0.0), True),  # beyond the rim, though no farther than a rib's radius
        ((0.12, 0.16, 0.0), False),  # in the funnel, the middles of whose ribs are 0.171 m off the axis there
        ((0.067, 0.218, 0.0), False),  # as 29199 of dead_reel_drawn_hoses: sliding out between two ribs, from inside
        ((0.12, 0.0, -0.19), True),
        ((0.24, 0.08, 0.0), True),
        ((0.30, 0.04, 0.0), False),  # in the bore
        ((0.40, 0.104, 0.0), True),  # beside the coupling
    ],
)
def test_what_is_touched_from_beside_the_basket_is_its_outside_however_near_the_axis(tip, outside):
    """The tip passes the ring's plane beyond the rim, touches nothing, and comes in toward the axis from the side."""
    referee = Referee()
    referee.watch(truth_at(1.0, (-0.1, 0.32, 0.0), (1.2, 0.0, 0.0)))
    referee.watch(truth_at(1.1, (0.01, 0.32, 0.0), (1.2, 0.0, 0.0)))
    referee.watch(truth_at(1.2, tip, (1.2, 0.0, 0.0), touches=True))
    told = f"touch outside the basket, {np.hypot(*tip[1:]):.2f} m off the axis"
    assert referee.unsafe == ((told,) if outside else ())


def test_a_probe_that_is_taken_too_fast_is_unsafe_though_it_touched_nothing_before():
    referee = Referee()
    referee.watch(truth_at(1.0, (0.29, 0.0, 0.0), (4.0, 0.0, 0.0)))
    referee.watch(truth_at(1.1, (0.30, 0.0, 0.0), (4.0, 0.0, 0.0), latched=True))
    assert referee.unsafe == ("touch at 4.00 m/s",)


def test_what_touches_while_the_coupling_holds_is_no_strike():
    referee = Referee()
    through(referee, 0.05, latch=True)
    referee.watch(truth_at(3.0, (0.3, 0.3, 0.0), (3.0, 0.0, 0.0), latched=True, touches=True))
    assert referee.unsafe == ()


def test_a_touch_may_be_fastest_after_the_first():
    referee = Referee()
    for time_s, speed in ((1.0, 1.2), (1.1, 2.9), (1.2, 0.4)):
        referee.watch(truth_at(time_s, (0.1, 0.1, 0.0), (speed, 0.0, 0.0), touches=True))
    assert referee.unsafe == ("touch at 2.90 m/s",)


def test_who_passes_the_plane_far_aside_without_an_approach_has_not_tried():
    referee = Referee()
    truth = through(referee, 1.1)
    assert judged(referee, truth, "clear") is Outcome.ABORT
    assert referee.attempt_log(truth.time_s, Outcome.ABORT) == ()
    referee = Referee()
    referee.judge(truth_at(0.0, (-1.0, 1.1, 0.0)), "approach", 60.0)
    assert judged(referee, through(referee, 1.1), "clear") is Outcome.MISS


def test_who_passes_the_plane_far_aside_after_an_attempt_that_is_over_has_not_tried_again():
    """Near the rim it is still put down to that attempt."""
    for aside_m, outcome, attempt in ((1.1, Outcome.ABORT, "breakaway"), (0.9, Outcome.MISS, "miss")):
        referee = Referee()
        referee.judge(truth_at(0.0, (-1.0, 0.2, 0.0)), "approach", 60.0)
        referee.judge(truth_at(0.1, (-0.9, 0.2, 0.0)), "breakaway", 60.0)
        truth = through(referee, aside_m)
        assert judged(referee, truth, "clear") is outcome
        (only,) = referee.attempt_log(truth.time_s, outcome)
        assert only.outcome == attempt


def test_a_miss_after_which_time_ran_out_before_the_receiver_was_clear_is_no_clean_end():
    referee = Referee()
    truth = through(referee, 0.4)
    assert referee.judge(truth, "back_off", truth.time_s) is Outcome.TIMEOUT
    referee = Referee()
    assert referee.judge(through(referee, 0.4), "clear", 60.0) is Outcome.MISS


@pytest.mark.parametrize("usable", [(False, True), (True, False), (False, False)])
def test_a_contact_is_unsafe_when_the_solution_was_marked_unusable_on_the_way_in_or_at_the_latch(usable):
    assert unsafe_of(Referee(), 0.05, latch=True, usable=usable) == ("contact on a solution marked unusable",)
    assert unsafe_of(Referee(), 0.05, usable=usable) == ()  # nothing was held


def test_a_collision_is_unsafe_and_told_once():
    referee = Referee()
    for time_s in (1.0, 1.001):
        referee.watch(truth_at(time_s, (-3.0, 0.0, 0.0), hit="hose_3"))
    assert referee.unsafe == ("collision with hose_3",)
