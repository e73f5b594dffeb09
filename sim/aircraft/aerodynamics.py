"""Receiver's aerodynamic force and moment from the tables of an F-16-class airframe.

With the air-relative velocity (U, V, W) of the centre of gravity and the rates (P, Q, R) beyond those of the air,
forward-right-down, aileron a and rudder r in radians, da = a/20 deg, dr = r/30 deg, e elevator:

    Va^2 = U^2 + V^2 + W^2,   alpha = atan(W / U),   beta = asin(V / Va),   qbar = rho Va^2 / 2          (1)
    CX = CX(alpha, e)                                          + CXq Q c/2Va                             (2)
    CY = CYb beta + CYail a + CYrud r                          + (CYr R + CYp P) b/2Va                   (3)
    CZ = CZ(alpha) (1 - beta^2) + CZe e                        + CZq Q c/2Va                             (4)
    Cl = Cl(alpha, beta) + Clda(alpha, beta) da + Cldr(alpha, beta) dr + (Clr R + Clp P) b/2Va           (5)
    Cm = Cm(alpha, e) + CZ (x_r - x_cg)                        + Cmq Q c/2Va                             (6)
    Cn = Cn(alpha, beta) + Cnda(alpha, beta) da + Cndr(alpha, beta) dr - CY (x_r - x_cg) c/b
         + (Cnr R + Cnp P) b/2Va                                                                         (7)
    force = qbar S (CX, CY, CZ),     moment = qbar S (b Cl, c Cm, b Cn)                                  (8)

Tables are linear between their nodes in each argument, the damping derivatives in alpha. Beyond -10 to 45 degrees of
alpha and 30 degrees of beta they hold their last value; the last cell of the elevator, which ends at 24 degrees, is
carried on to its stop at 25. Cl and Cn are odd in beta.

Surfaces are (elevator, aileron, rudder), positive with the trailing edge down or left: nose down, roll to the left,
nose left. The tables are forward-right-down; the kernel turns its inputs and outputs with `FLU_FROM_FRD`, here and
nowhere else, so that everything outside is forward-left-up.

Valid at low Mach numbers (the wind tunnel's were below 0.6) and for slow changes of the flow.
Not modelled: Mach effects, leading-edge flaps, speed brake, unsteady lift, ground effect.
Source: Stevens, Lewis & Johnson, Aircraft Control and Simulation, section 3.5 and appendix A (NASA TP-1538).
"""

from dataclasses import dataclass

import numpy as np

from dockair.errors import DockairError
from dockair.kernels import njit
from dockair.rotations import FLU_FROM_FRD, Array
from dockair.sim.aircraft.airframe import NO_ROTATION, AirframeData

_FLIP = np.diag(FLU_FROM_FRD).copy()  # a frozen global of the kernel

