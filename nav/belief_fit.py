"""The fit of one frame's LEDs and a belief: the kernels of `belief_frame`, whose equations these are.

An LED's two rows of H are zero but for the pose's six columns and its own two, and S = H C H' + 1 is positive definite:
sums run over what is not zero, and Cholesky's factor serves for solution, determinant and covariance.
"""

import numpy as np

from dockair.kernels import njit
from dockair.rotations import Array

_MOST_STEPS, _MOST_HALVINGS = 30, 8
_LEAST_CURVATURE, _MOST_CURVATURE = 0.1, 2.0  # of Eq. (3) of `belief_frame`: one noisy step is not trusted further
_SETTLED_CHI2 = 1e-8  # of a step: a ten-thousandth of a sigma


@njit(cache=True, error_model="numpy")
def _cholesky(S: Array) -> None:
    """Put L, S = L L', into the lower triangle of S (n, n)."""
    for j in range(len(S)):
        for i in range(j, len(S)):
            a = S[i, j]
            for k in range(j):
                a -= S[i, k] * S[j, k]
            S[i, j] = np.sqrt(a) if i == j else a / S[j, j]


@njit(cache=True, error_model="numpy")
def _halfway(L: Array, b: Array) -> None:
    """Put L^-1 b into b (n,)."""
    for i in range(len(b)):
        for k in range(i):
            b[i] -= L[i, k] * b[k]
        b[i] /= L[i, i]


@njit(cache=True, error_model="numpy")
def _solved(L: Array, b: Array) -> Array:
    """(n,) S^-1 b, with S = L L'."""
    z = b.copy()
    _halfway(L, z)
    for i in range(len(z) - 1, -1, -1):
        for k in range(i + 1, len(z)):
            z[i] -= L[k, i] * z[k]
        z[i] /= L[i, i]
    return z


@njit(cache=True, error_model="numpy")
def distance2(y: Array, other: Array, C: Array) -> float:
    """Of two poses, the first six of y, by the covariance C (6, 6)."""
    L, step = C.copy(), y[:6] - other[:6]
    _cholesky(L)
    _halfway(L, step)
    return float((step * step).sum())


@njit(cache=True, error_model="numpy")
def image_of(rays: Array, weights: Array) -> tuple[Array, Array]:
    """(n, 2) image of rays (n, 3), focal length 1, and (n, 2, 2) what whitens it, of weights (n, 3, 3)."""
    n = len(rays)
    ab, whiten, turn, N = np.empty((n, 2)), np.zeros((n, 2, 2)), np.empty((3, 2)), np.empty((2, 2))
    for k in range(n):
        ab[k, 0], ab[k, 1] = -rays[k, 1] / rays[k, 0], -rays[k, 2] / rays[k, 0]
        s = np.sqrt(1.0 + ab[k, 0] ** 2 + ab[k, 1] ** 2)
        for i in range(3):  # d ray / d ab
            for j in range(2):
                turn[i, j] = -rays[k, i] * ab[k, j] / s**2 - (1.0 / s if i == j + 1 else 0.0)
        for i in range(2):
            for j in range(2):
                N[i, j] = 0.0
                for a in range(3):
                    for b in range(3):
                        N[i, j] += turn[a, i] * weights[k, a, b] * turn[b, j]
        _cholesky(N)
        whiten[k, 0, 0], whiten[k, 0, 1], whiten[k, 1, 1] = N[0, 0], N[1, 0], N[1, 1]
    return ab, whiten


