"""Turns what pydantic says about a wrong table into the one line of a `DockairError`: where, expected, got, exists."""

import types
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, Literal, Union, get_args, get_origin

from pydantic import BaseModel, ValidationError
from pydantic.fields import FieldInfo
from pydantic_core import ErrorDetails, PydanticCustomError

from dockair.errors import DockairError
from dockair.scenarios.tables.table import as_written

_WORDS = {float: "a number", int: "an integer", bool: "true or false", str: "a string", dict: "a table"}
_UNKNOWN = "extra_forbidden"  # pydantic's word for a key that does not exist
_SAID = "said"  # of a refusal that says itself what is expected


@dataclass(frozen=True, slots=True)
class Expected:
    """Says in a field's annotation what is expected where type and range alone do not."""

    text: str


def refused(expected: str, got: str) -> PydanticCustomError:
    """Return what a validator raises that knows better than the field's type what is wrong, but not where it stands."""
    return PydanticCustomError(_SAID, "{expected}", {"expected": expected, "got": got})


def refusal(error: ValidationError, model: type[BaseModel], place: Callable[[str], str]) -> DockairError:
    """Return one of the errors in one line, with the places of the others.

    A key that does not exist comes first: where it is misspelt, another one is missing, too.

    Args:
        error: what pydantic raised on validating `model`.
        model: the outermost model.
        place: from a dotted key to what its writer would call the place (file and key).
    """
    found = [_of_the_list(one) for one in error.errors(include_url=False)]
    places = [one["loc"] for one in found]
    # of a list with a wrong entry pydantic says besides that it is too short: only the entry is at fault
    found = [one for one in found if not any(_holds(one["loc"], place) for place in places)]
    first, *others = sorted(found, key=lambda one: one["type"] != _UNKNOWN)
    where = place(_dotted(first["loc"]))
    also = dict.fromkeys(_dotted(other["loc"]) for other in others if other["loc"] != first["loc"])
    if first["type"] == _UNKNOWN:
        name = str(first["loc"][-1])
        exists = [*sorted(_model_at(model, first["loc"][:-1]).model_fields), *_elsewhere(model, name)]
        return DockairError(where, expected="a known key", got=name, exists=exists, also=also)
    if first["type"] == _SAID:
        return DockairError(where, **first["ctx"], also=also)
    field = _field_at(model, first["loc"])
    if first["type"] == "missing":
        return DockairError(where, expected=_expected(field), got="nothing", also=also)
    choices = () if _is_list_asked(field, first["loc"]) else _choices(field)
    return DockairError(where, expected=_expected(field), got=as_written(first["input"]), exists=choices, also=also)


def _of_the_list(one: ErrorDetails) -> ErrorDetails:
    """Of a number that is missing in a list the list is at fault."""
    if one["type"] == "missing" and isinstance(one["loc"][-1], int):
        return {**one, "type": "too_short", "loc": one["loc"][:-1]}
    return one


def _holds(outer: Sequence[int | str], inner: Sequence[int | str]) -> bool:
    return len(outer) < len(inner) and tuple(inner[: len(outer)]) == tuple(outer)


def _dotted(location: Sequence[int | str]) -> str:
    text = ""
    for part in location:
        text += f"[{part}]" if isinstance(part, int) else f".{part}" if text else part
    return text


def _model_at(model: type[BaseModel], location: Sequence[int | str]) -> type[BaseModel]:
    for part in location:
        if isinstance(part, str):
            inner = inner_model(model.model_fields[part])
            assert inner is not None
            model = inner
    return model


def _elsewhere(model: type[BaseModel], name: str) -> list[str]:
    """Return the dotted keys that end in the name: its table is easily left out, or another one's taken."""
    inner = ((table, inner_model(field)) for table, field in model.model_fields.items())
    return [f"{table}.{name}" for table, fields in inner if fields is not None and name in fields.model_fields]


def inner_model(field: FieldInfo) -> type[BaseModel] | None:
    """Return the model of a table, or of the elements of an array of tables; None for any other field."""
    annotation = field.annotation
    if get_origin(annotation) is tuple:
        annotation = get_args(annotation)[0]
    return annotation if isinstance(annotation, type) and issubclass(annotation, BaseModel) else None


def _field_at(model: type[BaseModel], location: Sequence[int | str]) -> FieldInfo:
    """Return the field of the location; of an element (or of what lies deeper) the field that holds it."""
    field, inner = model.model_fields[str(location[0])], inner_model(model.model_fields[str(location[0])])
    rest = [part for part in location[1:] if isinstance(part, str)]
    return _field_at(inner, rest) if inner is not None and rest else field


def _alternatives(annotation: Any) -> list[Any]:
    """Return the types of a union without None, or the one type."""
    if get_origin(annotation) in (Union, types.UnionType):
        return [kind for kind in get_args(annotation) if kind is not type(None)]
    return [annotation]


def _is_list_asked(field: FieldInfo, location: Sequence[int | str]) -> bool:
    """Whether a list of tables is at fault as a whole, none of its entries."""
    return inner_model(field) is not None and get_origin(field.annotation) is tuple and isinstance(location[-1], str)


def _choices(field: FieldInfo) -> tuple[str, ...]:
    inner = inner_model(field)
    if inner is not None:  # a value where a table belongs: one of its keys was meant
        return tuple(sorted(inner.model_fields))
    kind = _alternatives(field.annotation)[0]
    return tuple(str(value) for value in get_args(kind)) if get_origin(kind) is Literal else ()


def _expected(field: FieldInfo) -> str:
    for item in field.metadata:
        if isinstance(item, Expected):
            return item.text
    kind = _alternatives(field.annotation)[0]
    if get_origin(kind) is Literal:
        return "one of the names that exist"
    if isinstance(kind, type) and issubclass(kind, BaseModel):
        return "a table"
    word = _WORDS.get(get_origin(kind) or kind, str(kind))
    return " ".join([word, *_bounds(field)])


def _bounds(field: FieldInfo) -> list[str]:
    """Return the range in words, from the constraints among the field's metadata."""
    limits = {
        name: getattr(item, name) for item in field.metadata for name in ("gt", "ge", "lt", "le") if hasattr(item, name)
    }
    words = []
    if "gt" in limits:
        words.append(f"above {limits['gt']}")
    if "ge" in limits:
        words.append(f"from {limits['ge']}" if "le" in limits else f"of at least {limits['ge']}")
    if "le" in limits:
        words.append(f"to {limits['le']}" if "ge" in limits else f"up to {limits['le']}")
    if "lt" in limits:
        words.append(f"below {limits['lt']}")
    return words
