"""The receiver against the book its tables come from: check of the program, trims, turns, modes; a second airframe.

The check of the program is a wild state off every node of the tables; the force and moment are ours, the equations of
motion, the air and the thrust are the book's with its rounded constants, so that all printed digits count. The book
takes 57.3 degrees for a radian in one term, which shows in the sixth digit of the pitching and axial accelerations.
Trims and modes are entirely ours, with the standard atmosphere and gravity and a mass that differs by 0.04 %.

The book's turn needs its afterburner; ours is solved with the thrust range doubled. Its phugoid is one at a held
throttle, where thrust falls with Mach number; the receiver's engine holds its limits, so both are shown.
"""

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from dockair.parameters import load_parameters
from dockair.rotations import FLU_FROM_FRD, Array
from dockair.scenarios.reproduce.reference import picture_name, read_figure, read_reference
from dockair.sim.air.atmosphere import STANDARD_GRAVITY_M_S2, standard_atmosphere
from dockair.sim.aircraft.aerodynamics import AirframeParameters
from dockair.sim.aircraft.airframe import AirframeData
from dockair.sim.aircraft.derivatives import DerivativeAirframe
from dockair.sim.aircraft.engine import thrust_range
from dockair.sim.aircraft.linear_model import VELOCITY, LinearModel, linear_model
from dockair.sim.aircraft.trim import Trim, steady_trim

ID = "world/receiver"
TITLE = "receiver: the book's check of its program, trims, turn and five modes; the second airframe's"
_SOURCE = "[Stevens, Lewis & Johnson 2016, tables 3.5-2, 3.6-2, 3.6-3, examples 3.8-1, 3.8-2]"
_TABLE, _CURVE = "stevens_lewis_f16", "stevens_lewis_trim"
_FOOT_M, _AIRSPEED_FT_S, _TURN_RAD_S = 0.3048, 502.0, 0.3
_SPEED_STEP_M_S = 1.0
_FLIGHTS = ((120.0, 3000.0), (180.0, 6000.0))
_BANK_RAD = float(np.radians(25.0))  # of the refuelling racetrack
_SIZE_IN, _DPI = (10.0, 7.5), 110
_CURVES = ("airspeed_ft_s", "alpha_deg", "elevator_deg", "throttle")
_LABELS = {"alpha_deg": "angle of attack [°]", "elevator_deg": "elevator [°]", "throttle": "throttle"}


def checked_derivatives() -> dict[str, float]:
    """Return the state derivatives of table 3.5-2: our force and moment in the book's equations of motion."""
    p, x, u = (read_figure(_TABLE, figure) for figure in ("program", "state", "control"))
    V, alpha, beta, phi, theta = (x[key] for key in ("airspeed_ft_s", "alpha_rad", "beta_rad", "phi_rad", "theta_rad"))
    P, Q, R = w = np.array([x["p_rad_s"], x["q_rad_s"], x["r_rad_s"]])
    v = V * np.array([np.cos(alpha) * np.cos(beta), np.sin(beta), np.sin(alpha) * np.cos(beta)])
    surfaces_rad = np.radians([u["elevator_deg"], u["aileron_deg"], u["rudder_deg"]])
    CX, CY, CZ, Cl, Cm, Cn = _coefficients(p, x["centre_of_gravity"], v, w, surfaces_rad)
    qbar, thrust = _air_and_thrust(x)
    qS, g = qbar * p["wing_area_ft2"], p["gravity_ft_s2"]
    gravity = g * np.array([-np.sin(theta), np.cos(theta) * np.sin(phi), np.cos(theta) * np.cos(phi)])
    force = np.array([qS * CX + thrust, qS * CY, qS * CZ])
    dv = force * p["inverse_mass_1_slug"] + gravity - np.cross(w, v)
    dV = float(v @ dv) / V
    c = [0.0, *(p[f"c{i}"] for i in range(1, 10))]
    h, qSb = p["rotor_slug_ft2_s"], qS * p["span_ft"]
    turning = Q * np.sin(phi) + R * np.cos(phi)
    return {
        "airspeed_ft_s2": dV,
        "alpha_rad_s": float((v[0] * dv[2] - v[2] * dv[0]) / (v[0] ** 2 + v[2] ** 2)),
        "beta_rad_s": float((V * dv[1] - v[1] * dV) * np.cos(beta) / (v[0] ** 2 + v[2] ** 2)),
        "phi_rad_s": float(P + np.tan(theta) * turning),
        "theta_rad_s": float(Q * np.cos(phi) - R * np.sin(phi)),
        "psi_rad_s": float(turning / np.cos(theta)),
        "p_rad_s2": float((c[2] * P + c[1] * R + c[4] * h) * Q + qSb * (c[3] * Cl + c[4] * Cn)),
        "q_rad_s2": float((c[5] * P - c[7] * h) * R + c[6] * (R * R - P * P) + qS * p["chord_ft"] * c[7] * Cm),
        "r_rad_s2": float((c[8] * P - c[2] * R + c[9] * h) * Q + qSb * (c[4] * Cl + c[9] * Cn)),
    }


