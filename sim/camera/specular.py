"""Where a surface mirrors a light into the lens, and how brightly: one law for Sun and LEDs, smooth and rough.

Light from s (unit vector; distance d1, infinite for the Sun), lens toward v at distance d. A facet of the surface
mirrors one into the other if its normal is

    h = (s + v)/|s + v|,    s.h = v.h = cos i                                                                    (1)

Around a point p of the surface with normal n, tangents t1, t2 and second fundamental form C (convex: positive), at x on
the tangents, the slope that a facet must have over the surface is m(x) = m - B x with

    m = (h.t1, h.t2)/h.n,    B = C + [(1 - v_t v_t')/d + (1 - s_t s_t')/d1]/(2 cos i)                            (2)

Slopes are normally distributed (Beckmann's facets); the Sun's disc, angular radius a, smears h like more of them:

    S = sigma^2 1 + (a^2/4) (1 - s_t s_t')/(4 cos^2 i)                                                           (3)
    I = E A,    A = (R/4) Int N(m - B x; S) dx / (h.n)^4,    E: irradiance across the beam, R(i): Fresnel        (4)

A is in m^2/sr. If all slopes occur on the body, the integral is 1/|det B|, roughness or not: R r1 r2/4 far away from a
convex mirror, R d^2 at a plane one. Where its edge cuts the lobe, a tube's length or a facet's sides bound the integral.
On tubes and spheres the mirror point is the root of equal angles in one plane; on ellipsoids and the rim it is the
limit of x = B^-1 m.

Not modelled: facets that shade each other, curvature that changes within the lobe, more than one reflection, LEDs'
size. Valid for slopes up to 0.15 rad.
Sources: Walter et al., Microfacet models for refraction through rough surfaces, EGSR 2007 (facets); Deschamps, Ray
techniques in electromagnetics, Proc. IEEE 60, 1972 (curvature of reflected wave fronts); Born & Wolf 1.5 (Fresnel).
"""

import math

import numpy as np
from numba import njit
from numpy.typing import NDArray

from dockair.rotations import Array
from dockair.sim.camera.mirrors import Balls, Facets, Tubes

ROW = 9  #: columns of a row: p (3), n (3), A or I, size, skin
_SKIN_M = 1e-3  # a ray that starts on a surface starts this far off it
_EVERYWHERE = 1e9  # [m], for surfaces without edges
_NEWTON_STEPS, _CLOSE = 30, 1e-12
_STEEPEST = 0.5  # h.n below which no facet of a rough surface stands that way; also Newton's largest turn [rad]
_FLATTEST = 0.05  # of the rim's radius: where it would focus, its waviness limits it
_MOST_PIECES = 8  # of a streak
_REACH = 2.5  # standard deviations of a streak that its pieces divide; the outer ones take the rest
_FAINTEST_SHARE = 1e-9  # of a lobe

Vector = tuple[float, float, float]
Light = tuple[Vector, float, float]  # direction or place, 0 or 1 for which of them, a^2/4
Spot = tuple[Vector, Vector, Vector, Vector, float, float, float]  # p, n, t1, t2, C11, C12, C22
Box = tuple[float, float, float, float]  # low and high x1, low and high x2
Finish = tuple[float, float, float, float]  # a row of `finishes`
Limits = tuple[float, float, float, float]  # cos of the grazing angle, faintest A, faintest radiance, step [rad]


@njit(cache=True)
def _dot(a: Vector, b: Vector) -> float:
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@njit(cache=True)
def _cross(a: Vector, b: Vector) -> Vector:
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


@njit(cache=True)
def _add(a: Vector, k: float, b: Vector) -> Vector:
    """A + k b."""
    return a[0] + k * b[0], a[1] + k * b[1], a[2] + k * b[2]


@njit(cache=True)
def _unit(a: Vector) -> tuple[Vector, float]:
    length = math.sqrt(_dot(a, a))
    k = 1.0 / max(length, 1e-300)
    return (k * a[0], k * a[1], k * a[2]), length


