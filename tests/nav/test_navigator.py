"""The navigator on frames drawn without any simulator: pixels and gyro in, belief, window and command out."""

from dataclasses import replace

import numpy as np
import pytest

from dockair.calibration import Camera, GyroSheet, LedRing, Mounting, NavigationSheets, StartGeometry
from dockair.errors import DockairError
from dockair.messages import CameraFrame, ImuSample, Window
from dockair.nav.navigator import Navigator
from dockair.rotations import matrix_from_yaw_pitch_roll

EXPOSURE_S, LED_E = 20e-6, 3e4
DELAY_TICKS = 1  # a frame arrives one control tick after its exposure


def sheets():
    mounting = Mounting(
        R_BC=matrix_from_yaw_pitch_roll(-0.05, 0.0, 0.0),
        p_BC=np.array([3.3, -0.45, 0.75]),
        p_BP=np.array([6.0, -0.9, 0.6]),
    )
    start = StartGeometry(
        p_PD_B=np.array([4.0, 0.0, 0.0]),
        sigma_p_m=np.full(3, 0.3),
        R_BD=matrix_from_yaw_pitch_roll(0.0, -0.05, 0.0),
        sigma_R_rad=np.radians(5.0),
    )
    gyro = GyroSheet(rate_hz=500, noise_density_rad_s_rthz=1.7e-4, bias_sigma_rad_s=1e-3)
    return NavigationSheets(
        camera=Camera(),
        ring=LedRing(),
        mounting=mounting,
        start=start,
        gyro=gyro,
        camera_rate_hz=50,
        control_rate_hz=100,
        coupling_depth_m=0.3,
    )


class Sky:
    """A drogue on a path p_PD_B(t) in front of a receiver that does not turn, drawn where the navigator looks."""

    def __init__(self, render, path, seed=0, hidden=()):
        self.sheets, self.render, self.path, self.hidden = sheets(), render, path, set(hidden)
        self.navigator, self.rng = Navigator(self.sheets), np.random.default_rng(seed)
        self.R_BD = matrix_from_yaw_pitch_roll(0.03, -0.08, 0.02)
        self.window, self.tick, self.waiting = self.sheets.camera.full_window, 0, []

    def frame(self, time_s, window):
        m = self.sheets.mounting
        p_BL = self.path(time_s) + m.p_BP + self.sheets.ring.positions_D @ self.R_BD.T
        pixels = self.sheets.camera.pixels_from_points((p_BL - m.p_BC) @ m.R_BC)
        spots = [
            (u - window.column_start, v - window.row_start, LED_E)
            for k, (u, v) in enumerate(pixels)
            if k not in self.hidden
        ]
        image = self.render(window.shape, spots, self.rng)
        return CameraFrame(
            time_stamp_s=time_s, pixels=image, window=window, exposure_s=EXPOSURE_S, gain=255.0 / 13500.0
        )

    def step(self, *, camera=True, gyro=True):
        times = (self.tick * 5 + np.arange(1, 6)) / 500.0
        self.tick += 1
        imu = tuple(ImuSample(time_stamp_s=float(t), angular_rate_rad_s=np.zeros(3)) for t in times)
        arrived = self.waiting.pop(0) if self.waiting else None
        if camera and self.tick % 2 == 0:
            self.waiting.append(self.frame(float(times[-1]), self.window))
        solution = self.navigator.step(imu if gyro else (), arrived)
        self.window = solution.window or self.sheets.camera.full_window
        return solution

    def run(self, seconds, **how):
        for _ in range(round(100 * seconds)):
            solution = self.step(**how)
        return solution


def still(_time_s):
    return np.array([4.2, 0.2, -0.15])


def test_finds_the_drogue_and_knows_it_to_centimetres_along_and_millimetres_across(render):
    solution = Sky(render, still).run(0.5)
    assert solution.valid and solution.status == "pose used"
    error = solution.p_PD_B - still(0.0)
    assert abs(error[0]) < 0.02 and np.abs(error[1:]).max() < 0.003
    assert np.abs(solution.v_PD_B).max() < 0.05


