"""Steers the drogue, as seen from the probe's tip, onto the probe.

The state is the drogue in *body* axes: p = p_PD_B, its rate r = dp/dt, both known to millimetres from the camera's own
view (the camera's place in the drogue's axes is not). The receiver answers a command after a response time tau.

Across, the drogue's swing is predicted over tau (`drogue_motion`) and met there: with y_D its place, y_r the
receiver's own on the same scale, both at t + tau, the latter from the commands already given,

    u = y_D' + k (y_D - y_r),      du/dt = y_D'' + k (y_D' - u)  + smoothing                              (1)

Along, the command is built up from its own rate of change, e being the distance beyond the stand-off and c the
closure speed asked for, ramped up:

    du/dt = k_p e + k_d r   in PRE_CONTACT,        du/dt = k_d (r + c)   while closing                    (2)

so that the closure speed is what the coupling wants whatever the drogue does. u and du/dt both go out. Neither minds a
bias of the receiver's inertial velocity.

After contact the view says nothing about the way to the tanker: the way pushed in is the integral of what was
commanded beyond the drogue's mean velocity, itself the slow average of u during the approach.

Where the tanker turns or descends, the receiver's own path does so as announced (`announced_path`), and u stays small.
What announced and true turn differ by shows as a drift across that grows; u to the left goes into the turn:

    r = r_announced + k_r (u_left + integral of u_left dt / T_r)                                          (3)

While closing, the bow wave's push that is still to come is added to y_D and y_D' (`bow_wave_push`).
"""

from collections import deque
from dataclasses import dataclass, field

import numpy as np

from dockair.messages import ReceiverCommand, TankerAnnouncement
from dockair.nav.guidance.announced_path import AnnouncedPath
from dockair.nav.guidance.bow_wave_push import BowWavePush
from dockair.nav.guidance.drogue_motion import DrogueMotion, SwingSettings
from dockair.nav.guidance.phases import Phase, PhaseLimits, Situation, next_phase
from dockair.rotations import Array


@dataclass(frozen=True, slots=True, kw_only=True)
class GuidanceSettings:
    """Gains and speeds."""

    stand_off_m: float = 4.0  # pre-contact distance, tip to ring centre (procedures: 3-5 m)
    closure_speed_m_s: float = 1.2  # published practice 1.0-1.5 m/s
    back_off_speed_m_s: float = 1.0  # breakaway practice 1-2 m/s
    response_time_s: float = 0.25  # tau: the flight control's lag to a command with its rate, 0.5 to 2 rad/s
    lateral_gain_1_s: float = 1.0  # k: poles of Eq. (1) at a quarter of 1 / tau
    take_in_gain_1_s: float = 0.35  # speed into the refuelling range per metre to go; a third of k_d: no overshoot
    smoothing_1_s: float = 4.0  # how fast u goes to the u of Eq. (1) where it is not there: 1 / tau
    position_gain_1_s2: float = 0.6  # k_p: error of 1 m asks for 0.6 m/s^2
    rate_gain_1_s: float = 1.2  # k_d: rate of 1 m/s asks for 1.2 m/s^2
    acceleration_limit_m_s2: float = 1.5  # 0.15 g, 9 degrees of bank
    velocity_limit_m_s: float = 2.5
    closure_acceleration_m_s2: float = 0.6  # how fast the closure speed is asked for
    mean_velocity_time_s: float = 4.0  # averaging time of the drogue's mean velocity
    turn_gain_rad_m: float = 1e-3  # k_r: at 180 m/s a drift across goes within 6 s, slow beside the swing and Eq. (1)
    turn_learning_s: float = 10.0  # T_r: the turn's error is known when the probe is in the basket and sees no drift
    swing: SwingSettings = field(default_factory=SwingSettings)
    bow_wave: BowWavePush = field(default_factory=BowWavePush)
    limits: PhaseLimits = field(default_factory=PhaseLimits)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class RelativeState:
    """What guidance is told about the drogue, in body axes."""

    usable: bool
    p_PD_B: Array  #: (3,) ring centre from the probe's tip [m]
    rate_PD_B: Array  #: (3,) d/dt of p_PD_B [m/s]
    p_PK_B: Array  #: (3,) coupling from the probe's tip [m]
    sigma_lateral_m: float  #: standard deviation of p_PD_B across the probe's line


