"""A flight's row: every column there, nothing that is not a number or a text, an error no success."""

import json
from dataclasses import fields

import numpy as np
import pytest

from dockair.scenarios.campaign.jobs import jobs_of
from dockair.scenarios.campaign.plan_file import PlanFile
from dockair.scenarios.campaign.row import COLUMNS, as_asked, column_names, columns_of, is_row, row_of, unflown
from dockair.scenarios.campaign.summary import summary_of
from dockair.scenarios.campaign.table import read_table, write_table
from dockair.scenarios.campaign.worker import Answer
from dockair.scenarios.judgement.attempts import Attempt
from dockair.scenarios.judgement.metrics import HeadingFigures, NavigationFigures
from dockair.scenarios.judgement.referee import Contact
from dockair.scenarios.judgement.result import Result
from dockair.scenarios.report.groups import groups_of
from dockair.scenarios.report.pairs import paired


@pytest.fixture
def job(tmp_path):
    path = tmp_path / "p.toml"
    path.write_text('name = "p"\nscenarios = ["truth_navigation"]\nseeds = [7]\n[draw."start.aft_m"]\nvalues = [5]')
    return jobs_of(PlanFile(path))[0]


def attempt(number: int, outcome: str) -> Attempt:
    numbers = {f.name: 0.5 for f in fields(Attempt) if f.name.endswith(("_s", "_m", "_deg"))}
    return Attempt(number=number, outcome=outcome, **numbers)


def result(**changes) -> Result:
    nav = {f.name: float("nan") for f in fields(NavigationFigures)} | {"nees_mean": 9.5, "frames_used": 61}
    values = {
        **{f.name: None for f in fields(Result)},
        "outcome": "contact",
        "success": True,
        "first_attempt": False,
        "cause": "gust",
        "unsafe": (),
        "attempts": 2,
        "attempt_log": (attempt(1, "miss"), attempt(2, "contact")),
        "contact": Contact(time_s=31.5, radial_offset_m=0.04, closure_speed_m_s=1.21, angle_deg=2.0),
        "nav": NavigationFigures(**nav),
        "fuel_kg": 12.5,
        "collided_with": "",
        "frames": 640,
        "duration_s": 44.0,
        "background": "analytic",
    }
    return Result(**(values | changes))


def test_a_flight_fills_the_columns_with_what_its_result_says(job):
    row = row_of(job, Answer(columns=columns_of(result())))
    expected = {
        "scenario": "truth_navigation", "seed": 7, "sensing": "truth", "navigator": "truth", "controller": "predictive",
        "outcome": "contact", "success": True, "first_attempt": False, "attempts": 2, "cause": "gust", "unsafe": "",
        "contact_time_s": 31.5, "radial_offset_m": 0.04, "closure_speed_m_s": 1.21, "angle_deg": 2.0, "fuel_kg": 12.5,
        "nav_nees_mean": 9.5, "nav_range_rmse_m": None, "nav_frames_used": 61, "frames": 640, "duration_s": 44.0,
        "error": "", "set.start.aft_m": 5, "scenario_hash": job.scenario_hash,
    }  # fmt: skip
    assert {name: row[name] for name in expected} == expected
    assert [entry["outcome"] for entry in json.loads(row["attempt_log"])] == ["miss", "contact"]
    assert set(row) == {*COLUMNS, "set.start.aft_m"}


def test_an_own_heading_fills_its_columns_and_without_one_they_are_empty(job):
    names = [f.name for f in fields(HeadingFigures)]
    figures = dict(zip(names, np.arange(1.0, 1.0 + len(names)).tolist(), strict=True)) | {"error_deg": float("nan")}
    kept = row_of(job, Answer(columns=columns_of(result(heading=HeadingFigures(**figures)))))
    assert {name: kept[f"heading_{name}"] for name in names} == figures | {"error_deg": None}
    without = row_of(job, Answer(columns=columns_of(result())))
    assert [without[f"heading_{name}"] for name in names] == [None] * len(names)
    before_there_was_one = {name: value for name, value in without.items() if not name.startswith("heading_")}
    assert is_row(kept) and is_row(before_there_was_one)


