"""Levenberg-Marquardt on lines of sight: the solver that flies.

    X <- X + (H'WH + mu diag(H'WH))^-1 H'W (b - h)          [Yoon 2018, eq 65, sign mended]

The source leaves schedule and stop rule open; here, as `descent_kernels` says: mu falls tenfold after a step as good as
promised, rises after a bad one, and the descent has converged when the undamped step is a thousandth of its own
standard deviation. Steps are taken in local coordinates (phi, delta): in the source's own (attitude, camera in drogue
axes) every tilt drags the camera along an arc of the range's radius, a valley that straight steps follow slowly. One
entry for each angle lets the tilt of a frontal ring run: the three share the largest of diag(H'WH).
`AS_PRINTED` does neither, for the reproduction of its divergence; it takes no prior.
A prior may join as one more measurement; then a frontal ring or a single LED is no difficulty.
"""

from dataclasses import replace

from dockair.nav.pose.descent import Descent, DescentSettings, descend
from dockair.nav.pose.descent_kernels import DIAGONAL
from dockair.nav.pose.measurement import LinesOfSight
from dockair.nav.pose.model import LOCAL, SOURCE
from dockair.nav.pose.prior import Prior
from dockair.rotations import Array

LEVENBERG_MARQUARDT = DescentSettings(
    coordinates=LOCAL,
    damping=DIAGONAL,
    first_damping=1e-4,  # small: a start is either near, or the schedule soon corrects it
    tolerance_sigma=1e-3,  # that step is still taken, and leaves less than a hundredth of itself
    max_iterations=60,  # from starts 60 degrees and half the range off the median is 6, 99 % end within 15
)
AS_PRINTED = replace(LEVENBERG_MARQUARDT, coordinates=SOURCE)  #: eq (65) in the source's coordinates; no prior


def levenberg_marquardt(
    sight: LinesOfSight,
    R_CD: Array,
    p_CD: Array,
    *,
    prior: Prior | None = None,
    settings: DescentSettings = LEVENBERG_MARQUARDT,
) -> Descent:
    """Return the minimum to which a start (R_CD, p_CD [m]) leads; see `descent.descend`."""
    return descend(sight, R_CD, p_CD, settings, prior)
