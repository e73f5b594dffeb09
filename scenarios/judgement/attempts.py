"""Attempts to dock within one flight: when each began and ended, and from the truth how.

An attempt begins whenever the phase becomes "approach". It ends when the coupling holds the probe, or when the phase
next leaves {"approach", "contact"}; what the probe does after that and before the next attempt is still put down to it,
for a probe that has been called back may be too quick to miss the rim. Where nobody announces phases, the first attempt
begins when the tip touches the drogue or crosses the ring's plane within 1 m of its centre. Farther off it passes by,
before the first attempt and after one that is over.

Radial offset, closing speed and angle of an attempt are those of the tip in drogue axes

    contact:   at the last crossing of the ring's plane from behind; the angle when the coupling takes hold
    else:      at the crossing with the smallest offset; without one, at the closest approach to the ring's centre
               before the attempt ended
"""

from collections.abc import Sequence
from dataclasses import dataclass
from enum import Enum

import numpy as np

from dockair.rotations import Array
from dockair.sim.truth import Truth
from dockair.vectors import cross

ATTEMPTING = ("approach", "contact")  # phases in which the receiver tries


class AttemptOutcome(Enum):
    """How an attempt ended; of several that hold, the first."""

    COLLISION = "collision"  #: anything of the receiver but its probe touched something
    CONTACT = "contact"  #: the coupling held the probe
    RIM_STRIKE = "rim_strike"  #: the probe touched the drogue and was not held
    MISS = "miss"  #: the tip crossed the ring's plane and touched nothing
    BREAKAWAY = "breakaway"  #: the navigation broke away
    GIVEN_UP = "given_up"  #: the navigation went back to try again, or to clear
    DIVERGED = "diverged"  #: the simulation broke down meanwhile
    TIMEOUT = "timeout"  #: time ran out meanwhile


@dataclass(frozen=True, slots=True, kw_only=True)
class RefereeLimits:
    """What a good contact keeps to, and what is unsafe. Defaults: service practice, or this test bed's drogue."""

    radial_offset_m: float = 0.15  # whatever the drogue; one of 0.5 m leads a tip within it to the coupling at 2.4 m/s
    angle_deg: float = 10.0  # of the coupling
    closure_speed_m_s: float = 2.6  # 5 kt, service limit; above it a touch is unsafe
    rim_radius_m: float = 0.25  # half the ring's diameter
    #: The basket narrows from its rim, so far ahead of the ring's centre, to its throat, and goes on as wide as that:
    #: what is touched from farther out than its ribs reach is its outside. A tip that slides out along two ribs lies
    #: between them, from inside, with its middle where theirs are.
    rim_x_m: float = 0.03
    throat_x_m: float = 0.25
    throat_radius_m: float = 0.058
    rib_radius_m: float = 0.008
    #: As of breakaway practice: who crosses the plane farther off, and is in no approach, tries nothing.
    aside_m: float = 1.0

    def basket_radius_m(self, x_m: float) -> float:
        """Of the basket's outside, so far forward of the ring's centre along its axis; aft of that, of its rim."""
        ends = (self.rim_x_m, self.throat_x_m), (self.rim_radius_m, self.throat_radius_m)
        return min(self.rim_radius_m, float(np.interp(x_m, *ends)) + self.rib_radius_m)


@dataclass(frozen=True, slots=True, kw_only=True)
class Passing:
    """The probe's tip at one moment, seen from the drogue."""

    time_s: float
    p_DP: Array  #: (3,) tip from the ring's centre, drogue axes [m]
    closure_speed_m_s: float  #: of the tip along the drogue's axis
    angle_deg: float  #: between the probe's line and the drogue's axis

    @property
    def radial_offset_m(self) -> float:
        """Tip off the drogue's axis."""
        return float(np.hypot(self.p_DP[1], self.p_DP[2]))


@dataclass(frozen=True, slots=True, kw_only=True)
class Attempt:
    """One attempt, over; `cause` is for `scenarios.causes` to find."""

    number: int  #: from 1
    begun_s: float
    ended_s: float
    outcome: str
    radial_offset_m: float
    closure_speed_m_s: float
    angle_deg: float
    left_m: float  #: tip off the drogue's axis, drogue axes
    up_m: float
    decided_s: float  #: when the offset was taken
    cause: str = ""
    reason: str = ""  #: the navigation's own, why it left the attempt


