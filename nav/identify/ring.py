"""Which blobs are the ring, and which LED is which: `FOUND`, `AMBIGUOUS` or `NOT_FOUND`, never a guess.

    candidates ► prior gate ► triples (three-point circles | Hough peaks) ► octagon look-up ► exact fit ► decision
                                                                                   ellipse ► numbering ◄ roll

Where each LED is expected, and what is seen leaves no doubt, `followed` names them at a tenth of the cost. Otherwise
`hypotheses` proposes rings and fits them, `chance` says how likely each is an accident and how many impostors it may
hold, `brightness` how much less likely if its blobs are about equally bright; both must be less than the settings
allow. Two rings that both pass and are not the same are `AMBIGUOUS`, so is
one whose roll prior falls between two numberings, one whose code contradicts it, one that may be an accident, and one
so crowded that a blob may pass for a hidden LED (the most doubtful member is left out if that is enough). No ring of at
least four LEDs is `NOT_FOUND`; four LEDs without a prior are seldom more than an accident.

The ring looks the same every 45 degrees. With a prior (the roll of LED 0, or where each LED is expected) or a coded
ring (`code`) the LEDs get their numbers; without, LED 0 is the LED nearest to the left (-u) of the centre, and numbers
are right up to that symmetry (`absolute` says which). Roll is the angle of LED 0 in the image seen from the centre,
from left (0) toward up (pi/2), averaged over the LEDs less their 45 degrees each: without tilt the drogue's roll.

The order in which candidates come does not matter. Cost is bounded: at most `max_candidates` (nearest to the prior's
circle where it has a radius, too, else the brightest, else the uppermost), all their triples, beyond `few_candidates`
in three patterns of slots only, and `max_fits` exact fits; twice that when a prediction fails and the ring is looked
for as without.
"""

from typing import TypeGuard

import numpy as np
from numpy.typing import NDArray

from dockair.calibration import Camera, LedRing
from dockair.errors import DockairError
from dockair.nav.identify.brightness import brightness_model
from dockair.nav.identify.code import Code, code_of
from dockair.nav.identify.followed import followed_ring
from dockair.nav.identify.hypotheses import (
    METHODS,
    MIN_LEDS,
    Candidates,
    IdentifySettings,
    ScoredFit,
    ring_fits,
    without_impostors,
)
from dockair.nav.identify.numbering import numbered, roll_of
from dockair.nav.identify.perspective import SLOTS, RingFit, undistorted
from dockair.nav.identify.prior import ANYWHERE_PX, RingPrior, make_prior
from dockair.nav.identify.result import Identification, IdentificationStatus, nothing
from dockair.rotations import Array
from dockair.vectors import is_finite

__all__ = ["METHODS", "Identification", "IdentificationStatus", "IdentifySettings", "identify"]

_SETTINGS, _CAMERA, _RING = IdentifySettings(), Camera(), LedRing()  # when none are given


