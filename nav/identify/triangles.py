"""Which triples of candidates may be three LEDs of a ring, and in which slots: a first look without a square root.

For edges e, f of a triple and a pattern of slots with inverse edges M the affine map is A = [e f] M, and

    trace A'A = x e.e + y f.f + z e.f,   |det A| = w |e x f|                               (1)

with x, y, z, w of M alone. A ring of radius k tilted by theta against the line of sight has trace k^2 (1 + cos^2 theta)
and det k^2 cos theta, so that |det| / trace bounds the tilt and the trace the size. The tilt is bounded against the
camera's axis; against the line of sight it may be larger by the angle between the two. Shapes are looked at on a map
that keeps small ones (stereographic); what perspective does to large ones is left room for.
"""

import numpy as np

from dockair.kernels import njit

_LOOSE = 0.9  # of the least ratio of axes: what perspective may do to it


@njit(cache=True)
def _least_ratio(square, min_ratio):  # type: ignore[no-untyped-def]
    """Least ratio of axes of a ring seen off the optical axis, `square` being 4 tan^2 of half that angle."""
    half = 0.25 * square
    cosine = (min_ratio * (1.0 - half) - np.sqrt(1.0 - min_ratio**2) * 2.0 * np.sqrt(half)) / (1.0 + half)
    return _LOOSE * max(cosine, 0.1)


@njit(cache=True)
def _flattened(points):  # type: ignore[no-untyped-def]
    """Candidates on a map of the field of view that keeps small shapes (stereographic): needs no aimed camera."""
    flat = np.empty_like(points)
    for i in range(len(points)):
        stretch = 2.0 / (1.0 + np.sqrt(1.0 + points[i, 0] ** 2 + points[i, 1] ** 2))
        flat[i, 0], flat[i, 1] = points[i, 0] * stretch, points[i, 1] * stretch
    return flat


@njit(cache=True)
def plausible_maps(points, triples, inverses, k_min, k_max, min_ratio):  # type: ignore[no-untyped-def]
    """(m, 4) triples, going round in the sense of the LEDs' numbers, and patterns whose map may be a ring's view.

    Args:
        points: (n, 2) pixels over the focal length, from the principal point.
        triples: (t, 3) indices.
        inverses: (p, 2, 2) of each pattern's edges.
        k_min: of the ring's radius over its depth, as the next.
        k_max: the largest.
        min_ratio: cosine of the largest tilt against the camera's axis.
    """
    x, y = (inverses[:, 0] ** 2).sum(axis=1), (inverses[:, 1] ** 2).sum(axis=1)
    z = 2.0 * (inverses[:, 0] * inverses[:, 1]).sum(axis=1)
    w = np.abs(inverses[:, 0, 0] * inverses[:, 1, 1] - inverses[:, 0, 1] * inverses[:, 1, 0])
    # k^2 is between half the trace and the trace, but for what perspective does
    trace_min, trace_max = 0.7 * k_min * k_min, 3.0 * k_max * k_max
    flat = _flattened(points)
    ratio = _least_ratio((flat**2).sum(axis=1).max(), min_ratio)
    loosest = ratio / (1.0 + ratio * ratio)  # |det A| / trace at that ratio of axes
    out = np.empty((len(triples) * len(inverses), 4), np.int16)  # small, or the system maps fresh pages every time
    n = 0
    for t in range(len(triples)):
        i, j, k = triples[t, 0], triples[t, 1], triples[t, 2]
        iu, iv = flat[i, 0], flat[i, 1]
        eu, ev, fu, fv = flat[j, 0] - iu, flat[j, 1] - iv, flat[k, 0] - iu, flat[k, 1] - iv
        cross = eu * fv - fu * ev
        if cross < 0.0:
            j, k, eu, ev, fu, fv, cross = k, j, fu, fv, eu, ev, -cross
        ee, ff, ef = eu * eu + ev * ev, fu * fu + fv * fv, eu * fu + ev * fv
        limit = 0.0
        for p in range(len(inverses)):
            trace = x[p] * ee + y[p] * ff + z[p] * ef
            if w[p] * cross < loosest * trace or trace < trace_min or trace > trace_max:
                continue
            if limit == 0.0:
                ratio = _least_ratio((iu + (eu + fu) / 3.0) ** 2 + (iv + (ev + fv) / 3.0) ** 2, min_ratio)
                limit = ratio / (1.0 + ratio * ratio)
            if w[p] * cross >= limit * trace:
                out[n, 0], out[n, 1], out[n, 2], out[n, 3] = i, j, k, p
                n += 1
    return out[:n]
