"""First guess of the pose from a flat ring of LEDs: both of the attitudes that its image allows.

Scaled orthography about the middle of the LEDs. With q_i the LEDs in their own plane, from their mean, and (m_i) the
image seen along the mean line of sight (axes C', x' toward the LEDs, m = (y'/x', z'/x')), least squares gives

    m_i = A q_i + m_0,     A = (1/d) G,     G the last two rows of [c_1 c_2],                        (1)

where c_1, c_2 are the plane's axes in C' and d the distance. The larger singular value of A is 1/d, since one
direction in the plane is always seen at full length; the other is cos(tilt)/d. The missing first row follows from
c_1, c_2 being orthonormal, up to its sign:

    (c_1, c_2)_x = +- sin(tilt) v_2',    v_2 the singular vector of the smaller value.               (2)

That sign is the planar ambiguity: the two attitudes are mirror images about the line of sight, and orthography cannot
tell them apart. Perspective, which can (a little), is left to the refinement that follows. Unlike a homography the fit
stays well conditioned far away and when the ring is exactly frontal, where (2) gives one attitude twice.

Valid for ranges beyond about twice the ring's diameter. LEDs slightly out of the plane are projected onto it.
Source: D. Oberkampf, D. DeMenthon, L. Davis, Iterative pose estimation using coplanar feature points, 1996.
"""

import numpy as np

from dockair.kernels import njit
from dockair.rotations import Array


@njit(cache=True)
def _plane(points: Array, axes: Array) -> Array:
    """Fill axes (3, 3) with rows e_1, e_2, e_3 (normal); return the mean of the points, NaN when they lie on a line."""
    n, mean, normal = len(points), np.zeros(3), np.zeros(3)
    for i in range(n):
        for k in range(3):
            mean[k] += points[i, k] / n
    best, size = -1, 0.0
    for i in range(n):
        r = (points[i, 0] - mean[0]) ** 2 + (points[i, 1] - mean[1]) ** 2 + (points[i, 2] - mean[2]) ** 2
        if r > size:
            best, size = i, r
    for i in range(n):  # sum of the cross products with the farthest point, all on one side
        if best < 0:
            break
        a, b = points[best] - mean, points[i] - mean
        c = np.array([a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]])
        normal += c if (c * normal).sum() >= 0.0 else -c
    length = np.sqrt((normal**2).sum())
    if not length > 1e-9 * size:
        return np.full(3, np.nan)
    axes[2] = normal / length
    a = points[best] - mean
    a -= (a * axes[2]).sum() * axes[2]
    axes[0] = a / np.sqrt((a**2).sum())
    u, w = axes[2], axes[0]
    axes[1] = np.array([u[1] * w[2] - u[2] * w[1], u[2] * w[0] - u[0] * w[2], u[0] * w[1] - u[1] * w[0]])
    return mean


@njit(cache=True)
def _axes_along(ray: Array) -> Array:
    """(3, 3) R_CC' whose first column is the ray."""
    R, k = np.empty((3, 3)), 1 if abs(ray[1]) < abs(ray[2]) else 2
    y = np.zeros(3)
    y[k] = 1.0
    y -= (y * ray).sum() * ray
    y /= np.sqrt((y**2).sum())
    R[:, 0], R[:, 1] = ray, y
    R[:, 2] = np.array([ray[1] * y[2] - ray[2] * y[1], ray[2] * y[0] - ray[0] * y[2], ray[0] * y[1] - ray[1] * y[0]])
    return R


@njit(cache=True)
def _affine_fit(rays: Array, points: Array, R: Array, axes: Array, mean: Array) -> tuple[Array, Array]:
    """Return A (2, 2) and m_0 (2,) of Eq. (1); A is NaN when the LEDs do not span a plane."""
    n, S, T, m0, A = len(rays), np.zeros((2, 2)), np.zeros((2, 2)), np.zeros(2), np.full((2, 2), np.nan)
    for i in range(n):
        m, q, x = np.zeros(2), np.zeros(2), 0.0
        for k in range(3):
            x += R[k, 0] * rays[i, k]
            for j in range(2):
                m[j] += R[k, 1 + j] * rays[i, k]
                q[j] += axes[j, k] * (points[i, k] - mean[k])
        for j in range(2):
            m0[j] += m[j] / (x * n)
            for k in range(2):
                S[j, k] += q[j] * q[k]
                T[j, k] += m[j] / x * q[k]
    det = S[0, 0] * S[1, 1] - S[0, 1] * S[1, 0]
    if det > 1e-12 * (S[0, 0] + S[1, 1]) ** 2:
        for j in range(2):
            A[j, 0] = (T[j, 0] * S[1, 1] - T[j, 1] * S[1, 0]) / det
            A[j, 1] = (T[j, 1] * S[0, 0] - T[j, 0] * S[0, 1]) / det
    return A, m0


