"""A third person's view of the world; nothing that flies looks through it.

The eye follows a point from behind and to the left. Greys are near-infrared reflectances in the scene's own
light, with the shadow side filled in; LEDs are drawn as small bright spheres, though near infrared is invisible. The
point looked at is made the origin before OpenGL's single precision sees the scene, which may be far from W's.
"""

from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray

from dockair.rotations import Array
from dockair.sim.off_screen import open_renderer

_DISTANCE_M = 9.0
_AZIMUTH_DEG = -30.0  # MuJoCo's: of the direction of view, from x toward y
_ELEVATION_DEG = -8.0
_LED_RADIUS_M = 0.018
_LED_RGBA = np.array([1.0, 0.35, 0.45, 1.0], dtype=np.float32)
_FILL_LIGHT = 0.35  # ambient light added: the shadow side must be seen too
_OVERSAMPLING = 2  # the picture is drawn finer and averaged, which smooths edges without multisampling
_SPARE_GEOMS = 100


class ThirdPersonView:
    """Renders the world off-screen.

    Args:
        model: of the world.
        width_px: of the picture.
        height_px: of the picture.

    Raises:
        MachineError: no off-screen OpenGL here.
    """

    def __init__(self, model: mujoco.MjModel, width_px: int, height_px: int) -> None:
        self._model, self._shape = model, (height_px, width_px)
        width, height = _OVERSAMPLING * width_px, _OVERSAMPLING * height_px
        font = mujoco.mjtFontScale.mjFONTSCALE_100.value
        self._context, self._renderer = open_renderer(model, width, height, font, "render")
        self._scene = mujoco.MjvScene(model, model.ngeom + _SPARE_GEOMS)
        self._scene.flags[mujoco.mjtRndFlag.mjRND_SHADOW] = 0
        self._option = mujoco.MjvOption()
        self._camera = mujoco.MjvCamera()
        self._camera.distance, self._camera.azimuth = _DISTANCE_M, _AZIMUTH_DEG
        self._camera.elevation = _ELEVATION_DEG
        self._near = mujoco.MjData(model)  # the scene about the point looked at
        self._leds = [i for i in range(model.nsite) if model.site(i).name.startswith("led_")]

    def render(self, data: mujoco.MjData, look_at_W: Array) -> NDArray[np.uint8]:
        """(height, width, 3) picture of the world now, a new array.

        Args:
            data: of the world; not changed.
            look_at_W: (3,) point in the middle of the picture [m].
        """
        self._camera.lookat[:] = 0.0
        near, everything = self._near, mujoco.mjtCatBit.mjCAT_ALL.value
        near.geom_xpos[:], near.geom_xmat[:] = data.geom_xpos - look_at_W, data.geom_xmat
        near.light_xdir[:] = data.light_xdir
        mujoco.mjv_updateScene(self._model, near, self._option, None, self._camera, everything, self._scene)
        for light in self._scene.lights[: self._scene.nlight]:
            light.ambient[:] = _FILL_LIGHT
        for led in self._leds:
            self._add_led(data.site_xpos[led] - look_at_W)
        height, width = self._shape
        rect = mujoco.MjrRect(0, 0, _OVERSAMPLING * width, _OVERSAMPLING * height)
        fine = np.empty((rect.height, rect.width, 3), dtype=np.uint8)
        self._context.make_current()
        mujoco.mjr_render(rect, self._scene, self._renderer)
        mujoco.mjr_readPixels(fine, None, rect, self._renderer)
        blocks = fine.reshape(height, _OVERSAMPLING, width, _OVERSAMPLING, 3)
        linear = blocks.mean(axis=(1, 3))[::-1] / 255.0  # OpenGL's rows run upward
        return np.asarray(255.0 * np.sqrt(linear), dtype=np.uint8)  # for a screen's gamma

    def close(self) -> None:
        """Free the off-screen context."""
        self._context.make_current()
        self._renderer.free()
        self._context.free()

    def _add_led(self, position: Any) -> None:
        if self._scene.ngeom >= self._scene.maxgeom:
            return
        geom = self._scene.geoms[self._scene.ngeom]
        size, axes = np.full(3, _LED_RADIUS_M), np.eye(3).ravel()
        mujoco.mjv_initGeom(geom, mujoco.mjtGeom.mjGEOM_SPHERE, size, position, axes, _LED_RGBA)
        geom.emission = 1.0
        self._scene.ngeom += 1
