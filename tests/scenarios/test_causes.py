"""Why an attempt failed, on histories of which each is wrong in one thing alone."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from dockair.messages import NavSolution, ReceiverCommand
from dockair.rotations import exp
from dockair.scenarios.judgement.attempts import Attempt
from dockair.scenarios.judgement.causes import (
    CAUSES,
    CauseRules,
    Flown,
    cause_of_flight,
    flown_of,
    unforeseen_motion,
    with_cause,
)
from dockair.scenarios.schema import load_scenario
from dockair.sim.faults import CameraDropOut, DeadReel, LedOff

TIMES = np.round(np.arange(0.0, 5.0, 0.01), 2)
END_S = 4.0  # when the attempt is decided
NOSE = np.array([-1.2, 0.9, -0.65])  # to the left of the probe and below
TIP = np.array([2.7, -0.45, -0.15])  # from the camera


def attempt(**changes):
    values = dict(
        number=1, begun_s=1.0, ended_s=END_S, outcome="miss", radial_offset_m=0.3, closure_speed_m_s=1.2,
        angle_deg=2.0, left_m=0.0, up_m=0.3, decided_s=END_S,
    )  # fmt: skip
    return Attempt(**(values | changes))


@pytest.fixture
def flight(make_truth):
    """Make a flight of 5 s: a level receiver closes on a drogue; all are functions of time.

    Args of the function: the drogue across (y, z) [m], its rate; the tip's place across; error of the belief across;
    wind at the drogue across; valid, usable; turn of the believed attitude, of the true one.
    """

    def make(
        drogue=lambda t: (0.0, 0.0), rate=lambda t: (0.0, 0.0), tip=lambda t: (0.0, 0.0), error=lambda t: (0.0, 0.0),
        wind=lambda t: (0.0, 0.0), valid=lambda t: True, usable=lambda t: True, turn=(0.0, 0.0, 0.0),
        attitude=(0.0, 0.0, 0.0), faults=(), held=lambda t: False,
    ):  # fmt: skip
        truths, solutions = [], []
        R_BD = exp(np.array(attitude))
        for t in TIMES:
            truth = make_truth(
                t, R_WD=R_BD, p_WD=np.array([0.0, *drogue(t)]), v_WD=np.array([0.0, *rate(t)]),
                p_WP=np.array([1.2 * (t - END_S), *tip(t)]), gust_D_m_s=np.array([0.0, *wind(t)]),
                latched=held(t),
            )  # fmt: skip
            believed = truth.p_PD_B + np.array([0.0, *error(t)])
            truths.append(truth)
            solutions.append(solution(t, believed, exp(np.array(turn)) @ R_BD, valid(t), usable(t)))
        return Flown(truths=truths, solutions=solutions, p_PN_B=NOSE, p_CP_B=TIP, faults=faults)

    return make


def solution(t, p_PD_B, R_BD, valid=True, usable=True):
    return NavSolution(
        time_stamp_s=t, valid=valid, phase="approach", status="", p_PD_B=p_PD_B, v_PD_B=np.zeros(3), R_BD=R_BD,
        covariance=np.eye(9), command=ReceiverCommand(), window=None, frame_time_stamp_s=t,
        candidates_px=np.zeros((0, 2)), led_pixels_px=np.zeros((8, 2)), contact_usable=usable,
    )  # fmt: skip


def cause(flown, **changes):
    """Cause of an attempt whose offset is the flight's where it was decided."""
    at = flown.truths[flown.tick_at(changes.get("decided_s", END_S))]
    return with_cause(attempt(**{"radial_offset_m": float(np.linalg.norm(at.p_DP[1:]))} | changes), flown).cause


def kick(t):
    """0.3 m upward within the last 0.2 s, from rest: nobody could have known."""
    return (0.0, 0.3 * max(t - END_S + 0.2, 0.0) / 0.2)


BEHIND = dict(tip=lambda t: (0.0, -0.3))  # a tip that stays where the drogue, at rest, is not
MISLED = dict(tip=lambda t: (0.0, -0.3), error=lambda t: (0.0, -0.3))  # believed to be on the line


