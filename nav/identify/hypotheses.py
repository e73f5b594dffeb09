"""Rings that the candidates may form: triples proposed, octagons looked up, the exact image fitted, chance weighed.

Both methods of the source propose triples of candidates; the octagon look-up and the fit of the ring's exact
perspective image judge them, because a tilted ring is no circle, and `chance` says how likely each is an accident.

Cost: triples of n candidates, each looked up at a cost that does not grow with n (beyond `few_candidates` only three
patterns of slots are tried); of different ones the `_KEPT` least accidental compete for at most `max_fits` fits. A
hypothesis that an earlier fit already contains is not fitted again, nor one with too few LEDs to be believed, but for
`_HOPELESS` of them when there is nothing better.
"""

from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from dockair.calibration import Camera
from dockair.nav.identify.chance import box_area_px2, densities_px2, log10_false_rings, member_odds
from dockair.nav.identify.circle_hough import find_circles, radius_row
from dockair.nav.identify.code import CodeSettings
from dockair.nav.identify.octagon import ALL_PATTERNS, RIGHT_ANGLES, Octagons, find_octagons
from dockair.nav.identify.perspective import SLOTS, RingFit, fit_ring
from dockair.nav.identify.prior import RingPrior
from dockair.nav.identify.three_point import RADIUS_GATE, all_triples, circles_through, trust
from dockair.rotations import Array

METHODS = ("three_point", "circle_hough")
MIN_LEDS = 4
_HOUGH_BAND = 0.25  # half width around a peak's circle, of its radius: a ring tilted by 40 deg is 0.77 to 1
_TURNS = (np.arange(SLOTS) + np.arange(SLOTS)[:, None]) % SLOTS  # a row is the slots turned by one more place
_KEPT = 64  # octagons kept for ranking
_HOPELESS = 3  # fits of rings that cannot be believed, so that what is there is AMBIGUOUS
_EXTRAPOLATION = 2.5  # how much three LEDs blow up their errors at the other places, for all but short arcs


@dataclass(frozen=True, slots=True, kw_only=True)
class IdentifySettings:
    """Settings of the identification; lengths in pixels."""

    radius_range_px: tuple[float, float] = (12.0, 560.0)  # 0.5 m ring at 60 m and 1.3 m, where it overfills the frame
    max_tilt_rad: float = np.deg2rad(40.0)  # more, and four LEDs of a frontal ring pass for four of a tilted one
    max_candidates: int = 60  # 34 220 triples
    few_candidates: int = 24  # up to here every three LEDs propose a ring, beyond it only those at right angles
    max_fits: int = 16
    sigma_px: float = 0.10  # of a centroid when the caller does not say, without what the LEDs' places add
    ring_sigma: float = 0.0012  # LED position error over the ring's radius: 0.3 mm of 250 mm
    tolerance_sigmas: float = 4.0  # one true LED in 3000 falls outside in either coordinate
    centre_tolerance_radii: float = 1.0  # of an expected centre without sigma, in ring radii
    radius_tolerance: float = 0.25  # of an expected radius, as a fraction
    close_radius_tolerance: float = 0.15  # a ring this near to it is preferred to one that is not
    roll_tolerance_rad: float = np.deg2rad(15.0)  # beyond it a numbering is as far from the next, 22.5 being the middle
    predicted_radius_tolerance: float = 0.08  # of a tracked ring: 1.5 m/s toward it at 2 m for five frames
    predicted_roll_tolerance_rad: float = np.deg2rad(8.0)  # of a tracked ring: gyro, and an affine fit's 3 degrees
    predicted_shape_tolerance: float = 0.02  # of a tracked ring, in radii: a tilt of 20 deg may change by 4 deg
    predicted_shape_sigmas: float = 4.0  # of a centroid, beside it
    max_false_rings: float = 3e-4  # accidental rings a frame of pure clutter may show, see `chance` Eq. (1)
    max_false_rings_with_prior: float = 1e-2  # one that is also where, and as large as, the ring should be
    max_false_rings_predicted: float = 5e-2  # one that moreover is turned as it should be: few hypotheses are left
    max_impostors: float = 1e-3  # expected among the members of a ring, see `chance` Eq. (2)
    max_impostors_with_prior: float = 5e-3
    code: CodeSettings = field(default_factory=CodeSettings)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class ScoredFit:
    """A fit and what chance says of it."""

    log10_false_rings: float  #: of Eq. (1) of `chance`
    odds: Array  #: (8,) that a slot's candidate is an impostor, Eq. (2) of `chance`
    fit: RingFit


