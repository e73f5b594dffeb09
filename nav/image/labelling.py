"""Connected components of a binary image, three ways with one result: same partition, numbered in raster order.

* `label_contour_tracing`: one pass, following contours [Yoon 2018, Fig 9]; see `contour_tracing`.
* `label_two_pass`: provisional labels from the neighbours already seen, with a table of equivalences (a forest of
  parents) that the source leaves out; the second pass replaces them [Yoon 2018, Figs 7-8]. With 8 neighbours, what
  touches the pixel above is known to be equal to it: only where that one is background are two labels compared.
* `foreground_runs`: the same two passes on runs of foreground pixels instead of pixels. On a dark frame with a few
  blobs whole dark rows are passed over at once; it is what the detector uses.

The first two pass over 64 pixels at once where all of them are background, which is most of a frame.

Connectivity is 8 (edges and corners) or 4 (edges). Labels count from 1; 0 is background. The frame's outside is
background.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from dockair.errors import DockairError
from dockair.kernels import njit
from dockair.nav.image.binarise import Image, Mask
from dockair.nav.image.contour_tracing import label_contour_tracing
from dockair.nav.image.segments import SEGMENT, busy_segments, checked_mask

__all__ = ["Indices", "Labels", "Runs", "first_pass", "foreground_runs", "label_contour_tracing", "label_two_pass"]

Labels = NDArray[np.int32]
Indices = NDArray[np.int32]


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
        return np.add.reduceat(self.stop - self.start, self.offset[:-1], dtype=np.int64)

    def select(self, keep: Mask) -> "Runs":
        """The components for which `keep` (count,) is true, in the same order."""
        lengths = np.diff(self.offset)
        mine = np.repeat(keep, lengths)
        offset = np.concatenate([[0], np.cumsum(lengths[keep])]).astype(np.int32)
        return Runs(row=self.row[mine], start=self.start[mine], stop=self.stop[mine], offset=offset)


def label_two_pass(mask: Mask, connectivity: int = 8) -> tuple[Labels, int]:
    """Labels (rows, columns) int32 and their number, by two passes with a table of equivalences.

    Arguments and errors as for `label_contour_tracing`.
    """
    mask = np.ascontiguousarray(checked_mask(mask, connectivity))
    busy = busy_segments(mask)
    labels, parent = _first_pass(mask, busy, SEGMENT, connectivity == 8)
    return labels, int(_second_pass(labels, busy, SEGMENT, parent))


def first_pass(mask: Mask, connectivity: int = 8) -> tuple[Labels, Indices]:
    """Provisional labels and the table of equivalences: parent[label] is an equal, not larger label.

    Arguments and errors as for `label_contour_tracing`.
    """
    mask = np.ascontiguousarray(checked_mask(mask, connectivity))
    labels, parent = _first_pass(mask, busy_segments(mask), SEGMENT, connectivity == 8)
    return labels, parent


@njit(cache=True)
def _root(parent, label):  # type: ignore[no-untyped-def]
    while parent[label] != label:
        parent[label] = parent[parent[label]]
        label = parent[label]
    return label


@njit(cache=True)
def _joined(parent, label, other):  # type: ignore[no-untyped-def]
    """Label of a pixel that touches two, either of them 0 for none; that they are equal is noted."""
    if label == 0 or other == 0 or label == other:
        return max(label, other)
    a, b = _root(parent, label), _root(parent, other)
    parent[max(a, b)] = min(a, b)
    return label


@njit(cache=True)
def _first_pass(mask, busy, segment, corners):  # type: ignore[no-untyped-def]
    rows, columns = mask.shape
    labels = np.zeros((rows + 1, columns + 2), np.int32)  # a frame of background above and on both sides
    # a new label needs background to its left and above: at most every second pixel of a row
    parent = np.zeros(rows * ((columns + 1) // 2) + 1, np.int32)
    count = 0
    for i in range(rows):
        above, here = labels[i], labels[i + 1]
        for s in range(busy.shape[1]):
            if not busy[i, s]:
                continue
            for j in range(s * segment, min((s + 1) * segment, columns)):
                if not mask[i, j]:
                    continue
                label = here[j]
                if not corners:
                    label = _joined(parent, label, above[j + 1])
                else:
                    label = label if label else above[j]
                    if not above[j + 1]:
                        label = _joined(parent, label, above[j + 2])
                    elif not label:  # what touches the pixel above is known to be equal to it
                        label = above[j + 1]
                if label == 0:
                    count += 1
                    label = count
                    parent[count] = count
                here[j + 1] = label
    return labels[1:, 1:-1], parent[: count + 1]


@njit(cache=True)
def _second_pass(labels, busy, segment, parent):  # type: ignore[no-untyped-def]
    """Replace the provisional labels by final ones; their number."""
    final = np.zeros(len(parent), np.int32)
    count = 0
    for label in range(1, len(parent)):
        # a root is the smallest label of its component, so it has got its number before the others ask
        if parent[label] == label:
            count += 1
            final[label] = count
        else:
            final[label] = final[_root(parent, label)]
    for i in range(labels.shape[0]):
        for s in range(busy.shape[1]):
            if busy[i, s]:
                for j in range(s * segment, min((s + 1) * segment, labels.shape[1])):
                    labels[i, j] = final[labels[i, j]]
    return count


def foreground_runs(image: Image, threshold: int, connectivity: int = 8) -> Runs:
    """Components of [image > threshold] as runs, without making the binary image.

    Args:
        image: (rows, columns) uint8 or uint16.
        threshold: level [DN]; below 0 it counts as 0.
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
