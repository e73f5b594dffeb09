"""What the two controllers have in common: the drogue as they see it, what is wanted, and the command's rate."""

from dataclasses import dataclass
from typing import Protocol

from dockair.rotations import Array


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Sight:
    """The drogue in stabilised axes, forward, left, up."""

    place_m: Array  #: (3,) ring centre from the probe's tip
    rate_m_s: Array  #: (3,) its rate
    push_m_s2: Array  #: (n, 3) what the bow wave does to it now and at the controller's `looks_ahead_s`


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Wanted:
    """Where to be: at a distance, or closing."""

    distance_m: float | None  #: tip behind the ring centre; None: close
    speed_m_s: float  #: closing, or the most to go to the distance with
    aim_m: Array  #: (2,) where the tip is to go, off the ring centre, left and up in stabilised axes
    patient: bool = False  #: across, with a share of the limits
    must_follow: bool = False  #: a swing, too, that is more than the receiver can bear
    to_contact_s: float | None = None  #: until the tip is at the place, where it can no longer be called back


class Controller(Protocol):
    """Follows the drogue."""

    def observe(self, sight: Sight | None, change_m_s: Array) -> None:
        """Take note of what is seen and felt, once a control tick.

        Args:
            sight: the drogue, None when it is not seen.
            change_m_s: (3,) of the tip's velocity since the last tick, stabilised axes; NaN where it was not felt.
        """
        ...

    def given(self, velocity_m_s: Array, acceleration_m_s2: Array) -> None:
        """Take note of velocity and acceleration (3,) commanded for the next period, in stabilised axes."""
        ...

    @property
    def looks_ahead_s(self) -> Array:
        """(n,) times from now, the first 0, at which it wants to know the push of the bow wave."""
        ...

    @property
    def drift_m_s(self) -> Array:
        """(3,) velocity that keeps company with the drogue, its swing apart."""
        ...

    @property
    def steady_drift_m_s(self) -> Array:
        """(3,) the same where nothing new is learnt for seconds, with the drogue on the probe: no surge of the reel."""
        ...

    @property
    def middle_m(self) -> Array:
        """(3,) from the probe's tip to the middle of the drogue's swing."""
        ...

    @property
    def bears_the_gusts(self) -> bool:
        """Whether swings like those of the last half minute can be followed at all, for an approach to be begun."""
        ...

    @property
    def unrest(self) -> float:
        """The drogue's swing of now, of the largest with which the last metre may be begun."""
        ...

    def error_to_come(self, aim_m: Array) -> Array:
        """(2,) from the tip to where it is to go, left and up [m], when what has been commanded has been flown.

        Args:
            aim_m: (2,) that of `Wanted`.
        """
        ...

    def rate(self, u: Array, wanted: Wanted) -> Array:
        """(3,) du/dt of the commanded velocity [m/s^2], stabilised axes forward, left, up.

        Args:
            u: (3,) velocity commanded now, beyond the trim flight path [m/s], in the same axes.
            wanted: where to be.
        """
        ...


def clipped(value: float, limit: float) -> float:
    """Return the value, or the limit with its sign."""
    return min(max(value, -limit), limit)
