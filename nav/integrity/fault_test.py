"""The chi-square test for a bad LED: its threshold, and the least fault that it does not overlook.

J, the weighted sum of squared residuals, of m degrees of freedom, is chi-square when all is well. A fault leaves the
length lambda, in sigmas, in the residuals (what a change of the pose cannot imitate): then J is noncentral chi-square.

    P(J > T | no fault) = false_alarm                                                     (1)
    P(J <= T | lambda) <= missed_detection   for every lambda >= least_fault              (2)

A Gaussian error of 1, 2 or 3 axes, none of which has more than sigma, has a length over k sigma with at most the
probability missed_detection, when

    k^2 = the quantile of chi-square with 1, 2 or 3 degrees of freedom                    (3)
"""

from dataclasses import dataclass, fields
from functools import lru_cache

import numpy as np
from scipy.optimize import brentq
from scipy.stats import chi2, ncx2

from dockair.errors import DockairError

_LONGEST_FAULT = 1e3  # sigmas; upper end of the search for Eq. (2): no fault as long is ever overlooked
_HIGHEST_PROBABILITY = 0.5


@dataclass(frozen=True, slots=True, kw_only=True)
class IntegritySettings:
    """How often the monitor may be wrong, either way.

    Raises:
        DockairError: a probability not between 0 and 0.5.
    """

    false_alarm: float = 1e-4  # of a good frame: at 50 frames a second one in 200 s loses an LED, or its pose
    #: Of a frame with a bad LED: that the test does not see it, and yet the error exceeds the protection level. With
    #: one frame in a hundred faulted this is once in a million frames, 5 hours of them.
    missed_detection: float = 1e-4

    def __post_init__(self) -> None:
        for name in (f.name for f in fields(self)):
            if not 0.0 < getattr(self, name) < _HIGHEST_PROBABILITY:
                raise DockairError(f"integrity.{name}", expected="a probability, 0 to 0.5", got=getattr(self, name))


@dataclass(frozen=True, slots=True, kw_only=True)
class FaultTest:
    """Numbers of the test for one number of degrees of freedom."""

    degrees_of_freedom: int
    threshold: float  #: T of Eq. (1)
    least_fault: float  #: lambda of Eq. (2), in sigmas; inf without degrees of freedom
    error_sigmas: tuple[float, float, float]  #: k of Eq. (3)


@lru_cache(maxsize=256)
def fault_test(degrees_of_freedom: int, settings: IntegritySettings) -> FaultTest:
    """Return the test for a number of degrees of freedom; of 0 the threshold is 0 and no fault is ever seen."""
    missed = settings.missed_detection
    threshold = float(chi2.isf(settings.false_alarm, degrees_of_freedom)) if degrees_of_freedom else 0.0
    return FaultTest(
        degrees_of_freedom=degrees_of_freedom,
        threshold=threshold,
        least_fault=_least_fault(threshold, degrees_of_freedom, missed),
        error_sigmas=(
            float(np.sqrt(chi2.isf(missed, 1))),
            float(np.sqrt(chi2.isf(missed, 2))),
            float(np.sqrt(chi2.isf(missed, 3))),
        ),
    )


def _least_fault(threshold: float, degrees_of_freedom: int, missed: float) -> float:
    if not degrees_of_freedom:
        return np.inf

    def excess(fault: float) -> float:
        return float(ncx2.cdf(threshold, degrees_of_freedom, fault**2)) - missed

    return float(brentq(excess, 0.0, _LONGEST_FAULT))
