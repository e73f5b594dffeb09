"""Which frames say nothing, found before anyone looks at them.

A camera that hangs sends its last picture with new stamps: one that equals the picture before it to the last bit is
none, since noise makes any two differ. Where each picture is written over the one before, some of its rows tell. A
stamp ahead of the navigation's own clock, or older than a frame may be, is one to which nothing can be carried. An LED
whose numbers are not finite is not seen, nor is one that has a name which no LED has or another has, too.

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
        self._rows: NDArray[Any] = self._picture  # of it, kept: a camera may write each picture over the one before

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
        picture = frame.pixels if isinstance(frame, CameraFrame) else frame.centroids_px
        return "frame stuck" if self._is_as_before(picture) else None

    def _is_as_before(self, picture: NDArray[Any]) -> bool:
        """Whether a picture equals the one before and shows something; two with noise are told apart by a few rows."""
        rows = picture[:: _ROWS if len(picture) > _ROWS else 1].copy()
        before, self._picture = self._picture, picture
        rows_before, self._rows = self._rows, rows
        alike = picture.size > 0 and picture.shape == before.shape and np.array_equal(rows, rows_before, equal_nan=True)
        return alike and np.array_equal(picture, before, equal_nan=True)


def with_numbers(seen: LedObservation, count: int) -> LedObservation:
    """Return an observation without LEDs that say nothing.

    Left out are those whose centroid or sigma is not finite, whose sigma is not positive, and whose number is not of
    0 ... count - 1 or is another's, too: nobody can say which of the two it is.
    """
    kept = np.isfinite(seen.centroids_px).all(axis=1) & np.isfinite(seen.sigma_px) & (seen.sigma_px > 0.0)
    numbers = np.asarray(seen.led_numbers)
    kept &= (numbers >= 0) & (numbers < count)
    named = numbers[kept].tolist()
    kept[kept] = [named.count(number) == 1 for number in named]
    if kept.all():
        return seen
    return only(seen, kept)


def only(seen: LedObservation, kept: NDArray[np.bool_]) -> LedObservation:
    """Return an observation with some of its LEDs, (n,) which."""
    return replace(
        seen, led_numbers=seen.led_numbers[kept], centroids_px=seen.centroids_px[kept], sigma_px=seen.sigma_px[kept]
    )
