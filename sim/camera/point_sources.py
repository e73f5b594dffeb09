"""Everything that the lens sees as points: LEDs, their reflections, the Sun's glints, with their way in an exposure.

A point r of a body moves past the lens, in camera axes, at

    v_C = R_CW (v_r - v_lens) - w_C x p_C                                                                        (1)

and during the exposure by v_C t_exp. A glint, and an LED's reflection, moves as the body's point that it is on.

Not modelled: the way of a glint over its surface as body, light and lens turn; what hides an LED in a part of the
exposure.
"""

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import mujoco
import numpy as np
from numpy.typing import NDArray

from dockair.kernels import njit
from dockair.rotations import Array
from dockair.sim.as_built import AsBuilt
from dockair.sim.camera.glints import glint_rows, starts_of_seen
from dockair.sim.camera.led_reflections import led_reflection_rows
from dockair.sim.camera.lobes import ROW
from dockair.sim.camera.mirrors import Mirrors, vector
from dockair.sim.camera.obstacles import Obstacles
from dockair.sim.camera.occlusion import hidden, rays_are_clear
from dockair.sim.camera.radiometry import Responses, led_electrons
from dockair.sim.camera.sun_view import SunView
from dockair.triples import Vector

if TYPE_CHECKING:  # the camera imports this module
    from dockair.sim.camera.sheets import CameraSheets

_SMALLEST_PX = 0.5  # of a patch that is not a point
WIDE_PX = 8.0  #: side of a patch that is so much wider than the lens's blur that it is drawn without it
_NEAREST_M = 1e-3
_SUN = -1.0  # in the place of an LED's number
_LED_AXIS_D = np.array([-1.0, 0.0, 0.0])  # [docs/notation.md]: LEDs shine aft


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Sources:
    """Points as the lens sees them."""

    p_C: Array  #: (n, 3) camera axes [m]
    electrons: Array  #: (n,) of each whole blob
    size_m: Array  #: (n,) side of the source
    way_C_m: Array  #: (n, 3) motion during the exposure
    patches_W: Array  #: (n, ROW) as of `lobes`; its light which LED a mirror shows, or _SUN


