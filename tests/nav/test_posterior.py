"""Prior and frame brought together: linear closed form, the likelihood ratio, both floors."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import chi2

from dockair.calibration import Camera, LedRing
from dockair.nav.pose.descent import PosePrior
from dockair.nav.pose.difference import pose_difference
from dockair.nav.pose.estimate import PoseEstimate, solve_pose
from dockair.nav.pose.levenberg_marquardt import levenberg_marquardt
from dockair.nav.pose.planar import mirrored
from dockair.nav.pose.posterior import posteriors
from dockair.rotations import Array, exp, log, matrix_from_yaw_pitch_roll

RING, CAMERA = LedRing().positions_D, Camera()


def frame(R: Array, p: Array, rng: np.random.Generator, sigma_px: float) -> PoseEstimate:
    pixels = CAMERA.pixels_from_points(RING @ R.T + p) + sigma_px * rng.normal(size=(8, 2))
    return solve_pose(pixels, RING, CAMERA, sigma_px=sigma_px, initial=(R, p))


def prior_about(R: Array, p: Array, rng: np.random.Generator, sigma_rad: float, sigma_m: float) -> PosePrior:
    covariance = np.diag([sigma_rad**2] * 3 + [sigma_m**2] * 3)
    return PosePrior(
        R_CD=exp(sigma_rad * rng.normal(size=3)) @ R, p_CD=p + sigma_m * rng.normal(size=3), covariance=covariance
    )


@pytest.mark.parametrize("angle", [0.0, 1e-9, 9e-4, 1.1e-3, 1.0, 2.6, 2.8, np.pi - 1e-6])
def test_pose_difference_is_log_of_the_turn_and_the_shift(angle):
    rng = np.random.default_rng(1)
    for _ in range(20):
        axis = rng.normal(size=3)
        phi, R = angle * axis / np.linalg.norm(axis), exp(rng.normal(size=3))
        p, shift = rng.normal(size=(2, 3))
        difference = pose_difference(exp(phi) @ R, p + shift, R, p)
        np.testing.assert_allclose(difference, [*phi, *shift], rtol=1e-8, atol=1e-14)


def test_where_the_problem_is_linear_it_is_the_kalman_update():
    """5 m, 20 degrees of tilt: mean, covariance, likelihood ratio and evidence of the two Gaussians' product."""
    rng = np.random.default_rng(2)
    R, p = matrix_from_yaw_pitch_roll(0.0, 0.35, 0.1), np.array([5.0, 0.2, -0.1])
    for _ in range(20):
        pose, prior = frame(R, p, rng, 0.05), prior_about(R, p, rng, 0.001, 0.002)
        found = max(posteriors(prior, pose), key=lambda f: f.log_evidence)
        innovation = pose_difference(pose.R_CD, pose.p_CD, prior.R_CD, prior.p_CD)
        S = prior.covariance + pose.covariance
        step = prior.covariance @ np.linalg.solve(S, innovation)
        P = prior.covariance - prior.covariance @ np.linalg.solve(S, prior.covariance)
        sigma = np.sqrt(np.diag(P))
        ours = pose_difference(found.R_CD, found.p_CD, prior.R_CD, prior.p_CD)
        np.testing.assert_array_less(np.abs(ours - step), 0.05 * sigma)
        np.testing.assert_allclose(found.covariance / np.outer(sigma, sigma), P / np.outer(sigma, sigma), atol=0.03)
        distance = innovation @ np.linalg.solve(S, innovation)
        assert found.gate_chi2 == pytest.approx(distance, abs=0.1)
        volumes = np.linalg.slogdet(P)[1] - np.linalg.slogdet(prior.covariance)[1]
        assert found.log_evidence == pytest.approx(0.5 * (volumes - distance - pose.chi2), abs=0.1)


def test_likelihood_ratio_is_chi_square_with_six_degrees_of_freedom():
    """300 frames against priors that are right; the mean is outside by luck once in 10 000."""
    rng, values = np.random.default_rng(3), []
    for _ in range(300):
        R, p = matrix_from_yaw_pitch_roll(*rng.uniform(-0.3, 0.3, 3)), np.array([rng.uniform(4.0, 8.0), 0.2, 0.1])
        pose, prior = frame(R, p, rng, 0.1), prior_about(R, p, rng, 0.02, 0.05)
        values.append(min(f.gate_chi2 for f in posteriors(prior, pose)))
    low, high = chi2.ppf([0.5e-4, 1.0 - 0.5e-4], 6 * 300) / 300
    assert low < np.mean(values) < high


