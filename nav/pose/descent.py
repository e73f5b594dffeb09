"""One descent on lines of sight: what goes in, what comes out, and the call of the compiled loop in `model`."""

from dataclasses import dataclass

import numpy as np

from dockair.nav.pose import model
from dockair.nav.pose.measurement import LinesOfSight
from dockair.rotations import Array

_NO_PRIOR = np.zeros((0, 0))
_UNIT, _ZERO = np.eye(3), np.zeros(3)


@dataclass(frozen=True, slots=True, kw_only=True)
class DescentSettings:
    """Which member of the source's descent family, eqs (62)-(65), and when it stops."""

    coordinates: int  #: model.SOURCE or model.LOCAL
    damping: int  #: model.UNDAMPED, model.IDENTITY or model.DIAGONAL
    first_damping: float  #: mu at the start
    tolerance_sigma: float  #: length of the last step, in its own standard deviations
    max_iterations: int


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class PosePrior:
    """Belief about the pose before the frame; enters as one more measurement, Eq. (3) of `model`."""

    R_CD: Array  #: (3, 3)
    p_CD: Array  #: (3,) [m]
    covariance: Array  #: (6, 6) of (phi, delta) in camera axes [rad, m]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Descent:
    """Where a descent ended."""

    outcome: int  #: model.CONVERGED, NOT_CONVERGED, BEHIND or SINGULAR
    R_CD: Array  #: (3, 3)
    p_CD: Array  #: (3,) [m]
    covariance: Array  #: (6, 6) of (phi, delta) in camera axes, the prior included; NaN unless converged
    led_chi2: Array  #: (n,) weighted square of each LED's residual, two degrees of freedom each
    cost: float  #: their sum and the prior's share
    iterations: int

    @property
    def converged(self) -> bool:
        """True at a minimum."""
        return self.outcome == model.CONVERGED


def descend(
    sight: LinesOfSight, R_CD: Array, p_CD: Array, settings: DescentSettings, prior: PosePrior | None = None
) -> Descent:
    """Return the minimum to which a start leads.

    Args:
        sight: at least three lines of sight, or fewer with a prior.
        R_CD: (3, 3) start, drogue axes in camera axes.
        p_CD: (3,) start, drogue origin in camera axes [m].
        settings: which descent.
        prior: belief about the pose, with LOCAL coordinates only.
    """
    outcome, iterations, R, p, led_chi2, cost, covariance = model.descend(
        sight.rays,
        sight.weights,
        sight.points_D,
        np.ascontiguousarray(R_CD, dtype=float),
        np.ascontiguousarray(p_CD, dtype=float),
        _UNIT if prior is None else np.ascontiguousarray(prior.R_CD),
        _ZERO if prior is None else np.ascontiguousarray(prior.p_CD),
        _NO_PRIOR if prior is None else np.linalg.inv(prior.covariance),
        settings.coordinates,
        settings.damping,
        settings.first_damping,
        settings.tolerance_sigma,
        settings.max_iterations,
    )
    return Descent(
        outcome=outcome, R_CD=R, p_CD=p, covariance=covariance, led_chi2=led_chi2, cost=cost, iterations=iterations
    )
