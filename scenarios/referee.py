"""Says from the truth how a flight ended.

contact: the coupling held the probe. miss: the tip passed the ring's plane, was not held and touched nothing.
rim_strike: the probe touched the drogue and was not held. abort: the navigation broke away before the ring's plane.
collision: anything of the receiver but its probe touched something. timeout: none of these. diverged: the simulation
broke down; the loop says so, not the referee.

Radial offset and closure speed are taken where the tip crosses the ring's plane from behind (the last crossing before
the coupling holds); the angle between probe and drogue axis when it holds.
"""

from dataclasses import dataclass
from enum import Enum

import numpy as np

from dockair.sim.hose.chain import cross
from dockair.sim.truth import Truth

PASSED_M = 1.0  # a tip this far ahead of the ring's plane without being held has missed for good


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


@dataclass(frozen=True, slots=True)
class _Crossing:
    radial_m: float
    closure_m_s: float


class Referee:
    """Watches the truth tick by tick."""

    def __init__(self) -> None:
        self._previous_x: float | None = None
        self._crossing: _Crossing | None = None
        self._touched = False
        self.contact: Contact | None = None
        self.collided_with = ""

    def watch(self, truth: Truth) -> None:
        """Take note of one physics tick."""
        p_DP = truth.p_DP
        v_DP_D = truth.R_WD.T @ (truth.v_WP - truth.v_WD) - cross(truth.w_WD_D, p_DP)
        if self._previous_x is not None and self._previous_x < 0.0 <= p_DP[0]:
            self._crossing = _Crossing(float(np.hypot(p_DP[1], p_DP[2])), float(v_DP_D[0]))
        self._previous_x = float(p_DP[0])
        self._touched = self._touched or truth.probe_touches_drogue
        self.collided_with = self.collided_with or truth.receiver_touches
        if truth.latched and self.contact is None:
            self.contact = self._contact(truth)

    def _contact(self, truth: Truth) -> Contact:
        crossing = self._crossing or _Crossing(float("nan"), float("nan"))
        cosine = float((truth.R_WB[:, 0] @ truth.R_WD[:, 0]).clip(-1.0, 1.0))
        return Contact(
            time_s=truth.time_s,
            radial_offset_m=crossing.radial_m,
            closure_speed_m_s=crossing.closure_m_s,
            angle_deg=float(np.degrees(np.arccos(cosine))),
        )

    def judge(self, truth: Truth, phase: str, duration_s: float) -> Outcome | None:
        """Return the outcome once the flight is over, None before.

        Args:
            truth: now.
            phase: the navigation's own phase; "clear" ends a flight.
            duration_s: the longest a flight may take.
        """
        if self.collided_with:
            return Outcome.COLLISION
        passed = truth.p_DP[0] > PASSED_M and not truth.latched
        if phase == "clear" or passed or truth.time_s >= duration_s:
            return self._outcome(phase)
        return None

    def _outcome(self, phase: str) -> Outcome:
        if self.contact is not None:
            return Outcome.CONTACT
        if self._touched:
            return Outcome.RIM_STRIKE
        if self._crossing is not None:
            return Outcome.MISS
        return Outcome.ABORT if phase == "clear" else Outcome.TIMEOUT
