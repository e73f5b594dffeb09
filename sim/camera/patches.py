"""Wide soft patches on the image: flashes of faces and skins too large for a point spread function.

    e(u, v) = E X(u) Y(v),    X(u) = Phi((u + 1/2 - u0)/s) - Phi((u - 1/2 - u0)/s),  Y alike                     (1)

Every factor is a function of the pixel's own row or column on the sensor, so a window's pixels are the full frame's.
Not modelled: the patch's true outline; the lens's blur, small against s.
"""

import math
from typing import Final

import numpy as np
from numpy.typing import NDArray

from dockair.kernels import njit
from dockair.rotations import Array

REACH: Final = 5.0  #: standard deviations beyond which nothing is added: 1e-6 of the light


@njit(cache=True)
def add_patches(
    image: NDArray[np.float32], start: tuple[int, int], pixels: Array, electrons: Array, sigma_px: Array
) -> None:
    """Add round normal patches to expected electrons, in place, Eq. (1).

    Args:
        image: (rows, columns) of the window.
        start: (row, column) of its first pixel.
        pixels: (n, 2) middles (u, v); outside is allowed, what is not finite adds nothing.
        electrons: (n,) of each whole patch.
        sigma_px: (n,) standard deviations, > 0.
    """
    rows, columns = image.shape
    for i in range(len(electrons)):
        u, v, s = pixels[i, 0], pixels[i, 1], sigma_px[i]
        if not (math.isfinite(u) and math.isfinite(v) and math.isfinite(electrons[i])):
            continue
        left, right = _bounds(u, s, start[1], columns)
        top, bottom = _bounds(v, s, start[0], rows)
        if left >= right or top >= bottom:
            continue
        across = np.empty(right - left)
        for c in range(left, right):
            across[c - left] = _part(c + start[1], u, s)
        for r in range(top, bottom):
            share = electrons[i] * _part(r + start[0], v, s)
            for c in range(left, right):
                image[r, c] += np.float32(share * across[c - left])


@njit(cache=True)
def _bounds(middle: float, s: float, start: int, count: int) -> tuple[int, int]:
    """Which of the window's pixels, first and one past the last, lie within reach."""
    low = max(min(math.ceil(middle - REACH * s) - start, float(count)), 0.0)
    high = max(min(math.floor(middle + REACH * s) + 1 - start, float(count)), 0.0)
    return int(low), int(high)


@njit(cache=True)
def _part(x: int, middle: float, s: float) -> float:
    k = 1.0 / (math.sqrt(2.0) * s)
    return 0.5 * (math.erf((x + 0.5 - middle) * k) - math.erf((x - 0.5 - middle) * k))
