"""An episode: reset, step, render, reward, info; what all environments share but the observation.

One step is one control tick (or `ticks_per_step` of them). The world, the sensors and the navigation are those of
`dockair fly`; the action replaces the command of the navigation's guidance. Attempts are judged from the truth, see
`judge`; with `until_clear` the guidance keeps the phases, and the flight ends as its own would.
"""

from collections.abc import Mapping
from contextlib import ExitStack
from copy import deepcopy
from dataclasses import replace
from inspect import signature
from pathlib import Path
from typing import Any, Generic, Literal, SupportsFloat, TypeVar

import gymnasium
import numpy as np
from numpy.typing import NDArray

from dockair.errors import DockairError, check_choice, check_integer
from dockair.messages import ImuSample, ReceiverCommand
from dockair.scenarios.assembly.buildable import require_buildable
from dockair.scenarios.envs.judge import AttemptJudge
from dockair.scenarios.envs.options import command_from, scenario_from
from dockair.scenarios.envs.tables import ACTION, RETRY_REWARD, action_cost, box, outcome_reward, truth_info
from dockair.scenarios.envs.viewer import LiveViewer, require_viewer
from dockair.scenarios.judgement.attempts import succeeded
from dockair.scenarios.judgement.referee import Outcome
from dockair.scenarios.loop import Flight, Tick
from dockair.scenarios.schema import Scenario
from dockair.sim.truth import Truth
from dockair.sim.view import ThirdPersonView
from dockair.streams import LARGEST_SEED

RENDER_MODES = ("human", "rgb_array")
REWARDS = ("dense", "sparse")
PICTURE_PX = (640, 480)  # width, height of `render`
_TRUNCATED = (Outcome.TIMEOUT, Outcome.DIVERGED)
_NO_NAMES = ("self", "options", "unknown")  # of what an environment is made with

Obs = TypeVar("Obs")


