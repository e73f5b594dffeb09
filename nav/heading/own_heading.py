"""The receiver's heading as a navigator keeps it: when to ask for a frame, what of it counts, how sure the result is.

    IMU ─────────────────────────────────────────────► heading_filter ► heading, roll, pitch, bias
    every `every_s` a full frame of a long exposure ► visual ─┘ turn

LEDs want 20 us, cloud deck and ground 500 us: a frame of its own is asked for, of which one camera period takes one.
What is above the level holds tanker and sky, the probe moves with the camera, the drogue swings: all are masked.

Not modelled: what else of the receiver than its probe is in view; correlation with the errors of the drogue's place.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field

import cv2
import numpy as np
from numpy.typing import NDArray

from dockair.calibration import NavigationSheets
from dockair.errors import DockairError, check_numbers
from dockair.messages import CameraFrame, ImuSample
from dockair.nav.heading.heading_filter import HeadingFilter, HeadingFilterSettings
from dockair.nav.heading.turn import TurnStatus, VisualSettings
from dockair.nav.heading.visual import VisualHeading
from dockair.rotations import Array, exp

_GRID_PX = 8  # between the rays of the mask
_PROBE_POINTS = 60  # along the probe; closer than its own radius in the picture
_NEAREST_M = 0.3  # of the probe to the lens that is drawn


@dataclass(frozen=True, slots=True, kw_only=True)
class OwnHeadingSettings:
    """When frames are asked for, and what is known of the flight.

    Raises:
        DockairError: a number that is not positive.
    """

    airspeed_m_s: float  #: of the formation, as it was briefed
    every_s: float = 2.0  #: in a bank of 25 degrees 3 degrees of turn: most of the view is shared
    exposure_s: float = 500e-6  #: deck and ground are 10 to 50 of 255 grey levels bright then
    drogue_radius_m: float = 0.6  #: about the ring's centre: basket and swing
    probe_radius_m: float = 0.15  #: about its axis
    probe_length_m: float = 3.0  #: behind its tip
    filter: HeadingFilterSettings = field(default_factory=HeadingFilterSettings)
    visual: VisualSettings = field(default_factory=VisualSettings.for_aircraft)

    def __post_init__(self) -> None:
        check_numbers("heading", self)


class OwnHeading:
    """Stepped at every control tick.

    Args:
        sheets: camera, mounting, gyro, rates.
        settings: constants.

    Raises:
        DockairError: frames are asked for so often that none would show LEDs; what `HeadingFilter` refuses.
    """

    def __init__(self, sheets: NavigationSheets, settings: OwnHeadingSettings) -> None:
        if not settings.every_s * sheets.camera_rate_hz > 1.0:
            expected = f"more than a camera's period, {1.0 / sheets.camera_rate_hz:g} s, or no frame would show LEDs"
            raise DockairError("heading.every_s", expected=expected, got=settings.every_s)
        self._sheets, self._settings = sheets, settings
        self._filter = HeadingFilter(sheets.gyro, sheets.mounting, settings.airspeed_m_s, settings.filter)
        self._visual = VisualHeading(sheets.camera, settings.visual)
        self._next_s, self._until_s = -np.inf, -np.inf  # when to ask next; until when what was asked stands
        self._rays_C = self._grid()

    def ask(self, time_s: float) -> float:
        """Return the exposure to ask of the next frame [s], a full one; NaN for none. One frame takes it."""
        if self._is_known and self._filter.is_level and time_s >= self._next_s:
            self._next_s = time_s + self._settings.every_s
            self._until_s = time_s + 1.0 / self._sheets.camera_rate_hz
        half_tick_s = 0.5 / self._sheets.control_rate_hz
        return self._settings.exposure_s if time_s < self._until_s - half_tick_s else float("nan")

    def was_asked(self, frame: CameraFrame) -> bool:
        """Whether a frame is the one that was asked for: in the dark the camera may expose others as long."""
        half_tick_s = 0.5 / self._sheets.control_rate_hz
        begun_s = self._until_s - 1.0 / self._sheets.camera_rate_hz
        in_time = begun_s - half_tick_s < frame.time_stamp_s < self._until_s + half_tick_s
        full = frame.window == self._sheets.camera.full_window
        return in_time and full and bool(np.isclose(frame.exposure_s, self._settings.exposure_s))

    @property
    def heading_rad(self) -> float:
        """Since the first sample, to the left, not wrapped; NaN before it, and once the gyro was away for too long."""
        return self._filter.heading_rad if self._is_known else float("nan")

    @property
    def sigma_rad(self) -> float:
        """Standard deviation of the heading; NaN where there is none."""
        return self._filter.sigma_rad if self._is_known else float("nan")

    @property
    def _is_known(self) -> bool:
        return bool(np.isfinite(self._filter.time_stamp_s)) and not self._filter.is_lost

    def step(self, imu: Sequence[ImuSample], frame: CameraFrame | None, p_CD: Array) -> TurnStatus | None:
        """Take what arrived since the last step; return what came of the frame, None without one that can be used.

        Args:
            imu: samples.
            frame: that was asked for.
            p_CD: (3,) the ring's centre there [m].
        """
        self._filter.propagate(imu)
        if frame is None or not self._is_known:
            return None
        predicted_rad = self._filter.predicted_turn_rad(frame.time_stamp_s)
        if predicted_rad is None:
            return None
        R_LB, before_rad = self._filter.R_LB_at(frame.time_stamp_s), self._visual.heading_rad
        to_visual = exp(np.array([0.0, 0.0, before_rad + predicted_rad]))  # its own heading, here
        self._visual.tilt(to_visual @ self._filter.tilt_L(), self._sheets.mounting.R_BC)
        mask, R_LC = self._mask(R_LB, p_CD), R_LB @ self._sheets.mounting.R_BC
        turn = self._visual.step(frame.pixels, mask=mask, R_HC=R_LC, predicted_turn_rad=predicted_rad)
        measured = turn.status is TurnStatus.MEASURED
        self._filter.see(frame.time_stamp_s, self._visual.heading_rad - before_rad if measured else None)
        return turn.status

    def _grid(self) -> Array:
        """(rows, columns, 3) rays of the mask's coarse pixels."""
        camera = self._sheets.camera
        u, v = np.meshgrid(*(np.arange(_GRID_PX // 2, n, _GRID_PX) for n in (camera.width_px, camera.height_px)))
        return camera.rays_from_pixels(np.column_stack([u.ravel(), v.ravel()])).reshape(*u.shape, 3)

    def _mask(self, R_LB: Array, p_CD: Array) -> NDArray[np.bool_]:
        """(h, w) where features may lie: below the level, off the drogue and the probe."""
        camera, mounting, s = self._sheets.camera, self._sheets.mounting, self._settings
        below = (self._rays_C @ (R_LB @ mounting.R_BC)[2] < 0.0).astype(np.uint8)
        size = camera.width_px, camera.height_px
        mask = cv2.resize(below, size, interpolation=cv2.INTER_NEAREST)
        tip_C = mounting.R_BC.T @ (mounting.p_BP - mounting.p_BC)
        aft_C = -mounting.R_BC[0]  # the probe lies along the body's x axis
        places = tip_C + np.linspace(-s.probe_radius_m, s.probe_length_m, _PROBE_POINTS)[:, None] * aft_C
        discs = [(place, s.probe_radius_m) for place in places] + [(np.asarray(p_CD), s.drogue_radius_m)]
        for place, radius_m in discs:
            if place[0] > _NEAREST_M:
                (u, v), radius = camera.pixels_from_points(place)[0], camera.focal_length_px * radius_m / place[0]
                if -radius < u < size[0] + radius and -radius < v < size[1] + radius:  # far off, OpenCV overflows
                    cv2.circle(mask, (round(u), round(v)), round(radius), 0, thickness=-1)
        return np.asarray(mask > 0)
