"""What `dockair design-ring` shows: the ranking and the trials as tables, the picture."""

from pathlib import Path
from typing import Any

import numpy as np
from rich.console import Console
from rich.table import Table

from dockair.nav.dop.dilution import DopStatus
from dockair.rotations import Array
from dockair.scenarios.design_ring.ranking import Corridor, Ranking, RingDesign, RingMap, bound_at
from dockair.scenarios.design_ring.trials import Trials, try_ring

PICTURE = "design-ring.png"
_HEADINGS = ("", "rim\nLEDs", "inner\nLEDs", "at x\nm", "wide\nm", "\nspacing", "\ngain") + (
    "range\nmm",
    "side\nmm",
    "att.\ndeg",
    "camera\nmm",
    "\nmirror",
    "\nblind",
)
_LEGEND = """* the default ring; side: across the line of sight; att.: attitude about all axes;
camera: its place seen from the drogue, sideways; mirror: nodes at which one frame can be
taken for its mirror image; blind: nodes at which too few LEDs are on the sensor"""
_TICKS_M = (0.5, 1.0, 2.0, 5.0, 10.0, 20.0, 50.0, 100.0, 200.0, 500.0)
_SEED = 1
_SIZE_IN, _DPI = (13.0, 7.6), 110
_LINES = (  # quantity, units a metre or a radian, in words
    ("range_m", 1e3, "range [mm]"),
    ("lateral_m", 1e3, "lateral [mm]"),
    ("attitude_rad", 180.0 / np.pi, "attitude [deg]"),
)
_COLOURS = ("black", "tab:blue", "tab:orange")


def show_ranking(ranking: Ranking, top: int) -> None:
    """Print the first rings and the default one."""
    corridor, console = ranking.corridor, Console(highlight=False, emoji=False)
    low, high = corridor.ranges_m[[0, -1]]
    console.print(
        f"{len(ranking.maps)} rings, {low:g} to {high:g} m, tilt up to {np.rad2deg(corridor.tilts_rad[-1]):g} deg, "
        f"{corridor.sigma_px:g} px; gain in sigma over the default ring, by {ranking.by};\n"
        f"then the bounds of the frontal drogue at {ranking.at_range_m:.3g} m",
        soft_wrap=True,
    )
    table = Table(box=None, padding=(0, 1, 0, 0))
    for heading in _HEADINGS:
        table.add_column(heading, justify="left" if "spacing" in heading else "right", no_wrap=True)
    for k, ring in enumerate(ranking.maps):
        if k < top or ring is ranking.default:
            mark = "*" if ring is ranking.default else ""
            table.add_row(f"{k + 1}{mark}", *_cells(ranking, k))
    console.print(table)
    console.print(_LEGEND, style="dim", soft_wrap=True)


def _cells(ranking: Ranking, k: int) -> list[str]:
    ring = ranking.maps[k]
    design = ring.design
    at = {name: np.nan if value is None else value for name, value in ranking.frontal(ring).items()}
    return [
        str(design.rim),
        str(design.inner or ""),
        f"{design.depth_m:+g}" if design.inner else "",
        f"{design.diameter_m:g}",
        design.spacing,
        f"{ranking.gains[k]:.2f}",
        f"{1e3 * at['range_m']:.2f}",
        f"{1e3 * at['lateral_m']:.3f}",
        f"{np.rad2deg(at['attitude_rad']):.3f}",
        f"{1e3 * at['camera_lateral_m']:.1f}",
        f"{ring.ambiguous:.0%}",
        str(ring.blind),
    ]


def trials_of(ranking: Ranking, count: int) -> list[Trials]:
    """Return noisy solves of the frontal drogue for the rings of the picture, near, at the table's range and far."""
    if count == 0:
        return []
    rng = np.random.default_rng(_SEED)
    low, high = ranking.corridor.ranges_m[[0, -1]]
    return [
        try_ring(ring.design, ranking.corridor, float(range_m), count, rng)
        for ring in _shown(ranking)
        for range_m in (low, ranking.at_range_m, high)
        if bound_at(ring.design, ranking.corridor, float(range_m)).status is DopStatus.SOLVED
    ]


def show_trials(trials: list[Trials]) -> None:
    """Print what becomes of the bound; nothing when nothing was tried."""
    if not trials:
        return
    console = Console(highlight=False, emoji=False)
    console.print(
        f"\n{trials[0].trials} noisy frames each, frontal, solved from the true pose: bias, and RMSE over bound"
    )
    table = Table(box=None, padding=(0, 1, 0, 0))
    for heading in ("ring", "at m", "bias mm", "range", "side", "att."):
        table.add_column(heading, justify="left" if heading == "ring" else "right")
    for node in trials:
        ratios = (node.range_efficiency, node.lateral_efficiency, node.attitude_efficiency)
        bias = f"{1e3 * node.range_bias_m:.2f}"
        table.add_row(node.design.label, f"{node.range_m:.3g}", bias, *(f"{ratio:.3f}" for ratio in ratios))
    console.print(table)


