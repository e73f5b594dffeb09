"""Prediction of the drogue's swing."""

import numpy as np
import pytest
from scipy.linalg import expm

from dockair.nav.guidance.drogue_motion import DrogueMotion, SwingSettings

STEP_S, LEAD_S = 0.01, 0.25


def follow(path, rate, seconds=20.0, settings=None):
    """Feed exact places and rates; return time and prediction at the end."""
    motion = DrogueMotion(settings or SwingSettings(), STEP_S, LEAD_S)
    motion.start(path(0.0), rate(0.0))
    for k in range(1, round(seconds / STEP_S) + 1):
        motion.step(path(k * STEP_S), rate(k * STEP_S))
    return seconds, motion


def test_a_known_swing_is_continued_by_its_closed_form():
    """s = 0.1 exp(-zeta omega t) cos(omega_d t), the free response of Eq. (1), with its first two derivatives."""
    settings, t = SwingSettings(), 0.7
    omega = 2.0 * np.pi * np.array(settings.frequency_hz)
    pole = -settings.damping * omega + 1j * omega * np.sqrt(1.0 - settings.damping**2)
    motion = DrogueMotion(settings, STEP_S, LEAD_S)
    motion._x = np.column_stack([np.zeros((2, 2)), *((0.1 * pole**n * np.exp(pole * t)).real for n in (0, 1))])
    for n, predicted in enumerate(motion.ahead()):
        np.testing.assert_allclose(predicted, (0.1 * pole**n * np.exp(pole * (t + LEAD_S))).real, atol=1e-12)


def test_a_steady_drift_is_predicted_without_error_and_told_from_the_swing():
    drift = np.array([0.2, -0.1])
    t, motion = follow(lambda t: drift * t, lambda t: drift)
    place, velocity, _ = motion.ahead()
    np.testing.assert_allclose(place, drift * (t + LEAD_S), atol=1e-3)
    np.testing.assert_allclose(velocity, drift, atol=1e-3)
    np.testing.assert_allclose(motion.drift_m_s, drift, atol=1e-3)


def test_prediction_is_as_good_as_its_own_covariance_says():
    """Place simulated from Eq. (1) with the settings' densities: the error's variance is the Riccati equation's.

    P over the lead time is e^(A tau) P e^(A' tau) plus what the noise adds; P is computed here by iteration. Errors
    are correlated over about a second: 600 s give some 600 independent ones an axis, 5 sigma of their variance 29 %.
    """
    settings, rng, ticks = SwingSettings(), np.random.default_rng(2), 60_000
    lead, H = round(LEAD_S / STEP_S), np.array([[1.0, 0.0, 1.0, 0.0], [0.0, 1.0, 0.0, 1.0]])
    R = np.diag([settings.position_sigma_m, settings.rate_sigma_m_s]) ** 2
    densities = np.array([0.0, settings.drift_acceleration_density, 0.0, settings.swing_acceleration_density])
    Q = np.diag(densities**2) * STEP_S
    F, expected = [], []
    for frequency_hz in settings.frequency_hz:
        omega = 2.0 * np.pi * frequency_hz
        A = np.zeros((4, 4))
        A[0, 1] = A[2, 3] = 1.0
        A[3, 2:] = -(omega**2), -2.0 * settings.damping * omega
        F.append(expm(A * STEP_S))
        P = np.eye(4)
        for _ in range(4000):
            P = F[-1] @ P @ F[-1].T + Q
            P = P - P @ H.T @ np.linalg.solve(H @ P @ H.T + R, H @ P)
        for _ in range(lead):
            P = F[-1] @ P @ F[-1].T + Q
        expected.append(P[[0, 0, 2, 2], [0, 2, 0, 2]].sum())
    x, true, motion, predicted = np.zeros((2, 4)), [], DrogueMotion(settings, STEP_S, LEAD_S), []
    motion.start(np.zeros(2), np.zeros(2))
    for _ in range(ticks):
        kick = np.sqrt(STEP_S) * densities * rng.standard_normal((2, 4))
        x = np.stack([F[i] @ x[i] for i in range(2)]) + kick
        seen = x @ H.T + rng.standard_normal((2, 2)) * np.sqrt(np.diag(R))
        motion.step(seen[:, 0], seen[:, 1])
        true.append(x @ H[0])
        predicted.append(motion.ahead()[0])
    error = np.array(true)[lead + 500 :] - np.array(predicted)[500:-lead]
    np.testing.assert_allclose(np.mean(error**2, axis=0), expected, rtol=0.29)
    moved = np.array(true)[lead + 500 :] - np.array(true)[500:-lead]
    assert np.all(np.std(error, axis=0) < np.std(moved, axis=0))


def test_unseen_it_goes_on_by_the_model():
    motion = DrogueMotion(SwingSettings(), STEP_S, LEAD_S)
    motion.start(np.array([1.0, -1.0]), np.array([0.1, 0.2]))
    for _ in range(100):
        motion.step(None, None)
    np.testing.assert_allclose(motion.ahead()[0], [1.0 + 0.1 * 1.25, -1.0 + 0.2 * 1.25], atol=1e-9)
    assert motion.drift_m_s == pytest.approx([0.1, 0.2])
