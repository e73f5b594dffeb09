"""A camera in a process of its own: it works on a frame while the world goes on until the frame could arrive.

The world's state at the exposure and the frame's pixels go through shared memory, a slot for each frame under way;
orders and answers through a pipe. While there is no order the camera works ahead on its tables, so that no frame has to
wait for them. Whoever waits for the other stays awake for some milliseconds, its core free for all who want it: to be
woken on a core that sleeps takes a tenth of the time of a frame. The process is a fork of the flight, so it has the
camera as it was built, and it ends with the flight: an order of None, or the pipe's end, ends it. What the camera
refuses is raised in the flight, when the frame is asked for.

Not for a camera that draws with OpenGL (a context does not survive a fork), nor for systems without fork, nor inside a
process that may have no children: see `can_overlap`.
"""

import mmap
import multiprocessing
import os
import select
import signal
import sys
import time
from collections import deque
from contextlib import suppress
from multiprocessing.connection import Connection
from typing import Any, NamedTuple, TypeGuard

import mujoco
import numpy as np
from numpy.typing import NDArray

from dockair.errors import MachineError
from dockair.messages import CameraFrame, Window
from dockair.scenarios.exposures import newest_arrived
from dockair.sim.camera.camera import NearInfraredCamera
from dockair.sim.camera.scene_state import SceneState, size_of

_SLOTS = 4  # frames under way: two at 50 Hz and 10 ms; more when the transfer takes long
_PIECES_AHEAD = 3  # of what comes next, after a frame: so that the camera is idle again when the next order comes
_AWAKE_S = 4e-3  # of waiting for the other process: longer than a frame takes
_GOODBYE_S = 5.0  # for a process to end by itself; it has at most _SLOTS frames to finish


class _Begun(NamedTuple):
    """A frame that is being made."""

    slot: int
    time_s: float
    jitter_s: float
    least_s: float  #: it cannot arrive before


class _Failed(NamedTuple):
    """An error's parts: errors with arguments of their own cannot go through a pipe whole."""

    kind: type[Exception]
    arguments: tuple[Any, ...]
    fields: dict[str, Any]

    def error(self) -> Exception:
        """Put it together again."""
        made = self.kind.__new__(self.kind, *self.arguments)
        made.__dict__.update(self.fields)
        return made


class _Slot:
    """Memory that both processes see."""

    def __init__(self, model: mujoco.MjModel, most_pixels: int) -> None:
        numbers = size_of(model)
        memory = mmap.mmap(-1, 8 * numbers + most_pixels)
        self.scene = SceneState(model, np.frombuffer(memory, dtype=np.float64, count=numbers))
        self.pixels: NDArray[np.uint8] = np.frombuffer(memory, dtype=np.uint8, offset=8 * numbers, count=most_pixels)


class _Inbox:
    """Messages that come through a pipe."""

    def __init__(self, pipe: Connection) -> None:
        self._pipe, self._poll = pipe, select.poll()
        self._poll.register(pipe.fileno(), select.POLLIN)
        self.waited_s = 0.0  #: for all messages so far

    def next(self) -> Any:
        """Wait for the next message, awake at first.

        Raises:
            EOFError: the other end was closed.
            OSError: likewise, in the middle of a message.
        """
        begun_s = time.perf_counter()
        while not self._poll.poll(0) and time.perf_counter() < begun_s + _AWAKE_S:
            os.sched_yield()
        message = self._pipe.recv()
        self.waited_s += time.perf_counter() - begun_s
        return message


