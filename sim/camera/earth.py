"""Lines of sight over a round Earth: where they meet it, and through how much air.

A ray of elevation sine s from the height h over a sphere of radius a, r = a + h, and its air mass:

    d = -r s - sqrt(q),   q = a^2 - r^2 (1 - s^2),   mu = sqrt(q)/a,      m = 1/(|s| + 0.025 exp(-11 |s|))        (1)

Source: Rozenberg 1966 (air mass at the horizon).
"""

import math

import numpy as np
from numpy.typing import NDArray

from dockair.kernels import njit
from dockair.rotations import Array

Interval = NDArray[np.int64]  # (rows, 2) first column and one past the last


def meet_sphere(sine: Array, radius_m: float, height_m: float) -> tuple[NDArray[np.bool_], Array, Array]:
    """Whether rays meet a sphere below, the distance and the cosine of incidence there; else those of skimming it."""
    r = radius_m + height_m
    q = radius_m**2 - r * r * (1.0 - sine * sine)
    meets = (sine < 0.0) & (q > 0.0) & (height_m > 0.0)
    root = np.sqrt(np.maximum(q, 1.0))
    return meets, -r * sine - root, root / radius_m


def dip_sine(radius_m: float, height_m: float) -> float:
    """Sine of the angle below level from which on a sphere is seen; 1 from within it."""
    return math.sqrt(1.0 - (radius_m / (radius_m + height_m)) ** 2) if height_m > 0.0 else 1.0


def air_mass(sine: Array) -> Array:
    """(n,) air masses, Eq. (1), of rays with these sines of elevation."""
    s = np.abs(sine)
    return np.asarray(1.0 / (s + 0.025 * np.exp(-11.0 * s)))


def unit(directions: Array) -> Array:
    """(n, 3) unit vectors."""
    d = np.asarray(directions, dtype=float)
    length = np.sqrt(d[:, 0] * d[:, 0] + d[:, 1] * d[:, 1] + d[:, 2] * d[:, 2])
    return np.asarray(d / length[:, None])


@njit(cache=True)
def columns_below(R: Array, x: Array, y: Array, sine: float, out: Interval) -> tuple[int, int, bool]:
    """Fill (rows, 2) the columns whose rays point down by more than an angle; there they are one after the other.

    Returns the first row with others and one past the last such row, and whether any column points down so much.

    Args:
        R: attitude of the camera.
        x: (columns,) rising tangents to the right.
        y: (rows,) tangents below the axis.
        sine: of the angle, positive.
        out: first column and one past the last of each row.
    """
    k2, first_row, stop_row, any_below = sine * sine, 0, 0, False
    for i in range(len(y)):
        a, b = R[2, 0] - y[i] * R[2, 2], R[2, 1]  # the ray's z is a - x b
        square, half, rest = b * b - k2, a * b, a * a - k2 * (1.0 + y[i] * y[i])
        square = square if abs(square) > 1e-12 else 1e-12
        disc = half * half - square * rest
        low, high = 1.0, 0.0
        if disc <= 0.0:
            if square > 0.0 and a < 0.0:
                low, high = -np.inf, np.inf
        else:
            root = np.sqrt(disc)
            one, other = (half - root) / square, (half + root) / square
            first, last = min(one, other), max(one, other)
            if square < 0.0:
                if a - 0.5 * (first + last) * b < 0.0:
                    low, high = first, last
            elif b > 0.0:
                low, high = last, np.inf
            else:
                low, high = -np.inf, first
        out[i, 0] = np.searchsorted(x, low)
        out[i, 1] = max(np.searchsorted(x, high), out[i, 0]) if low <= high else out[i, 0]
        any_below = any_below or out[i, 0] < out[i, 1]
        if out[i, 0] > 0 or out[i, 1] < len(x):
            first_row, stop_row = (i if stop_row == 0 else first_row), i + 1
    return first_row, stop_row, any_below
