"""Receiver's aerodynamics from tables."""

import numpy as np
import pytest

from dockair.errors import DockairError
from dockair.parameters import load_parameters
from dockair.rotations import exp
from dockair.sim.aircraft.aerodynamics import AirframeParameters, TabulatedAerodynamics, flow_angles

AIRFRAME = load_parameters("airframe", AirframeParameters)
MODEL = AIRFRAME.aerodynamics(0.66)
STILL = np.zeros(3)
DEG = np.pi / 180.0


def force_and_moment(
    model: TabulatedAerodynamics = MODEL,
    *,
    alpha: float = 0.06,
    beta: float = 0.0,
    w_B: tuple[float, float, float] = (0.0, 0.0, 0.0),
    surfaces: tuple[float, float, float] = (-0.04, 0.0, 0.0),
    air_rotation_B: tuple[float, float, float] = (0.0, 0.0, 0.0),
) -> np.ndarray:
    """(6,) at 180 m/s; air from below for positive alpha, from the right for positive beta."""
    v_B = 180.0 * np.array([np.cos(alpha) * np.cos(beta), -np.sin(beta), -np.sin(alpha) * np.cos(beta)])
    force, moment = model.force_and_moment(v_B, np.array(w_B), np.array(surfaces), np.array(air_rotation_B))
    return np.concatenate([force, moment])


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
        ({"air_rotation_B": (0.3, 0.0, 0.0)}, MX, +1),  # air that rolls takes the aircraft along
        ({"air_rotation_B": (0.0, 0.3, 0.0)}, MY, +1),
        ({"air_rotation_B": (0.0, 0.0, 0.3)}, MZ, +1),
    ],
)
def test_derivatives_push_to_the_right_side(change: dict[str, object], component: int, sign: int) -> None:
    difference = force_and_moment(**change) - force_and_moment()  # type: ignore[arg-type]
    assert sign * difference[component] > 100.0


def test_only_the_rotation_relative_to_the_air_is_felt() -> None:
    one = force_and_moment(w_B=(0.2, -0.1, 0.3), air_rotation_B=(0.05, 0.1, -0.1))
    np.testing.assert_array_equal(one, force_and_moment(w_B=(0.2 - 0.05, -0.1 - 0.1, 0.3 + 0.1)))
    turning_along = force_and_moment(w_B=(0.05, 0.1, -0.1), air_rotation_B=(0.05, 0.1, -0.1))
    np.testing.assert_array_equal(turning_along, force_and_moment())
    v_B, w_B, surfaces = np.array([180.0, 0.0, -10.0]), np.array([0.1, 0.2, 0.3]), np.array([-0.04, 0.0, 0.0])
    for left, right in zip(
        MODEL.force_and_moment(v_B, w_B, surfaces), MODEL.force_and_moment(v_B, w_B, surfaces, STILL), strict=True
    ):
        np.testing.assert_array_equal(left, right)


def test_motions_in_rows_make_the_wrenches_that_each_alone_makes() -> None:
    """To the bit: flying forward, sideways and turning, in air that turns, each row on its own."""
    motions = np.random.default_rng(7).normal(size=(4, 12)) * np.repeat([20.0, 0.3, 0.2, 0.1], 3)
    motions[:, 0] += 180.0
    wrenches = np.empty((4, 6))
    MODEL.write_wrenches(motions, wrenches)
    for motion, wrench in zip(motions, wrenches, strict=True):
        np.testing.assert_array_equal(wrench, np.concatenate(MODEL.force_and_moment(*np.split(motion, 4))))


def test_left_and_right_are_mirror_images_where_the_tables_are() -> None:
    """Static tables are odd in sideslip; those of the surfaces are not printed as mirror images."""
    one = force_and_moment(beta=0.14, w_B=(0.2, 0.1, -0.1))
    other = force_and_moment(beta=-0.14, w_B=(-0.2, 0.1, 0.1))
    np.testing.assert_allclose(one, other * np.array([1, -1, 1, -1, 1, -1]), rtol=1e-12, atol=1e-8)
    one = force_and_moment(surfaces=(-0.02, 0.1, -0.05))
    other = force_and_moment(surfaces=(-0.02, -0.1, 0.05))
    np.testing.assert_allclose(one, other * np.array([1, -1, 1, -1, 1, -1]), rtol=1e-12, atol=1e-8)


def coefficients(
    alpha_deg: float, beta_deg: float = 0.0, surfaces_deg: tuple[float, float, float] = (0.0, 0.0, 0.0)
) -> np.ndarray:
    """(6,) without rates, about the tables' own reference."""
    airframe = load_parameters("airframe", AirframeParameters, {"centre_of_gravity": 0.35})
    model = airframe.aerodynamics(1.0)
    return model.coefficients(alpha_deg * DEG, beta_deg * DEG, STILL, np.array(surfaces_deg) * DEG)


