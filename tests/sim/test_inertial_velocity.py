"""The drift of the receiver's own inertial navigation."""

import numpy as np
import pytest
from scipy.stats import chi2

from dockair.sim.aircraft.inertial_velocity import InertialVelocity


def test_drift_has_the_strength_and_the_correlation_of_the_sheet() -> None:
    """400 drifts of 3 axes: chi2(1200) at the start and 100 s later; false alarm 1e-5."""
    start, end = np.empty((400, 3)), np.empty((400, 3))
    for i in range(400):
        drift = InertialVelocity(0.2, 100.0, 10.0, np.random.default_rng((3, i)))
        start[i] = drift.drift_m_s
        for _ in range(10):
            end[i] = drift.step(np.zeros(3))
    low, high = chi2.ppf([5e-6, 1.0 - 5e-6], 1200)
    assert low < np.sum(start**2) / 0.04 < high and low < np.sum(end**2) / 0.04 < high
    correlation = np.mean(start * end) / 0.04
    assert correlation == pytest.approx(np.exp(-1.0), abs=4.4 * np.sqrt((1.0 + np.exp(-2.0)) / 1200))


def test_drift_is_the_same_function_of_time_whatever_the_step() -> None:
    coarse, fine = (InertialVelocity(0.2, 1000.0, step_s, np.random.default_rng(5)) for step_s in (1e-3, 5e-4))
    for _ in range(3500):
        at_coarse = coarse.step(np.zeros(3))
        fine.step(np.zeros(3))
        at_fine = fine.step(np.zeros(3))
    np.testing.assert_allclose(at_fine, at_coarse, rtol=0.0, atol=1e-12)
    assert np.abs(at_fine - InertialVelocity(0.2, 1000.0, 1e-3, np.random.default_rng(5)).drift_m_s).max() > 1e-4
