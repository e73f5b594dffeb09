"""Flights that may be pooled: same scenario, same keys set over it, same sensing, same navigator, same controller.

A key that the plan draws differs from flight to flight of one group, which is apart from flights without that draw; of
any other key each value is a group of its own.
Perfect navigation, the measurement model and the camera never share a group: what one shows says nothing of the other
until both stand side by side (`pairs`).
"""

import json
import math
import re
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from hashlib import blake2b
from typing import Any

import numpy as np

from dockair.rotations import Array
from dockair.scenarios.accept import has_refuelled
from dockair.scenarios.campaign.points import runs_of
from dockair.scenarios.judgement.attempts import RefereeLimits
from dockair.scenarios.judgement.no_attempt import cause_and_ending, ending
from dockair.scenarios.report.settings import given_and_drawn, settings_of
from dockair.scenarios.statistics import wilson_interval
from dockair.scenarios.tables.crew import OUR_NAVIGATOR

Row = Mapping[str, Any]

CLOSING_BAND_M_S = (1.0, 1.5)  # service practice
GOOD_CONTACT = RefereeLimits()  # what a contact is asked for
SENSING_IN_WORDS = {"camera": "camera", "measurements": "measurement model", "truth": "perfect navigation"}
NOT_SAID = "not said"  # in place of a cause
_SPELT_OUT = 3  # keys that a plan draws: of more a title says how many
_NO_WORD = re.compile(r"[^\w.]+")


def counted(count: int, noun: str) -> str:
    """Return "1 flight", "2 flights"."""
    return f"{count} {noun}{'' if count == 1 else 's'}"


@dataclass(frozen=True, slots=True)
class Share:
    """So many of so many, with Wilson's 95 % interval."""

    count: int
    of: int

    @property
    def value(self) -> float:
        """The share itself; NaN of nothing."""
        return self.count / self.of if self.of else math.nan

    @property
    def interval(self) -> tuple[float, float]:
        """Lower and upper end."""
        return wilson_interval(self.count, self.of) if self.of else (math.nan, math.nan)

    @property
    def counted(self) -> str:
        """Count and share in words; a dash of nothing."""
        return f"{self.count}/{self.of} = {100 * self.value:.1f} %" if self.of else "–"

    @property
    def between(self) -> str:
        """The interval in words [%]; "" of nothing."""
        low, high = self.interval
        return f"({100 * low:.1f}–{100 * high:.1f})" if self.of else ""


