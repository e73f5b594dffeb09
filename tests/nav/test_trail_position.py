"""Back to where the hose trails by itself, with the drogue on the probe."""

import numpy as np
import pytest

from dockair.nav.guidance.guidance_settings import GuidanceSettings
from dockair.nav.guidance.phases import Phase
from dockair.nav.guidance.trail_position import TrailPosition

SETTINGS, STEP_S = GuidanceSettings(), 0.01
LIMITS, GAIN_M_S = SETTINGS.limits, SETTINGS.trail_gain_m_s
AT_THE_TIP = np.zeros(3)
REST_DEG = (2.0, 6.0)  # of the axis of a drogue that trails: left, up


def axis(left_deg, up_deg):
    """(3,) the drogue's, of the length that it happens to have."""
    return 0.3 * np.array([1.0, np.tan(np.radians(left_deg)), np.tan(np.radians(up_deg))])


def seen_before(seconds=20.0, at=lambda t: REST_DEG):
    trail = new()
    for t in np.arange(-seconds, 0.0, STEP_S):
        trail.step(Phase.APPROACH, np.array([1.0, 0.0, 0.0]), axis(*at(t)), seen=True)
    return trail


def new():
    return TrailPosition(SETTINGS, STEP_S)


def held(trail, turned_deg, seconds, *, phase=Phase.HOLD, coupling=AT_THE_TIP, seen=True):
    """(n, 2) what it asks for, tick by tick, of a drogue turned by so much."""
    left, up = np.add(REST_DEG, turned_deg)
    asked = []
    for _ in range(round(seconds / STEP_S)):
        trail.step(phase, coupling, axis(left, up), seen=seen)
        asked.append(trail.across_m_s)
    return np.array(asked)


@pytest.mark.parametrize("phase", [Phase.CONTACT, Phase.HOLD, Phase.DISCONNECT])
@pytest.mark.parametrize("turned_deg", [(3.0, 0.0), (-3.0, 0.0), (0.0, 4.0), (1.0, -4.0)])
def test_it_goes_to_where_the_drogue_s_axis_points(phase, turned_deg):
    asked = held(seen_before(), turned_deg, 1.0, phase=phase)[-1]
    np.testing.assert_allclose(asked, GAIN_M_S * np.radians(turned_deg), atol=1e-6)


def test_a_drogue_that_lies_as_it_trailed_is_where_it_trails():
    np.testing.assert_allclose(held(seen_before(), (0.0, 0.0), 2.0), 0.0, atol=1e-12)


def test_it_goes_no_faster_than_it_may():
    np.testing.assert_array_equal(
        held(seen_before(), (40.0, -40.0), 1.0)[-1], SETTINGS.trail_speed_max_m_s * np.array([1.0, -1.0])
    )


def test_while_the_hose_is_looked_at_for_slack_it_stays_where_it_is():
    looked_at = round(LIMITS.slack_to_s / STEP_S)
    asked = held(seen_before(), (3.0, 3.0), 2.0, phase=Phase.CONTACT)
    assert (asked[: looked_at - 1] == 0.0).all() and (asked[looked_at + 1 :] > 0.0).all()


def test_of_a_swing_the_mean_counts_from_the_first_seconds_on():
    """A drogue that swings by 3 degrees every 3 s."""
    for seconds in (3.0, 6.0, 30.0):
        trail = seen_before(seconds, lambda t: np.add(REST_DEG, 3.0 * np.sin(2.0 * np.pi * t / 3.0)))
        assert np.abs(held(trail, (0.0, 0.0), 1.0)[-1]).max() < GAIN_M_S * np.radians(1.0), seconds


def test_where_it_trails_is_the_mean_over_the_time_that_is_set():
    """Turned by 6 degrees to the left for just that time, all but 1/e of it has become the mean."""
    trail = seen_before(60.0, lambda t: np.add(REST_DEG, (6.0 if t > -SETTINGS.trail_before_s else 0.0, 0.0)))
    asked = held(trail, (6.0, 0.0), 1.0)[-1]
    np.testing.assert_allclose(asked, GAIN_M_S * np.radians([6.0, 0.0]) / np.e, rtol=0.01, atol=1e-6)


