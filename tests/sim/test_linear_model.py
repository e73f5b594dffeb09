"""The receiver's equations of motion about trim, and their Jacobians."""

from dataclasses import replace

import numpy as np
import pytest

from dockair.parameters import load_parameters
from dockair.rotations import exp
from dockair.sim.air.atmosphere import standard_atmosphere
from dockair.sim.aircraft.aerodynamics import AirframeParameters
from dockair.sim.aircraft.derivatives import DerivativeAirframe
from dockair.sim.aircraft.linear_model import INPUTS, STATES, linear_model, state_derivative
from dockair.sim.aircraft.trim import level_trim, steady_trim

FLIGHTS = [(180.0, 6000.0), (120.0, 3000.0)]
AIRFRAME = load_parameters("airframe", AirframeParameters)


@pytest.mark.parametrize(("airspeed_m_s", "altitude_m"), FLIGHTS)
def test_linear_model_has_the_modes_of_an_f16(airspeed_m_s: float, altitude_m: float) -> None:
    """Stable short period and Dutch roll of 1 to 4 rad/s, roll mode near 2 /s, a slow phugoid; nothing unstable."""
    trim = level_trim(AIRFRAME, airspeed_m_s, standard_atmosphere(altitude_m))
    modes = np.linalg.eigvals(linear_model(AIRFRAME, trim).A)
    assert modes.real.max() < 1e-9
    oscillations = np.sort(np.abs(modes[modes.imag > 1e-3]))
    # Lanchester: phugoid at sqrt(2) g / V
    assert oscillations[0] == pytest.approx(np.sqrt(2.0) * 9.80665 / airspeed_m_s, rel=0.15)
    assert np.all((oscillations[1:] > 1.0) & (oscillations[1:] < 4.0))


@pytest.mark.parametrize(("airspeed_m_s", "altitude_m"), FLIGHTS)
def test_linear_model_is_the_derivative_of_the_equations_of_motion(airspeed_m_s: float, altitude_m: float) -> None:
    """Along random directions, with a step other than the model's own; the remainder, from the tables' kinks at zero
    sideslip, is of second order."""
    trim = level_trim(AIRFRAME, airspeed_m_s, standard_atmosphere(altitude_m))
    model, rng = linear_model(AIRFRAME, trim), np.random.default_rng(8)
    for _ in range(10):
        x, u, g = rng.normal(size=STATES) * 1e-4, rng.normal(size=INPUTS) * 1e-4, rng.normal(size=3) * 1e-4
        slope = 0.5 * (state_derivative(AIRFRAME, trim, x, u, g) - state_derivative(AIRFRAME, trim, -x, -u, -g))
        np.testing.assert_allclose(slope, model.A @ x + model.B @ u + model.B_gust @ g, atol=1e-7)


def test_actuators_close_what_they_lack_of_their_commands_at_the_rates_of_the_sheet() -> None:
    """The engine's other than 1/s, the sheets' own."""
    airframe = replace(AIRFRAME, engine_time_constant_s=0.25)
    model = linear_model(airframe, level_trim(airframe, 180.0, standard_atmosphere(6000.0)))
    rates = np.diag([*np.full(3, airframe.actuator_bandwidth_rad_s), 4.0])
    np.testing.assert_allclose(model.B[9:], rates, rtol=1e-12)
    np.testing.assert_allclose(model.A[9:, 9:], -rates, rtol=1e-9, atol=1e-9)
    assert not model.B[:9].any() and np.abs(model.A[9:, :9]).max() < 1e-9


@pytest.mark.parametrize("turn_rate_rad_s", [0.0, 0.025, -0.04])
def test_nothing_changes_in_a_steady_flight_left_alone(turn_rate_rad_s: float) -> None:
    for airframe in (AIRFRAME, load_parameters("airframe_unmanned", DerivativeAirframe)):
        trim = steady_trim(
            airframe, 120.0, standard_atmosphere(3000.0), turn_rate_rad_s=turn_rate_rad_s, climb_rad=-0.02
        )
        x_dot = state_derivative(airframe, trim, np.zeros(STATES), np.zeros(INPUTS), np.zeros(3))
        np.testing.assert_allclose(x_dot, 0.0, atol=1e-8)


def test_in_a_turn_a_change_of_heading_alone_changes_nothing_but_the_velocitys_direction() -> None:
    """Attitude and velocity turned together by a small angle about the vertical: the same flight on another heading."""
    trim = steady_trim(AIRFRAME, 180.0, standard_atmosphere(6000.0), turn_rate_rad_s=0.025)
    A = linear_model(AIRFRAME, trim).A
    direction = np.zeros(STATES)
    direction[0:3], direction[5] = np.cross([0.0, 0.0, 1.0], trim.velocity_W), 1.0
    np.testing.assert_allclose((A @ direction)[3:], 0.0, atol=1e-6)
    # dv/dt of the turned velocity: still r x v in still axes, which in the path's axes is nothing
    np.testing.assert_allclose((A @ direction)[:3], 0.0, atol=1e-4)


def test_specific_force_beyond_trim_is_that_of_the_accelerometers() -> None:
    """F and F_gust by differences of the force itself along random directions."""
    trim = steady_trim(AIRFRAME, 180.0, standard_atmosphere(6000.0), turn_rate_rad_s=0.02)
    model, rng = linear_model(AIRFRAME, trim), np.random.default_rng(5)

    def felt(x: np.ndarray, gust: np.ndarray) -> np.ndarray:
        R = exp(x[3:6]) @ trim.R_WB
        v_B = R.T @ (trim.velocity_W + x[:3] - gust)
        force, _ = trim.aerodynamics.force_and_moment(v_B, trim.w_WB_B + x[6:9], trim.surfaces_rad + x[9:12])
        return np.asarray((force + [trim.thrust_n, 0.0, 0.0]) / AIRFRAME.mass_kg + [x[12], 0.0, 0.0])

    for _ in range(5):
        x, gust = 1e-4 * rng.normal(size=STATES), 1e-4 * rng.normal(size=3)
        slope = 0.5 * (felt(x, gust) - felt(-x, -gust))
        np.testing.assert_allclose(slope, model.F @ x + model.F_gust @ gust, atol=1e-7)


def test_in_a_turn_a_tilt_stays_where_it_is_in_still_axes_and_so_goes_round_in_the_paths() -> None:
    """With rates held at the trim's, by turning the body and the axes by hand over 1 ms."""
    trim = steady_trim(AIRFRAME, 180.0, standard_atmosphere(6000.0), turn_rate_rad_s=0.04)
    A, h = linear_model(AIRFRAME, trim).A, 1e-3
    for axis in np.eye(3):
        tilted = exp(1e-3 * axis) @ trim.R_WB
        later = exp(-trim.w_W * h) @ tilted @ exp(trim.w_WB_B * h) @ trim.R_WB.T
        phi = 0.5 * np.array([later[2, 1] - later[1, 2], later[0, 2] - later[2, 0], later[1, 0] - later[0, 1]])
        np.testing.assert_allclose(A[3:6, 3:6] @ axis, (phi - np.sin(1e-3) * axis) / (1e-3 * h), atol=5e-6)
    assert abs(A[3, 4] - 0.04) < 1e-9  # a roll that comes of a pitch: left turn, nose down becomes right wing down