class Episodes(gymnasium.Env[Obs, NDArray[np.float32]], Generic[Obs]):
    """What all environments share: everything but the observation."""

    metadata = {"render_modes": list(RENDER_MODES), "render_fps": 100}
    sensing: str | None = None  #: in place of the scenario's own
    full_frames = False  #: read the whole sensor

    def __init__(
        self,
        scenario: str | Path | Scenario = "default",
        *,
        render_mode: str | None = None,
        ticks_per_step: int = 1,
        reward: Literal["dense", "sparse"] = "dense",
        attempts: int | None = None,
        until_clear: bool = False,
        **unknown: Any,
    ) -> None:
        """Check the arguments; nothing is built before `reset`.

        Args:
            scenario: a library name, the path of a TOML file, or a Scenario.
            render_mode: None, "rgb_array" (a third person's view) or "human" (the same episode in the rerun viewer).
            ticks_per_step: control ticks for which an action is held.
            reward: "dense" (distance made good, less the action's cost, and the outcome) or "sparse" (the outcome).
            attempts: how many may fail before the episode ends, 1 by default.
            until_clear: go on as a flight does, until the guidance is clear of the drogue; its attempts are then the
                scenario's `guidance.attempts_max`, and `attempts` is refused.
            unknown: refused.
        """
        if unknown:
            exists = list(signature(type(self).__init__).parameters | signature(Episodes.__init__).parameters)
            expected = "a known argument (of a scenario's keys: scenario=load_scenario(name, {key: value}))"
            raise DockairError(
                type(self).__name__,
                expected=expected,
                got=min(unknown),
                exists=[k for k in exists if k not in _NO_NAMES],
            )
        check_choice("render_mode", render_mode, (None, *RENDER_MODES))
        check_choice("reward", reward, REWARDS)
        check_integer("ticks_per_step", ticks_per_step, 1)
        if not isinstance(until_clear, bool):
            raise DockairError("until_clear", expected="True or False", got=until_clear)
        if until_clear and attempts is not None:
            raise DockairError("attempts", expected="none with until_clear: guidance.attempts_max counts", got=attempts)
        attempts = check_integer("attempts", 1 if attempts is None else attempts, 1)
        if render_mode == "human":
            require_viewer()
        self._source, self._attempts, self._is_dense = scenario, attempts, reward == "dense"
        self._until_clear, self._ticks_per_step = until_clear, ticks_per_step
        self.render_mode = render_mode
        self.action_space: Any = box(ACTION, np.float32)
        self._flight: Flight | None = None
        self._view: ThirdPersonView | None = None
        self._viewer: LiveViewer | None = None
        self._tick: Tick | None = None
        self._outcome: Outcome | None = None
        self._judge, self._seed = AttemptJudge(attempts), 0
        self.imu: ImuSample | None = None  #: the newest sample; None until the first
        chosen = self.chosen_scenario({})
        require_buildable(chosen)  # as every flight does when it is built, but before the first reset
        self.metadata = self._metadata_of(chosen)

    def reset(self, *, seed: int | None = None, options: dict[str, Any] | None = None) -> tuple[Obs, dict[str, Any]]:
        """Begin a flight; its first control tick is flown on the trimmed path.

        A reset that is refused changes nothing: the flight before it goes on.

        Args:
            seed: flies what `dockair fly --seed` flies; None draws one from the environment's own generator.
            options: "scenario" (name, path or Scenario), "set" (dotted key -> value) and "seed" for this flight.

        Raises:
            DockairError: a wrong seed or option, or a flight that cannot be begun or is over with this tick; in mode
                "human", no viewer that can be opened.
        """
        options = {} if options is None else options
        scenario = self.chosen_scenario(options)
        seed = None if seed is None else check_integer("seed", seed, 0, LARGEST_SEED)
        own = options.get("seed")
        chosen = seed if own is None else check_integer("options.seed", own, 0, LARGEST_SEED)
        # a look ahead: only a reset that succeeds draws
        flight_seed = int(deepcopy(self.np_random).integers(LARGEST_SEED, endpoint=True)) if chosen is None else chosen
        flight, judge, tick = self._begun(scenario, flight_seed)
        try:
            self.close()
        except BaseException:  # a view's context belongs to the thread that made it
            flight.close()
            raise
        super().reset(seed=seed)
        if chosen is None:
            self.np_random.integers(LARGEST_SEED, endpoint=True)
        self._flight, self._judge, self._outcome, self.imu = flight, judge, None, None
        self._seed = flight_seed
        self.metadata = self._metadata_of(scenario)
        self.forget()
        self._take(tick)
        return self.observation(), self._info()

    def step(self, action: NDArray[np.float32]) -> tuple[Obs, SupportsFloat, bool, bool, dict[str, Any]]:
        """Hold a command for `ticks_per_step` control ticks; values beyond the space's limits are clipped to them.

        Raises:
            gymnasium.error.ResetNeeded: there is no flight, or it is over.
            DockairError: the action is not six finite real numbers; nothing is flown.
        """
        if self._flight is None or self._tick is None or self._outcome is not None:
            raise gymnasium.error.ResetNeeded("call reset() before step(): there is no flight going on")
        command = command_from(action, self.action_space)
        before_m, failed = self._distance_m(self._tick.truth), 0
        for _ in range(self._ticks_per_step):
            failed += self._fly(self._on_the_path(command))
            if self._outcome is not None:
                break
        reward = failed * RETRY_REWARD
        if self._is_dense:
            step_s = self._ticks_per_step / self._flight.scenario.rates.control_hz
            reward += before_m - self._distance_m(self._tick.truth)
            reward -= action_cost(command.velocity_m_s, command.acceleration_m_s2, step_s)
        if self._outcome is not None:
            unsafe = bool(self._flight.referee.unsafe)
            reward += outcome_reward(self._outcome, is_success=self._is_success(), is_unsafe=unsafe)
        truncated = self._outcome in _TRUNCATED
        terminated = self._outcome is not None and not truncated
        return self.observation(), reward, terminated, truncated, self._info()

    def render(self) -> NDArray[np.uint8] | None:
        """(480, 640, 3) third person's view of the world now; None in the other modes.

        In mode "human" the viewer follows by itself, with every step.

        Raises:
            gymnasium.error.ResetNeeded: there is no flight yet.
            DockairError: the first picture of this flight was drawn in another thread.
        """
        if self.render_mode is None:
            return None
        if self._flight is None:
            raise gymnasium.error.ResetNeeded("call reset() before render()")
        if self.render_mode == "human":
            return None
        if self._view is None:
            self._view = ThirdPersonView(self._flight.world.model, *PICTURE_PX)
        truth = self._flight.truth
        return self._view.render(self._flight.world.data, 0.5 * (truth.p_WP + truth.p_WD))

    def close(self) -> None:
        """Free the off-screen contexts; who drew pictures closes in the same thread.

        Raises:
            DockairError: in another thread; what could be freed is.
        """
        held = self._flight, self._view
        self._view = self._flight = self._tick = None
        with ExitStack() as closing:  # the flight, too, where the view cannot be
            for one in held:
                if one is not None:
                    closing.callback(one.close)

    def observation(self) -> Obs:
        """Return what is observed now; new arrays."""
        raise NotImplementedError

    def new_flight(self, scenario: Scenario, seed: int) -> Flight:
        """Build a flight of a scenario that `chosen_scenario` has returned."""
        return Flight(scenario, seed, full_frames=self.full_frames)

    def forget(self) -> None:
        """Forget what `note` took of the flight before."""

    def note(self, tick: Tick) -> None:
        """Take what a control tick brought that the observation needs."""

    @property
    def tick(self) -> Tick:
        """The newest control tick."""
        assert self._tick is not None
        return self._tick

    def _begun(self, scenario: Scenario, seed: int) -> tuple[Flight, AttemptJudge, Tick]:
        """Return a new flight, its judge and its first control tick, shown; one that is refused is closed."""
        flight, judge, command = self.new_flight(scenario, seed), AttemptJudge(self._attempts), ReceiverCommand()
        try:
            tick, _, outcome = self._flown(flight, judge, command)
            if outcome is not None:
                expected = "a flight that goes on after its first control tick"
                raise DockairError("reset", expected=expected, got=outcome.value)
            self._show(flight, tick, command)
        except BaseException:
            flight.close()
            raise
        return flight, judge, tick

    def _fly(self, command: ReceiverCommand) -> int:
        """Fly one control tick; return how many attempts failed in it and did not end the episode."""
        assert self._flight is not None
        tick, failed, self._outcome = self._flown(self._flight, self._judge, command)
        self._take(tick)
        self._show(self._flight, tick, command, is_last=self._outcome is not None)
        return failed

    def _flown(self, flight: Flight, judge: AttemptJudge, command: ReceiverCommand) -> tuple[Tick, int, Outcome | None]:
        """Fly one control tick; return it, how many attempts failed and did not end the episode, and the outcome."""
        attempt = flight.referee.attempt
        tick = flight.step(command)
        if self._until_clear:  # that another attempt begins says that the last one failed
            return tick, flight.referee.attempt - attempt, tick.outcome
        failed, outcome = judge.watch(tick.truth, tick.touched)
        if tick.outcome in (Outcome.COLLISION, Outcome.DIVERGED):
            outcome = tick.outcome
        elif outcome is None and tick.truth.time_s >= flight.scenario.flight.duration_s:
            outcome = judge.unfinished or Outcome.TIMEOUT
        return tick, int(failed and outcome in (None, Outcome.TIMEOUT)), outcome

    def _take(self, tick: Tick) -> None:
        """Make a control tick the newest."""
        self._tick = tick
        self.imu = tick.imu[-1] if tick.imu else self.imu
        self.note(tick)

    def _show(self, flight: Flight, tick: Tick, command: ReceiverCommand, *, is_last: bool = False) -> None:
        """Let the viewer follow, if there is to be one; what is commanded is the policy's, not the guidance's."""
        if self.render_mode == "human":
            self._viewer = self._viewer or LiveViewer()
            flown = replace(tick, solution=replace(tick.solution, command=command))
            self._viewer.show(flight, flown, is_last=is_last)

    def chosen_scenario(self, options: Mapping[str, Any]) -> Scenario:
        """Return the scenario that reset's options ask for, with the environment's own sensing, checked."""
        scenario = scenario_from(options, self._source)
        tick_s = 1.0 / scenario.rates.control_hz
        if scenario.flight.duration_s <= tick_s:
            expected = f"more than the one control tick that reset flies, {tick_s:g} s"
            raise DockairError("flight.duration_s", expected=expected, got=scenario.flight.duration_s)
        sensing, settings = scenario.camera.sensing, options.get("set", {})
        asked = "camera.sensing" in settings or "camera" in settings and "sensing" in scenario.camera.model_fields_set
        if asked and self.sensing not in (None, sensing):
            # a scenario's own gives way to the environment's; what is asked for here would be ignored without a word
            expected = f'"{self.sensing}", which this environment is made for'
            raise DockairError("options.set: camera.sensing", expected=expected, got=sensing)
        return self.with_sensing(scenario)

    def with_sensing(self, scenario: Scenario) -> Scenario:
        """Return a scenario with the environment's own sensing.

        Raises:
            DockairError: it cannot be flown so.
        """
        if self.sensing is None:
            return scenario
        if scenario.navigation.is_truth:
            expected = "one that looks through the camera, or at what is measured in its place"
            raise DockairError("navigation.navigator", expected=expected, got="truth")
        camera = scenario.camera.model_copy(update={"sensing": self.sensing})
        changed = scenario.model_copy(update={"camera": camera})
        return Scenario.model_validate(changed.model_dump(exclude_unset=True))  # a copy alone is not checked

    def _metadata_of(self, scenario: Scenario) -> dict[str, Any]:
        """Return the class's metadata, a copy, with the steps a second of a scenario."""
        return type(self).metadata | {"render_fps": scenario.rates.control_hz / self._ticks_per_step}

    def _on_the_path(self, command: ReceiverCommand) -> ReceiverCommand:
        """What is flown: the command as an increment on the path that the tanker has announced."""
        path = self.tick.solution.command
        return replace(command, turn_rate_rad_s=path.turn_rate_rad_s, climb_rad=path.climb_rad)

    def _distance_m(self, truth: Truth) -> float:
        assert self._flight is not None
        depth_m = self._flight.sheets.coupling_depth_m
        return float(np.linalg.norm(truth.p_DP - np.array([depth_m, 0.0, 0.0])))

    def _info(self) -> dict[str, Any]:
        assert self._flight is not None and self._tick is not None
        tick, outcome = self._tick, self._outcome
        return {
            "scenario": self._flight.scenario.name,
            "seed": self._seed,
            "is_success": self._is_success(),
            "outcome": outcome.value if outcome is not None else "",
            "unsafe": "; ".join(self._flight.referee.unsafe),
            "attempt": self._flight.referee.attempt if self._until_clear else self._judge.number,
            "phase": tick.solution.phase,
            "sensing": self._flight.scenario.sensing,
            "truth": truth_info(tick.truth, self._distance_m(tick.truth), self._flight.referee.contact),
        }

    def _is_success(self) -> bool:
        """Whether the episode has ended in a good contact."""
        assert self._flight is not None and self._tick is not None
        if self._outcome is not Outcome.CONTACT:
            return False
        return succeeded(self._flight.referee.attempt_log(self._tick.truth.time_s, self._outcome))
