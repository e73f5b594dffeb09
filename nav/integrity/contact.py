"""Whether the last frame's pose is good enough to push the probe into the drogue: a claim with its reasons.

The levels are those of one frame; a belief that many frames made lies off it by some centimetres, and what is known of
it is `ProtectionLevels.about` that offset. Of a belief that has coasted since they grow (`coasting`). Errors common to
all frames (mounting, focal length) are not in the levels: the limits leave room for them.
"""

from dataclasses import dataclass
from enum import Enum

from dockair.errors import check_numbers
from dockair.nav.integrity.levels import ProtectionLevels
from dockair.nav.integrity.monitor import Integrity, IntegrityStatus


class Doubt(Enum):
    """Why the claim is not made."""

    NO_POSE = "no pose"
    NOT_TESTED = "too few LEDs to test"
    INCONSISTENT = "LEDs contradict one another or the belief"
    RANGE = "protection level of range above its limit"
    LATERAL = "protection level across above its limit"
    AGE = "frame too old"


_DOUBT_OF = {
    IntegrityStatus.NO_POSE: Doubt.NO_POSE,
    IntegrityStatus.NOT_ENOUGH: Doubt.NOT_TESTED,
    IntegrityStatus.INCONSISTENT: Doubt.INCONSISTENT,
}


@dataclass(frozen=True, slots=True, kw_only=True)
class ContactLimits:
    """Alert limits.

    Raises:
        DockairError: a limit that is not positive.
    """

    lateral_m: float = 0.10  # the basket takes the tip within 0.15 m; 0.05 m is left for steering and calibration
    #: The tip latches 0.30 m ahead of the ring's plane and is taken to be there 0.05 m before. An error of 0.25 m would
    #: have it pushed on outside the basket; 0.10 m of that is left for a drogue that gives way, and for calibration.
    range_m: float = 0.15
    #: Of a belief from a pose that the filter's gate refused: a drogue struck at 1.5 m/s is 30 mm off by the first
    #: frame, a belief whose frames are refused for hundredths of a pixel was off by 3 and 6 mm.
    refused_m: float = 0.02
    age_s: float = 0.4  # what the belief foretells was measured for 0.3 s; until then `coasting` widens the levels

    def __post_init__(self) -> None:
        check_numbers("contact", self, infinite=("lateral_m", "range_m", "refused_m", "age_s"))


@dataclass(frozen=True, slots=True, kw_only=True)
class ContactClaim:
    """The answer."""

    doubts: tuple[Doubt, ...]  #: every reason against; none when usable
    levels: ProtectionLevels  #: that were held against the limits

    @property
    def usable(self) -> bool:
        """Whether contact may be flown on it."""
        return not self.doubts


def usable_for_contact(
    integrity: Integrity,
    age_s: float,
    limits: ContactLimits | None = None,
    *,
    levels: ProtectionLevels | None = None,
    in_basket: bool = False,
    contradicted: bool = False,
) -> ContactClaim:
    """Return whether the fault test passed, both protection levels are below their limits, and the frame is recent.

    Args:
        integrity: of the last frame that gave a pose.
        age_s: how long ago that was; NaN when there was none yet.
        limits: alert limits.
        levels: those of another estimate, `integrity.levels.about(its offset)`, or of a later one,
            `CoastingError.added`; the frame's own if not given.
        in_basket: the tip has entered the basket, claimed usable then, and not left it: the basket holds it sideways,
            so that the level across is not asked, and the probe strikes the drogue there, so that a frame which
            contradicts the belief is to be expected.
        contradicted: a newer frame was refused: its LEDs contradict one another or the belief.
    """
    limits, levels = limits or ContactLimits(), levels or integrity.levels
    doubts = []
    if integrity.status in _DOUBT_OF:
        doubts.append(_DOUBT_OF[integrity.status])
    else:
        if not levels.range_m <= limits.range_m:
            doubts.append(Doubt.RANGE)
        if not (in_basket or levels.lateral_m <= limits.lateral_m):
            doubts.append(Doubt.LATERAL)
    if contradicted and not in_basket and Doubt.INCONSISTENT not in doubts:
        doubts.append(Doubt.INCONSISTENT)
    if not 0.0 <= age_s <= limits.age_s:
        doubts.append(Doubt.AGE)
    return ContactClaim(doubts=tuple(doubts), levels=levels)
