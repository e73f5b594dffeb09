"""Rings that the candidates may form: triples proposed, octagons looked up, the exact image fitted, chance weighed.

Both methods of the source propose triples of candidates; the octagon look-up and the fit of the ring's exact
perspective image judge them, because a tilted ring is no circle; `chance` says how likely each is an accident of where
the candidates are, and `brightness` how likely one of how bright they are.

Cost: at most n(n-1)(n-2)/6 triples of n candidates in 21 patterns of slots, three beyond `few_candidates`, at most two
rings each, each looked up at a cost that does not grow with n; of the different ones that have four LEDs the `_KEPT`
least accidental compete for at most `max_fits` fits. A hypothesis that an earlier fit already contains is not fitted
again, nor one with too few LEDs to be believed, but for `_HOPELESS` of them when there is nothing better; and after two
whole rings of which none is preferred the answer is known.
"""

import math
from dataclasses import dataclass, field, fields, replace

import numpy as np
from numpy.typing import NDArray

from dockair.calibration import Camera
from dockair.errors import DockairError, check_numbers
from dockair.kernels import njit
from dockair.nav.identify.brightness import BrightnessModel, BrightnessSettings
from dockair.nav.identify.chance import box_area_px2, densities_px2, log10_false_rings, member_odds
from dockair.nav.identify.circle_hough import find_circles, radius_row, triples_near
from dockair.nav.identify.code import CodeSettings
from dockair.nav.identify.octagon import ALL_PATTERNS, RIGHT_ANGLES, Octagons, find_octagons
from dockair.nav.identify.perspective import SLOTS, RingFit, fit_ring
from dockair.nav.identify.prior import RingPrior
from dockair.nav.identify.three_point import RADIUS_GATE, all_triples, circles_through, trust
from dockair.rotations import Array

METHODS = ("three_point", "circle_hough")
MIN_LEDS = 4
_HOUGH_BAND = 0.25  # half width around a peak's circle, of its radius: a ring tilted by 40 deg is 0.77 to 1
_PEAKS = 32  # of the Hough transform whose candidates make triples
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
    max_fits: int = 12  # a ring that is found has seldom needed more than three
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
    max_impostors: float = 8e-4  # expected among the members of a ring, see `chance` Eq. (2)
    max_impostors_with_prior: float = 2e-3
    brightness: BrightnessSettings = field(default_factory=BrightnessSettings)
    code: CodeSettings = field(default_factory=CodeSettings)

    def __post_init__(self) -> None:
        accidents = [each.name for each in fields(self) if each.name.startswith(("max_false_rings", "max_impostors"))]
        check_numbers("identify", self, zero=("sigma_px", "ring_sigma"), infinite=accidents)
        least, most = self.radius_range_px
        if not least < most:
            raise DockairError("identify.radius_range_px", expected="from a smaller to a larger", got=(least, most))


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Candidates:
    """What may be LEDs."""

    points: Array  #: (n, 2) undistorted [px]
    sigma_px: float  #: of a coordinate
    brightness: BrightnessModel | None = None  #: None: it says nothing

    def likelihood_ratios(self, rings: NDArray[np.int64]) -> tuple[Array, Array]:
        """Eqs. (1) and (2) of `brightness` for hypotheses (m, 8): 1 where nothing is known."""
        if self.brightness is None:
            return np.ones(len(rings)), np.ones(rings.shape)
        return self.brightness.likelihood_ratios(rings)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class ScoredFit:
    """A fit and what chance says of it."""

    log10_false_rings: float  #: Eq. (1) of `chance` over Eq. (1) of `brightness`
    odds: Array  #: (8,) that a slot's candidate is an impostor, Eq. (2) of `chance` over Eq. (2) of `brightness`
    fit: RingFit


