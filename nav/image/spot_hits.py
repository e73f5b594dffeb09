"""Pixels that may belong to a spot: the pass over all pixels that comes before `spot_kernels`.

A pixel x is a hit when 13/16 x - n >= c, n the second brightest of the four pixels at distance r along its row and
column; of a small spot only a pixel that none of its neighbours outshines. Vector instructions test 64 at a time, in
whole numbers: 3/16 x is 0 up to 5, 1 from 6 and 2 from 14 on. Rows with no pixel as bright as c are passed over.
"""

import numpy as np

from dockair.kernels import njit
from dockair.nav.image.spot_kernels import grown

_SEGMENT = 64  # pixels that are passed over at once


@njit(cache=True)
def _may_hold(centre, above, below, left, right, contrast):  # type: ignore[no-untyped-def]
    """Whether a pixel of a segment has the contrast.

    A constant length, indices from 0, no type but the image's, and a flag instead of the largest contrast, which would
    have to be found across a vector: only so do 64 pixels become a few vector instructions.
    """
    found = False
    for k in range(_SEGMENT):
        high_1, low_1 = max(above[k], below[k]), min(above[k], below[k])
        high_2, low_2 = max(left[k], right[k]), min(left[k], right[k])
        second = max(min(high_1, high_2), max(low_1, low_2))
        x = centre.dtype.type(centre[k] - (((centre[k] >> 1) + 1) >> 2) - (centre[k] >> 4))
        if centre.dtype.type(max(x, second) - second) >= contrast:
            found = True
    return found


@njit(cache=True)
def _brightest(image):  # type: ignore[no-untyped-def]
    """(rows,) largest level of each row; on the way the image comes near, in the order of its addresses."""
    brightest = np.zeros(len(image), image.dtype)
    for i in range(len(image)):
        line, best = image[i], brightest[i]
        for k in range(len(line)):
            best = max(best, line[k])
        brightest[i] = best
    return brightest


@njit(cache=True)
def _segments(image, brightest, reach, row_step, contrast, found):  # type: ignore[no-untyped-def]
    """Rows and first columns of the segments that may hold a pixel of a spot, into `found`; their number.

    A loop of its own, which nothing else keeps from the registers.
    """
    n, end = 0, image.shape[1] - reach
    for i in range(reach, image.shape[0] - reach, row_step):
        if brightest[i] < contrast:  # no pixel has a contrast above its own level
            continue
        for first in range(reach, end, _SEGMENT):
            s = min(first, end - _SEGMENT)  # the last segment begins earlier than its own pixels
            e = s + _SEGMENT
            if s >= reach and not _may_hold(
                image[i, s:e], image[i - reach, s:e], image[i + reach, s:e],
                image[i, s - reach : e - reach], image[i, s + reach : e + reach], contrast,
            ):  # fmt: skip
                continue
            found[n, 0], found[n, 1] = i, first
            n += 1
    return n


@njit(cache=True)
def find_hits(image, reaches, row_steps, contrasts, wide):  # type: ignore[no-untyped-def]
    """(n, 4) which reach, row, column and n of the pixels that may belong to a spot, reach by reach.

    Args:
        image: contiguous.
        reaches: to look at.
        row_steps: of each, how many rows from one that is looked at to the next.
        contrasts: of each, what a pixel has to have, whole and not above the image's largest level.
        wide: reach from which on a spot may have many pixels of one level.
    """
    rows, columns = image.shape
    found = np.empty((rows * (columns // _SEGMENT + 1), 2), np.int32)  # touched only as far as it is used
    hits, n, brightest = np.empty((512, 4), np.int32), 0, _brightest(image)
    for k in range(len(reaches)):
        reach, contrast = reaches[k], contrasts[k]
        # the brightest of the neighbours that are looked at too speaks for its spot; 0 compares a pixel with itself
        beside, above = int(reach < wide), int(reach < wide and row_steps[k] == 1)
        for f in range(_segments(image, brightest, reach, row_steps[k], image.dtype.type(contrast), found)):
            i, first = found[f, 0], found[f, 1]
            while n + _SEGMENT > len(hits):
                hits = grown(hits)
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
