"""A function of direction, tabulated where it is looked at: the sky, read for every block of every frame.

Between the nodes of the sphere unfolded onto a square [octahedron] the value is bilinear. Tiles of nodes are computed
when a picture first needs them, and their values do not depend on when.

A function that is smooth over some milliradians is read where the tangents x and y are whole multiples of 1/256 and
1/512 alone, and bilinear in between.

A block's value is a function of R and its own x and y alone.
"""

import math
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from dockair.kernels import njit
from dockair.rotations import Array
from dockair.sim.camera.octahedron import STEEPEST, directions_from_nodes, mark_missing

_TILE = 64  # nodes a side
_ROWS_HELD = 3  # of places, of which the first is read when the last is known
_NODES_TOUCHED = 14  # blocks that surely are no farther apart than the 16 nodes of a line of cache
_PER_X, _PER_Y = 256.0, 512.0  # where a smooth function is read: powers of 2, so that these places are exact


class DirectionTable:
    """Values (n, n) at the nodes; row 0 up, column 0 left, straight ahead in the middle."""

    def __init__(self, function: Callable[[Array], Array], tiles: int, smooth: bool = False) -> None:
        """Set up an empty table.

        Args:
            function: (m, 3) unit vectors, W axes -> (m,) values.
            tiles: a side, each of 64 x 64 nodes.
            smooth: whether the function is smooth over 1/256 rad: then `fill` takes a fraction of the work.
        """
        self._function, self._tiles, self._is_smooth = function, tiles, smooth
        self._values: NDArray[np.float32] = np.zeros((tiles * _TILE, tiles * _TILE), dtype=np.float32)
        self._is_known, self._is_missing = np.zeros((2, tiles, tiles), dtype=np.bool_)

    def fill(self, out: NDArray[np.float32], R_WC: Array, x: Array, y: Array) -> None:
        """Write the value toward (1, -x_j, -y_i), C axes, into out (rows, columns); x and y are evenly spaced."""
        if not self._is_smooth:
            self._read(out, R_WC, x, y)
            return
        first_x, columns = _places_around(x, _PER_X)
        first_y, rows = _places_around(y, _PER_Y)
        few = np.empty((len(rows), len(columns)), dtype=np.float32)
        self._read(few, R_WC, columns, rows)
        _spread(few, first_x, first_y, np.asarray(x, dtype=float), np.asarray(y, dtype=float), out)

    def _read(self, out: NDArray[np.float32], R_WC: Array, x: Array, y: Array) -> None:
        """Bilinear between the nodes, which are made where they lack."""
        step = max(_step(x), _step(y), 1e-9)
        cells = self._values.shape[0] - 2  # even, so that the middle is a node; the last row and column serve nothing
        stride = max(1, int((_TILE - 1) / (0.5 * cells * STEEPEST * step)))
        R, columns = np.ascontiguousarray(R_WC, dtype=float), np.asarray(x, dtype=np.float32)
        rows = np.asarray(y, dtype=float)
        if _mark(R, columns, rows, stride, cells, self._is_known, self._is_missing):
            for row, column in np.argwhere(self._is_missing):
                self._compute(int(row), int(column))
            self._is_missing[:] = False
        _sample(self._values.ravel(), cells + 2, R, columns, rows, out)

    def _compute(self, row: int, column: int) -> None:
        """Tabulate a tile."""
        i, j = np.meshgrid(np.arange(_TILE) + row * _TILE, np.arange(_TILE) + column * _TILE, indexing="ij")
        values = self._function(directions_from_nodes(i.ravel(), j.ravel(), self._values.shape[0]))
        place = slice(row * _TILE, (row + 1) * _TILE), slice(column * _TILE, (column + 1) * _TILE)
        self._values[place] = values.reshape(_TILE, _TILE)
        self._is_known[row, column] = True


def _step(x: Array) -> float:
    return abs(float(x[-1] - x[0])) / (len(x) - 1) if len(x) > 1 else 0.0


@njit(cache=True)
def _places_around(x: Array, per_tangent: float) -> tuple[int, Array]:
    """Number of the first of the even places that evenly spaced tangents lie between, and all of them."""
    low, high = min(x[0], x[-1]), max(x[0], x[-1])
    first, last = math.floor(low * per_tangent), math.floor(high * per_tangent) + 1
    return first, np.arange(first, last + 1) / per_tangent


@njit(cache=True)
def _spread(few: NDArray[np.float32], first_x: int, first_y: int, x: Array, y: Array, out: NDArray[np.float32]) -> None:
    """Interpolate between values at even places: those of a row of them along x once, then along y."""
    n, held = len(x), -1
    before, part, lines = np.empty(n, np.uint32), np.empty(n, np.float32), np.empty((2, n), np.float32)
    for j in range(n):
        whole = math.floor(x[j] * _PER_X)
        before[j], part[j] = whole - first_x, x[j] * _PER_X - whole
    for i in range(len(y)):
        whole = math.floor(y[i] * _PER_Y)
        at, down, row = int(whole) - first_y, np.float32(y[i] * _PER_Y - whole), out[i]
        if at != held:
            for node in range(at, at + 2):
                if node == held + 1 and held >= 0:
                    continue
                nodes, line = few[node], lines[node % 2]
                for j in range(n):
                    k = before[j]
                    line[j] = nodes[k] + part[j] * (nodes[k + np.uint32(1)] - nodes[k])
            held = at
        a, b = lines[at % 2], lines[(at + 1) % 2]
        for j in range(n):
            row[j] = a[j] + down * (b[j] - a[j])


