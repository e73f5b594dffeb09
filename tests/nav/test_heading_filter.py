"""Heading by gyro and seen turns: closed forms of sigma, a beginning in a turn, consistency, late and wrong turns."""

import numpy as np
import pytest
from scipy.stats import chi2

from dockair.calibration import GyroSheet, Mounting
from dockair.errors import DockairError
from dockair.messages import ImuSample
from dockair.nav.heading.heading_filter import HeadingFilter, HeadingFilterSettings
from dockair.nav.heading.levelling import without_yaw
from dockair.rotations import Array, exp, log, matrix_from_yaw_pitch_roll

G, V, RATE_HZ, DEGREE = 9.80665, 180.0, 20, np.pi / 180.0
BANK, ATTACK = -25.0 * DEGREE, 5.0 * DEGREE  # left wing down turns to the left; nose above the airflow
TURN_RAD_S = G * np.tan(-BANK) / V
PLAIN = Mounting(R_BC=np.eye(3), p_BC=np.zeros(3), p_BP=np.zeros(3))
NONE = np.zeros(3)
Q = HeadingFilterSettings().walk_rad_rts


def gyro(bias_sigma_deg_s=0.2, noise=1e-6, **more):
    return GyroSheet(
        rate_hz=RATE_HZ, noise_density_rad_s_rthz=noise, bias_sigma_rad_s=bias_sigma_deg_s * DEGREE, **more
    )


class Turn:
    """A level coordinated turn, exact at every sample: rolling in takes from `starts_s` 6 s; -10: banked at once."""

    def __init__(self, seconds: float, starts_s: float = -10.0, mounting: Mounting = PLAIN) -> None:
        self.time_s = np.arange(round(seconds * RATE_HZ) + 1) / RATE_HZ
        u = np.clip((self.time_s - starts_s) / 6.0, 0.0, 1.0)
        bank = BANK * u * u * (3.0 - 2.0 * u)
        turning = G * np.tan(-bank) / V
        steps = 0.5 * (turning[1:] + turning[:-1]) / RATE_HZ
        self.heading_rad = np.concatenate([[0.0], np.cumsum(steps)])
        pitch = np.arctan(np.tan(ATTACK) * np.cos(bank))  # of a nose that is ATTACK above a level airflow
        angles = zip(self.heading_rad, -pitch, bank, strict=True)
        self.attitudes = [matrix_from_yaw_pitch_roll(*each) for each in angles]
        self.rates_B = [RATE_HZ * log(a.T @ b) for a, b in zip(self.attitudes[:-1], self.attitudes[1:], strict=True)]
        airflow_B = np.array([np.cos(ATTACK), 0.0, -np.sin(ATTACK)])  # in a bank the nose points into the turn
        up = np.array([0.0, 0.0, 1.0])
        pulls = zip(turning, self.attitudes, strict=True)
        self.forces_B = [R.T @ (V * w * np.cross(up, R @ airflow_B) + G * up) for w, R in pulls]
        self.mounting = mounting

    def samples(self, bias_B: Array = NONE, noise: Array | None = None) -> list[ImuSample]:
        back = self.mounting.R_BI.T
        noise = np.zeros((len(self.rates_B), 3)) if noise is None else noise
        out = [ImuSample(time_stamp_s=0.0, angular_rate_rad_s=back @ (self.rates_B[0] + bias_B),
                         specific_force_m_s2=back @ self.forces_B[0])]  # fmt: skip
        for k, (rate, force) in enumerate(zip(self.rates_B, self.forces_B[1:], strict=True), 1):
            w_I = back @ (rate + bias_B) + noise[k - 1]
            out.append(ImuSample(time_stamp_s=k / RATE_HZ, angular_rate_rad_s=w_I, specific_force_m_s2=back @ force))
        return out


