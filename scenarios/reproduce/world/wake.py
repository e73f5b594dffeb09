"""The tanker's wake beside closed forms: on the axis, across a core, of the whole sheet; and what it does to the hose.

On the axis: Gamma/(pi b_v) (1 + sqrt(x^2 + (b_v/2)^2)/x), cores and tail left out on both sides. Across a core far
behind: two Hallock-Burnham vortices. Of a finely divided sheet: Prandtl's elliptic wing, Gamma/(2 b) and Gamma/b. The
drogue's reference hangs in a uniform stream, turned down as the wake turns it halfway along the hose.
"""

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from dockair.parameters import load_parameters
from dockair.rotations import Array
from dockair.scenarios.reproduce.reference import picture_name
from dockair.scenarios.reproduce.world.tow_at_rest import TowAtRest, tow_at_rest
from dockair.sim.air.atmosphere import Air, standard_atmosphere
from dockair.sim.air.wake import WakeParameters, circulation_m2_s, wake_coefficients, wake_velocity
from dockair.sim.hose.chain import DrogueParameters, HoseParameters
from dockair.sim.outlines import TankerParameters

ID = "world/wake"
TITLE = "the tanker's wake: field, downwash on the axis, hose and drogue in it"
_SOURCE = "Biot-Savart with cores of [Burnham & Hallock 1982]; Prandtl's elliptic wing"
_FLIGHTS = ((180.0, 6000.0), (120.0, 3000.0))  # airspeed [m/s], altitude [m]
_BEHIND_M = (10.0, 20.0, 34.0, 50.0)
_FAR_M, _FINE = 1e6, 4000
_SIZE_IN, _DPI = (12.0, 7.0), 110
_Row = dict[str, Any]


def reproduce(out: Path | None) -> dict[str, Any]:
    """Compare the wake with closed forms; its picture in `out`."""
    tankers = [_Tanker(*flight) for flight in _FLIGHTS]
    rows = [_axis(tankers[0]), *_cores(tankers[0]), _sheet(tankers[0]), *(_tow(tanker) for tanker in tankers)]
    if out is not None:
        _draw(out / picture_name(ID), tankers[0])
    return {"id": ID, "source": _SOURCE, "rows": rows}


class _Tanker:
    """The default tanker in one flight condition, and its wake."""

    def __init__(self, airspeed_m_s: float, altitude_m: float) -> None:
        self.airspeed_m_s, self.altitude_m = airspeed_m_s, altitude_m
        self.air, self.sheet = standard_atmosphere(altitude_m), load_parameters("wake", WakeParameters)
        self.body = load_parameters("tanker", TankerParameters)
        self.span_m = self.body.span_m
        self.half_m = 0.5 * self.sheet.vortex_span_fraction * self.span_m
        #: the wing's vortices alone, their bound part through the origin, all but without cores
        self.thin = replace(
            self.sheet, bound_m=np.zeros(3), tail_circulation_fraction=0.0, core_fraction=1e-9, core_growth=0.0
        )
        self.gamma = circulation_m2_s(self.thin, self.body.mass_kg, self.span_m, airspeed_m_s, self.air)

    def velocity(self, sheet: WakeParameters, points_T: Array, *, viscous: bool = True) -> Array:
        """(n, 3) velocity in T."""
        air: Air = self.air if viscous else replace(self.air, kinematic_viscosity_m2_s=0.0)
        mass_kg, speed = self.body.mass_kg, self.airspeed_m_s
        k = wake_coefficients(sheet, mass_kg=mass_kg, span_m=self.span_m, airspeed_m_s=speed, air=air)
        return np.asarray(wake_velocity(np.ascontiguousarray(points_T), k))

    def downwash(self, behind_m: Array, *, filaments: int = 1, whole: bool = False) -> Array:
        """Downwash on the axis at distances behind the bound vortex; `whole`: with cores and tail as flown."""
        points = np.outer(-np.asarray(behind_m), [1.0, 0.0, 0.0])
        if whole:
            return -self.velocity(self.sheet, points + self.sheet.bound_m)[:, 2]
        return -self.velocity(replace(self.thin, filaments=filaments), points, viscous=False)[:, 2]

    def closed_form(self, behind_m: Array) -> Array:
        """Downwash of the horseshoe on the axis."""
        x = np.asarray(behind_m)
        return np.asarray(self.gamma / (2.0 * np.pi * self.half_m) * (1.0 + np.hypot(x, self.half_m) / x))


