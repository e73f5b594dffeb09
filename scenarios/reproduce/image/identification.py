"""Rings of eight LEDs among clutter: found, ambiguous and wrong by LEDs seen and clutter, and what it takes.

*Found*: FOUND with all visible LEDs but at most one, rightly named, and no clutter. *Wrong*: FOUND with clutter or a
wrong name among the members. Names count up to the ring's symmetry, but absolutely where a prediction settles them. The
tables: nothing known, by three-point circles and by Hough; where a track predicts the LEDs; clutter within 1.5 radii of
the ring, by place alone and by brightness too. A second ring of another size is AMBIGUOUS without a prior and resolved
by a radius to 15 %. Times are of one core, the least of some repetitions: forty candidates of every kind.

The source compares Hough and three-point circles by one picture each (figs 16 and 17): no figures to set beside.
"""

import time
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from dockair.nav.identify.ring import METHODS, Identification, IdentificationStatus, identify
from dockair.scenarios.reproduce.image.identification_scenes import CROWDS, Scene
from dockair.scenarios.reproduce.reference import picture_name

ID = "image/identification"
TITLE = "rings named among clutter: found, ambiguous, wrong by LEDs seen and clutter; Hough and three-point circles"
VISIBLE = (8, 7, 6, 5, 4)
CLUTTER = (0, 5, 10, 20, 30, 40)
PAIR_CASES, CROWD_CASES, REPETITIONS = 300, 12, 5
_SOURCE = "[Yoon 2018, II.3, figs 16 and 17]"
_SEED = 2026
_SIZE_IN, _DPI = (12.0, 14.0), 100
_OUTCOMES = ("found", "fewer", "ambiguous", "not_found", "wrong")


@dataclass(frozen=True, slots=True, kw_only=True)
class Setting:
    """What is known, and where clutter is."""

    method: str = METHODS[0]
    cases: int  #: of each cell
    near_radii: float | None = None  #: None: clutter over the frame
    predicted: bool = False
    brightness: bool = False

    def identify(self, scene: Scene) -> Identification:
        """What is made of a scene."""
        return identify(
            scene.points, self.method,
            brightness=scene.flux if self.brightness else None,
            expected_led_px=scene.predicted_px if self.predicted else None,
            expected_sigma_px=scene.sigma_px if self.predicted else None,
        )  # fmt: skip


TABLES = {
    "three points": Setting(cases=670),  # 20 100 in all
    "Hough": Setting(method="circle_hough", cases=200),
    "predicted": Setting(predicted=True, cases=200),
    "crowded": Setting(near_radii=1.5, cases=200),
    "crowded, with brightness": Setting(near_radii=1.5, brightness=True, cases=200),
}
Cells = dict[tuple[int, int], dict[str, float]]


def outcome(scene: Scene, result: Identification) -> str:
    """One of found, fewer, ambiguous, not_found, wrong."""
    if result.status is not IdentificationStatus.FOUND:
        return result.status.name.lower()
    true = scene.numbers[result.members]
    shift = (true - result.led_numbers) % len(scene.led_px)
    if (true < 0).any() or (shift != (0 if result.absolute else shift[0])).any():
        return "wrong"
    return "found" if len(true) >= scene.visible - 1 else "fewer"


def reproduce(out: Path | None) -> dict[str, Any]:
    """Count outcomes and take times; the tables' picture in `out`."""
    tables = {name: table(setting) for name, setting in TABLES.items()}
    speeds = {name: speed(name) for name in CROWDS}
    rows = [{"case": name, "ours": pooled(cells), "reference": {}} for name, cells in tables.items()]
    for name, cells in tables.items():
        for (visible, clutter), ours in cells.items():
            rows.append({"case": f"{name}: {visible} LEDs, {clutter} others", "ours": ours, "reference": {}})
    rows += [{"case": f"second ring, {name}", "ours": ours, "reference": {}} for name, ours in second_ring().items()]
    rows += [{"case": f"time: {name}", "ours": ours, "reference": {}} for name, ours in speeds.items()]
    if out is not None:
        _draw(tables, speeds, out / picture_name(ID))
    return {"id": ID, "source": _SOURCE, "rows": rows}


def table(setting: Setting, seed: int = _SEED) -> Cells:
    """Percentages by visible LEDs and clutter."""
    return {(visible, clutter): cell(setting, visible, clutter, seed) for visible in VISIBLE for clutter in CLUTTER}


def cell(setting: Setting, visible: int, clutter: int, seed: int = _SEED) -> dict[str, float]:
    """Percentages of outcomes; the same scenes whatever is known of them."""
    rng = np.random.default_rng([seed, visible, clutter, setting.near_radii is not None])
    scenes = (Scene(rng, visible, clutter, setting.near_radii) for _ in range(setting.cases))
    return _percentages([outcome(scene, setting.identify(scene)) for scene in scenes])


def _percentages(outcomes: list[str]) -> dict[str, float]:
    shares = {f"{one}_percent": 100.0 * outcomes.count(one) / len(outcomes) for one in _OUTCOMES}
    return {"cases": len(outcomes), **shares}


