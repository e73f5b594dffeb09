"""The second airframe flies the same guidance to the drogue."""

import pytest

from dockair.scenarios.loop import fly
from dockair.scenarios.schema import load_scenario


@pytest.mark.slow
def test_the_unmanned_receiver_docks_at_its_first_attempt_on_perfect_navigation():
    """In the gusts of its scenario; a flight control that sways with the drogue never gets steady enough to begin."""
    result = fly(load_scenario("unmanned", {"navigation.navigator": "truth"}), seed=3)
    assert result.first_attempt and not result.unsafe
    assert result.contact.radial_offset_m < 0.15
    assert 1.0 <= result.contact.closure_speed_m_s <= 1.5
    assert result.hold.take_in_max_m > 0.5  # into the refuelling range, and no farther than it was meant to:
    assert result.hold.take_in_max_m < 2.5
