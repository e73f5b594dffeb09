"""The overview of all groups; the panels on one: where tips went, how fast, how often, what was known, why not."""

import math
from collections.abc import Mapping, Sequence
from textwrap import fill
from typing import Any

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.axis import Axis
from matplotlib.figure import Figure
from matplotlib.layout_engine import ConstrainedLayoutEngine
from matplotlib.patches import Circle
from matplotlib.ticker import MaxNLocator

from dockair.rotations import Array
from dockair.scenarios.report.groups import CLOSING_BAND_M_S, GOOD_CONTACT, Group, Share, counted
from dockair.scenarios.report.headings import Headings, headings_of
from dockair.scenarios.report.svg import STYLE, as_svg, say

_FRAME_M = 0.6  # half the side of the picture of where tips went
_NO_RIM = "no rim: this table does not say its radius"  # of before it was a column
_CLOSING_AXIS_M_S = 2.8
_SHARES_IN = 0.36  # height of a group's two shares
_LINE_IN = 0.15  # of a label's line
_LABEL_WIDTH = 60  # characters: a third of the picture
_ROWS_APART_IN = 0.12  # half of the gap between a label and the title below it
#: Outcomes of attempts whose tip never crossed the ring's plane; of a collision or a strike it may have, or not.
_NOT_CROSSED = ("breakaway", "given_up", "timeout", "diverged")


def overview(groups: Sequence[Group]) -> str:
    """Success of every group at the first attempt and within all, with Wilson's intervals."""
    labels = [fill(g.label + g.mark, _LABEL_WIDTH, break_long_words=False, break_on_hyphens=False) for g in groups]
    lines = max(label.count("\n") + 1 for label in labels)
    with mpl.rc_context(STYLE):
        row_in = max(_SHARES_IN, _LINE_IN * (lines + 1))
        figure = Figure(figsize=(12.0, 1.0 + row_in * len(groups)), layout="constrained")
        ax = figure.subplots()
        for k, group in enumerate(groups):
            _share(ax, k - 0.13, group.success, "tab:blue", "o", "any attempt" if k == 0 else None)
            _share(ax, k + 0.13, group.first_attempt, "tab:orange", "s", "first attempt" if k == 0 else None)
        ax.set_yticks(range(len(groups)), labels)
        ax.set_ylim(len(groups) - 0.5, -0.5)
        ax.set_xlim(-2.0, 102.0)
        ax.set_xlabel("contact inside the limits [%], 95 % interval")
        ax.grid(axis="x", alpha=0.3)
        ax.legend(loc="lower left", bbox_to_anchor=(0.0, 1.0), ncols=2, frameon=False)  # rates may be anywhere inside
        return as_svg(figure, "overview")


def panels(group: Group) -> str:
    """Five panels on one group, and a sixth where its flights kept the receiver's own heading."""
    headings = headings_of(group.flown)
    rows: list[Any] = [["where", "speed", "tries"], ["known", "why", "why" if headings is None else "heading"]]
    with mpl.rc_context(STYLE):
        figure = Figure(figsize=(12.0, 7.4), layout=ConstrainedLayoutEngine(h_pad=_ROWS_APART_IN))
        axes = figure.subplot_mosaic(rows)
        _scatter(axes["where"], group)
        _closing(axes["speed"], group)
        _by_attempt(axes["tries"], group)
        _navigation(axes["known"], group)
        _causes(axes["why"], group)
        if headings is not None:
            _headings(axes["heading"], headings)
        return as_svg(figure, "p" + group.anchor.rpartition("-")[2])  # its digest: short, for ids are many


def _share(ax: Axes, y: float, share: Share, colour: str, marker: str, label: str | None) -> None:
    low, high = share.interval
    ax.plot([100 * low, 100 * high], [y, y], color=colour, linewidth=1.5)
    ax.plot(100 * share.value, y, marker, color=colour, markersize=5, label=label)


