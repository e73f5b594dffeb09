"""Reads a scenario's TOML, lays the settings of `--set` over it, and writes one; what the keys mean is the schema's."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import tomli_w

from dockair.errors import DockairError
from dockair.scenarios.dotted_key import is_within, parts_of
from dockair.scenarios.path_keys import absolute, taken_from, with_changed
from dockair.scenarios.toml_files import PLANS, SCENARIOS, read_toml, toml_value

#: Setting the one replaces the other, which the file may have given.
_ALTERNATIVES = {"turbulence.sigma_m_s": "intensity", "turbulence.intensity": "sigma_m_s"}
_MODEL = "turbulence.model"  # the file's goes with its strength: it would overrule one that is set in its place


def scenario_names() -> list[str]:
    """Names in the library, the default first."""
    return SCENARIOS.names()


def scenario_text(name_or_path: str | Path) -> str:
    """Return a scenario's file as it was written, without a byte order mark.

    Args:
        name_or_path: a name in the library, or the path of a TOML file.

    Raises:
        DockairError: no such scenario.
    """
    return SCENARIOS.find(name_or_path).read_text(encoding="utf-8-sig")


def text_from(table: Mapping[str, Any], beside: Mapping[str, str]) -> str:
    """Return a scenario's file, which read again from any folder says the same.

    Args:
        table: keys and values, each of a type that TOML has.
        beside: dotted key -> name of a copy that lies beside the file, in place of the path of what was copied.
    """

    def path(key: str, value: str) -> str:
        return beside.get(key) or str(absolute(key, value))

    return tomli_w.dumps(with_changed(table, path))


class ScenarioFile:
    """A scenario's table as its writers gave it.

    Args:
        name_or_path: a name in the library, or the path of a TOML file.
        settings: dotted key -> value instead of the file's; strings are read as TOML values, numpy's as Python's.

    Attributes:
        table: keys and values, not checked.

    Raises:
        DockairError: no such scenario, not TOML, or a plan.
    """

    def __init__(self, name_or_path: str | Path, settings: Mapping[str, object]) -> None:
        path = SCENARIOS.find(name_or_path)
        self._shown = SCENARIOS.shown(path)
        self._settings = tuple(settings)
        self.table = taken_from(path.parent, read_toml(path))  # those of `--set` from where one stands
        if "scenarios" in self.table:
            raise PLANS.misplaced(self._shown, SCENARIOS.kind, name_or_path)
        if any(key in _ALTERNATIVES for key in settings):
            _drop(self.table, _MODEL)
        for key, value in settings.items():
            _set(self.table, key, toml_value(value) if isinstance(value, str) else _plain(value))

    def place(self, where: str) -> str:
        """Return where a dotted key was written: `--set key`, or file and key."""
        for key in self._settings:
            if is_within(where, key) or is_within(key, where):
                return f"--set {where}"
        return f"{self._shown}: {where}"


def _plain(value: Any) -> Any:
    """Return a value with Python's numbers and lists for numpy's: what is drawn at random is numpy's."""
    if isinstance(value, np.generic | np.ndarray):
        return value.tolist()
    if isinstance(value, list | tuple):
        return [_plain(entry) for entry in value]
    if isinstance(value, dict):
        return {key: _plain(entry) for key, entry in value.items()}
    return value


def _drop(table: dict[str, Any], key: str) -> None:
    owner, name = key.split(".")
    if isinstance(table.get(owner), dict):
        table[owner].pop(name, None)


def _set(table: dict[str, Any], key: str, value: object) -> None:
    """Lay a value over a table; tables that are missing are made, entries of lists are not.

    Raises:
        DockairError: what should hold the value is neither, or a list without that entry.
    """
    *outer, last = parts_of(key)
    holder: Any = table
    for part in outer:
        _require_holds(holder, part, key)
        holder = holder.setdefault(part, {}) if isinstance(part, str) else holder[part]
    _require_holds(holder, last, key)
    if isinstance(last, str):
        holder.pop(_ALTERNATIVES.get(key, ""), None)
    holder[last] = value


def _require_holds(holder: object, part: str | int, key: str) -> None:
    """Refuse a key in what is no table, and a place that a list does not have."""
    if isinstance(part, str) and not isinstance(holder, dict):
        in_a_list = isinstance(holder, list)
        expected = "a place in a list, as in faults[0].start_s" if in_a_list else "a known key"
        raise DockairError(f"--set {key}", expected=expected, got=part if in_a_list else key)
    if isinstance(part, int):
        count = len(holder) if isinstance(holder, list) else 0
        if part >= count:
            has = f"a place from 0 to {count - 1}" if count else "a list that has entries; set whole, it gets them"
            raise DockairError(f"--set {key}", expected=has, got=f"[{part}]")
