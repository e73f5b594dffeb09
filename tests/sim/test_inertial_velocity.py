"""The drift of the receiver's own inertial navigation."""

import numpy as np
import pytest
from scipy.stats import chi2

from dockair.sim.aircraft.inertial_velocity import KNOT_S, InertialVelocity


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


def test_between_two_knots_the_drift_goes_straight_and_is_added_to_the_velocity_over_the_ground() -> None:
    """Ten knots, eight ticks from one to the next, in a frame that flies at 180 m/s."""
    frame, velocity = np.array([180.0, 0.0, 0.0]), np.array([1.0, -2.0, 3.0])
    drift = InertialVelocity(0.2, 10.0, 0.125 * KNOT_S, np.random.default_rng(6), frame)
    drifts = [drift.drift_m_s]
    for _ in range(80):
        np.testing.assert_allclose(drift.step(velocity) - velocity - frame, drift.drift_m_s, rtol=0.0, atol=1e-12)
        drifts.append(drift.drift_m_s)
    steps = np.diff(drifts, axis=0).reshape(10, 8, 3)
    np.testing.assert_allclose(steps, steps[:, :1].repeat(8, axis=1), rtol=0.0, atol=1e-12)
    z, keeps = np.random.default_rng(6).standard_normal((11, 3)), np.exp(-0.1)
    knots = [0.2 * z[0]]
    for k in range(1, 11):
        knots.append(keeps * knots[-1] + 0.2 * np.sqrt(1.0 - keeps**2) * z[k])  # Eq. (1), exactly
    np.testing.assert_allclose(drifts[::8], knots, rtol=0.0, atol=1e-12)
