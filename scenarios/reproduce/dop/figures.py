"""Dilution of precision over range, azimuth, elevation and focal length: exact, and with the linearisation as printed.

The body stands at the origin with zero attitude and sees three landmarks at (psi, theta), all at the range r:

    dop/fig5   r = 10...1000 m        (45, 45), (0, 0), (-45, 45)
    dop/fig6   psi = 1...89 deg       (psi, 45), (0, 0), (-psi, 45)         r = 100 m
    dop/fig7   theta = 1...89 deg     (45, theta), (0, 0), (45, -theta)     r = 100 m
    dop/fig8   f = 1...100 mm         (45, 45), (0, 0), (45, -45)           r = 100 m

The source's curves carry no numbers and figures 5-7 no focal length: 10 mm here. It sweeps from 0 to 90 deg; at 0 two
landmarks fall together, which is singular, and at 90 deg they are not imaged.

`reference` is the same dilution without any Jacobian of ours: (1)-(3) through scipy's rotations, differentiated by
differences; and what the source reads off its figures, as slopes and falls. `printed` is the source's own (19)-(24).
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from dockair.nav.dop.dilution import dilution_of_precision
from dockair.rotations import Array
from dockair.scenarios.reproduce.dop.printed import dop_of, printed_jacobian
from dockair.scenarios.reproduce.reference import picture_name

_FOCAL_LENGTH_M, _RANGE_M = 0.010, 100.0
_STEP = 1e-4  # of the range and in radians; error of a five-point difference about 1e-12
_POINTS = 89  # of a curve: whole degrees, or even on a logarithmic scale
_SIZE_IN, _DPI = (10.0, 4.2), 110

Place = Callable[[float], tuple[Array, float]]  # landmarks and focal length of one abscissa


@dataclass(frozen=True, slots=True, kw_only=True)
class Figure:
    """One of the source's figures."""

    id: str
    title: str
    symbol: str
    unit: str
    place: Place
    low: float
    high: float
    logarithmic: bool
    checks: tuple[float, ...]  # abscissae with a row of their own
    slopes: tuple[float, float] | None  # of ln PDOP and ln ADOP; None when both just fall

    @property
    def abscissae(self) -> Array:
        """(n,) of the curve."""
        return (np.geomspace if self.logarithmic else np.linspace)(self.low, self.high, _POINTS)


def landmarks(angles_deg: list[tuple[float, float]], range_m: float) -> Array:
    """(n, 3) landmarks at (psi, theta) and one range, from the origin [m]."""
    psi, theta = np.deg2rad(np.array(angles_deg, dtype=float)).T
    return range_m * np.column_stack([np.cos(theta) * np.cos(psi), np.cos(theta) * np.sin(psi), np.sin(theta)])


FIGURES = (
    Figure(
        id="dop/fig5", title="dilution of precision over range", symbol="r", unit="m",
        place=lambda r: (landmarks([(45, 45), (0, 0), (-45, 45)], r), _FOCAL_LENGTH_M),
        low=10.0, high=1000.0, logarithmic=True, checks=(10.0, 100.0, 1000.0), slopes=(1.0, 0.0),
    ),
    Figure(
        id="dop/fig6", title="dilution of precision over azimuth", symbol="psi", unit="deg",
        place=lambda psi: (landmarks([(psi, 45), (0, 0), (-psi, 45)], _RANGE_M), _FOCAL_LENGTH_M),
        low=1.0, high=89.0, logarithmic=False, checks=(1.0, 10.0, 30.0, 60.0, 80.0, 89.0), slopes=None,
    ),
    Figure(
        id="dop/fig7", title="dilution of precision over elevation", symbol="theta", unit="deg",
        place=lambda theta: (landmarks([(45, theta), (0, 0), (45, -theta)], _RANGE_M), _FOCAL_LENGTH_M),
        low=1.0, high=89.0, logarithmic=False, checks=(1.0, 10.0, 30.0, 60.0, 80.0, 89.0), slopes=None,
    ),
    Figure(
        id="dop/fig8", title="dilution of precision over focal length", symbol="f", unit="mm",
        place=lambda f_mm: (landmarks([(45, 45), (0, 0), (45, -45)], _RANGE_M), 1e-3 * f_mm),
        low=1.0, high=100.0, logarithmic=True, checks=(1.0, 10.0, 100.0), slopes=(-1.0, -1.0),
    ),
)  # fmt: skip


def exact(points: Array, focal_length_m: float) -> tuple[float, float]:
    """PDOP and ADOP at the origin and zero attitude."""
    dop = dilution_of_precision(points, np.zeros(3), np.zeros(3), focal_length_m)
    return dop.pdop, dop.adop


def printed(points: Array, focal_length_m: float, *, mended: bool = False) -> tuple[float, float]:
    """PDOP and ADOP there as the source's equations are printed, or with (9)-(20) mended."""
    return dop_of(printed_jacobian(points, np.zeros(3), np.zeros(3), focal_length_m, mended=mended))


