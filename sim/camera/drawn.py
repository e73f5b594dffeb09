"""Draws solids with MuJoCo's off-screen renderer: the background where there is OpenGL.

Only solids are drawn; the sky comes from elsewhere. Colour carries two things at once: red is the solid's grey

    red = rho (ambient + direct max(0, n . s)) / (ambient + direct),     blue = 1 where there is a solid, else 0  (1)

because the light's ambient part is (ambient, 0, 1), its direct part (direct, 0, 0), red over their sum, and a solid's
colour (rho, 0, 1).
So a solid in the dark still hides the sky.

The frustum is off-centre, on the outer edges of the blocks asked for. Every solid is a patch of one of the model's
meshes, or one of a few unit meshes (ball, tube, cube), stretched; how finely they are cut follows the solid's size in
the picture, so that an outline is off by a quarter of a block at most, up to a radius of 160 blocks. Their radius is
that of the polygon whose outline is right in the mean. Which pieces these are, `pieces` says.

The scene is shifted so that the lens is its origin, in double precision, before OpenGL's single precision sees it.
Not modelled: more than 256 grey levels, more than one sample a block (edges are steps of a block).
"""

import ctypes
import math
from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray

from dockair.kernels import njit
from dockair.rotations import Array
from dockair.sim.camera.meshes import Meshes
from dockair.sim.camera.pieces import Frustum, Table, set_pieces, set_planes
from dockair.sim.camera.solids import CAPSULE, Haze, Lighting, Solids, depth_limits_m
from dockair.sim.camera.unit_meshes import unit_meshes
from dockair.sim.off_screen import Canvas

_HALF_LEVEL = 128  # of 256: blue is 0 or 255


class DrawnSolids:
    """Draws the solids of a model with OpenGL. The context is made at the first picture.

    Args:
        model: the world's; read only.
        lighting: the light on the solids.
        blocks_per_tangent: blocks of the picture in a tangent of 1.
        most: (rows, columns) of the largest picture.

    Raises:
        DockairError: the model has a visible geom that is no solid.
    """

    name = "mujoco"

    def __init__(
        self, model: mujoco.MjModel, lighting: Lighting, blocks_per_tangent: float, most: tuple[int, int]
    ) -> None:
        self._lighting, self._most = lighting, most
        s, m = Solids.of(model), Meshes.of(model)
        self._skins = [m.one(k) for k in range(len(m.geoms))]
        self._table = Table.of(s, m)
        self._limits_m, self._scale = depth_limits_m(model), blocks_per_tangent
        self._full = max(lighting.ambient + lighting.direct, np.finfo(float).tiny)  # of a white solid facing the Sun
        self._canvas: Canvas | None = None

    def draw(
        self,
        out: NDArray[np.float32],
        data: mujoco.MjData,
        pose: tuple[Array, Array],
        x: Array,
        y: Array,
        haze: Haze,
    ) -> None:
        """Lay the solids over a picture of the sky, in place.

        Args:
            out: (rows, columns) relative radiance, one value a block.
            data: positions and attitudes up to date.
            pose: R_WC and p_WC of the camera.
            x: (columns,) tangents to the right of the axis, of the blocks' centres.
            y: (rows,) tangents below it.
            haze: the air in between.

        Raises:
            MachineError: no off-screen OpenGL here.
        """
        if len(self._table.geoms) == 0:
            return
        if self._canvas is None:
            self._open()
        half = 0.5 / self._scale
        frustum = float(x[0]) - half, float(x[-1]) + half, float(y[0]) - half, float(y[-1]) + half
        if not self._arrange(data, pose, frustum):
            return
        self._aim(pose[0], frustum)
        rows, columns = out.shape
        colours = np.empty((rows, columns, 3), dtype=np.uint8)
        depths = np.empty((rows, columns) if haze.extinction_1_m > 0.0 else (0, 0), dtype=np.float32)
        assert self._canvas is not None
        self._canvas.render(self._scene, colours, depths if depths.size else None)
        _lay_over(out, colours, self._full / 255.0, depths, x, y, haze.extinction_1_m, haze.airlight, self._limits_m)

    def close(self) -> None:
        """Free the OpenGL context."""
        if self._canvas is not None:
            self._canvas.close()
        self._canvas = None

    def _open(self) -> None:
        meshes = unit_meshes(self._skins)
        rows, columns = self._most
        self._canvas = Canvas(meshes, columns, rows, "camera")
        most = len(self._table.geoms) + 2 * int((self._table.kinds == CAPSULE).sum())
        self._scene = mujoco.MjvScene(meshes, most)
        for flag in ("SHADOW", "REFLECTION", "SKYBOX", "HAZE", "FOG"):
            self._scene.flags[getattr(mujoco.mjtRndFlag, f"mjRND_{flag}")] = 0
        nothing, upright = np.zeros(3), np.eye(3).ravel()
        self._geoms = list(self._scene.geoms[:most])
        for geom in self._geoms:
            mujoco.mjv_initGeom(geom, mujoco.mjtGeom.mjGEOM_MESH, nothing, nothing, upright, np.ones(4, np.float32))
            geom.specular = geom.reflectance = geom.emission = 0.0
        self._places, self._turns, self._colours = (
            _all(self._geoms, name, shape) for name, shape in (("pos", (3,)), ("mat", (3, 3)), ("rgba", (4,)))
        )
        self._meshes, self._changed = np.full(most, -1), np.empty(most, dtype=np.int64)
        self._cameras = list(self._scene.camera)
        for camera in self._cameras:
            camera.pos[:], camera.orthographic = 0.0, 0
            camera.frustum_near, camera.frustum_far = self._limits_m
        self._set_light()

    def _set_light(self) -> None:
        light, lighting = self._scene.lights[0], self._lighting
        self._scene.nlight = 1
        light.type, light.headlight, light.castshadow = mujoco.mjtLightType.mjLIGHT_DIRECTIONAL, 0, 0
        light.dir[:], light.attenuation[:] = -lighting.toward_W, (1.0, 0.0, 0.0)
        light.ambient[:] = lighting.ambient / self._full, 0.0, 1.0
        light.diffuse[:], light.specular[:] = (lighting.direct / self._full, 0.0, 0.0), 0.0

    def _arrange(self, data: mujoco.MjData, pose: tuple[Array, Array], frustum: Frustum) -> int:
        """Put into the scene what may be seen; return how many pieces that is."""
        poses, pieces = (data.geom_xpos, data.geom_xmat), (self._places, self._turns, self._colours)
        planes = np.empty((6, 4))
        set_planes(planes, pose[0], frustum, self._limits_m)
        count, changes = set_pieces(
            self._table, poses, pose[1], planes, self._scale, pieces, self._meshes, self._changed
        )
        for i in self._changed[:changes].tolist():
            self._geoms[i].dataid = 2 * int(self._meshes[i])  # MuJoCo counts each mesh and its convex hull
        self._scene.ngeom = count
        return count

    def _aim(self, R_WC: Array, frustum: Frustum) -> None:
        """Set the frustum; OpenGL's x is right, its y up."""
        near = self._limits_m[0]
        for camera in self._cameras:
            camera.forward[:], camera.up[:] = R_WC[:, 0], R_WC[:, 2]
            camera.frustum_center = 0.5 * near * (frustum[0] + frustum[1])
            camera.frustum_width = 0.5 * near * (frustum[1] - frustum[0])
            camera.frustum_bottom, camera.frustum_top = -near * frustum[3], -near * frustum[2]