def flown(turn, samples, sheet, *, settings=None, every_s=2.0, late_s=0.0, walk_rad=None, frames=True):
    """The filter at the end, and (n,) heading errors [rad] and sigmas after each sample."""
    filter_ = HeadingFilter(sheet, turn.mounting, V, settings)
    every, late = round(every_s * RATE_HZ), round(late_s * RATE_HZ)
    before, errors, sigmas = 0.0, [], []
    for k, sample in enumerate(samples):
        filter_.propagate([sample])
        if frames and k > late and (k - late) % every == 0:
            stamp_s = turn.time_s[k - late]
            assert filter_.predicted_turn_rad(stamp_s) is not None
            n = (k - late) // every
            seen = turn.heading_rad[k - late] + (0.0 if walk_rad is None else walk_rad[n])
            filter_.see(stamp_s, seen - before)
            before = seen
        errors.append(filter_.heading_rad - turn.heading_rad[k])
        sigmas.append(filter_.sigma_rad)
    return filter_, np.array(errors), np.array(sigmas)


STRAIGHT = 1e9  # never begins to turn


def test_without_frames_sigma_is_the_bias_s_times_the_time_and_the_gyro_s_walk():
    turn, sheet = Turn(30.0, STRAIGHT), gyro(noise=3e-3)
    slow = HeadingFilter(sheet, PLAIN, 1e-6)  # who stands turns without lift: nothing tells the bias of yaw
    slow.propagate(turn.samples())
    attitude = turn.attitudes[0]
    across = attitude[2] - attitude[2, 0] / attitude[0, 0] * attitude[0]
    expected = np.hypot(0.2 * DEGREE * 30.0 * np.linalg.norm(across), 3e-3 * np.sqrt(30.0) * np.linalg.norm(across))
    assert slow.sigma_rad == pytest.approx(expected, rel=0.02)


def at_rest_or_turning(rate_rad_s=0.0, **sheet):
    """Sigma of the heading after 30 s of gyros that are good but for what is said."""
    good = GyroSheet(rate_hz=RATE_HZ, noise_density_rad_s_rthz=1e-6, bias_sigma_rad_s=1e-9, **sheet)
    filter_ = HeadingFilter(good, PLAIN, 1e-6)  # without lift nothing tells a bias of yaw
    rate, force = np.array([0.0, 0.0, rate_rad_s]), np.array([0.0, 0.0, G])
    for k in range(30 * RATE_HZ + 1):
        stamp_s = k / RATE_HZ
        filter_.propagate([ImuSample(time_stamp_s=stamp_s, angular_rate_rad_s=rate, specific_force_m_s2=force)])
    return filter_.sigma_rad


def test_a_scale_factor_is_noise_that_comes_with_a_turn():
    """White noise of density (s |w|)^2 T_s over 30 s."""
    expected = 0.01 * 0.05 * np.sqrt(HeadingFilterSettings().turn_begins_s * 30.0)
    assert at_rest_or_turning(0.05, scale_factor_sigma=0.01) == pytest.approx(expected, rel=1e-3)
    assert at_rest_or_turning(0.0, scale_factor_sigma=0.01) == pytest.approx(1e-6 * np.sqrt(30.0), rel=1e-3)


def test_a_bias_that_walks_is_a_heading_s_walk_of_its_integral():
    """A walk of b, integrated: b^2 t^3 / 3, in 600 steps by 3/1200 less."""
    expected = 1e-4 * np.sqrt(30.0**3 / 3.0 * (1.0 - 1.5 / 600.0))
    assert at_rest_or_turning(bias_walk_rad_s_rts=1e-4) == pytest.approx(expected, rel=1e-4)


def test_with_frames_and_a_gyro_of_any_bias_sigma_is_the_walk_of_what_was_seen():
    turn = Turn(60.0, STRAIGHT)
    _, errors, sigmas = flown(turn, turn.samples(), gyro(bias_sigma_deg_s=0.9))
    assert sigmas[-1] == pytest.approx(Q * np.sqrt(60.0), rel=0.03)
    assert np.abs(errors).max() < 1e-6


