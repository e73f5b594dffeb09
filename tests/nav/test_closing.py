"""When to close."""

import numpy as np
import pytest

from dockair.nav.guidance.closing import ClosingSettings, PredictedMiss, room_to_stop_m, time_to_contact_s

SETTINGS = ClosingSettings()


def _fed(errors):
    miss = PredictedMiss(SETTINGS, 0.01)
    for error in errors:
        miss.step(float(error))
    return miss


def test_the_spread_is_the_rms_of_the_last_swing_and_forgets_what_was_before():
    errors = np.random.default_rng(3).normal(size=1000)
    assert _fed(errors).spread_m == pytest.approx(np.sqrt(np.mean(errors[-300:] ** 2)), rel=1e-9)


def test_nothing_is_known_before_a_whole_swing_nor_after_forgetting():
    miss = _fed(np.zeros(299))
    assert miss.spread_m == np.inf
    miss.step(0.0)
    assert miss.spread_m == 0.0
    miss.forget()
    assert miss.spread_m == np.inf


def test_what_was_followed_before_forgetting_has_no_part_in_the_spread():
    miss = _fed(np.full(300, 1.0))
    miss.forget()
    for _ in range(300):
        miss.step(0.1)
    assert miss.spread_m == pytest.approx(0.1, rel=1e-9)


def test_nothing_is_known_after_a_whole_swing_in_which_the_drogue_was_not_seen():
    miss = _fed(np.full(300, 0.1))
    for _ in range(299):
        miss.skip()
    assert miss.spread_m == pytest.approx(0.1)
    miss.step(0.1)
    for _ in range(299):
        miss.skip()
    assert miss.spread_m == pytest.approx(0.1)
    miss.skip()
    assert miss.spread_m == np.inf


def test_the_error_to_come_counts_whole_at_the_ring_and_hardly_from_afar():
    miss = _fed(np.full(300, 0.03))
    assert miss.at_contact_m(0.04, 0.0, 1.2) == pytest.approx(0.05)
    assert miss.at_contact_m(0.04, 3.0, 1.2) == pytest.approx(0.03, abs=1e-4)
    t = 0.5 / 1.2
    expected = np.hypot(0.04 * np.exp(-t / SETTINGS.error_time_s), 0.03)
    assert miss.at_contact_m(0.04, 0.5, 1.2) == pytest.approx(expected, rel=1e-12)


def test_a_receiver_that_brakes_after_its_response_time_stops_the_margin_short():
    """Against the motion integrated in small steps."""
    c, x, t, dt = 1.2, room_to_stop_m(SETTINGS, 1.2), 0.0, 1e-4
    while c > 0.0:
        c = c - SETTINGS.deceleration_m_s2 * dt if t > SETTINGS.response_s else c
        x, t = x - max(c, 0.0) * dt, t + dt
    assert x == pytest.approx(SETTINGS.margin_m, abs=1e-3)
    assert room_to_stop_m(SETTINGS, 0.0) == room_to_stop_m(SETTINGS, -0.5) == SETTINGS.margin_m


@pytest.mark.parametrize("deceleration", [0.2, 0.3, 0.5])
def test_an_airframe_that_brakes_less_runs_up_so_that_it_stops_within_the_same_room(deceleration):
    weak = SETTINGS.braked_at(deceleration)
    assert weak.deceleration_m_s2 == deceleration
    assert weak.run_up_m_s < SETTINGS.run_up_m_s
    assert room_to_stop_m(weak, weak.run_up_m_s) == pytest.approx(room_to_stop_m(SETTINGS, SETTINGS.run_up_m_s))


def test_an_airframe_that_brakes_more_runs_up_no_faster():
    assert SETTINGS.braked_at(5.0) == SETTINGS


@pytest.mark.parametrize("closure", [0.0, 0.5, 1.2])
@pytest.mark.parametrize("distance", [0.1, 1.0, 2.5])
def test_time_to_contact_is_that_of_the_ramp_flown_a_response_time_later(closure, distance):
    """Against the motion integrated in small steps; what was commanded before was the closure of now."""
    full, ramp, dt, t, x = 1.2, 0.6, 1e-4, 0.0, distance
    while x > 0.0:
        c = min(closure + ramp * max(t - SETTINGS.response_s, 0.0), full)
        x, t = x - c * dt, t + dt
    assert time_to_contact_s(SETTINGS, distance, closure, full, ramp) == pytest.approx(t, abs=1e-3)


def test_who_stands_at_the_ring_or_past_it_is_there_now():
    for distance_m in (0.0, -0.2):
        assert time_to_contact_s(SETTINGS, distance_m, 0.0, 1.2, 0.6) == 0.0
