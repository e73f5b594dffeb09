"""The gyro against the closed forms of its filter and its noise.

Statistical bounds are 4.5 standard errors (a false alarm in 1.5e5 each); seeds are fixed.
"""

from dataclasses import replace

import numpy as np
import pytest
from scipy import signal

from dockair.errors import DockairError
from dockair.parameters import load_parameters
from dockair.rotations import exp
from dockair.sim.imu import Gyro, GyroParameters

SHEET = load_parameters("gyro", GyroParameters)
QUIET = replace(
    SHEET, noise_density_rad_s_rthz=0.0, turn_on_bias_sigma_rad_s=0.0, bias_instability_rad_s=0.0, quantum_rad_s=1e-12
)
RATE = 500.0


def _run(
    parameters: GyroParameters, w: np.ndarray, seed: int = 0, rate: float = RATE, **more: np.ndarray
) -> np.ndarray:
    gyro = Gyro(parameters, rate, np.random.default_rng(seed), **more)
    return np.array([gyro.step(k / rate, w_k).angular_rate_rad_s for k, w_k in enumerate(w)])


def test_a_steady_rate_is_measured_as_it_is_from_the_first_sample() -> None:
    w = np.tile([0.1, -0.2, 0.3], (50, 1))
    assert np.allclose(_run(QUIET, w), w, atol=1e-9)


def test_white_noise_has_the_variance_of_its_density_over_the_sample_time() -> None:
    n = 40000
    noise = _run(replace(QUIET, noise_density_rad_s_rthz=SHEET.noise_density_rad_s_rthz), np.zeros((n, 3)))
    sigma = SHEET.noise_density_rad_s_rthz * np.sqrt(RATE)
    assert noise.var() == pytest.approx(sigma**2, rel=4.5 * np.sqrt(2.0 / (3 * n)))
    assert abs(noise.mean()) < 4.5 * sigma / np.sqrt(3 * n)
    for lag in (1, 2, 5):
        correlation = (noise[lag:] * noise[:-lag]).mean() / sigma**2
        assert abs(correlation) < 4.5 / np.sqrt(3 * (n - lag))


def test_the_default_density_is_a_hundredth_of_a_degree_per_second_and_root_hertz() -> None:
    assert np.degrees(SHEET.noise_density_rad_s_rthz) == pytest.approx(0.01, rel=1e-3)


def test_turn_on_bias_is_drawn_once_a_gyro_with_its_standard_deviation() -> None:
    only_bias = replace(QUIET, turn_on_bias_sigma_rad_s=SHEET.turn_on_bias_sigma_rad_s)
    biases = []
    for seed in range(400):
        gyro = Gyro(only_bias, RATE, np.random.default_rng(seed))
        first = gyro.step(0.0, np.zeros(3)).angular_rate_rad_s
        biases.append(first)
    gyro_again = _run(only_bias, np.zeros((20, 3)), seed=399)
    assert np.allclose(gyro_again, biases[-1])
    n = 3 * len(biases)
    assert np.var(biases) == pytest.approx(SHEET.turn_on_bias_sigma_rad_s**2, rel=4.5 * np.sqrt(2.0 / n))


def test_the_drift_forgets_itself_within_its_correlation_time_and_keeps_its_variance() -> None:
    """First-order Gauss-Markov: variance s^2 and correlation exp(-t/tau) at t = tau.

    Samples of one axis are correlated: 60 000 of them are worth 60 000 tanh(dt/tau), 5980 independent ones.
    """
    drifting = replace(QUIET, bias_instability_rad_s=1e-3, bias_correlation_s=0.02)
    drift = _run(drifting, np.zeros((20000, 3)))
    worth = drift.size * np.tanh(1.0 / (RATE * 0.02))
    assert drift.var() == pytest.approx(1e-6, rel=4.5 * np.sqrt(2.0 / worth))
    correlation = (drift[10:] * drift[:-10]).mean() / (drift**2).mean()
    assert correlation == pytest.approx(np.exp(-1.0), abs=4.5 / np.sqrt(worth))