class PointSources:
    """Finds the points of one world.

    Args:
        model: the world's.
        sheets: LEDs, surfaces, light.
        as_built: LEDs' places and intensities.
        response: electrons of each kind of source.
        sun: None without Sun.
        extinction_1_m: of the air.
    """

    def __init__(
        self,
        model: mujoco.MjModel,
        sheets: "CameraSheets",
        as_built: AsBuilt,
        response: Responses,
        sun: SunView | None,
        extinction_1_m: float,
    ) -> None:
        self._model, self._sheets, self._as_built, self._response = model, sheets, as_built, response
        self._sun, self._extinction_1_m = sun, extinction_1_m
        self._camera, self._drogue = model.body("receiver").id, model.body("drogue").id
        self._led_geom = int(np.flatnonzero(model.geom_bodyid == self._drogue)[0])
        self._trees, self._count = (model.geom_bodyid, model.body_rootid), len(as_built.led_intensity_w_sr)
        self._mirrors, self._obstacles = Mirrors.of(model), Obstacles.of(model)

    def of(self, data: mujoco.MjData, pose: tuple[Array, Array], exposure_s: float, led_factors: Array) -> Sources:
        """Return all points: the LEDs first, in their order, dark where hidden, then what mirrors LEDs, then the Sun.

        Args:
            data: positions and velocities up to date.
            pose: R_WC and p_WC of the camera.
            exposure_s: exposure.
            led_factors: (n,) what faults leave of each LED's light.
        """
        found = self.candidates(data, pose, exposure_s, led_factors)
        seen = self.are_seen(data, pose[1], found, np.arange(len(found.electrons)))
        kept = np.flatnonzero(seen | (np.arange(len(seen)) < self._count))
        return Sources(
            p_C=found.p_C[kept],
            electrons=(found.electrons * seen)[kept],
            size_m=found.size_m[kept],
            way_C_m=found.way_C_m[kept],
            patches_W=found.patches_W[kept],
        )

    def candidates(
        self, data: mujoco.MjData, pose: tuple[Array, Array], exposure_s: float, led_factors: Array
    ) -> Sources:
        """Return what could be seen if nothing hid it, in the order of `of`; arguments as there."""
        R_WC, p_WC = pose
        leds_W, intensity = self.leds_W(data), self._as_built.led_intensity_w_sr * led_factors
        axis_W, count = data.xmat[self._drogue].reshape(3, 3) @ _LED_AXIS_D, self._count
        leds, f_px = self._sheets.leds, self._as_built.camera.focal_length_px
        reflections, intensity_w_sr, glints = self._mirrored(data, pose, leds_W, axis_W, intensity)
        beam = 0.0 if self._sun is None else self._sun.beam
        all_light = self._response.led_e_m2_sr_w_s, self._response.glint_e_m2_s * beam
        total = count + len(reflections) + len(glints)
        patches, electrons, sizes = np.empty((total, ROW)), np.empty(total), np.empty(total)
        own = leds_W, leds.die_size_m, leds.occlusion_clearance_m, self._led_geom
        _join(own, (reflections, intensity_w_sr), glints, all_light, patches, electrons, sizes)
        p_C = (patches[:, :3] - p_WC) @ R_WC
        electrons[:count] = led_electrons(
            self._response, leds, intensity, p_C[:count], axis_W @ R_WC, 1.0, self._extinction_1_m
        )
        lens, ways = (self._extinction_1_m, f_px), np.empty_like(p_C)
        _as_received(p_C, count, lens, exposure_s, electrons, sizes)
        motion = data.cvel, data.subtree_com, *self._trees
        _ways(patches[:, :3], patches[:, 10], R_WC, motion, self._camera, exposure_s, ways)
        return Sources(p_C=p_C, electrons=electrons, size_m=sizes, way_C_m=ways, patches_W=patches)

    def are_seen(
        self, data: mujoco.MjData, p_WC: Array, candidates: Sources, which: NDArray[np.intp]
    ) -> NDArray[np.bool_]:
        """(k,) whether the lens sees these of the candidates, and their light reaches them."""
        patches, leds_W = candidates.patches_W[which], candidates.patches_W[: self._count, :3]
        seen, starts = starts_of_seen(self._obstacles, data, p_WC, patches)
        sun = (0.0, 0.0, 0.0) if self._sun is None else vector(self._sun.direction_W)
        rays, reach = np.empty_like(starts), np.empty(len(starts))
        _toward_lights(which, seen, starts, patches, leds_W, self._sheets.surfaces.led_seat_m, sun, rays, reach)
        seen &= rays_are_clear(self._obstacles, data, starts, rays, reach)
        return seen

    def leds_W(self, data: mujoco.MjData) -> Array:
        """(n, 3) the LEDs as built [m]."""
        R_WD = data.xmat[self._drogue].reshape(3, 3)
        return np.asarray(data.xpos[self._drogue] + self._as_built.ring_positions_D @ R_WD.T)

    def visible_leds(self, data: mujoco.MjData, p_WC: Array) -> NDArray[np.bool_]:
        """(n,) which LEDs nothing hides from the lens."""
        clearance = self._sheets.leds.occlusion_clearance_m
        return np.logical_not(hidden(self._obstacles, data, p_WC, self.leds_W(data), clearance))

    def _mirrored(
        self, data: mujoco.MjData, pose: tuple[Array, Array], leds_W: Array, axis_W: Array, intensity: Array
    ) -> tuple[Array, Array, Array]:
        """What may mirror the LEDs (n, ROW), how brightly (n,) [W/sr], and the Sun (m, ROW), hidden or not."""
        (R_WC, p_WC), sun = pose, self._sun
        leds, surfaces = self._sheets.leds, self._sheets.surfaces
        reflections, intensity_w_sr = led_reflection_rows(
            data, self._mirrors, p_WC, leds_W, axis_W, intensity, leds.pattern_exponent, surfaces
        )
        if sun is None or sun.beam <= 0.0:
            return reflections, intensity_w_sr, np.empty((0, ROW))
        light = self._sheets.light
        glints = glint_rows(data, self._mirrors, p_WC, sun.direction_W, surfaces, light, R_WC[:, 0])
        return reflections, intensity_w_sr, glints


#: Twists (nbody, 6) about their trees' centres (nbody, 3) [MuJoCo: cvel, subtree_com]; body of a geom, tree of a body.
Motion = tuple[Array, Array, NDArray[np.int32], NDArray[np.int32]]


@njit(cache=True)
def _velocity(motion: Motion, body: int, p: Vector) -> Vector:
    """Of a body's point, in W [m/s]."""
    twists, centres, _, trees = motion
    v, at = twists[body], centres[trees[body]]
    x, y, z = p[0] - at[0], p[1] - at[1], p[2] - at[2]
    return v[3] + v[1] * z - v[2] * y, v[4] + v[2] * x - v[0] * z, v[5] + v[0] * y - v[1] * x


