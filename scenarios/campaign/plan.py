"""The tables of a plan: which scenarios, which seeds, what is drawn, what the gate asks for.

Only `name` and `scenarios` are required. Unknown keys are refused. A scenario is a name of the library or the path of a
TOML file from the plan's folder.
"""

import operator
from collections.abc import Callable, Iterator
from typing import Annotated, Any

from pydantic import BeforeValidator, Field

from dockair.scenarios.campaign.draws import Draw, SamplerName
from dockair.scenarios.dotted_key import holders_of
from dockair.scenarios.refusal import Expected, refused
from dockair.scenarios.tables.table import Table, tuple_from_list
from dockair.streams import LARGEST_SEED

MOST_SEEDS = 100_000


def _seeds(value: Any) -> Any:
    if isinstance(value, int) and not isinstance(value, bool) and 1 <= value <= MOST_SEEDS:
        return tuple(range(value))
    return tuple_from_list(value)


def flat(value: Any, is_value: Callable[[dict[str, Any]], bool] = operator.not_) -> Any:
    """Return nested tables as one of dotted keys; what is not a table as it is.

    Args:
        value: as it was read.
        is_value: whether a table is one of the values; an empty one by default, as `--set` takes it.

    Raises:
        PydanticCustomError: a key is there twice, dotted and in its table: one of its values would go unsaid.
    """
    if not isinstance(value, dict):
        return value
    level: dict[str, Any] = {}
    for key, entry in _dotted(value, is_value):
        if key in level:
            raise refused("every key once", f"{key}, twice")
        level[key] = entry
    for key in level:
        for table in holders_of(key):
            if table in level:  # an empty one, or a list: it would take the key's place, or not, as they are written
                raise refused("every key once", f"{table} and {key}")
    return level


def _dotted(table: dict[str, Any], is_value: Callable[[dict[str, Any]], bool]) -> Iterator[tuple[str, Any]]:
    for key, entry in table.items():
        if isinstance(entry, dict) and not is_value(entry):
            yield from ((f"{key}.{name}", inner) for name, inner in _dotted(entry, is_value))
        else:
            yield key, entry


def _flat_draws(value: Any) -> Any:
    return flat(value, lambda table: not table or not all(isinstance(entry, dict) for entry in table.values()))


_Seed = Annotated[int, Field(ge=0, le=LARGEST_SEED)]
_Seeds = Annotated[
    tuple[_Seed, ...],
    Field(min_length=1),
    BeforeValidator(_seeds),
    Expected(f"how many seeds, from 1 to {MOST_SEEDS}, or a list of seeds, each from 0 to 2^63 - 1"),
]
_Set = Annotated[dict[str, Any], BeforeValidator(flat)]
_Rate = Annotated[Annotated[float, Field(gt=0.0, le=1.0)] | None, Expected("a number above 0, up to 1")]


class Entry(Table):
    """One scenario of the plan."""

    scenario: str
    seeds: Annotated[_Seeds | None, Expected("how many seeds, or a list of seeds")] = None  #: instead of the plan's
    set: _Set = {}  #: dotted key -> value, over the plan's


class RatesAsked(Table):
    """Rates that a build must not have lost."""

    success_rate: _Rate = None
    first_attempt_rate: _Rate = None


class Gate(RatesAsked):
    """When the campaign has failed; the rates are asked of every scenario by itself."""

    false_alarm: float = Field(default=0.001, gt=0.0, lt=0.5)  #: of all tests of rates together
    unsafe_max: int = Field(default=0, ge=0)  #: flights in which anything was unsafe, in all
    errors_max: int = Field(default=0, ge=0)  #: flights that ended in an error, in all
    scenarios: dict[str, Any] = {}  #: scenario -> rates instead of those for all

    def rates_of(self, scenario: str) -> RatesAsked:
        """Return the rates asked of a scenario."""
        if scenario in self.scenarios:
            return RatesAsked.model_validate(self.scenarios[scenario])
        return RatesAsked(success_rate=self.success_rate, first_attempt_rate=self.first_attempt_rate)


class Plan(Table):
    """A campaign as data."""

    name: Annotated[str, Field(pattern=r"^\w[\w.-]*$"), Expected("a name of letters, digits, _ . -")]
    claim: str = ""  #: the sentence that the campaign is there to show
    scenarios: Annotated[
        tuple[Entry, ...],
        Field(min_length=1),
        BeforeValidator(tuple_from_list),
        Expected("a list of scenarios, each a name or a table with scenario, seeds, set"),
    ]
    seeds: _Seeds = (0,)
    first_seed: int = Field(default=0, ge=0, le=2**62)  #: added to every seed
    set: _Set = {}  #: dotted key -> value instead of the scenario's
    draw: Annotated[dict[str, Any], BeforeValidator(_flat_draws)] = {}  #: dotted key -> table of `Draw`
    sampler: SamplerName = "latin_hypercube"
    draws: int | None = Field(default=None, ge=1, le=MOST_SEEDS)  #: points, flown with every seed; none: one a seed
    draw_seed: int = Field(default=0, ge=0, le=2**62)
    timeout_s: float = Field(default=1800.0, gt=0.0)  #: wall time of a flight, after which it is given up
    gate: Gate = Gate()

    @property
    def asked(self) -> Gate | None:
        """The gate, if the plan has one."""
        return self.gate if "gate" in self.model_fields_set else None

    @property
    def drawn(self) -> dict[str, Draw]:
        """What is drawn, by dotted key."""
        return {key: Draw.model_validate(table) for key, table in self.draw.items()}
