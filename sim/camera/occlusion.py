"""What hides what: rays from a point through the scene's real geometry. No OpenGL, so both backgrounds agree.

Only geoms that are drawn hide: those in a visible group and not fully transparent. Surfaces are met from inside, too.
Not modelled: partly hidden sources (a source is a point), transparent things.
Sources: MuJoCo's ray casting, mj_ray and mj_multiRay.
"""

import mujoco
import numpy as np
from numpy.typing import NDArray

from dockair.rotations import Array

VISIBLE_GROUPS: NDArray[np.uint8] = np.array([1, 1, 1, 0, 0, 0], dtype=np.uint8)  #: MuJoCo's own default
_EVERYWHERE = 1e10  # how far rays reach [m]; MuJoCo's own limit


def is_clear(model: mujoco.MjModel, data: mujoco.MjData, p_W: Array, direction_W: Array, distance_m: float) -> bool:
    """Say whether nothing visible lies within `distance_m` of p_W along a unit vector."""
    hit = mujoco.mj_ray(model, data, p_W, direction_W, VISIBLE_GROUPS, 1, -1, None)
    return hit < 0.0 or hit >= distance_m


def hidden(
    model: mujoco.MjModel, data: mujoco.MjData, p_WC: Array, targets_W: Array, clearance_m: float
) -> NDArray[np.bool_]:
    """(n,) whether something stands between a point and each of the targets.

    Args:
        model: geoms.
        data: their poses, up to date; not changed.
        p_WC: (3,) the lens [m].
        targets_W: (n, 3) [m].
        clearance_m: what lies nearer to a target than this, on the lens's side, does not hide it.
    """
    rays = np.asarray(targets_W, dtype=float) - p_WC
    distances = np.linalg.norm(rays, axis=1)
    reach = float(distances.max(initial=0.0))
    hits = first_hits(model, data, p_WC, rays / np.maximum(distances, np.finfo(float).tiny)[:, None], reach)
    return np.asarray((hits >= 0.0) & (hits < distances - clearance_m))


def clear_directions(model: mujoco.MjModel, data: mujoco.MjData, p_W: Array, directions: Array) -> NDArray[np.bool_]:
    """(n,) whether nothing visible lies along each of the unit vectors (n, 3) from a point, however far."""
    return np.asarray(first_hits(model, data, p_W, np.asarray(directions, dtype=float), _EVERYWHERE) < 0.0)


def first_hits(model: mujoco.MjModel, data: mujoco.MjData, p_W: Array, directions: Array, reach: float) -> Array:
    """(n,) distances along unit vectors (n, 3) to the nearest surface [m]; -1 for none within `reach`."""
    n = len(directions)
    distances, geoms = np.full(n, -1.0), np.empty(n, dtype=np.int32)
    if n:
        rays = np.ascontiguousarray(directions).ravel()
        mujoco.mj_multiRay(model, data, p_W, rays, VISIBLE_GROUPS, 1, -1, geoms, distances, None, n, reach)
    return distances
