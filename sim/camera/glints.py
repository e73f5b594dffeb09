"""Glints: the Sun mirrored by the scene's real surfaces, wherever it and the camera both see the place.

    e = S a A cos t / r^2 t_exp                                                                                  (1)

with A in m^2/sr of [lobes, eq 4] (reflectance included), S a the electrons per second of all sunlight through the lens,
t the angle off its axis and r the range. Mirror points come from `round_mirrors` and `curved_mirrors`, flat faces
facet by facet. A glint looks like an LED: nothing but its place tells them apart. Streaks on tubes are rows of points,
flashes of large faces are points a tile.

Not modelled: second reflections, shadows inside a patch (its middle is seen or not), Sun through cloud gaps, shading
between facets. Highlights darker than `faintest_radiance` are left to the surfaces' grey values.
Sources: as of `lobes`. Nothing here is random.
"""

import math
from dataclasses import dataclass

import mujoco
import numpy as np
from numpy.typing import NDArray

from dockair.kernels import njit
from dockair.rotations import Array
from dockair.sim.camera.curved_mirrors import ellipsoid_spots, rim_spots
from dockair.sim.camera.facets import facets_that_may_shine
from dockair.sim.camera.lobes import MOST_PIECES, ROW, SPOT, facet_rows, spot_rows
from dockair.sim.camera.mirrors import Mirrors, finishes, vector
from dockair.sim.camera.obstacles import Obstacles
from dockair.sim.camera.occlusion import first_hits, is_clear
from dockair.sim.camera.round_mirrors import round_spots
from dockair.sim.camera.sheets import LightParameters, SurfaceParameters
from dockair.triples import Vector

_TINY_M = 1e-300  # keeps a direction finite


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Glints:
    """Bright patches that both the Sun and the camera see."""

    p_W: Array  #: (n, 3) their middles [m]
    area_m2_sr: Array  #: (n,) A of Eq. (1): intensity over the Sun's irradiance, reflectance included
    size_m: Array  #: (n,) side of a square that is as wide: size^2/12 is the mean variance along the surface


def find_glints(
    model: mujoco.MjModel,
    data: mujoco.MjData,
    mirrors: Mirrors,
    p_WC: Array,
    s_W: Array,
    surfaces: SurfaceParameters,
    light: LightParameters,
    ahead_W: Array | None = None,
) -> Glints:
    """Return the glints in the scene.

    Args:
        model: the one `mirrors` is of.
        data: its poses, up to date; not changed.
        mirrors: of `Mirrors.of`.
        p_WC: (3,) the lens [m].
        s_W: (3,) unit vector toward the Sun.
        surfaces: reflectances, roughness, limits.
        light: the Sun's angular radius.
        ahead_W: (3,) the camera's axis, to leave out what lies behind the lens; None for all around.
    """
    rows = glint_rows(data, mirrors, p_WC, s_W, surfaces, light, ahead_W)
    obstacles = Obstacles.of(model)
    seen, starts = starts_of_seen(obstacles, data, p_WC, rows)
    kept = [i for i in np.flatnonzero(seen) if is_clear(obstacles, data, starts[i], s_W, np.inf)]
    return Glints(p_W=rows[kept, :3], area_m2_sr=rows[kept, 6], size_m=rows[kept, 7])


def starts_of_seen(
    obstacles: Obstacles, data: mujoco.MjData, p_WC: Array, rows: Array
) -> tuple[NDArray[np.bool_], Array]:
    """(n,) which of the patches the lens sees, (n, 3) a little above them, where rays to the light start.

    Their middles are on the surface to second order only, and the drawn rim has corners: what the line of sight meets
    within a sixth of a patch of the middle is the surface itself.
    """
    eye, directions, distances = vector(p_WC), np.empty((len(rows), 3)), np.empty(len(rows))
    hits = first_hits(obstacles, data, p_WC, directions, _aim(eye, rows, directions, distances) + 1.0)
    seen, starts = np.empty(len(rows), dtype=np.bool_), directions
    _judge(eye, rows, distances, hits, seen, starts)
    return seen, starts


