"""Three candidates say where the other five LEDs would be: the octagon's affine image, looked up among the candidates.

Three LEDs and the slots they take on the ring fix an affine map of the octagon,

    x_s = c + A e_s,   e_s = (cos 45 s, sin 45 s)                                         (1)

and each of the other five places is then a coincidence to be looked for, where a circle through three points
[Yoon 2018, eqs 4-8] only offers its whole rim, and a tilted ring is no circle. A triple is tried with the 21 patterns
of slots it can take; those whose map is no view of a circle (ratio of axes below the cosine of the largest tilt) drop
out first, about nine in ten.

Slots count in the sense of the LEDs' numbers (left, up, right, down in the image); which one is LED 0 is not decided
here. (1) is parallel projection: perspective moves the points by about r/f of the radius r, f the focal length, and the
tolerance grows accordingly; `perspective` has the exact shape.
"""

from dataclasses import dataclass

import numpy as np
from numba import njit
from numpy.typing import NDArray

from dockair.rotations import Array

SLOTS = 8
_ANGLE = 2.0 * np.pi * np.arange(SLOTS) / SLOTS
_COS, _SIN = np.cos(_ANGLE), np.sin(_ANGLE)


def _gap_table() -> tuple[NDArray[np.int64], Array]:
    """Slots of the second and third point when the first has slot 0, and the inverse of their two edges in Eq. (1)."""
    slots = np.array([(a, b) for a in range(1, SLOTS) for b in range(a + 1, SLOTS)])
    e = np.column_stack([_COS, _SIN])
    inverses = np.array([np.linalg.inv(np.column_stack([e[a] - e[0], e[b] - e[0]])) for a, b in slots])
    return slots, inverses


_GAP_SLOTS, _GAP_INVERSES = _gap_table()


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Octagons:
    """Affine hypotheses with at least four LEDs, one a row."""

    triple: NDArray[np.int64]  #: (m, 3) candidates that define it
    count: NDArray[np.int64]  #: (m,) LEDs, the three included
    candidate: NDArray[np.int64]  #: (m, 8) candidate in each slot, -1 for none
    tolerance_px: Array  #: (m,) of its look-ups
    tested: int  #: hypotheses of plausible shape that were looked up


def find_octagons(
    points: Array,
    triples: NDArray[np.int64],
    *,
    radius_range_px: tuple[float, float],
    centre_gate: tuple[float, float, float],
    roll_gate: tuple[float, float],
    min_axis_ratio: float,
    tolerance_px: float,
    tolerance_per_radius: float,
    perspective_per_radius_squared: float,
    capacity: int,
) -> Octagons:
    """Look up the octagons that triples of candidates suggest.

    Args:
        points: (n, 2) candidates [px].
        triples: (m, 3) indices, any order.
        radius_range_px: of the larger semi-axis.
        centre_gate: u, v and radius of the disc in which the centre must lie [px].
        roll_gate: roll of LED 0 and largest deviation from it, up to the ring's symmetry [rad].
        min_axis_ratio: smaller to larger semi-axis, the cosine of the largest tilt.
        tolerance_px: of a look-up, at radius 0;
        tolerance_per_radius: growing with the radius [px/px];
        perspective_per_radius_squared: and with its square [1/px].
        capacity: hypotheses kept, those with most LEDs when there are more.
    """
    triple, count, candidate, tolerance, tested = _find_octagons(
        np.ascontiguousarray(points), triples, radius_range_px[0], radius_range_px[1], *centre_gate, *roll_gate,
        min_axis_ratio, tolerance_px, tolerance_per_radius, perspective_per_radius_squared, 16 * capacity,
    )  # fmt: skip
    order = np.argsort(-count, kind="stable")[:capacity]
    return Octagons(
        triple=triple[order],
        count=count[order],
        candidate=candidate[order],
        tolerance_px=tolerance[order],
        tested=int(tested),
    )


