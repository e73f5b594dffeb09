"""What is believed about the drogue relative to the receiver: a Gaussian, or two while the image allows two attitudes.

State and errors, and how they move, are in `belief_motion`; what a frame shows of them, in `belief_sight`. The camera's
errors do not change during a flight, no averaging lessens them, and frames cannot tell them from place and attitude:
they are considered [Schmidt 1966], that is carried in the covariance with all their correlations and left at zero. The
LEDs' places are told from tilt by how the ring's image changes as receiver and drogue turn. Of what a frame says of
them a share s is taken [Brink 2017]: far away tilt enters by its square, and the whole would be believed too soon. That
the whole ring is larger is considered like the camera's errors: only range tells it, and waiting for minutes astern a
belief that was to learn it took the ring for 1.4 % smaller after 80 s, and went on.

`belief_frame` fits the pose as seen and the LEDs' places to a frame. The rest follows from the same linearisation, in
Joseph's form:

    e = K nu,   P+ = (I - K H) P (I - K H)' + K K',   K = P H' S^-1, times 0 for the camera, s for LEDs     (1)

Loosely coupled, the frame's own pose and covariance are averaged with the belief.

Two floors far apart stay apart, each with its weight, until one dies: one Gaussian drawn over both would forget at
every frame what the frames before had said about which. Two close together become one, with the mixture's moments.
What the LEDs' places say for the wrong one they say in every frame, so that frames are no independent witnesses: of a
frame's log evidence a share counts, and what was said before fades,

    log weight <- memory (log weight) + share (log evidence)                                          (2)
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from dockair.kernels import njit
from dockair.nav.belief_frame import Explanation, explanations
from dockair.nav.belief_motion import (
    CALIBRATION,
    ERRORS,
    GUST,
    HARDWARE,
    PHI,
    PLACE,
    REST,
    RING,
    SWING,
    SWING_RATE,
    VELOCITY,
    V,
)
from dockair.nav.belief_sight import Apparent, Belief, Sight
from dockair.nav.pose.difference import pose_difference
from dockair.nav.pose.estimate import PoseEstimate
from dockair.nav.pose.measurement import LinesOfSight
from dockair.nav.pose.posterior import PosePosterior, posteriors
from dockair.rotations import Array, exp

_MERGE_CHI2 = 9.0  # squared distance in sigmas below which two are told as one: 3 sigma
_LOG_NEGLIGIBLE = -14.0  # logarithm of the relative weight, about 1e-6, at which a hypothesis dies
_MOST = 2  # hypotheses: a flat ring has no more
_POSE_ERRORS = np.arange(6)


def _blow() -> Array:
    """(50, 9) errors by a turn, a shift and a change of velocity (3,) each of the drogue alone."""
    G, one = np.zeros((ERRORS, 9)), np.eye(3)
    swings = np.diag([0.0, 1.0, 1.0])  # along the hose there is no swing
    G[PHI, :3], G[REST, :3] = one, -one
    G[PLACE, 3:6], G[SWING, 3:6] = one, swings
    G[VELOCITY, 6:], G[SWING_RATE, 6:] = one, swings
    return G


_BLOW = _blow()


@dataclass(frozen=True, slots=True, kw_only=True)
class Taking:
    """How a frame is taken."""

    tight: bool = True  #: whether a pose's lines of sight are fitted together with the belief
    memory: float = 1.0  #: of Eq. (2), per frame
    share: float = 1.0
    ring: float = 0.0  #: s of Eq. (1)


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
        gates: largest chi2 taken for each number of degrees of freedom from 0 to 16.
        taking: how.
    """
    lines = frame if isinstance(frame, LinesOfSight) else frame.measurement
    tight = lines is not None and (taking.tight or isinstance(frame, LinesOfSight))
    freedom = 2 * len(lines.rays) if lines is not None and tight else 6
    found, least = [], np.inf
    for belief in beliefs:
        if lines is not None and tight:
            new = _fitted(belief, lines, [] if isinstance(frame, LinesOfSight) else _poses(frame), sight, taking)
        else:
            assert isinstance(frame, PoseEstimate)
            new = _averaged(belief, frame, sight, taking)
        least = min([least, *(chi2 for _, chi2 in new)])
        found += [(after, chi2) for after, chi2 in new if chi2 <= gates[freedom]]
    kept = _kept([belief for belief, _ in found])
    if not kept:
        return Correction(beliefs=[], chi2=least, degrees_of_freedom=freedom)
    chi2 = max(found, key=lambda pair: pair[0].log_weight)[1]
    return Correction(beliefs=kept, chi2=chi2, degrees_of_freedom=freedom)


