"""What the predictive controller says of the drogue where it is not looked at."""

import numpy as np
import pytest

from dockair.nav.guidance.controller import Sight, Wanted
from dockair.nav.guidance.guidance_settings import GuidanceSettings
from dockair.nav.guidance.path_plan import PathPlan
from dockair.nav.guidance.predictive import Predictive

SETTINGS, STEP_S, NOT_FELT = GuidanceSettings(), 0.01, np.full(3, np.nan)
ALONG = np.array([1.0, 0.0, 0.0])


def shown(place, rate, seconds):
    """A controller that was shown a drogue on a path, itself at rest."""
    limits = np.array(SETTINGS.acceleration_limit_m_s2), np.array(SETTINGS.jerk_limit_m_s3)
    settings = SETTINGS.predictive
    controller = Predictive(settings, np.array(SETTINGS.response_s), *limits, STEP_S, SETTINGS.patient_share)
    for k in range(round(seconds / STEP_S)):
        push = np.zeros((len(controller.looks_ahead_s), 3))
        controller.observe(Sight(place_m=place(k * STEP_S), rate_m_s=rate(k * STEP_S), push_m_s2=push), NOT_FELT)
        controller.given(np.zeros(3), np.zeros(3))
    return controller


def test_a_surge_of_the_reel_is_not_held_on_the_probe():
    """0.1 m/s forward for 15 s, then 0.9 m/s for the last second and a half: most of it is not held."""

    def rate(t):
        return np.array([0.1 if t < 15.0 else 0.9, 0.0, 0.0])

    def place(t):
        return np.array([4.0 + 0.1 * t + 0.8 * max(t - 15.0, 0.0), 0.0, 0.0])

    controller = shown(place, rate, 16.5)
    assert controller.drift_m_s[0] > 0.3
    held = controller.steady_drift_m_s
    assert 0.1 < held[0] < 0.2
    for _ in range(500):
        controller.observe(None, NOT_FELT)
    np.testing.assert_array_equal(controller.steady_drift_m_s, held)


def test_a_bias_of_the_velocity_is_held_after_some_seconds():
    drift = np.array([0.2, -0.3, 0.3])
    controller = shown(lambda t: np.array([4.0, 0.0, 0.0]) + drift * t, lambda _: drift, 9.0)
    np.testing.assert_allclose(controller.steady_drift_m_s, drift, atol=0.1)


def test_a_bias_that_has_long_been_there_is_held_whole():
    drift = np.array([0.2, -0.3, 0.3])
    controller = shown(lambda t: np.array([4.0, 0.0, 0.0]) + drift * t, lambda _: drift, 40.0)
    np.testing.assert_allclose(controller.steady_drift_m_s, drift, rtol=0.03)


@pytest.mark.parametrize("seconds", [5.0, 7.0, 10.0])
def test_a_bias_that_shows_a_second_late_is_held_though_it_is_still_being_learnt(seconds):
    """As 27093 of light_gusts on perfect navigation: contact after 10 s, 0.57 m/s of bias, of which 0.32 were held."""
    drift = np.array([0.5, -0.5, 0.5])
    controller = shown(lambda t: [4.0, 0.0, 0.0] + drift * max(t - 1.0, 0.0), lambda t: drift * (t > 1.0), seconds)
    np.testing.assert_allclose(controller.steady_drift_m_s, drift, rtol=0.2)


@pytest.mark.parametrize("seconds", [0.05, 0.1, 0.3, 0.6, 1.0])
@pytest.mark.parametrize("seed", range(5))
def test_from_a_glimpse_of_a_drogue_at_rest_no_drift_is_made_up_of_its_noise(seconds, seed):
    """Places to 1 mm, rates to 0.1 m/s: what is not learnt yet is made up for, but not what nothing is known of."""
    rng = np.random.default_rng(seed)
    controller = shown(
        lambda _: np.array([4.0, 0.0, 0.0]) + rng.normal(0.0, 0.001, 3), lambda _: rng.normal(0.0, 0.1, 3), seconds
    )
    assert np.abs(controller.steady_drift_m_s).max() < 0.3


def test_the_middle_of_the_swing_is_seen_from_the_tip():
    """A drogue 4 m ahead and 1 m left swings by 0.3 m: out of view it is sought in the middle."""
    omega = 2.0 * np.pi * np.array(SETTINGS.predictive.swing.modes[0].frequency_hz[1])
    across = np.array([0.0, 1.0, 0.0])
    controller = shown(
        lambda t: np.array([4.0, 1.0, 0.0]) + 0.3 * np.sin(omega * t) * across,
        lambda t: 0.3 * omega * np.cos(omega * t) * across,
        30.0,
    )
    np.testing.assert_allclose(controller.middle_m, (4.0, 1.0, 0.0), atol=0.1)


