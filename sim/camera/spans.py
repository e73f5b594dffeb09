"""Where in a picture solids can be: for each, runs of blocks between the edges of its box's picture, row by row.

A block's ray is d = (1, -x, -y) in camera axes C. What a solid's box encloses is seen at tangents (x, y) inside the
convex outline of the box's corners; of a box that reaches behind the near plane, of the corners before it and of the
points where its edges cross that plane. A run has one block more at either end, and an outline one row more.
Solids whose bounding sphere lies beside the picture or behind the near plane have no runs.
"""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from dockair.kernels import njit
from dockair.rotations import Array
from dockair.sim.camera.solids import CAPSULE

_MOST_POINTS = 20  # a box's corners and its edges' cuts
_ROUNDING = 1.0 + 1e-9  # on the bounding sphere

#: Of the solids in the model, with places (ngeom, 3) and attitudes (ngeom, 9) of its geoms.
Poses = tuple[NDArray[np.intp], Array, Array]
Frame = tuple[Array, Array]  # R_WC and p_WC of the camera
Point = tuple[float, float]  # tangents x and y
Even = tuple[float, float, int]  # evenly spaced tangents: the first, how many there are in 1, their number


class Placed(NamedTuple):
    """Room for what can be seen: which solid, where it is in C, and its rows' runs of blocks."""

    solid: NDArray[np.int64]  #: (n,)
    centre_C: Array  #: (n, 3) [m]
    axes_C: Array  #: (n, 3, 3)
    rows: NDArray[np.int64]  #: (n, 3) first row, one past the last, where the first's run stands in `runs`
    runs: NDArray[np.int64]  #: (n rows of the picture, 2) first column and one past the last

    @classmethod
    def room_for(cls, count: int, most_rows: int) -> "Placed":
        """Return empty tables for so many solids."""
        return cls(
            solid=np.empty(count, dtype=np.int64),
            centre_C=np.empty((count, 3)),
            axes_C=np.empty((count, 3, 3)),
            rows=np.empty((count, 3), dtype=np.int64),
            runs=np.empty((count * most_rows, 2), dtype=np.int64),
        )


@njit(cache=True)
def place(
    kinds: NDArray[np.int64],
    half_sizes: Array,
    poses: Poses,
    camera: Frame,
    x: Array,
    y: Array,
    near: float,
    out: Placed,
) -> int:
    """Fill `out` with the solids that can be seen; return how many.

    Args:
        kinds: (n,) as of `solids`.
        half_sizes: (n, 3) as of `solids` [m].
        poses: of the solids.
        camera: its pose.
        x: (columns,) evenly spaced tangents to the right of the axis.
        y: (rows,) evenly spaced tangents below it.
        near: depth of the near plane [m].
        out: with room for n solids and as many rows.
    """
    geoms, xpos, xmat = poses
    corners, points, sides = np.empty((8, 3)), np.empty((_MOST_POINTS, 2)), np.empty((2, y.shape[0]))
    rows, columns, count, used = even(y), even(x), 0, 0
    for g in range(kinds.shape[0]):
        h, c, M = half_sizes[g], out.centre_C[count], out.axes_C[count]
        length = h[2] + h[0] if kinds[g] == CAPSULE else h[2]
        _into_camera(camera, xpos[geoms[g]], c)
        if _is_beside(c, math.sqrt(h[0] * h[0] + h[1] * h[1] + length * length) * _ROUNDING, x, y, near):
            continue
        _turn_into_camera(camera[0], xmat[geoms[g]], M)
        behind = _corners_of_box(corners, c, M, h, length, near)
        row, stop = _outline(sides, points, corners, behind, _fronts(c, M, h, length), y, rows, near)
        if row == stop:
            continue
        out.solid[count], out.rows[count, 0], out.rows[count, 1], out.rows[count, 2] = g, row, stop, used
        for i in range(row, stop):
            out.runs[used, 0], out.runs[used, 1] = _between(sides[0, i], sides[1, i], columns)
            used += 1
        count += 1
    return count


@njit(cache=True)
def _into_camera(camera: Frame, p_W: Array, c: Array) -> None:
    R, lens = camera
    a, b, e = p_W[0] - lens[0], p_W[1] - lens[1], p_W[2] - lens[2]
    for k in range(3):
        c[k] = R[0, k] * a + R[1, k] * b + R[2, k] * e


@njit(cache=True)
def _turn_into_camera(R: Array, turn: Array, M: Array) -> None:
    for k in range(3):
        for axis in range(3):
            M[k, axis] = R[0, k] * turn[axis] + R[1, k] * turn[3 + axis] + R[2, k] * turn[6 + axis]


@njit(cache=True)
def _is_beside(c: Array, radius: float, x: Array, y: Array, near: float) -> bool:
    """Whether no block's ray meets a sphere before the near plane."""
    if c[0] + radius < near:
        return True
    for axis in (1, 2):
        tangents = x if axis == 1 else y
        low, high = tangents[0], tangents[-1]
        if -c[axis] - high * c[0] > radius * math.sqrt(1.0 + high * high):
            return True
        if low * c[0] + c[axis] > radius * math.sqrt(1.0 + low * low):
            return True
    return False


