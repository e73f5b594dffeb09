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
from numpy.typing import NDArray

from dockair.messages import ReceiverCommand
from dockair.rotations import Array
from dockair.sim.air.atmosphere import STANDARD_GRAVITY_M_S2, Air
from dockair.sim.aircraft.airframe import AirframeData
from dockair.sim.aircraft.control_law import TRIM, rotation_rows, write_commands, write_state, write_states
from dockair.sim.aircraft.flight_control_parameters import FlightControlParameters
from dockair.sim.aircraft.flight_path import FlightPath
from dockair.sim.aircraft.gain_schedule import RATE_0, SURFACES_0, THRUST_0, Design, GainSchedule
from dockair.sim.aircraft.linear_model import STATES, SURFACES, THRUST
from dockair.sim.aircraft.model_flight import ModelFlight
from dockair.sim.aircraft.rate_relief import RateRelief
from dockair.sim.aircraft.reference import Reference
from dockair.sim.aircraft.regulator import FOLLOWED
from dockair.sim.aircraft.trim import Trim

__all__ = ["FlightControl", "FlightControlParameters"]

_MEMORY = np.dtype(
    [
        ("step_s", float),
        ("airspeed_m_s", float),
        ("mass_kg", float),
        ("gust_share", float),  # of g's low pass in a tick
        ("lag_share", float),  # of the sensors' lag in a tick
        ("lag_s", float),
        ("probe_B", float, 3),
        ("limits", float, (2, 4)),  # lowest and highest command: surfaces, thrust per mass
        ("x_m", float, FOLLOWED),
        ("z", float, 3),
        ("gust", float, 3),
        ("force_B", float, 3),  # specific force of the air on the aircraft, were it still, as late as measured
        ("w_m", float, 3),  # the model's rates, as late as measured
        ("R_now", float, (3, 3)),  # of one step from here on: attitude of now,
        ("R_FB", float, (3, 3)),  # against the path
        ("trim", float, TRIM),
        ("x", float, STATES),
        ("commands_m", float, 4),  # to the model
    ]
)


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
        limits_rad, thrust = np.asarray(airframe.surface_limits_rad), trim.thrust_range
        self._memory: NDArray[np.void] = np.zeros((), _MEMORY)
        m = self._memory
        m["step_s"], m["airspeed_m_s"], m["mass_kg"], m["probe_B"] = step_s, trim.airspeed_m_s, self._mass_kg, probe_B
        m["gust_share"], m["lag_s"] = gust_share, lag_s
        m["lag_share"] = -float(np.expm1(-step_s / lag_s)) if lag_s else 1.0
        m["limits"][0] = np.append(-limits_rad, thrust.idle_n / self._mass_kg)
        m["limits"][1] = np.append(limits_rad, thrust.military_n / self._mass_kg)
        rates_rad_s = np.asarray(airframe.surface_rate_limits_rad_s)
        self._relief = RateRelief(parameters.relief, airframe.actuator_bandwidth_rad_s, rates_rad_s, limits_rad, step_s)
        self.model = ModelFlight(airframe, step_s)
        # of one step: commands to the surfaces; motions of aircraft and model in still air, and what it does to them
        self._surfaces, self._motions, self._wrenches = np.empty(3), np.zeros((2, 12)), np.empty((2, 6))
        self._engaged = False

    @property
    def gust_W(self) -> Array:
        """(3,) the gust it believes in [m/s]."""
        return np.asarray(self.path.axes() @ self._memory["gust"])

    def start_in(self, trim: Trim) -> None:
        """Set z to what holds another trim of the same path: with the gust that it then believes in, Eq. (2) is it."""
        row, m, v_B = self.schedule.at(0.0), self._memory, np.empty(3)
        attitude, at = (np.eye(3), trim.R_WB, trim.velocity_W), (trim.w_WB_B, trim.surfaces_rad)
        write_state(*attitude, *at, trim.thrust_n / self._mass_kg, 0.0, row.memory, m, v_B)
        force_B, _ = self._aerodynamics.force_and_moment(v_B, *at)
        residual = trim.R_WB[2] * STANDARD_GRAVITY_M_S2 - force_B / self._mass_kg
        residual[0] = np.linalg.norm(v_B) - np.linalg.norm(trim.velocity_W - trim.air_velocity_W)
        x: Array = m["x"]
        known = np.concatenate([x, np.zeros(3), row.gust_from_residual @ residual])
        missing = np.append(x[SURFACES], x[THRUST]) + row.K @ known
        weights = np.append(m["limits"][1, :3], STANDARD_GRAVITY_M_S2)  # radians and m/s^2, made comparable
        K_z = row.K[:, STATES : STATES + 3]
        m["z"] = -np.linalg.lstsq(K_z / weights[:, np.newaxis], missing / weights, rcond=None)[0]

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
        path = self.path
        path.step(command.turn_rate_rad_s, command.climb_rad)
        row = self.schedule.nearest(path.turn_rate_rad_s).memory
        own, model, motions, wrenches = self._memory, self.model.memory, self._motions, self._wrenches
        flown = (
            R_WB, velocity_W, w_WB_B, surfaces_rad, thrust_n, path.climb_rad, path.axes(), row, model, own, motions
        )  # fmt: skip
        if not self._engaged:
            write_states(*flown)
            self._start(command)
        write_states(*flown)
        self._aerodynamics.write_wrenches(motions, wrenches)
        thrust_command_n = write_commands(
            specific_force_B, airspeed_m_s, command.velocity_m_s, command.acceleration_m_s2, self._engaged,
            motions, wrenches, self._surfaces, row, own, self.reference.memory, self._relief.memory, model
        )  # fmt: skip
        self._engaged = True
        return self._surfaces, thrust_command_n

    def _start(self, command: ReceiverCommand) -> None:
        """Let model and reference begin in the trim of now, with the aircraft's velocity beyond it."""
        m = self._memory
        R_FB, trim, x, ahead = m["R_FB"], m["trim"], m["x"], np.array([m["airspeed_m_s"], 0.0, 0.0])
        R_WF, R_FM = self.path.axes(), np.array(rotation_rows(trim)).reshape(3, 3)
        self.model.start(R_WF @ R_FM, R_WF @ (x[:3] + ahead), trim[RATE_0], trim[SURFACES_0.start : THRUST_0 + 1])
        self.reference.start(x[:3], R_FB, command)
