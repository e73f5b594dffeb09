"""Keeping company with a tanker that turns or descends: what comes on top of the command that guidance steers by.

Guidance steers in stabilised axes, which take part in the announced turn (`stabilised_axes`), as if the tanker flew
straight on. Where it does not, the receiver's own path does as announced, and leans on what announced and true turn
differ by (`announced_path`). To what guidance asks for, u, is added the velocity v, level to the left (l), that the
path is learnt to leave, and what the turn n of the axes does to the drogue's place p is taken off,

    commanded = u + v l - n x p                                                                           (1)

so that the drogue's drift is the same on the way to it, on the probe and back.
"""

import numpy as np

from dockair.messages import ReceiverCommand
from dockair.nav.guidance.announced_path import AnnouncedPath
from dockair.nav.guidance.guidance_settings import GuidanceSettings
from dockair.nav.guidance.stabilised_axes import StabilisedAxes
from dockair.rotations import Array


class Formation:
    """Eq. (1), one control tick at a time.

    Args:
        settings: of the guidance.
        step_s: control period.
    """

    def __init__(self, settings: GuidanceSettings, step_s: float) -> None:
        self.axes, self.path = StabilisedAxes(settings.levelling_s, step_s), AnnouncedPath(settings.path)
        self._step_s = step_s
        self._turned: Array = np.zeros((2, 3))  # n x p and its rate
        self._commanded: Array = np.zeros(3)  # Eq. (1)

    @property
    def is_led(self) -> bool:
        """Whether any path was ever announced; without, Eq. (1) is u."""
        return self.path.is_announced

    def turn(self, w_WB_B: Array) -> None:
        """Turn the axes by a control tick; (3,) the body's angular velocity [rad/s]."""
        self.axes.step(w_WB_B, self.path.turn_rate_rad_s, self.path.bank_rad)

    def follow(self, place_m: Array, rate_m_s: Array, *, learns: bool) -> None:
        """Go on with the announced path by a control tick, and learn from the drogue what it leaves.

        Args:
            place_m: (3,) p.
            rate_m_s: (3,) its rate; 0 where it is reckoned.
            learns: whether it tells anything about the path.
        """
        self._turned = np.array([self.axes.turned(place_m), self.axes.turned(rate_m_s)])
        left = float((rate_m_s + self._turned[0] + self._commanded) @ self.axes.left_N)
        self.path.step(self._step_s, left if learns else None)

    def command(self, u: Array, u_dot: Array) -> ReceiverCommand:
        """Eq. (1) and its rate in body axes, of u (3,) [m/s] and its rate, and what the path does."""
        path, axes = self.path, self.axes
        if self.is_led:
            u = u + path.left_m_s * axes.left_N - self._turned[0]
            u_dot = u_dot + path.left_m_s2 * axes.left_N - self._turned[1]
        self._commanded = u
        R_BN = axes.R_NB.T
        return ReceiverCommand(
            velocity_m_s=R_BN @ u,
            acceleration_m_s2=R_BN @ u_dot,
            turn_rate_rad_s=path.flown_rad_s,
            climb_rad=path.climb_rad,
        )
