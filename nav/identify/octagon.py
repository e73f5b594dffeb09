"""Three candidates say where the other five LEDs would be: the octagon's image, looked up among the candidates.

Three LEDs and the slots they take on the ring fix an affine map of the octagon, and that a ring in space,

    q_s (1 + eps_s) = c + A e_s,   eps_s = d . e_s,   e_s = (cos 45 s, sin 45 s)          (1)
    d_0^2 = k^2 - |A_0|^2,   d_1^2 = k^2 - |A_1|^2,   d_0 d_1 = -A_0 . A_1                (2)

with q a pixel over the focal length from the principal point, A_0 and A_1 the columns of A, k its larger singular
value (the ring's radius over its depth) and eps the depth of a slot relative to the centre's. (2) leaves the sign of d
open, the two tilts that parallel projection cannot tell apart. (1) is solved from eps = 0 by putting eps of the last
map in, as POSIT does (DeMenthon & Davis 1995), for both signs where it matters. Each of the other five places is then
a coincidence to be looked for, where a circle through three points [Yoon 2018, eqs 4-8] only offers its whole rim.

A triple is tried with the patterns of slots it may take. `RIGHT_ANGLES` are the three whose slots are 90, 90 and 180
degrees apart: of any five LEDs three have slots of the same parity, so that no ring of five or more escapes them. All
21 (`ALL_PATTERNS`) are needed for four. Maps that are no view of a circle drop out first (`triangles`). Candidates
stand in a grid of cells, so that a look-up costs the same however many there are.

Slots count in the sense of the LEDs' numbers (left, up, right, down in the image); which one is LED 0 is not decided
here.
"""

from dataclasses import dataclass

import numpy as np
from numba import njit
from numpy.typing import NDArray

from dockair.nav.identify.triangles import plausible_maps
from dockair.rotations import Array

SLOTS = 8
_ANGLE = 2.0 * np.pi * np.arange(SLOTS) / SLOTS
_COS, _SIN = np.cos(_ANGLE), np.sin(_ANGLE)
#: slots of the second and the third point when the first has slot 0
ALL_PATTERNS = np.array([(a, b) for a in range(1, SLOTS) for b in range(a + 1, SLOTS)])
RIGHT_ANGLES = np.array([(2, 4), (2, 6), (4, 6)])
_STEPS = 2  # of Eq. (1)
# k^2 times the least of _LEFT[0] and _LEFT[1] + _LEFT[2] (k / sin tilt)^2 bounds what these steps leave of a slot's
# error: a ring seen nearly along its axis has four views through three LEDs, and two of them are started from
_LEFT = (0.7, 0.04, 1.4)
_LOOSE = 0.9  # of the least ratio of axes: what eps may do to it
_CELLS = 32  # of the grid, a side
_KEPT = 2048  # octagons at most, in the order of the triples


def _inverse_edges() -> Array:
    """(8, 8, 2, 2) inverse of the edges e_a - e_0, e_b - e_0 for every pattern (a, b)."""
    e = np.column_stack([_COS, _SIN])
    inverses = np.full((SLOTS, SLOTS, 2, 2), np.nan)
    for a, b in ALL_PATTERNS:
        inverses[a, b] = np.linalg.inv(np.column_stack([e[a] - e[0], e[b] - e[0]]))
    return inverses


_INVERSES = _inverse_edges()


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Octagons:
    """Hypotheses with at least four LEDs, one a row."""

    triple: NDArray[np.int64]  #: (m, 3) candidates that define it
    count: NDArray[np.int64]  #: (m,) LEDs, the three included
    candidate: NDArray[np.int64]  #: (m, 8) candidate in each slot, -1 for none
    radius_px: Array  #: (m,) of the ring if it were frontal
    tolerance_px: Array  #: (m,) of its look-ups
    tested_right_angles: int  #: hypotheses of plausible shape that were looked up, of RIGHT_ANGLES
    tested: int  #: and of all patterns


