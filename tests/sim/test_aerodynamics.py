"""Receiver's aerodynamics, engine limits and trim."""

import numpy as np
import pytest

from dockair.errors import DockairError
from dockair.parameters import load_parameters
from dockair.rotations import exp
from dockair.sim.air.atmosphere import STANDARD_GRAVITY_M_S2, standard_atmosphere
from dockair.sim.aircraft.aerodynamics import (
    AirframeParameters,
    LinearAerodynamics,
    flow_angles,
    linearise,
    static_coefficients,
)
from dockair.sim.aircraft.engine import thrust_range
from dockair.sim.aircraft.trim import level_trim

FLIGHTS = [(180.0, 6000.0), (120.0, 3000.0), (150.0, 6000.0)]
AIRFRAME = load_parameters("airframe", AirframeParameters)
MODEL = linearise(AIRFRAME, 0.06, -0.04, 0.66)


def force_and_moment(
    model: LinearAerodynamics = MODEL,
    *,
    alpha: float = 0.06,
    beta: float = 0.0,
    w_B: tuple[float, float, float] = (0.0, 0.0, 0.0),
    surfaces: tuple[float, float, float] = (-0.04, 0.0, 0.0),
) -> np.ndarray:
    """(6,) at 180 m/s; air from below for positive alpha, from the right for positive beta."""
    v_B = 180.0 * np.array([np.cos(alpha) * np.cos(beta), -np.sin(beta), -np.sin(alpha) * np.cos(beta)])
    force, moment = model.force_and_moment(v_B, np.array(w_B), np.array(surfaces))
    return np.concatenate([force, moment])


@pytest.mark.parametrize(
    ("centre_of_gravity", "alpha_rad", "elevator_deg"),
    [(0.30, 0.03936, -1.931), (0.35, 0.03691, -0.7588), (0.38, 0.03544, -0.05590)],
)
def test_published_trim_of_the_f16_is_reproduced(
    centre_of_gravity: float, alpha_rad: float, elevator_deg: float
) -> None:
    """Level flight at 502 ft/s, sea level [Stevens & Lewis, table 3.6-3]; the elevator agrees to its last digit."""
    airframe = load_parameters("airframe", AirframeParameters, {"centre_of_gravity": centre_of_gravity})
    trim = level_trim(airframe, 502.0 * 0.3048, standard_atmosphere(0.0))
    assert trim.alpha_rad == pytest.approx(alpha_rad, abs=5e-5)
    assert np.degrees(trim.elevator_rad) == pytest.approx(elevator_deg, abs=1e-3)


@pytest.mark.parametrize(("airspeed_m_s", "altitude_m"), FLIGHTS)
def test_trim_balances_weight_and_moments_exactly(airspeed_m_s: float, altitude_m: float) -> None:
    trim = level_trim(AIRFRAME, airspeed_m_s, standard_atmosphere(altitude_m))
    v_B = trim.R_WB.T @ np.array([airspeed_m_s, 0.0, 0.0])
    force, moment = trim.aerodynamics.force_and_moment(v_B, np.zeros(3), trim.surfaces_rad)
    weight = AIRFRAME.mass_kg * STANDARD_GRAVITY_M_S2
    net = trim.R_WB @ (force + np.array([trim.thrust_n, 0.0, 0.0])) - np.array([0.0, 0.0, weight])
    assert np.abs(net).max() < 1e-10 * weight
    assert np.abs(moment).max() < 1e-10 * weight


def test_trim_is_nose_up_with_the_air_from_below() -> None:
    trim = level_trim(AIRFRAME, 180.0, standard_atmosphere(6000.0))
    assert trim.R_WB[2, 0] == pytest.approx(np.sin(trim.alpha_rad)) and trim.alpha_rad > 0.0
    airspeed, alpha, beta = flow_angles(trim.R_WB.T @ np.array([180.0, 0.0, 0.0]))
    assert (airspeed, alpha, beta) == pytest.approx((180.0, trim.alpha_rad, 0.0))


def test_air_from_the_right_is_positive_sideslip() -> None:
    """Flying to the right (y is left) the air comes from the right."""
    assert flow_angles(np.array([100.0, -5.0, 0.0]))[2] == pytest.approx(np.arcsin(5.0 / np.hypot(100.0, 5.0)))


