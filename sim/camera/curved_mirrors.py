"""Mirror points of lights on ellipsoids and on the basket's rim, by Newton's method on the law of reflection.

At a point with normal n, tangents t1, t2 and second fundamental form C (convex: positive), let a facet have to stand m
steeper than the surface to mirror the light into the lens; at x on the tangents it must by m - B x [lobes, eq 2]. The
mirror point is the limit of

    x = B^-1 m,    p <- p + x, put back onto the surface                                                         (1)
    ellipsoid, half-axes A = diag(a, b, c):  p <- (p + x)/|A^-1 (p + x)|,  n ~ A^-2 p,  C = t' A^-2 t/|A^-2 p|    (2)
    torus R, r about x, ring angle f, tube angle g:  p = (R + r cos g) e(f) + r sin g x
        C = 1/r along the tube's circle,  cos g/(R + r cos g) along the ring                                     (3)

On the torus the search starts where light and eye would mirror far away, on the ring's outer and inner side; for LEDs,
which sit on the ring, at their own angle and across from it.
Source: do Carmo, Differential Geometry of Curves and Surfaces, section 3-3 (curvatures).
"""

import math

from dockair.kernels import njit
from dockair.rotations import Array
from dockair.sim.camera.mirrors import Balls
from dockair.triples import Vector, dot, plus, tangents, turned, turned_back, unit

_STEPS, _CLOSE_RAD = 40, 1e-10
_LONGEST_TURN_RAD = 0.5  # of the normal in one step
_EVERYWHERE = 1e9  # [m], for surfaces without edges
_SKIN_M = 1e-3  # a ray that starts on a surface starts this far off it

Torus = tuple[Vector, Vector, float, float]  # centre, axis, R, r


@njit(cache=True)
def ellipsoid_spots(
    balls: Balls, xpos: Array, xmat: Array, lights: Array, point: float, eye: Vector, spots: Array
) -> int:
    """Fill rows with the mirror points on ellipsoids that are no spheres; arguments as of `round_spots`."""
    count = 0
    for j in range(len(lights)):
        for i in range(len(balls.geom)):
            g, axes = balls.geom[i], (balls.axes[i, 0], balls.axes[i, 1], balls.axes[i, 2])
            if axes[0] == axes[1] == axes[2]:
                continue
            M, at = xmat[g], (xpos[g, 0], xpos[g, 1], xpos[g, 2])
            light = turned_back(M, plus((lights[j, 0], lights[j, 1], lights[j, 2]), -point, at))
            found, p, n, t1, t2, c = _on_ellipsoid(axes, light, point, turned_back(M, plus(eye, -1.0, at)))
            if found and abs(n[balls.thin[i]]) <= balls.most_cos[i]:
                out = spots[count]
                _write(out, plus(at, 1.0, turned(M, p)), turned(M, n), turned(M, t1), turned(M, t2), c)
                out[19], out[20], out[21], out[22] = balls.material[i], _SKIN_M, j, g
                count += 1
    return count


@njit(cache=True)
def rim_spots(torus: Torus, labels: Vector, lights: Array, point: float, eye: Vector, spots: Array) -> int:
    """Fill rows with up to two mirror points a light on a torus, its material, skin and geom in `labels`.

    The other arguments as of `round_spots`.
    """
    centre, axis, radius, tube = torus
    count = 0
    for j in range(len(lights)):
        light = (lights[j, 0], lights[j, 1], lights[j, 2])
        for side in (1.0, -1.0):
            found, p, n, t1, t2, c = _on_torus(torus, light, point, eye, side)
            if found:
                out = spots[count]
                _write(out, p, n, t1, t2, c)
                out[15], out[16] = -radius, radius  # an arc of 1 rad to either side: further on it turns away
                out[19], out[20], out[21], out[22] = labels[0], labels[1], j, labels[2]
                count += 1
    return count


@njit(cache=True)
def _write(row: Array, p: Vector, n: Vector, t1: Vector, t2: Vector, c: Vector) -> None:
    for k in range(3):
        row[k], row[3 + k], row[6 + k], row[9 + k], row[12 + k] = p[k], n[k], t1[k], t2[k], c[k]
    row[15], row[16], row[17], row[18] = -_EVERYWHERE, _EVERYWHERE, -_EVERYWHERE, _EVERYWHERE


@njit(cache=True)
def _bisector(p: Vector, light: Vector, point: float, eye: Vector) -> tuple[Vector, float]:
    s, _ = unit(plus(light, -point, p))
    v, _ = unit(plus(eye, -1.0, p))
    h, twice = unit(plus(s, 1.0, v))
    return h, 0.5 * twice


