"""Values of a layer at the nodes of directions from one place, made tile by tile, or strip by strip ahead of time.

A node's value depends on its direction and the place, its key, alone: not on when or in which order it was made.
"""

from collections.abc import Callable, Iterable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dockair.rotations import Array
from dockair.sim.camera.layer_keys import Place
from dockair.sim.camera.octahedron import directions_from_nodes

TILE = 64  #: nodes a side
SIDE = TILE + 1  #: of what is kept of a tile: with the next ones' first nodes, so that it is read alone
_STRIPS, _ROWS = 5, 13  # that a tile is made in, SIDE rows in sum


class LayerTiles:
    """Tiles of one key.

    Args:
        function: (m, 3) unit vectors and the key's place (3,) -> (m, channels) values.
        tiles: a side.
        channels: how many values the function has, 1 or 2.
    """

    def __init__(self, function: Callable[[Array, Array], Array], tiles: int, channels: int) -> None:
        self._function, self._tiles = function, tiles
        self._strips = np.zeros((tiles, tiles), dtype=np.int64)
        self._ahead: list[tuple[int, int]] = []
        self._made = 0
        self.key: Place = (0.0, 0.0, 0.0)
        self.values: NDArray[np.float32] = np.zeros(((tiles * SIDE) ** 2, channels), dtype=np.float32)
        self.is_known = np.zeros((tiles, tiles), dtype=np.bool_)

    @property
    def neighbours(self) -> NDArray[Any]:
        """(nodes - 1,) the values of each node and of the next one as one, whatever that is a number of."""
        values = self.values
        kind = np.uint64 if values.shape[1] == 1 else np.complex128
        return np.ndarray(len(values) - 1, kind, values.data, strides=values.strides[:1])

    def restart(self, key: Place) -> None:
        """Forget all, for another key."""
        self.key, self._ahead, self._made = key, [], 0
        self._strips[:] = 0
        self.is_known[:] = False

    def complete(self, tiles: Iterable[tuple[int, int]]) -> None:
        """Make what lacks of tiles (row, column)."""
        for row, column in tiles:
            while not self.is_known[row, column]:
                self.make_strip(row, column)

    @property
    def lacks_work(self) -> bool:
        """Whether `prepare` has made all that it was told of."""
        return not self._ahead

    def plan(self, tiles: Iterable[tuple[int, int]]) -> None:
        """Tell which tiles will be wanted."""
        self._ahead = list(tiles)

    def prepare(self, share: float) -> None:
        """Make strips of what is planned until this share of all, 0 to 1, is made."""
        while self._ahead:
            row, column = self._ahead[-1]
            if self.is_known[row, column]:
                self._ahead.pop()
                continue
            left = sum(_STRIPS - int(self._strips[tile]) for tile in self._ahead)
            if self._made >= share * (self._made + left):
                return
            self.make_strip(row, column)
            self._made += 1

    def make_strip(self, row: int, column: int) -> None:
        """Tabulate the next strip of a tile that is not known."""
        strip, first = int(self._strips[row, column]), (row * self._tiles + column) * SIDE * SIDE
        down, along = np.arange(strip * _ROWS, (strip + 1) * _ROWS), np.arange(SIDE)
        i, j = np.meshgrid(down + row * TILE, along + column * TILE, indexing="ij")
        directions = directions_from_nodes(i.ravel(), j.ravel(), self._tiles * TILE)
        place = slice(first + strip * _ROWS * SIDE, first + (strip + 1) * _ROWS * SIDE)
        self.values[place] = self._function(directions, np.array(self.key))
        self._strips[row, column] = strip + 1
        self.is_known[row, column] = strip + 1 == _STRIPS
