"""When a frame for the heading is asked for, what of it may be looked at, and how sure the heading is said to be."""

from dataclasses import replace

import cv2
import numpy as np
import pytest

from dockair.calibration import Camera, GyroSheet, LedRing, Mounting, NavigationSheets, StartGeometry
from dockair.errors import DockairError
from dockair.messages import CameraFrame, ImuSample, Window
from dockair.nav.heading.levelling import without_yaw
from dockair.nav.heading.own_heading import OwnHeading, OwnHeadingSettings
from dockair.nav.heading.turn import Turn, TurnStatus
from dockair.nav.heading.visual import VisualHeading
from dockair.nav.navigator import Navigator, NavigatorSettings
from dockair.rotations import exp, matrix_from_yaw_pitch_roll

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
        p_PD_B=np.array([4.0, 0.0, 0.0]),
        sigma_p_m=np.full(3, 0.3),
        R_BD=np.eye(3),
        sigma_R_rad=np.full(3, np.radians(5.0)),
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


def levelled() -> OwnHeading:
    heading = OwnHeading(SHEETS, SETTINGS)
    heading.step(imu(-4.5, 0.0), None, DROGUE_C)
    return heading


def test_no_frame_is_asked_for_before_it_could_be_levelled():
    heading = OwnHeading(SHEETS, SETTINGS)
    assert np.isnan(heading.ask(0.0))
    heading.step(imu(-3.0, 0.0), None, DROGUE_C)
    assert np.isnan(heading.ask(0.0))
    heading.step(imu(0.0, 2.0), None, DROGUE_C)
    assert heading.ask(2.0) == 500e-6


def test_one_camera_period_in_two_seconds_is_asked_for():
    heading = levelled()
    asked = [heading.ask(0.01 * k) for k in range(600)]
    assert np.flatnonzero(np.isfinite(asked)).tolist() == [0, 1, 200, 201, 400, 401]  # two control ticks, one exposure
    assert asked[0] == 500e-6


@pytest.mark.parametrize("first", range(12))
def test_rounding_of_the_time_asks_for_no_third_tick(first):
    """0.07 + 0.02 is more than 0.09 in double precision."""
    heading = levelled()
    asked = [heading.ask(0.01 * k) for k in range(first, first + 6)]
    assert np.flatnonzero(np.isfinite(asked)).tolist() == [0, 1]


def test_leds_are_left_a_frame():
    """Of a camera of 2 Hz each frame would be asked for every 0.5 s, and the drogue never seen."""
    slow = replace(SHEETS, camera_rate_hz=2)
    with pytest.raises(DockairError, match="heading.every_s: expected more than a camera's period, 0.5 s"):
        OwnHeading(slow, replace(SETTINGS, every_s=0.5))
    heading = OwnHeading(slow, replace(SETTINGS, every_s=1.0))
    heading.step(imu(-4.5, 0.0), None, DROGUE_C)
    asked = [np.isfinite(heading.ask(0.01 * k)) for k in range(400)]
    exposed = [asked[k - 1] for k in range(50, 400, 50)]  # every 0.5 s, as was asked a control tick before
    assert 0 < sum(exposed) < len(exposed)


def test_a_frame_was_asked_for_if_it_is_full_and_exposed_as_asked_and_when():
    """In the dark the camera's own control may expose as long: those frames are the LEDs'."""
    heading = levelled()
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


def test_a_mask_of_a_camera_that_is_mounted_askew_is_that_of_the_body_s_level_and_probe():
    """The camera is banked by 20 degrees and stands above the probe, whose axis is the body's x."""
    R_BC = matrix_from_yaw_pitch_roll(0.1, 0.05, 0.35)
    mounting = Mounting(R_BC=R_BC, p_BC=np.array([3.3, -0.9, 0.75]), p_BP=SHEETS.mounting.p_BP)
    heading = OwnHeading(replace(SHEETS, mounting=mounting), SETTINGS)
    mask, R_LB = heading._mask(np.eye(3), -DROGUE_C), np.eye(3)
    corners = np.array([[100.0, 100.0], [100.0, 900.0], [1900.0, 100.0], [700.0, 60.0], [1000.0, 300.0]])
    below = (CAMERA.rays_from_pixels(corners) @ (R_LB @ R_BC).T)[:, 2] < 0.0
    assert 0 < below.sum() < len(below)
    np.testing.assert_array_equal(mask[tuple(corners.astype(int).T[::-1])], below)
    behind_m = np.linspace(0.0, 1.6, 9)
    probe_C = (mounting.p_BP - np.outer(behind_m, [1.0, 0.0, 0.0]) - mounting.p_BC) @ R_BC
    pixels = np.round(CAMERA.pixels_from_points(probe_C)).astype(int)
    inside = ((pixels >= 0) & (pixels < [CAMERA.width_px, CAMERA.height_px])).all(axis=1)
    assert inside.sum() >= 5
    assert not mask[tuple(pixels[inside].T[::-1])].any()


