"""The visible geoms of a compiled model, body by body, for whoever draws the world without MuJoCo's renderer.

Only geometry and grey value; what moves is the bodies' poses, which `Truth` holds.
"""

from dataclasses import dataclass

import mujoco
import numpy as np

from dockair.rotations import Array

_VISIBLE_GROUPS = np.array([True, True, True, False, False, False])  # MuJoCo's own default
_KINDS = {
    mujoco.mjtGeom.mjGEOM_SPHERE: "ellipsoid",
    mujoco.mjtGeom.mjGEOM_CAPSULE: "capsule",
    mujoco.mjtGeom.mjGEOM_ELLIPSOID: "ellipsoid",
    mujoco.mjtGeom.mjGEOM_CYLINDER: "cylinder",
    mujoco.mjtGeom.mjGEOM_BOX: "box",
    mujoco.mjtGeom.mjGEOM_MESH: "mesh",
}


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Shape:
    """One primitive, fixed in its body."""

    name: str
    body: str
    kind: str  #: "ellipsoid", "box", "capsule", "cylinder" (both along z) or "mesh"
    p_m: Array  #: (3,) its centre in the body's axes
    q_wxyz: Array  #: (4,) its attitude in the body's axes
    half_size_m: Array  #: (3,) half extents; capsule: radius, radius, half length without the caps; mesh: zeros
    rgba: Array  #: (4,) 0-1
    vertices_m: Array | None = None  #: (n, 3) of a mesh
    triangles: Array | None = None  #: (m, 3) indices of its vertices


def shapes_of(model: mujoco.MjModel) -> list[Shape]:
    """Return every geom that is drawn, in the model's order; planes and height fields are left out."""
    visible = _VISIBLE_GROUPS[model.geom_group] & (model.geom_rgba[:, 3] > 0.0)
    return [_shape(model, int(i)) for i in np.flatnonzero(visible) if mujoco.mjtGeom(model.geom_type[i]) in _KINDS]


def _shape(model: mujoco.MjModel, i: int) -> Shape:
    kind = mujoco.mjtGeom(model.geom_type[i])
    size = np.array(model.geom_size[i])
    if kind == mujoco.mjtGeom.mjGEOM_SPHERE:
        size = np.full(3, size[0])
    elif kind in (mujoco.mjtGeom.mjGEOM_CAPSULE, mujoco.mjtGeom.mjGEOM_CYLINDER):
        size = np.array([size[0], size[0], size[1]])
    vertices, triangles = _mesh(model, int(model.geom_dataid[i])) if _KINDS[kind] == "mesh" else (None, None)
    return Shape(
        name=model.geom(i).name,
        body=model.body(model.geom_bodyid[i]).name,
        kind=_KINDS[kind],
        p_m=np.array(model.geom_pos[i]),
        q_wxyz=np.array(model.geom_quat[i]),
        half_size_m=np.zeros(3) if vertices is not None else size,
        rgba=np.array(model.geom_rgba[i], dtype=float),
        vertices_m=vertices,
        triangles=triangles,
    )


def _mesh(model: mujoco.MjModel, mesh: int) -> tuple[Array, Array]:
    vertex, face = model.mesh_vertadr[mesh], model.mesh_faceadr[mesh]
    vertices = model.mesh_vert[vertex : vertex + model.mesh_vertnum[mesh]]
    return np.array(vertices, dtype=float), np.array(model.mesh_face[face : face + model.mesh_facenum[mesh]])
