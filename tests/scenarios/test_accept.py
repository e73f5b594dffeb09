"""What a campaign is held to: counts against rates, and what is told of those that fall short."""

import re

import pytest

from dockair.errors import DockairError
from dockair.scenarios.accept import Accept, has_refuelled, is_clean


def row(seed=0, **changes):
    values = {
        "seed": seed, "error": "", "unsafe": "", "success": True, "first_attempt": True, "outcome": "contact",
        "radial_offset_m": 0.04, "closure_speed_m_s": 1.2, "sensing": "camera",
    }  # fmt: skip
    return values | changes


MISSED = {"outcome": "miss", "success": False, "first_attempt": False, "radial_offset_m": 0.4}
CRASHED = {"error": "ValueError: 3", "outcome": "", "success": None, "first_attempt": None, "unsafe": "", "sensing": ""}


def rows(good, bad, what):
    return [row(seed) for seed in range(good)] + [row(good + k, **what) for k in range(bad)]


def test_a_rate_is_reached_at_exactly_its_part_and_missed_by_one_flight_less():
    accept = Accept(first_attempt_rate_min=0.95)
    assert accept.judge(rows(19, 1, MISSED)) == []
    assert accept.judge(rows(18, 2, MISSED)) == ["contacts at the first attempt 18 of 20, wanted at least 95 %"]


@pytest.mark.parametrize("good", [7, 14, 28, 55, 56])
def test_a_rate_that_is_just_reached_is_reached_however_it_rounds(good):
    accept = Accept(success_rate_min=good / 100)
    assert accept.judge(rows(good, 100 - good, MISSED)) == []
    assert accept.judge(rows(good - 1, 101 - good, MISSED)) != []


def test_a_contact_in_a_later_attempt_counts_for_the_one_rate_and_not_for_the_other():
    later = rows(1, 1, {"first_attempt": False})
    accept = Accept(first_attempt_rate_min=1.0, success_rate_min=1.0)
    assert accept.judge(later) == ["contacts at the first attempt 1 of 2, wanted at least 100 %"]


@pytest.mark.parametrize(
    ("change", "refuelled"),
    [
        ({"fuel_kg": 116.0, "timeline": '[{"phase": "disconnect", "begun_s": 16.8, "reason": "refuelled"}]'}, True),
        ({"fuel_kg": 0.0, "timeline": '[{"phase": "disconnect", "begun_s": 16.8, "reason": "refuelled"}]'}, False),
        ({"fuel_kg": 69.0, "timeline": '[{"phase": "back_off", "begun_s": 10.7, "reason": "not come along"}]'}, False),
        ({"fuel_kg": None, "timeline": "[]"}, False),
        ({}, False),  # a table of before there was a time line
        (CRASHED, False),
    ],
)
def test_who_docks_and_is_called_back_has_not_refuelled(change, refuelled):
    assert has_refuelled(row(**change)) == refuelled
    lines = Accept(success_rate_min=0.0, refuelled_rate_min=1.0).judge([row(**change)])
    assert lines == ([] if refuelled else ["refuelled flights 0 of 1, wanted at least 100 %"])


def test_a_flight_that_crashed_counts_as_flown_without_success():
    accept = Accept(success_rate_min=0.9, clean_rate_min=0.9)
    assert accept.judge(rows(9, 1, CRASHED)) == []
    assert accept.judge(rows(8, 2, CRASHED)) == [
        "contacts in any attempt 8 of 10, wanted at least 90 %",
        "contacts or clean departures 8 of 10, wanted at least 90 %",
    ]


@pytest.mark.parametrize(
    ("change", "clean"),
    [
        ({}, True),
        (MISSED, True),
        (MISSED | {"outcome": "abort"}, True),
        (MISSED | {"outcome": "rim_strike"}, False),
        (MISSED | {"outcome": "timeout"}, False),
        (MISSED | {"outcome": "collision", "unsafe": "collision with hose_3"}, False),
        ({"success": False, "radial_offset_m": 0.2}, False),  # held, but from outside the limits
        ({"unsafe": "touch at 2.70 m/s"}, False),
        (CRASHED, False),
    ],
)
def test_a_flight_is_clean_that_made_a_good_contact_or_went_away_without_touching_anything(change, clean):
    assert is_clean(row(**change)) is clean


def test_the_median_is_over_the_contacts_alone():
    flights = [row(k, radial_offset_m=offset) for k, offset in enumerate([0.03, 0.05, 0.09])] + rows(0, 3, MISSED)
    assert Accept(radial_offset_median_max_m=0.05).judge(flights) == []
    assert Accept(radial_offset_median_max_m=0.049).judge(flights) == [
        "median radial offset 0.050 m, wanted at most 0.049"
    ]


