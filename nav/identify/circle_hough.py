"""Circle Hough transform over candidate points.

Every candidate votes for the centres of all circles of radius r through it, r over a range; where the votes meet is the
ring's centre, and the radius with the highest vote is its radius [Yoon 2018, Figs 10 and 16].

Here a vote is exact: a cell counts the candidates whose distance from the cell's centre is within `gate` r of r,

    votes(c, r) = #{ i : | |x_i - c| - r | <= gate r }                                    (1)

so the accumulator can be checked against (1), and no rounding of drawn circles loses a vote. Cells are `cell` r wide:
a coarse grid for a large ring, a fine one for a small ring, and radii stand in a geometric row, so the cost of a radius
does not depend on it: about 2 pi / cell votes a candidate times the band's width in cells.

Bounded by the range of radii (give the prior's when there is one), the disc in which the centre can be, and the number
of candidates; those too far from all others to be on a common circle do not vote. Fooled by any second ring of the same
size; a tilted ring spreads its votes over the gate.
"""

from dataclasses import dataclass

import numpy as np
from numba import njit
from numpy.typing import NDArray

from dockair.rotations import Array


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Peaks:
    """Cells with the most votes, most first, at most one of a neighbourhood."""

    centre_px: Array  #: (n, 2)
    radius_px: Array  #: (n,)
    votes: NDArray[np.int64]  #: (n,)


def radius_row(smallest_px: float, largest_px: float, ratio: float = 1.1) -> Array:
    """Radii in a geometric row from the smallest to at least the largest."""
    steps = max(0, int(np.ceil(np.log(largest_px / smallest_px) / np.log(ratio))))
    return np.asarray(smallest_px * ratio ** np.arange(steps + 1))


def accumulate(points: Array, radius: float, origin: Array, shape: tuple[int, int], cell: float, gate: float) -> Array:
    """Votes (rows, columns) of Eq. (1) for one radius.

    Args:
        points: (n, 2) candidates (u, v) [px].
        radius: r [px].
        origin: (u, v) of the first cell's centre [px].
        shape: rows (v) and columns (u) of the grid.
        cell: width of a cell [px].
        gate: half width of the band, as a fraction of r.
    """
    return _accumulate(np.ascontiguousarray(points), radius, origin[0], origin[1], shape[0], shape[1], cell, gate)


@njit(cache=True)
def _accumulate(points, radius, u0, v0, rows, columns, cell, gate):  # type: ignore[no-untyped-def]
    votes = np.zeros((rows, columns), np.int16)
    outer, inner = radius * (1.0 + gate), radius * (1.0 - gate)
    for k in range(len(points)):
        u, v = points[k, 0] - u0, points[k, 1] - v0
        for i in range(max(0, int(np.ceil((v - outer) / cell))), min(rows - 1, int(np.floor((v + outer) / cell))) + 1):
            h2 = (i * cell - v) ** 2
            if h2 > outer * outer:
                continue
            reach = np.sqrt(outer * outer - h2)
            first, last = int(np.ceil((u - reach) / cell)), int(np.floor((u + reach) / cell))
            hole_first, hole_last = 1, 0  # cells nearer than the band: none
            if h2 < inner * inner:
                hole = np.sqrt(inner * inner - h2)
                hole_first, hole_last = int(np.floor((u - hole) / cell)) + 1, int(np.ceil((u + hole) / cell)) - 1
            if hole_first > hole_last:
                for j in range(max(first, 0), min(last, columns - 1) + 1):
                    votes[i, j] += 1
            else:
                for j in range(max(first, 0), min(hole_first - 1, columns - 1) + 1):
                    votes[i, j] += 1
                for j in range(max(hole_last + 1, 0), min(last, columns - 1) + 1):
                    votes[i, j] += 1
    return votes


def find_circles(
    points: Array,
    radii: Array,
    *,
    centre_gate: tuple[float, float, float],
    cell: float = 0.15,
    gate: float = 0.15,
    peaks: int = 12,
    min_votes: int = 4,
) -> Peaks:
    """The cells with most votes over all radii.

    Args:
        points: (n, 2) candidates [px].
        radii: (m,) to try [px].
        centre_gate: u, v and radius of the disc that may hold the centre [px].
        cell: width of a cell as a fraction of the radius.
        gate: half width of the band as a fraction of the radius.
        peaks: how many to return.
        min_votes: cells with fewer are no peaks.
    """
    gate_centre = np.array(centre_gate[:2])
    table = _peaks(
        np.ascontiguousarray(points), radii, gate_centre - centre_gate[2], gate_centre + centre_gate[2],
        cell, gate, peaks, min_votes,
    )  # fmt: skip
    return Peaks(centre_px=table[:, :2], radius_px=table[:, 2], votes=table[:, 3].astype(np.int64))


@njit(cache=True)
def _insert(table, filled, u, v, r, votes, spacing):  # type: ignore[no-untyped-def]
    """Put a cell among the best unless a better one lies near it; it takes the place of worse ones near it."""
    for k in range(filled):
        near = np.hypot(table[k, 0] - u, table[k, 1] - v) + abs(table[k, 2] - r) <= spacing * max(r, table[k, 2])
        if near:
            if table[k, 3] < votes:
                table[k, 0], table[k, 1], table[k, 2], table[k, 3] = u, v, r, votes
            return filled
    if filled < len(table):
        filled += 1
        table[filled - 1, 3] = -1.0
    worst = 0
    for k in range(filled):
        if table[k, 3] < table[worst, 3]:
            worst = k
    if votes > table[worst, 3]:
        table[worst, 0], table[worst, 1], table[worst, 2], table[worst, 3] = u, v, r, votes
    return filled


@njit(cache=True)
def _in_company(points, reach, needed):  # type: ignore[no-untyped-def]
    """Points with at least so many, themselves included, within reach."""
    keep = np.zeros(len(points), np.bool_)
    for i in range(len(points)):
        near = 0
        for j in range(len(points)):
            near += (points[i, 0] - points[j, 0]) ** 2 + (points[i, 1] - points[j, 1]) ** 2 <= reach * reach
        keep[i] = near >= needed
    return points[keep]


@njit(cache=True)
def _peaks(all_points, radii, gate_lower, gate_upper, cell, gate, capacity, min_votes):  # type: ignore[no-untyped-def]
    table = np.zeros((capacity, 4))
    filled = 0
    for r in radii:
        width = cell * r
        # all that vote for a cell lie within the band's outer diameter: the lonely need not vote
        points = _in_company(all_points, 2.0 * (1.0 + gate) * r, min_votes)
        if len(points) == 0:
            continue
        lower, upper = np.empty(2), np.empty(2)
        for axis in range(2):
            lower[axis] = max(points[:, axis].min(), gate_lower[axis])
            upper[axis] = min(points[:, axis].max(), gate_upper[axis])
        if lower[0] > upper[0] or lower[1] > upper[1]:
            continue
        # the centre of a ring of which at least four LEDs are seen may lie outside their box, by less than a radius
        u0, v0 = lower[0] - r, lower[1] - r
        rows = int((upper[1] - lower[1] + 2.0 * r) / width) + 1
        columns = int((upper[0] - lower[0] + 2.0 * r) / width) + 1
        votes = _accumulate(points, r, u0, v0, rows, columns, width, gate)
        for i in range(rows):
            for j in range(columns):
                if votes[i, j] >= min_votes:
                    filled = _insert(table, filled, u0 + j * width, v0 + i * width, r, votes[i, j], 3.0 * cell)
    order = np.argsort(-table[:filled, 3])
    return table[:filled][order]
