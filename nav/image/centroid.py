"""Centre of each blob, its standard deviation, and whether it was clipped.

Weighted by the intensity above the background b, over the blob's pixels and those that touch it:

    w_i = I_i - b,   F = sum w_i,   u = sum w_i u_i / F,   v = sum w_i v_i / F          [Yoon 2018, eqs 2-3]   (1)
    sigma_u^2 = sum (u_i - u)^2 s_i^2 / F^2 + (sum (u_i - u))^2 s_b^2 / F^2                                    (2)
    s_i^2 = g I_i + s_n^2 + (p w_i)^2 + s_t^2                                                                  (3)

b is the mean of the pixels two and three away from the blob, if they are not above the threshold (a mean, since a
median of quantised levels is off by up to half a level), else a given one; s_b is its standard deviation. g [DN/e-]
turns shot noise into digital numbers; s_n holds read noise and quantisation, p is the spread of the pixels' responses,
s_t^2 what the background varies by beyond its noise.

Windowed, which flies: the same sums over the same pixels, with a window G around the centre; it solves

    sum G_i w_i (u_i - u) = 0,   sum G_i w_i (v_i - v) = 0,   G_i = (1 - d_i^2 / R^2)^2 for d_i < R             (4)
    sigma_u^2 = sum G_i^2 (u_i - u)^2 s_i^2 / J^2,   J = sum w_i [G_i - 4 sqrt(G_i) (u_i - u)^2 / R^2]          (5)

by Newton steps, J being the derivative. d_i is the distance from (u, v), R a multiple of the blob's equivalent radius.
A constant error of b drops out, the skirt's noise enters less, and a canopy's edge beside the LED pulls less: half the
error of (1) where the background is dark and even, a fifth where it is not.

To (2) and (5) comes a floor for what is not noise: the sub-pixel phase of an undersampled spot. A clipped blob has lost
its core, inside the plateau every pixel weighs the same, and its error is almost all phase: 0.01 to 0.05 px, up and
down with brightness as one ring of pixels after another fills. A wider window is its better estimate, and a larger
floor, the rms over brightness, stands for what is left; it falls with the root of the blob's area.

Not modelled: asymmetric spots, neighbours closer than three pixels, smear.
Sources: the window's idea is that of SExtractor's XWIN_IMAGE (Bertin & Arnouts 1996).
"""

from dataclasses import dataclass

import numpy as np
from numba import njit
from numpy.typing import NDArray

from dockair.nav.image.binarise import Image
from dockair.nav.image.labelling import Runs
from dockair.rotations import Array

_MIN_BACKGROUND_PIXELS = 12  # fewer say less about b than the whole frame does
_WINDOW_RADII = 1.9  # R in equivalent radii of the blob: least error from 2 m to 30 m
_CLIPPED_WINDOW_RADII = 2.8
_LEAST_WINDOW_PX = 1.9
_CORRELATION = 2.0  # neighbouring pixels of structure go together: their variance counts as often
_RINGS_SHARE = 0.01  # of the peak: rms of the lens's rings two and three pixels outside a blob
_STEPS = 12  # Newton's; four are the rule
_CONVERGED_PX = 1e-5


@dataclass(frozen=True, slots=True, kw_only=True)
class NoiseModel:
    """What Eqs. (2)-(3) need to know of the camera; levels in DN of the frame that is measured."""

    gain_dn_per_electron: float
    noise_dn: float  #: read noise and quantisation; shot noise comes from the pixels' levels
    saturation_dn: int
    floor_px: float
    clipped_floor_px: float  #: of one pixel; falls with the root of the area
    response_spread: float = 0.0  #: p


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class BlobMeasurements:
    """One row a blob. Coordinates (u, v) = (column, row) of the image that was measured."""

    centroids_px: Array  #: (n, 2)
    sigma_px: Array  #: (n,) of each coordinate, the larger of the two
    flux: Array  #: (n,) F [DN]
    peak: NDArray[np.int64]  #: (n,) brightest pixel [DN], background included
    clipped: NDArray[np.bool_]  #: (n,) a pixel is at or above the saturation level
    elongation: Array  #: (n,) ratio of the longer to the shorter axis of the blob's pixels