def test_prior_between_the_two_floors_keeps_both_and_weighs_them_by_what_the_frame_says():
    """20 m, 6 degrees: a prior that knows nothing of the tilt leaves the difference of the two costs."""
    R, p = matrix_from_yaw_pitch_roll(0.0, np.deg2rad(6.0), 0.0), np.array([20.0, 0.0, 0.0])
    pose = solve_pose(CAMERA.pixels_from_points(RING @ R.T + p), RING, CAMERA, sigma_px=0.05)
    assert pose.alternative is not None
    prior = PosePrior(R_CD=np.eye(3), p_CD=p, covariance=np.diag([1.0, 1.0, 1.0, 1.0, 1.0, 1.0]))
    floors = sorted(posteriors(prior, pose), key=lambda f: -f.log_evidence)
    assert len(floors) == 2
    assert np.linalg.norm(log(floors[0].R_CD @ R.T)) < 0.01
    assert np.linalg.norm(log(floors[1].R_CD @ mirrored(R, p, RING)[0].T)) < 0.03
    expected = 0.5 * (pose.alternative.chi2 - pose.chi2)
    volumes = 0.5 * np.diff([np.linalg.slogdet(f.covariance)[1] for f in floors])[0]
    assert floors[0].log_evidence - floors[1].log_evidence == pytest.approx(expected - volumes, abs=0.05)


def test_side_that_the_prior_dislikes_stays_possible_when_its_floor_is_filled_up():
    """20 m, 0.1 px, prior 3 sigma on the other side: no descent ends on the true side, yet it is among the results."""
    R, p = matrix_from_yaw_pitch_roll(0.0, np.deg2rad(5.0), 0.0), np.array([20.0, 0.0, 0.0])
    pose = solve_pose(CAMERA.pixels_from_points(RING @ R.T + p), RING, CAMERA, sigma_px=0.1)
    wrong = mirrored(R, p, RING)[0]
    prior = PosePrior(R_CD=wrong, p_CD=p, covariance=np.diag([np.deg2rad(3.3) ** 2] * 3 + [0.04] * 3))
    assert pose.measurement is not None
    end = levenberg_marquardt(pose.measurement, R, p, prior=prior)
    assert np.rad2deg(np.linalg.norm(log(end.R_CD @ R.T))) > 6.0
    floors = sorted(posteriors(prior, pose), key=lambda f: -f.log_evidence)
    distances = [np.rad2deg(np.linalg.norm(log(f.R_CD @ R.T))) for f in floors]
    assert distances[0] > 6.0
    assert min(distances) < 2.5


def test_an_average_within_three_sigma_of_a_floor_is_no_hypothesis_beside_it():
    """20 m, frontal, 1 degree of prior: floor and average are apart by what no Gaussian describes, and are one."""
    R, p = np.eye(3), np.array([20.0, 0.0, 0.0])
    prior = PosePrior(R_CD=R, p_CD=p, covariance=np.diag([np.deg2rad(1.0) ** 2] * 3 + [1.0] * 3))
    for seed in range(5):
        assert len(posteriors(prior, frame(R, p, np.random.default_rng(seed), 0.1))) == 1


def test_pose_without_lines_of_sight_is_averaged_as_a_gaussian():
    rng = np.random.default_rng(4)
    R, p = matrix_from_yaw_pitch_roll(0.0, 0.35, 0.1), np.array([5.0, 0.2, -0.1])
    pose, prior = replace(frame(R, p, rng, 0.1), measurement=None, alternative=None), prior_about(R, p, rng, 0.01, 0.02)
    (found,) = posteriors(prior, pose)
    S = prior.covariance + pose.covariance
    P = prior.covariance - prior.covariance @ np.linalg.solve(S, prior.covariance)
    np.testing.assert_allclose(found.covariance, P, rtol=1e-6, atol=1e-6 * np.abs(P).max())
    innovation = pose_difference(pose.R_CD, pose.p_CD, prior.R_CD, prior.p_CD)
    assert found.gate_chi2 == pytest.approx(innovation @ np.linalg.solve(S, innovation))
    volumes = np.linalg.slogdet(P)[1] - np.linalg.slogdet(prior.covariance)[1]
    expected = 0.5 * (volumes - innovation @ np.linalg.solve(S, innovation) - pose.chi2)  # Eq. (1): J has both costs
    assert found.log_evidence == pytest.approx(expected)
    step = prior.covariance @ np.linalg.solve(S, innovation)
    np.testing.assert_allclose(pose_difference(found.R_CD, found.p_CD, prior.R_CD, prior.p_CD), step, atol=1e-12)


@pytest.mark.parametrize("with_lines_of_sight", [True, False])
def test_likelihood_ratio_is_against_the_better_minimum_whichever_comes_first(with_lines_of_sight):
    """A start on the wrong side puts the worse minimum first; of the two ratios that changes nothing."""
    R, p = matrix_from_yaw_pitch_roll(0.0, np.deg2rad(8.0), 0.0), np.array([20.0, 0.0, 0.0])
    pixels = CAMERA.pixels_from_points(RING @ R.T + p) + 0.05 * np.random.default_rng(5).normal(size=(8, 2))
    prior, gates = PosePrior(R_CD=R, p_CD=p, covariance=np.diag([0.2**2] * 3 + [0.3**2] * 3)), []
    for start in (R, p), mirrored(R, p, RING):
        pose = solve_pose(pixels, RING, CAMERA, sigma_px=0.05, initial=start)
        assert pose.alternative is not None and abs(pose.alternative.chi2 - pose.chi2) > 5.0
        known = pose if with_lines_of_sight else replace(pose, measurement=None)
        gates.append(sorted(found.gate_chi2 for found in posteriors(prior, known)))
    assert len(gates[0]) == 2
    assert gates[0] == pytest.approx(gates[1], abs=0.01)
