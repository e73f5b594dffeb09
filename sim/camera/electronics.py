"""From expected electrons to grey levels: pattern, dark current, shot noise, full well, read noise, gain, conversion.

    e = (1 + g) (1 + P w/t) x + D t,   D = D_ref 2^((T - T_ref)/T_d)                                             (1)
    n ~ Poisson(e)                                                                                               (2)
    m = min(n, full well) + o + c + r,   r ~ N(0, s^2)                                                           (3)
    raw = floor(K m + black level + 1/2), clipped to [0, 2^bits - 1];   output = raw >> (bits - 8)               (4)

x expected photo-electrons, t exposure, P parasitic light sensitivity, w the row's wait for its read-out; g, o, c the
fixed pattern; s the read noise; K at 10 bits, four times as much at 12.

Away from full well, n + r is one number: its first three cumulants are e + s^2 = v, and the skew e of the Poisson law,

    n + r = e + sqrt(v) z + e/(6 v) (z^2 - 1),   z ~ N(0, 1)   (Cornish and Fisher)                              (5)

off by at most 5e-5 in distribution for 13 e- of read noise, 4e-4 for 5 e-. Within 6 standard deviations of full well
shot and read noise are drawn apart. For less than 5 e- of read noise n is exact: a Poisson(j/4) from a table plus a
Poisson(d), d < 1/4, add up to Poisson(j/4 + d); above 30 e- it is Eq. (5) with s = 0, not rounded.

Every random number is a hash of (key, frame, row, column), so a pixel reads the same in a window and in the full
frame, and no frame depends on which were taken before it. The kernels use IEEE single precision with every fused
multiply-add written out, so that the compiler's vectors and its remainder loops give the same bits.

Not modelled: non-linearity below full well; dark current while a row waits; motion of the scene while it waits; the
wait is that of the row's place in a full read-out (a window's rows wait less: this is the upper bound).
Sources: EMVA 1288 release 4.0 (linear model); CMV2000 data sheet v3.8; Cornish & Fisher 1938; hashes: Steele, Lea &
Flood 2014 (SplitMix64, rows), C. Wellons, hash-prospector (lowbias32, pixels).
"""

import numpy as np
from numba import njit, types
from numba.extending import intrinsic
from numpy.typing import NDArray
from scipy.stats import poisson

from dockair.errors import DockairError
from dockair.rotations import Array
from dockair.sim.camera.fixed_pattern import FixedPattern
from dockair.sim.camera.readout import readout_time_s
from dockair.sim.camera.sheets import SensorParameters

OUTPUT_BITS = 8  #: of CameraFrame.pixels
EXACT_BELOW_E = 5.0  #: read noise [e-] under which shot noise is drawn from the exact law
POISSON_LIMIT = 30.0  #: electrons above which the exact law gives way to Eq. (5)
_STATED_BITS = 10  # that the sheet's gain and black level are stated for
_REACH = 6.0  # standard deviations of shot noise around full well within which both noises are drawn
_STEPS = 4  # tabled Poisson laws per electron
_GUIDE = 64  # cells of the guide into each tabled law

F = np.float32


@intrinsic
def fma(typing_context, a, b, c):  # type: ignore[no-untyped-def]  # noqa: ANN001, ANN201
    """a b + c, rounded once."""

    def generate(context, builder, signature, arguments):  # type: ignore[no-untyped-def]  # noqa: ANN001, ANN202
        return builder.fma(*arguments)

    return types.float32(types.float32, types.float32, types.float32), generate
