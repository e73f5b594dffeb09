"""One small picture of a flight, from the files it wrote: the approach from the side, a frame, the time histories."""

from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pyarrow.parquet as pq
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from dockair.errors import DockairError
from dockair.rotations import Array
from dockair.scenarios import flight_log, message_log

FILE_NAME = "flight.png"
FRAME_AT_M = 1.5  # the frame shown is the one with most LEDs named when the ring is about this far ahead of the tip
_GROW_PX = 3
_SIZE_IN, _DPI = (11.0, 6.2), 110
_TRUTH, _BELIEF, _FOUND, _GREY = "#1f77b4", "#ff7f0e", "#34c759", "#9a9a9a"
_PHASE_COLOURS = {
    "pre_contact": "#dfe7ee",
    "approach": "#cfe3f7",
    "contact": "#cdeccf",
    "hold": "#b5e2ba",
    "disconnect": "#ece3f4",
    "breakaway": "#f6d5d2",
}


def picture_of_flight(out_dir: str | Path) -> Path:
    """Draw `flight.png` into a flight's folder and return its path.

    Raises:
        DockairError: there is no flight in the folder.
    """
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    folder = Path(out_dir)
    path = folder / flight_log.FILE_NAME
    if not path.is_file():
        raise DockairError(str(path), expected="a flight's log", got="no such file")
    with path.open("rb") as file:  # Arrow takes no path but of UTF-8
        flight = pq.read_table(file)
    frame = _chosen_frame(folder, flight)
    figure = Figure(figsize=_SIZE_IN, dpi=_DPI, layout="constrained")
    FigureCanvasAgg(figure)
    rows = figure.add_gridspec(2, 1, height_ratios=[0.85, 1.0])
    _draw_side_view(figure.add_subplot(rows[0]), flight)
    below = rows[1].subgridspec(2, 2 if frame is not None else 1, width_ratios=[0.8, 2] if frame is not None else [1])
    if frame is not None:
        _draw_frame(figure.add_subplot(below[:, 0]), *frame)
    upper = figure.add_subplot(below[0, -1])
    _draw_approach(upper, flight)
    _draw_errors(figure.add_subplot(below[1, -1], sharex=upper), flight)
    figure.savefig(folder / FILE_NAME)
    return folder / FILE_NAME


def _values(flight: Any, name: str) -> Array:
    return np.asarray(flight[name].to_numpy(zero_copy_only=False))


def _points(flight: Any, name: str, unit: str = "m") -> Array:
    return np.column_stack([_values(flight, f"{name}_{axis}_{unit}") for axis in "xyz"])


def _from_exit(flight: Any, points_W: Array, moments: slice = slice(None)) -> Array:
    """(n, 3) points of n ticks, or (1, m, 3) of one, from the hose's exit in level axes along the tanker's heading."""
    w, x, y, z = (_values(flight, f"truth_q_WT_{axis}") for axis in "wxyz")
    turn, place = Rotation.from_quat(np.column_stack([x, y, z, w])), _points(flight, "truth_p_WT")
    exit_W = place + turn.apply(-place[0])  # at the start the exit is W's origin, and T's axes are W's
    ahead = turn.apply([1.0, 0.0, 0.0])[moments]
    level = Rotation.from_rotvec(np.outer(-np.arctan2(ahead[:, 1], ahead[:, 0]), [0.0, 0.0, 1.0])).as_matrix()
    from_exit_W = points_W.reshape(len(level), -1, 3) - exit_W[moments, None]
    return np.asarray(np.einsum("kij,kmj->kmi", level, from_exit_W).reshape(points_W.shape))


def _contact(flight: Any) -> tuple[bool, int]:
    """Return whether the probe was held, and the tick of that, or where the tip was nearest to the drogue."""
    held = np.flatnonzero(_values(flight, "truth_latched"))
    if len(held):
        return True, int(held[0])
    apart_m = np.linalg.norm(_points(flight, "truth_p_WP") - _points(flight, "truth_p_WD"), axis=1)
    return False, int(np.argmin(apart_m))


