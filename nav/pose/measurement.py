"""Measured lines of sight with their weights, from pixels; see `model` for what they mean."""

from dataclasses import dataclass

import numpy as np
from numba import njit

from dockair.calibration import Camera
from dockair.rotations import Array


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class LinesOfSight:
    """What the camera says about n LEDs, with nothing assumed about the pose."""

    rays: Array  #: (n, 3) unit vectors in camera axes
    weights: Array  #: (n, 3, 3) W of `model`'s Eq. (2), or isotropic
    points_D: Array  #: (n, 3) LEDs in drogue axes [m]
    sigma_px: Array  #: (n,) standard deviation of each pixel coordinate


def lines_of_sight_from_pixels(pixels: Array, points_D: Array, camera: Camera, sigma_px: Array) -> LinesOfSight:
    """Return lines of sight with the efficient weight, Eq. (2) of `model`.

    Args:
        pixels: (n, 2) LEDs' pixels (u, v), finite.
        points_D: (n, 3) the same LEDs in drogue axes [m].
        camera: its calibration, distortion included.
        sigma_px: (n,) standard deviation of each pixel coordinate.
    """
    rays = camera.rays_from_pixels(pixels)
    distortion = np.zeros(5) if camera.distortion is None else np.array(camera.distortion)
    weights = tangent_weights(rays, camera.focal_length_px, distortion, sigma_px)
    return LinesOfSight(rays=rays, weights=weights, points_D=points_D, sigma_px=sigma_px)


def isotropic_weights(count: int, sigma: float) -> Array:
    """(count, 3, 3) the source's weight R = sigma^2 I of a unit vector's three components, for its reproduction."""
    return np.asarray(np.tile(np.eye(3) / sigma**2, (count, 1, 1)))


@njit(cache=True)
def tangent_weights(rays: Array, focal_length_px: float, distortion: Array, sigma_px: Array) -> Array:
    """(n, 3, 3) weights G'G/sigma^2, G = d(pixel)/dh at the ray.

    Args:
        rays: (n, 3) unit vectors in camera axes.
        focal_length_px: focal length [px].
        distortion: (5,) k1, k2, p1, p2, k3; zeros for none.
        sigma_px: (n,) standard deviation of each pixel coordinate.
    """
    k1, k2, p1, p2, k3 = distortion
    weights, G = np.empty((len(rays), 3, 3)), np.empty((2, 3))
    for i in range(len(rays)):
        x = rays[i, 0]
        a, b = -rays[i, 1] / x, -rays[i, 2] / x
        r2 = a * a + b * b
        s, ds = 1.0 + r2 * (k1 + r2 * (k2 + r2 * k3)), 2.0 * (k1 + r2 * (2.0 * k2 + 3.0 * k3 * r2))
        aa = s + ds * a * a + 2.0 * p1 * b + 6.0 * p2 * a  # derivative of calibration's Eq. (1)
        ab = ds * a * b + 2.0 * p1 * a + 2.0 * p2 * b
        bb = s + ds * b * b + 6.0 * p1 * b + 2.0 * p2 * a
        scale = focal_length_px / (sigma_px[i] * x)
        G[0, 0], G[0, 1], G[0, 2] = -(aa * a + ab * b) * scale, -aa * scale, -ab * scale
        G[1, 0], G[1, 1], G[1, 2] = -(ab * a + bb * b) * scale, -ab * scale, -bb * scale
        for j in range(3):
            for k in range(3):
                weights[i, j, k] = G[0, j] * G[0, k] + G[1, j] * G[1, k]
    return weights
