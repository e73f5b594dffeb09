"""The relative filter against a kinematic world that obeys its assumptions, written here without it."""

from dataclasses import dataclass, replace

import numpy as np
import pytest
from scipy.stats import chi2

from dockair.calibration import Camera, GyroSheet, LedRing, Mounting, NavigationSheets, StartGeometry
from dockair.errors import DockairError
from dockair.messages import ImuSample
from dockair.nav import belief_buffer
from dockair.nav.belief import mixture
from dockair.nav.belief_motion import BIAS, CALIBRATION, ERRORS, GUST, SWING, SWING_RATE, VELOCITY, propagated
from dockair.nav.belief_motion import RING as LED_PLACES
from dockair.nav.fusion import FusionSettings, RelativeFilter
from dockair.nav.fusion_settings import motion_of, refusals_until_doubt, start_of, swing_covariance, taking_of
from dockair.nav.pose.estimate import PoseEstimate, solve_pose
from dockair.nav.pose.planar import mirrored
from dockair.rotations import Array, exp, log, matrix_from_yaw_pitch_roll, skew

RING, CAMERA = LedRing().positions_D, Camera()
MOUNTING = Mounting(
    R_BC=matrix_from_yaw_pitch_roll(-0.05, 0.02, 0.1),
    p_BC=np.array([3.3, -0.45, 0.75]),
    p_BP=np.array([6.0, -0.9, 0.6]),
    R_BI=matrix_from_yaw_pitch_roll(0.3, -0.2, 0.1),
    p_BI=np.array([1.0, 0.3, -0.2]),
)
GYRO = GyroSheet(
    rate_hz=250,
    noise_density_rad_s_rthz=1.7e-4,
    bias_sigma_rad_s=3.5e-3,
    accelerometer_noise_density_m_s2_rthz=6e-4,
    accelerometer_bias_sigma_m_s2=0.03,
)
TIP_FROM_IMU = MOUNTING.p_BP - MOUNTING.p_BI
GRAVITY_N = np.array([0.0, 0.0, -9.80665])
CALIBRATED = dict.fromkeys(
    (
        "camera_axes_sigma_rad",
        "camera_place_sigma_m",
        "focal_scale_sigma",
        "ring_diameter_sigma_m",
        "led_place_sigma_m",
        "led_place_walk_m_rts",
    ),
    0.0,
)
SETTINGS = FusionSettings(start_velocity_sigma_m_s=0.3, **CALIBRATED)


def sheets(distance_m: float, sigma_R_rad: float = 0.009, sigma_p_m: float = 0.2) -> NavigationSheets:
    start = StartGeometry(
        p_PD_B=np.array([distance_m, 0.3, -0.2]),
        sigma_p_m=np.full(3, sigma_p_m),
        R_BD=matrix_from_yaw_pitch_roll(0.05, -0.08, 0.1),
        sigma_R_rad=np.full(3, sigma_R_rad),
    )
    return NavigationSheets(
        camera=CAMERA,
        ring=LedRing(),
        mounting=MOUNTING,
        start=start,
        gyro=GYRO,
        camera_rate_hz=50,
        control_rate_hz=100,
        coupling_depth_m=0.3,
    )


@dataclass
class World:
    """Receiver turning and speeding smoothly, drogue swinging in gusts; axes N do not turn. Advances by gyro steps."""

    sheets: NavigationSheets
    settings: FusionSettings
    rng: np.random.Generator
    turn_rad_s: float = 0.15

    def __post_init__(self) -> None:
        start, s, rng = self.sheets.start, self.settings, self.rng
        self.k, self.dt, self.R_NB = 0, 1.0 / GYRO.rate_hz, np.eye(3)
        self.R_rest = exp(start.sigma_R_rad * rng.normal(size=3)) @ start.R_BD
        self.u_N = s.attitude_density * np.sqrt(0.5 * s.attitude_time_s) * rng.normal(size=3)
        self.R_ND = exp(-self.u_N) @ self.R_rest
        self.s_N = start.p_PD_B + MOUNTING.p_BP - MOUNTING.p_BI + start.sigma_p_m * rng.normal(size=3)
        omega = 2.0 * np.pi * np.array(s.swing_frequency_hz)
        self.stiffness, self.friction = np.append(0.0, omega**2), np.append(0.0, 2.0 * s.swing_damping * omega)
        blown = [swing_covariance(s, axis) + 1e-12 * np.eye(3) for axis in range(3)]
        self.n_N, self.m_N, self.g_N = np.stack([np.linalg.cholesky(P) @ rng.normal(size=3) for P in blown], axis=1)
        self.v_N = s.start_velocity_sigma_m_s * rng.normal(size=3) + self.m_N
        self.push = s.start_formation_sigma_m_s2 * rng.normal(size=3)
        self.c_N = GRAVITY_N.copy()
        self.bias_B = GYRO.bias_sigma_rad_s * rng.normal(size=3)
        self.force_bias_B = GYRO.accelerometer_bias_sigma_m_s2 * rng.normal(size=3)

    @property
    def time_s(self) -> float:
        return self.k * self.dt

    def rate(self, time_s: float) -> Array:
        return self.turn_rad_s * np.sin(2.0 * time_s + np.array([0.0, 1.0, 2.0]))

    def speeding(self, time_s: float) -> Array:
        """Acceleration of I in N beyond the formation's."""
        return self.push * np.cos(3.0 * time_s)

    def step(self) -> ImuSample:
        dt, s = self.dt, self.settings
        a, b = self.rng.normal(size=(2, 3)) * s.drogue_acceleration_density  # exact double integral of white noise
        kick_s, kick_v = dt**1.5 * (a / 2.0 + b / np.sqrt(12.0)), a * np.sqrt(dt)
        swing = -self.stiffness * self.n_N - self.friction * self.m_N + self.g_N
        own = swing - self.speeding(self.time_s + 0.5 * dt)
        self.s_N = self.s_N + self.v_N * dt + 0.5 * dt**2 * own + kick_s
        self.v_N = self.v_N + own * dt + kick_v
        across = np.array([0.0, 1.0, 1.0])
        self.n_N = self.n_N + (self.m_N * dt + 0.5 * dt**2 * swing + kick_s) * across
        self.m_N = self.m_N + (swing * dt + kick_v) * across
        gust = np.array(s.gust_density) * np.sqrt(dt) * self.rng.normal(size=3)
        self.g_N = self.g_N * np.exp(-dt / s.gust_time_s) + gust
        self.c_N = self.c_N + s.formation_walk_m_s2_rts * np.sqrt(dt) * self.rng.normal(size=3)
        self.u_N = self.u_N * np.exp(-dt / s.attitude_time_s) - s.attitude_density * np.sqrt(dt) * self.rng.normal(
            size=3
        )
        self.R_rest = exp(s.rest_walk_rad_rts * np.sqrt(dt) * self.rng.normal(size=3)) @ self.R_rest
        self.R_ND = exp(-self.u_N) @ self.R_rest
        self.R_NB = self.R_NB @ exp(self.rate(self.time_s + 0.5 * dt) * dt)
        self.k += 1
        return self.gyro()

    def gyro(self) -> ImuSample:
        noise_w, noise_f = np.sqrt(GYRO.rate_hz) * self.rng.normal(size=(2, 3))
        w_B = self.rate(self.time_s) + self.bias_B + GYRO.noise_density_rad_s_rthz * noise_w
        f_B = self.R_NB.T @ (self.speeding(self.time_s) - self.c_N) + self.force_bias_B
        f_B += GYRO.accelerometer_noise_density_m_s2_rthz * noise_f
        return ImuSample(
            time_stamp_s=self.time_s,
            angular_rate_rad_s=MOUNTING.R_BI.T @ w_B,
            specific_force_m_s2=MOUNTING.R_BI.T @ f_B,
        )

    def pixels(self, sigma_px: float, built: Mounting = MOUNTING, scale: float = 1.0) -> Array:
        R_BD, s_B = self.R_NB.T @ self.R_ND, self.R_NB.T @ self.s_N
        p_C = (s_B + MOUNTING.p_BI + scale * RING @ R_BD.T - built.p_BC) @ built.R_BC
        return CAMERA.pixels_from_points(p_C) + sigma_px * self.rng.normal(size=(len(RING), 2))

    def error(self, filter_: RelativeFilter) -> tuple[Array, Array]:
        """Error of (phi, p_PD_B, v_PD_B) and the covariance that the filter states."""
        state = filter_.state(self.time_s)
        R_BD, s_B, v_B = self.R_NB.T @ self.R_ND, self.R_NB.T @ self.s_N, self.R_NB.T @ self.v_N
        v_PD_B = v_B - np.cross(self.rate(self.time_s), TIP_FROM_IMU)
        return np.concatenate(
            [log(R_BD @ state.R_BD.T), s_B - TIP_FROM_IMU - state.p_PD_B, v_PD_B - state.v_PD_B]
        ), state.covariance


