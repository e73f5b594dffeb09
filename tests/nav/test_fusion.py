"""The relative filter against a kinematic world that obeys its assumptions, written here without it."""

from dataclasses import dataclass, replace

import numpy as np
import pytest
from scipy.stats import chi2

from dockair.calibration import Camera, GyroSheet, LedRing, Mounting, NavigationSheets, StartGeometry
from dockair.messages import ImuSample
from dockair.nav.fusion import FusionSettings, RelativeFilter
from dockair.nav.pose.estimate import PoseEstimate, solve_pose
from dockair.rotations import Array, exp, log, matrix_from_yaw_pitch_roll

RING, CAMERA = LedRing().positions_D, Camera()
MOUNTING = Mounting(
    R_BC=matrix_from_yaw_pitch_roll(-0.05, 0.02, 0.1),
    p_BC=np.array([3.3, -0.45, 0.75]),
    p_BP=np.array([6.0, -0.9, 0.6]),
    R_BI=matrix_from_yaw_pitch_roll(0.3, -0.2, 0.1),
)
GYRO = GyroSheet(rate_hz=250, noise_density_rad_s_rthz=1.7e-4, bias_sigma_rad_s=0.0)
SETTINGS = FusionSettings(start_velocity_sigma_m_s=0.3)
STILL = replace(SETTINGS, acceleration_density=1e-6, attitude_density=1e-6, start_velocity_sigma_m_s=1e-6)


def sheets(distance_m: float, sigma_R_rad: float = 0.05, sigma_p_m: float = 0.2) -> NavigationSheets:
    start = StartGeometry(
        p_PD_B=np.array([distance_m, 0.3, -0.2]),
        sigma_p_m=np.full(3, sigma_p_m),
        R_BD=matrix_from_yaw_pitch_roll(0.05, -0.08, 0.1),
        sigma_R_rad=sigma_R_rad,
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
    """Receiver turning smoothly, drogue with random acceleration; axes N do not turn. Advances by gyro steps."""

    sheets: NavigationSheets
    settings: FusionSettings
    rng: np.random.Generator
    turn_rad_s: float = 0.15

    def __post_init__(self) -> None:
        start, rng = self.sheets.start, self.rng
        self.k, self.dt, self.R_NB = 0, 1.0 / GYRO.rate_hz, np.eye(3)
        self.R_ND = exp(start.sigma_R_rad * rng.normal(size=3)) @ start.R_BD
        self.s_N = start.p_PD_B + MOUNTING.p_BP + start.sigma_p_m * rng.normal(size=3)
        self.v_N = self.settings.start_velocity_sigma_m_s * rng.normal(size=3)

    @property
    def time_s(self) -> float:
        return self.k * self.dt

    def rate(self, time_s: float) -> Array:
        return self.turn_rad_s * np.sin(2.0 * time_s + np.array([0.0, 1.0, 2.0]))

    def step(self) -> ImuSample:
        dt, s = self.dt, self.settings
        a, b = self.rng.normal(size=(2, 3)) * s.acceleration_density  # exact double integral of white noise
        self.s_N = self.s_N + self.v_N * dt + dt**1.5 * (a / 2.0 + b / np.sqrt(12.0))
        self.v_N = self.v_N + a * np.sqrt(dt)
        self.R_ND = exp(s.attitude_density * np.sqrt(dt) * self.rng.normal(size=3)) @ self.R_ND
        self.R_NB = self.R_NB @ exp(self.rate(self.time_s + 0.5 * dt) * dt)
        self.k += 1
        return self.gyro()

    def gyro(self) -> ImuSample:
        noise = GYRO.noise_density_rad_s_rthz * np.sqrt(GYRO.rate_hz) * self.rng.normal(size=3)
        w_I = MOUNTING.R_BI.T @ self.rate(self.time_s) + noise
        return ImuSample(time_stamp_s=self.time_s, angular_rate_rad_s=w_I)

    def pixels(self, sigma_px: float) -> Array:
        R_BD, s_B = self.R_NB.T @ self.R_ND, self.R_NB.T @ self.s_N
        p_C = (s_B + RING @ R_BD.T - MOUNTING.p_BC) @ MOUNTING.R_BC
        return CAMERA.pixels_from_points(p_C) + sigma_px * self.rng.normal(size=(len(RING), 2))

    def error(self, filter_: RelativeFilter) -> tuple[Array, Array]:
        """Error of (phi, p_PD_B, v_PD_B) and the covariance that the filter states."""
        state = filter_.state(self.time_s)
        R_BD, s_B, v_B = self.R_NB.T @ self.R_ND, self.R_NB.T @ self.s_N, self.R_NB.T @ self.v_N
        v_PD_B = v_B - np.cross(self.rate(self.time_s), MOUNTING.p_BP)
        return np.concatenate(
            [log(R_BD @ state.R_BD.T), s_B - MOUNTING.p_BP - state.p_PD_B, v_PD_B - state.v_PD_B]
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