def ring_fits(
    candidates: Candidates,
    method: str,
    prior: RingPrior,
    camera: Camera,
    settings: IdentifySettings,
    most_false_rings: float,
) -> list[ScoredFit]:
    """Different fits with at least four LEDs, the least accidental first.

    Args:
        candidates: blobs.
        method: of METHODS.
        prior: gates.
        camera: its focal length and principal point.
        settings: of the identification.
        most_false_rings: expected accidental rings above which no ring is believed.
    """
    octagons = _octagons(candidates, method, prior, camera, settings)
    hypotheses, hopeless = _ranked(candidates, octagons, most_false_rings, settings)
    scored: list[ScoredFit] = []
    fits = doubtful = whole = 0
    believed = False
    while len(hypotheses) and fits < settings.max_fits and doubtful < _HOPELESS and not (believed and hopeless[0]):
        fits, doubtful = fits + 1, doubtful + int(hopeless[0])
        fit = _fit(candidates, hypotheses[0], camera, settings)
        different = not any(_is_contained(one.fit.candidate, fit.candidate) for one in scored)
        if fit.count >= MIN_LEDS and different and fit.tilt_rad <= settings.max_tilt_rad:
            scored.append(_scored(candidates, fit, octagons, settings))
            if scored[-1].log10_false_rings <= math.log10(most_false_rings):
                believed = True
                whole += int(fit.count == SLOTS and prior.allows(fit.centre_px, fit.radius_px))
                if whole == 2 and not prior.prefers:
                    break  # neither can be the other less well seen, nor part of a third
        # a hypothesis with an impostor may lose the wrong LEDs in its fit: parts of it still get their own
        size = (hypotheses >= 0).sum(axis=1)
        repeated = _contained(hypotheses[0], hypotheses) & (size == size[0])
        keep = ~(repeated | _contained(fit.candidate, hypotheses))
        hypotheses, hopeless = hypotheses[keep], hopeless[keep]
    return sorted(scored, key=lambda one: (one.log10_false_rings, one.fit.rms_px))


def _fit(candidates: Candidates, hypothesis: NDArray[np.int64], camera: Camera, settings: IdentifySettings) -> RingFit:
    return fit_ring(
        candidates.points, hypothesis, camera.focal_length_px, camera.principal_point_px,
        tolerance_px=settings.tolerance_sigmas * candidates.sigma_px,
        tolerance_per_radius=settings.tolerance_sigmas * settings.ring_sigma,
        max_tilt_rad=settings.max_tilt_rad,
    )  # fmt: skip


def _octagons(
    candidates: Candidates, method: str, prior: RingPrior, camera: Camera, settings: IdentifySettings
) -> Octagons:
    """What the method's triples suggest."""
    spread, points = _EXTRAPOLATION * settings.tolerance_sigmas, candidates.points
    return find_octagons(
        points, _triples_of(points, method, prior),
        ALL_PATTERNS if len(points) <= settings.few_candidates else RIGHT_ANGLES,
        focal_length_px=camera.focal_length_px, principal_point_px=camera.principal_point_px,
        radius_range_px=prior.radius_range_px, centre_gate=prior.gate, roll_gate=prior.roll_gate,
        min_axis_ratio=float(np.cos(settings.max_tilt_rad)),
        tolerance_px=max(1.0, spread * candidates.sigma_px), tolerance_per_radius=spread * settings.ring_sigma,
    )  # fmt: skip


