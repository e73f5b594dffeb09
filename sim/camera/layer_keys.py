"""Keys: the places that tables of a layer are of, on a grid, and which one comes next on the way."""

import math

from dockair.rotations import Array

Place = tuple[float, float, float]  #: [m]; numbers, as comparing arrays takes its time


class Keys:
    """The key of where one is, and of where one goes.

    Args:
        step_m: from one to the next, along each axis.
    """

    def __init__(self, step_m: float) -> None:
        self._step_m = step_m
        self._place_m: Place = (0.0, 0.0, 0.0)
        self._moved_m: Place = (0.0, 0.0, 0.0)

    def come_to(self, place_m: Array) -> tuple[Place, Place]:
        """Return a place (3,) as numbers, and its key; the way to it is that from the last other one."""
        here, last = (float(place_m[0]), float(place_m[1]), float(place_m[2])), self._place_m
        if here != last:
            self._place_m, self._moved_m = here, (here[0] - last[0], here[1] - last[1], here[2] - last[2])
        return here, (self._on_grid(here[0]), self._on_grid(here[1]), self._on_grid(here[2]))

    def coming(self, place_m: Place, key: Place) -> tuple[Place | None, float]:
        """Return the key that comes next if the way goes on, along the axis left first.

        Args:
            place_m: as come to.
            key: of it.

        Returns:
            That key, and how far the place is toward it, in steps; None and 0 where nothing moves.
        """
        step_m, moved, axis, frames = self._step_m, self._moved_m, 0, math.inf
        for k in range(3):
            ahead = 0.5 * step_m - math.copysign(1.0, moved[k]) * (place_m[k] - key[k])
            if moved[k] != 0.0 and ahead / abs(moved[k]) < frames:
                axis, frames = k, ahead / abs(moved[k])
        if math.isinf(frames):
            return None, 0.0
        sign, coming = math.copysign(1.0, moved[axis]), list(key)
        coming[axis] = (round(place_m[axis] / step_m) + sign) * step_m
        return (coming[0], coming[1], coming[2]), sign * (place_m[axis] - key[axis]) / step_m

    def _on_grid(self, way_m: float) -> float:
        return round(way_m / self._step_m) * self._step_m
