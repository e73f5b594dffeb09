"""Closed forms and symmetries of hose and drogue, on MuJoCo's chain.

Without air, pulled aft with H, a hose of length L and weight w per metre and a drogue of weight W hang in a catenary;
in a stream a hose is straight where its weight balances the drag across it, if its drogue pulls along it, and high up
on a long one, whatever the drogue:

    aft = H/w (asinh((W + w L)/H) - asinh(W/H))                                                            (1)
    below = H/w (sqrt(1 + ((W + w L)/H)^2) - sqrt(1 + (W/H)^2))                                            (2)
    w cos(theta) = 1/2 rho d C_n V^2 sin^2(theta)                                                          (3)

A hose without weight and drag runs along its drogue's pull. Without air and friction energy is kept as well as the
integrator promises: halving the step divides RK4's error by 16 or more, implicitfast's, the world's, by 2. A hose towed
through air at rest is one at rest in a wind. Gravity, wind and hose turned together about the stream change nothing,
but that the hinges' order, y then z, hands on another roll to the drogue.
"""

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from dockair.rotations import Array, exp
from dockair.scenarios.reproduce.reference import picture_name
from dockair.scenarios.reproduce.world.hose_cases import HoseCase
from dockair.sim.air.atmosphere import STANDARD_GRAVITY_M_S2
from dockair.sim.hose.rest import rest_shape
from dockair.sim.hose.rig import HoseRig

ID = "world/hose-checks"
TITLE = "hose and drogue against closed forms: catenary, critical angle, no mass; energy, moving frame, turned scene"
_SOURCE = "closed forms and symmetries"
_PULL_N = 900.0
_SLOW_M_S, _SLOW_AT_M = 60.0, 3000.0  # where the critical angle is steep
_LONG_M = 400.0
_NEARLY_NOTHING = 1e-3  # kg/m, and of the radius 1/100: what is left of a hose of no mass
_SETTLING_S, _BRAKE_1_S = 25.0, 1.0
_SETTLING_STEP_S = 2e-3  # rest does not depend on it
_SWING_S = 3.0
_LEAN = np.array([0.0, 0.08, 0.06])  # of the drogue's direction at the start, sideways and up; the links' in proportion
_LET_GO = np.array([0.57, 0.1, 0.82])  # forward and up to the exit: 35 degrees from hanging
_ENERGY_STEPS_S = {"RK4": (10e-3, 5e-3), "implicitfast": (2e-3, 1e-3)}
_SIZE_IN, _DPI = (11.0, 4.2), 110


def reproduce(out: Path | None) -> dict[str, Any]:
    """Run the checks; catenary, energies and the turned scene in `out`."""
    energies = {(name, h): energy(name, h) for name, steps in _ENERGY_STEPS_S.items() for h in steps}
    turned = {degrees: swing(turn_rad=np.deg2rad(degrees)) for degrees in (0.0, 30.0, 90.0)}
    catenary_row, joints = _catenary()
    rows = [catenary_row, _critical(), _critical_long(), _massless()]
    rows += [_energy_row(name, energies) for name in _ENERGY_STEPS_S]
    rows += [_frame_row(turned[0.0]), *(_turn_row(turned, degrees) for degrees in (30.0, 90.0))]
    if out is not None:
        _draw(joints, energies, turned, out / picture_name(ID))
    return {"id": ID, "source": _SOURCE, "rows": rows}


def _catenary() -> tuple[dict[str, Any], Array]:
    case = HoseCase.of(180.0, 6000.0, {"bending_stiffness_n_m2": 0.0, "links": 40})
    rig = HoseRig(case.hose, case.drogue, np.zeros(3), None, step_s=_SETTLING_STEP_S)
    rig.pull(np.array([-_PULL_N, 0.0, 0.0]))
    rig.relax(_SETTLING_S, _BRAKE_1_S)
    end, tensions = rig.hose_end(), rig.tensions()
    aft, below, root_n, drogue_n = catenary(case, case.hose.length_m)
    row = {
        "case": "catenary, 40 links",
        "ours": _floats(aft_m=-end[0], below_m=-end[2], root_tension_n=tensions[0], drogue_tension_n=tensions[1]),
        "reference": _floats(aft_m=aft, below_m=below, root_tension_n=root_n, drogue_tension_n=drogue_n),
    }
    return row, rig.joints()


def catenary(case: HoseCase, length_m: float) -> tuple[float, float, float, float]:
    """Rear end of so much hose aft and below [m], tensions at its ends [N], Eqs. (1) and (2)."""
    w, W = case.hose.line_density_kg_m * STANDARD_GRAVITY_M_S2, case.drogue.mass_kg * STANDARD_GRAVITY_M_S2
    high, low = (W + w * length_m) / _PULL_N, W / _PULL_N
    aft = _PULL_N / w * (np.arcsinh(high) - np.arcsinh(low))
    below = _PULL_N / w * (np.hypot(1.0, high) - np.hypot(1.0, low))
    return float(aft), float(below), float(_PULL_N * np.hypot(1.0, high)), float(_PULL_N * np.hypot(1.0, low))


