"""The command line: one line for each mistake, exit status, nothing but one object on stdout with --json."""

import errno
import json
import os
import subprocess
import sys
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
import typer
from rich.text import Text

from dockair.errors import DockairError, MachineError
from dockair.scenarios import cli, doctor
from dockair.scenarios.commands.options import overrides
from dockair.scenarios.judgement.flight_profile import PhaseEntry
from dockair.scenarios.judgement.metrics import NavigationFigures
from dockair.scenarios.judgement.referee import Contact
from dockair.scenarios.judgement.result import Result, held_to
from dockair.scenarios.output_folder import FlightFolder
from dockair.scenarios.schema import load_scenario
from dockair.sim import opengl

NAVIGATION = NavigationFigures(
    range_rmse_m=0.02,
    lateral_rmse_m=0.004,
    range_max_m=0.05,
    lateral_max_m=0.01,
    velocity_rmse_m_s=0.03,
    attitude_rmse_deg=0.4,
    nees_mean=9.1,
    availability=0.98,
    frames_used=600,
)


def a_result(scenario, seed, out, **changes) -> Result:
    values = {
        "scenario": scenario.name,
        "seed": seed,
        "outcome": "contact",
        "success": True,
        "first_attempt": True,
        "cause": "",
        "unsafe": (),
        "attempts": 1,
        "attempt_log": (),
        "contact": Contact(time_s=9.87, radial_offset_m=0.042, closure_speed_m_s=1.23, angle_deg=2.5),
        "hold": None,
        "disconnect": None,
        "fuel_kg": 110.0,
        "collided_with": "",
        "sensing": scenario.sensing,
        "truth_navigation": scenario.navigation.is_truth,
        "background": "mujoco",
        "nav": NAVIGATION,
        "frames": 612,
        "duration_s": 20.0,
        "real_time_factor": 0.25,
        "wall_time_s": 80.0,
        "versions": {"dockair": "0.1.0"},
        "timeline": (PhaseEntry(phase="disconnect", begun_s=16.8, reason="refuelled"),),
        "nav_by_range": (),
        "out_dir": str(out),
    }
    return held_to(scenario.accept, Result(**(values | changes)))


@pytest.fixture
def command(monkeypatch, capfd):
    """Run `dockair` with arguments; return its exit status, stdout and stderr."""

    def run(*arguments: str) -> tuple[int, str, str]:
        monkeypatch.setattr(sys, "argv", ["dockair", *arguments])
        with pytest.raises(SystemExit) as ended:
            cli.main()
        said = capfd.readouterr()
        return ended.value.code, said.out, said.err

    return run


