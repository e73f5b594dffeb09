"""Errors of the navigation on approaches flown by it in the world, by range, from 12 m before the drogue to contact.

The ring is found, the filter believes, the guidance flies on it. Light gusts; hardware as drawn from its tolerances, by
camera and on its measurement model (LEDs' places with the camera's errors, no picture), and hardware as its sheets
say. Errors are those of the tick at which a frame has been used, so that they
hold what the latency costs. In camera axes means: of the camera as it was built, which sees the drogue; the miss vector
is what is left across the probe's line, and carries the camera's mounting.

A flight is a file, `seed_<number>.json` below the output folder: what is there is not flown again, unless other code or
another scenario flew it.
"""

import json
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import partial
from hashlib import blake2b
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.stats import chi2

from dockair.messages import NavSolution
from dockair.nav.navigator import Navigator
from dockair.nav.pose.planar import mirrored
from dockair.rotations import Array, log
from dockair.scenarios.campaign.code import Code
from dockair.scenarios.judgement.metrics import normalised_error_squared, state_error
from dockair.scenarios.loop import Flight
from dockair.scenarios.output_folder import made_folder
from dockair.scenarios.reproduce.fusion.wanted import WANTED
from dockair.scenarios.reproduce.reference import picture_name
from dockair.scenarios.scenario_hash import scenario_hash
from dockair.scenarios.schema import Scenario, load_scenario
from dockair.sim.truth import Truth

ID = "fusion/closed-loop"
TITLE = "errors of the navigation on approaches that it flies itself, light gusts, by range"
_SOURCE = "the world; Bar-Shalom, Li & Kirubarajan 2001, ch. 5.4 (NEES, NIS)"
SEEDS = 10  # by camera; on the measurement model twice as many
_SCENARIO = "light_gusts"
_FROM_12_M: Mapping[str, object] = {"start.aft_m": 12.0}
_EXACT: Mapping[str, object] = {
    f"parameters.as_built.{name}": 0.0
    for name in (
        "mounting_angle_sigma_rad", "mounting_position_sigma_m", "focal_length_sigma", "principal_point_sigma_px",
        "led_position_sigma_m", "ring_diameter_sigma_m", "distortion_k1_sigma", "distortion_k2_sigma",
        "distortion_p_sigma",
    )
}  # fmt: skip
_MEASURED: Mapping[str, object] = {"camera.sensing": "measurements"}
CASES: Mapping[str, Mapping[str, object]] = {
    "as drawn, by camera": {},
    "as drawn": _MEASURED,
    "as its sheets say": {**_MEASURED, **_EXACT},
}
_BEFORE_CONTACT = ("join_up", "pre_contact", "approach", "back_off")
_MIRROR_APART_RAD = np.deg2rad(3.0)  # below, the two minima are one
_SETTLED_S = 0.5  # from the first frame: the start geometry is not normal enough to be counted
_BINS_M = (2.4, 3.0, 4.0, 5.0, 7.5, 9.0, 11.0, 16.0)
_FAR_M, _NEAR_M, _INSIDE_M = (9.0, 11.0), 5.0, 10.0
_EPOCH_M = 0.1  # of range: one frame of each seed in each of these
_BAND = (0.025, 0.975)
_SIZE_IN, _DPI = (11.0, 7.4), 110
_COLUMNS = (
    "time_s", "range_m", "range_error_m", "left_error_m", "up_error_m", "miss_left_m", "miss_up_m", "attitude_rad",
    "wrong", "nees", "nis", "freedom", "valid",
)  # fmt: skip


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Rows:
    """Frames of one flight, a column each by name."""

    seed: int
    columns: dict[str, Array]

    def __getitem__(self, name: str) -> Array:
        return self.columns[name]


def reproduce(out: Path | None, seeds: int = SEEDS) -> dict[str, Any]:
    """Fly what has not been flown; table by range, and errors against range in `out`."""
    rows, shown, code = [], {}, Code().digest
    folders = {name: None if out is None else made_folder(out / "closed_loop" / _file_name(name)) for name in CASES}
    for name, overrides in CASES.items():
        folder = folders[name]
        count, flown_by = 2 * seeds if "camera.sensing" in overrides else seeds, _flown_by(code, overrides)
        flown = [_kept(folder, seed, flown_by, partial(fly, overrides, seed)) for seed in range(count)]
        rows.append({"case": name, "ours": figures(flown) | {"flights": len(flown)}, "reference": dict(WANTED)})
        rows += [
            {"case": f"{name}, {low:g}-{high:g} m from the camera", "ours": _between(flown, low, high), "reference": {}}
            for low, high in zip(_BINS_M[:-1], _BINS_M[1:], strict=True)
        ]
        shown[name] = flown
    if out is not None:
        _draw(shown, out / picture_name(ID))
    return {"id": ID, "source": _SOURCE, "rows": rows}


