"""Campaigns run, broken off, gone on with: nothing is lost, nothing is flown twice, nobody else's files are touched."""

import errno
import importlib
import io
import json
import os
import random
import shutil
import signal
import subprocess
import sys
import time
from collections import Counter
from functools import partial
from itertools import count
from pathlib import Path
from types import SimpleNamespace

import pytest
from rich.console import Console

import dockair
from dockair.errors import DockairError, MachineError
from dockair.scenarios import cli
from dockair.scenarios.campaign import manifest
from dockair.scenarios.campaign import pool as pool_module
from dockair.scenarios.campaign import run as run_module
from dockair.scenarios.campaign.code import _NOT_FLOWN, Code, code_of, dockair_files, plug_in_files
from dockair.scenarios.campaign.dry_run import dry_run
from dockair.scenarios.campaign.folder import rows_of
from dockair.scenarios.campaign.jobs import jobs_of
from dockair.scenarios.campaign.journal import Journal
from dockair.scenarios.campaign.manifest import read_manifest
from dockair.scenarios.campaign.plan_file import PlanFile
from dockair.scenarios.campaign.pool import Done, Pool
from dockair.scenarios.campaign.progress import CampaignProgress, _in_words, docked, show_campaign
from dockair.scenarios.campaign.run import run
from dockair.scenarios.campaign.table import read_table
from dockair.scenarios.campaign.worker import Answer, one_line
from dockair.scenarios.commands import campaign as campaign_command
from dockair.scenarios.scenario_hash import scenario_hash
from dockair.scenarios.schema import load_scenario
from dockair.scenarios.whole_file import write_whole
from dockair.sim.opengl import Trial

#: Flies nothing: answers after a while that the seed decides, or comes to the end that the seed decides.
FAKE = """
import os, signal, time

def quick(job):
    time.sleep(0.004 * (1 + job.seed % 5))
    with open(os.environ["FLOWN"], "a") as file:
        file.write(f"{job.key}\\n")
    docked = job.seed % 3 > 0
    return {"outcome": "contact" if docked else "miss", "success": docked, "first_attempt": docked,
            "attempts": 1 + job.seed % 2, "radial_offset_m": 0.01 * job.seed / 3 if docked else None,
            "closure_speed_m_s": 1.2 if docked else None}

def deadly(job):
    if job.seed == 1:
        raise ValueError("no\\nway")
    if job.seed == 2:
        os.kill(os.getpid(), signal.SIGSEGV)
    if job.seed == 3:
        os.kill(os.getpid(), signal.SIGKILL)
    if job.seed == 4:
        open(f"{os.environ['FLOWN']}.asleep", "w").close()
        time.sleep(1000.0)
    if job.seed == 5:
        raise SystemExit(3)
    if job.seed == 6:
        os._exit(7)
    if job.seed == 7:
        print("said on stdout")
    return quick(job)

def who(job):
    return {"outcome": "miss", "frames": os.getpid()}

def never(job):
    raise ValueError("not today")

def sleeper(job):
    with open(os.environ["FLOWN"], "w") as file:
        file.write(f"{os.getpid()}\\n")
    time.sleep(1000.0)

def mortal_once(job):
    mark = f"{os.environ['FLOWN']}.{job.seed}"
    if not os.path.exists(mark):
        open(mark, "w").close()
        os.kill(os.getpid(), signal.SIGKILL)
    return quick(job)
"""


@pytest.fixture
def fakes(tmp_path, monkeypatch):
    """The functions above as a module that a spawned process can import; returns where they note what they flew."""
    folder = tmp_path / "modules"
    folder.mkdir()
    (folder / "fake_flights.py").write_text(FAKE)
    monkeypatch.syspath_prepend(str(folder))
    monkeypatch.setenv("FLOWN", str(tmp_path / "flown"))
    monkeypatch.setenv("PYTHONPATH", str(folder), prepend=os.pathsep)  # of a clone its own Dockair stands there
    monkeypatch.setattr("dockair.scenarios.campaign.code.dockair_files", dict)  # whoever edits the sources meanwhile
    monkeypatch.setattr(manifest, "commit_of_the_code", lambda: ("abc", False))
    return tmp_path / "flown"


@pytest.fixture
def here(fakes, monkeypatch):
    """Fly in this process: for tests that are not about processes."""
    import fake_flights

    class Here:
        def __init__(self, workers, timeout_s, flight, check):
            self.fly = getattr(fake_flights, flight.rpartition(":")[2])

        def __enter__(self):
            return self

        def __exit__(self, *_):
            pass

        def done(self, jobs):
            for job in jobs:
                try:
                    yield Done(job, Answer(columns=self.fly(job)))
                except Exception as error:
                    yield Done(job, Answer(columns=None, error=one_line(error)))

    monkeypatch.setattr(run_module, "Pool", Here)
    return fakes


def plan(folder: Path, seeds: int = 4, more: str = "", scenarios: str = '"truth_navigation"') -> PlanFile:
    path = folder / "p.toml"
    path.write_text(f'name = "p"\nscenarios = [{scenarios}]\nseeds = {seeds}\n{more}')
    return PlanFile(path)


def fly(source: PlanFile, out: Path, flight: str = "quick", **options):
    return run(source, out, workers=2, flight=f"fake_flights:{flight}", **options)


def lines(path: Path) -> list[str]:
    return path.read_text().splitlines() if path.exists() else []


def test_a_campaign_that_is_over_is_not_flown_again(here, tmp_path):
    first = fly(plan(tmp_path), tmp_path / "out")
    table = (tmp_path / "out/flights.parquet").read_bytes()
    again = fly(plan(tmp_path), tmp_path / "out")
    assert len(lines(here)) == 4
    assert again.rows == first.rows == read_table(tmp_path / "out") == rows_of(tmp_path / "out")
    assert (tmp_path / "out/flights.parquet").read_bytes() == table


@pytest.mark.parametrize(
    ("more", "seeds"),
    [("", [0, 1, 2]), ("[draw]", [0, 1, 2]), ("draws = 2\n[draw]", [0, 0, 1, 1, 2, 2])],
    ids=["as written", "a point a seed", "every point with every seed"],
)
def test_scenarios_take_turns_seed_by_seed_whether_keys_are_drawn_or_not(here, tmp_path, more, seeds):
    drawn = f'{more}\n"start.aft_m" = {{ low = 3.0, high = 5.0 }}\n' if more else ""
    two, told = '"truth_navigation", "dead_reel"', []

    def watch(jobs, entries):
        return lambda row, wall_time_s: told.append((row["scenario"], row["seed"]))

    fly(plan(tmp_path, 3, drawn, two), tmp_path / "out", watch=watch)
    assert told == [(scenario, seed) for seed in seeds for scenario in ("truth_navigation", "dead_reel")]


def test_a_line_that_was_torn_is_flown_again_and_no_other(here, tmp_path):
    undisturbed = fly(plan(tmp_path), tmp_path / "whole")
    fly(plan(tmp_path), tmp_path / "out")
    journal = tmp_path / "out/journal.jsonl"
    whole = journal.read_bytes()
    for cut in (1, 50, len(whole.splitlines(keepends=True)[-1]) - 1):
        journal.write_bytes(whole[:-cut])
        here.unlink()
        assert fly(plan(tmp_path), tmp_path / "out").rows == undisturbed.rows
        assert [key[-2:] for key in lines(here)] == [":3"]
        assert fly(plan(tmp_path), tmp_path / "out").rows == undisturbed.rows
        assert len(lines(here)) == 1  # what was written after the torn line can be read again


def test_damage_in_the_middle_is_refused_and_left_as_it_is(here, tmp_path):
    fly(plan(tmp_path), tmp_path / "out")
    journal = tmp_path / "out/journal.jsonl"
    parts = journal.read_bytes().splitlines(keepends=True)
    damaged = b"".join([parts[0], b"\0" * 30 + b"\n", *parts[2:]])
    journal.write_bytes(damaged)
    with pytest.raises(DockairError, match=r"journal.jsonl:2: expected an entry of a campaign"):
        fly(plan(tmp_path), tmp_path / "out")
    assert journal.read_bytes() == damaged


