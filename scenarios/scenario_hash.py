"""Digests of what decides a flight: two that are equal name one flight, however it was written and from wherever."""

import json
from hashlib import blake2b
from pathlib import Path

from dockair.errors import DockairError
from dockair.scenarios.class_by_name import by_module
from dockair.scenarios.path_keys import SHEETS, with_changed
from dockair.scenarios.scenario_file import ScenarioFile
from dockair.scenarios.schema import Scenario

SAYS_NOTHING_OF_THE_FLIGHT = {"seed", "claim", "accept"}  #: of a scenario's keys; the seed is told beside it


def require_decisive(key: str, where: str, got: object) -> None:
    """Refuse a key of a scenario that says nothing of the flight: it would be taken without a word.

    Raises:
        DockairError: it does not.
    """
    if key.partition(".")[0] in SAYS_NOTHING_OF_THE_FLIGHT:
        raise DockairError(where, expected="a key that decides the flight", got=got)


def scenario_hash(scenario: Scenario) -> str:
    """Return a digest of all that decides a flight but its seed, the sheets that the scenario names included."""
    table = scenario.model_dump(mode="json", exclude=SAYS_NOTHING_OF_THE_FLIGHT)
    table = with_changed(table, _without_path)
    return blake2b(json.dumps(table, sort_keys=True).encode(), digest_size=8).hexdigest()


def file_hash(file: str) -> str:
    """Return a digest of what a scenario's file says of the flight, its paths apart."""
    table = {key: value for key, value in ScenarioFile(file, {}).table.items() if key not in SAYS_NOTHING_OF_THE_FLIGHT}
    table = with_changed(table, _without_path)
    return blake2b(json.dumps(table, sort_keys=True, default=str).encode(), digest_size=8).hexdigest()


def sheets_of(scenario: Scenario) -> dict[str, str]:
    """Return the keys of the sheets that a scenario names, each with a digest of what its sheet holds."""
    return {key: _without_path(key, path) for key, path in sheet_paths(scenario).items()}


def sheet_paths(scenario: Scenario) -> dict[str, str]:
    """Return the keys of the sheets that a scenario names, each with the sheet's path."""
    paths = {f"hardware.{key}": path for key, path in scenario.hardware.model_dump().items()}
    return {key: paths[key] for key in SHEETS if paths[key] is not None}


def _without_path(key: str, value: str) -> str:
    """Return what tells a value in place of its path, which is written otherwise from another folder.

    That is a digest of what a sheet holds, and of a navigator that is named by its file the module's name.
    """
    if key not in SHEETS:
        return by_module(value)
    return content_hash(value) if Path(value).is_file() else value


def content_hash(path: str) -> str:
    """Return a digest of what a sheet holds."""
    return blake2b(Path(path).read_bytes(), digest_size=8).hexdigest()
