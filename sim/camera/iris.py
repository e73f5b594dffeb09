"""The iris: the shape of its opening, and the far wing of its diffraction, gathered into spikes by straight edges.

An opening of area A and perimeter P sends far from its geometric image, beyond a distance r, the part

    Q/r,    Q = P lambda f/(2 pi^2 A)                of a point's light                                          (1)

(for a circle 2 lambda N/(pi^2 r), the Airy pattern's tail). A straight edge sends its share along its normal, to both
sides: as many spikes as blades if their number is even, twice as many if odd. Per unit length along a spike a point
has Q/(M r^2), M spikes. For the Sun, radius R in the image, light bent by less than about R stays in the disc:

    l(s) = w/M (s/R^2) (1 + s^2/R^2)^(-3/2),   w = Q/R      from the Sun's centre; all of it is w, its tail Q/M s^2  (2)
    across:  b(t) = 15/(16 z) (1 - t^2/z^2)^2,   z^2 = 7 (R^2/4 + (c s)^2)                                       (3)

The profile across has the variance of the disc's, R^2/4, and of the fan c by which real edges are not straight; the
coarse grid holds it to an eighth of its middle. What blades leave round, 1 - spike_share, is a halo of the law (2) in
all directions [halo, eq 1 with p = 3/2, core R].

An LED's spikes are left out: one of 5e4 e- at f/8 with 6 blades has, 6 px from its middle where its blob has ended,
60 e- in each pixel-wide length of a spike and 30 e- in a pixel, half a grey level of eight bits; it falls as r^-2.
Not modelled: the fine fringes (the Sun's disc and the band's width wash them out); a fully open, round iris.
Sources: Born & Wolf, Principles of Optics, sections 8.5.2 and 8.5.3; Parseval's theorem along an edge's normal.
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from dockair.kernels import njit
from dockair.rotations import Array
from dockair.sim.camera.coarse_grid import SPACING_PX


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Iris:
    """A regular polygon, or a circle where it has no blades."""

    blades: int  #: 0 (round), or 3 and more
    angle_rad: float  #: of the first blade's outward normal, from +u toward +v

    @property
    def area_factor(self) -> float:
        """Area over the square of the inscribed circle's radius: pi of a circle."""
        return self.blades * math.tan(math.pi / self.blades) if self.blades else math.pi

    @property
    def normals(self) -> Array:
        """(blades, 2) outward normals of the edges (u, v)."""
        angle = self.angle_rad + 2.0 * np.pi * np.arange(self.blades) / max(self.blades, 1)
        return np.column_stack([np.cos(angle), np.sin(angle)])

    @property
    def spikes(self) -> Array:
        """(M, 2) unit vectors (u, v) along which spikes run."""
        return self.normals if self.blades % 2 == 0 else np.vstack([self.normals, -self.normals])

    def inscribed_radius(self, radius: float) -> float:
        """Radius of the inscribed circle where the opening's area is that of a circle of the given radius."""
        return radius * math.sqrt(math.pi / self.area_factor)

    def wing_px(self, wavelength_m: float, f_number: float, pixel_pitch_m: float) -> float:
        """Q of Eq. (1) in pixels: P/A is 2 over the inscribed radius."""
        return 2.0 * wavelength_m * f_number / (math.pi**2 * self.inscribed_radius(1.0) * pixel_pitch_m)


class Spikes:
    """Spikes of the Sun, Eqs. (2) and (3).

    Args:
        iris: the opening.
        share: part of the Sun's flux in all spikes together.
        sun_radius_px: R.
        fan_rad: c.
    """

    def __init__(self, iris: Iris, share: float, sun_radius_px: float, fan_rad: float) -> None:
        self.share = share if iris.blades else 0.0
        self._directions = np.ascontiguousarray(iris.spikes)
        self._sun_radius, self._fan = sun_radius_px, fan_rad

    def add_to_grid(
        self, values: NDArray[np.float32], first: tuple[int, int], centre: tuple[float, float], electrons: float
    ) -> None:
        """Add them to nodes, in place.

        Args:
            values: (m, n) [e-/px].
            first: of the grid.
            centre: (u, v) of the Sun's image.
            electrons: its flux.
        """
        if self.share > 0.0:
            each = electrons * self.share / len(self._directions)
            _add(values, first, SPACING_PX, centre, self._directions, each, self._sun_radius, self._fan)


@njit(cache=True)
def _spike(along: float, across: float, radius: float, fan: float) -> float:
    """Part of one spike's light per square pixel, Eqs. (2) and (3)."""
    z2 = 7.0 * (0.25 * radius * radius + fan * fan * along * along)
    a = 1.0 - across * across / z2
    if along <= 0.0 or a <= 0.0:
        return 0.0
    q = 1.0 + along * along / (radius * radius)
    return along / (radius * radius * q * math.sqrt(q)) * 0.9375 * a * a / math.sqrt(z2)


@njit(cache=True)
def _add(
    values: NDArray[np.float32],
    first: tuple[int, int],
    spacing: int,
    centre: tuple[float, float],
    directions: Array,
    electrons: float,
    radius: float,
    fan: float,
) -> None:
    m, n = values.shape
    widest = math.sqrt(7.0)
    for d in range(directions.shape[0]):
        x, y = directions[d]
        steep = abs(y) > abs(x)
        major = y if steep else x
        for k in range(m if steep else n):  # along the axis that the spike is nearer to
            near = spacing * (first[0] + k) - centre[1] if steep else spacing * (first[1] + k) - centre[0]
            along = abs(near / major)
            half = widest * (0.5 * radius + fan * along) / (1.0 - widest * fan)  # no node beyond has z > |t|
            if near / major < -half:
                continue
            middle = near * (x / y if steep else y / x) + (centre[0] if steep else centre[1])
            reach = half / abs(major)
            origin = first[1] if steep else first[0]
            low = max(int(math.ceil((middle - reach) / spacing)) - origin, 0)
            high = min(int(math.floor((middle + reach) / spacing)) - origin + 1, n if steep else m)
            for other in range(low, high):
                i, j = (k, other) if steep else (other, k)
                du, dv = spacing * (first[1] + j) - centre[0], spacing * (first[0] + i) - centre[1]
                values[i, j] += electrons * _spike(du * x + dv * y, dv * x - du * y, radius, fan)
