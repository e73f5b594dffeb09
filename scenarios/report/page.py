"""The page: overview, what vision costs, crews side by side, a section a group, how it was made.

One HTML file that needs no other.
"""

import json
import math
import re
from collections.abc import Sequence
from typing import Any

import numpy as np
from jinja2 import Environment, PackageLoader, StrictUndefined
from markupsafe import Markup

from dockair.rotations import Array
from dockair.scenarios.report import figures
from dockair.scenarios.report.acceptance import claim_of, shortfalls_of
from dockair.scenarios.report.cause_words import meaning_of
from dockair.scenarios.report.folders import Campaign
from dockair.scenarios.report.groups import (
    GOOD_CONTACT,
    Group,
    Row,
    cause_without_attempt,
    causes_of,
    counted,
    ending_without_attempt,
    groups_of,
)
from dockair.scenarios.report.headings import headings_of, rms
from dockair.scenarios.report.pairs import beside_perfect_navigation, side_by_side
from dockair.scenarios.report.timelines import timelines

LIMITS = (
    f"{GOOD_CONTACT.radial_offset_m:g} m, {GOOD_CONTACT.angle_deg:g} degrees, {GOOD_CONTACT.closure_speed_m_s:g} m/s"
)
#: What no page may hold: control characters, half of a pair of UTF-16.
_NO_TEXT = re.compile("[\x00-\x08\x0b\x0c\x0e-\x1f\x7f-\x9f\ud800-\udfff\ufffe\uffff]")


def page(title: str, campaigns: Sequence[Campaign]) -> str:
    """Return the HTML text.

    Args:
        title: of the page.
        campaigns: whose flights are pooled where they may be.
    """
    rows = [row for campaign in campaigns for row in campaign.rows]
    groups = groups_of(rows)
    environment = Environment(
        loader=PackageLoader("dockair.scenarios.report", ""), autoescape=True, undefined=StrictUndefined,
        trim_blocks=True, lstrip_blocks=True,
    )  # fmt: skip
    environment.filters |= {"quantile": _quantile, "figure": _figure, "rms": rms}
    beside_perfect = [(group, pair) for group in groups if (pair := beside_perfect_navigation(group, groups))]
    text = environment.get_template("page.html.jinja").render(
        title=title,
        flights=_flights_in_words(campaigns),
        crashed=sum(len(group.failed_to_fly) for group in groups),
        limits=LIMITS,
        groups=groups,
        beside_perfect=beside_perfect,
        side_by_side=side_by_side(groups),
        overview=Markup(figures.overview(groups)),
        panels={group.anchor: Markup(figures.panels(group)) for group in groups},
        timelines={group.anchor: Markup(timelines(group)) for group in groups},
        headings={group.anchor: headings_of(group.flown) for group in groups},
        shortfalls={group.anchor: shortfalls_of(group) for group in groups},
        claims={group.anchor: claim_of(group) for group in groups},
        failures={group.anchor: _failures(group) for group in groups},
        causes={group.anchor: _causes(group) for group in groups},
        manifests=[_manifest(campaign) for campaign in campaigns],
    )
    return _NO_TEXT.sub("\N{REPLACEMENT CHARACTER}", text)


def _flights_in_words(campaigns: Sequence[Campaign]) -> str:
    """Return how many were flown, and of how many planned while a campaign is not over."""
    flown = sum(len(campaign.rows) for campaign in campaigns)
    asked = [(campaign.manifest.get("flights"), len(campaign.rows)) for campaign in campaigns]
    planned = sum(max(plan, done) if isinstance(plan, int) else done for plan, done in asked)  # any file may be damaged
    return counted(flown, "flight") if planned == flown else f"{flown} of {counted(planned, 'flight')} planned"


def _manifest(campaign: Campaign) -> dict[str, Any]:
    entries = [
        (key, value if isinstance(value, str) else json.dumps(value, ensure_ascii=False))
        for key, value in campaign.manifest.items()
    ]
    return {"name": campaign.name, "entries": entries}


def _failures(group: Group) -> list[dict[str, Any]]:
    """Flights that failed at some attempt or began none, or did something unsafe."""
    return [
        {
            "id": _id(group, number),
            "seed": row["seed"],
            "outcome": row["outcome"] or "error",
            "attempts": row["attempts"],
            "cause": (row["cause"] or "").replace("_", " "),
            "story": row["error"] or "; ".join(filter(None, [_story(row), _unsafe(row)])),
            "command": row["command"],
        }
        for number, row in enumerate(group.rows)
        if row["unsafe"] or not row["first_attempt"] or _causes_of_flight(row)
    ]


def _causes(group: Group) -> list[dict[str, Any]]:
    """Return why attempts failed and why flights began none, each with the flights of which that is true."""
    flights: dict[str, list[dict[str, Any]]] = {}
    for number, row in enumerate(group.rows):
        for cause in _causes_of_flight(row):
            flights.setdefault(cause, []).append({"id": _id(group, number), "seed": row["seed"]})
    meanings = {ending_without_attempt(row): meaning_of(cause_without_attempt(row)) for row in group.rows}
    attempts, idle = dict(group.causes), dict(group.endings_without_attempt)
    return [
        {
            "name": name.replace("_", " "),
            "meaning": meanings.get(name) or meaning_of(name),
            "attempts": attempts.get(name, 0),
            "idle": idle.get(name, 0),
            "flights": flights[name],
        }
        for name in [*attempts, *(name for name in idle if name not in attempts)]
    ]


def _causes_of_flight(row: Row) -> list[str]:
    """Return each of its causes once."""
    return list(dict.fromkeys(filter(None, [*causes_of(row), ending_without_attempt(row)])))


def _id(group: Group, number: int) -> str:
    """Return the id of a flight on the page."""
    return f"{group.anchor}-flight-{number}"


def _unsafe(row: Row) -> str:
    return f"unsafe: {row['unsafe']}" if row["unsafe"] else ""


def _story(row: Row) -> str:
    """Return what happened attempt by attempt, or why there was none."""
    without = ending_without_attempt(row)
    if without:
        return f"no attempt after {row['duration_s']:.1f} s; {without}"
    parts = []
    for attempt in json.loads(row["attempt_log"] or "[]"):
        offset = attempt["radial_offset_m"]
        where = "" if offset is None or not math.isfinite(offset) else f" {offset:.2f} m off"
        why = ", ".join(filter(None, [attempt["cause"].replace("_", " "), attempt["reason"]]))
        parts.append(
            f"{attempt['number']}: {attempt['outcome'].replace('_', ' ')}{where}" + (f" ({why})" if why else "")
        )
    return "; ".join(parts)


def _quantile(values: Array, share: float) -> str:
    return f"{float(np.quantile(values, share)):.3f}" if len(values) else "–"


def _figure(value: float, form: str) -> str:
    """Return a figure as the form writes it, a dash where there is none."""
    return form.format(value) if math.isfinite(value) else "–"
