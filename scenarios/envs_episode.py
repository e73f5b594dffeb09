"""An episode: reset, step, render, reward, info; what all environments share but the observation.

One step is one control tick (or `ticks_per_step` of them). The world, the sensors and the navigation are those of
`dockair fly`; the action replaces the command of the navigation's guidance. Attempts are judged from the truth, see
`envs_judge`; with `until_clear` the guidance keeps the phases, and the flight ends as its own would.
"""

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any, Generic, Literal, SupportsFloat, TypeVar

import gymnasium
import numpy as np
from numpy.typing import NDArray

from dockair.errors import DockairError, check_choice, check_integer
from dockair.messages import ImuSample, ReceiverCommand
from dockair.scenarios.attempts import succeeded
from dockair.scenarios.envs_judge import AttemptJudge
from dockair.scenarios.envs_tables import ACTION, OUTCOME_REWARD, RETRY_REWARD, action_cost, box, truth_info
from dockair.scenarios.envs_viewer import LiveViewer
from dockair.scenarios.loop import Flight, Tick
from dockair.scenarios.referee import Outcome
from dockair.scenarios.schema import Scenario, load_scenario
from dockair.sim.truth import Truth
from dockair.sim.view import ThirdPersonView

RENDER_MODES = ("human", "rgb_array")
REWARDS = ("dense", "sparse")
PICTURE_PX = (640, 480)  # width, height of `render`
_TRUNCATED = (Outcome.TIMEOUT, Outcome.DIVERGED)

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
        attempts: int = 1,
        until_clear: bool = False,
    ) -> None:
        """Check the arguments; nothing is built before `reset`.

        Args:
            scenario: a library name, the path of a TOML file, or a Scenario.
            render_mode: None, "rgb_array" (a third person's view) or "human" (the same episode in the rerun viewer).
            ticks_per_step: control ticks for which an action is held.
            reward: "dense" (distance made good, less the action's cost, and the outcome) or "sparse" (the outcome).
            attempts: how many may fail before the episode ends.
            until_clear: go on as a flight does, until the guidance is clear of the drogue; `attempts` is then its own.
        """
        check_choice("render_mode", render_mode, (None, *RENDER_MODES))
        check_choice("reward", reward, REWARDS)
        check_integer("ticks_per_step", ticks_per_step, 1)
        check_integer("attempts", attempts, 1)
        self._source, self._attempts, self._is_dense = scenario, attempts, reward == "dense"
        self._until_clear, self._ticks_per_step = until_clear, ticks_per_step
        self.render_mode = render_mode
        self.action_space: Any = box(ACTION, np.float32)
        self._flight: Flight | None = None
        self._view: ThirdPersonView | None = None
        self._viewer: LiveViewer | None = None
        self._tick: Tick | None = None
        self._outcome: Outcome | None = None
        self._judge = AttemptJudge(attempts)
        self.imu: ImuSample | None = None  #: the newest sample; None until the first
        chosen = self.chosen_scenario({})
        self.metadata = self.metadata | {"render_fps": chosen.rates.control_hz / ticks_per_step}

    def reset(self, *, seed: int | None = None, options: dict[str, Any] | None = None) -> tuple[Obs, dict[str, Any]]:
        """Begin a flight; its first control tick is flown on the trimmed path.

        Args:
            seed: flies what `dockair fly --seed` flies; None draws one from the environment's own generator.
            options: "scenario" (name, path or Scenario), "set" (dotted key -> value) and "seed" for this flight.
        """
        super().reset(seed=seed)
        options = options or {}
        scenario = self.chosen_scenario(options)
        chosen = options.get("seed", seed)
        flight_seed = self.np_random.integers(2**63) if chosen is None else check_integer("options.seed", chosen, 0)
        self.close()
        self._flight = Flight(scenario, int(flight_seed), full_frames=self.full_frames)
        self._judge, self._outcome, self.imu = AttemptJudge(self._attempts), None, None
        self._fly(ReceiverCommand())
        return self.observation(), self._info()

    def step(self, action: NDArray[np.float32]) -> tuple[Obs, SupportsFloat, bool, bool, dict[str, Any]]:
        """Hold a command for `ticks_per_step` control ticks; values beyond the space's limits are clipped to them.

        Raises:
            gymnasium.error.ResetNeeded: there is no flight, or it is over.
            DockairError: the action has a wrong shape or is not finite.
        """
        if self._flight is None or self._tick is None or self._outcome is not None:
            raise gymnasium.error.ResetNeeded("call reset() before step(): there is no flight going on")
        command = self._command(action)
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
            reward += OUTCOME_REWARD[self._outcome]
        truncated = self._outcome in _TRUNCATED
        terminated = self._outcome is not None and not truncated
        return self.observation(), reward, terminated, truncated, self._info()

    def render(self) -> NDArray[np.uint8] | None:
        """(480, 640, 3) third person's view of the world now; None in the other modes.

        In mode "human" the viewer follows by itself, with every step.

        Raises:
            gymnasium.error.ResetNeeded: there is no flight yet.
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
        """Free the off-screen contexts."""
        for held in (self._view, self._flight):
            if held is not None:
                held.close()
        self._view = self._flight = self._tick = None

    def observation(self) -> Obs:
        """Return what is observed now; new arrays."""
        raise NotImplementedError

    def note(self, tick: Tick) -> None:
        """Take what a control tick brought that the observation needs."""

    @property
    def tick(self) -> Tick:
        """The newest control tick."""
        assert self._tick is not None
        return self._tick

    def _fly(self, command: ReceiverCommand) -> int:
        """Fly one control tick; return how many attempts failed in it that are not the last."""
        assert self._flight is not None
        attempt = self._flight.referee.attempt
        self._tick = tick = self._flight.step(command)
        self.imu = tick.imu[-1] if tick.imu else self.imu
        self.note(tick)
        if self.render_mode == "human":
            self._viewer = self._viewer or LiveViewer()
            self._viewer.show(self._flight, tick)
        if self._until_clear:
            self._outcome = tick.outcome
            return self._flight.referee.attempt - attempt  # that another begins says that the last one failed
        failed, self._outcome = self._judge.watch(tick.truth, tick.touched)
        if tick.outcome in (Outcome.COLLISION, Outcome.DIVERGED):
            self._outcome = tick.outcome
        elif self._outcome is None and tick.truth.time_s >= self._flight.scenario.flight.duration_s:
            self._outcome = self._judge.unfinished or Outcome.TIMEOUT
        return int(failed and self._outcome is None)

    def chosen_scenario(self, options: Mapping[str, Any]) -> Scenario:
        """Return the scenario that reset's options ask for, checked."""
        exists = ("scenario", "seed", "set")
        unknown = sorted(set(options) - set(exists))
        if unknown:
            raise DockairError("options", expected="a known key", got=unknown[0], exists=exists)
        source, settings = options.get("scenario", self._source), options.get("set", {})
        if not isinstance(settings, Mapping):
            raise DockairError("options.set", expected="a dictionary of dotted key -> value", got=settings)
        if not isinstance(source, (str, Path, Scenario)):
            raise DockairError("scenario", expected="a name, a path or a Scenario", got=source)
        if not isinstance(source, Scenario):
            scenario = load_scenario(source, settings)
        elif settings:
            raise DockairError("options.set", expected="a scenario's name or path beside it", got="a Scenario")
        else:
            scenario = source
        if self.sensing is None:
            return scenario
        if scenario.navigation.is_truth:
            expected = "one that looks through the camera, or at what is measured in its place"
            raise DockairError("navigation.navigator", expected=expected, got="truth")
        camera = scenario.camera.model_copy(update={"sensing": self.sensing})
        changed = scenario.model_copy(update={"camera": camera})
        return Scenario.model_validate(changed.model_dump(exclude_unset=True))  # a copy alone is not checked

    def _command(self, action: NDArray[np.float32]) -> ReceiverCommand:
        values = np.asarray(action, dtype=np.float64)
        if values.shape != self.action_space.shape or not np.isfinite(values).all():
            raise DockairError("action", expected=f"{len(ACTION)} finite numbers", got=action)
        values = np.clip(values, self.action_space.low, self.action_space.high)
        return ReceiverCommand(velocity_m_s=values[:3], acceleration_m_s2=values[3:])

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
            "is_success": outcome is Outcome.CONTACT and self._docked_well(),
            "outcome": outcome.value if outcome is not None else "",
            "attempt": self._flight.referee.attempt if self._until_clear else self._judge.number,
            "phase": tick.solution.phase,
            "truth": truth_info(tick.truth, self._distance_m(tick.truth), self._flight.referee.contact),
        }

    def _docked_well(self) -> bool:
        assert self._flight is not None and self._tick is not None
        return succeeded(self._flight.referee.attempt_log(self._tick.truth.time_s, self._outcome))