def test_what_a_drogue_did_unseen_is_no_drift():
    """It swings by a metre, goes out of view for 1.2 s, and is 1.5 m lower at a glimpse of 0.1 s."""
    omega, up = 2.0 * np.pi * np.array(SETTINGS.predictive.swing.modes[0].frequency_hz[2]), np.array([0.0, 0.0, 1.0])
    controller = shown(
        lambda t: np.array([6.0, 0.0, 0.0]) + np.sin(omega * t) * up, lambda t: omega * np.cos(omega * t) * up, 20.0
    )
    for k in range(130):
        seen_m, push = np.array([6.0, 0.0, np.sin(omega * 20.0) - 1.5]), np.zeros((len(controller.looks_ahead_s), 3))
        sight = Sight(place_m=seen_m, rate_m_s=-0.5 * up, push_m_s2=push) if k >= 120 else None
        controller.observe(sight, NOT_FELT)
        controller.given(np.zeros(3), np.zeros(3))
    assert np.abs(controller.steady_drift_m_s).max() < 0.1
    assert np.abs(controller.drift_m_s).max() < 0.3
    np.testing.assert_allclose(controller.middle_m, seen_m, atol=0.5)


def test_a_drogue_at_rest_stays_at_rest_while_the_tip_strays():
    """The tip sways by 0.1 m besides its commands and feels it: of the drogue's swing that it sees a third is left.

    That is what forgetting twice within 4 s costs at 0.5 Hz.
    """
    limits = np.array(SETTINGS.acceleration_limit_m_s2), np.array(SETTINGS.jerk_limit_m_s3)
    omega, left, swings = 2.0 * np.pi * 0.5, np.array([0.0, 1.0, 0.0]), {}
    for felt in (True, False):
        controller = Predictive(
            SETTINGS.predictive, np.array(SETTINGS.response_s), *limits, STEP_S, SETTINGS.patient_share
        )
        push, unrest = np.zeros((len(controller.looks_ahead_s), 3)), []
        for k in range(4000):
            t = k * STEP_S
            place = np.array([4.0, 0.0, 0.0]) - 0.1 * np.sin(omega * t) * left
            rate = -0.1 * omega * np.cos(omega * t) * left
            change = 0.1 * omega * (np.cos(omega * t) - np.cos(omega * (t - STEP_S))) * left
            controller.observe(Sight(place_m=place, rate_m_s=rate, push_m_s2=push), change if felt else NOT_FELT)
            controller.given(np.zeros(3), np.zeros(3))
            unrest.append(controller.unrest)
        swings[felt] = max(unrest[2000:])
    assert swings[True] < 0.4 * swings[False]


def test_a_gust_that_lifts_the_tip_says_where_the_drogue_will_go():
    """Felt up by 0.3 m/s while the drogue is still where it was: it is expected to go by the modes' shares of that."""
    limits = np.array(SETTINGS.acceleration_limit_m_s2), np.array(SETTINGS.jerk_limit_m_s3)
    ahead = {}
    for felt_m_s in (0.0, 0.03):
        settings, response_s = SETTINGS.predictive, np.array(SETTINGS.response_s)
        controller = Predictive(settings, response_s, *limits, STEP_S, SETTINGS.patient_share)
        push, tip_m = np.zeros((len(controller.looks_ahead_s), 3)), 0.0
        for k in range(410):
            lifted = felt_m_s if k >= 400 else 0.0
            tip_m += STEP_S * lifted * max(k - 399, 0)
            place, rate = np.array([4.0, 0.0, -tip_m]), np.array([0.0, 0.0, -lifted * max(k - 399, 0)])
            controller.observe(Sight(place_m=place, rate_m_s=rate, push_m_s2=push), np.array([0.0, 0.0, lifted]))
            controller.given(np.zeros(3), np.zeros(3))
        ahead[felt_m_s] = controller._motion.path(np.zeros((5, 3)))[:, 2]
    assert np.abs(ahead[0.0]).max() < 1e-9
    assert np.abs(ahead[0.03]).max() > 0.01


