"""How brightly a surface mirrors a light into the lens: one law for Sun and LEDs, smooth and rough.

Light from s (unit vector; distance d1, infinite for the Sun), lens toward v at distance d. A facet of the surface
mirrors one into the other if its normal is

    h = (s + v)/|s + v|,    s.h = v.h = cos i                                                                    (1)

Around a point of the surface with normal n, tangents t1, t2 and second fundamental form C (convex: positive), at x on
the tangents, the slope that a facet must have over the surface is m - B x, with

    m = (h.t1, h.t2)/h.n,    B = C + [(1 - v_t v_t')/d + (1 - s_t s_t')/d1]/(2 cos i)                            (2)

Slopes are normally distributed (Beckmann's facets); the Sun's disc, angular radius a, smears h like more of them:

    S = sigma^2 1 + (a^2/4) (1 - s_t s_t')/(4 cos^2 i)                                                           (3)
    I = E A,    A = (R/4) Int N(m - B x; S) dx / (h.n)^4                                                         (4)

with E the irradiance across the beam, R(i) Fresnel's reflectance times the material's share; A is in m^2/sr. Where all
these slopes occur on the body, the integral is 1/|det B|, rough or not: A = R r1 r2/4 far from a convex mirror, R d^2
at a plane one. Else edges bound it: a tube's ends, a facet's sides.

Not modelled: facets that shade each other, curvature that changes within the lobe, second reflections. Valid for slopes
up to 0.15 rad.
Sources: Walter et al., Microfacet models for refraction through rough surfaces, EGSR 2007 (facets); Deschamps, Ray
techniques in electromagnetics, Proc. IEEE 60, 1972 (curvature of reflected wave fronts); Born & Wolf 1.5 (Fresnel).
"""

import math

import numpy as np
from numpy.typing import NDArray

from dockair.kernels import njit
from dockair.rotations import Array
from dockair.sim.camera.mirrors import Facets
from dockair.triples import Vector, dot, plus, turned, unit

SPOT = 23  #: columns: p, n, t1, t2 (3 each), C11 C12 C22, bounds of x1 and of x2 (4), material, skin, light, geom
ROW = 11  #: columns: p (3), n (3), A, size, skin, which light, geom
_SKIN_M = 1e-3  # a ray that starts on a surface starts this far off it
_STEEPEST = 0.5  # h.n below which no facet of a rough surface stands that way
MOST_PIECES = 48  #: of a streak: 60 px long in as many points as make it look whole
_HALF_STREAK = 2.6  # standard deviations of a lobe that is cut; 1 % lies beyond and goes to the ends
_EVERYWHERE = 1e9  # [m], bounds of surfaces without edges
_FAINTEST_SHARE = 1e-9  # of a lobe
_ALL_SIGMAS = 9.0  # what lies beyond is lost in rounding
_DARK = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)

Spot = tuple[Vector, Vector, Vector, Vector, Vector]  # p, n, t1, t2, C11 C12 C22
Light = tuple[Vector, float, float]  # direction or place, 0 or 1 for which of them, a^2/4
Lamp = tuple[Light, Vector, Array]  # light, lens, finish of the surface
Box = tuple[float, float, float, float]  # bounds of x1, of x2
Lobe = tuple[float, float, float, float, float, float, float]  # A, radiance, mean (2) and covariance (3) of the patch
Poses = tuple[Array, Array]  # (ngeom, 3) places and (ngeom, 9) attitudes of the geoms
Limits = tuple[float, float, float, float]  # cosine of the grazing angle, faintest A, faintest radiance, step [rad]


