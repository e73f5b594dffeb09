"""What the command line shows to people: tables on stdout, progress on stderr."""

import os
import shlex
import sys
from collections.abc import Mapping, Sequence
from contextlib import AbstractContextManager
from pathlib import Path
from types import TracebackType
from typing import TYPE_CHECKING, Any, Self

import numpy as np
from rich.console import Console
from rich.measure import Measurement
from rich.progress import BarColumn, Progress, TaskProgressColumn, TextColumn, TimeElapsedColumn
from rich.table import Table
from rich.text import Text

from dockair.scenarios.display import has_display
from dockair.scenarios.judgement.no_attempt import cause_and_ending, ending

if TYPE_CHECKING:  # the progress of a flight is told in these; importing them here would slow `--help` down
    from dockair.messages import NavSolution
    from dockair.scenarios.bench.run import BenchReport
    from dockair.scenarios.doctor import Check
    from dockair.sim.truth import Truth

_PLAIN_INTERVAL_S = 5.0  # of simulated time between two lines where stderr is no terminal
_BAR_INTERVAL_S = 0.1
_FILE_WIDTH = 140  # of tables where stdout is no terminal
_WIDEST = 1000  # characters that a table may ask for

#: Key of `result.json` (dotted) -> what people call it, unit, decimals.
_FIGURES = {
    "contact.time_s": ("contact after", "s", 2),
    "contact.radial_offset_m": ("off the basket's centre", "m", 3),
    "contact.closure_speed_m_s": ("closing speed", "m/s", 2),
    "contact.angle_deg": ("probe against drogue axis", "deg", 1),
    "hold.duration_s": ("held for", "s", 1),
    "hold.take_in_max_m": ("hose taken in", "m", 2),
    "fuel_kg": ("fuel taken on", "kg", 0),
    "nav.range_rmse_m": ("navigation, range error (RMS)", "m", 4),
    "nav.lateral_rmse_m": ("navigation, lateral error (RMS)", "m", 4),
    "nav.availability": ("navigation, valid", "of the time", 3),
    "frames": ("camera frames", "", 0),
    "wall_time_s": ("wall time", "s", 1),
    "real_time_factor": ("simulated time per wall time", "", 2),
}


class FlightProgress:
    """Shows simulated time, phase and how far the ring is from the tip: a bar on a terminal, else a line now and then.

    Args:
        duration_s: the longest the flight may take.
        console: where to; stderr by default.
    """

    def __init__(self, duration_s: float, console: Console | None = None) -> None:
        self._console = console or Console(stderr=True, highlight=False, emoji=False)
        self._duration_s, self._next_s = duration_s, 0.0
        self._bar = Progress(
            TextColumn("{task.description:<12}", markup=False),
            BarColumn(),
            TaskProgressColumn("{task.completed:5.1f} of {task.total:.0f} s"),
            TextColumn("distance to drogue {task.fields[distance_m]:6.2f} m"),
            TimeElapsedColumn(),
            console=self._console,
            transient=True,
        )
        self._task = self._bar.add_task("building", total=duration_s, distance_m=float("nan"))

    def __enter__(self) -> Self:
        if self._console.is_terminal:
            self._bar.start()
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, at: TracebackType | None) -> None:
        if self._console.is_terminal:
            self._bar.stop()

    def __call__(self, truth: "Truth", solution: "NavSolution") -> None:
        """Take note of one control tick."""
        if truth.time_s < self._next_s:
            return
        distance_m = float(np.linalg.norm(truth.p_PD_B))
        if self._console.is_terminal:
            self._next_s = truth.time_s + _BAR_INTERVAL_S
            self._bar.update(self._task, completed=truth.time_s, description=solution.phase, distance_m=distance_m)
        else:
            self._next_s = truth.time_s + _PLAIN_INTERVAL_S
            line = f"{truth.time_s:6.1f} s  {solution.phase:<12} distance to drogue {distance_m:6.2f} m"
            self._console.print(line, markup=False)


