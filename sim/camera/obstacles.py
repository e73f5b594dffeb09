"""What can hide a point: the solids and meshes of a model that are drawn, as rays meet them."""

from typing import NamedTuple

import mujoco
import numpy as np
from numpy.typing import NDArray

from dockair.rotations import Array
from dockair.sim.camera.meshes import Meshes
from dockair.sim.camera.solids import Solids


class Obstacles(NamedTuple):
    """The solids of a model as rays meet them."""

    geoms: NDArray[np.int64]  #: (n,) their numbers in the model
    kinds: NDArray[np.int64]  #: (n,) as of `solids`
    half_sizes_m: Array  #: (n, 3) as of `solids`
    radii_m: Array  #: (n,) of a ball around each
    meshes: Meshes

    @classmethod
    def of(cls, model: mujoco.MjModel) -> "Obstacles":
        """Take what is drawn.

        Raises:
            DockairError: the model has a visible geom that is no solid.
        """
        s = Solids.of(model)
        return cls(
            s.geoms.astype(np.int64), s.kinds, s.half_sizes_m, np.array(model.geom_rbound[s.geoms]), Meshes.of(model)
        )
