"""Hose and drogue alone in MuJoCo, on an exit at rest: what the checks of the hose are run on.

The model is the world's own (`scene`), its reel held by a drum and its exit by a tanker too heavy to move, the receiver
held up, nothing touching anything. One step is the world's: kinematics, air loads of `loads`, then the second half
step. Without air the step is MuJoCo's whole one, so that any of its integrators can be tried.

Frame: W of the world, the exit in its origin; gravity may point anywhere.
"""

from collections.abc import Callable

import mujoco
import numpy as np

from dockair.calibration import Mounting
from dockair.parameters import load_parameters
from dockair.rotations import Array
from dockair.sim.air.atmosphere import STANDARD_GRAVITY_M_S2, Air
from dockair.sim.hose.chain import DrogueParameters, HoseParameters, velocities_at
from dockair.sim.hose.coupling import CouplingParameters
from dockair.sim.hose.loads import load_coefficients, tow_loads
from dockair.sim.hose.reel import ReelParameters
from dockair.sim.hose.rest import RestShape, hinge_angles, rest_shape
from dockair.sim.outlines import TankerParameters
from dockair.sim.scene import SceneParameters, build_scene

AirField = Callable[[Array], Array]  #: places (n, 3) in W -> velocity of the air there (n, 3)

_IMMOVABLE = 1e18  # kg or kg m^2: the hose's 2 kN do not turn or move what it hangs on, nor take energy with it
_INTEGRATORS = {
    "implicitfast": mujoco.mjtIntegrator.mjINT_IMPLICITFAST,
    "Euler": mujoco.mjtIntegrator.mjINT_EULER,
    "RK4": mujoco.mjtIntegrator.mjINT_RK4,
}
_DOWN = np.array([0.0, 0.0, -STANDARD_GRAVITY_M_S2])
# Of the receiver, which takes no part
_MASS_KG, _INERTIA = 9300.0, np.diag([12874.0, 75674.0, 85552.0])


