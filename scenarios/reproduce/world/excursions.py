"""How far gusts carry the drogue: light, moderate and severe, in two flight conditions, on a tanker that stands still.

Hose and drogue alone ride the frozen Dryden field of MIL-F-8785C. Excursions are those of the hose's rear end about its
mean place over all runs of a row. A run is as long as the reference's two together, so that the spread from run to run
says how far the reference may lie from the mean by luck; ours is the mean over the runs, with its standard error. All
rows have the same seeds.

Not in it: wake, receiver, a tanker that gives way to the gusts itself.
"""

from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from dockair.parameters import load_parameters
from dockair.rotations import Array
from dockair.scenarios.reproduce.reference import picture_name, read_reference
from dockair.sim.air.atmosphere import standard_atmosphere
from dockair.sim.air.turbulence import DrydenField, TurbulenceParameters, gust_sigma
from dockair.sim.hose.chain import DrogueParameters, HoseParameters
from dockair.sim.hose.rig import HoseRig

ID = "world/excursions"
TITLE = "drogue excursions in light, moderate and severe gusts"
_SOURCE = "MIL-F-8785C gusts; excursions by an independent simulation (2 x 45 s, within 30 %)"
_RUNS = 10
_RUN_S, _SETTLE_S = 90.0, 15.0  # settling: five periods of the swing
_STEP_S = 5e-3  # the same gusts at 1 kHz give the same rms within 0.2 %
_SEED = 93
_SIZE_IN, _DPI = (11.0, 8.0), 110
_SHOWN_S = 45.0
_QUANTITIES = (
    "rms_lateral_m",
    "rms_vertical_m",
    "peak_lateral_m",
    "peak_vertical_m",
    "speed_lateral_m_s",
    "speed_vertical_m_s",
)


@dataclass(frozen=True, slots=True, kw_only=True)
class Condition:
    """One row."""

    airspeed_m_s: float
    altitude_m: float
    intensity: str

    @property
    def name(self) -> str:
        """Its name in words."""
        return f"{self.airspeed_m_s:.0f} m/s, {self.altitude_m:.0f} m, {self.intensity}"

    @property
    def sigma_m_s(self) -> float:
        """Strength of the gusts."""
        return gust_sigma(self.intensity, self.altitude_m)


def reproduce(out: Path | None) -> dict[str, Any]:
    """Run all conditions; in `out` the drogue's paths across the flight direction, and rms against strength."""
    rows, paths = [], {}
    for published in read_reference("drogue_excursions"):
        condition = Condition(
            airspeed_m_s=float(published["airspeed_m_s"]),
            altitude_m=float(published["altitude_m"]),
            intensity=published["intensity"],
        )
        runs = np.array([ride(condition, run) for run in range(_RUNS)])
        paths[condition] = runs
        reference = {key: float(published[key]) for key in ("sigma_m_s", *_QUANTITIES)}
        rows.append({"case": condition.name, "ours": excursions(condition, runs), "reference": reference})
    if out is not None:
        _draw(paths, rows, out / picture_name(ID))
    return {"id": ID, "source": _SOURCE, "rows": rows}


def ride(condition: Condition, run: int, *, sigma_m_s: float | None = None, duration_s: float = _RUN_S) -> Array:
    """(n, 3) places of the hose's rear end from its exit [m], tick by tick, settled.

    Args:
        condition: airspeed, altitude and strength.
        run: its number; the same one meets the same air in all conditions, but for its strength.
        sigma_m_s: another strength than the condition's.
        duration_s: after settling.
    """
    sheet = load_parameters("turbulence", TurbulenceParameters)
    sheet = replace(sheet, sigma_m_s=condition.sigma_m_s if sigma_m_s is None else sigma_m_s)
    field = DrydenField(sheet, condition.airspeed_m_s, _STEP_S, np.random.default_rng((_SEED, run)))
    rig = HoseRig(
        load_parameters("hose", HoseParameters),
        load_parameters("drogue", DrogueParameters),
        np.array([-condition.airspeed_m_s, 0.0, 0.0]),
        standard_atmosphere(condition.altitude_m),
        step_s=_STEP_S,
    )
    settling = round(_SETTLE_S / _STEP_S)
    places = np.empty((round(duration_s / _STEP_S), 3))
    for tick in range(-settling, len(places)):
        field.step()
        rig.step(lambda place_W: field.velocity(place_W[:, 0]))
        if tick >= 0:
            places[tick] = rig.hose_end()
    return places


