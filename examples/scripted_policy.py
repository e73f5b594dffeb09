"""A policy that flies what the guidance would have commanded, over several seeds, without a picture to wait for.

    python examples/scripted_policy.py [EPISODES] [SCENARIO]

`DockFast-v0` draws each LED's place from the camera's error model; `dockair/Dock-v0` in its place renders every frame.
"""

import sys

import gymnasium
import numpy as np

import dockair  # noqa: F401 - makes the environments known
from dockair.scenarios.envs.tables import ACTION, OBSERVATION

FIRST = [entry.name for entry in OBSERVATION].index("navigator_command_velocity_x")


def policy(observation: np.ndarray) -> np.ndarray:
    """Return the action for an observation: the command that stands in it."""
    return observation[FIRST : FIRST + len(ACTION)].astype(np.float32)


def main(episodes: str = "3", scenario: str = "default") -> None:
    """Fly, one line an episode."""
    env = gymnasium.make("dockair/DockFast-v0", scenario=scenario, until_clear=True)  # the guidance's own attempts
    contacts = 0
    for seed in range(int(episodes)):
        observation, info = env.reset(seed=seed)
        total, over = 0.0, False
        while not over:
            observation, reward, terminated, truncated, info = env.step(policy(observation))
            total, over = total + float(reward), terminated or truncated
        contacts += info["is_success"]
        truth = info["truth"]
        print(f"seed {seed}: {info['outcome']} after {truth['time_s']:.1f} s, sum of rewards {total:.2f}")
    print(f"contact in {contacts} of {episodes}")
    env.close()


if __name__ == "__main__":
    main(*sys.argv[1:])
