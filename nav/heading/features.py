"""Features of an image, by SIFT (OpenCV), and which of two images' are the same: ratio test, both ways.

Source: Lowe, Int. J. Computer Vision 60(2), 2004.
"""

from dataclasses import dataclass
from functools import cache
from typing import Any, Protocol

import cv2
import numpy as np
from numpy.typing import NDArray

from dockair.errors import DockairError
from dockair.rotations import Array

_SAMPLED_PX = 4  # every so many pixels say how bright a picture is
_DARK_AND_BRIGHT_PERCENT = (1.0, 99.0)
_MARGIN_PX = 64  # around a mask: features' neighbourhoods
_UPSCALED_PX = 0.25  # too far right and down: OpenCV's SIFT begins with a reduced image at twice its size
_LEAST_CONTRAST = 16  # grey levels that are spread over all; less is noise


class FeatureSettings(Protocol):
    """What `turn.VisualSettings` says of features."""

    @property
    def scale(self) -> float:
        """By which images are reduced."""
        ...

    @property
    def most_features(self) -> int:
        """Of an image."""
        ...

    @property
    def contrast(self) -> float:
        """Least of a feature."""
        ...


@dataclass(frozen=True, slots=True, eq=False)
class Features:
    """What is matched of an image, and how the camera stood."""

    pixels: Array  # (n, 2)
    descriptors: NDArray[np.float32]
    R_HC: Array | None
    middle_px: float  # column of the picture's middle


def features_of(
    image: NDArray[Any], settings: FeatureSettings, mask: NDArray[np.bool_] | None, R_HC: Array | None
) -> Features:
    """Features of an image.

    Args:
        image: (h, w) uint8 or uint16.
        settings: constants.
        mask: (h, w) bool: where they may lie.
        R_HC: (3, 3) how the camera stood; kept.
    """
    grey = np.asarray(image)
    if grey.ndim != 2 or min(grey.shape) < 16 or grey.dtype not in (np.uint8, np.uint16):
        raise DockairError("image", expected="(h, w) of uint8 or uint16", got=f"{grey.dtype} {grey.shape}")
    if mask is not None and (mask.shape != grey.shape or mask.dtype != bool):
        raise DockairError("mask", expected=f"{grey.shape} of bool", got=f"{mask.dtype} {mask.shape}")
    middle = 0.5 * (grey.shape[1] - 1)
    part, corner = _around(mask, grey.shape, settings.scale)
    grey, allowed_here = grey[part], None if mask is None else mask[part]
    grey = _stretched(grey, allowed_here)
    s = settings.scale
    small = cv2.resize(np.ascontiguousarray(grey), None, fx=s, fy=s, interpolation=cv2.INTER_AREA)
    allowed = None
    if allowed_here is not None:
        allowed = cv2.resize(allowed_here.astype(np.uint8) * 255, small.shape[::-1], interpolation=cv2.INTER_NEAREST)
    points, descriptors = _sift(settings.most_features, settings.contrast).detectAndCompute(small, allowed)
    if not points:
        return Features(np.empty((0, 2)), np.empty((0, 128), np.float32), R_HC, middle)
    pixels = (np.array([point.pt for point in points]) - _UPSCALED_PX + 0.5) / s - 0.5 + corner
    return Features(pixels, np.asarray(descriptors, np.float32), R_HC, middle)


def _around(
    mask: NDArray[np.bool_] | None, shape: tuple[int, ...], scale: float
) -> tuple[tuple[slice, slice], tuple[int, int]]:
    """The smallest part of an image that holds the mask with a margin, and its first column and row: it is quicker."""
    if mask is None or not mask.any():
        return (slice(None), slice(None)), (0, 0)
    slices = []
    for axis in (0, 1):
        inside = np.flatnonzero(mask.any(axis=1 - axis))
        first = max(int((inside[0] - _MARGIN_PX) * scale) / scale, 0.0)  # a whole number of reduced pixels
        first = first if first == int(first) else 0.0
        slices.append(slice(int(first), min(int(inside[-1]) + 1 + _MARGIN_PX, shape[axis])))
    rows, columns = slices
    return (rows, columns), (columns.start, rows.start)


def _stretched(grey: NDArray[Any], mask: NDArray[np.bool_] | None) -> NDArray[np.uint8]:
    """Grey levels from the darkest to the brightest hundredth spread over eight bits, unless they are all alike."""
    every = slice(None, None, _SAMPLED_PX)
    sampled = grey[every, every] if mask is None else grey[every, every][mask[every, every]]
    low, high = np.percentile(sampled, _DARK_AND_BRIGHT_PERCENT) if sampled.size else (0.0, 0.0)
    gain = 255.0 / max(high - low, _LEAST_CONTRAST)
    table = np.clip(gain * (np.arange(np.iinfo(grey.dtype).max + 1) - low), 0.0, 255.0).astype(np.uint8)
    return np.asarray(table[grey])


@cache
def _sift(most: int, contrast: float) -> Any:
    return cv2.SIFT_create(nfeatures=most, contrastThreshold=contrast)  # type: ignore[attr-defined]


def matched(one: Features, two: Features, ratio: float) -> tuple[Array, Array]:
    """(m, 2) pixels in both, matched both ways."""
    if min(len(one.pixels), len(two.pixels)) < 2:
        return np.empty((0, 2)), np.empty((0, 2))
    # squared distances of all pairs; descriptors have nearly equal norms, but not exactly
    squares = (
        (one.descriptors**2).sum(axis=1)[:, None]
        + (two.descriptors**2).sum(axis=1)[None, :]
        - 2.0 * one.descriptors @ two.descriptors.T
    )
    nearest = np.argpartition(squares, 1, axis=1)[:, :2]
    rows = np.arange(len(squares))
    first, second = squares[rows, nearest[:, 0]], squares[rows, nearest[:, 1]]
    best = np.where(first <= second, nearest[:, 0], nearest[:, 1])
    clear = np.minimum(first, second) < ratio**2 * np.maximum(first, second)
    mutual = squares.argmin(axis=0)[best] == rows
    kept = clear & mutual
    return one.pixels[kept], two.pixels[best[kept]]