def by_differences(points: Array, focal_length_m: float) -> tuple[float, float]:
    """PDOP and ADOP there from differences of eqs (1)-(3)."""
    length = float(np.linalg.norm(points[0]))

    def image(state: Array) -> Array:
        s = Rotation.from_euler("xyz", state[3:]).inv().apply(points - length * state[:3])
        return np.asarray(focal_length_m * (s[:, 1:] / s[:, :1]).ravel())

    columns = []
    for e in _STEP * np.eye(6):
        near, far = image(e) - image(-e), image(2.0 * e) - image(-2.0 * e)
        columns.append((8.0 * near - far) / (12.0 * _STEP))
    pdop, adop = dop_of(np.column_stack(columns))
    return length * pdop, adop


def reproduce(figure: Figure, out: Path | None) -> dict[str, Any]:
    """Return rows at the checks and of the whole curve; both curves in `out`."""
    curves = {
        name: np.array([of(*figure.place(value)) for value in figure.abscissae])
        for name, of in (("exact", exact), ("as printed", printed))
    }
    rows = [*(_row(figure, value) for value in figure.checks), _row_of_curve(figure, curves)]
    if out is not None:
        _draw(figure, curves, out / picture_name(figure.id))
    number = figure.id.removeprefix("dop/fig")
    source = f"[Kim & Hwang 2014, fig {number}]; reference: differences of eqs 1-3, and what the text says of the curve"
    return {"id": figure.id, "source": source, "rows": rows}


def _row(figure: Figure, value: float) -> dict[str, Any]:
    place = figure.place(value)
    (pdop, adop), (printed_pdop, printed_adop) = exact(*place), printed(*place)
    mended_pdop, mended_adop = printed(*place, mended=True)
    reference_pdop, reference_adop = by_differences(*place)
    return {
        "case": f"{figure.symbol} = {value:g} {figure.unit}",
        "ours": {
            "pdop_m_per_m": pdop,
            "adop_rad_per_m": adop,
            "printed_pdop_m_per_m": printed_pdop,
            "printed_adop_rad_per_m": printed_adop,
            "printed_mended_pdop_m_per_m": mended_pdop,
            "printed_mended_adop_rad_per_m": mended_adop,
        },
        "reference": {"pdop_m_per_m": reference_pdop, "adop_rad_per_m": reference_adop},
    }


def _row_of_curve(figure: Figure, curves: dict[str, Array]) -> dict[str, Any]:
    ours: dict[str, Any] = {}
    reference: dict[str, Any] = {}
    for name, curve in curves.items():
        mark = "" if name == "exact" else "printed_"
        for k, what in enumerate(("pdop", "adop")):
            if figure.slopes is None:
                ours[f"{mark}{what}_falls"] = bool((np.diff(curve[:, k]) < 0.0).all())
                reference[f"{mark}{what}_falls"] = True
            else:
                slopes = np.diff(np.log(curve[:, k])) / np.diff(np.log(figure.abscissae))
                ours[f"{mark}{what}_log_slope_low"] = float(slopes.min())
                ours[f"{mark}{what}_log_slope_high"] = float(slopes.max())
                reference[f"{mark}{what}_log_slope_low"] = reference[f"{mark}{what}_log_slope_high"] = figure.slopes[k]
    case = f"{figure.symbol} = {figure.low:g} to {figure.high:g} {figure.unit}"
    return {"case": case, "ours": ours, "reference": reference}


def _draw(figure: Figure, curves: dict[str, Array], path: Path) -> None:
    from matplotlib.figure import Figure as Picture

    picture = Picture(figsize=_SIZE_IN, dpi=_DPI, layout="constrained")
    panels = picture.subplots(1, 2)
    for axes, k, what in zip(panels, (0, 1), ("PDOP [m/m]", "ADOP [rad/m]"), strict=True):
        for (name, curve), style in zip(curves.items(), ("-", "--"), strict=True):
            axes.plot(figure.abscissae, curve[:, k], style, color="black" if name == "exact" else "tab:red", label=name)
        checks = [by_differences(*figure.place(value))[k] for value in figure.checks]
        axes.plot(figure.checks, checks, "o", ms=5.0, mfc="none", color="tab:blue", label="differences")
        axes.set(xlabel=f"{figure.symbol} [{figure.unit}]", ylabel=what, yscale="log")
        if figure.logarithmic:
            axes.set_xscale("log")
        axes.grid(alpha=0.3, which="both")
    low, high = np.array(panels[1].get_ylim())
    if high < 2.0 * low:  # a constant: leave it one, instead of drawing rounding over the whole height
        panels[1].set_ylim(0.5 * low, 2.0 * high)
    panels[0].legend(frameon=False, fontsize=9)
    picture.suptitle(f"{figure.id}: {figure.title}, three landmarks", fontsize=10)
    picture.savefig(path)


REPRODUCTIONS = {figure.id: (figure.title, partial(reproduce, figure)) for figure in FIGURES}
