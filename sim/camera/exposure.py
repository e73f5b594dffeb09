"""The camera's exposure time: held, or set from frame to frame by what the frame before shows.

    y = (level of the n-th brightest pixel - black) / (full scale - black)                                       (1)
    next = exposure x (y < clipped_level ? min(target/y, longest_step) : clipped_factor), within the limits      (2)

The exposure in (2) is the metered frame's own, so frames that were already under way when it changed cannot make it
swing. A change smaller than the dead band is not made, but for one to a limit or because of a clipped frame. This is
what a camera's firmware can do: it knows grey levels and nothing of LEDs. A Sun's disc in the window has more pixels
than are metered and drives the exposure to its shortest, LEDs or not.

Not modelled: gain control; regions of interest; steps of the sensor's row clock (2.7 us, finer in practice).
Sources: metering by a high quantile of the histogram is common practice; the figures are in sheet `exposure`.
"""

import numpy as np
from numpy.typing import NDArray

from dockair.errors import DockairError
from dockair.kernels import njit
from dockair.sim.camera.electronics import OUTPUT_BITS, output_black, output_gain
from dockair.sim.camera.sheets import ExposureParameters, SensorParameters

_LEVELS = 1 << OUTPUT_BITS


class ExposureControl:
    """Holds the exposure of the next frame."""

    def __init__(self, parameters: ExposureParameters, sensor: SensorParameters, automatic: bool = True) -> None:
        """Start with the sheet's exposure.

        Args:
            parameters: sheet.
            sensor: whose black level and full scale the grey levels refer to.
            automatic: False holds the sheet's exposure.
        """
        self._p, self._automatic = parameters, automatic
        self._black = output_black(sensor)
        full_well = self._black + output_gain(sensor) * sensor.full_well_e
        self._span = min(full_well, 2.0**OUTPUT_BITS - 1.0) - self._black
        self._exposure_s = parameters.exposure_s

    @property
    def exposure_s(self) -> float:
        """Of the next frame [s]."""
        return self._exposure_s

    def within_limits(self, exposure_s: float) -> float:
        """Return the exposure nearest to one asked for that the hardware can make [s]."""
        return min(max(exposure_s, self._p.shortest_s), self._p.longest_s)

    def reset(self) -> None:
        """Forget all frames."""
        self._exposure_s = self._p.exposure_s

    def step(self, pixels: NDArray[np.uint8], exposure_s: float) -> float:
        """Meter a frame and return the exposure of the next, Eq. (2) [s].

        Args:
            pixels: (rows, columns) as read out.
            exposure_s: the frame's own.

        Raises:
            DockairError: an exposure that the hardware cannot have made.
        """
        p = self._p
        if not p.shortest_s <= exposure_s <= p.longest_s:
            expected = f"{p.shortest_s} to {p.longest_s} s (exposure.shortest_s, exposure.longest_s)"
            raise DockairError("exposure_s", expected=expected, got=exposure_s)
        if not self._automatic:
            return self._exposure_s
        y = (brightest_level(pixels, p.metered_pixel) - self._black) / self._span
        clipped = y >= p.clipped_level
        if clipped:
            factor = p.clipped_factor
        else:
            factor = min(p.target_level / y, p.longest_step) if y > 0.0 else p.longest_step
        wanted_s = min(max(exposure_s * factor, p.shortest_s), p.longest_s)
        at_limit = wanted_s in (p.shortest_s, p.longest_s)
        if clipped or at_limit or abs(wanted_s - self._exposure_s) > p.dead_band * self._exposure_s:
            self._exposure_s = wanted_s
        return self._exposure_s


def brightest_level(pixels: NDArray[np.uint8], n: int) -> int:
    """Level of the n-th brightest pixel (of the darkest, if there are fewer).

    The n rows with the highest maxima hold n pixels at least as bright as the n-th of these maxima: a brighter n-th
    pixel is in those of the rows that exceed it, of which there are fewer than n.
    """
    if pixels.shape[0] < n:
        return int(np.sort(pixels, axis=None)[max(pixels.size - n, 0)])
    return int(_brightest_level(pixels, n))


@njit(cache=True)
def _brightest_level(pixels: NDArray[np.uint8], n: int) -> int:
    """As `brightest_level`, of a picture with at least n rows."""
    of_rows, counts = np.zeros(pixels.shape[0], np.uint8), np.zeros(_LEVELS, np.int64)
    for i in range(pixels.shape[0]):
        highest = np.uint8(0)
        for level in pixels[i]:
            highest = max(highest, level)
        of_rows[i] = highest
        counts[highest] += 1
    floor = _level_of(counts, n, 0)
    counts[:] = 0
    for row in pixels[of_rows > floor]:
        for level in row:
            counts[level] += 1
    return _level_of(counts, n, floor)


@njit(cache=True)
def _level_of(counts: NDArray[np.int64], n: int, floor: int) -> int:
    """Level of the n-th brightest of those counted, no less than the floor."""
    above = 0
    for level in range(_LEVELS - 1, floor, -1):
        above += counts[level]
        if above >= n:
            return level
    return floor
