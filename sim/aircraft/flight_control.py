"""Receiver's own flight control: flies a commanded increment of the probe tip's velocity on a path of its own.

It is plant, not navigation. It knows what an aircraft knows of itself: attitude, rates, airspeed, specific force, the
positions of its actuators, an inertial velocity with a drift and where its probe is; no place in W and nothing of the
tanker. Axes F have x along the path (`flight_path`) and y level to the left.

The command becomes a smooth reference (c, a, j) (`reference`). A model of the aircraft flies it in still air with the
gains of `regulator` (`model_flight`); surfaces and thrust are the model's and what brings the aircraft to it:

    u_m = -K_m (x_m, z_m) - K_c (c, a, j),     z_m' = C x_m - c                                           (1)
    command = trim + u_m - K_h (x - x_m, z, g),     z' = C (x - x_m),     K_h = (1 - h) K + h K_busy      (2)

x and x_m are the states of aircraft and model beyond the path's trim, which may move, with velocities such that C x is
the tip's at every bank; the attitude is carried on over the sensors' lag, the model's rates are as late as the measured
ones. z is held while an actuator is at its limit, z_m while the model's command is. g is the gust: what the
accelerometers feel across the body beyond what the on-board model of the airframe predicts for still air, and the
airspeed beyond that of the inertial velocity, through a first-order low pass. A pull of the hose looks like a gust and
is countered like one. At its first step the control engages without a bump: the model starts from trim with the
aircraft's velocity, g from its measurement, and z, in a trim of air that sinks, from what holds it.
What keeps the model inside the actuators' limits are those of the reference, which are taken back where a surface meets
its rate limit or comes near its stop (`rate_relief`); beyond them the aircraft falls behind its model, and comes back.
As long as surfaces are busy (h of `rate_relief`) the feedback asks for less: gusts that are too large to be met do not
drive the airframe apart.

Valid while the aircraft stays near the path's trim (attitude within some 30 degrees, airspeed within some 10 m/s).
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
from dockair.sim.aircraft.gain_schedule import RATE_0, SURFACES_0, THRUST_0, Design, GainSchedule
from dockair.sim.aircraft.linear_model import ATTITUDE, STATES, SURFACES, THRUST
from dockair.sim.aircraft.model_flight import ModelFlight
from dockair.sim.aircraft.rate_relief import RateRelief
from dockair.sim.aircraft.reference import Reference
from dockair.sim.aircraft.regulator import FOLLOWED
from dockair.sim.aircraft.trim import Trim

__all__ = ["FlightControl", "FlightControlParameters"]

# Layouts that the kernels know: a trim of now is attitude, rates, surfaces, thrust per mass, slope of the path
_SLOPE, _TRIM = 10, 11
_AIRSPEED, _MASS, _GUST_SHARE, _LAG_SHARE, _LAG, _PROBE = 1, 2, 3, 4, 5, 6  # in `_constants`, the step first


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
            busy=parameters.busy_tolerances,
            following=parameters.following_tolerances,
            gust_1_s=trim.airspeed_m_s / parameters.gust_length_m,
            swing=parameters.swing,
        )
        self.schedule = GainSchedule(airframe, air, trim, wanted)
        self.path = FlightPath(parameters.path, trim.airspeed_m_s, step_s)
        self.reference = Reference(parameters.reference_limits, step_s)
        self._aerodynamics, self._mass_kg = trim.aerodynamics, airframe.mass_kg
        gust_share = -float(np.expm1(-parameters.gust_bandwidth_rad_s * step_s))
        lag_s = parameters.inertial_lag_s
        shares = [gust_share, -float(np.expm1(-step_s / lag_s)) if lag_s else 1.0]
        self._constants = np.array([step_s, trim.airspeed_m_s, airframe.mass_kg, *shares, lag_s, *probe_B])
        limits_rad, thrust = np.asarray(airframe.surface_limits_rad), trim.thrust_range
        self._limits = np.vstack(
            [
                np.append(-limits_rad, thrust.idle_n / self._mass_kg),
                np.append(limits_rad, thrust.military_n / self._mass_kg),
            ]
        )
        rates_rad_s = np.asarray(airframe.surface_rate_limits_rad_s)
        self._relief = RateRelief(parameters.relief, airframe.actuator_bandwidth_rad_s, rates_rad_s, limits_rad, step_s)
        self.model = ModelFlight(airframe, trim.aerodynamics, step_s)
        self._x_m: Array = np.zeros(FOLLOWED)
        self._z: Array = np.zeros(3)
        self._gust: Array = np.zeros(3)
        self._force_B: Array = np.zeros(3)
        self._room = np.empty((3, 3)), np.empty(3), np.empty(_TRIM), np.empty(STATES), np.empty(3)  # of one step
        self._model_room = np.empty((3, 3)), np.empty(3), np.empty(4)
        self._R_WB, self._w_m = np.empty((3, 3)), np.zeros(3)  # attitude of now; the model's rates, as late as measured
        self._engaged = False

    @property
    def gust_W(self) -> Array:
        """(3,) the gust it believes in [m/s]."""
        return np.asarray(self.path.axes() @ self._gust)

    def start_in(self, trim: Trim) -> None:
        """Set z to what holds another trim of the same path: with the gust that it then believes in, Eq. (2) is it."""
        row, x, R_FB, v_B = self.schedule.at(0.0), np.empty(STATES), np.empty((3, 3)), np.empty(3)
        attitude, at = (np.eye(3), trim.R_WB, trim.velocity_W), (trim.w_WB_B, trim.surfaces_rad)
        about = (trim.thrust_n / self._mass_kg, 0.0, row.trim, self._constants)
        _state(*attitude, *at, *about, R_FB, v_B, np.empty(_TRIM), x)
        force_B, _ = self._aerodynamics.force_and_moment(v_B, *at)
        residual = trim.R_WB[2] * STANDARD_GRAVITY_M_S2 - force_B / self._mass_kg
        residual[0] = np.linalg.norm(v_B) - np.linalg.norm(trim.velocity_W - trim.air_velocity_W)
        known = np.concatenate([x, np.zeros(3), row.gust_from_residual @ residual])
        missing = np.append(x[SURFACES], x[THRUST]) + row.K @ known
        weights = np.append(self._limits[1, :3], STANDARD_GRAVITY_M_S2)  # radians and m/s^2, made comparable
        K_z = row.K[:, STATES : STATES + 3]
        self._z = -np.linalg.lstsq(K_z / weights[:, np.newaxis], missing / weights, rcond=None)[0]

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
        """Commands to the surfaces (3,) [rad], overwritten by the next step, and to the engine [N].

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
        path, model, x_m = self.path, self.model, self._x_m
        path.step(command.turn_rate_rad_s, command.climb_rad)
        row, (R_FB, v_B, trim, x, surfaces_command) = self.schedule.at(path.turn_rate_rad_s), self._room
        R_FM, v_M, commands_m = self._model_room
        _ahead(R_WB, w_WB_B, self._constants[_LAG], self._R_WB)
        flown = (self._R_WB, velocity_W, w_WB_B, surfaces_rad, thrust_n / self._mass_kg)
        about = (path.climb_rad, row.trim, self._constants)
        _state(path.axes(), *flown, *about, R_FB, v_B, trim, x)
        force_B, _ = self._aerodynamics.force_and_moment(v_B, w_WB_B, surfaces_rad)
        if not self._engaged:
            self._start(x[:3], trim)
            self.reference.start(x[:3], R_FB, command)
        modelled = (model.R_WB, model.velocity_W, model.w_WB_B, model.actuators[:3], model.actuators[3])
        _state(path.axes(), *modelled, *about, R_FM, v_M, trim, x_m[:STATES])
        share = self._relief.step(surfaces_command, surfaces_rad, model.actuators) if self._engaged else 1.0
        chain = self.reference.step(R_FB, command, x_m[ATTITUDE.start], share)
        measured = (x, v_B, force_B, specific_force_B, airspeed_m_s, trim, chain)
        haste = self._relief.haste
        K = row.K if haste == 0.0 else (1.0 - haste) * row.K + haste * row.K_busy
        gains = (row.C, K, row.K_followed, row.K_command, row.gust_from_residual)
        memory = (x_m, self._w_m, self._z, self._gust, self._force_B)
        limits = (self._engaged, self._limits, self._constants)
        thrust_command_n = _command(*measured, *gains, *memory, *limits, surfaces_command, commands_m)
        model.step(v_M, commands_m)
        self._engaged = True
        return surfaces_command, thrust_command_n

    def _start(self, velocity_F: Array, trim: Array) -> None:
        """Let the model begin in the trim of now, with a velocity beyond it."""
        R_WF, R_FB = self.path.axes(), np.array(_attitude(trim)).reshape(3, 3)
        ahead = np.array([self._constants[_AIRSPEED], 0.0, 0.0])
        self.model.start(R_WF @ R_FB, R_WF @ (velocity_F + ahead), trim[RATE_0], trim[SURFACES_0.start : THRUST_0 + 1])


