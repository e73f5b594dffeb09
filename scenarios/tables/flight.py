"""The tables of a scenario that say what is flown: the steady flight, the rates, the tanker's manoeuvre, the start."""

from typing import Annotated, Literal, Self

import numpy as np
from pydantic import BeforeValidator, Field, model_validator

from dockair.clock import Clock
from dockair.errors import DockairError
from dockair.rotations import Array
from dockair.scenarios.refusal import Expected
from dockair.scenarios.tables.table import Table, tuple_from_list

_Sigma = Annotated[float, Field(ge=0.0, le=20.0)]
_ThreeSigmas = Annotated[
    tuple[_Sigma, _Sigma, _Sigma],
    BeforeValidator(tuple_from_list),
    Expected("three numbers, each 0 to 20"),
]
_SmallAngle = Annotated[float, Field(ge=0.0, le=30.0)]
_ThreeSmallAngles = Annotated[
    tuple[_SmallAngle, _SmallAngle, _SmallAngle],
    BeforeValidator(tuple_from_list),
    Expected("three numbers, each 0 to 30"),
]
_Rate = Annotated[int, Field(ge=1, le=100_000)]


class FlightConditions(Table):
    """The tanker's steady flight, and how long the whole flight may take."""

    airspeed_m_s: float = Field(default=180.0, ge=100.0, le=250.0)  #: true airspeed
    altitude_m: float = Field(default=6000.0, ge=0.0, le=15000.0)  #: in the standard atmosphere
    duration_s: float = Field(default=60.0, gt=0.0, le=600.0)  #: after which it ends


class Rates(Table):
    """How often everything happens; all divide the physics rate."""

    physics_hz: _Rate = 1000  #: of the simulation's steps
    gyro_hz: _Rate = 500  #: of the IMU's samples; not below control_hz
    control_hz: _Rate = 100  #: of navigation, guidance and command
    camera_hz: _Rate = 50  #: of frames; not above control_hz

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


class Tanker(Table):
    """What the tanker flies, which hose is out; how fast it rolls, what it announces, sheet `tanker_path` says."""

    #: straight and level; turns of 180 degrees with legs between; or a descent
    manoeuvre: Literal["straight", "racetrack", "toboggan"] = "straight"
    pod: Literal["centreline", "left_wing", "right_wing"] = "centreline"  #: the refuelling unit whose hose is out
    starts_s: float = Field(default=2.0, ge=0.0, le=600.0)  #: when the first turn, or the descent, begins
    turns: Literal["left", "right"] = "left"  #: of the racetrack: which way
    bank_deg: float = Field(default=25.0, gt=0.0, le=45.0)  #: in the turns of the racetrack
    leg_s: float = Field(default=60.0, ge=0.0, le=600.0)  #: of the racetrack: wings level between two turns
    descent_deg: float = Field(default=3.0, gt=0.0, le=10.0)  #: of the toboggan, below the horizon


class Start(Table):
    """Where the probe's tip starts from the ring's centre, and how far off the navigation is told it may be."""

    aft_m: float = Field(default=4.0, ge=0.5, le=40.0)  #: tip behind the ring's centre
    left_m: float = Field(default=0.0, ge=-20.0, le=20.0)  #: tip to the left of it
    up_m: float = Field(default=0.0, ge=-20.0, le=20.0)  #: tip above it
    sigma_m: _ThreeSigmas = (0.3, 0.3, 0.3)  #: standard deviation of that place: forward, left, up
    #: Standard deviation of the drogue's attitude of rest, about each axis: the ring's roll, and 0.5 degrees of hose,
    #: trim and heading.
    sigma_attitude_deg: _ThreeSmallAngles = (1.15, 0.52, 0.52)

    @property
    def p_PD_B(self) -> Array:
        """(3,) nominal ring centre from the probe's tip, body axes [m]."""
        return np.array([self.aft_m, -self.left_m, -self.up_m])

    @property
    def sigma_p_m(self) -> Array:
        """(3,) standard deviation of the ring's centre from the probe's tip, body axes [m]."""
        return np.array(self.sigma_m)

    @property
    def sigma_R_rad(self) -> Array:
        """(3,) standard deviation of the drogue's attitude about each axis [rad]."""
        return np.radians(self.sigma_attitude_deg)