@njit(cache=True)
def _vector(a: Array) -> Vector:
    return a[0], a[1], a[2]


@njit(cache=True)
def _turned(M: Array, a: Vector) -> Vector:
    """M a, with M (9,) by rows."""
    return (
        M[0] * a[0] + M[1] * a[1] + M[2] * a[2],
        M[3] * a[0] + M[4] * a[1] + M[5] * a[2],
        M[6] * a[0] + M[7] * a[1] + M[8] * a[2],
    )


@njit(cache=True)
def _turned_back(M: Array, a: Vector) -> Vector:
    """M' a."""
    return (
        M[0] * a[0] + M[3] * a[1] + M[6] * a[2],
        M[1] * a[0] + M[4] * a[1] + M[7] * a[2],
        M[2] * a[0] + M[5] * a[1] + M[8] * a[2],
    )


@njit(cache=True)
def _across(n: Vector) -> tuple[Vector, Vector]:
    """Two unit vectors that make a right-handed frame with n: n x t1 = t2."""
    helper = (1.0, 0.0, 0.0) if abs(n[0]) < 0.7 else (0.0, 1.0, 0.0)
    t1, _ = _unit(_cross(n, helper))
    return t1, _cross(n, t1)


@njit(cache=True)
def _reflectance(cos_i: float, finish: Finish) -> float:
    """R of Eq. (4): Fresnel's for unpolarised light on a dielectric, Schlick's form on metal, times the share."""
    index, metal, share, _ = finish
    if index == 0.0:
        return share * (metal + (1.0 - metal) * (1.0 - cos_i) ** 5)
    cos_r = math.sqrt(1.0 - (1.0 - cos_i * cos_i) / (index * index))
    across = (cos_i - index * cos_r) / (cos_i + index * cos_r)
    along = (cos_r - index * cos_i) / (cos_r + index * cos_i)
    return 0.5 * share * (across * across + along * along)


@njit(cache=True)
def _strip(low: float, high: float, mean: float, sd: float) -> tuple[float, float, float]:
    """Part of a normal distribution between two bounds, and the mean and variance of that part."""
    a, b = (low - mean) / sd, (high - mean) / sd
    phi_a, phi_b = math.exp(-0.5 * a * a) / math.sqrt(2.0 * math.pi), math.exp(-0.5 * b * b) / math.sqrt(2.0 * math.pi)
    if b - a < 1e-3:  # differences of the functions below would cancel
        middle = 0.5 * (a + b)
        part = math.exp(-0.5 * middle * middle) / math.sqrt(2.0 * math.pi) * (b - a)
        return part, 0.5 * (low + high), (high - low) ** 2 / 12.0
    if a > 0.0:
        part = 0.5 * (math.erfc(a / math.sqrt(2.0)) - math.erfc(b / math.sqrt(2.0)))
    elif b < 0.0:
        part = 0.5 * (math.erfc(-b / math.sqrt(2.0)) - math.erfc(-a / math.sqrt(2.0)))
    else:
        part = 0.5 * (math.erf(b / math.sqrt(2.0)) - math.erf(a / math.sqrt(2.0)))
    if part < _FAINTEST_SHARE:
        return 0.0, mean, sd * sd
    shift = (phi_a - phi_b) / part
    variance = 1.0 + (a * phi_a - b * phi_b) / part - shift * shift
    return part, mean + sd * shift, sd * sd * max(variance, 0.0)


@njit(cache=True)
def _legs(p: Vector, light: Light, eye: Vector) -> tuple[Vector, float, Vector, float, Vector, float]:
    """Eq. (1) at a point: s, 1/d1, v, d, h, cos i."""
    toward, point, _ = light
    s, d1 = _unit(_add(toward, -point, p))
    v, d = _unit(_add(eye, -1.0, p))
    h, twice = _unit(_add(s, 1.0, v))
    return s, point / d1, v, d, h, 0.5 * twice


