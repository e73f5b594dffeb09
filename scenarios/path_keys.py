"""The keys of a scenario that hold paths: calibration sheets, and a navigator that is named by its file.

A path is taken from where it was written: in a scenario's file from that file's folder, in a plan from the plan's. That
of `--set`, and of Python, is left as it is: it is taken from where one stands.
"""

from collections.abc import Callable, Mapping
from functools import partial
from pathlib import Path
from typing import Any

from dockair.scenarios.class_by_name import file_and_class

SHEETS = ("hardware.camera", "hardware.ring")  #: whose values are paths
NAVIGATOR = "navigation.navigator"  #: a path in "file.py:Class" alone


def from_folder(folder: Path, key: str, value: Any) -> Any:
    """Return a dotted key's value with its path taken from a folder; one without a path as it is."""
    return _with_path(key, value, lambda path: folder / path)


def absolute(key: str, value: Any) -> Any:
    """Return a dotted key's value with its path from where one stands made absolute; one without a path as it is."""
    return _with_path(key, value, lambda path: Path(path).absolute())


def _with_path(key: str, value: Any, change: Callable[[str], Path]) -> Any:
    if not isinstance(value, str):
        return value
    if key in SHEETS:
        return str(change(value))
    file, name = file_and_class(value) if key == NAVIGATOR else ("", "")
    return f"{change(file)}:{name}" if file else value


def taken_from(folder: Path, table: Mapping[str, Any]) -> dict[str, Any]:
    """Return a scenario's table with its paths taken from a folder."""
    return with_changed(table, partial(from_folder, folder))


def with_changed(table: Mapping[str, Any], change: Callable[[str, str], Any]) -> dict[str, Any]:
    """Return a scenario's table with other values of these keys, where they are texts.

    Args:
        table: as it was read, not checked.
        change: from dotted key and value to what takes its place.
    """
    changed = dict(table)
    for key in (*SHEETS, NAVIGATOR):
        owner, _, name = key.partition(".")
        value = value_in(changed, key)
        if value is not None:
            changed[owner] = {**changed[owner], name: change(key, value)}
    return changed


def value_in(table: Mapping[str, Any], key: str) -> str | None:
    """Return the text that a scenario's table, not checked, has for one of these keys; None where it has none."""
    owner, _, name = key.partition(".")
    value = table[owner].get(name) if isinstance(table.get(owner), dict) else None
    return value if isinstance(value, str) else None
