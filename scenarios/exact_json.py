"""Frozen dataclasses to JSON and back without losing a bit.

Numbers are written as Python writes them: the shortest decimal that reads back as the same 64-bit float. What JSON
lacks is an object with one key:

    {"class": "module:Class", "fields": {...}}   a dataclass          {"float": "nan"}    NaN and infinities
    {"array": [...], "shape": [...], "dtype": "float64"}  an array    {"enum": "module:Class", "name": "..."}
    {"tuple": [...]}                                                  {"dict": [[key, value], ...]}

Reading imports the classes that the file names, and refuses anything that is neither a dataclass nor an enumeration.
"""

import math
from dataclasses import fields, is_dataclass
from enum import Enum
from typing import Any

import numpy as np

from dockair.errors import DockairError
from dockair.scenarios.class_by_name import import_by_name, name_of


def encode(value: Any) -> Any:
    """Return what `json.dump` can write.

    Raises:
        DockairError: a type that has no exact form here.
    """
    if isinstance(value, Enum):  # first: one may be a number or a text, too
        return {"enum": name_of(type(value)), "name": value.name}
    if value is None or isinstance(value, bool | int | str):
        return value
    if isinstance(value, float):
        return float(value) if math.isfinite(value) else {"float": repr(float(value))}
    if isinstance(value, np.ndarray):
        flat = [encode(entry) for entry in value.ravel().tolist()]
        return {"array": flat, "shape": list(value.shape), "dtype": value.dtype.str}
    if isinstance(value, tuple):
        return {"tuple": [encode(entry) for entry in value]}
    if isinstance(value, list):
        return [encode(entry) for entry in value]
    if isinstance(value, dict):
        return {"dict": [[encode(key), encode(entry)] for key, entry in value.items()]}
    if is_dataclass(value) and not isinstance(value, type):
        entries = {f.name: encode(getattr(value, f.name)) for f in fields(value) if f.init}
        return {"class": name_of(type(value)), "fields": entries}
    raise DockairError("recording", expected="numbers, text, arrays and dataclasses", got=type(value).__name__)


def decode(table: Any) -> Any:
    """Return the value that `encode` was given; arrays are read-only.

    Raises:
        DockairError: a class that does not exist, or is neither dataclass nor enumeration.
    """
    if isinstance(table, list):
        return [decode(entry) for entry in table]
    if not isinstance(table, dict):
        return table
    if "float" in table:
        return float(table["float"])
    if "array" in table:
        array = np.array([decode(entry) for entry in table["array"]], dtype=table["dtype"]).reshape(table["shape"])
        array.setflags(write=False)
        return array
    if "tuple" in table:
        return tuple(decode(entry) for entry in table["tuple"])
    if "dict" in table:
        return {decode(key): decode(entry) for key, entry in table["dict"]}
    return _object(table)


def _object(table: dict[str, Any]) -> Any:
    name = table.get("enum") or table.get("class") or ""
    cls = import_by_name(name)
    if "enum" in table and isinstance(cls, type) and issubclass(cls, Enum):
        return cls[table["name"]]
    if "class" in table and isinstance(cls, type) and is_dataclass(cls):
        return cls(**{key: decode(entry) for key, entry in table["fields"].items()})
    raise DockairError(name, expected="a dataclass or an enumeration", got=str(cls))
