"""What a count of successes says about a rate.

K successes of n flights, z the normal quantile of (1 + confidence) / 2, p = K / n:

    centre = (p + z^2 / 2n) / (1 + z^2 / n)                                          (1)
    half   = z sqrt(p (1 - p) / n + z^2 / 4n^2) / (1 + z^2 / n)                      (2)
    P(K <= k | n, p) = sum over i = 0 .. k of C(n, i) p^i (1 - p)^(n - i)            (3)

Of two that were tried on the same n cases, a of these were only the one's and b only the other's (sign test):

    P = min(1, 2 P(K <= min(a, b) | a + b, 1/2))                                     (4)

Source: (1), (2) [Wilson 1927, J. Am. Stat. Assoc. 22, 209]; (4) [McNemar 1947, Psychometrika 12, 153], exact.
"""

import math

import numpy as np
from scipy.special import bdtr, ndtri

CONFIDENCE = 0.95  #: of the intervals that are shown


def wilson_interval(successes: int, trials: int, confidence: float = CONFIDENCE) -> tuple[float, float]:
    """Return the lower and upper limit of the rate, Eqs. (1) and (2); 0 and 1 without trials.

    Args:
        successes: K.
        trials: n.
        confidence: that the interval holds the rate, about.
    """
    if trials == 0:
        return 0.0, 1.0
    z, p = float(ndtri(0.5 + 0.5 * confidence)), successes / trials
    shrink = 1.0 + z * z / trials
    centre = (p + 0.5 * z * z / trials) / shrink
    half = z * math.sqrt(p * (1.0 - p) / trials + 0.25 * (z / trials) ** 2) / shrink
    low = 0.0 if successes == 0 else centre - half  # exactly, and not by rounding
    return low, 1.0 if successes == trials else centre + half


def probability_of_at_most(successes: int, trials: int, rate: float) -> float:
    """Return P(K <= successes), Eq. (3).

    Args:
        successes: k; -1 is none at all.
        trials: n.
        rate: p.
    """
    if successes < 0:
        return 0.0
    return 1.0 if successes >= trials else float(bdtr(successes, trials, rate))


def sign_test(only_one: int, only_other: int) -> float:
    """Return how often chance divides cases as unevenly between two that are as good, Eq. (4); 1 without any.

    Args:
        only_one: a.
        only_other: b.
    """
    return min(1.0, 2.0 * probability_of_at_most(min(only_one, only_other), only_one + only_other, 0.5))


def largest_rejected_count(trials: int, rate: float, false_alarm: float) -> int:
    """Return the largest k for which P(K <= k) < false_alarm under the rate; -1 if there is none."""
    count = -1
    while count + 1 < trials and probability_of_at_most(count + 1, trials, rate) < false_alarm:
        count += 1
    return count


def trials_to_reject_none(rate: float, false_alarm: float) -> float:
    """Return the smallest n with (1 - p)^n < false_alarm, Eq. (3) of no success; a float, for it may be infinite.

    Args:
        rate: p, above 0.
        false_alarm: below 1.
    """
    if rate >= 1.0:
        return 1.0
    about = float(np.ceil(math.log(false_alarm) / math.log1p(-rate)))
    # where the quotient is a whole number, rounding and "<" decide which of three it is
    return next((n for n in (about - 1.0, about) if n >= 1.0 and (1.0 - rate) ** n < false_alarm), about + 1.0)