def test_a_good_contact_has_no_cause_and_one_outside_the_limits_has_that_of_a_miss(flight):
    assert cause(flight(**BEHIND), outcome="contact", radial_offset_m=0.1) == ""
    assert cause(flight(**BEHIND), outcome="contact", radial_offset_m=0.2) == "control_limit"
    assert cause(flight(**MISLED), outcome="contact", radial_offset_m=0.2) == "navigation_error"
    assert cause(flight(), outcome="contact", radial_offset_m=0.0, closure_speed_m_s=2.7) == "outside_limits"
    assert cause(flight(), outcome="contact", radial_offset_m=0.0, angle_deg=11.0) == "outside_limits"


def test_a_drogue_that_jumps_aside_within_the_response_time_is_a_gusts_doing(flight):
    assert cause(flight(drogue=kick, rate=lambda t: (0.0, 0.0))) == "gust"


def test_a_drogue_that_goes_on_as_it_moved_is_no_gust_but_the_receivers_own_lag(flight):
    """Constant velocity and acceleration are foreseen: 0.3 m in the last 0.3 s, at 0.7 m/s and 2 m/s^2."""
    fall = dict(
        drogue=lambda t: (0.0, 0.7 * (t - END_S) + (t - END_S) ** 2 + 0.3),
        rate=lambda t: (0.0, 0.7 + 2.0 * (t - END_S)),
    )
    np.testing.assert_allclose(unforeseen_motion(400, flight(**fall), CauseRules()), 0.0, atol=0.01)
    assert cause(flight(**fall)) == "control_limit"


@pytest.mark.parametrize("tau", [0.4, 0.29])
def test_unforeseen_motion_is_what_velocity_and_acceleration_of_before_do_not_explain(flight, tau):
    """A jerk j gives j tau^3/6, and half of difference_s of it in the acceleration j difference_s tau^2/4."""
    rules, j = CauseRules(response_s=tau, difference_s=0.02), 6.0
    s = lambda t: t - (END_S - tau)  # noqa: E731
    jerk = flight(drogue=lambda t: (0.0, j * s(t) ** 3 / 6), rate=lambda t: (0.0, j * s(t) ** 2 / 2))
    expected = j * tau**3 / 6 + j * 0.02 * tau**2 / 4
    np.testing.assert_allclose(unforeseen_motion(400, jerk, rules), [0.0, expected], rtol=1e-9, atol=1e-12)


def test_a_receiver_that_is_not_where_the_known_drogue_is_was_at_the_limit_of_its_control(flight):
    assert cause(flight(**BEHIND)) == "control_limit"


def test_a_drogue_that_was_believed_on_the_line_is_an_error_of_the_navigation(flight):
    assert cause(flight(**MISLED)) == "navigation_error"


def test_an_error_away_from_the_miss_does_not_explain_it(flight):
    """Believed farther off than it was: the navigation's share is negative."""
    assert cause(flight(tip=lambda t: (0.0, -0.3), error=lambda t: (0.0, 0.3))) == "control_limit"


@pytest.mark.parametrize("angle_deg", [23.0, -23.0, 45.0, -90.0, 170.0])
def test_an_error_of_a_numbering_that_is_another_is_an_ambiguity(flight, angle_deg):
    assert cause(flight(**MISLED, turn=(np.radians(angle_deg), 0.0, 0.0))) == "ambiguity"


def test_a_roll_of_less_than_half_an_led_is_no_ambiguity(flight):
    assert cause(flight(**MISLED, turn=(np.radians(22.0), 0.0, 0.0))) == "navigation_error"


@pytest.mark.parametrize(("rolled_s", "expected"), [(0.495, "navigation_error"), (0.505, "ambiguity")])
def test_an_ambiguity_lasts_for_half_of_the_last_second_if_not_to_its_end(flight, rolled_s, expected):
    """At 49 of 100 ticks, or at 50."""
    misled, rolled = flight(**MISLED), exp(np.array([np.radians(45.0), 0.0, 0.0]))
    believed = [
        replace(s, R_BD=rolled) if END_S - 0.599 < s.time_stamp_s <= END_S - 0.599 + rolled_s else s
        for s in misled.solutions
    ]
    assert cause(replace(misled, solutions=believed)) == expected


