"""Which of the scene's facets may mirror the Sun into the lens; most do not, and working out a lobe takes its time.

A facet that is turned away from Sun or lens does not, nor is one seen that lies behind the lens. Of the others the
facet that [lobes, eq 1] asks for stands steeper by |m|, m of [lobes, eq 2] in the middle, and by no less than |m| - b
elsewhere, b being the most by which slope and half vector turn over the facet. With V the variance of slopes, the Sun's
disc included, its radiance is at most

    4 R(i)/(8 (h.n)^4 (v.n - b) sigma^2) exp(-(|m| - b)^2/(2 V))                                                  (1)

where the 4 stands for what R and h.n gain over it. Nor is one looked at whose lobe ends before, at six sigmas.
Sources: as of `lobes`.
"""

import math

import numpy as np
from numpy.typing import NDArray

from dockair.kernels import njit
from dockair.rotations import Array
from dockair.sim.camera.lobes import reflectance
from dockair.sim.camera.mirrors import Facets
from dockair.triples import Vector, turned_back, unit

_GAIN = 4.0
_LEAST_COS = 1e-3  # of v.n - b
_MOST_SIGMAS = 6.0
_STEEPEST = 0.5  # h.n of `lobes`


@njit(cache=True)
def facets_that_may_shine(
    facets: Facets,
    poses: tuple[Array, Array],
    sun: tuple[Vector, float],
    eye: Vector,
    ahead: Vector,
    finishes: Array,
    faintest: float,
) -> NDArray[np.int64]:
    """Return their numbers, in order.

    Args:
        facets: of `Mirrors`.
        poses: (ngeom, 3) places and (ngeom, 9) attitudes of the geoms.
        sun: unit vector toward it, a^2/4 of [lobes, eq 3].
        eye: the lens [m].
        ahead: unit vector along its axis, to leave out what lies wholly behind it; zeros for all around.
        finishes: of `mirrors.finishes`.
        faintest: radiance below which none counts.
    """
    (xpos, xmat), planes, frame, half = poses, facets.planes, facets.frame, facets.half
    out, count = np.empty(len(facets.geom) + 1, dtype=np.int64), 0
    for g, start, stop in facets.runs:
        s = turned_back(xmat[g], sun[0])
        e = turned_back(xmat[g], (eye[0] - xpos[g, 0], eye[1] - xpos[g, 1], eye[2] - xpos[g, 2]))
        facing, first, axis = _facing(planes, start, stop, s, e, out[count:]), count, turned_back(xmat[g], ahead)
        for at in range(first, first + facing):
            i = out[at]
            px, py, pz, reach = frame[i, 0, 0], frame[i, 0, 1], frame[i, 0, 2], half[i, 0] + half[i, 1]
            depth = axis[0] * (px - e[0]) + axis[1] * (py - e[1]) + axis[2] * (pz - e[2])
            if depth < -reach * (1.0 + facets.bend[i]):
                continue
            v, d = unit((e[0] - px, e[1] - py, e[2] - pz))
            h, twice = unit((v[0] + s[0], v[1] + s[1], v[2] + s[2]))
            x, y, z = planes[0, i], planes[1, i], planes[2, i]
            hn, vn = x * h[0] + y * h[1] + z * h[2], x * v[0] + y * v[1] + z * v[2]
            if hn < _STEEPEST:
                continue
            bend = facets.bend[i] + 2.0 * reach / max(d * twice, 1e-9)
            disc, rough = math.sqrt(sun[1]) / max(twice, 1e-9), finishes[facets.material[i], 3]
            lacking = max(math.sqrt(max(1.0 / hn**2 - 1.0, 0.0)) - bend, 0.0)
            if lacking > _MOST_SIGMAS * (rough + disc):
                continue
            share = reflectance(0.5 * twice, finishes[facets.material[i]])
            most = _GAIN * share / (8.0 * hn**4 * max(vn - bend, _LEAST_COS) * rough**2)
            if most * math.exp(-0.5 * lacking**2 / (rough**2 + disc**2)) >= faintest:
                out[count] = i
                count += 1
    return out[:count]


@njit(cache=True)
def _facing(planes: Array, start: int, stop: int, s: Vector, e: Vector, out: NDArray[np.int64]) -> int:
    """List which facets of a run face both a direction s and a point e; return how many."""
    count = 0
    for i in range(start, stop):
        x, y, z = planes[0, i], planes[1, i], planes[2, i]
        out[count] = i
        toward, ahead = x * s[0] + y * s[1] + z * s[2], x * e[0] + y * e[1] + z * e[2]
        count += (toward > 0.0) & (ahead > planes[3, i])
    return count
