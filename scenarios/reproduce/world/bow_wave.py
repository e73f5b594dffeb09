"""What the receiver's bow wave does to the drogue: its push at rest, beside a static solution by other hands.

The reference has the source itself at the nose, the receiver's axis along the stream, and gives displacements to 1 cm;
its drogue and hose are those of 120 m/s at 3000 m. So are ours there. The last rows are the default flight's: a trimmed
receiver holds its probe's tip so far behind the undisturbed ring's centre, the half-body's nose at its own.
"""

from pathlib import Path
from typing import Any

import numpy as np

from dockair.parameters import load_parameters, read_sheet
from dockair.rotations import Array
from dockair.scenarios.reproduce.reference import picture_name, read_reference
from dockair.scenarios.reproduce.world.tow_at_rest import AirField, TowAtRest, tow_at_rest
from dockair.sim.air.atmosphere import standard_atmosphere
from dockair.sim.air.bow_wave import BowWaveParameters, bow_wave_coefficients, bow_wave_velocity
from dockair.sim.aircraft.aerodynamics import AirframeParameters
from dockair.sim.aircraft.trim import level_trim
from dockair.sim.hose.chain import DrogueParameters, HoseParameters

ID = "world/bow-wave"
TITLE = "the receiver's bow wave: half-body, and how far it pushes the drogue"
_SOURCE = "Rankine half-body, as [Dai, Wei & Quan 2016] with one source; static solution by other hands"
_REFERENCE_FLIGHT = (120.0, 3000.0)  # airspeed [m/s], altitude [m]
_DEFAULT_FLIGHT = (180.0, 6000.0)
_REFERENCE_DROGUE = {"drag_diameter_m": 0.5, "mass_kg": 20.0, "drag_coefficient": 0.8}
_TIP_BEHIND_M = (4.0, 3.0, 2.0, 1.0, 0.5, 0.0)
_SIZE_IN, _DPI = (11.0, 4.6), 110
_Row = dict[str, Any]


def reproduce(out: Path | None) -> dict[str, Any]:
    """Compare half-body and push with closed forms and reference; its picture in `out`."""
    pushes = _reference_pushes()
    rows = [_half_body(), *(_push_row(case, values) for case, values in pushes.items()), *_default_flight()]
    if out is not None:
        _draw(out / picture_name(ID), pushes)
    return {"id": ID, "source": _SOURCE, "rows": rows}


class _Tow:
    """Hose and drogue in one flight condition, and where they hang undisturbed."""

    def __init__(self, flight: tuple[float, float], **drogue: float) -> None:
        self.airspeed_m_s, altitude_m = flight
        self._air, self._wind_W = standard_atmosphere(altitude_m), np.array([-self.airspeed_m_s, 0.0, 0.0])
        self._hose = load_parameters("hose", HoseParameters)
        self._drogue = load_parameters("drogue", DrogueParameters, drogue)
        self.rest = self.at_rest(np.zeros_like)

    def at_rest(self, motion: AirField) -> TowAtRest:
        """Where they hang in air that moves so."""
        return tow_at_rest(self._hose, self._drogue, self._wind_W, self._air, motion)

    def displaced_m(self, p_WB: Array, R_WB: Array, k: Array) -> Array:
        """(3,) the drogue's displacement by a receiver that stays at p_WB."""
        motion = self.at_rest(lambda places: bow_wave_velocity((places - p_WB) @ R_WB, k) @ R_WB.T)
        return motion.p_WD - self.rest.p_WD


def _source(radius_m: float, airspeed_m_s: float) -> Array:
    """Coefficients of a source in the receiver's origin."""
    bare = BowWaveParameters(radius_m=radius_m, nose_behind_tip_m=-0.5 * radius_m, nose_height_m=0.0)
    return bow_wave_coefficients(bare, np.zeros(3), airspeed_m_s)


def _reference_pushes() -> dict[tuple[float, float], list[tuple[float, float, float]]]:
    """Half-body's radius, distance beside -> distance behind, our push, the reference's [m]."""
    tow = _Tow(_REFERENCE_FLIGHT, **_REFERENCE_DROGUE)
    pushes: dict[tuple[float, float], list[tuple[float, float, float]]] = {}
    for row in read_reference("bow_wave_push"):
        radius, beside, behind = (float(row[key]) for key in ("radius_m", "beside_m", "behind_m"))
        p_WB = tow.rest.p_WD - [behind, beside, 0.0]  # to the right of the drogue, which gives way to the left
        ours = float(tow.displaced_m(p_WB, np.eye(3), _source(radius, tow.airspeed_m_s))[1])
        pushes.setdefault((radius, beside), []).append((behind, ours, float(row["push_m"])))
    return pushes


def _push_row(case: tuple[float, float], values: list[tuple[float, float, float]]) -> _Row:
    radius, beside = case
    names = [f"push_{behind:g}_m_behind_m" for behind, _, _ in values]
    return {
        "case": f"half-body {radius:g} m, {beside:g} m beside",
        "ours": dict(zip(names, (ours for _, ours, _ in values), strict=True)),
        "reference": dict(zip(names, (theirs for _, _, theirs in values), strict=True)),
    }