def _axis(tanker: _Tanker) -> _Row:
    names = [f"downwash_{behind:g}_m_behind_m_s" for behind in _BEHIND_M]
    ours, theirs = tanker.downwash(np.array(_BEHIND_M)), tanker.closed_form(np.array(_BEHIND_M))
    return {
        "case": "on the axis, one horseshoe, no cores",
        "ours": dict(zip(names, (float(w) for w in ours), strict=True)),
        "reference": dict(zip(names, (float(w) for w in theirs), strict=True)),
    }


def _cores(tanker: _Tanker) -> list[_Row]:
    """Swirl of the left leg far behind, its core not grown, at parts of the core's radius outboard."""
    core = tanker.sheet.core_fraction * tanker.span_m
    young = replace(tanker.thin, core_fraction=tanker.sheet.core_fraction)
    rows = []
    for over_core in (0.5, 1.0, 3.0):
        r, other = over_core * core, 2.0 * tanker.half_m + over_core * core
        point = np.array([[-_FAR_M, tanker.half_m + r, 0.0]])
        swirl = [d / (d * d + core * core) * tanker.gamma / (2.0 * np.pi) for d in (r, other)]
        rows.append(
            {
                "case": f"far behind, {over_core:g} core radii outboard of a leg",
                "ours": {"upwash_m_s": float(tanker.velocity(young, point, viscous=False)[0, 2])},
                "reference": {"upwash_m_s": float(swirl[0] - swirl[1])},
            }
        )
    return rows


def _sheet(tanker: _Tanker) -> _Row:
    """Downwash on the axis of the sheet as shed: at the wing and far behind, and the rolled-up pair's part of it."""
    elliptic = tanker.gamma / tanker.span_m
    wing, far = tanker.downwash(np.array([0.0, _FAR_M]), filaments=_FINE)
    pair = tanker.downwash(np.array([_FAR_M]))[0]
    ours = {"at_wing_m_s": float(wing), "far_behind_m_s": float(far), "rolled_up_over_sheet": float(pair / elliptic)}
    reference = {
        "at_wing_m_s": 0.5 * elliptic,
        "far_behind_m_s": elliptic,
        "rolled_up_over_sheet": 8.0 / np.pi**2,
    }
    return {"case": f"elliptic sheet in {_FINE} filaments", "ours": ours, "reference": reference}


def _at_rest(tanker: _Tanker, wind_W: Array, in_wake: bool) -> TowAtRest:
    hose, drogue = load_parameters("hose", HoseParameters), load_parameters("drogue", DrogueParameters)
    exit_T = tanker.body.exit_m

    def motion(places: Array) -> Array:
        return tanker.velocity(tanker.sheet, places + exit_T) if in_wake else np.zeros_like(places)

    return tow_at_rest(hose, drogue, wind_W, tanker.air, motion)


