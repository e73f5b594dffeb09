"""What a flight is judged by: errors of the navigation against the truth, and `result.json`.

With p the drogue's ring centre from the camera in body axes, e = p_estimated - p_true and l = p_true / |p_true|:

    range error    e_r = e . l                                                      (1)
    lateral error  e_t = |e - e_r l|                                                (2)
    NEES           x' P^-1 x,   x = (log(R_true R_estimated'), p_true - p_estimated, v_true - v_estimated)   (3)

All three are taken where a new frame has just been used and the solution is valid. A consistent filter has a mean
NEES equal to the number of states, 9 [Bar-Shalom, Li & Kirubarajan 2001, section 5.4].
"""

import json
import math
import platform
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np

from dockair.calibration import Mounting
from dockair.messages import NavSolution
from dockair.rotations import Array, log
from dockair.scenarios.attempts import Attempt, first_attempt_succeeded, succeeded
from dockair.scenarios.causes import Flown, cause_of_flight, with_cause
from dockair.scenarios.hold import Disconnect, Hold, hold_of
from dockair.scenarios.referee import Contact, Outcome, Referee
from dockair.sim.truth import Truth

SCHEMA_VERSION = 1
_PACKAGES = ("dockair", "mujoco", "numpy", "scipy", "opencv-python-headless", "numba", "filterpy")


@dataclass(frozen=True, slots=True, kw_only=True)
class NavigationFigures:
    """How good the navigation was; NaN (null in JSON) where there was nothing to compare."""

    range_rmse_m: float
    lateral_rmse_m: float
    range_max_m: float
    lateral_max_m: float
    velocity_rmse_m_s: float
    attitude_rmse_deg: float
    nees_mean: float  #: of 9 states
    availability: float  #: fraction of control ticks with a valid solution, counted from the first valid one
    frames_used: int


@dataclass(frozen=True, slots=True, kw_only=True)
class Result:
    """One flight; the fields are the keys of `result.json`."""

    schema_version: int = SCHEMA_VERSION
    scenario: str
    seed: int
    outcome: str
    success: bool  #: contact inside the limits in some attempt
    first_attempt: bool  #: in the first
    cause: str  #: of the last attempt that failed; "" if none did
    unsafe: tuple[str, ...]  #: what was unsafe; empty when all was safe
    attempts: int
    attempt_log: tuple[Attempt, ...]
    contact: Contact | None
    hold: Hold | None
    disconnect: Disconnect | None
    fuel_kg: float  #: that was taken on
    collided_with: str
    sensing: str  #: what the navigation saw: "camera", "measurements" or "truth"
    truth_navigation: bool
    background: str  #: who drew what the camera saw, "mujoco" or "analytic"; "" without a camera
    nav: NavigationFigures
    frames: int
    duration_s: float
    real_time_factor: float
    wall_time_s: float
    versions: Mapping[str, str]
    out_dir: str | None

    def to_dict(self) -> dict[str, Any]:
        """Return plain values for JSON: NaN and infinity become None."""
        return {key: _plain(value) for key, value in asdict(self).items()}

    def to_json(self) -> str:
        """Return one JSON object, keys in the order of the fields."""
        return json.dumps(self.to_dict(), indent=2, allow_nan=False)

    def write(self, out_dir: str | Path) -> Path:
        """Write `result.json` into a folder and return its path."""
        path = Path(out_dir) / "result.json"
        path.write_text(self.to_json() + "\n", encoding="utf-8")
        return path


def _plain(value: Any) -> Any:
    if isinstance(value, Mapping):
        return {key: _plain(entry) for key, entry in value.items()}
    if isinstance(value, (tuple, list)):
        return [_plain(entry) for entry in value]
    if isinstance(value, float) and not math.isfinite(value):
        return None
    return value


def versions() -> dict[str, str]:
    """Return the versions that decide a flight's bits."""
    return {"python": platform.python_version()} | {package: version(package) for package in _PACKAGES}


def line_of_sight_errors(estimated: Array, true: Array) -> tuple[Array, Array]:
    """Return the range errors (n,) and the lateral errors (n,) [m], Eqs. (1) and (2).

    Args:
        estimated: (n, 3) positions from the camera, any common axes [m].
        true: (n, 3) the same, true and not zero.
    """
    along = true / np.linalg.norm(true, axis=1, keepdims=True)
    error = estimated - true
    range_error = np.sum(error * along, axis=1)
    return range_error, np.asarray(np.linalg.norm(error - range_error[:, None] * along, axis=1))


def normalised_error_squared(error: Array, covariance: Array) -> float:
    """Return x' P^-1 x, Eq. (3); NaN where P (n, n) is not positive definite.

    Args:
        error: (n,) x.
        covariance: (n, n) P.
    """
    try:
        factor = np.linalg.cholesky(covariance)
    except np.linalg.LinAlgError:
        return float("nan")
    whitened = np.linalg.solve(factor, error)
    return float(whitened @ whitened)


def true_relative_state(truth: Truth) -> tuple[Array, Array, Array]:
    """Return R_BD (3, 3), p_PD_B (3,) [m] and v_PD_B (3,) [m/s], in the sense of `NavSolution`."""
    return truth.R_WB.T @ truth.R_WD, truth.p_PD_B, truth.R_WB.T @ (truth.v_WD - truth.v_WP)


