"""What is expected of the ring before the frame is looked at: centre, size, roll.

Roll phi is the angle of LED 0 in the image seen from the centre, from left (-u) toward up (-v):

    (u, v)_k = centre - r (cos(phi + 45 k), sin(phi + 45 k))                              (1)
"""

import math
from dataclasses import dataclass, replace
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from dockair.calibration import Camera
from dockair.errors import DockairError
from dockair.nav.identify.perspective import undistorted_prediction
from dockair.rotations import Array

Expectation = TypeVar("Expectation", Array, float)

_EVEN = np.column_stack([np.cos(np.arange(8) * np.pi / 4), np.sin(np.arange(8) * np.pi / 4)])
ANYWHERE_PX = 1e6  #: radius of a gate that lets everything pass


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class RingPrior:
    """Gates that follow from the expectations, without the lens's distortion; wide open where there is none."""

    centre_px: Array  #: (2,)
    centre_tolerance_px: float  #: of a fitted ring's centre
    centre_slack_px: float  #: by which an affine octagon's centre, or a circle's, may differ from the ring's
    radius_range_px: tuple[float, float]
    expected_radius_px: float  #: NaN when unknown
    roll_rad: float  #: NaN when unknown
    roll_tolerance_rad: float = np.pi  #: of an octagon's roll, up to the ring's symmetry
    prediction_px: Array | None = None  #: (8, 2) of every LED, with sigma: from a track, not from nominal geometry

    @property
    def has_centre(self) -> bool:
        """Whether the ring is expected somewhere."""
        return self.centre_tolerance_px < ANYWHERE_PX

    @property
    def gate(self) -> tuple[float, float, float]:
        """(u, v, radius) of the disc for an affine centre."""
        return float(self.centre_px[0]), float(self.centre_px[1]), self.centre_tolerance_px + self.centre_slack_px

    @property
    def roll_gate(self) -> tuple[float, float]:
        """Roll and tolerance of an affine octagon; open when there is no roll."""
        return (0.0, np.pi) if np.isnan(self.roll_rad) else (self.roll_rad, self.roll_tolerance_rad)

    @property
    def prefers(self) -> bool:
        """Whether of several rings one may be preferred, for its size or its roll."""
        return not (np.isnan(self.expected_radius_px) and np.isnan(self.roll_rad))

    def allows(self, centre_px: Array, radius_px: float) -> bool:
        """Whether a fitted ring lies where, and is as large as, it should."""
        inside = not self.has_centre or np.hypot(*(centre_px - self.centre_px)) <= self.centre_tolerance_px
        return bool(inside and self.radius_range_px[0] <= radius_px <= self.radius_range_px[1])

    def tightened(self, radius_tolerance: float, roll_tolerance_rad: float) -> "RingPrior":
        """The same with the gates of a prediction: radius to a fraction, roll to an angle."""
        radius = self.expected_radius_px
        return replace(
            self,
            radius_range_px=(radius * (1.0 - radius_tolerance), radius * (1.0 + radius_tolerance)),
            roll_tolerance_rad=roll_tolerance_rad,
        )

    def shape_error_px(self, points: Array, numbers: NDArray[np.int64]) -> float:
        """Largest distance of LEDs (m, 2) from the prediction of their numbers (m,), moved, turned and scaled to them.

        What is left is noise, a change of tilt, or an impostor; 0 without a prediction.
        """
        if self.prediction_px is None:
            return 0.0
        expected = self.prediction_px[numbers]
        theirs, mine = (x[:, 0] + 1j * x[:, 1] - (x[:, 0] + 1j * x[:, 1]).mean() for x in (points, expected))
        similarity = np.vdot(mine, theirs) / np.vdot(mine, mine)
        return float(np.abs(theirs - similarity * mine).max())


