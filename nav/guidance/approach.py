"""Guidance: from the drogue as the navigation sees it to the phase of the docking and the command.

Everything is flown in stabilised axes (`stabilised_axes`): a controller (`predictive`, or `pid` for comparison) follows
the drogue; `closure` says how fast to close, and when to be called back; `take_in` how far to push it in; `phases` says
what comes next. Where the tanker turns or descends, none of it is left to them: `formation` keeps company with it.

The push of the receiver's own bow wave is part of the prediction, and what it did otherwise at one attempt is part of
the next one's aim (`bow_wave_push`).
"""

import math

import numpy as np

from dockair.messages import Light, PodSignal, ReceiverCommand, TankerAnnouncement
from dockair.nav.guidance.closing import PredictedMiss, time_to_contact_s
from dockair.nav.guidance.closure import Closure
from dockair.nav.guidance.command_limits import CommandLimits
from dockair.nav.guidance.controller import Controller, Sight, Wanted
from dockair.nav.guidance.dead_reckoning import DeadReckoning
from dockair.nav.guidance.evasion import Evasion
from dockair.nav.guidance.field_of_view import FieldOfView
from dockair.nav.guidance.formation import Formation
from dockair.nav.guidance.guidance_settings import GuidanceSettings, RelativeState
from dockair.nav.guidance.phase_clocks import PhaseClocks
from dockair.nav.guidance.phases import (
    GOING_BACK,
    ON_THE_PROBE,
    RED_LIGHT,
    TOUCHING,
    Phase,
    PhaseLimits,
    Situation,
    next_phase,
)
from dockair.nav.guidance.pid import Pid
from dockair.nav.guidance.predictive import Predictive
from dockair.nav.guidance.slack_hose import SlackHose
from dockair.nav.guidance.take_in import TakeIn
from dockair.nav.guidance.trail_position import TrailPosition
from dockair.rotations import Array

__all__ = ["Guidance", "GuidanceSettings", "PhaseLimits", "RelativeState"]

_FOLLOWING = (Phase.JOIN_UP, Phase.PRE_CONTACT, Phase.APPROACH, Phase.CLEAR)
_WAITING = (Phase.JOIN_UP, Phase.PRE_CONTACT)
_EVADE_GAIN_1_S = 4.0  # as quickly as the limits allow


