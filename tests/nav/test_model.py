"""Lines of sight, their derivatives (also near 0 and near pi) and their weights."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from dockair.calibration import Camera, LedRing
from dockair.nav.pose import model
from dockair.nav.pose.descent import PosePrior, descend
from dockair.nav.pose.levenberg_marquardt import LEVENBERG_MARQUARDT
from dockair.nav.pose.measurement import isotropic_weights, lines_of_sight_from_pixels
from dockair.rotations import Array, exp, log, matrix_from_mrp, mrp_from_matrix

RING, CAMERA = LedRing().positions_D, Camera()
DISTORTED = replace(CAMERA, distortion=(-0.12, 0.06, 8e-4, -5e-4, -0.01))
ANGLES = (0.0, 1e-9, 1e-5, 0.5, 2.0, np.pi - 1e-5, np.pi, np.pi + 1e-5, 5.0)


def attitudes() -> list[Array]:
    """MRP of every angle of ANGLES about six axes; beyond pi they are longer than 1."""
    axes = np.vstack([np.eye(3), np.random.default_rng(5).normal(size=(3, 3))])
    return [axis / np.linalg.norm(axis) * np.tan(angle / 4.0) for axis in axes for angle in ANGLES]


def predicted(R_CD: Array, p_CD: Array) -> Array:
    s = RING @ R_CD.T + p_CD
    return s / np.linalg.norm(s, axis=1, keepdims=True)


@pytest.mark.parametrize("coordinates", [model.SOURCE, model.LOCAL])
def test_line_of_sight_is_the_unit_vector_to_the_led(coordinates):
    p_CD = np.array([7.0, 0.4, -0.3])
    for p in attitudes():
        h, _ = model.lines_of_sight(p, p_CD, RING, coordinates)
        np.testing.assert_allclose(h, predicted(matrix_from_mrp(p), p_CD), atol=1e-14)


def test_jacobian_of_the_source_matches_central_differences():
    """[Yoon 2018, eqs 56-57] in (p, o): as printed, without the square, (56) is off by up to 0.23."""
    p_CD, step = np.array([7.0, 0.4, -0.3]), 1e-6
    for p in attitudes():
        o = -matrix_from_mrp(p).T @ p_CD
        _, J = model.lines_of_sight(p, p_CD, RING, model.SOURCE)
        for k, e in enumerate(np.eye(6) * step):
            ends = []
            for sign in (1.0, -1.0):
                C = matrix_from_mrp(p + sign * e[:3])
                ends.append(predicted(C, -C @ (o + sign * e[3:])))
            np.testing.assert_allclose(J[:, :, k], (ends[0] - ends[1]) / (2.0 * step), atol=3e-9)


def test_local_jacobian_matches_central_differences():
    p_CD, step = np.array([7.0, 0.4, -0.3]), 1e-6
    for p in attitudes():
        R = matrix_from_mrp(p)
        _, J = model.lines_of_sight(p, p_CD, RING, model.LOCAL)
        for k, e in enumerate(np.eye(6) * step):
            ends = [predicted(exp(sign * e[:3]) @ R, p_CD + sign * e[3:]) for sign in (1.0, -1.0)]
            np.testing.assert_allclose(J[:, :, k], (ends[0] - ends[1]) / (2.0 * step), atol=3e-9)


@pytest.mark.parametrize("camera", [CAMERA, DISTORTED], ids=["pinhole", "distorted"])
def test_weight_is_the_inverse_of_what_pixel_noise_does_in_the_tangent_plane(camera):
    """W = T S^-1 T' with S the 2 x 2 covariance on two tangent vectors, by differences through the camera."""
    pixels = np.array([[30.0, 40.0], [1023.5, 543.5], [1900.0, 300.0], [700.0, 1000.0]])
    sigma, step = np.array([0.1, 0.05, 0.3, 0.2]), 1e-3
    sight = lines_of_sight_from_pixels(pixels, RING[:4], camera, sigma)
    for i, b in enumerate(sight.rays):
        ends = [camera.rays_from_pixels(pixels[i : i + 1] + s * step * np.eye(2)) for s in (1.0, -1.0)]
        db = (ends[0] - ends[1]).T / (2.0 * step)  # (3, 2)
        T = np.linalg.svd(b[None])[2][1:].T
        S = sigma[i] ** 2 * T.T @ db @ db.T @ T
        expected = T @ np.linalg.inv(S) @ T.T
        np.testing.assert_allclose(sight.weights[i], expected, rtol=1e-6, atol=1e-6 * np.abs(expected).max())
        assert np.linalg.norm(sight.weights[i] @ b) < 1e-9 * np.abs(expected).max()


def test_isotropic_weight_is_the_sources():
    np.testing.assert_array_equal(isotropic_weights(2, 0.5), np.array([4.0 * np.eye(3)] * 2))


