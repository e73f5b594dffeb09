"""The F-16-class airframe against the printed check, trims, turns and modes of the book that its tables come from.

[Stevens, Lewis & Johnson, Aircraft Control and Simulation, sections 3.5 to 3.8]. Everything here runs through our own
forward-left-up equations; the book's mass, air and gravity differ from ours by up to 0.04 %, and where they count they
are put in.
"""

from dataclasses import replace

import numpy as np
import pytest

from dockair.parameters import load_parameters
from dockair.rotations import exp
from dockair.sim.air.atmosphere import standard_atmosphere
from dockair.sim.aircraft.aerodynamics import AirframeParameters
from dockair.sim.aircraft.engine import rotor_moment
from dockair.sim.aircraft.linear_model import linear_model
from dockair.sim.aircraft.trim import Trim, level_trim, steady_trim

FOOT, SLUG, POUND_N = 0.3048, 14.593903, 4.4482216
FLIP = np.array([1.0, -1.0, -1.0])  # forward-right-down to forward-left-up
SEA_LEVEL = standard_atmosphere(0.0)
AIRSPEED = 502.0 * FOOT


def airframe(centre_of_gravity: float) -> AirframeParameters:
    return load_parameters("airframe", AirframeParameters, {"centre_of_gravity": centre_of_gravity})


def test_all_state_derivatives_of_the_printed_check_are_reproduced() -> None:
    """Table 3.5-2, a state off every node: 500 ft/s at 10000 ft, power 90, centre of gravity at 0.40 chord.

    With the book's mass, inertia and size, dynamic pressure 218.9 lb/ft^2 and thrust 15.14 klb worked out by hand from
    its formulas. Its moments use constants rounded to four digits and fewer, which bounds the agreement.
    """
    book = replace(
        load_parameters("airframe", AirframeParameters),
        centre_of_gravity=0.40,
        wing_area_m2=300.0 * FOOT**2,
        span_m=30.0 * FOOT,
        chord_m=11.32 * FOOT,
        inertia_kg_m2=np.array([9496.0, 55814.0, 63100.0, 982.0]) * SLUG * FOOT**2,
        rotor_momentum_kg_m2_s=160.0 * SLUG * FOOT**2,
    )
    alpha, beta, phi, theta, psi = 0.5, -0.2, -1.0, 1.0, -1.0
    v_ft = 500.0 * np.array([np.cos(alpha) * np.cos(beta), np.sin(beta), np.sin(alpha) * np.cos(beta)])
    v_B, w_B = FLIP * v_ft * FOOT, FLIP * [0.7, -0.8, 0.9]
    factor = 1.0 - 0.703e-5 * 10000.0
    density = 2.377e-3 * factor**4.14 * SLUG / FOOT**3
    mach = 500.0 / np.sqrt(1.4 * 1716.3 * 519.0 * factor)
    military, maximum = (a + (mach - 0.4) / 0.2 * (b - a) for a, b in ((9312.0, 9839.0), (16860.0, 18910.0)))
    thrust_n = (military + (maximum - military) * 0.8) * POUND_N
    force, moment = book.aerodynamics(density).force_and_moment(v_B, w_B, np.radians([20.0, -15.0, -20.0]))
    force[0] += thrust_n
    yaw, pitch, roll = (exp(axis) for axis in (FLIP * [0, 0, psi], FLIP * [0, theta, 0], FLIP * [phi, 0, 0]))
    gravity_B = (yaw @ pitch @ roll).T @ [0.0, 0.0, -32.17 * FOOT]
    dv = FLIP * (force / (SLUG / 1.57e-3) + gravity_B - np.cross(w_B, v_B)) / FOOT
    inertia = book.inertia_B
    dw = FLIP * np.linalg.solve(inertia, moment + rotor_moment(book, w_B) - np.cross(w_B, inertia @ w_B))
    speed_rate = v_ft @ dv / 500.0
    flat = v_ft[0] ** 2 + v_ft[2] ** 2
    alpha_rate = (v_ft[0] * dv[2] - v_ft[2] * dv[0]) / flat
    beta_rate = (500.0 * dv[1] - v_ft[1] * speed_rate) * np.cos(beta) / flat
    printed = [-75.23724, -0.8813491, -0.4759990]
    np.testing.assert_allclose([speed_rate, alpha_rate, beta_rate], printed, rtol=1e-5)
    np.testing.assert_allclose(dw, [12.62679, 0.9649671, 0.5809759], rtol=5e-4)


@pytest.mark.parametrize(
    ("centre_of_gravity", "alpha_rad", "elevator_deg", "throttle"),
    [(0.30, 0.03936, -1.931, 0.1485), (0.35, 0.03691, -0.7588, 0.1385), (0.38, 0.03544, -0.05590, 0.1325)],
)
def test_published_level_trims_are_reproduced(
    centre_of_gravity: float, alpha_rad: float, elevator_deg: float, throttle: float
) -> None:
    """502 ft/s at sea level [table 3.6-3]; the book's throttle is power over 64.94, idle to military is 50 of power."""
    trim = level_trim(airframe(centre_of_gravity), AIRSPEED, SEA_LEVEL)
    assert trim.alpha_rad == pytest.approx(alpha_rad, abs=5e-5)
    assert np.degrees(trim.elevator_rad) == pytest.approx(elevator_deg, abs=1e-3)
    assert trim.thrust_range.throttle(trim.thrust_n) * 50.0 / 64.94 == pytest.approx(throttle, abs=1e-4)


