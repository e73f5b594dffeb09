"""The time between contact and release: how long, how far in, how hard. Of a flight that docks twice, the first."""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import takewhile
from operator import attrgetter

from dockair.sim.truth import Truth


@dataclass(frozen=True, slots=True, kw_only=True)
class Hold:
    """The time between contact and release."""

    duration_s: float
    take_in_max_m: float  #: most hose that was wound in
    coupling_force_max_n: float  #: largest pull at any physics tick, that at which it let go included


@dataclass(frozen=True, slots=True, kw_only=True)
class Disconnect:
    """How the probe left the coupling."""

    time_s: float


def hold_of(truths: Sequence[Truth], pull_max_n: float) -> tuple[Hold | None, Disconnect | None]:
    """Return what happened while the probe was held, and how it came free (None: it did not).

    Args:
        truths: one a control tick.
        pull_max_n: largest pull that the referee saw, who watches every physics tick: that which opens the coupling
            lasts for one of them.
    """
    first = next((k for k, truth in enumerate(truths) if truth.latched), None)
    if first is None:
        return None, None
    during = list(takewhile(attrgetter("latched"), truths[first:]))
    last = first + len(during) - 1
    released = truths[last + 1 : last + 2]
    hold = Hold(
        duration_s=truths[last].time_s - truths[first].time_s,
        take_in_max_m=max(truth.reel_position_m for truth in during),
        coupling_force_max_n=pull_max_n,
    )
    return hold, Disconnect(time_s=released[0].time_s) if released else None
