"""Which frames say nothing, found before anyone looks at them.

A camera that hangs sends its last picture with new stamps: one that equals the picture before it to the last bit is
none, since noise makes any two differ. A stamp ahead of the navigation's own clock, or older than a frame may
be, is one to which nothing can be carried. An LED whose numbers are not finite is not seen.

Not modelled: a camera that hangs for some rows only, or whose clock is off by less than a period.
"""

import math
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dockair.messages import STAMP_RESOLUTION_S, CameraFrame, LedObservation

_ROWS = 64  # every so many one is compared before the others


class FrameChecks:
    """Stamps and pictures of one frame after the other.

    Args:
        ahead_s: how far ahead of the clock a stamp may be; the clocks of camera and IMU may differ by a little.
        buffer_s: how old it may be.
    """

    def __init__(self, ahead_s: float, buffer_s: float) -> None:
        self._ahead_s, self._buffer_s = ahead_s + STAMP_RESOLUTION_S, buffer_s + STAMP_RESOLUTION_S
        self._picture: NDArray[Any] = np.empty((0, 2))

    def refused(self, frame: CameraFrame | LedObservation, now_s: float) -> str | None:
        """Return the status of a frame that says nothing; None of one to look at.

        Args:
            frame: as it arrived.
            now_s: the navigation's time; NaN before the first sample of the IMU, when a stamp could be anything, and
                would be the one that all later frames are held against.
        """
        time_s = frame.time_stamp_s
        if math.isnan(now_s):
            return "no clock"
        if not math.isfinite(time_s) or time_s - now_s > self._ahead_s:
            return "frame ahead of the clock"
        if now_s - time_s > self._buffer_s:
            return "frame too old"
        before, self._picture = self._picture, frame.pixels if isinstance(frame, CameraFrame) else frame.centroids_px
        return "frame stuck" if _are_equal(self._picture, before) else None


def _are_equal(one: NDArray[Any], other: NDArray[Any]) -> bool:
    """Whether two pictures are equal and show something; two with noise are told apart by a few rows."""
    if one.size == 0 or one.shape != other.shape:
        return False
    return np.array_equal(one[::_ROWS], other[::_ROWS]) and np.array_equal(one, other)


def with_numbers(seen: LedObservation) -> LedObservation:
    """Return an observation without the LEDs whose centroid or sigma is not finite, or whose sigma is not positive."""
    kept = np.isfinite(seen.centroids_px).all(axis=1) & np.isfinite(seen.sigma_px) & (seen.sigma_px > 0.0)
    if kept.all():
        return seen
    return only(seen, kept)


def only(seen: LedObservation, kept: NDArray[np.bool_]) -> LedObservation:
    """Return an observation with some of its LEDs, (n,) which."""
    return replace(
        seen, led_numbers=seen.led_numbers[kept], centroids_px=seen.centroids_px[kept], sigma_px=seen.sigma_px[kept]
    )
