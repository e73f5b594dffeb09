"""The examples run, and do what they say."""

import importlib
import re
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import gymnasium
import numpy as np
import pytest

from dockair.messages import LedObservation
from dockair.scenarios.envs.tables import ACTION, OBSERVATION, box

EXAMPLES = Path(__file__).parents[2] / "examples"
pytestmark = [pytest.mark.slow, pytest.mark.timeout(900)]


@pytest.fixture
def example(monkeypatch):
    monkeypatch.syspath_prepend(str(EXAMPLES))
    return importlib.import_module


@pytest.fixture
def short(tmp_path):
    """A scenario of two seconds."""
    path = tmp_path / "short.toml"
    path.write_text('name = "short"\n[flight]\nduration_s = 2.0\n', encoding="utf-8")
    return str(path)


def test_the_scripted_policy_flies_its_episodes_one_after_the_other(example, short, capsys):
    example("scripted_policy").main("2", short)
    lines = capsys.readouterr().out.splitlines()
    assert [line.partition(":")[0] for line in lines] == ["seed 0", "seed 1", "contact in 0 of 2"]


def test_the_scripted_policy_is_the_flight_of_the_same_seed(example):
    """The command that stands in the observation, held for one tick, is what the loop would have flown."""
    import gymnasium

    from dockair.scenarios.loop import Flight
    from dockair.scenarios.schema import load_scenario

    env = gymnasium.make("dockair/DockFast-v0", until_clear=True)
    observation, info = env.reset(seed=5)
    flight = Flight(load_scenario("default", {"camera.sensing": "measurements"}), 5)
    flight.step()
    for _ in range(50):
        observation, *_, info = env.step(example("scripted_policy").policy(observation))
        tick = flight.step()
    env.close()
    flight.close()
    assert info["truth"]["p_PD_B_x_m"] == pytest.approx(tick.truth.p_PD_B[0], abs=1e-6)  # actions are 32-bit


def test_the_controller_of_ones_own_docks(example, capsys):
    example("own_controller").main("still_air", "1", "dockair/DockFast-v0")
    assert capsys.readouterr().out.startswith("contact after")


def test_the_controller_of_ones_own_holds_its_velocity_while_there_is_nothing_to_steer_to(example):
    module = example("own_controller")
    controller, blind = module.Controller(0.01), np.zeros(len(module.INDEX))
    seen = blind.copy()
    seen[module.INDEX["valid"]], seen[module.INDEX["p_PD_B_x"]] = 1.0, 6.0
    before = module.action_for(controller, seen)
    for _ in range(500):
        action = module.action_for(controller, blind)
    assert before[0] > 0.0
    np.testing.assert_array_equal(action, [*before[:3], 0.0, 0.0, 0.0])
    assert not controller.closing


def test_the_navigator_of_ones_own_docks_and_is_judged_by_the_truth(example, capsys):
    example("own_navigator").main("still_air", "1")
    outcome, figures = capsys.readouterr().out.splitlines()
    assert outcome.startswith("contact after")
    assert float(re.search(r"([\d.]+) m off", figures)[1]) < 0.15


def test_the_navigator_of_ones_own_is_the_tutorial_s():
    page = (EXAMPLES.parent / "docs" / "tutorials" / "own_navigator.md").read_text(encoding="utf-8")
    (code,) = re.findall(r"```python\n(.*?)```", page, re.DOTALL)
    text = (EXAMPLES / "own_navigator.py").read_text(encoding="utf-8")
    assert code in text
    assert text.count("\nclass ") == code.count("\nclass ") == 1


def test_the_navigator_of_ones_own_is_not_valid_half_a_second_after_its_last_sight(example, hand_made):
    module = example("own_navigator")
    navigator = module.MyNavigator(hand_made.sheets)
    valid = []
    for k in range(1, 101):
        truth, imu, *_ = hand_made.tick(k)
        seen = LedObservation(
            time_stamp_s=truth.time_s,
            led_numbers=np.arange(8),
            centroids_px=hand_made.leds_px(truth),
            sigma_px=np.full(8, 0.05),
        )
        valid.append(navigator.step(imu, seen if 10 <= k <= 30 else None).valid)
    assert [k for k, is_valid in enumerate(valid, 1) if is_valid] == list(range(10, 80))


def test_the_navigator_of_ones_own_docks_soon(example):
    """Its first frame, believed by half, had kept guidance waiting for a minute."""
    from dockair.scenarios.loop import fly
    from dockair.scenarios.schema import load_scenario

    example("own_navigator")
    own = {"camera.sensing": "measurements", "navigation.navigator": "own_navigator:MyNavigator"}
    result = fly(load_scenario("still_air", own), 0)
    assert result.first_attempt
    assert result.contact.time_s < 15.0


def test_the_search_for_gains_finds_those_that_score_best(example, monkeypatch):
    """Each seed likes other gains, their mean those of no single one."""
    module, best, flown = example("learn_gains"), np.log([4.0, 0.5, 2.0]), []

    def episode(gains, seed):
        flown.append((tuple(gains), int(seed)))
        return -float(np.sum((np.log(gains) - best - 0.5 * (seed % module.FLIGHTS - 1)) ** 2)), False

    monkeypatch.setattr(module, "episode", episode)
    with ThreadPoolExecutor(1) as pool:
        np.testing.assert_allclose(np.log(module.learned(pool, 12, 20)), best, atol=0.1)
    assert len(set(flown)) == len(flown) == 12 * 20 * module.FLIGHTS
    assert {seed for _, seed in flown} == set(range(module.TRAINED_FROM, module.TRAINED_FROM + 12 * module.FLIGHTS))


