"""Keys: the places that tables of a layer are of, on a grid, and which one comes next on the way."""

import math

from dockair.rotations import Array

Place = tuple[float, float, float]  #: [m]; numbers, as comparing arrays takes its time

_LEAST_STEP_M = 0.1  # on the layer, and below it, no step is fine enough


class Keys:
    """The key of where one is, and of where one goes.

    Where the layer is no more than half a step below, the grid is as fine again, and so on: a key on the layer itself
    would see nothing of it.

    Args:
        step_m: from one to the next, along each axis.
        height_m: of the origin over the layer.
    """

    def __init__(self, step_m: float, height_m: float) -> None:
        self._step_m, self._height_m = step_m, height_m
        self._place_m: Place = (0.0, 0.0, 0.0)
        self._moved_m: Place = (0.0, 0.0, 0.0)

    def come_to(self, place_m: Array) -> tuple[Place, Place]:
        """Return a place (3,) as numbers, and its key; the way to it is that from the last other one."""
        here, last = (float(place_m[0]), float(place_m[1]), float(place_m[2])), self._place_m
        if here != last:
            self._place_m, self._moved_m = here, (here[0] - last[0], here[1] - last[1], here[2] - last[2])
        step_m = self._step_at(here)
        return here, (_on_grid(here[0], step_m), _on_grid(here[1], step_m), _on_grid(here[2], step_m))

    def coming(self, place_m: Place, key: Place) -> tuple[Place | None, float]:
        """Return the key that comes next if the way goes on, along the axis left first.

        Args:
            place_m: as come to.
            key: of it.

        Returns:
            That key, and how far the place is toward it, in steps; None and 0 where nothing moves, or down to where the
            grid is finer.
        """
        step_m, moved, axis, frames = self._step_at(place_m), self._moved_m, 0, math.inf
        for k in range(3):
            ahead = 0.5 * step_m - math.copysign(1.0, moved[k]) * (place_m[k] - key[k])
            if moved[k] != 0.0 and ahead / abs(moved[k]) < frames:
                axis, frames = k, ahead / abs(moved[k])
        if math.isinf(frames):
            return None, 0.0
        sign, coming = math.copysign(1.0, moved[axis]), list(key)
        coming[axis] = (round(place_m[axis] / step_m) + sign) * step_m
        if self._height_m + coming[2] < 0.5 * step_m:
            return None, 0.0
        return (coming[0], coming[1], coming[2]), sign * (place_m[axis] - key[axis]) / step_m

    def _step_at(self, place_m: Place) -> float:
        step_m, height_m = self._step_m, self._height_m + place_m[2]
        while step_m >= 2.0 * height_m and step_m > _LEAST_STEP_M:
            step_m *= 0.5
        return step_m


def _on_grid(way_m: float, step_m: float) -> float:
    return round(way_m / step_m) * step_m
