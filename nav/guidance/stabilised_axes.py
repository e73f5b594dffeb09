"""Axes that do not roll, pitch and yaw with the body: what guidance steers in.

A receiver that moves sideways banks and yaws; seen from its body a drogue 4 m ahead then moves by half a metre that
nobody has to fly. The axes N take part in the announced turn r, its bank b and all, and in slow changes of attitude
only:

    n = (b', r sin b, r cos b),     w_N = n + phi / T,     d(R_NB)/dt = [w_B - w_N] R_NB                  (1)

w_B is the gyros' rate in axes of N; phi is the axis of R_NB times the sine of its angle. Constant rates of the body
against the announced ones (gyro bias) turn N off by T times the rate, which changes where astern is, and nothing at the
basket. By the turn n alone, a point at p that keeps company with the receiver moves in N by

    -n x p                                                                                                (2)

Not modelled: that N itself turns, by up to phi / T, while the swing is predicted in it.
"""

import math

import numpy as np

from dockair.kernels import njit
from dockair.rotations import Array
from dockair.vectors import cross


class StabilisedAxes:
    """Eq. (1), from axes along the body at the start."""

    def __init__(self, levelling_s: float, step_s: float) -> None:
        self._levelling_s, self._step_s = levelling_s, step_s
        self.R_NB: Array = np.eye(3)
        self.w_NB_N: Array = np.zeros(3)  #: of the body against N [rad/s]
        self._turn_N: Array = np.zeros(3)  # n of Eq. (1)
        self._bank_rad = 0.0

    def step(self, w_WB_B: Array, turn_rate_rad_s: float, bank_rad: float = 0.0) -> None:
        """Advance by one control period.

        Args:
            w_WB_B: (3,) the body's angular velocity [rad/s].
            turn_rate_rad_s: that the announced path has, to the left.
            bank_rad: with which it is flown, right wing down.
        """
        rolling = (bank_rad - self._bank_rad) / self._step_s
        self._bank_rad = bank_rad
        self._turn_N[:] = rolling, turn_rate_rad_s * math.sin(bank_rad), turn_rate_rad_s * math.cos(bank_rad)
        _turn(self.R_NB, self.w_NB_N, w_WB_B, self._turn_N, self._levelling_s, self._step_s)

    @property
    def left_N(self) -> Array:
        """(3,) level to the left of the path."""
        return np.array([0.0, math.cos(self._bank_rad), -math.sin(self._bank_rad)])

    def turned(self, p_N: Array) -> Array:
        """(3,) n x p of Eq. (2), or its rate for a rate."""
        return cross(self._turn_N, p_N)

    def moved(self, p_B: Array, rate_B: Array) -> tuple[Array, Array]:
        """(3,) a vector and its rate of change in N, of those in B."""
        p, rate = np.empty(3), np.empty(3)
        _move(self.R_NB, self.w_NB_N, p_B, rate_B, p, rate)
        return p, rate


@njit(cache=True)
def _turn(R, w, w_B, turn, levelling_s, step):  # type: ignore[no-untyped-def]
    """Eq. (1) over a step, in place: R (3, 3), w (3,)."""
    for i in range(3):
        j, k = (i + 1) % 3, (i + 2) % 3
        w[i] = -0.5 * (R[k, j] - R[j, k]) / levelling_s
        for m in range(3):
            w[i] += R[i, m] * w_B[m]
        w[i] -= turn[i]
    angle = step * np.sqrt(w[0] * w[0] + w[1] * w[1] + w[2] * w[2])
    sine = step * (np.sin(angle) / angle if angle > 1e-9 else 1.0)
    cosine = 2.0 * step * step * ((np.sin(0.5 * angle) / angle) ** 2 if angle > 1e-9 else 0.25)
    for m in range(3):  # column by column, v + sine w x v + cosine w x (w x v)
        a, b, c = R[0, m], R[1, m], R[2, m]
        x, y, z = w[1] * c - w[2] * b, w[2] * a - w[0] * c, w[0] * b - w[1] * a
        R[0, m] = a + sine * x + cosine * (w[1] * z - w[2] * y)
        R[1, m] = b + sine * y + cosine * (w[2] * x - w[0] * z)
        R[2, m] = c + sine * z + cosine * (w[0] * y - w[1] * x)


@njit(cache=True)
def _move(R, w, p_B, rate_B, p, rate):  # type: ignore[no-untyped-def]
    """Write p = R p_B and its rate R rate_B + w x p."""
    for i in range(3):
        p[i], rate[i] = 0.0, 0.0
        for m in range(3):
            p[i] += R[i, m] * p_B[m]
            rate[i] += R[i, m] * rate_B[m]
    rate[0] += w[1] * p[2] - w[2] * p[1]
    rate[1] += w[2] * p[0] - w[0] * p[2]
    rate[2] += w[0] * p[1] - w[1] * p[0]
