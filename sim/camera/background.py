"""What the LEDs stand in front of: the scene drawn off-screen by MuJoCo, as expected electrons.

    e(u, v) = e_white grey(u, v) cos^4 t + floor,    cos t = f / sqrt(f^2 + (u - c_u)^2 + (v - c_v)^2)           (1)

grey is the drawn value, 0 to 1; 1 is the radiance of a white Lambertian surface in normal sunlight, so the scene's
light has ambient + diffuse = 1 and geoms' grey is their reflectance. The picture is an exact pinhole's: an off-centre
frustum on the grid of blocks of k x k pixels (sheet `camera`, background_reduction), which a window cuts out of the
full frame's, with one block more on each side; between the blocks' centres it is interpolated linearly.

The scene is shifted so that the lens is its origin, in double precision, before OpenGL's single precision sees it.
Not modelled: shadows, interreflections, gloss (that is `glare`), lens distortion and blur of the background, more than
256 grey levels (1.3 e- each at the default exposure).
"""

import math
from typing import Any

import mujoco
import numpy as np
from numba import njit
from numpy.typing import NDArray

from dockair.calibration import Camera
from dockair.messages import Window
from dockair.rotations import Array
from dockair.sim.off_screen import open_renderer

VISIBLE_GROUPS: NDArray[np.uint8] = np.array([1, 1, 1, 0, 0, 0], dtype=np.uint8)  #: MuJoCo's own default
_FONT = 50  # smallest; no text is drawn
_SPARE_GEOMS = 100
_BLOCK_MARGIN = 1  # blocks around a window that the interpolation reaches into


