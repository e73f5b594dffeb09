"""The rings in space that three candidates and their slots fix.

Three LEDs and the slots they take on the ring fix an affine map of the octagon, and that a ring in space,

    q_s (1 + eps_s) = c + A e_s,   eps_s = d . e_s,   e_s = (cos 45 s, sin 45 s)          (1)
    d_0^2 = k^2 - |A_0|^2,   d_1^2 = k^2 - |A_1|^2,   d_0 d_1 = -A_0 . A_1                (2)

with q a pixel over the focal length from the principal point, A_0 and A_1 the columns of A, k its larger singular
value (the ring's radius over its depth) and eps the depth of a slot relative to the centre's. (2) leaves the sign of d
open, the two tilts that parallel projection cannot tell apart. (1) is solved from eps = 0 by putting eps of the last
map in, as POSIT does (DeMenthon & Davis 1995), for both signs where it matters.
"""

import numpy as np

from dockair.kernels import njit

SLOTS = 8
_ANGLE = 2.0 * np.pi * np.arange(SLOTS) / SLOTS
_COS, _SIN = np.cos(_ANGLE), np.sin(_ANGLE)
_STEPS = 2  # of Eq. (1)
# k^2 times the least of _LEFT[0] and _LEFT[1] + _LEFT[2] (k / sin tilt)^2 bounds what these steps leave of a slot's
# error: a ring seen nearly along its axis has four views through three LEDs, and two of them are started from
_LEFT = (0.7, 0.04, 1.4)
_LOOSE = 0.9  # of the least ratio of axes: what eps may do to it


@njit(cache=True, error_model="numpy")
def _aim(points, i, j, k, turn, q):  # type: ignore[no-untyped-def]
    """Aim a camera at the middle of three points: its rotation from camera axes (depth, u, v), and what it sees."""
    u = (points[i, 0] + points[j, 0] + points[k, 0]) / 3.0
    v = (points[i, 1] + points[j, 1] + points[k, 1]) / 3.0
    x = 1.0 / np.sqrt(1.0 + u * u + v * v)
    u, v, h = u * x, v * x, 1.0 / (1.0 + x)
    turn[0, 0], turn[0, 1], turn[0, 2] = x, u, v
    turn[1, 0], turn[1, 1], turn[1, 2] = -u, 1.0 - u * u * h, -u * v * h
    turn[2, 0], turn[2, 1], turn[2, 2] = -v, -u * v * h, 1.0 - v * v * h
    for row, point in ((0, i), (1, j), (2, k)):
        u, v = points[point, 0], points[point, 1]
        depth = turn[0, 0] + turn[0, 1] * u + turn[0, 2] * v
        q[row, 0] = (turn[1, 0] + turn[1, 1] * u + turn[1, 2] * v) / depth
        q[row, 1] = (turn[2, 0] + turn[2, 1] * u + turn[2, 2] * v) / depth


@njit(cache=True, error_model="numpy")
def _map(q, b, c, inverses, p, m):  # type: ignore[no-untyped-def]
    """Eq. (1) through q (3, 2) in slots 0, b, c with the depths of the last map in m, then Eq. (2); k^2.

    m holds c, A and d: c_u, c_v, A_u0, A_u1, A_v0, A_v1, d_0, d_1.
    """
    w = 1.0 + m[6]
    wb = 1.0 + m[6] * _COS[b] + m[7] * _SIN[b]
    wc = 1.0 + m[6] * _COS[c] + m[7] * _SIN[c]
    e, f = wb * q[1, 0] - w * q[0, 0], wc * q[2, 0] - w * q[0, 0]
    g, h = wb * q[1, 1] - w * q[0, 1], wc * q[2, 1] - w * q[0, 1]
    m[2] = e * inverses[p, 0, 0] + f * inverses[p, 1, 0]
    m[3] = e * inverses[p, 0, 1] + f * inverses[p, 1, 1]
    m[4] = g * inverses[p, 0, 0] + h * inverses[p, 1, 0]
    m[5] = g * inverses[p, 0, 1] + h * inverses[p, 1, 1]
    m[0], m[1] = w * q[0, 0] - m[2], w * q[0, 1] - m[4]  # e_0 = (1, 0)
    aa, bb, ab = m[2] * m[2] + m[4] * m[4], m[3] * m[3] + m[5] * m[5], m[2] * m[3] + m[4] * m[5]
    k2 = 0.5 * (aa + bb + np.sqrt((aa - bb) * (aa - bb) + 4.0 * ab * ab))
    d0, d1 = np.sqrt(max(k2 - aa, 0.0)), np.sqrt(max(k2 - bb, 0.0))
    if ab > 0.0:
        d1 = -d1
    along = m[6] * d0 + m[7] * d1  # of the two, the one nearer to the last: each start keeps to its own solution
    if along < 0.0:
        d0, d1 = -d0, -d1
    m[6], m[7] = d0, d1
    return k2


