"""What decides about closing: the miss predicted for contact, the room to stop, the time to contact.

The miss at contact, t_go from now, is predicted from the error that the commands given will leave and from how well
the drogue has been followed over its last swing,

    miss^2 = |e|^2 exp(-2 t_go / T_e) + mean of |e|^2 over the swing                                      (1)

(where it decides, 1.5 s before contact, e is forgotten but for a fortieth, and the mean is what counts), and the
receiver, once it closes at c, comes to rest not before

    d = c tau + c^2 / (2 a)                                                                               (2)

Within d of the ring it cannot be called back any more (`closure`).
"""

from collections import deque
from dataclasses import dataclass, replace

import numpy as np

from dockair.errors import check_numbers


@dataclass(frozen=True, slots=True, kw_only=True)
class ClosingSettings:
    """Constants of Eqs. (1) and (2), and of `closure`."""

    swing_s: float = 3.0  # the drogue's period at 0.33 Hz
    error_time_s: float = 0.4  # T_e: an error of the following is another one half a response and a half swing later
    deceleration_m_s2: float = 0.6  # a: of a fighter, whose flight control is asked for 0.76 at most
    response_s: float = 0.45  # tau along, engine and all
    hopeful: float = 1.7  # times radius and swing while running up: within a second it may become good
    run_up_m_s: float = 0.9  # c until committed: quick enough to gain 1.2 m/s on the rest, and stopped within 0.7 m
    recall_m: float = 2.0  # from the ring: nearer than this the speed once lost is not gained any more
    recall_m_s2: float = 1.5  # how fast c is then taken back: idle thrust at once, whatever the lag
    wait_at_m: float = 2.8  # from the ring: room to gain the speed of the run-up before the last moment
    retreat_m_s: float = 0.8  # to that place: walking pace, a second try within a few swings
    margin_m: float = 0.7  # short of the ring, at rest: half of it goes as drogue and receiver come together by gusts

    def __post_init__(self) -> None:
        check_numbers("guidance.closing", self, zero=("margin_m",))

    def braked_at(self, deceleration_m_s2: float) -> "ClosingSettings":
        """Return the same for an airframe that brakes less: it runs up so that it stops within the same room."""
        a, tau = deceleration_m_s2, self.response_s
        if a >= self.deceleration_m_s2:
            return self
        room_m = room_to_stop_m(self, self.run_up_m_s) - self.margin_m
        run_up_m_s = float(np.sqrt((a * tau) ** 2 + 2.0 * a * room_m) - a * tau)  # (2) for c
        return replace(self, deceleration_m_s2=a, run_up_m_s=run_up_m_s)


class PredictedMiss:
    """Eq. (1), one control tick at a time."""

    def __init__(self, settings: ClosingSettings, step_s: float) -> None:
        self._settings = settings
        self._squares: deque[float] = deque(maxlen=max(round(settings.swing_s / step_s), 1))
        self._sum, self._skipped = 0.0, 0

    def forget(self) -> None:
        """Begin anew: nothing is known of how well the drogue is followed."""
        self._squares.clear()
        self._sum = 0.0

    def skip(self) -> None:
        """Take note of a tick in which it could not be told; after a whole swing of them nothing is known any more."""
        self._skipped += 1
        if self._skipped == self._squares.maxlen:
            self.forget()

    def step(self, error_m: float) -> None:
        """Take note of how far off the drogue the probe's line is now."""
        self._skipped = 0
        if len(self._squares) == self._squares.maxlen:
            self._sum -= self._squares[0]
        self._squares.append(error_m**2)
        self._sum += error_m**2

    @property
    def spread_m(self) -> float:
        """Root of the mean square over the last swing; infinite before a whole one has been followed."""
        if len(self._squares) < (self._squares.maxlen or 0):
            return float("inf")
        return float(np.sqrt(max(self._sum, 0.0) / len(self._squares)))

    def at_contact_m(self, error_to_come_m: float, distance_m: float, closure_m_s: float) -> float:
        """Miss predicted for a contact that lies `distance_m` ahead at that closure speed."""
        to_go_s = max(distance_m, 0.0) / closure_m_s
        share = float(np.exp(-to_go_s / self._settings.error_time_s))
        return float(np.hypot(share * error_to_come_m, self.spread_m))


def time_to_contact_s(
    settings: ClosingSettings, distance_m: float, closure_m_s: float, full: float, ramp: float
) -> float:
    """Time until a distance has been closed by a receiver whose command has come to `closure_m_s` and goes on to full.

    Args:
        settings: constants.
        distance_m: tip to ring.
        closure_m_s: c now, as commanded.
        full: c at last [m/s].
        ramp: its rate [m/s^2].
    """
    to_go = distance_m - settings.response_s * closure_m_s
    if to_go <= 0.0:  # there before what is commanded now is flown
        return max(distance_m, 0.0) / closure_m_s if closure_m_s > 0.0 else 0.0
    ramping_s = max(full - closure_m_s, 0.0) / ramp
    ramped_m = (closure_m_s + 0.5 * ramp * ramping_s) * ramping_s
    if to_go <= ramped_m:
        time_s = (np.sqrt(closure_m_s**2 + 2.0 * ramp * to_go) - closure_m_s) / ramp
    else:
        time_s = ramping_s + (to_go - ramped_m) / full
    return settings.response_s + float(time_s)


def room_to_stop_m(settings: ClosingSettings, closure_m_s: float) -> float:
    """Distance to the ring within which a receiver that closes at this speed is committed, Eq. (2) with its margin."""
    c = max(closure_m_s, 0.0)
    return c * settings.response_s + 0.5 * c * c / settings.deceleration_m_s2 + settings.margin_m
