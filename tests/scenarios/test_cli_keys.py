"""The keys that a scenario may set, as they are shown: all of them, and each as it is checked."""

from pathlib import Path

import pytest

from dockair.errors import DockairError
from dockair.parameters import read_sheet
from dockair.scenarios.commands.keys import keys_page, scenario_keys
from dockair.scenarios.commands.library_output import show_keys
from dockair.scenarios.scenario_file import scenario_names, scenario_text
from dockair.scenarios.schema import Scenario, load_scenario

PAGE = Path(__file__).parents[2] / "docs" / "scenario_keys.md"
KEYS = {key.name: key for key in scenario_keys()}


def test_the_committed_page_is_what_the_tables_make():
    assert PAGE.read_text(encoding="utf-8") == keys_page()


def test_every_key_of_every_table_has_one_row_with_a_meaning():
    rows = [line for line in keys_page().splitlines() if line.startswith("| `")]
    assert [row.split("`")[1] for row in rows] == list(KEYS)
    assert all(row.replace("\\|", "").count("|") == 6 for row in rows)  # five cells: nothing in them breaks the table
    assert {key.table or key.name for key in KEYS.values()} == set(Scenario.model_fields)
    assert [name for name, key in KEYS.items() if not key.meaning] == []


def test_a_key_is_told_with_unit_range_default_and_the_comment_beside_it():
    def told(name):
        key = KEYS[name]
        return key.unit, key.range, key.default, key.meaning

    assert told("flight.airspeed_m_s") == ("m/s", "100 to 250", "180", "true airspeed")
    assert told("turbulence.intensity") == (
        "",
        "light, moderate, severe",
        "none",
        "MIL-F-8785C, at the altitude, from 610 m on",
    )
    assert told("gusts[].at_s") == ("s", "0 to 600", "", "when its front meets the drogue")
    assert told("faults[].stop_s")[:3] == ("s", "above 0", "none")
    assert told("tanker.bank_deg")[:3] == ("deg", "above 0, up to 45", "25")
    assert told("start.sigma_m")[:3] == ("m", "three numbers, each 0 to 20", "0.3, 0.3, 0.3")
    assert told("camera.background")[3].endswith(
        "where the machine has OpenGL"
    )  # a comment of two lines, above the key
    assert told("seed")[1:3] == ("0 to 2^63 - 1", "0")
    assert told("name")[2] == "" and told("weather.night")[1:3] == ("true, false", "false")


def test_the_default_that_is_told_is_the_one_that_is_set(tmp_path):
    path = tmp_path / "mine.toml"
    path.write_text('name = "mine"\n', encoding="utf-8")
    plain, checked = load_scenario(path), 0
    for name, key in KEYS.items():
        if key.default and key.default != "none" and "[]" not in name and "<" not in name:
            value = f"[{key.default}]" if "," in key.default else key.default
            assert load_scenario(path, {name: value}) == plain, name
            checked += 1
    assert checked > 40


@pytest.mark.parametrize(("name", "range_"), [("flight.airspeed_m_s", "99.9"), ("guidance.attempts_max", "21")])
def test_what_lies_outside_the_range_that_is_told_is_refused(name, range_):
    with pytest.raises(DockairError):
        load_scenario("default", {name: range_})


def test_a_part_of_a_name_chooses_keys_and_one_that_is_nowhere_is_refused():
    assert [key.name for key in scenario_keys("sun.")] == ["sun.present", "sun.azimuth_deg", "sun.elevation_deg"]
    with pytest.raises(
        DockairError, match=r"--keys: expected a part of a key's name, got 'sunn'; exists: accept, .*sun"
    ):
        scenario_keys("sunn")


def test_a_part_of_a_name_finds_keys_of_parameter_sheets_with_unit_range_and_default():
    start, hose = scenario_keys("hose.length")[0], scenario_keys("parameters.hose.length_m")
    assert [start] == hose and hose[0].table == "parameters"
    sheet = read_sheet("hose")["length_m"]
    told = hose[0].unit, hose[0].range, hose[0].default
    assert told == ("m", f"{sheet.low:g} to {sheet.high:g}", f"{sheet.value:g}") and sheet.source in hose[0].meaning
    camera, both = scenario_keys("camera_position_m")[0], [key.name for key in scenario_keys("capture_")]
    assert camera.default.count(",") == 2  # three numbers
    assert both == ["guidance.capture_radius_m", "parameters.coupling.capture_distance_m"]
    for key in scenario_keys("parameters.reel."):
        load_scenario("default", {key.name: key.default})


def test_keys_are_shown_a_line_each_brackets_included(capsys, monkeypatch):
    monkeypatch.setenv("COLUMNS", "300")
    show_keys(scenario_keys("faults[].d"))
    lines = capsys.readouterr().out.splitlines()
    assert [line.split()[0] for line in lines] == ["key", "faults[].duty", "faults[].depth"]
    assert "0 to 1" in lines[1] and lines[1].rstrip().endswith("part of a period in which the LED is bright")


def test_every_key_that_the_library_sets_is_told():
    said = {
        f"{table}.{line.partition(' ')[0]}" if table else line.partition(" ")[0]
        for name in scenario_names()
        for table, line in _settings(scenario_text(name))
        if not table.startswith("parameters.")
    }
    assert said <= set(KEYS)


def _settings(text):
    """Table and line of every setting; array tables with `[]`."""
    table = ""
    for line in text.splitlines():
        if line.startswith("["):
            array = line.startswith("[[")
            table = line.partition("#")[0].strip().strip("[]") + ("[]" if array else "")
        elif " = " in line and not line.startswith(("#", " ")):
            yield table, line
