"""The path that commands are increments on: its turn rate and slope follow the command, and make up what they lag.

For the turn rate r against the commanded one r_c, and alike for the slope's, with e the heading not yet turned,

    r'' = w^2 (r_c - r) - 2 zeta w r' + kappa w^3 e,     e' = r_c - r,     |r'| <= limit                   (1)

so that after a change the heading is where the command's integral is (for the slope: the height), although r came
late. The limit is the rate of roll p: tan(bank) = V r / g, so r' <= p g / (V cos(bank)^2).
Not modelled: wind; the path is one in the air mass.
"""

from dataclasses import dataclass

import numpy as np

from dockair.rotations import Array
from dockair.sim.air.atmosphere import STANDARD_GRAVITY_M_S2


@dataclass(frozen=True, slots=True, kw_only=True)
class FlightPathParameters:
    """Constants of Eq. (1)."""

    bandwidth_rad_s: float
    damping: float
    catching_up: float  #: kappa
    bank_limit_rad: float
    roll_rate_limit_rad_s: float
    climb_limit_rad: float
    climb_rate_limit_rad_s: float


class FlightPath:
    """Eq. (1), one tick at a time, level and straight at first.

    Args:
        parameters: its constants.
        airspeed_m_s: V.
        step_s: length of a tick.
    """

    def __init__(self, parameters: FlightPathParameters, airspeed_m_s: float, step_s: float) -> None:
        self._parameters, self._step_s = parameters, step_s
        self._r_per_tan = STANDARD_GRAVITY_M_S2 / airspeed_m_s
        self._turn, self._slope = [0.0, 0.0, 0.0], [0.0, 0.0, 0.0]  # value, its rate, what is not yet made up
        self.heading_rad = 0.0

    @property
    def turn_rate_rad_s(self) -> float:
        """Positive to the left."""
        return self._turn[0]

    @property
    def climb_rad(self) -> float:
        """Slope against the air."""
        return self._slope[0]

    def step(self, turn_rate_rad_s: float, climb_rad: float) -> None:
        """Advance by one tick toward the commanded turn rate and slope."""
        p = self._parameters
        highest = self._r_per_tan * float(np.tan(p.bank_limit_rad))
        tangent = self._turn[0] / self._r_per_tan
        fastest = p.roll_rate_limit_rad_s * self._r_per_tan * (1.0 + tangent * tangent)
        self._follow(self._turn, min(max(turn_rate_rad_s, -highest), highest), fastest)
        climb = min(max(climb_rad, -p.climb_limit_rad), p.climb_limit_rad)
        self._follow(self._slope, climb, p.climb_rate_limit_rad_s)
        self.heading_rad += self._turn[0] * self._step_s

    def _follow(self, state: list[float], command: float, fastest: float) -> None:
        p, h = self._parameters, self._step_s
        value, rate, behind = state
        if value == command and rate == 0.0 and behind == 0.0:
            return
        w = p.bandwidth_rad_s
        rate += h * (w * w * (command - value) - 2.0 * p.damping * w * rate + p.catching_up * w**3 * behind)
        rate = min(max(rate, -fastest), fastest)
        value += h * rate
        state[:] = value, rate, behind + h * (command - value)

    def axes(self) -> Array:
        """(3, 3) R_WF: F has x along the path and y level to the left."""
        c, s = np.cos(self.heading_rad), np.sin(self.heading_rad)
        cg, sg = np.cos(self._slope[0]), np.sin(self._slope[0])
        return np.array([[c * cg, -s, -c * sg], [s * cg, c, -s * sg], [sg, 0.0, cg]])
