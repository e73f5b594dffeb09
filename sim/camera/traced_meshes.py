"""Draws triangle meshes by intersecting rays with them: the part of `traced` that is no primitive.

In camera axes C a block's ray is d = (1, -x, -y). With the corners a, b, c of a triangle seen counter-clockwise, and
the lens as origin, d goes through its inside where the three

    e_a = (c x b).d,   e_b = (a x c).d,   e_c = (b x a).d                                                         (1)

are not negative; then its depth and the radiance there, from that of the corners, are

    t = -a.(b x c)/(e_a + e_b + e_c),      L = (e_a L_a + e_b L_b + e_c L_c)/(e_a + e_b + e_c)                    (2)

All are linear in x along a row, so nothing has to be clipped at the near plane. Two triangles share e on their common
edge but for the sign, to the bit: no ray slips through. Light falls on the corners, [solids, eq 1], as with OpenGL.
Triangles that show their back are not seen. What a block shows depends on its own ray alone.

Not modelled: more than one ray a block; else see `solids`.
Source: Olano & Greer 1997 (triangle scan conversion using 2D homogeneous coordinates).
"""

import math

import numpy as np
from numba import njit
from numpy.typing import NDArray

from dockair.rotations import Array
from dockair.sim.camera.meshes import Meshes

_F = np.float32
_ZERO, _ONE = _F(0.0), _F(1.0)
_FAINTEST = _F(80.0)  # exponent beyond which nothing is seen through the haze
_SHALLOW_M = 1e-3  # depth that tangents are worked out for at least
_ROUNDING = 1e-9  # of a triangle's turn
_SLACK = 0.01  # blocks by which a triangle's rows and columns may be off: far more than rounding
_LANES = 4  # rays that are taken at once
_LOG2_E = _F(1.44269504)
#: 2^-f on [0, 1] to 2e-9, but for rounding; highest power first, 1 at f = 0 to the bit.
_POWER = tuple(_F(a) for a in (1.0902322e-4, -1.2747482e-3, 9.5791798e-3, -5.5490758e-2, 0.24022436, -0.69314706, 1.0))

Row = NDArray[np.float32]
Frame = tuple[Array, Array]  # R_WC and p_WC of the camera
Poses = tuple[Array, Array]  # places (ngeom, 3) and attitudes (ngeom, 9) of the model's geoms
Vector = tuple[float, float, float]
Side = tuple[float, float, float, float]
Even = tuple[float, float, int]  # evenly spaced tangents: the first, how many there are in 1, their number
Line = tuple[np.float32, np.float32]  # value at x = 0 and slope
#: Extinction, airlight, 1 + y^2, depth of the near plane.
Air = tuple[np.float32, np.float32, np.float32, np.float32]


@njit(cache=True)
def trace_meshes(
    out: NDArray[np.float32],
    nearest: NDArray[np.float32],
    meshes: Meshes,
    poses: Poses,
    camera: Frame,
    x: Array,
    y: Array,
    sun_C: Array,
    light: tuple[float, float, float, float],
    near: float,
) -> None:
    """Draw them over a picture.

    Args:
        out: (rows, columns) relative radiance, written.
        nearest: (rows, columns) depths so far, written.
        meshes: of the model.
        poses: of its geoms.
        camera: its pose.
        x: (columns,) evenly spaced tangents to the right of the axis, of the blocks' centres.
        y: (rows,) evenly spaced tangents below it.
        sun_C: unit vector toward the Sun.
        light: ambient, direct, extinction, airlight.
        near: depth of the near plane.
    """
    (xpos, xmat), tangents, columns, rows = poses, x.astype(np.float32), _even(x), _even(y)
    places, lit = np.empty((meshes.corners_m.shape[0], 5)), np.empty(meshes.corners_m.shape[0])
    for k in range(meshes.geoms.shape[0]):
        g, first, stop = meshes.geoms[k], meshes.first_corner[k], meshes.first_corner[k + 1]
        (R, lens), at = camera, xpos[g]
        c, M = _into(R, at[0] - lens[0], at[1] - lens[1], at[2] - lens[2]), _turn(R, xmat[g])
        middle = _moved(c, M, meshes.centres_m[k])
        if _is_beside(middle, meshes.radii_m[k], x, y, near):
            continue
        _light_corners(meshes, first, stop, c, M, sun_C, places, lit)
        for i in range(first, stop):
            lit[i] = meshes.reflectances[k] * (light[0] + light[1] * max(lit[i], 0.0))
        for i in range(meshes.first_triangle[k], meshes.first_triangle[k + 1]):
            corners = meshes.triangles[i, 0], meshes.triangles[i, 1], meshes.triangles[i, 2]
            _draw_triangle(corners, places, lit, out, nearest, tangents, columns, rows, y, light, near)


@njit(cache=True)
def _into(R: Array, a: float, b: float, c: float) -> Vector:
    """R' times a vector."""
    return (
        R[0, 0] * a + R[1, 0] * b + R[2, 0] * c,
        R[0, 1] * a + R[1, 1] * b + R[2, 1] * c,
        R[0, 2] * a + R[1, 2] * b + R[2, 2] * c,
    )