@pytest.mark.parametrize("column", [0, 2, 7, 10])
def test_at_their_nodes_the_tables_are_met(column: int) -> None:
    alpha = -10.0 + 5.0 * column
    p = AIRFRAME
    for row, elevator in enumerate((-24.0, -12.0, 0.0, 12.0, 24.0)):
        CX, _, CZ, _, Cm, _ = coefficients(alpha, 0.0, (elevator, 0.0, 0.0))
        assert p.axial_force[row, column] == pytest.approx(CX, abs=1e-8)
        assert p.pitching_moment[row, column] == pytest.approx(Cm, abs=1e-8)
        assert p.normal_force[column] - 0.19 / 25.0 * elevator == pytest.approx(CZ, abs=1e-8)
    for row, beta in enumerate(range(0, 31, 5)):
        C = coefficients(alpha, beta)
        assert (C[3], C[5]) == pytest.approx((p.rolling_moment[row, column], p.yawing_moment[row, column]), abs=1e-8)
    for row, beta in enumerate(range(-30, 31, 10)):
        still = coefficients(alpha, beta)
        aileron, rudder = coefficients(alpha, beta, (0.0, 20.0, 0.0)), coefficients(alpha, beta, (0.0, 0.0, 30.0))
        assert aileron[3] - still[3] == pytest.approx(p.rolling_moment_aileron[row, column], abs=1e-8)
        assert aileron[5] - still[5] == pytest.approx(p.yawing_moment_aileron[row, column], abs=1e-8)
        assert rudder[3] - still[3] == pytest.approx(p.rolling_moment_rudder[row, column], abs=1e-8)
        assert rudder[5] - still[5] == pytest.approx(p.yawing_moment_rudder[row, column], abs=1e-8)
        assert (aileron - still)[1] == pytest.approx(0.021, abs=1e-8)
        assert (rudder - still)[1] == pytest.approx(0.086, abs=1e-8)


def test_between_nodes_the_tables_are_bilinear() -> None:
    """A quarter along one argument and three quarters along the other, by hand."""
    p = AIRFRAME
    CX, _, _, _, Cm, _ = coefficients(6.25, 0.0, (9.0, 0.0, 0.0))  # columns 5 and 10 deg, rows 0 and 12 deg
    for table, ours in ((p.axial_force, CX), (p.pitching_moment, Cm)):
        low, high = 0.75 * table[2, 3] + 0.25 * table[2, 4], 0.75 * table[3, 3] + 0.25 * table[3, 4]
        assert ours == pytest.approx(0.25 * low + 0.75 * high, abs=1e-8)
    C = coefficients(6.25, -8.75)  # rows 5 and 10 deg, odd
    for table, ours in ((p.rolling_moment, C[3]), (p.yawing_moment, C[5])):
        low, high = 0.75 * table[1, 3] + 0.25 * table[1, 4], 0.75 * table[2, 3] + 0.25 * table[2, 4]
        assert ours == pytest.approx(-(0.25 * low + 0.75 * high), abs=1e-8)


def test_beyond_the_tables_angles_hold_and_the_elevators_last_cell_goes_on() -> None:
    for inside, outside in (
        ((-10.0, 0.0), (-25.0, 0.0)),
        ((45.0, 0.0), (80.0, 0.0)),
        ((5.0, 30.0), (5.0, 50.0)),
        ((5.0, -30.0), (5.0, -50.0)),
    ):
        np.testing.assert_allclose(coefficients(*inside), coefficients(*outside), atol=1e-9)
    slope = coefficients(5.0, 0.0, (24.0, 0.0, 0.0)) - coefficients(5.0, 0.0, (23.0, 0.0, 0.0))
    beyond = coefficients(5.0, 0.0, (25.0, 0.0, 0.0)) - coefficients(5.0, 0.0, (24.0, 0.0, 0.0))
    np.testing.assert_allclose(beyond, slope, atol=1e-9)
    assert slope[4] < -1e-3


def test_damping_is_the_derivative_after_the_rates_at_the_angle_of_attack() -> None:
    """From the force function, at a node and between two, of every row of the table."""
    p = load_parameters("airframe", AirframeParameters, {"centre_of_gravity": 0.35})
    model = p.aerodynamics(0.66)
    qbar_S = 0.5 * 0.66 * 180.0**2 * p.wing_area_m2
    b, c = p.span_m, p.chord_m
    to_coefficients = np.array([1.0, -1.0, -1.0, 1.0 / b, -1.0 / c, -1.0 / b]) / qbar_S
    for alpha_deg, weights in ((10.0, {4: 1.0}), (12.0, {4: 0.6, 5: 0.4})):
        table = p.damping[:, list(weights)] @ np.array(list(weights.values()))
        CXq, CYr, CYp, CZq, Clr, Clp, Cmq, Cnr, Cnp = table
        expected = np.array([[0, CYp, 0, Clp, 0, Cnp], [CXq, 0, CZq, 0, Cmq, 0], [0, CYr, 0, Clr, 0, Cnr]])
        still = force_and_moment(model, alpha=alpha_deg * DEG)
        for axis, per in ((0, 2 * 180.0 / b), (1, -2 * 180.0 / c), (2, -2 * 180.0 / b)):
            x, y, z = 0.01 * per * np.eye(3)[axis]
            moved = force_and_moment(model, alpha=alpha_deg * DEG, w_B=(x, y, z))
            np.testing.assert_allclose((moved - still) * to_coefficients / 0.01, expected[axis], atol=1e-9)


