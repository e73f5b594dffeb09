"""Draws solids with MuJoCo's off-screen renderer: the background where there is OpenGL.

Only solids are drawn; the sky comes from elsewhere. Colour carries two things at once: red is the solid's grey

    red = rho (ambient + direct max(0, n . s)) / (ambient + direct),     blue = 1 where there is a solid, else 0  (1)

because the light's ambient part is (ambient, 0, 1), its direct part (direct, 0, 0), red over their sum, and a solid's
colour (rho, 0, 1).
So a solid in the dark still hides the sky.

The frustum is off-centre, on the outer edges of the blocks asked for. Every solid is a patch of one of the model's
meshes, or one of a few unit meshes (ball, tube, cube), stretched; how finely they are cut follows the solid's size in
the picture, so that an outline is off by a quarter of a block at most, up to a radius of 160 blocks. Their radius is
that of the polygon whose outline is right in the mean. What lies outside the frustum is left out.

The scene is shifted so that the lens is its origin, in double precision, before OpenGL's single precision sees it.
Not modelled: more than 256 grey levels, more than one sample a block (edges are steps of a block). Capsules up to
twelve blocks thick have flat ends of the round ones' area.
"""

import ctypes
import math
from typing import Any

import mujoco
import numpy as np
from numba import njit
from numpy.typing import NDArray

from dockair.rotations import Array
from dockair.sim.camera.meshes import Meshes
from dockair.sim.camera.solids import BALL, BOX, CAPSULE, Haze, Lighting, Solids, depth_limits_m
from dockair.sim.camera.unit_meshes import BALLS, CUBE, ENDS, LEVELS, OTHERS, TUBES, unit_meshes
from dockair.sim.off_screen import Canvas

