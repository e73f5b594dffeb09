"""Figures of a flight against errors put in by hand."""

import json
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pyarrow.parquet as pq
import pytest
from scipy.spatial.transform import Rotation

from dockair.messages import ReceiverCommand
from dockair.rotations import exp
from dockair.scenarios.flight_log import FlightLog, standard_deviations
from dockair.scenarios.judgement import metrics, result
from dockair.scenarios.judgement.causes import flown_of
from dockair.scenarios.judgement.hold import hold_of
from dockair.scenarios.judgement.referee import Referee
from dockair.scenarios.schema import load_scenario


def _log(flight, count: int) -> FlightLog:
    log = FlightLog()
    for entry in flight.ticks(count):
        log.append(*entry)
    return log


def _summary(flight, log: FlightLog, **changes):
    values = dict(
        scenario="hand_made", seed=3, outcome="timeout", referee=Referee(),
        flown=flown_of(load_scenario("default"), flight.sheets.mounting, log.truths, log.solutions), frames=log.frames,
        mounting=flight.sheets.mounting, sensing="camera", background="mujoco", wall_time_s=2.0, out_dir=None,
    )  # fmt: skip
    return result.summarise(**(values | changes))


def test_an_error_is_split_into_along_and_across_the_line_of_sight():
    """True point at (3, 4, 0): along is (0.6, 0.8, 0). An error of 0.1 along and (0, 0, 0.02) across."""
    true = np.array([[3.0, 4.0, 0.0]])
    along, across = metrics.line_of_sight_errors(true + [[0.06, 0.08, 0.02]], true)
    assert along[0] == pytest.approx(0.1, abs=1e-15)
    assert across[0] == pytest.approx(0.02, abs=1e-15)


def test_errors_of_a_flight_are_those_put_in(make_hand_made):
    """e = (5, 2, 0) mm in body axes; range and lateral error together have its length at every tick."""
    flight = make_hand_made()
    log = _log(flight, 100)
    nav = metrics.navigation_figures(log.solutions, log.truths, flight.sheets.mounting)
    assert np.hypot(nav.range_rmse_m, nav.lateral_rmse_m) == pytest.approx(np.hypot(5e-3, 2e-3), rel=1e-9)
    assert nav.attitude_rmse_deg == pytest.approx(np.degrees(0.01), rel=1e-9)
    assert nav.velocity_rmse_m_s == pytest.approx(0.0, abs=1e-15)
    assert nav.frames_used == 50
    off = [replace(s, v_PD_B=s.v_PD_B + [0.1, -0.2, 0.2]) for s in log.solutions]
    assert metrics.navigation_figures(off, log.truths, flight.sheets.mounting).velocity_rmse_m_s == pytest.approx(0.3)


def test_nees_counts_errors_in_standard_deviations(make_hand_made):
    """x = (0.01, 0, 0 | 5 mm, 2 mm, 0 | 0): with sigma 0.01 on every state x'P^-1x = 1 + 0.25 + 0.04."""
    flight = make_hand_made(sigma_m=0.01)
    log = _log(flight, 20)
    nav = metrics.navigation_figures(log.solutions, log.truths, flight.sheets.mounting)
    assert nav.nees_mean == pytest.approx(1.29, rel=1e-9)
    unknown = replace(log.solutions[-1], covariance=np.diag([1.0] * 8 + [-1.0]))  # no covariance: it says nothing
    nav = metrics.navigation_figures([*log.solutions[:-1], unknown], log.truths, flight.sheets.mounting)
    assert nav.nees_mean == pytest.approx(1.29, rel=1e-9)


def test_nees_of_gaussian_errors_is_chi_square():
    """Mean of 2000 draws of chi2(9): standard deviation sqrt(18/2000) = 0.095; 4.5 sigma fail once in 1.5e5."""
    rng = np.random.default_rng(5)
    root = rng.normal(size=(9, 9))
    covariance = root @ root.T + np.eye(9)
    draws = rng.multivariate_normal(np.zeros(9), covariance, size=2000)
    mean = np.mean([metrics.normalised_error_squared(x, covariance) for x in draws])
    assert abs(mean - 9.0) < 4.5 * 0.095


