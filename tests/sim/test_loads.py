"""Air loads on hose and drogue."""

from dataclasses import replace

import numpy as np
import pytest

from dockair.parameters import load_parameters
from dockair.rotations import exp
from dockair.sim.hose.chain import DrogueParameters, HoseParameters
from dockair.sim.hose.loads import drogue_force, hose_load_per_length, load_coefficients, tow_loads, write_tow_loads

HOSE = load_parameters("hose", HoseParameters)
DROGUE = load_parameters("drogue", DrogueParameters)
DENSITY, VISCOSITY = 0.66, 2.4e-5
K = load_coefficients(HOSE, DROGUE, DENSITY, VISCOSITY)
DIAMETER = 2.0 * HOSE.radius_m


def _tow(rng, links=3):
    """A crooked tow in motion: axes, velocities, angular velocities, air."""
    R = np.array([exp(0.3 * rng.normal(size=3)) for _ in range(links + 1)])
    v, w = (rng.normal(size=(links + 1, 3)) for _ in range(2))
    air = np.array([-180.0, 0.0, 0.0]) + 5.0 * rng.normal(size=(links + 1, 3))
    return R, 10.0 * v, w, air


def test_critical_angle_of_a_heavy_towed_cable():
    """A long cable without drogue trails straight where gravity balances the drag across it.

    Per metre, across the cable: w cos(theta) = 1/2 rho d C_n V^2 sin^2(theta), theta from the stream. Hence
    cos(theta) = -k + sqrt(k^2 + 1), k = w / (rho d C_n V^2).
    """
    speed, weight = 40.0, 9.80665 * HOSE.line_density_kg_m  # slow, so that the angle is large
    k = weight / (DENSITY * DIAMETER * HOSE.normal_drag_coefficient * speed**2)
    cos_theta = -k + np.sqrt(k**2 + 1.0)
    sin_theta = np.sqrt(1.0 - cos_theta**2)
    t_W = np.array([cos_theta, 0.0, sin_theta])  # toward the tanker: forward and up
    across = np.array([-sin_theta, 0.0, cos_theta])
    load = hose_load_per_length(t_W, np.array([-speed, 0.0, 0.0]), K)
    assert (load - np.array([0.0, 0.0, weight])) @ across == pytest.approx(0.0, abs=1e-9 * weight)


def test_hose_along_the_stream_feels_the_friction_law_of_its_flat_plate_and_nothing_across():
    """At a small angle a: Re_f = pi d V / (2 nu sin a), C_f = 0.0464 Re_f^(-1/6), on pi d per metre."""
    speed, angle = 180.0, 1e-3
    t_W = np.array([np.cos(angle), 0.0, np.sin(angle)])
    reynolds = np.pi * DIAMETER * speed / (2.0 * VISCOSITY * np.sin(angle))
    friction = 0.5 * DENSITY * HOSE.friction_coefficient * reynolds ** (-1 / 6) * np.pi * DIAMETER * speed**2
    load = hose_load_per_length(t_W, np.array([-speed, 0.0, 0.0]), K)
    assert -load @ t_W == pytest.approx(friction * np.cos(angle) ** 2, rel=1e-12)
    exactly_along = hose_load_per_length(np.array([1.0, 0.0, 0.0]), np.array([-speed, 0.0, 0.0]), K)
    np.testing.assert_array_equal(exactly_along[1:], 0.0)


def test_reynolds_number_is_that_of_the_normal_velocity():
    """At 120 m/s and 3000 m the total speed is at the drag crisis, the normal one far below: C_n must be 1.2."""
    k = load_coefficients(HOSE, DROGUE, 0.909, 1.863e-5)
    angle, speed = np.deg2rad(14.0), 120.0
    assert speed * DIAMETER / 1.863e-5 > HOSE.crisis_reynolds
    t_W = np.array([np.cos(angle), 0.0, np.sin(angle)])
    load = hose_load_per_length(t_W, np.array([-speed, 0.0, 0.0]), k)
    normal = 0.5 * 0.909 * HOSE.normal_drag_coefficient * DIAMETER * (speed * np.sin(angle)) ** 2
    assert load @ np.array([-np.sin(angle), 0.0, np.cos(angle)]) == pytest.approx(normal, rel=1e-12)


