"""Where a drogue that is out of view should be, and the way back to where it will come into view again.

The middle of its swing p, the drift d and the receiver's own velocity u say where it is while nobody sees it; frames
that show no ring say where it is not. Where p would be in the camera's field, let e be its way out, over the edge
that the drogue was nearest to when it was last seen; else, and while no such frames come, e is nothing:

    p' = d - u + 2 e / T,     d' = e / T^2                                                                  (1)

with |d| on each axis no more than a drogue behind its tanker may seem to drift, and at first no more of what was learnt
than may be believed. Both e and what is wrong in d die away with the time constant T (critically damped).

Its last place does not say it: a drogue that goes out of view has been pushed aside or is at the end of a swing.

A drogue behind its tanker is not found however far out. Once p is farther than

    m + d_max t                                                                                             (2)

from where d alone, as it was at first, would have it, t out of view, it went out by another edge: p is there again, and
frames move it no more.

Not modelled: the swing, which is over the longer it is not seen.
"""

import numpy as np

from dockair.nav.guidance.field_of_view import FieldOfView
from dockair.nav.guidance.guidance_settings import GuidanceSettings
from dockair.rotations import Array


class DeadReckoning:
    """Eqs. (1) and (2), one control tick at a time; stabilised axes.

    Args:
        settings: of the guidance.
        step_s: control period.
        field: the camera's; None where nobody says what frames do not show.
    """

    def __init__(self, settings: GuidanceSettings, step_s: float, field: FieldOfView | None = None) -> None:
        self._settings, self._step_s, self._field = settings, step_s, field
        self.place_m: Array = np.zeros(3)  #: (3,) p
        self.drift_m_s: Array = np.zeros(3)  #: (3,) d: as learnt in view, what may be believed of it out of view
        self._ring_m: Array | None = None  # of a drogue that is in view
        self._most_m_s = settings.unseen_drift_m_s
        self._edge: int | None = None  # by which it went out of view; none of a drogue that nobody has seen
        self._unseen_s = 0.0
        self._first_drift_m_s: Array = np.zeros(3)  # d as it went out of view
        self._unmoved_m: Array = np.zeros(3)  # p by that drift alone

    def see(self, ring_m: Array, middle_m: Array, drift_m_s: Array, *, bearable: bool) -> None:
        """Take note of a drogue that is in view.

        Args:
            ring_m: (3,) its ring's centre, from the probe's tip.
            middle_m: (3,) p.
            drift_m_s: (3,) as learnt: it may be half a swing, or a gust's.
            bearable: whether the gusts can be borne.
        """
        s = self._settings
        self._most_m_s = s.unseen_drift_m_s if bearable else s.unseen_drift_in_gusts_m_s
        self._ring_m, self.place_m, self.drift_m_s = ring_m, middle_m, drift_m_s

    def miss(self, u_m_s: Array, R_NB: Array, *, not_shown: bool) -> None:
        """Advance by one control tick in which the drogue is out of view.

        Args:
            u_m_s: (3,) u.
            R_NB: (3, 3) the body's axes in the stabilised ones.
            not_shown: whether the newest frame shows the whole field, and no ring in it.
        """
        if self._ring_m is not None:
            self._lose(R_NB.T @ self._ring_m)
        out_m = np.zeros(3)
        if self._field is not None and self._edge is not None and not_shown and self._is_ahead:
            out_m = R_NB @ self._field.out_m(R_NB.T @ self.place_m, self._edge)
        T, most_m_s = self._settings.unseen_correction_s, self._settings.unseen_drift_m_s
        self.place_m = self.place_m + (self.drift_m_s - u_m_s + 2.0 * out_m / T) * self._step_s
        drift_m_s = self.drift_m_s + out_m / T**2 * self._step_s
        self.drift_m_s = np.clip(drift_m_s, -most_m_s, most_m_s)
        self._give_up_edge(u_m_s)

    def _give_up_edge(self, u_m_s: Array) -> None:
        """Advance what bounds how far frames may move p, Eq. (2), and put it back once they have moved it farther."""
        if self._edge is None:
            return
        s = self._settings
        self._unseen_s += self._step_s
        self._unmoved_m = self._unmoved_m + (self._first_drift_m_s - u_m_s) * self._step_s
        moved_m = float(np.linalg.norm(self.place_m - self._unmoved_m))
        if moved_m > s.unseen_swing_m + s.unseen_drift_m_s * self._unseen_s:
            self.place_m, self.drift_m_s, self._edge = self._unmoved_m, self._first_drift_m_s, None

    def _lose(self, ring_B: Array) -> None:
        """Note by which edge a drogue goes out of view, and keep of its drift what may be believed."""
        if self._field is not None:
            self._edge = self._field.nearest_edge(ring_B)
        self.drift_m_s, self._ring_m = np.clip(self.drift_m_s, -self._most_m_s, self._most_m_s), None
        self._unseen_s, self._unmoved_m, self._first_drift_m_s = 0.0, self.place_m, self.drift_m_s

    def astern_m_s(self) -> Array:
        """(3,) velocity across to get astern of the drogue; none beside it."""
        s, across = self._settings, np.zeros(3)
        if self._is_ahead:
            most = s.back_off_speed_m_s
            across[1:] = np.clip(s.reckoned_gain_1_s * self.place_m[1:], -most, most)
        return across

    @property
    def _is_ahead(self) -> bool:
        return bool(self.place_m[0] > self._settings.limits.off_axis_range_m)
