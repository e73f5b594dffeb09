"""A docking at a hose under the wing, where the wake is not symmetric."""

import pytest

from dockair.scenarios.loop import fly
from dockair.scenarios.schema import load_scenario

QUIET = {"navigation.navigator": "truth", "guidance.hold_s": 0.5, "guidance.stabilise_s": 1.0}


@pytest.mark.slow
@pytest.mark.parametrize("pod", ["left_wing", "right_wing"])
def test_the_receiver_docks_at_a_wing_pods_hose_beside_the_wakes_leg(pod):
    result = fly(load_scenario("still_air", QUIET | {"tanker.pod": pod}), 1)
    assert result.outcome == "contact" and result.attempts == 1
    assert result.contact.radial_offset_m < 0.15
    assert 1.0 < result.contact.closure_speed_m_s < 1.5
