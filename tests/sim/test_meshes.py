"""Triangle meshes in the camera: by rays and by OpenGL alike, and as MuJoCo's own rays meet them."""

from collections.abc import Iterator
from typing import Any

import mujoco
import numpy as np
import pytest

from dockair.calibration import Mounting
from dockair.parameters import load_parameters
from dockair.rotations import exp, quaternion_from_matrix
from dockair.sim.camera.drawn import DrawnSolids
from dockair.sim.camera.mesh_view import _is_beside
from dockair.sim.camera.meshes import Meshes, mesh_of
from dockair.sim.camera.mirrors import Mirrors
from dockair.sim.camera.obstacles import Obstacles
from dockair.sim.camera.occlusion import first_hits, rays_are_clear
from dockair.sim.camera.solids import VISIBLE_GROUPS, Haze, Lighting
from dockair.sim.camera.tiles import mesh_tiles, triangle_tile
from dockair.sim.camera.traced import TracedSolids
from dockair.sim.lofts import body
from dockair.sim.outlines import TankerParameters
from dockair.sim.skins import Skin, receiver_skins, tanker_skins

BLOCKS_PER_TANGENT = 500.0
X, Y = np.arange(-200, 201) / BLOCKS_PER_TANGENT, np.arange(-120, 121) / BLOCKS_PER_TANGENT
SKY = -1.0
SUN = np.array([-0.6, 0.48, 0.64])
SUNLIT = Lighting(toward_W=SUN, ambient=0.25, direct=0.75)
MOUNTING = Mounting(R_BC=np.eye(3), p_BC=np.array([3.3, -0.45, 0.75]), p_BP=np.array([6.0, -0.9, 0.6]))
SKINS = {
    "tanker": tanker_skins(load_parameters("tanker", TankerParameters)),
    "fighter": receiver_skins(MOUNTING),
    "unmanned": receiver_skins(MOUNTING, "unmanned"),
}
FAR = {"tanker": 60.0, "fighter": 18.0, "unmanned": 25.0}

World = tuple[mujoco.MjModel, mujoco.MjData]


def _world(skins: list[Skin], **more: Any) -> World:
    spec = mujoco.MjSpec()
    spec.stat.extent, spec.visual.map.znear, spec.visual.map.zfar = 20.0, 0.005, 100.0
    for skin in skins:
        mesh = spec.add_mesh(name=skin.name, inertia=mujoco.mjtMeshInertia.mjMESH_INERTIA_SHELL)
        mesh.uservert = skin.mesh.vertices_m.ravel().tolist()
        mesh.userface = mesh.userfacenormal = skin.mesh.triangles.ravel().tolist()
        mesh.usernormal = skin.mesh.normals.ravel().tolist()
        grey = {"rgba": [0.5 * skin.shade] * 3 + [1.0]}
        geom = mujoco.mjtGeom.mjGEOM_MESH
        spec.worldbody.add_geom(name=skin.name, type=geom, meshname=skin.name, **(grey | more))
    model = spec.compile()
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    return model, data


@pytest.fixture(scope="module", params=SKINS)
def world(request: pytest.FixtureRequest) -> Iterator[tuple[str, mujoco.MjModel, mujoco.MjData]]:
    yield request.param, *_world(SKINS[request.param])


def _looking_at_it(distance: float, seed: int) -> tuple[np.ndarray, np.ndarray]:
    rng = np.random.default_rng(seed)
    R = exp(rng.normal(0.0, 1.0, 3))
    return R, -distance * R[:, 0] + R[:, 1:] @ rng.uniform(-0.1, 0.1, 2) * distance


def _draw(way: Any, data: mujoco.MjData, pose: Any, x: np.ndarray = X, y: np.ndarray = Y) -> np.ndarray:
    out = np.full((len(y), len(x)), SKY, dtype=np.float32)
    way.draw(out, data, pose, x, y, Haze(extinction_1_m=1e-3, airlight=0.2))
    return out


