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
receiver waits far behind; then the receiver is put, at rest in W and trimmed in the wake's downwash there, where the
probe's tip stands to the drogue's *mean* place over the second half of that time as asked.

Not modelled: what hose and receiver do to the tanker; the mass of the fuel that flows (`hose.fuel`).
"""

import copy
from collections.abc import Callable
from dataclasses import dataclass

import mujoco
import numpy as np

from dockair.clock import Clock
from dockair.errors import DockairError
from dockair.kernels import njit
from dockair.messages import ReceiverCommand
from dockair.rotations import Array, quaternion_from_matrix
from dockair.sim import truth as layout
from dockair.sim.addresses import Addresses
from dockair.sim.air.atmosphere import STANDARD_GRAVITY_M_S2
from dockair.sim.air.motion import AirState
from dockair.sim.aircraft.tanker import TankerPath, TankerPathParameters
from dockair.sim.hose.coupling import CouplingState, next_coupling_state, probe_in_coupling, stays
from dockair.sim.hose.fuel import Fuel
from dockair.sim.hose.probe_push import probe_push
from dockair.sim.hose.reel import Reel, reel_light
from dockair.sim.hose.rest import hinge_angles
from dockair.sim.hose.tow import Tow
from dockair.sim.led_tanker import LedTanker
from dockair.sim.parts import AirAround, Airframe, FlyingAirframe, WorldParameters, WorldStart, scene_of, still_air
from dockair.sim.reach import Reach
from dockair.sim.scene import build_scene
from dockair.sim.step_limit import check_step
from dockair.sim.truth import Seen, Truth, observe, truth_of

__all__ = ["World", "DivergedError", "WorldParameters", "WorldStart", "WorldState"]

_WAITING_PLACE_M = (-300.0, 0.0, -20.0)  # of the receiver while the hose settles: out of everybody's way
_TRIMS = 3  # attitude changes the place, the place the wake, the wake the attitude: a fortieth as much each time
_STATE = mujoco.mjtState.mjSTATE_INTEGRATION
_DIVERGED = 1e10  # acceleration at which MuJoCo calls a step unstable [m/s^2 or rad/s^2]


class DivergedError(DockairError):
    """The integration has become unstable; the world's truth is still that of the last tick that was not."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class WorldState:
    """Everything that a world remembers; opaque."""

    engine: Array
    parts: tuple[Reel, Airframe, AirAround | None, Fuel]
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
        reel_known_dead: whether the hose unit knows it at a time, and shuts the fuel off; never by default.
        tanker_path: what the tanker flies; straight on by default.

    Attributes:
        truth: the state now.
        model, data: for the camera, to read only; the model says to look for contacts only while there may be some.
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
        reel_known_dead: Callable[[float], bool] | None = None,
    ) -> None:
        if not start.settle_s >= 0.0:
            raise DockairError("start.settle_s", expected="a time >= 0", got=start.settle_s)
        self.parameters, self._receiver, self._air, self._clock = parameters, receiver, air, clock
        self._reel_locked, self._reel_known_dead, self._drum_stands = reel_locked, reel_known_dead, False
        self.model = build_scene(scene_of(parameters, receiver, clock.step_s))
        self.data = mujoco.MjData(self.model)
        self._at = Addresses.of(self.model)
        self._reach, self._looks = Reach(self.model, self.data, self._at.receiver), True
        self._keep_views(self._at, self.data)
        self._wind_W = np.array([-parameters.airspeed_m_s, 0.0, 0.0])
        p = parameters
        self._tow = Tow(p.hose, p.drogue, p.reel, p.air, self._wind_W, clock.step_s)
        self._coupling, self._fuel = CouplingState.READY, Fuel(p.fuel, clock.step_s)
        exit_T = np.array(p.tanker.exit_m, dtype=float)
        path = tanker_path or TankerPath(TankerPathParameters(), p.airspeed_m_s, -exit_T)
        self._tanker = LedTanker(path, self.model, self.data, self._at, exit_T, clock.step_s)
        self.rest = rest = self._tow.rest
        check_step(self.model, parameters, rest.root_tension_n)
        self.data.qpos[self._at.hinges] = hinge_angles(np.vstack([rest.t_W, rest.t_D_W])).ravel()
        self._put_receiver(np.array(_WAITING_PLACE_M))
        self._tensions = rest.root_tension_n, rest.drogue_tension_n, 0.0
        self._observe(0)
        p_WD_mean = self._settle(round(start.settle_s / clock.step_s))
        self._put_behind(p_WD_mean, start.p_PD_B)
        self.data.qacc[self._at.receiver_dof] = 0.0
        self._observe(0)

    def step(self, command: ReceiverCommand) -> Truth:
        """Advance by one physics tick under a command; return the new truth."""
        air = self._air_state
        self._wrench_W[:] = self._receiver.step(
            R_WB=self._R_WB,
            v_WB=self._v_WB,
            w_WB_B=self._w_WB_B,
            air_velocity_W=self._wind_W + air.receiver_W,
            air_rotation_B=air.receiver_rotation_B,
            specific_force_B=self._seen[layout.SPECIFIC_FORCE_B],
            command=command,
        )
        self._advance(self._tick + 1)
        return self.truth

    def save(self) -> WorldState:
        """Everything that the next steps depend on."""
        engine = np.empty(mujoco.mj_stateSize(self.model, _STATE))
        mujoco.mj_getState(self.model, self.data, engine, _STATE)
        return WorldState(
            engine=engine,
            parts=copy.deepcopy((self._tow.reel, self._receiver, self._air, self._fuel)),
            coupling=self._coupling,
            truth=self.truth,
            seen=self._seen,
            air=self._air_state,
        )

    def restore(self, state: WorldState) -> None:
        """Go back to a saved state; what follows is the same to the bit."""
        mujoco.mj_setState(self.model, self.data, state.engine, _STATE)
        self._hold_drum(state.parts[0].locked)
        self._renew()
        self._tow.reel, self._receiver, self._air, self._fuel = copy.deepcopy(state.parts)
        self._coupling, self.truth, self._seen, self._air_state = state.coupling, state.truth, state.seen, state.air
        now, self._tick = self.truth, state.truth.tick
        self._tensions = (now.root_tension_n, now.drogue_tension_n, now.coupling_force_n)
        self._tanker.put(now.time_s)

    def _keep_views(self, at: Addresses, d: mujoco.MjData) -> None:
        """Views of MuJoCo's own memory, which every tick reads: to ask for them anew takes a tenth of its time."""
        R = d.xmat[at.tow].reshape(-1, 3, 3)
        self._tow_places = d.xipos[at.tow], R, d.cvel[at.tow], d.subtree_com[at.tanker]
        self._tow_wrenches, self._reel_force = d.xfrc_applied[at.tow], d.qfrc_applied[at.reel_dof : at.reel_dof + 1]
        self._wrench_W = d.xfrc_applied[at.receiver].reshape(2, 3)
        self._R_WB, self._p_WB = d.xmat[at.receiver].reshape(3, 3), d.xpos[at.receiver]
        self._v_WB, self._w_WB_B = np.split(d.qvel[at.receiver_dof], 2)
        self._reactions = d.cfrc_int, d.xmat, d.qacc
        drogue = self.parameters.drogue
        canopy, gravity = drogue.drag_centre_x_m - drogue.centre_of_mass_x_m, [0.0, 0.0, -STANDARD_GRAVITY_M_S2]
        tip, depth = self.parameters.mounting.p_BP, self.parameters.coupling.depth_m
        where, constants = np.append(at.observed, [at.tow.start, at.drogue_joint]), [*tip, depth, *gravity, canopy]
        bodies, joints = (d.xpos, d.xmat, d.cvel, d.subtree_com, d.xipos), (d.xanchor, d.qpos, d.qvel, d.qacc)
        self._sight = (*bodies, *joints, where, np.array(constants))

    def _put_behind(self, p_WD: Array, p_PD_B: Array) -> None:
        """Put the receiver behind the drogue at p_WD, trimmed in the wake that blows where it then is."""
        receiver, from_tip_B = self._receiver, p_PD_B + self.parameters.mounting.p_BP
        for _ in range(_TRIMS):
            if self._air is None or not isinstance(receiver, FlyingAirframe):
                break
            R_WB = np.ascontiguousarray(receiver.trim_R_WB)
            where = (p_WD[np.newaxis], R_WB, p_WD - R_WB @ from_tip_B, self._tanker.R_WT, self._tanker.p_WT)
            wake = self._air.steady().at(*where)
            if wake.receiver_W.any():
                receiver.trim_in(-float(wake.receiver_W[2]), float(wake.receiver_rotation_B[1]))
        self._put_receiver(p_WD - np.asarray(receiver.trim_R_WB) @ from_tip_B)

    def _put_receiver(self, p_WB: Array) -> None:
        """Place the receiver, trimmed and at rest in W."""
        qpos = self.data.qpos[self._at.receiver_qpos]
        qpos[:3], qpos[3:] = p_WB, quaternion_from_matrix(np.asarray(self._receiver.trim_R_WB))
        self.data.qvel[self._at.receiver_dof] = 0.0
        self.data.qacc_warmstart[self._at.receiver_dof] = 0.0
        self._renew()

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
        x, time_s = self._seen, self._clock.seconds(tick)
        position, rate = float(x[layout.REEL_POSITION]), float(x[layout.REEL_RATE])
        pod = self._tanker.pod() if position > 0.0 else None  # nobody asks for it while all of the hose is outside
        self._tow_wrenches[:] = self._tow.wrenches(*self._tow_places, self._air_state.tow_W, position, pod)
        began_s = self._clock.seconds(self._tick)
        locked = self._reel_locked is not None and self._reel_locked(began_s)
        self._hold_drum(locked)
        self._reel_force[0] = self._tow.reel.step(self._tensions[0], position, rate, locked)
        self._tanker.set_out(time_s)
        self._solve(time_s, self._at.tow.start + self._tow.link_at_exit(position))
        self._decide_coupling()
        if self._coupling is CouplingState.LATCHED or self._fuel.flow_kg_s > 0.0:
            known_dead = self._reel_known_dead is not None and self._reel_known_dead(began_s)
            light = reel_light(position, known_dead, self.parameters.reel)
            self._fuel.step(light, self._coupling is CouplingState.LATCHED)
        if self._air is not None:
            self._air.step()
        self._tanker.arrive()
        self._renew(may_touch=not self._reach.is_clear())
        self._observe(tick)

    def _hold_drum(self, stands: bool) -> None:
        """From the next step on the drum's inertia is on the hose's way in and out, or, where it stands, is not."""
        if stands != self._drum_stands:
            self._drum_stands = stands
            self.model.dof_armature[self._at.reel_dof] = 0.0 if stands else self.parameters.reel.drum_mass_kg

    def _renew(self, *, may_touch: bool = True) -> None:
        """MuJoCo's first half step; to look for contacts takes a third of it."""
        if may_touch != self._looks:
            self.model.opt.disableflags ^= mujoco.mjtDisableBit.mjDSBL_CONTACT
            self._looks = may_touch
        mujoco.mj_step1(self.model, self.data)

    def _solve(self, time_s: float, at_exit: int) -> None:
        """MuJoCo's second half step, without actuators, and the forces that must be taken before it integrates."""
        model, data = self.model, self.data
        mujoco.mj_fwdAcceleration(model, data)
        mujoco.mj_fwdConstraint(model, data)
        mujoco.mj_rnePostConstraint(model, data)
        root, drogue, converged = _solved(*self._reactions, at_exit, self._at.drogue, _DIVERGED)
        if not converged:
            raise DivergedError("world", expected="a physics step that converges", got=f"diverged at {time_s:.3f} s")
        pull = 0.0
        if self._coupling is CouplingState.LATCHED:  # its three rows come first: it is the only equality
            held = data.efc_force[:3]
            if data.ncon:
                held = held - probe_push(model, data, self._at.geom_is_probe, self._at.geom_is_drogue)
            pull = float(held @ self.truth.R_WD[:, 0])
        self._tensions = root, drogue, pull
        mujoco.mj_implicit(model, data)

    def _decide_coupling(self) -> None:
        p = self.parameters.coupling
        if stays(self._coupling, self._seen[layout.TIP_DISTANCE], self._tensions[2], p):
            return
        probe = probe_in_coupling(self.truth, self._tensions[2], p)
        self._coupling = next_coupling_state(self._coupling, probe, p)
        self.data.eq_active[self._at.latch] = self._coupling is CouplingState.LATCHED

    def _observe(self, tick: int) -> None:
        """Take the truth of the present state, and the air's motion where everything is."""
        data, tanker, bodies = self.data, self._tanker, len(self._tow_wrenches)
        x, hose = np.empty(layout.OBSERVED), np.empty((2, bodies, 3))
        observe(x, hose, *self._sight)
        self._tick, self._seen = tick, x
        if self._air is None:
            air = still_air(bodies)
        else:
            air = self._air.at(hose[1], self._R_WB, self._p_WB, tanker.R_WT, tanker.p_WT)
        touches = self._at.contacts(data.contact.geom) if data.ncon else (False, "")
        own, self._air_state = self._receiver, air
        flow = own.airspeed_m_s, own.angle_of_attack_rad, own.sideslip_rad, own.throttle
        latched, time_s = self._coupling is CouplingState.LATCHED, self._clock.seconds(tick)
        fuel = self._fuel.given_kg, self._fuel.flow_kg_s
        seen = Seen(tick, time_s, x, hose, tanker.state, self._tensions, air, flow, latched, fuel, touches)
        self.truth = truth_of(seen)


@njit(cache=True)
def _solved(cfrc_int, xmat, qacc, at_exit, drogue, limit):  # type: ignore[no-untyped-def]
    """Tensions at the exit and at the drogue, positive where the hose pulls; whether all accelerations are finite."""
    converged = True
    for a in qacc:
        converged = converged and abs(a) < limit  # also when it is not a number
    return _tension(cfrc_int, xmat, at_exit), _tension(cfrc_int, xmat, drogue), converged


@njit(cache=True)
def _tension(cfrc_int, xmat, body):  # type: ignore[no-untyped-def]
    f, R = cfrc_int[body], xmat[body]
    size = np.sqrt(f[3] * f[3] + f[4] * f[4] + f[5] * f[5])
    return np.copysign(size, f[3] * R[0] + f[4] * R[3] + f[5] * R[6])