def _file_name(case: str) -> str:
    return case.replace(",", "").replace(" ", "_")


def _scenario(overrides: Mapping[str, object]) -> Scenario:
    return load_scenario(_SCENARIO, {**_FROM_12_M, **overrides})


def _flown_by(code: str, overrides: Mapping[str, object]) -> str:
    """Digest of all that decides a flight's rows but its seed: Dockair's code, the scenario, this file."""
    parts = code, scenario_hash(_scenario(overrides)), Path(__file__).read_text(encoding="utf-8")
    return blake2b("\0".join(parts).encode(), digest_size=8).hexdigest()


def _kept(folder: Path | None, seed: int, flown_by: str, flying: Callable[[], Rows]) -> Rows:
    """A flight that is in the folder, flown by what flies now; or flown now and put there whole or not at all."""
    if folder is None:
        return flying()
    path = folder / f"seed_{seed:03d}.json"
    table = json.loads(path.read_text(encoding="utf-8")) if path.is_file() else {}
    if table.get("flown_by") != flown_by:
        flown = flying()
        table = {"seed": seed, "flown_by": flown_by, "columns": {name: _plain(flown[name]) for name in _COLUMNS}}
        part = path.with_suffix(".part")
        part.write_text(json.dumps(table) + "\n", encoding="utf-8")
        part.replace(path)
    return Rows(seed=seed, columns={name: np.array(table["columns"][name], dtype=float) for name in _COLUMNS})


def _plain(column: Array) -> list[float | None]:
    return [None if not np.isfinite(value) else float(f"{value:.6g}") for value in column]


def fly(overrides: Mapping[str, object], seed: int) -> Rows:
    """Fly one approach up to the coupling and return its used frames."""
    flight = Flight(_scenario(overrides), seed)
    rows, newest_s = [], float("nan")
    try:
        while True:
            tick = flight.step()
            if tick.outcome is not None or tick.solution.phase not in _BEFORE_CONTACT:
                break
            stamp_s = tick.solution.frame_time_stamp_s
            if np.isfinite(stamp_s) and stamp_s != newest_s:
                newest_s = stamp_s
                rows.append(_row(flight, tick.solution, tick.truth))
    finally:
        flight.close()
    columns = np.array(rows, dtype=float).reshape(-1, len(_COLUMNS))
    return Rows(seed=seed, columns=dict(zip(_COLUMNS, columns.T, strict=True)))


def _row(flight: Flight, solution: NavSolution, truth: Truth) -> tuple[float, ...]:
    """One used frame: true less believed."""
    nominal, built = flight.sheets.mounting, flight.as_built.mounting
    R_BD = truth.R_WB.T @ truth.R_WD
    R_CD, R_CD_seen = built.R_BC.T @ R_BD, nominal.R_BC.T @ solution.R_BD
    p_CD = built.R_BC.T @ (truth.p_PD_B + built.p_BP - built.p_BC)
    p_CD_seen = nominal.R_BC.T @ (solution.p_PD_B + nominal.p_BP - nominal.p_BC)
    off_C, x = p_CD - p_CD_seen, state_error(solution, truth)
    other, _ = mirrored(R_CD, p_CD, flight.sheets.ring.positions_D)
    turned = float(np.linalg.norm(log(R_CD @ R_CD_seen.T)))
    apart, wrong = (float(np.linalg.norm(log(other @ R.T))) for R in (R_CD, R_CD_seen))
    assert isinstance(flight.navigator, Navigator)
    nis, freedom = flight.navigator.innovation or (float("nan"), 0)
    nees = normalised_error_squared(x, solution.covariance) if solution.valid else float("nan")
    return (
        truth.time_s, p_CD[0], *off_C, x[4], x[5], turned, float(apart > _MIRROR_APART_RAD and wrong < turned),
        nees, nis, float(freedom), float(solution.valid),
    )  # fmt: skip


def _settled(flown: Rows) -> NDArray[np.bool_]:
    return np.asarray((flown["time_s"] > flown["time_s"][0] + _SETTLED_S) & (flown["valid"] > 0.0))


