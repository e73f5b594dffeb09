"""One frame's LEDs and a belief about what it shows, fitted together.

Unknown are the pose as seen and how far each LED seen is from its place in the ring's plane,

    y = (phi, delta, d),   R_CD = exp(phi) R_0,   p_CD = p_0 + delta,   LED at q_k + (0, d_k)             (1)

with a belief of mean 0 and covariance C. The image coordinates of an LED at c in camera axes are (-c_y/c_x, -c_z/c_x),
those of its ray are taken for measured, whitened by the ray's weight: residuals r(y), Jacobian -H. The fit is the
iterated extended Kalman filter's, which is Gauss-Newton's on r'r + y'C^-1 y but needs no inverse of C, so that
the LEDs' places may be known for certain:

    nu = r(y) + H y,   S = H C H' + 1,   y <- C g,   g <- g + t (H' S^-1 nu - g)                          (2)

t = 1 is halved while the cost r'r + g'Cg grows. A flat ring far away is a bent valley with two floors, so that
the fit begins at several poses; each end comes with its evidence (Laplace)

    log_evidence = -(r'r + g'Cg + log det S) / 2                                                          (3)

and the cost is the gate's chi-square, of two degrees of freedom an LED where the problem is linear. A belief
can tilt the valley so far that the floor it dislikes is one no more, only a shoulder: what one step from there makes
of it, the average of two Gaussians, stands for it.

Not modelled: LEDs out of the ring's plane, which the camera sees at the sine of the tilt.
Source: Bell & Cathey 1993, "The iterated Kalman filter update as a Gauss-Newton method".
"""

from dataclasses import dataclass

import numpy as np
from numba import njit

from dockair.nav.pose.measurement import LinesOfSight
from dockair.rotations import Array, log

POSE = 6
_SAME_FLOOR_CHI2 = 1e-3  # squared distance, in sigmas, below which two ends are one floor
_SHOULDER_CHI2 = 9.0  # distance from the floors at which a shoulder is worth its own hypothesis: 3 sigma
_MOST_STEPS, _MOST_HALVINGS = 30, 8
_SETTLED_CHI2 = 1e-8  # of a step: a ten-thousandth of a sigma


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
    log_evidence: float  #: Eq. (3)
    chi2: float


def explanations(seen: Seen, sight: LinesOfSight, starts: list[tuple[Array, Array]]) -> list[Explanation]:
    """Return every floor that is found from the belief and from the frame's own poses (R_CD, p_CD); none if none is."""
    ab, whiten = _image(sight)
    begin = [np.zeros(POSE)] + [np.concatenate([log(R @ seen.R_CD.T), p - seen.p_CD]) for R, p in starts]
    ends: list[tuple[Explanation, Array]] = []
    shoulders: list[tuple[Explanation, Array]] = []
    for k, pose in enumerate(begin):
        numbers = fitted(seen.R_CD, seen.p_CD, seen.points_D, seen.C, ab, whiten, pose)
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
        step = (new[0].y - end.y)[:POSE]
        if step @ np.linalg.solve(C, step) < least_chi2:
            return
    ends.append(new)


def _image(sight: LinesOfSight) -> tuple[Array, Array]:
    """(n, 2) image coordinates of the rays, focal length 1, and (n, 2, 2) what whitens them."""
    h = sight.rays
    ab = -h[:, 1:] / h[:, :1]
    s = np.sqrt(1.0 + (ab**2).sum(axis=1))
    turn = -h[:, :, None] * (ab / s[:, None] ** 2)[:, None, :]  # d ray / d ab
    turn[:, 1, 0] -= 1.0 / s
    turn[:, 2, 1] -= 1.0 / s
    information = turn.transpose(0, 2, 1) @ sight.weights @ turn
    return np.ascontiguousarray(ab), np.ascontiguousarray(np.linalg.cholesky(information).transpose(0, 2, 1))


@njit(cache=True)
def _exp(phi: Array) -> tuple[Array, Array]:
    """(3, 3) exp(phi), and its left Jacobian."""
    angle = np.sqrt(phi[0] ** 2 + phi[1] ** 2 + phi[2] ** 2)
    p = 1.0 - angle**2 / 6.0 if angle < 1e-4 else np.sin(angle) / angle
    q = 0.5 - angle**2 / 24.0 if angle < 1e-4 else (1.0 - np.cos(angle)) / angle**2
    s = 1.0 / 6.0 - angle**2 / 120.0 if angle < 1e-4 else (angle - np.sin(angle)) / angle**3
    K = np.array([[0.0, -phi[2], phi[1]], [phi[2], 0.0, -phi[0]], [-phi[1], phi[0], 0.0]])
    KK = np.dot(K, K)
    return np.eye(3) + p * K + q * KK, np.eye(3) + q * K + s * KK


@njit(cache=True)
def _residuals(R: Array, p: Array, points: Array, ab: Array, whiten: Array, d: Array) -> tuple[bool, Array]:
    """R (2n,) of LEDs moved by d (2n,); false when one is behind the camera."""
    n = len(points)
    r = np.empty(2 * n)
    for k in range(n):
        Y, Z = points[k, 1] + d[2 * k], points[k, 2] + d[2 * k + 1]
        X = points[k, 0]
        x = R[0, 0] * X + R[0, 1] * Y + R[0, 2] * Z + p[0]
        if not x > 1e-3:
            return False, r
        da = ab[k, 0] + (R[1, 0] * X + R[1, 1] * Y + R[1, 2] * Z + p[1]) / x
        db = ab[k, 1] + (R[2, 0] * X + R[2, 1] * Y + R[2, 2] * Z + p[2]) / x
        r[2 * k] = whiten[k, 0, 0] * da + whiten[k, 0, 1] * db
        r[2 * k + 1] = whiten[k, 1, 0] * da + whiten[k, 1, 1] * db
    return True, r