@pytest.mark.parametrize(("seconds", "kept"), [(2.0, False), (9.0, True)])
def test_a_drift_learnt_from_a_glimpse_is_forgotten_where_the_drogue_comes_into_view_again(seconds, kept):
    down = np.array([0.0, 0.0, -1.0])
    controller = shown(lambda t: np.array([8.0, 0.0, 0.0]) + down * t, lambda _: down, seconds)
    assert controller.drift_m_s[2] < -0.3
    for _ in range(100):
        controller.observe(None, NOT_FELT)
    push = np.zeros((len(controller.looks_ahead_s), 3))
    controller.observe(Sight(place_m=np.array([8.0, 0.0, 0.0]), rate_m_s=np.zeros(3), push_m_s2=push), NOT_FELT)
    drift_up_m_s = controller.drift_m_s[2], controller.steady_drift_m_s[2]
    assert (max(drift_up_m_s) < -0.3) if kept else (max(np.abs(drift_up_m_s)) < 0.01)


@pytest.mark.parametrize("to_contact_s", [0.3, 0.6, 1.0])
def test_what_is_flown_up_does_not_ask_how_late_the_receiver_answers_to_the_left(to_contact_s):
    """A drogue that swings: each axis meets it a response time of its own from now."""
    limits = np.array(SETTINGS.acceleration_limit_m_s2), np.array(SETTINGS.jerk_limit_m_s3)
    wanted = Wanted(distance_m=None, speed_m_s=1.0, aim_m=np.zeros(2), must_follow=True, to_contact_s=to_contact_s)
    flown = []
    for left_s in (0.10, 0.25):
        response_s = np.array([0.40, left_s, 0.10])
        controller = Predictive(SETTINGS.predictive, response_s, *limits, STEP_S, SETTINGS.patient_share)
        push, swings = np.zeros((len(controller.looks_ahead_s), 3)), np.array([0.0, 0.02, 0.02])
        for k in range(500):
            angle = 2.6 * k * STEP_S
            place, rate = np.array([2.0, 0.0, 0.0]) + np.sin(angle) * swings, 2.6 * np.cos(angle) * swings
            controller.observe(Sight(place_m=place, rate_m_s=rate, push_m_s2=push), NOT_FELT)
            controller.given(np.zeros(3), np.zeros(3))
        flown.append(controller.rate(np.zeros(3), wanted)[1:])
    assert flown[0][1] == flown[1][1]
    assert flown[0][0] != flown[1][0]


@pytest.mark.parametrize("distance_m", [None, 4.0])
def test_along_what_the_tip_strays_at_is_flown_against(distance_m):
    """Blown forward by 0.1 m/s in the last tick, the drogue at rest: e by Eqs. (2) and (3) of `own_path`.

    Where a place is kept, du/dt has k (v - u) besides, and u* has k times the way on which e dies away.
    """
    s, tau_s, dies_s = SETTINGS.predictive, SETTINGS.response_s[0], SETTINGS.predictive.straying_s[0]
    limits = np.array(SETTINGS.acceleration_limit_m_s2), np.array(SETTINGS.jerk_limit_m_s3)
    e = 0.1 / (1.0 + STEP_S / s.forgotten_s) ** 2
    wanted = Wanted(distance_m=distance_m, speed_m_s=1.0, aim_m=np.zeros(2), must_follow=True)
    rates = []
    for blown_m_s, nearer_m in ((0.0, 0.0), (0.1, e * STEP_S)):
        controller = Predictive(s, np.array(SETTINGS.response_s), *limits, STEP_S, SETTINGS.patient_share)
        push = np.zeros((len(controller.looks_ahead_s), 3))
        for k in range(300):
            place, change = (4.0 - nearer_m, blown_m_s) if k == 299 else (4.0, 0.0)
            sight = Sight(place_m=place * ALONG, rate_m_s=np.zeros(3), push_m_s2=push)
            controller.observe(sight, change * ALONG)
            controller.given(np.zeros(3), np.zeros(3))
        rates.append(controller.rate(np.zeros(3), wanted)[0])
    left = np.exp(-tau_s / dies_s)
    expected = -s.smoothing_1_s * e * left
    if distance_m is not None:
        goes_on_m = e * (STEP_S + dies_s * (1.0 - left))
        expected -= s.along_gain_1_s * (e * left + s.smoothing_1_s * goes_on_m)
    assert rates[1] - rates[0] == pytest.approx(expected, rel=1e-6)


