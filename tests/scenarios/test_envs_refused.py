"""What the environments refuse: in one line, and the flight that goes on is not touched by it."""

import socket

import gymnasium
import numpy as np
import pytest

from dockair.calibration import Window
from dockair.errors import DockairError, MachineError
from dockair.messages import CameraFrame
from dockair.scenarios import display
from dockair.scenarios.envs import DockEnv, DockFastEnv, DockPixelsEnv
from dockair.scenarios.envs import episode as envs_episode
from dockair.scenarios.envs import viewer as envs_viewer
from dockair.scenarios.envs.options import command_from
from dockair.scenarios.judgement.referee import Outcome
from dockair.scenarios.loop import Flight
from dockair.scenarios.schema import load_scenario

#: The world without camera: what is tested here does not depend on who navigates.
QUICK = "truth_navigation"
STILL = np.zeros(6, np.float32)
MEASURED = {"camera.sensing": "measurements"}

NAVIGATOR_THAT_FAILS = """
class Fails:
    def __init__(self, sheets):
        pass

    def step(self, imu, frame):
        raise ValueError("not today")
"""


@pytest.fixture(scope="module")
def env():
    """One for all tests: each resets it as it needs."""
    made = DockEnv(QUICK, ticks_per_step=5)
    yield made
    made.close()


@pytest.fixture
def flights(monkeypatch):
    """Return those that are open, of all that are made."""
    opened = []

    class Counted(Flight):
        def __init__(self, *given, **named):
            super().__init__(*given, **named)
            opened.append(self)

        def close(self):
            super().close()
            opened.remove(self)

    monkeypatch.setattr(envs_episode, "Flight", Counted)
    return opened


WRONG_OPTIONS = [
    (["scenario"], "options: expected a dictionary, got ['scenario']"),
    ([], "options: expected a dictionary, got []"),
    ("abc", "options: expected a dictionary, got 'abc'"),
    (80 * "x", "options: expected a dictionary, got 'str'"),  # with its quotes longer than a line bears
    (np.zeros((9, 9)), "options: expected a dictionary, got 'ndarray of shape (9, 9)'"),
    ({1: 2, "a": 3}, "options: expected keys that are text, got 1"),
    ({None: 2}, "options: expected keys that are text, got 'NoneType'"),
    ({"sett": {}}, "options: expected a known key, got 'sett'; exists: scenario, seed, set"),
    ({"set": {1: 2}}, "options.set: expected keys that are text, got 1"),
    ({"set": "turbulence.sigma_m_s=1"}, "options.set: expected a dictionary of dotted key -> value, got 'turb"),
    ({"set": None}, "options.set: expected a dictionary of dotted key -> value, got 'NoneType'"),
    ({"scenario": 3}, "scenario: expected a name, a path or a Scenario, got 3"),
    ({"seed": -1}, "options.seed: expected an integer from 0 to 9223372036854775807, got -1"),
    ({"seed": 2.9}, "options.seed: expected an integer from 0 to 9223372036854775807, got 2.9"),
    ({"seed": "x"}, "options.seed: expected an integer from 0 to 9223372036854775807, got 'x'"),
    (
        {"set": {"accept.outcome": "miss"}},
        "options.set: accept.outcome: expected a key that decides the flight, got 'miss'",
    ),
    ({"set": {"claim": "docks"}}, "options.set: claim: expected a key that decides the flight, got 'docks'"),
    ({"set": {"seed": 5}}, 'options.set: seed: expected the option "seed" in its place, or reset(seed=...), got 5'),
    ({"set": {"navigation.navigator": "nosuch:Class"} | MEASURED}, "navigation.navigator: expected an importable"),
    ({"set": {"flight.duration_s": 0.01}}, "flight.duration_s: expected more than the one control tick that reset"),
]


def test_a_wrong_option_is_refused_in_one_line_and_the_flight_goes_on(env, flights):
    """One flight, in which one wrong reset follows another."""
    _, info = env.reset(seed=0)
    for options, line in WRONG_OPTIONS:
        before_s = info["truth"]["time_s"]
        with pytest.raises(DockairError) as refused:
            env.reset(seed=4, options=options)
        assert str(refused.value).startswith(line)
        assert "\n" not in str(refused.value)
        info = env.step(STILL)[4]
        assert info["outcome"] == ""
        assert info["truth"]["time_s"] == pytest.approx(before_s + 0.05)
        assert flights == [env._flight]