def test_pictures_of_before_are_tilted_in_axes_of_the_visual_heading_s_own_zero(monkeypatch):
    """Filter and vision count their headings from different moments; a tilt is told along the heading at the frame."""
    told, tilt = [], np.array([0.1, -0.05, 0.0])
    heading = levelled()
    heading._visual.heading_rad = 2.0
    monkeypatch.setattr(heading._filter, "tilt_L", lambda: tilt)
    monkeypatch.setattr(heading._filter, "predicted_turn_rad", lambda stamp_s: 0.3)
    monkeypatch.setattr(VisualHeading, "tilt", lambda self, theta, R_BC: told.append(theta))
    heading.step([], frame(500e-6, stamp_s=0.0), DROGUE_C)
    c, s = np.cos(2.3), np.sin(2.3)
    np.testing.assert_allclose(told, [[0.1 * c + 0.05 * s, 0.1 * s - 0.05 * c, 0.0]], atol=1e-12)


def test_a_drogue_believed_far_out_of_view_masks_nothing():
    heading = OwnHeading(SHEETS, SETTINGS)
    heading.step(imu(0.0, 0.1), None, DROGUE_C)
    for far in ([0.31, 0.0, -3e5], [0.31, -1e6, 0.0], [0.35, 3.0, -1e7], [1e3, 0.0, 1e9]):
        np.testing.assert_array_equal(heading._mask(np.eye(3), np.array(far)), heading._mask(np.eye(3), -DROGUE_C))


def test_a_bank_turns_the_level():
    heading = OwnHeading(SHEETS, SETTINGS)
    mask = heading._mask(matrix_from_yaw_pitch_roll(0.0, 0.0, np.radians(-25.0)), DROGUE_C)  # left wing down
    assert mask[400, 100] and not mask[600, 1900]


def test_before_any_frame_the_heading_is_the_gyro_s_and_its_sigma_grows_with_the_bias():
    heading = OwnHeading(SHEETS, SETTINGS)
    assert np.isnan([heading.heading_rad, heading.sigma_rad]).all()
    sigmas = []
    for k in range(100):
        assert heading.step(imu(0.1 * k, 0.1 * (k + 1)), None, DROGUE_C) is None
        sigmas.append(heading.sigma_rad)
    assert abs(heading.heading_rad) < 1e-6
    grown_rad_s = (sigmas[-1] - sigmas[49]) / 5.0
    assert 0.8 * SHEETS.gyro.bias_sigma_rad_s < grown_rad_s <= 1.001 * SHEETS.gyro.bias_sigma_rad_s


def test_pictures_that_stand_still_show_the_gyro_s_bias():
    """Two pictures of the same landscape, 2 s apart, with 0.3 degrees/s of bias between them: no turn."""
    heading = OwnHeading(SHEETS, SETTINGS)
    rng = np.random.default_rng(0)
    pixels = cv2.GaussianBlur(rng.integers(0, 255, CAMERA.full_window.shape, np.uint8), (0, 0), 4.0)
    pixels = cv2.normalize(pixels, None, 0, 255, cv2.NORM_MINMAX)
    bias, statuses = np.array([0.0, 0.0, np.radians(0.3)]), []
    for k in range(401):
        samples = [replace(s, angular_rate_rad_s=bias) for s in imu(0.02 * k, 0.02 * (k + 1))]
        seen = replace(frame(500e-6, stamp_s=0.02 * k + 0.01), pixels=pixels) if k % 100 == 50 else None
        statuses.append(heading.step(samples, seen, DROGUE_C))
    assert [s for s in statuses if s] == [TurnStatus.FIRST, *3 * [TurnStatus.MEASURED]]
    assert abs(heading.heading_rad) < np.radians(0.2)
    assert heading.sigma_rad < np.radians(0.5)


