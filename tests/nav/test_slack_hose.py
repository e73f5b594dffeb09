"""Whether the hose is taken up at contact."""

from dataclasses import replace

import numpy as np
import pytest

from dockair.nav.guidance.phases import Phase, PhaseLimits
from dockair.nav.guidance.slack_hose import SlackHose, turn_rad

LIMITS, STEP_S = PhaseLimits(), 0.01
BEFORE_S = 2.0
TOLD_S = LIMITS.slack_from_s + LIMITS.slack_over_s  # at the earliest
LIMIT_DEG, SIDE_LIMIT_DEG = np.degrees(LIMITS.slack_drop_rad), np.degrees(LIMITS.slack_tilt_rad)
REST = np.array([0.29, 0.05, -0.03])
DOWN, UP, LEFT = 0.0, 180.0, 90.0


def turned(degrees: float, to: float = DOWN) -> np.ndarray:
    """REST (3,) with its nose turned."""
    length = np.linalg.norm(REST)
    left = np.cross([0.0, 0.0, 1.0], REST) / np.hypot(REST[0], REST[1])
    down = np.cross(left, REST) / length
    toward = np.cos(np.radians(to)) * down + np.sin(np.radians(to)) * left
    return np.cos(np.radians(degrees)) * REST + np.sin(np.radians(degrees)) * length * toward


def told(degrees, *, seen=lambda t: True, ahead_m=lambda t: 0.0, after=Phase.CONTACT, before=lambda t: 0.0, to=DOWN):
    """(60,) whether it was told slack, tick by tick from contact on; the angles are of the time since contact."""
    hose = SlackHose(LIMITS, STEP_S)
    for t in np.arange(-BEFORE_S, 0.0, STEP_S):
        hose.step(Phase.APPROACH, np.array([-t, 0.0, 0.0]), turned(before(t)), seen=True)
    slack = []
    for k in range(60):
        t = k * STEP_S
        hose.step(after if k else Phase.CONTACT, np.array([ahead_m(t), 0.0, 0.0]), turned(degrees(t), to), seen=seen(t))
        slack.append(hose.is_slack)
    return np.array(slack)


@pytest.mark.parametrize("after", [Phase.CONTACT, Phase.BACK_OFF, Phase.HOLD])
def test_a_drogue_that_turns_on_the_probe_is_on_a_slack_hose_whatever_phase_follows(after):
    slack = told(lambda t: LIMIT_DEG + 0.5, after=after)
    first = int(np.argmax(slack))
    assert abs(first * STEP_S - TOLD_S) < 1.5 * STEP_S and slack[first:].all()
    assert not told(lambda t: LIMIT_DEG - 0.5, after=after).any()


@pytest.mark.parametrize(
    ("to", "limit_deg"), [(DOWN, LIMIT_DEG), (UP, SIDE_LIMIT_DEG), (LEFT, SIDE_LIMIT_DEG), (UP + 60.0, SIDE_LIMIT_DEG)]
)
def test_a_drogue_that_a_gust_turns_is_on_a_taut_hose_unless_by_much_and_by_more_up_or_aside(to, limit_deg):
    """As 26312, 26356, 26406 and 26419 of moderate_gusts on perfect navigation: taut, up by 3 to 6 degrees."""
    assert not told(lambda t: limit_deg - 0.5, to=to).any()
    assert told(lambda t: limit_deg + 0.5, to=to).any()


def test_what_has_dropped_counts_also_where_it_has_turned_aside():
    aside_deg = 60.0
    assert not told(lambda t: LIMIT_DEG + 0.5, to=aside_deg).any()  # half of it down
    assert told(lambda t: 2.0 * LIMIT_DEG, to=aside_deg - 2.0).any()


@pytest.mark.parametrize(("to", "drop_deg"), [(DOWN, 6.0), (UP, -6.0), (LEFT, 0.0)])
def test_how_far_an_axis_has_dropped_and_turned(to, drop_deg):
    drop_rad, tilt_rad = turn_rad(2.0 * turned(6.0, to), REST)
    assert np.degrees(tilt_rad) == pytest.approx(6.0)
    assert np.degrees(drop_rad) == pytest.approx(drop_deg, abs=0.04)  # aside, along a great circle


