"""The haze before what is drawn: [solids, eq 1] block by block, once all solids are there.

Stretches of a row that hold a solid are worked out whole, the others not at all. Not modelled: see `solids`.
"""

import numpy as np
from numpy.typing import NDArray

from dockair.kernels import njit
from dockair.rotations import Array

_F = np.float32
_ONE = _F(1.0)
_FAINTEST = _F(80.0)  # exponent beyond which nothing is seen through the haze
_STRETCH = 64  # blocks
_LOG2_E = _F(1.44269504)
#: 2^-f on [0, 1] to 2e-9, but for rounding; highest power first, 1 at f = 0 to the bit.
_POWER = tuple(_F(a) for a in (1.0902322e-4, -1.2747482e-3, 9.5791798e-3, -5.5490758e-2, 0.24022436, -0.69314706, 1.0))

Row = NDArray[np.float32]


@njit(cache=True)
def lay_before(
    out: NDArray[np.float32],
    nearest: NDArray[np.float32],
    reach: NDArray[np.int64],
    x: Array,
    y: Array,
    extinction_1_m: float,
    airlight: float,
    far: float,
) -> None:
    """Lay haze before a picture of solids, in place.

    Args:
        out: (rows, columns) relative radiance.
        nearest: (rows, columns) depths [m].
        reach: (rows, 2) first column that may hold a solid and one past the last; may go beyond the picture.
        x: (columns,) tangents to the right of the axis, of the blocks' centres.
        y: (rows,) tangents below it.
        extinction_1_m: of the air.
        airlight: relative radiance of endless air.
        far: depth from which on there is no solid [m].
    """
    tangents, last = x.astype(np.float32), _F(far)
    for i in range(out.shape[0]):
        air = _F(extinction_1_m), _F(airlight), _F(1.0 + y[i] * y[i]), last
        begin, n = -1, min(reach[i, 1], out.shape[1])
        for left in range(max(reach[i, 0], 0) // _STRETCH * _STRETCH, n + _STRETCH, _STRETCH):
            solid = left < n and _count_nearer(nearest[i, left : min(left + _STRETCH, n)], last) > 0
            if solid and begin < 0:
                begin = left
            elif begin >= 0 and not solid:
                _fade_row(out[i, begin:left], nearest[i, begin:left], tangents[begin:left], air)
                begin = -1


@njit(cache=True)
def clear(nearest: NDArray[np.float32], reach: NDArray[np.int64], far: float) -> None:
    """Make depths (rows, columns) far again wherever something may have been drawn; `reach` as in `lay_before`."""
    for i in range(nearest.shape[0]):
        nearest[i, max(reach[i, 0], 0) : min(reach[i, 1], nearest.shape[1])] = far


@njit(cache=True)
def _count_nearer(depths: Row, far: np.float32) -> np.int32:
    count = np.int32(0)
    for j in range(depths.shape[0]):
        count = np.int32(count + np.int32(depths[j] < far))
    return count


@njit(cache=True)
def _fade_row(out: Row, depths: Row, x: Row, air: tuple[np.float32, np.float32, np.float32, np.float32]) -> None:
    """`air` is extinction, airlight, 1 + y^2 and the depth from which on there is no solid."""
    extinction, airlight, beyond, far = air
    for j in range(out.shape[0]):
        clear = _fading(extinction * depths[j] * np.sqrt(beyond + x[j] * x[j]))
        radiance = out[j] * clear + airlight * (_ONE - clear)
        out[j] = radiance if depths[j] < far else out[j]


@njit(cache=True)
def _fading(depth: np.float32) -> np.float32:
    """exp(-depth) of 0 to 80, of more that of 80, to 1e-7."""
    y = (depth if depth < _FAINTEST else _FAINTEST) * _LOG2_E
    whole = np.int32(y)
    f = y - _F(whole)
    power = _POWER[0]
    for a in _POWER[1:]:
        power = power * f + a
    return np.int32(_F(power).view(np.int32) - (whole << np.int32(23))).view(np.float32)
