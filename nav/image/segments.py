"""Which parts of a binary image hold anything: most of a frame is background, and is passed over 64 pixels at once."""

import numpy as np
from numpy.typing import NDArray

from dockair.errors import DockairError
from dockair.kernels import njit

SEGMENT = 64  #: pixels


def checked_mask(mask: NDArray[np.bool_], connectivity: int) -> NDArray[np.bool_]:
    """The mask, if it is one.

    Raises:
        DockairError: wrong shape, dtype or connectivity.
    """
    if connectivity not in (4, 8):
        raise DockairError("connectivity", expected="4 or 8", got=connectivity)
    mask = np.asarray(mask)
    if mask.ndim != 2 or mask.dtype != np.bool_:
        raise DockairError("mask", expected="a (rows, columns) bool array", got=f"{mask.shape} {mask.dtype}")
    return mask


def busy_segments(mask: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """(rows, columns // SEGMENT + 1) which segments of a contiguous mask (rows, columns) may hold foreground."""
    return np.asarray(_busy_segments(mask.view(np.uint8)))


@njit(cache=True)
def _any(segment):  # type: ignore[no-untyped-def]
    """Whether a segment holds anything. A constant length: only so does it become vector instructions."""
    found = np.uint8(0)
    for k in range(SEGMENT):
        found |= segment[k]
    return found != 0


@njit(cache=True)
def _busy_segments(mask):  # type: ignore[no-untyped-def]
    rows, columns = mask.shape
    busy = np.ones((rows, columns // SEGMENT + 1), np.bool_)  # what remains of a row is not looked at here
    for i in range(rows):
        for s in range(columns // SEGMENT):
            busy[i, s] = _any(mask[i, s * SEGMENT : (s + 1) * SEGMENT])
    return busy
