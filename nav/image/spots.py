"""Compact spots against a structured background: a threshold of its own for each, from the ring of pixels around it.

A spot of reach r is a peak P whose surroundings, the ring S_r of the n pixels at distance r +- 1/2 from its centre, are
all darker but for a few (an eighth: a neighbour, a glint, the rib that carries the LED):

    P - m >= max(c_min, k s(m), m - b)                                                    (1)
    s(x)^2 = g x + s_n^2                                                                  (2)

m is the brightest pixel of S_r that is left, b the mean of those not brighter than m, g [DN/e-] the gain, s_n read
noise and quantisation. An edge, a rib, a wave of the sea have bright pixels on their ring and fail, however bright they
are; the last term of (1) asks more of a spot where the ring itself is uneven. The spot's pixels are those above

    t = max(m, b + k s(b), b + f (P - b))                                                 (3)

connected to the peak (8 neighbours). If they reach the ring, t is raised halfway to the peak; if they still do, it is
no spot. Reaches are tried from the smallest up; pixels of a spot are not tried again.

Most of a frame is passed over by a necessary condition that vector instructions test: a pixel of the spot stands c_min
above the second brightest of the four pixels at distance r along rows and columns. Wide spots hold many such pixels,
so that only every second or fourth row is looked at for them. The frame's outside is dark.

Not modelled: spots of more than two thirds of the largest reach in radius, two spots closer than the smaller one's
reach that are both in the other's ring's brightest eighth. A bright compact feature of cloud, water or metal is a spot
as well: identification must tell.
"""

from dataclasses import dataclass

import numpy as np
from numba import njit
from numpy.typing import NDArray

from dockair.nav.image.binarise import Image
from dockair.nav.image.labelling import Runs
from dockair.rotations import Array

_REACH_PX = (4, 2, 8, 14)
_ROW_STEP = (2, 1, 3, 4)
_SEGMENT = 64  # pixels that are passed over at once
_CELL = 16  # of the grid that finds earlier spots; not less than the largest reach
_SPARE = 8  # one pixel in so many of a ring may be as bright as it likes


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Spots:
    """Components of the local binarisation, in raster order of their first pixel."""

    runs: Runs
    threshold_dn: NDArray[np.int64]  #: (n,) Eq. (3): its pixels are above
    background_dn: Array  #: (n,) b


def _ring(reach: int) -> NDArray[np.int32]:
    """(n, 2) steps (row, column) of S_r."""
    steps = np.indices((2 * reach + 3,) * 2).reshape(2, -1).T - reach - 1
    distance = np.hypot(*steps.T)
    return steps[np.abs(distance - reach) <= 0.5].astype(np.int32)


_RINGS = [_ring(reach) for reach in _REACH_PX]
_RING_STEPS = np.concatenate(_RINGS)
_RING_OFFSET = np.concatenate([[0], np.cumsum([len(r) for r in _RINGS])])
import os
_KAPPA=float(os.environ.get('KAPPA','1'))
_RHO=.04
_D2=np.zeros((20000,6))
_D = np.zeros(3, np.int64)
_REACHES, _STEPS = np.array(_REACH_PX), np.array(_ROW_STEP)


def find_spots(
    image: Image,
    *,
    min_contrast_dn: float,
    noise_factor: float,
    min_share: float,
    gain_dn_per_electron: float,
    noise_dn: float,
) -> Spots:
    """Spots of all reaches, Eqs. (1)-(3).

    Args:
        image: (rows, columns) uint8 or uint16.
        min_contrast_dn: c_min; at least 1.
        noise_factor: k.
        min_share: f.
        gain_dn_per_electron: g.
        noise_dn: s_n.
    """
    least = image.dtype.type(min(max(np.ceil(min_contrast_dn), 1.0), np.iinfo(image.dtype).max))
    row, start, stop, offset, threshold, background = _find(
        np.ascontiguousarray(image), image.dtype.type(0), least, image.dtype.type(12 * least), noise_factor, min_share, gain_dn_per_electron, noise_dn,
        _REACHES, _STEPS, _RING_STEPS, _RING_OFFSET, _D, _D2,_RHO,
    )  # fmt: skip
    return Spots(
        runs=Runs(row=row, start=start, stop=stop, offset=offset), threshold_dn=threshold, background_dn=background
    )


