"""Phases over time, named by seeds, on an axis that one flight does not stretch; own headings against the truth."""

import json
import math

import pytest

from dockair.scenarios.report.figures import panels
from dockair.scenarios.report.groups import Group
from dockair.scenarios.report.headings import headings_of, rms
from dockair.scenarios.report.timelines import axis_end, spans_of, timelines


def _row(seed, duration_s=30.0, phases=("pre_contact", "approach"), **changes):
    timeline = [{"phase": phase, "begun_s": 10.0 * k, "reason": ""} for k, phase in enumerate(phases)]
    values = {
        "seed": seed, "duration_s": duration_s, "timeline": json.dumps(timeline), "error": "", "outcome": "abort",
        "attempts": 0, "attempt_log": "[]", "nav_by_range": "[]", "cause": "never_steady",
    }  # fmt: skip
    return values | changes


def _group(rows):
    return Group("made", "camera", "ours", "predictive", "", tuple(rows))


def _heading(seed, **changes):
    figures = {
        "turned": 0.0,
        "error": 3.0,
        "sigma": 1.0,
        "error_rms": 3.0,
        "error_max": 4.0,
    }
    columns = {f"heading_{name}_deg": value for name, value in figures.items()} | {"heading_beyond_3_sigma": 0.0}
    return _row(seed) | columns | changes


def test_a_phase_lasts_until_the_next_and_the_last_until_the_flights_end():
    assert spans_of(_row(0)) == [("pre_contact", 0.0, 10.0), ("approach", 10.0, 30.0)]
    assert spans_of(_row(0, timeline=None)) == []


def test_bars_are_named_by_seeds():
    text = timelines(_group([_row(seed) for seed in (25500, 25517, 25531)]))
    assert all(f">{seed}</text>" in text for seed in (25500, 25517, 25531))
    assert "phases of the flights" in text and "run on" not in text


def test_of_many_flights_the_title_says_how_many_are_shown():
    text = timelines(_group([_row(seed) for seed in range(100, 141)]))
    assert "phases of the first 40 of 41 flights" in text
    assert ">139</text>" in text and ">140</text>" not in text


def test_a_long_flight_does_not_squeeze_the_others_and_is_said_to_run_on():
    durations_s = [20.0] * 19 + [100.0]
    assert axis_end(durations_s) == pytest.approx(25.0)
    text = timelines(_group([_row(seed, duration_s) for seed, duration_s in enumerate(durations_s)]))
    assert "time since the start [s]; 1 run on" in text and "until 100 s" in text
    assert axis_end([20.0, 22.0, 24.0]) == 24.0


def test_without_a_record_of_phases_there_is_no_picture():
    assert timelines(_group([_row(0, phases=())])) == ""
    assert timelines(_group([_row(0, error="ValueError: x")])) == ""


def test_headings_are_of_the_flights_that_kept_one():
    lost = _heading(2, heading_error_deg=None, heading_sigma_deg=None)
    found = headings_of([_row(0), _heading(1), lost, _heading(3, heading_error_deg=-4.0)])
    assert (found.flights, found.lost) == (3, 1)
    assert rms(found.at_end_deg) == pytest.approx(math.sqrt((3.0**2 + 4.0**2) / 2))
    assert headings_of([_row(0)]) is None
    assert math.isnan(rms(found.at_end_deg[1:2]))


def test_headings_have_a_panel_where_flights_kept_one():
    text = panels(_group([_heading(0), _heading(1, heading_error_deg=None, heading_sigma_deg=None)]))
    assert "own heading against the truth, 2 flights" in text and "1 lost at the end" in text
    assert "own heading" not in panels(_group([_row(0)]))
