"""Which samples are believed, and the rate between them."""

from dataclasses import replace

import numpy as np
import pytest

from dockair.calibration import GyroSheet, Mounting
from dockair.messages import ImuSample
from dockair.nav.imu_record import ImuRecord, Stamps

MOUNTING = Mounting(R_BC=np.eye(3), p_BC=np.zeros(3), p_BP=np.zeros(3))
GYRO = GyroSheet(rate_hz=100, noise_density_rad_s_rthz=1e-4, bias_sigma_rad_s=1e-3, range_rad_s=4.0)


def record() -> ImuRecord:
    return ImuRecord(MOUNTING, GYRO, 0.999)


def sample(time_s: float, rate: float = 0.1) -> ImuSample:
    return ImuSample(time_stamp_s=time_s, angular_rate_rad_s=np.array([0.0, rate, 0.0]))


@pytest.mark.parametrize(
    ("time_s", "rate"),
    [(1.0, 0.1), (0.9, 0.1), (np.nan, 0.1), (np.inf, 0.1), (1.1, np.nan), (1.1, 4.0), (1.1, -3.999)],
    ids=["same stamp", "backwards", "no stamp", "endless", "no rate", "saturated", "a digit below"],
)
def test_a_sample_that_says_nothing_is_not_taken(time_s, rate):
    kept = record()
    assert kept.take(sample(1.0))
    assert not kept.take(sample(time_s, rate))
    assert kept.times_s.tolist() == [1.0]


@pytest.mark.parametrize("axis", range(3))
def test_a_rate_at_the_limit_of_any_axis_is_not_taken(axis):
    rate_I = np.where(np.arange(3) == axis, 4.0, 0.1)
    assert not record().take(ImuSample(time_stamp_s=1.0, angular_rate_rad_s=rate_I))


@pytest.mark.parametrize("axis", range(3))
@pytest.mark.parametrize("sign", [-1.0, 1.0])
def test_a_force_at_the_limit_of_any_axis_is_none_and_its_rate_is_taken_all_the_same(axis, sign):
    kept = ImuRecord(MOUNTING, replace(GYRO, accelerometer_range_m_s2=20.0), 0.999)
    for time_s, force in ((1.0, 19.9), (1.1, 20.0), (1.2, 19.9)):
        force_I = np.where(np.arange(3) == axis, sign * force, 1.0)
        assert kept.take(ImuSample(time_stamp_s=time_s, angular_rate_rad_s=np.zeros(3), specific_force_m_s2=force_I))
    assert np.isfinite(kept.forces_B).all(axis=1).tolist() == [True, False, True]
    assert np.isnan(kept.mean_force_B(1.0, 1.2)).all()


def test_rates_and_forces_are_turned_into_body_axes():
    R_BI = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
    kept = ImuRecord(replace(MOUNTING, R_BI=R_BI), GYRO, 0.999)
    rate_I, force_I = np.array([0.1, 0.2, 0.3]), np.array([4.0, 5.0, 6.0])
    assert kept.take(ImuSample(time_stamp_s=1.0, angular_rate_rad_s=rate_I, specific_force_m_s2=force_I))
    np.testing.assert_allclose(kept.rates_B, [[-0.2, 0.1, 0.3]])
    np.testing.assert_allclose(kept.forces_B, [[-5.0, 4.0, 6.0]])


def test_samples_of_whole_numbers_or_single_precision_are_taken_as_they_are():
    kept = ImuRecord(replace(MOUNTING, R_BI=np.eye(3, dtype=int)), GYRO, 0.999)
    rate_I, force_I = np.array([0, 1, 2]), np.array([4.0, 5.0, 6.0], dtype=np.float32)
    assert kept.take(ImuSample(time_stamp_s=1.0, angular_rate_rad_s=rate_I, specific_force_m_s2=force_I))
    np.testing.assert_array_equal([*kept.rates_B, *kept.forces_B], [[0.0, 1.0, 2.0], [4.0, 5.0, 6.0]])


def test_a_rate_just_inside_the_range_is_taken():
    assert record().take(sample(1.0, 3.99))


