"""What an identification says."""

from dataclasses import dataclass
from enum import Enum

import numpy as np
from numpy.typing import NDArray

from dockair.nav.identify.ellipse import Ellipse
from dockair.nav.identify.perspective import SLOTS
from dockair.rotations import Array


class IdentificationStatus(Enum):
    """Outcome of an identification."""

    FOUND = "found"
    AMBIGUOUS = "ambiguous"  #: several rings, or a ring whose numbers the roll prior cannot settle
    NOT_FOUND = "not found"


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Identification:
    """The ring among the candidates. Without a ring `members` is empty and positions are NaN."""

    status: IdentificationStatus
    members: NDArray[np.int64]  #: (m,) indices of the LEDs among the candidates
    led_numbers: NDArray[np.int64]  #: (m,) 0-7, see `ring`; -1 when AMBIGUOUS
    centre_px: Array  #: (2,) image of the ring's centre (not the ellipse's centre)
    radius_px: float  #: the radius a frontal ring would have at the centre's depth
    roll_rad: float  #: of LED 0 in the image; NaN when AMBIGUOUS
    led_pixels_px: Array  #: (8, 2) where each numbered LED is or, hidden, should be
    ellipse: Ellipse | None  #: through the LEDs; None where a prediction named them, and without a ring
    rms_px: float  #: of the fit's residuals
    absolute: bool = False  #: whether numbers are the sheet's (by prior or code), not only up to the ring's symmetry


def nothing(status: IdentificationStatus) -> Identification:
    """An identification without a ring."""
    empty = np.empty(0, np.int64)
    return Identification(
        status=status, members=empty, led_numbers=empty, centre_px=np.full(2, np.nan), radius_px=np.nan,
        roll_rad=np.nan, led_pixels_px=np.full((SLOTS, 2), np.nan), ellipse=None, rms_px=np.nan,
    )  # fmt: skip
