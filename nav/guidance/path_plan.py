"""Plans how the tip goes across to where the drogue will be, inside the limits of acceleration and jerk: one axis.

Model predictive control. The tip's place, rate and acceleration x = (y, y', y'') as commanded begin where they are, and
N jerks, each held for h, bring them on. With y_D the drogue's predicted places at the nodes, j_max and a_max the
limits, and z = j / j_max,

    minimise  sum_k w_k (y_k - y_D,k)^2 + r sum_k z_k^2     with |z_k| <= 1, |y''_k| <= a_max             (1)

is a convex quadratic programme, in which on the way to contact a share of both limits is kept back from later nodes,
the more the later up to a time; the first jerk is flown, and the next tick plans anew. Following the drogue, w = 1;
on the way to a contact that is t_r away only the miss about that moment counts, but for a little on the way, and the
moment is when the tip is half-way from the ring to the coupling, lest it sweeps across the basket:

    w_k = w_0 + W exp(-(t_k - t_c)^2 / 2 s^2),    w_k = w_0 from t_c + 2 s on,    t_c = t_r + half_way     (2)

(1) is solved by a set number of steps of the alternating direction method of multipliers, beginning at the last tick's
solution: with C z in [lo, hi] for both limits, and f the gradient at z = 0,

    z <- (H + q C'C)^-1 (C'(q v - p) - f),   v <- clip(C z + p / q),   p <- p + q (C z - v)               (3)

Not modelled: that the prediction is worth less the farther it looks, but by where w is; limits met by rounding only:
whoever flies the plan clips what it asks for.
Source: [Stellato 2020, OSQP: an operator splitting solver for quadratic programs, Math. Prog. Comp. 12(4)], Eq. (3).
"""

from dataclasses import dataclass

import numpy as np

from dockair.errors import check_numbers
from dockair.kernels import njit
from dockair.rotations import Array

_UNTIL = 2.0  # widths after t_c: the way to the coupling is flown by then


@dataclass(frozen=True, slots=True, kw_only=True)
class PlanSettings:
    """Constants of Eqs. (1) to (3)."""

    nodes: int = 16  # N
    node_s: float = 0.1  # h: with N, half a period of the drogue; longer is not predicted to any use
    jerk_price_m2: float = 0.01  # r
    #: r / j_max^2 where a swing is only waited for, whatever j_max: a metre is gone in 4 s, with 0.6 m/s^2.
    calm_price_s6: float = 0.07
    at_contact: float = 8.0  # W
    half_way_s: float = 0.1  # from the ring to the coupling
    contact_s: float = 0.12  # s: the way from the ring to the coupling takes 0.2 s
    on_the_way: float = 0.03  # w_0: 1 m on the way counts like 0.06 m at contact
    #: Of both limits, from `kept_back_s` on, on the way to contact: what is planned with all of them leaves nothing for
    #: what was not foreseen, and the first jerks may still use all.
    kept_back: float = 0.5
    kept_back_s: float = 0.5  # a gust unforeseen is met by jerks within this time, or not at all
    iterations: int = 40  # of Eq. (3): the jerk is then 2 % of its limit off the exact one, on average
    error_max_m: float = 0.75  # a drogue farther off is gone to, not rushed at

    def __post_init__(self) -> None:
        none = "half_way_s", "on_the_way", "kept_back"
        check_numbers("guidance.predictive.plan", self, zero=none, below_one=("kept_back",))


