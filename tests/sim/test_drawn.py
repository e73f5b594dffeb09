"""Solids by OpenGL: its meshes, its outlines and shades against the same solids by rays, what it leaves out."""

from typing import Any

import mujoco
import numpy as np
import pytest

from dockair.errors import MachineError
from dockair.rotations import exp
from dockair.sim import off_screen
from dockair.sim.camera.drawn import DrawnSolids
from dockair.sim.camera.meshes import Meshes
from dockair.sim.camera.pieces import Table, _reach, set_pieces, set_planes
from dockair.sim.camera.solids import BALL, BOX, CAPSULE, CYLINDER, Haze, Lighting, Solids
from dockair.sim.camera.traced import TracedSolids
from dockair.sim.camera.unit_meshes import BALLS, CUBE, ENDS, SLICES, TUBES, unit_meshes

AT_ORIGIN = (np.eye(3), np.zeros(3))
BLOCKS_PER_TANGENT = 500.0
X, Y = np.arange(-200, 201) / BLOCKS_PER_TANGENT, np.arange(-120, 121) / BLOCKS_PER_TANGENT
SKY = -1.0
GEOM = mujoco.mjtGeom
SUNLIT = Lighting(toward_W=np.array([-0.6, 0.48, 0.64]), ambient=0.25, direct=0.75)


def _scene(*geoms: dict[str, Any]) -> tuple[mujoco.MjModel, mujoco.MjData]:
    """Clipped at 0.1 m and 2 km."""
    spec = mujoco.MjSpec()
    spec.stat.extent, spec.visual.map.znear, spec.visual.map.zfar = 20.0, 0.005, 100.0
    for geom in geoms:
        spec.worldbody.add_geom(**({"rgba": [0.8, 0.8, 0.8, 1.0]} | geom))
    model = spec.compile()
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    return model, data


def _both(model: mujoco.MjModel, data: mujoco.MjData, haze: Haze | None = None) -> tuple[np.ndarray, np.ndarray]:
    """Drawn and traced."""
    pictures = []
    drawn = DrawnSolids(model, SUNLIT, BLOCKS_PER_TANGENT, (len(Y), len(X)))
    for way in (drawn, TracedSolids(model, SUNLIT)):
        pictures.append(np.full((len(Y), len(X)), SKY, dtype=np.float32))
        way.draw(pictures[-1], data, AT_ORIGIN, X, Y, haze or Haze())
        way.close()
    return pictures[0], pictures[1]


def _volume(model: mujoco.MjModel, mesh: int) -> float:
    first, count = model.mesh_vertadr[mesh], model.mesh_vertnum[mesh]
    face, faces = model.mesh_faceadr[mesh], model.mesh_facenum[mesh]
    corners = model.mesh_vert[first : first + count][model.mesh_face[face : face + faces]].astype(float)
    return float(np.einsum("fi,fi->", corners[:, 0], np.cross(corners[:, 1], corners[:, 2])) / 6.0)


@pytest.mark.parametrize("level", range(len(SLICES)))
def test_meshes_enclose_the_volume_of_their_bodies_and_face_outward(level: int) -> None:
    """Signed volume of the closed ones; a polygon's mean radius being right, it falls short by (pi/n)^2/6 or so."""
    model = unit_meshes()
    small = (np.pi / SLICES[level]) ** 2
    assert _volume(model, TUBES + level) == pytest.approx(2.0 * np.pi, rel=small)
    assert _volume(model, BALLS + level) == pytest.approx(4.0 / 3.0 * np.pi, rel=2.0 * small)
    assert _volume(model, ENDS + level) == pytest.approx(2.0 / 3.0 * np.pi, rel=2.0 * small)
    assert _volume(model, CUBE) == pytest.approx(8.0, rel=1e-6)


@pytest.mark.gl
@pytest.mark.parametrize("radius_blocks", [1.9, 3.0, 20.0, 40.0, 100.0])
@pytest.mark.parametrize("kind", [GEOM.mjGEOM_SPHERE, GEOM.mjGEOM_CAPSULE, GEOM.mjGEOM_CYLINDER])
def test_outlines_are_off_by_a_third_of_a_block_at_most_in_the_mean(kind: mujoco.mjtGeom, radius_blocks: float) -> None:
    """Blocks that only one of the two ways shows, over the outline's length; a quarter from the polygon's corners."""
    radius = 10.0 * radius_blocks / BLOCKS_PER_TANGENT
    model, data = _scene(
        {"type": kind, "pos": [10.0, 0.13, 0.07], "size": [radius, radius, 0.0], "quat": [0.9, 0.3, 0.1, 0.2]}
    )
    drawn, traced = _both(model, data)
    outline = 2.0 * np.pi * radius_blocks + (4.0 * radius_blocks if kind != GEOM.mjGEOM_SPHERE else 0.0)
    assert (traced != SKY).sum() > 5
    assert ((drawn != SKY) != (traced != SKY)).sum() < outline / 3.0 + 2.0


