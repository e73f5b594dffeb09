"""What is believed about the drogue relative to the receiver: a Gaussian, or two while the image allows two attitudes.

Held in body axes B, from the centre of gravity:

    R = R_BD,    s = p_BD_B,    v = v_BD_B  (velocity of the ring centre less that of the centre of gravity, as seen
                                             from axes that do not turn, written in body axes)

with nine errors (phi, ds, dv), R_true = exp(phi) R. With w = w_WB_B from the gyro and E = exp(-[w x] dt):

    R <- E R,    s <- E (s + v dt),    v <- E v                                                       (1)
    errors <- F errors,    F = [E 0 0; 0 E E dt; 0 0 E]                                               (2)

Eq. (1) is exact for constant w. What is random: the drogue's acceleration relative to the receiver (white), its turning
(random walk), and the gyro: its noise n enters the errors as G n dt, G = [I; -[s x]; -[v x]].

v belongs to the centre of gravity, not to the probe's tip, because the tip's velocity jumps with every pitching of the
receiver, which the gyro knows and a random acceleration would have to guess.

`pose.posterior` forms the poses (a+, P_aa+) that explain a frame and this belief together; the velocity follows by
regression on the pose, K = P_va P_aa^-1:

    v+ = v + K (a+ - a),   P_va+ = K P_aa+,   P_vv+ = P_vv - K (P_aa - P_aa+) K'                      (3)

Two of them far apart stay apart, each with its weight, until one dies: one Gaussian drawn over both would forget at
every frame what the frames before had said about which. Two close together become one, with the mixture's moments.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numba import njit

from dockair.calibration import Mounting
from dockair.nav.pose.descent import PosePrior
from dockair.nav.pose.difference import pose_difference
from dockair.nav.pose.estimate import PoseEstimate
from dockair.nav.pose.posterior import posteriors
from dockair.rotations import Array, exp

_MERGE_CHI2 = 9.0  # squared distance in sigmas below which two are told as one: 3 sigma
_LOG_NEGLIGIBLE = -14.0  # logarithm of the relative weight, about 1e-6, at which a hypothesis dies
_MOST = 2  # hypotheses: a flat ring has no more


@dataclass(frozen=True, slots=True, eq=False)
class Belief:
    """One Gaussian."""

    R_BD: Array  #: (3, 3)
    p_BD: Array  #: (3,) s [m]
    v_BD: Array  #: (3,) [m/s]
    P: Array  #: (9, 9) of (phi, ds, dv)
    log_weight: float = 0.0


@dataclass(frozen=True, slots=True, kw_only=True)
class MotionNoise:
    """Squared densities of what is random."""

    attitude2: float  #: drogue's turning [rad^2/s]
    acceleration2: float  #: relative acceleration [m^2/s^3]
    gyro2: float  #: [rad^2/s]


def moved(belief: Belief, w_B: Array, dt: float, noise: MotionNoise) -> Belief:
    """Return the belief after dt [s] of turning at w_B (3,) [rad/s], Eqs (1) and (2)."""
    if dt <= 0.0:
        return belief
    densities2 = (noise.attitude2, noise.acceleration2, noise.gyro2)
    state = _propagated(belief.R_BD, belief.p_BD, belief.v_BD, belief.P, w_B, dt, densities2)
    return Belief(*state, log_weight=belief.log_weight)


def pose_prior(belief: Belief, mounting: Mounting) -> PosePrior:
    """Return the belief's pose in camera axes."""
    T = np.kron(np.eye(2), mounting.R_BC.T)
    return PosePrior(
        R_CD=mounting.R_BC.T @ belief.R_BD,
        p_CD=mounting.R_BC.T @ (belief.p_BD - mounting.p_BC),
        covariance=T @ belief.P[:6, :6] @ T.T,
    )


