"""What stands before the sky: the scene's solids, the light on them and the haze before them.

    L = T rho (ambient + direct max(0, n . s)) + (1 - T) L_air,      T = exp(-b r)                               (1)

in units of a white Lambertian surface in normal sunlight: reflectance rho, unit normal n, unit vector s toward the
Sun, extinction b, slant range r. `ambient` is the mean radiance of all directions, `direct` what clouds and haze let
through of the Sun, the mean over its disc. A solid is a sphere, ellipsoid, capsule, cylinder or box, or a mesh of
triangles (`meshes`), opaque and matt; both ways of drawing it (`drawn`, `traced`) take it from here. Over the disc of a
white ball, whose surface has every direction that can be seen, the mean of the light at phase angle a between Sun and
lens is

    L = ambient + direct 2/(3 pi) (sin a + (pi - a) cos a)                                                       (2)

Not modelled: shadows, interreflections, gloss (glints are point sources of their own).
Sources: Koschmieder's law of air light, in Middleton, Vision through the Atmosphere, ch. 4; Lambert, Photometria 1760,
for (2), whose value at phase angle 0 is the geometric albedo 2/3.
"""

import math
from dataclasses import dataclass
from typing import Protocol

import mujoco
import numpy as np
from numpy.typing import NDArray

from dockair.errors import DockairError
from dockair.rotations import Array
from dockair.sim.camera.sun_beam import Beam, SunBeam

VISIBLE_GROUPS: NDArray[np.uint8] = np.array([1, 1, 1, 0, 0, 0], dtype=np.uint8)  #: MuJoCo's own default
#: Kinds of solids, as numbers for compiled code.
BALL, CAPSULE, CYLINDER, BOX = 0, 1, 2, 3
_KIND_OF = {
    mujoco.mjtGeom.mjGEOM_SPHERE: BALL,
    mujoco.mjtGeom.mjGEOM_ELLIPSOID: BALL,
    mujoco.mjtGeom.mjGEOM_CAPSULE: CAPSULE,
    mujoco.mjtGeom.mjGEOM_CYLINDER: CYLINDER,
    mujoco.mjtGeom.mjGEOM_BOX: BOX,
}


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Solids:
    """The visible geoms of a model that are no meshes, in its order."""

    geoms: NDArray[np.intp]  #: (n,) their numbers in the model
    kinds: NDArray[np.int64]  #: (n,)
    half_sizes_m: Array  #: (n, 3) half extents along their own axes; capsule: of its cylinder
    reflectances: Array  #: (n,)

    @classmethod
    def of(cls, model: mujoco.MjModel) -> "Solids":
        """Take every geom of a visible group that is not fully transparent, but for meshes.

        Raises:
            DockairError: one of them is neither sphere, ellipsoid, capsule, cylinder, box nor mesh.
        """
        visible = VISIBLE_GROUPS[model.geom_group].astype(bool) & (model.geom_rgba[:, 3] > 0.0)
        geoms = np.flatnonzero(visible & (model.geom_type != int(mujoco.mjtGeom.mjGEOM_MESH)))
        types = [mujoco.mjtGeom(model.geom_type[i]) for i in geoms]
        for i, kind in zip(geoms, types, strict=True):
            if kind not in _KIND_OF:
                name = model.geom(int(i)).name or f"number {i}"
                got = kind.name.removeprefix("mjGEOM_").lower()
                raise DockairError(
                    f"geom {name}", expected="a sphere, ellipsoid, capsule, cylinder, box or mesh", got=got
                )
        kinds = np.array([_KIND_OF[kind] for kind in types], dtype=np.int64)
        size = model.geom_size[geoms]
        spheres = np.array([kind == mujoco.mjtGeom.mjGEOM_SPHERE for kind in types], dtype=bool)
        round_about_z = (kinds == CAPSULE) | (kinds == CYLINDER)
        return cls(
            geoms=geoms,
            kinds=kinds,
            half_sizes_m=np.column_stack(
                [
                    size[:, 0],
                    np.where(spheres | round_about_z, size[:, 0], size[:, 1]),
                    np.where(spheres, size[:, 0], np.where(round_about_z, size[:, 1], size[:, 2])),
                ]
            ),
            reflectances=np.array(model.geom_rgba[geoms, 0], dtype=float),
        )


class Shines(Beam, Protocol):
    """What is asked of the sky about its light: `dockair.sim.camera.sky.Sky`."""

    @property
    def ambient(self) -> float:
        """Mean relative radiance of all directions."""
        ...


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Lighting:
    """The light on the solids, relative to sunlight on a surface that faces the Sun."""

    toward_W: Array  #: (3,) unit vector toward the Sun; anything where `direct` is 0
    ambient: float  #: from all sides alike
    direct: float  #: from the Sun

    @classmethod
    def of(cls, model: mujoco.MjModel, sky: Shines, sun_radius_rad: float) -> "Lighting":
        """Sunlight along the model's first light, if it has one, as much as the sky lets through."""
        if model.nlight == 0:
            return cls(toward_W=np.array([0.0, 0.0, 1.0]), ambient=sky.ambient, direct=0.0)
        return cls.toward(-np.array(model.light_dir[0]), sky, sun_radius_rad)

    @classmethod
    def toward(cls, sun_W: Array, sky: Shines, sun_radius_rad: float) -> "Lighting":
        """Sunlight from (3,) the unit vector toward the middle of its disc, as much as the sky lets through."""
        return cls(toward_W=sun_W, ambient=sky.ambient, direct=SunBeam.of(sky, sun_W, sun_radius_rad).mean)

    def on_ball(self, lens_W: Array) -> float:
        """Return the mean relative radiance of a white ball, Eq. (2); (3,) unit vector from it toward the lens."""
        cosine = min(max(float(self.toward_W @ lens_W), -1.0), 1.0)
        phase = math.acos(cosine)
        return self.ambient + self.direct * 2.0 / (3.0 * math.pi) * (math.sin(phase) + (math.pi - phase) * cosine)


@dataclass(frozen=True, slots=True, kw_only=True)
class Haze:
    """The air between the lens and the solids."""

    extinction_1_m: float = 0.0
    airlight: float = 0.0  #: L_air of Eq. (1)


def depth_limits_m(model: mujoco.MjModel) -> tuple[float, float]:
    """Nearest and farthest depth drawn, MuJoCo's own clipping planes."""
    extent = model.stat.extent
    return float(model.vis.map.znear * extent), float(model.vis.map.zfar * extent)
