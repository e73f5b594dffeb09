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

To (5) comes what a spot that is not round has merged with. Two points d apart with shares x and 1 - x of the light
have a centre x d away from the second, and second moments, windowed as in (4), that differ by a = x (1 - x) d^2 between
their longer and their shorter axis. If the LED has a third to a half of the light, that is an error of a/2 to a in each
coordinate's square; taken is

    sigma^2 += max(0, a - 1.5 s_a - 0.07 (M_uu + M_vv)),    s_a^2 = sum G_i^2 d_i^4 s_i^2 / (sum G_i w_i)^2    (6)

s_a being the noise of a, and the last term what phase and a tilted source make of a single point. A reflection in the
drogue's ribs a pixel or two beside a far LED is the rule in sunlight from 16 m on: without (6) errors are three sigma.

To (2) and (5) comes a floor for what is not noise: the sub-pixel phase of an undersampled spot. A clipped blob has lost
its core, inside the plateau every pixel weighs the same, and its error is almost all phase: 0.01 to 0.05 px, up and
down with brightness as one ring of pixels after another fills. A wider window is its better estimate, and a larger
floor, the rms over brightness, stands for what is left; it grows with the root of the clipped pixels up to four.

A centre outside the pixels it was made from (their sum above the background can vanish, where the threshold given is
below the background) is none: such a blob gets the centre of what its pixels have above the threshold, and the spread
of its width as sigma.

Not modelled: neighbours closer than three pixels but for (6), smear.
Sources: the window's idea is that of SExtractor's XWIN_IMAGE (Bertin & Arnouts 1996).
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from dockair.nav.image.binarise import Image
from dockair.nav.image.centroid_kernels import measure
from dockair.nav.image.labelling import Runs
from dockair.rotations import Array


@dataclass(frozen=True, slots=True, kw_only=True)
class NoiseModel:
    """What Eqs. (2)-(3) need to know of the camera; levels in DN of the frame that is measured."""

    gain_dn_per_electron: float
    noise_dn: float  #: read noise and quantisation; shot noise comes from the pixels' levels
    saturation_dn: int
    floor_px: float
    clipped_floor_px: float  #: of one clipped pixel; grows with their root up to four
    response_spread: float = 0.0  #: p


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class BlobMeasurements:
    """One row a blob. Coordinates (u, v) = (column, row) of the image that was measured."""

    centroids_px: Array  #: (n, 2)
    sigma_px: Array  #: (n,) of each coordinate, the larger of the two
    flux: Array  #: (n,) F [DN]; above the threshold where F is not positive
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
    thresholds = threshold if isinstance(threshold, np.ndarray) else np.full(runs.count, threshold, np.int64)
    backgrounds = background_dn if isinstance(background_dn, np.ndarray) else np.full(runs.count, background_dn, float)
    centroids_px, sigma_px, flux, peak, elongation, clipped = measure(
        np.ascontiguousarray(image), runs.row, runs.start, runs.stop, runs.offset, thresholds,
        (noise.gain_dn_per_electron, noise.noise_dn, noise.response_spread),
        (noise.floor_px, noise.clipped_floor_px), backgrounds, local_background, windowed, noise.saturation_dn,
    )  # fmt: skip
    return BlobMeasurements(
        centroids_px=centroids_px, sigma_px=sigma_px, flux=flux, peak=peak, clipped=clipped, elongation=elongation
    )