class PathPlan:
    """Eqs. (1) to (3), one control tick at a time.

    Args:
        settings: constants.
        acceleration_limit_m_s2: a_max.
        jerk_limit_m_s3: j_max.
    """

    def __init__(self, settings: PlanSettings, acceleration_limit_m_s2: float, jerk_limit_m_s3: float) -> None:
        self._settings, self._jerk = settings, jerk_limit_m_s3
        n, h = settings.nodes, settings.node_s
        k = np.arange(1, n + 1)
        self._times = h * k
        late = h * np.maximum(k[:, np.newaxis] - k, 0)  # from the end of a jerk to a node
        acts = np.tril(np.ones((n, n)))
        self._place = acts * (late * late * h / 2.0 + late * h * h / 2.0 + h**3 / 6.0) * jerk_limit_m_s3
        self._free = np.column_stack([np.ones(n), self._times, 0.5 * self._times**2])
        self._rise = h * jerk_limit_m_s3 / acceleration_limit_m_s2  # of acceleration, in shares of its limit, by a jerk
        self._C = np.vstack([np.eye(n), self._rise * acts])
        kept = settings.kept_back * np.minimum(h * (k - 1) / settings.kept_back_s, 1.0)
        self._all, self._left = np.ones(2 * n), np.tile(1.0 - kept, 2)
        self._a_max = acceleration_limit_m_s2
        self._v, self._p = np.zeros(2 * n), np.zeros(2 * n)
        prices = settings.jerk_price_m2, settings.calm_price_s6 * jerk_limit_m_s3**2  # the second where calm
        self._prices, self._following = prices, [self._system(np.ones(n), price) for price in prices]

    def jerk_m_s3(self, x: Array, places_m: Array, to_contact_s: float | None, *, calm: bool = False) -> float:
        """The jerk to fly now.

        Args:
            x: (3,) place [m], rate [m/s] and acceleration [m/s^2] as commanded.
            places_m: (N,) y_D, the first h from now.
            to_contact_s: t_r, None to follow.
            calm: at the price of a swing that is only waited for.
        """
        s = self._settings
        off = self._free @ x - places_m
        if to_contact_s is None:
            limits, system = self._all, self._following[calm]
        else:
            limits, system = self._left, self._system(self._weights(to_contact_s), self._prices[calm])
        ways = self._rise, self._place, *system, off, x[2] / self._a_max, limits
        return float(_first(*ways, self._v, self._p, s.iterations)) * self._jerk

    def _system(self, weights: Array, price: float) -> tuple[Array, Array, float]:
        """Weights w and what Eq. (3) needs of them and of r: (H + q C'C)^-1, q."""
        return weights, *_inverse(self._place, self._C, weights, price)

    def _weights(self, to_contact_s: float) -> Array:
        """(N,) Eq. (2); a contact that is there already is met at the first node."""
        s, t_c = self._settings, max(to_contact_s + self._settings.half_way_s, self._settings.node_s)
        near = np.exp(-0.5 * ((self._times - t_c) / s.contact_s) ** 2)
        near[self._times > t_c + _UNTIL * s.contact_s] = 0.0
        return np.asarray(s.on_the_way + s.at_contact * near)


@njit(cache=True)
def _inverse(G, C, w, price):  # type: ignore[no-untyped-def]
    """(H + q C'C)^-1 and q of Eq. (3)."""
    n = G.shape[1]
    H = (G.T * w) @ G
    for i in range(n):
        H[i, i] += price
    q = 0.5 * np.trace(H) / n
    return np.linalg.inv(H + q * (C.T @ C)), q


@njit(cache=True)
def _first(rise, G, w, M, q, off, a_0, limits, v, p, iterations):  # type: ignore[no-untyped-def]
    """First z of Eq. (1) by Eq. (3); v and p (2N,) go on in place.

    C z is z itself and, below it, `rise` times its running sum; M is symmetric, and goes column by column.
    """
    n = len(M)
    f = G.T @ (w * off)
    z, g = np.zeros(n), np.empty(n)
    for _ in range(iterations):
        later = 0.0
        for i in range(n - 1, -1, -1):
            later += q * v[n + i] - p[n + i]
            g[i] = q * v[i] - p[i] + rise * later - f[i]
        z[:] = 0.0
        for j in range(n):
            for i in range(n):
                z[i] += M[j, i] * g[j]
        so_far = 0.0
        for i in range(n):
            so_far += z[i]
            _clip(z[i], i, 0.0, q, limits, v, p)
            _clip(rise * so_far, n + i, a_0, q, limits, v, p)
    return min(max(z[0], -1.0), 1.0)


@njit(cache=True)
def _clip(Cz, i, there, q, limits, v, p):  # type: ignore[no-untyped-def]
    """Row i of the last two of Eq. (3), `there` being what is there already, as a share of its limit."""
    v[i] = min(max(Cz + p[i] / q, -limits[i] - there), limits[i] - there)
    p[i] += q * (Cz - v[i])