class OverlappedExposures:
    """Stands where `ExposuresInTurn` stands, and gives the same frames.

    Args:
        camera: that this process no longer exposes itself.
        model: the world's.
    """

    def __init__(self, camera: NearInfraredCamera, model: mujoco.MjModel) -> None:
        self._camera = camera
        rows, columns = camera.full_window.shape
        self._slots = [_Slot(model, rows * columns) for _ in range(_SLOTS)]
        self._begun: deque[_Begun] = deque()
        self._in_transfer: deque[tuple[float, CameraFrame]] = deque()
        self._next_slot = 0
        fork = multiprocessing.get_context("fork")
        self._pipe, theirs = fork.Pipe()
        self._answers = _Inbox(self._pipe)
        self._process: Any = fork.Process(
            target=_serve, args=(camera, self._slots, theirs, self._pipe), name="camera", daemon=True
        )
        self._process.start()
        theirs.close()

    def begin(
        self, data: mujoco.MjData, time_s: float, number: int, window: Window | None, exposure_s: float = np.nan
    ) -> None:
        """See `exposures.Exposures`."""
        if len(self._begun) == _SLOTS:
            self._collect()
        slot, self._next_slot = self._next_slot, (self._next_slot + 1) % _SLOTS
        self._slots[slot].scene.take(data)
        jitter_s = self._camera.transfer_jitter_s()
        least_s = time_s + (self._camera.least_latency_s(window) + jitter_s)
        self._begun.append(_Begun(slot, time_s, jitter_s, least_s))
        self._send((slot, time_s, number, window, exposure_s))

    def delivered(self, time_s: float) -> CameraFrame | None:
        """See `exposures.Exposures`."""
        while any(begun.least_s <= time_s for begun in self._begun):
            self._collect()
        return newest_arrived(self._in_transfer, time_s)

    @property
    def waited_s(self) -> float:
        """See `exposures.Exposures`."""
        return self._answers.waited_s

    def close(self) -> None:
        """See `exposures.Exposures`."""
        if self._process is None:
            return
        with suppress(OSError):
            self._pipe.send(None)
        self._pipe.close()
        self._process.join(_GOODBYE_S)
        if self._process.is_alive():
            self._process.kill()
            self._process.join()
        self._process = None

    def _collect(self) -> None:
        """Wait for the oldest frame that is being made."""
        begun = self._begun.popleft()
        try:
            answer = self._answers.next()
        except (EOFError, OSError) as error:
            raise self._lost() from error
        if isinstance(answer, _Failed):
            raise answer.error()
        if answer is not None:
            frame = _frame_of(answer, self._slots[begun.slot].pixels)
            self._in_transfer.append((begun.time_s + self._camera.latency_s(frame, begun.jitter_s), frame))

    def _send(self, order: Any) -> None:
        try:
            self._pipe.send(order)
        except OSError as error:
            raise self._lost() from error

    def _lost(self) -> MachineError:
        self._process.join(_GOODBYE_S)
        status = self._process.exitcode
        expected = f"the camera's process to live as long as the flight, not to end with status {status}"
        return MachineError("camera", expected=expected, remedy="is there memory enough? see `dockair doctor`")


def can_overlap(camera: object) -> TypeGuard[NearInfraredCamera]:
    """Say whether a camera can be exposed in a process beside this one, and a core is there for it."""
    return (
        isinstance(camera, NearInfraredCamera)
        and camera.background == "analytic"
        and sys.platform.startswith("linux")
        and len(os.sched_getaffinity(0)) > 1
        and not multiprocessing.current_process().daemon
    )


def _serve(camera: NearInfraredCamera, slots: list[_Slot], pipe: Connection, flights_end: Connection) -> None:
    """Expose as ordered until there are no more orders, and work ahead in between."""
    flights_end.close()  # or the pipe would never end with the flight
    orders = _Inbox(pipe)
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # a keyboard's interrupt goes to both; the flight says when to end
    with suppress(EOFError, OSError):
        while (order := orders.next()) is not None:
            slot, *asked = order
            try:
                answer: Any = _exposed(camera, slots[slot], *asked)
            except Exception as error:  # the flight's to handle, whatever it is
                answer = _Failed(type(error), error.args, error.__dict__)
            pipe.send(answer)
            with suppress(Exception):  # what a frame really needs it makes itself, and says what it lacks
                for _ in range(_PIECES_AHEAD):
                    if pipe.poll() or not camera.work_ahead():
                        break


def _exposed(
    camera: NearInfraredCamera, slot: _Slot, time_s: float, number: int, window: Window | None, exposure_s: float
) -> Any:
    """Make a frame; leave its pixels in the slot and return the rest, or None for a frame that dropped out."""
    frame = camera.expose(slot.scene, time_s, number, window, exposure_s)
    if frame is None:
        return None
    slot.pixels[: frame.pixels.size] = frame.pixels.ravel()
    return frame.time_stamp_s, frame.window, frame.exposure_s, frame.gain


def _frame_of(answer: tuple[float, Window, float, float], memory: NDArray[np.uint8]) -> CameraFrame:
    time_stamp_s, window, exposure_s, gain = answer
    rows, columns = window.shape
    pixels = memory[: rows * columns].reshape(rows, columns).copy()
    pixels.setflags(write=False)
    return CameraFrame(time_stamp_s=time_stamp_s, pixels=pixels, window=window, exposure_s=exposure_s, gain=gain)