@pytest.mark.gl
@pytest.mark.parametrize(
    ("kind", "size", "most"),
    [
        (GEOM.mjGEOM_SPHERE, [1.2, 0.0, 0.0], 0.97),
        (GEOM.mjGEOM_ELLIPSOID, [1.5, 0.4, 0.9], 0.9),
        (GEOM.mjGEOM_CAPSULE, [0.7, 0.9, 0.0], 0.97),
        (GEOM.mjGEOM_CYLINDER, [0.7, 0.9, 0.0], 0.97),
        (GEOM.mjGEOM_BOX, [0.7, 0.3, 1.1], 1.0),
    ],
)
@pytest.mark.parametrize("turn", [(0.0, 0.0, 0.0), (0.5, -0.9, 0.4), (2.0, 1.0, -2.0)])
def test_most_shades_are_within_two_grey_levels_of_the_closed_form(
    kind: mujoco.mjtGeom, size: list[float], most: float, turn: tuple[float, float, float]
) -> None:
    """Share of the blocks inside the outline; OpenGL shades corners and interpolates, and has 256 levels.

    The rest lie where the Sun's light ends, and on the ridge of a flat ellipsoid.
    """
    quat = np.zeros(4)
    mujoco.mju_mat2Quat(quat, exp(np.array(turn)).ravel())
    drawn, traced = _both(*_scene({"type": kind, "pos": [8.0, 0.2, -0.1], "size": size, "quat": quat}))
    inside = (drawn != SKY) & (traced != SKY)
    assert inside.sum() > 2000
    error = 255.0 * np.abs(drawn - traced)[inside]
    assert (error < 2.0).mean() >= most
    assert error.mean() < 1.0


@pytest.mark.gl
def test_ranges_for_the_haze_come_from_the_depth_buffer() -> None:
    """Black balls at 2, 20 and 200 m in bright haze: what is seen is haze, 1 - exp(-b r)."""
    geoms = [
        {"type": GEOM.mjGEOM_SPHERE, "pos": [d, side * d, 0.1 * d], "size": [0.05 * d, 0, 0], "rgba": [0, 0, 0, 1]}
        for d, side in ((2.0, 0.2), (20.0, 0.0), (200.0, -0.2))
    ]
    drawn, traced = _both(*_scene(*geoms), Haze(extinction_1_m=0.02, airlight=1.0))
    inside = (drawn != SKY) & (traced != SKY)
    assert np.abs(drawn - traced)[inside].max() < 2e-3
    assert np.ptp(traced[inside]) > 0.9


@pytest.mark.gl
def test_what_stands_outside_the_frustum_is_left_out_and_what_reaches_in_is_not() -> None:
    """Two hundred balls in the picture, beside it and behind the lens, against all of them by rays."""
    rng = np.random.default_rng(2)
    places = np.array([1.0, 1.2, 1.2]) * rng.uniform([-10.0, -5.0, -3.0], [12.0, 5.0, 3.0], (200, 3))
    model, data = _scene(*({"type": GEOM.mjGEOM_SPHERE, "pos": p, "size": [0.2, 0.0, 0.0]} for p in places))
    drawn = DrawnSolids(model, SUNLIT, BLOCKS_PER_TANGENT, (len(Y), len(X)))
    out = np.full((len(Y), len(X)), SKY, dtype=np.float32)
    drawn.draw(out, data, AT_ORIGIN, X, Y, Haze())
    traced = np.full_like(out, SKY)
    TracedSolids(model, SUNLIT).draw(traced, data, AT_ORIGIN, X, Y, Haze())
    count = drawn._scene.ngeom
    drawn.close()
    assert ((out != SKY) != (traced != SKY)).mean() < 0.005
    assert 10 < count < 60


