"""Numbers for the LEDs of a fitted ring: from its code, the roll prior or the convention; checked on the ellipse."""

import numpy as np
from numpy.typing import NDArray

from dockair.calibration import Camera
from dockair.nav.identify.chance import densities_px2
from dockair.nav.identify.code import Code, displaced_leds, possible_slots
from dockair.nav.identify.ellipse import MIN_POINTS, Ellipse, fit_ellipse, places_on_circle
from dockair.nav.identify.perspective import SLOTS, RingFit, distorted
from dockair.nav.identify.prior import RingPrior, ring_from_leds
from dockair.nav.identify.result import Identification, IdentificationStatus
from dockair.rotations import Array

_PLACE = 2.0 * np.pi / SLOTS


def roll_of(fit: RingFit, prior: RingPrior) -> tuple[int, float]:
    """Slot of LED 0, and how far [rad] the roll then is from the expected one (0 when none is expected)."""
    wanted = 0.0 if np.isnan(prior.roll_rad) else prior.roll_rad
    turns = (wanted - ring_from_leds(fit.slots_px)[2]) / _PLACE
    slot = int(np.round(turns))
    return slot, 0.0 if np.isnan(prior.roll_rad) else abs(turns - slot) * _PLACE


def numbered(
    points: Array,
    index: NDArray[np.int64],
    brightness: Array | None,
    fit: RingFit,
    prior: RingPrior,
    camera: Camera,
    code: Code,
    roll_tolerance_rad: float,
) -> Identification:
    """Number the LEDs of a fit.

    Args:
        points: (n, 2) candidates, undistorted [px].
        index: (n,) of them among the caller's.
        brightness: (n,) their fluxes, or None.
        fit: the ring.
        prior: whose roll counts, if it has one.
        camera: for its distortion.
        code: of the ring's sheet.
        roll_tolerance_rad: by which the roll may differ from the prior's.
    """
    filled = np.flatnonzero(fit.candidate >= 0)
    regular = points[fit.candidate[filled]]
    # with five LEDs on a short arc the ellipse is loose; the fit's own eight places always make one
    ellipse = fit_ellipse(regular) if len(filled) > MIN_POINTS else fit_ellipse(fit.slots_px)
    slot, absolute, certain = _slot_of_led_0(points, brightness, fit, prior, code, roll_tolerance_rad)
    certain = certain and _ellipse_agrees(regular, filled, ellipse)
    numbers, members = (filled - slot) % SLOTS, fit.candidate[filled]
    if absolute and len(code.displaced):
        others = displaced_leds(points, fit, code, slot)
        numbers = np.concatenate([numbers, np.array(list(others), np.int64)])
        members = np.concatenate([members, np.array(list(others.values()), np.int64)])
    order = np.argsort(numbers)
    roll = ring_from_leds(np.roll(fit.slots_px, -slot, axis=0))[2]
    angle = _PLACE * (slot + np.arange(SLOTS)) + (code.offset_rad if absolute else 0.0)
    return Identification(
        status=IdentificationStatus.FOUND if certain else IdentificationStatus.AMBIGUOUS,
        members=index[members[order]],
        led_numbers=numbers[order] if certain else np.full(len(numbers), -1),
        centre_px=distorted(fit.centre_px[None], camera)[0],
        radius_px=fit.radius_px,
        roll_rad=roll if certain else np.nan,
        led_pixels_px=distorted(fit.image_px(angle), camera) if certain else np.full((SLOTS, 2), np.nan),
        ellipse=ellipse,
        rms_px=fit.rms_px,
        absolute=absolute and certain,
    )


def _slot_of_led_0(
    points: Array, brightness: Array | None, fit: RingFit, prior: RingPrior, code: Code, roll_tolerance_rad: float
) -> tuple[int, bool, bool]:
    """Slot of LED 0, whether that numbering is the sheet's, and whether nothing speaks against it."""
    slot, roll_error = roll_of(fit, prior)
    expected = not np.isnan(prior.roll_rad)
    if not code.says_something:
        return slot, expected, roll_error <= roll_tolerance_rad
    possible = possible_slots(points, brightness, fit, code, densities_px2(points, fit)[1])
    if expected:
        return slot, True, roll_error <= roll_tolerance_rad and slot % SLOTS in possible
    if len(possible) == 1:
        return int(possible[0]), True, True
    return slot, False, len(possible) > 0


def _ellipse_agrees(points: Array, slots: NDArray[np.int64], ellipse: Ellipse | None) -> bool:
    """Whether the places on the ellipse's circle have the same order and gaps as the fit's slots."""
    if ellipse is None:
        return False
    places = places_on_circle(ellipse.to_circle(points), SLOTS).slot
    return bool(((places - slots) % SLOTS == (places[0] - slots[0]) % SLOTS).all())
