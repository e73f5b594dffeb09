"""Compact spots against a structured background: each gets a threshold of its own from the ring of pixels around it.

A spot of reach r is a peak P whose surroundings, the pixels S_r at distance r +- 1/2 from its centre, are all darker
but for a ninth of them (a neighbour, a glint, the rib that carries the LED):

    P - m >= max(c, sqrt(k^2 s^2(m) + (q m)^2), m - b),    s^2(x) = g x + s_n^2           (1)

m is the brightest pixel of S_r that is left and b the mean of those no brighter; g [DN/e-] is the gain, s_n read noise
and quantisation, q m what lit surfaces vary by. An edge, a rib, a wave have bright pixels on their ring and fail,
however bright they are; the term m - b asks more where the ring itself is uneven. The centre is the middle of the
pixels above half height. Whether noise alone could have made it is asked of the peak and its eight neighbours together,
weighted as a point's image is (1 2 1 each way: nine tenths of the best ratio of signal to noise for sigma 0.65 px):

    sum w_i (I_i - b) / 6 >= d s(b),                                                      (2)

and of the eight but their brightest the sum over 4 has to be at least e s(b) and f (P - b): that keeps hot pixels out,
and pairs of them. The spot's pixels are those connected to the peak (8 neighbours) above

    t = t_0 + h (P - t_0),    t_0 = b + max(p s(b), f (P - b))                            (3)

with the first h of 0, 1/8, 1/4, 1/2 that keeps them off the ring; if none does, or leaves the peak alone, it is no
spot. The ring of reach 2 is the border of a square of 5 x 5 pixels. One side of it may be brighter, for a bright
surface beside the spot, but not two, for those are a rib; and the spot's pixels are cut at it.

Reaches are 4 first, for the best background; 2, for far and faint LEDs, between bright surfaces; 8 and 14 for near or
clipped LEDs, which are bright. Each has its own c. A peak inside an earlier spot is passed over. Most of a frame never
comes so far: see `spot_hits`. Spots of more than two rows are met on every second row, wide ones on every third or
fourth.

Not modelled: spots whose ring leaves the frame; spots of more than 11 pixels radius; a background that falls by more
than its noise across the spot. Compact features of cloud, water and metal are spots too: identification must tell.
Sources: the ring is that of the FAST corner detector (Rosten & Drummond 2006), read for isolation instead of corners.
"""

import math
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from dockair.nav.image.binarise import Image
from dockair.nav.image.labelling import Runs
from dockair.nav.image.spot_hits import find_hits
from dockair.nav.image.spot_kernels import REACHES_PX, ROW_STEPS, WIDE_PX, grow
from dockair.rotations import Array


@dataclass(frozen=True, slots=True, kw_only=True)
class SpotLimits:
    """What makes a spot; levels in DN of the frame."""

    small_contrast_dn: float  #: c for reach 2; each c is at least 1
    middle_contrast_dn: float  #: c for reach 4
    wide_contrast_dn: float  #: c for reaches 8 and 14
    isolation: float  #: k
    texture: float  #: q
    detection: float  #: d
    beside: float  #: e
    pixel: float  #: p
    share: float  #: f
    gain_dn_per_electron: float  #: g
    noise_dn: float  #: s_n


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Spots:
    """The spots of a frame, in raster order of their first pixel."""

    runs: Runs  #: their pixels
    threshold_dn: NDArray[np.int64]  #: (n,) t of Eq. (3): the pixels are above
    background_dn: Array  #: (n,) b


def find_spots(image: Image, limits: SpotLimits) -> Spots:
    """All spots of an image (rows, columns) of uint8 or uint16, by Eqs. (1) to (3)."""
    contrasts, model = _numbers(limits, (1 << 8 * image.dtype.itemsize) - 1)
    image = np.ascontiguousarray(image)
    hits = find_hits(image, REACHES_PX, ROW_STEPS, contrasts, WIDE_PX)
    row, start, stop, offset, threshold, background = grow(image, hits, contrasts, model)
    runs = Runs(row=row, start=start, stop=stop, offset=offset)
    return Spots(runs=runs, threshold_dn=threshold, background_dn=background)


@lru_cache(maxsize=16)
def _numbers(limits: SpotLimits, largest: int) -> tuple[tuple[int, ...], tuple[float, ...]]:
    """Contrasts of all reaches and the model, as the kernels take them."""
    wide = limits.wide_contrast_dn
    of_reaches = (limits.middle_contrast_dn, limits.small_contrast_dn, wide, wide)
    contrasts = tuple(min(max(math.ceil(c), 1), largest) for c in of_reaches)
    model = (
        limits.isolation, limits.texture, limits.detection, limits.beside, limits.pixel, limits.share,
        limits.gain_dn_per_electron, limits.noise_dn,
    )  # fmt: skip
    return contrasts, model
