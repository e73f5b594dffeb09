"""The Sun in the camera: its disc, the veil it spreads over the array, and its glints on curved surfaces.

Disc: a uniform circle of angular radius a, its edge blurred by the lens; hidden block by block where a ray meets the
scene.

    veil = g S A cos t v exp(-(d/d0)^2) / pixels   on every pixel                                                (1)

with g the glare index, S A all sunlight through the aperture, t the Sun's angle off the axis, v the visible part of
its disc and d how far it stands outside the field.

Glints, the one kind of reflection there is: real specular points. On a convex body lit from s and seen from v (unit
vectors) the surface mirrors the Sun where its normal is

    n = (s + v)/|s + v|                                                                                          (2)
    ellipsoid, half-axes A = diag(a, b, c):     p = A^2 n/|A n|,    r1 r2 = (abc)^2/|A n|^4                      (3)
    torus R, r about x, e = +-(n - n.x x)/|..|:  p = R e + r n,      r1 r2 = r |R + r n.e|/|n.e|                  (4)

The basket's rim, which the scene draws as straight tubes, is one torus. A glint counts if both Sun and camera see its
point. It is as bright as [radiometry, eq 4] says and looks like an LED: nothing but its place tells them apart.
Nothing here is random.

Not modelled: halo, ghosts and spikes of the lens; glints of flat faces, straight tubes and meshes (a straight tube
glints in one direction only), roughness, second reflections, Sun through cloud gaps.
Sources: ISO 9358 (glare index); do Carmo, Differential Geometry of Curves and Surfaces, section 3-3 (curvatures).
"""

import math
from dataclasses import dataclass

import mujoco
import numpy as np
from numba import njit
from numpy.typing import NDArray

from dockair.calibration import Camera
from dockair.rotations import Array
from dockair.sim.camera.background import VISIBLE_GROUPS
from dockair.sim.camera.radiometry import CameraParameters, LightParameters

RIM_GEOMS = "basket_rim"  #: how the names of the rim's pieces begin
_SKIN_M = 1e-3  # a ray that starts on a surface starts this far off it
_FIXED_POINT_STEPS = 6  # of (2) and (3), for the direction from the point to the camera; error falls by size/range
_FLATTEST = 0.05  # seen along the rim's axis a whole circle would glint; a real rim's waviness limits it
_ROUND = (mujoco.mjtGeom.mjGEOM_SPHERE, mujoco.mjtGeom.mjGEOM_ELLIPSOID)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Glints:
    """Specular points that both the Sun and the camera see."""

    p_W: Array  #: (n, 3) [m]
    r1_r2_m2: Array  #: (n,) product of the principal radii


@dataclass(frozen=True, slots=True, kw_only=True)
class Rim:
    """The basket's rim as a torus about its body's x axis."""

    body: int
    centre_x_m: float
    radius_m: float
    tube_radius_m: float


def rim_of(model: mujoco.MjModel) -> Rim | None:
    """Return the torus through the capsules that draw the rim; None where the scene has none."""
    pieces = [i for i in range(model.ngeom) if model.geom(i).name.startswith(RIM_GEOMS)]
    if not pieces:
        return None
    middle = model.geom_pos[pieces]
    chord = np.hypot(middle[:, 1], middle[:, 2])
    return Rim(
        body=int(model.geom_bodyid[pieces[0]]),
        centre_x_m=float(middle[:, 0].mean()),
        radius_m=float(np.hypot(chord, model.geom_size[pieces, 1]).mean()),
        tube_radius_m=float(model.geom_size[pieces, 0].mean()),
    )


def is_clear(model: mujoco.MjModel, data: mujoco.MjData, p_W: Array, direction_W: Array, distance_m: float) -> bool:
    """Say whether nothing visible lies within `distance_m` of p_W along a unit vector."""
    which = np.zeros(1, dtype=np.int32)
    hit = mujoco.mj_ray(model, data, p_W, direction_W, VISIBLE_GROUPS, 1, -1, which)
    return hit < 0.0 or hit >= distance_m


def find_glints(
    model: mujoco.MjModel, data: mujoco.MjData, rim: Rim | None, p_WC: Array, s_W: Array, light: LightParameters
) -> Glints:
    """Return the glints in the scene, Eqs. (2) to (4).

    Args:
        model: geoms; those in hidden groups or fully transparent throw none.
        data: their poses, up to date; not changed.
        rim: of `rim_of`.
        p_WC: (3,) the lens [m].
        s_W: (3,) unit vector toward the Sun.
        light: the limit of incidence.
    """
    seen = VISIBLE_GROUPS[model.geom_group].astype(bool) & (model.geom_rgba[:, 3] > 0.0)
    found = [_on_ellipsoids(model, data, p_WC, s_W, np.flatnonzero(seen & np.isin(model.geom_type, _ROUND)))]
    if rim is not None:
        found += [_on_rim(data, rim, p_WC, s_W, side) for side in (1.0, -1.0)]
    p, n, area = (np.concatenate(column) for column in zip(*found, strict=True))
    kept = [i for i in range(len(p)) if _is_lit_and_seen(model, data, p[i], n[i], p_WC, s_W, light)]
    return Glints(p_W=p[kept], r1_r2_m2=area[kept])


