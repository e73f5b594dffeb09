"""Where the basket leads a probe that does not come in through its middle: capture, rim strike or miss.

The receiver is driven straight ahead at a constant speed, its tip beside the drogue's axis by an offset in one of five
directions from below to above, or with its nose raised or lowered. The drogue is its own mirror image, so that nothing
is fired at the other side; the picture has it hollow. The referee says from the truth what came of it.

In still air the drogue points 3.5 degrees up. A tip so far out that it passes beyond rim, tube and its own radius must
miss:

    offset > d/2 + r_rim + r_tip                                                                          (1)

Not modelled: ribs that give way.
"""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from dockair.messages import ReceiverCommand
from dockair.parameters import load_parameters
from dockair.scenarios.judgement.referee import Outcome, Referee
from dockair.scenarios.reproduce.reference import picture_name
from dockair.scenarios.reproduce.world.driven import PHYSICS_HZ, driven_world
from dockair.sim.hose.chain import DrogueParameters
from dockair.sim.hose.coupling import CouplingParameters

ID = "world/contact"
TITLE = "capture, rim strike or miss against offset, direction, speed and angle of the probe"
_SOURCE = "closed form (1) for the miss"
_SPEEDS_M_S = (0.6, 1.2, 1.8, 2.4, 2.6)  # the last is the limit of the service procedures
_OFFSETS_M = tuple(float(offset) for offset in np.arange(8) * 0.05)
_DIRECTIONS_DEG = {"below": -90.0, "below and aside": -45.0, "aside": 0.0, "above and aside": 45.0, "above": 90.0}
_NOSE_DOWN_DEG = (-10.0, -5.0, 5.0, 10.0)
_USUAL_M_S = 1.2
_GAP_M, _BEYOND_M = 0.1, 1.1  # the flight begins so far behind the ring's plane and ends so far ahead of it
_LOST_S = 0.6  # more than that: the drogue is being pushed along
_SAME_M = 1e-6  # nearer to the plane of symmetry a place is its own mirror image
_COLOURS = {Outcome.CONTACT: "tab:green", Outcome.RIM_STRIKE: "tab:red", Outcome.MISS: "tab:grey"}
_SIZE_IN, _DPI = (15.0, 3.8), 110


@dataclass(frozen=True, slots=True, kw_only=True)
class Shot:
    """One probe."""

    speed_m_s: float
    offset_m: float
    direction_deg: float
    nose_down_deg: float
    outcome: Outcome


def shoot(speed_m_s: float, offset_m: float, direction_deg: float, nose_down_deg: float = 0.0) -> Shot:
    """Drive a probe at the drogue until it is held or has passed."""
    angle = np.radians(direction_deg)
    place = (_GAP_M, -offset_m * float(np.cos(angle)), -offset_m * float(np.sin(angle)))
    world, referee = driven_world(place, pitch_rad=float(np.radians(nose_down_deg))), Referee()
    command = ReceiverCommand(velocity_m_s=np.array([speed_m_s, 0.0, 0.0]))
    longest_s = (_GAP_M + _BEYOND_M) / speed_m_s + _LOST_S
    for _ in range(round(longest_s * PHYSICS_HZ)):
        truth = world.step(command)
        referee.watch(truth)
        if truth.latched or truth.p_DP[0] > _BEYOND_M:
            break
    outcome = referee.judge(truth, "clear", truth.time_s)  # it has passed, or is held
    if outcome is None:
        raise RuntimeError("a flight that is over has an outcome")
    return Shot(
        speed_m_s=speed_m_s,
        offset_m=offset_m,
        direction_deg=direction_deg,
        nose_down_deg=nose_down_deg,
        outcome=outcome,
    )


