"""One frame's LEDs and a belief about what it shows, fitted together.

Unknown are the pose as seen and how far each LED seen is from its place in the ring's plane,

    y = (phi, delta, d),   R_CD = exp(phi) R_0,   p_CD = p_0 + delta,   LED at q_k + (0, d_k)             (1)

with a belief of mean 0 and covariance C. The image coordinates of an LED at c in camera axes are (-c_y/c_x, -c_z/c_x),
those of its ray are taken for measured, whitened by the ray's weight: residuals r(y), Jacobian -H. The fit is the
iterated extended Kalman filter's, which is Gauss-Newton's on r'r + y'C^-1 y but needs no inverse of C, so that
the LEDs' places may be known for certain:

    nu = r(y) + H y,   S = H C H' + 1,   y <- C g,   s = H' S^-1 nu - g,   g <- g + s / k                  (2)

k is the cost's curvature along the last step, in Gauss-Newton's, which leaves out that of the residuals: nearly
frontal it is 0.2 to 1.9, and full steps swing to and fro or creep, some without an end. After a step Dg, Dy it is
known from how much of s is left [Barzilai & Borwein 1988]; 1 at first, and doubled while the cost r'r + g'Cg grows:

    k <- k - s'Dy / Dg'Dy                                                                                 (3)

A flat ring far away is a bent valley with two floors, so that the fit begins at several poses; each end comes with its
evidence (Laplace)

    log_evidence = -(r'r + g'Cg + log det S) / 2                                                          (4)

and the cost is the gate's chi-square, of two degrees of freedom an LED where the problem is linear. A belief
can tilt the valley so far that the floor it dislikes is one no more, only a shoulder: what one step from there makes
of it, the average of two Gaussians, stands for it.

Not modelled: LEDs out of the ring's plane, which the camera sees at the sine of the tilt.
Source: Bell & Cathey 1993, "The iterated Kalman filter update as a Gauss-Newton method"; Barzilai & Borwein 1988,
"Two-point step size gradient methods".
"""

from dataclasses import dataclass

from dockair.nav.belief_fit import distance2, fitted, image_of
from dockair.nav.pose.measurement import LinesOfSight
from dockair.rotations import Array

_SAME_FLOOR_CHI2 = 1e-3  # squared distance, in sigmas, below which two ends are one floor
_SHOULDER_CHI2 = 9.0  # distance from the floors at which a shoulder is worth its own hypothesis: 3 sigma


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Seen:
    """What is believed that a frame shows, before it is looked at."""

    R_CD: Array  #: (3, 3)
    p_CD: Array  #: (3,) [m]
    points_D: Array  #: (n, 3) LEDs of the frame, where they are believed to be on the drogue [m]
    C: Array  #: (6 + 2n, 6 + 2n)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Explanation:
    """One end of the fit."""

    H: Array  #: (2n, 6 + 2n) whitened
    nu: Array  #: (2n,) of Eq. (2), whitened
    y: Array  #: (6 + 2n,)
    log_evidence: float  #: Eq. (4)
    chi2: float


def explanations(seen: Seen, sight: LinesOfSight, starts: list[tuple[Array, Array]]) -> list[Explanation]:
    """Return every floor that is found from the belief and from the frame's own poses (R_CD, p_CD); none if none is."""
    ab, whiten = image_of(sight.rays, sight.weights)
    ends: list[tuple[Explanation, Array]] = []
    shoulders: list[tuple[Explanation, Array]] = []
    for k, (R, p) in enumerate([(seen.R_CD, seen.p_CD), *starts]):
        numbers = fitted(seen.R_CD, seen.p_CD, seen.points_D, seen.C, ab, whiten, R, p)
        settled = numbers[0]
        if settled > 0:
            _add(ends, _explanation(*numbers[1:7]), _SAME_FLOOR_CHI2)
        if settled >= 0 and k > 0:
            shoulders.append(_explanation(*numbers[7:]))
    for shoulder in shoulders:
        _add(ends, shoulder, _SHOULDER_CHI2)
    return [end for end, _ in ends]


def _explanation(
    H: Array, nu: Array, y: Array, cost: float, log_evidence: float, C: Array
) -> tuple[Explanation, Array]:
    return Explanation(H=H, nu=nu, y=y, log_evidence=log_evidence, chi2=cost), C


def _add(ends: list[tuple[Explanation, Array]], new: tuple[Explanation, Array], least_chi2: float) -> None:
    """Append an end unless it is as near to a known one, in that one's sigmas."""
    for end, C in ends:
        if distance2(new[0].y, end.y, C) < least_chi2:
            return
    ends.append(new)
