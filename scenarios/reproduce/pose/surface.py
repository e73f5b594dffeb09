"""RMSE over size of the drogue and range, the source's two surfaces; see `trials` for the set-up.

The source prints no number of figures 21 and 22, only that a drogue of 10 cm degrades fast with range and one of 50 cm
hardly. A frontal ring's tilt shows in the image by perspective, as r^2/R per radian, and by foreshortening, as r/2 per
radian squared. Where perspective carries it the angles' error grows with (R/r)^2 and the camera's sideways error, range
times angle, with R^3/r^2; where noise drowns perspective, with the root of R/r and its R-fold: a small drogue is there
at all ranges of the figures.
"""

from pathlib import Path
from typing import Any

import numpy as np

from dockair.rotations import Array
from dockair.scenarios.reproduce.pose.trials import READINGS, Reading, errors
from dockair.scenarios.reproduce.reference import picture_name

_SIZES_M = (0.10, 0.20, 0.30, 0.40, 0.50)
_RANGES_M = (25.0, 30.0, 35.0, 40.0, 45.0, 50.0)
_TRIALS = 300
_SEED = 21
_SIZE_IN, _DPI = (13.0, 3.9), 110


def distance(out: Path | None) -> dict[str, Any]:
    """Return RMSE of the camera's position in drogue axes [m] at the surface's corners; the surface in `out`."""
    return _reproduce("pose/fig21", "[Yoon 2018, fig 21]", slice(0, 3), "position_m", out)


def angle(out: Path | None) -> dict[str, Any]:
    """Return RMSE of the attitude [deg] at the surface's corners; the surface in `out`."""
    return _reproduce("pose/fig22", "[Yoon 2018, fig 22]", slice(3, 6), "attitude_deg", out)


REPRODUCTIONS = {
    "pose/fig21": ("Levenberg-Marquardt: position RMSE over size and range", distance),
    "pose/fig22": ("Levenberg-Marquardt: attitude RMSE over size and range", angle),
}


def surface(reading: Reading, columns: slice, trials: int = _TRIALS, seed: int = _SEED) -> tuple[Array, int]:
    """Return (sizes, ranges) root of the summed squares of three components, and how many trials did not converge."""
    rng = np.random.default_rng(seed)
    found, failed = np.empty((len(_SIZES_M), len(_RANGES_M))), 0
    for i, size_m in enumerate(_SIZES_M):
        for k, range_m in enumerate(_RANGES_M):
            each, on_the_way = errors(reading, size_m, range_m, trials, rng)
            found[i, k] = np.sqrt((each[:, columns] ** 2).sum(axis=1).mean())
            failed += on_the_way
    return found, failed


def _reproduce(wanted: str, source: str, columns: slice, quantity: str, out: Path | None) -> dict[str, Any]:
    surfaces = {reading: surface(reading, columns) for reading in READINGS}
    rows = [_row(reading, quantity, *each) for reading, each in surfaces.items()]
    if out is not None:
        _draw({reading: found for reading, (found, _) in surfaces.items()}, quantity, out / picture_name(wanted))
    return {"id": wanted, "source": source, "rows": rows}


def _row(reading: Reading, quantity: str, found: Array, failed: int) -> dict[str, Any]:
    name, unit = quantity.split("_")
    corners = {
        f"{name}_size_{100 * _SIZES_M[i]:.0f}_cm_at_{_RANGES_M[k]:.0f}_m_{unit}": float(found[i, k])
        for i in (0, -1)
        for k in (0, -1)
    }
    return {"case": reading.name, "ours": {**corners, "not_converged": failed}, "reference": {}}


def _draw(surfaces: dict[Reading, Array], quantity: str, path: Path) -> None:
    from matplotlib.figure import Figure

    figure = Figure(figsize=_SIZE_IN, dpi=_DPI, layout="constrained")
    name, unit = quantity.split("_")
    for panel, (reading, found) in zip(figure.subplots(1, len(surfaces)), surfaces.items(), strict=True):
        for size_m, row in zip(_SIZES_M, found, strict=True):
            panel.semilogy(_RANGES_M, row, "o-", ms=3, label=f"{100 * size_m:.0f} cm")
        panel.set(xlabel="range [m]", title=reading.name)
        panel.title.set_fontsize(9)
        panel.grid(alpha=0.3, which="both")
    figure.axes[0].set_ylabel(f"RMSE of {name} [{unit}]")
    figure.axes[0].legend(frameon=False, fontsize=8, title="size")
    figure.savefig(path)
