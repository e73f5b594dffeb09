"""Why an attempt did not end in a good contact: one cause by stated rules, from the truth beside what was believed.

Where the attempt was decided (the tip in the ring's plane, or its closest approach; of one called off, where in its
last second the ring was farthest off) the ring is off the probe's line by m, body axes across. With d as the navigation
believed it and s the place at which the ring would have been, had it gone on for the response time tau as it moved
before, at that velocity and acceleration,

    m = (m - d) + (m - s) + rest,        share = part . m / |m|                                            (1)

the first part was hidden by the navigation, the second could not be foreseen, and what is left was known in time and
not flown. The largest share names the cause. Rules, the first that holds:

| cause            | when                                                                                             |
|------------------|--------------------------------------------------------------------------------------------------|
| diverged         | the simulation broke down during the attempt                                                     |
| departed         | the receiver departed from controlled flight before the attempt ended                            |
| out_of_time      | the flight's time ran out during the attempt                                                     |
| collision        | the coupling held the probe in the attempt, and then the receiver struck something; of a flight  |
|                  | without any attempt, see below                                                                   |
| detection        | the solution was not valid for half of the last second                                           |
| integrity        | it was valid, and marked as not to be flown into contact for half of the last second             |
| outside_limits   | the attempt's offset (drogue axes, in the ring's plane) was a good contact's and the tip held,   |
|                  | too fast or at too wide an angle                                                                 |
| not_held         | the same, and it was not held                                                                    |
| called_off       | the navigation went back although the ring was no farther off the probe's line than a good       |
|                  | contact may be, for all of that second                                                           |
| ambiguity        | share of navigation the largest, and the believed attitude was the mirrored one, about the line  |
|                  | from the camera, or rolled by more than half an LED's spacing for half of the last second        |
| navigation_error | share of navigation the largest, otherwise                                                       |
| gust             | share of what could not be foreseen the largest                                                  |
| bow_wave         | the rest the largest, the miss points away from the nose, and the air at the drogue blew that    |
|                  | way by more than twice what it varied by before                                                  |
| control_limit    | the rest the largest, otherwise: the receiver could not follow, or was not told to               |
| fault            | instead of one of these, when a fault that can bring it about acted before the attempt was       |
|                  | decided, or ended if it was called off                                                           |

How far off a good contact may be is asked of the flight whatever drogue it meets: a wider ring leads no farther tip to
the coupling, for its ribs stand flatter (docs/models/coupling.md).

A flight without any attempt has the cause diverged if the simulation broke down, collision if the receiver struck
something (fault, if any had acted by then: any can bring it about), detection if the solution was valid for less than
half of its last half, else never_steady. A flight in which an attempt failed or none began, and whose receiver departed
at any time, has the cause departed.

Not modelled: causes that act together; the one named is the largest, not the only one.
"""

from collections.abc import Collection, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from dockair.calibration import Mounting
from dockair.messages import NavSolution
from dockair.parameters import load_parameters
from dockair.rotations import Array
from dockair.scenarios.judgement.attempts import Attempt, AttemptOutcome, RefereeLimits, is_good_contact
from dockair.scenarios.judgement.departure import Departure
from dockair.scenarios.judgement.referee import Outcome
from dockair.scenarios.schema import Scenario
from dockair.sim.air.bow_wave import BowWaveParameters
from dockair.sim.faults import DeadReel, Fault
from dockair.sim.truth import Truth

#: Causes that faults of LEDs, camera and IMU can bring about, and those of the reel.
_OF_SENSORS = ("detection", "integrity", "ambiguity", "navigation_error", "called_off", "never_steady")
_OF_REEL = ("gust", "bow_wave", "control_limit", "outside_limits", "not_held", "collision", "never_steady")
_CALLED_OFF = (AttemptOutcome.GIVEN_UP.value, AttemptOutcome.BREAKAWAY.value)
_RED_LIGHT = "red light"  # the navigation's reason, of the table of phases

CAUSES = (
    "diverged", "departed", "out_of_time", "collision", "detection", "integrity", "outside_limits", "not_held",
    "called_off", "ambiguity", "navigation_error", "gust", "bow_wave", "control_limit", "fault", "never_steady",
)  # fmt: skip