_ROUND_END_BLOCKS = 6.0  # radius from which a capsule gets its round ends
_FLAT_END = 0.25 * math.pi  # length of a flat end that covers the area of a round one, in radii
_NEAR = 4  # which of the frustum's planes
_HALF_LEVEL = 128  # of 256: blue is 0 or 255
_MESH = OTHERS  # this kind and those after it: the model's meshes, one after the other


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
        self._geoms_drawn = np.concatenate([s.geoms, m.geoms])
        self._middles_m = np.vstack([np.zeros((len(s.geoms), 3)), m.centres_m])
        around = np.column_stack([m.radii_m, np.ones((len(m.geoms), 2))])
        kinds, half_sizes_m = np.append(s.kinds, _MESH + np.arange(len(m.geoms))), np.vstack([s.half_sizes_m, around])
        self._table = kinds, half_sizes_m, np.append(s.reflectances, m.reflectances)
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
        R_WC, p_WC = pose
        if len(self._geoms_drawn) == 0:
            return
        if self._canvas is None:
            self._open()
        half = 0.5 / self._scale
        frustum = np.array([x[0] - half, x[-1] + half, y[0] - half, y[-1] + half])
        if not self._arrange(data, R_WC, p_WC, frustum):
            return
        self._aim(R_WC, frustum)
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
        most = len(self._geoms_drawn) + 2 * int((self._table[0] == CAPSULE).sum())
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
        self._meshes = np.full(most, -1)
        self._set_light()

    def _set_light(self) -> None:
        light, lighting = self._scene.lights[0], self._lighting
        self._scene.nlight = 1
        light.type, light.headlight, light.castshadow = mujoco.mjtLightType.mjLIGHT_DIRECTIONAL, 0, 0
        light.dir[:], light.attenuation[:] = -lighting.toward_W, (1.0, 0.0, 0.0)
        light.ambient[:] = lighting.ambient / self._full, 0.0, 1.0
        light.diffuse[:], light.specular[:] = (lighting.direct / self._full, 0.0, 0.0), 0.0

    def _arrange(self, data: mujoco.MjData, R_WC: Array, p_WC: Array, frustum: Array) -> int:
        """Put into the scene what may be seen; return how many pieces that is."""
        geoms = self._geoms_drawn
        axes = data.geom_xmat[geoms].reshape(-1, 3, 3)
        centres = data.geom_xpos[geoms] - p_WC + np.einsum("nij,nj->ni", axes, self._middles_m)
        near, far = self._limits_m
        left, right, top, bottom = frustum
        outward_C = [[left, 1, 0], [-right, -1, 0], [top, 0, 1], [-bottom, 0, -1], [-1, 0, 0], [1, 0, 0]]
        planes = np.zeros((6, 4))
        planes[:, :3], planes[4, 3], planes[5, 3] = outward_C @ R_WC.T, -near, far
        meshes = np.empty_like(self._meshes)
        pieces = meshes, self._places, self._turns, self._colours
        count = _pieces(self._table, centres, axes, planes, self._scale, pieces)
        for i in np.flatnonzero(meshes[:count] != self._meshes[:count]):
            self._geoms[i].dataid = 2 * int(meshes[i])  # MuJoCo counts each mesh and its convex hull
        self._meshes[:count] = meshes[:count]
        self._scene.ngeom = count
        return count

    def _aim(self, R_WC: Array, frustum: Array) -> None:
        """Set the frustum; OpenGL's x is right, its y up."""
        near, far = self._limits_m
        for camera in self._scene.camera:
            camera.pos[:], camera.forward[:], camera.up[:] = 0.0, R_WC[:, 0], R_WC[:, 2]
            camera.orthographic, camera.frustum_near, camera.frustum_far = 0, near, far
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
def _pieces(
    solids: tuple[NDArray[np.int64], Array, Array],
    centres: Array,
    axes: Array,
    planes: Array,
    scale: float,
    pieces: tuple[NDArray[np.int64], NDArray[np.float32], NDArray[np.float32], NDArray[np.float32]],
) -> int:
    """Fill (mesh, place, turn, colour) of the pieces of what may be in the frustum; return how many.

    A mesh's kind is its number, its first half size the radius of a ball around it.
    Planes are (outward normal, offset), the last two being the near and the far one.
    """
    kinds, half_sizes, reflectances = solids
    meshes, places, turns, colours = pieces
    count = 0
    for g in range(kinds.shape[0]):
        kind, h, M = kinds[g], half_sizes[g], axes[g]
        if _is_outside(kind, h, M, centres[g], planes):
            continue
        depth = -_along(planes[_NEAR], centres[g]) - _reach(kind, h, M, planes[_NEAR])
        radius = scale * (max(h[0], h[1], h[2]) if kind == BALL else h[0]) / max(depth, -planes[_NEAR, 3])
        level = 0
        while level < LEVELS.shape[0] - 1 and radius > LEVELS[level]:
            level += 1
        ends = 3 if kind == CAPSULE and radius >= _ROUND_END_BLOCKS else 1
        for part in range(ends):
            side = 1.0 if part < 2 else -1.0  # of a capsule's end; the lower one is the upper one turned about x
            offset = 0.0 if part == 0 else side * h[2]
            length = h[2] + _FLAT_END * h[0] if kind == CAPSULE and ends == 1 else h[2]
            size = (h[0], h[1], length) if part == 0 else (h[0], side * h[0], side * h[0])
            if kind >= _MESH:
                meshes[count], size = kind, (1.0, 1.0, 1.0)
            elif kind == BOX:
                meshes[count] = CUBE
            elif part > 0:
                meshes[count] = ENDS + level
            else:
                meshes[count] = (BALLS if kind == BALL else TUBES) + level
            for k in range(3):
                places[count, k] = centres[g, k] + offset * M[k, 2]
                for axis in range(3):
                    turns[count, k, axis] = M[k, axis] * size[axis]
            colours[count, 0], colours[count, 1], colours[count, 2], colours[count, 3] = reflectances[g], 0.0, 1.0, 1.0
            count += 1
    return count


@njit(cache=True)
def _is_outside(kind: int, h: Array, M: Array, centre: Array, planes: Array) -> bool:
    """Whether a solid lies wholly beyond one of the planes."""
    for k in range(planes.shape[0]):
        if _along(planes[k], centre) - planes[k, 3] > _reach(kind, h, M, planes[k]):
            return True
    return False


@njit(cache=True)
def _along(plane: Array, p: Array) -> float:
    return plane[0] * p[0] + plane[1] * p[1] + plane[2] * p[2]


@njit(cache=True)
def _reach(kind: int, h: Array, M: Array, plane: Array) -> float:
    """How far a solid reaches from its centre along a plane's normal, in units of the normal's length."""
    if kind >= _MESH:
        return h[0] * math.sqrt(plane[0] ** 2 + plane[1] ** 2 + plane[2] ** 2)
    x = abs(M[0, 0] * plane[0] + M[1, 0] * plane[1] + M[2, 0] * plane[2])
    y = abs(M[0, 1] * plane[0] + M[1, 1] * plane[1] + M[2, 1] * plane[2])
    z = abs(M[0, 2] * plane[0] + M[1, 2] * plane[1] + M[2, 2] * plane[2])
    if kind == BALL:
        return math.sqrt((h[0] * x) ** 2 + (h[1] * y) ** 2 + (h[2] * z) ** 2)
    if kind == BOX:
        return h[0] * x + h[1] * y + h[2] * z
    if kind == CAPSULE:
        return h[2] * z + h[0] * math.sqrt(x * x + y * y + z * z)
    return h[2] * z + h[0] * math.sqrt(x * x + y * y)


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
