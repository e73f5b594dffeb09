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
from dockair.sim.camera.solids import BALL, BOX, CAPSULE, Haze, Lighting, Solids, depth_limits_m

_PARALLEL = 1e-24  # squared sine below which a ray runs along a tube


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
    corners = np.empty((8, 3))
    for g in range(kinds.shape[0]):
        kind, h, M, c = kinds[g], half_sizes[g], axes[g], centres[g]
        front = _box_picture(corners, c, M, h, kind == CAPSULE)
        if front < near and corners[:, 0].max() < near:
            continue
        o, s = -(M.T @ c), M.T @ sun_C
        row, row_stop = 0, y.shape[0]
        if front >= near:
            row, row_stop = _between(corners[:, 2].min(), corners[:, 2].max(), y)
        for i in range(row, row_stop):
            column, column_stop = 0, x.shape[0]
            if front >= near:
                left, right = _row_of_picture(corners, y[i])
                column, column_stop = _between(left, right, x)
            d0, d1, d2 = M[0, 0] - y[i] * M[2, 0], M[0, 1] - y[i] * M[2, 1], M[0, 2] - y[i] * M[2, 2]
            for j in range(column, column_stop):
                d = (d0 - x[j] * M[1, 0], d1 - x[j] * M[1, 1], d2 - x[j] * M[1, 2])
                if kind == BALL:
                    t, cosine = _hit_ball(o, d, h, s)
                elif kind == BOX:
                    t, cosine = _hit_box(o, d, h, s)
                else:
                    t, cosine = _hit_tube(o, d, h, s, kind == CAPSULE)
                if near <= t < nearest[i, j]:
                    nearest[i, j] = t
                    radiance = reflectances[g] * (ambient + direct * max(0.0, cosine))
                    if extinction > 0.0:
                        clear = math.exp(-extinction * t * math.sqrt(1.0 + x[j] * x[j] + y[i] * y[i]))
                        radiance = radiance * clear + air * (1.0 - clear)
                    out[i, j] = radiance


@njit(cache=True)
def _box_picture(corners: Array, c: Array, M: Array, h: Array, capped: bool) -> float:
    """Fill (8, 3) depths and tangents (x, y) of a solid's box; return the least depth."""
    front = math.inf
    length = h[2] + h[0] if capped else h[2]
    for k in range(8):
        a = h[0] if k & 1 else -h[0]
        b = h[1] if k & 2 else -h[1]
        e = length if k & 4 else -length
        depth = c[0] + M[0, 0] * a + M[0, 1] * b + M[0, 2] * e
        corners[k, 0] = depth
        corners[k, 1] = -(c[1] + M[1, 0] * a + M[1, 1] * b + M[1, 2] * e) / depth
        corners[k, 2] = -(c[2] + M[2, 0] * a + M[2, 1] * b + M[2, 2] * e) / depth
        front = min(front, depth)
    return front


@njit(cache=True)
def _row_of_picture(corners: Array, y: float) -> tuple[float, float]:
    """Leftmost and rightmost tangent of a box's picture in one row: where its twelve edges cross it."""
    left, right = math.inf, -math.inf
    for a in range(8):
        for bit in (1, 2, 4):
            b = a | bit
            if a & bit or (corners[a, 2] - y) * (corners[b, 2] - y) > 0.0:
                continue
            rise = corners[b, 2] - corners[a, 2]
            part = (y - corners[a, 2]) / rise if rise != 0.0 else 0.0
            at = corners[a, 1] + part * (corners[b, 1] - corners[a, 1])
            left, right = min(left, at), max(right, at)
            if rise == 0.0:
                left, right = min(left, corners[b, 1]), max(right, corners[b, 1])
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
def _hit_ball(o: Array, d: tuple[float, float, float], h: Array, s: Array) -> tuple[float, float]:
    """Depth of the entry, Eq. (1), and cosine of the Sun's incidence there; infinity for a miss."""
    ox, oy, oz = o[0] / h[0], o[1] / h[1], o[2] / h[2]
    dx, dy, dz = d[0] / h[0], d[1] / h[1], d[2] / h[2]
    a = dx * dx + dy * dy + dz * dz
    b = ox * dx + oy * dy + oz * dz
    under = b * b - a * (ox * ox + oy * oy + oz * oz - 1.0)
    if under <= 0.0:
        return math.inf, 0.0
    t = (-b - math.sqrt(under)) / a
    nx, ny, nz = (ox + t * dx) / h[0], (oy + t * dy) / h[1], (oz + t * dz) / h[2]
    return t, (nx * s[0] + ny * s[1] + nz * s[2]) / math.sqrt(nx * nx + ny * ny + nz * nz)


@njit(cache=True)
def _hit_tube(
    o: Array, d: tuple[float, float, float], h: Array, s: Array, capped: bool
) -> tuple[float, float]:
    """The same for a tube along z, Eq. (2): a capsule where `capped` by balls, else a cylinder."""
    r, half = h[0], h[2]
    a = d[0] * d[0] + d[1] * d[1]
    b = o[0] * d[0] + o[1] * d[1]
    c = o[0] * o[0] + o[1] * o[1] - r * r
    under = b * b - a * c
    along = a <= _PARALLEL * d[2] * d[2]
    if c > 0.0 and (along or under <= 0.0):
        return math.inf, 0.0
    enters = -math.inf if along else (-b - math.sqrt(under)) / a
    z = o[2] + enters * d[2] if not along else (-math.inf if d[2] > 0.0 else math.inf)
    if -half <= z <= half:
        return enters, ((o[0] + enters * d[0]) * s[0] + (o[1] + enters * d[1]) * s[1]) / r
    end = half if z > half else -half
    if capped:
        return _hit_end_ball(o, d, r, end, s)
    if d[2] * end >= 0.0:  # the tube is entered beyond this end and left farther away from it
        return math.inf, 0.0
    t = (end - o[2]) / d[2]
    px, py = o[0] + t * d[0], o[1] + t * d[1]
    if px * px + py * py > r * r:
        return math.inf, 0.0
    return t, s[2] if end > 0.0 else -s[2]


@njit(cache=True)
def _hit_end_ball(
    o: Array, d: tuple[float, float, float], r: float, end: float, s: Array
) -> tuple[float, float]:
    """The same for the ball at one end of a capsule."""
    oz = o[2] - end
    a = d[0] * d[0] + d[1] * d[1] + d[2] * d[2]
    b = o[0] * d[0] + o[1] * d[1] + oz * d[2]
    under = b * b - a * (o[0] * o[0] + o[1] * o[1] + oz * oz - r * r)
    if under <= 0.0:
        return math.inf, 0.0
    t = (-b - math.sqrt(under)) / a
    return t, ((o[0] + t * d[0]) * s[0] + (o[1] + t * d[1]) * s[1] + (oz + t * d[2]) * s[2]) / r


@njit(cache=True)
def _hit_box(o: Array, d: tuple[float, float, float], h: Array, s: Array) -> tuple[float, float]:
    """The same for a box, Eq. (3)."""
    enters, leaves, cosine = -math.inf, math.inf, 0.0
    for k in range(3):
        if d[k] == 0.0:
            if abs(o[k]) > h[k]:
                return math.inf, 0.0
            continue
        side = -h[k] if d[k] > 0.0 else h[k]
        t = (side - o[k]) / d[k]
        if t > enters:
            enters, cosine = t, (-s[k] if d[k] > 0.0 else s[k])
        leaves = min(leaves, (-side - o[k]) / d[k])
    if enters > leaves:
        return math.inf, 0.0
    return enters, cosine