def corrected(beliefs: Sequence[Belief], pose: PoseEstimate, mounting: Mounting, gate: float) -> list[Belief]:
    """Return what is believed with a frame's pose taken, most likely first; empty if the gate refuses the frame."""
    found = []
    for belief in beliefs:
        prior = pose_prior(belief, mounting)
        T = np.kron(np.eye(2), mounting.R_BC)
        for after in posteriors(prior, pose):
            if after.gate_chi2 > gate:
                continue
            step = T @ pose_difference(after.R_CD, after.p_CD, prior.R_CD, prior.p_CD)
            P, P_aa = belief.P, T @ after.covariance @ T.T
            K = np.linalg.solve(P[:6, :6], P[:6, 6:]).T  # Eq. (3)
            P_va = K @ P_aa
            P_vv = P[6:, 6:] - K @ (P[:6, :6] - P_aa) @ K.T
            found.append(
                Belief(
                    mounting.R_BC @ after.R_CD,
                    mounting.p_BC + mounting.R_BC @ after.p_CD,
                    belief.v_BD + K @ step,
                    np.block([[P_aa, P_va.T], [P_va, 0.5 * (P_vv + P_vv.T)]]),
                    belief.log_weight + after.log_evidence,
                )
            )
    return _kept(found)


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
    return Belief(exp(mean[:3]) @ first.R_BD, first.p_BD + mean[3:6], first.v_BD + mean[6:], np.asarray(P), total)


def _difference(belief: Belief, other: Belief) -> Array:
    difference = pose_difference(belief.R_BD, belief.p_BD, other.R_BD, other.p_BD)
    return np.concatenate([difference, belief.v_BD - other.v_BD])


def _kept(found: list[Belief]) -> list[Belief]:
    """Merge the close, drop the negligible and the surplus, weigh the most likely 1."""
    kept: list[Belief] = []
    for belief in sorted(found, key=lambda b: -b.log_weight):
        for i, other in enumerate(kept):
            d = _difference(belief, other)[:6]
            if d @ np.linalg.solve(other.P[:6, :6], d) < _MERGE_CHI2:
                kept[i] = mixture([other, belief])
                break
        else:
            if len(kept) < _MOST and (not kept or belief.log_weight - kept[0].log_weight > _LOG_NEGLIGIBLE):
                kept.append(belief)
    kept.sort(key=lambda b: -b.log_weight)
    return [replace(b, log_weight=b.log_weight - kept[0].log_weight) for b in kept]


@njit(cache=True)
def _propagated(
    R: Array, s: Array, v: Array, P: Array, w: Array, dt: float, densities2: tuple[float, float, float]
) -> tuple[Array, Array, Array, Array]:
    """R, s, v, P after dt, Eqs (1) and (2); densities2 of the drogue's attitude and acceleration and of the gyro."""
    attitude2, acceleration2, gyro2 = densities2
    angle = np.sqrt(w[0] ** 2 + w[1] ** 2 + w[2] ** 2) * dt
    a = 1.0 - angle**2 / 6.0 if angle < 1e-4 else np.sin(angle) / angle
    b = 0.5 - angle**2 / 24.0 if angle < 1e-4 else (1.0 - np.cos(angle)) / angle**2
    x, y, z = -w[0] * dt, -w[1] * dt, -w[2] * dt
    K = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    E = np.eye(3) + a * K + b * np.dot(K, K)
    moved = s + v * dt
    s_new, v_new = np.dot(E, moved), np.dot(E, v)
    F, G, Q = np.zeros((9, 9)), np.zeros((9, 3)), np.zeros((9, 9))
    F[:3, :3], F[3:6, 3:6], F[3:6, 6:], F[6:, 6:] = E, E, E * dt, E
    G[:3] = np.eye(3)
    for i in range(2):
        u = s_new if i == 0 else v_new
        r = 3 + 3 * i
        G[r, 1], G[r, 2], G[r + 1, 2] = u[2], -u[1], u[0]
        G[r + 1, 0], G[r + 2, 0], G[r + 2, 1] = -u[2], u[1], -u[0]
    for i in range(3):
        Q[i, i] = attitude2 * dt
        Q[3 + i, 3 + i], Q[6 + i, 6 + i] = acceleration2 * dt**3 / 3.0, acceleration2 * dt
        Q[3 + i, 6 + i] = Q[6 + i, 3 + i] = acceleration2 * dt**2 / 2.0
    P_new = np.dot(np.dot(F, P), F.T) + Q + gyro2 * dt * np.dot(G, G.T)
    return np.dot(E, R), s_new, v_new, 0.5 * (P_new + P_new.T)
