"""Receiver's aerodynamic force and moment: derivatives of an F-16-class airframe about its trim point.

With the air-relative velocity (U, V, W) of the centre of gravity and the rates (P, Q, R), forward-right-down:

    Va^2 = U^2 + V^2 + W^2,   alpha = atan(W / U),   beta = asin(V / Va),   qbar = rho Va^2 / 2      (1)
    z = (alpha - alpha_0, beta, P b/2Va, Q c/2Va, R b/2Va, elevator - elevator_0, aileron, rudder)   (2)
    (CX, CY, CZ, Cl, Cm, Cn) = C_0 + D z                                                             (3)
    force = qbar S (CX, CY, CZ),     moment = qbar S (b Cl, c Cm, b Cn)                              (4)

C_0 and D (6, 8) come from the tables of the sheet at the trim point (alpha_0, elevator_0): slopes are differences over
one table interval about it. Moments are carried from the tables' reference to the centre of gravity:
Cm + CZ (x_r - x_cg),  Cn - CY (x_r - x_cg) c/b.

Surfaces are (elevator, aileron, rudder), positive with the trailing edge down or left: nose down, roll to the left,
nose left. The tables are forward-right-down; the kernel turns its inputs and outputs with `FLU_FROM_FRD`, here and
nowhere else, so that everything outside is forward-left-up.

Valid within 3 degrees of the trim's angle of attack and 5 degrees of sideslip (CX, CZ and Cm within 0.01 of
the tables), and at low Mach numbers.
Not modelled: curvature of the tables, Mach effects, leading-edge flaps, speed brake, unsteady lift, gust gradients.
Source: Stevens, Lewis & Johnson, Aircraft Control and Simulation, section 3.5 and appendix A (NASA TP-1538).
"""

from dataclasses import dataclass

import numpy as np
from numba import njit

from dockair.rotations import FLU_FROM_FRD, Array

_FLIP = np.diag(FLU_FROM_FRD).copy()  # a frozen global of the kernel


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class AirframeParameters:
    """Sheet `airframe`: what the tables are and how they are laid out is said there."""

    mass_kg: float
    inertia_kg_m2: Array  #: (4,) Ixx, Iyy, Izz, Ixz, forward-right-down
    wing_area_m2: float
    chord_m: float
    span_m: float
    centre_of_gravity: float
    reference_centre: float
    angle_of_attack_rad: Array  #: (12,)
    elevator_rad: Array  #: (5,)
    axial_force: Array  #: (5, 12)
    normal_force: Array  #: (12,)
    normal_force_elevator_1_rad: float
    pitching_moment: Array  #: (5, 12)
    sideslip_rad: float
    rolling_moment: Array  #: (12,)
    yawing_moment: Array  #: (12,)
    side_force_1_rad: Array  #: (3,)
    aileron_reference_rad: float
    rudder_reference_rad: float
    rolling_moment_aileron: Array  #: (12,)
    rolling_moment_rudder: Array  #: (12,)
    yawing_moment_aileron: Array  #: (12,)
    yawing_moment_rudder: Array  #: (12,)
    damping: Array  #: (9, 12) CXq, CYr, CYp, CZq, Clr, Clp, Cmq, Cnr, Cnp
    actuator_bandwidth_rad_s: float
    surface_limits_rad: Array  #: (3,) elevator, aileron, rudder
    surface_rate_limits_rad_s: Array  #: (3,)
    engine_time_constant_s: float
    thrust_mach: Array  #: (6,)
    thrust_altitude_m: Array  #: (6,)
    idle_thrust_n: Array  #: (6, 6) by Mach number and altitude
    military_thrust_n: Array  #: (6, 6)

    @property
    def inertia_B(self) -> Array:
        """(3, 3) inertia about the centre of gravity, forward-left-up [kg m^2]."""
        xx, yy, zz, xz = self.inertia_kg_m2
        inertia_frd = np.array([[xx, 0.0, -xz], [0.0, yy, 0.0], [-xz, 0.0, zz]])
        return np.asarray(FLU_FROM_FRD @ inertia_frd @ FLU_FROM_FRD)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class LinearAerodynamics:
    """Eq. (3) about one trim point, with what turns coefficients into force and moment."""

    C_0: Array  #: (6,) CX, CY, CZ, Cl, Cm, Cn at trim
    D: Array  #: (6, 8) derivatives after z of Eq. (2)
    z_0: Array  #: (8,) trim values of z's quantities: alpha_0 and elevator_0, else 0
    lengths: Array  #: (3,) S, b, c
    density_kg_m3: float

    def force_and_moment(self, v_B: Array, w_B: Array, surfaces_rad: Array) -> tuple[Array, Array]:
        """Force [N] and moment [N m] about the centre of gravity, (3,) each, body axes forward-left-up.

        Args:
            v_B: (3,) velocity of the centre of gravity relative to the air [m/s].
            w_B: (3,) angular velocity [rad/s].
            surfaces_rad: (3,) elevator, aileron, rudder [rad].
        """
        return _force_and_moment(self.C_0, self.D, self.z_0, self.lengths, self.density_kg_m3, v_B, w_B, surfaces_rad)


def flow_angles(v_B: Array) -> tuple[float, float, float]:
    """Airspeed [m/s], angle of attack and sideslip [rad], Eq. (1), of a velocity relative to the air (3,), body axes.

    Positive angle of attack: air from below. Positive sideslip: air from the right.
    """
    airspeed, alpha, beta = _flow_angles(v_B)
    return airspeed, alpha, beta


