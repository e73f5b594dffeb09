"""Roll and pitch of the receiver from its own gyros and accelerometers, at an airspeed that is known.

What the accelerometers read beyond the lift that a turn asks for points up. With u, up in body axes, V the airspeed,
and d what the rate about the vertical has to be corrected by (vision knows it, gravity does not),

    w = w_gyro - b,   up = f - (w + d u) x (V e_x),   u' = -w x u + k (up/|up| - u),   b' = u x up/|up| / T^2     (1)

k = 2/T, so that both poles are at 1/T: gusts of some seconds are averaged, a bias of the gyros across the vertical is
found within a few T. While t, the time since the first sample, is below T, k is 2/t.

Not modelled: speeding up along the flight path, the nose's angle to the airflow, gaps between samples (the
attitude rests).
Source: Mahony, Hamel & Pflimlin 2008, "Nonlinear complementary filters on the special orthogonal group".
"""

from collections.abc import Sequence

import numpy as np

from dockair.calibration import Mounting
from dockair.messages import ImuSample
from dockair.rotations import Array, exp


class OwnAttitude:
    """Eq. (1).

    Args:
        mounting: of the gyros.
        airspeed_m_s: V.
        time_s: T.
        longest_gap_s: between samples that are used.
    """

    def __init__(self, mounting: Mounting, airspeed_m_s: float, time_s: float, longest_gap_s: float) -> None:
        self._R_BI, self._time_s, self._longest_gap_s = mounting.R_BI, time_s, longest_gap_s
        self._velocity_B = np.array([airspeed_m_s, 0.0, 0.0])
        self._stamp_s, self._passed_s = float("nan"), 0.0
        self._bias_B = np.zeros(3)
        self._up_B: Array | None = None

    @property
    def is_known(self) -> bool:
        """Whether there has been a sample with specific force."""
        return self._up_B is not None

    @property
    def R_LB(self) -> Array:
        """(3, 3) roll and pitch: body axes in level axes along the body's heading; level before the first sample."""
        up = np.array([0.0, 0.0, 1.0]) if self._up_B is None else self._up_B
        ahead = np.array([1.0, 0.0, 0.0]) - up[0] * up
        ahead = ahead / np.linalg.norm(ahead)
        return np.array([ahead, np.cross(up, ahead), up])

    def propagate(self, imu: Sequence[ImuSample], correction_rad_s: float = 0.0) -> None:
        """Take samples; those that are not finite or whose stamps do not rise are passed over.

        Args:
            imu: oldest first.
            correction_rad_s: d.
        """
        for sample in imu:
            w_B = self._R_BI @ np.asarray(sample.angular_rate_rad_s, dtype=float)
            f_B = self._R_BI @ np.asarray(sample.specific_force_m_s2, dtype=float)
            if not np.isfinite(w_B).all() or not np.isfinite(f_B).all() or sample.time_stamp_s <= self._stamp_s:
                continue
            self._take(sample.time_stamp_s - self._stamp_s, w_B - self._bias_B, f_B, correction_rad_s)
            self._stamp_s = sample.time_stamp_s

    def _take(self, dt: float, w_B: Array, f_B: Array, correction_rad_s: float) -> None:
        turning_B = w_B if self._up_B is None else w_B + correction_rad_s * self._up_B
        lift = f_B - np.cross(turning_B, self._velocity_B)
        seen = lift / np.linalg.norm(lift)
        if self._up_B is None:
            self._up_B = seen
        if not dt <= self._longest_gap_s:  # the first sample, too
            return
        self._passed_s += dt
        up = exp(-w_B * dt) @ self._up_B
        self._bias_B = self._bias_B + dt / self._time_s**2 * np.cross(up, seen)
        share = min(2.0 * dt / min(self._time_s, self._passed_s), 1.0)
        up = up + share * (seen - up)
        self._up_B = up / np.linalg.norm(up)