@njit(cache=True)
def _jacobian(R: Array, J: Array, p: Array, points: Array, whiten: Array, d: Array) -> Array:
    """H (2n, 6 + 2n) at a pose whose turn has the left Jacobian J."""
    n = len(points)
    H = np.zeros((2 * n, 6 + 2 * n))
    for k in range(n):
        a = np.dot(R, np.array([points[k, 0], points[k, 1] + d[2 * k], points[k, 2] + d[2 * k + 1]]))
        x, y, z = a[0] + p[0], a[1] + p[1], a[2] + p[2]
        G = np.array([[y / x**2, -1.0 / x, 0.0], [z / x**2, 0.0, -1.0 / x]])
        G = np.dot(np.ascontiguousarray(whiten[k]), G)
        arm = np.array([[0.0, a[2], -a[1]], [-a[2], 0.0, a[0]], [a[1], -a[0], 0.0]])
        turned = np.dot(np.dot(G, arm), J)
        moved = np.dot(G, R)
        for i in range(2):
            for j in range(3):
                H[2 * k + i, j], H[2 * k + i, 3 + j] = turned[i, j], G[i, j]
            H[2 * k + i, 6 + 2 * k], H[2 * k + i, 7 + 2 * k] = moved[i, 1], moved[i, 2]
    return H


@njit(cache=True)
def _spread(H: Array, C: Array) -> tuple[Array, Array]:
    """H C, and S of Eq. (2)."""
    HC = np.dot(H, C)
    return HC, np.dot(HC, H.T) + np.eye(len(H))


@njit(cache=True)
def _ended(HC: Array, S: Array, C: Array, cost: float) -> tuple[float, Array]:
    """Eq. (3), and (6, 6) the pose's covariance."""
    at_pose = np.ascontiguousarray(HC[:, :6])
    return -0.5 * (cost + np.linalg.slogdet(S)[1]), C[:6, :6] - np.dot(at_pose.T, np.linalg.solve(S, at_pose))


@njit(cache=True)
def fitted(
    R0: Array, p0: Array, points: Array, C: Array, ab: Array, whiten: Array, start: Array
) -> tuple[int, Array, Array, Array, float, float, Array, Array, Array, Array, float, float, Array]:
    """Run Eq. (2) from a pose `start` (6,).

    Returns:
        1 if it ended, 0 if not, -1 if an LED is behind the camera at the start; then twice H, nu, y, cost, Eq. (3),
        (6, 6) the pose's covariance: at the end, and after the first step, as if the problem were linear.
    """
    y, g = np.zeros(len(C)), np.zeros(len(C))
    y[:6] = start
    turn, J = _exp(y[:3])
    R = np.dot(turn, R0)
    ahead, r = _residuals(R, p0 + y[3:6], points, ab, whiten, y[6:])
    H = _jacobian(R, J, p0 + y[3:6], points, whiten, y[6:])
    nu = r + np.dot(H, y)
    HC, S = _spread(H, C)
    if not ahead:
        return -1, H, nu, y, np.inf, -np.inf, C[:6, :6], H, nu, y, np.inf, -np.inf, C[:6, :6]
    inverse_nu = np.linalg.solve(S, nu)
    first_H, first_nu, first_y, first_cost = H, nu, np.dot(C, np.dot(H.T, inverse_nu)), np.dot(nu, inverse_nu)
    first_evidence, first_C = _ended(HC, S, C, first_cost)
    cost, settled = np.inf, 0
    for _ in range(_MOST_STEPS):
        towards, t, better = np.dot(H.T, np.linalg.solve(S, nu)), 1.0, False
        for _halving in range(_MOST_HALVINGS):
            g_new = g + t * (towards - g)
            y_new = np.dot(C, g_new)
            turn, J = _exp(y_new[:3])
            R = np.dot(turn, R0)
            ahead, r_new = _residuals(R, p0 + y_new[3:6], points, ab, whiten, y_new[6:])
            cost_new = np.dot(r_new, r_new) + np.dot(g_new, y_new)
            better = ahead and cost_new <= cost
            if better:
                break
            t *= 0.5
        if not better:  # no step helps: as far down as numbers reach
            settled = 1 if cost < np.inf else 0
            break
        small = cost < np.inf and np.dot(g_new - g, y_new - y) < _SETTLED_CHI2
        y, g, r, cost = y_new, g_new, r_new, cost_new
        H = _jacobian(R, J, p0 + y[3:6], points, whiten, y[6:])
        nu = r + np.dot(H, y)
        HC, S = _spread(H, C)
        if small:
            settled = 1
            break
    evidence, after = _ended(HC, S, C, cost)
    return (
        settled, H, nu, y, cost, evidence, after,
        first_H, first_nu, first_y, first_cost, first_evidence, first_C,
    )  # fmt: skip