def solve(filter_: RelativeFilter, pixels: Array, time_s: float, sigma_px: float) -> PoseEstimate:
    R, p, _ = filter_.predicted_pose(time_s)
    return solve_pose(pixels, RING, CAMERA, sigma_px=sigma_px, initial=(R, p))


def fly(world: World, filter_: RelativeFilter, duration_s: float, sigma_px: float = 0.1, seen=lambda t: True):
    """Fly with a frame every fifth gyro sample; yields after each frame whether it was taken."""
    filter_.propagate([world.gyro()])
    while world.time_s < duration_s:
        filter_.propagate([world.step()])
        if world.k % 5 == 0 and seen(world.time_s):
            taken = filter_.update(solve(filter_, world.pixels(sigma_px), world.time_s, sigma_px), world.time_s)
            yield taken


def nees(error: Array, P: Array) -> float:
    return float(error @ np.linalg.solve(P, error))


def assert_mean_nees(values: list[float], dof: int) -> None:
    """Inside chi2(dof N)/N for N independent values; outside by luck once in 10 000."""
    low, high = chi2.ppf([0.5e-4, 1.0 - 0.5e-4], dof * len(values)) / len(values)
    assert low < np.mean(values) < high


def state_of(filter_: RelativeFilter, time_s: float) -> Array:
    s = filter_.state(time_s)
    return np.concatenate([s.R_BD.ravel(), s.p_PD_B, s.v_PD_B, s.rate_PD_B, s.covariance.ravel()])


@pytest.mark.parametrize(("distance_m", "sigma_px"), [(4.0, 0.1), (10.0, 0.05), (20.0, 0.1)])
def test_covariance_is_honest_after_40_frames(distance_m, sigma_px):
    """Position within 0.2 m and attitude within 3 degrees (1 sigma) at the start, receiver turning at 9 deg/s."""
    values: list[tuple[float, ...]] = []
    for seed in range(25):
        world = World(sheets(distance_m), SETTINGS, np.random.default_rng(seed))
        filter_ = RelativeFilter(world.sheets, SETTINGS)
        assert np.mean(list(fly(world, filter_, 0.8, sigma_px))) > 0.9
        e, P = world.error(filter_)
        values.append((nees(e, P), *(nees(e[k : k + 3], P[k : k + 3, k : k + 3]) for k in (0, 3, 6))))
    for column, dof in zip(zip(*values, strict=True), (9, 3, 3, 3), strict=True):
        assert_mean_nees(list(column), dof)


def test_coasting_through_dropped_frames_the_covariance_grows_and_stays_honest():
    """Camera off from 0.3 s to 0.8 s."""
    at_end, sigma = [], []
    for seed in range(25):
        world = World(sheets(5.0), SETTINGS, np.random.default_rng(seed))
        filter_ = RelativeFilter(world.sheets, SETTINGS)
        for _ in fly(world, filter_, 0.3):
            pass
        sigma.append([np.sqrt(np.trace(world.error(filter_)[1][3:6, 3:6]))])
        for _ in range(125):
            filter_.propagate([world.step()])
            sigma[-1].append(np.sqrt(np.trace(world.error(filter_)[1][3:6, 3:6])))
        e, P = world.error(filter_)
        at_end.append(nees(e, P))
    assert (np.diff(sigma, axis=1) > 0.0).all()
    assert_mean_nees(at_end, 9)


def test_frames_that_come_without_any_sample_are_kept_for_no_longer_than_others():
    """An IMU that drops out for the rest of the flight: what is run again at each frame does not grow with it."""
    world = World(sheets(5.0), SETTINGS, np.random.default_rng(3))
    filter_ = RelativeFilter(world.sheets, SETTINGS)
    for _ in fly(world, filter_, 0.3):
        pass
    most = 2 * SETTINGS.buffer_s * 50  # before, nodes without frames lay among them
    for _ in range(150):
        for _ in range(5):
            world.step()
        filter_.update(solve(filter_, world.pixels(0.1), world.time_s, 0.1), world.time_s)
        assert len(filter_._buffer._nodes) <= most
    before_s = world.time_s
    filter_.propagate([world.step()])
    assert filter_._buffer._nodes[0].time_s >= before_s - SETTINGS.buffer_s - 0.021
    assert np.isfinite(filter_.state(world.time_s).p_PD_B).all()


def test_before_the_first_message_the_drogue_has_swung_in_gusts_for_ever():
    """Its swing is as uncertain a second later, and the drogue's velocity as much as the rate of its swing more."""
    start, motion = start_of(SETTINGS, sheets(5.0)), motion_of(SETTINGS, GYRO)
    swinging = np.r_[VELOCITY, SWING, SWING_RATE, GUST]
    P = np.zeros((ERRORS, ERRORS))
    P[np.ix_(swinging, swinging)] = start.P[np.ix_(swinging, swinging)]
    times, still = np.arange(251) / 250.0, np.zeros((251, 3))
    alone = motion._replace(gyro2=0.0, scale2=0.0, held_turn2=0.0, bias2=0.0, formation2=0.0, accelerometer2=0.0)
    after = propagated(np.eye(3), np.zeros((8, 3)), P, 0.0, 1.0, times, still, still, alone.flat())[2]
    across = np.r_[SWING, SWING_RATE, GUST].reshape(3, 3)[:, 1:].ravel()
    kept = np.ix_(across, across)
    size = np.sqrt(np.outer(P.diagonal(), P.diagonal()))[kept]
    np.testing.assert_allclose(after[kept] / size, P[kept] / size, atol=0.01)
    more = P[VELOCITY, VELOCITY].diagonal() - P[SWING_RATE, SWING_RATE].diagonal()
    np.testing.assert_allclose(more, SETTINGS.start_velocity_sigma_m_s**2, rtol=1e-12)


@pytest.mark.parametrize("diameter_m", [0.25, 0.5, 0.8])
def test_a_rings_size_is_known_to_as_many_millimetres_whatever_it_is(diameter_m):
    """What of it is scale goes with one over the diameter; the lens's part does not."""
    start = start_of(FusionSettings(), replace(sheets(5.0), ring=LedRing(diameter_m=diameter_m)))
    scale = np.sqrt(start.P.diagonal()[CALIBRATION.stop - 1])  # the last of the seven
    assert scale == pytest.approx(np.hypot(5e-4, 3e-4 / diameter_m))


def test_turning_of_the_receiver_alone_leaves_the_drogue_where_it_is():
    """Constant rate: R_BD and p_BD turn by exp(-w t) exactly; the tip's velocity is that of a lever."""
    filter_, w = RelativeFilter(sheets(8.0), SETTINGS), np.array([0.2, -0.1, 0.3])
    start, times = filter_.state(0.0), np.arange(251) / 250.0
    w_I = MOUNTING.R_BI.T @ w
    filter_.propagate([ImuSample(time_stamp_s=t, angular_rate_rad_s=w_I) for t in times])
    state, back = filter_.state(1.0), exp(w)
    np.testing.assert_allclose(back @ state.R_BD, start.R_BD, atol=1e-12)
    s, s0 = state.p_PD_B + TIP_FROM_IMU, start.p_PD_B + TIP_FROM_IMU
    np.testing.assert_allclose(back @ s, s0, atol=1e-12)
    np.testing.assert_allclose(state.v_PD_B, -np.cross(w, TIP_FROM_IMU), atol=1e-12)
    np.testing.assert_allclose(state.rate_PD_B, -np.cross(w, s), atol=1e-12)


def test_rate_between_gyro_samples_is_linear():
    """Rate growing as 2 t about one axis: the angle after 1 s is 1 rad, whatever the sampling."""
    filter_ = RelativeFilter(sheets(8.0), SETTINGS)
    start, axis = filter_.state(0.0), np.array([0.6, 0.0, 0.8])
    w_I = MOUNTING.R_BI.T @ axis
    filter_.propagate([ImuSample(time_stamp_s=t, angular_rate_rad_s=2.0 * t * w_I) for t in np.arange(11) / 10.0])
    np.testing.assert_allclose(exp(axis) @ filter_.state(1.0).R_BD, start.R_BD, atol=1e-12)
    np.testing.assert_allclose(exp(0.85**2 * axis) @ filter_.state(0.85).R_BD, start.R_BD, atol=1e-12)


