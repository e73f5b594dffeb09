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
    keys = Keys(STEP_M, 3.0 * STEP_M)
    for place in (*way, way[-1]):
        here, found = keys.come_to(place)
    assert (here, found) == (way[-1], key)
    next_key, share = keys.coming(here, found)
    assert next_key == coming and share == pytest.approx(part)


@pytest.mark.parametrize("height_m", [900.0, 301.0, 151.0, 149.0, 75.5, 74.0, 12.0, 1.0, 0.1])
def test_no_key_is_on_the_layer_nor_more_than_twice_as_high_over_it_as_the_place(height_m: float) -> None:
    """The origin is 900 m over it; nor further aside than the layer is below, but for 5 cm."""
    keys = Keys(STEP_M, 900.0)
    for x in (0.0, 1234.5, -77.7):
        place, key = keys.come_to((x, -x, height_m - 900.0))
        key_height_m = 900.0 + key[2]
        assert 0.5 * height_m < key_height_m < 2.0 * height_m
        assert abs(key[0] - x) <= max(min(height_m, 0.5 * STEP_M), 0.05) and key[0] == -key[1]


def test_the_way_down_to_a_finer_grid_has_no_next_key() -> None:
    keys = Keys(STEP_M, 900.0)
    keys.come_to((0.0, 0.0, -600.0))
    place, key = keys.come_to((0.0, 0.0, -700.0))
    assert key == (0.0, 0.0, -600.0) and keys.coming(place, key) == (None, 0.0)
    place, key = keys.come_to((0.0, 0.0, -690.0))
    assert keys.coming(place, key)[0] == (0.0, 0.0, -300.0)
