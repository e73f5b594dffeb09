"""What hides what: rays from a point through the scene's real geometry. No OpenGL, so both backgrounds agree.

Every solid but a mesh is convex: a ray is in it from one distance to another, and meets it at the first of the two that
is not behind its start; surfaces are met from inside, too. In a solid's own axes, o being the start and d the ray,

    ball       |A^-1 (o + t d)|^2 <= 1                      A = diag of half axes                                (1)
    tube       (o + t d)_x^2 + (o + t d)_y^2 <= r^2                                                              (2)
    slab       |o + t d|_k <= h_k                                                                                (3)

A box is what three slabs share, a cylinder a tube and a slab; a capsule is a cylinder and the balls at its ends. A
triangle with corners a, b, c of a mesh is met at t, where

    o + t d = a + u (b - a) + v (c - a),    u >= 0, v >= 0, u + v <= 1                                           (4)

Solids beside a cone around all rays from one point are not looked at; rays with starts of their own are each measured
against the balls around all solids first. Only geoms that are drawn hide: those in a visible group and not fully
transparent.
Not modelled: partly hidden sources (a source is a point), transparent things.
Sources: Glassner (ed.), An Introduction to Ray Tracing, ch. 2; Moeller & Trumbore 1997 (4).
"""

import math

import mujoco
import numpy as np
from numpy.typing import NDArray

from dockair.kernels import njit
from dockair.rotations import Array
from dockair.sim.camera.meshes import Meshes
from dockair.sim.camera.obstacles import Obstacles
from dockair.sim.camera.solids import BALL, BOX, CAPSULE
from dockair.triples import Vector, cross, dot, turned, turned_back

_ALONG = 1e-300  # least squared component across a tube, of a ray that does not run along it
_ROUNDING = 1e-9  # of distances to boxes, relative and in metres
_SPARE_M = 1e-6  # between a ball around a solid and rays beside it: far more than rounding
_NOWHERE = (math.inf, -math.inf)

Part = tuple[float, float]  # of a ray: from one distance to another; nothing where the second is less
Cone = tuple[Vector, float, float]  # axis, cosine and sine of the half angle, less than a right one
_ALL_AROUND: Cone = ((0.0, 0.0, 0.0), 0.0, 0.0)


def is_clear(obstacles: Obstacles, data: mujoco.MjData, p_W: Array, direction_W: Array, distance_m: float) -> bool:
    """Say whether nothing visible lies within `distance_m` of p_W along a unit vector."""
    hit = first_hits(obstacles, data, p_W, np.array(direction_W, dtype=float, ndmin=2), math.inf)[0]
    return bool(hit < 0.0 or hit >= distance_m)


def rays_are_clear(
    obstacles: Obstacles, data: mujoco.MjData, starts_W: Array, directions_W: Array, distances_m: Array
) -> NDArray[np.bool_]:
    """(n,) `is_clear` of many rays, each from a start of its own (n, 3)."""
    out = np.empty(len(starts_W), dtype=np.bool_)
    _clear_rays(obstacles, data.geom_xpos, data.geom_xmat, starts_W, directions_W, distances_m, out)
    return out


def hidden(
    obstacles: Obstacles, data: mujoco.MjData, p_WC: Array, targets_W: Array, clearance_m: float
) -> NDArray[np.bool_]:
    """(n,) whether something stands between a point and each of the targets.

    Args:
        obstacles: geoms.
        data: their poses, up to date; not changed.
        p_WC: (3,) the lens [m].
        targets_W: (n, 3) [m].
        clearance_m: what lies nearer to a target than this, on the lens's side, does not hide it.
    """
    rays = np.asarray(targets_W, dtype=float) - p_WC
    distances = np.linalg.norm(rays, axis=1)
    reach = float(distances.max(initial=0.0))
    hits = first_hits(obstacles, data, p_WC, rays / np.maximum(distances, np.finfo(float).tiny)[:, None], reach)
    return np.asarray((hits >= 0.0) & (hits < distances - clearance_m))


def clear_directions(obstacles: Obstacles, data: mujoco.MjData, p_W: Array, directions: Array) -> NDArray[np.bool_]:
    """(n,) whether nothing visible lies along each of the unit vectors (n, 3) from a point, however far."""
    return np.asarray(first_hits(obstacles, data, p_W, np.asarray(directions, dtype=float), math.inf) < 0.0)


