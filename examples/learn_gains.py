"""Learn the gains of a linear policy by the cross-entropy method, with numpy alone, a flight on each core.

    python examples/learn_gains.py [GENERATIONS] [CANDIDATES] [EVALUATED]

A generation draws candidates from a log-normal distribution, flies each on the same new seeds, and fits the
distribution to the best: a gain is positive, and nobody knows beforehand whether it is 0.5 or 5. The gains before and
after are then flown on seeds that no candidate has met (docs/environments.md#learning).
"""

import multiprocessing
import os
import sys
from collections.abc import Sequence
from concurrent.futures import Executor, ProcessPoolExecutor
from functools import cache, partial

import gymnasium
import numpy as np

import dockair  # noqa: F401 - makes the environments known
from dockair.scenarios.envs.tables import OBSERVATION
from dockair.scenarios.schema import load_scenario

INDEX = {entry.name: k for k, entry in enumerate(OBSERVATION)}
TICKS, STEP_S = 5, 0.05  # of the control for which a command is held
CONDITIONS = {"turbulence.sigma_m_s": 1.1, "flight.duration_s": 8.0}  # light gusts; a good approach is over after 6
CLOSING_M_S, MOST_M_S, MOST_M_S2 = 1.2, 2.5, 3.0
START, START_SIGMA = np.ones(3), 1.0  # of each gain; of its logarithm: a factor of 2.7 up or down
SIGMA_MIN = 0.1  # likewise: few elites look more alike than they are
ELITES = 0.35  # part of the candidates
FLIGHTS = 3  # of each: in one flight's gusts a good policy fails and a bad one docks
TRAINED_FROM, EVALUATED_FROM = 1000, 2000  # first seeds; the second are never trained on


def place_and_rate(observation: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """(3,) where the ring is [m], and (3,) how that changes in axes that turn with the receiver [m/s]."""
    p, v, gyro = (observation[INDEX[name] : INDEX[name] + 3] for name in ("p_PD_B_x", "v_PD_B_x", "gyro_x"))
    return p, v - np.cross(gyro, p)


def linear(gains: Sequence[float] | np.ndarray, p: np.ndarray, rate: np.ndarray) -> np.ndarray:
    """(3,) acceleration [m/s^2].

    Args:
        gains: (3,) on offset [1/s^2] and its rate [1/s] across; on the rate less that of closing [1/s], forward.
        p: (3,) offset.
        rate: (3,) of it.
    """
    wanted = gains[0] * p + gains[1] * rate
    wanted[0] = gains[2] * (rate[0] + CLOSING_M_S)
    return np.clip(wanted, -MOST_M_S2, MOST_M_S2)


class LinearPolicy:
    """Acceleration linear in the belief, and the velocity that it sums to: to the side, and forward."""

    def __init__(self, gains: np.ndarray) -> None:
        """Start with no command.

        Args:
            gains: (3,) of `linear`.
        """
        self._gains, self._velocity = gains, np.zeros(3)

    def __call__(self, observation: np.ndarray) -> np.ndarray:
        """Return the action for an observation."""
        acceleration = linear(self._gains, *place_and_rate(observation)) * observation[INDEX["valid"]]
        self._velocity = np.clip(self._velocity + STEP_S * acceleration, -MOST_M_S, MOST_M_S)
        return np.concatenate([self._velocity, acceleration]).astype(np.float32)


@cache
def environment() -> gymnasium.Env:
    """Return this process's environment."""
    scenario = load_scenario("default", CONDITIONS)
    return gymnasium.make("dockair/DockFast-v0", scenario=scenario, ticks_per_step=TICKS)


def episode(gains: np.ndarray, seed: int) -> tuple[float, bool]:
    """Fly a flight; return the sum of its rewards, and whether it ended in a good contact."""
    env, policy = environment(), LinearPolicy(gains)
    observation, info = env.reset(seed=int(seed))
    total, over = 0.0, False
    while not over:
        observation, reward, terminated, truncated, info = env.step(policy(observation))
        total, over = total + float(reward), terminated or truncated
    return total, info["is_success"]


def fitted(gains: np.ndarray, scores: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return mean and standard deviation of the best.

    Args:
        gains: (n, 3) logarithms of the candidates'.
        scores: (n,) of each.
    """
    count = max(2, round(ELITES * len(gains)))
    best = gains[np.argsort(scores)[-count:]]
    return best.mean(axis=0), np.maximum(best.std(axis=0), SIGMA_MIN)


def learned(pool: Executor, generations: int, candidates: int) -> np.ndarray:
    """(3,) gains after so many generations, a line printed of each."""
    rng = np.random.default_rng(0)
    mean, sigma = np.log(START), np.full(len(START), START_SIGMA)
    for generation in range(generations):
        gains = rng.normal(mean, sigma, (candidates, len(mean)))
        seeds = TRAINED_FROM + FLIGHTS * generation + np.arange(FLIGHTS)
        each = np.repeat(np.exp(gains), FLIGHTS, axis=0), np.tile(seeds, candidates)
        scores, good = np.array(list(pool.map(episode, *each))).T
        mean, sigma = fitted(gains, scores.reshape(candidates, FLIGHTS).mean(axis=1))
        said = f"mean score {scores.mean():6.2f}, {good.sum():.0f} of {len(good)} flights docked"
        print(f"generation {generation}: {said}", flush=True)
    return np.exp(mean)


def docked_of(pool: Executor, gains: np.ndarray, count: int) -> int:
    """Return how many of `count` flights on new seeds end in a good contact."""
    seeds = range(EVALUATED_FROM, EVALUATED_FROM + count)
    return sum(good for _, good in pool.map(partial(episode, gains), seeds))


def main(generations: str = "6", candidates: str = "10", evaluated: str = "40") -> None:
    """Learn, and say what it was worth."""
    cores = len(os.sched_getaffinity(0))
    with ProcessPoolExecutor(cores, mp_context=multiprocessing.get_context("spawn")) as pool:
        gains = learned(pool, int(generations), int(candidates))
        print("gains:", ", ".join(f"{gain:.2f}" for gain in gains))
        for name, flown in (("before", START), ("after", gains)):
            print(f"{name}: good contact in {docked_of(pool, flown, int(evaluated))} of {evaluated} on new seeds")


if __name__ == "__main__":
    main(*sys.argv[1:])
