"""What faults leave on the camera: smudges on its window and hot pixels, worked out when first met and kept.

Hot pixels are white from the converter on, in the output's full scale. Smudges are `dirt`; the same stream makes the
same ones whatever their cover. Faults that this camera cannot have are refused before the flight.
"""

import numpy as np
from numpy.typing import NDArray

from dockair.calibration import Camera
from dockair.errors import DockairError
from dockair.messages import Window
from dockair.sim.camera.dirt import Dirt
from dockair.sim.camera.sheets import ExposureParameters, GlareParameters
from dockair.sim.faults import Faults, hot_pixel_places


class Defects:
    """Dirt and hot pixels of one camera.

    Args:
        camera: as built.
        glare: what dirt does to light.
        exposure: limits of what it can be stuck at.
        faults: of the flight.
        dirt: stream "dirt"; never advanced.
        hot_pixels: key of that name.

    Raises:
        DockairError: an exposure beyond the limits, more hot pixels than the sensor has.
    """

    def __init__(
        self,
        camera: Camera,
        glare: GlareParameters,
        exposure: ExposureParameters,
        faults: Faults,
        dirt: np.random.Generator,
        hot_pixels: int,
    ) -> None:
        self._camera, self._glare, self._stream, self._key = camera, glare, dirt, hot_pixels
        self._dirt: tuple[float, Dirt | None] = 0.0, None
        self._places = np.empty((0, 2), dtype=np.int64)
        _check_exposures(faults, exposure)
        size, (index, most) = camera.height_px * camera.width_px, faults.most_hot_pixels
        if most > size:
            expected = f"up to {size} hot pixels at a time, all of the sensor's"
            raise DockairError(f"faults[{index}].count", expected=expected, got=most)

    def dirt(self, cover: float) -> Dirt | None:
        """Return the smudges of a cover; None for 0."""
        if cover != self._dirt[0]:
            rng = np.random.Generator(type(self._stream.bit_generator)())
            rng.bit_generator.state = self._stream.bit_generator.state
            self._dirt = cover, Dirt(self._glare, self._camera, rng, cover) if cover > 0.0 else None
        return self._dirt[1]

    def whiten(self, pixels: NDArray[np.unsignedinteger], window: Window, count: int) -> None:
        """Make hot pixels white in the output (rows, columns) of a window, in place."""
        if count == 0:
            return
        if count != len(self._places):
            self._places = hot_pixel_places(self._key, count, self._camera.height_px, self._camera.width_px)
        places = self._places - (window.row_start, window.column_start)
        places = places[((places >= 0) & (places < pixels.shape)).all(axis=1)]
        pixels[places[:, 0], places[:, 1]] = np.iinfo(pixels.dtype).max


def _check_exposures(faults: Faults, exposure: ExposureParameters) -> None:
    for index, stuck_at in faults.exposures_s.items():
        if not exposure.shortest_s <= stuck_at <= exposure.longest_s:
            expected = f"{1e6 * exposure.shortest_s:g} to {1e6 * exposure.longest_s:g} us, the hardware's limits"
            raise DockairError(f"faults[{index}].exposure_us", expected=expected, got=round(1e6 * stuck_at, 6))
