"""Position under a known attitude: exact, honest about the attitude's error, and what it refuses."""

from itertools import product

import numpy as np
import pytest

from dockair.calibration import Camera, LedRing
from dockair.errors import DockairError
from dockair.nav.pose.estimate import PoseOptions, PoseStatus, solve_pose
from dockair.nav.pose.position import solve_position
from dockair.nav.pose.prior import AttitudePrior
from dockair.rotations import Array, exp, log, matrix_from_yaw_pitch_roll

RING, CAMERA = LedRing().positions_D, Camera()
R, P_CD = matrix_from_yaw_pitch_roll(0.2, -0.25, 0.1), np.array([8.0, 0.4, -0.3])
PIXELS = CAMERA.pixels_from_points(RING @ R.T + P_CD)


@pytest.mark.parametrize("leds", [[0, 1, 2, 3, 4, 5, 6, 7], [1, 6], [0, 4]])
def test_position_is_exact_with_the_right_attitude_even_from_two_leds(leds):
    found = solve_position(PIXELS[leds], RING[leds], CAMERA, R, attitude_covariance=np.zeros((3, 3)))
    assert found.status is PoseStatus.CONVERGED
    np.testing.assert_allclose(found.p_CD, P_CD, atol=1e-8)
    np.testing.assert_array_equal(found.R_CD, R)


def test_one_led_is_too_few():
    found = solve_position(PIXELS[:1], RING[:1], CAMERA, R, attitude_covariance=np.zeros((3, 3)))
    assert found.status is PoseStatus.TOO_FEW_LEDS and np.isnan(found.covariance).all()


def test_first_order_covariance_is_how_the_position_answers_to_the_attitude():
    """Small P: K by solving again with the attitude turned a little, and cov(delta, phi) = -K P."""
    P = np.diag([3e-8, 1e-8, 2e-8])
    found = solve_position(PIXELS, RING, CAMERA, R, attitude_covariance=P)
    free = solve_position(PIXELS, RING, CAMERA, R, attitude_covariance=np.zeros((3, 3)))
    step, answer = 1e-4, np.empty((3, 3))
    for k, e in enumerate(np.eye(3)):
        ends = [
            solve_position(PIXELS, RING, CAMERA, exp(s * step * e) @ R, attitude_covariance=np.zeros((3, 3))).p_CD
            for s in (1.0, -1.0)
        ]
        answer[:, k] = (ends[0] - ends[1]) / (2.0 * step)
    np.testing.assert_allclose(found.covariance[3:, :3], answer @ P, rtol=1e-3, atol=1e-13)
    expected = free.covariance[3:, 3:] + answer @ P @ answer.T
    np.testing.assert_allclose(found.covariance[3:, 3:], expected, rtol=1e-3, atol=1e-12)
    np.testing.assert_array_equal(found.covariance[:3, :3], P)
    np.testing.assert_allclose(found.covariance[:3, 3:], found.covariance[3:, :3].T, rtol=1e-9)


def test_mean_and_covariance_are_those_over_all_attitudes_that_may_be():
    """P of three sizes, its axes askew, truths exp(phi) R without noise: Gauss-Hermite sums, exact to fifth order.

    The second order is 20 mm of the mean and a third of the variance; what is left of higher orders, a fiftieth.
    """
    root = exp(np.array([0.5, -0.4, 0.8])) @ np.diag(np.deg2rad([4.0, 2.0, 1.0]))
    P, (nodes, weights) = root @ root.T, np.polynomial.hermite_e.hermegauss(5)
    mean, square, covariance = np.zeros(3), np.zeros((3, 3)), np.zeros((3, 3))
    noise = solve_position(PIXELS, RING, CAMERA, R, attitude_covariance=np.zeros((3, 3))).covariance[3:, 3:]
    for draw in product(range(5), repeat=3):
        pixels = CAMERA.pixels_from_points(RING @ (exp(root @ nodes[list(draw)]) @ R).T + P_CD)
        found, weight = solve_position(pixels, RING, CAMERA, R, attitude_covariance=P), weights[list(draw)].prod()
        e, weight = P_CD - found.p_CD, weight / weights.sum() ** 3
        mean, square = mean + weight * e, square + weight * np.outer(e, e)
        covariance += weight * (found.covariance[3:, 3:] - noise)
    np.testing.assert_allclose(mean, 0.0, atol=5e-4)
    np.testing.assert_allclose(covariance, square, rtol=0.03)


def test_an_attitude_that_errs_about_one_axis_alone_has_a_mean_and_a_covariance():
    """Truths a sigma of 1 degree to both sides, without noise: a twentieth is left of the second order's 1.2 mm.

    Of rank one, P has eigenvalues that rounding makes negative.
    """
    negative = 0
    for axis in np.random.default_rng(4).normal(size=(20, 3)):
        axis *= np.deg2rad(1.0) / np.linalg.norm(axis)
        P, errors = np.outer(axis, axis), []
        negative += np.linalg.eigvalsh(P)[0] < 0.0
        for way in (1.0, -1.0):
            pixels = CAMERA.pixels_from_points(RING @ (exp(way * axis) @ R).T + P_CD)
            found = solve_position(pixels, RING, CAMERA, R, attitude_covariance=P)
            assert np.isfinite(found.covariance).all()
            errors.append(P_CD - found.p_CD)
        np.testing.assert_allclose(np.mean(errors, axis=0), 0.0, atol=6e-5)
    assert negative > 0