def _draw_side_view(axes: Any, flight: Any) -> None:
    tip, drogue = (_from_exit(flight, _points(flight, name)) for name in ("truth_p_WP", "truth_p_WD"))
    held, moment = _contact(flight)
    hose = np.array(flight["truth_p_WH_m"][moment].as_py()).reshape(1, -1, 3)
    hose = _from_exit(flight, hose, slice(moment, moment + 1))[0]
    phases = flight["nav_phase"].to_pylist()
    axes.plot(hose[:, 0], hose[:, 2], color="#3a3a3a", lw=2.5, label="hose")
    axes.plot(drogue[:, 0], drogue[:, 2], color=_GREY, lw=0.8, label="drogue's path")
    axes.plot(*drogue[moment, [0, 2]], marker="o", ms=8, mfc="none", mec="#3a3a3a", mew=2.0, ls="none")
    before = np.arange(moment + 1)
    axes.plot(tip[before, 0], tip[before, 2], color=_TRUTH, lw=1.6, label="probe's tip, to contact")
    axes.plot(tip[moment:, 0], tip[moment:, 2], color=_TRUTH, lw=0.8, alpha=0.5, label="and after")
    axes.plot(*tip[0, [0, 2]], marker="o", ms=4, color=_TRUTH, ls="none")
    words = "contact" if held else f"nearest, {phases[moment].replace('_', ' ')}"
    time_s = _values(flight, "time_s")[moment]
    axes.annotate(
        f"{words} at {time_s:.1f} s", tip[moment, [0, 2]], xytext=(0, -34), textcoords="offset points", ha="center",
        fontsize=9, arrowprops={"arrowstyle": "-", "color": _GREY},
    )  # fmt: skip
    axes.annotate("pod", (0.0, 0.0), xytext=(4, 4), textcoords="offset points", fontsize=9)
    axes.set(xlabel="forward of the pod [m]", ylabel="up [m]", title="From the left side, tanker's axes")
    axes.set_aspect("equal", adjustable="datalim")
    axes.legend(loc="upper left", fontsize=8, frameon=False)


def _chosen_frame(folder: Path, flight: Any) -> tuple[Any, tuple[int, int], Any, Any, float] | None:
    """Return pixels, (left column, top row), named LEDs and candidates [px] and range [m] of the frame to show."""
    if not (folder / message_log.MESSAGES).is_file():
        return None
    ahead, named = _values(flight, "nav_p_PD_B_x_m"), _values(flight, "nav_leds_named")
    fresh = _fresh(flight)
    inward = fresh[fresh <= _contact(flight)[1]]
    fresh = inward if len(inward) else fresh  # the way back passes there, too
    chosen = int(fresh[np.argmin(np.abs(ahead[fresh] - FRAME_AT_M) + 10.0 * (8 - named[fresh]))])
    messages = message_log.read_messages(folder, pixels=False)
    tick = next(tick for k, tick in enumerate(messages) if k == chosen)
    estimate = next(row for k, row in enumerate(message_log.read_estimates(folder)) if k == chosen)
    if tick.frame is None or tick.png is None:
        return None
    leds, candidates = (np.asarray(estimate[name]).reshape(-1, 2) for name in ("led_pixels_px", "candidates_px"))
    corner = tick.frame.window.column_start, tick.frame.window.row_start
    return message_log.pixels_from_png(tick.png), corner, leds, candidates, float(ahead[chosen])


def _draw_frame(
    axes: Any, pixels: Array, corner: tuple[int, int], leds: Array, candidates: Array, ahead_m: float
) -> None:
    left, top = corner
    rows, columns = pixels.shape
    grown = cv2.dilate(
        pixels, np.ones((_GROW_PX, _GROW_PX), np.uint8)
    )  # an LED is a few pixels wide: nobody would see it
    extent = (left - 0.5, left + columns - 0.5, top + rows - 0.5, top - 0.5)
    axes.imshow(np.sqrt(grown / 255.0), cmap="gray", extent=extent, vmin=0.1, vmax=0.7, interpolation="antialiased")
    axes.scatter(*candidates.T, s=70, facecolors="none", edgecolors="#ffd60a", linewidths=0.8)
    centre = np.nanmean(leds, axis=0) if np.isfinite(leds).any() else np.zeros(2)
    for number, led in enumerate(leds):
        if np.isfinite(led).all():
            u, v = led + 0.16 * (centre - led)
            axes.text(u, v, str(number), color=_FOUND, fontsize=9, ha="center", va="center")
    axes.set(xlabel="u [px]", ylabel="v [px]", title=f"Near-infrared frame, {ahead_m:.1f} m to go")
    axes.set_xlim(extent[0], extent[1])
    axes.set_ylim(extent[2], extent[3])
    axes.tick_params(labelsize=8)


