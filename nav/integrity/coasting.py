"""How far the drogue may be from where it was foretold while no frame comes: measured on frames that do come.

A belief without frames goes wrong by what its model of motion does not know: gusts, the bow wave. Its covariance holds
one strength of them for all weathers. So the belief is asked, again and again, where it had foretold the drogue a time
h before: the squares of the errors, per camera axis, fade with `memory_s` and begin at `sigma_m` with `prior_s`. After
a time a without frames

    sigma(a)^2 = s^2 (a/h)^3 for a <= h,   s^2 (a/h)^5 beyond                                        (1)

as by a white acceleration, and beyond as by one that itself changes at random. On flights it grew by something between
the two (docs/integrity.md), so that neither below nor beyond too little is added; an error of another age is brought to
the horizon by the other power of the two, so that s is not too small. Protection levels grow by k sigma(a), with k of
one axis along and of two across for the probability `risk`. So it is for a belief like those that were asked:
with an IMU, and with frames up to the last. Of any other (`is_of` says which) the covariance is asked, too.

Not modelled: gusts that begin in the very moment in which the camera goes out, a drogue that is struck, that s is
itself an estimate (along, the risk is up to twice the one set).
"""

from dataclasses import dataclass

import numpy as np
from scipy.stats import chi2

from dockair.errors import DockairError, check_numbers
from dockair.messages import STAMP_RESOLUTION_S
from dockair.nav.integrity.levels import ProtectionLevels
from dockair.rotations import Array

_HIGHEST_RISK = 0.5


@dataclass(frozen=True, slots=True, kw_only=True)
class CoastingSettings:
    """How the belief is asked, and how often it may be wrong.

    Raises:
        DockairError: a number that is not positive, or a risk not below 0.5.
    """

    horizon_s: float = 0.3  #: h; drop-outs of a camera that a contact is flown through are as long
    interval_s: float = 0.1  # between two questions: nearer ones have nearly the same answer
    memory_s: float = 6.0  # two periods of the drogue's swing
    sigma_m: float = 0.05  # before anything is measured: as in moderate turbulence
    prior_s: float = 0.3  # of measuring that weighs as much as that: one answer
    #: That the drogue is farther off. A frame that does not come is a fault that seldom falls in the 0.2 s in which it
    #: would matter; together with this it is as rare as `missed_detection`.
    risk: float = 1e-3

    def __post_init__(self) -> None:
        check_numbers("coasting", self)
        if not self.risk < _HIGHEST_RISK:
            raise DockairError("coasting.risk", expected="a probability, 0 to 0.5", got=self.risk)


class CoastingError:
    """What the belief has foretold wrongly so far."""

    def __init__(self, settings: CoastingSettings | None = None) -> None:
        self._settings = settings or CoastingSettings()
        self._squares, self._weight_s = np.full(3, self._settings.sigma_m**2), self._settings.prior_s
        self._factors = tuple(float(np.sqrt(chi2.isf(self._settings.risk, axes))) for axes in (1, 2))
        self._asked_s = -np.inf

    def is_of(self, frame_s: float) -> bool:
        """Whether the belief with a last frame of this stamp is like those that were asked: one of them was, lately."""
        return frame_s - self._asked_s <= self._settings.horizon_s

    def due(self, time_s: float) -> bool:
        """Whether the belief is to be asked again at a frame of this stamp."""
        return time_s - self._asked_s >= self._settings.interval_s - STAMP_RESOLUTION_S

    def take(self, error_C: Array, age_s: float, time_s: float) -> None:
        """Take where a frame shows the drogue less where it was foretold.

        Args:
            error_C: (3,) in camera axes [m]; not finite when nothing was foretold, which says nothing.
            age_s: how long before; about the horizon.
            time_s: stamp of the frame.
        """
        s = self._settings
        if not np.isfinite(error_C).all():
            return
        since_s, self._asked_s = time_s - self._asked_s, time_s
        kept_s = self._weight_s * (np.exp(-since_s / s.memory_s) if np.isfinite(since_s) else 1.0)
        weight_s = min(since_s, s.horizon_s)
        at_horizon = np.square(error_C) * _growth(s.horizon_s / age_s)  # back in time the most of Eq. (1), too
        self._weight_s = kept_s + weight_s
        self._squares = (kept_s * self._squares + weight_s * at_horizon) / self._weight_s

    def sigma_m(self, age_s: float) -> Array:
        """(3,) of Eq. (1) in camera axes."""
        return np.asarray(np.sqrt(self._squares * _growth(age_s / self._settings.horizon_s)))

    def added(self, levels: ProtectionLevels, age_s: float, believed_m: Array) -> ProtectionLevels:
        """Return protection levels of a belief that had its last frame so long ago; none promised without that.

        Args:
            levels: at the frame.
            age_s: of the frame.
            believed_m: (3,) sigmas of the belief itself in camera axes, below which nothing is promised [m].
        """
        measured_m = self.sigma_m(age_s) if age_s >= 0.0 else np.full(3, np.inf)
        along, left, up = np.maximum(measured_m, believed_m)
        return ProtectionLevels(
            range_m=levels.range_m + self._factors[0] * float(along),
            lateral_m=levels.lateral_m + self._factors[1] * float(max(left, up)),
        )


def _growth(ratio: float) -> float:
    """Variance of Eq. (1) in units of that at the horizon."""
    return ratio**3 if ratio <= 1.0 else ratio**5
