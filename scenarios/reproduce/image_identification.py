"""Rings of eight LEDs among clutter, named without a prior: found, ambiguous and wrong by LEDs seen and clutter.

Random drogues at 2 to 30 m anywhere in the field of view, axis up to 30 degrees off the camera's, any roll, 0.1 px of
noise; clutter uniform over the frame, or within 1.5 radii of the ring's centre. *Found*: FOUND with all visible LEDs
but at most one, rightly named up to the ring's symmetry, and no clutter. *Wrong*: FOUND with clutter or a wrong name
among the members. A second ring of another size is AMBIGUOUS without a prior and resolved by an expected radius. The
source compares Hough and three-point circles by one picture each (figs 16 and 17): no figures to set beside.
"""

import time
from collections.abc import Callable, Iterable
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from dockair.calibration import Camera, LedRing
from dockair.nav.identify.ring import METHODS, Identification, IdentificationStatus, identify
from dockair.rotations import Array, exp
from dockair.scenarios.reproduce.reference import picture_name

ID = "image/identification"
TITLE = "rings named among clutter: found, ambiguous, wrong by LEDs seen and clutter; Hough and three-point circles"
VISIBLE = (8, 7, 6, 5, 4)
CLUTTER = (0, 5, 10, 20, 30, 40)
CASES = 670  # a cell of the first table, 20 100 in all
NEAR_CASES, HOUGH_CASES, PAIR_CASES = 200, 60, 300
NEAR_RADII = 1.5
_SOURCE = "[Yoon 2018, II.3, figs 16 and 17]"
_RANGE_M, _TILT_RAD, _SIGMA_PX = (2.0, 30.0), np.deg2rad(30.0), 0.1
_SIZE_IN, _DPI = (11.0, 7.0), 110
_OUTCOMES = ("found", "fewer", "ambiguous", "not_found", "wrong")


class Scene:
    """One case: candidates in random order, and which LED each of them is (-1 for clutter)."""

    def __init__(
        self, rng: np.random.Generator, visible: int = 8, clutter: int = 0, near_radii: float | None = None
    ) -> None:
        camera, ring = Camera(), LedRing()
        frame = np.array([camera.width_px - 1.0, camera.height_px - 1.0])
        while True:
            range_m, self.centre_px = rng.uniform(*_RANGE_M), rng.uniform(0.0, frame)
            ray = camera.rays_from_pixels(self.centre_px[None])[0]
            axis, roll = rng.uniform(-np.pi, np.pi, 2)
            tilt = exp(rng.uniform(0.0, _TILT_RAD) * np.array([0.0, np.cos(axis), np.sin(axis)]))
            p_CL = range_m * ray / ray[0] + ring.positions_D @ (tilt @ exp(np.array([roll, 0.0, 0.0]))).T
            self.led_px: Array = camera.pixels_from_points(p_CL)
            if ((self.led_px > 0.0) & (self.led_px < frame)).all():
                break
        self.radius_px: float = camera.focal_length_px * 0.5 * ring.diameter_m / range_m
        low, high = np.zeros(2), frame
        if near_radii is not None:
            low, high = (self.centre_px + side * near_radii * self.radius_px for side in (-1.0, 1.0))
        seen = rng.permutation(ring.count)[:visible]
        noise = _SIGMA_PX * rng.standard_normal((visible, 2))
        points = np.vstack([self.led_px[seen] + noise, rng.uniform(low, high, (clutter, 2))])
        order = rng.permutation(len(points))
        self.points, self.visible = points[order], visible
        self.numbers = np.concatenate([seen, np.full(clutter, -1)])[order]


def outcome(scene: Scene, result: Identification) -> str:
    """One of found, fewer, ambiguous, not_found, wrong; names count up to the ring's symmetry."""
    if result.status is not IdentificationStatus.FOUND:
        return result.status.name.lower()
    true = scene.numbers[result.members]
    shift = (true - result.led_numbers) % len(scene.led_px)
    if (true < 0).any() or (shift != shift[0]).any():
        return "wrong"
    return "found" if len(true) >= scene.visible - 1 else "fewer"


def reproduce(out: Path | None) -> dict[str, Any]:
    """Count outcomes; the first table's picture in `out`."""
    tables = {
        "frame": table(METHODS[0], CASES),
        "near the ring": table(METHODS[0], NEAR_CASES, NEAR_RADII),
        "Hough, frame": table(METHODS[1], HOUGH_CASES),
    }
    rows = [
        {"case": f"clutter over the {name}" if name == "frame" else name, "ours": pooled(cells), "reference": {}}
        for name, cells in tables.items()
    ]
    for name, cells in tables.items():
        for (visible, clutter), ours in cells.items():
            rows.append({"case": f"{name}: {visible} LEDs, {clutter} others", "ours": ours, "reference": {}})
    rows += [{"case": f"second ring, {name}", "ours": ours, "reference": {}} for name, ours in second_ring().items()]
    if out is not None:
        _draw(tables, out / picture_name(ID))
    return {"id": ID, "source": _SOURCE, "rows": rows}