def test_it_looks_ahead_to_now_the_response_time_and_the_nodes_of_the_plan():
    plan, tau_s = SETTINGS.predictive.plan, SETTINGS.response_s[1]
    times_s = shown(lambda _: 4.0 * ALONG, lambda _: np.zeros(3), 0.0).looks_ahead_s
    np.testing.assert_allclose(times_s, [0.0, *(tau_s + plan.node_s * np.arange(plan.nodes + 1))], atol=1e-12)


@pytest.mark.parametrize("to_contact_s", [None, 0.5, 0.9])
def test_across_the_tip_begins_from_where_straying_will_have_brought_it_and_on_to_where_it_goes(to_contact_s):
    """Blown to the left by 0.1 m/s in the last tick, the drogue at rest: y_r at the nodes by Eq. (3) of `own_path`.

    The plan begins a response time from now, and so it is nearer to contact by that.
    """
    s, tau_s = SETTINGS.predictive, SETTINGS.response_s[1]
    limits = np.array(SETTINGS.acceleration_limit_m_s2), np.array(SETTINGS.jerk_limit_m_s3)
    e, left = 0.1 / (1.0 + STEP_S / s.forgotten_s) ** 2, np.array([0.0, 1.0, 0.0])
    controller = Predictive(s, np.array(SETTINGS.response_s), *limits, STEP_S, SETTINGS.patient_share)
    push = np.zeros((len(controller.looks_ahead_s), 3))
    for blown_m_s in (*np.zeros(299), 0.1):
        place_m = 4.0 * ALONG - (e * STEP_S * left if blown_m_s else 0.0)
        controller.observe(Sight(place_m=place_m, rate_m_s=np.zeros(3), push_m_s2=push), blown_m_s * left)
        controller.given(np.zeros(3), np.zeros(3))
    wanted = Wanted(distance_m=None, speed_m_s=1.0, aim_m=np.zeros(2), must_follow=True, to_contact_s=to_contact_s)
    planned_s = None if to_contact_s is None else to_contact_s - tau_s
    times_s, dies_s = tau_s + s.plan.node_s * np.arange(1, s.plan.nodes + 1), s.straying_s[1]
    gone_m = e * (STEP_S + dies_s * (1.0 - np.exp(-times_s / dies_s)))
    jerk_m_s3 = PathPlan(s.plan, limits[0][1], limits[1][1]).jerk_m_s3(np.zeros(3), -gone_m, planned_s)
    assert controller.rate(np.zeros(3), wanted)[1] == pytest.approx(jerk_m_s3 * STEP_S, rel=1e-6)


@pytest.mark.parametrize(("patient", "share"), [(False, (1.0, 1.0)), (True, SETTINGS.patient_share)])
def test_across_it_goes_to_a_drogue_that_is_far_aside_with_all_of_the_jerk_or_the_share_that_patience_leaves(
    patient, share
):
    place_m = np.array([4.0, 20.0, -20.0])
    controller = shown(lambda _: place_m, lambda _: np.zeros(3), 5.0)
    wanted = Wanted(distance_m=4.0, speed_m_s=1.0, aim_m=np.zeros(2), patient=patient, must_follow=True)
    most_m_s2 = share * np.array(SETTINGS.jerk_limit_m_s3[1:]) * STEP_S
    np.testing.assert_allclose(controller.rate(np.zeros(3), wanted)[1:] / most_m_s2, [1.0, -1.0], rtol=0.02)


@pytest.mark.parametrize("row", [0, 1])
def test_the_swing_is_as_large_as_the_share_of_the_acceleration_that_it_asks_for(row):
    """Of the first mode by 0.2 m, at its end: omega^2 s of what is calm, left and up."""
    controller, axis = shown(lambda _: 4.0 * ALONG, lambda _: np.zeros(3), 0.0), 1 + row
    controller._motion._filters._x[:, axis, 2] = 0.2
    omega = 2.0 * np.pi * SETTINGS.predictive.swing.modes[0].frequency_hz[axis]
    calm_m_s2 = SETTINGS.predictive.calm_share[row] * SETTINGS.acceleration_limit_m_s2[axis]
    assert controller.unrest == pytest.approx(0.2 * omega**2 / calm_m_s2, rel=1e-9)


