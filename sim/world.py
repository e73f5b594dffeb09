"""The world: the only owner of MjModel and MjData. One `step` is one physics tick.

Order within a tick, all forces from the state at its beginning:

    air's motion -> air loads on hose and drogue, guide of the hose in the pod, pull of the reel, receiver's own forces
          -> MuJoCo's second half step (constraints, implicitfast) -> coupling decides -> gusts and tanker move on
          -> MuJoCo's first half step (kinematics, contacts of the new state) -> Truth

Frame W: origin at the hose's exit at the start, x forward, z up, moving with the tanker's velocity at the start
(Galilean), so that the air in W blows with (-V, 0, 0) plus its own motion. A tanker that flies straight does not move
in W; one that turns or descends is led along its path, and takes the hose with it: over a tick its acceleration is the
difference of the path's velocities, so that hose and drogue feel every inertial load.

At construction the hose starts from its shape at rest and settles in the gusts, the tanker flying straight, while the
receiver waits far behind; then the receiver is put, trimmed and at rest in W, where the probe's tip stands to the
drogue's *mean* place over the second half of that time as asked.

Not modelled: fuel flow; what hose and receiver do to the tanker.
"""

import copy
from collections.abc import Callable
from dataclasses import dataclass

import mujoco
import numpy as np
from numba import njit

from dockair.clock import Clock
from dockair.errors import DockairError
from dockair.messages import ReceiverCommand
from dockair.rotations import Array, quaternion_from_matrix
from dockair.sim import truth as layout
from dockair.sim.addresses import Addresses
from dockair.sim.air.atmosphere import STANDARD_GRAVITY_M_S2
from dockair.sim.air.motion import AirState
from dockair.sim.aircraft.tanker import TankerPath, TankerPathParameters
from dockair.sim.hose.coupling import CouplingState, next_coupling_state, probe_in_coupling
from dockair.sim.hose.reel import Reel
from dockair.sim.hose.rest import hinge_angles
from dockair.sim.hose.tow import Tow
from dockair.sim.led_tanker import LedTanker
from dockair.sim.parts import AirAround, Airframe, WorldParameters, WorldStart, still_air
from dockair.sim.scene import SceneParameters, build_scene
from dockair.sim.step_limit import check_step
from dockair.sim.truth import Truth, observed, truth_of

__all__ = ["World", "DivergedError", "WorldParameters", "WorldStart", "WorldState"]

_WAITING_PLACE_M = (-300.0, 0.0, -20.0)  # of the receiver while the hose settles: out of everybody's way
_STATE = mujoco.mjtState.mjSTATE_INTEGRATION
_DIVERGED = 1e10  # acceleration at which MuJoCo calls a step unstable [m/s^2 or rad/s^2]
_GRAVITY = np.array([0.0, 0.0, -STANDARD_GRAVITY_M_S2])


