"""How many links and how short a step: shape, swing and motion in one and the same gust, against finer ones.

The gust is a sum of waves frozen in the air, which passes with V: its velocity depends on x + V t alone, neither on the
step nor on a random number per tick. Amplitudes follow Dryden's spectrum, down to waves of one hose length. Every run
begins at rest, and its first seconds do not count. What the rows stand beside is finer than any of them.
"""

from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from dockair.rotations import Array
from dockair.scenarios.reproduce.reference import picture_name
from dockair.scenarios.reproduce.world.hose_cases import HoseCase, continuous_cable
from dockair.sim.hose.rest import rest_shape
from dockair.sim.hose.swing import LinearSwing

ID = "world/convergence"
TITLE = "links of the hose and physics rate: shape at rest, first swings, drogue in one gust"
_LINKS, _RATES_HZ = (4, 8, 12, 16, 18, 24, 32), (250, 500, 1000, 2000, 4000)
_FINEST_LINKS, _FINEST_RATE_HZ = 40, 8000  # the references, in no row
_SOURCE = f"continuous cable for the shape; {_FINEST_LINKS} links, or {_FINEST_RATE_HZ} Hz, for the rest"
_DEFAULT_LINKS, _DEFAULT_RATE_HZ = 18, 1000
_DURATION_S, _BEFORE_S, _SAMPLE_HZ = 12.0, 4.0, 50
_SIGMA_M_S, _SCALE_M = 1.11, 533.4  # light turbulence at 6096 m
_WAVES, _LONGEST_M, _SEED = 48, 4000.0, 18
_GRID_M = 0.1  # of the tabulated gust: 1/150 of the shortest wave
_SIZE_IN, _DPI = (11.0, 4.2), 110


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class FrozenWaves:
    """A gust that rides the air, tabulated along its way."""

    along_m: Array  #: (n,) x + V t
    velocity_m_s: Array  #: (n, 3)
    airspeed_m_s: float

    @classmethod
    def drawn(cls, airspeed_m_s: float, shortest_m: float, duration_s: float) -> "FrozenWaves":
        """Sum waves of Dryden's lateral spectrum, sigma^2 L/pi (1 + 3 (L k)^2) / (1 + (L k)^2)^2, of random phase."""
        k = np.geomspace(2.0 * np.pi / _LONGEST_M, 2.0 * np.pi / shortest_m, _WAVES)
        density = (
            _SIGMA_M_S**2 * _SCALE_M / np.pi * (1.0 + 3.0 * (_SCALE_M * k) ** 2) / (1.0 + (_SCALE_M * k) ** 2) ** 2
        )
        amplitude = np.sqrt(2.0 * density * np.gradient(k))
        phase = np.random.default_rng(_SEED).uniform(0.0, 2.0 * np.pi, (_WAVES, 3))
        along = np.arange(-3.0 * shortest_m, airspeed_m_s * duration_s + shortest_m, _GRID_M)
        waves = [np.cos(np.outer(along, k) + phase[:, axis]) @ amplitude for axis in range(3)]
        return cls(along_m=along, velocity_m_s=np.column_stack(waves), airspeed_m_s=airspeed_m_s)

    def at(self, places_W: Array, time_s: float) -> Array:
        """(n, 3) velocity of the air beyond the wind at places (n, 3) in W."""
        along = places_W[:, 0] + self.airspeed_m_s * time_s
        return np.column_stack([np.interp(along, self.along_m, self.velocity_m_s[:, axis]) for axis in range(3)])


def path_in_gust(case: HoseCase, gust: FrozenWaves, rate_hz: int) -> Array:
    """(n, 3) places of the hose's end [m] at the sampling rate, from when the start is forgotten."""
    rig, every, places = case.rig(1.0 / rate_hz), rate_hz // _SAMPLE_HZ, []
    for tick in range(round(_DURATION_S * rate_hz)):
        time_s = tick / rate_hz
        if tick % every == 0 and time_s >= _BEFORE_S:
            places.append(rig.hose_end())
        rig.step(lambda places_W, now_s=time_s: gust.at(places_W, now_s))  # type: ignore[misc]
    return np.array(places)


def reproduce(out: Path | None) -> dict[str, Any]:
    """Fly every number of links at the default rate, and the default number at every rate; errors in `out`."""
    case = HoseCase.of(180.0, 6000.0)
    gust = FrozenWaves.drawn(case.airspeed_m_s, case.hose.length_m, _DURATION_S)
    cases = {links: replace(case, hose=replace(case.hose, links=links)) for links in (*_LINKS, _FINEST_LINKS)}
    by_links = {links: path_in_gust(cases[links], gust, _DEFAULT_RATE_HZ) for links in cases}
    default = cases[_DEFAULT_LINKS]
    others = [rate for rate in (*_RATES_HZ, _FINEST_RATE_HZ) if rate != _DEFAULT_RATE_HZ]
    by_rate = {rate: path_in_gust(default, gust, rate) for rate in others}
    by_rate[_DEFAULT_RATE_HZ] = by_links[_DEFAULT_LINKS]
    rows = _rows_by_links(cases, by_links) + _rows_by_rate(by_rate)
    if out is not None:
        _draw(rows, by_links, out / picture_name(ID))
    return {"id": ID, "source": _SOURCE, "rows": rows}


