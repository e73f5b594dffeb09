"""Dirt on the window before the lens: smudges far out of focus that dim what is behind them and spread sunlight.

    g = Sum_k s_k g_k/|s|,   g_k = white noise smoothed by a Gaussian of smudge size s_k, variance 1             (1)
    h = max(g - g_c, 0)/d,   T = 1 - (1 - T_min) h^2/(1 + h^2)                                                   (2)
    veil and halo grow by   1 + scatter (1 - mean T)/(veil + halo)                                               (3)

T dims the scene where it is seen, and all stray light of the Sun, which comes about in the lens behind the window, by
T toward the Sun. Big smudges are thick. g_c is the quantile of g that leaves the part `cover` of the frame above it, so
that more cover contains less; d is the thickness at which a smudge is half as dark as it can be. Of the light that dirt
takes, the part `scatter` returns as veil and halo.

Not modelled: that smudges move with the aperture's parallax; what they spread of LEDs (their halo stays unseen); that
in the Sun's light they glow themselves, where Eq. (3) spreads what they scatter over the frame.
Not valid for drops that focus light.
Source: an edge 50 mm before an aperture of 2 mm is blurred over 40 mrad, which sets the sizes.
"""

import numpy as np
from scipy.ndimage import gaussian_filter

from dockair.calibration import Camera
from dockair.errors import DockairError
from dockair.rotations import Array
from dockair.sim.camera.coarse_grid import SPACING_PX, CoarseGrid, nodes_around
from dockair.sim.camera.image_point import image_point
from dockair.sim.camera.sheets import GlareParameters

_SIGMA_OF_SIZE = 0.3  # a Gaussian of this times a smudge's width makes blobs of about that width
_SIZES = 3  # smudge sizes between smallest and largest, in equal ratios


class Dirt:
    """One dirty window.

    Args:
        parameters: sizes, darkness, scatter; the clean lens's veil and halo.
        camera: as built.
        rng: stream "dirt"; draws the same whatever the cover.
        cover: part of the frame that is smudged, 0 to 1.
    """

    def __init__(self, parameters: GlareParameters, camera: Camera, rng: np.random.Generator, cover: float) -> None:
        if not 0.0 <= cover <= 1.0:
            raise DockairError("dirty window: cover", expected="a number in [0, 1]", got=cover)
        self._camera = camera
        first, shape = nodes_around(camera.full_window)
        field = _field(parameters, camera.focal_length_px, rng, shape)
        edge = float(np.quantile(field, 1.0 - cover)) if cover > 0.0 else np.inf
        thick = np.maximum(field - edge, 0.0) / parameters.dirt_slope  # h of Eq. (2)
        values = (1.0 - (1.0 - parameters.dirt_darkest) * thick**2 / (1.0 + thick**2)).astype(np.float32)
        values.setflags(write=False)
        self.grid = CoarseGrid(values, first)  #: transmittance of the whole sensor
        self._mean = float(values.mean(dtype=float))
        taken = 1.0 - self._mean
        spread = parameters.veiling_glare + float(parameters.halo_share.sum())
        #: how much brighter than a clean lens's are veil and halo, Eq. (3); a lens with neither keeps neither
        self.veil_factor = 1.0 + parameters.dirt_scatter * taken / spread if spread > 0.0 else 1.0

    def at(self, pixels: Array) -> Array:
        """(n,) transmittance at pixels (n, 2) (u, v)."""
        return self.grid.at(pixels)

    def toward(self, direction_C: Array) -> float:
        """Transmittance in a direction (3,), x > 0; from outside the frame, where nothing is drawn, the mean."""
        u, v = pixel = image_point(self._camera, direction_C)
        inside = 0.0 <= u <= self._camera.width_px - 1 and 0.0 <= v <= self._camera.height_px - 1
        return float(self.at(pixel[np.newaxis])[0]) if inside else self._mean

    def over(self, shape: tuple[int, int], first: tuple[int, int]) -> Array:
        """(rows, columns) transmittance of a patch of pixels whose first one is at (row, column) on the sensor."""
        rows, columns = np.indices(shape)
        pixels = np.column_stack([columns.ravel() + first[1], rows.ravel() + first[0]]).astype(float)
        return self.at(pixels).reshape(shape)


def _field(parameters: GlareParameters, focal_px: float, rng: np.random.Generator, shape: tuple[int, int]) -> Array:
    """(m, n) field g of Eq. (1)."""
    total = np.zeros(shape)
    sigmas = (
        _SIGMA_OF_SIZE
        * focal_px
        / SPACING_PX
        * np.geomspace(parameters.dirt_smallest_rad, parameters.dirt_largest_rad, _SIZES)
    )
    for sigma in sigmas:
        # noise of variance 1 smoothed by a Gaussian has the variance 1/(4 pi sigma^2)
        unit = 2.0 * np.sqrt(np.pi) * sigma * gaussian_filter(rng.standard_normal(shape), sigma, mode="wrap")
        total += sigma * unit
    return np.asarray(total / np.sqrt(np.sum(sigmas**2)))