@pytest.mark.parametrize(
    ("hidden_m", "unforeseen_m", "expected"),
    [
        (0.18, 0.12, "navigation_error"),
        (0.12, 0.18, "gust"),
        (0.10, 0.12, "control_limit"),
        (0.18, -0.1, "control_limit"),
    ],
)
def test_the_largest_of_three_shares_names_the_cause_though_none_is_half(flight, hidden_m, unforeseen_m, expected):
    """The ring is 0.4 m above the probe's line; what neither was hidden nor unforeseen was known and not flown."""
    three = flight(
        drogue=lambda t: (0.0, unforeseen_m / 0.3 * kick(t)[1]), tip=lambda t: (0.0, unforeseen_m - 0.4),
        error=lambda t: (0.0, -hidden_m),
    )  # fmt: skip
    assert cause(three) == expected


@pytest.mark.parametrize("tilt_deg", [(6.0, 0.0), (-6.0, 0.0), (0.0, 6.0), (0.0, -6.0), (4.0, -8.0)])
def test_an_error_with_the_mirrored_attitude_is_an_ambiguity(flight, tilt_deg):
    """The ring's two images that look alike lie on both sides of the line from the camera, not of that from the tip."""
    misled = flight(**MISLED, attitude=(0.0, *np.radians(tilt_deg)))
    for share, expected in ((1.0, "ambiguity"), (0.3, "navigation_error")):
        believed = [
            replace(solution, R_BD=towards_mirror_image(truth, share))
            for truth, solution in zip(misled.truths, misled.solutions, strict=True)
        ]
        assert cause(replace(misled, solutions=believed)) == expected


def towards_mirror_image(truth, share):
    """R_BD of the drogue turned, without a roll, by a share of the way to its mirror image about the camera's sight."""
    R_BD, p_CD_B = truth.R_WB.T @ truth.R_WD, TIP + truth.p_PD_B
    across = np.cross(R_BD[:, 0], p_CD_B) / np.linalg.norm(p_CD_B)
    sine = np.linalg.norm(across)
    return exp(share * 2.0 * np.arcsin(sine) * across / sine) @ R_BD


def test_attitudes_within_four_degrees_of_their_mirror_image_are_no_ambiguity(flight):
    """The ring faces the camera to within 2 degrees throughout the last second."""
    facing = (0.0, -np.arctan2(0.15, 3.2), -np.arctan2(0.45, 3.2))
    misled = flight(**MISLED, attitude=facing)
    believed = [
        replace(solution, R_BD=towards_mirror_image(truth, 1.0))
        for truth, solution in zip(misled.truths, misled.solutions, strict=True)
    ]
    assert cause(replace(misled, solutions=believed)) == "navigation_error"


def turned(flown, Q):
    """Return the same flight in a world that is turned: nothing changes for who looks along the body's axes."""
    truths = [
        replace(
            t, R_WB=Q @ t.R_WB, R_WD=Q @ t.R_WD, R_WT=Q @ t.R_WT, p_WD=Q @ t.p_WD, p_WP=Q @ t.p_WP, v_WD=Q @ t.v_WD,
            gust_D_m_s=Q @ t.gust_D_m_s,
        )
        for t in flown.truths
    ]  # fmt: skip
    return replace(flown, truths=truths)


def test_causes_are_seen_along_the_bodys_axes_whichever_way_these_stand_in_the_world(flight):
    Q = exp(np.array([1.3, -0.3, 0.5]))
    jump = flight(drogue=lambda t: (0.1 * kick(t)[1], kick(t)[1]))
    expected = unforeseen_motion(400, jump, CauseRules())
    assert expected[1] > 0.2
    np.testing.assert_allclose(unforeseen_motion(400, turned(jump, Q), CauseRules()), expected, atol=1e-12)
    away = -np.array([0.9, -0.65]) / np.hypot(0.9, 0.65)
    wind = lambda t: tuple(away * (0.2 * np.sin(9.0 * t) + 3.0 * (t > END_S - 1.0)))  # noqa: E731
    assert cause(turned(flight(tip=lambda t: tuple(-0.25 * away), wind=wind), Q)) == "bow_wave"
    assert cause(turned(flight(**MISLED), Q)) == "navigation_error"
    assert cause(turned(flight(**MISLED, turn=(np.radians(45.0), 0.0, 0.0)), Q)) == "ambiguity"