def first_hits(obstacles: Obstacles, data: mujoco.MjData, p_W: Array, directions: Array, reach: float) -> Array:
    """(n,) distances along unit vectors (n, 3) to the nearest surface [m]; -1 for none within `reach`."""
    out = np.empty(len(directions))
    _first_hits(obstacles, data.geom_xpos, data.geom_xmat, p_W, directions, reach, out)
    return out


@njit(cache=True)
def _first_hits(
    obstacles: Obstacles, xpos: Array, xmat: Array, p: Array, directions: Array, reach: float, out: Array
) -> None:
    out[:] = reach
    _cast(obstacles, xpos, xmat, p, directions, out)
    for i in range(len(out)):
        if out[i] == reach:
            out[i] = -1.0


@njit(cache=True)
def _clear_rays(
    obstacles: Obstacles,
    xpos: Array,
    xmat: Array,
    starts: Array,
    directions: Array,
    distances: Array,
    out: NDArray[np.bool_],
) -> None:
    """Fill (n,) whether no surface is nearer to a start than its distance."""
    patches, balls = len(obstacles.meshes.geoms), _balls_around(obstacles, xpos, xmat)
    near = np.empty(balls.shape[1], dtype=np.bool_)
    for i in range(len(starts)):
        out[i], reach = True, distances[i]
        if not reach > 0.0:
            continue
        p, d = (starts[i, 0], starts[i, 1], starts[i, 2]), (directions[i, 0], directions[i, 1], directions[i, 2])
        _mark_near(balls, p, d, reach, near)
        for k in range(patches):
            if near[k] and _meets_patch(obstacles.meshes, k, xpos, xmat, p, d, reach) < reach:
                out[i] = False
                break
        for k in range(patches, len(near)):
            if not out[i]:
                break
            if near[k] and _meets_solid(obstacles, k - patches, xpos, xmat, p, d, reach) < reach:
                out[i] = False


@njit(cache=True)
def _balls_around(obstacles: Obstacles, xpos: Array, xmat: Array) -> Array:
    """(4, n) centres and radii, a little too large, of balls around the meshes' patches and then the solids, in W."""
    meshes, patches = obstacles.meshes, len(obstacles.meshes.geoms)
    out = np.empty((4, patches + len(obstacles.geoms)))
    for k in range(patches):
        g, m = meshes.geoms[k], meshes.centres_m[k]
        from_geom = turned(xmat[g], (m[0], m[1], m[2]))
        for axis in range(3):
            out[axis, k] = xpos[g, axis] + from_geom[axis]
        out[3, k] = meshes.radii_m[k] + _SPARE_M
    for k in range(len(obstacles.geoms)):
        for axis in range(3):
            out[axis, patches + k] = xpos[obstacles.geoms[k], axis]
        out[3, patches + k] = obstacles.radii_m[k] + _SPARE_M
    return out


@njit(cache=True)
def _mark_near(balls: Array, p: Vector, d: Vector, reach: float, out: NDArray[np.bool_]) -> None:
    """Fill (n,) which balls (4, n) a ray may meet within `reach`; without branches, so that many are taken at once."""
    x, y, z, radius = balls[0], balls[1], balls[2], balls[3]
    for k in range(len(out)):
        r = (x[k] - p[0], y[k] - p[1], z[k] - p[2])
        along = dot(r, d)
        is_beside = dot(r, r) - along * along > radius[k] * radius[k]
        out[k] = not (is_beside | (along + radius[k] < 0.0) | (along - radius[k] > reach))


@njit(cache=True)
def _cone_around(directions: Array) -> Cone:
    """A cone that holds unit vectors (n, 3); all around where they stand wide apart."""
    x, y, z = directions[:, 0].sum(), directions[:, 1].sum(), directions[:, 2].sum()
    length = math.sqrt(x * x + y * y + z * z)
    if length == 0.0:
        return _ALL_AROUND
    x, y, z, square = x / length, y / length, z / length, 0.0
    for i in range(len(directions)):
        a, b, c = directions[i, 0], directions[i, 1], directions[i, 2]
        along = a * x + b * y + c * z
        if along <= 0.0:
            return _ALL_AROUND
        square = max(square, (a - along * x) ** 2 + (b - along * y) ** 2 + (c - along * z) ** 2)
    return (x, y, z), math.sqrt(max(1.0 - square, 0.0)), math.sqrt(square)


