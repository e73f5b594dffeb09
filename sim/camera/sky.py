"""Pictures of what is infinitely far away: `sky_radiance`, read from tables for every block of every frame.

Deck and ground stay where they are as the camera passes over them (`layer_table`); what is above goes along with it
(`sky_table`). Tables hold the law and not the sky, so that a sky that nobody needs is gone at once, with its tables.
"""

import numpy as np
from numpy.typing import NDArray

from dockair.rotations import Array
from dockair.sim.camera.earth import Interval, columns_below, dip_sine
from dockair.sim.camera.layer_table import NO_DECK, LayerTable, lay_under
from dockair.sim.camera.sky_radiance import LAYER_NODE_RAD, NODE_RAD, SkyRadiance
from dockair.sim.camera.sky_table import DirectionTable

_TILES, _LAYER_TILES = (round(2.0 / (64 * node)) for node in (NODE_RAD, LAYER_NODE_RAD))  # of the tables, a side
_SMOOTH_TILES = _TILES // 2  # without clouds


class Sky:
    """Pictures by attitude and place, and the law behind. Keeps what it has worked out; no answer depends on that."""

    def __init__(self, law: SkyRadiance) -> None:
        """Set up.

        Args:
            law: what is shown.
        """
        self._law, weather, earth_m = law, law.weather, law.parameters.earth_radius_m
        tiles = _TILES if weather.cloud_cover > 0.0 else _SMOOTH_TILES
        self._table = DirectionTable(law.upward, tiles, smooth=tiles == _SMOOTH_TILES)
        self._top_m, self._height_m = earth_m + law.top_m, law.altitude_m - law.top_m  # of what is met first from above
        self._ground_table = LayerTable(law.below, _LAYER_TILES, 1, law.altitude_m, earth_m)
        self._deck_table = LayerTable(law.over, _LAYER_TILES, 2, self._height_m, self._top_m)
        self._last: tuple[Array, Array] | None = None  # attitude and place of the last picture

    def fill(self, out: NDArray[np.float32], R_WC: Array, x: Array, y: Array, place_m: Array | None = None) -> None:
        """Write what is seen in directions of the camera's axes.

        Args:
            out: (rows, columns) relative radiance toward (1, -x_j, -y_i), written.
            R_WC: attitude of the camera.
            x: (columns,) evenly spaced and rising.
            y: (rows,) evenly spaced.
            place_m: (3,) where it has come to since the start, in axes that stay with the air; None is the start.
        """
        if self._law.weather.night:
            out[:] = self._law.parameters.night
            return
        place = np.zeros(3) if place_m is None else np.asarray(place_m, dtype=float)
        R, x, y = np.ascontiguousarray(R_WC, dtype=float), np.asarray(x, dtype=float), np.asarray(y, dtype=float)
        self._last = R.copy(), place.copy()
        (first, stop, any_below), below = self._columns_below(R, x, y, place)
        if first < stop:
            self._table.fill(out[first:stop], R, x, y[first:stop])
        if any_below:
            ground = self._ground_table.nodes(place, R, x, y, below)
            deck = self._deck_table.nodes(place, R, x, y, below) if self._law.has_deck else NO_DECK
            lay_under(out, R, x, y, below, ground, deck)

    def work_ahead(self, x: Array, y: Array) -> bool:
        """Make a little of what pictures in these directions will be read from; say whether anything lacked.

        For time that no picture waits for. Of the sky's parts those below, which come and go with the way: from where
        the last picture was made, and under the keys that come next.

        Args:
            x: (columns,) as of `fill`.
            y: (rows,) as of `fill`.
        """
        if self._last is None:
            return False
        R, place = self._last
        (_, _, any_below), below = self._columns_below(R, x, y, place)
        if not any_below:
            return False
        return self._ground_table.work_ahead(place, R, x, y, below) or (
            self._law.has_deck and self._deck_table.work_ahead(place, R, x, y, below)
        )

    def _columns_below(self, R: Array, x: Array, y: Array, place: Array) -> tuple[tuple[int, int, bool], Interval]:
        """What `earth.columns_below` returns and fills, of what is met first from above."""
        below = np.empty((len(y), 2), dtype=np.int64)
        sine = dip_sine(self._top_m, self._height_m + float(place[2]))
        return columns_below(R, x, y, sine, below), below

    @property
    def ambient(self) -> float:
        """Mean relative radiance of all directions: what lights the Sun's lee."""
        return self._law.ambient

    def beam(self, directions_W: Array) -> Array:
        """Return (n,) transmittance of cloud and haze for sunlight from (n, 3) directions; 1 without either."""
        return self._law.beam(directions_W)

    def airlight(self, direction_W: Array) -> float:
        """Return the relative radiance of endless haze toward a direction (3,): what far objects fade into."""
        return self._law.airlight(direction_W)

    def radiance(self, directions_W: Array) -> Array:
        """Return (n,) relative radiances toward (n, 3) directions at the start: what `fill` reads between nodes."""
        return self._law.radiance(directions_W)
