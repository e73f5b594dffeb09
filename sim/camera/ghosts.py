"""Ghosts: images of the iris that two reflections between lens surfaces put on the line Sun - centre.

Ghost k of the Sun, whose image stands at p_sun, with c the principal point:

    p_k = c - s_k (p_sun - c),     light f_k x flux                                                              (1)
    pupil, radius z_k/(2 N)  *  image of the Sun, radius |s_k| R                                                 (2)

z_k is how far from the sensor the ghost's light comes to a focus, N the f-number. The larger of the two shapes in (2)
is the ghost's body: a polygon or circle of inscribed radius a; the smaller, of radius g, softens its edge. With
m = max_k n_k.x - a the distance from the body's edge:

    e = f_k flux/(K (a^2 + w^2/5)) S(m/w),   S(t) = (2 - 3 t + t^3)/4 in [-1, 1],   w = g sqrt(5)/2              (3)

K a^2 is the body's area. The edge's law has the variance of a disc's projection, g^2/4, and (3) the energy f_k flux
exactly, as curves of equal m bound areas K (a + m)^2.

Ghosts smaller than 32 px are added pixel by pixel: they are what looks like an LED. Larger ones go to the coarse grid.
Not modelled: vignetting of ghosts (cut-off discs), coma, colour; ghosts of LEDs (1e-4 of 5e4 e- is 5 e-).
Source: first-order ghosts, Lee & Eisemann, Practical real-time lens-flare rendering, EGSR 2013.
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from dockair.kernels import njit
from dockair.rotations import Array
from dockair.sim.camera.coarse_grid import SPACING_PX
from dockair.sim.camera.iris import Iris

_COMPACT_PX = 4.0 * SPACING_PX
_SHARPEST_PX = 1.5 * SPACING_PX  # edge, half-width, that the coarse grid can hold
_SMALLEST_PX = 1.5  # radius: diffraction and the pixel make no image finer


@dataclass(frozen=True, slots=True, eq=False)
class CompactGhosts:
    """Ghosts of an LED's size."""

    pixels: Array  #: (n, 2) their middles (u, v); some may lie outside the sensor
    electrons: Array  #: (n,) of each whole ghost
    radius_px: Array  #: (n,) of a disc of their area


class Ghosts:
    """What the lens makes of the Sun, Eqs. (1) to (3).

    Args:
        iris: shape of the pupil.
        positions: (n,) s_k.
        shares: (n,) f_k.
        pupil_px: (n,) radius of a disc of the defocused pupil's area.
        sun_radius_px: R.
        centre_px: (u, v) c.
    """

    def __init__(
        self,
        iris: Iris,
        positions: Array,
        shares: Array,
        pupil_px: Array,
        sun_radius_px: float,
        centre_px: tuple[float, float],
    ) -> None:
        self.share = float(np.sum(shares))
        self._iris, self._s, self._f, self._c = iris, np.asarray(positions), np.asarray(shares), np.array(centre_px)
        sun = np.abs(self._s) * sun_radius_px
        self._polygon = pupil_px > sun
        self._radius = np.maximum(np.maximum(pupil_px, sun), _SMALLEST_PX)
        self._edge = np.minimum(pupil_px, sun) * math.sqrt(5.0) / 2.0
        self._compact = self._radius + self._edge < _COMPACT_PX

    def places(self, sun_px: Array) -> Array:
        """(n, 2) middles (u, v) of all ghosts, Eq. (1), for the Sun's image at sun_px (2,)."""
        return np.asarray(self._c - self._s[:, None] * (sun_px - self._c))

    def compact(self, sun_px: Array, electrons: float) -> CompactGhosts:
        """The small ghosts of a Sun of so many electrons at sun_px (2,)."""
        k = self._compact
        return CompactGhosts(self.places(sun_px)[k], electrons * self._f[k], self._radius[k])

    def add_to_grid(self, values: NDArray[np.float32], first: tuple[int, int], sun_px: Array, electrons: float) -> None:
        """Add the large ones to nodes (m, n) [e-/px], in place; arguments as of `Halo.add_to_grid`."""
        self._add(values, first, SPACING_PX, sun_px, electrons, ~self._compact)

    def add_to_pixels(
        self, image: NDArray[np.float32], start: tuple[int, int], sun_px: Array, electrons: float
    ) -> None:
        """Add the small ones to expected electrons, in place; arguments as of `Halo.add_to_pixels`."""
        self._add(image, start, 1, sun_px, electrons, self._compact)

    def _add(
        self,
        image: NDArray[np.float32],
        start: tuple[int, int],
        spacing: int,
        sun_px: Array,
        electrons: float,
        which: NDArray[np.bool_],
    ) -> None:
        places = self.places(sun_px)
        sharpest = _SHARPEST_PX if spacing > 1 else _SMALLEST_PX
        for k in np.flatnonzero(which):
            round_iris = Iris(blades=0, angle_rad=0.0)
            iris = self._iris if self._polygon[k] else round_iris
            a = iris.inscribed_radius(float(self._radius[k]))
            w = min(max(float(self._edge[k]), sharpest), a)
            level = electrons * float(self._f[k]) / (iris.area_factor * (a**2 + w**2 / 5.0))
            u, v = places[k]
            corner = a / math.cos(math.pi / iris.blades) if iris.blades else a
            _add_body(image, start, spacing, (u, v), iris.normals, (a, w, corner * (a + w) / a), level)


@njit(cache=True)
def _add_body(
    image: NDArray[np.float32],
    start: tuple[int, int],
    spacing: int,
    centre: tuple[float, float],
    normals: Array,
    shape: tuple[float, float, float],
    level: float,
) -> None:
    """Eq. (3) at rows spacing (start + i), columns spacing (start + j); shape is a, w and the radius that holds all."""
    a, w, reach = shape
    u, v = centre
    i0 = max(int(math.ceil((v - reach) / spacing)) - start[0], 0)
    i1 = min(int(math.floor((v + reach) / spacing)) + 1 - start[0], image.shape[0])
    j0 = max(int(math.ceil((u - reach) / spacing)) - start[1], 0)
    j1 = min(int(math.floor((u + reach) / spacing)) + 1 - start[1], image.shape[1])
    for i in range(i0, i1):
        dv = spacing * (start[0] + i) - v
        for j in range(j0, j1):
            du = spacing * (start[1] + j) - u
            if normals.shape[0] == 0:
                m = math.sqrt(du * du + dv * dv) - a
            else:
                m = -math.inf
                for k in range(normals.shape[0]):
                    m = max(m, normals[k, 0] * du + normals[k, 1] * dv - a)
            t = m / w
            if t >= 1.0:
                continue
            image[i, j] += level * (1.0 if t <= -1.0 else 0.25 * (2.0 - 3.0 * t + t * t * t))
