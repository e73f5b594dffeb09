"""The normal numbers of the next frame's noise, made before it is exposed.

They depend on the frame's number and the pixel's place alone, so the camera can make them in time that nobody waits
for, half of what digitising a frame takes. Which window will be read is not known yet: it is taken to be the last one
and some pixels about it. Where it is not, the numbers are made as the frame is digitised; they are the same.
"""

import numpy as np

from dockair.sim.camera.pixel_noise import LANES, Place, Reals, fill_normals, padded_columns

_ABOUT_PX = 16  # by which a window may move or grow from frame to frame

#: Numbers, and the place of the first; none.
NOTHING_AHEAD: tuple[Reals, Place] = (np.empty((0, 0), dtype=np.float32), (0, 0))


class NormalsAhead:
    """Normal numbers of one camera's frames.

    Args:
        key: of the frames' noise, of `dockair.streams.counter_key`.
        sensor: its rows and columns.
    """

    def __init__(self, key: int, sensor: Place) -> None:
        self._key, self._sensor = np.uint64(key), sensor
        self._memory: Reals = np.empty(0, dtype=np.float32)
        self._asked: tuple[int, Place, Place] | None = None  # frame, start and shape that were digitised last
        self._made_for, self._made = -1, NOTHING_AHEAD

    def of(self, frame_number: int, start: Place, shape: Place) -> tuple[Reals, Place]:
        """Return normal numbers that hold a window of a frame, and the place of their first; none if they lack."""
        self._asked = frame_number, start, shape
        made, first = self._made
        last = start[0] + shape[0], start[1] + padded_columns(shape[1], start[1], self._sensor[1])
        held = (
            self._made_for == frame_number
            and all(a <= b for a, b in zip(first, start, strict=True))
            and all(a + n >= b for a, n, b in zip(first, made.shape, last, strict=True))
        )
        return self._made if held else NOTHING_AHEAD

    def work_ahead(self) -> bool:
        """Make those of the frame after the one that was asked for last; say whether they lacked."""
        if self._asked is None or self._made_for == self._asked[0] + 1:
            return False
        number, (row, column), (rows, columns) = self._asked
        first = max(row - _ABOUT_PX, 0), max(column - _ABOUT_PX, 0)
        below, right = row + rows + _ABOUT_PX, column + columns + _ABOUT_PX + LANES
        shape = min(below, self._sensor[0]) - first[0], min(right, self._sensor[1]) - first[1]
        count = shape[0] * shape[1]
        if self._memory.size < count:
            self._memory = np.empty(count, dtype=np.float32)
        made = self._memory[:count].reshape(shape)
        fill_normals(made, self._key, number + 1, first)
        self._made_for, self._made = number + 1, (made, first)
        return True
