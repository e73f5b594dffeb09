"""The scene as mirrors: which of its geoms reflect like what, prepared once a model.

    balls     spheres and ellipsoids, and the round ends of capsules                       doubly curved
    tubes     the sides of cylinders and capsules                                          curved once
    facets    the faces of boxes, the flat ends of cylinders, flat ellipsoids in tiles,
              the triangles of meshes                                                      (nearly) flat
    rim       the basket's rim, which the scene draws as straight capsules, as one torus

An ellipsoid with half-axes a >= b >= c is flat when its middle is so little curved that a rough surface's slopes reach
as far as the body does; then no single point stands for the glint of its two sides, and they are cut into tiles. Its
edge remains a ball. How all these are cut, `tiles` says.

A material follows from the geom's name. Not modelled: planes, height fields.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import NamedTuple

import mujoco
import numpy as np
from numpy.typing import NDArray

from dockair.rotations import Array
from dockair.sim.camera.meshes import mesh_of
from dockair.sim.camera.sheets import SurfaceParameters
from dockair.sim.camera.solids import VISIBLE_GROUPS
from dockair.sim.camera.tiles import EDGE_COS, Tile, ellipsoid_tiles, face, is_flat, mesh_tiles
from dockair.triples import Vector

PAINT, METAL, RUBBER, GLASS = range(4)
RIM_GEOMS = "basket_rim"  #: how the names of the rim's pieces begin
_MATERIALS = {"basket_": METAL, "coupling_": METAL, "probe_": METAL, "hose_": RUBBER, "led_housing_": RUBBER}
_GLASS_GEOM = "skin_canopy"  # the receiver's; the drogue's are canopy_0, canopy_1, ...
_NEAR_LEDS = ("basket_rib", "coupling_", "probe_")  # what the LEDs shine on from nearby
_SKIN_M = 1e-3  # a ray that starts on a surface starts this far off it

_G = mujoco.mjtGeom


class Balls(NamedTuple):
    """Ellipsoids about a point on their geom's z axis."""

    geom: NDArray[np.int64]  #: (n,)
    material: NDArray[np.int64]  #: (n,)
    axes: Array  #: (n, 3) half-axes [m]
    at_z: Array  #: (n,) [m]
    side: Array  #: (n,) 0 for the whole ball; 1 or -1 for the half toward z or -z
    thin: NDArray[np.int64]  #: (n,) the shortest axis
    most_cos: Array  #: (n,) no glint where the normal is nearer than this to the thin axis; 2 for none such


class Tubes(NamedTuple):
    """Round sides about their geom's z axis."""

    geom: NDArray[np.int64]  #: (n,)
    material: NDArray[np.int64]  #: (n,)
    radius: Array  #: (n,) [m]
    half_length: Array  #: (n,) [m]


class Facets(NamedTuple):
    """Small rectangles, flat or slightly curved, in their geom's axes."""

    geom: NDArray[np.int64]  #: (n,)
    material: NDArray[np.int64]  #: (n,)
    frame: Array  #: (n, 4, 3) centre [m], normal, and the two tangents along the sides
    half: Array  #: (n, 2) half sides [m]
    curvature: Array  #: (n, 3) 11, 12, 22 of the second fundamental form, positive for convex [1/m]
    bend: Array  #: (n,) how much the slope may differ from the middle's
    planes: Array  #: (4, n) normal n, and n . centre [m]: a point p of the geom's axes is before it where n . p is more
    runs: NDArray[np.int64]  #: (m, 3) geom, its first facet, one past its last