def _coefficients(p: dict[str, float], centre_of_gravity: float, v_ft: Array, w: Array, surfaces_rad: Array) -> Array:
    """(6,) of our model, from its force and moment; arguments forward-right-down."""
    airframe = replace(
        load_parameters("airframe", AirframeParameters),
        centre_of_gravity=centre_of_gravity,
        wing_area_m2=p["wing_area_ft2"] * _FOOT_M**2,
        span_m=p["span_ft"] * _FOOT_M,
        chord_m=p["chord_ft"] * _FOOT_M,
    )
    v_B = FLU_FROM_FRD @ v_ft * _FOOT_M
    force, moment = airframe.aerodynamics(1.0).force_and_moment(v_B, FLU_FROM_FRD @ w, surfaces_rad)
    qbar_S = 0.5 * float(v_B @ v_B) * airframe.wing_area_m2
    lengths = np.array([airframe.span_m, airframe.chord_m, airframe.span_m])
    return np.concatenate([FLU_FROM_FRD @ force, FLU_FROM_FRD @ moment / lengths]) / qbar_S


def _air_and_thrust(x: dict[str, float]) -> tuple[float, float]:
    """The book's dynamic pressure [lb/ft^2] and thrust [lb], subroutines ADC and THRUST of its appendix A."""
    nodes = read_figure(_TABLE, "thrust")
    factor = 1.0 - 0.703e-5 * x["altitude_ft"]
    mach = x["airspeed_ft_s"] / np.sqrt(1.4 * 1716.3 * 519.0 * factor)
    part = (mach - nodes["mach_low"]) / (nodes["mach_high"] - nodes["mach_low"])
    military, maximum = (
        nodes[f"{name}_low_lb"] + part * (nodes[f"{name}_high_lb"] - nodes[f"{name}_low_lb"])
        for name in ("military", "maximum")
    )
    thrust = military + (maximum - military) * (x["power"] - 50.0) / 50.0
    return 0.5 * 2.377e-3 * factor**4.14 * x["airspeed_ft_s"] ** 2, thrust


def book_trim(centre_of_gravity: float, airspeed_ft_s: float = _AIRSPEED_FT_S, turn_rate_rad_s: float = 0.0) -> Trim:
    """Return a trim at sea level; a turn with twice the thrust range."""
    airframe = book_airframe(centre_of_gravity)
    if turn_rate_rad_s != 0.0:
        airframe = replace(airframe, military_thrust_n=2.0 * airframe.military_thrust_n)
    air = standard_atmosphere(0.0)
    return steady_trim(airframe, airspeed_ft_s * _FOOT_M, air, turn_rate_rad_s=turn_rate_rad_s)


def book_airframe(centre_of_gravity: float) -> AirframeParameters:
    """Return the first airframe with its centre of gravity where the book has it."""
    return load_parameters("airframe", AirframeParameters, {"centre_of_gravity": centre_of_gravity})


