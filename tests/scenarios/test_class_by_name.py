"""A class named by its file, and a navigator that is: where its path is taken from, and what is shown of it."""

import os
import re
import subprocess
import sys

import pytest

from dockair.errors import DockairError
from dockair.scenarios import class_by_name
from dockair.scenarios.assembly.buildable import require_buildable
from dockair.scenarios.campaign.code import code_of
from dockair.scenarios.campaign.jobs import jobs_of
from dockair.scenarios.campaign.plan_file import PlanFile
from dockair.scenarios.campaign.row import unflown
from dockair.scenarios.class_by_name import by_module, import_by_name
from dockair.scenarios.loop import fly
from dockair.scenarios.navigator_recipe import NAVIGATOR, code_fingerprint
from dockair.scenarios.replay import replay
from dockair.scenarios.report.groups import groups_of
from dockair.scenarios.scenario_file import text_from
from dockair.scenarios.scenario_hash import file_hash, scenario_hash
from dockair.scenarios.schema import load_scenario

OWN = """from gains_of_mine import GAIN
from dockair.nav.navigator import Navigator

class Own:
    def __init__(self, sheets):
        self.ours = Navigator(sheets)
    def step(self, imu, frame):
        return self.ours.step(imu, frame)
"""
KEY = "navigation.navigator"


@pytest.fixture(autouse=True)
def imports(monkeypatch):
    """Modules and paths of imports as they were, afterwards."""
    monkeypatch.setattr(sys, "path", list(sys.path))
    monkeypatch.setattr(class_by_name, "_BY_FILE", set())
    yield
    for name in ("navigator_of_mine", "another_of_mine", "gains_of_mine", "mine_too"):
        sys.modules.pop(name, None)


@pytest.fixture
def beside(tmp_path):
    """A folder with a navigator, what it imports, and a scenario that names it."""
    folder = tmp_path / "project"
    folder.mkdir()
    (folder / "navigator_of_mine.py").write_text(OWN)
    (folder / "gains_of_mine.py").write_text("GAIN = 1.0")
    (folder / "mine.toml").write_text('name = "mine"\n[navigation]\nnavigator = "navigator_of_mine.py:Own"\n')
    return folder


def plan(folder, scenarios: str, name: str = "p.toml") -> PlanFile:
    (folder / name).write_text(f'name = "p"\nscenarios = [{scenarios}]\nset.flight.duration_s = 0.1\n')
    return PlanFile(folder / name)


def test_a_class_is_found_by_its_file_with_what_lies_beside_it_first(beside, monkeypatch):
    monkeypatch.chdir(beside)
    (beside.parent / "gains_of_mine.py").write_text("raise SystemExit")
    sys.path.insert(0, str(beside.parent))
    found = import_by_name("navigator_of_mine.py:Own")
    assert found.__module__ == "navigator_of_mine" and import_by_name(f"{beside}/navigator_of_mine.py:Own") is found
    assert by_module("../a/b.py:Own") == "b:Own" and by_module("a.b:Own") == "a.b:Own"


@pytest.mark.parametrize(
    ("name", "text", "said"),
    [
        ("none.py:Own", None, "expected the path of a Python file, got 'none.py, where no file is'"),
        ("my-own.py:Own", OWN, "expected a file that is named as a module may be: of letters, digits and _, got 'my"),
        ("else.py:Own", "", "expected a file that is named as a module may be"),
        ("mine_too.py:Other", OWN, "a class in mine_too.py, got \"module 'mine_too' has no attribute 'Other'"),
        ("mine_too.py:Own", "1 / 0", r"a class in mine_too.py, got 'ZeroDivisionError: .*mine_too.py, line 1\)"),
        ("mine_too.py:Own", "import no_such", "got \"ModuleNotFoundError: No module named 'no_such'"),
        ("json.py:Own", OWN, "a file of another name: .* one module json, got 'json imported from"),
        ("sys.py:Own", OWN, "one module sys, got 'sys imported from Python itself before'"),
    ],
)
def test_a_file_that_does_not_do_is_refused_in_one_line(beside, monkeypatch, name, text, said):
    monkeypatch.chdir(beside)
    if text is not None:
        (beside / name.partition(":")[0]).write_text(text)
    with pytest.raises(DockairError, match=said) as refused:
        import_by_name(name)
    assert "\n" not in str(refused.value)


def test_neither_a_second_file_of_a_name_nor_what_lies_beside_it_is_taken_for_the_first(beside, tmp_path):
    other = tmp_path / "other"
    other.mkdir()
    for name in ("navigator_of_mine.py", "another_of_mine.py"):
        (other / name).write_text(OWN)
    (other / "gains_of_mine.py").write_text("GAIN = 2.0")
    import_by_name(f"{beside}/navigator_of_mine.py:Own")
    for name in ("navigator_of_mine", "gains_of_mine"):
        file = "navigator_of_mine.py" if name == "navigator_of_mine" else "another_of_mine.py"
        said = f"one module {name}, got '{name} imported from {beside}/{name}.py before'"
        with pytest.raises(DockairError, match=re.escape(said)):
            import_by_name(f"{other}/{file}:Own")


@pytest.mark.parametrize("wrong", ["navigator_of_mine.txt/a:Own", "navigator_of_mine.py", "navigator_of_mine.py:a.b"])
def test_what_names_no_class_is_refused_by_the_key(wrong):
    with pytest.raises(DockairError, match=r'--set navigation.navigator: expected "truth", "module:Class" or "file'):
        load_scenario("default", {KEY: wrong})