def _scatter(ax: Axes, group: Group) -> None:
    ax.set_title("the tip in the ring's plane, or where it came nearest")
    contacts, others, short = _by_crossing(group.attempts)
    kinds = (
        (contacts, "o", "tab:blue", "contact"),
        (others, "o", "tab:red", "no contact"),
        (short, "x", "tab:red", "plane not crossed"),
    )
    for chosen, marker, colour, label in kinds:
        right, up = _places(chosen).clip(-_FRAME_M, _FRAME_M).T
        ax.scatter(
            right, up, s=12, marker=marker, color=colour, alpha=0.6, linewidths=float(marker == "x"), label=label,
            clip_on=False,
        )  # fmt: skip
    outside = int((np.abs(_places(group.attempts)) > _FRAME_M).any(axis=1).sum())
    ax.add_patch(Circle((0.0, 0.0), GOOD_CONTACT.radial_offset_m, fill=False, color="tab:green", linestyle="--"))
    for rim_m in group.rims_m:
        ax.add_patch(Circle((0.0, 0.0), rim_m, fill=False, color="black"))
    if not group.rims_m:
        ax.text(0.0, -0.95 * _FRAME_M, _NO_RIM, ha="center", color="tab:gray", fontsize=7)
    frame = (-_FRAME_M, _FRAME_M)
    beyond = f"; {outside} beyond, on the frame" if outside else ""
    ax.set(xlim=frame, ylim=frame, aspect="equal", xlabel=f"right [m], seen from behind{beyond}", ylabel="up [m]")
    ax.legend(loc="upper right", frameon=False)


def _by_crossing(attempts: Sequence[Mapping[str, Any]]) -> tuple[list[Any], list[Any], list[Any]]:
    """Return the contacts, what else may have crossed the ring's plane, and what has not."""
    contacts = [a for a in attempts if a["outcome"] == "contact"]
    short = [a for a in attempts if a["outcome"] in _NOT_CROSSED]
    return contacts, [a for a in attempts if a["outcome"] not in ("contact", *_NOT_CROSSED)], short


def _places(attempts: Sequence[Mapping[str, Any]]) -> Array:
    """(n, 2) right and up of the drogue's axis [m], of those that have a place."""
    places = np.array([[-_number(a.get("left_m")), _number(a.get("up_m"))] for a in attempts]).reshape(-1, 2)
    return np.asarray(places[np.isfinite(places).all(axis=1)])


def _closing(ax: Axes, group: Group) -> None:
    ax.set_title("closing speed of the contacts")
    if not group.contacts:
        say(ax, "no contact")
        return
    ax.axvspan(*CLOSING_BAND_M_S, color="tab:green", alpha=0.12)
    ax.axvline(GOOD_CONTACT.closure_speed_m_s, color="tab:red", linestyle="--")
    speeds = group.closing_m_s
    outside = int(((speeds < 0.0) | (speeds > _CLOSING_AXIS_M_S)).sum())
    bins = np.linspace(0.0, _CLOSING_AXIS_M_S, 57)
    ax.hist(speeds.clip(0.0, _CLOSING_AXIS_M_S), bins=list(bins), color="tab:blue")
    beyond = f"; {outside} beyond, in the end bins" if outside else ""
    ax.set(xlabel=f"[m/s]; band of practice, limit{beyond}", ylabel="contacts", xlim=(0.0, _CLOSING_AXIS_M_S))
    ax.yaxis.set_major_locator(_whole_numbers())


def _by_attempt(ax: Axes, group: Group) -> None:
    ax.set_title("contact inside the limits within n attempts" + group.mark)
    most = max((row["attempts"] for row in group.flown), default=1)
    for n in range(1, max(most, 1) + 1):
        share = group.within(n)
        low, high = share.interval
        ax.plot([n, n], [100 * low, 100 * high], color="tab:blue")
        ax.plot(n, 100 * share.value, "o", color="tab:blue")
    ax.set(xlabel="n", ylabel="[%]", ylim=(-2.0, 102.0), xlim=(0.5, max(most, 1) + 0.5))
    ax.set_xticks(range(1, max(most, 1) + 1))
    ax.grid(axis="y", alpha=0.3)


