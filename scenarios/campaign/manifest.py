"""What a campaign was: its plan, its code, the machine; and whether what is asked now is still the same campaign.

Rows of two codes are rows of two campaigns. A plan may grow (more seeds, more scenarios) as long as every flight that
is done is still part of it.
"""

import json
import os
import platform
import subprocess
from collections.abc import Sequence
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from llvmlite.binding import get_host_cpu_name

import dockair
from dockair.errors import DockairError
from dockair.scenarios.campaign.code import Code
from dockair.scenarios.campaign.jobs import Job
from dockair.scenarios.campaign.plan import Plan
from dockair.scenarios.campaign.points import runs_of
from dockair.scenarios.judgement.result import versions
from dockair.scenarios.whole_file import write_whole

FILE_NAME = "manifest.json"
SCHEMA_VERSION = 1

_TABLES = ("plug_ins", "versions", "files")
_SAME = ("code", "versions", "background")
OF_THE_BEGINNING = ("commit", "uncommitted_changes", "machine", "begun")  #: of the first run, whichever goes on with it


def manifest_of(plan: Plan, jobs: Sequence[Job], flight: str, code: Code) -> dict[str, Any]:
    """Return the manifest of a campaign that begins now.

    Args:
        plan: as flown, the command line's changes included.
        jobs: of the plan.
        flight: name of the function that flies a job.
        code: that flies them.
    """
    commit, changed = commit_of_the_code()
    asked = plan.model_dump(mode="json", exclude_unset=True)
    for table in (asked, *asked["scenarios"]):
        if table.get("seeds") is not None:
            table["seeds"] = _in_runs(table["seeds"])
    return {
        "schema_version": SCHEMA_VERSION,
        "plan": asked,
        "flights": len(jobs),
        "seeds": _in_runs(sorted({job.seed for job in jobs})),
        "scenarios": _hashes(jobs),
        "files": {job.scenario.name: job.file_hash for job in jobs},
        "flight": flight,
        "background": _background(jobs),
        "code": code.digest,
        "plug_ins": code.plug_ins,
        "commit": commit,
        "uncommitted_changes": changed,
        "versions": versions(),
        "machine": _machine(),
        "begun": datetime.now(UTC).isoformat(timespec="seconds"),
    }


def require_same(earlier: dict[str, Any], now: dict[str, Any], done: set[str], jobs: Sequence[Job], where: str) -> None:
    """Refuse to go on with a campaign that has become another one.

    Args:
        earlier: manifest in the folder.
        now: manifest of what is asked.
        done: keys of the flights that are done.
        jobs: that are asked.
        where: the folder, as its user would write it.

    Raises:
        DockairError: code, versions or background have changed, or the navigator of a flight that is done, or flights
            are no longer part of the plan.
    """
    expected = "the campaign that was begun there (--fresh begins it anew, another --out keeps both)"
    for name in _SAME:
        if earlier.get(name) != now[name] and (name != "background" or earlier.get("background") and now["background"]):
            raise DockairError(where, expected=expected, got=_difference(name, earlier, now))
    for module in sorted({job.plug_in for job in jobs if job.plug_in and job.key in done}):
        if earlier.get("plug_ins", {}).get(module) != now["plug_ins"][module]:
            raise DockairError(where, expected=expected, got=f"another code of the navigator in {module}")
    strangers = len(done - {job.key for job in jobs})
    if strangers:
        got = f"another plan: {strangers} of {len(done)} flights that are done are not part of it"
        raise DockairError(where, expected=expected, got=got)


def _difference(name: str, earlier: dict[str, Any], now: dict[str, Any]) -> str:
    if name == "code":
        return f"another code (of commit {earlier.get('commit')}, {earlier.get('begun')})"
    return f"other {name}: {earlier.get(name)}, now {now[name]}"


def write_json(table: Any, path: Path) -> None:
    """Write a file whole or not at all."""
    write_whole(path, (json.dumps(table, indent=1, allow_nan=False) + "\n").encode())


def read_manifest(folder: Path) -> dict[str, Any]:
    """Return a folder's manifest.

    Raises:
        DockairError: there is none, it cannot be read, or its format is another version's.
    """
    path = folder / FILE_NAME
    try:
        table: Any = json.loads(path.read_text(encoding="utf-8"))
    except OSError as error:
        expected = "the manifest of a campaign, which `dockair campaign PLAN` makes"
        raise DockairError(str(path), expected=expected, got=error.strerror) from None
    except ValueError as error:
        raise DockairError(str(path), expected="the manifest of a campaign", got=str(error)) from None
    plan = table.get("plan") if isinstance(table, dict) else None
    if not isinstance(plan, dict) or "name" not in plan:
        raise DockairError(str(path), expected="the manifest of a campaign", got="no plan with a name in it")
    if table.get("schema_version") != SCHEMA_VERSION:
        got = "nothing" if table.get("schema_version") is None else table["schema_version"]
        raise DockairError(f"{path}: schema_version", expected=str(SCHEMA_VERSION), got=got)
    for key in _TABLES:
        if not isinstance(table.get(key, {}), dict):
            raise DockairError(str(path), expected=f"a table {key} in the manifest of a campaign", got=table[key])
    return dict(table)


def commit_of_the_code() -> tuple[str | None, bool | None]:
    """Return the commit that the package was loaded from and whether files differ from it; None outside git."""
    folder = Path(dockair.__file__).resolve().parent

    def git(*arguments: str) -> str:
        command = ["git", "-C", str(folder), *arguments]
        return subprocess.run(command, capture_output=True, text=True, check=True, timeout=60).stdout.strip()

    try:
        git("ls-files", "--error-unmatch", "__init__.py")  # somebody else's repository may hold our .venv
        return git("rev-parse", "HEAD"), bool(git("status", "--porcelain", ":/"))
    except (OSError, subprocess.SubprocessError):
        return None, None


def _machine() -> str:
    """Return what the machine is; its processor as LLVM calls it, which compiles for that one."""
    processor = f"{platform.machine()} ({get_host_cpu_name()})"
    return f"{processor}, {platform.system()} {platform.release()}, {os.cpu_count()} cores"


def _background(jobs: Sequence[Job]) -> str:
    """Return who draws here what the camera sees where a scenario leaves that to the machine; "" if none does.

    Raises:
        MachineError: a scenario asks for MuJoCo's drawing, and there is no off-screen OpenGL.
    """
    from dockair.scenarios.doctor import require_rendering
    from dockair.sim.opengl import available_backend

    wanted = {job.scenario.camera.background for job in jobs if job.scenario.sensing == "camera"}
    if "mujoco" in wanted:
        require_rendering()
    return available_backend() if "auto" in wanted else ""


def _hashes(jobs: Sequence[Job]) -> dict[str, Any]:
    """Return each scenario's digest, or how many there are where keys are drawn."""
    found: dict[str, set[str]] = {}
    for job in jobs:
        found.setdefault(job.scenario.name, set()).add(job.scenario_hash)
    return {name: sorted(digests) if len(digests) < 10 else f"{len(digests)} draws" for name, digests in found.items()}


def _in_runs(seeds: Sequence[int]) -> list[int | str]:
    """Return whole numbers in order with runs as "first-last": 0-59 instead of sixty numbers."""
    return [first if first == last else f"{first}-{last}" for first, last in runs_of(seeds)]