@njit(cache=True)
def _is_beside(p: Vector, radius: float, cone: Cone) -> bool:
    """Whether a plane through the cone's tip parts it from a ball about p."""
    axis, cosine, sine = cone
    along = dot(p, axis)
    return cosine * math.sqrt(max(dot(p, p) - along * along, 0.0)) - sine * along > radius + _SPARE_M


@njit(cache=True)
def _cast(obstacles: Obstacles, xpos: Array, xmat: Array, p: Array, directions: Array, nearest: Array) -> None:
    """Lower (n,) distances to those of the nearest surface."""
    cone, start = _cone_around(directions), (p[0], p[1], p[2])
    _cast_at_meshes(obstacles.meshes, xpos, xmat, p, directions, cone, nearest)
    for k in range(len(obstacles.geoms)):
        g, radius = obstacles.geoms[k], obstacles.radii_m[k]
        x, y, z = xpos[g, 0] - p[0], xpos[g, 1] - p[1], xpos[g, 2] - p[2]
        if _is_beside((x, y, z), radius, cone):
            continue
        square = x * x + y * y + z * z
        for i in range(len(nearest)):
            d = (directions[i, 0], directions[i, 1], directions[i, 2])
            along = x * d[0] + y * d[1] + z * d[2]
            if square - along * along > radius * radius or along + radius < 0.0 or along - radius > nearest[i]:
                continue
            nearest[i] = _meets_solid(obstacles, k, xpos, xmat, start, d, nearest[i])


@njit(cache=True)
def _cast_at_meshes(
    meshes: Meshes, xpos: Array, xmat: Array, p: Array, directions: Array, cone: Cone, nearest: Array
) -> None:
    """The same for meshes; the cone holds all rays."""
    for k in range(len(meshes.geoms)):
        g, radius = meshes.geoms[k], meshes.radii_m[k]
        M, m = xmat[g], meshes.centres_m[k]
        o = turned_back(M, (p[0] - xpos[g, 0], p[1] - xpos[g, 1], p[2] - xpos[g, 2]))
        x, y, z = m[0] - o[0], m[1] - o[1], m[2] - o[2]
        if _is_beside((x, y, z), radius, (turned_back(M, cone[0]), cone[1], cone[2])):
            continue
        square = x * x + y * y + z * z
        for i in range(len(nearest)):
            ray = turned_back(M, (directions[i, 0], directions[i, 1], directions[i, 2]))
            along = x * ray[0] + y * ray[1] + z * ray[2]
            if square - along * along > radius * radius or along + radius < 0.0 or along - radius > nearest[i]:
                continue
            nearest[i] = _meets_runs(meshes, k, o, ray, nearest[i])


@njit(cache=True)
def _meets_solid(obstacles: Obstacles, k: int, xpos: Array, xmat: Array, p: Vector, d: Vector, reach: float) -> float:
    """Distance along a ray to a solid; `reach` where that is no less."""
    g, h = obstacles.geoms[k], obstacles.half_sizes_m[k]
    M, o = xmat[g], (p[0] - xpos[g, 0], p[1] - xpos[g, 1], p[2] - xpos[g, 2])
    start, stop = _inside(obstacles.kinds[k], (h[0], h[1], h[2]), turned_back(M, o), turned_back(M, d))
    at = start if start >= 0.0 else stop
    return at if start <= stop and 0.0 <= at < reach else reach


@njit(cache=True)
def _meets_patch(meshes: Meshes, k: int, xpos: Array, xmat: Array, p: Vector, d: Vector, reach: float) -> float:
    """The same for a patch of a mesh."""
    g = meshes.geoms[k]
    M, o = xmat[g], (p[0] - xpos[g, 0], p[1] - xpos[g, 1], p[2] - xpos[g, 2])
    return _meets_runs(meshes, k, turned_back(M, o), turned_back(M, d), reach)


@njit(cache=True)
def _meets_runs(meshes: Meshes, k: int, o: Vector, d: Vector, reach: float) -> float:
    """The same, the ray being in the axes of the patch's geom."""
    for run in range(meshes.first_run[k], meshes.first_run[k + 1]):
        if _meets_box(meshes.run_box_m[run], o, d, reach):
            for t in range(meshes.run_start[run], meshes.run_start[run + 1]):
                reach = min(reach, _meets_triangle(meshes, t, o, d))
    return reach