def test_drag_crisis_is_passed_without_a_jump():
    reynolds = np.linspace(0.3, 2.0, 2000) * HOSE.crisis_reynolds
    across = reynolds * VISCOSITY / DIAMETER
    force = np.array([-hose_load_per_length(np.array([1.0, 0, 0]), np.array([0, 0, -u]), K)[2] for u in across])
    coefficient = force / (0.5 * DENSITY * DIAMETER * across**2)
    assert coefficient[0] == pytest.approx(HOSE.normal_drag_coefficient)
    assert coefficient[-1] == pytest.approx(HOSE.supercritical_drag_coefficient)
    assert np.abs(np.diff(coefficient)).max() < 0.01
    assert np.all(np.diff(coefficient) <= 1e-12)


def test_drag_crisis_lies_about_the_sheets_reynolds_number_as_wide_either_way_as_the_sheet_says():
    """From R_c / ratio to R_c ratio, half of the fall at R_c, and in log Re as much is left as has been lost before."""
    middle, ratio, e = HOSE.crisis_reynolds, HOSE.crisis_width_ratio, np.array([1.0, 0.0, 0.0])

    def fallen(reynolds):
        """Share of the fall of C_n across the stream."""
        u = reynolds * VISCOSITY / DIAMETER
        c_n = -hose_load_per_length(e, np.array([0.0, 0.0, -u]), K)[2] / (0.5 * DENSITY * DIAMETER * u**2)
        low, high = HOSE.normal_drag_coefficient, HOSE.supercritical_drag_coefficient
        return (low - c_n) / (low - high)

    assert fallen(0.999 * middle / ratio) == pytest.approx(0.0, abs=1e-12) and fallen(1.02 * middle / ratio) > 1e-4
    assert fallen(1.001 * middle * ratio) == pytest.approx(1.0, abs=1e-12) and fallen(0.98 * middle * ratio) < 0.9999
    assert fallen(middle) == pytest.approx(0.5, abs=1e-12)
    for part in (0.2, 0.5, 0.8):
        assert fallen(middle * ratio**part) + fallen(middle * ratio**-part) == pytest.approx(1.0, abs=1e-12)


def test_air_at_rest_never_feeds_energy_into_the_tow():
    rng = np.random.default_rng(7)
    for _ in range(300):
        R, v, w, air = _tow(rng)
        wrench = tow_loads(R, v, w, 0.0 * air, rng.uniform(0.0, 2.0), K)
        assert np.sum(wrench[:, :3] * v) + np.sum(wrench[:, 3:] * w) <= 0.0


def test_loads_depend_on_the_relative_velocity_only():
    R, v, w, air = _tow(np.random.default_rng(8))
    drift = np.array([30.0, -20.0, 10.0])
    np.testing.assert_allclose(
        tow_loads(R, v, w, air, 0.4, K),
        tow_loads(R, v + drift, w, air + drift, 0.4, K),
        rtol=1e-9,
        atol=1e-9,
    )


def test_loads_of_what_mujoco_knows_are_those_of_the_bodies_velocities_in_wind_and_gusts():
    """Velocities given at a far point: v = v_0 + w x (x - x_0). What the arrays held before does not matter."""
    rng = np.random.default_rng(10)
    R, v, w, _ = _tow(rng)
    position, reference, wind = 9.0 * rng.normal(size=(4, 3)), np.array([3.0, -4.0, 5.0]), np.array([-180.0, 3.0, -2.0])
    gusts, rates, wrench = rng.normal(size=(4, 3)), np.full((3, 4, 3), 7.0), np.full((4, 6), 7.0)
    spatial = np.hstack([w, v - np.cross(w, position - reference)])
    write_tow_loads(position, R, spatial, reference, wind, gusts, 0.4, K, rates, wrench)
    np.testing.assert_allclose(rates, [v, w, wind + gusts], rtol=1e-12, atol=1e-12)
    np.testing.assert_allclose(wrench, tow_loads(R, v, w, wind + gusts, 0.4, K), rtol=1e-9, atol=1e-9)


def test_loads_turn_with_the_scene():
    R, v, w, air = _tow(np.random.default_rng(9))
    Q = exp(np.array([0.0, 0.0, 1.1]))
    turned = tow_loads(Q @ R, v @ Q.T, w @ Q.T, air @ Q.T, 0.4, K)
    wrench = tow_loads(R, v, w, air, 0.4, K)
    np.testing.assert_allclose(turned, np.hstack([wrench[:, :3] @ Q.T, wrench[:, 3:] @ Q.T]), rtol=1e-9, atol=1e-9)


