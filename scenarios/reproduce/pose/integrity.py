"""One wrong LED: how often it is named, how often a good frame is blamed, and whether the protection levels hold.

Frames of a ring of 0.5 m at 2-30 m, tilted by up to 20 degrees, LEDs 0.1 px noisy, no prior. One LED is put off by a
fault of three kinds: any size up to 50 px; sizes about the least that shows; and the worst case: the LED and the
direction in which range, lateral error or attitude suffers most for what shows in the residuals, at sizes up to twice
the least that is not overlooked. It is found from differences of projected pixels, not from the monitor's derivatives.

The picture is a Stanford diagram: error against protection level. Points right of the diagonal are misleading; points
below the dashed alert limit are frames that contact may be flown on.
"""

from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.stats import binom

from dockair.nav.integrity.contact import ContactLimits
from dockair.nav.integrity.fault_test import IntegritySettings, fault_test
from dockair.nav.integrity.monitor import Integrity, IntegrityStatus, check_integrity
from dockair.nav.integrity.sensitivity import worst_sigmas
from dockair.rotations import Array
from dockair.scenarios.reproduce.pose.faulted_frames import (
    FARTHEST_M,
    NEAREST_M,
    RING,
    Frame,
    draw_frame,
    random_fault,
    solved,
    worst_fault,
)
from dockair.scenarios.reproduce.reference import picture_name

ID = "pose/integrity"
TITLE = "one wrong LED of eight: named, left out, and the protection levels' coverage"
_SOURCE = "closed forms: chi-square false alarms, the set probability of missed detection"
_RANGES_M = (3.0, 5.0, 10.0, 20.0, 30.0)
_COUNTS = (8, 7, 6, 5)
_NAMED_FAULTS_PX = (5.0, 50.0)
_SMALL_FAULT_PX = 2.0
_RATES = (1e-2, 1e-3)
_BAND = 1e-3  # probability of lying outside the binomial band by luck
_SEED = 55
_SIZE_IN, _DPI = (14.0, 5.2), 110
_LARGE, _SMALL, _WORST = "any size to 50 px", "small, to 2 px", "worst LED and direction"
_KINDS = {_LARGE: 0.3, _SMALL: 0.4, _WORST: 0.3}  # shares of the trials


@dataclass(frozen=True, slots=True, kw_only=True)
class Effort:
    """Number of trials."""

    coverage: int = 100_000  #: faulted frames, all kinds together
    named: int = 1000  #: a range and a number of LEDs
    good: int = 6000  #: frames without a fault, a range


def reproduce(out: Path | None) -> dict[str, Any]:
    """Run all trials."""
    return run(Effort(), out)


def run(effort: Effort, out: Path | None) -> dict[str, Any]:
    """Return the rows of as many trials as asked; Stanford diagrams in `out`."""
    rng = np.random.default_rng(_SEED)
    named = [_row_of_names(rng, effort.named, range_m, count) for count in _COUNTS for range_m in _RANGES_M]
    good = [row for range_m in _RANGES_M for row in _rows_of_alarms(rng, effort.good, range_m)]
    kinds = {kind: _coverage(rng, kind, round(share * effort.coverage)) for kind, share in _KINDS.items()}
    rows = [*named, _row_of_two(rng, effort.named), *good, *_rows_of_coverage(kinds)]
    if out is not None:
        _draw(np.vstack(list(kinds.values())), out / picture_name(ID))
    return {"id": ID, "source": _SOURCE, "rows": rows}


def _check(frame: Frame, pixels: Array) -> Integrity:
    return check_integrity(solved(frame, pixels))


def _row_of_names(rng: np.random.Generator, trials: int, range_m: float, count: int) -> dict[str, Any]:
    outcome = {"named_percent": 0, "another_named_percent": 0, "inconsistent_percent": 0, "not_seen_percent": 0}
    for _ in range(trials):
        frame = draw_frame(rng, range_m, count)
        led, fault = random_fault(rng, frame, *_NAMED_FAULTS_PX)
        pixels = frame.pixels.copy()
        pixels[led] += fault
        result = _check(frame, pixels)
        if result.status is IntegrityStatus.EXCLUDED:
            outcome["named_percent" if result.led == led else "another_named_percent"] += 1
        else:
            seen = result.status is not IntegrityStatus.CONSISTENT
            outcome["inconsistent_percent" if seen else "not_seen_percent"] += 1
    ours = {key: 100.0 * value / trials for key, value in outcome.items()}
    return {"case": f"fault of 5-50 px, {count} LEDs, {range_m:g} m", "ours": ours, "reference": {}}


