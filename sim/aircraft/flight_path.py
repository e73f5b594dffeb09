"""The path that commands are increments on: its turn rate and slope follow the command, and make up what they lag.

For the turn rate r against the commanded one r_c, and alike for the slope's, with e the heading not yet turned,

    r'' = w^2 (r_c - r) - 2 zeta w r' + kappa w^3 e,     e' = r_c - r,     |r'| <= limit                   (1)

so that after a change the heading is where the command's integral is (for the slope: the height), although r came
late. The limit is the rate of roll p: tan(bank) = V r / g, so r' <= p g / (V cos(bank)^2).
Bank and slope are limited as commanded; what is flown while it makes up for what it lagged goes beyond, after a step
to the limits at 180 m/s to 1.4 times the bank and 1.7 times the slope.
Not modelled: wind; the path is one in the air mass.
"""

from dataclasses import dataclass

import numpy as np

from dockair.kernels import njit
from dockair.rotations import Array
from dockair.sim.air.atmosphere import STANDARD_GRAVITY_M_S2


@dataclass(frozen=True, slots=True, kw_only=True)
class FlightPathParameters:
    """Constants of Eq. (1)."""

    bandwidth_rad_s: float
    damping: float
    catching_up: float  #: kappa
    bank_limit_rad: float  #: of the command
    roll_rate_limit_rad_s: float
    climb_limit_rad: float  #: of the command
    climb_rate_limit_rad_s: float


class FlightPath:
    """Eq. (1), one tick at a time, level and straight at first.

    Args:
        parameters: its constants.
        airspeed_m_s: V.
        step_s: length of a tick.
    """

    def __init__(self, parameters: FlightPathParameters, airspeed_m_s: float, step_s: float) -> None:
        p, r_per_tan = parameters, STANDARD_GRAVITY_M_S2 / airspeed_m_s
        highest = r_per_tan * float(np.tan(p.bank_limit_rad))
        self._constants = np.array(
            [step_s, p.bandwidth_rad_s, p.damping, p.catching_up, r_per_tan, p.roll_rate_limit_rad_s, highest]
            + [p.climb_rate_limit_rad_s, p.climb_limit_rad]
        )
        self._state: Array = np.zeros((2, 3))  # turn rate, slope: value, its rate, what is not yet made up
        self._axes: Array = np.eye(3)
        self.heading_rad = 0.0
        self.turn_rate_rad_s = 0.0  #: positive to the left
        self.climb_rad = 0.0  #: slope against the air
        self._straight = True  # as long as nothing else has been commanded
        _advance(self._state, self._axes, self._constants, 0.0, 0.0, 0.0)

    def step(self, turn_rate_rad_s: float, climb_rad: float) -> None:
        """Advance by one tick toward the commanded turn rate and slope."""
        if self._straight and turn_rate_rad_s == 0.0 and climb_rad == 0.0:
            return
        self._straight = False
        self.heading_rad, self.turn_rate_rad_s, self.climb_rad = _advance(
            self._state, self._axes, self._constants, self.heading_rad, float(turn_rate_rad_s), float(climb_rad)
        )

    def axes(self) -> Array:
        """(3, 3) R_WF: F has x along the path and y level to the left; not a copy."""
        return self._axes


@njit(cache=True)
def _advance(state, axes, k, heading, turn, climb):  # type: ignore[no-untyped-def]
    """Eq. (1) over one tick and the axes then; returns heading, turn rate and slope."""
    step, r_per_tan, highest, steepest = k[0], k[4], k[6], k[8]
    tangent = state[0, 0] / r_per_tan
    fastest = k[5] * r_per_tan * (1.0 + tangent * tangent)
    _follow(state[0], min(max(turn, -highest), highest), fastest, k)
    _follow(state[1], min(max(climb, -steepest), steepest), k[7], k)
    heading += state[0, 0] * step
    c, s, cg, sg = np.cos(heading), np.sin(heading), np.cos(state[1, 0]), np.sin(state[1, 0])
    axes[0, 0], axes[0, 1], axes[0, 2] = c * cg, -s, -c * sg
    axes[1, 0], axes[1, 1], axes[1, 2] = s * cg, c, -s * sg
    axes[2, 0], axes[2, 1], axes[2, 2] = sg, 0.0, cg
    return heading, state[0, 0], state[1, 0]


@njit(cache=True)
def _follow(state, command, fastest, k):  # type: ignore[no-untyped-def]
    h, w, zeta, kappa = k[0], k[1], k[2], k[3]
    value, rate, behind = state
    if value == command and rate == 0.0 and behind == 0.0:
        return
    rate += h * (w * w * (command - value) - 2.0 * zeta * w * rate + kappa * w**3 * behind)
    rate = min(max(rate, -fastest), fastest)
    value += h * rate
    state[0], state[1], state[2] = value, rate, behind + h * (command - value)
