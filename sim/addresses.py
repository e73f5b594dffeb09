"""Where things are in the arrays of the compiled model."""

from dataclasses import dataclass

import mujoco
import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Addresses:
    """Indices into MjModel's and MjData's arrays, looked up once by name."""

    tow: slice  #: bodies: links, then the drogue
    links: slice  #: bodies: links
    drogue: int  #: body
    receiver: int  #: body
    tanker: int  #: body
    reel_qpos: int
    reel_dof: int
    drogue_joint: int  #: at the hose's end
    hinges: slice  #: qpos of all hinges, link by link about y and z, the drogue's last
    receiver_qpos: slice
    receiver_dof: slice
    tanker_qpos: slice
    tanker_dof: slice
    latch: int  #: equality constraint
    geom_is_probe: NDArray[np.bool_]  #: (ngeom,)
    geom_is_receiver: NDArray[np.bool_]  #: (ngeom,) without the probe
    geom_is_drogue: NDArray[np.bool_]  #: (ngeom,) basket and coupling
    geom_names: tuple[str, ...]
    observed: NDArray[
        np.int64
    ]  #: (6,) for `truth.observe`: receiver, drogue, tanker, dof of the first, reel's qpos, dof

    @classmethod
    def of(cls, model: mujoco.MjModel) -> "Addresses":
        """Look everything up."""
        first, drogue = model.body("hose_0").id, model.body("drogue").id
        receiver = model.body("receiver").id
        reel, free, prescribed = model.joint("reel"), model.joint("receiver"), model.joint("tanker")
        names = tuple(model.geom(i).name for i in range(model.ngeom))
        probe = np.array([name.startswith("probe_") for name in names])
        first_hinge, last_hinge = model.joint("hose_0_y").qposadr[0], model.joint("drogue_z").qposadr[0]
        return cls(
            tow=slice(first, drogue + 1),
            links=slice(first, drogue),
            drogue=drogue,
            receiver=receiver,
            tanker=model.body("tanker").id,
            reel_qpos=int(reel.qposadr[0]),
            reel_dof=int(reel.dofadr[0]),
            drogue_joint=model.joint("drogue_y").id,
            hinges=slice(first_hinge, last_hinge + 1),
            receiver_qpos=slice(free.qposadr[0], free.qposadr[0] + 7),
            receiver_dof=slice(free.dofadr[0], free.dofadr[0] + 6),
            tanker_qpos=slice(prescribed.qposadr[0], prescribed.qposadr[0] + 7),
            tanker_dof=slice(prescribed.dofadr[0], prescribed.dofadr[0] + 6),
            latch=model.equality("latch").id,
            geom_is_probe=probe,
            geom_is_receiver=(np.asarray(model.geom_bodyid) == receiver) & ~probe,
            geom_is_drogue=np.array([name.startswith(("basket_", "coupling_")) for name in names]),
            geom_names=names,
            observed=np.array(
                [receiver, drogue, model.body("tanker").id, free.dofadr[0], reel.qposadr[0], reel.dofadr[0]]
            ),
        )

    def contacts(self, geom_pairs: NDArray[np.int32]) -> tuple[bool, str]:
        """Say what touches what.

        Args:
            geom_pairs: (n, 2) geoms in contact.

        Returns:
            Whether the probe touches basket or coupling; the name of what else of the receiver touches what, or the
            probe anything but the drogue, "" for nothing.
        """
        probe_touches, receiver_touches = False, ""
        for a, b in geom_pairs:
            for own, other in ((a, b), (b, a)):
                probe = bool(self.geom_is_probe[own])
                probe_touches = probe_touches or bool(probe and self.geom_is_drogue[other])
                stray_probe = probe and not self.geom_is_drogue[other]
                if (self.geom_is_receiver[own] or stray_probe) and not receiver_touches:
                    receiver_touches = self.geom_names[other]
        return probe_touches, receiver_touches
