"""How far one pose is from another, in the coordinates of every covariance here."""

import numpy as np

from dockair.kernels import njit
from dockair.rotations import Array, log

_NEAR_HALF_TURN = -0.9  # cosine below which the sine no longer gives the axis well


def pose_difference(R: Array, p: Array, R_from: Array, p_from: Array) -> Array:
    """(6,) (phi, delta) with R = exp(phi) R_from and p = p_from + delta [rad, m].

    Args:
        R: (3, 3) attitude.
        p: (3,) position [m], or any vector whose difference is wanted.
        R_from: (3, 3) attitude.
        p_from: (3,) position [m].
    """
    difference, cosine = _difference(R, p, R_from, p_from)
    if cosine < _NEAR_HALF_TURN:
        difference[:3] = log(R @ R_from.T)
    return np.asarray(difference)


@njit(cache=True)
def _difference(R: Array, p: Array, R_from: Array, p_from: Array) -> tuple[Array, float]:
    turn, out = np.zeros((3, 3)), np.empty(3 + len(p))
    for i in range(3):
        for j in range(3):
            for k in range(3):
                turn[i, j] += R[i, k] * R_from[j, k]
    x, y, z = turn[2, 1] - turn[1, 2], turn[0, 2] - turn[2, 0], turn[1, 0] - turn[0, 1]
    sine, cosine = 0.5 * np.sqrt(x * x + y * y + z * z), 0.5 * (turn[0, 0] + turn[1, 1] + turn[2, 2] - 1.0)
    k = 0.5 + sine**2 / 12.0 if sine < 1e-3 and cosine > 0.0 else 0.5 * np.arctan2(sine, cosine) / max(sine, 1e-300)
    out[0], out[1], out[2] = k * x, k * y, k * z
    for i in range(len(p)):
        out[3 + i] = p[i] - p_from[i]
    return out, cosine
