"""Looks at the machine before it flies: Python, links, off-screen OpenGL, cores, memory, disk, packages.

Without OpenGL the camera's background cannot be MuJoCo's, which by default it is not, and pictures for people are
missing. Whether there is any is tried in a process of its own (`dockair.sim.opengl`); however it fails becomes one line
here.
"""

import os
import platform
import shutil
import sys
from dataclasses import asdict, dataclass
from importlib import metadata
from importlib.resources import files
from pathlib import Path
from typing import Any

from dockair.errors import MachineError
from dockair.scenarios.tables.light import CameraOptions
from dockair.sim.opengl import RENDER_SCRIPT, TIMEOUT_S, drawing_remedy, kind_of_context, try_drawing

PYTHON_AT_LEAST = (3, 11)
MEMORY_AT_LEAST_GB = 1.0  # a flight with its recording stays below this
DISK_AT_LEAST_GB = 0.5  # a default flight writes up to 150 MB
RENDER_TIMEOUT_S = TIMEOUT_S
LINKED = ("sim", "nav", "scenarios", "assets")

_RENDER = RENDER_SCRIPT


@dataclass(frozen=True, slots=True)
class Check:
    """One thing looked at."""

    name: str
    ok: bool
    found: str
    remedy: str = ""  #: what to do when it is not ok
    needed: bool = True  #: without it nothing flies
    detail: str = ""  #: what was said by what failed


def examine(folder: Path) -> list[Check]:
    """Look at everything.

    Args:
        folder: where flights would be written.
    """
    rendering = _rendering()
    return [_python(), _links(), rendering, _camera(rendering), _cores(), _memory(), _disk(folder), _packages()]


def require_rendering() -> None:
    """Raise a MachineError of one line when nothing can be rendered off-screen."""
    check = _rendering()
    if not check.ok:
        raise MachineError("off-screen OpenGL", expected=f"a picture through {_opengl()}", remedy=check.remedy)


def package_versions() -> dict[str, str]:
    """Return the version of each package that Dockair requires; "missing" where there is none."""
    return {name: _version(name) for name in sorted({"dockair", *_required()})}


def to_json(checks: list[Check]) -> dict[str, Any]:
    """Return what `dockair doctor --json` prints."""
    return {"ok": is_fit(checks), "checks": [asdict(check) for check in checks], "versions": package_versions()}


def is_fit(checks: list[Check]) -> bool:
    """Whether nothing needed is missing."""
    return all(check.ok for check in checks if check.needed)


def _python() -> Check:
    wanted = ".".join(map(str, PYTHON_AT_LEAST))
    found = f"{platform.python_version()} on {platform.system()} {platform.machine()}"
    return Check("Python", sys.version_info >= PYTHON_AT_LEAST, found, f"install Python {wanted} or newer")


def _links() -> Check:
    package = files("dockair")
    text = [name for name in LINKED if not package.joinpath(name).is_dir()]
    remedy = "links not restored: clone with git, a zip tool has made text of them"
    return Check("source links", not text, "missing: " + ", ".join(text) if text else "in place", remedy)


def _opengl() -> str:
    return kind_of_context() or "window-system"


def _rendering() -> Check:
    name = f"off-screen OpenGL ({_opengl()})"
    trial = try_drawing(_RENDER, RENDER_TIMEOUT_S)
    if trial.renderer:
        return Check(name, True, trial.renderer, needed=False)
    return Check(name, False, trial.reason, drawing_remedy(), needed=False, detail=trial.said)


def _camera(rendering: Check) -> Check:
    """Which background the camera takes when a scenario names none, and what it could take here."""
    default = CameraOptions.model_fields["background"].default
    words = f'{default} background by default; camera.background = "mujoco"'
    if rendering.ok:
        renderer = rendering.found.split(" (")[0]
        return Check("camera", True, f'{words} or "auto" draws by {_opengl().upper()}, {renderer}')
    return Check("camera", True, f'{words} is refused here, "auto" is analytic: {rendering.found}')


def _cores() -> Check:
    count = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
    return Check("cores", count >= 2, str(count), "works, but takes twice the time on one core", needed=False)


def _memory() -> Check:
    try:
        lines = Path("/proc/meminfo").read_text(encoding="ascii").splitlines()
        available_kb = next(int(line.split()[1]) for line in lines if line.startswith("MemAvailable"))
    except (OSError, StopIteration, ValueError):
        return Check("free memory", True, "unknown", needed=False)
    gigabytes = available_kb * 1024 / 1e9
    remedy = f"free {MEMORY_AT_LEAST_GB:g} GB"
    return Check("free memory", gigabytes >= MEMORY_AT_LEAST_GB, f"{gigabytes:.1f} GB", remedy)


def _disk(folder: Path) -> Check:
    folder = folder.absolute()
    while not folder.is_dir():
        folder = folder.parent
    gigabytes = shutil.disk_usage(folder).free / 1e9
    remedy = f"free {DISK_AT_LEAST_GB:g} GB, or fly with --out elsewhere"
    return Check("free disk", gigabytes >= DISK_AT_LEAST_GB, f"{gigabytes:.1f} GB at {folder}", remedy)


def _packages() -> Check:
    missing = [name for name, version in package_versions().items() if version == "missing"]
    found = "missing: " + ", ".join(missing) if missing else f"{len(package_versions())} in place"
    return Check("packages", not missing, found, "type: make install")


def _required() -> list[str]:
    """Return the names that Dockair itself requires, without its extras."""
    try:
        requirements = metadata.requires("dockair") or []
    except metadata.PackageNotFoundError:
        return []
    plain = [line for line in requirements if "extra ==" not in line]
    return [line[: next((i for i, c in enumerate(line) if c in "<>=!~[; ("), len(line))] for line in plain]


def _version(name: str) -> str:
    try:
        return metadata.version(name)
    except metadata.PackageNotFoundError:
        return "missing"