@pytest.fixture
def flights(monkeypatch, tmp_path):
    """Stand in for the loop: notes what it is asked to fly, tells the progress of two ticks, returns a contact."""
    asked = []

    def fly(scenario, seed=None, out=None, *, record="window", progress=None, overlap=False):
        asked.append(SimpleNamespace(scenario=scenario, seed=seed, out=out, record=record))
        for time_s in (0.0, 5.0):
            progress(
                SimpleNamespace(time_s=time_s, p_PD_B=np.array([3.0, 4.0, 0.0])), SimpleNamespace(phase="approach")
            )
        folder = FlightFolder(Path(out))  # as the recorder does, once the flight is built
        result = a_result(scenario, seed, out)
        result.write(folder.under_way)
        folder.keep()
        return result

    monkeypatch.setitem(sys.modules, "dockair.scenarios.loop", SimpleNamespace(fly=fly))
    monkeypatch.setattr(doctor, "require_rendering", lambda: None)
    monkeypatch.chdir(tmp_path)
    return asked


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (("fly", "defualt"), "scenario: expected a scenario of the library, or the path of a TOML file, got 'defualt'"),
        (("fly", "none.toml"), "none.toml: expected a scenario file, got 'no such file'"),
        (("fly", "n" * 300 + ".toml"), f"{'n' * 300}.toml: expected a scenario file, got 'no such file'"),
        (
            ("fly", "--set", "flight.speed=1"),
            "--set flight.speed: expected a known key, got 'speed'; exists: airspeed_m_s,",
        ),
        (
            ("fly", "--set", "flight.airspeed_m_s=fast"),
            "--set flight.airspeed_m_s: expected a number from 100.0 to 250.0",
        ),
        (("fly", "--set", "seed"), "--set: expected key=value, as in turbulence.sigma_m_s=1.1, got 'seed'"),
        (("fly", "--set", "=1"), "--set: expected key=value, as in turbulence.sigma_m_s=1.1, got '=1'"),
        (("fly", "--seed", "-1"), "Invalid value for '--seed': Input should be greater than or equal to 0, got '-1'"),
        (
            (
                "fly",
                "--seed",
                "3",
                "--seed",
                "-1",
            ),
            "Invalid value for '--seed': Input should be greater than or equal to 0, got '-1'",
        ),
        (
            ("fly", "--seed=9223372036854775808"),
            "Invalid value for '--seed': Input should be less than or equal to 9223372036854775807, got '922337203685",
        ),
        (("fly", "--record", "some"), "Invalid value for '--record': Value error, 'some' is not one of"),
        (
            ("fly", "--set", "start.sigma_m=[1.0, 2.0]"),
            "--set start.sigma_m: expected three numbers, each 0 to 20, got [1.0, 2.0]",
        ),
        (("fly", "--sed", "1"), "No such option: --sed"),
        (("fyl",), "No such command 'fyl'"),
        (("replay", "nowhere"), "nowhere: expected the folder of a recorded flight, got 'no such folder'"),
        (("replay", "n" * 300), f"{'n' * 300}: expected the folder of a recorded flight, got 'no such folder'"),
        (
            ("allan", "n" * 300 + ".csv", "--rate-hz", "100"),
            f"{'n' * 300}.csv: expected a record of gyro rates, got 'no such file'",
        ),
        (
            ("design-ring", "--camera", "n" * 300, "--out", "."),
            f"{'n' * 300}: expected a calibration file, got 'no such file'",
        ),
        (("replay",), "Missing argument 'OUT'"),
        (("bench", "defualt"), "scenario: expected a scenario of the library"),
        (("fly", "levels"), "scenario: expected a scenario, got 'a plan, for dockair campaign levels'"),
        (("campaign", "night"), "plan: expected a plan, got 'a scenario, for dockair fly night'"),
        (
            ("fly", "--set", "navigation.navigator=nosuch:Class"),
            'navigation.navigator: expected an importable "module:Class", got "nosuch:Class: No module named \'nosuch',
        ),
    ],
)
def test_a_mistake_is_told_in_one_line_and_ends_with_status_two(command, tmp_path, monkeypatch, arguments, said):
    monkeypatch.chdir(tmp_path)
    status, out, err = command(*arguments)
    assert status == 2
    assert out == ""
    assert err.startswith(f"dockair: {said}")
    assert err.count("\n") == 1
    assert list(tmp_path.iterdir()) == []


def test_flying_writes_to_a_folder_named_after_scenario_and_seed(command, flights, tmp_path):
    status, out, err = command("fly", "still_air", "--seed", "3", "--record", "none")
    assert status == 0
    (flight,) = flights
    assert (flight.scenario.name, flight.seed, flight.record) == ("still_air", 3, "none")
    assert (tmp_path / flight.out).samefile(tmp_path / "out" / "still_air-3")
    for figure in ("contact", "0.042", "1.23", "9.87", "out/still_air-3/result.json", "as the scenario claims"):
        assert figure in out
    assert "distance to drogue   5.00 m" in err


