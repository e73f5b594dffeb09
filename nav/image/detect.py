"""Grey frame to blobs: threshold, components, opening, filters, weighted centres.

    frame ► statistics ► threshold ► components (runs) ► opening ► area, shape ► centroid

Components come before opening, not after as in [Yoon 2018, Fig 2]: the result is the same (see `morphology`), and on a
dark frame nothing but the blobs is ever touched. Whatever is wider than an LED can be (the Sun, broad reflections)
falls to the area filter before it is opened or measured.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from dockair.errors import DockairError
from dockair.messages import Window
from dockair.nav.image.binarise import Image, adaptive_threshold, check_image, frame_statistics
from dockair.nav.image.centroid import NoiseModel, measure_blobs
from dockair.nav.image.labelling import Runs, foreground_runs
from dockair.nav.image.morphology import open_components, structuring_element
from dockair.rotations import Array

_QUANTISATION_VARIANCE = 1.0 / 12.0  # of a rounded level [DN^2]


@dataclass(frozen=True, slots=True, kw_only=True)
class DetectSettings:
    """Settings of the image stages; levels are in DN of the frame."""

    threshold_dn: int | None = None  # fixed threshold; None for the adaptive one
    noise_factor: float = 8.0  # k: in 2.2 million pixels of normal noise none passes
    min_contrast_dn: float = 8.0  # above sunlit cloud (5 DN at f/8, 20 us); a spot of peak 60 DN keeps 6 pixels
    max_contrast_dn: float = 40.0  # half of a mean LED's peak at 10 m (80 DN)
    connectivity: int = 8  # as the source recommends
    element_shape: str = "square"  # the source's structuring element
    element_size_px: int = 3  # 1 switches opening off
    spare_below_px: int = 13  # smaller blobs are not opened, see `morphology`
    min_area_px: int = 3  # a far LED has four pixels, with one to spare; two hot pixels side by side are none
    max_area_px: int = 400  # the Sun's disc has 570; a clipped LED at 2 m about 200
    max_elongation: float = 3.5  # ratio of axes; streaks and edges are longer, a row of three pixels is 3.0
    local_background: bool = True
    gain_dn_per_electron: float = 255.0 / 13500.0  # 8 bit over the full well; a frame's own gain replaces it
    noise_dn: float = 0.25  # 13 e- of read noise; quantisation is added, and the frame may show more
    saturation_dn: int | None = None  # None for the data type's largest level
    sigma_floor_px: float = 0.005  # phase error of a sampled spot, from the tests' frames
    clipped_sigma_floor_px: float = 0.05  # of a clipped one

    def __post_init__(self) -> None:
        if not 1 <= self.min_area_px <= self.max_area_px:
            raise DockairError(
                "detect.min_area_px", expected=f"1 to max_area_px = {self.max_area_px}", got=self.min_area_px
            )


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Blobs:
    """Candidates for LEDs, in raster order of their first pixel."""

    centroids_px: Array  #: (n, 2) (u, v) in full-frame pixels
    area_px: NDArray[np.int64]  #: (n,) pixels above the threshold, after opening
    peak: NDArray[np.int64]  #: (n,) brightest pixel [DN]
    sigma_px: Array  #: (n,) standard deviation of each coordinate
    clipped: NDArray[np.bool_]  #: (n,) touches the saturation level
    flux: Array  #: (n,) sum above the background [DN]
    threshold_dn: int  #: the threshold that was used

    def __len__(self) -> int:
        return len(self.area_px)


def detect(
    image: Image,
    settings: DetectSettings | None = None,
    window: Window | None = None,
    *,
    gain_dn_per_electron: float | None = None,
) -> Blobs:
    """Find the blobs in a frame.

    Args:
        image: (rows, columns) uint8 or uint16, the pixels of the window.
        settings: None for the defaults.
        window: where the image lies on the sensor; None when it begins at pixel (0, 0).
        gain_dn_per_electron: the frame's own gain, in place of the settings'.

    Raises:
        DockairError: not a grey frame, or not of the window's shape.
    """
    settings = settings or DetectSettings()
    check_image(image)
    if window is not None and window.shape != image.shape:
        raise DockairError("image", expected=f"the window's shape {window.shape}", got=image.shape)
    image = np.ascontiguousarray(image)
    threshold, background, noise_dn = _levels(image, settings)
    runs = _components(image, threshold, settings)
    largest = int(np.iinfo(image.dtype).max)
    noise = NoiseModel(
        gain_dn_per_electron=settings.gain_dn_per_electron if gain_dn_per_electron is None else gain_dn_per_electron,
        noise_dn=noise_dn,
        saturation_dn=largest if settings.saturation_dn is None else settings.saturation_dn,
        floor_px=settings.sigma_floor_px,
        clipped_floor_px=settings.clipped_sigma_floor_px,
    )
    measured = measure_blobs(
        image, runs, threshold, noise, background_dn=background, local_background=settings.local_background
    )
    keep = measured.elongation <= settings.max_elongation
    origin = np.zeros(2) if window is None else np.array([window.column_start, window.row_start], dtype=float)
    return Blobs(
        centroids_px=measured.centroids_px[keep] + origin,
        area_px=runs.area_px[keep],
        peak=measured.peak[keep],
        sigma_px=measured.sigma_px[keep],
        clipped=measured.clipped[keep],
        flux=measured.flux[keep],
        threshold_dn=threshold,
    )


def _levels(image: Image, settings: DetectSettings) -> tuple[int, float, float]:
    """Threshold, background and noise [DN]."""
    sensor_noise = float(np.sqrt(settings.noise_dn**2 + _QUANTISATION_VARIANCE))
    if image.size == 0:
        return settings.threshold_dn or 0, 0.0, sensor_noise
    statistics = frame_statistics(image)
    # the interpolated histogram spreads every level over its width, which adds a rounding error's variance once more
    noise = float(np.sqrt(max(statistics.noise_dn**2 - _QUANTISATION_VARIANCE, sensor_noise**2)))
    if settings.threshold_dn is not None:
        return settings.threshold_dn, statistics.background_dn, noise
    threshold = adaptive_threshold(
        statistics,
        noise_factor=settings.noise_factor,
        min_contrast_dn=settings.min_contrast_dn,
        max_contrast_dn=settings.max_contrast_dn,
    )
    return threshold, statistics.background_dn, noise


def _components(image: Image, threshold: int, settings: DetectSettings) -> Runs:
    runs = foreground_runs(image, threshold, settings.connectivity)
    runs = _of_right_area(runs, settings)
    if settings.element_size_px > 1 and runs.count:
        element = structuring_element(settings.element_shape, settings.element_size_px)
        runs = open_components(runs, element, settings.spare_below_px, settings.connectivity)
        runs = _of_right_area(runs, settings)
    return runs


def _of_right_area(runs: Runs, settings: DetectSettings) -> Runs:
    area = runs.area_px
    return runs.select((area >= settings.min_area_px) & (area <= settings.max_area_px))
