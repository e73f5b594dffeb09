"""The ring of a track: blobs that stand where a prediction has the LEDs are named by it, without a search.

Predicted places are shifted by the median of what the nearest blobs are off; the blob nearest to a place, if near
enough, is that LED. The exact image is fitted to them (`perspective`), and they are the ring if it passes all that
`ring`, given the same prediction, asks of one. What takes time to count is replaced by bounds on the safe side:

    N <= 2 . 21 . (n over 3)   hypotheses of n blobs, for Eq. (1) of `chance`                            (1)
    L >= 1,   L_i >= eps       for Eqs. (1) and (2) of `brightness`; L_i is only counted where eps is not enough  (2)

A rival would have as many LEDs, or share fewer than three with this ring. It would be of the predicted shape, and its
places within what `ring` allows of shift, scale and roll from the predicted ones; so it needs two blobs that near which
are no members, or one in a member's place. Where there are such, or anything else is in doubt, nothing is said, and
`ring` searches.
"""

import math

import numpy as np
from numpy.typing import NDArray

from dockair.calibration import Camera
from dockair.kernels import njit
from dockair.nav.identify.brightness import brightness_model
from dockair.nav.identify.chance import log10_false_rings_of_one
from dockair.nav.identify.hypotheses import IdentifySettings
from dockair.nav.identify.perspective import (
    SLOTS,
    RingFit,
    distorted,
    fit_ring,
    undistorted,
    undistorted_prediction,
)
from dockair.nav.identify.result import Identification, IdentificationStatus
from dockair.rotations import Array

_LEAST_LEDS = 6  # fewer on a short arc may be another ring's as well
_MOST_BLOBS = 24  # within reach of the ring; more are a crowd, and work for the search
_FIRST_RADII = 0.25  # within which the shift is looked for: a third of the way to the next LED
_OWN_RADII = 0.05  # within which a blob is an LED after the shift, and a second one is in its place
_RIVAL_RADII = 0.2  # 8 % of scale and 2 % of shape along the radius, 8 degrees of roll and 2 % of shape across it
_MOST_SHIFT_RADII = 0.1  # five sigma of a prediction that can be followed
_PATTERNS = 42  # 2 . 21 of Eq. (1)
_NEIGHBOURHOOD_RADII, _UNSEEN, _LARGEST_EXPONENT = 1.6, 0.2, 50.0  # of `chance`
_PLACE = 2.0 * np.pi / SLOTS
_COS, _SIN = np.cos(_PLACE * np.arange(SLOTS)), np.sin(_PLACE * np.arange(SLOTS))


@njit(cache=True)
def _roll_and_radius(leds):  # type: ignore[no-untyped-def]
    """Roll and larger semi-axis of eight places (8, 2), as `prior.ring_from_leds` has them."""
    a, b, c, d = 0.0, 0.0, 0.0, 0.0
    for s in range(SLOTS):
        a -= 0.25 * leds[s, 0] * _COS[s]
        b -= 0.25 * leds[s, 0] * _SIN[s]
        c -= 0.25 * leds[s, 1] * _COS[s]
        d -= 0.25 * leds[s, 1] * _SIN[s]
    square = 0.5 * (a * a + b * b + c * c + d * d)
    return np.arctan2(c - b, a + d), np.sqrt(square + np.sqrt(max(square**2 - (a * d - b * c) ** 2, 0.0)))


@njit(cache=True)
def _nearest(points, inside, u, v, reach):  # type: ignore[no-untyped-def]
    best, found = reach * reach, -1
    for k in range(len(points)):
        if inside[k]:
            distance = (points[k, 0] - u) ** 2 + (points[k, 1] - v) ** 2
            if distance < best:
                best, found = distance, k
    return found


