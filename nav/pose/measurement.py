"""What the camera says about named LEDs: lines of sight with their weights, from pixels; see `model`."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from dockair.calibration import Camera
from dockair.errors import DockairError
from dockair.nav.pose import model
from dockair.rotations import Array


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class LinesOfSight:
    """What the camera says about n LEDs, with nothing assumed about the pose."""

    rays: Array  #: (n, 3) unit vectors in camera axes
    weights: Array  #: (n, 3, 3) W of `model`'s Eq. (2), or isotropic
    points_D: Array  #: (n, 3) LEDs in drogue axes [m]
    sigma_px: Array  #: (n,) standard deviation of each pixel coordinate
    pixels: Array | None = None  #: (n, 2) when residuals are to be formed in pixels instead
    lens: Array | None = None  #: (8,) of `lens_of`, with pixels


def lens_of(camera: Camera) -> Array:
    """(8,) focal length, centre u, v [px], k1, k2, p1, p2, k3."""
    return np.array((camera.focal_length_px, *camera.principal_point_px, *(camera.distortion or (0.0,) * 5)))


def lines_of_sight_from_pixels(
    pixels: Array, points_D: Array, camera: Camera, sigma_px: Array, *, isotropic: bool = False
) -> LinesOfSight:
    """Return lines of sight with the efficient weight, Eq. (2) of `model`.

    Args:
        pixels: (n, 2) LEDs' pixels (u, v); what is not finite, or what no ray makes, is left out.
        points_D: (n, 3) the same LEDs in drogue axes [m].
        camera: its calibration, distortion included.
        sigma_px: (n,) standard deviation of each pixel coordinate.
        isotropic: the source's weight instead.
    """
    sight, _, _ = seen_lines_of_sight(pixels, points_D, lens_of(camera), sigma_px, isotropic=isotropic)
    return sight


def seen_lines_of_sight(
    pixels: Array, points_D: Array, lens: Array, sigma_px: Array, *, isotropic: bool = False, in_pixels: bool = False
) -> tuple[LinesOfSight, NDArray[np.bool_], int]:
    """Return lines of sight of the LEDs that were seen, which these are (n,), and how many of them stand apart."""
    seen, rays, weights, points, sigma, measured_px, apart = model.seen_leds(
        pixels, points_D, sigma_px, lens, isotropic
    )
    if in_pixels:
        sight = LinesOfSight(rays=rays, weights=weights, points_D=points, sigma_px=sigma, pixels=measured_px, lens=lens)
    else:
        sight = LinesOfSight(rays=rays, weights=weights, points_D=points, sigma_px=sigma)
    return sight, seen, apart


def measure(
    pixels: Array, points_D: Array, camera: Camera, sigma_px: float | Array, *, residuals: str, weight: str
) -> tuple[LinesOfSight, NDArray[np.bool_], int]:
    """Check what a person gave, then `seen_lines_of_sight`.

    Raises:
        DockairError: wrong shapes, points that are not finite, sigma not positive.
    """
    try:
        pixels = np.ascontiguousarray(pixels, dtype=float)
        points_D = np.ascontiguousarray(points_D, dtype=float)
    except (TypeError, ValueError):
        raise DockairError("pixels, points_D", expected="arrays (n, 2) and (n, 3) of numbers", got=pixels) from None
    if pixels.ndim != 2 or pixels.shape[1] != 2:
        raise DockairError("pixels", expected="an array (n, 2)", got=pixels.shape)
    n = len(pixels)
    sigma = np.empty(n)
    try:
        sigma[:] = sigma_px
    except (TypeError, ValueError):
        sigma = np.empty(0)
    if points_D.shape == (n, 3) and len(sigma) == n:
        seen = seen_lines_of_sight(
            pixels, points_D, lens_of(camera), sigma, isotropic=weight == "isotropic", in_pixels=residuals == "pixels"
        )
        if seen[2] >= 0:
            return seen
        bad_points = seen[2] == model.BAD_POINTS
    else:
        bad_points = points_D.shape != (n, 3)
    if bad_points:
        raise DockairError("points_D", expected=f"an array ({n}, 3) of finite numbers", got=points_D.shape)
    raise DockairError("sigma_px", expected=f"one number > 0, or {n} of them", got=sigma_px)


def isotropic_weights(count: int, sigma: float) -> Array:
    """(count, 3, 3) the source's weight R = sigma^2 I of a unit vector's three components, for its reproduction."""
    return np.asarray(np.tile(np.eye(3) / sigma**2, (count, 1, 1)))


def tangent_weights(rays: Array, focal_length_px: float, distortion: Array, sigma_px: Array) -> Array:
    """(n, 3, 3) weights G'G/sigma^2, G = d(pixel)/dh at the ray.

    Args:
        rays: (n, 3) unit vectors in camera axes.
        focal_length_px: focal length [px].
        distortion: (5,) k1, k2, p1, p2, k3; zeros for none.
        sigma_px: (n,) standard deviation of each pixel coordinate.
    """
    lens = np.array((focal_length_px, 0.0, 0.0, *distortion))
    return np.asarray(model.sight_weights(np.ascontiguousarray(rays), lens, np.ascontiguousarray(sigma_px)))
