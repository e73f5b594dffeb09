"""What is seen of a layer below, cloud deck or ground, tabulated by direction from places that the camera passes.

The layer is a sphere of radius a about a centre under the camera, whose structure is fixed in the plane: a point of it
goes by its level way from the camera's place. A ray d, of any length n, from the height h over the layer meets it at

    k = (2 h - h^2/r)/(sqrt(d_z^2 - n^2 e) - d_z),   e = (2 h - h^2/r)/r,   r = a + h,     o = k (d_x, d_y)        (1)

A table is of one place, its key, and serves all places around; from the key, D away, the same point is seen toward

    (o_x + D_x, o_y + D_y, -h' - q),    q = a - sqrt(a^2 - o'^2) = o'^2/2a (1 + o'^2/4a^2 + ...)                   (2)

with h' the key's height, o' the level way from there; the horizon is near enough for two terms. Keys stand on a grid, a
third of the layer's depth apart at the start and closer where the layer is near, so that the picture is a function of
the place alone. A feature stays where it is as the camera moves and turns; what it fades into changes with the key by
less than the eye sees. On the way to a change of key the next one's tiles are made bit by bit, so that no frame has to
wait for them; and, where there is time between frames, before anything looks at them. Rays that skim past the layer are
taken to the farthest it reaches.

The directions are unfolded onto a square as in `octahedron`.
"""

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from dockair.kernels import njit
from dockair.rotations import Array
from dockair.sim.camera.earth import Interval
from dockair.sim.camera.layer_keys import Keys, Place
from dockair.sim.camera.layer_tiles import SIDE, TILE, LayerTiles
from dockair.sim.camera.octahedron import STEEPEST, mark_missing

_TILE, _SIDE, _SHIFT = TILE, SIDE, 6  # as of `layer_tiles`; the power of 2
_STRETCH = 2.0  # most by which Eq. (2) widens the way between two directions
_KEYS_PER_DEPTH = 3.0
_LEAST_DEPTH_M = 1.0  # for the keys' distance: a flight may begin on the layer
_FROM, _UNTIL = 0.05, 0.45  # way from a key, in keys' distances, over which the next one's tiles are made
_LOOK_AGAIN = 16  # frames from one look at what the next key lacks to another

Neighbours = NDArray[Any]  # values of a node and of the next one, four bytes each, as one number of so many bytes
#: Of a row's blocks: the node before each, and the parts of the way down and to the right to the next ones.
Places = tuple[NDArray[np.int32], NDArray[np.float32], NDArray[np.float32]]
Geometry = tuple[float, float, float, float, float, float]  # e, 2 h - h^2/r, h', 1/2a, D_x, D_y
View = tuple[Array, Array, Array, Interval]  # R_WC, tangents x and y, columns that see the layer


class Nodes(NamedTuple):
    """Values of a table for the kernel, tile after tile: what is near is near in memory."""

    neighbours: Neighbours
    side: int
    geometry: Geometry


NO_DECK = Nodes(np.empty(0, dtype=np.complex128), 0, (0.0, 0.0, 0.0, 0.0, 0.0, 0.0))


