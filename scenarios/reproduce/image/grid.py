"""Small binary and labelled images drawn as the source draws them: squares with a grid, numbers in them."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from dockair.rotations import Array

COLOURS = ("#f4f4f4", "#4c78a8", "#f58518", "#54a24b", "#e45756", "#72b7b2", "#b279a2", "#eeca3b")  # 0, 1, 2, ...


def mask_from_text(text: str) -> NDArray[np.bool_]:
    """(rows, columns) bool; `#` is foreground."""
    return np.array([[letter == "#" for letter in line] for line in text.split()])


def draw_grid(axes: Any, values: NDArray[Any], title: str, *, numbers: bool = False) -> None:
    """Draw 0, 1, 2, ... in colours; with numbers written into the squares that are not 0."""
    from matplotlib.colors import ListedColormap

    shown = np.where(values > 0, (values.astype(int) - 1) % (len(COLOURS) - 1) + 1, 0)
    axes.imshow(shown, cmap=ListedColormap(COLOURS), vmin=-0.5, vmax=len(COLOURS) - 0.5, interpolation="nearest")
    rows, columns = values.shape
    axes.set_xticks(np.arange(columns + 1) - 0.5)
    axes.set_yticks(np.arange(rows + 1) - 0.5)
    axes.grid(color="#9a9a9a", lw=0.6)
    axes.tick_params(length=0, labelbottom=False, labelleft=False)
    axes.set_title(title, fontsize=9)
    if numbers:
        for i, j in np.argwhere(values > 0):
            axes.text(j, i, str(values[i, j]), ha="center", va="center", fontsize=8, color="white")


def mark_squares(axes: Any, where: NDArray[np.bool_], colour: str) -> None:
    """Put a dot into each square that is true: what an operation added or took away."""
    rows, columns = np.nonzero(where)
    axes.plot(columns, rows, ".", ms=7.0, color=colour)


def draw_points(axes: Any, points: Array, **style: Any) -> None:
    """Points (n, 2) of the image, v downward."""
    axes.plot(points[:, 0], points[:, 1], **{"ls": "none", "marker": "o", "ms": 4.0, **style})
    axes.set_aspect("equal")
    if not axes.yaxis_inverted():
        axes.invert_yaxis()
