"""Kernels of `track`: the ring after a turn of the camera, process noise, and the window."""

import numpy as np
from numba import njit

from dockair.rotations import Array

_NEAREST_M = 0.1  # depth of a ring that a turn has brought to the lens


@njit(cache=True)
def turned(
    x: Array, turn_C: Array, focal_px: float, centre_px: tuple[float, float], ring_radius_m: float, lever_C: Array
) -> tuple[float, float, float, float]:
    """u, v, r of a ring at rest, x (u, v, r, ...), when the camera has turned, and by what its roll has changed.

    Args:
        x: of the track.
        turn_C: (3,) rotation vector of the camera, in its own axes [rad].
        focal_px: focal length.
        centre_px: principal point.
        ring_radius_m: for the range.
        lever_C: (3,) the camera from the point about which it turns, in its own axes [m].
    """
    u, v, r = x[0], x[1], max(x[2], 1.0)
    a, b, ahead_m = (centre_px[0] - u) / focal_px, (centre_px[1] - v) / focal_px, focal_px * ring_radius_m / r
    p, q, s = ahead_m + lever_C[0], a * ahead_m + lever_C[1], b * ahead_m + lever_C[2]
    i, j, k = -turn_C[0], -turn_C[1], -turn_C[2]  # p <- exp(-turn) p about the end of the lever
    angle = np.sqrt(i * i + j * j + k * k)
    sine = 1.0 - angle**2 / 6.0 if angle < 1e-4 else np.sin(angle) / angle
    cosine = 0.5 - angle**2 / 24.0 if angle < 1e-4 else (1.0 - np.cos(angle)) / angle**2
    along = cosine * (i * p + j * q + k * s)
    rest = 1.0 - cosine * angle**2
    x_m = rest * p + along * i + sine * (j * s - k * q) - lever_C[0]
    y_m = rest * q + along * j + sine * (k * p - i * s) - lever_C[1]
    z_m = rest * s + along * k + sine * (i * q - j * p) - lever_C[2]
    nearer = ahead_m / max(x_m, _NEAREST_M)
    roll = -(turn_C[0] + 0.5 * (a * turn_C[1] + b * turn_C[2]))  # curl of the image's flow
    u += focal_px * (a - y_m / ahead_m * nearer)
    return u, v + focal_px * (b - z_m / ahead_m * nearer), r * nearer, roll


@njit(cache=True)
def process_noise(
    radius_px: float, dt: float, variance: float, acceleration_radii_s2: float, roll_acceleration_rad_s2: float
) -> Array:
    """(8, 8) Q of Eq. (1) of `track`."""
    r, Q = max(radius_px, 1.0), np.zeros((8, 8))
    for i in range(4):
        a2 = roll_acceleration_rad_s2**2 if i == 3 else (acceleration_radii_s2 * r) ** 2
        q = variance / r**2 if i == 3 else variance
        Q[i, i], Q[4 + i, 4 + i] = q + 0.25 * dt**4 * a2, q + dt**2 * a2
        Q[i, 4 + i] = Q[4 + i, i] = 0.5 * dt**3 * a2
    return Q


@njit(cache=True)
def predicted(x: Array, P: Array, dt: float, Q: Array) -> tuple[Array, Array]:
    """(4,) u, v, r, roll after a time, and their standard deviations."""
    places, sigma = np.empty(4), np.empty(4)
    for i in range(4):
        places[i] = x[i] + dt * x[4 + i]
        sigma[i] = np.sqrt(P[i, i] + 2.0 * dt * P[i, 4 + i] + dt**2 * P[4 + i, 4 + i] + Q[i, i])
    return places, sigma