def test_a_flight_that_docks_and_is_called_back_is_not_as_claimed(command, flights, monkeypatch):
    called_back = partial(
        a_result, fuel_kg=69.0, timeline=(PhaseEntry(phase="back_off", begun_s=11.0, reason="a miss"),)
    )
    monkeypatch.setitem(globals(), "a_result", called_back)
    _, out, _ = command("fly", "still_air", "--seed", "3")
    assert "docked, and has not refuelled" in out and "as the scenario claims" not in out
    _, out, _ = command("fly", "still_air", "--seed", "3", "--json")
    assert json.loads(out)["shortfalls"] == ["docked, and has not refuelled"]


def test_a_flight_that_docks_askew_is_not_as_claimed_where_a_campaign_would_not_count_it():
    askew = Contact(time_s=9.87, radial_offset_m=0.042, closure_speed_m_s=1.23, angle_deg=12.0)
    result = a_result(load_scenario("severe_gusts"), 0, "out", contact=askew)
    assert result.shortfalls == ("angle 12.000 deg, wanted 0 to 10",)


def test_flying_without_a_name_flies_the_default_scenario_with_its_own_seed(command, flights):
    assert command("fly")[0] == 0
    assert (flights[0].scenario.name, flights[0].seed) == ("default", 0)


def test_settings_reach_the_scenario(command, flights):
    command("fly", "--set", "seed=5", "--set", "turbulence.intensity=light")
    assert (flights[0].seed, flights[0].scenario.turbulence.intensity) == (5, "light")


def test_json_is_one_object_on_stdout_and_nothing_else(command, flights):
    status, out, err = command("fly", "--json")
    assert status == 0
    table = json.loads(out)
    assert table["outcome"] == "contact"
    assert table["contact"]["radial_offset_m"] == 0.042
    assert table["shortfalls"] == []
    assert "approach" in err


def test_what_a_navigator_prints_is_not_among_the_json(command, flights, monkeypatch):
    stand_in = sys.modules["dockair.scenarios.loop"].fly

    def fly(*given, **options):
        sys.stdout.write("hello\n")
        return stand_in(*given, **options)

    monkeypatch.setitem(sys.modules, "dockair.scenarios.loop", SimpleNamespace(fly=fly))
    _, out, err = command("fly", "--json")
    assert json.loads(out)["outcome"] == "contact"
    assert "hello" in err
    assert command("fly")[1].startswith("hello")


@pytest.mark.parametrize("outcome", ["miss", "rim_strike", "abort", "collision", "timeout"])
def test_the_exit_status_is_zero_whatever_the_outcome(command, flights, monkeypatch, outcome):
    def fly(scenario, seed, out, *, record, progress, overlap):
        FlightFolder(Path(out)).keep()
        return a_result(scenario, seed, out, outcome=outcome, contact=None)

    monkeypatch.setitem(sys.modules, "dockair.scenarios.loop", SimpleNamespace(fly=fly))
    status, out, _ = command("fly")
    assert status == 0
    assert out.startswith(outcome)
    assert f"outcome {outcome}, wanted contact" in out


def test_perfect_navigation_is_said_in_the_outcome_and_needs_no_opengl(command, flights, monkeypatch):
    def refuse():
        raise MachineError("off-screen OpenGL", expected="a picture", remedy="none here")

    monkeypatch.setattr(doctor, "require_rendering", refuse)
    status, out, _ = command("fly", "truth_navigation")
    assert status == 0
    assert "perfect navigation" in out


def test_without_opengl_a_drawn_background_ends_with_status_three_and_keeps_the_earlier_flight(
    command, flights, monkeypatch, tmp_path
):
    command("fly")
    monkeypatch.setenv("MUJOCO_GL", "disabled")
    monkeypatch.setattr(doctor, "require_rendering", REQUIRE_RENDERING)
    status, out, err = command("fly", "--set", "camera.background=mujoco")
    assert status == 3
    assert out == ""
    assert err.startswith("dockair: off-screen OpenGL: expected a picture through disabled; ")
    assert err.count("\n") == 1
    assert (tmp_path / "out/default-0/result.json").is_file()


