"""The IMU term by term: filter, lever arm and mounting in closed form, the errors by their statistics.

Statistical bounds are 4.5 standard errors (a false alarm in 1.5e5 each); seeds are fixed. Allan deviations of long
records are in test_imu_allan.py.
"""

from dataclasses import fields, replace
from typing import Any

import numpy as np
import pytest
from scipy import signal

from dockair.errors import DockairError
from dockair.messages import ReceiverCommand
from dockair.parameters import load_parameters
from dockair.rotations import exp
from dockair.sim.faults import ImuFault
from dockair.sim.imu import Imu, ImuParameters, ImuRecord

SHEET = load_parameters("imu_mti", ImuParameters)
RATE = 500.0
G = 9.80665
#: No error at all but the filters and the ranges.
QUIET = replace(
    SHEET,
    **{
        f.name: 0.0
        for f in fields(ImuParameters)
        if f.name.endswith("_jitter_s") or any(w in f.name for w in ("noise", "instability", "walk", "sigma"))
    },
    gyro_quantum_rad_s=1e-12,
    accelerometer_quantum_m_s2=1e-12,
)


def _imu(
    parameters: ImuParameters, seed: int = 0, rate: float = RATE, R_BI: Any = np.eye(3), p_BI: Any = (0.0, 0.0, 0.0)
) -> Imu:
    gyro, accelerometer, clock = (np.random.default_rng((seed, i)) for i in range(3))
    return Imu(parameters, rate, gyro, accelerometer, clock, R_BI, np.array(p_BI))


def _rates(parameters: ImuParameters, w: np.ndarray, **more: Any) -> np.ndarray:
    return _imu(parameters, **more).record(len(w), w_WB_B=w).angular_rate_rad_s


def _forces(parameters: ImuParameters, f: np.ndarray, **more: Any) -> np.ndarray:
    return _imu(parameters, **more).record(len(f), specific_force_B=f).specific_force_m_s2


def _still(parameters: ImuParameters, n: int, **more: Any) -> ImuRecord:
    """A record in free fall: nothing to measure."""
    return _imu(parameters, **more).record(n, specific_force_B=np.zeros((n, 3)))


# What an ideal IMU on the receiver feels


def test_a_steady_motion_is_measured_as_it_is_from_the_first_sample() -> None:
    w, f = np.tile([0.1, -0.2, 0.3], (50, 1)), np.tile([1.0, -2.0, 9.0], (50, 1))
    record = _imu(QUIET).record(50, w, np.zeros((50, 3)), f)
    assert np.allclose(record.angular_rate_rad_s, w, atol=1e-9)
    assert np.allclose(record.specific_force_m_s2, f, atol=1e-9)


def test_standing_upright_the_accelerometers_read_gravity_upward() -> None:
    assert _imu(QUIET).record(3).specific_force_m_s2[2] == pytest.approx([0.0, 0.0, G], abs=1e-9)


def test_the_mounting_turns_body_axes_into_the_imus() -> None:
    """An IMU turned by 90 deg to the left: its x axis is the body's y."""
    R_BI = exp(np.array([0.0, 0.0, np.pi / 2]))
    motion = np.tile([0.1, 0.2, 0.3], (3, 1))
    assert _rates(QUIET, motion, R_BI=R_BI)[0] == pytest.approx([0.2, -0.1, 0.3], abs=1e-9)
    assert _forces(QUIET, motion, R_BI=R_BI)[0] == pytest.approx([0.2, -0.1, 0.3], abs=1e-9)


def test_turning_about_the_vertical_pulls_the_imu_inward_and_speeding_up_pushes_it_along() -> None:
    """2 m ahead of the centre of gravity: -w^2 r along x; alpha r along y, to the left when the yaw rate grows."""
    w, alpha = np.tile([0.0, 0.0, 0.5], (3, 1)), np.tile([0.0, 0.0, 0.25], (3, 1))
    imu = _imu(QUIET, p_BI=(2.0, 0.0, 0.0))
    felt = imu.record(3, w, alpha, np.zeros((3, 3))).specific_force_m_s2[0]
    assert felt == pytest.approx([-0.5, 0.5, 0.0], abs=1e-9)


