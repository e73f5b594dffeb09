"""Where a drogue must be for the camera to see it: within four planes through the camera and its sensor's edges.

The centre of a ring that is on an edge has half of its LEDs in view, as many as a ring is found by.

Not modelled: how far LEDs are seen, what of the receiver stands before the camera. A bent image of a straight edge: the
planes go through the sensor's corners.
"""

import numpy as np

from dockair.calibration import Camera, Mounting
from dockair.rotations import Array


class FieldOfView:
    """The camera's field, for a ring's centre as it is seen from the probe's tip, in body axes.

    Args:
        camera: calibration.
        mounting: where camera and tip are.
    """

    def __init__(self, camera: Camera, mounting: Mounting) -> None:
        right, low = camera.width_px - 0.5, camera.height_px - 0.5
        corners_px = np.array([[-0.5, -0.5], [right, -0.5], [right, low], [-0.5, low]])
        rays_B = camera.rays_from_pixels(corners_px) @ mounting.R_BC.T
        across = np.cross(rays_B, np.roll(rays_B, -1, axis=0))
        inward = np.sign(across @ mounting.R_BC[:, 0])[:, np.newaxis]
        self._inward_B = inward * across / np.linalg.norm(across, axis=1, keepdims=True)  # of each edge's plane
        self._p_PC_B: Array = mounting.p_BC - mounting.p_BP

    def nearest_edge(self, p_PD_B: Array) -> int:
        """Number of the edge that a ring's centre (3,) is nearest to, or farthest beyond."""
        return int(np.argmin(self._inside_m(p_PD_B)))

    def holds(self, p_PD_B: Array) -> bool:
        """Whether a ring's centre (3,) is within the field."""
        return bool(self._inside_m(p_PD_B).min() > 0.0)

    def out_m(self, p_PD_B: Array, edge: int) -> Array:
        """(3,) shortest way of a ring's centre (3,) out of the field over an edge, body axes; none from outside."""
        inside_m = self._inside_m(p_PD_B)
        return np.asarray(-inside_m[edge] * self._inward_B[edge]) if inside_m.min() > 0.0 else np.zeros(3)

    def _inside_m(self, p_PD_B: Array) -> Array:
        """(4,) distance from each edge's plane, positive within."""
        return np.asarray(self._inward_B @ (p_PD_B - self._p_PC_B))
