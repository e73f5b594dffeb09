"""Frames on their way from the exposure to the navigation.

A frame arrives when it has been exposed, read out and transferred, and never before the one exposed before it: jitter
of a transfer delays the frames behind it, too. A control tick takes one frame.

The frame exposed at t is not wanted before t plus its least latency, so a camera may work on it meanwhile in a process
of its own (`camera_process`). Which of the two takes the frames changes no bit of them.
"""

from collections import deque
from typing import Any, Protocol

import mujoco
import numpy as np

from dockair.messages import CameraFrame, LedObservation, Window
from dockair.scenarios.measured_leds import Senses

Frame = CameraFrame | LedObservation


class Exposures(Protocol):
    """What a flight asks of it."""

    def begin(
        self, data: mujoco.MjData, time_s: float, number: int, window: Window | None, exposure_s: float = np.nan
    ) -> None:
        """Expose a frame of the world as it stands.

        Args:
            data: only read, and no longer needed afterwards.
            time_s: middle of the exposure.
            number: of the frame.
            window: what to read; None for the full frame.
            exposure_s: how long; NaN: what the camera sets itself.
        """
        ...

    def delivered(self, time_s: float) -> Frame | None:
        """Return the oldest frame if it has arrived; it is then taken."""
        ...

    def close(self) -> None:
        """End what runs beside the flight; twice is once."""
        ...


class ExposuresInTurn:
    """Makes each frame while the world waits.

    Args:
        camera: or what stands in its place.
    """

    def __init__(self, camera: Senses) -> None:
        self._camera = camera
        self._in_transfer: deque[tuple[float, Frame]] = deque()

    def begin(
        self, data: mujoco.MjData, time_s: float, number: int, window: Window | None, exposure_s: float = np.nan
    ) -> None:
        """See `Exposures`."""
        asked = {"exposure_s": exposure_s} if np.isfinite(exposure_s) else {}
        frame: Any = self._camera.expose(data, time_s, number, window, **asked)
        if frame is not None:
            self._in_transfer.append((time_s + self._camera.latency_s(frame), frame))

    def delivered(self, time_s: float) -> Frame | None:
        """See `Exposures`."""
        if self._in_transfer and self._in_transfer[0][0] <= time_s:
            return self._in_transfer.popleft()[1]
        return None

    def close(self) -> None:
        """Nothing runs."""
