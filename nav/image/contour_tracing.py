"""Connected components by contour tracing: one pass over the pixels.

An outer contour is followed when its first pixel is met, an inner one when its hole is, and everything else takes its
left neighbour's label. The background pixels that a contour looked at are marked, so no hole is followed twice.

Sources: [Yoon 2018, Fig 9]; Chang, Chen & Lu 2004.
"""

import numpy as np
from numpy.typing import NDArray

from dockair.kernels import njit
from dockair.nav.image.binarise import Mask
from dockair.nav.image.segments import SEGMENT, busy_segments, checked_mask

# Clockwise from east, rows downward: E SE S SW W NW N NE.
_ROW_STEP = np.array([0, 1, 1, 1, 0, -1, -1, -1])
_COLUMN_STEP = np.array([1, 1, 0, -1, -1, -1, 0, 1])


def label_contour_tracing(mask: Mask, connectivity: int = 8) -> tuple[NDArray[np.int32], int]:
    """Labels (rows, columns) int32 and their number, by contour tracing.

    Args:
        mask: (rows, columns) bool.
        connectivity: 8 (edges and corners) or 4 (edges).

    Raises:
        DockairError: wrong shape, dtype or connectivity.
    """
    mask = checked_mask(mask, connectivity)
    # a frame of background spares the tracer all tests for the image's edge
    padded = np.zeros((mask.shape[0] + 2, mask.shape[1] + 2), np.bool_)
    padded[1:-1, 1:-1] = mask
    labels, count = _contour_tracing(padded, busy_segments(padded), SEGMENT, 8 // connectivity)
    return labels[1:-1, 1:-1], int(count)


@njit(cache=True)
def _next_direction(mask, labels, row, column, first, stride):  # type: ignore[no-untyped-def]
    """Direction of the next foreground neighbour, clockwise from `first`; -1 if none. Marks the background seen."""
    for turn in range(0, 8, stride):
        direction = (first + turn) % 8
        i, j = row + _ROW_STEP[direction], column + _COLUMN_STEP[direction]
        if mask[i, j]:
            return direction
        labels[i, j] = -1
    return -1


@njit(cache=True)
def _trace(mask, labels, row, column, label, first, stride):  # type: ignore[no-untyped-def]
    """Follow one contour all round and label it."""
    labels[row, column] = label
    first_move = _next_direction(mask, labels, row, column, first, stride)
    if first_move < 0:
        return  # a single pixel
    direction = first_move
    i, j = row + _ROW_STEP[direction], column + _COLUMN_STEP[direction]
    while True:
        labels[i, j] = label
        # the pixel just left lies at direction + 4; clockwise of it, + 5 was seen from there, + 6 was not
        direction = _next_direction(mask, labels, i, j, (direction + 6) % 8, stride)
        if i == row and j == column and direction == first_move:
            return  # a contour may touch its first pixel more than once: it ends when it would begin again
        i, j = i + _ROW_STEP[direction], j + _COLUMN_STEP[direction]


@njit(cache=True)
def _contour_tracing(mask, busy, segment, stride):  # type: ignore[no-untyped-def]
    rows, columns = mask.shape
    labels = np.zeros((rows, columns), np.int32)
    count = 0
    outer = 7 if stride == 1 else 0  # above and to the left of an outer contour's first pixel there is background
    inner = 3 if stride == 1 else 4  # below an inner contour's first pixel (direction 2) there is the hole
    for i in range(1, rows - 1):
        for s in range(busy.shape[1]):
            if not busy[i, s]:
                continue
            for j in range(max(s * segment, 1), min((s + 1) * segment, columns - 1)):
                if not mask[i, j]:
                    continue
                if labels[i, j] == 0 and not mask[i - 1, j]:
                    count += 1
                    _trace(mask, labels, i, j, count, outer, stride)
                if labels[i, j] == 0:
                    labels[i, j] = labels[i, j - 1]
                if not mask[i + 1, j] and labels[i + 1, j] == 0:
                    labels[i + 1, j] = -1
                    _trace(mask, labels, i, j, labels[i, j], inner, stride)
    _unmark(labels, busy, segment)
    return labels, count


@njit(cache=True)
def _unmark(labels, busy, segment):  # type: ignore[no-untyped-def]
    """Take the marks off the background. They touch foreground: elsewhere there are none."""
    rows, columns = labels.shape
    for i in range(rows):
        for s in range(busy.shape[1]):
            if not busy[max(i - 1, 0) : i + 2, max(s - 1, 0) : s + 2].any():
                continue
            for j in range(s * segment, min((s + 1) * segment, columns)):
                labels[i, j] = max(labels[i, j], 0)
