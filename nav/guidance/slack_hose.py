"""Whether the reel takes up the hose at contact, told by how the drogue turns on the probe.

A hose that is taken up stays taut, and holds the drogue along itself. One that is not is slack within a tenth of a
second: it sags and lets the drogue's nose down, on the probe, and turns it with every wave that the blow of contact
sends up and down it, long before they tear it off. With the mean a' of the drogue's axis before contact, forward, in
axes that do not turn with the receiver, and its mean a'' from when the blow of contact is over, for that turns the
drogue on a taut hose, too,

    drop = elevation of a' - elevation of a'',     tilt = angle between a' and a''                          (1)

The hose is told to be slack as soon as one of them is too large. Both are of a mean, for the waves turn the drogue to
and fro, and what is left of that is the sag. Gusts turn it on a taut hose, too; a nose that is down has to be so by
less than one that is up or aside, where no sag takes it. The way along the funnel is part of a': without it the two
kinds are no farther apart.

Contact is when the tip has come to the coupling: one that is still on its way there along the funnel turns the drogue
by itself. Nothing is said where the drogue has not been seen on the probe for half of that time.

Some slack hoses lie straight for all of it. Later, as long as the drogue is pushed in or held, it is told by a drogue
that stays turned by more than any taut hose turns it once the receiver goes back to where it trails
(`trail_position`).

Not modelled: a reel that takes up late or slowly; a coupling that does not let the drogue turn.
"""

from collections import deque

import numpy as np

from dockair.nav.guidance.phases import (
    BEFORE_CONTACT,
    ON_THE_PROBE,
    Phase,
    PhaseLimits,
    is_off_the_probe,
    is_reached,
)
from dockair.rotations import Array
from dockair.vectors import cross


class SlackHose:
    """Told once after each contact, and true until the next approach.

    Args:
        limits: how far the drogue may turn, and when it is looked at.
        step_s: control period.
    """

    def __init__(self, limits: PhaseLimits, step_s: float) -> None:
        self._limits = limits
        times_s = limits.slack_from_s, limits.slack_over_s, limits.slack_to_s, limits.slack_far_s
        self._from, self._over, self._to, self._far = (max(round(time_s / step_s), 1) for time_s in times_s)  # ticks
        self._to = max(self._to, self._from + self._over)
        self._before: deque[Array] = deque(maxlen=max(round(limits.slack_before_s / step_s), 1))
        self._rest: Array | None = None  # their sum, made once they are all there
        self._ticks: int | None = None  # since contact; None before it
        self._since, self._seen = np.zeros(3), 0  # sum since the blow was over, of so many that were seen on the probe
        self._far_ticks = 0  # for which the drogue has been turned far, later
        self.is_slack = False  #: nothing takes up the hose

    def step(self, phase: Phase, coupling: Array, along: Array, *, seen: bool) -> None:
        """Advance by one control tick.

        Args:
            phase: that is flown; a receiver that is called back may still come to the coupling.
            coupling: (3,) from the probe's tip [m].
            along: (3,) from its ring's centre to the coupling, the drogue's axis. Both in axes that do not turn with
                the receiver.
            seen: whether that is known of frames that have not stopped.
        """
        if phase in BEFORE_CONTACT:
            self._ticks, self._far_ticks, self.is_slack = None, 0, False
            self._since, self._seen = np.zeros(3), 0
        limits, ahead_m, beside_m = self._limits, float(coupling[0]), float(np.hypot(coupling[1], coupling[2]))
        at_the_coupling = is_reached(limits, ahead_m, beside_m) and beside_m <= limits.coupling_reached_m
        if self._ticks is not None:
            self._ticks += 1
        elif at_the_coupling and phase not in BEFORE_CONTACT:
            self._ticks = 0
        if self._ticks is None:
            if seen and (phase in BEFORE_CONTACT or coupling[0] > along[0]):  # else it may be in the funnel, and turned
                self._before.append(along)
                self._rest = None
            return
        late = self._ticks >= self._to
        if self.is_slack or self._ticks < self._from or (late and phase not in ON_THE_PROBE):
            return
        if self._rest is None:
            if not self._before:
                return
            self._rest = np.sum(self._before, axis=0)
        on_the_probe = seen and not is_off_the_probe(limits, ahead_m, beside_m)
        if not late:
            self._look(along if on_the_probe else None, self._rest, self._ticks - self._from + 1)
        elif on_the_probe:
            _, turned_rad = turn_rad(along, self._rest)
            self._far_ticks = self._far_ticks + 1 if turned_rad > limits.slack_far_rad else 0
            self.is_slack = self._far_ticks >= self._far

    def _look(self, along: Array | None, rest: Array, looked: int) -> None:
        """Eq. (1), and whether it says that it is slack; `looked`: ticks since the blow was over, with this one."""
        limits = self._limits
        if along is not None:
            self._since, self._seen = self._since + along, self._seen + 1
        if looked >= self._over and self._seen >= 0.5 * looked:
            drop_rad, tilt_rad = turn_rad(self._since, rest)
            self.is_slack = drop_rad > limits.slack_drop_rad or tilt_rad > limits.slack_tilt_rad


def turn_rad(along: Array, before: Array) -> tuple[float, float]:
    """How far the axis has dropped and by what angle it has turned [rad], Eq. (1).

    Args:
        along: (3,) the axis, or its mean, forward, of any length; z up.
        before: (3,) the same before contact.
    """
    across = cross(along, before)
    angle_rad = np.arctan2(np.sqrt(across @ across), along @ before)
    return _elevation_rad(before) - _elevation_rad(along), float(angle_rad)


def _elevation_rad(a: Array) -> float:
    return float(np.arctan2(a[2], np.hypot(a[0], a[1])))
