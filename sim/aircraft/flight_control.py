"""Receiver's own flight control: flies a commanded increment of velocity on its trim flight path.

It is plant, not navigation. It knows what an aircraft knows of itself: attitude, rates, airspeed, specific force, the
positions of its actuators and an inertial velocity with a drift; no place in W and nothing of the tanker.

The command (u, a) in body axes is turned into W axes and becomes a reference r with limited acceleration and jerk,

    r''= w_r^2 (u - r) + 2 zeta w_r (a - r'),     |r'| <= a_max,  |r''| <= j_max  per axis              (1)

which a command whose a is its u's own rate passes without lag. Surfaces and thrust follow from `regulator`:

    command = trim + Gamma (r, r', r'') - K (x - Pi (r, r', r'')) - K_z z - K_g g                       (2)

x is the measured state beyond trim, z the integral of the velocity's error (held while an actuator is at its limit),
g the gust: what the accelerometers feel across the body beyond what the on-board model of Eq. (3) of `aerodynamics`
predicts for still air, and the airspeed beyond that of the inertial velocity, through a first-order low pass.
A pull of the hose looks like a gust and is countered like one.

Valid while the aircraft stays near trim (attitude within some 20 degrees, airspeed within some 10 m/s).
Not modelled: noise and lag of the air data, rates and attitude; its on-board model of the airframe is exact.
"""

from dataclasses import dataclass

import numpy as np
from numba import njit

from dockair.messages import ReceiverCommand
from dockair.rotations import Array
from dockair.sim.aircraft.aerodynamics import AirframeParameters
from dockair.sim.aircraft.linear_model import SURFACES, THRUST, LinearModel, linear_model
from dockair.sim.aircraft.regulator import Gains, Tolerances, design
from dockair.sim.aircraft.trim import Trim


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class FlightControlParameters:
    """Sheet `flight_control`."""

    velocity_tolerance_m_s: Array  #: (3,) forward, left, up
    integral_tolerance_m: Array  #: (3,)
    attitude_tolerance_rad: Array  #: (3,) roll, pitch, yaw
    rate_tolerance_rad_s: Array  #: (3,)
    surface_tolerance_rad: Array  #: (3,) elevator, aileron, rudder
    thrust_tolerance_m_s2: float
    gust_length_m: float
    gust_bandwidth_rad_s: float
    reference_bandwidth_rad_s: Array  #: (3,) w_r
    reference_damping: float  #: zeta
    acceleration_limit_m_s2: Array  #: (3,) a_max
    jerk_limit_m_s3: Array  #: (3,) j_max
    velocity_limit_m_s: float
    inertial_velocity_sigma_m_s: float
    inertial_velocity_time_s: float

    @property
    def tolerances(self) -> Tolerances:
        """The weights of the regulator."""
        return Tolerances(
            velocity_m_s=self.velocity_tolerance_m_s,
            integral_m=self.integral_tolerance_m,
            attitude_rad=self.attitude_tolerance_rad,
            rate_rad_s=self.rate_tolerance_rad_s,
            surfaces_rad=self.surface_tolerance_rad,
            thrust_m_s2=self.thrust_tolerance_m_s2,
        )


