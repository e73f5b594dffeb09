"""Rings that the candidates may form: triples proposed, octagons looked up, the exact image fitted, chance weighed.

Both methods of the source propose triples of candidates; the octagon look-up and the fit of the ring's exact
perspective image judge them, because a tilted ring is no circle. With N hypotheses looked up, n - 3 other candidates
on an area S and a tolerance t, a fit with m LEDs comes with the expected number of accidental rings like it,

    NFA = N (5 over m - 3) p^(m - 3),   p = (n - 3) pi t^2 / S                            (1)

(the "number of false alarms" of a-contrario detection, Desolneux, Moisan & Morel 2000). N counts the hypotheses that
passed the shape's and the prior's gates, the true ones among them, so it errs on the safe side.

Cost: triples of n candidates, each looked up in n; then at most `max_fits` fits. A hypothesis that an earlier fit
already contains is not fitted again.
"""

from dataclasses import dataclass
from math import comb

import numpy as np
from numpy.typing import NDArray

from dockair.calibration import Camera
from dockair.nav.identify.circle_hough import find_circles, radius_row
from dockair.nav.identify.octagon import Octagons, find_octagons
from dockair.nav.identify.perspective import SLOTS, RingFit, fit_ring
from dockair.nav.identify.prior import RingPrior
from dockair.nav.identify.three_point import RADIUS_GATE, all_triples, circles_through, trust
from dockair.rotations import Array

METHODS = ("three_point", "circle_hough")
MIN_LEDS = 4
_HOUGH_BAND = 0.25  # half width around a peak's circle, of its radius: a ring tilted by 40 deg is 0.77 to 1
_TURNS = (np.arange(SLOTS) + np.arange(SLOTS)[:, None]) % SLOTS  # a row is the slots turned by one more place
_CAPACITY = 256  # octagons kept for ranking
_EXTRAPOLATION = 2.5  # how much three LEDs blow up their errors at the other places, for all but short arcs


@dataclass(frozen=True, slots=True, kw_only=True)
class IdentifySettings:
    """Settings of the identification; lengths in pixels."""

    radius_range_px: tuple[float, float] = (12.0, 700.0)  # 0.5 m ring at 60 m and at 1 m, 2909 px focal length
    max_tilt_rad: float = np.deg2rad(40.0)  # more, and four LEDs of a frontal ring pass for four of a tilted one
    max_candidates: int = 60  # 34 220 triples
    max_fits: int = 16
    sigma_px: float = 0.10  # of a centroid when the caller does not say, without what the LEDs' places add
    ring_sigma: float = 0.0012  # LED position error over the ring's radius: 0.3 mm of 250 mm
    tolerance_sigmas: float = 4.0  # one true LED in 3000 falls outside in either coordinate
    centre_tolerance_radii: float = 1.0  # of an expected centre without sigma, in ring radii
    radius_tolerance: float = 0.25  # of an expected radius, as a fraction
    roll_tolerance_rad: float = np.deg2rad(15.0)  # beyond it a numbering is as far from the next, 22.5 being the middle
    predicted_radius_tolerance: float = 0.08  # of a tracked ring: 1.5 m/s toward it at 2 m for five frames
    predicted_roll_tolerance_rad: float = np.deg2rad(8.0)  # of a tracked ring: gyro, and an affine fit's 3 degrees
    predicted_shape_tolerance: float = 0.02  # of a tracked ring, in radii: a tilt of 20 deg may change by 4 deg
    predicted_shape_sigmas: float = 4.0  # of a centroid, beside it
    max_false_rings: float = 3e-3  # accidental rings a frame of pure clutter may show, see `hypotheses` Eq. (1)
    max_false_rings_with_prior: float = 1e-2  # one that is also where, and as large as, the ring should be
    max_false_rings_predicted: float = 5e-2  # one that moreover is turned as it should be: few hypotheses are left


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class ScoredFit:
    """A fit and log10 of its NFA, Eq. (1)."""

    log10_false_rings: float
    fit: RingFit