def ring_from_leds(led_px: Array, angle_rad: Array | None = None) -> tuple[Array, float, float]:
    """Centre (2,), radius (larger semi-axis) and roll of eight LEDs (8, 2): Eq. (1) for a tilted ring.

    The offsets are -(A_0 cos theta_k + A_1 sin theta_k) in the least-squares sense; roll is the rotation part of
    [A_0 A_1]. Angles theta (8,) are 45 k when not given.
    """
    if angle_rad is None:
        centre, A = led_px.sum(axis=0) / 8.0, -0.25 * led_px.T @ _EVEN  # the columns are orthogonal, squares 4
    else:
        columns = np.column_stack([np.ones(8), -np.cos(angle_rad), -np.sin(angle_rad)])
        solution = np.linalg.lstsq(columns, led_px, rcond=None)[0]
        centre, A = solution[0], solution[1:].T
    (a, b), (c, d) = A.tolist()
    square, area = 0.5 * float((A**2).sum()), a * d - b * c
    radius = math.sqrt(square + math.sqrt(max(square * square - area * area, 0.0)))
    return centre, radius, float(np.arctan2(c - b, a + d))


def _finite(expectation: Expectation | None) -> Expectation | None:
    return expectation if expectation is not None and np.isfinite(expectation).all() else None


def make_prior(
    radius_range_px: tuple[float, float],
    centre_tolerance_radii: float,
    radius_tolerance: float,
    centre_px: Array | None,
    radius_px: float | None,
    roll_rad: float | None,
    led_px: Array | None,
    sigma_px: float | None,
    led_angle_rad: Array | None = None,
    camera: Camera | None = None,
) -> RingPrior:
    """Gates from whatever is expected; an expectation that is not finite is none (a prediction behind the camera).

    Args:
        radius_range_px: when no radius is expected.
        centre_tolerance_radii: of a centre without sigma, in radii.
        radius_tolerance: of the radius, as a fraction.
        centre_px: (2,) expected centre, or None.
        radius_px: expected radius, or None.
        roll_rad: expected roll, or None.
        led_px: (8, 2) expected LEDs, or None: stands for those of the three above that are None.
        sigma_px: of the expected centre, or None.
        led_angle_rad: (8,) where the LEDs stand on the ring; None for every 45 degrees.
        camera: whose pixels are expected, its distortion is taken off; None where they have none.

    Raises:
        DockairError: wrong shapes.
    """
    centre_px, led_px = _finite(centre_px), _finite(led_px)
    radius_px, roll_rad, sigma_px = _finite(radius_px), _finite(roll_rad), _finite(sigma_px)
    if centre_px is not None:
        centre_px = np.asarray(centre_px, dtype=float)
        if centre_px.shape != (2,):
            raise DockairError("identify.expected_centre_px", expected="an array of shape (2,)", got=centre_px.shape)
        centre_px = centre_px if camera is None else undistorted_prediction(centre_px[None], camera)[0]
    if led_px is not None:
        led_px = np.asarray(led_px, dtype=float)
        if led_px.shape != (8, 2):
            raise DockairError("identify.expected_led_px", expected="an array of shape (8, 2)", got=led_px.shape)
        led_px = led_px if camera is None else undistorted_prediction(led_px, camera)
        centre, radius, roll = ring_from_leds(led_px, led_angle_rad)
        centre_px = centre if centre_px is None else centre_px
        radius_px = radius if radius_px is None else radius_px
        roll_rad = roll if roll_rad is None else roll_rad
    if radius_px is not None:
        radius_range_px = (radius_px * (1.0 - radius_tolerance), radius_px * (1.0 + radius_tolerance))
    tolerance = ANYWHERE_PX
    if centre_px is not None:
        # five sigma, and the two per cent of the radius by which a mean of LEDs and a ring's centre differ
        open_gate = centre_tolerance_radii * radius_range_px[1]
        tolerance = open_gate if sigma_px is None else 5.0 * sigma_px + 0.02 * radius_range_px[1]
    return RingPrior(
        centre_px=np.zeros(2) if centre_px is None else centre_px,
        centre_tolerance_px=tolerance,
        centre_slack_px=0.1 * radius_range_px[1],
        radius_range_px=radius_range_px,
        expected_radius_px=np.nan if radius_px is None else float(radius_px),
        roll_rad=np.nan if roll_rad is None else float(roll_rad),
        prediction_px=led_px if sigma_px is not None else None,
    )
