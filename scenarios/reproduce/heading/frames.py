"""Frames of the racetrack: the scenario's camera in the whole world, put where the receiver and its tanker are.

The camera's own code draws deck, coast and ground, and before them tanker, hose, drogue and probe, which stand still in
the picture: a mask leaves them out. Exposure is the longest of the camera's sheet, 500 us; at the 20 us that the LEDs
want, the ground is 2 to 4 of 255 grey levels bright and nothing can be matched.
Not modelled: the swing of the drogue (it hangs as at rest); blur by the turn (0.04 px in 500 us).
"""

from collections.abc import Iterator
from contextlib import contextmanager

import cv2
import mujoco
import numpy as np
from numpy.typing import NDArray

from dockair.messages import CameraFrame
from dockair.rotations import Array, quaternion_from_matrix
from dockair.scenarios.reproduce.heading.formation import Formation
from dockair.scenarios.studio import Studio, studio
from dockair.sim.camera.obstacles import Obstacles
from dockair.sim.camera.occlusion import first_hits

EXPOSURE_S = 500e-6
_AHEAD_M = 8.0  # of the drogue's ring, from the lens
_MASK_STEP_PX = 8  # between the rays of the mask
_MASK_MARGIN_STEPS = 6  # by which it is wider than what stands there, which is half a metre at 8 m: the drogue swings
_SETTINGS = {"camera.exposure": "fixed", "parameters.exposure.exposure_s": EXPOSURE_S}


class FormationCamera:
    """Takes frames at samples of a formation; `frames` makes and closes what it needs."""

    def __init__(self, formation: Formation, made: Studio) -> None:
        self._formation, self._studio = formation, made
        self._model = made.parts.world.model
        self._data = made.ahead(_AHEAD_M)
        tanker, receiver = (self._model.joint(name).qposadr[0] for name in ("tanker", "receiver"))
        self._tanker, self._receiver = (slice(first, first + 7) for first in (int(tanker), int(receiver)))
        self._start = self._data.qpos.copy()

    @property
    def R_BC(self) -> Array:
        """(3, 3) nominal mounting: what the navigation is told."""
        return np.asarray(self._studio.parts.sheets.mounting.R_BC)

    def take(self, sample: int) -> CameraFrame:
        """The frame at a sample."""
        self._put(sample)
        frame = self._studio.camera.expose(self._data, float(self._formation.time_s[sample]), sample, None)
        assert frame is not None, "no fault is set"
        return frame

    def mask(self) -> NDArray[np.bool_]:
        """(h, w) where features may lie: what no tanker, hose, drogue or probe hides at the start, and a margin."""
        self._put(0)
        camera = self._studio.parts.sheets.camera
        R_WC, p_WC = self._studio.camera.pose(self._data)
        rows, columns = (np.arange(_MASK_STEP_PX // 2, n, _MASK_STEP_PX) for n in (camera.height_px, camera.width_px))
        u, v = np.meshgrid(columns, rows)
        rays = camera.rays_from_pixels(np.column_stack([u.ravel(), v.ravel()])) @ R_WC.T
        hits = first_hits(Obstacles.of(self._model), self._data, p_WC, np.ascontiguousarray(rays), np.inf) >= 0.0
        side = 2 * _MASK_MARGIN_STEPS + 1
        wider = cv2.dilate(hits.reshape(u.shape).astype(np.uint8), np.ones((side, side), np.uint8))
        size = camera.width_px, camera.height_px
        return np.asarray(cv2.resize(wider, size, interpolation=cv2.INTER_NEAREST) == 0)

    def _put(self, sample: int) -> None:
        f, data = self._formation, self._data
        R_WT, p_WT = f.tanker_attitude(sample), f.places_W[sample]
        data.qpos[self._tanker] = [*(p_WT + R_WT @ self._start[self._tanker][:3]), *quaternion_from_matrix(R_WT)]
        place = p_WT + R_WT @ self._start[self._receiver][:3]
        data.qpos[self._receiver] = [*place, *quaternion_from_matrix(f.attitudes_R_WB[sample])]
        data.qvel[:] = 0.0
        data.time = f.time_s[sample]  # what passes below goes by it
        mujoco.mj_forward(self._model, data)

    def below_horizon(self, R_LB: Array) -> NDArray[np.bool_]:
        """(h, w) what lies below the level by the aircraft's own roll and pitch: there is nothing to match above it."""
        camera = self._studio.parts.sheets.camera
        step = _MASK_STEP_PX
        u, v = np.meshgrid(*(np.arange(step // 2, n, step) for n in (camera.width_px, camera.height_px)))
        rays = camera.rays_from_pixels(np.column_stack([u.ravel(), v.ravel()])) @ (R_LB @ self.R_BC).T
        below = (rays[:, 2] < 0.0).reshape(u.shape).astype(np.uint8)
        return np.asarray(cv2.resize(below, (camera.width_px, camera.height_px), interpolation=cv2.INTER_NEAREST) > 0)


@contextmanager
def formation_camera(formation: Formation, seed: int = 3) -> Iterator[FormationCamera]:
    """Yield the camera, and close it."""
    with studio(_SETTINGS, seed) as made:
        yield FormationCamera(formation, made)
