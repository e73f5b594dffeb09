"""The path that the tanker has announced: turn rate and slope now, as it said it would fly them.

A change begins at its announced start and takes the announced time T to come in, u = t/T, by the step that tanker and
receiver have agreed upon,

    s(u) = u^3 (10 - 15 u + 6 u^2)                                                                       (1)

Announcements may overlap: the next may come while the last is still being flown.
"""

from collections import deque
from dataclasses import dataclass

from dockair.messages import TankerAnnouncement


@dataclass(frozen=True, slots=True)
class _Ahead:
    """A change that has not begun."""

    starts_s: float  #: on the path's own clock
    entry_s: float
    turn_rate_rad_s: float
    climb_rad: float


class AnnouncedPath:
    """Eq. (1), one control tick at a time; straight and level until something is announced."""

    def __init__(self) -> None:
        self._ahead: deque[_Ahead] = deque()
        self._before = (0.0, 0.0)
        self._after = (0.0, 0.0)
        self._entry_s, self._since_s, self._clock_s = 0.0, 0.0, 0.0
        self.is_announced = False  #: anything, ever

    def announce(self, announcement: TankerAnnouncement) -> None:
        """Take note of what the tanker is about to do."""
        self.is_announced = True
        starts_s = self._clock_s + announcement.starts_s - announcement.time_stamp_s
        change = _Ahead(starts_s, announcement.entry_s, announcement.turn_rate_rad_s, announcement.climb_rad)
        self._ahead.append(change)

    def step(self, step_s: float) -> tuple[float, float]:
        """Turn rate [rad/s], left positive, and slope [rad] a time step later."""
        self._clock_s += step_s
        self._since_s += step_s
        if self._ahead and self._clock_s >= self._ahead[0].starts_s:
            change = self._ahead.popleft()
            self._before, self._after = self._now(), (change.turn_rate_rad_s, change.climb_rad)
            self._entry_s, self._since_s = change.entry_s, self._clock_s - change.starts_s
        return self._now()

    def _now(self) -> tuple[float, float]:
        u = min(self._since_s / self._entry_s, 1.0) if self._entry_s > 0.0 else 1.0
        s = u**3 * (10.0 - 15.0 * u + 6.0 * u * u)  # Eq. (1)
        turn, climb = (before + s * (after - before) for before, after in zip(self._before, self._after, strict=True))
        return turn, climb