@pytest.mark.gl
@pytest.mark.parametrize("edge", [(X[-1], 0.0), (X[0], 0.0), (0.0, Y[-1]), (0.0, Y[0])])
def test_a_ball_beside_the_picture_is_drawn_as_long_as_a_part_of_it_is_inside(edge: tuple[float, float]) -> None:
    """Its centre 0.4 radii beyond the edge, then 1.5; ten metres away, 0.5 m in radius."""
    drawn = DrawnSolids(_beside(edge, 0.4)[0], SUNLIT, BLOCKS_PER_TANGENT, (len(Y), len(X)))
    counts, shown = [], []
    for radii in (0.4, 1.5):
        _, data = _beside(edge, radii)
        out = np.full((len(Y), len(X)), SKY, dtype=np.float32)
        drawn.draw(out, data, AT_ORIGIN, X, Y, Haze())
        counts.append(drawn._scene.ngeom)
        shown.append((out != SKY).sum())
    drawn.close()
    assert counts == [1, 0]
    assert shown[0] > 300 and shown[1] == 0


def _beside(edge: tuple[float, float], radii: float) -> tuple[mujoco.MjModel, mujoco.MjData]:
    x, y = (10.0 * e + radii * 0.5 * np.sign(e) for e in edge)
    return _scene({"type": GEOM.mjGEOM_SPHERE, "pos": [10.0, -x, -y], "size": [0.5, 0.0, 0.0]})


@pytest.mark.parametrize("kind", [BALL, CAPSULE, CYLINDER, BOX])
def test_a_solid_reaches_as_far_along_a_direction_as_its_farthest_point(kind: int) -> None:
    """Of its rim and corners: 40 000 points on a ball put onto each solid's surface, the farthest within 1 %."""
    rng = np.random.default_rng(kind)
    h, M = np.array([0.7, 0.7 if kind in (CAPSULE, CYLINDER) else 0.3, 1.1]), exp(rng.normal(0.0, 1.0, 3))
    n = rng.normal(0.0, 1.0, (40000, 3))
    n /= np.linalg.norm(n, axis=1, keepdims=True)
    round_z = n[:, :2] / np.linalg.norm(n[:, :2], axis=1, keepdims=True)
    points = {
        BALL: h * n,
        BOX: h * np.sign(n),
        CAPSULE: h[0] * n + np.outer(np.sign(n[:, 2]), [0.0, 0.0, h[2]]),
        CYLINDER: np.column_stack([h[0] * round_z, h[2] * np.sign(n[:, 2])]),
    }[kind]
    for direction in rng.normal(0.0, 1.0, (20, 3)):
        farthest = (points @ M.T @ direction).max()
        reach = _reach(kind, h, M, np.array([*direction, 0.0]))
        assert farthest <= reach * (1.0 + 1e-12)
        assert farthest == pytest.approx(reach, rel=0.01)