def _half_body() -> _Row:
    """Where the stream stops, how wide the body grows, and how much air leaves the source."""
    R, V = 0.75, _DEFAULT_FLIGHT[0]
    k = _source(R, V)
    ahead = np.linspace(0.2, 0.6, 4001)
    total = bow_wave_velocity(np.column_stack([ahead, 0.0 * ahead, 0.0 * ahead]), k)[:, 0] - V
    far = float(np.linalg.norm(bow_wave_velocity(np.array([[0.0, 50.0, 0.0]]), k)))
    ours = {
        "stagnation_ahead_of_source_m": float(ahead[np.argmax(total)]),
        "volume_flux_m3_s": float(far * 4.0 * np.pi * 50.0**2),
        "width_from_flux_m": float(np.sqrt(far * 4.0 * 50.0**2 / V)),
    }
    reference = {
        "stagnation_ahead_of_source_m": 0.5 * R,
        "volume_flux_m3_s": float(np.pi * R**2 * V),
        "width_from_flux_m": R,
    }
    return {"case": "half-body 0.75 m at 180 m/s, closed forms", "ours": ours, "reference": reference}


def _default_flight() -> list[_Row]:
    """Push on the default flight's drogue as the probe comes nearer."""
    return [
        {
            "case": f"default flight, probe's tip {behind:g} m behind the ring",
            "ours": dict(zip(("forward_m", "left_m", "up_m"), (float(c) for c in displaced), strict=True)),
            "reference": {},
        }
        for behind, displaced in zip(_TIP_BEHIND_M, _approach(_TIP_BEHIND_M), strict=True)
    ]


def _approach(tip_behind_m: tuple[float, ...] | Array) -> Array:
    """(n, 3) displacements of the drogue by the default receiver in level trim [m]."""
    tow, airspeed_m_s = _Tow(_DEFAULT_FLIGHT), _DEFAULT_FLIGHT[0]
    p_BP = np.array(read_sheet("mounting")["probe_tip_m"].value)
    air = standard_atmosphere(_DEFAULT_FLIGHT[1])
    R_WB = level_trim(load_parameters("airframe", AirframeParameters), airspeed_m_s, air).R_WB
    k = bow_wave_coefficients(load_parameters("bow_wave", BowWaveParameters), p_BP, airspeed_m_s)
    places = [tow.rest.p_WD - [behind, 0.0, 0.0] - R_WB @ p_BP for behind in tip_behind_m]
    return np.array([tow.displaced_m(p_WB, R_WB, k) for p_WB in places])


def _draw(path: Path, pushes: dict[tuple[float, float], list[tuple[float, float, float]]]) -> None:
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=_SIZE_IN, dpi=_DPI, layout="constrained")
    FigureCanvasAgg(figure)
    field, push = figure.subplots(1, 2, width_ratios=(1.25, 1.0))
    _draw_field(figure, field)
    for (radius, beside), values in pushes.items():
        behind, ours, theirs = np.array(values).T
        (line,) = push.plot(behind, 100.0 * ours, label=f"half-body {radius:g} m, {beside:g} m beside")
        push.plot(behind, 100.0 * theirs, "o", color=line.get_color(), markersize=4)
    behind = np.linspace(0.0, 4.0, 41)
    across = 100.0 * np.linalg.norm(_approach(behind)[:, 1:], axis=1)
    push.plot(behind + 1.2, across, "k--", label="default flight, probe's tip 1.2 m ahead of the nose")
    push.set(
        title="Push on the drogue at rest; dots: reference",
        xlabel="nose behind the undisturbed drogue [m]",
        ylabel="sideways [cm]",
        xlim=(4.2, -0.1),
        ylim=(0.0, None),
    )
    push.legend(fontsize=7, loc="upper left")
    push.grid(alpha=0.3)
    figure.savefig(path)


def _draw_field(figure: Any, axes: Any) -> None:
    from matplotlib.colors import BoundaryNorm

    R, V = 0.75, 1.0
    x, y = np.linspace(-3.0, 4.0, 141), np.linspace(-2.5, 2.5, 101)
    grid = np.stack([*np.meshgrid(x, y), np.zeros((len(y), len(x)))], axis=-1).reshape(-1, 3)
    grid[:, 0] += 0.5 * R  # nose in the picture's origin
    u = bow_wave_velocity(grid, _source(R, V)).reshape(len(y), len(x), 3)
    cosine = (x[None, :] + 0.5 * R) / np.hypot(x[None, :] + 0.5 * R, y[:, None])
    inside = np.hypot(x[None, :] + 0.5 * R, y[:, None]) < 0.5 * R / np.sqrt(0.5 * (1.0 + cosine) + 1e-12)
    speed = np.ma.masked_array(100.0 * np.linalg.norm(u, axis=2), inside)
    levels = [0.0, 0.5, 1.0, 2.0, 5.0, 10.0, 20.0, 50.0, 100.0]
    shades = axes.contourf(x, y, speed, levels=levels, norm=BoundaryNorm(levels, 256), cmap="YlOrBr")
    total = np.ma.masked_array(u[:, :, 0] - V, inside), np.ma.masked_array(u[:, :, 1], inside)
    axes.streamplot(x, y, *total, density=1.1, color="#555555", linewidth=0.6, arrowsize=0.7)
    theta = np.linspace(0.0, 2.95, 200)
    r = 0.5 * R / np.cos(0.5 * theta)
    for side in (1.0, -1.0):
        axes.plot(r * np.cos(theta) - 0.5 * R, side * r * np.sin(theta), color="#1f77b4", linewidth=1.5)
    axes.plot([1.2], [-0.9], "k+", markersize=9)
    axes.annotate("probe's tip", (1.2, -0.9), (1.35, -1.25), fontsize=8)
    axes.set(
        title="Disturbance over V [%]; blue: closed form of the body", xlabel="ahead of the nose [m]", ylabel="left [m]"
    )
    axes.set(xlim=(-3.0, 4.0), ylim=(-2.5, 2.5), aspect="equal")
    figure.colorbar(shades, ax=axes, shrink=0.85)
