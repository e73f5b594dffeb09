"""The loops of `spots`, whose symbols and equation numbers they use."""

import numpy as np
from numba import njit
from numpy.typing import NDArray

REACHES_PX = (4, 2, 8, 14)  #: in the order in which they are tried
ROW_STEPS = (2, 1, 3, 4)  #: rows that are looked at: the smallest spots of a reach cover so many
WIDE_PX = 8  #: reaches from here on are of wide spots
CUT_PX = 2  #: reach at which a spot's pixels are cut at the ring
CELL_PX = 16  #: side of the cells that hold earlier spots, not less than the largest reach
SPARE = 9  #: one pixel in so many of a ring may be as bright as it likes
ARC = 3  #: pixels side by side of the smallest ring that may be as bright as they like
RISES = (0.0, 0.125, 0.25, 0.5)  #: h of Eq. (2)
_SEGMENT = 64  # pixels that are passed over at once


def ring_steps(reach: int) -> NDArray[np.int32]:
    """(n, 2) steps (rows, columns) from a centre to the pixels of S_r."""
    steps = np.indices((2 * reach + 3,) * 2).reshape(2, -1).T - (reach + 1)
    if reach == CUT_PX:  # of the smallest circle the corners are needed, or diagonal ribs slip through; in order
        steps = steps[np.abs(steps).max(axis=1) == reach]
        return steps[np.argsort(np.arctan2(*steps.T))].astype(np.int32)
    return steps[np.abs(np.hypot(*steps.T) - reach) <= 0.5].astype(np.int32)


_RINGS = np.concatenate([ring_steps(reach) for reach in REACHES_PX])
_RING_STARTS = tuple(sum(len(ring_steps(reach)) for reach in REACHES_PX[:k]) for k in range(len(REACHES_PX) + 1))


