"""Where light falls on the pixels: the lens's point spread function at any depth, splatted.

The blur of a point depends on its depth x through 1/x alone, in which the defocused disc and the die's image are
linear. Cores [point_spread] are made when they are first needed, at steps of 1/x over which either grows by half a
pixel, and interpolated by a parabola; `splat` adds them up.

Every pixel is within 0.7 % of the blob's brightest (f/1.4 to f/16, 1 m to infinity, die to 5 mm, diffusion 0.3 px;
1.5 % without diffusion). The sum is the electrons given. From f/7 on the first moment is the true position; a faster
lens in focus is coarsely sampled, and its pixels bend the centroid as real ones do: 0.025 px at f/2.8.
"""

import math
from dataclasses import replace
from typing import Final

import numpy as np
from numpy.typing import NDArray

from dockair.calibration import Camera
from dockair.kernels import njit
from dockair.rotations import Array
from dockair.sim.camera.point_spread import Spread, airy_px, blur_px, core, transfer
from dockair.sim.camera.sheets import LensParameters, SensorParameters
from dockair.sim.camera.splat import POINT, Tables, missing_levels, splat

NEAREST_M: Final = 0.5  #: nearer points are as blurred as at this depth
_STEP_PX = 0.5  # growth of the disc or of the die's image between two tabulated depths
_LARGEST_M = 5e-3  # a larger square is drawn as 4, 16, ... squares
_SIZES = 16  # of sources whose cores are kept
_EDGE_NODES = 1024


class PointSpread:
    """The point spread function of one lens and sensor at one wavelength. It remembers tables, never results."""

    def __init__(self, lens: LensParameters, sensor: SensorParameters, camera: Camera, wavelength_m: float) -> None:
        """Prepare; cores are made when first needed, 4 ms each at f/8.

        Args:
            lens: f-number and focus.
            sensor: diffusion.
            camera: focal length and pixel pitch.
            wavelength_m: of the light.
        """
        self._lens, self._camera = lens, camera
        self._sharp = Spread(airy=airy_px(lens, camera, wavelength_m), diffusion=sensor.diffusion_px, blur=0.0, die=0.0)
        self._edge_sigma_px = self._edge_sigma()
        self.wing: Final = self._sharp.wing  #: A and w of the wings, [splat, eq 1]
        self._cores: dict[float, _Cores] = {}
        self._widest_px = self._cores_of(_LARGEST_M).widest_px

    def splat(
        self,
        image: NDArray[np.float32],
        start: tuple[int, int],
        pixels: Array,
        electrons: Array,
        depth_m: Array,
        size_m: float,
        smear_px: Array,
        of: NDArray[np.int64] | None = None,
    ) -> None:
        """Add point sources to expected electrons, in place.

        Args:
            image: (rows, columns) of the window.
            start: (row, column) of the window's first pixel.
            pixels: (n, 2) true (u, v) at the middle of the exposure; outside is allowed, NaN adds nothing.
            electrons: (n,) of each whole blob.
            depth_m: (n,) along the lens's axis; infinity for the Sun's.
            size_m: side of the sources, squares that face the lens; 0 for points.
            smear_px: (n, 2) way (du, dv) during the exposure.
            of: numbers of those to add; None for all.
        """
        of, (side, size_m) = np.arange(len(electrons)) if of is None else of, _divided(size_m)
        cores, points = self._cores_of(size_m), np.empty((len(of) * side**2, POINT))
        sources = pixels, electrons, depth_m, smear_px
        _divide(of, side, self._camera.focal_length_px * size_m, cores.levels_m, sources, points)
        cores.make_for(points)
        splat(image, start, points, cores.tables, self.wing)

    def work_ahead(self) -> bool:
        """Make a core beside those that the last points took, in time that nobody waits for; say whether any lacked."""
        return any(cores.work_ahead() for cores in self._cores.values())

    @property
    def widest_px(self) -> int:
        """Half-width of the widest core that any source can have."""
        return self._widest_px

    def edge_sigma_px(self) -> float:
        """Gaussian equivalent [px] of the blur of the Sun's edge: the same slope in the middle of a straight edge."""
        return self._edge_sigma_px

    def _cores_of(self, size_m: float) -> "_Cores":
        if size_m not in self._cores:
            if len(self._cores) == _SIZES:
                del self._cores[next(iter(self._cores))]
            self._cores[size_m] = _Cores(self._lens, self._camera, self._sharp, size_m)
        return self._cores[size_m]

    def _edge_sigma(self) -> float:
        """From the line spread at 0, which is the integral of the spectrum along one axis, the pixel's box included."""
        q, d = self._sharp.airy, self._sharp.diffusion
        blur = abs(float(blur_px(self._lens, self._camera, np.zeros(1))[0]))
        f = (np.arange(_EDGE_NODES) + 0.5) / (_EDGE_NODES * q)
        line = transfer(f, q, blur) * np.exp(-2.0 * (np.pi * d * f) ** 2) * np.sinc(f)
        return 1.0 / (math.sqrt(2.0 * math.pi) * 2.0 * float(line.sum()) / (_EDGE_NODES * q))


