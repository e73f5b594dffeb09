"""What crosses between the world, the navigation and the command: frozen, stamped, no more than a sensor could send.

| message         | producer   | consumer            | rate            | frame |
|-----------------|------------|---------------------|-----------------|-------|
| CameraFrame     | sim/camera | nav                 | camera rate     | C     |
| ImuSample       | sim/imu    | nav                 | gyro rate       | I     |
| LedObservation  | nav, or a model of it | nav      | camera rate     | C     |
| ReceiverCommand | nav        | sim flight control  | control rate    | B     |
| NavSolution     | nav        | loop, log, gymnasium| control rate    | B, C  |
| TankerAnnouncement | sim tanker | nav, if it listens | before a change |    |
| PodSignal       | sim pod light | nav, if it looks | at a change     |       |

A test freezes the fields of the two sensor messages: no LED index, visibility, pose or gust may ever enter them. All
stamps and times are on one clock, that of the flight. Pixels are (u, v), u to the right and v down, counted on the full
sensor.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field
from enum import Enum
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from dockair.rotations import Array

STAMP_RESOLUTION_S = 1e-6  #: stamps that are nearer than this are of one moment


@dataclass(frozen=True, slots=True)
class Window:
    """Rows [row_start, row_stop) and columns [column_start, column_stop) of the sensor."""

    row_start: int
    row_stop: int
    column_start: int
    column_stop: int

    @property
    def shape(self) -> tuple[int, int]:
        """(rows, columns)."""
        return self.row_stop - self.row_start, self.column_stop - self.column_start


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class CameraFrame:
    """One exposure, as read out."""

    time_stamp_s: float  #: middle of the exposure, on the clock that also stamps the IMU
    pixels: NDArray[np.uint8]  #: (rows, columns) of the window
    window: Window  #: which part of the sensor was read
    exposure_s: float
    gain: float  #: digital numbers of the output per electron [1/e-]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class ImuSample:
    """One sample of three gyros and three accelerometers."""

    time_stamp_s: float
    angular_rate_rad_s: Array  #: (3,) w_WI_I, as measured
    specific_force_m_s2: Array = field(default_factory=lambda: np.full(3, np.nan))
    #: (3,) acceleration of I less gravity, I axes, as measured; NaN where no accelerometers are fitted


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class LedObservation:
    """Named LEDs of one frame: what finding the ring makes of pixels, or a model of the camera draws without any."""

    time_stamp_s: float  #: of the frame
    led_numbers: NDArray[np.int64]  #: (n,) which LED of the sheet's ring each is; n may be 0
    centroids_px: Array  #: (n, 2) pixels (u, v), full-frame coordinates
    sigma_px: Array  #: (n,) standard deviation of each coordinate


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class ReceiverCommand:
    """An increment on the receiver's own trim flight path, in body axes B (forward, left, up)."""

    velocity_m_s: Array = field(default_factory=lambda: np.zeros(3))  #: (3,) velocity beyond trim
    acceleration_m_s2: Array = field(default_factory=lambda: np.zeros(3))  #: (3,) feed-forward
    turn_rate_rad_s: float = 0.0  #: of the trim path itself, positive to the left
    climb_rad: float = 0.0  #: of the trim path itself, against the air


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class NavSolution:
    """What the navigation believes and wants, at one control tick.

    `valid` says whether the relative state is usable; when it is not, the arrays still hold the prediction
    and the covariance is NaN.
    """

    time_stamp_s: float
    valid: bool
    #: Name of the docking phase. On these names the loop acts, whoever navigates: "clear" ends the flight; "approach"
    #: begins an attempt, which goes on in "approach" and "contact"; any other ends it, "breakaway" as a breakaway.
    phase: str
    status: str  #: outcome of the last frame: what the pose solver or the stage before it said
    p_PD_B: Array  #: (3,) drogue ring centre from the probe's tip, body axes [m]
    #: (3,) velocity of the ring centre less that of the probe's tip, body axes, not seen from turning axes [m/s]:
    #: d/dt of p_PD_B is v_PD_B - w_WB_B x p_PD_B.
    v_PD_B: Array
    R_BD: Array  #: (3, 3) drogue axes in body axes: a rotation, also while not valid
    covariance: Array  #: (9, 9) of (phi, p_PD_B, v_PD_B): R_BD <- exp(phi) R_BD [rad, m, m/s]
    command: ReceiverCommand
    window: Window | None  #: what the camera should read next; None for the full frame
    frame_time_stamp_s: float  #: stamp of the newest frame used, NaN before the first
    candidates_px: Array  #: (n, 2) centroids (u, v) of the newest frame, full-frame coordinates
    led_pixels_px: Array  #: (8, 2) pixels (u, v) where each LED was seen, full-frame coordinates; NaN where it was not
    contact_usable: bool = True  #: whether contact may be flown on it, as far as the navigation's integrity can tell
    phase_reason: str = ""  #: why the present phase was entered
    exposure_s: float = float("nan")  #: asked of the camera for its next frame; NaN: what it sets itself
    heading_rad: float = float("nan")  #: of the receiver since the start, to the left, not wrapped; NaN if not kept
    heading_sigma_rad: float = float("nan")  #: its standard deviation


@dataclass(frozen=True, slots=True, kw_only=True)
class TankerAnnouncement:
    """What the tanker says by radio that it is about to do: from one steady flight to another. Not quite exact."""

    time_stamp_s: float  #: when it was said
    starts_s: float  #: when it begins, on the clock of `time_stamp_s`
    entry_s: float  #: from its start until the new steady flight
    turn_rate_rad_s: float  #: of the heading then, positive to the left
    climb_rad: float  #: of the way through the air then


class Light(Enum):
    """What the refuelling pod shows the receiver behind it [KDC-10 procedures]. Recordings hold these numbers."""

    AMBER = 0  #: the hose is ready, or not wound in far enough for fuel
    RED = 1  #: dead hose: no contact is to be made
    GREEN = 2  #: wound in to within the refuelling range: fuel flows into a probe that is held
    FLASHING_AMBER = 3  #: wound in beyond the range's inner limit


@dataclass(frozen=True, slots=True, kw_only=True)
class PodSignal:
    """What the light of the refuelling pod begins to show; amber until the first of these."""

    time_stamp_s: float  #: when it was seen
    light: Light


class Navigates(Protocol):
    """Anything that can stand where `nav.navigator.Navigator` stands; a scenario may name any such class.

    It is made once a flight, of nothing but `calibration.NavigationSheets`: `Class(sheets)`. One that has a method
    `announce(TankerAnnouncement)` is told of the tanker's changes, one that has `signal(PodSignal)` of those of the
    pod's light, before the tick's `step`.
    """

    def step(self, imu: Sequence[ImuSample], frame: CameraFrame | None) -> NavSolution:
        """Take what arrived since the last control tick; return what is believed and commanded now.

        Args:
            imu: the samples, oldest first; none while the IMU has dropped out.
            frame: the one that arrived, None if none did; in a scenario with `camera.sensing = "measurements"` always a
                `LedObservation` in place of a `CameraFrame`.
        """
        ...
