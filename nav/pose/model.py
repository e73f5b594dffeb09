"""Lines of sight to the drogue's LEDs, their derivatives and weights, and the one descent loop of all pose solvers.

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

Cost: sum (b_i - h_i)' W_i (b_i - h_i). The covariance of a unit vector has rank 2, so its inverse (52) exists in the
tangent plane only. With G_i = d(pixel)/dh at b_i (G_i b_i = 0) and pixel noise sigma_i the efficient weight is

    W_i = G_i' G_i / sigma_i^2                                                           (2)

which is T S^-1 T' for any two tangent vectors T and the 2x2 covariance S that the pixel noise gives them.
A prior on the pose, d = (4 MRP(R_prior R'), t_prior - t) with information matrix, adds d' Lambda d.      (3)

Not modelled: errors common to the LEDs (focal length, mounting); a wrong match must be removed before.
Everything is in one file because compiled kernels may call those of their own file only.
"""

import numpy as np
from numba import njit

from dockair.rotations import Array

SOURCE, LOCAL = 0, 1  #: coordinates of a step: (p, o) as in the source, or (phi, delta)
UNDAMPED, IDENTITY, DIAGONAL = 0, 1, 2  #: eqs (62), (64), (65) of the source
CONVERGED, NOT_CONVERGED, BEHIND, SINGULAR = 0, 1, 2, 3  #: how a descent ended
_SINGULAR_PIVOT = 1e-13  # of the normal matrix scaled to unit diagonal: nothing but rounding is left
_CREEPING = 1e-2  # sigmas; a floor so flat that steps are still this short after half of the iterations is reached
_ROUNDING = 1e-10  # of the cost: its own rounding is about 1e-12, a smaller promise cannot be told from it


@njit(cache=True)
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


@njit(cache=True)
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


@njit(cache=True)
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


@njit(cache=True)
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


@njit(cache=True)
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


@njit(cache=True)
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


@njit(cache=True)
def _normal_equations(
    rays: Array, weights: Array, points: Array, p: Array, t: Array, prior_p: Array, prior_t: Array,
    prior_information: Array, coordinates: int, N: Array, g: Array, led_cost: Array,
) -> float:  # fmt: skip
    """Fill N = H'WH, g = H'W(b - h), the cost of each LED; return the whole cost, inf with an LED behind its ray."""
    C, B, h, J, WJ = np.empty((3, 3)), np.empty((3, 3)), np.empty(3), np.empty((3, 6)), np.empty((3, 6))
    _matrix_from_mrp(p, C)
    _mrp_rate(p, -1.0, B)
    N[:], g[:], cost = 0.0, 0.0, 0.0
    for i in range(len(rays)):
        b, W = rays[i], weights[i]
        _line_of_sight(C, t, points[i], p, coordinates, h, J, B)
        if not b[0] * h[0] + b[1] * h[1] + b[2] * h[2] > 0.0:
            return np.inf
        for k in range(3):
            for j in range(6):
                WJ[k, j] = W[k, 0] * J[0, j] + W[k, 1] * J[1, j] + W[k, 2] * J[2, j]
        ex, ey, ez = b[0] - h[0], b[1] - h[1], b[2] - h[2]
        led_cost[i] = (
            ex * (W[0, 0] * ex + W[0, 1] * ey + W[0, 2] * ez)
            + ey * (W[1, 0] * ex + W[1, 1] * ey + W[1, 2] * ez)
            + ez * (W[2, 0] * ex + W[2, 1] * ey + W[2, 2] * ez)
        )
        cost += led_cost[i]
        for j in range(6):
            g[j] += WJ[0, j] * ex + WJ[1, j] * ey + WJ[2, j] * ez
            for k in range(j + 1):
                N[j, k] += J[0, j] * WJ[0, k] + J[1, j] * WJ[1, k] + J[2, j] * WJ[2, k]
    for j in range(6):
        for k in range(j):
            N[k, j] = N[j, k]
    if len(prior_information) == 6:
        cost += _add_prior(p, t, prior_p, prior_t, prior_information, N, g)
    return cost


@njit(cache=True)
def _add_prior(p: Array, t: Array, prior_p: Array, prior_t: Array, information: Array, N: Array, g: Array) -> float:
    """Add Eq. (3) in local coordinates; return its cost."""
    s, B, d, A, LA = np.empty(3), np.empty((3, 3)), np.zeros(6), np.zeros((6, 6)), np.zeros((6, 6))
    _mrp_product(p, prior_p, -1.0, s)  # passive: d_phi = 4 s, and -d(d_phi)/dphi is B of the next line
    _mrp_rate(s, 1.0, B)
    for i in range(3):
        d[i], d[3 + i], A[3 + i, 3 + i] = 4.0 * s[i], prior_t[i] - t[i], 1.0
        for j in range(3):
            A[i, j] = B[i, j]
    cost = 0.0
    for i in range(6):
        for j in range(6):
            cost += d[i] * information[i, j] * d[j]
            for k in range(6):
                LA[i, j] += information[i, k] * A[k, j]
    for i in range(6):
        for k in range(6):
            g[i] += LA[k, i] * d[k]
            for j in range(6):
                N[i, j] += A[k, i] * LA[k, j]
    return cost


@njit(cache=True)
def _factor(N: Array, D: Array, mu: float, L: Array, scale: Array) -> bool:
    """Cholesky factor L of N + damping scaled to unit diagonal; False when it is singular."""
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


