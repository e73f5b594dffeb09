"""Rays through the scene, against MuJoCo's own, one at a time."""

import mujoco
import numpy as np
import pytest

from dockair.errors import DockairError
from dockair.sim.camera.obstacles import Obstacles
from dockair.sim.camera.occlusion import (
    clear_directions,
    first_hits,
    hidden,
    is_clear,
    rays_are_clear,
)
from dockair.sim.camera.solids import VISIBLE_GROUPS
from mirror_scenes import EYE, scene_of

AHEAD = np.array([1.0, 0.0, 0.0])
_G = mujoco.mjtGeom


def _world(*geoms: dict) -> tuple[Obstacles, mujoco.MjData]:
    model, data = scene_of(*geoms)
    return Obstacles.of(model), data


def _mujocos_hits(model: mujoco.MjModel, data: mujoco.MjData, eye: np.ndarray, directions: np.ndarray) -> np.ndarray:
    """(n,) distances, -1 for none, a ray at a time."""
    return np.array([mujoco.mj_ray(model, data, eye, v, VISIBLE_GROUPS, 1, -1, None) for v in directions])


def _ball(x: float, radius: float = 1.0, **more: object) -> dict:
    return {"type": _G.mjGEOM_SPHERE, "pos": [x, 0.0, 0.0], "size": [radius, 0.0, 0.0], **more}


@pytest.fixture(scope="module")
def crowd() -> tuple[mujoco.MjModel, mujoco.MjData]:
    """Seventy geoms of all kinds around the eye, some in hidden groups, some transparent."""
    rng = np.random.default_rng(5)
    kinds = [_G.mjGEOM_SPHERE, _G.mjGEOM_BOX, _G.mjGEOM_CAPSULE, _G.mjGEOM_ELLIPSOID, _G.mjGEOM_CYLINDER]
    return scene_of(
        *(
            {
                "type": kinds[i % 5],
                "pos": rng.uniform(2.0, 10.0, 3) * rng.choice([-1.0, 1.0], 3),
                "size": rng.uniform(0.2, 1.5, 3),
                "quat": rng.normal(size=4),
                "group": i % 4,
                "rgba": [1.0, 1.0, 1.0, float(i % 7 > 0)],
            }
            for i in range(70)
        )
    )


def _directions(n: int) -> np.ndarray:
    v = np.random.default_rng(6).normal(size=(n, 3))
    return v / np.linalg.norm(v, axis=1, keepdims=True)


@pytest.mark.parametrize("seed", range(8))
def test_distances_to_all_kinds_of_solids_are_mujocos(crowd, seed: int) -> None:
    """From anywhere, so from inside of solids, too; to 1e-9 m."""
    model, data = crowd
    eye = np.random.default_rng(seed).uniform(-9.0, 9.0, 3)
    hits = first_hits(Obstacles.of(model), data, eye, _directions(500), np.inf)
    expected = _mujocos_hits(model, data, eye, _directions(500))
    assert 20 < (expected >= 0.0).sum() < 500 or (expected >= 0.0).all()
    assert np.array_equal(hits < 0.0, expected < 0.0)
    np.testing.assert_allclose(hits, expected, rtol=0.0, atol=1e-9)


@pytest.mark.parametrize(
    "kind", ["mjGEOM_CAPSULE", "mjGEOM_CYLINDER", "mjGEOM_BOX", "mjGEOM_SPHERE", "mjGEOM_ELLIPSOID"]
)
@pytest.mark.parametrize("start", [-5.0, -0.6, 0.0, 0.6, 5.0])
def test_a_ray_along_a_solids_axis_meets_its_near_end_or_from_inside_its_far_one(kind: str, start: float) -> None:
    """Radius 0.5, half length 1 (capsule 1.5 with its ends); no component across at all, in the axis and beside it."""
    obstacles, data = _world(
        {
            "type": getattr(_G, kind),
            "pos": [0.0, 0.0, 0.0],
            "size": [0.5, 1.0 if "BOX" not in kind and "ELL" not in kind else 0.5, 1.0],
        }
    )
    half = {"mjGEOM_CAPSULE": 1.5, "mjGEOM_SPHERE": 0.5}.get(kind, 1.0)
    up = np.array([[0.0, 0.0, 1.0]])
    expected = -half - start if start < -half else (half - start if start <= half else -1.0)
    assert first_hits(obstacles, data, np.array([0.0, 0.0, start]), up, np.inf)[0] == pytest.approx(expected, abs=1e-12)
    assert first_hits(obstacles, data, np.array([0.51, 0.0, start]), up, np.inf)[0] == -1.0


