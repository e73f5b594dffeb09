"""Which pieces draw a scene's solids: patches of its meshes and stretched unit meshes, as fine as the picture needs.

A capsule is a tube and, from a radius of six blocks on, two round ends. What lies wholly beyond one of the frustum's
six planes is left out.

Not modelled: round ends of thinner capsules; theirs are flat and cover the same area.
"""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from dockair.kernels import njit
from dockair.rotations import Array
from dockair.sim.camera.meshes import Meshes
from dockair.sim.camera.solids import BALL, BOX, CAPSULE, Solids
from dockair.sim.camera.unit_meshes import BALLS, CUBE, ENDS, LEVELS, OTHERS, TUBES

_ROUND_END_BLOCKS = 6.0  # radius from which a capsule gets its round ends
_FLAT_END = 0.25 * math.pi  # length of a flat end that covers the area of a round one, in radii
_NEAR = 4  # which of the frustum's planes
_MESH = OTHERS  # this kind and those after it: the model's meshes, one after the other

Frustum = tuple[float, float, float, float]  # tangents of its left, right, top and bottom sides


class Table(NamedTuple):
    """Solids and meshes, in the order in which they are drawn."""

    geoms: NDArray[np.int64]  #: (n,) their numbers in the model
    kinds: NDArray[np.int64]  #: (n,) as of `solids`; a mesh's is its number
    middles_m: Array  #: (n, 3) in their geoms' axes
    half_sizes_m: Array  #: (n, 3) as of `solids`; a mesh's first is the radius of a ball around it
    reflectances: Array  #: (n,)

    @classmethod
    def of(cls, solids: Solids, meshes: Meshes) -> "Table":
        """Join the two."""
        count = len(meshes.geoms)
        around = np.column_stack([meshes.radii_m, np.ones((count, 2))])
        return cls(
            geoms=np.append(solids.geoms, meshes.geoms),
            kinds=np.append(solids.kinds, _MESH + np.arange(count)),
            middles_m=np.vstack([np.zeros((len(solids.geoms), 3)), meshes.centres_m]),
            half_sizes_m=np.vstack([solids.half_sizes_m, around]),
            reflectances=np.append(solids.reflectances, meshes.reflectances),
        )


@njit(cache=True)
def set_planes(planes: Array, R: Array, frustum: Frustum, limits: tuple[float, float]) -> None:
    """Fill (6, 4) outward normals in W, the lens being the origin, and offsets of a frustum's sides.

    The last two are the near and the far one, `limits` their depths; R is R_WC.
    """
    left, right, top, bottom = frustum
    for i in range(3):
        planes[0, i], planes[1, i] = left * R[i, 0] + R[i, 1], -right * R[i, 0] - R[i, 1]
        planes[2, i], planes[3, i] = top * R[i, 0] + R[i, 2], -bottom * R[i, 0] - R[i, 2]
        planes[4, i], planes[5, i] = -R[i, 0], R[i, 0]
    planes[:4, 3], planes[4, 3], planes[5, 3] = 0.0, -limits[0], limits[1]


