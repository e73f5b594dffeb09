"""The 1 - cosine gust against its formula, written out by hand here, and what follows from its being frozen."""

import copy

import numpy as np
import pytest

from dockair.errors import DockairError
from dockair.sim.air.discrete_gust import DiscreteGust, DiscreteGusts

V, STEP_S, DROGUE_X = 150.0, 1e-3, -14.6
PEAK = np.array([1.0, -6.0, 4.0])


def gust(at_s: float = 0.5, length_m: float = 30.0, velocity_m_s: np.ndarray = PEAK) -> DiscreteGust:
    return DiscreteGust(at_s=at_s, length_m=length_m, velocity_m_s=velocity_m_s)


def run(gusts: list[DiscreteGust], time_s: float, step_s: float = STEP_S, start_s: float = 0.0) -> DiscreteGusts:
    sum_ = DiscreteGusts(gusts, V, step_s, met_at_m=DROGUE_X, start_s=start_s)
    for _ in range(round((time_s - start_s) / step_s)):
        sum_.step()
    return sum_


@pytest.mark.parametrize(("inside_m", "share"), [(0, 0), (10, 0.25), (15, 0.5), (30, 1), (45, 0.5), (60, 0), (61, 0)])
def test_velocity_is_that_of_cs_25_341_a_distance_inside_the_front(inside_m: float, share: float) -> None:
    """(1 - cos(pi s / H)) / 2 at s = H/3, H/2, H, 3 H/2 is 1/4, 1/2, 1, 1/2. The front is at the drogue now."""
    np.testing.assert_allclose(run([gust()], 0.5).velocity(np.array([DROGUE_X + inside_m]))[0], share * PEAK, atol=1e-9)


def test_front_meets_the_drogue_at_its_time_and_a_body_farther_aft_a_distance_over_airspeed_later() -> None:
    x = np.array([0.0, DROGUE_X, DROGUE_X - 25.0])
    field, met = DiscreteGusts([gust()], V, STEP_S, met_at_m=DROGUE_X), np.full(3, np.nan)
    for tick in range(1, 1000):
        field.step()
        new = np.isnan(met) & (np.linalg.norm(field.velocity(x), axis=1) > 0.0)
        met[new] = tick * STEP_S
    np.testing.assert_allclose(met, 0.5 + (DROGUE_X - x) / V, atol=1.01 * STEP_S)


def test_gust_is_frozen_and_rides_aft_with_the_air() -> None:
    x = np.linspace(20.0, -50.0, 71)
    early, late = run([gust()], 0.5), run([gust()], 0.7)
    np.testing.assert_allclose(late.velocity(x - V * 0.2), early.velocity(x), atol=1e-9)
    assert np.abs(early.velocity(x)).max() > 3.0


def test_mean_over_the_gusts_whole_length_is_half_the_peak_and_its_slope_has_no_jump() -> None:
    x = DROGUE_X + np.linspace(-5.0, 65.0, 70_001)
    v = run([gust()], 0.5).velocity(x)
    np.testing.assert_allclose(np.trapezoid(v, x, axis=0), 0.5 * PEAK * 60.0, rtol=1e-8)
    slope = np.diff(v[:, 1]) / np.diff(x)
    assert np.abs(slope).max() == pytest.approx(6.0 * np.pi / 2.0 / 30.0, rel=1e-6)
    curvature = 6.0 * np.pi**2 / 2.0 / 30.0**2
    assert np.abs(np.diff(slope)).max() <= 1.001 * curvature * (x[1] - x[0])


def test_gusts_add_up_and_no_gust_is_still_air() -> None:
    x = np.linspace(30.0, -40.0, 29)
    one, two = gust(), gust(at_s=0.4, length_m=12.0, velocity_m_s=np.array([0.0, 3.0, -2.0]))
    both = run([one, two], 0.55).velocity(x)
    np.testing.assert_allclose(both, run([one], 0.55).velocity(x) + run([two], 0.55).velocity(x), atol=1e-12)
    np.testing.assert_array_equal(run([], 0.55).velocity(x), np.zeros((29, 3)))


def test_two_ramps_of_mil_f_8785c_make_one_gust() -> None:
    """Its gust rises over d_m and stays; the second, turned round, begins where the first has risen."""
    s = np.linspace(-10.0, 80.0, 181)

    def ramp(s: np.ndarray) -> np.ndarray:
        return np.asarray(0.5 * (1.0 - np.cos(np.pi * np.clip(s, 0.0, 30.0) / 30.0)))

    made = (ramp(s) - ramp(s - 30.0))[:, None] * PEAK
    np.testing.assert_allclose(run([gust()], 0.5).velocity(DROGUE_X + s), made, atol=1e-9)


def test_another_physics_rate_and_a_settling_time_before_the_flight_meet_the_same_gust() -> None:
    x = np.linspace(30.0, -40.0, 29)
    fast = run([gust()], 0.6).velocity(x)
    np.testing.assert_allclose(run([gust()], 0.6, step_s=4e-3).velocity(x), fast, atol=1e-9)
    np.testing.assert_allclose(run([gust()], 0.6, start_s=-2.0).velocity(x), fast, atol=1e-9)


def test_copy_goes_on_by_itself() -> None:
    one = run([gust()], 0.5)
    two, x = copy.deepcopy(one), np.zeros(1)
    one.step()
    assert not np.array_equal(one.velocity(x), two.velocity(x))
    two.step()
    np.testing.assert_array_equal(one.velocity(x), two.velocity(x))


def test_what_is_no_gust_is_refused_by_its_keys_name() -> None:
    with pytest.raises(DockairError, match=r"gusts\.length_m: expected a length > 0, got 0\.0"):
        gust(length_m=0.0)
    with pytest.raises(DockairError, match=r"gusts\.velocity_m_s"):
        gust(velocity_m_s=np.array([1.0, 2.0]))
    with pytest.raises(DockairError, match=r"gusts\.velocity_m_s"):
        gust(velocity_m_s=np.array([1.0, np.nan, 2.0]))
    with pytest.raises(DockairError, match=r"gusts\.at_s"):
        gust(at_s=np.inf)
    with pytest.raises(DockairError, match="airspeed_m_s: expected a speed > 0"):
        DiscreteGusts([gust()], 0.0, STEP_S, met_at_m=0.0)