FX, FY, FZ, MX, MY, MZ = range(6)


@pytest.mark.parametrize(
    ("change", "component", "sign"),
    [
        ({"surfaces": (-0.14, 0.0, 0.0)}, MY, -1),  # elevator's trailing edge up pitches up
        ({"surfaces": (-0.14, 0.0, 0.0)}, FZ, -1),  # and pushes the tail down
        ({"surfaces": (-0.04, -0.1, 0.0)}, MX, +1),  # aileron to the right rolls right
        ({"surfaces": (-0.04, 0.0, -0.1)}, MZ, -1),  # rudder to the right yaws right
        ({"surfaces": (-0.04, 0.0, -0.1)}, FY, +1),  # and pushes the tail left
        ({"alpha": 0.10}, FZ, +1),  # lift
        ({"alpha": 0.10}, MY, +1),  # static stability: nose down against the angle of attack (0.30 chord)
        ({"beta": 0.05}, FY, +1),  # air from the right pushes left
        ({"beta": 0.05}, MZ, -1),  # weathercock: nose to the right, into the wind
        ({"beta": 0.05}, MX, -1),  # dihedral: rolls left, away from the wind
        ({"w_B": (0.3, 0.0, 0.0)}, MX, -1),  # damping of all three rates
        ({"w_B": (0.0, 0.3, 0.0)}, MY, -1),
        ({"w_B": (0.0, 0.0, 0.3)}, MZ, -1),
        ({"w_B": (0.0, -0.3, 0.0)}, FZ, +1),  # pitching up, the tail's lift adds
    ],
)
def test_derivatives_push_to_the_right_side(change: dict[str, object], component: int, sign: int) -> None:
    difference = force_and_moment(**change) - force_and_moment()  # type: ignore[arg-type]
    assert sign * difference[component] > 100.0


def test_left_and_right_are_mirror_images() -> None:
    one = force_and_moment(beta=0.04, w_B=(0.2, 0.1, -0.1), surfaces=(-0.02, 0.1, -0.05))
    other = force_and_moment(beta=-0.04, w_B=(-0.2, 0.1, 0.1), surfaces=(-0.02, -0.1, 0.05))
    np.testing.assert_allclose(one, other * np.array([1, -1, 1, -1, 1, -1]), rtol=1e-12, atol=1e-8)


def test_derivatives_are_the_differences_of_the_force_function() -> None:
    """Nondimensional, forward-right-down, from central differences of the force in all eight arguments."""
    qbar_S = 0.5 * 0.66 * 180.0**2 * AIRFRAME.wing_area_m2
    b, c = AIRFRAME.span_m, AIRFRAME.chord_m
    to_coefficients = np.array([1.0, -1.0, -1.0, 1.0 / b, -1.0 / c, -1.0 / b]) / qbar_S
    h = 1e-4
    roll, pitch, yaw = 2.0 * 180.0 / b * h, -2.0 * 180.0 / c * h, -2.0 * 180.0 / b * h
    changes = [
        ({"alpha": 0.06 + h}, {"alpha": 0.06 - h}),
        ({"beta": h}, {"beta": -h}),
        ({"w_B": (roll, 0.0, 0.0)}, {"w_B": (-roll, 0.0, 0.0)}),
        ({"w_B": (0.0, pitch, 0.0)}, {"w_B": (0.0, -pitch, 0.0)}),
        ({"w_B": (0.0, 0.0, yaw)}, {"w_B": (0.0, 0.0, -yaw)}),
        ({"surfaces": (-0.04 + h, 0.0, 0.0)}, {"surfaces": (-0.04 - h, 0.0, 0.0)}),
        ({"surfaces": (-0.04, h, 0.0)}, {"surfaces": (-0.04, -h, 0.0)}),
        ({"surfaces": (-0.04, 0.0, h)}, {"surfaces": (-0.04, 0.0, -h)}),
    ]
    for column, (plus, minus) in enumerate(changes):
        slope = (force_and_moment(**plus) - force_and_moment(**minus)) / (2.0 * h)  # type: ignore[arg-type]
        np.testing.assert_allclose(slope * to_coefficients, MODEL.D[:, column], atol=1e-9, err_msg=str(column))


