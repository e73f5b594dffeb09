"""Connected components of a binary image, three ways with one result: same partition, numbered in raster order.

* `label_contour_tracing`: one pass over the pixels; an outer contour is followed when its first pixel is met, an inner
  one when its hole is, and everything else takes its left neighbour's label [Yoon 2018, Fig 9;
  Chang, Chen & Lu 2004]. The background pixels that a contour looked at are marked, so no hole is followed twice.
* `label_two_pass`: provisional labels from the neighbours already seen, with a table of equivalences (a forest of
  parents) that the source leaves out; the second pass replaces them [Yoon 2018, Figs 7-8].
* `foreground_runs`: the same two passes on runs of foreground pixels instead of pixels. On a dark frame with a few
  blobs whole dark rows are passed over at once; it is what the detector uses.

Connectivity is 8 (edges and corners) or 4 (edges). Labels count from 1; 0 is background. The frame's outside is
background.
"""

from dataclasses import dataclass

import numpy as np
from numba import njit
from numpy.typing import NDArray

from dockair.errors import DockairError
from dockair.nav.image.binarise import Image, Mask

Labels = NDArray[np.int32]
Indices = NDArray[np.int32]

# Clockwise from east, rows downward: E SE S SW W NW N NE.
_ROW_STEP = np.array([0, 1, 1, 1, 0, -1, -1, -1])
_COLUMN_STEP = np.array([1, 1, 0, -1, -1, -1, 0, 1])


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Runs:
    """Components as runs: row[i], columns [start[i], stop[i]); component c owns runs offset[c]:offset[c+1]."""

    row: Indices
    start: Indices
    stop: Indices
    offset: Indices

    @property
    def count(self) -> int:
        """Number of components."""
        return len(self.offset) - 1

    @property
    def area_px(self) -> NDArray[np.int64]:
        """(count,) pixels of each component."""
        if self.count == 0:
            return np.zeros(0, np.int64)
        return np.add.reduceat(self.stop - self.start, self.offset[:-1], dtype=np.int64)

    def select(self, keep: Mask) -> "Runs":
        """The components for which `keep` (count,) is true, in the same order."""
        lengths = np.diff(self.offset)
        mine = np.repeat(keep, lengths)
        offset = np.concatenate([[0], np.cumsum(lengths[keep])]).astype(np.int32)
        return Runs(row=self.row[mine], start=self.start[mine], stop=self.stop[mine], offset=offset)


def _checked(mask: Mask, connectivity: int) -> Mask:
    if connectivity not in (4, 8):
        raise DockairError("connectivity", expected="4 or 8", got=connectivity)
    mask = np.asarray(mask)
    if mask.ndim != 2 or mask.dtype != np.bool_:
        raise DockairError("mask", expected="a (rows, columns) bool array", got=f"{mask.shape} {mask.dtype}")
    return mask


