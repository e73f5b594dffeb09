"""Whether the receiver can touch anything."""

from typing import Any

import mujoco
import numpy as np
import pytest

from dockair.messages import ReceiverCommand
from dockair.rotations import exp, quaternion_from_matrix
from dockair.sim.reach import Reach

FORWARD = ReceiverCommand(velocity_m_s=np.array([1.0, 0.0, 0.0]))


def _reach(world: Any) -> Reach:
    return Reach(world.model, world.data, world.model.body("receiver").id)


@pytest.mark.parametrize(("spare_m", "clear"), [(0.501, True), (0.499, False)])
@pytest.mark.parametrize("ball", ["first", "second"])
def test_a_ball_is_out_of_reach_half_a_metre_and_its_radius_ahead_of_the_foremost_solid(
    ball: str, spare_m: float, clear: bool
) -> None:
    """Two bodies ahead of one that is turned, the other of them far off; what is only drawn counts on neither side.

    The foremost solid reaches 2.1 m along; a ball of 0.3 m that stands 0.4 m beside its body's place is one of 0.7 m.
    """
    spec, R = mujoco.MjSpec(), exp(np.array([0.4, -0.3, 0.8]))
    places = {"receiver": np.zeros(3), "ghost": np.zeros(3), "first": R @ [50.0, 0.0, 0.0], "second": R @ [50.0, 0, 0]}
    places[ball] = R @ [2.1 + 0.7 + spare_m, 5.0, -4.0]
    for name, place in places.items():
        body = spec.worldbody.add_body(name=name, pos=place + [1.0, 2.0, 3.0], quat=quaternion_from_matrix(R))
        drawn = {"contype": 0, "conaffinity": 0, "size": [1.0, 0.0, 0.0]}
        body.add_geom(type=mujoco.mjtGeom.mjGEOM_SPHERE, pos=[3.0, 0.0, 0.0], **drawn)
        if name == "receiver":
            for x in (2.0, -3.0):
                body.add_geom(type=mujoco.mjtGeom.mjGEOM_SPHERE, pos=[x, 0.0, 0.0], size=[0.1, 0.0, 0.0], conaffinity=0)
        elif name != "ghost":
            body.add_geom(type=mujoco.mjtGeom.mjGEOM_SPHERE, pos=[0.0, 0.4, 0.0], size=[0.3, 0.0, 0.0], contype=0)
    model = spec.compile()
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    assert Reach(model, data, model.body("receiver").id).is_clear() is clear


@pytest.mark.parametrize("ahead_m", [2.5, 4.0])
def test_what_lies_well_ahead_of_the_probe_is_out_of_reach(make_world: Any, ahead_m: float) -> None:
    world = make_world(p_PD_B=(ahead_m, 0.0, 0.0))
    assert _reach(world).is_clear()


@pytest.mark.parametrize("place", [(0.6, 0.0, 0.0), (1.0, 3.0, 0.0), (-5.0, 0.0, 8.0)])
def test_what_is_near_the_probe_or_beside_the_receiver_is_not(make_world: Any, place: tuple[float, ...]) -> None:
    world = make_world(p_PD_B=place)
    assert not _reach(world).is_clear()


def test_a_receiver_that_faces_away_may_touch_what_is_behind_it(make_world: Any) -> None:
    world = make_world(p_PD_B=(4.0, 0.0, 0.0))
    world.data.xmat[world.model.body("receiver").id] = np.diag([-1.0, -1.0, 1.0]).ravel()
    assert not _reach(world).is_clear()


def test_a_place_that_is_no_number_is_not_out_of_reach(make_world: Any) -> None:
    world = make_world(p_PD_B=(4.0, 0.0, 0.0))
    world.data.xpos[world.model.body("receiver").id, 0] = np.nan
    assert not _reach(world).is_clear()


def test_not_to_look_for_contacts_where_there_are_none_changes_no_bit_on_the_way_to_the_first(
    make_world: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    flights, skipped = [], 0
    for always in (False, True):
        world = make_world(p_PD_B=(2.3, 0.0, 0.0))
        if always:
            monkeypatch.setattr(Reach, "is_clear", lambda reach: False)
        touched, truths = False, []
        for _ in range(4000):
            skipped += not always and _reach(world).is_clear()
            truth = world.step(FORWARD)
            truths.append(np.concatenate([truth.p_WB, truth.v_WB, truth.p_WH.ravel(), truth.w_WB_B]))
            touched |= truth.probe_touches_drogue
        flights.append(np.array(truths))
        assert touched
    assert skipped > 100
    assert np.array_equal(*flights)