@pytest.mark.parametrize(("airspeed_m_s", "altitude_m"), FLIGHTS)
def test_linear_coefficients_stay_near_the_tables_within_three_degrees(airspeed_m_s: float, altitude_m: float) -> None:
    trim = level_trim(AIRFRAME, airspeed_m_s, standard_atmosphere(altitude_m))
    model = trim.aerodynamics
    for step in np.radians(np.linspace(-3.0, 3.0, 13)):
        linear = model.C_0 + model.D[:, 0] * step
        table = static_coefficients(AIRFRAME, trim.alpha_rad + step, trim.elevator_rad)
        np.testing.assert_allclose(linear, table, atol=0.01)
    np.testing.assert_array_equal(model.C_0, static_coefficients(AIRFRAME, trim.alpha_rad, trim.elevator_rad))


def test_moving_the_centre_of_gravity_moves_the_force_not_the_aircraft() -> None:
    """Moments about a centre of gravity further aft by d: M' = M + d e_x x F."""
    aft = load_parameters("airframe", AirframeParameters, {"centre_of_gravity": 0.35})
    d = (0.35 - AIRFRAME.centre_of_gravity) * AIRFRAME.chord_m
    change = {"alpha": 0.09, "beta": 0.03, "w_B": (0.2, -0.1, 0.1), "surfaces": (0.02, 0.1, -0.1)}
    ours = force_and_moment(linearise(aft, 0.06, -0.04, 0.66), **change)  # type: ignore[arg-type]
    before = force_and_moment(**change)  # type: ignore[arg-type]
    np.testing.assert_allclose(ours[:3], before[:3], rtol=1e-12)
    np.testing.assert_allclose(ours[3:], before[3:] + np.cross([d, 0.0, 0.0], before[:3]), rtol=1e-9)


def test_inertia_has_its_product_on_the_side_of_forward_left_up() -> None:
    """A positive Ixz (forward-right-down) is mass ahead and below: its product x z is negative with z up."""
    inertia = AIRFRAME.inertia_B
    assert inertia[0, 2] == inertia[2, 0] == 1331.0
    assert np.all(np.linalg.eigvalsh(inertia) > 0.0)
    np.testing.assert_array_equal(np.diag(inertia), [12875.0, 75674.0, 85552.0])


def test_thrust_range_is_the_tables_own_at_their_nodes() -> None:
    """Mach 0.6 at 20000 ft: idle -300 lbf, military 7090 lbf."""
    air = standard_atmosphere(6096.0)
    available = thrust_range(AIRFRAME, 0.6 * air.speed_of_sound_m_s, air)
    assert available.idle_n == pytest.approx(-300.0 * 4.4482216, abs=1.0)
    assert available.military_n == pytest.approx(7090.0 * 4.4482216, abs=1.0)
    assert available.throttle(available.military_n) == 1.0 and available.throttle(available.idle_n) == 0.0


@pytest.mark.parametrize(("airspeed_m_s", "altitude_m"), [(60.0, 6000.0), (0.0, 6000.0), (float("nan"), 6000.0)])
def test_airspeeds_without_level_flight_are_refused(airspeed_m_s: float, altitude_m: float) -> None:
    with pytest.raises(DockairError, match="airspeed_m_s: expected an airspeed"):
        level_trim(AIRFRAME, airspeed_m_s, standard_atmosphere(altitude_m))


def test_forces_turn_with_the_aircraft() -> None:
    """Body forces depend on the air relative to the body alone, whatever the attitude."""
    v_W, R_WB = np.array([180.0, 0.0, 0.0]), exp(np.array([0.0, -0.06, 0.0]))
    R = exp(np.array([0.3, -0.2, 0.9]))
    one = MODEL.force_and_moment(R_WB.T @ v_W, np.zeros(3), np.zeros(3))
    other = MODEL.force_and_moment((R @ R_WB).T @ (R @ v_W), np.zeros(3), np.zeros(3))
    np.testing.assert_allclose(one, other, rtol=1e-9, atol=1e-6)
