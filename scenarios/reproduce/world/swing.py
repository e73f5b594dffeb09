"""Small swings of hose and drogue: what MuJoCo's chain does, against the eigenvalues of the linearised chain.

The chain is set swinging in one mode alone, once to either side; half the difference of the two runs is free of the
small shift by which the hose's stiffness keeps it from the shape at rest. Period and damping are those of
A exp(lambda t) fitted to the hose's end.
"""

from pathlib import Path
from typing import Any

import numpy as np
from scipy.optimize import least_squares

from dockair.rotations import Array
from dockair.scenarios.reproduce.reference import picture_name
from dockair.scenarios.reproduce.world.hose_cases import HoseCase, steady_flights
from dockair.sim.hose.rest import hinge_angles
from dockair.sim.hose.swing import LinearSwing, Mode, Plane

ID = "world/swing"
TITLE = "period and damping of the hose's small swings: MuJoCo's chain and the linearised one"
_SOURCE = "eigenvalues of the linearised chain, dockair.sim.hose.swing"
_MODES = 2  # of each plane
_HOSE_END_M = 0.02
_PERIODS = 2.0
_PLANES: tuple[Plane, Plane] = ("vertical", "lateral")
_SIZE_IN, _DPI = (11.0, 6.4), 110


def reproduce(out: Path | None) -> dict[str, Any]:
    """Let four modes of two flights ring down; the hose's end in `out`."""
    rows, drawn = [], []
    for case in steady_flights():
        for plane in _PLANES:
            linear = LinearSwing(case.hose, case.drogue, case.wind_W, case.air, plane)
            for number, mode in enumerate(linear.modes()[:_MODES], start=1):
                name = f"{case.name}, {plane} mode {number}"
                time_s, path = ring_down(case, linear, mode, plane)
                fitted = fit(time_s, path, mode.eigenvalue_1_s)
                rows.append({"case": name, "ours": _figures(fitted), "reference": _figures(mode.eigenvalue_1_s)})
                drawn.append((name, time_s, path, mode))
    if out is not None:
        _draw(drawn, out / picture_name(ID))
    return {"id": ID, "source": _SOURCE, "rows": rows}


def ring_down(
    case: HoseCase, linear: LinearSwing, mode: Mode, plane: Plane, rate_hz: int = 1000, periods: float = _PERIODS
) -> tuple[Array, Array]:
    """Times (n,) [s] and the hose end's displacement (n,) [m] along the plane's axis."""
    axis = 1 if plane == "lateral" else 2
    count = round(periods * mode.period_s * rate_hz)
    runs = []
    for amplitude_m in (_HOSE_END_M, -_HOSE_END_M):
        rig, run, instant_s = case.rig(1.0 / rate_hz), np.empty(count), 1e-4 / abs(mode.eigenvalue_1_s)
        before, now, after = (linear.directions(mode, amplitude_m, t) for t in (-instant_s, 0.0, instant_s))
        rig.put(now, (hinge_angles(after) - hinge_angles(before)) / (2.0 * instant_s))
        for k in range(count):
            run[k] = rig.hose_end()[axis]
            rig.step()
        runs.append(run)
    return np.arange(count) / rate_hz, 0.5 * (runs[0] - runs[1])


def fit(time_s: Array, path: Array, first: complex) -> complex:
    """Eigenvalue [1/s] of the damped swing that fits a path best."""

    def residual(p: Array) -> Array:
        phase = p[1] * time_s
        return np.asarray(np.exp(p[0] * time_s) * (p[2] * np.cos(phase) + p[3] * np.sin(phase)) - path)

    scale = [abs(first.real), abs(first), _HOSE_END_M, _HOSE_END_M]
    found = least_squares(residual, [first.real, first.imag, path[0], 0.0], x_scale=scale, xtol=1e-12, ftol=1e-12)
    return complex(found.x[0], found.x[1])


def _figures(eigenvalue: complex) -> dict[str, float]:
    mode = Mode(eigenvalue_1_s=eigenvalue, shape=np.empty(0, dtype=complex))
    return {"period_s": mode.period_s, "damping_ratio": mode.damping_ratio}


def _draw(drawn: list[tuple[str, Array, Array, Mode]], path: Path) -> None:
    from matplotlib.figure import Figure

    figure = Figure(figsize=_SIZE_IN, dpi=_DPI, layout="constrained")
    panels = figure.subplots(2, len(drawn) // 2)
    for axes, (name, time_s, swing, mode) in zip(panels.flat, drawn, strict=True):
        linear = _HOSE_END_M * np.real(np.exp(mode.eigenvalue_1_s * time_s))
        axes.plot(time_s, 1e3 * swing, lw=2.5, color="tab:blue", alpha=0.5, label="MuJoCo")
        axes.plot(time_s, 1e3 * linear, lw=0.9, color="black", ls="--", label="linearised")
        axes.set_title(f"{name}\n{mode.period_s:.3f} s, damping ratio {mode.damping_ratio:.4f}", fontsize=8)
        axes.set_xlabel("time [s]")
    for row in panels:
        row[0].set_ylabel("hose's end [mm]")
    panels[0, 0].legend(frameon=False, fontsize=8)
    figure.savefig(path)
