"""The phases of a docking and what leads from one to the next: the table of docs/guidance.md, in code.

Phases and limits as in service practice: pre-contact 3-5 m behind the drogue, closing at 1.0-1.5 m/s and never over
2.6 m/s (5 kt), breakaway on a lost track, on too much speed, far off the drogue's axis close to it, beside the basket.
"""

from collections.abc import Callable
from dataclasses import dataclass, fields
from enum import Enum

from dockair.errors import DockairError, check_numbers


class Phase(Enum):
    """What the receiver is doing."""

    JOIN_UP = "join_up"
    PRE_CONTACT = "pre_contact"
    APPROACH = "approach"
    CONTACT = "contact"
    HOLD = "hold"
    DISCONNECT = "disconnect"
    BACK_OFF = "back_off"
    BREAKAWAY = "breakaway"
    CLEAR = "clear"


BEFORE_CONTACT = (Phase.JOIN_UP, Phase.PRE_CONTACT, Phase.APPROACH)
ON_THE_PROBE = (Phase.CONTACT, Phase.HOLD)  #: pushed in, and held
TOUCHING = (*ON_THE_PROBE, Phase.DISCONNECT)
GOING_BACK = (Phase.DISCONNECT, Phase.BACK_OFF, Phase.BREAKAWAY)

RED_LIGHT = "red light"  #: the reason to go back from a hose that is dead
REFUELLED = "refuelled"  #: the reason to end a hold in which the light has been green for long enough


