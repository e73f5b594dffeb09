"""The flight control by itself; flown on a rigid body it is in test_receiver.py, its gains are in test_regulator.py."""

import copy
from dataclasses import fields, replace
from typing import Any

import numpy as np
import pytest

from dockair.messages import ReceiverCommand
from dockair.parameters import load_parameters
from dockair.rotations import exp
from dockair.sim.air.atmosphere import standard_atmosphere
from dockair.sim.aircraft.aerodynamics import AirframeParameters
from dockair.sim.aircraft.flight_control import FlightControl, FlightControlParameters
from dockair.sim.aircraft.linear_model import linear_model
from dockair.sim.aircraft.regulator import design as gains_of
from dockair.sim.aircraft.regulator import tip_velocity
from dockair.sim.aircraft.trim import level_trim, steady_trim

AIRFRAME = load_parameters("airframe", AirframeParameters)
PARAMETERS = load_parameters("flight_control", FlightControlParameters)


PROBE_B = np.array([6.0, -0.9, 0.6])
AIR = standard_atmosphere(6000.0)
TOLERANCES = {  # of a part: the sheet's keys
    "velocity_m_s": "velocity_tolerance_m_s",
    "integral_m": "integral_tolerance_m",
    "attitude_rad": "attitude_tolerance_rad",
    "rate_rad_s": "rate_tolerance_rad_s",
    "surfaces_rad": "surface_tolerance_rad",
    "thrust_m_s2": "thrust_tolerance_m_s2",
}
ZERO, AHEAD = np.zeros(3), np.array([180.0, 0.0, 0.0])


def control(step_s: float = 1e-3) -> FlightControl:
    trim = level_trim(AIRFRAME, 180.0, AIR)
    return FlightControl(PARAMETERS, AIRFRAME, trim=trim, air=AIR, probe_B=PROBE_B, step_s=step_s)


def force_of(velocity_W: np.ndarray, R_WB: np.ndarray, w_WB_B: np.ndarray) -> np.ndarray:
    """(3,) specific force on the aircraft in still air, surfaces and thrust of trim, body axes."""
    trim = level_trim(AIRFRAME, 180.0, AIR)
    force_B, _ = trim.aerodynamics.force_and_moment(R_WB.T @ velocity_W, w_WB_B, trim.surfaces_rad)
    return np.asarray((force_B + [trim.thrust_n, 0.0, 0.0]) / AIRFRAME.mass_kg)


def commands(
    design: FlightControl,
    velocity_W: np.ndarray,
    *,
    gust_W: np.ndarray = ZERO,
    turn: np.ndarray = ZERO,
    w_WB_B: np.ndarray = ZERO,
    felt_B: np.ndarray | None = None,
    **said: object,
) -> np.ndarray:
    """(4,) of one tick, in still air unless there is a gust, at the attitude of trim unless that is turned."""
    trim = level_trim(AIRFRAME, 180.0, AIR)
    R_WB, air_W = exp(turn) @ trim.R_WB, velocity_W - gust_W
    surfaces_rad, thrust_n = design.step(
        R_WB=R_WB,
        w_WB_B=w_WB_B,
        velocity_W=velocity_W,
        airspeed_m_s=float(np.linalg.norm(air_W)),
        specific_force_B=force_of(air_W, R_WB, w_WB_B) if felt_B is None else felt_B,
        surfaces_rad=trim.surfaces_rad,
        thrust_n=trim.thrust_n,
        command=ReceiverCommand(**said),  # type: ignore[arg-type]
    )
    return np.append(surfaces_rad, thrust_n)


def test_control_finds_the_gust_that_explains_airspeed_and_accelerometers() -> None:
    """The plant flown through a small gust at trim; at engagement the estimate is the measurement, unfiltered."""
    design, gust_W = control(), np.array([0.05, -0.04, 0.03])
    commands(design, AHEAD, gust_W=gust_W)
    np.testing.assert_allclose(design.gust_W, gust_W, atol=1e-3)


