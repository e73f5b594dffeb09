"""A flight along its time and along its range: which phase when and why, how well the navigation knew how far off.

Ranges are the camera's from the drogue's ring centre, in bins; errors are those of `metrics`, Eqs. (1) and (2), and of
the attitude, |log(R_true R_estimated')|. Beside each stands what the filter itself expected of it,

    sigma = sqrt(mean of u' P u)                                                                          (1)

u being the unit vector toward the drogue for the range; for the lateral error the trace over the two axes across it,
for the attitude over all three. Only ticks at which a new frame had just been used and the solution was valid count.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from dockair.calibration import Mounting
from dockair.messages import NavSolution
from dockair.scenarios.judgement.metrics import fresh_and_valid, line_of_sight_errors, state_error
from dockair.sim.truth import Truth

RANGE_EDGES_M = (0.0, 2.0, 3.0, 4.0, 5.0, 7.0, 10.0, 15.0, 20.0, 30.0)


@dataclass(frozen=True, slots=True, kw_only=True)
class RangeBin:
    """Errors and their expected sizes between two ranges."""

    low_m: float
    high_m: float
    count: int
    range_rmse_m: float
    range_bias_m: float  #: mean of estimated less true
    lateral_rmse_m: float
    attitude_rmse_deg: float
    range_sigma_m: float
    lateral_sigma_m: float
    attitude_sigma_deg: float


@dataclass(frozen=True, slots=True, kw_only=True)
class PhaseEntry:
    """When a phase was entered, and why."""

    phase: str
    begun_s: float
    reason: str


def timeline(solutions: Sequence[NavSolution]) -> tuple[PhaseEntry, ...]:
    """Return the phases in the order in which they were entered."""
    entries: list[PhaseEntry] = []
    for solution in solutions:
        if not entries or entries[-1].phase != solution.phase:
            reason = solution.phase_reason
            entries.append(PhaseEntry(phase=solution.phase, begun_s=solution.time_stamp_s, reason=reason))
    return tuple(entries)


def navigation_by_range(
    solutions: Sequence[NavSolution], truths: Sequence[Truth], mounting: Mounting
) -> tuple[RangeBin, ...]:
    """Return the bins that hold anything, the nearest first.

    Args:
        solutions: one a control tick.
        truths: at the same ticks.
        mounting: where the navigation believes its camera to be.
    """
    ticks = fresh_and_valid(solutions)
    if not ticks:
        return ()
    errors = np.array([state_error(solutions[k], truths[k]) for k in ticks])
    p_CD_B = np.array([truths[k].p_PD_B for k in ticks]) + (mounting.p_BP - mounting.p_BC)
    covariances = np.array([solutions[k].covariance for k in ticks])
    range_error, lateral_error = line_of_sight_errors(p_CD_B - errors[:, 3:6], p_CD_B)
    ranges_m = np.linalg.norm(p_CD_B, axis=1)
    along = p_CD_B / ranges_m[:, None]
    place, attitude = covariances[:, 3:6, 3:6], covariances[:, :3, :3]
    along_variance = np.einsum("ni,nij,nj->n", along, place, along)  # Eq. (1)
    squares = {
        "range_rmse_m": range_error**2,
        "lateral_rmse_m": lateral_error**2,
        "attitude_rmse_deg": np.degrees(np.linalg.norm(errors[:, :3], axis=1)) ** 2,
        "range_sigma_m": along_variance,
        "lateral_sigma_m": np.trace(place, axis1=1, axis2=2) - along_variance,
        "attitude_sigma_deg": np.trace(attitude, axis1=1, axis2=2) * np.degrees(1.0) ** 2,
    }
    return tuple(
        RangeBin(
            low_m=low,
            high_m=high,
            count=int(inside.sum()),
            range_bias_m=float(range_error[inside].mean()),
            **{name: float(np.sqrt(values[inside].mean())) for name, values in squares.items()},
        )
        for low, high in pairwise(RANGE_EDGES_M)
        if (inside := (ranges_m >= low) & (ranges_m < high)).any()
    )