def is_good_contact(attempt: Attempt, limits: RefereeLimits | None = None) -> bool:
    """Return whether an attempt ended in a contact inside the limits."""
    limits = limits or RefereeLimits()
    return (
        attempt.outcome == AttemptOutcome.CONTACT.value
        and attempt.radial_offset_m <= limits.radial_offset_m
        and attempt.closure_speed_m_s <= limits.closure_speed_m_s
        and attempt.angle_deg <= limits.angle_deg
    )


def succeeded(attempts: Sequence[Attempt]) -> bool:
    """Return whether any attempt ended in a good contact."""
    return any(is_good_contact(attempt) for attempt in attempts)


def first_attempt_succeeded(attempts: Sequence[Attempt]) -> bool:
    """Return whether the first one did."""
    return bool(attempts) and is_good_contact(attempts[0])


def passing(truth: Truth) -> Passing:
    """Return where the tip is and how fast it closes, w x p of the drogue's turning included."""
    p_DP = truth.p_DP
    v_DP_D = truth.R_WD.T @ (truth.v_WP - truth.v_WD) - cross(truth.w_WD_D, p_DP)
    cosine = float((truth.R_WB[:, 0] @ truth.R_WD[:, 0]).clip(-1.0, 1.0))
    return Passing(
        time_s=truth.time_s,
        p_DP=p_DP,
        closure_speed_m_s=float(v_DP_D[0]),
        angle_deg=float(np.degrees(np.arccos(cosine))),
    )


class OpenAttempt:
    """What is known of the attempt that goes on.

    Args:
        number: from 1.
        truth: where it begins.
    """

    def __init__(self, number: int, truth: Truth) -> None:
        self.number, self.begun_s = number, truth.time_s
        self.touched = False
        self.latched: Passing | None = None
        self.last_crossing: Passing | None = None
        self.best_crossing: Passing | None = None
        self._closest = truth
        self._closest_m2 = np.inf
        self._ended_s: float | None = None
        self._ended_as = AttemptOutcome.TIMEOUT
        self._reason = ""

    @property
    def is_over(self) -> bool:
        """Whether the navigation has left it, or the coupling has taken hold."""
        return self._ended_s is not None

    def watch(self, truth: Truth, p_DP: Array) -> None:
        """Take note of one physics tick before the attempt is over."""
        if self.is_over:
            return
        x, y, z = p_DP.tolist()
        away_m2 = x * x + y * y + z * z
        if away_m2 < self._closest_m2:
            self._closest, self._closest_m2 = truth, away_m2

    def cross(self, at: Passing) -> None:
        """Take note of the tip in the ring's plane, coming from behind."""
        self.last_crossing = at
        if self.best_crossing is None or at.radial_offset_m < self.best_crossing.radial_offset_m:
            self.best_crossing = at

    def latch(self, at: Passing) -> None:
        """Take note of the coupling's hold: the attempt has succeeded."""
        self.latched, self._ended_s = at, at.time_s

    def leave(self, time_s: float, outcome: AttemptOutcome, reason: str) -> None:
        """Take note of how it ended for the navigation; what the truth says of it goes first."""
        if self._ended_s is None:
            self._ended_s, self._ended_as, self._reason = time_s, outcome, reason

    def settled(self, now_s: float, collided: bool) -> Attempt:
        """Return the attempt as it stands.

        Args:
            now_s: ends it if nothing has.
            collided: the receiver struck something in its course.
        """
        at = self._decisive()
        return Attempt(
            number=self.number,
            begun_s=self.begun_s,
            ended_s=now_s if self._ended_s is None else self._ended_s,
            outcome=self._outcome(collided).value,
            radial_offset_m=at.radial_offset_m,
            closure_speed_m_s=at.closure_speed_m_s,
            angle_deg=at.angle_deg if self.latched is None else self.latched.angle_deg,
            left_m=float(at.p_DP[1]),
            up_m=float(at.p_DP[2]),
            decided_s=at.time_s,
            reason=self._reason,
        )

    def _decisive(self) -> Passing:
        if self.latched is not None:
            return self.last_crossing or self.latched
        return self.best_crossing or passing(self._closest)

    def _outcome(self, collided: bool) -> AttemptOutcome:
        if collided:
            return AttemptOutcome.COLLISION
        if self.latched is not None:
            return AttemptOutcome.CONTACT
        if self.touched:
            return AttemptOutcome.RIM_STRIKE
        return AttemptOutcome.MISS if self.best_crossing is not None else self._ended_as
