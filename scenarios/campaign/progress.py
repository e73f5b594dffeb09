"""What people see of a campaign: how much is done, how fast, how often it docked so far; then a table."""

import time
from collections.abc import Mapping, Sequence
from types import TracebackType
from typing import Any, Self

from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn
from rich.table import Column, Table
from rich.text import Text

from dockair.scenarios.campaign.jobs import Job
from dockair.scenarios.campaign.row import flight_of, unflown
from dockair.scenarios.commands.output import plain_console, print_whole
from dockair.scenarios.report.groups import counted, groups_of
from dockair.scenarios.statistics import wilson_interval
from dockair.scenarios.tables.crew import OUR_NAVIGATOR, Guidance

_LINE_INTERVAL_S = 30.0  # between two lines where stderr is no terminal
_BAR = 20  # characters: the figures beside it fit on a terminal of 80
_USUAL = {"controller": Guidance().controller, "navigator": OUR_NAVIGATOR}  # who flies where a plan says nothing of it
_CELL = 48  # characters of settings that a table's cell can hold
_TOO_NARROW = (
    "\N{DAGGER} a seed occurs twice: its flights share gusts and hardware, so that the intervals are too narrow"
)

Row = Mapping[str, Any]


class CampaignProgress:
    """Bars on a terminal, one for each group of flights that may be pooled; else a line every half minute.

    Args:
        console: where to; stderr by default.
    """

    def __init__(self, console: Console | None = None) -> None:
        self._console = console or Console(stderr=True, highlight=False, emoji=False)
        columns = (
            TextColumn("{task.description}", markup=False, table_column=Column(no_wrap=False)),  # a long name gives way
            BarColumn(bar_width=_BAR),
            MofNCompleteColumn(),
            TextColumn("{task.fields[said]}", markup=False),
        )
        self._bars = Progress(*columns, console=self._console, transient=True)
        self._labels: dict[tuple[str, int], str] = {}  # scenario's hash and seed -> group
        self._tasks: dict[str, Any] = {}
        self._counts: dict[str, list[int]] = {}  # successes, done
        self._total = self._earlier = self._now = self._errors = 0
        self._begun_s = self._next_s = time.monotonic()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, at: TracebackType | None) -> None:
        if self._console.is_terminal:
            self._bars.stop()
        done = self._earlier + self._now
        if kind is KeyboardInterrupt:
            self._say(f"{done} of {self._total} flights are done and kept; the same command goes on")

    def begin(self, jobs: list[Job], entries: dict[str, Any]) -> "CampaignProgress":
        """Take the jobs, and the journal's entries of those that are not flown again."""
        self._total = len(jobs)
        for group in groups_of([unflown(job) for job in jobs]):
            self._labels |= dict.fromkeys(map(flight_of, group.rows), group.label)
            self._counts[group.label] = [0, 0]
            self._tasks[group.label] = self._bars.add_task(group.label, total=len(group.rows), said="")
        for job in jobs:
            if job.key in entries:
                self._earlier += 1
                self._count(entries[job.key]["row"])
        if self._earlier:
            self._say(f"{self._earlier} of {self._total} flights were done before")
        self._overall = self._bars.add_task("all", total=self._total, completed=self._earlier, said="")
        if self._console.is_terminal:
            self._bars.start()
        self._begun_s = time.monotonic()
        self._next_s = self._begun_s + _LINE_INTERVAL_S
        return self

    def __call__(self, row: Row | None, wall_time_s: float) -> None:
        """Take note of a flight that is done, or of the time."""
        if row is not None:
            self._now += 1
            self._count(row)
            if row["error"]:
                self._say(f"{row['scenario']}, seed {row['seed']}: {row['error']}")
        said = self._pace()
        self._bars.update(self._overall, completed=self._earlier + self._now, said=said)
        if not self._console.is_terminal and time.monotonic() >= self._next_s:
            self._next_s = time.monotonic() + _LINE_INTERVAL_S
            done = self._earlier + self._now
            self._say("; ".join(filter(None, (f"{done} of {self._total} flights, {said}", self._rates()))))

    def _say(self, text: str) -> None:
        self._console.print(text, markup=False, soft_wrap=True)  # an error may say anything, brackets too

    def _count(self, row: Row) -> None:
        label = self._labels[flight_of(row)]
        counts = self._counts[label]
        counts[0] += bool(row["success"])
        counts[1] += 1
        self._errors += bool(row["error"])
        self._bars.update(self._tasks[label], completed=counts[1], said=docked(*counts))

    def _pace(self) -> str:
        elapsed_s = time.monotonic() - self._begun_s
        if not self._now:
            return "none done yet"
        left_s = (self._total - self._earlier - self._now) * elapsed_s / self._now
        errors = f", {counted(self._errors, 'error')}" if self._errors else ""
        return f"{60.0 * self._now / elapsed_s:.1f} a minute, {_in_words(left_s)} left{errors}"

    def _rates(self) -> str:
        return "; ".join(f"{label} {docked(*counts)}" for label, counts in self._counts.items() if counts[1])


