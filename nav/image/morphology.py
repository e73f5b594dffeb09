"""Erosion, dilation, opening and closing of binary images, and an opening that spares small LEDs.

    erosion   (B - S)(x) = min over s in S of B(x + s),    dilation  (B + S)(x) = max over s in S of B(x - s)
    opening = dilation of the erosion,                     closing = erosion of the dilation     [Yoon 2018, Figs 3-5]

The frame's outside is background. Opening removes what the structuring element S does not fit into: noise pixels, thin
bridges, streaks. It also erases an LED that is small because it is far: at 30 m and PSF sigma 0.7 px it has four to
nine pixels. The rule here:

    a component of fewer than `spare_below_px` pixels is left as it is; any other is replaced by its opening.   (1)

An unclipped LED of 13 pixels or more always holds a full 3 x 3 square, so that with (1) at 13 opening never loses one
(checked over sub-pixel phases in the tests), and what has fewer is judged by the area filter alone.

Opening does not mix components (S is connected, so each place where it fits lies inside one component): opening them
one by one is the opening of the image, and costs nothing where the frame is dark.
"""

import cv2
import numpy as np
from numpy.typing import NDArray

from dockair.errors import DockairError
from dockair.kernels import njit
from dockair.nav.image.binarise import Mask
from dockair.nav.image.labelling import Runs

Element = NDArray[np.uint8]
_ANY_AREA_PX = 1 << 40  # more than any frame has
_SHAPES = {"cross": cv2.MORPH_CROSS, "square": cv2.MORPH_RECT, "disc": cv2.MORPH_ELLIPSE}


def structuring_element(shape: str = "square", size_px: int = 3) -> Element:
    """(size, size) uint8 of 0 and 1, centred.

    Args:
        shape: "square" (the source's choice), "cross" or "disc".
        size_px: odd.

    Raises:
        DockairError: unknown shape, even or non-positive size.
    """
    if shape not in _SHAPES:
        raise DockairError("structuring element", expected="a shape", got=shape, exists=_SHAPES)
    if size_px < 1 or size_px % 2 == 0:
        raise DockairError("structuring element", expected="an odd size >= 1", got=size_px)
    return np.asarray(cv2.getStructuringElement(_SHAPES[shape], (size_px, size_px)), np.uint8)


def _apply(operation: int, mask: Mask, element: Element) -> Mask:
    mask = np.ascontiguousarray(mask)
    if mask.ndim != 2 or mask.dtype != np.bool_:
        raise DockairError("mask", expected="a (rows, columns) bool array", got=f"{mask.shape} {mask.dtype}")
    # a border of background as wide as the element, because OpenCV's own borders differ between its operations
    margin = element.shape[0] // 2 + 1
    padded = np.pad(mask, margin).view(np.uint8)
    result = cv2.morphologyEx(padded, operation, element, borderType=cv2.BORDER_CONSTANT, borderValue=0)
    return np.asarray(result[margin:-margin, margin:-margin]).astype(np.bool_)


def erode(mask: Mask, element: Element) -> Mask:
    """Erosion (rows, columns) bool of mask (rows, columns) bool."""
    return _apply(cv2.MORPH_ERODE, mask, element)


def dilate(mask: Mask, element: Element) -> Mask:
    """Dilation (rows, columns) bool of mask (rows, columns) bool."""
    return _apply(cv2.MORPH_DILATE, mask, np.ascontiguousarray(element[::-1, ::-1]))  # OpenCV takes B(x + s)


def open_(mask: Mask, element: Element) -> Mask:
    """Opening (rows, columns) bool of mask (rows, columns) bool."""
    return dilate(erode(mask, element), element)


def close(mask: Mask, element: Element) -> Mask:
    """Closing (rows, columns) bool of mask (rows, columns) bool."""
    return erode(dilate(mask, element), element)


def open_components(runs: Runs, element: Element, spare_below_px: int, connectivity: int = 8) -> Runs:
    """Components after opening by rule (1); one that falls apart becomes several, one that vanishes is left out.

    Args:
        runs: components.
        element: structuring element, itself connected.
        spare_below_px: area under which a component is left as it is.
        connectivity: 8 or 4, as the components were made with.
    """
    return open_and_trace(runs, element, spare_below_px, connectivity)[0]


def open_and_trace(
    runs: Runs,
    element: Element,
    spare_below_px: int,
    connectivity: int = 8,
    area_range_px: tuple[int, int] = (0, _ANY_AREA_PX),
) -> tuple[Runs, NDArray[np.int32], NDArray[np.int64]]:
    """Components of the right area, before opening and after it.

    Args:
        runs: components.
        element: as for `open_components`, like the next two.
        spare_below_px: area under which a component is left as it is.
        connectivity: 8 or 4.
        area_range_px: least and largest area.

    Returns:
        what is left of them, for each the component (n,) that it is of, and its area (n,).
    """
    row, start, stop, offset, origin, area = _open_components(
        runs.row, runs.start, runs.stop, runs.offset, element, spare_below_px, connectivity == 8, *area_range_px
    )
    return Runs(row=row, start=start, stop=stop, offset=offset), origin, area


