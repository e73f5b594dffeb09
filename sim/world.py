"""The world: the only owner of MjModel and MjData. One `step` is one physics tick.

Order within a tick, all forces from the state at its beginning:

    gusts -> air loads on hose and drogue, guide of the hose in the pod, pull of the reel, receiver's own forces
          -> MuJoCo's second half step (constraints, implicitfast) -> coupling decides -> gusts move on
          -> MuJoCo's first half step (kinematics, contacts of the new state) -> Truth

Frame W: origin at the hose's exit from the pod, x forward, z up, moving with the tanker's trim velocity (Galilean), so
the air in W blows with (-V, 0, 0) plus the gust. The tanker does not move in W.

At construction the hose starts from its shape at rest and settles in the gusts while the receiver waits far behind;
then the receiver is put, trimmed and at rest in W, where the probe's tip stands to the drogue's *mean* place over the
second half of that time as asked.

Not modelled: tanker motion, wake and bow wave, fuel flow.
"""

import copy
from dataclasses import dataclass

import mujoco
import numpy as np

from dockair.clock import Clock
from dockair.errors import DockairError
from dockair.messages import ReceiverCommand
from dockair.rotations import Array, quaternion_from_matrix
from dockair.sim.addresses import Addresses
from dockair.sim.air.atmosphere import STANDARD_GRAVITY_M_S2
from dockair.sim.hose.chain import cross
from dockair.sim.hose.coupling import CouplingState, next_coupling_state, probe_in_coupling
from dockair.sim.hose.reel import Reel
from dockair.sim.hose.rest import hinge_angles
from dockair.sim.hose.tow import Tow
from dockair.sim.parts import Airframe, GustField, WorldParameters, WorldStart
from dockair.sim.scene import SceneParameters, build_scene
from dockair.sim.truth import Truth

__all__ = ["World", "WorldParameters", "WorldStart", "WorldState"]

_WAITING_PLACE_M = (-300.0, 0.0, -20.0)  # of the receiver while the hose settles: out of everybody's way
_STATE = mujoco.mjtState.mjSTATE_INTEGRATION
_DIVERGED = 1e10  # acceleration at which MuJoCo calls a step unstable [m/s^2 or rad/s^2]
_GRAVITY = np.array([0.0, 0.0, -STANDARD_GRAVITY_M_S2])


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class WorldState:
    """Everything that a world remembers; opaque."""

    engine: Array
    parts: tuple[Reel, Airframe, GustField | None]
    coupling: CouplingState
    truth: Truth
    gusts_W: Array
    specific_force_B: Array


@dataclass(slots=True, eq=False)
class _Reactions:
    """Forces that MuJoCo solved for in the last tick."""

    root_tension_n: float
    drogue_tension_n: float
    coupling_force_n: float
    a_WB: Array
    alpha_WB_B: Array


