"""Point sources on the image: which of them reach into the window, and their light there.

A source of side a at depth x is imaged f a/x wide. Up to WIDE_PX it is spread by the lens [optics], beyond that it is
a patch of its own width [patches]. Whether something hides a source is asked only of those whose light would reach the
window: rays cost more than the rest, and what does not reach it leaves every pixel as it is.

Far beside the field the distortion is that of its margin [image_point]: the polynomial would fold light from 76 degrees
off the axis into the frame.
"""

import math
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from dockair.calibration import Camera
from dockair.kernels import njit
from dockair.rotations import Array
from dockair.sim.camera.dirt import Dirt
from dockair.sim.camera.image_point import margin_slope
from dockair.sim.camera.optics import PointSpread
from dockair.sim.camera.patches import add_patches
from dockair.sim.camera.point_sources import WIDE_PX, Sources
from dockair.sim.camera.splat import reach_window

_FAINTEST_E = 0.5  # a whole blob with fewer electrons is left out
_WIDE = -1.0  # in the place of a size: drawn first, without the lens's blur
_SQUARE_SIGMAS = float(np.sqrt(12.0))  # side of a square over its standard deviation

#: f, c_u, c_v [px], k1, k2, p1, p2, k3, and the slope off the axis up to which the distortion's polynomial holds.
Lens = tuple[float, float, float, float, float, float, float, float, float]


class Blobs:
    """Adds the light of point sources to images.

    Args:
        camera: as built.
        spread: of its lens.
    """

    def __init__(self, camera: Camera, spread: PointSpread) -> None:
        self._camera, self._spread = camera, spread
        self._lens = _lens(camera)

    def add(
        self,
        image: NDArray[np.float32],
        start: tuple[int, int],
        sources: Sources,
        dirt: Dirt | None,
        are_seen: Callable[[NDArray[np.intp]], NDArray[np.bool_]],
    ) -> None:
        """Add what can be seen of sources to expected electrons, in place.

        Args:
            image: (rows, columns) of the window.
            start: (row, column) of its first pixel on the sensor.
            sources: what might be seen.
            dirt: dims the light; None for none.
            are_seen: tells of some of the sources (k,) which are not hidden, (k,).
        """
        count = len(sources.electrons)
        pixels, smear, width_px = np.empty((count, 2)), np.empty((count, 2)), np.empty(count)
        _image(sources.p_C, sources.way_C_m, sources.size_m, self._lens, pixels, smear, width_px)
        electrons, faintest, spread = sources.electrons, _FAINTEST_E, self._spread
        near = reach_window(
            image.shape, start, pixels, smear, electrons, faintest, width_px, spread.widest_px, spread.wing
        )
        near = near[are_seen(near)]
        if dirt is not None:
            electrons = electrons.copy()
            electrons[near] *= dirt.at(pixels[near])
        sizes = np.empty(len(near))
        _sizes(near, sources.size_m, width_px, sizes)
        for size_m in sorted(set(sizes.tolist())):
            of = near[sizes == size_m]
            if size_m == _WIDE:
                add_patches(image, start, pixels[of], electrons[of], width_px[of] / _SQUARE_SIGMAS)
            else:
                spread.splat(image, start, pixels, electrons, sources.p_C[:, 0], size_m, smear, of)


def _lens(camera: Camera) -> Lens:
    (u, v), distortion = camera.principal_point_px, camera.distortion
    margin = math.inf if distortion is None else margin_slope(camera)
    return camera.focal_length_px, float(u), float(v), *(distortion or (0.0,) * 5), margin


@njit(cache=True)
def _image(p_C: Array, way_C: Array, size_m: Array, lens: Lens, pixels: Array, smear: Array, width_px: Array) -> None:
    """Fill (n, 2) pixels of points, their motion, and (n,) widths: `image_points`, compiled."""
    for i in range(len(p_C)):
        x, y, z = p_C[i]
        dx, dy, dz = 0.5 * way_C[i, 0], 0.5 * way_C[i, 1], 0.5 * way_C[i, 2]
        pixels[i, 0], pixels[i, 1] = _pixel(x, y, z, lens)
        u1, v1 = _pixel(x + dx, y + dy, z + dz, lens)
        u0, v0 = _pixel(x - dx, y - dy, z - dz, lens)
        smear[i, 0], smear[i, 1] = u1 - u0, v1 - v0
        width_px[i] = size_m[i] * lens[0] / x if x > 0.0 else 0.0


@njit(cache=True)
def _sizes(near: NDArray[np.int64], size_m: Array, width_px: Array, out: Array) -> None:
    """Fill (k,) as how large some of the sources (n,) are drawn."""
    for k in range(len(near)):
        out[k] = _WIDE if width_px[near[k]] >= WIDE_PX else size_m[near[k]]


@njit(cache=True)
def _pixel(x: float, y: float, z: float, lens: Lens) -> tuple[float, float]:
    """[calibration, eq 1], far off the axis [image_point, eq 1]; NaN behind the lens."""
    if x <= 0.0:
        return math.nan, math.nan
    f, c_u, c_v, k1, k2, p1, p2, k3, margin = lens
    a, b = -y / x, -z / x
    r2, beyond_a, beyond_b = a * a + b * b, 0.0, 0.0
    if r2 > margin * margin:
        part = margin / math.sqrt(r2)
        beyond_a, beyond_b = a - part * a, b - part * b
        a, b, r2 = part * a, part * b, margin * margin
    s = 1.0 + r2 * (k1 + r2 * (k2 + r2 * k3))
    return (
        c_u + f * (a * s + 2 * p1 * a * b + p2 * (r2 + 2 * a * a) + beyond_a),
        c_v + f * (b * s + p1 * (r2 + 2 * b * b) + 2 * p2 * a * b + beyond_b),
    )
