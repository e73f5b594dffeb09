"""Says from the truth how a flight ended, attempt by attempt, and what about it was unsafe.

contact: the coupling held the probe. miss: the tip passed the ring's plane, was not held and touched nothing.
rim_strike: the probe touched the drogue and was not held. abort: the navigation cleared without any of these.
collision: anything of the receiver but its probe touched something, or the probe anything but basket and coupling, as a
hose that whips. timeout: time was over before the navigation cleared, and the probe had touched nothing. diverged: the
simulation broke down; the loop says so, not the referee. A flight goes on after a miss: it ends when the navigation is
clear, when the receiver collides, when time is over.

Radial offset and closure speed are taken where the tip crosses the ring's plane from behind (the last crossing before
the coupling holds); the angle between probe and drogue axis when it holds.

Unsafe is a touch at more than 2.6 m/s along the drogue's axis, held or not, one with the tip outside the rim or, ahead
of it, outside the basket (also by a drogue that the coupling has let go), a contact while the navigation itself marked
its solution unusable (as the tip entered the basket or as it was held), any collision, and a receiver that departs from
controlled flight (`departure`).
"""

import math
from dataclasses import dataclass
from enum import Enum

from dockair.rotations import Array
from dockair.scenarios.judgement.attempts import (
    ATTEMPTING,
    Attempt,
    AttemptOutcome,
    OpenAttempt,
    Passing,
    RefereeLimits,
    passing,
)
from dockair.scenarios.judgement.departure import Departure
from dockair.sim.truth import Truth


class Outcome(Enum):
    """How a flight ended."""

    CONTACT = "contact"
    MISS = "miss"
    RIM_STRIKE = "rim_strike"
    ABORT = "abort"
    COLLISION = "collision"
    TIMEOUT = "timeout"
    DIVERGED = "diverged"  #: the simulation, not the flight: its parameters are beyond what the physics can bear


@dataclass(frozen=True, slots=True, kw_only=True)
class Contact:
    """How the probe entered the coupling."""

    time_s: float
    radial_offset_m: float
    closure_speed_m_s: float
    angle_deg: float