@njit(cache=True)
def _ahead(R, w, late, now):  # type: ignore[no-untyped-def]
    """Write R exp(w late), to the second order: the attitude of now."""
    x, y, z = late * w[0], late * w[1], late * w[2]
    half = 0.5 * (x * x + y * y + z * z)
    for i in range(3):
        along = 0.5 * (R[i, 0] * x + R[i, 1] * y + R[i, 2] * z)
        now[i, 0] = R[i, 0] * (1.0 - half) + R[i, 1] * z - R[i, 2] * y + along * x
        now[i, 1] = R[i, 1] * (1.0 - half) + R[i, 2] * x - R[i, 0] * z + along * y
        now[i, 2] = R[i, 2] * (1.0 - half) + R[i, 0] * y - R[i, 1] * x + along * z


@njit(cache=True)
def _state(R_WF, R_WB, velocity_W, w, surfaces, thrust, slope, level, k, R_FB, v_B, trim, x):  # type: ignore[no-untyped-def]
    """Write attitude against the path, velocity along the body, the path's trim, and x beyond it.

    The velocity in x is the one with which C x is that of the tip however much the body is turned from trim.
    """
    trim[:10], trim[_SLOPE] = level, slope
    trim[THRUST_0] += STANDARD_GRAVITY_M_S2 * np.sin(slope)
    R_trim, p = _attitude(trim), k[_PROBE:]
    of_tip = (w[1] * p[2] - w[2] * p[1], w[2] * p[0] - w[0] * p[2], w[0] * p[1] - w[1] * p[0])
    for i in range(3):
        v_B[i] = R_WB[0, i] * velocity_W[0] + R_WB[1, i] * velocity_W[1] + R_WB[2, i] * velocity_W[2]
        x[i] = R_WF[0, i] * velocity_W[0] + R_WF[1, i] * velocity_W[1] + R_WF[2, i] * velocity_W[2]
        for j in range(3):
            R_FB[i, j] = R_WF[0, i] * R_WB[0, j] + R_WF[1, i] * R_WB[1, j] + R_WF[2, i] * R_WB[2, j]
            x[i] += (R_FB[i, j] - R_trim[3 * i + j]) * of_tip[j]
    x[0] -= k[_AIRSPEED]
    _rotation_between(R_FB, R_trim, x[3:6])
    for i in range(3):
        x[6 + i], x[9 + i] = w[i] - trim[3 + i], surfaces[i] - trim[6 + i]
    x[12] = thrust - trim[THRUST_0]


