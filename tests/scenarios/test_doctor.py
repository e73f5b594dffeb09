"""The doctor: what is missing becomes one line that says what to type."""

import json
import os
import sys
from pathlib import Path

import pytest

from dockair.errors import MachineError
from dockair.scenarios import doctor
from dockair.scenarios.schema import load_scenario
from dockair.sim.opengl import Trial, kind_of_context


@pytest.fixture
def plenty_of_room(monkeypatch):
    """Whatever else is run here may take its memory and its disk."""
    monkeypatch.setattr(doctor, "MEMORY_AT_LEAST_GB", 0.0)
    monkeypatch.setattr(doctor, "DISK_AT_LEAST_GB", 0.0)


@pytest.mark.parametrize("trial", [Trial("llvmpipe"), Trial("", "no picture through egl")])
@pytest.mark.usefixtures("plenty_of_room")
def test_this_machine_is_fit_with_opengl_or_without(monkeypatch, tmp_path, trial):
    """And looking for OpenGL twice would cost a second."""
    runs = []
    monkeypatch.setattr(doctor, "try_drawing", lambda *arguments: runs.append(arguments) or trial)
    checks = doctor.examine(tmp_path)
    assert doctor.is_fit(checks), [check for check in checks if not check.ok]
    assert runs == [(doctor.RENDER_SCRIPT, doctor.TIMEOUT_S)]


@pytest.mark.usefixtures("plenty_of_room")
@pytest.mark.parametrize(
    ("trial", "besides"),
    [
        (Trial("llvmpipe (LLVM 15.0.6, 256 bits)"), '= "mujoco" or "auto" draws by EGL, llvmpipe'),
        (Trial("", "no picture through egl"), '= "mujoco" is refused here, "auto" is analytic: no picture through egl'),
    ],
)
def test_the_camera_line_says_what_runs_by_default_and_what_could(monkeypatch, tmp_path, trial, besides):
    """The default is the scenario's, whatever this machine can draw."""
    monkeypatch.setenv("MUJOCO_GL", "egl")
    monkeypatch.setattr(doctor, "try_drawing", lambda *_: trial)
    checks = doctor.examine(tmp_path)
    flown = load_scenario("default").camera.background
    said = {check.name: check.found for check in checks}["camera"]
    assert said == f"{flown} background by default; camera.background {besides}"
    assert doctor.is_fit(checks)


def test_opengl_that_was_switched_off_is_no_reason_to_install_packages(monkeypatch):
    monkeypatch.setenv("MUJOCO_GL", "disabled")
    check = doctor._rendering()
    assert (check.found, check.remedy) == ("MUJOCO_GL is disabled", "unset MUJOCO_GL, or set it to egl")


@pytest.mark.gl
def test_a_machine_that_renders_is_told_who_renders():
    check = doctor._rendering()
    assert check.ok
    assert check.found
    doctor.require_rendering()


@pytest.mark.parametrize(
    "failure",
    [
        "import sys; raise AttributeError(\"'NoneType' object has no attribute 'eglQueryString'\")",
        "raise ImportError('Cannot initialize a EGL device display.')",
        "raise TypeError('glGetError')",
        "import os; os.abort()",
    ],
)
def test_however_opengl_fails_it_is_one_line_with_the_packages_to_install(monkeypatch, failure):
    monkeypatch.setenv("MUJOCO_GL", "egl")
    monkeypatch.setattr(doctor, "_RENDER", failure)
    with pytest.raises(MachineError) as caught:
        doctor.require_rendering()
    assert str(caught.value) == (
        "off-screen OpenGL: expected a picture through egl; "
        "type: sudo apt-get install -y libegl1 libgl1-mesa-dri libopengl0"
    )
    assert caught.value.exit_code == 3


def test_what_opengl_said_is_kept_for_those_who_ask(monkeypatch):
    monkeypatch.setattr(doctor, "_RENDER", "raise ImportError('Cannot initialize')")
    assert doctor._rendering().detail == "ImportError: Cannot initialize"


def test_a_renderer_that_hangs_is_given_up(monkeypatch):
    monkeypatch.setattr(doctor, "_RENDER", "import time; time.sleep(60)")
    monkeypatch.setattr(doctor, "RENDER_TIMEOUT_S", 0.5)
    assert not doctor._rendering().ok


