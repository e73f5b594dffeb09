import pytest

from dockair.clock import Clock
from dockair.errors import DockairError


def test_seconds_are_exact_at_whole_seconds_however_long_the_flight():
    clock = Clock(1800)
    assert clock.seconds(1800 * 3600 * 10) == 36000.0
    assert clock.step_s == 1.0 / 1800.0


def test_rates_that_divide_give_whole_ticks():
    assert [Clock(1800).ticks_per(rate, "rate_hz") for rate in (1800, 450, 90, 1)] == [1, 4, 20, 1800]


@pytest.mark.parametrize("rate", [300, 0, -50, 2000])
def test_rate_that_does_not_divide_is_refused_with_both_numbers_and_what_would(rate):
    with pytest.raises(DockairError) as error:
        Clock(1000).ticks_per(rate, "camera.rate_hz")
    assert error.value.where == "camera.rate_hz"
    assert "1000" in str(error.value) and str(rate) in str(error.value)
    assert "250" in error.value.exists and "300" not in error.value.exists


@pytest.mark.parametrize("rate", [0, -1000])
def test_physics_rate_must_be_positive(rate):
    with pytest.raises(DockairError, match="physics_rate_hz"):
        Clock(rate)
