"""LEDs mirrored by what stands near them: basket, coupling, probe.

    I_ref = (I(psi)/d1^2) A,    I(psi) = I_0 max(cos^m psi, side light)                                          (1)

A in m^2/sr of [lobes, eq 4] with the LED at the distance d1 of the mirror point, psi off the LED's axis. The LEDs shine
aft, on the probe; what they send sideways and forward, to the basket and the coupling, is `led_side_light`.

Most pairs of LED and mirror are too faint whatever their mirror point, and are not looked at: with R at most the
material's share, c the angle between ray and tube, which a straight line from LED to lens makes smallest,

    sphere  A < R r^2/4 (d, d1 >> r only makes it less),    tube  A < R r d1/(2 sin c)                            (2)

Not modelled: flat faces, hose, tanker and receiver's skin as mirrors; reflections of reflections; the LED's size.
Sources: as of `lobes`.
"""

import math
from dataclasses import dataclass

import mujoco
import numpy as np
from numpy.typing import NDArray

from dockair.kernels import njit
from dockair.rotations import Array
from dockair.sim.camera.curved_mirrors import ellipsoid_spots, rim_spots
from dockair.sim.camera.glints import starts_of_seen
from dockair.sim.camera.lobes import ROW, SPOT, Poses, spot_rows
from dockair.sim.camera.mirrors import Balls, Mirrors, Tubes, finishes, vector
from dockair.sim.camera.obstacles import Obstacles
from dockair.sim.camera.occlusion import is_clear
from dockair.sim.camera.round_mirrors import round_spots
from dockair.sim.camera.sheets import SurfaceParameters
from dockair.triples import Vector, dot

_CLOSEST_M = 1e-3  # to a surface, in the bound (2)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class LedReflections:
    """Mirror images of LEDs that both the LED and the camera see."""

    p_W: Array  #: (n, 3) where they are mirrored [m]
    intensity_w_sr: Array  #: (n,) toward the lens
    led: NDArray[np.intp]  #: (n,) which LED


def find_led_reflections(
    model: mujoco.MjModel,
    data: mujoco.MjData,
    mirrors: Mirrors,
    p_WC: Array,
    leds_W: Array,
    axis_W: Array,
    intensity_w_sr: Array,
    pattern_exponent: float,
    surfaces: SurfaceParameters,
) -> LedReflections:
    """Return the reflections that are bright enough, Eq. (1).

    Args:
        model: the one `mirrors` is of.
        data: its poses, up to date; not changed.
        mirrors: of `Mirrors.of`.
        p_WC: (3,) the lens [m].
        leds_W: (m, 3) [m].
        axis_W: (3,) unit vector along which they shine.
        intensity_w_sr: (m,) on the axis.
        pattern_exponent: m of Eq. (1).
        surfaces: reflectances, side light, limits.
    """
    rows, intensity = led_reflection_rows(
        data, mirrors, p_WC, leds_W, axis_W, intensity_w_sr, pattern_exponent, surfaces
    )
    led = rows[:, 9].astype(np.intp)
    obstacles = Obstacles.of(model)
    seen, starts = starts_of_seen(obstacles, data, p_WC, rows)
    kept = [i for i in np.flatnonzero(seen) if is_lit(obstacles, data, starts[i], leds_W[led[i]], surfaces.led_seat_m)]
    return LedReflections(p_W=rows[kept, :3], intensity_w_sr=intensity[kept], led=led[kept])


def led_reflection_rows(
    data: mujoco.MjData,
    mirrors: Mirrors,
    p_WC: Array,
    leds_W: Array,
    axis_W: Array,
    intensity_w_sr: Array,
    pattern_exponent: float,
    surfaces: SurfaceParameters,
) -> tuple[Array, Array]:
    """(n, ROW) reflections that are bright enough, hidden ones among them, and (n,) their intensities [W/sr].

    Arguments as of `find_led_reflections`.
    """
    leds_W, axis = np.asarray(leds_W, dtype=float), vector(axis_W)
    intensity_w_sr = np.asarray(intensity_w_sr, dtype=float)
    limit = surfaces.faintest_reflection * float(intensity_w_sr.max(initial=0.0))
    eye, near, poses = vector(p_WC), (mirrors.near_balls, mirrors.near_tubes), (data.geom_xpos, data.geom_xmat)
    pattern = pattern_exponent, surfaces.led_side_light
    wanted = _wanted(near, poses, leds_W, axis, eye, finishes(surfaces), pattern[1], intensity_w_sr, limit)
    rows = _rows(data, mirrors, eye, leds_W, wanted, surfaces)
    intensity = np.empty(len(rows))
    count = _reflect(rows, leds_W, axis, intensity_w_sr, pattern, limit, intensity)
    return rows[:count], intensity[:count]


@njit(cache=True)
def _reflect(
    rows: Array,
    leds_W: Array,
    axis: Vector,
    intensity_w_sr: Array,
    pattern: tuple[float, float],
    limit: float,
    out: Array,
) -> int:
    """Keep the rows whose I_ref, Eq. (1), is above the limit, and fill it in; `pattern` is m and the side light."""
    count = 0
    for i in range(len(rows)):
        j = int(rows[i, 9])
        ray = (rows[i, 0] - leds_W[j, 0], rows[i, 1] - leds_W[j, 1], rows[i, 2] - leds_W[j, 2])
        d2 = dot(ray, ray)
        cos_psi = max(dot(ray, axis) / math.sqrt(d2), 0.0)
        reflected = intensity_w_sr[j] * max(cos_psi ** pattern[0], pattern[1]) * rows[i, 6] / d2
        if reflected > 0.0 and reflected >= limit:
            rows[count], out[count] = rows[i], reflected
            count += 1
    return count


