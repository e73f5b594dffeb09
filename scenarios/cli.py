"""The command line, `dockair`: flights, campaigns of flights, what they are judged by and compared with.

Exit status: 0 done as asked, whatever the flight's outcome; 1 a replay that was not identical, or a campaign whose gate
has failed; 2 bad input; 3 the machine lacks something; 130 stopped. With `--json` one object goes to stdout and nothing
else; progress and errors go to stderr. Modules that are slow to import are imported by the command that needs them.
"""

import errno
import json
import os
import sys
from dataclasses import asdict
from enum import Enum
from itertools import pairwise
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

import dockair
from dockair.errors import DockairError
from dockair.scenarios.commands.allan import allan
from dockair.scenarios.commands.campaign import campaign
from dockair.scenarios.commands.design_ring import design_ring
from dockair.scenarios.commands.options import Json, ScenarioName, Seed, Settings, overrides, print_json, stdout_kept
from dockair.scenarios.commands.report import report
from dockair.scenarios.std_streams import outlive_readers
from dockair.scenarios.whole_file import NO_ROOM

if TYPE_CHECKING:
    from dockair.scenarios.schema import Scenario

#: Of an OSError, where a path is to blame that somebody has given.
_NO_FILE = (errno.EACCES, errno.EPERM, errno.EISDIR, errno.ENOTDIR, errno.ENAMETOOLONG)

app = typer.Typer(
    name="dockair",
    help="Autonomous aerial refuelling by vision: simulated, closed-loop.",
    epilog=(
        "Exit status: 0 done as asked, whatever a flight's outcome; 1 a replay that differs, or a campaign whose gate "
        "has failed; 2 wrong input; 3 the machine lacks something; 130 stopped."
    ),
    add_completion=False,
    pretty_exceptions_enable=False,
)


class Record(Enum):
    """Which pixels of the camera are kept."""

    FULL = "full"
    WINDOW = "window"
    NONE = "none"


@app.callback(invoke_without_command=True)
def root(
    context: typer.Context,
    version: Annotated[bool, typer.Option("--version", help="Print the version and exit.")] = False,
) -> None:
    """Autonomous aerial refuelling by vision: simulated, closed-loop."""
    if version:
        print(dockair.__version__)
        raise typer.Exit
    if context.invoked_subcommand is None:
        print(context.get_help())
        raise typer.Exit


@app.command()
def fly(
    scenario: ScenarioName = "default",
    seed: Seed = None,
    settings: Settings = None,
    out: Annotated[Path | None, typer.Option(help="Folder to write to; out/<scenario>-<seed> by default.")] = None,
    record: Annotated[
        Record, typer.Option(help="Frames to keep: full (the whole sensor), window (as navigated on) or none.")
    ] = Record.WINDOW,
    as_json: Json = False,
) -> None:
    """Fly a scenario and write its result, logs, recording and picture to a folder (docs/results.md)."""
    from dockair.scenarios.commands.output import FlightProgress, show_result
    from dockair.scenarios.output_folder import check_output_folder, default_output_folder
    from dockair.scenarios.schema import load_scenario

    chosen = load_scenario(scenario, overrides(settings))
    seed = chosen.seed if seed is None else seed
    _require_background(chosen)
    folder = out or default_output_folder(chosen.name, seed)
    check_output_folder(folder)
    from dockair.scenarios.loop import fly as fly_scenario

    with stdout_kept(as_json), FlightProgress(chosen.flight.duration_s) as progress:
        result = fly_scenario(chosen, seed, folder, record=record.value, progress=progress, overlap=True)
    if as_json:
        print_json(result.to_dict())
    else:
        show_result(result.to_dict(), folder)