@njit(cache=True)
def set_pieces(
    solids: Table,
    poses: tuple[Array, Array],
    lens: Array,
    planes: Array,
    scale: float,
    pieces: tuple[NDArray[np.float32], NDArray[np.float32], NDArray[np.float32]],
    meshes: NDArray[np.int64],
    changed: NDArray[np.int64],
) -> tuple[int, int]:
    """Fill what draws all that may be in the frustum; return how many pieces, of how many the mesh is a new one.

    Args:
        solids: of the model.
        poses: (ngeom, 3) places and (ngeom, 9) attitudes of its geoms.
        lens: (3,) place of the camera.
        planes: of `set_planes`.
        scale: blocks of the picture in a tangent of 1.
        pieces: (n, 3) places from the lens, (n, 3, 3) turned and stretched axes, (n, 4) colours; written.
        meshes: (n,) of the pieces; read and written.
        changed: (n,), its first numbers written: of the pieces whose mesh is another than it was.
    """
    places, turns, colours = pieces
    xpos, axes, centre = poses[0], poses[1].reshape((-1, 3, 3)), np.empty(3)
    count, changes = 0, 0
    for g in range(solids.kinds.shape[0]):
        kind, h, M, m = solids.kinds[g], solids.half_sizes_m[g], axes[solids.geoms[g]], solids.middles_m[g]
        for k in range(3):
            centre[k] = xpos[solids.geoms[g], k] - lens[k] + (M[k, 0] * m[0] + M[k, 1] * m[1] + M[k, 2] * m[2])
        if _is_outside(kind, h, M, centre, planes):
            continue
        depth = -_along(planes[_NEAR], centre) - _reach(kind, h, M, planes[_NEAR])
        radius = scale * (max(h[0], h[1], h[2]) if kind == BALL else h[0]) / max(depth, -planes[_NEAR, 3])
        level = 0
        while level < LEVELS.shape[0] - 1 and radius > LEVELS[level]:
            level += 1
        ends = 3 if kind == CAPSULE and radius >= _ROUND_END_BLOCKS else 1
        for part in range(ends):
            side = 1.0 if part < 2 else -1.0  # of a capsule's end; the lower one is the upper one turned about x
            offset = 0.0 if part == 0 else side * h[2]
            length = h[2] + _FLAT_END * h[0] if kind == CAPSULE and ends == 1 else h[2]
            size = (h[0], h[1], length) if part == 0 else (h[0], side * h[0], side * h[0])
            if kind >= _MESH:
                mesh, size = kind, (1.0, 1.0, 1.0)
            elif kind == BOX:
                mesh = CUBE
            elif part > 0:
                mesh = ENDS + level
            else:
                mesh = (BALLS if kind == BALL else TUBES) + level
            changed[changes] = count
            changes += mesh != meshes[count]
            meshes[count] = mesh
            for k in range(3):
                places[count, k] = centre[k] + offset * M[k, 2]
                for axis in range(3):
                    turns[count, k, axis] = M[k, axis] * size[axis]
            colours[count, 0], colours[count, 1], colours[count, 2] = solids.reflectances[g], 0.0, 1.0
            count += 1
    return count, changes


@njit(cache=True)
def _is_outside(kind: int, h: Array, M: Array, centre: Array, planes: Array) -> bool:
    """Whether a solid lies wholly beyond one of the planes."""
    for k in range(planes.shape[0]):
        if _along(planes[k], centre) - planes[k, 3] > _reach(kind, h, M, planes[k]):
            return True
    return False


@njit(cache=True)
def _along(plane: Array, p: Array) -> float:
    return plane[0] * p[0] + plane[1] * p[1] + plane[2] * p[2]


@njit(cache=True)
def _reach(kind: int, h: Array, M: Array, plane: Array) -> float:
    """How far a solid reaches from its centre along a plane's normal, in units of the normal's length."""
    if kind >= _MESH:
        return h[0] * math.sqrt(plane[0] ** 2 + plane[1] ** 2 + plane[2] ** 2)
    x = abs(M[0, 0] * plane[0] + M[1, 0] * plane[1] + M[2, 0] * plane[2])
    y = abs(M[0, 1] * plane[0] + M[1, 1] * plane[1] + M[2, 1] * plane[2])
    z = abs(M[0, 2] * plane[0] + M[1, 2] * plane[1] + M[2, 2] * plane[2])
    if kind == BALL:
        return math.sqrt((h[0] * x) ** 2 + (h[1] * y) ** 2 + (h[2] * z) ** 2)
    if kind == BOX:
        return h[0] * x + h[1] * y + h[2] * z
    if kind == CAPSULE:
        return h[2] * z + h[0] * math.sqrt(x * x + y * y + z * z)
    return h[2] * z + h[0] * math.sqrt(x * x + y * y)
