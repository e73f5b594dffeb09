"""The visible triangle meshes of a model, in one table: what draws them, rays and mirrors take them from here.

A corner is a place with a normal: where a mesh has several normals in one place, its corners are several. Where a
normal leans more than 36 degrees from a triangle's own, the triangle's stands for it there, as in MuJoCo's renderer
(which does so from 37 degrees on). A mesh is cut into patches of triangles that follow one another in its own order,
each with a ball around it, and those into runs of at most eight, each in a box.
"""

from typing import NamedTuple

import mujoco
import numpy as np
from numpy.typing import NDArray

from dockair.rotations import Array
from dockair.sim.camera.solids import VISIBLE_GROUPS

_PATCH, _RUN = 64, 8  # triangles in a ball, and in a box
_NO_AREA_M2 = 1e-9  # twice the area of a triangle that is left out
_CREASE = 0.809  # cosine of the lean of a normal from which an edge counts as sharp

#: Corners (n, 3), their normals (n, 3) and triangles (m, 3).
Mesh = tuple[Array, Array, NDArray[np.int64]]


class Meshes(NamedTuple):
    """Patches of the mesh geoms that are drawn, in the model's order; lengths in their geom's axes."""

    geoms: NDArray[np.int64]  #: (k,) numbers in the model
    reflectances: Array  #: (k,)
    centres_m: Array  #: (k, 3) of a ball around each
    radii_m: Array  #: (k,)
    first_corner: NDArray[np.int64]  #: (k + 1,) where the corners of each begin
    first_triangle: NDArray[np.int64]  #: (k + 1,) where its triangles begin
    first_run: NDArray[np.int64]  #: (k + 1,) where its runs begin
    corners_m: Array  #: (n, 3)
    normals: Array  #: (n, 3) unit vectors outward
    triangles: NDArray[np.int64]  #: (m, 3) numbers of corners, counter-clockwise from outside
    planes: Array  #: (4, m) the triangles' unit normals n, and n . p of the points p in their planes [m]
    run_start: NDArray[np.int64]  #: (r + 1,) first triangle of each run
    run_box_m: Array  #: (r, 2, 3) lowest and highest corner

    @classmethod
    def of(cls, model: mujoco.MjModel) -> "Meshes":
        """Take what is drawn."""
        is_mesh = model.geom_type == int(mujoco.mjtGeom.mjGEOM_MESH)
        visible = VISIBLE_GROUPS[model.geom_group].astype(bool) & (model.geom_rgba[:, 3] > 0.0)
        cut = {int(i): _patches(mesh_of(model, int(model.geom_dataid[i]))) for i in np.flatnonzero(is_mesh & visible)}
        geoms = np.array([i for i, patches in cut.items() for _ in patches], dtype=np.int64)
        parts = [patch for patches in cut.values() for patch in patches]
        corners, normals, triangles = (np.concatenate([np.empty((0, 3)), *(p[k] for p in parts)]) for k in range(3))
        first_corner, first_triangle = (_starts([len(part[k]) for part in parts]) for k in (0, 2))
        triangles = triangles.astype(np.int64) + np.repeat(first_corner[:-1], np.diff(first_triangle))[:, None]
        runs = [np.arange(0, len(part[2]), _RUN) for part in parts]
        begun = [starts + first for starts, first in zip(runs, first_triangle, strict=False)]
        boxes = [
            _box(part[0][part[2][s : s + _RUN].ravel()])
            for part, starts in zip(parts, runs, strict=True)
            for s in starts
        ]
        middles = [_box(part[0]).mean(axis=0) for part in parts]
        return cls(
            geoms=geoms,
            reflectances=np.array(model.geom_rgba[geoms, 0], dtype=float),
            centres_m=np.reshape(middles, (-1, 3)),
            radii_m=np.array([np.linalg.norm(p[0] - c, axis=1).max() for p, c in zip(parts, middles, strict=True)]),
            first_corner=first_corner,
            first_triangle=first_triangle,
            first_run=_starts([len(starts) for starts in runs]),
            corners_m=corners,
            normals=normals,
            triangles=triangles,
            planes=_planes(corners[triangles]),
            run_start=np.concatenate([*begun, first_triangle[-1:]]).astype(np.int64),
            run_box_m=np.reshape(boxes, (-1, 2, 3)),
        )

    def one(self, k: int) -> Mesh:
        """Corners about the ball's centre, normals and triangles of patch k."""
        first, stop = self.first_corner[k], self.first_corner[k + 1]
        triangles = self.triangles[self.first_triangle[k] : self.first_triangle[k + 1]]
        return self.corners_m[first:stop] - self.centres_m[k], self.normals[first:stop], triangles - first


def mesh_of(model: mujoco.MjModel, mesh: int) -> Mesh:
    """Corners (n, 3), their normals (n, 3) and triangles (m, 3) with any area of a mesh, in the axes MuJoCo gave it."""
    vertices = _part(model.mesh_vert, model.mesh_vertadr[mesh], model.mesh_vertnum[mesh])
    normals = _part(model.mesh_normal, model.mesh_normaladr[mesh], model.mesh_normalnum[mesh])
    faces = _part(model.mesh_face, model.mesh_faceadr[mesh], model.mesh_facenum[mesh]).astype(np.int64)
    shading = _part(model.mesh_facenormal, model.mesh_faceadr[mesh], model.mesh_facenum[mesh]).astype(np.int64)
    normals, (a, b, c) = _units(normals), (vertices[faces[:, k]] for k in range(3))
    twice_area = np.cross(b - a, c - a)
    has_area = np.linalg.norm(twice_area, axis=1) > _NO_AREA_M2
    faces, shading, flat = faces[has_area], shading[has_area], _units(twice_area[has_area])
    is_sharp = np.einsum("ikj,ij->ik", normals[shading], flat) < _CREASE
    shading = np.where(is_sharp, len(normals) + np.arange(len(faces))[:, None], shading)
    pairs, number = np.unique(np.column_stack([faces.ravel(), shading.ravel()]), axis=0, return_inverse=True)
    return vertices[pairs[:, 0]], np.vstack([normals, flat])[pairs[:, 1]], number.reshape(-1, 3).astype(np.int64)


def _part(table: Array, first: int, count: int) -> Array:
    return np.array(table[first : first + count], dtype=float)


def _units(vectors: Array) -> Array:
    return np.asarray(vectors / np.maximum(np.linalg.norm(vectors, axis=1, keepdims=True), np.finfo(float).tiny))


def _patches(mesh: Mesh) -> list[Mesh]:
    """Cut a mesh; corners on the cuts are in several patches."""
    corners, normals, triangles = mesh
    patches = []
    for start in range(0, len(triangles), _PATCH):
        used, number = np.unique(triangles[start : start + _PATCH], return_inverse=True)
        patches.append((corners[used], normals[used], number.reshape(-1, 3).astype(np.int64)))
    return patches


def _planes(corners: Array) -> Array:
    """(4, m) as of `Meshes`, from (m, 3, 3) corners."""
    a, b, c = corners[:, 0], corners[:, 1], corners[:, 2]
    n = _units(np.cross(b - a, c - a))
    return np.vstack([n.T, np.sum(n * a, axis=1)])


def _box(points: Array) -> Array:
    return np.array([points.min(axis=0), points.max(axis=0)])


def _starts(counts: list[int]) -> NDArray[np.int64]:
    return np.cumsum([0, *counts]).astype(np.int64)