@pytest.mark.parametrize(("share", "bears"), [(0.7, True), (1.3, False)])
@pytest.mark.parametrize("row", [0, 1])
def test_gusts_can_be_borne_whose_swing_asks_for_a_share_of_the_acceleration_at_most(row, share, bears):
    """A steady swing at the first mode's frequency by its rms acceleration, which is told to a sixth."""
    axis = 1 + row
    omega = 2.0 * np.pi * SETTINGS.predictive.swing.modes[0].frequency_hz[axis]
    bearable_m_s2 = SETTINGS.predictive.bearable_share[row] * SETTINGS.acceleration_limit_m_s2[axis]
    swing_m = np.sqrt(2.0) * share * bearable_m_s2 / omega**2 * np.eye(3)[axis]
    controller = shown(
        lambda t: 8.0 * ALONG + np.sin(omega * t) * swing_m, lambda t: omega * np.cos(omega * t) * swing_m, 30.0
    )
    assert controller.bears_the_gusts is bears


def fresh():
    """A controller that was shown nothing yet."""
    return shown(lambda _: 4.0 * ALONG, lambda _: np.zeros(3), 0.0)


def test_a_drogue_that_comes_into_view_goes_on_at_its_rate_and_the_receivers_own():
    controller, left = fresh(), np.array([0.0, 1.0, 0.0])
    for _ in range(50):
        controller.observe(None, NOT_FELT)
        controller.given(0.3 * left, np.zeros(3))
    push = np.zeros((len(controller.looks_ahead_s), 3))
    controller.observe(Sight(place_m=4.0 * ALONG, rate_m_s=0.1 * left, push_m_s2=push), NOT_FELT)
    tau_s = SETTINGS.response_s[1]
    assert controller.error_to_come(np.zeros(2))[0] == pytest.approx(0.1 * tau_s, abs=0.1 * 0.4 * tau_s)


def test_the_push_of_the_bow_wave_now_and_after_the_response_time_is_in_the_error_to_come():
    """From rest by 1 m/s^2 for a tick, then growing to 3: tau^2 (1/3 + 3/6) more, but for the swing's stiffness."""
    controller, tau_s = fresh(), SETTINGS.response_s[1]
    push = np.full((len(controller.looks_ahead_s), 3), 9.0)
    push[:2] = [[1.0], [3.0]]
    controller.observe(Sight(place_m=4.0 * ALONG, rate_m_s=np.zeros(3), push_m_s2=push), NOT_FELT)
    expected = 0.5 * STEP_S**2 + STEP_S * tau_s + tau_s**2 * (1.0 / 3.0 + 3.0 / 6.0)
    np.testing.assert_allclose(controller.error_to_come(np.zeros(2)), expected, rtol=0.02)


def test_a_drogue_that_has_been_seen_to_hang_still_is_waited_for_at_the_distance_that_is_wanted():
    wanted = Wanted(distance_m=4.0, speed_m_s=1.0, aim_m=np.zeros(2))
    controller = shown(lambda _: 4.0 * ALONG, lambda _: np.zeros(3), 5.0)
    np.testing.assert_allclose(controller.rate(np.zeros(3), wanted), 0.0, atol=1e-9)


@pytest.mark.parametrize(
    ("times", "farther"), [(1.0, 0.0), (1.5, 0.5), (2.0, 1.0), (9.0, SETTINGS.predictive.excess_max)]
)
def test_a_swing_is_waited_for_farther_astern_the_more_it_asks_for(times, farther):
    """By so many times what is bearable, rms: u* = k (y_D - y_r - wanted)."""
    s, controller = SETTINGS.predictive, shown(lambda _: 4.0 * ALONG, lambda _: np.zeros(3), 5.0)
    controller._asked = times**2 * controller._bearable * [1.0, 0.1]
    asked = controller.rate(np.zeros(3), Wanted(distance_m=4.0, speed_m_s=9.0, aim_m=np.zeros(2)))[0]
    assert asked == pytest.approx(-s.smoothing_1_s * s.along_gain_1_s * farther * s.keep_away_m, abs=1e-9)
    must = Wanted(distance_m=4.0, speed_m_s=9.0, aim_m=np.zeros(2), must_follow=True)
    assert controller.rate(np.zeros(3), must)[0] == pytest.approx(0.0, abs=1e-9)


def test_across_it_goes_on_from_the_acceleration_that_was_commanded_last():
    controller, a_m_s2 = shown(lambda _: 4.0 * ALONG, lambda _: np.zeros(3), 0.1), np.array([0.0, 1.0, -2.0])
    controller.given(np.zeros(3), a_m_s2)
    asked = controller.rate(np.zeros(3), Wanted(distance_m=4.0, speed_m_s=1.0, aim_m=np.zeros(2), must_follow=True))
    assert (np.abs(asked - a_m_s2)[1:] <= STEP_S * np.array(SETTINGS.jerk_limit_m_s3[1:]) * (1.0 + 1e-9)).all()


