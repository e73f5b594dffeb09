"""Lines of sight and pixels of the drogue's LEDs, their derivatives and weights, and the one loop of all pose solvers.

State: attitude as modified Rodrigues parameters p (drogue to camera, R_CD = C(p), passive) and the drogue's origin
t = p_CD in camera axes; the source's o = p_DC = -C't is the camera in drogue axes. With LED i at q_i (drogue axes):

    C(p) = I + (8 [p x]^2 - 4 (1 - p'p) [p x]) / (1 + p'p)^2                            [Yoon 2018, eq 39]
    b_i  = unit vector toward the LED's pixel                                           [Yoon 2018, eq 41]
    h_i  = C r_i,  r_i = (q_i - o) / |q_i - o|                                          [Yoon 2018, eqs 42, 47]
    dh_i/dp = 4/(1 + p'p)^2 [h_i x] {(1 - p'p) I - 2 [p x] + 2 p p'}                    [Yoon 2018, eq 56, mended]
    dh_i/do = -C (I - r_i r_i') / |q_i - o|                                             [Yoon 2018, eq 57]

The source prints (56) without the square. Beside its coordinates (p, o), in which a tilt drags the camera along an
arc, stand local ones: R_CD <- exp(phi) R_CD, t <- t + delta, with s_i = C q_i + t:

    dh_i/dphi = -(I - h_i h_i') [C q_i x] / |s_i|,     dh_i/ddelta = (I - h_i h_i') / |s_i|       (1)

Cost: sum (z_i - zhat_i)' W_i (z_i - zhat_i), in which z_i, zhat_i are b_i, h_i or the pixel and pi(h_i), pi the lens of
`calibration` with its derivative G. The covariance of a unit vector has rank 2, so its inverse (52) exists in the
tangent plane only. With G_i at b_i (G_i b_i = 0) and pixel noise sigma_i the efficient weight of a line of sight is

    W_i = G_i' G_i / sigma_i^2                                                           (2)

which is T S^-1 T' for any two tangent vectors T and the 2x2 covariance S that the pixel noise gives them; then both
models have the same minimum but for residual / focal length squared. More measurements, in local coordinates:

    d' Lambda d,   d = (4 MRP(R_prior R'), t_prior - t)         a pose, an attitude, or part of it    (3)
    |c - C a|^2 / sigma^2                                       direction a of the drogue, seen along c    (4)

Huber's loss counts an LED's r^2 = (z - zhat)'W(z - zhat) as 2 k r - k^2 beyond r = k; its weight is then k/r.   (5)

Not modelled: errors common to the LEDs (focal length, mounting); a wrong match, which only (5) bounds.
All is in one file because compiled kernels may call those of their own file only: the cache of their machine code does
not see edits elsewhere. The loop allocates nothing: its room is laid out before it, in `_Room`.
"""

from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from dockair.rotations import Array

SOURCE, LOCAL = 0, 1  #: coordinates of a step: (p, o) as in the source, or (phi, delta)
UNDAMPED, IDENTITY, DIAGONAL, GRADIENT = 0, 1, 2, 3  #: eqs (62), (64), (65), (63) of the source
CONVERGED, NOT_CONVERGED, BEHIND, SINGULAR = 0, 1, 2, 3  #: how a descent ended
BAD_POINTS, BAD_SIGMA = -1, -2  #: what `seen_leds` finds wrong
_SINGULAR_PIVOT = 1e-12  # of the normal matrix scaled to unit diagonal: next to nothing but rounding is left
_CREEPING = 1e-2  # sigmas; a floor so flat that steps are still this short after half of the iterations is reached
_ROUNDING = 1e-10  # of the cost: its own rounding is about 1e-12, a smaller promise cannot be told from it
_LENS_STEPS = 20  # of Newton's method on the lens; two or three do for lenses of this class
_LENS_ROUNDING_PX = 1e-9


