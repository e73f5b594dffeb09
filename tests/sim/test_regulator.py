"""Gains of the flight control: optimality, margins, steering."""

import numpy as np
import pytest

from dockair.parameters import load_parameters
from dockair.sim.air.atmosphere import standard_atmosphere
from dockair.sim.aircraft.aerodynamics import AirframeParameters
from dockair.sim.aircraft.flight_control import FlightControl, FlightControlParameters
from dockair.sim.aircraft.linear_model import INPUTS, RATE, STATES
from dockair.sim.aircraft.regulator import CHAIN
from dockair.sim.aircraft.trim import level_trim

FLIGHTS = [(180.0, 6000.0), (120.0, 3000.0)]
AIRFRAME = load_parameters("airframe", AirframeParameters)
PARAMETERS = load_parameters("flight_control", FlightControlParameters)


def control(airspeed_m_s: float, altitude_m: float) -> FlightControl:
    trim = level_trim(AIRFRAME, airspeed_m_s, standard_atmosphere(altitude_m))
    return FlightControl(PARAMETERS, AIRFRAME, trim, 1e-3)


def loop_matrices(design: FlightControl) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """A, B, K of the plant with the three integrals of the velocity."""
    A, B = np.zeros((STATES + 3, STATES + 3)), np.zeros((STATES + 3, INPUTS))
    A[:STATES, :STATES], A[STATES:, :3], B[:STATES] = design.model.A, np.eye(3), design.model.B
    return A, B, np.hstack([design.gains.K, design.gains.K_integral])


@pytest.mark.parametrize(("airspeed_m_s", "altitude_m"), FLIGHTS)
def test_closed_loop_is_stable_and_damped(airspeed_m_s: float, altitude_m: float) -> None:
    A, B, K = loop_matrices(control(airspeed_m_s, altitude_m))
    poles = np.linalg.eigvals(A - B @ K)
    assert poles.real.max() < -0.25
    assert np.min(-poles.real / np.abs(poles)) > 0.4


@pytest.mark.parametrize("broken", range(INPUTS), ids=["elevator", "aileron", "rudder", "thrust"])
@pytest.mark.parametrize(("airspeed_m_s", "altitude_m"), FLIGHTS)
def test_each_loop_has_margin_at_its_actuator(airspeed_m_s: float, altitude_m: float, broken: int) -> None:
    """Loop broken at one input, the others closed: phase margin, and the delay it stands for."""
    A, B, K = loop_matrices(control(airspeed_m_s, altitude_m))
    others = B @ np.diag(np.arange(INPUTS) != broken).astype(float) @ K
    omega = np.logspace(-2, 3, 4000)
    L = np.array([K[broken] @ np.linalg.solve(1j * w * np.eye(len(A)) - A + others, B[:, broken]) for w in omega])
    crossings = np.flatnonzero((np.abs(L[:-1]) > 1.0) != (np.abs(L[1:]) > 1.0))
    margin = np.abs(np.angle(-L[crossings]))
    assert np.all(margin > np.radians(60.0) - 0.02)  # what a linear-quadratic regulator promises
    assert np.all(margin / omega[crossings] > 0.08)
    assert np.all(omega[crossings] < 0.5 * AIRFRAME.actuator_bandwidth_rad_s)


@pytest.mark.parametrize(("airspeed_m_s", "altitude_m"), FLIGHTS)
def test_gains_satisfy_the_algebraic_riccati_equation_through_their_return_difference(
    airspeed_m_s: float, altitude_m: float
) -> None:
    """Kalman's identity (1 + L)* R (1 + L) = R + B* (jw - A)^-* Q (jw - A)^-1 B, independent of how K was found."""
    A, B, K = loop_matrices(control(airspeed_m_s, altitude_m))
    t = PARAMETERS.tolerances
    Q = np.diag(np.concatenate([t.velocity_m_s, t.attitude_rad, t.rate_rad_s, np.full(4, np.inf), t.integral_m]) ** -2)
    R = np.diag(np.append(t.surfaces_rad, t.thrust_m_s2) ** -2.0)
    for w in (0.3, 1.0, 4.0, 15.0):
        resolvent_B = np.linalg.solve(1j * w * np.eye(len(A)) - A, B.astype(complex))
        difference = np.eye(INPUTS) + K @ resolvent_B
        left = difference.conj().T @ R @ difference
        right = R + resolvent_B.conj().T @ Q @ resolvent_B
        np.testing.assert_allclose(left, right, rtol=1e-6, atol=1e-6 * np.abs(right).max())


def test_steering_solves_the_regulator_equations() -> None:
    design = control(180.0, 6000.0)
    Pi, Gamma, model = design.gains.Pi, design.gains.Gamma, design.model
    S = np.kron(np.eye(CHAIN, k=1), np.eye(3))
    np.testing.assert_allclose(model.A @ Pi + model.B @ Gamma, Pi @ S, atol=1e-10)
    np.testing.assert_allclose(Pi[:3], np.hstack([np.eye(3), np.zeros((3, 9))]), atol=1e-12)
    np.testing.assert_allclose(Pi[5], 0.0, atol=1e-12)  # heading stays


def test_steady_lateral_acceleration_is_flown_with_bank() -> None:
    """Pi's bank for 1 m/s^2 to the left: tan(bank) = a / g to the left (negative about x)."""
    Pi = control(180.0, 6000.0).gains.Pi
    assert Pi[3, 4] == pytest.approx(-1.0 / 9.80665, rel=0.01)
    assert Pi[12, 3] == pytest.approx(1.0, rel=0.02)  # 1 m/s^2 forward: as much thrust per mass


def test_rate_tolerance_damps_the_dutch_roll_the_bare_airframe_has_too_little_of() -> None:
    design = control(120.0, 3000.0)
    A, B, K = loop_matrices(design)

    def yaw_ringing(matrix: np.ndarray) -> float:
        poles, vectors = np.linalg.eig(matrix)
        yaw = np.abs(vectors[RATE.stop - 1]) * (poles.imag > 0.5)
        pole = poles[np.argmax(yaw)]
        return float(-pole.real / abs(pole))

    assert yaw_ringing(design.model.A) < 0.2 < 0.4 < yaw_ringing(A - B @ K)