def find_octagons(
    points: Array,
    triples: NDArray[np.int64],
    patterns: NDArray[np.int64] = ALL_PATTERNS,
    *,
    focal_length_px: float,
    principal_point_px: tuple[float, float],
    radius_range_px: tuple[float, float],
    centre_gate: tuple[float, float, float],
    roll_gate: tuple[float, float],
    min_axis_ratio: float,
    tolerance_px: float,
    tolerance_per_radius: float,
) -> Octagons:
    """Look up the octagons that triples of candidates suggest.

    Args:
        points: (n, 2) candidates, undistorted [px].
        triples: (m, 3) indices, any order.
        patterns: (p, 2) slots of second and third point, rows of ALL_PATTERNS.
        focal_length_px: of the camera, as the next.
        principal_point_px: (u, v).
        radius_range_px: of the ring if it were frontal.
        centre_gate: u, v and radius of the disc in which the centre must lie [px].
        roll_gate: roll of LED 0 and largest deviation from it, up to the ring's symmetry [rad].
        min_axis_ratio: smaller to larger semi-axis, the cosine of the largest tilt.
        tolerance_px: of a look-up, at radius 0;
        tolerance_per_radius: growing with the radius [px/px].
    """
    f, (u, v, reach) = focal_length_px, centre_gate
    relative = np.ascontiguousarray(points - np.array(principal_point_px)) / f
    inverses = _INVERSES[patterns[:, 0], patterns[:, 1]]
    k_min, k_max = radius_range_px[0] / f, radius_range_px[1] / f
    gate = (u - principal_point_px[0]) / f, (v - principal_point_px[1]) / f, reach / f
    gates = (k_min, k_max, *gate, *roll_gate, min_axis_ratio)
    plausible = plausible_maps(relative, triples, inverses, k_min, k_max, min_axis_ratio)
    triple, count, candidate, size, tested = _find_octagons(
        relative, plausible, patterns, inverses, gates, tolerance_px / f, tolerance_per_radius
    )
    return Octagons(
        triple=triple, count=count, candidate=candidate, radius_px=size[:, 0] * f, tolerance_px=size[:, 1] * f,
        tested_right_angles=int(tested[0]), tested=int(tested.sum()),
    )  # fmt: skip


@njit(cache=True)
def _grid(points, reach):  # type: ignore[no-untyped-def]
    """Cells over the candidates: origin and size, first entry of each cell, and the candidates within reach of each."""
    u0, v0 = points[:, 0].min() - reach, points[:, 1].min() - reach
    size = max(points[:, 0].max() + reach - u0, points[:, 1].max() + reach - v0) / _CELLS * (1.0 + 1e-12) + 1e-300
    first = np.zeros(_CELLS * _CELLS + 1, np.int64)
    for fill in range(2):
        if fill:
            entries = np.empty(first[-1], np.int64)
        for k in range(len(points) - 1, -1, -1):
            top = int((points[k, 1] - reach - v0) / size)
            left = int((points[k, 0] - reach - u0) / size)
            for row in range(max(top, 0), min(int((points[k, 1] + reach - v0) / size), _CELLS - 1) + 1):
                for column in range(max(left, 0), min(int((points[k, 0] + reach - u0) / size), _CELLS - 1) + 1):
                    cell = row * _CELLS + column
                    if fill:
                        first[cell] -= 1
                        entries[first[cell]] = k
                    else:
                        first[cell] += 1
        if not fill:
            first[:] = np.cumsum(first)
    return u0, v0, size, first, entries