def test_rate_is_the_derivative_of_the_position_in_body_axes():
    filter_, w = RelativeFilter(sheets(8.0), SETTINGS), np.array([0.2, -0.1, 0.3])
    samples = [ImuSample(time_stamp_s=t, angular_rate_rad_s=MOUNTING.R_BI.T @ w) for t in np.arange(26) / 250.0]
    filter_.propagate(samples)
    R, p, _ = filter_.predicted_pose(0.1)
    moved = CAMERA.pixels_from_points(p + [0.0, 0.05, -0.02] + RING @ R.T)
    assert filter_.update(solve_pose(moved, RING, CAMERA, sigma_px=0.1, initial=(R, p)), 0.1)
    step = 1e-5
    difference = (filter_.state(0.1 + step).p_PD_B - filter_.state(0.1).p_PD_B) / step
    np.testing.assert_allclose(filter_.state(0.1).rate_PD_B, difference, atol=1e-4)
    assert np.linalg.norm(filter_.state(0.1).rate_PD_B + np.cross(w, filter_.state(0.1).p_PD_B)) > 0.1


@pytest.mark.parametrize("late_samples", [1, 4, 25])
@pytest.mark.parametrize("offset", [0.0, 0.4], ids=["on a gyro stamp", "between two"])
def test_late_frame_is_the_frame_in_time_to_the_last_bit(late_samples, offset):
    world = World(sheets(6.0), SETTINGS, np.random.default_rng(3))
    samples = [world.gyro()] + [world.step() for _ in range(80)]
    stamps = [samples[k].time_stamp_s - offset / GYRO.rate_hz for k in (20, 30, 40)]
    template = RelativeFilter(world.sheets, SETTINGS)
    template.propagate(samples[:41])
    poses = []
    for stamp in stamps:  # what was seen does not matter here, only when it is told
        R, p, _ = template.predicted_pose(stamp)
        poses.append(solve_pose(CAMERA.pixels_from_points(RING @ R.T + p + [0.05, 0.01, 0.02]), RING, CAMERA))
    told = []
    for late in (0, late_samples):
        filter_, i = RelativeFilter(world.sheets, SETTINGS), 0
        for k, sample in enumerate(samples):
            filter_.propagate([sample])
            while i < 3 and samples[min(k, 80)].time_stamp_s >= stamps[i] + late / GYRO.rate_hz:
                assert filter_.update(poses[i], stamps[i])
                i += 1
        told.append(state_of(filter_, samples[-1].time_stamp_s))
    np.testing.assert_array_equal(told[0], told[1])


def test_frame_ahead_of_the_gyro_ends_like_a_late_one():
    """Told before the sample that follows it, it has to guess the rate, and is put right when the sample comes."""
    world = World(sheets(6.0), SETTINGS, np.random.default_rng(4))
    samples = [world.gyro()] + [world.step() for _ in range(40)]
    stamp = samples[20].time_stamp_s + 0.7 / GYRO.rate_hz
    pose = solve_pose(world_pixels(world), RING, CAMERA)
    ahead, late = RelativeFilter(world.sheets, SETTINGS), RelativeFilter(world.sheets, SETTINGS)
    ahead.propagate(samples[:21])
    assert ahead.update(pose, stamp)
    ahead.propagate(samples[21:])
    late.propagate(samples)
    assert late.update(pose, stamp)
    np.testing.assert_array_equal(state_of(ahead, 0.16), state_of(late, 0.16))


def world_pixels(world: World) -> Array:
    R, p, _ = RelativeFilter(world.sheets, SETTINGS).predicted_pose(0.0)
    return CAMERA.pixels_from_points(RING @ R.T + p + [0.05, 0.01, 0.02])


def test_frames_out_of_order_are_put_in_order():
    world = World(sheets(6.0), SETTINGS, np.random.default_rng(5))
    samples = [world.gyro()] + [world.step() for _ in range(40)]
    told, poses = [], {}
    for stamps in ((0.04, 0.08), (0.08, 0.04)):
        filter_ = RelativeFilter(world.sheets, SETTINGS)
        filter_.propagate(samples)
        for stamp in stamps:
            R, p, _ = filter_.predicted_pose(stamp)
            seen = CAMERA.pixels_from_points(RING @ R.T + p + [0.05, 0.01, 0.02])
            assert filter_.update(poses.setdefault(stamp, solve_pose(seen, RING, CAMERA)), stamp)
        told.append(state_of(filter_, 0.16))
    np.testing.assert_array_equal(told[0], told[1])


def test_frame_older_than_the_buffer_is_refused_and_changes_nothing():
    world = World(sheets(6.0), SETTINGS, np.random.default_rng(6))
    filter_ = RelativeFilter(world.sheets, SETTINGS)
    filter_.propagate([world.gyro()] + [world.step() for _ in range(150)])
    before = state_of(filter_, 0.6)
    assert not filter_.update(solve_pose(world_pixels(world), RING, CAMERA), 0.1)
    np.testing.assert_array_equal(state_of(filter_, 0.6), before)


@pytest.mark.parametrize(
    "spoil",
    [
        lambda px: px + [0.0, 12.0],
        lambda px: np.roll(px, 1, axis=0),
        lambda px: 1023.5 + (px - 1023.5) * 1.1,
        lambda px: px * np.nan,
    ],
    ids=["another light", "LEDs named one too far", "ring too large", "nothing seen"],
)
def test_false_pose_is_refused_and_changes_nothing(spoil):
    world = World(sheets(8.0), SETTINGS, np.random.default_rng(7))
    filter_ = RelativeFilter(world.sheets, SETTINGS)
    for _ in fly(world, filter_, 0.3):
        pass
    filter_.propagate([world.step() for _ in range(5)])
    before, now = state_of(filter_, world.time_s), world.time_s
    assert not filter_.update(solve(filter_, spoil(world.pixels(0.1)), now, 0.1), now)
    np.testing.assert_array_equal(state_of(filter_, now), before)
    assert filter_.update(solve(filter_, world.pixels(0.1), now, 0.1), now)


def test_pose_on_the_wrong_floor_still_corrects_the_right_way():
    """Every frame is solved from the mirror image of the prediction; the filter is not drawn over."""
    world = World(sheets(12.0), SETTINGS, np.random.default_rng(8))
    filter_ = RelativeFilter(world.sheets, SETTINGS)
    for _ in fly(world, filter_, 0.3):
        pass
    flipped = 0
    for _ in range(20):
        for _ in range(5):
            filter_.propagate([world.step()])
        pixels, (R, p, _) = world.pixels(0.1), filter_.predicted_pose(world.time_s)
        pose = solve_pose(pixels, RING, CAMERA, initial=mirrored(R, p, RING))
        flipped += np.linalg.norm(log(pose.R_CD @ R.T)) > 0.1
        assert filter_.update(pose, world.time_s)
    e, P = world.error(filter_)
    assert flipped > 10
    assert nees(e[:3], P[:3, :3]) < chi2.ppf(0.9999, 3)


def test_attitude_belief_of_the_wrong_side_is_given_up_for_the_right_one():
    """Start 9 degrees (3 sigma) off, at 20 m where one frame cannot tell the two floors apart."""
    ended = []
    for seed in (6, 106, 206):
        world = World(sheets(20.0), SETTINGS, np.random.default_rng(seed))
        line = world.s_N + MOUNTING.p_BI - MOUNTING.p_BC
        R_CD = MOUNTING.R_BC.T @ world.sheets.start.R_BD
        other, _ = mirrored(R_CD, MOUNTING.R_BC.T @ line, RING)
        world.R_ND = MOUNTING.R_BC @ other
        filter_ = RelativeFilter(world.sheets, SETTINGS)
        for _ in fly(world, filter_, 1.2, 0.05):
            pass
        e, P = world.error(filter_)
        ended.append(nees(e[:3], P[:3, :3]))
    assert max(ended) < chi2.ppf(0.9999, 3)


def test_pose_without_its_lines_of_sight_is_the_same_where_the_problem_is_linear():
    """At 4 m and 20 degrees of tilt both ways of taking a frame agree within a twentieth of a sigma."""
    tilted = sheets(4.0, sigma_R_rad=0.005, sigma_p_m=0.02)
    tilted = replace(tilted, start=replace(tilted.start, R_BD=matrix_from_yaw_pitch_roll(0.0, 0.35, 0.0)))
    world = World(tilted, SETTINGS, np.random.default_rng(9))
    whole, gaussian = RelativeFilter(tilted, SETTINGS), RelativeFilter(tilted, SETTINGS)
    pose = solve(whole, world.pixels(0.1), 0.0, 0.1)
    assert whole.update(pose, 0.0)
    assert gaussian.update(replace(pose, measurement=None), 0.0)
    a, b = whole.state(0.0), gaussian.state(0.0)
    difference = np.concatenate([log(a.R_BD @ b.R_BD.T), a.p_PD_B - b.p_PD_B, a.v_PD_B - b.v_PD_B])
    assert (np.abs(difference) < 0.05 * np.sqrt(np.diag(a.covariance))).all()


