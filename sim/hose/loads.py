"""Air loads on hose and drogue.

Hose, per metre, by the cross-flow principle; u is the air's velocity minus the hose's, split along and across it:

    f = 1/2 rho ( C_n(Re_n) d |u_n| u_n  +  C_f(Re_f) pi d |u_t| u_t )                                    (1)
    Re_n = |u_n| d / nu            Re_f = pi d |u|^2 / (2 nu |u_n|)                                       (2)
    C_f = c_f Re_f^(-1/6)                                                                                (3)

C_n falls smoothly, in log Re_n, from its subcritical to its supercritical value over the drag crisis. Its Reynolds
number is that of the *normal* velocity: with the total speed, 120 m/s sits on the crisis and the hose chatters.
Each link is integrated by two-point Gauss quadrature over the part of it that is outside the pod, so that its own
rotation is damped and a link half drawn in has the right moment. The air's velocity is taken at the link's middle.

Drogue: drag along the relative air at the canopy's centre, behind the hose's end, which makes it point into the wind,
and a moment against its rate of turn:

    D = 1/2 rho S C_D |u| u        M = - 1/2 rho |u| S d^2 C_q w                                         (4)

Not modelled: added mass, vortex shedding, lift of the canopy, C_n below Re 180 (forces under 1 mN/m).
Frame: W throughout. Sources: Hoerner, Fluid-Dynamic Drag, ch. III (cross-flow principle); coefficients as in
RflySim/RflySimAAR `hose3D_n_air_Fv_correction.m`.
"""

import numpy as np
from numba import njit

from dockair.rotations import Array
from dockair.sim.hose.chain import DrogueParameters, HoseParameters

# Layout of the coefficient vector the kernels take: numba caches no dataclasses.
_RHO, _NU, _DIAMETER, _CN_LOW, _CN_HIGH, _LOG_RE_LOW, _LOG_RE_HIGH, _CF = range(8)
_LINK_LENGTH, _DROGUE_SCD, _DROGUE_ARM, _DROGUE_SDDCQ = range(8, 12)
_SIZE = 12

_FRICTION_EXPONENT = -1.0 / 6.0  # Eq. (3), turbulent boundary layer
_GAUSS = 0.5 / 3.0**0.5  # two-point abscissa on [-1/2, 1/2]


def load_coefficients(
    hose: HoseParameters, drogue: DrogueParameters, density_kg_m3: float, viscosity_m2_s: float
) -> Array:
    """(12,) vector of what the kernels of this module need, SI."""
    k = np.zeros(_SIZE)
    k[_RHO], k[_NU], k[_DIAMETER] = density_kg_m3, viscosity_m2_s, 2.0 * hose.radius_m
    k[_CN_LOW], k[_CN_HIGH] = hose.normal_drag_coefficient, hose.supercritical_drag_coefficient
    k[_LOG_RE_LOW] = np.log(hose.crisis_reynolds / hose.crisis_width_ratio)
    k[_LOG_RE_HIGH] = np.log(hose.crisis_reynolds * hose.crisis_width_ratio)
    k[_CF], k[_LINK_LENGTH] = hose.friction_coefficient, hose.link_length_m
    k[_DROGUE_SCD] = drogue.drag_area_m2 * drogue.drag_coefficient
    k[_DROGUE_ARM] = drogue.centre_of_mass_x_m - drogue.drag_centre_x_m
    k[_DROGUE_SDDCQ] = drogue.drag_area_m2 * drogue.drag_diameter_m**2 * drogue.rate_damping_coefficient
    k.setflags(write=False)
    return k


