"""Circles through three candidates, and how much each is to be trusted.

    x^2 + y^2 + A x + B y + C = 0 through three points, centre (-A/2, -B/2), radius sqrt(A^2 + B^2 - 4C)/2
                                                                                  [Yoon 2018, eqs 4-8]
    D_i = sum_j |X_i - X_j|,  E_i = sum_j |r_i - r_j|,  T_i = 1 / (alpha D_i + beta E_i)       [eqs 9-11]

The source prints D and E as double sums; i is fixed. Of the circles through LEDs of one ring all are nearly the same,
so the ring's have the largest T, and the candidates within 10 % of its radius are the LEDs.

As printed, T is largest at the geometric median of *all* circles, which is the ring's while its circles are the
majority. Eight LEDs make 56 of the n(n-1)(n-2)/6 circles through n candidates: two noise blobs end that majority. `cap`
bounds each distance, which turns the median into the densest place; the identification uses it so.

Cost grows as n^3 for the circles and n^6 for the trust: `identify` bounds n, and takes the trust of those circles only
whose octagon has been found (`octagon`).
"""

from dataclasses import dataclass
from functools import lru_cache
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from dockair.kernels import njit
from dockair.rotations import Array

RADIUS_GATE = 0.10  # [Yoon 2018, III.2]: candidates within 10 % of the radius are the LEDs


@lru_cache(maxsize=64)
def all_triples(count: int) -> NDArray[np.int64]:
    """(m, 3) indices of all triples of `count` things, ascending; read-only."""
    triples = np.array(list(combinations(range(count), 3)), dtype=np.int64).reshape(-1, 3)
    triples.setflags(write=False)
    return triples


def circles_through(points: Array, triples: NDArray[np.int64]) -> tuple[Array, Array]:
    """Centres (m, 2) and radii (m,) of the circles through triples (m, 3) of points (n, 2); inf on a line.

    Solved relative to the first point of each triple, where Eq. (4) has no constant and loses no digits.
    """
    origin = points[triples[:, 0]]
    p, q = (points[triples[:, 1]] - origin).T, (points[triples[:, 2]] - origin).T
    pp, qq = (p * p).sum(axis=0), (q * q).sum(axis=0)
    cross = 2.0 * (p[0] * q[1] - p[1] * q[0])
    with np.errstate(divide="ignore", invalid="ignore"):
        centre = np.column_stack([q[1] * pp - p[1] * qq, p[0] * qq - q[0] * pp]) / cross[:, None]
    radii = np.hypot(centre[:, 0], centre[:, 1])
    radii[~np.isfinite(radii)] = np.inf
    return centre + origin, radii


def trust(centres: Array, radii: Array, *, alpha: float = 1.0, beta: float = 1.0, cap_px: float = np.inf) -> Array:
    """(m,) T of circles (m, 2), (m,), Eqs. (9)-(11), each |.| not above `cap_px`; one circle alone has T = inf."""
    sums = _sums(np.ascontiguousarray(centres), np.ascontiguousarray(radii), alpha, beta, cap_px)
    with np.errstate(divide="ignore"):
        return np.asarray(1.0 / sums)


@njit(cache=True)
def _sums(centres, radii, alpha, beta, cap):  # type: ignore[no-untyped-def]
    m = len(radii)
    sums = np.zeros(m)
    for i in range(m):
        for j in range(i):
            distance = np.hypot(centres[i, 0] - centres[j, 0], centres[i, 1] - centres[j, 1])
            term = alpha * min(distance, cap) + beta * min(abs(radii[i] - radii[j]), cap)
            sums[i] += term
            sums[j] += term
    return sums


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class TrustedCircle:
    """The circle of largest trust and the candidates on it."""

    centre_px: Array  #: (2,)
    radius_px: float
    trust: float
    members: NDArray[np.int64]


def most_trusted_circle(
    points: Array,
    *,
    alpha: float = 1.0,
    beta: float = 1.0,
    cap_px: float = np.inf,
    radius_range_px: tuple[float, float] = (0.0, np.inf),
) -> TrustedCircle | None:
    """The source's method as it stands: all triples, the most trusted circle, the candidates within 10 % of its radius.

    Args:
        points: (n, 2) candidates [px]; at most a few tens, see the module.
        alpha: weight of the centres' distances.
        beta: weight of the radii's differences.
        cap_px: largest distance that counts; inf as printed.
        radius_range_px: circles outside are left out.

    Returns:
        None when no circle is left.
    """
    centres, radii = circles_through(points, all_triples(len(points)))
    keep = np.isfinite(radii) & (radii >= radius_range_px[0]) & (radii <= radius_range_px[1])
    if not keep.any():
        return None
    centres, radii = centres[keep], radii[keep]
    T = trust(centres, radii, alpha=alpha, beta=beta, cap_px=cap_px)
    best = int(np.argmax(T))
    distance = np.hypot(*(points - centres[best]).T)
    return TrustedCircle(
        centre_px=centres[best],
        radius_px=float(radii[best]),
        trust=float(T[best]),
        members=np.flatnonzero(np.abs(distance - radii[best]) <= RADIUS_GATE * radii[best]),
    )