@njit(cache=True)
def spot_rows(
    spots: Array,
    lights: Array,
    point: float,
    sun_variance: float,
    eye: Vector,
    finishes: Array,
    limits: Limits,
    rows: Array,
    count: int,
) -> int:
    """Append what mirror points send to the lens, streaks in pieces; return the new number of rows.

    Args:
        spots: (n, SPOT).
        lights: (m, 3) directions (unit vectors) or places [m].
        point: 0 for directions, 1 for places.
        sun_variance: a^2/4 of Eq. (3).
        eye: the lens [m].
        finishes: of `mirrors.finishes`.
        limits: dimmer ones are left out; streaks longer than the step are cut into pieces.
        rows: (k, ROW), written up to its length.
        count: rows that are there already.
    """
    for row in spots:
        light = (_vector(lights[int(row[21])], 0), point, sun_variance)
        finish, box = finishes[int(row[19])], (row[15], row[16], row[17], row[18])
        spot = (_vector(row, 0), _vector(row, 3), _vector(row, 6), _vector(row, 9), _vector(row, 12))
        lobe = _lobe(spot, box, light, eye, finish, limits[0])
        if lobe[0] == 0.0 or lobe[0] < limits[1] or lobe[1] < limits[2]:
            continue
        if box[1] >= _EVERYWHERE:
            spot = _along_patch(spot, lobe)
            lobe = _lobe(spot, box, light, eye, finish, limits[0])
        count = _pieces(spot, box, (light, eye, finish), limits, lobe, row, rows, count)
    return count


@njit(cache=True)
def _pieces(spot: Spot, box: Box, lamp: Lamp, limits: Limits, lobe: Lobe, row: Array, rows: Array, count: int) -> int:
    """Append a lobe, cut across t1 into pieces as long as it is wide."""
    light, eye, finish = lamp
    step = limits[3] * unit(plus(eye, -1.0, spot[0]))[1]
    half, width = _HALF_STREAK * math.sqrt(lobe[4]), max(math.sqrt(12.0 * lobe[6]), step)
    first, last = max(lobe[2] - half, box[0]), min(lobe[2] + half, box[1])
    streak = math.sqrt(12.0 * lobe[4]) >= 1.5 * width
    pieces = min(int((last - first) / width + 0.5), MOST_PIECES) if streak else 1
    for k in range(pieces):
        low = box[0] if k == 0 else first + k / pieces * (last - first)
        high = box[1] if k == pieces - 1 else first + (k + 1) / pieces * (last - first)
        part = _lobe(spot, (low, high, box[2], box[3]), light, eye, finish, limits[0]) if pieces > 1 else lobe
        if part[0] > 0.0 and count < len(rows):
            _write(rows[count], spot, part, (row[20], row[21], row[22]))
            count += 1
    return count


@njit(cache=True)
def facet_rows(
    facets: Facets,
    which: NDArray[np.int64],
    poses: Poses,
    light: Light,
    eye: Vector,
    finishes: Array,
    limits: Limits,
    rows: Array,
    count: int,
) -> int:
    """Append what facets, `which` of all, send of the Sun to the lens; other arguments as of `spot_rows`."""
    xpos, xmat = poses
    for i in which:
        g, frame, half, finish = facets.geom[i], facets.frame[i], facets.half[i], finishes[facets.material[i]]
        p, n = plus(_vector(xpos[g], 0), 1.0, turned(xmat[g], frame[0])), turned(xmat[g], frame[1])
        spot = (p, n, turned(xmat[g], frame[2]), turned(xmat[g], frame[3]), _vector(facets.curvature[i], 0))
        box = (-half[0], half[0], -half[1], half[1])
        lobe = _lobe(spot, box, light, eye, finish, limits[0])
        if lobe[0] == 0.0:
            continue
        spot, box = _nearer(spot, box, light, eye)  # where it is bright, Eq. (2)'s linear map is better
        lobe = _lobe(spot, box, light, eye, finish, limits[0])
        if lobe[0] > 0.0 and lobe[0] >= limits[1] and lobe[1] >= limits[2] and count < len(rows):
            _write(rows[count], spot, lobe, (_SKIN_M, 0.0, float(g)))
            count += 1
    return count


