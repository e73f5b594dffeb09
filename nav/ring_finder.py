"""Pixels to named LEDs: detect, identify, track, and the window that the next frame needs.

Two predictions of the ring exist. The belief's, which knows range, attitude and gyro, says where each LED should be; a
ring that is not there is looked for within a radius about. The track's, which knows the image and the gyro, makes the
window. When they disagree, that is when no ring is found and the window does not even show where the belief has its
LEDs, the track gives way and the full frame is read. A ring that is AMBIGUOUS with LEDs where the sheet has them is
looked for once more with twice their tolerance. Whether what was found is believed is the filter's gate's to say.

Which LED is which follows from the ring's roll: the track's, which knows how fast the ring turns, as long as that tells
one numbering from the next, then the belief's. While nothing is tracked (at first, after a loss) the ring is looked for
without any roll, too. A code then says which LED is which, whatever was expected; without one the numbering nearest to
the expected roll is taken, which is right up to the ring's symmetry, and for flying that is all the same. A belief of
another roll is turned by the difference. A code that contradicts the numbers of a tracked ring makes it AMBIGUOUS, so
that the track is lost and the code read again.

Four LEDs make a ring, fewer do not. While the belief follows the drogue, single blobs are named by it: one that lies
alone in the gate of one LED, g sigma of belief and of the sharpest centroid about where it should be, and in no
other's. With rho blobs a square pixel that are in no gate, counted within 1.6 radii as for a ring (`chance`), clutter
gets a wrong name in at most

    rho (sum of the gates' areas)                                                                     (1)

of the frames; where that is more than is allowed, nothing is named. A belief is never begun with such LEDs.

A belief that has lost the drogue runs away, and where it has the LEDs nothing will be found any more. Then the ring is
looked for anywhere, as if nothing were known; its numbers are right up to the symmetry, and the belief begins anew.
"""

import math
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dockair.calibration import NavigationSheets
from dockair.errors import check_numbers
from dockair.messages import CameraFrame, LedObservation, Window
from dockair.nav.fusion import RelativeFilter
from dockair.nav.identify.code import CodeSettings, code_of
from dockair.nav.identify.perspective import SLOTS
from dockair.nav.identify.prior import ring_from_leds
from dockair.nav.identify.ring import Identification, IdentificationStatus, IdentifySettings, identify
from dockair.nav.image.detect import Blobs, DetectSettings, detect
from dockair.nav.track import RingTracker, TrackSettings
from dockair.rotations import Array

_NONE: NDArray[np.int64] = np.empty(0, np.int64)
#: Of the sheet's tolerance, by which LEDs may be off. Near the basket one that is off by four sigma is left out of its
#: ring, and what makes it an outlier makes impostors of the others.
_FARTHER_OFF = 2.0
_NEIGHBOURHOOD_RADII, _UNSEEN = 1.6, 0.2  # of `chance`: where clutter is counted, and blobs more than were seen


@dataclass(frozen=True, slots=True, kw_only=True)
class FewSettings:
    """When single LEDs are named by the belief."""

    gate_sigmas: float = 4.0  # along the worst axis: a true LED is missed once in 3000
    false_names_max: float = (
        5e-3  # Eq. (1), a frame: one in 4 s at 50 Hz, which moves a belief by its own 4 sigma at most
    )

    def __post_init__(self) -> None:
        check_numbers("few", self)