class LayerTable:
    """Values of a layer at nodes of directions.

    Args:
        function: (m, 3) unit vectors and the key's place (3,) -> (m, channels) values.
        tiles: a side, each of 64 x 64 nodes.
        channels: how many values a node has.
        height_m: of the origin over the layer.
        radius_m: of the layer's sphere.
    """

    def __init__(
        self, function: Callable[[Array, Array], Array], tiles: int, channels: int, height_m: float, radius_m: float
    ) -> None:
        self._height_m, self._radius_m, self._tiles = height_m, radius_m, tiles
        self._keys = Keys(max(height_m, _LEAST_DEPTH_M) / _KEYS_PER_DEPTH, height_m)
        self._own, self._next = (LayerTiles(function, tiles, channels) for _ in range(2))
        self._is_missing = np.zeros_like(self._own.is_known)  # false between looks
        self._count = 0

    def nodes(self, place_m: Array, R_WC: Array, x: Array, y: Array, below: Interval) -> Nodes:
        """Return the table for a place, known wherever a picture looks.

        Args:
            place_m: (3,) of the camera from the origin.
            R_WC: its attitude.
            x: (columns,) tangents to the right.
            y: (rows,) tangents below the axis.
            below: (rows, 2) first column and one past the last that see the layer.
        """
        place = self._come_to(place_m)
        view = np.ascontiguousarray(R_WC, dtype=float), x, y, below
        self._own.complete(self._missing(self._own, place, view))
        self._prepare(place, view)
        return Nodes(self._own.neighbours, self._tiles * _TILE, self._geometry(place, self._own.key))

    def work_ahead(self, place_m: Array, R_WC: Array, x: Array, y: Array, below: Interval) -> bool:
        """Make a strip of what a picture lacks here, or under the key that comes next; say whether anything lacked.

        Arguments as of `nodes`. For time that no frame waits for: `nodes` then finds done what it would do itself.
        """
        place = self._come_to(place_m)
        view = np.ascontiguousarray(R_WC, dtype=float), x, y, below
        coming, _ = self._keys.coming(place, self._own.key)
        for tiles, key in ((self._own, self._own.key), (self._next, coming)):
            if key is None:
                continue
            if key != tiles.key:
                tiles.restart(key)
            lacking = self._missing(tiles, place, view)
            if lacking:
                tiles.make_strip(*lacking[0])
                return True
        return False

    def _come_to(self, place_m: Array) -> Place:
        """Take up the tiles of a place's key; return the place as numbers."""
        place, key = self._keys.come_to(place_m)
        if key != self._own.key:
            self._own, self._next = self._next, self._own
            if key != self._own.key:
                self._own.restart(key)
        return place

    def _prepare(self, place_m: Place, view: View) -> None:
        """Make a share of the tiles of the key that comes next."""
        coming, way = self._keys.coming(place_m, self._own.key)
        share = (way - _FROM) / (_UNTIL - _FROM)
        if coming is None or share <= 0.0:
            return
        self._count += 1
        if coming != self._next.key:
            self._next.restart(coming)
        elif not (self._next.lacks_work and self._count >= _LOOK_AGAIN):
            self._next.prepare(share)
            return
        self._count = 0
        self._next.plan(self._missing(self._next, place_m, view))
        self._next.prepare(share)

    def _missing(self, tiles: LayerTiles, place_m: Place, view: View) -> list[tuple[int, int]]:
        """Which tiles a picture looks at that are not known."""
        (R, x, y, below), side, missing = view, self._tiles * _TILE, self._is_missing
        step = max(_step(x), _step(y), 1e-9)
        stride = max(1, int((_TILE - 1) / (0.5 * (side - 2) * STEEPEST * _STRETCH * step)))
        if not _mark(R, x, y, below, stride, side, self._geometry(place_m, tiles.key), tiles.is_known, missing):
            return []
        found = [(int(row), int(column)) for row, column in np.argwhere(missing)]
        missing[:] = False
        return found

    def _geometry(self, place_m: Place, key: Place) -> Geometry:
        height, a = self._height_m + place_m[2], self._radius_m
        twice = 2.0 * height - height * height / (a + height)
        aside_x, aside_y = place_m[0] - key[0], place_m[1] - key[1]
        return twice / (a + height), twice, self._height_m + key[2], 0.5 / a, aside_x, aside_y


def _step(x: Array) -> float:
    return abs(float(x[-1] - x[0])) / (len(x) - 1) if len(x) > 1 else 0.0


@njit(cache=True, error_model="numpy")
def lay_under(
    out: NDArray[np.float32], R: Array, x: Array, y: Array, below: Interval, ground: Nodes, deck: Nodes
) -> None:
    """Write the radiance of ground, or of a deck (light, transmittance) before it, into the columns that see it."""
    tangents, n = x.astype(np.float32), len(x)
    corner, down, right = np.empty(n, np.int32), np.empty(n, np.float32), np.empty(n, np.float32)
    around_ground, around_deck = np.empty((2, n), np.uint64), np.empty((2, n), np.complex128)
    for i in range(len(y)):
        left, stop = below[i]
        if left == stop:
            continue
        row, part, count = out[i, left:stop], tangents[left:stop], stop - left
        places = corner[:count], down[:count], right[:count]
        _place(R, part, y[i], ground, places)
        _read(ground.neighbours, around_ground, places, row)
        if len(deck.neighbours) > 0:
            _place(R, part, y[i], deck, places)
            _read_over(deck.neighbours, around_deck, places, row)


@njit(cache=True, error_model="numpy", inline="always")
def _toward(
    dx: np.float32, dy: np.float32, dz: np.float32, g: tuple[np.float32, ...]
) -> tuple[np.float32, np.float32, np.float32]:
    """Eqs. (1) and (2)."""
    e, twice, key_height, half_curvature, aside_x, aside_y = g
    square, zero = dz * dz - (dx * dx + dy * dy + dz * dz) * e, np.float32(0.0)
    k = twice / (np.sqrt(square if square > zero else zero) - (dz if dz < zero else zero))
    ox, oy = k * dx + aside_x, k * dy + aside_y
    sag = (ox * ox + oy * oy) * half_curvature
    return ox, oy, -key_height - sag * (np.float32(1.0) + sag * half_curvature)


@njit(cache=True, error_model="numpy", inline="always")
def _node(x: np.float32, y: np.float32, z: np.float32, half: np.float32) -> tuple[np.float32, np.float32]:
    """Fractional row and column of a direction of any length, [octahedron, eq 1]; of one that points down, z < 0."""
    zero = np.float32(0.0)
    scale = half / (abs(x) + abs(y) - z)
    p_y, p_z = y * scale, z * scale
    q_y, q_z = half + p_z, abs(p_y) - half
    q_y = q_y if p_y >= zero else -q_y
    return half - (q_z if x < zero else p_z), half - (q_y if x < zero else p_y)


