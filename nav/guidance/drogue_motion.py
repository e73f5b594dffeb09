"""Where the drogue will be in a moment: its swing (`swing_model`), estimated on the receiver's own scale (`own_path`).

With y_r the receiver's place by its commands and what it felt besides, y_D = p + y_r is the drogue's place on a scale
that drifts steadily with the bias of the receiver's inertial velocity: Eqs. (1) and (2) of `swing_model`. A Kalman
filter follows their state from p. Its covariance goes on while nothing is seen: a drogue of which there are glimpses
alone would otherwise be followed with the gains of one that is seen all the time, and the state run away. Its
prediction over the response time is what a command given now can still meet.
"""

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
    """Filter of the swing for three axes.

    Args:
        settings: the model.
        step_s: control period [s].
        lead_s: (3,) how far ahead `ahead` predicts: the receiver's response times [s].
        node_s: from one place of `path` to the next [s].
    """

    def __init__(self, settings: SwingSettings, step_s: float, lead_s: Array, node_s: float) -> None:
        self._lead_s = np.asarray(lead_s)
        self._felt_share = np.array([*(mode.felt_share for mode in settings.modes), settings.gust_felt_share])
        self._states = FIRST_MODE + 2 * len(settings.modes) + 1
        self._A = np.stack([dynamics(settings, axis) for axis in range(3)])
        self._F = np.stack([expm(A * step_s) for A in self._A])
        self._lead = np.stack([expm(A * lead) for A, lead in zip(self._A, self._lead_s, strict=True)])
        self._Q = np.stack([step_noise(settings, axis, step_s) for axis in range(3)])
        self._R = np.array(settings.position_sigma_m) ** 2 * (_FITTED_STEP_S / step_s)
        self._P_begun, self._P_resumed = (
            np.stack([any_moment(settings, axis, sigma) for axis in range(3)])
            for sigma in (settings.drift_sigma_m_s, settings.drift_kept_sigma_m_s)
        )
        self._P: Array = self._P_begun.copy()
        self._pushed = np.stack([held_push(A, step_s) for A in self._A])
        self._F_node = np.stack([expm(A * node_s) for A in self._A])
        self._pushed_node = np.stack([held_push(A, node_s) for A in self._A])
        self._node_s = node_s
        self._x: Array = np.zeros((3, self._states))
        self.unforeseen: Array = np.zeros((2, 3))
        """nu^2/S and ln S of the last place seen: nu off where it was foretold, S the variance of that."""

    def start(self, place_m: Array, velocity_m_s: Array) -> None:
        """Begin anew, at rest but for the swing; (3,) each."""
        self._x, self._P = np.zeros((3, self._states)), self._P_begun.copy()
        self._x[:, 0], self._x[:, FIRST_MODE + 1] = place_m, velocity_m_s

    def resume(self, place_m: Array) -> None:
        """Begin anew at a place (3,) where it comes into view again, whatever the swing; the drift stays as learnt."""
        self._x[:, 0], self._x[:, FIRST_MODE:], self._P = place_m, 0.0, self._P_resumed.copy()

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
        """(3,) velocity without the swing."""
        return self._x[:, 1].copy()

    @property
    def middle_m(self) -> Array:
        """(3,) m: the place without the swing."""
        return self._x[:, 0].copy()

    def swing_m_s2(self, omega_rad_s: Array) -> Array:
        """(3,) acceleration at the ends of the swing of now, omega hypot(omega s, s'), if no gust drove it on.

        Of the modes, the root of the sum of squares.

        Args:
            omega_rad_s: (modes, 3) of a hose on which it would swing so.
        """
        s, rate = self._x[:, FIRST_MODE:-1:2].T, self._x[:, FIRST_MODE + 1 : -1 : 2].T
        return np.asarray(np.linalg.norm(omega_rad_s * np.hypot(omega_rad_s * s, rate), axis=0))

    def ahead(self, push_m_s2: Array, push_then_m_s2: Array) -> Array:
        """(3, 3) place [m], velocity [m/s] and acceleration [m/s^2] after the lead time, a row each.

        Args:
            push_m_s2: (3,) b now; until then it changes steadily, and the swing does not answer to it yet.
            push_then_m_s2: (3,) b after the lead time.
        """
        out = np.empty((3, 3))
        _predict(self._x, self._lead, self._A, self._lead_s, push_m_s2, push_then_m_s2, out)
        return out

    def path(self, push_m_s2: Array) -> Array:
        """(n, 3) places [m] at the nodes after the lead time.

        Args:
            push_m_s2: (n + 2, 3) b now, after the lead time and at the nodes; in between it changes steadily.
        """
        out = np.empty((len(push_m_s2) - 2, 3))
        _go_on(self._x, self._lead, self._lead_s, self._F_node, self._pushed_node, push_m_s2, out)
        return out

    def mean_path(self, nodes: int) -> Array:
        """(nodes, 3) the same without the swing: drift alone."""
        m, d = self._x[:, 0], self._x[:, 1]
        times = self._lead_s + self._node_s * np.arange(1, nodes + 1)[:, np.newaxis]
        return np.asarray(m + times * d)

    def mean_ahead(self) -> Array:
        """(3, 3) the same three without the swing: drift alone."""
        m, d = self._x[:, 0], self._x[:, 1]
        return np.array([m + self._lead_s * d, d, np.zeros(3)])