@pytest.mark.gl
@pytest.mark.parametrize("near", [1.0, 0.25])
def test_opengl_and_rays_agree_but_for_edges(world: Any, near: float) -> None:
    """99.9 % of the blocks within two of 256 grey levels, from all sides, near enough to clip, too."""
    name, model, data = world
    drawn, traced = DrawnSolids(model, SUNLIT, BLOCKS_PER_TANGENT, (len(Y), len(X))), TracedSolids(model, SUNLIT)
    apart, shown = 0.0, 0.0
    for seed in range(6):
        pose = _looking_at_it(near * FAR[name], seed)
        one, other = (_draw(way, data, pose) for way in (drawn, traced))
        apart += (np.abs(one - other) > 2.0 / 255.0).mean() / 6.0
        shown += (other != SKY).mean() / 6.0
    drawn.close()
    assert shown > 0.03
    assert apart < 1e-3


def _as_box_and_as_mesh(half: np.ndarray, pos: list[float], quat: np.ndarray, R: np.ndarray) -> list[np.ndarray]:
    """Which blocks show a box, and which a mesh of its twelve triangles, from the origin."""
    corners = np.array([[i, j, k] for i in (-1, 1) for j in (-1, 1) for k in (-1, 1)]) * half
    quads = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
    pictures = []
    for kind in (mujoco.mjtGeom.mjGEOM_BOX, mujoco.mjtGeom.mjGEOM_MESH):
        spec = mujoco.MjSpec()
        spec.stat.extent, spec.visual.map.znear, spec.visual.map.zfar = 20.0, 0.005, 100.0
        spec.add_mesh(
            name="rod",
            uservert=corners.ravel().tolist(),
            userface=[corner for a, b, c, d in quads for corner in (a, b, c, a, c, d)],
        )
        shape = {"size": half} if kind == mujoco.mjtGeom.mjGEOM_BOX else {"meshname": "rod"}
        spec.worldbody.add_geom(type=kind, pos=pos, quat=quat, rgba=[1.0, 1.0, 1.0, 1.0], **shape)
        model = spec.compile()
        data = mujoco.MjData(model)
        mujoco.mj_forward(model, data)
        pictures.append(_draw(TracedSolids(model, SUNLIT), data, (R, np.zeros(3))) != SKY)
    return pictures


@pytest.mark.parametrize("aside", [(0.35, 0.1), (-0.2, -0.3), (0.05, 0.5)])
@pytest.mark.parametrize("turn", [(0.0, 0.0, 0.0), (0.4, 0.1, -0.3)])
def test_a_mesh_that_reaches_past_the_lens_is_seen_as_far_as_the_near_plane(
    aside: tuple[float, float], turn: tuple[float, float, float]
) -> None:
    """A rod of twelve triangles from 5 m behind to 5 m ahead shows in the blocks that a box of its size shows in."""
    quat = quaternion_from_matrix(exp(np.array([0.03, np.pi / 2 + 0.02, -0.02])))
    box, mesh = _as_box_and_as_mesh(np.array([0.1, 0.07, 5.0]), [0.0, *aside], quat, exp(np.array(turn)))
    assert box.sum() > 500
    assert (box != mesh).sum() <= 3


def test_a_mesh_close_before_the_lens_and_half_a_millimetre_under_it_is_seen_as_a_box_is() -> None:
    """From 5 cm beyond the near plane on; one row of blocks shows its top alone."""
    pos, upright = [0.215, 0.0, -0.0205], np.array([1.0, 0.0, 0.0, 0.0])
    box, mesh = _as_box_and_as_mesh(np.array([0.06, 0.05, 0.02]), pos, upright, np.eye(3))
    assert box.sum() > 10000 and np.flatnonzero(box.any(axis=1))[0] == np.searchsorted(Y, 0.0005 / 0.275)
    assert (box != mesh).sum() <= 3


