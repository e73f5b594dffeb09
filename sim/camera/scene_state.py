"""What a camera reads of the world at one moment, kept apart from MuJoCo's own memory.

The arrays bear MuJoCo's names and can stand in its data's place wherever the camera asks for it. They may lie in memory
that another process shares.
"""

import mujoco
import numpy as np

from dockair.rotations import Array

_ARRAYS = ("xpos", "xmat", "geom_xpos", "geom_xmat", "cvel", "subtree_com")


class SceneState:
    """Places, attitudes and velocities of bodies and geoms.

    Args:
        model: whose state.
        memory: (size_of(model),) numbers that hold it; its own by default.
    """

    def __init__(self, model: mujoco.MjModel, memory: Array | None = None) -> None:
        self.memory = np.empty(size_of(model)) if memory is None else memory
        self.xpos, self.xmat, self.geom_xpos, self.geom_xmat, self.cvel, self.subtree_com = _cut(self.memory, model)

    @property
    def time(self) -> float:
        """Of the simulation [s]."""
        return float(self.memory[0])

    def take(self, data: mujoco.MjData) -> None:
        """Copy the state of now."""
        self.memory[0] = data.time
        for name in _ARRAYS:
            getattr(self, name)[:] = getattr(data, name)


def size_of(model: mujoco.MjModel) -> int:
    """How many numbers a state has."""
    return 1 + sum(rows * columns for rows, columns in _shapes(model))


def _shapes(model: mujoco.MjModel) -> list[tuple[int, int]]:
    bodies, geoms = int(model.nbody), int(model.ngeom)
    return [(bodies, 3), (bodies, 9), (geoms, 3), (geoms, 9), (bodies, 6), (bodies, 3)]


def _cut(memory: Array, model: mujoco.MjModel) -> list[Array]:
    parts: list[Array] = []
    first = 1
    for rows, columns in _shapes(model):
        parts.append(memory[first : first + rows * columns].reshape(rows, columns))
        first += rows * columns
    return parts
