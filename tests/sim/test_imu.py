"""The IMU as a whole: what it feels on a moving receiver, its clock, its streams, its faults, its sheets.

Statistical bounds are 4.5 standard errors (a false alarm in 1.5e5 each); seeds are fixed. The sensors' errors are in
test_imu_errors.py and test_imu_allan.py.
"""

from dataclasses import fields, replace
from typing import Any

import numpy as np
import pytest

from dockair.errors import DockairError
from dockair.messages import ReceiverCommand
from dockair.parameters import load_parameters
from dockair.rotations import exp
from dockair.sim.faults import ImuFault
from dockair.sim.imu import ImuParameters
from quiet_imu import QUIET, RATE, SHEET, forces_of, imu_of, rates_of, still

G = 9.80665
IDENTITY = np.eye(3)


# What an ideal IMU on the receiver feels


def test_a_steady_motion_is_measured_as_it_is_from_the_first_sample() -> None:
    w, f = np.tile([0.1, -0.2, 0.3], (50, 1)), np.tile([1.0, -2.0, 9.0], (50, 1))
    record = imu_of(QUIET).record(50, w, np.zeros((50, 3)), f)
    assert np.allclose(record.angular_rate_rad_s, w, atol=1e-9)
    assert np.allclose(record.specific_force_m_s2, f, atol=1e-9)


def test_standing_upright_the_accelerometers_read_gravity_upward() -> None:
    assert imu_of(QUIET).record(3).specific_force_m_s2[2] == pytest.approx([0.0, 0.0, G], abs=1e-9)


def test_the_mounting_turns_body_axes_into_the_imus() -> None:
    """An IMU turned by 90 deg to the left: its x axis is the body's y."""
    R_BI = exp(np.array([0.0, 0.0, np.pi / 2]))
    motion = np.tile([0.1, 0.2, 0.3], (3, 1))
    assert rates_of(QUIET, motion, R_BI=R_BI)[0] == pytest.approx([0.2, -0.1, 0.3], abs=1e-9)
    assert forces_of(QUIET, motion, R_BI=R_BI)[0] == pytest.approx([0.2, -0.1, 0.3], abs=1e-9)


def test_turning_about_the_vertical_pulls_the_imu_inward_and_speeding_up_pushes_it_along() -> None:
    """2 m ahead of the centre of gravity: -w^2 r along x; alpha r along y, to the left when the yaw rate grows."""
    w, alpha = np.tile([0.0, 0.0, 0.5], (3, 1)), np.tile([0.0, 0.0, 0.25], (3, 1))
    imu = imu_of(QUIET, p_BI=(2.0, 0.0, 0.0))
    felt = imu.record(3, w, alpha, np.zeros((3, 3))).specific_force_m_s2[0]
    assert felt == pytest.approx([-0.5, 0.5, 0.0], abs=1e-9)


def test_the_lever_arm_is_that_of_rigid_bodies_on_any_motion() -> None:
    w, alpha, f, r, turn = np.random.default_rng(1).normal(size=(5, 3))
    R_BI = exp(turn)
    expected = R_BI.T @ (f + np.cross(alpha, r) + np.cross(w, np.cross(w, r)))
    felt = imu_of(QUIET, R_BI=R_BI, p_BI=r).step(0.0, w, alpha, f)
    assert felt is not None
    assert felt.specific_force_m_s2 == pytest.approx(expected, abs=1e-9)
    assert felt.angular_rate_rad_s == pytest.approx(R_BI.T @ w, abs=1e-9)


