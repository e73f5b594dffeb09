"""Back to where the hose trails by itself, with the drogue on the probe.

A drogue that is held aside of where it would trail turns on the probe until it lies along its hose: its axis points to
where the hose comes from. With a the angles of that axis to the left and up, in axes that do not turn with the
receiver, and a' their mean over some swings before contact, the tip goes across at

    v = k (a - a'),     each axis within v_max                                                              (1)

so that the hose is let go from about where it trails, and does not throw the drogue aside as it comes off. Nobody sees
the hose, and what the receiver drifts by on the probe is not seen either: without Eq. (1) it comes off from farther
aside the longer it is held.

Not modelled: that a hose which is pushed in trails higher; that by how much a drogue turns a metre depends on the hose;
a coupling that does not let the drogue turn, where there is nothing to see.
"""

import numpy as np

from dockair.nav.guidance.guidance_settings import GuidanceSettings
from dockair.nav.guidance.phases import BEFORE_CONTACT, TOUCHING, Phase, is_off_the_probe
from dockair.rotations import Array


class TrailPosition:
    """Eq. (1), one control tick at a time.

    Args:
        settings: k, v_max and over which time a' is taken; from when on nobody looks at the hose for slack any more.
        step_s: control period.
    """

    def __init__(self, settings: GuidanceSettings, step_s: float) -> None:
        self._settings, self._step_s = settings, step_s
        self._share, self._known = step_s / settings.trail_before_s, 0.0
        self._before_rad: Array = np.zeros(2)  # a' times the share of it that is known
        self._touching_s = 0.0
        self.across_m_s: Array = np.zeros(2)  #: (2,) v, left and up; nothing unless the drogue is seen on the probe

    def step(self, phase: Phase, coupling: Array, along: Array, *, seen: bool) -> None:
        """Advance by one control tick.

        Args:
            phase: that is flown.
            coupling: (3,) from the probe's tip [m].
            along: (3,) the drogue's axis, forward, of any length. Both in axes that do not turn with the receiver.
            seen: whether that is known of frames that have not stopped.
        """
        self.across_m_s = np.zeros(2)
        self._touching_s = self._touching_s + self._step_s if phase in TOUCHING else 0.0
        if not seen:
            return
        angles_rad = np.arctan2(along[1:], along[0])
        if phase in BEFORE_CONTACT:
            self._before_rad = self._before_rad + self._share * (angles_rad - self._before_rad)
            self._known += self._share * (1.0 - self._known)
            return
        s, beside_m = self._settings, float(np.hypot(coupling[1], coupling[2]))
        off = is_off_the_probe(s.limits, float(coupling[0]), beside_m)
        if self._touching_s > s.limits.slack_to_s and self._known > 0.0 and not off:
            asked = s.trail_gain_m_s * (angles_rad - self._before_rad / self._known)
            self.across_m_s = np.clip(asked, -s.trail_speed_max_m_s, s.trail_speed_max_m_s)