@dataclass(frozen=True, slots=True, kw_only=True)
class PhaseLimits:
    """When one phase gives way to the next. Defaults: service procedures, or assumed where marked."""

    attempts_max: int = 3  # assumed: what a patient tanker grants
    slot_s: float = float("inf")  # after this no approach is begun; the tanker's time is not one's own
    stabilise_s: float = 3.0  # assumed: a period of the drogue's swing
    station_m: float = 0.5  # assumed: astern, that is near enough to the stand-off point
    steady_along_m: float = 0.35  # assumed: twice the way that moderate gusts push receiver and drogue apart
    steady_sigma_m: float = 0.05  # assumed: a third of the 0.15 m that a contact may be off
    capture_radius_m: float = 0.12  # assumed: of the following; less than the 0.15 m that a contact may be off
    patience_s: float = 120.0  # assumed: some swings' worth of gusts; who has waited so long for a calm moment ...
    late_radius: float = 1.6  # ... closes within so many times that radius and that swing, which grow on the way there
    waiting_s: float = 120.0  # assumed: gusts that pass by have passed; a retry would wait as long
    inside_s: float = 1.0  # assumed: the way from the ring to the coupling takes 0.2 s
    coupling_reached_m: float = 0.05  # assumed: the coupling takes the tip within 0.03 m, the range errs by 0.02 m
    come_along_m: float = 0.2  # assumed: a drogue farther ahead of the tip than this, or behind it, is not held by it
    frames_stop_s: float = 0.1  # assumed: camera out; the belief of a drogue that is pushed runs off by 0.2 m in 0.17 s
    #: A hose is slack on which the drogue's mean axis (`slack_hose`) has dropped by this much since contact, ...
    slack_drop_rad: float = 0.070  # 4 degrees: of 148 taut hoses 3.1 at most, of 188 slack ones 4.8 at least
    slack_tilt_rad: float = 0.140  # ... or has turned by this to any side; 8 degrees: of those taut ones 3.8 at most
    slack_from_s: float = 0.20  # ... looked at from so long after contact, when its blow is over, ...
    slack_over_s: float = 0.08  # ... for so long at least, ...
    slack_to_s: float = 0.5  # ... until then: half of the time that it takes to be torn off
    slack_before_s: float = 1.0  # and before contact over so long: a third of a swing
    slack_far_rad: float = 0.28  # 16 degrees: turned by more than this later, ...
    slack_far_s: float = 0.12  # ... for so long, it is slack, too
    take_in_m: float = 2.5  # inside the refuelling range 0.5-6 m (KDC-10 procedures), 1.5 m from where fuel flows here
    taken_in: float = 0.9  # of that way when holding begins: the receiver comes to rest on the remaining tenth
    hold_s: float = 5.0  # under a green light; assumed: long enough to see that the drogue stays on the probe
    #: By how much more, as reckoned, it is pushed in under an amber light than at the farthest where it was green, or
    #: than `take_in_m`: the reckoning errs by 1.1 m over a hold; behind a dead reel no hose is ever taken up.
    push_on_m: float = 1.0
    no_fuel_s: float = 10.0  # assumed: without a green light a hold ends; pushing on by `push_on_m` takes 3 s
    clear_m: float = 3.0  # procedures: pre-contact is 3-5 m behind the drogue
    lost_s: float = 0.5  # breakaway practice: track lost for 0.5 s ...
    lost_range_m: float = 2.0  # ... within 2 m of the ring
    lost_for_good_s: float = 20.0  # assumed: what is not in view again after falling back so long will not be found
    off_axis_m: float = 1.0  # breakaway practice: 1 m off ...
    off_axis_range_m: float = 1.0  # ... within 1 m
    rim_m: float = 0.25  # radius of the ring: a tip that came past its plane farther out is beside the basket, and so
    # is one in contact with the coupling farther off its line
    clear_range_m: float = 0.6  # assumed: who is not committed and comes nearer than this ...
    beside_m: float = 0.6  # ... outside the rim keeps so far from the axis: rim, probe and what a gust may do
    recall_m: float = 0.4  # assumed: who is committed and nearer the ring than this goes on before a red light, too
    closure_limit_m_s: float = 2.6  # 5 kt, service limit
    breakaway_s: float = 10.0  # assumed: backing off at 1 m/s clears any attempt in this time

    def __post_init__(self) -> None:
        where = "guidance.limits"
        counted = "slack_from_s", "slack_over_s", "slack_to_s", "slack_before_s", "slack_far_s"  # in ticks
        flown = "take_in_m", "beside_m", "late_radius"  # reckoned with, not only compared
        never = [limit.name for limit in fields(self) if limit.name not in (*counted, *flown)]  # others may be infinite
        check_numbers(where, self, zero=("stabilise_s", "take_in_m", "hold_s", "push_on_m"), infinite=never)
        told_s = self.slack_from_s + self.slack_over_s
        if not told_s <= self.slack_to_s:
            expected = f"slack_from_s + slack_over_s = {told_s:g} at least"
            raise DockairError(f"{where}.slack_to_s", expected=expected, got=self.slack_to_s)
        if not self.late_radius >= 1.0:
            raise DockairError(f"{where}.late_radius", expected="a number from 1 on", got=self.late_radius)
        if not self.taken_in <= 1.0:
            raise DockairError(f"{where}.taken_in", expected="a number above 0, 1 at most", got=self.taken_in)


@dataclass(frozen=True, slots=True, kw_only=True)
class Situation:
    """What the transitions look at, from the navigation's own estimate."""

    time_s: float  #: since the guidance began
    in_phase_s: float  #: since the phase began
    steady_s: float  #: time for which the receiver has been steady astern of the drogue, but for moments of not knowing
    unsure_s: float  #: time for which it has not known the drogue's place well
    spread_m: float  #: root mean square of the error across over the last swing
    radius_m: float  #: what that may be, after so much waiting
    waiting_s: float  #: time for which the approach has stood still for want of a good moment
    inside_s: float  #: time for which the tip has been past the ring's plane
    came_out: bool  #: it was in this approach, and is before it again
    unusable_s: float  #: time for which the relative state has been unusable, from the start on
    track_lost_s: float  #: the same, or since the newest frame that was used, whichever is longer
    blind_s: float  #: time for which it has been unusable beyond that for which it has been usable
    doubtful_s: float  #: time for which the integrity monitor has not claimed that contact may be flown
    station_m: float  #: probe's tip from the stand-off point
    ahead_m: float  #: coupling ahead of the probe's tip
    beside_m: float  #: the same off the probe's line
    ring_ahead_m: float  #: ring centre ahead of the probe's tip
    lateral_m: float  #: ring centre off the probe's line
    entered_m: float  #: the same where the tip came past the ring's plane, 0 before it
    frame_age_s: float  #: since the newest frame, whatever it showed
    frames_stopped: bool  #: for longer than `frames_stop_s`, and none that has come since was used
    closing_m_s: float  #: rate at which `ring_ahead_m` shrinks
    committed: bool  #: too near to be called back, but by a red light
    pushed_in_m: float  #: way flown toward the tanker since the coupling was reached
    attempts: int  #: approaches begun
    light_is_red: bool = False  #: of the pod: the hose is dead
    green_s: float = 0.0  #: time for which it has been green in this hold
    no_fuel_s: float = 0.0  #: time for which it has not been, now
    hose_is_slack: bool = False  #: nothing takes it up since contact (`slack_hose`)
    hose_has_whipped: bool = False  #: a drogue has come off the probe as from a hose that nothing takes up