def critical_angle_rad(case: HoseCase) -> float:
    """Angle of a long hose to the stream, Eq. (3)."""
    hose, rho = case.hose, case.air.density_kg_m3
    across = rho * 2.0 * hose.radius_m * hose.normal_drag_coefficient * case.airspeed_m_s**2
    k = hose.line_density_kg_m * STANDARD_GRAVITY_M_S2 / across
    return float(np.arccos(np.sqrt(k**2 + 1.0) - k))


def _critical() -> dict[str, Any]:
    """With a drogue whose drag and weight pull along the hose every link is at the angle."""
    case = HoseCase.of(_SLOW_M_S, _SLOW_AT_M, {"bending_stiffness_n_m2": 0.0})
    angle = critical_angle_rad(case)
    mass = _drag_n(case) * np.tan(angle) / STANDARD_GRAVITY_M_S2
    rig = replace(case, drogue=replace(case.drogue, mass_kg=float(mass))).rig(_SETTLING_STEP_S)
    rig.put(np.tile([1.0, 0.0, 0.0], (case.hose.links + 1, 1)))
    rig.relax(_SETTLING_S, _BRAKE_1_S)
    step = np.diff(rig.joints(), axis=0)
    links_rad = np.arctan2(-step[:, 2], -step[:, 0])
    ours = _floats(steepest_link_deg=np.rad2deg(links_rad.max()), flattest_link_deg=np.rad2deg(links_rad.min()))
    name = f"critical angle, {_SLOW_M_S:g} m/s, drogue of {mass:.2f} kg"
    return {"case": name, "ours": ours, "reference": dict.fromkeys(ours, float(np.rad2deg(angle)))}


def _critical_long() -> dict[str, Any]:
    case = HoseCase.of(_SLOW_M_S, _SLOW_AT_M)
    long = replace(case.hose, length_m=_LONG_M, links=round(_LONG_M))
    rest = rest_shape(long, case.drogue, case.wind_W, case.air.density_kg_m3, case.air.kinematic_viscosity_m2_s)
    ours = np.rad2deg(np.arctan2(rest.t_W[0, 2], rest.t_W[0, 0]))
    return {
        "case": f"critical angle, {_SLOW_M_S:g} m/s, first of {_LONG_M:g} m, links at rest",
        "ours": _floats(link_deg=ours),
        "reference": _floats(link_deg=np.rad2deg(critical_angle_rad(case))),
    }


def _massless() -> dict[str, Any]:
    case = HoseCase.of(120.0, 3000.0, {"links": 4, "bending_stiffness_n_m2": 0.0, "bending_damping_n_m2_s": 0.0})
    thin = replace(case.hose, line_density_kg_m=_NEARLY_NOTHING, radius_m=0.01 * case.hose.radius_m)
    thin = replace(thin, normal_drag_coefficient=0.0, supercritical_drag_coefficient=0.0, friction_coefficient=0.0)
    rig = replace(case, hose=thin).rig()
    rig.put(np.tile([1.0, 0.0, 0.0], (thin.links + 1, 1)))
    rig.relax(_SETTLING_S, _BRAKE_1_S)
    end = rig.hose_end()
    weight = case.drogue.mass_kg * STANDARD_GRAVITY_M_S2
    return {
        "case": "drogue on a hose of 1 g/m without drag",
        "ours": _floats(below_stream_deg=np.rad2deg(np.arctan2(-end[2], -end[0])), tension_n=rig.tensions()[0]),
        "reference": _floats(
            below_stream_deg=np.rad2deg(np.arctan2(weight, _drag_n(case))), tension_n=np.hypot(weight, _drag_n(case))
        ),
    }


def _drag_n(case: HoseCase) -> float:
    pressure = 0.5 * case.air.density_kg_m3 * case.airspeed_m_s**2
    return pressure * case.drogue.drag_area_m2 * case.drogue.drag_coefficient


def energy(integrator: str, step_s: float) -> Array:
    """(n,) energy gained since the start [J], ten times a second, of a hose let go far from rest without friction."""
    case = HoseCase.of(180.0, 6000.0, {"bending_damping_n_m2_s": 0.0}, {"hinge_damping_n_m_s": 0.0})
    rig = HoseRig(case.hose, case.drogue, np.zeros(3), None, step_s=step_s, integrator=integrator)
    rig.put(np.tile(np.divide(_LET_GO, np.linalg.norm(_LET_GO)), (case.hose.links + 1, 1)))
    energies = [rig.energy_j()]
    every = round(0.2 / step_s)
    for _ in range(round(5.0 * _SWING_S)):
        for _ in range(every):
            rig.step()
        energies.append(rig.energy_j())
    return np.array(energies) - energies[0]


