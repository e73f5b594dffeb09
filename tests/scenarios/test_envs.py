"""The environments keep gymnasium's contract, are determined by their seeds, and observe no truth."""

import hashlib
import re
import subprocess
import sys
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import gymnasium
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env

import dockair
from dockair.errors import DockairError
from dockair.messages import CameraFrame, LedObservation, ReceiverCommand, Window
from dockair.rotations import exp, matrix_from_yaw_pitch_roll
from dockair.scenarios.envs import DockEnv, DockFastEnv, DockPixelsEnv
from dockair.scenarios.envs import episode as envs_episode
from dockair.scenarios.envs.judge import AttemptJudge
from dockair.scenarios.envs.tables import (
    ACTION,
    LOOSE_CONTACT_REWARD,
    OBSERVATION,
    OUTCOME_REWARD,
    PIXEL_STATE,
    UNSAFE_REWARD,
    Entry,
    action_cost,
    box,
    clipped,
    observation_from,
    outcome_reward,
    truth_info,
)
from dockair.scenarios.judgement.attempts import Attempt
from dockair.scenarios.judgement.referee import Contact, Outcome, Referee
from dockair.scenarios.loop import Flight, Tick
from dockair.scenarios.schema import load_scenario

#: The world without camera: what is tested here does not depend on who navigates.
QUICK = "truth_navigation"
IDS = tuple(dockair.ENVIRONMENTS)
#: The checker recommends actions in [-1, 1]; ours are in units (gymnasium.wrappers.RescaleAction changes that).
allow_units = pytest.mark.filterwarnings("ignore:.*symmetric and normalized space")
PAGE = Path(__file__).parents[2] / "docs" / "environments.md"


@pytest.fixture(scope="module")
def env():
    """One for all tests: each resets it as it needs."""
    made = DockEnv(QUICK, ticks_per_step=5)
    yield made
    made.close()


def _fly(env: gymnasium.Env, seed: int, steps: int) -> list[tuple]:
    rng = np.random.default_rng(1)
    history: list[tuple] = [env.reset(seed=seed)]
    for _ in range(steps):
        history.append(env.step(rng.uniform(-0.5, 0.5, 6).astype(np.float32)))
    return history


def _same(a, b) -> bool:
    if isinstance(a, dict):
        return a.keys() == b.keys() and all(_same(a[key], b[key]) for key in a)
    if isinstance(a, tuple):
        return all(_same(x, y) for x, y in zip(a, b, strict=True))
    return np.array_equal(a, b)


def _digest(value) -> str:
    digest = hashlib.blake2b()

    def take(x) -> None:
        if isinstance(x, dict):
            for key in sorted(x):
                digest.update(key.encode())
                take(x[key])
        elif isinstance(x, tuple | list):
            for one in x:
                take(one)
        else:
            digest.update(x.encode() if isinstance(x, str) else np.asarray(x).tobytes())

    take(value)
    return digest.hexdigest()


def roll_out(name: str, steps: int) -> str:
    """Digest of everything that an environment returns, for a process of its own."""
    made = gymnasium.make(name, ticks_per_step=4)
    try:
        return _digest(_fly(made, 21, steps))
    finally:
        made.close()


@pytest.mark.slow
@pytest.mark.gl
@pytest.mark.timeout(900)
@allow_units
@pytest.mark.parametrize("name", IDS)
def test_each_registered_environment_passes_the_checker(name):
    made = gymnasium.make(name, render_mode="rgb_array")
    try:
        check_env(made.unwrapped, skip_render_check=True)  # it would open the viewer; tested below
    finally:
        made.close()


@pytest.mark.slow
@pytest.mark.timeout(600)
@pytest.mark.parametrize("name", ["dockair/DockFast-v0", "dockair/DockPixels-v0"])
def test_a_roll_out_is_the_same_to_the_bit_in_another_process(name):
    """The other process runs this very file, which it cannot import by a name."""
    script = f"import runpy; print(runpy.run_path({str(Path(__file__))!r})['roll_out']({name!r}, 12))"
    elsewhere = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=True, timeout=300)
    assert elsewhere.stdout.split()[-1] == roll_out(name, 12)


@pytest.mark.slow
def test_the_first_observation_after_a_reset_is_a_new_environments(env):
    env.reset(seed=2)
    for _ in range(4):
        env.step(env.action_space.sample())
    again = env.reset(seed=9)
    fresh = DockEnv(QUICK, ticks_per_step=5)
    assert _same(again, fresh.reset(seed=9))
    fresh.close()


@pytest.mark.slow
def test_the_same_seed_is_the_same_flight_and_another_is_another(env):
    first, again, other = _fly(env, 11, 12), _fly(env, 11, 12), _fly(env, 12, 12)
    assert all(_same(a, b) for a, b in zip(first, again, strict=True))
    assert not np.array_equal(first[-1][0], other[-1][0])


@pytest.mark.slow
def test_without_a_seed_the_environment_draws_the_next_flight_from_its_own_generator(env):
    env.reset(seed=3)
    second = env.reset()[0]
    third = env.reset()[0]
    env.reset(seed=3)
    assert np.array_equal(env.reset()[0], second)
    assert not np.array_equal(second, third)