@pytest.mark.parametrize("flown_s", [0.0, 0.1], ids=["before any frame", "attitude and place correlated by frames"])
def test_predicted_pixels_are_the_leds_and_their_sigma_is_that_of_samples(flown_s):
    """2000 states drawn from the belief; a sample sigma is off by 6 % (4 of its own) once in 10 000."""
    filter_, rng = RelativeFilter(sheets(6.0, 0.02, 0.02), SETTINGS), np.random.default_rng(10)
    world = World(filter_._sheets, SETTINGS, rng)
    assert all(fly(world, filter_, flown_s))
    pixels, sigma = filter_.predicted_led_pixels(world.time_s)
    R, p, covariance = filter_.predicted_pose(world.time_s)
    np.testing.assert_allclose(pixels, CAMERA.pixels_from_points(RING @ R.T + p))
    draws = rng.multivariate_normal(np.zeros(6), covariance, 2000)
    samples = np.array([CAMERA.pixels_from_points(RING @ (exp(d[:3]) @ R).T + p + d[3:]) for d in draws])
    for i in range(8):
        worst = np.sqrt(np.linalg.eigvalsh(np.cov(samples[:, i].T))[-1])
        assert sigma[i] == pytest.approx(worst, rel=0.07)


@pytest.mark.parametrize(
    ("time_s", "rate"),
    [(0.08, 0.1), (0.0804, np.nan), (0.02, 0.1), (np.nan, 0.1)],
    ids=["same stamp again", "not a number", "backwards", "no stamp"],
)
def test_useless_gyro_sample_is_ignored(time_s, rate):
    world = World(sheets(6.0), SETTINGS, np.random.default_rng(11))
    samples = [world.gyro()] + [world.step() for _ in range(20)]
    clean, disturbed = RelativeFilter(world.sheets, SETTINGS), RelativeFilter(world.sheets, SETTINGS)
    clean.propagate(samples)
    disturbed.propagate([*samples, ImuSample(time_stamp_s=time_s, angular_rate_rad_s=np.full(3, rate))])
    np.testing.assert_array_equal(state_of(disturbed, 0.08), state_of(clean, 0.08))


def test_frame_before_the_first_gyro_sample_is_taken():
    start = sheets(6.0)
    filter_ = RelativeFilter(start, SETTINGS)
    R, p, _ = filter_.predicted_pose(5.0)
    seen = solve_pose(CAMERA.pixels_from_points(RING @ R.T + p + [0.1, 0.0, 0.0]), RING, CAMERA)
    assert filter_.update(seen, 5.0)
    moved = filter_.state(5.0).p_PD_B - start.start.p_PD_B
    np.testing.assert_allclose(MOUNTING.R_BC.T @ moved, [0.1, 0.0, 0.0], atol=0.01)


def test_rate_is_told_in_body_axes_linear_between_samples_and_held_outside():
    filter_ = RelativeFilter(sheets(8.0), SETTINGS)
    np.testing.assert_array_equal(filter_.rate_B(0.0), np.zeros(3))
    w = np.array([0.1, 0.2, -0.3])
    w_I = MOUNTING.R_BI.T @ w
    filter_.propagate([ImuSample(time_stamp_s=t, angular_rate_rad_s=k * w_I) for t, k in ((1.0, 1.0), (1.08, 3.0))])
    for time_s, factor in ((0.5, 1.0), (1.0, 1.0), (1.02, 1.5), (1.08, 3.0), (2.0, 3.0)):
        np.testing.assert_allclose(filter_.rate_B(time_s), factor * w, atol=1e-12)


def test_the_mean_rate_is_that_of_as_many_samples_as_last_a_span_less_the_bias():
    """At 250 Hz, in 0.02 s: five."""
    filter_ = RelativeFilter(sheets(8.0), SETTINGS)
    np.testing.assert_array_equal(filter_.mean_rate_B(0.01, 0.02), np.zeros(3))
    w = np.array([0.1, 0.2, -0.3])
    samples = [(1.004 + 0.004 * k, 1.0 + k) for k in range(10)]
    filter_.propagate([ImuSample(time_stamp_s=t, angular_rate_rad_s=k * MOUNTING.R_BI.T @ w) for t, k in samples])
    np.testing.assert_allclose(filter_.mean_rate_B(1.041, 0.02), 8.0 * w, atol=1e-12)  # the last five of ten
    np.testing.assert_allclose(filter_.mean_rate_B(1.08, 0.02), 8.0 * w, atol=1e-12)  # held
    R, p, _ = filter_.predicted_pose(1.04)
    seen = solve_pose(CAMERA.pixels_from_points(RING @ R.T + p + [0.0, 0.02, 0.0]), RING, CAMERA)
    assert filter_.update(seen, 1.04)
    bias = filter_.rate_B(1.04) - 10.0 * w
    assert np.abs(bias).max() > 1e-9
    np.testing.assert_allclose(filter_.mean_rate_B(1.041, 0.02), 8.0 * w + bias, atol=1e-12)


def test_the_rate_of_the_place_is_by_the_gyros_mean_of_one_age_whatever_the_jitter():
    """500 Hz, rates that grow evenly, stamps as the MTi's: v_PD - d/dt p_PD = w x p_PD, w of 4 ms before the tick."""
    known = sheets(8.0)
    filter_ = RelativeFilter(replace(known, gyro=replace(GYRO, rate_hz=500)), SETTINGS)
    draws, slope = np.random.default_rng(0), np.array([0.01, 0.02, -0.03])
    for tick in range(1, 1000):
        times = (5 * tick + np.arange(-4, 1)) / 500.0
        filter_.propagate(
            [
                ImuSample(
                    time_stamp_s=t + 1e-5 * draws.standard_normal(), angular_rate_rad_s=t * MOUNTING.R_BI.T @ slope
                )
                for t in times
            ]
        )
        state = filter_.state(filter_.imu_time_s)
        turning = np.cross((times[-1] - 0.004) * slope, state.p_PD_B)
        np.testing.assert_allclose(state.v_PD_B - state.rate_PD_B, turning, atol=1e-9)


def struck(seed, settings):
    """Half a second of flight, then 1.2 m/s gained at once, as when the coupling catches the probe; 0.3 s more."""
    world = World(sheets(2.0), settings, np.random.default_rng((41, seed)))
    filter_ = RelativeFilter(world.sheets, settings)
    assert all(fly(world, filter_, 0.5))
    world.v_N = world.v_N + np.array([-1.2, 0.0, 0.0])
    return world, filter_, list(fly(world, filter_, 0.8))


def test_a_drogue_that_is_struck_is_followed_again_after_a_few_refused_frames():
    values = []
    for seed in range(20):
        world, filter_, taken = struck(seed, SETTINGS)
        assert taken.count(False) < SETTINGS.refusals_until_doubt
        assert all(taken[SETTINGS.refusals_until_doubt :])
        assert 0.5 < filter_.doubted_s <= 0.6
        values.append(nees(*world.error(filter_)))
    assert_mean_nees(values, 9)  # what comes after is honest again


def struck_aside(seed: int) -> tuple[Array, Array]:
    """Struck off its place of rest; seen for 0.1 s more, then coasting for 0.4 s. Error and covariance."""
    world = World(sheets(2.0), SETTINGS, np.random.default_rng((42, seed)))
    filter_ = RelativeFilter(world.sheets, SETTINGS)
    assert all(fly(world, filter_, 0.5))
    blow = np.array([0.0, 1.2, -0.6])
    world.v_N, world.m_N = world.v_N + blow, world.m_N + blow
    list(fly(world, filter_, 1.0, seen=lambda t: t < 0.6))
    assert filter_.doubted_s > 0.5
    return world.error(filter_)


def test_a_drogue_that_is_struck_aside_swings_back_to_where_it_hung():
    """Had only velocity and place been doubted, not the swing, the mean would be 14."""
    assert_mean_nees([nees(*struck_aside(seed)) for seed in range(20)], 9)


def test_without_doubt_it_would_not_come_back():
    settings = replace(SETTINGS, refusals_until_doubt=1000)
    assert all(struck(seed, settings)[2].count(False) > SETTINGS.refusals_until_doubt for seed in range(5))