class RingFinder:
    """Finds the ring in one frame after the other.

    Args:
        sheets: camera, ring, mounting, rates.
        belief: says where the LEDs should be, and is turned when they were numbered wrongly.
        detect_settings: of the blobs.
        track_settings: of the track in the image.
        turned_rad: roll by which a belief is off that its own gate may no longer bridge.
        few_settings: of single LEDs; None for the defaults.
        misplaced_m: as-built tolerance of an LED's place on the ring.
    """

    def __init__(
        self,
        sheets: NavigationSheets,
        belief: RelativeFilter,
        detect_settings: DetectSettings,
        track_settings: TrackSettings,
        turned_rad: float,
        few_settings: FewSettings | None = None,
        misplaced_m: float = 0.0,
    ) -> None:
        self._sheets, self._belief, self._detect_settings = sheets, belief, detect_settings
        self._turned_rad, self._few_settings, self._misplaced_m = turned_rad, few_settings or FewSettings(), misplaced_m
        self._by_sheet = IdentifySettings(ring_sigma=misplaced_m / (0.5 * sheets.ring.diameter_m))
        self._farther_off = replace(self._by_sheet, ring_sigma=_FARTHER_OFF * self._by_sheet.ring_sigma)
        self._code = code_of(sheets.ring, CodeSettings())
        self._few = False  #: whether the newest frame's LEDs were named one by one
        self._tracker = RingTracker(
            sheets.camera, 1.0 / sheets.camera_rate_hz, track_settings,
            ring_radius_m=0.5 * sheets.ring.diameter_m, lever_C=sheets.mounting.R_BC.T @ sheets.mounting.p_BC,
        )  # fmt: skip
        self._track_settings, self._frame_time_s = track_settings, float("nan")
        self.status = "no frame yet"  #: what became of the newest frame
        self.candidates_px: Array = np.empty((0, 2))  #: (n, 2) blobs of the newest frame

    def find(self, frame: CameraFrame, *, followed: bool = False, lost: bool = False) -> LedObservation:
        """Return the LEDs that a frame shows, by name; none when there is no ring, and `status` says why.

        Args:
            frame: what the camera sent.
            followed: whether the belief follows the drogue, so that it may name LEDs too few for a ring.
            lost: whether the belief has not for long, so that the ring may be anywhere.
        """
        blobs = detect(frame.pixels, self._detect_settings, frame.window, gain_dn_per_electron=frame.gain)
        self.candidates_px = blobs.centroids_px
        if frame.time_stamp_s > self._frame_time_s:
            self._tracker.predict(*self._turn_C(self._frame_time_s, frame.time_stamp_s))
        is_late = frame.time_stamp_s <= self._frame_time_s  # a newer one has come: the track is of its time
        self._frame_time_s = self._frame_time_s if is_late else frame.time_stamp_s
        found, expected_px = self._found(blobs, frame.time_stamp_s)
        if lost and found.status is IdentificationStatus.NOT_FOUND:
            found = self._identified(blobs)
        if not is_late:
            self._tracker.update(found)
        self.status = f"ring {found.status.value}"
        members, numbers, few = found.members, found.led_numbers, False
        if found.status is not IdentificationStatus.FOUND:
            if not is_late and not self._shown(expected_px, frame.window):
                self._tracker.lose()
            members, numbers = _NONE, _NONE
            if followed and (found.status is IdentificationStatus.NOT_FOUND or not self._code.says_something):
                members, numbers = self._named_singly(blobs, frame.time_stamp_s)
            few = len(members) > 0
        self._few = self._few if is_late else few
        return _named(blobs, members, numbers, frame.time_stamp_s)

    def window(self, time_s: float) -> Window | None:
        """What the camera should read at its next exposure, the first after a time; None for the full frame."""
        if not np.isfinite(self._frame_time_s):
            return None
        period_s = 1.0 / self._sheets.camera_rate_hz
        # half a control tick, since the clocks of camera and IMU may differ by a little
        since_s = time_s - self._frame_time_s + 0.5 / self._sheets.control_rate_hz
        frames = max(math.floor(since_s / period_s), 0) + 1
        next_s = self._frame_time_s + frames * period_s
        if self._few and not self._tracker.tracking:
            return self._window_about(*self._belief.predicted_led_pixels(next_s))
        return self._tracker.window(*self._turn_C(self._frame_time_s, next_s))

    def _found(self, blobs: Blobs, time_s: float) -> tuple[Identification, Array]:
        """The ring, where the belief has its LEDs or else somewhere about there; and (8, 2) the belief's LEDs."""
        roll_rad = self._tracker.roll_rad
        if not self._tracker.tracking:
            roll_rad = self._look_for_roll(blobs, roll_rad, time_s)
        led_px, sigma_px = self._belief.predicted_led_pixels(time_s)
        expected: dict[str, Any] = {"expected_led_px": led_px, "expected_roll_rad": roll_rad}
        found = self._identified(blobs, expected_sigma_px=_largest(sigma_px), **expected)
        if found.status is IdentificationStatus.NOT_FOUND:  # without a sigma: within a radius
            found = self._identified(blobs, **expected)
        return found, led_px

    def _named_singly(self, blobs: Blobs, time_s: float) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
        """Blobs (m,) that are LEDs (m,) by the belief alone; none where Eq. (1) is too large."""
        led_px, sigma_px = self._belief.predicted_led_pixels(time_s)
        if not (len(blobs.sigma_px) and np.isfinite(led_px).all()):
            return _NONE, _NONE
        settings, centre_px = self._few_settings, led_px.mean(axis=0)
        radius_px = float(np.hypot(*(led_px - centre_px).T).max())
        misplaced_px = self._misplaced_m * radius_px / (0.5 * self._sheets.ring.diameter_m)
        noise_px = float(np.hypot(blobs.sigma_px.min(), misplaced_px))
        gate_px = settings.gate_sigmas * np.hypot(sigma_px, noise_px)
        apart_px = np.hypot(*(blobs.centroids_px[:, None, :] - led_px[None, :, :]).transpose(2, 0, 1))
        inside = apart_px < gate_px
        near = np.hypot(*(blobs.centroids_px - centre_px).T) < _NEIGHBOURHOOD_RADII * radius_px
        others = int((near & ~inside.any(axis=1)).sum())
        density_px2 = (others + _UNSEEN) / (np.pi * (_NEIGHBOURHOOD_RADII * radius_px) ** 2)
        if density_px2 * np.pi * float((gate_px**2).sum()) > settings.false_names_max:
            return _NONE, _NONE
        alone = inside & (inside.sum(axis=0) == 1) & (inside.sum(axis=1) == 1)[:, None]
        members, numbers = np.nonzero(alone)
        return members, numbers

    def _window_about(self, led_px: Array, sigma_px: Array) -> Window | None:
        """The window that holds the LEDs of a belief; None for the full frame."""
        if not (np.isfinite(led_px).all() and np.isfinite(sigma_px).all()):
            return None
        s, camera = self._track_settings, self._sheets.camera
        size_px = float(np.ptp(led_px, axis=0).max())
        margin = s.window_margin_px + 0.5 * s.window_margin_radii * size_px + s.window_sigmas * float(sigma_px.max())
        sensor = np.array([camera.width_px, camera.height_px])
        u, v = np.maximum(np.floor(led_px.min(axis=0) - margin), 0).astype(int).tolist()
        u_stop, v_stop = np.minimum(np.ceil(led_px.max(axis=0) + margin) + 1, sensor).astype(int).tolist()
        window = Window(v, v_stop, u, u_stop)
        rows, columns = window.shape
        return window if rows > 0 and columns > 0 and window != camera.full_window else None

    def _identified(self, blobs: Blobs, **expected: Any) -> Identification:
        """The ring by LEDs in their places, or else, where that leaves doubt, by LEDs farther off them."""
        found = self._identified_by(self._by_sheet, blobs, **expected)
        doubt = found.status is IdentificationStatus.AMBIGUOUS
        return self._identified_by(self._farther_off, blobs, **expected) if doubt else found

    def _identified_by(self, settings: IdentifySettings, blobs: Blobs, **expected: Any) -> Identification:
        return identify(
            blobs.centroids_px, settings=settings, camera=self._sheets.camera, ring=self._sheets.ring,
            code=self._code, brightness=blobs.flux, **expected,
        )  # fmt: skip

    def _look_for_roll(self, blobs: Blobs, expected_rad: float, time_s: float) -> float:
        """Roll of the ring where the belief has it, however it is rolled; the expected one if there is no ring.

        A belief of another roll is turned. An expected roll of NaN is the belief's.
        """
        led_px, sigma_px = self._belief.predicted_led_pixels(time_s)
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
        if abs(turn_rad) > self._turned_rad:
            self._belief.turn_drogue(turn_rad, time_s)
        return roll_rad

    def _shown(self, pixels: Array, window: Window) -> bool:
        """Whether a window holds all of the pixels (n, 2) that are on the sensor."""
        on_sensor = _inside(pixels, self._sheets.camera.full_window)
        return bool(_inside(pixels[on_sensor], window).all())

    def _turn_C(self, before_s: float, time_s: float) -> tuple[Array, float]:
        """(3,) rotation vector of the camera between two times, in its own axes [rad], and the time between them."""
        interval_s = time_s - before_s
        rate_C = self._sheets.mounting.R_BC.T @ self._belief.rate_B(0.5 * (time_s + before_s))
        return np.asarray(rate_C * interval_s), interval_s


def _named(blobs: Blobs, members: NDArray[np.int64], numbers: NDArray[np.int64], time_s: float) -> LedObservation:
    return LedObservation(
        time_stamp_s=time_s,
        led_numbers=numbers,
        centroids_px=blobs.centroids_px[members],
        sigma_px=blobs.sigma_px[members],
    )


def _largest(sigma_px: Array) -> float | None:
    finite = sigma_px[np.isfinite(sigma_px)]
    return float(finite.max()) if len(finite) else None


def _inside(pixels: Array, window: Window) -> NDArray[np.bool_]:
    """(n,) which pixels (n, 2) a window holds; those that are not finite are in none."""
    first, stop = np.array([window.column_start, window.row_start]), np.array([window.column_stop, window.row_stop])
    return np.asarray(((pixels > first - 0.5) & (pixels < stop - 0.5)).all(axis=1))
