"""The package as people meet it: links, what an import loads, what an installed copy holds."""

import importlib.util
import json
import os
import subprocess
import sys
import tarfile
import tomllib
import zipfile
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
PACKAGE = ROOT / "src" / "dockair"
LINKED = ("sim", "nav", "scenarios", "assets")
IS_CLONE = (ROOT / ".git").exists()


def run(code: str, cwd: Path = ROOT) -> str:
    """Run code in a fresh interpreter and return what it printed."""
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, cwd=cwd)
    assert done.returncode == 0, done.stderr
    return done.stdout.strip()


@pytest.mark.parametrize("name", LINKED)
def test_each_folder_of_the_package_is_a_relative_link_or_in_a_source_archive_a_folder(name):
    path = PACKAGE / name
    assert path.is_dir()
    if IS_CLONE:
        assert path.is_symlink()
        assert path.readlink() == Path("..") / ".." / name


def test_each_package_folder_below_the_links_has_its_init():
    for name in ("sim", "nav", "scenarios"):
        for module in (PACKAGE / name).rglob("*.py"):
            assert (module.parent / "__init__.py").is_file(), f"{module.parent} has no __init__.py"


def test_importing_dockair_loads_nothing_but_itself():
    loaded = run(
        "import sys; before = set(sys.modules); import dockair; print(*sorted(set(sys.modules) - before))"
    ).split()
    foreign = {name.partition(".")[0] for name in loaded} - {"dockair"} - set(sys.stdlib_module_names)
    assert foreign == set()


@pytest.mark.parametrize("module", ["dockair.nav", "dockair.nav.navigator"])
def test_the_navigation_loads_no_engine_and_nothing_of_the_world(module):
    forbidden = (
        "mujoco",
        "gymnasium",
        "rerun",
        "pyarrow",
        "pydantic",
        "filterpy",
        "matplotlib",
        "dockair.sim",
        "dockair.scenarios",
    )
    code = f"import sys, json, {module}; print(json.dumps([n for n in {forbidden!r} if n in sys.modules]))"
    assert json.loads(run(code)) == []


def test_the_world_loads_neither_navigation_nor_scenarios():
    code = (
        "import sys, json, dockair.sim.world; print(json.dumps([n for n in sys.modules if n.startswith('dockair.')]))"
    )
    loaded = json.loads(run(code))
    assert not [name for name in loaded if name.startswith(("dockair.nav", "dockair.scenarios"))]


@pytest.mark.parametrize(
    "imports",
    [
        "import gymnasium, dockair",
        "import dockair, gymnasium",
        "import dockair.nav; from gymnasium.envs import registration",
        "import gymnasium.spaces, dockair",
        "import dockair, importlib.util; importlib.util.find_spec('gymnasium')",
    ],
)
def test_the_environments_are_registered_whichever_is_imported_first(imports):
    code = f"{imports}\nimport gymnasium\nprint(gymnasium.spec('dockair/Dock-v0').entry_point)"
    assert run(code) == "dockair.scenarios.envs:DockEnv"


def test_the_environments_are_registered_where_another_finder_knows_gymnasium():
    """As an editable install of it brings along."""
    code = (
        "import sys, dockair\nfrom importlib.machinery import PathFinder\n"
        "class Own:\n"
        "    def find_spec(name, path=None, target=None):\n"
        "        return PathFinder.find_spec(name, path, target) if name == 'gymnasium' else None\n"
        "class Blind:\n"
        "    def find_spec(name, path=None, target=None):\n"
        "        return None if name == 'gymnasium' else PathFinder.find_spec(name, path, target)\n"
        "sys.meta_path[sys.meta_path.index(PathFinder)] = Blind\n"
        "sys.meta_path.append(Own)\n"
        "import gymnasium\nprint(gymnasium.spec('dockair/Dock-v0').entry_point)"
    )
    assert run(code) == "dockair.scenarios.envs:DockEnv"


def test_gymnasium_can_be_reloaded_after_dockair():
    assert run("import dockair, gymnasium, importlib; importlib.reload(gymnasium); print('fine')") == "fine"


def test_the_finder_of_gymnasium_is_gone_once_it_has_done_its_work():
    code = "import sys, dockair; n = len(sys.meta_path); import gymnasium; print(n - len(sys.meta_path))"
    assert run(code) == "1"


