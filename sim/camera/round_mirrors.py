"""Mirror points of lights on spheres and tubes: the angles are equal in one plane.

On a circle of radius r seen from its centre, light at distance ds in direction 0, eye at dc in direction g, the mirror
point stands at the angle x where both incidences agree:

    i(x, r/ds) = i(g - x, r/dc),    i(x, q) = atan2(sin x, cos x - q)      one root, as i grows with x             (1)

A sphere is such a circle in the plane of its centre, light and eye. A tube is one in projection along its axis, and
along the axis the ray goes straight on: at shares l_s : l_c of the projected legs,

    z = (z_s l_c + z_c l_s)/(l_s + l_c),    Sun: z = z_c + l_c (s.a)/|s - s.a a|                                  (2)

A tube that ends before that is taken at its end. A tube whose facets would have to lean so far along its axis that next
to none do is left out before. Everything here is in W. Source: law of reflection.
"""

import math

import numpy as np
from numpy.typing import NDArray

from dockair.kernels import njit
from dockair.rotations import Array
from dockair.sim.camera.mirrors import Balls, Tubes
from dockair.triples import Vector, cross, dot, plus, tangents, unit

_NEWTON_STEPS = 30
_SMALL = 0.01  # angles [rad] whose series end within 1e-15
_CLOSE = 1e-8  # after a step so short the rest is its square
_EVERYWHERE = 1e9  # [m], for surfaces without edges
_SKIN_M = 1e-3  # a ray that starts on a surface starts this far off it
_STEEPEST = 1.765  # slope along a tube from which h.n < 1/2 around it, the limit of `lobes`
_MOST_SIGMAS = 7.0  # of slopes: less than 1e-9 of the facets lean farther, `lobes` leaves out such shares

Spread = tuple[float, float]  # rms slope of a finish; of the light, half the Sun's angular radius [rad]


@njit(cache=True)
def round_spots(
    balls: Balls,
    tubes: Tubes,
    xpos: Array,
    xmat: Array,
    lights: Array,
    point: float,
    wanted: NDArray[np.bool_],
    eye: Vector,
    finishes: Array,
    variance: float,
    spots: Array,
) -> int:
    """Fill rows of `lobes.SPOT` columns with the mirror points; return how many.

    Args:
        balls: ellipsoids among them are left out.
        tubes: of `Mirrors`.
        xpos: (ngeom, 3) of the geoms [m].
        xmat: (ngeom, 9).
        lights: (m, 3) directions (unit vectors) or places [m].
        point: 0 for directions, 1 for places.
        wanted: (m, balls + tubes) which pairs to look at.
        eye: the lens [m].
        finishes: of `mirrors.finishes`.
        variance: a^2/4 of [lobes, eq 3].
        spots: (at least m (balls + tubes), SPOT), written.
    """
    count, disc = 0, math.sqrt(variance)
    for j in range(len(lights)):
        toward = (lights[j, 0], lights[j, 1], lights[j, 2])
        for i in range(len(balls.geom)):
            radius, g = balls.axes[i, 0], balls.geom[i]
            if not (wanted[j, i] and radius == balls.axes[i, 1] == balls.axes[i, 2]):
                continue
            z = (xmat[g, 2], xmat[g, 5], xmat[g, 8])
            centre = plus((xpos[g, 0], xpos[g, 1], xpos[g, 2]), balls.at_z[i], z)
            found, n = _on_ball(centre, z, balls.side[i], radius, toward, point, eye)
            if found:
                p, (t1, t2), c, endless = (
                    plus(centre, radius, n),
                    tangents(n),
                    1.0 / radius,
                    (-_EVERYWHERE, _EVERYWHERE),
                )
                _write(spots, count, (p, n, t1, t2), (c, c), endless, (balls.material[i], j, g))
                count += 1
        for i in range(len(tubes.geom)):
            if not wanted[j, len(balls.geom) + i]:
                continue
            g, radius, half, material = tubes.geom[i], tubes.radius[i], tubes.half_length[i], tubes.material[i]
            axis, centre = (xmat[g, 2], xmat[g, 5], xmat[g, 8]), (xpos[g, 0], xpos[g, 1], xpos[g, 2])
            to_light, to_eye = plus(toward, -point, centre), plus(eye, -1.0, centre)
            if _is_steep(to_light, point, to_eye, axis, half + radius, (finishes[material, 3], disc)):
                continue
            found, n, x = _on_tube(centre, axis, radius, half, toward, point, eye)
            if found:
                p, bounds = plus(plus(centre, x, axis), radius, n), (-half - x, half - x)
                _write(spots, count, (p, n, axis, cross(axis, n)), (0.0, 1.0 / radius), bounds, (material, j, g))
                count += 1
    return count


@njit(cache=True)
def _on_ball(
    centre: Vector, z: Vector, side: float, radius: float, toward: Vector, point: float, eye: Vector
) -> tuple[bool, Vector]:
    """Whether there is a mirror point on the ball, or on its half toward z or -z, and its normal."""
    to_light, to_eye = plus(toward, -point, centre), plus(eye, -1.0, centre)
    if side * dot(to_light, z) < 0.0 and side * dot(to_eye, z) < 0.0:
        return False, z  # for so is the normal, which stands between them
    found, n = _on_sphere(to_light, point, to_eye, radius)
    return found and side * dot(n, z) >= 0.0, n


