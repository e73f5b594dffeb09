"""Draws solids by intersecting rays with them in closed form: the background without OpenGL.

In camera axes C a block's ray is d = (1, -x, -y), so that the parameter t of a hit is its depth. In a solid's own axes,
o being the lens and d the ray, the nearer root t of

    ball      |A^-1 (o + t d)|^2 = 1                      A = diag of half axes                                  (1)
    tube      (o + t d)_x^2 + (o + t d)_y^2 = r^2                                                                (2)
    box       |o + t d|_k <= h_k, k = x, y, z             entered where the last of three slabs is               (3)

A capsule is a tube up to its two balls, a cylinder a tube cut by one slab. The nearest solid wins, block by block.
Only entries count: a solid that the lens stands in is not seen, as with OpenGL's culled back faces.

Each solid visits the blocks between the edges of its box's picture, row by row. What a block shows depends on its own
ray and the scene alone, never on which other blocks are drawn.
Not modelled: more than one ray a block (edges are steps of a block).
Source: Glassner (ed.), An Introduction to Ray Tracing, ch. 2.
"""

import math

import mujoco
import numpy as np
from numba import njit
from numpy.typing import NDArray

from dockair.rotations import Array
from dockair.sim.camera.solids import BALL, BOX, CAPSULE, CYLINDER, Haze, Lighting, Solids, depth_limits_m

_MOST_EDGES = 190  # pairs of 20 points: a box's corners and its edges' cuts
_PARALLEL = 1e-24  # squared sine below which a ray runs along a tube
_ON_SIDE = 1.0 - 1e-9  # part of a tube's length that is surely its side

Triple = tuple[float, float, float]


class TracedSolids:
    """Draws the solids of a model by rays.

    Raises:
        DockairError: the model has a visible geom that is no solid.
    """

    name = "analytic"

    def __init__(self, model: mujoco.MjModel, lighting: Lighting) -> None:
        self._solids, self._lighting = Solids.of(model), lighting
        self._limits_m = depth_limits_m(model)

    def draw(
        self,
        out: NDArray[np.float32],
        data: mujoco.MjData,
        pose: tuple[Array, Array],
        x: Array,
        y: Array,
        haze: Haze,
    ) -> None:
        """Lay the solids over a picture of the sky, in place.

        Args:
            out: (rows, columns) relative radiance, one value a block.
            data: positions and attitudes up to date.
            pose: R_WC and p_WC of the camera.
            x: (columns,) tangents to the right of the axis, of the blocks' centres.
            y: (rows,) tangents below it.
            haze: the air in between.
        """
        R_WC, p_WC = pose
        s, light = self._solids, self._lighting
        centres = (data.geom_xpos[s.geoms] - p_WC) @ R_WC
        axes = R_WC.T @ data.geom_xmat[s.geoms].reshape(-1, 3, 3)
        nearest = np.full(out.shape, self._limits_m[1])
        shade = light.ambient, light.direct, haze.extinction_1_m, haze.airlight
        solids = s.kinds, s.half_sizes_m, s.reflectances
        _trace(out, nearest, solids, centres, axes, x, y, R_WC.T @ light.toward_W, shade, self._limits_m[0])

    def close(self) -> None:
        """Nothing to free."""