def test_where_it_trailed_long_ago_is_forgotten():
    trail = seen_before(60.0, lambda t: REST_DEG if t > -5.0 * SETTINGS.trail_before_s else (30.0, 30.0))
    assert np.abs(held(trail, (0.0, 0.0), 1.0)[-1]).max() < GAIN_M_S * np.radians(0.2)


@pytest.mark.parametrize("said", [{"seen": False}, *({"coupling": 0.3 * one} for one in np.eye(3))])
def test_a_drogue_that_is_not_seen_on_the_probe_says_nothing(said):
    trail = seen_before()
    assert held(trail, (3.0, 3.0), 1.0).any()
    assert not held(trail, (3.0, 3.0), 1.0, **said).any()


@pytest.mark.parametrize("phase", [Phase.BACK_OFF, Phase.BREAKAWAY, Phase.CLEAR])
def test_on_the_way_back_it_says_nothing(phase):
    assert not held(seen_before(), (3.0, 3.0), 2.0, phase=phase).any()


def test_where_nothing_was_seen_before_contact_it_says_nothing():
    assert not held(new(), (3.0, 3.0), 2.0).any()


def test_what_is_seen_on_the_probe_is_not_how_it_trails():
    trail = seen_before()
    first = held(trail, (3.0, 3.0), 1.0)[-1]
    np.testing.assert_array_equal(held(trail, (3.0, 3.0), 60.0)[-1], first)


@pytest.mark.parametrize("phase", [Phase.JOIN_UP, Phase.PRE_CONTACT])
def test_how_it_trailed_is_seen_from_farther_astern_too(phase):
    trail = new()
    held(trail, (0.0, 0.0), 20.0, phase=phase, coupling=np.array([4.0, 0.0, 0.0]))
    np.testing.assert_allclose(held(trail, (3.0, -2.0), 1.0)[-1], GAIN_M_S * np.radians((3.0, -2.0)), atol=1e-6)


def test_what_is_only_believed_before_contact_is_not_how_it_trailed():
    trail = seen_before()
    held(trail, (20.0, 20.0), 5.0, phase=Phase.APPROACH, coupling=np.array([1.0, 0.0, 0.0]), seen=False)
    np.testing.assert_allclose(held(trail, (0.0, 0.0), 1.0)[-1], 0.0, atol=1e-12)


def test_at_the_next_contact_too_it_stays_where_it_is_while_the_hose_is_looked_at():
    trail, looked_at = seen_before(), round(LIMITS.slack_to_s / STEP_S)
    held(trail, (3.0, 3.0), 5.0)
    held(trail, (0.0, 0.0), 10.0, phase=Phase.APPROACH, coupling=np.array([1.0, 0.0, 0.0]))
    asked = held(trail, (3.0, 3.0), 2.0, phase=Phase.CONTACT)
    assert (asked[: looked_at - 1] == 0.0).all() and (asked[looked_at + 1 :] > 0.0).all()


def test_the_hose_is_looked_at_no_longer_for_a_drogue_that_is_out_of_view_meanwhile():
    trail = seen_before()
    held(trail, (3.0, 3.0), LIMITS.slack_to_s, phase=Phase.CONTACT, seen=False)
    assert (held(trail, (3.0, 3.0), 1.0, phase=Phase.CONTACT)[1:] > 0.0).all()


@pytest.mark.parametrize("deg_m", [4.0, 9.0])
def test_a_drogue_that_is_held_aside_is_brought_back_though_the_drift_is_known_wrongly(deg_m):
    """A hose that turns the drogue by 4 to 9 degrees a metre (measured), a tip that answers within 1 / course gain."""
    trail, aside_m, speed_m_s, drift_m_s, way = seen_before(), 1.5, -1.0, 0.15, []
    for _ in range(round(12.0 / STEP_S)):
        trail.step(Phase.HOLD, AT_THE_TIP, axis(REST_DEG[0] - deg_m * aside_m, REST_DEG[1]), seen=True)
        wanted_m_s = trail.across_m_s[0] + drift_m_s
        speed_m_s += SETTINGS.course_gain_1_s * (wanted_m_s - speed_m_s) * STEP_S
        aside_m += speed_m_s * STEP_S
        way.append(aside_m)
    last = np.array(way[-round(1.0 / STEP_S) :])
    assert np.abs(last - drift_m_s / (GAIN_M_S * np.radians(deg_m))).max() < 0.1
    assert min(way) > -0.35  # hardly beyond it
