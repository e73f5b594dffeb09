"""What is believed about the drogue relative to the receiver: a Gaussian, or two while the image allows two attitudes.

State and errors, and how they move, are in `belief_motion`. A frame does not see the drogue where it is, but where a
camera and a ring with errors of calibration show it. With c = p_CD_B from the camera to the ring's centre, the camera
turned by k_1, misplaced by k_2, of scale 1 + k_3 (focal length, ring's diameter), the ring strained by k_4 and with
keystone k_5, the pose that explains the image best differs from the true one by

    phi_seen = phi - k_1 + J_phi (k_4, k_5)
    p_seen = p - k_1 x c - k_2 - k_3 c + J_p (k_4, k_5),    J = (H'H)^-1 H' H_ring                    (1)

In short a = M e. These errors do not change during a flight, no averaging lessens them, and little of them can be
estimated: they are considered [Schmidt 1966], that is carried in the covariance and left at zero. LEDs out of place
reach the pose as the eight parameters of a plane's image do: six look like another pose (of which the scale counts),
strain and keystone are the two pairs that do not, and so tilt it a little.

`pose.posterior` forms the poses (a+, P_aa+) that explain a frame and this belief together. The rest follows by
regression on the pose, P_aa = M P M', K = P M' P_aa^-1, in Joseph's form:

    e = K (a+ - a),    P+ = (I - K M) P (I - K M)' + K P_aa+ K'                                       (2)

but for the considered block of P+, which stays as it was. Loosely coupled, the frame's own pose and covariance are
averaged with the belief; tightly, its lines of sight are fitted together with the belief, which one LED allows, too.

Two of them far apart stay apart, each with its weight, until one dies: one Gaussian drawn over both would forget at
every frame what the frames before had said about which. Two close together become one, with the mixture's moments.
What a strained ring says for the wrong one it says in every frame, so that frames are no independent witnesses: of a
frame's log evidence a share counts, and what was said before fades,

    log weight <- memory (log weight) + share (log evidence)                                          (3)
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from dockair.calibration import Mounting
from dockair.nav.belief_motion import CALIBRATION, ERRORS, B, S, V
from dockair.nav.pose.descent import PosePrior
from dockair.nav.pose.difference import pose_difference
from dockair.nav.pose.estimate import PoseEstimate
from dockair.nav.pose.levenberg_marquardt import levenberg_marquardt
from dockair.nav.pose.measurement import LinesOfSight
from dockair.nav.pose.posterior import PosePosterior, posteriors
from dockair.rotations import Array, exp, skew

_MERGE_CHI2 = 9.0  # squared distance in sigmas below which two are told as one: 3 sigma
_LOG_NEGLIGIBLE = -14.0  # logarithm of the relative weight, about 1e-6, at which a hypothesis dies
_MOST = 2  # hypotheses: a flat ring has no more
_POSE_ERRORS = np.arange(6)
_TILT_FLOOR = (
    1e-9  # of the largest information: below it the pose is not determined, and the ring's errors move nothing
)


@dataclass(frozen=True, slots=True, eq=False)
class Belief:
    """One Gaussian."""

    R_BD: Array  #: (3, 3)
    x: Array  #: (6, 3) rows of `belief_motion`: p_ID, v_ID, swing, its rate, the gyro's bias, formation
    P: Array  #: (32, 32) of the errors
    log_weight: float = 0.0

    @property
    def p_ID(self) -> Array:
        """(3,) ring centre from the accelerometers, body axes [m]."""
        return np.asarray(self.x[S])

    @property
    def v_ID(self) -> Array:
        """(3,) its velocity less that of the accelerometers, body axes, not seen from turning axes [m/s]."""
        return np.asarray(self.x[V])

    @property
    def bias(self) -> Array:
        """(3,) of the gyro, body axes [rad/s]."""
        return np.asarray(self.x[B])


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Apparent:
    """The pose that a frame would show, Eq. (1)."""

    R_CD: Array  #: (3, 3)
    p_CD: Array  #: (3,) [m]
    M: Array  #: (6, 32) its errors (phi, delta) in camera axes, per error of the belief
    covariance: Array  #: (6, 6)

    @property
    def prior(self) -> PosePrior:
        """As a prior for a frame's pose."""
        return PosePrior(R_CD=self.R_CD, p_CD=self.p_CD, covariance=self.covariance)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Sight:
    """How the camera sits and what it looks at."""

    mounting: Mounting
    points_D: Array  #: (n, 3) LEDs of the ring [m]

    def apparent(self, belief: Belief) -> Apparent:
        """Return the pose that a frame would show, with how it depends on the errors of a belief."""
        R_CB = self.mounting.R_BC.T
        p_CD_B = belief.p_ID + self.mounting.p_BI - self.mounting.p_BC
        R_CD, p_CD = R_CB @ belief.R_BD, R_CB @ p_CD_B
        M = np.zeros((6, ERRORS))
        M[:3, :3] = M[3:, 3:6] = R_CB
        first = CALIBRATION.start
        M[:3, first : first + 3] = -R_CB
        M[3:, first : first + 3] = R_CB @ skew(p_CD_B)
        M[3:, first + 3 : first + 6] = -R_CB
        M[3:, first + 6] = -p_CD
        M[:, first + 7 :] = ring_sensitivity(R_CD, p_CD, self.points_D)
        covariance = M @ belief.P @ M.T
        return Apparent(R_CD=R_CD, p_CD=p_CD, M=M, covariance=0.5 * (covariance + covariance.T))


