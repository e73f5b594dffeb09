"""An episode in the rerun viewer while it is flown: scene, belief, plots, as in a recorded one."""

import shutil
import socket
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any
from uuid import uuid4

import numpy as np

from dockair.errors import MachineError
from dockair.messages import CameraFrame
from dockair.rotations import Array
from dockair.scenarios.display import has_display
from dockair.scenarios.flight_log import FlightLog
from dockair.scenarios.loop import Flight, Tick
from dockair.scenarios.recording.frames import shown_pixels
from dockair.scenarios.recording.layout import blueprint
from dockair.scenarios.recording.overlays import log_overlay_looks, log_overlays
from dockair.scenarios.recording.plots import log_plots
from dockair.scenarios.recording.scene import hose_exit, log_moving, log_still, log_tip_path, tip_place
from dockair.sim.shapes import shapes_of

_PORT = 9876  # of rerun's viewer
_SHOWN_HZ = 20.0  # a viewer needs no more, and each costs a few milliseconds
_FLUSH_S = 2.0  # a viewer that is later than this gets its layout again, and loses nothing
_ROUNDING_S = 1e-6  # of the times of ticks: one that is due is not put off to the next for it

Sink = Callable[[Any], bool]


class LiveViewer:
    """Shows episodes one after the other, each a recording of its own.

    Args:
        sink: sends a rerun recording somewhere, and returns whether nothing was sent there before; None opens the
            viewer, or finds the one that is open.
    """

    def __init__(self, sink: Sink | None = None) -> None:
        self._sink = sink or _spawned
        self._flight: Flight | None = None
        self._recording: Any = None
        self._next_s = 0.0
        self._episode = 0
        self._frame: CameraFrame | None = None  # the newest that has not been drawn
        self._p_TE: Array = np.zeros(3)
        self._path: list[Array] = []

    def show(self, flight: Flight, tick: Tick, *, is_last: bool = False) -> None:
        """Draw a control tick, if it is the last or it is time for one; a new flight begins a new recording."""
        if flight is not self._flight:
            self._begin(flight)
        if isinstance(tick.frame, CameraFrame):
            self._frame = tick.frame
        time_s = tick.truth.time_s
        if time_s < self._next_s and not is_last:
            return
        self._next_s = time_s + 1.0 / _SHOWN_HZ - _ROUNDING_S
        self._draw(flight, tick)

    def _draw(self, flight: Flight, tick: Tick) -> None:
        import rerun as rr

        log = FlightLog()
        log.append(tick.truth, tick.imu, self._frame, tick.solution)
        self._recording.set_time("sim_time", duration=tick.truth.time_s)
        times = [rr.TimeColumn("sim_time", duration=[tick.truth.time_s])]
        log_moving(self._recording, log, [0], times, flight.sheets, self._p_TE)
        log_overlays(self._recording, log, [0], times, flight.sheets)
        self._path.append(tip_place(tick.truth, self._p_TE))
        log_tip_path(self._recording, self._path)
        log_plots(self._recording, log)
        if self._frame is not None:
            self._log_frame(self._frame)
            self._frame = None

    def _begin(self, flight: Flight) -> None:
        import rerun as rr  # 0.75 s, and only this needs it
        from rerun_bindings import flush_and_cleanup_orphaned_recordings

        episode = self._episode + 1
        recording = rr.RecordingStream("dockair", recording_id=uuid4(), send_properties=False)
        recording.send_recording_name(f"{flight.scenario.name}, episode {episode}")
        recording.set_log_time_enabled(False)  # the timelines are the flight's
        is_new = self._sink(recording)  # what it raises leaves the last episode as it is
        is_new = is_new or self._recording is None or _is_cut_off(self._recording)
        self._next_s, self._frame = 0.0, None
        self._p_TE, self._path = hose_exit(flight.truth), []
        self._recording = recording
        flush_and_cleanup_orphaned_recordings()  # the last episode's: rerun keeps its threads and memory otherwise
        if is_new:  # the layout stays; rerun never frees what it took to send one
            self._recording.send_blueprint(blueprint(flight.sheets.camera))
        log_still(self._recording, flight.sheets, shapes_of(flight.world.model))
        log_overlay_looks(self._recording, flight.sheets)
        self._flight, self._episode = flight, episode  # not before: what could not be begun is begun again

    def _log_frame(self, frame: CameraFrame) -> None:
        import rerun as rr

        shift = rr.Transform3D(translation=[frame.window.column_start, frame.window.row_start, 0])
        self._recording.log("camera/window", shift)
        self._recording.log("camera/window/pixels", rr.Image(shown_pixels(np.asarray(frame.pixels)), "L"))


def _is_cut_off(recording: Any) -> bool:
    """Whether the viewer that a recording was sent to has been closed; one that is open then is another."""
    try:
        recording.flush(timeout_sec=_FLUSH_S)
    except RuntimeError:
        return True
    return False


def require_viewer() -> None:
    """Refuse where no viewer can be opened and none is open.

    Raises:
        MachineError: with what to do.
    """
    if not has_display() and not _is_open():
        expected = "a display, or a rerun viewer that is open already"
        raise MachineError("render_mode", expected=expected, remedy='without one use "rgb_array", or `dockair fly`')


def _is_open() -> bool:
    """Whether somebody listens where a viewer does."""
    try:
        with socket.create_connection(("127.0.0.1", _PORT), timeout=0.5):
            return True
    except OSError:
        return False


def _spawned(recording: Any) -> bool:
    """Send a recording to the viewer that is open, or open one; return whether it was opened.

    Raises:
        MachineError: none is open, and none can be opened.
    """
    is_open = _is_open()
    if not is_open:
        _open(recording)
    recording.connect_grpc(f"rerun+http://127.0.0.1:{_PORT}/proxy")
    return not is_open


def _open(recording: Any) -> None:
    """Open a viewer that a recording can be sent to; its program stands beside this Python.

    Raises:
        MachineError: there is no such program, or no display that it could open on.
    """
    import rerun as rr

    beside = shutil.which("rerun", path=str(Path(sys.executable).parent)) or shutil.which("rerun")
    if beside is None:
        raise MachineError("render_mode", expected="the rerun viewer", remedy="install rerun-sdk")
    require_viewer()  # the one before may have been closed; without a display rerun waits for another in vain
    rr.spawn(executable_path=beside, connect=False, recording=recording)  # without one rerun does nothing
    if not _is_open():  # rerun has waited for it for some seconds, and says no more than a warning
        remedy = 'begin `rerun --bind 127.0.0.1` first and see what it says, or use "rgb_array"'
        raise MachineError("render_mode", expected="a rerun viewer that opens on this display", remedy=remedy)
