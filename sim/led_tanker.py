"""Leads the tanker's body along its path, so that the hose on it feels every inertial load.

Over a tick of length dt the body is pushed with

    F = m (v(t + dt) - v(t)) / dt,     M = I (w(t + dt) - w(t)) / dt     (w in the tanker's axes)         (1)

and put where the path has it at the tick's end, with the path's velocities. m and I are so large that what the hose
does to the acceleration in between is nothing (`scene`).
"""

import mujoco
import numpy as np

from dockair.kernels import njit
from dockair.rotations import Array
from dockair.sim.addresses import Addresses
from dockair.sim.aircraft.tanker import TankerPath
from dockair.sim.aircraft.tanker_motion import OMEGA, P, R, V
from dockair.sim.hose.tow import PodMotion
from dockair.vectors import cross


class LedTanker:
    """The tanker in MuJoCo; remembers the path's state now.

    Args:
        path: what it flies.
        model, data: the world's.
        at: addresses in them.
        exit_T: (3,) the hose's exit in its axes [m].
        step_s: physics step.
    """

    def __init__(
        self,
        path: TankerPath,
        model: mujoco.MjModel,
        data: mujoco.MjData,
        at: Addresses,
        exit_T: Array,
        step_s: float,
    ) -> None:
        self._path, self._data, self._exit_T = path, data, exit_T
        self._qpos, self._qvel = data.qpos[at.tanker_qpos], data.qvel[at.tanker_dof]
        self._push = data.qfrc_applied[at.tanker_dof]
        self._mass_rate = model.body_mass[at.tanker] / step_s
        self._inertia_rate = model.body_inertia[at.tanker, 0] / step_s
        self._straight = path.is_straight
        self.put(0.0)

    def put(self, time_s: float) -> None:
        """Put it where it is at a time."""
        self._following = self._path.vector(time_s)
        self._land(self._following)
        self._held = np.concatenate([self._qpos, self._qvel])

    def set_out(self, time_s: float) -> None:
        """Push it so that it arrives at its velocities of the tick's end, Eq. (1)."""
        if self._straight:
            return
        self._following = self._path.vector(time_s)
        self._push[:3] = self._mass_rate * (self._following[V] - self.state[V])
        self._push[3:] = self._inertia_rate * (self._following[OMEGA] - self.state[OMEGA])

    def arrive(self) -> None:
        """Put it where its path has it at the tick's end."""
        if self._straight:
            _hold(self._qpos, self._qvel, self._held)
        else:
            self._land(self._following)

    def _land(self, state: Array) -> None:
        self.state = state  #: laid out as `tanker_motion` says
        self.R_WT, self.p_WT = state[R].reshape(3, 3), state[P]  #: (3, 3) attitude, (3,) place [m]
        self._qpos[:3], self._qvel[:3], self._qvel[3:] = state[P], state[V], state[OMEGA]
        self._qpos[3:] = 1.0, 0.0, 0.0, 0.0
        if not self._straight:
            mujoco.mju_mat2Quat(self._qpos[3:], state[R])

    def pod(self) -> PodMotion | None:
        """Where the hose's exit is and how it moves; None while it rests in the origin of W."""
        if self._straight:
            return None
        arm_W, w_WT = self.R_WT @ self._exit_T, self.R_WT @ self.state[OMEGA]
        v_WO = self.state[V] + cross(w_WT, arm_W)
        return PodMotion(R_WT=self.R_WT, p_WO=self.p_WT + arm_W, v_WO=v_WO, w_WT=w_WT)


@njit(cache=True)
def _hold(qpos, qvel, held):  # type: ignore[no-untyped-def]
    """Write place and velocities; numpy takes three times as long for so few numbers."""
    for i in range(len(qpos)):
        qpos[i] = held[i]
    for i in range(len(qvel)):
        qvel[i] = held[len(qpos) + i]