def test_the_policy_whose_gains_are_searched_is_linear_in_the_belief_and_sums_to_its_velocity(example):
    module = example("learn_gains")
    policy, seen = module.LinearPolicy(np.array([0.5, 2.0, 0.25])), np.zeros(len(module.INDEX))
    for name, value in {"valid": 1.0, "p_PD_B_y": 1.0, "v_PD_B_z": -0.1, "gyro_x": 0.1}.items():
        seen[module.INDEX[name]] = value
    acceleration = [0.25 * 1.2, 0.5, 2.0 * (-0.1 - 0.1)]  # the turn lifts a ring to the left by 0.1 m/s
    for steps in (1, 2):
        velocity = np.array(acceleration) * 0.05 * steps
        np.testing.assert_allclose(policy(seen), [*velocity, *acceleration], rtol=1e-6)
    seen[module.INDEX["valid"]] = 0.0
    np.testing.assert_allclose(policy(seen), [*velocity, 0.0, 0.0, 0.0], rtol=1e-6)


def test_learning_runs_and_says_what_it_was_worth():
    done = subprocess.run(
        [sys.executable, str(EXAMPLES / "learn_gains.py"), "1", "1", "1"], capture_output=True, text=True
    )
    assert done.returncode == 0, done.stderr
    said = r"generation 0: mean score +\S+, \d of 3 flights docked\ngains: \S+, \S+, \S+\n"
    said += "".join(rf"{when}: good contact in \d of 1 on new seeds\n" for when in ("before", "after"))
    assert re.fullmatch(said, done.stdout)


class _Belief(gymnasium.Env):
    """Answers with one belief, and keeps the commands."""

    observation_space = box(OBSERVATION, np.float64)
    action_space = box(ACTION, np.float32)

    def __init__(self, **values: float) -> None:
        names = [entry.name for entry in OBSERVATION]
        self.belief, self.commands = np.zeros(len(names)), []
        for name, value in values.items():
            self.belief[names.index(name)] = value

    def reset(self, *, seed=None, options=None):
        super().reset(seed=seed)
        return self.belief, {}

    def step(self, action):
        self.commands.append(action)
        return self.belief, 0.5, False, False, {}


def test_the_policy_that_learns_asks_for_a_velocity_and_sees_the_ring_in_units_of_size_one(example):
    """Its rate is that in turning axes: a turn of 0.1 rad/s lifts a ring that is 2 m to the left by 0.2 m/s."""
    module = example("learn_policy")
    belief = _Belief(valid=1.0, p_PD_B_x=4.0, p_PD_B_y=0.5, v_PD_B_x=-1.0, v_PD_B_z=0.35, gyro_x=0.1)
    env = module.Steered(belief)
    seen, _ = env.reset(seed=0)
    np.testing.assert_allclose(seen, [2.0, 2.0, 0.0, -0.5, 0.0, 1.2, 0.0, 0.0, 0.0, 1.0], atol=1e-6)
    assert env.observation_space.contains(seen)
    for _ in range(2):
        seen, reward, *_ = env.step(np.array([1.0, -0.5, 7.0], np.float32))
        np.testing.assert_allclose(belief.commands[-1], [2.0, -0.5, 1.0, 0.0, 0.0, 0.0])
        np.testing.assert_allclose(seen[6:9], [2.0, -0.5, 1.0])
    assert reward == 0.5
    assert not env.reset()[0][6:9].any()


def test_what_is_shown_is_the_linear_policys_velocity_in_shares_of_the_most(example):
    module = example("learn_policy")
    p, rate, velocity = [4.0, 0.1, 0.0], [-1.0, 0.0, 0.02], [1.0, 0.3, -0.9]
    seen = np.array([*(p / module.UNIT_M), *(rate / module.UNIT_M), *velocity, 1.0], np.float32)
    acceleration = np.array([0.82 * 0.2, 2.50 * 0.1, 3.94 * 0.02])
    action = (velocity + 0.05 * acceleration) / [2.0, 1.0, 1.0]
    np.testing.assert_allclose(module.shown(seen), action, rtol=1e-5)
    blind, fast = np.array([*seen[:9], 0.0]), np.array([*seen[:7], 3.0, *seen[8:]])
    np.testing.assert_allclose(
        module.shown(np.array([blind, fast])), [[0.5, 0.3, -0.9], [action[0], 1.0, action[2]]], rtol=1e-5
    )


def test_the_policy_that_learns_is_told_while_nothing_may_be_flown_on(example):
    assert example("learn_policy").Steered(_Belief(valid=0.0)).reset()[0][9] == 0.0


def test_what_was_learned_is_evaluated_on_the_seeds_that_it_has_not_met(example, monkeypatch):
    module, seeds = example("learn_policy"), []

    class Flown(_Belief):
        def reset(self, *, seed=None, options=None):
            seeds.append(seed)
            return super().reset(seed=seed)

        def step(self, action):
            observation, reward, *_ = super().step(action)
            good = seeds[-1] % 2 == 0
            return observation, reward, True, False, {"is_success": good, "unsafe": "" if good else "touch"}

    monkeypatch.setattr(module, "made", lambda name: module.Steered(Flown()))
    said = module.evaluated(lambda seen: np.zeros(3, np.float32), "fast", 5)
    assert said == "fast: good contact in 3 of 5 on new seeds, 2 unsafe"
    assert seeds == [2000, 2001, 2002, 2003, 2004]