class _Problem(NamedTuple):
    """What is minimised."""

    measured: Array  # (n, 3) rays b, or (n, 2) pixels
    weights: Array  # (n, m, m)
    points: Array  # (n, 3)
    lens: Array  # (8,) focal length, centre (2), k1, k2, p1, p2, k3 [px, 1]
    prior_p: Array  # (3,) MRP
    prior_t: Array  # (3,)
    information: Array  # (6, 6) of Eq. (3), or (0, 0)
    axis_D: Array  # (3,) a of Eq. (4)
    axis_C: Array  # (3,) c of Eq. (4)
    axis_information: float  # 1/sigma^2 of Eq. (4), or 0
    huber: float  # k of Eq. (5), or inf
    hold_attitude: bool
    coordinates: int


class _Room(NamedTuple):
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
def _room() -> _Room:
    return _Room(
        np.zeros((3, 3)), np.zeros((3, 3)), np.zeros(3), np.zeros(2), np.zeros((3, 6)), np.zeros((2, 3)), np.zeros(3),
        np.zeros(6), np.zeros((6, 6)), np.zeros((6, 6)), np.zeros((6, 6)), np.zeros(6),
    )  # fmt: skip


@njit(cache=True, error_model="numpy")
def _pixel(h: Array, lens: Array, z: Array, G: Array) -> None:
    """Fill the pixel z (2,) of a direction h (3,), h_x > 0, and its derivative G (2, 3); Eq. (1) of `calibration`."""
    k1, k2, p1, p2, k3 = lens[3], lens[4], lens[5], lens[6], lens[7]
    a, b = -h[1] / h[0], -h[2] / h[0]
    r2 = a * a + b * b
    s, ds = 1.0 + r2 * (k1 + r2 * (k2 + r2 * k3)), 2.0 * (k1 + r2 * (2.0 * k2 + 3.0 * k3 * r2))
    z[0] = lens[1] + lens[0] * (a * s + 2.0 * p1 * a * b + p2 * (r2 + 2.0 * a * a))
    z[1] = lens[2] + lens[0] * (b * s + p1 * (r2 + 2.0 * b * b) + 2.0 * p2 * a * b)
    aa = s + ds * a * a + 2.0 * p1 * b + 6.0 * p2 * a
    ab = ds * a * b + 2.0 * p1 * a + 2.0 * p2 * b
    bb = s + ds * b * b + 6.0 * p1 * b + 2.0 * p2 * a
    scale = lens[0] / h[0]
    G[0, 0], G[0, 1], G[0, 2] = -(aa * a + ab * b) * scale, -aa * scale, -ab * scale
    G[1, 0], G[1, 1], G[1, 2] = -(ab * a + bb * b) * scale, -ab * scale, -bb * scale


@njit(cache=True, error_model="numpy")
def _ray(u: float, v: float, lens: Array, b: Array, z: Array, G: Array) -> None:
    """Fill the unit vector b toward a pixel, NaN when no ray makes it: Newton's method on the lens."""
    b[0], b[1], b[2] = 1.0, -(u - lens[1]) / lens[0], -(v - lens[2]) / lens[0]
    for _ in range(_LENS_STEPS):
        _pixel(b, lens, z, G)
        du, dv, det = u - z[0], v - z[1], G[0, 1] * G[1, 2] - G[0, 2] * G[1, 1]
        if not det > 0.0:  # beyond the edge of what the lens shows
            break
        if abs(du) + abs(dv) <= _LENS_ROUNDING_PX + 1e-15 * (abs(u) + abs(v)):
            length = np.sqrt(1.0 + b[1] ** 2 + b[2] ** 2)
            b[0], b[1], b[2] = 1.0 / length, b[1] / length, b[2] / length
            return
        b[1] += (G[1, 2] * du - G[0, 2] * dv) / det
        b[2] += (G[0, 1] * dv - G[1, 1] * du) / det
    b[:] = np.nan


@njit(cache=True, error_model="numpy")
def sight_weights(rays: Array, lens: Array, sigma_px: Array) -> Array:
    """(n, 3, 3) weights of Eq. (2) at rays (n, 3), from sigma_px (n,)."""
    weights, z, G = np.empty((len(rays), 3, 3)), np.empty(2), np.empty((2, 3))
    for i in range(len(rays)):
        _pixel(rays[i], lens, z, G)
        for j in range(3):
            for k in range(3):
                weights[i, j, k] = (G[0, j] * G[0, k] + G[1, j] * G[1, k]) / sigma_px[i] ** 2
    return weights