def damaged(out: Path, number: int, line: bytes) -> bytes:
    """Put another line in the place of one of the journal's; return the whole."""
    parts = (out / "journal.jsonl").read_bytes().splitlines(keepends=True)
    parts[number] = line
    (out / "journal.jsonl").write_bytes(b"".join(parts))
    return b"".join(parts)


@pytest.mark.parametrize("number", [0, 1])
@pytest.mark.parametrize(
    "line", [b"\0" * 30 + b"\n", b'{"key": "x", "row": 3}\n', b'{"key": "x", "row": {}}\n', b"<!doctype html>\n"]
)
def test_fresh_forgets_a_damaged_journal_too(here, tmp_path, number, line):
    whole = fly(plan(tmp_path), tmp_path / "out")
    before = damaged(tmp_path / "out", number, line)
    with pytest.raises(DockairError):
        fly(plan(tmp_path), tmp_path / "out")
    assert (tmp_path / "out/journal.jsonl").read_bytes() == before
    assert fly(plan(tmp_path), tmp_path / "out", fresh=True).rows == whole.rows
    assert fly(plan(tmp_path), tmp_path / "out").rows == whole.rows
    assert len(lines(here)) == 8


@pytest.mark.parametrize(
    "change",
    [
        {"row": None},
        {"row": {}},
        {"row": "contact"},
        {"key": "x"},
        {"key": 3},
        {"wall_time_s": None},
        {"seed": "1"},
        {"seed": None},
        {"success": "yes"},
        {"radial_offset_m": "0.1"},
        {"attempt_log": None},
        {"command": 3},
    ],
)
def test_a_line_whose_row_is_no_row_is_damage(here, tmp_path, change):
    fly(plan(tmp_path), tmp_path / "out")
    entry = json.loads(lines(tmp_path / "out/journal.jsonl")[1])
    whole = entry | change if change.keys() <= entry.keys() else entry | {"row": entry["row"] | change}
    damaged(tmp_path / "out", 1, json.dumps(whole).encode() + b"\n")
    (tmp_path / "out/flights.parquet").unlink()
    for read in (rows_of, Journal, partial(dry_run, plan(tmp_path))):
        with pytest.raises(DockairError, match=r"journal.jsonl:2: expected an entry of a campaign .*--fresh"):
            read(tmp_path / "out")


def test_a_last_line_that_is_whole_and_no_entry_is_damage_and_stays(here, tmp_path):
    """As where an older version's rows lacked a column: to cut it off would lose a flight without a word."""
    fly(plan(tmp_path), tmp_path / "out")
    entry = json.loads(lines(tmp_path / "out/journal.jsonl")[3])
    del entry["row"]["cause"]
    before = damaged(tmp_path / "out", 3, json.dumps(entry).encode() + b"\n")
    with pytest.raises(DockairError, match=r"journal.jsonl:4: expected an entry of a campaign .*--fresh"):
        fly(plan(tmp_path), tmp_path / "out")
    assert (tmp_path / "out/journal.jsonl").read_bytes() == before


def test_a_damaged_manifest_is_one_line_and_fresh_writes_another(here, tmp_path):
    fly(plan(tmp_path), tmp_path / "out")
    for text in ("", '{"schema_version": 1, "plan": {"name": "p"}, "plug_ins": 3}'):
        (tmp_path / "out/manifest.json").write_text(text)
        with pytest.raises(DockairError, match=r"manifest.json: expected "):
            fly(plan(tmp_path), tmp_path / "out")
    assert len(fly(plan(tmp_path), tmp_path / "out", fresh=True).rows) == 4


def test_a_manifest_says_what_each_scenarios_file_holds_whatever_is_set_or_drawn(here, tmp_path):
    drawn = '[draw."start.aft_m"]\nlow = 3.0\nhigh = 5.0'
    both = '"default", { scenario = "still_air", set = { "navigation.navigator" = "truth" } }'
    fly(plan(tmp_path, 3, scenarios=both), tmp_path / "a")
    fly(plan(tmp_path, 4, drawn, scenarios=both), tmp_path / "b")
    files = read_manifest(tmp_path / "a")["files"]
    assert files == read_manifest(tmp_path / "b")["files"]
    assert list(files) == ["default", "still_air"] and len(set(files.values())) == 2


def test_a_seed_that_the_table_cannot_hold_is_refused_before_anything_is_flown(here, tmp_path):
    with pytest.raises(DockairError, match="p.toml: first_seed: expected seeds up to 9223372036854775807"):
        fly(
            plan(
                tmp_path,
                2,
                "first_seed = 4611686018427387904",
                '{ scenario = "default", seeds = [4611686018427387904] }',
            ),
            tmp_path / "out",
        )
    assert not lines(here) and not (tmp_path / "out").exists()
    most = plan(
        tmp_path, 2, "first_seed = 4611686018427387903", '{ scenario = "default", seeds = [4611686018427387904] }'
    )
    assert [row["seed"] for row in fly(most, tmp_path / "out").rows] == [2**63 - 1]
    assert read_table(tmp_path / "out")[0]["seed"] == 2**63 - 1


def test_a_plan_may_grow_and_what_was_flown_is_kept(here, tmp_path):
    fly(plan(tmp_path, 3), tmp_path / "out")
    more = fly(plan(tmp_path, 5, scenarios='"still_air", "truth_navigation"'), tmp_path / "out")
    keys = lines(here)
    assert len(keys) == len(set(keys)) == 10
    assert [row["seed"] for row in more.rows] == [*range(5), *range(5)]
    assert read_manifest(tmp_path / "out")["seeds"] == ["0-4"]


@pytest.mark.parametrize(
    ("changed", "said"),
    [
        ({"seeds": 2}, "another plan: 1 of 3 flights that are done are not part of it"),
        ({"more": "[set]\nguidance.hold_s = 1.0"}, "another plan: 3 of 3 flights that are done are not part of it"),
    ],
)
def test_another_plan_in_the_same_folder_is_refused_and_fresh_begins_anew(here, tmp_path, changed, said):
    fly(plan(tmp_path, 3), tmp_path / "out")
    journal = (tmp_path / "out/journal.jsonl").read_bytes()
    with pytest.raises(DockairError) as refused:
        fly(plan(tmp_path, **({"seeds": 3} | changed)), tmp_path / "out")
    assert said in str(refused.value) and "--fresh" in str(refused.value)
    assert (tmp_path / "out/journal.jsonl").read_bytes() == journal
    anew = fly(plan(tmp_path, **({"seeds": 3} | changed)), tmp_path / "out", fresh=True)
    assert len(anew.rows) == changed.get("seeds", 3)


@pytest.mark.parametrize(
    ("name", "value", "said"),
    [
        ("code.dockair_files", {"sim/air.py": Path(__file__)}, "another code (of commit"),
        ("manifest.versions", {"numpy": "0.9"}, "other versions:"),
    ],
)
def test_another_code_is_refused_for_its_rows_are_another_campaign(here, tmp_path, monkeypatch, name, value, said):
    fly(plan(tmp_path), tmp_path / "out")
    monkeypatch.setattr(f"dockair.scenarios.campaign.{name}", lambda: value)
    with pytest.raises(DockairError) as refused:
        fly(plan(tmp_path), tmp_path / "out")
    assert said in str(refused.value)


def test_a_background_left_to_the_machine_is_the_same_in_every_process(here, tmp_path, monkeypatch):
    import fake_flights

    monkeypatch.setattr("dockair.sim.opengl._trial", lambda: Trial("", "none here"))
    seen = []
    monkeypatch.setattr(fake_flights, "quick", lambda job: seen.append(job.scenario.camera.background) or {})
    source = plan(tmp_path, 2, '[set]\ncamera.background = "auto"', '"default"')
    fly(source, tmp_path / "out")
    assert seen == ["analytic", "analytic"]
    monkeypatch.setattr("dockair.sim.opengl._trial", lambda: Trial("somebody"))
    with pytest.raises(DockairError, match="other background: analytic, now mujoco"):
        fly(source, tmp_path / "out")


