"""Grey frame to blobs: binarisation, components, opening, filters, weighted centres.

    local:  frame ► spots, each with its threshold (runs)           ► opening ► area, shape ► centroid
    frame:  frame ► statistics ► threshold ► components (runs)      ► opening ► area, shape ► centroid

The local method (see `spots`) flies: it finds LEDs in the Sun's veil, in front of the sea and beside the canopy, where
one threshold for the frame (see `binarise`) is above the LEDs or below the background. A fixed threshold is taken as
it is, like one of the frame.

Components come before opening, not after as in [Yoon 2018, Fig 2]: the result is the same (see `morphology`), and on a
dark frame nothing but the blobs is ever touched. Whatever is wider than an LED can be (the Sun, broad reflections)
falls to the area filter before it is opened or measured. Gaps in cloud are as small as a near LED but softer than any:
their flux is that of ten and more pixels as bright as their peak (the *equivalent area*), and that is what tells them.
"""

import math
from dataclasses import dataclass
from functools import lru_cache
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from dockair.errors import DockairError, check_numbers
from dockair.kernels import njit
from dockair.messages import Window
from dockair.nav.image.binarise import Image, adaptive_threshold, check_image, frame_statistics
from dockair.nav.image.centroid import BlobMeasurements, NoiseModel, measure_blobs
from dockair.nav.image.labelling import Runs, foreground_runs
from dockair.nav.image.morphology import Element, open_and_trace, structuring_element
from dockair.nav.image.spots import SpotLimits, find_spots
from dockair.rotations import Array

_QUANTISATION_VARIANCE = 1.0 / 12.0  # of a rounded level [DN^2]


@dataclass(frozen=True, slots=True, kw_only=True)
class DetectSettings:
    """Settings of the image stages; levels are in DN of the frame."""

    method: Literal["local", "frame"] = "local"
    threshold_dn: int | None = None  # fixed threshold, in place of either method's
    spot_contrast_dn: float = 2.0  # of the smallest spots: an LED at 30 m in 14 us (the Sun in view) has 2 to 4
    middle_spot_contrast_dn: float = 4.0  # what is fainter is left to the smallest ring, which meets less texture
    wide_spot_contrast_dn: float = 48.0  # of spots wider than 7 px: an LED as near as that is bright
    spot_isolation: float = 3.0  # standard deviations of noise between a peak and the brightest around it
    texture: float = 0.2  # range of sea, cloud and canopy within a ring, in shares of their level
    spot_detection: float = 6.0  # standard deviations of a spot's nine pixels: noise makes one in 500 frames of them
    spot_beside: float = 1.0  # of seven of them, for hot pixels; the bright ones fail by their share
    spot_pixel: float = 2.5  # of a pixel that belongs to a spot, connected as it is
    spot_share: float = 0.1  # of the peak that a spot's pixels are above: the skirt below it is measured as it touches
    max_equivalent_area_px: float = 7.0  # flux over peak of an unclipped spot: an LED has 2 to 6.4, gaps in cloud 10
    noise_factor: float = 8.0  # of "frame": in 2.2 million pixels of normal noise none passes
    min_contrast_dn: float = 8.0  # above sunlit cloud (5 DN at f/8, 20 us); a spot of peak 60 DN keeps 6 pixels
    max_contrast_dn: float = 40.0  # half of a mean LED's peak at 10 m (80 DN)
    connectivity: int = 8  # as the source recommends; spots always have 8
    element_shape: str = "square"  # the source's structuring element
    element_size_px: int = 3  # 1 switches opening off
    spare_below_px: int = 13  # smaller blobs are not opened, see `morphology`
    min_area_px: int = 2  # an LED at the limit has four pixels, and noise takes two of them
    max_area_px: int = 400  # the Sun's disc has 570; a clipped LED at 2 m about 200
    max_elongation: float = 3.5  # ratio of axes; streaks and edges are longer, a row of three pixels is 3.0
    centroid: Literal["windowed", "weighted"] = "windowed"  # the source's is the second, see `centroid`
    local_background: bool = True
    gain_dn_per_electron: float = 255.0 / 13500.0  # 8 bit over the full well; a frame's own gain replaces it
    noise_dn: float = 0.25  # 13 e- of read noise; quantisation is added, and the frame may show more
    response_spread: float = 0.01  # of the pixels, as their maker states it
    saturation_dn: int | None = None  # None for the data type's largest level
    sigma_floor_px: float = 0.001  # phase error of a sampled spot, from the tests' frames
    clipped_sigma_floor_px: float = 0.0145  # of one with one clipped pixel, grows with their root up to four

    def __post_init__(self) -> None:
        for name, value, exists in (
            ("method", self.method, ["local", "frame"]),
            ("centroid", self.centroid, ["windowed", "weighted"]),
        ):
            if value not in exists:
                raise DockairError(f"detect.{name}", expected="one that exists", got=value, exists=exists)
        exact = "noise_dn", "response_spread", "sigma_floor_px", "clipped_sigma_floor_px"
        check_numbers("detect", self, zero=exact, infinite=("max_equivalent_area_px", "max_elongation"))
        if not 1 <= self.min_area_px <= self.max_area_px:
            raise DockairError(
                "detect.min_area_px", expected=f"1 to max_area_px = {self.max_area_px}", got=self.min_area_px
            )


