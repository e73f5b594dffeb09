"""Kernels on vectors and small matrices; apart from `rotations`, which quick commands load without numba."""

import numpy as np

from dockair.kernels import njit
from dockair.rotations import Array


@njit(cache=True)
def cross(a: Array, b: Array) -> Array:
    """(3,) a x b; numpy's own takes ten times as long for one pair of vectors."""
    return np.array([a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]])


@njit(cache=True)
def is_finite(a: Array) -> bool:
    """Whether every number of an array is finite."""
    for value in a.flat:
        if not np.isfinite(value):
            return False
    return True


@njit(cache=True)
def largest_sigma(P: Array) -> float:
    """Standard deviation in its worst direction of a pair of covariance P (2, 2); NaN where P has one."""
    return float(np.sqrt(0.5 * (P[0, 0] + P[1, 1]) + np.hypot(0.5 * (P[0, 0] - P[1, 1]), P[0, 1])))
