"""Receiver's engine: thrust along the body's x axis through the centre of gravity, with limits and a first-order lag.

    dT/dt = (T_c - T) / tau,     T_idle <= T_c <= T_military                              (1)
    throttle = (T_c - T_idle) / (T_military - T_idle)                                     (2)

The limits are the tables' at the trim's Mach number and altitude, and stay there: the few m/s of a docking change them
by less than 1 %. The lag is the one below half power and for small changes.
Not modelled: afterburner, slower spooling for large changes, the rotor's angular momentum (217 kg m^2/s, whose moment
at docking rates is some 20 N m), ram drag's change with gusts.
Source: Stevens, Lewis & Johnson, Aircraft Control and Simulation, section 3.5 and appendix A.
"""

from dataclasses import dataclass

import numpy as np

from dockair.rotations import Array
from dockair.sim.air.atmosphere import Air, standard_atmosphere
from dockair.sim.aircraft.aerodynamics import AirframeParameters


@dataclass(frozen=True, slots=True, kw_only=True)
class ThrustRange:
    """What the engine can give at one flight condition."""

    idle_n: float
    military_n: float

    def throttle(self, thrust_n: float) -> float:
        """Fraction of the range, Eq. (2)."""
        return (thrust_n - self.idle_n) / (self.military_n - self.idle_n)


def thrust_range(parameters: AirframeParameters, airspeed_m_s: float, air: Air) -> ThrustRange:
    """Thrust range at an airspeed [m/s]; the altitude is the one where the standard pressure is that of `air`."""
    mach = airspeed_m_s / air.speed_of_sound_m_s
    pressures = [standard_atmosphere(altitude).pressure_pa for altitude in parameters.thrust_altitude_m]
    altitude = float(np.interp(-air.pressure_pa, -np.array(pressures), parameters.thrust_altitude_m))
    tables = (parameters.idle_thrust_n, parameters.military_thrust_n)
    idle, military = (_interpolate(parameters, table, mach, altitude) for table in tables)
    return ThrustRange(idle_n=idle, military_n=military)


def _interpolate(parameters: AirframeParameters, table: Array, mach: float, altitude: float) -> float:
    over_altitude = [np.interp(altitude, parameters.thrust_altitude_m, row) for row in table]
    return float(np.interp(mach, parameters.thrust_mach, over_altitude))
