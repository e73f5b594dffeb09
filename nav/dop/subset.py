"""The k of n landmarks that tell position or attitude best: which of those seen to use, or where to put LEDs.

Least trace of the wanted block of (N_0 + Sum N_i)^-1 over all choices of k, N_i = H_i'H_i a landmark's information and
N_0 a prior's. Few choices are all tried. More are searched by branch and bound: with some landmarks in, some out and m
of the rest still to be taken, no choice can be better than

    f(all of the rest taken)                              information never harms                 (1)
    f(w) + min_x grad f(w)'(x - w),   0 <= w <= 1, Sum w = m, x takes m of the rest               (2)

(2) because f is convex in the weights w: its tangent lies below it, and the tangent's least value is that of the m
steepest. w starts even and is shifted toward the steep ones (w g^(1/2), the step of optimal experiment design). What
cannot beat the best found is left out, so that the result is the exhaustive one; when the nodes run out before the
proof is complete, the status says so and `at_least` how much better a choice might still be.

Source: the problem, [Kim & Hwang 2014, sec 5]; P. Narendra, K. Fukunaga, A branch and bound algorithm for feature
subset selection, 1977 (1); F. Pukelsheim, Optimal Design of Experiments, 1993 (2).
"""

from dataclasses import dataclass
from enum import Enum
from math import comb
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from dockair.errors import DockairError
from dockair.nav.dop import search
from dockair.rotations import Array

_CRITERIA = ("pdop", "adop", "dop")


class Geometry(Protocol):
    """What can be chosen from: a `Dop`, its `landmarks_in_camera`, or a `PoseBound`."""

    @property
    def information(self) -> Array:
        """(n, m, m) of each landmark; NaN for one that cannot be chosen."""

    @property
    def position(self) -> slice:
        """Where the position stands in the state."""

    @property
    def attitude(self) -> slice:
        """Where the attitude stands in the state."""


@dataclass(frozen=True, slots=True, kw_only=True)
class SubsetSettings:
    """When to search, and how long."""

    exhaustive_up_to: int = 50_000  # choices; some ten milliseconds
    max_nodes: int = 300_000  # some seconds


class SubsetStatus(Enum):
    """What is known about the choice."""

    OPTIMAL = "optimal"
    NOT_PROVEN = "not proven"
    TOO_FEW_LANDMARKS = "too few landmarks"
    SINGULAR = "singular"


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Subset:
    """The best choice; of equal ones any."""

    status: SubsetStatus
    members: NDArray[np.int64]  #: (k,) rising; empty without a choice
    value: float  #: its PDOP, ADOP or DOP, in the geometry's unit; NaN without a choice
    at_least: float  #: no choice is better than this; `value` when OPTIMAL
    nodes: int  #: choices tried, or nodes searched


def best_subset(
    geometry: Geometry,
    count: int,
    criterion: str = "pdop",
    *,
    prior_information: Array | None = None,
    settings: SubsetSettings | None = None,
) -> Subset:
    """Return the landmarks that give the least dilution.

    Args:
        geometry: what is seen, and as which state.
        count: how many to take.
        criterion: "pdop" (position), "adop" (attitude) or "dop" (both, in the state's units).
        prior_information: (m, m) known beside the landmarks; without it fewer than three cannot be chosen.
        settings: when to search, and how long.

    Raises:
        DockairError: unknown criterion, a count below 1, a prior of the wrong shape.
    """
    information, settings = np.asarray(geometry.information, dtype=float), settings or SubsetSettings()
    size = information.shape[1]
    if criterion not in _CRITERIA:
        raise DockairError("criterion", expected="what to minimise", got=criterion, exists=_CRITERIA)
    if not _is_whole(count) or count < 1:
        raise DockairError("count", expected="a whole number from 1", got=count)
    prior = np.zeros((size, size)) if prior_information is None else np.asarray(prior_information, dtype=float)
    if prior.shape != (size, size) or not np.isfinite(prior).all():
        raise DockairError(
            "prior_information", expected=f"an array ({size}, {size}) of finite numbers", got=prior.shape
        )
    candidates = np.flatnonzero(np.isfinite(information).all(axis=(1, 2)))
    if len(candidates) < count or (count < 3 and prior_information is None):
        return _none(SubsetStatus.TOO_FEW_LANDMARKS)
    order, wanted = _wanted_last(geometry, criterion, size)
    pieces = np.ascontiguousarray(information[candidates][:, order][:, :, order])
    start = np.ascontiguousarray(prior[order][:, order])
    if comb(len(candidates), count) <= settings.exhaustive_up_to:
        value, chosen, nodes = search.exhaustive(start, pieces, int(count), wanted)
        bound = value
    else:
        value, chosen, nodes, bound = search.branch_and_bound(start, pieces, int(count), wanted, settings.max_nodes)
    if not value < np.inf:
        return _none(SubsetStatus.SINGULAR)
    return Subset(
        status=SubsetStatus.OPTIMAL if bound >= value else SubsetStatus.NOT_PROVEN,
        members=np.sort(candidates[chosen]),
        value=float(np.sqrt(value)),
        at_least=float(np.sqrt(max(min(bound, value), 0.0))),
        nodes=nodes,
    )


def _is_whole(value: object) -> bool:
    return isinstance(value, int | np.integer) and not isinstance(value, bool)


def _none(status: SubsetStatus) -> Subset:
    return Subset(status=status, members=np.zeros(0, np.int64), value=np.nan, at_least=np.nan, nodes=0)


def _wanted_last(geometry: Geometry, criterion: str, size: int) -> tuple[NDArray[np.int64], int]:
    """Return the state's order with what is minimised at its end, and how much that is."""
    every = np.arange(size)
    if criterion == "dop":
        return every, size
    wanted = every[geometry.position if criterion == "pdop" else geometry.attitude]
    return np.concatenate([np.setdiff1d(every, wanted), wanted]), len(wanted)