def test_hubers_loss_holds_a_wrong_led_and_the_position_is_the_minimum_of_its_cost():
    """The cost written anew in pixels: r^2 up to k, 2 k r - k^2 beyond."""
    pixels, sigma, k = PIXELS.copy(), 0.1, 2.0
    pixels[3] += [6.0, -8.0]
    options = [PoseOptions(residuals="pixels", huber_sigma=huber) for huber in (np.inf, k)]
    plain, robust = (
        solve_position(pixels, RING, CAMERA, R, attitude_covariance=np.zeros((3, 3)), sigma_px=sigma, options=o)
        for o in options
    )

    def cost(p: Array) -> float:
        r = np.linalg.norm(CAMERA.pixels_from_points(RING @ R.T + p) - pixels, axis=1) / sigma
        return float(np.where(r <= k, r**2, 2.0 * k * r - k**2).sum())

    assert robust.cost == pytest.approx(cost(robust.p_CD)) and robust.chi2 > robust.cost + 1000.0
    for step in 0.1 * np.diag(np.sqrt(np.diag(robust.covariance)[3:])):
        sides = [cost(robust.p_CD + sign * step) for sign in (1.0, -1.0)]
        assert min(sides) > robust.cost and abs(sides[0] - sides[1]) < 0.01 * (sum(sides) - 2.0 * robust.cost)
    assert np.linalg.norm(robust.p_CD - P_CD) < 0.1 * np.linalg.norm(plain.p_CD - P_CD)


def test_the_sources_weight_is_taken_when_it_is_asked_for():
    found = solve_position(
        PIXELS, RING, CAMERA, R, attitude_covariance=np.zeros((3, 3)), options=PoseOptions(weight="isotropic")
    )
    assert found.measurement is not None
    np.testing.assert_allclose(found.measurement.weights, [(CAMERA.focal_length_px / 0.1) ** 2 * np.eye(3)] * 8)


@pytest.mark.parametrize(("tilt_deg", "sigma_deg"), [(0.0, 3.0), (0.0, 0.5), (15.0, 1.0)])
def test_range_is_free_of_bias_and_its_variance_right(tilt_deg, sigma_deg):
    """20 m, 0.1 px, 1500 frames, truth scattered about the belief: mean and NEES within 4 standard errors.

    To first order alone the frontal ring of 3 degrees would be 27 mm too far, with a NEES of 5.
    """
    rng, believed = np.random.default_rng(61), matrix_from_yaw_pitch_roll(0.0, np.deg2rad(tilt_deg), 0.0)
    sigma, p, errors, nees = np.deg2rad(sigma_deg), np.array([20.0, 0.0, 0.0]), [], []
    for _ in range(1500):
        true = exp(sigma * rng.standard_normal(3)) @ believed
        pixels = CAMERA.pixels_from_points(RING @ true.T + p) + 0.1 * rng.standard_normal((8, 2))
        found = solve_position(pixels, RING, CAMERA, believed, attitude_covariance=sigma**2 * np.eye(3))
        errors.append(found.p_CD[0] - 20.0)
        nees.append(errors[-1] ** 2 / found.covariance[3, 3])
    assert abs(np.mean(errors)) < 4.0 * np.std(errors) / np.sqrt(1500)
    assert abs(np.mean(nees) - 1.0) < 4.0 * np.std(nees) / np.sqrt(1500)


def test_an_exact_attitude_prior_comes_to_the_same():
    rng = np.random.default_rng(62)
    pixels = PIXELS + 0.1 * rng.standard_normal((8, 2))
    held = solve_position(pixels, RING, CAMERA, R, attitude_covariance=np.zeros((3, 3)))
    prior = AttitudePrior(R_CD=R, information=1e14 * np.eye(3))
    solved = solve_pose(pixels, RING, CAMERA, prior=prior)
    np.testing.assert_allclose(solved.p_CD, held.p_CD, atol=1e-7)
    np.testing.assert_allclose(solved.covariance[3:, 3:], held.covariance[3:, 3:], rtol=1e-3)
    np.testing.assert_allclose(log(solved.R_CD @ R.T), 0.0, atol=1e-6)


@pytest.mark.parametrize(
    ("change", "where"),
    [
        ({"R_CD": np.eye(2)}, "R_CD"),
        ({"R_CD": np.full((3, 3), np.nan)}, "R_CD"),
        ({"attitude_covariance": np.eye(6)}, "attitude_covariance"),
        ({"sigma_px": -1.0}, "sigma_px"),
        ({"pixels": np.zeros((8, 3))}, "pixels"),
    ],
)
def test_wrong_arguments_are_refused_by_name(change, where):
    arguments = {"pixels": PIXELS, "points_D": RING, "camera": CAMERA, "R_CD": R, "attitude_covariance": np.eye(3)}
    with pytest.raises(DockairError) as caught:
        solve_position(**{**arguments, **change})
    assert caught.value.where == where