def test_in_the_world_the_imus_place_accelerates_as_the_truth_says(make_world: Any, receiver_on_rails: Any) -> None:
    """Second difference of the IMU's own place, gravity added, against what it feels on a tumbling, pushed receiver.

    Truth's accelerations are those of the tick that ends where its rates are: 1 ms apart, so agreement is to some
    1e-3 of 20 m/s^2. MuJoCo takes a little of the gyroscopic torque implicitly: alpha dt is the change of w to 1e-3.
    """

    class Tumbling(receiver_on_rails):  # type: ignore[misc]
        def step(self, *, R_WB: np.ndarray, **state: Any) -> tuple[np.ndarray, np.ndarray]:
            self.time_s = getattr(self, "time_s", 0.0) + 1e-3
            torque_B = self.inertia_B @ [2.0 * np.cos(9.0 * self.time_s), 1.5, -2.0]
            return self.mass_kg * np.array([3.0, np.sin(7.0 * self.time_s), 9.0]), R_WB @ torque_B

    world, p_BI = make_world(receiver=Tumbling(), p_PD_B=(80.0, 0.0, 0.0)), np.array([3.0, -0.4, 0.7])
    truths = [world.step(ReceiverCommand()) for _ in range(700)]
    place = np.array([t.p_WB + t.R_WB @ p_BI for t in truths])
    for k in (300, 500, 690):
        before, at = truths[k - 1], truths[k]
        a_W = (place[k] - 2.0 * place[k - 1] + place[k - 2]) * 1e6
        expected = at.R_WB.T @ (a_W + [0.0, 0.0, G])
        sample = imu_of(QUIET, p_BI=p_BI).step(at.time_s, at.w_WB_B, at.alpha_WB_B, at.specific_force_B)
        np.testing.assert_allclose(sample.specific_force_m_s2, expected, atol=0.05)
        assert np.linalg.norm(expected - at.specific_force_B) > 5.0  # the lever arm's share
        np.testing.assert_allclose(at.alpha_WB_B, (at.w_WB_B - before.w_WB_B) * 1e3, atol=5e-3)


def test_a_bias_uses_up_range() -> None:
    """Clipping comes after everything that is added: a biased gyro saturates at its range, not beyond it."""
    sheet = replace(QUIET, gyro_turn_on_bias_sigma_rad_s=0.5)
    imu = imu_of(sheet)
    bias = imu.gyro_bias_I
    out = imu.record(1, w_WB_B=np.sign(bias)[None] * (SHEET.gyro_range_rad_s - 1e-3)).angular_rate_rad_s[0]
    assert np.abs(bias).min() > 2e-3
    assert np.abs(out) == pytest.approx(SHEET.gyro_range_rad_s, abs=1e-9)


# Clock


def test_time_stamps_jitter_by_their_standard_deviation_and_the_samples_do_not() -> None:
    n = 20000
    jittery, exact = (imu_of(replace(SHEET, time_stamp_jitter_s=s), 4).record(n, start_s=3.0) for s in (5e-5, 0.0))
    assert np.allclose(exact.time_stamp_s, 3.0 + np.arange(n) / RATE, atol=1e-12)
    error = jittery.time_stamp_s - exact.time_stamp_s
    assert error.var() == pytest.approx(25e-10, rel=4.5 * np.sqrt(2.0 / n))
    assert abs(error.mean()) < 4.5 * 5e-5 / np.sqrt(n)
    assert abs((error[1:] * error[:-1]).mean()) / 25e-10 < 4.5 / np.sqrt(n)
    assert np.array_equal(jittery.angular_rate_rad_s, exact.angular_rate_rad_s)


def test_time_stamps_stay_in_order_however_bad_the_clock() -> None:
    stamps = imu_of(replace(SHEET, time_stamp_jitter_s=0.01)).record(20000).time_stamp_s
    assert np.diff(stamps).min() > 0.0
    assert np.abs(stamps - np.arange(20000) / RATE).max() <= 0.49 / RATE + 1e-12


# Streams, steps and records


def test_a_record_is_what_so_many_steps_give_bit_for_bit() -> None:
    n = 9000  # more than a block of random numbers
    w, alpha, f = np.random.default_rng(6).normal(size=(3, n, 3))
    stamps, rates, forces = imu_of(SHEET, p_BI=(1.0, 0.2, -0.3)).record(n, w, alpha, f)
    stepping = imu_of(SHEET, p_BI=(1.0, 0.2, -0.3))
    samples = [stepping.step(k / RATE, w[k], alpha[k], f[k]) for k in range(n)]
    assert np.array_equal([s.time_stamp_s for s in samples], stamps)
    assert np.array_equal([s.angular_rate_rad_s for s in samples], rates)
    assert np.array_equal([s.specific_force_m_s2 for s in samples], forces)


