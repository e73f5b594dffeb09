"""A scenario file (TOML) becomes a frozen `Scenario`: data only, unknown keys refused, units converted here alone.

Keys carry their unit. Degrees and other units of people stop here: properties without `_deg` are SI and radians.
Only `name` is required; every other key has the default written below.
"""

import os
from collections.abc import Mapping
from dataclasses import make_dataclass
from pathlib import Path
from typing import Annotated, Any, Literal, Self, get_args

from pydantic import BeforeValidator, Field, ValidationError, model_validator

from dockair.errors import DockairError
from dockair.parameters import load_parameters, read_sheet
from dockair.rotations import Array
from dockair.scenarios.accept import Accept
from dockair.scenarios.refusal import Expected, refusal
from dockair.scenarios.scenario_file import ScenarioFile
from dockair.scenarios.tables.air import BowWave, Gusts, Turbulence, Wake
from dockair.scenarios.tables.crew import Guidance, Navigation
from dockair.scenarios.tables.fault import FaultTable
from dockair.scenarios.tables.flight import FlightConditions, Rates, Start, Tanker
from dockair.scenarios.tables.light import CameraOptions, Sun, Weather
from dockair.scenarios.tables.table import Table, tuple_from_list
from dockair.streams import LARGEST_SEED

ReceiverSheet = Literal["airframe", "flight_control", "mounting", "bow_wave"]
_OF_RECEIVER: tuple[ReceiverSheet, ...] = get_args(ReceiverSheet)


class Hardware(Table):
    """The receiver, the grade of its IMU; calibration sheets of one's own, as paths from the scenario's file."""

    airframe: Literal["fighter", "unmanned"] = "fighter"  #: the receiver's; "unmanned" is meant for 120 m/s and 3000 m
    imu: Literal["tactical", "mti", "consumer"] = "mti"  #: grade of the IMU: sheet `imu_<grade>`
    camera: str | None = None  #: calibration sheet of a camera of one's own
    ring: str | None = None  #: the same of a ring of LEDs

    @model_validator(mode="after")
    def _exist(self) -> Self:
        for key, path in (("camera", self.camera), ("ring", self.ring)):
            if path is not None and not os.path.isfile(path):  # False, too, where nobody may look
                got = f"{path}, where no file is"
                raise DockairError(f"hardware.{key}", expected="the path of a calibration sheet", got=got)
        return self

    def receiver_sheet(self, name: ReceiverSheet) -> str:
        """Return the name of the receiver's own sheet of a kind."""
        return name if self.airframe == "fighter" else f"{name}_{self.airframe}"


class Scenario(Table):
    """One flight as data."""

    #: Of the scenario, and of the folder that its flights are written to.
    name: Annotated[str, Field(pattern=r"^\w[\w.-]*$"), Expected("a name of letters, digits, _ . -")]
    claim: str = ""  #: the sentence that the flight is there to show
    seed: int = Field(default=0, ge=0, le=LARGEST_SEED)  #: of every random stream, where `--seed` says no other
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
        tuple[FaultTable, ...], BeforeValidator(tuple_from_list), Expected("tables [[faults]], each with a kind")
    ] = ()  #: what breaks, and when
    parameters: dict[str, dict[str, Any]] = {}  #: sheet -> key -> value instead of the sheet's
    accept: Accept = Accept()

    @model_validator(mode="after")
    def _faults_fit(self) -> Self:
        for index, table in enumerate(self.faults):
            table.check(f"faults[{index}]")
        return self

    @model_validator(mode="after")
    def _frames_for_the_heading(self) -> Self:
        if self.navigation.heading and self.sensing != "camera":
            expected = 'false but with camera.sensing = "frames": a heading is kept by pictures'
            raise DockairError("navigation.heading", expected=expected, got=self.navigation.heading)
        return self

    @model_validator(mode="after")
    def _parameters_fit(self) -> Self:
        for sheet, overrides in self.parameters.items():
            load_parameters(sheet, make_dataclass(sheet, sorted(read_sheet(sheet))), overrides)  # checks only
            if sheet.startswith(("imu_", "filter_", *_OF_RECEIVER)) and sheet not in self.chosen_sheets:
                expected = f"a sheet that this scenario uses ({', '.join(self.chosen_sheets)})"
                raise DockairError(f"parameters.{sheet}", expected=expected, got=sheet)
            if sheet == "turbulence" and "sigma_m_s" in overrides:  # gusts are not flown without one of the two
                where, expected = "parameters.turbulence.sigma_m_s", "turbulence.sigma_m_s or turbulence.intensity"
                raise DockairError(where, expected=f"{expected} in its place", got=overrides["sigma_m_s"])
        return self

    @property
    def chosen_sheets(self) -> tuple[str, ...]:
        """Sheets that are chosen by name: of the IMU, of the filter and of the receiver."""
        receiver = (self.hardware.receiver_sheet(name) for name in _OF_RECEIVER)
        return f"imu_{self.hardware.imu}", f"filter_{self.camera.filter}", *receiver

    @property
    def sensing(self) -> Literal["camera", "measurements", "truth"]:
        """What the navigation sees; flights of different kinds are never pooled."""
        if self.navigation.is_truth:
            return "truth"
        return "measurements" if self.camera.sensing == "measurements" else "camera"

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
    if not isinstance(name_or_path, (str, Path)):
        expected = "a name in the library, or the path of a TOML file"
        raise DockairError("load_scenario: name_or_path", expected=expected, got=type(name_or_path).__name__)
    if overrides is not None and not isinstance(overrides, Mapping):
        expected = "a mapping of dotted keys to values"
        raise DockairError("load_scenario: overrides", expected=expected, got=type(overrides).__name__)
    source = ScenarioFile(name_or_path, overrides or {})
    try:
        return Scenario.model_validate(source.table)
    except ValidationError as error:
        raise refusal(error, Scenario, source.place) from None
    except DockairError as error:
        raise error.at(source.place(error.where)) from None