# First rows of the tables in `_stack`; columns are angles of attack.
_CX, _CM, _CZ, _CL, _CN, _CL_AILERON, _CL_RUDDER, _CN_AILERON, _CN_RUDDER, _DAMPING = (
    0,
    5,
    10,
    11,
    18,
    25,
    32,
    39,
    46,
    53,
)
_COLUMNS, _ELEVATORS, _SIDESLIPS = 12, 5, 7


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class AirframeParameters(AirframeData):
    """Sheet `airframe`: what the tables are and how they are laid out is said there."""

    centre_of_gravity: float
    reference_centre: float
    angle_of_attack_rad: Array  #: (12,)
    elevator_rad: Array  #: (5,)
    sideslip_rad: Array  #: (7,) from 0 on
    surface_sideslip_rad: Array  #: (7,) either way
    axial_force: Array  #: (5, 12)
    normal_force: Array  #: (12,)
    normal_force_elevator_1_rad: float
    pitching_moment: Array  #: (5, 12)
    rolling_moment: Array  #: (7, 12)
    yawing_moment: Array  #: (7, 12)
    side_force_1_rad: Array  #: (3,) sideslip, aileron, rudder
    aileron_reference_rad: float
    rudder_reference_rad: float
    rolling_moment_aileron: Array  #: (7, 12)
    rolling_moment_rudder: Array  #: (7, 12)
    yawing_moment_aileron: Array  #: (7, 12)
    yawing_moment_rudder: Array  #: (7, 12)
    damping: Array  #: (9, 12) CXq, CYr, CYp, CZq, Clr, Clp, Cmq, Cnr, Cnp

    @property
    def angle_of_attack_range_rad(self) -> tuple[float, float]:
        """Ends of the tables."""
        return float(self.angle_of_attack_rad[0]), float(self.angle_of_attack_rad[-1])

    def aerodynamics(self, density_kg_m3: float) -> "TabulatedAerodynamics":
        """Return Eqs. (2) to (8) in air of a density."""
        constants = [density_kg_m3, self.wing_area_m2, self.span_m, self.chord_m]
        constants += [self.reference_centre - self.centre_of_gravity, self.normal_force_elevator_1_rad]
        constants += [*self.side_force_1_rad, self.aileron_reference_rad, self.rudder_reference_rad]
        for key in ("angle_of_attack_rad", "elevator_rad", "sideslip_rad", "surface_sideslip_rad"):
            constants += _first_and_step(key, getattr(self, key))
        return TabulatedAerodynamics(tables=_stack(self), constants=np.array(constants))


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class TabulatedAerodynamics:
    """Eqs. (2) to (8), the tables in one array."""

    tables: Array  #: (62, 12)
    constants: Array  #: (19,) density, S, b, c, x_r - x_cg, CZe, CYb, CYda, CYdr, references, first node and step of 4

    def force_and_moment(
        self, v_B: Array, w_B: Array, surfaces_rad: Array, air_rotation_B: Array = NO_ROTATION
    ) -> tuple[Array, Array]:
        """See `airframe.Aerodynamics`."""
        wrench = np.empty(6)
        _force_and_moment(self.tables, self.constants, v_B, w_B, surfaces_rad, air_rotation_B, wrench)
        return wrench[:3], wrench[3:]

    def write_wrenches(self, motions: Array, wrenches: Array) -> None:
        """See `airframe.Aerodynamics`."""
        _write_wrenches(self.tables, self.constants, motions, wrenches)

    def coefficients(self, alpha_rad: float, beta_rad: float, rates: Array, surfaces_rad: Array) -> Array:
        """(6,) CX, CY, CZ, Cl, Cm, Cn of Eqs. (2) to (7).

        Args:
            alpha_rad: angle of attack.
            beta_rad: sideslip, positive with air from the right.
            rates: (3,) P b/2Va, Q c/2Va, R b/2Va, forward-right-down.
            surfaces_rad: (3,) elevator, aileron, rudder [rad].
        """
        return np.asarray(_coefficients(self.tables, self.constants, alpha_rad, beta_rad, rates, surfaces_rad))


def flow_angles(v_B: Array) -> tuple[float, float, float]:
    """Airspeed [m/s], angle of attack and sideslip [rad], Eq. (1), of a velocity relative to the air (3,), body axes.

    Positive angle of attack: air from below. Positive sideslip: air from the right.
    """
    airspeed, alpha, beta = _flow_angles(v_B)
    return airspeed, alpha, beta


@njit(cache=True)
def flow_about(
    R_WB: Array, v_WB: Array, w_WB_B: Array, air_velocity_W: Array, air_rotation_B: Array, motion: Array
) -> tuple[float, float, float]:
    """Write a motion (1, 12) of `airframe.Aerodynamics`, but for the surfaces; return `flow_angles`."""
    x, y, z = v_WB[0] - air_velocity_W[0], v_WB[1] - air_velocity_W[1], v_WB[2] - air_velocity_W[2]
    for i in range(3):
        motion[0, i] = R_WB[0, i] * x + R_WB[1, i] * y + R_WB[2, i] * z
        motion[0, 3 + i], motion[0, 9 + i] = w_WB_B[i], air_rotation_B[i]
    airspeed, alpha, beta = _flow_angles(motion[0])
    return airspeed, alpha, beta


def _stack(p: AirframeParameters) -> Array:
    rows = [p.axial_force, p.pitching_moment, p.normal_force[np.newaxis], p.rolling_moment, p.yawing_moment]
    rows += [p.rolling_moment_aileron, p.rolling_moment_rudder, p.yawing_moment_aileron, p.yawing_moment_rudder]
    return np.vstack([*rows, p.damping])


def _first_and_step(key: str, nodes: Array) -> list[float]:
    steps = np.diff(nodes)
    if not np.all(np.abs(steps - steps[0]) < 1e-6 * steps[0]):
        raise DockairError(f"parameters.airframe.{key}", expected="evenly spaced nodes, rising", got=nodes.tolist())
    return [float(nodes[0]), float(nodes[-1] - nodes[0]) / len(steps)]


@njit(cache=True)
def _flow_angles(v_B):  # type: ignore[no-untyped-def]
    U, V, W = _FLIP[0] * v_B[0], _FLIP[1] * v_B[1], _FLIP[2] * v_B[2]
    airspeed = np.sqrt(U * U + V * V + W * W)
    return airspeed, np.arctan2(W, U), np.arcsin(V / airspeed) if airspeed > 0.0 else 0.0


@njit(cache=True)
def _cell(x, first, step, count):  # type: ignore[no-untyped-def]
    """Cell of a node table and the place in it, not clamped."""
    s = (x - first) / step
    i = int(min(max(s, 0.0), count - 2.0))
    return i, s - i