class Referee:
    """Watches the truth tick by tick.

    Args:
        limits: beyond which a touch is unsafe.
    """

    def __init__(self, limits: RefereeLimits | None = None) -> None:
        self.limits = limits or RefereeLimits()  #: beyond which a touch is unsafe
        self._previous_x: float | None = None
        self._phase, self._usable = "", True
        self._over: list[Attempt] = []
        self._open: OpenAttempt | None = None
        self._entered_usable = True
        self._outside_m = 0.0  # farthest that the tip was off the axis when it touched beyond the rim
        self._fastest_m_s = 0.0  # that tip and drogue closed at in a touch
        self._unsafe: list[str] = []
        self._departure = Departure()
        self.contact: Contact | None = None
        self.pull_max_n = -math.inf  #: largest in the coupling's first hold, the tick at which it let go included
        self._held = self._let_go = False
        self.collided_with = ""

    def watch(self, truth: Truth) -> None:
        """Take note of one physics tick."""
        p_DP = truth.p_DP
        x = float(p_DP[0])
        if self._previous_x is not None and self._previous_x < 0.0 <= x:
            self._enter(truth)
        self._previous_x = x
        if truth.probe_touches_drogue:
            self._touch(truth, p_DP)
        if truth.receiver_touches and not self.collided_with:
            self.collided_with = truth.receiver_touches
            self._unsafe.append(f"collision with {self.collided_with}")
        if not self._let_go and (truth.latched or self._held):
            self.pull_max_n = max(self.pull_max_n, truth.coupling_force_n)
            self._held, self._let_go = truth.latched, not truth.latched
        if truth.latched and self._attempt(truth).latched is None:
            self._latch(truth)
        elif self._open is not None:
            self._open.watch(truth, p_DP)

    def judge(
        self, truth: Truth, phase: str, duration_s: float, *, usable: bool = True, reason: str = ""
    ) -> Outcome | None:
        """Return the outcome once the flight is over, None before.

        Args:
            truth: now.
            phase: the navigation's own phase; "clear" ends a flight.
            duration_s: the longest a flight may take.
            usable: whether the navigation says that contact may be flown on its solution.
            reason: the navigation's own, why it entered the phase.
        """
        self._follow(truth, phase, reason)
        self._departure.watch(truth)
        self._usable = usable
        if self.collided_with:
            return Outcome.COLLISION
        if phase == "clear" or truth.time_s >= duration_s:
            return self._outcome(truth, phase)
        return None

    def attempt_log(self, now_s: float, outcome: Outcome | None) -> tuple[Attempt, ...]:
        """Return all attempts.

        Args:
            now_s: when the flight ended, if it has.
            outcome: of the flight; None while it goes on.
        """
        if self._open is None:
            return tuple(self._over)
        if outcome is Outcome.DIVERGED:
            self._open.leave(now_s, AttemptOutcome.DIVERGED, "")
        return (*self._over, self._open.settled(now_s, bool(self.collided_with)))

    @property
    def attempt(self) -> int:
        """The number of the attempt that goes on or was the last, from 1; 1 before the first."""
        return 1 if self._open is None else self._open.number

    @property
    def unsafe(self) -> tuple[str, ...]:
        """What was unsafe; empty when all was safe."""
        unsafe, departed_s = list(self._unsafe), self._departure.time_s
        if self._fastest_m_s > self.limits.closure_speed_m_s:
            unsafe.append(f"touch at {self._fastest_m_s:.2f} m/s")
        if self._outside_m > 0.0:
            unsafe.append(f"touch outside the basket, {self._outside_m:.2f} m off the axis")
        if departed_s is not None:
            unsafe.append(f"departed from controlled flight at {departed_s:.1f} s")
        return tuple(unsafe)

    def _attempt(self, truth: Truth) -> OpenAttempt:
        if self._open is None:
            self._open = OpenAttempt(len(self._over) + 1, truth)
        return self._open

    def _follow(self, truth: Truth, phase: str, reason: str) -> None:
        """Begin and end attempts with the phases."""
        begins = phase == "approach" and self._phase not in ATTEMPTING
        if self._open is not None and (begins or phase not in ATTEMPTING):
            broke_away = phase == "breakaway"
            ended_as = AttemptOutcome.BREAKAWAY if broke_away else AttemptOutcome.GIVEN_UP
            self._open.leave(truth.time_s, ended_as, reason)
        if begins:
            if self._open is not None:
                self._over.append(self._open.settled(truth.time_s, collided=False))
            self._open = OpenAttempt(len(self._over) + 1, truth)
        self._phase = phase

    def _enter(self, truth: Truth) -> None:
        now = passing(truth)
        trying = self._open is not None and not self._open.is_over
        if not trying and now.radial_offset_m > self.limits.aside_m:
            return
        attempt = self._attempt(truth)
        if attempt.latched is None:  # a probe that has been let go may swing to and fro
            attempt.cross(now)
            self._entered_usable = self._usable

    def _touch(self, truth: Truth, p_DP: Array) -> None:
        if truth.latched:
            return
        attempt, now = self._attempt(truth), passing(truth)
        attempt.touched = True  # one that was held is no rim strike afterwards: that is looked at first
        self._fastest_m_s = max(self._fastest_m_s, now.closure_speed_m_s)
        if now.radial_offset_m > self.limits.basket_radius_m(float(now.p_DP[0])):
            self._outside_m = max(self._outside_m, now.radial_offset_m)

    def _latch(self, truth: Truth) -> None:
        attempt, held = self._attempt(truth), passing(truth)
        attempt.latch(held)
        self._fastest_m_s = max(self._fastest_m_s, held.closure_speed_m_s)
        if not (self._usable and self._entered_usable):
            self._unsafe.append("contact on a solution marked unusable")
        if self.contact is None:
            self.contact = _contact(attempt.last_crossing, held)

    def _outcome(self, truth: Truth, phase: str) -> Outcome:
        if self.contact is not None:
            return Outcome.CONTACT
        outcomes = {attempt.outcome for attempt in self.attempt_log(truth.time_s, None)}
        if Outcome.RIM_STRIKE.value in outcomes:
            return Outcome.RIM_STRIKE
        if phase != "clear":
            return Outcome.TIMEOUT
        return Outcome.MISS if Outcome.MISS.value in outcomes else Outcome.ABORT


def _contact(crossing: Passing | None, held: Passing) -> Contact:
    return Contact(
        time_s=held.time_s,
        radial_offset_m=float("nan") if crossing is None else crossing.radial_offset_m,
        closure_speed_m_s=float("nan") if crossing is None else crossing.closure_speed_m_s,
        angle_deg=held.angle_deg,
    )