def test_pictures_of_before_stand_as_is_known_of_them_by_now():
    """A tilt that both pictures share is no turn; one that only the newer has been rid of would be."""
    R_BC = SHEETS.mounting.R_BC
    visual = VisualHeading(CAMERA)
    believed, tilt = matrix_from_yaw_pitch_roll(0.0, -0.1, 0.02), np.array([0.08, -0.03, 0.0])
    visual.step(np.zeros((64, 64), np.uint8), R_HC=believed @ R_BC)
    for heading_rad in (0.0, 2.0):
        visual._key = visual._last = replace(visual._last, heading_rad=heading_rad)
        before = visual._key.features.R_HC
        along = exp(np.array([0.0, 0.0, heading_rad])) @ tilt  # axes of heading zero
        visual.tilt(along, R_BC)
        expected = without_yaw(exp(tilt) @ before @ R_BC.T) @ R_BC
        np.testing.assert_allclose(visual._key.features.R_HC, expected, atol=1e-12)
        assert visual._last is visual._key


def test_after_a_gap_the_heading_is_lost_and_says_no_sigma():
    heading = levelled()
    heading.step(imu(2.0, 2.1), None, DROGUE_C)
    assert np.isnan(heading.heading_rad) and np.isnan(heading.sigma_rad)
    assert np.isnan(heading.ask(2.2))  # a frame would say nothing any more


def test_gyros_of_which_nothing_is_known_are_refused():
    consumer = replace(SHEETS, gyro=replace(SHEETS.gyro, bias_sigma_rad_s=0.087))
    with pytest.raises(DockairError, match="heading.gyro: expected gyros whose bias is below 0.016 rad/s at 180 m/s"):
        OwnHeading(consumer, SETTINGS)


def test_a_number_that_is_not_positive_is_refused():
    with pytest.raises(DockairError, match="heading.airspeed_m_s: expected a finite number above 0"):
        OwnHeadingSettings(airspeed_m_s=0.0)


def test_a_navigator_asks_for_the_frame_in_full_and_does_not_look_for_leds_in_it():
    navigator = Navigator(SHEETS, NavigatorSettings(heading=SETTINGS))
    solution = navigator.step(imu(-4.5, 0.01), None)
    assert solution.exposure_s == 500e-6 and solution.window is None
    later = [navigator.step(imu(0.01 * k, 0.01 * (k + 1)), None) for k in range(1, 4)]
    assert np.isnan(later[-1].exposure_s)
    before = later[-1].status
    after = navigator.step(imu(0.04, 0.05), frame(500e-6))
    assert after.status == before == "no frame yet"
    assert abs(after.heading_rad) < 1e-6 and after.heading_sigma_rad > 0.0
    other = frame(20e-6, stamp_s=0.04)
    other.pixels[0, 0] = 1  # two that are equal to the last bit are one
    assert navigator.step(imu(0.05, 0.06), other).status == "ring not found"


def test_samples_that_the_belief_does_not_take_the_heading_does_not_take_either():
    """One stamp an hour ahead, and a rate at the gyro's limit, which may be any beyond it."""
    sheets = replace(SHEETS, gyro=replace(SHEETS.gyro, range_rad_s=1.0))
    navigator = Navigator(sheets, NavigatorSettings(heading=SETTINGS))
    navigator.step(imu(0.0, 0.1), None)
    (last,) = imu(0.1, 0.102)
    navigator.step([replace(last, time_stamp_s=3600.0)], None)
    navigator.step([replace(last, angular_rate_rad_s=np.array([0.0, 0.0, 1.0]))], None)
    solution = navigator.step(imu(0.1, 0.2), None)
    assert abs(solution.heading_rad) < 1e-6 and solution.heading_sigma_rad < 0.01


def test_a_picture_that_comes_again_shows_the_heading_nothing(monkeypatch):
    navigator = Navigator(SHEETS, NavigatorSettings(heading=SETTINGS))
    hung = np.random.default_rng(0).integers(0, 255, CAMERA.full_window.shape, np.uint8)
    seen, statuses = [], []
    monkeypatch.setattr(VisualHeading, "step", lambda *_, **__: seen.append(True) or Turn.none(TurnStatus.FIRST))
    solution = navigator.step(imu(-4.5, 0.0), None)
    for k in range(450):
        asked = k % 2 == 0 and np.isfinite(solution.exposure_s)
        picture = replace(frame(500e-6, stamp_s=0.01 * k), pixels=hung) if asked else None
        solution = navigator.step(imu(0.01 * k, 0.01 * (k + 1)), picture)
        statuses += [solution.status] if asked else []
    assert len(seen) == 1 and statuses == ["no frame yet", "frame stuck", "frame stuck"]


def test_a_navigator_without_heading_asks_for_nothing():
    solution = Navigator(SHEETS).step(imu(0.0, 0.01), None)
    assert np.isnan([solution.exposure_s, solution.heading_rad, solution.heading_sigma_rad]).all()
