"""A scenario's tables become the sources of the air's motion, each alone."""

import numpy as np
import pytest

from dockair.clock import Clock
from dockair.errors import DockairError
from dockair.parameters import load_parameters
from dockair.scenarios.assembly.air import air_motion
from dockair.scenarios.schema import load_scenario
from dockair.sim.air.discrete_gust import DiscreteGusts
from dockair.sim.air.turbulence import DrydenField, gust_sigma

SETTLE_S = 2.0
POINTS_B = np.array([[0.0, 0.0, 0.0], [0.0, 4.0, 0.0], [0.0, -4.0, 0.0], [-5.0, 0.0, 0.0]])
CALM = {"wake.present": False, "bow_wave.present": False}
DRYDEN = {"turbulence.model": "dryden", "turbulence.sigma_m_s": 1.0}
GUST = {"at_s": 0.0, "length_m": 30.0, "velocity_m_s": [0.0, 0.0, -4.0]}


@pytest.fixture
def make(make_world):
    parameters = make_world().parameters

    def build(settings):
        def load(sheet, cls):
            return load_parameters(sheet, cls, scenario.parameters.get(sheet))

        scenario = load_scenario("still_air", CALM | settings)
        rng = np.random.default_rng(1)
        kwargs = {"receiver_span_m": 9.144, "receiver_points_B": POINTS_B, "settle_s": SETTLE_S}
        return air_motion(scenario, load, parameters, Clock(1000), rng, **kwargs)

    return build


def _at(air):
    tow = np.array([[-7.0, 0.0, -1.0], [-14.8, 0.0, -2.8]])
    return air.at(tow, np.eye(3), np.array([-21.0, 0.9, -3.4]), np.eye(3), -air._exit_T)


def test_still_air_has_no_sources(make):
    assert make({}) is None


@pytest.mark.parametrize(
    ("settings", "there"),
    [
        (DRYDEN, "gusts"),
        ({"gusts": [GUST]}, "discrete"),
        ({"wake.present": True}, "wake"),
        ({"bow_wave.present": True}, "bow_wave"),
    ],
)
def test_each_table_switches_on_one_source_and_no_other(make, settings, there):
    air = make(settings)
    for name in ("gusts", "discrete", "wake", "bow_wave"):
        assert (getattr(air, f"_{name}") is not None) == (name == there)


def test_an_intensity_is_that_of_the_flights_altitude(make):
    """As MIL-F-8785C has it there; the field is otherwise the same."""
    for altitude_m in (6000.0, 15000.0):
        named = make({"turbulence.intensity": "moderate", "flight.altitude_m": altitude_m})
        given = make({"turbulence.sigma_m_s": gust_sigma("moderate", altitude_m)})
        np.testing.assert_array_equal(_at(named).tow_W, _at(given).tow_W)
    assert gust_sigma("moderate", 6000.0) == pytest.approx(2.24, abs=0.01) != gust_sigma("moderate", 15000.0)
    assert np.abs(_at(named).tow_W).max() > 0.0


@pytest.mark.parametrize(("start_m", "least_m"), [(4.0, 70.0), (40.0, 106.0)])
def test_a_field_that_ends_before_the_receivers_tail_is_refused(make, start_m, least_m):
    """Front 40 m, hose 15 m, the tail 11 m behind the tip."""
    settings = DRYDEN | {"start.aft_m": start_m}
    make(settings | {"parameters.turbulence.extent_m": least_m})
    with pytest.raises(DockairError, match=f"parameters.turbulence.extent_m: expected at least {least_m:.0f} m"):
        make(settings | {"parameters.turbulence.extent_m": least_m - 0.1})


def test_turbulence_none_overrules_a_strength_and_leaves_the_wake(make):
    air = make({"turbulence.sigma_m_s": 1.0, "turbulence.model": "none", "wake.present": True})
    assert air._gusts is None and air._wake is not None


def test_the_sheets_values_of_the_scenario_reach_wake_and_bow_wave(make):
    """Twice the half-body's radius sends out four times the air; no lift on the tail takes its vortices away."""
    wide, plain = (make({"bow_wave.present": True, **more}) for more in ({"parameters.bow_wave.radius_m": 1.5}, {}))
    assert wide._bow_wave[3] == pytest.approx(4.0 * plain._bow_wave[3], rel=1e-12)
    assert wide._bow_wave[3] == pytest.approx(180.0 * 1.5**2 / 4.0, rel=1e-12)  # V R^2/4
    bare = make({"wake.present": True, "parameters.wake.tail_circulation_fraction": 0.0})
    assert bare._wake[-1, 4] == 0.0 and bare._wake[0, 4] > 0.0


def test_a_gusts_front_meets_the_drogues_canopy_at_its_time_after_the_settling(make):
    air = make({"gusts": [GUST]})
    assert isinstance(air._discrete, DiscreteGusts)
    canopy, p_WT = np.array([[-15.24, 0.0, -2.7]]), -air._exit_T
    for _ in range(round(1000 * SETTLE_S)):
        air.step()
    place = np.array([-21.0, 0.0, -3.0])
    before = air.at(canopy, np.eye(3), place, np.eye(3), p_WT)
    assert np.abs(before.tow_W).max() < 1e-3  # a few centimetres into its front
    for _ in range(round(1000 * 30.0 / 180.0)):
        air.step()
    peak = air.at(canopy, np.eye(3), place, np.eye(3), p_WT)
    np.testing.assert_allclose(peak.tow_W[0], [0.0, 0.0, -4.0], atol=1e-3)


def test_the_rolling_gust_has_the_receivers_span(make):
    air = make(DRYDEN)
    assert isinstance(air._gusts, DrydenField)
    assert abs(_at(air).receiver_rotation_B[0]) > 1e-4  # rad/s; without it, rounding