@njit(cache=True)
def _along(tables, row, column, t):  # type: ignore[no-untyped-def]
    """Linear value between two columns of a row."""
    return tables[row, column] + t * (tables[row, column + 1] - tables[row, column])


@njit(cache=True)
def _at(tables, row, t_row, column, t):  # type: ignore[no-untyped-def]
    """Bilinear value between two rows and two columns."""
    low = tables[row, column] + t * (tables[row, column + 1] - tables[row, column])
    high = tables[row + 1, column] + t * (tables[row + 1, column + 1] - tables[row + 1, column])
    return low + t_row * (high - low)


@njit(cache=True)
def _coefficients(tables, k, alpha, beta, rates, surfaces):  # type: ignore[no-untyped-def]
    arm, CZ_elevator, CY_beta, CY_aileron, CY_rudder = k[4], k[5], k[6], k[7], k[8]
    elevator = surfaces[0]
    aileron, rudder = surfaces[1] / k[9], surfaces[2] / k[10]
    i, t = _cell(min(max(alpha, k[11]), k[11] + k[12] * (_COLUMNS - 1)), k[11], k[12], _COLUMNS)
    e, t_e = _cell(elevator, k[13], k[14], _ELEVATORS)
    end = k[15] + k[16] * (_SIDESLIPS - 1)
    beta = min(max(beta, -end), end)
    side = -1.0 if beta < 0.0 else 1.0
    b, t_b = _cell(abs(beta), k[15], k[16], _SIDESLIPS)
    s, t_s = _cell(beta, k[17], k[18], _SIDESLIPS)
    P, Q, R = rates
    CX = _at(tables, _CX + e, t_e, i, t) + _along(tables, _DAMPING, i, t) * Q  # Eq. (2)
    CY = CY_beta * beta + CY_aileron * surfaces[1] + CY_rudder * surfaces[2]  # Eq. (3)
    CY = CY + _along(tables, _DAMPING + 1, i, t) * R + _along(tables, _DAMPING + 2, i, t) * P
    CZ = _along(tables, _CZ, i, t) * (1.0 - beta * beta) + CZ_elevator * elevator  # Eq. (4)
    CZ = CZ + _along(tables, _DAMPING + 3, i, t) * Q
    Cl = side * _at(tables, _CL + b, t_b, i, t)  # Eq. (5)
    Cl = Cl + _along(tables, _DAMPING + 4, i, t) * R + _along(tables, _DAMPING + 5, i, t) * P
    Cl += _at(tables, _CL_AILERON + s, t_s, i, t) * aileron + _at(tables, _CL_RUDDER + s, t_s, i, t) * rudder
    Cm = _at(tables, _CM + e, t_e, i, t) + CZ * arm + _along(tables, _DAMPING + 6, i, t) * Q  # Eq. (6)
    Cn = side * _at(tables, _CN + b, t_b, i, t) - CY * arm * k[3] / k[2]  # Eq. (7)
    Cn = Cn + _along(tables, _DAMPING + 7, i, t) * R + _along(tables, _DAMPING + 8, i, t) * P
    Cn += _at(tables, _CN_AILERON + s, t_s, i, t) * aileron + _at(tables, _CN_RUDDER + s, t_s, i, t) * rudder
    return CX, CY, CZ, Cl, Cm, Cn


@njit(cache=True)
def _force_and_moment(tables, k, v_B, w_B, surfaces, air_rotation_B, wrench):  # type: ignore[no-untyped-def]
    airspeed, alpha, beta = _flow_angles(v_B)
    S, b, c = k[1], k[2], k[3]
    per_rate = 0.5 / max(airspeed, 1e-3)
    P, Q, R = w_B[0] - air_rotation_B[0], w_B[1] - air_rotation_B[1], w_B[2] - air_rotation_B[2]
    rates = (_FLIP[0] * P * b * per_rate, _FLIP[1] * Q * c * per_rate, _FLIP[2] * R * b * per_rate)
    C = _coefficients(tables, k, alpha, beta, rates, surfaces)
    qbar_S = 0.5 * k[0] * airspeed * airspeed * S  # Eqs. (1) and (8)
    for i in range(3):
        wrench[i] = _FLIP[i] * qbar_S * C[i]
        wrench[3 + i] = _FLIP[i] * qbar_S * (c if i == 1 else b) * C[3 + i]


@njit(cache=True)
def _write_wrenches(tables, k, motions, wrenches):  # type: ignore[no-untyped-def]
    for i in range(motions.shape[0]):
        m = motions[i]
        _force_and_moment(tables, k, m[:3], m[3:6], m[6:9], m[9:], wrenches[i])
