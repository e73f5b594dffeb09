"""The picture behind the LEDs in blocks of k x k pixels, and its way from blocks to pixels.

Block (i, j) has its centre at row k (i + 1/2) - 1/2 and column k (j + 1/2) - 1/2 of the sensor. From the blocks'
radiances L, with the lens's fall-off and bilinear between the centres, a pixel gets

    e(u, v) = e_white [L cos^4 t](u, v) dirt(u, v) + stray(u, v)                                                 (1)

Through a lens that distorts, block (i, j) sees along the ray that the inverse of [calibration, eq 1] gives. Then the
scene is drawn for a pinhole, on blocks of the same size around the same axis, and each block of the sensor takes the
pinhole's radiance where its ray falls, bilinear again. Where the distortion moves nothing by more than half a block
that step is left out.

Every block and pixel is a function of its place on the sensor: tables hold the whole sensor, a window takes its part.
Not modelled: vignetting beyond cos^4, blur by the lens.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import RectBivariateSpline

from dockair.calibration import Camera
from dockair.kernels import njit
from dockair.messages import Window
from dockair.rotations import Array
from dockair.sim.camera.coarse_grid import CoarseGrid

_KNOTS = 16  # blocks between the rays from which a spline makes the others

#: For each pixel along a row or column: the node before it, and the part of the way to the next.
Line = tuple[NDArray[np.int64], NDArray[np.float32]]
Layer = tuple[NDArray[np.float32], Line, Line, tuple[int, int], int]  # nodes, rows, columns, first node, spacing [px]
_NO_LINE: Line = (np.empty(0, dtype=np.int64), np.empty(0, dtype=np.float32))
_NOTHING: Layer = (np.empty((0, 0), dtype=np.float32), _NO_LINE, _NO_LINE, (0, 0), 0)
#: The whole sensor's, and its row and column of the scene's first node: rows of a part of it would not be known to be
#: contiguous, and so be worked on one number at a time.
FallOff = tuple[NDArray[np.float32], int, int]
_ALIKE: FallOff = (np.empty((0, 0), dtype=np.float32), 0, 0)  # none


@dataclass(frozen=True, slots=True)
class Extent:
    """Blocks [row_start, row_stop) and [column_start, column_stop)."""

    row_start: int
    row_stop: int
    column_start: int
    column_stop: int

    @property
    def shape(self) -> tuple[int, int]:
        """(rows, columns)."""
        return self.row_stop - self.row_start, self.column_stop - self.column_start


class Blocks:
    """The blocks of one camera.

    Args:
        camera: as built.
        k: side of a block [px].
    """

    def __init__(self, camera: Camera, k: int) -> None:
        self._camera, self._k = camera, k
        self._lines = tuple(_line(0, size, 2 * k, 1 - k) for size in (camera.height_px, camera.width_px))
        self.whole = self.around(camera.full_window)
        f, k_f = camera.focal_length_px, k / camera.focal_length_px
        self._first = (0.5 * k - 0.5 - np.array(camera.principal_point_px)) / f, k_f
        x, y = self._tangents(self.whole)
        a, b = np.meshgrid(x, y)
        self._places: tuple[NDArray[np.float32], NDArray[np.float32]] | None = None
        self.drawn = self.whole
        if camera.distortion is not None:
            a, b = self._undistorted()
            rows, columns = (b - self._first[0][1]) / k_f, (a - self._first[0][0]) / k_f
            moved = max(np.abs(columns - (x - self._first[0][0]) / k_f).max(),
                        np.abs(rows - (y[:, None] - self._first[0][1]) / k_f).max())  # fmt: skip
            if moved > 0.5:
                self._places = rows.astype(np.float32), columns.astype(np.float32)
                self.drawn = self.drawn_for(self.whole)
            else:
                a, b = np.meshgrid(x, y)
        self._drawn_tangents = self._tangents(self.drawn)
        self._fall_off = (1.0 / (1.0 + a**2 + b**2) ** 2).astype(np.float32)

    def around(self, window: Window) -> Extent:
        """Blocks that the pixels of a window are interpolated from."""
        k = self._k
        return Extent(
            (2 * window.row_start + 1 - k) // (2 * k),
            (2 * window.row_stop - 1 - k) // (2 * k) + 2,
            (2 * window.column_start + 1 - k) // (2 * k),
            (2 * window.column_stop - 1 - k) // (2 * k) + 2,
        )

    def drawn_for(self, extent: Extent) -> Extent:
        """Blocks of the pinhole's picture that blocks of the sensor are taken from."""
        if self._places is None:
            return extent
        if extent == self.whole and self.drawn != self.whole:
            return self.drawn
        rows, columns = (self._part(place, extent) for place in self._places)
        return Extent(
            int(np.floor(rows.min())),
            int(np.floor(rows.max())) + 2,
            int(np.floor(columns.min())),
            int(np.floor(columns.max())) + 2,
        )

    def tangents(self, extent: Extent) -> tuple[Array, Array]:
        """Tangents x (columns,) to the right and y (rows,) below the axis, of some of the pinhole's blocks."""
        (x, y), drawn = self._drawn_tangents, self.drawn
        return (
            x[extent.column_start - drawn.column_start : extent.column_stop - drawn.column_start],
            y[extent.row_start - drawn.row_start : extent.row_stop - drawn.row_start],
        )

    def to_sensor(self, picture: NDArray[np.float32], drawn: Extent, extent: Extent) -> NDArray[np.float32]:
        """Take the sensor's blocks from the pinhole's."""
        if self._places is None:
            return picture
        out = np.empty(extent.shape, dtype=np.float32)
        rows, columns = (self._part(place, extent) for place in self._places)
        _take(picture, drawn.row_start, drawn.column_start, rows, columns, out)
        return out

    def to_pixels(
        self,
        picture: NDArray[np.float32],
        extent: Extent,
        window: Window,
        white_e: float,
        stray: CoarseGrid | None,
        dirt: CoarseGrid | None,
        out: NDArray[np.float32] | None = None,
    ) -> NDArray[np.float32]:
        """Return (rows, columns) expected electrons of the window, Eq. (1).

        Args:
            picture: radiances of the sensor's blocks.
            extent: which those are.
            window: what is wanted.
            white_e: electrons of radiance 1 on the axis.
            stray: electrons added; None for none.
            dirt: factor on the picture; None for 1.
            out: (rows, columns) that takes them; a new array by default.
        """
        rows = _cut(self._lines[0], window.row_start, window.row_stop)
        columns = _cut(self._lines[1], window.column_start, window.column_stop)
        scene = picture, rows, columns, (extent.row_start, extent.column_start), self._k
        down, right = extent.row_start - self.whole.row_start, extent.column_start - self.whole.column_start
        fall_off = self._fall_off, down, right
        out = np.empty(window.shape, dtype=np.float32) if out is None else out
        _to_pixels(out, scene, fall_off, np.float32(white_e), _layer(stray, window), _layer(dirt, window))
        return out

    def _tangents(self, extent: Extent) -> tuple[Array, Array]:
        (x, y), step = self._first
        columns = np.arange(extent.column_start, extent.column_stop)
        return x + step * columns, y + step * np.arange(extent.row_start, extent.row_stop)

    def _part(self, table: NDArray[np.float32], extent: Extent) -> NDArray[np.float32]:
        i, j = extent.row_start - self.whole.row_start, extent.column_start - self.whole.column_start
        rows, columns = extent.shape
        return table[i : i + rows, j : j + columns]

    def _undistorted(self) -> tuple[Array, Array]:
        """Tangents of the rays of all blocks, (rows, columns) each."""
        k, camera = self._k, self._camera
        rows = np.arange(self.whole.row_start, self.whole.row_stop)
        columns = np.arange(self.whole.column_start, self.whole.column_stop)
        few = [np.linspace(line[0], line[-1], max(4, len(line) // _KNOTS)) for line in (rows, columns)]
        v, u = np.meshgrid(*(k * (line + 0.5) - 0.5 for line in few), indexing="ij")
        rays = camera.rays_from_pixels(np.column_stack([u.ravel(), v.ravel()]))
        x, y = (-(rays[:, axis] / rays[:, 0]).reshape(u.shape) for axis in (1, 2))
        return RectBivariateSpline(*few, x)(rows, columns), RectBivariateSpline(*few, y)(rows, columns)


def _line(start: int, stop: int, unit: int, shift: int) -> Line:
    """For pixels n in [start, stop): floor and remainder of (2 n + shift) / unit."""
    twice = 2 * np.arange(start, stop) + shift
    return twice // unit, ((twice % unit) / unit).astype(np.float32)


def _cut(line: Line, start: int, stop: int) -> Line:
    return line[0][start:stop], line[1][start:stop]


def _layer(grid: CoarseGrid | None, window: Window) -> Layer:
    """Nodes of a grid, and where each row and column of a window lies among them."""
    if grid is None:
        return _NOTHING
    unit = 2 * grid.spacing_px
    rows = _line(window.row_start, window.row_stop, unit, 0)
    columns = _line(window.column_start, window.column_stop, unit, 0)
    for line, first, nodes in zip((rows, columns), grid.first, grid.values.shape, strict=True):
        if line[0][0] < first or line[0][-1] + 2 > first + nodes:
            raise ValueError(f"a grid of {grid.values.shape} nodes from {grid.first} does not hold {window}")
    return grid.values, rows, columns, grid.first, grid.spacing_px


@njit(cache=True)
def _take(
    picture: NDArray[np.float32],
    row_start: int,
    column_start: int,
    rows: NDArray[np.float32],
    columns: NDArray[np.float32],
    out: NDArray[np.float32],
) -> None:
    """Sample a picture at places given in its sensor-wide block numbers."""
    for r in range(out.shape[0]):
        for c in range(out.shape[1]):
            i, j = int(np.floor(rows[r, c])), int(np.floor(columns[r, c]))
            down, right = rows[r, c] - np.float32(i), columns[r, c] - np.float32(j)
            i, j = i - row_start, j - column_start
            a = picture[i, j] + right * (picture[i, j + 1] - picture[i, j])
            b = picture[i + 1, j] + right * (picture[i + 1, j + 1] - picture[i + 1, j])
            out[r, c] = a + down * (b - a)


@njit(cache=True)
def _to_pixels(
    out: NDArray[np.float32],
    scene: Layer,
    fall_off: FallOff,
    white_e: np.float32,
    stray: Layer,
    dirt: Layer,
) -> None:
    """Fill the window, Eq. (1); a layer without nodes is left out."""
    width = max(out.shape[1], scene[0].shape[1])
    lines = np.empty((9, width), dtype=np.float32)  # of each layer the nodes' rows around the pixels', and one more
    at, above, below = -2, -2, -2
    for r in range(out.shape[0]):
        i = scene[1][0][r] - scene[3][0]
        if i != at:
            _spread_rows(scene, fall_off, white_e, at, i, lines[:3])
            at = i
        a, b, down = i % 2, (i + 1) % 2, scene[1][1][r]
        for c in range(out.shape[1]):
            out[r, c] = lines[a, c] + down * (lines[b, c] - lines[a, c])
        if dirt[0].size > 0:
            i = dirt[1][0][r] - dirt[3][0]
            if i != below:
                _spread_rows(dirt, _ALIKE, white_e, below, i, lines[6:])
                below = i
            a, b, down = 6 + i % 2, 6 + (i + 1) % 2, dirt[1][1][r]
            for c in range(out.shape[1]):
                out[r, c] *= lines[a, c] + down * (lines[b, c] - lines[a, c])
        if stray[0].size > 0:
            i = stray[1][0][r] - stray[3][0]
            if i != above:
                _spread_rows(stray, _ALIKE, white_e, above, i, lines[3:6])
                above = i
            a, b, down = 3 + i % 2, 3 + (i + 1) % 2, stray[1][1][r]
            for c in range(out.shape[1]):
                out[r, c] += lines[a, c] + down * (lines[b, c] - lines[a, c])


@njit(cache=True)
def _spread_rows(
    layer: Layer, fall_off: FallOff, white_e: np.float32, held: int, i: int, lines: NDArray[np.float32]
) -> None:
    """Spread to pixels those of the rows of nodes i and i + 1 that are not held; the third line is for work."""
    (nodes, _, columns, first, spacing), (whole, top, left) = layer, fall_off
    for node in range(max(i, held + 2), i + 2):
        line = nodes[node]
        if whole.size > 0:
            line, bright, factor = lines[2], nodes[node], whole[top + node, left : left + nodes.shape[1]]
            for k in range(bright.shape[0]):
                line[k] = bright[k] * factor[k] * white_e
        _spread(line, columns, first[1], spacing, lines[node % 2, : columns[0].shape[0]])


@njit(cache=True)
def _spread(line: NDArray[np.float32], columns: Line, first: int, spacing: int, out: NDArray[np.float32]) -> None:
    """Interpolate a row of nodes at the pixels; two that lie between the same nodes at once where each node has two."""
    before, part = columns
    n, begin, end = out.shape[0], 0, 0  # of the pairs
    if spacing == 2 and n > 2:
        begin = 0 if before[0] == before[1] else 1
        pairs, node = (n - begin) // 2, before[begin] - first
        end = begin + 2 * pairs
        nodes, pixels, near, far = line[node : node + pairs + 1], out[begin:end], part[begin], part[begin + 1]
        for k in range(pairs):
            a, step = nodes[k], nodes[k + 1] - nodes[k]
            pixels[2 * k], pixels[2 * k + 1] = a + near * step, a + far * step
    for start, stop in ((0, begin), (end, n)):
        for c in range(start, stop):
            at = np.uint32(before[c] - first)  # unsigned: spares the test for indices that count from the end
            out[c] = line[at] + part[c] * (line[at + np.uint32(1)] - line[at])