@njit(cache=True, error_model="numpy")
def seen_leds(
    pixels: Array, points: Array, sigma_px: Array, lens: Array, isotropic: bool
) -> tuple[NDArray[np.bool_], Array, Array, Array, Array, Array, int]:
    """Keep the LEDs that were seen, find their rays, and weigh them.

    Args:
        pixels: (n, 2); an LED was not seen when its pixel is not finite or no ray makes it.
        points: (n, 3) LEDs in drogue axes [m].
        sigma_px: (n,) standard deviation of a pixel coordinate.
        lens: (8,).
        isotropic: the source's weight, sigma_px / focal length in every direction.

    Returns:
        which were seen (n,), their rays (k, 3), weights (k, 3, 3), points, sigma_px, pixels, and how many of them stand
        apart; instead of that BAD_POINTS when a point is not finite, BAD_SIGMA when one is not positive.
    """
    n, k, apart = len(pixels), 0, 0
    which, rays, z, G = np.zeros(n, np.bool_), np.empty((n, 3)), np.empty(2), np.empty((2, 3))
    seen_points, seen_pixels, seen_sigma = np.empty((n, 3)), np.empty((n, 2)), np.empty(n)
    for i in range(n):
        if not sigma_px[i] > 0.0:
            apart = BAD_SIGMA
        if not np.isfinite(points[i, 0] + points[i, 1] + points[i, 2]):
            apart = BAD_POINTS
    for i in range(n if apart == 0 else 0):
        _ray(pixels[i, 0], pixels[i, 1], lens, rays[k], z, G)
        if not rays[k, 0] > 0.0:
            continue
        which[i], seen_sigma[k], new = True, sigma_px[i], True
        seen_pixels[k, 0], seen_pixels[k, 1] = pixels[i, 0], pixels[i, 1]
        for j in range(3):
            seen_points[k, j] = points[i, j]
        for m in range(k):
            new = new and not (
                seen_points[m, 0] == points[i, 0]
                and seen_points[m, 1] == points[i, 1]
                and seen_points[m, 2] == points[i, 2]
            )
        apart += new
        k += 1
    rays, seen_points, seen_sigma, seen_pixels = rays[:k], seen_points[:k], seen_sigma[:k], seen_pixels[:k]
    weights = sight_weights(rays, lens, seen_sigma)
    if isotropic:
        weights[:] = 0.0
        for i in range(k):
            for j in range(3):
                weights[i, j, j] = (lens[0] / seen_sigma[i]) ** 2
    return which, rays, weights, seen_points, seen_sigma, seen_pixels, apart


@njit(cache=True, error_model="numpy")
def _mrp_from_matrix(R: Array, p: Array) -> None:
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
def _matrix_from_mrp(p: Array, C: Array) -> None:
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
def _mrp_product(a: Array, b: Array, sign_b: float, out: Array) -> None:
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
def _mrp_rate(p: Array, sign: float, B: Array) -> None:
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


@njit(cache=True, error_model="numpy")
def _line_of_sight(C: Array, t: Array, q: Array, p: Array, coordinates: int, h: Array, J: Array, B: Array) -> None:
    """Fill h (3,) and J (3, 6), the derivative in the chosen coordinates; B is work space holding {..} of eq (56)."""
    ax = C[0, 0] * q[0] + C[0, 1] * q[1] + C[0, 2] * q[2]
    ay = C[1, 0] * q[0] + C[1, 1] * q[1] + C[1, 2] * q[2]
    az = C[2, 0] * q[0] + C[2, 1] * q[1] + C[2, 2] * q[2]
    h[0], h[1], h[2] = ax + t[0], ay + t[1], az + t[2]
    r = np.sqrt(h[0] ** 2 + h[1] ** 2 + h[2] ** 2)
    for i in range(3):
        h[i] /= r
    if coordinates == LOCAL:
        for i in range(3):  # rows d of (I - h h')/|s|, then -d [a x], Eq. (1)
            for j in range(3):
                J[i, 3 + j] = ((1.0 if i == j else 0.0) - h[i] * h[j]) / r
            dx, dy, dz = J[i, 3], J[i, 4], J[i, 5]
            J[i, 0], J[i, 1], J[i, 2] = dz * ay - dy * az, dx * az - dz * ax, dy * ax - dx * ay
        return
    s = p[0] ** 2 + p[1] ** 2 + p[2] ** 2
    factor = 4.0 / (1.0 + s) ** 2
    for j in range(3):
        J[0, j] = factor * (h[1] * B[2, j] - h[2] * B[1, j])  # [Yoon 2018, eq 56, mended]
        J[1, j] = factor * (h[2] * B[0, j] - h[0] * B[2, j])
        J[2, j] = factor * (h[0] * B[1, j] - h[1] * B[0, j])
        hC = h[0] * C[0, j] + h[1] * C[1, j] + h[2] * C[2, j]
        for i in range(3):
            J[i, 3 + j] = -(C[i, j] - h[i] * hC) / r  # [Yoon 2018, eq 57]


