"""The tow: everything that acts on hose and drogue but gravity, joints and contact, for one flight condition.

Puts together the air loads (`loads`), the guide in the pod and the reel (`reel`) and the shape at rest (`rest`), so
that the world hands over arrays and gets forces back.
"""

from dataclasses import dataclass, replace

import numpy as np

from dockair.errors import DockairError
from dockair.rotations import Array
from dockair.sim.air.atmosphere import Air
from dockair.sim.hose.chain import DrogueParameters, HoseParameters
from dockair.sim.hose.loads import load_coefficients, write_tow_loads
from dockair.sim.hose.reel import (
    Reel,
    ReelParameters,
    add_guide_loads,
    guide_coefficients,
    guide_loads,
    set_point_n,
)
from dockair.sim.hose.rest import rest_shape


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class PodMotion:
    """Where the pod's exit is and how it moves."""

    R_WT: Array  #: (3, 3) axes of the tanker
    p_WO: Array  #: (3,) the exit [m]
    v_WO: Array  #: (3,) its velocity in W [m/s]
    w_WT: Array  #: (3,) angular velocity of the tanker, in W [rad/s]


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

    Raises:
        DockairError: a reel that winds in all of the hose, or one that `Reel` refuses.
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
        if not reel.range_m < hose.length_m:
            expected = f"less than the hose's length, parameters.hose.length_m = {hose.length_m}"
            raise DockairError("parameters.reel.range_m", expected=expected, got=reel.range_m)
        shorter = replace(hose, length_m=hose.length_m - reel.range_m)
        holds_n = set_point_n(reel, self.rest, rest_shape(shorter, drogue, wind_W, rho, nu))
        tension_n = self.rest.root_tension_n
        pull_n = tension_n * float(self.rest.t_W[0, 0])
        self.reel = Reel(
            reel, static_root_tension_n=tension_n, static_pull_n=pull_n, set_point_n=holds_n, step_s=step_s
        )
        self._link_length_m, self._links = hose.link_length_m, hose.links
        self._wind_W = np.array(wind_W, dtype=float)
        self._rates = np.empty((3, hose.links + 1, 3))  # room for velocities; written anew whenever they are asked for
        self._v, self._w = self._rates[0], self._rates[1]  # of the bodies
        self._loads = load_coefficients(hose, drogue, rho, nu)
        self._guide = guide_coefficients(hose, reel, self.rest.root_tension_n)

    def wrenches(
        self,
        position: Array,
        R: Array,
        spatial: Array,
        reference: Array,
        gusts_W: Array,
        drawn_in_m: float,
        pod: PodMotion | None = None,
    ) -> Array:
        """(links + 1, 6) force [N] and moment about the centre of mass [N m] in W, on the links and the drogue.

        Args:
            position: (links + 1, 3) centres of mass in W [m].
            R: (links + 1, 3, 3) axes in W.
            spatial: (links + 1, 6) angular velocity, and velocity of the body's material at `reference`, in W.
            reference: (3,) point of W.
            gusts_W: (links + 1, 3) velocity of the air at each body beyond the undisturbed wind [m/s].
            drawn_in_m: length of hose inside the pod.
            pod: where the pod is; None for an exit at rest in the origin of W, without turn.
        """
        wrench = np.empty(spatial.shape)
        write_tow_loads(
            position, R, spatial, reference, self._wind_W, gusts_W, drawn_in_m, self._loads, self._rates, wrench
        )
        if drawn_in_m > 0.0:
            if pod is None:
                add_guide_loads(position, R, self._v, self._w, drawn_in_m, self._guide, wrench[:-1])
            else:
                links = (position[:-1], R[:-1], self._v[:-1], self._w[:-1])
                wrench[:-1] += self._guided(*links, drawn_in_m, pod)
        return wrench

    def _guided(self, position: Array, R: Array, v: Array, w: Array, drawn_in_m: float, pod: PodMotion) -> Array:
        """(links, 6) what the tube in the pod does to the links, in W; the tube moves with the tanker."""
        to_T = pod.R_WT  # row vectors of W times this are rows of T
        from_exit = position - pod.p_WO
        wrench_T = guide_loads(
            from_exit @ to_T,
            np.ascontiguousarray(to_T.T @ R),
            (v - pod.v_WO - np.cross(pod.w_WT, from_exit)) @ to_T,
            (w - pod.w_WT) @ to_T,
            drawn_in_m,
            self._guide,
        )
        return np.hstack([wrench_T[:, :3] @ to_T.T, wrench_T[:, 3:] @ to_T.T])

    def link_at_exit(self, drawn_in_m: float) -> int:
        """Number of the link that passes through the pod's exit."""
        return min(max(int(drawn_in_m / self._link_length_m), 0), self._links - 1)