def test_a_picture_leaves_nothing_behind_in_the_next(world: Any) -> None:
    """From all sides, near and far, narrow and wide by turns: as drawn by one that never drew before."""
    name, model, data = world
    used = TracedSolids(model, SUNLIT)
    for seed in range(12):
        pose = _looking_at_it((1.5, 0.5, 0.2)[seed % 3] * FAR[name], seed)
        x, y = ((X, Y), (X[3:12], Y[5:40]), (X[20:90], Y))[seed % 3]
        fresh = TracedSolids(model, SUNLIT)
        assert np.array_equal(_draw(used, data, pose, x, y), _draw(fresh, data, pose, x, y))


def test_blocks_show_a_mesh_where_mujocos_rays_meet_it(world: Any) -> None:
    """A block in 23; the skins are closed, so that the first face met looks at the lens."""
    name, model, data = world
    pose = _looking_at_it(FAR[name], 11)
    shown = _draw(TracedSolids(model, SUNLIT), data, pose) != SKY
    wrong, count, geom = 0, 0, np.empty(1, dtype=np.int32)
    for i in range(0, len(Y), 5):
        for j in range(i % 4, len(X), 5):
            ray = pose[0] @ np.array([1.0, -X[j], -Y[i]])
            hit = mujoco.mj_ray(model, data, pose[1], ray / np.linalg.norm(ray), VISIBLE_GROUPS, 1, -1, geom)
            wrong += (hit >= 0.0) != shown[i, j]
            count += hit >= 0.0
    assert count > 30
    assert wrong == 0