def ring_fits(
    points: Array,
    method: str,
    prior: RingPrior,
    camera: Camera,
    sigma_px: float,
    settings: IdentifySettings,
    most_false_rings: float,
) -> list[ScoredFit]:
    """Different fits with at least four LEDs, the least accidental first.

    Args:
        points: (n, 2) candidates, undistorted [px].
        method: of METHODS.
        prior: gates.
        camera: its focal length and principal point.
        sigma_px: of a candidate's coordinate.
        settings: of the identification.
        most_false_rings: NFA above which no ring is believed.
    """
    octagons = _octagons(points, method, prior, camera, sigma_px, settings)
    scored: list[ScoredFit] = []
    hypotheses, hopeless = _ranked(points, octagons, sigma_px, most_false_rings, settings)
    fits = doubtful = 0
    believed = False
    while len(hypotheses) and fits < settings.max_fits and doubtful < _HOPELESS and not (believed and hopeless[0]):
        fits, doubtful = fits + 1, doubtful + int(hopeless[0])
        fit = fit_ring(
            points, hypotheses[0], camera.focal_length_px, camera.principal_point_px,
            tolerance_px=settings.tolerance_sigmas * sigma_px,
            tolerance_per_radius=settings.tolerance_sigmas * settings.ring_sigma,
            max_tilt_rad=settings.max_tilt_rad,
        )  # fmt: skip
        different = not any(_contained(one.fit.candidate, fit.candidate[None])[0] for one in scored)
        if fit.count >= MIN_LEDS and different and fit.tilt_rad <= settings.max_tilt_rad:
            scored.append(_scored(points, fit, octagons, settings))
            believed |= scored[-1].log10_false_rings <= np.log10(most_false_rings)
        # a hypothesis with an impostor may lose the wrong LEDs in its fit: parts of it still get their own
        size = (hypotheses >= 0).sum(axis=1)
        repeated = _contained(hypotheses[0], hypotheses) & (size == size[0])
        keep = ~(repeated | _contained(fit.candidate, hypotheses))
        hypotheses, hopeless = hypotheses[keep], hopeless[keep]
    return sorted(scored, key=lambda one: (one.log10_false_rings, one.fit.rms_px))


def _octagons(
    points: Array, method: str, prior: RingPrior, camera: Camera, sigma_px: float, settings: IdentifySettings
) -> Octagons:
    """What the method's triples suggest."""
    spread = _EXTRAPOLATION * settings.tolerance_sigmas
    return find_octagons(
        points, _triples_of(points, method, prior),
        ALL_PATTERNS if len(points) <= settings.few_candidates else RIGHT_ANGLES,
        focal_length_px=camera.focal_length_px, principal_point_px=camera.principal_point_px,
        radius_range_px=prior.radius_range_px, centre_gate=prior.gate, roll_gate=prior.roll_gate,
        min_axis_ratio=float(np.cos(settings.max_tilt_rad)),
        tolerance_px=max(1.0, spread * sigma_px), tolerance_per_radius=spread * settings.ring_sigma,
    )  # fmt: skip


def _scored(points: Array, fit: RingFit, octagons: Octagons, settings: IdentifySettings) -> ScoredFit:
    accident, impostor = densities_px2(points, fit)
    p = accident * np.pi * fit.tolerance_px**2
    return ScoredFit(
        log10_false_rings=float(log10_false_rings(_tested(octagons, fit.count), fit.count, p)),
        odds=member_odds(points, fit, impostor, settings.tolerance_sigmas),
        fit=fit,
    )


