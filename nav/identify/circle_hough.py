"""Circle Hough transform over candidate points.

Every candidate votes for the centres of all circles of radius r through it, r over a range; where the votes meet is the
ring's centre, and the radius with the highest vote is its radius [Yoon 2018, Figs 10 and 16].

Here a vote is exact: a cell counts the candidates whose distance from the cell's centre is within `gate` r of r,

    votes(c, r) = #{ i : | |x_i - c| - r | <= gate r }                                    (1)

so the accumulator can be checked against (1), and no rounding of drawn circles loses a vote. Cells are `cell` r wide:
a coarse grid for a large ring, a fine one for a small ring, and radii stand in a geometric row, so the cost of a radius
does not depend on it: about 2 pi / cell votes a candidate times the band's width in cells.

Among clutter the highest vote is the largest circle's, whose band holds the most clutter. With n candidates over an
area A a band holds 4 pi gate r^2 n/A of them by accident, and a peak of m votes is as good as it is seldom,

    -ln(expected accidental cells like it) = m ln(m/mu) - m + mu - ln(A/(cell r)^2),   mu = 4 pi gate r^2 n/A      (2)

by Chernoff's bound of the Poisson tail. `find_circles` ranks by (2) when it is told n/A, else by votes as the source.

Bounded by the range of radii (give the prior's when there is one), the disc in which the centre can be, and the number
of candidates: of n only groups vote of which each is within reach of the next, on a grid of no more than
(2 n (1 + gate) + 2)^2 / cell^2 cells, whatever the radius. Fooled by any second ring of the same size; a tilted ring
spreads its votes over the gate.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from dockair.kernels import njit
from dockair.rotations import Array

_WORD = 64  # bits: peaks that `triples_near` looks at together


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
    clutter_px2: float | None = None,
) -> Peaks:
    """The best cells over all radii.

    Args:
        points: (n, 2) candidates [px].
        radii: (m,) to try [px].
        centre_gate: u, v and radius of the disc that may hold the centre [px]; the square about it is searched.
        cell: width of a cell as a fraction of the radius.
        gate: half width of the band as a fraction of the radius.
        peaks: how many to return.
        min_votes: cells with fewer are no peaks.
        clutter_px2: n/A of Eq. (2) [1/px^2]; None: the most votes are the best.
    """
    middle, reach = np.array(centre_gate[:2]), centre_gate[2]
    table = _peaks(
        np.ascontiguousarray(points), radii, middle - reach, middle + reach,
        cell, gate, peaks, min_votes, clutter_px2 or 0.0,
    )  # fmt: skip
    return Peaks(centre_px=table[:, :2], radius_px=table[:, 2], votes=table[:, 3].astype(np.int64))


def triples_near(points: Array, peaks: Peaks, band: float) -> NDArray[np.int64]:
    """(m, 3) indices, ascending, of points (n, 2) that are three in one peak's band: within `band` r of its circle."""
    distance = np.hypot(*(points[:, None] - peaks.centre_px).transpose(2, 0, 1))
    member = np.abs(distance - peaks.radius_px) <= band * peaks.radius_px
    found = []
    for first in range(0, max(len(peaks.votes), 1), _WORD):
        part = member[:, first : first + _WORD]
        bits = (part * (np.uint64(1) << np.arange(part.shape[1], dtype=np.uint64))).sum(axis=1, dtype=np.uint64)
        found.append(_triples_sharing_a_bit(bits))
    return np.asarray(found[0] if len(found) == 1 else np.unique(np.concatenate(found), axis=0))


