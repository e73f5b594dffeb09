"""The picture behind the LEDs in blocks of k x k pixels, and its way from blocks to pixels.

Block (i, j) has its centre at row k (i + 1/2) - 1/2 and column k (j + 1/2) - 1/2 of the sensor. From the blocks'
radiances L, with the lens's fall-off and bilinear between the centres, a pixel gets

    e(u, v) = (e_white [L cos^4 t](u, v) + stray(u, v)) dirt(u, v)                                               (1)

Through a lens that distorts, block (i, j) sees along the ray that the inverse of [calibration, eq 1] gives. Then the
scene is drawn for a pinhole, on blocks of the same size around the same axis, and each block of the sensor takes the
pinhole's radiance where its ray falls, bilinear again. Where the distortion moves nothing by more than half a block
that step is left out.

Every block and pixel is a function of its place on the sensor: tables hold the whole sensor, a window takes its part.
Not modelled: vignetting beyond cos^4, blur by the lens.
"""

from dataclasses import dataclass

import numpy as np
from numba import njit
from numpy.typing import NDArray
from scipy.interpolate import RectBivariateSpline

from dockair.calibration import Camera
from dockair.messages import Window
from dockair.rotations import Array
from dockair.sim.camera.coarse_grid import CoarseGrid

_KNOTS = 16  # blocks between the rays from which a spline makes the others

#: For each pixel along a row or column: the node before it, and the part of the way to the next.
Line = tuple[NDArray[np.int64], NDArray[np.float32]]
Layer = tuple[NDArray[np.float32], Line, Line]  # nodes, rows, columns
_NO_LINE: Line = (np.empty(0, dtype=np.int64), np.empty(0, dtype=np.float32))
_NOTHING: Layer = (np.empty((0, 0), dtype=np.float32), _NO_LINE, _NO_LINE)


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
        self._fall_off = (1.0 / (1.0 + a**2 + b**2) ** 2).astype(np.float32)

    @property
    def distorted(self) -> bool:
        """Whether the sensor's blocks are not the pinhole's."""
        return self._places is not None

    def around(self, window: Window) -> Extent:
        """Blocks that the pixels of a window are interpolated from."""
        k = self._k
        first = [(2 * pixel + 1 - k) // (2 * k) for pixel in (window.row_start, window.column_start)]
        last = [(2 * pixel - 1 - k) // (2 * k) + 1 for pixel in (window.row_stop, window.column_stop)]
        return Extent(first[0], last[0] + 1, first[1], last[1] + 1)

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
        """Tangents x (columns,) to the right and y (rows,) below the axis, of the pinhole's blocks."""
        return self._tangents(extent)

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
    ) -> NDArray[np.float32]:
        """Return (rows, columns) expected electrons of the window, Eq. (1).

        Args:
            picture: radiances of the sensor's blocks; changed.
            extent: which those are.
            window: what is wanted.
            white_e: electrons of radiance 1 on the axis.
            stray: electrons added; None for none.
            dirt: factor; None for 1.
        """
        k = self._k
        picture *= self._part(self._fall_off, extent)
        picture *= np.float32(white_e)
        rows = _line(window.row_start, window.row_stop, 2 * k, 1 - k, extent.row_start)
        columns = _line(window.column_start, window.column_stop, 2 * k, 1 - k, extent.column_start)
        out = np.empty(window.shape, dtype=np.float32)
        _to_pixels(out, (picture, rows, columns), _layer(stray, window), _layer(dirt, window))
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


def _line(start: int, stop: int, unit: int, shift: int, first: int) -> Line:
    """For pixels n in [start, stop): floor and remainder of (2 n + shift) / unit, the floor less `first`."""
    twice = 2 * np.arange(start, stop) + shift
    return twice // unit - first, ((twice % unit) / unit).astype(np.float32)


def _layer(grid: CoarseGrid | None, window: Window) -> Layer:
    """Nodes of a grid, and where each row and column of a window lies among them."""
    if grid is None:
        return _NOTHING
    unit = 2 * grid.spacing_px
    rows = _line(window.row_start, window.row_stop, unit, 0, grid.first[0])
    columns = _line(window.column_start, window.column_stop, unit, 0, grid.first[1])
    for line, nodes in zip((rows, columns), grid.values.shape, strict=True):
        if line[0][0] < 0 or line[0][-1] + 2 > nodes:
            raise ValueError(f"a grid of {grid.values.shape} nodes from {grid.first} does not hold {window}")
    return grid.values, rows, columns


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
def _to_pixels(out: NDArray[np.float32], scene: Layer, stray: Layer, dirt: Layer) -> None:
    """Fill the window, Eq. (1); a layer without nodes is left out."""
    two_lines = np.empty((3, 2, out.shape[1]), dtype=np.float32)
    held = np.full(3, -2)
    for r in range(out.shape[0]):
        row = out[r]
        a, b, down = _lines_around(scene, r, two_lines[0], held[0:1])
        for c in range(row.shape[0]):
            row[c] = a[c] + down * (b[c] - a[c])
        if stray[0].size > 0:
            a, b, down = _lines_around(stray, r, two_lines[1], held[1:2])
            for c in range(row.shape[0]):
                row[c] += a[c] + down * (b[c] - a[c])
        if dirt[0].size > 0:
            a, b, down = _lines_around(dirt, r, two_lines[2], held[2:3])
            for c in range(row.shape[0]):
                row[c] *= a[c] + down * (b[c] - a[c])


@njit(cache=True)
def _lines_around(
    layer: Layer, r: int, two_lines: NDArray[np.float32], held: NDArray[np.int64]
) -> tuple[NDArray[np.float32], NDArray[np.float32], np.float32]:
    """Rows of nodes before and after row r of the window, spread to pixels, and the part of the way between them."""
    nodes, (rows, down), (left, right) = layer
    i = rows[r]
    for node in range(max(i, held[0] + 2), i + 2):
        line, spread = nodes[node], two_lines[node % 2]
        for c in range(spread.shape[0]):
            k = np.uint32(left[c])  # unsigned: spares the test for indices that count from the end
            a = line[k]
            spread[c] = a + right[c] * (line[k + np.uint32(1)] - a)
    held[0] = i
    return two_lines[i % 2], two_lines[(i + 1) % 2], down[r]
