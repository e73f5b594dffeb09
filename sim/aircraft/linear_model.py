"""Receiver's equations of motion about a steady flight and their Jacobians: what the flight control is designed on.

    state x (13):  v velocity beyond trim, in level axes that turn with the path (W in straight flight); phi,
                   R = exp(phi) R_trim in the same axes; w_WB_B beyond trim; surfaces beyond trim; thrust beyond trim
                   per mass
    input u (4):   commanded surfaces and thrust per mass, beyond trim;   gust g (3) in the axes of v

    m dv/dt = R (F + T e_x) + m g - m w_0 x v_total,     dphi/dt = R w - w_0  (at phi = 0)                   (1)
    J dw/dt = M + M_rotor - w x J w,     d(surface)/dt = a (u - surface),     dT/dt = (u - T) / tau          (2)

w_0 is the turn of the path. Valid for derivatives at x = 0; phi's kinematics are those of small angles. Limits of
position and rate and the slow part of the engine's lag are left out.
"""

from dataclasses import dataclass

import numpy as np

from dockair.rotations import Array, exp
from dockair.sim.air.atmosphere import STANDARD_GRAVITY_M_S2
from dockair.sim.aircraft.airframe import AirframeData
from dockair.sim.aircraft.engine import rotor_moment
from dockair.sim.aircraft.trim import Trim

STATES, INPUTS = 13, 4
VELOCITY, ATTITUDE, RATE, SURFACES, THRUST = slice(0, 3), slice(3, 6), slice(6, 9), slice(9, 12), 12

_LONGITUDINAL, _LATERAL = [0, 2, 4, 7], [1, 3, 5, 6, 8]  # states of the plane of symmetry; across it
_STEPS = np.array([1e-2] * 3 + [1e-4] * 3 + [1e-3] * 3 + [1e-3] * 3 + [1e-2])  # differences well above rounding
_GUST_STEP = 1e-2


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class LinearModel:
    """dx/dt = A x + B u + B_gust g,    specific force beyond trim f_B = F x + F_gust g."""

    A: Array  #: (13, 13)
    B: Array  #: (13, 4)
    B_gust: Array  #: (13, 3)
    F: Array  #: (3, 13)
    F_gust: Array  #: (3, 3)

    @property
    def longitudinal_roots(self) -> Array:
        """(4,) complex, quickest first [1/s]: short period and phugoid of straight flight, surfaces and thrust held."""
        return _roots(self.A, _LONGITUDINAL)

    @property
    def lateral_roots(self) -> Array:
        """(4,) complex, quickest first [1/s]: roll, Dutch roll and spiral; the heading's root of zero is left out."""
        return _roots(self.A, _LATERAL)[:4]


def _roots(A: Array, states: list[int]) -> Array:
    roots = np.linalg.eigvals(A[np.ix_(states, states)])
    return np.asarray(roots[np.argsort(-np.abs(roots), kind="stable")])


def state_derivative(airframe: AirframeData, trim: Trim, x: Array, u: Array, gust_W: Array) -> Array:
    """(13,) dx/dt of Eqs. (1) and (2)."""
    R_WB = exp(x[ATTITUDE]) @ trim.R_WB
    specific_force, moment = _specific_force_and_moment(airframe, trim, x, R_WB, gust_W)
    w = trim.w_WB_B + x[RATE]
    inertia = airframe.inertia_B
    x_dot = np.empty(STATES)
    turning = np.cross(trim.w_W, trim.velocity_W + x[VELOCITY])
    x_dot[VELOCITY] = R_WB @ specific_force - np.array([0.0, 0.0, STANDARD_GRAVITY_M_S2]) - turning
    x_dot[ATTITUDE] = R_WB @ w - trim.w_W
    x_dot[RATE] = np.linalg.solve(inertia, moment + rotor_moment(airframe, w) - np.cross(w, inertia @ w))
    x_dot[SURFACES] = airframe.actuator_bandwidth_rad_s * (u[:3] - x[SURFACES])
    x_dot[THRUST] = (u[3] - x[THRUST]) / airframe.engine_time_constant_s
    return x_dot


def _specific_force_and_moment(
    airframe: AirframeData, trim: Trim, x: Array, R_WB: Array, gust_W: Array
) -> tuple[Array, Array]:
    v_W = trim.velocity_W - trim.air_velocity_W + x[VELOCITY] - gust_W
    surfaces = trim.surfaces_rad + x[SURFACES]
    force, moment = trim.aerodynamics.force_and_moment(R_WB.T @ v_W, trim.w_WB_B + x[RATE], surfaces)
    specific_force = force / airframe.mass_kg
    specific_force[0] += trim.thrust_n / airframe.mass_kg + x[THRUST]
    return specific_force, moment


def linear_model(airframe: AirframeData, trim: Trim) -> LinearModel:
    """Jacobians of Eqs. (1) and (2) at trim, by central differences."""

    def derivative_and_force(x: Array, gust_W: Array) -> Array:
        x_dot = state_derivative(airframe, trim, x, np.zeros(INPUTS), gust_W)
        R_WB = exp(x[ATTITUDE]) @ trim.R_WB
        return np.concatenate([x_dot, _specific_force_and_moment(airframe, trim, x, R_WB, gust_W)[0]])

    of_state = np.empty((STATES + 3, STATES))
    for j, step in enumerate(_STEPS):
        shift = np.eye(STATES)[j] * step
        plus, minus = derivative_and_force(shift, np.zeros(3)), derivative_and_force(-shift, np.zeros(3))
        of_state[:, j] = (plus - minus) / (2.0 * step)
    of_gust = np.empty((STATES + 3, 3))
    for j in range(3):
        shift = np.eye(3)[j] * _GUST_STEP
        plus, minus = derivative_and_force(np.zeros(STATES), shift), derivative_and_force(np.zeros(STATES), -shift)
        of_gust[:, j] = (plus - minus) / (2.0 * _GUST_STEP)
    B = np.zeros((STATES, INPUTS))
    B[SURFACES, :3] = airframe.actuator_bandwidth_rad_s * np.eye(3)
    B[THRUST, 3] = 1.0 / airframe.engine_time_constant_s
    return LinearModel(A=of_state[:STATES], B=B, B_gust=of_gust[:STATES], F=of_state[STATES:], F_gust=of_gust[STATES:])
