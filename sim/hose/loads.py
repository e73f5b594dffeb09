"""Air loads on hose and drogue.

Hose, per metre, by the cross-flow principle; u is the air's velocity minus the hose's, split along and across it:

    f = 1/2 rho ( C_n(Re_n) d |u_n| u_n  +  C_f(Re_f) pi d |u_t| u_t )                                    (1)
    Re_n = |u_n| d / nu            Re_f = pi d |u|^2 / (2 nu |u_n|)                                       (2)
    C_f = c_f Re_f^(-1/6)                                                                                (3)

C_n falls smoothly, in log Re_n, from its subcritical to its supercritical value over the drag crisis. Its Reynolds
number is that of the *normal* velocity: with the total speed, 120 m/s sits on the crisis and the hose chatters.
Each link is integrated by two-point Gauss quadrature over the part of it that is outside the pod, so that its own
rotation is damped and a link half drawn in has the right moment. The air's velocity is taken at the link's middle.

Drogue: the force at the canopy's centre, behind the hose's end, has its own coefficients along and across the axis
(u_a, u_c: the relative air along and across; S_c: fabric of the canopy), and a moment acts against its rate of turn:

    F = 1/2 rho |u| (S C_D u_a + S_c C_S u_c)        M = - 1/2 rho |u| S d^2 C_q w                         (4)

At incidence a the drag coefficient on S is C_D cos^2 a + C_S S_c/S sin^2 a and the lift's (C_S S_c/S - C_D) sin a
cos a: smooth for every a, also with the air from behind.

Not modelled: added mass, vortex shedding, flapping or folding of the canopy, C_n below Re 180 (forces under 1 mN/m).
Frame: W throughout. Sources: Hoerner, Fluid-Dynamic Drag, ch. III (cross-flow principle); coefficients as in
RflySim/RflySimAAR `hose3D_n_air_Fv_correction.m`; the canopy's in assets/parameters/drogue.toml.
"""

import numpy as np

from dockair.kernels import njit
from dockair.rotations import Array
from dockair.sim.hose.chain import DrogueParameters, HoseParameters

# Layout of the coefficient vector the kernels take: numba caches no dataclasses.
_RHO, _NU, _DIAMETER, _CN_LOW, _CN_HIGH, _LOG_RE_LOW, _LOG_RE_HIGH, _CF = range(8)
_LINK_LENGTH, _DROGUE_AXIAL, _DROGUE_SIDE, _DROGUE_ARM, _DROGUE_SDDCQ, _RE_LOW = range(8, 14)
_SIZE = 14

_FRICTION_EXPONENT = -1.0 / 6.0  # Eq. (3), turbulent boundary layer
_GAUSS = 0.5 / 3.0**0.5  # two-point abscissa on [-1/2, 1/2]


def load_coefficients(
    hose: HoseParameters, drogue: DrogueParameters, density_kg_m3: float, viscosity_m2_s: float
) -> Array:
    """(14,) vector of what the kernels of this module need, SI."""
    k = np.zeros(_SIZE)
    k[_RHO], k[_NU], k[_DIAMETER] = density_kg_m3, viscosity_m2_s, 2.0 * hose.radius_m
    k[_CN_LOW], k[_CN_HIGH] = hose.normal_drag_coefficient, hose.supercritical_drag_coefficient
    k[_RE_LOW] = hose.crisis_reynolds / hose.crisis_width_ratio
    k[_LOG_RE_LOW] = np.log(k[_RE_LOW])
    k[_LOG_RE_HIGH] = np.log(hose.crisis_reynolds * hose.crisis_width_ratio)
    k[_CF], k[_LINK_LENGTH] = hose.friction_coefficient, hose.link_length_m
    k[_DROGUE_AXIAL] = drogue.drag_area_m2 * drogue.drag_coefficient
    k[_DROGUE_SIDE] = drogue.canopy_area_m2 * drogue.canopy_side_coefficient
    k[_DROGUE_ARM] = drogue.centre_of_mass_x_m - drogue.drag_centre_x_m
    k[_DROGUE_SDDCQ] = drogue.drag_area_m2 * drogue.drag_diameter_m**2 * drogue.rate_damping_coefficient
    k.setflags(write=False)
    return k