def test_settings_beside_a_scenario_object_are_refused_wherever_it_was_given(env):
    scenario, settings = load_scenario(QUICK), {"turbulence.sigma_m_s": 1.0}
    for made, options in ((env, {"scenario": scenario}), (DockEnv(scenario), {})):
        with pytest.raises(DockairError, match=r"options\.set: expected a scenario's name or path beside it"):
            made.reset(options=options | {"set": settings})


@pytest.mark.parametrize("seed", [-1, 2.0, "7", True, 2**63])
def test_a_seed_that_is_no_whole_number_is_refused_by_its_own_name(env, seed):
    with pytest.raises(DockairError, match="^seed: expected an integer from 0 to 9223372036854775807, got"):
        env.reset(seed=seed)


@pytest.mark.parametrize("seed", [None, 99])
@pytest.mark.parametrize("options", [{"sett": 1}, {"set": {"navigation.navigator": "nosuch:Class"} | MEASURED}])
def test_a_refused_reset_neither_seeds_the_generator_nor_draws_from_it(env, seed, options):
    env.reset(seed=3)
    before = env.np_random, env.np_random.bit_generator.state, env.np_random_seed
    with pytest.raises(DockairError):
        env.reset(seed=seed, options=options)
    assert env.np_random is before[0]
    assert (env.np_random.bit_generator.state, env.np_random_seed) == before[1:]


def test_a_reset_without_a_seed_flies_what_the_generator_draws_next(env, monkeypatch):
    """And leaves it as if it had been asked for one number."""
    env.reset(seed=3)
    seeds = []
    new_flight = env.new_flight
    monkeypatch.setattr(env, "new_flight", lambda scenario, seed: seeds.append(seed) or new_flight(scenario, seed))
    env.reset()
    env.reset()
    drawn = gymnasium.utils.seeding.np_random(3)[0]
    assert seeds == [drawn.integers(2**63) for _ in range(2)]
    assert env.np_random.bit_generator.state == drawn.bit_generator.state
    assert env.np_random_seed == 3


def test_a_flight_that_fails_in_its_first_tick_is_closed_and_the_one_before_it_goes_on(
    env, flights, tmp_path, monkeypatch
):
    (tmp_path / "navigator_that_fails.py").write_text(NAVIGATOR_THAT_FAILS, encoding="utf-8")
    monkeypatch.syspath_prepend(str(tmp_path))
    env.reset(seed=0)
    with pytest.raises(DockairError, match="not today"):
        env.reset(options={"set": {"navigation.navigator": "navigator_that_fails:Fails"} | MEASURED})
    assert flights == [env._flight]
    assert env.step(STILL)[4]["outcome"] == ""


@pytest.mark.parametrize("until_clear", [False, True])
def test_a_duration_of_a_control_tick_is_refused_and_a_little_more_is_flown(until_clear):
    made = DockEnv(QUICK, until_clear=until_clear)
    with pytest.raises(DockairError, match=r"flight\.duration_s: expected more than .*, 0\.01 s, got 0\.005"):
        made.reset(options={"set": {"flight.duration_s": 0.005}})
    _, info = made.reset(seed=0, options={"set": {"flight.duration_s": 0.011}})
    assert info["outcome"] == ""
    *_, truncated, info = made.step(STILL)
    made.close()
    assert (truncated, info["outcome"]) == (True, "timeout")


def test_what_gymnasium_makes_flies_on_after_a_first_reset_that_was_refused():
    made = gymnasium.make("dockair/Dock-v0", scenario=QUICK)
    with pytest.raises(DockairError, match="^options: expected a known key"):
        made.reset(seed=0, options={"sett": 1})
    with pytest.raises(gymnasium.error.ResetNeeded):
        made.step(STILL)
    _, before = made.reset(seed=0)
    with pytest.raises(DockairError, match="^action: expected 6 finite numbers"):
        made.step(STILL[:5])
    for _ in range(2):
        info = made.step(STILL)[4]
    made.close()
    assert info["truth"]["time_s"] == pytest.approx(before["truth"]["time_s"] + 0.02)


def test_a_flight_that_is_over_with_its_first_tick_is_refused(env, flights, monkeypatch):
    env.reset(seed=0)
    flown = env._flown
    monkeypatch.setattr(env, "_flown", lambda *given: (*flown(*given)[:2], Outcome.COLLISION))
    with pytest.raises(DockairError, match="reset: expected a flight that goes on .*, got 'collision'"):
        env.reset(seed=1)
    assert flights == [env._flight]


