"""How fast the tip closes, and the last moment at which it is called back.

The closure speed c is ramped up and down,

    dc/dt = +-a_c,   and +-a_r while it is called back                                                    (1)

so that it is what the coupling wants whatever the drogue does; where it need fall back no farther, it stands at once.
Until the last moment, when no more than the room to stop (`closing`) is left, the receiver runs up at less than that,
as long as the moment is hopeful. At the last moment it must be good: the predicted miss inside the capture radius, and
the drogue's swing so small that a gust on the rest of the way can be met. Then the receiver is committed and gains its
full speed; else it is called back to where it runs up again.

What is asked for within the response time tau (`closing`) of the coupling is flown in contact. From there on the
committed receiver eases off, and meets the coupling at c all the same,

    distance to the coupling <= c tau                                                                     (2)

for a hose that nothing takes up has to be told before it is pushed in (`slack_hose`).

With q the larger of miss / radius and swing / calm swing: good is q <= 1, hopeful is q <= h, and of a standing receiver
the swing is asked to be calm before it runs up at all.
"""

from dockair.nav.guidance.closing import ClosingSettings, room_to_stop_m


class Closure:
    """Eq. (1), one control tick at a time.

    Args:
        settings: constants.
        full_m_s: closure speed at contact.
        ramp_m_s2: a_c.
        step_s: control period.
    """

    def __init__(self, settings: ClosingSettings, full_m_s: float, ramp_m_s2: float, step_s: float) -> None:
        self._settings, self._full_m_s, self._ramp_m_s2, self._step_s = settings, full_m_s, ramp_m_s2, step_s
        self.begin()

    def begin(self) -> None:
        """Stand still, for another approach or none."""
        self.speed_m_s = self.waiting_s = 0.0  #: c; for so long it has not closed
        self.committed = self._recalled = False
        self.eases_off = False  #: Eq. (2): what is asked for is flown in contact

    def step(
        self, distance_m: float, coupling_m: float, closing_m_s: float, *, known: bool, miss: float, unrest: float
    ) -> None:
        """Advance by one control tick.

        Args:
            distance_m: tip to ring.
            coupling_m: tip to coupling.
            closing_m_s: rate at which it shrinks: gusts bring drogue and receiver together faster than c.
            known: contact may be flown on what is known of the drogue.
            miss: predicted, of the capture radius.
            unrest: the drogue's swing, of one that is calm.
        """
        s, closes = self._settings, self.speed_m_s > 0.0
        last = closes and distance_m <= room_to_stop_m(s, max(self.speed_m_s, closing_m_s))
        if last and known and max(miss, unrest) <= 1.0 and not self._recalled:
            self.committed = True
        hopeful = known and miss <= s.hopeful and unrest <= (s.hopeful if closes else 1.0)
        if not self.committed and (last or (distance_m < s.recall_m and not hopeful)):
            self._recalled = True
        if distance_m >= s.wait_at_m:
            self._recalled = False
        falls_back = self._recalled or (not closes and distance_m < s.wait_at_m)
        goes = self.committed or (hopeful and not falls_back)
        self._ramp(goes, falls_back)
        self.eases_off = self.eases_off or (self.committed and coupling_m <= self.speed_m_s * s.response_s)
        self.waiting_s = self.waiting_s + self._step_s if self.speed_m_s <= 0.0 else 0.0

    def _ramp(self, goes: bool, falls_back: bool) -> None:
        s = self._settings
        ramp_m_s2 = s.recall_m_s2 if self._recalled else self._ramp_m_s2
        speed = self.speed_m_s + (ramp_m_s2 if goes else -ramp_m_s2) * self._step_s
        fastest = self._full_m_s if self.committed else min(s.run_up_m_s, self._full_m_s)
        self.speed_m_s = min(max(speed, -s.retreat_m_s if falls_back else 0.0), fastest)
