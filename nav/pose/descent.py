"""One descent to a minimum of the pose's cost: what goes in, what comes out, and the call of the loop."""

from dataclasses import dataclass

import numpy as np

from dockair.errors import DockairError
from dockair.nav.pose import descent_kernels, model
from dockair.nav.pose.measurement import LinesOfSight
from dockair.nav.pose.prior import NO_PRIOR, Prior
from dockair.nav.pose.prior import PosePrior as PosePrior
from dockair.rotations import Array

_NO_LENS: Array = np.zeros(8)


@dataclass(frozen=True, slots=True, kw_only=True)
class DescentSettings:
    """Which member of the source's descent family, eqs (62)-(65), when it stops, and its loss."""

    coordinates: int  #: model.SOURCE or model.LOCAL
    damping: (
        int  #: descent_kernels.UNDAMPED, descent_kernels.IDENTITY, descent_kernels.DIAGONAL or descent_kernels.GRADIENT
    )
    first_damping: float  #: mu at the start
    tolerance_sigma: float  #: length of the last step, in its own standard deviations
    max_iterations: int
    huber_sigma: float = np.inf  #: residual of an LED, u and v together, beyond which it counts linearly


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Descent:
    """Where a descent ended."""

    outcome: int  #: descent_kernels.CONVERGED, NOT_CONVERGED, BEHIND or SINGULAR
    R_CD: Array  #: (3, 3)
    p_CD: Array  #: (3,) [m]
    covariance: Array  #: (6, 6) of (phi, delta) in camera axes, the prior included; NaN unless converged
    led_chi2: Array  #: (n,) weighted square of each LED's residual, two degrees of freedom each
    chi2: float  #: their sum
    cost: float  #: what was minimised: the same, less what Huber's loss spares, and the prior's share
    iterations: int
    information: Array  #: (6, 6) its inverse, also when that does not exist; NaN unless converged

    @property
    def converged(self) -> bool:
        """True at a minimum."""
        return self.outcome == descent_kernels.CONVERGED


def descend(
    sight: LinesOfSight,
    R_CD: Array,
    p_CD: Array,
    settings: DescentSettings,
    prior: Prior | None = None,
    *,
    hold_attitude: bool = False,
) -> Descent:
    """Return the minimum to which a start leads.

    Args:
        sight: at least three lines of sight, or fewer with a prior.
        R_CD: (3, 3) start, drogue axes in camera axes.
        p_CD: (3,) start, drogue origin in camera axes [m].
        settings: which descent.
        prior: what is known beside, with LOCAL coordinates only.
        hold_attitude: solve for the position alone, with LOCAL coordinates only; `information` is still of all six,
            and the covariance its inverse.

    Raises:
        DockairError: a prior or a held attitude with SOURCE coordinates.
    """
    if settings.coordinates != model.LOCAL and (prior is not None or hold_attitude):
        raise DockairError("settings.coordinates", expected="LOCAL with a prior or a held attitude", got="SOURCE")
    if sight.pixels is None or sight.lens is None:
        measured, weights, lens = sight.rays, sight.weights, _NO_LENS
    else:
        measured, weights, lens = sight.pixels, _pixel_weights(sight.sigma_px), sight.lens
    outcome, iterations, R, p, led_chi2, chi2, cost, covariance, information = descent_kernels.descend(
        measured,
        weights,
        sight.points_D,
        lens,
        np.ascontiguousarray(R_CD, dtype=float),
        np.ascontiguousarray(p_CD, dtype=float),
        *(NO_PRIOR if prior is None else prior.terms),
        settings.huber_sigma,
        hold_attitude,
        settings.coordinates,
        settings.damping,
        settings.first_damping,
        settings.tolerance_sigma,
        settings.max_iterations,
    )
    return Descent(
        outcome=outcome,
        R_CD=R,
        p_CD=p,
        covariance=covariance,
        led_chi2=led_chi2,
        chi2=chi2,
        cost=cost,
        iterations=iterations,
        information=information,
    )


def _pixel_weights(sigma_px: Array) -> Array:
    """(n, 3, 3) of pixel residuals, whose third row is empty."""
    return np.asarray(np.diag((1.0, 1.0, 0.0)) / (sigma_px**2)[:, None, None])