WRONG_ACTIONS = [
    ("abc", "'abc'"),
    (["1"] * 6, r"\['1', "),
    ([[1.0], [1.0, 2.0]], r"\[\[1\.0\], "),
    ({}, "{}"),
    (None, "'NoneType'"),
    ([None] * 6, r"\[None, "),
    (np.ones(6, complex), r"array\(\[1\.\+0\.j"),
    ([1j] + [0.0] * 5, r"\[1j, "),
    (np.full(6, np.nan, np.float32), r"array\(\[nan"),
    (np.zeros(5, np.float32), r"array\(\[0\."),
    (np.zeros((1, 6)), r"array\(\[\[0\."),
    (np.zeros((20, 6)), r"'ndarray of shape \(20, 6\)'"),
]


def test_an_action_that_is_not_six_numbers_is_refused_in_one_line_and_no_tick_is_flown(env):
    env.reset(seed=0)
    tick = env.tick
    for action, got in WRONG_ACTIONS:
        with pytest.raises(DockairError, match=f"^action: expected 6 finite numbers, got {got}") as refused:
            env.step(action)
        assert "\n" not in str(refused.value)
        assert env.tick is tick


@pytest.mark.parametrize("kind", [list, tuple, np.array, lambda values: np.array(values, np.float32)])
def test_commands_beyond_the_limits_are_clipped(env, kind):
    command = command_from(kind([100] * 6), env.action_space)
    np.testing.assert_array_equal(command.velocity_m_s, 3.5)
    np.testing.assert_array_equal(command.acceleration_m_s2, 6.0)


def test_a_refused_reset_leaves_the_picture(monkeypatch):
    """The frame is made by hand, the flight one on measurements: no OpenGL is needed."""
    monkeypatch.setattr(DockPixelsEnv, "sensing", "measurements")
    made = DockPixelsEnv()
    made.reset(seed=0)
    pixels = np.full((8, 8), 200, np.uint8)
    window = Window(row_start=0, row_stop=8, column_start=0, column_stop=8)
    made._frame = CameraFrame(time_stamp_s=0.0, pixels=pixels, window=window, exposure_s=1e-4, gain=0.1)
    seen = made.observation()
    for options in ({"sett": 1}, {"set": {"navigation.navigator": "nosuch:Class"}}):
        with pytest.raises(DockairError):
            made.reset(options=options)
        np.testing.assert_array_equal(made.observation()["picture"], seen["picture"])
    again, _ = made.reset(seed=1)
    made.close()
    assert seen["picture"].any()
    assert not again["picture"].any()


def test_a_reset_whose_viewer_cannot_be_opened_leaves_the_flight_before_it(flights, monkeypatch):
    """Or none, at the first reset."""
    is_open, shown = False, []

    class Viewer:
        def show(self, flight, tick, *, is_last=False):
            if not is_open:
                raise MachineError("render_mode", expected="the rerun viewer")
            shown.append((flight, is_last))

    monkeypatch.setattr(envs_episode, "require_viewer", lambda: None)
    monkeypatch.setattr(envs_episode, "LiveViewer", Viewer)
    made = DockEnv(QUICK, render_mode="human")
    with pytest.raises(MachineError):
        made.reset(seed=0)
    assert flights == [] and made._flight is None
    is_open = True
    made.reset(seed=0)
    before, time_s = made._flight, made.tick.truth.time_s
    is_open = False
    with pytest.raises(MachineError):
        made.reset(seed=5)
    assert flights == [before] and made._flight is before
    is_open = True
    made.step(STILL)
    assert made.tick.truth.time_s > time_s and shown == [(before, False)] * 2
    made.close()


def test_a_view_that_cannot_be_closed_keeps_neither_flight_open_nor_seeds(env, flights):
    """Its context belongs to the thread that made it: another's reset fails, and the next one begins anew."""

    class Foreign:
        def close(self):
            raise RuntimeError("EGL_BAD_ACCESS")

    env.reset(seed=0)
    env._view = Foreign()
    drawn = env.np_random.bit_generator.state
    with pytest.raises(RuntimeError, match="EGL_BAD_ACCESS"):
        env.reset(seed=5)
    assert env.np_random.bit_generator.state == drawn
    assert flights == []
    env.reset(seed=5)


def test_what_needs_pictures_is_refused_with_the_environment_that_takes_them():
    instead = "dockair/Dock-v0 in place of dockair/DockFast-v0"
    with pytest.raises(DockairError, match=rf"navigation\.heading: expected false, or {instead}: a heading"):
        DockFastEnv(load_scenario("default", {"navigation.heading": True}))
    acts = f"^scenario: expected {instead}: the scenario has what acts through the picture, "
    for name, reason in (("low_sun_clouds", "clouds"), ("sun_in_view", "the Sun in the camera's field")):
        with pytest.raises(DockairError, match=f"{acts}{reason}$"):
            DockFastEnv(name)
    with pytest.raises(DockairError, match=f"{acts}clouds$"):
        DockFastEnv().reset(seed=0, options={"set": {"weather.cloud_cover": 0.3}})


