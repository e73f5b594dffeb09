"""Force with which the probe pushes the drogue where they touch: nozzle on the coupling's bottom, ribs and bore.

A nozzle that is taken while it still presses on the bottom is held there by the latch against what pushes it out. Both
are forces inside the coupling, tens of kilonewtons between rigid bodies; only their sum can draw the nozzle out.
"""

import mujoco
import numpy as np
from numpy.typing import NDArray

from dockair.rotations import Array


def probe_push(
    model: mujoco.MjModel, data: mujoco.MjData, is_probe: NDArray[np.bool_], is_drogue: NDArray[np.bool_]
) -> Array:
    """(3,) force of the probe on the drogue by all of their contacts, axes of the world [N].

    Args:
        model: of the scene.
        data: with the forces of its constraints solved.
        is_probe: (ngeom,) whether a geom is the probe's.
        is_drogue: (ngeom,) whether it is the basket's or the coupling's.
    """
    total, wrench = np.zeros(3), np.empty(6)
    for i, (a, b) in enumerate(data.contact.geom):
        if not ((is_probe[a] and is_drogue[b]) or (is_drogue[a] and is_probe[b])):
            continue
        mujoco.mj_contactForce(model, data, i, wrench)
        on_second = data.contact.frame[i].reshape(3, 3).T @ wrench[:3]
        total += on_second if is_drogue[b] else -on_second
    return total
