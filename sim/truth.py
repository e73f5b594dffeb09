"""The complete state of the world at one tick. It goes to the log and to the referee, never to `nav`.

`observe` reads it out of MuJoCo's arrays. With r the place of a point from the tree's centre of mass c,

    v(point) = v(c) + w x r                                                                               (1)

where (w, v(c)) is what MuJoCo calls a body's `cvel`.
"""

from collections.abc import Callable
from dataclasses import dataclass, field
from operator import attrgetter
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from dockair.kernels import njit
from dockair.rotations import Array
from dockair.sim.air.motion import AirState
from dockair.sim.aircraft import tanker_motion

#: Layout of `observe`'s vector: attitudes and vectors of the receiver, the probe's tip and the drogue, scalars, and
#: the tip seen from the drogue.
R_WB, P_WB, V_WB, W_WB_B, A_WB, ALPHA_WB_B, SPECIFIC_FORCE_B = (
    slice(0, 9), slice(9, 12), slice(12, 15), slice(15, 18), slice(18, 21), slice(21, 24), slice(24, 27)
)  # fmt: skip
P_WP, V_WP, R_WD, P_WD, V_WD, W_WD_D = (
    slice(27, 30), slice(30, 33), slice(33, 42), slice(42, 45), slice(45, 48), slice(48, 51)
)  # fmt: skip
REEL_POSITION, REEL_RATE, TIP_DISTANCE = 51, 52, 53
P_DP = slice(54, 57)
OBSERVED = 57


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Truth:
    """Copies, not views: a Truth stays true after the world has moved on, and who writes into one changes no flight.

    Frames as in docs/notation.md.
    """

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
    coupling_force_n: float  #: pull on the probe by the coupling in this tick, that in which it let go the last; else 0
    fuel_kg: float = 0.0  #: that has flowed through the coupling
    fuel_flow_kg_s: float = 0.0
    probe_touches_drogue: bool  #: any contact of the probe with basket or coupling at this tick
    receiver_touches: str  #: name of what the receiver touches, the probe's touches of the drogue apart; "" for nothing

    @property
    def p_PD_B(self) -> Array:
        """(3,) ring centre from the probe's tip, body axes [m]."""
        p_PD_B: Array = (self.p_WD - self.p_WP).dot(self.R_WB)  # its transpose from the left: quicker than that is
        return p_PD_B

    @property
    def p_DP(self) -> Array:
        """(3,) probe tip from the ring centre, drogue axes [m]; x < 0 while the probe is still aft of the rim."""
        p_DP: Array = (self.p_WP - self.p_WD).dot(self.R_WD)  # likewise
        return p_DP


class Seen(NamedTuple):
    """What a Truth is cut out of. The world reads these arrays too, and nobody writes into them any more."""

    tick: int
    time_s: float
    x: Array  #: of `observe`
    hose: Array  #: likewise
    tanker: Array  #: state of `tanker_motion`
    tensions_n: tuple[float, float, float]  #: at the exit, at the drogue, and the coupling's pull
    air: AirState
    flow: tuple[float, float, float, float]  #: receiver's airspeed, angle of attack, sideslip, and its throttle
    latched: bool
    fuel: tuple[float, float]  #: given, flow
    touches: tuple[bool, str]  #: whether the probe touches the drogue; what the receiver touches


class _TruthWhenRead(Truth):
    """A Truth whose fields are cut out whenever they are read, as copies: at most ticks few are."""

    __slots__ = ("_seen",)
    _seen: Seen

    def __new__(cls, *fields: Any, **named: Any) -> Any:
        """Whoever fills in fields, as `dataclasses.replace` does, gets a Truth that holds them."""
        return Truth(*fields, **named)

    def __reduce__(self) -> tuple[Callable[[Seen], Truth], tuple[Seen]]:
        """Copies are cut out of copies."""
        return truth_of, (self._seen,)


def truth_of(seen: Seen) -> Truth:
    """Return the truth of what was seen."""
    truth = object.__new__(_TruthWhenRead)
    object.__setattr__(truth, "_seen", seen)
    return truth


def _matrix(where: slice) -> Callable[[Any], Array]:
    return lambda truth: truth._seen.x[where].copy().reshape(3, 3)


def _vector(where: slice) -> Callable[[Any], Array]:
    return lambda truth: truth._seen.x[where].copy()