def test_steps_taken_together_are_those_taken_one_by_one_bit_for_bit() -> None:
    w, alpha, f = np.random.default_rng(8).normal(size=(3, 100, 3))
    times_s = [k / RATE for k in range(100)]
    alone, together = (imu_of(SHEET, p_BI=(1.0, 0.2, -0.3)) for _ in range(2))
    ones = [alone.step(times_s[k], w[k], alpha[k], f[k]) for k in range(100)]
    fives = [together.steps(times_s[k : k + 5], *(v[k : k + 5] for v in (w, alpha, f))) for k in range(0, 100, 5)]
    for one, other in zip(ones, (sample for five in fives for sample in five), strict=True):
        assert one is not None
        assert one.time_stamp_s == other.time_stamp_s
        assert np.array_equal(one.angular_rate_rad_s, other.angular_rate_rad_s)
        assert np.array_equal(one.specific_force_m_s2, other.specific_force_m_s2)


def test_a_record_goes_on_where_the_last_one_ended() -> None:
    w = np.random.default_rng(7).normal(size=(600, 3))
    whole = imu_of(SHEET).record(600, w).angular_rate_rad_s
    imu = imu_of(SHEET)
    parts = [imu.record(10, w[:10]), imu.record(190, w[10:200]), imu.record(400, w[200:])]
    assert np.array_equal(np.concatenate([p.angular_rate_rad_s for p in parts]), whole)


def test_the_same_streams_give_the_same_record_and_others_another() -> None:
    assert all(np.array_equal(a, b) for a, b in zip(still(SHEET, 20, seed=5), still(SHEET, 20, seed=5), strict=True))
    for a, b in zip(still(SHEET, 20, seed=5), still(SHEET, 20, seed=6), strict=True):
        assert not np.array_equal(a, b)


def test_switching_one_error_off_leaves_every_other_as_it_was() -> None:
    """Gyros without any error beside the same accelerometers and clock; a bias that goes leaves the noise."""
    gyroless = replace(SHEET, **{f.name: getattr(QUIET, f.name) for f in fields(SHEET) if f.name.startswith("gyro_")})
    usual, less = still(SHEET, 300), still(gyroless, 300)
    assert np.array_equal(usual.specific_force_m_s2, less.specific_force_m_s2)
    assert np.array_equal(usual.time_stamp_s, less.time_stamp_s)
    fine = replace(SHEET, gyro_quantum_rad_s=1e-12)
    biased, unbiased = (still(replace(fine, gyro_turn_on_bias_sigma_rad_s=s), 300)[1] for s in (3.5e-3, 0.0))
    assert np.ptp(biased - unbiased, axis=0).max() < 1e-11
    assert np.abs(biased - unbiased).min() > 1e-5


def test_a_rate_that_is_not_positive_is_refused() -> None:
    with pytest.raises(DockairError, match=r"imu\.rate_hz"):
        imu_of(SHEET, rate=0.0)


# Faults


def _pair(fault: ImuFault, parameters: ImuParameters = SHEET) -> tuple[list[Any], list[Any]]:
    """60 samples with a fault in the middle third, and without."""
    w, f = np.array([0.1, -0.2, 0.3]), np.array([0.0, 1.0, G])
    healthy, ill = imu_of(parameters, 9), imu_of(parameters, 9)
    ill_at = [fault if 20 <= k < 40 else None for k in range(60)]
    return (
        [ill.step(k / RATE, w, w, f, ill_at[k]) for k in range(60)],
        [healthy.step(k / RATE, w, w, f) for k in range(60)],
    )


def test_a_gyro_bias_step_adds_to_the_rates_while_it_lasts_and_to_nothing_else() -> None:
    step = np.array([0.02, 0.0, -0.01])
    ill, healthy = _pair(ImuFault(bias_rad_s=step), replace(SHEET, gyro_quantum_rad_s=1e-12))
    for k in range(60):
        change = ill[k].angular_rate_rad_s - healthy[k].angular_rate_rad_s
        assert change == pytest.approx(step if 20 <= k < 40 else np.zeros(3), abs=1e-11)
        assert np.array_equal(ill[k].specific_force_m_s2, healthy[k].specific_force_m_s2)


