"""The baseline on its way in, against a receiver that flies the velocity asked for a response time later."""

from collections import deque
from dataclasses import replace

import numpy as np
import pytest

from dockair.messages import ReceiverCommand
from dockair.nav.guidance.approach import Guidance, GuidanceSettings, RelativeState
from dockair.nav.guidance.controller import Sight, Wanted
from dockair.nav.guidance.phases import Phase
from dockair.nav.guidance.pid import Pid

RATE_HZ, SETTINGS, NOT_FELT = 50, GuidanceSettings(controller="pid"), np.full(3, np.nan)


def joined_up(offset_m, bias_m_s):
    """Places of the drogue from the tip (n, 3) and velocities of the tip (n, 3) until an approach begins."""
    guidance, command = Guidance(SETTINGS, RATE_HZ), ReceiverCommand()
    waiting = [deque([0.0] * round(tau * RATE_HZ)) for tau in SETTINGS.response_s]
    p_PD, places, velocities = np.array(offset_m), [], []
    while guidance.phase is not Phase.APPROACH and len(places) < 90 * RATE_HZ:
        for queue, u in zip(waiting, command.velocity_m_s, strict=True):
            queue.append(u)
        v = np.array([queue.popleft() for queue in waiting]) + bias_m_s
        p_PD = p_PD - v / RATE_HZ
        command = guidance.step(
            RelativeState(
                usable=True,
                contact_usable=True,
                p_PD_B=p_PD,
                rate_PD_B=-v,
                p_PK_B=p_PD + [0.3, 0.0, 0.0],
                w_WB_B=np.zeros(3),
                sigma_lateral_m=0.0,
            )
        )
        places.append(p_PD)
        velocities.append(v)
    assert guidance.phase is Phase.APPROACH
    return np.array(places), np.array(velocities)


@pytest.mark.parametrize("bias_m_s", [(0.0, 0.0, 0.0), (0.2, -0.3, 0.3)])
@pytest.mark.parametrize("aft_m", [14.0, 30.0])
def test_who_comes_from_far_aft_arrives_no_faster_than_it_joins_up_and_stands_astern(aft_m, bias_m_s):
    places, velocities = joined_up((aft_m, 0.0, 0.0), bias_m_s)
    assert velocities[:, 0].max() < SETTINGS.join_up_speed_m_s + 0.1
    assert places[:, 0].min() > SETTINGS.stand_off_m - 0.3


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_who_comes_from_far_aside_hardly_goes_past_the_drogues_line(side):
    places, _ = joined_up((8.0, 20.0 * side, 0.0), (0.0, 0.0, 0.0))
    assert (side * places[:, 1]).min() > -0.15


def held(place_m, distance_m, seen=True):
    """(3,) what the integrals hold after 10 s of a drogue that stands there."""
    pid, push = Pid(SETTINGS.pid, 0.01), np.zeros((1, 3))
    for _ in range(1000):
        pid.observe(Sight(place_m=np.array(place_m), rate_m_s=np.zeros(3), push_m_s2=push) if seen else None, NOT_FELT)
        pid.rate(np.zeros(3), Wanted(distance_m=distance_m, speed_m_s=1.5, aim_m=np.zeros(2)))
    return pid.drift_m_s


def test_an_axis_is_integrated_while_its_own_error_is_small():
    near_m, k_i = SETTINGS.pid.integrated_m, SETTINGS.pid.integral_1_s2
    np.testing.assert_allclose(held((4.1, near_m + 0.1, -0.2), 4.0), 10.0 * k_i * np.array([0.1, 0.0, -0.2]))
    np.testing.assert_allclose(held((4.1 + near_m, 0.1, 0.0), 4.0), 10.0 * k_i * np.array([0.0, 0.1, 0.0]))
    np.testing.assert_array_equal(held((4.1, 0.1, 0.1), None)[0], 0.0)  # closing
    np.testing.assert_array_equal(held((4.1, 0.1, 0.1), 4.0, seen=False), 0.0)


