"""Lines of sight, their derivatives (also near 0 and near pi) and their weights."""

from dataclasses import replace

import numpy as np
import pytest
from numba.core.runtime import _nrt_python, rtsys
from scipy.optimize import least_squares
from scipy.spatial.transform import Rotation

from dockair.calibration import Camera, LedRing
from dockair.nav.pose import model
from dockair.nav.pose.descent import PosePrior, descend
from dockair.nav.pose.difference import pose_difference
from dockair.nav.pose.glsdc import GLSDC
from dockair.nav.pose.gradient import GRADIENT
from dockair.nav.pose.levenberg import LEVENBERG
from dockair.nav.pose.levenberg_marquardt import AS_PRINTED, LEVENBERG_MARQUARDT
from dockair.nav.pose.measurement import (
    isotropic_weights,
    lens_of,
    lines_of_sight_from_pixels,
    seen_lines_of_sight,
)
from dockair.nav.pose.prior import DirectionPrior
from dockair.rotations import Array, exp, log, matrix_from_mrp, mrp_from_matrix

RING, CAMERA = LedRing().positions_D, Camera()
DISTORTED = replace(CAMERA, distortion=(-0.12, 0.06, 8e-4, -5e-4, -0.01))
LENSES = {"pinhole": CAMERA, "distorted": DISTORTED}
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


@pytest.mark.parametrize("camera", LENSES.values(), ids=LENSES)
@pytest.mark.parametrize("coordinates", [model.SOURCE, model.LOCAL])
def test_pixel_jacobian_matches_central_differences_through_the_camera(camera, coordinates):
    """Also at attitudes of 0 and of half a turn and beyond, where the MRP is its shadow's."""
    p_CD, step, lens = np.array([7.0, 0.4, -0.3]), 1e-6, lens_of(camera)
    for p in attitudes():
        R = matrix_from_mrp(p)
        o = -R.T @ p_CD
        uv, J = model.pixels(p, p_CD, RING, lens, coordinates)
        np.testing.assert_allclose(uv, camera.pixels_from_points(RING @ R.T + p_CD), atol=1e-9)
        for k, e in enumerate(np.eye(6) * step):
            ends = []
            for sign in (1.0, -1.0):
                if coordinates == model.LOCAL:
                    points_C = RING @ (exp(sign * e[:3]) @ R).T + p_CD + sign * e[3:]
                else:
                    C = matrix_from_mrp(p + sign * e[:3])
                    points_C = (RING - (o + sign * e[3:])) @ C.T
                ends.append(camera.pixels_from_points(points_C))
            np.testing.assert_allclose(J[:, :, k], (ends[0] - ends[1]) / (2.0 * step), atol=2e-5)


@pytest.mark.parametrize("camera", LENSES.values(), ids=LENSES)
@pytest.mark.parametrize("settings", [LEVENBERG_MARQUARDT, GLSDC], ids=["local", "source"])
def test_lines_of_sight_and_pixels_have_the_same_minimum_and_covariance(camera, settings):
    """Within 2e-3 sigma, LEDs of unequal noise included; the costs differ by less than one in a thousand."""
    rng = np.random.default_rng(31)
    for _ in range(30):
        R, p = exp(rng.uniform(-0.3, 0.3, 3)), rng.uniform(2.0, 8.0) * np.array([1.0, 0.15, -0.1])
        sigma = rng.uniform(0.05, 0.3, 8)
        pixels = camera.pixels_from_points(RING @ R.T + p) + sigma[:, None] * rng.standard_normal((8, 2))
        ends = [
            descend(seen_lines_of_sight(pixels, RING, lens_of(camera), sigma, in_pixels=in_pixels)[0], R, p, settings)
            for in_pixels in (False, True)
        ]
        d = pose_difference(ends[1].R_CD, ends[1].p_CD, ends[0].R_CD, ends[0].p_CD)
        s = np.sqrt(np.diag(ends[0].covariance))
        np.testing.assert_array_less(np.abs(d), 2e-3 * s)
        np.testing.assert_allclose(ends[1].covariance / np.outer(s, s), ends[0].covariance / np.outer(s, s), atol=2e-3)
        assert ends[1].cost == pytest.approx(ends[0].cost, rel=1e-3)
        assert ends[1].cost != ends[0].cost  # they are two models


@pytest.mark.parametrize("camera", LENSES.values(), ids=LENSES)
def test_rays_are_the_cameras_and_what_was_not_seen_is_left_out(camera):
    rng = np.random.default_rng(32)
    pixels = rng.uniform([0.0, 0.0], [2047.0, 1087.0], (8, 2))
    pixels[2, 1], pixels[5, 0] = np.nan, np.inf
    sight, seen, apart = seen_lines_of_sight(pixels, RING, lens_of(camera), np.arange(1.0, 9.0))
    kept = [0, 1, 3, 4, 6, 7]
    assert list(np.flatnonzero(seen)) == kept and apart == 6
    np.testing.assert_allclose(sight.rays, camera.rays_from_pixels(pixels[kept]), atol=1e-12)
    np.testing.assert_array_equal(sight.points_D, RING[kept])
    np.testing.assert_array_equal(sight.sigma_px, 1.0 + np.array(kept))


