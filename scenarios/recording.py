"""One `episode.rrd` a flight: the camera's frames and what was found in them, the scene in three dimensions, plots.

| entity                              | from               | drawn                                               |
|-------------------------------------|--------------------|-----------------------------------------------------|
| camera/window/pixels_*              | message log        | the window's pixels, lossless, at their place; of   |
|                                     |                    | long flights every n-th frame, to keep files small  |
| camera/{candidates,leds,ring,...}   | NavSolution        | candidates, named LEDs, the believed ring projected |
| world/{tanker,hose,drogue,receiver} | Truth              | the model's own primitives                          |
| world/receiver/belief               | NavSolution        | the believed drogue, orange, beside the true one    |
| plots/*, states/{phase,frame}       | both               | truth beside belief with 3 sigma                    |

Timelines: `sim_time` [s] and `frame` (of the camera). Everything is written after the flight, so that nothing of it
costs the control loop anything. The viewer takes a change of an image's size for a fault of a video, so that windows
are padded with black to multiples of `PADDING_PX` and each size has an entity of its own.
"""

from collections.abc import Iterable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import numpy as np

from dockair.calibration import NavigationSheets
from dockair.messages import NavSolution, Window
from dockair.rotations import Array
from dockair.scenarios.flight_log import FlightLog
from dockair.scenarios.message_log import TickMessages, pixels_from_png, png_from_pixels
from dockair.scenarios.recording_layout import BELIEF, CLOSE_UP, FOUND, NEUTRAL, TRUTH, blueprint
from dockair.scenarios.recording_plots import log_plots
from dockair.scenarios.recording_scene import hose_exit, log_moving, log_still, log_tip_path, time_columns, tip_place
from dockair.sim.shapes import Shape

FILE_NAME = "episode.rrd"
PADDING_PX = 128
FRAME_BYTES = 30_000_000  # of frames in an episode; the message log holds every one of them
_BATCH = 64
RATE_HZ = 50  # of everything but the plots, which have the control rate
_PIXEL_CENTRE = 0.5  # the viewer puts the top left corner of the top left pixel at (0, 0), the project its centre


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
        name: of the recording, as the viewer shows it.
        shapes: the world's primitives.
        messages: of the same control ticks, for the frames; empty for a recording without frames.
        summary: Markdown shown beside the plots.
    """
    import rerun as rr  # 0.75 s, and only recordings need it

    path = Path(out_dir) / FILE_NAME
    recording = rr.RecordingStream("dockair", recording_id=name, send_properties=False)
    recording.set_log_time_enabled(False)  # times of day would make two recordings of one flight differ
    recording.save(path, default_blueprint=blueprint(sheets.camera))
    ticks = drawn_ticks(log, sheets.control_rate_hz)
    p_TE = hose_exit(log.truths[0])
    log_still(recording, sheets, shapes)
    times = time_columns(log, ticks)
    log_moving(recording, log, ticks, times, sheets, p_TE)
    log_tip_path(recording, [tip_place(truth, p_TE) for truth in log.truths])
    log_plots(recording, log)
    _log_overlays(recording, log, ticks, times, sheets)
    _log_frames(recording, log, list(messages))
    if summary:
        recording.log("summary", rr.TextDocument(summary, media_type="text/markdown"), static=True)
    recording.flush()
    recording.disconnect()
    return path


def drawn_ticks(log: FlightLog, control_rate_hz: int) -> list[int]:
    """Return the control ticks that are drawn: every one with a new frame; without a camera, RATE_HZ of them."""
    stamps = np.array([s.frame_time_stamp_s for s in log.solutions])
    if np.isfinite(stamps).any():
        fresh = np.diff(stamps, prepend=np.nan) != 0.0  # a comparison with NaN is true: the ticks before the first
        return [int(k) for k in np.flatnonzero(fresh)]
    return list(range(0, len(stamps), max(control_rate_hz // RATE_HZ, 1)))


def _log_overlays(
    recording: Any, log: FlightLog, ticks: Sequence[int], times: list[Any], sheets: NavigationSheets
) -> None:
    import rerun as rr

    solutions = [log.solutions[k] for k in ticks]
    send = recording.send_columns
    width, height = sheets.camera.width_px, sheets.camera.height_px
    sensor = rr.Boxes2D(array=[0, 0, width, height], array_format=rr.Box2DFormat.XYWH, colors=[70, 70, 70])
    recording.log("camera/sensor", sensor, static=True)

    found = [s.candidates_px + _PIXEL_CENTRE for s in solutions]
    sizes = [len(points) for points in found]
    thin, thick = rr.Radius.ui_points(0.7), rr.Radius.ui_points(2.0)
    recording.log("camera/candidates", rr.Ellipses2D.from_fields(colors=NEUTRAL, line_radii=thin), static=True)
    columns = rr.Ellipses2D.columns(centers=_stacked(found, 2), half_sizes=np.full((sum(sizes), 2), 9.0))
    send("camera/candidates", times, columns.partition(sizes))

    seen = [np.flatnonzero(np.isfinite(s.led_pixels_px[:, 0])) for s in solutions]
    sizes = [len(numbers) for numbers in seen]
    leds = [s.led_pixels_px[k] + _PIXEL_CENTRE for s, k in zip(solutions, seen, strict=True)]
    labels = [str(k) for numbers in seen for k in numbers]
    recording.log("camera/leds", rr.Points2D.from_fields(colors=FOUND, radii=thick), static=True)
    send("camera/leds", times, rr.Points2D.columns(positions=_stacked(leds, 2), labels=labels).partition(sizes))

    rings = [believed_ring_px(s, sheets) + _PIXEL_CENTRE for s in solutions]
    recording.log(
        "camera/ring", rr.LineStrips2D.from_fields(colors=BELIEF, radii=rr.Radius.ui_points(0.7)), static=True
    )
    send("camera/ring", times, rr.LineStrips2D.columns(strips=rings))

    centres = np.array([ring.mean(axis=0) for ring in rings]).reshape(-1, 2)
    centres = np.where(np.isfinite(centres), centres, [0.5 * width, 0.5 * height])
    translations = np.column_stack([centres, np.zeros(len(centres))])
    send(CLOSE_UP, times, rr.Transform3D.columns(translation=translations))


def believed_ring_px(solution: NavSolution, sheets: NavigationSheets, count: int = 48) -> Array:
    """(count + 1, 2) pixels of the ring's circle where the navigation believes it to be; NaN behind the camera."""
    angle = np.linspace(0.0, 2.0 * np.pi, count + 1)
    radius = 0.5 * sheets.ring.diameter_m
    circle_D = np.column_stack([np.zeros_like(angle), radius * np.cos(angle), radius * np.sin(angle)])
    mounting = sheets.mounting
    p_CL_B = circle_D @ solution.R_BD.T + solution.p_PD_B + mounting.p_BP - mounting.p_BC
    return sheets.camera.pixels_from_points(p_CL_B @ mounting.R_BC)