class Guidance:
    """Phase and command, one control tick at a time."""

    def __init__(self, settings: GuidanceSettings, control_rate_hz: int) -> None:
        self._settings, self._dt = settings, 1.0 / control_rate_hz
        self.phase = Phase.PRE_CONTACT
        self._motion = DrogueMotion(settings.swing, self._dt, settings.response_time_s)
        self._u: Array = np.zeros(3)
        delay = round(settings.response_time_s * control_rate_hz)
        self._given: deque[Array] = deque([np.zeros(2)] * delay, maxlen=delay)  # commands across that are not flown yet
        self._flown: Array = np.zeros(2)  # y_r now
        self._path, self._turn_error_m_s = AnnouncedPath(), 0.0
        self._seen = False
        self._mean_along = self._closure = 0.0
        self._in_phase_s = self._steady_s = self._unusable_s = self._pushed_in_m = 0.0

    def announce(self, announcement: TankerAnnouncement) -> None:
        """Take note of what the tanker is about to do."""
        self._path.announce(announcement)

    def step(self, state: RelativeState) -> ReceiverCommand:
        """Advance by one control tick.

        Args:
            state: the relative state now; a prediction when not usable.
        """
        self._count(state)
        following = next_phase(self.phase, self._settings.limits, self._situation(state))
        if following is not self.phase:
            self.phase, self._in_phase_s = following, 0.0
            if following is Phase.CONTACT:  # what is commanded already will still be flown
                self._pushed_in_m = self._closure * self._settings.response_time_s
        if self.phase in (Phase.PRE_CONTACT, Phase.APPROACH, Phase.CLEAR):
            self._observe(state)
            u_dot = self._track(state)
        else:
            u_dot = self._hold_course()
        u_dot = _limited(u_dot, self._settings.acceleration_limit_m_s2)
        self._u = _limited(self._u + u_dot * self._dt, self._settings.velocity_limit_m_s)
        self._flown = self._flown + self._given[0] * self._dt
        self._given.append(self._u[1:])
        turn, climb = self._path.step(self._dt)
        if self._path.is_announced:
            if state.usable and self.phase in (Phase.PRE_CONTACT, Phase.APPROACH):
                self._turn_error_m_s += float(self._u[1]) * self._dt / self._settings.turn_learning_s
            turn += self._settings.turn_gain_rad_m * (float(self._u[1]) + self._turn_error_m_s)  # Eq. (3)
        return ReceiverCommand(
            velocity_m_s=self._u.copy(), acceleration_m_s2=u_dot, turn_rate_rad_s=turn, climb_rad=climb
        )

    def _count(self, state: RelativeState) -> None:
        settings, limits = self._settings, self._settings.limits
        self._in_phase_s += self._dt
        self._unusable_s = 0.0 if state.usable else self._unusable_s + self._dt
        offset = state.p_PD_B - np.array([settings.stand_off_m, 0.0, 0.0])
        steady = (
            state.usable
            and np.linalg.norm(offset) < limits.steady_offset_m
            and np.linalg.norm(state.rate_PD_B) < limits.steady_rate_m_s
            and state.sigma_lateral_m < limits.steady_sigma_m
        )
        self._steady_s = self._steady_s + self._dt if steady else 0.0
        if self.phase is Phase.CONTACT:
            self._pushed_in_m += (self._u[0] - self._mean_along) * self._dt

    def _situation(self, state: RelativeState) -> Situation:
        return Situation(
            in_phase_s=self._in_phase_s,
            steady_s=self._steady_s,
            unusable_s=self._unusable_s,
            ahead_m=float(state.p_PK_B[0]),
            ring_ahead_m=float(state.p_PD_B[0]),
            lateral_m=float(np.hypot(state.p_PD_B[1], state.p_PD_B[2])),
            closing_m_s=-float(state.rate_PD_B[0]),
            pushed_in_m=self._pushed_in_m,
        )

    def _observe(self, state: RelativeState) -> None:
        """Follow the drogue on the receiver's own scale of u."""
        if not state.usable:
            self._motion.step(None, None)
            return
        place = self._error_across(state) + self._flown
        rate = state.rate_PD_B[1:] + self._given[0]
        if not self._seen:
            self._motion.start(place, rate)
            self._seen = True
        self._motion.step(place, rate)
        along = self._u[0] + state.rate_PD_B[0]
        self._mean_along += (along - self._mean_along) * self._dt / self._settings.mean_velocity_time_s

    def _error_across(self, state: RelativeState) -> Array:
        """(2,) ring centre off the probe's line, or the coupling once the tip is inside the basket."""
        return (state.p_PD_B if state.p_PD_B[0] > 0.0 else state.p_PK_B)[1:]

    def _track(self, state: RelativeState) -> Array:
        """(3,) du/dt of Eqs. (1) and (2); toward the drogue's drift, if known, while the drogue is not seen."""
        s = self._settings
        if not state.usable:
            return self._toward(np.array([self._u[0], *self._motion.drift_m_s]))
        place, velocity, acceleration = self._motion.ahead()
        if self.phase is Phase.APPROACH:
            way, rate_change = s.bow_wave.ahead(float(state.p_PD_B[0]), -float(state.rate_PD_B[0]))
            place, velocity = place + way, velocity + rate_change
        receiver = self._flown + np.sum(self._given, axis=0) * self._dt
        across = velocity + s.lateral_gain_1_s * (place - receiver)
        across_dot = acceleration + s.lateral_gain_1_s * (velocity - self._u[1:])
        across_dot = across_dot + s.smoothing_1_s * (across - self._u[1:])
        rate = float(state.rate_PD_B[0])
        if self.phase is Phase.APPROACH:
            self._closure = min(self._closure + s.closure_acceleration_m_s2 * self._dt, s.closure_speed_m_s)
            along_dot = s.rate_gain_1_s * (rate + self._closure)
        else:
            self._closure = 0.0
            along_dot = s.position_gain_1_s2 * (state.p_PD_B[0] - s.stand_off_m) + s.rate_gain_1_s * rate
        return np.array([along_dot, *across_dot])

    def _hold_course(self) -> Array:
        """(3,) du/dt toward the drogue's mean velocity, plus the speed along that the phase asks for."""
        s = self._settings
        along = 0.0
        if self.phase is Phase.CONTACT:  # slows down so as to stop where it is to hold
            to_go = max(s.limits.take_in_m - self._pushed_in_m, 0.0)
            along = min(s.closure_speed_m_s, s.take_in_gain_1_s * to_go)
        elif self.phase in (Phase.DISCONNECT, Phase.BREAKAWAY):
            along = -s.back_off_speed_m_s
        return self._toward(np.array([self._mean_along + along, *self._motion.drift_m_s]))

    def _toward(self, u: Array) -> Array:
        return np.asarray(self._settings.rate_gain_1_s * (u - self._u))


def _limited(v: Array, limit: float) -> Array:
    norm = float(np.linalg.norm(v))
    return v if norm <= limit else v * (limit / norm)