def test_gust_that_sets_in_in_flight_is_believed_through_the_sheets_low_pass() -> None:
    design, at_once, gust_W = control(), control(), np.array([0.05, -0.04, 0.03])
    commands(at_once, AHEAD, gust_W=gust_W)
    commands(design, AHEAD)
    for _ in range(40):
        commands(design, AHEAD, gust_W=gust_W)
    share = 1.0 - np.exp(-0.040 * PARAMETERS.gust_bandwidth_rad_s)
    assert 0.1 < share < 0.9
    np.testing.assert_allclose(design.gust_W, share * at_once.gust_W, rtol=1e-9, atol=1e-12)


def test_force_that_the_accelerometers_feel_late_is_no_gust() -> None:
    """The aircraft is set across the path at once; what is felt comes to that with the sensors' lag."""
    design, beside = control(), AHEAD + [0.0, 0.4, -0.3]
    commands(design, AHEAD)
    before, after = (force_of(velocity, level_trim(AIRFRAME, 180.0, AIR).R_WB, ZERO) for velocity in (AHEAD, beside))
    for k in range(1, 30):
        felt_B = after + (before - after) * np.exp(-1e-3 * k / PARAMETERS.inertial_lag_s)
        commands(design, beside, felt_B=felt_B)
        np.testing.assert_allclose(design.gust_W, 0.0, atol=1e-9)


def test_attitude_is_carried_on_over_the_sensors_lag() -> None:
    """R exp(w lag); what is left is of third order, 2e-5, in an angle of 0.05."""
    design, turn, w = control(), np.array([0.3, -0.1, 0.2]), np.array([2.0, -1.5, 1.0])
    commands(design, AHEAD, turn=turn, w_WB_B=w)
    R_WB = exp(turn) @ level_trim(AIRFRAME, 180.0, AIR).R_WB
    now = R_WB @ exp(w * PARAMETERS.inertial_lag_s)
    assert np.abs(now - R_WB).max() > 0.02
    np.testing.assert_allclose(design._memory["R_now"], now, atol=4e-5)


def test_state_has_the_tips_velocity_however_far_the_body_is_turned_from_trim() -> None:
    """C x against the velocity of a point of a rigid body; level path along W's x, attitude of now."""
    design, w, velocity_W = control(), np.array([0.4, -0.2, 0.3]), np.array([179.0, 1.0, -2.0])
    commands(design, velocity_W, turn=np.array([0.5, 0.0, 0.0]), w_WB_B=w)
    tip_W = velocity_W + design._memory["R_now"] @ np.cross(w, PROBE_B)
    np.testing.assert_allclose(design.schedule.at(0.0).C @ design._memory["x"], tip_W - AHEAD, atol=1e-9)


def test_attitude_in_the_state_is_the_rotation_from_trim_however_large_it_is() -> None:
    design, turn = control(), np.array([1.2, -0.5, 0.8])
    commands(design, AHEAD, turn=turn)
    np.testing.assert_allclose(design._memory["x"][3:6], turn, atol=1e-9)


def test_states_of_aircraft_and_model_are_beyond_the_turn_and_the_slope_that_the_path_flies() -> None:
    """Rates, surfaces and thrust per mass; the slope adds its part of the weight to the thrust of the level turn."""
    design, w, level = control(1e-2), np.array([0.1, -0.2, 0.3]), level_trim(AIRFRAME, 180.0, AIR)
    flown: dict[str, Any] = {"turn_rate_rad_s": 0.03, "climb_rad": 0.05, "w_WB_B": w}
    for _ in range(150):
        commands(design, AHEAD, **flown)
    model = np.concatenate([design.model.w_WB_B, design.model.actuators])
    commands(design, AHEAD, **flown)
    row, slope = design.schedule.at(design.path.turn_rate_rad_s), design.path.climb_rad
    assert np.abs(row.trim[4:6]).min() > 1e-3 and slope > 0.02
    trim = row.trim[3:] + [*np.zeros(6), 9.80665 * np.sin(slope)]
    aircraft = np.concatenate([w, level.surfaces_rad, [level.thrust_n / AIRFRAME.mass_kg]])
    np.testing.assert_allclose(design._memory["x"][6:], aircraft - trim, rtol=0.0, atol=1e-12)
    np.testing.assert_allclose(design._memory["x_m"][6:13], model - trim, rtol=0.0, atol=1e-12)


