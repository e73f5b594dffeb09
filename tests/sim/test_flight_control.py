"""The flight control by itself; flown on a rigid body it is in test_receiver.py, its gains are in test_regulator.py."""

import copy

import numpy as np
import pytest

from dockair.messages import ReceiverCommand
from dockair.parameters import load_parameters
from dockair.sim.air.atmosphere import standard_atmosphere
from dockair.sim.aircraft.aerodynamics import AirframeParameters
from dockair.sim.aircraft.flight_control import FlightControl, FlightControlParameters
from dockair.sim.aircraft.trim import level_trim, steady_trim

AIRFRAME = load_parameters("airframe", AirframeParameters)
PARAMETERS = load_parameters("flight_control", FlightControlParameters)


PROBE_B = np.array([6.0, -0.9, 0.6])
AIR = standard_atmosphere(6000.0)


def control(step_s: float = 1e-3) -> FlightControl:
    trim = level_trim(AIRFRAME, 180.0, AIR)
    return FlightControl(PARAMETERS, AIRFRAME, trim=trim, air=AIR, probe_B=PROBE_B, step_s=step_s)


def commands(design: FlightControl, velocity_W: np.ndarray, **said: object) -> np.ndarray:
    """(4,) of one tick at the attitude of trim in still air."""
    trim = level_trim(AIRFRAME, 180.0, AIR)
    force_B, _ = trim.aerodynamics.force_and_moment(trim.R_WB.T @ velocity_W, np.zeros(3), trim.surfaces_rad)
    force_B[0] += trim.thrust_n
    surfaces_rad, thrust_n = design.step(
        R_WB=trim.R_WB,
        w_WB_B=np.zeros(3),
        velocity_W=velocity_W,
        airspeed_m_s=float(np.linalg.norm(velocity_W)),
        specific_force_B=force_B / AIRFRAME.mass_kg,
        surfaces_rad=trim.surfaces_rad,
        thrust_n=trim.thrust_n,
        command=ReceiverCommand(**said),  # type: ignore[arg-type]
    )
    return np.append(surfaces_rad, thrust_n)


def test_control_finds_the_gust_that_explains_airspeed_and_accelerometers() -> None:
    """The plant flown through a small gust at trim; at engagement the estimate is the measurement, unfiltered."""
    trim, gust_W = level_trim(AIRFRAME, 180.0, AIR), np.array([0.05, -0.04, 0.03])
    design = control()
    velocity_W = np.array([180.0, 0.0, 0.0])
    v_air_B = trim.R_WB.T @ (velocity_W - gust_W)
    force_B, _ = trim.aerodynamics.force_and_moment(v_air_B, np.zeros(3), trim.surfaces_rad)
    force_B[0] += trim.thrust_n
    design.step(
        R_WB=trim.R_WB,
        w_WB_B=np.zeros(3),
        velocity_W=velocity_W,
        airspeed_m_s=float(np.linalg.norm(v_air_B)),
        specific_force_B=force_B / AIRFRAME.mass_kg,
        surfaces_rad=trim.surfaces_rad,
        thrust_n=trim.thrust_n,
        command=ReceiverCommand(),
    )
    np.testing.assert_allclose(design.gust_W, gust_W, atol=1e-3)


def test_control_engages_without_a_bump() -> None:
    """Half a metre per second off the path, and no command to hurry back: the first commands are those of trim."""
    trim = level_trim(AIRFRAME, 180.0, AIR)
    first = commands(control(), np.array([180.5, 0.4, -0.3]))
    np.testing.assert_allclose(first[:3], trim.surfaces_rad, atol=np.radians(2.0))
    assert abs(first[3] - trim.thrust_n) < 0.2 * trim.thrust_n


@pytest.mark.parametrize("axis", range(3), ids=["forward", "left", "up"])
def test_commands_go_the_right_way(axis: int) -> None:
    """After 0.3 s: more thrust to speed up; left aileron and rudder to go left; trailing edge up to climb."""
    design, trim = control(1e-2), level_trim(AIRFRAME, 180.0, AIR)
    for _ in range(30):
        u = commands(design, np.array([180.0, 0.0, 0.0]), velocity_m_s=np.eye(3)[axis])
    beyond = u - np.append(trim.surfaces_rad, trim.thrust_n)
    right_way = ((3, 1.0), (2, 1.0), (0, -1.0))[axis]
    assert beyond[right_way[0]] * right_way[1] > 0.0


def test_commanded_turn_moves_the_trim_to_that_of_the_turn() -> None:
    """Held turn rate: path and row of the schedule arrive at the steady turn's bank, surfaces and thrust."""
    design, rate = control(1e-2), 0.025
    for _ in range(1500):
        commands(design, np.array([180.0, 0.0, 0.0]), turn_rate_rad_s=rate)
    row, turn = design.schedule.at(design.path.turn_rate_rad_s), steady_trim(AIRFRAME, 180.0, AIR, turn_rate_rad_s=rate)
    assert design.path.turn_rate_rad_s == pytest.approx(rate, rel=2e-3)
    assert row.trim[0] == pytest.approx(turn.bank_rad, abs=2e-3)
    np.testing.assert_allclose(row.trim[6:9], turn.surfaces_rad, atol=1e-3)
    assert row.trim[9] * AIRFRAME.mass_kg == pytest.approx(turn.thrust_n, rel=0.02)


def test_integral_is_held_while_an_actuator_is_at_its_limit() -> None:
    """A speed 40 m/s too low asks for more than military thrust: nothing is added up."""
    design = control(1e-2)
    commands(design, np.array([180.0, 0.0, 0.0]))
    for _ in range(50):
        u = commands(design, np.array([140.0, 0.0, 0.0]))
    assert u[3] == pytest.approx(level_trim(AIRFRAME, 180.0, AIR).thrust_range.military_n)
    np.testing.assert_array_equal(design._memory["z"], 0.0)


def test_a_copy_goes_on_as_the_original_would_have_and_leaves_it_alone() -> None:
    one, off_path = control(1e-2), np.array([180.3, 0.2, -0.1])
    for _ in range(20):
        commands(one, off_path, turn_rate_rad_s=0.01)
    two = copy.deepcopy(one)
    ahead = [commands(two, off_path, velocity_m_s=np.ones(3)) for _ in range(20)]
    np.testing.assert_array_equal([commands(one, off_path, velocity_m_s=np.ones(3)) for _ in range(20)], ahead)
    assert not np.shares_memory(one._memory["x_m"], two._memory["x_m"])
    assert not np.shares_memory(one.model.R_WB, two.model.R_WB)
