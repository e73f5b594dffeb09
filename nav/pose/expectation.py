"""Mean and covariance over both minima of a frame: what it says to those who have nothing else to choose by.

Between the two minima of a flat ring lies a pass: the attitude half way from one to the other, nearly frontal, with the
position that fits it best. A frontal ring whose noise looks like tilt has its truth there. With costs J_k of the first
minimum, the second and the pass, and d_k the pose less the first, (phi, delta):

    w_k = exp(-J_k/2) / Sum_j exp(-J_j/2),   mean = Sum_k w_k d_k from the first                                 (1)
    P = Sum_k w_k (P_k + (d_k - mean)(d_k - mean)'),   at the pass P is the mean of the two                      (2)

Both minima have nearly the same tilt and so the same volume, which is why volumes do not count. Where one minimum is
far better this is that one; where they are alike, and a choice would be wrong every other time, the mean square error
is less than of either, and the covariance honest about the tilt. With Huber's loss the pass is solved without it.

Not modelled: the rest of the valley; a single minimum that noise has bent. A prior mends both.
"""

from dataclasses import dataclass

import numpy as np

from dockair.nav.pose.descent import descend
from dockair.nav.pose.difference import pose_difference
from dockair.nav.pose.estimate import PoseEstimate
from dockair.nav.pose.levenberg_marquardt import LEVENBERG_MARQUARDT
from dockair.rotations import Array, exp


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Expectation:
    """Eqs (1) and (2)."""

    R_CD: Array  #: (3, 3)
    p_CD: Array  #: (3,) [m]
    covariance: Array  #: (6, 6) of (phi, delta) in camera axes [rad, m]


def expectation(pose: PoseEstimate) -> Expectation:
    """Return mean and covariance over a converged pose and its alternative; of the pose itself when it has none."""
    other = pose.alternative
    if other is None or pose.measurement is None:
        return Expectation(R_CD=pose.R_CD, p_CD=pose.p_CD, covariance=pose.covariance)
    d_other = pose_difference(other.R_CD, other.p_CD, pose.R_CD, pose.p_CD)
    R = exp(0.5 * d_other[:3]) @ pose.R_CD
    middle = descend(pose.measurement, R, 0.5 * (pose.p_CD + other.p_CD), LEVENBERG_MARQUARDT, hold_attitude=True)
    d = np.stack([np.zeros(6), d_other, pose_difference(R, middle.p_CD, pose.R_CD, pose.p_CD)])
    costs = np.array([pose.cost, other.cost, middle.cost if middle.converged else np.inf])
    w = np.exp(-0.5 * (costs - costs.min()))
    w /= w.sum()
    mean = w @ d
    P = (w[0] + 0.5 * w[2]) * pose.covariance + (w[1] + 0.5 * w[2]) * other.covariance + (w * (d - mean).T) @ (d - mean)
    return Expectation(R_CD=exp(mean[:3]) @ pose.R_CD, p_CD=pose.p_CD + mean[3:], covariance=P)
