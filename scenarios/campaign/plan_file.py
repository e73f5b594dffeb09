"""Finds and reads a plan's TOML, lays what the command line says over it, and refuses what cannot be flown."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any, TypeVar

from pydantic import ValidationError

from dockair.errors import DockairError
from dockair.scenarios.campaign.draws import Draw
from dockair.scenarios.campaign.plan import Plan, RatesAsked
from dockair.scenarios.refusal import refusal
from dockair.scenarios.scenario_file import scenario_names
from dockair.scenarios.schema import Scenario
from dockair.scenarios.tables.table import Table
from dockair.scenarios.toml_files import PLANS, SCENARIOS, read_toml, toml_value

_T = TypeVar("_T", bound=Table)
_OF_SCENARIOS = Scenario.model_fields.keys() - Plan.model_fields.keys()  # keys that only a scenario has


def plan_names() -> list[str]:
    """Names of the packaged plans."""
    return PLANS.names()


class PlanFile:
    """A plan and where it was found.

    Args:
        name_or_path: a name among the packaged plans, or the path of a TOML file.
        changes: keys of the plan instead of the file's, from the command line.
        settings: dotted key -> value over every other, from the command line's `--set`; texts are read as TOML.

    Attributes:
        plan: checked.
        folder: that holds the file; paths in it begin there.
        settings: what `--set` says, as values.

    Raises:
        DockairError: no such plan; not TOML; a scenario; unknown key, wrong type or value out of range.
    """

    def __init__(
        self,
        name_or_path: str | Path,
        changes: Mapping[str, object] | None = None,
        settings: Mapping[str, str] | None = None,
    ) -> None:
        path = PLANS.find(name_or_path)
        self.folder = path.parent
        self._shown = PLANS.shown(path)
        self.settings = {key: toml_value(text) for key, text in (settings or {}).items()}
        table = read_toml(path)
        if "scenarios" not in table and not _OF_SCENARIOS.isdisjoint(table):
            raise SCENARIOS.misplaced(self._shown, PLANS.kind, name_or_path)
        if isinstance(table.get("scenarios"), list):
            table["scenarios"] = _expanded(table["scenarios"], own_seeds="seeds" not in (changes or {}))
        self.plan = self._checked(Plan, table | dict(changes or {}), "")
        self._check_draws(own_sampler=table.get("sampler", Plan.model_fields["sampler"].default))
        self._check_gate()

    def place(self, key: str) -> str:
        """Return where a key of the plan was written."""
        return f"{self._shown}: {key}"

    def _check_draws(self, own_sampler: str) -> None:
        """Refuse draws that say nothing, or two things.

        Args:
            own_sampler: the file's; the command line may have another for a plan that has points, or a draw_seed.
        """
        plan = self.plan
        for key, table in plan.draw.items():
            draw = self._checked(Draw, table, f'draw."{key}"')
            draw.check(self.place(f'draw."{key}"'))
            if draw.points is not None and "grid" not in (own_sampler, plan.sampler):
                expected = 'none, or sampler = "grid": only a grid has points'
                raise DockairError(self.place(f'draw."{key}".points'), expected=expected, got=draw.points)
            if key in self.settings:
                raise DockairError(f"--set {key}", expected="a key that the plan does not draw", got=key)
        on_grid, at_random = plan.sampler == "grid", "keys to draw at random or by Latin hypercube, or no"
        may_decide_nothing = (
            ("sampler", "keys to draw, or no sampler", False),
            ("draws", f"{at_random} number of draws", on_grid),
            ("draw_seed", f"{at_random} seed of the draws", on_grid and own_sampler == "grid"),
        )
        for key, expected, in_vain in may_decide_nothing:
            if key in plan.model_fields_set and (in_vain or not plan.draw):
                raise DockairError(self.place(key), expected=expected, got=getattr(plan, key))

    def _check_gate(self) -> None:
        for name, table in self.plan.gate.scenarios.items():
            self._checked(RatesAsked, table, f"gate.scenarios.{name}")

    def _checked(self, model: type[_T], table: Any, owner: str) -> _T:
        if not isinstance(table, dict):
            raise DockairError(self.place(owner), expected="a table", got=table)
        try:
            return model.model_validate(table)
        except ValidationError as error:
            raise refusal(error, model, lambda key: self.place(".".join(filter(None, (owner, key))))) from None


def _expanded(entries: list[Any], *, own_seeds: bool) -> list[Any]:
    """Return the entries with "*" as every scenario of the library; without seeds of their own where all get others."""
    found: list[Any] = []
    for entry in entries:
        table = entry if isinstance(entry, dict) else {"scenario": entry}
        kept = table if own_seeds else {key: value for key, value in table.items() if key != "seeds"}
        names = scenario_names() if table.get("scenario") == "*" else [table.get("scenario")]
        found += [kept | {"scenario": name} for name in names] if "scenario" in table else [entry]
    return found
