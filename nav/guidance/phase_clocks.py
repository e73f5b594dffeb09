"""For how long what decides the next phase has lasted, s."""

import math

from dockair.messages import Light
from dockair.nav.guidance.guidance_settings import RelativeState
from dockair.nav.guidance.phases import Phase, PhaseLimits


class PhaseClocks:
    """Clocks that run on, stand still or begin anew with what the navigation says, one control tick at a time.

    Args:
        step_s: control period.
        limits: from when on a drogue is lost, and frames have stopped.
    """

    def __init__(self, step_s: float, limits: PhaseLimits) -> None:
        self._step_s, self._limits = step_s, limits
        self._has_seen, self._age_s = False, math.inf
        self.time_s = 0.0  #: since the guidance began
        self.in_phase_s = 0.0  #: since the phase began
        self.steady_s = 0.0  #: steady astern of the drogue; stands still while its place is not known well
        self.unsure_s = 0.0  #: the drogue's place has not been known well
        self.patient_s = 0.0  #: waiting for a calm moment, astern or in the approach
        self.unusable_s = 0.0  #: the relative state has been unusable, from the start on
        self.track_lost_s = 0.0  #: the same, or since the newest frame that was used, whichever is longer
        self.blind_s = 0.0  #: unusable beyond that for which it has been usable
        self.doubtful_s = 0.0  #: the integrity monitor has not claimed that contact may be flown
        self.inside_s = 0.0  #: the tip has been past the ring's plane
        self.came_out = False  #: it was in this approach, and is before it again
        self.green_s = 0.0  #: the pod's light has been green in the hold
        self.no_fuel_s = 0.0  #: it has not been, in the hold
        self.frames_stopped = False  #: and none that has come since was used

    def begin(self, phase: Phase) -> None:
        """Begin a phase."""
        self.in_phase_s = self.green_s = self.no_fuel_s = 0.0
        if phase is Phase.APPROACH:
            self.inside_s, self.came_out = 0.0, False

    def step(
        self, phase: Phase, state: RelativeState, ring_ahead_m: float, *, steady: bool, sure: bool, light: Light
    ) -> None:
        """Advance by one control tick.

        Args:
            phase: that is flown.
            state: relative state now.
            ring_ahead_m: ring centre ahead of the probe's tip.
            steady: whether the receiver is steady astern of the drogue, as far as it knows.
            sure: whether it knows the drogue's place well.
            light: of the pod.
        """
        dt = self._step_s
        self.time_s += dt
        self.in_phase_s += dt
        self._see(state)
        self.unsure_s = 0.0 if sure else self.unsure_s + dt
        # What a gap costs here it would cost in the basket, too, from where nobody can be called back.
        claim_lost_in_gap = self.frames_stopped and not state.contact_usable
        if not steady or claim_lost_in_gap or self.unsure_s > self._limits.lost_s:
            self.steady_s = 0.0
        elif sure:
            self.steady_s += dt
        if phase not in (Phase.PRE_CONTACT, Phase.APPROACH):
            self.patient_s = 0.0
        elif light is not Light.RED:  # who waits for amber has not waited for a calm moment
            self.patient_s += dt
        if phase is Phase.APPROACH:
            self.came_out = ring_ahead_m > 0.0 and (self.came_out or self.inside_s > 0.0)
            self.inside_s = self.inside_s + dt if ring_ahead_m <= 0.0 else 0.0
        elif phase is Phase.HOLD:
            is_green = light is Light.GREEN
            self.green_s += dt if is_green else 0.0
            self.no_fuel_s = 0.0 if is_green else self.no_fuel_s + dt

    def _see(self, state: RelativeState) -> None:
        dt = self._step_s
        self._has_seen = self._has_seen or state.usable
        self.unusable_s = 0.0 if state.usable else self.unusable_s + dt
        self.track_lost_s = max(self.unusable_s, state.age_s if self._has_seen else 0.0)
        self.blind_s = max(self.blind_s + (dt if self.unusable_s > 0.0 else -dt), 0.0)
        stop = self._limits.frames_stop_s < state.frame_age_s < math.inf  # infinite where nobody says
        self.frames_stopped = stop or (self.frames_stopped and state.age_s > self._age_s)
        self._age_s = state.age_s
        self.doubtful_s = 0.0 if state.contact_usable else self.doubtful_s + dt
