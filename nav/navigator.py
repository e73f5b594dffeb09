"""The stages in order: gyro and frame in, belief and command out.

    frame ► frame_checks ► ring_finder ► belief_update (pose ► integrity ► fusion) ► guidance ► command
    IMU   ─────────────────────────────────────────────────────────────────┘          ▲
       └► tip_motion ─────────────────────────────────────────────────────────────────┘

Only this file knows the order; ring_finder is detect ► identify ► track. What it knows of its hardware arrives as
`NavigationSheets`. Named LEDs may come in the place of a frame; they go the same way but for the ring_finder. What is
claimed for contact is the `contact_watch`'s.
"""

import math
from collections.abc import Sequence

import numpy as np

from dockair.calibration import LedRing, NavigationSheets
from dockair.errors import DockairError
from dockair.messages import CameraFrame, ImuSample, LedObservation, NavSolution, PodSignal, TankerAnnouncement
from dockair.nav.belief_update import POSE_LEDS, BeliefUpdate
from dockair.nav.contact_watch import ContactWatch, look_back_s
from dockair.nav.frame_checks import FrameChecks, with_numbers
from dockair.nav.fusion import RelativeFilter
from dockair.nav.guidance.approach import Guidance, RelativeState
from dockair.nav.guidance.field_of_view import FieldOfView
from dockair.nav.guidance.phases import Phase
from dockair.nav.heading.own_heading import OwnHeading
from dockair.nav.identify.code import CodeSettings, code_of
from dockair.nav.identify.hypotheses import IdentifySettings
from dockair.nav.identify.perspective import SLOTS
from dockair.nav.integrity.contact import ContactClaim
from dockair.nav.navigator_settings import NavigatorSettings
from dockair.nav.ring_finder import RingFinder
from dockair.nav.tip_motion import TipMotion
from dockair.rotations import Array
from dockair.vectors import is_finite, largest_sigma

__all__ = ["Navigator", "NavigatorSettings"]

_EVEN_LEDS = 5  # four are seldom more than an accident
_ROUNDING_RAD = 1e-9  # of a sheet's angles
_LONGEST_TICKS = 1.5  # between two stamps, for what is felt at the second to stand for all of the time


class Navigator:
    """The navigation that Dockair flies; see `messages.Navigates` for what any other must offer.

    Raises:
        DockairError: a ring that cannot be identified, having fewer than five LEDs within four as-built tolerances of
            their even places, or numbered by the code it has; fewer than no tolerances of a learnt place.
    """

    def __init__(self, sheets: NavigationSheets, settings: NavigatorSettings | None = None) -> None:
        self._sheets, self._settings = sheets, settings or NavigatorSettings()
        _check_ring(sheets.ring, self._settings.led_position_sigma_m)
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
        self._time_s, self._begun_s = 0.0, float("nan")
        self._looked_time_s = 0.0  # when the newest frame came that says something
        self._felt_time_s = 0.0
        self._contact = ContactWatch(sheets, self._filter, contact, coasting)
        self._update = BeliefUpdate(sheets, self._settings, self._filter, self._contact)
        self._status = self._finder.status
        self._not_shown = False
        self._candidates_px: Array = np.empty((0, 2))

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
        if np.isnan(self._begun_s) and taken:  # the IMU's clock begins where it likes
            self._begun_s = self._time_s
            self._looked_time_s = self._felt_time_s = self._time_s - 1.0 / self._sheets.control_rate_hz
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

    def _lost(self, time_s: float) -> bool:
        """Whether the belief has followed no frame for so long that it says nothing of where the drogue is."""
        since_s = self._begun_s if np.isnan(self._update.used_time_s) else self._update.used_time_s
        return time_s - since_s > self._settings.search_anew_s

    def _checked(self, frame: CameraFrame | LedObservation) -> CameraFrame | LedObservation | None:
        """Return a frame to look at; of one that says nothing only the status is left."""
        clock_s = self._time_s if np.isfinite(self._filter.imu_time_s) else float("nan")
        refused = self._checks.refused(frame, clock_s)
        if refused is None:
            return frame
        self._update.nothing()
        self._candidates_px, self._status = np.empty((0, 2)), refused
        return None

    def _give_heading(
        self, heading: OwnHeading, taken: Sequence[ImuSample], frame: CameraFrame | LedObservation | None
    ) -> CameraFrame | LedObservation | None:
        """Let the heading have its samples and the frame that it asked for; return one that it did not ask for."""
        if not (isinstance(frame, CameraFrame) and heading.was_asked(frame)):
            heading.step(taken, None, np.zeros(3))
            return frame
        heading.step(taken, frame, self._filter.predicted_pose(frame.time_stamp_s)[1])
        return None

    def _look(self, frame: CameraFrame | LedObservation) -> str:
        """Frame to named LEDs to belief; what became of it is the status."""
        self._candidates_px = np.empty((0, 2))
        self._looked_time_s = self._time_s
        time_s = frame.time_stamp_s
        lost, nothing = self._lost(time_s), "ring not found"
        if isinstance(frame, CameraFrame):
            seen = self._finder.find(frame, followed=self._update.followed(time_s), lost=lost)
            self._candidates_px, nothing = self._finder.candidates_px, self._finder.status
        else:
            seen = with_numbers(frame, self._sheets.ring.count)
            self._candidates_px = seen.centroids_px
        self._not_shown = self._shows_no_ring(frame)
        if lost and len(seen.led_numbers) >= self._update.pose_leds:
            self._update.begin_again(seen)
        if len(seen.led_numbers) > 0:
            return self._update.use(seen)
        self._update.nothing()
        return nothing

    def _shows_no_ring(self, frame: CameraFrame | LedObservation) -> bool:
        """Whether a frame is of the whole field, and shows fewer spots than a ring is found by."""
        whole = not isinstance(frame, CameraFrame) or frame.window == self._sheets.camera.full_window
        return whole and len(self._candidates_px) < POSE_LEDS

    def contact_claim(self) -> ContactClaim | None:
        """Whether contact may be flown on the present belief, and why not; None before the first pose that was used."""
        return self._contact.claim(self._time_s)

    def _solution(self) -> NavSolution:
        state = self._filter.state(self._time_s)
        sigma_lateral_m = largest_sigma(state.covariance[4:6, 4:6])
        aged_s = self._time_s - self._update.used_time_s
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
            frame_time_stamp_s=self._update.used_time_s,
            candidates_px=self._candidates_px.copy(),  # of a frame that is told from the next one by it
            led_pixels_px=self._update.led_pixels_px.copy(),
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