def test_a_swing_is_followed_but_where_it_is_more_than_can_be_borne_and_need_not_be():
    """At rest but for a swing by 0.5 m/s on each axis; closing at 1 m/s."""
    s, controller = SETTINGS.predictive, shown(lambda _: 4.0 * ALONG, lambda _: np.zeros(3), 5.0)
    controller._motion._filters._x[:, :, 3] = 0.5
    controller.observe(None, NOT_FELT)
    for times, must_follow, follows in ((2.0, False, False), (2.0, True, True), (0.5, False, True)):
        controller._asked = times * controller._bearable
        wanted = Wanted(distance_m=None, speed_m_s=1.0, aim_m=np.zeros(2), must_follow=must_follow)
        more = controller.rate(np.zeros(3), wanted) - s.smoothing_1_s * ALONG
        np.testing.assert_array_equal(np.abs(more) > (0.02 if follows else 1e-9), follows)


def test_the_tip_goes_to_where_it_is_aimed_off_the_drogue():
    """As to a drogue that hangs there."""
    off_m, asked = np.array([0.1, -0.2]), []
    for place_m, aim_m in ((np.array([4.0, *off_m]), np.zeros(2)), (4.0 * ALONG, off_m)):
        controller = shown(lambda _, place_m=place_m: place_m, lambda _: np.zeros(3), 5.0)
        np.testing.assert_allclose(controller.error_to_come(aim_m), off_m, atol=1e-9)
        asked.append(controller.rate(np.zeros(3), Wanted(distance_m=4.0, speed_m_s=1.0, aim_m=aim_m, must_follow=True)))
    np.testing.assert_allclose(asked[1], asked[0], atol=1e-9)
    assert (np.abs(asked[0][1:]) > 0.01).all()


@pytest.mark.parametrize(
    ("distance_m", "speed_m_s", "way_m_s"),
    [(3.8, 1.0, None), (4.2, 1.0, None), (0.5, 0.7, 0.7), (10.0, 0.7, -0.7)],
    ids=["behind", "ahead", "far behind", "far ahead"],
)
def test_along_it_goes_to_the_distance_and_no_faster_than_it_is_told_to(distance_m, speed_m_s, way_m_s):
    """Eq. (1) of a drogue at rest, and of a receiver that is commanded 0.3 m/s now."""
    s, u = SETTINGS.predictive, np.array([0.3, 0.0, 0.0])
    controller = shown(lambda _: 4.0 * ALONG, lambda _: np.zeros(3), 5.0)
    asked = controller.rate(u, Wanted(distance_m=distance_m, speed_m_s=speed_m_s, aim_m=np.zeros(2), must_follow=True))
    if way_m_s is None:
        expected = -s.along_gain_1_s * u[0] + s.smoothing_1_s * (s.along_gain_1_s * (4.0 - distance_m) - u[0])
    else:
        expected = s.smoothing_1_s * (way_m_s - u[0])
    assert asked[0] == pytest.approx(expected, rel=1e-6)


def test_a_drogue_that_is_reeled_in_is_gone_after_no_faster_than_the_speed_that_is_told():
    drift = 0.5 * ALONG
    controller, u = shown(lambda t: 8.0 * ALONG + t * drift, lambda _: drift, 10.0), np.array([0.3, 0.0, 0.0])
    asked = controller.rate(u, Wanted(distance_m=4.0, speed_m_s=0.7, aim_m=np.zeros(2), must_follow=True))
    assert asked[0] == pytest.approx(SETTINGS.predictive.smoothing_1_s * (0.7 - u[0]), rel=1e-9)


def test_across_a_drogue_that_is_farther_off_than_the_most_is_gone_to_as_if_it_were_that_far_off():
    """At the price of a swing that is waited for, which leaves some of the jerk."""
    most_m, asked = SETTINGS.predictive.plan.error_max_m, []
    for off_m in (most_m, 2.0 * most_m):
        place_m = np.array([4.0, off_m, -off_m])
        controller = shown(lambda _, place_m=place_m: place_m, lambda _: np.zeros(3), 5.0)
        controller._asked = 4.0 * controller._bearable
        asked.append(controller.rate(np.zeros(3), Wanted(distance_m=4.0, speed_m_s=1.0, aim_m=np.zeros(2)))[1:])
    np.testing.assert_allclose(asked[1], asked[0], rtol=1e-9)
    assert (np.abs(asked[0]) < 0.8 * STEP_S * np.array(SETTINGS.jerk_limit_m_s3[1:])).all()
