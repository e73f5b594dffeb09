"""The stages in order: gyro and frame in, belief and command out.

    frame ► detect ► identify ► track ► pose ► fusion ► guidance ► command
    gyro  ────────────────────────────────────┘

Only this file knows the order. Everything it knows of its hardware arrives as `NavigationSheets`.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from dockair.calibration import NavigationSheets
from dockair.messages import CameraFrame, ImuSample, NavSolution
from dockair.nav.fusion import FusionSettings, RelativeFilter
from dockair.nav.guidance.approach import Guidance, GuidanceSettings, RelativeState
from dockair.nav.identify.ring import Identification, IdentificationStatus, identify
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
    usable_sigma_m: float = 0.10  # lateral 1 sigma above which the state may not be flown on


class Navigator:
    """The navigation that Dockair flies; see `messages.Navigates` for what any other must offer."""

    def __init__(self, sheets: NavigationSheets, settings: NavigatorSettings | None = None) -> None:
        self._sheets, self._settings = sheets, settings or NavigatorSettings()
        self._filter = RelativeFilter(sheets, self._settings.fusion)
        self._tracker = RingTracker(sheets.camera, 1.0 / sheets.camera_rate_hz, self._settings.track)
        self._guidance = Guidance(self._settings.guidance, sheets.control_rate_hz)
        self._points_D = sheets.ring.positions_D
        self._time_s = 0.0
        self._frame_time_s = float("nan")
        self._seen = False
        self._status = "no frame yet"
        self._candidates_px: Array = np.empty((0, 2))
        self._led_pixels_px: Array = np.full((len(self._points_D), 2), np.nan)

    def step(self, imu: Sequence[ImuSample], frame: CameraFrame | None) -> NavSolution:
        """Take the gyro samples and the frame that arrived since the last control tick."""
        if imu:
            self._time_s = imu[-1].time_stamp_s
            self._filter.propagate(imu)
        if frame is not None:
            self._take_frame(frame)
        return self._solution()
