"""Flight path of the tanker: straight, the refuelling racetrack, the toboggan; prescribed, not flown.

True airspeed V is constant. Heading rate r (left positive) and climb angle gamma go from one steady value to the next
over a time T by the step s of the fifth order, u = t/T:

    s(u) = u^3 (10 - 15 u + 6 u^2),    integral of s over [0, u] = u^4 (5/2 - 3 u + u^2)                  (1)
    heading' = r,     v = V (cos gamma cos heading, cos gamma sin heading, sin gamma)                     (2)
    tan(bank) = V r cos gamma / (V gamma' + g cos gamma)                                                  (3)

Eq. (3) is coordinated flight: no side force in the tanker's own axes, x along its way through the air. Its bank is that
of the turn, left wing down positive like r; `bank_rad`, right wing down positive, is its negative. s has no jump up to
its second derivative, so that the roll acceleration has none either. A turn of bank b rolls in over the time

    T = 15/8 tan(b) / p          (p: limit of the roll rate),      r = g tan(b) / V                       (4)

and a racetrack's turns, rolling in and out included, are of 180 degrees each: in the air mass it closes on itself.
The place is the integral of Eq. (2): in closed form while r is steady, by Gauss-Legendre quadrature where it changes.

Frames: W moves with the tanker's velocity at t = 0, (V, 0, 0); the air there blows with (-V, 0, 0) all the time.
Not modelled: the tanker's own dynamics and what gusts and hose do to it, its angle of attack (T's x axis lies along the
way through the air), the change of the air with altitude (a toboggan of 3 degrees at 180 m/s goes down 570 m a minute,
on which the air's density grows by 6 per cent).
"""

import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Literal

import numpy as np

from dockair.errors import DockairError
from dockair.rotations import Array
from dockair.sim.air.atmosphere import STANDARD_GRAVITY_M_S2
from dockair.sim.aircraft.tanker_motion import ALPHA, CLIMB, NODES, OMEGA, TURN, WEIGHTS, A, P, R, V, state_at

Manoeuvre = Literal["straight", "racetrack", "toboggan"]

_PEAK_RATE = 15.0 / 8.0  # of s', at u = 1/2
_LONGEST_S = 3600.0  # of one segment: longer than any flight
#: Layout of a segment: when it begins, how long it is, r and gamma at both ends, heading and place at the beginning.
_START, _DURATION, _R0, _R1, _G0, _G1, _HEADING, _PLACE = 0, 1, 2, 3, 4, 5, 6, slice(7, 10)
_SEGMENT = 10


@dataclass(frozen=True, slots=True, kw_only=True)
class TankerPathParameters:
    """What the tanker flies; sheet `tanker_path` and the scenario's table `[tanker]`."""

    manoeuvre: Manoeuvre = "straight"
    starts_s: float = 0.0  #: when the first turn, or the descent, begins
    leg_s: float = 60.0  #: wings level between two turns of the racetrack
    bank_rad: float = 0.0
    turns_left: bool = True
    descent_rad: float = 0.0  #: angle of the way through the air below the horizon
    roll_rate_rad_s: float = 0.1
    pull_over_rate_rad_s: float = 0.01


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class TankerState:
    """The tanker at one moment; arrays are read-only."""

    R_WT: Array  #: (3, 3)
    p_WT: Array  #: (3,) of T's origin [m]
    v_WT_W: Array  #: (3,) [m/s]
    a_WT_W: Array  #: (3,) [m/s^2]
    w_WT_T: Array  #: (3,) [rad/s]
    alpha_WT_T: Array  #: (3,) [rad/s^2]
    turn_rate_rad_s: float  #: of the heading, left positive
    climb_rad: float  #: of the way through the air

    @property
    def heading_rad(self) -> float:
        """Of the way through the air, 0 at the start, left positive."""
        return math.atan2(self.R_WT[1, 0], self.R_WT[0, 0])

    @property
    def bank_rad(self) -> float:
        """Right wing down positive."""
        return math.atan2(self.R_WT[2, 1], self.R_WT[2, 2])


@dataclass(frozen=True, slots=True, kw_only=True)
class Change:
    """A change of the tanker's steady flight: what it would announce by radio."""

    starts_s: float
    entry_s: float  #: from one steady flight to the next
    turn_rate_rad_s: float  #: afterwards, left positive
    climb_rad: float  #: afterwards


