"""All of the source's descents (62)-(65) from bad starts: where they end, and how many do not arrive.

Ring at 2 to 30 m, up to a tenth of it off the axis each way, each angle within 20 degrees, 0.1 px of noise. A start is
turned from the truth about any axis by up to 60 degrees, and its range is wrong by up to half, either way. A flat ring
has two minima: arriving at either is what a descent can do; the choice between them is another matter. An end counts as
a minimum's when it is within 0.3 sigma of it.

The source leaves step size, damping and stop rule open; what is used stands in `nav.pose`. Gradient, Levenberg and
Levenberg-Marquardt as printed step in the source's own coordinates, as GLSDC does. What flies is (65) in local
coordinates with a common entry for the three angles; the row before it shows what these two changes are worth.
"""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from dockair.calibration import Camera, LedRing
from dockair.nav.pose.descent import Descent, DescentSettings, descend
from dockair.nav.pose.difference import pose_difference
from dockair.nav.pose.estimate import PoseEstimate, solve_pose
from dockair.nav.pose.glsdc import GLSDC
from dockair.nav.pose.gradient import GRADIENT
from dockair.nav.pose.levenberg import LEVENBERG
from dockair.nav.pose.levenberg_marquardt import AS_PRINTED, LEVENBERG_MARQUARDT
from dockair.rotations import Array, exp, matrix_from_yaw_pitch_roll
from dockair.scenarios.reproduce.reference import picture_name

ID = "pose/divergence"
TITLE = "descents (62)-(65) from starts up to 60° and half the range off: where they end"
_SOURCE = "[Yoon 2018, eqs 62-65]"
METHODS: dict[str, DescentSettings] = {
    "GLSDC (62)": GLSDC,
    "gradient (63)": GRADIENT,
    "Levenberg (64)": LEVENBERG,
    "Levenberg-Marquardt (65)": AS_PRINTED,
    "Levenberg-Marquardt, flies": LEVENBERG_MARQUARDT,
}
_STARTS = 10_000
_SLOW, _STARTS_OF_SLOW = "gradient (63)", 500  # it takes milliseconds
_NEAREST_M, _FARTHEST_M, _OFF_AXIS, _LARGEST_ANGLE_RAD = 2.0, 30.0, 0.1, np.deg2rad(20.0)
_SIGMA_PX = 0.1
_TURNED_DEG, _RANGE_OFF = 60.0, 0.5
BINS_DEG = ((0.0, 15.0), (15.0, 30.0), (30.0, 45.0), (45.0, 60.0))
ENDS = ("right", "mirror", "elsewhere", "not arrived")
_AT_CHI2 = 0.1  # 0.3 sigma
_SEED = 53
_SIZE_IN, _DPI = (11.0, 4.4), 110


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Start:
    """A frame, its minima, and where a descent begins."""

    minima: PoseEstimate  #: the one that the truth leads to, and its alternative
    R_CD: Array  #: (3, 3)
    p_CD: Array  #: (3,) [m]
    turned_deg: float


def starts(count: int, rng: np.random.Generator) -> list[Start]:
    """Draw frames and starts."""
    camera, points_D, drawn = Camera(), LedRing().positions_D, []
    for _ in range(count):
        R = matrix_from_yaw_pitch_roll(*rng.uniform(-_LARGEST_ANGLE_RAD, _LARGEST_ANGLE_RAD, 3))
        p = rng.uniform(_NEAREST_M, _FARTHEST_M) * np.array([1.0, *rng.uniform(-_OFF_AXIS, _OFF_AXIS, 2)])
        pixels = camera.pixels_from_points(points_D @ R.T + p)
        pixels += _SIGMA_PX * rng.standard_normal(pixels.shape)
        axis, turned_deg = rng.standard_normal(3), rng.uniform(0.0, _TURNED_DEG)
        drawn.append(
            Start(
                minima=solve_pose(pixels, points_D, camera, sigma_px=_SIGMA_PX, initial=(R, p)),
                R_CD=exp(np.deg2rad(turned_deg) * axis / np.linalg.norm(axis)) @ R,
                p_CD=p * rng.uniform(1.0 - _RANGE_OFF, 1.0 + _RANGE_OFF),
                turned_deg=turned_deg,
            )
        )
    return drawn