@pytest.mark.parametrize("angle", ANGLES)
def test_attitude_goes_into_the_descent_and_out_unchanged(angle):
    """Through the compiled MRP, also where its quaternion's scalar part is zero: the start already is the minimum."""
    p_CD = np.array([7.0, 0.4, -0.3])
    for axis in np.eye(3):
        R = exp(angle * axis)
        sight = replace(
            lines_of_sight_from_pixels(CAMERA.pixels_from_points(RING + [7.0, 0, 0]), RING, CAMERA, np.full(8, 0.1)),
            rays=predicted(R, p_CD),
            weights=isotropic_weights(8, 1e-4),
        )
        end = descend(sight, R, p_CD, LEVENBERG_MARQUARDT)
        assert end.converged
        np.testing.assert_allclose(log(end.R_CD @ R.T), 0.0, atol=1e-12)
        np.testing.assert_allclose(end.p_CD, p_CD, atol=1e-12)


def test_prior_alone_is_found_with_its_own_covariance():
    """With next to no weight on the lines of sight the minimum is the prior, from 60 degrees and 2 m away."""
    rng = np.random.default_rng(2)
    root = rng.normal(size=(6, 6))
    prior = PosePrior(R_CD=exp(rng.normal(size=3)), p_CD=np.array([9.0, 0.5, 0.2]), covariance=1e-3 * root @ root.T)
    sight = lines_of_sight_from_pixels(CAMERA.pixels_from_points(RING + [9.0, 0, 0]), RING, CAMERA, np.full(8, 1e9))
    start = exp(np.array([0.6, -0.6, 0.6])) @ prior.R_CD
    end = descend(sight, start, prior.p_CD + [2.0, 0.0, 0.0], LEVENBERG_MARQUARDT, prior)
    assert end.converged
    np.testing.assert_allclose(log(end.R_CD @ prior.R_CD.T), 0.0, atol=1e-7)
    np.testing.assert_allclose(end.p_CD, prior.p_CD, atol=1e-7)
    np.testing.assert_allclose(end.covariance, prior.covariance, rtol=1e-6, atol=1e-10)


def test_minimum_with_a_prior_that_disagrees_is_one():
    """Prior 30 degrees away and as strong as the frame: the cost, written anew with scipy's MRP, is stationary."""
    R, p_CD = exp(np.array([0.1, 0.3, -0.2])), np.array([3.0, 0.2, 0.1])
    pixels = CAMERA.pixels_from_points(RING @ R.T + p_CD)
    sight = lines_of_sight_from_pixels(pixels, RING, CAMERA, np.full(8, 10.0))
    prior = PosePrior(
        R_CD=exp(np.array([0.5, -0.2, 0.3])) @ R,
        p_CD=p_CD + [0.02, -0.01, 0.01],
        covariance=np.diag([1e-3, 8e-3, 2e-4, 1e-3, 1e-3, 1e-3]),
    )
    end = descend(sight, R, p_CD, LEVENBERG_MARQUARDT, prior)
    assert end.converged

    def cost(x: Array) -> float:
        Q, t = exp(x[:3]) @ end.R_CD, end.p_CD + x[3:]
        e = sight.rays - predicted(Q, t)
        d = np.concatenate([4.0 * Rotation.from_matrix(prior.R_CD @ Q.T).as_mrp(), prior.p_CD - t])
        return float(np.einsum("ni,nij,nj", e, sight.weights, e) + d @ np.linalg.solve(prior.covariance, d))

    assert end.cost == pytest.approx(cost(np.zeros(6)))
    assert end.cost > 20.0  # they do disagree
    for k, sigma in enumerate(np.sqrt(np.diag(end.covariance))):
        step = 1e-2 * sigma * np.eye(6)[k]
        assert abs(cost(step) - cost(-step)) < 1e-6 * end.cost


def test_prior_and_frame_add_their_information():
    """Where both agree the posterior's information is the sum of the two."""
    R, p_CD = exp(np.array([0.1, 0.3, -0.2])), np.array([8.0, 0.2, 0.1])
    pixels = CAMERA.pixels_from_points(RING @ R.T + p_CD)
    sight = lines_of_sight_from_pixels(pixels, RING, CAMERA, np.full(8, 0.1))
    prior = PosePrior(R_CD=R, p_CD=p_CD, covariance=np.diag([1e-4, 1e-4, 1e-4, 1e-4, 1e-6, 1e-6]))
    alone = descend(sight, R, p_CD, LEVENBERG_MARQUARDT).covariance
    both = descend(sight, R, p_CD, LEVENBERG_MARQUARDT, prior).covariance
    expected = np.linalg.inv(np.linalg.inv(alone) + np.linalg.inv(prior.covariance))
    np.testing.assert_allclose(both, expected, rtol=1e-6, atol=1e-6 * np.abs(expected).max())


def test_mrp_longer_than_one_and_its_shadow_predict_the_same():
    p, p_CD = np.array([0.9, -0.8, 0.5]), np.array([7.0, 0.4, -0.3])
    h, _ = model.lines_of_sight(p, p_CD, RING, model.SOURCE)
    shadow, _ = model.lines_of_sight(mrp_from_matrix(matrix_from_mrp(p)), p_CD, RING, model.SOURCE)
    np.testing.assert_allclose(h, shadow, atol=1e-14)
