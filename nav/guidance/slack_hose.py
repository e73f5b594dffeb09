"""Whether the reel takes up the hose at contact, told by how the drogue turns on the probe.

A hose that is taken up stays taut, and holds the drogue along itself. One that is not is slack within a tenth of a
second: it sags and lets the drogue's nose down, on the probe, and turns it with every wave that the blow of contact
sends up and down it, long before they tear it off. With the drogue's axis a, forward, in axes that do not turn with the
receiver, and its mean a' before contact,

    drop = median of (elevation of a' - elevation of a),     tilt = median angle between a and a'          (1)

since the blow of contact, which turns the drogue on a taut hose, too, is over. Gusts turn it there as well, up more
than down: so a nose that is up has to be so by more. It is asked for some time, for a slack hose may lie straight for a
moment between two waves. The hose is told only while the drogue is still turned by half of that angle: where the
medians are a blow's that has lasted, it has come back meanwhile.

Nothing is said where the drogue has not been seen on the probe for half of that time.

Some slack hoses lie straight for all of it. Later, as long as the drogue is pushed in or held, it is told by a drogue
that stays turned by more than any taut hose turns it once the receiver goes back to where it trails
(`trail_position`).

Not modelled: a reel that takes up late or slowly; a coupling that does not let the drogue turn.
"""

from collections import deque

import numpy as np

from dockair.nav.guidance.phases import BEFORE_CONTACT, ON_THE_PROBE, Phase, PhaseLimits, is_off_the_probe, is_reached
from dockair.rotations import Array
from dockair.vectors import cross


class SlackHose:
    """Told once after each contact, and true until the next approach.

    Args:
        limits: how far the drogue may turn, and when it is looked at.
        step_s: control period.
    """

    def __init__(self, limits: PhaseLimits, step_s: float) -> None:
        self._limits, self._step_s = limits, step_s
        self._before: deque[Array] = deque(maxlen=round(limits.slack_before_s / step_s))
        self._rest: Array | None = None  # their sum, made once they are all there
        self._contact_s = -np.inf  # since contact; -inf before it
        self._turns_rad: list[tuple[float, float]] = []  # since the blow was over, where it was seen on the probe
        self._far_s = 0.0  # for which the drogue has been turned far, later
        self.is_slack = False  #: nothing takes up the hose

    def step(self, phase: Phase, coupling: Array, along: Array, *, seen: bool) -> None:
        """Advance by one control tick.

        Args:
            phase: that is flown; a receiver that is called back may still come to the coupling.
            coupling: (3,) from the probe's tip [m].
            along: (3,) the drogue's axis, forward, of any length. Both in axes that do not turn with the receiver.
            seen: whether that is known of frames that have not stopped.
        """
        self._contact_s += self._step_s
        if phase in BEFORE_CONTACT:
            self._contact_s, self._far_s, self.is_slack = -np.inf, 0.0, False
            self._turns_rad.clear()
            if seen:
                self._before.append(along)
                self._rest = None
            return
        limits, ahead_m, beside_m = self._limits, float(coupling[0]), float(np.hypot(coupling[1], coupling[2]))
        if self._contact_s == -np.inf and (phase is Phase.CONTACT or is_reached(limits, ahead_m, beside_m)):
            self._contact_s = 0.0
        late = self._contact_s > limits.slack_to_s
        if self.is_slack or self._contact_s < limits.slack_from_s or (late and phase not in ON_THE_PROBE):
            return
        if self._rest is None:
            self._rest = np.sum(self._before, axis=0) if self._before else None
        on_the_probe = seen and not is_off_the_probe(limits, ahead_m, beside_m)
        turn = turn_rad(along, self._rest) if on_the_probe and self._rest is not None else None
        if not late:
            self._look(turn)
        elif turn is not None:
            self._far_s = self._far_s + self._step_s if turn[1] > limits.slack_far_rad else 0.0
            self.is_slack = self._far_s >= limits.slack_over_s

    def _look(self, turn: tuple[float, float] | None) -> None:
        """Eq. (1), and whether it says that the hose is slack."""
        limits = self._limits
        if turn is not None:
            self._turns_rad.append(turn)
        looked = round((self._contact_s - limits.slack_from_s) / self._step_s) + 1
        if looked >= round(limits.slack_over_s / self._step_s) and len(self._turns_rad) >= 0.5 * looked:
            drop_rad, tilt_rad = np.median(self._turns_rad, axis=0)
            limit_rad = limits.slack_tilt_rad if drop_rad > 0.0 else limits.slack_tilt_up_rad
            still_rad = self._turns_rad[-1][1]
            self.is_slack = bool(tilt_rad > limit_rad and still_rad > limits.slack_still * limit_rad)


def turn_rad(along: Array, before: Array) -> tuple[float, float]:
    """How far the axis has dropped and by what angle it has turned [rad], Eq. (1) but for the medians.

    Args:
        along: (3,) the axis, forward, of any length; z up.
        before: (3,) the same before contact.
    """
    across = cross(along, before)
    angle_rad = np.arctan2(np.sqrt(across @ across), along @ before)
    return _elevation_rad(before) - _elevation_rad(along), float(angle_rad)


def _elevation_rad(a: Array) -> float:
    return float(np.arctan2(a[2], np.hypot(a[0], a[1])))
