"""Where the drogue will be in a moment: its swing (`swing_model`), estimated on the receiver's own scale (`own_path`).

With y_r the receiver's place by its commands and what it felt besides, y_D = p + y_r is the drogue's place on a scale
that drifts steadily with the bias of the receiver's inertial velocity: Eqs. (1) and (2) of `swing_model`. A Kalman
filter follows their state from p. Its covariance goes on while nothing is seen: a drogue of which there are glimpses
alone would otherwise be followed with the gains of one that is seen all the time, and the state run away. Its
prediction over the response time is what a command given now can still meet.
"""

from collections.abc import Callable, Sequence

import numpy as np
from scipy.linalg import expm

from dockair.kernels import njit
from dockair.nav.guidance.swing_model import (
    FIRST_MODE,
    SwingSettings,
    any_moment,
    dynamics,
    held_push,
    step_noise,
)
from dockair.rotations import Array

_FITTED_STEP_S = 0.01  # of the settings' variances


class DrogueMotion:
    """Filters of the swing for three axes, one for each of some hoses, side by side.

    Args:
        hoses: the models.
        step_s: control period [s].
        lead_s: (3,) how far ahead `ahead` predicts: the receiver's response times [s].
        node_s: from one place of `path` to the next [s].
    """

    def __init__(self, hoses: Sequence[SwingSettings], step_s: float, lead_s: Array, node_s: float) -> None:
        self._lead_s, self._node_s, first = np.asarray(lead_s), node_s, hoses[0]
        self._states = FIRST_MODE + 2 * len(first.modes) + 1
        self._felt_share = np.stack([_felt_share(hose) for hose in hoses])
        self._A = _of_each(hoses, dynamics)
        self._F = _through(self._A, np.full(3, step_s))
        self._lead = _through(self._A, self._lead_s)
        self._Q = _of_each(hoses, lambda hose, axis: step_noise(hose, axis, step_s))
        self._R = np.array([hose.position_sigma_m for hose in hoses]) ** 2 * (_FITTED_STEP_S / step_s)
        self._P_begun = _of_each(hoses, lambda hose, axis: any_moment(hose, axis, hose.drift_sigma_m_s))
        self._P_resumed = _of_each(hoses, lambda hose, axis: any_moment(hose, axis, hose.drift_kept_sigma_m_s))
        self._P: Array = self._P_begun.copy()
        self._pushed = np.stack([[held_push(A, step_s) for A in of_hose] for of_hose in self._A])
        self._F_node = _through(self._A, np.full(3, node_s))
        self._pushed_node = np.stack([[held_push(A, node_s) for A in of_hose] for of_hose in self._A])
        self._x: Array = np.zeros((len(hoses), 3, self._states))
        self.unforeseen: Array = np.zeros((len(hoses), 2, 3))
        """nu^2/S and ln S of the last place seen: nu off where it was foretold, S the variance of that."""

    def start(self, place_m: Array, velocity_m_s: Array) -> None:
        """Begin anew, at rest but for the swing; (3,) each."""
        self._x, self._P = np.zeros_like(self._x), self._P_begun.copy()
        self._x[..., 0], self._x[..., FIRST_MODE + 1] = place_m, velocity_m_s

    def resume(self, place_m: Array) -> None:
        """Begin anew at a place (3,) where it comes into view again, whatever the swing; the drift stays as learnt."""
        self._x[..., 0], self._x[..., FIRST_MODE:], self._P = place_m, 0.0, self._P_resumed.copy()

    def step(self, place_m: Array | None, push_m_s2: Array, blown_m_s: Array) -> None:
        """Advance by one control period.

        Args:
            place_m: (3,) on the receiver's scale, None if not seen.
            push_m_s2: (3,) b.
            blown_m_s: (3,) dw over the period.
        """
        _foretell(self._x, self._felt_share, blown_m_s, self._F, self._pushed, push_m_s2)
        if place_m is not None:
            _correct(self._x, self._P, self._R, place_m, self.unforeseen)
        _spread(self._P, self._F, self._Q)

    @property
    def drift_m_s(self) -> Array:
        """(hoses, 3) velocity without the swing."""
        return self._x[..., 1].copy()

    @property
    def middle_m(self) -> Array:
        """(hoses, 3) m: the place without the swing."""
        return self._x[..., 0].copy()

    def swing_m_s2(self, omega_rad_s: Array) -> Array:
        """(hoses, 3) acceleration at the ends of the swing of now, omega hypot(omega s, s'), if no gust drove it on.

        Of the modes, the root of the sum of squares.

        Args:
            omega_rad_s: (modes, 3) of a hose on which it would swing so.
        """
        s, rate = (np.swapaxes(self._x[..., first:-1:2], 1, 2) for first in (FIRST_MODE, FIRST_MODE + 1))
        return np.asarray(np.sqrt(((omega_rad_s * np.hypot(omega_rad_s * s, rate)) ** 2).sum(axis=1)))

    def ahead(self, push_m_s2: Array, push_then_m_s2: Array) -> Array:
        """(hoses, 3, 3) place [m], velocity [m/s] and acceleration [m/s^2] after the lead time, a row each.

        Args:
            push_m_s2: (3,) b now; until then it changes steadily, and the swing does not answer to it yet.
            push_then_m_s2: (3,) b after the lead time.
        """
        out = np.empty((len(self._x), 3, 3))
        _predict(self._x, self._lead, self._A, self._lead_s, push_m_s2, push_then_m_s2, out)
        return out

    def path(self, push_m_s2: Array) -> Array:
        """(hoses, n, 3) places [m] at the nodes after the lead time.

        Args:
            push_m_s2: (n + 2, 3) b now, after the lead time and at the nodes; in between it changes steadily.
        """
        out = np.empty((len(self._x), len(push_m_s2) - 2, 3))
        _go_on(self._x, self._lead, self._lead_s, self._F_node, self._pushed_node, push_m_s2, out)
        return out

    def mean_path(self, nodes: int) -> Array:
        """(hoses, nodes, 3) the same without the swing: drift alone."""
        m, d = self._x[:, np.newaxis, :, 0], self._x[:, np.newaxis, :, 1]
        times = self._lead_s + self._node_s * np.arange(1, nodes + 1)[:, np.newaxis]
        return np.asarray(m + times * d)

    def mean_ahead(self) -> Array:
        """(hoses, 3, 3) the same three without the swing: drift alone."""
        m, d = self._x[..., 0], self._x[..., 1]
        return np.stack([m + self._lead_s * d, d, np.zeros_like(d)], axis=1)


