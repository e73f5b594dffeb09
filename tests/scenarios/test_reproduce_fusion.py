"""The relative filter on made-up approaches: limits claimed of it, on fewer of them."""

import json
from dataclasses import replace

import cv2
import numpy as np
import pytest

from dockair.nav.fusion import FusionSettings
from dockair.parameters import load_parameters
from dockair.rotations import log
from dockair.scenarios.reproduce.fusion import consistency as fusion_consistency
from dockair.scenarios.reproduce.fusion import outages as fusion_outages
from dockair.scenarios.reproduce.fusion.cases import Case, consistency, figures, tracks
from dockair.scenarios.reproduce.fusion.flight import Approach, _Motion, fly, navigation_sheets
from dockair.scenarios.reproduce.fusion.follow import Watching, calibrated
from dockair.scenarios.reproduce.reference import picture_name
from dockair.sim.imu import ImuParameters

SHORT = Approach(duration_s=1.0)


def test_the_made_up_motion_obeys_its_own_kinematics():
    """Differences of place and attitude against velocity, rate and specific force."""
    still = FusionSettings(formation_walk_m_s2_rts=0.0, drogue_acceleration_density=0.0, gust_density=(0.0, 0.0, 0.0))
    flown = fly(replace(SHORT, belief=still), 1)
    dt = flown.time_s[1]
    v = np.diff(flown.s_N, axis=0) / dt
    np.testing.assert_allclose(v, 0.5 * (flown.v_N[1:] + flown.v_N[:-1]), atol=1e-5)
    turns = np.array([log(a.T @ b) for a, b in zip(flown.R_NB[:-1], flown.R_NB[1:], strict=True)]) / dt
    np.testing.assert_allclose(turns, 0.5 * (flown.w_B[1:] + flown.w_B[:-1]), atol=1e-9)
    felt = np.array([R @ sample.specific_force_m_s2 for R, sample in zip(flown.R_NB, flown.imu, strict=True)])
    pushed = -np.diff(flown.v_N, axis=0) / dt  # of the receiver, the drogue's share being left out
    error = (felt[1:] + felt[:-1])[:, 0] / 2.0 - pushed[:, 0]
    assert np.abs(error.mean()) < 0.1  # the accelerometers' bias, 3 sigma


def test_a_swing_of_another_frequency_begins_as_it_goes_on():
    """d/dt E[m^2] = q + 2 E[m g] - 4 z W E[m^2] is nothing in gusts that have blown for ever; false alarms: 6e-5."""
    approach = replace(Approach(), swing_frequency_factor=1.3)
    belief, sheets = approach.belief, navigation_sheets(approach, load_parameters("imu_mti", ImuParameters))
    swings = [_Motion(approach, sheets, np.random.default_rng(seed)) for seed in range(4000)]
    m, g = (np.array([getattr(swing, name)[1:] for swing in swings]) for name in ("_m", "_drogue_gust"))
    friction = 4.0 * belief.swing_damping * 2.0 * np.pi * np.array(belief.swing_frequency_hz) * 1.3
    change = belief.drogue_acceleration_density**2 + 2.0 * m * g - friction * m**2
    z = change.mean(axis=0) / (change.std(axis=0) / np.sqrt(len(swings)))
    assert np.abs(z.sum()) < 4.0 * np.sqrt(2.0)


def test_the_same_seed_flies_the_same_gusts_whatever_is_as_built():
    nominal, built = fly(SHORT, 3), fly(replace(SHORT, as_built=("camera axes", "ring")), 3)
    np.testing.assert_array_equal(nominal.s_N, built.s_N)
    assert not np.allclose(nominal.built.ring_positions_D, built.built.ring_positions_D)
    np.testing.assert_array_equal(nominal.built.mounting.p_BC, built.built.mounting.p_BC)


