"""How an episode's attempts end, from the truth alone: a policy announces no phases.

An attempt begins when the tip crosses the ring's plane from behind within `aside_m` of the drogue's axis, or when the
probe touches the drogue; farther off it passes by, as for the flight's own referee. It ends in contact when the
coupling holds; in a rim strike (touched) or a miss (did not) when the tip is `retreat_m` behind the plane again,
`overshoot_m` ahead of it or `aside_m` off the drogue's axis, and the coupling has not taken hold; or when time is over.
"""

from dataclasses import dataclass, field

import numpy as np

from dockair.scenarios.judgement.attempts import RefereeLimits
from dockair.scenarios.judgement.referee import Outcome
from dockair.sim.truth import Truth


@dataclass(frozen=True, slots=True, kw_only=True)
class AttemptLimits:
    """Where an attempt begins, and where one that did not hold is over."""

    retreat_m: float = 0.5  # a tip that swings to and fro at the ring, 0.15 m, is still trying
    overshoot_m: float = 1.0  # the coupling is 0.25 to 0.35 m behind the plane: past it, and past the drogue
    aside_m: float = field(default_factory=lambda: RefereeLimits().aside_m)  # one rule for who tries and who passes by


class AttemptJudge:
    """Watches one episode, control tick by control tick.

    Args:
        attempts: how many may fail before the episode ends.
        limits: where one ends.
    """

    def __init__(self, attempts: int, limits: AttemptLimits | None = None) -> None:
        self._most, self._limits = attempts, limits or AttemptLimits()
        self._previous_x: float | None = None
        self._trying = self._touched = False
        self.failed = 0  #: attempts that are over and did not hold

    @property
    def number(self) -> int:
        """Of the attempt that goes on, or that would be the next, from 1."""
        return min(self.failed + 1, self._most)

    def watch(self, truth: Truth, touched: bool) -> tuple[bool, Outcome | None]:
        """Take note of a tick; return whether an attempt has just failed, and the outcome when it was the last.

        Args:
            truth: at the tick's end.
            touched: whether the probe has touched the drogue within the tick.
        """
        x, aside_m = float(truth.p_DP[0]), float(np.hypot(truth.p_DP[1], truth.p_DP[2]))
        limits = self._limits
        crossed = self._previous_x is not None and self._previous_x < 0.0 <= x and aside_m <= limits.aside_m
        self._previous_x = x
        if truth.latched:
            return False, Outcome.CONTACT
        self._trying |= crossed or touched
        self._touched |= touched
        is_near = -limits.retreat_m < x < limits.overshoot_m and aside_m <= limits.aside_m
        if not self._trying or is_near or touched:
            return False, None
        outcome = self.unfinished
        self._trying = self._touched = False
        self.failed += 1
        return True, outcome if self.failed >= self._most else None

    @property
    def unfinished(self) -> Outcome | None:
        """How the attempt that goes on ends if it ends now; None when there is none."""
        if not self._trying:
            return None
        return Outcome.RIM_STRIKE if self._touched else Outcome.MISS
