"""What a group's scenario claims, and what it lacks of the figures that it is held to."""

import shlex
from collections.abc import Sequence

from dockair.errors import DockairError
from dockair.scenarios.report.groups import Group
from dockair.scenarios.schema import Scenario, load_scenario


def scenario_of(group: Group) -> Scenario | None:
    """Return the scenario as its file says it; None where that file is not to be found any more."""
    try:
        return load_scenario(shlex.split(group.rows[0]["command"])[2])
    except DockairError:
        return None


def claim_of(group: Group) -> str:
    """Return the sentence that the scenario is there to show; "" where there is none."""
    scenario = scenario_of(group)
    return "" if scenario is None else scenario.claim.rstrip(".")


def shortfalls_of(group: Group) -> Sequence[str] | None:
    """Return what the group lacks; None where nothing is asked of it.

    A scenario's figures are asked of flights as it is written: with no key set, and so neither of perfect navigation
    in place of its camera nor of another controller.
    """
    scenario = scenario_of(group)
    if scenario is None or not scenario.accept.claims_figures:
        return None
    as_written = not any(" --set " in row["command"] for row in group.rows)
    return scenario.accept.judge(group.rows) if as_written else None
