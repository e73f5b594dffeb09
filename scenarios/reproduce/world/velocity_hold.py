"""The receiver's velocity hold, flown: steps, swings, gusts with and without its accelerometers, still air with noise.

What is asked for is the velocity of the probe's tip. The swings' reference is the linear prediction

    y / c = H_m(s) F(s),     H_m = C (s - A_m)^-1 (E - B K_c (1, s)'),     F = w^2 / (s^2 + 2 zeta w s + w^2)     (1)

of `regulator` and `reference`; the flights have the whole airframe, its actuators' limits and its sensors' lags. The
steps' references are those of the reference alone, 1/e of its way after 1/k + 2 zeta / w seconds for small steps.
The body is a free rigid one; no hose, no tanker.
"""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from dockair.messages import ReceiverCommand
from dockair.parameters import load_parameters, read_sheet
from dockair.rotations import Array, exp
from dockair.scenarios.reproduce.reference import picture_name
from dockair.sim.air.atmosphere import STANDARD_GRAVITY_M_S2, standard_atmosphere
from dockair.sim.air.turbulence import DrydenField, TurbulenceParameters, gust_sigma
from dockair.sim.aircraft.aerodynamics import AirframeParameters
from dockair.sim.aircraft.flight_control import FlightControlParameters
from dockair.sim.aircraft.receiver import Receiver

ID = "world/velocity-hold"
TITLE = "receiver's velocity hold: steps, swings at 0.1-1 Hz, gusts with and without accelerometers"
_SOURCE = "linear prediction of the flight control's own design; gusts of MIL-F-8785C"
_AIRSPEED_M_S, _ALTITUDE_M, _STEP_S, _SEED = 180.0, 6000.0, 2e-3, 6
_AXES = ("forward", "left", "up")
_SWINGS_HZ, _SWING_M_S = (0.1, 0.2, 0.33, 0.5, 0.7, 1.0), 0.4
_SHARE_OF_LIMIT = 0.6  # of the reference's acceleration and jerk: swings stay linear
_STEP_M_S, _STEP_TIME_S, _GUST_TIME_S = 1.0, 6.0, 22.0
_SIZE_IN, _DPI = (11.0, 8.0), 110

Command = Callable[[float], ReceiverCommand]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Flown:
    """A flight, a row a tick."""

    time_s: Array
    velocity_m_s: Array  #: (n, 3) of the probe's tip in W
    place_m: Array  #: (n, 3) of the probe's tip in W


def make_receiver(quiet: bool = True) -> tuple[Receiver, Array]:
    """Return the receiver, and its probe's tip in body axes."""
    noise = dict.fromkeys(
        ["attitude_sigma_rad", "rate_sigma_rad_s", "specific_force_sigma_m_s2", "velocity_sigma_m_s"], 0.0
    )
    overrides = (noise | {"airspeed_sigma_m_s": 0.0} if quiet else {}) | {"inertial_velocity_sigma_m_s": 0.0}
    probe_B = _probe_tip()
    receiver = Receiver(
        airframe=load_parameters("airframe", AirframeParameters),
        flight_control=load_parameters("flight_control", FlightControlParameters, overrides),
        probe_B=probe_B,
        airspeed_m_s=_AIRSPEED_M_S,
        air=standard_atmosphere(_ALTITUDE_M),
        step_s=_STEP_S,
        rng=np.random.default_rng(_SEED),
    )
    return receiver, probe_B


def _probe_tip() -> Array:
    """(3,) the probe's tip of sheet `mounting`."""
    return np.array(read_sheet("mounting")["probe_tip_m"].value, dtype=float)


def fly(receiver: Receiver, probe_B: Array, seconds: float, command: Command, gusts: DrydenField | None) -> Flown:
    """Fly it as a free rigid body, semi-implicitly integrated."""
    R, v, w, p = receiver.trim_R_WB.copy(), np.zeros(3), np.zeros(3), np.zeros(3)
    gravity_W, inertia = np.array([0.0, 0.0, -STANDARD_GRAVITY_M_S2]), receiver.inertia_B
    inverse, f_B, wind_W = np.linalg.inv(inertia), -R.T @ gravity_W, np.array([-_AIRSPEED_M_S, 0.0, 0.0])
    n = round(seconds / _STEP_S)
    velocity, place = np.empty((n, 3)), np.empty((n, 3))
    for k in range(n):
        gust_W, roll_rad_s = np.zeros(3), 0.0
        if gusts is not None:
            gusts.step()
            gust_W, roll_rad_s = gusts.velocity(np.zeros(1))[0], gusts.rolling(0.0)
        force_W, torque_W = receiver.step(
            R_WB=R,
            v_WB=v,
            w_WB_B=w,
            air_velocity_W=wind_W + gust_W,
            specific_force_B=f_B,
            command=command(k * _STEP_S),
            air_rotation_B=np.array([roll_rad_s, 0.0, 0.0]),
        )
        a_W = force_W / receiver.mass_kg
        f_B = R.T @ a_W
        w = w + _STEP_S * inverse @ (R.T @ torque_W - np.cross(w, inertia @ w))
        R, v = R @ exp(_STEP_S * w), v + _STEP_S * (a_W + gravity_W)
        p = p + _STEP_S * v
        velocity[k], place[k] = v + R @ np.cross(w, probe_B), p + R @ probe_B
    return Flown(time_s=_STEP_S * np.arange(1, n + 1), velocity_m_s=velocity, place_m=place)