@njit(cache=True, error_model="numpy")
def _log(R: Array) -> Array:
    """(3,) rotation vector of R (3, 3), from the largest row of 4 q q', q its quaternion."""
    K = np.empty((4, 4))
    K[0, 0] = 1.0 + R[0, 0] + R[1, 1] + R[2, 2]
    largest = 0
    for i in range(3):
        j, k = (i + 1) % 3, (i + 2) % 3
        K[0, 1 + i] = K[1 + i, 0] = R[k, j] - R[j, k]
        K[1 + i, 1 + i] = 1.0 + R[i, i] - R[j, j] - R[k, k]
        K[1 + i, 1 + j] = K[1 + j, 1 + i] = R[i, j] + R[j, i]
        if K[1 + i, 1 + i] > K[largest, largest]:
            largest = 1 + i
    q = K[largest] if K[largest, 0] >= 0.0 else -K[largest]
    sine = np.sqrt(q[1] ** 2 + q[2] ** 2 + q[3] ** 2)
    scale = 2.0 * np.arctan2(sine, q[0]) / sine if sine > 1e-12 * q[0] else 2.0 / q[0]
    out: Array = scale * q[1:]
    return out


@njit(cache=True, error_model="numpy")
def _exp(phi: Array) -> tuple[Array, Array]:
    """(3, 3) exp(phi), and its left Jacobian."""
    angle = np.sqrt(phi[0] ** 2 + phi[1] ** 2 + phi[2] ** 2)
    p = 1.0 - angle**2 / 6.0 if angle < 1e-4 else np.sin(angle) / angle
    q = 0.5 - angle**2 / 24.0 if angle < 1e-4 else (1.0 - np.cos(angle)) / angle**2
    s = 1.0 / 6.0 - angle**2 / 120.0 if angle < 1e-4 else (angle - np.sin(angle)) / angle**3
    K = np.array([[0.0, -phi[2], phi[1]], [phi[2], 0.0, -phi[0]], [-phi[1], phi[0], 0.0]])
    KK = np.dot(K, K)
    return np.eye(3) + p * K + q * KK, np.eye(3) + q * K + s * KK


@njit(cache=True, error_model="numpy")
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


@njit(cache=True, error_model="numpy")
def _jacobian(R: Array, J: Array, p: Array, points: Array, whiten: Array, d: Array) -> Array:
    """H (2n, 6 + 2n) at a pose whose turn has the left Jacobian J; a row has but its own LED beside the pose."""
    n = len(points)
    H, a = np.zeros((2 * n, 6 + 2 * n)), np.empty(3)
    for k in range(n):
        for i in range(3):
            a[i] = (
                R[i, 0] * points[k, 0] + R[i, 1] * (points[k, 1] + d[2 * k]) + R[i, 2] * (points[k, 2] + d[2 * k + 1])
            )
        x, y, z = a[0] + p[0], a[1] + p[1], a[2] + p[2]
        for i in range(2):
            v, w = whiten[k, i, 0], whiten[k, i, 1]
            g0, g1, g2 = (v * y + w * z) / x**2, -v / x, -w / x
            t0, t1, t2 = g2 * a[1] - g1 * a[2], g0 * a[2] - g2 * a[0], g1 * a[0] - g0 * a[1]
            row = H[2 * k + i]
            for j in range(3):
                row[j] = t0 * J[0, j] + t1 * J[1, j] + t2 * J[2, j]
            row[3], row[4], row[5] = g0, g1, g2
            for j in range(2):
                row[6 + 2 * k + j] = g0 * R[0, 1 + j] + g1 * R[1, 1 + j] + g2 * R[2, 1 + j]
    return H


@njit(cache=True, error_model="numpy")
def _spread(H: Array, C: Array) -> tuple[Array, Array]:
    """H C, and L of S of Eq. (2), S = L L'."""
    HC, S = np.zeros(H.shape), np.empty((len(H), len(H)))
    for i in range(len(H)):
        own = 6 + i // 2 * 2
        for j in (0, 1, 2, 3, 4, 5, own, own + 1):
            for m in range(len(C)):
                HC[i, m] += H[i, j] * C[j, m]
        for j in range(i + 1):
            other = 6 + j // 2 * 2
            S[i, j] = 1.0 if i == j else 0.0
            for m in (0, 1, 2, 3, 4, 5, other, other + 1):
                S[i, j] += HC[i, m] * H[j, m]
    _cholesky(S)
    return HC, S