def trim_numbers(trim: Trim) -> dict[str, float]:
    """Return a trim in the book's quantities and signs."""
    P, Q, R = FLU_FROM_FRD @ trim.w_WB_B
    elevator, aileron, rudder = np.degrees(trim.surfaces_rad)
    power = 50.0 * trim.thrust_range.throttle(trim.thrust_n)
    return {
        "alpha_rad": trim.alpha_rad,
        "beta_rad": trim.sideslip_rad,
        "phi_rad": trim.bank_rad,
        "theta_rad": trim.pitch_rad,
        "p_rad_s": float(P),
        "q_rad_s": float(Q),
        "r_rad_s": float(R),
        "elevator_deg": float(elevator),
        "aileron_deg": float(aileron),
        "rudder_deg": float(rudder),
        "throttle": power / read_figure(_TABLE, "program")["throttle_power"],
        "thrust_n": trim.thrust_n,
    }


def mode_numbers(model: LinearModel) -> dict[str, float]:
    """Return the five modes of straight flight; NaN where two real roots stand for an oscillation."""
    pairs = [root for root in model.longitudinal_roots if root.imag > 0.0]
    short, slow = pairs if len(pairs) == 2 else (complex("nan"), complex("nan"))
    dutch = [root for root in model.lateral_roots if root.imag > 0.0]
    real = [float(root.real) for root in model.lateral_roots if root.imag == 0.0]
    roll, spiral = real if len(real) == 2 else (float("nan"), float("nan"))
    swing = dutch[0] if len(dutch) == 1 else complex("nan")
    return {
        "short_period_real_1_s": float(short.real),
        "short_period_imag_1_s": float(short.imag),
        "phugoid_real_1_s": float(slow.real),
        "phugoid_imag_1_s": float(slow.imag),
        "dutch_roll_real_1_s": float(swing.real),
        "dutch_roll_imag_1_s": float(swing.imag),
        "roll_1_s": roll,
        "spiral_1_s": spiral,
    }


def at_held_throttle(airframe: AirframeData, trim: Trim, altitude_m: float) -> LinearModel:
    """Return the linear model with a thrust that follows the tables as the airspeed changes."""
    model, air = linear_model(airframe, trim), standard_atmosphere(altitude_m)
    throttle = trim.thrust_range.throttle(trim.thrust_n)
    thrusts = []
    for step in (-_SPEED_STEP_M_S, _SPEED_STEP_M_S):
        limits = thrust_range(airframe, trim.airspeed_m_s + step, air)
        thrusts.append(limits.idle_n + throttle * (limits.military_n - limits.idle_n))
    slope = (thrusts[1] - thrusts[0]) / (2.0 * _SPEED_STEP_M_S)
    A = model.A.copy()
    A[VELOCITY, 0] += trim.R_WB[:, 0] * slope / airframe.mass_kg
    return replace(model, A=A)


def reproduce(out: Path | None) -> dict[str, Any]:
    """Compute all rows; trims and modes beside the printed ones in `out`."""
    rows = [
        {"case": "state derivatives", "ours": checked_derivatives(), "reference": read_figure(_TABLE, "derivative")}
    ]
    for case in ("level 0.30", "level 0.35", "level 0.38", "turn 0.30", "turn 0.35"):
        turn = -_TURN_RAD_S if case.startswith("turn") else 0.0  # to the right
        numbers = trim_numbers(book_trim(float(case.split()[1]), turn_rate_rad_s=turn))
        rows.append({"case": f"trim, {case} chord", "ours": numbers, "reference": read_figure(_TABLE, case)})
    airframe, trim = book_airframe(0.30), book_trim(0.30)
    printed = read_figure(_TABLE, "modes")
    models = {"thrust": linear_model(airframe, trim), "throttle": at_held_throttle(airframe, trim, 0.0)}
    for held, model in models.items():
        rows.append({"case": f"modes, held {held}", "ours": mode_numbers(model), "reference": printed})
    unmanned = load_parameters("airframe_unmanned", DerivativeAirframe)
    for name, either in (("fighter", book_airframe(0.30)), ("unmanned", unmanned)):
        rows += [_flight_row(name, either, *flight) for flight in _FLIGHTS]
    if out is not None:
        _draw(models["throttle"], unmanned, out / picture_name(ID))
    return {"id": ID, "source": _SOURCE, "rows": rows}