def ring_sensitivity(R_CD: Array, p_CD: Array, points_D: Array) -> Array:
    """(6, 4) J of Eq. (1): how the pose that explains all LEDs moves with strain (-) and keystone (1/m) of the ring.

    Strain (e, g) moves an LED at (y, z) by (e y + g z, g y - e z), keystone (j, l) by (y, z)(j y + l z).
    """
    y, z = points_D[:, 1], points_D[:, 2]
    moved = np.zeros((4, len(points_D), 3))
    moved[0, :, 1], moved[0, :, 2] = y, -z
    moved[1, :, 1], moved[1, :, 2] = z, y
    moved[2, :, 1], moved[2, :, 2] = y * y, y * z
    moved[3, :, 1], moved[3, :, 2] = y * z, z * z
    arm_C = points_D @ R_CD.T
    at_C = arm_C + p_CD
    G = np.zeros((len(points_D), 2, 3))  # of (-y/x, -z/x), the image but for the focal length
    G[:, 0, 0], G[:, 1, 0] = at_C[:, 1] / at_C[:, 0] ** 2, at_C[:, 2] / at_C[:, 0] ** 2
    G[:, 0, 1] = G[:, 1, 2] = -1.0 / at_C[:, 0]
    turn = np.zeros((len(points_D), 3, 3))
    turn[:, 0, 1], turn[:, 0, 2], turn[:, 1, 2] = arm_C[:, 2], -arm_C[:, 1], arm_C[:, 0]
    turn[:, 1, 0], turn[:, 2, 0], turn[:, 2, 1] = -arm_C[:, 2], arm_C[:, 1], -arm_C[:, 0]
    H = np.concatenate([G @ turn, G], axis=2).reshape(-1, 6)
    H_ring = np.stack([(G @ (d @ R_CD.T)[:, :, None]).ravel() for d in moved], axis=1)
    scale = np.sqrt((H * H).sum(axis=0))
    values, vectors = np.linalg.eigh((H / scale).T @ (H / scale))
    weak = values < _TILT_FLOOR * values[-1]
    inverse = (vectors * np.where(weak, 0.0, 1.0 / np.where(weak, 1.0, values))) @ vectors.T
    return np.asarray(inverse @ (H / scale).T @ H_ring / scale[:, None])


@dataclass(frozen=True, slots=True, kw_only=True)
class Taking:
    """How a frame is taken."""

    tight: bool = True  #: whether a pose's lines of sight are fitted together with the belief
    memory: float = 1.0  #: of Eq. (3), per frame
    share: float = 1.0


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Correction:
    """What a frame made of the belief."""

    beliefs: list[Belief]  #: most likely first; empty if the gate refused the frame
    chi2: float  #: the frame's disagreement with the most likely of them, or the least with any
    degrees_of_freedom: int


def corrected(
    beliefs: Sequence[Belief], frame: PoseEstimate | LinesOfSight, sight: Sight, gates: Sequence[float], taking: Taking
) -> Correction:
    """Return what is believed with a frame taken.

    Args:
        beliefs: before the frame.
        frame: its pose, or the lines of sight of LEDs too few for one.
        sight: camera and ring.
        gates: largest chi2 taken for each number of degrees of freedom from 0 to 6.
        taking: how.
    """
    found, least = [], np.inf
    freedom = min(2 * len(frame.rays), 6) if isinstance(frame, LinesOfSight) else 6
    for belief in beliefs:
        seen = sight.apparent(belief)
        for after in _explanations(seen.prior, frame, taking.tight):
            least = min(least, after.gate_chi2)
            if after.gate_chi2 <= gates[freedom]:
                log_weight = taking.memory * belief.log_weight + taking.share * after.log_evidence
                found.append((_regressed(belief, seen, after, log_weight), after.gate_chi2))
    kept = _kept([belief for belief, _ in found])
    if not kept:
        return Correction(beliefs=[], chi2=least, degrees_of_freedom=freedom)
    chi2 = max(found, key=lambda pair: pair[0].log_weight)[1]
    return Correction(beliefs=kept, chi2=chi2, degrees_of_freedom=freedom)