def identify(
    centroids_px: Array,
    method: str = "three_point",
    settings: IdentifySettings | None = None,
    *,
    camera: Camera | None = None,
    ring: LedRing | None = None,
    code: Code | None = None,
    sigma_px: float | None = None,
    brightness: Array | None = None,
    expected_centre_px: Array | None = None,
    expected_radius_px: float | None = None,
    expected_roll_rad: float | None = None,
    expected_led_px: Array | None = None,
    expected_sigma_px: float | None = None,
) -> Identification:
    """Find the ring among candidates and number its LEDs.

    Args:
        centroids_px: (n, 2) candidates (u, v), full-frame pixels; rows that are not finite, or beyond any frame,
            are passed over.
        method: "three_point" or "circle_hough".
        settings: None for the defaults.
        camera: for its focal length, principal point and distortion; None for the default one.
        ring: for its code, if it has one; None for the default one, which has none.
        code: the ring's, where it is at hand; None reads it off the ring.
        sigma_px: of a candidate's coordinate, in place of the settings'.
        brightness: (n,) fluxes, any unit, NaN where unknown; tells LEDs from clutter, decides who stays when there are
            too many candidates and no prior, and reads the code of a ring that has one.
        expected_centre_px: (2,) where the ring's centre should be.
        expected_radius_px: what its radius should be.
        expected_roll_rad: what its roll should be, as the module defines it.
        expected_led_px: (8, 2) where each LED should be; stands for the three above where they are not given.
        expected_sigma_px: standard deviation of the expected centre.

    Raises:
        DockairError: unknown method, wrong shapes, a ring of other than eight LEDs.
    """
    settings, camera, ring = settings or _SETTINGS, camera or _CAMERA, ring or _RING
    points, flux = _checked(centroids_px, brightness, method, ring)
    sigma_px = settings.sigma_px if sigma_px is None else sigma_px
    code = code_of(ring, settings.code) if code is None else code
    nowhere_else = expected_centre_px is None and expected_radius_px is None and not code.says_something
    if nowhere_else and expected_sigma_px is not None and _is_prediction(expected_led_px):
        known_flux = None if brightness is None else flux
        followed = followed_ring(
            points, known_flux, expected_led_px, expected_sigma_px, expected_roll_rad, camera, sigma_px, settings
        )
        if followed is not None:
            return followed
    prior = make_prior(
        settings.radius_range_px, settings.centre_tolerance_radii, settings.radius_tolerance,
        expected_centre_px, expected_radius_px, expected_roll_rad, expected_led_px, expected_sigma_px, ring.angles_rad,
        camera,
    )  # fmt: skip
    points = undistorted(points, camera)
    index = _candidates(points, prior, flux, settings.max_candidates)
    if len(index) < MIN_LEDS:
        return nothing(IdentificationStatus.NOT_FOUND)
    spread = 0.0 if code.log_brightness is None else float(code.log_brightness.std())
    candidates = Candidates(
        points=points[index], sigma_px=sigma_px,
        brightness=None if brightness is None else brightness_model(flux[index], settings.brightness, spread),
    )  # fmt: skip
    status, fit = _found(candidates, method, prior, camera, settings)
    if fit is None:
        return nothing(status)
    known_flux = None if brightness is None else flux[index]
    return numbered(candidates.points, index, known_flux, fit, prior, camera, code, settings.roll_tolerance_rad)


def _checked(centroids_px: Array, brightness: Array | None, method: str, ring: LedRing) -> tuple[Array, Array]:
    """Candidates (n, 2) and their fluxes (n,), NaN where there are none; refuses what is no such thing."""
    if ring.count != SLOTS:
        raise DockairError("identify.ring", expected=f"a ring of {SLOTS} LEDs", got=ring.count)
    if method not in METHODS:
        raise DockairError("identify.method", expected="a method", got=method, exists=METHODS)
    points = np.asarray(centroids_px, dtype=float)
    if points.ndim != 2 or points.shape[1] != 2:
        raise DockairError("identify.centroids_px", expected="an array of shape (n, 2)", got=points.shape)
    flux = np.full(len(points), np.nan) if brightness is None else np.asarray(brightness, dtype=float)
    if flux.shape != (len(points),):
        raise DockairError("identify.brightness", expected=f"an array of shape ({len(points)},)", got=flux.shape)
    return points, flux


def _is_prediction(led_px: Array | None) -> TypeGuard[Array]:
    """Whether it says where every LED is."""
    return led_px is not None and np.shape(led_px) == (SLOTS, 2) and is_finite(led_px)


def _found(
    candidates: Candidates, method: str, prior: RingPrior, camera: Camera, settings: IdentifySettings
) -> tuple[IdentificationStatus, RingFit | None]:
    """The ring where a prediction has it, or else anywhere that the prior allows."""
    status, fit = IdentificationStatus.NOT_FOUND, None
    if prior.prediction_px is not None:
        tight = prior.tightened(settings.predicted_radius_tolerance, settings.predicted_roll_tolerance_rad)
        fits = ring_fits(candidates, method, tight, camera, settings, settings.max_false_rings_predicted)
        shape = settings.predicted_shape_tolerance * tight.expected_radius_px
        shape += settings.predicted_shape_sigmas * candidates.sigma_px
        fits = [one for one in fits if _shape_error(candidates.points, one.fit, tight) <= shape]
        status, fit = _decide(fits, tight, settings.max_false_rings_predicted, settings)
    if fit is None:
        # a ring that contradicts a prediction needs as good a case as one that nothing was known of
        nominal = prior.has_centre and prior.prediction_px is None
        limit = settings.max_false_rings_with_prior if nominal else settings.max_false_rings
        fits = ring_fits(candidates, method, prior, camera, settings, limit)
        status, fit = _decide(fits, prior, limit, settings)
    return status, fit


