"""`dockair/Dock-v0` keeps gymnasium's contract, is determined by its seed, and shows no truth in its observation."""

import re
from dataclasses import replace
from pathlib import Path

import gymnasium
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env

import dockair
from dockair.errors import DockairError
from dockair.scenarios.envs import ACTION, OBSERVATION, OUTCOME_REWARD, DockEnv, observation_from
from dockair.scenarios.loop import Tick
from dockair.scenarios.referee import Outcome

#: The world without camera: what is tested here does not depend on who navigates.
QUICK = "truth_navigation"
#: The checker recommends actions in [-1, 1]; ours are in units (gymnasium.wrappers.RescaleAction changes that).
allow_units = pytest.mark.filterwarnings("ignore:.*symmetric and normalized space")


@pytest.fixture
def env():
    made = DockEnv(QUICK, ticks_per_step=5)
    yield made
    made.close()


def _fly(env: DockEnv, seed: int, steps: int) -> list[tuple]:
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


@pytest.mark.slow
@allow_units
def test_the_contract_of_gymnasium_is_kept(env):
    check_env(env, skip_render_check=True)


@pytest.mark.slow
@pytest.mark.gl
@pytest.mark.timeout(900)
@allow_units
def test_the_registered_environment_passes_the_checker_with_the_camera_in_the_loop():
    assert "dockair/Dock-v0" in dockair.ENVIRONMENTS
    made = gymnasium.make("dockair/Dock-v0", render_mode="rgb_array")
    try:
        check_env(made.unwrapped)
    finally:
        made.close()


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


def test_observations_are_new_objects(env):
    history = _fly(env, 0, 3)
    arrays = [entry[0] for entry in history]
    assert all(not np.shares_memory(a, b) for a, b in zip(arrays, arrays[1:], strict=False))


def test_step_before_reset_and_after_the_end_is_refused(env):
    with pytest.raises(gymnasium.error.ResetNeeded):
        env.step(np.zeros(6, np.float32))
    env.reset(seed=0, options={"set": {"flight.duration_s": 0.2}})
    for _ in range(10):
        *_, terminated, truncated, _ = env.step(np.zeros(6, np.float32))
        if terminated or truncated:
            break
    with pytest.raises(gymnasium.error.ResetNeeded):
        env.step(np.zeros(6, np.float32))


def test_the_end_of_time_truncates_and_does_not_terminate(env):
    env.reset(seed=0, options={"set": {"flight.duration_s": 0.1}})
    ends = [env.step(np.zeros(6, np.float32))[2:] for _ in range(2)]
    (terminated, truncated, info) = ends[-1]
    assert (terminated, truncated) == (False, True)
    assert info["outcome"] == "timeout"
    assert not info["is_success"]


def test_shaping_sums_to_the_distance_made_good(env):
    """With zero action nothing is subtracted: the sum of rewards is the distance at the start less that at the end."""
    _, start = env.reset(seed=4)
    steps = [env.step(np.zeros(6, np.float32)) for _ in range(10)]
    made_good = start["truth"]["distance_m"] - steps[-1][4]["truth"]["distance_m"]
    assert sum(step[1] for step in steps) == pytest.approx(made_good, abs=1e-12)


def test_a_full_deflection_costs_what_is_written(make_hand_made):
    """0.02 per second with every axis at its limit: 0.001 in a step of 50 ms, 0.0005 with half the axes."""
    env = DockEnv(QUICK, ticks_per_step=5)
    env.reset(seed=4)
    high = env.action_space.high  # type: ignore[attr-defined]
    assert env._action_cost(env._command(high)) == pytest.approx(0.02 * 0.05)
    assert env._action_cost(env._command(np.where(np.arange(6) < 3, high, 0.0))) == pytest.approx(0.5 * 0.02 * 0.05)
    env.close()


def test_commands_beyond_the_limits_are_clipped_and_nonsense_is_refused(env):
    env.reset(seed=0)
    command = env._command(np.full(6, 100.0, np.float32))
    np.testing.assert_array_equal(command.velocity_m_s, 2.5)
    np.testing.assert_array_equal(command.acceleration_m_s2, 2.0)
    for wrong in (np.full(6, np.nan, np.float32), np.zeros(5, np.float32)):
        with pytest.raises(DockairError, match="6 finite numbers"):
            env.step(wrong)


def test_an_observation_is_finite_and_inside_its_space_when_the_navigation_knows_nothing(hand_made, env):
    truth, _, _, solution = hand_made.tick(1)
    blind = replace(solution, valid=False, covariance=np.full((9, 9), np.nan), led_pixels_px=np.full((8, 2), np.nan))
    env.reset(seed=0)
    env._tick = Tick(truth=truth, imu=(), frame=None, solution=blind, outcome=None)
    observation = env._observation()
    assert np.isfinite(observation).all()
    assert env.observation_space.contains(observation)
    named = dict(zip([entry.name for entry in OBSERVATION], observation, strict=True))
    assert (named["valid"], named["leds_seen"], named["frame_age"]) == (0.0, 0.0, 10.0)
    assert named["sigma_p_PD_B_x"] == 100.0
    assert named["p_PD_B_x"] == solution.p_PD_B[0]


def test_the_observation_does_not_depend_on_the_truth(hand_made):
    """The same solution and gyro with another truth give the same observation."""
    truth, imu, _, solution = hand_made.tick(2)
    elsewhere = hand_made.truth(9000)
    a, b = (Tick(truth=t, imu=imu, frame=None, solution=solution, outcome=None) for t in (truth, elsewhere))
    np.testing.assert_array_equal(observation_from(solution, a), observation_from(solution, b))


def test_wrong_arguments_say_what_exists():
    with pytest.raises(DockairError, match="rgb_array"):
        DockEnv(QUICK, render_mode="human")
    with pytest.raises(DockairError, match="exists: .*default"):
        DockEnv("no_such_scenario")
    with pytest.raises(DockairError, match="options: .*'scenari'.*exists: scenario, set"):
        DockEnv(QUICK).reset(options={"scenari": "default"})


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


def test_the_page_tables_what_the_code_has():
    """Every entry of the observation and the action, with its index, stands in docs/environments.md."""
    page = (Path(__file__).parents[2] / "docs" / "environments.md").read_text(encoding="utf-8")
    assert f"`Box({len(OBSERVATION)},)`, float64" in page
    assert f"`Box({len(ACTION)},)`, float32" in page
    first_index = {}
    for index, entry in enumerate(OBSERVATION):
        stem = re.sub(r"(_velocity|_acceleration)?_[xyz]$", "", entry.name)
        first_index.setdefault(stem, index)
    for stem, index in first_index.items():
        assert re.search(rf"^\| {index}(-\d+)? \| `{stem}`", page, re.MULTILINE), stem
    for outcome, reward in OUTCOME_REWARD.items():
        assert re.search(rf"^\|.*`{outcome.value}`.*\| {reward:g} \|", page, re.MULTILINE), outcome
    assert set(OUTCOME_REWARD) == set(Outcome)
