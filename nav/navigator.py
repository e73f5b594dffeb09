"""The stages in order: gyro and frame in, belief and command out.

    frame ► detect ► identify ► track ► pose ► fusion ► guidance ► command
    gyro  ────────────────────────────────────┘

Only this file knows the order. Everything it knows of its hardware arrives as `NavigationSheets`.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from dockair.calibration import NavigationSheets
from dockair.errors import DockairError
from dockair.messages import CameraFrame, ImuSample, NavSolution
from dockair.nav.fusion import FusionSettings, RelativeFilter
from dockair.nav.guidance.approach import Guidance, GuidanceSettings, RelativeState
from dockair.nav.identify.octagon import SLOTS
from dockair.nav.identify.ring import IdentificationStatus, identify
from dockair.nav.image.detect import Blobs, DetectSettings, detect
from dockair.nav.pose.estimate import PoseStatus, solve_pose
from dockair.nav.track import RingTracker, TrackSettings
from dockair.rotations import Array


@dataclass(frozen=True, slots=True, kw_only=True)
class NavigatorSettings:
    """Settings of every stage."""

    detect: DetectSettings = field(default_factory=DetectSettings)
    track: TrackSettings = field(default_factory=TrackSettings)
    fusion: FusionSettings = field(default_factory=FusionSettings)
    guidance: GuidanceSettings = field(default_factory=GuidanceSettings)
    led_position_sigma_m: float = 3e-4  # as-built tolerance of an LED's place on the ring; 0.3 px at 3 m
    usable_sigma_m: float = 0.10  # lateral 1 sigma above which the state may not be flown on
    usable_age_s: float = 0.5  # breakaway practice: a track lost for 0.5 s is lost


class Navigator:
    """The navigation that Dockair flies; see `messages.Navigates` for what any other must offer.

    Raises:
        DockairError: a ring of other than eight LEDs.
    """

    def __init__(self, sheets: NavigationSheets, settings: NavigatorSettings | None = None) -> None:
        if sheets.ring.count != SLOTS:
            raise DockairError(
                "ring.count", expected=f"{SLOTS} LEDs, the ring that can be identified", got=sheets.ring.count
            )
        self._sheets, self._settings = sheets, settings or NavigatorSettings()
        self._filter = RelativeFilter(sheets, self._settings.fusion)
        self._tracker = RingTracker(sheets.camera, 1.0 / sheets.camera_rate_hz, self._settings.track)
        self._guidance = Guidance(self._settings.guidance, sheets.control_rate_hz)
        self._points_D = sheets.ring.positions_D
        self._time_s = 0.0
        self._frame_time_s = self._used_time_s = float("nan")
        self._status = "no frame yet"
        self._candidates_px: Array = np.empty((0, 2))
        self._led_pixels_px: Array = np.full((len(self._points_D), 2), np.nan)

    def step(self, imu: Sequence[ImuSample], frame: CameraFrame | None) -> NavSolution:
        """Take the gyro samples and the frame that arrived since the last control tick."""
        if imu:
            self._time_s = imu[-1].time_stamp_s
            self._filter.propagate(imu)
        else:  # the IMU has dropped out: the last rate is held
            self._time_s += 1.0 / self._sheets.control_rate_hz
        if frame is not None:
            self._take(frame)
        return self._solution()

    def _take(self, frame: CameraFrame) -> None:
        """Pixels to pose to belief; every way out leaves its reason in the status."""
        blobs = detect(frame.pixels, self._settings.detect, frame.window, gain_dn_per_electron=frame.gain)
        self._candidates_px = blobs.centroids_px
        self._led_pixels_px = np.full((len(self._points_D), 2), np.nan)
        self._tracker.predict(self._shift_px(frame.time_stamp_s, self._frame_time_s))
        self._frame_time_s = frame.time_stamp_s
        self._status = self._use(blobs, frame.time_stamp_s)

    def _use(self, blobs: Blobs, time_s: float) -> str:
        expected_px, sigma_px = self._filter.predicted_led_pixels(time_s)
        found = identify(
            blobs.centroids_px,
            camera=self._sheets.camera,
            brightness=blobs.flux,
            expected_led_px=expected_px,
            expected_sigma_px=float(np.nanmax(sigma_px)) if np.isfinite(sigma_px).any() else None,
        )
        self._tracker.update(found)
        if found.status is not IdentificationStatus.FOUND:
            return f"ring {found.status.value}"
        self._led_pixels_px[found.led_numbers] = blobs.centroids_px[found.members]
        R_CD, p_CD, _ = self._filter.predicted_pose(time_s)
        misplaced_px = self._sheets.camera.focal_length_px * self._settings.led_position_sigma_m / p_CD[0]
        pose = solve_pose(
            blobs.centroids_px[found.members],
            self._points_D[found.led_numbers],
            self._sheets.camera,
            sigma_px=np.hypot(blobs.sigma_px[found.members], misplaced_px),
            initial=(R_CD, p_CD),
        )
        if pose.status is not PoseStatus.CONVERGED:
            return f"pose {pose.status.value}"
        if not self._filter.update(pose, time_s):
            return "pose refused by the gate"
        self._used_time_s = time_s
        return "pose used"

    def _shift_px(self, time_s: float, before_s: float) -> Array | None:
        """(2,) image shift on the axis that the camera's own rotation made between two times."""
        if not np.isfinite(before_s):
            return None
        w_C = self._sheets.mounting.R_BC.T @ self._filter.rate_B(0.5 * (time_s + before_s))
        # a still point on the axis moves by -w x (1, 0, 0) = (0, -w_z, w_y); u and v run against y and z
        return np.asarray(self._sheets.camera.focal_length_px * (time_s - before_s) * np.array([w_C[2], -w_C[1]]))

    def _solution(self) -> NavSolution:
        state = self._filter.state(self._time_s)
        sigma_lateral_m = float(np.sqrt(np.linalg.eigvalsh(state.covariance[4:6, 4:6])[-1]))
        aged_s = self._time_s - self._used_time_s
        valid = sigma_lateral_m <= self._settings.usable_sigma_m and aged_s <= self._settings.usable_age_s
        command = self._guidance.step(
            RelativeState(
                usable=valid,
                p_PD_B=state.p_PD_B,
                rate_PD_B=state.rate_PD_B,
                p_PK_B=state.p_PD_B + self._sheets.coupling_depth_m * state.R_BD[:, 0],
                sigma_lateral_m=sigma_lateral_m,
            )
        )
        next_s = self._frame_time_s + 1.0 / self._sheets.camera_rate_hz
        return NavSolution(
            time_stamp_s=self._time_s,
            valid=valid,
            phase=self._guidance.phase.value,
            status=self._status,
            p_PD_B=state.p_PD_B,
            v_PD_B=state.v_PD_B,
            R_BD=state.R_BD,
            covariance=state.covariance if valid else np.full((9, 9), np.nan),
            command=command,
            window=self._tracker.window(self._shift_px(next_s, self._frame_time_s)),
            frame_time_stamp_s=self._used_time_s,
            candidates_px=self._candidates_px,
            led_pixels_px=self._led_pixels_px,
        )
