"""The phases of a docking and what leads from one to the next.

| from        | to          | when                                                                          |
|-------------|-------------|-------------------------------------------------------------------------------|
| PRE_CONTACT | APPROACH    | steady behind the drogue for `stabilise_s`, the relative state is usable      |
| APPROACH    | CONTACT     | the probe's tip has come to the coupling                                      |
| APPROACH    | BREAKAWAY   | lost, too fast, or too far off the drogue's axis close to it                  |
| CONTACT     | HOLD        | nine tenths of `take_in_m` are pushed in and the drogue has come along        |
| CONTACT     | BREAKAWAY   | the drogue has not come along: the probe is not held                          |
| HOLD        | DISCONNECT  | `hold_s` are over                                                             |
| HOLD        | BREAKAWAY   | the drogue has left the probe                                                 |
| DISCONNECT  | CLEAR       | the drogue is `clear_m` ahead again                                           |
| BREAKAWAY   | CLEAR       | the drogue is `clear_m` ahead again, or `breakaway_s` are over                |

Approach and limits as in service practice: pre-contact 3-5 m behind the drogue, closing at 1.0-1.5 m/s and never over
2.6 m/s (5 kt). Not here yet: joining up from afar, and a second attempt after a breakaway.
"""

from collections.abc import Callable
from dataclasses import dataclass
from enum import Enum


class Phase(Enum):
    """What the receiver is doing."""

    PRE_CONTACT = "pre_contact"
    APPROACH = "approach"
    CONTACT = "contact"
    HOLD = "hold"
    DISCONNECT = "disconnect"
    CLEAR = "clear"
    BREAKAWAY = "breakaway"


@dataclass(frozen=True, slots=True, kw_only=True)
class PhaseLimits:
    """When one phase gives way to the next. Defaults: service procedures, or assumed where marked."""

    stabilise_s: float = 3.0  # assumed: a few periods of the drogue's motion
    steady_offset_m: float = 0.35  # assumed: about twice the drogue's excursion in light gusts
    steady_rate_m_s: float = 0.4  # assumed, likewise
    steady_sigma_m: float = 0.05  # assumed: a third of the 0.15 m that a contact may be off
    coupling_reached_m: float = 0.05  # assumed: the coupling takes the tip within 0.03 m, the range errs by 0.02 m
    come_along_m: float = 0.2  # assumed: a drogue farther from the tip than this is not held by it
    take_in_m: float = 1.5  # inside the refuelling range 0.5-6 m (KDC-10 procedures)
    hold_s: float = 5.0  # assumed: long enough to see that the drogue stays on the probe
    clear_m: float = 3.0  # procedures: pre-contact is 3-5 m behind the drogue
    lost_s: float = 0.5  # breakaway practice: track lost for 0.5 s ...
    lost_range_m: float = 2.0  # ... within 2 m
    off_axis_m: float = 1.0  # breakaway practice: 1 m off ...
    off_axis_range_m: float = 1.0  # ... within 1 m
    closure_limit_m_s: float = 2.6  # 5 kt, service limit
    breakaway_s: float = 10.0  # assumed: backing off at 1 m/s clears any attempt in this time


@dataclass(frozen=True, slots=True, kw_only=True)
class Situation:
    """What the transitions look at, from the navigation's own estimate."""

    in_phase_s: float  #: time since the phase began
    steady_s: float  #: time for which the drogue has been steady ahead
    unusable_s: float  #: time for which the relative state has been unusable
    ahead_m: float  #: coupling ahead of the probe's tip, body x
    ring_ahead_m: float  #: ring centre ahead of the probe's tip, body x
    lateral_m: float  #: ring centre off the probe's line
    closing_m_s: float  #: rate at which `ahead_m` shrinks
    pushed_in_m: float  #: way flown toward the tanker since the coupling was reached


def _must_break_away(limits: PhaseLimits, s: Situation) -> bool:
    lost = s.unusable_s > limits.lost_s and s.ahead_m < limits.lost_range_m
    off_axis = s.lateral_m > limits.off_axis_m and s.ahead_m < limits.off_axis_range_m
    return lost or off_axis or s.closing_m_s > limits.closure_limit_m_s


def _drogue_left(limits: PhaseLimits, s: Situation) -> bool:
    return abs(s.ahead_m) > limits.come_along_m or s.unusable_s > limits.lost_s


_TAKEN_IN = 0.9  # of the way at which holding begins: the receiver comes to rest on the remaining tenth

_Condition = Callable[[PhaseLimits, Situation], bool]

#: The table of the module's first lines; the first condition that holds decides.
TRANSITIONS: dict[Phase, tuple[tuple[_Condition, Phase], ...]] = {
    Phase.PRE_CONTACT: ((lambda limits, s: s.steady_s >= limits.stabilise_s, Phase.APPROACH),),
    Phase.APPROACH: (
        (_must_break_away, Phase.BREAKAWAY),
        (lambda limits, s: s.ahead_m <= limits.coupling_reached_m, Phase.CONTACT),
    ),
    Phase.CONTACT: (
        (_drogue_left, Phase.BREAKAWAY),
        (lambda limits, s: s.pushed_in_m >= _TAKEN_IN * limits.take_in_m, Phase.HOLD),
    ),
    Phase.HOLD: (
        (_drogue_left, Phase.BREAKAWAY),
        (lambda limits, s: s.in_phase_s >= limits.hold_s, Phase.DISCONNECT),
    ),
    Phase.DISCONNECT: ((lambda limits, s: s.ring_ahead_m >= limits.clear_m, Phase.CLEAR),),
    Phase.BREAKAWAY: (
        (lambda limits, s: s.ring_ahead_m >= limits.clear_m or s.in_phase_s >= limits.breakaway_s, Phase.CLEAR),
    ),
    Phase.CLEAR: (),
}


def next_phase(phase: Phase, limits: PhaseLimits, situation: Situation) -> Phase:
    """Return the phase that follows; the same one when no condition of the table holds."""
    for condition, successor in TRANSITIONS[phase]:
        if condition(limits, situation):
            return successor
    return phase
