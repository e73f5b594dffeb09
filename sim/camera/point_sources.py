"""Everything that the lens sees as points: LEDs, their reflections, the Sun's glints, with their way in an exposure.

A point r of a body moves past the lens, in camera axes, at

    v_C = R_CW (v_r - v_lens) - w_C x p_C                                                                        (1)

and during the exposure by v_C t_exp. A glint is taken to stick to its place: only the camera's own turn and motion move
it.

Not modelled: the way of a glint over its surface; what hides an LED in a part of the exposure.
"""

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import mujoco
import numpy as np
from numba import njit
from numpy.typing import NDArray

from dockair.rotations import Array, skew
from dockair.sim.as_built import AsBuilt
from dockair.sim.camera.glints import glint_rows, starts_of_seen
from dockair.sim.camera.led_reflections import is_lit, led_reflection_rows
from dockair.sim.camera.lobes import ROW
from dockair.sim.camera.mirrors import Mirrors
from dockair.sim.camera.occlusion import hidden, is_clear
from dockair.sim.camera.radiometry import Responses, led_electrons
from dockair.sim.camera.sun_view import SunView

if TYPE_CHECKING:  # the camera imports this module
    from dockair.sim.camera.camera import CameraSheets

_SMALLEST_PX = 0.5  # of a patch that is not a point
WIDE_PX = 8.0  #: side of a patch that is so much wider than the lens's blur that it is drawn without it
_NEAREST_M = 1e-3
_SUN = -1.0  # in the place of an LED's number
_LED_AXIS_D = np.array([-1.0, 0.0, 0.0])  # [docs/notation.md]: LEDs shine aft


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Sources:
    """Points as the lens sees them."""

    p_C: Array  #: (n, 3) camera axes [m]
    electrons: Array  #: (n,) of each whole blob, 0 for what is hidden
    size_m: Array  #: (n,) side of the source
    way_C_m: Array  #: (n, 3) motion during the exposure


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
        self._receiver, self._drogue = model.body("receiver").id, model.body("drogue").id
        self._mirrors = Mirrors.of(model)

    def of(self, data: mujoco.MjData, pose: tuple[Array, Array], exposure_s: float, led_factors: Array) -> Sources:
        """Return all points: the LEDs first, in their order, then their reflections, then the Sun's glints.

        Args:
            data: positions and velocities up to date.
            pose: R_WC and p_WC of the camera.
            exposure_s: exposure.
            led_factors: (n,) what faults leave of each LED's light.
        """
        R_WC, p_WC = pose
        leds_W, intensity = self.leds_W(data), self._as_built.led_intensity_w_sr * led_factors
        axis_W, count = data.xmat[self._drogue].reshape(3, 3) @ _LED_AXIS_D, len(leds_W)
        mirrored, electrons_m2_s, size_m = self._mirrored(data, pose, leds_W, axis_W, intensity)
        seen, starts = starts_of_seen(self._model, data, p_WC, np.concatenate([self._led_rows(leds_W), mirrored]))
        kept = [
            i for i in np.flatnonzero(seen[count:]) if self._is_lit(data, starts[count + i], mirrored[i, 9], leds_W)
        ]
        p_C = (np.concatenate([leds_W, mirrored[kept, :3]]) - p_WC) @ R_WC
        p_CL, p_CM = p_C[:count], p_C[count:]
        leds, response = self._sheets.leds, self._response
        led_rates = led_electrons(response, leds, intensity, p_CL, axis_W @ R_WC, 1.0, self._extinction_1_m)
        mirrored_rates, sizes = electrons_m2_s[kept], size_m[kept]
        _as_received(p_CM, self._extinction_1_m, self._as_built.camera.focal_length_px, mirrored_rates, sizes)
        return Sources(
            p_C=p_C,
            electrons=exposure_s * np.concatenate([led_rates * seen[:count], mirrored_rates]),
            size_m=np.concatenate([np.full(count, leds.die_size_m), sizes]),
            way_C_m=exposure_s * self._velocities_C(data, pose, p_C, leds_W),
        )

    def leds_W(self, data: mujoco.MjData) -> Array:
        """(n, 3) the LEDs as built [m]."""
        R_WD = data.xmat[self._drogue].reshape(3, 3)
        return np.asarray(data.xpos[self._drogue] + self._as_built.ring_positions_D @ R_WD.T)

    def visible_leds(self, data: mujoco.MjData, p_WC: Array) -> NDArray[np.bool_]:
        """(n,) which LEDs nothing hides from the lens."""
        clearance = self._sheets.leds.occlusion_clearance_m
        return np.logical_not(hidden(self._model, data, p_WC, self.leds_W(data), clearance))

    def _led_rows(self, leds_W: Array) -> Array:
        """(n, ROW) the LEDs as patches for `starts_of_seen`."""
        rows = np.zeros((len(leds_W), ROW))
        rows[:, :3], rows[:, 8] = leds_W, self._sheets.leds.occlusion_clearance_m
        return rows

    def _mirrored(
        self, data: mujoco.MjData, pose: tuple[Array, Array], leds_W: Array, axis_W: Array, intensity: Array
    ) -> tuple[Array, Array, Array]:
        """What may mirror the LEDs, then the Sun, hidden places among them.

        Returns:
            (n, ROW) patches, the last column which LED or _SUN; (n,) electrons per second times m^2; (n,) sizes [m].
        """
        (R_WC, p_WC), sun = pose, self._sun
        leds, surfaces, response = self._sheets.leds, self._sheets.surfaces, self._response
        reflections, intensity_w_sr = led_reflection_rows(
            data, self._mirrors, p_WC, leds_W, axis_W, intensity, leds.pattern_exponent, surfaces
        )
        reflected_e_m2_s, points = response.led_e_m2_sr_w_s * intensity_w_sr, np.zeros(len(reflections))
        if sun is None or sun.beam <= 0.0:
            return reflections, reflected_e_m2_s, points
        glints = glint_rows(
            data, self._mirrors, p_WC, sun.direction_W, surfaces, self._sheets.light, np.ascontiguousarray(R_WC[:, 0])
        )
        glints[:, 9] = _SUN
        glint_e_m2_s = response.glint_e_m2_s * sun.beam * glints[:, 6]
        return (
            np.concatenate([reflections, glints]),
            np.concatenate([reflected_e_m2_s, glint_e_m2_s]),
            np.concatenate([points, glints[:, 7]]),
        )

    def _is_lit(self, data: mujoco.MjData, start: Array, light: float, leds_W: Array) -> bool:
        """Whether the way from a place (3,) to the Sun, or to an LED, is clear."""
        if light == _SUN:
            assert self._sun is not None
            return is_clear(self._model, data, start, self._sun.direction_W, np.inf)
        return is_lit(self._model, data, start, leds_W[int(light)], self._sheets.surfaces.led_seat_m)

    def _velocities_C(self, data: mujoco.MjData, pose: tuple[Array, Array], p_C: Array, leds_W: Array) -> Array:
        """(n, 3) Eq. (1): the LEDs, which come first, move with the drogue; what mirrors is taken to stand still."""
        R_WC, p_WC = pose
        w_C = R_WC.T @ data.cvel[self._receiver, :3]
        velocity_C = p_C @ skew(w_C) - self._point_velocities(data, self._receiver, p_WC) @ R_WC  # p x w = -w x p
        velocity_C[: len(leds_W)] += self._point_velocities(data, self._drogue, leds_W) @ R_WC
        return np.asarray(velocity_C)

    def _point_velocities(self, data: mujoco.MjData, body: int, points_W: Array) -> Array:
        """(..., 3) velocity in W of points of a body [m/s]; MuJoCo keeps that of the tree's centre of mass."""
        root = data.subtree_com[self._model.body_rootid[body]]
        return np.asarray(data.cvel[body, 3:] - (points_W - root) @ skew(data.cvel[body, :3]))


@njit(cache=True)
def _as_received(p_C: Array, extinction_1_m: float, focal_length_px: float, rates: Array, size_m: Array) -> None:
    """Turn (n,) electrons per second times m^2 into electrons per second, and round (n,) sizes, in place.

    The first with cos t/r^2 and what is left of the light on its way; the second to powers of two of a millimetre, so
    that few spread functions serve all. Patches under half a pixel are points; those from WIDE_PX on keep their size,
    for they are drawn without the lens.
    """
    for i in range(len(p_C)):
        x = p_C[i, 0]
        r = math.sqrt(x * x + p_C[i, 1] * p_C[i, 1] + p_C[i, 2] * p_C[i, 2])
        rates[i] *= min(max(x / r, 0.0), 1.0) * math.exp(-extinction_1_m * r) / r**2
        width_px = size_m[i] * focal_length_px / max(x, _NEAREST_M)
        if width_px < _SMALLEST_PX:
            size_m[i] = 0.0
        elif width_px < WIDE_PX:
            size_m[i] = 1e-3 * 2.0 ** round(math.log2(max(size_m[i], _NEAREST_M) / 1e-3))
