"""Design of the receiver's flight control: linear model, margins, steering, reference."""

from typing import Any

import numpy as np
import pytest

from dockair.messages import ReceiverCommand
from dockair.parameters import load_parameters
from dockair.sim.air.atmosphere import standard_atmosphere
from dockair.sim.aircraft.aerodynamics import AirframeParameters
from dockair.sim.aircraft.flight_control import FlightControl, FlightControlParameters
from dockair.sim.aircraft.linear_model import INPUTS, RATE, STATES, linear_model, state_derivative
from dockair.sim.aircraft.reference import Reference
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
    """Along random directions, with a step other than the model's own: the remainder is of second order."""
    trim = level_trim(AIRFRAME, airspeed_m_s, standard_atmosphere(altitude_m))
    model, rng = linear_model(AIRFRAME, trim), np.random.default_rng(8)
    for _ in range(10):
        x, u, g = rng.normal(size=STATES) * 1e-3, rng.normal(size=INPUTS) * 1e-3, rng.normal(size=3) * 1e-3
        slope = 0.5 * (state_derivative(AIRFRAME, trim, x, u, g) - state_derivative(AIRFRAME, trim, -x, -u, -g))
        np.testing.assert_allclose(slope, model.A @ x + model.B @ u + model.B_gust @ g, atol=1e-6)


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


def fly_reference(command: Any, seconds: float, step_s: float = 1e-3) -> np.ndarray:
    """(n, 4, 3) of the chain under a command that is a function of time."""
    reference = Reference(PARAMETERS.reference_limits, step_s)
    reference.start(np.zeros(3), np.eye(3), command(0.0))
    return np.array([reference.step(np.eye(3), command(k * step_s)).copy() for k in range(round(seconds / step_s))])


def test_reference_with_feed_forward_is_the_command_through_the_low_pass_alone() -> None:
    w, size = 1.0, 0.5
    chain = fly_reference(
        lambda t: ReceiverCommand(
            velocity_m_s=np.full(3, size * np.sin(w * t)), acceleration_m_s2=np.full(3, size * w * np.cos(w * t))
        ),
        20.0,
    )
    t = np.arange(1, len(chain) + 1) * 1e-3
    tail = t > 12.0
    b, zeta = PARAMETERS.smoothing_bandwidth_rad_s, PARAMETERS.smoothing_damping
    F = b**2 / (b**2 - w**2 + 2j * zeta * b * w)
    expected = size * np.imag(F * np.exp(1j * w * t[tail]))
    np.testing.assert_allclose(chain[tail, 0], np.tile(expected[:, None], 3), atol=2e-3)  # a tick of delay


def test_reference_keeps_its_limits_and_its_derivatives_belong_together() -> None:
    rng, limits = np.random.default_rng(2), PARAMETERS.reference_limits
    commands = rng.normal(size=(40, 2, 3)) * 6.0
    chain = fly_reference(
        lambda t: ReceiverCommand(velocity_m_s=commands[int(4 * t), 0], acceleration_m_s2=commands[int(4 * t), 1]), 10.0
    )
    assert np.all(np.abs(chain[:, 1]) <= limits.acceleration_m_s2 * 1.2)  # the low pass after the limit overshoots
    assert np.all(np.abs(chain[:, 2]) <= limits.jerk_m_s3 * (1.0 + 1e-12))
    assert np.any(np.abs(chain[:, 2]) == limits.jerk_m_s3)
    for order in range(3):
        np.testing.assert_allclose(np.diff(chain[:, order], axis=0), 1e-3 * chain[1:, order + 1], atol=1e-12)


def test_reference_shortens_a_command_beyond_the_velocity_limit() -> None:
    command = ReceiverCommand(velocity_m_s=np.array([0.0, 40.0, 0.0]))
    chain = fly_reference(lambda t: command, 10.0)
    assert chain[-1, 0, 1] == pytest.approx(PARAMETERS.velocity_limit_m_s, rel=1e-3)
    assert chain[:, 0, 1].max() < 1.02 * PARAMETERS.velocity_limit_m_s


def test_rate_tolerance_damps_the_dutch_roll_the_bare_airframe_has_too_little_of() -> None:
    design = control(120.0, 3000.0)
    A, B, K = loop_matrices(design)

    def yaw_ringing(matrix: np.ndarray) -> float:
        poles, vectors = np.linalg.eig(matrix)
        yaw = np.abs(vectors[RATE.stop - 1]) * (poles.imag > 0.5)
        pole = poles[np.argmax(yaw)]
        return float(-pole.real / abs(pole))

    assert yaw_ringing(design.model.A) < 0.2 < 0.4 < yaw_ringing(A - B @ K)
