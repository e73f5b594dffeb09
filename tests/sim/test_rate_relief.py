"""The reference is taken back where a surface is asked for more than its rate."""

import numpy as np
import pytest

from dockair.sim.aircraft.rate_relief import RateRelief, RateReliefParameters

STEP_S, BANDWIDTH = 1e-3, 20.0
STOPS = np.array([0.4, 0.35, 0.5])
RATES = np.array([1.0, 1.4, 2.0])  # asked for by 0.05, 0.07 and 0.1 rad
CALM = np.zeros(3)
UP, LEFT = 2, 1
TAKEN_BACK = {0: [True, True, True], 1: [False, True, False], 2: [False, True, False]}  # elevator, aileron, rudder


@pytest.fixture
def relief():
    parameters = RateReliefParameters(time_s=0.5, busy_share=0.4, least=0.2, stop_share=0.9)
    return RateRelief(parameters, BANDWIDTH, RATES, STOPS, STEP_S)


def test_surfaces_that_keep_up_leave_the_reference_alone(relief):
    just_inside = 0.999 * RATES / BANDWIDTH
    assert all((relief.step(just_inside, CALM, CALM) == 1.0).all() for _ in range(2000))
    assert relief.haste == 0.0


@pytest.mark.parametrize("surface", range(3))
def test_a_late_elevator_takes_back_all_axes_a_late_aileron_or_rudder_its_own(relief, surface):
    asked = CALM.copy()
    asked[surface] = -1.001 * RATES[surface] / BANDWIDTH
    shares = relief.step(asked, CALM, CALM)
    assert (shares < 1.0).tolist() == TAKEN_BACK[surface]
    assert relief.haste == pytest.approx((1.0 - shares.min()) / 0.8)


@pytest.mark.parametrize("surface", range(3))
@pytest.mark.parametrize("sign", [-1.0, 1.0])
def test_a_surface_near_its_stop_takes_the_reference_back_the_model_s_too(relief, surface, sign):
    at = CALM.copy()
    at[surface] = sign * 0.899 * STOPS[surface]
    assert (relief.step(at, at, at) == 1.0).all()
    at[surface] = sign * 0.901 * STOPS[surface]
    assert relief.step(CALM, CALM, at)[LEFT] < 1.0
    again = relief.step(at, at, CALM)[LEFT]
    assert again < relief.step(CALM, CALM, CALM)[LEFT] < 1.0


@pytest.mark.parametrize("surface", range(3))
def test_near_the_stop_the_command_counts_and_not_the_surface(relief, surface):
    """Behind or ahead of each other by less than what is late."""
    beyond, inside = np.zeros((2, 3))
    beyond[surface], inside[surface] = 0.91 * STOPS[surface], 0.89 * STOPS[surface]
    assert (relief.step(inside, beyond, CALM) == 1.0).all()
    assert relief.step(beyond, inside, CALM)[LEFT] < 1.0


def test_the_share_falls_as_the_equations_say(relief):
    """b = 1 - exp(-t/T) while busy; the share is 1 - 0.8 b / 0.4, and no less than 0.2."""
    asked = np.array([0.2, 0.0, 0.0])
    shares = [relief.step(asked, CALM, CALM)[UP] for _ in range(600)]
    t = STEP_S * np.arange(1, 601)
    expected = 1.0 - 0.8 * np.minimum((1.0 - np.exp(-t / 0.5)) / 0.4, 1.0)
    np.testing.assert_allclose(shares, expected, atol=1e-9)
    assert shares[-1] == pytest.approx(0.2)
    assert relief.haste == 1.0


def test_however_long_an_aileron_is_late_the_least_share_is_left_and_haste_is_whole(relief):
    for _ in range(5000):
        shares = relief.step(np.array([0.0, 0.2, 0.0]), CALM, CALM)
    np.testing.assert_allclose(shares, [1.0, 0.2, 1.0], atol=1e-12)
    assert relief.haste == 1.0


def test_to_the_left_the_worse_of_both_counts_and_so_it_does_for_the_feedback(relief):
    for _ in range(100):
        relief.step(np.array([0.0, 0.2, 0.0]), CALM, CALM)
    for _ in range(20):
        shares = relief.step(np.array([0.2, 0.0, 0.0]), CALM, CALM)
    assert shares[LEFT] < shares[UP] == shares[0] < 1.0
    assert relief.haste == pytest.approx((1.0 - shares[LEFT]) / 0.8)


def test_it_comes_back_when_the_surfaces_keep_up_again(relief):
    for _ in range(600):
        relief.step(np.array([0.2, 0.0, 0.0]), CALM, CALM)
    later = [relief.step(CALM, CALM, CALM)[UP] for _ in range(3000)]
    assert np.all(np.diff(later) >= 0.0) and later[-1] > 0.99
