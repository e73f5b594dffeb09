"""The exact image of a tilted ring of eight LEDs, fitted to candidates.

A ring of unit radius at p, spanned by two perpendicular unit vectors a, b (its y and z axis in camera axes):

    X_s = p + a cos 45 s + b sin 45 s,   u = c_u - f X_y/X_x,   v = c_v - f X_z/X_x         (1)

Six unknowns, like the affine octagon's, but exact: four LEDs leave two equations to check, eight leave ten. It is
fitted by Levenberg-Marquardt, and again from that fit mirrored along the line of sight, which parallel projection
cannot tell from it; the better one counts. Candidates off the fit by more than the tolerance are dropped, the worst
first, and candidates on it are taken up.

The pose serves identification alone (range in radii, attitude up to noise); `nav/pose` estimates the real one.
Not modelled: LEDs out of plane, distortion (give undistorted pixels).
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from dockair.calibration import Camera
from dockair.nav.identify.ring_pose import SLOTS, facing, fit_members
from dockair.rotations import Array

__all__ = ["SLOTS", "RingFit", "distorted", "fit_ring", "undistorted", "undistorted_prediction"]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class RingFit:
    """Eq. (1) fitted to some candidates."""

    candidate: NDArray[np.int64]  #: (8,) in each slot, -1 for none
    slots_px: Array  #: (8, 2) image of every slot, seen or not
    centre_px: Array  #: (2,) image of the ring's centre
    radius_px: float  #: f over the centre's depth: the radius of the ring's image if it were frontal
    tilt_rad: float  #: between the ring's axis and the camera's
    tolerance_px: float  #: largest residual allowed
    pose: Array  #: (3, 3) rows p, a, b of Eq. (1), in radii
    focal_length_px: float
    principal_point_px: tuple[float, float]
    rms_px: float  #: root of the squared residuals over the degrees of freedom; 0 when there are none

    @property
    def count(self) -> int:
        """Number of LEDs."""
        return int(np.count_nonzero(self.candidate >= 0))

    def image_px(self, angle_rad: Array) -> Array:
        """(n, 2) image of the ring's points at angles (n,), slot s standing at 45 s."""
        X = self.pose[0] + np.column_stack([np.cos(angle_rad), np.sin(angle_rad)]) @ self.pose[1:]
        return np.asarray(np.array(self.principal_point_px) - self.focal_length_px * X[:, 1:] / X[:, :1])


def fit_ring(
    points: Array,
    candidate: NDArray[np.int64],
    focal_length_px: float,
    principal_point_px: tuple[float, float],
    *,
    tolerance_px: float,
    tolerance_per_radius: float,
    max_tilt_rad: float = np.pi,
) -> RingFit:
    """Fit Eq. (1).

    Args:
        points: (n, 2) candidates, undistorted [px].
        candidate: (8,) which of them is in each slot, -1 for none; at least three.
        focal_length_px: of the camera, as the next.
        principal_point_px: (u, v).
        tolerance_px: largest residual; to it comes, root of the sum of squares,
        tolerance_per_radius: for the LEDs' own position errors [px/px].
        max_tilt_rad: of the two poses one beyond it gives way.
    """
    chosen, pose, image, rms_px, largest_px = fit_members(
        points, candidate, focal_length_px, principal_point_px, tolerance_px, tolerance_per_radius,
        math.cos(max_tilt_rad),
    )  # fmt: skip
    return RingFit(
        candidate=chosen,
        slots_px=image[:SLOTS],
        centre_px=image[SLOTS],
        radius_px=float(focal_length_px / pose[0, 0]),
        tilt_rad=math.acos(min(1.0, max(-1.0, facing(pose)))),
        tolerance_px=largest_px,
        pose=pose,
        focal_length_px=focal_length_px,
        principal_point_px=principal_point_px,
        rms_px=rms_px,
    )


def undistorted(pixels: Array, camera: Camera) -> Array:
    """Pixels of the same camera without distortion; not finite where no ray makes one, far off the sensor."""
    if camera.distortion is None:
        return pixels
    with np.errstate(all="ignore"):
        rays = camera.rays_from_pixels(pixels)
        return np.asarray(-camera.focal_length_px * rays[:, 1:] / rays[:, :1] + np.array(camera.principal_point_px))


def undistorted_prediction(pixels: Array, camera: Camera) -> Array:
    """Predicted pixels of the same camera without distortion; as they are where no ray makes one of them."""
    straight = undistorted(pixels, camera)
    return straight if np.isfinite(straight).all() else pixels


def distorted(pixels: Array, camera: Camera) -> Array:
    """Pixels of the camera at those of the same camera without distortion."""
    if camera.distortion is None:
        return pixels
    ab = (pixels - np.array(camera.principal_point_px)) / camera.focal_length_px
    return camera.pixels_from_points(np.column_stack([np.ones(len(ab)), -ab]))
