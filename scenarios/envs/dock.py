"""`dockair/Dock-v0`, `dockair/DockFast-v0`, `dockair/DockPixels-v0`: fly the receiver (docs/environments.md)."""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np
from numpy.typing import NDArray

from dockair.errors import DockairError, check_choice
from dockair.messages import CameraFrame
from dockair.rotations import Array
from dockair.scenarios.assembly.measured import require_measurable
from dockair.scenarios.envs.episode import Episodes
from dockair.scenarios.envs.picture import PICTURE, pooled_picture
from dockair.scenarios.envs.tables import (
    ACTION,
    FRAME_AGE_LIMIT_S,
    OBSERVATION,
    OUTCOME_REWARD,
    PIXEL_STATE,
    box,
    clipped,
    observation_from,
)
from dockair.scenarios.loop import Flight, Tick
from dockair.scenarios.schema import Scenario

__all__ = ["ACTION", "OBSERVATION", "OUTCOME_REWARD", "PIXEL_STATE", "DockEnv", "DockFastEnv", "DockPixelsEnv"]

VIEWS = tuple(PICTURE)
Pixels = dict[str, NDArray[Any]]
_BY_CAMERA = "dockair/Dock-v0 in place of dockair/DockFast-v0"


class DockEnv(Episodes[NDArray[np.float64]]):
    """Dock on what the navigation believes; see OBSERVATION, ACTION and docs/environments.md."""

    def __init__(self, scenario: str | Path | Scenario = "default", **options: Any) -> None:
        super().__init__(scenario, **options)
        self.observation_space: Any = box(OBSERVATION, np.float64)

    def observation(self) -> NDArray[np.float64]:
        """(31,) of OBSERVATION."""
        return clipped(observation_from(self.tick.solution, self.imu), self.observation_space)


@contextmanager
def _by_camera_instead() -> Iterator[None]:
    """Say which environment flies what cannot be measured: its user has set no `camera.sensing`."""
    try:
        yield
    except DockairError as error:
        if error.where != "camera.sensing":
            raise
        reason = error.expected.partition(": ")[2]
        raise DockairError("scenario", expected=f"{_BY_CAMERA}: {reason}") from None


class DockFastEnv(DockEnv):
    """The same without a picture: each LED's place is drawn from the camera's error model."""

    sensing = "measurements"

    def with_sensing(self, scenario: Scenario) -> Scenario:
        """As of `Episodes`; what acts through the picture alone is refused."""
        if scenario.navigation.heading:
            expected = f"false, or {_BY_CAMERA}: a heading is kept by pictures"
            raise DockairError("navigation.heading", expected=expected, got=True)
        changed = super().with_sensing(scenario)
        with _by_camera_instead():
            require_measurable(changed)
        return changed

    def new_flight(self, scenario: Scenario, seed: int) -> Flight:
        """As of `Episodes`; the Sun may be in the field of the camera as it was built, and not of the nominal one."""
        with _by_camera_instead():
            return super().new_flight(scenario, seed)


class DockPixelsEnv(Episodes[Pixels]):
    """Dock on the camera's picture and the IMU, the navigation's belief left out."""

    sensing = "frames"

    def __init__(self, scenario: str | Path | Scenario = "default", *, view: str = "ring", **options: Any) -> None:
        """Check the arguments.

        Args:
            scenario: as of `DockEnv`; one without a camera (perfect navigation) is refused.
            view: "ring", the window that the navigation has read, or "sensor", all of it.
            options: as of `DockEnv`.
        """
        check_choice("view", view, VIEWS)
        self.full_frames = view == "sensor"
        super().__init__(scenario, **options)
        self.observation_space: Any = gymnasium.spaces.Dict(
            {
                "picture": gymnasium.spaces.Box(0, 255, (*PICTURE[view], 1), np.uint8),
                "state": box(PIXEL_STATE, np.float64),
            }
        )
        self._shape = PICTURE[view]
        self._frame: CameraFrame | None = None

    def forget(self) -> None:
        """Forget the frame: the picture is black until the first of a flight has arrived."""
        self._frame = None

    def note(self, tick: Tick) -> None:
        """Keep the newest frame."""
        if isinstance(tick.frame, CameraFrame):
            self._frame = tick.frame

    def observation(self) -> Pixels:
        """Picture and state."""
        tick, frame, space = self.tick, self._frame, self.observation_space
        time_s = tick.solution.time_stamp_s
        motion: list[Array] = [np.zeros(6)]
        if self.imu is not None:
            motion = [self.imu.angular_rate_rad_s, self.imu.specific_force_m_s2]
        if frame is None:
            picture, place, exposure = np.zeros(self._shape, np.uint8), [0.0, 0.0, 0.0, FRAME_AGE_LIMIT_S], 0.0
        else:
            picture, pooled = pooled_picture(frame.pixels, self._shape)
            place = [frame.window.column_start, frame.window.row_start, pooled, time_s - frame.time_stamp_s]
            exposure = frame.exposure_s
        state = np.concatenate([place, [exposure], *motion, [time_s]])
        return {"picture": picture[:, :, np.newaxis], "state": clipped(state, space["state"])}