def reproduce(out: Path | None) -> dict[str, Any]:
    """Fire them all; a map of what came of them in `out`."""
    rows, shots = [], []
    for speed in _SPEEDS_M_S:
        for name, direction in _DIRECTIONS_DEG.items():
            line = [shoot(speed, offset, direction) for offset in _OFFSETS_M]
            rows.append(_row(f"{speed} m/s, tip {name}", line, straight=True))
            shots += line
    for nose_down in _NOSE_DOWN_DEG:
        line = [shoot(_USUAL_M_S, offset, 0.0, nose_down) for offset in _OFFSETS_M]
        rows.append(_row(f"{_USUAL_M_S} m/s, tip aside, {_nose_in_words(nose_down)}", line, straight=False))
    if out is not None:
        _draw(shots, out / picture_name(ID))
    return {"id": ID, "source": _SOURCE, "rows": rows}


def miss_from_m() -> float:
    """Offset of Eq. (1)."""
    drogue, coupling = load_parameters("drogue", DrogueParameters), load_parameters("coupling", CouplingParameters)
    return 0.5 * drogue.ring_diameter_m + drogue.rim_tube_radius_m + coupling.probe_tip_radius_m


def _nose_in_words(nose_down_deg: float) -> str:
    return f"nose {abs(nose_down_deg):.0f} deg {'down' if nose_down_deg > 0.0 else 'up'}"


def _row(case: str, line: list[Shot], *, straight: bool) -> dict[str, Any]:
    ours = {
        "captured": float(sum(shot.outcome is Outcome.CONTACT for shot in line)),
        "struck_the_rim": float(sum(shot.outcome is Outcome.RIM_STRIKE for shot in line)),
        "missed": float(sum(shot.outcome is Outcome.MISS for shot in line)),
    }
    if line[0].outcome is Outcome.CONTACT:
        ours["captured_to_m"] = _captured_to_m(line)
    missed = float(sum(shot.offset_m > miss_from_m() for shot in line))
    return {"case": case, "ours": ours, "reference": {"missed": missed} if straight else {}}


def _captured_to_m(line: list[Shot]) -> float:
    """Largest offset up to which all probes are captured, the first being so."""
    lost = [k for k, shot in enumerate(line) if shot.outcome is not Outcome.CONTACT]
    return line[lost[0] - 1].offset_m if lost else line[-1].offset_m


def _draw(shots: list[Shot], path: Path) -> None:
    from matplotlib.figure import Figure

    drogue, coupling = load_parameters("drogue", DrogueParameters), load_parameters("coupling", CouplingParameters)
    figure = Figure(figsize=_SIZE_IN, dpi=_DPI, layout="constrained")
    circle = np.linspace(-np.pi, np.pi, 181)
    for axes, speed in zip(figure.subplots(1, len(_SPEEDS_M_S), sharey=True), _SPEEDS_M_S, strict=True):
        for radius in (0.5 * drogue.ring_diameter_m, coupling.socket_radius_m):
            axes.plot(radius * np.cos(circle), radius * np.sin(circle), color="black", lw=0.8)
        for outcome, colour in _COLOURS.items():
            at = [shot for shot in shots if shot.speed_m_s == speed and shot.outcome is outcome]
            angle = np.radians([shot.direction_deg for shot in at])
            offset = np.array([shot.offset_m for shot in at])
            left, up = offset * np.cos(angle), offset * np.sin(angle)
            axes.scatter(left, up, s=28.0, color=colour, label=outcome.value.replace("_", " "))
            aside = left > _SAME_M
            axes.scatter(-left[aside], up[aside], s=24.0, facecolors="none", edgecolors=colour)
        axes.set(title=f"{speed} m/s", xlabel="left of the axis [m]", xlim=(0.4, -0.4), ylim=(-0.4, 0.4))
        axes.set_aspect("equal")
    figure.axes[0].set_ylabel("above the axis [m]")
    handles, labels = figure.axes[0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside upper center", ncols=len(_COLOURS), frameon=False)
    figure.text(0.995, 0.98, "hollow: mirrored, not fired", ha="right", va="top", fontsize=9)
    figure.savefig(path)