@njit(cache=True)
def _estimate(v_B, force, felt, airspeed, gust_from_residual, gust, force_m, engaged, k):  # type: ignore[no-untyped-def]
    """Advance the gust g."""
    residual = np.empty(3)  # airspeed and specific forces across the body beyond those of still air
    for i in range(3):
        if not engaged:
            force_m[i] = force[i] / k[_MASS]
        force_m[i] += k[_LAG_SHARE] * (force[i] / k[_MASS] - force_m[i])  # as late as the accelerometers
        residual[i] = felt[i] - force_m[i]
    residual[0] = np.sqrt(v_B[0] * v_B[0] + v_B[1] * v_B[1] + v_B[2] * v_B[2]) - airspeed
    for i in range(3):
        now = 0.0
        for j in range(3):
            now += gust_from_residual[i, j] * residual[j]
        gust[i] = gust[i] + k[_GUST_SHARE] * (now - gust[i]) if engaged else now


@njit(cache=True)
def _command(  # type: ignore[no-untyped-def]
    x, v_B, force, felt, airspeed, trim, chain, C, K, K_m, K_c, gust_from_residual, x_m, w_m, z, gust, force_m, engaged,
    limits, k, surfaces, commands_m,
):  # fmt: skip
    """Eqs. (1) and (2): write commands to surfaces and model, return thrust [N]; advance gust and integrals."""
    _estimate(v_B, force, felt, airspeed, gust_from_residual, gust, force_m, engaged, k)
    n, step = len(x), k[0]
    error, u, off = np.empty(n + 6), np.zeros(4), np.zeros(3)
    error[:n], error[n : n + 3], error[n + 3 :] = x - x_m[:n], z, gust
    for i in range(3):
        w_m[i] += k[_LAG_SHARE] * (x_m[6 + i] - w_m[i])
        error[6 + i] = x[6 + i] - w_m[i]
    _add(-1.0, K_m, x_m, u)
    _add(-1.0, K_c, chain[:3].reshape(9), u)
    free_m = free = True
    for i in range(4):
        wanted = trim[6 + i] + u[i]
        commands_m[i] = min(max(wanted, limits[0, i]), limits[1, i])
        free_m = free_m and commands_m[i] == wanted
    _add(-1.0, K, error, u)
    for i in range(4):
        wanted = trim[6 + i] + u[i]
        u[i] = min(max(wanted, limits[0, i]), limits[1, i])
        free = free and u[i] == wanted
    surfaces[:] = u[:3]
    if free:
        _add(step, C, error, z)
    if free_m:
        _add(1.0, C, x_m, off)
        for i in range(3):
            x_m[n + i] += step * (off[i] - chain[0, i])
    return u[3] * k[_MASS]