def state_error(solution: NavSolution, truth: Truth) -> Array:
    """Return x of Eq. (3), (9,) [rad, m, m/s]."""
    R_BD, p_PD_B, v_PD_B = true_relative_state(truth)
    return np.concatenate([log(R_BD @ solution.R_BD.T), p_PD_B - solution.p_PD_B, v_PD_B - solution.v_PD_B])


def fresh_and_valid(solutions: Sequence[NavSolution]) -> list[int]:
    """Return the ticks at which a new frame had been used and the solution was valid."""
    ticks, newest = [], float("nan")
    for tick, solution in enumerate(solutions):
        stamp = solution.frame_time_stamp_s
        if np.isfinite(stamp) and stamp != newest:
            newest = stamp
            if solution.valid:
                ticks.append(tick)
    return ticks


def navigation_figures(
    solutions: Sequence[NavSolution], truths: Sequence[Truth], mounting: Mounting
) -> NavigationFigures:
    """Compare what was believed with what was.

    Args:
        solutions: one a control tick.
        truths: at the same ticks.
        mounting: where the navigation believes its camera to be.
    """
    ticks = fresh_and_valid(solutions)
    errors = np.array([state_error(solutions[k], truths[k]) for k in ticks]).reshape(-1, 9)
    p_CP_B = mounting.p_BP - mounting.p_BC
    true = np.array([truths[k].p_PD_B + p_CP_B for k in ticks]).reshape(-1, 3)
    range_error, lateral_error = line_of_sight_errors(true - errors[:, 3:6], true)
    nees = [normalised_error_squared(x, solutions[k].covariance) for k, x in zip(ticks, errors, strict=True)]
    stamps = {s.frame_time_stamp_s for s in solutions if np.isfinite(s.frame_time_stamp_s)}
    return NavigationFigures(
        range_rmse_m=_rms(range_error),
        lateral_rmse_m=_rms(lateral_error),
        range_max_m=_largest(range_error),
        lateral_max_m=_largest(lateral_error),
        velocity_rmse_m_s=_rms(np.linalg.norm(errors[:, 6:], axis=1)),
        attitude_rmse_deg=float(np.degrees(_rms(np.linalg.norm(errors[:, :3], axis=1)))),
        nees_mean=_mean(np.array(nees)),
        availability=availability([s.valid for s in solutions]),
        frames_used=len(stamps),
    )


def availability(valid: Sequence[bool]) -> float:
    """Return the fraction of valid ticks from the first valid one on; 0 if there is none."""
    if not any(valid):
        return 0.0
    rest = list(valid)[list(valid).index(True) :]
    return sum(rest) / len(rest)


def summarise(
    *,
    scenario: str,
    seed: int,
    outcome: str,
    referee: Referee,
    flown: Flown,
    frames: int,
    mounting: Mounting,
    sensing: str,
    background: str,
    wall_time_s: float,
    out_dir: str | Path | None,
) -> Result:
    """Return a flight's result.

    Args:
        scenario: its name.
        seed: that was flown.
        outcome: of the referee.
        referee: that watched the flight.
        flown: truth and belief, one a control tick.
        frames: that were delivered to the navigation.
        mounting: where the navigation believes its camera to be.
        sensing: what the navigation saw: "camera", "measurements", or "truth" in place of `nav`.
        background: who drew what the camera saw, "" without a camera.
        wall_time_s: that the flight took.
        out_dir: where the flight was written.
    """
    truths = flown.truths
    hold, disconnect = hold_of(truths)
    duration_s = truths[-1].time_s if truths else 0.0
    log = referee.attempt_log(duration_s, Outcome(outcome))
    attempts = tuple(with_cause(attempt, flown) for attempt in log)
    return Result(
        scenario=scenario,
        seed=seed,
        outcome=outcome,
        success=succeeded(attempts),
        first_attempt=first_attempt_succeeded(attempts),
        cause=cause_of_flight(attempts, flown),
        unsafe=referee.unsafe,
        attempts=len(attempts),
        attempt_log=attempts,
        contact=referee.contact,
        hold=hold,
        disconnect=disconnect,
        fuel_kg=truths[-1].fuel_kg if truths else 0.0,
        collided_with=referee.collided_with,
        sensing=sensing,
        truth_navigation=sensing == "truth",
        background=background,
        nav=navigation_figures(flown.solutions, truths, mounting),
        frames=frames,
        duration_s=duration_s,
        real_time_factor=duration_s / wall_time_s if wall_time_s > 0.0 else float("nan"),
        wall_time_s=wall_time_s,
        versions=versions(),
        out_dir=None if out_dir is None else str(out_dir),
    )


def _rms(values: Array) -> float:
    return float(np.sqrt(np.mean(values**2))) if len(values) else float("nan")


def _largest(values: Array) -> float:
    return float(np.max(np.abs(values))) if len(values) else float("nan")


def _mean(values: Array) -> float:
    finite = values[np.isfinite(values)]
    return float(np.mean(finite)) if len(finite) else float("nan")