def test_without_opengl_the_analytic_background_is_taken_and_said(command, flights, monkeypatch):
    monkeypatch.setattr(opengl, "_trial", lambda: opengl.Trial("", "none of it"))
    status, out, err = command("fly", "--set", "camera.background=auto")
    assert status == 0 and out.startswith("contact")
    assert "dockair: no OpenGL here (none of it): the camera's background is analytic\n" in err
    status, _, err = command("fly")
    assert status == 0 and "no OpenGL" not in err  # the analytic one is the default


REQUIRE_RENDERING = doctor.require_rendering


def test_an_earlier_flight_is_replaced_and_other_files_beside_it_stay(command, flights, tmp_path):
    folder = tmp_path / "out" / "default-0"
    command("fly")
    (folder / "episode.rrd").write_text("old")
    (folder / "notes.txt").write_text("mine")
    assert command("fly")[0] == 0
    assert sorted(path.name for path in folder.iterdir()) == ["notes.txt", "result.json"]


def test_a_folder_with_other_files_is_refused_untouched(command, flights, tmp_path):
    (tmp_path / "thesis.tex").write_text("mine")
    status, _, err = command("fly", "--out", str(tmp_path))
    assert status == 2
    assert "expected a new or empty folder, or one with an earlier flight, got 'a folder with thesis.tex'" in err
    assert flights == []
    assert [path.name for path in tmp_path.iterdir()] == ["thesis.tex"]


def test_a_folder_in_the_place_of_a_flights_file_is_refused_before_anything_is_flown(command, flights, tmp_path):
    (tmp_path / "result.json").mkdir()
    status, out, err = command("fly", "--out", str(tmp_path))
    assert (status, out) == (2, "")
    assert err == f"dockair: --out {tmp_path / 'result.json'}: expected a file, or nothing, got 'a folder'\n"
    assert flights == []


def test_what_goes_wrong_inside_a_flight_is_one_line(command, flights, monkeypatch):
    def fly(*_, **__):
        raise DockairError("navigation.navigator", expected="a module that can be imported", got="mine:Mine")

    monkeypatch.setitem(sys.modules, "dockair.scenarios.loop", SimpleNamespace(fly=fly))
    status, out, err = command("fly")
    assert (status, out) == (2, "")
    assert err == "dockair: navigation.navigator: expected a module that can be imported, got 'mine:Mine'\n"


def test_interrupting_a_flight_is_no_traceback(command, flights, monkeypatch):
    def fly(*_, **__):
        raise KeyboardInterrupt

    monkeypatch.setitem(sys.modules, "dockair.scenarios.loop", SimpleNamespace(fly=fly))
    status, _, err = command("fly")
    assert status == 130
    assert err == "dockair: stopped\n"


def test_a_full_disk_is_one_line_and_status_three(command, flights, monkeypatch):
    def fly(*_, **__):
        error = OSError(errno.ENOSPC, os.strerror(errno.ENOSPC), "out/default-0/flight.png")
        error.add_note("out/default-0 holds the flight, without flight.png")
        raise error

    monkeypatch.setitem(sys.modules, "dockair.scenarios.loop", SimpleNamespace(fly=fly))
    status, out, err = command("fly")
    assert (status, out) == (3, "")
    full = "out/default-0/flight.png: expected room to write, got a full disk"
    assert err == f"dockair: {full}; out/default-0 holds the flight, without flight.png\n"


@pytest.mark.parametrize("number", [errno.EISDIR, errno.ENOTDIR, errno.EACCES, errno.EPERM, errno.ENAMETOOLONG])
def test_a_file_that_cannot_be_one_is_one_line_and_status_two(number, command, flights, monkeypatch):
    def fly(*_, **__):
        raise OSError(number, os.strerror(number), "out/.part", None, "out/result.json")

    monkeypatch.setitem(sys.modules, "dockair.scenarios.loop", SimpleNamespace(fly=fly))
    status, out, err = command("fly")
    assert (status, out) == (2, "")
    assert err == f"dockair: out/result.json: expected a file that may be used, got {os.strerror(number)}\n"