@njit(cache=True, error_model="numpy")
def lines_of_sight(mrp: Array, p_CD: Array, points_D: Array, coordinates: int) -> tuple[Array, Array]:
    """Predicted lines of sight and their derivatives.

    Args:
        mrp: (3,) passive MRP of R_CD.
        p_CD: (3,) drogue origin in camera axes [m].
        points_D: (n, 3) LEDs in drogue axes [m].
        coordinates: SOURCE or LOCAL.

    Returns:
        h (n, 3) unit vectors in camera axes; (n, 3, 6) derivative in (p, o) or in (phi, delta).
    """
    n = len(points_D)
    h, J, C, B = np.empty((n, 3)), np.empty((n, 3, 6)), np.empty((3, 3)), np.empty((3, 3))
    _matrix_from_mrp(mrp, C)
    _mrp_rate(mrp, -1.0, B)
    for i in range(n):
        _line_of_sight(C, p_CD, points_D[i], mrp, coordinates, h[i], J[i], B)
    return h, J


@njit(cache=True, error_model="numpy")
def _to_pixel(h: Array, lens: Array, z: Array, G: Array, J: Array) -> None:
    """Fill the pixel z of h, and turn J, the derivative of h, into that of z with a third row of zeros."""
    _pixel(h, lens, z, G)
    for j in range(6):
        x, y, w = J[0, j], J[1, j], J[2, j]
        J[0, j] = G[0, 0] * x + G[0, 1] * y + G[0, 2] * w
        J[1, j] = G[1, 0] * x + G[1, 1] * y + G[1, 2] * w
        J[2, j] = 0.0


@njit(cache=True, error_model="numpy")
def pixels(mrp: Array, p_CD: Array, points_D: Array, lens: Array, coordinates: int) -> tuple[Array, Array]:
    """Predicted pixels (n, 2) of LEDs in front of the camera and their derivatives (n, 2, 6); see `lines_of_sight`."""
    h, J = lines_of_sight(mrp, p_CD, points_D, coordinates)
    z, G = np.empty((len(h), 2)), np.empty((2, 3))
    for i in range(len(h)):
        _to_pixel(h[i], lens, z[i], G, J[i])
    return z, J[:, :2].copy()


