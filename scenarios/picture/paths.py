"""Where the probe's tip went: from the left side, and as the receiver sees it, against the drogue's basket.

Both are the truth. From the side, axes are level along the tanker's heading, from the hose's exit; as the receiver sees
it, they are the drogue's, so that the place where the tip crosses the ring's plane is the miss that the referee judges.
"""

from typing import Any

import numpy as np

from dockair.rotations import Array
from dockair.scenarios.judgement.attempts import RefereeLimits
from dockair.scenarios.picture.columns import attitude, contact, level_axes, values, vectors

TIP, HOSE, GREY, PROBE = "#1f77b4", "#3a3a3a", "#9a9a9a", "#c0392b"
_FROM_M = 3.0  # the last metres before the ring are shown as the receiver sees them
_PROBE_M = 1.0
_HALF_OF_RIM = 1.2  # least half of the view along the drogue's axis: rim and a little more


def draw_side_view(axes: Any, flight: Any, limits: RefereeLimits) -> None:
    """Draw hose, drogue with its rim and probe at contact, and the paths of drogue and tip."""
    R_EW, p_WE = level_axes(flight)
    held, moment = contact(flight)
    tip, drogue = (R_EW.apply(vectors(flight, name) - p_WE) for name in ("truth_p_WP", "truth_p_WD"))
    hose = R_EW[moment].apply(np.array(flight["truth_p_WH_m"][moment].as_py()).reshape(-1, 3) - p_WE[moment])
    ahead = max(drogue[:, 0].max(), hose[-1, 0])
    wide = max(ahead - tip[:, 0].min(), _PROBE_M)  # a tip may have been ahead of the hose's end all the while
    hose = hose[hose[:, 0] < ahead + 0.3 * wide]  # what is on to the pod would make the rest small
    R_ED, R_EB = (R_EW[moment] * attitude(flight, name)[moment] for name in ("truth_q_WD", "truth_q_WB"))
    rim = limits.rim_radius_m * R_ED.apply([0.0, 0.0, 1.0])
    basket = np.array([drogue[moment] + rim, hose[-1], drogue[moment] - rim])
    probe = tip[moment] + np.outer([0.0, -_PROBE_M], R_EB.apply([1.0, 0.0, 0.0]))

    axes.plot(drogue[:, 0], drogue[:, 2], color=GREY, lw=0.8, label="drogue's path")
    axes.plot(tip[moment:, 0], tip[moment:, 2], color=TIP, lw=0.9, alpha=0.45, label="tip's path, after")
    axes.plot(tip[: moment + 1, 0], tip[: moment + 1, 2], color=TIP, lw=1.8, label="tip's path, before")
    axes.plot(*tip[0, [0, 2]], marker="o", ms=5, color=TIP, ls="none")
    axes.fill(basket[:, 0], basket[:, 2], color=HOSE, alpha=0.25, lw=0.0)
    axes.plot(basket[:, 0], basket[:, 2], color=HOSE, lw=1.5)
    axes.plot(hose[:, 0], hose[:, 2], color=HOSE, lw=3.0, solid_capstyle="round", label="hose and basket")
    axes.plot(probe[:, 0], probe[:, 2], color=PROBE, lw=3.0, solid_capstyle="round", label="probe")

    axes.annotate("to the pod", hose[0, [0, 2]], xytext=(0, 6), textcoords="offset points", ha="right", fontsize=8)
    axes.set(xlabel="forward of the pod [m]", ylabel="up [m]")
    axes.margins(0.02, 0.1)
    axes.set_aspect("equal", adjustable="datalim")
    axes.set_title(f"From the left, {_moment_words(flight, held, moment)}", fontsize=10)
    axes.legend(loc="best", fontsize=8, frameon=False)
    axes.tick_params(labelsize=8)