def test_models_rates_are_as_late_as_the_measured_ones() -> None:
    """The sum of all rates so far, each with the weight that the lag's exponential leaves it."""
    design, rates, late = control(), [], []
    for _ in range(60):
        commands(design, AHEAD, velocity_m_s=np.array([0.0, 1.0, 1.0]), acceleration_m_s2=np.array([0.0, 2.0, 2.0]))
        rates.append(design._memory["x_m"][6:9].copy())
        late.append(design._memory["w_m"].copy())
    keep = np.exp(-1e-3 / PARAMETERS.inertial_lag_s)
    weights = (1.0 - keep) * keep ** np.arange(60)[::-1]
    assert np.abs(rates[-1]).max() > 1e-3
    np.testing.assert_allclose(late[-1], weights @ np.array(rates), rtol=1e-9, atol=1e-15)


@pytest.mark.parametrize(("share", "left"), [(0.5, 1.0), (1.5, 0.5), (-1.5, 0.5), (2.5, 0.0)])
def test_reference_to_the_side_is_taken_back_with_the_bank_that_the_model_flies(share: float, left: float) -> None:
    """Eq. (2) of `reference`: whole up to the sheet's first bank, none from the second on, up it stays; one tick."""
    (first, last), jerks = PARAMETERS.increment_bank_rad, []
    for part in (0.0, share):
        beyond = abs(part) - 1.0
        bank = np.sign(part) * (first + beyond * (last - first) if beyond > 0.0 else first * abs(part))
        design = control()
        commands(design, AHEAD)
        design.model.R_WB[:] = exp(np.array([bank, 0.0, 0.0])) @ design.model.R_WB
        commands(design, AHEAD, acceleration_m_s2=np.array([0.0, 20.0, 20.0]))
        jerks.append(design.reference.chain[2].copy())
    assert np.abs(jerks[0][1:]).min() > 0.1
    np.testing.assert_allclose(jerks[1][1:], jerks[0][1:] * [left, 1.0], rtol=1e-6, atol=1e-9)


def test_busy_surfaces_get_the_gains_for_busy_surfaces() -> None:
    """From one state, with b of `rate_relief` at 1 and at 0: the commands differ by (K - K_busy) times the error."""
    design = control()
    commands(design, AHEAD)
    busy, row, m = copy.deepcopy(design), design.schedule.at(0.0), design._memory
    busy._relief.memory["busy"] = 1.0
    beside, scale = AHEAD + [0.02, 0.03, -0.02], np.array([1.0, 1.0, 1.0, AIRFRAME.mass_kg])
    calm_u, busy_u = (commands(each, beside) / scale for each in (design, busy))
    error = np.concatenate([m["x"] - m["x_m"][: len(m["x"])], ZERO, m["gust"]])
    assert np.abs(busy_u - calm_u).max() > 1e-4
    np.testing.assert_allclose(busy_u - calm_u, (row.K - row.K_busy) @ error, rtol=1e-6, atol=1e-9)


def test_control_engages_without_a_bump() -> None:
    """Half a metre per second off the path, and no command to hurry back: the first commands are those of trim."""
    trim = level_trim(AIRFRAME, 180.0, AIR)
    first = commands(control(), np.array([180.5, 0.4, -0.3]))
    np.testing.assert_allclose(first[:3], trim.surfaces_rad, atol=np.radians(2.0))
    assert abs(first[3] - trim.thrust_n) < 0.2 * trim.thrust_n


def test_started_in_air_that_sinks_it_commands_that_trim_as_nearly_as_three_integrals_allow() -> None:
    """Least squares leave a remainder across what the integrals can do, in radians over limits and m/s^2 over g."""
    sink, per = steady_trim(AIRFRAME, 180.0, AIR, downwash_m_s=4.0), [*AIRFRAME.surface_limits_rad, 9.80665]
    wanted = np.append(sink.surfaces_rad, sink.thrust_n / AIRFRAME.mass_kg)
    missed = []
    for design in (control(), control()):
        if missed:
            design.start_in(sink)
        surfaces_rad, thrust_n = design.step(
            R_WB=sink.R_WB,
            w_WB_B=sink.w_WB_B,
            velocity_W=sink.velocity_W,
            airspeed_m_s=float(np.linalg.norm(sink.velocity_W - sink.air_velocity_W)),
            specific_force_B=sink.R_WB[2] * 9.80665,
            surfaces_rad=sink.surfaces_rad,
            thrust_n=sink.thrust_n,
            command=ReceiverCommand(),
        )
        by_integrals = design.schedule.at(0.0).K[:, 13:16] / np.reshape(per, (4, 1))
        missed.append(by_integrals.T @ ((np.append(surfaces_rad, thrust_n / AIRFRAME.mass_kg) - wanted) / per))
    assert np.linalg.norm(missed[0]) > 1e-4
    np.testing.assert_allclose(missed[1], 0.0, atol=1e-6 * np.linalg.norm(missed[0]))


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