@dataclass(frozen=True, slots=True, kw_only=True)
class CauseRules:
    """Numbers in the rules."""

    look_back_s: float = 1.0  # the last second: a metre and a bit of approach
    for_half: float = 0.5  # part of it; 0.5 s without a track is what makes a receiver break away
    response_s: float = 0.3  # tau: 0.25 s of the receiver's answer and the age of a frame
    difference_s: float = 0.05  # over which the drogue's acceleration is taken; short beside its swing of 3 s
    told_apart_rad: float = 0.07  # attitudes nearer to their mirror image than 4 degrees are not told apart
    leds: int = 8  # on the ring: a numbering that is off by one is rolled by 1/8 of a turn
    away_cosine: float = 0.7071  # within 45 degrees of "away from the nose"
    blown: float = 2.0  # times the air's own variation; more than 1 in 20 gusts of a second reach
    limits: RefereeLimits = field(default_factory=RefereeLimits)  # of a good contact


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Flown:
    """A flight as the causes see it."""

    truths: Sequence[Truth]  #: one a control tick
    solutions: Sequence[NavSolution]  #: likewise
    p_PN_B: Array  #: (3,) tip of the nose from the probe's tip, body axes [m]
    p_CP_B: Array  #: (3,) the probe's tip from the camera, body axes [m]
    faults: Collection[Fault] = ()
    departed_s: float = field(init=False)  #: when the receiver departed from controlled flight; infinite if it did not

    def __post_init__(self) -> None:
        departure = Departure()
        for truth in self.truths:
            departure.watch(truth)
        object.__setattr__(self, "departed_s", np.inf if departure.time_s is None else departure.time_s)

    @property
    def step_s(self) -> float:
        """Of control."""
        return self.truths[1].time_s - self.truths[0].time_s if len(self.truths) > 1 else np.inf

    def tick_at(self, time_s: float) -> int:
        """Last control tick not after a time."""
        if len(self.truths) < 2:
            return 0
        k = int((time_s - self.truths[0].time_s) / self.step_s + 1e-6)
        return min(max(k, 0), len(self.truths) - 1)


def flown_of(
    scenario: Scenario, mounting: Mounting, truths: Sequence[Truth], solutions: Sequence[NavSolution]
) -> Flown:
    """Return a flight as the causes see it.

    Args:
        scenario: that was flown.
        mounting: of probe and camera.
        truths: one a control tick.
        solutions: likewise.
    """
    name = scenario.hardware.receiver_sheet("bow_wave")
    sheet = load_parameters(name, BowWaveParameters, scenario.parameters.get(name))
    nose = np.array([-sheet.nose_behind_tip_m, -mounting.p_BP[1], sheet.nose_height_m - mounting.p_BP[2]])
    faults = [table.fault for table in scenario.faults]
    if scenario.navigation.is_truth:  # it has no sensors that could fail
        faults = [fault for fault in faults if isinstance(fault, DeadReel)]
    return Flown(
        truths=truths, solutions=solutions, p_PN_B=nose, p_CP_B=mounting.p_BP - mounting.p_BC, faults=faults
    )  # fmt: skip


def with_cause(attempt: Attempt, flown: Flown, rules: CauseRules | None = None) -> Attempt:
    """Return the attempt with its cause; without one if it ended in a good contact."""
    rules = rules or CauseRules()
    if is_good_contact(attempt, rules.limits):
        return attempt
    if attempt.reason == _RED_LIGHT:
        return replace(attempt, cause="fault")
    cause = _cause(attempt, flown, rules)
    until_s = attempt.ended_s if attempt.outcome in _CALLED_OFF else attempt.decided_s
    if cause == "collision":
        until_s = flown.truths[-1].time_s  # what ends a hold comes later
    return replace(attempt, cause=_or_fault(cause, attempt.begun_s, until_s, flown))


