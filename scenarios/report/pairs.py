"""Two groups side by side on the same flights: same scenario, seed and world, flown by two crews.

A crew is what sees and flies: keys `navigation.*`, `guidance.*` and `camera.sensing`. Only flights on which one of two
crews docked say which is better: if both were as good, each of these would be either's by the toss of a coin, and the
sign test [statistics, eq 4] says how often chance alone divides them as unevenly.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np

from dockair.scenarios.report.groups import Group, Row
from dockair.scenarios.report.settings import conditions_of, key_of
from dockair.scenarios.statistics import sign_test

_SEES = ("navigation.navigator", "camera.sensing")  # keys that say what the navigation sees, and nothing of the world
_CREW = ("navigation.", "guidance.", "camera.sensing")  # keys of a crew begin so


@dataclass(frozen=True, slots=True, kw_only=True)
class Paired:
    """First attempts of two groups on the flights that both have flown."""

    flights: int
    seeds: int  #: different ones among them
    ours: int  #: successes
    theirs: int
    only_ours: int  #: flights at which only ours succeeded
    only_theirs: int

    @property
    def ratio(self) -> float:
        """Successes of ours over theirs; NaN without any of theirs."""
        return self.ours / self.theirs if self.theirs else math.nan

    @property
    def by_chance(self) -> float:
        """How often two crews that are as good would differ as much, were the flights independent."""
        return sign_test(self.only_ours, self.only_theirs)


def beside_perfect_navigation(group: Group, groups: Sequence[Group]) -> Paired | None:
    """Return the comparison with perfect navigation under the same guidance, None where it has flown none of these."""
    for other in groups:
        if other.sensing == "truth" != group.sensing and _docks_alike(other, group):
            pair = paired(group, other, apart=_SEES)
            if pair is not None:
                return pair
    return None


def side_by_side(groups: Sequence[Group]) -> list[tuple[Group, Group, Paired]]:
    """Return every two groups of a scenario with flights in common, but those beside perfect navigation."""
    alike = [
        (a, b) for a, b in combinations(groups, 2)
        if a.scenario == b.scenario and (a.sensing == "truth") == (b.sensing == "truth")
    ]  # fmt: skip
    found = ((a, b, paired(a, b, apart=_CREW)) for a, b in alike)
    return [(a, b, pair) for a, b, pair in found if pair is not None]


def paired(ours: Group, theirs: Group, apart: tuple[str, ...]) -> Paired | None:
    """Compare first attempts on common flights, None without any; an error is a flight that has not docked.

    A flight that one of both has twice under the same conditions (a key of its crew was drawn, a file has changed
    meanwhile) is in no pair.

    Args:
        ours: a group.
        theirs: another.
        apart: how the keys begin in which flights that are the same may differ.
    """
    mine, others = (_by_conditions(group.rows, apart) for group in (ours, theirs))
    both = [c for c in mine if len(mine[c]) == len(others.get(c, ())) == 1]
    if not both:
        return None
    a, b = np.array([(_docked_at_once(mine[c][0]), _docked_at_once(others[c][0])) for c in both]).T
    return Paired(
        flights=len(both), seeds=len({mine[c][0]["seed"] for c in both}),
        ours=int(a.sum()), theirs=int(b.sum()),
        only_ours=int((a & ~b).sum()), only_theirs=int((~a & b).sum()),
    )  # fmt: skip


def _docks_alike(a: Group, b: Group) -> bool:
    return (a.scenario, a.controller, a.settings) == (b.scenario, b.controller, b.settings)


def _docked_at_once(row: Row) -> bool:
    """Whether the first attempt succeeded; a flight that ended in an error is none."""
    return bool(row["first_attempt"]) and not row["error"]


def _by_conditions(rows: Sequence[Row], apart: tuple[str, ...]) -> dict[tuple[str, ...], list[Row]]:
    """Return the rows by what else decides the flight: seed, values set and drawn; a name has one content."""
    found: dict[tuple[str, ...], list[Row]] = {}
    for row in rows:
        settings = [text for text in conditions_of(row) if not key_of(text).startswith(apart)]
        found.setdefault((str(row["seed"]), *sorted(settings)), []).append(row)
    return found