def _shown(ranking: Ranking) -> list[RingMap]:
    """The default ring, the best flat one and the best."""
    flat = next(ring for ring in ranking.maps if ring.design.inner == 0)
    return list({id(ring): ring for ring in (ranking.default, flat, ranking.maps[0])}.values())


def draw(ranking: Ranking, folder: Path) -> Path:
    """Draw the default ring, the best flat one and the best; return where."""
    from matplotlib.figure import Figure

    best, shown = ranking.maps[0], _shown(ranking)
    figure = Figure(figsize=_SIZE_IN, dpi=_DPI, layout="constrained")
    panels = figure.subplots(2, 3)
    for axes, line in zip(panels[0], _LINES, strict=True):
        _draw_lines(axes, ranking.corridor, shown, *line)
    panels[0, 0].legend(frameon=False, fontsize=8)
    scale = _colours([ranking.default, best])
    for axes, ring, title in zip(panels[1], (ranking.default, best), ("default", "best"), strict=False):
        shade = _draw_map(axes, ranking.corridor, ring, scale)
        axes.set_title(f"sigma of attitude [deg], {title}: {ring.design.label}", fontsize=9)
    figure.colorbar(shade, ax=panels[1, :2].tolist(), shrink=0.9)
    _draw_ring(panels[1, 2], best.design)
    figure.suptitle(f"bound at {ranking.corridor.sigma_px:g} px; drogue seen from the camera", fontsize=10)
    figure.savefig(folder / PICTURE)
    return folder / PICTURE


def _draw_lines(axes: Any, corridor: Corridor, rings: list[RingMap], name: str, scale: float, what: str) -> None:
    for ring, colour in zip(rings, _COLOURS, strict=False):
        sigma = scale * np.where(np.isfinite(ring.sigma[name]), ring.sigma[name], np.nan)
        axes.plot(corridor.ranges_m, sigma[:, 0], color=colour, label=ring.design.label)
        axes.plot(corridor.ranges_m, sigma[:, -1], "--", color=colour)
    tilt = np.rad2deg(corridor.tilts_rad[-1])
    axes.set(yscale="log")
    _range_axis(axes, corridor)
    axes.set_title(f"sigma of {what}; frontal, dashed: {tilt:g} deg", fontsize=9)
    axes.grid(alpha=0.3)


def _colours(rings: list[RingMap]) -> Any:
    from matplotlib.colors import LogNorm

    values = np.rad2deg(np.concatenate([ring.sigma["attitude_rad"].ravel() for ring in rings]))
    values = values[np.isfinite(values)]
    return LogNorm(values.min(), values.max()) if values.size else LogNorm(0.1, 1.0)


def _draw_map(axes: Any, corridor: Corridor, ring: RingMap, scale: Any) -> Any:
    ranges, tilts = _edges(np.log(corridor.ranges_m)), _edges(np.rad2deg(corridor.tilts_rad))
    sigma = np.rad2deg(np.where(np.isfinite(ring.sigma["attitude_rad"]), ring.sigma["attitude_rad"], np.nan))
    shade = axes.pcolormesh(np.exp(ranges), tilts, sigma.T, norm=scale, cmap="viridis")
    axes.set(ylabel="tilt [deg]")
    _range_axis(axes, corridor)
    return shade


def _range_axis(axes: Any, corridor: Corridor) -> None:
    from matplotlib.ticker import LogLocator

    low, high = corridor.ranges_m[[0, -1]]
    axes.set(xlabel="range [m]", xscale="log")
    axes.set_xticks([tick for tick in _TICKS_M if low <= tick <= high], minor=False)
    axes.set_xticks([], minor=True)
    axes.xaxis.set_major_formatter("{x:g}")
    if axes.get_yscale() == "log":
        axes.yaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0), numticks=20))
        axes.yaxis.set_major_formatter("{x:g}")
        axes.yaxis.set_minor_formatter("")


def _edges(values: Array) -> Array:
    """(n + 1,) edges of cells around evenly spaced values."""
    half = 0.5 * (values[1] - values[0]) if len(values) > 1 else 0.5
    return np.append(values - half, values[-1] + half)


def _draw_ring(axes: Any, design: RingDesign) -> None:
    points = design.points_D
    shown = axes.scatter(-points[:, 1], points[:, 2], c=points[:, 0], cmap="plasma", s=60.0, ec="black")
    axes.figure.colorbar(shown, ax=axes, label="x [m]", shrink=0.8)
    axes.set(xlabel="right [m]", ylabel="up [m]", aspect="equal")
    axes.set_title(f"best, seen from behind: {design.label}", fontsize=9)
    axes.margins(0.15)
