"""The time series of an episode: truth beside belief, at the control rate."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from dockair.rotations import Array
from dockair.scenarios.flight_log import FlightLog, standard_deviations
from dockair.scenarios.judgement.metrics import true_headings, true_relative_state
from dockair.scenarios.recording.layout import AXES, BELIEF, NEUTRAL, OTHER, PHASES, STATUSES, TRUTH

_SIGMA = [130, 130, 130]


def log_plots(recording: Any, log: FlightLog) -> None:
    """Send every series of `plot_series`, and the phases and frame statuses as states."""
    import rerun as rr

    if not log.truths:
        return
    times = [rr.TimeColumn("sim_time", duration=[truth.time_s for truth in log.truths])]
    for entity, (label, colour, values) in plot_series(log).items():
        recording.log(f"plots/{entity}", rr.SeriesLines(names=label, colors=colour, widths=1.5), static=True)
        recording.send_columns(f"plots/{entity}", times, rr.Scalars.columns(scalars=values))
    _log_states(recording, log, "states/phase", [s.phase for s in log.solutions], PHASES)
    _log_states(recording, log, "states/frame", [s.status for s in log.solutions], STATUSES)


def plot_series(log: FlightLog) -> Mapping[str, tuple[str, Sequence[int], Array]]:
    """Return entity -> (label, colour, (ticks,) values)."""
    relative = [true_relative_state(truth) for truth in log.truths]
    p_true = np.array([p for _, p, _ in relative])
    v_true = np.array([v for _, _, v in relative])
    p_nav = np.array([s.p_PD_B for s in log.solutions])
    v_nav = np.array([s.v_PD_B for s in log.solutions])
    sigma = standard_deviations(log.solutions)
    error_mm = 1e3 * (p_nav - p_true)
    bound_mm = 3e3 * sigma[:, 3:6]
    none = np.full(3, np.nan)
    gyro = np.degrees([imu[-1].angular_rate_rad_s if imu else none for imu in log.imu])
    force = np.array([imu[-1].specific_force_m_s2 if imu else none for imu in log.imu])
    series: dict[str, tuple[str, Sequence[int], Array]] = {
        "range/truth": ("truth", TRUTH, p_true[:, 0]),
        "range/belief": ("belief", BELIEF, p_nav[:, 0]),
        "range_error/error": ("belief - truth", BELIEF, error_mm[:, 0]),
        "range_error/upper": ("3 sigma", _SIGMA, bound_mm[:, 0]),
        "range_error/lower": ("3 sigma", _SIGMA, -bound_mm[:, 0]),
        "closing/truth": ("truth", TRUTH, -v_true[:, 0]),
        "closing/belief": ("belief", BELIEF, -v_nav[:, 0]),
        "reel/position": ("taken in", TRUTH, np.array([truth.reel_position_m for truth in log.truths])),
        "tension/root": ("at the pod", TRUTH, np.array([truth.root_tension_n for truth in log.truths])),
        "tension/drogue": ("at the drogue", NEUTRAL, np.array([truth.drogue_tension_n for truth in log.truths])),
    }
    for axis, letter, word in ((1, "y", "left"), (2, "z", "up")):
        series[f"lateral/truth_{letter}"] = (f"{word}, truth", _shade(TRUTH, axis), p_true[:, axis])
        series[f"lateral/belief_{letter}"] = (f"{word}, belief", _shade(BELIEF, axis), p_nav[:, axis])
        series[f"lateral_error/{letter}"] = (word, _shade(BELIEF, axis), error_mm[:, axis])
    series["lateral_error/upper"] = ("3 sigma", _SIGMA, bound_mm[:, 1:].max(axis=1))
    series["lateral_error/lower"] = ("3 sigma", _SIGMA, -bound_mm[:, 1:].max(axis=1))
    for axis, label in enumerate(("roll", "pitch, nose down", "yaw, left")):
        series[f"gyro/{'xyz'[axis]}"] = (label, AXES[axis], gyro[:, axis])
    for axis, label in enumerate(("forward", "left", "up")):
        series[f"accelerometer/{'xyz'[axis]}"] = (label, AXES[axis], force[:, axis])
    series["exposure/exposure"] = ("exposure", TRUTH, _held(1e6 * np.array(log.exposures_s)))
    series.update(_heading_series(log))
    return series


def _heading_series(log: FlightLog) -> Mapping[str, tuple[str, Sequence[int], Array]]:
    """The heading's error and its three sigma; nothing where none is kept."""
    believed = np.array([s.heading_rad for s in log.solutions])
    if not np.isfinite(believed).any():
        return {}
    error_deg = np.degrees(believed - true_headings(log.truths))
    bound_deg = np.degrees(3.0 * np.array([s.heading_sigma_rad for s in log.solutions]))
    return {
        "heading_error/error": ("belief - truth", BELIEF, error_deg),
        "heading_error/upper": ("3 sigma", _SIGMA, bound_deg),
        "heading_error/lower": ("3 sigma", _SIGMA, -bound_deg),
    }


def _held(values: Array) -> Array:
    """(n,) each NaN replaced by the last value before it."""
    newest = np.maximum.accumulate(np.where(np.isfinite(values), np.arange(len(values)), 0))
    return values[newest]


def _shade(colour: Sequence[int], axis: int) -> list[int]:
    return [c if axis == 1 else c * 3 // 5 for c in colour]


def _log_states(
    recording: Any, log: FlightLog, entity: str, values: Sequence[str], colours: Mapping[str, Sequence[int]]
) -> None:
    import rerun as rr

    changes = [k for k, value in enumerate(values) if k == 0 or value != values[k - 1]]
    times = [rr.TimeColumn("sim_time", duration=[log.truths[k].time_s for k in changes])]
    states = [values[k].replace("_", " ") or "none" for k in changes]
    known = sorted({*states, *colours})  # all, for a flight that is sent in parts
    look = rr.StateConfiguration(values=known, labels=known, colors=[colours.get(state, OTHER) for state in known])
    recording.log(entity, look, static=True)
    recording.send_columns(entity, times, rr.StateChange.columns(state=states))