def test_a_navigations_range_is_from_the_camera(hand_made):
    """Estimates 20 mm too far along the line of sight, which does not begin at the tip: all range, nothing across."""
    mounting, truths, solutions = hand_made.sheets.mounting, [], []
    for truth, _, _, solution in hand_made.ticks(60):
        along = truth.p_PD_B + mounting.p_BP - mounting.p_BC
        truths.append(truth)
        solutions.append(replace(solution, p_PD_B=truth.p_PD_B + 0.02 * along / np.linalg.norm(along)))
    figures = metrics.navigation_figures(solutions, truths, mounting)
    assert figures.range_rmse_m == pytest.approx(0.02, rel=1e-9)
    assert figures.range_max_m == pytest.approx(0.02, rel=1e-9)
    assert figures.lateral_max_m < 1e-9


@pytest.mark.parametrize("angle", [1e-9, 0.3, np.pi - 1e-6])
def test_the_attitude_error_is_the_rotation_that_mends_the_estimate(hand_made, angle):
    truth, _, _, solution = hand_made.tick(2)
    R_BD = truth.R_WB.T @ truth.R_WD
    axis = np.array([2.0, -1.0, 2.0]) / 3.0
    error = metrics.state_error(replace(solution, R_BD=exp(-angle * axis) @ R_BD), truth)
    np.testing.assert_allclose(error[:3], angle * axis, atol=1e-9)


def test_errors_of_place_and_velocity_are_true_less_believed_in_body_axes(make_truth, hand_made):
    """The receiver heads along W's y: what lies along the world's y is ahead of it, what lies along -x to its left."""
    R_WB = exp(np.array([0.0, 0.0, np.pi / 2]))
    truth = make_truth(
        1.0, R_WB=R_WB, p_WP=np.array([1.0, 2.0, 3.0]), p_WD=np.array([0.0, 6.0, 3.5]), v_WP=np.array([0.0, 1.2, 0.0]),
        v_WD=np.array([-0.4, 0.3, 0.1]),
    )  # fmt: skip
    believed = replace(hand_made.tick(2)[3], R_BD=R_WB.T, p_PD_B=np.array([4.0, 1.1, 0.3]), v_PD_B=np.zeros(3))
    error = metrics.state_error(believed, truth)
    np.testing.assert_allclose(error, [0.0, 0.0, 0.0, 0.0, -0.1, 0.2, -0.9, 0.4, 0.1], atol=1e-12)


def test_ticks_without_a_new_frame_or_a_valid_solution_do_not_count(hand_made):
    log = _log(hand_made, 10)
    solutions = [replace(s, valid=k != 5) for k, s in enumerate(log.solutions)]
    assert metrics.fresh_and_valid(solutions) == [1, 3, 7, 9]


def test_availability_is_counted_from_the_first_valid_tick():
    assert metrics.availability([False, False, True, True, False, True]) == 0.75
    assert metrics.availability([False, False]) == 0.0


def _hold_of(truths):
    """As of a flight whose every physics tick is a control tick."""
    referee = Referee()
    for truth in truths:
        referee.watch(truth)
    return hold_of(truths, referee.pull_max_n)


def test_hold_and_disconnect_are_read_from_the_latch(hand_made):
    """Latched from 6.55 to 8.49 s, so that the first free control tick is at 8.5 s."""
    truths = [hand_made.truth(10 * k) for k in range(1, 900)]
    hold, disconnect = _hold_of(truths)
    assert hold is not None and disconnect is not None
    assert hold.duration_s == pytest.approx(8.49 - 6.55)
    assert hold.take_in_max_m == pytest.approx(1.2)
    assert hold.coupling_force_max_n == 700.0
    assert disconnect.time_s == 8.5


def test_the_take_in_of_a_hold_is_the_most_that_was_wound_in_from_full_trail_while_it_lasted(make_truth):
    """0.3 m were wound in before the contact already, and 2 m are after it."""
    wound = ((False, 0.2), (True, 0.3), (True, 1.1), (True, 0.7), (False, 2.0))
    truths = [make_truth(0.01 * k, latched=held, reel_position_m=m) for k, (held, m) in enumerate(wound)]
    hold, _ = hold_of(truths, 700.0)
    assert hold is not None and hold.take_in_max_m == 1.1


def test_the_pull_that_opened_the_coupling_is_the_largest(hand_made):
    truths = [hand_made.truth(10 * k) for k in range(1, 900)]
    opens = next(k for k, truth in enumerate(truths) if truth.time_s == 8.5)
    truths[opens] = replace(truths[opens], coupling_force_n=1913.0)
    hold, _ = _hold_of(truths)
    assert hold is not None and hold.coupling_force_max_n == 1913.0


