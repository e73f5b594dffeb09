"""What the claim of contact is worth while the camera is out, in gusts of three strengths.

`camera_dropouts` flown on measured LEDs from station to the basket: 0.3 s without a frame every 2.2 s. At every tick of
the last metres, by the age of the last frame: how often contact is claimed, how far the belief is off across the
camera's axis and along it, and how often it is off by more than an alert limit while contact is claimed.
"""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from dockair.nav.integrity.contact import ContactLimits
from dockair.nav.navigator import Navigator
from dockair.rotations import Array
from dockair.scenarios.loop import Flight
from dockair.scenarios.reproduce.reference import picture_name
from dockair.scenarios.schema import load_scenario

ID = "integrity/coasting"
TITLE = "what the claim of contact is worth while the camera is out, in gusts of three strengths"
SEEDS = 6
_FIRST_SEED = 15_200
_MEASURED: Mapping[str, object] = {"camera.sensing": "measurements", "flight.duration_s": 40.0}
_GUSTS: Mapping[str, Mapping[str, object]] = {
    "0.5 m/s": {},
    "light": {"turbulence.intensity": "light"},
    "moderate": {"turbulence.intensity": "moderate"},
}
_AGES_S = (0.0, 0.06, 0.12, 0.2, 0.25, 0.3, 0.34)
_SIZE_IN, _DPI = (11.0, 4.0), 110
_NEAR_M = 5.0  # ahead of the tip: astern and nearer
_SETTLED_S = 2.0  # from the start: before, the belief has foretold next to nothing


def reproduce(out: Path | None, seeds: int = SEEDS) -> dict[str, Any]:
    """Fly, and table claims and errors by the age of the last frame; every tick in `out`."""
    rows, flown = [], {}
    for name, gusts in _GUSTS.items():
        ticks = flown[name] = np.concatenate([fly(gusts, _FIRST_SEED + k) for k in range(seeds)])
        for low, high in zip(_AGES_S[:-1], _AGES_S[1:], strict=True):
            within = ticks[(ticks[:, 0] >= low) & (ticks[:, 0] < high)]
            rows.append({"case": f"{name}, {low:g}-{high:g} s", "ours": _figures(within), "reference": {}})
    if out is not None:
        _draw(flown, out / picture_name(ID))
    return {"id": ID, "source": "the world", "rows": rows}


def fly(gusts: Mapping[str, object], seed: int) -> Array:
    """(ticks, 6) before the tip enters the basket: frame's age [s], claimed, error and level across, along [m]."""
    flight = Flight(load_scenario("camera_dropouts", {**_MEASURED, **gusts}), seed)
    ticks: list[tuple[float, ...]] = []
    try:
        while True:
            tick = flight.step()
            if tick.outcome is not None or tick.truth.p_DP[0] > 0.0:
                return np.array(ticks).reshape(-1, 6)
            navigator = flight.navigator
            assert isinstance(navigator, Navigator)
            claim, solution = navigator.contact_claim(), tick.solution
            if claim is None or tick.truth.time_s < _SETTLED_S or tick.truth.p_PD_B[0] > _NEAR_M:
                continue
            error_C = flight.sheets.mounting.R_BC.T @ (tick.truth.p_PD_B - solution.p_PD_B)
            errors_m = float(np.hypot(error_C[1], error_C[2])), abs(float(error_C[0]))
            levels_m = claim.levels.lateral_m, claim.levels.range_m
            age_s = solution.time_stamp_s - solution.frame_time_stamp_s
            ticks.append((age_s, solution.contact_usable, errors_m[0], levels_m[0], errors_m[1], levels_m[1]))
    finally:
        flight.close()


def _figures(ticks: Array) -> dict[str, float]:
    if not len(ticks):
        return {"ticks": 0}
    _, claimed, across_m, across_level_m, along_m, along_level_m = ticks.T
    limits = ContactLimits()
    beyond = (claimed > 0.0) & ((across_m > limits.lateral_m) | (along_m > limits.range_m))
    return {
        "ticks": len(ticks),
        "claimed_percent": 100.0 * float(claimed.mean()),
        "claimed_beyond_a_limit": int(beyond.sum()),
        "error_across_mm_median": 1e3 * float(np.median(across_m)),
        "error_across_mm_99_percent": 1e3 * float(np.quantile(across_m, 0.99)),
        "level_across_mm_median": 1e3 * float(np.median(across_level_m)),
        "error_along_mm_median": 1e3 * float(np.median(along_m)),
        "error_along_mm_99_percent": 1e3 * float(np.quantile(along_m, 0.99)),
        "level_along_mm_median": 1e3 * float(np.median(along_level_m)),
    }


def _draw(flown: Mapping[str, Array], path: Path) -> None:
    from matplotlib.figure import Figure

    figure = Figure(figsize=_SIZE_IN, dpi=_DPI, layout="constrained")
    for axes, (name, ticks) in zip(figure.subplots(1, len(flown), sharey=True), flown.items(), strict=True):
        for claimed, label, color in ((0.0, "not claimed", "C1"), (1.0, "contact claimed", "C0")):
            age_s, _, across_m = ticks[ticks[:, 1] == claimed, :3].T
            axes.plot(age_s, 1e3 * across_m, ".", ms=2, color=color, label=label)
        axes.axhline(1e3 * ContactLimits().lateral_m, color="black", lw=1.0, label="alert limit")
        axes.set(xlabel="age of the last frame [s]", title=f"gusts: {name}")
    figure.axes[0].set_ylabel("error across [mm]")
    figure.axes[0].legend(frameon=False, fontsize=8)
    figure.savefig(path)
