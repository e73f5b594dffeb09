"""Steady flight of the receiver: straight or turning, level, climbing or descending, in air that may sink.

The centre of gravity flies at the speed V relative to the undisturbed wind, on a path of slope gamma that turns at the
rate r about the vertical; the air it meets sinks at the speed d. In level axes along the path (x forward, z up)

    v = V (cos gamma, 0, sin gamma),     v_air = v + (0, 0, d),     w = (0, 0, r)                         (1)
    (F + T e_x) / m = g e_z + w x v                                                                       (2)
    M - w_B x (J w_B + h e_x) = 0,     w_B = R_WB' w                                                      (3)
    F_y = 0 in body axes                                                                                  (4)

with the force F and moment M of the air, the thrust T and the rotor's angular momentum h. Eq. (4) makes the turn a
coordinated one. The seven unknowns are the angle of attack, the sideslip, the bank about the flow, three surfaces and
the thrust; straight flight is solved in its plane of symmetry, where the other four vanish.

Turns to the left and climbs are positive. Bank is positive with the left wing up, so that a turn to the left is flown
with a negative one. Source: Stevens, Lewis & Johnson, Aircraft Control and Simulation, section 3.6.
"""

from dataclasses import dataclass

import numpy as np
from scipy.optimize import root

from dockair.errors import DockairError
from dockair.rotations import FLU_FROM_FRD, Array, exp
from dockair.sim.air.atmosphere import STANDARD_GRAVITY_M_S2, Air
from dockair.sim.aircraft.airframe import Aerodynamics, AirframeData
from dockair.sim.aircraft.engine import ThrustRange, rotor_moment, thrust_range

_ALPHA, _BETA, _BANK, _SURFACES, _THRUST = 0, 1, 2, slice(3, 6), 6  # unknowns; angles, and thrust over weight
_SYMMETRIC_UNKNOWNS, _SYMMETRIC_EQUATIONS = [0, 3, 6], [0, 2, 4]
_BALANCED = 1e-9  # of weight, and of weight times chord or span; what is left of the equations at a solution


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Trim:
    """A steady flight. W has the directions of the path's level axes: its heading is zero."""

    airspeed_m_s: float  #: V
    alpha_rad: float
    sideslip_rad: float
    elevator_rad: float
    aileron_rad: float
    rudder_rad: float
    thrust_n: float
    thrust_range: ThrustRange
    aerodynamics: Aerodynamics
    R_WB: Array  #: (3, 3)
    climb_rad: float = 0.0  #: gamma
    turn_rate_rad_s: float = 0.0  #: r
    downwash_m_s: float = 0.0  #: d

    @property
    def surfaces_rad(self) -> Array:
        """(3,) elevator, aileron, rudder [rad]."""
        return np.array([self.elevator_rad, self.aileron_rad, self.rudder_rad])

    @property
    def bank_rad(self) -> float:
        """Angle about the body's x axis against level wings, positive with the left wing up."""
        return float(np.arctan2(self.R_WB[2, 1], self.R_WB[2, 2]))

    @property
    def pitch_rad(self) -> float:
        """Angle of the body's x axis above the horizon, nose up positive."""
        return float(np.arcsin(self.R_WB[2, 0]))

    @property
    def velocity_W(self) -> Array:
        """(3,) v of Eq. (1), relative to the undisturbed wind [m/s]."""
        return self.airspeed_m_s * np.array([np.cos(self.climb_rad), 0.0, np.sin(self.climb_rad)])

    @property
    def air_velocity_W(self) -> Array:
        """(3,) of the sinking air against the undisturbed wind [m/s]."""
        return np.array([0.0, 0.0, -self.downwash_m_s])

    @property
    def w_W(self) -> Array:
        """(3,) angular velocity in the path's level axes [rad/s]."""
        return np.array([0.0, 0.0, self.turn_rate_rad_s])

    @property
    def w_WB_B(self) -> Array:
        """(3,) angular velocity, body axes [rad/s]."""
        return np.asarray(self.R_WB.T @ self.w_W)


def level_trim(parameters: AirframeData, airspeed_m_s: float, air: Air) -> Trim:
    """Straight level flight in still air; see `steady_trim`."""
    return steady_trim(parameters, airspeed_m_s, air)


def steady_trim(
    parameters: AirframeData,
    airspeed_m_s: float,
    air: Air,
    *,
    climb_rad: float = 0.0,
    turn_rate_rad_s: float = 0.0,
    downwash_m_s: float = 0.0,
    pitching_air_rad_s: float = 0.0,
) -> Trim:
    """Solve Eqs. (2) to (4).

    Args:
        parameters: the airframe.
        airspeed_m_s: V.
        air: of the flight's altitude.
        climb_rad: gamma, slope of the path against the undisturbed wind.
        turn_rate_rad_s: r, positive to the left.
        downwash_m_s: d.
        pitching_air_rad_s: turning of the air about the aircraft's y axis (left): a downwash that changes along it.

    Raises:
        DockairError: no such flight at this airspeed and altitude within the airframe's data, the surfaces' limits and
            the thrust range.
    """
    _check_airspeed(airspeed_m_s)
    wanted = _Wanted(parameters, airspeed_m_s, air, climb_rad, turn_rate_rad_s, downwash_m_s)
    wanted.air_rotation_B[1] = pitching_air_rad_s
    x: Array = np.zeros(7)
    x[_ALPHA], x[_BANK], x[_THRUST] = 0.05, -np.arctan(turn_rate_rad_s * airspeed_m_s / STANDARD_GRAVITY_M_S2), 0.1
    straight = turn_rate_rad_s == 0.0
    x = wanted.solve(x, _SYMMETRIC_UNKNOWNS, _SYMMETRIC_EQUATIONS)  # in a turn, where its search starts
    if not straight:
        x = wanted.solve(x, list(range(7)), list(range(7)))
    trim = wanted.trim(x)
    if not (np.max(np.abs(wanted.imbalance(x))) < _BALANCED and _inside(parameters, trim, air)):
        level = straight and climb_rad == 0.0 and downwash_m_s == 0.0
        flight = "level" if level else f"with a slope of {climb_rad:g} rad, turning at {turn_rate_rad_s:g} rad/s,"
        expected = f"an airspeed at which the receiver can fly {flight} in air of {air.density_kg_m3:.3f} kg/m^3"
        raise DockairError("flight.airspeed_m_s", expected=expected, got=airspeed_m_s)
    return trim