def test_follows_a_drogue_that_comes_nearer_and_swings(render):
    def path(t):
        return np.array([4.0 - 1.0 * t, 0.1 * np.sin(2.0 * t), 0.05 * np.cos(2.5 * t)])

    sky = Sky(render, path)
    sky.run(0.3)
    for _ in range(200):
        solution = sky.step()
        error = solution.p_PD_B - path(solution.time_stamp_s)
        assert solution.valid and np.abs(error).max() < 0.02


def test_reads_the_full_frame_first_and_then_a_window_around_the_ring(render):
    sky = Sky(render, still)
    assert sky.step().window is None
    window = sky.run(0.5).window
    assert isinstance(window, Window)
    rows, columns = window.shape
    assert rows * columns < 0.2 * 1088 * 2048
    assert sky.run(0.2).valid  # what it sees through the window is enough


def test_hidden_leds_do_not_rename_the_others(render):
    solution = Sky(render, still, hidden=(2, 3)).run(0.5)
    assert solution.valid
    seen = np.isfinite(solution.led_pixels_px).all(axis=1)
    assert seen.tolist() == [True, True, False, False, True, True, True, True]
    assert np.abs(solution.p_PD_B - still(0.0)).max() < 0.02


def test_without_frames_nothing_is_valid_and_the_command_stays_still(render):
    solution = Sky(render, still).run(0.5, camera=False)
    assert not solution.valid and solution.status == "no frame yet"
    assert np.isnan(solution.covariance).all() and np.isfinite(solution.p_PD_B).all()
    assert not solution.command.velocity_m_s.any()


def test_a_camera_that_goes_dark_is_a_status_and_ends_validity(render):
    sky = Sky(render, still, hidden=())
    sky.run(0.5)
    sky.hidden = set(range(8))
    solution = sky.run(0.2)
    assert solution.status == "ring not found"
    assert not np.isfinite(solution.led_pixels_px).any()
    solution = sky.run(0.6)
    assert not solution.valid and solution.window is None  # looks everywhere again
    sky.hidden = set()
    assert sky.run(0.5).valid


def test_time_and_belief_go_on_while_the_imu_is_silent_and_after_it(render):
    def path(t):
        return np.array([4.0 - 1.0 * t, 0.2, -0.15])

    sky = Sky(render, path)
    sky.run(0.5)
    before = sky.step()
    silent = sky.run(0.2, gyro=False)
    assert silent.time_stamp_s == pytest.approx(before.time_stamp_s + 0.2)
    assert silent.valid and silent.frame_time_stamp_s > before.frame_time_stamp_s
    assert np.abs(silent.p_PD_B - path(silent.time_stamp_s)).max() < 0.02
    after = sky.run(0.2)
    assert after.time_stamp_s == pytest.approx(silent.time_stamp_s + 0.2)
    assert np.abs(after.p_PD_B - path(after.time_stamp_s)).max() < 0.02


def test_the_same_messages_give_the_same_bits(render):
    one, other = (Sky(render, still, seed=4).run(0.3) for _ in range(2))
    assert np.array_equal(one.p_PD_B, other.p_PD_B) and np.array_equal(one.covariance, other.covariance)


@pytest.mark.parametrize("axis", [1, 2])
def test_the_image_shift_of_a_turning_camera_has_the_sign_of_the_pinhole(axis):
    """A far point ahead of a camera that turns by w dt about body axis: the gyro-made shift against projection."""
    from dockair.rotations import exp

    navigator, nav_sheets, dt = Navigator(sheets()), sheets(), 0.02
    w_B = np.zeros(3)
    w_B[axis] = 0.1
    times = np.arange(1, 20) / 500.0
    navigator.step(tuple(ImuSample(time_stamp_s=float(t), angular_rate_rad_s=w_B) for t in times), None)
    shift = navigator._shift_px(0.03, 0.03 - dt)
    R_BC, camera = nav_sheets.mounting.R_BC, nav_sheets.camera
    far_B = 1e6 * R_BC[:, 0]
    turned = (exp(-w_B * dt) @ far_B) @ R_BC
    expected = camera.pixels_from_points(turned)[0] - np.array(camera.principal_point_px)
    np.testing.assert_allclose(shift, expected, rtol=0.02, atol=0.05)


def test_a_ring_that_cannot_be_identified_is_refused_before_the_first_frame():
    with pytest.raises(DockairError, match="ring.count: expected 8 LEDs"):
        Navigator(replace(sheets(), ring=LedRing(count=6)))