def test_a_scenario_flies_the_navigator_beside_it_and_says_so_alike_from_everywhere(beside, tmp_path, monkeypatch):
    there = load_scenario(beside / "mine.toml")
    require_buildable(there)
    assert there.navigation.navigator == f"{beside}/navigator_of_mine.py:Own"
    monkeypatch.chdir(beside)
    here = load_scenario("mine.toml")
    assert here.navigation.navigator == "navigator_of_mine.py:Own"
    assert here.navigation.name == there.navigation.name == "navigator_of_mine:Own"
    assert scenario_hash(here) == scenario_hash(there)
    assert file_hash("mine.toml") == file_hash(f"{beside}/mine.toml")
    kept = tmp_path / "kept.toml"
    kept.write_text(text_from(here.model_dump(mode="json", exclude_none=True), {}))
    assert load_scenario(kept).navigation.navigator == there.navigation.navigator
    with pytest.raises(DockairError, match=r"--set navigation.navigator: .* got 'gone.py, where no file is'"):
        load_scenario("default", {KEY: "gone.py:Own"})


def test_a_plan_begun_from_two_folders_flies_and_shows_the_same(beside, tmp_path, monkeypatch):
    entry = 'set = { navigation.navigator = "navigator_of_mine.py:Own" }'
    both = f'"mine.toml", {{ scenario = "still_air", {entry} }}'
    jobs = jobs_of(plan(beside, both))
    rows = [unflown(job) for job in jobs]
    assert f'navigator="{beside}/navigator_of_mine.py:Own"\'' in rows[1]["command"]
    monkeypatch.chdir(beside)
    again = [unflown(job) for job in jobs_of(PlanFile("p.toml"))]
    assert 'navigator="navigator_of_mine.py:Own"\'' in again[1]["command"]
    assert {row["navigator"] for row in rows + again} == {"navigator_of_mine:Own"}
    assert [row["scenario_hash"] for row in rows] == [row["scenario_hash"] for row in again]
    assert len(groups_of(rows + [row | {"seed": 1} for row in again])) == 2
    code = code_of(jobs)
    assert [job.plug_in for job in jobs] == ["navigator_of_mine"] * 2 and list(code.plug_ins) == ["navigator_of_mine"]
    (beside / "navigator_of_mine.py").write_text(OWN + "\n")
    with pytest.raises(DockairError, match=r"a change of navigator_of_mine\.py"):
        code.require_unchanged("--out here")


def test_a_drawn_navigator_has_a_column_without_its_path(beside):
    drawn = '{ "navigation.navigator".values = ["truth", "./navigator_of_mine.py:Own"] }'
    source = plan(beside, f'"still_air"]\nsampler = "grid"\ndraw = {drawn}\nseeds = [0')
    rows = [unflown(job) for job in jobs_of(source)]
    assert [row[f"set.{KEY}"] for row in rows] == ["truth", "navigator_of_mine:Own"]


def test_two_navigators_of_one_plan_whose_files_have_one_name_are_refused(beside, tmp_path):
    (tmp_path / "navigator_of_mine.py").write_text(OWN)
    entry = '{{ scenario = "still_air", set = {{ navigation.navigator = "{}navigator_of_mine.py:Own" }} }}'
    with pytest.raises(DockairError, match="in one process there is one module navigator_of_mine"):
        jobs_of(plan(beside, f"{entry.format('')}, {entry.format('../')}"))


def test_a_flight_is_replayed_from_any_folder_as_long_as_the_file_is_there(beside, tmp_path, monkeypatch):
    monkeypatch.chdir(beside)
    fly(load_scenario("mine.toml", {"flight.duration_s": 0.05}), out=tmp_path / "out")
    monkeypatch.chdir(tmp_path)
    report = replay("out")
    assert report.identical and report.same_code and report.ticks == 5
    name = f"{beside}/navigator_of_mine.py:Own"
    assert f'"{name}"' in (tmp_path / "out" / NAVIGATOR).read_text()
    before = code_fingerprint(name)
    os.rename(beside / "navigator_of_mine.py", beside / "moved.py")
    with pytest.raises(DockairError, match=r"got .*navigator_of_mine\.py: expected the path of a Python file"):
        replay("out")
    (beside / "navigator_of_mine.py").write_text(OWN + "\n")
    assert code_fingerprint(name) != before


def test_a_spawned_process_finds_it_too(beside):
    """As a worker of a campaign and a spawned environment do: by the path, in a process that has imported nothing."""
    code = f"from dockair.scenarios.class_by_name import import_by_name as i; print(i({str(beside)!r} + '/{{}}'))"
    command = [sys.executable, "-c", code.replace("{}", "navigator_of_mine.py:Own")]
    done = subprocess.run(command, capture_output=True, text=True, check=True, cwd=beside.parent)
    assert done.stdout == "<class 'navigator_of_mine.Own'>\n"


def test_a_flight_without_a_path_needs_no_folder_to_stand_in(tmp_path, monkeypatch):
    gone = tmp_path / "gone"
    gone.mkdir()
    monkeypatch.chdir(gone)
    gone.rmdir()
    assert fly(load_scenario("truth_navigation", {"flight.duration_s": 0.1}), out=tmp_path / "out").duration_s == 0.1
    measured = {"camera.sensing": "measurements", "flight.duration_s": 0.1}
    assert fly(load_scenario("still_air", measured), out=tmp_path / "measured").duration_s == 0.1
    monkeypatch.chdir(tmp_path)
