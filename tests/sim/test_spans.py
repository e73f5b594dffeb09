"""Runs of blocks against MuJoCo's rays through all blocks, and what is left out."""

import mujoco
import numpy as np
import pytest

from dockair.rotations import exp
from dockair.sim.camera.solids import VISIBLE_GROUPS, Solids
from dockair.sim.camera.spans import Placed, place

GEOM = mujoco.mjtGeom
KINDS = {
    GEOM.mjGEOM_SPHERE: [0.4, 0.0, 0.0],
    GEOM.mjGEOM_ELLIPSOID: [1.5, 0.3, 0.6],
    GEOM.mjGEOM_CAPSULE: [0.2, 1.2, 0.0],
    GEOM.mjGEOM_CYLINDER: [0.5, 0.9, 0.0],
    GEOM.mjGEOM_BOX: [0.7, 0.2, 1.1],
}
X, Y = np.arange(-40, 41) / 100.0, np.arange(-25, 26) / 100.0
NEAR = 0.1
LEVEL = (np.eye(3), np.zeros(3))

Pose = tuple[np.ndarray, np.ndarray]


def _placed(kind: mujoco.mjtGeom, p_C: np.ndarray, R: np.ndarray, pose: Pose) -> tuple[np.ndarray, np.ndarray]:
    """Which blocks (rows, columns) are in a run of a solid at a place in camera axes, and which blocks' rays meet it.

    Rays that meet it nearer than the near plane count as misses.
    """
    spec = mujoco.MjSpec()
    quat = np.zeros(4)
    mujoco.mju_mat2Quat(quat, (pose[0] @ R).ravel())
    spec.worldbody.add_geom(type=kind, size=KINDS[kind], pos=pose[1] + pose[0] @ p_C, quat=quat)
    model = spec.compile()
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    solids, out = Solids.of(model), Placed.room_for(1, len(Y))
    poses = solids.geoms, data.geom_xpos, data.geom_xmat
    in_run, met = np.zeros((2, len(Y), len(X)), dtype=bool)
    if place(solids.kinds, solids.half_sizes_m, poses, pose, X, Y, NEAR, out) == 1:
        first, stop, run = out.rows[0]
        for row in range(first, stop):
            in_run[row, slice(*out.runs[run + row - first])] = True
    for i, y in enumerate(Y):
        for j, x in enumerate(X):
            d = np.array([1.0, -x, -y])
            length = np.linalg.norm(d)
            distance = mujoco.mj_ray(model, data, pose[1], pose[0] @ d / length, VISIBLE_GROUPS, 1, -1, None)
            met[i, j] = distance >= NEAR * length
    return in_run, met


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("seed", range(12))
def test_every_block_whose_ray_meets_a_solid_is_in_one_of_its_runs(kind: mujoco.mjtGeom, seed: int) -> None:
    """Anywhere before the lens, partly outside the picture; the last four seeds reach behind the lens."""
    rng = np.random.default_rng(seed)
    ahead = rng.uniform(0.3, 1.0) if seed >= 8 else rng.uniform(2.0, 9.0)
    p_C = np.array([ahead, *(rng.uniform(-0.3, 0.3, 2) * max(ahead, 1.0))])
    in_run, met = _placed(kind, p_C, exp(rng.normal(0.0, 1.0, 3)), (exp(rng.normal(0.0, 1.0, 3)), rng.normal(0, 50, 3)))
    assert in_run[met].all()


@pytest.mark.parametrize("kind", KINDS)
def test_runs_have_a_block_more_at_either_end_and_outlines_a_row_more(kind: mujoco.mjtGeom) -> None:
    for seed in range(6):
        rng = np.random.default_rng(seed)
        p_C = np.array([rng.uniform(5.0, 9.0), *rng.uniform(-1.0, 1.0, 2)])
        in_run, met = _placed(kind, p_C, exp(rng.normal(0.0, 1.0, 3)), LEVEL)
        assert met.any()
        assert in_run[:, 1:][met[:, :-1]].all() and in_run[:, :-1][met[:, 1:]].all()
        rows, rows_met = in_run.any(axis=1), met.any(axis=1)
        assert rows[1:][rows_met[:-1]].all() and rows[:-1][rows_met[1:]].all()


@pytest.mark.parametrize(("kind", "half"), [(GEOM.mjGEOM_BOX, (0.7, 0.2, 1.1)), (GEOM.mjGEOM_CAPSULE, (0.2, 0.2, 1.4))])
def test_runs_are_the_solids_boxs_picture_and_two_blocks_more_a_side(
    kind: mujoco.mjtGeom, half: tuple[float, float, float]
) -> None:
    """Level and facing the lens, the picture of the box is that of its near face."""
    in_run, met = _placed(kind, np.array([8.0, 0.1, 0.0]), np.eye(3), LEVEL)
    wide, high = (2.0 * half[k] / (8.0 - half[0]) * 100.0 for k in (1, 2))
    assert met.any() and in_run[met].all()
    assert wide * high < in_run.sum() <= (wide + 5.0) * (high + 5.0)


@pytest.mark.parametrize(
    "p_C", [(-4.0, 0.0, 0.0), (6.0, 6.0, 0.0), (6.0, -6.0, 0.0), (6.0, 0.0, 4.5), (6.0, 0.0, -4.5)]
)
@pytest.mark.parametrize("kind", KINDS)
def test_solids_behind_the_lens_and_beside_the_picture_have_no_runs(
    kind: mujoco.mjtGeom, p_C: tuple[float, float, float]
) -> None:
    assert not _placed(kind, np.array(p_C), np.eye(3), LEVEL)[0].any()


@pytest.mark.parametrize("side", ["left", "right", "above", "below", "behind"])
def test_a_box_whose_corner_just_reaches_into_the_picture_has_runs_and_one_just_beside_it_has_none(side: str) -> None:
    """By a fiftieth of its diagonal, which is across the plane of the lens and an edge's blocks, or the near plane."""
    low, high = (X[0], Y[0]), (X[-1], Y[-1])
    inward, edge = {
        "left": (np.array([-low[0], -1.0, 0.0]), np.array([5.0, -5.0 * low[0], 0.0])),
        "right": (np.array([high[0], 1.0, 0.0]), np.array([5.0, -5.0 * high[0], 0.0])),
        "above": (np.array([-low[1], 0.0, -1.0]), np.array([5.0, 0.0, -5.0 * low[1]])),
        "below": (np.array([high[1], 0.0, 1.0]), np.array([5.0, 0.0, -5.0 * high[1]])),
        "behind": (np.array([1.0, 0.0, 0.0]), np.array([NEAR, 0.0, 0.0])),
    }[side]
    half = np.array(KINDS[GEOM.mjGEOM_BOX])
    a, b = half / np.linalg.norm(half), inward / np.linalg.norm(inward)
    axis = np.cross(a, b)
    R = exp(axis / np.linalg.norm(axis) * np.arccos(a @ b))
    for part in (0.98, 1.02):
        in_run, _ = _placed(GEOM.mjGEOM_BOX, edge - part * np.linalg.norm(half) * b, R, LEVEL)
        assert in_run.any() == (part < 1.0)