@pytest.mark.slow
def test_a_seed_among_the_options_chooses_the_flight(env):
    assert _same(env.reset(seed=1, options={"seed": 5}), env.reset(seed=5))


def test_shaping_sums_to_the_distance_made_good_and_observations_are_new_objects(env):
    """With zero action nothing is subtracted: the sum of rewards is the distance at the start less that at the end."""
    _, start = env.reset(seed=4)
    steps = [env.step(np.zeros(6, np.float32)) for _ in range(10)]
    made_good = start["truth"]["distance_m"] - steps[-1][4]["truth"]["distance_m"]
    assert sum(step[1] for step in steps) == pytest.approx(made_good, abs=1e-12)
    truth, depth_m = env.tick.truth, env._flight.world.parameters.coupling.depth_m
    p_WK = truth.p_WD + truth.R_WD @ [depth_m, 0.0, 0.0]  # where the coupling holds the tip
    assert steps[-1][4]["truth"]["distance_m"] == pytest.approx(np.linalg.norm(p_WK - truth.p_WP), abs=1e-12)
    assert all(not np.shares_memory(a[0], b[0]) for a, b in zip(steps, steps[1:], strict=False))


def test_a_step_before_any_reset_is_refused():
    with pytest.raises(gymnasium.error.ResetNeeded):
        DockEnv(QUICK).step(np.zeros(6, np.float32))


def test_the_end_of_time_truncates_and_what_comes_after_is_refused(env):
    env.reset(seed=0, options={"set": {"flight.duration_s": 0.1}})
    ends = [env.step(np.zeros(6, np.float32))[2:] for _ in range(2)]
    (terminated, truncated, info) = ends[-1]
    assert (terminated, truncated) == (False, True)
    assert info["outcome"] == "timeout"
    assert not info["is_success"]
    with pytest.raises(gymnasium.error.ResetNeeded):
        env.step(np.zeros(6, np.float32))


@pytest.mark.parametrize(("offset_m", "good"), [(0.14, True), (0.16, False)])
def test_success_is_a_contact_inside_the_limits(env, monkeypatch, offset_m, good):
    env.reset(seed=0)
    measured = {"radial_offset_m": offset_m, "closure_speed_m_s": 1.2, "angle_deg": 3.0, "left_m": 0.0, "up_m": 0.0}
    contact = Attempt(number=1, begun_s=0.0, ended_s=9.0, decided_s=9.0, outcome="contact", **measured)
    monkeypatch.setattr(Referee, "attempt_log", lambda self, now_s, outcome: (contact,))
    env.step(np.zeros(6, np.float32))
    env._outcome = Outcome.CONTACT
    assert env._info()["is_success"] is good


@pytest.mark.parametrize(
    ("offset_m", "unsafe", "paid"),
    [(0.14, (), 10.0), (0.16, (), 0.0), (0.14, ("touch at 2.70 m/s",), -5.0), (0.16, ("touch at 2.70 m/s",), -5.0)],
)
def test_a_contact_is_paid_for_when_it_is_good_and_safe(env, monkeypatch, offset_m, unsafe, paid):
    """docs/environments.md#reward: who learns from the reward must not come to touch as hard as may be."""
    _, before = env.reset(seed=0)
    measured = {"radial_offset_m": offset_m, "closure_speed_m_s": 1.2, "angle_deg": 3.0, "left_m": 0.0, "up_m": 0.0}
    contact = Attempt(number=1, begun_s=0.0, ended_s=9.0, decided_s=9.0, outcome="contact", **measured)
    monkeypatch.setattr(Referee, "attempt_log", lambda self, now_s, outcome: (contact,))
    monkeypatch.setattr(Referee, "unsafe", unsafe)
    monkeypatch.setattr(AttemptJudge, "watch", lambda self, truth, touched: (False, Outcome.CONTACT))
    _, reward, terminated, _, after = env.step(np.zeros(6, np.float32))
    made_good = before["truth"]["distance_m"] - after["truth"]["distance_m"]
    assert (reward - made_good, terminated) == (pytest.approx(paid, abs=1e-12), True)


@pytest.mark.parametrize("outcome", Outcome)
def test_an_end_pays_as_tabled_if_nothing_was_unsafe_and_no_more_than_a_miss_if_it_was(outcome):
    assert outcome_reward(outcome, is_success=True, is_unsafe=False) == OUTCOME_REWARD[outcome]
    unsafe = -20.0 if outcome is Outcome.COLLISION else -5.0
    assert outcome_reward(outcome, is_success=True, is_unsafe=True) == unsafe
    poor = 0.0 if outcome is Outcome.CONTACT else OUTCOME_REWARD[outcome]
    assert outcome_reward(outcome, is_success=False, is_unsafe=False) == poor


@pytest.mark.slow
def test_the_sparse_reward_is_the_outcome_alone():
    env = DockEnv(QUICK, ticks_per_step=5, reward="sparse")
    env.reset(seed=4, options={"set": {"flight.duration_s": 0.12}})
    rewards = [env.step(np.ones(6, np.float32))[1] for _ in range(3)]
    env.close()
    assert rewards == [0.0, 0.0, OUTCOME_REWARD[Outcome.TIMEOUT]]


