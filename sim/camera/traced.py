"""Draws solids by intersecting rays with them in closed form: the background without OpenGL.

In camera axes C a block's ray is d = (1, -x, -y), so that the parameter t of a hit is its depth. In a solid's own axes
and in units of its size, o being the lens and w = o x d, a ray enters

    ball      |o + t d|^2 = 1                  t = -(o.d + s)/d.d,   s^2 = d.d - w.w,   n = (d x w - s d)/d.d        (1)
    tube      the same across its axis                                                                           (2)
    box       |o + t d|_k <= 1, k = x, y, z    where the last of three slabs is entered                          (3)

s and the place n of the entry are no small differences of large numbers, so that single precision is enough: w is
linear in x, and its coefficients are worked out in double precision. A capsule is a tube up to its two balls, a
cylinder a tube cut by one slab. The nearest solid wins, block by block. Only entries count: a solid that the lens
stands in is not seen, as with OpenGL's culled back faces. What a block shows depends on its own ray alone; which are
looked at for a solid, `spans` says. Meshes are `traced_meshes`. The haze is laid over when all are drawn.

Not modelled: more than one ray a block (edges are steps of a block).
Source: Glassner (ed.), An Introduction to Ray Tracing, ch. 2.
"""

import mujoco
import numpy as np
from numpy.typing import NDArray

from dockair.kernels import njit
from dockair.rotations import Array
from dockair.sim.camera.fading import clear, lay_before
from dockair.sim.camera.mesh_view import MeshView, view_meshes
from dockair.sim.camera.meshes import Meshes
from dockair.sim.camera.solids import BALL, BOX, CAPSULE, CYLINDER, Haze, Lighting, Solids, depth_limits_m
from dockair.sim.camera.spans import Placed, place
from dockair.sim.camera.traced_meshes import trace_meshes
from dockair.triples import Vector, cross

_F = np.float32
_ZERO, _ONE, _MISS = _F(0.0), _F(1.0), _F(np.nan)
_ALONG = _F(1e-30)  # least squared component across a tube, of a ray that runs along it
_LANES = 16  # rays that are taken at once

Row = NDArray[np.float32]
Picture = NDArray[np.float32]  # (rows, columns)
Where = tuple[np.uint64, np.uint64, np.uint64]  # row, first column, one past the last
Single = tuple[np.float32, np.float32, np.float32]
#: Of one row, in a solid's axes and units: o; d = a + x b; w = p + x q.
Rays = tuple[Single, Single, Single, Single, Single]
Shade = tuple[np.float32, np.float32, np.float32, np.float32]  # reflectance, ambient and direct light, near plane


