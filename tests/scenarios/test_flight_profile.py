"""A flight in bins of range, against errors and covariances put in by hand; its phases in order."""

from dataclasses import replace

import numpy as np
import pytest

from dockair.scenarios.judgement.flight_profile import RANGE_EDGES_M, navigation_by_range, timeline


def _flown(flight, count):
    ticks = flight.ticks(count)
    return [tick[3] for tick in ticks], [tick[0] for tick in ticks]


def test_each_bin_has_the_error_that_was_put_in(make_hand_made):
    """e = (5, 2, 0) mm: range and lateral error together have its length in every bin; attitude 0.01 rad."""
    flight = make_hand_made()
    bins = navigation_by_range(*_flown(flight, 600), flight.sheets.mounting)
    assert len(bins) > 1
    for entry in bins:
        assert np.hypot(entry.range_rmse_m, entry.lateral_rmse_m) == pytest.approx(np.hypot(5e-3, 2e-3), rel=1e-9)
        assert entry.attitude_rmse_deg == pytest.approx(np.degrees(0.01), rel=1e-9)


def test_an_estimate_ahead_of_the_truth_is_a_range_too_long(make_hand_made):
    flight = make_hand_made()
    solutions, truths = _flown(flight, 60)
    mounting = flight.sheets.mounting
    along = truths[-1].p_PD_B + mounting.p_BP - mounting.p_BC
    solutions = [
        replace(s, p_PD_B=t.p_PD_B + 0.02 * along / np.linalg.norm(along))
        for s, t in zip(solutions, truths, strict=True)
    ]
    (entry,) = navigation_by_range(solutions[-2:], truths[-2:], mounting)
    assert entry.range_bias_m == pytest.approx(0.02, rel=1e-3)


def test_expected_sizes_are_the_covariances_own(make_hand_made):
    """P = s^2 I: s along, s sqrt 2 across, s sqrt 3 rad of attitude."""
    flight = make_hand_made(sigma_m=0.01)
    for entry in navigation_by_range(*_flown(flight, 200), flight.sheets.mounting):
        assert entry.range_sigma_m == pytest.approx(0.01, rel=1e-9)
        assert entry.lateral_sigma_m == pytest.approx(0.01 * np.sqrt(2.0), rel=1e-9)
        assert entry.attitude_sigma_deg == pytest.approx(np.degrees(0.01 * np.sqrt(3.0)), rel=1e-9)


def test_of_a_covariance_that_differs_by_direction_the_line_of_sight_has_its_own(make_hand_made):
    """3 mm along it, 1 and 2 mm across; attitude 1, 2 and 2 mrad."""
    flight = make_hand_made()
    solutions, truths = _flown(flight, 60)
    along = truths[-1].p_PD_B + flight.sheets.mounting.p_BP - flight.sheets.mounting.p_BC
    axes = np.linalg.qr(np.column_stack([along, np.eye(3)[:, 1:]]))[0]
    P = np.diag(np.square([1e-3, 2e-3, 2e-3, 0.0, 0.0, 0.0, 1.0, 1.0, 1.0]))
    P[3:6, 3:6] = axes @ np.diag(np.square([3e-3, 1e-3, 2e-3])) @ axes.T
    (entry,) = navigation_by_range([replace(solutions[-1], covariance=P)], truths[-1:], flight.sheets.mounting)
    assert entry.range_sigma_m == pytest.approx(3e-3, rel=1e-9)
    assert entry.lateral_sigma_m == pytest.approx(np.sqrt(5.0) * 1e-3, rel=1e-9)
    assert entry.attitude_sigma_deg == pytest.approx(np.degrees(3e-3), rel=1e-9)


def test_every_new_frame_falls_into_one_bin(make_hand_made):
    flight = make_hand_made()
    solutions, truths = _flown(flight, 400)
    bins = navigation_by_range(solutions, truths, flight.sheets.mounting)
    assert sum(entry.count for entry in bins) == 200  # a frame at every second tick
    assert {entry.low_m for entry in bins} <= set(RANGE_EDGES_M)


def test_without_a_valid_solution_there_is_no_bin(make_hand_made):
    flight = make_hand_made()
    solutions, truths = _flown(flight, 40)
    assert navigation_by_range([replace(s, valid=False) for s in solutions], truths, flight.sheets.mounting) == ()


def test_phases_are_listed_once_each_time_they_begin(make_hand_made):
    solutions, _ = _flown(make_hand_made(), 30)
    says = [("a", "first")] + 9 * [("a", "later")] + 10 * [("b", "")] + 10 * [("a", "again")]
    flown = [replace(s, phase=name, phase_reason=why) for s, (name, why) in zip(solutions, says, strict=True)]
    entries = timeline(flown)
    assert [entry.phase for entry in entries] == ["a", "b", "a"]
    assert [entry.reason for entry in entries] == ["first", "", "again"]
    assert [entry.begun_s for entry in entries] == [flown[k].time_stamp_s for k in (0, 10, 20)]