def test_the_lever_arm_is_that_of_rigid_bodies_on_any_motion() -> None:
    w, alpha, f, r, turn = np.random.default_rng(1).normal(size=(5, 3))
    R_BI = exp(turn)
    expected = R_BI.T @ (f + np.cross(alpha, r) + np.cross(w, np.cross(w, r)))
    felt = _imu(QUIET, R_BI=R_BI, p_BI=r).step(0.0, w, alpha, f)
    assert felt is not None
    assert felt.specific_force_m_s2 == pytest.approx(expected, abs=1e-9)
    assert felt.angular_rate_rad_s == pytest.approx(R_BI.T @ w, abs=1e-9)


def test_in_the_world_the_imus_place_accelerates_as_the_truth_says(make_world: Any, receiver_on_rails: Any) -> None:
    """Second difference of the IMU's own place less gravity against what it feels, on a tumbling, pushed receiver.

    A semi-implicit step of 1 ms is first order: 1e-3 of the forces of some 10 m/s^2, where leaving out the lever arm
    would be wrong by 10.
    """

    class Tumbling(receiver_on_rails):  # type: ignore[misc]
        def step(self, *, R_WB: np.ndarray, **state: Any) -> tuple[np.ndarray, np.ndarray]:
            self.time_s = getattr(self, "time_s", 0.0) + 1e-3
            torque_B = self.inertia_B @ [2.0 * np.cos(9.0 * self.time_s), 1.5, -2.0]
            return self.mass_kg * np.array([3.0, np.sin(7.0 * self.time_s), 9.0]), R_WB @ torque_B

    world, p_BI = make_world(receiver=Tumbling(), p_PD_B=(80.0, 0.0, 0.0)), np.array([3.0, -0.4, 0.7])
    truths = [world.step(ReceiverCommand()) for _ in range(700)]
    place = np.array([t.p_WB + t.R_WB @ p_BI for t in truths])
    wide = replace(QUIET, accelerometer_bandwidth_hz=1e5)
    for k in (300, 500, 690):
        before, at = truths[k], truths[k + 1]  # a tick's accelerations change the velocity within it
        a_W = (place[k + 1] - 2.0 * place[k] + place[k - 1]) * 1e6
        middle = [0.5 * (getattr(before, name) + getattr(at, name)) for name in ("alpha_WB_B", "specific_force_B")]
        sample = _imu(wide, p_BI=p_BI).step(0.0, before.w_WB_B, *middle)
        expected = before.R_WB.T @ (a_W + [0.0, 0.0, G])
        np.testing.assert_allclose(sample.specific_force_m_s2, expected, atol=0.05)
        assert np.linalg.norm(expected - middle[1]) > 5.0
        np.testing.assert_allclose(at.alpha_WB_B, (at.w_WB_B - before.w_WB_B) * 1e3, atol=1e-6)


# Filter