@pytest.mark.parametrize("axis", range(3))
def test_leds_that_differ_along_one_axis_alone_stand_apart(axis):
    points = RING[[0, 0]] + 0.1 * np.outer([0.0, 1.0], np.eye(3)[axis])
    pixels = np.array([[900.0, 500.0], [901.0, 500.0]])
    for q, apart in ((points, 2), (points[[0, 0]], 1)):
        assert seen_lines_of_sight(pixels, q, lens_of(CAMERA), np.ones(2))[2] == apart


def test_a_pixel_that_no_ray_makes_counts_as_not_seen():
    """A lens of barrel distortion has an edge: k1 = -0.3 shows nothing beyond 0.7 focal lengths from its centre."""
    camera = replace(CAMERA, distortion=(-0.3, 0.0, 0.0, 0.0, 0.0))
    edge = camera.focal_length_px * (2.0 / 3.0) / np.sqrt(0.9)
    pixels = np.array([[1023.5 + 0.99 * edge, 543.5], [1023.5 + 1.01 * edge, 543.5]])
    sight, seen, _ = seen_lines_of_sight(pixels, RING[:2], lens_of(camera), np.ones(2))
    assert list(seen) == [True, False]
    np.testing.assert_allclose(camera.pixels_from_points(sight.rays), pixels[:1], atol=1e-6)


@pytest.mark.parametrize("settings", [LEVENBERG_MARQUARDT, GLSDC, LEVENBERG, GRADIENT, AS_PRINTED])
@pytest.mark.parametrize("in_pixels", [False, True])
def test_the_loop_allocates_nothing(settings, in_pixels):
    """As many allocations in two steps as in twenty; counted by numba's own memory system."""
    R, p = exp(np.array([0.1, 0.3, -0.2])), np.array([8.0, 0.2, 0.1])
    pixels = DISTORTED.pixels_from_points(RING @ R.T + p)
    sight, _, _ = seen_lines_of_sight(pixels, RING, lens_of(DISTORTED), np.full(8, 0.1), in_pixels=in_pixels)
    local = settings.coordinates == model.LOCAL
    prior = PosePrior(R_CD=R, p_CD=p, covariance=np.eye(6)) if local else None
    counts, steps = [], []
    _nrt_python.memsys_enable_stats()
    try:
        for limit in (2, 2, 20):
            before = rtsys.get_allocation_stats().alloc
            limited = replace(settings, max_iterations=limit, tolerance_sigma=0.0)
            end = descend(sight, exp(np.array([0.0, 0.5, 0.2])) @ R, 1.3 * p, limited, prior)
            counts.append(rtsys.get_allocation_stats().alloc - before)
            steps.append(end.iterations)
    finally:
        _nrt_python.memsys_disable_stats()
    assert steps[1] == 2 < 6 <= steps[2]
    assert counts[1] == counts[2] > 0


def huber_cost(r2: Array, k: float) -> Array:
    r = np.sqrt(r2)
    return np.where(r <= k, r2, 2.0 * k * r - k**2)


def test_hubers_minimum_is_one_of_its_cost_and_its_covariance_the_inverse_of_what_it_leaves():
    """One LED is off by 20 sigma, the cost written anew: stationary; the information is the weighed sum."""
    rng, k = np.random.default_rng(33), 2.0
    R, p = exp(np.array([0.1, 0.3, -0.2])), np.array([4.0, 0.2, 0.1])
    pixels = CAMERA.pixels_from_points(RING @ R.T + p) + 0.1 * rng.standard_normal((8, 2))
    pixels[3] += [1.6, -1.2]
    sight = lines_of_sight_from_pixels(pixels, RING, CAMERA, np.full(8, 0.1))
    settings = replace(LEVENBERG_MARQUARDT, huber_sigma=k, tolerance_sigma=1e-7, max_iterations=200)
    end = descend(sight, R, p, settings)
    assert end.converged

    def squares(x: Array) -> Array:
        e = sight.rays - predicted(exp(x[:3]) @ end.R_CD, end.p_CD + x[3:])
        return np.einsum("ni,nij,nj->n", e, sight.weights, e)

    np.testing.assert_allclose(end.led_chi2, squares(np.zeros(6)), rtol=1e-9)
    assert end.cost == pytest.approx(huber_cost(end.led_chi2, k).sum()) and end.chi2 > end.cost + 50.0
    for i, sigma in enumerate(np.sqrt(np.diag(end.covariance))):
        step = 1e-2 * sigma * np.eye(6)[i]
        assert abs(huber_cost(squares(step), k).sum() - huber_cost(squares(-step), k).sum()) < 1e-5
    _, J = model.lines_of_sight(mrp_from_matrix(end.R_CD), end.p_CD, RING, model.LOCAL)
    w = np.minimum(1.0, k / np.sqrt(end.led_chi2))
    information = np.einsum("n,nij,nik,nkl->jl", w, J, sight.weights, J)
    np.testing.assert_allclose(end.covariance @ information, np.eye(6), atol=1e-6)


