"""Draws triangle meshes by intersecting rays with them: the part of `traced` that is no primitive.

In camera axes C a block's ray is d = (1, -x, -y). With the corners a, b, c of a triangle seen counter-clockwise, and
the lens as origin, d goes through its inside where the three

    e_a = (c x b).d,   e_b = (a x c).d,   e_c = (b x a).d                                                         (1)

are not negative; then its depth and the radiance there, from that of the corners, are

    t = -a.(b x c)/(e_a + e_b + e_c),      L = (e_a L_a + e_b L_b + e_c L_c)/(e_a + e_b + e_c)                    (2)

All are linear in x along a row, so nothing has to be clipped at the near plane. Two triangles share e on their common
edge but for the sign, to the bit: no ray slips through. Triangles that show their back are not seen. What a block
shows depends on its own ray alone. Corners and their light are `mesh_view`.

Not modelled: more than one ray a block; else see `solids`.
Source: Olano & Greer 1997 (triangle scan conversion using 2D homogeneous coordinates).
"""

import math

import numpy as np
from numpy.typing import NDArray

from dockair.kernels import njit
from dockair.rotations import Array
from dockair.sim.camera.mesh_view import MeshView
from dockair.sim.camera.meshes import Meshes
from dockair.sim.camera.spans import Even, even
from dockair.triples import Vector, cross

_F = np.float32
_ZERO, _ONE = _F(0.0), _F(1.0)
_SLACK = 0.01  # blocks by which a triangle's rows and columns may be off: far more than rounding
_LANES = 16  # rays that are taken at once

Row = NDArray[np.float32]
Side = tuple[float, float, float, float]
Line = tuple[np.float32, np.float32]  # value at x = 0 and slope; or volume and near plane


@njit(cache=True)
def trace_meshes(
    out: NDArray[np.float32],
    nearest: NDArray[np.float32],
    reach: NDArray[np.int64],
    meshes: Meshes,
    view: MeshView,
    count: int,
    x: Array,
    y: Array,
    near: float,
) -> None:
    """Draw the first `count` triangles of a view over a picture, without haze.

    Args:
        out: (rows, columns) relative radiance, written.
        nearest: (rows, columns) depths so far, written.
        reach: (rows, 2) first column that may have been drawn and one past the last, widened.
        meshes: of the model.
        view: of them.
        count: of the triangles in it.
        x: (columns,) evenly spaced tangents to the right of the axis, of the blocks' centres.
        y: (rows,) evenly spaced tangents below it.
        near: depth of the near plane.
    """
    tangents, columns, rows = x.astype(np.float32), even(x), even(y)
    triangles, places, lit = meshes.triangles, view.places, view.radiances
    for k in range(count):
        t = view.triangles[k]
        a, b, c = triangles[t, 0], triangles[t, 1], triangles[t, 2]
        depths, t_x = (places[a, 0], places[b, 0], places[c, 0]), (places[a, 3], places[b, 3], places[c, 3])
        is_cut, t_y = min(depths) < near, (places[a, 4], places[b, 4], places[c, 4])
        if max(depths) < near or (not is_cut and (_is_missed(t_x, columns) or _is_missed(t_y, rows))):
            continue
        _draw_triangle((a, b, c), is_cut, places, lit, out, nearest, reach, tangents, columns, rows, y, near)


@njit(cache=True)
def _mixed(e: tuple[Vector, Vector, Vector], a: float, b: float, c: float) -> Vector:
    """Sum of a e_a, b e_b and c e_c."""
    p, q, r = e
    return a * p[0] + b * q[0] + c * r[0], a * p[1] + b * q[1] + c * r[1], a * p[2] + b * q[2] + c * r[2]


@njit(cache=True)
def _draw_triangle(
    corners: tuple[int, int, int],
    is_cut: bool,
    places: Array,
    lit: Array,
    out: NDArray[np.float32],
    nearest: NDArray[np.float32],
    reach: NDArray[np.int64],
    tangents: Row,
    x: Even,
    y: Even,
    heights: Array,
    near: float,
) -> None:
    i, j, k = corners
    a, b, c = _place(places, i), _place(places, j), _place(places, k)
    e = cross(c, b), cross(a, c), cross(b, a)
    volume = a[0] * e[0][0] + a[1] * e[0][1] + a[2] * e[0][2]  # -a.(b x c)
    if not volume > 0.0:
        return
    t_y = (places[i, 4], places[j, 4], places[k, 4])
    low, high = _clipped(a, b, c, near) if is_cut else (min(t_y), max(t_y))
    row, stop = _within((low - y[0]) * y[1], (high - y[0]) * y[1], y[2])
    total, bright = _mixed(e, 1.0, 1.0, 1.0), _mixed(e, lit[i], lit[j], lit[k])
    sides = _side(e[0], x), _side(e[1], x), _side(e[2], x)
    limits = _F(volume), _F(near)
    for line in range(row, stop):
        at = heights[line]
        left, right = _within(
            max(sides[0][0] + at * sides[0][1], sides[1][0] + at * sides[1][1], sides[2][0] + at * sides[2][1]),
            min(sides[0][2] + at * sides[0][3], sides[1][2] + at * sides[1][3], sides[2][2] + at * sides[2][3]),
            x[2],
        )
        if left >= right:
            continue
        lines = _line(e[0], at), _line(e[1], at), _line(e[2], at), _line(total, at), _line(bright, at)
        where = np.uint64(line), np.uint64(left), np.uint64(right)
        reach[line, 0] = min(reach[line, 0], left - _LANES)  # a lot is taken whole
        reach[line, 1] = max(reach[line, 1], right + _LANES)
        if x[2] < _LANES:
            _draw_narrow(lines, limits, tangents, out, nearest, where)
        else:
            _draw_row(lines, limits, tangents, out, nearest, where)


