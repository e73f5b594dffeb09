"""Allan deviation against published values and allantools; noise terms back from records that were made of them."""

from decimal import Decimal, localcontext

import allantools
import numpy as np
import pytest

from dockair.errors import DockairError
from dockair.nav.heading import allan
from dockair.nav.heading.allan import allan_deviation, identify_gyro_noise

NBS14 = np.array([892.0, 809.0, 823.0, 798.0, 671.0, 644.0, 883.0, 903.0, 677.0])  # NIST SP 1065, table 30


def _thousand():
    """The thousand points of NIST SP 1065, section 12.4: n <- 16807 n mod 2147483647, from 1234567890."""
    n, points = 1234567890, []
    for _ in range(1000):
        points.append(n / 2147483647)
        n = 16807 * n % 2147483647
    return np.array(points)


def test_nine_points_of_the_nbs_data_set_give_the_published_deviations():
    curve = allan_deviation(NBS14, 1.0, [1.0, 2.0])
    np.testing.assert_allclose(curve.deviation, [91.22945, 85.95287], rtol=1e-6)


def test_a_thousand_points_of_the_nbs_data_set_give_the_published_deviations():
    curve = allan_deviation(_thousand(), 1.0, [1.0, 10.0, 100.0])
    np.testing.assert_allclose(curve.deviation, [2.922319e-01, 9.159953e-02, 3.241343e-02], rtol=1e-6)


@pytest.mark.parametrize("seed", range(3))
def test_it_is_allantools_overlapping_deviation(seed):
    rng = np.random.default_rng(seed)
    y = rng.standard_normal(20_000) + 0.02 * np.cumsum(rng.standard_normal(20_000)) + 5.0
    curve = allan_deviation(y, 50.0)
    taus, deviation, _, _ = allantools.oadev(y, rate=50.0, data_type="freq", taus=curve.taus_s)
    np.testing.assert_allclose(curve.taus_s, taus, rtol=1e-12)
    np.testing.assert_allclose(curve.deviation, deviation, rtol=1e-9)


def test_records_side_by_side_have_the_mean_variance():
    y = np.random.default_rng(0).standard_normal((5000, 3)) * [1.0, 2.0, 3.0]
    each = [allan_deviation(column, 10.0, [1.0, 5.0]).deviation ** 2 for column in y.T]
    both = allan_deviation(y, 10.0, [1.0, 5.0])
    np.testing.assert_allclose(both.deviation**2, np.mean(each, axis=0), rtol=1e-12)
    assert both.intervals[0] == pytest.approx(3 * (5000 / 10 - 1))


def test_the_slopes_are_those_of_the_terms_alone():
    """Quantisation falls as 1/t, white noise as 1/sqrt(t), a random walk rises as sqrt(t), a ramp as t."""
    rng = np.random.default_rng(1)
    white = rng.standard_normal(400_000)
    taus = np.array([0.1, 1.0, 10.0])

    def slopes(y):
        return np.diff(np.log10(allan_deviation(y, 100.0, taus).deviation))

    np.testing.assert_allclose(slopes(np.diff(white)), -1.0, atol=0.05)
    np.testing.assert_allclose(slopes(white), -0.5, atol=0.05)
    np.testing.assert_allclose(slopes(np.cumsum(white)), 0.5, atol=0.1)
    np.testing.assert_allclose(slopes(np.arange(400_000.0)), 1.0, atol=1e-6)


def _record(seed, *, N=0.0, B=0.0, T=20.0, K=0.0, Q=0.0, hours=2.0, rate=50.0):
    rng, dt = np.random.default_rng(seed), 1.0 / rate
    n = round(hours * 3600.0 * rate)
    white = N / np.sqrt(dt) * rng.standard_normal(n)
    walk = K * np.sqrt(dt) * np.cumsum(rng.standard_normal(n))
    e, sigma = np.exp(-dt / T), B / 0.617364283
    drive = sigma * np.sqrt(1.0 - e * e) * rng.standard_normal(n)
    drive[0] = sigma * rng.standard_normal()
    from scipy.signal import lfilter

    markov = lfilter([1.0], [1.0, -e], drive)
    quantum = Q / dt * np.diff(rng.standard_normal(n + 1))  # an angle read with the error Q
    return white + walk + markov + quantum