_DEFAULTS = DetectSettings()


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Blobs:
    """Candidates for LEDs, in raster order of their first pixel."""

    centroids_px: Array  #: (n, 2) (u, v) in full-frame pixels
    area_px: NDArray[np.int64]  #: (n,) pixels above the threshold, after opening
    peak: NDArray[np.int64]  #: (n,) brightest pixel [DN]
    sigma_px: Array  #: (n,) standard deviation of each coordinate
    clipped: NDArray[np.bool_]  #: (n,) touches the saturation level
    flux: Array  #: (n,) sum above the background [DN]
    threshold_dn: int  #: the fixed one or the frame's; of spots the lowest, -1 if there are none
    thresholds_dn: NDArray[np.int64]  #: (n,) the level that each one's pixels are above

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
    settings = settings or _DEFAULTS
    check_image(image)
    if window is not None and window.shape != image.shape:
        raise DockairError("image", expected=f"the window's shape {window.shape}", got=image.shape)
    # a read-only array is another type to the compiler: it is copied rather than compiled for
    image = np.ascontiguousarray(image) if image.flags.writeable else np.array(image, order="C")
    if gain_dn_per_electron is None:
        gain_dn_per_electron = settings.gain_dn_per_electron
    if settings.method == "local" and settings.threshold_dn is None:
        found = _spots(image, settings, gain_dn_per_electron)
    else:
        found = _above_one_threshold(image, settings)
    found, area_px = _opened(found, settings)
    noise = NoiseModel(
        gain_dn_per_electron=gain_dn_per_electron,
        noise_dn=found.noise_dn,
        saturation_dn=(1 << 8 * image.dtype.itemsize) - 1 if settings.saturation_dn is None else settings.saturation_dn,
        floor_px=settings.sigma_floor_px,
        clipped_floor_px=settings.clipped_sigma_floor_px,
        response_spread=settings.response_spread,
    )
    measured = measure_blobs(
        image,
        found.runs,
        found.thresholds_dn,
        noise,
        background_dn=found.backgrounds_dn,
        local_background=settings.local_background,
        windowed=settings.centroid == "windowed",
    )
    return _blobs(found, area_px, measured, settings, window)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Components:
    """Components, each with its threshold and background (n,) and all with the noise [DN]."""

    runs: Runs
    thresholds_dn: NDArray[np.int64]
    backgrounds_dn: Array
    noise_dn: float
    threshold_dn: int | None  # that all were made with


def _spots(image: Image, settings: DetectSettings, gain: float) -> _Components:
    limits = _spot_limits(settings, gain)
    spots = find_spots(image, limits)
    return _Components(
        runs=spots.runs,
        thresholds_dn=spots.threshold_dn,
        backgrounds_dn=spots.background_dn,
        noise_dn=limits.noise_dn,
        threshold_dn=None,
    )


@lru_cache(maxsize=16)
def _spot_limits(settings: DetectSettings, gain: float) -> SpotLimits:
    return SpotLimits(
        small_contrast_dn=settings.spot_contrast_dn,
        middle_contrast_dn=settings.middle_spot_contrast_dn,
        wide_contrast_dn=settings.wide_spot_contrast_dn,
        isolation=settings.spot_isolation,
        texture=settings.texture,
        detection=settings.spot_detection,
        beside=settings.spot_beside,
        pixel=settings.spot_pixel,
        share=settings.spot_share,
        gain_dn_per_electron=gain,
        noise_dn=math.sqrt(settings.noise_dn**2 + _QUANTISATION_VARIANCE),
    )