def table(method: str, cases: int, near_radii: float | None = None) -> dict[tuple[int, int], dict[str, float]]:
    """Percentages by visible LEDs and clutter."""
    return {
        (visible, clutter): cell(method, cases, visible, clutter, near_radii)
        for visible in VISIBLE
        for clutter in CLUTTER
    }


def cell(method: str, cases: int, visible: int, clutter: int, near_radii: float | None = None) -> dict[str, float]:
    """Percentages of outcomes, and milliseconds; the same cases for both methods."""
    rng = np.random.default_rng([visible, clutter, near_radii is not None])
    scenes = (Scene(rng, visible, clutter, near_radii) for _ in range(cases))
    return _counted(scenes, partial(_identify, method))


def pooled(cells: dict[tuple[int, int], dict[str, float]]) -> dict[str, float]:
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


def second_ring(cases: int = PAIR_CASES) -> dict[str, dict[str, float]]:
    """A true ring and one 1.36 to 2 times larger or smaller beside it: without prior, and with a radius to 15 %."""
    rng = np.random.default_rng(2)
    pairs: list[Scene] = []
    while len(pairs) < cases:
        scene, other = Scene(rng), Scene(rng)
        ratio = max(scene.radius_px / other.radius_px, other.radius_px / scene.radius_px)
        apart = np.hypot(*(scene.centre_px - other.centre_px)) > 1.2 * (scene.radius_px + other.radius_px)
        if apart and 1.36 < ratio < 2.0:
            scene.points = np.vstack([scene.points, other.points])
            scene.numbers = np.concatenate([scene.numbers, np.full(len(other.points), -1)])
            pairs.append(scene)
    result = {}
    for method in METHODS:
        result[f"{method}, no prior"] = _counted(pairs, partial(_identify, method))
        result[f"{method}, radius to 15 %"] = _counted(pairs, partial(_identify_with_radius, method))
    return result


def _identify(method: str, scene: Scene) -> Identification:
    return identify(scene.points, method)


def _identify_with_radius(method: str, scene: Scene) -> Identification:
    return identify(scene.points, method, expected_radius_px=_guess(scene))


def _guess(scene: Scene) -> float:
    """A radius off by up to 15 %, the same each time it is asked for."""
    return scene.radius_px / (0.85 + 0.3 * float(scene.points[0, 0] % 1.0))


def _counted(scenes: Iterable[Scene], name: Callable[[Scene], Identification]) -> dict[str, float]:
    outcomes, seconds = [], []
    for scene in scenes:
        start = time.perf_counter()
        result = name(scene)
        seconds.append(time.perf_counter() - start)
        outcomes.append(outcome(scene, result))
    ours: dict[str, float] = {"cases": len(outcomes)}
    ours |= {f"{one}_percent": 100.0 * outcomes.count(one) / len(outcomes) for one in _OUTCOMES}
    return ours | {"median_ms": 1e3 * float(np.median(seconds))}


def _draw(tables: dict[str, dict[tuple[int, int], dict[str, float]]], path: Path) -> None:
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=_SIZE_IN, dpi=_DPI, layout="constrained")
    FigureCanvasAgg(figure)
    shown = ("found", "ambiguous", "wrong")
    for row, axes_row in zip(tables.items(), figure.subplots(len(tables), len(shown)), strict=True):
        name, cells = row
        for what, axes in zip(shown, axes_row, strict=True):
            values = np.array([[cells[v, c][f"{what}_percent"] for c in CLUTTER] for v in VISIBLE])
            full = 100.0 if what != "wrong" else 1.0
            axes.imshow(values, vmin=0.0, vmax=full, cmap="Blues", aspect="auto")
            for (i, j), value in np.ndenumerate(values):
                colour = "white" if value > 0.6 * full else "black"
                axes.text(j, i, f"{value:.3g}", ha="center", va="center", fontsize=8, color=colour)
            axes.set(title=f"{name}: {what} [%]", xlabel="clutter", ylabel="LEDs seen")
            axes.set_xticks(range(len(CLUTTER)), [str(c) for c in CLUTTER])
            axes.set_yticks(range(len(VISIBLE)), [str(v) for v in VISIBLE])
    figure.savefig(path)