def measure_blobs(
    image: Image,
    runs: Runs,
    threshold: int | NDArray[np.int64],
    noise: NoiseModel,
    *,
    background_dn: float | Array,
    local_background: bool = True,
    windowed: bool = False,
) -> BlobMeasurements:
    """Measure every component.

    Args:
        image: (rows, columns) uint8 or uint16.
        runs: its components.
        threshold: level they were made with [DN], or each one's own (n,).
        noise: the camera's noise.
        background_dn: of the frame [DN], or each one's own (n,).
        local_background: take b around each blob instead, where there is enough of it.
        windowed: Eqs. (4) and (5), else (1) and (2).
    """
    thresholds, backgrounds = np.empty(runs.count, np.int64), np.empty(runs.count)
    thresholds[:], backgrounds[:] = threshold, background_dn
    table = _measure(
        np.ascontiguousarray(image), runs.row, runs.start, runs.stop, runs.offset, thresholds,
        (noise.gain_dn_per_electron, noise.noise_dn, noise.response_spread), backgrounds, local_background,
        windowed, noise.saturation_dn,
    )  # fmt: skip
    clipped = table[:, 4] >= noise.saturation_dn
    floor = np.where(clipped, noise.clipped_floor_px / np.sqrt(runs.area_px), noise.floor_px)
    return BlobMeasurements(
        centroids_px=table[:, :2].copy(),
        sigma_px=np.hypot(table[:, 2], floor),
        flux=table[:, 3].copy(),
        peak=table[:, 4].astype(np.int64),
        clipped=clipped,
        elongation=table[:, 5].copy(),
    )


@njit(cache=True)
def _paint(row, start, stop, top, left, rows, columns):  # type: ignore[no-untyped-def]
    """Patch of 2 for the blob's pixels, 1 for those that touch it, 0 elsewhere."""
    patch = np.zeros((rows, columns), np.uint8)
    for k in range(len(row)):
        for i in range(max(row[k] - 1 - top, 0), min(row[k] + 2 - top, rows)):
            for j in range(max(start[k] - 1 - left, 0), min(stop[k] + 1 - left, columns)):
                patch[i, j] = max(patch[i, j], 1)
        patch[row[k] - top, start[k] - left : stop[k] - left] = 2
    return patch


@njit(cache=True)
def _background(image, patch, top, left, threshold):  # type: ignore[no-untyped-def]
    """Mean and variance of the patch's pixels outside the blob and not above the threshold, and their number."""
    total, squares, n = 0.0, 0.0, 0
    for i in range(patch.shape[0]):
        for j in range(patch.shape[1]):
            level = float(image[top + i, left + j])
            if patch[i, j] == 0 and level <= threshold:
                total += level
                squares += level * level
                n += 1
    mean = total / max(n, 1)
    return mean, squares / max(n, 1) - mean * mean, n


@njit(cache=True)
def _elongation(patch):  # type: ignore[no-untyped-def]
    """Ratio of the axes of the blob's pixels, each a unit square (hence the 1/12)."""
    n, si, sj, sii, sij, sjj = 0, 0.0, 0.0, 0.0, 0.0, 0.0
    for i in range(patch.shape[0]):
        for j in range(patch.shape[1]):
            if patch[i, j] == 2:
                n += 1
                si += i
                sj += j
                sii += i * i
                sij += i * j
                sjj += j * j
    a, b, c = sii / n - (si / n) ** 2 + 1 / 12, sij / n - si * sj / n**2, sjj / n - (sj / n) ** 2 + 1 / 12
    root = np.sqrt((a - c) ** 2 + 4 * b * b)
    return np.sqrt((a + c + root) / max(a + c - root, 1e-9))


@njit(cache=True)
def _variance(level, background, model, texture):  # type: ignore[no-untyped-def]
    """Eq. (3)."""
    gain, noise, spread = model
    return gain * level + noise * noise + (spread * (level - background)) ** 2 + texture


@njit(cache=True)
def _weighted(image, patch, top, left, model, background, texture, background_variance):  # type: ignore[no-untyped-def]
    """Eqs. (1)-(3) on one patch, in its coordinates: u, v, sigma, flux."""
    flux, su, sv = 0.0, 0.0, 0.0
    for i in range(patch.shape[0]):
        for j in range(patch.shape[1]):
            if patch[i, j]:
                w = image[top + i, left + j] - background
                flux += w
                su += w * j
                sv += w * i
    flux = max(flux, 1e-9)
    u, v = su / flux, sv / flux
    var_u, var_v, du, dv = 0.0, 0.0, 0.0, 0.0
    for i in range(patch.shape[0]):
        for j in range(patch.shape[1]):
            if patch[i, j]:
                variance = _variance(float(image[top + i, left + j]), background, model, texture)
                var_u += (j - u) ** 2 * variance
                var_v += (i - v) ** 2 * variance
                du += j - u
                dv += i - v
    var_u += du * du * background_variance
    var_v += dv * dv * background_variance
    return u, v, np.sqrt(max(var_u, var_v)) / flux, flux


