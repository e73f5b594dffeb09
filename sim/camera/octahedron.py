"""The sphere of directions unfolded onto a square by way of the octahedron; x is the direction of flight.

    p = (y, z)/(|x| + |y| + |z|);     x < 0:  p <- (sgn p_y (1 - |p_z|), sgn p_z (1 - |p_y|))                    (1)

Nodes of a table stand on an even grid of p, 2/n rad apart straight ahead and up to sqrt 6 times that elsewhere, with
rows of them on p_y = 0 and p_z = 0, where the map has a kink: row 0 up, column 0 left, straight ahead in the middle.
Source: Praun & Hoppe 2003 (octahedral maps).
"""

import numpy as np
from numpy.typing import NDArray

from dockair.kernels import njit
from dockair.rotations import Array

STEEPEST = 2.74  #: |dp| <= (1 + sqrt 3) |d direction|, Eq. (1)


def directions_from_nodes(i: NDArray[np.int64], j: NDArray[np.int64], n: int) -> Array:
    """(m, 3) unit vectors of nodes (row i, column j) of an (n, n) table, the inverse of Eq. (1)."""
    p_y, p_z = 1.0 - 2.0 * j / (n - 2), 1.0 - 2.0 * i / (n - 2)
    x = 1.0 - np.abs(p_y) - np.abs(p_z)
    behind = x < 0.0
    y = np.where(behind, np.copysign(1.0 - np.abs(p_z), p_y), p_y)
    z = np.where(behind, np.copysign(1.0 - np.abs(p_y), p_z), p_z)
    length = np.sqrt(x * x + y * y + z * z)
    return np.stack([x / length, y / length, z / length], axis=1)


@njit(cache=True)
def mark_missing(row: int, column: int, known: NDArray[np.bool_], missing: NDArray[np.bool_]) -> bool:
    """Mark what is not known of a tile (tiles, tiles) of nodes and of its neighbours; say whether that is any."""
    tiles, any_missing = known.shape[0], False
    for a in range(row - 1, row + 2):
        for b in range(column - 1, column + 2):
            r, c = a, b
            if a < 0 or a >= tiles:  # the square's edges meet their own mirror images
                r, c = min(max(a, 0), tiles - 1), tiles - 1 - c
            if b < 0 or b >= tiles:
                r, c = tiles - 1 - r, min(max(c, 0), tiles - 1)
            if not known[r, c]:
                missing[r, c] = any_missing = True
    return any_missing