def test_nothing_is_met_beyond_the_reach(crowd) -> None:
    model, data = crowd
    expected = _mujocos_hits(model, data, EYE, _directions(2000))
    expected[expected >= 11.0] = -1.0
    assert (expected >= 0.0).sum() > 100
    np.testing.assert_allclose(first_hits(Obstacles.of(model), data, EYE, _directions(2000), 11.0), expected, atol=1e-9)


def test_directions_are_clear_where_mujocos_rays_meet_nothing(crowd) -> None:
    model, data = crowd
    clear = clear_directions(Obstacles.of(model), data, EYE, _directions(2000))
    assert 0.2 < clear.mean() < 0.98
    assert np.array_equal(clear, _mujocos_hits(model, data, EYE, _directions(2000)) < 0.0)


def test_targets_are_hidden_where_mujocos_rays_end_before_them(crowd) -> None:
    model, data = crowd
    distances = np.random.default_rng(7).uniform(1.0, 25.0, 2000)
    together = hidden(Obstacles.of(model), data, EYE, _directions(2000) * distances[:, None], 0.05)
    hits = _mujocos_hits(model, data, EYE, _directions(2000))
    assert 0.05 < together.mean() < 0.9
    assert np.array_equal(together, (hits >= 0.0) & (hits < distances - 0.05))


def test_a_visible_geom_that_is_no_solid_is_refused_by_name() -> None:
    model, _ = scene_of({"type": _G.mjGEOM_PLANE, "size": [1.0, 1.0, 1.0], "name": "floor"})
    with pytest.raises(DockairError, match="geom floor"):
        Obstacles.of(model)


def test_a_ray_is_clear_up_to_what_it_meets() -> None:
    world = _world(_ball(5.0))
    assert is_clear(*world, EYE, AHEAD, 3.99)
    assert not is_clear(*world, EYE, AHEAD, 4.01)
    assert is_clear(*world, EYE, -AHEAD, np.inf)
    assert list(clear_directions(*world, EYE, np.array([AHEAD, -AHEAD]))) == [False, True]


def test_what_lies_within_the_clearance_of_a_target_does_not_hide_it() -> None:
    world = _world(_ball(5.0))
    targets = np.array([[3.9, 0.0, 0.0], [4.04, 0.0, 0.0], [4.06, 0.0, 0.0], [7.0, 0.0, 0.0], [-7.0, 0.0, 0.0]])
    assert list(hidden(*world, EYE, targets, 0.05)) == [False, False, True, True, False]


def test_what_is_not_drawn_hides_nothing() -> None:
    beyond = np.array([[9.0, 0.0, 0.0]])
    assert hidden(*_world(_ball(5.0, group=2)), EYE, beyond, 0.0)[0]
    assert not hidden(*_world(_ball(5.0, group=3)), EYE, beyond, 0.0)[0]
    assert not hidden(*_world(_ball(5.0, rgba=[1.0, 1.0, 1.0, 0.0])), EYE, beyond, 0.0)[0]


def test_no_targets_and_no_directions_give_empty_answers() -> None:
    world = _world(_ball(5.0))
    assert hidden(*world, EYE, np.empty((0, 3)), 0.0).shape == (0,)
    assert clear_directions(*world, EYE, np.empty((0, 3))).shape == (0,)


