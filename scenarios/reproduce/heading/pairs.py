"""Visual heading: two pictures 4 degrees apart (fig 2), the line (eqs 3-6, 11), one lap at 151 points (fig 8)."""

from pathlib import Path
from typing import Any

import numpy as np

from dockair.nav.heading.visual import measure_turn
from dockair.scenarios.reproduce.heading.scene import Landscape, random_landscape
from dockair.scenarios.reproduce.heading.vision import POINTS, calibration, seen_lap
from dockair.scenarios.reproduce.reference import picture_name, read_figure

_SOURCE = "[Kyung et al. 2015, {}]"
_PAIR_SEED, _PAIR_PANELS, _PAIR_RANGES_M = 2, 120, (40.0, 600.0)
_PAIR_WIDTH_PX, _PAIR_HEIGHT_PX = 2700, 700
_SHOWN_MATCHES = 40
_DPI = 110


PAIR_ID, LAP_ID = "heading/fig2", "heading/fig8"


def reproduce_pair(out: Path | None) -> dict[str, Any]:
    """Match one pair, and draw it in `out`; the source's pixels a degree are a focal length of 2120 px."""
    printed = read_figure("kyung_2015", "2")
    turn_deg = printed["turn_deg"]
    focal_px = printed["px_per_deg"] / np.radians(1.0)
    scene = random_landscape(_PAIR_SEED, panels=_PAIR_PANELS, distances_m=_PAIR_RANGES_M)
    scene = Landscape(panels=scene.panels, focal_length_px=focal_px, width_px=_PAIR_WIDTH_PX, height_px=_PAIR_HEIGHT_PX)
    pictures = scene.image(0.0, 0.0, 0.0), scene.image(0.0, 0.0, float(np.radians(turn_deg)))
    turn = measure_turn(*pictures, calibration().line)
    shifts = turn.pixels[1][:, 0] - turn.pixels[0][:, 0]
    ours = {
        "turn_deg": turn_deg,
        "matches": turn.matches,
        "px_per_deg": turn.shift_px / turn_deg,
        "mean_px_per_deg": float(shifts.mean()) / turn_deg,
    }
    reference = {key: printed[key] for key in ("turn_deg", "px_per_deg", "mean_px_per_deg")}
    if out is not None:
        _draw_pair(pictures, turn.pixels, out / picture_name(PAIR_ID))
    row = {"case": f"{turn_deg:g} degrees", "ours": ours, "reference": reference}
    return {"id": PAIR_ID, "source": _SOURCE.format("fig 2"), "rows": [row]}


def reproduce_lap(out: Path | None) -> dict[str, Any]:
    """Tabulate line and errors; drawn in `out`."""
    line, printed_line = read_figure("kyung_2015", "3"), read_figure("kyung_2015", "8")
    fitted, lap = calibration(), seen_lap()
    residuals = np.degrees(fitted.turns_rad - fitted.line.slope_rad_px * fitted.shifts_px)
    rows = [
        {
            "case": "calibration line",
            "ours": {
                "pairs": int(fitted.turns_rad.size),
                "slope_deg_px": float(np.degrees(fitted.line.slope_rad_px)),
                "offset_deg": float(np.degrees(fitted.printed.offset_rad)),
                "rms_deg": float(np.sqrt(np.mean(residuals**2))),
            },
            "reference": {"slope_deg_px": line["slope_deg_px"], "offset_deg": line["offset_deg"]},
        },
        _row("one lap to the left", lap, printed_line),
        _row("one lap to the right", seen_lap(mirrored=True), printed_line),
    ]
    if out is not None:
        _draw_lap(out / picture_name(LAP_ID))
    return {"id": LAP_ID, "source": _SOURCE.format("fig 8, eqs 3-6, 11"), "rows": rows}


def _row(case: str, lap: Any, printed: dict[str, float]) -> dict[str, Any]:
    errors = np.abs(np.degrees(np.diff(lap.seen_rad) - np.diff(lap.true_rad)))
    ours = {
        "points": POINTS,
        "max_error_deg": float(errors.max()),
        "mean_error_deg": float(errors.mean()),
        "min_error_deg": float(errors.min()),
        "lap_reads_deg": float(np.degrees(lap.seen_rad[-1])),
        "refused": lap.refused,
        "key_frames": lap.key_frames,
    }
    return {"case": case, "ours": ours, "reference": printed}


def _draw_pair(pictures: Any, pixels: Any, path: Path) -> None:
    import matplotlib.pyplot as plt

    figure, axes = plt.subplots(2, 1, figsize=(11.0, 6.4), layout="constrained")
    every = max(len(pixels[0]) // _SHOWN_MATCHES, 1)
    for each, picture, points, title in zip(axes, pictures, pixels, ("first", "4 degrees to the left"), strict=True):
        each.imshow(picture, cmap="gray", vmin=0, vmax=255)
        each.scatter(*points[::every].T, c=np.arange(len(points[::every])), cmap="hsv", s=14)
        each.set(title=title, xlabel="u [px]", ylabel="v [px]")
    figure.savefig(path, dpi=_DPI)
    plt.close(figure)


def _draw_lap(path: Path) -> None:
    import matplotlib.pyplot as plt

    fitted, lap = calibration(), seen_lap()
    figure, axes = plt.subplots(1, 2, figsize=(11.0, 4.4), layout="constrained")
    axes[0].plot(fitted.shifts_px, np.degrees(fitted.turns_rad), ".", label="known turns")
    ends = np.array([fitted.shifts_px.min(), fitted.shifts_px.max()])
    axes[0].plot(ends, np.degrees(fitted.line.slope_rad_px * ends), label="line through zero")
    axes[0].set(xlabel="column shift [px]", ylabel="turn [deg]", title="Calibration")
    axes[0].legend()
    axes[1].plot(np.degrees(np.diff(lap.true_rad)), label="true")
    axes[1].plot(np.degrees(np.diff(lap.seen_rad)), label="seen")
    axes[1].set(xlabel="point", ylabel="turn since the last point [deg]", title="One lap")
    axes[1].legend()
    for each in axes:
        each.grid(alpha=0.3)
    figure.savefig(path, dpi=_DPI)
    plt.close(figure)


REPRODUCTIONS = {
    PAIR_ID: ("features matched between two pictures 4 degrees apart: pixels a degree", reproduce_pair),
    LAP_ID: ("visual heading on one lap of the oval: turns at 151 points, and the calibration line", reproduce_lap),
}
