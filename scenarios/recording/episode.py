"""One `episode.rrd` a flight: the camera's frames and what was found in them, the scene in three dimensions, plots.

| entity                              | from               | drawn                                               |
|-------------------------------------|--------------------|-----------------------------------------------------|
| camera/window/pixels_*              | message log        | the window's pixels, brightened, at their place; of |
|                                     |                    | long flights every n-th frame, to keep files small  |
| camera/{candidates,leds,ring,...}   | NavSolution        | candidates, named LEDs, the believed ring projected |
| world/{tanker,hose,drogue,receiver} | Truth              | the model's own primitives                          |
| world/receiver/belief               | NavSolution        | the believed drogue, orange, beside the true one    |
| plots/*, states/{phase,frame}       | both               | truth beside belief with 3 sigma                    |

Timelines: `sim_time` [s] and `frame`, the number of the frame that arrived, whether it was used or not. Everything is
written after the flight, so that nothing of it costs the control loop anything.
"""

from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

from dockair.calibration import NavigationSheets
from dockair.rotations import Array
from dockair.scenarios.flight_log import FlightLog
from dockair.scenarios.message_log import TickMessages
from dockair.scenarios.recording.frames import log_frames
from dockair.scenarios.recording.layout import blueprint
from dockair.scenarios.recording.overlays import log_overlay_looks, log_overlays
from dockair.scenarios.recording.plots import log_plots
from dockair.scenarios.recording.scene import hose_exit, log_moving, log_still, log_tip_path, time_columns, tip_place
from dockair.sim.shapes import Shape

FILE_NAME = "episode.rrd"
RATE_HZ = 25  # of what is drawn while no frame arrives; the plots have the control rate


def write_episode(
    out_dir: str | Path,
    log: FlightLog,
    sheets: NavigationSheets,
    *,
    name: str,
    shapes: Sequence[Shape] = (),
    messages: Iterable[TickMessages] = (),
    summary: str = "",
) -> Path:
    """Write `episode.rrd` into a folder and return its path.

    Args:
        out_dir: where to.
        log: the flight.
        sheets: the navigation's; the believed ring is projected with them.
        name: of the recording, as the viewer shows it; it puts recordings of one name together as one flight.
        shapes: the world's primitives.
        messages: of the same control ticks, for the frames; empty for a recording without frames.
        summary: Markdown shown beside the plots.
    """
    import rerun as rr  # 0.75 s, and only recordings need it

    path = Path(out_dir) / FILE_NAME
    recording = rr.RecordingStream("dockair", recording_id=name, send_properties=False)
    recording.set_log_time_enabled(False)  # times of day would make two recordings of one flight differ
    recording.save(path, default_blueprint=blueprint(sheets.camera))
    p_TE = hose_exit(log.truths[0])
    log_still(recording, sheets, shapes)
    log_overlay_looks(recording, sheets)
    _log_drawn_ticks(recording, log, sheets, p_TE)
    log_tip_path(recording, [tip_place(truth, p_TE) for truth in log.truths])
    log_plots(recording, log)
    log_frames(recording, log, list(messages))
    if summary:
        recording.log("summary", rr.TextDocument(summary, media_type="text/markdown"), static=True)
    recording.flush()
    recording.disconnect()
    return path


def drawn_ticks(log: FlightLog, control_rate_hz: int) -> list[int]:
    """Return the control ticks that are drawn: the first, every one at which a frame arrived, else RATE_HZ of them."""
    step = max(control_rate_hz // RATE_HZ, 1)
    drawn = [0]
    for k, arrived in enumerate(log.arrived):
        if k and (arrived or k - drawn[-1] >= step):
            drawn.append(k)
    return drawn


def _log_drawn_ticks(recording: Any, log: FlightLog, sheets: NavigationSheets, p_TE: Array) -> None:
    drawn = drawn_ticks(log, sheets.control_rate_hz)
    for with_frame in (True, False):  # apart: where no frame arrived there is no place on the timeline `frame`
        if ticks := [k for k in drawn if log.arrived[k] is with_frame]:
            times = time_columns(log, ticks)
            log_moving(recording, log, ticks, times, sheets, p_TE)
            log_overlays(recording, log, ticks, times, sheets)