class DivergedError(DockairError):
    """The integration has become unstable; the world's truth is still that of the last tick that was not."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class WorldState:
    """Everything that a world remembers; opaque."""

    engine: Array
    parts: tuple[Reel, Airframe, AirAround | None]
    coupling: CouplingState
    truth: Truth
    seen: Array
    air: AirState


class World:
    """Tanker, hose, drogue, receiver.

    Args:
        parameters: sheets and flight condition.
        receiver: the receiver's forces, trimmed.
        air: motion of the air, or None for still air.
        start: relative geometry and settling time.
        clock: physics rate.
        reel_locked: whether the reel is dead at a time of the flight [s]; while the hose settles it is 0.
        tanker_path: what the tanker flies; straight on by default.

    Attributes:
        truth: the state now.
        model, data: for the camera, to read only.
        rest: hose and drogue at rest at full trail in still air.
    """

    def __init__(
        self,
        parameters: WorldParameters,
        receiver: Airframe,
        air: AirAround | None,
        start: WorldStart,
        clock: Clock,
        reel_locked: Callable[[float], bool] | None = None,
        tanker_path: TankerPath | None = None,
    ) -> None:
        if not start.settle_s >= 0.0:
            raise DockairError("start.settle_s", expected="a time >= 0", got=start.settle_s)
        self.parameters, self._receiver, self._air, self._clock = parameters, receiver, air, clock
        self._reel_locked = reel_locked
        self.model = build_scene(_scene_parameters(parameters, receiver, clock))
        self.data = mujoco.MjData(self.model)
        self._at = Addresses.of(self.model)
        self._keep_views(self._at, self.data)
        self._wind_W = np.array([-parameters.airspeed_m_s, 0.0, 0.0])
        p = parameters
        self._tow = Tow(p.hose, p.drogue, p.reel, p.air, self._wind_W, clock.step_s)
        self._coupling = CouplingState.READY
        self._tip_in_body, exit_T = np.array(p.mounting.p_BP), np.array(p.tanker.exit_m, dtype=float)
        path = tanker_path or TankerPath(TankerPathParameters(), p.airspeed_m_s, -exit_T)
        self._tanker = LedTanker(path, self.model, self.data, self._at, exit_T, clock.step_s)
        self.rest = rest = self._tow.rest
        check_step(self.model, parameters, rest.root_tension_n)
        self.data.qpos[self._at.hinges] = hinge_angles(np.vstack([rest.t_W, rest.t_D_W])).ravel()
        self._put_receiver(np.array(_WAITING_PLACE_M))
        self._tensions = rest.root_tension_n, rest.drogue_tension_n, 0.0
        self._observe(0)
        p_WD_mean = self._settle(round(start.settle_s / clock.step_s))
        R_WB = np.asarray(receiver.trim_R_WB)
        self._put_receiver(p_WD_mean - R_WB @ (start.p_PD_B + p.mounting.p_BP))
        self.data.qacc[self._at.receiver_dof] = 0.0
        self._observe(0)

    def step(self, command: ReceiverCommand) -> Truth:
        """Advance by one physics tick under a command; return the new truth."""
        truth = self.truth
        force_W, torque_W = self._receiver.step(
            R_WB=truth.R_WB,
            v_WB=truth.v_WB,
            w_WB_B=truth.w_WB_B,
            air_velocity_W=self._wind_W + self._air_state.receiver_W,
            air_rotation_B=self._air_state.receiver_rotation_B,
            specific_force_B=truth.specific_force_B,
            command=command,
        )
        self._receiver_wrench[:3], self._receiver_wrench[3:] = force_W, torque_W
        self._advance(truth.tick + 1)
        return self.truth

    def save(self) -> WorldState:
        """Everything that the next steps depend on."""
        engine = np.empty(mujoco.mj_stateSize(self.model, _STATE))
        mujoco.mj_getState(self.model, self.data, engine, _STATE)
        return WorldState(
            engine=engine,
            parts=copy.deepcopy((self._tow.reel, self._receiver, self._air)),
            coupling=self._coupling,
            truth=self.truth,
            seen=self._seen,
            air=self._air_state,
        )

    def restore(self, state: WorldState) -> None:
        """Go back to a saved state; what follows is the same to the bit."""
        mujoco.mj_setState(self.model, self.data, state.engine, _STATE)
        mujoco.mj_step1(self.model, self.data)
        self._tow.reel, self._receiver, self._air = copy.deepcopy(state.parts)
        self._coupling, self.truth, self._seen, self._air_state = state.coupling, state.truth, state.seen, state.air
        self._tanker.put(self.truth.time_s)

    def _keep_views(self, at: Addresses, d: mujoco.MjData) -> None:
        """Views of MuJoCo's own memory, which every tick reads: to ask for them anew takes a tenth of its time."""
        self._bodies, self._joints = (d.xpos, d.xmat, d.cvel, d.subtree_com), (d.qpos, d.qvel, d.qacc)
        R = d.xmat[at.tow].reshape(-1, 3, 3)
        self._tow_places = d.xipos[at.tow], R, d.cvel[at.tow], d.subtree_com[at.tanker]
        self._tow_wrenches, self._receiver_wrench = d.xfrc_applied[at.tow], d.xfrc_applied[at.receiver]
        self._hose_joints = d.xpos[at.links], d.xanchor[at.drogue_joint]

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
        self._tow_wrenches[:] = self._tow.wrenches(
            *self._tow_places, self._air_state.tow_W, before.reel_position_m, self._tanker.pod()
        )
        locked = self._reel_locked is not None and self._reel_locked(before.time_s)
        data.qfrc_applied[at.reel_dof] = self._tow.reel.step(
            before.root_tension_n, before.reel_position_m, before.reel_rate_m_s, locked
        )
        self._tanker.set_out(self._clock.seconds(tick))
        self._solve(self._clock.seconds(tick))
        self._decide_coupling()
        if self._air is not None:
            self._air.step()
        self._tanker.arrive()
        mujoco.mj_step1(self.model, data)
        self._observe(tick)

    def _solve(self, time_s: float) -> None:
        """MuJoCo's second half step, and the forces at its beginning: they must be taken before it integrates."""
        at, data = self._at, self.data
        mujoco.mj_fwdActuation(self.model, data)
        mujoco.mj_fwdAcceleration(self.model, data)
        mujoco.mj_fwdConstraint(self.model, data)
        mujoco.mj_rnePostConstraint(self.model, data)
        at_exit = at.tow.start + self._tow.link_at_exit(self.truth.reel_position_m)
        root, drogue, converged = _solved(
            data.cfrc_int, self._bodies[1], self._joints[2], at_exit, at.drogue, _DIVERGED
        )
        if not converged:
            raise DivergedError("world", expected="a physics step that converges", got=f"diverged at {time_s:.3f} s")
        pull = 0.0
        if self._coupling is CouplingState.LATCHED:  # its three rows come first: it is the only equality
            pull = float(data.efc_force[:3] @ self.truth.R_WD[:, 0])
        self._tensions = root, drogue, pull
        mujoco.mj_implicit(self.model, data)

    def _decide_coupling(self) -> None:
        p = self.parameters.coupling
        if self._coupling is CouplingState.READY and self._seen[layout.TIP_DISTANCE] > p.capture_distance_m:
            return  # nothing to decide, and no time to lose
        probe = probe_in_coupling(self.truth, self._tensions[2], p)
        self._coupling = next_coupling_state(self._coupling, probe, p)
        self.data.eq_active[self._at.latch] = self._coupling is CouplingState.LATCHED

    def _observe(self, tick: int) -> None:
        """Take the truth of the present state, and the air's motion where everything is."""
        at, data, tanker = self._at, self.data, self._tanker
        self._seen = x = observed(
            self._bodies,
            self._joints,
            at.observed,
            self._tip_in_body,
            self.parameters.coupling.depth_m,
            _GRAVITY,
        )
        R_WB, p_WB = x[layout.R_WB].reshape(3, 3), x[layout.P_WB]
        R_WT, p_WT = tanker.R_WT, tanker.p_WT
        drogue, places = self.parameters.drogue, self._tow_places[0].copy()
        places[-1] += (drogue.drag_centre_x_m - drogue.centre_of_mass_x_m) * x[layout.R_WD][::3]  # at its canopy
        air = still_air(len(places)) if self._air is None else self._air.at(places, R_WB, p_WB, R_WT, p_WT)
        probe_touches, receiver_touches = at.contacts(data.contact.geom) if data.ncon else (False, "")
        joints = np.empty(places.shape)
        joints[:-1], joints[-1] = self._hose_joints
        self._air_state = air
        self.truth = truth_of(
            tick=tick,
            time_s=self._clock.seconds(tick),
            seen=x,
            joints_W=joints,
            tanker=tanker,
            tensions_n=self._tensions,
            air=air,
            receiver=self._receiver,
            latched=self._coupling is CouplingState.LATCHED,
            touches=(probe_touches, receiver_touches),
        )


@njit(cache=True)
def _solved(cfrc_int, xmat, qacc, at_exit, drogue, limit):  # type: ignore[no-untyped-def]
    """Tensions at the exit and at the drogue, positive where the hose pulls; whether all accelerations are finite."""
    converged = True
    for a in qacc:
        converged = converged and abs(a) < limit  # also when it is not a number
    tensions = np.empty(2)
    for i, body in enumerate((at_exit, drogue)):
        f, R = cfrc_int[body], xmat[body]
        size = np.sqrt(f[3] * f[3] + f[4] * f[4] + f[5] * f[5])
        tensions[i] = np.copysign(size, f[3] * R[0] + f[4] * R[3] + f[5] * R[6])
    return tensions[0], tensions[1], converged


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
        receiver_outline=p.receiver_outline,
    )
