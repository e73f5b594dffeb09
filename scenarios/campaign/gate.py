"""Whether a campaign shows that a build has become worse, and how often it says so of one that has not.

A rate p is asked, K of n flights have succeeded. The test fails if so few are too unlikely under p,

    P(K <= k | n, p) < false_alarm / m                                               (1)

m being the number of such tests in the campaign: a build whose true rates are those asked, or better, fails one of them
with a probability below false_alarm in all (the union bound), whatever the flights of one seed have in common with
another scenario's. Within a test flights must be independent, so that no seed may occur twice there: its flights share
gusts and hardware. A flight that ends in an error is no success.

Unsafe flights and errors are counted, not tested: the bound says nothing of these limits.
"""

import math
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from typing import Any

from dockair.errors import DockairError
from dockair.scenarios.campaign.plan import Gate
from dockair.scenarios.report.groups import Group, counted, groups_of
from dockair.scenarios.statistics import largest_rejected_count, probability_of_at_most, trials_to_reject_none


@dataclass(frozen=True, slots=True, kw_only=True)
class RateTest:
    """One rate of one group of flights against what was asked, Eq. (1)."""

    group: str
    rate: str  #: which
    asked: float
    successes: int
    flights: int
    probability: float  #: of so few under the rate asked
    fails_up_to: int  #: successes at which it would fail; -1 for never: too few flights to say anything
    passed: bool


@dataclass(frozen=True, slots=True, kw_only=True)
class Verdict:
    """What the gate says."""

    passed: bool
    false_alarm: float  #: of all tests of rates together, at most
    tests: tuple[RateTest, ...]
    unsafe: int
    errors: int
    reasons: tuple[str, ...]  #: why not passed

    def to_dict(self) -> dict[str, Any]:
        """Return plain values for JSON."""
        return asdict(self)


def judge(gate: Gate, rows: Sequence[Mapping[str, Any]]) -> Verdict:
    """Return the verdict on a campaign's rows.

    Args:
        gate: what is asked.
        rows: of all its flights.
    """
    asked = _asked(gate, rows)
    tests = tuple(_test(group, name, rate, gate.false_alarm / len(asked)) for group, name, rate in asked)
    unsafe, errors = (sum(bool(row[name]) for row in rows) for name in ("unsafe", "error"))
    reasons = [
        f"{test.group}: {test.successes} of {test.flights}, {test.rate} asked {test.asked:g}, "
        f"so few have a probability of {test.probability:.2g}"
        for test in tests
        if not test.passed
    ]
    if unsafe > gate.unsafe_max:
        reasons.append(f"{counted(unsafe, 'unsafe flight')}, allowed {gate.unsafe_max}")
    if errors > gate.errors_max:
        reasons.append(f"{counted(errors, 'flight')} ended in an error, allowed {gate.errors_max}")
    return Verdict(
        passed=not reasons,
        false_alarm=gate.false_alarm,
        tests=tests,
        unsafe=unsafe,
        errors=errors,
        reasons=tuple(reasons),
    )


def require_power(gate: Gate, rows: Sequence[Mapping[str, Any]], where: str) -> None:
    """Refuse a gate that would pass a build that never docks, or one whose probability of a false alarm is not known.

    Args:
        gate: what is asked.
        rows: of a campaign in which nothing has docked.
        where: the gate's place, to be named.

    Raises:
        DockairError: too few flights for a rate, or a seed twice among those it is tested on.
    """
    asked = _asked(gate, rows)
    for group, name, _ in asked:
        _require_each_seed_once(group, f"{where}.{name}")
    false_alarm = gate.false_alarm / max(len(asked), 1)
    for group, name, rate in asked:
        test = _test(group, name, rate, false_alarm)
        if test.passed:
            needed = trials_to_reject_none(rate, false_alarm)
            enough = f"{needed:.0f} flights or more" if math.isfinite(needed) else "a higher rate"
            expected = f"{enough}, or another false_alarm: with fewer it never fails"
            raise DockairError(f"{where}.{name}", expected=expected, got=f"{test.flights} ({test.group})")


def _require_each_seed_once(group: Group, where: str) -> None:
    """Refuse flights that are not independent: Eq. (1) would fail a good build more often than it says."""
    seed, times = Counter(row["seed"] for row in group.rows).most_common(1)[0]
    if times > 1:
        expected = "every seed once among the flights of a test, for flights of one seed share gusts and hardware"
        raise DockairError(where, expected=expected, got=f"seed {seed} {times} times ({group.title})")


def _asked(gate: Gate, rows: Sequence[Mapping[str, Any]]) -> list[tuple[Group, str, float]]:
    """Return each group with each rate that is asked of it."""
    return [
        (group, name, rate)
        for group in groups_of(rows)
        for name in ("success_rate", "first_attempt_rate")
        if (rate := getattr(gate.rates_of(group.scenario), name)) is not None
    ]


def _test(group: Group, name: str, rate: float, false_alarm: float) -> RateTest:
    share = group.success if name == "success_rate" else group.first_attempt
    probability = probability_of_at_most(share.count, share.of, rate)
    return RateTest(
        group=group.title,
        rate=name,
        asked=rate,
        successes=share.count,
        flights=share.of,
        probability=probability,
        fails_up_to=largest_rejected_count(share.of, rate, false_alarm),
        passed=probability >= false_alarm,
    )
