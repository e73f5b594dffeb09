"""What may be claimed of the belief for contact, from frame to frame.

The claim is that of the newest pose which was tested (`integrity.contact`), about the belief as it is now, and wider by
what the belief foretells wrongly while no frame comes (`integrity.coasting`). A pose that the filter's gate refuses is
one, too: close in what is refused may be off by a few hundredths of a pixel, which is tenths of a millimetre of drogue.
If the drogue has been struck it has gone the way d to that pose since the last frame that was used, in the time t, and
goes on,

    the belief is off by d (1 + age / t)                                                                  (1)

Where that is more than some millimetres (`refused_m`), or a newer frame contradicts itself, the claim ends until a pose
is tested again; of a belief that had to be widened after a blow the covariance is asked. In the basket neither is so:
it is the probe that strikes the drogue there, at no more than the closure speed.
"""

import numpy as np

from dockair.calibration import NavigationSheets
from dockair.nav.fusion import FilterState, RelativeFilter
from dockair.nav.integrity.coasting import CoastingError, CoastingSettings
from dockair.nav.integrity.contact import ContactClaim, ContactLimits, usable_for_contact
from dockair.nav.integrity.monitor import Integrity
from dockair.nav.integrity.sensitivity import moved_by_places
from dockair.rotations import Array

_PERIODS = 1.5  # of the camera, between two frames of which none is missing


def look_back_s(sheets: NavigationSheets, limits: ContactLimits, coasting: CoastingSettings) -> float:
    """Return how long before a frame one may have been taken that is asked what it foretold of it.

    The newest that is as old as the horizon, if frames come as they should; after a drop-out an older one, unless the
    claim had ended meanwhile: the drogue is found again then, which says nothing of a belief that follows it.
    """
    return max(limits.age_s, coasting.horizon_s + _PERIODS / sheets.camera_rate_hz)


class ContactWatch:
    """Keeps the newest test of a pose, and what has become of the belief since.

    Args:
        sheets: mounting, ring and the camera's rate.
        belief: that the claim is about.
        limits: alert limits.
        coasting: how the belief is asked what it foretold.
    """

    def __init__(
        self,
        sheets: NavigationSheets,
        belief: RelativeFilter,
        limits: ContactLimits,
        coasting: CoastingSettings,
    ) -> None:
        self._R_BC, self._rim_m = sheets.mounting.R_BC, 0.5 * sheets.ring.diameter_m
        self._camera_rate_hz = sheets.camera_rate_hz
        self._belief, self._limits = belief, limits
        self._horizon_s, self._coasting = coasting.horizon_s, CoastingError(coasting)
        self._look_back_s = look_back_s(sheets, limits, coasting)
        self._integrity: Integrity | None = None
        self._posed_time_s = self._used_time_s = float("nan")
        self._contradicted_s = -np.inf
        self._learnt_m: Array = np.zeros(3)  # what the pose owes to the LEDs' places that are learnt, camera axes
        self._in_basket = False

    def used(self, checked: Integrity, points_D: Array, time_s: float) -> None:
        """Take note of a pose that has corrected the belief; a late one leaves the claim that of a newer.

        Args:
            checked: the pose and its test.
            points_D: (n, 3) places of its LEDs by the sheet [m].
            time_s: stamp of its frame.
        """
        is_newest = self._tested(checked, points_D, time_s)
        self.corrected(time_s)  # as a late one has, too
        if not is_newest:
            return
        if self._coasting.due(time_s):
            self._ask_coasting(time_s)

    def corrected(self, time_s: float) -> None:
        """Take note of a frame that has corrected the belief, also with LEDs too few for a pose."""
        self._used_time_s = float(np.fmax(time_s, self._used_time_s))

    def refused(self, checked: Integrity, points_D: Array, time_s: float) -> None:
        """Take note of a pose that passed its own test and has not corrected the belief; arguments as of `used`."""
        if self._integrity is not None:  # before the first that was used there is no belief to claim anything of
            self._tested(checked, points_D, time_s)

    def _tested(self, checked: Integrity, points_D: Array, time_s: float) -> bool:
        """Make a pose the one that is claimed by, unless there is a newer one."""
        if time_s < self._posed_time_s:
            return False
        self._integrity, self._posed_time_s = checked, time_s
        self._learnt_m = moved_by_places(checked.pose, points_D)[3:]
        return True

    def contradicted(self, time_s: float) -> None:
        """Take note of a frame whose LEDs contradict one another or, too few for a pose, the belief."""
        self._contradicted_s = max(time_s, self._contradicted_s)

    def found_again(self) -> None:
        """Take note that the belief begins anew, so that it does not know any more of the tip in the basket."""
        self._in_basket = False

    def claim(self, time_s: float) -> ContactClaim | None:
        """Return whether contact may be flown on the belief of a time, and why not; None before the first pose."""
        if self._integrity is None:
            return None
        offset_m = self._integrity.pose.p_CD - self._belief.predicted_pose(self._posed_time_s)[1]
        age_s = time_s - self._posed_time_s
        if -1.0 / self._camera_rate_hz <= age_s < 0.0:  # the clocks of camera and IMU may differ by a little
            age_s = 0.0
        contradicted = self._contradicted_s > self._posed_time_s
        if self._posed_time_s > self._used_time_s:
            offset_m = offset_m * (1.0 + age_s / (self._posed_time_s - self._used_time_s))  # Eq. (1)
            contradicted |= bool(np.linalg.norm(offset_m) > self._limits.refused_m)
        levels = self._integrity.levels.about(offset_m).about(self._learnt_m)  # what is learnt may be a fault
        levels = self._coasting.added(levels, age_s, self._sigmas_to_ask_m(time_s))
        return usable_for_contact(
            self._integrity,
            age_s,
            self._limits,
            levels=levels,
            in_basket=self._in_basket,
            contradicted=contradicted,
        )

    def note_basket(self, state: FilterState, claim: ContactClaim | None, *, usable: bool) -> None:
        """Note whether the tip is in the basket: it went in inside the rim, on a usable belief, and has stayed."""
        p_DP = -state.R_BD.T @ state.p_PD_B
        aside_m = float(np.hypot(p_DP[1], p_DP[2]))
        stays = self._in_basket and p_DP[0] > 0.0 and aside_m <= self._rim_m
        within = claim is not None and p_DP[0] > claim.levels.range_m
        self._in_basket = bool(stays or (usable and within and aside_m <= self._rim_m - self._limits.lateral_m))

    def _ask_coasting(self, time_s: float) -> None:
        """Hold what had been foretold for a frame against what is believed with it."""
        foretold_B, age_s = self._belief.foretold_p_PD_B(time_s, self._horizon_s)
        if age_s <= self._look_back_s:  # NaN where none is kept
            error_B = self._belief.p_PD_B(time_s) - foretold_B
            self._coasting.take(self._R_BC.T @ error_B, age_s, time_s)

    def _sigmas_to_ask_m(self, time_s: float) -> Array:
        """(3,) of the belief in camera axes [m]; 0 where what it foretold wrongly says all: with IMU, well followed."""
        posed_s = self._posed_time_s
        unstruck = self._in_basket or posed_s - self._belief.doubted_s > self._horizon_s
        if unstruck and self._coasting.is_of(posed_s) and self._belief.felt(posed_s, time_s):
            return np.zeros(3)
        covariance = self._belief.predicted_pose(time_s)[2]
        return np.asarray(np.sqrt(np.diag(covariance)[3:]))