def draw_along_axis(figure: Any, axes: Any, flight: Any, limits: RefereeLimits) -> None:
    """Draw the tip's last metres before the ring as the receiver sees them, with the basket's rim and the limit."""
    p_DP = tip_in_drogue_axes(flight)
    p_DP = p_DP[: path_end(p_DP[:, 0], *contact(flight)) + 1]
    begin = approach_begin(p_DP[:, 0])
    path = p_DP[begin:]
    angle = np.linspace(0.0, 2.0 * np.pi, 97)
    for radius, style in ((limits.rim_radius_m, "-"), (limits.radial_offset_m, "--")):
        axes.plot(radius * np.cos(angle), radius * np.sin(angle), color=HOSE, lw=1.2, ls=style)
    outer = max(limits.rim_radius_m, limits.radial_offset_m)
    above, below = f"rim, {limits.rim_radius_m:.2f} m", f"dashed: good docking, {limits.radial_offset_m:.2f} m"
    for height, words, side in ((outer, above, "bottom"), (-outer, below, "top")):  # after a wide miss they are small
        axes.text(0.0, height, words, fontsize=7, ha="center", va=side)
    to_go = np.maximum(-path[:, 0], 0.0)
    points = axes.scatter(path[:, 1], path[:, 2], c=to_go, cmap="viridis", s=5, vmin=0.0, zorder=3)
    crossing = ring_crossing(path[:, 0])
    end, where = (path[-1], "nearest") if crossing is None else (path[crossing], "in the ring's plane")
    axes.plot(end[1], end[2], marker="x", ms=9, mew=2.2, color=PROBE, ls="none", zorder=4)
    half = max(_HALF_OF_RIM * limits.rim_radius_m, 1.1 * float(np.abs(path[:, 1:]).max()))
    axes.set(xlim=(half, -half), ylim=(-half, half), xlabel="left [m]", ylabel="up [m]")
    axes.set_aspect("equal")
    axes.set_title(f"From behind, along the drogue's axis ($\\times$: {where})", fontsize=9)
    axes.tick_params(labelsize=8)
    bar = figure.colorbar(points, ax=axes, shrink=0.9)
    bar.set_label("to go [m]", fontsize=8)
    bar.ax.tick_params(labelsize=8)


def tip_in_drogue_axes(flight: Any) -> Array:
    """(ticks, 3) p_DP [m]: forward, left and up of the ring's centre."""
    apart_W = vectors(flight, "truth_p_WP") - vectors(flight, "truth_p_WD")
    return np.asarray(attitude(flight, "truth_q_WD").inv().apply(apart_W))


def approach_begin(forward_m: Array) -> int:
    """Return the tick at which the tip last came nearer than _FROM_M behind the ring; the first if it always was."""
    farther = np.flatnonzero(forward_m < -_FROM_M)
    return int(farther[-1]) + 1 if len(farther) and farther[-1] + 1 < len(forward_m) else 0


def path_end(forward_m: Array, held: bool, moment: int) -> int:
    """Return the tick at which the way to the ring ends, from the one of the hold or of the nearest point.

    A tip that goes apart from the drogue's axis is nearest before it comes into the ring's plane, where the referee
    takes its miss: the way goes on to there, if it does not go back over _FROM_M first.
    """
    if held or forward_m[moment] >= 0.0:
        return moment
    ends = np.flatnonzero((forward_m[moment:] >= 0.0) | (forward_m[moment:] < -_FROM_M))
    return moment + int(ends[0]) if len(ends) and forward_m[moment + ends[0]] >= 0.0 else moment


def ring_crossing(forward_m: Array) -> int | None:
    """Return the tick at which the tip last came into the ring's plane or beyond, from behind; None if it never did."""
    came = np.flatnonzero((forward_m[:-1] < 0.0) & (forward_m[1:] >= 0.0))
    return int(came[-1]) + 1 if len(came) else None


def _moment_words(flight: Any, held: bool, moment: int) -> str:
    time_s = values(flight, "time_s")[moment]
    phase = flight["nav_phase"][moment].as_py().replace("_", " ")
    return f"at contact, {time_s:.1f} s" if held else f"where it was nearest ({phase}), {time_s:.1f} s"
