"""How well guidance foretells the drogue in moderate gusts: the filter that is flown, beside ones that know less.

Every flight is flown once, on perfect navigation and up to contact; what guidance was told and commanded is then gone
through by each filter, so that all of them see the same drogue; likewise on two hoses that guidance does not know. A
place foretold on the receiver's own scale is held against where the drogue was on it when the time had come.

Not in it: the camera, whose frames are old and noisy, and the IMU, whose bias turns gravity; what they add stands on
the page. What of the receiver's own motion nobody foresees is in none of the figures.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from dockair.nav.guidance.multiple_models import MultipleModels
from dockair.nav.guidance.own_path import OwnPath
from dockair.nav.guidance.stabilised_axes import StabilisedAxes
from dockair.nav.guidance.swing_model import SwingSettings
from dockair.rotations import Array
from dockair.scenarios.assembly.parts import guidance_settings
from dockair.scenarios.loop import Flight
from dockair.scenarios.reproduce.reference import picture_name
from dockair.scenarios.schema import load_scenario
from dockair.vectors import cross

ID = "guidance/foretelling"
TITLE = (
    "how far off the foretold place of the drogue is, in moderate gusts, by how far ahead and by what the filter knows"
)
SEEDS = 8
_FIRST_SEED = 21400
_SOURCE = "none: filters beside each other, on the same flights"
_SCENARIO, _OVERRIDES = "moderate_gusts", {"navigation.navigator": "truth"}
HOSES: Mapping[str, Mapping[str, float]] = {  # length of the hose, drag of the drogue
    "nominal": {},
    "long, little drag": {"parameters.hose.length_m": 20.0, "parameters.drogue.drag_coefficient": 0.65},
    "short, much drag": {"parameters.hose.length_m": 11.0, "parameters.drogue.drag_coefficient": 0.95},
}
_WAITING = ("join_up", "pre_contact", "approach")
_FROM_S, _LONGEST_S = 6.0, 60.0  # what a filter foretells in its first seconds is not counted
_NODE_S, _AHEAD_S = 0.05, (0.2, 0.3, 0.4, 0.6)
_AXES = {"left": 1, "up": 2}
_SIZE_IN, _DPI = (7.0, 4.2), 110


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Told:
    """What guidance was told and commanded in a flight, tick by tick, stabilised axes."""

    place_m: Array  #: (n, 3) ring centre from the probe's tip
    rate_m_s: Array  #: (3,) its rate in the first tick
    felt_m_s: Array  #: (n, 3) change of the tip's velocity in the tick
    commanded_m_s: Array  #: (n, 3) velocity for the next tick


def reproduce(out: Path | None, seeds: int = SEEDS) -> dict[str, Any]:
    """Fly, go through every flight with every filter; error against time ahead on the nominal hose in `out`."""
    rows, errors = [], {}
    for hose in HOSES:
        flights = [fly(seed, hose) for seed in range(_FIRST_SEED, _FIRST_SEED + seeds)]
        for name, swing in knowledge(flown_settings()).items():
            found = [unforeseen_m(told, swing) for told in flights]
            errors[hose, name] = found
            rows.append({"case": f"{hose}: {name}", "ours": _figures(found), "reference": {}})
    if out is not None:
        _draw({name: found for (hose, name), found in errors.items() if not HOSES[hose]}, out / picture_name(ID))
    return {"id": ID, "source": _SOURCE, "rows": rows}


def flown_settings() -> SwingSettings:
    """Return the settings that the scenario flies with."""
    return guidance_settings(load_scenario(_SCENARIO, _OVERRIDES)).predictive.swing


def knowledge(flown: SwingSettings) -> Mapping[str, SwingSettings]:
    """Return the filters: the one that flies with some of its knowledge taken away."""
    nominal = replace(flown, frequency_ratios=(1.0,))
    modes = tuple(replace(mode, felt_share=(0.0,) * 3) for mode in flown.modes)
    deaf = replace(nominal, modes=modes, gust_felt_share=(0.0,) * 3)
    return {
        "one swing": replace(deaf, modes=modes[:1]),
        "three modes": deaf,
        "three modes, and what is felt": nominal,
        "the same, not told which hose it is (flown)": flown,
    }


def fly(seed: int, hose: str = "nominal") -> Told:
    """Fly a seed up to contact."""
    scenario = load_scenario(_SCENARIO, {**_OVERRIDES, **HOSES[hose]})
    step_s = 1.0 / scenario.rates.control_hz
    axes = StabilisedAxes(guidance_settings(scenario).levelling_s, step_s)
    flight = Flight(scenario, seed)
    places, rates, felt, commanded = [], [], [], []
    before = flight.truth.v_WP
    try:
        while (tick := flight.step()).outcome is None:
            truth, told = tick.truth, tick.solution  # which is the truth, too
            if told.phase not in _WAITING or told.p_PD_B[0] <= 0.0 or truth.time_s > _LONGEST_S:
                break
            axes.step(truth.w_WB_B, 0.0)
            place, rate = axes.moved(told.p_PD_B, told.v_PD_B - cross(truth.w_WB_B, told.p_PD_B))
            places.append(place)
            rates.append(rate)
            felt.append(axes.R_NB @ ((truth.v_WP - before) @ truth.R_WB))
            commanded.append(axes.R_NB @ told.command.velocity_m_s)
            before = truth.v_WP
    finally:
        flight.close()
    return Told(place_m=np.array(places), rate_m_s=rates[0], felt_m_s=np.array(felt), commanded_m_s=np.array(commanded))


def unforeseen_m(told: Told, swing: SwingSettings) -> Array:
    """(n, times ahead, 3) place foretold less the place that came [m]; NaN where it is not counted."""
    scenario = load_scenario(_SCENARIO, _OVERRIDES)
    settings, step_s = guidance_settings(scenario), 1.0 / scenario.rates.control_hz
    predictive = settings.predictive
    straying_s, limit_m_s = np.array(predictive.straying_s), np.array(predictive.straying_limit_m_s)
    own = OwnPath(np.array(settings.response_s), step_s, straying_s, predictive.forgotten_s, limit_m_s)
    motion = MultipleModels(swing, step_s, np.zeros(3), _NODE_S)
    nodes = np.round(np.array(_AHEAD_S) / _NODE_S).astype(int) - 1
    came, foretold = np.empty_like(told.place_m), np.full((len(told.place_m), len(_AHEAD_S), 3), np.nan)
    motion.start(told.place_m[0], told.rate_m_s)
    for i, place in enumerate(told.place_m):
        own.feel(told.felt_m_s[i])
        came[i] = place + own.place_m
        push = settings.bow_wave.at(place)
        motion.step(came[i], push, own.blown_m_s)
        foretold[i] = motion.path(np.tile(push, (nodes[-1] + 3, 1)))[nodes]
        own.step(told.commanded_m_s[i])
    for row, ahead_s in enumerate(_AHEAD_S):
        ticks = round(ahead_s / step_s)
        foretold[:-ticks, row] -= came[ticks:]
        foretold[-ticks:, row] = np.nan
    foretold[: round(_FROM_S / step_s)] = np.nan
    return foretold


def _figures(errors: list[Array]) -> dict[str, float]:
    together = np.concatenate(errors)
    return {
        f"{name}_{ahead_s:g}_s_rms_mm": 1e3 * float(np.sqrt(np.nanmean(together[:, row, axis] ** 2)))
        for name, axis in _AXES.items()
        for row, ahead_s in enumerate(_AHEAD_S)
    }


def _draw(errors: dict[str, list[Array]], path: Path) -> None:
    from matplotlib.figure import Figure

    figure = Figure(figsize=_SIZE_IN, dpi=_DPI, layout="constrained")
    for panel, (side, axis) in zip(figure.subplots(1, 2, sharey=True), _AXES.items(), strict=True):
        for name, found in errors.items():
            rms = np.sqrt(np.nanmean(np.concatenate(found)[:, :, axis] ** 2, axis=0))
            panel.plot(_AHEAD_S, 1e3 * rms, marker="o", label=name)
        panel.set_title(side, fontsize=9)
        panel.set_xlabel("ahead [s]")
        panel.grid(alpha=0.3)
    figure.axes[0].set_ylabel("foretold place, error rms [mm]")
    figure.axes[0].legend(frameon=False, fontsize=8)
    figure.savefig(path)
