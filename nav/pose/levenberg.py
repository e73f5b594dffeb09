"""Levenberg's descent: between Gauss-Newton and the gradient.

    X <- X + (H'WH + mu I)^-1 H'W (b - h),     X = (p, o)          [Yoon 2018, eq 64, sign mended]

The source leaves schedule and stop rule open; here mu is counted in the largest diagonal entry of H'WH, starts at 1e-4
of it, falls up to tenfold after a step as good as promised and rises tenfold after one that raises the cost, which is
not taken. It has converged when the undamped step is shorter than a millionth of its own standard deviation, or
promises less than the cost's rounding; after half of the steps a hundredth is enough. One mu for metres and MRP alike
holds back what is hardly seen, the camera's place sideways, by orders of magnitude more than the rest: it seldom
diverges, but arrives late. For the reproduction; it takes no prior.
"""

from dockair.nav.pose.descent import Descent, DescentSettings, descend
from dockair.nav.pose.descent_kernels import IDENTITY
from dockair.nav.pose.measurement import LinesOfSight
from dockair.nav.pose.model import SOURCE
from dockair.rotations import Array

LEVENBERG = DescentSettings(
    coordinates=SOURCE, damping=IDENTITY, first_damping=1e-4, tolerance_sigma=1e-6, max_iterations=60
)


def levenberg(sight: LinesOfSight, R_CD: Array, p_CD: Array, *, settings: DescentSettings = LEVENBERG) -> Descent:
    """Return the minimum to which a start (R_CD, p_CD [m]) leads; see `descent.descend`."""
    return descend(sight, R_CD, p_CD, settings)
