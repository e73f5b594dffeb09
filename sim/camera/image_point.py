"""Where on the sensor, or beside it, a direction ahead of the lens is imaged.

The distortion's polynomial [calibration, eq 1] holds over the field it was measured in. Far outside it may fold back:
with k2 = -8e-4 light from 80 degrees off the axis would be imaged in the middle of the frame. So beyond a margin around
the corners a direction is shifted as at the margin:

    p = p(m ab/|ab|) + f (ab - m ab/|ab|),    |ab| > m                                                           (1)

ab being the direction's slopes across the axis and m the margin's.
"""

import math
from functools import lru_cache
from typing import Final

import numpy as np

from dockair.calibration import Camera
from dockair.rotations import Array

_MARGIN: Final = 1.3  # beyond the corners


def image_point(camera: Camera, direction_C: Array) -> Array:
    """(2,) pixel (u, v) of a direction, Eq. (1).

    Args:
        camera: as built.
        direction_C: (3,) in camera axes, x > 0.
    """
    ab = -direction_C[1:] / direction_C[0]
    f, c = camera.focal_length_px, np.array(camera.principal_point_px)
    if camera.distortion is None:
        return np.asarray(c + f * ab)
    inner = ab * min(1.0, margin_slope(camera) / max(math.hypot(*ab), 1e-12))
    return np.asarray(camera.pixels_from_slopes(inner[np.newaxis])[0] + f * (ab - inner))


def image_points(camera: Camera, p_C: Array) -> Array:
    """(n, 2) pixels (u, v) of points p_C (n, 3) [m], camera axes, Eq. (1); NaN where x <= 0."""
    pixels, slopes = camera.pixels_from_points(p_C), np.hypot(p_C[:, 1], p_C[:, 2])
    for i in np.flatnonzero((p_C[:, 0] > 0.0) & (slopes > margin_slope(camera) * p_C[:, 0])):
        pixels[i] = image_point(camera, p_C[i])
    return pixels


def in_field(camera: Camera, direction_C: Array) -> bool:
    """Whether the distortion's polynomial holds for a direction (3,): on the sensor or not far beside it."""
    return bool(math.hypot(*direction_C[1:]) <= margin_slope(camera) * direction_C[0])


@lru_cache(maxsize=8)
def margin_slope(camera: Camera) -> float:
    """Slope m: of the array's farthest corner, distortion left out, and some more; no less than distortion makes it."""
    (u, v), width, height = camera.principal_point_px, camera.width_px - 1.0, camera.height_px - 1.0
    corners = camera.rays_from_pixels(np.array([[0.0, 0.0], [width, 0.0], [0.0, height], [width, height]]))
    straight = math.hypot(max(u, width - u), max(v, height - v)) / camera.focal_length_px
    return max(_MARGIN * straight, float(np.max(np.hypot(corners[:, 1], corners[:, 2]) / corners[:, 0])))