def without_impostors(scored: ScoredFit, most: float) -> RingFit | None:
    """The fit, or the fit less its most doubtful member, so that fewer impostors than `most` are expected; or None."""
    if scored.odds.sum() <= most:
        return scored.fit
    worst = int(np.argmax(scored.odds))
    if scored.fit.count <= MIN_LEDS or scored.odds.sum() - scored.odds[worst] > most:
        return None
    candidate = scored.fit.candidate.copy()
    candidate[worst] = -1
    return replace(scored.fit, candidate=candidate)


def _contained(larger: NDArray[np.int64], smaller: NDArray[np.int64]) -> NDArray[np.bool_]:
    """(m,) whether every LED of a hypothesis (m, 8) has the same place in the larger one, up to the symmetry."""
    fits = (smaller[:, None, :] < 0) | (smaller[:, None, :] == larger[_TURNS])
    return np.asarray(fits.all(axis=2).any(axis=1))


def _triples_of(points: Array, method: str, prior: RingPrior) -> NDArray[np.int64]:
    """(m, 3) triples of candidates that the method proposes."""
    if method == "three_point":
        return all_triples(len(points))
    peaks = find_circles(points, radius_row(*prior.radius_range_px), centre_gate=prior.gate)
    proposed = [np.empty((0, 3), np.int64)]
    for centre, radius in zip(peaks.centre_px, peaks.radius_px, strict=True):
        distance = np.hypot(*(points - centre).T)
        members = np.flatnonzero(np.abs(distance - radius) <= _HOUGH_BAND * radius)
        proposed.append(members[all_triples(len(members))])
    n = len(points)
    keys = np.unique(np.vstack(proposed) @ np.array([n * n, n, 1]))  # neighbouring peaks share their triples
    return np.column_stack([keys // (n * n), keys // n % n, keys % n])


def _tested(octagons: Octagons, count: NDArray[np.int64] | int) -> NDArray[np.int64]:
    """N of a ring: no five LEDs without three at right angles, so that only these hypotheses can bring it forth."""
    return np.where(np.asarray(count) > MIN_LEDS, octagons.tested_right_angles, octagons.tested)


def _keys(candidate: NDArray[np.int64]) -> NDArray[np.uint64]:
    """(m,) hash of who is next to whom in hypotheses (m, 8): the same for those alike up to the ring's symmetry."""
    mixed = (candidate + 2).astype(np.uint64) * np.uint64(0x9E3779B97F4A7C15)
    mixed = (mixed ^ (mixed >> np.uint64(29))) * np.uint64(0xBF58476D1CE4E5B9)
    return np.asarray((mixed * (np.roll(mixed, 1, axis=1) >> np.uint64(17))).sum(axis=1, dtype=np.uint64))


def _ranked(
    points: Array, octagons: Octagons, sigma_px: float, most_false_rings: float, settings: IdentifySettings
) -> tuple[NDArray[np.int64], NDArray[np.bool_]]:
    """(m, 8) hypotheses, the least accidental first, the more trusted circle first among equals.

    Beside them (m,) whether a ring of no more LEDs is too likely an accident even where clutter is not crowded.
    """
    if not len(octagons.count):
        return octagons.candidate, np.empty(0, np.bool_)
    area = box_area_px2(points)
    p = len(points) * np.pi * octagons.tolerance_px**2 / area
    accident = np.round((octagons.count - 3) * np.log(np.clip(p, 1e-12, 0.5)), 6)
    best = np.argsort(accident, kind="stable")
    best = best[np.sort(np.unique(_keys(octagons.candidate[best]), return_index=True)[1])][:_KEPT]
    centres, radii = circles_through(points, octagons.triple[best])
    trusted = trust(centres, radii, cap_px=RADIUS_GATE * float(np.median(radii)))
    best = best[np.lexsort((-trusted, accident[best]))]
    count, radius = octagons.count[best], octagons.radius_px[best]
    t2 = settings.tolerance_sigmas**2 * (sigma_px**2 + (settings.ring_sigma * radius) ** 2)
    p = max(len(points) - 3, 1) * np.pi * t2 / area
    rings = log10_false_rings(_tested(octagons, count), count, p)
    hopeless = rings > np.log10(most_false_rings)
    order = np.argsort(hopeless, kind="stable")
    return octagons.candidate[best[order]], hopeless[order]
