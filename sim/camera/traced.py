"""Draws solids by intersecting rays with them in closed form: the background without OpenGL.

In camera axes C a block's ray is d = (1, -x, -y), so that the parameter t of a hit is its depth. In a solid's own axes,
o being the lens and d the ray, the nearer root t of

    ball      |A^-1 (o + t d)|^2 = 1                      A = diag of half axes                                  (1)
    tube      (o + t d)_x^2 + (o + t d)_y^2 = r^2                                                                (2)
    box       |o + t d|_k <= h_k, k = x, y, z             entered where the last of three slabs is               (3)

A capsule is a tube up to its two balls, a cylinder a tube cut by one slab. The nearest solid wins, block by block.
Only entries count: a solid that the lens stands in is not seen, as with OpenGL's culled back faces. Each solid visits
the blocks between the edges of its box's picture, row by row; what a block shows depends on its own ray alone.
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
_ALONG = 1e-300  # least squared component across a tube, of a ray that runs along it
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
        self._memory = np.empty(0, dtype=np.float32)

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
        if self._memory.size < out.size:
            self._memory = np.empty(out.size, dtype=np.float32)
        nearest = self._memory[: out.size].reshape(out.shape)
        nearest[:] = self._limits_m[1]
        shade = light.ambient, light.direct, haze.extinction_1_m, haze.airlight
        solids = s.kinds, s.half_sizes_m, s.reflectances
        _trace(out, nearest, solids, centres, axes, x, y, R_WC.T @ light.toward_W, shade, self._limits_m[0])

    def close(self) -> None:
        """Nothing to free."""


@njit(cache=True)
def _trace(
    out: NDArray[np.float32],
    nearest: NDArray[np.float32],
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
    edges, depth_row = np.empty((_MOST_EDGES, 4)), np.empty(x.shape[0])
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
        half = h[2] / h[0]
        o = _to_unit(-c[0], -c[1], -c[2], M, unit)
        sun = _to_unit(sun_C[0], sun_C[1], sun_C[2], M, (1.0, 1.0, 1.0))
        across = _to_unit(0.0, -1.0, 0.0, M, unit)
        for i in range(row, row_stop):
            left, right = _crossed(edges, count, y[i])
            column, column_stop = _between(left, right, x)
            ahead = _to_unit(1.0, 0.0, -y[i], M, unit)
            depths, tangents = depth_row[column:column_stop], x[column:column_stop]
            if kind == BALL:
                _hit_ball(o, ahead, across, tangents, depths)
            elif kind == BOX:
                _hit_box(o, ahead, across, tangents, depths)
            elif kind == CAPSULE:
                _hit_capsule(o, ahead, across, half, tangents, depths)
            else:
                _hit_cylinder(o, ahead, across, half, tangents, depths)
            for j in range(column, column_stop):
                t = depth_row[j]
                if not near <= t < nearest[i, j]:  # NaN is a miss
                    continue
                nearest[i, j] = t
                p = (
                    o[0] + t * (ahead[0] + x[j] * across[0]),
                    o[1] + t * (ahead[1] + x[j] * across[1]),
                    o[2] + t * (ahead[2] + x[j] * across[2]),
                )
                radiance = reflectances[g] * (ambient + direct * max(0.0, _cosine(kind, p, unit, half, sun)))
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
    behind = _corners_of_box(corners, c, M, h, h[2] + h[0] if capped else h[2], near)
    points, count = 0, 0
    for k in range(8):
        if corners[k, 0] >= near:
            picture[points] = -corners[k, 1:] / corners[k, 0]
            points += 1
    for a in range(8):
        for b in (a | 1, a | 2, a | 4):
            if behind == 0 and b != a:
                edges[count, :2], edges[count, 2:] = picture[a], picture[b]
                count += 1
            elif (corners[a, 0] < near) != (corners[b, 0] < near):
                part = (near - corners[a, 0]) / (corners[b, 0] - corners[a, 0])
                picture[points] = -(corners[a, 1:] + part * (corners[b, 1:] - corners[a, 1:])) / near
                points += 1
    if behind > 0:
        for a in range(points):
            for b in range(a):
                edges[count, :2], edges[count, 2:] = picture[a], picture[b]
                count += 1
    return count


@njit(cache=True)
def _corners_of_box(corners: Array, c: Array, M: Array, h: Array, length: float, near: float) -> int:
    """Fill (8, 3) corners in C, number k having bit 0, 1, 2 set on its far sides; return how many lie behind `near`."""
    behind = 0
    for k in range(8):
        a, b, e = h[0] * (2 * (k & 1) - 1), h[1] * ((k & 2) - 1), length * ((k & 4) / 2 - 1)
        for axis in range(3):
            corners[k, axis] = c[axis] + M[axis, 0] * a + M[axis, 1] * b + M[axis, 2] * e
        behind += corners[k, 0] < near
    return behind


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


# The next four fill the depths at which one row of rays, d = ahead + x across, enters a solid of unit size; NaN or no
# depth before the lens is a miss. They have no branches, so that the compiler can take several rays at once.


@njit(cache=True, error_model="numpy")
def _hit_ball(o: Triple, ahead: Triple, across: Triple, x: Array, depths: Array) -> None:
    """Eq. (1)."""
    c = o[0] * o[0] + o[1] * o[1] + o[2] * o[2] - 1.0
    for j in range(x.shape[0]):
        dx, dy, dz = ahead[0] + x[j] * across[0], ahead[1] + x[j] * across[1], ahead[2] + x[j] * across[2]
        a = dx * dx + dy * dy + dz * dz
        b = o[0] * dx + o[1] * dy + o[2] * dz
        depths[j] = (-b - math.sqrt(b * b - a * c)) / a


@njit(cache=True, error_model="numpy")
def _hit_capsule(o: Triple, ahead: Triple, across: Triple, half: float, x: Array, depths: Array) -> None:
    """Eq. (2); a ray that enters the endless tube beyond one of its ends may hit that end's ball."""
    c = o[0] * o[0] + o[1] * o[1] - 1.0
    for j in range(x.shape[0]):
        dx, dy, dz = ahead[0] + x[j] * across[0], ahead[1] + x[j] * across[1], ahead[2] + x[j] * across[2]
        a = max(dx * dx + dy * dy, _ALONG)
        b = o[0] * dx + o[1] * dy
        side = (-b - math.sqrt(b * b - a * c)) / a
        z = o[2] + side * dz
        from_end = o[2] - math.copysign(half, z)
        a += dz * dz
        b += from_end * dz
        end = (-b - math.sqrt(b * b - a * (c + from_end * from_end))) / a
        depths[j] = side if abs(z) <= half else end


