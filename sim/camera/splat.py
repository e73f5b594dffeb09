"""Adding blobs to an image: a tabulated core, a formula for the wings, a straight smear.

A blob of E electrons is E (core + W_R) about its place. The core is interpolated bilinearly between tabulated positions
in the pixel and by a parabola between three tabulated depths. The wings W = A (r^2 + w^2)^(-3/2) end at the radius R
where E W falls to `FAINTEST_E`; what they hold beyond is laid under the blob, smoothly, so that the sum stays E:

    W_R(r) = A P^-3 (t^(-3/2) - 1 - 3/2 s + c s^2),   P^2 = R^2 + w^2,   t = (r^2 + w^2)/P^2,   s = 1 - t          (1)
    c = 3 (2 + S + 3/4 S^2)/S^3,                      S = R^2/P^2                                                  (2)

W_R and its slope vanish at R, so nothing ends at an edge; the layer is at most 9 FAINTEST_E, at the centre.
A smear is the mean over K blobs along a line, spaced |smear|/sqrt(K^2 - 1): its variance is |smear|^2/12 for every K.

Every pixel is computed from its own row and column on the sensor, in one order of sources and sums: a window's pixels
are the full frame's, bit for bit.
"""

import math
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from dockair.kernels import njit
from dockair.rotations import Array

POINT = 6  #: columns: place u, v [px], electrons of the whole blob, depth [levels], smear du, dv [px]
FAINTEST_E = 0.1  #: electrons per pixel at which the wings end
SHORTEST_SMEAR_PX = 0.02  #: less counts as none: it adds 3e-5 px^2
_REACH_CORES = 1.5  # the wings reach at least this many half-widths of the core, over which W exceeds (1)'s tail
_REACH_WIDTHS = 1.5  # of a square's side: parts of it, or a patch of its variance, reach less far from its middle
_SPARE_PX = 1.0  # for rounding
_SMEAR_STEPS = 4.0  # blobs per pixel of smear; the wings, smooth over w, need 1/w

#: All cores one after the other; of each level: where its core begins, its half-width, its positions per pixel.
Tables: TypeAlias = tuple[NDArray[np.float32], NDArray[np.int64], NDArray[np.int64], NDArray[np.int64]]


@njit(cache=True)
def missing_levels(points: Array, made: NDArray[np.bool_], more: int) -> NDArray[np.int64]:
    """Return which of the tables that `splat` reads for these points, and so many more, are not made yet, each once."""
    wanted = np.zeros(made.shape[0], np.bool_)
    for i in range(points.shape[0]):
        middle = _middle(points[i, 3], made.shape[0])
        wanted[max(middle - 1 - more, 0) : middle + 2 + more] = True
    return np.flatnonzero(wanted & ~made)


@njit(cache=True, error_model="numpy")
def reach_window(
    shape: tuple[int, int],
    start: tuple[int, int],
    pixels: Array,
    smear: Array,
    electrons: Array,
    faintest: float,
    width_px: Array,
    widest_px: int,
    wing: tuple[float, float],
) -> NDArray[np.int64]:
    """Return which blobs may add to a pixel of a window; those left out surely do not.

    Args:
        shape: rows and columns of the window.
        start: (row, column) of its first pixel.
        pixels: (n, 2) true positions (u, v).
        smear: (n, 2) ways of the middles [px].
        electrons: (n,) of each whole blob.
        faintest: no blob with so few electrons counts.
        width_px: (n,) sides of the sources.
        widest_px: half-width of the widest core there is.
        wing: A and w.
    """
    near, count = np.empty(pixels.shape[0], np.int64), 0
    for i in range(pixels.shape[0]):
        (u, v), E = pixels[i], electrons[i]
        if not (E > faintest and math.isfinite(u) and math.isfinite(v)):
            continue
        length = math.hypot(smear[i, 0], smear[i, 1])
        reach = _reach(E, widest_px, wing) + length + _REACH_WIDTHS * width_px[i] + _SPARE_PX
        if not _is_outside(shape, start, u, v, reach):
            near[count] = i
            count += 1
    return near[:count]


@njit(cache=True, error_model="numpy")
def splat(
    image: NDArray[np.float32],
    start: tuple[int, int],
    points: Array,
    tables: Tables,
    wing: tuple[float, float],
) -> None:
    """Add blobs to an image in place.

    Args:
        image: (rows, columns) expected electrons of the window.
        start: (row, column) of its first pixel.
        points: (n, POINT) true places on the sensor, depths in steps of the tables, ways of the middles during the
            exposure; those with places that are not finite are left out.
        tables: at least the three levels around each depth are filled.
        wing: A and w.
    """
    half_widths = tables[2]
    for u, v, E, level, du, dv in points:
        if not (E > 0.0 and math.isfinite(u) and math.isfinite(v)):
            continue
        middle = _middle(level, half_widths.shape[0])
        half = max(half_widths[middle - 1], half_widths[middle], half_widths[middle + 1])
        reach = _reach(E, half, wing)
        length = math.hypot(du, dv)
        if _is_outside(image.shape, start, u, v, reach + length):
            continue
        count = 2 + int(length / wing[1]) if length > SHORTEST_SMEAR_PX else 1
        for k in range(count):
            a = _along(k, count)
            _add_wings(image, start, u + a * du, v + a * dv, E / count, reach, wing)
        count = 2 + int(_SMEAR_STEPS * length) if length > SHORTEST_SMEAR_PX else 1
        for k in range(count):
            a = _along(k, count)
            _add_core(image, start, u + a * du, v + a * dv, E / count, level, middle, half, tables)


@njit(cache=True)
def _middle(level: float, count: int) -> int:
    """The middle one of the three levels that a depth is interpolated between; a NaN's is the first."""
    return min(max(int(level + 0.5), 1), count - 2) if level > 0.0 else 1


