"""Receiver's own flight control: flies a commanded increment of the probe tip's velocity on a path of its own.

It is plant, not navigation. It knows what an aircraft knows of itself: attitude, rates, airspeed, specific force, the
positions of its actuators, an inertial velocity with a drift and where its probe is; no place in W and nothing of the
tanker. Axes F have x along the path (`flight_path`) and y level to the left.

The command becomes a smooth reference (c, a) (`reference`), which a linear model of the aircraft flies with the gains
of `regulator`; surfaces and thrust are the model's and what brings the aircraft to it:

    x_m' = A x_m + B u_m,     u_m = -K_m (x_m, z_m) - K_c (c, a),     z_m' = C x_m - c                  (1)
    command = trim + u_m - K (x - x_m) - K_z z - K_g g,     z' = C (x - x_m)                            (2)

x is the measured state beyond the path's trim; x_m moves against a trim that moves. z is held while an actuator is at
its limit. g is the gust: what the accelerometers feel across the body beyond what the on-board model of the airframe
predicts for still air, and the airspeed beyond that of the inertial velocity, through a first-order low pass. A pull
of the hose looks like a gust and is countered like one. At its first step the control engages without a bump: x_m
starts from the aircraft's velocity, g from its measurement. What keeps the model inside the actuators' limits are those
of the reference; beyond them the aircraft falls behind its model, and comes back.

Valid while the aircraft stays near the path's trim (attitude within some 20 degrees, airspeed within some 10 m/s).
Not modelled: structural modes, quantisation, delay of computing beyond a tick; its model of the airframe is exact.
"""

import numpy as np
from numba import njit

from dockair.messages import ReceiverCommand
from dockair.rotations import Array
from dockair.sim.air.atmosphere import STANDARD_GRAVITY_M_S2, Air
from dockair.sim.aircraft.airframe import AirframeData
from dockair.sim.aircraft.flight_control_parameters import FlightControlParameters
from dockair.sim.aircraft.flight_path import FlightPath
from dockair.sim.aircraft.gain_schedule import THRUST_0, Design, GainSchedule
from dockair.sim.aircraft.linear_model import STATES
from dockair.sim.aircraft.reference import Reference
from dockair.sim.aircraft.regulator import FOLLOWED
from dockair.sim.aircraft.trim import Trim

__all__ = ["FlightControl", "FlightControlParameters"]

_N = STATES


class FlightControl:
    """Eqs. (1) and (2), one tick at a time.

    Args:
        parameters: weights, limits and filters.
        airframe: the on-board model and the limits of the actuators.
        trim: straight and level.
        air: of the flight's altitude.
        probe_B: (3,) the probe's tip from the centre of gravity, body axes [m].
        step_s: length of a tick [s].
    """

    def __init__(
        self,
        parameters: FlightControlParameters,
        airframe: AirframeData,
        *,
        trim: Trim,
        air: Air,
        probe_B: Array,
        step_s: float,
    ) -> None:
        wanted = Design(
            point_B=probe_B,
            feedback=parameters.tolerances,
            following=parameters.following_tolerances,
            gust_1_s=trim.airspeed_m_s / parameters.gust_length_m,
            command_1_s=parameters.command_rate_1_s,
        )
        self.schedule = GainSchedule(airframe, air, trim, wanted)
        self.path = FlightPath(parameters.path, trim.airspeed_m_s, step_s)
        self.reference = Reference(parameters.reference_limits, step_s)
        self._aerodynamics, self._mass_kg, self._step_s = trim.aerodynamics, airframe.mass_kg, step_s
        self._airspeed_m_s = trim.airspeed_m_s
        self._gust_share = -float(np.expm1(-parameters.gust_bandwidth_rad_s * step_s))
        self._force_share = -float(np.expm1(-step_s / parameters.inertial_lag_s)) if parameters.inertial_lag_s else 1.0
        limits_rad, thrust = np.asarray(airframe.surface_limits_rad), trim.thrust_range
        self._limits = np.vstack(
            [
                np.append(-limits_rad, thrust.idle_n / self._mass_kg),
                np.append(limits_rad, thrust.military_n / self._mass_kg),
                np.append(np.full(3, airframe.actuator_bandwidth_rad_s), 1.0 / airframe.engine_time_constant_s),
            ]
        )
        self._trim: Array = np.empty(10)  # of the last tick: attitude, rates, surfaces, thrust
        self._x_m: Array = np.zeros(FOLLOWED)
        self._z: Array = np.zeros(3)
        self._gust: Array = np.zeros(3)
        self._force_B: Array = np.zeros(3)
        self._slope = 0.0
        self._engaged = False

    @property
    def gust_W(self) -> Array:
        """(3,) the gust it believes in [m/s]."""
        return np.asarray(self.path.axes() @ self._gust)

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
            R_WB: (3, 3) attitude against level and the heading of the path at the start.
            w_WB_B: (3,) angular velocity [rad/s].
            velocity_W: (3,) inertial velocity with its drift, axes of W [m/s].
            airspeed_m_s: true airspeed.
            specific_force_B: (3,) of the accelerometers at the centre of gravity [m/s^2].
            surfaces_rad: (3,) positions of the surfaces.
            thrust_n: thrust.
            command: increment on the path, and what the path does.
        """
        path, thrust = self.path, thrust_n / self._mass_kg
        path.step(command.turn_rate_rad_s, command.climb_rad)
        row, R_FW = self.schedule.at(path.turn_rate_rad_s), path.axes().T
        R_FB, velocity_F = R_FW @ R_WB, R_FW @ velocity_W
        trim = row.trim.copy()
        trim[THRUST_0] += STANDARD_GRAVITY_M_S2 * np.sin(path.climb_rad)
        x = _state(R_FB, w_WB_B, velocity_F, self._airspeed_m_s, surfaces_rad, thrust, trim)
        residual = self._residual(R_WB.T @ velocity_W, w_WB_B, surfaces_rad, airspeed_m_s, specific_force_B)
        gust = row.gust_from_residual @ residual
        if not self._engaged:
            self._engage(x, row.C @ x, R_FB, trim, command, gust)
        _move(self._x_m, self._trim, trim, path.climb_rad - self._slope, self._airspeed_m_s)
        self._trim, self._slope = trim, path.climb_rad
        self._gust += self._gust_share * (gust - self._gust)
        chain = self.reference.step(R_FB, command)
        matrices = (row.A, row.C, row.K, row.K_followed, row.K_command)
        u = _command(*matrices, trim[6:], x, self._x_m, self._z, self._gust, chain, self._limits, self._step_s)
        return u[:3], self._mass_kg * float(u[3])

    def _engage(
        self, x: Array, velocity: Array, R_FB: Array, trim: Array, command: ReceiverCommand, gust: Array
    ) -> None:
        """Start from where the aircraft is."""
        self._x_m[:3] = x[:3]
        self.reference.start(velocity, R_FB, command)
        self._gust, self._trim, self._slope, self._engaged = gust.copy(), trim, self.path.climb_rad, True

    def _residual(
        self, v_B: Array, w_B: Array, surfaces_rad: Array, airspeed_m_s: float, specific_force_B: Array
    ) -> Array:
        """(3,) airspeed and specific forces across the body beyond those of still air."""
        force_B = self._aerodynamics.force_and_moment(v_B, w_B, surfaces_rad)[0] / self._mass_kg
        if not self._engaged:
            self._force_B = force_B
        self._force_B = self._force_B + self._force_share * (force_B - self._force_B)  # as late as the accelerometers
        residual = specific_force_B - self._force_B
        residual[0] = np.sqrt(v_B @ v_B) - airspeed_m_s
        return np.asarray(residual)


@njit(cache=True)
def _state(R_FB, w, velocity_F, airspeed, surfaces, thrust, trim):  # type: ignore[no-untyped-def]
    """(13,) x beyond the path's trim."""
    x = np.empty(13)
    x[:3] = velocity_F
    x[0] -= airspeed
    x[3:6] = _rotation_vector(R_FB @ _attitude(trim[:3]).T)
    x[6:9] = w - trim[3:6]
    x[9:12] = surfaces - trim[6:9]
    x[12] = thrust - trim[9]
    return x