def test_calibration_errors_that_frames_do_not_average_stay_in_the_covariance():
    """15 cameras turned, misplaced, with rings of another size, as the settings say: 0.8 s of frames, NEES honest."""
    axes, place, scale = 2e-3, 4e-3, 1e-3
    settings = replace(SETTINGS, camera_axes_sigma_rad=axes, camera_place_sigma_m=place, focal_scale_sigma=scale)
    values, plain = [], []
    for seed in range(15):
        rng = np.random.default_rng((60, seed))
        built = replace(
            MOUNTING,
            R_BC=exp(axes * rng.normal(size=3)) @ MOUNTING.R_BC,
            p_BC=MOUNTING.p_BC + place * rng.normal(size=3),
        )
        size = 1.0 + scale * rng.normal()
        world = World(sheets(5.0), SETTINGS, np.random.default_rng(seed))
        filters = [RelativeFilter(world.sheets, each) for each in (settings, SETTINGS)]
        for filter_ in filters:
            filter_.propagate([world.gyro()])
        while world.time_s < 0.8:
            sample = world.step()
            pixels = world.pixels(0.1, built, size)
            for filter_ in filters:
                filter_.propagate([sample])
                if world.k % 5 == 0:
                    filter_.update(solve(filter_, pixels, world.time_s, 0.1), world.time_s)
        values.append(nees(*world.error(filters[0])))
        plain.append(nees(*world.error(filters[1])))
    assert_mean_nees(values, 9)
    assert np.mean(plain) > 50.0  # what it costs to leave them out


def test_accelerometers_take_the_receiver_s_share_out_of_a_blind_second():
    """Half a second without camera while the receiver is pushed at 3 m/s^2: off by a third of what it is without."""
    calm = replace(SETTINGS, gust_density=(0.0, 0.0, 0.0), drogue_acceleration_density=0.25)
    settings, missed = replace(calm, start_formation_sigma_m_s2=3.0), {True: [], False: []}
    for fitted in missed:
        for seed in range(8):
            world = World(sheets(5.0), settings, np.random.default_rng((61, seed)))
            filter_ = RelativeFilter(world.sheets, settings)
            for k in range(351):
                sample = world.step() if k else world.gyro()
                filter_.propagate([sample if fitted else replace(sample, specific_force_m_s2=np.full(3, np.nan))])
                if k % 5 == 0 and k <= 225:
                    filter_.update(solve(filter_, world.pixels(0.1), world.time_s, 0.1), world.time_s)
            missed[fitted].append(world.error(filter_)[0][3:6])
    with_them, without = (np.sqrt(np.mean(np.square(missed[fitted]))) for fitted in (True, False))
    assert with_them < 0.12 and without > 3.0 * with_them


@pytest.mark.parametrize(
    ("turning", "wider"),
    [({"attitude_density": 0.01, "attitude_time_s": 1.5}, 1.5), ({}, 1.2)],
    ids=["a drogue that hardly turns", "a drogue as flown"],
)
@pytest.mark.parametrize("saturated", [False, True], ids=["IMU silent", "gyro at its limit"])
def test_while_the_gyro_is_out_the_covariance_is_that_of_a_missing_rate(saturated, turning, wider):
    """0.3 s without a rate, frames going on, the receiver turning at 9 deg/s: still honest, and wider than with it."""
    limit = 4.0
    settings = replace(SETTINGS, held_rate_sigma_rad_s=0.1, held_rate_time_s=0.5)  # the world's 0.2 rad/s^2
    settings = replace(settings, **turning)
    values, sigmas = [], {True: [], False: []}
    for seed in range(8):
        for out in sigmas:
            world = World(sheets(5.0), settings, np.random.default_rng((62, seed)))
            sheet = replace(world.sheets, gyro=replace(GYRO, range_rad_s=limit))
            filter_ = RelativeFilter(sheet, settings)
            for k in range(151):
                sample = world.step() if k else world.gyro()
                silent = out and 75 < k
                if silent and saturated:
                    sample = replace(sample, angular_rate_rad_s=np.array([0.0, limit, 0.0]))
                if saturated or not silent:
                    filter_.propagate([sample])
                if k % 5 == 0 and k <= 125:
                    filter_.update(solve(filter_, world.pixels(0.1), world.time_s, 0.1), world.time_s)
            e, P = world.error(filter_)
            sigmas[out].append(np.sqrt(np.trace(P[:3, :3])))
            if out:
                values.append(nees(e[:6], P[:6, :6]))
    assert np.mean(values) < chi2.ppf(1.0 - 1e-4, 6 * len(values)) / len(values)
    assert np.mean(sigmas[True]) > wider * np.mean(sigmas[False])