def test_the_mean_counts_and_neither_the_blow_nor_what_comes_later():
    third_s = LIMITS.slack_from_s + LIMITS.slack_over_s / 3.0
    assert told(lambda t: 4.0 * LIMIT_DEG if t < third_s else 0.0).any()  # its median is 0
    assert not told(lambda t: LIMIT_DEG - 0.5 + 3.0 * np.sin(2.0 * np.pi * (t - LIMITS.slack_from_s) / 0.04)).any()
    assert not told(lambda t: 30.0 if t < LIMITS.slack_from_s - 0.5 * STEP_S else 0.0).any()
    assert not told(lambda t: 30.0 if t > LIMITS.slack_to_s + 0.5 * STEP_S else 0.0).any()


def test_a_slack_hose_that_lies_straight_for_a_moment_is_told_once_it_does_so_no_longer():
    slack = told(lambda t: 0.0 if 0.20 <= t < 0.26 else LIMIT_DEG + 4.0)
    assert not slack[: round(0.30 / STEP_S)].any() and slack[round(LIMITS.slack_to_s / STEP_S)]


def test_a_taut_hose_that_a_gust_turns_at_last_is_not_told():
    """As 25977 of moderate_gusts by camera: 3 degrees at 0.3 s, 5.9 from 0.5 s on."""
    assert not told(lambda t: np.interp(t, [0.0, 0.3, 0.5], [3.0, 3.0, 5.9])).any()


def test_a_taut_hose_whose_blow_has_lasted_is_not_told():
    """As 26977 of unmanned on measured LEDs: its blow lasts until 0.26 s, and 2.1 degrees are left."""
    assert not told(lambda t: np.interp(t, [0.20, 0.26], [LIMIT_DEG + 2.0, 2.1])).any()


def test_the_drogue_s_own_attitude_of_the_last_second_is_what_it_turns_from():
    """Half a swing before, the drogue hung elsewhere: only the last second counts."""
    assert not told(lambda t: 8.0, before=lambda t: 8.0 if t >= -LIMITS.slack_before_s else -40.0).any()
    assert told(lambda t: 0.0, before=lambda t: -8.0).any()


def test_it_turns_from_the_mean_of_the_last_second_whatever_the_drogue_did_at_the_last():
    """A drogue that nodded to and fro within it, and had its nose highest as it was met."""
    assert not told(
        lambda t: LIMIT_DEG - 0.5, before=lambda t: -6.0 * np.cos(2.0 * np.pi * t / LIMITS.slack_before_s)
    ).any()


def test_at_the_next_contact_it_turns_from_where_it_hung_before_that_one():
    hose = SlackHose(LIMITS, STEP_S)
    for degrees in (0.0, 12.0, -12.0):
        for phase, coupling_m in ((Phase.APPROACH, 1.0), (Phase.CONTACT, 0.0)):
            for _ in range(round(1.2 / STEP_S)):
                hose.step(phase, np.array([coupling_m, 0.0, 0.0]), turned(degrees), seen=True)
                assert not hose.is_slack


FAR_DEG = np.degrees(LIMITS.slack_far_rad)


@pytest.mark.parametrize("phase", [Phase.CONTACT, Phase.HOLD])
@pytest.mark.parametrize("to", [DOWN, UP, LEFT])
def test_a_hose_that_lay_straight_at_first_is_told_later_by_a_drogue_that_stays_turned_far(phase, to):
    """As 27935, a dead reel on a drawn hose, turned by 19 degrees from 0.8 s on."""
    assert late(lambda t: FAR_DEG + 1.0 if t > 0.8 else 0.0, phase=phase, to=to) == pytest.approx(
        0.8 + LIMITS.slack_far_s, abs=2 * STEP_S
    )
    assert late(lambda t: FAR_DEG - 1.0, phase=phase, to=to) is None


def test_of_a_drogue_that_turns_far_for_a_moment_nothing_is_said():
    assert late(lambda t: FAR_DEG + 10.0 if t % 0.2 < LIMITS.slack_far_s - 2 * STEP_S else 0.0) is None


def test_frames_that_are_missing_meanwhile_neither_count_nor_begin_it_anew():
    gap_s = 0.2
    told_s = late(lambda t: FAR_DEG + 5.0 if t > 0.8 else 0.0, seen=lambda t: not 0.85 < t <= 0.85 + gap_s)
    assert told_s == pytest.approx(0.8 + LIMITS.slack_far_s + gap_s, abs=2 * STEP_S)


