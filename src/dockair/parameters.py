"""Physical numbers are data: `assets/parameters/<sheet>.toml`, each with range, source and status.

One table a parameter::

    [line_density_kg_m]
    value = 4.1
    low = 3.3
    high = 4.9
    unit = "kg/m"
    source = "..."
    status = "published"        # measured | published | derived | assumed

A sheet fills a frozen dataclass whose fields are exactly its keys. Scenarios may override a value inside [low, high].
"""

import tomllib
from collections.abc import Mapping
from dataclasses import dataclass, fields
from functools import cache
from importlib.resources import files
from numbers import Real
from typing import Any, TypeVar

import numpy as np

from dockair.errors import DockairError

STATUSES = ("measured", "published", "derived", "assumed")
_KEYS = {"value", "low", "high", "unit", "source", "status"}

T = TypeVar("T")


@dataclass(frozen=True, slots=True)
class Parameter:
    """One number (or short vector) and where it comes from."""

    value: Any
    low: Any
    high: Any
    unit: str
    source: str
    status: str


def sheet_names() -> list[str]:
    """Names of the parameter sheets that exist."""
    folder = files("dockair.assets").joinpath("parameters")
    return sorted(f.name.removesuffix(".toml") for f in folder.iterdir() if f.name.endswith(".toml"))


@cache
def read_sheet(sheet: str) -> Mapping[str, Parameter]:
    """All parameters of a sheet, checked: no missing field, no empty source, low <= value <= high."""
    if sheet not in sheet_names():  # a file that is found by a path, as "../parameters/hose", is no sheet of that name
        raise DockairError("parameters", expected="a parameter sheet", got=sheet, exists=sheet_names())
    path = files("dockair.assets").joinpath("parameters", f"{sheet}.toml")
    table = tomllib.loads(path.read_text(encoding="utf-8"))
    return {key: _parameter(f"{sheet}.toml: {key}", entry) for key, entry in table.items()}


def _parameter(where: str, entry: dict[str, Any]) -> Parameter:
    if set(entry) != _KEYS:
        raise DockairError(where, expected=f"the keys {sorted(_KEYS)}", got=sorted(entry))
    parameter = Parameter(**entry)
    if parameter.status not in STATUSES:
        raise DockairError(f"{where}.status", expected="a status", got=parameter.status, exists=STATUSES)
    if not parameter.source.strip():
        raise DockairError(f"{where}.source", expected="where the number comes from", got=parameter.source)
    _check_range(where, parameter, parameter.value)
    return parameter


def _check_range(where: str, parameter: Parameter, value: Any) -> None:
    shape = " x ".join(map(str, np.shape(parameter.value)))
    numbers = f"{shape} numbers, each" if shape else "a number"
    expected = f"{numbers} in [{parameter.low}, {parameter.high}] {parameter.unit}"
    if not all(isinstance(v, Real) and not isinstance(v, bool) for v in np.asarray(value, dtype=object).ravel()):
        raise DockairError(where, expected=expected, got=value)
    try:
        array = np.asarray(value, dtype=float)
    except OverflowError:  # a whole number beyond all floats
        raise DockairError(where, expected=expected, got=value) from None
    right_shape = array.shape == np.shape(parameter.value)
    if not right_shape or not np.all(array >= parameter.low) or not np.all(array <= parameter.high):
        raise DockairError(where, expected=expected, got=value)


def load_parameters(sheet: str, cls: type[T], overrides: Mapping[str, Any] | None = None) -> T:
    """Fill a parameters dataclass from its sheet.

    Args:
        sheet: name of the sheet, without `.toml`.
        cls: frozen dataclass; field names are the sheet's keys. Vectors become read-only float arrays,
            integer values stay integers.
        overrides: values that replace the sheet's, inside its ranges.

    Raises:
        DockairError: unknown sheet or key, value out of range, keys and fields differ, or what the class refuses.
    """
    parameters = read_sheet(sheet)
    names = {f.name for f in fields(cls)}  # type: ignore[arg-type]
    if names != set(parameters):
        raise DockairError(f"{sheet}.toml", expected=f"the keys {sorted(names)}", got=sorted(parameters))
    values = {key: parameter.value for key, parameter in parameters.items()}
    for key, value in (overrides or {}).items():
        where = f"parameters.{sheet}.{key}"
        if key not in parameters:
            raise DockairError(where, expected="a parameter", got=key, exists=sorted(parameters))
        _check_range(where, parameters[key], value)
        if isinstance(parameters[key].value, int) and not float(value).is_integer():
            raise DockairError(where, expected="an integer", got=value)
        values[key] = type(parameters[key].value)(value)
    try:
        return cls(**{key: _frozen(value) for key, value in values.items()})
    except DockairError as error:  # the class knows its key, not of which sheet of its kind it is
        raise error.at(f"parameters.{sheet}.{error.where.partition('.')[2]}") from None


def _frozen(value: Any) -> Any:
    if isinstance(value, list):
        array = np.array(value, dtype=float)
        array.setflags(write=False)
        return array
    return value
