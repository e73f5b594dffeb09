"""Learn what to add to a linear policy with stable-baselines3's SAC: residual policy learning.

    pip install stable-baselines3
    python examples/learn_policy.py [STEPS] [EVALUATED]

Who begins with nothing comes to hover astern, where nothing is lost; this begins with a policy that docks now and then.
What it begins with and what it has learned are then flown on seeds that neither has met, the latter by camera, too.
What it was worth, and what else was tried: docs/environments.md#with-a-library.
"""

import os
import sys
from collections.abc import Callable
from typing import Any

import gymnasium
import numpy as np
from learn_gains import EVALUATED_FROM, INDEX, MOST_M_S, MOST_M_S2, STEP_S, TICKS, linear, place_and_rate
from numpy.typing import NDArray

from dockair.scenarios.schema import load_scenario

CONDITIONS = {"flight.duration_s": 10.0}
GAINS = 0.57, 1.38, 0.79  # those that examples/learn_gains.py finds
ADDED_MOST_M_S2 = 0.5  # to what the linear policy accelerates by, on each axis
FAST, BY_CAMERA = "dockair/DockFast-v0", "dockair/Dock-v0"

Seen = NDArray[np.float32]


class Added(gymnasium.Wrapper[Seen, Seen, NDArray[np.float64], Seen]):
    """Takes what to add to the linear policy's acceleration, of the most; sums that to the velocity.

    | observed | what |
    |---|---|
    | 0-2 | where the ring is, body axes [m] |
    | 3-5 | how that changes, in axes that turn with the receiver [m/s] |
    | 6-8 | the velocity that is commanded [m/s] |
    | 9 | whether the belief may be flown on |
    """

    def __init__(self, env: gymnasium.Env[NDArray[np.float64], Seen]) -> None:
        """Wrap an environment that observes a belief."""
        super().__init__(env)
        self.action_space = gymnasium.spaces.Box(-1.0, 1.0, (3,), np.float32)
        self.observation_space = gymnasium.spaces.Box(-np.inf, np.inf, (10,), np.float32)
        self._velocity_m_s, self._now = np.zeros(3), np.zeros(10, np.float32)

    def reset(self, *, seed: int | None = None, options: dict[str, Any] | None = None) -> tuple[Seen, dict[str, Any]]:
        """Begin with no command."""
        observation, info = self.env.reset(seed=seed, options=options)
        self._velocity_m_s = np.zeros(3)
        return self._seen(observation), info

    def step(self, action: Seen) -> tuple[Seen, float, bool, bool, dict[str, Any]]:
        """Accelerate by so much more."""
        added = ADDED_MOST_M_S2 * np.clip(action, -1.0, 1.0)
        acceleration = np.clip(begun_with(self._now) + added, -MOST_M_S2, MOST_M_S2)
        self._velocity_m_s = np.clip(self._velocity_m_s + STEP_S * acceleration, -MOST_M_S, MOST_M_S)
        command = np.concatenate([self._velocity_m_s, acceleration]).astype(np.float32)
        observation, reward, terminated, truncated, info = self.env.step(command)
        return self._seen(observation), float(reward), terminated, truncated, info

    def _seen(self, observation: NDArray[np.float64]) -> Seen:
        seen = [*place_and_rate(observation), self._velocity_m_s, [observation[INDEX["valid"]]]]
        self._now = np.concatenate(seen).astype(np.float32)
        return self._now


def made(name: str = FAST) -> Added:
    """Return a new environment."""
    return Added(gymnasium.make(name, scenario=load_scenario("default", CONDITIONS), ticks_per_step=TICKS))


def begun_with(seen: Seen) -> Seen:
    """(3,) acceleration [m/s^2] of the linear policy, for (10,) of what is observed."""
    return linear(GAINS, seen[0:3], seen[3:6]) * seen[9]


def evaluated(policy: Callable[[Seen], Seen], name: str, flights: int) -> str:
    """Fly a policy on new seeds; say how often it docked."""
    env, good, unsafe = made(name), 0, 0
    for seed in range(EVALUATED_FROM, EVALUATED_FROM + flights):
        seen, info = env.reset(seed=seed)
        terminated = truncated = False
        while not (terminated or truncated):
            seen, _, terminated, truncated, info = env.step(policy(seen))
        good, unsafe = good + info["is_success"], unsafe + bool(info["unsafe"])
    env.close()
    return f"{name}: good contact in {good} of {flights} on new seeds, {unsafe} unsafe"


def main(steps: str = "40000", flights: str = "40") -> None:
    """Learn, and say what it was worth."""
    import torch
    from stable_baselines3 import SAC
    from stable_baselines3.common.vec_env import SubprocVecEnv, VecMonitor

    torch.set_num_threads(1)  # the flights need the cores
    envs = VecMonitor(SubprocVecEnv([made] * len(os.sched_getaffinity(0)), start_method="spawn"))
    envs.seed(0)
    model = SAC(
        "MlpPolicy", envs, seed=0, device="cpu", verbose=1, learning_rate=1e-3, learning_starts=1000, gradient_steps=4,
        ent_coef="auto_0.01", policy_kwargs={"net_arch": [64, 64]},
    )  # fmt: skip
    model.learn(int(steps), log_interval=20)
    model.save("docking")
    envs.close()

    def learned(seen: Seen) -> Seen:
        action: Seen = model.predict(seen, deterministic=True)[0]
        return action

    print("before:", evaluated(lambda seen: np.zeros(3, np.float32), FAST, int(flights)), flush=True)
    for name in (FAST, BY_CAMERA):
        print("after:", evaluated(learned, name, int(flights)), flush=True)


if __name__ == "__main__":
    main(*sys.argv[1:])
