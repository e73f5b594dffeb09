"""A coded ring's numbering without a prior: an LED off its 45 degree place, or LEDs of unlike brightness.

The ring is found by the LEDs at their places. For each of the eight numberings the sheet then says where the displaced
LEDs must be and how bright each LED is:

    places:      no displaced LED's own place may be filled, and its true one should be; most filled wins
    brightness:  chi^2 = sum (ln f_i - ln b_k(i) - mean)^2 / sigma^2; least wins, by a margin               (1)

with fluxes f, the sheet's relative brightnesses b and sigma for the LEDs' bins (2:1 is 0.2), pattern and clipping. The
mean takes out range and exposure. A numbering is settled when one is left by both; chance hits of displaced LEDs are
weighed by the clutter about (`chance`).

Left out: flux is not corrected for the pattern's fall with the angle, which all LEDs share but for perspective.
"""

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from dockair.calibration import LedRing
from dockair.errors import check_numbers
from dockair.nav.identify.perspective import SLOTS, RingFit
from dockair.rotations import Array

_PLACE = 2.0 * np.pi / SLOTS
_DISPLACED_RAD = np.deg2rad(1.0)  # less, and an LED counts as in its place
_ROUNDING = 1e-9  # of angles and logarithms: two LEDs that are off alike differ by this at most


@dataclass(frozen=True, slots=True, kw_only=True)
class CodeSettings:
    """Settings of the code."""

    brightness_sigma: float = 0.35  # of ln f
    brightness_margin: float = 6.0  # of Eq. (1) between the best numbering and any other that is ruled out
    reach: float = 2.0  # tolerances of the fit within which a displaced LED is looked for: its place is extrapolated
    max_chance_hits: float = 3e-3  # displaced LEDs that clutter may feign

    def __post_init__(self) -> None:
        check_numbers("identify.code", self)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Code:
    """What the sheet says beside eight equal LEDs at 45 degrees."""

    offset_rad: Array  #: (8,) of each LED from its place, 0 when it is there
    log_brightness: Array | None  #: (8,)
    settings: CodeSettings
    displaced: NDArray[np.int64] = field(init=False)  #: numbers of the LEDs off their place
    says_something: bool = field(init=False)  #: whether there is a code at all

    def __post_init__(self) -> None:
        displaced = np.flatnonzero(self.offset_rad)
        object.__setattr__(self, "displaced", displaced)
        object.__setattr__(self, "says_something", len(displaced) > 0 or self.log_brightness is not None)

    @property
    def is_the_same_turned(self) -> bool:
        """Whether some other numbering has the same code, so that it cannot settle the numbers."""
        marks = [self.offset_rad] if self.log_brightness is None else [self.offset_rad, self.log_brightness]
        return any(
            all(np.allclose(np.roll(m, turn), m, rtol=0.0, atol=_ROUNDING) for m in marks) for turn in range(1, SLOTS)
        )


def code_of(ring: LedRing, settings: CodeSettings) -> Code:
    """The code of a sheet of eight LEDs."""
    offset = ring.angles_rad - _PLACE * np.arange(SLOTS)
    bright = None if ring.brightness is None else np.log(np.asarray(ring.brightness, dtype=float))
    if bright is not None and np.ptp(bright) == 0.0:
        bright = None
    return Code(
        offset_rad=np.where(np.abs(offset) > _DISPLACED_RAD, offset, 0.0), log_brightness=bright, settings=settings
    )


def displaced_leds(points: Array, fit: RingFit, code: Code, slot_of_led_0: int) -> dict[int, int]:
    """Candidate of each displaced LED that is seen, by number, if LED 0 is in this slot: the nearest pairs first."""
    places = fit.image_px(_PLACE * (slot_of_led_0 + code.displaced) + code.offset_rad[code.displaced])
    distance = np.hypot(*(points - places[:, None]).transpose(2, 0, 1))
    distance[:, fit.candidate[fit.candidate >= 0]] = np.inf
    found = {}
    for _ in code.displaced:
        led, nearest = np.unravel_index(np.argmin(distance), distance.shape)
        if not distance[led, nearest] <= code.settings.reach * fit.tolerance_px:
            break
        found[int(code.displaced[led])] = int(nearest)
        distance[led], distance[:, nearest] = np.inf, np.inf  # no candidate is two LEDs
    return found


def possible_slots(
    points: Array, brightness: Array | None, fit: RingFit, code: Code, density_px2: float
) -> NDArray[np.int64]:
    """Slots that LED 0 may have: all eight when the code says nothing, one when it settles the numbering.

    Args:
        points: (n, 2) candidates, undistorted [px].
        brightness: (n,) their fluxes, any unit, or None.
        fit: the ring.
        code: of its sheet.
        density_px2: of clutter about the ring.
    """
    slots = _by_place(points, fit, code, density_px2)
    if brightness is None or code.log_brightness is None:
        return slots
    return np.intersect1d(slots, _by_brightness(np.asarray(brightness, dtype=float), fit, code.log_brightness, code))


def _by_place(points: Array, fit: RingFit, code: Code, density: float) -> NDArray[np.int64]:
    displaced = code.displaced
    every = np.arange(SLOTS)
    if not len(displaced):
        return every
    free = [j for j in every if (fit.candidate[(j + displaced) % SLOTS] < 0).all()]
    hits = np.array([len(displaced_leds(points, fit, code, int(j))) for j in free])
    chance = density * np.pi * (code.settings.reach * fit.tolerance_px) ** 2 * SLOTS * len(displaced)
    if not len(hits) or chance > code.settings.max_chance_hits:
        return np.array(free, np.int64)
    return np.asarray(np.array(free, np.int64)[hits == hits.max()])


def _by_brightness(flux: Array, fit: RingFit, log_brightness: Array, code: Code) -> NDArray[np.int64]:
    every = np.arange(SLOTS)
    filled = np.flatnonzero(fit.candidate >= 0)
    flux = flux[fit.candidate[filled]]
    usable = np.isfinite(flux) & (flux > 0.0)
    if np.count_nonzero(usable) < 2:
        return every
    slots, measured = filled[usable], np.log(flux[usable])
    residual = measured - log_brightness[(slots - every[:, None]) % SLOTS]  # a row for each slot of LED 0
    residual -= residual.mean(axis=1, keepdims=True)
    chi2 = (residual**2).sum(axis=1) / code.settings.brightness_sigma**2
    return np.asarray(every[chi2 <= chi2.min() + code.settings.brightness_margin])
