"""Ellipse through points by direct least squares; its circle; the ring's places on it.

    F(x, y) = a x^2 + b x y + c y^2 + d x + e y + f = 0                            [Yoon 2018, eq 12]
    min |D A|^2  subject to  4 a c - b^2 = 1                                       (1)

(1) is the constraint of Fitzgibbon, Pilu & Fisher (1999); the source prints b^2 - 4ac = 1 (eq 16), which gives
hyperbolas. It is solved in the partitioned form of Halir & Flusser (1998), which stays regular for exact data, on
points shifted to their mean and scaled to unit size. With the conic's sign chosen so that a + c > 0,

    root = sqrt((a - c)^2 + b^2),   D = 4ac - b^2,   centre = ((b e - 2 c d), (b d - 2 a e)) / D    [eq 23]
    semi-axes = sqrt(2 g / ((a + c) -+ root)),   g = -F(centre)                                      (2)
    angle of the major axis = atan2(c - a - root, b)                                                 [eq 25]

(2) stands for eq (24), missing from the text. Without the choice of sign eq (25) gives the minor axis for a < 0.
Turned to its axes and stretched by A/B along the minor one the ellipse is a circle (3); eq (26) says so for one point.
On that circle a tilted ring's LEDs stand 45 degrees apart but for perspective (43.6 to 46.4 at 2.5 m and 20 degrees).

The ellipse's centre is not the image of the ring's centre (6.5 px off at 3 m and 20 degrees): it identifies, it does
not measure.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from dockair.rotations import Array

MIN_POINTS = 5  # a conic has five parameters


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Ellipse:
    """An ellipse in the image."""

    conic: Array  #: (6,) a, b, c, d, e, f with 4ac - b^2 = 1 and a + c > 0
    centre_px: Array  #: (2,)
    semi_axes_px: Array  #: (2,) larger, smaller
    angle_rad: float  #: of the major axis from +u toward +v, in (-pi/2, pi/2]

    def to_circle(self, points: Array) -> Array:
        """(n, 2) places of points (n, 2) relative to the centre after Eq. (3): on the ellipse, at radius A."""
        c, s = np.cos(self.angle_rad), np.sin(self.angle_rad)
        axes = np.array([[c, s], [-s, c]])  # image -> major, minor
        stretch = np.diag([1.0, self.semi_axes_px[0] / self.semi_axes_px[1]])
        return np.asarray((points - self.centre_px) @ (axes.T @ stretch @ axes).T)

    def from_circle(self, places: Array) -> Array:
        """(n, 2) points whose places on the circle are given (n, 2): the inverse of `to_circle`."""
        c, s = np.cos(self.angle_rad), np.sin(self.angle_rad)
        axes = np.array([[c, s], [-s, c]])
        shrink = np.diag([1.0, self.semi_axes_px[1] / self.semi_axes_px[0]])
        return np.asarray(places @ (axes.T @ shrink @ axes).T + self.centre_px)


def ellipse_from_conic(conic: Array) -> Ellipse | None:
    """The ellipse of a conic (6,) of either sign; None if it is no real ellipse."""
    a, b, c, d, e, f = (float(x) for x in (conic if conic[0] + conic[2] > 0 else -np.asarray(conic)))
    discriminant = 4.0 * a * c - b * b
    if not np.isfinite(discriminant) or discriminant <= 0.0:
        return None
    u, v = (b * e - 2.0 * c * d) / discriminant, (b * d - 2.0 * a * e) / discriminant
    g = -(f + 0.5 * (d * u + e * v))
    root = float(np.hypot(a - c, b))
    # (a + c) - root without cancellation
    small = discriminant / ((a + c) + root)
    if g <= 0.0:
        return None
    angle = float(np.arctan2(c - a - root, b)) if root > 0.0 else 0.0
    return Ellipse(
        conic=np.array([a, b, c, d, e, f]) / np.sqrt(discriminant),
        centre_px=np.array([u, v]),
        semi_axes_px=np.sqrt(2.0 * g / np.array([small, (a + c) + root])),
        angle_rad=angle + np.pi if angle <= -0.5 * np.pi else angle - np.pi if angle > 0.5 * np.pi else angle,
    )


def fit_ellipse(points: Array) -> Ellipse | None:
    """Direct least squares, Eq. (1).

    Args:
        points: (n, 2) px.

    Returns:
        None for fewer than five points, or when they fix no ellipse (on a line, coincident).
    """
    points = np.asarray(points, dtype=float).reshape(-1, 2)
    if len(points) < MIN_POINTS or not np.isfinite(points).all():
        return None
    mean = points.mean(axis=0)
    scale = float(np.sqrt(((points - mean) ** 2).sum(axis=1).mean()))
    if scale == 0.0:
        return None
    x, y = ((points - mean) / scale).T
    quadratic, linear = np.column_stack([x * x, x * y, y * y]), np.column_stack([x, y, np.ones_like(x)])
    S1, S2, S3 = quadratic.T @ quadratic, quadratic.T @ linear, linear.T @ linear
    if np.linalg.cond(S3) > 1e12:  # all on one line
        return None
    T = -np.linalg.solve(S3, S2.T)
    M = S1 + S2 @ T
    _, vectors = np.linalg.eig(np.array([M[2] / 2.0, -M[1], M[0] / 2.0]))
    vectors = vectors.real
    constraint = 4.0 * vectors[0] * vectors[2] - vectors[1] ** 2
    best = int(np.argmax(constraint))  # exactly one of the three is positive, but for rounding
    if not constraint[best] > 0.0:
        return None
    a1 = vectors[:, best]
    return ellipse_from_conic(_conic_from_normalised(np.concatenate([a1, T @ a1]), mean, scale))


def _conic_from_normalised(conic: Array, mean: Array, scale: float) -> Array:
    """The conic in pixels of one in (pixels - mean) / scale."""
    a, b, c, d, e, f = conic
    m, n = mean
    a, b, c, d, e = a / scale**2, b / scale**2, c / scale**2, d / scale, e / scale
    return np.array(
        [
            a,
            b,
            c,
            d - 2.0 * a * m - b * n,
            e - 2.0 * c * n - b * m,
            f + a * m * m + b * m * n + c * n * n - d * m - e * n,
        ]
    )


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Places:
    """Points on a circle, each at its nearest of equally spaced places."""

    slot: NDArray[np.int64]  #: (n,) 0 to count - 1
    phase_rad: float  #: angle of place 0, in (-pi/count, pi/count]
    residual_rad: Array  #: (n,) angle beyond the place


def places_on_circle(points: Array, count: int = 8) -> Places:
    """Nearest of `count` equally spaced places for each point (n, 2) relative to the circle's centre.

    The phase is that of the points' mean `count`-th power, so that every point may be at any place.
    """
    angle = np.arctan2(points[:, 1], points[:, 0])
    spacing = 2.0 * np.pi / count
    phase = float(np.angle(np.exp(1j * count * angle).mean())) / count
    steps = np.round((angle - phase) / spacing)
    return Places(slot=steps.astype(np.int64) % count, phase_rad=phase, residual_rad=angle - phase - steps * spacing)
