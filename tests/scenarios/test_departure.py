"""When a receiver has departed from controlled flight: hand-made histories of one angle and one place."""

import numpy as np
import pytest

from dockair.rotations import exp
from dockair.scenarios.judgement.departure import Departure, DepartureLimits
from dockair.scenarios.loop import Flight
from dockair.scenarios.schema import load_scenario

STEP_S = 0.01
DROGUE = np.array([-300.0, -40.0, 30.0])  # the world's origin is nobody's place


@pytest.fixture
def departed_s(make_truth):
    """Time at which a flight of 10 s departs; angle [rad] and the tip's place (y, z) across are functions of time."""

    def watch(angle=lambda t: 0.05, across=lambda t: (0.0, 0.0), behind=lambda t: 400.0, R_WT=None, limits=None):
        departure = Departure(limits)
        for t in np.arange(0.0, 10.0, STEP_S):
            R = np.eye(3) if R_WT is None else R_WT
            p_WP = DROGUE + R @ np.array([-behind(t), *across(t)])
            departure.watch(make_truth(t, angle_of_attack_rad=angle(t), p_WP=p_WP, p_WD=DROGUE, R_WT=R))
        return departure.time_s

    return watch


def pulse(longest_s, size_rad):
    return lambda t: 0.05 + size_rad * (2.0 <= t < 2.0 + longest_s)


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_an_angle_of_attack_15_degrees_off_for_half_a_second_is_a_departure_and_a_gust_is_none(departed_s, sign):
    beyond, within = sign * np.radians(15.5), sign * np.radians(14.5)
    assert departed_s(pulse(0.7, beyond)) == pytest.approx(2.0, abs=STEP_S)
    assert departed_s(pulse(0.4, beyond)) is None
    assert departed_s(pulse(8.0, within)) is None


def test_gusts_that_follow_one_another_do_not_add_up(departed_s):
    assert departed_s(lambda t: 0.05 + np.radians(20.0) * (t % 0.6 < 0.4)) is None


def test_the_angle_counts_from_that_of_the_start(departed_s):
    """A slow flight at 20 degrees is a flight."""
    assert departed_s(lambda t: np.radians(20.0)) is None


def test_a_tip_20_m_off_the_drogues_line_for_two_seconds_has_departed_one_that_comes_back_has_not(departed_s):
    assert departed_s(across=lambda t: (0.0, -21.0 * (t > 3.0))) == pytest.approx(3.0, abs=2 * STEP_S)
    assert departed_s(across=lambda t: (15.0 * (t > 3.0), -15.0 * (t > 3.0))) is not None  # 21 m in all
    assert departed_s(across=lambda t: (21.0 * (3.0 < t < 4.9), 0.0)) is None
    assert departed_s(across=lambda t: (21.0 * (3.0 < t < 5.1), 0.0)) == pytest.approx(3.0, abs=2 * STEP_S)
    assert departed_s(across=lambda t: (19.0, 0.0)) is None


@pytest.mark.parametrize("began", [(20.0, 20.0), (-15.0, 0.0), (0.0, 11.0)])
def test_a_flight_that_begins_far_aside_has_not_departed_but_one_that_goes_10_m_farther_has(departed_s, began):
    start_m, ahead = np.hypot(*began), np.array(began) / np.hypot(*began)
    assert departed_s(across=lambda t: began) is None
    assert departed_s(across=lambda t: np.array(began) * (1.0 - 0.1 * t)) is None  # it closes in
    assert departed_s(across=lambda t: ahead * (start_m + 9.9 * (t > 3.0))) is None
    assert departed_s(across=lambda t: ahead * (start_m + 10.1 * (t > 3.0))) == pytest.approx(3.0, abs=2 * STEP_S)


def test_a_start_some_metres_aside_changes_nothing(departed_s):
    assert departed_s(across=lambda t: (9.9 + 10.2 * (t > 3.0), 0.0)) == pytest.approx(3.0, abs=2 * STEP_S)
    assert departed_s(across=lambda t: (9.9 + 10.0 * (t > 3.0), 0.0)) is None


def test_far_behind_is_not_off_the_line_whichever_way_the_tanker_flies(departed_s):
    """To 404 m, after a turn by 60 degrees and in a climb: the line is the tanker's, not the world's."""
    R_WT = exp(np.array([0.0, 0.0, np.pi / 3])) @ exp(np.array([0.0, -0.1, 0.0]))
    behind = lambda t: 4.0 + 40.0 * t  # noqa: E731
    assert departed_s(behind=behind, R_WT=R_WT) is None
    aside = departed_s(behind=behind, across=lambda t: (21.0 * (t > 3.0), 0.0), R_WT=R_WT)
    assert aside == pytest.approx(3.0, abs=2 * STEP_S)


def test_limits_are_settings(departed_s):
    strict = DepartureLimits(angle_rad=0.01, angle_s=0.1)
    assert departed_s(pulse(0.2, 0.02), limits=strict) == pytest.approx(2.0, abs=STEP_S)


@pytest.mark.slow
@pytest.mark.parametrize(("factors", "departs"), [([1.0, 1.0, 1.0, 1.0], True), (None, False)])
def test_severe_gusts_drive_an_airframe_apart_whose_feedback_does_not_give_way(factors, departs):
    """On perfect navigation, waiting: with the gains for busy surfaces it flies on, without them it departs."""
    changed = {} if factors is None else {"parameters.flight_control.busy_tolerance_factors": factors}
    flight = Flight(load_scenario("severe_gusts", {"navigation.navigator": "truth", **changed}), 314, overlap=False)
    while flight.truth.time_s < 37.0:
        flight.step()
    unsafe = [what for what in flight.referee.unsafe if what.startswith("departed")]
    assert bool(unsafe) == departs
