"""What the navigation is told of the start: the attitude without gusts, and nothing of this very flight."""

from dataclasses import replace

import numpy as np
import pytest

from dockair.parameters import load_parameters
from dockair.rotations import log, matrix_from_yaw_pitch_roll
from dockair.scenarios.assembly import parts as build_module
from dockair.scenarios.assembly.nominal_sheets import _gyro_sheet, nominal_attitude
from dockair.scenarios.assembly.parts import build
from dockair.scenarios.schema import load_scenario
from dockair.sim.air.atmosphere import standard_atmosphere
from dockair.sim.aircraft.aerodynamics import AirframeParameters
from dockair.sim.aircraft.trim import level_trim
from dockair.sim.hose.chain import DrogueParameters, HoseParameters
from dockair.sim.hose.rest import rest_shape
from dockair.sim.imu import ImuParameters

QUIET = {"navigation.navigator": "truth", "start.sigma_m": [0.0, 0.0, 0.0], "bow_wave.present": False}


def still_air(**keys):
    return load_scenario("still_air", QUIET | {key.replace("__", "."): value for key, value in keys.items()})


def attitude(**keys):
    """(3, 3) R_BD of the sheets, and that of the world which was made with them, settled in the wake."""
    parts = build(still_air(**keys), 0)
    truth = parts.world.truth
    return parts.sheets.start.R_BD, truth.R_WB.T @ truth.R_WD


@pytest.mark.slow
@pytest.mark.parametrize(
    ("keys", "within_deg"),
    [
        ({}, 0.1),
        ({"tanker__pod": "left_wing"}, 0.4),
        ({"hardware__airframe": "unmanned", "flight__airspeed_m_s": 120.0, "flight__altitude_m": 3000.0}, 0.2),
    ],
    ids=["centreline", "left wing", "unmanned"],
)
def test_the_nominal_attitude_is_that_of_a_start_in_the_wake_without_gusts(keys, within_deg):
    """Under the wing the air turns about the path besides, and so does a drogue that is told without roll."""
    told, true = attitude(**keys)
    assert np.degrees(np.linalg.norm(log(true @ told.T))) < within_deg


@pytest.mark.parametrize("grade", ["tactical", "mti", "consumer"])
def test_the_data_sheet_that_is_told_is_the_imus_with_scale_and_misalignment_in_one(grade):
    imu = load_parameters(f"imu_{grade}", ImuParameters)
    imu = replace(imu, accelerometer_range_m_s2=50.0)  # for a grade without a limit, too
    sheet = _gyro_sheet(imu, 400)
    told = {
        "rate_hz": 400,
        "noise_density_rad_s_rthz": imu.gyro_noise_density_rad_s_rthz,
        "bias_sigma_rad_s": imu.gyro_turn_on_bias_sigma_rad_s,
        "bias_walk_rad_s_rts": imu.gyro_bias_walk_rad_s_rts,
        "range_rad_s": imu.gyro_range_rad_s,
        "accelerometer_noise_density_m_s2_rthz": imu.accelerometer_noise_density_m_s2_rthz,
        "accelerometer_bias_sigma_m_s2": imu.accelerometer_turn_on_bias_sigma_m_s2,
        "accelerometer_range_m_s2": 50.0,
    }
    assert {name: getattr(sheet, name) for name in told} == told
    assert sheet.scale_factor_sigma >= max(imu.gyro_scale_factor_sigma, imu.gyro_misalignment_sigma_rad) > 0.0
    assert sheet.scale_factor_sigma == pytest.approx(imu.gyro_scale_factor_sigma + imu.gyro_misalignment_sigma_rad)


@pytest.mark.usefixtures("unsettled")
def test_the_start_that_is_told_is_the_scenarios_in_radians():
    keys = {"start__sigma_attitude_deg": [30.0, 18.0, 9.0], "start__aft_m": 6.0, "start__left_m": 1.0}
    start = build(still_air(**keys), 0).sheets.start
    np.testing.assert_allclose(start.sigma_R_rad, [np.pi / 6.0, np.pi / 10.0, np.pi / 20.0], rtol=1e-15)
    np.testing.assert_array_equal(start.p_PD_B, [6.0, -1.0, 0.0])
    assert not start.sigma_p_m.any()


@pytest.fixture
def unsettled(monkeypatch):
    """Worlds whose shape at the start does not matter."""
    monkeypatch.setattr(build_module, "SETTLE_S", 0.0)


@pytest.mark.usefixtures("unsettled")
def test_without_wake_it_is_that_of_level_flight_and_a_hose_in_still_air():
    scenario = still_air(wake__present=False)
    world = build(scenario, 0).world
    air, speed = standard_atmosphere(scenario.flight.altitude_m), scenario.flight.airspeed_m_s
    hose, drogue = load_parameters("hose", HoseParameters), load_parameters("drogue", DrogueParameters)
    wind_W = np.array([-speed, 0.0, 0.0])
    x, _, z = rest_shape(hose, drogue, wind_W, air.density_kg_m3, air.kinematic_viscosity_m2_s).t_D_W
    R_WB = level_trim(load_parameters("airframe", AirframeParameters), speed, air).R_WB
    expected = R_WB.T @ matrix_from_yaw_pitch_roll(0.0, -np.arctan2(z, x), 0.0)
    np.testing.assert_allclose(nominal_attitude(scenario, world.parameters), expected, atol=1e-12)


@pytest.mark.usefixtures("unsettled")
def test_what_is_changed_for_this_flight_is_not_told():
    """Another hose, drogue, tanker and wake than those of the sheets change the world and not the nominal attitude."""
    changed = {
        "parameters__hose__line_density_kg_m": 4.9,
        "parameters__drogue__mass_kg": 28.0,
        "parameters__tanker__mass_kg": 100e3,
        "parameters__wake__vortex_span_fraction": 0.9,
    }
    plain, other = still_air(), still_air(**changed)
    a, b = build(plain, 0).world.parameters, build(other, 0).world.parameters
    assert b.hose.line_density_kg_m != a.hose.line_density_kg_m and b.tanker.mass_kg != a.tanker.mass_kg
    assert np.array_equal(nominal_attitude(plain, a), nominal_attitude(other, b))


@pytest.mark.slow
def test_the_hose_of_a_wing_pod_is_blown_outward_from_the_tankers_middle_below_its_vortex():
    """Below the left leg of the horseshoe the air blows to the left: the drogue hangs there, its nose turned back."""
    scenario = still_air(tanker__pod="left_wing")
    left = build(scenario, 0)
    p_TD = left.world.truth.p_WD - left.world.truth.p_WT
    exit_T = left.world.parameters.tanker.exit_m
    assert exit_T[1] == 12.0 and 0.1 < p_TD[1] - exit_T[1] < 0.6
    assert left.world.truth.gust_D_m_s[1] > 2.0
    assert left.sheets.start.R_BD[1, 0] < -0.01