@njit(cache=True)
def _write(row: Array, spot: Spot, lobe: Lobe, labels: Vector) -> None:
    """The patch's middle, put back onto the surface to second order in x, its normal there; skin, light and geom."""
    p, n, t1, t2, c = spot
    area, _, x1, x2, var1, _, var2 = lobe
    m1, m2 = c[0] * x1 + c[1] * x2, c[1] * x1 + c[2] * x2
    middle = plus(plus(plus(p, x1, t1), x2, t2), -0.5 * (m1 * x1 + m2 * x2), n)
    normal, _ = unit(plus(plus(n, m1, t1), m2, t2))
    for k in range(3):
        row[k], row[3 + k] = middle[k], normal[k]
    row[6], row[7] = area, math.sqrt(6.0 * (var1 + var2))
    row[8], row[9], row[10] = labels


@njit(cache=True)
def _nearer(spot: Spot, box: Box, light: Light, eye: Vector) -> tuple[Spot, Box]:
    """Move to the mirror point, or to the box's edge on the way there."""
    p, n, t1, t2, c = spot
    m1, m2, b11, b12, b22 = _slopes(spot, light, eye)
    det = b11 * b22 - b12 * b12
    x1 = min(max((b22 * m1 - b12 * m2) / det, box[0]), box[1])
    x2 = min(max((b11 * m2 - b12 * m1) / det, box[2]), box[3])
    c1, c2 = c[0] * x1 + c[1] * x2, c[1] * x1 + c[2] * x2
    p = plus(plus(plus(p, x1, t1), x2, t2), -0.5 * (c1 * x1 + c2 * x2), n)
    n, _ = unit(plus(plus(n, c1, t1), c2, t2))
    t1, _ = unit(plus(t1, -dot(t1, n), n))
    t2, _ = unit(plus(plus(t2, -dot(t2, n), n), -dot(t2, t1), t1))
    return (p, n, t1, t2, c), (box[0] - x1, box[1] - x1, box[2] - x2, box[3] - x2)


@njit(cache=True)
def _along_patch(spot: Spot, lobe: Lobe) -> Spot:
    """Turn the tangents so that the patch is longest along t1."""
    p, n, t1, t2, c = spot
    angle = 0.5 * math.atan2(2.0 * lobe[5], lobe[4] - lobe[6])
    cos, sin = math.cos(angle), math.sin(angle)
    u1 = (cos * t1[0] + sin * t2[0], cos * t1[1] + sin * t2[1], cos * t1[2] + sin * t2[2])
    u2 = (cos * t2[0] - sin * t1[0], cos * t2[1] - sin * t1[1], cos * t2[2] - sin * t1[2])
    c11 = cos * cos * c[0] + 2.0 * cos * sin * c[1] + sin * sin * c[2]
    c12 = cos * sin * (c[2] - c[0]) + (cos * cos - sin * sin) * c[1]
    return p, n, u1, u2, (c11, c12, c[0] + c[2] - c11)


@njit(cache=True)
def _vector(row: Array, first: int) -> Vector:
    return row[first], row[first + 1], row[first + 2]


@njit(cache=True)
def reflectance(cos_i: float, finish: Array) -> float:
    """R of Eq. (4): Fresnel's for unpolarised light on a dielectric, Schlick's form on metal."""
    index, metal, share = finish[0], finish[1], finish[2]
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
    if a < -_ALL_SIGMAS and b > _ALL_SIGMAS:
        return 1.0, mean, sd * sd
    root = math.sqrt(2.0)
    if b - a < 1e-3:  # the differences below would cancel
        middle = 0.5 * (a + b)
        part = math.exp(-0.5 * middle * middle) / math.sqrt(2.0 * math.pi) * (b - a)
        return part, 0.5 * (low + high), (high - low) ** 2 / 12.0
    if a > 0.0:
        part = 0.5 * (math.erfc(a / root) - math.erfc(b / root))
    elif b < 0.0:
        part = 0.5 * (math.erfc(-b / root) - math.erfc(-a / root))
    else:
        part = 0.5 * (math.erf(b / root) - math.erf(a / root))
    if part < _FAINTEST_SHARE:
        return 0.0, mean, sd * sd
    phi_a, phi_b = math.exp(-0.5 * a * a) / math.sqrt(2.0 * math.pi), math.exp(-0.5 * b * b) / math.sqrt(2.0 * math.pi)
    shift = (phi_a - phi_b) / part
    variance = 1.0 + (a * phi_a - b * phi_b) / part - shift * shift
    return part, mean + sd * shift, sd * sd * max(variance, 0.0)