class Guidance:
    """Phase and command, one control tick at a time.

    Args:
        settings: gains, speeds and limits.
        control_rate_hz: of the ticks.
        field: the camera's; None where what frames do not show says nothing.
    """

    def __init__(self, settings: GuidanceSettings, control_rate_hz: int, field: FieldOfView | None = None) -> None:
        self._settings, self._dt = settings, 1.0 / control_rate_hz
        self.phase, self.phase_reason = Phase.JOIN_UP, ""
        self._formation = Formation(settings, self._dt)
        self._axes = self._formation.axes
        self._controller = _controller(settings, self._dt)
        self._limits = CommandLimits(settings, self._dt)
        self._miss = PredictedMiss(settings.closing, self._dt)
        self._u: Array = np.zeros(3)
        self._u_dot: Array = np.zeros(3)
        self._place: Array = np.zeros(3)  # of the drogue, reckoned while nobody sees it
        self._aim: Array = np.zeros(2)
        self._reckoning = DeadReckoning(settings, self._dt, field)
        self._passed: Array | None = None  # where the ring was when the tip last came to its plane, left and up
        self._entered_m = 0.0  # how far off when the tip last came past it
        self._station = np.array([settings.stand_off_m, 0.0, 0.0])
        speeds = settings.closure_speed_m_s, settings.closure_acceleration_m_s2
        self._closure = Closure(settings.closing, *speeds, self._dt)
        self._clocks = PhaseClocks(self._dt, settings.limits)
        self._attempts, self._light = 0, Light.AMBER
        self._take_in = TakeIn(settings, self._dt)
        self._is_evading = self._is_recalled = False
        self._evasion = Evasion(settings, self._dt)
        self._hose = SlackHose(settings.limits, self._dt)
        self._trail = TrailPosition(settings, self._dt)

    def announce(self, announcement: TankerAnnouncement) -> None:
        """Take note of what the tanker is about to do."""
        self._formation.path.announce(announcement)

    def signal(self, signal: PodSignal) -> None:
        """Take note of what the pod's light begins to show."""
        self._light = signal.light

    def step(self, state: RelativeState) -> ReceiverCommand:
        """Advance by one control tick.

        Args:
            state: the relative state now; a prediction when not usable.
        """
        self._formation.turn(state.w_WB_B)
        ring, rate = self._axes.moved(state.p_PD_B, state.rate_PD_B)
        coupling = self._axes.R_NB @ state.p_PK_B
        lateral_m = float(np.hypot(ring[1], ring[2]))
        if self._formation.is_led:
            self._keep_company(state, ring, rate)
        self._observe(state, ring, rate)
        self._reckon(state, ring)
        self._count(state, ring, rate, coupling, lateral_m)
        seen = self._is_seen(state)
        self._hose.step(self.phase, coupling, coupling - ring, seen=seen)
        self._trail.step(self.phase, coupling, coupling - ring, seen=seen)
        situation = self._situation(state, ring, rate, coupling, lateral_m)
        before = self.phase
        self._change_phase(situation)
        self._is_evading = self._evasion.step(before, self.phase, situation)
        asked = self._follow(ring, lateral_m) if self._follows(state, ring) else self._hold_course(ring)
        self._u, self._u_dot = self._limits.step(self._u, self._u_dot, asked, patient=self._is_patient)
        self._controller.given(self._u, self._u_dot)
        return self._formation.command(self._u, self._u_dot)

    def _keep_company(self, state: RelativeState, ring: Array, rate: Array) -> None:
        """Tell the formation where the drogue is, and whether it says anything about the path."""
        if state.usable:
            self._place = ring
        elif self.phase not in TOUCHING:  # on the probe it stays where it was seen
            self._place = self._reckoning.place_m
        pushed = self._closure.committed  # a drogue in the bow wave says nothing about the path
        learns = self._is_seen(state) and self.phase in _FOLLOWING and not pushed
        self._formation.follow(self._place, rate if state.usable else np.zeros(3), learns=learns)

    def _observe(self, state: RelativeState, ring: Array, rate: Array) -> None:
        """Show the drogue to the controller, and its distance from the probe's line to the prediction of the miss."""
        change = np.full(3, np.nan) if self._formation.is_led else self._axes.R_NB @ state.dv_WP_B
        touches = self.phase in TOUCHING or (self.phase in (Phase.APPROACH, *GOING_BACK) and ring[0] <= 0.0)
        if touches or not self._is_seen(state):  # a drogue that the probe pushes would lead it astray
            self._controller.observe(None, change)
            self._miss.skip()
            return
        times = self._controller.looks_ahead_s
        later = np.empty((len(times), 3))
        later[:] = ring
        later[1:, 0] = np.maximum(ring[0] + min(rate[0], 0.0) * times[1:], 0.0)
        self._controller.observe(
            Sight(
                place_m=ring,
                rate_m_s=rate,
                push_m_s2=self._settings.bow_wave.at(later),
            ),
            change,
        )
        if not self._closure.committed:  # from then on only the miss at contact is kept small
            self._miss.step(float(np.hypot(*(ring[1:] + self._aim_now()))))
        if self.phase is Phase.APPROACH:
            self._passed = ring[1:].copy() if ring[0] < self._settings.limits.come_along_m else None

    def _is_seen(self, state: RelativeState) -> bool:
        """Whether the drogue is known, and not by a forecast of the fusion's alone."""
        return state.usable and state.age_s <= self._settings.limits.frames_stop_s

    def _reckon(self, state: RelativeState, ring: Array) -> None:
        """Keep where the drogue should be: on the probe, a frame that does not show it says nothing."""
        controller = self._controller
        if state.usable:
            drift, bearable = controller.steady_drift_m_s, controller.bears_the_gusts
            self._reckoning.see(ring, controller.middle_m, drift, bearable=bearable)
            return
        frames_come = state.frame_age_s <= self._settings.limits.frames_stop_s
        not_shown = state.not_shown and frames_come and self.phase not in TOUCHING
        self._reckoning.miss(self._u, self._axes.R_NB, not_shown=not_shown)

    def _count(self, state: RelativeState, ring: Array, rate: Array, coupling: Array, lateral_m: float) -> None:
        """Count time and way in the phase that is flown."""
        ring_ahead_m = float(ring[0])
        self._clocks.step(
            self.phase,
            state,
            ring_ahead_m,
            steady=self._is_steady(ring_ahead_m),
            sure=state.usable and state.sigma_lateral_m < self._settings.limits.steady_sigma_m,
            light=self._light,
        )
        if self.phase is Phase.APPROACH:
            self._close(state, ring_ahead_m, float(coupling[0]), -float(rate[0]))
        if ring_ahead_m > 0.0:
            self._entered_m = 0.0
        elif self._entered_m == 0.0 and math.isfinite(lateral_m):
            self._entered_m = lateral_m
        if self.phase in TOUCHING:
            self._take_in.step(self._u[0] - self._controller.steady_drift_m_s[0], self._light)

    def _is_steady(self, ring_ahead_m: float) -> bool:
        """Whether the receiver is where an approach may begin, as far as it knows."""
        limits = self._settings.limits
        return (
            self.phase is Phase.PRE_CONTACT
            and abs(ring_ahead_m - self._settings.stand_off_m) < limits.steady_along_m
            and self._controller.bears_the_gusts
        )

    def _close(self, state: RelativeState, distance_m: float, coupling_m: float, closing_m_s: float) -> None:
        """Say how good a moment it is to close; the longer one has been waited for, the less is asked of it."""
        s, late = self._settings, self._late
        error = float(np.hypot(*self._controller.error_to_come(self._aim_now())))
        miss = self._miss.at_contact_m(error, distance_m, s.closure_speed_m_s)
        self._closure.step(
            distance_m,
            coupling_m,
            closing_m_s,
            known=state.usable and state.contact_usable,
            miss=miss / (late * s.limits.capture_radius_m),
            unrest=self._controller.unrest / late,
        )

    @property
    def _late(self) -> float:
        """What is asked of a moment now, of what is asked at first."""
        limits = self._settings.limits
        return 1.0 + (limits.late_radius - 1.0) * min(self._clocks.patient_s / limits.patience_s, 1.0)

    def _situation(
        self, state: RelativeState, ring: Array, rate: Array, coupling: Array, lateral_m: float
    ) -> Situation:
        clocks = self._clocks
        return Situation(
            time_s=clocks.time_s,
            in_phase_s=clocks.in_phase_s,
            steady_s=clocks.steady_s,
            unsure_s=clocks.unsure_s,
            spread_m=self._miss.spread_m,
            radius_m=self._late * self._settings.closing.hopeful * self._settings.limits.capture_radius_m,
            waiting_s=self._closure.waiting_s,
            inside_s=clocks.inside_s,
            came_out=clocks.came_out,
            unusable_s=clocks.unusable_s,
            track_lost_s=clocks.track_lost_s,
            blind_s=clocks.blind_s,
            doubtful_s=clocks.doubtful_s,
            station_m=_length(ring - self._station),
            ahead_m=float(coupling[0]),
            beside_m=float(np.hypot(coupling[1], coupling[2])),
            ring_ahead_m=float(ring[0]),
            lateral_m=lateral_m,
            entered_m=self._entered_m,
            frame_age_s=state.frame_age_s,
            frames_stopped=clocks.frames_stopped,
            closing_m_s=-float(rate[0]),
            committed=self._closure.committed,
            pushed_in_m=self._take_in.pushed_in_m,
            attempts=self._attempts,
            light_is_red=self._light is Light.RED,
            green_s=clocks.green_s,
            no_fuel_s=clocks.no_fuel_s,
            hose_is_slack=self._hose.is_slack,
            hose_has_whipped=self._evasion.hose_has_whipped,
        )

    def _change_phase(self, situation: Situation) -> None:
        """Go to the next phase if it is time, and prepare it."""
        transition = next_phase(self.phase, self._settings.limits, situation)
        if transition is None:
            return
        before, self.phase, self.phase_reason = self.phase, transition.to, transition.reason
        self._clocks.begin(self.phase)
        if self.phase is Phase.APPROACH:
            self._attempts, self._passed = self._attempts + 1, None
            self._closure.begin()
        elif self.phase is Phase.CONTACT:
            self._take_in.begin(self._u[0] - self._controller.steady_drift_m_s[0])
        elif self.phase in (Phase.BACK_OFF, Phase.BREAKAWAY):
            self._is_recalled = before is Phase.APPROACH and transition.reason == RED_LIGHT and situation.committed
            if self._passed is not None and self._closure.committed:  # else it did not mean to meet the drogue
                self._aim = self._settings.bow_wave.learnt(self._aim, self._passed)
            self._closure.begin()
            self._miss.forget()

    def _follows(self, state: RelativeState, ring: Array) -> bool:
        """Whether the drogue is followed; not while it is on the probe or about it, or out of view."""
        closes = self._u[0] > self._controller.steady_drift_m_s[0]
        on_its_way = self._is_recalled and closes  # may still come to the ring: then inside the rim
        clear_m = 0.0 if on_its_way else self._settings.limits.off_axis_range_m
        clear = self.phase in (Phase.BACK_OFF, Phase.BREAKAWAY) and ring[0] > clear_m
        past = self.phase is Phase.APPROACH and self._clocks.inside_s > self._settings.funnel_s
        return state.usable and not past and not self._is_evading and (self.phase in _FOLLOWING or clear)

    def _aim_now(self) -> Array:
        """(2,) off the drogue's predicted place, left and up: what is learnt applies to contact."""
        return self._aim if self.phase is Phase.APPROACH else np.zeros(2)

    def _clearance(self, ring: Array, lateral_m: float) -> Array:
        """(2,) added to the aim: beside a basket that is not to be met and may be, from outside the rim."""
        limits = self._settings.limits
        meets = not self._closure.committed and ring[0] < limits.clear_range_m and lateral_m > limits.rim_m
        return -limits.beside_m / lateral_m * ring[1:] if meets else np.zeros(2)

    def _follow(self, ring: Array, lateral_m: float) -> Array:
        """(3,) du/dt of the controller."""
        s = self._settings
        if self.phase is Phase.APPROACH:
            distance_m = float(ring[0])
            wanted = Wanted(
                distance_m=None,
                speed_m_s=0.0 if self._closure.eases_off else self._closure.speed_m_s,
                aim_m=self._aim_now() + self._clearance(ring, lateral_m),
                patient=self._is_patient,
                must_follow=True,
                to_contact_s=self._to_contact_s(distance_m) if self._closure.committed else None,
            )
        elif self.phase in GOING_BACK:
            wanted = Wanted(distance_m=None, speed_m_s=-s.back_off_speed_m_s, aim_m=self._aim_now())
        else:
            wanted = Wanted(
                distance_m=s.stand_off_m,
                speed_m_s=s.join_up_speed_m_s,
                aim_m=self._aim_now(),
                patient=self._is_patient,
            )
        return self._controller.rate(self._u, wanted)

    @property
    def _is_patient(self) -> bool:
        """Whether a share of the limits across is enough: as long as it can be called back."""
        return self.phase in _WAITING or (self.phase is Phase.APPROACH and not self._closure.committed)

    def _to_contact_s(self, distance_m: float) -> float:
        s = self._settings
        speeds = self._closure.speed_m_s, s.closure_speed_m_s
        return time_to_contact_s(s.closing, distance_m, *speeds, s.closure_acceleration_m_s2)

    def _hold_course(self, ring: Array) -> Array:
        """(3,) du/dt toward the drogue's drift, plus the speed along that the phase asks for."""
        about_it = self.phase in GOING_BACK and ring[0] <= 0.0  # it may come along: its drift would be one's own
        s, steady, touching = self._settings, self._controller.steady_drift_m_s, self.phase in TOUCHING
        lost = self._clocks.unusable_s > 0.0 and not touching
        target = self._reckoning.drift_m_s.copy() if lost else self._controller.drift_m_s
        if touching or about_it:
            target[0] = steady[0]
        if touching:
            target[1:] += self._trail.across_m_s
        if self._formation.is_led and touching:  # the drogue has come along
            target += self._axes.turned(np.array([self._take_in.pushed_in_m, 0.0, 0.0]))
        if self.phase in ON_THE_PROBE:
            target[0] += self._take_in.speed_m_s(self.phase, self._light)
        elif self.phase in GOING_BACK or (
            self.phase in _WAITING and self._clocks.unusable_s > s.limits.lost_s
        ):  # nobody waits near a drogue that is not seen
            if lost:
                target += self._reckoning.astern_m_s()
            target[0] -= s.back_off_speed_m_s
        elif self.phase is Phase.APPROACH and lost and not self._closure.committed and self._clocks.inside_s == 0.0:
            target[0] += self._closure.speed_m_s
        elif self.phase is Phase.APPROACH:  # out of view at the last, or in the basket: on as before
            target[0] = self._u[0]
        u_dot = np.asarray(s.course_gain_1_s * (target - self._u))
        if self._is_evading:
            u_dot[2] = _EVADE_GAIN_1_S * (-s.evade_speed_m_s - self._u[2])
        return u_dot


def _controller(settings: GuidanceSettings, step_s: float) -> Controller:
    if settings.controller == "pid":
        return Pid(settings.pid, step_s)
    limits = np.array(settings.acceleration_limit_m_s2), np.array(settings.jerk_limit_m_s3)
    return Predictive(settings.predictive, np.array(settings.response_s), *limits, step_s, settings.patient_share)


def _length(v: Array) -> float:
    return math.sqrt(v @ v)
