"""RMSE of position and attitude at 10, 20 and 30 m, and the errors trial by trial; see `trials` for the set-up."""

from pathlib import Path
from typing import Any

import numpy as np

from dockair.rotations import Array
from dockair.scenarios.reproduce.pose.trials import COLUMNS, RADIUS, READINGS, Reading, errors, rmse
from dockair.scenarios.reproduce.reference import picture_name, read_reference

_SIZE_M = 0.5
_TRIALS = 500
_SEED = 3
_SIZE_IN, _DPI = (11.0, 6.6), 110


def table3(out: Path | None) -> dict[str, Any]:
    """Return the table in every reading, `x_over_reference` and the like beside each; all as bars in `out`."""
    printed = _printed()
    rows = []
    for reading in READINGS:
        rng = np.random.default_rng(_SEED)
        for range_m, reference in printed.items():
            found, on_the_way = errors(reading, _SIZE_M, range_m, _TRIALS, rng)
            rows.append(_row(reading, range_m, found, reference))
            rows[-1]["ours"]["not_converged"] = on_the_way
    if out is not None:
        _draw_table(rows, out / picture_name("pose/table3"))
    return {"id": "pose/table3", "source": "[Yoon 2018, table 3]", "rows": rows}


def figures_23_to_25(out: Path | None) -> dict[str, Any]:
    """Return the RMSE of the reading that fits all columns; its errors trial by trial in `out`."""
    rng = np.random.default_rng(_SEED)
    printed = _printed()
    found = {range_m: errors(RADIUS, _SIZE_M, range_m, _TRIALS, rng)[0] for range_m in printed}
    rows = [_row(RADIUS, range_m, each, printed[range_m]) for range_m, each in found.items()]
    if out is not None:
        _draw_trials(found, out / picture_name("pose/fig23-25"))
    return {"id": "pose/fig23-25", "source": "[Yoon 2018, figs 23-25]", "rows": rows}


REPRODUCTIONS = {
    "pose/table3": ("Levenberg-Marquardt: RMSE by range, in every reading of size and noise", table3),
    "pose/fig23-25": ("Levenberg-Marquardt: errors of 500 trials at 10, 20 and 30 m", figures_23_to_25),
}


def _printed() -> dict[float, dict[str, float]]:
    rows = read_reference("yoon_2018_pose")
    return {float(row["range_m"]): {column: float(row[column]) for column in COLUMNS} for row in rows}


def _row(reading: Reading, range_m: float, found: Array, reference: dict[str, float]) -> dict[str, Any]:
    ours = dict(zip(COLUMNS, rmse(found).tolist(), strict=True))
    return {
        "case": f"{range_m:g} m, {reading.name}",
        "ours": {
            **ours,
            **{f"{column.split('_')[0]}_over_reference": ours[column] / reference[column] for column in COLUMNS},
        },
        "reference": reference,
    }


def _draw_table(rows: list[dict[str, Any]], path: Path) -> None:
    from matplotlib.figure import Figure

    figure = Figure(figsize=_SIZE_IN, dpi=_DPI, layout="constrained")
    for panel, column in zip(figure.subplots(2, 3).flat, COLUMNS, strict=True):
        ranges = sorted(_printed())
        for reading, style in zip(READINGS, ("o-", "s-", "o:", "s:"), strict=True):
            ours = [row["ours"][column] for row in rows if row["case"].endswith(reading.name)]
            panel.loglog(ranges, ours, style, ms=4, lw=1.2, label=reading.name)
        panel.loglog(
            ranges, [_printed()[r][column] for r in ranges], "k*", ms=10, label="[Yoon 2018, table 3]", zorder=5
        )
        panel.set(title=f"RMSE of {column.split('_')[0]} [{column.split('_')[1]}]", xlabel="range [m]")
        panel.set_xticks(ranges, [f"{r:g}" for r in ranges])
        panel.minorticks_off()
        panel.grid(alpha=0.3)
    handles, labels = figure.axes[0].get_legend_handles_labels()
    figure.legend(handles, labels, frameon=False, fontsize=8, loc="outside upper center", ncols=len(labels))
    figure.savefig(path)


def _draw_trials(found: dict[float, Array], path: Path) -> None:
    from matplotlib.figure import Figure

    figure = Figure(figsize=_SIZE_IN, dpi=_DPI, layout="constrained")
    panels = figure.subplots(2, 3, sharex=True)
    for (above, below), (range_m, each) in zip(panels.T, found.items(), strict=True):
        for k, column in enumerate(COLUMNS):
            panel, colour = (above, below)[k // 3], ("tab:blue", "tab:orange", "tab:green")[k % 3]
            panel.plot(each[:, k], lw=0.5, color=colour, label=column.split("_")[0], zorder=3 - k % 3)
        above.set(title=f"{range_m:g} m", ylabel="camera in drogue axes [m]" if range_m == min(found) else "")
        below.set(xlabel="trial", ylabel="angle [deg]" if range_m == min(found) else "")
    for panel in panels[:, 0]:
        panel.legend(frameon=False, fontsize=8, ncols=3)
    figure.savefig(path)