def show_result(result: Mapping[str, Any], folder: Path) -> None:
    """Print a flight's outcome, figures and files.

    Args:
        result: as in `result.json`.
        folder: where the flight was written.
    """
    console = plain_console()
    colour = "green" if result["outcome"] == "contact" else "yellow"
    mark = "  (perfect navigation: the truth in place of the camera)" if result.get("truth_navigation") else ""
    flown = f"  {result['scenario']}, seed {result['seed']}{mark}"
    console.print(Text.assemble((result["outcome"], f"bold {colour}"), flown), soft_wrap=True)
    for attempt in result.get("attempt_log", ()):
        if attempt["cause"]:
            console.print(_failed_attempt(attempt), style="yellow", soft_wrap=True)
    if result.get("attempts") == 0:
        console.print(_no_attempt(result), style="yellow", soft_wrap=True)
    table = Table(show_header=False, box=None, padding=(0, 1))
    table.add_column()
    table.add_column(justify="right")
    table.add_column()
    for key, (label, unit, decimals) in _FIGURES.items():
        value = _at(result, key)
        if value is not None:
            table.add_row(label, f"{value:.{decimals}f}", unit)
    console.print(table)
    shortfalls = result.get("shortfalls")
    if shortfalls is not None:
        console.print("; ".join(shortfalls) or "as the scenario claims", style="yellow" if shortfalls else "green")
    for path in sorted(folder.iterdir()):
        console.print(Text.assemble(f"  {path}  ", (_size(path.stat().st_size), "dim")), soft_wrap=True)
    if (folder / "episode.rrd").exists():
        console.print(f"look at it{_how_to_look(folder / 'episode.rrd')}", soft_wrap=True)


def _how_to_look(recording: Path) -> str:
    viewer = [os.path.relpath(Path(sys.executable).parent / "rerun"), "--bind", "127.0.0.1"]
    if has_display():
        return f": {shlex.join([*viewer, str(recording)])}"
    return f" in a browser, there is no display here: {shlex.join([*viewer, '--serve-web', str(recording)])}"


def _failed_attempt(attempt: Mapping[str, Any]) -> str:
    offset_m, reason = attempt["radial_offset_m"], attempt["reason"]
    off = "" if offset_m is None else f", {offset_m:.2f} m off"
    why = f" ({reason})" if reason else ""
    return f"attempt {attempt['number']}: {attempt['outcome'].replace('_', ' ')}{off}{why}; cause: {attempt['cause']}"


def _no_attempt(result: Mapping[str, Any]) -> str:
    why = cause_and_ending(result["cause"], ending(result["timeline"], result["outcome"]))
    return f"no attempt after {result['duration_s']:.1f} s; {why}"


def _size(count: int) -> str:
    """Return a number of bytes in kB, from 0.1 MB on in MB."""
    return f"{count / 1e6:.1f} MB" if count >= 100_000 else f"{count / 1e3:.1f} kB"


def show_checks(checks: Sequence["Check"], versions: Mapping[str, str]) -> None:
    """Print what the doctor found."""
    console = plain_console()
    table = Table(show_header=False, box=None, padding=(0, 1))
    for check in checks:
        said = ("ok", "green") if check.ok else ("missing", "red") if check.needed else ("note", "yellow")
        word = Text(said[0], style=said[1])
        table.add_row(word, check.name, check.found if check.ok else f"{check.found}; {check.remedy}")
    console.print(table)
    console.print(", ".join(f"{name} {version}" for name, version in versions.items()), style="dim")


def show_bench(report: "BenchReport") -> None:
    """Print where a flight's time goes."""
    figures = report.to_json()
    console = plain_console()
    console.print(
        f"{figures['frames_per_second']:.1f} frames per second, {figures['real_time_factor']:.2f} of real time"
    )
    table = Table(box=None, padding=(0, 1))
    for heading in ("part", "share", "ms a call"):
        table.add_column(heading, justify="left" if heading == "part" else "right")
    for part, share in figures["share"].items():
        milliseconds = figures["milliseconds_per_call"].get(part)
        table.add_row(part, f"{share:.1%}", "" if milliseconds is None else f"{milliseconds:.3f}")
    console.print(table)


