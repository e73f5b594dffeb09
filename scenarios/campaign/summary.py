"""What a campaign showed, in figures: a line for each group of flights that may be pooled."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from dockair.rotations import Array
from dockair.scenarios.accept import Accept
from dockair.scenarios.campaign.jobs import Job
from dockair.scenarios.campaign.row import flight_of
from dockair.scenarios.report.groups import Group, Row, Share, groups_of


def summary_of(rows: Sequence[Mapping[str, Any]], jobs: Sequence[Job]) -> list[dict[str, Any]]:
    """Return for each group counts, rates with intervals, spread of the contacts, and what was claimed in vain.

    Args:
        rows: of all flights.
        jobs: likewise; their scenarios say what is claimed, where the plan changes nothing of them.
    """
    claims = {(job.scenario_hash, job.seed): job.scenario.accept for job in jobs if job.as_written}
    return [_group(group, _claimed(group.rows, claims)) for group in groups_of(rows)]


def _claimed(rows: Sequence[Row], claims: Mapping[tuple[str, int], Accept]) -> Accept | None:
    """Return what all of a group's flights claim; None where one of them is not as written, or they differ."""
    found = [claims.get(flight_of(row)) for row in rows]
    return found[0] if all(claim == found[0] for claim in found) else None


def _group(group: Group, claimed: Accept | None) -> dict[str, Any]:
    return {
        **group.kind,
        "flights": len(group.rows),
        "seeds": group.seeds,
        "independent": group.independent,
        "first_attempt": _share(group.first_attempt),
        "success": _share(group.success),
        "refuelled": _share(group.refuelled),
        "outcomes": dict(group.outcomes),
        "causes": dict(group.causes),
        "causes_of_flights_without_attempt": dict(group.causes_without_attempt),
        "unsafe": len(group.unsafe),
        "errors": len(group.failed_to_fly),
        "shortfalls": None if claimed is None else _shortfalls(claimed, group.rows),
        "radial_offset_m": _spread(group.offsets_m),
        "closure_speed_m_s": _spread(group.closing_m_s),
    }


def _shortfalls(claimed: Accept, rows: Sequence[Row]) -> list[str] | None:
    """Return what was claimed in vain; None where no figure is claimed, and nothing was unsafe nor an error."""
    found = claimed.judge(rows)
    return found if found or claimed.claims_figures else None


def _share(share: Share) -> dict[str, Any]:
    low, high = share.interval
    return {"count": share.count, "rate": share.value, "low": low, "high": high}


def _spread(values: Array) -> dict[str, float] | None:
    """Return median, 95th percentile, smallest and largest; None of nothing."""
    if not len(values):
        return None
    median, most = np.percentile(values, [50.0, 95.0])
    return {"median": float(median), "p95": float(most), "min": float(values.min()), "max": float(values.max())}
