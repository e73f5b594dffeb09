"""Copies of the scenario files and calibration sheets of one's own that a campaign flies, in its folder.

A scenario's copy is called by its name, which no two scenarios of a plan share; a sheet's by the digest of what it
holds, as in the column `sheets`. A scenario's copy names the sheets' copies, and has the digest of the file that it is
of. They are there before the first flight, each whole or not at all.
"""

import os
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from dockair.errors import DockairError
from dockair.scenarios.campaign.jobs import Job
from dockair.scenarios.path_keys import SHEETS, value_in
from dockair.scenarios.scenario_file import ScenarioFile, text_from
from dockair.scenarios.scenario_hash import content_hash, file_hash
from dockair.scenarios.whole_file import make_folder, write_whole

FOLDER = "scenario_files"


def keep_copies(jobs: Sequence[Job], out: Path) -> None:
    """Write the copies, and remove those of a plan that was flown there before.

    Args:
        jobs: of the plan.
        out: the campaign's folder.

    Raises:
        DockairError: a scenario's file is no longer what the jobs were made of, or the folder cannot be written.
        MachineError: there is no room.
    """
    folder, own = out / FOLDER, {job.scenario.name: job for job in jobs if job.is_of_own_file}
    tables = {name: ScenarioFile(job.file, {}).table for name, job in own.items()}
    texts = {f"{name}.toml": _text_of(table) for name, table in tables.items()}
    paths = {path for job in jobs for path in (job.scenario.hardware.camera, job.scenario.hardware.ring) if path}
    paths |= {path for table in tables.values() for path in _sheets_in(table).values()}
    contents = {_name_of(path): Path(path).read_bytes() for path in paths}
    contents |= {name: text.encode(errors="surrogateescape") for name, text in texts.items()}
    try:
        if contents:
            make_folder(folder)
        for name, content in contents.items():
            write_whole(folder / name, content)
        for path in folder.glob("*.toml*") if folder.is_dir() else ():
            if path.name not in contents:  # half written when a campaign was killed, too
                path.unlink()
    except OSError as error:
        raise DockairError(f"--out {out}", expected="a folder that can be written", got=error.strerror) from None
    for name, job in own.items():
        if file_hash(str(folder / f"{name}.toml")) != job.file_hash:
            expected = (
                "a scenario's file that stays as it is while the campaign begins (the same command begins it again)"
            )
            raise DockairError(job.file, expected=expected, got="a change")


def _text_of(table: Mapping[str, Any]) -> str:
    """Return a scenario's file, its sheets named by their copies."""
    return text_from(table, {key: _name_of(path) for key, path in _sheets_in(table).items()})


def _sheets_in(table: Mapping[str, Any]) -> dict[str, str]:
    """Return the keys of the sheets that a scenario's file names, each with its path, where there is such a sheet."""
    return {key: path for key in SHEETS if (path := value_in(table, key)) and os.path.isfile(path)}


def _name_of(sheet: str) -> str:
    return f"{content_hash(sheet)}.toml"
