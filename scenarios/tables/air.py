"""The tables of a scenario that set the air in motion; each can be switched off alone.

| table         | keys                          | what it stirs                                                     |
|---------------|-------------------------------|-------------------------------------------------------------------|
| [turbulence]  | sigma_m_s or intensity, model | Dryden gusts on hose, drogue and receiver                         |
| [[gusts]]     | at_s, length_m, velocity_m_s  | a single gust that rides past all of them                         |
| [wake]        | present                       | the tanker's vortices, on hose, drogue and receiver               |
| [bow_wave]    | present                       | the receiver's displacement of the air, on hose and drogue        |
"""

from collections.abc import Mapping
from typing import Annotated, Any, Literal, Self

from pydantic import BeforeValidator, Field, model_validator

from dockair.errors import DockairError
from dockair.scenarios.refusal import Expected
from dockair.scenarios.tables.table import Table, tuple_from_list

_GustSpeed = Annotated[float, Field(ge=-30.0, le=30.0)]


class Turbulence(Table):
    """Gusts. One of `sigma_m_s` and `intensity`; without either the air is still."""

    model: Literal["none", "dryden"] = "none"  #: "dryden" as soon as one of the others is given; "none" overrules them
    sigma_m_s: float | None = Field(default=None, ge=0.0, le=15.0)  #: standard deviation of each component of the gusts
    intensity: Literal["light", "moderate", "severe"] | None = None  #: MIL-F-8785C, at the altitude, from 610 m on

    @model_validator(mode="before")
    @classmethod
    def _model_follows(cls, table: Any) -> Any:
        if isinstance(table, Mapping) and "model" not in table and ("sigma_m_s" in table or "intensity" in table):
            return {**table, "model": "dryden"}
        return table

    @model_validator(mode="after")
    def _one_strength(self) -> Self:
        if self.sigma_m_s is not None and self.intensity is not None:
            raise DockairError(
                "turbulence",
                expected="one of sigma_m_s and intensity",
                got={"sigma_m_s": self.sigma_m_s, "intensity": self.intensity},
            )
        if self.model == "dryden" and self.sigma_m_s is None and self.intensity is None:
            raise DockairError("turbulence", expected="sigma_m_s or intensity beside the model", got=self.model)
        return self


class SingleGust(Table):
    """One gust of 1 - cosine shape."""

    at_s: float = Field(ge=0.0, le=600.0)  #: when its front meets the drogue
    length_m: float = Field(ge=1.0, le=1000.0)  #: from its front to its peak
    velocity_m_s: Annotated[
        tuple[_GustSpeed, _GustSpeed, _GustSpeed],
        BeforeValidator(tuple_from_list),
        Expected("three numbers from -30 to 30"),
    ]  #: at its peak: forward, left, up


class Wake(Table):
    """The tanker's wake; sheet `wake`."""

    present: bool = True  #: whether there is one


class BowWave(Table):
    """The receiver's bow wave; sheet `bow_wave`."""

    present: bool = True  #: whether there is one


Gusts = Annotated[
    tuple[SingleGust, ...],
    BeforeValidator(tuple_from_list),
    Expected("tables [[gusts]], each with at_s, length_m and velocity_m_s"),
]