@pytest.mark.parametrize("starts_s", [-10.0, 2.0, 20.0])
@pytest.mark.parametrize("side", [1.0, -1.0])
def test_it_may_begin_in_a_turn_or_before_one_with_a_bias_on_every_axis(starts_s, side):
    """The raw gyro would be off by 20 degrees."""
    bias = side * np.array([0.3, -0.4, 0.35]) * DEGREE
    R_BI = matrix_from_yaw_pitch_roll(0.3, -0.2, 0.1)
    mounting = Mounting(R_BC=np.eye(3), p_BC=NONE, p_BP=NONE, R_BI=R_BI)
    turn = Turn(60.0, starts_s, mounting)
    filter_, errors, sigmas = flown(turn, turn.samples(bias), gyro(bias_sigma_deg_s=0.4))
    late = round(10.0 * RATE_HZ)
    assert np.abs(errors[late:]).max() < 0.2 * DEGREE
    assert (np.abs(errors[late:]) < sigmas[late:]).all()
    axis_B = turn.attitudes[-1][2]
    assert axis_B @ (filter_.bias_B - bias) == pytest.approx(0.0, abs=0.01 * DEGREE)
    wrong = np.degrees(np.linalg.norm(log(without_yaw(turn.attitudes[-1]).T @ filter_.R_LB)))
    assert wrong < 2.0


def test_one_average_of_up_leaves_of_roll_and_pitch_what_two_measurements_leave():
    """Start and average are independent: their inverse variances add up."""
    filter_, start, up = HeadingFilter(gyro(1e-9), PLAIN, 1e-6), 0.3, 0.07
    for k in range(4 * RATE_HZ + 1):
        filter_.propagate(
            [ImuSample(time_stamp_s=k / RATE_HZ, angular_rate_rad_s=NONE, specific_force_m_s2=np.array([0.0, 0.0, G]))]
        )
    assert filter_.is_level
    np.testing.assert_allclose(np.diag(filter_._P)[:2], 1.0 / (start**-2 + up**-2), rtol=1e-4)


def test_the_first_sample_of_a_turn_levels_it_to_a_four_hundredth_of_its_bank():
    """Three rounds: the first leaves a twenty-fifth, each other one a fifth of what was left."""
    turn, filter_ = Turn(1.0), HeadingFilter(gyro(), PLAIN, V)
    filter_.propagate(turn.samples()[:1])
    assert np.linalg.norm(log(without_yaw(turn.attitudes[0]).T @ filter_.R_LB)) < abs(BANK) / 400.0


def test_one_batch_of_samples_has_the_sigma_of_samples_one_by_one_from_the_first_on():
    """A nose 30 degrees up in a bank: the gyros' axes are not those of the heading."""
    level = matrix_from_yaw_pitch_roll(0.0, -30.0 * DEGREE, -40.0 * DEGREE).T @ [0.0, 0.0, G]
    samples = [
        ImuSample(time_stamp_s=k / RATE_HZ, angular_rate_rad_s=NONE, specific_force_m_s2=level) for k in range(60)
    ]
    at_once, by_one = (HeadingFilter(gyro(), PLAIN, 1e-6) for _ in range(2))
    at_once.propagate(samples)
    for sample in samples:
        by_one.propagate([sample])
    np.testing.assert_allclose(at_once._P, by_one._P, rtol=1e-9, atol=1e-15)


def test_a_correction_of_roll_and_pitch_is_told_once_in_axes_along_the_heading():
    """The nose 15 degrees up, 1.6 rad of turn before up is averaged; the first sample was askew."""
    R_LB = matrix_from_yaw_pitch_roll(0.0, -15.0 * DEGREE, 0.0)
    level, rate = R_LB.T @ [0.0, 0.0, G], R_LB.T @ [0.0, 0.0, 0.4]
    askew = exp(np.array([4.0, -3.0, 0.0]) * DEGREE) @ level
    corrected, never = (HeadingFilter(gyro(1e-6), PLAIN, 1e-6, HeadingFilterSettings(up_every_s=t)) for t in (4.0, 1e6))
    for k in range(4 * RATE_HZ + 1):
        force = askew if k == 0 else level
        sample = ImuSample(time_stamp_s=k / RATE_HZ, angular_rate_rad_s=rate, specific_force_m_s2=force)
        corrected.propagate([sample])
        never.propagate([sample])
    assert corrected.is_level and corrected.heading_rad == pytest.approx(1.6, abs=0.05)
    tilt = corrected.tilt_L()
    np.testing.assert_allclose(tilt[:2], log(corrected.R_LB @ never.R_LB.T)[:2], atol=0.2 * DEGREE)
    assert np.linalg.norm(tilt) > 4.0 * DEGREE and tilt[2] == 0.0
    assert (corrected.tilt_L() == 0.0).all()