@contextmanager
def no_reader():
    """A pipe that nobody reads."""
    reading, writing = os.pipe()
    os.close(reading)
    try:
        yield writing
    finally:
        os.close(writing)


@pytest.mark.parametrize("arguments", [["scenarios"], ["scenarios", "--json"], ["--help"], ["--version"], ["campaign"]])
def test_a_reader_that_has_gone_is_no_failure(arguments):
    command = [sys.executable, "-m", "dockair", *arguments]
    with no_reader() as writing:
        done = subprocess.run(command, stdout=writing, stderr=subprocess.PIPE, text=True)
    assert (done.returncode, done.stderr) == (0, "")


STANDING_IN = """
import sys
from types import SimpleNamespace
from dockair.scenarios import cli
def replay(out):
    {does}
sys.modules["dockair.scenarios.replay"] = SimpleNamespace(replay=replay)
sys.argv = ["dockair", "replay", "."]
cli.main()
"""


def test_without_a_reader_the_status_still_says_what_came_of_it():
    differs = STANDING_IN.format(does="print('x', file=sys.stderr); return SimpleNamespace(identical=False)")
    with no_reader() as writing:
        assert subprocess.run([sys.executable, "-c", differs], stdout=writing, stderr=writing).returncode == 1


def test_a_notebooks_own_backend_is_none_of_a_command_that_is_begun_there():
    """Matplotlib refuses to be imported where the module is not installed, as where the kernel lies elsewhere."""
    draws = STANDING_IN.format(does="import matplotlib; return SimpleNamespace(identical=False)")
    environment = {**os.environ, "MPLBACKEND": "module://matplotlib_inline.backend_inline"}
    done = subprocess.run([sys.executable, "-c", draws], capture_output=True, text=True, env=environment)
    assert done.returncode == 1 and "Traceback" not in done.stderr


def test_a_pipe_that_breaks_within_is_no_quiet_failure():
    breaks = STANDING_IN.format(does="raise BrokenPipeError(32, 'a pipe of our own')")
    done = subprocess.run([sys.executable, "-c", breaks], capture_output=True, text=True)
    assert "a pipe of our own" in done.stderr


@pytest.mark.parametrize(
    ("arguments", "status"), [("scenarios", 0), ("scenarios --json", 0), ("--help", 0), ("fly nosuch", 2)]
)
@pytest.mark.parametrize("closed", [">&-", "2>&-", "<&- >&- 2>&-"])
def test_a_stream_that_is_closed_is_no_traceback(arguments, status, closed):
    command = f'"{sys.executable}" -m dockair {arguments} {closed}'
    done = subprocess.run(["sh", "-c", command], capture_output=True, text=True)
    assert done.returncode == status
    assert "Traceback" not in done.stderr and "dockair: " not in done.stdout


def test_a_file_that_a_library_keeps_open_does_not_take_a_closed_streams_place():
    keeps = """import os, sys
from dockair.__main__ import main
class Library:
    def find_spec(self, name, *_):
        if name == "dockair.scenarios.cli":
            self.kept = os.open(os.devnull, os.O_RDONLY)
sys.meta_path.insert(0, Library())
sys.argv = ["dockair", "scenarios"]
main()"""
    command = f'"{sys.executable}" -c "$KEEPS" >&-'
    done = subprocess.run(["sh", "-c", command], capture_output=True, text=True, env=os.environ | {"KEEPS": keeps})
    assert (done.returncode, done.stderr) == (0, "")