def _all(geoms: list[Any], name: str, shape: tuple[int, ...]) -> NDArray[np.float32]:
    """One array over the same member of all geoms of a scene, which lie one after the other in memory."""
    first = getattr(geoms[0], name).ctypes.data
    step = getattr(geoms[1], name).ctypes.data - first if len(geoms) > 1 else 4 * math.prod(shape)
    if getattr(geoms[-1], name).ctypes.data != first + step * (len(geoms) - 1):
        raise RuntimeError("the geoms of a scene are not evenly spaced")
    memory: Any = (ctypes.c_char * (step * (len(geoms) - 1) + 4 * math.prod(shape))).from_address(first)
    strides = (step, *(4 * math.prod(shape[i + 1 :]) for i in range(len(shape))))
    return np.ndarray((len(geoms), *shape), dtype=np.float32, buffer=memory, strides=strides)


@njit(cache=True)
def _lay_over(
    out: NDArray[np.float32],
    colours: NDArray[np.uint8],
    level: float,
    depths: NDArray[np.float32],
    x: Array,
    y: Array,
    extinction: float,
    air: float,
    limits: tuple[float, float],
) -> None:
    """Take the solids' grey, Eq. (1), where the picture has any; with haze before them if there are depths."""
    near, far = limits
    for i in range(out.shape[0]):
        row = out.shape[0] - 1 - i  # OpenGL's first row is the lowest
        for j in range(out.shape[1]):
            if colours[row, j, 2] < _HALF_LEVEL:
                continue
            radiance = level * colours[row, j, 0]
            if depths.size > 0:
                t = near * far / (far - depths[row, j] * (far - near))
                clear = math.exp(-extinction * t * math.sqrt(1.0 + x[j] * x[j] + y[i] * y[i]))
                radiance = radiance * clear + air * (1.0 - clear)
            out[i, j] = radiance