def test_the_pull_that_opened_the_coupling_between_two_control_ticks_counts_too(hand_made):
    """It lasts for one physics tick, of which the log has one in ten; the referee sees them all."""
    log, referee = _refereed(hand_made, 900)
    referee.pull_max_n = 1913.0
    hold = _summary(hand_made, log, referee=referee).hold
    assert hold is not None and hold.coupling_force_max_n == 1913.0


def test_the_largest_pull_is_the_referees_alone(hand_made):
    hold, _ = hold_of([hand_made.truth(10 * k) for k in range(1, 900)], 650.0)
    assert hold is not None and hold.coupling_force_max_n == 650.0


def test_of_two_holds_the_first_counts(hand_made):
    """Of the second everything is larger, and its time is later."""
    once = [hand_made.truth(10 * k) for k in range(1, 900)]
    again = [
        replace(t, time_s=9.0 + 2.0 * t.time_s, reel_position_m=2.0 * t.reel_position_m, coupling_force_n=900.0)
        for t in once
    ]
    assert _hold_of(once + again) == _hold_of(once)


def test_a_probe_still_held_at_the_end_was_not_disconnected(hand_made):
    _, disconnect = _hold_of([hand_made.truth(10 * k) for k in range(600, 700)])
    assert disconnect is None


def _refereed(flight, count: int) -> tuple[FlightLog, Referee]:
    """The log of some control ticks without pictures, and a referee who watched them."""
    flight.frame = lambda truth: None
    log, referee = _log(flight, count), Referee()
    for truth, solution in zip(log.truths, log.solutions, strict=True):
        referee.watch(truth)
        referee.judge(truth, solution.phase, 60.0, usable=solution.valid, reason=solution.phase_reason)
    return log, referee


def test_result_json_has_the_documented_keys_and_no_others(hand_made, tmp_path):
    log, referee = _refereed(hand_made, 700)
    result = _summary(hand_made, log, referee=referee, outcome="contact", out_dir=tmp_path, wall_time_s=70.0)
    written = json.loads(result.write(tmp_path).read_text())
    assert list(written) == [
        "schema_version", "scenario", "seed", "outcome", "success", "first_attempt", "cause", "unsafe", "attempts",
        "attempt_log", "contact", "hold", "disconnect", "fuel_kg", "collided_with", "sensing", "truth_navigation",
        "background", "nav", "heading", "frames", "duration_s", "real_time_factor", "wall_time_s", "versions",
        "timeline", "nav_by_range", "shortfalls", "out_dir",
    ]  # fmt: skip
    page = (Path(__file__).parents[2] / "docs" / "results.md").read_text(encoding="utf-8")
    documented = page[page.index("## result.json") : page.index("## as_built.json")]
    for key in (*written, *(f"attempt_log[].{key}" for key in written["attempt_log"][0])):
        assert f"`{key}`" in documented or f"`{key}." in documented, key
    assert list(written["contact"]) == ["time_s", "radial_offset_m", "closure_speed_m_s", "angle_deg"]
    assert written["real_time_factor"] == pytest.approx(0.1)
    assert written["versions"]["dockair"]


def test_attempts_contact_and_fuel_of_a_flight_come_from_the_referee_and_the_truth(hand_made):
    """The hand-made probe stops at the ring's plane and closes at 1.2 m/s from 3 s on; it is held at 6.55 s."""
    log, referee = _refereed(hand_made, 700)
    result = _summary(hand_made, log, referee=referee, outcome="contact")
    (attempt,) = result.attempt_log
    assert (result.attempts, attempt.number, attempt.outcome, attempt.cause) == (1, 1, "contact", "")
    assert (attempt.begun_s, attempt.ended_s) == (3.0, 6.55)
    assert result.first_attempt and result.success and result.unsafe == () and result.cause == ""
    assert result.fuel_kg == log.truths[-1].fuel_kg
    assert not result.truth_navigation and result.sensing == "camera"
    perfect = _summary(hand_made, log, sensing="truth")
    assert perfect.truth_navigation and perfect.nav_by_range == () and result.nav_by_range != ()


