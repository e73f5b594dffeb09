"""Heading, roll, pitch and gyro bias in one error-state Kalman filter, by accelerometers and turns that were seen.

    R_NB' = R_NB [w_gyro - b]x,     x = (theta, db, dpsi_f),     R_true = exp(theta) R,   b_true = b + db        (1)
    theta' = -R db + noise,         db' = noise,     dpsi_f' = 0                                                 (2)
    up:     l = R (f - (w_gyro - b) x V),   e_z - l/|l| = theta x e_z + R (db x V)/|l| + v_up                    (3)
    turn:   psi(frame) - psi_f = seen + v,      v ~ N(0, q^2 dt)                                                 (4)
            dpsi = theta_z + tan(pitch) (theta_x cos psi + theta_y sin psi)                                      (5)

N has z up and x along the heading at the start; psi, the heading, is counted from there, to the left; psi_f is that at
the frame before. What the accelerometers read beyond the lift that a turn asks for points up, but who does not know
his gyros does not know how fast he turns: the second term of (3), by which a bias of 0.2 degrees/s tilts a receiver at
180 m/s by 3.7 degrees. The filter knows that both errors are one, so that it may begin anywhere, in a turn, too: the
first turn that is seen settles both.

A gust that yaws the body does not turn its path: the second term of l is then off by |V| times the rate of sideslip, by
0.6 rad for 2 degrees in a second. Up is therefore averaged over `up_every_s`; as the next average makes good what
one is off by, the sigma is that of many.

A scale factor s is a bias that comes with a turn: white noise of density (s |w|)^2 T_s over the time T_s that turns
take to begin. A frame counts at its own time stamp. A turn that is further off than the gate is passed over.

The velocity V is level and in the plane of symmetry, so that its direction in the body follows from the attitude, with
u = R' e_z:   V = |V| (u_z, 0, -u_x)/|(u_z, u_x)|  (6); a climb or a sideslip of some degrees tilts by a fifth of that.

Not modelled: speeding up but as noise, the IMU's distance from the centre of gravity, the Earth's rotation (15 deg/h),
errors that successive turns share but for the size of q.
Source: Sola 2017, "Quaternion kinematics for the error-state Kalman filter" (1, 2); the clone psi_f is that of
Roumeliotis & Burdick 2002, "Stochastic cloning".
"""

from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from dockair.calibration import GyroSheet, Mounting
from dockair.errors import DockairError, check_numbers
from dockair.messages import ImuSample
from dockair.nav.heading.levelling import without_yaw
from dockair.rotations import Array, exp, skew
from dockair.vectors import cross

__all__ = ["HeadingFilter", "HeadingFilterSettings"]

_THETA, _B, _PSI = slice(0, 3), slice(3, 6), 6
_ROUNDS = 3  # from attitude to airflow and back; each leaves a fifth of the error
_GRAVITY_M_S2 = 9.80665
_UP = np.array([0.0, 0.0, 1.0])


@dataclass(frozen=True, slots=True, kw_only=True)
class HeadingFilterSettings:
    """Constants.

    Raises:
        DockairError: a number that is not positive.
    """

    up_every_s: float = 4.0  #: a Dutch roll takes as long
    up_sigma_rad: float = 0.07  #: of one average in the long run; in gusts, one by itself is three times worse
    start_sigma_rad: float = 0.3  #: of roll and pitch before the first: a bank of 25 degrees is 0.44
    walk_rad_rts: float = 1.2e-3  #: q: 0.1 degrees in the 2 s between frames (docs/heading.md)
    gate_sigmas: float = 5.0
    largest_tilt_rad: float = 0.3  #: that a bias of one sigma may seem to be: beyond, no picture can be levelled
    turn_begins_s: float = 10.0  #: T_s
    longest_gap_s: float = 0.5  #: between samples; the rate of the one behind it is taken for it
    remembered_s: float = 1.0  #: how late a frame may come

    def __post_init__(self) -> None:
        check_numbers("heading.filter", self)


