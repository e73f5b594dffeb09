"""A scenario file (TOML) becomes a frozen `Scenario`: data only, unknown keys refused, units converted here alone.

Keys carry their unit. Degrees and other units of people stop here: properties without `_deg` are SI and radians.
Only `name` is required; every other key has the default written below.
"""

import tomllib
from collections.abc import Iterator, Mapping
from importlib.resources import files
from pathlib import Path
from typing import Annotated, Any, Literal, Self

import numpy as np
from pydantic import BaseModel, BeforeValidator, ConfigDict, Field, ValidationError, model_validator

from dockair.clock import Clock
from dockair.errors import DockairError
from dockair.parameters import check_overrides
from dockair.rotations import Array
from dockair.scenarios.refusal import Expected, refusal

OutcomeName = Literal["contact", "miss", "rim_strike", "abort", "collision", "timeout"]

#: `--set` of the one replaces the other, which the file may have given.
_ALTERNATIVES = {"turbulence.sigma_m_s": "turbulence.intensity", "turbulence.intensity": "turbulence.sigma_m_s"}


def _tuple_from_list(value: Any) -> Any:
    return tuple(value) if isinstance(value, list) else value


_NonNegative = Annotated[float, Field(ge=0.0)]
_ThreeSigmas = Annotated[
    tuple[_NonNegative, _NonNegative, _NonNegative],
    BeforeValidator(_tuple_from_list),
    Expected("three numbers, each 0 or more"),
]
_Rate = Annotated[int, Field(ge=1, le=100_000)]


class _Table(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True, strict=True, allow_inf_nan=False)


class Flight(_Table):
    """The tanker's steady flight, and how long an attempt may take."""

    airspeed_m_s: float = Field(180.0, ge=100.0, le=250.0)  #: true airspeed
    altitude_m: float = Field(6000.0, ge=0.0, le=15000.0)
    duration_s: float = Field(60.0, gt=0.0, le=600.0)


class Rates(_Table):
    """How often everything happens; all divide the physics rate."""

    physics_hz: _Rate = 1000
    gyro_hz: _Rate = 500
    control_hz: _Rate = 100
    camera_hz: _Rate = 50

    @model_validator(mode="after")
    def _fit(self) -> Self:
        clock = Clock(self.physics_hz)
        for name in ("gyro_hz", "control_hz", "camera_hz"):
            clock.ticks_per(getattr(self, name), f"rates.{name}")
        if self.camera_hz > self.control_hz:
            expected = f"a rate up to the control rate {self.control_hz} Hz: a control tick takes one frame"
            raise DockairError("rates.camera_hz", expected=expected, got=self.camera_hz)
        if self.gyro_hz < self.control_hz:
            expected = f"a rate from the control rate {self.control_hz} Hz on: every control tick needs a sample"
            raise DockairError("rates.gyro_hz", expected=expected, got=self.gyro_hz)
        return self


class Turbulence(_Table):
    """Gusts. One of `sigma_m_s` and `intensity`; without either the air is still."""

    model: Literal["none", "dryden"] = "none"  #: "dryden" as soon as one of the others is given; "none" overrules them
    sigma_m_s: float | None = Field(None, ge=0.0, le=15.0)
    intensity: Literal["light", "moderate", "severe"] | None = None  #: MIL-F-8785C, at the flight's altitude

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


class Sun(_Table):
    """Where the Sun stands, seen from the receiver in level flight."""

    present: bool = True
    azimuth_deg: float = Field(180.0, ge=-360.0, le=360.0)  #: 0 straight ahead, positive to the left
    elevation_deg: float = Field(35.0, ge=-10.0, le=90.0)

    @property
    def direction_W(self) -> Array | None:
        """(3,) unit vector toward the Sun in W, None without Sun."""
        if not self.present:
            return None
        azimuth, elevation = np.radians(self.azimuth_deg), np.radians(self.elevation_deg)
        across = np.cos(elevation)
        return np.array([across * np.cos(azimuth), across * np.sin(azimuth), np.sin(elevation)])


