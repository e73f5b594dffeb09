"""From body rates to the heading's, by the aircraft's own roll and pitch; they also tell the gyros' level bias.

    w_L = R_LB (w_B - bias),     heading' = w_z - w_x x_z/x_x,     x = R_LB e_x                            (1)
    r = w_B - bias - log( R_LB(t)' R_LB(t + dt) )/dt - heading' R_LB' e_z,     bias <- bias + r dt/T       (2)

L are level axes along the body's heading, so that R_LB holds roll and pitch alone; the second term of the heading's
rate takes off the part that rolling has about the vertical where the nose is not level. In a coordinated turn the body
turns about the vertical, so that an error of roll or pitch enters Eq. (1) by its square. Bias about the vertical does
not show in Eq. (2); bias across it would enter the heading in a bank b with sin b.

T grows with the time since the start up to `levelling_s`. In a turn, where scale factors would pass for bias, it rests.
"""

import numpy as np

from dockair.errors import DockairError
from dockair.rotations import Array, log

__all__ = ["Levelling", "without_yaw"]

_NEARLY_VERTICAL = 1e-6  # of the nose's level part


class Levelling:
    """Eqs. (1) and (2).

    Args:
        levelling_s: the longest T.

    Attributes:
        bias_B: (3,) of the gyros, as far as it is known [rad/s].
    """

    def __init__(self, levelling_s: float) -> None:
        self._longest_s, self._averaged_s = levelling_s, 0.0
        self._before: tuple[float, Array] | None = None  # stamp, R_LB
        self._sum_B, self._samples = np.zeros(3), 0
        self.bias_B: Array = np.zeros(3)

    def heading_rate_rad_s(self, w_B: Array, R_LB: Array) -> float:
        """Eq. (1) of a sample of the gyros (3,), which is also kept for Eq. (2)."""
        self._sum_B, self._samples = self._sum_B + w_B, self._samples + 1
        return _heading_rate(R_LB, w_B - self.bias_B)

    def average(self, stamp_s: float, R_LB: Array, correction_rad_s: float, turning_rad_s: float) -> None:
        """Eq. (2) over the samples since the last time.

        Args:
            stamp_s: of the newest sample.
            R_LB: (3, 3) roll and pitch there.
            correction_rad_s: of the heading's rate, by others.
            turning_rad_s: rate above which the aircraft turns.
        """
        before, n, total_B = self._before, self._samples, self._sum_B
        if n == 0:
            return
        self._before, self._sum_B, self._samples = (stamp_s, R_LB), np.zeros(3), 0
        if before is None:
            return
        dt, w_B = stamp_s - before[0], total_B / n - self.bias_B
        rate = _heading_rate(R_LB, w_B)
        if abs(rate + correction_rad_s) > turning_rad_s:
            return
        left = w_B - log(before[1].T @ R_LB) / dt - rate * R_LB[2]
        self._averaged_s = min(self._averaged_s + dt, self._longest_s)
        self.bias_B = np.asarray(self.bias_B + dt / max(self._averaged_s, dt) * left)


def without_yaw(R: Array) -> Array:
    """(3, 3) roll and pitch of an attitude, in level axes along its own heading."""
    R = np.asarray(R, dtype=float)
    right = R.shape == (3, 3) and bool(np.isfinite(R).all())
    length = float(np.hypot(R[0, 0], R[1, 0])) if right else 0.0
    if length < _NEARLY_VERTICAL:
        raise DockairError("R_LB", expected="(3, 3), a finite attitude whose nose is not vertical", got=R)
    c, s = R[0, 0] / length, R[1, 0] / length
    return np.array([[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, 1.0]]) @ R


def _heading_rate(R_LB: Array, w_B: Array) -> float:
    w_L = R_LB @ w_B
    return float(w_L[2] - w_L[0] * R_LB[2, 0] / R_LB[0, 0])