_Condition = Callable[[PhaseLimits, Situation], bool]


def _is_close(limits: PhaseLimits, s: Situation) -> bool:
    """Within the range by what is believed; also where that runs away from a receiver that is committed, or is NaN."""
    return s.committed or not s.ring_ahead_m >= limits.lost_range_m


def _lost(limits: PhaseLimits, s: Situation) -> bool:
    return s.track_lost_s > limits.lost_s and _is_close(limits, s)


def _doubtful(limits: PhaseLimits, s: Situation) -> bool:
    return s.doubtful_s > limits.lost_s and _is_close(limits, s)


def _off_axis(limits: PhaseLimits, s: Situation) -> bool:
    return s.lateral_m > limits.off_axis_m and s.ring_ahead_m < limits.off_axis_range_m


def _is_recalled(limits: PhaseLimits, s: Situation) -> bool:
    """By a red light: too late not to come to the ring at all is not too late to meet it slowly, or not."""
    return s.light_is_red and (not s.committed or s.ring_ahead_m > limits.recall_m)


def _beside(limits: PhaseLimits, s: Situation) -> bool:
    """Past the plane inside the rim is in the basket, whatever a belief says that the blow on it has unsettled.

    A tip that has come out of it again over the rim is beside it, too.
    """
    return s.entered_m > limits.rim_m or (s.came_out and s.lateral_m > limits.rim_m)


def is_off_the_probe(limits: PhaseLimits, ahead_m: float, beside_m: float) -> bool:
    """Whether a coupling so far ahead of the tip, and beside the probe's line, is elsewhere than at the tip."""
    return abs(ahead_m) > limits.come_along_m or beside_m > limits.rim_m


def is_reached(limits: PhaseLimits, ahead_m: float, beside_m: float) -> bool:
    """Whether the tip has come to it; a receiver that was called back may, too."""
    return ahead_m <= limits.coupling_reached_m and not is_off_the_probe(limits, ahead_m, beside_m)


def _left(limits: PhaseLimits, s: Situation) -> bool:
    """Off the probe, or lost. That the probe pushes it only frames tell; without them the belief passes through it."""
    return (is_off_the_probe(limits, s.ahead_m, s.beside_m) and not s.frames_stopped) or s.track_lost_s > limits.lost_s


def _far_enough(limits: PhaseLimits, s: Situation) -> bool:
    """Seen clear, or not for long; never with the drogue on the probe, where nobody may wait astern of it."""
    seen_clear = s.unusable_s == 0.0 and s.ring_ahead_m >= limits.clear_m and s.closing_m_s <= 0.0
    about_it = s.unusable_s <= limits.lost_s and s.ring_ahead_m <= 0.0
    return seen_clear or (s.in_phase_s >= limits.breakaway_s and not about_it)


@dataclass(frozen=True, slots=True)
class Transition:
    """A row of the table: where to, when, and the condition in words."""

    to: Phase
    reason: str
    holds: _Condition


_TOO_FAST = Transition(Phase.BREAKAWAY, "closing too fast", lambda limits, s: s.closing_m_s > limits.closure_limit_m_s)
_AWAY = (
    Transition(Phase.CLEAR, "hose has whipped", lambda limits, s: _far_enough(limits, s) and s.hose_has_whipped),
    Transition(
        Phase.CLEAR,
        "no attempts left",
        lambda limits, s: _far_enough(limits, s) and s.attempts >= limits.attempts_max,
    ),
    Transition(Phase.PRE_CONTACT, "far enough to try again", _far_enough),
)
_SLOT_OVER = Transition(Phase.CLEAR, "time slot over", lambda limits, s: s.time_s >= limits.slot_s)

