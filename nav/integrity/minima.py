"""Both minima of a frame's cost: with all LEDs, and with each LED left out in turn."""

from dataclasses import dataclass, fields, replace
from math import isclose

import numpy as np
from numpy.typing import NDArray

from dockair.nav.pose.difference import pose_difference
from dockair.nav.pose.estimate import PoseEstimate, estimate_of
from dockair.nav.pose.levenberg_marquardt import levenberg_marquardt
from dockair.nav.pose.measurement import LinesOfSight
from dockair.nav.pose.planar import mirrored, position_for_attitude, two_poses
from dockair.nav.pose.prior import AttitudePrior, PosePrior, Prior
from dockair.rotations import Array

_SAME_MINIMUM_CHI2 = 1e-3  # squared distance, in sigmas, below which two ends of a descent are one minimum
_TWO_POSES_FROM = 4  # LEDs; three in a plane may have four poses
_ROUNDING = 1e-9  # of the cost: above it the pose was solved with a prior or another loss


@dataclass(frozen=True, slots=True, eq=False)
class Exclusion:
    """A minimum of the cost without one LED."""

    led: int  #: the LED left out
    pose: PoseEstimate


def minima_of(pose: PoseEstimate, sight: LinesOfSight, prior: Prior | None) -> list[PoseEstimate]:
    """Return the pose and its mirror image, if that is another minimum; with a prior those to which they lead.

    Args:
        pose: a converged estimate. One that was solved with a prior or Huber's loss is solved again without.
        sight: its lines of sight.
        prior: taken as one more measurement; then the lowest comes first.
    """
    other = pose.alternative
    as_it_came = prior is None and isclose(pose.cost, pose.chi2, rel_tol=_ROUNDING)
    if as_it_came and (other is not None or pose.mirror_tried):
        return [pose] if other is None else [pose, other]
    seen = np.isfinite(pose.led_chi2)
    mirror = mirrored(pose.R_CD, pose.p_CD, sight.points_D) if other is None else (other.R_CD, other.p_CD)
    if as_it_came:
        return [pose, *(end for end in _ends(sight, [mirror], None, seen) if not _are_one(end, pose))]
    starts = [(pose.R_CD, pose.p_CD), mirror]
    if len(sight.rays) < _TWO_POSES_FROM:
        starts += _starts(prior, sight)
    return _ends(sight, starts, prior, seen)


def exclusions(
    sight: LinesOfSight, prior: Prior | None, seen: NDArray[np.bool_], highest_cost: float
) -> list[Exclusion]:
    """Return the minima without one LED, of every LED, up to a cost, lowest first; from starts that no bad LED bent.

    Args:
        sight: lines of sight of all LEDs that were seen.
        prior: taken as one more measurement.
        seen: (n,) which these are.
        highest_cost: above it an exclusion explains nothing.
    """
    found = []
    for i, led in enumerate(np.flatnonzero(seen)):
        others = seen.copy()
        others[led] = False
        fewer = _without(sight, i)
        starts = _starts(prior, fewer)
        attitudes, positions = two_poses(fewer.rays, fewer.points_D)
        if np.isfinite(positions).all():
            starts += [(attitudes[k], positions[k]) for k in range(2)]
        found += [Exclusion(int(led), end) for end in _ends(fewer, starts, prior, others, highest_cost)]
    return sorted(found, key=lambda exclusion: exclusion.pose.cost)


def paired(minima: list[PoseEstimate]) -> PoseEstimate:
    """Return the first of some LEDs' minima with the second as its alternative."""
    alternative = minima[1] if len(minima) > 1 else None
    return minima[0] if minima[0].alternative is alternative else replace(minima[0], alternative=alternative)


def _starts(prior: Prior | None, sight: LinesOfSight) -> list[tuple[Array, Array]]:
    if isinstance(prior, PosePrior):
        return [(prior.R_CD, prior.p_CD)]
    if isinstance(prior, AttitudePrior):
        R = np.ascontiguousarray(prior.R_CD, dtype=float)
        return [(R, position_for_attitude(sight.rays, sight.points_D, R))]
    return []


def _without(sight: LinesOfSight, i: int) -> LinesOfSight:
    kept = np.arange(len(sight.rays)) != i
    arrays = {f.name: getattr(sight, f.name) for f in fields(sight) if f.name != "lens"}
    return replace(sight, **{name: array[kept] for name, array in arrays.items() if array is not None})


def _ends(
    sight: LinesOfSight,
    starts: list[tuple[Array, Array]],
    prior: Prior | None,
    seen: NDArray[np.bool_],
    highest_cost: float = np.inf,
) -> list[PoseEstimate]:
    """Return where the starts lead, each minimum once, lowest first."""
    ends: list[PoseEstimate] = []
    for R, p in starts:
        end = levenberg_marquardt(sight, R, p, prior=prior)
        if end.converged and end.cost <= highest_cost:
            estimate = estimate_of(end, sight, seen)
            if not any(_are_one(estimate, other) for other in ends):
                ends.append(estimate)
    return sorted(ends, key=lambda end: end.cost)


def _are_one(end: PoseEstimate, other: PoseEstimate) -> bool:
    step = pose_difference(end.R_CD, end.p_CD, other.R_CD, other.p_CD)
    return bool(step @ np.linalg.solve(other.covariance, step) < _SAME_MINIMUM_CHI2)
