"""Cramer-Rao bound of a ring's pose: the least covariance that any unbiased estimator can have.

    N = Sum_i J_i' W_i J_i,    bound = (N + prior information)^-1                   (1)

with J_i the derivative of a line of sight in (phi, delta), Eq. (1) of `pose.model`, and W_i = G'G/sigma_i^2 its weight
from the pixel's noise, distortion included, Eq. (2) there; both at the true pose. R_CD <- exp(phi) R_CD, p_CD <- p_CD +
delta in camera axes. The other way round, for the camera at o = p_DC = -R'p in drogue axes, R_DC <- R_DC exp(-phi) and

    do = -R' (delta + p x phi)                                                      (2)

Per metre of focal-plane error instead of per sigma in pixels it is `dilution`'s covariance.

Not modelled: errors common to the LEDs (calibration, mounting), LEDs hidden by the basket, their beam. It is the bound
of the linearised problem: when sigma of the tilt reaches the tilt at which perspective tells, a flat ring seen from the
front has two minima within it, and no estimator without a prior comes near.
"""

from dataclasses import dataclass
from math import hypot
from typing import cast

import numpy as np
from numpy.typing import NDArray

from dockair.calibration import Camera
from dockair.errors import DockairError
from dockair.nav.dop.dilution import DopStatus, _finite, _rotation
from dockair.nav.pose import model
from dockair.nav.pose.measurement import tangent_weights
from dockair.rotations import Array, skew

_SINGULAR = 1e-13  # smallest eigenvalue of N at unit diagonal: no more than rounding leaves
_GRAZING = 1e-9  # cosine to the boresight below which a line of sight has no pixel in double precision
_NEAREST_M, _FARTHEST_M = 1e-50, 1e50  # beyond, squares leave double precision
_NO_TURN = np.zeros(3)  # MRP


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class PoseBound:
    """Bound of one pose; the state is (phi, delta) in camera axes, as everywhere in `nav.pose`."""

    status: DopStatus
    covariance: Array  #: (6, 6) of (phi, delta) [rad, m]; NaN unless SOLVED
    camera_in_drogue: Array  #: (6, 6) of (phi, do) with phi in camera, do in drogue axes [rad, m], Eq. (2)
    seen: NDArray[np.bool_]  #: (n,) LEDs that count: in front of the camera and on its sensor
    information: Array  #: (n, 6, 6) of each LED in (phi, delta), NaN where not seen; for `best_subset`
    line_of_sight: Array  #: (3,) unit vector to the drogue, camera axes

    position = property(lambda self: slice(3, 6), doc="Where the position stands in the state.")
    attitude = property(lambda self: slice(0, 3), doc="Where the attitude stands in the state.")

    @property
    def range_sigma_m(self) -> float:
        """Of the drogue in camera axes, along the line of sight."""
        return float(np.sqrt(self.line_of_sight @ self.covariance[3:, 3:] @ self.line_of_sight))

    @property
    def lateral_sigma_m(self) -> float:
        """Of the drogue in camera axes, across the line of sight, both directions together."""
        return float(np.sqrt(np.trace(self.covariance[3:, 3:]) - self.range_sigma_m**2))

    @property
    def attitude_sigma_rad(self) -> float:
        """All three axes together."""
        return float(np.sqrt(np.trace(self.covariance[:3, :3])))

    @property
    def camera_range_sigma_m(self) -> float:
        """Of the camera in drogue axes, along the drogue's x."""
        return float(np.sqrt(self.camera_in_drogue[3, 3]))

    @property
    def camera_lateral_sigma_m(self) -> float:
        """Of the camera in drogue axes, along the drogue's y and z together."""
        return float(np.sqrt(self.camera_in_drogue[4, 4] + self.camera_in_drogue[5, 5]))