def test_single_leds_hold_the_place_when_no_pose_can_be_had():
    """From 0.5 s on two LEDs in turn: after another 0.5 s across to 2 mm, where coasting is off by centimetres."""
    ended = {2: [], 0: []}
    for count in ended:
        for seed in range(6):
            world = World(sheets(5.0), SETTINGS, np.random.default_rng((63, seed)))
            filter_ = RelativeFilter(world.sheets, SETTINGS)
            for _ in fly(world, filter_, 0.5):
                pass
            for k in range(125):
                filter_.propagate([world.step()])
                if count and k % 5 == 4:
                    leds = [(k // 5) % 8, (k // 5 + 3) % 8]
                    seen = world.pixels(0.1)[leds]
                    assert filter_.update_leds(seen, RING[leds], np.full(2, 0.1), world.time_s)
                    chi2_, freedom = filter_.innovation
                    assert freedom == 4 and chi2_ < 40.0
            ended[count].append(np.linalg.norm((MOUNTING.R_BC.T @ world.error(filter_)[0][3:6])[1:]))
    assert np.mean(ended[2]) < 2e-3 < 0.02 < np.mean(ended[0])


def test_single_leds_are_refused_by_the_gate_and_by_a_loose_filter():
    world = World(sheets(5.0), SETTINGS, np.random.default_rng(64))
    filter_ = RelativeFilter(world.sheets, SETTINGS)
    for _ in fly(world, filter_, 0.3):
        pass
    filter_.propagate([world.step()])
    pixels = world.pixels(0.1)[:1]
    assert not filter_.update_leds(pixels + 60.0, RING[:1], np.array([0.1]), world.time_s)
    assert not filter_.update_leds(pixels * np.nan, RING[:1], np.array([0.1]), world.time_s)
    assert filter_.update_leds(pixels, RING[:1], np.array([0.1]), world.time_s)
    with pytest.raises(DockairError, match=r"fusion\.coupling"):
        RelativeFilter(world.sheets, replace(SETTINGS, coupling="loose")).update_leds(
            pixels, RING[:1], np.array([0.1]), 0.0
        )
    with pytest.raises(DockairError, match="tight, loose"):
        FusionSettings(coupling="tigth")


@pytest.mark.parametrize("count", [1, 2])
def test_however_often_single_leds_are_refused_the_belief_does_not_give_way_to_them(count):
    """A glint has an LED's name, 40 px off, frame after frame; the next ring is neither doubted for it nor refused."""
    world = World(sheets(5.0), SETTINGS, np.random.default_rng(69))
    filter_ = RelativeFilter(world.sheets, SETTINGS)
    for _ in fly(world, filter_, 0.3):
        pass
    for _ in range(3 * SETTINGS.refusals_until_doubt):
        filter_.propagate([world.step()])
        pixels = world.pixels(0.1)[:count] + [40.0, 0.0]
        assert not filter_.update_leds(pixels, RING[:count], np.full(count, 0.1), world.time_s)
    before, now = state_of(filter_, world.time_s), world.time_s
    false_pose = solve(filter_, world.pixels(0.1) + [0.0, 12.0], now, 0.1)
    assert not filter_.update(false_pose, now)
    np.testing.assert_array_equal(state_of(filter_, now), before)
    assert filter_.update(solve(filter_, world.pixels(0.1), now, 0.1), now) and filter_.doubted_s == -np.inf


@pytest.mark.parametrize("gust_time_s", [0.0, -1.0, 0.005, float("nan")])
def test_gusts_that_last_no_longer_than_a_step_are_refused(gust_time_s):
    with pytest.raises(DockairError, match=r"fusion\.gust_time_s"):
        FusionSettings(gust_time_s=gust_time_s)


def test_second_frame_of_the_same_stamp_is_refused_and_changes_nothing():
    world = World(sheets(6.0), SETTINGS, np.random.default_rng(65))
    filter_ = RelativeFilter(world.sheets, SETTINGS)
    for _ in fly(world, filter_, 0.3):
        pass
    before = state_of(filter_, world.time_s)
    assert not filter_.update(solve(filter_, world.pixels(0.1), world.time_s, 0.1), world.time_s)
    np.testing.assert_array_equal(state_of(filter_, world.time_s), before)


@pytest.mark.parametrize("of", ["IMU", "camera"])
def test_one_stamp_far_ahead_harms_nothing(of):
    world = World(sheets(6.0), SETTINGS, np.random.default_rng(66))
    filter_, twin = RelativeFilter(world.sheets, SETTINGS), RelativeFilter(world.sheets, SETTINGS)
    for k in range(101):
        sample = world.step() if k else world.gyro()
        pixels = world.pixels(0.1)
        for each in (filter_, twin):
            each.propagate([sample])
            if k % 5 == 0:
                assert each.update(solve(each, pixels, world.time_s, 0.1), world.time_s)
        if k == 52 and of == "IMU":
            filter_.propagate([replace(sample, time_stamp_s=sample.time_stamp_s + 3600.0)])
        if k == 52 and of == "camera":
            assert not filter_.update(solve(filter_, pixels, world.time_s, 0.1), world.time_s + 3600.0)
    np.testing.assert_array_equal(state_of(filter_, world.time_s), state_of(twin, world.time_s))


def test_after_a_long_silence_of_everything_it_goes_on():
    """2 s without a message: the first stamp is doubted, the second believed; the covariance is wide meanwhile."""
    world = World(sheets(6.0, sigma_p_m=0.1), SETTINGS, np.random.default_rng(67), turn_rad_s=0.03)
    filter_ = RelativeFilter(world.sheets, SETTINGS)
    for _ in fly(world, filter_, 0.3):
        pass
    for _ in range(500):
        world.step()
    assert np.sqrt(np.trace(filter_.state(world.time_s).covariance[3:6, 3:6])) > 0.3
    taken = list(fly(world, filter_, world.time_s + 0.2))
    assert taken[1:] == [True] * (len(taken) - 1)
    e, P = world.error(filter_)
    assert nees(e, P) < chi2.ppf(1.0 - 1e-4, 9)


def test_loose_and_tight_end_alike_near_by():
    settings = replace(SETTINGS, coupling="loose")
    world = World(sheets(4.0), SETTINGS, np.random.default_rng(68))
    tight, loose = RelativeFilter(world.sheets, SETTINGS), RelativeFilter(world.sheets, settings)
    for k in range(126):
        sample, pixels = world.step() if k else world.gyro(), world.pixels(0.1)
        for each in (tight, loose):
            each.propagate([sample])
            if k % 5 == 0:
                each.update(solve(each, pixels, world.time_s, 0.1), world.time_s)
    a, b = tight.state(world.time_s), loose.state(world.time_s)
    sigma = np.sqrt(np.diag(a.covariance))[3:6]
    assert (np.abs(a.p_PD_B - b.p_PD_B) < 0.3 * sigma).all()
    np.testing.assert_allclose(np.sqrt(np.diag(b.covariance))[3:6], sigma, rtol=0.05)


def test_a_drogue_whose_leds_were_misnumbered_keeps_its_place_and_gets_its_roll():
    world = World(sheets(6.0), SETTINGS, np.random.default_rng(69))
    filter_ = RelativeFilter(world.sheets, SETTINGS)
    for _ in fly(world, filter_, 0.3):
        pass
    before = filter_.state()
    filter_.turn_drogue(np.pi / 4, before.time_s)
    after = filter_.state()
    np.testing.assert_allclose(after.R_BD, before.R_BD @ exp(np.array([np.pi / 4, 0.0, 0.0])), atol=1e-12)
    np.testing.assert_array_equal(after.p_PD_B, before.p_PD_B)
    assert filter_.update(solve(filter_, np.roll(world.pixels(0.1), -1, axis=0), world.time_s, 0.1), world.time_s)


def test_a_bias_of_the_gyro_hardly_harms_the_velocity_from_the_tip():
    """5 degrees/s of bias: v - w x r is seen directly, 0.45 m/s as v and w x r are off by; the filter knows that."""
    world = World(sheets(2.0), SETTINGS, np.random.default_rng(70))
    sheet = replace(world.sheets, gyro=replace(GYRO, bias_sigma_rad_s=0.0873))
    world.bias_B = np.array([0.05, -0.09, 0.09])
    filter_ = RelativeFilter(sheet, SETTINGS)
    for _ in fly(world, filter_, 1.0):
        pass
    e, P = world.error(filter_)
    assert np.abs(e[7:]).max() < 0.12
    assert np.sqrt(np.diag(P)[7:].max()) < 0.08
    assert nees(e, P) < chi2.ppf(0.9999, 9)


def test_a_long_silence_is_gone_through_once_however_often_the_present_is_asked_for(monkeypatch):
    """40 s without a message, asked at 50 Hz: the way that is gone is theirs, and a buffer's length a question."""
    asked, quiet = RelativeFilter(sheets(6.0)), RelativeFilter(sheets(6.0))
    world = World(sheets(6.0), SETTINGS, np.random.default_rng(3))
    for _ in range(50):
        sample = world.step()
        for filter_ in (asked, quiet):
            filter_.propagate([sample])
    gone, real = [], belief_buffer.propagated
    monkeypatch.setattr(belief_buffer, "propagated", lambda *a: gone.append(a[4] - a[3]) or real(*a))
    begun_s, rate_hz, silence_s = asked.imu_time_s, 50, 40.0
    times = begun_s + np.arange(1, round(silence_s * rate_hz) + 1) / rate_hz
    for time_s in times:
        state = asked.state(time_s)
    assert sum(gone) < silence_s + len(times) * SETTINGS.buffer_s
    at_once = quiet.state(times[-1])
    assert np.allclose(state.p_PD_B, at_once.p_PD_B, atol=1e-6)
    assert np.allclose(state.covariance, at_once.covariance, rtol=1e-6)
    sample = replace(world.gyro(), time_stamp_s=begun_s + 0.5)  # and a message is the end of it
    for filter_ in (asked, quiet):
        filter_.propagate([sample])
    assert np.array_equal(asked.state(begun_s + 0.6).covariance, quiet.state(begun_s + 0.6).covariance)


def test_a_moment_that_was_asked_for_is_believed_anew_once_a_sample_has_come():
    """Until then the rate was held; filters that are asked and not asked before agree to the last bit."""
    asked, quiet = RelativeFilter(sheets(6.0)), RelativeFilter(sheets(6.0))
    world = World(sheets(6.0), SETTINGS, np.random.default_rng(4))
    first = world.step()
    for filter_ in (asked, quiet):
        filter_.propagate([first])
    for _ in range(60):
        time_s = asked.imu_time_s + 1e-4
        held = asked.state(time_s), asked.predicted_pose(time_s)
        sample = world.step()
        for filter_ in (asked, quiet):
            filter_.propagate([sample])
        assert not np.array_equal(asked.state(time_s).R_BD, held[0].R_BD)
        assert np.array_equal(asked.state(time_s).covariance, quiet.state(time_s).covariance)
        for mine, other in zip(asked.predicted_pose(time_s), quiet.predicted_pose(time_s), strict=True):
            assert np.array_equal(mine, other)


def test_a_faster_camera_says_no_more_of_the_leds_places_in_a_second_and_a_blow_is_believed_as_late():
    """Its frames see the same LEDs off in the same way; a glint of 17 ms is no blow."""
    at = {hz: (taking_of(SETTINGS, hz).ring * max(hz, 50), refusals_until_doubt(SETTINGS, hz)) for hz in (25, 50, 180)}
    shares, refusals = zip(*at.values(), strict=True)
    np.testing.assert_allclose(shares, SETTINGS.led_place_share * 50)
    assert refusals == (3, 3, 11)


@pytest.mark.parametrize(("rate_hz", "seconds"), [(25, 0.06), (50, 0.03), (100, 0.02), (500, 0.02)])
def test_a_slow_imus_samples_are_no_gaps_and_one_left_out_is(rate_hz, seconds):
    """With stamps off by 10 us, as a data sheet has them."""
    gyro = replace(GYRO, rate_hz=rate_hz)
    asked = replace(sheets(6.0), gyro=gyro)
    assert motion_of(SETTINGS, gyro).longest_gap_s == pytest.approx(seconds)
    left_out = max(1, round(1.5 * seconds * rate_hz) - 1)
    for gap, whole in ((0, True), (left_out, False)):
        relative, rng = RelativeFilter(asked, SETTINGS), np.random.default_rng(rate_hz)
        ticks = [*range(rate_hz), *range(rate_hz + gap, rate_hz + gap + 3)]
        for k in ticks:
            sample = ImuSample(
                time_stamp_s=k / rate_hz + 1e-5 * rng.uniform(-1.0, 1.0),
                angular_rate_rad_s=np.zeros(3),
                specific_force_m_s2=-GRAVITY_N,
            )
            relative.propagate([sample])
        assert relative.felt(relative.imu_time_s - 0.3, relative.imu_time_s) == whole


def seen_from(filter_: RelativeFilter, time_s: float, moved_C: tuple[float, float, float]) -> PoseEstimate:
    """A frame's pose that is off by so much from what is believed, in camera axes [m]."""
    R, p, _ = filter_.predicted_pose(time_s)
    return solve_pose(CAMERA.pixels_from_points(RING @ R.T + p + moved_C), RING, CAMERA, initial=(R, p))


@pytest.mark.parametrize("leds", [0, 3, -2])
def test_a_drogue_that_was_lost_begins_again_where_it_is_seen_with_the_attitude_it_had(leds):
    """Its LEDs are numbered so many places on: the attitude is turned by as many and else stays."""
    world = World(sheets(6.0), SETTINGS, np.random.default_rng(71))
    filter_ = RelativeFilter(world.sheets, SETTINGS)
    assert all(fly(world, filter_, 0.3))
    before, now_s = filter_.state(), world.time_s
    roll = exp(np.array([leds * np.pi / 4, 0.0, 0.0]))
    R_CD, p_CD = MOUNTING.R_BC.T @ before.R_BD @ roll @ exp(np.array([0.1, 0.05, -0.1])), np.array([9.0, 1.0, -0.5])
    seen = solve_pose(CAMERA.pixels_from_points(RING @ R_CD.T + p_CD), RING, CAMERA, initial=(R_CD, p_CD))
    filter_.begin_again(seen, now_s)
    after = filter_.state(now_s)
    np.testing.assert_allclose(after.R_BD, before.R_BD @ roll, atol=1e-12)
    np.testing.assert_allclose(after.p_PD_B, MOUNTING.R_BC @ p_CD + MOUNTING.p_BC - MOUNTING.p_BP, atol=1e-6)
    assert filter_.update(seen, now_s)


def test_refusals_before_the_drogue_was_lost_do_not_count_once_it_is_found_again():
    """A frame off by a little more than a belief takes, and a widened one would."""
    filter_ = RelativeFilter(sheets(6.0, sigma_p_m=0.2), SETTINGS)
    for k in range(SETTINGS.refusals_until_doubt - 1):
        assert not filter_.update(seen_from(filter_, 0.02 * k, (0.0, 2.0, 0.0)), 0.02 * k)
    filter_.begin_again(seen_from(filter_, 0.05, (0.0, 0.0, 0.0)), 0.05)
    off_m = 0.2 * np.sqrt(1.05 * chi2.ppf(SETTINGS.gate_probability, 16))
    assert not filter_.update(seen_from(filter_, 0.05, (0.0, off_m, 0.0)), 0.05)
    assert filter_.doubted_s == -np.inf


def test_without_a_force_ever_the_receiver_is_felt_by_its_gyro_and_with_one_by_both():
    filter_ = RelativeFilter(sheets(6.0), SETTINGS)
    still = [ImuSample(time_stamp_s=k / 250.0, angular_rate_rad_s=np.zeros(3)) for k in range(51)]
    filter_.propagate(still[:26])
    assert filter_.felt(0.04, 0.1)
    filter_.propagate([replace(still[26], specific_force_m_s2=-GRAVITY_N), *still[27:]])
    assert not filter_.felt(0.11, 0.2)


def test_the_slowest_imu_s_stamps_are_no_leaps():
    """Samples and control at 5 Hz, every sample taken though a stamp may leap by 0.1 s."""
    slow = replace(sheets(6.0), control_rate_hz=5, gyro=replace(GYRO, rate_hz=5))
    samples = [ImuSample(time_stamp_s=0.2 * k, angular_rate_rad_s=np.zeros(3)) for k in range(10)]
    assert RelativeFilter(slow, SETTINGS).propagate(samples) == samples


def test_only_what_the_gate_refuses_contradicts_the_belief():
    """Not a second frame of one stamp, none that is too old, and no LED without numbers."""
    filter_ = RelativeFilter(sheets(6.0), SETTINGS)
    good, false = seen_from(filter_, 1.0, (0.0, 0.01, 0.0)), seen_from(filter_, 1.0, (0.0, 3.0, 0.0))
    one, none, sigma_px = RING[:1], np.full((1, 2), np.nan), np.array([0.1])
    for harmless in (
        lambda: filter_.update(good, 1.0),  # taken the first time
        lambda: filter_.update(good, 1.0),
        lambda: filter_.update(good, 0.2),
        lambda: filter_.update_leds(none, one, sigma_px, 1.01),
    ):
        assert not filter_.update(false, 1.01)
        assert filter_.was_contradicted
        harmless()
        assert not filter_.was_contradicted


def begun(sigma_p_m: float) -> RelativeFilter:
    filter_ = RelativeFilter(sheets(6.0, sigma_p_m=sigma_p_m), SETTINGS)
    filter_.propagate([ImuSample(time_stamp_s=0.0, angular_rate_rad_s=np.zeros(3))])
    return filter_


def struck_filter() -> tuple[RelativeFilter, list[tuple[PoseEstimate, float]]]:
    """A filter that took a frame, then refused two that show the drogue 0.1 m aside, doubts, and takes the third."""
    filter_, frames = begun(0.005), []
    for k, aside_m in enumerate((0.0, 0.1, 0.1, 0.1)):
        time_s = 0.04 + 0.002 * k
        frames.append((seen_from(filter_, time_s, (0.0, aside_m, 0.0)), time_s))
        assert filter_.update(*frames[-1]) == (k in (0, 3))
    assert filter_.doubted_s == frames[-1][1]
    return filter_, frames


def test_the_innovation_is_that_of_the_belief_before_it_was_widened():
    filter_, _ = struck_filter()
    value, freedom = filter_.innovation
    assert freedom == 16 and value > chi2.ppf(SETTINGS.gate_probability, 16)


def test_a_late_frame_leaves_a_doubt_after_it_as_it_was():
    """To the last bit as if it had come in time, before the blow."""
    late, frames = struck_filter()
    in_time = begun(0.005)
    early = seen_from(in_time, 0.02, (0.0, 1e-3, 0.0)), 0.02
    assert late.update(*early)
    assert in_time.update(*early)
    assert [in_time.update(*frame) for frame in frames] == [True, False, False, True]
    assert late.doubted_s == in_time.doubted_s == frames[-1][1]
    np.testing.assert_array_equal(state_of(late, 0.1), state_of(in_time, 0.1))


def test_the_newest_doubt_is_told_though_late_frames_are_doubted_after_it():
    filter_, frames = struck_filter()
    late = [(seen_from(filter_, 0.04 + 5e-4 * k, (0.0, -0.1, 0.0)), 0.04 + 5e-4 * k) for k in (1, 2, 3)]
    assert [filter_.update(*frame) for frame in late] == [False, False, True]
    assert filter_.doubted_s == frames[-1][1]


def test_a_frame_that_a_late_one_shows_to_be_false_is_taken_back():
    """Within the start's 0.2 m the drogue may be 0.8 m aside; not a millisecond after it was seen elsewhere."""
    filter_, twin = begun(0.2), begun(0.2)
    false, true = seen_from(filter_, 0.021, (0.0, 0.8, 0.0)), seen_from(filter_, 0.02, (0.0, 0.0, 0.0))
    assert filter_.update(false, 0.021) and filter_.update(true, 0.02)
    assert twin.update(true, 0.02) and not twin.update(false, 0.021)
    np.testing.assert_allclose(state_of(filter_, 0.021), state_of(twin, 0.021), atol=1e-12)


@pytest.mark.parametrize(("age_s", "grows"), [(0.1, True), (0.3, False)])
def test_a_rate_that_is_held_makes_the_tip_s_velocity_uncertain_by_the_lever(age_s, grows):
    """By 0.05 rad/s within 0.25 s and no more, since the middle of the samples that are averaged, times r = p_IP."""
    filter_ = RelativeFilter(sheets(6.0), SETTINGS)
    filter_.propagate([ImuSample(time_stamp_s=k / 250.0, angular_rate_rad_s=np.zeros(3)) for k in range(26)])
    P = filter_._buffer.beliefs(0.1 + age_s)[0].P
    shown = np.zeros((3, ERRORS))
    shown[:, VELOCITY], shown[:, BIAS] = np.eye(3), -skew(TIP_FROM_IMU)
    since_s = age_s + 0.004  # at 250 Hz three samples last 0.01 s
    rate2 = (0.05 * since_s / 0.25) ** 2 if grows else 0.05**2
    expected = shown @ P @ shown.T + rate2 * skew(TIP_FROM_IMU) @ skew(TIP_FROM_IMU).T
    np.testing.assert_allclose(filter_.state(0.1 + age_s).covariance[6:, 6:], expected, rtol=1e-9)


def test_what_was_foretold_is_what_is_believed_without_the_frames_since():
    """Frames until 0.2 s, samples until 0.4 s: the newest frame that is 0.1 s old is of 0.2 s; asked for older ones."""
    world = World(sheets(6.0), SETTINGS, np.random.default_rng(72))
    filter_, blind = RelativeFilter(world.sheets, SETTINGS), RelativeFilter(world.sheets, SETTINGS)
    for k in range(101):
        sample, pixels = world.step() if k else world.gyro(), world.pixels(0.1)
        for each, last in ((filter_, 50), (blind, 40)):
            each.propagate([sample])
            if k % 5 == 0 and k <= last:
                assert each.update(solve(each, pixels, world.time_s, 0.1), world.time_s)
    for horizon_s, age_s, alike in ((0.1, 0.2, filter_), (0.2, 0.2, filter_), (0.23, 0.24, blind), (0.24, 0.24, blind)):
        foretold_m, unseen_s = filter_.foretold_p_PD_B(world.time_s, horizon_s + 4e-7)  # to the microsecond
        assert unseen_s == pytest.approx(age_s, abs=1e-9)
        np.testing.assert_allclose(foretold_m, alike.p_PD_B(world.time_s), atol=1e-9)
    foretold_m, unseen_s = filter_.foretold_p_PD_B(world.time_s, 0.41)
    assert np.isnan(foretold_m).all() and np.isnan(unseen_s)


@pytest.mark.parametrize(("look_back_s", "kept"), [(0.0, False), (0.4, True)])
def test_frames_are_kept_to_be_asked_for_as_long_as_is_looked_back(look_back_s, kept):
    """One frame, then 0.8 s of samples: a second node after 0.45 s would have it forgotten."""
    world = World(sheets(6.0), SETTINGS, np.random.default_rng(73))
    filter_ = RelativeFilter(world.sheets, SETTINGS, look_back_s=look_back_s)
    filter_.propagate([world.gyro()])
    assert filter_.update(solve(filter_, world.pixels(0.1), 0.0, 0.1), 0.0)
    filter_.propagate([world.step() for _ in range(200)])
    assert np.isfinite(filter_.foretold_p_PD_B(world.time_s, 0.8)[0]).all() == kept


def test_before_all_that_is_kept_the_oldest_belief_is_told():
    world = World(sheets(6.0), SETTINGS, np.random.default_rng(74))
    filter_ = RelativeFilter(world.sheets, SETTINGS)
    assert all(fly(world, filter_, 0.4))
    oldest = filter_._buffer._nodes[0]
    np.testing.assert_array_equal(state_of(filter_, -1.0)[:9], oldest.beliefs[0].R_BD.ravel())
    np.testing.assert_array_equal(filter_.p_PD_B(-1.0), oldest.beliefs[0].p_ID - TIP_FROM_IMU)


def test_one_led_is_refused_once_in_ten_thousand():
    """Two degrees of freedom: chi-square of 18.4, crossed between two of the places where it is seen."""
    taken = []
    for off_px in np.linspace(150.0, 300.0, 31):
        filter_ = RelativeFilter(sheets(6.0), SETTINGS)
        R, p, _ = filter_.predicted_pose(0.0)
        pixels = CAMERA.pixels_from_points(RING[:1] @ R.T + p) + [off_px, 0.0]
        taken.append(filter_.update_leds(pixels, RING[:1], np.array([0.1]), 0.0))
        value, freedom = filter_.innovation
        assert freedom == 2 and taken[-1] == (value <= chi2.ppf(0.9999, 2))
    assert taken[0] and not taken[-1]


def test_the_gyro_s_bias_that_is_told_is_the_one_that_is_taken_off():
    """A rate of nothing but bias, learnt in 2 s of frames: what is left of it is small."""
    calm = replace(SETTINGS, attitude_density=0.002)
    world = World(sheets(4.0), calm, np.random.default_rng(75))
    world.bias_B = np.array([0.01, -0.02, 0.015])
    sheet = replace(world.sheets, gyro=replace(GYRO, bias_sigma_rad_s=0.02))
    filter_ = RelativeFilter(sheet, calm)
    assert np.mean(list(fly(world, filter_, 2.0))) > 0.9
    np.testing.assert_allclose(filter_.bias_B, world.bias_B, atol=0.004)
    np.testing.assert_allclose(filter_.mean_rate_B(world.time_s, 0.01), world.rate(world.time_s - 0.004), atol=0.02)


def test_a_frame_as_late_as_may_be_is_the_frame_in_time_to_the_last_bit():
    """0.44 s, after a second in which what is older was forgotten all the time."""
    world = World(sheets(6.0), SETTINGS, np.random.default_rng(76))
    samples = [world.gyro()] + [world.step() for _ in range(250)]
    in_time, late = RelativeFilter(world.sheets, SETTINGS), RelativeFilter(world.sheets, SETTINGS)
    stamp_s = samples[140].time_stamp_s
    in_time.propagate(samples[:141])
    pose = seen_from(in_time, stamp_s, (0.05, 0.01, 0.02))
    assert in_time.update(pose, stamp_s)
    for sample in samples[141:]:
        in_time.propagate([sample])
    for sample in samples:
        late.propagate([sample])
    assert late.update(pose, stamp_s)
    np.testing.assert_array_equal(state_of(late, 1.0), state_of(in_time, 1.0))


def test_the_first_force_is_the_formation_s_of_frames_before_it_too():
    """A receiver in steady flight, a frame, and then the first sample: the drogue does not fall."""
    filter_ = RelativeFilter(sheets(6.0), SETTINGS)
    assert filter_.update(seen_from(filter_, 5.0, (0.0, 0.0, 0.0)), 5.0)
    before_m = filter_.p_PD_B(5.0)
    f_I = MOUNTING.R_BI.T @ -GRAVITY_N
    still = [
        ImuSample(time_stamp_s=5.004 + k / 250.0, angular_rate_rad_s=np.zeros(3), specific_force_m_s2=f_I)
        for k in range(50)
    ]
    filter_.propagate(still)
    np.testing.assert_allclose(filter_.p_PD_B(5.2), before_m, atol=1e-4)


def test_what_was_foretold_in_a_silence_is_forgotten_once_a_sample_ends_it():
    """Asked in the silence or not, two filters say the same after it."""
    asked, quiet = RelativeFilter(sheets(6.0)), RelativeFilter(sheets(6.0))
    w_I = np.array([0.2, -0.1, 0.3])
    for filter_ in (asked, quiet):
        filter_.propagate([ImuSample(time_stamp_s=k / 250.0, angular_rate_rad_s=0.0 * w_I) for k in range(26)])
    asked.state(0.6)  # longer than the buffer
    again = [ImuSample(time_stamp_s=time_s, angular_rate_rad_s=w_I) for time_s in (0.65, 0.654)]
    for filter_ in (asked, quiet):
        assert filter_.propagate(again) == again[1:]  # the first one leaps
    np.testing.assert_array_equal(state_of(asked, 0.7), state_of(quiet, 0.7))


def test_two_hypotheses_are_told_as_their_mixture():
    """Frontal at 20 m, 0.1 rad either way: of both together the attitude is uncertain by what they are apart."""
    far = sheets(20.0, sigma_R_rad=0.14)
    far = replace(far, start=replace(far.start, R_BD=MOUNTING.R_BC))
    filter_ = RelativeFilter(far, SETTINGS)
    _, p, _ = filter_.predicted_pose(0.0)
    pixels = CAMERA.pixels_from_points(RING @ matrix_from_yaw_pitch_roll(0.0, 0.1, 0.0).T + p)
    assert filter_.update(solve_pose(pixels, RING, CAMERA, sigma_px=0.1), 0.0)
    beliefs, state = filter_._buffer.beliefs(0.0), filter_.state(0.0)
    assert len(beliefs) == 2
    both = mixture(beliefs)
    np.testing.assert_array_equal(state.R_BD, both.R_BD)
    np.testing.assert_array_equal(state.p_PD_B, both.p_ID - TIP_FROM_IMU)
    assert np.trace(state.covariance[:3, :3]) > np.trace(beliefs[0].P[:3, :3]) + 0.1 * 0.2**2


def test_of_other_leds_no_more_is_known_than_at_the_start():
    """Their places are the sheet's, to 0.3 mm each, where the drogue was rolled by an LED."""
    filter_ = RelativeFilter(sheets(6.0), FusionSettings())
    assert filter_.update(seen_from(filter_, 0.0, (0.0, 0.01, 0.0)), 0.0)
    assert np.abs(filter_.led_points_D(0.0) - RING).max() > 0.0
    filter_.turn_drogue(np.pi / 4, 0.0)
    np.testing.assert_array_equal(filter_.led_points_D(0.0), RING)
    np.testing.assert_allclose(filter_._buffer.beliefs(0.0)[0].P[LED_PLACES, LED_PLACES], 9e-8 * np.eye(16))


def test_a_sample_that_is_near_the_newest_frame_is_no_leap():
    """The IMU was out for 0.2 s, in which frames came."""
    filter_ = begun(0.2)
    for time_s in (0.1, 0.2):
        assert filter_.update(seen_from(filter_, time_s, (0.0, 0.0, 0.0)), time_s)
    sample = ImuSample(time_stamp_s=0.204, angular_rate_rad_s=np.zeros(3))
    assert filter_.propagate([sample]) == [sample]
