"""What may be commanded: velocity u and acceleration a = du/dt that belong together, inside the limits.

An acceleration that is asked for is cut off at a_max on each axis, and its change in a tick at j_max dt. Velocity, too,
has a limit V. It is what u comes to when a is let go,

    |u + a |a| / (2 j)| <= V,     a |a| / j axis by axis                                                  (1)

that stays inside it, with j the share of j_max that is used where patience is wanted: where it would not, a goes from
the one asked for toward the one let go until it does. So no more is gained than can be stopped inside the limits.

Not modelled: what u does on its way there; where it turns quickly it goes past V by up to 3 %.
"""

import numpy as np

from dockair.nav.guidance.guidance_settings import GuidanceSettings
from dockair.rotations import Array

_HALVINGS = 20  # to a millionth of the way


class CommandLimits:
    """Eq. (1), one control tick at a time.

    Args:
        settings: limits, and the share of those across where patience is wanted.
        step_s: control period.
    """

    def __init__(self, settings: GuidanceSettings, step_s: float) -> None:
        self._step_s, self._speed_m_s = step_s, settings.velocity_limit_m_s
        limits = np.array(settings.acceleration_limit_m_s2), step_s * np.array(settings.jerk_limit_m_s3)
        share = np.append(1.0, settings.patient_share)
        self._limits, self._patient_limits = limits, (share * limits[0], share * limits[1])  # of u', of its change

    def step(self, u: Array, u_dot: Array, asked: Array, *, patient: bool) -> tuple[Array, Array]:
        """(3,) velocity [m/s] and (3,) acceleration [m/s^2] to command next.

        Args:
            u: (3,) velocity commanded now [m/s].
            u_dot: (3,) its acceleration [m/s^2].
            asked: (3,) acceleration asked for [m/s^2].
            patient: a share of the limits across is enough.
        """
        limit, change = self._patient_limits if patient else self._limits
        out = np.minimum(np.maximum(asked, -limit), limit)
        out = np.minimum(np.maximum(out, u_dot - change), u_dot + change)
        if self._comes_to(u, out) > self._speed_m_s:
            out = self._slowed(u, out, u_dot - np.minimum(np.maximum(u_dot, -change), change))
        return u + out * self._step_s, np.asarray(out)

    def _comes_to(self, u: Array, u_dot: Array) -> float:
        """Left side of Eq. (1) after a tick with this acceleration."""
        gained = u_dot * (np.abs(u_dot) / self._patient_limits[1] + 1.0) * (0.5 * self._step_s)
        return float(np.linalg.norm(u + gained))

    def _slowed(self, u: Array, asked: Array, let_go: Array) -> Array:
        """(3,) the acceleration nearest to the one asked for, on the way to the one let go, that keeps Eq. (1)."""
        most = max(self._speed_m_s, self._comes_to(u, let_go))  # from outside every way back is right
        low, high = 0.0, 1.0
        for _ in range(_HALVINGS):
            share = 0.5 * (low + high)
            if self._comes_to(u, let_go + share * (asked - let_go)) <= most:
                low = share
            else:
                high = share
        return np.asarray(let_go + low * (asked - let_go))
