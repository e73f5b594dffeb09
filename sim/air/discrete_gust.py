"""Discrete gusts: the tuned 1 - cosine shape, frozen in the air and riding past all bodies.

A point that lies a distance s inside the gust's front meets

    v(s) = v_max (1 - cos(pi s / H)) / 2    for 0 <= s <= 2 H, and nothing before and after      (1)
    s    = x - x_0 + V (t - t_0)                                                                 (2)

The front meets x_0, where the drogue at rest feels the air (its canopy), at t_0, bodies farther aft later. H is
the distance from the front to the peak: the gust gradient distance of CS-25.341, the gust length d_m of MIL-F-8785C.
The latter's gust stays at its peak from there on; two of them, the second turned round and 1 H later, make Eq. (1).

Not modelled: a gust that differs from place to place across the path.
Sources: CS-25.341 (a)(2); MIL-F-8785C (1980), section 3.7.1.3.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from dockair.errors import DockairError
from dockair.kernels import njit
from dockair.rotations import Array


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class DiscreteGust:
    """One gust."""

    at_s: float  #: t_0, when its front meets the drogue
    length_m: float  #: H, from the front to the peak; the whole gust is twice as long
    velocity_m_s: Array  #: (3,) v_max, along the axes forward, left, up

    def __post_init__(self) -> None:
        if not self.length_m > 0.0:
            raise DockairError("gusts.length_m", expected="a length > 0", got=self.length_m)
        if np.shape(self.velocity_m_s) != (3,) or not np.all(np.isfinite(self.velocity_m_s)):
            raise DockairError("gusts.velocity_m_s", expected="three finite speeds", got=self.velocity_m_s)
        if not np.isfinite(self.at_s):
            raise DockairError("gusts.at_s", expected="a finite time", got=self.at_s)


class DiscreteGusts:
    """The sum of some gusts at any place along x, one tick at a time.

    Args:
        gusts: any number of them; they may overlap.
        airspeed_m_s: V, with which they pass.
        step_s: length of a tick [s].
        met_at_m: x_0, the drogue's place at rest [m].
        start_s: time before the first tick; the hose may settle before time 0.
    """

    def __init__(
        self,
        gusts: Sequence[DiscreteGust],
        airspeed_m_s: float,
        step_s: float,
        *,
        met_at_m: float,
        start_s: float = 0.0,
    ) -> None:
        if not airspeed_m_s > 0.0:
            raise DockairError("airspeed_m_s", expected="a speed > 0", got=airspeed_m_s)
        self._airspeed_m_s, self._step_s, self._start_s, self._ticks = airspeed_m_s, step_s, start_s, 0
        self._met_at_m = met_at_m
        self._gusts = np.array([[g.at_s, g.length_m, *g.velocity_m_s] for g in gusts], dtype=float).reshape(-1, 5)

    def step(self) -> None:
        """Advance by one tick."""
        self._ticks += 1

    def velocity(self, x: Array) -> Array:
        """(n, 3) gust velocity [m/s] at the places x (n,) [m], Eq. (1)."""
        time_s = self._start_s + self._ticks * self._step_s
        gusts: Array = np.zeros((len(x), 3))
        _add_gusts(self._gusts, time_s, self._airspeed_m_s, self._met_at_m, np.asarray(x, dtype=float), gusts)
        return gusts


@njit(cache=True)
def _add_gusts(gusts, time_s, airspeed_m_s, met_at_m, x, out):  # type: ignore[no-untyped-def]
    for g in range(gusts.shape[0]):
        at_s, length_m = gusts[g, 0], gusts[g, 1]
        for i in range(x.shape[0]):
            s = x[i] - met_at_m + airspeed_m_s * (time_s - at_s)
            if 0.0 < s < 2.0 * length_m:
                share = 0.5 * (1.0 - np.cos(np.pi * s / length_m))
                for axis in range(3):
                    out[i, axis] += share * gusts[g, 2 + axis]