def _poses(frame: PoseEstimate) -> list[tuple[Array, Array]]:
    solutions = [frame] if frame.alternative is None else [frame, frame.alternative]
    return [(one.R_CD, one.p_CD) for one in solutions]


def _fitted(
    belief: Belief, lines: LinesOfSight, poses: list[tuple[Array, Array]], sight: Sight, taking: Taking
) -> list[tuple[Belief, float]]:
    """Return the beliefs after a frame, and their chi2, lines of sight and belief fitted together."""
    seen, M = sight.shown(belief, lines)
    ring = taking.ring * sight.but_size  # only range tells a larger ring
    return [
        (_updated(belief, after.H @ M, after, ring, _weight(belief, after, taking)), after.chi2)
        for after in explanations(seen, lines, poses)
    ]


def _averaged(belief: Belief, frame: PoseEstimate, sight: Sight, taking: Taking) -> list[tuple[Belief, float]]:
    """Return the beliefs after a frame's own pose was averaged with the belief, and their chi2."""
    seen = sight.apparent(belief, solved=True)
    return [
        (_regressed(belief, seen, after, _weight(belief, after, taking)), after.gate_chi2)
        for after in posteriors(seen.prior, replace(frame, measurement=None))
    ]


def _weight(belief: Belief, after: Explanation | PosePosterior, taking: Taking) -> float:
    return taking.memory * belief.log_weight + taking.share * after.log_evidence


def _updated(belief: Belief, H: Array, after: Explanation, ring: Array, log_weight: float) -> Belief:
    """Return a belief after a frame, Eq. (1); H is per error of the belief, ring (16, 16) what is taken of its gain."""
    e, P = _gained(belief.P, H, after.nu, ring, CALIBRATION.start, RING.start)
    return _moved(belief, e, P, log_weight)


@njit(cache=True, error_model="numpy")
def _gained(P: Array, H: Array, nu: Array, ring: Array, calibration: int, places: int) -> tuple[Array, Array]:
    """(50,) e and (50, 50) P+ of Eq. (1), NaN where P or H are not finite.

    Where the errors of calibration and of the LEDs' places begin comes along.
    """
    HP = np.dot(H, P)
    S = np.dot(HP, H.T) + np.eye(len(H))
    if not (np.isfinite(S).all() and np.isfinite(HP).all()):  # numba's solver would raise
        return np.full(len(P), np.nan), np.full_like(P, np.nan)
    K = np.ascontiguousarray(np.linalg.solve(S, HP)).T
    K[calibration:places] = 0.0
    K[places:] = np.dot(ring, np.ascontiguousarray(K[places:]))
    A = np.eye(len(P)) - np.dot(K, H)
    return np.dot(K, nu), np.dot(np.dot(A, P), A.T) + np.dot(K, K.T)


def _regressed(belief: Belief, seen: Apparent, after: PosePosterior, log_weight: float) -> Belief:
    """Return a belief after a pose: e = K (a+ - a), K = P M' (M P M')^-1, and P+ with the pose's covariance."""
    P, M = belief.P, seen.M
    K = np.linalg.solve(seen.covariance, M @ P).T
    e = K @ pose_difference(after.R_CD, after.p_CD, seen.R_CD, seen.p_CD)
    A = np.eye(ERRORS) - K @ M
    P_after = A @ P @ A.T + K @ after.covariance @ K.T
    P_after[HARDWARE, HARDWARE] = P[HARDWARE, HARDWARE]
    e[HARDWARE] = 0.0
    return _moved(belief, e, P_after, log_weight)