@njit(cache=True)
def _slopes(spot: Spot, light: Light, eye: Vector) -> tuple[float, float, float, float, float]:
    """Eq. (2): m1, m2, B11, B12, B22."""
    p, n, t1, t2, c11, c12, c22 = spot
    s, near, v, d, h, cos_i = _legs(p, light, eye)
    k = 0.5 / max(cos_i, 1e-12)
    s1, s2, v1, v2 = _dot(s, t1), _dot(s, t2), _dot(v, t1), _dot(v, t2)
    hn = max(_dot(h, n), _STEEPEST)
    return (
        _dot(h, t1) / hn,
        _dot(h, t2) / hn,
        c11 + k * ((1.0 - v1 * v1) / d + (1.0 - s1 * s1) * near),
        c12 - k * (v1 * v2 / d + s1 * s2 * near),
        c22 + k * ((1.0 - v2 * v2) / d + (1.0 - s2 * s2) * near),
    )


@njit(cache=True)
def _lobe(
    spot: Spot, box: Box, light: Light, eye: Vector, finish: Finish, cos_grazing: float
) -> tuple[float, float, float, float, float, float]:
    """Eqs. (3) and (4): A, radiance, and mean and variance of the bright patch along t1 and t2.

    The radiance is the brightest point's, over a white Lambertian surface's in normal sunlight.
    """
    _, n, t1, t2, _, _, _ = spot
    s, _, v, _, h, cos_i = _legs(spot[0], light, eye)
    hn, vn = _dot(h, n), _dot(v, n)
    if _dot(s, n) <= 0.0 or vn <= 0.0 or cos_i < cos_grazing or hn < _STEEPEST:
        return 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    m1, m2, b11, b12, b22 = _slopes(spot, light, eye)
    s1, s2, q = _dot(s, t1), _dot(s, t2), light[2] / (4.0 * cos_i * cos_i)
    v11, v12, v22 = finish[3] ** 2 + q * (1.0 - s1 * s1), -q * s1 * s2, finish[3] ** 2 + q * (1.0 - s2 * s2)
    det = b11 * b22 - b12 * b12
    i11, i12, i22 = b22 / det, -b12 / det, b11 / det
    a11, a12, a21, a22 = i11 * v11 + i12 * v12, i11 * v12 + i12 * v22, i12 * v11 + i22 * v12, i12 * v12 + i22 * v22
    p11, p12, p22 = a11 * i11 + a12 * i12, a11 * i12 + a12 * i22, a21 * i12 + a22 * i22
    x1, x2 = i11 * m1 + i12 * m2, i12 * m1 + i22 * m2
    part1, mean1, var1 = _strip(box[0], box[1], x1, math.sqrt(p11))
    if part1 == 0.0:
        return 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    ratio = p12 / p11
    rest = max(p22 - ratio * p12, 1e-12 * p22)
    part2, mean2, var2 = _strip(box[2], box[3], x2 + ratio * (mean1 - x1), math.sqrt(rest))
    reflected = _reflectance(cos_i, finish) / hn**4
    area = 0.25 * reflected * part1 * part2 / abs(det)
    e1, e2 = m1 - b11 * mean1 - b12 * mean2, m2 - b12 * mean1 - b22 * mean2
    det_v = v11 * v22 - v12 * v12
    exponent = 0.5 * (v22 * e1 * e1 - 2.0 * v12 * e1 * e2 + v11 * e2 * e2) / det_v
    radiance = reflected / (8.0 * vn * math.sqrt(det_v)) * math.exp(-exponent)
    return area, radiance, mean1, mean2, var1, var2 + ratio * ratio * var1


@njit(cache=True)
def _incidence(x: float, q: float) -> float:
    """Angle of incidence at a circle's point, x from the direction of something at 1/q radii from the centre."""
    return math.atan2(math.sin(x), math.cos(x) - q)