def excursions(condition: Condition, runs: Array) -> dict[str, float]:
    """Mean of each quantity over the runs (k, n, 3), its standard error and its spread from run to run."""
    away = (runs - runs.mean(axis=(0, 1)))[:, :, 1:]
    speed = np.gradient(runs, _STEP_S, axis=1)[:, :, 1:]
    # of shape (k, 6); rms by the mean square over the runs, so that it is that of one long run
    squares = np.hstack([(away**2).mean(axis=1), np.abs(away).max(axis=1) ** 2, (speed**2).mean(axis=1)])
    ours = {"sigma_m_s": condition.sigma_m_s}
    for name, values in zip(_QUANTITIES, np.sqrt(squares).T, strict=True):
        mean = values.mean() if "peak" in name else np.sqrt((values**2).mean())
        ours[name] = float(mean)
        ours[name.replace("_m", "_standard_error_m", 1)] = float(values.std(ddof=1) / np.sqrt(len(values)))
    ours["runs"] = len(runs)
    return ours


def _draw(paths: dict[Condition, Array], rows: list[dict[str, Any]], path: Path) -> None:
    from matplotlib.figure import Figure

    figure = Figure(figsize=_SIZE_IN, dpi=_DPI, layout="constrained")
    panels = figure.subplots(2, 3)
    shown = round(_SHOWN_S / _STEP_S)
    speeds = sorted({condition.airspeed_m_s for condition in paths})
    for row, airspeed in zip(panels, speeds, strict=True):
        ours = {c: runs for c, runs in paths.items() if c.airspeed_m_s == airspeed}
        for condition, runs in reversed(ours.items()):
            row[0].plot(*runs[0, :shown, 1:].T, lw=0.6, label=condition.intensity)
        row[0].set(xlabel="left [m]", ylabel="up [m]", title=f"{airspeed:.0f} m/s: {_SHOWN_S:.0f} s of one run")
        row[0].set_aspect("equal", adjustable="datalim")
        of_speed = [r for r, c in zip(rows, paths, strict=True) if c.airspeed_m_s == airspeed]
        _draw_against_strength(row[1], of_speed, "rms_{}_m", "rms [m]")
        _draw_against_strength(row[2], of_speed, "speed_{}_m_s", "rms speed [m/s]")
        for panel in row:
            panel.legend(frameon=False, fontsize=8)
            panel.grid(alpha=0.25)
    figure.savefig(path)


def _draw_against_strength(panel: Any, rows: list[dict[str, Any]], key: str, label: str) -> None:
    sigma = [row["ours"]["sigma_m_s"] for row in rows]
    for axis, colour in (("lateral", "tab:blue"), ("vertical", "tab:orange")):
        name = key.format(axis)
        values = [row["ours"][name] for row in rows]
        error = [2.0 * row["ours"][name.replace("_m", "_standard_error_m", 1)] for row in rows]
        panel.errorbar(sigma, values, yerr=error, fmt="o-", ms=4, lw=0.9, capsize=3, color=colour, label=axis)
        panel.plot(sigma, [row["reference"][name] for row in rows], "x", ms=7, color=colour, label=f"{axis}, reference")
    panel.set(xlabel="σ [m/s]", ylabel=label, xlim=(0.0, None), ylim=(0.0, None), title="bars: 2 standard errors")