def test_roll_and_pitch_of_a_frame_s_own_time_are_those_of_the_past():
    """Rolling at 0.2 rad/s, with the nose up: 0.3 s before the newest sample."""
    filter_, before = HeadingFilter(gyro(), PLAIN, 1e-6), matrix_from_yaw_pitch_roll(0.0, -0.3, 0.0)
    for k in range(2 * RATE_HZ + 1):
        rate, force = np.array([0.2, 0.0, 0.0]), before.T @ [0.0, 0.0, G]
        filter_.propagate([ImuSample(time_stamp_s=k / RATE_HZ, angular_rate_rad_s=rate, specific_force_m_s2=force)])
    for ago_s in (0.0, 0.3):
        then = matrix_from_yaw_pitch_roll(0.0, -0.3, 0.2 * (2.0 - ago_s))
        np.testing.assert_allclose(filter_.R_LB_at(2.0 - ago_s), then, atol=1e-9)


@pytest.mark.parametrize("first", [np.zeros(3), np.full(3, np.nan)])
def test_accelerometers_that_begin_late_and_miss_samples_level_as_soon(first):
    """The first says nothing, later every second does not either: up is known 4 s after the first that does."""
    filter_, up = HeadingFilter(gyro(), PLAIN, V), np.array([0.0, 0.0, G])
    for k in range(4 * RATE_HZ + 4):
        force = first if k == 0 else up if k % 2 else np.full(3, np.nan)
        filter_.propagate([ImuSample(time_stamp_s=k / RATE_HZ, angular_rate_rad_s=NONE, specific_force_m_s2=force)])
    assert filter_.is_level
    np.testing.assert_allclose(filter_.R_LB, np.eye(3), atol=1e-9)


def test_accelerometers_that_fail_in_flight_leave_the_attitude_as_it_is():
    filter_ = HeadingFilter(gyro(), PLAIN, V)
    for k in range(10 * RATE_HZ):
        force = np.array([0.0, 0.0, G if k == 0 else 0.0])
        filter_.propagate([ImuSample(time_stamp_s=k / RATE_HZ, angular_rate_rad_s=NONE, specific_force_m_s2=force)])
    np.testing.assert_array_equal(filter_.R_LB, np.eye(3))
    assert not filter_.is_level and np.isfinite(filter_.sigma_rad)


@pytest.mark.parametrize(("sigmas", "believed"), [(4.9, True), (-4.9, True), (5.1, False), (-5.1, False)])
def test_a_turn_is_believed_up_to_five_sigmas_of_what_it_may_be_off_by(sigmas, believed):
    """Pairs of frames so bad that nothing else counts: sigma is q sqrt(dt)."""
    settings = HeadingFilterSettings(walk_rad_rts=0.05)
    filter_ = HeadingFilter(gyro(1e-9), PLAIN, V, settings)
    turn = Turn(3.0, STRAIGHT)
    filter_.propagate(turn.samples()[: RATE_HZ + 1])
    filter_.see(1.0, None)
    filter_.propagate(turn.samples()[RATE_HZ + 1 :])
    assert filter_.see(3.0, sigmas * 0.05 * np.sqrt(2.0)) == believed


def test_gyros_are_refused_from_the_bias_on_that_may_seem_to_be_the_largest_tilt():
    limit_deg_s = HeadingFilterSettings().largest_tilt_rad * G / V / DEGREE
    HeadingFilter(gyro(0.99 * limit_deg_s), PLAIN, V)
    with pytest.raises(DockairError, match=r"heading\.gyro"):
        HeadingFilter(gyro(1.01 * limit_deg_s), PLAIN, V)


