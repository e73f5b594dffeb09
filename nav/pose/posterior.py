"""Prior belief about the pose and one frame, brought together.

A frame is taken whole: the cost of its lines of sight plus that of the prior is minimised (`normal_equations`, Eq.
(1)); no average of two Gaussians is formed. Far away or nearly frontal the lines of sight are a bent valley with two
floors (`planar`): a ring that noise makes look tilted looks nearer too, by a square law that no covariance of one floor
describes. The prior chooses the floor and the place along the valley, which also keeps the range free of bias: frontal
ring, 20 m, 0.1 px, 1 degree of prior: 2 mm; the average of two Gaussians 11 mm, the frame alone -23 mm.
Where the prior cannot choose, each floor k with cost J_k and covariance P_k is returned with its evidence (Laplace)

    log_evidence = -J_k / 2 + (log det P_k - log det P_prior) / 2                        (1)

and the frame's disagreement with the prior is the likelihood ratio

    gate = J_k - min [lines of sight alone],                                             (2)

A prior can tilt the valley so far that the floor it dislikes is one no more, only a shoulder; then the average of two
Gaussians, prior and the frame's own pose on that side, stands for it. Eq. (2) is
chi-square with 6 degrees of freedom where the problem is linear: then it is the squared Mahalanobis distance of the
frame's own pose from the prior. A pose that comes without its lines of sight is averaged with the prior as a Gaussian.
"""

from dataclasses import dataclass

import numpy as np

from dockair.nav.pose.descent import PosePrior
from dockair.nav.pose.difference import pose_difference
from dockair.nav.pose.estimate import PoseEstimate
from dockair.nav.pose.levenberg_marquardt import levenberg_marquardt
from dockair.rotations import Array, exp

_SAME_FLOOR_CHI2 = 1e-3  # squared distance, in sigmas, below which two ends of a descent are one floor
_SHOULDER_CHI2 = 9.0  # distance from the floors at which a shoulder is worth its own hypothesis: 3 sigma


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class PosePosterior:
    """A pose that explains prior and frame."""

    R_CD: Array  #: (3, 3)
    p_CD: Array  #: (3,) [m]
    covariance: Array  #: (6, 6) of (phi, delta) in camera axes [rad, m]
    log_evidence: float  #: Eq. (1), less what all floors and priors of one frame have in common
    gate_chi2: float  #: Eq. (2)


def posteriors(prior: PosePrior, pose: PoseEstimate) -> list[PosePosterior]:
    """Return every floor to which prior, pose and its alternative lead; empty when there is none.

    Args:
        prior: the belief before the frame.
        pose: a converged estimate from the frame alone.
    """
    solutions = [pose] if pose.alternative is None else [pose, pose.alternative]
    free_chi2 = min(solution.chi2 for solution in solutions)
    log_det = float(np.linalg.slogdet(prior.covariance)[1])
    gaussians = [_gaussian(prior, log_det, solution, free_chi2) for solution in solutions]
    if pose.measurement is None:
        return gaussians
    floors: list[PosePosterior] = []
    for R, p in [(prior.R_CD, prior.p_CD), *((s.R_CD, s.p_CD) for s in solutions)]:
        end = levenberg_marquardt(pose.measurement, R, p, prior=prior)
        if end.converged:
            floor = PosePosterior(
                R_CD=end.R_CD,
                p_CD=end.p_CD,
                covariance=end.covariance,
                log_evidence=0.5 * (float(np.linalg.slogdet(end.covariance)[1]) - log_det - end.cost),
                gate_chi2=end.cost - free_chi2,
            )
            _add(floors, floor, _SAME_FLOOR_CHI2)
    for gaussian in gaussians:
        _add(floors, gaussian, _SHOULDER_CHI2)
    return floors


def _add(floors: list[PosePosterior], new: PosePosterior, least_chi2: float) -> None:
    """Append a floor unless it is as near to a known one, in that one's sigmas."""
    for floor in floors:
        step = pose_difference(new.R_CD, new.p_CD, floor.R_CD, floor.p_CD)
        if step @ np.linalg.solve(floor.covariance, step) < least_chi2:
            return
    floors.append(new)


def _gaussian(prior: PosePrior, log_det: float, pose: PoseEstimate, free_chi2: float) -> PosePosterior:
    """Average two Gaussians; the covariance in Joseph's form."""
    S = np.linalg.inv(prior.covariance + pose.covariance)
    innovation = pose_difference(pose.R_CD, pose.p_CD, prior.R_CD, prior.p_CD)
    K = prior.covariance @ S
    step, A = K @ innovation, np.eye(6) - K
    covariance = A @ prior.covariance @ A.T + K @ pose.covariance @ K.T
    distance = float(innovation @ S @ innovation)
    return PosePosterior(
        R_CD=exp(step[:3]) @ prior.R_CD,
        p_CD=prior.p_CD + step[3:],
        covariance=covariance,
        log_evidence=0.5 * (float(np.linalg.slogdet(covariance)[1]) - log_det - distance - pose.chi2),
        gate_chi2=distance + pose.chi2 - free_chi2,
    )