def _rows_by_links(cases: dict[int, HoseCase], paths: dict[int, Array]) -> list[dict[str, Any]]:
    shapes = {links: _shape_and_swing(case) for links, case in cases.items()}
    place, tension = continuous_cable(cases[_FINEST_LINKS])
    cable = {"aft_m": float(place[-1, 0]), "below_m": float(place[-1, 1]), "root_tension_n": float(tension[0])}
    return [
        {
            "case": f"{links} links, {_DEFAULT_RATE_HZ} Hz",
            "ours": {**shapes[links], **_motion(paths[links], paths[_FINEST_LINKS])},
            "reference": {**shapes[_FINEST_LINKS], **cable, **_rms(paths[_FINEST_LINKS])},
        }
        for links in _LINKS
    ]


def _rows_by_rate(paths: dict[int, Array]) -> list[dict[str, Any]]:
    return [
        {
            "case": f"{rate} Hz, {_DEFAULT_LINKS} links",
            "ours": _motion(paths[rate], paths[_FINEST_RATE_HZ]),
            "reference": _rms(paths[_FINEST_RATE_HZ]),
        }
        for rate in _RATES_HZ
    ]


def _shape_and_swing(case: HoseCase) -> dict[str, float]:
    """Return the shape at rest, and the first swing's period and damping in both planes."""
    rest = rest_shape(case.hose, case.drogue, case.wind_W, case.air.density_kg_m3, case.air.kinematic_viscosity_m2_s)
    figures = {
        "aft_m": float(-rest.p_WH[-1, 0]),
        "below_m": float(-rest.p_WH[-1, 2]),
        "root_tension_n": rest.root_tension_n,
    }
    vertical, lateral = (
        LinearSwing(case.hose, case.drogue, case.wind_W, case.air, plane).modes()[0]
        for plane in ("vertical", "lateral")
    )
    figures |= {"vertical_period_s": vertical.period_s, "vertical_damping_ratio": vertical.damping_ratio}
    return figures | {"lateral_period_s": lateral.period_s, "lateral_damping_ratio": lateral.damping_ratio}


def _rms(path: Array) -> dict[str, float]:
    return {"lateral_rms_m": float(path[:, 1].std()), "vertical_rms_m": float(path[:, 2].std())}


def _motion(path: Array, finest: Array) -> dict[str, float]:
    """Rms of the motion, and of its difference from the finest run's, mean and all."""
    return _rms(path) | {"rms_from_finest_mm": float(1e3 * np.sqrt(((path - finest) ** 2).sum(axis=1).mean()))}


def _draw(rows: list[dict[str, Any]], by_links: dict[int, Array], path: Path) -> None:
    from matplotlib.figure import Figure

    figure = Figure(figsize=_SIZE_IN, dpi=_DPI, layout="constrained")
    left, middle, right = figure.subplots(1, 3, width_ratios=(1.4, 1.0, 1.0))
    time_s = _BEFORE_S + np.arange(len(by_links[_LINKS[-1]])) / _SAMPLE_HZ
    for links in (_LINKS[0], _DEFAULT_LINKS, _LINKS[-1]):
        left.plot(time_s, by_links[links][:, 1], lw=1, ls="--" if links == _LINKS[0] else "-", label=f"{links} links")
    left.set(xlabel="time [s]", ylabel="hose's end, lateral [m]", title="the same gust")
    left.legend(frameon=False, fontsize=8)
    errors = [row["ours"]["rms_from_finest_mm"] for row in rows]
    middle.loglog(_LINKS, errors[: len(_LINKS)], "o-")
    middle.set(xlabel="links", ylabel=f"rms from {_FINEST_LINKS} links [mm]", title=f"{_DEFAULT_RATE_HZ} Hz")
    right.loglog(_RATES_HZ, errors[len(_LINKS) :], "o-")
    right.set(xlabel="physics rate [Hz]", ylabel=f"rms from {_FINEST_RATE_HZ} Hz [mm]", title=f"{_DEFAULT_LINKS} links")
    for axes, ticks in (middle, _LINKS[::2]), (right, _RATES_HZ):
        axes.set_xticks(ticks, [str(tick) for tick in ticks])
        axes.set_xticks([], minor=True)
        axes.grid(which="both", lw=0.3)
    figure.savefig(path)