@njit(cache=True, error_model="numpy")
def _normal_equations(problem: _Problem, p: Array, t: Array, room: _Room, N: Array, g: Array, led: Array) -> float:
    """Fill N = H'WH, g = H'W(z - zhat), each LED's r^2; return the whole cost, inf with an LED behind the camera."""
    measured, weights, points, lens = problem.measured, problem.weights, problem.points, problem.lens
    C, B, h, pixel, J, G = room.C, room.B, room.h, room.pixel, room.J, room.G
    _matrix_from_mrp(p, C)
    _mrp_rate(p, -1.0, B)
    N[:], g[:], cost = 0.0, 0.0, 0.0
    for i in range(len(measured)):
        W, w = weights[i], 1.0
        _line_of_sight(C, t, points[i], p, problem.coordinates, h, J, B)
        if not h[0] > 0.0:
            return np.inf
        if lens[0] > 0.0:
            _to_pixel(h, lens, pixel, G, J)
            ex, ey, ez = measured[i, 0] - pixel[0], measured[i, 1] - pixel[1], 0.0
        else:
            ex, ey, ez = measured[i, 0] - h[0], measured[i, 1] - h[1], measured[i, 2] - h[2]
        xx, xy, xz, yy, yz, zz = W[0, 0], W[0, 1], W[0, 2], W[1, 1], W[1, 2], W[2, 2]
        led[i] = xx * ex * ex + yy * ey * ey + zz * ez * ez + 2.0 * (xy * ex * ey + xz * ex * ez + yz * ey * ez)
        if led[i] > problem.huber**2:
            w = problem.huber / np.sqrt(led[i])
        cost += led[i] * w * (2.0 - w)  # r^2, or 2 k r - k^2, Eq. (5)
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
def _add_beliefs(problem: _Problem, p: Array, t: Array, room: _Room, N: Array, g: Array) -> float:
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
def _add_prior(problem: _Problem, p: Array, t: Array, room: _Room, N: Array, g: Array) -> float:
    """Add Eq. (3) in local coordinates; return its cost."""
    s, d, A, LA, information = room.s, room.d, room.A, room.LA, problem.information
    _mrp_product(p, problem.prior_p, -1.0, s)  # passive: d_phi = 4 s, and -d(d_phi)/dphi is _mrp_rate of the next line
    _mrp_rate(s, 1.0, A)
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
def _add_direction(problem: _Problem, C: Array, N: Array, g: Array) -> float:
    """Add Eq. (4) in local coordinates, whose derivative is -[C a x]; return its cost."""
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
def _factor(N: Array, D: Array, mu: float, L: Array, scale: Array) -> bool:
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
def _substitute(L: Array, scale: Array, g: Array, x: Array) -> None:
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
def _invert(N: Array, inverse: Array, room: _Room) -> bool:
    """Fill the inverse; False when N is singular."""
    unit = room.d
    if not _factor(N, unit, 0.0, room.L, room.scale):
        return False
    for i in range(6):
        unit[:] = 0.0
        unit[i] = 1.0
        _substitute(room.L, room.scale, unit, inverse[i])
    for i in range(6):
        for j in range(i):
            inverse[i, j] = inverse[j, i] = 0.5 * (inverse[i, j] + inverse[j, i])
    return True


@njit(cache=True, error_model="numpy")
def _step(N: Array, g: Array, D: Array, damping: int, mu: float, x: Array, room: _Room) -> bool:
    """Fill the step x of a member of the family; False when its matrix is singular."""
    if damping == GRADIENT:
        for i in range(6):
            x[i] = g[i] / (mu * D[i])
        return True
    if not _factor(N, D, mu, room.L, room.scale):
        return False
    _substitute(room.L, room.scale, g, x)
    return True


@njit(cache=True, error_model="numpy")
def _set_damping(N: Array, coordinates: int, damping: int, D: Array) -> None:
    """Fill D: the largest diagonal of N met so far, or its largest entry, or its trace now; see `descend`."""
    largest, trace = 0.0, 0.0
    for i in range(6):
        D[i] = max(D[i], N[i, i])
        largest, trace = max(largest, D[i]), trace + N[i, i]
    if damping == DIAGONAL and coordinates == LOCAL:
        D[:3] = max(D[0], D[1], D[2])
    elif damping == IDENTITY:
        D[:] = largest
    elif damping == GRADIENT:
        D[:] = trace