@njit(cache=True)
def _solve(N: Array, D: Array, mu: float, g: Array, x: Array) -> bool:
    """Solve (N + damping) x = g; False when it is singular."""
    L, scale = np.empty((6, 6)), np.empty(6)
    if not _factor(N, D, mu, L, scale):
        return False
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
    return True


@njit(cache=True)
def _moved(p: Array, t: Array, x: Array, coordinates: int, p_new: Array, t_new: Array) -> None:
    """Fill the state after a step x."""
    C, step = np.empty((3, 3)), np.empty(3)
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


@njit(cache=True)
def descend(
    rays: Array, weights: Array, points: Array, R_CD: Array, p_CD: Array, prior_R: Array, prior_t: Array,
    information: Array, coordinates: int, damping: int, mu: float, tolerance: float, max_iterations: int,
) -> tuple[int, int, Array, Array, Array, float, Array]:  # fmt: skip
    """Minimise the cost of the module's head from a start; no error is raised, the outcome is in the first result.

    Args:
        rays: (n, 3) measured unit vectors b_i in camera axes.
        weights: (n, 3, 3) W_i.
        points: (n, 3) LEDs in drogue axes [m].
        R_CD: (3, 3) start.
        p_CD: (3,) start [m].
        prior_R: (3, 3) attitude of Eq. (3).
        prior_t: (3,) position of Eq. (3) [m].
        information: (6, 6) Lambda of Eq. (3), with LOCAL coordinates; (0, 0) for no prior.
        coordinates: SOURCE or LOCAL.
        damping: UNDAMPED, IDENTITY or DIAGONAL.
        mu: first damping, on the largest diagonal met so far. With g the share of the decrease promised by the
            quadratic model that a step brings, mu falls by max(0.1, 1 - (2 g - 1)^3); a step that raises the cost is
            not taken and mu rises tenfold.
        tolerance: converged when the undamped step is shorter than this many of its own standard deviations.
        max_iterations: of solved steps.

    Returns:
        outcome, iterations, R_CD (3, 3), p_CD (3,), cost of each LED (n,), whole cost,
        covariance (6, 6) of (phi, delta), the inverse of N; NaN unless CONVERGED.
    """
    p, t, p_new, t_new, prior_p = np.empty(3), p_CD.copy(), np.empty(3), np.empty(3), np.empty(3)
    _mrp_from_matrix(R_CD, p)
    _mrp_from_matrix(prior_R, prior_p)
    N, N_new, C = np.zeros((6, 6)), np.zeros((6, 6)), np.empty((3, 3))
    g, g_new, x, D, led_cost, led_new = (
        np.zeros(6),
        np.zeros(6),
        np.empty(6),
        np.zeros(6),
        np.zeros(len(rays)),
        np.zeros(len(rays)),
    )
    cost = _normal_equations(rays, weights, points, p, t, prior_p, prior_t, information, coordinates, N, g, led_cost)
    outcome, iterations = (NOT_CONVERGED, 0) if cost < np.inf else (BEHIND, 0)
    while outcome == NOT_CONVERGED and iterations < max_iterations:
        iterations += 1
        for i in range(6):
            D[i] = 1.0 if damping == IDENTITY else max(D[i], N[i, i])
        if not _solve(N, D, mu, g, x):
            if damping == UNDAMPED or mu > 1e6:
                outcome = SINGULAR
                break
            mu = max(10.0 * mu, 1e-6)
            continue
        length = _square(N, x)
        least = tolerance if 2 * iterations < max_iterations else max(tolerance, _CREEPING)
        if length < least**2 and damping != UNDAMPED and mu > 1e-9 and _solve(N, D, 0.0, g, x):
            length = _square(N, x)
        _moved(p, t, x, coordinates, p_new, t_new)
        new = _normal_equations(
            rays, weights, points, p_new, t_new, prior_p, prior_t, information, coordinates, N_new, g_new, led_new
        )
        promised = 2.0 * (g * x).sum() - _square(N, x)
        if (length < least**2 or promised < _ROUNDING * cost) and new < np.inf:
            outcome = CONVERGED
        elif damping != UNDAMPED:
            gain = (cost - new) / promised
            if not gain > 0.0:
                mu = max(10.0 * mu, 1e-6)
                continue
            mu *= max(0.1, 1.0 - (2.0 * gain - 1.0) ** 3)
        elif not new < np.inf:
            break
        p[:], t[:], g[:], N[:], led_cost[:], cost = p_new, t_new, g_new, N_new, led_new, new
    _normal_equations(rays, weights, points, p, t, prior_p, prior_t, information, LOCAL, N, g, led_cost)
    covariance = np.full((6, 6), np.nan)
    if outcome == CONVERGED and not _invert(N, covariance):
        outcome = SINGULAR
    _matrix_from_mrp(p, C)
    return outcome, iterations, C, t, led_cost, cost, covariance


@njit(cache=True)
def _invert(N: Array, inverse: Array) -> bool:
    unit, x = np.zeros(6), np.empty(6)
    for i in range(6):
        unit[:] = 0.0
        unit[i] = 1.0
        if not _solve(N, unit, 0.0, unit, x):
            inverse[:] = np.nan
            return False
        inverse[i] = x
    for i in range(6):
        for j in range(i):
            inverse[i, j] = inverse[j, i] = 0.5 * (inverse[i, j] + inverse[j, i])
    return True


@njit(cache=True)
def _square(N: Array, x: Array) -> float:
    total = 0.0
    for i in range(6):
        for j in range(6):
            total += x[i] * N[i, j] * x[j]
    return total
