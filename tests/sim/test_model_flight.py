"""The model that the receiver's flight control follows: a free rigid body of the on-board airframe."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from dockair.parameters import load_parameters
from dockair.rotations import exp
from dockair.sim.air.atmosphere import STANDARD_GRAVITY_M_S2, standard_atmosphere
from dockair.sim.aircraft.aerodynamics import AirframeParameters
from dockair.sim.aircraft.engine import rotor_moment
from dockair.sim.aircraft.model_flight import ModelFlight
from dockair.sim.aircraft.trim import Trim, steady_trim

AIRFRAME, AIR, STEP_S = load_parameters("airframe", AirframeParameters), standard_atmosphere(6000.0), 1e-3


def started(trim: Trim) -> tuple[ModelFlight, np.ndarray]:
    """The model in a trim, and the commands that hold it."""
    flight = ModelFlight(AIRFRAME, STEP_S)
    commands = np.append(trim.surfaces_rad, trim.thrust_n / AIRFRAME.mass_kg)
    flight.start(trim.R_WB, trim.velocity_W, trim.w_WB_B, commands)
    return flight, commands


def fly(flight: ModelFlight, trim: Trim, commands: np.ndarray, seconds: float) -> None:
    for _ in range(round(seconds / STEP_S)):
        motion = (flight.R_WB.T @ flight.velocity_W, flight.w_WB_B, flight.actuators[:3])
        flight.step(np.concatenate(trim.aerodynamics.force_and_moment(*motion)), commands)


@pytest.mark.parametrize("turn_rate_rad_s", [0.0, 0.025])
def test_trimmed_model_keeps_its_steady_flight(turn_rate_rad_s: float) -> None:
    """Straight, and in a turn of 25 degrees of bank, where the velocity turns with the path."""
    trim = steady_trim(AIRFRAME, 180.0, AIR, turn_rate_rad_s=turn_rate_rad_s)
    flight, commands = started(trim)
    fly(flight, trim, commands, 0.5)
    turned = exp(np.array([0.0, 0.0, 0.5 * turn_rate_rad_s]))
    np.testing.assert_allclose(flight.velocity_W, turned @ trim.velocity_W, atol=2e-2 if turn_rate_rad_s else 1e-6)
    np.testing.assert_allclose(flight.R_WB, turned @ trim.R_WB, atol=1e-3 if turn_rate_rad_s else 1e-9)


def test_model_flies_as_an_independent_integration_of_the_equations_of_motion() -> None:
    """Surfaces moved by degrees for half a second against SciPy's Runge-Kutta, quaternion-free: a matrix for R."""
    trim = steady_trim(AIRFRAME, 180.0, AIR)
    flight, held = started(trim)
    commands = held + np.array([-0.01, 0.02, 0.03, 0.5])
    lags = np.array([*np.full(3, AIRFRAME.actuator_bandwidth_rad_s), 1.0 / AIRFRAME.engine_time_constant_s])
    inertia = AIRFRAME.inertia_B

    def derivative(_: float, y: np.ndarray) -> np.ndarray:
        R, v, w, actuators = y[:9].reshape(3, 3), y[9:12], y[12:15], y[15:]
        force, moment = trim.aerodynamics.force_and_moment(R.T @ v, w, actuators[:3])
        push = force / AIRFRAME.mass_kg + [actuators[3], 0.0, 0.0]
        torque = moment + rotor_moment(AIRFRAME, w) - np.cross(w, inertia @ w)
        spin = np.array([[0.0, -w[2], w[1]], [w[2], 0.0, -w[0]], [-w[1], w[0], 0.0]])
        falling = R @ push - [0.0, 0.0, STANDARD_GRAVITY_M_S2]
        turning = np.linalg.solve(inertia, torque)
        return np.concatenate([(R @ spin).ravel(), falling, turning, lags * (commands - actuators)])

    start = np.concatenate([trim.R_WB.ravel(), trim.velocity_W, trim.w_WB_B, held])
    expected = solve_ivp(derivative, (0.0, 0.5), start, rtol=1e-9, atol=1e-10).y[:, -1]
    fly(flight, trim, commands, 0.5)
    rolled = np.arccos(0.5 * (np.trace(flight.R_WB @ trim.R_WB.T) - 1.0))
    assert rolled > np.radians(2.0)
    np.testing.assert_allclose(flight.R_WB.ravel(), expected[:9], atol=2e-3)  # the integration is of first order
    np.testing.assert_allclose(flight.velocity_W, expected[9:12], atol=0.02)
    np.testing.assert_allclose(flight.w_WB_B, expected[12:15], atol=4e-3)
    np.testing.assert_allclose(flight.actuators, expected[15:], atol=5e-3)
    np.testing.assert_allclose(flight.R_WB @ flight.R_WB.T, np.eye(3), atol=1e-12)


def test_first_tick_moves_the_actuators_by_what_they_lack_over_their_time_constants() -> None:
    """The engine's other than 1 s, the sheet's own."""
    trim = steady_trim(AIRFRAME, 180.0, AIR)
    flight, move = ModelFlight(replace(AIRFRAME, engine_time_constant_s=0.25), STEP_S), np.array([0.1, -0.2, 0.3, 0.4])
    flight.start(trim.R_WB, trim.velocity_W, trim.w_WB_B, np.zeros(4))
    flight.step(np.zeros(6), move)
    rates = np.array([*np.full(3, AIRFRAME.actuator_bandwidth_rad_s), 4.0])
    np.testing.assert_allclose(flight.actuators, STEP_S * rates * move, rtol=1e-12)


def test_first_tick_turns_as_eulers_equations_say_with_the_rotor() -> None:
    """Angular acceleration of one tick at 0.5 rad/s about all axes, to rounding."""
    trim = steady_trim(AIRFRAME, 180.0, AIR)
    flight, commands = started(trim)
    w, inertia = np.array([0.5, 0.4, -0.3]), AIRFRAME.inertia_B
    flight.start(trim.R_WB, trim.velocity_W, w, commands)
    velocity_B = trim.R_WB.T @ trim.velocity_W
    force, moment = trim.aerodynamics.force_and_moment(velocity_B, w, trim.surfaces_rad)
    expected = np.linalg.solve(inertia, moment + rotor_moment(AIRFRAME, w) - np.cross(w, inertia @ w))
    flight.step(np.concatenate([force, moment]), commands)
    np.testing.assert_allclose((flight.w_WB_B - w) / STEP_S, expected, rtol=1e-9, atol=1e-9)
