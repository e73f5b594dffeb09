"""What the receiver's flight control measures."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import chi2

from dockair.parameters import load_parameters
from dockair.rotations import exp
from dockair.sim.aircraft.flight_control import FlightControlParameters
from dockair.sim.aircraft.own_sensors import SAMPLE_S, OwnSensors, OwnSensorsParameters

PARAMETERS = load_parameters("flight_control", FlightControlParameters).own_sensors
QUIET = OwnSensorsParameters(
    inertial_lag_s=0.02,
    air_data_lag_s=0.1,
    attitude_sigma_rad=0.0,
    rate_sigma_rad_s=0.0,
    specific_force_sigma_m_s2=0.0,
    velocity_sigma_m_s=0.0,
    airspeed_sigma_m_s=0.0,
)
STILL = (np.eye(3), np.zeros(3), np.zeros(3), np.zeros(3))


def noise() -> np.ndarray:
    """(3000, 13) samples of each channel, over its strength in the sheet."""
    sensors, rows = OwnSensors(PARAMETERS, SAMPLE_S, np.random.default_rng(4)), []
    for _ in range(3000):
        R, w, f, v, airspeed = sensors.step(*STILL, 180.0)
        rows.append([R[2, 1], R[0, 2], R[1, 0], *w, *f, *v, airspeed - 180.0])
    return np.array(rows) / PARAMETERS.sigmas


def test_noise_has_the_strength_of_the_sheet() -> None:
    """chi2, false alarm 1e-5 in all 13 channels."""
    sums = np.sum(noise() ** 2, axis=0)
    low, high = chi2.ppf([5e-6 / 13, 1.0 - 5e-6 / 13], 3000)
    assert np.all((low < sums) & (sums < high))


def test_no_channels_noise_tells_of_anothers_or_of_its_own_next_sample() -> None:
    """Correlations of n independent samples have the spread 1/sqrt(n); 5.3 of them, false alarm 1e-5 in 91."""
    rows, most = noise(), 5.3 / np.sqrt(3000)
    between = np.corrcoef(rows.T)[np.triu_indices(13, 1)]
    following = np.mean(rows[1:] * rows[:-1], axis=0)
    assert np.abs(between).max() < most and np.abs(following).max() < most


def test_noise_is_drawn_anew_every_ten_milliseconds_and_held() -> None:
    """290 ticks of 1 ms, too, of which the 29 samples are 28.999... by rounding."""
    assert 290 * 1e-3 / SAMPLE_S < 29.0
    sensors = OwnSensors(PARAMETERS, 1e-3, np.random.default_rng(6))
    rates = np.array([sensors.step(*STILL, 180.0)[1].copy() for _ in range(600)]).reshape(60, 10, 3)
    np.testing.assert_array_equal(rates, rates[:, :1].repeat(10, axis=1))
    assert np.all(np.diff(rates[:, 0], axis=0) != 0.0)


def test_noise_is_the_same_function_of_time_whatever_the_step() -> None:
    coarse = OwnSensors(PARAMETERS, 1e-3, np.random.default_rng(5))
    fine = OwnSensors(PARAMETERS, 5e-4, np.random.default_rng(5))
    for _ in range(137):
        at_coarse = coarse.step(*STILL, 180.0)
        at_fine = fine.step(*STILL, 180.0)
        np.testing.assert_array_equal(at_coarse[1], at_fine[1])
        fine.step(*STILL, 180.0)


@pytest.mark.parametrize("step_s", [1e-3, 2e-3])
def test_lags_are_of_first_order(step_s: float) -> None:
    """A step of rate, force and airspeed after a settled start: 1 - exp(-t / tau), exactly at every tick."""
    sensors = OwnSensors(QUIET, step_s, np.random.default_rng(0))
    sensors.step(*STILL, 180.0)
    for k in range(1, 40):
        _, w, f, v, airspeed = sensors.step(np.eye(3), np.ones(3), 2.0 * np.ones(3), np.ones(3), 181.0)
        slow, quick = -np.expm1(-k * step_s / 0.1), -np.expm1(-k * step_s / 0.02)
        np.testing.assert_allclose(np.concatenate([w, f]), quick * np.repeat([1.0, 2.0], 3), atol=1e-12)
        assert airspeed - 180.0 == pytest.approx(slow, abs=1e-10)
        np.testing.assert_array_equal(v, 1.0)


def test_attitude_is_late_by_the_inertial_lag() -> None:
    """A steady turn w: what is told is where the aircraft was tau ago."""
    sensors, w = OwnSensors(QUIET, 1e-3, np.random.default_rng(0)), np.array([0.3, -0.2, 0.5])
    R = exp(np.array([0.2, 0.1, -0.3]))
    np.testing.assert_allclose(sensors.step(R, w, *STILL[2:], 180.0)[0], R @ exp(-0.02 * w), atol=1e-12)


def test_without_lag_and_noise_the_sensors_tell_the_truth() -> None:
    sensors = OwnSensors(replace(QUIET, inertial_lag_s=0.0, air_data_lag_s=0.0), 1e-3, np.random.default_rng(0))
    rng = np.random.default_rng(1)
    for _ in range(3):
        said = exp(rng.normal(size=3)), rng.normal(size=3), rng.normal(size=3), rng.normal(size=3), 150.0
        for told, true in zip(sensors.step(*said), said, strict=True):
            np.testing.assert_allclose(np.asarray(told), np.asarray(true), atol=1e-12)
