"""Gaussian least squares differential correction: the source's first solver.

    X <- X + (H'WH)^-1 H'W (b - h),     X = (p, o)          [Yoon 2018, eq 62]

Gauss-Newton in the source's coordinates: attitude as MRP and the camera's position in drogue axes. It has no step
control: from a poor start it may diverge, which is a status of the result, and why `levenberg_marquardt` flies. It has
converged when a step is shorter than a millionth of its own standard deviation, or promises less than the cost's
rounding (with noise in the pixels one of 1e-5 does); after half of the 60 steps a hundredth is enough. It has not after
60 steps, or when an LED comes behind the camera. Kept as the reference of the source and to count its divergence. It
takes no prior.
"""

from dockair.nav.pose.descent import Descent, DescentSettings, descend
from dockair.nav.pose.descent_kernels import UNDAMPED
from dockair.nav.pose.measurement import LinesOfSight
from dockair.nav.pose.model import SOURCE
from dockair.rotations import Array

GLSDC = DescentSettings(
    coordinates=SOURCE, damping=UNDAMPED, first_damping=0.0, tolerance_sigma=1e-6, max_iterations=60
)


def glsdc(sight: LinesOfSight, R_CD: Array, p_CD: Array, *, settings: DescentSettings = GLSDC) -> Descent:
    """Return the minimum to which a start (R_CD, p_CD [m]) leads; see `descent.descend`."""
    return descend(sight, R_CD, p_CD, settings)