class TracedSolids:
    """Draws the solids of a model by rays.

    Raises:
        DockairError: the model has a visible geom that is no solid.
    """

    name = "analytic"

    def __init__(self, model: mujoco.MjModel, lighting: Lighting) -> None:
        self._solids, self._meshes, self._lighting = Solids.of(model), Meshes.of(model), lighting
        self._limits_m, self._view = depth_limits_m(model), MeshView.room_for(self._meshes)
        self._depths = np.empty(0, dtype=np.float32)  # far wherever nothing is drawn, between pictures everywhere
        self._placed = Placed.room_for(len(self._solids.geoms), 0)

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
            x: (columns,) evenly spaced tangents to the right of the axis, of the blocks' centres.
            y: (rows,) evenly spaced tangents below it.
            haze: the air in between.
        """
        R_WC, p_WC = pose
        s, light, (near, far) = self._solids, self._lighting, self._limits_m
        most = len(s.geoms) * len(y)
        if len(self._placed.runs) < most:
            self._placed = Placed.room_for(len(s.geoms), len(y))
        if self._depths.size < out.size:
            self._depths = np.full(out.size, far, dtype=np.float32)
        poses = s.geoms, data.geom_xpos, data.geom_xmat
        count = place(s.kinds, s.half_sizes_m, poses, (R_WC, p_WC), x, y, near, self._placed)
        nearest, reach = self._depths[: out.size].reshape(out.shape), np.empty((len(y), 2), dtype=np.int64)
        solids = s.kinds, s.half_sizes_m, s.reflectances
        shade, sun_C = (light.ambient, light.direct), R_WC.T @ light.toward_W
        _trace(out, nearest, reach, solids, self._placed, count, x, y, sun_C, shade, near)
        triangles = view_meshes(self._meshes, poses[1:], pose, x, y, sun_C, shade, near, self._view)
        trace_meshes(out, nearest, reach, self._meshes, self._view, triangles, x, y, near)
        if haze.extinction_1_m > 0.0:
            lay_before(out, nearest, reach, x, y, haze.extinction_1_m, haze.airlight, far)
        clear(nearest, reach, far)

    def close(self) -> None:
        """Nothing to free."""


@njit(cache=True)
def _trace(
    out: NDArray[np.float32],
    nearest: NDArray[np.float32],
    reach: NDArray[np.int64],
    solids: tuple[NDArray[np.int64], Array, Array],
    placed: Placed,
    count: int,
    x: Array,
    y: Array,
    sun_C: Array,
    light: tuple[float, float],
    near: float,
) -> None:
    """Draw the first `count` placed solids, without haze; `nearest` (rows, columns) holds depths so far.

    `reach` (rows, 2) is filled with the first column that may have been drawn in each row and one past the last.
    """
    reach[:, 0], reach[:, 1] = len(x), 0
    kinds, half_sizes, reflectances = solids
    runs, tangents = placed.runs, x.astype(np.float32)
    for k in range(count):
        g = placed.solid[k]
        kind, h, M, c = kinds[g], half_sizes[g], placed.axes_C[k], placed.centre_C[k]
        # To the solid's own axes, in units of its size: a unit ball, a tube of radius 1, a cube of half side 1
        unit = (h[0], h[0], h[0]) if kind in (CAPSULE, CYLINDER) else (h[0], h[1], h[2])
        o = _to_unit(-c[0], -c[1], -c[2], M, unit)
        ahead, across = _to_unit(1.0, 0.0, 0.0, M, unit), _to_unit(0.0, -1.0, 0.0, M, unit)
        down, q = _to_unit(0.0, 0.0, -1.0, M, unit), cross(o, across)
        sun = _single(_to_unit(sun_C[0], sun_C[1], sun_C[2], M, (1.0, 1.0, 1.0)))
        half, inverse = _F(h[2] / h[0]), _single((1.0 / h[0], 1.0 / h[1], 1.0 / h[2]))
        row, stop, run = placed.rows[k]
        for i in range(row, stop):
            left, right = runs[run + i - row, 0], runs[run + i - row, 1]
            if left == right:
                continue
            right = min(left + (right - left + _LANES - 1) // _LANES * _LANES, len(x))
            reach[i, 0], reach[i, 1] = min(reach[i, 0], left), max(reach[i, 1], right)
            a = (ahead[0] + y[i] * down[0], ahead[1] + y[i] * down[1], ahead[2] + y[i] * down[2])
            rays = _single(o), _single(a), _single(across), _single(cross(o, a)), _single(q)
            shade, where = (
                (_F(reflectances[g]), _F(light[0]), _F(light[1]), _F(near)),
                (np.uint64(i), np.uint64(left), np.uint64(right)),
            )
            if kind == BALL:
                _draw_ball(rays, inverse, sun, shade, tangents, out, nearest, where)
            elif kind == BOX:
                _draw_box(rays, sun, shade, tangents, out, nearest, where)
            elif kind == CAPSULE:
                _draw_capsule(rays, half, sun, shade, tangents, out, nearest, where)
            else:
                _draw_cylinder(rays, half, sun, shade, tangents, out, nearest, where)


@njit(cache=True)
def _to_unit(a: float, b: float, c: float, M: Array, unit: Vector) -> Vector:
    """Turn a vector of C into a solid's axes and scale it to units of its size."""
    return (
        (M[0, 0] * a + M[1, 0] * b + M[2, 0] * c) / unit[0],
        (M[0, 1] * a + M[1, 1] * b + M[2, 1] * c) / unit[1],
        (M[0, 2] * a + M[1, 2] * b + M[2, 2] * c) / unit[2],
    )