def test_the_filter_is_3_db_down_and_lags_by_90_degrees_at_its_bandwidth() -> None:
    """A fast clock, so that the hold between samples plays no part: |H| = 1/sqrt 2 and phase -90 deg for z = 0.707."""
    rate = 20000.0
    t = np.arange(int(rate * 0.2)) / rate
    sheet = replace(QUIET, accelerometer_bandwidth_hz=120.0)
    for f, sensors in ((SHEET.gyro_bandwidth_hz, _rates), (120.0, _forces)):
        out = sensors(sheet, np.sin(2 * np.pi * f * t)[:, None] * [1.0, 0.0, 0.0], rate=rate)[:, 0]
        late = slice(len(t) // 2, None)
        response = 2j * (out[late] * np.exp(-2j * np.pi * f * t[late])).mean()
        assert abs(response) == pytest.approx(1.0 / np.sqrt(2.0), rel=2e-3)
        assert np.degrees(np.angle(response)) == pytest.approx(-90.0, abs=0.3)


@pytest.mark.parametrize("f", [2.0, 30.0, 100.0, 200.0])
def test_at_the_imus_own_rate_the_gain_is_the_continuous_filters_on_the_linear_hold(f: float) -> None:
    """A sampled sine joined by straight lines has images at f + k f_s of size sinc^2; the filter weighs each."""
    t = np.arange(2000) / RATE
    out = _rates(QUIET, np.sin(2 * np.pi * f * t)[:, None] * [0.0, 1.0, 0.0])[:, 1]
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
    assert np.allclose(_forces(QUIET, ramp[:, None] * [0.0, 0.0, 1.0])[:, 2], exact, atol=1e-9)


def test_a_step_overshoots_by_four_percent_and_settles_on_its_value() -> None:
    """Second-order Butterworth: overshoot exp(-pi z/sqrt(1 - z^2)) = 4.3 %."""
    w = np.zeros((1000, 3))
    w[10:] = [0.5, 0.0, 0.0]
    out = _rates(QUIET, w, rate=20000.0)[:, 0]
    assert out.max() / 0.5 == pytest.approx(1.0 + np.exp(-np.pi), rel=1e-3)
    assert out[-1] == pytest.approx(0.5, abs=1e-6)


def test_the_integral_of_the_measured_rate_is_the_angle_turned() -> None:
    """A turn from rest to rest: the filter has gain one at zero frequency, so the angle comes out whole."""
    t = np.arange(1000) / RATE
    rate = np.where((t > 0.2) & (t < 1.2), 0.4 * np.sin(np.pi * (t - 0.2)) ** 2, 0.0)
    out = _rates(QUIET, rate[:, None] * [0.0, 0.0, 1.0])[:, 2]
    assert out.sum() / RATE == pytest.approx(rate.sum() / RATE, rel=1e-9)
    assert out.sum() / RATE == pytest.approx(0.2, rel=1e-6)


# Errors that stay as they are, drawn at switch-on

UNITS = 400  # instruments that are looked at: 1200 draws of 3 axes
WITHIN = 4.5 * np.sqrt(2.0 / (3 * UNITS))  # relative bound of a variance of 1200 draws


def _responses(parameters: ImuParameters, stimulus: str) -> tuple[np.ndarray, np.ndarray]:
    """(UNITS, 3, 3) matrices from a unit rate or force along each axis to rates and to forces, one a unit."""
    gyros, accelerometers = np.empty((UNITS, 3, 3)), np.empty((UNITS, 3, 3))
    for seed in range(UNITS):
        for axis in range(3):
            motion = {"w_WB_B": np.zeros((1, 3)), "specific_force_B": np.zeros((1, 3))}
            motion[stimulus][0, axis] = 1.0
            record = _imu(parameters, seed).record(1, **motion)
            gyros[seed, :, axis], accelerometers[seed, :, axis] = record[1][0], record[2][0]
    return gyros, accelerometers


def _diagonal(matrices: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Diagonal (units, 3) and the rest (units, 6)."""
    on = np.eye(3, dtype=bool)
    return matrices[:, on], matrices[:, ~on]


@pytest.mark.parametrize("sensors", ["gyro", "accelerometer"])
def test_scale_factors_stretch_each_axis_by_its_own_draw_and_nothing_else(sensors: str) -> None:
    stimulus = "w_WB_B" if sensors == "gyro" else "specific_force_B"
    only = replace(QUIET, **{f"{sensors}_scale_factor_sigma": 0.02})
    stretch, rest = _diagonal(_responses(only, stimulus)[sensors == "accelerometer"])
    assert np.var(stretch - 1.0) == pytest.approx(0.02**2, rel=WITHIN)
    assert abs(np.mean(stretch - 1.0)) < 4.5 * 0.02 / np.sqrt(stretch.size)
    assert np.abs(rest).max() < 1e-9
    assert abs(np.corrcoef(stretch.T)[0, 1]) < 4.5 / np.sqrt(UNITS)


@pytest.mark.parametrize("sensors", ["gyro", "accelerometer"])
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


@pytest.mark.parametrize("sensors", ["gyro", "accelerometer"])
def test_turn_on_bias_is_drawn_once_a_unit_with_its_standard_deviation(sensors: str) -> None:
    name = "gyro_turn_on_bias_sigma_rad_s" if sensors == "gyro" else "accelerometer_turn_on_bias_sigma_m_s2"
    sigma = getattr(SHEET, name)
    biases = np.empty((UNITS, 3))
    for seed in range(UNITS):
        samples = _still(replace(QUIET, **{name: sigma}), 3, seed=seed)[1 if sensors == "gyro" else 2]
        assert np.ptp(samples, axis=0).max() == 0.0
        biases[seed] = samples[0]
    assert np.var(biases) == pytest.approx(sigma**2, rel=WITHIN)
    assert abs(np.mean(biases)) < 4.5 * sigma / np.sqrt(biases.size)


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
    _, rates, forces = _still(noisy, n)
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
    for drift in _still(drifting, 20000)[1:]:
        worth = drift.size * np.tanh(1.0 / (RATE * 0.02))
        assert drift.var() == pytest.approx(sigma**2, rel=4.5 * np.sqrt(2.0 / worth))
        correlation = (drift[10:] * drift[:-10]).mean() / (drift**2).mean()
        assert correlation == pytest.approx(np.exp(-1.0), abs=4.5 / np.sqrt(worth))
    first = np.array([_still(drifting, 1, seed=seed).angular_rate_rad_s[0] for seed in range(UNITS)])
    assert first.var() == pytest.approx(sigma**2, rel=WITHIN)


def test_random_walk_starts_at_zero_and_its_variance_grows_by_k_squared_a_second() -> None:
    walking = replace(QUIET, gyro_rate_random_walk_rad_s_rts=1e-3, accelerometer_random_walk_m_s2_rts=2e-3)
    n, lag = 60000, 250  # 0.5 s: 240 steps a record and axis that do not overlap
    for walk, K in zip(_still(walking, n)[1:], (1e-3, 2e-3), strict=True):
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
    imu = _imu(sheet, 8)
    record = imu.record(20000, specific_force_B=np.zeros((20000, 3)))
    for samples, bias, N in (
        (record.angular_rate_rad_s, imu.gyro_bias_I, sheet.gyro_noise_density_rad_s_rthz),
        (record.specific_force_m_s2, imu.accelerometer_bias_I, sheet.accelerometer_noise_density_m_s2_rthz),
    ):
        assert samples.mean(0) == pytest.approx(bias, abs=4.5 * N * np.sqrt(RATE / 20000))
        assert np.abs(bias).max() > 10.0 * N * np.sqrt(RATE / 20000)


def test_the_true_biases_are_those_of_the_last_sample_drift_and_walk_included() -> None:
    noiseless = replace(QUIET, **{f.name: getattr(SHEET, f.name) for f in fields(SHEET) if "bias" in f.name})
    imu = _imu(replace(noiseless, gyro_rate_random_walk_rad_s_rts=1e-3, accelerometer_random_walk_m_s2_rts=1e-3), 3)
    for k in range(20):
        sample = imu.step(k / RATE, np.zeros(3), np.zeros(3), np.zeros(3))
        assert sample is not None
        assert sample.angular_rate_rad_s == pytest.approx(imu.gyro_bias_I, abs=1e-11)
        assert sample.specific_force_m_s2 == pytest.approx(imu.accelerometer_bias_I, abs=1e-11)


# Converter and clock


@pytest.mark.parametrize("sensors", [_rates, _forces])
def test_the_range_clips_both_ways(sensors: Any) -> None:
    limit = SHEET.gyro_range_rad_s if sensors is _rates else SHEET.accelerometer_range_m_s2
    out = sensors(QUIET, np.tile([1.1 * limit, -3.0 * limit, 0.9 * limit], (100, 1)))[-1]
    assert out == pytest.approx([limit, -limit, 0.9 * limit], abs=1e-9)


@pytest.mark.parametrize("sensors", [_rates, _forces])
def test_every_output_is_a_whole_number_of_quanta_and_the_nearest(sensors: Any) -> None:
    coarse = replace(QUIET, gyro_quantum_rad_s=0.01, accelerometer_quantum_m_s2=0.01)
    motion = np.random.default_rng(2).uniform(-1.0, 1.0, (200, 3))
    out, fine = sensors(coarse, motion), sensors(QUIET, motion)
    assert np.allclose(out / 0.01, np.round(out / 0.01), atol=1e-9)
    assert np.abs(out - fine).max() <= 0.005 + 1e-9
    assert (out - fine).var() == pytest.approx(0.01**2 / 12.0, rel=0.2)


def test_a_bias_uses_up_range() -> None:
    """Clipping comes after everything that is added: a biased gyro saturates at its range, not beyond it."""
    sheet = replace(QUIET, gyro_turn_on_bias_sigma_rad_s=0.5)
    imu = _imu(sheet)
    bias = imu.gyro_bias_I
    out = imu.record(1, w_WB_B=np.sign(bias)[None] * (SHEET.gyro_range_rad_s - 1e-3)).angular_rate_rad_s[0]
    assert np.abs(bias).min() > 2e-3
    assert np.abs(out) == pytest.approx(SHEET.gyro_range_rad_s, abs=1e-9)


def test_time_stamps_jitter_by_their_standard_deviation_and_the_samples_do_not() -> None:
    n = 20000
    jittery, exact = (_imu(replace(SHEET, time_stamp_jitter_s=s), 4).record(n, start_s=3.0) for s in (5e-5, 0.0))
    assert np.allclose(exact.time_stamp_s, 3.0 + np.arange(n) / RATE, atol=1e-12)
    error = jittery.time_stamp_s - exact.time_stamp_s
    assert error.var() == pytest.approx(25e-10, rel=4.5 * np.sqrt(2.0 / n))
    assert abs(error.mean()) < 4.5 * 5e-5 / np.sqrt(n)
    assert abs((error[1:] * error[:-1]).mean()) / 25e-10 < 4.5 / np.sqrt(n)
    assert np.array_equal(jittery.angular_rate_rad_s, exact.angular_rate_rad_s)


def test_time_stamps_stay_in_order_however_bad_the_clock() -> None:
    stamps = _imu(replace(SHEET, time_stamp_jitter_s=0.01)).record(20000).time_stamp_s
    assert np.diff(stamps).min() > 0.0
    assert np.abs(stamps - np.arange(20000) / RATE).max() <= 0.49 / RATE + 1e-12


# Streams, steps and records


def test_a_record_is_what_so_many_steps_give_bit_for_bit() -> None:
    n = 9000  # more than a block of random numbers
    w, alpha, f = np.random.default_rng(6).normal(size=(3, n, 3))
    stamps, rates, forces = _imu(SHEET, p_BI=(1.0, 0.2, -0.3)).record(n, w, alpha, f)
    stepping = _imu(SHEET, p_BI=(1.0, 0.2, -0.3))
    samples = [stepping.step(k / RATE, w[k], alpha[k], f[k]) for k in range(n)]
    assert np.array_equal([s.time_stamp_s for s in samples], stamps)
    assert np.array_equal([s.angular_rate_rad_s for s in samples], rates)
    assert np.array_equal([s.specific_force_m_s2 for s in samples], forces)


def test_a_record_goes_on_where_the_last_one_ended() -> None:
    w = np.random.default_rng(7).normal(size=(600, 3))
    whole = _imu(SHEET).record(600, w).angular_rate_rad_s
    imu = _imu(SHEET)
    parts = [imu.record(200, w[:200]), imu.record(400, w[200:])]
    assert np.array_equal(np.concatenate([p.angular_rate_rad_s for p in parts]), whole)


def test_the_same_streams_give_the_same_record_and_others_another() -> None:
    assert all(np.array_equal(a, b) for a, b in zip(_still(SHEET, 20, seed=5), _still(SHEET, 20, seed=5), strict=True))
    for a, b in zip(_still(SHEET, 20, seed=5), _still(SHEET, 20, seed=6), strict=True):
        assert not np.array_equal(a, b)


def test_switching_one_error_off_leaves_every_other_as_it_was() -> None:
    """Gyros without any error beside the same accelerometers and clock; a bias that goes leaves the noise."""
    gyroless = replace(SHEET, **{f.name: getattr(QUIET, f.name) for f in fields(SHEET) if f.name.startswith("gyro_")})
    usual, less = _still(SHEET, 300), _still(gyroless, 300)
    assert np.array_equal(usual.specific_force_m_s2, less.specific_force_m_s2)
    assert np.array_equal(usual.time_stamp_s, less.time_stamp_s)
    fine = replace(SHEET, gyro_quantum_rad_s=1e-12)
    biased, unbiased = (_still(replace(fine, gyro_turn_on_bias_sigma_rad_s=s), 300)[1] for s in (3.5e-3, 0.0))
    assert np.ptp(biased - unbiased, axis=0).max() < 1e-11
    assert np.abs(biased - unbiased).min() > 1e-5


def test_a_rate_that_is_not_positive_is_refused() -> None:
    with pytest.raises(DockairError, match=r"imu\.rate_hz"):
        _imu(SHEET, rate=0.0)


# Faults


def _pair(fault: ImuFault, parameters: ImuParameters = SHEET) -> tuple[list[Any], list[Any]]:
    """60 samples with a fault in the middle third, and without."""
    w, f = np.array([0.1, -0.2, 0.3]), np.array([0.0, 1.0, G])
    healthy, ill = _imu(parameters, 9), _imu(parameters, 9)
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
    sample = _imu(QUIET).step(0.0, fast, fast, fast, wide)
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


def test_no_error_of_a_better_grade_is_larger_than_a_worse_ones() -> None:
    tactical, mti, consumer = (load_parameters(f"imu_{g}", ImuParameters) for g in ("tactical", "mti", "consumer"))
    for f in fields(ImuParameters):
        if any(word in f.name for word in ("noise", "instability", "walk", "sigma", "jitter")):
            assert 0.0 < getattr(tactical, f.name) <= getattr(mti, f.name) <= getattr(consumer, f.name), f.name
