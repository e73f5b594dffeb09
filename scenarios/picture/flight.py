"""One small picture of a flight, from the files it wrote: the paths, a frame, the time histories."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from dockair.errors import DockairError
from dockair.rotations import Array
from dockair.scenarios import flight_log, message_log
from dockair.scenarios.judgement.attempts import RefereeLimits
from dockair.scenarios.parquet_file import read_parquet
from dockair.scenarios.picture.columns import contact, fresh, not_valid, values, vectors, without_frame
from dockair.scenarios.picture.paths import draw_along_axis, draw_side_view
from dockair.scenarios.recording.frames import shown_pixels

FILE_NAME = "flight.png"
FRAME_AT_M = 1.5  # the frame shown is the one with most LEDs named when the ring is about this far ahead of the tip
_GROW_PX = 3
_GREYS = 16  # of the frame, for a small file
_SIZE_IN, _DPI = (11.0, 6.8), 100
_TRUTH, _BELIEF, _FOUND, _GREY = "#1f77b4", "#ff7f0e", "#34c759", "#9a9a9a"
_PHASE_COLOURS = {
    "pre_contact": "#dfe7ee",
    "approach": "#cfe3f7",
    "contact": "#cdeccf",
    "hold": "#b5e2ba",
    "disconnect": "#ece3f4",
    "breakaway": "#f6d5d2",
}


def picture_of_flight(out_dir: str | Path, limits: RefereeLimits | None = None) -> Path:
    """Draw `flight.png` into a flight's folder and return its path.

    Args:
        out_dir: the folder.
        limits: of the flight's referee, whose rim and good docking are drawn; the built-in ring's by default.

    Raises:
        DockairError: there is no flight in the folder.
    """
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    folder = Path(out_dir)
    path = folder / flight_log.FILE_NAME
    if not path.is_file():
        raise DockairError(str(path), expected="a flight's log", got="no such file")
    flight = read_parquet(path)
    frame = _chosen_frame(folder, flight)
    figure = Figure(figsize=_SIZE_IN, dpi=_DPI, layout="constrained")
    FigureCanvasAgg(figure)
    rows = figure.add_gridspec(2, 1, height_ratios=[0.8, 1.0])
    above = rows[0].subgridspec(1, 2, width_ratios=[2.2, 1.0])
    limits = limits or RefereeLimits()
    draw_side_view(figure.add_subplot(above[0]), flight, limits)
    draw_along_axis(figure, figure.add_subplot(above[1]), flight, limits)
    widths = [1.0] if frame is None else [0.8, 2.0]
    below = rows[1].subgridspec(4, len(widths), width_ratios=widths, height_ratios=[2.4, 1.0, 1.0, 1.0])
    if frame is not None:
        _draw_frame(figure.add_subplot(below[:, 0]), *frame)
    upper = figure.add_subplot(below[0, -1])
    _draw_approach(upper, flight)
    _draw_errors([figure.add_subplot(below[k, -1], sharex=upper) for k in (1, 2, 3)], flight)
    figure.draw_without_rendering()  # the layout goes by the ticks of before the axes had their aspect
    figure.savefig(folder / FILE_NAME, pil_kwargs={"optimize": True})
    return folder / FILE_NAME


def _chosen_frame(folder: Path, flight: Any) -> tuple[NDArray[np.uint8], tuple[int, int], Any, Any, float] | None:
    """Return pixels, (left column, top row), named LEDs and candidates [px] and range [m] of the frame to show."""
    if not (folder / message_log.MESSAGES).is_file():
        return None
    ahead, named = values(flight, "nav_p_PD_B_x_m"), values(flight, "nav_leds_named")
    ticks = fresh(flight)
    inward = ticks[ticks <= contact(flight)[1]]
    ticks = inward if len(inward) else ticks  # the way back passes there, too
    known = ticks[np.isfinite(ahead[ticks])]  # a navigator of one's own may answer NaN while it is not valid
    ticks = known if len(known) else ticks
    chosen = int(ticks[np.argmin(np.abs(ahead[ticks] - FRAME_AT_M) + 10.0 * (8 - named[ticks]))])
    messages = message_log.read_messages(folder, pixels=False)
    tick = next(tick for k, tick in enumerate(messages) if k == chosen)
    estimate = next(row for k, row in enumerate(message_log.read_estimates(folder)) if k == chosen)
    if tick.frame is None or tick.png is None:
        return None
    leds, candidates = (np.asarray(estimate[name]).reshape(-1, 2) for name in ("led_pixels_px", "candidates_px"))
    corner = tick.frame.window.column_start, tick.frame.window.row_start
    return message_log.pixels_from_png(tick.png), corner, leds, candidates, float(ahead[chosen])


def _draw_frame(
    axes: Any, pixels: NDArray[np.uint8], corner: tuple[int, int], leds: Array, candidates: Array, ahead_m: float
) -> None:
    from matplotlib import colormaps

    left, top = corner
    rows, columns = pixels.shape
    # an LED is a few pixels wide: nobody would see it
    grown = np.asarray(cv2.dilate(pixels, np.ones((_GROW_PX, _GROW_PX), np.uint8)), np.uint8)
    extent = (left - 0.5, left + columns - 0.5, top + rows - 0.5, top - 0.5)
    greys = colormaps["gray"].resampled(_GREYS)
    axes.imshow(shown_pixels(grown), cmap=greys, extent=extent, vmin=0, vmax=255, interpolation_stage="data")
    axes.scatter(*candidates.T, s=70, facecolors="none", edgecolors="#ffd60a", linewidths=0.8)
    centre = np.nanmean(leds, axis=0) if np.isfinite(leds).any() else np.zeros(2)
    for number, led in enumerate(leds):
        if np.isfinite(led).all():
            u, v = led + 0.16 * (centre - led)
            axes.text(u, v, str(number), color=_FOUND, fontsize=9, ha="center", va="center")
    axes.set(xlabel="u [px]", ylabel="v [px]")
    to_go = f", {ahead_m:.1f} m to go" if np.isfinite(ahead_m) else ""
    axes.set_title(f"Near-infrared frame{to_go}", fontsize=10)
    axes.set_xlim(extent[0], extent[1])
    axes.set_ylim(extent[2], extent[3])
    axes.tick_params(labelsize=8)


def _shade_phases(axes: Any, flight: Any, *, named: bool) -> None:
    time_s, phases = values(flight, "time_s"), flight["nav_phase"].to_pylist()
    begins = [k for k, phase in enumerate(phases) if k == 0 or phase != phases[k - 1]]
    for begin, end in zip(begins, [*begins[1:], len(phases) - 1], strict=True):
        axes.axvspan(time_s[begin], time_s[end], color=_PHASE_COLOURS.get(phases[begin], "white"), lw=0.0, zorder=0)
        if named and time_s[end] - time_s[begin] > 0.07 * time_s[-1]:
            middle = 0.5 * (time_s[begin] + time_s[end])
            label = phases[begin].replace("_", "-")
            axes.text(middle, 0.98, label, transform=axes.get_xaxis_transform(), fontsize=8, ha="center", va="top")
    axes.set_xlim(time_s[0], max(time_s[-1], time_s[0] + 1e-3))  # also of a flight of one tick


def _legend_beside(axes: Any) -> None:
    axes.legend(loc="center left", bbox_to_anchor=(1.0, 0.5), fontsize=8, frameon=False)


def _draw_approach(axes: Any, flight: Any) -> None:
    time_s = values(flight, "time_s")
    _shade_phases(axes, flight, named=True)
    axes.plot(time_s, values(flight, "truth_p_PD_B_x_m"), color=_TRUTH, lw=1.4, label="ring ahead [m]")
    across = np.hypot(values(flight, "truth_p_PD_B_y_m"), values(flight, "truth_p_PD_B_z_m"))
    axes.plot(time_s, across, color="#8e44ad", lw=1.2, label="ring beside [m]")
    axes.plot(time_s, -values(flight, "truth_v_PD_B_x_m_s"), color="#2e8b57", lw=1.2, label="closing [m/s]")
    axes.axhline(0.0, color=_GREY, lw=0.6)
    _legend_beside(axes)
    low, high = axes.get_ylim()
    axes.set_ylim(low, high + 0.18 * (high - low))  # room for the phases' names
    axes.tick_params(labelbottom=False, labelsize=8)


def _draw_errors(panels: Sequence[Any], flight: Any) -> None:
    """Draw the belief's error along, to the left and up, one above the other, over three of its own sigmas."""
    time_s = values(flight, "time_s")
    gone = not_valid(flight)
    shown = np.union1d(np.union1d(fresh(flight), without_frame(flight)), np.flatnonzero(gone))
    error_mm = 1e3 * (vectors(flight, "nav_p_PD_B") - vectors(flight, "truth_p_PD_B"))
    bound_mm = 3e3 * vectors(flight, "nav_sigma_p_PD_B")
    error_mm, bound_mm = (np.where(gone[:, None], np.nan, each)[shown] for each in (error_mm, bound_mm))
    limit_mm = _shown_limit(np.concatenate([np.abs(error_mm), bound_mm]))
    for k, (axes, word) in enumerate(zip(panels, ("along", "left", "up"), strict=True)):
        _shade_phases(axes, flight, named=False)
        axes.fill_between(time_s[shown], -bound_mm[:, k], bound_mm[:, k], color=_GREY, alpha=0.45, lw=0.0)
        axes.plot(time_s[shown], error_mm[:, k], color=_BELIEF, lw=0.9)
        axes.axhline(0.0, color=_GREY, lw=0.6)
        axes.set_ylim(-limit_mm, limit_mm)
        axes.set_ylabel(word, fontsize=8)
        axes.tick_params(labelsize=8, labelbottom=k == 2)
    words = panels[1].text(1.01, 0.5, "belief - truth [mm],\ngrey: 3 sigma", transform=panels[1].transAxes, fontsize=8)
    words.set_in_layout(False)  # the legend above has made room
    panels[2].set_xlabel("time [s]", fontsize=9)


def _shown_limit(sizes_mm: Array) -> float:
    """Return where an axis of errors ends: beyond nine tenths of them, so that a drogue that was lost flattens none."""
    known_mm = sizes_mm[np.isfinite(sizes_mm)]  # a navigator of one's own may claim an infinite sigma
    return max(1.3 * float(np.percentile(known_mm, 90.0)), 1.0) if known_mm.size else 1.0