def test_a_full_deflection_costs_what_is_written(env):
    """0.02 per second with every axis at its limit: 0.001 in a step of 50 ms, 0.0005 with half the axes."""
    high = env.action_space.high.astype(float)
    assert action_cost(high[:3], high[3:], 0.05) == pytest.approx(0.02 * 0.05)
    assert action_cost(high[:3], np.zeros(3), 0.05) == pytest.approx(0.5 * 0.02 * 0.05)


@pytest.mark.parametrize(("of_the_limits", "cost"), [(1.0, 0.001), (2.0, 0.001), (-0.5, 0.00025)])
def test_the_dense_reward_of_a_step_is_less_by_what_holding_the_action_costs(env, of_the_limits, cost):
    """docs/environments.md: 0.02 dt mean((action / limit)^2), a step of five ticks at 100 Hz being 0.05 s."""
    _, before = env.reset(seed=4)
    _, reward, *_, after = env.step(np.float32(of_the_limits) * env.action_space.high)
    made_good = before["truth"]["distance_m"] - after["truth"]["distance_m"]
    assert made_good - reward == pytest.approx(cost, abs=1e-12)


def test_the_receiver_goes_along_where_the_tanker_has_announced_to_turn():
    """Two seconds after the start into 25 degrees of bank: without it the drogue is 15 m aside 8 s later."""
    env = gymnasium.make("dockair/DockFast-v0", scenario="racetrack", disable_env_checker=True).unwrapped
    env.reset(seed=3)
    rates = []
    while env.tick.truth.time_s < 10.0:
        wanted = env.tick.solution.command.turn_rate_rad_s
        env.step(env.tick.solution.command.velocity_m_s.tolist() + [0.0] * 3)
        rates.append(wanted)
    aside_m = np.hypot(*env.tick.truth.p_PD_B[1:])
    env.close()
    assert max(rates) > 0.02
    assert aside_m < 2.0


def test_what_is_flown_is_the_action_on_the_path_that_the_tanker_has_announced(hand_made, env):
    truth, imu, _, solution = hand_made.tick(1)
    announced = ReceiverCommand(velocity_m_s=np.full(3, 9.0), turn_rate_rad_s=0.03, climb_rad=-0.02)
    env._tick = Tick(truth=truth, imu=imu, frame=None, solution=replace(solution, command=announced), outcome=None)
    velocity, acceleration = np.array([0.1, 0.2, 0.3]), np.array([0.4, 0.5, 0.6])
    flown = env._on_the_path(ReceiverCommand(velocity_m_s=velocity, acceleration_m_s2=acceleration))
    np.testing.assert_array_equal(flown.velocity_m_s, velocity)
    np.testing.assert_array_equal(flown.acceleration_m_s2, acceleration)
    assert (flown.turn_rate_rad_s, flown.climb_rad) == (0.03, -0.02)


def test_an_observation_is_finite_and_inside_its_space_when_the_navigation_knows_nothing(hand_made, env):
    env.imu = None
    truth, _, _, solution = hand_made.tick(1)
    blind = replace(solution, valid=False, covariance=np.full((9, 9), np.nan), led_pixels_px=np.full((8, 2), np.nan))
    env._tick = Tick(truth=truth, imu=(), frame=None, solution=blind, outcome=None)
    observation = env.observation()
    assert np.isfinite(observation).all()
    assert env.observation_space.contains(observation)
    named = dict(zip([entry.name for entry in OBSERVATION], observation, strict=True))
    assert (named["valid"], named["leds_seen"], named["frame_age"]) == (0.0, 0.0, 10.0)
    assert named["sigma_p_PD_B_x"] == 100.0
    assert named["p_PD_B_x"] == solution.p_PD_B[0]


def test_the_observation_is_made_of_the_solution_and_the_gyro(hand_made, env):
    """It is not given the truth."""
    _, imu, _, solution = hand_made.tick(2)
    observation = clipped(observation_from(solution, imu[-1]), env.observation_space)
    named = dict(zip([entry.name for entry in OBSERVATION], observation, strict=True))
    assert [named[f"gyro_{axis}"] for axis in "xyz"] == list(imu[-1].angular_rate_rad_s)
    assert named["v_PD_B_x"] == solution.v_PD_B[0]
    assert named["time"] == solution.time_stamp_s != solution.frame_time_stamp_s
    assert [named[f"navigator_command_{of}_x"] for of in ("velocity", "acceleration")] == [0.1, 0.0]


def test_what_is_beyond_a_space_is_observed_at_its_limit_and_what_is_no_number_as_nought():
    space = box((Entry("a", "m", -2.0, 3.0),) * 5, np.float64)
    assert clipped(np.array([np.nan, np.inf, -np.inf, 3.5, 1.5]), space).tolist() == [0.0, 3.0, -2.0, 3.0, 1.5]


