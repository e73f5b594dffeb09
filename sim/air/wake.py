"""The tanker's wake: horseshoe vortices of its wing and its tailplane, with Hallock-Burnham cores.

The wing's lift makes a bound vortex on its quarter chord and two trailing legs, a distance b_v apart; the tailplane's,
f Gamma with legs b_t apart, is a small one with the sense of a download, f < 0. Both together carry the tanker:

    Gamma = m g / (rho V (b_v + f b_t)),      b_v = s b                                                  (1)
    v     = Gamma/(4 pi) e x d / (h^2 + r_c^2) (cos A + cos B)          for each straight piece             (2)
    r_c^2 = r_0^2 + 4 alpha (nu + a Gamma) t,      alpha = 1.25643,      t = age = (x_b - x)/V              (3)

Eq. (2) is the law of Biot and Savart for a piece along e, seen at the distance h from its line under the angles A and
B at its ends; r_c, the core of [Burnham & Hallock 1982], takes the place of the singular line. Far behind, with both
legs infinite, it is their profile Gamma/(2 pi) h/(h^2 + r_c^2). As each piece turns the air about its own axis, the
field is free of divergence, core and all. On the axis of symmetry, cores left out, at the distance x behind:

    w = - Gamma/(pi b_v) (1 + sqrt(x^2 + (b_v/2)^2)/x)                                                   (4)

The legs stand at b_v/2 from the wing on. An elliptic loading sheds a sheet that takes some six spans to roll up
[Spreiter & Sacks 1951], but the centroid of each half stays at pi/8 b all the way, s = pi/4, because lift is kept; legs
from the tips that come in later would carry too much. `filaments` > 1 divides the sheet into as many nested horseshoes
of equal strength, at the centroids of their parts of the elliptic sheet: not rolled up at all.

Frame: T, axes of the tanker; the air blows along -x. Not modelled: roll-up, sinking and meandering of the legs, sweep
and dihedral of the bound vortex, jets, fuselage, the wing's thickness, curvature of the legs in a turn.
Sources: Eq. (3) Squire 1965 with a of Bhagwat & Leishman 2002; tail as in RflySim/RflySimAAR `TankerVortexWindField.m`.
"""

from dataclasses import dataclass

import numpy as np

from dockair.errors import DockairError
from dockair.kernels import njit
from dockair.rotations import Array
from dockair.sim.air.atmosphere import STANDARD_GRAVITY_M_S2, Air

_SQUIRE = 1.25643  # where the swirl of a Lamb-Oseen vortex is greatest: r_c^2 = 4 alpha nu t

# Columns of the table that the kernel takes, a horseshoe in each row
_X, _Z, _HALF_SPAN, _STRENGTH, _CORE, _GROWTH = 0, 2, 3, 4, 5, 6


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class WakeParameters:
    """assets/parameters/wake.toml. Places in the tanker's axes T."""

    vortex_span_fraction: float  #: s
    filaments: int  #: nested horseshoes of the wing
    bound_m: Array  #: (3,) middle of the wing's bound vortex
    core_fraction: float  #: r_0 over the span of wing or tailplane
    core_growth: float  #: a
    tail_circulation_fraction: float  #: f, of the wing's; negative for a download
    tail_vortex_span_m: float  #: b_t
    tail_bound_m: Array  #: (3,) middle of the tailplane's bound vortex


def circulation_m2_s(parameters: WakeParameters, mass_kg: float, span_m: float, airspeed_m_s: float, air: Air) -> float:
    """Gamma of the wing in straight level flight, Eq. (1)."""
    lift_n = mass_kg * STANDARD_GRAVITY_M_S2
    wing_m = parameters.vortex_span_fraction * span_m
    tail_m = parameters.tail_circulation_fraction * parameters.tail_vortex_span_m
    return lift_n / (air.density_kg_m3 * airspeed_m_s * (wing_m + tail_m))


