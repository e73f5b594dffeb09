"""The library: every scenario loads, claims something, is held to figures, and stands on its page."""

import tomllib
from pathlib import Path

import pytest

from dockair.scenarios.assembly import parts
from dockair.scenarios.loop import Flight
from dockair.scenarios.scenario_file import scenario_names, scenario_text
from dockair.scenarios.schema import load_scenario

NAMES = scenario_names()
PAGE = (Path(__file__).parents[2] / "docs" / "scenarios.md").read_text(encoding="utf-8")
HARMLESS = {"severe_gusts", "dead_reel"}  # held to doing no harm: nobody is to dock at any price
FREE = {"name", "claim", "accept"}  # keys that do not change a flight


@pytest.mark.parametrize("name", NAMES)
def test_a_scenario_claims_something_in_a_sentence_and_is_held_to_figures(name):
    scenario = load_scenario(name)
    assert scenario.name == name
    assert scenario.claim and scenario.claim[0].islower() and not scenario.claim.endswith(".")
    accept = scenario.accept
    assert accept.unsafe_max == 0 and (accept.claims_rates or accept.outcome == "abort")  # then every flight has to


@pytest.mark.slow
@pytest.mark.parametrize("name", NAMES)
def test_a_scenario_is_built_and_flies_to_its_first_frame(name, monkeypatch):
    monkeypatch.setattr(parts, "SETTLE_S", 0.0)  # of the hose, before the flight: most of the time that it takes
    flight = Flight(load_scenario(name), 1)
    try:
        ticks = [flight.step() for _ in range(10)]
    finally:
        flight.close()
    assert [tick.outcome for tick in ticks] == [None] * 10
    assert any(tick.frame is not None for tick in ticks) == (flight.camera is not None)
    assert ticks[-1].solution.phase in ("join_up", "pre_contact")


@pytest.mark.parametrize("name", [name for name in NAMES if name not in HARMLESS])
def test_whoever_is_to_dock_is_held_to_the_limits_of_service_practice(name):
    """Contact within 0.15 m of the centre at 1.0 to 1.5 m/s; before severe gusts and red lights, no harm instead."""
    accept = load_scenario(name).accept
    assert (accept.outcome, accept.radial_offset_max_m) == ("contact", 0.15)
    assert (accept.closure_speed_min_m_s, accept.closure_speed_max_m_s, accept.closure_rate_min) == (1.0, 1.5, 0.95)
    assert accept.refuelled_rate_min == (None if name == "dead_reel_unnoticed" else 0.95)
    assert accept.first_attempt_rate_min >= 0.7 and accept.success_rate_min >= max(accept.first_attempt_rate_min, 0.95)


def test_the_levels_of_turbulence_are_held_to_the_figures_of_the_project():
    light, moderate, severe = (load_scenario(f"{level}_gusts") for level in ("light", "moderate", "severe"))
    assert [s.turbulence.intensity for s in (light, moderate, severe)] == ["light", "moderate", "severe"]
    figures = [
        (s.accept.first_attempt_rate_min, s.accept.success_rate_min, s.accept.radial_offset_median_max_m)
        for s in (light, moderate)
    ]
    assert figures == [(0.95, 0.99, 0.05), (0.70, 0.95, 0.08)]
    assert severe.accept.clean_rate_min == 1.0 and severe.accept.outcome is None


def test_a_dead_reel_that_is_noticed_keeps_the_receiver_away_and_another_is_flown_as_any_hose():
    noticed, unnoticed = load_scenario("dead_reel"), load_scenario("dead_reel_unnoticed")
    assert noticed.accept.outcome == "abort"
    docks = {"seed": 0, "error": "", "unsafe": "", "success": True, "first_attempt": True, "outcome": "contact"}
    docks |= {"radial_offset_m": 0.04, "closure_speed_m_s": 1.2, "sensing": "camera"}
    assert noticed.accept.judge([docks]) == ["1 of 1 flights fall short: seeds 0"]
    assert noticed.accept.judge([docks | {"success": False, "outcome": "abort"}]) == []
    assert [fault.unnoticed for fault in (*noticed.faults, *unnoticed.faults)] == [None, True]


def test_no_two_scenarios_fly_the_same():
    flown = {}
    for name in NAMES:
        table = {key: value for key, value in load_scenario(name).model_dump(mode="json").items() if key not in FREE}
        assert table not in flown.values(), name
        flown[name] = table


@pytest.mark.parametrize("name", NAMES)
def test_a_scenario_is_data_with_a_comment_that_says_what_differs_in_lines_of_at_most_120(name):
    text = scenario_text(name)
    assert text.startswith("# ")
    assert max(map(len, text.splitlines())) <= 120
    assert tomllib.loads(text)["name"] == name


def test_leds_out_are_as_many_as_the_name_says():
    for count in (1, 2, 3, 4):
        (fault,) = load_scenario(f"leds_out_{count}").faults
        assert fault.kind == "led_off" and len(set(fault.leds)) == count


def test_the_page_has_a_row_for_each_scenario_with_its_claim_and_no_other():
    library = PAGE[PAGE.index("## The library") : PAGE.index("## Acceptance")]
    rows = [line.split("|") for line in library.splitlines() if line.startswith("| `")]
    told = {row[1].strip(" `"): row[2].strip() for row in rows}
    assert told == {name: load_scenario(name).claim for name in NAMES}