def test_an_observation_s_attitude_sigmas_age_and_leds_are_the_solution_s(hand_made):
    _, _, _, solution = hand_made.tick(2)
    leds_px = solution.led_pixels_px.copy()
    leds_px[[1, 4, 6]] = np.nan
    told = replace(
        solution,
        R_BD=exp(np.array([0.1, -0.2, 0.3])),
        covariance=np.diag(np.arange(1.0, 10.0) ** 2),
        frame_time_stamp_s=solution.time_stamp_s - 0.02,
        led_pixels_px=leds_px,
    )
    named = dict(zip([entry.name for entry in OBSERVATION], observation_from(told, None), strict=True))
    assert [named[f"log_R_BD_{axis}"] for axis in "xyz"] == pytest.approx([0.1, -0.2, 0.3])
    sigmas = [named[f"sigma_{of}_{axis}"] for of in ("R_BD", "p_PD_B", "v_PD_B") for axis in "xyz"]
    assert sigmas == pytest.approx(range(1, 10))  # `NavSolution.covariance`: attitude, place, velocity
    assert named["frame_age"] == pytest.approx(0.02)
    assert named["leds_seen"] == 5.0


def test_what_is_known_exactly_has_a_standard_deviation_of_nought(hand_made):
    solution = replace(hand_made.tick(2)[3], covariance=np.zeros((9, 9)))
    named = dict(zip([entry.name for entry in OBSERVATION], observation_from(solution, None), strict=True))
    assert {value for name, value in named.items() if name.startswith("sigma_")} == {0.0}


def test_the_state_beside_a_picture_is_of_its_frame_and_of_the_newest_sample(hand_made):
    """Without OpenGL: the frame is made by hand, 8 times 6 pixels from row 100, column 200 on."""
    made = DockPixelsEnv()
    truth, imu, _, solution = hand_made.tick(2)
    made._tick, made.imu = Tick(truth=truth, imu=imu, frame=None, solution=solution, outcome=None), imu[-1]
    names = [entry.name for entry in PIXEL_STATE]
    before = dict(zip(names, made.observation()["state"], strict=True))
    assert (before["frame_age"], before["pooled"], before["exposure"]) == (10.0, 0.0, 0.0)
    pixels = np.full((8, 6), 9, np.uint8)
    window = Window(row_start=100, row_stop=108, column_start=200, column_stop=206)
    stamp_s = solution.time_stamp_s - 0.007
    made._frame = CameraFrame(time_stamp_s=stamp_s, pixels=pixels, window=window, exposure_s=2e-4, gain=0.1)
    observation = made.observation()
    state = dict(zip(names, observation["state"], strict=True))
    assert (state["column"], state["row"], state["pooled"], state["exposure"]) == (200.0, 100.0, 1.0, 2e-4)
    assert state["frame_age"] == pytest.approx(0.007)
    assert state["time"] == solution.time_stamp_s
    for name, measured in (("gyro", imu[-1].angular_rate_rad_s), ("specific_force", imu[-1].specific_force_m_s2)):
        np.testing.assert_array_equal([state[f"{name}_{axis}"] for axis in "xyz"], np.nan_to_num(measured))
    assert observation["picture"].sum() == pixels.sum()


def test_info_s_truth_is_of_the_world_now_and_of_the_contact_once_there_was_one(make_truth):
    truth = make_truth(1.5, p_WD=np.array([4.0, 0.2, -0.1]), reel_position_m=0.7, latched=True)
    info = truth_info(truth, 3.9, Contact(time_s=1.4, radial_offset_m=0.03, closure_speed_m_s=1.2, angle_deg=4.0))
    place = dict(zip(("p_PD_B_x_m", "p_PD_B_y_m", "p_PD_B_z_m"), truth.p_PD_B, strict=True))
    now = {"time_s": 1.5, "distance_m": 3.9, "closing_speed_m_s": 0.0, "reel_position_m": 0.7, "latched": 1.0}
    assert info == place | now | {"contact_radial_offset_m": 0.03, "contact_closure_speed_m_s": 1.2}
    before = truth_info(make_truth(1.5, probe_touches_drogue=True), 3.9, None)
    assert (before["latched"], before["contact_radial_offset_m"], before["contact_closure_speed_m_s"]) == (0, np.inf, 0)


@pytest.mark.parametrize(("v_WD", "v_WP", "closing_m_s"), [(0.0, 1.2, 1.2), (0.5, 1.2, 0.7), (0.5, 0.0, -0.5)])
def test_info_s_closing_speed_is_positive_where_tip_and_ring_come_together(make_truth, v_WD, v_WP, closing_m_s):
    """Along the drogue's axis, which points to the left here: what goes on along x is none of it."""
    R_WD = matrix_from_yaw_pitch_roll(0.5 * np.pi, 0.0, 0.0)
    truth = make_truth(1.0, R_WD=R_WD, v_WD=np.array([0.3, v_WD, 0.0]), v_WP=np.array([0.1, v_WP, 0.0]))
    assert truth_info(truth, 4.0, None)["closing_speed_m_s"] == pytest.approx(closing_m_s)