class Start(_Table):
    """Where the probe's tip starts from the ring's centre, and how far off the navigation is told it may be."""

    aft_m: float = Field(4.0, ge=0.5, le=40.0)  #: behind
    left_m: float = Field(0.0, ge=-20.0, le=20.0)
    up_m: float = Field(0.0, ge=-20.0, le=20.0)
    sigma_m: _ThreeSigmas = (0.3, 0.3, 0.3)  #: forward, left, up
    sigma_attitude_deg: float = Field(5.0, ge=0.0, le=30.0)  #: of the drogue, about each axis

    @property
    def p_PD_B(self) -> Array:
        """(3,) nominal ring centre from the probe's tip, body axes [m]."""
        return np.array([self.aft_m, -self.left_m, -self.up_m])

    @property
    def sigma_p_m(self) -> Array:
        """(3,) standard deviation of the ring's centre [m]."""
        return np.array(self.sigma_m)

    @property
    def sigma_R_rad(self) -> float:
        """Standard deviation of the drogue's attitude about each axis [rad]."""
        return float(np.radians(self.sigma_attitude_deg))


class Navigation(_Table):
    """Who navigates: a class with `messages.Navigates`' method, or "truth" for perfect navigation."""

    navigator: Annotated[
        str,
        Field(pattern=r"^(truth|[A-Za-z_][\w.]*:[A-Za-z_]\w*)$"),
        Expected('"truth" or "module:Class"'),
    ] = "dockair.nav.navigator:Navigator"

    @property
    def is_truth(self) -> bool:
        """Whether the truth stands in place of `nav`."""
        return self.navigator == "truth"


class Guidance(_Table):
    """How the receiver docks."""

    closure_speed_m_s: float = Field(1.2, ge=0.3, le=2.6)  #: 2.6 m/s (5 kt) is the service limit
    hold_s: float = Field(5.0, ge=0.0, le=300.0)
    take_in_m: float = Field(1.5, ge=0.0, le=6.0)  #: hose pushed in before holding
    stabilise_s: float = Field(3.0, ge=0.0, le=60.0)  #: steady in pre-contact before closing


class Hardware(_Table):
    """Calibration sheets of one's own, as paths from the scenario's file; without them the project's."""

    camera: str | None = None
    ring: str | None = None


class Accept(_Table):
    """What a flight must show for its claim to hold; empty when the scenario claims nothing in figures."""

    outcome: OutcomeName | None = None
    radial_offset_max_m: float | None = Field(None, gt=0.0)
    closure_speed_min_m_s: float | None = Field(None, ge=0.0)
    closure_speed_max_m_s: float | None = Field(None, gt=0.0)

    def shortfalls(self, outcome: str, radial_offset_m: float | None, closure_speed_m_s: float | None) -> list[str]:
        """Return a line for each figure that the flight did not reach; the two figures are None without contact."""
        lines = []
        if self.outcome is not None and outcome != self.outcome:
            lines.append(f"outcome {outcome}, wanted {self.outcome}")
        limits = (
            ("radial offset", radial_offset_m, 0.0, self.radial_offset_max_m, "m"),
            ("closure speed", closure_speed_m_s, self.closure_speed_min_m_s, self.closure_speed_max_m_s, "m/s"),
        )
        for label, value, low, high, unit in limits:
            if value is None:
                continue
            low, high = low or 0.0, np.inf if high is None else high
            if not low <= value <= high:  # also when the value is NaN
                lines.append(f"{label} {value:.3f} {unit}, wanted {low:g} to {high:g}")
        return lines


class Scenario(_Table):
    """One flight as data."""

    name: Annotated[str, Field(pattern=r"^\w[\w.-]*$"), Expected("letters, digits, _ . -")]
    claim: str = ""  #: the sentence that the flight is there to show
    seed: int = Field(0, ge=0, le=2**63 - 1)
    flight: Flight = Flight()
    rates: Rates = Rates()
    turbulence: Turbulence = Turbulence()
    sun: Sun = Sun()
    start: Start = Start()
    navigation: Navigation = Navigation()
    guidance: Guidance = Guidance()
    hardware: Hardware = Hardware()
    parameters: dict[str, dict[str, Any]] = {}  #: sheet -> key -> value instead of the sheet's
    accept: Accept = Accept()

    @model_validator(mode="after")
    def _parameters_fit(self) -> Self:
        for sheet, overrides in self.parameters.items():
            check_overrides(sheet, overrides)
        return self


def scenario_names() -> list[str]:
    """Names in the library, the default first."""
    return sorted(_library(), key=lambda name: (name != "default", name))