def test_without_frames_such_a_gyro_is_lost():
    """The control of the test before."""
    turn = Turn(60.0)
    _, errors, _ = flown(turn, turn.samples(np.array([0.3, -0.4, 0.35]) * DEGREE), gyro(), frames=False)
    assert abs(errors[-1]) > 10.0 * DEGREE


def test_what_is_learnt_of_the_bias_holds_for_the_time_before_the_first_frame():
    """Ten seconds at 0.35 deg/s are 3.5 degrees, which no frame has seen."""
    bias = np.array([0.0, 0.0, 0.35]) * DEGREE
    turn = Turn(40.0, STRAIGHT)
    filter_, before = HeadingFilter(gyro(), PLAIN, V), None
    for k, sample in enumerate(turn.samples(bias)):
        filter_.propagate([sample])
        if k >= 10 * RATE_HZ and k % (2 * RATE_HZ) == 0:
            before = filter_.heading_rad if before is None else before
            filter_.see(turn.time_s[k], 0.0)
    assert before > 2.5 * DEGREE
    assert abs(filter_.heading_rad) < 0.3 * DEGREE


def test_a_steady_bank_is_levelled_whatever_the_nose_s_angle_to_the_airflow():
    turn = Turn(60.0)
    filter_, _, _ = flown(turn, turn.samples(), gyro(bias_sigma_deg_s=0.01), frames=False)
    assert np.degrees(np.linalg.norm(log(without_yaw(turn.attitudes[-1]).T @ filter_.R_LB))) < 0.1


def test_roll_that_was_wrong_at_first_is_no_turn():
    """The nose is 15 degrees up: taking off 10 degrees of roll moves it by 2.7 degrees, but it began at zero."""
    R_LB = matrix_from_yaw_pitch_roll(0.0, -15.0 * DEGREE, 0.0)
    level = R_LB.T @ [0.0, 0.0, G]
    askew = exp(np.array([10.0 * DEGREE, 0.0, 0.0])) @ level
    filter_ = HeadingFilter(gyro(bias_sigma_deg_s=1e-6), PLAIN, V)
    for k in range(20 * RATE_HZ):
        force = askew if k == 0 else level
        filter_.propagate([ImuSample(time_stamp_s=k / RATE_HZ, angular_rate_rad_s=NONE, specific_force_m_s2=force)])
    assert np.degrees(np.linalg.norm(log(R_LB.T @ filter_.R_LB))) < 0.5
    assert abs(filter_.heading_rad) < 0.1 * DEGREE and filter_.sigma_rad < 0.1 * DEGREE


def test_its_sigma_is_that_of_its_errors():
    """60 receivers that begin in a turn, gyros and frames as bad as they say: the mean of error^2/sigma^2 is one.

    A filter that is right fails once in 1000.
    """
    runs, noise, sheet = 60, 2e-3, gyro(noise=2e-3)
    turn, rng, ratios = Turn(16.0), np.random.default_rng(5), []
    for _ in range(runs):
        bias = 0.2 * DEGREE * rng.standard_normal(3)
        white = noise * np.sqrt(RATE_HZ) * rng.standard_normal((len(turn.rates_B), 3))
        walk = np.cumsum(Q * np.sqrt(2.0) * rng.standard_normal(9))
        _, errors, sigmas = flown(turn, turn.samples(bias, white), sheet, walk_rad=walk)
        ratios.append(errors[-1] / sigmas[-1])
    low, high = chi2.ppf([5e-4, 1.0 - 5e-4], runs) / runs
    assert low < np.mean(np.square(ratios)) < high


@pytest.mark.parametrize("late_s", [0.1, 0.5])
def test_a_turn_counts_at_its_frame_s_own_time(late_s):
    """In the turn 0.5 s are 0.7 degrees."""
    turn, bias = Turn(40.0), np.array([0.1, 0.1, 0.2]) * DEGREE
    _, now, _ = flown(turn, turn.samples(bias), gyro())
    _, late, _ = flown(turn, turn.samples(bias), gyro(), late_s=late_s)
    assert np.abs(late - now)[10 * RATE_HZ :].max() < 0.15 * DEGREE