@njit(cache=True)
def _hose_load(t0, t1, t2, u0, u1, u2, k):  # type: ignore[no-untyped-def]
    """Eqs. (1)-(3), by components."""
    along = u0 * t0 + u1 * t1 + u2 * t2
    n0, n1, n2 = u0 - along * t0, u1 - along * t1, u2 - along * t2
    across = np.sqrt(n0 * n0 + n1 * n1 + n2 * n2)
    speed2 = along * along + across * across
    if speed2 == 0.0:
        return 0.0, 0.0, 0.0
    normal = 0.0
    if across > 0.0:
        s, reynolds = 0.0, across * k[_DIAMETER] / k[_NU]
        if reynolds > k[_RE_LOW]:  # most of a hose is below the crisis and needs no logarithm
            s = min(max((np.log(reynolds) - k[_LOG_RE_LOW]) / (k[_LOG_RE_HIGH] - k[_LOG_RE_LOW]), 0.0), 1.0)
        c_n = k[_CN_LOW] + (k[_CN_HIGH] - k[_CN_LOW]) * s * s * (3.0 - 2.0 * s)
        normal = 0.5 * k[_RHO] * c_n * k[_DIAMETER] * across
    # Eq. (3) with 1 / Re_f of Eq. (2), which is 0 and not infinite for a hose exactly along the stream
    c_f = k[_CF] * (2.0 * k[_NU] * across / (np.pi * k[_DIAMETER] * speed2)) ** (-_FRICTION_EXPONENT)
    tangential = 0.5 * k[_RHO] * c_f * np.pi * k[_DIAMETER] * abs(along) * along
    return normal * n0 + tangential * t0, normal * n1 + tangential * t1, normal * n2 + tangential * t2


@njit(cache=True)
def hose_load_per_length(t: Array, u: Array, k: Array) -> Array:
    """(3,) load [N/m] on hose along the unit vector t (3,) in relative air u (3,) [m/s], Eqs. (1)-(3)."""
    f0, f1, f2 = _hose_load(t[0], t[1], t[2], u[0], u[1], u[2], k)
    return np.array([f0, f1, f2])


@njit(cache=True)
def _drogue_force(t0, t1, t2, u0, u1, u2, k):  # type: ignore[no-untyped-def]
    """Eq. (4)'s force, by components."""
    along = u0 * t0 + u1 * t1 + u2 * t2
    pressure = 0.5 * k[_RHO] * np.sqrt(u0 * u0 + u1 * u1 + u2 * u2)
    side, lengthwise = pressure * k[_DROGUE_SIDE], pressure * (k[_DROGUE_AXIAL] - k[_DROGUE_SIDE]) * along
    return side * u0 + lengthwise * t0, side * u1 + lengthwise * t1, side * u2 + lengthwise * t2


@njit(cache=True)
def drogue_force(t: Array, u: Array, k: Array) -> Array:
    """(3,) force [N] on a drogue whose axis is the unit vector t (3,), in relative air u (3,) [m/s], Eq. (4)."""
    f0, f1, f2 = _drogue_force(t[0], t[1], t[2], u[0], u[1], u[2], k)
    return np.array([f0, f1, f2])


@njit(cache=True)
def tow_loads(R: Array, v: Array, w: Array, air: Array, drawn_in: float, k: Array) -> Array:
    """Air loads on every body of the tow: the links from the exit on, then the drogue.

    Args:
        R: (n + 1, 3, 3) axes in W; x along the body toward the tanker.
        v: (n + 1, 3) velocities of the centres of mass in W [m/s]; a link's is its middle.
        w: (n + 1, 3) angular velocities in W [rad/s].
        air: (n + 1, 3) velocity of the air there, in W [m/s].
        drawn_in: length of hose inside the pod [m]; it feels no air.
        k: vector of `load_coefficients`.

    Returns:
        (n + 1, 6) force [N] and moment about the centre of mass [N m], in W.
    """
    wrench = np.zeros((R.shape[0], 6))
    _add_loads(R, v, w, air, drawn_in, k, wrench)
    return wrench