@njit(cache=True)
def _triples_sharing_a_bit(bits):  # type: ignore[no-untyped-def]
    n = len(bits)
    triples = np.empty((n * (n - 1) * (n - 2) // 6, 3), np.int64)
    m = 0
    for i in range(n):
        for j in range(i + 1, n):
            both = bits[i] & bits[j]
            if both != 0:
                for k in range(j + 1, n):
                    if both & bits[k] != 0:
                        triples[m, 0], triples[m, 1], triples[m, 2] = i, j, k
                        m += 1
    return triples[:m]


@njit(cache=True)
def _insert(table, filled, u, v, r, votes, worth, spacing):  # type: ignore[no-untyped-def]
    """Put a cell among the best unless a better one lies near it; it takes the place of a worse one near it."""
    place, worst = filled, 0
    for k in range(filled):
        near = np.hypot(table[k, 0] - u, table[k, 1] - v) + abs(table[k, 2] - r) <= spacing * max(r, table[k, 2])
        if near:
            place = k
            break
        if table[k, 4] < table[worst, 4]:
            worst = k
    if place == len(table):
        place = worst
    if place < filled and worth <= table[place, 4]:
        return filled
    table[place, 0], table[place, 1], table[place, 2], table[place, 3], table[place, 4] = u, v, r, votes, worth
    return max(filled, place + 1)


@njit(cache=True)
def _is_top(votes, i, j):  # type: ignore[no-untyped-def]
    """Whether no neighbouring cell has more votes."""
    for a in range(max(i - 1, 0), min(i + 2, votes.shape[0])):
        for b in range(max(j - 1, 0), min(j + 2, votes.shape[1])):
            if votes[a, b] > votes[i, j]:
                return False
    return True


@njit(cache=True)
def _groups(points, reach):  # type: ignore[no-untyped-def]
    """(n,) number of each point's group: all whom steps within reach join."""
    group = np.full(len(points), -1)
    todo = np.empty(len(points), np.int64)
    count = 0
    for i in range(len(points)):
        if group[i] >= 0:
            continue
        group[i], todo[0], left = count, i, 1
        while left > 0:
            left -= 1
            j = todo[left]
            for k in range(len(points)):
                near = (points[j, 0] - points[k, 0]) ** 2 + (points[j, 1] - points[k, 1]) ** 2 <= reach * reach
                if group[k] < 0 and near:
                    group[k], todo[left] = count, k
                    left += 1
        count += 1
    return group


@njit(cache=True)
def _worth(most, r, cell, gate, clutter, candidates):  # type: ignore[no-untyped-def]
    """(most + 1,) Eq. (2) for every number of votes; the votes themselves without clutter."""
    worth = np.arange(most + 1).astype(np.float64)
    if clutter > 0.0:
        mu = 4.0 * np.pi * gate * r * r * clutter
        cells = np.log(candidates / clutter / (cell * r) ** 2)
        for m in range(1, most + 1):
            worth[m] = (m * np.log(m / mu) - m + mu if m > mu else 0.0) - cells
    return worth


@njit(cache=True)
def _peaks(  # type: ignore[no-untyped-def]
    all_points, radii, gate_lower, gate_upper, cell, gate, capacity, min_votes, clutter
):
    table = np.zeros((capacity, 5))
    filled = 0
    lower, upper = np.empty(2), np.empty(2)
    for r in radii:
        width = cell * r
        # all that vote for a cell lie within the band's outer diameter
        group = _groups(all_points, 2.0 * (1.0 + gate) * r)
        worth = _worth(len(all_points), r, cell, gate, clutter, len(all_points))
        for g in range(group.max() + 1 if len(group) else 0):
            points = all_points[group == g]
            if len(points) < min_votes:
                continue
            # the centre of a ring of which at least four LEDs are seen may lie outside their box, by less than a radius
            for axis in range(2):
                lower[axis] = max(points[:, axis].min() - r, gate_lower[axis])
                upper[axis] = min(points[:, axis].max() + r, gate_upper[axis] + width)  # the last cells lie beyond it
            if lower[0] > upper[0] or lower[1] > upper[1]:
                continue
            u0, v0 = lower[0], lower[1]
            rows, columns = int((upper[1] - v0) / width) + 1, int((upper[0] - u0) / width) + 1
            votes = _accumulate(points, r, u0, v0, rows, columns, width, gate)
            least = table[:, 4].min() if filled == capacity else -np.inf
            for i in range(rows):
                for j in range(columns):
                    m = votes[i, j]
                    if m >= min_votes and worth[m] > least and _is_top(votes, i, j):
                        u, v = u0 + j * width, v0 + i * width
                        filled = _insert(table, filled, u, v, r, m, worth[m], 3.0 * cell)
                        least = table[:, 4].min() if filled == capacity else -np.inf
    order = np.argsort(-table[:filled, 4])
    return table[:filled][order]
