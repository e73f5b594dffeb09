"""What the IMU's samples say of the time between them, and after the last.

Between two samples the rate is linear, after the last it is held. The truth departs from that by an angular
acceleration: a steady one of sigma_A since the last sample, or one of sigma_A / 2 that changes its sign half-way
between two. A time t after the last, or between two that are T apart, the gyro's squared noise density grows by

    sigma_A^2 t^3,   or   sigma_A^2 T^3 / 64,   but at most by that of a rate that is not known at all             (1)

Specific force is linear and held likewise; where no two samples of it stand near, it is not felt.

Not modelled: the size of the IMU.
"""

import numpy as np

from dockair.kernels import njit
from dockair.rotations import Array


@njit(cache=True, error_model="numpy")
def _held_noise(after: float, before: float, turn2: float, most2: float) -> float:
    """Mean of sigma_A^2 t^3 over a piece of time, t from `before` to `after`, at most `most2` (Eq. (1))."""
    corner = (most2 / turn2) ** (1.0 / 3.0) if turn2 > 0.0 else np.inf
    if after <= before or corner <= before:
        return most2 if turn2 > 0.0 else 0.0
    inside = min(after, corner)
    return (turn2 * (inside**4 - before**4) / 4.0 + most2 * max(after - corner, 0.0)) / (after - before)


@njit(cache=True, error_model="numpy")
def sampled(
    w: Array,
    f: Array,
    k: int,
    ta: float,
    tb: float,
    times: Array,
    rates: Array,
    forces: Array,
    held_turn2: float,
    held_most2: float,
    longest_gap_s: float,
) -> tuple[float, bool]:
    """Write w, f of a piece of time; return the mean of Eq. (1) in it, and whether f was felt.

    Args:
        w: (3,) angular velocity, written [rad/s].
        f: (3,) specific force, written [m/s^2].
        k: number of the sample that the piece comes after; -1 before the first.
        ta: begin of the piece [s].
        tb: end of it, before the next sample.
        times: (n,) stamps of the samples, increasing [s].
        rates: (n, 3) of the gyro [rad/s].
        forces: (n, 3) of the accelerometers [m/s^2]; NaN where there is none.
        held_turn2: sigma_A^2 [rad^2/s^4].
        held_most2: noise density of a rate that is not known [rad^2/s].
        longest_gap_s: between two samples of acceleration that are used.
    """
    n, middle = len(times), 0.5 * (ta + tb)
    if n == 0:
        w[:], f[:] = 0.0, 0.0
        return held_most2, False
    if 0 <= k < n - 1:
        gap = times[k + 1] - times[k]
        share = (middle - times[k]) / gap
        for i in range(3):
            w[i] = (1.0 - share) * rates[k, i] + share * rates[k + 1, i]
            f[i] = (1.0 - share) * forces[k, i] + share * forces[k + 1, i]
        held2, far = min(held_turn2 * gap**3 / 64.0, held_most2), gap
    else:
        near = 0 if k < 0 else n - 1
        w[:], f[:] = rates[near], forces[near]
        a, b = abs(ta - times[near]), abs(tb - times[near])
        far = max(a, b)
        held2 = _held_noise(far, min(a, b), held_turn2, held_most2)
    return held2, far <= longest_gap_s and np.isfinite(f[0]) and np.isfinite(f[1]) and np.isfinite(f[2])