@njit(cache=True)
def _opened(patch, element):  # type: ignore[no-untyped-def]
    """Opening of a patch whose outermost element.shape // 2 pixels are background."""
    half = element.shape[0] // 2
    rows, columns = patch.shape
    result = np.zeros_like(patch)
    for i in range(half, rows - half):
        for j in range(half, columns - half):
            fits = True
            for a in range(-half, half + 1):
                for b in range(-half, half + 1):
                    if element[a + half, b + half] and not patch[i + a, j + b]:
                        fits = False
            if not fits:
                continue
            for a in range(-half, half + 1):
                for b in range(-half, half + 1):
                    if element[a + half, b + half]:
                        result[i + a, j + b] = 1
    return result


@njit(cache=True)
def _mark_piece(patch, row, column, mark, corners, stack):  # type: ignore[no-untyped-def]
    """Flood the piece of 1s that holds (row, column) with `mark`."""
    patch[row, column] = mark
    stack[0, 0], stack[0, 1] = row, column
    depth = 1
    while depth > 0:
        depth -= 1
        i, j = stack[depth, 0], stack[depth, 1]
        for a in range(-1, 2):
            for b in range(-1, 2):
                if (a and b and not corners) or patch[i + a, j + b] != 1:
                    continue
                patch[i + a, j + b] = mark
                stack[depth, 0], stack[depth, 1] = i + a, j + b
                depth += 1


@njit(cache=True)
def _append_piece(out, n, patch, top, left, piece, row, start, stop):  # type: ignore[no-untyped-def]
    """Write the runs of one piece, found along the component's old runs; the new number of runs."""
    for k in range(len(row)):
        inside = False
        for j in range(start[k], stop[k] + 1):
            belongs = j < stop[k] and patch[row[k] - top, j - left] == piece
            if belongs and not inside:
                out[0, n], out[1, n] = row[k], j
            elif inside and not belongs:
                out[2, n] = j
                n += 1
            inside = belongs
    return n


@njit(cache=True)
def _areas(start, stop, offset):  # type: ignore[no-untyped-def]
    """Pixels of each component."""
    areas = np.zeros(len(offset) - 1, np.int64)
    for c in range(len(areas)):
        for k in range(offset[c], offset[c + 1]):
            areas[c] += stop[k] - start[k]
    return areas


@njit(cache=True)
def _open_components(  # type: ignore[no-untyped-def]
    row, start, stop, offset, element, spare_below, corners, least, largest
):
    half = max(element.shape[0] // 2, 1)
    areas = _areas(start, stop, offset)
    # opening can cut a run into pieces, but never into more than it has pixels
    capacity = areas[(areas >= least) & (areas <= largest)].sum()
    out, out_offset = np.empty((3, capacity), np.int32), np.zeros(capacity + 1, np.int32)
    origin, out_area = np.empty(capacity, np.int32), np.empty(capacity, np.int64)
    n, count = 0, 0
    for c in range(len(areas)):
        area = areas[c]
        if not least <= area <= largest:
            continue
        r, a, b = row[offset[c] : offset[c + 1]], start[offset[c] : offset[c + 1]], stop[offset[c] : offset[c + 1]]
        if area < spare_below:
            for k in range(len(r)):
                out[0, n + k], out[1, n + k], out[2, n + k] = r[k], a[k], b[k]
            origin[count], out_area[count] = c, area
            n, count = n + len(r), count + 1
            out_offset[count] = n
            continue
        top, left = r[0] - half, a.min() - half
        patch = np.zeros((r[-1] + half + 1 - top, b.max() + half - left), np.int32)
        for k in range(len(r)):
            patch[r[k] - top, a[k] - left : b[k] - left] = 1
        patch = _opened(patch, element)
        stack = np.empty((area, 2), np.int32)
        pieces = 0
        for k in range(len(r)):
            for j in range(a[k] - left, b[k] - left):
                if patch[r[k] - top, j] == 1:
                    pieces += 1
                    _mark_piece(patch, r[k] - top, j, pieces + 1, corners, stack)
        for piece in range(pieces):
            end = _append_piece(out, n, patch, top, left, piece + 2, r, a, b)
            remaining = (out[2, n:end] - out[1, n:end]).sum()
            if least <= remaining <= largest:
                origin[count], out_area[count] = c, remaining
                n, count = end, count + 1
                out_offset[count] = n
    return (
        out[0, :n].copy(),
        out[1, :n].copy(),
        out[2, :n].copy(),
        out_offset[: count + 1].copy(),
        origin[:count].copy(),
        out_area[:count].copy(),
    )