@njit(cache=True, error_model="numpy")
def _ended(HC: Array, L: Array, C: Array, cost: float) -> tuple[float, Array]:
    """Eq. (4), and (6, 6) the pose's covariance."""
    half, after, log_det = np.empty((6, len(L))), C[:6, :6].copy(), 0.0
    for i in range(len(L)):
        log_det += 2.0 * np.log(L[i, i])
    for j in range(6):
        half[j] = HC[:, j]
        _halfway(L, half[j])
    for i in range(6):
        for j in range(6):
            for k in range(len(L)):
                after[i, j] -= half[i, k] * half[j, k]
    return -0.5 * (cost + log_det), after


@njit(cache=True, error_model="numpy")
def _times(H: Array, y: Array) -> Array:
    """(2n,) H y."""
    out = np.empty(len(H))
    for i in range(len(H)):
        own = 6 + i // 2 * 2
        out[i] = H[i, own] * y[own] + H[i, own + 1] * y[own + 1]
        for j in range(6):
            out[i] += H[i, j] * y[j]
    return out


@njit(cache=True, error_model="numpy")
def fitted(
    R0: Array, p0: Array, points: Array, C: Array, ab: Array, whiten: Array, R: Array, p: Array
) -> tuple[int, Array, Array, Array, float, float, Array, Array, Array, Array, float, float, Array]:
    """Run Eq. (2) from a pose R, p.

    Returns:
        1 if it ended, 0 if not, -1 if an LED is behind the camera at the start; then twice H, nu, y, cost, Eq. (4),
        (6, 6) the pose's covariance: at the end, and after the first step, as if the problem were linear.
    """
    y, g = np.zeros(len(C)), np.zeros(len(C))
    y[:3], y[3:6] = _log(np.dot(R, R0.T)), p - p0
    turn, J = _exp(y[:3])
    R = np.dot(turn, R0)
    ahead, r = _residuals(R, p0 + y[3:6], points, ab, whiten, y[6:])
    H = _jacobian(R, J, p0 + y[3:6], points, whiten, y[6:])
    nu = r + _times(H, y)
    HC, L = _spread(H, C)
    if not ahead:
        return -1, H, nu, y, np.inf, -np.inf, C[:6, :6], H, nu, y, np.inf, -np.inf, C[:6, :6]
    inverse_nu = _solved(L, nu)
    first_H, first_nu, first_y, first_cost = H, nu, np.dot(C, np.dot(H.T, inverse_nu)), np.dot(nu, inverse_nu)
    first_evidence, first_C = _ended(HC, L, C, first_cost)
    cost, settled, curvature = np.inf, 0, 1.0
    way, way2 = np.zeros(len(C)), np.inf
    for _ in range(_MOST_STEPS):
        towards, better = np.dot(H.T, _solved(L, nu)), False
        curvature = min(max(curvature - np.dot(towards - g, way) / way2, _LEAST_CURVATURE), _MOST_CURVATURE)
        for _halving in range(_MOST_HALVINGS):
            g_new = g + (towards - g) / curvature
            y_new = np.dot(C, g_new)
            turn, J = _exp(y_new[:3])
            R = np.dot(turn, R0)
            ahead, r_new = _residuals(R, p0 + y_new[3:6], points, ab, whiten, y_new[6:])
            cost_new = np.dot(r_new, r_new) + np.dot(g_new, y_new)
            better = ahead and cost_new <= cost
            if better:
                break
            curvature *= 2.0
        if not better:  # no step helps: as far down as numbers reach
            settled = 1 if cost < np.inf else 0
            break
        way, way2 = y_new - y, np.dot(g_new - g, y_new - y)
        small = cost < np.inf and way2 < _SETTLED_CHI2
        y, g, r, cost = y_new, g_new, r_new, cost_new
        H = _jacobian(R, J, p0 + y[3:6], points, whiten, y[6:])
        nu = r + _times(H, y)
        HC, L = _spread(H, C)
        if small:
            settled = 1
            break
    evidence, after = _ended(HC, L, C, cost)
    return (
        settled, H, nu, y, cost, evidence, after,
        first_H, first_nu, first_y, first_cost, first_evidence, first_C,
    )  # fmt: skip