@njit(cache=True)
def _trace(
    out: NDArray[np.float32],
    nearest: Array,
    solids: tuple[NDArray[np.int64], Array, Array],
    centres: Array,
    axes: Array,
    x: Array,
    y: Array,
    sun_C: Array,
    shade: tuple[float, float, float, float],
    near: float,
) -> None:
    """Draw every solid; `centres` (n, 3) and `axes` (n, 3, 3) in C, `nearest` (rows, columns) depths so far."""
    kinds, half_sizes, reflectances = solids
    ambient, direct, extinction, air = shade
    edges = np.empty((_MOST_EDGES, 4))
    for g in range(kinds.shape[0]):
        kind, h, M, c = kinds[g], half_sizes[g], axes[g], centres[g]
        count = _edges_of_box(edges, c, M, h, kind == CAPSULE, near)
        if count == 0:
            continue
        row, row_stop = _between(edges[:count, 1::2].min(), edges[:count, 1::2].max(), y)
        if row == row_stop:
            continue
        # To the solid's own axes, in units of its size: a unit ball, a tube of radius 1, a cube of half side 1
        unit = (h[0], h[0], h[0]) if kind in (CAPSULE, CYLINDER) else (h[0], h[1], h[2])
        o = _to_unit(-c[0], -c[1], -c[2], M, unit)
        sun = _to_unit(sun_C[0], sun_C[1], sun_C[2], M, (1.0, 1.0, 1.0))
        across = _to_unit(0.0, -1.0, 0.0, M, unit)
        for i in range(row, row_stop):
            left, right = _crossed(edges, count, y[i])
            column, column_stop = _between(left, right, x)
            ahead = _to_unit(1.0, 0.0, -y[i], M, unit)
            for j in range(column, column_stop):
                d = (ahead[0] + x[j] * across[0], ahead[1] + x[j] * across[1], ahead[2] + x[j] * across[2])
                if kind == BALL:
                    t = _hit_ball(o, d)
                elif kind == BOX:
                    t = _hit_box(o, d)
                else:
                    t = _hit_tube(o, d, h[2] / h[0], kind == CAPSULE)
                if near <= t < nearest[i, j]:
                    nearest[i, j] = t
                    p = (o[0] + t * d[0], o[1] + t * d[1], o[2] + t * d[2])
                    radiance = reflectances[g] * (ambient + direct * max(0.0, _cosine(kind, p, unit, h[2] / h[0], sun)))
                    if extinction > 0.0:
                        clear = math.exp(-extinction * t * math.sqrt(1.0 + x[j] * x[j] + y[i] * y[i]))
                        radiance = radiance * clear + air * (1.0 - clear)
                    out[i, j] = radiance


@njit(cache=True)
def _to_unit(a: float, b: float, c: float, M: Array, unit: Triple) -> Triple:
    """Turn a vector of C into a solid's axes and scale it to units of its size."""
    return (
        (M[0, 0] * a + M[1, 0] * b + M[2, 0] * c) / unit[0],
        (M[0, 1] * a + M[1, 1] * b + M[2, 1] * c) / unit[1],
        (M[0, 2] * a + M[1, 2] * b + M[2, 2] * c) / unit[2],
    )


@njit(cache=True)
def _edges_of_box(edges: Array, c: Array, M: Array, h: Array, capped: bool, near: float) -> int:
    """Fill edges (m, 4), tangents (x, y) of two ends each, of the picture of a solid's box; return how many.

    Of a box that reaches behind the near plane they join all corners of the part before it, pair by pair.
    """
    corners, picture = np.empty((8, 3)), np.empty((20, 2))
    length = h[2] + h[0] if capped else h[2]
    behind = 0
    for k in range(8):
        a, b, e = h[0] * (2 * (k & 1) - 1), h[1] * ((k & 2) - 1), length * ((k & 4) / 2 - 1)
        for axis in range(3):
            corners[k, axis] = c[axis] + M[axis, 0] * a + M[axis, 1] * b + M[axis, 2] * e
        behind += corners[k, 0] < near
    if behind == 8:
        return 0
    points = 0
    for k in range(8):
        if corners[k, 0] >= near:
            picture[points] = -corners[k, 1:] / corners[k, 0]
            points += 1
    count = 0
    for a in range(8):
        for bit in (1, 2, 4):
            b = a | bit
            if a & bit:
                continue
            if behind == 0:
                edges[count, :2], edges[count, 2:] = picture[a], picture[b]
                count += 1
            elif (corners[a, 0] < near) != (corners[b, 0] < near):
                part = (near - corners[a, 0]) / (corners[b, 0] - corners[a, 0])
                picture[points] = -(corners[a, 1:] + part * (corners[b, 1:] - corners[a, 1:])) / near
                points += 1
    if behind == 0:
        return count
    for a in range(points):
        for b in range(a):
            edges[count, :2], edges[count, 2:] = picture[a], picture[b]
            count += 1
    return count


@njit(cache=True)
def _crossed(edges: Array, count: int, y: float) -> tuple[float, float]:
    """Leftmost and rightmost tangent at which edges cross a row."""
    left, right = math.inf, -math.inf
    for k in range(count):
        x0, y0, x1, y1 = edges[k, 0], edges[k, 1], edges[k, 2], edges[k, 3]
        if (y0 - y) * (y1 - y) > 0.0:
            continue
        if y0 == y1:
            left, right = min(left, x0, x1), max(right, x0, x1)
        else:
            at = x0 + (y - y0) / (y1 - y0) * (x1 - x0)
            left, right = min(left, at), max(right, at)
    return left, right