@njit(cache=True)
def _single(a: Vector) -> Single:
    return _F(a[0]), _F(a[1]), _F(a[2])


# The next four draw a row of a kind of solid. What they call has no branches, so that the compiler takes several rays
# at once; it returns the depth at which a ray enters a solid, NaN or before the lens for a miss, and the cosine of the
# Sun's incidence there.


@njit(cache=True, error_model="numpy")
def _draw_ball(
    rays: Rays, inverse: Single, sun: Single, shade: Shade, x: Row, out: Picture, nearest: Picture, where: Where
) -> None:
    row, left, right = where
    for k in range(right - left):
        j = left + np.uint64(k)
        t, cos = _enter_ball(rays, inverse, sun, x[j])
        out[row, j], nearest[row, j] = _lay_over(t, cos, shade, out[row, j], nearest[row, j])


@njit(cache=True, error_model="numpy")
def _draw_capsule(
    rays: Rays, half: np.float32, sun: Single, shade: Shade, x: Row, out: Picture, nearest: Picture, where: Where
) -> None:
    row, left, right = where
    for k in range(right - left):
        j = left + np.uint64(k)
        t, cos = _enter_capsule(rays, half, sun, x[j])
        out[row, j], nearest[row, j] = _lay_over(t, cos, shade, out[row, j], nearest[row, j])


@njit(cache=True, error_model="numpy")
def _draw_cylinder(
    rays: Rays, half: np.float32, sun: Single, shade: Shade, x: Row, out: Picture, nearest: Picture, where: Where
) -> None:
    row, left, right = where
    for k in range(right - left):
        j = left + np.uint64(k)
        t, cos = _enter_cylinder(rays, half, sun, x[j])
        out[row, j], nearest[row, j] = _lay_over(t, cos, shade, out[row, j], nearest[row, j])


@njit(cache=True, error_model="numpy")
def _draw_box(rays: Rays, sun: Single, shade: Shade, x: Row, out: Picture, nearest: Picture, where: Where) -> None:
    row, left, right = where
    for k in range(right - left):
        j = left + np.uint64(k)
        t, cos = _enter_box(rays, sun, x[j])
        out[row, j], nearest[row, j] = _lay_over(t, cos, shade, out[row, j], nearest[row, j])


@njit(cache=True, error_model="numpy", inline="always")
def _enter_ball(rays: Rays, inverse: Single, sun: Single, x: np.float32) -> tuple[np.float32, np.float32]:
    """Eq. (1); `inverse` are the inverses of the half axes."""
    o, a, b, p, q = rays
    dx, dy, dz = a[0] + x * b[0], a[1] + x * b[1], a[2] + x * b[2]
    wx, wy, wz = p[0] + x * q[0], p[1] + x * q[1], p[2] + x * q[2]
    dd = dx * dx + dy * dy + dz * dz
    s = np.sqrt(dd - (wx * wx + wy * wy + wz * wz))
    nx, ny, nz = dy * wz - dz * wy - s * dx, dz * wx - dx * wz - s * dy, dx * wy - dy * wx - s * dz
    nx, ny, nz = nx * inverse[0], ny * inverse[1], nz * inverse[2]
    cos = (nx * sun[0] + ny * sun[1] + nz * sun[2]) / np.sqrt(nx * nx + ny * ny + nz * nz)
    return -(o[0] * dx + o[1] * dy + o[2] * dz + s) / dd, cos