@njit(cache=True)
def hose_load_per_length(t: Array, u: Array, k: Array) -> Array:
    """(3,) load [N/m] on hose along the unit vector t (3,) in relative air u (3,) [m/s], Eqs. (1)-(3)."""
    along = u[0] * t[0] + u[1] * t[1] + u[2] * t[2]
    n0, n1, n2 = u[0] - along * t[0], u[1] - along * t[1], u[2] - along * t[2]
    across = np.sqrt(n0 * n0 + n1 * n1 + n2 * n2)
    speed = np.sqrt(along * along + across * across)
    f = np.zeros(3)
    if speed == 0.0:
        return f
    normal = 0.0
    if across > 0.0:
        s = (np.log(across * k[_DIAMETER] / k[_NU]) - k[_LOG_RE_LOW]) / (k[_LOG_RE_HIGH] - k[_LOG_RE_LOW])
        s = min(max(s, 0.0), 1.0)
        c_n = k[_CN_LOW] + (k[_CN_HIGH] - k[_CN_LOW]) * s * s * (3.0 - 2.0 * s)
        normal = 0.5 * k[_RHO] * c_n * k[_DIAMETER] * across
    # Eq. (3) with 1 / Re_f of Eq. (2), which is 0 and not infinite for a hose exactly along the stream
    c_f = k[_CF] * (2.0 * k[_NU] * across / (np.pi * k[_DIAMETER] * speed * speed)) ** (-_FRICTION_EXPONENT)
    tangential = 0.5 * k[_RHO] * c_f * np.pi * k[_DIAMETER] * abs(along) * along
    f[0] = normal * n0 + tangential * t[0]
    f[1] = normal * n1 + tangential * t[1]
    f[2] = normal * n2 + tangential * t[2]
    return f


@njit(cache=True)
def drogue_drag(u: Array, k: Array) -> Array:
    """(3,) drag [N] of the drogue in relative air u (3,) [m/s] at its canopy, Eq. (4)."""
    return 0.5 * k[_RHO] * k[_DROGUE_SCD] * np.sqrt(u[0] * u[0] + u[1] * u[1] + u[2] * u[2]) * u


@njit(cache=True)
def tow_loads(position: Array, R: Array, v: Array, w: Array, air: Array, drawn_in: float, k: Array) -> Array:
    """Air loads on every body of the tow: the links from the exit on, then the drogue.

    Args:
        position: (n + 1, 3) centres of mass in W [m]; a link's is its middle.
        R: (n + 1, 3, 3) axes in W; x along the body toward the tanker.
        v: (n + 1, 3) velocities of the centres of mass in W [m/s].
        w: (n + 1, 3) angular velocities in W [rad/s].
        air: (n + 1, 3) velocity of the air there, in W [m/s].
        drawn_in: length of hose inside the pod [m]; it feels no air.
        k: vector of `load_coefficients`.

    Returns:
        (n + 1, 6) force [N] and moment about the centre of mass [N m], in W.
    """
    n = position.shape[0] - 1
    wrench = np.zeros((n + 1, 6))
    length = k[_LINK_LENGTH]
    for i in range(n):
        inside = min(max(drawn_in - i * length, 0.0), length)
        outside = length - inside
        if outside <= 0.0:
            continue
        t = np.ascontiguousarray(R[i, :, 0])
        for sign in (-1.0, 1.0):
            x = -0.5 * inside + sign * _GAUSS * outside  # from the link's middle, positive toward the tanker
            arm = x * t
            u = air[i] - v[i] - np.cross(w[i], arm)
            force = 0.5 * outside * hose_load_per_length(t, u, k)
            wrench[i, :3] += force
            wrench[i, 3:] += np.cross(arm, force)
    arm = -k[_DROGUE_ARM] * np.ascontiguousarray(R[n, :, 0])
    u = air[n] - v[n] - np.cross(w[n], arm)
    drag = drogue_drag(u, k)
    wrench[n, :3] = drag
    damping = 0.5 * k[_RHO] * k[_DROGUE_SDDCQ] * np.sqrt(u[0] * u[0] + u[1] * u[1] + u[2] * u[2])
    wrench[n, 3:] = np.cross(arm, drag) - damping * w[n]
    return wrench
