"""Learn to dock with stable-baselines3's SAC: a velocity from where the ring is and how that changes.

    pip install stable-baselines3
    python examples/learn_policy.py [STEPS] [SHOWN] [EVALUATED] [SEED]

Some flights of a linear policy are shown first: its transitions are in the replay buffer before the first is its own.
What was shown and what has been learned are then flown on seeds that neither has met, the latter by camera, too. What
it was worth, and what else was tried: docs/environments.md#with-a-library.
"""

import os
import sys
from collections.abc import Callable
from typing import Any

import gymnasium
import numpy as np
from learn_gains import EVALUATED_FROM, INDEX, STEP_S, TICKS, linear, place_and_rate
from numpy.typing import NDArray

from dockair.scenarios.schema import load_scenario

CONDITIONS = {"flight.duration_s": 8.0}  # in the gusts of `default`, 0.5 m/s; a good approach is over after 6
MOST_M_S = np.array([2.0, 1.0, 1.0])  # forward, left, up
UNIT_M = np.array([2.0, 0.25, 0.25])  # of places, and per second of rates: what counts is of size 1 to the network
GAINS = 2.50, 3.94, 0.82  # those that examples/learn_gains.py finds
NOISE_M_S = 0.1  # beside what is shown, so that it is seen what comes of other velocities
FAST, BY_CAMERA = "dockair/DockFast-v0", "dockair/Dock-v0"

Seen = NDArray[np.float32]


class Steered(gymnasium.Wrapper[Seen, Seen, NDArray[np.float64], Seen]):
    """Takes a velocity, of the most on each axis, and asks for no acceleration beside it.

    | observed | what |
    |---|---|
    | 0-2 | where the ring is, body axes, in units of `UNIT_M` |
    | 3-5 | how that changes, in axes that turn with the receiver, likewise per second |
    | 6-8 | the velocity that is commanded [m/s]: the receiver drifts by itself, and the next is to be near the last |
    | 9 | whether the belief may be flown on |
    """

    def __init__(self, env: gymnasium.Env[NDArray[np.float64], Seen]) -> None:
        """Wrap an environment that observes a belief."""
        super().__init__(env)
        self.action_space = gymnasium.spaces.Box(-1.0, 1.0, (3,), np.float32)
        self.observation_space = gymnasium.spaces.Box(-np.inf, np.inf, (10,), np.float32)
        self._velocity_m_s = np.zeros(3)

    def reset(self, *, seed: int | None = None, options: dict[str, Any] | None = None) -> tuple[Seen, dict[str, Any]]:
        """Begin with no command."""
        observation, info = self.env.reset(seed=seed, options=options)
        self._velocity_m_s = np.zeros(3)
        return self._seen(observation), info

    def step(self, action: Seen) -> tuple[Seen, float, bool, bool, dict[str, Any]]:
        """Fly at this velocity."""
        self._velocity_m_s = MOST_M_S * np.clip(action, -1.0, 1.0)
        command = np.concatenate([self._velocity_m_s, np.zeros(3)]).astype(np.float32)
        observation, reward, terminated, truncated, info = self.env.step(command)
        return self._seen(observation), float(reward), terminated, truncated, info

    def _seen(self, observation: NDArray[np.float64]) -> Seen:
        place, rate = place_and_rate(observation)
        seen = [place / UNIT_M, rate / UNIT_M, self._velocity_m_s, [observation[INDEX["valid"]]]]
        return np.concatenate(seen).astype(np.float32)


def made(name: str = FAST) -> Steered:
    """Return a new environment."""
    return Steered(gymnasium.make(name, scenario=load_scenario("default", CONDITIONS), ticks_per_step=TICKS))


def shown(seen: Seen) -> Seen:
    """(..., 3) action of the linear policy, for (..., 10) of what is observed."""
    actions = []
    for one in seen.reshape(-1, 10):
        acceleration = linear(GAINS, one[0:3] * UNIT_M, one[3:6] * UNIT_M) * one[9]
        actions.append((one[6:9] + STEP_S * acceleration) / MOST_M_S)
    return np.clip(np.reshape(actions, (*seen.shape[:-1], 3)), -1.0, 1.0).astype(np.float32)


def show(model: Any, flights: int) -> None:
    """Put so many flights of the linear policy into the replay buffer."""
    envs, rng, over = model.get_env(), np.random.default_rng(0), 0
    seen = envs.reset()
    while over < flights:
        noise = rng.normal(0.0, NOISE_M_S, (envs.num_envs, 3)) / MOST_M_S
        actions = np.clip(shown(seen) + noise, -1.0, 1.0).astype(np.float32)
        after, rewards, ends, infos = envs.step(actions)
        last = after.copy()  # an environment that is over has begun anew
        for k in np.flatnonzero(ends):
            last[k] = infos[k]["terminal_observation"]
        model.replay_buffer.add(seen, last, actions, rewards, ends, infos)
        seen, over = after, over + int(np.sum(ends))


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


def main(steps: str = "20000", demonstrated: str = "60", flights: str = "40", seed: str = "0") -> None:
    """Learn, and say what it was worth."""
    import torch
    from stable_baselines3 import SAC
    from stable_baselines3.common.vec_env import SubprocVecEnv, VecMonitor

    torch.set_num_threads(1)  # the flights need the cores
    envs = VecMonitor(SubprocVecEnv([made] * len(os.sched_getaffinity(0)), start_method="spawn"))
    envs.seed(100 * int(seed))  # of the first flights; later ones are drawn from these
    model = SAC(
        "MlpPolicy", envs, seed=int(seed), device="cpu", verbose=1, learning_rate=1e-3, gamma=0.98, learning_starts=0,
        gradient_steps=4, ent_coef="auto_0.1", policy_kwargs={"net_arch": [64, 64]},
    )  # fmt: skip
    show(model, int(demonstrated))
    model.learn(int(steps), log_interval=20)
    model.save("docking")
    envs.close()

    def learned(seen: Seen) -> Seen:
        action: Seen = model.predict(seen, deterministic=True)[0]
        return action

    print("shown:", evaluated(shown, FAST, int(flights)), flush=True)
    for name in (FAST, BY_CAMERA):
        print("learned:", evaluated(learned, name, int(flights)), flush=True)


if __name__ == "__main__":
    main(*sys.argv[1:])
