"""From how far aside of its trail position the drogue is let go, and what it does then, by the gain toward that place.

Each flight is flown on measured LEDs to its end. The trail position is the mean of the drogue's place behind the
tanker over the last seconds before contact; the gain is k of `nav.guidance.trail_position`, 0: the receiver is left
where contact and its drift have it.
"""

from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from dockair.nav.navigator import Navigator, NavigatorSettings
from dockair.rotations import Array
from dockair.scenarios.assembly.parts import guidance_settings
from dockair.scenarios.loop import Flight
from dockair.scenarios.reproduce.reference import picture_name
from dockair.scenarios.schema import load_scenario

ID = "guidance/release"
TITLE = "from how far aside the drogue is let go and how fast it goes aside then, by the gain toward its trail position"
_SOURCE = "none: gains beside each other"
GAINS_M_S: tuple[float, ...] = (0.0, 3.0, 6.0, 12.0)
SEEDS = 12
_SCENARIO, _FIRST_SEED = "moderate_gusts", 28460
_OVERRIDES = {"camera.sensing": "measurements"}
_BEFORE_S = 10.0  # over which the trail position is taken
_AFTER_S = 1.0  # within which a drogue that was let go has gone as fast as it will
_SIZE_IN, _DPI = (6.0, 4.2), 110


@dataclass(frozen=True, slots=True, kw_only=True)
class Release:
    """How the drogue came off."""

    aside_m: float  #: off the trail position, across, in the last tick in which it was held
    speed_m_s: float  #: across, of the drogue against the probe's tip, the greatest since
    off_axis_m: float  #: of the tip, where it came out of the ring's plane; NaN if it did not


def reproduce(out: Path | None) -> dict[str, Any]:
    """Fly; how far and how fast in `out`."""
    found: dict[float, list[Release]] = {}
    for gain in GAINS_M_S:
        flown = [release(seed, gain) for seed in range(_FIRST_SEED, _FIRST_SEED + SEEDS)]
        found[gain] = [one for one in flown if one is not None]
    if out is not None:
        _draw(found, out / picture_name(ID))
    rows = [{"case": f"{gain:g} m/s a radian", "ours": _figures(found[gain]), "reference": {}} for gain in GAINS_M_S]
    return {"id": ID, "source": _SOURCE, "rows": rows}


def release(seed: int, gain_m_s: float) -> Release | None:
    """Fly a seed; None if the drogue was not held and let go."""
    scenario = load_scenario(_SCENARIO, _OVERRIDES)
    flight = Flight(scenario, seed)
    flown = guidance_settings(scenario)
    limits = replace(flown.limits, slack_far_rad=np.inf)  # else a hose that is held far aside is told to be slack
    guidance = replace(flown, trail_gain_m_s=gain_m_s, limits=limits)
    flight.navigator = Navigator(flight.sheets, NavigatorSettings(guidance=guidance))
    times, places, latched, tips, rates = [], [], [], [], []
    try:
        while True:
            tick = flight.step()
            truth = tick.truth
            times.append(truth.time_s)
            places.append(((truth.p_WD - truth.p_WT) @ truth.R_WT)[1:])
            latched.append(truth.latched)
            tips.append(truth.p_DP)
            rates.append(float(np.linalg.norm(((truth.v_WD - truth.v_WP) @ truth.R_WB)[1:])))
            if tick.outcome is not None:
                break
    finally:
        flight.close()
    return _release(*(np.array(x) for x in (times, places, latched, tips, rates)))


def _release(time_s: Array, place_m: Array, latched: Array, tip_m: Array, rate_m_s: Array) -> Release | None:
    held = np.flatnonzero(latched)
    if not held.size or held[-1] + 1 == len(latched):
        return None
    first, last = held[0], held[-1]
    trail_m = place_m[(time_s >= time_s[first] - _BEFORE_S) & (time_s < time_s[first])].mean(axis=0)
    out = np.flatnonzero(tip_m[last:, 0] < 0.0)
    return Release(
        aside_m=float(np.linalg.norm(place_m[last] - trail_m)),
        speed_m_s=float(rate_m_s[last + 1 :][time_s[last + 1 :] <= time_s[last] + _AFTER_S].max()),
        off_axis_m=float(np.linalg.norm(tip_m[last + out[0], 1:])) if out.size else float("nan"),
    )


def _figures(found: list[Release]) -> dict[str, float]:
    figures: dict[str, float] = {"released": len(found)}
    for name in Release.__slots__ if found else ():
        values = [getattr(one, name) for one in found]
        figures |= {f"median_{name}": float(np.nanmedian(values)), f"most_{name}": float(np.nanmax(values))}
    return figures


def _draw(found: dict[float, list[Release]], path: Path) -> None:
    from matplotlib.figure import Figure

    figure = Figure(figsize=_SIZE_IN, dpi=_DPI, layout="constrained")
    panel = figure.subplots()
    for gain, flights in found.items():
        aside, speed = [one.aside_m for one in flights], [one.speed_m_s for one in flights]
        panel.plot(aside, speed, marker="o", ls="", ms=4, label=f"{gain:g} m/s a radian")
    panel.set(xlabel="let go aside of the trail position [m]", ylabel="goes aside of the tip at up to [m/s]")
    panel.legend(frameon=False, fontsize=8)
    panel.grid(alpha=0.3)
    figure.savefig(path)