def test_a_row_says_the_rims_radius_of_its_scenarios_drogue_and_one_of_before_it_did_is_a_row_too(tmp_path):
    (tmp_path / "ring.toml").write_text("diameter_m = 0.61\ncount = 8\n")
    wide = (
        '{ scenario = "default", set = { "hardware.ring" = "ring.toml", "parameters.drogue.ring_diameter_m" = 0.61 } }'
    )
    (tmp_path / "p.toml").write_text(PLAN.format(seeds=1, scenarios=f'"default", {wide}'))
    own, other = (row_of(job, Answer(columns=columns_of(result()))) for job in jobs_of(PlanFile(tmp_path / "p.toml")))
    assert (own["rim_radius_m"], other["rim_radius_m"]) == (0.25, 0.305)
    before = {name: value for name, value in other.items() if name != "rim_radius_m"}
    assert is_row(before)


def test_flights_with_a_sheet_of_ones_own_are_pooled_by_what_it_holds_wherever_their_plan_was_begun(
    tmp_path, monkeypatch
):
    own = '{ scenario = "default", set = { "hardware.ring" = "ring.toml" } }'
    for folder, diameter_m in (("a", 0.5), ("b", 0.51)):
        (tmp_path / folder).mkdir()
        (tmp_path / folder / "ring.toml").write_text(f"diameter_m = {diameter_m}\ncount = 8\n")
        (tmp_path / folder / "p.toml").write_text(PLAN.format(seeds=1, scenarios=own))

    def begun(where, plan):
        monkeypatch.chdir(where)
        monkeypatch.setattr("dockair.scenarios.campaign.jobs.require_buildable", lambda scenario: None)
        return [row_of(job, Answer(columns=columns_of(result()))) for job in jobs_of(PlanFile(plan))]

    inside, outside = begun(tmp_path / "a", "p.toml"), begun(tmp_path, "a/p.toml")
    assert inside[0]["command"] != outside[0]["command"]
    (group,) = groups_of([*inside, *outside])
    digest = json.loads(inside[0]["sheets"])["hardware.ring"]
    assert group.settings == f'hardware.ring="ring.toml" ({digest})'
    assert len(groups_of([*inside, *begun(tmp_path / "b", "p.toml")])) == 2
    before = [{name: value for name, value in row.items() if name != "sheets"} for row in (*inside, *outside)]
    assert all(map(is_row, before)) and len(groups_of(before)) == 2
    assert paired(*groups_of(inside), *groups_of(outside), apart=()).flights == 1


def test_a_row_of_before_is_said_as_the_plan_says_it_now_and_keeps_no_key_that_is_no_longer_drawn(job):
    flown = row_of(job, Answer(columns=columns_of(result())))
    before = flown | {"set.turbulence.sigma_m_s": 0.5, "set.start.aft_m": 9, "command": "dockair fly other"}
    assert as_asked(before, job) == flown


def test_without_contact_its_columns_are_empty_and_what_was_unsafe_is_one_text(job):
    row = row_of(job, Answer(columns=columns_of(result(contact=None, outcome="miss", unsafe=("3.1 m/s", "rim")))))
    assert row["unsafe"] == "3.1 m/s; rim"
    assert [row[name] for name in ("contact_time_s", "radial_offset_m", "closure_speed_m_s", "angle_deg")] == [None] * 4


def test_an_error_is_no_success_and_says_what_was_asked(job):
    row = row_of(job, Answer(columns=None, error="ValueError: no"))
    assert (row["outcome"], row["error"], row["success"], row["first_attempt"]) == (
        "error",
        "ValueError: no",
        False,
        False,
    )
    assert (row["scenario"], row["seed"], row["set.start.aft_m"], row["attempts"]) == ("truth_navigation", 7, 5, 0)
    assert json.loads(row["attempt_log"]) == []


def test_the_table_gives_back_the_rows(job, tmp_path):
    rows = [row_of(job, Answer(columns=columns_of(result()))), row_of(job, Answer(columns=None, error="x"))]
    write_table(rows, tmp_path)
    assert read_table(tmp_path) == rows
    assert list(read_table(tmp_path)[0]) == column_names(rows)


