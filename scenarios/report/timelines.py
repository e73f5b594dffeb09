"""The phases of a group's flights over time, a bar a flight, named by its seed."""

import json
from collections.abc import Sequence

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Patch

from dockair.scenarios.report.groups import Group, Row
from dockair.scenarios.report.svg import STYLE, as_svg

_SHOWN = 40  # flights
_LONG_SHARE, _LONG_TIMES = 0.9, 1.25  # the axis ends at so many times the duration that this share stays below
_COLOURS = {
    "join_up": "#d9d9d9",
    "pre_contact": "#9ecae1",
    "approach": "#3182bd",
    "contact": "#a1d99b",
    "hold": "#31a354",
    "disconnect": "#c7c0e4",
    "back_off": "#fdae6b",
    "breakaway": "#de2d26",
    "clear": "#636363",
}
_OTHER = "black"  # a phase of a navigator of one's own

Span = tuple[str, float, float]  # phase, begin and end [s]


def timelines(group: Group) -> str:
    """Return the picture of the first flights, "" where no phases were recorded."""
    shown = [(row, spans) for row in group.flown[:_SHOWN] if (spans := spans_of(row))]
    if not shown:
        return ""
    durations_s = [row["duration_s"] for row, _ in shown]
    limit_s = axis_end(durations_s)
    with mpl.rc_context(STYLE):
        figure = Figure(figsize=(12.0, 1.1 + 0.14 * len(shown)), layout="constrained")
        ax = figure.subplots()
        for k, (_, spans) in enumerate(shown):
            _bar(ax, k, spans)
        beyond = [(k, end_s) for k, end_s in enumerate(durations_s) if end_s > limit_s]
        for k, end_s in beyond:
            ax.text(limit_s, k, f" until {end_s:.0f} s", fontsize=7, va="center")
        part = f"the first {_SHOWN} of {len(group.flown)} flights" if len(group.flown) > _SHOWN else "the flights"
        more = f"; {len(beyond)} run on" if beyond else ""
        ax.set_title(f"phases of {part}")
        ax.set(xlabel=f"time since the start [s]{more}", ylabel="seed", xlim=(0.0, limit_s))
        ax.set_yticks(range(len(shown)), [str(row["seed"]) for row, _ in shown], fontsize=7)
        ax.set_ylim(len(shown) - 0.4, -0.6)
        seen = {phase for _, spans in shown for phase, _, _ in spans}
        names = [*(p for p in _COLOURS if p in seen), *sorted(seen - _COLOURS.keys())]
        keys = [Patch(color=_COLOURS.get(name, _OTHER), label=name.replace("_", " ")) for name in names]
        figure.legend(handles=keys, ncols=len(_COLOURS), frameon=False, fontsize=8, loc="outside lower center")
        return as_svg(figure, "t" + group.anchor.rpartition("-")[2])


def spans_of(row: Row) -> list[Span]:
    """Return a flight's phases in their order; the last ends with the flight."""
    entries = json.loads(row.get("timeline") or "[]")
    ends_s = [*(entry["begun_s"] for entry in entries[1:]), row["duration_s"]]
    return [(entry["phase"], entry["begun_s"], end_s) for entry, end_s in zip(entries, ends_s, strict=False)]


def axis_end(durations_s: Sequence[float]) -> float:
    """Return where the axis ends [s]: with the longest flight, unless that is much longer than most."""
    return min(max(durations_s), _LONG_TIMES * float(np.quantile(durations_s, _LONG_SHARE)))


def _bar(ax: Axes, k: int, spans: Sequence[Span]) -> None:
    lengths = [(begin_s, end_s - begin_s) for _, begin_s, end_s in spans]
    ax.broken_barh(lengths, (k - 0.42, 0.84), facecolors=[_COLOURS.get(phase, _OTHER) for phase, _, _ in spans])