def _explanations(prior: PosePrior, frame: PoseEstimate | LinesOfSight, tight: bool) -> list[PosePosterior]:
    if isinstance(frame, PoseEstimate):
        return posteriors(prior, frame if tight else replace(frame, measurement=None))
    end = levenberg_marquardt(frame, prior.R_CD, prior.p_CD, prior=prior)
    if not end.converged:
        return []
    log_dets = np.linalg.slogdet(end.covariance)[1] - np.linalg.slogdet(prior.covariance)[1]
    return [
        PosePosterior(
            R_CD=end.R_CD,
            p_CD=end.p_CD,
            covariance=end.covariance,
            log_evidence=0.5 * float(log_dets - end.cost),
            gate_chi2=end.cost,
        )
    ]


def _regressed(belief: Belief, seen: Apparent, after: PosePosterior, log_weight: float) -> Belief:
    """Return a belief after a frame, Eq. (2)."""
    P, M = belief.P, seen.M
    K = np.linalg.solve(seen.covariance, M @ P).T
    e = K @ pose_difference(after.R_CD, after.p_CD, seen.R_CD, seen.p_CD)
    A = np.eye(ERRORS) - K @ M
    P_after = A @ P @ A.T + K @ after.covariance @ K.T
    P_after[CALIBRATION, CALIBRATION] = P[CALIBRATION, CALIBRATION]
    e[CALIBRATION] = 0.0
    return _moved(belief, e, 0.5 * (P_after + P_after.T), log_weight)


def _moved(belief: Belief, e: Array, P: Array, log_weight: float) -> Belief:
    return Belief(exp(e[:3]) @ belief.R_BD, belief.x + e[3 : CALIBRATION.start].reshape(6, 3), P, log_weight)


def mixture(beliefs: Sequence[Belief]) -> Belief:
    """Return the Gaussian with the mean and covariance of all of them."""
    if len(beliefs) == 1:
        return beliefs[0]
    first = beliefs[0]
    logs = np.array([b.log_weight for b in beliefs])
    w = np.exp(logs - logs.max())
    total = float(np.log(w.sum()) + logs.max())
    w /= w.sum()
    steps = np.array([_difference(b, first) for b in beliefs])
    mean = w @ steps
    P = sum(wk * (b.P + np.outer(d - mean, d - mean)) for wk, b, d in zip(w, beliefs, steps, strict=True))
    return _moved(first, mean, np.asarray(P), total)


def _difference(belief: Belief, other: Belief) -> Array:
    """(32,) errors by which a belief is off from another."""
    pose = pose_difference(belief.R_BD, belief.p_ID, other.R_BD, other.p_ID)
    return np.concatenate([pose, (belief.x[V:] - other.x[V:]).ravel(), np.zeros(ERRORS - CALIBRATION.start)])


def _kept(found: list[Belief]) -> list[Belief]:
    """Merge the close, drop the negligible and the surplus, weigh the most likely 1."""
    kept: list[Belief] = []
    for belief in sorted(found, key=lambda b: -b.log_weight):
        for i, other in enumerate(kept):
            d = _difference(belief, other)[_POSE_ERRORS]
            if d @ np.linalg.solve(other.P[:6, :6], d) < _MERGE_CHI2:
                kept[i] = mixture([other, belief])
                break
        else:
            if len(kept) < _MOST and (not kept or belief.log_weight - kept[0].log_weight > _LOG_NEGLIGIBLE):
                kept.append(belief)
    kept.sort(key=lambda b: -b.log_weight)
    return [replace(b, log_weight=b.log_weight - kept[0].log_weight) for b in kept]


def widened(belief: Belief, sigmas: tuple[float, float, float]) -> Belief:
    """Return a belief with less certainty of attitude [rad], place [m] and velocity [m/s], each axis."""
    P = belief.P.copy()
    P[np.arange(9), np.arange(9)] += np.repeat(np.square(sigmas), 3)
    return replace(belief, P=P)


def rolled(belief: Belief, roll_rad: float) -> Belief:
    """Return a belief whose drogue is rolled about its axis, the attitude's errors told apart from all others."""
    P = belief.P.copy()
    own = np.diag(np.full(3, np.diag(P)[:3].max()))
    P[:3], P[:, :3] = 0.0, 0.0
    P[:3, :3] = own
    return replace(belief, R_BD=belief.R_BD @ exp(np.array([roll_rad, 0.0, 0.0])), P=P)


def felt_first(belief: Belief, force_B: Array) -> Belief:
    """Return a belief that takes the receiver's first specific force (3,) for that of the formation [m/s^2]."""
    x = belief.x.copy()
    x[5] = -force_B
    return replace(belief, x=x)
