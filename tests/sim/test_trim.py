"""Steady flight of the receiver."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from dockair.errors import DockairError
from dockair.parameters import load_parameters
from dockair.rotations import exp
from dockair.sim.air.atmosphere import STANDARD_GRAVITY_M_S2, standard_atmosphere
from dockair.sim.aircraft.aerodynamics import AirframeParameters, flow_angles
from dockair.sim.aircraft.airframe import AirframeData
from dockair.sim.aircraft.derivatives import DerivativeAirframe
from dockair.sim.aircraft.engine import rotor_moment
from dockair.sim.aircraft.trim import level_trim, steady_trim

AIRFRAME = load_parameters("airframe", AirframeParameters)
BOTH = [AIRFRAME, load_parameters("airframe_unmanned", DerivativeAirframe)]
NAMES = ["fighter", "unmanned"]
G = STANDARD_GRAVITY_M_S2
PATHS: list[dict[str, float]] = [
    {},
    {"climb_rad": 0.05},
    {"climb_rad": -0.0524},
    {"downwash_m_s": 3.0},
    {"turn_rate_rad_s": 0.038},
    {"turn_rate_rad_s": -0.038, "climb_rad": -0.03, "downwash_m_s": 2.0},
]


@pytest.mark.parametrize("airframe", BOTH, ids=NAMES)
@pytest.mark.parametrize("path", PATHS, ids=str)
def test_a_body_left_in_its_trim_stays_in_it(airframe: AirframeData, path: dict[str, float]) -> None:
    """Newton and Euler in body axes, written down anew: velocity and rates are steady, and there is no side force."""
    trim = steady_trim(airframe, 120.0, standard_atmosphere(3000.0), **path)
    climb, turn, sink = (path.get(key, 0.0) for key in ("climb_rad", "turn_rate_rad_s", "downwash_m_s"))
    v_B = trim.R_WB.T @ (120.0 * np.array([np.cos(climb), 0.0, np.sin(climb)]))
    w_B = trim.R_WB.T @ [0.0, 0.0, turn]
    force, moment = trim.aerodynamics.force_and_moment(v_B + trim.R_WB.T @ [0.0, 0.0, sink], w_B, trim.surfaces_rad)
    weight = airframe.mass_kg * G
    assert abs(force[1]) < 1e-9 * weight
    force = force + [trim.thrust_n, 0.0, 0.0]
    dv = force / airframe.mass_kg + trim.R_WB.T @ [0.0, 0.0, -G] - np.cross(w_B, v_B)
    inertia = airframe.inertia_B
    dw = np.linalg.solve(inertia, moment + rotor_moment(airframe, w_B) - np.cross(w_B, inertia @ w_B))
    np.testing.assert_allclose(dv, 0.0, atol=1e-8)
    np.testing.assert_allclose(dw, 0.0, atol=1e-8)
    np.testing.assert_allclose(w_B, trim.w_WB_B, atol=1e-15)
    assert flow_angles(v_B + trim.R_WB.T @ [0.0, 0.0, sink])[1:] == pytest.approx((trim.alpha_rad, trim.sideslip_rad))
    assert trim.thrust_range.idle_n < trim.thrust_n < trim.thrust_range.military_n


@pytest.mark.parametrize("airframe", BOTH, ids=NAMES)
def test_trim_in_air_that_turns_about_the_wing_balances_with_that_air(airframe: AirframeData) -> None:
    """A downwash that grows forward: no moment with the turning air, one to be trimmed out without it."""
    air = np.array([0.0, 0.03, 0.0])
    trim = steady_trim(airframe, 120.0, standard_atmosphere(3000.0), downwash_m_s=3.0, pitching_air_rad_s=0.03)
    v_B = trim.R_WB.T @ [120.0, 0.0, 3.0]
    force, moment = trim.aerodynamics.force_and_moment(v_B, np.zeros(3), trim.surfaces_rad, air)
    force = trim.R_WB @ (force + [trim.thrust_n, 0.0, 0.0])
    np.testing.assert_allclose(force, [0.0, 0.0, airframe.mass_kg * G], atol=1e-6 * airframe.mass_kg * G)
    np.testing.assert_allclose(moment, 0.0, atol=1e-6 * airframe.mass_kg * G)
    _, without = trim.aerodynamics.force_and_moment(v_B, np.zeros(3), trim.surfaces_rad)
    assert abs(without[1]) > 1e-3 * airframe.mass_kg * G * airframe.chord_m


def test_straight_flight_is_symmetric_to_the_bit() -> None:
    trim = steady_trim(AIRFRAME, 180.0, standard_atmosphere(6000.0), climb_rad=0.02)
    assert trim.sideslip_rad == trim.aileron_rad == trim.rudder_rad == trim.bank_rad == 0.0
    assert not np.any(trim.R_WB[[0, 1, 1, 2], [1, 0, 2, 1]])


def test_level_trim_is_the_steady_one_without_climb_turn_or_downwash() -> None:
    one = level_trim(AIRFRAME, 180.0, standard_atmosphere(6000.0))
    other = steady_trim(AIRFRAME, 180.0, standard_atmosphere(6000.0), climb_rad=0.0, turn_rate_rad_s=0.0)
    assert (one.alpha_rad, one.thrust_n) == (other.alpha_rad, other.thrust_n)
    np.testing.assert_array_equal(one.R_WB, other.R_WB)
    assert one.pitch_rad == pytest.approx(one.alpha_rad, abs=1e-12)


def test_nose_is_up_by_the_angle_of_attack_and_more_so_when_slow() -> None:
    angles = []
    for airspeed_m_s in (120.0, 150.0, 180.0):
        trim = level_trim(AIRFRAME, airspeed_m_s, standard_atmosphere(3000.0))
        np.testing.assert_allclose(trim.R_WB[:, 0], [np.cos(trim.alpha_rad), 0.0, np.sin(trim.alpha_rad)], atol=1e-12)
        np.testing.assert_allclose(trim.R_WB[:, 1], [0.0, 1.0, 0.0], atol=1e-12)
        angles.append(trim.alpha_rad)
    assert angles[0] > angles[1] > angles[2] > 0.0
    # lift = weight with a linear slope: alpha less that of zero lift goes with 1/V^2, and the elevator's share is small
    slope = -(AIRFRAME.normal_force[3] - AIRFRAME.normal_force[2]) / np.deg2rad(5.0)
    pressure = 0.5 * standard_atmosphere(3000.0).density_kg_m3 * AIRFRAME.wing_area_m2 * slope
    expected = AIRFRAME.mass_kg * G / pressure * (120.0**-2 - 180.0**-2)
    assert angles[0] - angles[2] == pytest.approx(expected, rel=0.1)


@pytest.mark.parametrize("airframe", BOTH, ids=NAMES)
def test_climb_costs_the_weights_part_along_the_path_and_downwash_is_a_climb_through_the_air(
    airframe: AirframeData,
) -> None:
    """To first order, with the drag as before, thrust rises by m g gamma, and by m g d / V in air sinking at d."""
    air, weight = standard_atmosphere(3000.0), airframe.mass_kg * G
    level = level_trim(airframe, 150.0, air).thrust_n
    for slope in (0.004, -0.004):
        climbing = steady_trim(airframe, 150.0, air, climb_rad=slope).thrust_n
        assert climbing - level == pytest.approx(weight * slope, rel=0.01)
        sinking = steady_trim(airframe, 150.0, air, downwash_m_s=150.0 * slope)
        assert sinking.thrust_n - level == pytest.approx(weight * slope, rel=0.01)
        assert sinking.climb_rad == 0.0


@pytest.mark.parametrize("airframe", BOTH, ids=NAMES)
@pytest.mark.parametrize("sense", [1.0, -1.0])
def test_coordinated_turn_banks_into_the_turn_by_the_textbook_angle(airframe: AirframeData, sense: float) -> None:
    """tan(bank) = V r / g for level flight, but for the pitch attitude, whose cosine is within 1 %; left turn: left
    wing down, which is negative; it needs 1 / cos(bank) of the lift."""
    air, bank = standard_atmosphere(6000.0), np.radians(25.0)
    rate = G * np.tan(bank) / 180.0
    trim = steady_trim(airframe, 180.0, air, turn_rate_rad_s=sense * rate)
    assert trim.bank_rad == pytest.approx(-sense * bank, rel=0.01)
    assert np.sign(trim.R_WB[2, 1]) == -sense  # the left wing's height
    assert trim.w_WB_B == pytest.approx(sense * rate * trim.R_WB[2], abs=1e-12)
    level = level_trim(airframe, 180.0, air)
    assert trim.alpha_rad > level.alpha_rad and trim.thrust_n > level.thrust_n


def test_turns_to_either_side_are_mirror_images_without_the_rotor() -> None:
    """Of the airframe without derivatives that the tables do not print symmetrically."""
    airframe = load_parameters("airframe_unmanned", DerivativeAirframe, {"rotor_momentum_kg_m2_s": 0.0})
    left, right = (
        steady_trim(airframe, 120.0, standard_atmosphere(3000.0), turn_rate_rad_s=rate) for rate in (0.03, -0.03)
    )
    assert (left.alpha_rad, left.thrust_n) == pytest.approx((right.alpha_rad, right.thrust_n), rel=1e-9)
    lateral = [
        np.array([trim.sideslip_rad, trim.bank_rad, trim.aileron_rad, trim.rudder_rad]) for trim in (left, right)
    ]
    np.testing.assert_allclose(lateral[0], -lateral[1], atol=1e-12)


def test_path_is_along_the_level_axes_it_is_given_in() -> None:
    """The velocity's heading is zero, whatever the bank; the nose is not, in a turn."""
    trim = steady_trim(AIRFRAME, 180.0, standard_atmosphere(6000.0), turn_rate_rad_s=0.025, climb_rad=0.03)
    np.testing.assert_allclose(trim.velocity_W, 180.0 * np.array([np.cos(0.03), 0.0, np.sin(0.03)]), atol=1e-12)
    assert abs(trim.R_WB[1, 0]) > 0.01
    np.testing.assert_allclose(trim.R_WB @ trim.R_WB.T, np.eye(3), atol=1e-14)
    spun = exp(np.array([0.0, 0.0, 0.7])) @ trim.R_WB  # the same flight on another heading: the same air in the body
    np.testing.assert_allclose(spun.T @ exp(np.array([0.0, 0.0, 0.7])) @ trim.velocity_W, trim.R_WB.T @ trim.velocity_W)