def show_working(text: str) -> AbstractContextManager[Any]:
    """Show on stderr that something goes on, where it is a terminal."""
    return Console(stderr=True, highlight=False, emoji=False).status(text)


def show_reproductions(titles: Mapping[str, str]) -> None:
    """Print what can be reproduced."""
    table = Table(box=None, padding=(0, 1))
    for heading in ("id", "what it shows"):
        table.add_column(heading)
    for name, title in titles.items():
        table.add_row(name, title)
    plain_console().print(table)


def show_reproduction(reproduction: Mapping[str, Any], picture: Path) -> None:
    """Print ours beside the reference's, one line a figure, and where the picture is."""
    console = plain_console()
    console.print(Text.assemble((reproduction["id"], "bold"), f"  {reproduction['source']}"), soft_wrap=True)
    table = Table(box=None, padding=(0, 1))
    for heading in ("case", "figure", "ours", "reference"):
        table.add_column(heading, justify="right" if heading in ("ours", "reference") else "left")
    for row in reproduction["rows"]:
        for figure, ours in row["ours"].items():
            table.add_row(row["case"], figure, _figure(ours), _figure(row["reference"].get(figure)))
    console.print(table)
    console.print(f"  {picture}", soft_wrap=True)


def _figure(value: Any) -> str:
    if value is None:
        return ""
    if isinstance(value, float):
        return f"{value:.6g}"
    if isinstance(value, (list, tuple)):
        return ", ".join(_figure(entry) for entry in value)
    return str(value)


def show_stages_bench(figures: Mapping[str, Any]) -> None:
    """Print the times of the stages, their ratios, and what each of them found."""
    console = plain_console()
    if "flights" in figures:
        _print_rows(console, figures["flights"], ".2f")
        _print_rows(console, {what: {"steps/s": n} for what, n in figures["steps_per_second"].items()}, ".1f")
    for unit, short in (("milliseconds", "ms"), ("microseconds", "µs")):
        if unit in figures:
            _print_rows(console, {what: {short: time} for what, time in figures[unit].items()}, ".3f")
    for what, ratio in figures["ratios"].items():
        console.print(f"{what}: {ratio:.2f}")
    if "recall" in figures:
        _print_rows(console, figures["recall"])
    if "found_by_frame" in figures:
        names = {name: f"({k})" for k, name in enumerate(figures["recall"], 1)}
        console.print("LEDs found by " + ", ".join(f"{number} {name}" for name, number in names.items()))
        by_frame = figures["found_by_frame"].items()
        _print_rows(console, {frame: {names.get(key, key): n for key, n in row.items()} for frame, row in by_frame})
    for what, choice in figures.get("chosen", {}).items():
        console.print(f"{what}: best of its parameters: {choice}")


def _print_rows(console: Console, rows: Mapping[str, Mapping[str, Any]], decimals: str = "") -> None:
    """Print row -> column -> value as a table."""
    table = Table(box=None, padding=(0, 1))
    table.add_column("what")
    for heading in next(iter(rows.values())):
        table.add_column(heading, justify="right")
    for what, row in rows.items():
        table.add_row(what, *(format(value, decimals) for value in row.values()))
    print_whole(console, table)


def plain_console() -> Console:
    """Return stdout without markup: paths and what others say are printed as they are, brackets too.

    Where it is no terminal, lines are as long as the tables: nothing is cut off in a file.
    """
    console = Console(highlight=False, markup=False, emoji=False)
    if not console.is_terminal:
        console.width = _FILE_WIDTH
    return console


def print_whole(console: Console, table: Table) -> None:
    """Print a table as wide as it is: a narrow terminal wraps its lines, where rich would cut or fold the cells."""
    whole_width = Measurement.get(console, console.options.update_width(_WIDEST), table).maximum
    console.width = max(console.width, whole_width)
    console.print(table)


def _at(table: Mapping[str, Any], key: str) -> Any:
    value: Any = table
    for name in key.split("."):
        value = value.get(name) if isinstance(value, Mapping) else None
    return value
