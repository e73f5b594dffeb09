"""What the navigation is told before it flies: nominal calibration, mounting and geometry, and the gyro's data sheet.

Nominal values only: nothing that is drawn, or changed in hose, drogue and airframe, for this flight goes in. What can
be measured on the ground goes in as a scenario sets it: where probe and camera are mounted, how deep the coupling is.
A tanker's mass, span and units are published to its receivers, and with them its wake; so the geometry at the start is
that of a flight in that wake without gusts: the hose hangs in it, the receiver is trimmed in the air where it waits. As
the air depends on the places and the places on the air, both are found in a few rounds.

Not told: the bow wave's push; what guidance anticipates of it is of the nominal sheet (`bow_wave_push`).
"""

import numpy as np

from dockair.calibration import Camera, GyroSheet, LedRing, NavigationSheets, StartGeometry
from dockair.parameters import load_parameters
from dockair.rotations import Array, matrix_from_yaw_pitch_roll
from dockair.scenarios.assembly import receiver as build_receiver
from dockair.scenarios.schema import Scenario
from dockair.sim.air.motion import AirMotion
from dockair.sim.air.wake import WakeParameters, wake_coefficients
from dockair.sim.aircraft.trim import steady_trim
from dockair.sim.hose.chain import DrogueParameters, HoseParameters
from dockair.sim.hose.rest import rest_shape
from dockair.sim.imu import ImuParameters
from dockair.sim.outlines import TankerParameters
from dockair.sim.parts import WorldParameters, still_air

_ROUNDS = 5  # each leaves a tenth of the last one's change, the first one's being 1 degree


def nominal_sheets(scenario: Scenario, world: WorldParameters, imu: ImuParameters) -> NavigationSheets:
    """Return the sheets of a flight.

    Args:
        scenario: start geometry, rates, hardware.
        world: flight condition and place of the hose's exit.
        imu: whose data sheet is told.
    """
    start = StartGeometry(
        p_PD_B=scenario.start.p_PD_B,
        sigma_p_m=scenario.start.sigma_p_m,
        R_BD=nominal_attitude(scenario, world),
        sigma_R_rad=scenario.start.sigma_R_rad,
    )
    return NavigationSheets(
        camera=nominal_camera(scenario),
        ring=nominal_ring(scenario),
        mounting=world.mounting,
        start=start,
        gyro=_gyro_sheet(imu, scenario.rates.gyro_hz),
        camera_rate_hz=scenario.rates.camera_hz,
        control_rate_hz=scenario.rates.control_hz,
        coupling_depth_m=world.coupling.depth_m,
    )


def nominal_camera(scenario: Scenario) -> Camera:
    """Return the camera's calibration sheet."""
    camera = scenario.hardware.camera
    return Camera() if camera is None else Camera.from_toml(camera)


def nominal_ring(scenario: Scenario) -> LedRing:
    """Return the ring's sheet."""
    ring = scenario.hardware.ring
    return LedRing() if ring is None else LedRing.from_toml(ring)


def nominal_attitude(scenario: Scenario, world: WorldParameters) -> Array:
    """(3, 3) R_BD of hose and receiver at rest where the scenario begins, in the tanker's nominal wake."""
    airframe = build_receiver.airframe(scenario, {})
    around = _wake(scenario, world, airframe.gust_points_m)
    hose, drogue = load_parameters("hose", HoseParameters), load_parameters("drogue", DrogueParameters)
    air, moving, wind_W = world.air, still_air(hose.links + 1), np.array([-world.airspeed_m_s, 0.0, 0.0])
    for _ in range(_ROUNDS):
        rest = rest_shape(hose, drogue, wind_W + moving.tow_W, air.density_kg_m3, air.kinematic_viscosity_m2_s)
        downwash, pitching = -float(moving.receiver_W[2]), float(moving.receiver_rotation_B[1])
        trim = steady_trim(airframe, world.airspeed_m_s, air, downwash_m_s=downwash, pitching_air_rad_s=pitching)
        if around is None:
            break
        p_WP = rest.p_WD(drogue) - trim.R_WB @ scenario.start.p_PD_B
        where = (np.ascontiguousarray(trim.R_WB), p_WP - trim.R_WB @ world.mounting.p_BP)
        moving = around.at(rest.air_places_W(drogue), *where, np.eye(3), -world.tanker.exit_m)
    return np.asarray(trim.R_WB.T @ _attitude_along(rest.t_D_W))


def _wake(scenario: Scenario, world: WorldParameters, points_B: Array) -> AirMotion | None:
    if not scenario.wake.present:
        return None
    tanker, sheet = load_parameters("tanker", TankerParameters), load_parameters("wake", WakeParameters)
    table = wake_coefficients(
        sheet, mass_kg=tanker.mass_kg, span_m=tanker.span_m, airspeed_m_s=world.airspeed_m_s, air=world.air
    )
    return AirMotion(wake=table, exit_T=world.tanker.exit_m, receiver_points_B=points_B)


def _attitude_along(x_W: Array) -> Array:
    """(3, 3) R_WD without roll of a body whose x axis points along a unit vector (3,)."""
    yaw, pitch = np.arctan2(x_W[1], x_W[0]), -np.arcsin(x_W[2])
    return matrix_from_yaw_pitch_roll(float(yaw), float(pitch), 0.0)


def _gyro_sheet(imu: ImuParameters, rate_hz: int) -> GyroSheet:
    return GyroSheet(
        rate_hz=rate_hz,
        noise_density_rad_s_rthz=imu.gyro_noise_density_rad_s_rthz,
        bias_sigma_rad_s=imu.gyro_turn_on_bias_sigma_rad_s,
        bias_walk_rad_s_rts=imu.gyro_bias_walk_rad_s_rts,
        scale_factor_sigma=imu.gyro_scale_factor_sigma + imu.gyro_misalignment_sigma_rad,
        range_rad_s=imu.gyro_range_rad_s,
        accelerometer_noise_density_m_s2_rthz=imu.accelerometer_noise_density_m_s2_rthz,
        accelerometer_bias_sigma_m_s2=imu.accelerometer_turn_on_bias_sigma_m_s2,
        accelerometer_range_m_s2=imu.accelerometer_range_m_s2,
    )
