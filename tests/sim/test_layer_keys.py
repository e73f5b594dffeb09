"""Which key a place has, and which comes next: along the axis that is left first."""

import pytest

from dockair.rotations import Array
from dockair.sim.camera.layer_keys import Keys, Place

STEP_M = 300.0


@pytest.mark.parametrize(
    ("way", "key", "coming", "part"),
    [
        ([(0.0, 0.0, 0.0)], (0.0, 0.0, 0.0), None, 0.0),
        ([(30.0, 0.0, 0.0)], (0.0, 0.0, 0.0), (300.0, 0.0, 0.0), 0.1),
        ([(30.0, 0.0, 0.0), (15.0, 0.0, 0.0)], (0.0, 0.0, 0.0), (-300.0, 0.0, 0.0), -0.05),
        ([(149.0, 30.0, 0.0), (149.0, 60.0, -1.0)], (0.0, 0.0, 0.0), (0.0, 300.0, 0.0), 0.2),
        ([(400.0, 0.0, 0.0), (430.0, 0.0, 6.0)], (300.0, 0.0, 0.0), (600.0, 0.0, 0.0), 130.0 / 300.0),
    ],
)
def test_the_next_key_lies_beyond_the_side_that_is_reached_first(
    way: list[Array], key: Place, coming: Place | None, part: float
) -> None:
    """Coming to the same place twice is no standing still: the way on is that of before."""
    keys = Keys(STEP_M)
    for place in (*way, way[-1]):
        here, found = keys.come_to(place)
    assert (here, found) == (way[-1], key)
    next_key, share = keys.coming(here, found)
    assert next_key == coming and share == pytest.approx(part)
