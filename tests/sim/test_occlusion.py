"""Rays through the scene: many at once say what one at a time says."""

import mujoco
import numpy as np
import pytest

from dockair.sim.camera.occlusion import clear_directions, hidden, is_clear

EYE = np.zeros(3)
AHEAD = np.array([1.0, 0.0, 0.0])
_G = mujoco.mjtGeom


def _world(*geoms: dict) -> tuple[mujoco.MjModel, mujoco.MjData]:
    spec = mujoco.MjSpec()
    for geom in geoms:
        spec.worldbody.add_geom(**geom)
    model = spec.compile()
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    return model, data


def _ball(x: float, radius: float = 1.0, **more: object) -> dict:
    return {"type": _G.mjGEOM_SPHERE, "pos": [x, 0.0, 0.0], "size": [radius, 0.0, 0.0], **more}


@pytest.fixture(scope="module")
def crowd() -> tuple[mujoco.MjModel, mujoco.MjData]:
    """Seventy geoms of all kinds around the eye, some in hidden groups, some transparent."""
    rng = np.random.default_rng(5)
    kinds = [_G.mjGEOM_SPHERE, _G.mjGEOM_BOX, _G.mjGEOM_CAPSULE, _G.mjGEOM_ELLIPSOID, _G.mjGEOM_CYLINDER]
    return _world(
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


def test_many_directions_at_once_are_clear_where_one_by_one_they_are(crowd) -> None:
    directions = _directions(2000)
    together = clear_directions(*crowd, EYE, directions)
    assert 0.2 < together.mean() < 0.98
    assert np.array_equal(together, [is_clear(*crowd, EYE, v, np.inf) for v in directions])


def test_targets_together_are_hidden_where_one_by_one_they_are(crowd) -> None:
    targets = _directions(2000) * np.random.default_rng(7).uniform(1.0, 25.0, (2000, 1))
    together = hidden(*crowd, EYE, targets, 0.05)
    distances = np.linalg.norm(targets, axis=1)
    one_by_one = [not is_clear(*crowd, EYE, p / r, r - 0.05) for p, r in zip(targets, distances, strict=True)]
    assert 0.05 < together.mean() < 0.9
    assert np.array_equal(together, one_by_one)


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
    before = np.empty(mujoco.mj_stateSize(model, mujoco.mjtState.mjSTATE_INTEGRATION))
    mujoco.mj_getState(model, data, before, mujoco.mjtState.mjSTATE_INTEGRATION)
    poses = data.geom_xpos.copy()
    clear_directions(model, data, EYE, _directions(10))
    after = np.empty_like(before)
    mujoco.mj_getState(model, data, after, mujoco.mjtState.mjSTATE_INTEGRATION)
    assert np.array_equal(before, after) and np.array_equal(poses, data.geom_xpos)