def _above_one_threshold(image: Image, settings: DetectSettings) -> _Components:
    threshold, background, noise_dn = _levels(image, settings)
    runs = foreground_runs(image, threshold, settings.connectivity)
    return _Components(
        runs=runs,
        thresholds_dn=np.full(runs.count, threshold),
        backgrounds_dn=np.full(runs.count, background),
        noise_dn=noise_dn,
        threshold_dn=threshold,
    )


def _levels(image: Image, settings: DetectSettings) -> tuple[int, float, float]:
    """Threshold, background and noise of the whole frame [DN]."""
    sensor_noise = math.sqrt(settings.noise_dn**2 + _QUANTISATION_VARIANCE)
    if image.size == 0:
        return settings.threshold_dn or 0, 0.0, sensor_noise
    statistics = frame_statistics(image)
    if settings.threshold_dn is not None:
        return settings.threshold_dn, statistics.background_dn, sensor_noise
    threshold = adaptive_threshold(
        statistics,
        noise_factor=settings.noise_factor,
        min_contrast_dn=settings.min_contrast_dn,
        max_contrast_dn=settings.max_contrast_dn,
    )
    return threshold, statistics.background_dn, sensor_noise


def _opened(found: _Components, settings: DetectSettings) -> tuple[_Components, NDArray[np.int64]]:
    """What opening leaves of the components, of the right area before and after, and their areas (n,)."""
    element, spare_below_px = _element(settings)
    connectivity = 8 if found.threshold_dn is None else settings.connectivity  # spots have 8, whatever the setting
    runs, origin, area_px = open_and_trace(
        found.runs, element, spare_below_px, connectivity, (settings.min_area_px, settings.max_area_px)
    )
    opened = _Components(
        runs=runs,
        thresholds_dn=found.thresholds_dn[origin],
        backgrounds_dn=found.backgrounds_dn[origin],
        noise_dn=found.noise_dn,
        threshold_dn=found.threshold_dn,
    )
    return opened, area_px


@lru_cache(maxsize=16)
def _element(settings: DetectSettings) -> tuple[Element, int]:
    """Structuring element, and the area below which components are spared: all of them without opening."""
    element = structuring_element(settings.element_shape, settings.element_size_px)
    return element, settings.max_area_px + 1 if settings.element_size_px == 1 else settings.spare_below_px


def _blobs(
    found: _Components,
    area_px: NDArray[np.int64],
    measured: BlobMeasurements,
    settings: DetectSettings,
    window: Window | None,
) -> Blobs:
    """What has the right shape, in full-frame pixels."""
    left, top = (0, 0) if window is None else (window.column_start, window.row_start)
    centroids_px, area_px, peak, sigma_px, clipped, flux, thresholds_dn, lowest_dn = _of_right_shape(
        measured.centroids_px, area_px, measured.peak, measured.sigma_px, measured.clipped, measured.flux,
        found.thresholds_dn, measured.elongation, found.backgrounds_dn, found.threshold_dn is None,
        settings.max_elongation, settings.max_equivalent_area_px, left, top,
    )  # fmt: skip
    return Blobs(
        centroids_px=centroids_px,
        area_px=area_px,
        peak=peak,
        sigma_px=sigma_px,
        clipped=clipped,
        flux=flux,
        threshold_dn=lowest_dn if found.threshold_dn is None else found.threshold_dn,
        thresholds_dn=thresholds_dn,
    )


@njit(cache=True)
def _of_right_shape(  # type: ignore[no-untyped-def]
    centroids, area, peak, sigma, clipped, flux, threshold, elongation, background, spots, longest, widest, left, top
):
    """Of components those that are not too long and, of spots not clipped, not wider than a lens makes a point.

    Their centroids (m, 2), moved by (left, top), and the next six of them (m,); the lowest threshold, -1 of none.
    """
    keep, lowest = np.zeros(len(area), np.bool_), -1
    for k in range(len(area)):
        narrow = not spots or clipped[k] or flux[k] <= widest * (peak[k] - background[k])
        keep[k] = elongation[k] <= longest and narrow
        if keep[k] and (lowest < 0 or threshold[k] < lowest):
            lowest = threshold[k]
    kept = centroids[keep]
    kept[:, 0] += left
    kept[:, 1] += top
    return kept, area[keep], peak[keep], sigma[keep], clipped[keep], flux[keep], threshold[keep], lowest