def test_the_part_of_contacts_at_the_right_speed_counts_contacts_alone():
    flights = rows(19, 1, {"closure_speed_m_s": 1.6}) + rows(0, 5, MISSED)
    speeds = {"closure_speed_min_m_s": 1.0, "closure_speed_max_m_s": 1.5}
    assert Accept(closure_rate_min=0.95, **speeds).judge(flights) == []
    assert Accept(closure_rate_min=0.96, **speeds).judge(flights) == [
        "contacts at 1 to 1.5 m/s 19 of 20, wanted at least 96 %"
    ]


def test_where_no_rate_is_asked_for_every_flight_must_show_what_one_must():
    accept = Accept(outcome="contact", radial_offset_max_m=0.15)
    assert accept.judge(rows(5, 0, {})) == []
    assert accept.judge(rows(5, 2, MISSED)) == ["2 of 7 flights fall short: seeds 5, 6"]
    assert accept.judge(rows(0, 5, MISSED)) == ["5 of 5 flights fall short: seeds 0, 1, 2, 3, 4"]
    assert accept.judge(rows(0, 7, {"radial_offset_m": 0.16})) == [
        "7 of 7 flights fall short: seeds 0, 1, 2, 3, 4, ..."
    ]


def test_limits_of_a_contact_are_asked_of_the_flights_that_made_one():
    contacts_only = Accept(radial_offset_max_m=0.15, closure_speed_max_m_s=1.5)
    assert contacts_only.judge(rows(2, 1, MISSED | {"closure_speed_m_s": None})) == []
    assert contacts_only.judge(rows(2, 1, {"closure_speed_m_s": 1.6})) == ["1 of 3 flights fall short: seeds 2"]


def test_a_flight_that_crashed_falls_short_of_any_figure_that_every_flight_must_show():
    crashed = Accept(radial_offset_max_m=0.15).judge([row(0), row(1, **CRASHED)])
    assert crashed == ["1 of 2 flights fall short: seeds 1"]


def test_one_unsafe_flight_is_too_many_unless_the_scenario_grants_it_whatever_else_is_asked_for():
    flights = rows(99, 1, {"unsafe": "touch outside the basket, 0.27 m off the axis"})
    assert Accept().judge(flights) == ["unsafe in 1 of 100 flights, wanted at most 0: seeds 99"]
    assert Accept(unsafe_max=1).judge(flights) == []


def test_flights_of_different_sensing_are_not_pooled_and_none_are_no_campaign():
    with pytest.raises(DockairError, match=r"one kind of sensing, got \['camera', 'truth'\]"):
        Accept().judge([row(), row(1, sensing="truth")])
    with pytest.raises(DockairError, match="at least one flight"):
        Accept().judge([])


def test_the_acceptance_in_words_names_every_figure_asked_for():
    accept = Accept(
        outcome="contact", first_attempt_rate_min=0.7, success_rate_min=0.95, closure_rate_min=0.9, clean_rate_min=1.0,
        radial_offset_max_m=0.15, radial_offset_median_max_m=0.08, closure_speed_min_m_s=1.0,
        closure_speed_max_m_s=1.5, unsafe_max=2,
    )  # fmt: skip
    assert accept.in_words == (
        "contact, 70 % at the first attempt, 95 % within all, 100 % contact or clean departure, within 0.15 m, "
        "median offset 0.08 m, 90 % at 1 to 1.5 m/s, unsafe in at most 2"
    )
    assert Accept().in_words == Accept(unsafe_max=2).in_words == ""
    assert Accept(radial_offset_max_m=0.15).in_words == "within 0.15 m"


def test_what_could_not_be_measured_is_no_shortfall_where_nothing_is_asked_of_it():
    nothing = float("nan")
    assert Accept().shortfalls("contact", nothing, nothing, angle_deg=nothing) == []
    speed = Accept(closure_speed_min_m_s=1.0)
    assert speed.shortfalls("contact", nothing, nothing) == ["closure speed nan m/s, wanted 1 to inf"]


def test_what_was_unsafe_in_one_flight_is_a_shortfall_of_any_scenario():
    assert Accept().shortfalls("contact", 0.1, 1.2, ("touch at 2.70 m/s",)) == ["unsafe: touch at 2.70 m/s"]


def test_one_flight_that_docks_and_does_not_refuel_is_not_as_claimed_where_that_is_asked_for():
    asked = Accept(outcome="contact", refuelled_rate_min=0.95)
    assert asked.shortfalls("contact", 0.1, 1.2, refuelled=True) == []
    assert asked.shortfalls("contact", 0.1, 1.2, refuelled=False) == ["docked, and has not refuelled"]
    assert asked.shortfalls("abort", None, None, refuelled=False) == ["outcome abort, wanted contact"]
    assert Accept(outcome="contact").shortfalls("contact", 0.1, 1.2, refuelled=False) == []


