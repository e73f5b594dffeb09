"""What brightness says of a ring: its LEDs are about equally bright, clutter has any brightness.

With x = ln flux, q(x) its density among clutter, and LEDs normal about a common unknown mu but for a share eps that is
as bright as clutter (soiled, half hidden, run into a glint), members i of a ring are by

    L = integral of prod r_i(mu) dmu / W,    r_i(mu) = eps + (1 - eps) N(x_i; mu, s)/q(x_i)             (1)

likelier LEDs than clutter, W being the range of mu. The mean of L over clutter is 1 whatever q is, so that clutter
has so large an L with probability 1/L at most (Markov): the expected number of accidental rings, Eq. (1) of `chance`,
falls by the factor L. Of one member, given the others,

    L_i = L / (the same without r_i)                                                                    (2)

is the likelihood ratio by which the odds of its being an impostor, Eq. (2) of `chance`, fall.

q is estimated from the candidates that are no members, a kernel each, and from `prior_weight` of a blob spread over
`prior_range` about the ring's own brightness: little is concluded from few. Positions and brightnesses of clutter
are taken as independent; a reflection of each LED, as bright as its LED and in a ring, is beyond this.
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from dockair.errors import check_numbers
from dockair.kernels import njit
from dockair.rotations import Array

_STEP_SIGMAS = 0.5  # of the integral of Eq. (1): good to a thousandth
_MARGIN_SIGMAS = 2.0  # by which it goes beyond the brightest and the faintest candidate


@dataclass(frozen=True, slots=True, kw_only=True)
class BrightnessSettings:
    """Settings of the brightnesses, in ln flux."""

    sigma: float = 0.35  # s: bins (2:1 is 0.2), pattern, clipping, noise; rendered frames have 0.24
    outliers: float = 0.05  # eps
    mean_range: float = 7.0  # W, a factor of 1000 from just detected to overexposed
    kernel: float = 0.5  # standard deviation of a blob's share in q
    prior_weight: float = 5.0  # blobs
    prior_range: float = 3.4  # a factor of 30; rendered frames' clutter spreads over 150

    def __post_init__(self) -> None:
        check_numbers("identify.brightness", self)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class BrightnessModel:
    """The densities of Eq. (1) at every candidate."""

    led: Array  #: (n, steps) N(x_i; mu, s) over mu
    kernel: Array  #: (n, n) of each candidate's share (column) in q at another
    known: NDArray[np.bool_]  #: (n,) whether a candidate's flux is
    step: float  #: of mu
    settings: BrightnessSettings

    def likelihood_ratios(self, rings: NDArray[np.int64]) -> tuple[Array, Array]:
        """L (m,) of Eq. (1) and L_i (m, slots) of Eq. (2), 1 for an empty slot and the second slot of a candidate.

        Args:
            rings: (m, slots) candidate in each slot, -1 for none.
        """
        s = self.settings
        return _likelihood_ratios(
            self.led, self.kernel, self.known, rings, s.outliers, self.step / s.mean_range, s.prior_weight,
            s.prior_range,
        )  # fmt: skip


def brightness_model(flux: Array, settings: BrightnessSettings, spread: float = 0.0) -> BrightnessModel:
    """What is known of candidates' brightnesses.

    Args:
        flux: (n,) in any unit; one that is not finite and positive says nothing.
        settings: of the brightnesses.
        spread: standard deviation that the sheet itself gives the LEDs' ln brightness.
    """
    known = np.isfinite(flux) & (flux > 0.0)
    x = np.log(flux, where=known, out=np.zeros(len(flux)))
    faintest, brightest = _bound(x, known, settings.mean_range)
    sigma = float(np.hypot(settings.sigma, spread))
    step, margin = _STEP_SIGMAS * sigma, _MARGIN_SIGMAS * sigma
    mu = np.arange(faintest - margin, brightest + margin + step, step)
    return BrightnessModel(
        led=_normal(x, mu, sigma), kernel=_normal(x, x, settings.kernel) * known, known=known,
        step=step, settings=settings,
    )  # fmt: skip


@njit(cache=True)
def _bound(x, known, reach):  # type: ignore[no-untyped-def]
    """Bring x (n,) within reach of the median of those known, the others to it; the least and the largest."""
    middle = 0.0
    if known.any():
        ordered = np.sort(x[known])
        middle = 0.5 * (ordered[(len(ordered) - 1) // 2] + ordered[len(ordered) // 2])
    for k in range(len(x)):
        x[k] = min(max(x[k] if known[k] else middle, middle - reach), middle + reach)
    return x.min(), x.max()


def _normal(x: Array, mean: Array, sigma: float) -> Array:
    """(n, m) density at x (n,) of normals about means (m,)."""
    density = _exponents(x, mean, sigma)
    np.exp(density, out=density)  # the library's, whose digits are others than those of a kernel's
    density /= math.sqrt(2.0 * math.pi) * sigma
    return density


@njit(cache=True)
def _exponents(x: Array, mean: Array, sigma: float) -> Array:
    """(n, m) of `_normal`."""
    exponents = np.empty((len(x), len(mean)))
    for i in range(len(x)):
        for j in range(len(mean)):
            exponents[i, j] = -0.5 * ((x[i] - mean[j]) / sigma) ** 2
    return exponents


@njit(cache=True)
def _likelihood_ratios(  # type: ignore[no-untyped-def]
    led, kernel, known, rings, outliers, d_mu, prior_weight, prior_range
):
    """Densities `led` (n, mu) of each candidate as an LED, `kernel` (n, n) of its share in another's q."""
    slots = rings.shape[1]
    total, single = np.ones(len(rings)), np.ones(rings.shape)
    r, without, slot = np.empty(slots), np.empty(slots), np.empty(slots, np.int64)
    for row in range(len(rings)):
        filled = 0
        for s in range(slots):
            k, first = rings[row, s], True
            for a in range(filled):
                first = first and rings[row, slot[a]] != k
            if k >= 0 and known[k] and first:
                slot[filled] = s
                filled += 1
        if filled == 0:
            continue
        members, q = rings[row][slot[:filled]], np.empty(filled)
        for a in range(filled):
            others = kernel[members[a]].sum()
            for b in members:
                others -= kernel[members[a], b]
            q[a] = (prior_weight / prior_range + others) / (prior_weight + known.sum() - filled)
        total[row], without[:] = 0.0, 0.0
        for step in range(led.shape[1]):
            product = 1.0
            for a in range(filled):
                r[a] = outliers + (1.0 - outliers) * led[members[a], step] / q[a]
                product *= r[a]
            total[row] += product * d_mu
            for a in range(filled):
                without[a] += product / r[a] * d_mu
        for a in range(filled):
            single[row, slot[a]] = total[row] / without[a]
    return total, single