def test_link_that_is_half_in_the_pod_bears_half_the_load_a_quarter_of_its_length_behind_its_middle():
    R = np.array([exp(np.array([0.0, -0.2, 0.0]))] * 2)
    v = w = np.zeros((2, 3))
    air = np.array([[-180.0, 0.0, 0.0]] * 2)
    length = HOSE.link_length_m
    free = tow_loads(R, v, w, air, 0.0, K)[0]
    half = tow_loads(R, v, w, air, 0.5 * length, K)[0]
    np.testing.assert_allclose(free[3:], 0.0, atol=1e-9)
    np.testing.assert_allclose(half[:3], 0.5 * free[:3], rtol=1e-12)
    np.testing.assert_allclose(half[3:], np.cross(-0.25 * length * R[0, :, 0], half[:3]), rtol=1e-9, atol=1e-9)
    np.testing.assert_array_equal(tow_loads(R, v, w, air, length, K)[0], 0.0)


def _incidence(angle_rad, speed=170.0):
    """Axis and relative air of a drogue whose axis is turned up from the stream by an angle."""
    return np.array([np.cos(angle_rad), 0.0, np.sin(angle_rad)]), np.array([-speed, 0.0, 0.0])


def test_drogue_along_the_stream_has_the_sheets_drag_on_its_disc():
    t, u = _incidence(0.0)
    drag = 0.5 * DENSITY * 0.8 * np.pi * 0.25 * 0.5**2 * 170.0**2
    np.testing.assert_allclose(drogue_force(t, u, K), [-drag, 0.0, 0.0], rtol=1e-12)


def test_drogue_across_the_stream_has_the_canopys_side_force_on_its_fabric():
    t, u = _incidence(0.5 * np.pi)
    side = 0.5 * DENSITY * DROGUE.canopy_side_coefficient * DROGUE.canopy_area_m2 * 170.0**2
    np.testing.assert_allclose(drogue_force(t, u, K), [-side, 0.0, 0.0], rtol=1e-12, atol=1e-9)


@pytest.mark.parametrize(("ratio", "sign"), [(0.7, -1.0), (1.3, 1.0)])
def test_drogues_lift_and_drag_at_incidence_are_those_of_its_two_coefficients(ratio, sign):
    """C_D' = C_D cos^2 a + C_s sin^2 a, C_L = (C_s - C_D) sin a cos a: negative for a canopy that is weak sideways."""
    side = ratio * DROGUE.drag_coefficient / DROGUE.canopy_area_ratio
    drogue = replace(DROGUE, canopy_side_coefficient=side)
    k = load_coefficients(HOSE, drogue, DENSITY, VISCOSITY)
    angle = np.deg2rad(25.0)
    t, u = _incidence(angle)
    pressure_area = 0.5 * DENSITY * 170.0**2 * drogue.drag_area_m2 * drogue.drag_coefficient
    drag = pressure_area * (np.cos(angle) ** 2 + ratio * np.sin(angle) ** 2)
    lift = pressure_area * (ratio - 1.0) * np.sin(angle) * np.cos(angle)
    assert lift * sign > 0.0
    np.testing.assert_allclose(drogue_force(t, u, k), [-drag, 0.0, lift], rtol=1e-12, atol=1e-9)


def test_drogue_of_the_sheet_has_no_lift_at_any_incidence():
    """Its side coefficient is the middle of two strip theories, where side and axial force change alike."""
    for angle in (0.05, 0.4, 1.2):
        force = drogue_force(*_incidence(angle), K)
        assert np.abs(force[1:]).max() < 1e-9 * -force[0]


def test_drogues_force_has_no_corner_at_any_incidence_not_even_across_or_from_behind():
    """The second difference of a smooth function falls with the square of the step: a corner's falls with the first."""
    k = load_coefficients(HOSE, replace(DROGUE, canopy_side_coefficient=0.3), DENSITY, VISCOSITY)

    def second(step):
        angles = np.arange(-np.pi, np.pi, step)
        force = np.array([drogue_force(*_incidence(angle), k) for angle in angles])
        return np.abs(np.diff(force, 2, axis=0)).max()

    assert second(0.02) / second(0.01) == pytest.approx(4.0, rel=0.02)


def test_hoses_load_has_no_corner_at_the_ends_of_the_drag_crisis():
    across = np.linspace(0.5, 1.9, 20001) * HOSE.crisis_reynolds * VISCOSITY / DIAMETER
    force = np.array([hose_load_per_length(np.array([1.0, 0, 0]), np.array([0, 0, -u]), K)[2] for u in across])
    slope = np.diff(force) / np.diff(across)
    assert np.abs(np.diff(slope)).max() < 2e-3 * np.ptp(slope)


