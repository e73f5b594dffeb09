"""The stages in order: gyro and frame in, belief and command out.

    frame ► frame_checks ► ring_finder (detect ► identify ► track) ► pose ► integrity ► fusion ► guidance ► command
    IMU   ────────────────────────────────────────────────────────────────────────────────┘         ▲
       └► tip_motion ───────────────────────────────────────────────────────────────────────────────┘

Only this file knows the order. What it knows of its hardware arrives as `NavigationSheets`. Named LEDs may come in the
place of a frame; they go the same way but for the ring_finder. What is claimed for contact is the `contact_watch`'s.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from dockair.calibration import LedRing, NavigationSheets
from dockair.errors import DockairError
from dockair.messages import CameraFrame, ImuSample, LedObservation, NavSolution, PodSignal, TankerAnnouncement
from dockair.nav.contact_watch import ContactWatch, look_back_s
from dockair.nav.frame_checks import FrameChecks, only, with_numbers
from dockair.nav.fusion import FusionSettings, RelativeFilter
from dockair.nav.guidance.approach import Guidance, GuidanceSettings, RelativeState
from dockair.nav.guidance.field_of_view import FieldOfView
from dockair.nav.guidance.phases import Phase
from dockair.nav.heading.own_heading import OwnHeading, OwnHeadingSettings
from dockair.nav.identify.code import CodeSettings, code_of
from dockair.nav.identify.hypotheses import IdentifySettings
from dockair.nav.identify.perspective import SLOTS
from dockair.nav.image.detect import DetectSettings
from dockair.nav.integrity.coasting import CoastingSettings
from dockair.nav.integrity.contact import ContactClaim, ContactLimits
from dockair.nav.integrity.fault_test import IntegritySettings
from dockair.nav.integrity.monitor import IntegrityStatus, check_integrity
from dockair.nav.pose.estimate import PoseStatus, solve_pose
from dockair.nav.pose.measurement import lines_of_sight_from_pixels
from dockair.nav.pose.prior import AttitudePrior
from dockair.nav.ring_finder import FewSettings, RingFinder
from dockair.nav.tip_motion import TipMotion
from dockair.nav.track import TrackSettings
from dockair.rotations import Array
from dockair.vectors import is_finite, largest_sigma

_EVEN_LEDS = 5  # four are seldom more than an accident
_ROUNDING_RAD = 1e-9  # of a sheet's angles
_POSE_LEDS = 4  # fewer are no pose without a belief ...
_LONGEST_TICKS = 1.5  # between two stamps, for what is felt at the second to stand for all of the time
_LEAST_POSE_LEDS = 3  # ... and these are one with its attitude


@dataclass(frozen=True, slots=True, kw_only=True)
class NavigatorSettings:
    """Settings of every stage."""

    detect: DetectSettings = field(default_factory=DetectSettings)
    track: TrackSettings = field(default_factory=TrackSettings)
    few: FewSettings = field(default_factory=FewSettings)
    integrity: IntegritySettings = field(default_factory=IntegritySettings)
    contact: ContactLimits = field(default_factory=ContactLimits)
    coasting: CoastingSettings = field(default_factory=CoastingSettings)
    fusion: FusionSettings = field(default_factory=FusionSettings)
    guidance: GuidanceSettings = field(default_factory=GuidanceSettings)
    tip_levelling_s: float = 60.0  # of the tip's motion: gusts of 1 m/s are then taken for 0.02 m/s^2 of gravity
    heading: OwnHeadingSettings | None = None  # none: docking needs no heading, and each of its frames shows no LEDs
    led_position_sigma_m: float = 3e-4  # as-built tolerance of an LED's place on the ring; 0.3 px at 3 m
    learnt_place_sigmas: float = 4.0  # of that tolerance: so far a learnt place is believed when a frame is tested
    #: LEDs from which on a frame is tested by itself. Of four any three fit: the range could be off by 0.3 m unseen,
    #: of five by as much near the frontal attitude. Fewer are tested with the attitude that the frames before showed.
    alone_leds: int = 6
    usable_sigma_m: float = 0.10  # lateral 1 sigma above which the state may not be flown on
    turned_rad: float = np.radians(10.0)  # roll by which a belief is off that its own gate may no longer bridge
    usable_age_s: float = 0.5  # breakaway practice: a track lost for 0.5 s is lost
    #: Time for which no frame has been used, after which the ring is looked for anywhere. By then an acceleration that
    #: is 0.3 m/s^2 in error has moved the belief by 0.6 m, more than the ring's own size.
    search_anew_s: float = 2.0


class Navigator:
    """The navigation that Dockair flies; see `messages.Navigates` for what any other must offer.

    Raises:
        DockairError: a ring that cannot be identified, having fewer than five LEDs within four as-built tolerances of
            their even places, or numbered by the code it has; fewer than no tolerances of a learnt place.
    """

    def __init__(self, sheets: NavigationSheets, settings: NavigatorSettings | None = None) -> None:
        self._sheets, self._settings = sheets, settings or NavigatorSettings()
        _check_ring(sheets.ring, self._settings.led_position_sigma_m)
        learnt_sigmas = self._settings.learnt_place_sigmas
        if not learnt_sigmas >= 0.0:
            raise DockairError("navigator.learnt_place_sigmas", expected="a number, 0 or more", got=learnt_sigmas)
        contact, coasting = self._settings.contact, self._settings.coasting
        asked_s = look_back_s(sheets, contact, coasting)
        self._filter = RelativeFilter(sheets, self._settings.fusion, look_back_s=asked_s)
        self._finder = RingFinder(
            sheets, self._filter, self._settings.detect, self._settings.track, self._settings.turned_rad,
            self._settings.few, self._settings.led_position_sigma_m,
        )  # fmt: skip
        mounting = sheets.mounting
        self._tip = TipMotion(mounting.p_BP - mounting.p_BI, self._settings.tip_levelling_s)
        self._longest_step_s = _longest_step_s(sheets)
        field_of_view = FieldOfView(sheets.camera, mounting)
        self._guidance = Guidance(self._settings.guidance, sheets.control_rate_hz, field_of_view)
        self._heading = None if self._settings.heading is None else OwnHeading(sheets, self._settings.heading)
        self._checks = FrameChecks(1.0 / sheets.camera_rate_hz, self._settings.fusion.buffer_s)
        self._points_D = sheets.ring.positions_D
        self._time_s = 0.0
        self._used_time_s = self._begun_s = float("nan")
        self._looked_time_s = 0.0  # when the newest frame came that says something
        self._felt_time_s = 0.0
        self._contact = ContactWatch(sheets, self._filter, contact, coasting)
        self._status = self._finder.status
        self._not_shown = False
        self._candidates_px: Array = np.empty((0, 2))
        self._led_pixels_px: Array = np.full((len(self._points_D), 2), np.nan)

    def announce(self, announcement: TankerAnnouncement) -> None:
        """Take note of what the tanker is about to do."""
        self._guidance.announce(announcement)

    def signal(self, signal: PodSignal) -> None:
        """Take note of what the pod's light begins to show."""
        self._guidance.signal(signal)

    def step(self, imu: Sequence[ImuSample], frame: CameraFrame | LedObservation | None) -> NavSolution:
        """Take the gyro samples and the frame, or its LEDs, that arrived since the last control tick."""
        taken = self._filter.propagate(imu)
        if taken:
            self._time_s = self._filter.imu_time_s
        else:  # the IMU has dropped out, or says nothing that can be used: the last rate is held
            self._time_s += 1.0 / self._sheets.control_rate_hz
        if np.isnan(self._begun_s):
            self._begun_s = self._time_s
        if frame is not None:
            frame = self._checked(frame)
        if self._heading is not None:
            frame = self._give_heading(self._heading, taken, frame)
        if frame is not None:
            self._status = self._look(frame)
        return self._solution()

    @property
    def innovation(self) -> tuple[float, int] | None:
        """Of the newest frame offered to the filter: its chi-square against the belief, and the degrees of freedom."""
        return self._filter.innovation

    def _followed(self, time_s: float) -> bool:
        """Whether the belief has been corrected lately enough to say which LED a single one is."""
        return time_s - self._used_time_s <= self._settings.usable_age_s

    def _lost(self, time_s: float) -> bool:
        """Whether the belief has followed no frame for so long that it says nothing of where the drogue is."""
        since_s = self._begun_s if np.isnan(self._used_time_s) else self._used_time_s
        return time_s - since_s > self._settings.search_anew_s

    def _checked(self, frame: CameraFrame | LedObservation) -> CameraFrame | LedObservation | None:
        """Return a frame to look at; of one that says nothing only the status is left."""
        clock_s = self._time_s if np.isfinite(self._filter.imu_time_s) else float("nan")
        refused = self._checks.refused(frame, clock_s)
        if refused is None:
            return frame
        self._candidates_px, self._status = np.empty((0, 2)), self._nothing(refused)
        return None

    def _give_heading(
        self, heading: OwnHeading, taken: Sequence[ImuSample], frame: CameraFrame | LedObservation | None
    ) -> CameraFrame | LedObservation | None:
        """Let the heading have its samples and the frame that it asked for; return one that it did not ask for."""
        if not (isinstance(frame, CameraFrame) and heading.was_asked(frame)):
            heading.step(taken, None, np.zeros(3))
            return frame
        heading.step(taken, frame, self._filter.predicted_pose(self._time_s)[1])
        return None

    def _look(self, frame: CameraFrame | LedObservation) -> str:
        """Frame to named LEDs to belief; what became of it is the status."""
        self._candidates_px = np.empty((0, 2))
        self._looked_time_s = self._time_s
        time_s = frame.time_stamp_s
        lost, nothing = self._lost(time_s), "ring not found"
        if isinstance(frame, CameraFrame):
            seen = self._finder.find(frame, followed=self._followed(time_s), lost=lost)
            self._candidates_px, nothing = self._finder.candidates_px, self._finder.status
        else:
            seen = with_numbers(frame)
            self._candidates_px = seen.centroids_px
        self._not_shown = self._shows_no_ring(frame)
        if lost and len(seen.led_numbers) >= _POSE_LEDS:
            self._begin_again(seen)
        return self._use(seen) if len(seen.led_numbers) else self._nothing(nothing)

    def _shows_no_ring(self, frame: CameraFrame | LedObservation) -> bool:
        """Whether a frame is of the whole field, and shows fewer spots than a ring is found by."""
        whole = not isinstance(frame, CameraFrame) or frame.window == self._sheets.camera.full_window
        return whole and len(self._candidates_px) < _POSE_LEDS

    def _begin_again(self, seen: LedObservation) -> None:
        """Believe the drogue to be where LEDs that agree show it, whatever was believed while it was lost."""
        pixels, points_D, camera = seen.centroids_px, self._points_D[seen.led_numbers], self._sheets.camera
        pose = solve_pose(pixels, points_D, camera, sigma_px=seen.sigma_px)
        if pose.status is not PoseStatus.CONVERGED:
            return
        sigma_px = np.hypot(seen.sigma_px, self._misplaced_px(pose.p_CD))
        pose = solve_pose(pixels, points_D, camera, sigma_px=sigma_px, initial=(pose.R_CD, pose.p_CD))
        if pose.status is not PoseStatus.CONVERGED:
            return
        checked = check_integrity(pose, None, self._settings.integrity)
        if checked.status is not IntegrityStatus.INCONSISTENT:
            self._filter.begin_again(checked.pose, seen.time_stamp_s)
            self._contact.found_again()

    def _nothing(self, status: str) -> str:
        self._led_pixels_px = np.full((len(self._points_D), 2), np.nan)
        return status

    def _use(self, seen: LedObservation) -> str:
        """Named LEDs to pose to belief; every way out leaves its reason in the status."""
        time_s, named = seen.time_stamp_s, seen.led_numbers
        self._led_pixels_px = np.full((len(self._points_D), 2), np.nan)
        self._led_pixels_px[named] = seen.centroids_px
        R_CD, p_CD, covariance = self._filter.predicted_pose(time_s)
        attitude = self._attitude_known(len(named), time_s, R_CD, covariance)
        tight = self._settings.fusion.coupling == "tight"
        few = len(named) < (_POSE_LEDS if tight else self._settings.alone_leds)
        if few and (attitude is None or len(named) < _LEAST_POSE_LEDS or not tight):
            return self._use_few(seen, R_CD, p_CD)  # a loose filter would take the believed attitude of fewer for new
        pose = solve_pose(
            seen.centroids_px,
            self._believed_points_D(time_s)[named],
            self._sheets.camera,
            sigma_px=np.hypot(seen.sigma_px, self._misplaced_px(p_CD)),
            initial=(R_CD, p_CD),
            prior=attitude if few else None,
        )
        if pose.status is not PoseStatus.CONVERGED:
            return f"pose {pose.status.value}"
        checked = check_integrity(pose, attitude, self._settings.integrity)
        if checked.status is IntegrityStatus.INCONSISTENT:
            self._contact.contradicted(time_s)
            return f"pose {checked.status.value}"
        kept = np.isfinite(checked.pose.led_chi2)  # neither left out nor beyond the lens's edge, where no ray goes
        self._led_pixels_px[named[~kept]] = np.nan
        if kept.sum() < _LEAST_POSE_LEDS:  # what is left makes no pose, whose claim it could be
            return self._use_few(only(seen, kept), R_CD, p_CD)
        sight = lines_of_sight_from_pixels(
            seen.centroids_px[kept],
            self._points_D[named[kept]],
            self._sheets.camera,
            self._unlearnt_px(seen, R_CD, p_CD)[kept],
        )
        if not self._filter.update(replace(checked.pose, measurement=sight), time_s):
            self._contact.refused(checked, self._points_D[named[kept]], time_s)
            return "pose refused by the gate"
        self._contact.used(checked, self._points_D[named[kept]], time_s)
        self._used_time_s = max(time_s, self._used_time_s)  # NaN before the first: the first of the two then
        return "pose used"

    def _misplaced_px(self, p_CD: Array) -> float:
        """What an LED's place on the ring, as built, moves its image by across the line of sight, one sigma [px]."""
        return float(self._sheets.camera.focal_length_px * self._settings.led_position_sigma_m / p_CD[0])

    def _unlearnt_px(self, seen: LedObservation, R_CD: Array, p_CD: Array) -> Array:
        """(n,) sigma of the LEDs' images for the filter: the centroid's, and that of what it does not learn [px].

        It learns the LEDs' places in the ring's plane, and takes none to be out of it. One that is shows the more the
        farther it is seen off the drogue's axis: less than the centroid's noise 8 m ahead, ten times it at the ring.
        """
        arm_D = self._points_D[seen.led_numbers] + R_CD.T @ p_CD
        slope = np.hypot(arm_D[:, 1], arm_D[:, 2]) / np.abs(arm_D[:, 0])
        return np.asarray(np.hypot(seen.sigma_px, self._misplaced_px(p_CD) * slope))

    def _believed_points_D(self, time_s: float) -> Array:
        """(count, 3) places of the LEDs as far as the belief has learnt them, for a frame that tests itself [m].

        Each axis departs from the sheet by at most a set number of tolerances: a fault that grows too slowly for any
        one frame to see is learnt like a place, and is then seen at last.
        """
        most_m = self._settings.learnt_place_sigmas * self._settings.led_position_sigma_m
        learnt_D = self._filter.led_points_D(time_s) - self._points_D
        return np.asarray(self._points_D + np.minimum(np.maximum(learnt_D, -most_m), most_m))

    def _attitude_known(self, leds: int, time_s: float, R_CD: Array, covariance: Array) -> AttitudePrior | None:
        """The attitude that is believed, where the LEDs of one frame are too few to test one another without it."""
        if leds >= self._settings.alone_leds or not self._followed(time_s):
            return None
        return AttitudePrior(R_CD=R_CD, information=np.linalg.inv(covariance[:3, :3]))

    def _use_few(self, seen: LedObservation, R_CD: Array, p_CD: Array) -> str:
        """LEDs too few for a pose correct a belief that follows the drogue, and begin none."""
        time_s = seen.time_stamp_s
        if self._settings.fusion.coupling != "tight" or not self._followed(time_s):
            return "pose too few LEDs"
        sigma_px = self._unlearnt_px(seen, R_CD, p_CD)
        if not self._filter.update_leds(seen.centroids_px, self._points_D[seen.led_numbers], sigma_px, time_s):
            self._contact.contradicted(time_s)
            return "LEDs refused by the gate"
        self._used_time_s = max(time_s, self._used_time_s)
        self._contact.corrected(time_s)
        return "LEDs used"

    def contact_claim(self) -> ContactClaim | None:
        """Whether contact may be flown on the present belief, and why not; None before the first pose that was used."""
        return self._contact.claim(self._time_s)

    def _solution(self) -> NavSolution:
        state = self._filter.state(self._time_s)
        sigma_lateral_m = largest_sigma(state.covariance[4:6, 4:6])
        aged_s = self._time_s - self._used_time_s
        known = is_finite(state.p_PD_B) and is_finite(state.rate_PD_B) and is_finite(state.covariance)
        recent = -0.5 / self._sheets.control_rate_hz <= aged_s <= self._settings.usable_age_s
        valid = known and sigma_lateral_m <= self._settings.usable_sigma_m and recent
        claim = self.contact_claim()
        contact_usable = valid and claim is not None and claim.usable
        self._contact.note_basket(state, claim, usable=contact_usable)
        w_WB_B = self._filter.mean_rate_B(self._time_s, 1.0 / self._sheets.control_rate_hz)
        command = self._guidance.step(
            RelativeState(
                usable=valid,
                contact_usable=contact_usable,
                p_PD_B=state.p_PD_B,
                rate_PD_B=state.rate_PD_B,
                p_PK_B=state.p_PD_B + self._sheets.coupling_depth_m * state.R_BD[:, 0],
                w_WB_B=w_WB_B,
                dv_WP_B=self._felt_change(w_WB_B),
                sigma_lateral_m=sigma_lateral_m,
                age_s=aged_s,
                not_shown=self._not_shown,
                frame_age_s=self._time_s - self._looked_time_s,
            )
        )
        exposure_s, heading_rad, sigma_rad = self._heading_now()
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
            window=None if np.isfinite(exposure_s) else self._finder.window(self._time_s),
            frame_time_stamp_s=self._used_time_s,
            candidates_px=self._candidates_px,
            led_pixels_px=self._led_pixels_px,
            contact_usable=contact_usable,
            phase_reason=self._guidance.phase_reason,
            exposure_s=exposure_s,
            heading_rad=heading_rad,
            heading_sigma_rad=sigma_rad,
        )

    def _felt_change(self, w_WB_B: Array) -> Array:
        """(3,) of the tip's velocity since the last control tick."""
        before_s, self._felt_time_s = self._felt_time_s, self._time_s
        step_s = self._time_s - before_s
        in_step = 0.0 < step_s < self._longest_step_s  # else stamps have leapt
        force_B = self._filter.mean_force_B(before_s, self._time_s) if in_step else np.full(3, np.nan)
        return self._tip.change_m_s(force_B, w_WB_B, self._filter.bias_B, step_s)

    def _heading_now(self) -> tuple[float, float, float]:
        """Exposure to ask for, heading and its sigma; the LEDs' frames are not given away while the probe goes in."""
        if self._heading is None:
            return float("nan"), float("nan"), float("nan")
        free = self._guidance.phase is not Phase.CONTACT
        exposure_s = self._heading.ask(self._time_s) if free else float("nan")
        return exposure_s, self._heading.heading_rad, self._heading.sigma_rad