@njit(cache=True)
def _moved(c: Vector, M: Array, v: Array) -> Vector:
    return (
        c[0] + M[0, 0] * v[0] + M[0, 1] * v[1] + M[0, 2] * v[2],
        c[1] + M[1, 0] * v[0] + M[1, 1] * v[1] + M[1, 2] * v[2],
        c[2] + M[2, 0] * v[0] + M[2, 1] * v[1] + M[2, 2] * v[2],
    )


@njit(cache=True)
def _turn(R: Array, turn: Array) -> Array:
    M = np.empty((3, 3))
    for k in range(3):
        for axis in range(3):
            M[k, axis] = R[0, k] * turn[axis] + R[1, k] * turn[3 + axis] + R[2, k] * turn[6 + axis]
    return M


@njit(cache=True)
def _is_beside(c: Vector, radius: float, x: Array, y: Array, near: float) -> bool:
    """Whether no block's ray meets a ball before the near plane."""
    if c[0] + radius < near:
        return True
    right, left, low, high = x[-1], x[0], y[-1], y[0]
    return (
        -c[1] - right * c[0] > radius * math.sqrt(1.0 + right * right)
        or left * c[0] + c[1] > radius * math.sqrt(1.0 + left * left)
        or -c[2] - low * c[0] > radius * math.sqrt(1.0 + low * low)
        or high * c[0] + c[2] > radius * math.sqrt(1.0 + high * high)
    )


@njit(cache=True)
def _light_corners(
    meshes: Meshes, first: int, stop: int, c: Vector, M: Array, sun_C: Array, places: Array, lit: Array
) -> None:
    """Fill places in C, tangents (of those ahead) and cosines of the Sun's incidence of a patch's corners."""
    s_x, s_y, s_z = _into(M, sun_C[0], sun_C[1], sun_C[2])
    for i in range(first, stop):
        places[i, 0], places[i, 1], places[i, 2] = _moved(c, M, meshes.corners_m[i])
        depth = max(places[i, 0], _SHALLOW_M)
        places[i, 3], places[i, 4] = -places[i, 1] / depth, -places[i, 2] / depth
        n = meshes.normals[i]
        lit[i] = n[0] * s_x + n[1] * s_y + n[2] * s_z


@njit(cache=True)
def _cross(a: Vector, b: Vector) -> Vector:
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


@njit(cache=True)
def _mixed(e: tuple[Vector, Vector, Vector], a: float, b: float, c: float) -> Vector:
    """Sum of a e_a, b e_b and c e_c."""
    p, q, r = e
    return a * p[0] + b * q[0] + c * r[0], a * p[1] + b * q[1] + c * r[1], a * p[2] + b * q[2] + c * r[2]


