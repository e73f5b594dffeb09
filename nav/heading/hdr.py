"""Heuristic drift reduction: who mostly goes straight has a rate whose sign changes; a sign that stays is drift.

    w'_i = (T w_i + tau w'_{i-1}) / (T + tau)                                              (1)  low-pass
    I_i  = I_{i-1} - sign(w_{i-1}) s(r),   sign(0) = 0                                     (2)  binary I-controller
    s(r) = i_c (1 + c_1) / (1 + c_1 r^c_2)                                                 (3)  repetition attenuator

r counts the samples for which the sign has stayed. While |w| says that the vehicle turns, I is held (turn switch). The
source prints the loop one way and draws it another; `loop` chooses:

    "printed"   (1) acts on the raw rate;        the corrected rate, whose sign drives I, is w' + I
    "closed"    (1) acts on the raw rate + I;    its output's sign drives I, the corrected rate is raw + I

The source prints none of its constants. The defaults are those of a search over (tau, i_c, c_1, c_2) on a drift of 16
degrees in 85 s, straight and on two laps of an oval, with white noise of 0.05 to 0.5 deg/s: of the printed loop they
leave 0.033 degrees at most on the straight (400 runs) and read 575 to 632 of the oval's 720 degrees (800 runs, half to
each side). No closed loop tried kept the straight below 0.06 degrees over all that noise.

What it cannot do: tell a slow steady turn from drift. It takes turns for drift and loses part of them (`vdr` does not).
Sources: [Kyung et al. 2015, eqs 1, 2]; Borenstein & Ojeda, Heuristic Reduction of Gyro Drift, IEEE PLANS 2010 (3).
"""

from dataclasses import dataclass, field
from typing import Literal

import numpy as np

from dockair.errors import DockairError
from dockair.kernels import njit
from dockair.rotations import Array

__all__ = ["HeuristicDriftReduction", "HeuristicDriftSettings"]

# Layout of the kernel's state
_FILTERED, _CORRECTION, _RUN, _SIGN, _DRIVING = range(5)


@dataclass(frozen=True, slots=True, kw_only=True)
class HeuristicDriftSettings:
    """Constants of Eqs. (1) to (3); angles in radians."""

    time_constant_s: float = 1.0  #: tau
    step_rad_s: float = float(np.radians(0.01))  #: i_c, of every sample
    attenuation: float = 0.1  #: c_1
    exponent: float = 1.0  #: c_2
    turn_rate_rad_s: float = float(np.radians(10.0))  #: of the turn switch
    loop: Literal["printed", "closed"] = "printed"

    @classmethod
    def for_aircraft(cls) -> "HeuristicDriftSettings":
        """Constants of a fixed-wing aircraft with a gyro of 100 Hz: turns of a degree a second, bias that moves slowly.

        The switch opens below the rate of a bank of 7 degrees at 180 m/s, 0.4 deg/s, and holds I above it; gusts yaw
        less than that. I moves by 1e-4 deg/s a sample: the seconds of a turn's beginning, until the switch
        holds it, add some thousandths of a degree a second.
        """
        return cls(
            time_constant_s=2.0,
            step_rad_s=float(np.radians(1e-4)),
            turn_rate_rad_s=float(np.radians(0.4)),
        )

    def __post_init__(self) -> None:
        for name, least in (("time_constant_s", 0.0), ("step_rad_s", 0.0), ("attenuation", 0.0), ("exponent", 0.0)):
            if not (np.isfinite(getattr(self, name)) and getattr(self, name) >= least):
                raise DockairError(name, expected="a finite number >= 0", got=getattr(self, name))
        if not self.turn_rate_rad_s > 0.0:
            raise DockairError("turn_rate_rad_s", expected="a rate > 0", got=self.turn_rate_rad_s)
        if self.loop not in ("printed", "closed"):
            raise DockairError("loop", expected="a reading of the loop", got=self.loop, exists=("printed", "closed"))


@dataclass(slots=True, eq=False)
class HeuristicDriftReduction:
    """Eqs. (1) to (3), one sample at a time or a record at once.

    Args:
        sample_rate_hz: of the gyro.
        settings: the constants.
    """

    sample_rate_hz: float = 100.0
    settings: HeuristicDriftSettings = field(default_factory=HeuristicDriftSettings)
    _state: Array = field(init=False, repr=False)
    _constants: Array = field(init=False, repr=False)

    def __post_init__(self) -> None:
        if not (np.isfinite(self.sample_rate_hz) and self.sample_rate_hz > 0.0):
            raise DockairError("sample_rate_hz", expected="a rate > 0", got=self.sample_rate_hz)
        s = self.settings
        self._state = np.zeros(5)
        self._constants = np.array(
            [
                1.0 / self.sample_rate_hz,
                s.time_constant_s,
                s.step_rad_s,
                s.attenuation,
                s.exponent,
                s.turn_rate_rad_s,
                float(s.loop == "closed"),
            ]
        )

    @property
    def correction_rad_s(self) -> float:
        """I: what is added to the rate."""
        return float(self._state[_CORRECTION])

    @correction_rad_s.setter
    def correction_rad_s(self, value: float) -> None:
        if not np.isfinite(value):
            raise DockairError("correction_rad_s", expected="a finite rate", got=value)
        self._state[_CORRECTION] = value

    def step(self, rate_rad_s: float) -> float:
        """Take a sample of the yaw rate; return the corrected rate [rad/s]. A sample that is not finite is refused."""
        if not np.isfinite(rate_rad_s):
            raise DockairError("rate_rad_s", expected="a finite rate", got=rate_rad_s)
        return float(_step(rate_rad_s, self._state, self._constants))

    def run(self, rates_rad_s: Array) -> Array:
        """(n,) corrected rates of a record (n,) [rad/s], as if stepped through."""
        rates = np.ascontiguousarray(rates_rad_s, dtype=float)
        if rates.ndim != 1 or not np.isfinite(rates).all():
            raise DockairError("rates_rad_s", expected="a row of finite rates", got=f"shape {rates.shape}")
        return np.asarray(_run(rates, self._state, self._constants))


@njit(cache=True)
def _step(rate: float, state: Array, constants: Array) -> float:
    period, tau, step, c_1, c_2, turning, closed = constants
    driving = state[_DRIVING]
    sign = float(np.sign(driving))
    state[_RUN] = state[_RUN] + 1.0 if sign == state[_SIGN] else 1.0
    state[_SIGN] = sign
    if abs(driving) < turning:
        state[_CORRECTION] -= sign * step * (1.0 + c_1) / (1.0 + c_1 * state[_RUN] ** c_2)  # Eqs. (2), (3)
    seen = rate + state[_CORRECTION] if closed else rate
    state[_FILTERED] = (period * seen + tau * state[_FILTERED]) / (period + tau)  # Eq. (1)
    state[_DRIVING] = state[_FILTERED] if closed else state[_FILTERED] + state[_CORRECTION]
    return seen if closed else state[_DRIVING]


@njit(cache=True)
def _run(rates: Array, state: Array, constants: Array) -> Array:
    corrected = np.empty(rates.size)
    for i in range(rates.size):
        corrected[i] = _step(rates[i], state, constants)
    return corrected