@pytest.mark.parametrize(("speed_m_s", "end"), [(140.0, "military_n"), (220.0, "idle_n")])
def test_integral_is_held_while_an_actuator_is_at_its_limit(speed_m_s: float, end: str) -> None:
    """A speed 40 m/s too low asks for more than military thrust, one too high for less than idle: nothing is added."""
    design = control(1e-2)
    commands(design, np.array([180.0, 0.0, 0.0]))
    for _ in range(50):
        u = commands(design, np.array([speed_m_s, 0.0, 0.0]))
    assert u[3] == pytest.approx(getattr(level_trim(AIRFRAME, 180.0, AIR).thrust_range, end))
    np.testing.assert_array_equal(design._memory["z"], 0.0)


@pytest.mark.parametrize("stuck", range(4), ids=["elevator", "aileron", "rudder", "thrust"])
def test_both_integrals_are_held_whichever_actuator_is_at_its_limit(stuck: int) -> None:
    """One that cannot leave a place beside that of trim, while the other three are free."""
    trim, design = level_trim(AIRFRAME, 180.0, AIR), control(1e-2)
    at = np.append(trim.surfaces_rad, trim.thrust_n / AIRFRAME.mass_kg)[stuck] + 1e-3
    design._memory["limits"][:, stuck] = at
    for _ in range(20):
        u = commands(design, np.array([180.3, 0.2, -0.1]), velocity_m_s=np.array([0.4, 0.3, 0.2]))
    u[3] /= AIRFRAME.mass_kg
    lowest, highest = design._memory["limits"]
    assert ((lowest < u) & (u < highest)).tolist() == [i != stuck for i in range(4)]
    np.testing.assert_array_equal(design._memory["z"], 0.0)
    np.testing.assert_array_equal(design._memory["x_m"][13:], 0.0)


def test_models_integral_adds_up_its_velocity_less_the_reference_and_is_held_while_its_command_is_at_a_limit() -> None:
    """Eq. (1); the second control has no thrust beyond that of trim."""
    free, held, step_s, expected = control(1e-2), control(1e-2), 1e-2, np.zeros(3)
    held._memory["limits"][1, 3] = level_trim(AIRFRAME, 180.0, AIR).thrust_n / AIRFRAME.mass_kg
    for _ in range(30):
        for design in (free, held):
            commands(design, AHEAD, velocity_m_s=np.array([0.4, 0.3, 0.2]))
        x_m, c = free._memory["x_m"], free.reference.memory["chain"][0]
        expected += step_s * (free.schedule.at(0.0).C @ x_m[:13] - c)
        assert held._memory["commands_m"][3] == held._memory["limits"][1, 3]
    assert np.abs(expected).min() > 1e-5
    np.testing.assert_allclose(free._memory["x_m"][13:], expected, rtol=1e-9)
    np.testing.assert_array_equal(held._memory["x_m"][13:], 0.0)


def test_a_copy_goes_on_as_the_original_would_have_and_leaves_it_alone() -> None:
    one, off_path = control(1e-2), np.array([180.3, 0.2, -0.1])
    for _ in range(20):
        commands(one, off_path, turn_rate_rad_s=0.01)
    two = copy.deepcopy(one)
    ahead = [commands(two, off_path, velocity_m_s=np.ones(3)) for _ in range(20)]
    np.testing.assert_array_equal([commands(one, off_path, velocity_m_s=np.ones(3)) for _ in range(20)], ahead)
    assert not np.shares_memory(one._memory["x_m"], two._memory["x_m"])
    assert not np.shares_memory(one.model.R_WB, two.model.R_WB)