@njit(cache=True)
def _add(factor, M, x, out):  # type: ignore[no-untyped-def]
    """Add factor M x to out, as many of x as M has columns."""
    for i in range(M.shape[0]):
        total = 0.0
        for j in range(M.shape[1]):
            total += M[i, j] * x[j]
        out[i] += factor * total


@njit(cache=True)
def _attitude(angles):  # type: ignore[no-untyped-def]
    """R_z R_y R_x, row by row, of angles about x, y, z."""
    cx, sx, cy, sy = np.cos(angles[0]), np.sin(angles[0]), np.cos(angles[1]), np.sin(angles[1])
    cz, sz = np.cos(angles[2]), np.sin(angles[2])
    return (
        cz * cy, cz * sy * sx - sz * cx, cz * sy * cx + sz * sx,
        sz * cy, sz * sy * sx + cz * cx, sz * sy * cx - cz * sx,
        -sy, cy * sx, cy * cx,
    )  # fmt: skip


@njit(cache=True)
def _rotation_between(R, S, phi):  # type: ignore[no-untyped-def]
    """Write the rotation vector phi (3,) of R S' = exp(phi), for |phi| < pi; S row by row."""
    M = np.empty((3, 3))
    for i in range(3):
        for j in range(3):
            M[i, j] = R[i, 0] * S[3 * j] + R[i, 1] * S[3 * j + 1] + R[i, 2] * S[3 * j + 2]
    phi[0], phi[1], phi[2] = 0.5 * (M[2, 1] - M[1, 2]), 0.5 * (M[0, 2] - M[2, 0]), 0.5 * (M[1, 0] - M[0, 1])
    sine = np.sqrt(phi[0] * phi[0] + phi[1] * phi[1] + phi[2] * phi[2])
    if sine >= 1e-12:
        cosine = 0.5 * (M[0, 0] + M[1, 1] + M[2, 2] - 1.0)
        phi *= np.arctan2(sine, cosine) / sine
