"""How the receiver's own bow wave pushes the drogue across as the probe comes near, as guidance believes it.

A source behind the nose makes a half-body of radius R and sends out, at r from it in a stream V,

    u / V = R^2/4  r/|r|^3,         b = c u/V  across                                                     (1)

A drogue in a stream that has been turned by u/V is accelerated across by c u/V as long as it hangs where it hung: c is
its drag per mass that moves along. An attempt that missed tells what (1) did not know: a share of the miss is added
to where the next one aims.

Not modelled: the push along the way, the turning of the source with the body, the hose in the same flow.
Source: potential flow about a Rankine half-body; c from the swing, omega^2 times the hose's length.
"""

from dataclasses import dataclass, replace

import numpy as np

from dockair.errors import check_numbers
from dockair.nav.guidance.swing_model import frequency_ratio
from dockair.rotations import Array


@dataclass(frozen=True, slots=True, kw_only=True)
class BowWavePush:
    """Eq. (1); the defaults push nothing."""

    source_from_tip_m: tuple[float, float, float] = (-1.575, 0.9, -0.65)  # of the probe, body axes
    radius_m: float = 0.0  # R; 0: no bow wave
    side_acceleration_m_s2: float = 60.0  # c: (2 pi 0.32 Hz)^2 times 15 m, at 180 m/s and 6000 m
    learning_share: float = 0.4  # of a miss that the next attempt corrects; the rest is taken for chance
    learnt_max_m: float = 0.15  # a miss beyond this was not the bow wave's

    def __post_init__(self) -> None:
        zero = "radius_m", "side_acceleration_m_s2", "learning_share", "learnt_max_m"
        check_numbers("guidance.bow_wave", self, zero=zero, signed=("source_from_tip_m",))

    def at_pressure(self, dynamic_pressure_pa: float) -> "BowWavePush":
        """Return the same for another dynamic pressure [Pa]: c goes with the square of the swing's frequency."""
        c = self.side_acceleration_m_s2 * frequency_ratio(dynamic_pressure_pa) ** 2
        return replace(self, side_acceleration_m_s2=c)

    def at(self, p_PD_m: Array) -> Array:
        """(..., 3) b with the ring's centre at p_PD (..., 3) from the probe's tip, forward left up [m/s^2]."""
        r = p_PD_m - np.array(self.source_from_tip_m)
        distance = np.maximum(np.linalg.norm(r, axis=-1, keepdims=True), max(0.5 * self.radius_m, 1e-9))
        b = self.side_acceleration_m_s2 * 0.25 * self.radius_m**2 * r / distance**3
        b[..., 0] = 0.0
        return np.asarray(b)

    def learnt(self, aim_m: Array, miss_m: Array) -> Array:
        """(2,) where to aim off the predicted place next, after a miss (2,): ring centre from the tip, left and up."""
        miss = _no_longer_than(miss_m, self.learnt_max_m)
        return _no_longer_than(aim_m + self.learning_share * miss, self.learnt_max_m)


def _no_longer_than(v: Array, limit: float) -> Array:
    norm = float(np.hypot(*v))
    return v if norm <= limit else v * (limit / norm)
