"""Mean and covariance over both minima."""

from dataclasses import replace

import numpy as np
import pytest

from dockair.calibration import Camera, LedRing
from dockair.nav.pose.difference import pose_difference
from dockair.nav.pose.estimate import solve_pose
from dockair.nav.pose.expectation import expectation
from dockair.nav.pose.position import solve_position
from dockair.rotations import exp, matrix_from_yaw_pitch_roll

RING, CAMERA = LedRing().positions_D, Camera()


def frame(range_m: float, tilt_deg: float, rng: np.random.Generator | None = None, sigma_px: float = 0.1):
    R, p = matrix_from_yaw_pitch_roll(0.0, np.deg2rad(tilt_deg), 0.0), np.array([range_m, 0.0, 0.0])
    pixels = CAMERA.pixels_from_points(RING @ R.T + p)
    if rng is not None:
        pixels = pixels + sigma_px * rng.standard_normal((8, 2))
    return R, p, solve_pose(pixels, RING, CAMERA, sigma_px=sigma_px)


def test_without_an_alternative_it_is_the_pose():
    _, _, pose = frame(4.0, 10.0)
    assert pose.alternative is None
    mean = expectation(pose)
    assert mean.R_CD is pose.R_CD and mean.p_CD is pose.p_CD and mean.covariance is pose.covariance


def test_where_one_minimum_is_far_better_it_is_that_one():
    R, p, pose = frame(10.0, 20.0)
    assert pose.alternative is not None and not pose.ambiguous
    mean = expectation(pose)
    np.testing.assert_allclose(pose_difference(mean.R_CD, mean.p_CD, R, p), 0.0, atol=1e-9)
    np.testing.assert_allclose(mean.covariance, pose.covariance, rtol=1e-9)


def test_it_is_that_one_too_where_noise_is_far_larger_than_it_is_said_to_be():
    """Costs of thousands: the weights exp(-J/2) are below the least number that there is."""
    _, _, pose = frame(20.0, 10.0, np.random.default_rng(3))
    pixels = CAMERA.pixels_from_points(pose.measurement.rays)
    pose = solve_pose(pixels, RING, CAMERA, sigma_px=1e-3)
    assert pose.alternative is not None and pose.cost > 3000.0
    mean = expectation(pose)
    np.testing.assert_allclose(pose_difference(mean.R_CD, mean.p_CD, pose.R_CD, pose.p_CD), 0.0, atol=1e-9)


def test_two_equal_minima_give_the_middle_and_their_distance_as_its_uncertainty():
    """20 m, 10 degrees, costs set alike: tilt 0 with a sigma of 10 degrees; the pass costs hundreds, has no say."""
    _, _, pose = frame(20.0, 10.0)
    assert pose.alternative is not None
    pose = replace(pose, alternative=replace(pose.alternative, cost=pose.cost))
    mean = expectation(pose)
    assert mean.R_CD[0, 0] > np.cos(np.deg2rad(0.2))
    tilt_deg = np.rad2deg(np.sqrt(mean.covariance[1, 1]))
    assert tilt_deg == pytest.approx(10.0, abs=0.3)


def test_frontal_mean_and_covariance_are_those_of_three_gaussians():
    """25 m, frontal, frames in which the pass has over a fifth of the weight: Eqs (1) and (2) by hand."""
    rng, found = np.random.default_rng(64), 0
    for _ in range(40):
        _, _, pose = frame(25.0, 0.0, rng)
        other = pose.alternative
        if other is None:
            continue
        d = pose_difference(other.R_CD, other.p_CD, pose.R_CD, pose.p_CD)
        assert pose.measurement is not None
        middle = solve_position(
            CAMERA.pixels_from_points(pose.measurement.rays), RING, CAMERA, exp(0.5 * d[:3]) @ pose.R_CD,
            attitude_covariance=np.zeros((3, 3)),
        )  # fmt: skip
        costs, covariances = [pose.cost, other.cost, middle.chi2], [pose.covariance, other.covariance]
        covariances.append(0.5 * (covariances[0] + covariances[1]))
        w = np.exp(-0.5 * np.array(costs)) / np.exp(-0.5 * np.array(costs)).sum()
        if w[2] < 0.2:
            continue
        found += 1
        ds = [np.zeros(6), d, pose_difference(middle.R_CD, middle.p_CD, pose.R_CD, pose.p_CD)]
        mean = sum(wk * dk for wk, dk in zip(w, ds, strict=True))
        P = sum(wk * (Pk + np.outer(dk - mean, dk - mean)) for wk, Pk, dk in zip(w, covariances, ds, strict=True))
        ours = expectation(pose)
        np.testing.assert_allclose(pose_difference(ours.R_CD, ours.p_CD, pose.R_CD, pose.p_CD), mean, atol=1e-6)
        np.testing.assert_allclose(ours.covariance, P, rtol=1e-4, atol=1e-9)
    assert found > 5


@pytest.mark.parametrize(("range_m", "tilt_deg"), [(20.0, 5.0), (20.0, 10.0), (30.0, 20.0)])
def test_it_is_honest_and_nearer_than_the_more_likely_one_where_nobody_can_choose(range_m, tilt_deg):
    """400 frames: NEES of the most likely one over 30, of the mean 6 within 1.2, 5 standard errors; RMSE less."""
    rng, own, mean, distances = np.random.default_rng(63), [], [], []
    for _ in range(400):
        R, p, pose = frame(range_m, tilt_deg, rng)
        best = expectation(pose)
        own.append(pose_difference(R, p, pose.R_CD, pose.p_CD))
        mean.append(pose_difference(R, p, best.R_CD, best.p_CD))
        distances.append([e[-1] @ np.linalg.solve(x.covariance, e[-1]) for e, x in ((own, pose), (mean, best))])
    nees_own, nees_mean = np.mean(distances, axis=0)
    assert nees_own > 30.0 and abs(nees_mean - 6.0) < 1.2
    assert np.linalg.norm(np.array(mean)[:, :3]) < 0.95 * np.linalg.norm(np.array(own)[:, :3])
