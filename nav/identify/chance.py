"""How likely a ring is an accident of clutter, and how likely one of its LEDs is.

With N hypotheses looked up, clutter of rho candidates a square pixel and a tolerance t, a fit with m LEDs comes with
the expected number of accidental rings like it,

    NFA = N (5 over m - 3) p^(m - 3),   p = rho pi t^2                                    (1)

(the "number of false alarms" of a-contrario detection, Desolneux, Moisan & Morel 2000). N counts the hypotheses that
passed the shape's and the prior's gates, the true ones among them, so it errs on the safe side.

A true ring may still count a blob as the LED that is hidden there. With residual d against the standard deviation s
and any number of visible LEDs as likely as another, a member is an impostor with odds

    o = (9 - m)/m rho 2 pi s^2 g exp(d^2 g / 2 s^2),   g = 2 m / (2 m - 6)                (2)

where g makes of d and s those of a prediction from the other members: six parameters were fitted to all. The sum of o
is the expected number of impostors.

rho of Eq. (1) is the larger of two densities, of all candidates but three over their box and of those that are no
members within 1.6 radii: reflections crowd about the drogue. Eq. (2) counts no members in either, and a fifth of a blob
more near by, so that a member may be the only blob there is. Both look at places only; see `brightness`.
"""

import math

import numpy as np
from numpy.typing import NDArray

from dockair.kernels import njit
from dockair.nav.identify.perspective import SLOTS, RingFit
from dockair.rotations import Array

Count = NDArray[np.int64] | int

_WAYS = np.array([math.comb(SLOTS - 3, k) for k in range(SLOTS - 2)])
_NEIGHBOURHOOD_RADII = 1.6
_UNSEEN = 0.2  # blobs
_LARGEST_EXPONENT = 50.0


def box_area_px2(points: Array) -> float:
    """Area of the candidates' box, at least one pixel."""
    (left, top), (right, bottom) = points.min(axis=0), points.max(axis=0)
    return max(float((right - left) * (bottom - top)), 1.0)


def log10_false_rings(tested: Count, count: Count, p: Array | float) -> Array:
    """log10 of Eq. (1).

    Args:
        tested: N.
        count: m, 3 to 8.
        p: as above.
    """
    more = np.asarray(count) - 3
    p = np.minimum(np.maximum(p, 1e-12), 1.0)
    return np.asarray(np.log10(np.maximum(tested, 1) * _WAYS[more]) + more * np.log10(p))


def log10_false_rings_of_one(tested: int, count: int, p: float) -> float:
    """The same of a single ring, for less than what arrays of one number cost."""
    return math.log10(max(tested, 1) * int(_WAYS[count - 3])) + (count - 3) * math.log10(min(max(p, 1e-12), 1.0))


def densities_px2(points: Array, fit: RingFit) -> tuple[float, float]:
    """Clutter by Eq. (1) and by Eq. (2), rho, about a fitted ring [1/px^2]."""
    reach = _NEIGHBOURHOOD_RADII * fit.radius_px
    neighbourhood = np.pi * reach**2
    near = _others_near(points, fit.candidate, fit.centre_px, reach)
    # a box that the ring fills holds at least the ring's own area
    area = max(box_area_px2(points), np.pi * fit.radius_px**2)
    accident = max(max(len(points) - 3, 1) / area, near / neighbourhood)
    return accident, max((len(points) - fit.count) / area, (near + _UNSEEN) / neighbourhood)


@njit(cache=True)
def _others_near(points, candidate, centre, reach):  # type: ignore[no-untyped-def]
    """Number of points nearer to the centre than reach, without the candidates."""
    near = 0
    for k in range(len(points)):
        inside = (points[k, 0] - centre[0]) ** 2 + (points[k, 1] - centre[1]) ** 2 < reach * reach
        if inside and not (candidate == k).any():
            near += 1
    return near


def member_odds(points: Array, fit: RingFit, density: float, tolerance_sigmas: float) -> Array:
    """(8,) Eq. (2) of each slot's candidate; 0 for an empty slot.

    Args:
        points: (n, 2) candidates [px].
        fit: of at least four of them.
        density: rho [1/px^2].
        tolerance_sigmas: t / s.
    """
    filled = fit.candidate >= 0
    variance = (fit.tolerance_px / tolerance_sigmas) ** 2
    squares = np.where(filled, ((points[fit.candidate] - fit.slots_px) ** 2).sum(axis=1), 0.0)
    m = fit.count
    g = m / (m - 3)
    exponent = np.minimum(0.5 * g * squares / variance, _LARGEST_EXPONENT)
    return np.where(filled, (SLOTS + 1 - m) / m * density * 2.0 * np.pi * variance * g * np.exp(exponent), 0.0)
