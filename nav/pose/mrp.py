"""Attitude as passive modified Rodrigues parameters (MRP), p with R = C(p), for kernels.

    C(p) = I + (8 [p x]^2 - 4 (1 - p'p) [p x]) / (1 + p'p)^2                            [Yoon 2018, eq 39]

The shadow set -p/p'p is the same attitude; of the two the one with |p| <= 1 is given.
"""

import numpy as np

from dockair.kernels import njit
from dockair.rotations import Array


@njit(cache=True, error_model="numpy")
def mrp_from_matrix(R: Array, p: Array) -> None:
    """Fill the passive MRP of R, |p| <= 1: from the largest row of 4 q q', q the quaternion of R."""
    K = np.empty((4, 4))
    K[0] = [1.0 + R[0, 0] + R[1, 1] + R[2, 2], R[2, 1] - R[1, 2], R[0, 2] - R[2, 0], R[1, 0] - R[0, 1]]
    k = 0
    for i in range(3):
        K[1 + i, 0] = K[0, 1 + i]
        for j in range(3):
            K[1 + i, 1 + j] = R[i, j] + R[j, i]
        K[1 + i, 1 + i] += 2.0 - K[0, 0]
        if K[1 + i, 1 + i] > K[k, k]:
            k = 1 + i
    q = K[k]
    norm = np.sqrt(q[0] ** 2 + q[1] ** 2 + q[2] ** 2 + q[3] ** 2)
    for i in range(3):
        p[i] = -q[1 + i] / (q[0] + norm) if q[0] >= 0.0 else -q[1 + i] / (q[0] - norm)


@njit(cache=True, error_model="numpy")
def matrix_from_mrp(p: Array, C: Array) -> None:
    """Fill C(p)."""
    s = p[0] ** 2 + p[1] ** 2 + p[2] ** 2
    a, b = 8.0 / (1.0 + s) ** 2, 4.0 * (1.0 - s) / (1.0 + s) ** 2
    for i in range(3):
        for j in range(3):
            C[i, j] = a * p[i] * p[j]
        C[i, i] += 1.0 - a * s
    C[0, 1] += b * p[2]
    C[1, 0] -= b * p[2]
    C[0, 2] -= b * p[1]
    C[2, 0] += b * p[1]
    C[1, 2] += b * p[0]
    C[2, 1] -= b * p[0]


@njit(cache=True, error_model="numpy")
def mrp_product(a: Array, b: Array, sign_b: float, out: Array) -> None:
    """MRP of C(a) C(sign_b b), |out| <= 1: product of the two quaternions (1 - s, 2 p)/(1 + s)."""
    s, r = a[0] ** 2 + a[1] ** 2 + a[2] ** 2, b[0] ** 2 + b[1] ** 2 + b[2] ** 2
    w1, x1, y1, z1 = 1.0 - s, 2.0 * a[0], 2.0 * a[1], 2.0 * a[2]
    w2, x2, y2, z2 = 1.0 - r, 2.0 * sign_b * b[0], 2.0 * sign_b * b[1], 2.0 * sign_b * b[2]
    w = w1 * w2 - x1 * x2 - y1 * y2 - z1 * z2
    d = w + (1.0 + s) * (1.0 + r) if w >= 0.0 else w - (1.0 + s) * (1.0 + r)
    out[0] = (w1 * x2 + x1 * w2 - y1 * z2 + z1 * y2) / d
    out[1] = (w1 * y2 + x1 * z2 + y1 * w2 - z1 * x2) / d
    out[2] = (w1 * z2 - x1 * y2 + y1 * x2 + z1 * w2) / d


@njit(cache=True, error_model="numpy")
def mrp_rate(p: Array, sign: float, B: Array) -> None:
    """{(1 - p'p) I + 2 sign [p x] + 2 p p'}."""
    s = 1.0 - (p[0] ** 2 + p[1] ** 2 + p[2] ** 2)
    for i in range(3):
        for j in range(3):
            B[i, j] = 2.0 * p[i] * p[j]
        B[i, i] += s
    B[0, 1] -= 2.0 * sign * p[2]
    B[1, 0] += 2.0 * sign * p[2]
    B[0, 2] += 2.0 * sign * p[1]
    B[2, 0] -= 2.0 * sign * p[1]
    B[1, 2] -= 2.0 * sign * p[0]
    B[2, 1] += 2.0 * sign * p[0]
