"""Departure from controlled flight: the receiver no longer goes where its flight control means it to.

It has departed when its angle of attack has been farther from that at the start than alpha_d for a time t_alpha, or its
probe's tip farther from the drogue across the tanker's axes than d for a time t_d. A flight that begins far aside has
its way to the drogue yet to fly: there d is no less than what it began with and s besides. There is no way back: what a
flight shows after that is no docking.

Not modelled: departures that end before those times; a spin at a small angle of attack beside the drogue.
"""

from dataclasses import dataclass

import numpy as np

from dockair.sim.truth import Truth


@dataclass(frozen=True, slots=True, kw_only=True)
class DepartureLimits:
    """alpha_d, t_alpha, d, s and t_d."""

    angle_rad: float = 0.2617993878  # 15 degrees: three times what severe gusts do at 180 m/s
    angle_s: float = 0.5  # gusts that long are slower than the short period, and flown
    across_m: float = 20.0  # no phase takes the receiver farther than some metres off the drogue's line
    beyond_start_m: float = 10.0  # nor farther off on its way in from a start far aside
    across_s: float = 2.0  # a drogue's swing: one that is only passing by is back


class Departure:
    """Watches a receiver tick by tick.

    Args:
        limits: from where on it has departed.
    """

    def __init__(self, limits: DepartureLimits | None = None) -> None:
        self._limits = limits or DepartureLimits()
        self._angle_at_start_rad: float | None = None
        self._most_across_m = 0.0  # of this flight: it is known as it begins
        self._steep_since_s: float | None = None
        self._away_since_s: float | None = None
        self.time_s: float | None = None  #: when it departed: the first tick beyond either limit

    def watch(self, truth: Truth) -> None:
        """Take note of one tick."""
        if self.time_s is not None:
            return
        limits, now_s, across_m = self._limits, truth.time_s, _across_m(truth)
        if self._angle_at_start_rad is None:
            self._angle_at_start_rad = truth.angle_of_attack_rad
            self._most_across_m = max(limits.across_m, across_m + limits.beyond_start_m)
        steep = abs(truth.angle_of_attack_rad - self._angle_at_start_rad) > limits.angle_rad
        self._steep_since_s = _since(self._steep_since_s, steep, now_s)
        self._away_since_s = _since(self._away_since_s, across_m > self._most_across_m, now_s)
        for since_s, longest_s in ((self._steep_since_s, limits.angle_s), (self._away_since_s, limits.across_s)):
            if self.time_s is None and since_s is not None and now_s - since_s > longest_s:
                self.time_s = since_s


def _since(before_s: float | None, holds: bool, now_s: float) -> float | None:
    if not holds:
        return None
    return now_s if before_s is None else before_s


def _across_m(truth: Truth) -> float:
    across = truth.R_WT[:, 1:].T @ (truth.p_WP - truth.p_WD)
    return float(np.hypot(across[0], across[1]))
