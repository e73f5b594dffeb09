"""Surfaces cut into tiles that mirror: flat faces, flat ellipsoids, triangles of meshes.

A tile is a small rectangle with a normal, two tangents along its sides, and a second fundamental form C. Of an
ellipsoid C is that of its surface. A triangle counts as a rectangle of its area with its axes of inertia; with k its
edges on the tile's tangents and dn the change of the corners' normals along them, its C is that of least squares

    C k = dn,    C symmetric                                                                                     (1)

Source: do Carmo, Differential Geometry of Curves and Surfaces, section 3-3.
"""

import math
from functools import lru_cache

import numpy as np

from dockair.rotations import Array
from dockair.sim.camera.meshes import Mesh
from dockair.triples import Vector
from dockair.vectors import cross

#: Frame (4, 3): centre [m], normal, two tangents along the sides; half sides [m]; 11, 12, 22 of C, positive for convex.
Tile = tuple[Array, tuple[float, float], Vector]

_FLAT_RATIO = 10.0  # of an ellipsoid's longest to its shortest half-axis
_TILE_M = 0.5  # tiles of flat faces are no longer than this, up to _MOST_TILES a side
_MOST_TILES = 12
_TILES_ALONG, _TILES_AROUND = 20, 32  # of a flat ellipsoid
EDGE_COS = math.cos(0.4)  # of the angle between normal and thin axis where its edge begins
_THINNEST_M = 0.02  # faces narrower than this are edges


def is_flat(axes: Array) -> bool:
    """Whether an ellipsoid with these half-axes is so flat that it is cut into tiles."""
    return bool(axes.max() > _FLAT_RATIO * axes.min())


def face(half: Array, axis: int, side: float) -> list[Tile]:
    """The face of a box across one axis, in tiles."""
    one, two = (axis + 1) % 3, (axis + 2) % 3
    if min(half[one], half[two]) < 0.5 * _THINNEST_M:
        return []
    counts = [int(np.clip(np.ceil(2.0 * half[k] / _TILE_M), 1, _MOST_TILES)) for k in (one, two)]
    sides = half[one] / counts[0], half[two] / counts[1]
    frame = np.zeros((4, 3))
    frame[0, axis], frame[1, axis], frame[2, one], frame[3, two] = side * half[axis], side, 1.0, 1.0
    tiles: list[Tile] = []
    for j in range(counts[0]):
        for k in range(counts[1]):
            placed = frame.copy()
            placed[0, one], placed[0, two] = (2 * j + 1) * sides[0] - half[one], (2 * k + 1) * sides[1] - half[two]
            tiles.append((placed, sides, (0.0, 0.0, 0.0)))
    return tiles


def mesh_tiles(mesh: Mesh) -> tuple[Tile, ...]:
    """A mesh's triangles as tiles, in their order; read-only.

    Every mesh is cut once a process: to cut their thousands of triangles was most of what a camera took to be made.
    """
    corners, normals, triangles = mesh
    return _mesh_tiles(corners[triangles].tobytes(), normals[triangles].tobytes())


@lru_cache(maxsize=128)  # meshes; a scene has some twenty
def _mesh_tiles(corners: bytes, normals: bytes) -> tuple[Tile, ...]:
    pairs = zip(*(np.frombuffer(a).reshape(-1, 3, 3) for a in (corners, normals)), strict=True)
    tiles = tuple(triangle_tile(*pair) for pair in pairs)
    for frame, _, _ in tiles:
        frame.setflags(write=False)
    return tiles


def triangle_tile(corners: Array, normals: Array) -> Tile:
    """A triangle's tile, Eq. (1); normals are those of its corners."""
    middle, n = corners.mean(axis=0), normals.sum(axis=0)
    n /= np.linalg.norm(n)
    helper = np.eye(3)[int(np.argmin(np.abs(n)))]
    e_1 = cross(n, helper)
    e_1 /= np.linalg.norm(e_1)
    plane = np.column_stack([e_1, cross(n, e_1)])
    flat = (corners - middle) @ plane
    spread, axes = np.linalg.eigh(flat.T @ flat / 12.0)  # second moments over the area
    area = 0.5 * abs(np.linalg.det(flat[1:] - flat[0]))
    ratio = math.sqrt(max(spread[1], 0.0) / max(spread[0], 1e-12))
    half = (0.5 * math.sqrt(area * ratio), 0.5 * math.sqrt(area / ratio))
    t_1 = plane @ axes[:, 1]
    t_2 = cross(n, t_1)
    tangents = np.column_stack([t_1, t_2])
    k, dn = (np.roll(a, -1, axis=0) - a for a in (corners @ tangents, normals @ tangents))
    rows = np.zeros((6, 3))
    rows[:3, :2], rows[3:, 1:] = k, k
    C = np.linalg.lstsq(rows, np.concatenate([dn[:, 0], dn[:, 1]]), rcond=None)[0]
    return np.array([middle, n, t_1, t_2]), half, (float(C[0]), float(C[1]), float(C[2]))


def ellipsoid_tiles(axes: Array) -> list[Tile]:
    """An ellipsoid cut along its longest axis, and around it."""
    order = np.argsort(-axes)
    longest, across, thin = (np.eye(3)[k] * axes[k] for k in order)
    step_b, step_a = np.pi / _TILES_ALONG, 2.0 * np.pi / _TILES_AROUND
    tiles: list[Tile] = []
    for b in (np.arange(_TILES_ALONG) + 0.5) * step_b - 0.5 * np.pi:
        for a in (np.arange(_TILES_AROUND) + 0.5) * step_a:
            around = np.cos(a) * thin + np.sin(a) * across
            p = np.cos(b) * around + np.sin(b) * longest
            along_b = -np.sin(b) * around + np.cos(b) * longest
            along_a = np.cos(b) * (-np.sin(a) * thin + np.cos(a) * across)
            gradient = p / axes**2
            n = gradient / np.linalg.norm(gradient)
            if abs(n[order[2]]) < EDGE_COS:
                continue
            t1 = along_b / np.linalg.norm(along_b)
            t2 = np.cross(n, t1)
            area = float(np.linalg.norm(np.cross(along_a, along_b))) * step_a * step_b
            half = 0.5 * float(np.linalg.norm(along_b)) * step_b
            C = np.array([t1, t2]) @ np.diag(axes**-2.0) @ np.array([t1, t2]).T / np.linalg.norm(gradient)
            tiles.append((np.array([p, n, t1, t2]), (half, 0.25 * area / half), (C[0, 0], C[0, 1], C[1, 1])))
    return tiles