def test_no_module_of_ours_is_loaded_twice_under_a_top_level_name():
    # the working directory is on the path, so `import sim` would find the folder and load a second copy of it
    code = (
        "import sys, dockair.scenarios.schema, dockair.sim.truth, dockair.nav.guidance.approach\n"
        "print(*[name for name in ('sim', 'nav', 'scenarios', 'assets') if name in sys.modules])"
    )
    assert run(code, cwd=ROOT) == ""


def test_the_linter_refuses_imports_under_a_top_level_name():
    banned = tomllib.loads((ROOT / "pyproject.toml").read_text())["tool"]["ruff"]["lint"]["flake8-tidy-imports"][
        "banned-api"
    ]
    assert set(banned) == set(LINKED)


def test_every_module_of_ours_is_found_below_dockair():
    for name in ("sim", "nav", "scenarios"):
        spec = importlib.util.find_spec(f"dockair.{name}")
        assert spec is not None
        assert Path(spec.origin).is_relative_to(PACKAGE)


def test_links_that_became_text_are_told_in_one_line(tmp_path):
    # what some zip tools do: each link a file with its target as text
    copy = tmp_path / "dockair"
    copy.mkdir()
    for name in ("__init__.py", "__main__.py", "errors.py"):
        (copy / name).write_text((PACKAGE / name).read_text())
    for name in LINKED:
        (copy / name).write_text(f"../../{name}")
    done = subprocess.run([sys.executable, "-m", "dockair", "doctor"], capture_output=True, text=True, cwd=tmp_path)
    assert done.returncode == 3
    assert done.stdout == ""
    assert done.stderr == "dockair: links not restored (sim, nav, scenarios, assets): clone with git\n"


def test_constraints_pin_everything_that_is_required():
    pins = {}
    for line in (ROOT / "constraints.txt").read_text().splitlines():
        if line and not line.startswith("#"):
            name, equals, version = line.partition("==")
            assert equals and version, f"{line}: not pinned"
            pins[name.lower().replace("_", "-")] = version
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    wanted = [*project["dependencies"], *project["optional-dependencies"]["dev"]]
    names = {requirement.split(">")[0].strip().lower() for requirement in wanted}
    assert names <= set(pins), f"not pinned: {sorted(names - set(pins))}"


@pytest.mark.parametrize("script", ["machine", "install", "run"])
def test_the_scripts_of_the_two_commands_are_executable_posix_shell(script):
    path = ROOT / ".ci" / script
    assert os.access(path, os.X_OK)
    assert path.read_text().startswith("#!/bin/sh\n")
    assert subprocess.run(["sh", "-n", str(path)], check=False).returncode == 0


@pytest.fixture(scope="module")
def distributions(tmp_path_factory):
    """Build sdist and wheel with the installed backend, so without a network."""
    folder = tmp_path_factory.mktemp("dist")
    command = [sys.executable, "-m", "hatchling", "build", "-d", str(folder)]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    (sdist,) = folder.glob("*.tar.gz")
    (wheel,) = folder.glob("*.whl")
    with tarfile.open(sdist) as archive:
        in_sdist = {member.name.partition("/")[2] for member in archive.getmembers() if member.isfile()}
    with zipfile.ZipFile(wheel) as archive:
        in_wheel = set(archive.namelist())
    return in_sdist, in_wheel


def ours() -> set[str]:
    """Return the files of the four folders as paths below `dockair/`."""
    suffixes = {".py", ".toml", ".csv"}
    return {
        f"dockair/{name}/{path.relative_to(ROOT / name)}"
        for name in LINKED
        for path in (ROOT / name).rglob("*")
        if path.suffix in suffixes
    }


@pytest.mark.slow
def test_the_wheel_holds_every_module_and_sheet_and_nothing_at_top_level_but_dockair(distributions):
    _, in_wheel = distributions
    assert ours() <= in_wheel
    assert {"dockair/py.typed", "dockair/__main__.py"} <= in_wheel
    assert {name.partition("/")[0].partition("-")[0] for name in in_wheel} == {"dockair"}


@pytest.mark.slow
def test_the_source_archive_can_build_test_and_be_cited(distributions):
    in_sdist, _ = distributions
    assert {f"src/{name}" for name in ours()} <= in_sdist
    assert {
        "pyproject.toml",
        "Makefile",
        "constraints.txt",
        ".ci/install",
        ".ci/machine",
        "CITATION.cff",
        "LICENSE",
    } <= in_sdist
    assert "tests/test_layout.py" in in_sdist
