"""The reel: tension while the probe pushes the drogue in, and the way back to full trail once it is let go.

The receiver is driven. It makes contact, pushes the hose in at a constant speed, slows down to a stop with five metres
in, and stays there; then it breaks away faster than the brake lets the hose run, so that the coupling lets go of it,
and the hose is left to itself.

The references are the set-point for the tension that is held, the static tension and full trail for where it ends.
"""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from dockair.messages import Light, ReceiverCommand
from dockair.parameters import load_parameters
from dockair.rotations import Array
from dockair.scenarios.reproduce.reference import picture_name
from dockair.scenarios.reproduce.world.driven import PHYSICS_HZ, driven_world
from dockair.sim.hose.reel import ReelParameters, reel_light

ID = "world/reel"
TITLE = "reel: tension held while 5 m are pushed in, return to full trail, the pod's lights"
_SOURCE = "assets/parameters/reel.toml; [KDC-10 procedures] for the lights"
_TAKE_IN_M, _SLOWING_M_S2, _STAY_S, _RETURN_S = 5.0, 1.0, 2.0, 8.0
_SPEEDS_M_S = (0.6, 1.2, 2.4)
_BREAKAWAY_M_S, _BREAKAWAY_M_S2 = 5.0, 5.0
_SETTLED_M = 0.05  # from full trail
_AFTER_CONTACT_S = 0.3  # in which the blow of the contact passes
_GAP_M = 0.2
_SIZE_IN, _DPI = (11.0, 8.0), 110


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Stroke:
    """One run, a row a tick from the moment at which the coupling holds."""

    speed_m_s: float
    static_n: float
    pushed_s: float  #: when the receiver begins to slow down
    tension_n: Array
    wound_in_m: Array
    rate_m_s: Array
    latched: Array

    @property
    def time_s(self) -> Array:
        """(n,) since the coupling holds."""
        return np.arange(len(self.tension_n)) / PHYSICS_HZ

    @property
    def let_go_s(self) -> float:
        """When the coupling lets go."""
        return float(np.argmin(self.latched) / PHYSICS_HZ)


def stroke(speed_m_s: float) -> Stroke:
    """Push in, stay, break away, and watch the hose run out."""
    world = driven_world((_GAP_M, 0.0, 0.0))
    while not world.truth.latched:
        world.step(_along(speed_m_s))
    pushed_s = _TAKE_IN_M / speed_m_s - 0.5 * speed_m_s / _SLOWING_M_S2
    away_s = pushed_s + speed_m_s / _SLOWING_M_S2 + _STAY_S
    rows = []
    for tick in range(round((away_s + _RETURN_S) * PHYSICS_HZ)):
        time_s = tick / PHYSICS_HZ
        wanted = min(max(speed_m_s - _SLOWING_M_S2 * (time_s - pushed_s), 0.0), speed_m_s)
        if time_s > away_s:
            wanted = -min(_BREAKAWAY_M_S2 * (time_s - away_s), _BREAKAWAY_M_S)
        truth = world.step(_along(wanted))
        rows.append((truth.root_tension_n, truth.reel_position_m, truth.reel_rate_m_s, float(truth.latched)))
    tension, wound_in, rate, latched = np.array(rows).T
    return Stroke(
        speed_m_s=speed_m_s,
        static_n=world.rest.root_tension_n,
        pushed_s=pushed_s,
        tension_n=tension,
        wound_in_m=wound_in,
        rate_m_s=rate,
        latched=latched,
    )


def _along(speed_m_s: float) -> ReceiverCommand:
    return ReceiverCommand(velocity_m_s=np.array([speed_m_s, 0.0, 0.0]))


def reproduce(out: Path | None) -> dict[str, Any]:
    """Three strokes; tension, hose wound in and lights in `out`."""
    reel = load_parameters("reel", ReelParameters)
    strokes = [stroke(speed) for speed in _SPEEDS_M_S]
    rows = [row for run in strokes for row in (_held(run, reel), _returned(run, reel))]
    if out is not None:
        _draw(strokes, reel, out / picture_name(ID))
    return {"id": ID, "source": _SOURCE, "rows": rows}


def _held(run: Stroke, reel: ReelParameters) -> dict[str, Any]:
    """Tension from the end of the contact's blow until the push ends."""
    during = (run.time_s >= _AFTER_CONTACT_S) & (run.time_s < run.pushed_s)
    tension, set_point = run.tension_n[during], reel.set_point_fraction * run.static_n
    ours = {
        "tension_n": float(tension.mean()),
        "lowest_n": float(tension.min()),
        "highest_n": float(tension.max()),
        "rms_percent_of_set_point": float(100.0 * np.sqrt(np.mean((tension / set_point - 1.0) ** 2))),
    }
    return {"case": f"pushed in at {run.speed_m_s} m/s", "ours": ours, "reference": {"tension_n": set_point}}


def _returned(run: Stroke, reel: ReelParameters) -> dict[str, Any]:
    after = run.time_s >= run.let_go_s
    away = np.abs(run.wound_in_m) > _SETTLED_M
    lights = [reel_light(float(q), False, reel) for q in run.wound_in_m[after]]
    ours = {
        "let_go_at_m": float(run.wound_in_m[after][0]),
        "to_full_trail_s": float(run.time_s[np.flatnonzero(away)[-1]] - run.let_go_s),
        "overshoot_m": float(-run.wound_in_m[after].min()),
        "fastest_m_s": float(-run.rate_m_s[after].min()),
        "peak_tension_n": float(run.tension_n[after].max()),
        "end_tension_n": float(run.tension_n[-1]),
        "end_m": float(run.wound_in_m[-1]),
        "green_s": lights.count(Light.GREEN) / PHYSICS_HZ,
    }
    reference = {"end_tension_n": run.static_n, "end_m": 0.0}
    return {"case": f"let go after a push at {run.speed_m_s} m/s", "ours": ours, "reference": reference}


def _draw(strokes: list[Stroke], reel: ReelParameters, path: Path) -> None:
    from matplotlib.figure import Figure

    figure = Figure(figsize=_SIZE_IN, dpi=_DPI, layout="constrained")
    panels = figure.subplots(2, len(strokes), sharex="col", sharey="row")
    for (upper, lower), run in zip(panels.T, strokes, strict=True):
        upper.plot(run.time_s, 1e-3 * run.tension_n, lw=0.9, color="tab:blue", label="tension at the exit")
        upper.axhline(1e-3 * reel.set_point_fraction * run.static_n, color="black", lw=0.7, ls="--", label="set-point")
        upper.axhline(1e-3 * run.static_n, color="black", lw=0.7, ls=":", label="static, full trail")
        lower.plot(run.time_s, run.wound_in_m, lw=1.2, color="tab:blue")
        lower.axhspan(reel.refuelling_from_m, reel.inner_limit_m, color="#d8efd3", label="green: refuelling range")
        lower.axhspan(0.0, reel.refuelling_from_m, color="#fbe7c2", label="amber")
        for axes in (upper, lower):
            axes.axvline(run.let_go_s, color="tab:red", lw=0.8, ls=":", label="coupling lets go")
        upper.set(title=f"pushed in at {run.speed_m_s} m/s", ylim=(0.0, 4.5))
        lower.set(xlabel="time since contact [s]", ylim=(-0.4, 6.5))
    panels[0, 0].set_ylabel("[kN]")
    panels[1, 0].set_ylabel("hose wound in [m]")
    panels[0, 0].legend(frameon=False, fontsize=8, loc="upper left")
    panels[1, 0].legend(frameon=False, fontsize=8, loc="upper right")
    figure.savefig(path)
