"""Heading reproductions: the tracks, and the figures of the source that the parts' own tests do not check."""

import json

import numpy as np
import pytest

from dockair.scenarios.reproduce.heading import oval as heading_oval
from dockair.scenarios.reproduce.heading import straight as heading_straight
from dockair.scenarios.reproduce.heading.tracks import lap_places, oval_true_rates_rad_s
from dockair.scenarios.reproduce.heading.vision import calibration, seen_lap
from dockair.scenarios.reproduce.registry import ids, reproduce


def test_the_whole_source_is_registered():
    assert {"heading/fig2", "heading/fig5-7", "heading/fig8", "heading/fig9-11"} <= set(ids())


def test_a_lap_ends_where_it_began_turned_by_a_whole_turn_along_its_own_heading():
    places = lap_places(2000)
    np.testing.assert_allclose(places[-1] - places[0], [0.0, 0.0, 2.0 * np.pi], atol=1e-9)
    steps = np.diff(places[:, :2], axis=0)
    middle = 0.5 * (places[1:, 2] + places[:-1, 2])
    along = steps[:, 0] * np.cos(middle) + steps[:, 1] * np.sin(middle)
    np.testing.assert_allclose(along, np.hypot(*steps.T), rtol=1e-4)
    assert np.hypot(*steps.T).sum() == pytest.approx(2.0 * (84.39 + np.pi * 36.5), rel=1e-6)
    assert (oval_true_rates_rad_s() >= 0.0).all()


def test_the_straight_s_figures_are_json_and_drawn(tmp_path, monkeypatch):
    monkeypatch.setattr(heading_straight, "SEEDS", 3)
    table = reproduce("heading/fig5-7", tmp_path)
    assert json.loads(json.dumps(table))["id"] == "heading/fig5-7"
    assert (tmp_path / "heading-fig5-7.png").stat().st_size > 10_000
    assert all(set(row["reference"]) <= set(row["ours"]) for row in table["rows"])
    printed = [row for row in table["rows"] if row["case"].startswith("printed")]
    assert len(printed) == len(heading_straight.NOISES_DEG_S) > 0
    for row in printed:
        assert row["ours"]["most_left_deg"] <= row["reference"]["most_left_deg"]


def test_a_heading_of_the_oval_has_one_colour_in_both_panels(tmp_path, monkeypatch):
    from matplotlib.figure import Figure

    drawn = []
    monkeypatch.setattr(Figure, "savefig", lambda figure, *_, **__: drawn.append(figure))
    headings = {name: np.linspace(0.0, end, 100) for name, end in (("true", 12.0), ("raw", 13.0), ("hdr", 11.0))}
    monkeypatch.setattr(heading_oval, "walk", lambda *_: headings | {"vdr": headings["true"] + 0.01})
    heading_oval._draw(tmp_path / "oval.png")
    above, below = ({line.get_label(): line.get_color() for line in panel.lines} for panel in drawn[0].axes)
    assert below == {name: above[name] for name in ("raw gyro", "HDR", "VDR")}
    assert len(set(above.values())) == 4


@pytest.mark.slow
def test_turns_of_a_lap_s_first_curve_are_seen_better_than_in_the_source():
    line = calibration()
    assert np.degrees(line.line.slope_rad_px) == pytest.approx(np.degrees(1.0 / 900.0), rel=2e-3)
    assert abs(np.degrees(line.printed.offset_rad)) < 1e-3
    lap = seen_lap(walked=50)
    errors = np.abs(np.degrees(np.diff(lap.seen_rad) - np.diff(lap.true_rad)))
    assert errors.mean() <= 0.6 and errors.max() <= 3.0
    assert np.degrees(lap.seen_rad[-1]) == pytest.approx(np.degrees(lap.true_rad[-1]), abs=1.5)
