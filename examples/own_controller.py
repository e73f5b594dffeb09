"""Dock with a controller of one's own, in the gymnasium environment, camera in the loop.

    python examples/own_controller.py [SCENARIO] [SEED] [ENVIRONMENT]

The controller steers the ring, as the navigation sees it in body axes, onto the probe's line, and closes when it is
there. Its command is an increment of velocity; because the receiver's own velocity drifts, the command is integrated
from the error in velocity instead of being set from it.
"""

import sys

import gymnasium
import numpy as np

import dockair  # noqa: F401 - makes the environments known
from dockair.scenarios.envs.tables import OBSERVATION

INDEX = {entry.name: k for k, entry in enumerate(OBSERVATION)}
STAND_OFF_M, CLOSING_M_S = 4.0, 1.2
ACROSS = 4.0, 3.5  # 1/s^2 of the offset, 1/s of its rate: damped, and quicker than the drogue swings (2 to 3 rad/s) ...
FORWARD = 0.6, 1.4  # ... and likewise where the engine is slower to answer
MOST_M_S2 = 3.0
LINED_UP_M, LINED_UP_M_S, LINED_UP_S = 0.25, 0.3, 2.0


class Controller:
    """Pre-contact, then close; one step a control tick."""

    def __init__(self, step_s: float) -> None:
        """Start with no command.

        Args:
            step_s: length of a step of the environment.
        """
        self._step_s, self._velocity, self._lined_up_s, self.closing = step_s, np.zeros(3), 0.0, False

    def hold(self) -> tuple[np.ndarray, np.ndarray]:
        """Return the velocity commanded last and no acceleration: there is nothing to steer to."""
        self._lined_up_s = 0.0
        return self._velocity, np.zeros(3)

    def step(self, p: np.ndarray, rate: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return velocity and acceleration to command.

        Args:
            p: (3,) ring from the probe's tip, body axes [m].
            rate: (3,) its change in these axes [m/s].
        """
        steady = np.hypot(p[1], p[2]) < LINED_UP_M and np.linalg.norm(rate) < LINED_UP_M_S
        self._lined_up_s = self._lined_up_s + self._step_s if steady else 0.0
        self.closing = self.closing or self._lined_up_s > LINED_UP_S
        wanted = ACROSS[0] * p + ACROSS[1] * rate
        if self.closing:
            wanted[0] = FORWARD[1] * (rate[0] + CLOSING_M_S)
        else:
            wanted[0] = FORWARD[0] * (p[0] - STAND_OFF_M) + FORWARD[1] * rate[0]
        acceleration = np.clip(wanted, -MOST_M_S2, MOST_M_S2)
        self._velocity = np.clip(self._velocity + acceleration * self._step_s, -2.5, 2.5)
        return self._velocity, acceleration


def action_for(controller: Controller, observation: np.ndarray) -> np.ndarray:
    """Return the action for an observation."""
    if not observation[INDEX["valid"]]:
        return np.concatenate(controller.hold()).astype(np.float32)
    p, v, gyro = (observation[INDEX[name] : INDEX[name] + 3] for name in ("p_PD_B_x", "v_PD_B_x", "gyro_x"))
    rate = v - np.cross(gyro, p)  # in turning axes
    return np.concatenate(controller.step(p, rate)).astype(np.float32)


def main(scenario: str = "default", seed: str = "0", environment: str = "dockair/Dock-v0") -> None:
    """Fly one episode and say how it ended."""
    env = gymnasium.make(environment, scenario=scenario)
    controller = Controller(step_s=1.0 / env.unwrapped.metadata["render_fps"])
    observation, info = env.reset(seed=int(seed))
    total, over = 0.0, False
    while not over:
        observation, reward, terminated, truncated, info = env.step(action_for(controller, observation))
        total, over = total + float(reward), terminated or truncated
    truth = info["truth"]
    print(f"{info['outcome']} after {truth['time_s']:.1f} s, sum of rewards {total:.2f}")
    if info["is_success"]:
        offset_m, speed_m_s = truth["contact_radial_offset_m"], truth["contact_closure_speed_m_s"]
        print(f"  {offset_m:.3f} m off centre at {speed_m_s:.2f} m/s")
    env.close()


if __name__ == "__main__":
    main(*sys.argv[1:])