def end_of(start: Start, settings: DescentSettings) -> tuple[int, int]:
    """Where a descent ends, as the index into ENDS, and its iterations."""
    sight = start.minima.measurement
    assert sight is not None
    end = descend(sight, start.R_CD, start.p_CD, settings)
    if not end.converged:
        return ENDS.index("not arrived"), end.iterations
    if _is_at(end, start.minima):
        return ENDS.index("right"), end.iterations
    other = start.minima.alternative
    return ENDS.index("mirror" if other is not None and _is_at(end, other) else "elsewhere"), end.iterations


def _is_at(end: Descent, minimum: PoseEstimate) -> bool:
    d = pose_difference(end.R_CD, end.p_CD, minimum.R_CD, minimum.p_CD)
    return bool(min(d @ end.information @ d, d @ np.linalg.solve(minimum.covariance, d)) < _AT_CHI2)


def reproduce(out: Path | None, count: int = _STARTS) -> dict[str, Any]:
    """Run every descent from every start; shares by start's angle in `out`."""
    drawn, rows = starts(count, np.random.default_rng(_SEED)), []
    shares: dict[str, list[Any]] = {}
    turned = np.array([start.turned_deg for start in drawn])
    for name, settings in METHODS.items():
        n = min(count, _STARTS_OF_SLOW) if name == _SLOW else count
        ends, iterations = np.array([end_of(start, settings) for start in drawn[:n]]).T
        rows.append({"case": name, "ours": _summary(ends, iterations), "reference": {}})
        shares[name] = [
            np.bincount(ends[(turned[:n] >= low) & (turned[:n] < high)], minlength=len(ENDS)) for low, high in BINS_DEG
        ]
        for (low, high), counts in zip(BINS_DEG, shares[name], strict=True):
            ours: dict[str, float] = {"starts": int(counts.sum())}
            for end, c in zip(ENDS, counts, strict=True):
                ours[f"{end.replace(' ', '_')}_percent"] = float(100.0 * c / max(counts.sum(), 1))
            rows.append({"case": f"{name}, {low:g}-{high:g} deg", "ours": ours, "reference": {}})
    if out is not None:
        _draw(shares, out / picture_name(ID))
    return {"id": ID, "source": _SOURCE, "rows": rows}


def _summary(ends: Array, iterations: Array) -> dict[str, float]:
    counts = np.bincount(ends, minlength=len(ENDS))
    ours: dict[str, float] = {"starts": len(ends)}
    ours |= {end.replace(" ", "_"): int(c) for end, c in zip(ENDS, counts, strict=True)}
    ours["right_or_mirror_percent"] = float(100.0 * (counts[0] + counts[1]) / len(ends))
    ours["median_iterations"] = float(np.median(iterations))
    ours["iterations_99_percent"] = float(np.quantile(iterations, 0.99))
    return ours


def _draw(shares: dict[str, list[Any]], path: Path) -> None:
    from matplotlib.figure import Figure

    figure = Figure(figsize=_SIZE_IN, dpi=_DPI, layout="constrained")
    panels = figure.subplots(1, len(shares), sharey=True)
    for axes, (name, counts) in zip(panels, shares.items(), strict=True):
        percent = np.array([100.0 * c / c.sum() for c in counts])
        below = np.zeros(len(BINS_DEG))
        for k, (end, colour) in enumerate(zip(ENDS, ("tab:green", "tab:olive", "tab:orange", "tab:red"), strict=True)):
            axes.bar(range(len(BINS_DEG)), percent[:, k], bottom=below, color=colour, label=end)
            below += percent[:, k]
        axes.set_xticks(range(len(BINS_DEG)), [f"{low:g}-{high:g}°" for low, high in BINS_DEG], fontsize=8)
        axes.set_title(name, fontsize=9)
        axes.set_xlabel("start turned by")
    panels[0].set_ylabel("starts [%]")
    handles, labels = panels[0].get_legend_handles_labels()
    figure.legend(handles, labels, frameon=False, fontsize=8, loc="outside upper center", ncols=len(ENDS))
    figure.savefig(path)
