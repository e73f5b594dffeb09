"""Two laps of the oval: heuristic drift reduction loses turns, vision drift reduction keeps them.

The visual headings are those that `vision` sees at 151 points of a lap, one after the other for two laps; walks
to the left and, in mirrored pictures, to the right. The source prints one walk to one side.
"""

from pathlib import Path
from typing import Any

import numpy as np

from dockair.nav.heading.vdr import VisionDriftReduction
from dockair.rotations import Array
from dockair.scenarios.reproduce.heading.tracks import LAPS, OVAL_S, RATE_HZ, hdr_heading_rad, oval_rates_rad_s
from dockair.scenarios.reproduce.heading.vision import POINTS, seen_lap
from dockair.scenarios.reproduce.reference import picture_name, read_figure

ID = "heading/fig9-11"
TITLE = "two laps of an oval, 720 degrees: heuristic and vision drift reduction"
NOISES_DEG_S = (0.05, 0.1, 0.2, 0.5)
_SOURCE = "[Kyung et al. 2015, figs 9-11]"
_SEEDS, _SHOWN_DEG_S = 5, 0.1
_SIZE_IN, _DPI = (9.5, 7.5), 110
_LINES = (
    ("true", "true", "black"),
    ("raw", "raw gyro", "0.6"),
    ("hdr", "HDR", "tab:green"),
    ("vdr", "VDR", "tab:blue"),
)  # one colour a line in both panels, those of heading/racetrack


def reproduce(out: Path | None) -> dict[str, Any]:
    """Tabulate what the headings read at the end and their errors; their course as a picture in `out`."""
    printed = read_figure("kyung_2015", "9-11")
    reference = {key: value for key, value in printed.items() if key not in ("duration_s", "turned_deg")}
    rows = []
    for side in ("left", "right"):
        for noise in NOISES_DEG_S:
            walks = [walk(seed, noise, mirrored=side == "right") for seed in range(_SEEDS)]
            rows.append(
                {"case": f"to the {side}, noise {noise} deg/s", "ours": _figures(walks), "reference": reference}
            )
    if out is not None:
        _draw(out / picture_name(ID))
    return {"id": ID, "source": _SOURCE, "rows": rows}


def walk(seed: int, noise_deg_s: float, *, mirrored: bool = False) -> dict[str, Array]:
    """(28000,) headings [rad] of two laps: true, raw, hdr, vdr."""
    left, true = oval_rates_rad_s(seed, noise_deg_s=noise_deg_s)
    bias_and_noise, side = left - true, -1.0 if mirrored else 1.0
    rates, true = side * true + bias_and_noise, side * true
    visual, vdr = _visual(mirrored), VisionDriftReduction(RATE_HZ)
    seen = [vdr.step(float(rate), visual.get(i)) for i, rate in enumerate(rates)]
    sums = {"true": true, "raw": rates}
    headings = {name: np.cumsum(rate) / RATE_HZ for name, rate in sums.items()}
    return headings | {"hdr": hdr_heading_rad(rates), "vdr": np.array(seen)}


def _visual(mirrored: bool) -> dict[int, float]:
    """Sample -> visual heading."""
    lap = seen_lap(mirrored=mirrored).seen_rad
    both = np.concatenate([lap[:-1] + n * lap[-1] for n in range(LAPS)])
    samples = np.round(np.arange(LAPS * POINTS) * OVAL_S * RATE_HZ / (LAPS * POINTS)).astype(int)
    return dict(zip(samples.tolist(), both.tolist(), strict=True))


def _figures(walks: list[dict[str, Array]]) -> dict[str, float]:
    def error_deg(name: str) -> Array:
        return np.asarray(np.degrees([each[name] - each["true"] for each in walks]))

    hdr, vdr = error_deg("hdr"), error_deg("vdr")
    jumps = np.degrees(np.array([np.abs(np.diff(each["vdr"]) - np.diff(each["raw"])) for each in walks])) * RATE_HZ
    return {
        "walks": len(walks),
        "hdr_reads_deg": float(np.degrees(np.mean([abs(each["hdr"][-1]) for each in walks]))),
        "vdr_reads_deg": float(np.degrees(np.mean([abs(each["vdr"][-1]) for each in walks]))),
        "hdr_mean_error_deg": float(np.abs(hdr).mean()),
        "vdr_mean_error_deg": float(np.abs(vdr).mean()),
        "vdr_worst_error_deg": float(np.abs(vdr).max()),
        "vdr_fastest_correction_deg_s": float(jumps.max()),
    }


def _draw(path: Path) -> None:
    import matplotlib.pyplot as plt

    headings = walk(0, _SHOWN_DEG_S)
    figure, axes = plt.subplots(2, 1, figsize=_SIZE_IN, sharex=True, layout="constrained")
    time_s = (np.arange(headings["true"].size) + 1) / RATE_HZ
    for name, label, colour in _LINES:
        axes[0].plot(time_s, np.degrees(headings[name]), color=colour, label=label)
        if name != "true":
            error_deg = np.abs(np.degrees(headings[name] - headings["true"]))
            axes[1].plot(time_s, error_deg + 1e-3, color=colour, label=label)
    axes[0].set_ylabel("heading [deg]")
    axes[0].set_title(f"Two laps, 720 degrees, drift 16 degrees in 85 s, noise {_SHOWN_DEG_S} deg/s")
    axes[1].set(yscale="log", ylim=(1e-2, 2e2), ylabel="error [deg]", xlabel="time [s]")
    for each in axes:
        each.legend()
        each.grid(alpha=0.3)
    figure.savefig(path, dpi=_DPI)
    plt.close(figure)