_CUT: dict[str, Callable[[Any], Any]] = {
    "tick": attrgetter("_seen.tick"),
    "time_s": attrgetter("_seen.time_s"),
    "R_WB": _matrix(R_WB), "p_WB": _vector(P_WB), "v_WB": _vector(V_WB), "w_WB_B": _vector(W_WB_B),
    "alpha_WB_B": _vector(ALPHA_WB_B), "a_WB": _vector(A_WB), "specific_force_B": _vector(SPECIFIC_FORCE_B),
    "p_WP": _vector(P_WP), "v_WP": _vector(V_WP),
    "R_WD": _matrix(R_WD), "p_WD": _vector(P_WD), "v_WD": _vector(V_WD), "w_WD_D": _vector(W_WD_D),
    "p_DP": _vector(P_DP),
    "p_WH": lambda truth: truth._seen.hose[0].copy(),
    "R_WT": lambda truth: truth._seen.tanker[tanker_motion.R].copy().reshape(3, 3),
    "p_WT": lambda truth: truth._seen.tanker[tanker_motion.P].copy(),
    "v_WT": lambda truth: truth._seen.tanker[tanker_motion.V].copy(),
    "w_WT_T": lambda truth: truth._seen.tanker[tanker_motion.OMEGA].copy(),
    "reel_position_m": lambda truth: float(truth._seen.x[REEL_POSITION]),
    "reel_rate_m_s": lambda truth: float(truth._seen.x[REEL_RATE]),
    "root_tension_n": lambda truth: truth._seen.tensions_n[0],
    "drogue_tension_n": lambda truth: truth._seen.tensions_n[1],
    "coupling_force_n": lambda truth: truth._seen.tensions_n[2],
    "gust_B_m_s": lambda truth: truth._seen.air.receiver_W.copy(),
    "gust_D_m_s": lambda truth: truth._seen.air.tow_W[-1].copy(),
    "airspeed_m_s": lambda truth: truth._seen.flow[0],
    "angle_of_attack_rad": lambda truth: truth._seen.flow[1],
    "sideslip_rad": lambda truth: truth._seen.flow[2],
    "throttle": lambda truth: truth._seen.flow[3],
    "latched": attrgetter("_seen.latched"),
    "fuel_kg": lambda truth: truth._seen.fuel[0],
    "fuel_flow_kg_s": lambda truth: truth._seen.fuel[1],
    "probe_touches_drogue": lambda truth: truth._seen.touches[0],
    "receiver_touches": lambda truth: truth._seen.touches[1],
}  # fmt: skip
for _name, _cut in _CUT.items():
    setattr(_TruthWhenRead, _name, property(_cut))


@njit(cache=True)
def observe(
    out: Array, hose: Array, xpos: Array, xmat: Array, cvel: Array, subtree_com: Array, xipos: Array, xanchor: Array,
    qpos: Array, qvel: Array, qacc: Array, where: NDArray[np.int64], constants: Array,
) -> None:  # fmt: skip
    """Read receiver, probe's tip, drogue, reel and hose out of MuJoCo's arrays.

    Args:
        out: (57,) written, laid out as above.
        hose: (2, links + 1, 3) written: joints from the reel to the drogue; where the air acts on links and drogue.
        xpos: of MuJoCo, as all down to qacc.
        xmat: rotation matrices.
        cvel: angular velocities, and velocities at the tree's centre of mass.
        subtree_com: that centre.
        xipos: centres of mass.
        xanchor: joints.
        qpos: positions.
        qvel: rates.
        qacc: accelerations.
        where: (8,) bodies: receiver, drogue, tanker; dof of the first; reel's qpos and dof; first link, drogue's joint.
        constants: (8,) probe's tip in the receiver's axes [m]; coupling point ahead of the ring's centre [m]; gravity
            [m/s^2]; the canopy's centre ahead of the drogue's centre of mass [m].
    """
    drogue = where[1]
    out[REEL_POSITION], out[REEL_RATE] = qpos[where[4]], qvel[where[5]]
    _observe_bodies(xpos, xmat, cvel[drogue], subtree_com[where[2]], qvel, qacc, where, constants, out)
    _observe_hose(xpos, xipos, xanchor[where[7]], where[6], xmat[drogue], constants[7], hose)


@njit(cache=True)
def _observe_bodies(xpos, xmat, w, centre, qvel, qacc, where, constants, out):  # type: ignore[no-untyped-def]
    receiver, drogue, dof = where[0], where[1], where[3]
    B, D = xmat[receiver], xmat[drogue]
    turn, arm, r, tip = np.empty(3), np.empty(3), np.empty(3), np.empty(3)
    for i in range(9):
        out[i], out[33 + i] = B[i], D[i]
    for i in range(3):
        out[9 + i], out[12 + i], out[15 + i] = xpos[receiver, i], qvel[dof + i], qvel[dof + 3 + i]
        out[18 + i], out[21 + i], out[42 + i] = qacc[dof + i], qacc[dof + 3 + i], xpos[drogue, i]
        turn[i] = B[3 * i] * qvel[dof + 3] + B[3 * i + 1] * qvel[dof + 4] + B[3 * i + 2] * qvel[dof + 5]
        arm[i] = B[3 * i] * constants[0] + B[3 * i + 1] * constants[1] + B[3 * i + 2] * constants[2]
        r[i] = xpos[drogue, i] - centre[i]
    tip2 = 0.0
    for i in range(3):
        j, k = (i + 1) % 3, (i + 2) % 3
        out[24 + i] = 0.0
        for m in range(3):
            out[24 + i] += B[3 * m + i] * (qacc[dof + m] - constants[4 + m])
        out[27 + i] = out[9 + i] + arm[i]
        out[30 + i] = out[12 + i] + (turn[j] * arm[k] - turn[k] * arm[j])
        out[45 + i] = w[3 + i] + (w[j] * r[k] - w[k] * r[j])  # Eq. (1)
        out[48 + i] = D[i] * w[0] + D[3 + i] * w[1] + D[6 + i] * w[2]
        tip[i] = out[27 + i] - out[42 + i]  # from the ring's centre
        tip2 += (tip[i] - constants[3] * D[3 * i]) ** 2
    out[TIP_DISTANCE] = np.sqrt(tip2)
    for i in range(3):
        out[54 + i] = D[i] * tip[0] + D[3 + i] * tip[1] + D[6 + i] * tip[2]


@njit(cache=True)
def _observe_hose(xpos, xipos, end, first, D, canopy, hose):  # type: ignore[no-untyped-def]
    links = hose.shape[1] - 1
    for axis in range(3):
        for i in range(links):
            hose[0, i, axis], hose[1, i, axis] = xpos[first + i, axis], xipos[first + i, axis]
        hose[0, links, axis] = end[axis]
        hose[1, links, axis] = xipos[first + links, axis] + canopy * D[3 * axis]