@dataclass(frozen=True, slots=True, kw_only=True)
class Rim:
    """The basket's rim as a torus about its body's x axis."""

    body: int
    geom: int  #: the first of the pieces that are drawn
    centre_x_m: float
    radius_m: float
    tube_radius_m: float
    skin_m: float  #: how far the straight pieces that are drawn stick out of the torus, and a ray's skin

    @property
    def labels(self) -> Vector:
        """Material, skin and geom, as `curved_mirrors` takes them."""
        return float(METAL), self.skin_m, float(self.geom)

    def torus_W(self, data: mujoco.MjData) -> tuple[Vector, Vector, float, float]:
        """Centre, axis and the two radii in W, as `curved_mirrors` takes them."""
        axis, (x, y, z), ahead = vector(data.xmat[self.body, ::3]), vector(data.xpos[self.body]), self.centre_x_m
        centre = (x + ahead * axis[0], y + ahead * axis[1], z + ahead * axis[2])
        return centre, axis, self.radius_m, self.tube_radius_m


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Mirrors:
    """Everything in a model that can mirror a light."""

    balls: Balls
    tubes: Tubes
    facets: Facets
    rim: Rim | None
    any_ellipsoids: bool  #: whether any of the balls are no spheres
    all_wanted: NDArray[np.bool_]  #: (1, balls + tubes) True, for `round_spots`
    near_balls: Balls  #: those that the LEDs shine on from nearby
    near_tubes: Tubes

    @classmethod
    def of(cls, model: mujoco.MjModel) -> "Mirrors":
        """Collect what is drawn."""
        rim = rim_of(model)
        balls, tubes, facets = [], [], []
        for i in range(model.ngeom):
            name = model.geom(i).name
            drawn = VISIBLE_GROUPS[model.geom_group[i]] and model.geom_rgba[i, 3] > 0.0
            if not drawn or (rim is not None and name.startswith(RIM_GEOMS)):
                continue
            material = material_of(name)
            balls += [(i, material, *ball) for ball in _balls(model, i)]
            tubes += [(i, material, *tube) for tube in _tubes(model, i)]
            facets += [(i, material, *facet) for facet in _facets(model, i)]
        near = [model.geom(i).name.startswith(_NEAR_LEDS) for i in range(model.ngeom)]
        table = _ball_table(balls)
        return cls(
            balls=table,
            tubes=_tube_table(tubes),
            facets=_facet_table(facets),
            rim=rim,
            any_ellipsoids=bool(np.any(np.ptp(table.axes, axis=1))),
            all_wanted=np.ones((1, len(balls) + len(tubes)), dtype=np.bool_),
            near_balls=_ball_table([ball for ball in balls if near[ball[0]]]),
            near_tubes=_tube_table([tube for tube in tubes if near[tube[0]]]),
        )


def material_of(geom: str) -> int:
    """What a geom of this name is made of."""
    if geom == _GLASS_GEOM:
        return GLASS
    return next((material for prefix, material in _MATERIALS.items() if geom.startswith(prefix)), PAINT)


@lru_cache(maxsize=16)
def finishes(surfaces: SurfaceParameters) -> Array:
    """(4, 4) a row a material: refractive index (0 for metal), normal reflectance of metal, share, rms slope."""
    p, n = surfaces, surfaces.refractive_index
    table = np.array(
        [
            [n, 0.0, p.paint_share, p.paint_roughness_rad],
            [0.0, p.metal_reflectance, p.metal_share, p.metal_roughness_rad],
            [n, 0.0, p.rubber_share, p.rubber_roughness_rad],
            [n, 0.0, p.glass_share, p.glass_roughness_rad],
        ]
    )
    table.setflags(write=False)
    return table


def vector(a: Array) -> Vector:
    """Three numbers as the kernels take them."""
    x, y, z = a.tolist()
    return float(x), float(y), float(z)


def rim_of(model: mujoco.MjModel) -> Rim | None:
    """Return the torus through the capsules that draw the rim; None where the scene has none."""
    pieces = [i for i in range(model.ngeom) if model.geom(i).name.startswith(RIM_GEOMS)]
    if not pieces:
        return None
    middle = model.geom_pos[pieces]
    chord = np.hypot(middle[:, 1], middle[:, 2])
    radius = float(np.hypot(chord, model.geom_size[pieces, 1]).mean())
    return Rim(
        body=int(model.geom_bodyid[pieces[0]]),
        geom=pieces[0],
        centre_x_m=float(middle[:, 0].mean()),
        radius_m=radius,
        tube_radius_m=float(model.geom_size[pieces, 0].mean()),
        skin_m=radius - float(chord.min()) + _SKIN_M,
    )


