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
_LANES = 8  # rays that are taken at once
_LOG2_E = _F(1.44269504)
#: 2^-f on [0, 1] to 2e-9, but for rounding; highest power first, 1 at f = 0 to the bit.
_POWER = tuple(_F(a) for a in (1.0902322e-4, -1.2747482e-3, 9.5791798e-3, -5.5490758e-2, 0.24022436, -0.69314706, 1.0))

Row = NDArray[np.float32]
Frame = tuple[Array, Array]  # R_WC and p_WC of the camera
Poses = tuple[Array, Array]  # places (ngeom, 3) and attitudes (ngeom, 9) of the model's geoms
Vector = tuple[float, float, float]
Side = tuple[float, float, float, float]
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
    tangents, xpos, xmat = x.astype(np.float32), poses[0], poses[1]
    places, lit = np.empty((meshes.corners_m.shape[0], 5)), np.empty(meshes.corners_m.shape[0])
    for k in range(meshes.geoms.shape[0]):
        g, first, stop = meshes.geoms[k], meshes.first_corner[k], meshes.first_corner[k + 1]
        c, M, m = (
            _into_camera(camera, xpos[g, 0], xpos[g, 1], xpos[g, 2]),
            _turn(camera[0], xmat[g]),
            meshes.centres_m[k],
        )
        middle = (
            c[0] + M[0, 0] * m[0] + M[0, 1] * m[1] + M[0, 2] * m[2],
            c[1] + M[1, 0] * m[0] + M[1, 1] * m[1] + M[1, 2] * m[2],
            c[2] + M[2, 0] * m[0] + M[2, 1] * m[1] + M[2, 2] * m[2],
        )
        if _is_beside(middle, meshes.radii_m[k], x, y, near):
            continue
        _light_corners(meshes, first, stop, c, M, sun_C, places, lit)
        for i in range(first, stop):
            lit[i] = meshes.reflectances[k] * (light[0] + light[1] * max(lit[i], 0.0))
        for i in range(meshes.first_triangle[k], meshes.first_triangle[k + 1]):
            _draw_triangle(meshes.triangles[i], places, lit, out, nearest, tangents, x, y, light, near)


