"""What is known beside the frame: whole, in part, and what is refused."""

import numpy as np
import pytest

from dockair.calibration import Camera, LedRing
from dockair.errors import DockairError
from dockair.nav.pose import descent_kernels
from dockair.nav.pose.estimate import PoseStatus, solve_pose
from dockair.nav.pose.levenberg_marquardt import levenberg_marquardt
from dockair.nav.pose.planar import mirrored
from dockair.nav.pose.prior import AttitudePrior, DirectionPrior, PosePrior
from dockair.rotations import Array, exp, log, matrix_from_yaw_pitch_roll

RING, CAMERA = LedRing().positions_D, Camera()
X = np.array([1.0, 0.0, 0.0])


def tilted(tilt_deg: float, range_m: float) -> tuple[Array, Array]:
    return matrix_from_yaw_pitch_roll(0.0, np.deg2rad(tilt_deg), 0.3), np.array([range_m, 0.0, 0.0])


def priors(R: Array, p: Array, sigma_rad: float) -> list[PosePrior | AttitudePrior | DirectionPrior]:
    covariance = np.diag([sigma_rad**2] * 3 + [1e4] * 3)
    return [
        PosePrior(R_CD=R, p_CD=p, covariance=covariance),
        AttitudePrior(R_CD=R, information=np.eye(3) / sigma_rad**2),
        AttitudePrior.from_sigmas(R, np.array([np.inf, sigma_rad, sigma_rad])),
        DirectionPrior(axis_C=R[:, 0], axis_D=X, sigma_rad=sigma_rad),
    ]


@pytest.mark.parametrize("kind", range(4))
def test_prior_chooses_the_side_that_the_frame_cannot(kind):
    """20 m, 6 degrees: noise set so that the frame alone prefers the mirror image; 1.5 degrees of prior end that."""
    (R, p), found = tilted(6.0, 20.0), 0
    rng = np.random.default_rng(71)
    for _ in range(60):
        pixels = CAMERA.pixels_from_points(RING @ R.T + p) + 0.1 * rng.standard_normal((8, 2))
        if np.linalg.norm(log(solve_pose(pixels, RING, CAMERA).R_CD @ R.T)) < np.deg2rad(6.0):
            continue
        found += 1
        pose = solve_pose(pixels, RING, CAMERA, prior=priors(R, p, np.deg2rad(1.5))[kind])
        assert pose.status is PoseStatus.CONVERGED
        assert np.linalg.norm(log(pose.R_CD @ R.T)) < np.deg2rad(6.0)
    assert found > 10


@pytest.mark.parametrize("kind", range(4))
def test_what_prior_and_frame_cost_together_decides_which_minimum_comes_first(kind):
    """20 m, 12 degrees, pixels of the mirror image: it costs the frame nothing and a prior of 6 degrees 16."""
    R, p = tilted(12.0, 20.0)
    Q, s = mirrored(R, p, RING)
    pixels = CAMERA.pixels_from_points(RING @ Q.T + s)
    pose = solve_pose(pixels, RING, CAMERA, prior=priors(R, p, np.deg2rad(6.0))[kind])
    assert pose.alternative is not None
    assert np.linalg.norm(log(pose.R_CD @ R.T)) < np.deg2rad(1.0)
    assert pose.cost + 5.0 < pose.alternative.cost and pose.chi2 > pose.alternative.chi2 + 5.0
    assert pose.ambiguous


@pytest.mark.parametrize("kind", range(1, 4))
def test_a_start_on_the_wrong_side_does_not_decide_against_the_prior(kind):
    R, p = tilted(8.0, 15.0)
    pixels = CAMERA.pixels_from_points(RING @ R.T + p)
    prior = priors(R, p, np.deg2rad(3.0))[kind]
    pose = solve_pose(pixels, RING, CAMERA, initial=mirrored(R, p, RING), prior=prior)
    np.testing.assert_allclose(log(pose.R_CD @ R.T), 0.0, atol=1e-4)
    assert pose.cost < 1e-3
    assert pose.alternative is not None and pose.alternative.cost > pose.cost + 5.0


@pytest.mark.parametrize("kind", range(4))
def test_a_prior_has_its_say_also_from_a_start_with_the_range_far_off(kind):
    """Ten times as far the first descent does not arrive; the second is as good as one from the truth."""
    (R, _), p = tilted(12.0, 8.0), np.array([8.0, 1.0, -0.5])
    pixels = CAMERA.pixels_from_points(RING @ R.T + p)
    prior = priors(exp(np.deg2rad([0.5, 1.0, -1.0])) @ R, p, np.deg2rad(1.0))[kind]
    near, far = (solve_pose(pixels, RING, CAMERA, initial=(R, factor * p), prior=prior) for factor in (1.0, 10.0))
    assert near.measurement is not None
    first = levenberg_marquardt(near.measurement, R, 10.0 * p, prior=prior)
    assert first.outcome == descent_kernels.NOT_CONVERGED
    assert near.status is far.status is PoseStatus.CONVERGED
    assert far.cost == pytest.approx(near.cost, rel=1e-3) and near.cost > 1.0
    np.testing.assert_allclose(far.covariance, near.covariance, rtol=1e-3, atol=1e-3 * near.covariance[3, 3])