@njit(cache=True)
def _best_contrast(centre, above, below, left, right, zero):  # type: ignore[no-untyped-def]
    """Largest 7/8 x - n of a segment.

    A constant length, indices from 0 and no type but the image's: only so does it become vector instructions.
    """
    best = zero
    for k in range(_SEGMENT):
        high_1, low_1 = max(above[k], below[k]), min(above[k], below[k])
        high_2, low_2 = max(left[k], right[k]), min(left[k], right[k])
        second = max(min(high_1, high_2), max(low_1, low_2))
        x = centre.dtype.type(centre[k] - (centre[k] >> 3))
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
def _hits(image, zero, contrast, reach, row_step):  # type: ignore[no-untyped-def]
    """(n, 3) row, column and n of the pixels that may belong to a spot."""
    rows, columns = image.shape
    found = np.empty(columns // _SEGMENT + 1, np.int64)
    hits, n = np.empty((256, 3), np.int32), 0
    for i in range(reach, rows - reach, row_step):
        for first in found[: _segments(image, i, zero, contrast, reach, found)]:
            for j in range(first, min(first + _SEGMENT, columns - reach)):
                x = np.int64(image[i, j])
                most = x - (x >> 3) - contrast  # that the second brightest may have
                if most < 0:
                    continue
                a, b = np.int64(image[i, j - reach]), np.int64(image[i, j + reach])
                if a > most and b > most:
                    continue
                c, d = np.int64(image[i - reach, j]), np.int64(image[i + reach, j])
                second = max(min(max(a, b), max(c, d)), max(min(a, b), min(c, d)))
                if second > most:
                    continue
                if n == len(hits):
                    hits = _grown(hits)
                hits[n, 0], hits[n, 1], hits[n, 2] = i, j, second
                n += 1
    return hits[:n]


@njit(cache=True)
def _grown(table):  # type: ignore[no-untyped-def]
    """A copy with twice the rows."""
    longer = np.empty((2 * len(table), table.shape[1]), table.dtype)
    longer[: len(table)] = table
    return longer


@njit(cache=True)
def _climb(image, i, j, most):  # type: ignore[no-untyped-def]
    """The pixel that steepest ascent leads to, in at most so many steps."""
    rows, columns = image.shape
    for _ in range(most):
        top, left = i, j
        for a in range(max(i - 1, 0), min(i + 2, rows)):
            for b in range(max(j - 1, 0), min(j + 2, columns)):
                if image[a, b] > image[top, left]:
                    top, left = a, b
        if top == i and left == j:
            break
        i, j = top, left
    return i, j


@njit(cache=True)
def _extent(line, at, level, most):  # type: ignore[no-untyped-def]
    """First and last place around `at` where the line is above the level, and whether they are fewer than `most`."""
    first, last = at, at
    while first > 0 and last - first < most and line[first - 1] > level:
        first -= 1
    while last < len(line) - 1 and last - first < most and line[last + 1] > level:
        last += 1
    return first, last, last - first + 1 < most


@njit(cache=True)
def _middle(image, i, j, level, reach):  # type: ignore[no-untyped-def]
    """Middle of the pixels above the level, along the column, then the row, twice; row -1 if they are too many."""
    for _ in range(2):
        first, last, few = _extent(image[:, j], i, level, 2 * reach)
        i = (first + last) // 2
        left, right, few_too = _extent(image[i], j, level, 2 * reach)
        j = (left + right) // 2
        if not (few and few_too):
            return -1, -1
    return i, j


@njit(cache=True)
def _surroundings(image, i, j, ring, limit, brightest):  # type: ignore[no-untyped-def]
    """The levels m and b of Eq. (1); m = -1 as soon as it is above the limit."""
    spare = len(ring) // SPARE
    brightest[: spare + 1] = -1
    total = np.int64(0)
    for n in range(len(ring)):
        level = np.int64(image[i + ring[n, 0], j + ring[n, 1]])
        total += level
        if level <= brightest[spare]:
            continue
        k = spare
        while k > 0 and brightest[k - 1] < level:
            brightest[k] = brightest[k - 1]
            k -= 1
        brightest[k] = level
        if brightest[spare] > limit:
            return -1, 0.0
    return brightest[spare], (total - brightest[:spare].sum()) / (len(ring) - spare)


@njit(cache=True)
def _beside_an_arc(image, i, j, ring, limit):  # type: ignore[no-untyped-def]
    """As `_surroundings` for the smallest ring, with the ARC pixels side by side left out that lessen m most."""
    n, bright, total = len(ring), 0, np.int64(0)
    for k in range(n):
        level = np.int64(image[i + ring[k, 0], j + ring[k, 1]])
        bright += level > limit
        total += level
    m, best = np.int64(-1), 0
    if bright > ARC:
        return m, 0.0
    for first in range(n):
        highest = np.int64(0)
        for k in range(first + ARC, first + n):
            highest = max(highest, np.int64(image[i + ring[k % n, 0], j + ring[k % n, 1]]))
        if m < 0 or highest < m:
            m, best = highest, first
    for k in range(best, best + ARC):
        total -= image[i + ring[k % n, 0], j + ring[k % n, 1]]
    return (m if m <= limit else np.int64(-1)), total / (n - ARC)


@njit(cache=True)
def _flood(image, peak, centre, level, reach, patch, stack):  # type: ignore[no-untyped-def]
    """Mark in the patch around the centre what is connected to the peak above the level; whether that is a spot.

    It is none if it meets the ring, or a pixel brighter than the peak: that one has a spot of its own.
    """
    top, left, limit = centre[0] - reach, centre[1] - reach, (reach - 0.5) ** 2
    if (peak[0] - centre[0]) ** 2 + (peak[1] - centre[1]) ** 2 >= limit:
        return False
    patch[: 2 * reach + 1, : 2 * reach + 1] = 0
    patch[peak[0] - top, peak[1] - left] = 1
    stack[0, 0], stack[0, 1], depth = peak[0], peak[1], 1
    while depth > 0:
        depth -= 1
        i, j = stack[depth, 0], stack[depth, 1]
        for a in range(i - 1, i + 2):
            for b in range(j - 1, j + 2):
                if image[a, b] <= level or patch[a - top, b - left]:
                    continue
                if (a - centre[0]) ** 2 + (b - centre[1]) ** 2 >= limit:
                    if reach > CUT_PX:
                        return False
                    continue
                if image[a, b] > image[peak]:
                    return False
                patch[a - top, b - left] = 1
                stack[depth, 0], stack[depth, 1] = a, b
                depth += 1
    return True


@njit(cache=True)
def _cut_out(image, peak, centre, reach, ring, contrast, model, patch, stack):  # type: ignore[no-untyped-def]
    """Threshold t and background b of the spot of a peak, its pixels marked in the patch; t = -1 if there is none."""
    factor, share, texture, gain, noise = model
    P = np.int64(image[peak])
    if reach == CUT_PX:
        m, b = _beside_an_arc(image, centre[0], centre[1], ring, P - contrast)
    else:
        m, b = _surroundings(image, centre[0], centre[1], ring, P - contrast, stack[:, 0])
    if m < 0 or P - m < factor * np.sqrt(gain * m + noise**2 + (texture * m) ** 2) or P - m < m - b:
        return -1, 0.0
    lowest = b + max(factor * np.sqrt(gain * b + noise**2), share * (P - b))
    for rise in RISES:
        level = min(np.int64(lowest + rise * (P - lowest)), P - 1)  # rounding must not lift it to the peak
        if _flood(image, peak, centre, level, reach, patch, stack):
            return level, b
    return -1, 0.0


@njit(cache=True)
def _inside_earlier(i, j, head, spots, runs):  # type: ignore[no-untyped-def]
    """Whether a pixel belongs to a spot that is already known."""
    for u in range(i // CELL_PX, i // CELL_PX + 3):  # the cells have a margin of one
        for v in range(j // CELL_PX, j // CELL_PX + 3):
            k = head[u, v]
            while k >= 0:
                for r in range(spots[k, 0], spots[k, 1]):
                    if runs[r, 0] == i and runs[r, 1] <= j < runs[r, 2]:
                        return True
                k = spots[k, 2]
    return False


@njit(cache=True)
def _append_runs(patch, top, left, size, runs, n):  # type: ignore[no-untyped-def]
    """Runs of a patch behind the n that there are; the table and its new length."""
    while n + size * (size + 1) // 2 > len(runs):
        runs = _grown(runs)
    for u in range(size):
        v = 0
        while v < size:
            if not patch[u, v]:
                v += 1
                continue
            first = v
            while v < size and patch[u, v]:
                v += 1
            runs[n, 0], runs[n, 1], runs[n, 2] = top + u, left + first, left + v
            n += 1
    return runs, n


@njit(cache=True)
def find(image, zero, contrast, wide_contrast, model):  # type: ignore[no-untyped-def]
    """Spots of all reaches in raster order: runs' rows, starts, stops and each spot's first; levels; backgrounds.

    Args:
        image: contiguous.
        zero: of the image's type.
        contrast: c of Eq. (1), whole.
        wide_contrast: the same for spots of the wide reaches.
        model: k, f, q, g, s_n.
    """
    rows, columns = image.shape
    head = np.full((rows // CELL_PX + 3, columns // CELL_PX + 3), -1, np.int32)
    spots, backgrounds, runs = np.empty((64, 4), np.int32), np.empty((64, 1)), np.empty((1024, 3), np.int32)
    largest = 2 * max(REACHES_PX) + 1
    patch, stack = np.empty((largest, largest), np.uint8), np.empty((largest**2, 2), np.int64)
    count, n = 0, 0
    for scale in range(len(REACHES_PX)):
        reach, ring = REACHES_PX[scale], _RINGS[_RING_STARTS[scale] : _RING_STARTS[scale + 1]]
        c = wide_contrast if reach >= WIDE_PX else contrast
        last = (-1, -1)
        for hit in _hits(image, zero, c, reach, ROW_STEPS[scale]):
            peak = _climb(image, hit[0], hit[1], 2 * reach)
            if peak == last or _inside_earlier(peak[0], peak[1], head, spots, runs):
                continue
            last = peak
            i, j = _middle(image, peak[0], peak[1], (np.int64(image[peak]) + hit[2]) // 2, reach)
            if not (reach <= i < rows - reach and reach <= j < columns - reach):
                continue
            level, b = _cut_out(image, peak, (i, j), reach, ring, c, model, patch, stack)
            if level < 0:
                continue
            if count == len(spots):
                spots, backgrounds = _grown(spots), _grown(backgrounds)
            spots[count, 0], spots[count, 3], backgrounds[count, 0] = n, level, b
            runs, n = _append_runs(patch, i - reach, j - reach, 2 * reach + 1, runs, n)
            spots[count, 1], spots[count, 2] = n, head[i // CELL_PX + 1, j // CELL_PX + 1]
            head[i // CELL_PX + 1, j // CELL_PX + 1] = count
            count += 1
    return _in_raster_order(runs, spots[:count], backgrounds[:count, 0])


@njit(cache=True)
def _in_raster_order(runs, spots, backgrounds):  # type: ignore[no-untyped-def]
    """Runs' rows, starts, stops; each spot's first run; levels; backgrounds."""
    first = runs[spots[:, 0]]
    order = np.argsort(first[:, 0].astype(np.int64) * (1 << 32) + first[:, 1])
    offset = np.zeros(len(spots) + 1, np.int32)
    ordered = np.empty((3, (spots[:, 1] - spots[:, 0]).sum()), np.int32)
    n = 0
    for k in range(len(spots)):
        for r in range(spots[order[k], 0], spots[order[k], 1]):
            ordered[0, n], ordered[1, n], ordered[2, n] = runs[r, 0], runs[r, 1], runs[r, 2]
            n += 1
        offset[k + 1] = n
    return ordered[0], ordered[1], ordered[2], offset, spots[order, 3].astype(np.int64), backgrounds[order]
