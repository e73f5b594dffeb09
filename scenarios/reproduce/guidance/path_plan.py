"""What planning for the moment of contact is worth: a drogue that swings as a filter believes, followed and met.

The drogue's paths are Eq. (1) of `nav.guidance.swing_model`, of the swing alone, driven by white noise; the filter
sees them as well as a camera shows them, and the plan flies what the filter predicts, a response time ahead. Every few
seconds a contact is due: the miss is the distance across at that moment.

Not modelled: the receiver's own motion in gusts, the bow wave, anything but the two axes across.
"""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from dockair.nav.guidance.multiple_models import MultipleModels
from dockair.nav.guidance.path_plan import PathPlan, PlanSettings
from dockair.nav.guidance.swing_model import HoseMode, SwingSettings
from dockair.rotations import Array
from dockair.scenarios.reproduce.reference import picture_name

ID = "guidance/path-plan"
TITLE = "misses at contact: a drogue in moderate gusts followed at all times, and met at one time"
_SOURCE = "none: the three ways beside each other, on the same paths"
_STEP_S, _FLIGHTS, _FLIGHT_S, _FIRST_S, _EVERY_S, _COMMITTED_S = 0.01, 6, 50.0, 9.0, 2.3, 1.6
_FINE = 10  # steps of the drogue's path in one of control
_RESPONSE_S = np.array([0.28, 0.10, 0.10])
_ACROSS = (1, 2)
_CAPTURED_M = 0.15
_PLACE_SIGMA_M = 0.001  # of what the camera's fusion tells of the drogue, but for what does not change
_SIZE_IN, _DPI = (7.0, 4.6), 110


#: A drogue in moderate gusts as fitted to records of its place, by its swing alone; what flies knows overtones, too.
SWING = HoseMode(frequency_hz=(0.44, 0.31, 0.45), damping=(0.5, 0.05, 0.12), gust_density=(0.7, 1.3, 3.0))
GUST_TIME_S = (1.2, 0.7, 1.2)
_SETTINGS = SwingSettings(
    frequency_ratios=(1.0,),  # the hose is known here
    modes=(SWING,),
    gust_time_s=GUST_TIME_S,
    rattle_density=(0.0,) * 3,
    position_sigma_m=(_PLACE_SIGMA_M,) * 3,
)


@dataclass(frozen=True, slots=True)
class Way:
    """How the drogue is gone for."""

    name: str
    meets: bool  #: plans for the contact once it is less than `_COMMITTED_S` away
    acceleration_m_s2: tuple[float, float]  #: left, up
    jerk_m_s3: tuple[float, float]


WAYS = (
    Way("followed", False, (2.85, 4.275), (12.8, 20.9)),
    Way("met at contact, two thirds of the jerk", True, (2.85, 4.275), (8.55, 14.25)),
    Way("met at contact", True, (2.85, 4.275), (12.8, 20.9)),
)


def reproduce(out: Path | None) -> dict[str, Any]:
    """Fly every way on the same paths; the misses' distribution in `out`."""
    misses = {way.name: np.concatenate([missed(way, seed) for seed in range(_FLIGHTS)]) for way in WAYS}
    if out is not None:
        _draw(misses, out / picture_name(ID))
    rows = [{"case": name, "ours": _figures(found), "reference": {}} for name, found in misses.items()]
    return {"id": ID, "source": _SOURCE, "rows": rows}


def missed(way: Way, seed: int) -> Array:
    """(n,) misses at the contacts of one flight [m]."""
    rng = np.random.default_rng(seed)
    places, rates = drogue(rng)
    seen = places + _PLACE_SIGMA_M * rng.standard_normal(places.shape)
    plan = PlanSettings(half_way_s=0.0)  # the moment is all that is asked for here
    motion = MultipleModels(_SETTINGS, _STEP_S, _RESPONSE_S, plan.node_s)
    motion.start(seen[0], rates[0])
    plans = [PathPlan(plan, a, j) for a, j in zip(way.acceleration_m_s2, way.jerk_m_s3, strict=True)]
    contacts_s = np.arange(_FIRST_S, _FLIGHT_S, _EVERY_S)
    tip, found = np.zeros((2, 3)), []  # place, rate, acceleration of the tip a response time ahead, left and up
    tip[:, 0] = places[0, 1:]
    for i in range(len(places)):
        to_go_s = contacts_s - i * _STEP_S - _RESPONSE_S[1]
        next_s = float(to_go_s[to_go_s > -0.5 * _STEP_S].min(initial=np.inf))
        if abs(next_s) < 0.5 * _STEP_S:
            found.append(float(np.hypot(*(places[i + round(_RESPONSE_S[1] / _STEP_S), 1:] - tip[:, 0]))))
        motion.step(seen[i], np.zeros(3), np.zeros(3))
        path = motion.path(np.zeros((plan.nodes + 2, 3)))
        to_contact_s = next_s if way.meets and next_s < _COMMITTED_S else None
        for row, (axis, planned) in enumerate(zip(_ACROSS, plans, strict=True)):
            x = np.array([0.0, tip[row, 1], tip[row, 2]])
            jerk = planned.jerk_m_s3(x, path[:, axis] - tip[row, 0], to_contact_s)
            most = way.acceleration_m_s2[row]
            tip[row, 2] = np.clip(tip[row, 2] + jerk * _STEP_S, -most, most)
            tip[row, 1] += tip[row, 2] * _STEP_S
            tip[row, 0] += tip[row, 1] * _STEP_S
    return np.array(found)


def drogue(rng: np.random.Generator) -> tuple[Array, Array]:
    """(n, 3) places and rates of the swing, control tick by control tick, from rest."""
    dt, count = _STEP_S / _FINE, round(_FLIGHT_S / _STEP_S)
    omega, damping = 2.0 * np.pi * np.array(SWING.frequency_hz), np.array(SWING.damping)
    memory, density = np.array(GUST_TIME_S), np.array(SWING.gust_density)
    noise = density * np.sqrt(dt) * rng.standard_normal((count * _FINE, 3))
    s, v, g = np.zeros(3), np.zeros(3), np.zeros(3)
    places, rates = np.empty((count, 3)), np.empty((count, 3))
    for k in range(count * _FINE):
        if k % _FINE == 0:
            places[k // _FINE], rates[k // _FINE] = s, v
        g = g - dt * g / memory + noise[k]
        v = v + dt * (-(omega**2) * s - 2.0 * damping * omega * v + g)
        s = s + dt * v
    return places, rates


def _figures(found: Array) -> dict[str, float]:
    return {
        "contacts": len(found),
        "miss_rms_m": float(np.sqrt(np.mean(found**2))),
        "miss_median_m": float(np.median(found)),
        "within_0.15_m_share": float(np.mean(found <= _CAPTURED_M)),
    }


def _draw(misses: dict[str, Array], path: Path) -> None:
    from matplotlib.figure import Figure

    figure = Figure(figsize=_SIZE_IN, dpi=_DPI, layout="constrained")
    axes = figure.subplots()
    for name, found in misses.items():
        axes.step(np.sort(found), np.arange(1, len(found) + 1) / len(found), where="post", label=name)
    axes.axvline(_CAPTURED_M, color="black", lw=0.8, ls=":", label="counts as docked")
    axes.set_xlabel("miss at contact [m]")
    axes.set_ylabel("share of contacts within")
    axes.set_xlim(left=0.0)
    axes.legend(frameon=False, fontsize=8)
    figure.savefig(path)