class HeadingFilter:
    """Eqs. (1) to (4).

    Args:
        gyro: data sheet.
        mounting: of the IMU.
        airspeed_m_s: V.
        settings: constants.

    Raises:
        DockairError: gyros so bad that neither up nor the turn is known at the start.

    Attributes:
        heading_rad: psi, not wrapped.
        bias_B: (3,) b [rad/s].
        is_level: up has been averaged once, so that a picture can be levelled.
        is_lost: the gyro was away for too long.
    """

    def __init__(
        self, gyro: GyroSheet, mounting: Mounting, airspeed_m_s: float, settings: HeadingFilterSettings | None = None
    ) -> None:
        tilt_rad = airspeed_m_s * gyro.bias_sigma_rad_s / _GRAVITY_M_S2
        limit_rad = (settings or HeadingFilterSettings()).largest_tilt_rad
        if tilt_rad > limit_rad:
            most = limit_rad * _GRAVITY_M_S2 / airspeed_m_s
            expected = (
                f"gyros whose bias is below {most:.3f} rad/s at {airspeed_m_s:g} m/s, as of mti or tactical grade"
            )
            raise DockairError("heading.gyro", expected=expected, got=gyro.bias_sigma_rad_s)
        self._gyro, self._R_BI, self._settings = gyro, mounting.R_BI, settings or HeadingFilterSettings()
        self._airspeed_m_s = airspeed_m_s
        self._stamp_s = float("nan")
        self._w_B: Array = np.zeros(3)  # of the newest sample, corrected
        self._R_NB: Array = np.eye(3)
        self.heading_rad, self.is_level, self.is_lost = 0.0, False, False
        self.bias_B: Array = np.zeros(3)
        self._P: Array = np.zeros((7, 7))
        self._P[_B, _B] = gyro.bias_sigma_rad_s**2 * np.eye(3)
        self._past: deque[tuple[float, float]] = deque()  # stamp, gyro's turn since the start
        self._turned_rad = 0.0
        self._frame: tuple[float, float] | None = None  # stamp and psi_f
        self._theta_N: Array = np.zeros(3)  # corrections of the attitude that are not yet told
        self._lift_N: Array = np.zeros(3)  # sum of the samples since Eq. (3) was last used, their number, the time
        self._lifts, self._lift_s = 0, 0.0

    @property
    def time_stamp_s(self) -> float:
        """Of the newest sample; NaN before the first that has accelerations, too."""
        return self._stamp_s

    @property
    def _begun(self) -> bool:
        return bool(np.isfinite(self._stamp_s))

    @property
    def R_LB(self) -> Array:
        """(3, 3) roll and pitch: body axes in level axes along the body's heading."""
        return without_yaw(self._R_NB)

    @property
    def sigma_rad(self) -> float:
        """Standard deviation of the heading."""
        g = self._to_heading
        return float(np.sqrt(max(float(g @ self._P @ g), 0.0)))  # nothing at the start, or what rounding makes of it

    @property
    def _to_heading(self) -> Array:
        """(7,) what the errors do to the heading, Eq. (5)."""
        x, y, z = self._R_NB[:, 0]
        return np.array([-x * z / (x * x + y * y), -y * z / (x * x + y * y), 1.0, 0.0, 0.0, 0.0, 0.0])

    def propagate(self, imu: Sequence[ImuSample]) -> None:
        """Take samples, oldest first; those that are not finite or whose stamps do not rise are passed over."""
        R_NB, passed_s = self._R_NB, 0.0
        for sample in imu:
            w_B = self._R_BI @ np.asarray(sample.angular_rate_rad_s, dtype=float)
            f_B = self._R_BI @ np.asarray(sample.specific_force_m_s2, dtype=float)
            stamp_s = sample.time_stamp_s
            # accelerometers that are off say 0, and not where up is
            if not self._begun and f_B.any() and np.isfinite([*f_B, *w_B, stamp_s]).all():
                self._begin(stamp_s, w_B, f_B)
                R_NB = self._R_NB
            elif self._begun and np.isfinite(w_B).all() and stamp_s > self._stamp_s:
                passed_s += self._take(stamp_s, w_B, f_B)
        self._spread(R_NB, passed_s)
        if self._lift_s >= self._settings.up_every_s:
            self._see_up()

    def predicted_turn_rad(self, stamp_s: float) -> float | None:
        """Turn since the frame before, by the gyro; None for a frame too late, or not after the one before."""
        if not self._past or stamp_s < self._past[0][0] or (self._frame is not None and stamp_s <= self._frame[0]):
            return None
        return 0.0 if self._frame is None else self._heading_at(stamp_s) - self._frame[1]

    def R_LB_at(self, stamp_s: float) -> Array:
        """(3, 3) `R_LB` at a time of the last second."""
        return without_yaw(self._R_NB @ exp(self._w_B * (stamp_s - self._stamp_s)))

    def tilt_L(self) -> Array:
        """(3,) by how much roll and pitch were corrected since this was last asked, level axes along the heading."""
        theta_N, self._theta_N = self._theta_N * [1.0, 1.0, 0.0], np.zeros(3)
        return np.asarray(exp(np.array([0.0, 0.0, -self.heading_rad])) @ theta_N)

    def see(self, stamp_s: float, seen_rad: float | None) -> bool:
        """Take the turn that a frame saw since the one before, None if it saw none; whether it was believed.

        Args:
            stamp_s: of a frame for which `predicted_turn_rad` is not None.
            seen_rad: to the left.
        """
        believed = False
        if seen_rad is not None and self._frame is not None:
            interval_s = stamp_s - self._frame[0]
            innovation = seen_rad - (self._heading_at(stamp_s) - self._frame[1])
            H = self._to_heading
            H[_PSI] = -1.0  # Eq. (4)
            variance = self._settings.walk_rad_rts**2 * interval_s
            S = float(H @ self._P @ H) + variance
            believed = innovation**2 <= self._settings.gate_sigmas**2 * S
            if believed:
                self._correct(H[None], np.array([innovation]), np.array([variance]))
        self._frame = stamp_s, self._heading_at(stamp_s)
        clone = np.eye(7)
        clone[_PSI] = self._to_heading
        self._P = clone @ self._P @ clone.T
        return believed

    def _take(self, stamp_s: float, w_B: Array, f_B: Array) -> float:
        """Go on by a sample; return the time since the one before."""
        dt = stamp_s - self._stamp_s
        self.is_lost = self.is_lost or dt > self._settings.longest_gap_s
        corrected_B = w_B - self.bias_B
        if np.isfinite(f_B).all():
            lift_B = f_B - cross(corrected_B, self._velocity_B)
            self._lift_N, self._lifts = self._lift_N + self._R_NB @ lift_B, self._lifts + 1
        self._lift_s += dt
        self._advance(corrected_B, dt)
        self._stamp_s = stamp_s
        self._past.append((stamp_s, self._turned_rad))
        while self._past[0][0] < stamp_s - self._settings.remembered_s:
            self._past.popleft()
        return dt

    def _begin(self, stamp_s: float, w_B: Array, f_B: Array) -> None:
        """Roll and pitch of the first sample. Whatever they are off by, the heading is zero there: Eq. (5)."""
        for _ in range(_ROUNDS):
            self._R_NB = _upright(f_B - cross(w_B, self._velocity_B))
        self._stamp_s = stamp_s
        self._past.append((stamp_s, 0.0))
        level = np.vstack([np.eye(2), -self._to_heading[:2]])
        self._P[_THETA, _THETA] = self._settings.start_sigma_rad**2 * level @ level.T

    @property
    def _velocity_B(self) -> Array:
        """(3,) Eq. (6)."""
        x, _, z = self._R_NB[2]
        return np.asarray(self._airspeed_m_s / np.hypot(x, z) * np.array([z, 0.0, -x]))

    def _advance(self, w_B: Array, dt: float) -> None:
        """Eq. (1) over a sample."""
        before = self._R_NB
        self._R_NB = before @ exp(w_B * dt)
        turn = _heading_turn_rad(before, self._R_NB)
        self.heading_rad, self._turned_rad = self.heading_rad + turn, self._turned_rad + turn
        self._w_B = w_B

    def _spread(self, R_NB: Array, dt: float) -> None:
        """Eq. (2): the covariance over a batch of samples that began at an attitude."""
        gyro, P = self._gyro, self._P
        A = -dt * R_NB
        P[_THETA] += A @ P[_B]
        P[:, _THETA] += P[:, _B] @ A.T
        scale = gyro.scale_factor_sigma**2 * float(self._w_B @ self._w_B) * self._settings.turn_begins_s
        P[range(3), range(3)] += (gyro.noise_density_rad_s_rthz**2 + scale) * dt
        P[range(3, 6), range(3, 6)] += gyro.bias_walk_rad_s_rts**2 * dt

    def _see_up(self) -> None:
        """Eq. (3) with the mean of the samples since the last time."""
        lift_N, n = self._lift_N, self._lifts
        self._lift_N, self._lifts, self._lift_s = np.zeros(3), 0, 0.0
        length = float(np.linalg.norm(lift_N)) / max(n, 1)
        if length == 0.0:
            return
        self.is_level = True
        H = np.zeros((2, 7))
        H[:, _THETA] = -skew(_UP)[:2]
        H[:, _B] = -(self._R_NB @ skew(self._velocity_B))[:2] / length
        innovation = -lift_N[:2] / (n * length)
        self._correct(H, innovation, np.full(2, self._settings.up_sigma_rad**2))

    def _correct(self, H: Array, innovation: Array, variances: Array) -> None:
        """Kalman's update, in Joseph's form, and the errors put where they belong."""
        P, noise = self._P, np.diag(variances)
        gain = np.linalg.solve(H @ P @ H.T + noise, H @ P).T
        x = gain @ innovation
        left = np.eye(7) - gain @ H
        P = left @ P @ left.T + gain @ noise @ gain.T
        self._P = 0.5 * (P + P.T)
        before = self._R_NB
        self._R_NB = exp(x[_THETA]) @ before
        self._theta_N = self._theta_N + x[_THETA]
        self.heading_rad += _heading_turn_rad(before, self._R_NB)
        self.bias_B = self.bias_B + x[_B]
        if self._frame is not None:
            self._frame = self._frame[0], self._frame[1] + float(x[_PSI])

    def _heading_at(self, stamp_s: float) -> float:
        """Of the last second; ahead of the newest sample the rate is that sample's, as in `R_LB_at`."""
        stamps, turned = np.array(self._past).T
        heading_rad = self.heading_rad - self._turned_rad + float(np.interp(stamp_s, stamps, turned))
        if stamp_s > self._stamp_s:
            ahead = exp(self._w_B * (stamp_s - self._stamp_s))
            heading_rad += _heading_turn_rad(self._R_NB, self._R_NB @ ahead)
        return heading_rad


def _heading_turn_rad(before: Array, after: Array) -> float:
    turn = np.arctan2(after[1, 0], after[0, 0]) - np.arctan2(before[1, 0], before[0, 0])
    return float((turn + np.pi) % (2.0 * np.pi) - np.pi)


def _upright(up_B: Array) -> Array:
    """(3, 3) the attitude of heading zero in which a direction of the body points up."""
    up = up_B / np.linalg.norm(up_B)
    ahead = np.array([1.0, 0.0, 0.0]) - up[0] * up
    ahead = ahead / np.linalg.norm(ahead)
    return np.array([ahead, cross(up, ahead), up])