def _candidates(points: Array, prior: RingPrior, flux: Array, most: int) -> NDArray[np.int64]:
    """Indices of the candidates, undistorted, that take part, in reading order: how they come does not matter."""
    index = np.flatnonzero((np.abs(points) < ANYWHERE_PX).all(axis=1))  # no frame is so large; false for NaN
    index = index[np.lexsort((flux[index], points[index, 0], points[index, 1]))]
    rank = -flux[index]
    if prior.has_centre:
        # perspective makes the near side of a ring larger, by at most a tenth beyond 2 m
        reach = prior.gate[2] + 1.15 * prior.radius_range_px[1]
        distance = np.hypot(*(points[index] - prior.centre_px).T)
        index, distance, rank = index[distance <= reach], distance[distance <= reach], rank[distance <= reach]
        if not np.isnan(prior.expected_radius_px):
            rank = np.abs(distance - prior.expected_radius_px)
    return index[np.sort(np.argsort(rank, kind="stable")[:most])]


def _decide(
    fits: list[ScoredFit],
    prior: RingPrior,
    most_false_rings: float,
    settings: IdentifySettings,
) -> tuple[IdentificationStatus, RingFit | None]:
    """The one ring that is no accident, if there is one."""
    expected = [one for one in fits if prior.allows(one.fit.centre_px, one.fit.radius_px)]
    if not expected:
        return IdentificationStatus.NOT_FOUND, None
    credible = [one for one in expected if one.log10_false_rings <= np.log10(most_false_rings)]
    # a ring as large and turned as expected beats one that is not; if there is none, `numbered` says AMBIGUOUS
    for is_better in (_is_close, _is_rightly_rolled):
        credible = [one for one in credible if is_better(one.fit, prior, settings)] or credible
    if not credible:
        return IdentificationStatus.AMBIGUOUS, None
    best = credible[0]
    mine = set(best.fit.candidate[best.fit.candidate >= 0].tolist())
    for rival in credible[1:]:
        theirs = set(rival.fit.candidate[rival.fit.candidate >= 0].tolist())
        # fewer LEDs, most of them the same: this ring seen less well. Anything else is another ring.
        if len(theirs) >= len(mine) or len(theirs & mine) < 3:
            return IdentificationStatus.AMBIGUOUS, None
    most = settings.max_impostors_with_prior if prior.has_centre else settings.max_impostors
    fit = without_impostors(best, most)
    return (IdentificationStatus.AMBIGUOUS, None) if fit is None else (IdentificationStatus.FOUND, fit)


def _is_close(fit: RingFit, prior: RingPrior, settings: IdentifySettings) -> bool:
    """Whether a fitted ring is nearly as large as expected; no when nothing is."""
    return abs(fit.radius_px - prior.expected_radius_px) <= settings.close_radius_tolerance * prior.expected_radius_px


def _is_rightly_rolled(fit: RingFit, prior: RingPrior, settings: IdentifySettings) -> bool:
    """Whether a fitted ring is turned as expected."""
    return roll_of(fit, prior)[1] <= settings.roll_tolerance_rad


def _shape_error(points: Array, fit: RingFit, prior: RingPrior) -> float:
    """How far [px] the LEDs depart from a prediction's shape."""
    filled = np.flatnonzero(fit.candidate >= 0)
    return prior.shape_error_px(points[fit.candidate[filled]], (filled - roll_of(fit, prior)[0]) % SLOTS)
