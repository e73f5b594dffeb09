"""Says by radio, some time ahead, what the tanker is about to do; with errors.

    start + e_s,     r + e_r,     gamma + e_g          e: normal, drawn once a change                          (1)

An aircraft that rolls out or levels off goes back to 0, about which nobody is mistaken: then r and gamma are exact. How
long the entry takes is agreed between tanker and receiver, and is exact too.
Not modelled: a call that is not made, or is late, or is not understood.
"""

from dataclasses import dataclass

import numpy as np

from dockair.messages import TankerAnnouncement
from dockair.sim.aircraft.tanker import Change, TankerPath


@dataclass(frozen=True, slots=True, kw_only=True)
class TankerSheet:
    """assets/parameters/tanker_path.toml."""

    roll_rate_rad_s: float
    pull_over_rate_rad_s: float
    announced_ahead_s: float
    start_sigma_s: float
    turn_rate_sigma_rad_s: float
    climb_sigma_rad: float


class Announcer:
    """Eq. (1), asked at increasing times.

    Args:
        path: what the tanker flies.
        sheet: when it says so, and how well.
        rng: the stream "announcement".
    """

    def __init__(self, path: TankerPath, sheet: TankerSheet, rng: np.random.Generator) -> None:
        self._path, self._sheet, self._rng = path, sheet, rng
        self._next = path.change_after(-1.0)

    def due(self, time_s: float) -> TankerAnnouncement | None:
        """The announcement to be made now, None for none."""
        change = self._next
        if change is None or change.starts_s - self._sheet.announced_ahead_s > time_s:
            return None
        self._next = self._path.change_after(change.starts_s)
        return self._announced(change, time_s)

    def _announced(self, change: Change, time_s: float) -> TankerAnnouncement:
        start, turn, climb = (float(e) for e in self._rng.standard_normal(3))
        sheet = self._sheet
        return TankerAnnouncement(
            time_stamp_s=time_s,
            starts_s=change.starts_s + sheet.start_sigma_s * start,
            entry_s=change.entry_s,
            turn_rate_rad_s=change.turn_rate_rad_s
            + sheet.turn_rate_sigma_rad_s * turn * (change.turn_rate_rad_s != 0.0),
            climb_rad=change.climb_rad + sheet.climb_sigma_rad * climb * (change.climb_rad != 0.0),
        )