@pytest.mark.parametrize(
    ("airspeed_ft_s", "throttle", "alpha_deg", "elevator_deg"),
    [
        (150, 0.619, 34.6, 0.173),
        (200, 0.287, 19.7, 0.723),
        (300, 0.122, 8.49, -0.591),
        (400, 0.108, 4.16, -0.591),
        (500, 0.137, 2.14, -0.756),
        (600, 0.200, 1.04, -0.846),
        (800, 0.378, -0.045, -0.943),
    ],
)
def test_published_trims_from_slow_to_fast_are_reproduced(
    airspeed_ft_s: float, throttle: float, alpha_deg: float, elevator_deg: float
) -> None:
    """Table 3.6-2, printed to three digits, sea level, 0.35 chord."""
    trim = level_trim(airframe(0.35), airspeed_ft_s * FOOT, SEA_LEVEL)
    assert np.degrees(trim.alpha_rad) == pytest.approx(alpha_deg, rel=2e-3, abs=1e-2)
    assert np.degrees(trim.elevator_rad) == pytest.approx(elevator_deg, abs=5e-3 if airspeed_ft_s > 250 else 0.03)
    assert trim.thrust_range.throttle(trim.thrust_n) * 50.0 / 64.94 == pytest.approx(throttle, rel=3e-3, abs=1e-3)


def published_turn(centre_of_gravity: float) -> Trim:
    """0.3 rad/s to the right, 4.8 g; the book uses its afterburner, here the thrust range is doubled."""
    data = airframe(centre_of_gravity)
    data = replace(data, military_thrust_n=2.0 * data.military_thrust_n)
    return steady_trim(data, AIRSPEED, SEA_LEVEL, turn_rate_rad_s=-0.3)


@pytest.mark.parametrize(
    ("centre_of_gravity", "printed"),
    [
        (0.30, [0.2485, 4.8e-4, 1.367, 0.05185, -0.01555, 0.2934, 0.06071, -6.256, 0.09891, -0.4218]),
        (
            0.35,
            [0.2392628, 5.061803e-4, 1.366289, 0.05000808, -0.01499617, 0.2933811, 0.06084932]
            + [-1.481766, 0.09553108, -0.4118124],
        ),
    ],
)
def test_published_coordinated_turns_are_reproduced(centre_of_gravity: float, printed: list[float]) -> None:
    """Alpha, beta, bank, pitch, P, Q, R, elevator, aileron, rudder [table 3.6-3 and the example before it]."""
    trim = published_turn(centre_of_gravity)
    ours = [trim.alpha_rad, trim.sideslip_rad, trim.bank_rad, trim.pitch_rad, *(FLIP * trim.w_WB_B)]
    np.testing.assert_allclose([*ours, *np.degrees(trim.surfaces_rad)], printed, rtol=1.5e-3)


def test_published_modes_are_reproduced() -> None:
    """Examples 3.8-1 and 3.8-2, centre of gravity at 0.30 chord; printed to four digits, our mass is 0.04 % more.

    The phugoid's damping is that of a thrust that changes with airspeed and is left out here.
    """
    model = linear_model(airframe(0.30), level_trim(airframe(0.30), AIRSPEED, SEA_LEVEL))
    short, _, phugoid, _ = model.longitudinal_roots
    assert complex(short.real, abs(short.imag)) == pytest.approx(-1.2039 + 1.4922j, rel=1e-3)
    assert abs(phugoid.imag) == pytest.approx(0.0739, rel=0.01)
    roll, *dutch, spiral = model.lateral_roots
    assert roll == pytest.approx(-3.601, rel=1e-3)
    assert complex(dutch[0].real, abs(dutch[0].imag)) == pytest.approx(-0.4399 + 3.220j, rel=1e-3)
    assert spiral == pytest.approx(-0.0128, abs=5e-5)


def test_published_lateral_matrix_is_reproduced() -> None:
    """Example 3.8-2: beta, phi, p, r at 502 ft/s, 0.30 chord, from our states in level axes."""
    trim = level_trim(airframe(0.30), AIRSPEED, SEA_LEVEL)
    A = linear_model(airframe(0.30), trim).A
    # rows and columns of side velocity, roll, yaw angle, roll rate, yaw rate; at fixed yaw angle beta = -v_y / V
    printed = np.array(
        [
            [-0.32200, 0.064032, 0.038904, -0.99156],
            [0.0, 0.0, 1.0, 0.039385],
            [-30.919, 0.0, -3.6730, 0.67425],
            [9.4724, 0.0, -0.026358, -0.49849],
        ]
    )
    to_beta = -AIRSPEED
    assert A[6, 1] * to_beta == pytest.approx(printed[2, 0], rel=1e-3)
    assert -A[8, 1] * to_beta == pytest.approx(printed[3, 0], rel=1e-3)
    assert A[1, 1] == pytest.approx(printed[0, 0], rel=1e-3)
    np.testing.assert_allclose([A[6, 6], -A[6, 8], -A[8, 6], A[8, 8]], printed[2:, 2:].ravel(), rtol=2e-3)