def test_a_saturated_gyro_sends_no_rate_beyond_the_shrunken_range() -> None:
    ill, healthy = _pair(ImuFault(range_rad_s=0.15))
    for k in range(60):
        limit = 0.15 if 20 <= k < 40 else np.inf
        expected = np.clip(healthy[k].angular_rate_rad_s, -limit, limit)
        assert ill[k].angular_rate_rad_s == pytest.approx(expected, abs=0.5 * SHEET.gyro_quantum_rad_s)
    assert np.abs(ill[0].angular_rate_rad_s).max() > 0.25


def test_a_shrunken_range_wider_than_the_sheets_changes_nothing() -> None:
    wide = ImuFault(range_rad_s=2.0 * SHEET.gyro_range_rad_s)
    fast = np.array([9.0, 0.0, 0.0])
    sample = imu_of(QUIET).step(0.0, fast, fast, fast, wide)
    assert sample is not None and sample.angular_rate_rad_s[0] == pytest.approx(SHEET.gyro_range_rad_s, abs=1e-9)


def test_after_a_drop_out_the_samples_are_those_of_an_imu_that_never_dropped_out() -> None:
    ill, healthy = _pair(ImuFault(dropped=True))
    for k in range(60):
        if 20 <= k < 40:
            assert ill[k] is None
        else:
            assert ill[k].time_stamp_s == healthy[k].time_stamp_s
            assert np.array_equal(ill[k].angular_rate_rad_s, healthy[k].angular_rate_rad_s)
            assert np.array_equal(ill[k].specific_force_m_s2, healthy[k].specific_force_m_s2)


# Sheets


def test_the_default_grade_is_the_sensor_of_the_sources() -> None:
    degrees = np.degrees
    assert degrees(SHEET.gyro_noise_density_rad_s_rthz) == pytest.approx(0.01, rel=1e-3)
    assert degrees(SHEET.gyro_bias_instability_rad_s) * 3600.0 == pytest.approx(10.0, rel=1e-2)
    assert degrees(SHEET.gyro_rate_random_walk_rad_s_rts) == pytest.approx(4e-4, rel=1e-2)
    assert degrees(SHEET.gyro_turn_on_bias_sigma_rad_s) == pytest.approx(0.2, rel=1e-2)
    assert degrees(SHEET.gyro_misalignment_sigma_rad) == pytest.approx(0.05, rel=1e-2)
    assert degrees(SHEET.gyro_range_rad_s) == pytest.approx(450.0, rel=1e-3)
    assert degrees(SHEET.gyro_g_sensitivity_sigma_rad_s_m) * G == pytest.approx(0.003, rel=1e-2)
    assert SHEET.accelerometer_noise_density_m_s2_rthz / G == pytest.approx(60e-6, rel=1e-2)
    assert SHEET.accelerometer_bias_instability_m_s2 / G == pytest.approx(15e-6, rel=1e-2)


def test_every_key_of_the_sheet_changes_what_its_name_says_and_nothing_else() -> None:
    n = 300
    swing = np.sin(0.3 * np.arange(n))[:, None]
    motion = (swing * [9.0, 0.1, -0.2], np.zeros((n, 3)), swing * [250.0, 1.0, 2.0])  # x beyond the ranges
    fine = replace(SHEET, gyro_quantum_rad_s=1e-10)
    usual = imu_of(fine).record(n, *motion)
    for f in fields(ImuParameters):
        other = imu_of(replace(fine, **{f.name: 0.9 * getattr(fine, f.name)})).record(n, *motion)
        changed = [not np.array_equal(a, b) for a, b in zip(usual, other, strict=True)]
        assert changed == [f.name.startswith(word) for word in ("time_stamp", "gyro", "accelerometer")], f.name


def test_no_error_of_a_better_grade_is_larger_than_a_worse_ones() -> None:
    tactical, mti, consumer = (load_parameters(f"imu_{g}", ImuParameters) for g in ("tactical", "mti", "consumer"))
    for f in fields(ImuParameters):
        if any(word in f.name for word in ("noise", "instability", "walk", "sigma", "jitter")):
            assert 0.0 < getattr(tactical, f.name) <= getattr(mti, f.name) <= getattr(consumer, f.name), f.name