def test_rays_change_nothing_in_the_world(crowd) -> None:
    model, data = crowd
    obstacles = Obstacles.of(model)
    before = np.empty(mujoco.mj_stateSize(model, mujoco.mjtState.mjSTATE_INTEGRATION))
    mujoco.mj_getState(model, data, before, mujoco.mjtState.mjSTATE_INTEGRATION)
    poses = data.geom_xpos.copy()
    clear_directions(obstacles, data, EYE, _directions(10))
    after = np.empty_like(before)
    mujoco.mj_getState(model, data, after, mujoco.mjtState.mjSTATE_INTEGRATION)
    assert np.array_equal(before, after) and np.array_equal(poses, data.geom_xpos)


@pytest.mark.parametrize("half_angle_rad", [0.0, 0.01, 0.1, 0.5, 1.2, 1.7])
def test_rays_of_a_bundle_meet_what_each_meets_alone(crowd, half_angle_rad: float) -> None:
    """To the bit, of bundles from almost no width to more than half of all directions; and MuJoCo agrees."""
    model, data = crowd
    obstacles, met = Obstacles.of(model), 0
    rng = np.random.default_rng(8)
    for toward in data.geom_xpos[::3]:  # and a little beside
        axis = toward + rng.normal(0.0, 0.5, 3)
        axis /= np.linalg.norm(axis)
        rays = rng.normal(size=(40, 3))
        rays -= (rays @ axis)[:, None] * axis
        angle = half_angle_rad * np.sqrt(rng.uniform(size=(40, 1)))
        rays = np.cos(angle) * axis + np.sin(angle) * rays / np.linalg.norm(rays, axis=1, keepdims=True)
        hits = first_hits(obstacles, data, EYE, rays, np.inf)
        alone = [first_hits(obstacles, data, EYE, ray[None], np.inf)[0] for ray in rays]
        assert np.array_equal(hits, alone)
        np.testing.assert_allclose(hits, _mujocos_hits(model, data, EYE, rays), atol=1e-7)
        met += int((hits >= 0.0).sum())
    assert 100 < met < 0.9 * 40 * len(data.geom_xpos[::3])


@pytest.mark.parametrize("beside_m", [-1e-4, 1e-4])
def test_a_ball_that_a_bundle_just_touches_is_met_and_one_beside_it_is_not(beside_m: float) -> None:
    """A bundle of 0.2 rad about x; the ball stands above its uppermost ray."""
    half, radius, away = 0.2, 0.5, 6.0
    turn = np.linspace(-np.pi, np.pi, 73)
    rays = np.column_stack([np.full(73, np.cos(half)), np.sin(half) * np.sin(turn), np.sin(half) * np.cos(turn)])
    up = np.array([-np.sin(half), 0.0, np.cos(half)])
    centre = away * np.array([np.cos(half), 0.0, np.sin(half)]) + (radius + beside_m) * up
    obstacles, data = _world({"type": _G.mjGEOM_SPHERE, "pos": centre, "size": [radius, 0.0, 0.0]})
    hits = first_hits(obstacles, data, EYE, rays, np.inf)
    assert (hits >= 0.0).any() == (beside_m < 0.0)


def test_a_way_of_no_length_is_clear() -> None:
    obstacles, data = _world(_ball(2.0))
    starts, ways = np.zeros((3, 3)), np.array([AHEAD, AHEAD, AHEAD])
    assert list(rays_are_clear(obstacles, data, starts, ways, np.array([-0.1, 0.0, 5.0]))) == [True, True, False]


def test_ways_from_many_places_are_clear_where_mujocos_rays_meet_nothing_nearer(crowd) -> None:
    model, data = crowd
    rng, ways = np.random.default_rng(7), _directions(1500)
    starts, reach = rng.uniform(-9.0, 9.0, (1500, 3)), rng.choice([0.5, 3.0, 12.0, np.inf], 1500)
    hits = np.array([_mujocos_hits(model, data, p, d[None])[0] for p, d in zip(starts, ways, strict=True)])
    expected = (hits < 0.0) | (hits >= reach)
    assert 0.2 < expected.mean() < 0.9
    assert np.array_equal(rays_are_clear(Obstacles.of(model), data, starts, ways, reach), expected)