def _on_ellipsoids(
    model: mujoco.MjModel, data: mujoco.MjData, p_WC: Array, s_W: Array, which: NDArray[np.intp]
) -> tuple[Array, Array, Array]:
    """Points (m, 3), normals (m, 3) and products of radii (m,), Eq. (3)."""
    sphere = (model.geom_type[which] == mujoco.mjtGeom.mjGEOM_SPHERE)[:, None]
    A = np.where(sphere, model.geom_size[which, :1], model.geom_size[which])
    R, centre = data.geom_xmat[which].reshape(-1, 3, 3), data.geom_xpos[which]
    p, n, support = centre, np.zeros_like(centre), np.ones(len(which))
    for _ in range(_FIXED_POINT_STEPS):
        n = _bisector(s_W, p_WC - p)
        n_local = np.einsum("mji,mj->mi", R, n)
        support = np.linalg.norm(A * n_local, axis=1)
        p = centre + np.einsum("mij,mj->mi", R, A**2 * n_local / support[:, None])
    return p, n, np.prod(A, axis=1) ** 2 / support**4


def _on_rim(data: mujoco.MjData, rim: Rim, p_WC: Array, s_W: Array, side: float) -> tuple[Array, Array, Array]:
    """The rim's outer (side 1) or inner (side -1) specular point, Eq. (4); shapes as of `_on_ellipsoids`."""
    x = data.xmat[rim.body].reshape(3, 3)[:, 0]
    p = centre = data.xpos[rim.body] + rim.centre_x_m * x
    n = e = np.zeros(3)
    for _ in range(_FIXED_POINT_STEPS):
        n = _bisector(s_W, (p_WC - p)[None])[0]
        radial = n - (n @ x) * x
        e = side * radial / max(float(np.linalg.norm(radial)), np.finfo(float).tiny)
        p = centre + rim.radius_m * e + rim.tube_radius_m * n
    slope = max(abs(float(n @ e)), _FLATTEST)
    area = rim.tube_radius_m * abs(rim.radius_m + rim.tube_radius_m * float(n @ e)) / slope
    return p[None], n[None], np.array([area])


def _bisector(s: Array, v: Array) -> Array:
    """(m, 3) unit vectors half-way between s (3,) and v (m, 3), Eq. (2)."""
    both = s + v / np.linalg.norm(v, axis=1, keepdims=True)
    return np.asarray(both / np.maximum(np.linalg.norm(both, axis=1, keepdims=True), np.finfo(float).tiny))


def _is_lit_and_seen(
    model: mujoco.MjModel, data: mujoco.MjData, p: Array, n: Array, p_WC: Array, s_W: Array, light: LightParameters
) -> bool:
    ray = p_WC - p
    distance = float(np.linalg.norm(ray))
    if n @ s_W < math.cos(light.glint_grazing_rad):  # as n halves the angle, the camera stands on the lit side too
        return False
    start = p + _SKIN_M * n
    return is_clear(model, data, start, ray / distance, distance) and is_clear(model, data, start, s_W, np.inf)


def veil_electrons(
    parameters: CameraParameters, camera: Camera, sun_C: Array, sun_flux_e: float, visible: float
) -> float:
    """Electrons per pixel of veiling glare, Eq. (1).

    Args:
        parameters: glare index and decay.
        camera: as built.
        sun_C: (3,) unit vector toward the Sun, camera axes.
        sun_flux_e: all sunlight through the lens, Sun on axis.
        visible: part of the disc that nothing hides, 0 to 1.
    """
    if sun_C[0] <= 0.0:
        return 0.0
    (c_u, c_v), f = camera.principal_point_px, camera.focal_length_px
    u, v = c_u - f * sun_C[1] / sun_C[0], c_v - f * sun_C[2] / sun_C[0]
    edge = np.array([np.clip(u, 0, camera.width_px - 1), np.clip(v, 0, camera.height_px - 1)])
    nearest = np.array([1.0, -(edge[0] - c_u) / f, -(edge[1] - c_v) / f])
    cos_d = float(nearest @ sun_C / np.linalg.norm(nearest))
    d = math.acos(min(cos_d, 1.0))
    taper = math.exp(-((d / parameters.veiling_decay_rad) ** 2))
    pixels = camera.width_px * camera.height_px
    return float(parameters.veiling_glare * sun_flux_e * sun_C[0] * visible * taper / pixels)


@njit(cache=True)
def add_disc(
    image: NDArray[np.float32],
    start: tuple[int, int],
    centre: tuple[float, float],
    radius: float,
    sigma: float,
    electrons: float,
    visible: NDArray[np.bool_],
    first: tuple[int, int],
    k: int,
) -> None:
    """Add a uniform disc with a blurred edge to expected electrons, in place.

    Args:
        image: (rows, columns) of the window.
        start: (row, column) of its first pixel.
        centre: (u, v) of the disc on the sensor.
        radius: of the disc [px].
        sigma: blur of its edge [px].
        electrons: per pixel inside.
        visible: (m, m) blocks of k x k pixels that nothing hides.
        first: (row, column) of the first block, in blocks.
        k: side of a block [px].
    """
    for i in range(visible.shape[0]):
        for j in range(visible.shape[1]):
            if not visible[i, j]:
                continue
            for r in range(
                max((first[0] + i) * k - start[0], 0), min((first[0] + i + 1) * k - start[0], image.shape[0])
            ):
                for c in range(
                    max((first[1] + j) * k - start[1], 0), min((first[1] + j + 1) * k - start[1], image.shape[1])
                ):
                    d = math.hypot(c + start[1] - centre[0], r + start[0] - centre[1])
                    image[r, c] += electrons * 0.5 * math.erfc((d - radius) / (math.sqrt(2.0) * sigma))
