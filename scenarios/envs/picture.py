"""Frames of any size as pictures of one size: padded with black, and pooled so that the brightest pixel remains.

A picture's pixel (i, j) is the brightest of the frame's pixels [k i, k i + k) x [k j, k j + k), with k the smallest
factor at which the frame fits. A mean would drown an LED of three pixels; the brightest keeps it, to k pixels.
"""

import numpy as np
from numpy.typing import NDArray

from dockair.kernels import njit

#: (rows, columns) of the picture by view: a window is about square, and the sensor has 1088 x 2048 pixels.
PICTURE = {"ring": (128, 128), "sensor": (136, 256)}


def pooled_picture(pixels: NDArray[np.uint8], shape: tuple[int, int]) -> tuple[NDArray[np.uint8], int]:
    """Return the picture (rows, columns) of a frame, and k.

    Args:
        pixels: (m, n) of the frame.
        shape: of the picture.
    """
    k = max(-(-pixels.shape[0] // shape[0]), -(-pixels.shape[1] // shape[1]), 1)
    out = np.zeros(shape, np.uint8)
    _pool(pixels, k, out)
    return out, k


@njit(cache=True)
def _pool(pixels: NDArray[np.uint8], k: int, out: NDArray[np.uint8]) -> None:
    for row in range(pixels.shape[0]):
        for column in range(pixels.shape[1]):
            i, j = row // k, column // k
            if pixels[row, column] > out[i, j]:
                out[i, j] = pixels[row, column]