@njit(cache=True)
def _into_camera(camera: Frame, x: float, y: float, z: float) -> Vector:
    R, lens = camera
    a, b, c = x - lens[0], y - lens[1], z - lens[2]
    return (
        R[0, 0] * a + R[1, 0] * b + R[2, 0] * c,
        R[0, 1] * a + R[1, 1] * b + R[2, 1] * c,
        R[0, 2] * a + R[1, 2] * b + R[2, 2] * c,
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
    s_x = M[0, 0] * sun_C[0] + M[1, 0] * sun_C[1] + M[2, 0] * sun_C[2]
    s_y = M[0, 1] * sun_C[0] + M[1, 1] * sun_C[1] + M[2, 1] * sun_C[2]
    s_z = M[0, 2] * sun_C[0] + M[1, 2] * sun_C[1] + M[2, 2] * sun_C[2]
    for i in range(first, stop):
        v, n = meshes.corners_m[i], meshes.normals[i]
        for k in range(3):
            places[i, k] = c[k] + M[k, 0] * v[0] + M[k, 1] * v[1] + M[k, 2] * v[2]
        depth = max(places[i, 0], _SHALLOW_M)
        places[i, 3], places[i, 4] = -places[i, 1] / depth, -places[i, 2] / depth
        lit[i] = n[0] * s_x + n[1] * s_y + n[2] * s_z


@njit(cache=True)
def _cross(a: Array, b: Array) -> Vector:
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


@njit(cache=True)
def _draw_triangle(
    corners: NDArray[np.int64],
    places: Array,
    lit: Array,
    out: NDArray[np.float32],
    nearest: NDArray[np.float32],
    tangents: Row,
    x: Array,
    y: Array,
    light: tuple[float, float, float, float],
    near: float,
) -> None:
    i, j, k = corners
    a, b, c = places[i], places[j], places[k]
    if _is_averted_or_beside(a, b, c, x, y, near):
        return
    e_a, e_b, e_c = _cross(c, b), _cross(a, c), _cross(b, a)
    volume = a[0] * e_a[0] + a[1] * e_a[1] + a[2] * e_a[2]  # -a.(b x c)
    if not volume > 0.0:
        return
    row, stop = _rows(a, b, c, y, near)
    if row == stop:
        return
    total = e_a[0] + e_b[0] + e_c[0], e_a[1] + e_b[1] + e_c[1], e_a[2] + e_b[2] + e_c[2]
    l_a, l_b, l_c = lit[i], lit[j], lit[k]
    bright = (
        e_a[0] * l_a + e_b[0] * l_b + e_c[0] * l_c,
        e_a[1] * l_a + e_b[1] * l_b + e_c[1] * l_c,
        e_a[2] * l_a + e_b[2] * l_b + e_c[2] * l_c,
    )
    per_column = (x.shape[0] - 1) / (x[-1] - x[0]) if x.shape[0] > 1 else 1.0
    sides = _side(e_a), _side(e_b), _side(e_c)
    for line in range(row, stop):
        at = y[line]
        low, high = _span(sides, at)
        first, last = (low - x[0]) * per_column - 1.0, (high - x[0]) * per_column + 2.0
        if not (first <= last) or last < 0.0 or first > x.shape[0]:
            continue
        left, right = int(max(first, 0.0)), int(min(last, float(x.shape[0] - 1))) + 1
        right = min(left + (right - left + _LANES - 1) // _LANES * _LANES, x.shape[0])
        air = _F(light[2]), _F(light[3]), _F(1.0 + at * at), _F(near)
        edges = _line(e_a, at), _line(e_b, at), _line(e_c, at)
        part, picture, depths = tangents[left:right], out[line, left:right], nearest[line, left:right]
        _draw_row(edges, _line(total, at), _line(bright, at), _F(volume), air, part, picture, depths)


@njit(cache=True)
def _is_averted_or_beside(a: Array, b: Array, c: Array, x: Array, y: Array, near: float) -> bool:
    """Whether a triangle surely shows nothing: all of what is ahead of the near plane told by its tangents."""
    if max(a[0], b[0], c[0]) < near:
        return True
    if min(a[0], b[0], c[0]) < near:
        return False
    turn = (b[3] - a[3]) * (c[4] - a[4]) - (b[4] - a[4]) * (c[3] - a[3])
    if turn > _ROUNDING * (abs(b[3] - a[3]) + abs(c[3] - a[3])) * (abs(b[4] - a[4]) + abs(c[4] - a[4])):
        return True
    wide, high = 2.0 * (x[1] - x[0]) if len(x) > 1 else 1.0, 2.0 * (y[1] - y[0]) if len(y) > 1 else 1.0
    return (
        max(a[3], b[3], c[3]) < x[0] - wide
        or min(a[3], b[3], c[3]) > x[-1] + wide
        or max(a[4], b[4], c[4]) < y[0] - high
        or min(a[4], b[4], c[4]) > y[-1] + high
    )


@njit(cache=True)
def _rows(a: Array, b: Array, c: Array, y: Array, near: float) -> tuple[int, int]:
    """Range of the rows that a triangle may be seen in; all of one that reaches behind the near plane."""
    n = y.shape[0]
    if min(a[0], b[0], c[0]) < near or n < 2:
        return 0, n
    at_a, at_b, at_c = -a[2] / a[0], -b[2] / b[0], -c[2] / c[0]
    per_row = (n - 1) / (y[-1] - y[0])
    first, last = (min(at_a, at_b, at_c) - y[0]) * per_row - 1.0, (max(at_a, at_b, at_c) - y[0]) * per_row + 2.0
    if last < 0.0 or first > n:
        return 0, 0
    return int(max(first, 0.0)), min(int(last) + 1, n)


@njit(cache=True)
def _side(edge: Vector) -> Side:
    """Where e is not negative: x >= 1st + 2nd y, x <= 3rd + 4th y; an edge along the row is left to Eq. (1)."""
    if edge[1] < 0.0:
        return edge[0] / edge[1], -edge[2] / edge[1], math.inf, 0.0
    if edge[1] > 0.0:
        return -math.inf, 0.0, edge[0] / edge[1], -edge[2] / edge[1]
    return -math.inf, 0.0, math.inf, 0.0


@njit(cache=True)
def _span(sides: tuple[Side, Side, Side], y: float) -> tuple[float, float]:
    """Range of x where no e is negative."""
    a, b, c = sides
    low = max(a[0] + y * a[1], b[0] + y * b[1], c[0] + y * c[1])
    return low, min(a[2] + y * a[3], b[2] + y * b[3], c[2] + y * c[3])


@njit(cache=True)
def _line(e: Vector, y: float) -> Line:
    return _F(e[0] - y * e[2]), _F(-e[1])


@njit(cache=True, error_model="numpy")
def _draw_row(
    edges: tuple[Line, Line, Line],
    total: Line,
    bright: Line,
    volume: np.float32,
    air: Air,
    x: Row,
    out: Row,
    nearest: Row,
) -> None:
    """Eqs. (1) and (2) of some blocks of a row; without branches, so that several are taken at once."""
    e_a, e_b, e_c = edges
    extinction, airlight, beyond, near = air
    for j in range(x.shape[0]):
        at = x[j]
        a, b, c = e_a[0] + at * e_a[1], e_b[0] + at * e_b[1], e_c[0] + at * e_c[1]
        k = _ONE / (total[0] + at * total[1])
        t, radiance = volume * k, (bright[0] + at * bright[1]) * k
        clear = _fading(extinction * t * np.sqrt(beyond + at * at))
        radiance = radiance * clear + airlight * (_ONE - clear)
        seen = (min(a, b, c) >= _ZERO) & (t >= near) & (t < nearest[j])
        out[j], nearest[j] = radiance if seen else out[j], t if seen else nearest[j]


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
