"""Prior belief about the pose and one frame, brought together.

A frame is taken whole: the cost of its lines of sight plus that of the prior is minimised (`model`, Eq. (3)); no
average of two Gaussians is formed. Far away or nearly frontal the lines of sight are a bent valley with two floors
(`planar`): a ring that noise makes look tilted looks nearer too, by a square law that no covariance of one floor
describes. The prior chooses the floor and the place along the valley, which also keeps the range free of bias.

Where the prior cannot choose, both floors count: with cost J_k and covariance P_k at floor k,

    weight_k ~ exp(-J_k / 2) sqrt(det P_k),     mean and covariance of the mixture                      (1)

so that a belief that may be on the wrong floor says so, and later frames can still change it. The frame's disagreement
with the prior is the likelihood ratio

    gate = min [lines of sight + prior] - min [lines of sight],                                         (2)

chi-square with 6 degrees of freedom where the problem is linear: then it is the squared Mahalanobis distance of the
frame's own pose from the prior. A pose that comes without its lines of sight is averaged with the prior as a Gaussian.
"""

from dataclasses import dataclass

import numpy as np

from dockair.nav.pose.descent import Descent, PosePrior
from dockair.nav.pose.estimate import PoseEstimate
from dockair.nav.pose.levenberg_marquardt import levenberg_marquardt
from dockair.rotations import Array, exp, log

_SAME_FLOOR_CHI2 = 1e-3  # squared distance, in sigmas, below which two ends of a descent are one floor
_NEGLIGIBLE_WEIGHT = 1e-9  # against the best floor's


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class PosePosterior:
    """Pose after a frame."""

    R_CD: Array  #: (3, 3)
    p_CD: Array  #: (3,) [m]
    covariance: Array  #: (6, 6) of (phi, delta) in camera axes [rad, m]
    gate_chi2: float  #: Eq. (2)


def posterior(prior: PosePrior, pose: PoseEstimate) -> PosePosterior | None:
    """Return the pose that explains prior and frame together; None when no minimum was found.

    Args:
        prior: the belief before the frame.
        pose: a converged estimate from the frame alone; its alternative is considered too.
    """
    solutions = [pose] if pose.alternative is None else [pose, pose.alternative]
    if pose.measurement is None:
        return min((_gaussian(prior, solution) for solution in solutions), key=lambda p: p.gate_chi2)
    starts = [(prior.R_CD, prior.p_CD), *((s.R_CD, s.p_CD) for s in solutions)]
    ends = [levenberg_marquardt(pose.measurement, R, p, prior=prior) for R, p in starts]
    floors = sorted((end for end in ends if end.converged), key=lambda end: end.cost)
    if not floors:
        return None
    gate = floors[0].cost - min(s.chi2 for s in solutions)
    return _mixture([_floor(floors[0], gate), *(_floor(end, gate) for end in floors[1:])], [f.cost for f in floors])


def _floor(end: Descent, gate: float) -> PosePosterior:
    return PosePosterior(R_CD=end.R_CD, p_CD=end.p_CD, covariance=np.linalg.inv(end.information), gate_chi2=gate)


def _mixture(floors: list[PosePosterior], costs: list[float]) -> PosePosterior:
    """Return the best floor, or mean and covariance of Eq. (1) if another one has weight."""
    best = floors[0]
    steps, weights = [np.zeros(6)], [1.0]
    covariances = [best.covariance]
    for floor, cost in zip(floors[1:], costs[1:], strict=True):
        step = np.concatenate([log(floor.R_CD @ best.R_CD.T), floor.p_CD - best.p_CD])
        nearest = min(float((step - s) @ np.linalg.solve(best.covariance, step - s)) for s in steps)
        ratio = np.linalg.det(np.linalg.solve(best.covariance, floor.covariance))
        weight = float(np.exp(-0.5 * (cost - costs[0])) * np.sqrt(max(ratio, 0.0)))
        if nearest > _SAME_FLOOR_CHI2 and weight > _NEGLIGIBLE_WEIGHT:
            steps.append(step)
            weights.append(weight)
            covariances.append(floor.covariance)
    if len(steps) == 1:
        return best
    w = np.array(weights) / np.sum(weights)
    mean = w @ np.array(steps)
    covariance = sum(wk * (Pk + np.outer(s - mean, s - mean)) for wk, Pk, s in zip(w, covariances, steps, strict=True))
    return PosePosterior(
        R_CD=exp(mean[:3]) @ best.R_CD,
        p_CD=best.p_CD + mean[3:],
        covariance=np.asarray(covariance),
        gate_chi2=best.gate_chi2,
    )


def _gaussian(prior: PosePrior, pose: PoseEstimate) -> PosePosterior:
    """Average two Gaussians; the covariance in Joseph's form."""
    S = np.linalg.inv(prior.covariance + pose.covariance)
    innovation = np.concatenate([log(pose.R_CD @ prior.R_CD.T), pose.p_CD - prior.p_CD])
    K = prior.covariance @ S
    step, A = K @ innovation, np.eye(6) - K
    return PosePosterior(
        R_CD=exp(step[:3]) @ prior.R_CD,
        p_CD=prior.p_CD + step[3:],
        covariance=A @ prior.covariance @ A.T + K @ pose.covariance @ K.T,
        gate_chi2=float(innovation @ S @ innovation),
    )
