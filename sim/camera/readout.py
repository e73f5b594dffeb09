"""When the rows leave the sensor and when the frame has arrived.

    slot = row_clocks T_clk,   share = 16/outputs                                                                (1)
    frame overhead = slot (overhead_setting + 2 share),   row = slot share                                       (2)
    read-out of n rows = frame overhead + n row                                                                  (3)
    latency = exposure/2 + read-out + transfer                                                                   (4)
    shortest period = frame overhead + max(exposure, n row)                                                      (5)

The overhead comes first: in it all pixels hand their charge to the storage nodes at once, which ends the exposure; the
rows are then read one after another while the next exposure runs. So row r waits for the read-out of r rows, and an
exposure overlaps the read-out of the frame before but not the overhead. Columns cost nothing.
The transfer to the computer takes a time of a gamma law with the sheet's mean and standard deviation: never negative.

At 12 bits T_clk is at least 25 ns: an output sends 480 Mbit/s at most. [sheets]

Not modelled: a link slower than the sensor; several windows in one frame; the sensor's own offset to the exposure.
Sources: CMV2000 data sheet v3.8 (read-out times, overlap of exposure and read-out).
"""

import numpy as np

from dockair.messages import Window
from dockair.sim.camera.sheets import SensorParameters

_OUTPUTS = 16  # that row_clocks is stated for


def row_time_s(sensor: SensorParameters) -> float:
    """Time [s] that each row adds, Eq. (2)."""
    return sensor.row_clocks / sensor.clock_hz * (_OUTPUTS / sensor.outputs)


def overhead_time_s(sensor: SensorParameters) -> float:
    """Time [s] of a frame without rows, Eq. (2)."""
    return sensor.row_clocks / sensor.clock_hz * (sensor.overhead_setting + 2.0 * _OUTPUTS / sensor.outputs)


def readout_time_s(rows: int, sensor: SensorParameters) -> float:
    """Time [s] from the end of the exposure until `rows` rows have left the sensor, Eq. (3)."""
    return overhead_time_s(sensor) + rows * row_time_s(sensor)


def latency_s(window: Window, sensor: SensorParameters, exposure_s: float) -> float:
    """Time [s] from the middle of the exposure until the frame has arrived, without jitter, Eq. (4)."""
    return 0.5 * exposure_s + readout_time_s(window.shape[0], sensor) + sensor.transfer_s


def transfer_jitter_s(sensor: SensorParameters, rng: np.random.Generator) -> float:
    """Draw what one frame's transfer takes beyond its mean [s]: mean 0, never below -transfer_s."""
    if sensor.transfer_s == 0.0 or sensor.transfer_jitter_s == 0.0:
        return 0.0
    shape = (sensor.transfer_s / sensor.transfer_jitter_s) ** 2
    return float(rng.gamma(shape, sensor.transfer_s / shape)) - sensor.transfer_s


def shortest_period_s(rows: int, sensor: SensorParameters, exposure_s: float) -> float:
    """Time [s] between frames of `rows` rows at the sensor's highest rate, Eq. (5)."""
    return overhead_time_s(sensor) + max(exposure_s, rows * row_time_s(sensor))