def _flight_row(name: str, airframe: AirframeData, airspeed_m_s: float, altitude_m: float) -> dict[str, Any]:
    air = standard_atmosphere(altitude_m)
    trim = steady_trim(airframe, airspeed_m_s, air)
    rate = STANDARD_GRAVITY_M_S2 * np.tan(_BANK_RAD) / airspeed_m_s
    turning = steady_trim(airframe, airspeed_m_s, air, turn_rate_rad_s=float(rate))
    ours = {
        "alpha_deg": float(np.degrees(trim.alpha_rad)),
        "elevator_deg": float(np.degrees(trim.elevator_rad)),
        "thrust_n": trim.thrust_n,
        "of_thrust_range": trim.thrust_range.throttle(trim.thrust_n),
        "turn_alpha_deg": float(np.degrees(turning.alpha_rad)),
        "turn_thrust_n": turning.thrust_n,
        **mode_numbers(linear_model(airframe, trim)),
    }
    return {"case": f"{name}, {airspeed_m_s:.0f} m/s, {altitude_m:.0f} m", "ours": ours, "reference": {}}


def _draw(model: LinearModel, unmanned: DerivativeAirframe, path: Path) -> None:
    from matplotlib.figure import Figure

    figure = Figure(figsize=_SIZE_IN, dpi=_DPI, layout="constrained")
    panels = figure.subplot_mosaic([["alpha_deg", "modes"], ["elevator_deg", "modes"], ["throttle", "slow"]])
    printed = {key: np.array([float(row[key]) for row in read_reference(_CURVE)]) for key in _CURVES}
    speeds = np.linspace(printed["airspeed_ft_s"][0], printed["airspeed_ft_s"][-1], 100)
    numbers = [trim_numbers(book_trim(0.35, float(speed))) for speed in speeds]
    curves = {
        "alpha_deg": np.degrees([row["alpha_rad"] for row in numbers]),
        "elevator_deg": np.array([row["elevator_deg"] for row in numbers]),
        "throttle": np.array([row["throttle"] for row in numbers]),
    }
    for key, label in _LABELS.items():
        axes = panels[key]
        axes.plot(speeds, curves[key], color="tab:blue", lw=1.2, label="ours")
        axes.plot(printed["airspeed_ft_s"], printed[key], "o", ms=4.0, mfc="none", color="black", label="printed")
        axes.set_ylabel(label)
        axes.grid(alpha=0.3)
    panels["alpha_deg"].legend(frameon=False)
    panels["alpha_deg"].set_title("F-16-class airframe, level flight at sea level, 0.35 chord", fontsize=10)
    panels["throttle"].set_xlabel("airspeed [ft/s]")
    trim = steady_trim(unmanned, _FLIGHTS[0][0], standard_atmosphere(_FLIGHTS[0][1]))
    for axes in (panels["modes"], panels["slow"]):
        _roots(axes, mode_numbers(model), "tab:blue", "+", "F-16-class, ours, 0.30 chord")
        _roots(axes, read_figure(_TABLE, "modes"), "black", "o", "printed")
        _roots(axes, mode_numbers(linear_model(unmanned, trim)), "tab:orange", "x", "unmanned, 120 m/s, 3000 m")
        axes.set_ylabel("imaginary [1/s]")
        axes.grid(alpha=0.3)
    panels["modes"].set(xlim=(-5.0, 0.5), ylim=(-6.0, 6.0))
    panels["modes"].set_title("Modes of level flight", fontsize=10)
    panels["modes"].legend(frameon=False, fontsize=8)
    panels["slow"].set(xlim=(-0.025, 0.005), ylim=(-0.12, 0.12), xlabel="real [1/s]")
    panels["slow"].locator_params(axis="x", nbins=4)
    figure.savefig(path)


def _roots(axes: Any, modes: dict[str, float], colour: str, marker: str, label: str) -> None:
    roots = [complex(modes["roll_1_s"]), complex(modes["spiral_1_s"])]
    for name in ("short_period", "phugoid", "dutch_roll"):
        root = complex(modes[f"{name}_real_1_s"], modes[f"{name}_imag_1_s"])
        roots += [root, root.conjugate()]
    face = "none" if marker == "o" else colour
    axes.plot(np.real(roots), np.imag(roots), marker, ms=8.0, mfc=face, color=colour, label=label)
