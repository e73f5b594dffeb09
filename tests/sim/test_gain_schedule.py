"""Trims and gains between straight flight and turns."""

from dataclasses import replace

import numpy as np
import pytest

from dockair.errors import DockairError
from dockair.parameters import load_parameters
from dockair.rotations import exp
from dockair.sim.air.atmosphere import STANDARD_GRAVITY_M_S2, Air, standard_atmosphere
from dockair.sim.aircraft.aerodynamics import AirframeParameters
from dockair.sim.aircraft.flight_control import FlightControlParameters
from dockair.sim.aircraft.gain_schedule import NODE_RAD, Design, GainSchedule, roll_pitch_yaw
from dockair.sim.aircraft.trim import level_trim, steady_trim

AIRFRAME = load_parameters("airframe", AirframeParameters)
PARAMETERS = load_parameters("flight_control", FlightControlParameters)
AIR = standard_atmosphere(6000.0)


def _schedule(airspeed_m_s: float, air: Air, airframe: AirframeParameters = AIRFRAME) -> GainSchedule:
    wanted = Design(
        point_B=np.array([6.0, -0.9, 0.6]),
        feedback=PARAMETERS.tolerances,
        busy=PARAMETERS.busy_tolerances,
        following=PARAMETERS.following_tolerances,
        gust_1_s=0.34,
        swing=PARAMETERS.swing,
    )
    return GainSchedule(airframe, air, level_trim(airframe, airspeed_m_s, air), wanted)


@pytest.fixture(scope="module")
def schedule() -> GainSchedule:
    return _schedule(180.0, AIR)


def test_roll_pitch_yaw_are_the_angles_of_three_rotations() -> None:
    angles = np.array([-0.4, 0.1, 0.05])
    R = exp(angles[2] * np.eye(3)[2]) @ exp(angles[1] * np.eye(3)[1]) @ exp(angles[0] * np.eye(3)[0])
    np.testing.assert_allclose(roll_pitch_yaw(R), angles, atol=1e-12)


def test_straight_flight_has_the_trim_and_the_gains_it_was_designed_with(schedule: GainSchedule) -> None:
    row, trim = schedule.at(0.0), level_trim(AIRFRAME, 180.0, AIR)
    np.testing.assert_array_equal(row.A, schedule.model.A)
    np.testing.assert_array_equal(row.K, schedule.gains.K)
    np.testing.assert_allclose(row.trim[:3], [0.0, -trim.pitch_rad, 0.0], atol=1e-12)


def test_the_record_that_the_control_law_reads_is_the_row_itself(schedule: GainSchedule) -> None:
    row = schedule.at(0.013)
    for name in row.memory.dtype.names or ():
        assert np.shares_memory(row.memory[name], getattr(row, name))
        np.testing.assert_array_equal(row.memory[name], getattr(row, name))


@pytest.mark.parametrize("bank_deg", [7.5, 12.5, -22.5])
def test_between_the_nodes_the_trim_is_that_of_a_steady_turn(schedule: GainSchedule, bank_deg: float) -> None:
    """Half-way, where the line is farthest off: bank within 0.1, surfaces within 0.15 degrees, thrust within 1 %."""
    rate = STANDARD_GRAVITY_M_S2 * np.tan(np.radians(bank_deg)) / 180.0
    row, turn = schedule.at(rate), steady_trim(AIRFRAME, 180.0, AIR, turn_rate_rad_s=rate)
    assert row.trim[0] == pytest.approx(turn.bank_rad, abs=np.radians(0.1))
    np.testing.assert_allclose(row.trim[3:6], turn.w_WB_B, atol=2e-4)
    np.testing.assert_allclose(row.trim[6:9], turn.surfaces_rad, atol=np.radians(0.15))
    assert row.trim[9] * AIRFRAME.mass_kg == pytest.approx(turn.thrust_n, rel=0.01)


def test_gains_are_continuous_across_a_node(schedule: GainSchedule) -> None:
    rate = STANDARD_GRAVITY_M_S2 * np.tan(NODE_RAD) / 180.0
    below, above = schedule.at(rate * (1.0 - 1e-9)).K, schedule.at(rate * (1.0 + 1e-9)).K
    np.testing.assert_allclose(below, above, atol=1e-6 * np.abs(below).max())


@pytest.mark.parametrize("bank_deg", [30.5, -33.0])
def test_a_turn_that_can_be_flown_has_a_trim_though_the_next_node_has_none(bank_deg: float) -> None:
    """At 200 m/s and 12 km military thrust bears 34.5 degrees of bank and not 35: the line from 25 and 30 goes on."""
    thin, rate = standard_atmosphere(12000.0), STANDARD_GRAVITY_M_S2 * np.tan(np.radians(bank_deg)) / 200.0
    schedule = _schedule(200.0, thin)
    row, turn = schedule.at(rate), steady_trim(AIRFRAME, 200.0, thin, turn_rate_rad_s=rate)
    assert row.trim[0] == pytest.approx(turn.bank_rad, abs=np.radians(0.01))
    np.testing.assert_allclose(row.trim[6:9], turn.surfaces_rad, atol=np.radians(0.03))
    assert row.trim[9] * AIRFRAME.mass_kg == pytest.approx(turn.thrust_n, rel=0.015)
    with pytest.raises(DockairError, match="turning at"):
        schedule.at(1.3 * rate)


def test_in_flight_the_last_row_is_kept_in_a_turn_that_cannot_be_flown() -> None:
    """A receiver that had fallen behind turned so: its flight was lost as invalid input, after a minute."""
    thin, rate = standard_atmosphere(12000.0), STANDARD_GRAVITY_M_S2 * np.tan(np.radians(30.5)) / 200.0
    schedule = _schedule(200.0, thin)
    last = schedule.nearest(rate)
    assert last is schedule.at(rate)
    for beyond in (1.3 * rate, 1.4 * rate, 1.3 * rate):
        assert schedule.nearest(beyond) is last
    assert schedule.nearest(0.5 * rate) is not last
    with pytest.raises(DockairError, match="turning at"):
        schedule.at(1.3 * rate)


@pytest.mark.parametrize("sense", [1.0, -1.0])
def test_a_turn_is_refused_where_the_airframe_flies_straight_and_not_even_the_first_node(sense: float) -> None:
    """Military thrust a hundred-thousandth above that of level flight: no line leads on, for there is but one node."""
    level = level_trim(AIRFRAME, 180.0, AIR)
    share = 1.00001 * level.thrust_n / level.thrust_range.military_n
    weak = replace(AIRFRAME, military_thrust_n=share * AIRFRAME.military_thrust_n)
    schedule = _schedule(180.0, AIR, weak)
    with pytest.raises(DockairError, match="turning at"):
        schedule.at(sense * STANDARD_GRAVITY_M_S2 * np.tan(0.5 * NODE_RAD) / 180.0)
    assert schedule.at(0.0).trim[9] == pytest.approx(level.thrust_n / AIRFRAME.mass_kg)


def test_turn_without_a_trim_is_refused(schedule: GainSchedule) -> None:
    with pytest.raises(DockairError, match="turning at"):
        schedule.at(0.4)