def ring_fits(
    points: Array, method: str, prior: RingPrior, camera: Camera, sigma_px: float, settings: IdentifySettings
) -> list[ScoredFit]:
    """Different fits with at least four LEDs, the least accidental first.

    Args:
        points: (n, 2) candidates, undistorted [px].
        method: of METHODS.
        prior: gates.
        camera: its focal length and principal point.
        sigma_px: of a candidate's coordinate.
        settings: of the identification.
    """
    sigmas, area = settings.tolerance_sigmas, max(float(np.prod(np.ptp(points, axis=0))), 1.0)
    octagons = find_octagons(
        points, _triples_of(points, method, prior), radius_range_px=prior.radius_range_px, centre_gate=prior.gate,
        roll_gate=prior.roll_gate,
        min_axis_ratio=float(np.cos(settings.max_tilt_rad)),
        tolerance_px=max(1.0, _EXTRAPOLATION * sigmas * sigma_px),
        tolerance_per_radius=_EXTRAPOLATION * sigmas * settings.ring_sigma,
        perspective_per_radius_squared=1.0 / camera.focal_length_px, capacity=_CAPACITY,
    )  # fmt: skip
    scored: list[ScoredFit] = []
    hypotheses = _ranked(points, octagons, area)
    for _ in range(settings.max_fits):
        if not len(hypotheses):
            break
        fit = fit_ring(
            points, hypotheses[0], camera.focal_length_px, camera.principal_point_px,
            tolerance_px=sigmas * sigma_px, tolerance_per_radius=sigmas * settings.ring_sigma,
        )  # fmt: skip
        different = not any(_contained(one.fit.candidate, fit.candidate[None])[0] for one in scored)
        if fit.count >= MIN_LEDS and different and fit.tilt_rad <= settings.max_tilt_rad:
            p = max(len(points) - 3, 1) * np.pi * fit.tolerance_px**2 / max(area, np.pi * fit.radius_px**2)
            chance = comb(SLOTS - 3, fit.count - 3) * min(1.0, p) ** (fit.count - 3)
            scored.append(ScoredFit(log10_false_rings=float(np.log10(max(octagons.tested, 1) * chance)), fit=fit))
        # a hypothesis with an impostor may lose the wrong LEDs in its fit: parts of it still get their own
        size = (hypotheses >= 0).sum(axis=1)
        repeated = _contained(hypotheses[0], hypotheses) & (size == size[0])
        hypotheses = hypotheses[~(repeated | _contained(fit.candidate, hypotheses))]
    return sorted(scored, key=lambda one: (one.log10_false_rings, one.fit.rms_px))


def _contained(larger: NDArray[np.int64], smaller: NDArray[np.int64]) -> NDArray[np.bool_]:
    """(m,) whether every LED of a hypothesis (m, 8) has the same place in the larger one, up to the symmetry."""
    fits = (smaller[:, None, :] < 0) | (smaller[:, None, :] == larger[_TURNS])
    return np.asarray(fits.all(axis=2).any(axis=1))


def _triples_of(points: Array, method: str, prior: RingPrior) -> NDArray[np.int64]:
    """(m, 3) triples of candidates that the method proposes."""
    if method == "three_point":
        triples = all_triples(len(points))
        _, radii = circles_through(points, triples)
        # three LEDs on the flat side of a ring tilted by 40 deg lie on a circle 1/cos^2 = 1.7 times its size
        return triples[(radii > 0.55 * prior.radius_range_px[0]) & (radii < 1.7 * prior.radius_range_px[1])]
    peaks = find_circles(points, radius_row(*prior.radius_range_px), centre_gate=prior.gate)
    proposed = [np.empty((0, 3), np.int64)]
    for centre, radius in zip(peaks.centre_px, peaks.radius_px, strict=True):
        distance = np.hypot(*(points - centre).T)
        members = np.flatnonzero(np.abs(distance - radius) <= _HOUGH_BAND * radius)
        proposed.append(members[all_triples(len(members))])
    n = len(points)
    keys = np.unique(np.vstack(proposed) @ np.array([n * n, n, 1]))  # neighbouring peaks share their triples
    return np.column_stack([keys // (n * n), keys // n % n, keys % n])


def _ranked(points: Array, octagons: Octagons, area: float) -> NDArray[np.int64]:
    """(m, 8) hypotheses, the least accidental first, the more trusted circle first among equals."""
    if not len(octagons.count):
        return octagons.candidate
    centres, radii = circles_through(points, octagons.triple)
    p = np.clip(len(points) * np.pi * octagons.tolerance_px**2 / area, 1e-12, 0.5)
    accident = (octagons.count - 3) * np.log(p)
    trusted = trust(centres, radii, cap_px=RADIUS_GATE * float(np.median(radii)))
    return octagons.candidate[np.lexsort((-trusted, np.round(accident, 6)))]
