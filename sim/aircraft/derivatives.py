"""Aerodynamic force and moment of an airframe that is known by its derivatives about one flight condition.

With the flow angles alpha and beta, and the rates (P, Q, R) beyond those of the air, forward-right-down, taken to
stability axes (x along the flow in the plane of symmetry: P_s = P cos alpha + R sin alpha, R_s likewise):

    CL = CL0 + CLalpha alpha + (CLq Q + CLalphadot q) c/2Va + CLe elevator,     CD = CD0 + k CL^2         (1)
    CX = CL sin alpha - CD cos alpha,                          CZ = -CL cos alpha - CD sin alpha          (2)
    Cm = Cm0 + Cmalpha alpha + (Cmq Q + Cmalphadot q) c/2Va + Cme elevator                                (3)
    CY, Cl_s, Cn_s = D (beta, P_s b/2Va, R_s b/2Va, aileron, rudder)                                      (4)

Moments are turned back into body axes; force and moment follow as Eq. (8) of `aerodynamics`. For the rate of alpha the
aircraft's own pitch rate q is taken, as in the short period where both are nearly the same; the air's is no part of it,
for in a wake's gradient alpha stays as it is.

Valid within the ranges of the sheet, where a lift curve and a polar are straight and parabolic; beyond, alpha and beta
hold their last value. Not modelled: stall, Mach effects; the lag of the downwash behind a gust, which would take back
Cmalphadot of the Cmq by which the gust's gradient pitches the aircraft.
Source: Roskam, Airplane Flight Dynamics and Automatic Flight Controls, part I, chapters 3 and 5.
"""

from dataclasses import dataclass

import numpy as np

from dockair.kernels import njit
from dockair.rotations import FLU_FROM_FRD, Array
from dockair.sim.aircraft.airframe import NO_ROTATION, AirframeData

_FLIP = np.diag(FLU_FROM_FRD).copy()  # a frozen global of the kernel


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class DerivativeAirframe(AirframeData):
    """Sheet `airframe_unmanned`."""

    angle_of_attack_ends_rad: Array  #: (2,)
    sideslip_end_rad: float
    lift: Array  #: (5,) CL0, CLalpha, CLq, CLalphadot, CLe
    drag: Array  #: (2,) CD0, k
    pitching_moment: Array  #: (5,) Cm0, Cmalpha, Cmq, Cmalphadot, Cme
    side_force: Array  #: (5,) after beta, P, R, aileron, rudder
    rolling_moment: Array  #: (5,)
    yawing_moment: Array  #: (5,)

    @property
    def angle_of_attack_range_rad(self) -> tuple[float, float]:
        """Where the lift curve is straight."""
        return float(self.angle_of_attack_ends_rad[0]), float(self.angle_of_attack_ends_rad[1])

    def aerodynamics(self, density_kg_m3: float) -> "DerivativeAerodynamics":
        """Return Eqs. (1) to (4) in air of a density."""
        lateral = np.vstack([self.side_force, self.rolling_moment, self.yawing_moment])
        sizes = [density_kg_m3, self.wing_area_m2, self.span_m, self.chord_m]
        ends = [*self.angle_of_attack_ends_rad, self.sideslip_end_rad]
        constants = np.array([*sizes, *ends, *self.lift, *self.drag, *self.pitching_moment])
        return DerivativeAerodynamics(constants=constants, lateral=lateral)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class DerivativeAerodynamics:
    """Eqs. (1) to (4)."""

    constants: Array  #: (19,) density, S, b, c, ends of alpha and beta, lift, drag, pitching moment
    lateral: Array  #: (3, 5) D of Eq. (4)

    def force_and_moment(
        self, v_B: Array, w_B: Array, surfaces_rad: Array, air_rotation_B: Array = NO_ROTATION
    ) -> tuple[Array, Array]:
        """See `airframe.Aerodynamics`."""
        wrench = np.empty(6)
        _force_and_moment(self.constants, self.lateral, v_B, w_B, surfaces_rad, air_rotation_B, wrench)
        return wrench[:3], wrench[3:]

    def write_wrenches(self, motions: Array, wrenches: Array) -> None:
        """See `airframe.Aerodynamics`."""
        _write_wrenches(self.constants, self.lateral, motions, wrenches)


@njit(cache=True)
def _force_and_moment(k, lateral, v_B, w_B, surfaces, air_rotation_B, wrench):  # type: ignore[no-untyped-def]
    U, V, W = _FLIP[0] * v_B[0], _FLIP[1] * v_B[1], _FLIP[2] * v_B[2]
    airspeed = max(np.sqrt(U * U + V * V + W * W), 1e-3)
    direction = np.arctan2(W, U)
    alpha = min(max(direction, k[4]), k[5])
    beta = min(max(np.arcsin(min(max(V / airspeed, -1.0), 1.0)), -k[6]), k[6])
    S, b, c = k[1], k[2], k[3]
    P = _FLIP[0] * (w_B[0] - air_rotation_B[0]) * 0.5 * b / airspeed
    Q = _FLIP[1] * (w_B[1] - air_rotation_B[1]) * 0.5 * c / airspeed
    own_Q = _FLIP[1] * w_B[1] * 0.5 * c / airspeed
    R = _FLIP[2] * (w_B[2] - air_rotation_B[2]) * 0.5 * b / airspeed
    cosine, sine = np.cos(direction), np.sin(direction)
    CL = k[7] + k[8] * alpha + k[9] * Q + k[10] * own_Q + k[11] * surfaces[0]  # Eq. (1)
    CD = k[12] + k[13] * CL * CL
    Cm = k[14] + k[15] * alpha + k[16] * Q + k[17] * own_Q + k[18] * surfaces[0]  # Eq. (3)
    z = (beta, P * cosine + R * sine, R * cosine - P * sine, surfaces[1], surfaces[2])
    CY = Cl = Cn = 0.0
    for j in range(5):  # Eq. (4)
        CY += lateral[0, j] * z[j]
        Cl += lateral[1, j] * z[j]
        Cn += lateral[2, j] * z[j]
    qbar_S = 0.5 * k[0] * airspeed * airspeed * S
    wrench[0] = _FLIP[0] * qbar_S * (CL * sine - CD * cosine)  # Eq. (2)
    wrench[1] = _FLIP[1] * qbar_S * CY
    wrench[2] = _FLIP[2] * qbar_S * (-CL * cosine - CD * sine)
    wrench[3] = _FLIP[0] * qbar_S * b * (Cl * cosine - Cn * sine)
    wrench[4] = _FLIP[1] * qbar_S * c * Cm
    wrench[5] = _FLIP[2] * qbar_S * b * (Cn * cosine + Cl * sine)


@njit(cache=True)
def _write_wrenches(k, lateral, motions, wrenches):  # type: ignore[no-untyped-def]
    for i in range(motions.shape[0]):
        m = motions[i]
        _force_and_moment(k, lateral, m[:3], m[3:6], m[6:9], m[9:], wrenches[i])
