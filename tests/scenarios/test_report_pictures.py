"""Phases over time, named by seeds, on an axis that one flight does not stretch; own headings against the truth."""

import json
import math

import pytest

from dockair.nav.guidance.phases import Phase
from dockair.scenarios.report import timelines as pictures
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


def _drawn(rows, monkeypatch):
    """The picture of phases, not yet written."""
    with monkeypatch.context() as patch:
        patch.setattr(pictures, "as_svg", lambda figure, name: figure)
        return timelines(_group(rows))


def test_every_phase_has_a_colour_of_its_own_and_one_that_nobody_knows_is_black(monkeypatch):
    names = [*(phase.value for phase in Phase), "loiter"]
    figure = _drawn([_row(0, 10.0 * len(names), names)], monkeypatch)
    (bars,) = figure.axes[0].collections
    colours = [tuple(colour) for colour in bars.get_facecolors()]
    assert len(set(colours)) == len(names) and colours[-1] == (0.0, 0.0, 0.0, 1.0)
    (legend,) = figure.legends
    keys = {
        text.get_text(): patch.get_facecolor() for text, patch in zip(legend.texts, legend.get_patches(), strict=True)
    }
    assert keys == {name.replace("_", " "): colour for name, colour in zip(names, colours, strict=True)}


def test_a_flight_s_bar_is_as_long_as_its_phases_and_stands_beside_its_seed_the_first_on_top(monkeypatch):
    figure = _drawn([_row(7, 25.0), _row(3, 40.0, ("join_up", "approach", "clear"))], monkeypatch)
    ax = figure.axes[0]
    boxes = [[path.get_extents() for path in bars.get_paths()] for bars in ax.collections]
    assert [[(box.x0, box.x1) for box in row] for row in boxes] == [
        [(0.0, 10.0), (10.0, 25.0)], [(0.0, 10.0), (10.0, 20.0), (20.0, 40.0)],
    ]  # fmt: skip
    assert [0.5 * (row[0].y0 + row[0].y1) for row in boxes] == pytest.approx(ax.get_yticks().tolist(), abs=1e-9)
    assert [label.get_text() for label in ax.get_yticklabels()] == ["7", "3"]
    assert ax.yaxis_inverted()


def test_where_a_flight_runs_on_it_is_said_beside_its_own_bar(monkeypatch):
    (ax,) = _drawn([_row(seed, 100.0 if seed == 4 else 20.0) for seed in range(20)], monkeypatch).axes
    assert [(text.get_position(), text.get_text()) for text in ax.texts] == [((25.0, 4), " until 100 s")]
    assert ax.get_xlim() == (0.0, 25.0)
    assert axis_end([*(10.0 * k for k in range(1, 11)), 1000.0]) == 125.0  # nine in ten are no longer than 100 s


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
    assert "own heading against the truth, 1 flight<" in panels(_group([_heading(0)]))
    assert "own heading" not in panels(_group([_row(0)]))