def test_huber_holds_back_a_wrong_led():
    """Shifted by 5 px of 0.1 px the LED drags the pose by over 10 sigma; with k = 2 by under 3."""
    R, p = exp(np.array([0.0, 0.3, -0.2])), np.array([5.0, 0.2, 0.1])
    pixels = CAMERA.pixels_from_points(RING @ R.T + p)
    pixels[2] += [3.0, 4.0]
    sight = lines_of_sight_from_pixels(pixels, RING, CAMERA, np.full(8, 0.1))
    errors = []
    for k in (np.inf, 2.0):
        end = descend(sight, R, p, replace(LEVENBERG_MARQUARDT, huber_sigma=k))
        d = pose_difference(R, p, end.R_CD, end.p_CD)
        errors.append(np.sqrt(d @ np.linalg.solve(end.covariance, d)))
    assert errors[0] > 10.0 and errors[1] < 3.0


def test_held_attitude_stays_and_the_position_is_the_minimum_for_it():
    rng = np.random.default_rng(34)
    R, p = exp(np.array([0.1, 0.3, -0.2])), np.array([6.0, 0.2, 0.1])
    pixels = CAMERA.pixels_from_points(RING @ R.T + p) + 0.1 * rng.standard_normal((8, 2))
    sight = lines_of_sight_from_pixels(pixels, RING, CAMERA, np.full(8, 0.1))
    held = exp(np.array([0.01, -0.03, 0.02])) @ R
    end = descend(sight, held, 1.2 * p, LEVENBERG_MARQUARDT, hold_attitude=True)
    assert end.converged
    np.testing.assert_allclose(end.R_CD, held, atol=1e-14)

    def residuals(t: Array) -> Array:
        values, vectors = np.linalg.eigh(sight.weights)
        A = np.sqrt(np.maximum(values, 0.0))[:, :, None] * vectors.transpose(0, 2, 1)
        return np.einsum("nij,nj->ni", A, sight.rays - predicted(held, t)).ravel()

    theirs = least_squares(residuals, p, x_scale="jac", xtol=1e-15, ftol=1e-15, gtol=1e-15)
    np.testing.assert_allclose(end.p_CD, theirs.x, atol=1e-8)
    np.testing.assert_allclose(end.information[3:, 3:], theirs.jac.T @ theirs.jac, rtol=1e-4)
    prior = PosePrior(R_CD=R, p_CD=p + [0.05, -0.02, 0.01], covariance=np.diag([1e-2] * 3 + [1e-4, 1e-6, 1e-6]))
    sigma = np.sqrt(np.diag(prior.covariance)[3:])
    both = descend(sight, held, 1.2 * p, LEVENBERG_MARQUARDT, prior, hold_attitude=True)
    theirs = least_squares(lambda t: np.append(residuals(t), (prior.p_CD - t) / sigma), p, x_scale=sigma, xtol=1e-15)
    assert both.converged and np.linalg.norm(both.p_CD - end.p_CD) > 1e-3
    np.testing.assert_allclose(both.p_CD, theirs.x, atol=1e-7)


def test_direction_prior_turns_the_axis_there_and_leaves_the_roll():
    """With next to no weight on the LEDs the axis comes to lie along c, and nothing is known about it."""
    rng = np.random.default_rng(35)
    c, a = rng.standard_normal((2, 3))
    c, a = c / np.linalg.norm(c), a / np.linalg.norm(a)
    R, p = exp(np.array([0.4, 0.2, -0.1])), np.array([9.0, 0.5, 0.2])
    sight = lines_of_sight_from_pixels(CAMERA.pixels_from_points(RING @ R.T + p), RING, CAMERA, np.full(8, 1e5))
    start = exp(0.5 * np.cross(R @ a, c)) @ R
    end = descend(sight, start, p, LEVENBERG_MARQUARDT, DirectionPrior(axis_C=c, axis_D=a, sigma_rad=1e-3))
    assert end.converged
    np.testing.assert_allclose(end.R_CD @ a, c, atol=1e-4)
    np.testing.assert_allclose(end.information[:3, :3], (np.eye(3) - np.outer(c, c)) / 1e-6, atol=50.0)