@njit(cache=True)
def _facing(turn, m):  # type: ignore[no-untyped-def]
    """k^2 times the cosine of the tilt against the camera's axis."""
    aimed = m[2] * m[5] - m[3] * m[4]
    return turn[0, 0] * aimed + turn[1, 0] * (m[4] * m[7] - m[6] * m[5]) + turn[2, 0] * (m[6] * m[3] - m[2] * m[7])


@njit(cache=True)
def _tolerance(k, m, tol, tol_k):  # type: ignore[no-untyped-def]
    """Of a look-up, after the steps of Eq. (1)."""
    left = min(_LEFT[0], _LEFT[1] + _LEFT[2] * k**4 / max(m[6] ** 2 + m[7] ** 2, 1e-12))
    return tol + k * (tol_k + left * k)


@njit(cache=True)
def _ring(turn, m, ring):  # type: ignore[no-untyped-def]
    """Centre and axes in camera axes, unit: the centre's distance along the aimed camera's axis."""
    for i in range(3):
        ring[0, i] = turn[0, i] + turn[1, i] * m[0] + turn[2, i] * m[1]
        ring[1, i] = turn[0, i] * m[6] + turn[1, i] * m[2] + turn[2, i] * m[4]
        ring[2, i] = turn[0, i] * m[7] + turn[1, i] * m[3] + turn[2, i] * m[5]


@njit(cache=True, error_model="numpy")
def _passes(ring, k, gates):  # type: ignore[no-untyped-def]
    """Whether a ring is as large, where and turned as the gates want it."""
    k_min, k_max, gate_u, gate_v, gate_r, roll, roll_tol, _ = gates
    depth = ring[0, 0]
    u, v = ring[0, 1] / depth, ring[0, 2] / depth
    if not k_min * depth <= k <= k_max * depth or (u - gate_u) ** 2 + (v - gate_v) ** 2 > gate_r**2:
        return False
    if roll_tol >= 0.5 * _ANGLE[1]:
        return True
    a, b = ring[1, 1] - u * ring[1, 0], ring[2, 1] - u * ring[2, 0]
    c, d = ring[1, 2] - v * ring[1, 0], ring[2, 2] - v * ring[2, 0]
    # rotation part of the image's map; slot 0 of a ring with roll phi lies at phi + 180 deg, and 180 is four slots
    turns = (np.arctan2(c - b, a + d) - roll) / _ANGLE[1]
    return abs(turns - np.round(turns)) * _ANGLE[1] <= roll_tol


@njit(cache=True, error_model="numpy")
def rings_through(points, plausible, patterns, inverses, gates, tol, tol_k):  # type: ignore[no-untyped-def]
    """Rings of plausible triples that pass the gates, at most two of each.

    Args:
        points: (n, 2) pixels over the focal length, from the principal point.
        plausible: (m, 4) triples and the row of their pattern.
        patterns: (p, 2) slots of the second and the third point.
        inverses: (p, 2, 2) of their edges.
        gates: least and largest k, (u, v, radius) of the centre's disc, roll and its tolerance, least ratio of axes.
        tol: of a look-up at radius 0;
        tol_k: growing with k.

    Returns:
        (r,) row of `plausible`, (r, 3, 3) centre and axes in camera axes, (r, 2) k and tolerance of the look-up.
    """
    row, size = np.empty(2 * len(plausible), np.int32), np.empty((2 * len(plausible), 2))
    rings = np.empty((2 * len(plausible), 3, 3))
    m, first, turn, q = np.empty(8), np.empty(8), np.empty((3, 3)), np.empty((3, 2))
    n, last_i, last_j, last_k = 0, np.int64(-1), np.int64(-1), np.int64(-1)
    for t in range(len(plausible)):
        i, j, k, p = np.int64(plausible[t, 0]), np.int64(plausible[t, 1]), np.int64(plausible[t, 2]), plausible[t, 3]
        if i != last_i or j != last_j or k != last_k:
            last_i, last_j, last_k = i, j, k
            _aim(points, i, j, k, turn, q)
        b, c = patterns[p, 0], patterns[p, 1]
        m[6] = m[7] = 0.0
        first_k2 = _map(q, b, c, inverses, p, m)
        first_radius = np.sqrt(first_k2)
        tolerance = tol + tol_k * first_radius
        # eps moves the octagon's points against each other by eps of its radius
        alike = first_radius * max(abs(m[6]), abs(m[7])) < 0.25 * tolerance
        first[:] = m
        for solution in range(1 if alike else 2):
            k2, radius = first_k2, first_radius
            if not alike:
                if solution == 1:
                    m[:] = first
                    m[6], m[7] = -first[6], -first[7]
                if _facing(turn, m) < _LOOSE**2 * gates[7] * k2:
                    continue
                for _ in range(_STEPS):
                    k2 = _map(q, b, c, inverses, p, m)
                radius = np.sqrt(k2)
                tolerance = _tolerance(radius, m, tol, tol_k)
            _ring(turn, m, rings[n])
            if (alike or _facing(turn, m) >= _LOOSE * gates[7] * k2) and _passes(rings[n], radius, gates):
                row[n], size[n, 0], size[n, 1] = t, radius, tolerance
                n += 1
    return row[:n], rings[:n], size[:n]