@pytest.mark.parametrize(("lost_s", "expected"), [(0.495, "control_limit"), (0.505, "detection")])
def test_half_of_the_last_second_without_a_solution_is_a_failure_to_detect(flight, lost_s, expected):
    """Of the 100 ticks of the last second it is not valid at 49, or at 50."""
    flown = flight(**BEHIND, valid=lambda t: not END_S - 0.599 < t <= END_S - 0.599 + lost_s)
    assert cause(flown) == expected
    told = flight(**BEHIND, usable=lambda t: not END_S - 0.599 < t <= END_S - 0.599 + lost_s)
    assert cause(told) == ("integrity" if expected == "detection" else expected)


def test_a_solution_that_is_not_to_be_flown_into_contact_is_a_matter_of_integrity(flight):
    assert cause(flight(**BEHIND, usable=lambda t: t < 3.2)) == "integrity"
    assert cause(flight(**BEHIND, usable=lambda t: t < 3.2, valid=lambda t: t < 3.2)) == "detection"


def test_a_miss_away_from_the_nose_with_the_air_blowing_that_way_is_the_bow_waves(flight):
    """The nose stands left of the probe and below: away is to the right and up."""
    away = -np.array([0.9, -0.65]) / np.hypot(0.9, 0.65)
    blown = lambda t: 0.2 * np.sin(9.0 * t) + (3.0 if t > END_S - 1.0 else 0.0)  # noqa: E731
    right = dict(tip=lambda t: tuple(-0.25 * away), wind=lambda t: tuple(blown(t) * away))
    assert cause(flight(**right)) == "bow_wave"
    assert cause(flight(tip=lambda t: tuple(0.25 * away), wind=lambda t: tuple(-blown(t) * away))) == "control_limit"
    steady = lambda t: 3.0 + 0.2 * np.sin(9.0 * t)  # noqa: E731  # it blew that way before
    assert cause(flight(tip=lambda t: tuple(-0.25 * away), wind=lambda t: tuple(steady(t) * away))) == "control_limit"
    gusty = lambda t: 3.0 * np.sign(np.sin(9.0 * t)) + blown(t)  # noqa: E731  # as much as it varied by before
    assert cause(flight(tip=lambda t: tuple(-0.25 * away), wind=lambda t: tuple(gusty(t) * away))) == "control_limit"


@pytest.mark.parametrize(("angle_deg", "expected"), [(44.0, "bow_wave"), (46.0, "control_limit")])
def test_away_from_the_nose_is_within_45_degrees_of_the_line_from_it_to_the_drogue(flight, angle_deg, expected):
    """The miss is the third side of the triangle of nose, tip and drogue: its sine law gives where the miss points."""
    size, to_nose, angle = 0.25, np.hypot(0.9, 0.65), np.radians(angle_deg)
    turn = np.arctan2(0.65, -0.9) + angle + np.arcsin(size / to_nose * np.sin(angle))
    along = np.array([np.cos(turn), np.sin(turn)])
    wind = lambda t: tuple(along * (0.2 * np.sin(9.0 * t) + 3.0 * (t > END_S - 1.0)))  # noqa: E731
    assert cause(flight(tip=lambda t: tuple(-size * along), wind=wind)) == expected


@pytest.mark.parametrize(("rise", "expected"), [(1.3, "control_limit"), (1.5, "bow_wave")])
def test_the_air_has_come_to_blow_by_more_than_twice_its_deviation_in_the_two_seconds_before(flight, rise, expected):
    """+-1 in one of the two seconds, calm in the other: deviation 1/sqrt(2), so that 1.41 is the limit."""
    away = -np.array([0.9, -0.65]) / np.hypot(0.9, 0.65)
    varied = lambda t: (-1.0) ** round(100.0 * t) * (1.005 < t < 2.005)  # noqa: E731
    wind = lambda t: tuple(away * (varied(t) + rise * (t > END_S - 0.995)))  # noqa: E731
    assert cause(flight(tip=lambda t: tuple(-0.25 * away), wind=wind)) == expected


