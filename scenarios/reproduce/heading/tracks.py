"""Yaw rates of the walks of [Kyung et al. 2015]: 100 m straight in 85 s, and two laps of a 400 m oval in 280 s.

The source does not print the oval's shape; here it is a running track's: two straights of 84.39 m, two half circles of
36.5 m radius. A drift of 16 degrees in 85 s is taken for a constant bias.
"""

import numpy as np

from dockair.nav.heading.hdr import HeuristicDriftReduction
from dockair.rotations import Array

RATE_HZ = 100.0
STRAIGHT_S, STRAIGHT_DRIFT_DEG = 85.0, 16.0
OVAL_S, LAPS = 280.0, 2
_SIDE_M, _RADIUS_M = 84.39, 36.5
BIAS_RAD_S = float(np.radians(STRAIGHT_DRIFT_DEG) / STRAIGHT_S)


def straight_rates_rad_s(seed: int, *, noise_deg_s: float, bias_rad_s: float = BIAS_RAD_S) -> Array:
    """(8500,) what the gyro says on the straight."""
    noise = np.radians(noise_deg_s) * np.random.default_rng(seed).standard_normal(round(STRAIGHT_S * RATE_HZ))
    return np.asarray(bias_rad_s + noise)


def oval_true_rates_rad_s() -> Array:
    """(28000,) true yaw rate on two laps to the left, 720 degrees in all."""
    speed = LAPS * 2.0 * (_SIDE_M + np.pi * _RADIUS_M) / OVAL_S
    travelled = speed * (np.arange(round(OVAL_S * RATE_HZ)) + 0.5) / RATE_HZ
    turning = travelled % (_SIDE_M + np.pi * _RADIUS_M) > _SIDE_M
    return np.where(turning, 2.0 * np.pi * LAPS / (turning.sum() / RATE_HZ), 0.0)


def oval_rates_rad_s(seed: int, *, noise_deg_s: float, bias_rad_s: float = BIAS_RAD_S) -> tuple[Array, Array]:
    """(28000,) what the gyro says on two laps, and the true rate."""
    true = oval_true_rates_rad_s()
    noise = np.radians(noise_deg_s) * np.random.default_rng(seed).standard_normal(true.size)
    return true + bias_rad_s + noise, true


def lap_places(points: int) -> Array:
    """(points + 1, 3) place x, y [m] and heading [rad] of a lap to the left, evenly spaced, back at its start."""
    lap = 2.0 * (_SIDE_M + np.pi * _RADIUS_M)
    return np.array([_place(float(d)) for d in np.linspace(0.0, lap, points + 1)])


def _place(travelled_m: float) -> tuple[float, float, float]:
    half = _SIDE_M + np.pi * _RADIUS_M
    halves = min(int(travelled_m / half), 1)
    rest = travelled_m - halves * half
    angle = max(rest - _SIDE_M, 0.0) / _RADIUS_M
    x = min(rest, _SIDE_M) + _RADIUS_M * np.sin(angle)
    y = _RADIUS_M * (1.0 - np.cos(angle))
    if halves:  # the other half is the first one turned about the oval's middle
        x, y = _SIDE_M - x, 2.0 * _RADIUS_M - y
    return float(x), float(y), float(angle + np.pi * halves)


def hdr_heading_rad(rates_rad_s: Array) -> Array:
    """(n,) heading of heuristic drift reduction alone."""
    return np.asarray(np.cumsum(HeuristicDriftReduction(RATE_HZ).run(rates_rad_s)) / RATE_HZ)
