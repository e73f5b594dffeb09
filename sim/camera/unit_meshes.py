"""Meshes that solids are drawn with: balls, tubes and round ends of radius 1 in several finenesses, a cube; more.

A ball or tube of n slices has the outline of a polygon with n corners; its corners stand at

    R = 2 / (1 + cos(pi/n))                                                                                      (1)

so that the outline's mean distance from the axis is 1 and it is off by (R - 1) either way: 4.0, 1.0, 0.15 % for the
finenesses here. Normals are those of the round body; between them OpenGL interpolates the shade, which is too dark by
up to 1 - cos(pi/n): 7.6, 1.9, 0.3 %.
"""

from collections.abc import Sequence
from itertools import pairwise

import mujoco
import numpy as np
from numpy.typing import NDArray

from dockair.rotations import Array

SLICES = (8, 16, 40)
#: Radius [blocks] up to which each fineness serves. Outlines are off by a quarter of a block at most (the last one's
#: up to 160 blocks); the first is for what is too thin to show its shade.
LEVELS: Array = np.array([2.0, 25.0, np.inf])
BALLS, TUBES, ENDS, CUBE = (k * len(SLICES) for k in range(4))  #: numbers of the first of each kind
OTHERS = CUBE + 1  #: of the first that is no unit mesh

_Mesh = tuple[Array, Array, NDArray[np.int64]]  # vertices (n, 3), their normals (n, 3), triangles (m, 3)


def unit_meshes(others: Sequence[_Mesh] = ()) -> mujoco.MjModel:
    """Return a model that holds the meshes, others after them, and nothing else."""
    spec = mujoco.MjSpec()
    meshes = [*map(_ball, SLICES), *map(_tube, SLICES), *map(_end, SLICES), _cube(), *others]
    for i, (vertices, normals, triangles) in enumerate(meshes):
        mesh = spec.add_mesh(name=f"mesh_{i}", inertia=mujoco.mjtMeshInertia.mjMESH_INERTIA_SHELL)
        mesh.uservert, mesh.userface = vertices.ravel().tolist(), triangles.ravel().tolist()
        mesh.usernormal, mesh.userfacenormal = normals.ravel().tolist(), triangles.ravel().tolist()
    model = spec.compile()
    for i, (vertices, normals, _) in enumerate(meshes):  # the compiler has turned them into their principal axes
        first, first_normal = model.mesh_vertadr[i], model.mesh_normaladr[i]
        model.mesh_vert[first : first + len(vertices)] = vertices
        model.mesh_normal[first_normal : first_normal + len(normals)] = normals
    return model


def _radius(n: int) -> float:
    return float(2.0 / (1.0 + np.cos(np.pi / n)))  # Eq. (1)


def _circle(n: int) -> Array:
    angle = 2.0 * np.pi * np.arange(n) / n
    return np.column_stack([np.cos(angle), np.sin(angle)])


def _strip(lower: NDArray[np.int64], upper: NDArray[np.int64]) -> NDArray[np.int64]:
    """Triangles of a closed band between two rings of vertices, seen from outside counter-clockwise."""
    next_lower, next_upper = np.roll(lower, -1), np.roll(upper, -1)
    return np.vstack([np.column_stack([lower, next_lower, next_upper]), np.column_stack([lower, next_upper, upper])])


def _ball(n: int) -> _Mesh:
    return _zone(n, np.pi * (np.arange(n // 2 + 1) / (n // 2) - 0.5))


def _end(n: int) -> _Mesh:
    """The half of a ball where z > 0."""
    return _zone(n, 0.5 * np.pi * np.arange(n // 4 + 1) / (n // 4))


def _zone(n: int, latitudes_rad: Array) -> _Mesh:
    circle = _circle(n)
    normals = np.vstack([np.column_stack([np.cos(a) * circle, np.full(n, np.sin(a))]) for a in latitudes_rad])
    number = np.arange(len(normals)).reshape(-1, n)
    triangles = np.vstack([_strip(low, high) for low, high in pairwise(number)])
    return _radius(n) * normals, normals, triangles


def _tube(n: int) -> _Mesh:
    """Radius 1, from z = -1 to z = 1, with flat ends."""
    circle = _circle(n)
    radial, flat = np.column_stack([circle, np.zeros(n)]), np.zeros((n, 3))
    vertices, normals = [], []
    for z in (-1.0, 1.0):
        ring = np.column_stack([_radius(n) * circle, np.full(n, z)])
        vertices += [ring, ring]
        normals += [radial, flat + [0.0, 0.0, z]]
    low, low_end, high, high_end = np.arange(4 * n).reshape(4, n)
    fan = np.arange(1, n - 1)
    top = np.column_stack([np.full(n - 2, high_end[0]), high_end[fan], high_end[fan + 1]])
    bottom = np.column_stack([np.full(n - 2, low_end[0]), low_end[fan + 1], low_end[fan]])
    return np.vstack(vertices), np.vstack(normals), np.vstack([_strip(low, high), top, bottom])


def _cube() -> _Mesh:
    vertices: list[Array] = []
    normals: list[Array] = []
    triangles: list[list[int]] = []
    for axis in range(3):
        for side in (-1.0, 1.0):
            normal = side * np.eye(3)[axis]
            across = np.eye(3)[(axis + 1) % 3]
            up = np.cross(normal, across)
            first = len(vertices)
            vertices += [normal + a * across + b * up for a, b in ((-1, -1), (1, -1), (1, 1), (-1, 1))]
            normals += [normal] * 4
            triangles += [[first, first + 1, first + 2], [first, first + 2, first + 3]]
    return np.array(vertices), np.array(normals), np.array(triangles)