def test_a_tip_inside_the_basket_that_was_not_held_and_one_that_was_called_off_on_the_line(flight):
    inside = flight(tip=lambda t: (0.0, -0.14))
    assert cause(inside, outcome="rim_strike") == "not_held"
    assert cause(inside, outcome="given_up") == "called_off"
    assert cause(flight(tip=lambda t: (0.0, -0.16)), outcome="given_up") == "control_limit"


@pytest.mark.parametrize(
    ("offset_m", "held", "lost"),
    [(0.149, "outside_limits", "not_held"), (0.152, "control_limit", "control_limit")],
)
def test_a_tip_is_inside_by_its_offset_in_the_drogues_axes_not_by_that_across_the_body(flight, offset_m, held, lost):
    """The drogue is tilted by 15 degrees: 0.152 m off its axis are 0.147 m across the body."""
    angle = np.radians(15.0)
    across, along = -offset_m * np.cos(angle), -offset_m * np.sin(angle)
    flown = flight(tip=lambda t: (0.0, across), attitude=(0.0, angle, 0.0))
    moved = [replace(truth, p_WP=truth.p_WP + np.array([along, 0.0, 0.0])) for truth in flown.truths]
    tilted = replace(flown, truths=moved)
    np.testing.assert_allclose(tilted.truths[400].p_DP, [0.0, 0.0, -offset_m], atol=1e-12)
    assert cause(tilted, outcome="contact", angle_deg=15.0) == held
    assert cause(tilted, outcome="rim_strike") == lost


def test_a_receiver_that_was_held_and_then_struck_something_has_collided_and_one_that_was_not_held_has_not_been(flight):
    held = dict(held=lambda t: END_S <= t < 4.5)
    assert cause(flight(**held), outcome="collision") == "collision"
    assert cause(flight(**held, **MISLED), outcome="collision") == "collision"  # it was held all the same
    assert cause(flight(), outcome="collision") == "not_held"
    assert cause(flight(**BEHIND), outcome="collision") == "control_limit"
    earlier = flight(held=lambda t: t < 0.5)  # of the attempt before
    assert cause(earlier, outcome="collision") == "not_held"


def test_a_reel_that_died_while_the_probe_was_held_is_the_fault_of_the_collision(flight):
    held = dict(held=lambda t: END_S <= t < 4.8)
    assert cause(flight(**held, faults=[DeadReel(start_s=4.2)]), outcome="collision") == "fault"
    assert cause(flight(faults=[DeadReel(start_s=4.2)]), outcome="collision") == "not_held"
    assert cause(flight(**held, faults=[LedOff()]), outcome="collision") == "collision"


def test_one_called_off_is_judged_by_the_worst_of_its_last_second_and_not_where_it_had_come_nearest(flight):
    """The tip was on the line at its nearest, 0.3 m off at 4.3 s, on the line again when the navigation gave up."""
    late = flight(tip=lambda t: (0.0, -0.3 if 4.29 < t < 4.31 else 0.0))
    assert cause(late, outcome="given_up", ended_s=4.5) == "control_limit"
    assert cause(late, outcome="breakaway", ended_s=4.5) == "control_limit"
    assert cause(late, outcome="given_up", ended_s=4.2) == "called_off"
    assert cause(late, outcome="miss", ended_s=4.5) == "not_held"


@pytest.mark.parametrize(("outcome", "expected"), [("timeout", "out_of_time"), ("diverged", "diverged")])
def test_an_attempt_that_was_cut_short_failed_for_that(flight, outcome, expected):
    assert cause(flight(**BEHIND), outcome=outcome) == expected