@njit()
def _contrast(centre, above, below, left, right, zero):  # type: ignore[no-untyped-def]
    """Largest contrast of a segment's pixels to the second brightest of their four neighbours at one reach.

    Slices that are indexed from 0, and one type throughout: only so are vector instructions made of it.
    """
    best = zero
    for k in range(_SEGMENT):
        high_1, low_1 = max(above[k], below[k]), min(above[k], below[k])
        high_2, low_2 = max(left[k], right[k]), min(left[k], right[k])
        second = max(min(high_1, high_2), max(low_1, low_2))
        raised = centre.dtype.type(min(second, 223) + (second >> 3))
        best = max(best, centre.dtype.type(max(centre[k], raised) - raised))
    return best


@njit()
def _climb(image, i, j, reach):  # type: ignore[no-untyped-def]
    """The local maximum above a pixel, at most 2 reach steps away."""
    rows, columns = image.shape
    for _ in range(2 * reach):
        top, left = i, j
        for a in range(max(i - 1, 0), min(i + 2, rows)):
            for b in range(max(j - 1, 0), min(j + 2, columns)):
                if image[a, b] > image[top, left]:
                    top, left = a, b
        if top == i and left == j:
            break
        i, j = top, left
    return i, j


@njit()
def _extent(image, i, j, di, dj, level, reach):  # type: ignore[no-untyped-def]
    """Steps from (i, j) along (di, dj) over pixels above the level; more than 2 reach - 1 are not counted."""
    rows, columns = image.shape
    n = 0
    while n < 2 * reach:
        a, b = i + (n + 1) * di, j + (n + 1) * dj
        if a < 0 or a >= rows or b < 0 or b >= columns or image[a, b] <= level:
            break
        n += 1
    return n


@njit()
def _middle(image, i, j, level, reach):  # type: ignore[no-untyped-def]
    """Middle of the pixels above the level along the column, then the row; row -1 if they are too many."""
    for _ in range(2):
        up, down = _extent(image, i, j, -1, 0, level, reach), _extent(image, i, j, 1, 0, level, reach)
        if up + down + 1 >= 2 * reach:
            return -1, -1
        i += (down - up) // 2
        left, right = _extent(image, i, j, 0, -1, level, reach), _extent(image, i, j, 0, 1, level, reach)
        if left + right + 1 >= 2 * reach:
            return -1, -1
        j += (right - left) // 2
    return i, j


@njit()
def _surroundings(image, i, j, ring, limit, brightest):  # type: ignore[no-untyped-def]
    """m and b of Eq. (1), with the spare brightest left out; m = -1 as soon as it is above the limit."""
    spare = len(ring) // _SPARE
    brightest[: spare + 1] = -1
    total = 0
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
    for k in range(spare):
        total -= brightest[k]
    return brightest[spare], total / (len(ring) - spare)


@njit()
def _flood(image, i, j, ci, cj, level, reach, patch, stack):  # type: ignore[no-untyped-def]
    """Mark the pixels above the level that are connected to (i, j) in the patch around (ci, cj): 1 if they are a spot.

    0: they reach the ring, or one is brighter than (i, j): another's peak.
    """
    patch[: 2 * reach + 1, : 2 * reach + 1] = 0
    limit = (reach - 0.5) ** 2
    if (i - ci) ** 2 + (j - cj) ** 2 >= limit:
        return False
    peak = image[i, j]
    stack[0, 0], stack[0, 1] = i, j
    patch[i - ci + reach, j - cj + reach] = 1
    depth = 1
    while depth > 0:
        depth -= 1
        p, q = stack[depth, 0], stack[depth, 1]
        for a in range(p - 1, p + 2):
            for b in range(q - 1, q + 2):
                u, v = a - ci, b - cj
                if patch[u + reach, v + reach] or image[a, b] <= level:
                    continue
                if u * u + v * v >= limit:
                    if reach == 2:
                        continue
                    return False
                if image[a, b] > peak:
                    return False
                patch[u + reach, v + reach] = 1
                stack[depth, 0], stack[depth, 1] = a, b
                depth += 1
    return True


@njit()
def _grown(array):  # type: ignore[no-untyped-def]
    wide = np.empty(2 * len(array), array.dtype)
    wide[: len(array)] = array
    return wide


