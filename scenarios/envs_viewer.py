"""An episode in the rerun viewer while it is flown: scene, belief, plots, as in a recorded one."""

import shutil
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any
from uuid import uuid4

import numpy as np

from dockair.errors import MachineError
from dockair.messages import CameraFrame
from dockair.scenarios.flight_log import FlightLog
from dockair.scenarios.loop import Flight, Tick
from dockair.scenarios.recording_layout import blueprint
from dockair.scenarios.recording_plots import log_plots
from dockair.scenarios.recording_scene import log_scene
from dockair.sim.shapes import shapes_of

_SHOWN_HZ = 20.0  # a viewer needs no more, and each costs a few milliseconds

Sink = Callable[[Any], None]


class LiveViewer:
    """Shows episodes one after the other, each a recording of its own.

    Args:
        sink: where a rerun recording goes; None opens the viewer, or finds the one that is open.
    """

    def __init__(self, sink: Sink | None = None) -> None:
        self._sink = sink or _spawned
        self._flight: Flight | None = None
        self._recording: Any = None
        self._next_s = 0.0
        self._episode = 0

    def show(self, flight: Flight, tick: Tick) -> None:
        """Draw a control tick, if it is time for one; a new flight begins a new recording."""
        if flight is not self._flight:
            self._begin(flight)
        if tick.truth.time_s < self._next_s and tick.outcome is None:
            return
        self._next_s = tick.truth.time_s + 1.0 / _SHOWN_HZ
        log = FlightLog()
        log.append(tick.truth, tick.imu, tick.frame, tick.solution)
        self._recording.set_time("sim_time", duration=tick.truth.time_s)
        log_scene(self._recording, log, [0], flight.sheets, ())
        log_plots(self._recording, log)
        self._log_frame(tick.frame)

    def _begin(self, flight: Flight) -> None:
        import rerun as rr  # 0.75 s, and only this needs it

        self._flight, self._next_s = flight, 0.0
        self._episode += 1
        self._recording = rr.RecordingStream("dockair", recording_id=uuid4(), send_properties=False)
        self._recording.send_recording_name(f"{flight.scenario.name}, episode {self._episode}")
        self._recording.set_log_time_enabled(False)  # the timelines are the flight's
        self._sink(self._recording)
        self._recording.send_blueprint(blueprint(flight.sheets.camera))
        log = FlightLog()
        log.truths.append(flight.truth)
        log_scene(self._recording, log, [], flight.sheets, shapes_of(flight.world.model))

    def _log_frame(self, frame: Any) -> None:
        import rerun as rr

        if isinstance(frame, CameraFrame):
            shift = rr.Transform3D(translation=[frame.window.column_start, frame.window.row_start, 0])
            self._recording.log("camera/window", shift)
            self._recording.log("camera/window/pixels", rr.Image(np.asarray(frame.pixels), "L"))


def _spawned(recording: Any) -> None:
    """Send a recording to the viewer that is open, or open one: the program stands beside this Python."""
    import rerun as rr

    beside = shutil.which("rerun", path=str(Path(sys.executable).parent)) or shutil.which("rerun")
    if beside is None:
        raise MachineError("render_mode", expected="the rerun viewer", remedy="install rerun-sdk")
    rr.spawn(executable_path=beside, recording=recording)