@njit(cache=True)
def _corners_of_box(corners: Array, c: Array, M: Array, h: Array, length: float, near: float) -> int:
    """Fill (8, 3) corners in C, number k having bit 0, 1, 2 set on its far sides; return how many lie behind `near`."""
    behind = 0
    for k in range(8):
        a, b, e = h[0] * (2 * (k & 1) - 1), h[1] * ((k & 2) - 1), length * ((k & 4) / 2 - 1)
        for axis in range(3):
            corners[k, axis] = c[axis] + M[axis, 0] * a + M[axis, 1] * b + M[axis, 2] * e
        behind += corners[k, 0] < near
    return behind


@njit(cache=True)
def _fronts(c: Array, M: Array, h: Array, length: float) -> int:
    """Which of a box's faces show their front: bit 2 k for the negative side across axis k, 2 k + 1 for the other."""
    fronts = 0
    for k in range(3):
        lens, half = -(c[0] * M[0, k] + c[1] * M[1, k] + c[2] * M[2, k]), length if k == 2 else h[k]
        fronts |= (lens < -half) << (2 * k) | (lens > half) << (2 * k + 1)
    return fronts


@njit(cache=True)
def _outline(
    sides: Array, points: Array, corners: Array, behind: int, fronts: int, y: Array, rows: Even, near: float
) -> tuple[int, int]:
    """Fill the leftmost and rightmost tangent of a box's picture in each row (2, rows); return the range of rows.

    An edge is on the outline where one of its two faces shows its front and the other does not. Of a box that reaches
    behind the near plane all points of the part before it are joined, pair by pair.
    """
    count = _points(points, corners, behind, near)
    low, high = math.inf, -math.inf
    for k in range(count):
        low, high = min(low, points[k, 1]), max(high, points[k, 1])
    row, stop = _between(low, high, rows)
    sides[0, row:stop], sides[1, row:stop] = math.inf, -math.inf
    if behind > 0:
        for a in range(count):
            for b in range(a):
                _mark(sides, _pair(points, a), _pair(points, b), y, rows)
        return row, stop
    for a in range(8):
        for axis in range(3):
            one, other = (axis + 1) % 3, (axis + 2) % 3
            faces = (fronts >> (2 * one + (a >> one & 1))) ^ (fronts >> (2 * other + (a >> other & 1)))
            if (a >> axis & 1) == 0 and (faces & 1) == 1:
                _mark(sides, _pair(points, a), _pair(points, a | 1 << axis), y, rows)
    return row, stop


@njit(cache=True)
def _points(points: Array, corners: Array, behind: int, near: float) -> int:
    """Fill (m, 2) tangents of a box's corners before the near plane, and of its edges' cuts with it; return m."""
    count = 0
    for k in range(8):
        if corners[k, 0] >= near:
            points[count, 0], points[count, 1] = -corners[k, 1] / corners[k, 0], -corners[k, 2] / corners[k, 0]
            count += 1
    if behind == 0:
        return count
    for a in range(8):
        for bit in (1, 2, 4):
            b = a | bit
            if (corners[a, 0] < near) != (corners[b, 0] < near):
                part = (near - corners[a, 0]) / (corners[b, 0] - corners[a, 0])
                for axis in range(2):
                    cut = corners[a, axis + 1] + part * (corners[b, axis + 1] - corners[a, axis + 1])
                    points[count, axis] = -cut / near
                count += 1
    return count


@njit(cache=True)
def _pair(points: Array, k: int) -> Point:
    """Numbers, as counting references to a part of an array takes its time."""
    return points[k, 0], points[k, 1]


@njit(cache=True)
def _mark(sides: Array, a: Point, b: Point, y: Array, rows: Even) -> None:
    """Widen the rows that an edge crosses, and one more at either end."""
    left, right = min(a[0], b[0]), max(a[0], b[0])
    row, stop = _between(min(a[1], b[1]), max(a[1], b[1]), rows)
    if a[1] == b[1]:
        for i in range(row, stop):
            sides[0, i], sides[1, i] = min(sides[0, i], left), max(sides[1, i], right)
        return
    slope = (b[0] - a[0]) / (b[1] - a[1])
    for i in range(row, stop):
        k = np.uint64(i)  # unsigned: spares the test for indices that count from the end
        at = min(max(a[0] + (y[k] - a[1]) * slope, left), right)
        sides[0, k], sides[1, k] = min(sides[0, k], at), max(sides[1, k], at)


@njit(cache=True)
def even(tangents: Array) -> Even:
    """What evenly spaced tangents are counted by."""
    n = tangents.shape[0]
    return tangents[0], (n - 1) / (tangents[-1] - tangents[0]) if n > 1 else 1.0, n


@njit(cache=True)
def _between(low: float, high: float, tangents: Even) -> tuple[int, int]:
    """Range of the evenly spaced tangents in [low, high], one more on each side."""
    first, per_tangent, n = tangents
    start, stop = (low - first) * per_tangent, (high - first) * per_tangent
    if not (low <= high) or stop < -2.0 or start > n + 2.0:
        return 0, 0
    return max(0, math.floor(max(start, 0.0)) - 1), min(n, math.ceil(min(stop, n + 0.0)) + 2)