def test_force_goes_with_density_and_the_square_of_the_speed() -> None:
    v_B, surfaces = np.array([180.0, -3.0, -11.0]), np.array([-0.04, 0.02, 0.01])
    one = np.concatenate(MODEL.force_and_moment(v_B, STILL, surfaces))
    twice = np.concatenate(AIRFRAME.aerodynamics(2.0 * 0.66).force_and_moment(v_B, STILL, surfaces))
    faster = np.concatenate(MODEL.force_and_moment(1.5 * v_B, STILL, surfaces))
    np.testing.assert_allclose(twice, 2.0 * one, rtol=1e-12)
    np.testing.assert_allclose(faster, 2.25 * one, rtol=1e-12)


def test_moving_the_centre_of_gravity_moves_the_force_not_the_aircraft() -> None:
    """Moments about a centre of gravity further aft by d: M' = M + d e_x x F."""
    aft = load_parameters("airframe", AirframeParameters, {"centre_of_gravity": 0.35})
    d = (0.35 - AIRFRAME.centre_of_gravity) * AIRFRAME.chord_m
    change = {"alpha": 0.09, "beta": 0.03, "surfaces": (0.02, 0.1, -0.1)}
    ours = force_and_moment(aft.aerodynamics(0.66), **change)  # type: ignore[arg-type]
    before = force_and_moment(**change)  # type: ignore[arg-type]
    np.testing.assert_allclose(ours[:3], before[:3], rtol=1e-12)
    np.testing.assert_allclose(ours[3:], before[3:] + np.cross([d, 0.0, 0.0], before[:3]), rtol=1e-9)


def test_inertia_has_its_product_on_the_side_of_forward_left_up() -> None:
    """A positive Ixz (forward-right-down) is mass ahead and below: its product x z is negative with z up."""
    inertia = AIRFRAME.inertia_B
    assert inertia[0, 2] == inertia[2, 0] == 1331.0
    assert np.all(np.linalg.eigvalsh(inertia) > 0.0)
    np.testing.assert_array_equal(np.diag(inertia), [12875.0, 75674.0, 85552.0])


def test_forces_turn_with_the_aircraft() -> None:
    """Body forces depend on the air relative to the body alone, whatever the attitude."""
    v_W, R_WB = np.array([180.0, 0.0, 0.0]), exp(np.array([0.0, -0.06, 0.0]))
    R = exp(np.array([0.3, -0.2, 0.9]))
    one = MODEL.force_and_moment(R_WB.T @ v_W, STILL, STILL)
    other = MODEL.force_and_moment((R @ R_WB).T @ (R @ v_W), STILL, STILL)
    np.testing.assert_allclose(one, other, rtol=1e-9, atol=1e-6)


def test_at_rest_there_is_no_force_and_no_division_by_the_airspeed() -> None:
    force, moment = MODEL.force_and_moment(STILL, np.array([0.1, 0.2, 0.3]), STILL)
    np.testing.assert_array_equal(force, 0.0)
    np.testing.assert_array_equal(moment, 0.0)


def test_uneven_nodes_are_refused_by_their_key() -> None:
    nodes = np.array(AIRFRAME.angle_of_attack_rad)
    nodes[3] += 0.01
    airframe = load_parameters("airframe", AirframeParameters, {"angle_of_attack_rad": nodes.tolist()})
    with pytest.raises(DockairError, match=r"airframe\.angle_of_attack_rad: expected evenly spaced"):
        airframe.aerodynamics(1.0)


@pytest.mark.parametrize(
    ("key", "value"),
    [
        ("inertia_kg_m2", [12875.0, 75674.0, 190000.0, 1331.0]),  # more about z than about x and y together
        ("inertia_kg_m2", [0.0, 75674.0, 75674.0, 0.0]),
        ("inertia_kg_m2", [12875.0, 75674.0, 85552.0, 50000.0]),
        ("thrust_mach", [0.0, 0.2, 0.4, 0.4, 0.8, 1.0]),
        ("thrust_altitude_m", [0.0, 3048.0, 3048.0, 9144.0, 12192.0, 15240.0]),
    ],
)
def test_values_that_no_aircraft_can_have_together_are_refused_by_their_key(key: str, value: list[float]) -> None:
    with pytest.raises(DockairError, match=f"airframe.{key}: expected"):
        load_parameters("airframe", AirframeParameters, {key: value})