@pytest.mark.parametrize("kind", range(4))
def test_three_leds_are_enough_with_a_prior(kind):
    R, p = tilted(15.0, 6.0)
    pixels = CAMERA.pixels_from_points(RING @ R.T + p)
    pixels[[1, 3, 4, 6, 7]] = np.nan
    prior = priors(exp(np.deg2rad([0.3, -0.4, 0.2])) @ R, p + 0.05, np.deg2rad(0.5))[kind]
    pose = solve_pose(pixels, RING, CAMERA, prior=prior)
    assert pose.status is PoseStatus.CONVERGED
    sigma = np.sqrt(np.diag(pose.covariance))
    np.testing.assert_array_less(np.abs(log(R @ pose.R_CD.T)), 4.0 * sigma[:3])
    np.testing.assert_array_less(np.abs(p - pose.p_CD), 4.0 * sigma[3:])


def test_sigmas_about_the_drogue_s_axes_are_information_in_the_camera_s():
    """1/sigma^2 about each, none where nothing is known."""
    R, sigma = matrix_from_yaw_pitch_roll(0.3, -0.2, 0.5), np.array([np.inf, 0.02, 0.05])
    information = AttitudePrior.from_sigmas(R, sigma).information
    for k in range(3):
        np.testing.assert_allclose(information @ R[:, k], R[:, k] / sigma[k] ** 2, atol=1e-9)


def test_unknown_roll_leaves_the_roll_to_the_frame():
    """A prior that is 40 degrees of roll off and knows nothing of it; the hose's direction never speaks of it."""
    R, p = tilted(12.0, 8.0)
    pixels = CAMERA.pixels_from_points(RING @ R.T + p)
    rolled = exp(np.deg2rad(40.0) * R[:, 0]) @ R
    for prior in priors(rolled, p, np.deg2rad(1.0))[2:]:
        pose = solve_pose(pixels, RING, CAMERA, prior=prior)
        np.testing.assert_allclose(log(pose.R_CD @ R.T), 0.0, atol=3e-3)


def test_direction_adds_its_information_across_and_none_about_it():
    R, p = tilted(12.0, 8.0)
    pixels, sigma = CAMERA.pixels_from_points(RING @ R.T + p), np.deg2rad(0.2)
    alone = np.linalg.inv(solve_pose(pixels, RING, CAMERA).covariance)
    both = np.linalg.inv(solve_pose(pixels, RING, CAMERA, prior=priors(R, p, sigma)[3]).covariance)
    expected = (np.eye(3) - np.outer(R[:, 0], R[:, 0])) / sigma**2
    np.testing.assert_allclose((both - alone)[:3, :3], expected, atol=1e-4 * both[:3, :3].max())
    np.testing.assert_allclose((both - alone)[3:, 3:], 0.0, atol=1e-5 * both[3:, 3:].max())


def test_a_covariance_that_is_turned_into_other_axes_is_symmetric_but_for_rounding():
    R = exp(np.array([0.3, -0.7, 1.1]))
    J = np.kron(np.eye(2), R)
    P = J @ np.diag([0.01] * 3 + [0.2] * 3) @ J.T
    assert (P != P.T).any()
    N = PosePrior(R_CD=R, p_CD=8.0 * X, covariance=P).terms[2]
    np.testing.assert_allclose(N @ P, np.eye(6), atol=1e-12)


@pytest.mark.parametrize(
    ("build", "where"),
    [
        (lambda: AttitudePrior(R_CD=np.eye(2), information=np.eye(3)), "prior.R_CD"),
        (lambda: AttitudePrior(R_CD=np.eye(3), information=-np.eye(3)), "prior.information"),
        (lambda: AttitudePrior(R_CD=np.eye(3), information=np.triu(np.ones((3, 3)))), "prior.information"),
        (lambda: AttitudePrior(R_CD=np.eye(3), information=np.full((3, 3), np.nan)), "prior.information"),
        (lambda: AttitudePrior.from_sigmas(np.eye(3), np.array([1.0, 0.0, 1.0])), "sigma_D_rad"),
        (lambda: DirectionPrior(axis_C=2.0 * X, axis_D=X, sigma_rad=0.1), "prior.axis_C"),
        (lambda: DirectionPrior(axis_C=X, axis_D=np.eye(3), sigma_rad=0.1), "prior.axis_D"),
        (lambda: DirectionPrior(axis_C=X, axis_D=X, sigma_rad=0.0), "prior.sigma_rad"),
        (lambda: DirectionPrior(axis_C=X, axis_D=X, sigma_rad=np.inf), "prior.sigma_rad"),
        (lambda: PosePrior(R_CD=np.eye(3), p_CD=8.0 * X, covariance=np.zeros((6, 6))).terms, "prior.covariance"),
        (lambda: PosePrior(R_CD=np.eye(3), p_CD=8.0 * X, covariance=-np.eye(6)).terms, "prior.covariance"),
        (
            lambda: PosePrior(R_CD=np.eye(3), p_CD=X, covariance=np.eye(6) + 0.1 * np.eye(6, k=1)).terms,
            "prior.covariance",
        ),
        (
            lambda: PosePrior(R_CD=np.eye(3), p_CD=X, covariance=1e-9 * (np.eye(6) + 0.1 * np.eye(6, k=1))).terms,
            "prior.covariance",
        ),
        (lambda: PosePrior(R_CD=np.eye(3), p_CD=X, covariance=np.full((6, 6), np.nan)).terms, "prior.covariance"),
        (lambda: PosePrior(R_CD=np.eye(3), p_CD=np.full(3, np.inf), covariance=np.eye(6)).terms, "prior.p_CD"),
        (lambda: PosePrior(R_CD=np.eye(3), p_CD=8.0 * X, covariance=np.eye(5)).terms, "prior"),
    ],
)
def test_wrong_arguments_are_refused_by_name(build, where):
    with pytest.raises(DockairError) as caught:
        build()
    assert caught.value.where == where