@njit(cache=True)
def _is_steep(to_light: Vector, point: float, to_eye: Vector, axis: Vector, reach: float, spread: Spread) -> bool:
    """Whether a facet would have to lean along a tube's axis farther than any does, wherever on it."""
    s, ds = unit(to_light)
    v, dc = unit(to_eye)
    h, twice = unit(plus(s, 1.0, v))
    if dc <= reach or point * ds < point * reach or twice == 0.0:
        return False
    turn = reach / (dc - reach) + (point * reach / (ds - reach) if point > 0.0 else 0.0)  # of s + v along the tube
    slope = min(_MOST_SIGMAS * (spread[0] + spread[1] / twice), _STEEPEST)
    return abs(dot(h, axis)) - 2.0 * turn / twice > slope / math.sqrt(1.0 + slope * slope)


@njit(cache=True)
def _write(
    spots: Array,
    at: int,
    place: tuple[Vector, Vector, Vector, Vector],
    curvature: tuple[float, float],
    bounds: tuple[float, float],
    labels: tuple[int, int, int],
) -> None:
    """Fill row `at`; `place` are point, normal and tangents, `labels` material, light and geom."""
    row, (p, n, t1, t2) = spots[at], place
    for k in range(3):
        row[k], row[3 + k], row[6 + k], row[9 + k] = p[k], n[k], t1[k], t2[k]
    row[12], row[13], row[14] = curvature[0], 0.0, curvature[1]
    row[15], row[16], row[17], row[18] = bounds[0], bounds[1], -_EVERYWHERE, _EVERYWHERE
    row[19], row[20], row[21], row[22] = labels[0], _SKIN_M, labels[1], labels[2]


@njit(cache=True)
def _angle(y: float, x: float) -> float:
    """atan2(y, x); of a small angle by its series, which is faster."""
    if abs(y) > _SMALL * x:
        return math.atan2(y, x)
    t = y / x
    return t * (1.0 - t * t * (1.0 / 3.0 - t * t * (0.2 - t * t / 7.0)))


@njit(cache=True)
def _mirror_angle(q_s: float, q_c: float, cos_gamma: float, sin_gamma: float) -> tuple[float, float]:
    """Cosine and sine of the root of Eq. (1), by Newton's method kept in [0, gamma]; q are radii over distances."""
    gamma = math.atan2(sin_gamma, cos_gamma)
    x = gamma * (1.0 - q_s) / (2.0 - q_s - q_c)
    cos_x, sin_x = math.cos(x), math.sin(x)
    for _ in range(_NEWTON_STEPS):
        cos_y, sin_y = cos_gamma * cos_x + sin_gamma * sin_x, sin_gamma * cos_x - cos_gamma * sin_x
        a, b = cos_x - q_s, cos_y - q_c
        slope = (1.0 - q_s * cos_x) / (a * a + sin_x * sin_x) + (1.0 - q_c * cos_y) / (b * b + sin_y * sin_y)
        step = min(max(x - _angle(sin_x * b - sin_y * a, a * b + sin_x * sin_y) / slope, 0.0), gamma) - x
        x += step
        if abs(step) > _SMALL:
            cos_x, sin_x = math.cos(x), math.sin(x)
            continue
        c, s = (
            1.0 - step * step * (0.5 - step * step / 24.0),
            step * (1.0 - step * step * (1.0 - 0.05 * step * step) / 6.0),
        )
        cos_x, sin_x = cos_x * c - sin_x * s, sin_x * c + cos_x * s
        if abs(step) < _CLOSE:
            break
    return cos_x, sin_x


@njit(cache=True)
def _circle_normal(
    to_light: Vector, point: float, to_eye: Vector, radius: float, spare: Vector
) -> tuple[bool, Vector, float]:
    """Whether both stand outside, the normal at the mirror point, and the length of `to_light`.

    `spare` is a second axis of the plane for when light and eye stand in one direction.
    """
    e, ds = unit(to_light)
    f, dc = unit(to_eye)
    if ds < 1e-9 or point * radius >= ds or radius >= dc:
        return False, e, ds
    cos_gamma = dot(e, f)
    g, sin_gamma = unit(plus(f, -cos_gamma, e))
    if sin_gamma < 1e-12:
        g = spare
    cos_x, sin_x = _mirror_angle(point * radius / ds, radius / dc, cos_gamma, sin_gamma)
    return True, plus((cos_x * e[0], cos_x * e[1], cos_x * e[2]), sin_x, g), ds


@njit(cache=True)
def _on_sphere(to_light: Vector, point: float, to_eye: Vector, radius: float) -> tuple[bool, Vector]:
    spare, _ = tangents(unit(to_light)[0])
    found, n, _ = _circle_normal(to_light, point, to_eye, radius, spare)
    return found, n


@njit(cache=True)
def _on_tube(
    centre: Vector, axis: Vector, radius: float, half: float, toward: Vector, point: float, eye: Vector
) -> tuple[bool, Vector, float]:
    """Normal and place along the axis, Eq. (2)."""
    to_light, to_eye = plus(toward, -point, centre), plus(eye, -1.0, centre)
    z_s, z_c = dot(to_light, axis), dot(to_eye, axis)
    flat_s, flat_c = plus(to_light, -z_s, axis), plus(to_eye, -z_c, axis)
    found, n, ds = _circle_normal(flat_s, point, flat_c, radius, cross(axis, unit(flat_s)[0]))
    if not found:
        return False, n, 0.0
    l_c = unit(plus(flat_c, -radius, n))[1]
    if point == 0.0:
        z = z_c + l_c * z_s / ds
    else:
        l_s = unit(plus(flat_s, -radius, n))[1]
        z = (z_s * l_c + z_c * l_s) / (l_s + l_c)
    return True, n, min(max(z, -half), half)
