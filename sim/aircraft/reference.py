"""From a commanded increment of velocity to one that an aircraft can fly: smooth, with limited acceleration and jerk.

The command (u, a), velocity and acceleration in body axes, is turned into the axes of W. With the second-order low
pass F = w^2 / (s^2 + 2 zeta w s + w^2) the reference velocity r follows, in each axis,

    r' = F(d),     d = sat(a + k (F(u) - r)),     |d| <= a_max,     |r''| <= j_max                    (1)

To the side, where an aircraft must bank, the limit is taken back with the bank phi at which the reference is flown:

    a_max <- a_max sat((phi_0 - |phi|) / (phi_0 - phi_1), 0, 1)                                       (2)

A command whose a is the rate of its own u comes out as r = F(u), without overshoot; one without a as a step response
of bandwidth k. W stands for any level axes that the caller gives attitudes against.
"""

from dataclasses import dataclass, fields

import numpy as np
from numpy.typing import NDArray

from dockair.messages import ReceiverCommand
from dockair.rotations import Array
from dockair.sim.aircraft.control_law import advance_reference, shortening

_WHOLE = np.ones(3)
_MEMORY = np.dtype(
    [
        ("chain", float, (4, 3)),
        ("smooth", float, (2, 3)),  # F(u) and its rate
        ("gain_1_s", float, 3),
        ("acceleration_m_s2", float, 3),
        ("jerk_m_s3", float, 3),
        ("bandwidth_rad_s", float),
        ("damping", float),
        ("velocity_m_s", float),
        ("bank_rad", float, 2),
        ("step_s", float),
    ]
)


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
        self.memory: NDArray[np.void] = np.zeros((), _MEMORY)  #: state and constants, for `control_law`
        for field in fields(limits):
            self.memory[field.name] = getattr(limits, field.name)
        self.memory["step_s"] = step_s

    @property
    def chain(self) -> Array:
        """(4, 3) r and its first three derivatives (rows), W axes [m/s, m/s^2, ...]; moved in place."""
        return np.asarray(self.memory["chain"])

    def start(self, velocity_W: Array, R_WB: Array, command: ReceiverCommand) -> None:
        """Start from a velocity (3,) beyond trim, at rest with a command."""
        m, u = self.memory, command.velocity_m_s
        m["smooth"], m["chain"] = 0.0, 0.0
        m["smooth"][0] = R_WB @ (u * shortening(u, float(m["velocity_m_s"])))
        m["chain"][0] = velocity_W

    def step(self, R_WB: Array, command: ReceiverCommand, bank_rad: float = 0.0, shares: Array = _WHOLE) -> Array:
        """(4, 3) the chain, advanced by one tick.

        Args:
            R_WB: (3, 3) axes of the command.
            command: u and a.
            bank_rad: phi, the bank with which the reference is being flown, beyond that of the path.
            shares: (3,) what is left of the limits of acceleration, axes of W.
        """
        u, a = command.velocity_m_s, command.acceleration_m_s2
        advance_reference(self.memory, R_WB, u, a, bank_rad, shares)
        return self.chain