@njit(cache=True, error_model="numpy")
def _moved(p: Array, t: Array, x: Array, coordinates: int, p_new: Array, t_new: Array, room: _Room) -> None:
    """Fill the state after a step x."""
    C, step = room.C, room.s
    if coordinates == LOCAL:
        angle = np.sqrt(x[0] ** 2 + x[1] ** 2 + x[2] ** 2)
        k = 0.25 if angle < 1e-4 else np.tan(0.25 * min(angle, np.pi)) / angle
        for i in range(3):
            step[i], t_new[i] = -k * x[i], t[i] + x[3 + i]
        _mrp_product(step, p, 1.0, p_new)
        return
    _matrix_from_mrp(p, C)
    for i in range(3):  # o + its step, by columns of C
        step[i] = x[3 + i] - (C[0, i] * t[0] + C[1, i] * t[1] + C[2, i] * t[2])
        p_new[i] = p[i] + x[i]
    s = p_new[0] ** 2 + p_new[1] ** 2 + p_new[2] ** 2
    if s > 1.0:  # shadow set
        for i in range(3):
            p_new[i] = -p_new[i] / s
    _matrix_from_mrp(p_new, C)
    for i in range(3):
        t_new[i] = -(C[i, 0] * step[0] + C[i, 1] * step[1] + C[i, 2] * step[2])


@njit(cache=True, error_model="numpy")
def _square(N: Array, x: Array) -> float:
    total = 0.0
    for i in range(6):
        for j in range(6):
            total += x[i] * N[i, j] * x[j]
    return total


@njit(cache=True, error_model="numpy")
def _dot(a: Array, b: Array) -> float:
    total = 0.0
    for i in range(6):
        total += a[i] * b[i]
    return total


@njit(cache=True, error_model="numpy")
def _check_end(
    N: Array, g: Array, D: Array, damping: int, least: float, cost: float, x: Array, undamped: Array, room: _Room
) -> int:
    """Say whether step x is the last one: CONVERGED, NOT_CONVERGED or SINGULAR; a damped step may become undamped."""
    length, promised = _square(N, x), 2.0 * _dot(g, x) - _square(N, x)
    if not (length < least**2 or promised < _ROUNDING * cost):
        return NOT_CONVERGED
    if damping == UNDAMPED:
        return CONVERGED
    if not _step(N, g, D, UNDAMPED, 0.0, undamped, room):
        return SINGULAR
    decrement = _dot(g, undamped)
    last = decrement < least**2 or decrement < _ROUNDING * cost
    if last or damping != GRADIENT:
        x[:] = undamped
    return CONVERGED if last else NOT_CONVERGED


@njit(cache=True, error_model="numpy")
def _minimise(
    problem: _Problem, p: Array, t: Array, room: _Room, damping: int, mu: float, tolerance: float, max_iterations: int
) -> tuple[int, int, Array, Array, Array, Array, float]:
    """Run the loop; return outcome, iterations, p, t, N, each LED's r^2, cost."""
    p_new, t_new, N, N_new, g, g_new = p.copy(), t.copy(), np.zeros((6, 6)), np.zeros((6, 6)), np.zeros(6), np.zeros(6)
    x, undamped, D, led = np.empty(6), np.empty(6), np.zeros(6), np.zeros(len(problem.points))
    led_new = led.copy()
    cost = _normal_equations(problem, p, t, room, N, g, led)
    outcome, iterations = (NOT_CONVERGED, 0) if cost < np.inf else (BEHIND, 0)
    while outcome == NOT_CONVERGED and iterations < max_iterations:
        iterations += 1
        _set_damping(N, problem.coordinates, damping, D)
        if not _step(N, g, D, damping, mu, x, room):
            if damping == UNDAMPED or mu > 1e6:
                outcome = SINGULAR
            mu = max(10.0 * mu, 1e-6)
            continue
        least = tolerance if 2 * iterations < max_iterations else max(tolerance, _CREEPING)
        end = _check_end(N, g, D, damping, least, cost, x, undamped, room)
        if end == SINGULAR:
            outcome = SINGULAR
            break
        _moved(p, t, x, problem.coordinates, p_new, t_new, room)
        new = _normal_equations(problem, p_new, t_new, room, N_new, g_new, led_new)
        if end == CONVERGED and new < np.inf:
            outcome = CONVERGED
        elif damping != UNDAMPED:
            promised = 2.0 * _dot(g, x) - _square(N, x)
            if not new < cost:
                mu = max(10.0 * mu, 1e-6)
                continue
            if promised > 0.0:
                mu *= max(0.1, 1.0 - (2.0 * (cost - new) / promised - 1.0) ** 3)
        elif not new < np.inf:
            break
        cost, p, p_new, t, t_new = new, p_new, p, t_new, t
        N, N_new, g, g_new, led, led_new = N_new, N, g_new, g, led_new, led
    return outcome, iterations, p, t, N, led, cost


