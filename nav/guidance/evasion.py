"""When the receiver goes down, out of the way of a hose that may whip.

A hose that nothing takes up at contact (`slack_hose`) will whip: the receiver goes before the drogue is torn off. One
whose drogue comes off the probe sideways, or out of a view that frames go on to give, whips: as the phase ends in which
the probe was held or, where the pod's light is red, on the way back from it, before the drogue is ahead of the tip. So
does one whose drogue has come off by itself and goes out of view before it is seen ahead: it may be thrown aside within
a frame or two of being believed ahead. On the way back under another light it is pulled off, and gusts may take it
aside as it goes. Where the camera itself stopped it may still be on the probe, and the receiver goes straight back. A
hose that has whipped once is not tried again (`phases`): nothing says that it will not do so again.

Not modelled: where the hose is; how long it whips.
"""

import math

from dockair.nav.guidance.guidance_settings import GuidanceSettings
from dockair.nav.guidance.phases import (
    GOING_BACK,
    ON_THE_PROBE,
    Phase,
    PhaseLimits,
    Situation,
    is_off_the_probe,
    is_reached,
)


class Evasion:
    """Begins once at most, and lasts for a time: a hose that has whipped is not tried again.

    Args:
        settings: of the guidance.
        step_s: control period.
    """

    def __init__(self, settings: GuidanceSettings, step_s: float) -> None:
        self._limits, self._lasts_s, self._step_s = settings.limits, settings.evade_s, step_s
        self._was_held, self._slipped_off, self._left_s = False, False, 0.0
        self.hose_has_whipped = False  #: once, ever

    def step(self, before: Phase, phase: Phase, situation: Situation) -> bool:
        """Advance by one control tick, and return whether to go down now.

        Args:
            before: phase until now.
            phase: that begins or goes on.
            situation: that it was decided on.
        """
        if phase not in GOING_BACK:
            self._was_held, self._slipped_off, self._left_s = False, False, 0.0
            return False
        ends_hold, coupling = before in ON_THE_PROBE, (situation.ahead_m, situation.beside_m)
        self._was_held = self._was_held or ends_hold or is_reached(self._limits, *coupling)
        slips_off = is_off_the_probe(self._limits, *coupling)
        self._slipped_off = slips_off if ends_hold else self._slipped_off and not _is_seen_ahead(situation)
        self._left_s = max(self._left_s - self._step_s, 0.0)
        slipped_unseen = self._slipped_off and _is_unseen(self._limits, situation)
        comes_off = slipped_unseen or _comes_off_aside(self._limits, situation, ends_hold=ends_hold)
        whips = self._was_held and (situation.hose_is_slack or comes_off)
        if whips and not self.hose_has_whipped:
            self._left_s, self.hose_has_whipped = self._lasts_s, True
        return self._left_s > 0.0


def _is_seen_ahead(s: Situation) -> bool:
    return s.unusable_s == 0.0 and s.ring_ahead_m > 0.0


def _frames_come(s: Situation) -> bool:
    return not s.frames_stopped and math.isfinite(s.frame_age_s)  # infinite where nobody says


def _is_unseen(limits: PhaseLimits, s: Situation) -> bool:
    """Out of the view of frames that come; where none come, what is believed of a drogue on the probe has run off."""
    return _frames_come(s) and s.unusable_s > limits.frames_stop_s


def _comes_off_aside(limits: PhaseLimits, s: Situation, *, ends_hold: bool) -> bool:
    if s.frames_stopped:
        return False
    out_of_view = s.track_lost_s > limits.lost_s and _frames_come(s)
    if ends_hold:
        return out_of_view or s.beside_m > limits.rim_m
    if not s.light_is_red:
        return False
    if out_of_view:  # since when the receiver may have gone back a little
        return s.ring_ahead_m < limits.come_along_m
    return s.beside_m > limits.rim_m and s.ring_ahead_m <= 0.0