@njit(cache=True)
def two_poses(rays: Array, points_D: Array) -> tuple[Array, Array]:
    """Both poses that scaled orthography allows.

    Args:
        rays: (n, 3) unit lines of sight in camera axes, n >= 3.
        points_D: (n, 3) LEDs in drogue axes [m], flat or nearly so.

    Returns:
        (2, 3, 3) R_CD and (2, 3) p_CD [m], along the rays wherever they point; NaN when the LEDs lie on a line.
    """
    attitudes, positions, axes = np.full((2, 3, 3), np.nan), np.full((2, 3), np.nan), np.empty((3, 3))
    mean = _plane(points_D, axes)
    ray = rays.sum(axis=0)
    ray /= np.sqrt((ray**2).sum())
    R = _axes_along(ray)
    A, m0 = _affine_fit(rays, points_D, R, axes, mean)
    a, b, c = (A[:, 0] ** 2).sum(), (A[:, 0] * A[:, 1]).sum(), (A[:, 1] ** 2).sum()  # A'A
    spread = np.sqrt(0.25 * (a - c) ** 2 + b * b)
    large, small = 0.5 * (a + c) + spread, max(0.5 * (a + c) - spread, 0.0)
    if not (large > 0.0 and large < np.inf):
        return attitudes, positions
    turn = 0.5 * np.arctan2(2.0 * b, a - c)  # direction of the larger value; the smaller one is across
    sine = np.sqrt(1.0 - small / large)
    distance = 1.0 / np.sqrt(large)
    for k in range(2):
        x = sine if k == 0 else -sine
        c1 = np.array([-x * np.sin(turn), A[0, 0] * distance, A[1, 0] * distance])  # Eq. (2)
        c2 = np.array([x * np.cos(turn), A[0, 1] * distance, A[1, 1] * distance])
        c3 = np.array([c1[1] * c2[2] - c1[2] * c2[1], c1[2] * c2[0] - c1[0] * c2[2], c1[0] * c2[1] - c1[1] * c2[0]])
        for i in range(3):
            for j in range(3):
                attitudes[k, i, j] = 0.0
                for m in range(3):
                    in_plane = c1[m] * axes[0, j] + c2[m] * axes[1, j] + c3[m] * axes[2, j]
                    attitudes[k, i, j] += R[i, m] * in_plane
        for i in range(3):
            positions[k, i] = distance * (R[i, 0] + R[i, 1] * m0[0] + R[i, 2] * m0[1])
            for j in range(3):
                positions[k, i] -= attitudes[k, i, j] * mean[j]
    return attitudes, positions


@njit(cache=True)
def mirrored(R_CD: Array, p_CD: Array, points_D: Array) -> tuple[Array, Array]:
    """The other attitude of Eq. (2): the LEDs' plane reflected about the line of sight to their middle.

    Args:
        R_CD: (3, 3) attitude.
        p_CD: (3,) position [m].
        points_D: (n, 3) LEDs in drogue axes [m].

    Returns:
        R_CD (3, 3), p_CD (3,); the same pose when the plane is frontal, NaN when the LEDs lie on a line.
    """
    axes, middle, normal = np.empty((3, 3)), np.zeros(3), np.zeros(3)
    mean = _plane(points_D, axes)
    for i in range(3):
        middle[i] = p_CD[i]
        for j in range(3):
            middle[i] += R_CD[i, j] * mean[j]
            normal[i] += R_CD[i, j] * axes[2, j]
    sight = middle / np.sqrt((middle**2).sum())
    cosine = (sight * normal).sum()  # of either sign: what follows has the same of both normals
    k = np.array(
        [
            sight[1] * normal[2] - sight[2] * normal[1],
            sight[2] * normal[0] - sight[0] * normal[2],
            sight[0] * normal[1] - sight[1] * normal[0],
        ]
    )
    # turn by -2 tilt about k, which has the length sin(tilt): I + sin K + (1 - cos) K^2
    R, p = np.empty((3, 3)), middle.copy()
    for j in range(3):
        v = R_CD[:, j].copy()
        along = (k * v).sum()
        cross = np.array([k[1] * v[2] - k[2] * v[1], k[2] * v[0] - k[0] * v[2], k[0] * v[1] - k[1] * v[0]])
        double_cross = k * along - v * (k**2).sum()
        R[:, j] = v - 2.0 * cosine * cross + 2.0 * double_cross
    for i in range(3):
        for j in range(3):
            p[i] -= R[i, j] * mean[j]
    return R, p


@njit(cache=True)
def position_for_attitude(rays: Array, points_D: Array, R_CD: Array) -> Array:
    """(3,) p_CD [m] that brings the LEDs nearest to their rays, attitude given: linear least squares.

    Minimises sum |(I - b b')(R_CD q + p)|^2; the solution in front of the camera.

    Args:
        rays: (n, 3) unit lines of sight b in camera axes.
        points_D: (n, 3) LEDs q in drogue axes [m].
        R_CD: (3, 3) attitude.
    """
    M, y, in_front = 1e-12 * np.eye(3), np.zeros(3), 0.0  # regular even when all rays are one
    for i in range(len(rays)):
        for j in range(3):
            for k in range(3):
                across = (1.0 if j == k else 0.0) - rays[i, j] * rays[i, k]
                M[j, k] += across
                for m in range(3):
                    y[j] -= across * R_CD[k, m] * points_D[i, m]
    p = np.linalg.solve(M, y)
    for i in range(len(rays)):
        in_front += (rays[i] * p).sum()
    return p if in_front >= 0.0 else -p