@pytest.mark.parametrize("airspeed_m_s", [0.0, -5.0, 60.0, 340.0, float("nan")])
def test_airspeed_at_which_level_flight_is_impossible_is_refused(airspeed_m_s: float) -> None:
    with pytest.raises(DockairError, match="airspeed_m_s: expected an airspeed"):
        level_trim(AIRFRAME, airspeed_m_s, standard_atmosphere(12000.0))


@pytest.mark.parametrize(
    "path", [{"climb_rad": 0.5}, {"turn_rate_rad_s": 0.3}, {"climb_rad": -0.3}, {"downwash_m_s": 60.0}]
)
def test_path_beyond_the_engine_or_the_wing_is_refused_with_its_figures(path: dict[str, Any]) -> None:
    expected = f"slope of {path.get('climb_rad', 0.0):g} rad, turning at {path.get('turn_rate_rad_s', 0.0):g} rad/s"
    with pytest.raises(DockairError, match=expected):
        steady_trim(AIRFRAME, 180.0, standard_atmosphere(6000.0), **path)


def test_descent_that_needs_less_than_idle_thrust_is_refused_and_one_that_needs_a_little_more_is_flown() -> None:
    """To first order the thrust falls by the weight's part along the path; idle is 0.34 kN at 120 m/s and 3000 m."""
    unmanned, air = load_parameters("airframe_unmanned", DerivativeAirframe), standard_atmosphere(3000.0)
    level = level_trim(unmanned, 120.0, air)
    idle_n, weight = level.thrust_range.idle_n, unmanned.mass_kg * G
    slopes = [-(level.thrust_n - share * idle_n) / weight for share in (1.5, 0.5)]
    assert steady_trim(unmanned, 120.0, air, climb_rad=slopes[0]).thrust_n == pytest.approx(1.5 * idle_n, rel=0.1)
    with pytest.raises(DockairError, match="airspeed_m_s"):
        steady_trim(unmanned, 120.0, air, climb_rad=slopes[1])


