"""The relative filter on a made-up approach: its errors and what it says of them, frame after frame."""

from collections import deque
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from dockair.messages import NavSolution
from dockair.nav.fusion import FilterState, FusionSettings, RelativeFilter
from dockair.nav.pose.estimate import solve_pose
from dockair.nav.pose.planar import mirrored
from dockair.rotations import Array, log
from dockair.scenarios.reproduce.fusion.flight import Flown

_MIRROR_APART_RAD = np.deg2rad(3.0)  # below, the two minima are one


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Track:
    """Errors of one approach, true less believed; arrays over frames, whether they could be used or not."""

    time_s: Array
    range_m: Array  #: true, from the camera
    error: Array  #: (k, 9) of (phi, p_PD_B, v_PD_B), when the frame arrives
    covariance: Array  #: (k, 9, 9)
    error_C: Array  #: (k, 6) of the pose as seen, at the frame's own stamp: (phi, delta) in camera axes
    nis: Array  #: (k,) NaN where no frame was offered
    freedom: Array  #: (k,) of nis
    used: Array  #: (k,) bool
    wrong_side: Array  #: (k,) bool: the attitude believed is nearer to the mirror image of the true one

    @property
    def nees(self) -> Array:
        """(k,) normalised estimation error squared, nine degrees of freedom."""
        return np.array([e @ np.linalg.solve(P, e) for e, P in zip(self.error, self.covariance, strict=True)])


@dataclass(frozen=True, slots=True, kw_only=True)
class Watching:
    """What the filter is given of the approach."""

    settings: FusionSettings
    sigma_px: float = 0.1
    seen: Callable[[float], bool] = lambda time_s: True  #: whether the camera works at a time
    leds: Callable[[float], int] = lambda time_s: 8  #: how many LEDs are seen at a time
    turned: Callable[[float], bool] = lambda time_s: True  #: whether the IMU works at a time
    latency_s: float = 0.0  #: from exposure to the filter


def follow(flown: Flown, watching: Watching, rng: np.random.Generator) -> Track:
    """Run a filter along an approach."""
    sheets, rows = flown.sheets, []
    filter_ = RelativeFilter(sheets, watching.settings)
    every = sheets.gyro.rate_hz // sheets.camera_rate_hz
    waiting: deque[tuple[int, Array]] = deque()
    late = round(watching.latency_s * sheets.gyro.rate_hz)
    for tick, sample in enumerate(flown.imu):
        if watching.turned(sample.time_stamp_s):
            filter_.propagate([sample])
        if tick % every:
            continue
        waiting.append((tick, flown.pixels(tick, watching.sigma_px, rng)))
        if waiting[0][0] + late > tick:
            continue
        taken, pixels = waiting.popleft()
        used, offered = _offer(filter_, flown, watching, taken, pixels)
        if taken == tick or len(waiting) >= late // every:
            rows.append(_row(filter_, flown, tick, taken, used, offered))
    columns = [np.array(column) for column in zip(*rows, strict=True)]
    names = ("time_s", "range_m", "error", "covariance", "error_C", "nis", "freedom", "used", "wrong_side")
    return Track(**dict(zip(names, columns, strict=True)))


def _offer(filter_: RelativeFilter, flown: Flown, watching: Watching, tick: int, pixels: Array) -> tuple[bool, bool]:
    """Give the filter a frame; return whether it was used, and whether there was one."""
    sheets, time_s = flown.sheets, float(flown.time_s[tick])
    count = watching.leds(time_s) if watching.seen(time_s) else 0
    if count == 0:
        return False, False
    R_CD, p_CD, _ = filter_.predicted_pose(time_s)
    sigma_px = np.full(len(pixels), watching.sigma_px)
    points_D = sheets.ring.positions_D
    if count < 4:
        return filter_.update_leds(pixels[:count], points_D[:count], sigma_px[:count], time_s), True
    pose = solve_pose(pixels, points_D, sheets.camera, sigma_px=sigma_px, initial=(R_CD, p_CD))
    return filter_.update(pose, time_s), True


def _row(filter_: RelativeFilter, flown: Flown, tick: int, taken: int, used: bool, offered: bool) -> tuple[object, ...]:
    mounting, nominal, R_NB = flown.built.mounting, flown.sheets.mounting, flown.R_NB[taken]
    state = filter_.state(float(flown.time_s[tick]))
    R_CD_seen, p_CD_seen, _ = filter_.predicted_pose(float(flown.time_s[taken]))
    R_CD = mounting.R_BC.T @ R_NB.T @ flown.R_ND[taken]
    p_CD = mounting.R_BC.T @ (R_NB.T @ flown.s_N[taken] + nominal.p_BI - mounting.p_BC)
    error_C = np.concatenate([log(R_CD @ R_CD_seen.T), p_CD - p_CD_seen])
    other, _ = mirrored(R_CD, p_CD, flown.sheets.ring.positions_D)
    apart, wrong = np.linalg.norm(log(other @ R_CD.T)), np.linalg.norm(log(other @ R_CD_seen.T))
    side = bool(apart > _MIRROR_APART_RAD and wrong < np.linalg.norm(error_C[:3]))
    nis, freedom = filter_.innovation if offered and filter_.innovation is not None else (np.nan, 0)
    error = true_error(flown, tick, state)
    return float(flown.time_s[tick]), p_CD[0], error, state.covariance, error_C, nis, freedom, used, side


def true_error(flown: Flown, tick: int, state: FilterState | NavSolution) -> Array:
    """(9,) of (phi, p_PD_B, v_PD_B), true less believed."""
    R_NB, mounting = flown.R_NB[tick], flown.sheets.mounting
    tip = mounting.p_BP - mounting.p_BI
    p = R_NB.T @ flown.s_N[tick] - tip
    v = R_NB.T @ flown.v_N[tick] - np.cross(flown.w_B[tick], tip)
    turn = log(R_NB.T @ flown.R_ND[tick] @ state.R_BD.T)
    return np.concatenate([turn, p - state.p_PD_B, v - state.v_PD_B])


def calibrated(settings: FusionSettings) -> FusionSettings:
    """Return settings for hardware that is as its sheets say."""
    return replace(
        settings,
        camera_axes_sigma_rad=0.0,
        camera_place_sigma_m=0.0,
        focal_scale_sigma=0.0,
        ring_diameter_sigma_m=0.0,
        led_place_sigma_m=0.0,
        led_place_walk_m_rts=0.0,
    )
