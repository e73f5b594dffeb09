"""The pose's cost and its normal equations: what the LEDs and what is known beside them add, and their solution.

    cost = sum (z_i - zhat_i)' W_i (z_i - zhat_i)

in which z_i, zhat_i are b_i, h_i or the pixel and pi(h_i), with the symbols of [model]; both have the same minimum but
for residual / focal length squared. More measurements, in local coordinates:

    d' Lambda d,   d = (4 MRP(R_prior R'), t_prior - t)         a pose, an attitude, or part of it    (1)
    |c - C a|^2 / sigma^2                                       direction a of the drogue, seen along c    (2)

Huber's loss counts an LED's r^2 = (z - zhat)'W(z - zhat) as 2 k r - k^2 beyond r = k; its weight is then k/r.   (3)

Nothing is allocated here: the loop's room is laid out before it, in `Room`.
Not modelled: a wrong match, which only (3) bounds.
"""

from typing import NamedTuple

import numpy as np

from dockair.kernels import njit
from dockair.nav.pose.model import line_of_sight, to_pixel
from dockair.nav.pose.mrp import matrix_from_mrp, mrp_product, mrp_rate
from dockair.rotations import Array

_SINGULAR_PIVOT = 1e-12  # of the normal matrix scaled to unit diagonal: next to nothing but rounding is left


class Problem(NamedTuple):
    """What is minimised."""

    measured: Array  # (n, 3) rays b, or (n, 2) pixels
    weights: Array  # (n, 3, 3), of pixels with a third row and column of zeros
    points: Array  # (n, 3)
    lens: Array  # (8,) focal length, centre (2), k1, k2, p1, p2, k3 [px, 1]
    prior_p: Array  # (3,) MRP
    prior_t: Array  # (3,)
    information: Array  # (6, 6) of Eq. (1), or (0, 0)
    axis_D: Array  # (3,) a of Eq. (2)
    axis_C: Array  # (3,) c of Eq. (2)
    axis_information: float  # 1/sigma^2 of Eq. (2), or 0
    huber: float  # k of Eq. (3), or inf
    hold_attitude: bool
    coordinates: int


class Room(NamedTuple):
    """What the loop computes anew at each step."""

    C: Array
    B: Array  # {..} of eq (56)
    h: Array
    pixel: Array  # of h
    J: Array  # (3, 6) derivative of h, or of its pixel with a third row of zeros
    G: Array  # (2, 3) derivative of the lens
    s: Array
    d: Array
    A: Array
    LA: Array
    L: Array
    scale: Array


@njit(cache=True, error_model="numpy")
def new_room() -> Room:
    """Lay it out."""
    return Room(
        np.zeros((3, 3)), np.zeros((3, 3)), np.zeros(3), np.zeros(2), np.zeros((3, 6)), np.zeros((2, 3)), np.zeros(3),
        np.zeros(6), np.zeros((6, 6)), np.zeros((6, 6)), np.zeros((6, 6)), np.zeros(6),
    )  # fmt: skip


@njit(cache=True, error_model="numpy")
def normal_equations(problem: Problem, p: Array, t: Array, room: Room, N: Array, g: Array, led: Array) -> float:
    """Fill N = H'WH, g = H'W(z - zhat), each LED's r^2; return the whole cost, inf with an LED behind the camera."""
    measured, weights, points, lens = problem.measured, problem.weights, problem.points, problem.lens
    C, B, h, pixel, J, G = room.C, room.B, room.h, room.pixel, room.J, room.G
    matrix_from_mrp(p, C)
    mrp_rate(p, -1.0, B)
    N[:], g[:], cost = 0.0, 0.0, 0.0
    for i in range(len(measured)):
        W, w = weights[i], 1.0
        line_of_sight(C, t, points[i], p, problem.coordinates, h, J, B)
        if not h[0] > 0.0:
            return np.inf
        if lens[0] > 0.0:
            to_pixel(h, lens, pixel, G, J)
            ex, ey, ez = measured[i, 0] - pixel[0], measured[i, 1] - pixel[1], 0.0
        else:
            ex, ey, ez = measured[i, 0] - h[0], measured[i, 1] - h[1], measured[i, 2] - h[2]
        xx, xy, xz, yy, yz, zz = W[0, 0], W[0, 1], W[0, 2], W[1, 1], W[1, 2], W[2, 2]
        led[i] = xx * ex * ex + yy * ey * ey + zz * ez * ez + 2.0 * (xy * ex * ey + xz * ex * ez + yz * ey * ez)
        if led[i] > problem.huber**2:
            w = problem.huber / np.sqrt(led[i])
        cost += led[i] * w * (2.0 - w)  # r^2, or 2 k r - k^2, Eq. (3)
        for j in range(6):
            x, y, z = w * J[0, j], w * J[1, j], w * J[2, j]
            x, y, z = xx * x + xy * y + xz * z, xy * x + yy * y + yz * z, xz * x + yz * y + zz * z
            g[j] += x * ex + y * ey + z * ez
            for k in range(j + 1):
                N[j, k] += J[0, k] * x + J[1, k] * y + J[2, k] * z
    for j in range(6):
        for k in range(j):
            N[k, j] = N[j, k]
    return cost + _add_beliefs(problem, p, t, room, N, g)