@njit(cache=True)
def _between(low: float, high: float, tangents: Array) -> tuple[int, int]:
    """Range of the evenly spaced tangents in [low, high], one more on each side."""
    n = tangents.shape[0]
    if not (low <= high) or n == 0:
        return 0, 0
    step = (tangents[-1] - tangents[0]) / (n - 1) if n > 1 else 1.0
    first = (low - tangents[0]) / step
    last = (high - tangents[0]) / step
    if last < -2.0 or first > n + 2.0:
        return 0, 0
    return max(0, math.floor(max(first, 0.0)) - 1), min(n, math.ceil(min(last, n + 0.0)) + 2)


@njit(cache=True)
def _hit_ball(o: Triple, d: Triple) -> float:
    """Depth of the entry into the unit ball, Eq. (1); infinity for a miss."""
    a = d[0] * d[0] + d[1] * d[1] + d[2] * d[2]
    b = o[0] * d[0] + o[1] * d[1] + o[2] * d[2]
    under = b * b - a * (o[0] * o[0] + o[1] * o[1] + o[2] * o[2] - 1.0)
    return (-b - math.sqrt(under)) / a if under > 0.0 else math.inf


@njit(cache=True)
def _hit_tube(o: Triple, d: Triple, half: float, capped: bool) -> float:
    """The same for a tube of radius 1 along z, Eq. (2): a capsule where `capped` by balls, else a cylinder."""
    a = d[0] * d[0] + d[1] * d[1]
    b = o[0] * d[0] + o[1] * d[1]
    c = o[0] * o[0] + o[1] * o[1] - 1.0
    under = b * b - a * c
    along = a <= _PARALLEL * d[2] * d[2]
    if c > 0.0 and (along or under <= 0.0):
        return math.inf
    if along:
        z, enters = (-math.inf if d[2] > 0.0 else math.inf), -math.inf
    else:
        enters = (-b - math.sqrt(under)) / a
        z = o[2] + enters * d[2]
    if -half <= z <= half:
        return enters
    end = half if z > half else -half
    if capped:
        return _hit_ball((o[0], o[1], o[2] - end), d)
    if d[2] * end >= 0.0:  # the tube is entered beyond this end and left farther away from it
        return math.inf
    t = (end - o[2]) / d[2]
    px, py = o[0] + t * d[0], o[1] + t * d[1]
    return t if px * px + py * py <= 1.0 else math.inf


@njit(cache=True)
def _hit_box(o: Triple, d: Triple) -> float:
    """The same for the cube of half side 1, Eq. (3)."""
    enters, leaves = -math.inf, math.inf
    for k in range(3):
        if d[k] == 0.0:
            if abs(o[k]) > 1.0:
                return math.inf
            continue
        side = -1.0 if d[k] > 0.0 else 1.0
        enters = max(enters, (side - o[k]) / d[k])
        leaves = min(leaves, (-side - o[k]) / d[k])
    return enters if enters <= leaves else math.inf


@njit(cache=True)
def _cosine(kind: int, p: Triple, unit: Triple, half: float, sun: Triple) -> float:
    """Cosine of the Sun's incidence where a solid is entered at p, in units of its size."""
    if kind == BALL:
        n = (p[0] / unit[0], p[1] / unit[1], p[2] / unit[2])
    elif kind == BOX:
        k = 0 if abs(p[0]) >= max(abs(p[1]), abs(p[2])) else (1 if abs(p[1]) >= abs(p[2]) else 2)
        return math.copysign(1.0, p[k]) * sun[k]
    elif abs(p[2]) < half * _ON_SIDE:
        return p[0] * sun[0] + p[1] * sun[1]
    elif kind == CAPSULE:
        n = (p[0], p[1], p[2] - math.copysign(half, p[2]))
    else:
        return math.copysign(1.0, p[2]) * sun[2]
    return (n[0] * sun[0] + n[1] * sun[1] + n[2] * sun[2]) / math.sqrt(n[0] * n[0] + n[1] * n[1] + n[2] * n[2])
