"""Axes that do not roll, pitch and yaw with the body: what guidance steers in.

A receiver that moves sideways banks and yaws; seen from its body a drogue 4 m ahead then moves by half a metre that
nobody has to fly. The axes N take part in the announced turn r and in slow changes of attitude only:

    w_N = r z + phi / T,     d(R_NB)/dt = [w_B - w_N] R_NB,     phi = log(R_NB)                           (1)

w_B is the gyros' rate in axes of N. Constant rates of the body against the announced ones (gyro bias) turn N off by
T times the rate, which changes where astern is, and nothing at the basket.

Not modelled: that N itself turns, by up to phi / T, while the swing is predicted in it.
"""

import numpy as np

from dockair.rotations import Array, exp, log


class StabilisedAxes:
    """Eq. (1), from axes along the body at the start."""

    def __init__(self, levelling_s: float, step_s: float) -> None:
        self._levelling_s, self._step_s = levelling_s, step_s
        self.R_NB: Array = np.eye(3)
        self.w_NB_N: Array = np.zeros(3)  #: of the body against N [rad/s]

    def step(self, w_WB_B: Array, turn_rate_rad_s: float) -> None:
        """Advance by one control period.

        Args:
            w_WB_B: (3,) the body's angular velocity [rad/s].
            turn_rate_rad_s: that the announced path has, to the left.
        """
        w = self.R_NB @ w_WB_B - log(self.R_NB) / self._levelling_s
        w[2] -= turn_rate_rad_s
        self.w_NB_N = w
        self.R_NB = exp(w * self._step_s) @ self.R_NB

    def moved(self, p_B: Array, rate_B: Array) -> tuple[Array, Array]:
        """(3,) a vector and its rate of change in N, of those in B."""
        p = self.R_NB @ p_B
        return p, self.R_NB @ rate_B + np.cross(self.w_NB_N, p)