@njit(cache=True)
def _look_up(points, cu, cv, a, slot_of, tolerance, found):  # type: ignore[no-untyped-def]
    """Fill the free slots of `found` with the nearest candidate inside the tolerance; number of slots filled in all."""
    count = 0
    for s in range(SLOTS):
        if found[s] >= 0:
            count += 1
            continue
        u = cu + a[0] * _COS[s] + a[1] * _SIN[s]
        v = cv + a[2] * _COS[s] + a[3] * _SIN[s]
        best = tolerance * tolerance
        for k in range(len(points)):
            du, dv = points[k, 0] - u, points[k, 1] - v
            d = du * du + dv * dv
            if d < best and not slot_of[k]:
                best = d
                found[s] = k
        if found[s] >= 0:
            count += 1
    return count


@njit(cache=True)
def _find_octagons(  # type: ignore[no-untyped-def]
    points, triples, r_min, r_max, gate_u, gate_v, gate_r, roll, roll_tol, min_ratio, tol, tol_r, tol_rr, capacity
):
    shape_limit = min_ratio**2 / (1.0 + min_ratio**2) ** 2  # det / trace^2 of A'A at that ratio of axes
    out_triple = np.empty((capacity, 3), np.int64)
    out_count = np.empty(capacity, np.int64)
    out_slots = np.empty((capacity, SLOTS), np.int64)
    out_tolerance = np.empty(capacity)
    taken = np.zeros(len(points), np.bool_)
    found = np.empty(SLOTS, np.int64)
    a = np.empty(4)
    n, tested = 0, 0
    for t in range(len(triples)):
        i, j, k = triples[t, 0], triples[t, 1], triples[t, 2]
        e, f = points[j, 0] - points[i, 0], points[k, 0] - points[i, 0]
        g, h = points[j, 1] - points[i, 1], points[k, 1] - points[i, 1]
        if e * h - f * g < 0.0:  # go round in the sense of the LEDs' numbers
            j, k, e, f, g, h = k, j, f, e, h, g
        for pattern in range(len(_GAP_SLOTS)):
            m = _GAP_INVERSES[pattern]
            a[0], a[1] = e * m[0, 0] + f * m[1, 0], e * m[0, 1] + f * m[1, 1]
            a[2], a[3] = g * m[0, 0] + h * m[1, 0], g * m[0, 1] + h * m[1, 1]
            trace = a[0] ** 2 + a[1] ** 2 + a[2] ** 2 + a[3] ** 2
            det = (a[0] * a[3] - a[1] * a[2]) ** 2
            if det < shape_limit * trace * trace:
                continue
            radius = np.sqrt(0.5 * (trace + np.sqrt(max(trace * trace - 4.0 * det, 0.0))))
            cu, cv = points[i, 0] - a[0], points[i, 1] - a[2]  # slot 0 is at e_0 = (1, 0)
            if radius < r_min or radius > r_max or (cu - gate_u) ** 2 + (cv - gate_v) ** 2 > gate_r**2:
                continue
            # rotation part of A; slot 0 of a ring with roll phi lies at phi + 180 deg, and 180 is four slots
            turns = (np.arctan2(a[2] - a[1], a[0] + a[3]) - roll) / _ANGLE[1]
            if abs(turns - np.round(turns)) * _ANGLE[1] > roll_tol:
                continue
            tested += 1
            taken[i] = taken[j] = taken[k] = True
            found[:] = -1
            found[0], found[_GAP_SLOTS[pattern, 0]], found[_GAP_SLOTS[pattern, 1]] = i, j, k
            tolerance = tol + radius * (tol_r + tol_rr * radius)
            count = _look_up(points, cu, cv, a, taken, tolerance, found)
            taken[i] = taken[j] = taken[k] = False
            if count >= 4 and n < capacity:
                out_triple[n, 0], out_triple[n, 1], out_triple[n, 2] = i, j, k
                out_count[n] = count
                out_slots[n] = found
                out_tolerance[n] = tolerance
                n += 1
    return out_triple[:n].copy(), out_count[:n].copy(), out_slots[:n].copy(), out_tolerance[:n].copy(), tested
