"""Errors of the navigation against the truth.

With p the drogue's ring centre from the camera in body axes, e = p_estimated - p_true and l = p_true / |p_true|:

    range error    e_r = e . l                                                      (1)
    lateral error  e_t = |e - e_r l|                                                (2)
    NEES           x' P^-1 x,   x = (log(R_true R_estimated'), p_true - p_estimated, v_true - v_estimated)   (3)

All three are taken where a new frame has just been used and the solution is valid. A consistent filter has a mean
NEES equal to the number of states, 9 [Bar-Shalom, Li & Kirubarajan 2001, section 5.4].
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from dockair.calibration import Mounting
from dockair.messages import NavSolution
from dockair.rotations import Array, log
from dockair.sim.truth import Truth


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
class HeadingFigures:
    """The receiver's own heading, counted from the flight's start, against the truth."""

    turned_deg: float  #: in truth, to the left, at the end
    error_deg: float  #: believed less true, at the end; NaN (null in JSON) where the heading is lost
    sigma_deg: float  #: as the navigation has it, at the end
    error_rms_deg: float  #: over all control ticks at which there was a heading
    error_max_deg: float
    beyond_3_sigma: float  #: part of those at which the error was larger than three of its sigmas


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


def heading_figures(solutions: Sequence[NavSolution], truths: Sequence[Truth]) -> HeadingFigures | None:
    """Compare the headings, one a control tick; None where the navigation kept none."""
    believed = np.array([s.heading_rad for s in solutions])
    sigma = np.array([s.heading_sigma_rad for s in solutions])
    kept = np.isfinite(believed)
    if not kept.any():
        return None
    true = true_headings(truths)
    error = believed - true
    return HeadingFigures(
        turned_deg=float(np.degrees(true[-1])),
        error_deg=float(np.degrees(error[-1])),
        sigma_deg=float(np.degrees(sigma[-1])),
        error_rms_deg=float(np.degrees(_rms(error[kept]))),
        error_max_deg=float(np.degrees(_largest(error[kept]))),
        beyond_3_sigma=float(np.mean(np.abs(error[kept]) > 3.0 * sigma[kept])),
    )


def true_headings(truths: Sequence[Truth]) -> Array:
    """(n,) headings of the receiver's nose since the first, to the left, not wrapped [rad]."""
    headings = np.unwrap([np.arctan2(truth.R_WB[1, 0], truth.R_WB[0, 0]) for truth in truths])
    return np.asarray(headings - headings[:1])


def availability(valid: Sequence[bool]) -> float:
    """Return the fraction of valid ticks from the first valid one on; 0 if there is none."""
    if not any(valid):
        return 0.0
    rest = list(valid)[list(valid).index(True) :]
    return sum(rest) / len(rest)


def _rms(values: Array) -> float:
    return float(np.sqrt(np.mean(values**2))) if len(values) else float("nan")


def _largest(values: Array) -> float:
    return float(np.max(np.abs(values))) if len(values) else float("nan")


def _mean(values: Array) -> float:
    finite = values[np.isfinite(values)]
    return float(np.mean(finite)) if len(finite) else float("nan")
