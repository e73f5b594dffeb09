"""Pixels that may belong to a spot: the pass over all pixels that comes before `spot_kernels`.

A pixel x is a hit when 13/16 x - n >= c, n the second brightest of the four pixels at distance r along its row and
column; of a small spot only a pixel that none of its neighbours outshines. Vector instructions test 64 at a time, in
whole numbers: 3/16 x is 0 up to 5, 1 from 6 and 2 from 14 on.
"""

import numpy as np
from numba import njit

_SEGMENT = 64  # pixels that are passed over at once


@njit(cache=True)
def _best_contrast(centre, above, below, left, right, zero):  # type: ignore[no-untyped-def]
    """Largest 13/16 x - n of a segment.

    A constant length, indices from 0 and no type but the image's: only so does it become vector instructions.
    """
    best = zero
    for k in range(_SEGMENT):
        high_1, low_1 = max(above[k], below[k]), min(above[k], below[k])
        high_2, low_2 = max(left[k], right[k]), min(left[k], right[k])
        second = max(min(high_1, high_2), max(low_1, low_2))
        x = centre.dtype.type(centre[k] - (((centre[k] >> 1) + 1) >> 2) - (centre[k] >> 4))
        best = max(best, centre.dtype.type(max(x, second) - second))
    return best


@njit(cache=True)
def _segments(image, i, zero, contrast, reach, found):  # type: ignore[no-untyped-def]
    """First columns of the segments of row i that may hold a pixel of a spot; their number."""
    n = 0
    end = image.shape[1] - reach
    for first in range(reach, end, _SEGMENT):
        s = min(first, end - _SEGMENT)  # the last segment begins earlier than its own pixels
        if s >= reach:
            e = s + _SEGMENT
            above, below = image[i - reach, s:e], image[i + reach, s:e]
            left, right = image[i, s - reach : e - reach], image[i, s + reach : e + reach]
            if _best_contrast(image[i, s:e], above, below, left, right, zero) < contrast:
                continue
        found[n] = first
        n += 1
    return n


@njit(cache=True)
def find_hits(image, zero, reaches, row_steps, contrasts, wide):  # type: ignore[no-untyped-def]
    """(n, 4) which reach, row, column and n of the pixels that may belong to a spot, reach by reach.

    Args:
        image: contiguous.
        zero: of the image's type.
        reaches: to look at.
        row_steps: of each, how many rows from one that is looked at to the next.
        contrasts: of each, what a pixel has to have, whole.
        wide: reach from which on a spot may have many pixels of one level.
    """
    columns = image.shape[1]
    found = np.empty(columns // _SEGMENT + 1, np.int64)
    hits, n = np.empty((512, 4), np.int32), 0
    for k in range(len(reaches)):
        reach, contrast = reaches[k], contrasts[k]
        # the brightest of the neighbours that are looked at too speaks for its spot; 0 compares a pixel with itself
        beside, above = int(reach < wide), int(reach < wide and row_steps[k] == 1)
        for i in range(reach, image.shape[0] - reach, row_steps[k]):
            for first in found[: _segments(image, i, zero, contrast, reach, found)]:
                while n + _SEGMENT > len(hits):
                    hits = _grown(hits)
                end = min(first + _SEGMENT, columns - reach)
                n = _look_at(image, i, first, end, k, reach, contrast, beside, above, hits, n)
    return hits[:n]


@njit(cache=True)
def _look_at(image, i, first, end, k, reach, contrast, beside, above, hits, n):  # type: ignore[no-untyped-def]
    """Append the hits of a part of a row; their number."""
    for j in range(first, end):
        x = np.int64(image[i, j])
        if image[i, j - beside] > x or image[i, j + beside] > x or image[i - above, j] > x or image[i + above, j] > x:
            continue
        most = x - (((x >> 1) + 1) >> 2) - (x >> 4) - contrast  # that the second brightest may have
        if most < 0:
            continue
        a, b = np.int64(image[i, j - reach]), np.int64(image[i, j + reach])
        if a > most and b > most:
            continue
        c, d = np.int64(image[i - reach, j]), np.int64(image[i + reach, j])
        second = max(min(max(a, b), max(c, d)), max(min(a, b), min(c, d)))
        if second > most:
            continue
        hits[n, 0], hits[n, 1], hits[n, 2], hits[n, 3] = k, i, j, second
        n += 1
    return n


@njit(cache=True)
def _grown(table):  # type: ignore[no-untyped-def]
    """A copy with twice the rows."""
    longer = np.empty((2 * len(table), table.shape[1]), table.dtype)
    longer[: len(table)] = table
    return longer
