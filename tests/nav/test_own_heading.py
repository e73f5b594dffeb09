"""When a frame for the heading is asked for, what of it may be looked at, and how sure the heading is said to be."""

import numpy as np
import pytest

from dockair.calibration import Camera, GyroSheet, LedRing, Mounting, NavigationSheets, StartGeometry
from dockair.errors import DockairError
from dockair.messages import CameraFrame, ImuSample, Window
from dockair.nav.heading.own_heading import OwnHeading, OwnHeadingSettings
from dockair.nav.navigator import Navigator, NavigatorSettings
from dockair.rotations import matrix_from_yaw_pitch_roll

CAMERA = Camera()
SHEETS = NavigationSheets(
    camera=CAMERA,
    ring=LedRing(),
    mounting=Mounting(
        R_BC=matrix_from_yaw_pitch_roll(-0.05, 0.0, 0.0),
        p_BC=np.array([3.3, -0.45, 0.75]),
        p_BP=np.array([6.0, -0.9, 0.6]),
    ),
    start=StartGeometry(
        p_PD_B=np.array([4.0, 0.0, 0.0]), sigma_p_m=np.full(3, 0.3), R_BD=np.eye(3), sigma_R_rad=np.radians(5.0)
    ),
    gyro=GyroSheet(rate_hz=500, noise_density_rad_s_rthz=1.7e-4, bias_sigma_rad_s=3.5e-3),
    camera_rate_hz=50,
    control_rate_hz=100,
    coupling_depth_m=0.3,
)
SETTINGS = OwnHeadingSettings(airspeed_m_s=180.0)
DROGUE_C = np.array([8.0, 0.3, 0.1])


def frame(exposure_s: float, window: Window = CAMERA.full_window, stamp_s: float = 0.02) -> CameraFrame:
    pixels = np.zeros(window.shape, np.uint8)
    return CameraFrame(time_stamp_s=stamp_s, pixels=pixels, window=window, exposure_s=exposure_s, gain=0.02)


def imu(first_s: float, last_s: float) -> list[ImuSample]:
    times = np.arange(round(first_s * 500) + 1, round(last_s * 500) + 1) / 500.0
    up = np.array([0.0, 0.0, 9.8])
    return [ImuSample(time_stamp_s=float(t), angular_rate_rad_s=np.zeros(3), specific_force_m_s2=up) for t in times]


def test_one_camera_period_in_two_seconds_is_asked_for():
    heading = OwnHeading(SHEETS, SETTINGS)
    asked = [heading.ask(0.01 * k) for k in range(600)]
    assert np.flatnonzero(np.isfinite(asked)).tolist() == [0, 1, 200, 201, 400, 401]  # two control ticks, one exposure
    assert asked[0] == 500e-6


def test_a_frame_was_asked_for_if_it_is_full_and_exposed_as_asked_and_when():
    """In the dark the camera's own control may expose as long: those frames are the LEDs'."""
    heading = OwnHeading(SHEETS, SETTINGS)
    assert not heading.was_asked(frame(500e-6))
    heading.ask(0.01)
    assert heading.was_asked(frame(500e-6))
    assert not heading.was_asked(frame(500e-6, stamp_s=0.05)) and not heading.was_asked(frame(500e-6, stamp_s=0.0))
    assert not heading.was_asked(frame(20e-6))
    assert not heading.was_asked(frame(500e-6, Window(0, 100, 0, 100)))


def test_features_lie_below_the_level_and_off_drogue_and_probe():
    heading = OwnHeading(SHEETS, SETTINGS)
    heading.step(imu(0.0, 0.1), None, DROGUE_C)
    mask = heading._mask(np.eye(3), DROGUE_C)
    assert mask.shape == (1088, 2048)
    assert not mask[:540].any()  # the level is in the middle row
    assert mask[560:, :300].all()
    column, row = CAMERA.pixels_from_points(DROGUE_C)[0]
    assert not mask[round(row) + 180, round(column)] and mask[round(row) + 280, round(column)]
    mounting = SHEETS.mounting
    on_probe_C = mounting.R_BC.T @ (mounting.p_BP - [0.8, 0.0, 0.0] - mounting.p_BC)
    column, row = CAMERA.pixels_from_points(on_probe_C)[0]
    assert row > 560 and not mask[round(row), round(column)]


def test_a_bank_turns_the_level():
    heading = OwnHeading(SHEETS, SETTINGS)
    mask = heading._mask(matrix_from_yaw_pitch_roll(0.0, 0.0, np.radians(-25.0)), DROGUE_C)  # left wing down
    assert mask[400, 100] and not mask[600, 1900]


def test_sigma_is_that_of_the_bias_until_frames_show_it_and_of_a_walk():
    heading = OwnHeading(SHEETS, SETTINGS)
    assert np.isnan(heading.sigma_rad)
    for k in range(100):
        heading.step(imu(0.1 * k, 0.1 * (k + 1)), None, DROGUE_C)
    after_s = 10.0 - 0.1
    expected = np.hypot(SETTINGS.walk_rad_rts * np.sqrt(after_s), SHEETS.gyro.bias_sigma_rad_s * after_s)
    assert heading.sigma_rad == pytest.approx(expected, rel=1e-6)


def test_after_a_gap_the_heading_is_lost_and_says_no_sigma():
    heading = OwnHeading(SHEETS, SETTINGS)
    heading.step(imu(0.0, 0.1), None, DROGUE_C)
    heading.step(imu(2.0, 2.1), None, DROGUE_C)
    assert heading.solution is not None and np.isnan(heading.solution.heading_rad) and np.isnan(heading.sigma_rad)


def test_a_number_that_is_not_positive_is_refused():
    with pytest.raises(DockairError, match="heading.airspeed_m_s: expected a number above 0"):
        OwnHeadingSettings(airspeed_m_s=0.0)


def test_a_navigator_asks_for_the_frame_in_full_and_does_not_look_for_leds_in_it():
    navigator = Navigator(SHEETS, NavigatorSettings(heading=SETTINGS))
    solution = navigator.step(imu(0.0, 0.01), None)
    assert solution.exposure_s == 500e-6 and solution.window is None
    later = [navigator.step(imu(0.01 * k, 0.01 * (k + 1)), None) for k in range(1, 4)]
    assert np.isnan(later[-1].exposure_s)
    before = later[-1].status
    after = navigator.step(imu(0.04, 0.05), frame(500e-6))
    assert after.status == before == "no frame yet"
    assert after.heading_rad == 0.0 and after.heading_sigma_rad > 0.0
    assert navigator.step(imu(0.05, 0.06), frame(20e-6, stamp_s=0.04)).status == "ring not found"


def test_a_navigator_without_heading_asks_for_nothing():
    solution = Navigator(SHEETS).step(imu(0.0, 0.01), None)
    assert np.isnan([solution.exposure_s, solution.heading_rad, solution.heading_sigma_rad]).all()
