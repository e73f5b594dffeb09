"""Where a drogue that is out of view should be, and the way back to where it will come into view again.

The middle of its swing p, the drift d and the receiver's own velocity u say where it is while nobody sees it:

    p' = d - u,     |d| on each axis no more than a drogue behind its tanker may seem to drift                (1)

Its last place does not: a drogue that goes out of view has been pushed aside or is at the end of a swing.

Not modelled: the swing, which is over the longer it is not seen.
"""

import numpy as np

from dockair.nav.guidance.guidance_settings import GuidanceSettings
from dockair.rotations import Array


class DeadReckoning:
    """Eq. (1), one control tick at a time.

    Args:
        settings: of the guidance.
        step_s: control period.
    """

    def __init__(self, settings: GuidanceSettings, step_s: float) -> None:
        self._settings, self._step_s = settings, step_s
        self.place_m: Array = np.zeros(3)  #: (3,) p
        self._most_m_s = settings.unseen_drift_m_s

    def step(self, middle_m: Array | None, drift_m_s: Array, u_m_s: Array, *, bearable: bool) -> None:
        """Advance by one control tick.

        Args:
            middle_m: (3,) p of a drogue that is seen, None out of view.
            drift_m_s: (3,) d, as learnt while it was in view.
            u_m_s: (3,) u.
            bearable: whether the gusts can be borne.
        """
        self._most_m_s = self._settings.unseen_drift_m_s if bearable else self._settings.unseen_drift_in_gusts_m_s
        if middle_m is not None:
            self.place_m = middle_m
        else:
            self.place_m = self.place_m + (self.believed(drift_m_s) - u_m_s) * self._step_s

    def believed(self, drift_m_s: Array) -> Array:
        """(3,) of a drift that was learnt, what may be believed out of view: it may be half a swing, or a gust's."""
        return np.clip(drift_m_s, -self._most_m_s, self._most_m_s)

    def astern_m_s(self) -> Array:
        """(3,) velocity across to get astern of the drogue; none beside it."""
        s, across = self._settings, np.zeros(3)
        if self.place_m[0] > s.limits.off_axis_range_m:
            most = s.back_off_speed_m_s
            across[1:] = np.clip(s.reckoned_gain_1_s * self.place_m[1:], -most, most)
        return across
