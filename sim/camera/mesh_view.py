"""Meshes as the lens sees them: where their corners are, how bright, and which triangles are worth drawing.

A triangle is left out where its patch's ball lies beside the picture or behind the near plane, or where the lens is
surely on its back's side. Light falls on the corners, [solids, eq 1], as with OpenGL. Not modelled: see `solids`.
"""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from dockair.kernels import njit
from dockair.rotations import Array
from dockair.sim.camera.meshes import Meshes
from dockair.triples import Vector

_SHALLOW_M = 1e-3  # depth that tangents are worked out for at least
_AVERTED_M = 1e-9  # depth of the lens under a triangle's plane from which on its back is seen: far more than rounding

Frame = tuple[Array, Array]  # R_WC and p_WC of the camera
Poses = tuple[Array, Array]  # places (ngeom, 3) and attitudes (ngeom, 9) of the model's geoms


class MeshView(NamedTuple):
    """Room for what the lens sees of a model's meshes."""

    places: Array  #: (n, 5) of corners: place in C [m], tangents x and y (of those ahead)
    radiances: Array  #: (n,) at the corners, without haze
    triangles: NDArray[np.int64]  #: numbers of those worth drawing, and one more place

    @classmethod
    def room_for(cls, meshes: Meshes) -> "MeshView":
        """Return empty tables for meshes."""
        corners = len(meshes.corners_m)
        return cls(np.empty((corners, 5)), np.empty(corners), np.empty(len(meshes.triangles) + 1, dtype=np.int64))


@njit(cache=True)
def view_meshes(
    meshes: Meshes,
    poses: Poses,
    camera: Frame,
    x: Array,
    y: Array,
    sun_C: Array,
    light: tuple[float, float],
    near: float,
    out: MeshView,
) -> int:
    """Fill `out`, corners only where they are needed; return how many triangles it lists.

    Args:
        meshes: of the model.
        poses: of its geoms.
        camera: its pose.
        x: (columns,) rising tangents to the right of the axis.
        y: (rows,) rising tangents below it.
        sun_C: unit vector toward the Sun.
        light: ambient and direct.
        near: depth of the near plane.
        out: with room for these meshes.
    """
    (xpos, xmat), (R, lens), count = poses, camera, 0
    for k in range(meshes.geoms.shape[0]):
        g = meshes.geoms[k]
        c, M = _into(R, xpos[g, 0] - lens[0], xpos[g, 1] - lens[1], xpos[g, 2] - lens[2]), _turn(R, xmat[g])
        if _is_beside(_moved(c, M, meshes.centres_m[k]), meshes.radii_m[k], x, y, near):
            continue
        _light_corners(meshes, k, c, M, sun_C, light, out.places, out.radiances)
        first, stop = meshes.first_triangle[k], meshes.first_triangle[k + 1]
        count = _list_facing(meshes.planes, first, stop, _lens_in(c, M), out.triangles, count)
    return count


@njit(cache=True)
def _into(R: Array, a: float, b: float, c: float) -> Vector:
    """R' times a vector."""
    return (
        R[0, 0] * a + R[1, 0] * b + R[2, 0] * c,
        R[0, 1] * a + R[1, 1] * b + R[2, 1] * c,
        R[0, 2] * a + R[1, 2] * b + R[2, 2] * c,
    )


@njit(cache=True)
def _moved(c: Vector, M: Array, v: Array) -> Vector:
    return (
        c[0] + M[0, 0] * v[0] + M[0, 1] * v[1] + M[0, 2] * v[2],
        c[1] + M[1, 0] * v[0] + M[1, 1] * v[1] + M[1, 2] * v[2],
        c[2] + M[2, 0] * v[0] + M[2, 1] * v[1] + M[2, 2] * v[2],
    )


@njit(cache=True)
def _turn(R: Array, turn: Array) -> Array:
    M = np.empty((3, 3))
    for k in range(3):
        for axis in range(3):
            M[k, axis] = R[0, k] * turn[axis] + R[1, k] * turn[3 + axis] + R[2, k] * turn[6 + axis]
    return M


@njit(cache=True)
def _is_beside(c: Vector, radius: float, x: Array, y: Array, near: float) -> bool:
    """Whether no block's ray meets a ball before the near plane."""
    if c[0] + radius < near:
        return True
    right, left, low, high = x[-1], x[0], y[-1], y[0]
    return (
        -c[1] - right * c[0] > radius * math.sqrt(1.0 + right * right)
        or left * c[0] + c[1] > radius * math.sqrt(1.0 + left * left)
        or -c[2] - low * c[0] > radius * math.sqrt(1.0 + low * low)
        or high * c[0] + c[2] > radius * math.sqrt(1.0 + high * high)
    )


@njit(cache=True)
def _light_corners(
    meshes: Meshes, k: int, c: Vector, M: Array, sun_C: Array, light: tuple[float, float], places: Array, lit: Array
) -> None:
    """Fill places in C, tangents (of those ahead) and radiances of a patch's corners."""
    s_x, s_y, s_z = _into(M, sun_C[0], sun_C[1], sun_C[2])
    for i in range(meshes.first_corner[k], meshes.first_corner[k + 1]):
        places[i, 0], places[i, 1], places[i, 2] = _moved(c, M, meshes.corners_m[i])
        depth = max(places[i, 0], _SHALLOW_M)
        places[i, 3], places[i, 4] = -places[i, 1] / depth, -places[i, 2] / depth
        n = meshes.normals[i]
        cosine = n[0] * s_x + n[1] * s_y + n[2] * s_z
        lit[i] = meshes.reflectances[k] * (light[0] + light[1] * max(cosine, 0.0))


@njit(cache=True)
def _lens_in(c: Vector, M: Array) -> Vector:
    """Place of the lens in a geom's axes."""
    return (
        -M[0, 0] * c[0] - M[1, 0] * c[1] - M[2, 0] * c[2],
        -M[0, 1] * c[0] - M[1, 1] * c[1] - M[2, 1] * c[2],
        -M[0, 2] * c[0] - M[1, 2] * c[1] - M[2, 2] * c[2],
    )


@njit(cache=True)
def _list_facing(planes: Array, start: int, stop: int, lens: Vector, out: NDArray[np.int64], count: int) -> int:
    """List, after those already there, the triangles that do not surely show the lens their back; return how many."""
    for i in range(start, stop):
        out[count] = i
        ahead = planes[0, i] * lens[0] + planes[1, i] * lens[1] + planes[2, i] * lens[2]
        count += ahead > planes[3, i] - _AVERTED_M
    return count
