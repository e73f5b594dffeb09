"""The receiver: trim, airframe, engine, actuators and its own flight control, as force and moment on a rigid body.

The caller integrates the body (and applies gravity); this adds what air and engine do, one tick at a time. The world W
moves with the trim velocity (V, 0, 0), so the velocity over the ground is v_WB + (V, 0, 0); the flight control gets it
with the drift of an inertial navigation and gets no position, and everything through its `own_sensors`.
"""

import numpy as np

from dockair.messages import ReceiverCommand
from dockair.rotations import Array
from dockair.sim.air.atmosphere import Air
from dockair.sim.aircraft.actuators import Actuators
from dockair.sim.aircraft.aerodynamics import flow_angles
from dockair.sim.aircraft.airframe import NO_ROTATION, AirframeData
from dockair.sim.aircraft.engine import rotor_moment
from dockair.sim.aircraft.flight_control import FlightControl, FlightControlParameters
from dockair.sim.aircraft.inertial_velocity import InertialVelocity
from dockair.sim.aircraft.own_sensors import OwnSensors
from dockair.sim.aircraft.trim import level_trim


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
            flight_control.inertial_velocity_sigma_m_s, flight_control.inertial_velocity_time_s, step_s, rng
        )
        self.own_sensors = OwnSensors(flight_control.own_sensors, step_s, rng.spawn(1)[0])
        self._airframe = airframe
        self._trim_velocity_W = np.array([airspeed_m_s, 0.0, 0.0])
        self.airspeed_m_s = airspeed_m_s
        self.angle_of_attack_rad = self.trim.alpha_rad
        self.sideslip_rad = 0.0

    @property
    def throttle(self) -> float:
        """Commanded fraction of the thrust range."""
        return self.actuators.throttle

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
    ) -> tuple[Array, Array]:
        """Force [N] and torque [N m] of air and engine about the centre of gravity, (3,) each, W axes, without gravity.

        Args:
            R_WB: (3, 3) attitude.
            v_WB: (3,) velocity in W [m/s].
            w_WB_B: (3,) angular velocity [rad/s].
            air_velocity_W: (3,) velocity of the air in W, gust included; still air is (-V, 0, 0) [m/s].
            specific_force_B: (3,) acceleration of the centre of gravity less gravity, body axes [m/s^2].
            command: increment on the path, and what the path does.
            air_rotation_B: (3,) angular velocity of the air about the aircraft [rad/s].
        """
        v_air_B = R_WB.T @ (v_WB - air_velocity_W)
        self.airspeed_m_s, self.angle_of_attack_rad, self.sideslip_rad = flow_angles(v_air_B)
        actuators = self.actuators
        R_measured, w_measured, f_measured, velocity_measured, airspeed_measured = self.own_sensors.step(
            R_WB,
            w_WB_B,
            specific_force_B,
            self.inertial_velocity.step(v_WB + self._trim_velocity_W),
            self.airspeed_m_s,
        )
        surfaces_rad, thrust_n = self.flight_control.step(
            R_WB=R_measured,
            w_WB_B=w_measured,
            velocity_W=velocity_measured,
            airspeed_m_s=airspeed_measured,
            specific_force_B=f_measured,
            surfaces_rad=actuators.surfaces_rad,
            thrust_n=actuators.thrust_n,
            command=command,
        )
        actuators.step(surfaces_rad, thrust_n)
        force_B, torque_B = self.trim.aerodynamics.force_and_moment(
            v_air_B, w_WB_B, actuators.surfaces_rad, air_rotation_B
        )
        force_B[0] += actuators.thrust_n
        return R_WB @ force_B, R_WB @ (torque_B + rotor_moment(self._airframe, w_WB_B))