def _stacked(parts: Sequence[Array], columns: int) -> Array:
    return np.concatenate([np.empty((0, columns)), *parts])


def padded_shape(window: Window) -> tuple[int, int]:
    """(rows, columns) of the window, rounded up to multiples of PADDING_PX."""
    rows, columns = window.shape
    return -(-rows // PADDING_PX) * PADDING_PX, -(-columns // PADDING_PX) * PADDING_PX


def _log_frames(recording: Any, log: FlightLog, messages: Sequence[TickMessages]) -> None:
    import rerun as rr

    before = ""
    for number, time_s, window, png in _padded_frames(log, messages):
        recording.set_time("sim_time", duration=time_s)
        recording.set_time("frame", sequence=number)
        entity = f"camera/window/pixels_{'x'.join(str(size) for size in padded_shape(window))}"
        if entity != before:
            if before:
                recording.log(before, rr.EncodedImage.from_fields(opacity=0.0))  # the viewer does not heed a Clear here
            recording.log(entity, rr.EncodedImage.from_fields(opacity=1.0))
            before = entity
        recording.log("camera/window", rr.Transform3D(translation=[window.column_start, window.row_start, 0]))
        recording.log(entity, rr.EncodedImage(contents=png, media_type="image/png", draw_order=-10.0))
        rows, columns = window.shape
        box = rr.Boxes2D(array=[0, 0, columns, rows], array_format=rr.Box2DFormat.XYWH, colors=TRUTH)
        recording.log("camera/window/outline", box)


def shown_frames(sizes_bytes: Sequence[int]) -> range:
    """Return which frames are shown: every n-th, n as small as FRAME_BYTES allow."""
    return range(0, len(sizes_bytes), max(1, -(-sum(sizes_bytes) // FRAME_BYTES)))


def _padded_frames(log: FlightLog, messages: Sequence[TickMessages]) -> Iterator[tuple[int, float, Window, bytes]]:
    """Yield number, time of delivery, window and padded PNG of each frame shown; threads encode a few dozen at once."""

    def pad(entry: tuple[int, float, Window, bytes]) -> tuple[int, float, Window, bytes]:
        number, time_s, window, png = entry
        canvas = np.zeros(padded_shape(window), np.uint8)
        canvas[: window.shape[0], : window.shape[1]] = pixels_from_png(png)
        return number, time_s, window, png_from_pixels(canvas)

    frames = [
        (truth.time_s, tick.frame.window, tick.png)
        for truth, tick in zip(log.truths, messages, strict=False)
        if tick.frame is not None and tick.png is not None
    ]
    chosen = [(k, *frames[k]) for k in shown_frames([len(png) for _, _, png in frames])]
    with ThreadPoolExecutor(max_workers=2) as pool:
        for first in range(0, len(chosen), _BATCH):
            yield from pool.map(pad, chosen[first : first + _BATCH])