def step_response(axis: int) -> tuple[Array, Array]:
    """Time [s] and the tip's velocity over the command's, along the axis."""
    receiver, probe_B = make_receiver()
    wanted = ReceiverCommand(velocity_m_s=_STEP_M_S * np.eye(3)[axis])
    flown = fly(receiver, probe_B, _STEP_TIME_S, lambda t: wanted, None)
    return flown.time_s, flown.velocity_m_s[:, axis] / (_STEP_M_S * receiver.trim_R_WB[axis, axis])


def swing_response(axis: int, hertz: float) -> complex:
    """The tip's velocity over the command's, both as complex amplitudes."""
    receiver, probe_B = make_receiver()
    w, e = 2.0 * np.pi * hertz, np.eye(3)[axis]
    limits = load_parameters("flight_control", FlightControlParameters).reference_limits
    most = min(float(limits.acceleration_m_s2[axis]) / w, float(limits.jerk_m_s3[axis]) / w**2)
    size = min(_SWING_M_S, _SHARE_OF_LIMIT * most)

    def command(t: float) -> ReceiverCommand:
        rate = size * w * np.cos(w * t)
        return ReceiverCommand(velocity_m_s=size * np.sin(w * t) * e, acceleration_m_s2=rate * e)

    settled_s = max(1.0 / hertz, 3.0)
    flown = fly(receiver, probe_B, settled_s + 1.0 / hertz, command, None)
    last = flown.time_s > settled_s
    phase = w * flown.time_s[last]
    basis = np.column_stack([np.sin(phase), np.cos(phase)])
    sine, cosine = np.linalg.lstsq(basis, flown.velocity_m_s[last, axis], rcond=None)[0]
    return complex(sine, cosine) / size


def predicted_swing(axis: int, hertz: float) -> complex:
    """Eq. (1)."""
    control = make_receiver()[0].flight_control
    model, gains = control.schedule.model, control.schedule.gains
    p = load_parameters("flight_control", FlightControlParameters)
    n, s = len(model.A), 2j * np.pi * hertz
    A, B, E = np.zeros((n + 3, n + 3)), np.zeros((n + 3, 4)), np.zeros((n + 3, 9))
    A[:n, :n], A[n:, :n], B[:n], E[n:, :3] = model.A, gains.C, model.B, -np.eye(3)
    way = np.vstack([np.eye(3), s * np.eye(3), s * s * np.eye(3)])[:, axis]
    x = np.linalg.solve(s * np.eye(n + 3) - A + B @ gains.K_followed, (E - B @ gains.K_command) @ way)
    b, zeta = p.smoothing_bandwidth_rad_s, p.smoothing_damping
    return complex((gains.C @ x[:n])[axis] * b * b / (s * s + 2.0 * zeta * b * s + b * b))


def reproduce(out: Path | None) -> dict[str, Any]:
    """Fly all of it; steps and swings in `out`."""
    steps = [step_response(axis) for axis in range(3)]
    swings = np.array([[swing_response(axis, f) for f in _SWINGS_HZ] for axis in range(3)])
    predicted = np.array([[predicted_swing(axis, f) for f in _SWINGS_HZ] for axis in range(3)])
    rows = [_step_row(axis, *steps[axis]) for axis in range(3)]
    rows += [
        {
            "case": f"swing {_AXES[axis]} {f:g} Hz",
            "ours": _polar(swings[axis, i]),
            "reference": _polar(predicted[axis, i]),
        }
        for axis in range(3)
        for i, f in enumerate(_SWINGS_HZ)
    ]
    rows += _calm_rows()
    if out is not None:
        _draw(steps, swings, predicted, out / picture_name(ID))
    return {"id": ID, "source": _SOURCE, "rows": rows}


def _polar(response: complex) -> dict[str, float]:
    return {"gain": float(abs(response)), "phase_deg": float(np.degrees(np.angle(response)))}