def test_a_contact_in_the_second_attempt_is_a_success_and_none_of_the_first(hand_made):
    """A first attempt of half a second, that was called back, before the one in which the probe is held until 8.5 s."""
    hand_made.frame = lambda truth: None
    log, referee = _log(hand_made, 900), Referee()
    for k, (truth, solution) in enumerate(zip(log.truths, log.solutions, strict=True)):
        log.solutions[k] = replace(solution, phase="approach") if k < 50 else solution
        referee.watch(truth)
        referee.judge(truth, log.solutions[k].phase, 60.0)
    result = _summary(hand_made, log, referee=referee, outcome="contact")
    assert [attempt.outcome for attempt in result.attempt_log] == ["given_up", "contact"]
    assert (result.attempts, result.success, result.first_attempt) == (2, True, False)
    assert result.cause == result.attempt_log[0].cause != ""
    assert result.disconnect is not None and result.disconnect.time_s == 8.5


def test_a_flight_that_never_approached_has_a_cause_without_an_attempt(hand_made):
    result = _summary(hand_made, _refereed(hand_made, 200)[0])
    assert (result.attempts, result.attempt_log, result.success, result.cause) == (0, (), False, "never_steady")


def test_what_could_not_be_measured_is_null_and_not_nan(hand_made):
    blind = _log(hand_made, 1)  # no frame yet
    text = _summary(hand_made, blind).to_json()
    assert "NaN" not in text
    assert json.loads(text)["nav"]["range_rmse_m"] is None
    assert json.loads(text)["contact"] is None
    assert replace(_summary(hand_made, blind), wall_time_s=float("inf")).to_dict()["wall_time_s"] is None


def test_a_heading_is_judged_by_how_far_the_receiver_turned_since_the_start(hand_made):
    """It turns by 400 degrees from a heading of 170; what is believed is ahead by 1 % of the turn, sigma 1 degree."""
    log = _log(hand_made, 101)
    turned = np.radians(4.0) * np.arange(101)
    headings = zip(log.truths, np.radians(170.0) + turned, strict=True)
    truths = [replace(t, R_WB=exp(np.array([0.0, 0.0, h])) @ t.R_WB) for t, h in headings]
    believed = zip(log.solutions, 1.01 * turned, strict=True)
    solutions = [replace(s, heading_rad=h, heading_sigma_rad=np.radians(1.0)) for s, h in believed]
    for k in range(21):  # none yet
        solutions[k] = replace(solutions[k], heading_rad=float("nan"), heading_sigma_rad=float("nan"))
    figures = metrics.heading_figures(solutions, truths)
    assert figures.turned_deg == pytest.approx(400.0)
    assert figures.error_deg == figures.error_max_deg == pytest.approx(4.0)
    assert figures.sigma_deg == pytest.approx(1.0)
    assert figures.error_rms_deg == pytest.approx(np.sqrt(np.mean((0.04 * np.arange(21, 101)) ** 2)))
    assert figures.beyond_3_sigma == pytest.approx(25 / 80, abs=1.01 / 80)  # at the 75th step it is 3 sigma
    assert metrics.heading_figures(log.solutions, log.truths) is None


def test_flight_parquet_holds_truth_and_belief_side_by_side(hand_made, tmp_path):
    log = _log(hand_made, 30)
    table = pq.read_table(log.write_parquet(tmp_path))
    assert table.num_rows == 30
    error = table["nav_p_PD_B_x_m"].to_numpy() - table["truth_p_PD_B_x_m"].to_numpy()
    np.testing.assert_allclose(error, 0.005, atol=1e-12)
    np.testing.assert_allclose(table["nav_sigma_p_PD_B_y_m"].to_numpy(), 0.01)
    assert table["nav_leds_named"].to_pylist()[-1] == 8
    assert len(table["truth_p_WH_m"][0].as_py()) == 3 * 17


