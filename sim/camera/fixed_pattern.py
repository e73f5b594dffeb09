"""What no two pixels have in common and no frame changes: each pixel's gain and offset, each column's offset.

    gain map     1 + g,  g ~ N(0, photo_response_nonuniformity)       a pixel                                    (1)
    offset map   o ~ N(0, dark_signal_nonuniformity_e) [e-]           a pixel                                    (2)
    columns      c ~ N(0, column_pattern_e) [e-]                      a column                                   (3)

Each is a hash of (key, row, column) put through the normal quantile, so that a part of the sensor does not depend on
how large the rest is. Entries are bytes of 1/29 standard deviation, quantiles of 16 bits: the law ends at 4.3 of them.

Not modelled: defective pixels (a fault, not a pattern), gradients over the sensor, offsets that grow with temperature
or exposure (0.0025 e- of dark current in 20 us leave nothing to vary).
Sources: EMVA 1288 release 4.0 (PRNU, DSNU and their column parts); hash: Steele, Lea & Flood 2014 (SplitMix64).
"""

import numpy as np
from numpy.typing import NDArray
from scipy.special import ndtri

from dockair.kernels import njit
from dockair.sim.camera.sheets import SensorParameters

_STEPS = 29.0  # per standard deviation: 4.3 of them fill a byte
_QUANTILES = 1 << 16


def _byte_table() -> NDArray[np.int8]:
    """(65536,) normal quantiles of equal shares, rounded to steps."""
    z = ndtri((np.arange(_QUANTILES) + 0.5) / _QUANTILES)
    return np.rint(_STEPS * z).astype(np.int8)


_TABLE = _byte_table()
_STEP = 1.0 / float(np.std(_TABLE.astype(float)))  # standard deviations a step, what rounding adds included


@njit(cache=True)
def _mix(x: np.uint64) -> np.uint64:
    """Return the SplitMix64 finaliser of a 64-bit number."""
    x = np.uint64(x)
    x = (x ^ (x >> np.uint64(30))) * np.uint64(0xBF58476D1CE4E5B9)
    x = (x ^ (x >> np.uint64(27))) * np.uint64(0x94D049BB133111EB)
    return x ^ (x >> np.uint64(31))


@njit(cache=True)
def _fill(
    gain: NDArray[np.int8], offset: NDArray[np.int8], columns: NDArray[np.int8], key: np.uint64, table: NDArray[np.int8]
) -> None:
    golden = np.uint64(0x9E3779B97F4A7C15)
    for r in range(gain.shape[0]):
        row_key = _mix(key + np.uint64(r + 1) * golden)
        for c in range(gain.shape[1]):
            bits = _mix(row_key + np.uint64(c + 1) * golden)
            gain[r, c] = table[bits & np.uint64(0xFFFF)]
            offset[r, c] = table[(bits >> np.uint64(16)) & np.uint64(0xFFFF)]
    for c in range(columns.size):
        columns[c] = table[_mix(~key + np.uint64(c + 1) * golden) & np.uint64(0xFFFF)]


class FixedPattern:
    """One sensor's pattern, drawn once. Bytes times their step are relative gain and electrons."""

    def __init__(self, sensor: SensorParameters, key: int, height_px: int, width_px: int) -> None:
        """Draw the maps.

        Args:
            sensor: standard deviations.
            key: of `dockair.streams.counter_key`.
            height_px: rows of the sensor.
            width_px: columns of the sensor.
        """
        self.gain_map = np.empty((height_px, width_px), dtype=np.int8)
        self.offset_map = np.empty((height_px, width_px), dtype=np.int8)
        columns = np.empty(width_px, dtype=np.int8)
        _fill(self.gain_map, self.offset_map, columns, np.uint64(key), _TABLE)
        self.gain_step = _STEP * sensor.photo_response_nonuniformity
        self.offset_step_e = _STEP * sensor.dark_signal_nonuniformity_e
        self.column_e = (_STEP * sensor.column_pattern_e * columns).astype(np.float32)
        for array in (self.gain_map, self.offset_map, self.column_e):
            array.setflags(write=False)

    @property
    def shape(self) -> tuple[int, int]:
        """(rows, columns) of the sensor."""
        rows, columns = self.gain_map.shape
        return rows, columns

    @property
    def gain(self) -> NDArray[np.float32]:
        """(rows, columns) response of each pixel over the mean pixel's, Eq. (1): truth, for logs and tests."""
        return np.float32(1.0) + np.float32(self.gain_step) * self.gain_map

    @property
    def offset_e(self) -> NDArray[np.float32]:
        """(rows, columns) dark offset of each pixel, its column's included, Eqs. (2) and (3) [e-]: truth."""
        return np.float32(self.offset_step_e) * self.offset_map + self.column_e
