"""The world's benchmark times like with like; how fast it is belongs to the machine and is not tested."""

from types import SimpleNamespace

import mujoco
import numpy as np
import pytest

from dockair.scenarios.bench import world as bench_of_world


def test_every_round_begins_where_the_world_was_and_not_where_the_last_one_ended(monkeypatch):
    """A ball that falls under a force."""
    model = mujoco.MjModel.from_xml_string(
        '<mujoco><worldbody><body name="ball"><freejoint/><geom size="0.1"/></body></worldbody></mujoco>'
    )
    data = mujoco.MjData(model)
    data.qpos[:3], data.qvel[:3], data.xfrc_applied[1, :3] = (1.0, 2.0, 3.0), (0.0, 0.0, -4.0), (5.0, 0.0, 0.0)
    reached = []
    step = mujoco.mj_step

    def spied(model, data):
        step(model, data)
        reached.append(np.concatenate([[data.time], data.qpos, data.qvel, data.xfrc_applied[1]]))

    monkeypatch.setattr(bench_of_world.mujoco, "mj_step", spied)
    bare = bench_of_world._bare_step(SimpleNamespace(model=model, data=data))
    rounds = []
    for _ in range(2):
        bench_of_world._microseconds(*bare)
        rounds.append(reached[:])
        reached.clear()
    assert len(rounds[0]) == bench_of_world._WARM_TICKS + bench_of_world._TICKS
    np.testing.assert_array_equal(rounds[1], rounds[0])
    assert rounds[0][-1][0] == pytest.approx(len(rounds[0]) * model.opt.timestep)
    assert data.time == 0.0