@njit(cache=True)
def _move(x_m, before, trim, inclined, airspeed):  # type: ignore[no-untyped-def]
    """Write x_m against a trim that has moved, in axes that have been inclined."""
    if inclined != 0.0:
        x_m[2] -= inclined * airspeed
        x_m[4] += inclined
    if not np.array_equal(before, trim):
        x_m[3:6] -= _rotation_vector(_attitude(trim[:3]) @ _attitude(before[:3]).T)
        x_m[6:13] -= trim[3:] - before[3:]


@njit(cache=True)
def _command(A, C, K, K_m, K_c, u_0, x, x_m, z, gust, chain, limits, step):  # type: ignore[no-untyped-def]
    """(4,) commands of Eq. (2); advances model and integral. Limits: lowest, highest; lags."""
    n = len(x)
    low, high = limits[0] - u_0, limits[1] - u_0
    u_m = -np.dot(K_m, x_m) - np.dot(K_c, chain[:2].copy().reshape(6))
    error = np.empty(n + 6)
    error[:n], error[n : n + 3], error[n + 3 :] = x - x_m[:n], z, gust
    wanted = u_m - np.dot(K, error)
    u = np.minimum(np.maximum(wanted, low), high)
    if np.array_equal(u, wanted):
        z += step * np.dot(C, error[:n])
    rate = np.dot(A, x_m[:n])
    rate[n - 4 :] += limits[2] * u_m
    x_m[n:] += step * (np.dot(C, x_m[:n]) - chain[0])
    x_m[:n] += step * rate
    return u + u_0


@njit(cache=True)
def _attitude(angles):  # type: ignore[no-untyped-def]
    """(3, 3) R_z R_y R_x of angles about x, y, z."""
    cx, sx, cy, sy = np.cos(angles[0]), np.sin(angles[0]), np.cos(angles[1]), np.sin(angles[1])
    cz, sz = np.cos(angles[2]), np.sin(angles[2])
    return np.array(
        [
            [cz * cy, cz * sy * sx - sz * cx, cz * sy * cx + sz * sx],
            [sz * cy, sz * sy * sx + cz * cx, sz * sy * cx - cz * sx],
            [-sy, cy * sx, cy * cx],
        ]
    )


@njit(cache=True)
def _rotation_vector(R):  # type: ignore[no-untyped-def]
    """(3,) rotation vector phi of R = exp(phi), for |phi| < pi."""
    s = 0.5 * np.array([R[2, 1] - R[1, 2], R[0, 2] - R[2, 0], R[1, 0] - R[0, 1]])
    sine = np.sqrt(s[0] * s[0] + s[1] * s[1] + s[2] * s[2])
    cosine = 0.5 * (R[0, 0] + R[1, 1] + R[2, 2] - 1.0)
    return s if sine < 1e-12 else s * (np.arctan2(sine, cosine) / sine)