@pytest.mark.parametrize(
    ("values", "kept"),
    [
        ((1, 2), (1, 2)),
        ((1, 2.5), (1.0, 2.5)),
        ((True, False), (True, False)),
        (("a", None), ("a", None)),
        ((1, "x"), ("1", "x")),
    ],
)
def test_a_drawn_keys_column_has_the_kind_of_its_values(job, tmp_path, values, kept):
    rows = [unflown(job) | {"set.start.aft_m": value} for value in values]
    write_table(rows, tmp_path)
    back = [row["set.start.aft_m"] for row in read_table(tmp_path)]
    assert [(type(value), value) for value in back] == [(type(value), value) for value in kept]


PLAN = """name = "p"
seeds = {seeds}
scenarios = [{scenarios}]
"""


def claims(tmp_path, scenarios):
    """Return the shortfalls of each group of a plan in which nothing docks."""
    path = tmp_path / "p.toml"
    path.write_text(PLAN.format(seeds=3, scenarios=scenarios))
    jobs = jobs_of(PlanFile(path))
    failed = columns_of(result(contact=None, outcome="miss", success=False, cause="never_steady", attempt_log=()))
    rows = [row_of(job, Answer(columns=failed | {"attempts": 0})) for job in jobs]
    return {(g["scenario"], g["controller"], g["settings"]): g for g in summary_of(rows, jobs)}


def test_a_claim_is_held_against_a_group_whose_flights_are_all_as_the_scenario_is_written(tmp_path):
    changed = '{ scenario = "default", set = { "turbulence.sigma_m_s" = 3.0 } }'
    pid = '{ scenario = "default", set = { "guidance.controller" = "pid" } }'
    groups = claims(tmp_path, f'"default", {changed}, {pid}')
    assert len(groups) == 3
    assert groups["default", "predictive", ""]["shortfalls"] != []
    assert groups["default", "pid", ""]["shortfalls"] is None
    assert groups["default", "predictive", "turbulence.sigma_m_s=3.0"]["shortfalls"] is None


def test_a_group_of_which_a_part_is_not_as_the_scenario_is_written_is_held_to_no_claim(tmp_path):
    """Set to what it is by default the controller makes no other group; but the plan has changed the scenario."""
    changed = '{ scenario = "default", seeds = [7], set = { "guidance.controller" = "predictive" } }'
    (group,) = claims(tmp_path, f'"default", {changed}').values()
    assert (group["flights"], group["shortfalls"]) == (4, None)


def test_the_summary_has_the_spread_of_the_contacts_and_what_was_unsafe_or_an_error(tmp_path):
    """Offsets of 0, 1 .. 20 cm: median 10, 95 in 100 within 19."""
    path = tmp_path / "p.toml"
    path.write_text(PLAN.format(seeds=24, scenarios='"default"'))
    jobs = jobs_of(PlanFile(path))
    docked = [columns_of(result()) | {"radial_offset_m": 0.01 * k, "closure_speed_m_s": 1.2} for k in range(21)]
    others = [columns_of(result(contact=None, outcome="miss")) | {"unsafe": said} for said in ("touch", "collision")]
    answers = [*(Answer(columns=columns) for columns in docked + others), Answer(columns=None, error="broke")]
    (group,) = summary_of([row_of(job, answer) for job, answer in zip(jobs, answers, strict=True)], jobs)
    assert group["radial_offset_m"] == pytest.approx({"median": 0.1, "p95": 0.19, "min": 0.0, "max": 0.2})
    assert group["closure_speed_m_s"] == pytest.approx({"median": 1.2, "p95": 1.2, "min": 1.2, "max": 1.2})
    assert (group["flights"], group["unsafe"], group["errors"]) == (24, 2, 1)


def test_the_summary_counts_why_flights_began_no_attempt(tmp_path):
    group = claims(tmp_path, '"default"')["default", "predictive", ""]
    assert group["causes"] == {}
    assert group["causes_of_flights_without_attempt"] == {"never_steady": 3}
    assert group["independent"]


def test_of_a_scenario_without_a_claim_nothing_is_told_but_what_is_unsafe_or_an_error(tmp_path):
    (tmp_path / "mine.toml").write_text('name = "mine"')
    (group,) = claims(tmp_path, '"./mine.toml"').values()
    assert group["shortfalls"] is None
    path = tmp_path / "p.toml"
    jobs = jobs_of(PlanFile(path))
    (group,) = summary_of([row_of(job, Answer(columns=None, error="broke")) for job in jobs], jobs)
    assert group["shortfalls"] != [] and group["shortfalls"] is not None