def test_a_mesh_is_as_bright_and_as_far_as_moller_and_trumbore_find_it(world: Any) -> None:
    """A block in 47: light of the corners in proportion to the ray's place between them, haze by its slant range."""
    name, model, data = world
    R_WC, p_WC = pose = _looking_at_it(0.4 * FAR[name], 5)
    corners, lit = [], []
    for g in range(model.ngeom):
        local, normals, triangles = mesh_of(model, int(model.geom_dataid[g]))
        turn = data.geom_xmat[g].reshape(3, 3)
        light = 0.25 + 0.75 * np.maximum(normals @ turn.T @ SUN, 0.0)
        corners.append((local @ turn.T + data.geom_xpos[g])[triangles])
        lit.append(model.geom_rgba[g, 0] * light[triangles])
    a, b, c = np.concatenate(corners).transpose(1, 0, 2)
    of_corners, picture, found = np.concatenate(lit), _draw(TracedSolids(model, SUNLIT), data, pose).ravel(), []
    for k in range(3, picture.size, 47):
        d = R_WC @ np.array([1.0, -X[k % len(X)], -Y[k // len(X)]])
        across = np.cross(d, c - a)
        volume = np.sum((b - a) * across, axis=1)
        with np.errstate(divide="ignore", invalid="ignore"):
            second = np.sum((p_WC - a) * across, axis=1) / volume
            third = np.cross(p_WC - a, b - a) @ d / volume
            depth = np.sum((c - a) * np.cross(p_WC - a, b - a), axis=1) / volume
        inside = (volume > 0.0) & (np.minimum(second, third) > 1e-4) & (second + third < 1.0 - 1e-4) & (depth > 0.1)
        if picture[k] != SKY and inside.any():
            t = np.flatnonzero(inside)[np.argmin(depth[inside])]
            through = np.exp(-1e-3 * depth[t] * np.linalg.norm(d))
            light = of_corners[t] @ [1.0 - second[t] - third[t], second[t], third[t]]
            found.append((picture[k], light * through + 0.2 * (1.0 - through)))
    assert len(found) > 100
    ours, theirs = np.array(found).T
    assert np.mean(np.abs(ours - theirs) > 1e-5) < 0.01  # rays that pass along an edge


def test_a_patch_is_left_out_only_where_no_blocks_ray_meets_its_ball() -> None:
    """In a wide picture whose axis is not its middle."""
    rng, x, y, left = np.random.default_rng(3), np.linspace(-1.2, 0.8, 41), np.linspace(-0.5, 1.5, 41), 0
    rays = np.stack(np.broadcast_arrays(1.0, -x, -y[:, None]), axis=-1).reshape(-1, 3)
    rays /= np.linalg.norm(rays, axis=1, keepdims=True)
    for _ in range(3000):
        centre, radius = rng.uniform([0.5, -6.0, -6.0], 6.0), rng.uniform(0.1, 3.0)
        nearest = np.linalg.norm(centre - np.maximum(rays @ centre, 0.0)[:, None] * rays, axis=1).min()
        if _is_beside((centre[0], centre[1], centre[2]), radius, x, y, 0.1):
            assert nearest > radius
            left += 1
    assert left > 500


def test_rays_from_anywhere_meet_meshes_where_mujocos_do(world: Any) -> None:
    """A thousand rays each from three places, one of them inside the outline; single precision of the mesh apart."""
    name, model, data = world
    rng = np.random.default_rng(4)
    for place in (np.array([0.2 * FAR[name], 0.0, 1.5]), np.array([-FAR[name], 3.0, -2.0]), np.zeros(3)):
        toward = rng.normal(0.0, 0.15 * FAR[name], (1000, 3)) - place
        toward /= np.linalg.norm(toward, axis=1, keepdims=True)
        hits = first_hits(Obstacles.of(model), data, place, toward, np.inf)
        wanted = np.array([mujoco.mj_ray(model, data, place, v, VISIBLE_GROUPS, 1, -1, None) for v in toward])
        assert (wanted >= 0.0).sum() > 40
        same = np.isclose(hits, wanted, atol=1e-5)
        assert (~same).sum() <= 2  # rays along a face


@pytest.mark.parametrize("parts_of_reach", [0.2, 1.0 - 1e-6, 1.0 + 1e-6, np.inf])
def test_a_way_is_clear_where_its_own_ray_meets_nothing_nearer(world: Any, parts_of_reach: float) -> None:
    """Rays from many places in one call, each as long as a part of its own way to a surface; in turned axes."""
    name, model, data = world
    rng = np.random.default_rng(5)
    for geom in range(model.ngeom):
        data.geom_xmat[geom], data.geom_xpos[geom] = exp(np.array([0.2, -0.3, 1.0])).ravel(), [1.0, -2.0, 0.5]
    starts = rng.normal(0.0, 0.3 * FAR[name], (600, 3))
    ways = rng.normal(0.0, 0.1 * FAR[name], (600, 3)) - starts
    ways /= np.linalg.norm(ways, axis=1, keepdims=True)
    obstacles = Obstacles.of(model)
    alone = np.array([first_hits(obstacles, data, p, d[None], np.inf)[0] for p, d in zip(starts, ways, strict=True)])
    met = alone >= 0.0
    assert 40 < met.sum() < 560
    reach = np.where(met, alone, FAR[name]) * parts_of_reach
    assert np.array_equal(rays_are_clear(obstacles, data, starts, ways, reach), ~met | (alone >= reach))
    mujoco.mj_forward(model, data)


def test_a_window_is_the_full_pictures_bit_for_bit(world: Any) -> None:
    name, model, data = world
    pose, traced = _looking_at_it(0.3 * FAR[name], 2), TracedSolids(model, SUNLIT)
    whole = _draw(traced, data, pose)
    assert (whole != SKY).mean() > 0.05
    for rows, columns in (
        (slice(0, 241), slice(0, 1)),
        (slice(7, 8), slice(3, 370)),
        (slice(80, 161), slice(133, 264)),
    ):
        assert np.array_equal(_draw(traced, data, pose, X[columns], Y[rows]), whole[rows, columns])


@pytest.mark.parametrize("width", [1, 2, 15, 16, 17, 31])
def test_strips_narrower_and_wider_than_the_lots_that_rays_are_taken_in_are_the_full_pictures(width: int) -> None:
    drum = body(np.array([[0.5, 1.0, 1.0, 0.0, 0.0, 2.0], [-0.5, 1.0, 1.0, 0.0, 0.0, 2.0]]), 37, 5)
    model, data = _world([Skin("drum", drum, 1.0)])
    traced, pose = TracedSolids(model, SUNLIT), (np.eye(3), np.array([-4.0, 0.0, 0.0]))
    whole = _draw(traced, data, pose)
    seen = np.flatnonzero((whole != SKY).any(axis=0))
    for start in (0, int(seen[0]) - 1, int(seen[-1]) - width + 2, len(X) - width):
        columns = slice(start, start + width)
        assert np.array_equal(_draw(traced, data, pose, X[columns]), whole[:, columns])


def test_planes_hold_their_triangles_and_look_outward(world: Any) -> None:
    """Normals as those of the corners, which the skins' makers give, but for creases."""
    meshes = Meshes.of(world[1])
    corners, n, offset = meshes.corners_m[meshes.triangles], meshes.planes[:3].T, meshes.planes[3]
    assert np.allclose(np.linalg.norm(n, axis=1), 1.0)
    assert np.allclose(np.einsum("mki,mi->mk", corners, n), offset[:, None], atol=1e-9)
    assert (np.einsum("mki,mi->mk", meshes.normals[meshes.triangles], n) > 0.8).all()


def test_no_ray_slips_between_triangles() -> None:
    """A closed drum before the lens: no sky inside its outline, at a hundred attitudes."""
    drum = body(np.array([[0.5, 1.0, 1.0, 0.0, 0.0, 2.0], [-0.5, 1.0, 1.0, 0.0, 0.0, 2.0]]), 37, 5)
    model, data = _world([Skin("drum", drum, 1.0)])
    traced = TracedSolids(model, SUNLIT)
    for seed in range(100):
        R = exp(np.random.default_rng(seed).normal(0.0, 1.0, 3))
        shown = _draw(traced, data, (R, -4.0 * R[:, 0])) != SKY
        j, i = np.meshgrid(X, Y)
        assert shown[np.hypot(j, i) < 0.1].all()


def test_backs_are_not_seen_and_hidden_groups_neither() -> None:
    drum = body(np.array([[0.5, 1.0, 1.0, 0.0, 0.0, 2.0], [-0.5, 1.0, 1.0, 0.0, 0.0, 2.0]]), 16)
    inside = _world([Skin("drum", drum, 1.0)])
    assert np.all(_draw(TracedSolids(inside[0], SUNLIT), inside[1], (np.eye(3), np.zeros(3))) == SKY)
    hidden = _world([Skin("drum", drum, 1.0)], group=3)
    assert len(Meshes.of(hidden[0]).geoms) == 0
    assert np.all(_draw(TracedSolids(hidden[0], SUNLIT), hidden[1], (np.eye(3), np.array([-4.0, 0.0, 0.0]))) == SKY)
    assert len(Meshes.of(_world([Skin("drum", drum, 1.0)], rgba=[1.0, 1.0, 1.0, 0.0])[0]).geoms) == 0


@pytest.mark.parametrize(("lean_deg", "is_kept"), [(35.5, True), (36.5, False)])
def test_a_normal_that_leans_more_than_36_degrees_gives_way_to_its_triangles_own(
    lean_deg: float, is_kept: bool
) -> None:
    """There alone: the other triangles around the corner keep what does not lean so much from theirs."""
    drum = body(np.array([[0.5, 1.0, 1.0, 0.0, 0.0, 2.0], [-0.5, 1.0, 1.0, 0.0, 0.0, 2.0]]), 16)
    model, _ = _world([Skin("drum", drum, 1.0)])
    a, b, c = model.mesh_vert[model.mesh_face[0]].astype(float)
    flat, along = np.cross(b - a, c - a), (b - a) / np.linalg.norm(b - a)
    flat /= np.linalg.norm(flat)
    leaning = np.cos(np.deg2rad(lean_deg)) * flat + np.sin(np.deg2rad(lean_deg)) * along
    model.mesh_normal[model.mesh_facenormal[0, 0]] = leaning
    _, normals, triangles = mesh_of(model, 0)
    np.testing.assert_allclose(normals[triangles[0, 0]], leaning if is_kept else flat, atol=1e-6)


def test_triangles_without_area_are_left_out() -> None:
    """Those on both sides of an edge whose ends are put together."""
    drum = body(np.array([[0.5, 1.0, 1.0, 0.0, 0.0, 2.0], [-0.5, 1.0, 1.0, 0.0, 0.0, 2.0]]), 16)
    model, _ = _world([Skin("drum", drum, 1.0)])
    count = len(mesh_of(model, 0)[2])
    a, b = model.mesh_face[5, :2]
    model.mesh_vert[b] = model.mesh_vert[a]
    on_edge = (model.mesh_face == a).any(axis=1) & (model.mesh_face == b).any(axis=1)
    corners, _, triangles = mesh_of(model, 0)
    assert on_edge.sum() > 0 and len(triangles) == count - on_edge.sum()
    p, q, r = corners[triangles].transpose(1, 0, 2)
    assert np.linalg.norm(np.cross(q - p, r - p), axis=1).min() > 1e-3


def test_triangles_of_a_round_body_have_its_curvature_and_area() -> None:
    """Of a drum of radius 2: 1/2 around, 0 along; all tiles together have the mesh's area, but for their tilt."""
    drum = body(np.array([[1.0, 2.0, 2.0, 0.0, 0.0, 2.0], [-1.0, 2.0, 2.0, 0.0, 0.0, 2.0]]), 48, 8)
    side = drum.triangles[: 2 * 48 * 8]
    area = 0.0
    for triangle in side:
        frame, half, (c_11, c_12, c_22) = triangle_tile(drum.vertices_m[triangle], drum.normals[triangle])
        C = np.array([[c_11, c_12], [c_12, c_22]])
        assert np.sort(np.linalg.eigvalsh(C)) == pytest.approx([0.0, 0.5], abs=0.01)
        around = frame[2:] @ np.cross([1.0, 0.0, 0.0], frame[1])
        assert around @ C @ around == pytest.approx(0.5, abs=0.01)
        np.testing.assert_allclose(frame[1:] @ frame[1:].T, np.eye(3), atol=1e-9)
        area += 4.0 * half[0] * half[1]
    assert area == pytest.approx(2.0 * 48 * 2.0 * 2.0 * np.sin(np.pi / 48), rel=5e-4)


def test_a_mesh_is_cut_once_and_another_anew() -> None:
    model, _ = _world(SKINS["fighter"])
    corners, normals, triangles = mesh_of(model, 0)
    tiles = mesh_tiles((corners, normals, triangles))
    assert mesh_tiles((corners.copy(), normals.copy(), triangles.copy())) is tiles
    for (frame, half, curvature), t in zip(tiles, triangles, strict=True):
        alone = triangle_tile(corners[t], normals[t])
        np.testing.assert_array_equal(frame, alone[0])
        assert (half, curvature) == alone[1:]
    for larger in ((2.0 * corners, normals, triangles), (corners, normals, triangles[:-1])):
        assert mesh_tiles(larger) is not tiles
    twice = mesh_tiles((2.0 * corners, normals, triangles))
    assert twice[0][1] == pytest.approx(tuple(2.0 * side for side in tiles[0][1]))


def test_meshes_mirror_with_every_triangle() -> None:
    model, _ = _world(SKINS["fighter"])
    facets = Mirrors.of(model).facets
    assert len(facets.geom) == len(Meshes.of(model).triangles)
    turned, _ = _world(SKINS["fighter"], quat=quaternion_from_matrix(exp(np.array([0.3, 0.2, 0.1]))))
    assert np.allclose(np.sort(Mirrors.of(turned).facets.half.prod(axis=1)), np.sort(facets.half.prod(axis=1)))