@njit(cache=True)
def _single(g: Geometry) -> tuple[np.float32, ...]:
    return np.float32(g[0]), np.float32(g[1]), np.float32(g[2]), np.float32(g[3]), np.float32(g[4]), np.float32(g[5])


@njit(cache=True, error_model="numpy")
def _place(R: Array, x: NDArray[np.float32], y_i: float, nodes: Nodes, places: Places) -> None:
    """Fill the places of a row of blocks."""
    corner, down, right = places
    last, half, tiles = np.int32(nodes.side - 3), np.float32(0.5 * (nodes.side - 2)), np.int32(nodes.side // _TILE)
    width, rest, shift, zero = np.int32(_SIDE), np.int32(_TILE - 1), np.int32(_SHIFT), np.int32(0)
    a_x, b_x = np.float32(R[0, 0] - y_i * R[0, 2]), np.float32(R[0, 1])
    a_y, b_y = np.float32(R[1, 0] - y_i * R[1, 2]), np.float32(R[1, 1])
    a_z, b_z = np.float32(R[2, 0] - y_i * R[2, 2]), np.float32(R[2, 1])
    g = _single(nodes.geometry)
    for j in range(len(x)):
        to_x, to_y, to_z = _toward(a_x - x[j] * b_x, a_y - x[j] * b_y, a_z - x[j] * b_z, g)
        down[j], right[j] = _node(to_x, to_y, to_z, half)
    for j in range(len(x)):  # on its own, in whole numbers of 32 bits: the compiler takes several at once
        row, column = np.int32(down[j]), np.int32(right[j])
        row, column = max(min(row, last), zero), max(min(column, last), zero)
        tile = np.int32(np.int32(row >> shift) * tiles + np.int32(column >> shift))
        corner[j] = np.int32(np.int32(tile * width + (row & rest)) * width + (column & rest))
        down[j], right[j] = down[j] - np.float32(row), right[j] - np.float32(column)


@njit(cache=True)
def _read(neighbours: Neighbours, around: Neighbours, places: Places, out: NDArray[np.float32]) -> None:
    """The ground.

    Nodes are fetched first, for all blocks: the compiler then reckons several at once; by twos, that halves the loads.
    """
    corner, down, right = places
    for j in range(len(out)):
        k = np.uint64(np.uint32(corner[j]))
        around[0, j], around[1, j] = neighbours[k], neighbours[k + np.uint64(_SIDE)]
    values = around.view(np.float32)
    upper, lower = values[0], values[1]
    for j in range(len(out)):
        here, after = 2 * j, 2 * j + 1
        a = upper[here] + right[j] * (upper[after] - upper[here])
        b = lower[here] + right[j] * (lower[after] - lower[here])
        out[j] = a + down[j] * (b - a)


@njit(cache=True)
def _read_over(neighbours: Neighbours, around: Neighbours, places: Places, out: NDArray[np.float32]) -> None:
    """Light of the deck, and what it lets through of what is in `out`."""
    corner, down, right = places
    for j in range(len(out)):
        k = np.uint64(np.uint32(corner[j]))
        around[0, j], around[1, j] = neighbours[k], neighbours[k + np.uint64(_SIDE)]
    values = around.view(np.float32)
    upper, lower = values[0], values[1]
    for j in range(len(out)):
        light, clear, s, t = 4 * j, 4 * j + 1, right[j], down[j]
        up = upper[light] + s * (upper[light + 2] - upper[light])
        up_clear = upper[clear] + s * (upper[clear + 2] - upper[clear])
        low = lower[light] + s * (lower[light + 2] - lower[light])
        low_clear = lower[clear] + s * (lower[clear + 2] - lower[clear])
        out[j] = up + t * (low - up) + (up_clear + t * (low_clear - up_clear)) * out[j]


@njit(cache=True)
def _mark(
    R: Array,
    x: Array,
    y: Array,
    below: Interval,
    stride: int,
    side: int,
    geometry: Geometry,
    known: NDArray[np.bool_],
    missing: NDArray[np.bool_],
) -> bool:
    """Mark what is not known of the tiles of every stride-th block and their neighbours; say whether that is any."""
    any_missing, g = False, _single(geometry)
    last = -1, -1
    half = np.float32(0.5 * (side - 2))
    for line in range(0, len(y) + stride - 1, stride):
        i = min(line, len(y) - 1)
        left, stop = below[i]
        for along in range(left, stop + stride - 1 if stop > left else left, stride):
            x_j = x[min(along, stop - 1)]
            to_x, to_y, to_z = _toward(
                np.float32(R[0, 0] - y[i] * R[0, 2] - x_j * R[0, 1]),
                np.float32(R[1, 0] - y[i] * R[1, 2] - x_j * R[1, 1]),
                np.float32(R[2, 0] - y[i] * R[2, 2] - x_j * R[2, 1]),
                g,
            )
            v, u = _node(to_x, to_y, to_z, half)
            row, column = int(v) // _TILE, int(u) // _TILE
            if (row, column) == last:
                continue
            last = row, column
            any_missing = mark_missing(row, column, known, missing) or any_missing
    return any_missing
