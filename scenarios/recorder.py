"""Everything that is kept of a flight, behind one object: the loop appends control ticks and asks for the result."""

import json
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from types import TracebackType
from typing import TYPE_CHECKING, Self

from dockair.errors import DockairError
from dockair.messages import LedObservation
from dockair.scenarios.flight_log import FlightLog
from dockair.scenarios.judgement.causes import flown_of
from dockair.scenarios.judgement.referee import Outcome
from dockair.scenarios.judgement.result import Result, held_to, summarise
from dockair.scenarios.message_log import MessageLog, read_messages
from dockair.scenarios.output_folder import FlightFolder, utf8_path_of
from dockair.scenarios.path_keys import SHEETS
from dockair.scenarios.scenario_file import text_from
from dockair.scenarios.scenario_hash import scenario_hash, sheet_paths
from dockair.scenarios.schema import Scenario

if TYPE_CHECKING:  # the loop imports this module
    from dockair.scenarios.loop import Flight, Tick

RECORD = ("full", "window", "none")
SCENARIO = "scenario.toml"  #: what was flown, every key of it, and the seed
AS_BUILT = "as_built.json"  #: how the hardware of the flight differed from its nominal sheets
_COPIES = {key: f"scenario_{key.partition('.')[2]}.toml" for key in SHEETS}  # key -> copy of a sheet of one's own


class Recorder:
    """Keeps a flight in memory, and its messages on disk while it goes on; use it in a `with` statement.

    Args:
        flight: that is about to begin.
        out: folder that takes the files; None keeps only what the result needs.
        record: "window" or "full" keep the frames as they were delivered, "none" keeps no messages.

    Raises:
        DockairError: `record` is none of these.
    """

    def __init__(self, flight: "Flight", out: str | Path | None, record: str) -> None:
        if record not in RECORD:
            raise DockairError("record", expected="what to keep of the frames", got=record, exists=RECORD)
        self._path = None if out is None else Path(out)
        self._log = FlightLog()
        self._messages: MessageLog | None = None
        self._folder = None if self._path is None else FlightFolder(self._path)
        if self._folder is not None:
            try:
                _copy_sheets(flight.scenario, self._folder.under_way)  # they may be edited meanwhile
                if record != "none" and flight.recipe is not None:
                    self._messages = MessageLog(self._folder.under_way, flight.recipe)
            except BaseException:
                self._folder.forget()
                raise

    def append(self, tick: "Tick") -> None:
        """Take one control tick."""
        self._log.append(tick.truth, tick.imu, tick.frame, tick.solution)
        if self._messages is not None:
            assert not isinstance(tick.frame, LedObservation), "a flight without frames has no recipe"
            self._messages.append(tick.imu, tick.frame, tick.solution, tick.announcement, tick.signal)

    def settle(self) -> None:
        """Write the messages that still wait; no more are taken."""
        if self._messages is not None:
            self._messages.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, traceback: TracebackType | None
    ) -> None:
        try:
            self.settle()
        finally:
            if self._folder is not None:
                self._folder.forget()

    def finish(self, flight: "Flight", outcome: Outcome, seed: int, wall_time_s: float) -> Result:
        """Return the result; with a folder, write all but the messages there.

        The messages have to be settled. Where one of the last two cannot be made, the folder keeps the flight without
        it, and what is raised says so in a note.

        Args:
            flight: that is over.
            outcome: of the referee.
            seed: that was flown.
            wall_time_s: that the flight took, without what is written here.
        """
        log = self._log
        result = summarise(
            scenario=flight.scenario.name,
            seed=seed,
            outcome=outcome.value,
            referee=flight.referee,
            flown=flown_of(flight.scenario, flight.sheets.mounting, log.truths, log.solutions),
            frames=log.frames,
            mounting=flight.sheets.mounting,
            sensing=flight.scenario.sensing,
            background="" if flight.camera is None else flight.camera.background,
            wall_time_s=wall_time_s,
            out_dir=self._path,
        )
        result = held_to(flight.scenario.accept, result)
        if self._folder is not None:
            self._write(flight, result, self._folder.under_way)
            self._folder.keep()
        return result

    def _write(self, flight: "Flight", result: Result, folder: Path) -> None:
        from dockair.scenarios.picture.flight import picture_of_flight
        from dockair.scenarios.recording.episode import write_episode
        from dockair.sim.shapes import shapes_of

        result.write(folder)
        flown = flight.scenario.model_dump(mode="json", exclude_none=True) | {"seed": result.seed}
        # a path need not be text, and nobody loses a flight by that
        (folder / SCENARIO).write_text(text_from(flown, _COPIES), encoding="utf-8", errors="surrogateescape")
        (folder / AS_BUILT).write_text(json.dumps(flight.as_built.record(), indent=1) + "\n", encoding="utf-8")
        self._log.write_parquet(folder)
        with self._kept_without("episode.rrd"), utf8_path_of(folder) as place:  # Rerun takes no other
            write_episode(
                place,
                self._log,
                flight.sheets,
                name=f"{result.scenario}-{result.seed}-{scenario_hash(flight.scenario)}",
                shapes=shapes_of(flight.world.model),
                messages=read_messages(folder, pixels=False) if self._messages is not None else (),
                summary=summary_of(result),
            )
        with self._kept_without("flight.png"):
            picture_of_flight(folder, flight.referee.limits)

    @contextmanager
    def _kept_without(self, name: str) -> Iterator[None]:
        """Write a file that is only made to be looked at: where it fails, the flight is kept all the same."""
        assert self._folder is not None
        try:
            yield
        except Exception as error:
            (self._folder.under_way / name).unlink(missing_ok=True)  # half of it
            self._folder.keep()
            error.add_note(f"{self._path} holds the flight, without {name}")
            raise


def _copy_sheets(scenario: Scenario, folder: Path) -> None:
    """Copy the sheets that a scenario names: `scenario.toml` names the copies, and can be moved with them."""
    for key, path in sheet_paths(scenario).items():
        (folder / _COPIES[key]).write_bytes(Path(path).read_bytes())


def summary_of(result: Result) -> str:
    """Return a result as a Markdown table."""
    rows: list[tuple[str, object]] = [("seed", result.seed), ("attempts", result.attempts)]
    if result.truth_navigation:
        rows.append(("navigation", "perfect: the truth in place of the camera"))
    if result.contact is not None:
        contact = result.contact
        rows += [
            ("contact after", f"{contact.time_s:.2f} s"),
            ("off the basket's centre", f"{contact.radial_offset_m:.3f} m"),
            ("closing speed", f"{contact.closure_speed_m_s:.2f} m/s"),
            ("probe against drogue axis", f"{contact.angle_deg:.1f} deg"),
        ]
    if result.hold is not None:
        rows += [("held for", f"{result.hold.duration_s:.1f} s"), ("taken in", f"{result.hold.take_in_max_m:.2f} m")]
    if result.nav.frames_used:
        rows += [
            ("range error (RMS)", f"{1e3 * result.nav.range_rmse_m:.1f} mm"),
            ("lateral error (RMS)", f"{1e3 * result.nav.lateral_rmse_m:.1f} mm"),
            ("mean NEES (of 9)", f"{result.nav.nees_mean:.1f}"),
            ("frames used", f"{result.nav.frames_used} of {result.frames}"),
        ]
    lines = [f"# {result.outcome.replace('_', ' ')}", "", f"{result.scenario}", "", "| | |", "|---|---|"]
    return "\n".join(lines + [f"| {label} | {value} |" for label, value in rows])