def test_each_column_of_the_log_is_what_its_name_says(hand_made):
    """One tick in which no two of these are alike."""
    truth, imu, frame, solution = hand_made.tick(750)
    vectors = (
        "v_WB", "w_WB_B", "alpha_WB_B", "a_WB", "specific_force_B", "v_WP", "v_WD", "w_WD_D", "gust_B_m_s",
        "gust_D_m_s",
    )  # fmt: skip
    truth = replace(
        truth,
        R_WT=exp(np.array([0.1, 0.2, -0.3])),
        **{name: np.array([1.0, -2.0, 3.0]) + 10.0 * k for k, name in enumerate(vectors)},
    )
    samples = [replace(sample, specific_force_m_s2=sample.angular_rate_rad_s + 7.0) for sample in imu]
    command = ReceiverCommand(velocity_m_s=np.array([0.1, 0.2, 0.3]), acceleration_m_s2=np.array([0.4, 0.5, 0.6]))
    named = np.where(np.arange(8)[:, None] < 5, solution.led_pixels_px, np.nan)
    seen = {"led_pixels_px": named, "heading_rad": 0.3, "heading_sigma_rad": 0.02, "contact_usable": True}
    covariance = np.diag(np.arange(1.0, 10.0) ** 2)
    solution = replace(solution, command=command, covariance=covariance, valid=False, phase_reason="why", **seen)
    log = FlightLog()
    log.append(truth, samples, frame, solution)
    row = {name: values[0] for name, values in log.columns().items()}

    def of(name, unit, letters="xyz"):
        return [row[f"{name}_{letter}{unit}"] for letter in letters]

    units = ("m_s", "rad_s", "rad_s2", "m_s2", "m_s2", "m_s", "m_s", "rad_s", "m_s", "m_s")
    for name, unit in zip(vectors, units, strict=True):
        assert of(f"truth_{name.removesuffix('_m_s')}", f"_{unit}") == getattr(truth, name).tolist()
    for name in ("p_WB", "p_WP", "p_WD", "p_WT"):
        assert of(f"truth_{name}", "_m") == getattr(truth, name).tolist()
    np.testing.assert_allclose(of("truth_p_PD_B", "_m"), truth.R_WB.T @ (truth.p_WD - truth.p_WP), atol=1e-12)
    np.testing.assert_allclose(of("truth_v_PD_B", "_m_s"), truth.R_WB.T @ (truth.v_WD - truth.v_WP), atol=1e-12)
    attitudes = (("truth_q_WB", truth.R_WB), ("truth_q_WD", truth.R_WD), ("truth_q_WT", truth.R_WT))
    for name, R in (*attitudes, ("nav_q_BD", solution.R_BD)):
        w, x, y, z = of(name, "", "wxyz")
        np.testing.assert_allclose(Rotation.from_quat([x, y, z, w]).as_matrix(), R, atol=1e-12)
    np.testing.assert_allclose(row["truth_p_WH_m"].reshape(-1, 3), truth.p_WH)
    assert (row["truth_reel_position_m"], row["truth_latched"]) == (truth.reel_position_m, True)
    np.testing.assert_allclose(of("nav_sigma_phi", "_rad"), [1.0, 2.0, 3.0])
    np.testing.assert_allclose(of("nav_sigma_p_PD_B", "_m"), [4.0, 5.0, 6.0])
    np.testing.assert_allclose(of("nav_sigma_v_PD_B", "_m_s"), [7.0, 8.0, 9.0])
    assert of("nav_v_PD_B", "_m_s") == solution.v_PD_B.tolist()
    assert of("command_velocity", "_m_s") + of("command_acceleration", "_m_s2") == [0.1, 0.2, 0.3, 0.4, 0.5, 0.6]
    assert of("gyro_w_WI_I", "_rad_s") == samples[-1].angular_rate_rad_s.tolist()  # of a tick's samples the newest
    assert of("accelerometer_f_I", "_m_s2") == samples[-1].specific_force_m_s2.tolist()
    assert (row["nav_leds_named"], row["nav_candidates"], row["camera_exposure_s"]) == (5, 9, 2e-5)
    assert (row["nav_heading_rad"], row["nav_sigma_heading_rad"]) == (0.3, 0.02)
    assert (row["nav_valid"], row["nav_contact_usable"], row["nav_phase_reason"]) == (False, True, "why")


def test_a_variance_below_zero_has_no_root_and_none_is_drawn(hand_made):
    solution = replace(hand_made.tick(1)[3], covariance=np.diag([-1.0, np.nan, *np.full(7, 4.0)]))
    np.testing.assert_array_equal(standard_deviations([solution]), [[np.nan, np.nan, *np.full(7, 2.0)]])


def test_every_column_of_the_log_stands_on_the_page_but_for_its_axis_and_unit(hand_made):
    page = (Path(__file__).parents[2] / "docs" / "results.md").read_text(encoding="utf-8")
    documented = page[page.index("## flight.parquet") : page.index("## messages.parquet")]
    for column in _log(hand_made, 3).columns():
        symbol = re.sub(r"_[wxyz](_m|_m_s|_m_s2|_rad|_rad_s|_rad_s2)?$", "", column)
        assert symbol in documented or symbol.removeprefix("truth_") in documented, column
