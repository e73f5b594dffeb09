"""Grey frame to binary: a fixed threshold, or one from the frame's own statistics.

A pixel is foreground when it is above the threshold, strictly: B = [I > t]. The adaptive threshold is

    t = b + clip(k s, c_min, c_max)                                                     (1)
    b = q(0.5),   s = q(0.5) - q(0.16)                                                  (2)

with q the frame's grey-level quantiles, interpolated inside a level (a level g holds [g - 1/2, g + 1/2], so that s does
not fall below a quantised sensor's own 1/3 level). Only the lower half of the histogram enters: LEDs, glints and the
Sun are bright and do not move it. c_min keeps single hot pixels out when the frame is black; c_max keeps the threshold
below the LEDs' expected level however noisy the sky ("a little lower than the LEDs' grey level", [Yoon 2018, II.1]).

Not modelled: a background that varies over the frame by more than c_min. Inside the Sun's halo everything is
foreground, one wide blob that the area filter drops, and an LED in it is lost for that frame. `spots` is for those.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dockair.errors import DockairError
from dockair.kernels import njit

Image = NDArray[np.integer[Any]]
Mask = NDArray[np.bool_]

_SAMPLES = 16384  # pixels that the statistics look at: quantiles to 1 %, in a few microseconds
_LOWER_QUANTILE = 0.158655  # one standard deviation below the median of a normal distribution


@dataclass(frozen=True, slots=True, kw_only=True)
class FrameStatistics:
    """Eq. (2), in digital numbers (DN)."""

    background_dn: float
    noise_dn: float


@njit(cache=True)
def _sampled_histogram(image, levels, row_step, column_step):  # type: ignore[no-untyped-def]
    counts = np.zeros(levels, np.int64)
    rows, columns = image.shape
    for i in range(0, rows, row_step):
        # the columns' phase walks with the row, so that no fixed pattern of the sensor is sampled at one phase only
        for j in range((i // row_step) % column_step, columns, column_step):
            counts[image[i, j]] += 1
    return counts


def check_image(image: Image) -> None:
    """Refuse what is not a grey frame.

    Raises:
        DockairError: not two-dimensional, or not unsigned 8 or 16 bit.
    """
    if np.ndim(image) != 2:
        raise DockairError("image", expected="an array of shape (rows, columns)", got=np.shape(image))
    if getattr(image, "dtype", None) not in (np.uint8, np.uint16):
        raise DockairError("image", expected="dtype uint8 or uint16", got=str(np.asarray(image).dtype))


def frame_statistics(image: Image) -> FrameStatistics:
    """Background and noise of a frame from a sample of its pixels, Eq. (2).

    Args:
        image: (rows, columns) uint8 or uint16, at least one pixel.

    Raises:
        DockairError: not a grey frame, or an empty one.
    """
    check_image(image)
    if image.size == 0:
        raise DockairError("image", expected="at least one pixel", got=image.shape)
    # a sample of about _SAMPLES pixels, with the same number of rows skipped as columns
    step = max(1, int(np.sqrt(image.size / _SAMPLES)))
    counts = _sampled_histogram(image, 1 << (8 * image.dtype.itemsize), step, step)
    cumulative = np.cumsum(counts)
    median = _quantile(counts, cumulative, 0.5)
    return FrameStatistics(background_dn=median, noise_dn=median - _quantile(counts, cumulative, _LOWER_QUANTILE))


def _quantile(counts: NDArray[np.int64], cumulative: NDArray[np.int64], fraction: float) -> float:
    wanted = fraction * float(cumulative[-1])
    level = int(np.searchsorted(cumulative, wanted))
    below = float(cumulative[level] - counts[level])
    return level - 0.5 + (wanted - below) / float(counts[level])


def adaptive_threshold(
    statistics: FrameStatistics, *, noise_factor: float, min_contrast_dn: float, max_contrast_dn: float
) -> int:
    """Threshold of Eq. (1), rounded to a level [DN]."""
    contrast = min(max(noise_factor * statistics.noise_dn, min_contrast_dn), max_contrast_dn)
    return round(max(0.0, statistics.background_dn + contrast))


def binarise(image: Image, threshold: int) -> Mask:
    """(rows, columns) bool, true where the image is above the threshold.

    Raises:
        DockairError: not a grey frame.
    """
    check_image(image)
    return np.asarray(image > threshold)