@dataclass(frozen=True)
class Group:
    """Rows that may be pooled."""

    scenario: str
    sensing: str
    navigator: str
    controller: str
    settings: str  #: keys set over the scenario, by `conditions_of`, or "KEY drawn"; without those that have a column
    rows: tuple[Row, ...]

    @property
    def anchor(self) -> str:
        """Its id on the page: in words as far as a link takes them, and a digest of the whole."""
        whole = "-".join([self.scenario, self.sensing, self.controller, self.navigator, self.settings])
        return f"{_NO_WORD.sub('-', whole)[:80]}-{blake2b(whole.encode(), digest_size=4).hexdigest()}"

    @property
    def kind(self) -> dict[str, str]:
        """What its flights have in common, as tables name it."""
        names = ("scenario", "sensing", "navigator", "controller", "settings")
        return {name: getattr(self, name) for name in names}

    @property
    def own_navigator(self) -> str:
        """Name of a navigator that is neither Dockair's own nor the truth; "" of these two."""
        return "" if self.navigator in (OUR_NAVIGATOR, "truth") else self.navigator

    @property
    def title(self) -> str:
        """What it is, in words."""
        words = f"{self.name}: {SENSING_IN_WORDS.get(self.sensing, self.sensing)}, {self.controller} controller"
        return words + (f", navigator {self.own_navigator}" if self.own_navigator else "")

    @property
    def name(self) -> str:
        """The scenario, with what is set over it, in short."""
        return f"{self.scenario} with {self.settings_in_short}" if self.settings else self.scenario

    @property
    def settings_in_short(self) -> str:
        """`settings`, but how many keys are drawn where these are more than a title can hold."""
        given, drawn = given_and_drawn(self.rows[0])
        if len(drawn) <= _SPELT_OUT:
            return self.settings
        return ", ".join([*sorted(given), f"{len(drawn)} keys drawn"])

    @property
    def label(self) -> str:
        """What it is, short, for a picture's axis."""
        return f"{self.name} ({', '.join(filter(None, [self.sensing, self.controller, self.own_navigator]))})"

    @cached_property
    def seeds(self) -> int:
        """Number of different seeds."""
        return len({row["seed"] for row in self.rows})

    @property
    def independent(self) -> bool:
        """Whether no seed occurs twice; else intervals, which take flights for independent, are too narrow."""
        return self.seeds == len(self.rows)

    @property
    def flights_in_words(self) -> str:
        """How many flights, and of how many seeds where there are fewer."""
        return counted(len(self.rows), "flight") + ("" if self.independent else f" of {counted(self.seeds, 'seed')}")

    @property
    def seeds_in_words(self) -> str:
        """Which seeds, with runs of them as "first to last"."""
        runs = runs_of(sorted({int(row["seed"]) for row in self.rows}))
        return ", ".join(str(first) if first == last else f"{first} to {last}" for first, last in runs)

    @property
    def mark(self) -> str:
        """Stands behind an interval that is too narrow."""
        return "" if self.independent else " †"

    @cached_property
    def flown(self) -> list[Row]:
        """Rows without an error."""
        return [row for row in self.rows if not row["error"]]

    @cached_property
    def failed_to_fly(self) -> list[Row]:
        """Rows that say why there was no flight to the end."""
        return [row for row in self.rows if row["error"]]

    @property
    def first_attempt(self) -> Share:
        """Contact inside the limits at the first attempt; a flight that crashed is none."""
        return Share(sum(bool(row["first_attempt"]) for row in self.flown), len(self.rows))

    @property
    def success(self) -> Share:
        """Contact inside the limits at any attempt."""
        return Share(sum(bool(row["success"]) for row in self.flown), len(self.rows))

    @property
    def refuelled(self) -> Share:
        """Flights that held the probe in the coupling until they had refuelled."""
        return Share(sum(map(has_refuelled, self.rows)), len(self.rows))

    @property
    def rims_m(self) -> list[float]:
        """Radii of the rims of the drogues flown; none where the rows are from before they were told."""
        return sorted({radius for row in self.rows if (radius := row.get("rim_radius_m")) is not None})

    @cached_property
    def contacts(self) -> list[Row]:
        """Rows that ended in a contact."""
        return [row for row in self.flown if row["outcome"] == "contact"]

    @cached_property
    def offsets_m(self) -> Array:
        """Radial offsets at the ring's plane of the contacts."""
        return _numbers(self.contacts, "radial_offset_m")

    @cached_property
    def closing_m_s(self) -> Array:
        """Closing speeds of the contacts."""
        return _numbers(self.contacts, "closure_speed_m_s")

    @property
    def in_closing_band(self) -> Share:
        """Contacts at the closing speeds of service practice."""
        low, high = CLOSING_BAND_M_S
        return Share(int(((self.closing_m_s >= low) & (self.closing_m_s <= high)).sum()), len(self.contacts))

    @property
    def inside_capture_radius(self) -> Share:
        """Contacts within the distance from the basket's centre that a docking is asked for."""
        return Share(int((self.offsets_m <= GOOD_CONTACT.radial_offset_m).sum()), len(self.contacts))

    @property
    def outcomes(self) -> list[tuple[str, int]]:
        """How the flights ended, the most frequent first."""
        return Counter(str(row["outcome"]) for row in self.rows).most_common()

    @property
    def unsafe(self) -> list[Row]:
        """Flights in which anything was unsafe."""
        return [row for row in self.flown if row["unsafe"]]

    @cached_property
    def attempts(self) -> list[Mapping[str, Any]]:
        """Every attempt of every flight."""
        return [attempt for row in self.flown for attempt in json.loads(row["attempt_log"])]

    def within(self, count: int) -> Share:
        """Contact inside the limits within so many attempts; a flight may go on after it, if the drogue was lost."""
        good = sum(any(map(_is_good, json.loads(row["attempt_log"])[:count])) for row in self.flown)
        return Share(good, len(self.rows))

    @cached_property
    def causes(self) -> list[tuple[str, int]]:
        """Causes of the attempts that failed, a contact outside the limits among them; the most frequent first."""
        return _most_frequent(cause for row in self.flown for cause in causes_of(row))

    @cached_property
    def causes_without_attempt(self) -> list[tuple[str, int]]:
        """Causes of the flights that began no attempt, "error" of those that were not flown to their end."""
        return _most_frequent(cause for row in self.rows if (cause := cause_without_attempt(row)))

    @cached_property
    def endings_without_attempt(self) -> list[tuple[str, int]]:
        """The same flights by what their navigation said last, too: "never steady: time slot over in join up"."""
        return _most_frequent(name for row in self.rows if (name := ending_without_attempt(row)))

    @cached_property
    def by_range(self) -> list[dict[str, float]]:
        """Errors of the navigation in bins of range, pooled over the flights by their counts."""
        return _pooled([entry for row in self.flown for entry in json.loads(row.get("nav_by_range") or "[]")])