def cause_of_flight(attempts: Sequence[Attempt], flown: Flown, outcome: str, rules: CauseRules | None = None) -> str:
    """Return the cause of the last attempt that failed; "" if none did, and what kept the receiver back if none began.

    Args:
        attempts: with their causes.
        flown: the flight.
        outcome: of the flight, by the referee.
        rules: their numbers.
    """
    last = next((attempt.cause for attempt in reversed(attempts) if attempt.cause), "")
    if attempts and last in ("", "diverged"):
        return last
    if not attempts and outcome == Outcome.DIVERGED.value:
        return "diverged"
    if np.isfinite(flown.departed_s):
        return "departed"
    if attempts:
        return last
    end_s = flown.truths[-1].time_s
    if outcome == Outcome.COLLISION.value:  # blind, or by a hose that whips: any fault can have brought it about
        return "fault" if any(_acted(fault, 0.0, end_s) for fault in flown.faults) else "collision"
    half = flown.solutions[len(flown.solutions) // 2 :]
    seen = np.mean([solution.valid for solution in half]) >= (rules or CauseRules()).for_half
    return _or_fault("never_steady" if seen else "detection", 0.0, end_s, flown)


def _or_fault(cause: str, since_s: float, until_s: float, flown: Flown) -> str:
    for fault in flown.faults:
        if _acted(fault, since_s, until_s) and cause in (_OF_REEL if isinstance(fault, DeadReel) else _OF_SENSORS):
            return "fault"
    return cause


def _acted(fault: Fault, since_s: float, until_s: float) -> bool:
    return fault.start_s <= until_s and fault.stop_s > since_s


def _cause(attempt: Attempt, flown: Flown, rules: CauseRules) -> str:
    if attempt.outcome == AttemptOutcome.DIVERGED.value:
        return "diverged"
    if flown.departed_s <= attempt.ended_s:
        return "departed"
    if attempt.outcome == AttemptOutcome.TIMEOUT.value:
        return "out_of_time"
    if attempt.outcome == AttemptOutcome.COLLISION.value and _was_held(attempt, flown):
        return "collision"
    called_off = attempt.outcome in _CALLED_OFF
    k = flown.tick_at(attempt.ended_s if called_off else attempt.decided_s)
    last = range(max(k + 1 - _ticks(rules.look_back_s, flown), 0), k + 1)
    if np.mean([flown.solutions[i].valid for i in last]) <= rules.for_half:
        return "detection"
    if np.mean([flown.solutions[i].contact_usable for i in last]) <= rules.for_half:
        return "integrity"
    if called_off:
        k = max(last, key=lambda i: float(np.linalg.norm(flown.truths[i].p_PD_B[1:])))
    miss = flown.truths[k].p_PD_B[1:]
    # the offset is that which decides on a good contact: across the body it is less by the cosine of the angle
    offset_m = float(np.linalg.norm(miss)) if called_off else attempt.radial_offset_m
    if offset_m <= rules.limits.radial_offset_m:
        if attempt.outcome == AttemptOutcome.CONTACT.value:
            return "outside_limits"
        return "called_off" if called_off else "not_held"
    return _largest_share(k, miss, flown, rules)


def _was_held(attempt: Attempt, flown: Flown) -> bool:
    """Whether the coupling held the probe since a collision's attempt began: the flight ends with the collision."""
    return any(truth.latched for truth in flown.truths[flown.tick_at(attempt.begun_s) :])


def _largest_share(k: int, miss: Array, flown: Flown, rules: CauseRules) -> str:
    """Cause by Eq. (1)."""
    along = miss / np.linalg.norm(miss)
    hidden = float((miss - flown.solutions[k].p_PD_B[1:]) @ along)
    unforeseen = float(unforeseen_motion(k, flown, rules) @ along)
    rest = float(np.linalg.norm(miss)) - hidden - unforeseen
    if hidden >= max(unforeseen, rest):
        return "ambiguity" if _mistaken(k, flown, rules) else "navigation_error"
    if unforeseen >= rest:
        return "gust"
    return "bow_wave" if _blown_away(k, along, flown, rules) else "control_limit"


def unforeseen_motion(k: int, flown: Flown, rules: CauseRules) -> Array:
    """(2,) drogue beyond where velocity and acceleration a response time before had it go, body axes across [m]."""
    before = max(k - _ticks(rules.response_s, flown), 0)
    earlier = max(before - _ticks(rules.difference_s, flown), 0)
    if earlier == before:
        return np.zeros(2)
    now, then, first = flown.truths[k], flown.truths[before], flown.truths[earlier]
    tau = now.time_s - then.time_s
    acceleration_W = (then.v_WD - first.v_WD) / (then.time_s - first.time_s)
    foreseen_W = then.p_WD + then.v_WD * tau + 0.5 * acceleration_W * tau**2
    return np.asarray((now.R_WB.T @ (now.p_WD - foreseen_W))[1:])


def _mistaken(k: int, flown: Flown, rules: CauseRules) -> bool:
    """Whether the believed attitude was the ring's other one, or its numbering another, for half of the last second."""
    span = range(max(k + 1 - _ticks(rules.look_back_s, flown), 0), k + 1)
    wrong = [_other_attitude(flown.truths[i], flown.solutions[i], flown.p_CP_B, rules) for i in span]
    return bool(np.mean(wrong) >= rules.for_half)


def _other_attitude(truth: Truth, solution: NavSolution, p_CP_B: Array, rules: CauseRules) -> bool:
    R_true, R, p_CD_B = truth.R_WB.T @ truth.R_WD, solution.R_BD, p_CP_B + truth.p_PD_B
    sight = p_CD_B / np.linalg.norm(p_CD_B)
    axis, believed = R_true[:, 0], R[:, 0]
    mirrored = 2.0 * (axis @ sight) * sight - axis
    if _angle(axis, mirrored) > rules.told_apart_rad and _angle(believed, mirrored) < _angle(believed, axis):
        return True
    turn = R_true.T @ R
    roll = np.arctan2(turn[2, 1] - turn[1, 2], turn[1, 1] + turn[2, 2])
    return bool(abs(roll) > np.pi / rules.leds)


def _blown_away(k: int, along: Array, flown: Flown, rules: CauseRules) -> bool:
    """Whether the miss points away from the nose, and the air at the drogue has come to blow that way."""
    away = (flown.truths[k].p_PD_B - flown.p_PN_B)[1:]
    if along @ away < rules.away_cosine * np.linalg.norm(away):
        return False
    count = _ticks(rules.look_back_s, flown)
    begin = max(k + 1 - 3 * count, 0)
    wind = np.array([(t.R_WB.T @ t.gust_D_m_s)[1:] @ along for t in flown.truths[begin : k + 1]])
    before, last = wind[:-count], wind[-count:]
    return len(before) > 1 and bool(np.mean(last) - np.mean(before) > rules.blown * np.std(before))


def _ticks(time_s: float, flown: Flown) -> int:
    return max(round(time_s / flown.step_s), 1)


def _angle(a: Array, b: Array) -> float:
    return float(np.arccos(np.clip(a @ b, -1.0, 1.0)))