def _moved(belief: Belief, e: Array, P: Array, log_weight: float) -> Belief:
    x = belief.x + e[3 : HARDWARE.start].reshape(belief.x.shape)
    return Belief(exp(e[:3]) @ belief.R_BD, x, 0.5 * (P + P.T), log_weight, belief.ring + e[RING])


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
    """(50,) errors by which a belief is off from another."""
    pose = pose_difference(belief.R_BD, belief.p_ID, other.R_BD, other.p_ID)
    calibration = np.zeros(CALIBRATION.stop - CALIBRATION.start)
    return np.concatenate([pose, (belief.x[V:] - other.x[V:]).ravel(), calibration, belief.ring - other.ring])


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


def widened(belief: Belief, sigmas: tuple[float, float, float], led_place_sigma_m: float) -> Belief:
    """Return a belief with less certainty of attitude [rad], place [m], velocity [m/s], each axis, and of the LEDs.

    What moves the drogue moves it away from its place of rest, too, and turns it from its attitude of rest, which stay:
    ds = dn, dv = dm but along the hose, phi = -du.
    """
    P = belief.P + (_BLOW * np.repeat(np.square(sigmas), 3)) @ _BLOW.T
    P[range(RING.start, RING.stop), range(RING.start, RING.stop)] += led_place_sigma_m**2
    return replace(belief, P=P)


def rolled(belief: Belief, roll_rad: float, led_place_variance_m2: float) -> Belief:
    """Return a belief whose drogue is rolled about its axis.

    The errors of its attitude and of its way to rest are told apart from all others, and what is known of the LEDs'
    places is forgotten: it was of other LEDs.
    """
    P = belief.P.copy()
    attitude = np.r_[:3, REST]
    own = P[np.ix_(attitude, attitude)]
    own[range(3), range(3)] += own[:3, :3].diagonal().max()
    P[attitude], P[:, attitude], P[RING], P[:, RING] = 0.0, 0.0, 0.0, 0.0
    P[np.ix_(attitude, attitude)] = own
    P[range(RING.start, RING.stop), range(RING.start, RING.stop)] = led_place_variance_m2
    R_BD = belief.R_BD @ exp(np.array([roll_rad, 0.0, 0.0]))
    return replace(belief, R_BD=R_BD, P=P, ring=np.zeros_like(belief.ring))


def begun_again(belief: Belief, start: Belief, p_ID: Array, turn_sigma_rad: float) -> Belief:
    """Return what is believed of a drogue that was lost and is seen at a place (3,) again.

    Where it is and how it moves is the start's. Everything else stays, with what is known of it: the gyro has carried
    the attitude on, but for what the drogue has turned meanwhile.

    Args:
        belief: that was lost.
        start: that of the first message.
        p_ID: where the drogue is seen.
        turn_sigma_rad: what the drogue may have turned by on each axis.
    """
    moving = np.r_[PLACE, VELOCITY, SWING, SWING_RATE, GUST]
    P = belief.P.copy()
    P[moving], P[:, moving] = 0.0, 0.0
    P[np.ix_(moving, moving)] = start.P[np.ix_(moving, moving)]
    P += turn_sigma_rad**2 * _BLOW[:, :3] @ _BLOW[:, :3].T
    x = belief.x.copy()
    x[:4], x[7] = start.x[:4], start.x[7]
    x[0] = p_ID
    return replace(belief, x=x, P=P)


def felt_first(belief: Belief, force_B: Array) -> Belief:
    """Return a belief that takes the receiver's first specific force (3,) for that of the formation [m/s^2]."""
    x = belief.x.copy()
    x[5] = -force_B
    return replace(belief, x=x)