@njit(cache=True)
def _aim(eye: Vector, rows: Array, directions: Array, distances: Array) -> float:
    """Fill (n, 3) unit vectors and (n,) distances from the lens to patches; return the longest distance."""
    longest = 0.0
    for i in range(len(rows)):
        x, y, z = rows[i, 0] - eye[0], rows[i, 1] - eye[1], rows[i, 2] - eye[2]
        distances[i] = math.sqrt(x * x + y * y + z * z)
        d = max(distances[i], _TINY_M)
        directions[i, 0], directions[i, 1], directions[i, 2] = x / d, y / d, z / d
        longest = max(longest, distances[i])
    return longest


@njit(cache=True)
def _judge(eye: Vector, rows: Array, distances: Array, hits: Array, seen: NDArray[np.bool_], starts: Array) -> None:
    """Fill what `starts_of_seen` returns; `starts` holds the lines of sight's unit vectors."""
    for i in range(len(rows)):
        slack = rows[i, 8] + rows[i, 7] / 6.0
        meets_surface = hits[i] >= 0.0 and abs(hits[i] - distances[i]) < slack
        along = hits[i] if meets_surface else distances[i]
        seen[i] = hits[i] < 0.0 or hits[i] > distances[i] - slack
        for k in range(3):
            starts[i, k] = eye[k] + along * starts[i, k] + rows[i, 8] * rows[i, 3 + k]


def glint_rows(
    data: mujoco.MjData,
    mirrors: Mirrors,
    p_WC: Array,
    s_W: Array,
    surfaces: SurfaceParameters,
    light: LightParameters,
    ahead_W: Array | None = None,
) -> Array:
    """(n, ROW) glints, hidden ones among them; arguments as of `find_glints`."""
    eye, sun = vector(p_WC), np.array(s_W, dtype=float, ndmin=2)
    xpos, xmat = data.geom_xpos, data.geom_xmat
    finish, variance = finishes(surfaces), 0.25 * light.sun_angular_radius_rad**2
    limits = (
        math.cos(surfaces.grazing_rad),
        surfaces.faintest_glint_m2_sr,
        surfaces.faintest_radiance,
        surfaces.patch_step_rad,
    )
    balls, tubes = mirrors.balls, mirrors.tubes
    spots = np.empty((mirrors.all_wanted.size + 2, SPOT))
    n = round_spots(balls, tubes, xpos, xmat, sun, 0.0, mirrors.all_wanted, eye, finish, variance, spots)
    if mirrors.any_ellipsoids:
        n += ellipsoid_spots(balls, xpos, xmat, sun, 0.0, eye, spots[n:])
    if mirrors.rim is not None:
        n += rim_spots(mirrors.rim.torus_W(data), mirrors.rim.labels, sun, 0.0, eye, spots[n:])
    poses, facets, s = (xpos, xmat), mirrors.facets, vector(s_W)
    ahead = (0.0, 0.0, 0.0) if ahead_W is None else vector(ahead_W)
    which = facets_that_may_shine(facets, poses, (s, variance), eye, ahead, finish, surfaces.faintest_radiance)
    rows = np.empty((MOST_PIECES * n + len(which), ROW))  # for all: a streak's pieces, a patch a facet
    count = spot_rows(spots[:n], sun, 0.0, variance, eye, finish, limits, rows, 0)
    count = facet_rows(facets, which, poses, (s, 0.0, variance), eye, finish, limits, rows, count)
    return rows[: count if ahead_W is None else _keep_ahead(rows, count, eye, ahead)]


@njit(cache=True)
def _keep_ahead(rows: Array, count: int, eye: Vector, ahead: Vector) -> int:
    """Leave out, of the first rows, those behind the lens; return how many remain."""
    kept = 0
    for i in range(count):
        x, y, z = rows[i, 0] - eye[0], rows[i, 1] - eye[1], rows[i, 2] - eye[2]
        if x * ahead[0] + y * ahead[1] + z * ahead[2] > 0.0:
            rows[kept] = rows[i]
            kept += 1
    return kept