def _pieces(**geom: Any) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Numbers of the meshes (n,) of a geom ten metres ahead, their places (n, 3) and their axes (n, 3, 3)."""
    model, data = _scene({"pos": [10.0, 0.0, 0.0], **geom})
    table, planes = Table.of(Solids.of(model), Meshes.of(model)), np.empty((6, 4))
    set_planes(planes, np.eye(3), (X[0], X[-1], Y[0], Y[-1]), (0.1, 2000.0))
    pieces = tuple(np.empty((3, *shape), dtype=np.float32) for shape in ((3,), (3, 3), (4,)))
    meshes, changed = np.full(3, -1), np.empty(3, dtype=np.int64)
    poses = data.geom_xpos, data.geom_xmat
    count, _ = set_pieces(table, poses, np.zeros(3), planes, BLOCKS_PER_TANGENT, pieces, meshes, changed)
    return meshes[:count], pieces[0][:count], pieces[1][:count]


@pytest.mark.parametrize("kind", [GEOM.mjGEOM_SPHERE, GEOM.mjGEOM_CYLINDER])
@pytest.mark.parametrize("radius_m", [0.001, 0.03, 0.2, 0.47, 0.51, 2.3])
def test_polygons_are_off_the_circle_by_a_quarter_of_a_block_where_a_solid_is_nearest(
    kind: mujoco.mjtGeom, radius_m: float
) -> None:
    """2/(1 + cos(pi/n)) - 1 of the radius there, up to 150 blocks; and what is eight times as small is cut coarser."""
    (mesh,), _, _ = _pieces(type=kind, size=[radius_m, 0.5, 0.0])
    blocks = BLOCKS_PER_TANGENT * radius_m / (10.0 - radius_m)
    level = mesh - (BALLS if kind == GEOM.mjGEOM_SPHERE else TUBES)
    off = [blocks * (2.0 / (1.0 + np.cos(np.pi / n)) - 1.0) for n in SLICES]
    assert off[level] < 0.252
    assert level == 0 or off[level - 1] > 0.08


def test_a_thin_capsule_is_a_tube_of_the_same_area_and_one_from_six_blocks_on_has_round_ends() -> None:
    """Upright; the nearest part of it counts. The ends' tips are the capsule's, and no piece is inside out."""
    for blocks, count in ((5.95, 1), (6.05, 3)):
        radius, half = 10.0 * blocks / (BLOCKS_PER_TANGENT + blocks), 0.7
        meshes, places, axes = _pieces(type=GEOM.mjGEOM_CAPSULE, size=[radius, half, 0.0])
        assert len(meshes) == count and (np.linalg.det(axes) > 0.0).all()
        tips = places[:, 2] + axes[:, 2, 2]
        if count == 1:
            assert 4.0 * radius * tips[0] == pytest.approx(4.0 * radius * half + np.pi * radius**2, rel=1e-6)
        else:
            assert tips == pytest.approx([half, half + radius, -half - radius], rel=1e-6)
            assert list(meshes) == [TUBES + 1, ENDS + 1, ENDS + 1]


@pytest.mark.gl
def test_what_lies_beyond_the_far_plane_is_left_out() -> None:
    """At 2 km here."""
    drawn = DrawnSolids(_far_ball(1900.0)[0], SUNLIT, BLOCKS_PER_TANGENT, (len(Y), len(X)))
    shown = []
    for x in (1900.0, 2100.0):
        out = np.full((len(Y), len(X)), SKY, dtype=np.float32)
        drawn.draw(out, _far_ball(x)[1], AT_ORIGIN, X, Y, Haze())
        shown.append(((out != SKY).sum() > 100, drawn._scene.ngeom))
    drawn.close()
    assert shown == [(True, 1), (False, 0)]


def _far_ball(x: float) -> tuple[mujoco.MjModel, mujoco.MjData]:
    return _scene({"type": GEOM.mjGEOM_SPHERE, "pos": [x, 0.0, 0.0], "size": [90.0, 0.0, 0.0]})


@pytest.mark.gl
def test_a_solid_the_lens_stands_in_is_not_seen() -> None:
    drawn, _ = _both(*_scene({"type": GEOM.mjGEOM_ELLIPSOID, "pos": [1.0, 0.0, 0.0], "size": [4.0, 2.0, 2.0]}))
    assert np.all(drawn == SKY)


def test_a_machine_without_opengl_is_told_when_the_first_picture_is_asked_for(monkeypatch: pytest.MonkeyPatch) -> None:
    def no_context(width: int, height: int) -> None:
        raise ImportError("libEGL.so.1: cannot open shared object file")

    model, data = _scene({"type": GEOM.mjGEOM_SPHERE, "pos": [5.0, 0.0, 0.0], "size": [0.3, 0.0, 0.0]})
    drawn = DrawnSolids(model, SUNLIT, BLOCKS_PER_TANGENT, (len(Y), len(X)))
    monkeypatch.setattr(off_screen, "gl_context", no_context)
    with pytest.raises(MachineError, match="libegl1"):
        drawn.draw(np.zeros((len(Y), len(X)), dtype=np.float32), data, AT_ORIGIN, X, Y, Haze())
    drawn.close()


@pytest.mark.gl
def test_a_picture_does_not_depend_on_the_one_before() -> None:
    """Pieces change their meshes with the range, their number with the window; the second picture is as if alone."""
    model, data = _scene(
        {"type": GEOM.mjGEOM_BOX, "pos": [30.0, 2.0, 0.0], "size": [0.5, 0.5, 0.5]},
        {"type": GEOM.mjGEOM_CAPSULE, "pos": [5.0, 0.0, 0.0], "size": [0.2, 0.5, 0.0], "quat": [0.9, 0.3, 0.1, 0.2]},
        {"type": GEOM.mjGEOM_SPHERE, "pos": [7.0, -1.0, 0.5], "size": [0.4, 0.0, 0.0]},
    )

    def picture(way: DrawnSolids, lens_m: float, columns: slice) -> np.ndarray:
        out = np.full((len(Y), len(X[columns])), SKY, dtype=np.float32)
        way.draw(out, data, (np.eye(3), np.array([lens_m, 0.0, 0.0])), X[columns], Y, Haze())
        return out

    views = [(-40.0, slice(None)), (3.5, slice(None)), (3.5, slice(150, 260)), (-40.0, slice(150, 260))]
    used = DrawnSolids(model, SUNLIT, BLOCKS_PER_TANGENT, (len(Y), len(X)))
    for view in [*views, *reversed(views)]:
        fresh = DrawnSolids(model, SUNLIT, BLOCKS_PER_TANGENT, (len(Y), len(X)))
        expected = picture(fresh, *view)
        fresh.close()
        assert (expected != SKY).any() and np.array_equal(picture(used, *view), expected)
    used.close()