def _balls(model: mujoco.MjModel, i: int) -> list[tuple[Array, float, float]]:
    """Half-axes, place on z and side of what is doubly curved in geom i."""
    kind, size = model.geom_type[i], np.array(model.geom_size[i])
    if kind == _G.mjGEOM_SPHERE:
        return [(np.full(3, size[0]), 0.0, 0.0)]
    if kind == _G.mjGEOM_ELLIPSOID:
        return [(size, 0.0, 0.0)]
    if kind == _G.mjGEOM_CAPSULE:
        return [(np.full(3, size[0]), side * size[1], side) for side in (1.0, -1.0)]
    return []


def _tubes(model: mujoco.MjModel, i: int) -> list[tuple[float, float]]:
    if int(model.geom_type[i]) in (int(_G.mjGEOM_CAPSULE), int(_G.mjGEOM_CYLINDER)):
        return [(float(model.geom_size[i, 0]), float(model.geom_size[i, 1]))]
    return []


def _facets(model: mujoco.MjModel, i: int) -> Sequence[Tile]:
    """Frame, half sides and curvature of each tile of geom i."""
    kind, size = model.geom_type[i], np.array(model.geom_size[i])
    if kind == _G.mjGEOM_BOX:
        return [tile for axis in range(3) for side in (1.0, -1.0) for tile in face(size, axis, side)]
    if kind == _G.mjGEOM_CYLINDER:  # a disc as the square of its area
        half = 0.5 * np.sqrt(np.pi) * size[0]
        box = np.array([half, half, size[1]])
        return [tile for side in (1.0, -1.0) for tile in face(box, 2, side)]
    if kind == _G.mjGEOM_ELLIPSOID and is_flat(size):
        return ellipsoid_tiles(size)
    if kind == _G.mjGEOM_MESH:
        return mesh_tiles(mesh_of(model, int(model.geom_dataid[i])))
    return []


def _ball_table(rows: list[tuple[int, int, Array, float, float]]) -> Balls:
    geom, material, axes, at_z, side = zip(*rows, strict=True) if rows else ((),) * 5
    table = np.reshape(axes, (-1, 3)).astype(float)
    thin = [int(np.argmin(a)) for a in table]
    most_cos = [EDGE_COS if is_flat(a) else 2.0 for a in table]
    return Balls(_index(geom), _index(material), table, _real(at_z), _real(side), _index(thin), _real(most_cos))


def _tube_table(rows: list[tuple[int, int, float, float]]) -> Tubes:
    geom, material, radius, half_length = zip(*rows, strict=True) if rows else ((),) * 4
    return Tubes(_index(geom), _index(material), _real(radius), _real(half_length))


def _facet_table(rows: list[tuple[int, int, Array, tuple[float, float], Vector]]) -> Facets:
    geom, material, frame, half, curvature = zip(*rows, strict=True) if rows else ((),) * 5
    sides = np.reshape(half, (-1, 2)).astype(float)
    C = np.reshape(curvature, (-1, 3)).astype(float)
    bend = np.abs(C[:, [0, 1, 1, 2]]).sum(axis=1) * sides.sum(axis=1)
    frames, geoms = np.reshape(frame, (-1, 4, 3)).astype(float), _index(geom)
    planes = np.vstack([frames[:, 1].T, np.sum(frames[:, 0] * frames[:, 1], axis=1)])
    first = np.flatnonzero(np.diff(geoms, prepend=-1))
    runs = np.column_stack([geoms[first], first, np.append(first[1:], len(geoms))]) if len(geoms) else np.empty((0, 3))
    return Facets(geoms, _index(material), frames, sides, C, bend, planes, runs.astype(np.int64))


def _index(values: object) -> NDArray[np.int64]:
    return np.array(values, dtype=np.int64)


def _real(values: object) -> Array:
    return np.array(values, dtype=float)