def test_a_frame_that_is_stamped_ahead_of_the_newest_sample_counts_at_its_own_time_too():
    """The clocks of camera and IMU may differ by a little."""
    turn, ahead_s = Turn(20.0), 0.03
    filter_ = HeadingFilter(gyro(), turn.mounting, V)
    filter_.propagate(turn.samples())
    assert filter_.predicted_turn_rad(19.5) is not None and not filter_.see(19.5, None)
    predicted = filter_.predicted_turn_rad(20.0 + ahead_s)
    assert predicted == pytest.approx((0.5 + ahead_s) * TURN_RAD_S, rel=1e-3)


def test_frames_too_late_or_out_of_order_are_passed_over():
    turn = Turn(5.0)
    filter_ = HeadingFilter(gyro(), PLAIN, V)
    filter_.propagate(turn.samples())
    assert filter_.predicted_turn_rad(3.9) is None
    assert filter_.predicted_turn_rad(4.5) == 0.0 and not filter_.see(4.5, None)
    assert filter_.predicted_turn_rad(4.5) is None
    assert filter_.predicted_turn_rad(5.0) == pytest.approx(0.5 * TURN_RAD_S, rel=0.05)


def test_a_turn_that_cannot_be_is_passed_over_and_the_next_counts_from_its_frame():
    turn = Turn(20.0, STRAIGHT)
    _, clean, sigma = flown(turn, turn.samples(), gyro())
    walk = np.zeros(11)
    walk[6:] = 5.0 * DEGREE  # one pair of frames saw 5 degrees that were not turned
    _, errors, sigmas = flown(turn, turn.samples(), gyro(), walk_rad=walk)
    assert np.abs(errors - clean).max() < 0.02 * DEGREE
    assert sigmas[-1] > sigma[-1]


@pytest.mark.parametrize("wrong", ["nan", "back", "gone"])
def test_samples_without_numbers_out_of_order_or_gone_do_little(wrong):
    turn = Turn(20.0)
    samples = turn.samples()
    bad = {
        "nan": ImuSample(time_stamp_s=5.02, angular_rate_rad_s=np.full(3, np.nan), specific_force_m_s2=np.ones(3)),
        "back": ImuSample(time_stamp_s=1.0, angular_rate_rad_s=np.ones(3), specific_force_m_s2=np.ones(3)),
        "gone": None,
    }[wrong]
    spoilt = samples[:101] + samples[106:] if bad is None else [*samples[:101], bad, *samples[101:]]
    filters = [HeadingFilter(gyro(), PLAIN, V) for _ in range(2)]
    for filter_, each in zip(filters, (samples, spoilt), strict=True):
        filter_.propagate(each)
    assert not filters[1].is_lost
    assert filters[1].heading_rad == pytest.approx(filters[0].heading_rad, abs=0.02 * DEGREE)


@pytest.mark.parametrize(("gap_s", "lost"), [(0.45, False), (0.55, True)])
def test_after_a_long_gap_it_is_lost(gap_s, lost):
    filter_, samples = HeadingFilter(gyro(), PLAIN, V), Turn(10.0).samples()
    filter_.propagate(samples[:101] + samples[100 + round(gap_s * RATE_HZ) :])
    assert filter_.is_lost is lost


def test_it_begins_with_the_first_sample_that_has_accelerations():
    filter_ = HeadingFilter(gyro(), PLAIN, V)
    filter_.propagate([ImuSample(time_stamp_s=1.0, angular_rate_rad_s=NONE)])
    assert np.isnan(filter_.time_stamp_s) and filter_.predicted_turn_rad(1.0) is None
    filter_.propagate([ImuSample(time_stamp_s=1.1, angular_rate_rad_s=NONE, specific_force_m_s2=np.array([0, 0, G]))])
    assert filter_.time_stamp_s == 1.1 and filter_.heading_rad == 0.0


def test_a_number_that_is_not_positive_is_refused():
    with pytest.raises(DockairError, match="heading.filter.up_every_s: expected a finite number above 0"):
        HeadingFilterSettings(up_every_s=0.0)
