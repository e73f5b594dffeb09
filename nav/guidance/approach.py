"""Steers the drogue, as seen from the probe's tip, onto the probe.

The state is the drogue in *body* axes: p = p_PD_B, its rate r = dp/dt, both known to millimetres from the camera's own
view (the camera's place in the drogue's axes is not). The receiver's velocity in W is unknown, so the command is
built up from its own rate of change:

    du/dt = k_p e + k_d r_e,        |du/dt| <= a_max,   |u| <= u_max                      (1)

with e the error in position, r_e in rate, each taken as "drogue minus where it should be". Against a receiver that
flies u, e'' = a_drogue - k_p e - k_d e': damped, and blind to the bias of the receiver's inertial velocity and to a
steady drift of the drogue. du/dt also goes out as acceleration, so that the flight control need not wait for u.

Across: e is the ring's centre off the probe's line, and the coupling's once the tip is inside the basket.
Along: in PRE_CONTACT e is the distance to the stand-off; while closing only the rate is held, so that the closure
speed is what the coupling wants whatever the drogue does. After contact the view says nothing about the way to the
tanker: the way pushed in is the integral of what was commanded beyond the drogue's mean velocity, itself the slow
average of u during the approach.

Not modelled: the bow wave's push on the drogue, prediction of the drogue's swing.
"""

from dataclasses import dataclass, field

import numpy as np

from dockair.messages import ReceiverCommand
from dockair.nav.guidance.phases import Phase, PhaseLimits, Situation, next_phase
from dockair.rotations import Array


@dataclass(frozen=True, slots=True, kw_only=True)
class GuidanceSettings:
    """Gains and speeds. Gains: poles of Eq. (1) well below the flight control's bandwidth of about 1.2 rad/s."""

    stand_off_m: float = 4.0  # pre-contact distance, tip to ring centre (procedures: 3-5 m)
    closure_speed_m_s: float = 1.2  # published practice 1.0-1.5 m/s
    back_off_speed_m_s: float = 1.0  # breakaway practice 1-2 m/s
    position_gain_1_s2: float = 0.6  # k_p: error of 1 m asks for 0.6 m/s^2
    rate_gain_1_s: float = 1.2  # k_d: rate of 1 m/s asks for 1.2 m/s^2
    acceleration_limit_m_s2: float = 1.5  # a_max; 0.15 g, 9 degrees of bank
    velocity_limit_m_s: float = 2.5  # u_max
    closure_acceleration_m_s2: float = 0.6  # how fast the closure speed is asked for
    mean_velocity_time_s: float = 4.0  # averaging time of the drogue's mean velocity
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
        self._u: Array = np.zeros(3)
        self._u_mean: Array = np.zeros(3)
        self._closure = 0.0
        self._in_phase_s = self._steady_s = self._unusable_s = self._pushed_in_m = 0.0

    def step(self, state: RelativeState) -> ReceiverCommand:
        """Advance by one control tick.

        Args:
            state: the relative state now; a prediction when not usable.
        """
        self._count(state)
        following = next_phase(self.phase, self._settings.limits, self._situation(state))
        if following is not self.phase:
            self.phase, self._in_phase_s = following, 0.0
        u_dot = self._track(state) if self._tracking(state) else self._hold_course()
        u_dot = _limited(u_dot, self._settings.acceleration_limit_m_s2)
        u = _limited(self._u + u_dot * self._dt, self._settings.velocity_limit_m_s)
        u_dot, self._u = (u - self._u) / self._dt, u
        if self.phase in (Phase.PRE_CONTACT, Phase.APPROACH):
            self._average(state)
        return ReceiverCommand(velocity_m_s=u.copy(), acceleration_m_s2=u_dot)

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
            self._pushed_in_m += (self._u[0] - self._u_mean[0]) * self._dt

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

    def _tracking(self, state: RelativeState) -> bool:
        return state.usable and self.phase in (Phase.PRE_CONTACT, Phase.APPROACH, Phase.CLEAR)

    def _track(self, state: RelativeState) -> Array:
        s = self._settings
        inside = state.p_PD_B[0] < 0.0
        error = (state.p_PK_B if inside else state.p_PD_B).copy()
        rate = state.rate_PD_B.copy()
        if self.phase is Phase.APPROACH:
            self._closure = min(self._closure + s.closure_acceleration_m_s2 * self._dt, s.closure_speed_m_s)
            error[0] = 0.0
            rate[0] += self._closure
        else:
            self._closure = 0.0
            error[0] -= s.stand_off_m
        return np.asarray(s.position_gain_1_s2 * error + s.rate_gain_1_s * rate)

    def _hold_course(self) -> Array:
        """Fly the drogue's mean velocity, plus the speed along that the phase asks for."""
        s = self._settings
        along = {Phase.CONTACT: s.closure_speed_m_s, Phase.DISCONNECT: -s.back_off_speed_m_s}
        along[Phase.BREAKAWAY] = -s.back_off_speed_m_s
        wanted = self._u_mean + np.array([along.get(self.phase, 0.0), 0.0, 0.0])
        return np.asarray(s.rate_gain_1_s * (wanted - self._u))

    def _average(self, state: RelativeState) -> None:
        """Update the slow average of the drogue's velocity on the receiver's own scale of u."""
        if not state.usable:
            return
        drogue = self._u + np.array([state.rate_PD_B[0], 0.0, 0.0])
        self._u_mean = self._u_mean + (drogue - self._u_mean) * self._dt / self._settings.mean_velocity_time_s


def _limited(v: Array, limit: float) -> Array:
    norm = float(np.linalg.norm(v))
    return v if norm <= limit else v * (limit / norm)
