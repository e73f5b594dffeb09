"""Follows the drogue by a plain PID: the baseline that shows what prediction is worth.

With e the place of the drogue less what is wanted, axis by axis,

    u* = k_p e + k_i integral of e + k_d e',     du/dt = s (u* - u)                                       (1)

and while closing at c, along, u* = k_i integral of e + c + k_d (e' + c). The term k_p e is clipped: a drogue that is
far off is gone to, not rushed at. The integral is held while the drogue is not seen, along while closing, and on an
axis on which the drogue is farther off than a bias explains: what is integrated on the way in would carry the receiver
past where it is to stand (wind-up).

Not modelled: the response time, the swing, the bow wave. Nothing limits the integral but what feeds it.
"""

import numpy as np

from dockair.nav.guidance.controller import Sight, Wanted
from dockair.nav.guidance.guidance_settings import PidSettings
from dockair.rotations import Array


class Pid:
    """Eq. (1); see `controller.Controller`."""

    def __init__(self, settings: PidSettings, step_s: float) -> None:
        self._settings, self._step_s = settings, step_s
        self._integral: Array = np.zeros(3)  # k_i times it [m/s]
        self._place: Array = np.zeros(3)
        self._rate: Array = np.zeros(3)
        self._seen = False

    def observe(self, sight: Sight | None, change_m_s: Array) -> None:
        """Take note of the drogue, once a control tick; None when it is not seen. What is felt it does not use."""
        self._seen = sight is not None
        if sight is not None:
            self._place, self._rate = sight.place_m, sight.rate_m_s

    def given(self, velocity_m_s: Array, acceleration_m_s2: Array) -> None:
        """Nothing: it does not look at what it has commanded."""

    @property
    def looks_ahead_s(self) -> Array:
        """(1,) now: it does not look ahead."""
        return np.zeros(1)

    @property
    def drift_m_s(self) -> Array:
        """(3,) velocity that keeps company with the drogue, its swing apart: what the integrals hold."""
        return self._integral.copy()

    @property
    def steady_drift_m_s(self) -> Array:
        """(3,) the same: the integrals are slow."""
        return self.drift_m_s

    @property
    def middle_m(self) -> Array:
        """(3,) from the tip to where the drogue was seen last: it does not tell a swing from a place."""
        return self._place.copy()

    @property
    def bears_the_gusts(self) -> bool:
        """Always: it does not know."""
        return True

    @property
    def unrest(self) -> float:
        """None: it does not tell a swing from a drift."""
        return 0.0

    def error_to_come(self, aim_m: Array) -> Array:
        """(2,) off the drogue across, now: it has no better idea."""
        return np.asarray(self._place[1:] + aim_m)

    def rate(self, u: Array, wanted: Wanted) -> Array:
        """(3,) du/dt of Eq. (1)."""
        s = self._settings
        error, error_rate = self._place.copy(), self._rate.copy()
        error[1:] += wanted.aim_m
        limits = np.full(3, s.proportional_1_s * s.error_max_m)
        if wanted.distance_m is None:
            error[0], speed = 0.0, wanted.speed_m_s
            error_rate[0] += speed
        else:
            error[0] -= wanted.distance_m
            limits[0], speed = wanted.speed_m_s, 0.0
        if self._seen:
            near = np.where(np.abs(error) < s.integrated_m, error, 0.0)
            self._integral = self._integral + s.integral_1_s2 * near * self._step_s
        proportional = np.clip(s.proportional_1_s * error, -limits, limits)
        target = proportional + self._integral + s.derivative * error_rate
        target[0] += speed
        return np.asarray(s.smoothing_1_s * (target - u))