def _between(flown: list[Rows], low_m: float, high_m: float) -> dict[str, float]:
    """Errors of the frames between two ranges; lateral, miss and attitude are lengths."""
    kept = [(one, _settled(one) & (one["range_m"] >= low_m) & (one["range_m"] < high_m)) for one in flown]

    def all_of(name: str) -> Array:
        return np.concatenate([one[name][mask] for one, mask in kept])

    count = len(all_of("time_s"))
    if count == 0:
        return {"frames": 0}
    nis, freedom = all_of("nis"), all_of("freedom")
    return {
        "frames": count,
        "range_rmse_mm": 1e3 * _rms(all_of("range_error_m")),
        "range_bias_mm": -1e3 * float(all_of("range_error_m").mean()),
        "lateral_rmse_mm": 1e3 * _rms(np.hypot(all_of("left_error_m"), all_of("up_error_m"))),
        "miss_vector_rmse_mm": 1e3 * _rms(np.hypot(all_of("miss_left_m"), all_of("miss_up_m"))),
        "attitude_rmse_deg": float(np.degrees(_rms(all_of("attitude_rad")))),
        "wrong_minimum_percent": 100.0 * float(all_of("wrong").mean()),
        "nees_over_n": float(np.nanmean(all_of("nees"))) / 9.0,
        "nis_over_n": float(np.nanmean(nis / np.maximum(freedom, 1.0))),
    }


def figures(flown: list[Rows]) -> dict[str, float]:
    """Return what is wanted, and the shares of epochs whose average over the flights is in its 95 % band."""
    far, near, inside = _between(flown, *_FAR_M), _between(flown, 0.0, _NEAR_M), _between(flown, 0.0, _INSIDE_M)
    missing = float("nan")
    nees, nis = _in_band(flown, "nees"), _in_band(flown, "nis")
    return {
        "range_rmse_mm_at_10_m": far.get("range_rmse_mm", missing),
        "range_bias_mm_at_10_m": far.get("range_bias_mm", missing),
        "range_rmse_mm_inside_5_m": near.get("range_rmse_mm", missing),
        "lateral_rmse_mm_inside_5_m": near.get("lateral_rmse_mm", missing),
        "miss_vector_rmse_mm_inside_5_m": near.get("miss_vector_rmse_mm", missing),
        "attitude_rmse_deg_inside_10_m": inside.get("attitude_rmse_deg", missing),
        "wrong_minimum_percent": _between(flown, 0.0, np.inf).get("wrong_minimum_percent", missing),
        "nees_over_n": _between(flown, 0.0, np.inf).get("nees_over_n", missing),
        "nees_in_band_percent": nees,
        "nis_in_band_percent": nis,
    }


def _in_band(flown: list[Rows], what: str) -> float:
    """Share of the ranges at which the average over the flights is in its 95 % band; one frame a flight and range."""
    inside = []
    for edge in np.arange(_BINS_M[0], _BINS_M[-1], _EPOCH_M):
        total, freedom = 0.0, 0.0
        for one in flown:
            there = _settled(one) & np.isfinite(one[what]) & (np.abs(one["range_m"] - edge) < 0.5 * _EPOCH_M)
            if there.any():
                first = int(np.argmax(there))
                total += float(one[what][first])
                freedom += 9.0 if what == "nees" else float(one["freedom"][first])
        if freedom > 0.0:
            low, high = chi2.ppf(_BAND, freedom)
            inside.append(low < total < high)
    return 100.0 * float(np.mean(inside)) if inside else float("nan")


def _rms(values: Array) -> float:
    return float(np.sqrt(np.mean(values**2)))


def _draw(shown: Mapping[str, list[Rows]], path: Path) -> None:
    from matplotlib.figure import Figure

    figure = Figure(figsize=_SIZE_IN, dpi=_DPI, layout="constrained")
    panels = figure.subplots(2, 2).ravel()
    quantities: tuple[tuple[str, Callable[[Rows], Array], tuple[tuple[float, float, float], ...]], ...] = (
        ("range [mm]", lambda one: 1e3 * np.abs(one["range_error_m"]), ((9.0, 11.0, 50.0), (2.4, 5.0, 10.0))),
        ("across, camera axes [mm]", lambda one: 1e3 * np.hypot(one["left_error_m"], one["up_error_m"]),
         ((2.4, 5.0, 5.0),)),
        ("attitude [deg]", lambda one: np.degrees(one["attitude_rad"]), ((2.4, 10.0, 0.5),)),
        ("NEES/n", lambda one: one["nees"] / 9.0, ()),
    )  # fmt: skip
    for axes, (label, of, limits) in zip(panels, quantities, strict=True):
        for k, (name, flown) in enumerate(shown.items()):
            for i, one in enumerate(flown):
                mask = _settled(one)
                axes.plot(
                    one["range_m"][mask],
                    of(one)[mask],
                    lw=0.5,
                    alpha=0.6,
                    color=f"C{k}",
                    label=name if i == 0 else None,
                )
        for first, last, limit in limits:
            axes.plot((first, last), (limit, limit), color="black", lw=1.5)
        axes.set(yscale="log", xlabel="range from the camera [m]", ylabel=label, title="black: rmse wanted")
        axes.invert_xaxis()
    panels[0].legend(frameon=False, fontsize=8)
    figure.savefig(path)