def test_every_number_of_the_sheet_arrives_where_its_key_says() -> None:
    """In a sheet without two equal numbers; a part's keys are its fields' names and what they are of."""
    sheet = {}
    for k, field in enumerate(fields(PARAMETERS)):
        size = np.size(getattr(PARAMETERS, field.name))
        sheet[field.name] = 10.0 * k + (np.arange(size) if size > 1 else 0.0)
    told = replace(PARAMETERS, **sheet)
    keys: dict[str, dict[str, str]] = {
        "own_sensors": {},
        "path": {name: f"path_{name}" for name in ("bandwidth_rad_s", "damping", "catching_up")},
        "relief": {name: f"relief_{name}" for name in ("time_s", "busy_share", "least", "stop_share")},
        "swing": {name: f"swing_{name}" for name in ("frequency_rad_s", "damping")},
        "tolerances": TOLERANCES,
        "following_tolerances": {name: f"following_{key}" for name, key in TOLERANCES.items()},
        "reference_limits": {
            "gain_1_s": "reference_gain_1_s",
            "bandwidth_rad_s": "smoothing_bandwidth_rad_s",
            "damping": "smoothing_damping",
            "acceleration_m_s2": "acceleration_limit_m_s2",
            "jerk_m_s3": "jerk_limit_m_s3",
            "velocity_m_s": "velocity_limit_m_s",
            "bank_rad": "increment_bank_rad",
        },
    }
    for part, renamed in keys.items():
        group = getattr(told, part)
        for field in fields(group):
            expected = sheet[renamed.get(field.name, field.name)]
            np.testing.assert_array_equal(getattr(group, field.name), expected, err_msg=f"{part}.{field.name}")
    relaxed = ("velocity_m_s", "integral_m", "attitude_rad", "rate_rad_s")
    factors = dict(zip(relaxed, told.busy_tolerance_factors, strict=True))
    for field in fields(told.tolerances):
        expected = factors.get(field.name, 1.0) * getattr(told.tolerances, field.name)
        np.testing.assert_array_equal(getattr(told.busy_tolerances, field.name), expected)


def test_gains_are_designed_for_gusts_that_pass_at_the_airspeed_over_the_sheets_length() -> None:
    """V/L in dg/dt = -(V/L) g, and the sheet's weights, each in its place."""
    p, trim = PARAMETERS, level_trim(AIRFRAME, 180.0, AIR)
    weights = p.tolerances, p.busy_tolerances, p.following_tolerances
    plant, C = linear_model(AIRFRAME, trim), tip_velocity(trim.R_WB, PROBE_B)
    expected, ours = gains_of(plant, C, *weights, 180.0 / p.gust_length_m, p.swing), control().schedule.gains
    for name in ("K", "K_busy", "K_followed", "K_command"):
        np.testing.assert_allclose(getattr(ours, name), getattr(expected, name), rtol=1e-9, atol=1e-12)


def test_feedback_is_equation_2_with_the_models_rates_as_late_as_the_measured_ones() -> None:
    design = control()
    for _ in range(60):
        before = design._memory["x_m"][13:].copy(), design._memory["z"].copy()
        u = commands(design, AHEAD, velocity_m_s=np.array([0.0, 1.0, 1.0]), acceleration_m_s2=np.array([0.0, 2.0, 2.0]))
    m, row, chain = design._memory, design.schedule.at(0.0), design.reference.memory["chain"]
    x_m = np.append(m["x_m"][:13], before[0])
    late = m["x"] - np.concatenate([m["x_m"][:6], m["w_m"], m["x_m"][9:13]])
    expected = m["trim"][6:10] - row.K_followed @ x_m - row.K_command @ chain[:3].ravel()
    h = design._relief.haste
    expected -= ((1.0 - h) * row.K + h * row.K_busy) @ np.concatenate([late, before[1], m["gust"]])
    u[3] /= AIRFRAME.mass_kg
    assert np.abs(m["w_m"] - m["x_m"][6:9]).max() > 1e-4
    np.testing.assert_allclose(u, expected, rtol=1e-9, atol=1e-12)
