"""Kernels on vectors held as three numbers: no array is made, no reference counted. Those on arrays: `vectors`."""

import math

from dockair.kernels import njit
from dockair.rotations import Array

Vector = tuple[float, float, float]


@njit(cache=True)
def dot(a: Vector, b: Vector) -> float:
    """Scalar product a' b."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@njit(cache=True)
def cross(a: Vector, b: Vector) -> Vector:
    """Vector product a x b."""
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


@njit(cache=True)
def plus(a: Vector, k: float, b: Vector) -> Vector:
    """Sum a + k b."""
    return a[0] + k * b[0], a[1] + k * b[1], a[2] + k * b[2]


@njit(cache=True)
def unit(a: Vector) -> tuple[Vector, float]:
    """Direction a / |a| and length |a|; of zero, zero."""
    length = math.sqrt(dot(a, a))
    k = 1.0 / max(length, 1e-300)
    return (k * a[0], k * a[1], k * a[2]), length


@njit(cache=True)
def tangents(n: Vector) -> tuple[Vector, Vector]:
    """Unit vectors t1, t2 across a unit vector n, with t2 = n x t1."""
    helper = (1.0, 0.0, 0.0) if abs(n[0]) < 0.7 else (0.0, 1.0, 0.0)
    t1, _ = unit(cross(n, helper))
    return t1, cross(n, t1)


@njit(cache=True)
def turned(M: Array, a: Vector) -> Vector:
    """M a, with M (9,) by rows."""
    return (
        M[0] * a[0] + M[1] * a[1] + M[2] * a[2],
        M[3] * a[0] + M[4] * a[1] + M[5] * a[2],
        M[6] * a[0] + M[7] * a[1] + M[8] * a[2],
    )


@njit(cache=True)
def turned_back(M: Array, a: Vector) -> Vector:
    """M' a, with M (9,) by rows."""
    return (
        M[0] * a[0] + M[3] * a[1] + M[6] * a[2],
        M[1] * a[0] + M[4] * a[1] + M[7] * a[2],
        M[2] * a[0] + M[5] * a[1] + M[8] * a[2],
    )
