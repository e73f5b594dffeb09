"""A scenario file (TOML) becomes a frozen `Scenario`: data only, unknown keys refused, units converted here alone.

Keys carry their unit. Degrees and other units of people stop here: properties without `_deg` are SI and radians.
Only `name` is required; every other key has the default written below.
"""

from collections.abc import Mapping
from dataclasses import make_dataclass
from pathlib import Path
from typing import Annotated, Any, Literal, Self

import numpy as np
from pydantic import BaseModel, BeforeValidator, ConfigDict, Field, ValidationError, model_validator

from dockair.clock import Clock
from dockair.errors import DockairError
from dockair.parameters import load_parameters, read_sheet
from dockair.rotations import Array
from dockair.scenarios.air_tables import BowWave, Gusts, Turbulence, Wake
from dockair.scenarios.fault_tables import FaultTable
from dockair.scenarios.refusal import Expected, refusal
from dockair.scenarios.scenario_file import ScenarioFile

OutcomeName = Literal["contact", "miss", "rim_strike", "abort", "collision", "timeout", "diverged"]


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


class FlightConditions(_Table):
    """The tanker's steady flight, and how long an attempt may take."""

    airspeed_m_s: float = Field(default=180.0, ge=100.0, le=250.0)  #: true airspeed
    altitude_m: float = Field(default=6000.0, ge=0.0, le=15000.0)
    duration_s: float = Field(default=60.0, gt=0.0, le=600.0)


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


class Tanker(_Table):
    """What the tanker flies; how fast it rolls and pulls over, and what it announces, sheet `tanker_path` says."""

    manoeuvre: Literal["straight", "racetrack", "toboggan"] = "straight"
    starts_s: float = Field(default=2.0, ge=0.0, le=600.0)  #: when the first turn, or the descent, begins
    turns: Literal["left", "right"] = "left"
    bank_deg: float = Field(default=25.0, gt=0.0, le=45.0)
    leg_s: float = Field(default=60.0, ge=0.0, le=600.0)  #: between two turns
    descent_deg: float = Field(default=3.0, gt=0.0, le=10.0)  #: of the toboggan, below the horizon


class Sun(_Table):
    """Where the Sun stands, seen from the receiver in level flight."""

    present: bool = True  #: false: daylight from above, but no disc, glints or stray light; `weather.night` is dark
    azimuth_deg: float = Field(default=180.0, ge=-360.0, le=360.0)  #: 0 straight ahead, positive to the left
    elevation_deg: float = Field(default=35.0, ge=-10.0, le=90.0)

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

    aft_m: float = Field(default=4.0, ge=0.5, le=40.0)  #: behind
    left_m: float = Field(default=0.0, ge=-20.0, le=20.0)
    up_m: float = Field(default=0.0, ge=-20.0, le=20.0)
    sigma_m: _ThreeSigmas = (0.3, 0.3, 0.3)  #: forward, left, up
    sigma_attitude_deg: float = Field(default=5.0, ge=0.0, le=30.0)  #: of the drogue, about each axis

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

    closure_speed_m_s: float = Field(default=1.2, ge=0.3, le=2.6)  #: 2.6 m/s (5 kt) is the service limit
    hold_s: float = Field(default=5.0, ge=0.0, le=300.0)
    take_in_m: float = Field(default=1.5, ge=0.0, le=6.0)  #: hose pushed in before holding
    stabilise_s: float = Field(default=3.0, ge=0.0, le=60.0)  #: steady in pre-contact before closing


class Weather(_Table):
    """What lies between and behind: clouds, haze, night."""

    cloud_cover: float = Field(default=0.0, ge=0.0, le=1.0)  #: part of the sky under the layer of broken cloud
    cloud_optical_depth: float = Field(default=8.0, gt=0.0, le=100.0)  #: mean, where there is cloud
    visibility_m: float = Field(default=100e3, ge=50.0, le=300e3)  #: meteorological optical range
    night: bool = False  #: no Sun, no daylight


class CameraOptions(_Table):
    """How the camera is run and simulated."""

    filter: Literal["long_pass", "band_pass"] = "long_pass"
    exposure: Literal["auto", "fixed"] = "auto"  #: "fixed": sheet `exposure`, exposure_s
    background: Literal["auto", "mujoco", "analytic"] = "auto"  #: "auto": MuJoCo where the machine has OpenGL


