"""The tables `[[faults]]` of a scenario: what breaks, when, and how badly; units converted here.

| kind            | keys beside start_s, stop_s                 | what happens                                       |
|-----------------|---------------------------------------------|----------------------------------------------------|
| led_off         | leds                                        | these LEDs are dark                                |
| led_dim         | leds, factor                                | these LEDs shine with a part of their intensity    |
| led_flicker     | leds, frequency_hz, duty, depth             | these LEDs flicker                                 |
| camera_drop_out |                                             | no frame arrives                                   |
| stuck_frame     |                                             | the camera sends its last picture again and again  |
| hot_pixels      | count                                       | this many pixels of the sensor are white           |
| dirty_window    | cover                                       | smudges on the window in front of the lens         |
| exposure_stuck  | exposure_us                                 | the exposure stays at this time                    |
| gyro_bias_step  | rate_deg_s                                  | the gyros' biases jump by this much                |
| gyro_saturation | limit_deg_s                                 | the gyros' range shrinks to this                   |
| gyro_drop_out   |                                             | no IMU sample arrives                              |
| dead_reel       | unnoticed                                   | the reel's drum is locked                          |

Without `leds` all LEDs are meant; without `stop_s` a fault lasts to the end.
"""

from dataclasses import MISSING, fields
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import BeforeValidator, Field

from dockair.errors import DockairError
from dockair.scenarios.refusal import Expected
from dockair.scenarios.tables.table import Table, tuple_from_list
from dockair.sim.faults import (
    CameraDropOut,
    DeadReel,
    DirtyWindow,
    ExposureStuck,
    Fault,
    GyroBiasStep,
    GyroDropOut,
    GyroSaturation,
    HotPixels,
    LedDim,
    LedFlicker,
    LedOff,
    StuckFrame,
)

FaultKind = Literal[
    "led_off",
    "led_dim",
    "led_flicker",
    "camera_drop_out",
    "stuck_frame",
    "hot_pixels",
    "dirty_window",
    "exposure_stuck",
    "gyro_bias_step",
    "gyro_saturation",
    "gyro_drop_out",
    "dead_reel",
]
_CLASSES: dict[str, type[Fault]] = {
    "led_off": LedOff,
    "led_dim": LedDim,
    "led_flicker": LedFlicker,
    "camera_drop_out": CameraDropOut,
    "stuck_frame": StuckFrame,
    "hot_pixels": HotPixels,
    "dirty_window": DirtyWindow,
    "exposure_stuck": ExposureStuck,
    "gyro_bias_step": GyroBiasStep,
    "gyro_saturation": GyroSaturation,
    "gyro_drop_out": GyroDropOut,
    "dead_reel": DeadReel,
}
_COMMON = ("start_s", "stop_s")
#: A field of a fault whose key here has another unit: field -> key, factor from key to field.
_UNITS = {
    "exposure_s": ("exposure_us", 1e-6),
    "rate_rad_s": ("rate_deg_s", float(np.pi / 180.0)),
    "limit_rad_s": ("limit_deg_s", float(np.pi / 180.0)),
}


def _own_fields(kind: str) -> dict[str, str]:
    """Key -> field of the fault, without those that all faults have."""
    names = [f.name for f in fields(_CLASSES[kind]) if f.name not in _COMMON]
    return {_UNITS.get(name, (name, 1.0))[0]: name for name in names}


def _has_default(kind: str, name: str) -> bool:
    return next(f.default for f in fields(_CLASSES[kind]) if f.name == name) is not MISSING


_Led = Annotated[int, Field(ge=0, le=7)]
_Step = Annotated[float, Field(ge=-5000.0, le=5000.0)]  # deg/s


class FaultTable(Table):
    """One fault. Which of the optional keys it must have, `kind` says."""

    kind: FaultKind  #: what breaks
    start_s: float = Field(default=0.0, ge=0.0)  #: when, in the flight
    stop_s: float | None = Field(default=None, gt=0.0)  #: when it ends; without, it lasts to the end
    leds: Annotated[
        tuple[_Led, ...] | None, BeforeValidator(tuple_from_list), Expected("numbers of LEDs, from 0 to 7")
    ] = None  #: which LEDs; without, all
    factor: float | None = Field(default=None, ge=0.0, le=1.0)  #: part of their intensity that is left
    frequency_hz: float | None = Field(default=None, gt=0.0, le=1e5)  #: of the flicker
    duty: float | None = Field(default=None, ge=0.0, le=1.0)  #: part of a period in which the LED is bright
    depth: float | None = Field(default=None, ge=0.0, le=1.0)  #: how much is missing in the dark part; 1 if not given
    count: int | None = Field(default=None, ge=1, le=100_000)  #: of white pixels
    cover: float | None = Field(default=None, ge=0.0, le=1.0)  #: part of the window under smudges
    #: At which the exposure stays; also inside the limits of the sheet `exposure`.
    exposure_us: float | None = Field(default=None, gt=0.0, le=20_000.0)
    rate_deg_s: Annotated[
        tuple[_Step, _Step, _Step] | None,
        BeforeValidator(tuple_from_list),
        Expected("three numbers, each from -5000 to 5000"),
    ] = None  #: jump of the gyros' biases, IMU axes
    limit_deg_s: float | None = Field(default=None, gt=0.0, le=5000.0)  #: range that is left to each gyro
    unnoticed: bool | None = None  #: whether the pod's light does not turn red; false if not given

    def check(self, where: str) -> None:
        """Refuse a table without a key that its kind must have, or with one that it cannot have.

        Args:
            where: the table's place, to be named.
        """
        wanted = {key: _has_default(self.kind, name) for key, name in _own_fields(self.kind).items()}
        for key in sorted(self.model_fields_set - {*wanted, *_COMMON, "kind"}):
            exists = sorted({*wanted, *_COMMON, "kind"})
            raise DockairError(where, expected=f"a key of the kind {self.kind}", got=key, exists=exists)
        for key, optional in wanted.items():
            if getattr(self, key) is None and not optional:
                raise DockairError(where, expected=f"the key {key} of the kind {self.kind}", got=None)
        if self.leds is not None and (not self.leds or len(set(self.leds)) < len(self.leds)):
            expected = "numbers of LEDs, each once; for all of them no such key"
            raise DockairError(f"{where}.leds", expected=expected, got=list(self.leds))
        if self.stop_s is not None and self.stop_s <= self.start_s:
            raise DockairError(f"{where}.stop_s", expected=f"a time after start_s = {self.start_s}", got=self.stop_s)

    @property
    def fault(self) -> Fault:
        """The fault, in SI units."""
        values: dict[str, Any] = {"start_s": self.start_s}
        if self.stop_s is not None:
            values["stop_s"] = self.stop_s
        for key, name in _own_fields(self.kind).items():
            value = getattr(self, key)
            if value is None:
                continue  # the fault's own default
            if name in _UNITS:
                factor = _UNITS[name][1]
                value = tuple(factor * v for v in value) if isinstance(value, tuple) else factor * value
            values[name] = value
        return _CLASSES[self.kind](**values)
