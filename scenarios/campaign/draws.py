"""Parameters that differ from flight to flight: what may be drawn, and the three ways to draw it.

A sampler places points u in the unit cube, a coordinate a drawn key; a `Draw` maps its coordinate to a value:

    uniform      low + u (high - low)           log: low (high / low)^u              (1)
    values       values[floor(u n)]                                                  (2)
    normal       mean + sigma Phi^-1(u)                                              (3)

grid: every combination of the values, or of `points` equally spaced ones from low to high. random: independent points.
latin_hypercube: of n points each of the n equal slices of every coordinate holds one [McKay, Beckman & Conover 1979].
"""

import itertools
import math
from collections.abc import Callable, Mapping
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import BeforeValidator, Field

from dockair.errors import DockairError
from dockair.scenarios.refusal import Expected
from dockair.scenarios.tables.table import Table, as_written, tuple_from_list

SamplerName = Literal["grid", "random", "latin_hypercube"]
Value = bool | int | float | str
Point = dict[str, Value]  #: dotted key -> value

_FORMS = "low and high, or values, or mean and sigma"


class Draw(Table):
    """How one key is drawn."""

    low: float | None = None
    high: float | None = None
    log: bool = False  #: equal in the logarithm
    points: int | None = Field(default=None, ge=2, le=10_000)  #: of a grid, from low to high
    values: Annotated[
        tuple[Any, ...] | None, BeforeValidator(tuple_from_list), Expected("a list of numbers, texts, true or false")
    ] = None
    mean: float | None = None
    sigma: float | None = Field(default=None, gt=0.0)

    def check(self, where: str) -> None:
        """Refuse what is not one of the three forms.

        Args:
            where: the table's place, to be named.
        """
        allowed = ({"low", "high"}, {"values"}, {"mean", "sigma"})
        given = self.model_fields_set - {"log", "points"}
        if given not in allowed:
            raise DockairError(where, expected=_FORMS, got=sorted(given))
        if not self.model_fields_set <= {"low", "high", "log", "points"} and (self.log or self.points):
            raise DockairError(where, expected="log and points beside low and high only", got=sorted(given))
        if self.low is not None and self.high is not None and not self.low < self.high:
            raise DockairError(f"{where}.high", expected=f"a number above low = {self.low:g}", got=self.high)
        if self.log and self.low is not None and self.low <= 0.0:
            raise DockairError(f"{where}.low", expected="a number above 0 where log = true", got=self.low)
        if self.values is not None and not (self.values and all(isinstance(v, Value) for v in self.values)):
            expected = "one number, text, true or false at least"
            raise DockairError(f"{where}.values", expected=expected, got=as_written(self.values))

    def at(self, u: float) -> Value:
        """Return the value at u in [0, 1], Eqs. (1) to (3)."""
        if self.values is not None:
            value: Value = self.values[min(int(u * len(self.values)), len(self.values) - 1)]
            return value
        if self.low is not None and self.high is not None:
            return self._between(self.low, self.high, u)
        from scipy.special import ndtri  # slow to import; only those who draw wait for it

        assert self.mean is not None and self.sigma is not None
        return self.mean + self.sigma * float(ndtri(u))

    def on_grid(self, where: str) -> list[Value]:
        """Return the values that a grid takes.

        Raises:
            DockairError: there is no saying which.
        """
        if self.values is not None:
            return list(self.values)
        if self.low is None or self.high is None or self.points is None:
            raise DockairError(where, expected="values, or low, high and points: the plan is a grid", got=None)
        return [self._between(self.low, self.high, k / (self.points - 1)) for k in range(self.points)]

    def _between(self, low: float, high: float, u: float) -> float:
        if u == 1.0:
            return high  # to the bit
        return low * math.exp(u * math.log(high / low)) if self.log else low + u * (high - low)


def grid(draws: Mapping[str, Draw], most: int, place: Callable[[str], str] = str) -> list[Point]:
    """Return every combination; one empty point where nothing is drawn.

    Args:
        draws: by dotted key.
        most: combinations that are not refused.
        place: from a key of the plan to where it was written.
    """
    axes = [draw.on_grid(place(f'draw."{key}"')) for key, draw in draws.items()]
    count = math.prod(map(len, axes))
    if count > most:
        raise DockairError(place("draw"), expected=f"a grid of up to {most} points", got=count)
    return [dict(zip(draws, values, strict=True)) for values in itertools.product(*axes)]


def samples(draws: Mapping[str, Draw], sampler: SamplerName, count: int, seed: int) -> list[Point]:
    """Return random points.

    Args:
        draws: by dotted key, one at least.
        sampler: random or latin_hypercube.
        count: of points.
        seed: of the points, apart from the flights' seeds.
    """
    generator = np.random.default_rng(seed)
    if sampler == "latin_hypercube":
        from scipy.stats import qmc

        cube = qmc.LatinHypercube(len(draws), rng=generator).random(count)
    else:
        cube = generator.random((count, len(draws)))
    return [{key: draw.at(float(u)) for (key, draw), u in zip(draws.items(), row, strict=True)} for row in cube]