@njit(cache=True)
def _mirror_angle(q_s: float, q_c: float, gamma: float) -> float:
    """On a circle, the angle from the light's direction to the mirror point; the eye's is gamma.

    The incidences grow and fall with it, so that there is one root: Newton's, kept in [0, gamma].
    """
    x = gamma * (1.0 - q_s) / (2.0 - q_s - q_c)
    for _ in range(_NEWTON_STEPS):
        y = gamma - x
        error = _incidence(x, q_s) - _incidence(y, q_c)
        slope_x = (1.0 - q_s * math.cos(x)) / (1.0 + q_s * q_s - 2.0 * q_s * math.cos(x))
        slope_y = (1.0 - q_c * math.cos(y)) / (1.0 + q_c * q_c - 2.0 * q_c * math.cos(y))
        step = error / (slope_x + slope_y)
        x = min(max(x - step, 0.0), gamma)
        if abs(step) < _CLOSE:
            break
    return x


@njit(cache=True)
def _circle_normal(
    to_light: Vector, point: float, to_eye: Vector, radius: float, spare: Vector
) -> tuple[bool, Vector, float, float]:
    """Normal at the mirror point of a circle (or sphere) about the origin; 1/d and distance of what it was given.

    `spare` is across the plane's first axis, for when light and eye stand in one direction.
    """
    e, ds = _unit(to_light)
    f, dc = _unit(to_eye)
    q_s, q_c = point * radius / ds, radius / dc
    if q_s >= 1.0 or q_c >= 1.0:
        return False, e, ds, dc
    cos_gamma = _dot(e, f)
    g = _add(f, -cos_gamma, e)
    sin_gamma = math.sqrt(_dot(g, g))
    g = _unit(g)[0] if sin_gamma > 1e-12 else spare
    x = _mirror_angle(q_s, q_c, math.atan2(sin_gamma, cos_gamma))
    n = _add((math.cos(x) * e[0], math.cos(x) * e[1], math.cos(x) * e[2]), math.sin(x), g)
    return True, n, ds, dc


@njit(cache=True)
def _on_sphere(centre: Vector, radius: float, light: Light, eye: Vector) -> tuple[bool, Spot]:
    to_light = _add(light[0], -light[1], centre)
    spare = _across(_unit(to_light)[0])[0]
    found, n, _, _ = _circle_normal(to_light, light[1], _add(eye, -1.0, centre), radius, spare)
    t1, t2 = _across(n)
    return found, (_add(centre, radius, n), n, t1, t2, 1.0 / radius, 0.0, 1.0 / radius)


@njit(cache=True)
def _on_tube(
    centre: Vector, axis: Vector, radius: float, half: float, light: Light, eye: Vector
) -> tuple[bool, Spot, float]:
    """The mirror point, or where the tube ends before it; third, its place along the axis.

    Along the axis the ray goes straight on; across it, the circle mirrors.
    """
    to_light, to_eye = _add(light[0], -light[1], centre), _add(eye, -1.0, centre)
    along_s, along_c = _dot(to_light, axis), _dot(to_eye, axis)
    flat_s, flat_c = _add(to_light, -along_s, axis), _add(to_eye, -along_c, axis)
    spare = _cross(axis, _unit(flat_s)[0])
    found, n, ds, _ = _circle_normal(flat_s, light[1], flat_c, radius, spare)
    l_c = math.sqrt(max(_dot(flat_c, flat_c) - 2.0 * radius * _dot(flat_c, n) + radius * radius, 0.0))
    if light[1] == 0.0:
        x = along_c + l_c * along_s / max(ds, 1e-12)
    else:
        l_s = math.sqrt(max(_dot(flat_s, flat_s) - 2.0 * radius * _dot(flat_s, n) + radius * radius, 0.0))
        x = (along_s * l_c + along_c * l_s) / max(l_s + l_c, 1e-12)
    x = min(max(x, -half), half)
    p = _add(_add(centre, x, axis), radius, n)
    return found and ds > 1e-9, (p, n, axis, _cross(axis, n), 0.0, 0.0, 1.0 / radius), x