@pytest.mark.parametrize("arguments", ["--version", "doctor", "fly nosuch"])
def test_a_working_folder_that_has_gone_is_one_line_and_status_two(tmp_path, arguments):
    (tmp_path / "gone").mkdir()
    command = f'rmdir ../gone; "{sys.executable}" -m dockair {arguments}'
    done = subprocess.run(["sh", "-c", command], cwd=tmp_path / "gone", capture_output=True, text=True)
    assert (done.returncode, done.stdout) == (2, "")
    assert done.stderr == "dockair: working folder: expected one that is there, got 'No such file or directory'\n"


def test_a_path_of_any_bytes_is_printed_as_it_is():
    code = "import os; from dockair.scenarios.std_streams import outlive_readers; outlive_readers()"
    done = subprocess.run([sys.executable, "-c", f"{code}; print(os.fsdecode(b'out/\\xff'))"], capture_output=True)
    assert (done.stdout, done.stderr) == (b"out/\xff\n", b"")


def test_a_sign_that_the_encoding_lacks_is_printed_as_its_number_beside_a_path_of_any_bytes():
    code = "import os; from dockair.scenarios.std_streams import outlive_readers; outlive_readers()"
    code += "; print('3\\xb0 \\u2014', os.fsdecode(b'\\xff'))"
    environment = {**os.environ, "PYTHONIOENCODING": "ascii"}
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, env=environment)
    assert (done.stdout, done.stderr) == (b"3\\xb0 \\u2014 \xff\n", b"")


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="a device of Linux")
@pytest.mark.parametrize(
    ("arguments", "full", "status"),
    [
        ("--version", "stdout", 3),
        ("--help", "stdout", 3),
        ("scenarios --json", "stdout", 3),
        ("fly nosuch", "stderr", 2),
    ],
)
def test_a_full_disk_where_output_goes_is_a_status_and_no_traceback(arguments, full, status):
    with open("/dev/full", "w") as disk:
        streams = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE, full: disk}
        done = subprocess.run([sys.executable, "-m", "dockair", *arguments.split()], text=True, **streams)
    assert done.returncode == status
    if full == "stdout":
        assert done.stderr == "dockair: disk: expected room to write, got a full disk\n"
    else:
        assert done.stdout == ""


@pytest.mark.parametrize(("identical", "expected_status"), [(True, 0), (False, 1)])
def test_a_replay_that_differs_ends_with_status_one(command, monkeypatch, tmp_path, identical, expected_status):
    class Report:
        def __init__(self):
            self.identical = identical

        def to_json(self):
            return json.dumps({"identical": identical, "frames": 3})

    monkeypatch.setitem(sys.modules, "dockair.scenarios.replay", SimpleNamespace(replay=lambda out: Report()))
    status, out, _ = command("replay", str(tmp_path), "--json")
    assert status == expected_status
    assert json.loads(out) == {"identical": identical, "frames": 3}


def test_the_library_is_listed_with_its_claims(command):
    status, out, _ = command("scenarios", "--json")
    assert status == 0
    listed = {entry["name"]: entry for entry in json.loads(out)["scenarios"]}
    assert listed["default"]["turbulence"]["sigma_m_s"] == 0.5
    assert listed["truth_navigation"]["navigation"]["navigator"] == "truth"
    status, out, _ = command("scenarios")
    assert all(name in out for name in listed)


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"diameter": 0.5}, "ring.toml: diameter: expected a known key, got 'diameter'"),
        ({"diameter_m": 0.6}, "expected the LED ring's own diameter, 0.6 m (hardware.ring), got 0.5"),
    ],
)
def test_a_scenario_whose_own_sheet_cannot_be_flown_is_refused_where_it_is_shown(command, tmp_path, changes, said):
    ring = {"diameter_m": 0.5, "count": 8} | changes
    (tmp_path / "ring.toml").write_text("".join(f"{key} = {value}\n" for key, value in ring.items()))
    (tmp_path / "own.toml").write_text('name = "own"\nhardware.ring = "ring.toml"\n')
    status, out, err = command("scenarios", str(tmp_path / "own.toml"))
    assert (status, out) == (2, "") and said in err