@njit(cache=True)
def _start(image, patch, top, left, threshold):  # type: ignore[no-untyped-def]
    """Centre of what the blob's pixels have above the threshold, their number and the brightest."""
    total, u, v, n, peak = 0.0, 0.0, 0.0, 0, 0
    for i in range(patch.shape[0]):
        for j in range(patch.shape[1]):
            if patch[i, j] == 2:
                level = int(image[top + i, left + j])
                w = float(level - threshold)
                total += w
                u += w * j
                v += w * i
                n += 1
                peak = max(peak, level)
    total = max(total, 1e-9)
    return u / total, v / total, n, peak


@njit(cache=True)
def _window_sums(image, patch, top, left, u, v, radius, model, background, texture):  # type: ignore[no-untyped-def]
    """Sums of Eqs. (4) and (5) for both coordinates: equation, derivative, variance of the equation."""
    sums = np.zeros(6)
    for i in range(max(int(np.ceil(v - radius)), 0), min(int(v + radius) + 1, patch.shape[0])):
        for j in range(max(int(np.ceil(u - radius)), 0), min(int(u + radius) + 1, patch.shape[1])):
            dv, du = i - v, j - u
            root = 1.0 - (du * du + dv * dv) / radius**2
            if root <= 0.0 or not patch[i, j]:
                continue
            level = float(image[top + i, left + j])
            G, w = root * root, level - background
            variance = _variance(level, background, model, texture)
            sums[0] += G * w * du
            sums[1] += G * w * dv
            sums[2] += w * (G - 4.0 * root * du * du / radius**2)
            sums[3] += w * (G - 4.0 * root * dv * dv / radius**2)
            sums[4] += G * G * du * du * variance
            sums[5] += G * G * dv * dv * variance
    return sums


@njit(cache=True)
def _windowed(image, patch, top, left, start, radius, model, background, texture):  # type: ignore[no-untyped-def]
    """Eqs. (4) and (5) from a start, in the patch's coordinates: u, v, sigma; sigma -1 if the steps go astray."""
    u, v = start
    for _ in range(_STEPS):
        sums = _window_sums(image, patch, top, left, u, v, radius, model, background, texture)
        if sums[2] <= 0.0 or sums[3] <= 0.0:
            return u, v, -1.0
        du, dv = sums[0] / sums[2], sums[1] / sums[3]
        u, v = u + du, v + dv
        if (u - start[0]) ** 2 + (v - start[1]) ** 2 > 0.25 * radius**2:
            return u, v, -1.0
        if abs(du) + abs(dv) < _CONVERGED_PX:
            break
    return u, v, np.sqrt(max(sums[4] / sums[2] ** 2, sums[5] / sums[3] ** 2))


@njit(cache=True)
def _measure(image, row, start, stop, offset, threshold, model, given_background, local, windowed, saturation):  # type: ignore[no-untyped-def]
    table = np.empty((len(offset) - 1, 6))
    margin = 3
    for c in range(len(table)):
        first, last = offset[c], offset[c + 1]
        top, bottom = max(row[first] - margin, 0), min(row[last - 1] + 1 + margin, image.shape[0])
        left = max(start[first:last].min() - margin, 0)
        right = min(stop[first:last].max() + margin, image.shape[1])
        patch = _paint(row[first:last], start[first:last], stop[first:last], top, left, bottom - top, right - left)
        background, spread, n = _background(image, patch, top, left, threshold[c])
        if not local or n < _MIN_BACKGROUND_PIXELS:
            background, spread, n = given_background[c], 0.0, 1 << 30
        own = _variance(background, background, model, 0.0)
        su, sv, area, peak = _start(image, patch, top, left, threshold[c])
        clipped = peak >= saturation
        # the lens's own rings vary too, but alike on all sides: they are no texture
        rings = (_RINGS_SHARE * (peak - background)) ** 2
        texture = 0.0 if clipped else _CORRELATION * max(spread - own - rings, 0.0)
        u, v, sigma, flux = _weighted(image, patch, top, left, model, background, texture, (own + texture) / n)
        if windowed:
            radii = _CLIPPED_WINDOW_RADII if clipped else _WINDOW_RADII
            radius = max(radii * np.sqrt(area / np.pi), _LEAST_WINDOW_PX)
            found = _windowed(image, patch, top, left, (su, sv), radius, model, background, texture)
            if found[2] >= 0.0:
                u, v, sigma = found
        table[c, 0], table[c, 1], table[c, 2], table[c, 3], table[c, 4] = u + left, v + top, sigma, flux, peak
        table[c, 5] = _elongation(patch)
    return table
