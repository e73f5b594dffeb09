"""Frames on their way from the exposure to the navigation.

A frame arrives when it has been exposed, read out and transferred, and never before the one exposed before it: jitter
of a transfer delays the frames behind it, too. A control tick takes one frame, the newest: of two that have arrived the
older is dropped, for where camera and control have one rate it would keep every later frame waiting for a tick.

The frame exposed at t is not wanted before t plus its least latency, so a camera may work on it meanwhile in a process
of its own (`camera_process`). Which of the two takes the frames changes no bit of them.
"""

from collections import deque
from typing import Any, Protocol, TypeVar

import mujoco
import numpy as np

from dockair.messages import CameraFrame, LedObservation, Window

Frame = CameraFrame | LedObservation
_F = TypeVar("_F")


class Senses(Protocol):
    """What a flight has in the camera's place: the camera, or a model of what is made of its frames."""

    def expose(
        self,
        data: mujoco.MjData,
        time_s: float,
        frame_number: int,
        window: Window | None,
        exposure_s: float = np.nan,
    ) -> Any:
        """Return a message with a time stamp; None when there is none."""

    def latency_s(self, frame: Any) -> float:
        """Draw the time [s] from the message's stamp until it has arrived."""


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
        """Return the newest frame that has arrived; it is then taken, and older ones are dropped."""
        ...

    @property
    def waited_s(self) -> float:
        """Wall time for which the flight has waited for another process so far."""
        ...

    def close(self) -> None:
        """End what runs beside the flight; twice is once."""
        ...


class ExposuresInTurn:
    """Makes each frame while the world waits.

    Args:
        camera: or what stands in its place.
    """

    waited_s = 0.0  #: the camera's work is the flight's own

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
        return newest_arrived(self._in_transfer, time_s)

    def close(self) -> None:
        """Nothing runs."""


def newest_arrived(in_transfer: deque[tuple[float, _F]], time_s: float) -> _F | None:
    """Return the newest frame that has arrived, None without one; it and all older ones are taken out.

    Args:
        in_transfer: times at which frames have been transferred [s], with the frames in the order of their exposures.
        time_s: now.
    """
    newest = None
    while in_transfer and in_transfer[0][0] <= time_s:
        _, newest = in_transfer.popleft()
    return newest
