"""Hose whip: a probe engages at three speeds, with a working and with a dead reel, and stops over three metres.

The receiver is driven: it comes in at a constant speed, and from the moment at which the coupling holds it slows down
evenly to a stop, as a pilot does who has made contact. The hose it pushes ahead must go somewhere. A working reel takes
it in; with a dead one it bows, until the slack snaps back along it.

What counts as whip here: after contact the tension at the exit goes beyond 1.5 of its static value, or the hose bows by
0.5 m more than at rest. Bow is the greatest distance of the hose, outside the pod, from the straight line between the
exit and its end. No source that could be read has a threshold; that too fast a contact or a dead reel whips the hose is
said by all, and that an inflection of the hose makes it worse by [Liggieri 2012].

The coupling's own limit of closing speed is lifted for all runs, or it would refuse the fastest. Drogue and hose are
in still air.

Not modelled: stretch of the hose between its ends, so that the blow of the contact reaches all of it at once: the
pushes of the first hundredths of a second are upper bounds. A hose of axial stiffness EA would pass on
v sqrt(EA mu), 3 kN at 1.2 m/s for the 1.5 MN that the sheet of the reel assumes.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from dockair.messages import ReceiverCommand
from dockair.parameters import read_sheet
from dockair.rotations import Array
from dockair.scenarios.reproduce.reference import picture_name
from dockair.scenarios.reproduce.world.driven import PHYSICS_HZ, driven_world

ID = "world/whip"
TITLE = "hose tension after contact at 1.2, 2.6 and 4 m/s, with a working and with a dead reel"
_SOURCE = "[Liggieri 2012], [Aerospace 2024, 11(1) 13]: that a dead reel or too fast a contact whips the hose"
SPEEDS_M_S = (1.2, 2.6, 4.0)
_STOP_M = 3.0  # over which the receiver slows down: to the middle of the refuelling range
_GAP_M, _DURATION_S = 0.2, 8.0
_SHAPE_TICKS = 10  # between two shapes of the hose that are kept
_WHIP_TENSION, _WHIP_BOW_M = 1.5, 0.5
_SLACK = 0.05  # of the static tension
_SIZE_IN, _DPI = (12.0, 8.0), 110


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Engagement:
    """One run, a row a tick from the moment at which the coupling holds; shapes every tenth tick."""

    speed_m_s: float
    dead: bool
    static_n: float
    tension_n: Array  #: (n,) at the exit
    coupling_n: Array  #: (n,) pull on the probe, negative while it pushes
    wound_in_m: Array  #: (n,)
    latched: Array  #: (n,)
    p_WH: Array  #: (n / 10, joints, 3)

    @property
    def time_s(self) -> Array:
        """(n,) since the coupling holds."""
        return np.arange(len(self.tension_n)) / PHYSICS_HZ

    @property
    def let_go_s(self) -> float:
        """When the coupling lets go; NaN if it never does."""
        return float("nan") if self.latched.all() else float(np.argmin(self.latched) / PHYSICS_HZ)

    @property
    def bow_m(self) -> Array:
        """(n / 10,) of each shape."""
        return np.array([bow(shape) for shape in self.p_WH])

    @property
    def whips(self) -> bool:
        """Whether the hose does."""
        beyond = float(self.tension_n.max()) > _WHIP_TENSION * self.static_n
        return beyond or float(self.bow_m.max() - self.bow_m[0]) > _WHIP_BOW_M


def bow(p_WH: Array) -> float:
    """Greatest distance of the joints (n, 3) outside the pod from the line between exit and hose's end [m]."""
    along = p_WH[-1] / np.linalg.norm(p_WH[-1])
    outside = p_WH[p_WH[:, 0] <= 0.0]
    return float(np.linalg.norm(outside - np.outer(outside @ along, along), axis=1).max(initial=0.0))


def engage(
    speed_m_s: float,
    *,
    dead: bool,
    duration_s: float = _DURATION_S,
    overrides: Mapping[str, Mapping[str, float]] | None = None,
) -> Engagement:
    """Drive the probe into the coupling and stop.

    Args:
        speed_m_s: at contact.
        dead: the reel is.
        duration_s: after contact.
        overrides: of the sheets' values, by sheet.
    """
    highest = read_sheet("coupling")["closing_speed_max_m_s"].high
    sheets = {"coupling": {"closing_speed_max_m_s": highest}, **(overrides or {})}
    world = driven_world((_GAP_M, 0.0, 0.0), dead_from_s=0.0 if dead else np.inf, overrides=sheets)
    while not world.truth.latched:
        world.step(_forward(speed_m_s))
        if world.truth.p_DP[0] > 1.0:
            raise RuntimeError("the probe has passed the coupling")
    deceleration = speed_m_s**2 / (2.0 * _STOP_M)
    rows, shapes = [], []
    for tick in range(round(duration_s * PHYSICS_HZ)):
        if tick % _SHAPE_TICKS == 0:
            shapes.append(world.truth.p_WH)
        truth = world.step(_forward(max(speed_m_s - deceleration * tick / PHYSICS_HZ, 0.0)))
        rows.append((truth.root_tension_n, truth.coupling_force_n, truth.reel_position_m, float(truth.latched)))
    tension, coupling, wound_in, latched = np.array(rows).T
    return Engagement(
        speed_m_s=speed_m_s,
        dead=dead,
        static_n=world.rest.root_tension_n,
        tension_n=tension,
        coupling_n=coupling,
        wound_in_m=wound_in,
        latched=latched > 0.5,
        p_WH=np.array(shapes),
    )