@njit(cache=True, error_model="numpy")
def _hit_cylinder(o: Triple, ahead: Triple, across: Triple, half: float, x: Array, depths: Array) -> None:
    """Eq. (2); a ray that enters the endless tube beyond one of its ends may come in through that end."""
    c = o[0] * o[0] + o[1] * o[1] - 1.0
    for j in range(x.shape[0]):
        dx, dy, dz = ahead[0] + x[j] * across[0], ahead[1] + x[j] * across[1], ahead[2] + x[j] * across[2]
        a = max(dx * dx + dy * dy, _ALONG)
        b = o[0] * dx + o[1] * dy
        side = (-b - math.sqrt(b * b - a * c)) / a
        z = o[2] + side * dz
        end = (math.copysign(half, z) - o[2]) / dz
        px, py = o[0] + end * dx, o[1] + end * dy
        depths[j] = side if abs(z) <= half else (end if dz * z < 0.0 and px * px + py * py <= 1.0 else math.nan)


@njit(cache=True, error_model="numpy")
def _hit_box(o: Triple, ahead: Triple, across: Triple, x: Array, depths: Array) -> None:
    """Eq. (3)."""
    for j in range(x.shape[0]):
        dx, dy, dz = ahead[0] + x[j] * across[0], ahead[1] + x[j] * across[1], ahead[2] + x[j] * across[2]
        ax, ay, az = (-1.0 - o[0]) / dx, (-1.0 - o[1]) / dy, (-1.0 - o[2]) / dz
        bx, by, bz = (1.0 - o[0]) / dx, (1.0 - o[1]) / dy, (1.0 - o[2]) / dz
        enters = max(min(ax, bx), min(ay, by), min(az, bz))
        leaves = min(max(ax, bx), max(ay, by), max(az, bz))
        depths[j] = enters if enters <= leaves else math.nan


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