def _felt_share(hose: SwingSettings) -> Array:
    return np.array([*(mode.felt_share for mode in hose.modes), hose.gust_felt_share])


def _of_each(hoses: Sequence[SwingSettings], make: Callable[[SwingSettings, int], Array]) -> Array:
    """(hoses, 3, ...) of each hose and axis."""
    return np.stack([[make(hose, axis) for axis in range(3)] for hose in hoses])


def _through(A: Array, times_s: Array) -> Array:
    """(hoses, 3, n, n) what a state becomes after a time, (3,) by axis."""
    return np.stack([[expm(A_axis * time) for A_axis, time in zip(of_hose, times_s, strict=True)] for of_hose in A])


@njit(cache=True)
def _at(x, first):  # type: ignore[no-untyped-def]
    """Place (first = 0) or rate (1) of a state (n,): m + s_1 + s_2 + ... or its derivative."""
    total = 0.0
    for j in range(first, len(x) - 1, 2):
        total += x[j]
    return total


@njit(cache=True)
def _foretell(x, share, blown, F, pushed, push):  # type: ignore[no-untyped-def]
    """A step of Eqs. (1) and (2) in place: x (hoses, 3, n), share of modes and g, F (..., n, n), pushed (..., n)."""
    hoses, _, n = x.shape
    modes, later = share.shape[1] - 1, np.empty(n)
    for hose in range(hoses):
        for axis in range(3):
            state = x[hose, axis]
            for mode in range(modes):
                state[FIRST_MODE + 1 + 2 * mode] += share[hose, mode, axis] * blown[axis]
            state[n - 1] += share[hose, modes, axis] * blown[axis]
            for i in range(n):
                later[i] = pushed[hose, axis, i] * push[axis]
                for j in range(n):
                    later[i] += F[hose, axis, i, j] * state[j]
            state[:] = later


