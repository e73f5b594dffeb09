"""Follows the drogue by prediction: flies now what the drogue will do when the receiver has answered.

With y_D place of the drogue and y_r that of the receiver on its own scale, both a response time ahead
(`drogue_motion`, `own_path`), the commanded velocity u goes to

    e = y_D - y_r - wanted,     u* = y_D' + k e + k_i integral of e across,
    du/dt = y_D'' + k (y_D' - u) + s (u* - u)                                                             (1)

axis by axis; while closing at c, u* = y_D' + c along. The integral takes out what a wrong idea of y_D'' leaves. Both u
and du/dt go out, so that the flight control has nothing to guess. A bias of the receiver's inertial velocity is part of
y_D'. What the tip does otherwise than commanded is part of y_D too: it is predicted and flown against like the drogue's
own motion, with the same filter.

A swing that asks for more than a share of the acceleration that the receiver may fly (rms over some swings) is not
followed but waited for astern: then y_D is the middle of the swing, and k and s are smaller. In gusts that move the
drogue so much the surfaces have no rate to spare for haste.

Not modelled: limits of the airframe in advance; what they cut off is missing from y_r's scale until it is seen.
"""

import numpy as np

from dockair.nav.guidance.controller import Sight, Wanted, clipped
from dockair.nav.guidance.drogue_motion import DrogueMotion
from dockair.nav.guidance.guidance_settings import PredictiveSettings
from dockair.nav.guidance.own_path import OwnPath
from dockair.rotations import Array

_AT_FIRST = 1.5  # of what is bearable: a swing that nobody has seen yet is not followed


class Predictive:
    """Eq. (1); see `controller.Controller`."""

    def __init__(self, settings: PredictiveSettings, response_s: Array, limit_m_s2: Array, step_s: float) -> None:
        self._settings = settings
        self._own = OwnPath(response_s, step_s)
        self._motion = DrogueMotion(settings.swing, step_s, response_s)
        self._gains = np.array([settings.along_gain_1_s, settings.across_gain_1_s, settings.across_gain_1_s])
        self._ahead: tuple[Array, Array, Array] = (np.zeros(3), np.zeros(3), np.zeros(3))
        self._integral: Array = np.zeros(2)  # k_i times it, left and up [m/s]
        self._bearable = (settings.bearable_share * limit_m_s2[1:]) ** 2
        self._asked = _AT_FIRST * self._bearable  # mean square of the drogue's acceleration, left and up
        self._step_s, self._seen = step_s, False

    def observe(self, sight: Sight | None) -> None:
        """Take note of the drogue, once a control tick; None when it is not seen."""
        none = np.zeros(3)
        if sight is None:
            self._motion.step(None, None, none)
            self._ahead = self._motion.ahead(none, none)
            return
        place, velocity = sight.place_m + self._own.place_m, sight.rate_m_s + self._own.velocity_m_s
        if not self._seen:
            self._motion.start(place, velocity)
            self._seen = True
        self._motion.step(place, velocity, sight.push_m_s2)
        self._ahead = self._motion.ahead(sight.push_m_s2, sight.push_then_m_s2)
        share = self._step_s / self._settings.bearing_s
        self._asked = self._asked + share * (self._ahead[2][1:] ** 2 - self._asked)

    def given(self, velocity_m_s: Array) -> None:
        """Take note of the velocity (3,) commanded for the next period."""
        self._own.step(velocity_m_s)

    @property
    def drift_m_s(self) -> Array:
        """(3,) velocity that keeps company with the drogue, its swing apart."""
        return self._motion.drift_m_s

    def error_to_come(self, aim_m: Array) -> Array:
        """(2,) off the drogue across, when what has been commanded has been flown."""
        return np.asarray((self._ahead[0] - self._own.place_ahead_m)[1:] + aim_m)

    def rate(self, u: Array, wanted: Wanted) -> Array:
        """(3,) du/dt of Eq. (1)."""
        bearable = wanted.must_follow or bool((self._asked <= self._bearable).all())
        place, velocity, acceleration = self._ahead if bearable else self._motion.mean_ahead()
        calm = 1.0 if bearable else self._settings.calm_share
        gains = calm * self._gains
        to_go = place - self._own.place_ahead_m
        to_go[1:] += wanted.aim_m
        speed = gains * to_go
        if bearable:
            self._integrate(to_go[1:])
        speed[1:] += self._integral
        change = gains * (velocity - u)
        if wanted.distance_m is None:
            speed[0], change[0] = wanted.speed_m_s, 0.0
        else:
            speed[0] = clipped(gains[0] * (to_go[0] - wanted.distance_m), wanted.speed_m_s)
        return np.asarray(acceleration + change + calm * self._settings.smoothing_1_s * (velocity + speed - u))

    def _integrate(self, error_m: Array) -> None:
        """Go on with the integral; errors too large for it count no more than their limit."""
        s = self._settings
        error = np.clip(error_m, -s.integral_error_max_m, s.integral_error_max_m)
        self._integral = self._integral + s.integral_1_s2 * error * self._step_s