def test_one_flight_that_is_asked_to_be_clean_is_held_to_it():
    clean = Accept(clean_rate_min=1.0)
    for outcome in ("abort", "miss"):
        assert clean.shortfalls(outcome, None, None) == []
    for outcome in ("timeout", "rim_strike", "collision", "diverged"):
        assert clean.shortfalls(outcome, None, None) == [f"outcome {outcome}, wanted a contact or a clean departure"]
    assert clean.shortfalls("contact", 0.14, 1.2) == []
    assert clean.shortfalls("contact", 0.24, 1.2) == ["radial offset 0.240 m, wanted 0 to 0.15"]
    assert clean.shortfalls("contact", 0.14, 2.7) == ["closure speed 2.700 m/s, wanted 0 to 2.6"]
    assert clean.shortfalls("contact", 0.14, 1.2, angle_deg=9.9) == []
    assert clean.shortfalls("contact", 0.14, 1.2, angle_deg=12.0) == ["angle 12.000 deg, wanted 0 to 10"]
    assert Accept(outcome="contact").shortfalls("contact", 0.14, 1.2, angle_deg=12.0) == []  # no good one is asked for
    assert Accept(clean_rate_min=1.0, outcome="timeout").shortfalls("timeout", None, None) == []  # asked for by name


def test_a_median_of_no_contact_is_none():
    lines = Accept(radial_offset_median_max_m=0.05).judge([row(0, **MISSED)])
    assert lines == ["median radial offset of no contact, wanted at most 0.05"]


def test_a_figure_of_a_contact_that_could_not_be_measured_is_inside_no_limit():
    flights = [row(0, radial_offset_m=None, closure_speed_m_s=None)]
    speeds = {"closure_speed_min_m_s": 1.0, "closure_speed_max_m_s": 1.5}
    assert len(Accept(closure_rate_min=0.1, radial_offset_median_max_m=0.1, **speeds).judge(flights)) == 2
    assert Accept(radial_offset_max_m=0.15).judge(flights) == ["1 of 1 flights fall short: seeds 0"]


@pytest.mark.parametrize(
    ("asked", "said"),
    [
        (
            {"closure_speed_min_m_s": 3.0, "closure_speed_max_m_s": 1.0, "closure_rate_min": 0.9},
            "accept.closure_speed_max_m_s: expected at least closure_speed_min_m_s = 3, got 1.0",
        ),
        ({"closure_rate_min": 0.9}, "accept.closure_rate_min: expected closure_speed_min_m_s or closure_speed_max_m_s"),
    ],
)
def test_what_nothing_could_meet_or_asks_for_nothing_is_refused(asked, said):
    with pytest.raises(DockairError, match=re.escape(said)):
        Accept(**asked)


def test_limits_of_ones_own_stand_in_the_place_of_a_good_contacts():
    loose = Accept(clean_rate_min=1.0, radial_offset_max_m=0.3, closure_speed_max_m_s=3.0)
    assert loose.shortfalls("contact", 0.24, 2.7) == []
    tight = Accept(clean_rate_min=1.0, radial_offset_max_m=0.05, closure_speed_max_m_s=1.0)
    assert tight.shortfalls("contact", 0.1, 1.2) == [
        "radial offset 0.100 m, wanted 0 to 0.05",
        "closure speed 1.200 m/s, wanted 0 to 1",
    ]


@pytest.mark.parametrize(
    ("speeds", "words", "counted"),
    [
        ({"closure_speed_min_m_s": 1.0}, "90 % from 1 m/s on", "1 to inf m/s 2 of 3"),
        ({"closure_speed_max_m_s": 1.5}, "90 % at 0 to 1.5 m/s", "0 to 1.5 m/s 2 of 3"),
        ({"closure_speed_min_m_s": 1.2, "closure_speed_max_m_s": 1.2}, "90 % at 1.2 to 1.2 m/s", "1.2 m/s 1 of 3"),
    ],
)
def test_of_two_closure_speeds_one_is_enough_and_both_may_be_the_same(speeds, words, counted):
    accept = Accept(closure_rate_min=0.9, **speeds)
    assert accept.in_words == words
    flights = [row(k, closure_speed_m_s=speed) for k, speed in enumerate((0.9, 1.2, 4.0))]
    (line,) = accept.judge(flights)
    assert line.endswith(f"{counted}, wanted at least 90 %")


def test_a_rate_of_nothing_asks_nothing_of_one_flight():
    assert Accept(refuelled_rate_min=0.0).shortfalls("contact", 0.1, 1.2, refuelled=False) == []