def test_thousands_of_samples_are_kept_in_order_while_old_ones_are_forgotten():
    kept = record()
    for k in range(3000):
        assert kept.take(sample(0.01 * k, 0.001 * k))
        kept.forget(0.01 * k - 0.3)
    assert len(kept.times_s) < 40
    assert kept.times_s[0] <= 29.691 < kept.times_s[1]  # one before, to interpolate from
    np.testing.assert_allclose(kept.rates_B[:, 1], 0.1 * kept.times_s)
    assert kept.rate_B(29.805)[1] == pytest.approx(2.9805)


def test_nothing_is_lost_when_nothing_may_be_forgotten():
    kept = record()
    assert all(kept.take(sample(0.01 * k, 0.001 * k)) for k in range(1500))
    np.testing.assert_allclose(kept.times_s, 0.01 * np.arange(1500))
    np.testing.assert_allclose(kept.rates_B[:, 1], 0.001 * np.arange(1500))


def test_mean_rate_is_of_the_newest_samples_up_to_a_time_or_else_the_rate_there():
    kept = record()
    for k in range(5):
        kept.take(sample(1.0 + 0.01 * k, 0.1 * k**2))
    assert kept.mean_rate_B(1.035, 0.03)[1] == pytest.approx((0.1 + 0.4 + 0.9) / 3.0)
    assert kept.mean_rate_B(1.04, 0.015)[1] == pytest.approx((0.9 + 1.6) / 2.0)
    assert kept.mean_rate_B(1.2, 0.015)[1] == pytest.approx((0.9 + 1.6) / 2.0)  # held
    assert kept.mean_rate_B(1.04, 0.0)[1] == pytest.approx(1.6)
    assert kept.mean_rate_B(1.015, 0.05)[1] == pytest.approx(0.05)  # there are no more
    assert kept.mean_rate_B(0.9, 0.05)[1] == 0.0
    np.testing.assert_array_equal(record().mean_rate_B(1.0, 0.05), np.zeros(3))


def test_mean_rate_leaves_out_what_is_older_than_a_gap():
    """At 100 Hz, four samples: those that are 0.04 s older than the newest, or more."""
    kept = record()
    for k in (*range(10), *range(20, 26)):
        kept.take(sample(0.01 * k, 0.1 if k < 10 else 0.1 * k))
    means = [kept.mean_rate_B(0.01 * k, 0.04)[1] for k in (9, 15, 20, 21, 22, 23, 24)]
    np.testing.assert_allclose(means, [0.1, 0.1, 2.0, 2.05, 2.1, 2.15, 2.25])
    missed = record()
    for k in (0, 1, 2, 4):
        missed.take(sample(0.01 * k, 0.1 * k))
    assert missed.mean_rate_B(0.04, 0.04)[1] == pytest.approx((0.1 + 0.2 + 0.4) / 3.0)


@pytest.mark.parametrize("jitter_s", [0.0, 1e-6, 1e-5, 1e-4, 0.01], ids=["none", "tactical", "mti", "consumer", "most"])
@pytest.mark.parametrize(
    ("gyro_hz", "control_hz", "samples"),
    [(500, 100, 5), (300, 100, 3), (700, 100, 7), (250, 100, 3), (225, 100, 2), (125, 100, 1), (450, 180, 3)]
    + [(100, 100, 1), (50, 100, 1), (20, 100, 1)],
)
def test_of_a_control_period_as_many_samples_count_at_every_tick(gyro_hz, control_hz, samples, jitter_s):
    """The rate grows evenly, so that the mean is that of the moment to which it belongs. Jitter as [imu, eq 3]."""
    kept = ImuRecord(MOUNTING, replace(GYRO, rate_hz=gyro_hz), 0.999)
    draws, span_s, sent = np.random.default_rng(0), 1.0 / control_hz, 0
    for tick in range(1, 3000):
        while sent * control_hz <= tick * gyro_hz:
            off_s = np.clip(jitter_s * draws.standard_normal(), -0.49 / gyro_hz, 0.49 / gyro_hz)
            assert kept.take(sample(sent / gyro_hz + off_s, 0.1 * sent / gyro_hz))
            sent += 1
        if sent > samples:
            moment_s = (sent - 1) / gyro_hz - kept.mean_age_s(span_s)
            assert kept.mean_rate_B(kept.newest_s, span_s)[1] == pytest.approx(0.1 * moment_s, abs=1e-12), tick
        kept.forget(kept.newest_s - 0.3)
    assert kept.mean_age_s(span_s) == pytest.approx(0.5 * (samples - 1) / gyro_hz)