def _step_row(axis: int, time_s: Array, y: Array) -> dict[str, Any]:
    p = load_parameters("flight_control", FlightControlParameters)
    lag_s = 1.0 / p.reference_gain_1_s[axis] + 2.0 * p.smoothing_damping / p.smoothing_bandwidth_rad_s
    ours = {
        "time_to_63_percent_s": float(time_s[np.argmax(y > 1.0 - np.exp(-1.0))]),
        "rise_10_to_90_percent_s": float(time_s[np.argmax(y > 0.9)] - time_s[np.argmax(y > 0.1)]),
        "overshoot_percent": float(100.0 * max(y.max() - 1.0, 0.0)),
        "settled_to_5_percent_s": float(time_s[np.flatnonzero(np.abs(y - 1.0) > 0.05)[-1]]),
    }
    return {"case": f"step {_AXES[axis]}", "ours": ours, "reference": {"time_to_63_percent_s": float(lag_s)}}


def _calm_rows() -> list[dict[str, Any]]:
    """Still air with all noise on; gusts with and without the gust's estimate."""
    rows = [_calm_row("still air, noise on", None, True)]
    for intensity in ("light", "moderate", "severe"):
        sigma = gust_sigma(intensity, _ALTITUDE_M)
        rows += [
            _calm_row(f"{intensity} gusts", sigma, True),
            _calm_row(f"{intensity} gusts, accelerometers unused", sigma, False),
        ]
    return rows


def _calm_row(case: str, sigma_m_s: float | None, uses_accelerometers: bool) -> dict[str, Any]:
    receiver, probe_B = make_receiver(quiet=False)
    if not uses_accelerometers:
        receiver.flight_control.schedule.at(0.0).gust_from_residual[:] = 0.0
    gusts = None
    if sigma_m_s is not None:
        parameters = load_parameters("turbulence", TurbulenceParameters, {"sigma_m_s": sigma_m_s})
        span_m = load_parameters("airframe", AirframeParameters).span_m
        gusts = DrydenField(parameters, _AIRSPEED_M_S, _STEP_S, np.random.default_rng(_SEED), span_m)
    flown = fly(receiver, probe_B, _GUST_TIME_S, lambda t: ReceiverCommand(), gusts)
    settled = flown.time_s > 2.0
    place_cm, velocity = 100.0 * flown.place_m[settled].std(axis=0), flown.velocity_m_s[settled].std(axis=0)
    ours = {f"tip_{axis}_rms_cm": float(x) for axis, x in zip(_AXES, place_cm, strict=True)}
    ours |= {f"tip_{axis}_rms_m_s": float(x) for axis, x in zip(_AXES, velocity, strict=True)}
    return {"case": case, "ours": ours, "reference": {}}


def _draw(steps: list[tuple[Array, Array]], swings: Array, predicted: Array, path: Path) -> None:
    import matplotlib.pyplot as plt

    figure, axes = plt.subplots(2, 2, figsize=_SIZE_IN, layout="constrained")
    for axis, name in enumerate(_AXES):
        colour = f"C{axis}"
        axes[0, 0].plot(*steps[axis], color=colour, label=name)
        axes[0, 1].plot(_SWINGS_HZ, np.abs(swings[axis]), "o", color=colour, label=name)
        axes[0, 1].plot(_SWINGS_HZ, np.abs(predicted[axis]), color=colour)
        axes[1, 1].plot(_SWINGS_HZ, np.degrees(np.unwrap(np.angle(swings[axis]))), "o", color=colour)
        axes[1, 1].plot(_SWINGS_HZ, np.degrees(np.unwrap(np.angle(predicted[axis]))), color=colour)
    axes[0, 0].axhline(1.0, color="0.7", linewidth=0.8)
    axes[0, 0].set(xlabel="time [s]", ylabel="tip's velocity over the command's", title=f"steps of {_STEP_M_S:g} m/s")
    for i in (0, 1):
        axes[i, 1].set_xscale("log")
        axes[i, 1].set_xticks(_SWINGS_HZ, [f"{f:g}" for f in _SWINGS_HZ], minor=False)
        axes[i, 1].minorticks_off()
        axes[i, 1].set_xlabel("frequency [Hz]")
    axes[0, 1].set(ylabel="gain", title="swings with feed-forward: flown (dots), predicted (lines)")
    axes[1, 1].set_ylabel("phase [deg]")
    axes[0, 0].legend()
    _draw_tip(axes[1, 0], swings)
    figure.savefig(path, dpi=_DPI)
    plt.close(figure)


def _draw_tip(ax: Any, swings: Array) -> None:
    """What is left between tip and drogue when the command is the drogue's velocity."""
    for axis, name in enumerate(_AXES):
        ax.plot(_SWINGS_HZ, np.abs(1.0 - swings[axis]), "o-", color=f"C{axis}", label=name)
    ax.set_xscale("log")
    ax.set_xticks(_SWINGS_HZ, [f"{f:g}" for f in _SWINGS_HZ], minor=False)
    ax.minorticks_off()
    ax.set(xlabel="frequency [Hz]", ylabel="|1 - y/c|", title="left of a drogue's swing without prediction")
    ax.axhline(1.0, color="0.7", linewidth=0.8)
