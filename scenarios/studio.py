"""Frames with their truth: a scenario's camera, put where the ring is wanted.

The hose hangs as it does when the flight begins, in still air at rest, and nothing moves but the receiver, which is put
down, not flown. What the picture shows of a relative motion is the same whichever of the two moves; what lies behind it
moves with the camera.
"""

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray

from dockair.errors import DockairError
from dockair.messages import CameraFrame, Window
from dockair.rotations import Array, quaternion_from_matrix
from dockair.scenarios.assembly.parts import Parts, build, camera_sheets
from dockair.scenarios.schema import load_scenario
from dockair.sim.camera.camera import NearInfraredCamera
from dockair.sim.camera.sheets import SensorParameters

SETTLING_FRAMES = 8  # the exposure control has settled after them
_FRAME_S = 0.02


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class TrueFrame:
    """A frame and what it shows, of the hardware as built."""

    frame: CameraFrame
    leds_px: Array  #: (n, 2) where the lens puts the LEDs, seen or not
    visible: NDArray[np.bool_]  #: (n,) on the window and hidden by nothing
    R_CD: Array  #: (3, 3) drogue axes in camera axes
    p_CD: Array  #: (3,) ring centre in camera axes [m]


class Studio:
    """The camera of one scenario and where it stands. Make it with `studio`, which closes it too."""

    def __init__(self, parts: Parts, camera: NearInfraredCamera, sensor: SensorParameters) -> None:
        self.parts, self.camera, self.sensor = parts, camera, sensor
        self._frame_number = 0

    def ahead(self, range_m: float) -> mujoco.MjData:
        """The world with the receiver in level flight, the ring ahead of its probe and so far from the lens."""
        data, mounting = self._copy(), self.parts.as_built.mounting
        p_CP_B = mounting.p_BP - mounting.p_BC
        ahead_m = np.sqrt(range_m**2 - p_CP_B[1] ** 2 - p_CP_B[2] ** 2) - p_CP_B[0]
        p_BD_B = mounting.p_BP + np.array([ahead_m, 0.0, 0.0])
        truth, joint = self.parts.world.truth, self._joint
        data.qpos[joint : joint + 3] = truth.p_WD - truth.R_WB @ p_BD_B
        mujoco.mj_forward(self.parts.world.model, data)
        return data

    def seen_at(self, R_CD: Array, p_CD: Array) -> mujoco.MjData:
        """The world at rest with the receiver where its lens sees the drogue in this pose."""
        data, mounting, truth = self._copy(), self.parts.as_built.mounting, self.parts.world.truth
        R_WC = truth.R_WD @ R_CD.T
        R_WB = R_WC @ mounting.R_BC.T
        data.qpos[self._joint : self._joint + 3] = truth.p_WD - R_WC @ p_CD - R_WB @ mounting.p_BC
        data.qpos[self._joint + 3 : self._joint + 7] = quaternion_from_matrix(R_WB)
        data.qvel[:] = 0.0
        mujoco.mj_forward(self.parts.world.model, data)
        return data

    def seen_between(self, before: mujoco.MjData, after: mujoco.MjData, between_s: float) -> mujoco.MjData:
        """The first of two worlds, moving so that it is the second after a time."""
        model = self.parts.world.model
        mujoco.mj_differentiatePos(model, before.qvel, between_s, before.qpos, after.qpos)
        mujoco.mj_forward(model, before)
        return before

    def pose(self, data: mujoco.MjData) -> tuple[Array, Array]:
        """R_CD (3, 3) and p_CD (3,) [m] of the hardware as built."""
        R_WC, p_WC = self.camera.pose(data)
        drogue = data.body("drogue")
        return R_WC.T @ drogue.xmat.reshape(3, 3), (drogue.xpos - p_WC) @ R_WC

    def take(
        self,
        data: mujoco.MjData,
        frames: int = SETTLING_FRAMES,
        window: Window | None = None,
        time_s: float | None = None,
    ) -> TrueFrame:
        """The last of a few frames of a world that stands still, or moves and is caught at one moment.

        Args:
            data: of this studio's world; its time becomes `time_s`, if given, and clouds are where they are then.
            frames: how many, for the exposure control to settle.
            window: what to read; None for the full frame.
            time_s: of all of them, by which faults act; by default each is a frame's time after the one before.

        Raises:
            DockairError: the camera drops out.
        """
        if time_s is not None:
            data.time = time_s
        for _ in range(frames):
            at_s = _FRAME_S * self._frame_number if time_s is None else time_s
            frame = self.camera.expose(data, at_s, self._frame_number, window)
            self._frame_number += 1
        if frame is None:
            raise DockairError("studio", expected="a camera that delivers the frame", got=f"none at {at_s:g} s")
        leds_px, seen = self.camera.led_pixels(data), frame.window
        first, stop = (seen.column_start, seen.row_start), (seen.column_stop, seen.row_stop)
        inside = ((leds_px > np.array(first) - 0.5) & (leds_px < np.array(stop) - 0.5)).all(axis=1)
        R_CD, p_CD = self.pose(data)
        visible = self.camera.visible_leds(data) & inside
        return TrueFrame(frame=frame, leds_px=leds_px, visible=visible, R_CD=R_CD, p_CD=p_CD)

    @property
    def _joint(self) -> int:
        return int(self.parts.world.model.joint("receiver").qposadr[0])

    def _copy(self) -> mujoco.MjData:
        world = self.parts.world
        data = mujoco.MjData(world.model)
        mujoco.mj_copyData(data, world.model, world.data)
        return data


@contextmanager
def studio(
    settings: Mapping[str, Any] | None = None, seed: int = 3, scenario: str | Path = "still_air"
) -> Iterator[Studio]:
    """The camera of a scenario.

    Args:
        settings: dotted key -> value instead of the scenario's.
        seed: of hardware, clouds and noise.
        scenario: a name in the library, or the path of a TOML file.

    Raises:
        DockairError: no such scenario, or one without frames.
    """
    loaded = load_scenario(scenario, {"seed": seed, **(settings or {})})
    sensing, navigator = loaded.camera.sensing, loaded.navigation.navigator
    if sensing != "frames" or loaded.navigation.is_truth:
        expected = 'a scenario with frames: camera.sensing = "frames", navigation.navigator other than "truth"'
        raise DockairError(f"scenario {loaded.name}", expected=expected, got=f"{sensing}, {navigator}")
    parts = build(loaded, seed)
    assert isinstance(parts.camera, NearInfraredCamera)
    try:
        yield Studio(parts, parts.camera, camera_sheets(loaded).sensor)
    finally:
        parts.camera.close()