@njit(cache=True, error_model="numpy")
def descend(
    measured: Array, weights: Array, points: Array, lens: Array, R_CD: Array, p_CD: Array, prior_R: Array,
    prior_t: Array, information: Array, axis_D: Array, axis_C: Array, axis_information: float, huber: float,
    hold_attitude: bool, coordinates: int, damping: int, mu: float, tolerance: float, max_iterations: int,
) -> tuple[int, int, Array, Array, Array, float, float, Array, Array]:  # fmt: skip
    """Minimise the cost of the module's head from a start; no error is raised, the outcome is in the first result.

    Args:
        measured: (n, 3) unit vectors b_i in camera axes, or (n, 2) pixels.
        weights: (n, 3, 3) or (n, 2, 2) W_i.
        points: (n, 3) LEDs in drogue axes [m].
        lens: (8,) focal length, centre u, v [px], k1, k2, p1, p2, k3; used with pixels.
        R_CD: (3, 3) start.
        p_CD: (3,) start [m].
        prior_R: (3, 3) attitude of Eq. (3).
        prior_t: (3,) position of Eq. (3) [m].
        information: (6, 6) Lambda of Eq. (3), of any rank, with LOCAL coordinates; (0, 0) for none.
        axis_D: (3,) unit vector a of Eq. (4), with LOCAL coordinates.
        axis_C: (3,) unit vector c.
        axis_information: 1/sigma^2, or 0 for none.
        huber: k of Eq. (5), or inf.
        hold_attitude: whether the position alone is solved for, with LOCAL coordinates.
        coordinates: SOURCE or LOCAL.
        damping: UNDAMPED, IDENTITY, DIAGONAL or GRADIENT.
        mu: first damping. It multiplies the largest diagonal met so far (DIAGONAL), its largest entry (IDENTITY), or
            stands for the step's length, 2 lambda = 1/(mu tr H'WH) (GRADIENT). With LOCAL coordinates all three angles
            have the entry of the one seen best: a frontal ring hardly shows its tilt to first order, and the damping
            that holds the other axes would let that one run. With g the share of the decrease promised by the quadratic
            model that a step brings, mu falls by max(0.1, 1 - (2 g - 1)^3); a step that does not lower the cost is not
            taken and mu rises tenfold.
        tolerance: converged when the undamped step is shorter than this many of its own standard deviations; a damped
            step as short gives way to it (but GRADIENT's).
        max_iterations: of solved steps.

    Returns:
        outcome, iterations, R_CD (3, 3), p_CD (3,), r^2 of each LED (n,), their sum, whole cost,
        covariance (6, 6) of (phi, delta), the inverse of N, and N, weighed by Eq. (5); NaN unless CONVERGED.
    """
    start, prior_p, room = np.empty(3), np.empty(3), _room()
    _mrp_from_matrix(R_CD, start)
    _mrp_from_matrix(prior_R, prior_p)
    problem = _Problem(
        measured, weights, points, lens, prior_p, prior_t, information, axis_D, axis_C, axis_information, huber,
        hold_attitude, coordinates,
    )  # fmt: skip
    outcome, iterations, p, t, N, led, cost = _minimise(
        problem, start, p_CD.copy(), room, damping, mu, tolerance, max_iterations
    )
    covariance, C, g = np.full((6, 6), np.nan), np.empty((3, 3)), np.empty(6)
    if coordinates != LOCAL or hold_attitude:
        local = _Problem(
            measured, weights, points, lens, prior_p, prior_t, information, axis_D, axis_C, axis_information, huber,
            False, LOCAL,
        )  # fmt: skip
        _normal_equations(local, p, t, room, N, g, led)
    if outcome != CONVERGED:
        N[:] = np.nan
    elif not _invert(N, covariance, room):
        covariance[:] = np.nan
        outcome = outcome if hold_attitude else SINGULAR
    _matrix_from_mrp(p, C)
    return outcome, iterations, C, t, led, led.sum(), cost, covariance, N
