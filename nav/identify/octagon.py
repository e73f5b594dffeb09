"""Three candidates say where the other five LEDs would be: the octagon's image, looked up among the candidates.

Three candidates and the slots they take fix a ring in space (`posit`). Each of its other five places is then a
coincidence to be looked for, where a circle through three points [Yoon 2018, eqs 4-8] only offers its whole rim.

A triple is tried with the patterns of slots it may take. `RIGHT_ANGLES` are the three whose slots are 90, 90 and 180
degrees apart: of any five LEDs three have slots of the same parity, so that no ring of five or more escapes them. All
21 (`ALL_PATTERNS`) are needed for four. Maps that are no view of a circle drop out first (`triangles`). Candidates
stand in a grid of cells, so that a look-up costs the same however many there are.

Slots count in the sense of the LEDs' numbers (left, up, right, down in the image); which one is LED 0 is not decided
here.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from dockair.kernels import njit
from dockair.nav.identify.posit import SLOTS, rings_through
from dockair.nav.identify.triangles import plausible_maps
from dockair.rotations import Array

_ANGLE = 2.0 * np.pi * np.arange(SLOTS) / SLOTS
_COS, _SIN = np.cos(_ANGLE), np.sin(_ANGLE)
#: slots of the second and the third point when the first has slot 0
ALL_PATTERNS = np.array([(a, b) for a in range(1, SLOTS) for b in range(a + 1, SLOTS)])
RIGHT_ANGLES = np.array([(2, 4), (2, 6), (4, 6)])
_IS_RIGHT_ANGLE = np.zeros((SLOTS, SLOTS), bool)
_IS_RIGHT_ANGLE[tuple(RIGHT_ANGLES.T)] = True
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
    radius_px: Array  #: (m,) of the ring if it were frontal to a camera aimed at it: f k of `posit`
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
    row, rings, size = rings_through(
        relative, plausible, patterns, inverses, gates, tolerance_px / f, tolerance_per_radius
    )
    found, count, candidate = _looked_up(relative, plausible, patterns, row, rings, size)
    right_angles = _IS_RIGHT_ANGLE[tuple(patterns.T)][plausible[row, 3]]
    return Octagons(
        triple=plausible[row[found], :3].astype(np.int64), count=count, candidate=candidate,
        radius_px=size[found, 0] * f, tolerance_px=size[found, 1] * f,
        tested_right_angles=int(np.count_nonzero(right_angles)), tested=len(row),
    )  # fmt: skip


@njit(cache=True)
def _grid(points, reach):  # type: ignore[no-untyped-def]
    """Cells over the candidates: origin, cells per unit, first entry of each cell, and who is within reach of each."""
    u0, v0 = points[:, 0].min() - reach, points[:, 1].min() - reach
    extent = max(points[:, 0].max() + reach - u0, points[:, 1].max() + reach - v0)
    per_cell = _CELLS / (extent * (1.0 + 1e-12) + 1e-300)
    first = np.zeros(_CELLS * _CELLS + 1, np.int64)
    for fill in range(2):
        if fill:
            entries = np.empty(first[-1], np.int64)
        for k in range(len(points) - 1, -1, -1):
            top = int((points[k, 1] - reach - v0) * per_cell)
            left = int((points[k, 0] - reach - u0) * per_cell)
            for row in range(max(top, 0), min(int((points[k, 1] + reach - v0) * per_cell), _CELLS - 1) + 1):
                for column in range(max(left, 0), min(int((points[k, 0] + reach - u0) * per_cell), _CELLS - 1) + 1):
                    cell = row * _CELLS + column
                    if fill:
                        first[cell] -= 1
                        entries[first[cell]] = k
                    else:
                        first[cell] += 1
        if not fill:
            first[:] = np.cumsum(first)
    return u0, v0, per_cell, first, entries


@njit(cache=True, error_model="numpy")
def _look_up(points, grid, ring, tolerance, found):  # type: ignore[no-untyped-def]
    """Fill the free slots of `found` with the nearest candidate inside the tolerance; number of slots filled in all.

    Rows of ring (3, 3): the centre and the ring's two axes in camera axes (depth, u, v), in any unit.
    """
    u0, v0, per_cell, first, entries = grid
    count = 0
    for s in range(SLOTS):
        if found[s] < 0:
            inverse = 1.0 / (ring[0, 0] + ring[1, 0] * _COS[s] + ring[2, 0] * _SIN[s])
            u = (ring[0, 1] + ring[1, 1] * _COS[s] + ring[2, 1] * _SIN[s]) * inverse
            v = (ring[0, 2] + ring[1, 2] * _COS[s] + ring[2, 2] * _SIN[s]) * inverse
            row, column = (v - v0) * per_cell, (u - u0) * per_cell
            if not (0.0 <= row < _CELLS and 0.0 <= column < _CELLS):
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
def _looked_up(points, plausible, patterns, row, rings, size):  # type: ignore[no-untyped-def]
    """Rows of `rings_through` with at least four LEDs: which, how many LEDs, and who is in each slot."""
    out_row, out_count = np.empty(_KEPT, np.int64), np.empty(_KEPT, np.int64)
    out_slots, found = np.empty((_KEPT, SLOTS), np.int64), np.empty(SLOTS, np.int64)
    grid = _grid(points, size[:, 1].max() if len(size) else 0.0)
    n = 0
    for r in range(len(row)):
        t = row[r]
        b, c = patterns[plausible[t, 3], 0], patterns[plausible[t, 3], 1]
        found[:] = -1
        found[0], found[b], found[c] = plausible[t, 0], plausible[t, 1], plausible[t, 2]
        count = _look_up(points, grid, rings[r], size[r, 1], found)
        if count >= 4 and n < _KEPT:
            out_row[n], out_count[n] = r, count
            out_slots[n] = found
            n += 1
    return out_row[:n].copy(), out_count[:n].copy(), out_slots[:n].copy()