@pytest.mark.parametrize(("last_mach", "flies"), [(0.58, True), (0.56, False)])
def test_trim_beyond_the_last_mach_number_of_the_engines_tables_is_refused(last_mach: float, flies: bool) -> None:
    """180 m/s at 6000 m are Mach 0.569; beyond their ends the tables would hold their last thrust."""
    mach = AIRFRAME.thrust_mach * last_mach / AIRFRAME.thrust_mach[-1]
    airframe, air = replace(AIRFRAME, thrust_mach=mach), standard_atmosphere(6000.0)
    if flies:
        assert level_trim(airframe, 180.0, air).airspeed_m_s == 180.0
        return
    with pytest.raises(DockairError, match="airspeed_m_s"):
        level_trim(airframe, 180.0, air)


def test_trim_beyond_the_derivatives_range_is_refused() -> None:
    """At 70 m/s and 3000 m the unmanned aircraft would need 0.75 of lift, inside; at 50 m/s 1.47, outside."""
    unmanned = load_parameters("airframe_unmanned", DerivativeAirframe)
    assert level_trim(unmanned, 70.0, standard_atmosphere(3000.0)).alpha_rad < np.radians(12.0)
    with pytest.raises(DockairError, match="airspeed_m_s"):
        level_trim(unmanned, 50.0, standard_atmosphere(3000.0))


def test_trim_beyond_the_elevators_stop_is_refused() -> None:
    """With the centre of gravity far forward, 100 m/s at 3000 m takes 8 degrees of elevator; these stops are at 6."""
    air, forward = standard_atmosphere(3000.0), {"centre_of_gravity": 0.25}
    trim = level_trim(load_parameters("airframe", AirframeParameters, forward), 100.0, air)
    assert -np.radians(9.0) < trim.elevator_rad < -0.11
    stopped = load_parameters("airframe", AirframeParameters, {**forward, "surface_limits_rad": [0.105, 0.3, 0.5]})
    with pytest.raises(DockairError, match="airspeed_m_s"):
        level_trim(stopped, 100.0, air)