@njit(cache=True)
def _meets_box(box: Array, o: Vector, d: Vector, reach: float) -> bool:
    start, stop = 0.0, reach
    for k in range(3):
        if d[k] == 0.0:
            if not box[0, k] <= o[k] <= box[1, k]:
                return False
            continue
        one, other = (box[0, k] - o[k]) / d[k], (box[1, k] - o[k]) / d[k]
        start, stop = max(start, min(one, other)), min(stop, max(one, other))
    return start <= stop * (1.0 + _ROUNDING) + _ROUNDING


@njit(cache=True)
def _meets_triangle(meshes: Meshes, t: int, o: Vector, d: Vector) -> float:
    """Distance, Eq. (4); infinity for a miss."""
    a, b, c = (
        meshes.corners_m[meshes.triangles[t, 0]],
        meshes.corners_m[meshes.triangles[t, 1]],
        meshes.corners_m[meshes.triangles[t, 2]],
    )
    p, q = (b[0] - a[0], b[1] - a[1], b[2] - a[2]), (c[0] - a[0], c[1] - a[1], c[2] - a[2])
    from_a = (o[0] - a[0], o[1] - a[1], o[2] - a[2])
    across, turned = cross(d, q), cross(from_a, p)
    det = dot(p, across)
    if det == 0.0:
        return math.inf
    u, v, at = dot(from_a, across) / det, dot(d, turned) / det, dot(q, turned) / det
    return at if u >= 0.0 and v >= 0.0 and u + v <= 1.0 and at >= 0.0 else math.inf


@njit(cache=True)
def _inside(kind: int, h: Vector, o: Vector, d: Vector) -> Part:
    """Which part of a ray is in a solid."""
    if kind == BALL:
        return _in_ball(h, o, d)
    across = _in_slab(h[2], o[2], d[2])
    if kind == BOX:
        return _shared(_shared(_in_slab(h[0], o[0], d[0]), _in_slab(h[1], o[1], d[1])), across)
    start, stop = _shared(_in_tube(h[0], o, d), across)
    if kind == CAPSULE:
        for end in (-h[2], h[2]):
            first, last = _in_ball((h[0], h[0], h[0]), (o[0], o[1], o[2] - end), d)
            if first <= last:
                start, stop = (min(start, first), max(stop, last)) if start <= stop else (first, last)
    return start, stop


@njit(cache=True)
def _shared(one: Part, other: Part) -> Part:
    return max(one[0], other[0]), min(one[1], other[1])


@njit(cache=True)
def _in_ball(h: Vector, o: Vector, d: Vector) -> Part:
    """Eq. (1)."""
    ox, oy, oz, dx, dy, dz = o[0] / h[0], o[1] / h[1], o[2] / h[2], d[0] / h[0], d[1] / h[1], d[2] / h[2]
    a, b, c = dx * dx + dy * dy + dz * dz, ox * dx + oy * dy + oz * dz, ox * ox + oy * oy + oz * oz - 1.0
    return _roots(a, b, c)


@njit(cache=True)
def _in_tube(r: float, o: Vector, d: Vector) -> Part:
    """Eq. (2)."""
    a, b, c = d[0] * d[0] + d[1] * d[1], o[0] * d[0] + o[1] * d[1], o[0] * o[0] + o[1] * o[1] - r * r
    if a < _ALONG:
        return (-math.inf, math.inf) if c <= 0.0 else _NOWHERE
    return _roots(a, b, c)


@njit(cache=True)
def _in_slab(h: float, o: float, d: float) -> Part:
    """Eq. (3)."""
    if d == 0.0:
        return (-math.inf, math.inf) if abs(o) <= h else _NOWHERE
    return min((-h - o) / d, (h - o) / d), max((-h - o) / d, (h - o) / d)


@njit(cache=True)
def _roots(a: float, b: float, c: float) -> Part:
    """Where a t^2 + 2 b t + c <= 0."""
    square = b * b - a * c
    if square < 0.0:
        return _NOWHERE
    root = math.sqrt(square)
    return (-b - root) / a, (root - b) / a