@njit(cache=True, error_model="numpy")
def _look_up(points, grid, ring, tolerance, found):  # type: ignore[no-untyped-def]
    """Fill the free slots of `found` with the nearest candidate inside the tolerance; number of slots filled in all.

    Rows of ring (3, 3): the centre and the ring's two axes in camera axes (depth, u, v), in any unit.
    """
    u0, v0, size, first, entries = grid
    count = 0
    for s in range(SLOTS):
        if found[s] < 0:
            depth = ring[0, 0] + ring[1, 0] * _COS[s] + ring[2, 0] * _SIN[s]
            u = (ring[0, 1] + ring[1, 1] * _COS[s] + ring[2, 1] * _SIN[s]) / depth
            v = (ring[0, 2] + ring[1, 2] * _COS[s] + ring[2, 2] * _SIN[s]) / depth
            row, column = np.floor((v - v0) / size), np.floor((u - u0) / size)
            if not (0 <= row < _CELLS and 0 <= column < _CELLS):
                continue
            cell = int(row) * _CELLS + int(column)
            best = tolerance * tolerance
            for entry in range(first[cell], first[cell + 1]):
                k = entries[entry]
                distance = (points[k, 0] - u) ** 2 + (points[k, 1] - v) ** 2
                if distance < best:
                    best = distance
                    found[s] = k
        if found[s] >= 0:
            count += 1
    return count


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
    """Eq. (1) through q (3, 2) in slots 0, b, c with the depths of the last map in m, then Eq. (2); the radius k.

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
    return np.sqrt(k2)


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
def _find_octagons(points, plausible, patterns, inverses, gates, tol, tol_k):  # type: ignore[no-untyped-def]
    out_triple = np.empty((_KEPT, 3), np.int64)
    out_count = np.empty(_KEPT, np.int64)
    out_slots = np.empty((_KEPT, SLOTS), np.int64)
    out_size = np.empty((_KEPT, 2))
    # no ring with three LEDs at right angles is larger than the candidates' extent
    extent = max(points[:, 0].max() - points[:, 0].min(), points[:, 1].max() - points[:, 1].min())
    largest = min(gates[1], 1.2 * extent)
    grid = _grid(points, tol + largest * (tol_k + _LEFT[0] * largest))
    found = np.empty(SLOTS, np.int64)
    m, first, turn, ring, q = np.empty(8), np.empty(8), np.empty((3, 3)), np.empty((3, 3)), np.empty((3, 2))
    n, tested = 0, np.zeros(2, np.int64)
    last_i, last_j, last_k = np.int64(-1), np.int64(-1), np.int64(-1)
    for t in range(len(plausible)):
        i, j, k, p = np.int64(plausible[t, 0]), np.int64(plausible[t, 1]), np.int64(plausible[t, 2]), plausible[t, 3]
        if i != last_i or j != last_j or k != last_k:
            last_i, last_j, last_k = i, j, k
            _aim(points, i, j, k, turn, q)
        b, c = patterns[p, 0], patterns[p, 1]
        m[6] = m[7] = 0.0
        first_radius = _map(q, b, c, inverses, p, m)
        tolerance = tol + tol_k * first_radius
        # eps moves the octagon's points against each other by eps of its radius
        alike = first_radius * max(abs(m[6]), abs(m[7])) < 0.25 * tolerance
        first[:] = m
        for solution in range(1 if alike else 2):
            radius = first_radius
            if not alike:
                if solution == 1:
                    m[:] = first
                    m[6], m[7] = -first[6], -first[7]
                if _facing(turn, m) < _LOOSE**2 * gates[7] * radius * radius:
                    continue
                for _ in range(_STEPS):
                    radius = _map(q, b, c, inverses, p, m)
                tolerance = _tolerance(radius, m, tol, tol_k)
            _ring(turn, m, ring)
            if (alike or _facing(turn, m) >= _LOOSE * gates[7] * radius * radius) and _passes(ring, radius, gates):
                tested[int(b % 2 == 1 or c % 2 == 1)] += 1
                found[:] = -1
                found[0], found[b], found[c] = i, j, k
                count = _look_up(points, grid, ring, tolerance, found)
                if count >= 4 and n < _KEPT:
                    out_triple[n, 0], out_triple[n, 1], out_triple[n, 2] = i, j, k
                    out_count[n] = count
                    out_slots[n] = found
                    out_size[n, 0], out_size[n, 1] = radius, tolerance
                    n += 1
    return out_triple[:n].copy(), out_count[:n].copy(), out_slots[:n].copy(), out_size[:n].copy(), tested