class TankerPath:
    """The path, as a function of time; straight and level before t = 0.

    Args:
        parameters: what is flown.
        airspeed_m_s: V.
        start_m: (3,) place of T's origin in W at t = 0.

    Raises:
        DockairError: a manoeuvre that cannot be flown so.
    """

    def __init__(self, parameters: TankerPathParameters, airspeed_m_s: float, start_m: Array | None = None) -> None:
        _check(parameters, airspeed_m_s)
        self._parameters, self._airspeed_m_s = parameters, airspeed_m_s
        self._wanted = self._steady_flights()
        self._segments = np.zeros((1, _SEGMENT))
        self._segments[0, _PLACE] = np.zeros(3) if start_m is None else start_m
        self._segments[0, _DURATION] = parameters.starts_s  # no end where nothing follows
        self._changes: list[Change] = []
        self._extend()

    @property
    def is_straight(self) -> bool:
        """Whether the tanker stands still in W for ever."""
        return self._parameters.manoeuvre == "straight"

    def at(self, time_s: float) -> TankerState:
        """The tanker at a time."""
        x = self.vector(time_s)
        x.setflags(write=False)
        return TankerState(
            R_WT=x[R].reshape(3, 3),
            p_WT=x[P],
            v_WT_W=x[V],
            a_WT_W=x[A],
            w_WT_T=x[OMEGA],
            alpha_WT_T=x[ALPHA],
            turn_rate_rad_s=float(x[TURN]),
            climb_rad=float(x[CLIMB]),
        )

    def vector(self, time_s: float) -> Array:
        """(26,) the same in one new array, laid out as P, V, A, R, OMEGA, ALPHA, TURN, CLIMB of `tanker_motion` say."""
        if not math.isfinite(time_s):
            raise DockairError("time_s", expected="a finite time", got=time_s)
        while time_s >= self._segments[-1, _START] + self._segments[-1, _DURATION]:
            self._extend()
        return state_at(self._segments, time_s, self._airspeed_m_s, NODES, WEIGHTS)

    def change_after(self, time_s: float) -> Change | None:
        """The first change of steady flight that begins after a time, None if there is none any more."""
        self.vector(time_s)
        while not any(change.starts_s > time_s for change in self._changes):
            if not self._extend():
                return None
        return next(change for change in self._changes if change.starts_s > time_s)

    def _steady_flights(self) -> Iterator[tuple[float, float, float, float]]:
        """(seconds of entry, seconds of steady flight, r, gamma) after the first leg, one after the other."""
        p = self._parameters
        if p.manoeuvre == "racetrack":
            r = STANDARD_GRAVITY_M_S2 * math.tan(p.bank_rad) / self._airspeed_m_s
            entry_s = _entry_s(p)
            signed = r if p.turns_left else -r
            while True:
                yield entry_s, math.pi / r - entry_s, signed, 0.0
                yield entry_s, p.leg_s, 0.0, 0.0
        elif p.manoeuvre == "toboggan":
            yield _PEAK_RATE * p.descent_rad / p.pull_over_rate_rad_s, _LONGEST_S, 0.0, -p.descent_rad

    def _extend(self) -> bool:
        """Append the entry into the next steady flight and that; return whether there is one. The last has no end."""
        following = next(self._wanted, None)
        last = self._segments[-1]
        end_s = last[_START] + last[_DURATION]
        if following is None:
            self._segments[-1, _DURATION] = math.inf
            return False
        entry_s, steady_s, r, gamma = following
        self._changes.append(Change(starts_s=float(end_s), entry_s=entry_s, turn_rate_rad_s=r, climb_rad=gamma))
        for duration_s, r0, g0 in ((entry_s, last[_R1], last[_G1]), (steady_s, r, gamma)):
            self._append(duration_s, (r0, r), (g0, gamma))
        return True

    def _append(self, duration_s: float, r: tuple[float, float], gamma: tuple[float, float]) -> None:
        last = self._segments[-1]
        end = state_at(self._segments[-1:], last[_START] + last[_DURATION], self._airspeed_m_s, NODES, WEIGHTS)
        heading = last[_HEADING] + 0.5 * (last[_R0] + last[_R1]) * last[_DURATION]  # the integral of s over [0, 1]: 1/2
        row = np.array([last[_START] + last[_DURATION], duration_s, *r, *gamma, heading, *end[P]])
        self._segments = np.vstack([self._segments, row])


def _entry_s(parameters: TankerPathParameters) -> float:
    """Eq. (4): how long rolling into the turn takes."""
    return _PEAK_RATE * math.tan(parameters.bank_rad) / parameters.roll_rate_rad_s


def _check(parameters: TankerPathParameters, airspeed_m_s: float) -> None:
    p = parameters
    if not airspeed_m_s > 0.0:
        raise DockairError("airspeed_m_s", expected="a speed > 0", got=airspeed_m_s)
    positive = ["roll_rate_rad_s", "pull_over_rate_rad_s"]
    positive += {"racetrack": ["bank_rad"], "toboggan": ["descent_rad"]}.get(p.manoeuvre, [])
    for key in positive:
        if not 0.0 < getattr(p, key) < math.inf:
            raise DockairError(f"tanker.{key}", expected="a number > 0", got=getattr(p, key))
    for key in ("starts_s", "leg_s"):
        if not 0.0 <= getattr(p, key) < math.inf:
            raise DockairError(f"tanker.{key}", expected="a time >= 0", got=getattr(p, key))
    if p.manoeuvre != "racetrack":
        return
    if not p.bank_rad < 0.5 * math.pi:
        raise DockairError("tanker.bank_rad", expected="a bank below a right angle", got=p.bank_rad)
    turn_s = math.pi * airspeed_m_s / (STANDARD_GRAVITY_M_S2 * math.tan(p.bank_rad))
    if _entry_s(p) > turn_s:
        expected = f"a rate at which rolling in and out fits into a turn of 180 degrees ({turn_s:.1f} s)"
        raise DockairError("parameters.tanker_path.roll_rate_rad_s", expected=expected, got=p.roll_rate_rad_s)