def groups_of(rows: Sequence[Row]) -> list[Group]:
    """Return the groups, by scenario and then by sensing."""
    kinds: dict[tuple[str, str, str, str, str], list[Row]] = {}
    for row in sorted(rows, key=lambda row: int(row["seed"])):
        crew = str(row["sensing"]), str(row["navigator"]), str(row["controller"])
        kinds.setdefault((str(row["scenario"]), *crew, settings_of(row)), []).append(row)
    return [Group(*kind, tuple(kinds[kind])) for kind in sorted(kinds)]


def _is_good(attempt: Mapping[str, Any]) -> bool:
    """Whether it ended in a contact inside the limits: one outside them has a cause."""
    return attempt["outcome"] == "contact" and not attempt["cause"]


def causes_of(row: Row) -> list[str]:
    """Return the cause of each attempt that failed, of a flight that was flown to its end."""
    failed = [] if row["error"] else [a for a in json.loads(row["attempt_log"]) if not _is_good(a)]
    return [attempt["cause"] or NOT_SAID for attempt in failed]


def cause_without_attempt(row: Row) -> str:
    """Return why a flight began no attempt, "error" of one that was not flown to its end; "" of one with attempts."""
    if row["error"]:
        return "error"
    return "" if row["attempts"] else row["cause"] or NOT_SAID


def ending_without_attempt(row: Row) -> str:
    """Return that cause with how the flight ended for its navigation, "error" without; "" of one with attempts."""
    cause = cause_without_attempt(row)
    if row["error"] or not cause:
        return cause
    return cause_and_ending(cause, ending(json.loads(row.get("timeline") or "[]"), row["outcome"]))


def _most_frequent(causes: Iterable[str]) -> list[tuple[str, int]]:
    """Return each cause with its number; of those as frequent the one that was met first."""
    return Counter(causes).most_common()


def _numbers(rows: Sequence[Row], name: str) -> Array:
    values = np.array([math.nan if row[name] is None else row[name] for row in rows], dtype=float)
    return np.asarray(values[np.isfinite(values)])


def _pooled(entries: Sequence[Mapping[str, Any]]) -> list[dict[str, float]]:
    """Return each bin with its frames; a figure is of those frames alone that have it, NaN where none has."""
    pooled = []
    for low, high in sorted({(entry["low_m"], entry["high_m"]) for entry in entries}):
        mine = [entry for entry in entries if (entry["low_m"], entry["high_m"]) == (low, high)]
        counts = np.array([entry["count"] for entry in mine], dtype=float)
        row = {"low_m": low, "high_m": high, "count": float(counts.sum())}
        for name in mine[0]:
            values = np.array([math.nan if e[name] is None else e[name] for e in mine], dtype=float)
            if name.endswith(("_rmse_m", "_rmse_deg", "_sigma_m", "_sigma_deg")):
                row[name] = math.sqrt(_mean(values**2, counts))
            elif name.endswith("_bias_m"):
                row[name] = _mean(values, counts)
        pooled.append(row)
    return pooled


def _mean(values: Array, counts: Array) -> float:
    """Return the mean of the values that there are, weighted; NaN of none."""
    there = np.isfinite(values) & (counts > 0)
    return float(np.average(values[there], weights=counts[there])) if there.any() else math.nan
