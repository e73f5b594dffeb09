"""Digests of what decides a flight: two that are equal name one flight, however it was written and from wherever."""

import json
from collections.abc import Mapping
from hashlib import blake2b
from pathlib import Path
from typing import Any

from dockair.errors import DockairError
from dockair.scenarios.scenario_file import SHEETS, ScenarioFile
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
    table["hardware"] = _sheets_by_content(table["hardware"])
    return blake2b(json.dumps(table, sort_keys=True).encode(), digest_size=8).hexdigest()


def file_hash(file: str) -> str:
    """Return a digest of what a scenario's file says of the flight, the sheets that it names by what they hold."""
    table = {key: value for key, value in ScenarioFile(file, {}).table.items() if key not in SAYS_NOTHING_OF_THE_FLIGHT}
    hardware = table.get("hardware")
    if isinstance(hardware, dict):
        table["hardware"] = _sheets_by_content(hardware)
    return blake2b(json.dumps(table, sort_keys=True, default=str).encode(), digest_size=8).hexdigest()


def sheets_of(scenario: Scenario) -> dict[str, str]:
    """Return the keys of the sheets that a scenario names, each with a digest of what its sheet holds."""
    contents = _sheets_by_content(scenario.hardware.model_dump())
    return {f"hardware.{key}": contents[key] for key in SHEETS if contents[key] is not None}


def _sheets_by_content(hardware: Mapping[str, Any]) -> dict[str, Any]:
    """Return the table with digests for the paths of sheets, which are written otherwise from another folder."""
    return {
        key: blake2b(Path(value).read_bytes(), digest_size=8).hexdigest()
        if key in SHEETS and isinstance(value, str) and Path(value).is_file()
        else value
        for key, value in hardware.items()
    }