def static_coefficients(parameters: AirframeParameters, alpha_rad: float, elevator_rad: float) -> Array:
    """(6,) CX, CY, CZ, Cl, Cm, Cn in straight symmetric flight, of the tables, about the centre of gravity."""
    p = parameters
    CX = _bilinear(p.elevator_rad, p.angle_of_attack_rad, p.axial_force, elevator_rad, alpha_rad)
    CZ = float(np.interp(alpha_rad, p.angle_of_attack_rad, p.normal_force))
    CZ += p.normal_force_elevator_1_rad * elevator_rad
    Cm = _bilinear(p.elevator_rad, p.angle_of_attack_rad, p.pitching_moment, elevator_rad, alpha_rad)
    Cm += CZ * (p.reference_centre - p.centre_of_gravity)
    return np.array([CX, 0.0, CZ, 0.0, Cm, 0.0])


def linearise(
    parameters: AirframeParameters, alpha_rad: float, elevator_rad: float, density_kg_m3: float
) -> LinearAerodynamics:
    """Eq. (3) about a trim point.

    Args:
        parameters: the tables.
        alpha_rad: alpha_0.
        elevator_rad: elevator_0.
        density_kg_m3: of the air flown in.
    """
    p = parameters
    D = np.zeros((6, 8))
    alpha_step, elevator_step = _half_intervals(p)
    for column, step_alpha, step_elevator in ((0, alpha_step, 0.0), (5, 0.0, elevator_step)):
        high = static_coefficients(p, alpha_rad + step_alpha, elevator_rad + step_elevator)
        low = static_coefficients(p, alpha_rad - step_alpha, elevator_rad - step_elevator)
        D[:, column] = (high - low) / (2.0 * (step_alpha + step_elevator))
    _fill_lateral(D, p, alpha_rad)
    _fill_damping(D, p, alpha_rad)
    arm = p.reference_centre - p.centre_of_gravity
    D[4, 3] += D[2, 3] * arm  # the static columns have it from static_coefficients
    D[5] -= D[1] * arm * p.chord_m / p.span_m
    return LinearAerodynamics(
        C_0=static_coefficients(p, alpha_rad, elevator_rad),
        D=D,
        z_0=np.array([alpha_rad, 0.0, 0.0, 0.0, 0.0, elevator_rad, 0.0, 0.0]),
        lengths=np.array([p.wing_area_m2, p.span_m, p.chord_m]),
        density_kg_m3=density_kg_m3,
    )


def _half_intervals(p: AirframeParameters) -> tuple[float, float]:
    alpha, elevator = p.angle_of_attack_rad, p.elevator_rad
    return 0.5 * float(alpha[1] - alpha[0]), 0.5 * float(elevator[1] - elevator[0])


def _fill_lateral(D: Array, p: AirframeParameters, alpha_rad: float) -> None:
    """Columns sideslip, aileron, rudder."""
    D[1, [1, 6, 7]] = p.side_force_1_rad
    columns = (
        (1, p.rolling_moment, p.yawing_moment, p.sideslip_rad),
        (6, p.rolling_moment_aileron, p.yawing_moment_aileron, p.aileron_reference_rad),
        (7, p.rolling_moment_rudder, p.yawing_moment_rudder, p.rudder_reference_rad),
    )
    for column, rolling, yawing, per in columns:
        D[3, column] = np.interp(alpha_rad, p.angle_of_attack_rad, rolling) / per
        D[5, column] = np.interp(alpha_rad, p.angle_of_attack_rad, yawing) / per


def _fill_damping(D: Array, p: AirframeParameters, alpha_rad: float) -> None:
    """Columns of the three rates."""
    CXq, CYr, CYp, CZq, Clr, Clp, Cmq, Cnr, Cnp = (
        np.interp(alpha_rad, p.angle_of_attack_rad, row) for row in p.damping
    )
    D[[1, 3, 5], 2] = CYp, Clp, Cnp
    D[[0, 2, 4], 3] = CXq, CZq, Cmq
    D[[1, 3, 5], 4] = CYr, Clr, Cnr


def _bilinear(rows: Array, columns: Array, table: Array, row: float, column: float) -> float:
    i = int(np.clip(np.searchsorted(rows, row) - 1, 0, len(rows) - 2))
    t = (row - rows[i]) / (rows[i + 1] - rows[i])
    low, high = np.interp(column, columns, table[i]), np.interp(column, columns, table[i + 1])
    return float((1.0 - t) * low + t * high)


@njit(cache=True)
def _flow_angles(v_B):  # type: ignore[no-untyped-def]
    U, V, W = _FLIP[0] * v_B[0], _FLIP[1] * v_B[1], _FLIP[2] * v_B[2]
    airspeed = np.sqrt(U * U + V * V + W * W)
    return airspeed, np.arctan2(W, U), np.arcsin(V / airspeed) if airspeed > 0.0 else 0.0


@njit(cache=True)
def _force_and_moment(C_0, D, z_0, lengths, density, v_B, w_B, surfaces):  # type: ignore[no-untyped-def]
    airspeed, alpha, beta = _flow_angles(v_B)
    S, b, c = lengths
    per_rate = 0.5 / max(airspeed, 1e-3)
    z = np.empty(8)
    z[0], z[1] = alpha, beta
    z[2] = _FLIP[0] * w_B[0] * b * per_rate
    z[3] = _FLIP[1] * w_B[1] * c * per_rate
    z[4] = _FLIP[2] * w_B[2] * b * per_rate
    z[5:] = surfaces
    C = C_0.copy()
    for i in range(6):
        for j in range(8):
            C[i] += D[i, j] * (z[j] - z_0[j])
    qbar_S = 0.5 * density * airspeed * airspeed * S  # Eqs. (1) and (4)
    force, moment = np.empty(3), np.empty(3)
    for i in range(3):
        force[i] = _FLIP[i] * qbar_S * C[i]
        moment[i] = _FLIP[i] * qbar_S * (c if i == 1 else b) * C[3 + i]
    return force, moment