@njit(cache=True)
def _slopes(spot: Spot, light: Light, eye: Vector) -> tuple[float, float, float, float, float]:
    """Eq. (2): m1, m2, B11, B12, B22."""
    p, n, t1, t2, c = spot
    s, d1 = unit(plus(light[0], -light[1], p))
    v, d = unit(plus(eye, -1.0, p))
    h, twice = unit(plus(s, 1.0, v))
    k, near, hn = 1.0 / twice, light[1] / d1, dot(h, n)
    s1, s2, v1, v2 = dot(s, t1), dot(s, t2), dot(v, t1), dot(v, t2)
    b11 = c[0] + k * ((1.0 - v1 * v1) / d + (1.0 - s1 * s1) * near)
    b12 = c[1] - k * (v1 * v2 / d + s1 * s2 * near)
    b22 = c[2] + k * ((1.0 - v2 * v2) / d + (1.0 - s2 * s2) * near)
    return dot(h, t1) / hn, dot(h, t2) / hn, b11, b12, b22


@njit(cache=True)
def _lobe(spot: Spot, box: Box, light: Light, eye: Vector, finish: Array, cos_grazing: float) -> Lobe:
    """Eqs. (2) to (4).

    The radiance is the patch's middle's, over a white Lambertian surface's in normal sunlight.
    """
    p, n, t1, t2, _ = spot
    s, _ = unit(plus(light[0], -light[1], p))
    v, _ = unit(plus(eye, -1.0, p))
    h, twice = unit(plus(s, 1.0, v))
    hn, vn = dot(h, n), dot(v, n)
    if dot(s, n) <= 0.0 or vn <= 0.0 or 0.5 * twice < cos_grazing or hn < _STEEPEST:
        return _DARK
    m1, m2, b11, b12, b22 = _slopes(spot, light, eye)
    s1, s2, q, rough = dot(s, t1), dot(s, t2), light[2] / (twice * twice), finish[3] ** 2
    v11, v12, v22 = rough + q * (1.0 - s1 * s1), -q * s1 * s2, rough + q * (1.0 - s2 * s2)
    det, det_v = b11 * b22 - b12 * b12, v11 * v22 - v12 * v12
    if abs(det) < 1e-20:
        return _DARK
    i11, i12, i22 = b22 / det, -b12 / det, b11 / det
    a11, a12, a21, a22 = i11 * v11 + i12 * v12, i11 * v12 + i12 * v22, i12 * v11 + i22 * v12, i12 * v12 + i22 * v22
    p11, p12, p22 = a11 * i11 + a12 * i12, a11 * i12 + a12 * i22, a21 * i12 + a22 * i22
    x1, x2, ratio = i11 * m1 + i12 * m2, i12 * m1 + i22 * m2, p12 / p11
    part1, mean1, var1 = _strip(box[0], box[1], x1, math.sqrt(p11))
    rest = math.sqrt(max(p22 - ratio * p12, 1e-12 * p22))
    part2, mean2, var2 = _strip(box[2], box[3], x2 + ratio * (mean1 - x1), rest)
    reflected = reflectance(0.5 * twice, finish) / hn**4
    e1, e2 = m1 - b11 * mean1 - b12 * mean2, m2 - b12 * mean1 - b22 * mean2
    exponent = 0.5 * (v22 * e1 * e1 - 2.0 * v12 * e1 * e2 + v11 * e2 * e2) / det_v
    radiance = reflected / (8.0 * vn * math.sqrt(det_v)) * math.exp(-exponent)
    area = 0.25 * reflected * part1 * part2 / abs(det)
    return area, radiance, mean1, mean2, var1, ratio * var1, var2 + ratio * ratio * var1