def test_a_sample_counts_in_the_mean_force_of_one_step_whatever_the_jitter():
    """Steps from one tick's newest stamp to the next one's, at 225 Hz and 100 Hz: of two samples or three."""
    kept, draws, sent, before_s = record(), np.random.default_rng(0), 0, 0.0
    for tick in range(1, 2000):
        felt = []
        while (sent + 1) * 100 <= tick * 225:
            sent += 1
            off_s = np.clip(0.01 * draws.standard_normal(), -0.49 / 225, 0.49 / 225)
            force = np.array([0.0, 0.0, 9.8 + 0.01 * sent])
            assert kept.take(replace(sample(sent / 225 + off_s), specific_force_m_s2=force))
            felt.append(force[2])
        assert len(felt) in (2, 3)
        assert kept.mean_force_B(before_s, kept.newest_s)[2] == pytest.approx(np.mean(felt)), tick
        before_s = kept.newest_s


def test_a_stamp_that_leaps_needs_a_second_one():
    stamps = Stamps(1.0)
    assert stamps.believed(5.0, -np.inf)
    assert not stamps.believed(47.0, 5.0)
    assert stamps.believed(5.02, 5.0)
    assert not stamps.believed(47.02, 5.02)
    assert stamps.believed(47.04, 5.02)
    assert not stamps.believed(np.nan, 47.04)


def test_a_second_stamp_says_the_same_only_if_it_is_a_later_one():
    stamps = Stamps(1.0)
    assert stamps.believed(5.0, -np.inf)
    assert not any(stamps.believed(time_s, 5.0) for time_s in (47.0, 47.0, 46.5, 46.5))
    assert stamps.believed(46.6, 5.0)


def test_a_stamp_that_leaps_by_more_than_a_minute_is_of_another_clock():
    stamps = Stamps(1.0)
    assert stamps.believed(5.0, -np.inf)
    assert not any(stamps.believed(3605.0 + 0.02 * k, 5.0) for k in range(10))
    assert stamps.believed(5.02, 5.0)


def test_a_gap_between_samples_is_told_wherever_it_is():
    """Samples at 0, 0.01, ..., 0.1 s and 0.15, ..., 0.2 s, of 0.1 rad/s and no force."""
    kept, gap_s = record(), 0.02
    assert not kept.is_unbroken(0.0, 0.01, gap_s, forces=False)
    for k in (*range(11), *range(15, 21)):
        kept.take(sample(0.01 * k))
    assert kept.is_unbroken(0.15, 0.2, gap_s, forces=False)
    assert kept.is_unbroken(0.155, 0.22, gap_s, forces=False)
    assert not kept.is_unbroken(0.155, 0.221, gap_s, forces=False)  # at the end
    assert not kept.is_unbroken(0.05, 0.2, gap_s, forces=False)  # in the middle
    assert not kept.is_unbroken(0.1, 0.2, gap_s, forces=False)
    assert not kept.is_unbroken(-0.03, 0.1, gap_s, forces=False)  # before the first
    assert kept.is_unbroken(0.1, 0.2, 0.05, forces=False)


@pytest.mark.parametrize(("start_s", "felt"), [(0.0, False), (0.05, False), (0.059, False), (0.06, True)])
def test_a_force_that_is_no_number_is_a_gap_where_forces_are_asked_for(start_s, felt):
    kept = record()
    for k in range(11):
        force = np.array([0.0, 0.0, np.nan if k == 5 else 9.8])
        kept.take(replace(sample(0.01 * k), specific_force_m_s2=force))
    assert kept.is_unbroken(start_s, 0.1, 0.02, forces=True) == felt
    assert kept.is_unbroken(start_s, 0.1, 0.02, forces=False)


@pytest.mark.parametrize(("late_s", "whole"), [(0.0, True), (5e-7, True), (2e-6, False)])
def test_a_gap_is_told_to_the_microsecond(late_s, whole):
    """0.07 - 0.05 is more than 0.02 in numbers that end."""
    kept = record()
    for time_s in (0.05, 0.07 + late_s):
        kept.take(sample(time_s))
    assert kept.is_unbroken(0.05, 0.07 + late_s, 0.02, forces=False) == whole