def pooled(cells: Cells) -> dict[str, float]:
    """Least found with five LEDs or more and up to twenty others, and wrong answers of all cells and the worst one."""
    wrong = [ours["wrong_percent"] for ours in cells.values()]
    found = [ours["found_percent"] for (visible, clutter), ours in cells.items() if visible >= 5 and clutter <= 20]
    return {
        "cases": sum(ours["cases"] for ours in cells.values()),
        "least_found_percent": min(found),
        "mean_found_percent": float(np.mean(found)),
        "wrong_percent": float(np.mean(wrong)),
        "worst_cell_wrong_percent": max(wrong),
    }


def second_ring(cases: int = PAIR_CASES, seed: int = _SEED) -> dict[str, dict[str, float]]:
    """A true ring and one 1.36 to 2 times larger or smaller beside it: without prior, and with a radius to 15 %."""
    rng = np.random.default_rng([seed, 2])
    pairs: list[tuple[Scene, float]] = []
    while len(pairs) < cases:
        scene, other = Scene(rng), Scene(rng)
        ratio = max(scene.radius_px / other.radius_px, other.radius_px / scene.radius_px)
        apart = np.hypot(*(scene.centre_px - other.centre_px)) > 1.2 * (scene.radius_px + other.radius_px)
        if apart and 1.36 < ratio < 2.0:
            scene.points = np.vstack([scene.points, other.points])
            scene.numbers = np.concatenate([scene.numbers, np.full(len(other.points), -1)])
            pairs.append((scene, scene.radius_px / rng.uniform(0.85, 1.15)))
    result = {}
    for method in METHODS:
        alone = [outcome(scene, identify(scene.points, method)) for scene, _ in pairs]
        told = [outcome(scene, identify(scene.points, method, expected_radius_px=guess)) for scene, guess in pairs]
        result[f"{method}, no prior"], result[f"{method}, radius to 15 %"] = _percentages(alone), _percentages(told)
    return result


def speed(crowd: str, cases: int = CROWD_CASES, repetitions: int = REPETITIONS) -> dict[str, float]:
    """Milliseconds of both methods, no prior: median and worst case, each case's least of some repetitions."""
    times = {}
    for method in METHODS:
        rng = np.random.default_rng([_SEED, list(CROWDS).index(crowd)])
        least = [min(_seconds(points, method) for _ in range(repetitions)) for points in _crowds(crowd, cases, rng)]
        times[f"{method}_median_ms"], times[f"{method}_worst_ms"] = 1e3 * float(np.median(least)), 1e3 * max(least)
    return {"cases": cases, **times}


def _crowds(name: str, cases: int, rng: np.random.Generator) -> list[Any]:
    return [CROWDS[name](rng) for _ in range(cases)]


def _seconds(points: Any, method: str) -> float:
    start = time.thread_time()  # the processor's: a busy machine does not count
    identify(points, method)
    return time.thread_time() - start


def _draw(tables: dict[str, Cells], speeds: dict[str, dict[str, float]], path: Path) -> None:
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=_SIZE_IN, dpi=_DPI, layout="constrained")
    FigureCanvasAgg(figure)
    upper, lower = figure.subfigures(2, 1, squeeze=False, height_ratios=(len(tables), 1.4))[:, 0]
    shown = ("found", "ambiguous", "wrong")
    for row, axes_row in zip(tables.items(), upper.subplots(len(tables), len(shown), sharex=True), strict=True):
        name, cells = row
        for what, axes in zip(shown, axes_row, strict=True):
            values = np.array([[cells[v, c][f"{what}_percent"] for c in CLUTTER] for v in VISIBLE])
            full = 100.0 if what != "wrong" else 1.0
            axes.imshow(values, vmin=0.0, vmax=full, cmap="Reds" if what == "wrong" else "Blues", aspect="auto")
            for (i, j), value in np.ndenumerate(values):
                colour = "white" if value > 0.6 * full else "black"
                axes.text(j, i, f"{value:.3g}", ha="center", va="center", fontsize=8, color=colour)
            axes.set_title(f"{name}: {what} [%]", fontsize=10)
            axes.set_xticks(range(len(CLUTTER)), [str(c) for c in CLUTTER])
            axes.set_yticks(range(len(VISIBLE)), [str(v) for v in VISIBLE])
        axes_row[0].set_ylabel("LEDs seen")
    for axes in axes_row:
        axes.set_xlabel("clutter")
    _draw_speeds(lower.subplots(), speeds)
    figure.savefig(path)


def _draw_speeds(axes: Any, speeds: dict[str, dict[str, float]]) -> None:
    place = np.arange(len(speeds))
    for k, (method, name) in enumerate(zip(METHODS, TABLES, strict=False)):
        y = place + 0.2 * (2 * k - 1)
        median, worst = (
            np.array([ours[f"{method}_{what}_ms"] for ours in speeds.values()]) for what in ("median", "worst")
        )
        axes.barh(y, median, height=0.35, color=f"C{k}", label=f"{name}, median")
        axes.plot(worst, y, "|", color=f"C{k}", markersize=10, label=f"{name}, worst")
    axes.set_yticks(place, list(speeds))
    axes.invert_yaxis()
    axes.set(xlabel="ms", title="time of forty candidates, nothing known")
    axes.grid(axis="x", alpha=0.3)
    axes.legend(fontsize=8, loc="lower right")