@app.command()
def scenarios(
    name: Annotated[
        str | None,
        typer.Argument(
            metavar="NAME",
            help="What to show whole; without, the list. With --keys a part of names, sheets' too.",
        ),
    ] = None,
    keys: Annotated[bool, typer.Option("--keys", help="Show the keys that a scenario may set, and --set.")] = False,
    as_json: Json = False,
) -> None:
    """List the library's scenarios, what each is there to show and what it is held to; show one whole, or all keys."""
    from dockair.scenarios.commands import library_output
    from dockair.scenarios.commands.keys import scenario_keys
    from dockair.scenarios.scenario_file import scenario_names
    from dockair.scenarios.schema import load_scenario

    if keys:
        found = scenario_keys(name or "")
        if as_json:
            print_json({"keys": [asdict(key) for key in found]})
        else:
            library_output.show_keys(found)
        return
    if name is not None:
        from dockair.scenarios.assembly.buildable import require_buildable

        chosen = load_scenario(name)
        require_buildable(chosen)  # what its own sheets hold, and its navigator: shown is what can be flown
        if as_json:
            print_json(chosen.model_dump(mode="json"))
        else:
            library_output.show_scenario(name, chosen)
        return
    library = [load_scenario(name) for name in scenario_names()]
    if as_json:
        print_json({"scenarios": [scenario.model_dump(mode="json") for scenario in library]})
    else:
        library_output.show_scenarios(library)


@app.command()
def replay(
    out: Annotated[Path, typer.Argument(metavar="OUT", help="Folder of a recorded flight.")],
    as_json: Json = False,
) -> None:
    """Feed a flight's recorded frames and IMU to the navigation, without a simulator; compare every bit."""
    from dockair.scenarios.replay import replay as replay_flight

    if not os.path.isdir(out):  # Path.is_dir raises where a name is too long, until Python 3.14
        raise DockairError(str(out), expected="the folder of a recorded flight", got="no such folder")
    report = replay_flight(out)
    if as_json:
        print_json(json.loads(report.to_json()))
    else:
        print(report)
    if not report.identical:
        raise typer.Exit(1)


@app.command()
def reproduce(
    wanted: Annotated[str | None, typer.Argument(metavar="ID", help="What to reproduce; without, the list.")] = None,
    out: Annotated[Path | None, typer.Option(help="Folder for the picture; out/reproduce by default.")] = None,
    as_json: Json = False,
) -> None:
    """Reproduce a published figure or table: ours beside the source's, and a picture."""
    from dockair.scenarios.commands.output import show_reproduction, show_reproductions, show_working
    from dockair.scenarios.reproduce import registry
    from dockair.scenarios.reproduce.reference import picture_name

    if wanted is None:
        if as_json:
            print_json({"ids": registry.ids()})
        else:
            show_reproductions(registry.titles())
        return
    folder = out or Path("out") / "reproduce"
    with show_working(f"reproducing {wanted}"):
        table = registry.reproduce(wanted, folder)
    if as_json:
        print_json(table)
    else:
        show_reproduction(table, folder / picture_name(wanted))


class BenchSubject(Enum):
    """What `bench` measures."""

    FLIGHT = "flight"
    LOOP = "loop"
    SENSORS = "sensors"
    IMAGE = "image"
    POSE = "pose"
    WORLD = "world"


@app.command()
def bench(
    scenario: ScenarioName = "default",
    settings: Settings = None,
    seconds: Annotated[float, typer.Option(min=1.0, max=600.0, help="Simulated time at most.")] = 20.0,
    subject: Annotated[BenchSubject, typer.Option("--of", help="A flight, the loop in all its ways, or one part.")] = (
        BenchSubject.FLIGHT
    ),
    as_json: Json = False,
) -> None:
    """Say how fast the closed loop runs here and where its time goes; or how fast the stages of one part are.

    The loop's ways: windowed, recorded, with full frames, at 180 Hz, two at once
    and others, the fastest of five flights each: minutes.

    The parts: the sensors; image stages and pose solvers, beside OpenCV's; the
    world, beside a bare step of MuJoCo. Only flight and sensors depend on the
    scenario.
    """
    from dockair.scenarios.bench.run import bench as bench_scenario
    from dockair.scenarios.bench.run import bench_stages
    from dockair.scenarios.commands.output import show_bench, show_stages_bench, show_working
    from dockair.scenarios.schema import load_scenario

    chosen = load_scenario(scenario, overrides(settings))
    if subject is not BenchSubject.FLIGHT:
        with stdout_kept(as_json), show_working(f"measuring: {subject.value}"):
            figures = bench_stages(subject.value, chosen)
        if as_json:
            print_json(figures)
        else:
            show_stages_bench(figures)
        return
    _require_background(chosen)
    with stdout_kept(as_json):
        report = bench_scenario(chosen, seconds)
    if as_json:
        print_json(report.to_json())
    else:
        show_bench(report)