def docked(successes: int, flights: int) -> str:
    """Return "9 of 10 docked (60-98 %)", the interval being Wilson's."""
    low, high = wilson_interval(successes, flights)
    return f"{successes} of {flights} docked ({100 * low:.0f}-{100 * high:.0f} %)"


def show_campaign(table: Mapping[str, Any]) -> None:
    """Print what `dockair campaign --json` would."""
    console = plain_console()
    shown = Table(box=None, padding=(0, 1))
    shares = {"first attempt": "first_attempt", "success": "success", "refuelled": "refuelled"}
    for heading in ("scenario", "sensing", *shares, "offset", "closing", "unsafe", "errors"):
        shown.add_column(heading, no_wrap=True)
    crew = _crew_columns(table["groups"])
    for name in crew:
        shown.add_column(name)
    cells, whole = _settings_cells(table["groups"])
    if not all(group["independent"] for group in table["groups"]):
        whole.append(f"  {_TOO_NARROW}")
    if any(cells):
        shown.add_column("set")
    for group, cell in zip(table["groups"], cells, strict=True):
        offset, speed = group["radial_offset_m"], group["closure_speed_m_s"]
        shown.add_row(
            *(group["scenario"], group["sensing"]),
            *(_share(group[name], group) for name in shares.values()),
            f"{offset['median']:.3f} m" if offset else "",
            f"{speed['min']:.2f}-{speed['max']:.2f} m/s" if speed else "",
            *(str(group[name]) for name in ("unsafe", "errors")),
            *(group[name] for name in crew),
            *((Text(cell),) if any(cells) else ()),  # a list's brackets are no markup
        )
    _print(console, shown, whole)
    for group in table["groups"]:
        for shortfall in group["shortfalls"] or ():
            where = f"{group['scenario']} ({group['sensing']}, {group['controller']})"
            console.print(f"not as claimed: {where}: {shortfall}", style="yellow", soft_wrap=True)
    _show_gate(console, table["gate"])
    console.print(f"  {table['folder']}", soft_wrap=True)


def _crew_columns(groups: Sequence[Mapping[str, Any]]) -> list[str]:
    """Return what of a crew is unusual, or differs from group to group; perfect navigation stands under sensing."""
    crews = {name: {group[name] for group in groups} - {"truth"} for name in _USUAL}
    return [name for name, found in crews.items() if len(found) > 1 or not found <= {_USUAL[name]}]


def _settings_cells(groups: Sequence[Mapping[str, Any]]) -> tuple[list[str], list[str]]:
    """Return the cell of each group's settings, "(1)" in place of long ones, and those in full, to stand below."""
    long = list(dict.fromkeys(group["settings"] for group in groups if len(group["settings"]) > _CELL))
    numbers = {text: f"({number})" for number, text in enumerate(long, start=1)}
    cells = [numbers.get(group["settings"], group["settings"]) for group in groups]
    return cells, [f"  {number} {text}" for text, number in numbers.items()]


def _print(console: Console, shown: Table, below: Sequence[str]) -> None:
    print_whole(console, shown)
    for text in below:
        console.print(text, markup=False, highlight=False, soft_wrap=True)


def show_dry_run(planned: Mapping[str, Any]) -> None:
    """Print what `dockair campaign --dry-run --json` would, but for the commands."""
    console, shown = plain_console(), Table(box=None, padding=(0, 1))
    crew = _crew_columns(planned["groups"])
    for heading in ("scenario", "sensing", *crew, "flights", "done", "set"):
        shown.add_column(heading, no_wrap=True)
    cells, whole = _settings_cells(planned["groups"])
    for group, cell in zip(planned["groups"], cells, strict=True):
        counts = str(group["flights"]), str(group["done"] or "")
        flown_by = (group[name] for name in crew)
        shown.add_row(group["scenario"], group["sensing"], *flown_by, *counts, Text(cell))
    _print(console, shown, whole)
    left = planned["flights"] - planned["done"]
    console.print(f"  {left} of {planned['flights']} flights would be flown; {planned['folder']}", soft_wrap=True)


def _show_gate(console: Console, gate: Mapping[str, Any] | None) -> None:
    if gate is None:
        return
    if gate["passed"]:
        console.print("gate passed", style="green")
    for reason in gate["reasons"]:
        console.print(f"gate failed: {reason}", style="red", soft_wrap=True)


def _share(share: Mapping[str, Any], group: Mapping[str, Any]) -> str:
    mark = "" if group["independent"] else " \N{DAGGER}"
    return f"{share['count']}/{group['flights']} ({100 * share['low']:.0f}-{100 * share['high']:.0f} %){mark}"


def _in_words(seconds: float) -> str:
    minutes, seconds = divmod(round(seconds), 60)
    hours, minutes = divmod(minutes, 60)
    return f"{hours} h {minutes} min" if hours else f"{minutes} min {seconds} s" if minutes else f"{seconds} s"
