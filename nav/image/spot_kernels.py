"""From hits to spots: the loops of `spots`, whose symbols and equation numbers they use."""

import numpy as np
from numpy.typing import NDArray

from dockair.kernels import njit

REACHES_PX = (4, 2, 8, 14)  #: in the order in which they are tried
ROW_STEPS = (2, 1, 3, 4)  #: rows that are looked at: the smallest spots of a reach cover so many
WIDE_PX = 8  #: reaches from here on are of wide spots
CUT_PX = 2  #: reach at which a spot's pixels are cut at the ring
CELL_PX = 16  #: side of the cells that hold earlier spots, not less than the largest reach
SPARE = 9  #: one pixel in so many of a ring may be as bright as it likes
ARC = 5  #: pixels side by side of the smallest ring that may be as bright as they like: a side of the square
RISES = (0.0, 0.125, 0.25, 0.5)  #: h of Eq. (3)


def ring_steps(reach: int) -> NDArray[np.int32]:
    """(n, 2) steps (rows, columns) from a centre to the pixels of S_r."""
    steps = np.indices((2 * reach + 3,) * 2).reshape(2, -1).T - (reach + 1)
    if reach == CUT_PX:  # of the smallest circle the corners are needed, or diagonal ribs slip through; in order
        steps = steps[np.abs(steps).max(axis=1) == reach]
        steps = steps[np.argsort(np.arctan2(*steps.T))]
    else:
        steps = steps[np.abs(np.hypot(*steps.T) - reach) <= 0.5]
    return np.asarray(steps, np.int32)


_RINGS = np.concatenate([ring_steps(reach) for reach in REACHES_PX])
_RING_STARTS = tuple(sum(len(ring_steps(reach)) for reach in REACHES_PX[:k]) for k in range(len(REACHES_PX) + 1))


@njit(cache=True)
def grown(table):  # type: ignore[no-untyped-def]
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
    m, brighter = brightest[spare], 0
    while brighter < spare and brightest[brighter] > m:
        total -= brightest[brighter]
        brighter += 1
    return m, total / (len(ring) - brighter)


@njit(cache=True)
def _beside_an_arc(image, i, j, ring, limit, levels):  # type: ignore[no-untyped-def]
    """As `_surroundings` for the smallest ring, with the ARC pixels side by side left out that lessen m most.

    What of the arc is no brighter than m counts for b, which would be too low without noise's brightest.
    """
    n, bright, top = len(ring), 0, 0
    for k in range(n):
        levels[k] = image[i + ring[k, 0], j + ring[k, 1]]
        bright += levels[k] > limit
        if levels[k] > levels[top]:
            top = k
    if bright > ARC:
        return np.int64(-1), 0.0
    m = levels[top]
    for first in range(top - ARC + 1, top + 1):  # of no other arc is the brightest a part
        highest = np.int64(0)
        for k in range(first + ARC, first + n):
            highest = max(highest, levels[k % n])
        m = min(m, highest)
    if m > limit:
        return np.int64(-1), 0.0
    total, count = np.int64(0), 0
    for k in range(n):
        if levels[k] <= m:
            total += levels[k]
            count += 1
    return m, total / count


@njit(cache=True)
def _flood(image, peak, centre, level, reach, patch, stack):  # type: ignore[no-untyped-def]
    """Mark in the patch around the centre what is connected to the peak above the level; whether that is a spot.

    It is none if it meets the ring, or a pixel brighter than the peak: that one has a spot of its own. A peak alone is
    none either.
    """
    top, left, limit = centre[0] - reach, centre[1] - reach, (reach - 0.5) ** 2
    patch[: 2 * reach + 1, : 2 * reach + 1] = 0
    patch[peak[0] - top, peak[1] - left] = 1
    stack[0, 0], stack[0, 1], depth, count = peak[0], peak[1], 1, 1
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
                count += 1
    return count > 1


@njit(cache=True)
def _is_point(image, i, j, b, least, least_beside):  # type: ignore[no-untyped-def]
    """Eq. (2), its limits in DN."""
    total, brightest = 0.0, 0.0
    for u in range(-1, 2):
        for v in range(-1, 2):
            w = (2 - abs(u)) * (2 - abs(v)) * (image[i + u, j + v] - b)
            total += w
            if u or v:
                brightest = max(brightest, w)
    return total >= 6.0 * least and total - 4.0 * (image[i, j] - b) - brightest >= 4.0 * least_beside


@njit(cache=True)
def _cut_out(image, peak, centre, reach, ring, contrast, model, patch, stack):  # type: ignore[no-untyped-def]
    """Threshold t and background b of the spot of a peak, its pixels marked in the patch; t = -1 if there is none."""
    isolation, texture, detection, beside, pixel, share, gain, noise = model
    if (peak[0] - centre[0]) ** 2 + (peak[1] - centre[1]) ** 2 >= (reach - 0.5) ** 2:
        return -1, 0.0
    P = np.int64(image[peak])
    if reach == CUT_PX:
        m, b = _beside_an_arc(image, centre[0], centre[1], ring, P - contrast, stack[:, 0])
    else:
        m, b = _surroundings(image, centre[0], centre[1], ring, P - contrast, stack[:, 0])
    if m < 0 or P - m < max(np.sqrt(isolation**2 * (gain * m + noise**2) + (texture * m) ** 2), m - b):
        return -1, 0.0
    s = np.sqrt(gain * b + noise**2)
    if not _is_point(image, peak[0], peak[1], b, detection * s, max(beside * s, share * (P - b))):
        return -1, 0.0
    lowest = b + max(pixel * s, share * (P - b))
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
        runs = grown(runs)
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
def grow(image, hits, contrasts, model):  # type: ignore[no-untyped-def]
    """Spots of all reaches in raster order: runs' rows, starts, stops and each spot's first; levels; backgrounds.

    Args:
        image: contiguous.
        hits: of `find_hits`.
        contrasts: c of Eq. (1) for each of REACHES_PX, whole.
        model: k, q, d, e, p, f, g, s_n.
    """
    rows, columns = image.shape
    head = np.full((rows // CELL_PX + 3, columns // CELL_PX + 3), -1, np.int32)
    spots, backgrounds, runs = np.empty((64, 4), np.int32), np.empty((64, 1)), np.empty((1024, 3), np.int32)
    largest = 2 * max(REACHES_PX) + 1
    patch, stack = np.empty((largest, largest), np.uint8), np.empty((largest**2, 2), np.int64)
    count, n, last, scale = 0, 0, (-1, -1), -1
    for hit in hits:
        if hit[0] != scale:
            scale, last = hit[0], (-1, -1)
            reach, ring = REACHES_PX[scale], _RINGS[_RING_STARTS[scale] : _RING_STARTS[scale + 1]]
        peak = _climb(image, hit[1], hit[2], 2 * reach)
        if peak == last or _inside_earlier(peak[0], peak[1], head, spots, runs):
            continue
        last = peak
        i, j = _middle(image, peak[0], peak[1], (np.int64(image[peak]) + hit[3]) // 2, reach)
        if not (reach <= i < rows - reach and reach <= j < columns - reach):
            continue
        level, b = _cut_out(image, peak, (i, j), reach, ring, contrasts[scale], model, patch, stack)
        if level < 0:
            continue
        if count == len(spots):
            spots, backgrounds = grown(spots), grown(backgrounds)
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
