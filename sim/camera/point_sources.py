"""Everything that the lens sees as points: LEDs, their reflections, the Sun's glints, with their way in an exposure.

A point r of a body moves past the lens, in camera axes, at

    v_C = R_CW (v_r - v_lens) - w_C x p_C                                                                        (1)

and during the exposure by v_C t_exp. A glint is taken to stick to its place: only the camera's own turn and motion move
it.

Not modelled: the way of a glint over its surface; what hides an LED in a part of the exposure.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING

import mujoco
import numpy as np
from numpy.typing import NDArray

from dockair.rotations import Array
from dockair.sim.as_built import AsBuilt
from dockair.sim.camera.glints import find_glints
from dockair.sim.camera.led_reflections import find_led_reflections
from dockair.sim.camera.mirrors import Mirrors
from dockair.sim.camera.occlusion import hidden
from dockair.sim.camera.radiometry import Responses, led_electrons
from dockair.sim.camera.sun_view import SunView

if TYPE_CHECKING:  # the camera imports this module
    from dockair.sim.camera.camera import CameraSheets

_SMALLEST_PX = 0.5  # of a patch that is not a point
_LARGEST_STEP = 6.0  # 64 mm; larger flashes come as several patches
_LED_AXIS_D = np.array([-1.0, 0.0, 0.0])  # [docs/notation.md]: LEDs shine aft


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Sources:
    """Points of one size."""

    p_C: Array  #: (n, 3) camera axes [m]
    electrons: Array  #: (n,) of each whole blob
    size_m: float
    way_C_m: Array  #: (n, 3) motion during the exposure


class PointSources:
    """Finds the points of one world."""

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

    def of(
        self, data: mujoco.MjData, pose: tuple[Array, Array], exposure_s: float, led_factors: Array
    ) -> Iterator[Sources]:
        """Yield the points that the camera sees, those hidden with 0 electrons.

        Args:
            data: positions and velocities up to date.
            pose: R_WC and p_WC of the camera.
            exposure_s: exposure.
            led_factors: (n,) what faults leave of each LED's light.
        """
        R_WC, p_WC = pose
        leds_W = self.leds_W(data)
        intensity = self._as_built.led_intensity_w_sr * led_factors
        axis_C = R_WC.T @ data.xmat[self._drogue].reshape(3, 3) @ _LED_AXIS_D
        p_CL = (leds_W - p_WC) @ R_WC
        electrons = led_electrons(
            self._response, self._sheets.leds, intensity, p_CL, axis_C, exposure_s, self._extinction_1_m
        )
        yield Sources(
            p_C=p_CL,
            electrons=np.where(self.visible_leds(data, p_WC), electrons, 0.0),
            size_m=self._sheets.leds.die_size_m,
            way_C_m=exposure_s * self._velocity_C(data, pose, p_CL, leds_W),
        )
        yield self._led_reflections(data, pose, exposure_s, leds_W, intensity)
        if self._sun is not None and self._sun.beam > 0.0:
            yield from self._glints(data, pose, exposure_s, self._sun)

    def leds_W(self, data: mujoco.MjData) -> Array:
        """(n, 3) the LEDs as built [m]."""
        R_WD = data.xmat[self._drogue].reshape(3, 3)
        return np.asarray(data.xpos[self._drogue] + self._as_built.ring_positions_D @ R_WD.T)

    def visible_leds(self, data: mujoco.MjData, p_WC: Array) -> NDArray[np.bool_]:
        """(n,) which LEDs nothing hides from the lens."""
        clearance = self._sheets.leds.occlusion_clearance_m
        return np.logical_not(hidden(self._model, data, p_WC, self.leds_W(data), clearance))

    def _led_reflections(
        self, data: mujoco.MjData, pose: tuple[Array, Array], exposure_s: float, leds_W: Array, intensity: Array
    ) -> Sources:
        R_WC, p_WC = pose
        axis_W = data.xmat[self._drogue].reshape(3, 3) @ _LED_AXIS_D
        found = find_led_reflections(
            self._model,
            data,
            self._mirrors,
            p_WC,
            leds_W,
            axis_W,
            intensity,
            self._sheets.leds.pattern_exponent,
            self._sheets.surfaces,
        )
        p_C = (found.p_W - p_WC) @ R_WC
        # of the LEDs' spectrum, toward the lens: a source without a pattern
        electrons = self._response.led_e_m2_sr_w_s * exposure_s * found.intensity_w_sr * self._per_area(p_C)
        way_C_m = exposure_s * self._velocity_C(data, pose, p_C, None)
        return Sources(p_C=p_C, electrons=electrons, size_m=0.0, way_C_m=way_C_m)

    def _glints(
        self, data: mujoco.MjData, pose: tuple[Array, Array], exposure_s: float, sun: SunView
    ) -> Iterator[Sources]:
        R_WC, p_WC = pose
        found = find_glints(
            self._model,
            data,
            self._mirrors,
            p_WC,
            sun.direction_W,
            self._sheets.surfaces,
            self._sheets.light,
            R_WC[:, 0],
        )
        p_C = (found.p_W - p_WC) @ R_WC
        electrons = self._response.glint_e_m2_s * sun.beam * exposure_s * found.area_m2_sr * self._per_area(p_C)
        way_C_m = exposure_s * self._velocity_C(data, pose, p_C, None)
        sizes_m = _rounded(found.size_m, self._as_built.camera.focal_length_px / np.maximum(p_C[:, 0], 1e-3))
        for size_m in np.unique(sizes_m):
            of_size = sizes_m == size_m
            yield Sources(
                p_C=p_C[of_size], electrons=electrons[of_size], size_m=float(size_m), way_C_m=way_C_m[of_size]
            )

    def _per_area(self, p_C: Array) -> Array:
        """(n,) cos t/r^2 with what is left of the light on its way [1/m^2]."""
        r = np.linalg.norm(p_C, axis=1)
        return np.asarray(np.clip(p_C[:, 0] / r, 0.0, 1.0) * np.exp(-self._extinction_1_m * r) / r**2)

    def _velocity_C(
        self, data: mujoco.MjData, pose: tuple[Array, Array], p_C: Array, drogue_points_W: Array | None
    ) -> Array:
        """(n, 3) Eq. (1) of points of the drogue, or of points at rest in W where None."""
        R_WC, p_WC = pose
        w_W = data.cvel[self._receiver, :3]
        v_lens = self._point_velocity(data, self._receiver, p_WC)
        v_W = 0.0 if drogue_points_W is None else self._point_velocity(data, self._drogue, drogue_points_W)
        return np.asarray((v_W - v_lens) @ R_WC - np.cross(R_WC.T @ w_W, p_C))

    def _point_velocity(self, data: mujoco.MjData, body: int, points_W: Array) -> Array:
        """(n, 3) velocity in W of points of a body [m/s]; MuJoCo keeps that of the tree's centre of mass."""
        root = data.subtree_com[self._model.body_rootid[body]]
        w_W, v_root = data.cvel[body, :3], data.cvel[body, 3:]
        return np.asarray(v_root + np.cross(w_W, points_W - root))


def _rounded(size_m: Array, px_per_m: Array) -> Array:
    """(n,) sizes in powers of two of a millimetre, so that few spread functions serve all; 0 under half a pixel."""
    steps = np.round(np.log2(np.maximum(size_m, 1e-6) / 1e-3))
    return np.where(size_m * px_per_m < _SMALLEST_PX, 0.0, 1e-3 * 2.0 ** np.clip(steps, -2.0, _LARGEST_STEP))
