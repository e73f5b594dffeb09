"""How far the hose is pushed in on the probe, and how fast to go on.

It is not pushed in before it has been told whether the reel takes it up at all (`slack_hose`): until then the receiver
slows down. After contact the view says nothing about the way to the tanker: the way pushed in is the integral of what
was commanded beyond the drogue's drift. Whether that has come into the refuelling range the pod's light says, and a
hold goes by it: on while it is amber, back while it flashes.

Not modelled: what the integral of commands is off by, the drift's error and the gusts.
"""

from dockair.messages import Light
from dockair.nav.guidance.guidance_settings import GuidanceSettings
from dockair.nav.guidance.phases import Phase


class TakeIn:
    """The way since contact.

    Args:
        settings: the range, speeds and gain.
        step_s: control period.
    """

    def __init__(self, settings: GuidanceSettings, step_s: float) -> None:
        self._settings, self._step_s = settings, step_s
        self._told = round(settings.limits.slack_to_s / step_s)  # ticks from contact on
        self._ticks = 0  # since contact
        self.pushed_in_m = 0.0  #: toward the tanker since the coupling was reached
        self._push_to_m = 0.0  # how far it is pushed in at most

    def begin(self, speed_m_s: float) -> None:
        """Begin at the coupling, reached at a commanded speed: what is commanded already will still be flown."""
        self.pushed_in_m, self._push_to_m, self._ticks = speed_m_s * self._settings.response_s[0], 0.0, 0

    def step(self, beyond_drift_m_s: float, light: Light) -> None:
        """Advance by one control tick with the drogue on the probe.

        Args:
            beyond_drift_m_s: commanded along, beyond the drogue's drift.
            light: of the pod.
        """
        limits = self._settings.limits
        self._ticks += 1
        self.pushed_in_m += beyond_drift_m_s * self._step_s
        reckoned_m = self.pushed_in_m if light is Light.GREEN else limits.take_in_m
        self._push_to_m = max(self._push_to_m, reckoned_m + limits.push_on_m)

    def speed_m_s(self, phase: Phase, light: Light) -> float:
        """Speed along that contact and hold ask for beyond the drogue's drift."""
        s = self._settings
        if phase is Phase.CONTACT:  # slows down so as to stop where it is to hold
            if self._ticks < self._told:
                return 0.0
            to_go = max(s.limits.take_in_m - self.pushed_in_m, 0.0)
            return float(min(s.closure_speed_m_s, s.take_in_gain_1_s * to_go))
        if light is Light.FLASHING_AMBER:
            return -s.regain_speed_m_s
        # not on for ever into a hose that is not taken up
        goes_on = light is Light.AMBER and self.pushed_in_m < self._push_to_m
        return s.regain_speed_m_s if goes_on else 0.0