@njit(cache=True, error_model="numpy")
def _node(x: np.float32, y: np.float32, z: np.float32, half: np.float32) -> tuple[np.float32, np.float32]:
    """Fractional row and column of a direction of any length, [octahedron, eq 1]; half is that of straight ahead."""
    zero = np.float32(0.0)
    scale = half / (abs(x) + abs(y) + abs(z))
    p_y, p_z = y * scale, z * scale
    q_y, q_z = half - abs(p_z), half - abs(p_y)
    q_y, q_z = (q_y if p_y >= zero else -q_y), (q_z if p_z >= zero else -q_z)
    return half - (q_z if x < zero else p_z), half - (q_y if x < zero else p_y)


@njit(cache=True, error_model="numpy")
def _sample(
    values: NDArray[np.float32], n: int, R: Array, x: NDArray[np.float32], y: Array, out: NDArray[np.float32]
) -> None:
    """Bilinear values toward (1, -x_j, -y_i) from (n n,) nodes; float32, the same sums wherever an array begins.

    A row's places are worked out, and its nodes asked for, some rows before its values: memory takes its time.
    """
    corner = np.empty((_ROWS_HELD, len(x)), dtype=np.int32)
    down, right = np.empty(corner.shape, dtype=np.float32), np.empty(corner.shape, dtype=np.float32)
    for i in range(len(y) + _ROWS_HELD - 1):
        if i < len(y):
            here = i % _ROWS_HELD
            _place(R, x, y[i], n, corner[here], down[here], right[here])
            out[i, 0] = _ask(values, corner[here], n)
        if i >= _ROWS_HELD - 1:
            here = (i + 1) % _ROWS_HELD
            _read(values, n, corner[here], down[here], right[here], out[i + 1 - _ROWS_HELD])


@njit(cache=True, error_model="numpy")
def _place(
    R: Array,
    x: NDArray[np.float32],
    y_i: float,
    n: int,
    corner: NDArray[np.int32],
    down: NDArray[np.float32],
    right: NDArray[np.float32],
) -> None:
    """Fill, for a row of blocks, the node before each and the parts of the way to the next ones."""
    last, width, half = np.int32(n - 3), np.int32(n), np.float32(0.5 * (n - 2))
    a_x, b_x = np.float32(R[0, 0] - y_i * R[0, 2]), np.float32(R[0, 1])
    a_y, b_y = np.float32(R[1, 0] - y_i * R[1, 2]), np.float32(R[1, 1])
    a_z, b_z = np.float32(R[2, 0] - y_i * R[2, 2]), np.float32(R[2, 1])
    for j in range(len(x)):
        v, u = _node(a_x - x[j] * b_x, a_y - x[j] * b_y, a_z - x[j] * b_z, half)
        row, column = max(min(np.int32(v), last), np.int32(0)), max(min(np.int32(u), last), np.int32(0))
        corner[j] = row * width + column
        down[j], right[j] = v - np.float32(row), u - np.float32(column)


@njit(cache=True)
def _ask(values: NDArray[np.float32], corner: NDArray[np.int32], n: int) -> np.float32:
    """Touch the memory of the nodes below a row of blocks; those above it were the last row's."""
    total = np.float32(0.0)
    for j in range(0, len(corner), _NODES_TOUCHED):
        total += values[np.uint32(corner[j]) + np.uint32(n)]
    return total


@njit(cache=True)
def _read(
    values: NDArray[np.float32],
    n: int,
    corner: NDArray[np.int32],
    down: NDArray[np.float32],
    right: NDArray[np.float32],
    out: NDArray[np.float32],
) -> None:
    for j in range(len(out)):
        k = np.uint32(corner[j])
        below = k + np.uint32(n)
        a = values[k] + right[j] * (values[k + np.uint32(1)] - values[k])
        b = values[below] + right[j] * (values[below + np.uint32(1)] - values[below])
        out[j] = a + down[j] * (b - a)


@njit(cache=True)
def _mark(
    R: Array,
    x: NDArray[np.float32],
    y: Array,
    stride: int,
    cells: int,
    known: NDArray[np.bool_],
    missing: NDArray[np.bool_],
) -> bool:
    """Mark what is not known of the tiles of every stride-th block and their neighbours; say whether that is any.

    No block in between lies farther than a tile.
    """
    any_missing = False
    last = -1, -1
    half = np.float32(0.5 * cells)
    for i in range(0, len(y) + stride - 1, stride):
        y_i = y[min(i, len(y) - 1)]
        for j in range(0, len(x) + stride - 1, stride):
            x_j = x[min(j, len(x) - 1)]
            v, u = _node(
                np.float32(R[0, 0] - y_i * R[0, 2] - x_j * R[0, 1]),
                np.float32(R[1, 0] - y_i * R[1, 2] - x_j * R[1, 1]),
                np.float32(R[2, 0] - y_i * R[2, 2] - x_j * R[2, 1]),
                half,
            )
            row, column = int(v) // _TILE, int(u) // _TILE
            if (row, column) == last:
                continue
            last = row, column
            any_missing = mark_missing(row, column, known, missing) or any_missing
    return any_missing