class Background:
    """Draws the scene behind the LEDs. The OpenGL context is made at the first picture."""

    def __init__(self, model: mujoco.MjModel, camera: Camera, reduction: int) -> None:
        """Keep what the pictures need.

        Args:
            model: the world's; read only.
            camera: as built; its distortion is ignored here.
            reduction: side of a block of pixels [px].
        """
        self._model, self._camera, self._reduction = model, camera, reduction
        self._context: Any = None
        self._renderer: Any = None
        self._scene: Any = None
        self._option = mujoco.MjvOption()
        self._option.geomgroup[:] = VISIBLE_GROUPS
        self._option.sitegroup[:] = 0
        self._option.tendongroup[:] = 0
        self._view = mujoco.MjvCamera()

    def electrons(
        self, data: mujoco.MjData, pose: tuple[Array, Array], window: Window, white_e: float, floor_e: float
    ) -> NDArray[np.float32]:
        """Return (rows, columns) expected electrons of the window, Eq. (1).

        Args:
            data: positions and attitudes up to date; not changed.
            pose: R_WC (3, 3) and p_WC (3,) of the camera.
            window: inside the sensor.
            white_e: electrons of grey 1 on the axis.
            floor_e: added to every pixel.

        Raises:
            MachineError: no off-screen OpenGL here.
        """
        k = self._reduction
        first = window.row_start // k - _BLOCK_MARGIN, window.column_start // k - _BLOCK_MARGIN
        last = -(-window.row_stop // k) + _BLOCK_MARGIN, -(-window.column_stop // k) + _BLOCK_MARGIN
        grey = self._draw(data, pose, first, last)
        c_u, c_v = self._camera.principal_point_px
        out = np.empty(window.shape, dtype=np.float32)
        start = window.row_start, window.column_start
        axis = c_u, c_v, self._camera.focal_length_px
        _expand(grey, first, k, start, axis, white_e / 255.0, floor_e, out)
        return out

    def close(self) -> None:
        """Free the OpenGL context."""
        if self._renderer is not None:
            self._context.make_current()
            self._renderer.free()
        if self._context is not None:
            self._context.free()
        self._context = self._renderer = self._scene = None

    def _draw(
        self, data: mujoco.MjData, pose: tuple[Array, Array], first: tuple[int, int], last: tuple[int, int]
    ) -> NDArray[np.uint8]:
        """Return (rows, columns, 3) bottom-up grey levels of the blocks [first, last)."""
        self._open()
        self._update(data, pose)
        self._aim(first, last)
        rows, columns = last[0] - first[0], last[1] - first[1]
        rect = mujoco.MjrRect(0, 0, columns, rows)
        grey = np.empty((rows, columns, 3), dtype=np.uint8)
        self._context.make_current()
        mujoco.mjr_render(rect, self._scene, self._renderer)
        mujoco.mjr_readPixels(grey, None, rect, self._renderer)
        return grey

    def _open(self) -> None:
        if self._renderer is not None:
            return
        k, margin = self._reduction, 2 * _BLOCK_MARGIN
        width, height = -(-self._camera.width_px // k) + margin, -(-self._camera.height_px // k) + margin
        self._context, self._renderer = open_renderer(self._model, width, height, _FONT, "camera")
        self._scene = mujoco.MjvScene(self._model, self._model.ngeom + _SPARE_GEOMS)
        self._scene.flags[mujoco.mjtRndFlag.mjRND_SHADOW] = 0
        self._scene.flags[mujoco.mjtRndFlag.mjRND_REFLECTION] = 0

    def _update(self, data: mujoco.MjData, pose: tuple[Array, Array]) -> None:
        """Fill the scene and move it so that the lens is its origin; make every surface matt."""
        R_WC, p_WC = pose
        bodies = mujoco.mjtCatBit.mjCAT_STATIC.value | mujoco.mjtCatBit.mjCAT_DYNAMIC.value
        mujoco.mjv_updateScene(self._model, data, self._option, None, self._view, bodies, self._scene)
        for i in range(self._scene.ngeom):
            geom = self._scene.geoms[i]
            geom.specular = geom.reflectance = 0.0
            if geom.objtype == mujoco.mjtObj.mjOBJ_GEOM and geom.type != mujoco.mjtGeom.mjGEOM_PLANE:
                geom.pos[:] = data.geom_xpos[geom.objid] - p_WC
            else:
                geom.pos[:] -= p_WC
        for camera in self._scene.camera:
            camera.pos[:], camera.forward[:], camera.up[:] = 0.0, R_WC[:, 0], R_WC[:, 2]

    def _aim(self, first: tuple[int, int], last: tuple[int, int]) -> None:
        """Set the frustum to the outer edges of the blocks [first, last); OpenGL's x is right, its y up."""
        (c_u, c_v), f, k = self._camera.principal_point_px, self._camera.focal_length_px, self._reduction
        right = (k * np.array([first[1], last[1]]) - 0.5 - c_u) / f
        down = (k * np.array([first[0], last[0]]) - 0.5 - c_v) / f
        for camera in self._scene.camera:
            near = camera.frustum_near
            camera.orthographic = 0
            camera.frustum_center = 0.5 * near * (right[0] + right[1])
            camera.frustum_width = 0.5 * near * (right[1] - right[0])
            camera.frustum_bottom, camera.frustum_top = -near * down[1], -near * down[0]


@njit(cache=True)
def _expand(
    grey: NDArray[np.uint8],
    first: tuple[int, int],
    k: int,
    start: tuple[int, int],
    axis: tuple[float, float, float],
    scale: float,
    floor: float,
    out: NDArray[np.float32],
) -> None:
    """Interpolate the blocks to pixels and apply Eq. (1)."""
    c_u, c_v, f = axis
    top = grey.shape[0] - 1  # OpenGL's first row is the lowest
    for r in range(out.shape[0]):
        y = (r + start[0] + 0.5) / k - 0.5 - first[0]
        i = int(math.floor(y))
        low = np.float32(y - i)
        above, below = grey[top - i], grey[top - min(i + 1, top)]
        dv2 = f * f + (r + start[0] - c_v) ** 2
        for c in range(out.shape[1]):
            x = (c + start[1] + 0.5) / k - 0.5 - first[1]
            j = int(x)
            right = np.float32(x - j)
            j1 = min(j + 1, grey.shape[1] - 1)
            a = above[j, 0] + right * (np.float32(above[j1, 0]) - np.float32(above[j, 0]))
            b = below[j, 0] + right * (np.float32(below[j1, 0]) - np.float32(below[j, 0]))
            cos2 = f * f / (dv2 + (c + start[1] - c_u) ** 2)
            out[r, c] = scale * cos2 * cos2 * (a + low * (b - a)) + floor