@njit(cache=True)
def _along(k: int, count: int) -> float:
    """Place of the k-th of `count` blobs along a smear of length 1."""
    return (k - 0.5 * (count - 1)) / math.sqrt(count * count - 1.0) if count > 1 else 0.0


@njit(cache=True, error_model="numpy")
def _reach(electrons: float, half: float, wing: tuple[float, float]) -> float:
    """R of Eq. (1), no less than the core asks for."""
    return max((wing[0] * electrons / FAINTEST_E) ** (1.0 / 3.0), _REACH_CORES * half)


@njit(cache=True)
def _is_outside(shape: tuple[int, int], start: tuple[int, int], u: float, v: float, reach: float) -> bool:
    """Whether a square about (u, v) misses the window."""
    return (
        u + reach < start[1]
        or u - reach > start[1] + shape[1] - 1
        or v + reach < start[0]
        or v - reach > start[0] + shape[0] - 1
    )


@njit(cache=True, error_model="numpy")
def _add_wings(
    image: NDArray[np.float32],
    start: tuple[int, int],
    u: float,
    v: float,
    electrons: float,
    reach: float,
    wing: tuple[float, float],
) -> None:
    """Add Eq. (1) about (u, v); single precision but for the distances along row and column."""
    A, w = wing
    P2 = reach * reach + w * w
    S = reach * reach / P2
    c = np.float32(3.0 * (2.0 + S + 0.75 * S * S) / (S * S * S))
    scale = np.float32(electrons * A / (P2 * math.sqrt(P2)))
    one, zero, three_halves = np.float32(1.0), np.float32(0.0), np.float32(1.5)
    first, last = max(math.ceil(u - reach), start[1]), min(math.floor(u + reach) + 1, start[1] + image.shape[1])
    top, bottom = max(math.ceil(v - reach), start[0]), min(math.floor(v + reach) + 1, start[0] + image.shape[0])
    if first >= last or top >= bottom:
        return
    across = np.empty(last - first, np.float32)
    for column in range(first, last):
        across[column - first] = (column - u) * (column - u) / P2
    for row in range(top, bottom):
        chord = reach * reach - (row - v) * (row - v)
        if chord <= 0.0:
            continue
        chord = math.sqrt(chord)
        left, right = max(math.ceil(u - chord), first), min(math.floor(u + chord) + 1, last)
        if left >= right:
            continue
        down = np.float32(((row - v) * (row - v) + w * w) / P2)
        x2 = across[left - first : right - first]
        line = image[row - start[0], left - start[1] : right - start[1]]
        for k in range(x2.shape[0]):
            t = x2[k] + down
            s = one - t
            line[k] += scale * max(one / (t * np.sqrt(t)) - one - s * (three_halves - c * s), zero)


@njit(cache=True, error_model="numpy")
def _add_core(
    image: NDArray[np.float32],
    start: tuple[int, int],
    u: float,
    v: float,
    electrons: float,
    level: float,
    middle: int,
    half: int,
    tables: Tables,
) -> None:
    """Add the interpolated core about (u, v)."""
    column, row = math.floor(u + 0.5), math.floor(v + 0.5)
    if _is_outside(image.shape, start, column, row, half):
        return
    core = np.zeros((2 * half + 1, 2 * half + 1), np.float32)
    d = level - middle
    _gather(core, middle - 1, 0.5 * d * (d - 1.0), abs(u - column), abs(v - row), tables)
    _gather(core, middle, 1.0 - d * d, abs(u - column), abs(v - row), tables)
    _gather(core, middle + 1, 0.5 * d * (d + 1.0), abs(u - column), abs(v - row), tables)
    E = np.float32(electrons)
    left, right = max(column - half, start[1]), min(column + half + 1, start[1] + image.shape[1])
    for r in range(max(row - half, start[0]), min(row + half + 1, start[0] + image.shape[0])):
        away = r - row if v >= row else row - r  # tables are for points right of and below a pixel's centre
        line, part = image[r - start[0]], core[away + half]
        if u >= column:
            for k in range(left, right):
                line[k - start[1]] += E * part[k - column + half]
        else:
            for k in range(left, right):
                line[k - start[1]] += E * part[column - k + half]


@njit(cache=True, error_model="numpy")
def _gather(
    core: NDArray[np.float32],
    level: int,
    weight: float,
    right: float,
    down: float,
    tables: Tables,
) -> None:
    """Add `weight` x one level's core for a point `right` and `down` [0, 1/2 px] of a pixel's centre."""
    pool, begins, half_widths, phases_per_pixel = tables
    half, phases = half_widths[level], phases_per_pixel[level]
    n = 2 * half + 1
    last = phases // 2 - 1
    i, j = min(int(down * phases), last), min(int(right * phases), last)
    y, x = down * phases - i, right * phases - j
    w00, w01 = np.float32(weight * (1.0 - y) * (1.0 - x)), np.float32(weight * (1.0 - y) * x)
    w10, w11 = np.float32(weight * y * (1.0 - x)), np.float32(weight * y * x)
    at = begins[level] + (i * (phases // 2 + 1) + j) * n * n
    plane = n * n
    below = (phases // 2 + 1) * plane
    margin = core.shape[0] // 2 - half
    for r in range(n):
        a = pool[at + r * n : at + r * n + n]
        b = pool[at + plane + r * n : at + plane + r * n + n]
        c = pool[at + below + r * n : at + below + r * n + n]
        e = pool[at + below + plane + r * n : at + below + plane + r * n + n]
        line = core[margin + r, margin : margin + n]
        for k in range(n):
            line[k] += w00 * a[k] + w01 * b[k] + w10 * c[k] + w11 * e[k]
