"""Receiver's engine: thrust along the body's x axis through the centre of gravity, with limits and a lag.

With p the place of the thrust T in its range, and a rise of more than q slowed down:

    throttle = (T_c - T_idle) / (T_military - T_idle),     p likewise of T                (1)
    dT/dt = (T_c - T) lag(p_c - p),     T_idle <= T_c <= T_military                       (2)
    lag(rise) = 1/tau up to q, 1/tau_slow for the whole range, linear between             (3)
    M = -w x h e_x,     h the rotor's angular momentum                                    (4)

The limits are the tables' at the trim's Mach number and altitude, and stay there: 3 m/s more airspeed
would take away 0.7 % of the thrust at a held throttle.
Not modelled: afterburner, the quicker lag above military power, ram drag's change with gusts.
Source: Stevens, Lewis & Johnson, Aircraft Control and Simulation, section 3.5 and appendix A, whose power is p/2 up to
military power.
"""

from dataclasses import dataclass

import numpy as np

from dockair.rotations import Array
from dockair.sim.air.atmosphere import Air, standard_atmosphere
from dockair.sim.aircraft.airframe import AirframeData


@dataclass(frozen=True, slots=True, kw_only=True)
class ThrustRange:
    """What the engine can give at one flight condition."""

    idle_n: float
    military_n: float

    def throttle(self, thrust_n: float) -> float:
        """Fraction of the range, Eq. (1)."""
        return (thrust_n - self.idle_n) / (self.military_n - self.idle_n)


def engine_lag_1_s(parameters: AirframeData, rise: float) -> float:
    """Rate [1/s] at which thrust closes a gap that is a part of the thrust range, Eq. (3); falls are quick."""
    quick, slow = 1.0 / parameters.engine_time_constant_s, 1.0 / parameters.engine_slow_time_constant_s
    part = (rise - parameters.engine_quick_rise) / (1.0 - parameters.engine_quick_rise)
    return quick + (slow - quick) * min(max(part, 0.0), 1.0)


def rotor_moment(parameters: AirframeData, w_B: Array) -> Array:
    """(3,) moment of the turning rotor on the aircraft, Eq. (4), body axes [N m]."""
    h = parameters.rotor_momentum_kg_m2_s
    return np.array([0.0, -h * w_B[2], h * w_B[1]])


def thrust_range(parameters: AirframeData, airspeed_m_s: float, air: Air) -> ThrustRange:
    """Thrust range at an airspeed [m/s]; between the tables' altitudes it goes with the standard pressure, linearly."""
    mach = airspeed_m_s / air.speed_of_sound_m_s
    pressures = [standard_atmosphere(altitude).pressure_pa for altitude in parameters.thrust_altitude_m]
    altitude = float(np.interp(-air.pressure_pa, -np.array(pressures), parameters.thrust_altitude_m))
    tables = (parameters.idle_thrust_n, parameters.military_thrust_n)
    idle, military = (_interpolate(parameters, table, mach, altitude) for table in tables)
    return ThrustRange(idle_n=idle, military_n=military)


def _interpolate(parameters: AirframeData, table: Array, mach: float, altitude: float) -> float:
    over_altitude = [np.interp(altitude, parameters.thrust_altitude_m, row) for row in table]
    return float(np.interp(mach, parameters.thrust_mach, over_altitude))
