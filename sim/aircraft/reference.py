"""From a commanded increment of velocity to one that an aircraft can fly: smooth, with limited acceleration and jerk.

The command (u, a), velocity and acceleration in body axes, is turned into the axes of W. With the second-order low
pass F = w^2 / (s^2 + 2 zeta w s + w^2) the reference velocity r follows, in each axis,

    r' = F(d),     d = sat(a + k (F(u) - r)),     |d| <= a_max,     |r''| <= j_max                    (1)

To the side, where an aircraft must bank, the limit is taken back with the bank phi at which the reference is flown:

    a_max <- a_max sat((phi_0 - |phi|) / (phi_0 - phi_1), 0, 1)                                       (2)

A command whose a is the rate of its own u comes out as r = F(u), without overshoot; one without a as a step response
of bandwidth k. W stands for any level axes that the caller gives attitudes against.
"""

from dataclasses import dataclass

import numpy as np
from numba import njit

from dockair.messages import ReceiverCommand
from dockair.rotations import Array

_WHOLE = np.ones(3)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class ReferenceLimits:
    """Constants of Eqs. (1) and (2); axes forward, left, up."""

    gain_1_s: Array  #: (3,) k
    bandwidth_rad_s: float  #: w
    damping: float  #: zeta
    acceleration_m_s2: Array  #: (3,) a_max
    jerk_m_s3: Array  #: (3,) j_max
    velocity_m_s: float  #: a longer u is shortened to this
    bank_rad: Array  #: (2,) phi_1, phi_0 of Eq. (2)


class Reference:
    """Eqs. (1) and (2), one tick at a time."""

    def __init__(self, limits: ReferenceLimits, step_s: float) -> None:
        shape = [limits.bandwidth_rad_s, limits.damping, limits.velocity_m_s]
        bank = [*limits.bank_rad, 0.0]
        self._constants = np.vstack([limits.gain_1_s, limits.acceleration_m_s2, limits.jerk_m_s3, shape, bank])
        self._step_s = step_s
        self._smooth = np.zeros((2, 3))  # F(u) and its rate
        self.chain: Array = np.zeros((4, 3))  #: r and its first three derivatives (rows), W axes [m/s, m/s^2, ...]

    def start(self, velocity_W: Array, R_WB: Array, command: ReceiverCommand) -> None:
        """Start from a velocity (3,) beyond trim, at rest with a command."""
        self._smooth[:], self.chain[:] = 0.0, 0.0
        u = command.velocity_m_s
        self._smooth[0] = R_WB @ (u * _shortening(u, self._constants[3, 2]))
        self.chain[0] = velocity_W

    def step(self, R_WB: Array, command: ReceiverCommand, bank_rad: float = 0.0, shares: Array = _WHOLE) -> Array:
        """(4, 3) the chain, advanced by one tick.

        Args:
            R_WB: (3, 3) axes of the command.
            command: u and a.
            bank_rad: phi, the bank with which the reference is being flown, beyond that of the path.
            shares: (3,) what is left of the limits of acceleration, axes of W.
        """
        u, a = command.velocity_m_s, command.acceleration_m_s2
        _advance(self.chain, self._smooth, R_WB, u, a, bank_rad, shares, self._constants, self._step_s)
        return self.chain


@njit(cache=True)
def _shortening(u, longest):  # type: ignore[no-untyped-def]
    size = np.sqrt(u[0] * u[0] + u[1] * u[1] + u[2] * u[2])
    return 1.0 if size <= longest else longest / size


@njit(cache=True)
def _advance(chain, smooth, R, u_B, a_B, bank, left, constants, step):  # type: ignore[no-untyped-def]
    """Eqs. (1) and (2) over one tick, in place."""
    w, zeta, share = constants[3, 0], constants[3, 1], _shortening(u_B, constants[3, 2])
    for i in range(3):
        k, a_max, jerk_max = constants[0, i], left[i] * constants[1, i], constants[2, i]
        if i == 1:
            a_max *= min(max((constants[4, 1] - abs(bank)) / (constants[4, 1] - constants[4, 0]), 0.0), 1.0)
        u = share * (R[i, 0] * u_B[0] + R[i, 1] * u_B[1] + R[i, 2] * u_B[2])
        a = R[i, 0] * a_B[0] + R[i, 1] * a_B[1] + R[i, 2] * a_B[2]
        smooth[1, i] += step * (w * w * (u - smooth[0, i]) - 2.0 * zeta * w * smooth[1, i])
        smooth[0, i] += step * smooth[1, i]
        d = min(max(a + k * (smooth[0, i] - chain[0, i]), -a_max), a_max)
        snap = w * w * (d - chain[1, i]) - 2.0 * zeta * w * chain[2, i]
        jerk = min(max(chain[2, i] + step * snap, -jerk_max), jerk_max)
        chain[3, i] = (jerk - chain[2, i]) / step
        chain[2, i] = jerk
        chain[1, i] += step * jerk
        chain[0, i] += step * chain[1, i]