def _rows_of_alarms(rng: np.random.Generator, trials: int, range_m: float) -> list[dict[str, Any]]:
    frames = (draw_frame(rng, range_m) for _ in range(trials))
    chi2 = np.array([_check(frame, frame.pixels).chi2 for frame in frames])
    rows = []
    for rate in _RATES:
        test = fault_test(2 * len(RING) - 6, IntegritySettings(false_alarm=rate))
        low, high = binom.ppf([0.5 * _BAND, 1.0 - 0.5 * _BAND], trials, rate)
        ours = {
            "alarms_percent": 100.0 * float((chi2 > test.threshold).mean()),
            "band_low_percent": float(100.0 * low / trials),
            "band_high_percent": float(100.0 * high / trials),
        }
        case = f"no fault, 8 LEDs, {range_m:g} m, false alarms set to {100.0 * rate:g} %"
        rows.append({"case": case, "ours": ours, "reference": {"alarms_percent": 100.0 * rate}})
    return rows


def _row_of_two(rng: np.random.Generator, trials: int) -> dict[str, Any]:
    """What the monitor does not promise: two wrong LEDs."""
    said = {"inconsistent_percent": 0, "one_left_out_percent": 0, "not_seen_percent": 0, "misleading_percent": 0}
    for _ in range(trials):
        frame = draw_frame(rng)
        pixels = frame.pixels.copy()
        for led in rng.permutation(len(RING))[:2]:
            pixels[led] += random_fault(rng, frame, *_NAMED_FAULTS_PX)[1]
        result = _check(frame, pixels)
        off = np.abs(result.pose.p_CD - frame.p_CD)
        if result.status is IntegrityStatus.EXCLUDED:
            said["one_left_out_percent"] += 1
        else:
            seen = result.status is not IntegrityStatus.CONSISTENT
            said["inconsistent_percent" if seen else "not_seen_percent"] += 1
        said["misleading_percent"] += bool(off[0] > result.levels.range_m or off[1:].max() > result.levels.lateral_m)
    ours = {key: 100.0 * count / trials for key, count in said.items()}
    return {"case": "two faults of 5-50 px, 8 LEDs, 2-30 m", "ours": ours, "reference": {}}


#: Columns of a result: outcome, range [m]; error, level and k sigma of range [m] and across [m]; error and level [rad].
_COLUMNS, _RANGE_AT, _LATERAL_AT, _ATTITUDE_AT = 10, 2, 5, 8
_NOT_SEEN, _RIGHT, _ANOTHER, _WITHOUT_LEVELS = range(4)  # outcomes


def _coverage(rng: np.random.Generator, kind: str, trials: int) -> Array:
    """(trials, _COLUMNS)."""
    points, least = np.empty((trials, _COLUMNS)), fault_test(2 * len(RING) - 6, IntegritySettings()).least_fault
    for k in range(trials):
        frame = draw_frame(rng)
        if kind == _WORST:
            led, unit = worst_fault(frame, ([3], [4, 5], [0, 1, 2])[k % 3])
            fault = unit * rng.uniform(0.0, 2.0 * least)
        else:
            led, fault = random_fault(rng, frame, 0.0, _SMALL_FAULT_PX if kind == _SMALL else _NAMED_FAULTS_PX[1])
        pixels = frame.pixels.copy()
        pixels[led] += fault
        points[k] = _point(frame, led, _check(frame, pixels))
    return points


def _point(frame: Frame, led: int, result: Integrity) -> list[float]:
    distance = float(frame.p_CD[0])
    if result.status not in (IntegrityStatus.CONSISTENT, IntegrityStatus.EXCLUDED):
        return [_WITHOUT_LEVELS, distance, *[np.nan] * (_COLUMNS - 2)]
    outcome = _NOT_SEEN if result.led is None else (_RIGHT if result.led == led else _ANOTHER)
    off, levels = result.pose.p_CD - frame.p_CD, result.levels
    k_sigma = np.array(fault_test(1, IntegritySettings()).error_sigmas) * worst_sigmas(result.pose.covariance)
    cosine = 0.5 * (np.trace(result.pose.R_CD @ frame.R_CD.T) - 1.0)
    turn, across = float(np.arccos(np.clip(cosine, -1.0, 1.0))), float(np.hypot(off[1], off[2]))
    return [
        *(outcome, distance),
        *(abs(float(off[0])), levels.range_m, float(k_sigma[0])),
        *(across, levels.lateral_m, float(k_sigma[1])),
        *(turn, levels.attitude_rad),
    ]


def _rows_of_coverage(kinds: dict[str, Array]) -> list[dict[str, Any]]:
    """One row a kind of fault, then all together by outcome, then by range."""
    everything = np.vstack(list(kinds.values()))
    outcome, distance = everything[:, 0], everything[:, 1]
    groups = {"all": everything} | kinds
    groups |= {
        "not seen": everything[outcome == _NOT_SEEN],
        "right LED left out": everything[outcome == _RIGHT],
        "another LED left out": everything[outcome == _ANOTHER],
    }
    for low, high in pairwise((NEAREST_M, *_RANGES_M)):
        groups[f"{low:g}-{high:g} m"] = everything[(distance >= low) & (distance < high)]
    promised = 100.0 * (1.0 - IntegritySettings().missed_detection)
    promise = {"range_covered_percent": promised, "lateral_covered_percent": promised}
    return [
        {"case": f"coverage, {name}", "ours": _figures(points), "reference": promise}
        for name, points in groups.items()
        if len(points)
    ]