@pytest.mark.parametrize(
    ("name", "counts"),
    [
        ("sim/air/wake.py", True),
        ("nav/fusion.py", True),
        ("assets/parameters/hose.toml", True),
        ("scenarios/loop.py", True),
        ("messages.py", True),
        ("scenarios/judgement/result.py", True),
        ("scenarios/campaign/row.py", True),  # what a row says of a flight
        ("scenarios/campaign/worker.py", True),
        ("scenarios/campaign/pool.py", True),  # when a flight is given up, and how many threads it has
        ("scenarios/campaign/jobs.py", True),
        ("scenarios/campaign/run.py", True),
        ("scenarios/campaign/new.py", True),  # whatever comes counts until somebody has said that it does not
        ("scenarios/new.py", True),
        ("scenarios/new/part.py", True),
        ("scenarios/reporter.py", True),  # that it begins as `report` says nothing
        ("scenarios/campaign/draws.py", False),  # the jobs' keys have what is drawn
        ("scenarios/campaign/progress.py", False),
        ("scenarios/campaign/summary.py", False),
        ("scenarios/cli.py", False),
        ("scenarios/commands/campaign.py", False),
        ("scenarios/display.py", False),
        ("scenarios/envs/dock.py", False),
        ("scenarios/reproductions_page.py", False),
        ("scenarios/std_streams.py", False),
        ("scenarios/recording/episode.py", False),  # no campaign records
        ("scenarios/message_log.py", False),
        ("scenarios/report/page.py", False),
        ("scenarios/reproduce/world/static.py", False),
        ("scenarios/library/still_air.toml", False),  # the job's key has it
        ("scenarios/library/default.toml", True),  # in its light the measurement model was fitted: others fly it, too
        ("nav/README.md", False),
        ("nav/.fusion.py.swp", False),  # somebody looks at it
        ("nav/__pycache__/fusion.cpython-311.pyc.140", False),
    ],
)
def test_the_digest_of_the_code_is_of_what_decides_flights(tmp_path, monkeypatch, name, counts):
    path = tmp_path / "dockair" / name
    for folder in ("sim", "nav", "scenarios", "assets"):
        (tmp_path / "dockair" / folder).mkdir(parents=True)
    path.parent.mkdir(parents=True, exist_ok=True)
    monkeypatch.setattr("dockair.__file__", str(tmp_path / "dockair/__init__.py"))
    digests = []
    for text in ("one", "two"):
        path.write_text(text)
        digests.append(Code().digest)
    assert (digests[0] != digests[1]) is counts


def test_whatever_the_digest_leaves_out_by_name_is_there():
    assert [name for name in _NOT_FLOWN if not (Path(dockair.__file__).parent / "scenarios" / name).exists()] == []


#: Flies a job as a worker does, says what of Dockair that imported.
IMPORTS = """
import pickle, sys
from pathlib import Path
from dockair.scenarios.campaign.jobs import jobs_of
from dockair.scenarios.campaign.plan_file import PlanFile
from dockair.scenarios.campaign.worker import Order, fly_order

for job in jobs_of(PlanFile(Path(sys.argv[1]))):
    fly_order(Order(seed=job.seed, key=job.key, pickled=pickle.dumps(job)))
print(*(module.__file__ for name, module in sys.modules.items() if name.partition(".")[0] == "dockair"), sep="\\n")
"""


def test_what_a_flight_imports_counts_but_for_what_names_and_keeps_flights(tmp_path):
    flights = '"truth_navigation", { scenario = "still_air", set = { "camera.sensing" = "measurements" } }'
    plan(tmp_path, 1, "[set]\nflight.duration_s = 0.1", flights)
    command = [sys.executable, "-c", IMPORTS, str(tmp_path / "p.toml")]
    said = subprocess.run(command, capture_output=True, text=True, check=True).stdout.split("\n")
    counted, package = {path.resolve() for path in dockair_files().values()}, Path(dockair.__file__).parent
    imported = {Path(file).resolve() for file in said if file}
    not_counted = {path.relative_to((package / "scenarios").resolve()).as_posix() for path in imported - counted}
    assert len(imported & counted) > 100
    names = {f"campaign/{name}.py" for name in ("draws", "plan", "plan_file", "points")}  # the jobs' keys have that
    assert not_counted == names | {"file_lock.py", "message_log.py", "output_folder.py"}  # a row's flight has no folder


RING = "diameter_m = 0.5\ncount = 8\n"


@pytest.fixture
def own_files(tmp_path):
    """A scenario with a ring of its own, and another ring; returns what a plan says of both."""
    files = tmp_path / "files"
    files.mkdir()
    (files / "own.toml").write_text('name = "own"\nclaim = "mine"\n[hardware]\nring = "ring.toml"\n')
    (files / "ring.toml").write_text(RING)
    (files / "other.toml").write_text(RING + "# another\n")
    return '"files/own.toml", { scenario = "files/own.toml", set.hardware.ring = "files/other.toml" }, "still_air"'


def test_a_row_is_flown_again_from_the_copies_when_ones_own_files_have_gone(here, own_files, tmp_path):
    rows = fly(plan(tmp_path, 1, scenarios=own_files), tmp_path / "out").rows
    shutil.rmtree(tmp_path / "files")
    folder = (tmp_path / "out").rename(tmp_path / "moved") / "scenario_files"
    ring, other = (json.loads(row["sheets"])["hardware.ring"] for row in rows[:2])
    assert {path.name for path in folder.iterdir()} == {"own.toml", f"{ring}.toml", f"{other}.toml"}
    as_written = load_scenario(folder / "own.toml")
    assert as_written.claim == "mine" and scenario_hash(as_written) == rows[0]["scenario_hash"]
    changed = load_scenario(folder / "own.toml", {"hardware.ring": str(folder / f"{other}.toml")})
    assert scenario_hash(changed) == rows[1]["scenario_hash"]


def test_copies_are_of_the_plan_that_is_flown_whatever_was_half_written_before(here, own_files, tmp_path):
    fly(plan(tmp_path, 1, scenarios='"still_air"'), tmp_path / "out")
    folder = tmp_path / "out/scenario_files"
    assert not folder.exists()
    fly(plan(tmp_path, 2, scenarios=own_files), tmp_path / "out")  # it has grown
    before = {path.name: path.read_bytes() for path in folder.iterdir()}
    (folder / "own.toml").unlink()
    (folder / "own.toml.part").write_text("name =")  # killed, and the same command given again
    fly(plan(tmp_path, 3, scenarios=own_files), tmp_path / "out")
    assert {path.name: path.read_bytes() for path in folder.iterdir()} == before
    (tmp_path / "files/own.toml").write_text('name = "own"\n')
    with pytest.raises(DockairError, match="another plan"):
        fly(plan(tmp_path, 3, scenarios=own_files), tmp_path / "out")
    assert {path.name: path.read_bytes() for path in folder.iterdir()} == before
    fly(plan(tmp_path, 1, scenarios='"files/own.toml"'), tmp_path / "out", fresh=True)
    assert {path.name: path.read_text() for path in folder.iterdir()} == {"own.toml": 'name = "own"\n'}


def test_a_scenarios_file_that_changes_while_the_campaign_begins_is_refused_before_a_flight(
    here, own_files, tmp_path, monkeypatch
):
    def edited(jobs):
        (tmp_path / "files/own.toml").write_text('name = "own"\n')
        return code_of(jobs)

    monkeypatch.setattr(run_module, "code_of", edited)
    with pytest.raises(DockairError, match=r"own\.toml: expected a scenario's file that stays as it is"):
        fly(plan(tmp_path, 1, scenarios=own_files), tmp_path / "out")
    assert not lines(here)


#: Never flown: all flights here are made up.
NAVIGATOR = """class Mine:
    def __init__(self, sheets): ...
    def step(self, imu, frame): ...
"""