@pytest.mark.slow
def test_all_four_terms_come_back_from_three_records_of_two_hours():
    """White noise to 3 %, the others to 20 %; their scatter over seeds is 0.3 %, 1 %, 4 % and 6 %."""
    true = {"N": 1.7e-4, "B": 5e-5, "K": 2e-6, "Q": 1e-5}
    records = np.column_stack([_record(seed, **true) for seed in range(3)])
    noise = identify_gyro_noise(records, 50.0)
    assert noise.noise_density_rad_s_rthz == pytest.approx(true["N"], rel=0.03)
    assert noise.quantisation_rad == pytest.approx(true["Q"], rel=0.2)
    assert noise.bias_instability_rad_s == pytest.approx(true["B"], rel=0.2)
    assert noise.rate_random_walk_rad_s_rts == pytest.approx(true["K"], rel=0.2)
    assert noise.bias_correlation_s == pytest.approx(20.0, rel=0.4)
    np.testing.assert_allclose(noise.fitted_rad_s[:20], noise.curve.deviation[:20], rtol=0.05)


def test_white_noise_alone_has_hardly_any_other_term():
    noise = identify_gyro_noise(_record(4, N=1e-4, hours=0.5), 50.0)
    assert noise.noise_density_rad_s_rthz == pytest.approx(1e-4, rel=0.03)
    assert noise.bias_instability_rad_s < 0.2 * 1e-4 / np.sqrt(600.0) * 10.0
    assert noise.quantisation_rad < 1e-6


def test_terms_not_asked_for_are_not_found():
    noise = identify_gyro_noise(_record(5, N=1e-4, B=1e-4, hours=0.2), 50.0, terms="N")
    assert noise.bias_instability_rad_s == 0.0 and np.isnan(noise.bias_correlation_s)


@pytest.mark.parametrize("r", [1e-7, 1e-5, 1e-3, 0.0099, 0.0101, 1.0, 1e4])
def test_the_term_of_the_bias_is_equation_3_in_sixty_digits(r):
    with localcontext(prec=60):
        R = Decimal(r)
        G = 2 / R * (1 - (3 - 4 * (-R).exp() + (-2 * R).exp()) / (2 * R))
    assert allan._gauss_markov(np.array([r]))[0] == pytest.approx(float(G), rel=1e-9)


def test_a_bias_without_white_noise_is_found_at_averaging_times_far_below_its_own():
    noise = identify_gyro_noise(_record(6, B=5e-5, T=300.0, rate=200.0), 200.0, terms="NB")
    assert noise.bias_instability_rad_s == pytest.approx(5e-5, rel=0.3)  # two hours are 24 of its times
    assert noise.noise_density_rad_s_rthz < 1e-7


def test_by_default_there_are_ten_times_a_decade_from_one_sample_to_a_third_of_the_record():
    curve = allan_deviation(np.random.default_rng(7).standard_normal(3000), 10.0)
    assert (curve.taus_s[0], curve.taus_s[-1]) == (0.1, 100.0)
    np.testing.assert_allclose(np.diff(np.log10(curve.taus_s[-15:])), 0.1, atol=0.01)


def test_a_time_is_taken_to_the_nearest_sample_and_may_be_half_the_record():
    """0.29 s at 100 Hz are 28.999999999999996 samples in double precision."""
    curve = allan_deviation(np.random.default_rng(8).standard_normal(58), 100.0, [0.29])
    assert curve.taus_s.tolist() == [0.29] and curve.intervals.tolist() == [1.0]