def _scored(candidates: Candidates, fit: RingFit, octagons: Octagons, settings: IdentifySettings) -> ScoredFit:
    accident, impostor = densities_px2(candidates.points, fit)
    p = accident * np.pi * fit.tolerance_px**2
    likelier, of_each = candidates.likelihood_ratios(fit.candidate[None])
    rings = float(log10_false_rings(_tested(octagons, fit.count), fit.count, p))
    return ScoredFit(
        log10_false_rings=rings - max(math.log10(likelier[0]), 0.0),
        odds=member_odds(candidates.points, fit, impostor, settings.tolerance_sigmas) / of_each[0],
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


@njit(cache=True)
def _is_contained(larger, smaller):  # type: ignore[no-untyped-def]
    for turn in range(SLOTS):
        same = True
        for s in range(SLOTS):
            same = same and (smaller[s] < 0 or smaller[s] == larger[(s + turn) % SLOTS])
        if same:
            return True
    return False


@njit(cache=True)
def _contained(larger, smaller):  # type: ignore[no-untyped-def]
    """(m,) whether every LED of a hypothesis (m, 8) has the same place in the larger one, up to the symmetry."""
    inside = np.zeros(len(smaller), np.bool_)
    for row in range(len(smaller)):
        inside[row] = _is_contained(larger, smaller[row])
    return inside


def _triples_of(points: Array, method: str, prior: RingPrior) -> NDArray[np.int64]:
    """(m, 3) triples of candidates that the method proposes."""
    if method == "three_point":
        return all_triples(len(points))
    density = len(points) / box_area_px2(points)
    peaks = find_circles(
        points, radius_row(*prior.radius_range_px), centre_gate=prior.gate, peaks=_PEAKS, clutter_px2=density
    )
    return triples_near(points, peaks, _HOUGH_BAND)


def _tested(octagons: Octagons, count: NDArray[np.int64] | int) -> NDArray[np.int64]:
    """N of a ring: no five LEDs without three at right angles, so that only these hypotheses can bring it forth."""
    return np.where(np.asarray(count) > MIN_LEDS, octagons.tested_right_angles, octagons.tested)


@njit(cache=True)
def _keys(candidate):  # type: ignore[no-untyped-def]
    """(m,) hash of who is next to whom in hypotheses (m, 8): the same for those alike up to the ring's symmetry."""
    keys, mixed = np.zeros(len(candidate), np.uint64), np.empty(SLOTS, np.uint64)
    for row in range(len(candidate)):
        for s in range(SLOTS):
            x = np.uint64(candidate[row, s] + 2) * np.uint64(0x9E3779B97F4A7C15)
            mixed[s] = (x ^ (x >> np.uint64(29))) * np.uint64(0xBF58476D1CE4E5B9)
        for s in range(SLOTS):
            keys[row] += mixed[s] * (mixed[s - 1] >> np.uint64(17))
    return keys


def _ranked(
    candidates: Candidates, octagons: Octagons, most_false_rings: float, settings: IdentifySettings
) -> tuple[NDArray[np.int64], NDArray[np.bool_]]:
    """(m, 8) hypotheses, the least accidental first, the more trusted circle first among equals.

    Beside them (m,) whether a ring of no more LEDs is too likely an accident even where clutter is not crowded.
    """
    if not len(octagons.count):
        return octagons.candidate, np.empty(0, np.bool_)
    points = candidates.points
    area = box_area_px2(points)
    p = len(points) * np.pi * octagons.tolerance_px**2 / area
    accident = np.round((octagons.count - 3) * np.log(np.clip(p, 1e-12, 0.5)), 6)
    best = np.argsort(accident, kind="stable")
    best = best[np.sort(np.unique(_keys(octagons.candidate[best]), return_index=True)[1])][:_KEPT]
    likelier = np.maximum(candidates.likelihood_ratios(octagons.candidate[best])[0], 1.0)
    centres, radii = circles_through(points, octagons.triple[best])
    trusted = trust(centres, radii, cap_px=RADIUS_GATE * float(np.median(radii)))
    order = np.lexsort((-trusted, accident[best] - np.log(likelier)))
    best, likelier = best[order], likelier[order]
    count, radius = octagons.count[best], octagons.radius_px[best]
    t2 = settings.tolerance_sigmas**2 * (candidates.sigma_px**2 + (settings.ring_sigma * radius) ** 2)
    p = max(len(points) - 3, 1) * np.pi * t2 / area
    rings = log10_false_rings(_tested(octagons, count), count, p) - np.log10(likelier)
    hopeless = rings > np.log10(most_false_rings)
    order = np.argsort(hopeless, kind="stable")
    return octagons.candidate[best[order]], hopeless[order]