@pytest.mark.slow
def test_the_fast_environment_flies_the_same_world_and_hardware_without_a_picture():
    fast = DockFastEnv(ticks_per_step=4)
    fast.reset(seed=3)
    for _ in range(3):
        *_, info = fast.step(np.zeros(6, np.float32))
    flight = Flight(load_scenario("default", {"camera.sensing": "measurements"}), 3)
    for _ in range(13):
        tick = flight.step(type(flight.navigator.step((), None).command)())
    assert info["truth"]["p_PD_B_x_m"] == tick.truth.p_PD_B[0]
    assert fast.tick.frame is None or isinstance(fast.tick.frame, LedObservation)
    fast.close()
    flight.close()


@pytest.mark.slow
@pytest.mark.gl
def test_the_picture_shows_the_navigations_window_and_says_where_it_lies():
    env = DockPixelsEnv(ticks_per_step=4)
    observation, _ = env.reset(seed=3)
    assert not observation["picture"].any()
    assert dict(zip([e.name for e in PIXEL_STATE], observation["state"], strict=True))["frame_age"] == 10.0
    for _ in range(6):
        before, (observation, *_) = observation, env.step(np.zeros(6, np.float32))
    frame, state = env._frame, dict(zip([e.name for e in PIXEL_STATE], observation["state"], strict=True))
    assert env.observation_space.contains(observation)
    assert observation["picture"].max() == frame.pixels.max()
    assert (state["row"], state["column"]) == (frame.window.row_start, frame.window.column_start)
    assert 0.005 < state["frame_age"] < 0.04
    assert not np.shares_memory(before["picture"], observation["picture"])
    env.close()


@pytest.mark.slow
@pytest.mark.gl
def test_the_whole_sensor_can_be_asked_for():
    env = DockPixelsEnv(view="sensor", ticks_per_step=4)
    env.reset(seed=3)
    for _ in range(3):
        observation, *_ = env.step(np.zeros(6, np.float32))
    env.close()
    assert observation["picture"].shape == (136, 256, 1)
    assert list(observation["state"][:3]) == [0.0, 0.0, 8.0]


def test_wrong_arguments_say_what_exists():
    for arguments, exists in (
        ({"render_mode": "ansi"}, "exists: human, rgb_array"),
        ({"reward": "shaped"}, "exists: dense, sparse"),
        ({"attempts": 0}, "from 1 on"),
        ({"ticks_per_step": 0}, "from 1 on"),
        ({"ticks_per_step": 1.5}, "ticks_per_step: expected an integer from 1 on, got 1.5"),
        ({"attempts": "2"}, "attempts: expected an integer from 1 on, got '2'"),
        ({"attempts": True}, "from 1 on"),
        ({"scenario": 3}, "scenario: expected a name, a path or a Scenario, got 3"),
    ):
        with pytest.raises(DockairError, match=exists):
            DockEnv(**{"scenario": QUICK} | arguments)
    with pytest.raises(DockairError, match="exists: ring, sensor"):
        DockPixelsEnv(view="crop")
    with pytest.raises(DockairError, match="one that looks through the camera"):
        DockPixelsEnv(QUICK)
    with pytest.raises(DockairError, match="exists: .*default"):
        DockEnv("no_such_scenario")
    with pytest.raises(DockairError, match="options: .*'scenari'.*exists: scenario, seed, set"):
        DockEnv(QUICK).reset(options={"scenari": "default"})


@pytest.mark.parametrize("made", [DockFastEnv, DockPixelsEnv])
def test_what_does_not_navigate_by_sight_is_refused_where_sight_is_the_point(made):
    with pytest.raises(DockairError, match=r"navigation\.navigator: expected one that looks through the camera"):
        made("truth_navigation")


def test_an_attempt_that_goes_on_when_time_is_over_has_failed_and_one_that_did_not_begin_has_not(env):
    for trying, outcome, ends in ((True, "miss", (True, False)), (False, "timeout", (False, True))):
        env.reset(seed=0, options={"set": {"flight.duration_s": 0.05}})
        env._judge._trying = trying
        *_, terminated, truncated, info = env.step(np.zeros(6, np.float32))
        assert (info["outcome"], (terminated, truncated)) == (outcome, ends)


def test_what_the_flights_own_referee_says_ends_an_episode_or_not(env, monkeypatch):
    """Without `until_clear` only what no episode can go on after: a collision, a simulation that has broken down."""
    env.reset(seed=0)
    monkeypatch.setattr(env, "_is_dense", False)
    step = env._flight.step
    for until_clear, outcome, paid, ends in (
        (False, Outcome.DIVERGED, 0.0, (False, True)),
        (True, Outcome.DIVERGED, 0.0, (False, True)),
        (False, Outcome.COLLISION, -20.0, (True, False)),
        (False, Outcome.ABORT, 0.0, (False, False)),
        (True, Outcome.ABORT, -5.0, (True, False)),
    ):
        env._outcome = None
        monkeypatch.setattr(env, "_until_clear", until_clear)
        monkeypatch.setattr(
            env._flight, "step", lambda command, outcome=outcome: replace(step(command), outcome=outcome)
        )
        _, reward, *ended, info = env.step(np.zeros(6, np.float32))
        assert (reward, tuple(ended)) == (paid, ends)
        assert info["outcome"] == (outcome.value if any(ends) else "")