@pytest.mark.parametrize("phase", [Phase.DISCONNECT, Phase.BACK_OFF, Phase.BREAKAWAY])
def test_on_the_way_back_a_drogue_may_turn_far(phase):
    assert late(lambda t: FAR_DEG + 5.0 if t > 0.8 else 0.0, phase=phase) is None


def late(degrees, *, phase=Phase.HOLD, seen=lambda t: True, to=DOWN):
    """When the hose was told slack after `slack_to_s`, up to which the drogue lay as before; None: never."""
    hose = SlackHose(LIMITS, STEP_S)
    for t in np.arange(-BEFORE_S, 3.0, STEP_S):
        flown = Phase.APPROACH if t < 0.0 else Phase.CONTACT if t <= LIMITS.slack_to_s else phase
        turn_deg = degrees(t) if t > LIMITS.slack_to_s + STEP_S else 0.0
        hose.step(flown, np.array([max(-t, 0.0), 0.0, 0.0]), turned(turn_deg, to), seen=t < 0.0 or seen(t))
        if hose.is_slack:
            return t
    return None


def test_nothing_is_said_of_a_drogue_that_was_hardly_seen_or_was_not_on_the_probe():
    half_s = LIMITS.slack_from_s + 0.5 * LIMITS.slack_over_s
    assert told(lambda t: 10.0, seen=lambda t: t < half_s + STEP_S).any()
    assert not told(lambda t: 10.0, seen=lambda t: t < half_s - 2 * STEP_S).any()
    assert not told(lambda t: 10.0, ahead_m=lambda t: 0.0 if t < half_s - 2 * STEP_S else 0.3).any()


def test_nothing_is_said_where_nothing_was_seen_before_contact_and_the_next_approach_begins_anew():
    hose = SlackHose(LIMITS, STEP_S)
    for _ in range(60):
        hose.step(Phase.CONTACT, np.zeros(3), turned(10.0), seen=True)
        assert not hose.is_slack
    for phase, degrees, expected in (
        (Phase.APPROACH, 0.0, False),
        (Phase.CONTACT, 10.0, True),
        (Phase.APPROACH, 0.0, False),
        (Phase.CONTACT, 0.0, False),
    ):
        for _ in range(110):
            hose.step(phase, np.zeros(3), turned(degrees), seen=True)
        assert hose.is_slack is expected


def test_a_receiver_that_was_called_back_is_in_contact_from_when_it_comes_to_the_coupling_all_the_same():
    hose, slack = SlackHose(LIMITS, STEP_S), []
    for t in np.arange(0.0, BEFORE_S, STEP_S):
        hose.step(Phase.APPROACH, np.array([1.0 - 0.3 * t, 0.0, 0.0]), REST, seen=True)
    for t in np.arange(-0.4, 0.6, STEP_S):  # the coupling is reached at 0
        coupling, degrees = np.array([max(-t, 0.0), 0.0, 0.0]), 0.0 if t < 0.0 else 8.0
        hose.step(Phase.BACK_OFF, coupling, turned(degrees), seen=True)
        slack.append((t, hose.is_slack))
    first_s = next(t for t, is_slack in slack if is_slack)
    assert first_s == pytest.approx(TOLD_S - LIMITS.coupling_reached_m, abs=2 * STEP_S)


def test_of_a_receiver_that_was_called_back_the_last_second_before_contact_counts_and_not_that_before_the_recall():
    hose = SlackHose(LIMITS, STEP_S)
    for _ in range(100):
        hose.step(Phase.APPROACH, np.array([1.0, 0.0, 0.0]), turned(-10.0), seen=True)
    for _ in range(100):  # on its way to the coupling, the drogue swings on
        hose.step(Phase.BACK_OFF, np.array([0.5, 0.0, 0.0]), turned(10.0), seen=True)
    for _ in range(60):
        hose.step(Phase.BACK_OFF, np.zeros(3), turned(10.0), seen=True)
        assert not hose.is_slack