def _energy_row(integrator: str, energies: dict[tuple[str, float], Array]) -> dict[str, Any]:
    drift = [float(np.abs(energies[integrator, h]).max()) for h in _ENERGY_STEPS_S[integrator]]
    coarse_ms, fine_ms = (1e3 * h for h in _ENERGY_STEPS_S[integrator])
    return {
        "case": f"energy without air and friction, {integrator}, steps of {coarse_ms:g} and {fine_ms:g} ms",
        "ours": {"drift_j": drift[0], "halved_drift_j": drift[1], "ratio": drift[0] / drift[1]},
        "reference": {"ratio": 16.0 if integrator == "RK4" else 2.0},
    }


def swing(*, turn_rad: float = 0.0, towed: float = 0.0) -> Array:
    """(n, 3) path of the hose's end from the exit, in the axes of a scene turned about the stream [m].

    Args:
        turn_rad: by which gravity and hose are turned.
        towed: fraction of the airspeed that is the exit's motion, the rest being wind.
    """
    case = HoseCase.of(180.0, 6000.0)
    Q = exp(np.array([turn_rad, 0.0, 0.0]))
    gravity_W = Q @ [0.0, 0.0, -STANDARD_GRAVITY_M_S2]
    rest = rest_shape(case.hose, case.drogue, case.wind_W, case.air.density_kg_m3, case.air.kinematic_viscosity_m2_s)
    t = np.vstack([rest.t_W, rest.t_D_W]) + np.linspace(0.0, 1.0, case.hose.links + 1)[:, None] * _LEAN
    t /= np.linalg.norm(t, axis=1, keepdims=True)
    rig = HoseRig(case.hose, case.drogue, (1.0 - towed) * case.wind_W, case.air, gravity_W=gravity_W)
    rig.put(t @ Q.T, exit_m_s=towed * case.airspeed_m_s)
    path = np.empty((round(1e3 * _SWING_S), 3))
    for k in range(len(path)):
        rig.step()
        path[k] = rig.hose_end() @ Q
    return path


def _frame_row(still: Array) -> dict[str, Any]:
    furthest = np.abs(swing(towed=1.0) - still).max()
    ours = _floats(largest_difference_m=furthest, swing_m=np.ptp(still[:, 1]))
    return {"case": "towed at 180 m/s through air at rest", "ours": ours, "reference": {"largest_difference_m": 0.0}}


def _turn_row(turned: dict[float, Array], degrees: float) -> dict[str, Any]:
    difference = np.linalg.norm(turned[degrees] - turned[0.0], axis=1).max()
    ours = _floats(largest_difference_m=difference, swing_m=np.ptp(turned[0.0][:, 1]))
    name = f"gravity, wind and hose turned by {degrees:g} deg about the stream"
    return {"case": name, "ours": ours, "reference": {"largest_difference_m": 0.0}}


def _floats(**values: Any) -> dict[str, float]:
    return {key: float(value) for key, value in values.items()}


def _draw(joints: Array, energies: dict[tuple[str, float], Array], turned: dict[float, Array], path: Path) -> None:
    from matplotlib.figure import Figure

    figure = Figure(figsize=_SIZE_IN, dpi=_DPI, layout="constrained")
    left, middle, right = figure.subplots(1, 3)
    case = HoseCase.of(180.0, 6000.0)
    lengths = np.linspace(0.0, case.hose.length_m, 100)
    whole = np.array(catenary(case, case.hose.length_m)[:2])
    curve = whole - np.array([catenary(case, length)[:2] for length in lengths])
    left.plot(-joints[:, 0], joints[:, 2], "o", ms=3, label="40 links, settled")
    left.plot(curve[:, 0], -curve[:, 1], lw=1, color="black", label="catenary")
    left.set(title=f"no air, pulled with {_PULL_N:g} N", xlabel="aft [m]", ylabel="up [m]")
    for (name, step_s), gained in energies.items():
        middle.semilogy(0.2 * np.arange(1, len(gained)), np.abs(gained[1:]), label=f"{name}, {1e3 * step_s:g} ms")
    middle.set(title="energy gained or lost", xlabel="time [s]", ylabel="J")
    time_s = 1e-3 * np.arange(1, len(turned[0.0]) + 1)
    for degrees in (30.0, 90.0):
        apart_mm = 1e3 * np.linalg.norm(turned[degrees] - turned[0.0], axis=1)
        right.plot(time_s, apart_mm, lw=1, label=f"scene turned by {degrees:g}°")
    right.set(title="difference in a swing of 1 m", xlabel="time [s]", ylabel="mm")
    for axes in (left, middle, right):
        axes.legend(frameon=False, fontsize=8)
    figure.savefig(path)
