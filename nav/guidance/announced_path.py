"""The path that the tanker has announced: turn rate and slope now, as it said it would fly them.

A change begins at its announced start and takes the announced time T to come in, u = t/T, by the step that tanker and
receiver have agreed upon,

    s(u) = u^3 (10 - 15 u + 6 u^2)                                                                       (1)

Announcements may overlap: the next may come while the last is still being flown. A turn of rate r (to the left) is
flown at airspeed V with the bank (right wing down)

    tan(bank) = -V r / g                                                                                 (2)

A tanker turns a little more or less than it said, by a share e of r, and begins sooner or later. Both show as a
velocity v to the left, beyond the path, that a receiver needs to keep company with the drogue. The receiver's own path
leans on it, by c / V more than announced, so that v goes:

    v' = -V r e - c,     c = k v - V r e                                                                 (3)

A Kalman filter learns v and e from the drogue's velocity on the receiver's scale; another turn rate has another e, a
change of the slope alone leaves it. Where the drogue tells nothing any more, on the probe, the path goes on as learnt.

Not modelled: an error of the slope that grows (one that is steady is a velocity like any other); a change of the
tanker's turn that was not announced.
"""

import math
from bisect import insort
from dataclasses import dataclass

from dockair.errors import check_numbers
from dockair.messages import TankerAnnouncement

_GRAVITY_M_S2 = 9.80665  # standard


@dataclass(frozen=True, slots=True, kw_only=True)
class AnnouncedPathSettings:
    """What is known beforehand of the formation and of what is announced."""

    airspeed_m_s: float = 180.0  # V, as it was briefed
    velocity_sigma_m_s: float = 0.2  # of v before anything is announced: the inertial velocity's bias
    start_sigma_s: float = 0.2  # of the announced beginning: a spoken countdown
    turn_rate_sigma_rad_s: float = 0.0003  # of the announced rate: a bank held within 0.25 degrees at 180 m/s
    wander_1_sqrt_s: float = 0.0005  # of e: the inertial velocity's bias, turning against the path, looks like it
    swing_m2_s: float = 0.02  # spectral density of what is flown besides v: swings go to and fro and leave little
    lean_1_s: float = 0.18  # k: v goes within 6 s, slow beside the swing

    def __post_init__(self) -> None:
        sigmas = "velocity_sigma_m_s", "start_sigma_s", "turn_rate_sigma_rad_s"
        check_numbers("guidance.path", self, zero=(*sigmas, "wander_1_sqrt_s"))


@dataclass(frozen=True, slots=True)
class _Ahead:
    """A change that has not begun."""

    starts_s: float  #: on the path's own clock
    entry_s: float
    turn_rate_rad_s: float
    climb_rad: float


class AnnouncedPath:
    """Eqs. (1) to (3), one control tick at a time; straight and level until something is announced."""

    def __init__(self, settings: AnnouncedPathSettings | None = None) -> None:
        self._settings = settings or AnnouncedPathSettings()
        self._ahead: list[_Ahead] = []  # in the order in which they begin
        self._before = (0.0, 0.0)
        self._after = (0.0, 0.0)
        self._entry_s, self._since_s, self._clock_s = 0.0, 0.0, 0.0
        self._v, self._e = 0.0, 0.0
        self._covariance = (self._settings.velocity_sigma_m_s**2, 0.0, 0.0)  # of v, of both, of e
        self.is_announced = False  #: anything, ever
        self.turn_rate_rad_s, self.climb_rad = 0.0, 0.0  #: as announced, now

    @property
    def bank_rad(self) -> float:
        """Eq. (2)."""
        return -math.atan(self._settings.airspeed_m_s * self.turn_rate_rad_s / _GRAVITY_M_S2)

    @property
    def left_m_s(self) -> float:
        """Velocity v to the left, beyond the path, that keeps company with the tanker, as learnt."""
        return self._v

    @property
    def left_m_s2(self) -> float:
        """Its rate, Eq. (3): v' = -k v."""
        return -self._settings.lean_1_s * self._v

    @property
    def flown_rad_s(self) -> float:
        """Turn rate to fly, Eq. (3)."""
        return self.turn_rate_rad_s * (1.0 - self._e) - self.left_m_s2 / self._settings.airspeed_m_s

    def announce(self, announcement: TankerAnnouncement) -> None:
        """Take note of what the tanker is about to do."""
        self.is_announced = True
        starts_s = self._clock_s + announcement.starts_s - announcement.time_stamp_s
        change = _Ahead(starts_s, announcement.entry_s, announcement.turn_rate_rad_s, announcement.climb_rad)
        insort(self._ahead, change, key=lambda ahead: ahead.starts_s)

    def step(self, step_s: float, left_m_s: float | None = None) -> None:
        """Advance by a control period.

        Args:
            step_s: the period.
            left_m_s: velocity of the drogue to the left on the receiver's scale, beyond the path; None if not seen.
        """
        if self.is_announced:
            self._learn(step_s, left_m_s)
        self._clock_s += step_s
        self._since_s += step_s
        if self._ahead and self._clock_s >= self._ahead[0].starts_s:
            self._begin(self._ahead.pop(0))
        u = min(self._since_s / self._entry_s, 1.0) if self._entry_s > 0.0 else 1.0
        s = u**3 * (10.0 - 15.0 * u + 6.0 * u * u)  # Eq. (1)
        self.turn_rate_rad_s, self.climb_rad = (
            before + s * (after - before) for before, after in zip(self._before, self._after, strict=True)
        )

    def _begin(self, change: _Ahead) -> None:
        same_turn = change.turn_rate_rad_s == self._after[0]
        self._before = (self.turn_rate_rad_s, self.climb_rad)
        self._after = (change.turn_rate_rad_s, change.climb_rad)
        self._entry_s, self._since_s = change.entry_s, self._clock_s - change.starts_s
        if change.turn_rate_rad_s != 0.0 and not same_turn:  # another turn, another error
            sigma = self._settings.turn_rate_sigma_rad_s / change.turn_rate_rad_s
            self._e, self._covariance = 0.0, (self._covariance[0], 0.0, sigma**2)

    def _learn(self, step_s: float, left_m_s: float | None) -> None:
        """A step of the filter of Eq. (3)."""
        s, (vv, ve, ee) = self._settings, self._covariance
        self._v += self.left_m_s2 * step_s
        f = -s.airspeed_m_s * self.turn_rate_rad_s * step_s
        vv, ve = vv + 2.0 * f * ve + f * f * ee, ve + f * ee
        if self._since_s < self._entry_s:  # of a change that comes in sooner or later than said
            late = s.airspeed_m_s * (self._after[0] - self._before[0]) * s.start_sigma_s
            vv += late * late * step_s / self._entry_s
        ee += s.wander_1_sqrt_s**2 * step_s
        if left_m_s is not None:
            total, off = vv + s.swing_m2_s / step_s, left_m_s - self._v
            self._v, self._e = self._v + vv / total * off, self._e + ve / total * off
            vv, ve, ee = vv - vv * vv / total, ve - vv * ve / total, ee - ve * ve / total
        self._covariance = vv, ve, ee
