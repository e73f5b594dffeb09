"""The complete state of the world at one tick. It goes to the log and to the referee, never to `nav`.

`observed` reads it out of MuJoCo's arrays. With r the place of a point from the tree's centre of mass c,

    v(point) = v(c) + w x r                                                                               (1)

where (w, v(c)) is what MuJoCo calls a body's `cvel`.
"""

from dataclasses import dataclass, field
from typing import Protocol

import numpy as np
from numba import njit
from numpy.typing import NDArray

from dockair.rotations import Array

#: Layout of `observed`'s vector: attitudes and vectors of the receiver, the probe's tip and the drogue, then scalars.
R_WB, P_WB, V_WB, W_WB_B, A_WB, ALPHA_WB_B, SPECIFIC_FORCE_B = (
    slice(0, 9), slice(9, 12), slice(12, 15), slice(15, 18), slice(18, 21), slice(21, 24), slice(24, 27)
)  # fmt: skip
P_WP, V_WP, R_WD, P_WD, V_WD, W_WD_D = (
    slice(27, 30), slice(30, 33), slice(33, 42), slice(42, 45), slice(45, 48), slice(48, 51)
)  # fmt: skip
REEL_POSITION, REEL_RATE, TIP_DISTANCE = 51, 52, 53
OBSERVED = 54


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Truth:
    """Copies, not views: a Truth stays true after the world has moved on. Frames as in docs/notation.md."""

    tick: int
    time_s: float
    R_WB: Array  #: (3, 3) receiver attitude
    p_WB: Array  #: (3,) receiver centre of gravity [m]
    v_WB: Array  #: (3,) its velocity in W [m/s] (relative to the tanker's velocity at the start)
    w_WB_B: Array  #: (3,) receiver angular velocity in B [rad/s]
    alpha_WB_B: Array  #: (3,) receiver angular acceleration in B [rad/s^2], over the tick that has just ended
    a_WB: Array  #: (3,) acceleration of the centre of gravity in W [m/s^2], gravity's part included; likewise
    specific_force_B: Array  #: (3,) the same less gravity, in B [m/s^2]: what an accelerometer there feels
    p_WP: Array  #: (3,) probe tip [m]
    v_WP: Array  #: (3,) its velocity [m/s]
    R_WD: Array  #: (3, 3) drogue attitude
    p_WD: Array  #: (3,) centre of the LED ring [m]
    v_WD: Array  #: (3,) its velocity [m/s]
    w_WD_D: Array  #: (3,) drogue angular velocity in D [rad/s]
    p_WH: Array  #: (links + 1, 3) hose joints from the reel to the drogue [m]
    R_WT: Array  #: (3, 3) tanker attitude
    p_WT: Array  #: (3,) tanker [m]
    v_WT: Array = field(default_factory=lambda: np.zeros(3))  #: (3,) its velocity in W [m/s]
    w_WT_T: Array = field(default_factory=lambda: np.zeros(3))  #: (3,) its angular velocity in T [rad/s]
    reel_position_m: float  #: hose wound in from full trail, 0 at the outer stop
    reel_rate_m_s: float
    root_tension_n: float  #: hose tension at the pod's exit
    drogue_tension_n: float  #: hose tension where the drogue begins
    gust_B_m_s: Array  #: (3,) air's motion beyond the undisturbed wind at the receiver, W axes
    gust_D_m_s: Array  #: (3,) the same at the drogue
    airspeed_m_s: float  #: of the receiver
    angle_of_attack_rad: float
    sideslip_rad: float
    throttle: float  #: commanded fraction of the thrust range
    latched: bool  #: the probe is held by the coupling
    coupling_force_n: float  #: pull on the probe by the coupling, 0 when not latched
    probe_touches_drogue: bool  #: any contact of the probe with basket or coupling at this tick
    receiver_touches: str  #: name of what the receiver (other than its probe) touches, "" for nothing

    @property
    def p_PD_B(self) -> Array:
        """(3,) ring centre from the probe's tip, body axes [m]."""
        return self.R_WB.T @ (self.p_WD - self.p_WP)

    @property
    def p_DP(self) -> Array:
        """(3,) probe tip from the ring centre, drogue axes [m]; x < 0 while the probe is still aft of the rim."""
        return self.R_WD.T @ (self.p_WP - self.p_WD)


class _Tanker(Protocol):
    @property
    def R_WT(self) -> Array: ...
    @property
    def p_WT(self) -> Array: ...
    @property
    def v_WT(self) -> Array: ...
    @property
    def w_WT_T(self) -> Array: ...


class _Air(Protocol):
    @property
    def tow_W(self) -> Array: ...
    @property
    def receiver_W(self) -> Array: ...


class _Receiver(Protocol):
    @property
    def airspeed_m_s(self) -> float: ...
    @property
    def angle_of_attack_rad(self) -> float: ...
    @property
    def sideslip_rad(self) -> float: ...
    @property
    def throttle(self) -> float: ...


