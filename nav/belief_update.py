"""From the named LEDs of a frame to a corrected belief.

    named LEDs ► pose ► integrity ► fusion
                  └───────┴───────────► what may be claimed for contact (`contact_watch`)

A frame whose LEDs are too few to test one another is tested with the attitude that the frames before showed; one with
too few for a pose corrects a belief that follows the drogue, LED by LED, and begins none. LEDs are where the sheet has
them but for an as-built tolerance, a part of which the belief learns.
"""

from dataclasses import replace

import numpy as np

from dockair.calibration import NavigationSheets
from dockair.messages import LedObservation
from dockair.nav.contact_watch import ContactWatch
from dockair.nav.frame_checks import only
from dockair.nav.fusion import RelativeFilter
from dockair.nav.integrity.monitor import IntegrityStatus, check_integrity
from dockair.nav.navigator_settings import NavigatorSettings
from dockair.nav.pose.estimate import PoseStatus, solve_pose
from dockair.nav.pose.measurement import lines_of_sight_from_pixels
from dockair.nav.pose.prior import AttitudePrior
from dockair.rotations import Array

POSE_LEDS = 4  #: fewer are no pose without a belief ...
_LEAST_POSE_LEDS = 3  # ... and these are one with its attitude


class BeliefUpdate:
    """Corrects the belief, frame by frame.

    Args:
        sheets: camera and ring.
        settings: of the navigator.
        belief: that is corrected.
        contact: what takes note of each pose.
    """

    def __init__(
        self, sheets: NavigationSheets, settings: NavigatorSettings, belief: RelativeFilter, contact: ContactWatch
    ) -> None:
        self._sheets, self._settings, self._filter, self._contact = sheets, settings, belief, contact
        self._points_D = sheets.ring.positions_D
        #: LEDs that make a pose without a belief; a loose filter would take for news what fewer have of its attitude
        self.pose_leds = POSE_LEDS if settings.fusion.coupling == "tight" else settings.alone_leds
        self.used_time_s = float("nan")  #: stamp of the newest frame that has corrected the belief
        self.led_pixels_px = self._none()  #: (count, 2) of the newest frame's LEDs that were believed, NaN for the rest

    def followed(self, time_s: float) -> bool:
        """Whether the belief has been corrected lately enough to say which LED a single one is."""
        return time_s - self.used_time_s <= self._settings.usable_age_s

    def begin_again(self, seen: LedObservation) -> None:
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

    def nothing(self) -> None:
        """Take note of a frame without named LEDs."""
        self.led_pixels_px = self._none()

    def use(self, seen: LedObservation) -> str:
        """Correct the belief by a frame's named LEDs, one at least; return what became of it."""
        time_s, named = seen.time_stamp_s, seen.led_numbers
        self.led_pixels_px = self._none()
        self.led_pixels_px[named] = seen.centroids_px
        R_CD, p_CD, covariance = self._filter.predicted_pose(time_s)
        attitude = self._attitude_known(len(named), time_s, R_CD, covariance)
        tight = self._settings.fusion.coupling == "tight"
        few = len(named) < self.pose_leds
        if few and (attitude is None or len(named) < _LEAST_POSE_LEDS or not tight):
            return self._use_few(seen, R_CD, p_CD)
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
        self.led_pixels_px[named[~kept]] = np.nan
        if kept.sum() < _LEAST_POSE_LEDS:  # what is left makes no pose, whose claim it could be
            return self._use_few(only(seen, kept), R_CD, p_CD)
        sight = lines_of_sight_from_pixels(
            seen.centroids_px[kept],
            self._points_D[named[kept]],
            self._sheets.camera,
            self._unlearnt_px(seen, R_CD, p_CD)[kept],
        )
        if not self._filter.update(replace(checked.pose, measurement=sight), time_s):
            if self._filter.was_contradicted:  # a second frame of one stamp has asked no gate
                self._contact.refused(checked, self._points_D[named[kept]], time_s)
            return "pose refused by the gate"
        self._contact.used(checked, self._points_D[named[kept]], time_s)
        self.used_time_s = max(time_s, self.used_time_s)  # NaN before the first: the first of the two then
        return "pose used"

    def _none(self) -> Array:
        return np.full((len(self._points_D), 2), np.nan)

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
        if leds >= self._settings.alone_leds or not self.followed(time_s):
            return None
        return AttitudePrior(R_CD=R_CD, information=np.linalg.inv(covariance[:3, :3]))

    def _use_few(self, seen: LedObservation, R_CD: Array, p_CD: Array) -> str:
        """LEDs too few for a pose correct a belief that follows the drogue, and begin none."""
        time_s = seen.time_stamp_s
        if self._settings.fusion.coupling != "tight" or not self.followed(time_s):
            return "pose too few LEDs"
        sigma_px = self._unlearnt_px(seen, R_CD, p_CD)
        if not self._filter.update_leds(seen.centroids_px, self._points_D[seen.led_numbers], sigma_px, time_s):
            if self._filter.was_contradicted:
                self._contact.contradicted(time_s)
            return "LEDs refused by the gate"
        self.used_time_s = max(time_s, self.used_time_s)
        self._contact.corrected(time_s)
        return "LEDs used"
