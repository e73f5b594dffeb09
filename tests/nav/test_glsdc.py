"""The source's Gauss-Newton: the same minimum as Levenberg-Marquardt from a good start, divergence said from a bad."""

from dataclasses import replace

import numpy as np
import pytest

from dockair.calibration import Camera, LedRing
from dockair.nav.pose.glsdc import GLSDC, glsdc
from dockair.nav.pose.levenberg_marquardt import levenberg_marquardt
from dockair.nav.pose.measurement import lines_of_sight_from_pixels
from dockair.rotations import exp, log, matrix_from_yaw_pitch_roll

RING, CAMERA = LedRing().positions_D, Camera()


def poses(count: int, noise_px: float):
    rng = np.random.default_rng(21)
    for _ in range(count):
        R = matrix_from_yaw_pitch_roll(*rng.uniform(-0.35, 0.35, 3))
        p = rng.uniform(2.0, 12.0) * np.array([1.0, *rng.uniform(-0.1, 0.1, 2)])
        pixels = CAMERA.pixels_from_points(RING @ R.T + p) + noise_px * rng.normal(size=(8, 2))
        axis = rng.normal(size=3)
        yield R, p, lines_of_sight_from_pixels(pixels, RING, CAMERA, np.full(8, 0.1)), axis / np.linalg.norm(axis)


def test_same_minimum_and_covariance_as_levenberg_marquardt_though_the_coordinates_differ():
    for R, p, sight, axis in poses(50, 0.1):
        ours = glsdc(sight, exp(0.02 * axis) @ R, 1.01 * p)
        other = levenberg_marquardt(sight, ours.R_CD, ours.p_CD)
        assert ours.converged
        sigma = np.sqrt(np.diag(other.covariance))
        np.testing.assert_array_less(np.abs(log(ours.R_CD @ other.R_CD.T)), 1e-3 * sigma[:3])
        np.testing.assert_array_less(np.abs(ours.p_CD - other.p_CD), 1e-3 * sigma[3:])
        np.testing.assert_allclose(ours.covariance, other.covariance, rtol=1e-2, atol=1e-2 * sigma.min() ** 2)


def test_divergence_is_a_status_with_nan_covariance_and_a_result_without_it_explains_the_pixels():
    """From 60 degrees off some starts diverge: none may claim convergence elsewhere than at a minimum."""
    unconverged = 0
    for R, p, sight, axis in poses(300, 0.0):
        end = glsdc(sight, exp(np.pi / 3.0 * axis) @ R, 0.6 * p)
        if not end.converged:
            unconverged += 1
            assert np.isnan(end.covariance).all()
        else:  # a minimum: Levenberg-Marquardt from there stays
            again = levenberg_marquardt(sight, end.R_CD, end.p_CD)
            assert np.linalg.norm(log(again.R_CD @ end.R_CD.T)) < 1e-3
    assert unconverged > 0


@pytest.mark.parametrize(
    ("noise_px", "off_sigma", "steps"), [(0.0, 3e-6, 2), (0.0, 3e-7, 1), (0.1, 1e-4, 2), (0.1, 1e-5, 1)]
)
def test_the_last_step_is_a_millionth_of_a_sigma_or_promises_less_than_rounding(noise_px, off_sigma, steps):
    """Starts beside the minimum: a step longer than that brings one more, which is shorter by far."""
    for R, p, sight, axis in poses(20, noise_px):
        least = glsdc(sight, R, p)
        least = glsdc(sight, least.R_CD, least.p_CD)
        x = off_sigma * np.linalg.cholesky(least.covariance) @ np.array([*axis, *axis]) / np.sqrt(2.0)
        start = exp(x[:3]) @ least.R_CD, least.p_CD + x[3:]
        assert glsdc(sight, *start).iterations == steps
        assert glsdc(sight, *start, settings=replace(GLSDC, tolerance_sigma=1.0)).iterations == 1