def test_hardware_as_its_sheets_say_is_known_within_the_limits():
    case = fusion_consistency.cases()[0]
    assert case.name == fusion_consistency.NOMINAL
    flown = tracks(replace(case, approach=replace(case.approach, first_m=5.0, duration_s=2.0)), 6)
    assert not any(track.wrong_side.any() for track in flown)
    assert np.mean([track.used for track in flown]) > 0.99
    agreement = consistency(flown)
    assert agreement.nees_band[0] < 1.0 < agreement.nees_band[1]
    assert len(agreement.time_s) == len(agreement.nees) == len(agreement.nis)
    assert 0.6 < agreement.nees.mean() < 1.6
    assert agreement.nees_inside > 0.6
    lateral = np.concatenate([track.error_C[-20:, 4:6] for track in flown])
    assert np.sqrt(np.mean(lateral**2)) < 1e-3


@pytest.mark.slow
def test_hardware_as_built_is_known_within_the_limits():
    """8 approaches: range 50 mm at 10 m, 10 mm and across 5 mm inside 5 m; NEES over n within 0.5-2."""
    found = figures(tracks(fusion_consistency.cases()[2], 8))
    assert found["range_rmse_mm_at_10_m"] < 50.0 and abs(found["range_bias_mm_at_10_m"]) < 20.0
    assert found["range_rmse_mm_inside_5_m"] < 10.0 and found["lateral_rmse_mm_inside_5_m"] < 5.0
    assert 0.5 < found["nees_over_n"] < 2.0


def test_errors_that_are_not_carried_make_the_filter_too_sure():
    cases = {case.name: case for case in fusion_consistency.cases()}
    short = {name: replace(case, approach=replace(case.approach, duration_s=2.0)) for name, case in cases.items()}
    carried = figures_of_short(short[fusion_consistency.BUILT])
    dropped = figures_of_short(short["as built, its errors not carried"])
    assert carried < 3.0 and dropped > 30.0


def figures_of_short(case: Case) -> float:
    return float(consistency(tracks(case, 4)).nees.mean())


def test_after_half_a_second_without_camera_the_belief_is_wide_and_comes_back_within_three_frames():
    length_s, watching = fusion_outages.outages()["camera off for 0.5 s"]
    case = Case(name="", approach=replace(fusion_outages._APPROACH, duration_s=4.2), watching=watching)
    found = fusion_outages._at_end(tracks(case, 5), length_s)
    assert found["frames_to_recover"] <= 3
    assert found["range_sigma_mm"] > 30.0 and found["across_sigma_mm"] > 30.0
    assert found["nees_over_n"] < 3.0


def test_late_frames_with_right_stamps_cost_nothing_at_their_exposure():
    """The belief about the exposure is the same to the last bit, about the present it is not."""
    ends = {}
    for latency_s in (0.0, 0.1):
        watching = Watching(settings=calibrated(FusionSettings()), latency_s=latency_s)
        (track,) = tracks(Case(name="", approach=SHORT, watching=watching), 1)
        ends[latency_s] = track
    late = ends[0.1]
    np.testing.assert_allclose(late.error_C, ends[0.0].error_C[: len(late.error_C)], atol=1e-9)
    assert not np.allclose(late.error[-1, 3:6], late.error_C[-1, 3:], atol=1e-3)


@pytest.mark.slow
@pytest.mark.parametrize("module", [fusion_consistency, fusion_outages], ids=lambda module: module.ID)
def test_each_has_the_printed_form_is_json_and_draws_a_picture(module, tmp_path, monkeypatch):
    if module is fusion_consistency:
        cases = [replace(case, approach=replace(case.approach, duration_s=7.0)) for case in module.cases()[:3]]
        monkeypatch.setattr(module, "cases", lambda: cases)
    result = module.reproduce(tmp_path, 2)
    assert json.loads(json.dumps(result, allow_nan=False)) == result
    assert result["id"] == module.ID
    for row in result["rows"]:
        assert list(row) == ["case", "ours", "reference"]
        assert row["reference"].keys() <= row["ours"].keys()
    assert cv2.imread(str(tmp_path / picture_name(module.ID))).std() > 10.0