def label_contour_tracing(mask: Mask, connectivity: int = 8) -> tuple[Labels, int]:
    """Labels (rows, columns) int32 and their number, by contour tracing.

    Args:
        mask: (rows, columns) bool.
        connectivity: 8 or 4.

    Raises:
        DockairError: wrong shape, dtype or connectivity.
    """
    mask = _checked(mask, connectivity)
    # a frame of background spares the tracer all tests for the image's edge
    padded = np.zeros((mask.shape[0] + 2, mask.shape[1] + 2), np.bool_)
    padded[1:-1, 1:-1] = mask
    labels, count = _contour_tracing(padded, 8 // connectivity)
    return np.ascontiguousarray(labels[1:-1, 1:-1]), int(count)


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
def _contour_tracing(mask, stride):  # type: ignore[no-untyped-def]
    rows, columns = mask.shape
    labels = np.zeros((rows, columns), np.int32)
    count = 0
    outer = 7 if stride == 1 else 0  # above and to the left of an outer contour's first pixel there is background
    inner = 3 if stride == 1 else 4  # below an inner contour's first pixel (direction 2) there is the hole
    for i in range(1, rows - 1):
        for j in range(1, columns - 1):
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
    for i in range(rows):
        for j in range(columns):
            if labels[i, j] < 0:
                labels[i, j] = 0
    return labels, count


def label_two_pass(mask: Mask, connectivity: int = 8) -> tuple[Labels, int]:
    """Labels (rows, columns) int32 and their number, by two passes with a table of equivalences.

    Arguments and errors as for `label_contour_tracing`.
    """
    labels, parent = first_pass(mask, connectivity)
    return _second_pass(labels, parent)


def first_pass(mask: Mask, connectivity: int = 8) -> tuple[Labels, Indices]:
    """Provisional labels and the table of equivalences: parent[label] is an equal, not larger label.

    Arguments and errors as for `label_contour_tracing`.
    """
    return _first_pass(np.ascontiguousarray(_checked(mask, connectivity)), connectivity == 8)


@njit(cache=True)
def _root(parent, label):  # type: ignore[no-untyped-def]
    while parent[label] != label:
        parent[label] = parent[parent[label]]
        label = parent[label]
    return label


@njit(cache=True)
def _first_pass(mask, corners):  # type: ignore[no-untyped-def]
    rows, columns = mask.shape
    labels = np.zeros((rows, columns), np.int32)
    # a new label needs background to its left and above: at most every second pixel of a row
    parent = np.zeros(rows * ((columns + 1) // 2) + 1, np.int32)
    count = 0
    for i in range(rows):
        for j in range(columns):
            if not mask[i, j]:
                continue
            label = labels[i, j - 1] if j > 0 else 0
            if i > 0:
                for k in range(max(j - 1, 0) if corners else j, min(j + 2, columns) if corners else j + 1):
                    other = labels[i - 1, k]
                    if other == 0:
                        continue
                    if label == 0:
                        label = other
                    elif label != other:
                        a, b = _root(parent, label), _root(parent, other)
                        parent[max(a, b)] = min(a, b)
            if label == 0:
                count += 1
                label = count
                parent[count] = count
            labels[i, j] = label
    return labels, parent[: count + 1]


@njit(cache=True)
def _second_pass(labels, parent):  # type: ignore[no-untyped-def]
    final = np.zeros(len(parent), np.int32)
    count = 0
    for label in range(1, len(parent)):
        # a root is the smallest label of its component, so it has got its number before the others ask
        if parent[label] == label:
            count += 1
            final[label] = count
        else:
            final[label] = final[_root(parent, label)]
    result = np.empty_like(labels)
    for i in range(labels.shape[0]):
        for j in range(labels.shape[1]):
            result[i, j] = final[labels[i, j]]
    return result, count


def foreground_runs(image: Image, threshold: int, connectivity: int = 8) -> Runs:
    """Components of [image > threshold] as runs, without making the binary image.

    Args:
        image: (rows, columns) uint8 or uint16.
        threshold: level [DN].
        connectivity: 8 or 4.

    Raises:
        DockairError: wrong connectivity.
    """
    if connectivity not in (4, 8):
        raise DockairError("connectivity", expected="4 or 8", got=connectivity)
    level = min(max(threshold, 0), int(np.iinfo(image.dtype).max))
    image = np.ascontiguousarray(image)
    # NumPy finds the rows that hold anything with vector instructions, ten times faster than the scan that follows
    bright_rows = np.flatnonzero(image.max(axis=1, initial=0) > level)
    row, start, stop = _find_runs(image, bright_rows, image.dtype.type(level))
    order, offset = _join_runs(row, start, stop, 1 if connectivity == 8 else 0)
    return Runs(row=row[order], start=start[order], stop=stop[order], offset=offset)


@njit(cache=True)
def _find_runs(image, bright_rows, threshold):  # type: ignore[no-untyped-def]
    columns = image.shape[1]
    capacity = len(bright_rows) * ((columns + 1) // 2)  # touched only as far as it is used
    row = np.empty(capacity, np.int32)
    start = np.empty(capacity, np.int32)
    stop = np.empty(capacity, np.int32)
    n = 0
    for i in bright_rows:
        line = image[i]
        inside = False
        for j in range(columns):
            if (line[j] > threshold) == inside:
                continue
            if inside:
                stop[n] = j
                n += 1
            else:
                row[n], start[n] = i, j
            inside = not inside
        if inside:
            stop[n] = columns
            n += 1
    return row[:n].copy(), start[:n].copy(), stop[:n].copy()


@njit(cache=True)
def _join_runs(row, start, stop, reach):  # type: ignore[no-untyped-def]
    """Order that groups the runs by component, components by their first run, and each component's first index."""
    n = len(row)
    parent = np.arange(n).astype(np.int32)
    above = 0  # first run that can still touch a run of this row from the row above
    for i in range(n):
        while above < i and (row[above] < row[i] - 1 or (row[above] == row[i] - 1 and stop[above] + reach <= start[i])):
            above += 1
        k = above
        while k < i and row[k] == row[i] - 1 and start[k] < stop[i] + reach:
            a, b = _root(parent, i), _root(parent, k)
            parent[max(a, b)] = min(a, b)
            k += 1
    component = np.empty(n, np.int32)
    count = 0
    for i in range(n):
        if parent[i] == i:
            component[i] = count
            count += 1
        else:
            component[i] = component[_root(parent, i)]
    offset = np.zeros(count + 1, np.int32)
    for i in range(n):
        offset[component[i] + 1] += 1
    for c in range(count):
        offset[c + 1] += offset[c]
    order = np.empty(n, np.int32)
    filled = offset[:count].copy()
    for i in range(n):
        order[filled[component[i]]] = i
        filled[component[i]] += 1
    return order, offset
