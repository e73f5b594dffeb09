"""Where the receiver has come by its own commands and by what it felt besides, and where it will come.

The tip answers a command that comes with its rate a response time later, axis by axis; what its accelerometers and
gyros feel otherwise, it strays by. With dv the felt change of the tip's velocity from tick to tick,

    v(t) = u(t - tau),      f <- (f + dv - (v_k - v_k-1)) / (1 + dt/T_f)                                  (1)
    e <- (e + g_k - g_k-1) / (1 + dt/T_f),      y_r' = v + e                                              (2)

where g is f cut off at a limit, lest what is felt wrongly, as a turn that nobody announced, is flown against; fed with
g, e comes back with f as it went, and is no more than the limit itself. Twice forgotten, a steady part of gravity that
is not taken off adds nothing to e. Flight control brings back a velocity that a gust has changed, not the place: e dies
away,

    e(t) = e exp(-t/T_e),      y_r(t) - y_r - way commanded = T_e (1 - exp(-t/T_e)) e                     (3)

so that what gusts gave the tip's velocity from tick to tick is what it is felt to have gained, and what flight control
has taken back of it meanwhile:

    dw = g_k - exp(-dt/T_e) g_k-1                                                                         (4)

y_r is a scale of the receiver's own, which drifts against any other with the bias of its inertial velocity. On it the
drogue's motion is its own: what the receiver did is taken off, so that a filter which follows the drogue closely does
not chase the receiver's answer to its own commands.

Not modelled: how e goes on in the gust that made it; that a gyro's bias b, until it is known, adds b g T_f^2 to e.
Where nothing is felt any more e dies away by Eq. (3), and what the tip does besides its commands shows as motion of the
drogue.
"""

import numpy as np

from dockair.kernels import njit
from dockair.rotations import Array


class OwnPath:
    """Eqs. (1) to (4), axes forward, left, up.

    Args:
        response_s: (3,) tau.
        step_s: control period.
        straying_s: (3,) T_e.
        forgotten_s: T_f.
        limit_m_s: (3,) of g and e; of an axis with none, nothing is felt.
    """

    def __init__(
        self, response_s: Array, step_s: float, straying_s: Array, forgotten_s: float, limit_m_s: Array
    ) -> None:
        self._limit_m_s, self._dies = limit_m_s, np.exp(-step_s / straying_s)
        self._step_s, self._straying_s, self._kept = step_s, straying_s, 1.0 / (1.0 + step_s / forgotten_s)
        self._ticks = np.maximum(np.round(np.asarray(response_s) / step_s).astype(int), 1)
        self._strays_s = self.strays_s(np.asarray(response_s))
        self._stays = np.exp(-np.asarray(response_s) / straying_s)  # of e, after tau
        self._length = int(self._ticks.max()) + 1
        self._axes, self._newest = np.arange(3), 0
        self._places, self._velocities = np.zeros((self._length, 3)), np.zeros((self._length, 3))  # rings
        self._own: Array = np.zeros((5, 3))  # v_k-1, f, and what follows
        self._blown: Array = self._own[2]  # dw
        self._straying: Array = self._own[3]  # e
        self._strayed: Array = self._own[4]  # its integral

    def feel(self, change_m_s: Array) -> None:
        """Take note of dv (3,) since the last period, NaN where it was not felt."""
        _feel(self._own, self._commanded_m_s, change_m_s, self._dies, self._kept, self._limit_m_s, self._step_s)

    def step(self, velocity_m_s: Array) -> None:
        """Take note of the velocity (3,) commanded for the next period."""
        before, self._newest = self._newest, (self._newest + 1) % self._length
        self._places[self._newest] = self._places[before] + velocity_m_s * self._step_s
        self._velocities[self._newest] = velocity_m_s

    @property
    def blown_m_s(self) -> Array:
        """(3,) dw of the last period; 0 where not felt."""
        return self._blown.copy()

    @property
    def place_m(self) -> Array:
        """(3,) y_r now."""
        return np.asarray(self._places[self._newest - self._ticks, self._axes] + self._strayed)

    @property
    def velocity_m_s(self) -> Array:
        """(3,) y_r' now."""
        return np.asarray(self._commanded_m_s + self._straying)

    @property
    def place_ahead_m(self) -> Array:
        """(3,) y_r after the response time of each axis, by the commands given so far."""
        return self.places_m(self._strays_s)

    @property
    def straying_ahead_m_s(self) -> Array:
        """(3,) e after the response time of each axis."""
        return np.asarray(self._straying * self._stays)

    def strays_s(self, time_s: Array) -> Array:
        """(..., 3) T_e (1 - exp(-t/T_e)) of Eq. (3) for times (..., 3) to come, no shorter than the response times."""
        return np.asarray(self._straying_s * (1.0 - np.exp(-time_s / self._straying_s)))

    def places_m(self, strays_s: Array) -> Array:
        """(..., 3) y_r in the times of `strays_s` (..., 3), by the commands given so far."""
        return np.asarray(self._places[self._newest] + self._strayed + strays_s * self._straying)

    @property
    def _commanded_m_s(self) -> Array:
        return np.asarray(self._velocities[self._newest - self._ticks, self._axes])


@njit(cache=True)
def _feel(own, v, change, dies, kept, limit, step):  # type: ignore[no-untyped-def]
    """Eqs. (1), (2) and (4) over a step in place: own (5, 3) are the rows v_k-1, f, dw, e, way."""
    felt = np.isfinite(change[0]) and np.isfinite(change[1]) and np.isfinite(change[2])
    for i in range(3):
        f, e = own[1, i], own[3, i]
        if felt:
            own[1, i] = kept * (f + change[i] - (v[i] - own[0, i]))
            before, now = min(max(f, -limit[i]), limit[i]), min(max(own[1, i], -limit[i]), limit[i])
            own[2, i] = now - dies[i] * before
            own[3, i] = min(max(kept * (e + now - before), -limit[i]), limit[i])
        else:
            own[1, i], own[2, i], own[3, i] = 0.0, 0.0, dies[i] * e
        own[0, i] = v[i]
        own[4, i] += own[3, i] * step