def test_the_keys_are_listed_all_or_those_with_a_part_of_their_name(command):
    status, out, _ = command("scenarios", "--keys", "--json")
    assert status == 0
    assert len(json.loads(out)["keys"]) > 60
    status, out, _ = command("scenarios", "--keys", "elevation", "--json")
    assert [key["name"] for key in json.loads(out)["keys"]] == ["sun.elevation_deg"]
    status, out, _ = command("scenarios", "--keys", "elevation")
    assert status == 0 and "sun.elevation_deg" in out and "-10 to 90 deg" in out


def test_help_and_version_need_no_command(command):
    status, out, _ = command()
    assert status == 0
    assert all(name in out for name in ("fly", "scenarios", "replay", "bench", "doctor"))
    assert command("--version")[1].strip() == cli.dockair.__version__


def test_no_help_text_loses_words_in_brackets_as_markup():
    group = typer.main.get_command(cli.app)
    told = {(name, part.name): part.help for name, made in group.commands.items() for part in made.params}
    told |= {(name, ""): made.help for name, made in group.commands.items()}
    assert ("design-ring", "depth") in told and ("fly", "") in told
    lost = {where: text for where, text in told.items() if text and Text.from_markup(text).plain != text}
    assert lost == {}


@pytest.mark.parametrize("arguments", [("--help",), ("fly", "--help"), ("scenarios",)])
def test_quick_commands_load_no_engine(arguments):
    code = (
        "import sys\nfrom dockair.scenarios import cli\nsys.argv = ['dockair', *sys.argv[1:]]\n"
        "try:\n    cli.main()\nexcept SystemExit:\n    pass\n"
        "slow = ('mujoco', 'rerun', 'cv2', 'numba', 'pyarrow', 'matplotlib', 'gymnasium', 'filterpy')\n"
        "print(*[name for name in slow if name in sys.modules], file=sys.stderr)"
    )
    done = subprocess.run([sys.executable, "-c", code, *arguments], capture_output=True, text=True)
    assert done.returncode == 0
    assert done.stderr.strip() == ""


@pytest.mark.slow
@pytest.mark.timeout(900)  # three flights, each in a new process: a loaded machine is slow at that
def test_a_real_flight_through_the_command_line_prints_its_result_and_repeats_it(tmp_path):
    command = [sys.executable, "-m", "dockair", "fly", "light_gusts", "--set", "camera.sensing=measurements"]
    command += ["--set", "flight.duration_s=1.0", "--record", "none", "--json"]
    results, flights = [], []
    for name, seed in (("first", "3"), ("second", "3"), ("other", "4")):
        out = tmp_path / name
        done = subprocess.run([*command, "--seed", seed, "--out", str(out)], capture_output=True, text=True)
        assert done.returncode == 0, done.stderr
        printed = json.loads(done.stdout)
        assert json.loads((out / "result.json").read_text()) == printed
        told = set(printed) - {"wall_time_s", "real_time_factor", "out_dir"}
        results.append({key: printed[key] for key in told})
        flights.append((out / "flight.parquet").read_bytes())
    assert results[0] == results[1]
    assert (results[0]["outcome"], results[0]["sensing"]) == ("timeout", "measurements")
    assert flights[0] == flights[1]
    assert flights[0] != flights[2] and results[0]["nav"] != results[2]["nav"]


def test_of_settings_that_are_repeated_the_last_holds_against_its_alternative_too():
    """Gusts are given by sigma or by intensity: what is set last replaces what the other said before."""
    settings = ["turbulence.intensity=light", "turbulence.sigma_m_s=2.5", "turbulence.intensity=severe"]
    assert list(overrides(settings).items()) == [("turbulence.sigma_m_s", "2.5"), ("turbulence.intensity", "severe")]
    turbulence = load_scenario("default", overrides(settings)).turbulence
    assert (turbulence.intensity, turbulence.sigma_m_s) == ("severe", None)
