"""Everything that the lens sees as points: LEDs, their reflections, the Sun's glints, with their way in an exposure.

A point r of a body moves past the lens, in camera axes, at

    v_C = R_CW (v_r - v_lens) - w_C x p_C                                                                        (1)

and during the exposure by v_C t_exp. A glint is taken to stick to its place: only the camera's own turn and motion move
it.

Not modelled: the way of a glint over its surface; what hides an LED in a part of the exposure.
"""

from dataclasses import dataclass
from typing import TYPE_CHECKING

import mujoco
import numpy as np
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
_LED_AXIS_D = np.array([-1.0, 0.0, 0.0])  # [docs/notation.md]: LEDs shine aft

_Found = tuple[Array, Array, Array]  # places in W (n, 3), electrons per second times m^2 (n,), sizes (n,)


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
        axis_W = data.xmat[self._drogue].reshape(3, 3) @ _LED_AXIS_D
        visible, places_W, electrons_m2_s, size_m = self._seen(data, pose, leds_W, axis_W, intensity)
        p_C = (np.concatenate([leds_W, places_W]) - p_WC) @ R_WC
        p_CL, p_CM = p_C[: len(leds_W)], p_C[len(leds_W) :]
        leds_s = led_electrons(
            self._response, self._sheets.leds, intensity, p_CL, axis_W @ R_WC, 1.0, self._extinction_1_m
        )
        px_per_m = self._as_built.camera.focal_length_px / np.maximum(p_CM[:, 0], _NEAREST_M)
        sizes = np.full(len(leds_W), self._sheets.leds.die_size_m), _rounded(size_m, px_per_m)
        return Sources(
            p_C=p_C,
            electrons=exposure_s * np.concatenate([leds_s * visible, electrons_m2_s * self._per_area(p_CM)]),
            size_m=np.concatenate(sizes),
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

    def _seen(
        self, data: mujoco.MjData, pose: tuple[Array, Array], leds_W: Array, axis_W: Array, intensity: Array
    ) -> tuple[NDArray[np.bool_], Array, Array, Array]:
        """What the lens sees, all rays at once: (m,) which LEDs, and of what mirrors them or the Sun (n, 3) places in W,
        (n,) electrons per second times m^2, (n,) sizes.
        """
        leds, surfaces, response = self._sheets.leds, self._sheets.surfaces, self._response
        direct = np.zeros((len(leds_W), ROW))
        direct[:, :3], direct[:, 8] = leds_W, leds.occlusion_clearance_m
        reflected, intensity_w_sr = led_reflection_rows(
            data, self._mirrors, pose[1], leds_W, axis_W, intensity, leds.pattern_exponent, surfaces
        )
        rows = np.concatenate([direct, reflected, self._glint_rows(data, pose)])
        seen, starts = starts_of_seen(self._model, data, pose[1], rows)
        from_sun = len(direct) + len(reflected)
        mirrored = np.flatnonzero(seen[len(direct) :]) + len(direct)
        kept = [
            i for i in mirrored
            if (is_lit(self._model, data, starts[i], leds_W[int(rows[i, 9])], surfaces.led_seat_m) if i < from_sun
                else is_clear(self._model, data, starts[i], self._sun.direction_W, np.inf))
        ]
        electrons_m2_s = np.concatenate([response.led_e_m2_sr_w_s * intensity_w_sr, self._glint_e_m2_s * rows[from_sun:, 6]])
        return seen[: len(direct)], ...
    def _per_area(self, p_C: Array) -> Array:
        """(n,) cos t/r^2 with what is left of the light on its way [1/m^2]."""
        r = np.linalg.norm(p_C, axis=1)
        return np.asarray(np.clip(p_C[:, 0] / r, 0.0, 1.0) * np.exp(-self._extinction_1_m * r) / r**2)

    def _velocities_C(self, data: mujoco.MjData, pose: tuple[Array, Array], p_C: Array, leds_W: Array) -> Array:
        """(n, 3) Eq. (1): the LEDs, which come first, move with the drogue; what mirrors is taken to stand still."""
        R_WC, p_WC = pose
        v_lens = self._point_velocities(data, self._receiver, p_WC[None])
        velocity_W = np.broadcast_to(-v_lens, p_C.shape).copy()
        velocity_W[: len(leds_W)] += self._point_velocities(data, self._drogue, leds_W)
        w_C = R_WC.T @ data.cvel[self._receiver, :3]
        return np.asarray(velocity_W @ R_WC + p_C @ skew(w_C))  # p x w = -w x p

    def _point_velocities(self, data: mujoco.MjData, body: int, points_W: Array) -> Array:
        """(n, 3) velocity in W of points of a body [m/s]; MuJoCo keeps that of the tree's centre of mass."""
        root = data.subtree_com[self._model.body_rootid[body]]
        return np.asarray(data.cvel[body, 3:] - (points_W - root) @ skew(data.cvel[body, :3]))


def _rounded(size_m: Array, px_per_m: Array) -> Array:
    """(n,) sizes in powers of two of a millimetre, so that few spread functions serve all.

    Patches under half a pixel are points; those from WIDE_PX on keep their size, for they are drawn without the lens.
    """
    width_px = size_m * px_per_m
    rounded = 1e-3 * 2.0 ** np.round(np.log2(np.maximum(size_m, _NEAREST_M) / 1e-3))
    return np.where(width_px < _SMALLEST_PX, 0.0, np.where(width_px >= WIDE_PX, size_m, rounded))
