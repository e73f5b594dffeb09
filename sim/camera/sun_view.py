"""How much of the Sun's disc the lens sees: hidden by the scene along rays, dimmed by cloud.

    visible = mean over the disc of clear(d) beam(d)                                                             (1)

clear(d) is 1 where nothing lies along the ray d, beam(d) the cloud's transmittance. For what all of the disc does
(stray light) the mean is taken over the rays of `sun_beam`; for the disc's image, pixel by pixel: clouds at every
pixel, the scene in blocks of k x k pixels.

Not modelled: diffraction at the edges of what hides it; the camera's own place within its lens.
"""

import mujoco
import numpy as np

from dockair.calibration import Camera
from dockair.rotations import Array
from dockair.sim.camera.image_point import in_field
from dockair.sim.camera.obstacles import Obstacles
from dockair.sim.camera.occlusion import clear_directions
from dockair.sim.camera.sun_beam import Beam, SunBeam

_BLOCK_PX = 2


class SunView:
    """The Sun as one camera sees it.

    Args:
        model: what may hide it.
        camera: as built.
        sky: clouds.
        sun_W: (3,) unit vector toward the Sun.
        radius_rad: of its disc.
        margin_px: how far the blurred disc reaches beyond its edge.

    Attributes:
        direction_W: (3,) unit vector toward the Sun.
        beam: part of the sunlight that comes through the clouds.
    """

    def __init__(
        self, model: mujoco.MjModel, camera: Camera, sky: Beam, sun_W: Array, radius_rad: float, margin_px: float
    ) -> None:
        self._obstacles, self._camera, self._sky = Obstacles.of(model), camera, sky
        self.direction_W = sun_W
        self._radius_px = camera.focal_length_px * float(np.tan(radius_rad)) + margin_px
        self._disc = SunBeam.of(sky, sun_W, radius_rad)
        self.beam = self._disc.mean

    def visible(self, data: mujoco.MjData, p_WC: Array) -> float:
        """Part of the disc that the lens sees, Eq. (1)."""
        clear = clear_directions(self._obstacles, data, p_WC, self._disc.directions_W)
        return float((self._disc.beams * clear).mean())

    def patch(self, data: mujoco.MjData, pose: tuple[Array, Array]) -> tuple[Array, tuple[int, int]] | None:
        """What the pixels around the disc's image see of it.

        Args:
            data: positions up to date.
            pose: R_WC and p_WC of the camera.

        Returns:
            (m, n) transmittance 0 to 1 of each pixel, and the sensor's (row, column) of the first; None where the disc
            falls beside the sensor.
        """
        R_WC, p_WC = pose
        sun_C = R_WC.T @ self.direction_W
        if not in_field(self._camera, sun_C):
            return None
        u, v = self._camera.pixels_from_points(sun_C[None])[0]
        reach = self._radius_px / float(sun_C[0]) ** 2  # off the axis the disc is drawn out
        if not (-reach < u < self._camera.width_px + reach and -reach < v < self._camera.height_px + reach):
            return None
        first = int((v - reach) // _BLOCK_PX), int((u - reach) // _BLOCK_PX)
        count = int(2.0 * reach // _BLOCK_PX) + 2
        centres = _BLOCK_PX * (np.arange(count) + 0.5) - 0.5
        rays = self._rays_W(R_WC, _BLOCK_PX * first[0] + centres, _BLOCK_PX * first[1] + centres)
        clear = clear_directions(self._obstacles, data, p_WC, rays).reshape(count, count)
        start = _BLOCK_PX * first[0], _BLOCK_PX * first[1]
        fine = np.arange(float(_BLOCK_PX * count))
        dimmed = self._sky.beam(self._rays_W(R_WC, start[0] + fine, start[1] + fine)).reshape(len(fine), len(fine))
        return np.asarray(dimmed * np.kron(clear, np.ones((_BLOCK_PX, _BLOCK_PX)))), start

    def _rays_W(self, R_WC: Array, rows: Array, columns: Array) -> Array:
        u, v = np.meshgrid(columns, rows)
        return np.asarray(self._camera.rays_from_pixels(np.column_stack([u.ravel(), v.ravel()])) @ R_WC.T)
