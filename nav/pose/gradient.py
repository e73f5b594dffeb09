"""Steepest descent: the source's first cure for a Gauss-Newton that diverges.

    X <- X + 2 lambda H'W (b - h),     X = (p, o)          [Yoon 2018, eq 63, sign mended]

The source leaves lambda open; here 2 lambda = 1/(mu tr H'WH), which cannot overshoot a quadratic valley at mu = 1 since
the trace exceeds every eigenvalue. mu falls after a step as good as promised and rises tenfold after one that raises
the cost, which is not taken. It has converged when the undamped step (62) from there would be shorter than a thousandth
of its own standard deviation. Metres and MRP being summed as they are, the valley is narrow by the square root of the
condition number of H'WH, 1e4 to 1e6 here: it creeps, and mostly does not arrive. For the reproduction alone.
"""

from dockair.nav.pose.descent import Descent, DescentSettings, descend
from dockair.nav.pose.descent_kernels import GRADIENT as GRADIENT_STEP
from dockair.nav.pose.measurement import LinesOfSight
from dockair.nav.pose.model import SOURCE
from dockair.rotations import Array

GRADIENT = DescentSettings(
    coordinates=SOURCE,
    damping=GRADIENT_STEP,
    first_damping=1.0,
    tolerance_sigma=1e-3,
    max_iterations=2000,  # a few milliseconds; ten times as many change little
)


def gradient(sight: LinesOfSight, R_CD: Array, p_CD: Array, *, settings: DescentSettings = GRADIENT) -> Descent:
    """Return where a start (R_CD, p_CD [m]) leads; see `descent.descend`."""
    return descend(sight, R_CD, p_CD, settings)
