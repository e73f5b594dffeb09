"""How the probe's tip is felt to change its velocity: by accelerometers and gyros, without a look outside.

In body axes, f being the specific force at the accelerometers' place I, w the body's rate, both means over a step,
r = p_IP and c what takes off gravity and the steady acceleration of the formation: from step to step

    dv_P = (f + c) dt + d(w x r) + w x (w x r) dt                                                         (1)
    c' = -w x c - (f + c) / T                                                                             (2)
    J' = -w x J - [c x] - J / T,   c <- c + J db                                                          (3)

Of the middle of a step are then all terms alike. Of a single sample of the gyro the noise times r is 20 mm/s, twice
what gusts change in a step.

Gusts and manoeuvres pass within seconds, so that over T the mean of f is -c; in between the gyros carry c along. T is
the time since the start until it has grown to `levelling_s`. w is what the gyro says less its bias b as believed now;
when another is believed, c is corrected as if that had been known all the time, J being dc/db: a bias takes 10 to 20 s
to be known, and 1 mrad/s turns gravity by 0.1 m/s^2 in ten.

The belief's own c (`belief_motion`) would not do: it walks fast enough to take up the entry of a turn, and with it
whatever the drogue does that its swing does not explain.

Not modelled: a turn, which Eq. (2) takes for gravity by and by; once one has been announced guidance does not use dv_P.
A gyro's bias that is not known yet turns c away by b g t, until it is known or T has passed.
"""

import numpy as np

from dockair.kernels import njit
from dockair.rotations import Array
from dockair.triples import cross
from dockair.vectors import is_finite

_LEVEL_S = 10.0  # of gravity felt: the mean over a shorter time is as much the gust's and the joining-up's
_SMALL2 = 1e-8  # squared angle [rad^2] below which the series' next term is rounding
_GAP_S = 0.1  # without samples the body turns unfelt; after longer ones c is found anew


class TipMotion:
    """Eqs. (1) to (3).

    Args:
        p_IP: (3,) probe's tip from the accelerometers, body axes [m].
        levelling_s: the longest T: gusts move c by their velocity over it, an unknown bias turns it by bias times it.
    """

    def __init__(self, p_IP: Array, levelling_s: float) -> None:
        self._p_IP, self._levelling_s = p_IP, levelling_s
        self._c: Array | None = None
        self._J: Array = np.zeros((3, 3))
        self._w: Array = np.zeros(3)
        self._bias: Array = np.zeros(3)
        self._time_s = self._unfelt_s = 0.0  # since c was begun, and without samples

    def change_m_s(self, force_B: Array, w_B: Array, bias_B: Array, step_s: float) -> Array:
        """(3,) dv_P in body axes over a step, NaN for the first seconds, where nothing was felt and just after.

        Args:
            force_B: (3,) mean of f over the step [m/s^2]; NaN where there is none.
            w_B: (3,) mean of w over the step, less the bias [rad/s].
            bias_B: (3,) b as believed now [rad/s].
            step_s: dt.
        """
        learnt, self._bias = bias_B - self._bias, bias_B
        before, self._w = self._w - learnt, w_B
        if self._c is not None:
            self._c += self._J @ learnt
        if not is_finite(force_B):
            self._unfelt_s += abs(step_s)
            return np.full(3, np.nan)
        unfelt_s, self._unfelt_s = self._unfelt_s, 0.0
        if self._c is None or unfelt_s > _GAP_S:
            self._c, self._J, self._time_s = -np.asarray(force_B), np.zeros((3, 3)), 0.0
            return np.full(3, np.nan)
        if unfelt_s > 0.0:
            _carry(self._c, self._J, unfelt_s + step_s, before, w_B)
            return np.full(3, np.nan)
        self._time_s += step_s
        time_s = min(self._time_s, self._levelling_s)
        change = _felt(self._c, self._J, force_B, before, w_B, self._p_IP, step_s, time_s)
        return change if self._time_s >= _LEVEL_S else np.full(3, np.nan)


@njit(cache=True)
def _felt(c, J, f, before, w, r, step, time):  # type: ignore[no-untyped-def]
    """(3,) Eq. (1) over a step, from one rate to the next; c (3,), J (3, 3) go on by Eqs. (2), (3), T being `time`."""
    _carry(c, J, step, before, w)
    out, whirl = np.empty(3), cross(w, cross(w, r))
    lever = cross((w[0] - before[0], w[1] - before[1], w[2] - before[2]), r)
    for i in range(3):
        felt = f[i] + c[i]
        c[i] -= step / time * felt
        out[i] = felt * step + lever[i] + step * whirl[i]
        for j in range(3):
            J[i, j] *= 1.0 - step / time
    return out


@njit(cache=True)
def _carry(c, J, seconds, before, w):  # type: ignore[no-untyped-def]
    """Turn c (3,) and J (3, 3) in place with the body for a time, Eqs. (2) and (3) without T."""
    for j in range(3):
        _turn(J[:, j], -0.5 * seconds, before, w)
    for i in range(3):
        k, m = (i + 1) % 3, (i + 2) % 3
        J[i, k] += seconds * c[m]
        J[i, m] -= seconds * c[k]
    _turn(c, -0.5 * seconds, before, w)


@njit(cache=True)
def _turn(c, seconds, before, w):  # type: ignore[no-untyped-def]
    """Turn a vector (3,) in place by the sum of two rates for a time: [rotations, eq 2] times it."""
    phi = (seconds * (before[0] + w[0]), seconds * (before[1] + w[1]), seconds * (before[2] + w[2]))
    angle2 = phi[0] * phi[0] + phi[1] * phi[1] + phi[2] * phi[2]
    if angle2 < _SMALL2:
        a, b = 1.0 - angle2 / 6.0, 0.5 - angle2 / 24.0
    else:
        angle = np.sqrt(angle2)
        a, b = np.sin(angle) / angle, (1.0 - np.cos(angle)) / angle2
    once = cross(phi, c)
    twice = cross(phi, once)
    for i in range(3):
        c[i] += a * once[i] + b * twice[i]