@njit(cache=True)
def _wanted(
    mirrors: tuple[Balls, Tubes],
    poses: Poses,
    leds_W: Array,
    axis: Vector,
    eye: Vector,
    finish: Array,
    side: float,
    intensity_w_sr: Array,
    limit: float,
) -> NDArray[np.bool_]:
    """(m, n) which pairs may be above the limit."""
    bound = _bound(mirrors, poses, leds_W, axis, eye, finish, side)
    out = np.empty(bound.shape[::-1], dtype=np.bool_)
    for i in range(len(bound)):
        for j in range(bound.shape[1]):
            out[j, i] = bound[i, j] * intensity_w_sr[j] >= limit
    return out


@njit(cache=True)
def _bound(
    mirrors: tuple[Balls, Tubes], poses: Poses, leds_W: Array, axis: Vector, eye: Vector, finish: Array, side: float
) -> Array:
    """(balls + tubes, m) what A I(psi)/(I_0 d1^2) cannot exceed, Eqs. (1) and (2).

    Each solid's row is worked out without branches, all LEDs at once.
    """
    balls, tubes = mirrors
    bound, places = np.empty((len(balls.geom) + len(tubes.geom), len(leds_W))), leds_W.T.copy()
    _bound_of_balls(balls, poses, places, axis, finish, side, bound)
    _bound_of_tubes(tubes, poses, places, axis, eye, finish, side, bound[len(balls.geom) :])
    return bound


@njit(cache=True, error_model="numpy")
def _bound_of_balls(
    balls: Balls, poses: Poses, leds_W: Array, axis: Vector, finish: Array, side: float, bound: Array
) -> None:
    (xpos, xmat), (x, y, z) = poses, (leds_W[0], leds_W[1], leds_W[2])
    for i in range(len(balls.geom)):
        g, radius, at_z = balls.geom[i], balls.axes[i].max(), balls.at_z[i]
        most = finish[balls.material[i], 2] * radius**2 / 4.0
        centre, row = (
            (xpos[g, 0] + at_z * xmat[g, 2], xpos[g, 1] + at_z * xmat[g, 5], xpos[g, 2] + at_z * xmat[g, 8]),
            bound[i],
        )
        for j in range(len(row)):
            p = (centre[0] - x[j], centre[1] - y[j], centre[2] - z[j])
            d = max(math.sqrt(dot(p, p)) - radius, _CLOSEST_M)
            row[j] = (1.0 if dot(p, axis) + radius > 0.0 else side) * most / d**2


@njit(cache=True, error_model="numpy")
def _bound_of_tubes(
    tubes: Tubes, poses: Poses, leds_W: Array, axis: Vector, eye: Vector, finish: Array, side: float, bound: Array
) -> None:
    (xpos, xmat), (x, y, z) = poses, (leds_W[0], leds_W[1], leds_W[2])
    for i in range(len(tubes.geom)):
        g, radius, half = tubes.geom[i], tubes.radius[i], tubes.half_length[i]
        a, row = (xmat[g, 2], xmat[g, 5], xmat[g, 8]), bound[i]
        reach, most = half * abs(dot(a, axis)) + radius, 0.5 * finish[tubes.material[i], 2] * radius
        for j in range(len(row)):
            p = (xpos[g, 0] - x[j], xpos[g, 1] - y[j], xpos[g, 2] - z[j])
            along = dot(p, a)
            across2 = max(dot(p, p) - along**2, 0.0)
            d = max(math.sqrt(across2 + max(abs(along) - half, 0.0) ** 2) - radius, _CLOSEST_M)
            sight = (eye[0] - x[j], eye[1] - y[j], eye[2] - z[j])
            sin2_c = max(1.0 - dot(sight, a) ** 2 / dot(sight, sight), _CLOSEST_M**2)
            row[j] = (1.0 if dot(p, axis) + reach > 0.0 else side) * most / (math.sqrt(sin2_c) * d)


def is_lit(obstacles: Obstacles, data: mujoco.MjData, start: Array, led_W: Array, seat_m: float) -> bool:
    """Say whether nothing stands between a place (3,) and an LED, but for its seat."""
    ray = led_W - start
    distance = math.sqrt(ray @ ray)
    return is_clear(obstacles, data, start, ray / distance, distance - seat_m)


def _rows(
    data: mujoco.MjData,
    mirrors: Mirrors,
    eye: Vector,
    leds_W: Array,
    wanted: NDArray[np.bool_],
    surfaces: SurfaceParameters,
) -> Array:
    """(n, ROW) reflections, faint and hidden ones among them."""
    balls, tubes = mirrors.near_balls, mirrors.near_tubes
    xpos, xmat = data.geom_xpos, data.geom_xmat
    spots = np.empty((wanted.size + 2 * len(leds_W), SPOT))
    finish = finishes(surfaces)
    n = round_spots(balls, tubes, xpos, xmat, leds_W, 1.0, wanted, eye, finish, 0.0, spots)
    if mirrors.any_ellipsoids:
        n += ellipsoid_spots(balls, xpos, xmat, leds_W, 1.0, eye, spots[n:])
    if mirrors.rim is not None:
        n += rim_spots(mirrors.rim.torus_W(data), mirrors.rim.labels, leds_W, 1.0, eye, spots[n:])
    limits = (math.cos(surfaces.grazing_rad), 0.0, 0.0, math.inf)
    rows = np.empty((n, ROW))
    return rows[: spot_rows(spots[:n], leds_W, 1.0, 0.0, eye, finish, limits, rows, 0)]
