"""Compact spots against a structured background: each gets a threshold of its own from the ring of pixels around it.

A spot of reach r is a peak P whose surroundings, the pixels S_r at distance r +- 1/2 from its centre, are all darker
but for a ninth of them (a neighbour, a glint, the rib that carries the LED):

    P - m >= max(c, k s, m - b),    s^2 = g m + s_n^2 + (q m)^2                           (1)

m is the brightest pixel of S_r that is left and b the mean of what is left; g [DN/e-] is the gain, s_n read noise and
quantisation, q the rms texture of lit surfaces, in shares of their level. An edge, a rib, a wave have bright pixels on
their ring and fail, however bright they are; the term m - b asks more where the ring itself is uneven. The centre
is the middle of the pixels above half height. The spot's pixels are those connected to the peak (8 neighbours) above

    t = t_0 + h (P - t_0),    t_0 = b + max(k sqrt(g b + s_n^2), f (P - b))               (2)

with the first h of 0, 1/8, 1/4, 1/2 that keeps them off the ring; if none does, it is no spot. The ring of reach 2 is
the border of a square of 5 x 5 pixels. Three of its pixels side by side may be brighter, for a bright surface on one
side of the spot, but not one on either side, for that is a rib; and the spot's pixels are cut at it.

Reaches are 4 first, for the best background; 2, for far LEDs between bright surfaces; 8 and 14 for near or clipped
LEDs, which are bright: their c is larger. A peak inside an earlier spot is passed over. Most of a frame never comes so
far: before, a pixel has to pass 7/8 x - n >= c, n the second brightest of the four pixels at distance r along its row
and column, which vector instructions test 64 at a time. Spots of more than two rows are met on every second row, wide
ones on every third or fourth.

Not modelled: spots whose ring leaves the frame; spots of more than 11 pixels radius; a background that falls by more
than its noise across the spot. Compact features of cloud, water and metal are spots too: identification must tell.
Sources: the ring is that of the FAST corner detector (Rosten & Drummond 2006), read for isolation instead of corners.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from dockair.nav.image.binarise import Image
from dockair.nav.image.labelling import Runs
from dockair.nav.image.spot_kernels import find
from dockair.rotations import Array


@dataclass(frozen=True, slots=True, kw_only=True)
class SpotLimits:
    """What makes a spot; levels in DN of the frame."""

    min_contrast_dn: float  #: c for reaches 2 and 4; at least 1
    wide_contrast_dn: float  #: c for wide spots
    noise_factor: float  #: k
    min_share: float  #: f
    texture: float  #: q
    gain_dn_per_electron: float  #: g
    noise_dn: float  #: s_n


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Spots:
    """The spots of a frame, in raster order of their first pixel."""

    runs: Runs  #: their pixels
    threshold_dn: NDArray[np.int64]  #: (n,) t of Eq. (2): the pixels are above
    background_dn: Array  #: (n,) b


def find_spots(image: Image, limits: SpotLimits) -> Spots:
    """All spots of an image (rows, columns) of uint8 or uint16, by Eqs. (1) and (2)."""
    largest = (1 << 8 * image.dtype.itemsize) - 1
    contrasts = [min(max(int(np.ceil(c)), 1), largest) for c in (limits.min_contrast_dn, limits.wide_contrast_dn)]
    model = (
        limits.noise_factor, limits.min_share, limits.texture, limits.gain_dn_per_electron, limits.noise_dn,
    )  # fmt: skip
    row, start, stop, offset, threshold, background = find(
        np.ascontiguousarray(image), image.dtype.type(0), contrasts[0], contrasts[1], model
    )
    runs = Runs(row=row, start=start, stop=stop, offset=offset)
    return Spots(runs=runs, threshold_dn=threshold, background_dn=background)
