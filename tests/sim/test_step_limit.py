"""Which step is too long is said before the world flies, and by whose fault."""

import numpy as np
import pytest

from dockair.errors import DockairError
from dockair.messages import ReceiverCommand
from dockair.sim.step_limit import fastest_rad_s


def test_step_longer_than_half_a_contact_is_refused_with_its_key(make_world):
    with pytest.raises(DockairError, match=r"rates\.physics_hz: expected at least 250 Hz.*contact_time_constant_s"):
        make_world(rate_hz=200)
    make_world(rate_hz=250)


def test_step_too_long_for_the_tube_is_refused_with_the_hose(make_world):
    stiff = {"reel": {"guide_stiffness_n_m": 300000.0}, "hose": {"links": 40}}
    with pytest.raises(DockairError, match=r"rates\.physics_hz: expected at least \d+ Hz, because of hose and reel"):
        make_world(rate_hz=250, **stiff)


def test_bound_grows_with_stiffness_and_with_the_number_of_links(make_world):
    def bound(**sheets):
        world = make_world(**sheets)
        return fastest_rad_s(world.model, world.parameters, world.rest.root_tension_n)

    plain = bound()
    assert bound(hose={"links": 36}) > plain and bound(hose={"bending_stiffness_n_m2": 500.0}) > plain
    tube_only = np.sqrt(4.0 * 1e5 / (4.1 * 15.0 / 18))
    assert tube_only < plain < 1.2 * tube_only  # by default it is the tube that is stiffest


def test_world_at_the_longest_step_it_is_allowed_holds_its_hose_still(make_world):
    world = make_world(p_PD_B=(60.0, 0.0, 0.0), rate_hz=250)
    start = world.truth.p_WD
    for _ in range(500):
        truth = world.step(ReceiverCommand())
    assert np.linalg.norm(truth.p_WD - start) < 0.02
