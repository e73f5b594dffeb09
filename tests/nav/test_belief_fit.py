"""Kernels of the fit of a frame and a belief, against scipy and against formulas written out."""

import numpy as np
import pytest
from scipy.optimize import least_squares
from scipy.stats import multivariate_normal

from dockair.calibration import Camera, LedRing
from dockair.nav.belief_fit import _exp, _log, distance2, fitted, image_of
from dockair.nav.pose.measurement import lines_of_sight_from_pixels
from dockair.rotations import exp, log, matrix_from_yaw_pitch_roll

LEDS, CAMERA = LedRing().positions_D, Camera()
R_0, P_0 = matrix_from_yaw_pitch_roll(0.1, -0.15, 0.2), np.array([6.0, 0.3, -0.2])


@pytest.mark.parametrize("angle_rad", [0.0, 1e-13, 1e-9, 1e-5, 0.3, 2.0, 3.0, np.pi - 1e-6])
def test_log_is_the_inverse_of_exp_up_to_half_a_turn(angle_rad):
    rng = np.random.default_rng(0)
    for _ in range(20):
        axis = rng.standard_normal(3)
        phi = angle_rad * axis / np.sqrt(axis @ axis)
        np.testing.assert_allclose(_log(exp(phi)), phi, atol=1e-15 + 1e-9 * angle_rad)
        np.testing.assert_allclose(_log(exp(phi)), log(exp(phi)), atol=1e-15 + 1e-9 * angle_rad)
        np.testing.assert_allclose(_exp(phi)[0], exp(phi), atol=1e-15)
        turned = [log(exp(phi + step) @ exp(phi).T) for step in 1e-6 * np.eye(3)]  # exp(J step), J the left Jacobian
        np.testing.assert_allclose(_exp(phi)[1], np.transpose(turned) / 1e-6, atol=2e-6)


def sight(d, noise_px=0.3, seed=1):
    """Lines of sight of LEDs that are off their places by d (16,), from a pose that is off the belief's."""
    rng = np.random.default_rng(seed)
    points = LEDS.copy()
    points[:, 1:] += d.reshape(-1, 2)
    R, p = exp(np.array([0.02, 0.05, -0.04])) @ R_0, P_0 + [0.1, -0.02, 0.03]
    pixels = CAMERA.pixels_from_points(points @ R.T + p) + noise_px * rng.standard_normal((8, 2))
    return lines_of_sight_from_pixels(pixels, LEDS, CAMERA, np.full(8, noise_px))


def residuals(y, ab, whiten, L_inverse):
    """Whitened image residuals and the belief's, written out."""
    points = LEDS.copy()
    points[:, 1:] += y[6:].reshape(-1, 2)
    at = points @ (exp(y[:3]) @ R_0).T + P_0 + y[3:6]
    image = np.einsum("kij,kj->ki", whiten, ab + at[:, 1:] / at[:, :1]).ravel()
    return np.concatenate([image, L_inverse @ y])


def test_the_image_is_whitened_by_the_weight_of_its_ray():
    """b = (1, -a, -b)/s: residuals of the ray, weighted, are those of the image, to first order."""
    lines = sight(np.zeros(16))
    ab, whiten = image_of(lines.rays, lines.weights)
    np.testing.assert_allclose(ab, -lines.rays[:, 1:] / lines.rays[:, :1], rtol=1e-15)
    step = 1e-6 * np.random.default_rng(2).standard_normal((8, 2))
    moved = np.column_stack([np.ones(8), -(ab + step)])
    moved /= np.sqrt((moved**2).sum(axis=1))[:, None]
    by_ray = np.einsum("ki,kij,kj->k", moved - lines.rays, lines.weights, moved - lines.rays)
    by_image = (np.einsum("kij,kj->ki", whiten, step) ** 2).sum(axis=1)
    np.testing.assert_allclose(by_image, by_ray, rtol=1e-5)


