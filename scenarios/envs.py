"""`dockair/Dock-v0`: fly the receiver on the navigation's solution, camera in the loop (docs/environments.md).

One step is one control tick (or `ticks_per_step` of them). The world, the sensors and the navigation are those of
`dockair fly`; the action replaces the command of the navigation's guidance. The guidance goes on keeping its phases
from its own estimate, and calls a flight off as it would its own.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, SupportsFloat

import gymnasium
import numpy as np
from gymnasium import spaces
from numpy.typing import NDArray

from dockair.errors import DockairError
from dockair.messages import NavSolution, ReceiverCommand
from dockair.rotations import log
from dockair.scenarios.loop import Flight, Tick
from dockair.scenarios.referee import Contact, Outcome
from dockair.scenarios.schema import Scenario, load_scenario
from dockair.sim.truth import Truth
from dockair.sim.view import ThirdPersonView

VELOCITY_LIMIT_M_S = 2.5  # the guidance's own limits: what its flight control is tuned for
ACCELERATION_LIMIT_M_S2 = 2.0
FRAME_AGE_LIMIT_S = 10.0
PICTURE_PX = (640, 480)  # width, height of `render`


@dataclass(frozen=True, slots=True)
class Entry:
    """One row of the table of observations or actions."""

    name: str
    unit: str
    low: float
    high: float


def _vector(name: str, unit: str, limit: float, low: float | None = None) -> list[Entry]:
    return [Entry(f"{name}_{axis}", unit, -limit if low is None else low, limit) for axis in "xyz"]


#: The observation, in order: what the navigation believes and wants, and the newest gyro sample. Never the truth.
OBSERVATION = (
    Entry("valid", "0 or 1", 0.0, 1.0),
    *_vector("p_PD_B", "m", 100.0),
    *_vector("v_PD_B", "m/s", 50.0),
    *_vector("log_R_BD", "rad", np.pi),
    *_vector("sigma_R_BD", "rad", np.pi, 0.0),
    *_vector("sigma_p_PD_B", "m", 100.0, 0.0),
    *_vector("sigma_v_PD_B", "m/s", 50.0, 0.0),
    Entry("frame_age", "s", 0.0, FRAME_AGE_LIMIT_S),
    Entry("leds_seen", "count", 0.0, 8.0),
    *_vector("gyro", "rad/s", 20.0),
    *_vector("navigator_command_velocity", "m/s", VELOCITY_LIMIT_M_S),
    *_vector("navigator_command_acceleration", "m/s^2", ACCELERATION_LIMIT_M_S2),
    Entry("time", "s", 0.0, 600.0),
)
#: The action, in order: `ReceiverCommand`, beyond the trimmed flight path, body axes.
ACTION = (*_vector("velocity", "m/s", VELOCITY_LIMIT_M_S), *_vector("acceleration", "m/s^2", ACCELERATION_LIMIT_M_S2))

#: Added to the last step's reward.
OUTCOME_REWARD = {
    Outcome.CONTACT: 10.0,
    Outcome.MISS: -5.0,
    Outcome.RIM_STRIKE: -5.0,
    Outcome.ABORT: -5.0,
    Outcome.COLLISION: -20.0,
    Outcome.TIMEOUT: 0.0,
    Outcome.DIVERGED: 0.0,
}
_ACTION_COST_1_S = 0.02  # of a full deflection of every axis; small beside the 1.2 of a second's approach at 1.2 m/s


def _box(entries: tuple[Entry, ...], dtype: type[np.floating[Any]]) -> Any:
    low, high = (np.array([getattr(entry, side) for entry in entries], dtype) for side in ("low", "high"))
    return spaces.Box(low, high, dtype=dtype)


class DockEnv(gymnasium.Env[NDArray[np.float64], NDArray[np.float32]]):
    """Dock a receiver by vision; see OBSERVATION, ACTION and docs/environments.md.

    Args:
        scenario: a library name, the path of a TOML file, or a Scenario.
        render_mode: None or "rgb_array" (a third person's view).
        ticks_per_step: control ticks for which an action is held.
        until_clear: go on after contact, until the receiver is clear of the drogue again.
    """

    metadata = {"render_modes": ["rgb_array"], "render_fps": 100}

    def __init__(
        self,
        scenario: str | Path | Scenario = "default",
        *,
        render_mode: str | None = None,
        ticks_per_step: int = 1,
        until_clear: bool = False,
    ) -> None:
        if render_mode not in (None, "rgb_array"):
            raise DockairError("render_mode", expected="None or one of", got=render_mode, exists=["rgb_array"])
        if ticks_per_step < 1:
            raise DockairError("ticks_per_step", expected="an integer from 1 on", got=ticks_per_step)
        self._source = scenario
        self._until_clear, self._ticks_per_step = until_clear, ticks_per_step
        self.render_mode = render_mode
        self.observation_space = _box(OBSERVATION, np.float64)
        self.action_space = _box(ACTION, np.float32)
        self._flight: Flight | None = None
        self._view: ThirdPersonView | None = None
        self._tick: Tick | None = None
        chosen = self._scenario({})
        self.metadata = self.metadata | {"render_fps": chosen.rates.control_hz / ticks_per_step}

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[NDArray[np.float64], dict[str, Any]]:
        """Begin a flight; its first control tick is flown on the trimmed path.

        Args:
            seed: flies what `dockair fly --seed` flies; None draws one from the environment's own generator.
            options: "scenario" (name, path or Scenario) and "set" (dotted key -> value) for this flight.
        """
        super().reset(seed=seed)
        scenario = self._scenario(options or {})
        flight_seed = int(self.np_random.integers(2**63)) if seed is None else seed
        self.close()
        self._flight = Flight(scenario, flight_seed)
        self._tick = self._flight.step(ReceiverCommand())
        return self._observation(), self._info(self._tick, None)

    def step(
        self, action: NDArray[np.float32]
    ) -> tuple[NDArray[np.float64], SupportsFloat, bool, bool, dict[str, Any]]:
        """Hold a command for `ticks_per_step` control ticks; values beyond the space's limits are clipped to them.

        Raises:
            gymnasium.error.ResetNeeded: there is no flight, or it is over.
            DockairError: the action has a wrong shape or is not finite.
        """
        if self._flight is None or self._tick is None or self._outcome(self._tick) is not None:
            raise gymnasium.error.ResetNeeded("call reset() before step(): there is no flight going on")
        command = self._command(action)
        before_m = self._distance_m(self._tick.truth)
        for _ in range(self._ticks_per_step):
            self._tick = self._flight.step(command)
            outcome = self._outcome(self._tick)
            if outcome is not None:
                break
        truncated = outcome in (Outcome.TIMEOUT, Outcome.DIVERGED)
        reward = before_m - self._distance_m(self._tick.truth) - self._action_cost(command)
        if outcome is not None:
            reward += OUTCOME_REWARD[outcome]
        terminated = outcome is not None and not truncated
        return self._observation(), reward, terminated, truncated, self._info(self._tick, outcome)

    def render(self) -> NDArray[np.uint8] | None:
        """(480, 640, 3) third person's view of the world now; None without a render mode.

        Raises:
            gymnasium.error.ResetNeeded: there is no flight yet.
        """
        if self.render_mode is None:
            return None
        if self._flight is None:
            raise gymnasium.error.ResetNeeded("call reset() before render()")
        if self._view is None:
            self._view = ThirdPersonView(self._flight.world.model, *PICTURE_PX)
        truth = self._flight.truth
        return self._view.render(self._flight.world.data, 0.5 * (truth.p_WP + truth.p_WD))

    def close(self) -> None:
        """Free the off-screen contexts."""
        if self._view is not None:
            self._view.close()
        if self._flight is not None:
            self._flight.close()
        self._view = self._flight = self._tick = None

    def _scenario(self, options: Mapping[str, Any]) -> Scenario:
        unknown = sorted(set(options) - {"scenario", "set"})
        if unknown:
            raise DockairError("options", expected="a known key", got=unknown[0], exists=["scenario", "set"])
        source, settings = options.get("scenario", self._source), options.get("set", {})
        if not isinstance(source, Scenario):
            return load_scenario(source, settings)
        if settings:
            raise DockairError("options.set", expected="a scenario's name or path beside it", got="a Scenario")
        return source

    def _command(self, action: NDArray[np.float32]) -> ReceiverCommand:
        values = np.asarray(action, dtype=np.float64)
        if values.shape != self.action_space.shape or not np.isfinite(values).all():
            raise DockairError("action", expected=f"{len(ACTION)} finite numbers", got=action)
        values = np.clip(values, self.action_space.low, self.action_space.high)  # type: ignore[attr-defined]
        return ReceiverCommand(velocity_m_s=values[:3], acceleration_m_s2=values[3:])

    def _outcome(self, tick: Tick) -> Outcome | None:
        if tick.outcome is None and tick.truth.latched and not self._until_clear:
            return Outcome.CONTACT
        return tick.outcome

    def _distance_m(self, truth: Truth) -> float:
        assert self._flight is not None
        depth_m = self._flight.sheets.coupling_depth_m
        return float(np.linalg.norm(truth.p_DP - np.array([depth_m, 0.0, 0.0])))

    def _action_cost(self, command: ReceiverCommand) -> float:
        assert self._flight is not None
        step_s = self._ticks_per_step / self._flight.scenario.rates.control_hz
        deflection = np.concatenate(
            [command.velocity_m_s / VELOCITY_LIMIT_M_S, command.acceleration_m_s2 / ACCELERATION_LIMIT_M_S2]
        )
        return float(_ACTION_COST_1_S * step_s * np.mean(deflection**2))

    def _observation(self) -> NDArray[np.float64]:
        assert self._tick is not None
        values = observation_from(self._tick.solution, self._tick)
        return np.clip(values, self.observation_space.low, self.observation_space.high)  # type: ignore[attr-defined]

    def _info(self, tick: Tick, outcome: Outcome | None) -> dict[str, Any]:
        assert self._flight is not None
        return {
            "is_success": outcome is Outcome.CONTACT,
            "outcome": outcome.value if outcome is not None else "",
            "phase": tick.solution.phase,
            "truth": _truth_info(tick.truth, self._distance_m(tick.truth), self._flight.referee.contact),
        }


def observation_from(solution: NavSolution, tick: Tick) -> NDArray[np.float64]:
    """(n,) values of OBSERVATION before they are clipped to its limits; all finite but for overflow beyond them.

    A standard deviation that is not known (NaN) is infinite, and so ends at its limit.
    """
    variances = np.diag(solution.covariance)
    sigmas = np.sqrt(np.where(variances >= 0.0, variances, np.inf))
    age_s = solution.time_stamp_s - solution.frame_time_stamp_s
    gyro = tick.imu[-1].angular_rate_rad_s if tick.imu else np.zeros(3)
    parts: list[Any] = [
        [float(solution.valid)],
        solution.p_PD_B,
        solution.v_PD_B,
        log(solution.R_BD),
        sigmas,
        [age_s if np.isfinite(age_s) else FRAME_AGE_LIMIT_S],
        [np.isfinite(solution.led_pixels_px[:, 0]).sum()],
        gyro,
        solution.command.velocity_m_s,
        solution.command.acceleration_m_s2,
        [solution.time_stamp_s],
    ]
    return np.nan_to_num(np.concatenate(parts).astype(np.float64), nan=0.0, posinf=np.inf, neginf=-np.inf)


def _truth_info(truth: Truth, distance_m: float, contact: Contact | None) -> dict[str, float]:
    """For evaluation only: a policy that reads it flies on perfect navigation."""
    x, y, z = (float(value) for value in truth.p_PD_B)
    closing = -truth.R_WD[:, 0] @ (truth.v_WD - truth.v_WP)
    return {
        "time_s": truth.time_s,
        "p_PD_B_x_m": x,
        "p_PD_B_y_m": y,
        "p_PD_B_z_m": z,
        "distance_m": distance_m,
        "closing_speed_m_s": float(closing),
        "reel_position_m": float(truth.reel_position_m),
        "latched": float(truth.latched),
        "contact_radial_offset_m": contact.radial_offset_m if contact is not None else float("inf"),
        "contact_closure_speed_m_s": contact.closure_speed_m_s if contact is not None else 0.0,
    }
