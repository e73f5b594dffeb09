"""How the receiver's own bow wave moves the drogue across as the probe comes near, as guidance believes it.

    b(x) = b_0 / (1 + x/L)^2                                                              (1)

x is the distance from the probe's tip to the ring, b_0 the push at contact (left, up), L its reach. What lies ahead of
the receiver by its own response is b at a later x; the difference to now is where the drogue is going to be besides its
swing, and its rate the velocity with which it will go there.

Valid for the closing speeds of an approach; the drogue's lag behind the push is in b_0 and L.
Not modelled: the push along x, its change with the place of the nose about the drogue.
Source: fitted to approaches of the simulated fighter in still air with and without the bow wave: 0.11 m at contact,
0.042 m at 1 m, 0.019 m at 2 m, away from the nose.
"""

from dataclasses import dataclass

import numpy as np

from dockair.rotations import Array


@dataclass(frozen=True, slots=True, kw_only=True)
class BowWavePush:
    """Eq. (1)."""

    at_contact_m: tuple[float, float] = (-0.11, 0.013)  # b_0: to the right, where the probe stands right of the nose
    reach_m: float = 1.5  # L
    lead_s: float = 0.5  # tau and the lag of the drogue's filter

    def ahead(self, distance_m: float, closing_m_s: float) -> tuple[Array, Array]:
        """(2,) way [m] and change of velocity [m/s] that the push adds within the lead time; left, up.

        Args:
            distance_m: x, now.
            closing_m_s: with which it shrinks.
        """
        if distance_m <= 0.0 or closing_m_s <= 0.0:
            return np.zeros(2), np.zeros(2)
        later_m = max(distance_m - closing_m_s * self.lead_s, 0.0)
        b_0 = np.array(self.at_contact_m)
        here, there = 1.0 + distance_m / self.reach_m, 1.0 + later_m / self.reach_m
        way = b_0 * (there**-2 - here**-2)
        rate = b_0 * (2.0 * closing_m_s / self.reach_m) * (there**-3 - here**-3)
        return way, rate
