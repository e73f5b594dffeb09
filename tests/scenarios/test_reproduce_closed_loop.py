"""Flights of the navigation's closed loop: one used frame against truths made by hand, and which flights are kept."""

import json
from dataclasses import replace
from types import SimpleNamespace

import cv2
import numpy as np
import pytest

from dockair.calibration import Mounting
from dockair.nav.navigator import Navigator
from dockair.nav.pose.planar import mirrored
from dockair.rotations import exp
from dockair.scenarios.judgement.metrics import true_relative_state
from dockair.scenarios.reproduce.fusion import closed_loop as fusion_closed_loop
from dockair.scenarios.reproduce.reference import picture_name

CLOSING_S = 4.0  # the hand-made flight is on its way in


@pytest.fixture
def believed(hand_made):
    """Truth, an exact belief about it, and what that is made a row of; the hardware is as its sheets say."""
    truth = hand_made.truth(round(1000 * CLOSING_S))
    _, _, _, solution = hand_made.tick(round(100 * CLOSING_S))
    R_BD, p_PD_B, v_PD_B = true_relative_state(truth)
    exact = replace(solution, p_PD_B=p_PD_B, v_PD_B=v_PD_B, R_BD=R_BD)
    navigator = Navigator.__new__(Navigator)
    navigator._filter = SimpleNamespace(innovation=(14.0, 13))
    as_built = SimpleNamespace(mounting=hand_made.sheets.mounting)
    flight = SimpleNamespace(sheets=hand_made.sheets, as_built=as_built, navigator=navigator)
    return flight, exact, truth


def row(flight, solution, truth):
    values = fusion_closed_loop._row(flight, solution, truth)
    return dict(zip(fusion_closed_loop._COLUMNS, values, strict=True))


def test_a_belief_that_is_the_truth_has_no_errors(believed, hand_made):
    flight, solution, truth = believed
    found = row(flight, solution, truth)
    assert found["time_s"] == CLOSING_S and found["range_m"] == pytest.approx(hand_made.p_CD(truth)[0])
    errors = ("range_error_m", "left_error_m", "up_error_m", "miss_left_m", "miss_up_m", "attitude_rad", "nees")
    assert [found[name] for name in errors] == pytest.approx([0.0] * len(errors), abs=1e-7)
    assert (found["wrong"], found["nis"], found["freedom"], found["valid"]) == (0.0, 14.0, 13.0, 1.0)


def test_errors_are_the_truth_less_the_belief_in_camera_axes_and_the_miss_in_the_receivers(believed):
    flight, solution, truth = believed
    off_B = np.array([0.03, 0.02, -0.01])
    found = row(flight, replace(solution, p_PD_B=solution.p_PD_B - off_B), truth)
    in_camera_axes = [found["range_error_m"], found["left_error_m"], found["up_error_m"]]
    assert in_camera_axes == pytest.approx(flight.sheets.mounting.R_BC.T @ off_B)
    assert (found["miss_left_m"], found["miss_up_m"]) == pytest.approx((0.02, -0.01))
    assert found["nees"] == pytest.approx(off_B @ off_B / solution.covariance[0, 0])


def test_a_camera_built_askew_that_shows_the_ring_where_it_is_leaves_the_error_to_the_miss(believed):
    """It sees the drogue rightly in its own axes, and its sheet turns that into the receiver's wrongly."""
    flight, solution, truth = believed
    nominal = flight.sheets.mounting
    built = Mounting(R_BC=nominal.R_BC @ exp(np.array([0.0, 0.0, 0.01])), p_BC=nominal.p_BC, p_BP=nominal.p_BP)
    flight.as_built.mounting = built
    to_sheet = nominal.R_BC @ built.R_BC.T
    from_camera_B = to_sheet @ (truth.p_PD_B + built.p_BP - built.p_BC)
    seen = replace(solution, p_PD_B=from_camera_B + nominal.p_BC - nominal.p_BP, R_BD=to_sheet @ solution.R_BD)
    found = row(flight, seen, truth)
    for name in ("range_error_m", "left_error_m", "up_error_m", "attitude_rad"):
        assert found[name] == pytest.approx(0.0, abs=1e-7), name
    assert found["miss_left_m"] == pytest.approx(0.01 * found["range_m"], rel=0.05)


def test_a_belief_at_the_mirror_image_is_the_wrong_minimum(believed):
    flight, solution, truth = believed
    mounting = flight.sheets.mounting
    p_CD = mounting.R_BC.T @ (truth.p_PD_B + mounting.p_BP - mounting.p_BC)
    other, _ = mirrored(mounting.R_BC.T @ solution.R_BD, p_CD, flight.sheets.ring.positions_D)
    found = row(flight, replace(solution, R_BD=mounting.R_BC @ other), truth)
    assert found["wrong"] == 1.0 and found["attitude_rad"] > fusion_closed_loop._MIRROR_APART_RAD


def test_a_belief_that_is_not_valid_has_no_nees_and_a_filter_without_a_frame_no_nis(believed):
    flight, solution, truth = believed
    flight.navigator._filter.innovation = None
    found = row(flight, replace(solution, valid=False), truth)
    assert np.isnan(found["nees"]) and np.isnan(found["nis"])
    assert (found["freedom"], found["valid"]) == (0.0, 0.0)