@njit(cache=True, error_model="numpy", inline="always")
def _enter_capsule(rays: Rays, half: np.float32, sun: Single, x: np.float32) -> tuple[np.float32, np.float32]:
    """Eq. (2); a ray that enters the endless tube beyond one of its ends may hit that end's ball."""
    o, a, b, p, q = rays
    dx, dy, dz = a[0] + x * b[0], a[1] + x * b[1], a[2] + x * b[2]
    wx, wy, wz = p[0] + x * q[0], p[1] + x * q[1], p[2] + x * q[2]
    dd, od = max(dx * dx + dy * dy, _ALONG), o[0] * dx + o[1] * dy
    s, k = np.sqrt(dd - wz * wz), _ONE / dd
    side = -(od + s) * k
    z = o[2] + side * dz
    cos_side = ((dy * wz - s * dx) * sun[0] - (dx * wz + s * dy) * sun[1]) * k
    to_end = -half if z > _ZERO else half  # o is moved by it along the axis
    wx, wy = wx - to_end * dy, wy + to_end * dx
    dd, od = dd + dz * dz, od + (o[2] + to_end) * dz
    s, k = np.sqrt(dd - (wx * wx + wy * wy + wz * wz)), _ONE / dd
    nx, ny, nz = dy * wz - dz * wy - s * dx, dz * wx - dx * wz - s * dy, dx * wy - dy * wx - s * dz
    cos_end = (nx * sun[0] + ny * sun[1] + nz * sun[2]) * k
    on_side = abs(z) <= half
    return side if on_side else -(od + s) * k, cos_side if on_side else cos_end


@njit(cache=True, error_model="numpy", inline="always")
def _enter_cylinder(rays: Rays, half: np.float32, sun: Single, x: np.float32) -> tuple[np.float32, np.float32]:
    """Eq. (2); a ray that enters the endless tube beyond one of its ends may come in through that end."""
    o, a, b, p, q = rays
    dx, dy, dz = a[0] + x * b[0], a[1] + x * b[1], a[2] + x * b[2]
    wz = p[2] + x * q[2]
    dd, od = max(dx * dx + dy * dy, _ALONG), o[0] * dx + o[1] * dy
    s, k = np.sqrt(dd - wz * wz), _ONE / dd
    side, leaves = -(od + s) * k, (s - od) * k
    z = o[2] + side * dz
    at_end = ((half if z > _ZERO else -half) - o[2]) / dz
    enters = (dz * z < _ZERO) & (at_end <= leaves)
    cos_side = ((dy * wz - s * dx) * sun[0] - (dx * wz + s * dy) * sun[1]) * k
    cos_end = sun[2] if z > _ZERO else -sun[2]
    on_side = abs(z) <= half
    return side if on_side else (at_end if enters else _MISS), cos_side if on_side else cos_end


@njit(cache=True, error_model="numpy", inline="always")
def _enter_box(rays: Rays, sun: Single, x: np.float32) -> tuple[np.float32, np.float32]:
    """Eq. (3)."""
    o, a, b, _, _ = rays
    dx, dy, dz = a[0] + x * b[0], a[1] + x * b[1], a[2] + x * b[2]
    kx, ky, kz = _ONE / dx, _ONE / dy, _ONE / dz
    ax, ay, az = (-_ONE - o[0]) * kx, (-_ONE - o[1]) * ky, (-_ONE - o[2]) * kz
    bx, by, bz = (_ONE - o[0]) * kx, (_ONE - o[1]) * ky, (_ONE - o[2]) * kz
    in_x, in_y, in_z = min(ax, bx), min(ay, by), min(az, bz)
    enters, leaves = max(in_x, in_y, in_z), min(max(ax, bx), max(ay, by), max(az, bz))
    cos_x, cos_y = -sun[0] if dx > _ZERO else sun[0], -sun[1] if dy > _ZERO else sun[1]
    cos_z = -sun[2] if dz > _ZERO else sun[2]
    cos = cos_x if in_x == enters else (cos_y if in_y == enters else cos_z)
    return enters if enters <= leaves else _MISS, cos


@njit(cache=True, inline="always")
def _lay_over(
    t: np.float32, cos: np.float32, shade: Shade, behind: np.float32, nearest: np.float32
) -> tuple[np.float32, np.float32]:
    """Radiance, [solids, eq 1] without haze, and depth of a solid where it is nearest so far, else what is behind."""
    reflectance, ambient, direct, near = shade
    seen = (t >= near) & (t < nearest)  # NaN is a miss
    radiance = reflectance * (ambient + direct * (cos if cos > _ZERO else _ZERO))
    return radiance if seen else behind, t if seen else nearest