def wake_coefficients(
    parameters: WakeParameters, *, mass_kg: float, span_m: float, airspeed_m_s: float, air: Air
) -> Array:
    """(m, 7) table of horseshoes that `wake_velocity` needs, for a tanker in straight level flight.

    Args:
        parameters: sheet `wake`.
        mass_kg: of the tanker.
        span_m: b, of its wing.
        airspeed_m_s: V, true.
        air: at its altitude.

    Raises:
        DockairError: no airspeed.
    """
    if not airspeed_m_s > 0.0:
        raise DockairError("airspeed_m_s", expected="a speed > 0", got=airspeed_m_s)
    p = parameters
    gamma = circulation_m2_s(p, mass_kg, span_m, airspeed_m_s, air)
    shares = _sheet_centroids(p.filaments)
    k = np.empty((p.filaments + 1, 7))
    k[:-1, _X : _Z + 1], k[-1, _X : _Z + 1] = p.bound_m, p.tail_bound_m
    k[:-1, _HALF_SPAN] = 0.5 * p.vortex_span_fraction * span_m * shares
    k[-1, _HALF_SPAN] = 0.5 * p.tail_vortex_span_m
    k[:-1, _STRENGTH] = gamma / p.filaments / (4.0 * np.pi)
    k[-1, _STRENGTH] = p.tail_circulation_fraction * gamma / (4.0 * np.pi)
    k[:-1, _CORE] = (p.core_fraction * span_m) ** 2
    k[-1, _CORE] = (p.core_fraction * p.tail_vortex_span_m / p.vortex_span_fraction) ** 2
    eddy = air.kinematic_viscosity_m2_s + p.core_growth * 4.0 * np.pi * np.abs(k[:, _STRENGTH])
    k[:, _GROWTH] = 4.0 * _SQUIRE * eddy / airspeed_m_s  # Eq. (3), per metre behind
    k.setflags(write=False)
    return k


def _sheet_centroids(count: int) -> Array:
    """(count,) centroids of equal parts of the vorticity that one half of an elliptic wing sheds; their mean is 1.

    Between u and u + du of Gamma/Gamma_0 it is shed at y = b/2 sqrt(1 - u^2).
    """
    u = np.linspace(0.0, 1.0, count + 1)
    below = 0.5 * (u * np.sqrt(1.0 - u**2) + np.arcsin(u))  # integral of sqrt(1 - u^2)
    parts = np.diff(below)
    return np.asarray(parts / np.mean(parts))


@njit(cache=True)
def wake_velocity(points_T: Array, k: Array) -> Array:
    """(n, 3) velocity [m/s] that the horseshoes of table k induce at points_T (n, 3) [m], axes T, Eq. (2)."""
    out = np.empty(points_T.shape)
    write_wake_velocity(points_T, k, out)
    return out


@njit(cache=True)
def write_wake_velocity(points_T: Array, k: Array, out: Array) -> None:
    """`wake_velocity` into an array that is there already (n, 3)."""
    for i in range(points_T.shape[0]):
        out[i, 0] = out[i, 1] = out[i, 2] = 0.0
        for j in range(k.shape[0]):
            x, y, z = points_T[i, 0] - k[j, 0], points_T[i, 1] - k[j, 1], points_T[i, 2] - k[j, 2]
            half, strength, core = k[j, 3], k[j, 4], k[j, 5]
            left, right = half - y, half + y
            xz = x * x + z * z
            left_end, right_end = np.sqrt(left * left + xz), np.sqrt(right * right + xz)
            if left_end == 0.0 or right_end == 0.0:
                continue  # on a corner: in both its cores, where nothing moves; the far leg's share has no limit there
            bound = strength / (xz + core) * (left / left_end + right / right_end)
            out[i, 0] -= bound * z
            out[i, 2] += bound * x
            grown = core + k[j, 6] * max(-x, 0.0)
            leg = strength / (left * left + z * z + grown) * (1.0 - x / left_end)  # runs forward
            out[i, 1] -= leg * z
            out[i, 2] -= leg * left
            leg = strength / (right * right + z * z + grown) * (1.0 - x / right_end)  # runs aft
            out[i, 1] += leg * z
            out[i, 2] -= leg * right
