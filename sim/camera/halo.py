"""The halo: light that the lens's surfaces and the dust on them scatter around the Sun's image.

Part k scatters the share w_k of a point's light by a law that falls off as a power; over the plane it is all of w_k:

    h_k(r) = w_k (p_k - 1)/(pi r_k^2) (1 + r^2/r_k^2)^-p_k                                                       (1)
    beyond r:   w_k (1 + r^2/r_k^2)^(1 - p_k)                                                                    (2)

which is Harvey's law of scatter from polished surfaces (slope -2 p_k, shoulder r_k). The Sun's is (1) averaged over
the disc of radius R about r.

Around the disc it is too steep for the nodes of a coarse grid. Within r_b = 96 pixels the grid carries the parabola
that continues it with its slope, and the rest is added pixel by pixel:

    grid:  h(r_b) + h'(r_b) (r^2 - r_b^2)/(2 r_b),      pixels:  h(r) - grid                                     (3)

Both are tables in x = r/(r + 100 px), so that 4096 cells reach from 0.02 px to infinity.
Not modelled: change of the law with the angle of incidence; halos of LEDs (below).
An LED of 5e4 e- has 0.008 e- per pixel of halo at 5 px, by (1) and the sheet: 1.5e-4 of a grey level.
Sources: Harvey, Light-Scattering Characteristics of Optical Surfaces, thesis, University of Arizona, 1976; its form
was found again in measurements of camera lenses: Ritt et al., Sensors 20 (2020) 6308.
"""

import math

import numpy as np
from numpy.typing import NDArray

from dockair.kernels import njit
from dockair.rotations import Array
from dockair.sim.camera.coarse_grid import SPACING_PX

_NEAR_PX = 12.0 * SPACING_PX
_NEAR_RADII = 4.0  # r_b is never less than so many radii of the disc
_KNEE_PX = 100.0
_CELLS = 4096
_DISC_NODES = 16  # of the quadrature over the Sun's disc, in radius and in angle


class Halo:
    """Tables of the Sun's halo per unit of its flux, part by part.

    Args:
        shares: (n,) w_k.
        cores_px: (n,) r_k.
        exponents: (n,) p_k > 1.
        sun_radius_px: R.
    """

    def __init__(self, shares: Array, cores_px: Array, exponents: Array, sun_radius_px: float) -> None:
        self.shares = np.asarray(shares, dtype=float)  #: (n,) of the flux, each over the whole plane
        self.near_px = max(_NEAR_PX, _NEAR_RADII * sun_radius_px)  #: r_b
        self._law = self.shares, np.asarray(cores_px, dtype=float), np.asarray(exponents, dtype=float)
        self._sun_radius = sun_radius_px
        x = np.arange(_CELLS) / _CELLS
        r = _KNEE_PX * x / (1.0 - x)
        law = self.densities(r)
        b, step = self.near_px, 1e-3 * self.near_px
        low, at, high = self.densities(np.array([b - step, b, b + step])).T[:, :, None]
        grid = np.where(r < b, at + (high - low) / (4.0 * step * b) * (r**2 - b**2), law)
        infinity = np.zeros((len(law), 1))
        self._grid, self._rest = np.hstack([grid, infinity]), np.hstack([law - grid, infinity])

    def densities(self, r_px: Array) -> Array:
        """(n, m) flux of each part per square pixel at distances r_px (m,) from the middle of the Sun's image."""
        shares, cores, exponents = self._law
        nodes, weights = np.polynomial.legendre.leggauss(_DISC_NODES)
        s = self._sun_radius * np.sqrt(0.5 * (nodes + 1.0))  # even in area
        angle = np.pi * (np.arange(_DISC_NODES) + 0.5) / _DISC_NODES
        r = np.asarray(r_px, dtype=float)[:, None, None]
        squared = r**2 + s[:, None] ** 2 + 2.0 * r * s[:, None] * np.cos(angle)
        parts = np.empty((len(shares), len(squared)))
        for k, (w, core, p) in enumerate(zip(shares, cores, exponents, strict=True)):
            law = w * (p - 1.0) / (np.pi * core**2) * (1.0 + squared / core**2) ** -p  # Eq. (1)
            parts[k] = np.einsum("i,nij->n", 0.5 * weights, law) / _DISC_NODES
        return parts

    def add_to_grid(
        self, values: NDArray[np.float32], first: tuple[int, int], centre: tuple[float, float], electrons: Array
    ) -> None:
        """Add the smooth part of Eq. (3) to nodes, in place.

        Args:
            values: (m, n) [e-/px].
            first: of the grid.
            centre: (u, v) of the Sun's image.
            electrons: (n,) the flux that each part is a share of.
        """
        _add_to_grid(values, first, SPACING_PX, centre, _KNEE_PX, electrons @ self._grid)

    def add_to_pixels(
        self, image: NDArray[np.float32], start: tuple[int, int], centre: tuple[float, float], electrons: Array
    ) -> None:
        """Add the rest of Eq. (3) to expected electrons, in place.

        Args:
            image: (rows, columns) of the window.
            start: (row, column) of its first pixel on the sensor.
            centre: (u, v) of the Sun's image.
            electrons: (n,) the flux that each part is a share of.
        """
        _add_to_pixels(image, start, centre, self.near_px, _KNEE_PX, electrons @ self._rest)


@njit(cache=True)
def _add_to_grid(
    values: NDArray[np.float32],
    first: tuple[int, int],
    spacing: int,
    centre: tuple[float, float],
    knee: float,
    table: Array,
) -> None:
    cells = table.shape[0] - 1
    for i in range(values.shape[0]):
        dv = spacing * (first[0] + i) - centre[1]
        for j in range(values.shape[1]):
            du = spacing * (first[1] + j) - centre[0]
            r = math.sqrt(du * du + dv * dv)
            x = cells * (r / (r + knee))
            k = min(int(x), cells - 1)
            values[i, j] += table[k] + (x - k) * (table[k + 1] - table[k])


@njit(cache=True)
def _add_to_pixels(
    image: NDArray[np.float32],
    start: tuple[int, int],
    centre: tuple[float, float],
    reach: float,
    knee: float,
    table: Array,
) -> None:
    cells = table.shape[0] - 1
    rows, columns = image.shape
    top, bottom = max(math.ceil(centre[1] - reach), start[0]), min(math.floor(centre[1] + reach) + 1, start[0] + rows)
    for r in range(top, bottom):
        dv = r - centre[1]
        half = math.sqrt(max(reach * reach - dv * dv, 0.0))
        left = max(math.ceil(centre[0] - half), start[1])
        right = min(math.floor(centre[0] + half) + 1, start[1] + columns)
        for c in range(left, right):
            du = c - centre[0]
            d = math.sqrt(du * du + dv * dv)
            x = cells * (d / (d + knee))
            k = min(int(x), cells - 1)
            image[r - start[0], c - start[1]] += table[k] + (x - k) * (table[k + 1] - table[k])
