"""The IMU's errors term by term: its filters in closed form, what is drawn and what moves by their statistics.

Statistical bounds are 4.5 standard errors (a false alarm in 1.5e5 each); seeds are fixed. Allan deviations of long
records are in test_imu_allan.py, motion, clock and faults in test_imu.py.
"""

from dataclasses import fields, replace
from typing import Any

import numpy as np
import pytest
from scipy import signal

from dockair.sim.imu import ImuParameters
from quiet_imu import QUIET, RATE, SHEET, forces_of, imu_of, rates_of, still

SENSORS = ("gyro", "accelerometer")


# Filter


def test_the_filter_is_3_db_down_and_lags_by_90_degrees_at_its_bandwidth() -> None:
    """A fast clock, so that the hold between samples plays no part: |H| = 1/sqrt 2 and phase -90 deg for z = 0.707."""
    rate = 20000.0
    t = np.arange(int(rate * 0.2)) / rate
    sheet = replace(QUIET, accelerometer_bandwidth_hz=120.0)
    for f, sensors in ((SHEET.gyro_bandwidth_hz, rates_of), (120.0, forces_of)):
        out = sensors(sheet, np.sin(2 * np.pi * f * t)[:, None] * [1.0, 0.0, 0.0], rate=rate)[:, 0]
        late = slice(len(t) // 2, None)
        response = 2j * (out[late] * np.exp(-2j * np.pi * f * t[late])).mean()
        assert abs(response) == pytest.approx(1.0 / np.sqrt(2.0), rel=2e-3)
        assert np.degrees(np.angle(response)) == pytest.approx(-90.0, abs=0.3)


@pytest.mark.parametrize("f", [2.0, 30.0, 100.0, 200.0])
def test_at_the_imus_own_rate_the_gain_is_the_continuous_filters_on_the_linear_hold(f: float) -> None:
    """A sampled sine joined by straight lines has images at f + k f_s of size sinc^2; the filter weighs each."""
    t = np.arange(2000) / RATE
    out = rates_of(QUIET, np.sin(2 * np.pi * f * t)[:, None] * [0.0, 1.0, 0.0])[:, 1]
    images = f + RATE * np.arange(-200, 201)
    wc = 2 * np.pi * SHEET.gyro_bandwidth_hz
    _, H = signal.freqs([wc**2], [1.0, 2 * SHEET.gyro_damping_ratio * wc, wc**2], 2 * np.pi * images)
    expected = (H * np.sinc(images / RATE) ** 2).sum()
    late = slice(1000, None)
    response = 2j * (out[late] * np.exp(-2j * np.pi * f * t[late])).mean()
    assert response == pytest.approx(expected, abs=1e-6)


def test_a_ramp_is_followed_by_the_exact_solution_of_the_filter() -> None:
    """Linear between samples is what the hold assumes: against scipy's lsim of the same system."""
    t = np.arange(200) / RATE
    ramp = np.where(t < 0.05, 0.0, 3.0 * (t - 0.05))
    wc = 2 * np.pi * SHEET.accelerometer_bandwidth_hz
    system = signal.TransferFunction([wc**2], [1.0, 2 * SHEET.accelerometer_damping_ratio * wc, wc**2])
    _, exact, _ = signal.lsim(system, ramp, t)
    assert np.allclose(forces_of(QUIET, ramp[:, None] * [0.0, 0.0, 1.0])[:, 2], exact, atol=1e-9)


def test_the_integral_of_the_measured_rate_is_the_angle_turned() -> None:
    """A turn from rest to rest: the filter has gain one at zero frequency, so the angle comes out whole."""
    t = np.arange(1000) / RATE
    rate = np.where((t > 0.2) & (t < 1.2), 0.4 * np.sin(np.pi * (t - 0.2)) ** 2, 0.0)
    out = rates_of(QUIET, rate[:, None] * [0.0, 0.0, 1.0])[:, 2]
    assert out.sum() / RATE == pytest.approx(rate.sum() / RATE, rel=1e-9)
    assert out.sum() / RATE == pytest.approx(0.2, rel=1e-6)


# Errors that stay as they are, drawn at switch-on

UNITS = 200  # instruments that are looked at
WITHIN = 4.5 * np.sqrt(2.0 / (3 * UNITS))  # relative bound of a variance over their three axes
ALL_DRAWN = replace(
    QUIET,
    gyro_scale_factor_sigma=0.01,
    gyro_misalignment_sigma_rad=0.01,
    gyro_g_sensitivity_sigma_rad_s_m=0.01,
    gyro_turn_on_bias_sigma_rad_s=0.01,
    accelerometer_scale_factor_sigma=0.01,
    accelerometer_misalignment_sigma_rad=0.01,
    accelerometer_turn_on_bias_sigma_m_s2=0.01,
)  # each error that a unit keeps


def _responses(parameters: ImuParameters, stimulus: str) -> tuple[np.ndarray, np.ndarray]:
    """(UNITS, 3, 3) matrices from a unit rate or force along each axis to rates and to forces, one a unit."""
    held = 100  # samples: the filters settle to exp(-180)
    motion = {"w_WB_B": np.zeros((3 * held, 3)), "specific_force_B": np.zeros((3 * held, 3))}
    motion[stimulus][:] = np.repeat(np.eye(3), held, axis=0)
    records = [imu_of(parameters, seed).record(3 * held, **motion) for seed in range(UNITS)]
    gyros = np.array([r.angular_rate_rad_s[held - 1 :: held].T for r in records])
    accelerometers = np.array([r.specific_force_m_s2[held - 1 :: held].T for r in records])
    return gyros, accelerometers


def _diagonal(matrices: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Diagonal (units, 3) and the rest (units, 6)."""
    on = np.eye(3, dtype=bool)
    return matrices[:, on], matrices[:, ~on]


@pytest.mark.parametrize("sensors", SENSORS)
def test_scale_factors_stretch_each_axis_by_its_own_draw_and_nothing_else(sensors: str) -> None:
    stimulus = "w_WB_B" if sensors == "gyro" else "specific_force_B"
    only = replace(QUIET, **{f"{sensors}_scale_factor_sigma": 0.02})
    stretch, rest = _diagonal(_responses(only, stimulus)[sensors == "accelerometer"])
    assert np.var(stretch - 1.0) == pytest.approx(0.02**2, rel=WITHIN)
    assert abs(np.mean(stretch - 1.0)) < 4.5 * 0.02 / np.sqrt(stretch.size)
    assert np.abs(rest).max() < 1e-9
    assert abs(np.corrcoef(stretch.T)[0, 1]) < 4.5 / np.sqrt(UNITS)


@pytest.mark.parametrize("sensors", SENSORS)
def test_misalignment_lets_each_axis_feel_the_others_and_leaves_its_own(sensors: str) -> None:
    stimulus = "w_WB_B" if sensors == "gyro" else "specific_force_B"
    only = replace(QUIET, **{f"{sensors}_misalignment_sigma_rad": 0.01})
    own, others = _diagonal(_responses(only, stimulus)[sensors == "accelerometer"])
    assert np.abs(own - 1.0).max() < 1e-9
    assert np.var(others) == pytest.approx(0.01**2, rel=WITHIN / np.sqrt(2.0))
    assert abs(np.mean(others)) < 4.5 * 0.01 / np.sqrt(others.size)
    symmetric = np.corrcoef(others[:, 0], others[:, 2])[0, 1]  # xy against yx: the axes are not at right angles
    assert abs(symmetric) < 4.5 / np.sqrt(UNITS)


def test_g_sensitivity_lets_the_gyros_feel_force_and_the_accelerometers_no_rate() -> None:
    only = replace(QUIET, gyro_g_sensitivity_sigma_rad_s_m=1e-4)
    gyros, accelerometers = _responses(only, "specific_force_B")
    assert np.var(gyros) == pytest.approx(1e-8, rel=WITHIN / np.sqrt(3.0))
    assert np.abs(accelerometers - np.eye(3)).max() < 1e-9
    gyros, accelerometers = _responses(only, "w_WB_B")
    assert np.abs(gyros - np.eye(3)).max() < 1e-9
    assert np.abs(accelerometers).max() < 1e-9


@pytest.mark.parametrize("sensors", SENSORS)
def test_turn_on_bias_is_drawn_once_a_unit_with_its_standard_deviation(sensors: str) -> None:
    name = "gyro_turn_on_bias_sigma_rad_s" if sensors == "gyro" else "accelerometer_turn_on_bias_sigma_m_s2"
    sigma = getattr(SHEET, name)
    biases = np.empty((UNITS, 3))
    for seed in range(UNITS):
        samples = still(replace(QUIET, **{name: sigma}), 3, seed=seed)[1 if sensors == "gyro" else 2]
        assert np.ptp(samples, axis=0).max() == 0.0
        biases[seed] = samples[0]
    assert np.var(biases) == pytest.approx(sigma**2, rel=WITHIN)
    assert abs(np.mean(biases)) < 4.5 * sigma / np.sqrt(biases.size)


def test_a_steady_motion_is_felt_with_all_errors_that_stay_from_the_first_sample_on() -> None:
    """Rates and forces are different, so that each is seen to come in by its own matrix."""
    w, f = np.tile([0.1, -0.2, 0.3], (100, 1)), np.tile([2.0, -3.0, 9.0], (100, 1))
    record = imu_of(ALL_DRAWN, 3).record(100, w, np.zeros((100, 3)), f)
    for samples in (record.angular_rate_rad_s, record.specific_force_m_s2):
        np.testing.assert_allclose(samples, samples[-1:].repeat(100, axis=0), rtol=0.0, atol=1e-9)
    assert np.abs(record.angular_rate_rad_s[0] - w[0]).min() > 1e-3


def test_every_drawn_error_is_a_draw_of_its_own() -> None:
    """Scale factors, misalignments, g-sensitivities, biases of both triads: 33 numbers a unit, none with another."""
    biases = [np.array([getattr(imu_of(ALL_DRAWN, s), f"{n}_bias_I") for s in range(UNITS)]) for n in SENSORS]
    by_rate, by_force = _responses(ALL_DRAWN, "w_WB_B"), _responses(ALL_DRAWN, "specific_force_B")
    responses = [by_rate[0] - biases[0][:, :, None], by_force[0] - biases[0][:, :, None]]
    responses.append(by_force[1] - biases[1][:, :, None])
    drawn = np.hstack([r.reshape(UNITS, 9) for r in responses] + biases)
    correlation = np.corrcoef(drawn.T) - np.eye(33)
    assert np.abs(correlation).max() < 5.0 / np.sqrt(UNITS)  # 528 pairs: 4.5 each would be a false alarm in 280


# Errors that move


@pytest.mark.parametrize("bandwidth_hz", [5.0, 200.0])
def test_white_noise_has_the_variance_of_its_density_over_the_sample_time_whatever_the_bandwidth(
    bandwidth_hz: float,
) -> None:
    n = 40000
    noisy = replace(
        QUIET,
        gyro_noise_density_rad_s_rthz=SHEET.gyro_noise_density_rad_s_rthz,
        accelerometer_noise_density_m_s2_rthz=SHEET.accelerometer_noise_density_m_s2_rthz,
        gyro_bandwidth_hz=bandwidth_hz,
        accelerometer_bandwidth_hz=bandwidth_hz,
    )
    _, rates, forces = still(noisy, n)
    densities = noisy.gyro_noise_density_rad_s_rthz, noisy.accelerometer_noise_density_m_s2_rthz
    for noise, density in zip((rates, forces), densities, strict=True):
        sigma = density * np.sqrt(RATE)
        assert noise.var() == pytest.approx(sigma**2, rel=4.5 * np.sqrt(2.0 / (3 * n)))
        assert abs(noise.mean()) < 4.5 * sigma / np.sqrt(3 * n)
        for lag in (1, 2, 5):
            correlation = (noise[lag:] * noise[:-lag]).mean() / sigma**2
            assert abs(correlation) < 4.5 / np.sqrt(3 * (n - lag))
    assert abs(np.corrcoef(rates[:, 0], rates[:, 1])[0, 1]) < 4.5 / np.sqrt(n)
    assert abs(np.corrcoef(rates.ravel(), forces.ravel())[0, 1]) < 4.5 / np.sqrt(3 * n)


def test_bias_instability_forgets_itself_within_its_correlation_time_and_keeps_its_variance() -> None:
    """First-order Gauss-Markov of sigma = B/0.6174: correlation exp(-t/T) at t = T, the same from the start on.

    Samples of one axis are correlated: 60 000 of them are worth 60 000 tanh(dt/T), 5980 independent ones.
    """
    sigma = 1e-3 / 0.6174
    drifting = replace(
        QUIET,
        gyro_bias_instability_rad_s=1e-3,
        gyro_bias_correlation_s=0.02,
        accelerometer_bias_instability_m_s2=1e-3,
        accelerometer_bias_correlation_s=0.02,
    )
    for drift in still(drifting, 20000)[1:]:
        worth = drift.size * np.tanh(1.0 / (RATE * 0.02))
        assert drift.var() == pytest.approx(sigma**2, rel=4.5 * np.sqrt(2.0 / worth))
        correlation = (drift[10:] * drift[:-10]).mean() / (drift**2).mean()
        assert correlation == pytest.approx(np.exp(-1.0), abs=4.5 / np.sqrt(worth))
    first = np.array([still(drifting, 1, seed=seed).angular_rate_rad_s[0] for seed in range(UNITS)])
    assert first.var() == pytest.approx(sigma**2, rel=WITHIN)


@pytest.mark.parametrize("sensors", SENSORS)
def test_the_first_drift_is_another_draw_than_the_turn_on_bias(sensors: str) -> None:
    unit = "rad_s" if sensors == "gyro" else "m_s2"
    biased = replace(QUIET, **{f"{sensors}_turn_on_bias_sigma_{unit}": 0.01})
    drifting = replace(QUIET, **{f"{sensors}_bias_instability_{unit}": 0.01})
    first = [
        np.concatenate([still(sheet, 1, seed=seed)[1 if sensors == "gyro" else 2][0] for seed in range(UNITS)])
        for sheet in (biased, drifting)
    ]
    assert abs(np.corrcoef(*first)[0, 1]) < 4.5 / np.sqrt(3 * UNITS)


def test_the_walk_that_stands_for_the_gyro_bias_is_as_quick_as_its_drift_and_its_walk_together() -> None:
    """Variance of the change from sample to sample, 1e-5 of the drift's correlation time apart, over that time."""
    drifting = replace(
        QUIET,
        gyro_bias_instability_rad_s=1e-3,
        gyro_bias_correlation_s=200.0,
        gyro_rate_random_walk_rad_s_rts=2e-4,
    )
    change = np.diff(still(drifting, 60000).angular_rate_rad_s, axis=0)
    walk = drifting.gyro_bias_walk_rad_s_rts
    assert change.var() * RATE == pytest.approx(walk**2, rel=4.5 * np.sqrt(2.0 / change.size))


def test_random_walk_starts_at_zero_and_its_variance_grows_by_k_squared_a_second() -> None:
    walking = replace(QUIET, gyro_rate_random_walk_rad_s_rts=1e-3, accelerometer_random_walk_m_s2_rts=2e-3)
    n, lag = 60000, 250  # 0.5 s: 240 steps a record and axis that do not overlap
    for walk, K in zip(still(walking, n)[1:], (1e-3, 2e-3), strict=True):
        assert np.abs(walk[0]).max() < 5.0 * K / np.sqrt(RATE)
        single = np.diff(walk, axis=0)
        assert single.var() == pytest.approx(K**2 / RATE, rel=4.5 * np.sqrt(2.0 / single.size))
        steps = np.diff(walk[::lag], axis=0)
        assert steps.var() == pytest.approx(K**2 * lag / RATE, rel=4.5 * np.sqrt(2.0 / steps.size))


def test_the_true_biases_are_what_the_samples_scatter_around() -> None:
    sheet = replace(
        SHEET,
        gyro_rate_random_walk_rad_s_rts=0.0,
        gyro_bias_instability_rad_s=0.0,
        accelerometer_random_walk_m_s2_rts=0.0,
        accelerometer_bias_instability_m_s2=0.0,
        gyro_g_sensitivity_sigma_rad_s_m=0.0,
    )
    imu = imu_of(sheet, 8)
    record = imu.record(20000, specific_force_B=np.zeros((20000, 3)))
    for samples, bias, N in (
        (record.angular_rate_rad_s, imu.gyro_bias_I, sheet.gyro_noise_density_rad_s_rthz),
        (record.specific_force_m_s2, imu.accelerometer_bias_I, sheet.accelerometer_noise_density_m_s2_rthz),
    ):
        assert samples.mean(0) == pytest.approx(bias, abs=4.5 * N * np.sqrt(RATE / 20000))
        assert np.abs(bias).max() > 10.0 * N * np.sqrt(RATE / 20000)


def test_the_true_biases_are_those_of_the_last_sample_drift_and_walk_included() -> None:
    noiseless = replace(QUIET, **{f.name: getattr(SHEET, f.name) for f in fields(SHEET) if "bias" in f.name})
    imu = imu_of(replace(noiseless, gyro_rate_random_walk_rad_s_rts=1e-3, accelerometer_random_walk_m_s2_rts=1e-3), 3)
    for k in range(20):
        sample = imu.step(k / RATE, np.zeros(3), np.zeros(3), np.zeros(3))
        assert sample is not None
        assert sample.angular_rate_rad_s == pytest.approx(imu.gyro_bias_I, abs=1e-11)
        assert sample.specific_force_m_s2 == pytest.approx(imu.accelerometer_bias_I, abs=1e-11)


# Converter


@pytest.mark.parametrize("sensors", [rates_of, forces_of])
def test_the_range_clips_both_ways(sensors: Any) -> None:
    limit = SHEET.gyro_range_rad_s if sensors is rates_of else SHEET.accelerometer_range_m_s2
    out = sensors(QUIET, np.tile([1.1 * limit, -3.0 * limit, 0.9 * limit], (100, 1)))[-1]
    assert out == pytest.approx([limit, -limit, 0.9 * limit], abs=1e-9)


@pytest.mark.parametrize("sensors", [rates_of, forces_of])
def test_every_output_is_a_whole_number_of_quanta_and_the_nearest(sensors: Any) -> None:
    coarse = replace(QUIET, gyro_quantum_rad_s=0.01, accelerometer_quantum_m_s2=0.01)
    motion = np.random.default_rng(2).uniform(-1.0, 1.0, (200, 3))
    out, fine = sensors(coarse, motion), sensors(QUIET, motion)
    assert np.allclose(out / 0.01, np.round(out / 0.01), atol=1e-9)
    assert np.abs(out - fine).max() <= 0.005 + 1e-9
    assert (out - fine).var() == pytest.approx(0.01**2 / 12.0, rel=0.2)