def _longest_step_s(sheets: NavigationSheets) -> float:
    """Time between two ticks' newest samples that is no leap; of an IMU of 125 Hz every fourth of 10 ms is 16 ms."""
    gyro_hz, control_hz = sheets.gyro.rate_hz, sheets.control_rate_hz
    return max(_LONGEST_TICKS / control_hz, (math.ceil(gyro_hz / control_hz) + 0.5) / gyro_hz)


def _check_ring(ring: LedRing, led_position_sigma_m: float) -> None:
    if ring.count != SLOTS:
        raise DockairError("ring.count", expected=f"{SLOTS} LEDs, the ring that can be identified", got=ring.count)
    code = code_of(ring, CodeSettings())
    off_rad = np.abs(ring.angles_rad - 2.0 * np.pi / SLOTS * np.arange(SLOTS))
    within_rad = IdentifySettings().tolerance_sigmas * led_position_sigma_m / (0.5 * ring.diameter_m)
    even = (code.offset_rad == 0.0) & (off_rad <= within_rad + _ROUNDING_RAD)
    if even.sum() < _EVEN_LEDS:
        within = f"within {np.degrees(within_rad):.2g} degrees, by which the ring is found"
        expected = f"at least {_EVEN_LEDS} LEDs in their even places, {within}"
        raise DockairError("ring.angles_deg", expected=expected, got=ring.angles_deg)
    if code.says_something and code.is_the_same_turned:
        got = {"angles_deg": ring.angles_deg, "brightness": ring.brightness}
        raise DockairError("ring", expected="a code that is another when the ring is turned, or none", got=got)
