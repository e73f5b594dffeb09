"""Rotations: matrices, rotation vectors, modified Rodrigues parameters (MRP), quaternions (w, x, y, z).

    R_AB maps B-vectors to A:   v_A = R_AB v_B                                        (1)
    exp(phi) = I + sin t/t [phi x] + (1 - cos t)/t^2 [phi x]^2,   t = |phi|           (2)
    MRP  p = e tan(Theta/4)                                        [Yoon 2018, eq 38]
    C(p) = I + (8 [p x]^2 - 4 (1 - p'p) [p x]) / (1 + p'p)^2       [Yoon 2018, eq 39]

The source's C is passive: R_CD = C(p) turns the other way from the active rotation by Theta about e.
All frames are forward-left-up; aircraft tables are forward-right-down: `FLU_FROM_FRD` is the one place that converts.
"""

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

Array = NDArray[np.floating[Any]]

#: Forward-right-down vector components to forward-left-up ones, and back (it is its own inverse).
FLU_FROM_FRD: Array = np.diag([1.0, -1.0, -1.0])
FLU_FROM_FRD.setflags(write=False)
_UNIT: Array = np.eye(3)
_UNIT.setflags(write=False)


def skew(v: Array) -> Array:
    """(3, 3) matrix of v x ( . ), for v of shape (3,)."""
    x, y, z = v
    return np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])


def exp(phi: Array) -> Array:
    """(3, 3) rotation matrix of a rotation vector phi (3,) [rad], Eq. (2)."""
    angle = math.sqrt(phi @ phi)
    K = skew(phi)
    if angle < 1e-4:  # next term of each series is angle^4 < 1e-16
        a, b = 1.0 - angle**2 / 6.0, 0.5 - angle**2 / 24.0
    else:
        a, b = np.sin(angle) / angle, (1.0 - np.cos(angle)) / angle**2
    return np.asarray(_UNIT + a * K + b * (K @ K))


def log(R: Array) -> Array:
    """(3,) rotation vector [rad], |phi| <= pi, of a rotation matrix (3, 3)."""
    return np.asarray(Rotation.from_matrix(R).as_rotvec())


def matrix_from_mrp(p: Array) -> Array:
    """(3, 3) passive direction cosine matrix C(p) of an MRP vector p (3,), [Yoon 2018, eq 39]."""
    K, s = skew(p), float(p @ p)
    return np.eye(3) + (8.0 * (K @ K) - 4.0 * (1.0 - s) * K) / (1.0 + s) ** 2


def mrp_from_matrix(C: Array) -> Array:
    """(3,) MRP vector with |p| <= 1 (the shadow set is chosen when needed) of a passive matrix C (3, 3)."""
    return np.asarray(-Rotation.from_matrix(C).as_mrp())


def matrix_from_quaternion(q_wxyz: Array) -> Array:
    """(3, 3) R_AB of the quaternion q_AB (4,), order w, x, y, z."""
    return np.asarray(Rotation.from_quat(q_wxyz, scalar_first=True).as_matrix())


def quaternion_from_matrix(R: Array) -> Array:
    """(4,) quaternion w, x, y, z with w >= 0 of R (3, 3)."""
    return np.asarray(Rotation.from_matrix(R).as_quat(canonical=True, scalar_first=True))


def matrix_from_yaw_pitch_roll(yaw_rad: float, pitch_rad: float, roll_rad: float) -> Array:
    """(3, 3) R_AB of z-y-x Euler angles, forward-left-up: positive yaw is left, positive pitch is nose *down*."""
    return np.asarray(Rotation.from_euler("ZYX", [yaw_rad, pitch_rad, roll_rad]).as_matrix())


def yaw_pitch_roll_from_matrix(R: Array) -> Array:
    """(3,) z-y-x Euler angles [rad] of R_AB, in the signs of `matrix_from_yaw_pitch_roll`."""
    return np.asarray(Rotation.from_matrix(R).as_euler("ZYX"))