def _navigation(ax: Axes, group: Group) -> None:
    ax.set_title("navigation error (lines), expected (dashed)")
    bins = group.by_range
    if not bins:
        say(ax, "no frames were used")
        return
    middle = [0.5 * (entry["low_m"] + entry["high_m"]) for entry in bins]
    for name, colour in (("range", "tab:blue"), ("lateral", "tab:orange")):
        ax.plot(middle, [1e3 * entry[f"{name}_rmse_m"] for entry in bins], "o-", color=colour, label=name, markersize=3)
        ax.plot(middle, [1e3 * entry[f"{name}_sigma_m"] for entry in bins], "--", color=colour)
    ax.set(xlabel="range from the camera [m]", ylabel="RMS [mm]", xscale="log", yscale="log")
    _ticks(ax.xaxis, (1, 2, 3, 5, 7, 10, 20), 2, 20)
    _ticks(ax.yaxis, (0.1, 0.3, 1, 3, 10, 30, 100, 300, 1000, 3000, 10_000), 0.3, 100)
    ax.minorticks_off()
    ax.grid(alpha=0.3)
    ax.legend(frameon=False)


def _causes(ax: Axes, group: Group) -> None:
    ax.set_title("why attempts failed, and why flights began none")
    if not group.causes and not group.causes_without_attempt:
        say(ax, "none failed")
        return
    kinds = (
        (group.causes, "tab:red", "attempts"),
        (group.endings_without_attempt, "tab:purple", "flights without one"),
    )
    names: list[str] = []
    for causes, colour, label in kinds:
        if causes:
            places = range(len(names), len(names) + len(causes))
            bars = ax.barh(places, [count for _, count in causes], color=colour, alpha=0.7, label=label)
            ax.bar_label(bars, padding=2)
            names += [name.replace("_", " ").replace(": ", ":\n") for name, _ in causes]
    ax.set_yticks(range(len(names)), names)
    ax.set_ylim(max(len(names), 4) - 0.5, -0.5)  # one bar alone is no wall
    ax.set_xlabel("number")
    ax.xaxis.set_major_locator(_whole_numbers())
    ax.legend(ncols=2, frameon=False, fontsize=7, loc="upper center", bbox_to_anchor=(0.5, -0.16))


def _headings(ax: Axes, headings: Headings) -> None:
    ax.set_title(f"own heading against the truth, {counted(headings.flights, 'flight')}")
    for values, colour, label in (
        (headings.at_end_deg, "tab:blue", "at the end"),
        (headings.largest_deg, "tab:orange", "largest of the flight"),
    ):
        sizes = np.abs(values[np.isfinite(values)])
        if len(sizes):
            ax.ecdf(sizes, color=colour, label=label)
    expected = headings.sigma_deg[np.isfinite(headings.sigma_deg)]
    if len(expected):
        ax.axvline(float(np.median(expected)), color="tab:blue", linestyle="--", label="expected at the end (median)")
    lost = f"; {headings.lost} lost at the end" if headings.lost else ""
    ax.set(xlabel=f"size of the error [deg]{lost}", ylabel="share of the flights", ylim=(-0.02, 1.02))
    ax.set_xlim(left=0.0)
    ax.legend(frameon=False, fontsize=7, loc="lower right")


def _ticks(axis: Axis, ticks: Sequence[float], low: float, high: float) -> None:
    """Set the ticks from low to high, and those beyond, as far as there are values."""
    first, last = axis.get_data_interval()
    chosen = [tick for tick in ticks if min(low, first) <= tick <= max(high, last)]
    axis.set_ticks(chosen, [f"{tick:g}" for tick in chosen])


def _whole_numbers() -> MaxNLocator:
    return MaxNLocator(integer=True, min_n_ticks=1)  # with more of them asked for, few counts would get fractions


def _number(value: Any) -> float:
    return math.nan if value is None else float(value)
