"""Whether the receiver can touch anything: only then has MuJoCo to look for contacts.

Only the receiver's solids seek contacts (`scene`), and those of any other body lie in a ball of radius r about the
body's place p. With x_R the receiver's axis forward, p_R its place and x_0 how far its foremost solid reaches along,

    (p - p_R) . x_R - r > x_0 + m                                                                         (1)

for all other bodies says that a plane parts the receiver from them. It still does after a tick, in which nothing comes
nearer by the margin m. Not modelled: a receiver beside what it could touch, which is taken to be able to.
"""

import mujoco
import numpy as np

from dockair.kernels import njit

_MARGIN_M = 0.5  # at 1000 Hz: 500 m/s


class Reach:
    """Eq. (1) for one model.

    Args:
        model, data: the world's.
        receiver: number of the receiver's body.
    """

    def __init__(self, model: mujoco.MjModel, data: mujoco.MjData, receiver: int) -> None:
        balls = np.linalg.norm(model.geom_pos, axis=1) + model.geom_rbound
        solid = (model.geom_contype | model.geom_conaffinity) != 0
        own, radii = model.geom_bodyid == receiver, np.full(model.nbody, -np.inf)
        np.maximum.at(radii, model.geom_bodyid[solid & ~own], balls[solid & ~own])
        foremost_m = float((model.geom_pos[:, 0] + model.geom_rbound)[solid & own].max(initial=0.0))
        self._others = np.flatnonzero(radii > 0.0)
        self._from_m, self._receiver = radii[self._others] + (foremost_m + _MARGIN_M), receiver
        self._xpos, self._xmat = data.xpos, data.xmat

    def is_clear(self) -> bool:
        """Return whether nothing touches the receiver now nor a tick later."""
        return bool(_all_ahead(self._xpos, self._xmat, self._receiver, self._others, self._from_m))


@njit(cache=True)
def _all_ahead(xpos, xmat, receiver, others, from_m):  # type: ignore[no-untyped-def]
    """Eq. (1); false where a number is not one."""
    p, R = xpos[receiver], xmat[receiver]
    for k in range(len(others)):
        q = xpos[others[k]]
        along = (q[0] - p[0]) * R[0] + (q[1] - p[1]) * R[3] + (q[2] - p[2]) * R[6]
        if not along > from_m[k]:
            return False
    return True
