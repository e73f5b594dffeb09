"""The small table that a repository keeps of campaigns: counts, intervals, spread, causes, a line for each flight."""

import json
import re
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from dockair.rotations import Array
from dockair.scenarios.report.acceptance import shortfalls_of
from dockair.scenarios.report.folders import Campaign
from dockair.scenarios.report.groups import Group, Share, groups_of
from dockair.scenarios.report.pairs import Paired, beside_perfect_navigation, side_by_side
from dockair.scenarios.report.settings import drawn_of

_MANIFEST = ("plan", "flights", "seeds", "commit", "uncommitted_changes", "code", "plug_ins", "versions", "begun")
_OF_EACH = ("seed", "outcome", "first_attempt", "success", "unsafe", "attempts", "radial_offset_m", "closure_speed_m_s")
_DRAWN = "drawn"
_LIST_OVER_LINES = re.compile(r"\[\n\s*([^\[\]{}]*?)\n\s*\]")  # one that holds neither list nor object


def evidence_of(campaigns: Sequence[Campaign]) -> dict[str, Any]:
    """Return the table; every number is None where there is nothing to take it from."""
    groups = groups_of([row for campaign in campaigns for row in campaign.rows])
    return {
        "groups": [_group(group, groups) for group in groups],
        "each_flight": (*_OF_EACH, _DRAWN),
        "side_by_side": [_side_by_side(*two) for two in side_by_side(groups)],
        "campaigns": [
            {"flown": len(campaign.rows)} | {key: campaign.manifest.get(key) for key in _MANIFEST}
            for campaign in campaigns
        ],
    }


def as_text(table: Mapping[str, Any]) -> str:
    """Return it as JSON, one flight a line."""
    text = json.dumps(table, indent=1, allow_nan=False) + "\n"
    return _LIST_OVER_LINES.sub(lambda found: "[" + re.sub(r"\n\s*", " ", found[1]) + "]", text)


def _group(group: Group, groups: Sequence[Group]) -> dict[str, Any]:
    pair = beside_perfect_navigation(group, groups)
    shortfalls = shortfalls_of(group)
    return {
        **group.kind,
        "flights": len(group.rows),
        "seeds": group.seeds,
        "independent": group.independent,
        "errors": len(group.failed_to_fly),
        "first_attempt": _share(group.first_attempt),
        "success": _share(group.success),
        "refuelled": _share(group.refuelled),
        "inside_capture_radius": _share(group.inside_capture_radius),
        "closing_1_0_to_1_5_m_s": _share(group.in_closing_band),
        "radial_offset_median_m": _quantile(group.offsets_m, 0.5),
        "radial_offset_90_m": _quantile(group.offsets_m, 0.9),
        "closure_speed_max_m_s": _quantile(group.closing_m_s, 1.0),
        "unsafe_seeds": [row["seed"] for row in group.unsafe],
        "outcomes": dict(group.outcomes),
        "causes_of_failed_attempts": dict(group.causes),
        "causes_of_flights_without_attempt": dict(group.causes_without_attempt),
        "failed_seeds": [row["seed"] for row in group.flown if not row["first_attempt"]],
        "beside_perfect_navigation": None if pair is None else _pair(pair),
        "shortfalls": None if shortfalls is None else list(shortfalls),
        "each": [[*(_rounded(row[name]) for name in _OF_EACH), ", ".join(drawn_of(row))] for row in group.rows],
    }


def _pair(pair: Paired) -> dict[str, Any]:
    counts = {"flights": pair.flights, "seeds": pair.seeds, "ours": pair.ours, "perfect": pair.theirs}
    return counts | {"ratio": _finite(pair.ratio)}


def _side_by_side(one: Group, other: Group, pair: Paired) -> dict[str, Any]:
    return {
        "one": one.kind,
        "other": other.kind,
        "flights": pair.flights,
        "seeds": pair.seeds,
        "one_docked": pair.ours,
        "other_docked": pair.theirs,
        "only_one": pair.only_ours,
        "only_other": pair.only_theirs,
        "by_chance": float(f"{pair.by_chance:.3g}"),
    }


def _share(share: Share) -> dict[str, Any]:
    low, high = share.interval
    return {"count": share.count, "of": share.of, "low": _finite(low), "high": _finite(high)}


def _rounded(value: Any) -> Any:
    return round(value, 4) if isinstance(value, float) else value


def _quantile(values: Array, share: float) -> float | None:
    return round(float(np.quantile(values, share)), 4) if len(values) else None


def _finite(value: float) -> float | None:
    return round(value, 4) if np.isfinite(value) else None