@pytest.mark.parametrize(("seen", "outcome"), [(Outcome.CONTACT, Outcome.CONTACT), (None, Outcome.TIMEOUT)])
def test_a_contact_in_the_last_tick_of_the_time_is_a_contact(seen, outcome):
    tick = SimpleNamespace(truth=SimpleNamespace(time_s=60.0), touched=False, outcome=None)
    scenario, referee = SimpleNamespace(flight=SimpleNamespace(duration_s=60.0)), SimpleNamespace(attempt=1)
    flight = SimpleNamespace(scenario=scenario, referee=referee, step=lambda command: tick)
    judge = SimpleNamespace(watch=lambda truth, touched: (False, seen), unfinished=None)
    assert DockEnv(QUICK)._flown(flight, judge, ReceiverCommand()) == (tick, 0, outcome)


def test_a_touch_between_two_control_ticks_begins_an_attempt(env, monkeypatch):
    """Touches last a few milliseconds, a control tick ten."""
    env.reset(seed=0)
    world, ticks = env._flight.world, iter(range(1000))
    step = world.step
    monkeypatch.setattr(world, "step", lambda command: replace(step(command), probe_touches_drogue=next(ticks) == 3))
    *_, info = env.step(np.zeros(6, np.float32))
    assert not env.tick.truth.probe_touches_drogue
    assert info["outcome"] == "rim_strike"  # four metres behind: over as soon as it has begun


def test_each_failed_attempt_but_the_last_costs_one_and_the_last_its_outcome_alone(monkeypatch):
    """A touch four metres behind the ring is over a control tick later: two in one step, then the last of three."""
    flown = DockEnv(QUICK, attempts=3, reward="sparse", ticks_per_step=4)
    flown.reset(seed=0)
    world, ticks = flown._flight.world, iter(range(1000))
    step = world.step
    touches = (3, 23, 43)  # of the physics, ten of which are a control tick
    monkeypatch.setattr(
        world, "step", lambda command: replace(step(command), probe_touches_drogue=next(ticks) in touches)
    )
    _, both, *_, info = flown.step(np.zeros(6, np.float32))
    assert (both, info["attempt"], info["outcome"]) == (-2.0, 3, "")
    _, last, *_, info = flown.step(np.zeros(6, np.float32))
    assert (last, info["outcome"]) == (OUTCOME_REWARD[Outcome.RIM_STRIKE], "rim_strike")
    flown.close()


@pytest.mark.parametrize(("attempts", "paid", "outcome"), [(2, -1.0 - 5.0, "timeout"), (1, -5.0, "rim_strike")])
def test_an_attempt_that_fails_as_the_time_runs_out_is_charged_once(monkeypatch, attempts, paid, outcome):
    """One that might have been tried again costs 1, as a tick earlier, the last its outcome; unsafe costs 5 in both."""
    flown = DockEnv(QUICK, attempts=attempts, reward="sparse", ticks_per_step=4)
    flown.reset(seed=0, options={"set": {"flight.duration_s": 0.03}})
    step = flown._flight.world.step
    touches = iter([True])  # four metres behind: over as soon as it has begun
    monkeypatch.setattr(
        flown._flight.world, "step", lambda command: replace(step(command), probe_touches_drogue=next(touches, False))
    )
    _, reward, *_, info = flown.step(np.zeros(6, np.float32))
    flown.close()
    assert (reward, info["outcome"]) == (paid, outcome)


def test_until_clear_an_attempt_has_failed_when_the_next_begins(monkeypatch):
    flown = DockEnv(QUICK, until_clear=True, reward="sparse")
    flown.reset(seed=0)
    referee, phases = flown._flight.referee, iter(["approach", "approach", "breakaway", "pre_contact", "approach"])
    judge = referee.judge
    monkeypatch.setattr(referee, "judge", lambda truth, phase, *rest, **more: judge(truth, next(phases), *rest, **more))
    returned = [flown.step(np.zeros(6, np.float32)) for _ in range(5)]
    flown.close()
    assert [reward for _, reward, *_ in returned] == [0.0, 0.0, 0.0, 0.0, -1.0]
    assert [info["attempt"] for *_, info in returned] == [1, 1, 1, 1, 2]


def test_the_newest_sample_is_observed_until_the_next(env):
    env.reset(seed=0, options={"set": {"faults": [{"kind": "gyro_drop_out", "start_s": 0.02, "stop_s": 9.0}]}})
    assert len(env.tick.imu) > 1 and env.imu is env.tick.imu[-1]
    for _ in range(3):
        observation, *_ = env.step(np.zeros(6, np.float32))
    named = dict(zip([entry.name for entry in OBSERVATION], observation, strict=True))
    assert env.tick.imu == ()
    assert [named[f"gyro_{axis}"] for axis in "xyz"] == list(env.imu.angular_rate_rad_s) != [0.0, 0.0, 0.0]


