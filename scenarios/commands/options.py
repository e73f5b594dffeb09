"""What the commands of the command line have in common: options, and how one JSON object is printed."""

import json
import sys
from contextlib import AbstractContextManager, nullcontext, redirect_stdout
from typing import Annotated, Any

import typer

from dockair.errors import DockairError
from dockair.streams import LARGEST_SEED

Json = Annotated[bool, typer.Option("--json", help="Print one JSON object on stdout and nothing else.")]
ScenarioName = Annotated[
    str, typer.Argument(metavar="SCENARIO", help="A name in the library (scenarios lists them) or a TOML path.")
]
Settings = Annotated[
    list[str] | None,
    typer.Option(
        "--set", metavar="KEY=VALUE", help="Dotted key and TOML value (scenarios --keys lists them); may be repeated."
    ),
]
Seed = Annotated[
    int | None, typer.Option(min=0, max=LARGEST_SEED, help="Seed of every random stream; the scenario's by default.")
]


def overrides(settings: list[str] | None) -> dict[str, str]:
    """Return dotted key -> TOML value of `--set`.

    Raises:
        DockairError: a setting without key or equals sign.
    """
    found: dict[str, str] = {}
    for setting in settings or ():
        key, equals, value = setting.partition("=")
        if not equals or not key.strip():
            raise DockairError("--set", expected="key=value, as in turbulence.sigma_m_s=1.1", got=setting)
        found.pop(key.strip(), None)  # the later holds, also against another key that says the same thing
        found[key.strip()] = value.strip()
    return found


def stdout_kept(as_json: bool) -> AbstractContextManager[object]:
    """Keep stdout for the one object: whatever a navigator of one's own prints meanwhile goes to stderr."""
    return redirect_stdout(sys.stderr) if as_json else nullcontext()


def print_json(table: Any) -> None:
    """Print one object, and no NaN: JSON has none."""
    typer.echo(json.dumps(table, allow_nan=False))