@njit(cache=True)
def _ways(places_W: Array, geoms: Array, R: Array, motion: Motion, camera: int, exposure_s: float, out: Array) -> None:
    """Fill (n, 3) Eq. (1) times the exposure for points (n, 3) of geoms (n,); R is R_WC, `camera` the body it is on."""
    for i in range(len(places_W)):
        p = (places_W[i, 0], places_W[i, 1], places_W[i, 2])
        past = _velocity(motion, camera, p)  # of the camera's body, drawn on to the point: v_lens + w x p
        own = _velocity(motion, motion[2][int(geoms[i])], p)
        for k in range(3):
            v = R[0, k] * (own[0] - past[0]) + R[1, k] * (own[1] - past[1]) + R[2, k] * (own[2] - past[2])
            out[i, k] = exposure_s * v


@njit(cache=True)
def _join(
    leds: tuple[Array, float, float, int],
    reflections: tuple[Array, Array],
    glints: Array,
    light: tuple[float, float],
    patches: Array,
    electrons: Array,
    size_m: Array,
) -> None:
    """Fill patches, electrons per second times m^2, and sizes: of LEDs (no electrons), their reflections, the Sun's.

    Args:
        leds: (k, 3) places, size of a die, how near to one nothing hides it, a geom of their body.
        reflections: (n, ROW) patches and (n,) intensities [W/sr].
        glints: (m, ROW).
        light: electrons per m^2 and W/sr of an LED, per m^2 of a glint.
        patches: (k + n + m, ROW), written.
        electrons: (k + n + m,), written.
        size_m: (k + n + m,), written.
    """
    (leds_W, die_m, clearance_m, geom), (mirrored, intensity_w_sr) = leds, reflections
    k, n = len(leds_W), len(leds_W) + len(mirrored)
    patches[:k], size_m[:k] = 0.0, die_m
    patches[:k, :3], patches[:k, 8], patches[:k, 10] = leds_W, clearance_m, geom
    patches[k:n], electrons[k:n], size_m[k:n] = mirrored, light[0] * intensity_w_sr, 0.0
    patches[n:], electrons[n:], size_m[n:] = glints, light[1] * glints[:, 6], glints[:, 7]
    patches[n:, 9] = _SUN


@njit(cache=True)
def _toward_lights(
    which: NDArray[np.intp],
    seen: NDArray[np.bool_],
    starts: Array,
    patches: Array,
    leds_W: Array,
    seat_m: float,
    sun: Vector,
    rays: Array,
    reach: Array,
) -> None:
    """Fill (n, 3) unit vectors from places to the Sun, or to an LED, and (n,) how far the way has to be clear.

    That is 0, without a vector, for LEDs themselves, which come first, and for what is not seen anyway.
    """
    for i in range(len(starts)):
        if not seen[i] or which[i] < len(leds_W):
            reach[i] = 0.0
            continue
        if patches[i, 9] == _SUN:
            rays[i, 0], rays[i, 1], rays[i, 2] = sun
            reach[i] = math.inf
            continue
        led = leds_W[int(patches[i, 9])]
        x, y, z = led[0] - starts[i, 0], led[1] - starts[i, 1], led[2] - starts[i, 2]
        distance = math.sqrt(x * x + y * y + z * z)
        rays[i, 0], rays[i, 1], rays[i, 2] = x / distance, y / distance, z / distance
        reach[i] = distance - seat_m


@njit(cache=True)
def _as_received(
    p_C: Array,
    leds: int,
    lens: tuple[float, float],
    exposure_s: float,
    electrons: Array,
    size_m: Array,
) -> None:
    """Turn (n,) electrons per second, of what mirrors times m^2, into electrons, and round its (n,) sizes, in place.

    What mirrors comes after the LEDs. Its light falls with cos t/r^2 and what is left of it on its way; its sizes go
    to powers of two of a millimetre, so that few spread functions serve all. Patches under half a pixel are points;
    those from WIDE_PX on keep their size, for they are drawn without the lens. `lens` is extinction and focal length.
    """
    extinction_1_m, focal_length_px = lens
    electrons[:leds] *= exposure_s
    for i in range(leds, len(p_C)):
        x = p_C[i, 0]
        r = math.sqrt(x * x + p_C[i, 1] * p_C[i, 1] + p_C[i, 2] * p_C[i, 2])
        electrons[i] *= min(max(x / r, 0.0), 1.0) * math.exp(-extinction_1_m * r) / r**2
        electrons[i] *= exposure_s
        width_px = size_m[i] * focal_length_px / max(x, _NEAREST_M)
        if width_px < _SMALLEST_PX:
            size_m[i] = 0.0
        elif width_px < WIDE_PX:
            size_m[i] = 1e-3 * 2.0 ** round(math.log2(size_m[i] / 1e-3))