def test_a_gain_of_none_leaves_integral_and_rate():
    s, place_m, rate_m_s = replace(SETTINGS.pid, proportional_1_s=0.0), np.array([4.2, 0.1, -0.1]), np.full(3, 0.2)
    pid = Pid(s, 0.01)
    pid.observe(Sight(place_m=place_m, rate_m_s=rate_m_s, push_m_s2=np.zeros((1, 3))), NOT_FELT)
    asked = pid.rate(np.zeros(3), Wanted(distance_m=4.0, speed_m_s=1.5, aim_m=np.zeros(2)))
    wanted = s.integral_1_s2 * 0.01 * np.array([0.2, 0.1, -0.1]) + s.derivative * rate_m_s
    np.testing.assert_allclose(asked, s.smoothing_1_s * wanted, rtol=1e-12)


FAR, MOST = 1.5 / SETTINGS.pid.proportional_1_s, SETTINGS.pid.error_max_m


@pytest.mark.parametrize(
    ("place_m", "distance_m", "error_m", "integrated_m", "closing_m_s"),
    [
        ((4.2, 0.1, -0.1), 4.0, (0.2, 0.12, -0.13), (0.2, 0.12, -0.13), 0.0),
        ((30.0, -15.0, 9.0), 4.0, (FAR, -MOST, MOST), (0.0, 0.0, 0.0), 0.0),
        ((2.0, 0.1, -0.1), None, (0.0, 0.12, -0.13), (0.0, 0.12, -0.13), 1.5),
    ],
    ids=["near", "far off", "closing"],
)
def test_what_it_asks_for_first_is_equation_1(place_m, distance_m, error_m, integrated_m, closing_m_s):
    s, u, rate_m_s = SETTINGS.pid, np.array([0.3, -0.2, 0.1]), np.array([0.05, -0.1, 0.2])
    pid = Pid(s, 0.01)
    pid.observe(Sight(place_m=np.array(place_m), rate_m_s=rate_m_s, push_m_s2=np.zeros((1, 3))), NOT_FELT)
    asked = pid.rate(u, Wanted(distance_m=distance_m, speed_m_s=1.5, aim_m=np.array([0.02, -0.03])))
    closing = np.array([closing_m_s, 0.0, 0.0])
    wanted = s.proportional_1_s * np.array(error_m) + s.integral_1_s2 * 0.01 * np.array(integrated_m)
    wanted += closing + s.derivative * (rate_m_s + closing)
    np.testing.assert_allclose(asked, s.smoothing_1_s * (wanted - u), rtol=1e-12)


def test_the_error_to_come_is_that_of_now():
    pid = Pid(SETTINGS.pid, 0.01)
    place_m = np.array([4.0, 0.1, -0.2])
    pid.observe(Sight(place_m=place_m, rate_m_s=np.ones(3), push_m_s2=np.zeros((1, 3))), NOT_FELT)
    np.testing.assert_allclose(pid.error_to_come(np.array([0.02, 0.03])), [0.12, -0.17], rtol=1e-12)


def test_along_it_goes_no_faster_than_it_is_told_to_and_across_no_faster_than_it_rushes():
    s, pid = SETTINGS.pid, Pid(SETTINGS.pid, 0.01)
    pid.observe(Sight(place_m=np.array([30.0, -15.0, 9.0]), rate_m_s=np.zeros(3), push_m_s2=np.zeros((1, 3))), NOT_FELT)
    asked = pid.rate(np.zeros(3), Wanted(distance_m=4.0, speed_m_s=0.7, aim_m=np.zeros(2)))
    across_m_s = s.proportional_1_s * s.error_max_m
    np.testing.assert_allclose(asked, s.smoothing_1_s * np.array([0.7, -across_m_s, across_m_s]), rtol=1e-12)


def test_the_integrals_are_held_while_a_drogue_that_was_seen_is_not():
    pid, wanted = Pid(SETTINGS.pid, 0.01), Wanted(distance_m=4.0, speed_m_s=1.5, aim_m=np.zeros(2))
    sight = Sight(place_m=np.array([4.1, 0.2, -0.3]), rate_m_s=np.zeros(3), push_m_s2=np.zeros((1, 3)))
    for seen in (sight, None, None):
        pid.observe(seen, NOT_FELT)
        pid.rate(np.zeros(3), wanted)
    np.testing.assert_allclose(pid.drift_m_s, SETTINGS.pid.integral_1_s2 * 0.01 * np.array([0.1, 0.2, -0.3]))