def _tow(tanker: _Tanker) -> _Row:
    """Hose and drogue in the wake, from the tanker's own exit."""
    wind_W = np.array([-tanker.airspeed_m_s, 0.0, 0.0])
    still, ours = _at_rest(tanker, wind_W, False), _at_rest(tanker, wind_W, True)
    middle = ours.p_WH[len(ours.p_WH) // 2]
    down = float(tanker.velocity(tanker.sheet, (middle + tanker.body.exit_m)[None])[0, 2])
    turned = _at_rest(tanker, wind_W + np.array([0.0, 0.0, down]), False)

    def told(rest: TowAtRest) -> dict[str, float]:
        x, _, z = (float(c) for c in rest.p_WD - still.p_WD)
        return {"forward_m": x, "sinks_m": -z, "root_tension_n": rest.root_tension_n}

    told_ours = told(ours) | {"downwash_at_middle_m_s": -down}
    case = f"drogue at rest in the wake, {tanker.airspeed_m_s:g} m/s, {tanker.altitude_m:g} m, less in still air"
    return {"case": case, "ours": told_ours, "reference": told(turned)}


def _draw(path: Path, tanker: _Tanker) -> None:
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure: Any = Figure(figsize=_SIZE_IN, dpi=_DPI, layout="constrained")
    FigureCanvasAgg(figure)
    panels = figure.subplot_mosaic([["plane", "axis"], ["across", "axis"]], width_ratios=(1.45, 1.0))
    plane, axis, across = panels["plane"], panels["axis"], panels["across"]
    drogue_T = tanker.body.exit_m + _at_rest(tanker, np.array([-tanker.airspeed_m_s, 0.0, 0.0]), True).p_WD
    _draw_plane(figure, plane, tanker, drogue_T)
    _draw_axis(axis, tanker)
    y = np.linspace(-30.0, 30.0, 301)
    for filaments, colour in ((1, "#1f77b4"), (16, "#ff7f0e")):
        points = np.column_stack([np.full(y.shape, drogue_T[0]), y, np.full(y.shape, drogue_T[2])])
        sheet = replace(tanker.sheet, filaments=filaments)
        label = "rolled up" if filaments == 1 else f"{filaments} filaments"
        across.plot(y, tanker.velocity(sheet, points)[:, 2], color=colour, label=label)
    across.axvline(drogue_T[1], color="#777777", linewidth=0.8, linestyle=":")
    across.set(title="Up-flow across, in the drogue's place", xlabel="left of the axis [m]", ylabel="m/s")
    across.legend(fontsize=8)
    across.grid(alpha=0.3)
    figure.savefig(path)


def _draw_plane(figure: Any, axes: Any, tanker: _Tanker, drogue_T: Array) -> None:
    y, z = np.linspace(-30.0, 30.0, 121), np.linspace(-16.0, 12.0, 57)
    grid = np.stack([np.full((len(z), len(y)), drogue_T[0]), *np.meshgrid(y, z)], axis=-1)
    v = tanker.velocity(tanker.sheet, grid.reshape(-1, 3)).reshape(len(z), len(y), 3)
    limit = 10.0
    shades = axes.contourf(
        y, z, np.clip(v[:, :, 2], -limit, limit), levels=np.linspace(-limit, limit, 21), cmap="RdBu_r"
    )
    few = (slice(None, None, 4), slice(None, None, 4))
    axes.quiver(y[::4], z[::4], v[:, :, 1][few], v[:, :, 2][few], scale=180.0, width=0.0022, color="#333333")
    half, wing_z = 0.5 * tanker.span_m, tanker.sheet.bound_m[2]
    axes.plot([-half, half], [wing_z, wing_z], color="k", linewidth=1.2, label="wing")
    axes.plot([-tanker.half_m, tanker.half_m], [wing_z, wing_z], "ko", markersize=4, label="legs")
    axes.plot(*drogue_T[1:], "k+", markersize=11, label="drogue")
    behind = tanker.sheet.bound_m[0] - drogue_T[0]
    axes.set(
        title=f"Seen from ahead, {behind:.0f} m behind the wing's bound vortex; colour: up-flow [m/s]",
        xlabel="left of the axis [m]",
        ylabel="above the wing [m]",
        aspect="equal",
    )
    axes.legend(fontsize=8, loc="upper right")
    figure.colorbar(shades, ax=axes, shrink=0.9)


def _draw_axis(axes: Any, tanker: _Tanker) -> None:
    behind = np.linspace(3.0, 100.0, 200)
    axes.plot(behind, tanker.downwash(behind), color="#1f77b4", label="one horseshoe, no cores")
    axes.plot(behind[::12], tanker.closed_form(behind[::12]), "o", color="#1f77b4", markersize=4, label="closed form")
    axes.plot(behind, tanker.downwash(behind, filaments=16), color="#ff7f0e", label="16 filaments")
    axes.plot(behind, tanker.downwash(behind, whole=True), "k--", label="with cores and tail, as flown")
    axes.axhline(
        tanker.gamma / tanker.span_m, color="#777777", linewidth=0.8, linestyle=":", label="elliptic sheet, far"
    )
    axes.set(title="Downwash on the axis", xlabel="behind the bound vortex [m]", ylabel="m/s", ylim=(0.0, 12.0))
    axes.legend(fontsize=8)
    axes.grid(alpha=0.3)