def _figures(points: Array) -> dict[str, float]:
    """A frame without levels promises nothing; it counts as such alone."""
    told = points[points[:, 0] != _WITHOUT_LEVELS]
    ours: dict[str, float] = {"trials": len(points), "without_levels": len(points) - len(told)}
    for i, name in ((_RANGE_AT, "range"), (_LATERAL_AT, "lateral")):
        error, level, k_sigma = told[:, i : i + 3].T
        ours |= {
            f"{name}_covered_percent": 100.0 * float((error <= level).mean()),
            f"{name}_exceeded": int((error > level).sum()),
            f"{name}_largest_error_over_level": float((error / level).max()),
            f"{name}_median_level_over_k_sigma": float(np.median(level / k_sigma)),
            f"{name}_median_level_m": float(np.median(level)),
        }
    error, level = told[:, _ATTITUDE_AT:].T
    ours["attitude_levels_percent"] = 100.0 * float(np.isfinite(level).mean())
    ours["attitude_exceeded"] = int((error > level).sum())
    return ours


def _draw(points: Array, path: Path) -> None:
    from matplotlib.figure import Figure

    figure, limits = Figure(figsize=_SIZE_IN, dpi=_DPI, layout="constrained"), ContactLimits()
    axes = figure.subplots(1, 3, width_ratios=(1.0, 1.0, 0.9))
    told = points[points[:, 0] != _WITHOUT_LEVELS]
    _draw_stanford(axes[0], told[:, _RANGE_AT:][:, :2], "range error [m]", limits.range_m)
    _draw_stanford(axes[1], told[:, _LATERAL_AT:][:, :2], "lateral error [m]", limits.lateral_m)
    _draw_tightness(axes[2], told, limits.range_m)
    figure.savefig(path)


def _draw_stanford(axes: Any, points: Array, words: str, limit_m: float) -> None:
    error, level = np.maximum(points[:, 0], 1e-6), points[:, 1]
    low, high = 1e-5, 2.0 * float(level.max())
    edges: NDArray[Any] = np.geomspace(low, high, 90)
    counts, _, _ = np.histogram2d(np.maximum(error, low), level, bins=(edges, edges))
    image = axes.pcolormesh(edges, edges, np.where(counts > 0, counts, np.nan).T, norm="log", cmap="viridis")
    axes.figure.colorbar(image, ax=axes, label="frames")
    axes.plot([low, high], [low, high], color="tab:red", lw=1.2)
    axes.fill_between([low, high], [low, high], low, color="tab:red", alpha=0.08, lw=0.0)
    axes.axhline(limit_m, color="black", ls="--", lw=1.0, label=f"alert limit {limit_m:g} m")
    exceeded = int((points[:, 0] > level).sum())
    axes.set(
        xscale="log", yscale="log", xlim=(low, high), ylim=(low, high), xlabel=words, ylabel="protection level [m]"
    )
    axes.set_title(f"{len(points)} faulted frames, {exceeded} beyond their level", fontsize=10)
    axes.legend(frameon=False, loc="upper left", fontsize=8)


def _draw_tightness(axes: Any, points: Array, limit_m: float) -> None:
    """Range level and error by range, for frames whose fault was not seen and for those with an LED left out."""
    edges = np.arange(NEAREST_M, FARTHEST_M + 1.0, 2.0)
    groups = {"not seen": (points[points[:, 0] == _NOT_SEEN], "tab:blue")}
    groups["LED left out"] = (points[points[:, 0] != _NOT_SEEN], "tab:orange")
    for name, (of, colour) in groups.items():
        bins = [of[(of[:, 1] >= low) & (of[:, 1] < high)][:, _RANGE_AT:] for low, high in pairwise(edges)]
        middle = [0.5 * (low + high) for (low, high), some in zip(pairwise(edges), bins, strict=True) if len(some)]
        some = [one for one in bins if len(one)]
        axes.plot(middle, [np.median(one[:, 1]) for one in some], color=colour, label=f"{name}: level, median")
        worst = [np.quantile(one[:, 0], 0.999) for one in some]
        axes.plot(middle, worst, color=colour, ls=":", marker=".", label=f"{name}: error, 99.9 %")
    axes.axhline(limit_m, color="black", ls="--", lw=1.0)
    axes.set(xlabel="range [m]", ylabel="range error, level [m]", yscale="log", title="how tight the levels are")
    axes.legend(frameon=False, loc="lower right", fontsize=8)
