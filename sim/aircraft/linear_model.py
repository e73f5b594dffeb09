"""Receiver's equations of motion about trim and their Jacobians: what the flight control is designed on.

    state x (13):  v_W velocity beyond trim, W axes; phi, R_WB = exp(phi) R_trim; w_WB_B; surfaces beyond trim;
                   thrust beyond trim per mass
    input u (4):   commanded surfaces and thrust per mass, beyond trim;   gust g (3) in W axes

    m dv/dt = R_WB (F + T e_x) + m g_W,     dphi/dt = R_trim w  (at phi = 0),     J dw/dt = M - w x J w     (1)
    d(surface)/dt = a (u - surface),        dT/dt = (u - T) / tau                                           (2)

Valid for derivatives at x = 0; phi's kinematics are those of small angles. Limits of position and rate are left out.
"""

from dataclasses import dataclass

import numpy as np

from dockair.rotations import Array, exp
from dockair.sim.air.atmosphere import STANDARD_GRAVITY_M_S2
from dockair.sim.aircraft.aerodynamics import AirframeParameters
from dockair.sim.aircraft.trim import Trim

STATES, INPUTS = 13, 4
VELOCITY, ATTITUDE, RATE, SURFACES, THRUST = slice(0, 3), slice(3, 6), slice(6, 9), slice(9, 12), 12

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


def state_derivative(airframe: AirframeParameters, trim: Trim, x: Array, u: Array, gust_W: Array) -> Array:
    """(13,) dx/dt of Eqs. (1) and (2)."""
    R_WB = exp(x[ATTITUDE]) @ trim.R_WB
    specific_force, moment = _specific_force_and_moment(airframe, trim, x, R_WB, gust_W)
    w = x[RATE]
    inertia = airframe.inertia_B
    x_dot = np.empty(STATES)
    x_dot[VELOCITY] = R_WB @ specific_force - np.array([0.0, 0.0, STANDARD_GRAVITY_M_S2])
    x_dot[ATTITUDE] = trim.R_WB @ w
    x_dot[RATE] = np.linalg.solve(inertia, moment - np.cross(w, inertia @ w))
    x_dot[SURFACES] = airframe.actuator_bandwidth_rad_s * (u[:3] - x[SURFACES])
    x_dot[THRUST] = (u[3] - x[THRUST]) / airframe.engine_time_constant_s
    return x_dot


def _specific_force_and_moment(
    airframe: AirframeParameters, trim: Trim, x: Array, R_WB: Array, gust_W: Array
) -> tuple[Array, Array]:
    v_W = np.array([trim.airspeed_m_s, 0.0, 0.0]) + x[VELOCITY] - gust_W
    surfaces = trim.surfaces_rad + x[SURFACES]
    force, moment = trim.aerodynamics.force_and_moment(R_WB.T @ v_W, x[RATE], surfaces)
    specific_force = force / airframe.mass_kg
    specific_force[0] += trim.thrust_n / airframe.mass_kg + x[THRUST]
    return specific_force, moment


def linear_model(airframe: AirframeParameters, trim: Trim) -> LinearModel:
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
