"""Kernels of `track`: the ring after a turn of the camera, process noise, the gate, and the ring of the next window."""

import numpy as np

from dockair.kernels import njit
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


@njit(cache=True)
def turn(
    x: Array, turn_C: Array, focal_px: float, centre_px: tuple[float, float], ring_radius_m: float, lever_C: Array
) -> None:
    """Turn a track's state (8,) with the camera, rates of the centre included; arguments as for `turned`."""
    x[0], x[1], x[2], roll = turned(x, turn_C, focal_px, centre_px, ring_radius_m, lever_C)
    x[3] += roll
    c, s, du, dv = np.cos(roll), np.sin(roll), x[4], x[5]
    x[4], x[5] = du * c - dv * s, du * s + dv * c


@njit(cache=True)
def ahead(
    x: Array, P: Array, dt: float, noise: tuple[float, float, float], turn_C: Array, focal_px: float,
    centre_px: tuple[float, float], ring_radius_m: float, lever_C: Array,
) -> tuple[float, float, float, Array]:  # fmt: skip
    """u, v after a time and a turn of the camera, r after the time alone, and (4,) standard deviations before the turn.

    Args:
        x: (8,) of the track.
        P: (8, 8) its covariance.
        dt: the time [s].
        noise: of `process_noise`, its last three arguments.
        turn_C: (3,) rotation vector of the camera in that time, in its own axes [rad]; the rest as for `turned`.
        focal_px: focal length.
        centre_px: principal point.
        ring_radius_m: for the range.
        lever_C: (3,) the camera from the point about which it turns, in its own axes [m].
    """
    variance, acceleration_radii_s2, roll_acceleration_rad_s2 = noise
    Q = process_noise(x[2], dt, variance, acceleration_radii_s2, roll_acceleration_rad_s2)
    places, sigma = predicted(x, P, dt, Q)
    u, v, _, _ = turned(places, turn_C, focal_px, centre_px, ring_radius_m, lever_C)
    return u, v, places[2], sigma


@njit(cache=True)
def innovation_squared(z: Array, x: Array, P: Array, variance: Array) -> float:
    """Normalised square of the innovation of centre and radius, three degrees of freedom; NaN where any is no number.

    Args:
        z: (4,) measured.
        x: (8,) of the track.
        P: (8, 8) its covariance.
        variance: (4,) of z.
    """
    S, innovation = np.empty((3, 3)), np.empty(3)
    for i in range(3):
        innovation[i] = z[i] - x[i]
        for j in range(3):
            S[i, j] = P[i, j] + (variance[i] if i == j else 0.0)
    if not (np.isfinite(S).all() and np.isfinite(innovation).all()):  # numba's solver would raise
        return np.nan
    weighed, total = np.linalg.solve(S, innovation), 0.0
    for i in range(3):
        total += innovation[i] * weighed[i]
    return total