def truth_of(
    *,
    tick: int,
    time_s: float,
    seen: Array,
    joints_W: Array,
    tanker: _Tanker,
    tensions_n: tuple[float, float, float],
    air: _Air,
    receiver: _Receiver,
    latched: bool,
    touches: tuple[bool, str],
) -> Truth:
    """Put a Truth together.

    Args:
        tick: now.
        time_s: now.
        seen: of `observed`; the Truth keeps it.
        joints_W: (links + 1, 3) hose joints; likewise.
        tanker: where it is.
        tensions_n: at the exit, at the drogue, and the coupling's pull.
        air: its motion.
        receiver: what it knows of its flow.
        latched: the coupling holds the probe.
        touches: whether the probe touches the drogue; what the receiver touches.
    """
    x, f = seen, float
    return Truth(
        tick=tick, time_s=time_s,
        R_WB=x[R_WB].reshape(3, 3), p_WB=x[P_WB], v_WB=x[V_WB], w_WB_B=x[W_WB_B], alpha_WB_B=x[ALPHA_WB_B],
        a_WB=x[A_WB], specific_force_B=x[SPECIFIC_FORCE_B], p_WP=x[P_WP], v_WP=x[V_WP],
        R_WD=x[R_WD].reshape(3, 3), p_WD=x[P_WD], v_WD=x[V_WD], w_WD_D=x[W_WD_D], p_WH=joints_W,
        R_WT=tanker.R_WT, p_WT=tanker.p_WT, v_WT=tanker.v_WT, w_WT_T=tanker.w_WT_T,
        reel_position_m=f(x[REEL_POSITION]), reel_rate_m_s=f(x[REEL_RATE]),
        root_tension_n=tensions_n[0], drogue_tension_n=tensions_n[1], coupling_force_n=tensions_n[2],
        gust_B_m_s=air.receiver_W, gust_D_m_s=air.tow_W[-1], airspeed_m_s=receiver.airspeed_m_s,
        angle_of_attack_rad=receiver.angle_of_attack_rad, sideslip_rad=receiver.sideslip_rad,
        throttle=receiver.throttle, latched=latched, probe_touches_drogue=touches[0], receiver_touches=touches[1],
    )  # fmt: skip


@njit(cache=True)
def observed(
    bodies: tuple[Array, Array, Array, Array],
    joints: tuple[Array, Array, Array],
    where: NDArray[np.int64],
    p_BP: Array,
    depth_m: float,
    gravity_W: Array,
) -> Array:
    """(54,) what MuJoCo's arrays say about receiver, probe's tip, drogue and reel, a new array laid out as above.

    Args:
        bodies: xpos, xmat, cvel, subtree_com.
        joints: qpos, qvel, qacc.
        where: of `Addresses.observed`.
        p_BP: (3,) probe's tip in the receiver's axes [m].
        depth_m: coupling point ahead of the ring's centre.
        gravity_W: (3,) [m/s^2].
    """
    (xpos, xmat, cvel, subtree_com), (qpos, qvel, qacc) = bodies, joints
    receiver, drogue, tree, dof, reel_qpos, reel_dof = where[0], where[1], where[2], where[3], where[4], where[5]
    out = np.empty(OBSERVED)
    B, D, w = xmat[receiver], xmat[drogue], cvel[drogue]
    turn, arm, r = np.empty(3), np.empty(3), np.empty(3)
    for i in range(9):
        out[i], out[33 + i] = B[i], D[i]
    for i in range(3):
        out[9 + i], out[12 + i], out[15 + i] = xpos[receiver, i], qvel[dof + i], qvel[dof + 3 + i]
        out[18 + i], out[21 + i], out[42 + i] = qacc[dof + i], qacc[dof + 3 + i], xpos[drogue, i]
        turn[i] = B[3 * i] * qvel[dof + 3] + B[3 * i + 1] * qvel[dof + 4] + B[3 * i + 2] * qvel[dof + 5]
        arm[i] = B[3 * i] * p_BP[0] + B[3 * i + 1] * p_BP[1] + B[3 * i + 2] * p_BP[2]
        r[i] = xpos[drogue, i] - subtree_com[tree, i]
    tip2 = 0.0
    for i in range(3):
        j, k = (i + 1) % 3, (i + 2) % 3
        out[24 + i] = 0.0
        for m in range(3):
            out[24 + i] += B[3 * m + i] * (qacc[dof + m] - gravity_W[m])
        out[27 + i] = out[9 + i] + arm[i]
        out[30 + i] = out[12 + i] + (turn[j] * arm[k] - turn[k] * arm[j])
        out[45 + i] = w[3 + i] + (w[j] * r[k] - w[k] * r[j])  # Eq. (1)
        out[48 + i] = D[i] * w[0] + D[3 + i] * w[1] + D[6 + i] * w[2]
        tip2 += (out[27 + i] - out[42 + i] - depth_m * D[3 * i]) ** 2
    out[REEL_POSITION], out[REEL_RATE], out[TIP_DISTANCE] = qpos[reel_qpos], qvel[reel_dof], np.sqrt(tip2)
    return out
