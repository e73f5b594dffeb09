"""Level flight of the receiver: angle of attack, elevator and thrust that balance weight and pitching moment.

With the pitch attitude equal to the angle of attack, and X, Z, M of the tables (forward-right-down):

    X + T = m g sin(alpha),     Z + m g cos(alpha) = 0,     M = 0                          (1)

Source: Stevens, Lewis & Johnson, Aircraft Control and Simulation, section 3.6.
"""

from dataclasses import dataclass

import numpy as np
from scipy.optimize import root

from dockair.errors import DockairError
from dockair.rotations import FLU_FROM_FRD, Array, exp
from dockair.sim.air.atmosphere import STANDARD_GRAVITY_M_S2, Air
from dockair.sim.aircraft.aerodynamics import AirframeParameters, LinearAerodynamics, linearise, static_coefficients
from dockair.sim.aircraft.engine import ThrustRange, thrust_range


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Trim:
    """Straight level flight in still air."""

    airspeed_m_s: float
    alpha_rad: float
    elevator_rad: float
    thrust_n: float
    thrust_range: ThrustRange
    aerodynamics: LinearAerodynamics  #: about this point
    R_WB: Array  #: (3, 3) nose up by alpha

    @property
    def surfaces_rad(self) -> Array:
        """(3,) elevator, aileron, rudder [rad]."""
        return np.array([self.elevator_rad, 0.0, 0.0])


def level_trim(parameters: AirframeParameters, airspeed_m_s: float, air: Air) -> Trim:
    """Solve Eq. (1).

    Raises:
        DockairError: no level flight at this airspeed and altitude within the tables, the elevator's limits and the
            thrust range.
    """
    qbar_S = 0.5 * air.density_kg_m3 * airspeed_m_s**2 * parameters.wing_area_m2
    weight = parameters.mass_kg * STANDARD_GRAVITY_M_S2
    if not qbar_S > 0.0:
        raise DockairError("airspeed_m_s", expected="an airspeed > 0", got=airspeed_m_s)
    table = parameters.angle_of_attack_rad
    lift_slope = float(parameters.normal_force[0] - parameters.normal_force[-1]) / float(table[-1] - table[0])
    guess = np.array([weight / (qbar_S * lift_slope), 0.0])

    def imbalance(x: Array) -> Array:
        C = static_coefficients(parameters, float(x[0]), float(x[1]))
        return np.array([qbar_S * C[2] / weight + np.cos(x[0]), C[4]])

    solution = root(imbalance, guess, tol=1e-13)
    alpha, elevator = (float(x) for x in solution.x)
    thrust = weight * np.sin(alpha) - qbar_S * static_coefficients(parameters, alpha, elevator)[0]
    available = thrust_range(parameters, airspeed_m_s, air)
    inside = (
        np.max(np.abs(imbalance(solution.x))) < 1e-9
        and table[0] < alpha < table[-1]
        and abs(elevator) < parameters.surface_limits_rad[0]
        and available.idle_n < thrust < available.military_n
        and airspeed_m_s / air.speed_of_sound_m_s <= parameters.thrust_mach[-1]
    )
    if not inside:
        raise DockairError(
            "airspeed_m_s",
            expected=f"an airspeed at which the receiver can fly level in air of {air.density_kg_m3:.3f} kg/m^3",
            got=airspeed_m_s,
        )
    return Trim(
        airspeed_m_s=airspeed_m_s,
        alpha_rad=alpha,
        elevator_rad=elevator,
        thrust_n=float(thrust),
        thrust_range=available,
        aerodynamics=linearise(parameters, alpha, elevator, air.density_kg_m3),
        R_WB=exp(FLU_FROM_FRD @ np.array([0.0, alpha, 0.0])),
    )
