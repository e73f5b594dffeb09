"""The Sun's disc in the image: an ellipse of even brightness with a blurred edge.

Directions within an angle a of the Sun are imaged, to first order in a, on the ellipse

    p = p_sun + a J e,   |e| <= 1,     J = d pixel/d direction across the line of sight                          (1)
    q = |(a J)^-1 (p - p_sun)|,   t = (q - 1)/|grad q|      distance from the edge, outward [px]                 (2)
    e(p) = flux / (pi a^2 |det J| + pi s^2) x erfc(t/(s sqrt 2))/2                                               (3)

J holds the stretch of a flat image (1/cos^2 t along the radius, 1/cos t across) and the lens's distortion. A pixel's
light is flux over area, so that cos^4 t comes out by itself. s is the blur of the edge; an edge softened along its
normal by a law of variance s^2 adds pi s^2 to the area (Steiner), which (3) takes back.

Not modelled: limb darkening (the edge has about half of the middle, both hundreds of times over full well).
Sources: Steiner's formula for parallel bodies; Cox, Allen's Astrophysical Quantities, section 14.7 (limb darkening).
"""

import math

import numpy as np
from numpy.typing import NDArray

from dockair.calibration import Camera
from dockair.kernels import njit
from dockair.rotations import Array

_STEP_RAD = 1e-4  # of the differences that make J; pixels are smooth over a thousand times that
_EDGE_SIGMAS = 6.0  # beyond this the blurred edge has ended: 1e-9 of the disc's brightness


def image_of_disc(camera: Camera, sun_C: Array, radius_rad: float) -> tuple[Array, Array]:
    """Return the centre (2,) [px] and the matrix a J (2, 2) [px] of Eq. (1).

    Args:
        camera: as built, distortion included.
        sun_C: (3,) unit vector toward the Sun, imaged on the sensor or close to it.
        radius_rad: of the disc.
    """
    across = np.cross(sun_C, np.eye(3)[int(np.argmin(np.abs(sun_C)))])
    across /= np.linalg.norm(across)
    sides = np.array([across, np.cross(sun_C, across)])
    pixels = camera.pixels_from_points(np.vstack([sun_C, sun_C + _STEP_RAD * sides, sun_C - _STEP_RAD * sides]))
    J = (pixels[1:3] - pixels[3:5]).T / (2.0 * _STEP_RAD)
    return pixels[0], radius_rad * J


def add_disc(
    image: NDArray[np.float32],
    start: tuple[int, int],
    disc: tuple[Array, Array],
    electrons: float,
    transmittance: Array,
    first: tuple[int, int],
    edge_sigma_px: float,
) -> None:
    """Add the disc to expected electrons, in place, Eq. (3).

    Args:
        image: (rows, columns) of the window.
        start: (row, column) of its first pixel on the sensor.
        disc: of `image_of_disc`.
        electrons: of the whole disc.
        transmittance: (m, n) of each pixel around the disc, 0 (hidden) to 1; pixels outside get nothing.
        first: (row, column) on the sensor of its first pixel.
        edge_sigma_px: s.
    """
    centre, shape = disc
    area = np.pi * (abs(float(np.linalg.det(shape))) + edge_sigma_px**2)
    inverse = np.linalg.inv(shape)
    _add(image, start, centre, inverse, electrons / area, np.asarray(transmittance, dtype=float), first, edge_sigma_px)


@njit(cache=True)
def _add(
    image: NDArray[np.float32],
    start: tuple[int, int],
    centre: Array,
    inverse: Array,
    level: float,
    transmittance: Array,
    first: tuple[int, int],
    sigma: float,
) -> None:
    rows, columns = image.shape
    top, left = max(first[0], start[0]), max(first[1], start[1])
    bottom = min(first[0] + transmittance.shape[0], start[0] + rows)
    right = min(first[1] + transmittance.shape[1], start[1] + columns)
    for r in range(top, bottom):
        dv = r - centre[1]
        for c in range(left, right):
            du = c - centre[0]
            a = inverse[0, 0] * du + inverse[0, 1] * dv
            b = inverse[1, 0] * du + inverse[1, 1] * dv
            q = math.sqrt(a * a + b * b)
            if q > 1e-9:
                g_u = (a * inverse[0, 0] + b * inverse[1, 0]) / q
                g_v = (a * inverse[0, 1] + b * inverse[1, 1]) / q
                t = (q - 1.0) / math.sqrt(g_u * g_u + g_v * g_v)  # Eq. (2)
            else:
                t = -math.inf
            if t > _EDGE_SIGMAS * sigma:
                continue
            share = 0.5 * math.erfc(t / (math.sqrt(2.0) * sigma))
            image[r - start[0], c - start[1]] += level * share * transmittance[r - first[0], c - first[1]]