def test_no_sample_of_the_flight_before_is_observed_in_one_that_has_none_yet(hand_made, env):
    env.imu = hand_made.tick(1)[1][-1]
    observation, _ = env.reset(seed=0, options={"set": {"faults": [{"kind": "gyro_drop_out", "start_s": 0.0}]}})
    named = dict(zip([entry.name for entry in OBSERVATION], observation, strict=True))
    assert [named[f"gyro_{axis}"] for axis in "xyz"] == [0.0, 0.0, 0.0]


@pytest.mark.slow
@pytest.mark.gl
def test_the_third_persons_view_is_a_picture_of_the_world(env):
    seen = DockEnv(QUICK, render_mode="rgb_array")
    seen.reset(seed=0)
    picture = seen.render()
    again = seen.render()
    assert picture.shape == (480, 640, 3) and picture.dtype == np.uint8
    assert len(np.unique(picture)) > 30
    np.testing.assert_array_equal(picture, again)
    assert not np.shares_memory(picture, again)
    seen.close()
    assert env.render() is None


def test_the_view_is_640_by_480_of_the_middle_between_tip_and_ring_and_closed_with_the_flight(monkeypatch, make_truth):
    """Without OpenGL."""
    said = []

    class View:
        def __init__(self, model, width_px, height_px):
            said.append((width_px, height_px))

        def render(self, data, look_at_W):
            said.append(look_at_W)

        def close(self):
            said.append("view")

    monkeypatch.setattr(envs_episode, "ThirdPersonView", View)
    made, truth = DockEnv(QUICK, render_mode="rgb_array"), make_truth(1.0, p_WD=np.array([4.0, 0.2, -0.1]))
    world = SimpleNamespace(model=None, data=None)
    made._flight = SimpleNamespace(world=world, truth=truth, close=lambda: said.append("flight"))
    made.render()
    made.close()
    size, look_at_W, *closed = said
    assert (size, sorted(closed)) == ((640, 480), ["flight", "view"])
    np.testing.assert_allclose(look_at_W, 0.5 * (truth.p_WP + truth.p_WD))
    with pytest.raises(gymnasium.error.ResetNeeded, match=r"render\(\)"):
        made.render()


def test_the_viewer_draws_the_command_that_is_flown_not_the_one_that_the_guidance_would_have_given(monkeypatch):
    drawn = []

    class Viewer:
        def show(self, flight, tick, *, is_last=False):
            drawn.append(tick.solution.command.velocity_m_s)

    monkeypatch.setattr(envs_episode, "require_viewer", lambda: None)
    monkeypatch.setattr(envs_episode, "LiveViewer", Viewer)
    made = DockEnv(QUICK, render_mode="human")
    made.reset(seed=0)
    observation, *_ = made.step(np.array([0.5, -0.25, 0.0, 0.0, 0.0, 0.0], np.float32))
    np.testing.assert_array_equal(drawn, [[0.0, 0.0, 0.0], [0.5, -0.25, 0.0]])
    first = [entry.name for entry in OBSERVATION].index("navigator_command_velocity_x")
    assert np.any(observation[first : first + 3] != drawn[-1])  # what is observed stays the guidance's
    made.close()


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore:.*ERROR")  # gymnasium tells of the error itself, too
def test_what_a_vector_environments_process_raises_comes_back_as_one_line():
    made = gymnasium.make_vec(
        "dockair/Dock-v0", num_envs=1, vectorization_mode="async", vector_kwargs={"context": "spawn"}, scenario=QUICK
    )
    try:
        with pytest.raises(DockairError, match="options: expected a known key, got 'sett'; exists: scenario"):
            made.reset(seed=1, options={"sett": {}})
    finally:
        made.close()


@pytest.mark.slow
@pytest.mark.timeout(600)
def test_vector_environments_in_one_process_and_in_two_fly_the_same():
    several = [
        gymnasium.make_vec("dockair/DockFast-v0", num_envs=2, vectorization_mode=mode, vector_kwargs=arguments)
        for mode, arguments in (("sync", {}), ("async", {"context": "spawn"}))
    ]
    try:
        firsts = [env.reset(seed=[7, 8])[0] for env in several]
        thens = [env.step(np.zeros((2, 6), np.float32))[0] for env in several for _ in range(2)]
        np.testing.assert_array_equal(*firsts)
        np.testing.assert_array_equal(thens[1], thens[3])
        assert not np.array_equal(thens[1][0], thens[1][1])
    finally:
        for env in several:
            env.close()