def approach(seed):
    """An approach from 12 to 2.4 m: 10 mm of range error, 1 mm across, a covariance that is right on average."""
    range_m = np.linspace(12.0, 2.4, 400)
    columns = {name: np.zeros_like(range_m) for name in fusion_closed_loop._COLUMNS}
    columns |= {"time_s": np.linspace(0.0, 8.0, 400), "range_m": range_m, "range_error_m": np.full(400, -0.010)}
    columns |= {"left_error_m": np.full(400, 0.001), "nees": np.full(400, 9.0), "valid": np.ones(400)}
    columns |= {"nis": np.full(400, 13.0), "freedom": np.full(400, 13.0)}
    return fusion_closed_loop.Rows(seed=seed, columns=columns)


@pytest.fixture
def flown(monkeypatch):
    """Overrides and seeds that are flown, from now on."""
    flights = []

    def fly(overrides, seed):
        flights.append((len(overrides), seed))
        return approach(seed)

    monkeypatch.setattr(fusion_closed_loop, "fly", fly)
    return flights


def test_twice_as_many_fly_on_the_measurement_model_and_errors_stand_by_range_in_the_printed_form(flown, tmp_path):
    result = fusion_closed_loop.reproduce(tmp_path, seeds=2)
    assert json.loads(json.dumps(result, allow_nan=False)) == result
    assert [sum(cases == overrides for cases, _ in flown) for overrides in (0, 1, 10)] == [2, 4, 4]
    rows = {row["case"]: row for row in result["rows"]}
    for case in fusion_closed_loop.CASES:
        ours = rows[case]["ours"]
        assert rows[case]["reference"].keys() <= ours.keys()
        for name in ("range_rmse_mm_at_10_m", "range_bias_mm_at_10_m", "range_rmse_mm_inside_5_m"):
            assert ours[name] == pytest.approx(10.0), name
        assert ours["lateral_rmse_mm_inside_5_m"] == pytest.approx(1.0)
        assert ours["nees_over_n"] == pytest.approx(1.0) and ours["nees_in_band_percent"] == 100.0
    assert rows["as drawn, 9-11 m from the camera"]["ours"]["frames"] == pytest.approx(4 * 400 * 2.0 / 9.6, abs=8)
    assert cv2.imread(str(tmp_path / picture_name("fusion/closed-loop"))).std() > 10.0


def test_what_is_in_the_folder_is_flown_again_only_if_other_code_or_another_scenario_flew_it(
    flown, tmp_path, monkeypatch
):
    monkeypatch.setattr(fusion_closed_loop, "_draw", lambda *_: None)
    first = fusion_closed_loop.reproduce(tmp_path, seeds=1)
    flown.clear()
    assert fusion_closed_loop.reproduce(tmp_path, seeds=1) == first and flown == []
    monkeypatch.setattr(fusion_closed_loop, "_FROM_12_M", {"start.aft_m": 11.0})
    fusion_closed_loop.reproduce(tmp_path, seeds=1)
    assert len(flown) == 5
    flown.clear()
    monkeypatch.setattr(fusion_closed_loop.Code, "digest", "of other code")
    fusion_closed_loop.reproduce(tmp_path, seeds=1)
    assert len(flown) == 5


def test_a_flight_of_before_its_code_was_written_down_is_flown_again(flown, tmp_path, monkeypatch):
    monkeypatch.setattr(fusion_closed_loop, "_draw", lambda *_: None)
    fusion_closed_loop.reproduce(tmp_path, seeds=1)
    flown.clear()
    (path,) = (tmp_path / "closed_loop" / "as_drawn_by_camera").iterdir()
    table = json.loads(path.read_text(encoding="utf-8"))
    del table["flown_by"]
    path.write_text(json.dumps(table), encoding="utf-8")
    fusion_closed_loop.reproduce(tmp_path, seeds=1)
    assert flown == [(0, 0)]


@pytest.mark.slow
def test_a_flight_has_a_row_of_every_used_frame_until_contact_is_gone_for(monkeypatch):
    """On the measurement model from 4 m before the drogue, as long as the receiver waits behind it."""
    monkeypatch.setattr(fusion_closed_loop, "_FROM_12_M", {"start.aft_m": 4.0})
    monkeypatch.setattr(fusion_closed_loop, "_BEFORE_CONTACT", ("join_up", "pre_contact"))
    flown = fusion_closed_loop.fly(fusion_closed_loop.CASES["as drawn"], 0)
    frames = len(flown["time_s"])
    assert frames > 20 and (np.diff(flown["time_s"]) > 0.0).all()
    assert np.median(np.diff(flown["time_s"])) == pytest.approx(0.02, abs=1e-6)
    settled = fusion_closed_loop._settled(flown)
    assert settled.any()
    for name in fusion_closed_loop._COLUMNS:
        assert np.isfinite(flown[name][settled]).all(), name
    assert (np.abs(flown["range_error_m"][settled]) < 0.05).all() and (flown["wrong"][settled] == 0.0).all()
    assert 0.01 < flown["nees"][settled].mean() / 9.0 < 5.0