@njit(cache=True)
def write_tow_loads(
    position: Array, R: Array, spatial: Array, reference: Array, wind: Array, gusts: Array, drawn_in: float, k: Array,
    rates: Array, wrench: Array,
) -> None:  # fmt: skip
    """`tow_loads` into an array that is there already (n + 1, 6), of what MuJoCo knows.

    Args:
        position: (n + 1, 3) centres of mass in W [m].
        R: as above.
        spatial: (n + 1, 6) angular velocity, and velocity of the body's material at `reference`, in W.
        reference: (3,) point of W.
        wind: (3,) velocity of the undisturbed air [m/s].
        gusts: (n + 1, 3) that of the air at each body beyond it [m/s].
        drawn_in: as above.
        k: as above.
        rates: (3, n + 1, 3) written, too: v, w and the air's velocity.
        wrench: as above.
    """
    v, w, air = rates[0], rates[1], rates[2]
    for i in range(position.shape[0]):
        x, y, z = position[i, 0] - reference[0], position[i, 1] - reference[1], position[i, 2] - reference[2]
        for axis in range(3):
            w[i, axis], air[i, axis] = spatial[i, axis], wind[axis] + gusts[i, axis]
        v[i, 0] = spatial[i, 3] + spatial[i, 1] * z - spatial[i, 2] * y
        v[i, 1] = spatial[i, 4] + spatial[i, 2] * x - spatial[i, 0] * z
        v[i, 2] = spatial[i, 5] + spatial[i, 0] * y - spatial[i, 1] * x
        for axis in range(6):
            wrench[i, axis] = 0.0
    _add_loads(R, v, w, air, drawn_in, k, wrench)


@njit(cache=True)
def _add_loads(R, v, w, air, drawn_in, k, wrench):  # type: ignore[no-untyped-def]
    n, length = wrench.shape[0] - 1, k[_LINK_LENGTH]
    for i in range(n):
        inside = min(max(drawn_in - i * length, 0.0), length)
        outside = length - inside
        if outside <= 0.0:
            continue
        for sign in (-1.0, 1.0):
            x = -0.5 * inside + sign * _GAUSS * outside  # from the link's middle, positive toward the tanker
            _add_at(wrench, i, x, 0.5 * outside, False, R, v, w, air, k)
    _add_at(wrench, n, -k[_DROGUE_ARM], 1.0, True, R, v, w, air, k)
    u0, u1, u2 = air[n, 0] - v[n, 0], air[n, 1] - v[n, 1], air[n, 2] - v[n, 2]
    damping = 0.5 * k[_RHO] * k[_DROGUE_SDDCQ] * np.sqrt(u0 * u0 + u1 * u1 + u2 * u2)
    for axis in range(3):
        wrench[n, 3 + axis] -= damping * w[n, axis]


@njit(cache=True)
def _add_at(wrench, i, x, weight, is_drogue, R, v, w, air, k):  # type: ignore[no-untyped-def]
    """Add the load on body i at a place x along its axis from its centre of mass, times a weight."""
    t0, t1, t2 = R[i, 0, 0], R[i, 1, 0], R[i, 2, 0]
    r0, r1, r2 = x * t0, x * t1, x * t2
    u0 = air[i, 0] - v[i, 0] - (w[i, 1] * r2 - w[i, 2] * r1)
    u1 = air[i, 1] - v[i, 1] - (w[i, 2] * r0 - w[i, 0] * r2)
    u2 = air[i, 2] - v[i, 2] - (w[i, 0] * r1 - w[i, 1] * r0)
    f0, f1, f2 = _drogue_force(t0, t1, t2, u0, u1, u2, k) if is_drogue else _hose_load(t0, t1, t2, u0, u1, u2, k)
    f0, f1, f2 = weight * f0, weight * f1, weight * f2
    wrench[i, 0] += f0
    wrench[i, 1] += f1
    wrench[i, 2] += f2
    wrench[i, 3] += r1 * f2 - r2 * f1
    wrench[i, 4] += r2 * f0 - r0 * f2
    wrench[i, 5] += r0 * f1 - r1 * f0
