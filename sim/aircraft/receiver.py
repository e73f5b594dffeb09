"""The receiver: trim, airframe, engine, actuators and its own flight control, as force and moment on a rigid body.

The caller integrates the body (and applies gravity); this adds what air and engine do, one tick at a time. The world W
moves with the trim velocity (V, 0, 0), so the velocity over the ground is v_WB + (V, 0, 0); the flight control gets it
with the drift of an inertial navigation and gets no position, and everything through its `own_sensors`.
"""

import numpy as np

from dockair.kernels import njit
from dockair.messages import ReceiverCommand
from dockair.rotations import Array
from dockair.sim.air.atmosphere import Air
from dockair.sim.aircraft.actuators import Actuators
from dockair.sim.aircraft.aerodynamics import flow_about
from dockair.sim.aircraft.airframe import NO_ROTATION, AirframeData
from dockair.sim.aircraft.flight_control import FlightControl, FlightControlParameters
from dockair.sim.aircraft.inertial_velocity import InertialVelocity
from dockair.sim.aircraft.own_sensors import OwnSensors
from dockair.sim.aircraft.trim import level_trim, steady_trim


class Receiver:
    """Force and moment of the receiver's air and engine.

    Args:
        airframe: an airframe's sheet.
        flight_control: sheet `flight_control`.
        probe_B: (3,) the probe's tip from the centre of gravity, body axes [m].
        airspeed_m_s: trim airspeed V.
        air: of the flight's altitude.
        step_s: length of a tick [s].
        rng: the stream "inertial_velocity"; the other sensors' noise is a stream of its own, spawned from it.

    Raises:
        DockairError: no level flight at this airspeed and altitude.
    """

    def __init__(
        self,
        *,
        airframe: AirframeData,
        flight_control: FlightControlParameters,
        probe_B: Array,
        airspeed_m_s: float,
        air: Air,
        step_s: float,
        rng: np.random.Generator,
    ) -> None:
        self.trim = level_trim(airframe, airspeed_m_s, air)
        self.mass_kg = airframe.mass_kg
        self.inertia_B = airframe.inertia_B  #: (3, 3) [kg m^2]
        self.trim_R_WB = self.trim.R_WB  #: (3, 3) nose up by the trim's angle of attack
        self.flight_control = FlightControl(
            flight_control, airframe, trim=self.trim, air=air, probe_B=probe_B, step_s=step_s
        )
        self.actuators = Actuators(airframe, self.trim, step_s)
        self.inertial_velocity = InertialVelocity(
            flight_control.inertial_velocity_sigma_m_s,
            flight_control.inertial_velocity_time_s,
            step_s,
            rng,
            frame_velocity_m_s=np.array([airspeed_m_s, 0.0, 0.0]),
        )
        self.own_sensors = OwnSensors(flight_control.own_sensors, step_s, rng.spawn(1)[0])
        self._airframe, self._air, self._step_s = airframe, air, step_s
        self._rotor_momentum = airframe.rotor_momentum_kg_m2_s
        self._motion, self._wrench_B, self._wrench_W = np.empty((1, 12)), np.empty((1, 6)), np.empty((2, 3))
        self.airspeed_m_s = airspeed_m_s
        self.angle_of_attack_rad = self.trim.alpha_rad
        self.sideslip_rad = 0.0
        self.throttle = self.actuators.throttle  #: commanded fraction of the thrust range

    def trim_in(self, downwash_m_s: float, pitching_air_rad_s: float) -> None:
        """Begin anew, trimmed in air that sinks and turns about the left axis; the flight control is that of still air.

        Raises:
            DockairError: no such flight.
        """
        self.trim = steady_trim(
            self._airframe,
            self.trim.airspeed_m_s,
            self._air,
            downwash_m_s=downwash_m_s,
            pitching_air_rad_s=pitching_air_rad_s,
        )
        self.trim_R_WB, self.angle_of_attack_rad = self.trim.R_WB, self.trim.alpha_rad
        self.actuators = Actuators(self._airframe, self.trim, self._step_s)
        self.throttle = self.actuators.throttle
        self.flight_control.start_in(self.trim)

    def step(
        self,
        *,
        R_WB: Array,
        v_WB: Array,
        w_WB_B: Array,
        air_velocity_W: Array,
        specific_force_B: Array,
        command: ReceiverCommand,
        air_rotation_B: Array = NO_ROTATION,
    ) -> Array:
        """(2, 3) force [N] and torque [N m] of air and engine about the centre of gravity, W axes, without gravity.

        The array is overwritten by the next step.

        Args:
            R_WB: (3, 3) attitude.
            v_WB: (3,) velocity in W [m/s].
            w_WB_B: (3,) angular velocity [rad/s].
            air_velocity_W: (3,) velocity of the air in W, gust included; still air is (-V, 0, 0) [m/s].
            specific_force_B: (3,) acceleration of the centre of gravity less gravity, body axes [m/s^2].
            command: increment on the path, and what the path does.
            air_rotation_B: (3,) angular velocity of the air about the aircraft [rad/s].
        """
        actuators, motion, wrench_B = self.actuators, self._motion, self._wrench_B
        flow = flow_about(R_WB, v_WB, w_WB_B, air_velocity_W, air_rotation_B, motion)
        self.airspeed_m_s, self.angle_of_attack_rad, self.sideslip_rad = flow
        velocity_W = self.inertial_velocity.step(v_WB)
        R, w, f, v, airspeed = self.own_sensors.step(R_WB, w_WB_B, specific_force_B, velocity_W, flow[0])
        surfaces_rad, thrust_n = self.flight_control.step(
            R_WB=R,
            w_WB_B=w,
            velocity_W=v,
            airspeed_m_s=airspeed,
            specific_force_B=f,
            surfaces_rad=actuators.surfaces_rad,
            thrust_n=actuators.thrust_n,
            command=command,
        )
        actuators.step(surfaces_rad, thrust_n)
        self.throttle = actuators.throttle
        motion[0, 6:9] = actuators.surfaces_rad
        self.trim.aerodynamics.write_wrenches(motion, wrench_B)
        _with_engine(R_WB, w_WB_B, wrench_B, actuators.thrust_n, self._rotor_momentum, self._wrench_W)
        return self._wrench_W


@njit(cache=True)
def _with_engine(R_WB, w_B, wrench_B, thrust, momentum, wrench_W):  # type: ignore[no-untyped-def]
    """Write force and torque along the axes of W, thrust and the rotor's moment (Eq. (4) of `engine`) included."""
    force, torque = wrench_B[0, :3], wrench_B[0, 3:]
    force_x = force[0] + thrust
    torque_y, torque_z = torque[1] - momentum * w_B[2], torque[2] + momentum * w_B[1]
    for i in range(3):
        wrench_W[0, i] = R_WB[i, 0] * force_x + R_WB[i, 1] * force[1] + R_WB[i, 2] * force[2]
        wrench_W[1, i] = R_WB[i, 0] * torque[0] + R_WB[i, 1] * torque_y + R_WB[i, 2] * torque_z