def pose_bound(
    points_D: Array,
    R_CD: Array,
    p_CD: Array,
    camera: Camera,
    sigma_px: float | Array = 0.1,
    *,
    prior_information: Array | None = None,
    sensor_edges: bool = True,
) -> PoseBound:
    """Return the bound on the pose of LEDs that a camera sees.

    Args:
        points_D: (n, 3) LEDs in drogue axes [m], in a plane or not.
        R_CD: (3, 3) true attitude.
        p_CD: (3,) true position [m].
        camera: calibration, distortion included.
        sigma_px: standard deviation of a pixel coordinate, one for all or (n,).
        prior_information: (6, 6) known beside the frame, in (phi, delta); then fewer than three LEDs will do.
        sensor_edges: whether an LED beyond the sensor's edge is not seen; False is an endless image plane.

    Raises:
        DockairError: wrong shapes, numbers that are not finite, R_CD no rotation, sigma not positive.
    """
    points, R, p = _finite(points_D, "points_D", (-1, 3)), _rotation(R_CD, "R_CD"), _finite(p_CD, "p_CD", (3,))
    sigma = np.full(len(points), sigma_px, dtype=float) if np.ndim(sigma_px) == 0 else np.array(sigma_px, dtype=float)
    if sigma.shape != (len(points),) or not (np.isfinite(sigma) & (sigma > 0.0)).all():
        raise DockairError("sigma_px", expected=f"one number > 0, or {len(points)} of them", got=sigma_px)
    prior = np.zeros((6, 6)) if prior_information is None else _finite(prior_information, "prior_information", (6, 6))
    information, covariance = np.full((len(points), 6, 6), np.nan), np.full((6, 6), np.nan)
    with np.errstate(over="ignore", invalid="ignore"):  # what overflows has no inverse and is told by the status
        points_C = points @ R.T + p
        in_front = _in_front(points_C)
        seen = _on_sensor(points_C, in_front, camera) if sensor_edges else in_front
        information[seen] = _information(points[seen], R, p, camera, sigma[seen])
        if prior_information is not None or seen.sum() >= 3:
            status, covariance = _inverse(information[seen].sum(axis=0) + prior)
        elif not in_front.any():
            status = DopStatus.BEHIND_CAMERA
        else:
            status = DopStatus.TOO_FEW_LANDMARKS if seen.any() else DopStatus.OFF_SENSOR
    to_drogue = np.zeros((6, 6))
    to_drogue[:3, :3], to_drogue[3:, :3], to_drogue[3:, 3:] = np.eye(3), -R.T @ skew(p), -R.T
    return PoseBound(
        status=status,
        covariance=covariance,
        camera_in_drogue=to_drogue @ covariance @ to_drogue.T,
        seen=seen,
        information=information,
        line_of_sight=p / max(hypot(*p), np.finfo(float).tiny),
    )


def _in_front(points_C: Array) -> NDArray[np.bool_]:
    distance = np.abs(points_C).max(axis=1, initial=0.0)
    return np.asarray((points_C[:, 0] > _GRAZING * distance) & (distance > _NEAREST_M) & (distance < _FARTHEST_M))


def _on_sensor(points_C: Array, in_front: NDArray[np.bool_], camera: Camera) -> NDArray[np.bool_]:
    """(n,) of those in front the ones whose image lies on the sensor."""
    pixels, seen = camera.pixels_from_points(points_C[in_front]), in_front.copy()
    high = np.array([camera.width_px - 0.5, camera.height_px - 0.5])
    seen[in_front] = ((pixels >= -0.5) & (pixels <= high)).all(axis=1)
    return seen


def _information(points: Array, R: Array, p: Array, camera: Camera, sigma: Array) -> Array:
    """(n, 6, 6) J'WJ."""
    rays, J = model.lines_of_sight(_NO_TURN, p, points @ R.T, model.LOCAL)  # in (phi, delta) the LEDs' arms are enough
    distortion = np.zeros(5) if camera.distortion is None else np.array(camera.distortion)
    W = tangent_weights(rays, camera.focal_length_px, distortion, sigma)
    return cast(Array, np.swapaxes(J, 1, 2) @ W @ J)


def _inverse(N: Array) -> tuple[DopStatus, Array]:
    """Return N^-1 by its eigenvalues at unit diagonal."""
    scale = np.diag(N)
    if (scale > 0.0).all() and np.isfinite(N).all():
        unit = 1.0 / np.sqrt(scale)
        values, vectors = np.linalg.eigh(N * unit * unit[:, None])
        if values[0] > _SINGULAR:
            root = unit[:, None] * vectors / np.sqrt(values)
            return DopStatus.SOLVED, root @ root.T
    return DopStatus.SINGULAR, np.full((6, 6), np.nan)