def _divided(size_m: float) -> tuple[int, float]:
    """Into how many squares a side a source is cut, and their size."""
    side = 2 ** math.ceil(math.log2(size_m / _LARGEST_M)) if size_m > _LARGEST_M else 1
    return side, size_m / side


@njit(cache=True)
def _divide(
    of: NDArray[np.int64],
    side: int,
    size_f: float,
    levels_m: float,
    sources: tuple[Array, Array, Array, Array],
    points: Array,
) -> None:
    """Fill (m, POINT) of the squares into which some of the sources are cut.

    `size_f` is a square's side times the focal length [m px], `levels_m` level times depth, `sources` as of `splat`.
    """
    pixels, electrons, depth_m, smear_px = sources
    k = 0
    for i in of:
        depth = NEAREST_M if depth_m[i] < NEAREST_M else depth_m[i]
        step_px = size_f / depth if side > 1 else 0.0
        for row in range(side):
            for column in range(side):
                points[k, 0] = pixels[i, 0] + step_px * (column - 0.5 * (side - 1))
                points[k, 1] = pixels[i, 1] + step_px * (row - 0.5 * (side - 1))
                points[k, 2], points[k, 3] = electrons[i] / side**2, levels_m / depth
                points[k, 4], points[k, 5] = smear_px[i, 0], smear_px[i, 1]
                k += 1


class _Cores:
    """Cores of one size of source, at whole levels of 1/x."""

    def __init__(self, lens: LensParameters, camera: Camera, sharp: Spread, size_m: float) -> None:
        nearest = 1.0 / NEAREST_M
        growth = float(np.ptp(blur_px(lens, camera, np.array([0.0, nearest]))))
        growth = max(growth, camera.focal_length_px * size_m * nearest)
        inverse_depth = np.linspace(0.0, nearest, max(int(np.ceil(growth / _STEP_PX)), 2) + 1)
        self.levels_m = 1.0 / float(inverse_depth[1])  #: level = this / depth
        self._sharp = sharp
        self._blurs, self._dies = blur_px(lens, camera, inverse_depth), camera.focal_length_px * size_m * inverse_depth
        self._made = np.zeros(len(inverse_depth), dtype=np.bool_)
        self._begins = np.zeros(len(inverse_depth), dtype=np.int64)
        spreads = [self._spread(k) for k in range(len(inverse_depth))]
        self._half_widths = np.array([spread.half_width for spread in spreads])
        self._phases = np.array([spread.phases for spread in spreads])
        self._pool = np.zeros(0, dtype=np.float32)
        self._points: Array = np.empty((0, POINT))  # that it was last made for
        self.widest_px = int(self._half_widths.max())

    @property
    def tables(self) -> Tables:
        """What `splat` reads."""
        return self._pool, self._begins, self._half_widths, self._phases

    def make_for(self, points: Array) -> None:
        """Make the cores around the depths of points (n, POINT) that lack."""
        self._points = points
        for k in missing_levels(points, self._made, 0):
            self._make(int(k))

    def work_ahead(self) -> bool:
        """Make one of the cores beside those that the last points took: those that come next along the axis."""
        missing = missing_levels(self._points, self._made, 1)
        if len(missing) > 0:
            self._make(int(missing[0]))
        return len(missing) > 0

    def _make(self, k: int) -> None:
        if self._made[k]:
            return
        self._begins[k] = len(self._pool)
        self._pool = np.concatenate([self._pool, core(self._spread(k)).ravel()])
        self._made[k] = True

    def _spread(self, k: int) -> Spread:
        return replace(self._sharp, blur=abs(float(self._blurs[k])), die=float(self._dies[k]))
