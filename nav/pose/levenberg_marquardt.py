"""Levenberg-Marquardt on lines of sight: the solver that flies.

    X <- X + (H'WH + mu diag(H'WH))^-1 H'W (b - h)          [Yoon 2018, eq 65, sign mended]

The source leaves schedule and stop rule open; here, as `model.descend` says: mu falls tenfold after a step as good as
promised, rises after a bad one, and the descent has converged when the undamped step is a millionth of its own standard
deviation. Steps are taken in local coordinates (phi, delta): in the source's own (attitude, camera in drogue axes)
every tilt drags the camera along an arc of the range's radius, a valley that straight steps follow slowly.
A prior on the pose may join as one more measurement; then a frontal ring or a single LED is no difficulty.
"""

from dockair.nav.pose.descent import Descent, DescentSettings, PosePrior, descend
from dockair.nav.pose.measurement import LinesOfSight
from dockair.nav.pose.model import DIAGONAL, LOCAL
from dockair.rotations import Array

LEVENBERG_MARQUARDT = DescentSettings(
    coordinates=LOCAL,
    damping=DIAGONAL,
    first_damping=1e-4,  # small: a start is either near, or the schedule soon corrects it
    tolerance_sigma=1e-6,  # far below anything that noise lets one see
    max_iterations=60,  # from starts 60 degrees and half the range off the median is 6, 99 % end within 25
)


def levenberg_marquardt(
    sight: LinesOfSight,
    R_CD: Array,
    p_CD: Array,
    *,
    prior: PosePrior | None = None,
    settings: DescentSettings = LEVENBERG_MARQUARDT,
) -> Descent:
    """Return the minimum to which a start (R_CD, p_CD [m]) leads; see `descent.descend`."""
    return descend(sight, R_CD, p_CD, settings, prior)