@njit(cache=True)
def _named(points, predicted, radius, reach, rival):  # type: ignore[no-untyped-def]
    """(8,) blob of each LED, -1 for none; whether there is no doubt; (n,) who is within reach of the ring's centre."""
    member, inside = np.full(SLOTS, -1), np.zeros(len(points), np.bool_)
    u, v = predicted[:, 0].mean(), predicted[:, 1].mean()
    for k in range(len(points)):
        inside[k] = (points[k, 0] - u) ** 2 + (points[k, 1] - v) ** 2 <= reach * reach  # false for NaN
    shift, n = np.empty((2, SLOTS)), 0
    for s in range(SLOTS):
        k = _nearest(points, inside, predicted[s, 0], predicted[s, 1], _FIRST_RADII * radius)
        if k >= 0:
            shift[0, n], shift[1, n] = points[k, 0] - predicted[s, 0], points[k, 1] - predicted[s, 1]
            n += 1
    if n < _LEAST_LEDS or inside.sum() > _MOST_BLOBS:
        return member, False, inside
    u, v = np.median(shift[0, :n]), np.median(shift[1, :n])
    for s in range(SLOTS):
        member[s] = _nearest(points, inside, predicted[s, 0] + u, predicted[s, 1] + v, _OWN_RADII * radius)
    near = 0
    for k in range(len(points)):
        if inside[k] and not (member == k).any():
            distance = np.inf
            for s in range(SLOTS):
                d = np.hypot(points[k, 0] - predicted[s, 0] - u, points[k, 1] - predicted[s, 1] - v)
                distance = min(distance, d)
            near += distance < rival
            if distance < _OWN_RADII * radius:
                near = len(points)
    return member, near < 2 and (member >= 0).sum() >= _LEAST_LEDS, inside


@njit(cache=True)
def _compared(points, member, kept, predicted, slots, centre):  # type: ignore[no-untyped-def]
    """Whether a fit to the members has kept just them, its roll, how far its centre is off, and `_shape_error`."""
    u, v = predicted[:, 0].mean(), predicted[:, 1].mean()
    off = np.hypot(centre[0] - u, centre[1] - v)
    return (kept == member).all(), _roll_and_radius(slots)[0], off, _shape_error(points, member, predicted)


@njit(cache=True)
def _shape_error(points, member, predicted):  # type: ignore[no-untyped-def]
    """Largest distance of members from the prediction moved, turned and scaled to them."""
    n = (member >= 0).sum()
    theirs, mine, i = np.empty(n, np.complex128), np.empty(n, np.complex128), 0
    for s in range(SLOTS):
        if member[s] >= 0:
            theirs[i] = points[member[s], 0] + 1j * points[member[s], 1]
            mine[i] = predicted[s, 0] + 1j * predicted[s, 1]
            i += 1
    theirs, mine = theirs - theirs.mean(), mine - mine.mean()
    similarity = (np.conj(mine) * theirs).sum() / (np.conj(mine) * mine).sum()
    return np.abs(theirs - similarity * mine).max()


@njit(cache=True)
def _chances(points, inside, member, slots, centre, radius, tolerance, sigma2):  # type: ignore[no-untyped-def]
    """Points within reach, members, clutter's p of Eq. (1) of `chance`, and Eq. (2) of each slot (8,)."""
    m, n, near = (member >= 0).sum(), 0, 0
    left, top, right, bottom = np.inf, np.inf, -np.inf, -np.inf
    for k in range(len(points)):
        if not inside[k]:
            continue
        n += 1
        left, right = min(left, points[k, 0]), max(right, points[k, 0])
        top, bottom = min(top, points[k, 1]), max(bottom, points[k, 1])
        distance2 = (points[k, 0] - centre[0]) ** 2 + (points[k, 1] - centre[1]) ** 2
        near += distance2 < (_NEIGHBOURHOOD_RADII * radius) ** 2 and not (member == k).any()
    area = max((right - left) * (bottom - top), np.pi * radius**2)
    neighbourhood = np.pi * (_NEIGHBOURHOOD_RADII * radius) ** 2
    accident = max(max(n - 3, 1) / area, near / neighbourhood)
    impostor = max((n - m) / area, (near + _UNSEEN) / neighbourhood)
    g, odds = m / (m - 3), np.zeros(SLOTS)
    for s in range(SLOTS):
        if member[s] >= 0:
            square = (points[member[s], 0] - slots[s, 0]) ** 2 + (points[member[s], 1] - slots[s, 1]) ** 2
            exponent = min(0.5 * g * square / sigma2, _LARGEST_EXPONENT)
            odds[s] = (SLOTS + 1 - m) / m * impostor * 2.0 * np.pi * sigma2 * g * np.exp(exponent)
    return n, m, accident * np.pi * tolerance**2, odds


