"""A flight as one row: what was asked, what came of it, how good the navigation was; empty where there is nothing.

A flight that could not be flown to its end is a row too: outcome "error", `error` says why, and it is no success.
"""

import json
from collections.abc import Mapping, Sequence
from dataclasses import fields
from typing import Any, TypeGuard

from dockair.parameters import read_sheet
from dockair.scenarios.campaign.jobs import Job
from dockair.scenarios.campaign.worker import Answer
from dockair.scenarios.judgement.metrics import HeadingFigures, NavigationFigures
from dockair.scenarios.judgement.result import Result
from dockair.scenarios.path_keys import NAVIGATOR
from dockair.scenarios.scenario_hash import sheets_of

Row = dict[str, Any]

ERROR = "error"  #: the outcome of a flight that could not be flown to its end
SET = "set."  #: begins the column of a key that the plan draws

_ASKED = ("scenario", "seed", "sensing", "navigator", "controller")
_CONTACT = {"contact_time_s": "time_s"} | {k: k for k in ("radial_offset_m", "closure_speed_m_s", "angle_deg")}
_SAME = tuple("outcome attempts first_attempt success cause fuel_kg collided_with frames duration_s background".split())
#: Fields of the result that are lists of objects: JSON in the table.
_LISTS = tuple(f.name for f in fields(Result) if f.name in ("attempt_log", "nav_by_range", "timeline"))

_HEADING = tuple(f"heading_{f.name}" for f in fields(HeadingFigures))

#: Column -> "text", "bool", "int" or "float", in the table's order; the drawn keys' columns come after the first five.
COLUMNS: dict[str, str] = (
    {name: "int" if name == "seed" else "text" for name in _ASKED}
    | {"outcome": "text", "attempts": "int", "first_attempt": "bool", "success": "bool", "unsafe": "text"}
    | {"cause": "text"}
    | dict.fromkeys(_CONTACT, "float")
    | {"fuel_kg": "float", "collided_with": "text", "rim_radius_m": "float"}
    | {f"nav_{f.name}": "int" if f.name == "frames_used" else "float" for f in fields(NavigationFigures)}
    | dict.fromkeys(_HEADING, "float")
    | {"frames": "int", "duration_s": "float", "background": "text", "error": "text"}
    | dict.fromkeys(_LISTS, "text")
    | {"sheets": "text", "scenario_hash": "text", "command": "text"}
)

_NEVER_EMPTY = {"scenario", "seed", "sensing", "scenario_hash", "command", "attempt_log"}
_LATER = {"nav_by_range", "timeline", "background", "rim_radius_m", "sheets", *_HEADING}  # came after the others
_ALWAYS = COLUMNS.keys() - _LATER
_TYPES = {"text": (str,), "bool": (bool,), "int": (int,), "float": (float, int)}


def columns_of(result: Result) -> Row:
    """Return the columns that a flight's result fills."""
    table = result.to_dict()
    row: Row = {name: table[name] for name in _SAME} | {"unsafe": "; ".join(result.unsafe)}
    row |= {name: (table["contact"] or {}).get(key) for name, key in _CONTACT.items()}
    row |= {f"nav_{key}": value for key, value in table["nav"].items()}
    row |= {f"heading_{key}": value for key, value in (table["heading"] or {}).items()}
    row |= {name: json.dumps(table[name], allow_nan=False) for name in _LISTS}
    return row


def row_of(job: Job, answer: Answer) -> Row:
    """Return the whole row of what came of a job."""
    row: Row = {name: {"text": "", "bool": False}.get(kind) for name, kind in COLUMNS.items()}
    row |= dict.fromkeys(_LISTS, "[]") | {"outcome": ERROR, "attempts": 0, "error": answer.error}
    return row | _asked(job) | (answer.columns or {})


def unflown(job: Job) -> Row:
    """Return the row of a job that has not been flown: what was asked, and nothing that came of it."""
    return row_of(job, Answer(columns=None))


def as_asked(row: Row, job: Job) -> Row:
    """Return a row of a job that is done, said as the plan says it now: it may have been written otherwise before."""
    return {name: value for name, value in row.items() if not name.startswith(SET)} | _asked(job)


def flight_of(row: Mapping[str, Any]) -> tuple[str, int]:
    """Return which flight a row is of: the scenario's hash, and the seed."""
    return row["scenario_hash"], row["seed"]


def _asked(job: Job) -> Row:
    scenario = job.scenario
    row: Row = {"scenario": scenario.name, "seed": job.seed, "scenario_hash": job.scenario_hash}
    row["command"] = job.command
    row |= {"sensing": scenario.sensing, "navigator": scenario.navigation.name}
    row["controller"] = scenario.guidance.controller
    row["sheets"] = json.dumps(sheets_of(scenario))
    sheet, own = read_sheet("drogue"), scenario.parameters.get("drogue", {})
    row["rim_radius_m"] = 0.5 * own.get("ring_diameter_m", sheet["ring_diameter_m"].value)
    drawn = {key: scenario.navigation.name if key == NAVIGATOR else value for key, value in job.drawn.items()}
    return row | {f"{SET}{key}": value for key, value in drawn.items()}


def is_row(value: Any) -> TypeGuard[Row]:
    """Whether this may be a row: what everything reads is there, and every column holds its kind or nothing."""
    if not isinstance(value, dict) or not _ALWAYS <= value.keys():
        return False
    return all(_holds(value[name], kind, name in _NEVER_EMPTY) for name, kind in COLUMNS.items() if name in value)


def _holds(value: Any, kind: str, filled: bool) -> bool:
    return not filled if value is None else type(value) in _TYPES[kind]


def column_names(rows: Sequence[Mapping[str, Any]]) -> list[str]:
    """Return the table's columns in order, those of the drawn keys among them."""
    drawn = sorted({name for row in rows for name in row if name.startswith(SET)})
    return [*_ASKED, *drawn, *(name for name in COLUMNS if name not in _ASKED)]