@pytest.fixture
def own_navigator(fakes, monkeypatch):
    """A module and a package with a navigator each; returns their folder."""
    folder = fakes.parent / "modules"
    (folder / "my_package/parts").mkdir(parents=True)
    files = {
        "my_module.py": NAVIGATOR,
        "my_package/__init__.py": "",
        "my_package/gains.py": "gain = 1\n",
    }
    files |= {"my_package/parts/__init__.py": "", "my_package/parts/navigator.py": NAVIGATOR}
    for name, text in files.items():
        (folder / name).write_text(text)
    importlib.invalidate_caches()
    yield folder
    for name in [name for name in sys.modules if name.partition(".")[0] in ("my_module", "my_package")]:
        del sys.modules[name]


def flown_by(*navigators: str) -> str:
    """Return a plan's scenarios."""
    table = '{{ scenario = "still_air", set = {{ "camera.sensing" = "measurements", "navigation.navigator" = "{}" }} }}'
    return ", ".join(table.format(name) for name in navigators)


@pytest.mark.parametrize(
    ("navigator", "changed"),
    [
        ("my_module:Mine", "my_module.py"),
        ("my_package.parts.navigator:Mine", "my_package/parts/navigator.py"),
        ("my_package.parts.navigator:Mine", "my_package/gains.py"),
    ],
)
def test_a_navigator_of_ones_own_is_part_of_the_code(here, own_navigator, tmp_path, navigator, changed):
    scenarios, path = flown_by(navigator), own_navigator / changed
    fly(plan(tmp_path, 2, scenarios=scenarios), tmp_path / "out")
    assert len(fly(plan(tmp_path, 3, scenarios=scenarios), tmp_path / "out").rows) == 3
    journal, as_it_was = (tmp_path / "out/journal.jsonl").read_bytes(), path.read_text()
    path.write_text(as_it_was + "# other gains\n")
    with pytest.raises(DockairError, match=f"another code of the navigator in {navigator.partition(':')[0]}"):
        fly(plan(tmp_path, 4, scenarios=scenarios), tmp_path / "out")
    assert (tmp_path / "out/journal.jsonl").read_bytes() == journal
    path.write_text(as_it_was)
    assert len(fly(plan(tmp_path, 4, scenarios=scenarios), tmp_path / "out").rows) == 4
    assert len(lines(here)) == 4


def test_another_navigator_may_come_and_one_that_has_not_flown_may_change(here, own_navigator, tmp_path):
    fly(plan(tmp_path, 2, scenarios='"truth_navigation"'), tmp_path / "out")
    both = f'"truth_navigation", {flown_by("my_module:Mine")}'
    (own_navigator / "my_module.py").write_text(NAVIGATOR + "    gain = 2\n")
    assert len(fly(plan(tmp_path, 2, scenarios=both), tmp_path / "out").rows) == 4
    assert list(read_manifest(tmp_path / "out")["plug_ins"]) == ["my_module"]


def test_only_what_is_not_dockairs_is_a_navigator_of_ones_own(own_navigator, tmp_path):
    scenarios = f'"truth_navigation", "still_air", {flown_by("my_module:Mine")}'
    assert [job.plug_in for job in jobs_of(plan(tmp_path, 1, scenarios=scenarios))] == ["", "", "my_module"]
    assert list(plug_in_files("my_module")) == ["my_module.py"]


def test_code_that_changes_meanwhile_ends_the_campaign_and_restored_goes_on(here, own_navigator, tmp_path, monkeypatch):
    import fake_flights

    path, scenarios = own_navigator / "my_module.py", flown_by("my_module:Mine")
    as_it_was, quick = path.read_text(), fake_flights.quick

    def edited(job):
        if job.seed == 2:
            path.write_text(as_it_was.replace("imu", "IMU"))  # as long as before
        return quick(job)

    monkeypatch.setattr(fake_flights, "quick", edited)
    with pytest.raises(DockairError) as refused:
        fly(plan(tmp_path, 5, scenarios=scenarios), tmp_path / "out")
    assert refused.value.exit_code == 2 and "\n" not in str(refused.value)
    assert "--fresh begins anew), got 'a change of my_module.py'" in str(refused.value)
    assert [row["seed"] for row in rows_of(tmp_path / "out")] == [0, 1]  # 2 was flown while it changed
    monkeypatch.setattr(fake_flights, "quick", quick)
    path.write_text(as_it_was)
    assert len(fly(plan(tmp_path, 5, scenarios=scenarios), tmp_path / "out").rows) == 5
    assert [line[-2:] for line in lines(here)] == [":0", ":1", ":2", ":2", ":3", ":4"]


def test_no_process_begins_on_another_code(fakes, tmp_path):
    def changed():
        raise DockairError("--out x", expected="the same code", got="another")

    jobs = jobs_of(plan(tmp_path, 1))
    with Pool(2, 1.0, "fake_flights:quick", changed) as pool, pytest.raises(DockairError, match="the same code"):
        next(pool.done(jobs))
    assert not lines(fakes)


def test_a_change_is_seen_whatever_the_clock_of_the_file_says(tmp_path, monkeypatch):
    monkeypatch.setattr("dockair.scenarios.campaign.code.dockair_files", dict)
    path = tmp_path / "ring.toml"
    path.write_text("a = 1")
    os.utime(path, (1e9, 1e9))
    code = Code(sheets=[str(path)])
    code.require_unchanged("--out x")
    path.write_text("a = 2")
    os.utime(path, (1e9, 1e9))
    with pytest.raises(DockairError, match="a change of .*ring.toml"):
        code.require_unchanged("--out x")
    path.unlink()
    with pytest.raises(DockairError, match="a change of .*ring.toml"):
        code.require_unchanged("--out x")


def test_what_has_not_changed_is_not_read_again(tmp_path, monkeypatch):
    path = tmp_path / "ring.toml"
    path.write_text("a = 1")
    monkeypatch.setattr("dockair.scenarios.campaign.code.dockair_files", dict)
    monkeypatch.setattr("dockair.scenarios.campaign.code._SETTLED_NS", -1)
    code = Code(sheets=[str(path)])
    monkeypatch.setattr(Path, "read_bytes", lambda path: pytest.fail(f"{path} read again"))
    code.require_unchanged("--out x")


def test_the_commit_is_that_of_the_sources_and_none_outside_git(tmp_path, monkeypatch):
    monkeypatch.setattr("dockair.__file__", str(tmp_path / "__init__.py"))
    assert manifest.commit_of_the_code() == (None, None)


def test_an_error_is_a_row_and_is_flown_again_only_when_asked(here, tmp_path):
    first = fly(plan(tmp_path, 2), tmp_path / "out", "deadly")
    assert [(row["outcome"], row["error"], row["success"]) for row in first.rows] == [
        ("miss", "", False),
        ("error", "ValueError: no way", False),
    ]
    again = fly(plan(tmp_path, 2), tmp_path / "out", "quick")
    assert again.rows == first.rows
    mended = fly(plan(tmp_path, 2), tmp_path / "out", "quick", retry_errors=True)
    assert [row["error"] for row in mended.rows] == ["", ""]
    assert [key[-2:] for key in lines(here)] == [":0", ":1"]


def test_drawn_keys_are_columns_with_their_own_type(here, tmp_path):
    more = (
        'sampler = "grid"\n[draw."start.aft_m"]\nvalues = [3, 4.5]\n[draw."hardware.imu"]\nvalues = ["mti", "tactical"]'
    )
    fly(plan(tmp_path, 1, more), tmp_path / "out")
    rows = read_table(tmp_path / "out")
    assert [(row["set.start.aft_m"], row["set.hardware.imu"]) for row in rows] == [
        (3.0, "mti"),
        (3.0, "tactical"),
        (4.5, "mti"),
        (4.5, "tactical"),
    ]


@pytest.mark.parametrize("number", [errno.ENOSPC, errno.EDQUOT])
def test_a_full_disk_is_one_line_and_the_earlier_rows_stay(here, tmp_path, monkeypatch, number):
    real = os.write

    def write(file, data):
        if b'"seed": 2' in data:
            real(file, data[:20])  # what still fits
            raise OSError(number, os.strerror(number))
        return real(file, data)

    monkeypatch.setattr(os, "write", write)
    with pytest.raises(MachineError, match="expected room to write; make some .* 2 flights are kept"):
        fly(plan(tmp_path), tmp_path / "out")
    monkeypatch.undo()
    assert [row["seed"] for row in rows_of(tmp_path / "out")] == [0, 1]
    assert (tmp_path / "out/journal.jsonl").read_bytes().endswith(b"\n")