class World:
    """Tanker, hose, drogue, receiver.

    Args:
        parameters: sheets and flight condition.
        receiver: the receiver's forces, trimmed.
        gusts: the field, or None for still air.
        start: relative geometry and settling time.
        clock: physics rate.

    Attributes:
        truth: the state now.
        model, data: for the camera, to read only.
        rest: hose and drogue at rest at full trail in still air.
    """

    def __init__(
        self, parameters: WorldParameters, receiver: Airframe, gusts: GustField | None, start: WorldStart, clock: Clock
    ) -> None:
        if not start.settle_s >= 0.0:
            raise DockairError("start.settle_s", expected="a time >= 0", got=start.settle_s)
        self.parameters, self._receiver, self._gusts, self._clock = parameters, receiver, gusts, clock
        self.model = build_scene(_scene_parameters(parameters, receiver, clock))
        self.data = mujoco.MjData(self.model)
        self._at = Addresses.of(self.model)
        self._wind_W = np.array([-parameters.airspeed_m_s, 0.0, 0.0])
        p = parameters
        self._tow = Tow(p.hose, p.drogue, p.reel, p.air, self._wind_W, clock.step_s)
        self._coupling = CouplingState.READY
        self.rest = rest = self._tow.rest
        self.data.qpos[self._at.hinges] = hinge_angles(np.vstack([rest.t_W, rest.t_D_W])).ravel()
        self._put_receiver(np.array(_WAITING_PLACE_M))
        self._reactions = _Reactions(rest.root_tension_n, rest.drogue_tension_n, 0.0, np.zeros(3), np.zeros(3))
        self._observe(0)
        p_WD_mean = self._settle(round(start.settle_s / clock.step_s))
        R_WB = np.asarray(receiver.trim_R_WB)
        self._put_receiver(p_WD_mean - R_WB @ (start.p_PD_B + p.mounting.p_BP))
        self._reactions.a_WB, self._reactions.alpha_WB_B = np.zeros(3), np.zeros(3)
        self._observe(0)

    def step(self, command: ReceiverCommand) -> Truth:
        """Advance by one physics tick under a command; return the new truth."""
        truth = self.truth
        force_W, torque_W = self._receiver.step(
            R_WB=truth.R_WB,
            v_WB=truth.v_WB,
            w_WB_B=truth.w_WB_B,
            air_velocity_W=self._wind_W + truth.gust_B_m_s,
            specific_force_B=self._specific_force_B,
            command=command,
        )
        wrench = self.data.xfrc_applied[self._at.receiver]
        wrench[:3], wrench[3:] = force_W, torque_W
        self._advance(truth.tick + 1)
        return self.truth

    def save(self) -> WorldState:
        """Everything that the next steps depend on."""
        engine = np.empty(mujoco.mj_stateSize(self.model, _STATE))
        mujoco.mj_getState(self.model, self.data, engine, _STATE)
        return WorldState(
            engine=engine,
            parts=copy.deepcopy((self._tow.reel, self._receiver, self._gusts)),
            coupling=self._coupling,
            truth=self.truth,
            gusts_W=self._gusts_W.copy(),
            specific_force_B=self._specific_force_B.copy(),
        )

    def restore(self, state: WorldState) -> None:
        """Go back to a saved state; what follows is the same to the bit."""
        mujoco.mj_setState(self.model, self.data, state.engine, _STATE)
        mujoco.mj_step1(self.model, self.data)
        self._tow.reel, self._receiver, self._gusts = copy.deepcopy(state.parts)
        self._coupling, self.truth = state.coupling, state.truth
        self._gusts_W, self._specific_force_B = state.gusts_W.copy(), state.specific_force_B.copy()

    def _put_receiver(self, p_WB: Array) -> None:
        """Place the receiver, trimmed and at rest in W."""
        qpos = self.data.qpos[self._at.receiver_qpos]
        qpos[:3], qpos[3:] = p_WB, quaternion_from_matrix(np.asarray(self._receiver.trim_R_WB))
        self.data.qvel[self._at.receiver_dof] = 0.0
        self.data.qacc_warmstart[self._at.receiver_dof] = 0.0
        mujoco.mj_step1(self.model, self.data)

    def _settle(self, ticks: int) -> Array:
        """Run the hose in the gusts, the receiver held; return the drogue's mean place over the second half."""
        self.data.xfrc_applied[self._at.receiver, 2] = self._receiver.mass_kg * STANDARD_GRAVITY_M_S2
        total, count = np.zeros(3), 0
        for tick in range(ticks):
            self._advance(0)
            if 2 * tick >= ticks:
                total += self.truth.p_WD
                count += 1
        self.data.time = 0.0
        return total / count if count else self.truth.p_WD

    def _advance(self, tick: int) -> None:
        """One tick, the receiver's forces being applied already."""
        at, data, before = self._at, self.data, self.truth
        data.xfrc_applied[at.tow] = self._tow.wrenches(
            data.xipos[at.tow],
            data.xmat[at.tow].reshape(-1, 3, 3),
            data.cvel[at.tow],
            data.subtree_com[at.tow.start],
            self._gusts_W[:-1],
            before.reel_position_m,
        )
        data.qfrc_applied[at.reel_dof] = self._tow.reel.step(
            before.root_tension_n, before.reel_position_m, before.reel_rate_m_s
        )
        mujoco.mj_step2(self.model, data)
        mujoco.mj_rnePostConstraint(self.model, data)
        self._reactions = self._solved_forces()
        self._decide_coupling()
        if self._gusts is not None:
            self._gusts.step()
        if not (np.abs(data.qacc) < _DIVERGED).all():
            time_s = self._clock.seconds(tick)
            raise DockairError("world", expected="a physics step that converges", got=f"diverged at {time_s:.3f} s")
        mujoco.mj_step1(self.model, data)
        self._observe(tick)

    def _solved_forces(self) -> _Reactions:
        """Forces at the beginning of the tick, which MuJoCo has just solved for."""
        at, data = self._at, self.data
        at_exit = at.tow.start + self._tow.link_at_exit(self.truth.reel_position_m)
        pull = 0.0
        if self._coupling is CouplingState.LATCHED:  # its three rows come first: it is the only equality
            pull = float(data.efc_force[:3] @ self.truth.R_WD[:, 0])
        return _Reactions(
            root_tension_n=_norm(data.cfrc_int[at_exit, 3:]),
            drogue_tension_n=_norm(data.cfrc_int[at.drogue, 3:]),
            coupling_force_n=pull,
            a_WB=data.qacc[at.receiver_dof][:3].copy(),
            alpha_WB_B=data.qacc[at.receiver_dof][3:].copy(),
        )

    def _decide_coupling(self) -> None:
        p = self.parameters.coupling
        probe = probe_in_coupling(self.truth, self._reactions.coupling_force_n, p)
        self._coupling = next_coupling_state(self._coupling, probe, p)
        self.data.eq_active[self._at.latch] = self._coupling is CouplingState.LATCHED

    def _observe(self, tick: int) -> None:
        """Take the truth of the present state, and the gusts where everything is."""
        at, data, solved = self._at, self.data, self._reactions
        self._gusts_W = self._gusts_at_bodies()
        root = data.subtree_com[at.tow.start]
        w_WD = data.cvel[at.drogue, :3]
        R_WD = data.xmat[at.drogue].reshape(3, 3).copy()
        p_WD = data.xpos[at.drogue].copy()
        R_WB = data.xmat[at.receiver].reshape(3, 3).copy()
        p_WB, p_BP_W = data.xpos[at.receiver].copy(), R_WB @ self.parameters.mounting.p_BP
        qvel = data.qvel[at.receiver_dof]
        probe_touches, receiver_touches = at.contacts(data.contact.geom) if data.ncon else (False, "")
        self._specific_force_B = R_WB.T @ (solved.a_WB - _GRAVITY)
        self.truth = Truth(
            tick=tick,
            time_s=self._clock.seconds(tick),
            R_WB=R_WB,
            p_WB=p_WB,
            v_WB=qvel[:3].copy(),
            w_WB_B=qvel[3:].copy(),
            alpha_WB_B=solved.alpha_WB_B,
            a_WB=solved.a_WB,
            specific_force_B=self._specific_force_B,
            p_WP=p_WB + p_BP_W,
            v_WP=qvel[:3] + cross(R_WB @ qvel[3:], p_BP_W),
            R_WD=R_WD,
            p_WD=p_WD,
            v_WD=data.cvel[at.drogue, 3:] + cross(w_WD, p_WD - root),
            w_WD_D=R_WD.T @ w_WD,
            p_WH=np.vstack([data.xpos[at.links], data.xanchor[at.drogue_joint]]),
            R_WT=np.eye(3),
            p_WT=-np.asarray(self.parameters.tanker.exit_m),
            reel_position_m=float(data.qpos[at.reel_qpos]),
            reel_rate_m_s=float(data.qvel[at.reel_dof]),
            root_tension_n=solved.root_tension_n,
            drogue_tension_n=solved.drogue_tension_n,
            gust_B_m_s=self._gusts_W[-1].copy(),
            gust_D_m_s=self._gusts_W[-2].copy(),
            airspeed_m_s=self._receiver.airspeed_m_s,
            angle_of_attack_rad=self._receiver.angle_of_attack_rad,
            sideslip_rad=self._receiver.sideslip_rad,
            throttle=self._receiver.throttle,
            latched=self._coupling is CouplingState.LATCHED,
            coupling_force_n=solved.coupling_force_n,
            probe_touches_drogue=probe_touches,
            receiver_touches=receiver_touches,
        )

    def _gusts_at_bodies(self) -> Array:
        """(links + 2, 3) gusts at the links' middles, the drogue, the receiver."""
        at, data = self._at, self.data
        n = at.tow.stop - at.tow.start
        if self._gusts is None:
            return np.zeros((n + 1, 3))
        x = np.empty(n + 1)
        x[:-1], x[-1] = data.xipos[at.tow, 0], data.xpos[at.receiver, 0]
        return self._gusts.velocity(x)


def _norm(v: Array) -> float:
    return float(np.sqrt(v @ v))


def _scene_parameters(parameters: WorldParameters, receiver: Airframe, clock: Clock) -> SceneParameters:
    p = parameters
    return SceneParameters(
        hose=p.hose,
        drogue=p.drogue,
        reel=p.reel,
        coupling=p.coupling,
        tanker=p.tanker,
        mounting=p.mounting,
        receiver_mass_kg=receiver.mass_kg,
        receiver_inertia_B=np.asarray(receiver.inertia_B),
        sun_direction_W=p.sun_direction_W,
        step_s=clock.step_s,
    )
