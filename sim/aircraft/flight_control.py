"""Receiver's own flight control: flies a commanded increment of velocity on its trim flight path.

It is plant, not navigation. It knows what an aircraft knows of itself: attitude, rates, airspeed, specific force, the
positions of its actuators and an inertial velocity with a drift; no place in W and nothing of the tanker.

The command becomes a smooth reference w (`reference`), which surfaces and thrust follow with the gains of `regulator`:

    command = trim + Gamma w - K (x - Pi w) - K_z z - K_g g                                             (1)

x is the measured state beyond trim, z the integral of the velocity's error (held while an actuator is at its limit),
g the gust: what the accelerometers feel across the body beyond what the on-board model of Eq. (3) of `aerodynamics`
predicts for still air, and the airspeed beyond that of the inertial velocity, through a first-order low pass.
A pull of the hose looks like a gust and is countered like one. At its first step the control engages without a bump:
the reference starts from the velocity measured, g from its measurement.

Valid while the aircraft stays near trim (attitude within some 20 degrees, airspeed within some 10 m/s).
Not modelled: noise and lag of the air data, rates and attitude; its on-board model of the airframe is exact.
"""

from dataclasses import dataclass

import numpy as np
from numba import njit

from dockair.messages import ReceiverCommand
from dockair.rotations import Array
from dockair.sim.aircraft.aerodynamics import AirframeParameters
from dockair.sim.aircraft.linear_model import (
    ATTITUDE,
    RATE,
    STATES,
    SURFACES,
    THRUST,
    VELOCITY,
    LinearModel,
    linear_model,
)
from dockair.sim.aircraft.reference import Reference, ReferenceLimits
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
    reference_gain_1_s: Array  #: (3,) forward, left, up
    smoothing_bandwidth_rad_s: float
    smoothing_damping: float
    acceleration_limit_m_s2: Array  #: (3,)
    jerk_limit_m_s3: Array  #: (3,)
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

    @property
    def reference_limits(self) -> ReferenceLimits:
        """The constants of the reference."""
        return ReferenceLimits(
            gain_1_s=self.reference_gain_1_s,
            bandwidth_rad_s=self.smoothing_bandwidth_rad_s,
            damping=self.smoothing_damping,
            acceleration_m_s2=self.acceleration_limit_m_s2,
            jerk_m_s3=self.jerk_limit_m_s3,
            velocity_m_s=self.velocity_limit_m_s,
        )


class FlightControl:
    """Eq. (1), one tick at a time.

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
        self.reference = Reference(parameters.reference_limits, step_s)
        self._trim, self._mass_kg, self._step_s = trim, airframe.mass_kg, step_s
        self._trim_R_WB, self._trim_surfaces_rad = np.ascontiguousarray(trim.R_WB), trim.surfaces_rad
        self._trim_velocity_W = np.array([trim.airspeed_m_s, 0.0, 0.0])
        self._gust_from_residual = np.linalg.inv(np.vstack([[1.0, 0.0, 0.0], self.model.F_gust[1:]]))
        self._gust_share = -float(np.expm1(-parameters.gust_bandwidth_rad_s * step_s))
        self._feedback = np.hstack([self.gains.K, self.gains.K_integral, self.gains.K_gust])
        self._steering = self.gains.Gamma + self.gains.K @ self.gains.Pi
        lowest, highest = trim.thrust_range.idle_n, trim.thrust_range.military_n
        limits_rad = airframe.surface_limits_rad
        self._low = np.append(-limits_rad - trim.surfaces_rad, (lowest - trim.thrust_n) / self._mass_kg)
        self._high = np.append(limits_rad - trim.surfaces_rad, (highest - trim.thrust_n) / self._mass_kg)
        self._engaged = False
        self._integral: Array = np.zeros(3)
        self._gust_W: Array = np.zeros(3)

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
        beyond_trim_W = velocity_W - self._trim_velocity_W
        gust_W = self._gust(R_WB, w_WB_B, velocity_W, airspeed_m_s, specific_force_B, surfaces_rad, thrust_n)
        if not self._engaged:
            self.reference.start(beyond_trim_W, R_WB, command)
            self._gust_W, self._engaged = gust_W, True
        self._gust_W = self._gust_W + self._gust_share * (gust_W - self._gust_W)
        chain = self.reference.step(R_WB, command)
        x = np.empty(STATES + 6)
        x[VELOCITY] = beyond_trim_W
        x[ATTITUDE] = _rotation_vector(R_WB, self._trim_R_WB)
        x[RATE] = w_WB_B
        x[SURFACES] = surfaces_rad - self._trim_surfaces_rad
        x[THRUST] = (thrust_n - self._trim.thrust_n) / self._mass_kg
        x[STATES : STATES + 3], x[STATES + 3 :] = self._integral, self._gust_W
        wanted = self._steering @ chain.reshape(-1) - self._feedback @ x  # Eq. (1), beyond trim
        u = np.minimum(np.maximum(wanted, self._low), self._high)
        if np.array_equal(u, wanted):
            self._integral = self._integral + (beyond_trim_W - chain[0]) * self._step_s
        return u[:3] + self._trim_surfaces_rad, self._trim.thrust_n + self._mass_kg * float(u[3])

    def _gust(
        self,
        R_WB: Array,
        w_WB_B: Array,
        velocity_W: Array,
        airspeed_m_s: float,
        specific_force_B: Array,
        surfaces_rad: Array,
        thrust_n: float,
    ) -> Array:
        """(3,) gust that explains what is felt, W axes [m/s], unfiltered."""
        force_B, _ = self._trim.aerodynamics.force_and_moment(R_WB.T @ velocity_W, w_WB_B, surfaces_rad)
        force_B[0] += thrust_n
        residual = specific_force_B - force_B / self._mass_kg
        residual[0] = np.sqrt(velocity_W @ velocity_W) - airspeed_m_s
        return np.asarray(self._gust_from_residual @ residual)


@njit(cache=True)
def _rotation_vector(R_WB, trim_R_WB):  # type: ignore[no-untyped-def]
    """(3,) rotation vector phi of R_WB = exp(phi) R_trim, for |phi| < pi."""
    R = R_WB @ trim_R_WB.T
    s = 0.5 * np.array([R[2, 1] - R[1, 2], R[0, 2] - R[2, 0], R[1, 0] - R[0, 1]])
    sine = np.sqrt(s[0] * s[0] + s[1] * s[1] + s[2] * s[2])
    cosine = 0.5 * (R[0, 0] + R[1, 1] + R[2, 2] - 1.0)
    return s if sine < 1e-12 else s * (np.arctan2(sine, cosine) / sine)