def followed_ring(
    blobs_px: Array,
    flux: Array | None,
    predicted_px: Array,
    prediction_sigma_px: float,
    roll_rad: float | None,
    camera: Camera,
    sigma_px: float,
    settings: IdentifySettings,
) -> Identification | None:
    """Return the ring that a prediction names; None where a search has to say.

    Args:
        blobs_px: (n, 2).
        flux: (n,) of the blobs, or None.
        predicted_px: (8, 2) every LED of a ring without a code.
        prediction_sigma_px: of the predicted centre.
        roll_rad: of LED 0 where it is known better than from the prediction; None or NaN if not.
        camera: for focal length, principal point and distortion.
        sigma_px: of a blob's coordinate.
        settings: of the identification.
    """
    points, predicted_px = undistorted(blobs_px, camera), undistorted_prediction(predicted_px, camera)
    believed_rad, radius_px = _roll_and_radius(predicted_px)
    if not 5.0 * prediction_sigma_px <= _MOST_SHIFT_RADII * radius_px:
        return None
    largest_px = (1.0 + settings.radius_tolerance) * radius_px
    reach_px = 5.0 * prediction_sigma_px + 0.02 * largest_px  # as `prior` has it
    member, clear, inside = _named(
        points, predicted_px, radius_px, reach_px + 1.25 * largest_px, _RIVAL_RADII * radius_px + 2.0 * reach_px
    )
    if not clear:
        return None
    fit = fit_ring(
        points, member, camera.focal_length_px, camera.principal_point_px,
        tolerance_px=settings.tolerance_sigmas * sigma_px,
        tolerance_per_radius=settings.tolerance_sigmas * settings.ring_sigma,
        max_tilt_rad=settings.max_tilt_rad,
    )  # fmt: skip
    same, roll, off_px, shape_error_px = _compared(
        points, member, fit.candidate, predicted_px, fit.slots_px, fit.centre_px
    )
    wanted_rad = believed_rad if roll_rad is None or not math.isfinite(roll_rad) else roll_rad
    shape_px = settings.predicted_shape_tolerance * radius_px + settings.predicted_shape_sigmas * sigma_px
    if not (
        same
        and fit.tilt_rad <= settings.max_tilt_rad
        and abs(fit.radius_px - radius_px) <= settings.predicted_radius_tolerance * radius_px
        and off_px <= reach_px
        and abs(math.remainder(roll - wanted_rad, 2.0 * math.pi)) <= settings.predicted_roll_tolerance_rad
        and shape_error_px <= shape_px
        and _is_no_accident(points, flux, inside, fit, settings)
    ):
        return None
    numbers = np.flatnonzero(member >= 0)
    return Identification(
        status=IdentificationStatus.FOUND,
        members=member[numbers],
        led_numbers=numbers,
        centre_px=distorted(fit.centre_px[None], camera)[0],
        radius_px=fit.radius_px,
        roll_rad=roll,
        led_pixels_px=distorted(fit.slots_px, camera),
        ellipse=None,
        rms_px=fit.rms_px,
        absolute=True,
    )


def _is_no_accident(
    points: Array, flux: Array | None, inside: NDArray[np.bool_], fit: RingFit, settings: IdentifySettings
) -> bool:
    """Whether Eqs. (1) and (2) let the ring pass."""
    spread2 = (fit.tolerance_px / settings.tolerance_sigmas) ** 2
    n, m, p, odds = _chances(
        points, inside, fit.candidate, fit.slots_px, fit.centre_px, fit.radius_px, fit.tolerance_px, spread2
    )
    rings = log10_false_rings_of_one(_PATTERNS * math.comb(n, 3), m, p)
    if rings > math.log10(settings.max_false_rings_predicted):
        return False
    most, expected = settings.max_impostors_with_prior, float(odds.sum())
    if flux is None or expected <= settings.brightness.outliers * most:
        return expected <= most
    among = np.where(fit.candidate >= 0, np.cumsum(inside)[fit.candidate] - 1, -1)  # places among those within reach
    likelier = brightness_model(flux[inside], settings.brightness).likelihood_ratios(among[None])[1]
    return bool((odds / likelier[0]).sum() <= most)