def test_a_fault_is_named_where_it_can_have_brought_the_cause_about_and_acted_during_the_attempt(flight):
    blind = dict(**BEHIND, valid=lambda t: t < 3.0)
    assert cause(flight(**blind, faults=[CameraDropOut(start_s=3.0, stop_s=3.5)])) == "fault"
    assert cause(flight(**blind, faults=[CameraDropOut(start_s=0.1, stop_s=0.9)])) == "detection"  # over before
    assert cause(flight(**blind, faults=[CameraDropOut(start_s=4.5)])) == "detection"  # later
    assert cause(flight(**BEHIND, faults=[LedOff(leds=(0,))])) == "control_limit"  # a dark LED moves no receiver
    assert cause(flight(drogue=kick, faults=[DeadReel()])) == "fault"
    assert cause(flight(**MISLED, faults=[DeadReel()])) == "navigation_error"
    assert cause(flight(faults=[DeadReel()]), outcome="given_up") == "called_off"
    assert cause(flight(faults=[DeadReel()]), outcome="given_up", reason="red light") == "fault"


def test_faults_of_sensors_are_no_cause_where_the_truth_navigates(hand_made):
    faults = {"faults": [{"kind": "led_off"}, {"kind": "camera_drop_out"}, {"kind": "dead_reel"}]}
    settings = (faults | {"navigation.navigator": name} for name in ("dockair.nav.navigator:Navigator", "truth"))
    flown = [flown_of(load_scenario("default", one), hand_made.sheets.mounting, [], []) for one in settings]
    assert [[type(fault) for fault in one.faults] for one in flown] == [[LedOff, CameraDropOut, DeadReel], [DeadReel]]


@pytest.mark.parametrize("outcome", ["given_up", "breakaway"])
def test_a_fault_after_the_closest_approach_is_named_for_an_attempt_that_it_ended(flight, outcome):
    blind = flight(**BEHIND, valid=lambda t: t < 3.2, faults=[CameraDropOut(start_s=3.2)])
    assert cause(blind, outcome=outcome, decided_s=3.0, ended_s=END_S) == "fault"
    assert cause(blind, outcome="miss", decided_s=3.0, ended_s=END_S) == "control_limit"  # that was over before
    later = flight(**BEHIND, valid=lambda t: t < 3.2, faults=[CameraDropOut(start_s=4.1)])
    assert cause(later, outcome=outcome, decided_s=3.0, ended_s=END_S) == "detection"


def test_a_flight_has_the_cause_of_its_last_failed_attempt(flight):
    flown = flight()
    failed = [attempt(outcome="miss", cause="gust"), attempt(number=2, cause="bow_wave")]
    held = attempt(number=3, outcome="contact", radial_offset_m=0.05)
    assert cause_of_flight([*failed, held], flown, "abort") == "bow_wave"
    assert cause_of_flight([held], flown, "abort") == ""


def test_a_flight_without_an_attempt_was_never_steady_or_saw_nothing(flight):
    assert cause_of_flight([], flight(), "abort") == "never_steady"
    assert cause_of_flight([], flight(valid=lambda t: t < 3.0), "abort") == "detection"
    assert cause_of_flight([], flight(valid=lambda t: t > 3.0), "abort") == "never_steady"  # it came to see in time
    assert cause_of_flight([], flight(faults=[LedOff()]), "abort") == "fault"


@pytest.mark.parametrize(("since_s", "expected"), [(3.745, "never_steady"), (3.755, "detection")])
def test_a_solution_for_half_of_the_last_half_is_enough_to_have_seen(flight, since_s, expected):
    """The last half has 250 ticks, from 2.5 s on; from 3.75 s on there are 125."""
    assert cause_of_flight([], flight(valid=lambda t: t > since_s), "abort") == expected


@pytest.mark.parametrize("first", [0, 1, 7])
def test_the_tick_at_a_time_is_the_last_one_not_after_it_whenever_the_log_begins(make_truth, first):
    """Of a flight the log begins with the first control tick, at 0.01 s; times as 0.29 are no whole number of steps."""
    truths = [make_truth(float(t)) for t in TIMES[first:]]
    flown = Flown(truths=truths, solutions=[], p_PN_B=NOSE, p_CP_B=TIP)
    assert [flown.tick_at(truth.time_s) for truth in truths] == list(range(len(truths)))
    assert [flown.tick_at(truth.time_s + 0.0099) for truth in truths] == list(range(len(truths)))
    assert (flown.tick_at(-1.0), flown.tick_at(9.0)) == (0, len(truths) - 1)


