"""What each LED says against the pose, and how far a fault of it could push the pose unseen.

Linearised at the pose. With w_i (2,) the whitened residual of LED i (unit variance in both axes of its tangent plane),
A_i (2, 6) its derivative, P the covariance of the pose and K_i = P A_i' its gain:

    S_i = I - A_i P A_i'                             covariance of w_i                    (1)
    t_i = w_i' S_i^-1 w_i                            local test, chi-square with 2 degrees of freedom    (2)

t_i is also the amount by which the cost falls when LED i is left out. A fault b (2,) of LED i, in sigmas, moves the
pose by K_i b and has the length lambda = sqrt(b' S_i b) in the residuals. What it does to some rows (range, lateral,
attitude) for one unit of what it shows is at most, over all directions b,

    slope_i = largest singular value of rows(K_i) C_i^-T,     S_i = C_i C_i'              (3)

An LED that stands d (3,) from the place that it is taken to have moves the pose as the same error of its ray would,

    sum_i P A_i' A_i [0 R']' d_i                                                                          (4)

Source: R. G. Brown, A baseline GPS RAIM scheme, 1992 (slope), W. Baarda, A testing procedure for use in geodetic
networks, 1968 (local test); a GPS satellite has one axis, an LED two.
"""

from dataclasses import dataclass

import numpy as np

from dockair.kernels import njit
from dockair.nav.pose.estimate import PoseEstimate
from dockair.nav.pose.measurement import LinesOfSight
from dockair.rotations import Array

RANGE, LATERAL, ATTITUDE = 0, 1, 2  #: columns of slopes and places of sigmas
_UNSEEN = 1e-9  # least eigenvalue of S_i below which a fault of LED i may not show at all: rounding is left


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Sensitivity:
    """Of one pose, by LED and by kind of error: along the camera's x, across it (y, z), of attitude."""

    local_chi2: Array  #: (n,) Eq. (2)
    slopes: Array  #: (n, 3) Eq. (3) [m, m, rad per sigma]; inf where a fault would not show
    sigmas: Array  #: (3,) standard deviation in the worst direction [m, m, rad]


def sensitivity(sight: LinesOfSight, R_CD: Array, p_CD: Array, covariance: Array) -> Sensitivity:
    """Return the local tests and slopes at a pose.

    Args:
        sight: lines of sight.
        R_CD: (3, 3) the pose that was solved from them.
        p_CD: (3,) [m].
        covariance: (6, 6) of (phi, delta) in camera axes; with a prior if there was one.
    """
    local_chi2, slopes = _local_tests(
        sight.rays, sight.weights, sight.points_D, np.ascontiguousarray(R_CD), np.ascontiguousarray(p_CD), covariance
    )
    return Sensitivity(local_chi2=local_chi2, slopes=slopes, sigmas=worst_sigmas(covariance))


def moved_by_places(pose: PoseEstimate, places_D: Array) -> Array:
    """(6,) of (phi, delta) by which a pose would be another with its LEDs elsewhere, Eq. (4).

    Args:
        pose: converged, with its lines of sight.
        places_D: (n, 3) the LEDs' other places [m].
    """
    sight = pose.measurement
    if sight is None:
        raise ValueError("a pose without lines of sight")
    R, p = np.ascontiguousarray(pose.R_CD), np.ascontiguousarray(pose.p_CD)
    moved = (sight.points_D - places_D) @ R.T
    return np.asarray(pose.covariance @ _information_moved(sight.rays, sight.weights, sight.points_D, R, p, moved))


@njit(cache=True)
def worst_sigmas(covariance: Array) -> Array:
    """(3,) standard deviation along the camera's x [m], across it in the worst direction [m], of attitude [rad]."""
    P, sigmas = covariance, np.empty(3)
    sigmas[RANGE] = np.sqrt(P[3, 3])
    middle, spread = 0.5 * (P[4, 4] + P[5, 5]), 0.5 * (P[4, 4] - P[5, 5])
    sigmas[LATERAL] = np.sqrt(middle + np.sqrt(spread**2 + P[4, 5] ** 2))
    sigmas[ATTITUDE] = np.sqrt(np.linalg.eigvalsh(P[:3, :3].copy())[2])
    return sigmas