class FlightControl:
    """Eqs. (1) and (2), one tick at a time.

    Args:
        parameters: weights, limits and filters.
        airframe: the on-board model and the limits of the actuators.
        trim: the flight path that commands are increments on.
        step_s: length of a tick [s].
    """

    def __init__(
        self, parameters: FlightControlParameters, airframe: AirframeParameters, trim: Trim, step_s: float
    ) -> None:
        self.model: LinearModel = linear_model(airframe, trim)
        self.gains: Gains = design(self.model, parameters.tolerances, trim.airspeed_m_s / parameters.gust_length_m)
        self._trim, self._mass_kg, self._step_s = trim, airframe.mass_kg, step_s
        self._trim_R_WB = np.ascontiguousarray(trim.R_WB)
        self._trim_velocity_W = np.array([trim.airspeed_m_s, 0.0, 0.0])
        self._gust_from_residual = np.linalg.inv(np.vstack([[1.0, 0.0, 0.0], self.model.F_gust[1:]]))
        self._gust_share = -float(np.expm1(-parameters.gust_bandwidth_rad_s * step_s))
        self._velocity_limit = parameters.velocity_limit_m_s
        self._bandwidth = np.array(parameters.reference_bandwidth_rad_s)
        self._damping = parameters.reference_damping
        self._acceleration_limit = np.array(parameters.acceleration_limit_m_s2)
        self._jerk_limit = np.array(parameters.jerk_limit_m_s3)
        self._feedback = np.hstack([self.gains.K, self.gains.K_integral, self.gains.K_gust])
        thrust_range = trim.thrust_range
        lowest = (thrust_range.idle_n - trim.thrust_n) / self._mass_kg
        highest = (thrust_range.military_n - trim.thrust_n) / self._mass_kg
        self._low = np.append(-airframe.surface_limits_rad - trim.surfaces_rad, lowest)
        self._high = np.append(airframe.surface_limits_rad - trim.surfaces_rad, highest)
        self._reference = np.zeros((3, 3))  # r, r', r'' (rows), W axes
        self._integral = np.zeros(3)
        self._gust_W = np.zeros(3)

    @property
    def reference_velocity_W(self) -> Array:
        """(3,) r of Eq. (1) [m/s]: the velocity beyond trim that is being flown, W axes."""
        return self._reference[0].copy()

    def step(
        self,
        *,
        R_WB: Array,
        w_WB_B: Array,
        velocity_W: Array,
        airspeed_m_s: float,
        specific_force_B: Array,
        surfaces_rad: Array,
        thrust_n: float,
        command: ReceiverCommand,
    ) -> tuple[Array, float]:
        """Commands to the surfaces (3,) [rad] and to the engine [N].

        Args:
            R_WB: (3, 3) attitude against level and the trim heading.
            w_WB_B: (3,) angular velocity [rad/s].
            velocity_W: (3,) inertial velocity with its drift, axes of W [m/s].
            airspeed_m_s: true airspeed.
            specific_force_B: (3,) of the accelerometers at the centre of gravity [m/s^2].
            surfaces_rad: (3,) positions of the surfaces.
            thrust_n: thrust.
            command: increment on the trim flight path.
        """
        model = self._trim.aerodynamics
        force_B, _ = model.force_and_moment(R_WB.T @ velocity_W, w_WB_B, surfaces_rad)
        force_B[0] += thrust_n
        residual = specific_force_B - force_B / self._mass_kg
        residual[0] = np.sqrt(velocity_W @ velocity_W) - airspeed_m_s
        self._gust_W += self._gust_share * (self._gust_from_residual @ residual - self._gust_W)
        _advance_reference(
            self._reference, R_WB, command.velocity_m_s, command.acceleration_m_s2, self._velocity_limit,
            self._bandwidth, self._damping, self._acceleration_limit, self._jerk_limit, self._step_s,
        )  # fmt: skip
        x = np.empty(19)
        x[:3] = velocity_W - self._trim_velocity_W
        x[3:6] = _rotation_vector(R_WB, self._trim_R_WB)
        x[6:9] = w_WB_B
        x[SURFACES] = surfaces_rad - self._trim.surfaces_rad
        x[THRUST] = (thrust_n - self._trim.thrust_n) / self._mass_kg
        error = x[:3] - self._reference[0]
        w = self._reference.reshape(9)
        x[:13] -= self.gains.Pi @ w
        x[13:16], x[16:] = self._integral, self._gust_W
        wanted = self.gains.Gamma @ w - self._feedback @ x
        u = np.minimum(np.maximum(wanted, self._low), self._high)
        if np.array_equal(u, wanted):
            self._integral += error * self._step_s
        return u[:3] + self._trim.surfaces_rad, self._trim.thrust_n + self._mass_kg * float(u[3])


@njit(cache=True)
def _rotation_vector(R_WB, trim_R_WB):  # type: ignore[no-untyped-def]
    """phi of R_WB = exp(phi) R_trim, for |phi| < pi."""
    R = R_WB @ trim_R_WB.T
    s = 0.5 * np.array([R[2, 1] - R[1, 2], R[0, 2] - R[2, 0], R[1, 0] - R[0, 1]])
    sine = np.sqrt(s[0] * s[0] + s[1] * s[1] + s[2] * s[2])
    cosine = 0.5 * (R[0, 0] + R[1, 1] + R[2, 2] - 1.0)
    return s if sine < 1e-12 else s * (np.arctan2(sine, cosine) / sine)


@njit(cache=True)
def _advance_reference(r, R_WB, u_B, a_B, u_max, bandwidth, damping, a_max, jerk_max, step):  # type: ignore[no-untyped-def]
    """Eq. (1) over one tick, in place."""
    size = np.sqrt(u_B[0] ** 2 + u_B[1] ** 2 + u_B[2] ** 2)
    share = min(1.0, u_max / size) if size > 0.0 else 1.0
    for i in range(3):
        u = share * (R_WB[i, 0] * u_B[0] + R_WB[i, 1] * u_B[1] + R_WB[i, 2] * u_B[2])
        a = R_WB[i, 0] * a_B[0] + R_WB[i, 1] * a_B[1] + R_WB[i, 2] * a_B[2]
        jerk = bandwidth[i] ** 2 * (u - r[0, i]) + 2.0 * damping * bandwidth[i] * (a - r[1, i])
        jerk = min(max(jerk, -jerk_max[i]), jerk_max[i])
        faster = min(max(r[1, i] + jerk * step, -a_max[i]), a_max[i])
        r[2, i] = (faster - r[1, i]) / step
        r[0, i] += 0.5 * (r[1, i] + faster) * step
        r[1, i] = faster
