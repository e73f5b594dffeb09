"""What was set over a flight's scenario, as its row's command says, and which of it the plan drew."""

import json
import shlex
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from dockair.scenarios.campaign.row import SET
from dockair.scenarios.class_by_name import by_module
from dockair.scenarios.path_keys import NAVIGATOR
from dockair.scenarios.toml_files import toml_value

#: Keys whose values have a column.
_IN_COLUMNS = ("name", NAVIGATOR, "camera.sensing", "guidance.controller")


def file_and_settings(row: Mapping[str, Any]) -> tuple[str, list[str]]:
    """Return the scenario's name or path from the flight's command, and what was set over it: "key=value" each."""
    _, _, file, _, _, *options = shlex.split(row["command"])
    return file, options[1::2]


def conditions_of(row: Mapping[str, Any]) -> list[str]:
    """Return what was set over the scenario, its paths apart, which depend on where one stood.

    Of a sheet its name and what it held stand there, of a navigator that was named by its file the module.
    Tables of before the column `sheets` do not say what one held.
    """
    contents = json.loads(row.get("sheets") or "{}")
    return [_by_content(text, contents) for text in file_and_settings(row)[1]]


def _by_content(text: str, contents: Mapping[str, str]) -> str:
    key, _, value = text.partition("=")
    if key == NAVIGATOR:
        return f'{key}="{by_module(str(toml_value(value)))}"'
    return f'{key}="{Path(str(toml_value(value))).name}" ({contents[key]})' if key in contents else text


def drawn_of(row: Mapping[str, Any]) -> list[str]:
    """Return what the plan has drawn for this flight: "key=value" each."""
    return [text for text in file_and_settings(row)[1] if row.get(SET + key_of(text)) is not None]


def settings_of(row: Mapping[str, Any]) -> str:
    """Return what was set over the scenario, of a draw the key alone; without keys that have a column of their own."""
    given, drawn = given_and_drawn(row)
    return ", ".join(sorted([*given, *(f"{key} drawn" for key in drawn)]))


def given_and_drawn(row: Mapping[str, Any]) -> tuple[list[str], list[str]]:
    """Return "key=value" of what was set, and the keys that were drawn; without those that have a column."""
    drawn = set(map(key_of, drawn_of(row)))
    settings = [text for text in conditions_of(row) if key_of(text) not in _IN_COLUMNS]
    keys = map(key_of, settings)
    return [text for text in settings if key_of(text) not in drawn], [key for key in keys if key in drawn]


def key_of(text: str) -> str:
    """Return the key of "key=value"."""
    return text.partition("=")[0]