def test_a_flight_that_struck_something_before_any_attempt_has_collided_whether_it_saw_or_not(flight):
    assert cause_of_flight([], flight(), "collision") == "collision"
    assert cause_of_flight([], flight(valid=lambda t: t < 3.0), "collision") == "collision"
    fallen = flight(tip=lambda t: (0.0, -25.0 * (t > 1.0)))
    assert cause_of_flight([], fallen, "collision") == "departed"  # it struck something as it fell


@pytest.mark.parametrize("fault", [DeadReel(start_s=2.0), CameraDropOut(start_s=2.0)])
def test_a_fault_that_acted_before_a_collision_without_an_attempt_can_have_brought_it_about(flight, fault):
    assert cause_of_flight([], flight(faults=[fault]), "collision") == "fault"
    assert cause_of_flight([], flight(faults=[replace(fault, start_s=9.0)]), "collision") == "collision"  # later


def test_a_flight_without_an_attempt_whose_simulation_broke_down_has_diverged_whatever_else_went_wrong(flight):
    assert cause_of_flight([], flight(), "diverged") == "diverged"
    blind = flight(tip=lambda t: (0.0, -25.0 * (t > 1.0)), valid=lambda t: False, faults=[LedOff()])
    assert cause_of_flight([], blind, "diverged") == "diverged"
    assert cause_of_flight([attempt(cause="gust")], flight(), "diverged") == "gust"  # it broke down after that attempt


def test_a_receiver_that_falls_away_has_departed_whatever_else_went_wrong(flight):
    """25 m below the drogue from 1 s on, and the navigation misled besides."""
    fallen = flight(tip=lambda t: (0.0, -25.0 * (t > 1.0)), error=lambda t: (0.0, -25.0))
    assert cause(fallen) == "departed"
    assert cause(fallen, outcome="timeout") == "departed"
    assert cause_of_flight([], fallen, "abort") == "departed"
    assert cause_of_flight([attempt(cause="gust")], fallen, "abort") == "departed"  # it departed after that attempt
    assert cause_of_flight([attempt(outcome="contact", cause="")], fallen, "abort") == ""
    assert cause_of_flight([attempt(cause="diverged")], fallen, "diverged") == "diverged"  # as of the attempt itself


def test_an_attempt_that_ended_before_the_departure_has_its_own_cause(flight):
    later = flight(**BEHIND | dict(tip=lambda t: (0.0, -25.0 if t > 2.5 else -0.3)))
    assert cause(later, decided_s=2.0, ended_s=2.0) == "control_limit"
    assert cause(later, decided_s=2.0, ended_s=3.0) == "departed"  # though the miss was decided before


def test_every_cause_is_in_the_modules_table_and_every_one_there_is_known():
    import dockair.scenarios.judgement.causes as causes

    rows = [line.split("|")[1].strip() for line in causes.__doc__.splitlines() if line.startswith("| ")]
    assert {row for row in rows if row and row != "cause"} | {"never_steady"} == set(CAUSES)


def test_every_cause_is_on_the_page_of_results():
    page = (Path(__file__).parents[2] / "docs/results.md").read_text(encoding="utf-8")
    said = page[page.index("### Causes") : page.index("## result.json")]
    assert [cause for cause in CAUSES if f"`{cause}`" not in said] == []


def test_the_nose_stands_in_the_plane_of_symmetry_ahead_of_the_centre_of_gravity(hand_made):
    """Probe's tip at (6.8, 0.4, 1.0) from the centre of gravity; the nose 1.2 m behind it, 0.05 m below that centre."""
    flown = flown_of(load_scenario("default"), hand_made.sheets.mounting, [], [])
    np.testing.assert_allclose(hand_made.sheets.mounting.p_BP + flown.p_PN_B, [5.6, 0.0, -0.05], atol=1e-12)


def test_the_tip_is_where_the_mounting_has_it_from_the_camera(hand_made):
    mounting = hand_made.sheets.mounting
    flown = flown_of(load_scenario("default"), mounting, [], [])
    np.testing.assert_allclose(mounting.p_BC + flown.p_CP_B, mounting.p_BP, atol=1e-12)