@njit()
def _find(image, zero, least, wide, factor, share, gain, noise, reaches, steps, rings, ring_offset, debug, debug2,rho):  # type: ignore[no-untyped-def]
    rows, columns = image.shape
    row, start, stop = np.empty(512, np.int32), np.empty(512, np.int32), np.empty(512, np.int32)
    offset = np.zeros(64, np.int32)
    threshold, background = np.empty(64, np.int64), np.empty(64)
    head = np.full((rows // _CELL + 3, columns // _CELL + 3), -1, np.int32)
    following = np.empty(64, np.int32)
    largest = reaches[-1]
    patch = np.zeros((2 * largest + 1, 2 * largest + 1), np.uint8)
    stack = np.empty((patch.size, 2), np.int32)
    brightest = np.empty(len(rings) // _SPARE + 2, np.int64)
    n, count = 0, 0
    hits, rt, fl = 0, 0, 0
    for scale in range(len(reaches)):
        reach = reaches[scale]
        c_min = least if scale < 2 else wide
        ring = rings[ring_offset[scale] : ring_offset[scale + 1]]
        for i in range(reach, rows - reach, steps[scale]):
            for s in range(reach, columns - reach, _SEGMENT):
                e = min(s + _SEGMENT, columns - reach)
                z = max(min(s, columns - reach - _SEGMENT), reach)
                if columns >= 2 * reach + _SEGMENT and _contrast(
                    image[i, z:z+_SEGMENT], image[i - reach, z:z+_SEGMENT], image[i + reach, z:z+_SEGMENT],
                    image[i, z - reach : z - reach+_SEGMENT], image[i, z + reach : z + reach+_SEGMENT], zero
                )<c_min:
                    continue
                last_i, last_j = -1, -1
                for j in range(s, e):
                    x = np.int64(image[i, j])
                    a, b = np.int64(image[i - reach, j]), np.int64(image[i + reach, j])
                    c, d = np.int64(image[i, j - reach]), np.int64(image[i, j + reach])
                    second = max(min(max(a, b), max(c, d)), max(min(a, b), min(c, d)))
                    if x - second - (second>>3) < c_min:
                        continue
                    hits += 1
                    pi, pj = _climb(image, i, j, reach)
                    if pi == last_i and pj == last_j:
                        continue
                    last_i, last_j = pi, pj
                    # earlier spots
                    claimed = False
                    gi, gj = pi // _CELL + 1, pj // _CELL + 1
                    for u in range(gi - 1, gi + 2):
                        for v in range(gj - 1, gj + 2):
                            k = head[u, v]
                            while k >= 0 and not claimed:
                                for r in range(offset[k], offset[k + 1]):
                                    if row[r] == pi and start[r] <= pj < stop[r]:
                                        claimed = True
                                k = following[k]
                    if claimed:
                        continue
                    peak = np.int64(image[pi, pj])
                    ci, cj = _middle(image, pi, pj, (peak + second) // 2, reach)
                    if ci < reach or cj < reach or ci >= rows - reach or cj >= columns - reach:
                        continue
                    rt += 1
                    m, b_ = _surroundings(image, ci, cj, ring, peak - c_min, brightest)
                    if m < 0:
                        continue
                    contrast = peak - m
                    if contrast < factor * np.sqrt(gain * m + noise * noise+(rho*m)**2) or contrast < _KAPPA*(m - b_):
                        continue
                    fl += 1
                    lowest = b_ + max(factor * np.sqrt(gain * b_ + noise * noise+(.0*b_)**2), share * (peak - b_))
                    ok = False
                    for rise in (0.0, 0.125, 0.25, 0.5):
                        t = np.int64(lowest + rise * (peak - lowest))
                        if _flood(image, pi, pj, ci, cj, t, reach, patch, stack):
                            ok = True
                            break
                    if not ok:
                        continue
                    if count + 2 > len(offset):
                        offset, threshold, background = _grown(offset), _grown(threshold), _grown(background)
                        following = _grown(following)
                    for u in range(2 * reach + 1):
                        inside = False
                        for v in range(2 * reach + 2):
                            on = v <= 2 * reach and patch[u, v] == 1
                            if on == inside:
                                continue
                            if on:
                                if n == len(row):
                                    row, start, stop = _grown(row), _grown(start), _grown(stop)
                                row[n], start[n] = ci - reach + u, cj - reach + v
                            else:
                                stop[n] = cj - reach + v
                                n += 1
                            inside = on
                    threshold[count], background[count] = t, b_
                    debug2[count,0]=scale; debug2[count,1]=peak; debug2[count,2]=m; debug2[count,3]=b_; debug2[count,4]=rise; debug2[count,5]=lowest
                    gi, gj = ci // _CELL + 1, cj // _CELL + 1
                    following[count] = head[gi, gj]
                    head[gi, gj] = count
                    count += 1
                    offset[count] = n
    debug[0], debug[1], debug[2] = hits, rt, fl
    return row[:n], start[:n], stop[:n], offset[: count + 1], threshold[:count], background[:count]