def test_another_backend_that_was_chosen_is_named_instead_of_packages(monkeypatch):
    monkeypatch.setenv("MUJOCO_GL", "osmesa")
    monkeypatch.setattr(doctor, "_RENDER", "raise ImportError('no OSMesa')")
    assert doctor._rendering().remedy == "unset MUJOCO_GL, or set it to egl"


@pytest.mark.parametrize(
    ("environment", "chosen"), [({}, "egl"), ({"DISPLAY": ":0"}, "egl"), ({"MUJOCO_GL": "glfw"}, "glfw")]
)
def test_egl_is_chosen_on_linux_where_nobody_chose(monkeypatch, environment, chosen):
    monkeypatch.setattr(sys, "platform", "linux")
    assert kind_of_context(environment) == chosen


def test_a_machine_is_fit_when_only_what_is_not_needed_is_missing():
    fine, needed = doctor.Check("a", True, ""), doctor.Check("b", False, "")
    wished = doctor.Check("c", False, "", needed=False)
    assert doctor.is_fit([fine, wished])
    assert not doctor.is_fit([fine, needed])


def test_a_full_disk_and_missing_memory_are_found(monkeypatch, tmp_path):
    monkeypatch.setattr(doctor, "DISK_AT_LEAST_GB", 1e9)
    monkeypatch.setattr(doctor, "MEMORY_AT_LEAST_GB", 1e9)
    assert not doctor._disk(tmp_path / "not" / "there" / "yet").ok
    assert not doctor._memory().ok


@pytest.mark.parametrize(("cores", "ok"), [({3}, False), ({0, 3}, True)])
def test_one_core_is_enough_to_fly_and_two_are_wanted(monkeypatch, cores, ok):
    monkeypatch.setattr(doctor.os, "sched_getaffinity", lambda _: cores, raising=False)
    check = doctor._cores()
    assert (check.ok, check.found, check.needed) == (ok, str(len(cores)), False)


def test_a_python_that_is_too_old_is_told_what_is_wanted(monkeypatch):
    assert doctor._python().ok
    monkeypatch.setattr(doctor, "PYTHON_AT_LEAST", (99, 1))
    check = doctor._python()
    assert not check.ok and check.needed and check.remedy == "install Python 99.1 or newer"


@pytest.mark.parametrize(
    ("line", "ok", "found"),
    [
        ("MemAvailable:  2500000 kB", True, "2.6 GB"),  # of 1024 bytes
        ("MemAvailable:   976000 kB", False, "1.0 GB"),
        ("MemFree:            12 kB", True, "unknown"),
    ],
)
def test_the_memory_that_is_free_is_what_the_system_says(monkeypatch, line, ok, found):
    monkeypatch.setattr(doctor.Path, "read_text", lambda path, **_: f"MemTotal: 9 kB\n{line}\n")
    check = doctor._memory()
    assert (check.ok, check.found) == (ok, found)


def test_a_package_that_is_not_installed_is_named(monkeypatch):
    monkeypatch.setattr(doctor, "_required", lambda: ["numpy", "no-such-package"])
    check = doctor._packages()
    assert not check.ok
    assert check.found == "missing: no-such-package"


def test_the_versions_are_of_what_the_project_requires_without_its_extras():
    versions = doctor.package_versions()
    assert {"dockair", "mujoco", "numpy", "rerun-sdk", "opencv-python-headless"} <= set(versions)
    assert "pytest" not in versions
    assert "missing" not in versions.values()


def test_links_that_are_text_are_not_in_place(monkeypatch, tmp_path):
    for name in ("sim", "nav", "scenarios"):
        (tmp_path / name).mkdir()
    (tmp_path / "assets").write_text("../../assets")
    monkeypatch.setattr(doctor, "files", lambda _: Path(tmp_path))
    check = doctor._links()
    assert not check.ok
    assert check.found == "missing: assets"
    assert "clone with git" in check.remedy


def test_the_report_is_plain_json():
    checks = [doctor.Check("cores", True, str(os.cpu_count()))]
    table = json.loads(json.dumps(doctor.to_json(checks)))
    assert table["ok"] is True
    assert set(table) == {"ok", "checks", "versions"}