@pytest.mark.parametrize(
    ("number", "kind", "said"),
    [
        (errno.ENOSPC, MachineError, "file: expected room to write; make some .* is kept"),
        (errno.EIO, OSError, "Input/output"),
    ],
)
def test_a_file_is_written_whole_or_stays_as_it_was(tmp_path, monkeypatch, number, kind, said):
    path = tmp_path / "file"
    write_whole(path, b"before")

    def fails(file):
        raise OSError(number, os.strerror(number))

    monkeypatch.setattr(os, "fsync", fails)
    with pytest.raises(kind, match=said):
        write_whole(path, b"after")
    assert path.read_bytes() == b"before"
    assert [found.name for found in tmp_path.iterdir()] == ["file"]


def test_one_campaign_at_a_time_writes_a_folder(here, tmp_path):
    (tmp_path / "out").mkdir()
    with Journal(tmp_path / "out"), pytest.raises(DockairError, match="expected a folder in which no campaign is runn"):
        fly(plan(tmp_path), tmp_path / "out")
    assert len(fly(plan(tmp_path), tmp_path / "out").rows) == 4


@pytest.mark.parametrize("replaced", [False, True])
def test_a_folder_that_is_moved_meanwhile_ends_the_campaign_and_in_its_place_it_goes_on(here, tmp_path, replaced):
    out, elsewhere = tmp_path / "out", tmp_path / "elsewhere"

    def watch(jobs, done):
        def told(row, wall_time_s):
            if row is not None and row["seed"] == 1:
                out.rename(elsewhere)
                if replaced:
                    out.mkdir()
                    (out / "journal.jsonl").touch()

        return told

    with pytest.raises(DockairError, match=r"journal\.jsonl: expected the journal to stay where the campaign began"):
        fly(plan(tmp_path), out, watch=watch)
    assert [row["seed"] for row in rows_of(elsewhere)] == [0, 1, 2]
    assert len(fly(plan(tmp_path), elsewhere).rows) == 4
    assert len(lines(here)) == 4


def test_other_peoples_files_are_refused_untouched(here, tmp_path):
    folder = tmp_path / "thesis"
    folder.mkdir()
    (folder / "thesis.tex").write_text("mine")
    for options in ({}, {"fresh": True}):
        with pytest.raises(DockairError, match="got 'a folder with thesis.tex'"):
            fly(plan(tmp_path), folder, **options)
    with pytest.raises(DockairError, match="got 'a file'"):
        fly(plan(tmp_path), folder / "thesis.tex")
    assert [path.name for path in folder.iterdir()] == ["thesis.tex"]


@pytest.mark.parametrize(
    ("files", "got"),
    [
        ({"main.js": "x", "manifest.json": '{"name": "an extension"}', "summary.json": "{}"}, "main.js"),
        ({"manifest.json": '{"name": "an extension"}'}, "manifest.json"),
        ({"flights.parquet": "departures"}, "flights.parquet"),
        ({"journal.jsonl": '{"entry": "dear diary"}'}, "another journal.jsonl"),
        ({"journal.jsonl": '{"entry": "dear diary"}\n', "manifest.json": "{}"}, "another journal.jsonl"),
    ],
)
def test_a_name_that_others_use_too_makes_no_campaign(here, tmp_path, files, got):
    folder = tmp_path / "theirs"
    folder.mkdir()
    for name, text in files.items():
        (folder / name).write_text(text)
    for options in ({}, {"fresh": True}):
        with pytest.raises(DockairError, match=f"got 'a folder with {got}'"):
            fly(plan(tmp_path), folder, **options)
    assert {path.name: path.read_text() for path in folder.iterdir()} == files


def test_a_folder_whose_name_is_no_utf8_takes_a_campaign(here, tmp_path):
    out = tmp_path / os.fsdecode(b"\xff")
    assert fly(plan(tmp_path), out).rows == rows_of(out)


def test_what_one_campaign_is_writing_no_other_removes(here, tmp_path):
    fly(plan(tmp_path), tmp_path / "out")
    part = tmp_path / "out/flights.parquet.part"
    with Journal(tmp_path / "out"):
        part.write_text("half")
        for options in ({}, {"fresh": True}):
            with pytest.raises(DockairError, match="another process at work"):
                fly(plan(tmp_path), tmp_path / "out", **options)
        assert part.read_text() == "half"
    fly(plan(tmp_path), tmp_path / "out")
    assert not part.exists()


@pytest.mark.parametrize("torn", [b"", b"\0" * 40, b'{"ke'])
def test_a_campaign_that_ended_in_its_first_line_begins_again(here, tmp_path, torn):
    (tmp_path / "out").mkdir()
    (tmp_path / "out/journal.jsonl").write_bytes(torn)
    assert len(fly(plan(tmp_path), tmp_path / "out").rows) == 4


def stopped(source: PlanFile, out: Path, after: int, flight: str = "quick", **options) -> None:
    """Run a campaign that somebody stops after some flights."""

    def watch(jobs, entries):
        flown = iter(range(1, after))

        def told(row, wall_time_s):
            if next(flown, None) is None:
                raise KeyboardInterrupt

        return told

    with pytest.raises(KeyboardInterrupt):
        fly(source, out, flight, watch=watch, **options)


def results(out: Path) -> set[str]:
    return {"flights.parquet", "summary.json", "timing.json"} & {path.name for path in out.iterdir()}


def test_while_a_campaign_grows_its_rows_are_those_that_are_done(here, tmp_path):
    fly(plan(tmp_path, 2), tmp_path / "out")
    assert len(results(tmp_path / "out")) == 3
    stopped(plan(tmp_path, 9), tmp_path / "out", 4)
    assert read_manifest(tmp_path / "out")["flights"] == 9
    assert [row["seed"] for row in rows_of(tmp_path / "out")] == [0, 1, 2, 3, 4, 5]
    assert not results(tmp_path / "out")
    assert len(fly(plan(tmp_path, 9), tmp_path / "out").rows) == 9
    assert len(results(tmp_path / "out")) == 3


def test_a_report_goes_when_more_is_flown_and_the_manifest_is_the_first_runs(here, tmp_path, monkeypatch):
    out = tmp_path / "out"
    fly(plan(tmp_path, 2), out)
    (out / "report.html").write_text("of two flights")
    first = read_manifest(out)
    assert f"({manifest.get_host_cpu_name()})" in first["machine"]  # on another processor rows need not be the same
    monkeypatch.setattr(manifest, "commit_of_the_code", lambda: ("another", True))
    monkeypatch.setattr(manifest.platform, "machine", lambda: "another")
    fly(plan(tmp_path, 2), out)
    assert (out / "report.html").exists() and read_manifest(out) == first
    fly(plan(tmp_path, 3), out)
    last = read_manifest(out)
    assert not (out / "report.html").exists() and last["flights"] == 3
    assert all(last[key] == first[key] for key in ("commit", "uncommitted_changes", "machine", "begun"))


def test_while_errors_are_flown_again_the_rows_are_the_newer_ones(here, tmp_path):
    fly(plan(tmp_path, 3), tmp_path / "out", "never")
    assert [bool(row["error"]) for row in rows_of(tmp_path / "out")] == [True] * 3
    stopped(plan(tmp_path, 3), tmp_path / "out", 2, retry_errors=True)
    assert [bool(row["error"]) for row in rows_of(tmp_path / "out")] == [False, False, True]


def test_a_fresh_campaign_never_shows_the_rows_of_the_one_before(here, tmp_path, monkeypatch):
    fly(plan(tmp_path, 2), tmp_path / "out")

    def killed(journal):
        assert not results(tmp_path / "out")  # they go before the rows that they are of
        raise KeyboardInterrupt

    monkeypatch.setattr(Journal, "clear", killed)
    with pytest.raises(KeyboardInterrupt):
        fly(plan(tmp_path, 9), tmp_path / "out", fresh=True)
    assert len(rows_of(tmp_path / "out")) == read_manifest(tmp_path / "out")["flights"] == 2


