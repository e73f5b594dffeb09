"""The path of contour tracing: outer contours, inner ones, and what is filled in between.

The tracer here is the one of `nav.image.labelling` written for the eye, recording where it goes. Its contours stand
beside OpenCV's, its labels beside those of the kernel that flies.
"""

from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from dockair.nav.image.labelling import label_contour_tracing
from dockair.scenarios.reproduce.image.grid import draw_grid, mask_from_text
from dockair.scenarios.reproduce.reference import picture_name

ID = "image/fig9"
TITLE = "the path of contour tracing, one pass"
_SOURCE = "[Yoon 2018, figs 7 and 9]; Chang, Chen & Lu 2004; reference: cv2.findContours"
_SIZE_IN, _DPI = (11.0, 4.4), 110
_STEPS = ((0, 1), (1, 1), (1, 0), (1, -1), (0, -1), (-1, -1), (-1, 0), (-1, 1))  # clockwise from east, rows downward
_OUTER_FIRST, _INNER_FIRST = 7, 3

GRID = mask_from_text("""
    ................
    ...######.......
    ..########..##..
    ..##...###..##..
    .###...####.....
    ..###..###......
    ...######....#..
    ....####....###.
    .....#.......#..
    .....#..........
    ................
""")

Pixel = tuple[int, int]


@dataclass(slots=True)
class Traced:
    """Labels and where the tracer went."""

    labels: NDArray[np.int32]
    outer: list[list[Pixel]] = field(default_factory=list)  #: a closed path (row, column) for each object
    inner: list[list[Pixel]] = field(default_factory=list)  #: one for each hole


def trace(mask: NDArray[np.bool_]) -> Traced:
    """One pass over (rows, columns) bool, 8-connected, whose outermost pixels are background."""
    labels = np.zeros(mask.shape, np.int32)
    traced = Traced(labels)
    for i, j in np.argwhere(mask):
        if labels[i, j] == 0 and not mask[i - 1, j]:
            label = len(traced.outer) + 1
            traced.outer.append(_contour(mask, labels, (int(i), int(j)), label, _OUTER_FIRST))
        if labels[i, j] == 0:
            labels[i, j] = labels[i, j - 1]
        if not mask[i + 1, j] and labels[i + 1, j] == 0:  # a hole that no contour has looked at
            traced.inner.append(_contour(mask, labels, (int(i), int(j)), int(labels[i, j]), _INNER_FIRST))
    labels[labels < 0] = 0
    return traced


def _contour(mask: NDArray[np.bool_], labels: NDArray[np.int32], start: Pixel, label: int, first: int) -> list[Pixel]:
    path, direction, first_move = [start], first, -1
    while True:
        i, j = path[-1]
        labels[i, j] = label
        for turn in range(8):
            k, m = i + _STEPS[(direction + turn) % 8][0], j + _STEPS[(direction + turn) % 8][1]
            if mask[k, m]:
                move = (direction + turn) % 8
                break
            labels[k, m] = -1
        else:
            return path  # a single pixel
        if (i, j) == start and move == first_move:
            return path[:-1]
        first_move = move if first_move < 0 else first_move
        path.append((k, m))
        direction = (move + 6) % 8


def reproduce(out: Path | None) -> dict[str, Any]:
    """Trace the grid; the paths in `out`."""
    traced = trace(GRID)
    labels, count = label_contour_tracing(GRID)
    contours, tree = cv2.findContours(GRID.astype(np.uint8), cv2.RETR_CCOMP, cv2.CHAIN_APPROX_NONE)
    holes = [bool(node[3] >= 0) for node in np.asarray(tree)[0]]
    rows = [
        {
            "case": f"{kind} contours",
            "ours": {"contours": len(paths), "steps": sum(map(len, paths))},
            "reference": {
                "contours": sum(hole == inner for hole in holes),
                "steps": sum(len(c) for c, hole in zip(contours, holes, strict=True) if hole == inner),
            },
        }
        for kind, paths, inner in (("outer", traced.outer, False), ("inner", traced.inner, True))
    ]
    same = {"labels": len(traced.outer), "pixels_that_differ": int((traced.labels != labels).sum())}
    rows.append({"case": "labels", "ours": same, "reference": {"labels": count, "pixels_that_differ": 0}})
    if out is not None:
        _draw(traced, out / picture_name(ID))
    return {"id": ID, "source": _SOURCE, "rows": rows}


def _draw(traced: Traced, path: Path) -> None:
    from matplotlib.figure import Figure

    figure = Figure(figsize=_SIZE_IN, dpi=_DPI, layout="constrained")
    left, right = figure.subplots(1, 2)
    draw_grid(left, GRID, "the way of the tracer: outer contours black, inner ones red, from the dots on")
    for paths, colour in ((traced.outer, "black"), (traced.inner, "#ff2d2d")):
        for way in paths:
            i, j = np.array([*way, way[0]], dtype=float).T
            left.plot(j[0], i[0], "o", ms=6.0, color=colour)
            left.quiver(
                j[:-1], i[:-1], np.diff(j), np.diff(i), angles="xy", scale_units="xy", scale=1.25, width=0.005,
                color=colour,
            )  # fmt: skip
    draw_grid(right, traced.labels, "labels after one pass", numbers=True)
    figure.savefig(path)