@njit(cache=True)
def _draw_triangle(
    corners: tuple[int, int, int],
    places: Array,
    lit: Array,
    out: NDArray[np.float32],
    nearest: NDArray[np.float32],
    tangents: Row,
    x: Even,
    y: Even,
    heights: Array,
    light: tuple[float, float, float, float],
    near: float,
) -> None:
    i, j, k = corners
    a, b, c = _place(places, i), _place(places, j), _place(places, k)
    t_x, t_y = (places[i, 3], places[j, 3], places[k, 3]), (places[i, 4], places[j, 4], places[k, 4])
    is_cut = min(a[0], b[0], c[0]) < near
    if max(a[0], b[0], c[0]) < near or (not is_cut and _is_averted_or_beside(t_x, t_y, x, y)):
        return
    e = _cross(c, b), _cross(a, c), _cross(b, a)
    volume = a[0] * e[0][0] + a[1] * e[0][1] + a[2] * e[0][2]  # -a.(b x c)
    if not volume > 0.0:
        return
    low, high = _clipped(a, b, c, near) if is_cut else (min(t_y), max(t_y))
    row, stop = _within((low - y[0]) * y[1], (high - y[0]) * y[1], y[2])
    total, bright = _mixed(e, 1.0, 1.0, 1.0), _mixed(e, lit[i], lit[j], lit[k])
    sides = _side(e[0], x), _side(e[1], x), _side(e[2], x)
    extinction, airlight, closest, solid = _F(light[2]), _F(light[3]), _F(near), _F(volume)
    for line in range(row, stop):
        at = heights[line]
        left, right = _within(
            max(sides[0][0] + at * sides[0][1], sides[1][0] + at * sides[1][1], sides[2][0] + at * sides[2][1]),
            min(sides[0][2] + at * sides[0][3], sides[1][2] + at * sides[1][3], sides[2][2] + at * sides[2][3]),
            x[2],
        )
        if left >= right:
            continue
        air = extinction, airlight, _F(1.0 + at * at), closest
        lines = _line(e[0], at), _line(e[1], at), _line(e[2], at), _line(total, at), _line(bright, at)
        right = min(left + (right - left + _LANES - 1) // _LANES * _LANES, x[2])
        _draw_row(lines, solid, air, tangents, out, nearest, (np.uint64(line), np.uint64(left), np.uint64(right)))


@njit(cache=True)
def _place(places: Array, i: int) -> Vector:
    return places[i, 0], places[i, 1], places[i, 2]


@njit(cache=True)
def _is_averted_or_beside(t_x: Vector, t_y: Vector, x: Even, y: Even) -> bool:
    """Whether a triangle surely shows nothing, by its corners' tangents; all are ahead of the near plane."""
    b_x, b_y, c_x, c_y = t_x[1] - t_x[0], t_y[1] - t_y[0], t_x[2] - t_x[0], t_y[2] - t_y[0]
    if b_x * c_y - b_y * c_x > _ROUNDING * (abs(b_x) + abs(c_x)) * (abs(b_y) + abs(c_y)):
        return True
    left, right = _within((min(t_x) - x[0]) * x[1], (max(t_x) - x[0]) * x[1], x[2])
    top, bottom = _within((min(t_y) - y[0]) * y[1], (max(t_y) - y[0]) * y[1], y[2])
    return left >= right or top >= bottom


@njit(cache=True)
def _clipped(a: Vector, b: Vector, c: Vector, near: float) -> tuple[float, float]:
    """Range of y of what of a triangle is ahead of the near plane."""
    low, high = math.inf, -math.inf
    for p, q in ((a, b), (b, c), (c, a)):
        if p[0] >= near:
            low, high = min(low, -p[2] / p[0]), max(high, -p[2] / p[0])
        if (p[0] >= near) != (q[0] >= near):
            at = -(p[2] + (near - p[0]) / (q[0] - p[0]) * (q[2] - p[2])) / near
            low, high = min(low, at), max(high, at)
    return low, high


@njit(cache=True)
def _even(tangents: Array) -> Even:
    n = tangents.shape[0]
    return tangents[0], (n - 1) / (tangents[-1] - tangents[0]) if n > 1 else 1.0, n


@njit(cache=True)
def _within(low: float, high: float, n: int) -> tuple[int, int]:
    """Range of the blocks, of n, from `low` to `high`."""
    if not (low <= high + 2.0 * _SLACK) or high < -_SLACK or low > n - 1 + _SLACK:
        return 0, 0
    return int(math.ceil(max(low - _SLACK, 0.0))), int(min(high + _SLACK, n - 1.0)) + 1


@njit(cache=True)
def _side(edge: Vector, x: Even) -> Side:
    """Where e is not negative: column >= 1st + 2nd y, <= 3rd + 4th y; an edge along the row is left to Eq. (1)."""
    if edge[1] == 0.0:
        return -math.inf, 0.0, math.inf, 0.0
    at, slope = (edge[0] / edge[1] - x[0]) * x[1], -edge[2] / edge[1] * x[1]
    return (at, slope, math.inf, 0.0) if edge[1] < 0.0 else (-math.inf, 0.0, at, slope)


@njit(cache=True)
def _line(e: Vector, y: float) -> Line:
    return _F(e[0] - y * e[2]), _F(-e[1])


@njit(cache=True, error_model="numpy")
def _draw_row(
    lines: tuple[Line, Line, Line, Line, Line],
    volume: np.float32,
    air: Air,
    x: Row,
    out: NDArray[np.float32],
    nearest: NDArray[np.float32],
    where: tuple[np.uint64, np.uint64, np.uint64],
) -> None:
    """Eqs. (1) and (2) of some blocks of a row; without branches, so that several are taken at once."""
    e_a, e_b, e_c, total, bright = lines
    extinction, airlight, beyond, near = air
    row, left, right = where
    for k in range(right - left):
        j = left + np.uint64(k)
        at = x[j]
        a, b, c = e_a[0] + at * e_a[1], e_b[0] + at * e_b[1], e_c[0] + at * e_c[1]
        inverse = _ONE / (total[0] + at * total[1])
        t, radiance = volume * inverse, (bright[0] + at * bright[1]) * inverse
        clear = _fading(extinction * t * np.sqrt(beyond + at * at))
        radiance = radiance * clear + airlight * (_ONE - clear)
        seen = (min(a, b, c) >= _ZERO) & (t >= near) & (t < nearest[row, j])
        out[row, j], nearest[row, j] = radiance if seen else out[row, j], t if seen else nearest[row, j]


@njit(cache=True)
def _fading(depth: np.float32) -> np.float32:
    """exp(-depth) of 0 to 80, of more that of 80, to 1e-7."""
    y = (depth if depth < _FAINTEST else _FAINTEST) * _LOG2_E
    y = y if y > _ZERO else _ZERO
    whole = np.int32(y)
    f = y - _F(whole)
    power = _POWER[0]
    for a in _POWER[1:]:
        power = power * f + a
    return np.int32(_F(power).view(np.int32) - (whole << np.int32(23))).view(np.float32)
