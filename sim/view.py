"""A third person's view of the world, in the visible; nothing that flies looks through it.

The eye follows the receiver's probe from behind and to the left. LEDs are drawn as small bright spheres, which they
are not to the eye: near infrared is invisible.
"""

from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray

from dockair.rotations import Array

_DISTANCE_M = 9.0
_AZIMUTH_DEG = -52.0  # MuJoCo's: direction of view from x toward y; the eye is behind and to the left
_ELEVATION_DEG = -14.0
_LED_RADIUS_M = 0.012
_LED_RGBA = np.array([1.0, 0.35, 0.45, 1.0], dtype=np.float32)


class ThirdPersonView:
    """Renders the world off-screen.

    Args:
        model: of the world.
        width_px: of the picture.
        height_px: of the picture.
    """

    def __init__(self, model: mujoco.MjModel, width_px: int, height_px: int) -> None:
        self._model = model
        self._renderer = mujoco.Renderer(model, height_px, width_px)
        self._camera = mujoco.MjvCamera()
        self._camera.distance, self._camera.azimuth = _DISTANCE_M, _AZIMUTH_DEG
        self._camera.elevation = _ELEVATION_DEG
        self._leds = [i for i in range(model.nsite) if model.site(i).name.startswith("led_")]

    def render(self, data: mujoco.MjData, look_at_W: Array) -> NDArray[np.uint8]:
        """(height, width, 3) picture of the world now, a new array.

        Args:
            data: of the world.
            look_at_W: (3,) point in the middle of the picture [m].
        """
        self._camera.lookat[:] = look_at_W
        self._renderer.update_scene(data, self._camera)
        for led in self._leds:
            self._add_led(data.site_xpos[led])
        return np.array(self._renderer.render())

    def close(self) -> None:
        """Free the off-screen context."""
        self._renderer.close()

    def _add_led(self, position_W: Any) -> None:
        scene = self._renderer.scene
        if scene.ngeom >= scene.maxgeom:
            return
        geom = scene.geoms[scene.ngeom]
        size, axes = np.full(3, _LED_RADIUS_M), np.eye(3).ravel()
        mujoco.mjv_initGeom(geom, mujoco.mjtGeom.mjGEOM_SPHERE, size, position_W, axes, _LED_RGBA)
        geom.emission = 1.0
        scene.ngeom += 1