@njit(cache=True)
def _move(
    p: Vector, n: Vector, t1: Vector, t2: Vector, c: Vector, light: Vector, point: float, eye: Vector
) -> tuple[float, float, float]:
    """Eq. (1): x1, x2 and the slope m."""
    s, d1 = unit(plus(light, -point, p))
    v, d = unit(plus(eye, -1.0, p))
    h, twice = unit(plus(s, 1.0, v))
    k, near = 1.0 / max(twice, 1e-9), point / d1
    s1, s2, v1, v2 = dot(s, t1), dot(s, t2), dot(v, t1), dot(v, t2)
    b11 = c[0] + k * ((1.0 - v1 * v1) / d + (1.0 - s1 * s1) * near)
    b12 = c[1] - k * (v1 * v2 / d + s1 * s2 * near)
    b22 = c[2] + k * ((1.0 - v2 * v2) / d + (1.0 - s2 * s2) * near)
    h1, h2, hn = dot(h, t1), dot(h, t2), dot(h, n)
    angle = math.atan2(math.sqrt(h1 * h1 + h2 * h2), hn)
    size = min(angle, _LONGEST_TURN_RAD) / max(math.sqrt(h1 * h1 + h2 * h2), 1e-300)
    m1, m2, det = size * h1, size * h2, b11 * b22 - b12 * b12
    if abs(det) < 1e-12:
        return 0.0, 0.0, angle
    return (b22 * m1 - b12 * m2) / det, (b11 * m2 - b12 * m1) / det, angle


@njit(cache=True)
def _on_ellipsoid(
    axes: Vector, light: Vector, point: float, eye: Vector
) -> tuple[bool, Vector, Vector, Vector, Vector, Vector]:
    """Found, point, normal, tangents, C11 C12 C22 in the ellipsoid's own axes, Eqs. (1) and (2)."""
    a2, b2, c2 = axes[0] ** 2, axes[1] ** 2, axes[2] ** 2
    h, _ = _bisector((0.0, 0.0, 0.0), light, point, eye)
    p = (a2 * h[0], b2 * h[1], c2 * h[2])
    k = 1.0 / math.sqrt(max(dot(p, h), 1e-300))
    p, angle = (k * p[0], k * p[1], k * p[2]), 1.0
    n, t1, t2, c = h, h, h, h
    for _ in range(_STEPS):
        n, slope = unit((p[0] / a2, p[1] / b2, p[2] / c2))
        t1, t2 = tangents(n)
        w = (t1[0] / a2, t1[1] / b2, t1[2] / c2)
        c = (dot(t1, w) / slope, dot(t2, w) / slope, (t2[0] ** 2 / a2 + t2[1] ** 2 / b2 + t2[2] ** 2 / c2) / slope)
        x1, x2, angle = _move(p, n, t1, t2, c, light, point, eye)
        if angle < _CLOSE_RAD:
            break
        p = plus(plus(p, x1, t1), x2, t2)
        k = 1.0 / math.sqrt(p[0] ** 2 / a2 + p[1] ** 2 / b2 + p[2] ** 2 / c2)
        p = (k * p[0], k * p[1], k * p[2])
    return angle < _CLOSE_RAD, p, n, t1, t2, c


@njit(cache=True)
def _on_torus(
    torus: Torus, light: Vector, point: float, eye: Vector, side: float
) -> tuple[bool, Vector, Vector, Vector, Vector, Vector]:
    """Found, point, normal, tangents along ring and tube circle, C11 C12 C22, Eqs. (1) and (3)."""
    centre, axis, radius, tube = torus
    y, z = tangents(axis)
    start, _ = _bisector(centre, light, point, eye)
    if point > 0.0:
        start = plus(light, -1.0, centre)
    f = math.atan2(side * dot(start, z), side * dot(start, y))
    e = plus(plus((0.0, 0.0, 0.0), math.cos(f), y), math.sin(f), z)
    h, _ = _bisector(plus(centre, radius, e), light, point, eye)
    g, angle = math.atan2(dot(h, axis), dot(h, e)), 1.0
    p, n, t1, t2, c = e, e, e, e, e
    for _ in range(_STEPS):
        e = plus(plus((0.0, 0.0, 0.0), math.cos(f), y), math.sin(f), z)
        cos_g, sin_g = math.cos(g), math.sin(g)
        n = plus((cos_g * e[0], cos_g * e[1], cos_g * e[2]), sin_g, axis)
        t1 = plus(plus((0.0, 0.0, 0.0), -math.sin(f), y), math.cos(f), z)
        t2 = plus((-sin_g * e[0], -sin_g * e[1], -sin_g * e[2]), cos_g, axis)
        arm = radius + tube * cos_g
        p, c = plus(plus(centre, radius, e), tube, n), (cos_g / arm, 0.0, 1.0 / tube)
        x1, x2, angle = _move(p, n, t1, t2, c, light, point, eye)
        if angle < _CLOSE_RAD:
            break
        f += min(max(x1 / arm, -_LONGEST_TURN_RAD), _LONGEST_TURN_RAD)
        g += min(max(x2 / tube, -_LONGEST_TURN_RAD), _LONGEST_TURN_RAD)
    return angle < _CLOSE_RAD, p, n, t1, t2, c
