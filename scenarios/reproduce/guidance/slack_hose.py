"""How far the drogue drops and turns on the probe after contact, on hoses that the reel takes up and on slack ones.

Each flight is flown on measured LEDs until little more than half a second after contact, and the navigation's own
belief of the drogue's axis is held against its mean of the second before, as `nav.guidance.slack_hose` does; the
receiver's attitude, by which the axis is told in axes that do not turn, is the true one here, and contact is the
phase's.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from dockair.nav.guidance.phases import PhaseLimits
from dockair.nav.guidance.slack_hose import turn_rad
from dockair.rotations import Array
from dockair.scenarios.loop import Flight
from dockair.scenarios.reproduce.reference import picture_name
from dockair.scenarios.schema import load_scenario

ID = "guidance/slack-hose"
TITLE = "how far the drogue drops and turns on the probe after contact, on hoses that are taken up and on slack ones"
_SOURCE = "none: the two kinds of hose beside each other"
#: Scenario -> how many seeds; the first is a dead reel.
FLOWN: Mapping[str, int] = {"dead_reel_unnoticed": 8, "default": 4, "moderate_gusts": 8, "slow_set": 4, "racetrack": 2}
_FIRST_SEED = 25867
_OVERRIDES = {"camera.sensing": "measurements"}
_AFTER_S, _LONGEST_S = 0.6, 90.0
_SIZE_IN, _DPI = (11.0, 4.0), 100


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Contact:
    """The drogue's axis about contact, and what guidance said of the hose."""

    before: Array  #: (n, 3) of the second before, axes that do not turn
    after: Array  #: (m, 3) from contact on, one a control tick
    step_s: float  #: control period
    told_slack: bool


def reproduce(out: Path | None) -> dict[str, Any]:
    """Fly; the angles over time in `out`."""
    contacts: dict[str, list[Contact]] = {}
    rows = []
    for name, seeds in FLOWN.items():
        flown = [contact(name, seed) for seed in range(_FIRST_SEED, _FIRST_SEED + seeds)]
        contacts[name] = [found for found in flown if found is not None]
        rows.append({"case": name, "ours": _figures(contacts[name]), "reference": {}})
    if out is not None:
        _draw(contacts, out / picture_name(ID))
    return {"id": ID, "source": _SOURCE, "rows": rows}


def contact(scenario: str, seed: int) -> Contact | None:
    """Fly a seed until a little after its first contact; None if it makes none."""
    loaded = load_scenario(scenario, _OVERRIDES)
    step_s, flight = 1.0 / loaded.rates.control_hz, Flight(loaded, seed)
    axes: list[Array] = []
    start: int | None = None
    told = False
    try:
        while (tick := flight.step()).outcome is None and tick.truth.time_s < _LONGEST_S:
            axes.append(tick.truth.R_WB @ tick.solution.R_BD[:, 0])
            told |= tick.solution.phase_reason == "hose is slack"
            if start is None and tick.solution.phase == "contact":
                start = len(axes) - 1
            if start is not None and (len(axes) - start) * step_s > _AFTER_S:
                break
    finally:
        flight.close()
    if start is None:
        return None
    first = max(start - round(PhaseLimits().slack_before_s / step_s), 0)
    return Contact(before=np.array(axes[first:start]), after=np.array(axes[start:]), step_s=step_s, told_slack=told)


def drop_deg(found: Contact) -> Array:
    """(m, 2) time since contact [s], and how far the nose has dropped from the mean axis before it [deg]."""
    rest = found.before.mean(axis=0)
    dropped = np.degrees([turn_rad(axis, rest)[0] for axis in found.after])
    return np.column_stack([found.step_s * np.arange(len(dropped)), dropped])


def mean_turn_deg(found: Contact) -> Array:
    """(k, 3) time since contact [s], drop and tilt of Eq. (1) of `nav.guidance.slack_hose` [deg], at each look."""
    limits, rest = PhaseLimits(), found.before.mean(axis=0)
    first, last = (round(t / found.step_s) for t in (limits.slack_from_s, limits.slack_to_s))
    sums = np.cumsum(found.after[first : last + 1], axis=0)[round(limits.slack_over_s / found.step_s) - 1 :]
    times_s = limits.slack_to_s - found.step_s * np.arange(len(sums))[::-1]
    return np.column_stack([times_s, np.degrees([turn_rad(axis, rest) for axis in sums])])


def _figures(contacts: list[Contact]) -> dict[str, float]:
    if not contacts:
        return {"contacts": 0}
    drop, tilt = np.transpose([mean_turn_deg(found)[:, 1:].max(axis=0) for found in contacts])
    return {
        "contacts": len(contacts),
        "least_drop_deg": drop.min(),
        "most_drop_deg": drop.max(),
        "least_tilt_deg": tilt.min(),
        "most_tilt_deg": tilt.max(),
        "told_slack": sum(found.told_slack for found in contacts),
    }


def _draw(contacts: Mapping[str, list[Contact]], path: Path) -> None:
    from matplotlib.figure import Figure

    limits = PhaseLimits()
    figure = Figure(figsize=_SIZE_IN, dpi=_DPI, layout="constrained")
    panels = figure.subplots(1, 3)
    for panel in panels[:2]:
        panel.axhline(0.0, color="black", lw=0.6)
        panel.axvspan(limits.slack_from_s, limits.slack_to_s, color="0.92", label="looked at")
    for panel, limit_rad in ((panels[1], limits.slack_drop_rad), (panels[2], limits.slack_tilt_rad)):
        panel.axhline(np.degrees(limit_rad), color="black", ls="--", lw=1.0, label="told slack above")
    for k, (name, flights) in enumerate(contacts.items()):
        for number, flown in enumerate(flights):
            style = {"color": f"C{(3, 0, 1, 2, 4)[k % 5]}", "lw": 0.9, "label": name if number == 0 else None}
            means = mean_turn_deg(flown)
            panels[0].plot(*drop_deg(flown).T, **style)
            panels[1].plot(means[:, 0], means[:, 1], **style)
            panels[2].plot(means[:, 0], means[:, 2], **style)
    for panel, label in zip(panels, ("nose dropped", "its mean dropped", "its mean turned"), strict=True):
        panel.set(xlabel="since contact [s]", ylabel=f"{label} on the probe [deg]")
    handles, labels = panels[1].get_legend_handles_labels()
    figure.legend(handles, labels, frameon=False, fontsize=8, loc="outside upper center", ncols=4)
    figure.savefig(path)