@njit(cache=True)
def _whitened(b: Array, W: Array, a: Array, p: Array, w: Array, A: Array) -> None:
    """Fill w (2,) and A (2, 6) of one LED at a = R q from its measured ray b and weight W: `pose.model`, Eq. (1)."""
    s, T, J, F = a + p, np.empty((2, 3)), np.empty((3, 6)), np.zeros((2, 3))
    length = np.sqrt(s[0] ** 2 + s[1] ** 2 + s[2] ** 2)
    h = s / length
    k = 1 if abs(b[1]) < abs(b[2]) else 2  # two tangents: the axis farther from b, made upright on it, and across
    for j in range(3):
        T[0, j] = (1.0 if j == k else 0.0) - b[k] * b[j]
    T[0] /= np.sqrt((T[0] ** 2).sum())
    T[1, 0] = b[1] * T[0, 2] - b[2] * T[0, 1]
    T[1, 1] = b[2] * T[0, 0] - b[0] * T[0, 2]
    T[1, 2] = b[0] * T[0, 1] - b[1] * T[0, 0]
    m = np.zeros((2, 2))
    for i in range(2):
        for j in range(2):
            for c in range(3):
                for d in range(3):
                    m[i, j] += T[i, c] * W[c, d] * T[j, d]
    u = np.sqrt(m[0, 0])  # upper Cholesky factor of T W T', times T
    v = m[0, 1] / u
    F[0], F[1] = u * T[0] + v * T[1], np.sqrt(m[1, 1] - v * v) * T[1]
    for i in range(3):
        for j in range(3):
            J[i, 3 + j] = ((1.0 if i == j else 0.0) - h[i] * h[j]) / length
        dx, dy, dz = J[i, 3], J[i, 4], J[i, 5]
        J[i, 0], J[i, 1], J[i, 2] = dz * a[1] - dy * a[2], dx * a[2] - dz * a[0], dy * a[0] - dx * a[1]
    for i in range(2):
        w[i] = 0.0
        for c in range(3):
            w[i] += F[i, c] * (b[c] - h[c])
        for j in range(6):
            A[i, j] = F[i, 0] * J[0, j] + F[i, 1] * J[1, j] + F[i, 2] * J[2, j]


@njit(cache=True)
def _largest_singular_value(K: Array, first: int, last: int, c00: float, c10: float, c11: float) -> float:
    """Of rows first:last of K (6, 2) times C^-T, C lower triangular."""
    g00, g01, g11 = 0.0, 0.0, 0.0
    for j in range(first, last):
        x = K[j, 0] / c00
        y = (K[j, 1] - c10 * x) / c11
        g00, g01, g11 = g00 + x * x, g01 + x * y, g11 + y * y
    return float(np.sqrt(0.5 * (g00 + g11) + np.sqrt(0.25 * (g00 - g11) ** 2 + g01 * g01)))


@njit(cache=True)
def _information_moved(rays: Array, weights: Array, points: Array, R: Array, p: Array, moved: Array) -> Array:
    """(6,) sum of A_i' A_i [0 I]' times how far each LED is moved (n, 3), camera axes."""
    w, A, out = np.empty(2), np.empty((2, 6)), np.zeros(6)
    for i in range(len(rays)):
        a = np.zeros(3)
        for j in range(3):
            a[j] = R[j, 0] * points[i, 0] + R[j, 1] * points[i, 1] + R[j, 2] * points[i, 2]
        _whitened(rays[i], weights[i], a, p, w, A)
        for k in range(2):
            shown = A[k, 3] * moved[i, 0] + A[k, 4] * moved[i, 1] + A[k, 5] * moved[i, 2]
            for j in range(6):
                out[j] += A[k, j] * shown
    return out


@njit(cache=True)
def _local_tests(rays: Array, weights: Array, points: Array, R: Array, p: Array, P: Array) -> tuple[Array, Array]:
    """(n,) Eq. (2) and (n, 3) Eq. (3)."""
    n = len(rays)
    tests, slopes, w, A, K, a = np.empty(n), np.empty((n, 3)), np.empty(2), np.empty((2, 6)), np.zeros((6, 2)), p * 0.0
    for i in range(n):
        for j in range(3):
            a[j] = R[j, 0] * points[i, 0] + R[j, 1] * points[i, 1] + R[j, 2] * points[i, 2]
        _whitened(rays[i], weights[i], a, p, w, A)
        K[:], s00, s01, s11 = 0.0, 1.0, 0.0, 1.0
        for j in range(6):
            for k in range(6):
                K[j, 0] += P[j, k] * A[0, k]
                K[j, 1] += P[j, k] * A[1, k]
            s00, s01, s11 = s00 - A[0, j] * K[j, 0], s01 - A[0, j] * K[j, 1], s11 - A[1, j] * K[j, 1]
        least = 0.5 * (s00 + s11) - np.sqrt(0.25 * (s00 - s11) ** 2 + s01 * s01)
        if not least > _UNSEEN:
            tests[i], slopes[i] = 0.0, np.inf
            continue
        c00 = np.sqrt(s00)
        c10 = s01 / c00
        c11 = np.sqrt(s11 - c10 * c10)
        x = w[0] / c00
        y = (w[1] - c10 * x) / c11
        tests[i] = x * x + y * y
        slopes[i, RANGE] = _largest_singular_value(K, 3, 4, c00, c10, c11)
        slopes[i, LATERAL] = _largest_singular_value(K, 4, 6, c00, c10, c11)
        slopes[i, ATTITUDE] = _largest_singular_value(K, 0, 3, c00, c10, c11)
    return tests, slopes
