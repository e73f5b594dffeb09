"""Heuristic drift reduction on the straight: 100 m in 85 s, 16 degrees of raw drift, over 100 seeds and four noises.

The source shows one walk. The drift is a constant bias; both readings of the loop with the flown constants are shown.
"""

from pathlib import Path
from typing import Any

import numpy as np

from dockair.nav.heading.hdr import HeuristicDriftReduction, HeuristicDriftSettings
from dockair.rotations import Array
from dockair.scenarios.reproduce.heading.tracks import RATE_HZ, straight_rates_rad_s
from dockair.scenarios.reproduce.reference import picture_name, read_figure

ID = "heading/fig5-7"
TITLE = "heuristic drift reduction on the straight: 16 degrees of drift in 85 s"
NOISES_DEG_S = (0.05, 0.1, 0.2, 0.5)
SEEDS = 100
_SOURCE = "[Kyung et al. 2015, figs 5-7]"
_LOOPS = {"printed": HeuristicDriftSettings(), "closed": HeuristicDriftSettings(loop="closed")}
_SHOWN_DEG_S = 0.1
_SIZE_IN, _DPI = (9.5, 6.5), 110


def reproduce(out: Path | None) -> dict[str, Any]:
    """Tabulate what is left of the drift; the walk's headings as a picture in `out`."""
    printed = read_figure("kyung_2015", "5-7")
    rows = []
    for loop, settings in _LOOPS.items():
        for noise in NOISES_DEG_S:
            ends = [heading_deg(seed, noise, settings)[1][-1] for seed in range(SEEDS)]
            raw = [heading_deg(seed, noise, settings)[0][-1] for seed in range(SEEDS)]
            ours = {
                "walks": SEEDS,
                "raw_drift_deg": float(np.mean(raw)),
                "most_left_deg": float(np.abs(ends).max()),
                "mean_left_deg": float(np.abs(ends).mean()),
            }
            reference = {"raw_drift_deg": printed["raw_drift_deg"], "most_left_deg": printed["most_left_deg"]}
            rows.append({"case": f"{loop} loop, noise {noise} deg/s", "ours": ours, "reference": reference})
    if out is not None:
        _draw(out / picture_name(ID))
    return {"id": ID, "source": _SOURCE, "rows": rows}


def heading_deg(seed: int, noise_deg_s: float, settings: HeuristicDriftSettings) -> tuple[Array, Array]:
    """(8500,) raw and corrected heading of one walk."""
    rates = straight_rates_rad_s(seed, noise_deg_s=noise_deg_s)
    corrected = HeuristicDriftReduction(RATE_HZ, settings).run(rates)
    raw, reduced = (np.degrees(np.cumsum(each)) / RATE_HZ for each in (rates, corrected))
    return raw, reduced


def _draw(path: Path) -> None:
    import matplotlib.pyplot as plt

    figure, axes = plt.subplots(2, 1, figsize=_SIZE_IN, sharex=True, layout="constrained")
    for loop, settings in _LOOPS.items():
        raw, reduced = heading_deg(0, _SHOWN_DEG_S, settings)
        time_s = (np.arange(raw.size) + 1) / RATE_HZ
        axes[1].plot(time_s, reduced, label=f"{loop} loop")
    axes[0].plot(time_s, raw, color="0.4", label="raw")
    axes[0].set_title(f"Straight walk, noise {_SHOWN_DEG_S} deg/s: heading of the gyro, and what is left of its drift")
    for each in axes:
        each.set_ylabel("heading [deg]")
        each.legend()
        each.grid(alpha=0.3)
    axes[1].set_xlabel("time [s]")
    figure.savefig(path, dpi=_DPI)
    plt.close(figure)