def test_a_folder_that_cannot_be_written_is_refused(here, tmp_path):
    with pytest.raises(DockairError, match="--out /proc/campaign: expected a folder that can be written"):
        fly(plan(tmp_path), Path("/proc/campaign"))


def test_a_journal_without_its_manifest_is_refused(here, tmp_path):
    fly(plan(tmp_path), tmp_path / "out")
    (tmp_path / "out/manifest.json").unlink()
    with pytest.raises(DockairError, match=r"expected manifest.json beside journal.jsonl"):
        fly(plan(tmp_path), tmp_path / "out")


def test_a_gate_that_could_not_fail_is_refused_before_anything_is_flown(here, tmp_path):
    with pytest.raises(DockairError, match=r"p.toml: gate.success_rate: expected 7 flights or more"):
        fly(plan(tmp_path, 6, "[gate]\nsuccess_rate = 0.65"), tmp_path / "out")
    assert not (tmp_path / "out").exists()


@pytest.fixture
def command(monkeypatch, capfd, fakes, tmp_path):
    """Run `dockair campaign` on fake flights; return its exit status, stdout and stderr."""
    monkeypatch.chdir(tmp_path)
    real = run_module.run
    monkeypatch.setattr(run_module, "run", lambda *a, **k: real(*a, **k, flight="fake_flights:quick"))

    def command(*arguments: str) -> tuple[int, str, str]:
        monkeypatch.setattr(sys, "argv", ["dockair", "campaign", *arguments])
        with pytest.raises(SystemExit) as ended:
            cli.main()
        said = capfd.readouterr()
        return ended.value.code, said.out, said.err

    return command


def test_the_exit_status_is_that_of_the_gate_and_json_is_one_object(command, here, tmp_path):
    plan(tmp_path, 12)
    status, out, _ = command("p.toml", "--json", "--workers", "1")
    assert (status, json.loads(out)["groups"][0]["success"]["count"]) == (0, 8)
    assert (tmp_path / "out/campaigns/p/summary.json").is_file()
    plan(tmp_path, 12, "[gate]\nsuccess_rate = 0.99")
    status, out, _ = command("p.toml", "--workers", "1")
    assert status == 1
    assert "gate failed: truth_navigation: perfect navigation" in out
    plan(tmp_path, 12, "[gate]\nsuccess_rate = 0.7")
    assert command("p.toml")[0] == 0


def test_a_dry_run_says_what_would_be_flown_and_writes_nothing(command, here, tmp_path):
    drawn = '[draw."turbulence.sigma_m_s"]\nlow = 0.1\nhigh = 0.4'
    plan(tmp_path, 3, drawn, '{ scenario = "truth_navigation", seeds = 2 }, "default"')
    status, out, err = command("p.toml", "--dry-run", "--json")
    said = json.loads(out)
    assert (status, err, said["flights"], said["done"], sorted(tmp_path.glob("out"))) == (0, "", 5, 0, [])
    counts = {(group["scenario"], group["settings"]): (group["flights"], group["done"]) for group in said["groups"]}
    drawn_key = "turbulence.sigma_m_s drawn"
    assert counts == {("default", drawn_key): (3, 0), ("truth_navigation", drawn_key): (2, 0)}
    assert said["commands"][0].startswith("dockair fly truth_navigation --seed 0 --set turbulence.sigma_m_s=0.")
    assert command("p.toml")[0] == 0
    plan(tmp_path, 4, drawn, '"default"')
    status, _, err = command("p.toml", "--dry-run")  # other draws of four
    assert status == 2 and "another plan: 5 of 5 flights that are done are not part of it" in err
    plan(tmp_path, 4)
    command("p.toml", "--fresh")
    plan(tmp_path, 6)
    assert "2 of 6 flights would be flown" in command("p.toml", "--dry-run")[1]
    assert command("p.toml", "--dry-run", "--set", "start.aft=1")[0] == 2
    assert "4 of 4 flights would be flown" in command("p.toml", "--dry-run", "--seeds", "4", "--fresh")[1]


def test_settings_too_long_for_a_cell_stand_once_under_the_table(command, here, tmp_path):
    faults = {
        '"faults"': '[{ kind = "led_off", leds = [0, 1, 2], start_s = 1.0, stop_s = 2.0 }]',
        '"start.aft_m"': "5.0",
    }
    changed = f"set = {{ {', '.join(f'{key} = {value}' for key, value in faults.items())} }}"
    scenarios = (
        f'"truth_navigation", {{ scenario = "truth_navigation", {changed} }}, {{ scenario = "default", {changed} }}'
    )
    plan(tmp_path, 1, "", scenarios)
    for arguments in (["--dry-run"], []):
        status, out, _ = command("p.toml", *arguments)
        (below,) = (line for line in out.splitlines() if "leds" in line)
        assert status == 0 and below.startswith("  (1) faults=[") and below.endswith(", start.aft_m=5.0")
        rows = [line for line in out.splitlines() if line.startswith((" truth_navigation", " default"))]
        assert sorted(line.rstrip().endswith(" (1)") for line in rows) == [False, True, True]


def test_a_dry_run_counts_errors_as_done_unless_they_are_to_be_tried_again(here, tmp_path):
    source = plan(tmp_path, 3)
    fly(source, tmp_path / "out", "never")
    done = [dry_run(source, tmp_path / "out", retry_errors=again).groups[0]["done"] for again in (False, True)]
    assert done == [3, 0]


def test_flights_that_are_done_are_told_as_the_plan_says_them_now(here, tmp_path):
    """The same setting as the scenario's file has, written out later: one group, of all the flights."""
    fly(plan(tmp_path, 2, "", '"light_gusts"'), tmp_path / "out")
    grown = plan(tmp_path, 4, '[set]\n"turbulence.intensity" = "light"', '"light_gusts"')
    over = fly(grown, tmp_path / "out")
    assert len(lines(here)) == 4
    assert [group["flights"] for group in over.groups] == [4]
    assert {"turbulence.intensity" in row["command"] for row in read_table(tmp_path / "out")} == {True}


@pytest.mark.parametrize(
    "entries",
    [
        """{ scenario = "default", set = { turbulence.sigma_m_s = 0.2, turbulence.intensity = "severe" } },
           { scenario = "default", set = { turbulence.intensity = "severe", turbulence.sigma_m_s = 0.2 } }""",
        """{ scenario = "default", set = { navigation.navigator = "truth" } },
           { scenario = "default", set = { navigation.navigator = "truth", camera.sensing = "measurements" } }""",
    ],
)
def test_flights_that_would_be_counted_together_and_are_not_alike_are_refused_before_any_is_flown(
    here, tmp_path, entries
):
    with pytest.raises(DockairError, match=r"p\.toml: scenarios: expected settings that differ in more than"):
        fly(plan(tmp_path, 2, "", entries), tmp_path / "out")
    assert lines(here) == [] and not (tmp_path / "out").exists()


def test_a_process_that_flies_does_not_hear_of_ctrl_c_from_its_first_moment(fakes):
    """While it imports what it needs, too: the signal goes to the whole group, and is for us alone."""
    before = signal.pthread_sigmask(signal.SIG_BLOCK, ())
    worker = pool_module._Worker("fake_flights:quick")
    try:
        status = Path(f"/proc/{worker.process.pid}/status").read_text()
    finally:
        worker.end(at_once=True)
    (blocked,) = (line.split()[1] for line in status.splitlines() if line.startswith("SigBlk"))
    assert int(blocked, 16) & 1 << signal.SIGINT - 1
    assert signal.pthread_sigmask(signal.SIG_BLOCK, ()) == before


def test_flights_with_other_settings_are_told_apart_while_they_are_flown(here, tmp_path):
    source = plan(tmp_path, 2, "", '"default", { scenario = "default", set = { "guidance.hold_s" = 2.0 } }')
    console = Console(file=io.StringIO(), width=200)
    progress = CampaignProgress(console)
    fly(source, tmp_path / "out", watch=progress.begin)
    said = progress._rates()
    assert said.count("1 of 2 docked") == 2
    assert "default with guidance.hold_s=2.0 (camera, predictive)" in said


