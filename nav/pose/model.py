"""Lines of sight and pixels of the drogue's LEDs, their derivatives and weights.

State: attitude as modified Rodrigues parameters p (drogue to camera, R_CD = C(p), passive, [mrp]) and the drogue's
origin t = p_CD in camera axes; the source's o = p_DC = -C't is the camera in drogue axes. With LED i at q_i (drogue
axes):

    b_i  = unit vector toward the LED's pixel                                           [Yoon 2018, eq 41]
    h_i  = C r_i,  r_i = (q_i - o) / |q_i - o|                                          [Yoon 2018, eqs 42, 47]
    dh_i/dp = 4/(1 + p'p)^2 [h_i x] {(1 - p'p) I - 2 [p x] + 2 p p'}                    [Yoon 2018, eq 56, mended]
    dh_i/do = -C (I - r_i r_i') / |q_i - o|                                             [Yoon 2018, eq 57]

The source prints (56) without the square. Beside its coordinates (p, o), in which a tilt drags the camera along an
arc, stand local ones: R_CD <- exp(phi) R_CD, t <- t + delta, with s_i = C q_i + t:

    dh_i/dphi = -(I - h_i h_i') [C q_i x] / |s_i|,     dh_i/ddelta = (I - h_i h_i') / |s_i|       (1)

The covariance of a unit vector has rank 2, so its inverse (52) exists in the tangent plane only. With G_i, the
derivative of the lens pi of `calibration`, at b_i (G_i b_i = 0) and pixel noise sigma_i the efficient weight of a line
of sight is

    W_i = G_i' G_i / sigma_i^2                                                           (2)

which is T S^-1 T' for any two tangent vectors T and the 2x2 covariance S that the pixel noise gives them.

Not modelled: errors common to the LEDs (focal length, mounting).
"""

import numpy as np
from numpy.typing import NDArray

from dockair.kernels import njit
from dockair.nav.pose.mrp import matrix_from_mrp, mrp_rate
from dockair.rotations import Array

SOURCE, LOCAL = 0, 1  #: coordinates of a step: (p, o) as in the source, or (phi, delta)
BAD_POINTS, BAD_SIGMA = -1, -2  #: what `seen_leds` finds wrong
_LENS_STEPS = 20  # of Newton's method on the lens; two or three do for lenses of this class
_LENS_ROUNDING_PX = 1e-9


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
def line_of_sight(C: Array, t: Array, q: Array, p: Array, coordinates: int, h: Array, J: Array, B: Array) -> None:
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
    matrix_from_mrp(mrp, C)
    mrp_rate(mrp, -1.0, B)
    for i in range(n):
        line_of_sight(C, p_CD, points_D[i], mrp, coordinates, h[i], J[i], B)
    return h, J


@njit(cache=True, error_model="numpy")
def to_pixel(h: Array, lens: Array, z: Array, G: Array, J: Array) -> None:
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
        to_pixel(h[i], lens, z[i], G, J[i])
    return z, J[:, :2].copy()