@njit(cache=True, error_model="numpy")
def _add_beliefs(problem: Problem, p: Array, t: Array, room: Room, N: Array, g: Array) -> float:
    """Add what is known beside the LEDs; return its cost."""
    cost = 0.0
    if len(problem.information) == 6:
        cost += _add_prior(problem, p, t, room, N, g)
    if problem.axis_information > 0.0:
        cost += _add_direction(problem, room.C, N, g)
    if problem.hold_attitude:
        for i in range(3):
            N[i, :], N[:, i], g[i] = 0.0, 0.0, 0.0
            N[i, i] = 1.0
    return cost


@njit(cache=True, error_model="numpy")
def _add_prior(problem: Problem, p: Array, t: Array, room: Room, N: Array, g: Array) -> float:
    """Add Eq. (1) in local coordinates; return its cost."""
    s, d, A, LA, information = room.s, room.d, room.A, room.LA, problem.information
    mrp_product(p, problem.prior_p, -1.0, s)  # passive: d_phi = 4 s, and -d(d_phi)/dphi is mrp_rate of the next line
    mrp_rate(s, 1.0, A)
    for i in range(3):
        d[i], d[3 + i], A[3 + i, 3 + i] = 4.0 * s[i], problem.prior_t[i] - t[i], 1.0
    cost = 0.0
    for i in range(6):
        for j in range(6):
            cost += d[i] * information[i, j] * d[j]
            LA[i, j] = 0.0
            for k in range(6):
                LA[i, j] += information[i, k] * A[k, j]
    for i in range(6):
        for k in range(6):
            g[i] += LA[k, i] * d[k]
            for j in range(6):
                N[i, j] += A[k, i] * LA[k, j]
    return cost


@njit(cache=True, error_model="numpy")
def _add_direction(problem: Problem, C: Array, N: Array, g: Array) -> float:
    """Add Eq. (2) in local coordinates, whose derivative is -[C a x]; return its cost."""
    a, c, weight = problem.axis_D, problem.axis_C, problem.axis_information
    x = C[0, 0] * a[0] + C[0, 1] * a[1] + C[0, 2] * a[2]
    y = C[1, 0] * a[0] + C[1, 1] * a[1] + C[1, 2] * a[2]
    z = C[2, 0] * a[0] + C[2, 1] * a[1] + C[2, 2] * a[2]
    g[0] += weight * (y * c[2] - z * c[1])
    g[1] += weight * (z * c[0] - x * c[2])
    g[2] += weight * (x * c[1] - y * c[0])
    N[0, 0] += weight * (y * y + z * z)
    N[1, 1] += weight * (z * z + x * x)
    N[2, 2] += weight * (x * x + y * y)
    N[0, 1], N[1, 0] = N[0, 1] - weight * x * y, N[1, 0] - weight * x * y
    N[0, 2], N[2, 0] = N[0, 2] - weight * x * z, N[2, 0] - weight * x * z
    N[1, 2], N[2, 1] = N[1, 2] - weight * y * z, N[2, 1] - weight * y * z
    return float(weight * ((c[0] - x) ** 2 + (c[1] - y) ** 2 + (c[2] - z) ** 2))


@njit(cache=True, error_model="numpy")
def factor(N: Array, D: Array, mu: float, L: Array, scale: Array) -> bool:
    """Cholesky factor L of N + mu diag(D), scaled to unit diagonal; False when it is singular."""
    for i in range(6):
        scale[i] = N[i, i] + mu * D[i]
        if not (scale[i] > 0.0 and scale[i] < np.inf):
            return False
        scale[i] = 1.0 / np.sqrt(scale[i])
        for j in range(i + 1):
            L[i, j] = 1.0 if i == j else N[i, j] * scale[i] * scale[j]
            for k in range(j):
                L[i, j] -= L[i, k] * L[j, k]
            if i != j:
                L[i, j] /= L[j, j]
        if not L[i, i] > _SINGULAR_PIVOT:
            return False
        L[i, i] = np.sqrt(L[i, i])
    return True


@njit(cache=True, error_model="numpy")
def substitute(L: Array, scale: Array, g: Array, x: Array) -> None:
    """Fill x, the solution with a factor."""
    for i in range(6):
        x[i] = g[i] * scale[i]
        for k in range(i):
            x[i] -= L[i, k] * x[k]
        x[i] /= L[i, i]
    for i in range(5, -1, -1):
        for k in range(i + 1, 6):
            x[i] -= L[k, i] * x[k]
        x[i] /= L[i, i]
    for i in range(6):
        x[i] *= scale[i]


@njit(cache=True, error_model="numpy")
def invert(N: Array, inverse: Array, room: Room) -> bool:
    """Fill the inverse; False when N is singular."""
    unit = room.d
    if not factor(N, unit, 0.0, room.L, room.scale):
        return False
    for i in range(6):
        unit[:] = 0.0
        unit[i] = 1.0
        substitute(room.L, room.scale, unit, inverse[i])
    for i in range(6):
        for j in range(i):
            inverse[i, j] = inverse[j, i] = 0.5 * (inverse[i, j] + inverse[j, i])
    return True
