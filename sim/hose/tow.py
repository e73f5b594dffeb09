"""The tow: everything that acts on hose and drogue but gravity, joints and contact, for one flight condition.

Puts together the air loads (`loads`), the guide in the pod and the reel (`reel`) and the shape at rest (`rest`), so
that the world hands over arrays and gets forces back.
"""

import numpy as np

from dockair.rotations import Array
from dockair.sim.air.atmosphere import Air
from dockair.sim.hose.chain import DrogueParameters, HoseParameters, velocities_at
from dockair.sim.hose.loads import load_coefficients, tow_loads
from dockair.sim.hose.reel import Reel, ReelParameters, guide_coefficients, guide_loads
from dockair.sim.hose.rest import rest_shape


class Tow:
    """Loads on hose and drogue; remembers the reel's motor.

    Args:
        hose: sheet.
        drogue: sheet.
        reel: sheet.
        air: the air at the flight's altitude.
        wind_W: (3,) velocity of the undisturbed air in W [m/s].
        step_s: physics step.

    Attributes:
        rest: shape and tensions at rest at full trail.
        reel: the motor.
    """

    def __init__(
        self,
        hose: HoseParameters,
        drogue: DrogueParameters,
        reel: ReelParameters,
        air: Air,
        wind_W: Array,
        step_s: float,
    ) -> None:
        rho, nu = air.density_kg_m3, air.kinematic_viscosity_m2_s
        self.rest = rest_shape(hose, drogue, wind_W, rho, nu)
        self.reel = Reel(reel, self.rest.root_tension_n, step_s)
        self._link_length_m, self._links = hose.link_length_m, hose.links
        self._wind_W = wind_W
        self._loads = load_coefficients(hose, drogue, rho, nu)
        self._guide = guide_coefficients(hose, reel, self.rest.root_tension_n)

    def wrenches(
        self, position: Array, R: Array, spatial: Array, reference: Array, gusts_W: Array, drawn_in_m: float
    ) -> Array:
        """(links + 1, 6) force [N] and moment about the centre of mass [N m] in W, on the links and the drogue.

        Args:
            position: (links + 1, 3) centres of mass in W [m].
            R: (links + 1, 3, 3) axes in W.
            spatial: (links + 1, 6) angular velocity, and velocity of the body's material at `reference`, in W.
            reference: (3,) point of W.
            gusts_W: (links + 1, 3) gust at each body [m/s].
            drawn_in_m: length of hose inside the pod.
        """
        v = velocities_at(position, spatial, reference)
        w = np.ascontiguousarray(spatial[:, :3])
        wrench = tow_loads(position, R, v, w, self._wind_W + gusts_W, drawn_in_m, self._loads)
        if drawn_in_m > 0.0:
            wrench[:-1] += guide_loads(position[:-1], R[:-1], v[:-1], w[:-1], drawn_in_m, self._guide)
        return wrench

    def link_at_exit(self, drawn_in_m: float) -> int:
        """Number of the link that passes through the pod's exit."""
        return min(max(int(drawn_in_m / self._link_length_m), 0), self._links - 1)
