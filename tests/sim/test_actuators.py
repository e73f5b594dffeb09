"""Control surfaces and engine lever."""

from dataclasses import replace

import numpy as np
import pytest

from dockair.parameters import load_parameters
from dockair.sim.air.atmosphere import standard_atmosphere
from dockair.sim.aircraft.actuators import Actuators
from dockair.sim.aircraft.aerodynamics import AirframeParameters
from dockair.sim.aircraft.trim import level_trim

AIRFRAME = load_parameters("airframe", AirframeParameters)
TRIM = level_trim(AIRFRAME, 180.0, standard_atmosphere(6000.0))
FREE = replace(AIRFRAME, surface_rate_limits_rad_s=np.full(3, 1e6))


@pytest.mark.parametrize("step_s", [1e-3, 5e-3])
def test_small_command_is_followed_by_the_exact_first_order_lag_whatever_the_step(step_s: float) -> None:
    actuators, move = Actuators(FREE, TRIM, step_s), np.array([0.01, -0.02, 0.03])
    for _ in range(round(0.1 / step_s)):
        actuators.step(TRIM.surfaces_rad + move, TRIM.thrust_n + 1000.0)
    share = 1.0 - np.exp(-0.1 * AIRFRAME.actuator_bandwidth_rad_s)
    np.testing.assert_allclose(actuators.surfaces_rad, TRIM.surfaces_rad + share * move, rtol=1e-9)
    gained = 1000.0 * (1.0 - np.exp(-0.1 / AIRFRAME.engine_time_constant_s))
    assert actuators.thrust_n == pytest.approx(TRIM.thrust_n + gained, rel=1e-9)


@pytest.mark.parametrize("sense", [1.0, -1.0])
def test_large_command_is_followed_at_the_surfaces_own_rates_up_to_their_stops(sense: float) -> None:
    actuators, step_s = Actuators(AIRFRAME, TRIM, 1e-3), 1e-3
    for _ in range(50):
        actuators.step(np.full(3, 9.0 * sense), 0.0)
    moved = actuators.surfaces_rad - TRIM.surfaces_rad
    np.testing.assert_allclose(moved, 50 * step_s * sense * AIRFRAME.surface_rate_limits_rad_s, rtol=1e-9)
    for _ in range(2000):
        actuators.step(np.full(3, 9.0 * sense), 0.0)
    np.testing.assert_allclose(actuators.surfaces_rad, sense * AIRFRAME.surface_limits_rad, rtol=1e-9)


def test_large_rise_of_thrust_is_slow_and_a_fall_quick() -> None:
    """From idle to military for 2.5 s, and back for 1 s [Stevens & Lewis, appendix A]."""
    span = TRIM.thrust_range
    rise, fall = Actuators(AIRFRAME, TRIM, 1e-3), Actuators(AIRFRAME, TRIM, 1e-3)
    rise.thrust_n, fall.thrust_n = span.idle_n, span.military_n
    quick = 1.0 - np.exp(-1.0 / AIRFRAME.engine_time_constant_s)
    for _ in range(1000):
        fall.step(TRIM.surfaces_rad, span.idle_n)
    gap = 1.0  # of the range; the book's lag, by Euler steps of 1 ms
    for k in range(2500):
        rise.step(TRIM.surfaces_rad, span.military_n)
        gap -= 1e-3 * gap * (1.0 if gap <= 0.5 else 1.9 - 1.8 * gap)
        assert span.throttle(rise.thrust_n) == pytest.approx(1.0 - gap, abs=1e-3)
        assert k >= 1000 or span.throttle(rise.thrust_n) < 0.25
    assert gap < 0.4  # it has become quick
    assert 1.0 - span.throttle(fall.thrust_n) == pytest.approx(quick, rel=1e-9)


def test_thrust_follows_a_small_command_with_the_sheets_time_constant() -> None:
    """Other than the book's 1 s, whose inverse is the same number."""
    quick = Actuators(replace(AIRFRAME, engine_time_constant_s=0.25), TRIM, 1e-3)
    for _ in range(250):
        quick.step(TRIM.surfaces_rad, TRIM.thrust_n + 1000.0)
    assert quick.thrust_n - TRIM.thrust_n == pytest.approx(1000.0 * (1.0 - np.exp(-1.0)), rel=1e-9)


def test_throttle_is_the_commands_place_in_the_thrust_range() -> None:
    actuators, span = Actuators(AIRFRAME, TRIM, 1e-3), TRIM.thrust_range
    for command_n, throttle in ((-1e6, 0.0), (1e6, 1.0), (0.5 * (span.idle_n + span.military_n), 0.5)):
        actuators.step(TRIM.surfaces_rad, command_n)
        assert actuators.throttle == pytest.approx(throttle, abs=1e-12)