@njit(cache=True)
def _correct(x, P, R, place, unforeseen):  # type: ignore[no-untyped-def]
    """Correct states (hoses, 3, n), covariances (..., n, n) in place by what is seen, with variances R (hoses, 3)."""
    hoses, _, n = x.shape
    PH = np.empty(n)
    for hose in range(hoses):
        for axis in range(3):
            state, own = x[hose, axis], P[hose, axis]
            for i in range(n):
                PH[i] = _at(own[i], 0)
            off, variance = place[axis] - _at(state, 0), _at(PH, 0) + R[hose, axis]
            unforeseen[hose, 0, axis], unforeseen[hose, 1, axis] = off * off / variance, np.log(variance)
            for i in range(n):
                state[i] += PH[i] / variance * off
                for j in range(i + 1):
                    own[i, j] -= PH[i] * PH[j] / variance
                    own[j, i] = own[i, j]


@njit(cache=True)
def _spread(P, F, Q):  # type: ignore[no-untyped-def]
    """P <- F P F' + Q of each hose and axis in place, (hoses, 3, n, n)."""
    hoses, _, n, _ = P.shape
    FP = np.empty((n, n))
    for hose in range(hoses):
        for axis in range(3):
            own, step = P[hose, axis], F[hose, axis]
            for i in range(n):
                for j in range(n):
                    FP[i, j] = 0.0
                    for k in range(n):
                        FP[i, j] += step[i, k] * own[k, j]
            for i in range(n):
                for j in range(i + 1):
                    total = Q[hose, axis, i, j]
                    for k in range(n):
                        total += FP[i, k] * step[j, k]
                    own[i, j] = own[j, i] = total


@njit(cache=True)
def _carry(A, x, out):  # type: ignore[no-untyped-def]
    """Write A x of (n, n) and (n,)."""
    for i in range(len(x)):
        out[i] = 0.0
        for j in range(len(x)):
            out[i] += A[i, j] * x[j]


@njit(cache=True)
def _predict(x, lead, A, lead_s, push, push_then, out):  # type: ignore[no-untyped-def]
    """Write place, velocity and acceleration (rows of each hose's out) of each axis after its lead time."""
    hoses, _, n = x.shape
    later = np.empty(n)
    for hose in range(hoses):
        for axis in range(3):
            _carry(lead[hose, axis], x[hose, axis], later)
            tau, now, then = lead_s[axis], push[axis], push_then[axis]
            out[hose, 0, axis] = _at(later, 0) + tau * tau * (now / 3.0 + then / 6.0)
            out[hose, 1, axis] = _at(later, 1) + 0.5 * tau * (now + then)
            out[hose, 2, axis] = then
            for i in range(1, n - 1, 2):
                for j in range(n):
                    out[hose, 2, axis] += A[hose, axis, i, j] * later[j]


@njit(cache=True)
def _go_on(x, lead, lead_s, F, pushed, push, out):  # type: ignore[no-untyped-def]
    """Write the places at the nodes (hoses, nodes, 3)."""
    hoses, _, n = x.shape
    state, later = np.empty(n), np.empty(n)
    for hose in range(hoses):
        for axis in range(3):
            _carry(lead[hose, axis], x[hose, axis], state)
            tau, now, then = lead_s[axis], push[0, axis], push[1, axis]
            state[FIRST_MODE] += tau * tau * (now / 3.0 + then / 6.0)
            state[FIRST_MODE + 1] += 0.5 * tau * (now + then)
            for k in range(out.shape[1]):
                b = 0.5 * (push[k + 1, axis] + push[k + 2, axis])
                for i in range(n):
                    later[i] = pushed[hose, axis, i] * b
                    for j in range(n):
                        later[i] += F[hose, axis, i, j] * state[j]
                state[:] = later
                out[hose, k, axis] = _at(state, 0)