@pytest.mark.parametrize("funnel_ticks", [0, 12, 40])
@pytest.mark.parametrize(("to", "degrees", "expected"), [(DOWN, LIMIT_DEG + 1.0, True), (UP, -1.0, False)])
def test_what_the_funnel_turns_of_a_receiver_that_was_called_back_is_no_reference(funnel_ticks, to, degrees, expected):
    """Past the ring's plane, not yet at the coupling, and turned by 12 degrees, as 29312 was."""
    hose, slack = SlackHose(LIMITS, STEP_S), []
    for k in range(200):
        hose.step(Phase.APPROACH if k < 150 else Phase.BACK_OFF, np.array([0.5, 0.0, 0.0]), REST, seen=True)
    for _ in range(funnel_ticks):
        hose.step(Phase.BACK_OFF, np.array([0.15, 0.0, 0.1]), turned(12.0, to), seen=True)
    for _ in range(50):
        hose.step(Phase.BACK_OFF, np.zeros(3), turned(degrees, to), seen=True)
        slack.append(hose.is_slack)
    assert any(slack) is expected


@pytest.mark.parametrize("rate_hz", [50, 100, 180])
@pytest.mark.parametrize("times_s", [(0.07, 0.07), (0.19, 0.31), (0.2, 0.005), (0.2, 0.08)])
def test_limits_that_leave_no_more_than_the_look_itself_leave_it_whole_at_any_rate(rate_hz, times_s):
    limits = replace(LIMITS, slack_from_s=times_s[0], slack_over_s=times_s[1], slack_to_s=sum(times_s))
    hose = SlackHose(replace(limits, slack_far_rad=np.inf), 1.0 / rate_hz)
    for phase, coupling_m, degrees in ((Phase.APPROACH, 1.0, 0.0), (Phase.CONTACT, 0.0, 10.0)):
        for _ in range(2 * rate_hz):
            hose.step(phase, np.array([coupling_m, 0.0, 0.0]), turned(degrees), seen=True)
    assert hose.is_slack


@pytest.mark.parametrize("rate_hz", [50, 100, 180, 500])
def test_the_times_are_whole_ticks_at_any_rate(rate_hz):
    """The ticks' times are no sums of a period: at 50 Hz the limit of a far turn would be met a tick late."""
    for late in (False, True):
        hose, slack = SlackHose(LIMITS, 1.0 / rate_hz), []
        for _ in range(2 * rate_hz):
            hose.step(Phase.APPROACH, np.array([1.0, 0.0, 0.0]), REST, seen=True)
        for k in range(rate_hz):  # contact is the first of them
            far = not late or k > LIMITS.slack_to_s * rate_hz
            hose.step(Phase.CONTACT, np.zeros(3), turned(FAR_DEG + 5.0 if far else 0.0), seen=True)
            slack.append(hose.is_slack)
        first = np.floor(LIMITS.slack_to_s * rate_hz) + 1 if late else round(LIMITS.slack_from_s * rate_hz)
        lasts_s = LIMITS.slack_far_s if late else LIMITS.slack_over_s
        assert int(np.argmax(slack)) == first + round(lasts_s * rate_hz) - 1


@pytest.mark.parametrize(("funnel_s", "expected"), [(0.0, True), (0.12, False)])
def test_while_the_tip_is_on_its_way_along_the_funnel_the_blow_is_not_over(funnel_s, expected):
    """As 29312 of moderate_gusts by camera: 0.12 m off the coupling's line when it is 0.05 m ahead, taut."""
    hose = SlackHose(LIMITS, STEP_S)
    for _ in range(200):
        hose.step(Phase.APPROACH, np.array([0.5, 0.0, 0.0]), REST, seen=True)
    for t in np.arange(0.0, 0.7, STEP_S):
        coupling = np.array([0.0, 0.0, 0.12 if t < funnel_s else 0.0])
        hose.step(Phase.CONTACT, coupling, turned(8.0 if t < 0.3 else 0.0), seen=True)
    assert hose.is_slack is expected


def test_a_drogue_beside_the_probe_is_not_in_contact():
    hose = SlackHose(LIMITS, STEP_S)
    for phase, degrees in ((Phase.APPROACH, 0.0), (Phase.BACK_OFF, 10.0)):
        for _ in range(100):
            hose.step(phase, np.array([0.0, 0.3, 0.0]), turned(degrees), seen=True)
    assert not hose.is_slack
