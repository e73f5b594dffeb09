"""What the navigation saw in the frames of an episode, and the believed ring, drawn over the pixels."""

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dockair.calibration import NavigationSheets
from dockair.messages import NavSolution
from dockair.rotations import Array
from dockair.scenarios.flight_log import FlightLog
from dockair.scenarios.recording.layout import BELIEF, CLOSE_UP, FOUND, NEUTRAL, PIXEL_CENTRE


def log_overlay_looks(recording: Any, sheets: NavigationSheets) -> None:
    """Log the sensor's edge, and how candidates, LEDs and ring are drawn."""
    import rerun as rr

    width, height = sheets.camera.width_px, sheets.camera.height_px
    sensor = rr.Boxes2D(array=[0, 0, width, height], array_format=rr.Box2DFormat.XYWH, colors=[70, 70, 70])
    recording.log("camera/sensor", sensor, static=True)
    thin, thick = rr.Radius.ui_points(0.7), rr.Radius.ui_points(2.0)
    recording.log("camera/candidates", rr.Ellipses2D.from_fields(colors=NEUTRAL, line_radii=thin), static=True)
    recording.log("camera/leds", rr.Points2D.from_fields(colors=FOUND, radii=thick), static=True)
    recording.log("camera/ring", rr.LineStrips2D.from_fields(colors=BELIEF, radii=thin), static=True)


def log_overlays(
    recording: Any, log: FlightLog, ticks: Sequence[int], times: list[Any], sheets: NavigationSheets
) -> None:
    """Log candidates, named LEDs and the believed ring at some control ticks.

    Args:
        recording: of rerun.
        log: of the flight.
        ticks: indices into the log.
        times: columns of the timelines at these ticks.
        sheets: the navigation's.
    """
    import rerun as rr

    missing, send = frame_missing(log, sheets), recording.send_columns
    solutions = [_unseeing(log.solutions[k]) if missing[k] else log.solutions[k] for k in ticks]

    found = [s.candidates_px + PIXEL_CENTRE for s in solutions]
    sizes = [len(points) for points in found]
    columns = rr.Ellipses2D.columns(centers=_stacked(found, 2), half_sizes=np.full((sum(sizes), 2), 9.0))
    send("camera/candidates", times, columns.partition(sizes))

    seen = [np.flatnonzero(np.isfinite(s.led_pixels_px[:, 0])) for s in solutions]
    sizes = [len(numbers) for numbers in seen]
    leds = [s.led_pixels_px[k] + PIXEL_CENTRE for s, k in zip(solutions, seen, strict=True)]
    labels = [str(k) for numbers in seen for k in numbers]
    send("camera/leds", times, rr.Points2D.columns(positions=_stacked(leds, 2), labels=labels).partition(sizes))

    rings = [believed_ring_px(s, sheets) + PIXEL_CENTRE for s in solutions]
    send("camera/ring", times, rr.LineStrips2D.columns(strips=rings))

    centres = np.array([ring.mean(axis=0) for ring in rings]).reshape(-1, 2)
    middle = 0.5 * np.array([sheets.camera.width_px, sheets.camera.height_px])
    centres = np.where(np.isfinite(centres), centres, middle)
    translations = np.column_stack([centres, np.zeros(len(centres))])
    send(CLOSE_UP, times, rr.Transform3D.columns(translation=translations))


def frame_missing(log: FlightLog, sheets: NavigationSheets) -> NDArray[np.bool_]:
    """(ticks,) whether no frame has arrived for two of the camera's periods.

    What a solution says of LEDs is of the newest frame, however old: then nothing is seen any more.
    """
    ticks = np.arange(len(log.arrived))
    newest = np.maximum.accumulate(np.where(log.arrived, ticks, -len(ticks)))
    return np.asarray((ticks - newest) * sheets.camera_rate_hz >= 2 * sheets.control_rate_hz)


def _unseeing(solution: NavSolution) -> NavSolution:
    none, unseen = np.empty((0, 2)), np.full_like(solution.led_pixels_px, np.nan)
    return replace(solution, candidates_px=none, led_pixels_px=unseen)


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