def _check_airspeed(airspeed_m_s: float) -> None:
    if not airspeed_m_s > 0.0:
        raise DockairError("flight.airspeed_m_s", expected="an airspeed > 0", got=airspeed_m_s)


def _inside(parameters: AirframeData, trim: Trim, air: Air) -> bool:
    low, high = parameters.angle_of_attack_range_rad
    return bool(
        low < trim.alpha_rad < high
        and np.all(np.abs(trim.surfaces_rad) < parameters.surface_limits_rad)
        and trim.thrust_range.idle_n < trim.thrust_n < trim.thrust_range.military_n
        and trim.airspeed_m_s / air.speed_of_sound_m_s <= parameters.thrust_mach[-1]
    )


class _Wanted:
    """Eqs. (2) to (4) as a function of the seven unknowns."""

    def __init__(self, p: AirframeData, airspeed: float, air: Air, climb: float, turn_rate: float, sink: float) -> None:
        self._p, self._air, self._airspeed = p, air, airspeed
        self._path = (climb, turn_rate, sink)
        self.air_rotation_B = np.zeros(3)
        self._aerodynamics = p.aerodynamics(air.density_kg_m3)
        self._weight, self._inertia = p.mass_kg * STANDARD_GRAVITY_M_S2, p.inertia_B
        self._v = airspeed * np.array([np.cos(climb), 0.0, np.sin(climb)])
        self._v_air, self._w = self._v + [0.0, 0.0, sink], np.array([0.0, 0.0, turn_rate])
        self._needed = np.array([0.0, 0.0, self._weight]) + p.mass_kg * np.cross(self._w, self._v)  # Eq. (2)

    def attitude(self, x: Array) -> Array:
        """(3, 3) R_WB: along the air's flow, banked about it, then turned by the flow's angles."""
        slope = np.arctan2(self._v_air[2], self._v_air[0])
        along = exp(FLU_FROM_FRD @ np.array([0.0, slope, 0.0])) @ exp(np.array([x[_BANK], 0.0, 0.0]))
        body_from_flow = exp(FLU_FROM_FRD @ np.array([0.0, x[_ALPHA], 0.0])).T @ exp(np.array([0.0, 0.0, -x[_BETA]]))
        return np.ascontiguousarray(along @ body_from_flow.T)

    def imbalance(self, x: Array) -> Array:
        """(7,) what is left of the equations, over weight and weight times chord or span."""
        R_WB = self.attitude(x)
        w_B = R_WB.T @ self._w
        force, moment = self._aerodynamics.force_and_moment(
            R_WB.T @ self._v_air, w_B, np.ascontiguousarray(x[_SURFACES]), self.air_rotation_B
        )
        side = force[1]
        force[0] += x[_THRUST] * self._weight
        left = R_WB @ force - self._needed
        moment = moment + rotor_moment(self._p, w_B) - np.cross(w_B, self._inertia @ w_B)  # Eq. (3)
        lengths = np.array([self._p.span_m, self._p.chord_m, self._p.span_m])
        return np.concatenate([left, moment / lengths, [side]]) / self._weight

    def solve(self, x: Array, unknowns: list[int], equations: list[int]) -> Array:
        """(7,) the unknowns, some of them solved for."""

        def some(part: Array) -> Array:
            full = x.copy()
            full[unknowns] = part
            return self.imbalance(full)[equations]

        solved = x.copy()
        solved[unknowns] = root(some, x[unknowns], tol=1e-13).x
        return solved

    def trim(self, x: Array) -> Trim:
        """The flight with these unknowns."""
        climb, turn_rate, sink = self._path
        elevator, aileron, rudder = (float(s) for s in x[_SURFACES])
        return Trim(
            airspeed_m_s=self._airspeed,
            alpha_rad=float(x[_ALPHA]),
            sideslip_rad=float(x[_BETA]),
            elevator_rad=elevator,
            aileron_rad=aileron,
            rudder_rad=rudder,
            thrust_n=float(x[_THRUST] * self._weight),
            thrust_range=thrust_range(self._p, self._airspeed, self._air),
            aerodynamics=self._aerodynamics,
            R_WB=self.attitude(x),
            climb_rad=climb,
            turn_rate_rad_s=turn_rate,
            downwash_m_s=sink,
        )