@njit(cache=True)
def _at(x, first):  # type: ignore[no-untyped-def]
    """Place (first = 0) or rate (1) of a state (n,): m + s_1 + s_2 + ... or its derivative."""
    total = 0.0
    for j in range(first, len(x) - 1, 2):
        total += x[j]
    return total


@njit(cache=True)
def _foretell(x, share, blown, F, pushed, push):  # type: ignore[no-untyped-def]
    """A step of Eqs. (1) and (2) in place: x (3, n), share (modes and g, 3), F (3, n, n), pushed (3, n)."""
    n, modes = x.shape[1], len(share) - 1
    later = np.empty(n)
    for axis in range(3):
        for mode in range(modes):
            x[axis, FIRST_MODE + 1 + 2 * mode] += share[mode, axis] * blown[axis]
        x[axis, n - 1] += share[modes, axis] * blown[axis]
        for i in range(n):
            later[i] = pushed[axis, i] * push[axis]
            for j in range(n):
                later[i] += F[axis, i, j] * x[axis, j]
        x[axis] = later


@njit(cache=True)
def _correct(x, P, R, place, unforeseen):  # type: ignore[no-untyped-def]
    """Correct the state (3, n) and its covariance P (3, n, n) in place by what is seen, with variances R (3,)."""
    n = x.shape[1]
    PH = np.empty(n)
    for axis in range(3):
        for i in range(n):
            PH[i] = _at(P[axis, i], 0)
        off, variance = place[axis] - _at(x[axis], 0), _at(PH, 0) + R[axis]
        unforeseen[0, axis], unforeseen[1, axis] = off * off / variance, np.log(variance)
        for i in range(n):
            x[axis, i] += PH[i] / variance * off
            for j in range(i + 1):
                P[axis, i, j] -= PH[i] * PH[j] / variance
                P[axis, j, i] = P[axis, i, j]


@njit(cache=True)
def _spread(P, F, Q):  # type: ignore[no-untyped-def]
    """P <- F P F' + Q of each axis in place, (3, n, n)."""
    n = P.shape[1]
    FP = np.empty((n, n))
    for axis in range(3):
        for i in range(n):
            for j in range(n):
                FP[i, j] = 0.0
                for k in range(n):
                    FP[i, j] += F[axis, i, k] * P[axis, k, j]
        for i in range(n):
            for j in range(i + 1):
                total = Q[axis, i, j]
                for k in range(n):
                    total += FP[i, k] * F[axis, j, k]
                P[axis, i, j] = P[axis, j, i] = total


@njit(cache=True)
def _predict(x, lead, A, lead_s, push, push_then, out):  # type: ignore[no-untyped-def]
    """Write place, velocity and acceleration (rows of out) of each axis after its lead time."""
    n = x.shape[1]
    later = np.empty(n)
    for axis in range(3):
        for i in range(n):
            later[i] = 0.0
            for j in range(n):
                later[i] += lead[axis, i, j] * x[axis, j]
        tau, now, then = lead_s[axis], push[axis], push_then[axis]
        out[0, axis] = _at(later, 0) + tau * tau * (now / 3.0 + then / 6.0)
        out[1, axis] = _at(later, 1) + 0.5 * tau * (now + then)
        out[2, axis] = then
        for i in range(1, n - 1, 2):
            for j in range(n):
                out[2, axis] += A[axis, i, j] * later[j]


@njit(cache=True)
def _go_on(x, lead, lead_s, F, pushed, push, out):  # type: ignore[no-untyped-def]
    """Write the places at the nodes (n, 3)."""
    n = x.shape[1]
    state, later = np.empty(n), np.empty(n)
    for axis in range(3):
        for i in range(n):
            state[i] = 0.0
            for j in range(n):
                state[i] += lead[axis, i, j] * x[axis, j]
        tau, now, then = lead_s[axis], push[0, axis], push[1, axis]
        state[FIRST_MODE] += tau * tau * (now / 3.0 + then / 6.0)
        state[FIRST_MODE + 1] += 0.5 * tau * (now + then)
        for k in range(len(out)):
            b = 0.5 * (push[k + 1, axis] + push[k + 2, axis])
            for i in range(n):
                later[i] = pushed[axis, i] * b
                for j in range(n):
                    later[i] += F[axis, i, j] * state[j]
            state[:] = later
            out[k, axis] = _at(state, 0)
