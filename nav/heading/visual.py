"""Visual heading: how far a camera has turned between two images, by the columns in which the same features stand.

Features are found and matched by SIFT (OpenCV) with the ratio test, both ways. Of the matches' column shifts
x_i = u_2 - u_1 [px] a robust mean is taken, of those within three robust sigmas of their median.

    d = m x_mean + b                                                                       (3)
    (m, b) = argmin sum (d_i - m x_i - b)^2      over images whose turn d_i is known       (4)-(6), (11)

Going forward spreads the picture about its middle, c. What two images of a turn share lies to one side of it, so that
the mean is too small by the spread there; and a plane picture stretches towards its sides, so that the mean depends
on where the matches are. With `spreads` the mean is that of the middle (q for the line alone, azimuths do not stretch):

    x_i = x_mean + k (u_i - c) + q (u_i - c)^2,   u_i = (u_1 + u_2) / 2                    (13)

Turning left is positive and moves what is seen to the right, to larger u. Any b but 0 is a false turn of every pair
of images, the same to the left as to the right: `fit_heading_line` leaves it out unless asked for, as zero shift is
zero turn. Instead of the line a camera's calibration will do: then a match's turn is the difference of its two
azimuths in level axes (with the attitude, where the camera is banked or pitched), exact at any column,

    d_i = azimuth(R_HC,1 ray_1) - azimuth(R_HC,2 ray_2)                                    (12)

Headings are counted from key frames: an image is compared with the last key frame, not with the last image, and takes
its place only when it has turned so far or shares so little with it that the next would be refused. So errors grow
with the number of key frames and not with that of images.

What is refused, and says so: too few matches; matches that disagree (most do not share one shift, as when what moves
with the camera fills the view). Valid for what is far away: a step sideways of s turns what is r away by s / r.
Sources: [Kyung et al. 2015, eqs 3 to 6, 11]; Lowe, Int. J. Computer Vision 60(2), 2004 (SIFT, ratio test).
Corrected: the sign of b in the source's printed line, which its own example contradicts.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field
from enum import Enum
from functools import cache
from typing import Any

import cv2
import numpy as np
from numpy.typing import ArrayLike, NDArray

from dockair.calibration import Camera
from dockair.errors import DockairError
from dockair.rotations import Array

__all__ = ["HeadingLine", "Turn", "TurnStatus", "VisualHeading", "VisualSettings", "fit_heading_line", "measure_turn"]

_MAD = 1.4826  # standard deviation of a normal law over its median absolute deviation
_SIGMAS = 3.0
_ROUNDS = 5
_SAMPLED_PX = 4  # every so many pixels say how bright a picture is
_DARK_AND_BRIGHT_PERCENT = (1.0, 99.0)
_LEAST_CONTRAST = 16  # grey levels that are spread over all; less is noise
_SPREAD_PX = 1000.0  # unit of places in Eq. (13), for the arithmetic's sake


@dataclass(frozen=True, slots=True, kw_only=True)
class HeadingLine:
    """Eq. (3)."""

    slope_rad_px: float  #: m
    offset_rad: float = 0.0  #: b

    @classmethod
    def of_focal_length(cls, focal_length_px: float) -> "HeadingLine":
        """Line of a camera in the middle of its picture: m = 1 / f."""
        if not focal_length_px > 0.0:
            raise DockairError("focal_length_px", expected="a length > 0", got=focal_length_px)
        return cls(slope_rad_px=1.0 / focal_length_px)

    def turn_rad(self, shift_px: float) -> float:
        """D."""
        return self.slope_rad_px * shift_px + self.offset_rad


@dataclass(frozen=True, slots=True, kw_only=True)
class VisualSettings:
    """Constants of matching; none is printed in the source."""

    scale: float = 0.5  #: by which images are reduced before features are looked for
    most_features: int = 600
    contrast: float = 0.02  #: least of a feature, SIFT's own
    ratio: float = 0.75  #: of the best match's distance to the second best's
    fewest_matches: int = 12  #: that share one shift
    least_share: float = 0.35  #: of all matches that share it
    spreads: bool = True  #: Eq. (13); the source's plain mean without
    least_sigma_px: float = 0.3  #: robust sigma that is believed; in pixels of the full image
    key_turn_rad: float = float(np.radians(8.0))  #: after which the next key frame is taken
    key_matches: int = 40  #: below which it is taken

    def __post_init__(self) -> None:
        for name in ("scale", "ratio", "least_share"):
            if not 0.0 < getattr(self, name) <= 1.0:
                raise DockairError(name, expected="a number above 0, up to 1", got=getattr(self, name))
        for name in ("most_features", "contrast", "fewest_matches", "least_sigma_px", "key_turn_rad"):
            if not getattr(self, name) > 0:
                raise DockairError(name, expected="a number > 0", got=getattr(self, name))


class TurnStatus(Enum):
    """What came of two images."""

    MEASURED = "measured"
    FIRST = "first image"
    TOO_FEW = "too few matches"
    DISAGREE = "matches disagree"


@dataclass(frozen=True, slots=True, eq=False)
class Turn:
    """From one image to another."""

    status: TurnStatus
    turn_rad: float  #: to the left; NaN when it was not measured
    sigma_rad: float  #: of the mean, from the scatter of those that share it
    shift_px: float  #: robust mean column shift; with a camera, of its middle
    matches: int
    pixels: tuple[Array, Array]  #: (inliers, 2) each, full-image coordinates of the matches that share the shift

    @classmethod
    def none(cls, status: TurnStatus, matches: int = 0) -> "Turn":
        """Return a turn that was not measured."""
        nan, empty = float("nan"), np.empty((0, 2))
        return cls(status, nan, nan, nan, matches, (empty, empty))


@dataclass(frozen=True, slots=True, eq=False)
class _Features:
    pixels: Array  # (n, 2)
    descriptors: NDArray[np.float32]
    R_HC: Array | None
    middle_px: float  # column of the picture's middle


def fit_heading_line(shifts_px: ArrayLike, turns_rad: ArrayLike, *, with_offset: bool = False) -> HeadingLine:
    """Least-squares line of known turns, Eqs. (4) to (6), (11).

    Args:
        shifts_px: (n,) mean column shifts.
        turns_rad: (n,) turns that made them.
        with_offset: fit b too, as the source does; otherwise it is 0.

    Raises:
        DockairError: lengths differ, too few pairs, shifts all alike.
    """
    x, d = np.asarray(shifts_px, dtype=float), np.asarray(turns_rad, dtype=float)
    if x.ndim != 1 or x.shape != d.shape or not (np.isfinite(x).all() and np.isfinite(d).all()):
        raise DockairError("shifts_px, turns_rad", expected="two finite rows of one length", got=(x.shape, d.shape))
    columns = np.column_stack([x, np.ones_like(x)]) if with_offset else x[:, None]
    if np.linalg.matrix_rank(columns) < columns.shape[1]:
        raise DockairError("shifts_px", expected="different shifts", got=list(x[:5]))
    solution = np.linalg.lstsq(columns, d, rcond=None)[0]
    return HeadingLine(slope_rad_px=float(solution[0]), offset_rad=float(solution[1]) if with_offset else 0.0)


def measure_turn(
    first: NDArray[Any],
    second: NDArray[Any],
    calibration: HeadingLine | Camera,
    settings: VisualSettings | None = None,
    *,
    masks: Sequence[NDArray[np.bool_] | None] = (None, None),
    attitudes_R_HC: Sequence[Array | None] = (None, None),
) -> Turn:
    """Turn of the camera between any two images.

    Args:
        first: (h, w) uint8 or uint16.
        second: of the same shape.
        calibration: the line, or the camera.
        settings: constants.
        masks: (h, w) bool each: where features may lie. Leave out what moves with the camera.
        attitudes_R_HC: (3, 3) each: camera axes in level axes that look along the camera's heading; for a camera only.

    Raises:
        DockairError: images or masks that are none, or of different shapes.
    """
    s = settings or VisualSettings()
    one, two = (
        _features(image, s, mask, R) for image, mask, R in zip((first, second), masks, attitudes_R_HC, strict=True)
    )
    if np.shape(first) != np.shape(second):
        raise DockairError("second", expected=f"an image of shape {np.shape(first)}", got=np.shape(second))
    return _turn(one, two, calibration, s)


@dataclass(slots=True, eq=False)
class VisualHeading:
    """Heading since the first image, from key frame to key frame.

    Args:
        calibration: the line, or the camera.
        settings: constants.

    Attributes:
        heading_rad: to the left, not wrapped.
        key_frames: how many there were.
    """

    calibration: HeadingLine | Camera
    settings: VisualSettings = field(default_factory=VisualSettings)
    heading_rad: float = field(default=0.0, init=False)
    key_frames: int = field(default=0, init=False)
    _key: _Features | None = field(default=None, init=False, repr=False)
    _key_heading_rad: float = field(default=0.0, init=False, repr=False)

    def step(
        self,
        image: NDArray[Any],
        *,
        mask: NDArray[np.bool_] | None = None,
        R_HC: Array | None = None,
        predicted_turn_rad: float = 0.0,
    ) -> Turn:
        """Take an image; return its turn from the key frame, and bring `heading_rad` up to date.

        Args:
            image: (h, w) uint8 or uint16.
            mask: (h, w) bool: where features may lie.
            R_HC: (3, 3) camera axes in level axes along its heading.
            predicted_turn_rad: since the last image, by the gyro: taken where the image is refused.
        """
        features = _features(image, self.settings, mask, R_HC)
        if self._key is None:
            self._take_key(features)
            return Turn.none(TurnStatus.FIRST)
        turn = _turn(self._key, features, self.calibration, self.settings)
        if turn.status is not TurnStatus.MEASURED:
            self.heading_rad += predicted_turn_rad
            self._take_key(features)
            return turn
        self.heading_rad = self._key_heading_rad + turn.turn_rad
        if abs(turn.turn_rad) > self.settings.key_turn_rad or len(turn.pixels[0]) < self.settings.key_matches:
            self._take_key(features)
        return turn

    def _take_key(self, features: _Features) -> None:
        self._key, self._key_heading_rad = features, self.heading_rad
        self.key_frames += 1


def _features(
    image: NDArray[Any], settings: VisualSettings, mask: NDArray[np.bool_] | None, R_HC: Array | None
) -> _Features:
    grey = np.asarray(image)
    if grey.ndim != 2 or min(grey.shape) < 16 or grey.dtype not in (np.uint8, np.uint16):
        raise DockairError("image", expected="(h, w) of uint8 or uint16", got=f"{grey.dtype} {grey.shape}")
    if mask is not None and (mask.shape != grey.shape or mask.dtype != bool):
        raise DockairError("mask", expected=f"{grey.shape} of bool", got=f"{mask.dtype} {mask.shape}")
    grey = _stretched(grey, mask)
    s = settings.scale
    small = cv2.resize(np.ascontiguousarray(grey), None, fx=s, fy=s, interpolation=cv2.INTER_AREA)
    allowed = None
    if mask is not None:
        allowed = cv2.resize(mask.astype(np.uint8) * 255, small.shape[::-1], interpolation=cv2.INTER_NEAREST)
    points, descriptors = _sift(settings.most_features, settings.contrast).detectAndCompute(small, allowed)
    middle = 0.5 * (grey.shape[1] - 1)
    if not points:
        return _Features(np.empty((0, 2)), np.empty((0, 128), np.float32), R_HC, middle)
    pixels = (np.array([point.pt for point in points]) + 0.5) / s - 0.5
    return _Features(pixels, np.asarray(descriptors, np.float32), R_HC, middle)


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


def _matches(one: _Features, two: _Features, ratio: float) -> tuple[Array, Array]:
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


def _turn(one: _Features, two: _Features, calibration: HeadingLine | Camera, settings: VisualSettings) -> Turn:
    a, b = _matches(one, two, settings.ratio)
    if len(a) < settings.fewest_matches:
        return Turn.none(TurnStatus.TOO_FEW, len(a))
    if isinstance(calibration, Camera):
        one_rad, two_rad = _azimuths(a, one.R_HC, calibration), _azimuths(b, two.R_HC, calibration)
        values, places = (one_rad - two_rad + np.pi) % (2.0 * np.pi) - np.pi, 0.5 * (one_rad + two_rad)
        unit = calibration.pixel_pitch_m / calibration.focal_length_m  # [rad] a pixel
    else:
        values, places, unit = b[:, 0] - a[:, 0], 0.5 * (a[:, 0] + b[:, 0]) - one.middle_px, 1.0
    powers = 1 if not settings.spreads else 2 if isinstance(calibration, Camera) else 3
    A = np.vander(places / (_SPREAD_PX * unit), powers, increasing=True)
    inside, mean, sigma = _shared(A, values, settings.least_sigma_px * unit)
    if inside.sum() < settings.fewest_matches or inside.sum() < settings.least_share * len(a):
        return Turn.none(TurnStatus.DISAGREE, len(a))
    if isinstance(calibration, HeadingLine):
        turn, sigma = calibration.turn_rad(mean), abs(calibration.slope_rad_px) * sigma
    else:
        turn = mean
    return Turn(TurnStatus.MEASURED, turn, sigma, mean / unit, len(a), (a[inside], b[inside]))


def _shared(A: Array, values: Array, least_sigma: float) -> tuple[NDArray[np.bool_], float, float]:
    """Which matches (m,) share one shift, its first coefficient on the columns of A, and that one's sigma."""
    inside = np.abs(values - np.median(values)) <= _SIGMAS * max(_robust_sigma(values), least_sigma)
    x: Array = np.zeros(A.shape[1])
    for _ in range(_ROUNDS):
        x = np.linalg.lstsq(A[inside], values[inside], rcond=None)[0]
        residuals = values - A @ x
        now = np.abs(residuals) <= _SIGMAS * max(_robust_sigma(residuals[inside]), least_sigma)
        if (now == inside).all() or now.sum() <= A.shape[1]:
            break
        inside = now
    freedom = max(int(inside.sum()) - A.shape[1], 1)
    variance = float(np.sum((values - A @ x)[inside] ** 2)) / freedom
    share = float(np.linalg.pinv(A[inside].T @ A[inside])[0, 0])
    return inside, float(x[0]), float(np.sqrt(variance * share))


def _robust_sigma(values: Array) -> float:
    return _MAD * float(np.median(np.abs(values - np.median(values))))


def _azimuths(pixels: Array, R_HC: Array | None, camera: Camera) -> Array:
    rays = camera.rays_from_pixels(pixels)
    rays = rays if R_HC is None else rays @ np.asarray(R_HC).T
    return np.arctan2(rays[:, 1], rays[:, 0])