def test_without_a_plan_the_packaged_ones_are_listed_with_their_claims(command):
    status, out, _ = command("--json")
    assert status == 0
    assert {"ci", "levels", "levels_truth", "levels_fast", "library"} <= json.loads(out)["plans"].keys()
    assert "by camera in light, moderate and severe" in command()[1]


def test_claims_are_judged_where_the_plan_changes_nothing_of_the_scenario(here, tmp_path):
    claimed = fly(plan(tmp_path, 3), tmp_path / "out").groups[0]["shortfalls"]
    assert any("2 of 3" in line for line in claimed)
    assert fly(plan(tmp_path, 3, "[set]\nguidance.hold_s = 1.0"), tmp_path / "b").groups[0]["shortfalls"] is None


def test_mistakes_are_one_line_and_status_two(command, here, tmp_path):
    long = ("p.toml", "--out", "n" * 300)
    mistakes = [("no_such_plan",), ("p.toml", "--set", "start.aft=1"), ("p.toml", "--out", "p.toml"), long]
    for arguments in mistakes:
        plan(tmp_path)
        status, out, err = command(*arguments)
        assert (status, out) == (2, "")
        assert err.startswith("dockair: ") and err.count("\n") == 1


def test_whatever_an_error_says_is_said_as_it_is(command, here, tmp_path, monkeypatch):
    """What looks like markup would be swallowed, or raise."""
    import fake_flights

    said = "OSError: no sheet in [/opt/sheets], [hose] [/]"

    def fails(job):
        raise OSError(said.partition(": ")[2])

    monkeypatch.setattr(fake_flights, "quick", fails)
    plan(tmp_path, 1)
    status, out, err = command("p.toml", "--out", "[hose]")
    assert status == 0
    assert f"truth_navigation, seed 0: {said}" in err
    assert "  [hose]\n" in out


def test_what_no_terminal_and_no_page_shows_of_an_error_is_escaped():
    assert one_line(ValueError("red \x1b[31m\n nothing \0 half \udce9 ä")) == (
        r"ValueError: red \x1b[31m nothing \x00 half \udce9 ä"
    )


def test_a_plans_name_that_is_too_long_for_a_folder_is_one_line(command, here, tmp_path):
    path = tmp_path / "p.toml"
    path.write_text(f'name = "{"n" * 300}"\nscenarios = ["truth_navigation"]')
    status, out, err = command("p.toml")
    assert (status, out, err.count("\n")) == (2, "", 1)
    assert "expected a folder that can be written, got 'File name too long'" in err
    assert command("p.toml", "--dry-run")[0] == 2


def test_a_reason_of_the_gate_is_printed_as_it_is(capsys):
    show_campaign({"groups": [], "gate": {"passed": False, "reasons": ["[/] of [hose]"]}, "folder": "out"})
    assert "gate failed: [/] of [hose]" in capsys.readouterr().out


def test_a_narrow_terminal_wraps_the_table_and_cuts_nothing_off(here, tmp_path, capsys, monkeypatch):
    over = fly(plan(tmp_path, 6), tmp_path / "out")
    narrow = Console(width=40, force_terminal=True, highlight=False, markup=False)
    monkeypatch.setattr("dockair.scenarios.campaign.progress.plain_console", lambda: narrow)
    capsys.readouterr()
    show_campaign(over.to_dict())
    shown = capsys.readouterr().out
    assert "first attempt" in shown and "errors" in shown and "\u2026" not in shown


def test_none_unsafe_is_told_as_a_number(here, tmp_path, capsys):
    """Two of six flights miss; none is unsafe, none an error."""
    over = fly(plan(tmp_path, 6), tmp_path / "out")
    capsys.readouterr()
    show_campaign(over.to_dict())
    heading, row, *_ = capsys.readouterr().out.splitlines()
    assert heading.split()[-2:] == ["unsafe", "errors"] and row.split()[-2:] == ["0", "0"]


@pytest.mark.parametrize(
    ("crews", "named"),
    [
        ([{"navigator": "mine:Mine"}], {"mine:Mine"}),
        ([{"controller": "pid"}], {"pid"}),
        ([{"controller": "pid"}, {}], {"pid", "predictive"}),
        ([{}], set()),
        ([{"navigator": "truth"}], set()),
    ],
)
def test_who_flies_is_named_where_it_is_not_the_usual_crew_or_not_the_same_everywhere(
    here, tmp_path, capsys, crews, named
):
    over = fly(plan(tmp_path, 2, "", '"default"'), tmp_path / "out").to_dict()
    capsys.readouterr()
    show_campaign(over | {"groups": [over["groups"][0] | crew for crew in crews]})
    shown = set(capsys.readouterr().out.split())
    assert shown & {"mine:Mine", "pid", "predictive", "dockair.nav.navigator:Navigator"} == named


def test_a_report_made_while_a_campaign_runs_is_not_left_beside_the_rows_of_all_flights(here, tmp_path):
    page = tmp_path / "out/report.html"
    fly(plan(tmp_path), tmp_path / "out", watch=lambda jobs, entries: lambda row, wall_s: page.write_text("of fewer"))
    assert not page.exists() and read_table(tmp_path / "out")


def test_intervals_of_flights_that_share_a_seed_are_marked_as_too_narrow(here, tmp_path, capsys):
    over = fly(plan(tmp_path, 2), tmp_path / "out").to_dict()
    for independent, marks in ((True, 0), (False, 4)):  # three rates, and what the mark means
        capsys.readouterr()
        show_campaign(over | {"groups": [group | {"independent": independent} for group in over["groups"]]})
        shown = capsys.readouterr().out
        assert shown.count("\N{DAGGER}") == marks and ("too narrow" in shown) == (not independent)


def test_flights_that_are_flown_again_count_once(here, tmp_path):
    fly(plan(tmp_path, 4), tmp_path / "out", "never")
    text = io.StringIO()
    progress = CampaignProgress(Console(file=text, width=200))
    fly(plan(tmp_path, 4), tmp_path / "out", watch=progress.begin, retry_errors=True)
    bars = {task.description: (task.completed, task.total) for task in progress._bars.tasks}
    assert bars == {"truth_navigation (truth, predictive)": (4, 4), "all": (4, 4)}
    assert progress._pace().endswith(" 0 s left")
    assert "2 of 4 docked" in progress._rates()
    assert "were done before" not in text.getvalue()


def test_on_a_terminal_of_eighty_columns_a_long_name_leaves_room_for_the_pace(tmp_path):
    settings = '"guidance.hold_s" = 2.0, "parameters.as_built.led_position_sigma_m" = 0.001'
    flown = f'{{ scenario = "default", set = {{ {settings} }} }}'
    text = io.StringIO()
    progress = CampaignProgress(Console(file=text, width=80, force_terminal=True))
    progress.begin(jobs_of(plan(tmp_path, 400, "", flown)), {})
    progress._bars.stop()
    progress._bars.update(progress._overall, said="11.4 a minute, 12 h 35 min left, 12 errors")
    progress._bars.console.print(progress._bars.get_renderable())
    (line,) = [line for line in text.getvalue().splitlines() if "a minute" in line]
    assert line.startswith("all") and "12 errors" in line


def test_before_the_first_flight_is_done_a_log_says_just_that(tmp_path, monkeypatch):
    monkeypatch.setattr("dockair.scenarios.campaign.progress._LINE_INTERVAL_S", 0.0)
    text = io.StringIO()
    with CampaignProgress(Console(file=text, width=200)) as progress:
        progress.begin(jobs_of(plan(tmp_path, 4)), {})
        progress(None, 0.0)
    assert text.getvalue() == "0 of 4 flights, none done yet\n"


def test_the_pace_is_that_of_this_run_and_what_is_left_is_what_no_run_has_flown(monkeypatch):
    """Of 100 flights 40 were done before and 10 in these two minutes: five a minute, 50 left."""
    clock = SimpleNamespace(monotonic=lambda: 1000.0)
    monkeypatch.setattr("dockair.scenarios.campaign.progress.time", clock)
    progress = CampaignProgress(Console(file=io.StringIO()))
    progress._total, progress._earlier, progress._now = 100, 40, 10
    clock.monotonic = lambda: 1120.0
    assert progress._pace() == "5.0 a minute, 10 min 0 s left"
    progress._errors = 2
    assert progress._pace() == "5.0 a minute, 10 min 0 s left, 2 errors"
    progress._errors = 1
    assert progress._pace().endswith("left, 1 error")