class Hardware(_Table):
    """The receiver, the grade of its IMU; calibration sheets of one's own, as paths from the scenario's file."""

    airframe: Literal["fighter", "unmanned"] = "fighter"
    imu: Literal["tactical", "mti", "consumer"] = "mti"
    camera: str | None = None
    ring: str | None = None

    @model_validator(mode="after")
    def _exist(self) -> Self:
        for key, path in (("camera", self.camera), ("ring", self.ring)):
            if path is not None and not Path(path).is_file():
                raise DockairError(f"hardware.{key}", expected="the path of a calibration sheet", got=path)
        return self

    def receiver_sheet(self, name: Literal["airframe", "flight_control", "mounting"]) -> str:
        """Return the name of the receiver's own sheet of a kind."""
        return name if self.airframe == "fighter" else f"{name}_{self.airframe}"


class Accept(_Table):
    """What a flight must show for its claim to hold; empty when the scenario claims nothing in figures."""

    outcome: OutcomeName | None = None
    radial_offset_max_m: float | None = Field(default=None, gt=0.0)
    closure_speed_min_m_s: float | None = Field(default=None, ge=0.0)
    closure_speed_max_m_s: float | None = Field(default=None, gt=0.0)

    @property
    def claims_figures(self) -> bool:
        """Whether anything is asked for."""
        return any(value is not None for value in self.model_dump().values())

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

    name: Annotated[str, Field(pattern=r"^\w[\w.-]*$"), Expected("a name of letters, digits, _ . -")]
    claim: str = ""  #: the sentence that the flight is there to show
    seed: int = Field(default=0, ge=0, le=2**63 - 1)
    flight: FlightConditions = FlightConditions()
    tanker: Tanker = Tanker()
    rates: Rates = Rates()
    turbulence: Turbulence = Turbulence()
    gusts: Gusts = ()
    wake: Wake = Wake()
    bow_wave: BowWave = BowWave()
    sun: Sun = Sun()
    weather: Weather = Weather()
    camera: CameraOptions = CameraOptions()
    start: Start = Start()
    navigation: Navigation = Navigation()
    guidance: Guidance = Guidance()
    hardware: Hardware = Hardware()
    faults: Annotated[
        tuple[FaultTable, ...], BeforeValidator(_tuple_from_list), Expected("tables [[faults]], each with a kind")
    ] = ()  #: what breaks, and when
    parameters: dict[str, dict[str, Any]] = {}  #: sheet -> key -> value instead of the sheet's
    accept: Accept = Accept()

    @model_validator(mode="after")
    def _faults_fit(self) -> Self:
        for index, table in enumerate(self.faults):
            table.check(f"faults[{index}]")
        return self

    @model_validator(mode="after")
    def _parameters_fit(self) -> Self:
        for sheet, overrides in self.parameters.items():
            load_parameters(sheet, make_dataclass(sheet, sorted(read_sheet(sheet))), overrides)  # checks only
            if (
                sheet.startswith(("imu_", "filter_", "airframe", "flight_control", "mounting"))
                and sheet not in self.chosen_sheets
            ):
                expected = f"a sheet that this scenario uses ({', '.join(self.chosen_sheets)})"
                raise DockairError(f"parameters.{sheet}", expected=expected, got=sheet)
        return self

    @property
    def chosen_sheets(self) -> tuple[str, ...]:
        """Sheets that are chosen by name: of the IMU, of the filter and of the receiver."""
        receiver = (self.hardware.receiver_sheet(name) for name in ("airframe", "flight_control", "mounting"))
        return f"imu_{self.hardware.imu}", f"filter_{self.camera.filter}", *receiver

    @property
    def sun_W(self) -> Array | None:
        """(3,) unit vector toward the Sun in W, None without Sun or at night."""
        return None if self.weather.night else self.sun.direction_W


def load_scenario(name_or_path: str | Path, overrides: Mapping[str, object] | None = None) -> Scenario:
    """Read a scenario and check it.

    Args:
        name_or_path: a name in the library, or the path of a TOML file.
        overrides: dotted key -> value instead of the file's. A string is read as a TOML value, and is the string
            itself when it is none.

    Raises:
        DockairError: no such scenario; not TOML; unknown key, wrong type or value out of range.
    """
    source = ScenarioFile(name_or_path, overrides or {})
    try:
        return Scenario.model_validate(source.table)
    except ValidationError as error:
        raise refusal(error, Scenario, source.place) from None
    except DockairError as error:
        where = source.place(error.where)
        raise DockairError(where, expected=error.expected, got=error.got, exists=error.exists) from None