class HoseRig:
    """Hose and drogue in a stream, from their shape at rest.

    Args:
        hose: sheet.
        drogue: sheet.
        wind_W: (3,) velocity of the undisturbed air in W [m/s].
        air: density and viscosity; None for no air.
        step_s: physics step.
        gravity_W: (3,) [m/s^2].
        integrator: MuJoCo's; with air the second half step knows implicitfast and Euler.

    Attributes:
        model, data: MuJoCo's.
        rest: shape at rest in the undisturbed stream under gravity downward; None without air.
    """

    def __init__(
        self,
        hose: HoseParameters,
        drogue: DrogueParameters,
        wind_W: Array,
        air: Air | None,
        *,
        step_s: float = 1e-3,
        gravity_W: Array = _DOWN,
        integrator: str = "implicitfast",
    ) -> None:
        self._wind_W, self._step_s = np.asarray(wind_W, dtype=float), step_s
        self._bodies = hose.links + 1
        self.model = _model(hose, drogue, step_s)
        self.model.opt.integrator = _INTEGRATORS[integrator]
        self.model.opt.gravity[:] = gravity_W
        self.data = mujoco.MjData(self.model)
        self._find()
        self._hold_aircraft(gravity_W)
        self._loads: Array | None = None
        self.rest: RestShape | None = None
        if air is not None:
            rho, nu = air.density_kg_m3, air.kinematic_viscosity_m2_s
            self._loads = load_coefficients(hose, drogue, rho, nu)
            self.rest = rest_shape(hose, drogue, self._wind_W, rho, nu)
            self.put(np.vstack([self.rest.t_W, self.rest.t_D_W]))

    def put(self, t_W: Array, rates_rad_s: Array | None = None, exit_m_s: float = 0.0) -> None:
        """Put links and drogue somewhere.

        Args:
            t_W: (links + 1, 3) unit vectors along them.
            rates_rad_s: (links + 1, 2) of the hinges about y and z; None for rest.
            exit_m_s: velocity of the exit forward, which nothing slows.
        """
        self.data.qpos[self._drum_qpos], self.data.qpos[self._hinge_qpos] = 0.0, hinge_angles(t_W).ravel()
        self.data.qvel[:] = 0.0
        self.data.qvel[self._drum_dof] = exit_m_s
        if rates_rad_s is not None:
            self.data.qvel[self._hinge_dof] = rates_rad_s.ravel()
        self.data.time = 0.0
        mujoco.mj_forward(self.model, self.data)

    def pull(self, force_W: Array) -> None:
        """Pull at the drogue's centre of mass with a steady force (3,) [N]; where there is air its loads replace it."""
        self.data.xfrc_applied[self._tow.stop - 1, :3] = force_W

    def step(self, gusts: AirField | None = None) -> None:
        """Advance by one step in the undisturbed wind plus gusts."""
        model, data = self.model, self.data
        if self._loads is None:
            mujoco.mj_step(model, data)
            return
        mujoco.mj_step1(model, data)
        place, spatial = data.xipos[self._tow], data.cvel[self._tow]
        air = np.tile(self._wind_W, (self._bodies, 1)) if gusts is None else self._wind_W + gusts(place)
        v = velocities_at(place, spatial, data.subtree_com[self._tree])
        R = data.xmat[self._tow].reshape(-1, 3, 3)
        w = np.ascontiguousarray(spatial[:, :3])
        data.xfrc_applied[self._tow] = tow_loads(R, v, w, air, 0.0, self._loads)
        mujoco.mj_step2(model, data)

    def relax(self, duration_s: float, brake_1_s: float) -> None:
        """Run with all rates braked besides: the place of rest stays the same, the swing dies sooner."""
        keep = float(np.exp(-brake_1_s * self._step_s))
        for _ in range(round(duration_s / self._step_s)):
            self.step()
            self.data.qvel *= keep

    def joints(self) -> Array:
        """(links + 1, 3) joints from the exit to the hose's rear end, from the exit in W axes [m]."""
        joints = self.data.xanchor[self._first_joint : self._last_joint + 1 : 2]
        return np.asarray(joints - joints[0])

    def hose_end(self) -> Array:
        """(3,) the hose's rear end from the exit, in W axes [m]."""
        return np.asarray(self.data.xanchor[self._last_joint] - self.data.xanchor[self._first_joint])

    def drogue_axis(self) -> Array:
        """(3,) x axis of the drogue in W."""
        return np.array(self.data.xmat[self._tow.stop - 1].reshape(3, 3)[:, 0])

    def tensions(self) -> tuple[float, float]:
        """Tension at the exit and at the drogue in the last step [N]."""
        mujoco.mj_rnePostConstraint(self.model, self.data)
        force = self.data.cfrc_int[[self._root, self._tow.stop - 1], 3:]
        return float(np.linalg.norm(force[0])), float(np.linalg.norm(force[1]))

    def air_powers_w(self) -> tuple[float, float]:
        """Power of the wind now [W]: of its loads on a chain at rest in this shape, and of the rest of them.

        Raises:
            RuntimeError: no air.
        """
        if self._loads is None:
            raise RuntimeError("a rig without air has no power of it")
        model, data = self.model, self.data
        mujoco.mj_kinematics(model, data)
        mujoco.mj_comPos(model, data)
        mujoco.mj_comVel(model, data)
        place, spatial, R = data.xipos[self._tow], data.cvel[self._tow], data.xmat[self._tow].reshape(-1, 3, 3)
        v, w = velocities_at(place, spatial, data.subtree_com[self._tree]), np.ascontiguousarray(spatial[:, :3])
        air = np.tile(self._wind_W, (self._bodies, 1))
        rates = np.hstack([v, w])
        loads = tow_loads(R, v, w, air, 0.0, self._loads)
        at_rest = tow_loads(R, np.zeros_like(v), np.zeros_like(w), air, 0.0, self._loads)
        return float(np.sum(at_rest * rates)), float(np.sum((loads - at_rest) * rates))

    def energy_j(self) -> float:
        """Kinetic energy of hose and drogue, and potential energy of their weight and bending."""
        model, data = self.model, self.data
        mujoco.mj_forward(model, data)
        mass = np.zeros((model.nv, model.nv))
        mujoco.mj_fullM(model, data, mass)
        hinges = self._hinge_dof
        rates, angles = data.qvel[hinges], data.qpos[self._hinge_qpos]
        kinetic = 0.5 * rates @ mass[hinges, hinges] @ rates
        height = data.xipos[self._tow] - data.xanchor[self._first_joint]
        weight = -float(model.body_mass[self._tow] @ height @ model.opt.gravity)
        bending = 0.5 * model.jnt_stiffness[self._first_joint : self._last_joint + 2] @ angles**2
        return float(kinetic + weight + bending)

    def _find(self) -> None:
        model = self.model
        self._root, last = model.body("hose_0").id, model.body("drogue").id
        self._tree = int(model.body_rootid[self._root])  # velocities are given at its centre of mass
        self._tow = slice(self._root, last + 1)
        first, end = model.joint("hose_0_y"), model.joint("drogue_z")
        self._first_joint, self._last_joint = first.id, model.joint("drogue_y").id
        self._hinge_qpos = slice(first.qposadr[0], end.qposadr[0] + 1)
        self._hinge_dof = slice(first.dofadr[0], end.dofadr[0] + 1)
        drum = model.joint("reel")
        self._drum_qpos, self._drum_dof = int(drum.qposadr[0]), int(drum.dofadr[0])
        model.dof_armature[self._drum_dof] = _IMMOVABLE
        carrier = model.body_dofadr[self._tree]
        if model.jnt_type[model.body_jntadr[self._tree]] == mujoco.mjtJoint.mjJNT_FREE:
            model.dof_armature[carrier : carrier + 6] = _IMMOVABLE

    def _hold_aircraft(self, gravity_W: Array) -> None:
        """Carry the weight of all that flies freely."""
        model = self.model
        for joint in range(model.njnt):
            if model.jnt_type[joint] == mujoco.mjtJoint.mjJNT_FREE:
                body = model.jnt_bodyid[joint]
                falling_kg = model.body_mass[body] * (1.0 - model.body_gravcomp[body])
                self.data.xfrc_applied[body, :3] = -falling_kg * np.asarray(gravity_W)


def _model(hose: HoseParameters, drogue: DrogueParameters, step_s: float) -> mujoco.MjModel:
    """Compile the world's model of this hose and drogue, without contacts and the reel's stop."""
    model = build_scene(
        SceneParameters(
            hose=hose,
            drogue=drogue,
            reel=load_parameters("reel", ReelParameters),
            coupling=load_parameters("coupling", CouplingParameters),
            tanker=load_parameters("tanker", TankerParameters),
            mounting=Mounting(R_BC=np.eye(3), p_BC=np.zeros(3), p_BP=np.array([6.0, 0.0, 0.0])),
            receiver_mass_kg=_MASS_KG,
            receiver_inertia_B=_INERTIA,
            sun_direction_W=np.array([0.0, 0.0, 1.0]),
            step_s=step_s,
        )
    )
    model.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_CONTACT | mujoco.mjtDisableBit.mjDSBL_LIMIT
    return model