app.command("design-ring")(design_ring)
app.command()(allan)
app.command()(campaign)
app.command()(report)


@app.command()
def doctor(as_json: Json = False) -> None:
    """Check the machine: Python, links, off-screen OpenGL, cores, memory, disk, packages."""
    from dockair.scenarios.commands.output import show_checks
    from dockair.scenarios.doctor import examine, is_fit, package_versions, to_json

    checks = examine(Path("out"))
    if as_json:
        print_json(to_json(checks))
    else:
        show_checks(checks, package_versions())
    if not is_fit(checks):
        raise typer.Exit(3)


def _require_background(scenario: "Scenario") -> None:
    """Refuse a flight whose camera cannot be drawn here; say so when it will be drawn without OpenGL.

    Raises:
        MachineError: the scenario asks for MuJoCo's drawing, and there is no off-screen OpenGL.
    """
    from dockair.scenarios.doctor import require_rendering
    from dockair.sim.opengl import available_backend, why_analytic

    if scenario.navigation.is_truth:
        return
    if scenario.camera.background == "mujoco":
        require_rendering()
    elif scenario.camera.background == "auto" and available_backend() == "analytic":
        print(f"dockair: no OpenGL here ({why_analytic()}): the camera's background is analytic", file=sys.stderr)


def _working_folder() -> str:
    """Return the folder that one stands in.

    Raises:
        DockairError: it has been removed.
    """
    try:
        return str(Path.cwd())
    except OSError as error:
        raise DockairError("working folder", expected="one that is there", got=error.strerror) from None


def _got(error: typer.TyperException, said: str, words: list[str]) -> str:
    """Return what was given to the option that an error is about, as the end of its line, unless it says so itself."""
    names = getattr(getattr(error, "param", None), "opts", ())
    for word, after in reversed(list(pairwise([*words, ""]))):  # of several the last counts
        name, equals, value = word.partition("=")
        if name in names and name.startswith("-"):
            got = value if equals else after
            return "" if repr(got) in said else f", got {got!r}"
    return ""


def _noted(said: str, error: BaseException) -> str:
    """Return the line that is said of an error, with its notes: what is kept of a flight in spite of it."""
    return "; ".join([said, *getattr(error, "__notes__", ())])


def main() -> None:
    """Run a command; what a person did wrong ends in one line on stderr, not in a traceback."""
    outlive_readers()
    if os.environ.get("MPLBACKEND", "").startswith("module://"):  # a notebook's; its module need not be installed
        del os.environ["MPLBACKEND"]
    try:
        sys.path.append(_working_folder())  # where one's own navigator lies; last, so that it hides nothing
        status = app(standalone_mode=False)
        sys.stdout.flush()
        if status == 130:  # typer makes a status of Ctrl-C
            print("dockair: stopped", file=sys.stderr)
    except DockairError as error:
        print(f"dockair: {_noted(str(error), error)}", file=sys.stderr)
        sys.exit(error.exit_code)
    except typer.TyperException as error:
        said = error.format_message()
        print(f"dockair: {said}{_got(error, said, sys.argv)}", file=sys.stderr)
        sys.exit(2)
    except SystemExit as ended:
        if isinstance(ended.__context__, BrokenPipeError):  # of a pipe within: typer would pass it over with status 1
            raise ended.__context__ from None
        raise
    except OSError as error:
        if error.errno in _NO_FILE:
            path = error.filename2 or error.filename or "a file"  # of two, the second is the one that was to be written
            said = f"{path}: expected a file that may be used, got {error.strerror}"
            print(f"dockair: {_noted(said, error)}", file=sys.stderr)
            sys.exit(2)
        if error.errno not in NO_ROOM:
            raise
        said = f"{error.filename or 'disk'}: expected room to write, got a full disk"
        print(f"dockair: {_noted(said, error)}", file=sys.stderr)
        sys.exit(3)
    except (typer.Abort, KeyboardInterrupt):
        print("dockair: stopped", file=sys.stderr)
        sys.exit(130)
    sys.exit(status if isinstance(status, int) else 0)