def test_terms_of_a_curve_that_is_made_of_them_come_back_and_no_other_correlation_fits_as_well():
    """Eq. (2) with the function of Eq. (3) written for it: exact, at thirty times over five decades."""
    Q, N, B, K, T = 2e-6, 1e-4, 5e-5, 2e-6, 20.0
    t = np.geomspace(0.02, 2000.0, 30)
    r = t / T
    G = 2.0 / r * (1.0 - (3.0 - 4.0 * np.exp(-r) + np.exp(-2.0 * r)) / (2.0 * r))
    variance = 3.0 * Q**2 / t**2 + N**2 / t + (B / 0.6174) ** 2 * G + K**2 * t / 3.0
    curve = allan.AllanCurve(t, np.sqrt(variance), 6000.0 / t - 1.0)
    squares, fitted, misfit = allan._fit(curve, T, "QNBK")
    np.testing.assert_allclose(np.sqrt(squares), [Q, N, B, K], rtol=1e-3)
    np.testing.assert_allclose(fitted, variance, rtol=1e-6)
    assert misfit < min(allan._fit(curve, factor * T, "QNBK")[2] for factor in (0.5, 0.8, 1.25, 2.0))


def test_each_time_counts_by_its_number_of_independent_intervals():
    """White noise alone: N^2 is the mean of t var(t), weighted by the intervals."""
    t, ratio, n = np.array([1.0, 4.0, 9.0]), np.array([1.0, 2.0, 3.0]), np.array([100.0, 10.0, 1.0])
    (square,), fitted, _ = allan._fit(allan.AllanCurve(t, np.sqrt(ratio / t), n), 1.0, "N")
    assert square == pytest.approx((n * ratio).sum() / n.sum(), rel=1e-9)
    np.testing.assert_allclose(fitted, square / t, rtol=1e-12)


def test_what_the_terms_make_is_given_as_a_deviation_at_the_curve_s_times():
    noise = identify_gyro_noise(_record(9, N=1e-4, hours=0.05), 50.0, terms="N")
    np.testing.assert_allclose(
        noise.fitted_rad_s, noise.noise_density_rad_s_rthz / np.sqrt(noise.curve.taus_s), rtol=1e-9
    )


@pytest.mark.parametrize("scale", [1.0, 1e-157])
def test_a_record_whose_averages_cancel_to_the_bit_has_terms_too(scale):
    """Levels by turns: an angle that swings by 1e-5 rad to either side, and of an even number of samples no trace."""
    rates = scale * np.tile([1e-3, -1e-3], 500)
    assert allan_deviation(rates, 50.0).deviation.min() == 0.0
    noise = identify_gyro_noise(rates, 50.0)
    assert noise.noise_density_rad_s_rthz == 0.0
    assert noise.quantisation_rad == pytest.approx(1e-5 * scale, rel=0.3, abs=1e-100)


@pytest.mark.parametrize(
    ("where", "make"),
    [
        ("rates", lambda: allan_deviation([1.0, 2.0], 1.0)),
        ("rates", lambda: allan_deviation([1.0, np.nan, 2.0], 1.0)),
        ("rates", lambda: allan_deviation(np.zeros((4, 2, 2)), 1.0)),
        ("sample_rate_hz", lambda: allan_deviation(NBS14, 0.0)),
        ("rates", lambda: identify_gyro_noise(np.full(1000, 0.3), 50.0)),
        ("rates", lambda: identify_gyro_noise(np.column_stack([np.arange(9.0), np.zeros(9)]), 50.0)),
        ("taus_s", lambda: allan_deviation(NBS14, 1.0, [5.0])),
        ("taus_s", lambda: allan_deviation(NBS14, 1.0, [0.1])),
        ("rates", lambda: allan_deviation([1.0, -1e300, 2.0], 1.0)),
        ("terms", lambda: identify_gyro_noise(NBS14, 1.0, terms="NX")),
        ("terms", lambda: identify_gyro_noise(NBS14, 1.0, terms="NN")),
        ("bias_correlation_s", lambda: identify_gyro_noise(NBS14, 1.0, bias_correlation_s=-1.0)),
        ("bias_correlation_s", lambda: identify_gyro_noise(NBS14, 1.0, bias_correlation_s=np.inf)),
        ("bias_correlation_s", lambda: identify_gyro_noise(NBS14, 1.0, bias_correlation_s=1e300)),
    ],
)
def test_what_cannot_be_is_refused_by_name(where, make):
    with pytest.raises(DockairError, match=where):
        make()
