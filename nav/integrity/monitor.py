"""Does one frame agree with itself: name one bad LED, leave it out, and bound the error of what remains.

J, the weighted sum of squared residuals (a prior's too, if one is given), has 2 n + r - 6 degrees of freedom with n
LEDs and r directions that the prior knows. J <= T (`fault_test`) is CONSISTENT. Otherwise each LED in turn is left out
and the pose solved again from the rays of the others, both minima, because a fault of many pixels is far from linear.
An exclusion passes when its J_i <= T of two degrees of freedom less. The lowest is believed: EXCLUDED. None passes:
INCONSISTENT. Without degrees of freedom (three LEDs) nothing can be seen: NOT_ENOUGH. With two (four LEDs) a fault can
be seen but not named, for any three LEDs fit.

Not modelled: two bad LEDs at once, errors common to the LEDs (focal length, mounting, diameter of the ring), a prior
that is wrong, or that stems from frames with the same bad LED.
"""

from dataclasses import dataclass, replace
from enum import Enum

import numpy as np

from dockair.nav.integrity.fault_test import FaultTest, IntegritySettings, fault_test
from dockair.nav.integrity.levels import ProtectionLevels, separation_levels, slope_levels
from dockair.nav.integrity.minima import exclusions, minima_of, paired
from dockair.nav.integrity.sensitivity import sensitivity
from dockair.nav.pose.estimate import PoseEstimate, PoseStatus
from dockair.nav.pose.measurement import LinesOfSight
from dockair.nav.pose.prior import AttitudePrior, PosePrior, Prior
from dockair.rotations import Array

_NO_KNOWLEDGE = 1e-6  # a prior a thousand times wider than the solution in some direction is none in that direction
_POSE_PARAMETERS = 6


class IntegrityStatus(Enum):
    """What the test says."""

    CONSISTENT = "consistent"
    EXCLUDED = "one LED excluded"
    INCONSISTENT = "inconsistent"
    NOT_ENOUGH = "not enough LEDs to tell"
    NO_POSE = "no pose"


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Integrity:
    """What may be believed of one frame."""

    status: IntegrityStatus
    led: int | None = None  #: the LED left out, an index into the pixels that were solved; only when EXCLUDED
    pose: PoseEstimate  #: of the LEDs believed, and of the prior if one was given; else as it came
    levels: ProtectionLevels = ProtectionLevels()  #: of `pose`; inf unless CONSISTENT or EXCLUDED
    chi2: float = np.nan  #: J of all LEDs; NaN when there is nothing to test
    threshold: float = np.nan  #: T that J was held against
    local_chi2: Array  #: (n,) t_i of all LEDs, NaN where not seen; a fault of many pixels smears over its neighbours
    mirror_ruled_out: bool = False  #: whether the attitude is the only one that the frame allows


def check_integrity(
    pose: PoseEstimate, prior: Prior | None = None, settings: IntegritySettings | None = None
) -> Integrity:
    """Test one frame's pose and bound its error.

    Args:
        pose: from `solve_pose`, weighted in the tangent plane. If it was solved with Huber's loss, which hides a fault,
            or with a prior, it is solved again.
        prior: what is known from elsewhere than this frame, taken as one more measurement. A very large sigma of a
            `PosePrior` says that a direction is not known.
        settings: how often the monitor may be wrong.
    """
    settings, sight = settings or IntegritySettings(), pose.measurement
    nothing = Integrity(status=IntegrityStatus.NO_POSE, pose=pose, local_chi2=np.full(len(pose.led_chi2), np.nan))
    minima = [] if pose.status is not PoseStatus.CONVERGED or sight is None else minima_of(pose, sight, prior)
    if not minima or sight is None:
        return nothing
    freedom = 2 * len(sight.rays) + _known(prior, minima[0]) - _POSE_PARAMETERS
    if freedom < 1:
        return replace(nothing, status=IntegrityStatus.NOT_ENOUGH)
    test, fewer = fault_test(freedom, settings), fault_test(max(freedom - 2, 0), settings)
    if minima[0].cost > test.threshold:  # the start that was given may have led to the higher one
        minima = sorted(minima, key=lambda minimum: minimum.cost)
    first = minima[0]
    found = sensitivity(sight, first.R_CD, first.p_CD, first.covariance)
    nothing.local_chi2[np.isfinite(pose.led_chi2)] = found.local_chi2
    if first.cost > test.threshold:
        return _without_one(replace(nothing, chi2=first.cost, threshold=test.threshold), sight, prior, fewer)
    levels, alone = slope_levels(minima, sight, found, test, fewer)
    return Integrity(
        status=IntegrityStatus.CONSISTENT,
        pose=paired(minima),
        levels=levels,
        chi2=first.cost,
        threshold=test.threshold,
        local_chi2=nothing.local_chi2,
        mirror_ruled_out=alone,
    )


def _without_one(tested: Integrity, sight: LinesOfSight, prior: Prior | None, test: FaultTest) -> Integrity:
    """Return the result with one LED left out, or that there is no such LED."""
    seen = np.isfinite(tested.pose.led_chi2)
    passed = exclusions(sight, prior, seen, test.threshold) if test.degrees_of_freedom else []
    if not passed:
        return replace(tested, status=IntegrityStatus.INCONSISTENT)
    levels, alone = separation_levels(passed, sight, test)
    return replace(
        tested,
        status=IntegrityStatus.EXCLUDED,
        led=passed[0].led,
        pose=paired([exclusion.pose for exclusion in passed if exclusion.led == passed[0].led]),
        levels=levels,
        mirror_ruled_out=alone,
    )


def _known(prior: Prior | None, pose: PoseEstimate) -> int:
    """r: how many directions the prior knows; of a `PosePrior` those in which it is not far wider than the solution."""
    if isinstance(prior, PosePrior):
        share = np.linalg.eigvals(np.linalg.solve(prior.covariance, pose.covariance)).real
        return int((share > _NO_KNOWLEDGE).sum())
    if isinstance(prior, AttitudePrior):
        return int(np.linalg.matrix_rank(prior.information, hermitian=True))
    return 0 if prior is None else 2  # a direction: across it, in both directions
