"""Intensity-weighted centre of each blob, its standard deviation, and whether it was clipped.

    w_i = I_i - b                                                                         (1)
    F = sum w_i,   u = sum w_i u_i / F,   v = sum w_i v_i / F                [Yoon 2018, eqs 2-3]
    sigma_u^2 = sum (u_i - u)^2 s_i^2 / F^2 + (sum (u_i - u))^2 s_b^2 / F^2               (2)
    s_i^2 = g max(w_i, 0) + s_n^2                                                         (3)

over the blob's pixels and those that touch it: the threshold cuts the point-spread function, and its skirt carries
what the threshold would bias. b is the mean of the pixels two and three away from the blob, if they are below the
threshold (a mean, since a median of quantised levels is off by up to half a level), else the frame's background; s_b is
its standard deviation. g [DN/e-] turns shot noise into digital numbers; s_n holds read noise, dark sky and
quantisation. To (2) comes a floor for what is not noise: the sub-pixel phase of an undersampled spot and its cut skirt.

A clipped blob has lost its core: inside the plateau every pixel weighs the same. Its centre is still the best of the
simple ones, but (2) does not know the loss; a larger floor stands for it.

Not modelled: asymmetric spots, neighbours closer than three pixels, smear.
"""

from dataclasses import dataclass

import numpy as np
from numba import njit
from numpy.typing import NDArray

from dockair.nav.image.binarise import Image
from dockair.nav.image.labelling import Runs
from dockair.rotations import Array

_MIN_BACKGROUND_PIXELS = 12  # fewer say less about b than the whole frame does


@dataclass(frozen=True, slots=True, kw_only=True)
class NoiseModel:
    """What Eqs. (2)-(3) need to know of the camera; levels in DN of the frame that is measured."""

    gain_dn_per_electron: float
    noise_dn: float
    saturation_dn: int
    floor_px: float
    clipped_floor_px: float


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
    image: Image, runs: Runs, threshold: int, noise: NoiseModel, *, background_dn: float, local_background: bool = True
) -> BlobMeasurements:
    """Measure every component.

    Args:
        image: (rows, columns) uint8 or uint16.
        runs: its components.
        threshold: level they were made with [DN].
        noise: the camera's noise.
        background_dn: of the frame [DN].
        local_background: take b around each blob instead, where there is enough of it.
    """
    table = _measure(
        np.ascontiguousarray(image), runs.row, runs.start, runs.stop, runs.offset, threshold,
        noise.gain_dn_per_electron, noise.noise_dn, background_dn, local_background,
    )  # fmt: skip
    clipped = table[:, 4] >= noise.saturation_dn
    floor = np.where(clipped, noise.clipped_floor_px, noise.floor_px)
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
    """Mean of the patch's pixels outside the blob and below the threshold, and their number."""
    total, n = 0.0, 0
    for i in range(patch.shape[0]):
        for j in range(patch.shape[1]):
            level = image[top + i, left + j]
            if patch[i, j] == 0 and level <= threshold:
                total += level
                n += 1
    return total / max(n, 1), n


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
def _measure_one(image, patch, top, left, gain, noise, background, background_variance):  # type: ignore[no-untyped-def]
    """Eqs. (1)-(3) on one patch: u, v, sigma, flux, peak."""
    rows, columns = patch.shape
    flux, su, sv, peak = 0.0, 0.0, 0.0, 0.0
    for i in range(rows):
        for j in range(columns):
            if patch[i, j]:
                level = float(image[top + i, left + j])
                w = level - background
                flux += w
                su += w * j
                sv += w * i
                if patch[i, j] == 2:
                    peak = max(peak, level)
    flux = max(flux, 1e-9)
    u, v = su / flux, sv / flux
    var_u, var_v, du, dv = 0.0, 0.0, 0.0, 0.0
    for i in range(rows):
        for j in range(columns):
            if patch[i, j]:
                variance = gain * max(image[top + i, left + j] - background, 0.0) + noise * noise
                var_u += (j - u) ** 2 * variance
                var_v += (i - v) ** 2 * variance
                du += j - u
                dv += i - v
    var_u += du * du * background_variance
    var_v += dv * dv * background_variance
    return u + left, v + top, np.sqrt(max(var_u, var_v)) / flux, flux, peak


@njit(cache=True)
def _measure(image, row, start, stop, offset, threshold, gain, noise, frame_background, local):  # type: ignore[no-untyped-def]
    count = len(offset) - 1
    table = np.empty((count, 6))
    margin = 3
    for c in range(count):
        first, last = offset[c], offset[c + 1]
        top, bottom = max(row[first] - margin, 0), min(row[last - 1] + 1 + margin, image.shape[0])
        left = max(start[first:last].min() - margin, 0)
        right = min(stop[first:last].max() + margin, image.shape[1])
        patch = _paint(row[first:last], start[first:last], stop[first:last], top, left, bottom - top, right - left)
        background, n = _background(image, patch, top, left, threshold)
        if not local or n < _MIN_BACKGROUND_PIXELS:
            background, n = frame_background, 1 << 30
        table[c, :5] = _measure_one(image, patch, top, left, gain, noise, background, noise * noise / n)
        table[c, 5] = _elongation(patch)
    return table