def _forward(speed_m_s: float) -> ReceiverCommand:
    return ReceiverCommand(velocity_m_s=np.array([speed_m_s, 0.0, 0.0]))


def reproduce(out: Path | None) -> dict[str, Any]:
    """Six engagements; tensions and shapes in `out`."""
    runs = [engage(speed, dead=dead) for speed in SPEEDS_M_S for dead in (False, True)]
    if out is not None:
        _draw(runs, out / picture_name(ID))
    return {"id": ID, "source": _SOURCE, "rows": [_row(run) for run in runs]}


def _row(run: Engagement) -> dict[str, Any]:
    ours = {
        "static_tension_n": run.static_n,
        "peak_tension_n": float(run.tension_n.max()),
        "peak_over_static": float(run.tension_n.max() / run.static_n),
        "peak_at_s": float(run.time_s[run.tension_n.argmax()]),
        "slack_s": float((run.tension_n < _SLACK * run.static_n).mean() * len(run.tension_n) / PHYSICS_HZ),
        "greatest_bow_m": float(run.bow_m.max()),
        "bow_at_rest_m": float(run.bow_m[0]),
        "wound_in_m": float(run.wound_in_m.max()),
        "peak_push_n": float(-run.coupling_n.min()),
        "whips": float(run.whips),
    }
    if np.isfinite(run.let_go_s):
        ours["let_go_s"] = run.let_go_s
    reel = "dead reel" if run.dead else "working reel"
    return {"case": f"{run.speed_m_s} m/s, {reel}", "ours": ours, "reference": {}}


def _draw(runs: list[Engagement], path: Path) -> None:
    from matplotlib.figure import Figure

    figure = Figure(figsize=_SIZE_IN, dpi=_DPI, layout="constrained")
    panels = figure.subplots(3, len(SPEEDS_M_S), height_ratios=(1.3, 1.0, 1.0))
    for run in runs:
        column = panels[:, SPEEDS_M_S.index(run.speed_m_s)]
        colour, name = ("tab:red", "dead reel") if run.dead else ("tab:blue", "working reel")
        column[0].plot(run.time_s, 1e-3 * run.tension_n, lw=0.9, color=colour, label=name)
        if np.isfinite(run.let_go_s):
            column[0].axvline(run.let_go_s, color=colour, lw=0.7, ls=":", label="coupling lets go")
        _draw_shapes(column[2 if run.dead else 1], run, name)
    for axes, speed in zip(panels[0], SPEEDS_M_S, strict=True):
        axes.axhline(1e-3 * _WHIP_TENSION * runs[0].static_n, color="black", lw=0.7, ls="--", label="1.5 of static")
        axes.set(title=f"contact at {speed} m/s, stopped over {_STOP_M:.0f} m", xlabel="time since contact [s]")
        axes.set(xlim=(-0.1, 5.0), ylim=(-3.0, 16.0))
        axes.legend(frameon=False, fontsize=8, loc="upper right")
    panels[0, 0].set_ylabel("tension at the exit [kN]")
    figure.savefig(path)


def _draw_shapes(axes: Any, run: Engagement, name: str) -> None:
    for time_s, shade in ((0.0, 0.8), (0.25, 0.6), (0.75, 0.4), (1.5, 0.2), (2.5, 0.0)):
        shape = run.p_WH[round(time_s * PHYSICS_HZ / _SHAPE_TICKS)]
        axes.plot(shape[:, 0], shape[:, 2], lw=1.2, color=str(shade), label=f"{time_s:.2f} s")
    axes.set(title=f"hose from the side, {name}", xlim=(-16.0, 4.0), ylim=(-6.5, 2.0), xlabel="x [m]")
    axes.set_xticks(range(-15, 5, 5))
    axes.set_aspect("equal")
    if run.speed_m_s == SPEEDS_M_S[0]:
        axes.set_ylabel("z [m]")
        axes.legend(frameon=False, fontsize=7, loc="lower right")
