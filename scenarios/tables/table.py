"""What every table of a scenario file is: frozen, strict, unknown keys refused."""

from typing import Any

from pydantic import BaseModel, ConfigDict


class Table(BaseModel):
    """Base of all tables."""

    model_config = ConfigDict(extra="forbid", frozen=True, strict=True, allow_inf_nan=False)


def tuple_from_list(value: Any) -> Any:
    """Arrays of TOML are lists; ours are tuples, which nobody can change."""
    return tuple(value) if isinstance(value, list) else value


def as_written(value: Any) -> Any:
    """Return a tuple as the list that it was in TOML: so errors say what was got."""
    return list(value) if isinstance(value, tuple) else value