def test_the_fit_ends_where_scipy_s_least_squares_does():
    """With a belief of full rank, whose inverse scipy needs; cost and pose, evidence and covariance by its Jacobian."""
    rng = np.random.default_rng(3)
    shape = rng.standard_normal((22, 22)) + 5.0 * np.eye(22)
    C = np.diag([0.03] * 3 + [0.1] * 3 + [3e-4] * 16) @ shape @ shape.T @ np.diag([0.03] * 3 + [0.1] * 3 + [3e-4] * 16)
    lines = sight(3e-4 * rng.standard_normal(16))
    ab, whiten = image_of(lines.rays, lines.weights)
    settled, H, nu, y, cost, evidence, after, *first = fitted(R_0, P_0, LEDS, C, ab, whiten, R_0, P_0)
    L_inverse = np.linalg.inv(np.linalg.cholesky(C))
    theirs = least_squares(residuals, np.zeros(22), args=(ab, whiten, L_inverse), xtol=1e-15, ftol=1e-15, gtol=1e-12)
    assert settled == 1
    sigma = np.sqrt(np.diag(C))
    np.testing.assert_allclose(y / sigma, theirs.x / sigma, atol=1e-4)
    assert cost == pytest.approx(2.0 * theirs.cost, rel=1e-6)
    # what scipy differentiates is the residual, this is its negative
    np.testing.assert_allclose(H, -theirs.jac[:16], atol=1e-3 * np.abs(H).max())
    covariance = np.linalg.inv(theirs.jac.T @ theirs.jac)
    np.testing.assert_allclose(after, covariance[:6, :6], atol=1e-3 * np.abs(covariance[:6, :6]).max())
    log_det = np.linalg.slogdet(H @ C @ H.T + np.eye(16))[1]
    assert evidence == pytest.approx(-0.5 * (cost + log_det), abs=1e-9 * abs(log_det))
    r = residuals(y, ab, whiten, L_inverse)[:16]
    np.testing.assert_allclose(nu, r + H @ y, atol=1e-9 * np.abs(nu).max())
    # the first step is the textbook's of a linear problem, from residuals at the belief
    H, nu, y, cost, evidence, after = first
    np.testing.assert_allclose(nu, residuals(np.zeros(22), ab, whiten, L_inverse)[:16], rtol=1e-9)
    S = H @ C @ H.T + np.eye(16)
    np.testing.assert_allclose(y / sigma, C @ H.T @ np.linalg.solve(S, nu) / sigma, atol=1e-9)
    assert cost == pytest.approx(nu @ np.linalg.solve(S, nu), rel=1e-9)
    likelihood = multivariate_normal.logpdf(nu, cov=S) + 8.0 * np.log(2.0 * np.pi)
    assert evidence == pytest.approx(likelihood, rel=1e-9)
    np.testing.assert_allclose(after, (C - C @ H.T @ np.linalg.solve(S, H @ C))[:6, :6], atol=1e-9 * after.max())


def test_nearly_frontal_far_away_the_fit_ends_from_both_sides():
    """There full Gauss-Newton steps swing to and fro or creep: six of these 600 had no end within thirty."""
    rng, sigma_px = np.random.default_rng(5), 0.05
    sigma = np.repeat([0.03, 0.05, 5e-5], [3, 3, 16])
    for _ in range(300):
        R = matrix_from_yaw_pitch_roll(*np.radians([*rng.uniform(-3.0, 3.0, 2), rng.uniform(-180.0, 180.0)]))
        p, points = np.array([14.5, 0.5, -0.3]), LEDS.copy()
        points[:, 1:] += 5e-5 * rng.standard_normal((8, 2))
        pixels = CAMERA.pixels_from_points(points @ (exp(0.03 * rng.standard_normal(3)) @ R).T + p)
        lines = lines_of_sight_from_pixels(
            pixels + sigma_px * rng.standard_normal((8, 2)), LEDS, CAMERA, np.full(8, sigma_px)
        )
        ab, whiten = image_of(lines.rays, lines.weights)
        for turn in (0.0, 0.06):
            begin = exp(np.array([0.0, turn, -turn])) @ R
            settled, H, nu, y, *_ = fitted(R, p, LEDS, np.diag(sigma**2), ab, whiten, begin, p)
            assert settled == 1
            r = nu - H @ y
            np.testing.assert_allclose(sigma * (H.T @ r), y / sigma, atol=2e-3)  # where no step goes down


def test_a_start_behind_the_camera_is_refused():
    lines = sight(np.zeros(16))
    ab, whiten = image_of(lines.rays, lines.weights)
    assert fitted(R_0, P_0, LEDS, np.eye(22), ab, whiten, R_0, -P_0)[0] == -1


def believed_too_far(true_m):
    """A ring on the axis that is believed 6 m ahead, by 10 m: from there one step to where it is goes behind the lens.

    By the image's scale f/x, dx = 6 m - (6 m)^2 / x.
    """
    p, C = np.array([6.0, 0.0, 0.0]), np.diag(np.repeat([0.05, 10.0, 3e-4], [3, 3, 16]) ** 2)
    pixels = CAMERA.pixels_from_points(LEDS + [true_m, 0.0, 0.0])
    lines = lines_of_sight_from_pixels(pixels, LEDS, CAMERA, np.full(8, 0.3))
    return fitted(np.eye(3), p, LEDS, C, *image_of(lines.rays, lines.weights), np.eye(3), p)


def test_a_step_that_goes_behind_the_camera_is_shortened_until_it_does_not():
    settled, _, _, y, *_ = believed_too_far(0.6)
    assert settled == 1
    np.testing.assert_allclose(y[3:6], [-5.4, 0.0, 0.0], atol=0.01)


def test_a_fit_without_any_step_that_stays_ahead_of_the_camera_has_not_ended():
    assert believed_too_far(0.02)[0] == 0


def test_distance_is_in_sigmas_of_the_pose_alone():
    rng = np.random.default_rng(4)
    shape = rng.standard_normal((6, 6))
    C, y, other = shape @ shape.T, rng.standard_normal(22), rng.standard_normal(22)
    step = (y - other)[:6]
    assert distance2(y, other, C) == pytest.approx(step @ np.linalg.solve(C, step), rel=1e-9)