def _shade_phases(axes: Any, flight: Any, *, named: bool) -> None:
    time_s, phases = _values(flight, "time_s"), flight["nav_phase"].to_pylist()
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
    time_s = _values(flight, "time_s")
    _shade_phases(axes, flight, named=True)
    axes.plot(time_s, _values(flight, "truth_p_PD_B_x_m"), color=_TRUTH, lw=1.4, label="ring ahead of\nthe tip [m]")
    across = np.hypot(_values(flight, "truth_p_PD_B_y_m"), _values(flight, "truth_p_PD_B_z_m"))
    axes.plot(time_s, across, color="#8e44ad", lw=1.2, label="ring off the\nprobe's line [m]")
    axes.plot(time_s, -_values(flight, "truth_v_PD_B_x_m_s"), color="#2e8b57", lw=1.2, label="closing speed\n[m/s]")
    axes.axhline(0.0, color=_GREY, lw=0.6)
    _legend_beside(axes)
    low, high = axes.get_ylim()
    axes.set_ylim(low, high + 0.18 * (high - low))  # room for the phases' names
    axes.tick_params(labelbottom=False, labelsize=8)


def _draw_errors(axes: Any, flight: Any) -> None:
    time_s = _values(flight, "time_s")
    _shade_phases(axes, flight, named=False)
    gone = _gone(flight)
    shown = np.union1d(_fresh(flight), np.flatnonzero(gone))
    sizes_mm = []
    for axis, colour, label in (("x", _BELIEF, "along"), ("y", _TRUTH, "left"), ("z", "#8e44ad", "up")):
        error_mm = 1e3 * (_values(flight, f"nav_p_PD_B_{axis}_m") - _values(flight, f"truth_p_PD_B_{axis}_m"))
        error_mm = np.where(gone, np.nan, error_mm)[shown]
        sizes_mm.append(np.abs(error_mm))
        axes.plot(time_s[shown], error_mm, color=colour, lw=0.9, label=label)
    sigma_mm = np.where(gone, np.nan, 3e3 * _values(flight, "nav_sigma_p_PD_B_x_m"))[shown]
    axes.plot(time_s[shown], sigma_mm, color=_BELIEF, lw=0.8, ls=":", label="3 sigma, along")
    axes.plot(time_s[shown], -sigma_mm, color=_BELIEF, lw=0.8, ls=":")
    sizes = np.concatenate(sizes_mm)
    limit = 1.6 * float(np.nanpercentile(sizes, 95.0)) if np.isfinite(sizes).any() else 1.0
    axes.set_ylim(-max(limit, 1.0), max(limit, 1.0))
    axes.set(xlabel="time [s]")
    axes.set_ylabel("belief - truth [mm]", fontsize=9)
    _legend_beside(axes)
    axes.tick_params(labelsize=8)


def _gone(flight: Any) -> NDArray[np.bool_]:
    """Return at which ticks no solution may be flown on: a line across them would read as drift."""
    return np.asarray(~_values(flight, "nav_valid").astype(bool))


def _fresh(flight: Any) -> NDArray[np.int64]:
    """Return the ticks with a new frame; every tick of a flight without camera."""
    stamps = _values(flight, "nav_frame_time_stamp_s")
    if not np.isfinite(stamps).any():
        return np.arange(len(stamps), dtype=np.int64)
    before = np.nan_to_num(np.concatenate([[np.nan], stamps[:-1]]), nan=-np.inf)
    return np.asarray(np.flatnonzero(stamps > before), dtype=np.int64)
