"""The way pushed in and the speed with which to go on, by the pod's light."""

from dataclasses import replace

import pytest

from dockair.messages import Light
from dockair.nav.guidance.guidance_settings import GuidanceSettings
from dockair.nav.guidance.phases import Phase
from dockair.nav.guidance.take_in import TakeIn

SETTINGS = GuidanceSettings()
LIMITS, STEP_S = SETTINGS.limits, 0.01


def begun(speed_m_s=0.0):
    take_in = TakeIn(SETTINGS, STEP_S)
    take_in.begin(speed_m_s)
    return take_in


def flown(take_in, phase, light, seconds):
    for _ in range(round(seconds / STEP_S)):
        take_in.step(take_in.speed_m_s(phase, light), light)
    return take_in.pushed_in_m


def test_what_is_commanded_at_the_coupling_is_still_flown():
    assert begun(1.2).pushed_in_m == pytest.approx(1.2 * SETTINGS.response_s[0])


def test_contact_comes_to_rest_where_it_is_to_hold_and_never_goes_back():
    take_in = begun()
    flown(take_in, Phase.CONTACT, Light.AMBER, LIMITS.slack_to_s)
    first_m_s = min(SETTINGS.closure_speed_m_s, SETTINGS.take_in_gain_1_s * LIMITS.take_in_m)
    assert take_in.speed_m_s(Phase.CONTACT, Light.AMBER) == first_m_s
    assert flown(take_in, Phase.CONTACT, Light.GREEN, 60.0) == pytest.approx(LIMITS.take_in_m, abs=1e-3)
    take_in.step(10.0 / STEP_S, Light.GREEN)
    assert take_in.speed_m_s(Phase.CONTACT, Light.GREEN) == 0.0


def test_it_is_not_pushed_in_before_it_is_told_whether_the_hose_is_slack():
    take_in = begun()
    assert flown(take_in, Phase.CONTACT, Light.AMBER, LIMITS.slack_to_s - STEP_S) == 0.0
    assert take_in.speed_m_s(Phase.CONTACT, Light.AMBER) == 0.0
    assert flown(take_in, Phase.CONTACT, Light.AMBER, STEP_S) == 0.0
    assert take_in.speed_m_s(Phase.CONTACT, Light.AMBER) > 0.5
    take_in.begin(0.0)
    assert take_in.speed_m_s(Phase.CONTACT, Light.AMBER) == 0.0


def test_a_hold_under_amber_goes_on_by_a_set_way_and_no_further():
    pushed_m = flown(begun(), Phase.HOLD, Light.AMBER, 60.0)
    assert pushed_m == pytest.approx(LIMITS.take_in_m + LIMITS.push_on_m, abs=SETTINGS.regain_speed_m_s * STEP_S)


def test_from_where_the_light_was_green_last_it_goes_on_again():
    take_in = begun()
    take_in.step(7.0 / STEP_S, Light.GREEN)
    assert take_in.speed_m_s(Phase.HOLD, Light.GREEN) == 0.0
    assert flown(take_in, Phase.HOLD, Light.AMBER, 60.0) == pytest.approx(7.0 + LIMITS.push_on_m, abs=0.01)


def test_under_a_flashing_light_it_eases_back():
    assert begun().speed_m_s(Phase.HOLD, Light.FLASHING_AMBER) == -SETTINGS.regain_speed_m_s


def test_the_next_contact_begins_anew():
    take_in = begun()
    flown(take_in, Phase.HOLD, Light.AMBER, 60.0)
    take_in.begin(0.0)
    assert take_in.pushed_in_m == 0.0
    assert flown(take_in, Phase.HOLD, Light.AMBER, 60.0) == pytest.approx(LIMITS.take_in_m + LIMITS.push_on_m, abs=0.01)


def test_how_far_the_light_was_green_is_forgotten_by_the_next_contact():
    take_in = begun()
    take_in.step(7.0 / STEP_S, Light.GREEN)
    take_in.begin(0.0)
    assert flown(take_in, Phase.HOLD, Light.AMBER, 60.0) == pytest.approx(LIMITS.take_in_m + LIMITS.push_on_m, abs=0.01)


def test_beyond_the_inner_limit_no_fuel_has_flown_and_no_way_is_gained_to_push_on():
    take_in = begun()
    take_in.step(7.0 / STEP_S, Light.FLASHING_AMBER)
    assert take_in.speed_m_s(Phase.HOLD, Light.AMBER) == 0.0


def test_it_is_pushed_in_no_faster_than_it_was_closed_upon_however_far():
    limits = replace(LIMITS, take_in_m=2.0 * SETTINGS.closure_speed_m_s / SETTINGS.take_in_gain_1_s)
    take_in = TakeIn(replace(SETTINGS, limits=limits), STEP_S)
    take_in.begin(0.0)
    flown(take_in, Phase.CONTACT, Light.AMBER, LIMITS.slack_to_s)
    assert take_in.speed_m_s(Phase.CONTACT, Light.AMBER) == SETTINGS.closure_speed_m_s


def test_nothing_is_pushed_into_a_hose_that_is_dead():
    take_in = begun()
    take_in.step(0.0, Light.RED)
    assert take_in.speed_m_s(Phase.HOLD, Light.AMBER) > 0.0
    assert take_in.speed_m_s(Phase.HOLD, Light.RED) == 0.0
