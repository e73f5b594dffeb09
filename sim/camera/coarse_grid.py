"""A smooth quantity over the sensor, kept at every eighth pixel.

Node (i, j) of a grid whose first node is (i0, j0) stands at

    row k (i0 + i),   column k (j0 + j),     k = 8 pixels                                                        (1)

and between four nodes the quantity is bilinear. A node's value depends on its place on the sensor alone, so that a
window's grid is the crop of the full frame's.

Not modelled: anything finer than about two nodes.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from dockair.messages import Window
from dockair.rotations import Array

SPACING_PX = 8  #: pixels between nodes


@dataclass(frozen=True, slots=True, eq=False)
class CoarseGrid:
    """Values at nodes, Eq. (1)."""

    values: NDArray[np.float32]  #: (m, n)
    first: tuple[int, int]  #: (i0, j0)
    spacing_px: int = SPACING_PX

    def at(self, pixels: Array) -> Array:
        """(n,) bilinear values at (n, 2) pixels (u, v); beyond the outermost nodes, those of the edge."""
        m, n = self.values.shape
        y = np.clip(pixels[:, 1] / self.spacing_px - self.first[0], 0.0, m - 1.0)
        x = np.clip(pixels[:, 0] / self.spacing_px - self.first[1], 0.0, n - 1.0)
        i, j = np.minimum(y.astype(int), m - 2), np.minimum(x.astype(int), n - 2)
        below, right = y - i, x - j
        upper = self.values[i, j] * (1.0 - right) + self.values[i, j + 1] * right
        lower = self.values[i + 1, j] * (1.0 - right) + self.values[i + 1, j + 1] * right
        return np.asarray(upper * (1.0 - below) + lower * below)


def nodes_around(window: Window) -> tuple[tuple[int, int], tuple[int, int]]:
    """First node (i0, j0) and numbers of nodes (m, n) that enclose every pixel of a window."""
    k = SPACING_PX
    first = window.row_start // k, window.column_start // k
    last = (window.row_stop - 1) // k + 1, (window.column_stop - 1) // k + 1
    return first, (last[0] - first[0] + 1, last[1] - first[1] + 1)