def test_the_filter_is_3_db_down_and_lags_by_90_degrees_at_its_bandwidth() -> None:
    """A fast clock, so that the hold between samples plays no part: |H| = 1/sqrt 2 and phase -90 deg for z = 0.707."""
    rate, f = 20000.0, SHEET.bandwidth_hz
    t = np.arange(int(rate * 0.2)) / rate
    out = _run(QUIET, np.sin(2 * np.pi * f * t)[:, None] * [1.0, 0.0, 0.0], rate=rate)[:, 0]
    late = slice(len(t) // 2, None)
    cycle = np.exp(-2j * np.pi * f * t[late])
    response = 2j * (out[late] * cycle).mean()
    assert abs(response) == pytest.approx(1.0 / np.sqrt(2.0), rel=2e-3)
    assert np.degrees(np.angle(response)) == pytest.approx(-90.0, abs=0.3)


@pytest.mark.parametrize("f", [2.0, 30.0, 100.0, 200.0])
def test_at_the_gyros_own_rate_the_gain_is_the_continuous_filters_on_the_linear_hold(f: float) -> None:
    """A sampled sine joined by straight lines has images at f + k f_s of size sinc^2; the filter weighs each."""
    t = np.arange(2000) / RATE
    out = _run(QUIET, np.sin(2 * np.pi * f * t)[:, None] * [0.0, 1.0, 0.0])[:, 1]
    images = f + RATE * np.arange(-200, 201)
    wc = 2 * np.pi * SHEET.bandwidth_hz
    _, H = signal.freqs([wc**2], [1.0, 2 * SHEET.damping_ratio * wc, wc**2], 2 * np.pi * images)
    expected = (H * np.sinc(images / RATE) ** 2).sum()
    late = slice(1000, None)
    response = 2j * (out[late] * np.exp(-2j * np.pi * f * t[late])).mean()
    assert response == pytest.approx(expected, abs=1e-6)


def test_a_ramp_is_followed_by_the_exact_solution_of_the_filter() -> None:
    """Linear between samples is what the hold assumes: against scipy's lsim of the same system."""
    t = np.arange(200) / RATE
    ramp = np.where(t < 0.05, 0.0, 3.0 * (t - 0.05))
    wc = 2 * np.pi * SHEET.bandwidth_hz
    system = signal.TransferFunction([wc**2], [1.0, 2 * SHEET.damping_ratio * wc, wc**2])
    _, exact, _ = signal.lsim(system, ramp, t)
    assert np.allclose(_run(QUIET, ramp[:, None] * [0.0, 0.0, 1.0])[:, 2], exact, atol=1e-9)


def test_a_step_overshoots_by_four_percent_and_settles_on_its_value() -> None:
    """Second-order Butterworth: overshoot exp(-pi z/sqrt(1 - z^2)) = 4.3 %."""
    rate = 20000.0
    w = np.zeros((1000, 3))
    w[10:] = [0.5, 0.0, 0.0]
    out = _run(QUIET, w, rate=rate)[:, 0]
    assert out.max() / 0.5 == pytest.approx(1.0 + np.exp(-np.pi), rel=1e-3)
    assert out[-1] == pytest.approx(0.5, abs=1e-6)


def test_the_integral_of_the_measured_rate_is_the_angle_turned() -> None:
    """A turn from rest to rest: the filter has gain one at zero frequency, so the angle comes out whole."""
    t = np.arange(1000) / RATE
    rate = np.where((t > 0.2) & (t < 1.2), 0.4 * np.sin(np.pi * (t - 0.2)) ** 2, 0.0)
    out = _run(QUIET, rate[:, None] * [0.0, 0.0, 1.0])[:, 2]
    assert out.sum() / RATE == pytest.approx(rate.sum() / RATE, rel=1e-9)
    assert out.sum() / RATE == pytest.approx(0.2, rel=1e-6)


def test_the_range_clips_both_ways() -> None:
    w = np.tile([20.0, -20.0, 1.0], (100, 1))
    out = _run(QUIET, w)[-1]
    assert out[0] == pytest.approx(SHEET.range_rad_s, abs=1e-9)
    assert out[1] == pytest.approx(-SHEET.range_rad_s, abs=1e-9)
    assert out[2] == pytest.approx(1.0, abs=1e-9)


def test_every_output_is_a_whole_number_of_quanta_and_the_nearest() -> None:
    coarse = replace(QUIET, quantum_rad_s=0.01)
    w = np.random.default_rng(2).uniform(-1.0, 1.0, (200, 3))
    out, fine = _run(coarse, w), _run(QUIET, w)
    assert np.allclose(out / 0.01, np.round(out / 0.01), atol=1e-9)
    assert np.abs(out - fine).max() <= 0.005 + 1e-9
    assert (out - fine).var() == pytest.approx(0.01**2 / 12.0, rel=0.2)


def test_the_mounting_turns_body_rates_into_the_gyros_axes() -> None:
    """A gyro turned by 90 deg to the left: its x axis is the body's y."""
    R_BI = exp(np.array([0.0, 0.0, np.pi / 2]))
    out = _run(QUIET, np.tile([0.1, 0.2, 0.3], (3, 1)), R_BI=R_BI)
    assert out[0] == pytest.approx([0.2, -0.1, 0.3], abs=1e-9)


def test_the_same_stream_gives_the_same_record_and_another_one_another() -> None:
    w = np.zeros((20, 3))
    assert np.array_equal(_run(SHEET, w, 5), _run(SHEET, w, 5))
    assert not np.array_equal(_run(SHEET, w, 5), _run(SHEET, w, 6))


def test_the_true_bias_is_what_the_samples_scatter_around() -> None:
    gyro = Gyro(replace(SHEET, bias_instability_rad_s=0.0), RATE, np.random.default_rng(8))
    samples = np.array([gyro.step(k / RATE, np.zeros(3)).angular_rate_rad_s for k in range(20000)])
    sigma = SHEET.noise_density_rad_s_rthz * np.sqrt(RATE) / np.sqrt(20000)
    assert samples.mean(0) == pytest.approx(gyro.bias_I, abs=4.5 * sigma)


def test_a_rate_that_is_not_positive_is_refused() -> None:
    with pytest.raises(DockairError, match="gyro.rate_hz"):
        Gyro(SHEET, 0.0, np.random.default_rng(0))