@njit(cache=True)
def _place(places: Array, i: int) -> Vector:
    return places[i, 0], places[i, 1], places[i, 2]


@njit(cache=True)
def _is_missed(corners: Vector, tangents: Even) -> bool:
    """Whether the tangents of a triangle's corners lie beside all blocks or between two."""
    low, high = (min(corners) - tangents[0]) * tangents[1], (max(corners) - tangents[0]) * tangents[1]
    return math.ceil(max(low - _SLACK, 0.0)) > min(high + _SLACK, tangents[2] - 1.0)


@njit(cache=True)
def _clipped(a: Vector, b: Vector, c: Vector, near: float) -> tuple[float, float]:
    """Range of y of what of a triangle is ahead of the near plane."""
    low, high = math.inf, -math.inf
    for p, q in ((a, b), (b, c), (c, a)):
        if p[0] >= near:
            low, high = min(low, -p[2] / p[0]), max(high, -p[2] / p[0])
        if (p[0] >= near) != (q[0] >= near):
            at = -(p[2] + (near - p[0]) / (q[0] - p[0]) * (q[2] - p[2])) / near
            low, high = min(low, at), max(high, at)
    return low, high


@njit(cache=True)
def _within(low: float, high: float, n: int) -> tuple[int, int]:
    """Range of the blocks, of n, from `low` to `high`."""
    if not (low <= high + 2.0 * _SLACK) or high < -_SLACK or low > n - 1 + _SLACK:
        return 0, 0
    return int(math.ceil(max(low - _SLACK, 0.0))), int(min(high + _SLACK, n - 1.0)) + 1


@njit(cache=True)
def _side(edge: Vector, x: Even) -> Side:
    """Where e is not negative: column >= 1st + 2nd y, <= 3rd + 4th y; an edge along the row is left to Eq. (1)."""
    if edge[1] == 0.0:
        return -math.inf, 0.0, math.inf, 0.0
    at, slope = (edge[0] / edge[1] - x[0]) * x[1], -edge[2] / edge[1] * x[1]
    return (at, slope, math.inf, 0.0) if edge[1] < 0.0 else (-math.inf, 0.0, at, slope)


@njit(cache=True)
def _line(e: Vector, y: float) -> Line:
    return _F(e[0] - y * e[2]), _F(-e[1])


@njit(cache=True, error_model="numpy")
def _draw_row(
    lines: tuple[Line, Line, Line, Line, Line],
    limits: Line,
    x: Row,
    out: NDArray[np.float32],
    nearest: NDArray[np.float32],
    where: tuple[np.uint64, np.uint64, np.uint64],
) -> None:
    """Eqs. (1) and (2) of some blocks of a row, in lots whose size the compiler knows; twice is as once."""
    row, left, right = where
    last = np.uint64(x.shape[0] - _LANES)
    for lot in range((right - left + np.uint64(_LANES - 1)) // np.uint64(_LANES)):
        first = min(left + np.uint64(lot) * np.uint64(_LANES), last)
        for k in range(_LANES):
            j = first + np.uint64(k)
            out[row, j], nearest[row, j] = _lay_over(lines, limits, x[j], out[row, j], nearest[row, j])


@njit(cache=True, error_model="numpy")
def _draw_narrow(
    lines: tuple[Line, Line, Line, Line, Line],
    limits: Line,
    x: Row,
    out: NDArray[np.float32],
    nearest: NDArray[np.float32],
    where: tuple[np.uint64, np.uint64, np.uint64],
) -> None:
    """The same in a picture narrower than a lot."""
    row, left, right = where
    for k in range(right - left):
        j = left + np.uint64(k)
        out[row, j], nearest[row, j] = _lay_over(lines, limits, x[j], out[row, j], nearest[row, j])


@njit(cache=True, error_model="numpy")
def _lay_over(
    lines: tuple[Line, Line, Line, Line, Line], limits: Line, x: np.float32, behind: np.float32, nearest: np.float32
) -> tuple[np.float32, np.float32]:
    """Radiance and depth of a triangle where it is nearest so far, else of what is behind it; without branches."""
    (e_a, e_b, e_c, total, bright), (volume, near) = lines, limits
    a, b, c = e_a[0] + x * e_a[1], e_b[0] + x * e_b[1], e_c[0] + x * e_c[1]
    inverse = _ONE / (total[0] + x * total[1])
    t, radiance = volume * inverse, (bright[0] + x * bright[1]) * inverse
    seen = (min(a, b, c) >= _ZERO) & (t >= near) & (t < nearest)
    return radiance if seen else behind, t if seen else nearest