_LOST_FOR_GOOD = Transition(Phase.CLEAR, "drogue lost", lambda limits, s: s.blind_s > limits.lost_for_good_s)

#: The first condition that holds decides.
TRANSITIONS: dict[Phase, tuple[Transition, ...]] = {
    Phase.JOIN_UP: (
        _SLOT_OVER,
        _LOST_FOR_GOOD,
        Transition(Phase.PRE_CONTACT, "at the stand-off point", lambda limits, s: s.station_m <= limits.station_m),
    ),
    Phase.PRE_CONTACT: (
        _SLOT_OVER,
        _LOST_FOR_GOOD,
        Transition(
            Phase.APPROACH,
            "steady",
            lambda limits, s: (
                s.steady_s > 0.0  # now, if for no longer
                and s.unsure_s == 0.0
                and s.steady_s >= limits.stabilise_s
                and s.spread_m <= s.radius_m
                and not s.light_is_red
            ),
        ),
    ),
    Phase.APPROACH: (
        _TOO_FAST,
        Transition(Phase.BREAKAWAY, "track lost", _lost),
        Transition(Phase.BREAKAWAY, "integrity lost", _doubtful),
        Transition(Phase.BREAKAWAY, "far off axis", _off_axis),
        Transition(Phase.BREAKAWAY, "beside the basket", _beside),
        _LOST_FOR_GOOD,
        Transition(Phase.BACK_OFF, RED_LIGHT, _is_recalled),
        Transition(Phase.BACK_OFF, "time slot over", lambda limits, s: s.time_s >= limits.slot_s and s.waiting_s > 0.0),
        Transition(Phase.BACK_OFF, "no good moment to close", lambda limits, s: s.waiting_s >= limits.waiting_s),
        Transition(Phase.BACK_OFF, "coupling not reached", lambda limits, s: s.inside_s >= limits.inside_s),
        Transition(Phase.CONTACT, "coupling reached", lambda limits, s: s.ahead_m <= limits.coupling_reached_m),
    ),
    Phase.CONTACT: (
        _TOO_FAST,
        Transition(Phase.BREAKAWAY, "beside the basket", _beside),
        Transition(Phase.BREAKAWAY, "hose is slack", lambda limits, s: s.hose_is_slack),
        Transition(Phase.BACK_OFF, RED_LIGHT, lambda limits, s: s.light_is_red),
        Transition(Phase.BACK_OFF, "drogue has not come along", _left),
        Transition(
            Phase.HOLD, "in the refuelling range", lambda limits, s: s.pushed_in_m >= limits.taken_in * limits.take_in_m
        ),
    ),
    Phase.HOLD: (
        Transition(Phase.BREAKAWAY, "hose is slack", lambda limits, s: s.hose_is_slack),
        Transition(Phase.BREAKAWAY, "drogue has left the probe", _left),
        Transition(Phase.DISCONNECT, RED_LIGHT, lambda limits, s: s.light_is_red),
        Transition(Phase.DISCONNECT, REFUELLED, lambda limits, s: s.green_s > 0.0 and s.green_s >= limits.hold_s),
        Transition(Phase.DISCONNECT, "no fuel", lambda limits, s: s.no_fuel_s >= limits.no_fuel_s),
    ),
    Phase.DISCONNECT: (Transition(Phase.CLEAR, "drogue well ahead", _far_enough),),
    Phase.BACK_OFF: _AWAY,
    Phase.BREAKAWAY: _AWAY,
    Phase.CLEAR: (),
}


def next_phase(phase: Phase, limits: PhaseLimits, situation: Situation) -> Transition | None:
    """Return the row of the table that applies now, None where the phase goes on."""
    for transition in TRANSITIONS[phase]:
        if transition.holds(limits, situation):
            return transition
    return None