def test_what_only_the_camera_as_built_does_not_measure_is_refused_likewise(monkeypatch):
    def refuse(*given, **named):
        raise DockairError("camera.sensing", expected='"frames": the scenario has it', got="measurements")

    monkeypatch.setattr(envs_episode, "Flight", refuse)
    with pytest.raises(DockairError, match="^scenario: expected dockair/Dock-v0 in place of .*: the scenario has it$"):
        DockFastEnv().reset(seed=0)


@pytest.mark.parametrize(("made", "own", "other"), [
    (DockFastEnv, "measurements", "frames"), (DockPixelsEnv, "frames", "measurements"),
])  # fmt: skip
def test_another_sensing_than_the_environments_own_is_refused_and_its_own_is_not(made, own, other):
    assert made().chosen_scenario({"set": {"camera.sensing": own}}).camera.sensing == own
    with pytest.raises(DockairError, match=rf'^options\.set: camera\.sensing: expected "{own}", .*, got \'{other}\'$'):
        made().reset(options={"set": {"camera.sensing": other}})
    for table in ({"sensing": other}, f'{{sensing = "{other}"}}'):  # the whole table, as TOML's text too
        with pytest.raises(DockairError, match=rf'^options\.set: camera\.sensing: expected "{own}"'):
            made().reset(options={"set": {"camera": table}})
    assert made().chosen_scenario({"set": {"camera": {"exposure": "auto"}}}).camera.sensing == own


@pytest.mark.parametrize("reward", ["dens", None, 1.0, ["dense"], np.array([1, 2])])
def test_a_reward_that_does_not_exist_is_refused_with_those_that_do(reward):
    with pytest.raises(
        DockairError, match=r"reward: expected one of those that exist(, got .+)?; exists: dense, sparse"
    ):
        DockEnv(reward=reward)


def test_a_setting_that_is_refused_is_named_as_the_caller_of_reset_wrote_it():
    with pytest.raises(DockairError, match=r"^options\.set: turbulence\.sgma"):
        DockFastEnv().reset(options={"set": {"turbulence.sgma": 1}})


@pytest.mark.parametrize("made", [DockEnv, DockFastEnv, DockPixelsEnv])
def test_an_argument_that_does_not_exist_is_refused_with_those_that_do(made):
    exists = "exists: scenario, view, render_mode" if made is DockPixelsEnv else "exists: scenario, render_mode"
    with pytest.raises(DockairError, match=rf"^{made.__name__}: expected a known argument .*, got 'set'; {exists}"):
        made(set={"turbulence.sigma_m_s": 1.0})


def test_attempts_that_would_be_ignored_are_refused():
    with pytest.raises(DockairError, match=r"^attempts: expected none with until_clear: guidance.attempts_max counts"):
        DockFastEnv(until_clear=True, attempts=5)


def test_a_viewer_that_cannot_be_shown_is_refused_before_a_flight_is_built(monkeypatch):
    for name in ("DISPLAY", "WAYLAND_DISPLAY"):
        monkeypatch.delenv(name, raising=False)
    monkeypatch.setattr(display.sys, "platform", "linux")
    monkeypatch.setattr(envs_viewer, "_is_open", lambda: False)
    with pytest.raises(
        MachineError, match="^render_mode: expected a display, or a rerun viewer that is open already; "
    ):
        DockFastEnv(render_mode="human")
    monkeypatch.setattr(envs_viewer, "_is_open", lambda: True)
    assert DockFastEnv(render_mode="human").render_mode == "human"
    monkeypatch.setattr(envs_viewer, "_is_open", lambda: False)
    monkeypatch.setenv("DISPLAY", ":0")
    assert DockFastEnv(render_mode="human").render_mode == "human"


def test_an_open_viewer_is_found_by_its_port(monkeypatch):
    with socket.socket() as listener:
        listener.bind(("127.0.0.1", 0))
        monkeypatch.setattr(envs_viewer, "_PORT", listener.getsockname()[1])
        assert not envs_viewer._is_open()
        listener.listen()
        assert envs_viewer._is_open()


def test_a_navigator_that_does_not_exist_is_refused_before_the_first_reset():
    scenario = load_scenario("default", {"navigation.navigator": "no_such_module:Navigator"} | MEASURED)
    with pytest.raises(DockairError, match=r'^navigation.navigator: expected an importable "module:Class", got '):
        DockFastEnv(scenario)