def test_the_page_tables_what_the_code_has():
    """Every entry of observation, picture's state and action, with its index, stands in docs/environments.md."""
    page = PAGE.read_text(encoding="utf-8")
    for entries, kind in ((OBSERVATION, "float64"), (ACTION, "float32"), (PIXEL_STATE, "float64")):
        assert f"`Box({len(entries)},)`, {kind}" in page
        first_index: dict[str, int] = {}
        for index, entry in enumerate(entries):
            stem = re.sub(r"(_velocity|_acceleration)?_[xyz]$", "", entry.name)
            first_index.setdefault(stem, index)
        for stem, index in first_index.items():
            assert re.search(rf"^\| {index}(-\d+)? \| `{stem}`", page, re.MULTILINE), stem
    for outcome, reward in OUTCOME_REWARD.items():
        assert re.search(rf"^\|.*`{outcome.value}`.*\| {reward:g} \|", page, re.MULTILINE), outcome
    unsafe = "any but `collision`, with something `unsafe`"
    for which, reward in (("`contact`, not good", LOOSE_CONTACT_REWARD), (unsafe, UNSAFE_REWARD)):
        assert re.search(rf"^\| {which}.*\| {reward:g} \|", page, re.MULTILINE), which
    assert set(OUTCOME_REWARD) == set(Outcome)
    for name in IDS:
        assert f"`{name}`" in page


def test_the_ranges_on_the_page_are_the_spaces():
    page = PAGE.read_text(encoding="utf-8")
    sections = {
        "\n## Action": ACTION, "\n## Observation of `Dock-v0`": OBSERVATION, "\n`state`: `Box(12,)`": PIXEL_STATE
    }  # fmt: skip
    row = re.compile(r"^\| (\d+)(?:-(\d+))? \|.*\| (-?[\d.π]+) to ([\d.π]+)(?: \||$)", re.MULTILINE)
    for begin, entries in sections.items():
        said = {}
        for first, last, *limits in row.findall(page.partition(begin)[2].partition("\n## ")[0]):
            low, high = (float(limit.replace("π", repr(np.pi))) for limit in limits)
            said |= dict.fromkeys(range(int(first), int(last or first) + 1), (low, high))
        left_out = [entry for k, entry in enumerate(entries) if k not in said]
        assert all(entry.name.startswith("navigator_command") for entry in left_out)  # "as the action"
        assert said == {k: (entry.low, entry.high) for k, entry in enumerate(entries) if entry not in left_out}
    commanded = [(entry.low, entry.high) for entry in OBSERVATION if entry.name.startswith("navigator_command")]
    assert commanded == [(entry.low, entry.high) for entry in ACTION]


def test_the_page_tables_every_key_of_info(env):
    page = PAGE.read_text(encoding="utf-8").partition("## Info")[2].partition("\n## ")[0]
    _, info = env.reset(seed=0)
    assert set(re.findall(r"^\| `(\w+)` \|", page, re.MULTILINE)) == set(info)
    for key in info["truth"]:
        assert f"`{key}`" in page, key


@pytest.mark.parametrize(
    ("set_keys", "sensing"),
    [({}, "truth"), ({"navigation.navigator": "dockair.nav.navigator:Navigator"}, "measurements")],
)
def test_info_says_what_the_navigation_sees_in_the_words_of_a_result(env, set_keys, sensing):
    assert env.reset(seed=0, options={"set": {"camera.sensing": "measurements"} | set_keys})[1]["sensing"] == sensing
    assert env.step(np.zeros(6, np.float32))[4]["sensing"] == sensing


def test_the_speed_of_a_video_follows_the_flight_and_not_the_other_environments():
    shared, other = DockEnv.metadata | {}, DockEnv(QUICK)
    made = DockEnv(QUICK, ticks_per_step=2)
    before = made.metadata["render_fps"]
    made.reset(seed=0, options={"set": {"rates.control_hz": 50, "rates.camera_hz": 50}})
    slow = made.metadata["render_fps"]
    made.reset(seed=0)
    made.close()
    assert (before, slow, made.metadata["render_fps"]) == (50.0, 25.0, 50.0)
    assert DockEnv.metadata == shared
    assert other.metadata["render_fps"] == 100.0


def test_info_says_which_flight_it_is_and_that_flies_again():
    """A drawn seed, too; the flight that it names is the same to the bit."""
    env = DockEnv(QUICK, ticks_per_step=10)
    _, info = env.reset()
    assert info["scenario"] == QUICK and 0 <= info["seed"] < 2**63
    first = [env.step(np.zeros(6, np.float32))[0] for _ in range(5)]
    _, again = env.reset(options={"seed": info["seed"]})
    assert again["seed"] == info["seed"]
    np.testing.assert_array_equal([env.step(np.zeros(6, np.float32))[0] for _ in range(5)], first)
    assert env.reset(seed=5)[1]["seed"] == 5
    env.close()


@pytest.mark.slow
def test_info_says_what_was_unsafe_of_a_contact_that_is_a_success():
    """Blind from 2.6 s on and straight in at 2.2 m/s, by what the navigation then believes."""
    blind = {"faults": [{"kind": "camera_drop_out", "start_s": 2.6, "stop_s": 60.0}]}
    env = DockFastEnv(load_scenario("still_air", blind), ticks_per_step=2)
    observation, info = env.reset(seed=0)
    assert info["unsafe"] == ""
    over = False
    while not over:
        aside = np.clip(observation[2:4], -2.0, 2.0)
        observation, _, over, late, info = env.step(np.array([2.2, *aside, 0.0, 0.0, 0.0], np.float32))
        over = over or late
    env.close()
    assert info["outcome"] == "contact" and info["unsafe"] == "contact on a solution marked unusable"
