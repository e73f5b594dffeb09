"""The stages in order: gyro and frame in, belief and command out.

    frame ► detect ► identify ► track ► pose ► integrity ► fusion ► guidance ► command
    gyro  ────────────────────────────────────────────────┘

Only this file knows the order. Everything it knows of its hardware arrives as `NavigationSheets`.

Two predictions of the ring exist. The belief's, which knows range, attitude and gyro, says where each LED should be; a
ring that is not there is looked for within a radius about. The track's, which knows the image and the gyro, makes the
window. When they disagree, that is when no ring is found and the window does not even show where the belief has its
LEDs, the track gives way and the full frame is read. Whether what was found is believed is the filter's gate's to say.

Which LED is which follows from the ring's roll: the track's, which knows how fast the ring turns, as long as that tells
one numbering from the next, then the belief's. While nothing is tracked (at first, after a loss) the ring is looked for
without any roll, too. A code then says which LED is which, whatever was expected; without one the numbering nearest to
the expected roll is taken, which is right up to the ring's symmetry, and for flying that is all the same. A belief of
another roll is turned by the difference. A code that contradicts the numbers of a tracked ring makes it AMBIGUOUS, so
that the track is lost and the code read again.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dockair.calibration import LedRing, NavigationSheets
from dockair.errors import DockairError
from dockair.messages import CameraFrame, ImuSample, NavSolution, TankerAnnouncement, Window
from dockair.nav.fusion import FusionSettings, RelativeFilter
from dockair.nav.guidance.approach import Guidance, GuidanceSettings, RelativeState
from dockair.nav.identify.code import CodeSettings, code_of
from dockair.nav.identify.perspective import SLOTS
from dockair.nav.identify.prior import ring_from_leds
from dockair.nav.identify.ring import Identification, IdentificationStatus, identify
from dockair.nav.image.detect import Blobs, DetectSettings, detect
from dockair.nav.integrity.contact import ContactClaim, ContactLimits, usable_for_contact
from dockair.nav.integrity.fault_test import IntegritySettings
from dockair.nav.integrity.monitor import Integrity, IntegrityStatus, check_integrity
from dockair.nav.pose.estimate import PoseStatus, solve_pose
from dockair.nav.track import RingTracker, TrackSettings
from dockair.rotations import Array

_EVEN_LEDS = 5  # four are seldom more than an accident


@dataclass(frozen=True, slots=True, kw_only=True)
class NavigatorSettings:
    """Settings of every stage."""

    detect: DetectSettings = field(default_factory=DetectSettings)
    track: TrackSettings = field(default_factory=TrackSettings)
    integrity: IntegritySettings = field(default_factory=IntegritySettings)
    contact: ContactLimits = field(default_factory=ContactLimits)
    fusion: FusionSettings = field(default_factory=FusionSettings)
    guidance: GuidanceSettings = field(default_factory=GuidanceSettings)
    led_position_sigma_m: float = 3e-4  # as-built tolerance of an LED's place on the ring; 0.3 px at 3 m
    usable_sigma_m: float = 0.10  # lateral 1 sigma above which the state may not be flown on
    turned_rad: float = np.radians(10.0)  # roll by which a belief is off that its own gate may no longer bridge
    usable_age_s: float = 0.5  # breakaway practice: a track lost for 0.5 s is lost


class Navigator:
    """The navigation that Dockair flies; see `messages.Navigates` for what any other must offer.

    Raises:
        DockairError: a ring that cannot be identified, or numbered by the code it has.
    """

    def __init__(self, sheets: NavigationSheets, settings: NavigatorSettings | None = None) -> None:
        _check_ring(sheets.ring)
        self._sheets, self._settings = sheets, settings or NavigatorSettings()
        self._filter = RelativeFilter(sheets, self._settings.fusion)
        self._tracker = RingTracker(
            sheets.camera, 1.0 / sheets.camera_rate_hz, self._settings.track,
            ring_radius_m=0.5 * sheets.ring.diameter_m, lever_C=sheets.mounting.R_BC.T @ sheets.mounting.p_BC,
        )  # fmt: skip
        self._guidance = Guidance(self._settings.guidance, sheets.control_rate_hz)
        self._points_D = sheets.ring.positions_D
        self._time_s = 0.0
        self._frame_time_s = self._used_time_s = float("nan")
        self._integrity: Integrity | None = None
        self._status = "no frame yet"
        self._candidates_px: Array = np.empty((0, 2))
        self._led_pixels_px: Array = np.full((len(self._points_D), 2), np.nan)

    def announce(self, announcement: TankerAnnouncement) -> None:
        """Take note of what the tanker is about to do."""
        self._guidance.announce(announcement)

    def step(self, imu: Sequence[ImuSample], frame: CameraFrame | None) -> NavSolution:
        """Take the gyro samples and the frame that arrived since the last control tick."""
        if self._filter.propagate(imu):
            self._time_s = self._filter.imu_time_s
        else:  # the IMU has dropped out, or says nothing that can be used: the last rate is held
            self._time_s += 1.0 / self._sheets.control_rate_hz
        if frame is not None:
            self._take(frame)
        return self._solution()

    def _take(self, frame: CameraFrame) -> None:
        """Pixels to pose to belief; every way out leaves its reason in the status."""
        blobs = detect(frame.pixels, self._settings.detect, frame.window, gain_dn_per_electron=frame.gain)
        self._candidates_px = blobs.centroids_px
        self._led_pixels_px = np.full((len(self._points_D), 2), np.nan)
        if frame.time_stamp_s > self._frame_time_s:
            self._tracker.predict(*self._turn_C(self._frame_time_s, frame.time_stamp_s))
        self._frame_time_s = frame.time_stamp_s
        self._status = self._use(blobs, frame)

    def _use(self, blobs: Blobs, frame: CameraFrame) -> str:
        time_s = frame.time_stamp_s
        found, expected_px = self._find(blobs, time_s)
        self._tracker.update(found)
        if found.status is not IdentificationStatus.FOUND:
            if not self._shown(expected_px, frame.window):
                self._tracker.lose()
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
        checked = check_integrity(pose, settings=self._settings.integrity)
        if checked.status is IntegrityStatus.INCONSISTENT:
            return f"pose {checked.status.value}"
        if checked.led is not None:
            self._led_pixels_px[found.led_numbers[checked.led]] = np.nan
        if not self._filter.update(checked.pose, time_s):
            return "pose refused by the gate"
        self._used_time_s, self._integrity = time_s, checked
        return "pose used"

    def contact_claim(self) -> ContactClaim | None:
        """Whether contact may be flown on the present belief, and why not; None before the first pose that was used."""
        if self._integrity is None:
            return None
        offset_m = self._integrity.pose.p_CD - self._filter.predicted_pose(self._used_time_s)[1]
        return usable_for_contact(
            self._integrity,
            self._time_s - self._used_time_s,
            self._settings.contact,
            levels=self._integrity.levels.about(offset_m),
        )

    def _find(self, blobs: Blobs, time_s: float) -> tuple[Identification, Array]:
        """The ring, where the belief has its LEDs or else somewhere about there; and (8, 2) the belief's LEDs."""
        roll_rad = self._tracker.roll_rad
        if not self._tracker.tracking:
            roll_rad = self._look_for_roll(blobs, roll_rad, time_s)
        led_px, sigma_px = self._filter.predicted_led_pixels(time_s)
        expected: dict[str, Any] = {"expected_led_px": led_px, "expected_roll_rad": roll_rad}
        found = self._identified(blobs, expected_sigma_px=_largest(sigma_px), **expected)
        if found.status is IdentificationStatus.NOT_FOUND:  # without a sigma: within a radius
            found = self._identified(blobs, **expected)
        return found, led_px

    def _identified(self, blobs: Blobs, **expected: Any) -> Identification:
        camera, ring = self._sheets.camera, self._sheets.ring
        return identify(blobs.centroids_px, camera=camera, ring=ring, brightness=blobs.flux, **expected)

    def _look_for_roll(self, blobs: Blobs, expected_rad: float, time_s: float) -> float:
        """Roll of the ring where the belief has it, however it is rolled; the expected one if there is no ring.

        A belief of another roll is turned. An expected roll of NaN is the belief's.
        """
        led_px, sigma_px = self._filter.predicted_led_pixels(time_s)
        if not np.isfinite(led_px).all():
            return expected_rad
        centre_px, radius_px, believed_rad = ring_from_leds(led_px, self._sheets.ring.angles_rad)
        found = self._identified(
            blobs, expected_centre_px=centre_px, expected_radius_px=radius_px, expected_sigma_px=_largest(sigma_px)
        )
        if found.status is not IdentificationStatus.FOUND:
            return expected_rad
        expected_rad = believed_rad if np.isnan(expected_rad) else expected_rad
        symmetry_rad = 2.0 * math.pi / (1 if found.absolute else SLOTS)
        roll_rad = expected_rad + math.remainder(found.roll_rad - expected_rad, symmetry_rad)
        turn_rad = math.remainder(roll_rad - believed_rad, 2.0 * math.pi)
        if abs(turn_rad) > self._settings.turned_rad:
            self._turn_belief(turn_rad, time_s)
        return roll_rad

    def _turn_belief(self, roll_rad: float, time_s: float) -> None:
        """Start the belief afresh where it is, the drogue rolled about its axis."""
        self._filter.turn_drogue(roll_rad, time_s)

    def _shown(self, pixels: Array, window: Window) -> bool:
        """Whether a window holds all of the pixels (n, 2) that are on the sensor."""
        on_sensor = _inside(pixels, self._sheets.camera.full_window)
        return bool(_inside(pixels[on_sensor], window).all())

    def _turn_C(self, before_s: float, time_s: float) -> tuple[Array, float]:
        """(3,) rotation vector of the camera between two times, in its own axes [rad], and the time between them."""
        interval_s = time_s - before_s
        rate_C = self._sheets.mounting.R_BC.T @ self._filter.rate_B(0.5 * (time_s + before_s))
        return np.asarray(rate_C * interval_s), interval_s

    def _window(self) -> Window | None:
        """What the camera should read at its next exposure, which is the first after now."""
        if not np.isfinite(self._frame_time_s):
            return None
        period_s = 1.0 / self._sheets.camera_rate_hz
        # half a control tick, since the clocks of camera and IMU may differ by a little
        since_s = self._time_s - self._frame_time_s + 0.5 / self._sheets.control_rate_hz
        frames = max(math.floor(since_s / period_s), 0) + 1
        return self._tracker.window(*self._turn_C(self._frame_time_s, self._frame_time_s + frames * period_s))

    def _solution(self) -> NavSolution:
        state = self._filter.state(self._time_s)
        sigma_lateral_m = float(np.sqrt(np.linalg.eigvalsh(state.covariance[4:6, 4:6])[-1]))
        aged_s = self._time_s - self._used_time_s
        known = bool(np.isfinite(state.p_PD_B).all() and np.isfinite(state.covariance).all())
        valid = known and sigma_lateral_m <= self._settings.usable_sigma_m and aged_s <= self._settings.usable_age_s
        command = self._guidance.step(
            RelativeState(
                usable=valid,
                p_PD_B=state.p_PD_B,
                rate_PD_B=state.rate_PD_B,
                p_PK_B=state.p_PD_B + self._sheets.coupling_depth_m * state.R_BD[:, 0],
                sigma_lateral_m=sigma_lateral_m,
            )
        )
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
            window=self._window(),
            frame_time_stamp_s=self._used_time_s,
            candidates_px=self._candidates_px,
            led_pixels_px=self._led_pixels_px,
        )


def _check_ring(ring: LedRing) -> None:
    if ring.count != SLOTS:
        raise DockairError("ring.count", expected=f"{SLOTS} LEDs, the ring that can be identified", got=ring.count)
    code = code_of(ring, CodeSettings())
    if SLOTS - len(code.displaced) < _EVEN_LEDS:
        expected = f"at least {_EVEN_LEDS} LEDs in their even places, by which the ring is found"
        raise DockairError("ring.angles_deg", expected=expected, got=ring.angles_deg)
    if code.says_something and code.is_the_same_turned:
        got = {"angles_deg": ring.angles_deg, "brightness": ring.brightness}
        raise DockairError("ring", expected="a code that is another when the ring is turned, or none", got=got)


def _largest(sigma_px: Array) -> float | None:
    finite = sigma_px[np.isfinite(sigma_px)]
    return float(finite.max()) if len(finite) else None


def _inside(pixels: Array, window: Window) -> NDArray[np.bool_]:
    """(n,) which pixels (n, 2) a window holds; those that are not finite are in none."""
    first, stop = np.array([window.column_start, window.row_start]), np.array([window.column_stop, window.row_stop])
    return np.asarray(((pixels > first - 0.5) & (pixels < stop - 0.5)).all(axis=1))
