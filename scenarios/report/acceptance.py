"""What a group's scenario claims, and what it lacks of the figures that it is held to.

Both are of the library's scenarios alone, and of flights as these are written: with no key set, and so neither of
perfect navigation in place of the camera nor of another controller; and of a scenario that still flies what was flown,
by its digest. A file of one's own may have changed since it was flown, or be another one from here; its campaign's
summary says what it claims.
"""

from collections.abc import Sequence

from dockair.scenarios.report.groups import Group, Row
from dockair.scenarios.report.settings import file_and_settings
from dockair.scenarios.scenario_file import scenario_names
from dockair.scenarios.scenario_hash import scenario_hash
from dockair.scenarios.schema import Scenario, load_scenario


def scenario_of(group: Group) -> Scenario | None:
    """Return the library's scenario that all of the group's flights flew as it is written, None if there is none."""
    names = {_flown_as_written(row) for row in group.rows}
    name = names.pop() if len(names) == 1 else ""
    if name not in scenario_names():
        return None
    scenario = load_scenario(name)
    return scenario if {row["scenario_hash"] for row in group.rows} == {scenario_hash(scenario)} else None


def claim_of(group: Group) -> str:
    """Return the sentence that the scenario is there to show; "" where there is none."""
    scenario = scenario_of(group)
    return "" if scenario is None else scenario.claim.rstrip(".")


def shortfalls_of(group: Group) -> Sequence[str] | None:
    """Return what the group lacks; None where nothing is asked of it."""
    scenario = scenario_of(group)
    if scenario is None or not scenario.accept.claims_figures:
        return None
    return scenario.accept.judge(group.rows)


def _flown_as_written(row: Row) -> str:
    """Return the scenario's name or path from the flight's command; "" where a key is set."""
    name, settings = file_and_settings(row)
    return "" if settings else name
