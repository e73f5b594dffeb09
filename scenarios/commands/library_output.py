"""What `dockair scenarios` shows: the library with its claims and what each is held to, one scenario, or keys."""

from collections.abc import Sequence

from rich.table import Table

from dockair.scenarios.commands.keys import Key
from dockair.scenarios.commands.output import plain_console
from dockair.scenarios.scenario_file import scenario_text
from dockair.scenarios.schema import Scenario


def show_scenarios(scenarios: Sequence[Scenario]) -> None:
    """Print the library."""
    table = Table(box=None, padding=(0, 1))
    table.add_column("scenario", no_wrap=True)
    for heading in ("claim", "held to"):
        table.add_column(heading)
    for scenario in scenarios:
        table.add_row(scenario.name, scenario.claim, scenario.accept.in_words)
    plain_console().print(table)


def show_keys(keys: Sequence[Key]) -> None:
    """Print keys that a scenario may set."""
    table = Table(box=None, padding=(0, 1))
    table.add_column("key", no_wrap=True)
    for heading in ("default", "range", "meaning"):
        table.add_column(heading)
    for key in keys:
        table.add_row(key.name, key.default, f"{key.range} {key.unit}".strip(), key.meaning)
    plain_console().print(table)


def show_scenario(name: str, scenario: Scenario) -> None:
    """Print one scenario as its file has it, and what it is held to.

    Args:
        name: in the library, or the path of its file.
        scenario: the same, read.
    """
    console = plain_console()
    console.print(scenario_text(name).rstrip(), soft_wrap=True)
    if scenario.accept.claims_figures:
        console.print(f"\nheld to: {scenario.accept.in_words}", soft_wrap=True)