@pytest.mark.parametrize(
    ("seconds", "said"),
    [(0.4, "0 s"), (59.4, "59 s"), (59.6, "1 min 0 s"), (3599.4, "59 min 59 s"), (3599.6, "1 h 0 min"),
     (5400.0, "1 h 30 min"), (86400.0, "24 h 0 min")],
)  # fmt: skip
def test_what_is_left_is_said_in_seconds_below_an_hour_and_in_minutes_beyond(seconds, said):
    assert _in_words(seconds) == said


def test_a_rate_is_said_with_the_lower_end_of_its_interval_first():
    assert docked(9, 10) == "9 of 10 docked (60-98 %)"


def test_the_samplers_of_the_command_line_are_those_of_the_plan():
    from typing import get_args

    from dockair.scenarios.campaign.draws import SamplerName

    assert [member.value for member in campaign_command.Sampler] == list(get_args(SamplerName))


@pytest.fixture
def eight_are_done_first(fakes, tmp_path, monkeypatch):
    """A clock for the pool that stands still until one flight of nine sleeps and all others are done."""
    asleep, journal, seconds = Path(f"{fakes}.asleep"), tmp_path / "out/journal.jsonl", count()

    def monotonic():
        return float(next(seconds)) if asleep.exists() and len(lines(journal)) == 8 else 0.0

    monkeypatch.setattr(pool_module, "time", SimpleNamespace(monotonic=monotonic))


@pytest.mark.slow
@pytest.mark.usefixtures("eight_are_done_first")
def test_a_flight_that_breaks_its_process_is_a_row_and_not_the_end(tmp_path, capfd):
    rows = fly(plan(tmp_path, 9, "timeout_s = 1.5"), tmp_path / "out", "deadly").rows
    assert [row["error"] for row in rows] == [
        "",
        "ValueError: no way",
        "process ended by SIGSEGV, 2 times",
        "process ended by SIGKILL, as when memory runs out, 2 times",
        "no result within 1.5 s",
        "SystemExit: 3",
        "process ended with status 7, 2 times",
        "",
        "",
    ]
    assert "said on stdout" not in capfd.readouterr().out
    assert [row["outcome"] for row in read_table(tmp_path / "out")].count("error") == 6
    journal = [json.loads(line) for line in lines(tmp_path / "out/journal.jsonl")]
    assert sum("raise ValueError" in entry.get("traceback", "") for entry in journal) == 1


@pytest.mark.parametrize("number", [signal.SIGRTMIN, signal.SIGRTMIN + 3, signal.SIGTERM])
def test_a_process_that_ends_by_any_signal_is_an_error_that_says_which(number):
    said = pool_module._how_it_died(-number)
    assert said.endswith(", 2 times")
    assert str(int(number)) in said or signal.Signals(number).name in said


@pytest.mark.slow
def test_a_process_that_dies_once_is_no_error(fakes, tmp_path):
    assert [row["error"] for row in fly(plan(tmp_path, 1), tmp_path / "out", "mortal_once").rows] == [""]


@pytest.mark.slow
def test_a_process_flies_so_many_and_another_goes_on(fakes, tmp_path, monkeypatch):
    monkeypatch.setattr("dockair.scenarios.campaign.pool.FLIGHTS_OF_A_PROCESS", 2)
    flown = Counter(row["frames"] for row in fly(plan(tmp_path, 6), tmp_path / "out", "who").rows)
    assert len(flown) >= 3 and max(flown.values()) <= 2


@pytest.mark.slow
def test_a_function_that_cannot_be_imported_is_said_once(fakes, tmp_path):
    with pytest.raises(DockairError, match="expected a function that flies an order, got 'fake_flights:none"):
        fly(plan(tmp_path, 50), tmp_path / "out", "none")


#: Imports once, then runs the campaign in a child for each line it reads; the child leads a process group of its own.
SERVER = """
import os, sys
from pathlib import Path
from dockair.scenarios.campaign import code
from dockair.scenarios.campaign.plan_file import PlanFile
from dockair.scenarios.campaign.run import run

if __name__ == "__main__":
    code.dockair_files = dict
    for line in sys.stdin:
        child = os.fork()
        if child == 0:
            os.setpgid(0, 0)
            run(PlanFile(sys.argv[1]), Path(sys.argv[2]), workers=2, flight=sys.argv[3])
            os._exit(0)
        print(child, flush=True)
        print(os.waitpid(child, 0)[1], flush=True)
"""


@pytest.mark.slow
@pytest.mark.timeout(900)  # eleven campaigns begin, each in new processes: a loaded machine is slow at that
def test_a_campaign_killed_ten_times_at_random_makes_the_table_of_an_undisturbed_one(fakes, tmp_path):
    seeds, kills, out = 80, 10, tmp_path / "out"
    source = plan(tmp_path, seeds, scenarios='"truth_navigation", "still_air"')
    (tmp_path / "server.py").write_text(SERVER)
    command = [sys.executable, str(tmp_path / "server.py"), str(tmp_path / "p.toml"), str(out), "fake_flights:quick"]
    chance = random.Random(11)
    with subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True) as server:
        assert server.stdin is not None and server.stdout is not None
        for kill in range(kills):
            server.stdin.write("go\n")
            server.stdin.flush()
            child = int(server.stdout.readline())
            wanted = len(lines(out / "journal.jsonl")) + chance.randrange(15)  # 160 flights outlast ten times 14
            while len(lines(out / "journal.jsonl")) < wanted:
                time.sleep(0.001)
            time.sleep(chance.uniform(0.0, 0.03))
            os.killpg(child, signal.SIGKILL) if kill % 2 else os.kill(child, signal.SIGKILL)
            assert int(server.stdout.readline()) == signal.SIGKILL
        server.stdin.write("go\n")
        server.stdin.close()
        server.stdout.readline()
        assert int(server.stdout.readline()) == 0
    undisturbed = fly(source, tmp_path / "whole")
    assert (out / "flights.parquet").read_bytes() == (tmp_path / "whole/flights.parquet").read_bytes()
    keys = [json.loads(line)["key"] for line in lines(out / "journal.jsonl")]
    assert len(keys) == len(set(keys)) == 2 * seeds == len(undisturbed.rows)


@pytest.mark.slow
def test_when_a_campaign_is_killed_its_processes_end_in_the_middle_of_their_flights(fakes, tmp_path):
    plan(tmp_path, 1)
    (tmp_path / "server.py").write_text(SERVER)
    command = [sys.executable, str(tmp_path / "server.py"), str(tmp_path / "p.toml"), str(tmp_path / "out")]
    with subprocess.Popen([*command, "fake_flights:sleeper"], stdin=subprocess.PIPE, stdout=subprocess.PIPE) as server:
        assert server.stdin is not None and server.stdout is not None
        server.stdin.write(b"go\n")
        server.stdin.close()
        child = int(server.stdout.readline())
        while not lines(fakes):
            time.sleep(0.01)
        os.kill(child, signal.SIGKILL)
        server.stdout.readline()
        asleep = Path("/proc") / lines(fakes)[0]
        for _ in range(1000):
            if not asleep.exists() or "\nState:\tZ" in (asleep / "status").read_text():
                return
            time.sleep(0.01)
    pytest.fail("it sleeps on")


def test_a_dry_run_refuses_the_folder_that_the_campaign_would_refuse(here, tmp_path):
    fly(plan(tmp_path, 3), tmp_path / "out")
    smaller = plan(tmp_path, 2)
    for ask in (partial(dry_run, smaller, tmp_path / "out"), partial(fly, smaller, tmp_path / "out")):
        with pytest.raises(DockairError, match=r"another plan: 1 of 3 flights that are done are not part of it"):
            ask()
    assert dry_run(smaller, tmp_path / "out", fresh=True).groups[0]["done"] == 0
