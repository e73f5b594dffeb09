"""Closed surfaces lofted through cross-sections: fuselages, pods and canopies; wings, tails and pylons.

A body's section at x is a superellipse with half width a, half height b about (x, y_0, z_0):

    |(y - y_0)/a|^e + |(z - z_0)/b|^e = 1,    angle t:  y = y_0 + a sgn(cos t)|cos t|^(2/e),  z likewise            (1)

Between the stations a, b, y_0 and z_0 follow monotone cubics of x, so that nothing bulges that the table does not.
A surface's section is a symmetric four-digit profile of chord c and thickness ratio h, sharp behind,

    +-5 h c (0.2969 sqrt u - 0.126 u - 0.3516 u^2 + 0.2843 u^3 - 0.1036 u^4),    u = 0 to 1 from nose to tail     (2)

across the line of the span, straight from section to section. Twist turns it nose up about its leading edge.

Triangles are seen counter-clockwise from outside. Normals are the mean of the faces about a corner, weighted by their
angles there, but for edges that are sharp: trailing edges and flat ends, where corners are doubled.
Not modelled: fillets where parts meet (they pass through one another), camber, control surfaces.
Sources: Fritsch & Carlson 1980 (monotone cubics); Jacobs, Ward & Pinkerton, NACA Report 460 (profiles);
Thuermer & Wuethrich 1998 (normals weighted by angle).
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import PchipInterpolator

from dockair.rotations import Array

_PROFILE = (0.2969, -0.126, -0.3516, 0.2843, -0.1036)  #: Eq. (2); the last one closes the trailing edge


class Mesh(NamedTuple):
    """A closed surface."""

    vertices_m: Array  #: (n, 3)
    normals: Array  #: (n, 3) unit vectors outward
    triangles: NDArray[np.int64]  #: (m, 3) corners, counter-clockwise from outside


def body(stations: Array, slices: int, finer: int = 1) -> Mesh:
    """Loft a body along x.

    Args:
        stations: (k, 6) x, half width, half height, y_0, z_0 [m] and exponent of Eq. (1), from the nose aft.
        slices: corners around.
        finer: rings between one station and the next.
    """
    way = np.arange(len(stations))
    fine = np.linspace(0.0, way[-1], finer * way[-1] + 1)
    x = np.interp(fine, way, stations[:, 0])
    smooth = PchipInterpolator(stations[::-1, 0], stations[::-1, 1:])(x)
    a, b, y_0, z_0, exponent = (column[:, None] for column in smooth.T)
    angle = -2.0 * np.pi * (np.arange(slices) + 0.5) / slices  # so that rings turn alike along x and aft
    cos, sin = np.cos(angle), np.sin(angle)
    y = y_0 + a * np.copysign(np.abs(cos) ** (2.0 / exponent), cos)
    z = z_0 + b * np.copysign(np.abs(sin) ** (2.0 / exponent), sin)
    grid = np.stack([np.broadcast_to(x[:, None], y.shape), y, z], axis=-1)
    return joined([_skin(grid, is_round=True), _end(grid[0], -1), _end(grid[-1], 1)])


def surface(sections: Array, points: int) -> Mesh:
    """Loft a wing, tail or pylon; its left side is where its span points away from the right hand of x.

    Args:
        sections: (k, 6) leading edge x, y, z and chord [m], thickness ratio, twist [rad], along the span.
        points: of the profile between leading and trailing edge.
    """
    u = 0.5 * (1.0 - np.cos(np.pi * np.arange(points + 1) / points))
    half = np.power.outer(u, [0.5, 1.0, 2.0, 3.0, 4.0]) @ _PROFILE
    half[-1] = 0.0  # but for rounding
    along = np.concatenate([u[::-1], u[1:]])  # from the trailing edge over the top, around the nose and back below
    across = 5.0 * np.concatenate([half[::-1], -half[1:]])
    span = np.gradient(sections[:, 1:3], axis=0)
    span /= np.linalg.norm(span, axis=1, keepdims=True)
    up = np.column_stack([np.zeros(len(sections)), -span[:, 1], span[:, 0]])  # x cross the span's direction
    chord, ratio, twist = (sections[:, k, None] for k in (3, 4, 5))
    aft, high = chord * along, chord * ratio * across
    x = -aft * np.cos(twist) - high * np.sin(twist)
    z = -aft * np.sin(twist) + high * np.cos(twist)
    grid = sections[:, None, :3] + x[..., None] * [1.0, 0.0, 0.0] + z[..., None] * up[:, None, :]
    return joined([_skin(grid, is_round=False), _end(grid[0], -1), _end(grid[-1], 1)])


def joined(meshes: list[Mesh]) -> Mesh:
    """Put meshes beside one another."""
    first = np.cumsum([0, *(len(m.vertices_m) for m in meshes[:-1])])
    return Mesh(
        np.vstack([m.vertices_m for m in meshes]),
        np.vstack([m.normals for m in meshes]),
        np.vstack([m.triangles + start for m, start in zip(meshes, first, strict=True)]),
    )


def mirrored(mesh: Mesh) -> Mesh:
    """The mesh on the other side of the plane y = 0."""
    other = np.array([1.0, -1.0, 1.0])
    return Mesh(mesh.vertices_m * other, mesh.normals * other, mesh.triangles[:, [0, 2, 1]])


def _skin(grid: Array, is_round: bool) -> Mesh:
    """The side of a loft: corners (rings, around, 3), the rings closed or open."""
    rings, around = grid.shape[:2]
    number = np.arange(rings * around).reshape(rings, around)
    if is_round:
        number = np.column_stack([number, number[:, 0]])
    a, b, c, d = (part.ravel() for part in (number[:-1, :-1], number[:-1, 1:], number[1:, 1:], number[1:, :-1]))
    triangles = np.column_stack([a, b, c, a, c, d]).reshape(-1, 3)
    vertices = grid.reshape(-1, 3)
    return Mesh(vertices, _smooth_normals(vertices, triangles), triangles)


def _end(ring: Array, side: int) -> Mesh:
    """A flat end: a fan about the ring's middle; side -1 where the loft begins, 1 where it ends."""
    n = len(ring)
    middle = ring.mean(axis=0)
    around = np.column_stack([np.full(n, n), np.arange(n), (np.arange(n) + 1) % n])
    triangles = around if side > 0 else around[:, [0, 2, 1]]
    triangles = triangles[np.any(ring != np.roll(ring, -1, axis=0), axis=1)]  # a profile is closed behind
    area = 0.5 * np.cross(ring - middle, np.roll(ring, -1, axis=0) - middle).sum(axis=0)
    normal = side * area / np.linalg.norm(area)
    return Mesh(np.vstack([ring, middle]), np.tile(normal, (n + 1, 1)), triangles.astype(np.int64))


def _smooth_normals(vertices: Array, triangles: NDArray[np.int64]) -> Array:
    corners = [vertices[triangles[:, k]] for k in range(3)]
    faces = _units(np.cross(corners[1] - corners[0], corners[2] - corners[0]))
    total = np.zeros_like(vertices)
    for k in range(3):
        one, other = (_units(corners[(k + turn) % 3] - corners[k]) for turn in (1, 2))
        angle = np.arccos(np.clip(np.sum(one * other, axis=1), -1.0, 1.0))
        np.add.at(total, triangles[:, k], angle[:, None] * faces)
    return _units(total)


def _units(vectors: Array) -> Array:
    return np.asarray(vectors / np.linalg.norm(vectors, axis=1, keepdims=True))
