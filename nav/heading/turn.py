"""How far a camera has turned between two images, by the columns in which the same features stand.

Of the matches' column shifts x_i = u_2 - u_1 [px] a robust mean is taken, of those within three robust sigmas of their
median.

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

Over ground the spread is not alike everywhere: who flies s forward and l to the left, h over a plane, sees what lies at
a depression e go by, and what is near the horizon stay. With `over_ground` (attitudes given) s/h and l/h are fitted in
the place of k, the second with a prior, as one goes where one looks but for wind and angle of attack in a bank:

    d_i = d - (s sin a_i - l cos a_i)/h tan e_i,   a_i: azimuth from the heading halfway between both       (14)

What is refused, and says so: too few matches; matches that disagree (most do not share one shift, as when what moves
with the camera fills the view); a turn of too large a sigma. Valid for what is far away, or with Eq. (14) on one plane:
else a step sideways of s turns what is r away by s / r.
Source: [Kyung et al. 2015, eqs 3 to 6, 11].
Corrected: the sign of b in the source's printed line, which its own example contradicts.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from enum import Enum
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from dockair.calibration import Camera
from dockair.errors import DockairError, check_numbers
from dockair.nav.heading.features import Features, features_of, matched
from dockair.rotations import Array

_MAD = 1.4826  # standard deviation of a normal law over its median absolute deviation
_SIGMAS = 3.0
_ROUNDS = 5
_SPREAD_PX = 1000.0  # unit of places in Eq. (13), for the arithmetic's sake


__all__ = ["HeadingLine", "Turn", "TurnStatus", "VisualSettings", "fit_heading_line", "measure_turn"]


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
        """Turn that a mean column shift says."""
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
    over_ground: bool = False  #: Eq. (14) in its place: level attitudes are given, what is seen below is a plane
    sideways: float = 0.01  #: sigma of the way sideways over the height, between two images, of Eq. (14)
    least_sigma_px: float = 0.3  #: robust sigma that is believed; in pixels of the full image
    largest_sigma_rad: float = float(np.radians(1.0))  #: of a turn that is believed
    key_turn_rad: float = float(np.radians(5.0))  #: after which the next key frame is taken
    key_matches: int = 40  #: below which it is taken

    @classmethod
    def for_aircraft(cls) -> "VisualSettings":
        """Constants of a fixed-wing aircraft over ground and cloud, with frames every 2 s and its attitude known."""
        return cls(
            over_ground=True,
            largest_sigma_rad=float(np.radians(0.2)),
            key_turn_rad=float(np.radians(2.0)),
        )

    def __post_init__(self) -> None:
        for name in ("scale", "ratio", "least_share"):
            if not 0.0 < getattr(self, name) <= 1.0:
                raise DockairError(name, expected="a number above 0, up to 1", got=getattr(self, name))
        check_numbers("heading.visual", self, zero=("key_matches",), infinite=("largest_sigma_rad", "key_turn_rad"))


class TurnStatus(Enum):
    """What came of two images."""

    MEASURED = "measured"
    FIRST = "first image"
    TOO_FEW = "too few matches"
    DISAGREE = "matches disagree"
    UNCERTAIN = "turn too uncertain"


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
        features_of(image, s, mask, R) for image, mask, R in zip((first, second), masks, attitudes_R_HC, strict=True)
    )
    if np.shape(first) != np.shape(second):
        raise DockairError("second", expected=f"an image of shape {np.shape(first)}", got=np.shape(second))
    return turn_between(one, two, calibration, s)


def turn_between(one: Features, two: Features, calibration: HeadingLine | Camera, settings: VisualSettings) -> Turn:
    a, b = matched(one, two, settings.ratio)
    if len(a) < settings.fewest_matches:
        return Turn.none(TurnStatus.TOO_FEW, len(a))
    if isinstance(calibration, Camera):
        unit = calibration.pixel_pitch_m / calibration.focal_length_m  # [rad] a pixel
        directions = _directions(a, one.R_HC, calibration), _directions(b, two.R_HC, calibration)
        values, A = _azimuth_model(*directions, settings)
    else:
        values, places, unit = b[:, 0] - a[:, 0], 0.5 * (a[:, 0] + b[:, 0]) - one.middle_px, 1.0
        A = np.vander(places / _SPREAD_PX, 3 if settings.spreads else 1, increasing=True)
    least, prior = settings.least_sigma_px * unit, np.zeros((1, A.shape[1]))
    if isinstance(calibration, Camera) and settings.over_ground:
        prior[0, -1] = least / settings.sideways
    inside, mean, sigma = _shared(A, values, least, prior)
    if inside.sum() < settings.fewest_matches or inside.sum() < settings.least_share * len(a):
        return Turn.none(TurnStatus.DISAGREE, len(a))
    if isinstance(calibration, HeadingLine):
        turn, sigma = calibration.turn_rad(mean), abs(calibration.slope_rad_px) * sigma
    else:
        turn = mean
    if sigma > settings.largest_sigma_rad:
        return Turn.none(TurnStatus.UNCERTAIN, len(a))
    return Turn(TurnStatus.MEASURED, turn, sigma, mean / unit, len(a), (a[inside], b[inside]))


def _shared(A: Array, values: Array, least_sigma: float, prior: Array) -> tuple[NDArray[np.bool_], float, float]:
    """Which matches (m,) share one shift, its first coefficient on the columns of A, and that one's sigma.

    The prior (1, columns) is a row of A whose value is 0 and whose sigma is the least.
    """
    inside = np.abs(values - np.median(values)) <= _SIGMAS * max(_robust_sigma(values), least_sigma)
    x: Array = np.zeros(A.shape[1])
    for _ in range(_ROUNDS):
        x = np.linalg.lstsq(np.vstack([A[inside], prior]), np.append(values[inside], 0.0), rcond=None)[0]
        residuals = values - A @ x
        now = np.abs(residuals) <= _SIGMAS * max(_robust_sigma(residuals[inside]), least_sigma)
        if (now == inside).all() or now.sum() <= A.shape[1]:
            break
        inside = now
    freedom = max(int(inside.sum()) - A.shape[1], 1)
    variance = float(np.sum((values - A @ x)[inside] ** 2)) / freedom
    share = float(np.linalg.pinv(A[inside].T @ A[inside] + prior.T @ prior)[0, 0])
    return inside, float(x[0]), float(np.sqrt(variance * share))


def _robust_sigma(values: Array) -> float:
    return _MAD * float(np.median(np.abs(values - np.median(values))))


def _azimuth_model(one: Array, two: Array, settings: VisualSettings) -> tuple[Array, Array]:
    """(m,) differences of azimuths, Eq. (12), of directions (m, 3), and the columns (m, 1 or 2) that explain them."""
    azimuths = np.arctan2(one[:, 1], one[:, 0]), np.arctan2(two[:, 1], two[:, 0])
    differences = (azimuths[0] - azimuths[1] + np.pi) % (2.0 * np.pi) - np.pi
    middle = azimuths[1] + 0.5 * differences
    columns = [np.ones_like(middle)]
    if settings.over_ground:
        slopes = [np.maximum(-d[:, 2], 0.0) / np.hypot(d[:, 0], d[:, 1]) for d in (one, two)]
        slope = 0.5 * (slopes[0] + slopes[1])
        columns += [-slope * np.sin(middle), slope * np.cos(middle)]  # Eq. (14)
    elif settings.spreads:
        columns.append(middle)  # Eq. (13)
    return differences, np.column_stack(columns)


def _directions(pixels: Array, R_HC: Array | None, camera: Camera) -> Array:
    """(n, 3) in level axes."""
    rays = camera.rays_from_pixels(pixels)
    return rays if R_HC is None else np.asarray(rays @ np.asarray(R_HC).T)