@pytest.mark.parametrize("axis", [1, 2])
def test_drogue_turns_into_the_wind_and_its_turning_is_damped(axis):
    v = np.zeros((2, 3))
    air = np.array([[-180.0, 0.0, 0.0]] * 2)
    tilt = np.zeros(3)
    tilt[axis] = 0.1
    R = np.array([np.eye(3), exp(tilt)])
    moment = tow_loads(R, v, np.zeros((2, 3)), air, 0.0, K)[1, 3 + axis]
    assert moment < 0.0
    w = np.zeros((2, 3))
    w[1, axis] = 1.0
    assert tow_loads(np.array([np.eye(3)] * 2), v, w, air, 0.0, K)[1, 3 + axis] < 0.0


def test_link_that_turns_about_its_middle_is_damped_as_two_gauss_points_say():
    """Still air: at +-L/(2 sqrt 3) half the link moves across the air with w L/(2 sqrt 3); exact would be L^4/32."""
    w, length = 2.0, HOSE.link_length_m
    arm = length / (2.0 * np.sqrt(3.0))
    zero = np.zeros((2, 3))
    wrench = tow_loads(np.array([np.eye(3)] * 2), zero, np.array([[0.0, w, 0.0], [0.0] * 3]), zero, 0.0, K)[0]
    per_metre = 0.5 * DENSITY * HOSE.normal_drag_coefficient * DIAMETER * (w * arm) ** 2
    np.testing.assert_allclose(wrench[:3], 0.0, atol=1e-12)
    np.testing.assert_allclose(wrench[3:], [0.0, -length * per_metre * arm, 0.0], rtol=1e-9, atol=1e-12)


def test_drogues_weathercock_moment_and_damping_are_the_closed_forms():
    """About the mass centre: D a sin(tilt) of the drag a behind it; (1/2 rho V)(S d^2 C_q + 2 S C_D a^2) a rate.

    The second part of the damping is the change of the drag's direction: the canopy moves across with w a, and the
    force across is D w a / V, of arm a.
    """
    speed, tilt, rate = 180.0, 1e-4, 1e-3
    arm = DROGUE.centre_of_mass_x_m - DROGUE.drag_centre_x_m
    area, d = 0.25 * np.pi * DROGUE.drag_diameter_m**2, DROGUE.drag_diameter_m
    drag = 0.5 * DENSITY * area * DROGUE.drag_coefficient * speed**2
    zero, air = np.zeros((2, 3)), np.array([[-speed, 0.0, 0.0]] * 2)
    R = np.array([np.eye(3), exp(np.array([0.0, tilt, 0.0]))])
    assert tow_loads(R, zero, zero, air, 0.0, K)[1, 4] == pytest.approx(-drag * arm * tilt, rel=1e-6)
    w = np.array([[0.0] * 3, [0.0, rate, 0.0]])
    moment = tow_loads(np.array([np.eye(3)] * 2), zero, w, air, 0.0, K)[1, 4]
    of_rate = 0.5 * DENSITY * speed * area * d**2 * DROGUE.rate_damping_coefficient
    assert moment == pytest.approx(-(of_rate + drag * arm**2 / speed) * rate, rel=1e-6)


def test_drogues_swing_about_the_hoses_end_is_damped_by_the_ratio_that_its_sheet_says():
    """Linear: I w' = -(D x_d + weight's part) tilt - (loads' and hinge's damping) w, about the hose's end at rest."""
    speed, tilt, rate = 180.0, 1e-4, 1e-3
    to_mass = DROGUE.hose_joint_x_m - DROGUE.centre_of_mass_x_m

    def moment(tilt_rad, rate_rad_s):
        """About the hose's end, which stands still, without weight."""
        R = np.array([np.eye(3), exp(np.array([0.0, tilt_rad, 0.0]))])
        arm = -to_mass * R[1, :, 0]
        w = np.array([[0.0] * 3, [0.0, rate_rad_s, 0.0]])
        v = np.array([np.zeros(3), np.cross(w[1], arm)])
        load = tow_loads(R, v, w, np.array([[-speed, 0.0, 0.0]] * 2), 0.0, K)[1]
        return load[4] + np.cross(arm, load[:3])[1] - DROGUE.hinge_damping_n_m_s * rate_rad_s

    inertia = DROGUE.inertia_kg_m2[1] + DROGUE.mass_kg * to_mass**2
    stiffness, damping = -moment(tilt, 0.0) / tilt, -moment(0.0, rate) / rate
    ratio = damping / (2.0 * np.sqrt(stiffness * inertia))
    assert ratio == pytest.approx(0.15, abs=0.04)
