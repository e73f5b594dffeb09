"""The pose from one frame: exact, at the bound, honest, and what it says when there is none."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from scipy.stats import chi2

from dockair.calibration import Camera, LedRing
from dockair.errors import DockairError
from dockair.nav.pose import model
from dockair.nav.pose.difference import pose_difference
from dockair.nav.pose.estimate import PoseEstimate, PoseOptions, PoseStatus, solve_pose
from dockair.nav.pose.levenberg_marquardt import levenberg_marquardt
from dockair.nav.pose.measurement import lens_of
from dockair.nav.pose.prior import AttitudePrior, DirectionPrior, PosePrior
from dockair.rotations import Array, exp, log, matrix_from_yaw_pitch_roll, mrp_from_matrix

RING, CAMERA = LedRing().positions_D, Camera()
LENS = replace(CAMERA, distortion=(-0.12, 0.06, 8e-4, -5e-4, -0.01))


def pixels_of(R: Array, p: Array, camera: Camera = CAMERA, points: Array = RING) -> Array:
    return camera.pixels_from_points(points @ R.T + p)


def random_poses(count: int, low_m: float = 2.0, high_m: float = 30.0, tilt_rad: float = 0.35):
    rng = np.random.default_rng(41)
    for _ in range(count):
        R = matrix_from_yaw_pitch_roll(*rng.uniform(-tilt_rad, tilt_rad, 3))
        yield R, rng.uniform(low_m, high_m) * np.array([1.0, *rng.uniform(-0.15, 0.15, 2)])


def error(estimate: PoseEstimate, R: Array, p: Array) -> Array:
    return np.concatenate([log(R @ estimate.R_CD.T), p - estimate.p_CD])


def tilted(tilt_deg: float, range_m: float) -> tuple[Array, Array]:
    return matrix_from_yaw_pitch_roll(0.0, np.deg2rad(tilt_deg), 0.0), np.array([range_m, 0.0, 0.0])


@pytest.mark.parametrize("camera", [CAMERA, LENS], ids=["pinhole", "distorted"])
@pytest.mark.parametrize("tilt_rad", [0.35, 0.9])
def test_pose_is_exact_without_noise_and_without_a_start(camera, tilt_rad):
    for R, p in random_poses(200, 1.2, 30.0, tilt_rad):
        estimate = solve_pose(pixels_of(R, p, camera), RING, camera)
        assert estimate.status is PoseStatus.CONVERGED
        np.testing.assert_allclose(error(estimate, R, p), 0.0, atol=1e-6)
        np.testing.assert_allclose(estimate.p_DC, -R.T @ p, atol=1e-5)
        assert estimate.rms_px < 1e-6


@pytest.mark.parametrize("method", ["lm", "glsdc"])
def test_pose_is_exact_from_a_start_by_both_methods(method):
    for R, p in random_poses(100):
        start = (exp(np.array([0.02, -0.01, 0.01])) @ R, p * 1.02)
        estimate = solve_pose(pixels_of(R, p), RING, CAMERA, method=method, initial=start)
        alternatives = [estimate, estimate.alternative or estimate]
        assert min(np.abs(error(e, R, p)).max() for e in alternatives) < 1e-6


def test_rms_and_chi2_are_those_of_the_pixels():
    rng = np.random.default_rng(5)
    for R, p in random_poses(20, 2.0, 12.0):
        sigma = rng.uniform(0.05, 0.3, 8)
        pixels = pixels_of(R, p, LENS) + sigma[:, None] * rng.normal(size=(8, 2))
        pixels[rng.permutation(8)[: rng.integers(3)]] = np.nan
        estimate = solve_pose(pixels, RING, LENS, sigma_px=sigma, initial=(R, p))
        residual = pixels - pixels_of(estimate.R_CD, estimate.p_CD, LENS)
        assert estimate.rms_px == pytest.approx(np.sqrt(np.nanmean(residual**2)), rel=1e-3)
        np.testing.assert_allclose(estimate.led_chi2, np.sum(residual**2, axis=1) / sigma**2, rtol=1e-2, atol=1e-3)
        assert estimate.chi2 == pytest.approx(np.nansum(estimate.led_chi2))


@pytest.mark.parametrize(
    ("range_m", "tilt_deg", "range_mm", "tilt_sigma_deg", "roll_deg", "across_mm"),
    [
        (2, 0, 0.19, 0.09, None, None),
        (5, 0, 1.2, 0.56, 0.014, None),
        (5, 20, 1.7, 0.08, None, None),
        (10, 0, 4.9, 2.2, 0.028, 0.17),
        (10, 10, None, 0.32, None, None),
        (10, 20, 6.9, 0.16, None, None),
        (20, 20, 27.0, 0.32, None, None),
        (30, 0, 44.0, 20.0, 0.084, 0.52),
        (40, 20, 110.0, 0.63, None, None),
    ],
)
def test_covariance_is_the_cramer_rao_bound_of_the_ring(
    range_m, tilt_deg, range_mm, tilt_sigma_deg, roll_deg, across_mm
):
    """Values of an independent program to two digits, 8 LEDs, 0.1 px, f = 2909 px."""
    R, p = tilted(tilt_deg, range_m)
    sigma = np.sqrt(np.diag(solve_pose(pixels_of(R, p), RING, CAMERA, initial=(R, p)).covariance))
    ours = [1e3 * sigma[3], np.rad2deg(sigma[1]), np.rad2deg(sigma[0]), 1e3 * sigma[4]]
    for value, expected in zip(ours, [range_mm, tilt_sigma_deg, roll_deg, across_mm], strict=True):
        assert expected is None or value == pytest.approx(expected, rel=0.03)


def test_covariance_of_the_frontal_ring_across_is_the_closed_form():
    """Eight LEDs average: sigma = R s / (f sqrt 8) with the tilt known; free tilt adds its share, sqrt 2 in all."""
    R, p = tilted(0.0, 10.0)
    prior = PosePrior(R_CD=R, p_CD=p, covariance=np.diag([1e-16] * 3 + [1e4] * 3))
    known = solve_pose(pixels_of(R, p), RING, CAMERA, prior=prior).covariance
    across = 10.0 * 0.1 / (CAMERA.focal_length_px * np.sqrt(8.0))
    np.testing.assert_allclose(np.sqrt(np.diag(known)[4:]), across, rtol=2e-3)


@pytest.mark.parametrize("sigma_px", [0.05, 0.1])
def test_covariance_is_honest(sigma_px):
    """Mean NEES of 400 frames at 5 m and 20 degrees is chi2(2400)/400; outside by luck once in 10 000."""
    rng = np.random.default_rng(42)
    (R, p), count, nees = tilted(20.0, 5.0), 400, 0.0
    for _ in range(count):
        pixels = pixels_of(R, p) + sigma_px * rng.normal(size=(8, 2))
        estimate = solve_pose(pixels, RING, CAMERA, sigma_px=sigma_px)
        e = error(estimate, R, p)
        nees += e @ np.linalg.solve(estimate.covariance, e) / count
    low, high = chi2.ppf([0.5e-4, 1.0 - 0.5e-4], 6 * count) / count
    assert low < nees < high


def test_residuals_are_chi_square_with_ten_degrees_of_freedom():
    """16 measurements, 6 unknowns; outside by luck once in 10 000."""
    rng = np.random.default_rng(43)
    (R, p), count = tilted(20.0, 5.0), 400
    total = sum(solve_pose(pixels_of(R, p) + 0.1 * rng.normal(size=(8, 2)), RING, CAMERA).chi2 for _ in range(count))
    low, high = chi2.ppf([0.5e-4, 1.0 - 0.5e-4], 10 * count)
    assert low < total < high


def test_leds_of_unequal_noise_are_weighed_so():
    """With one LED a hundred times worse the pose is that of the other seven."""
    rng = np.random.default_rng(44)
    R, p = tilted(20.0, 6.0)
    pixels = pixels_of(R, p) + 0.05 * rng.normal(size=(8, 2))
    pixels[3] += [0.4, -0.3]
    sigma = np.full(8, 0.05)
    sigma[3] = 5.0
    weighed = solve_pose(pixels, RING, CAMERA, sigma_px=sigma)
    without = solve_pose(np.delete(pixels, 3, 0), np.delete(RING, 3, 0), CAMERA, sigma_px=0.05)
    distance = error(weighed, without.R_CD, without.p_CD)
    assert distance @ np.linalg.solve(without.covariance, distance) < 0.01


def test_both_minima_are_found_at_20_m_and_5_degrees():
    """Without noise the mirror image is there, tilted as much the other way, and costs a little more."""
    R, p = tilted(5.0, 20.0)
    estimate = solve_pose(pixels_of(R, p), RING, CAMERA, sigma_px=0.02)
    other = estimate.alternative
    assert other is not None
    assert np.rad2deg(log(other.R_CD @ R.T)) == pytest.approx([0.0, -10.0, 0.0], abs=1.0)
    assert other.chi2 > estimate.chi2 + 1.0


def test_the_other_minimum_is_found_from_either_start():
    """200 noisy frames at 20 m, 8 degrees: the pair is the same from truth, from the mirror image and from no start."""
    rng = np.random.default_rng(45)
    R, p = tilted(8.0, 20.0)
    both = 0
    for _ in range(200):
        pixels = pixels_of(R, p) + 0.05 * rng.normal(size=(8, 2))
        first = solve_pose(pixels, RING, CAMERA, sigma_px=0.05)
        if first.alternative is None:
            continue
        both += 1
        assert first.chi2 <= first.alternative.chi2
        for start in (first, first.alternative):
            again = solve_pose(pixels, RING, CAMERA, sigma_px=0.05, initial=(start.R_CD, start.p_CD))
            assert again.alternative is not None
            assert again.chi2 == pytest.approx(start.chi2, rel=1e-3)
            assert again.reprojection_ratio == pytest.approx(first.reprojection_ratio, rel=1e-3)
            assert sorted([again.chi2, again.alternative.chi2]) == pytest.approx(
                [first.chi2, first.alternative.chi2], rel=1e-3
            )
    assert both > 180


def test_a_second_minimum_within_a_sigma_of_the_first_is_one():
    R, p = tilted(2.5, 20.0)
    pose = solve_pose(pixels_of(R, p), RING, CAMERA, sigma_px=0.3)
    other = pose.alternative
    assert other is not None
    d = pose_difference(other.R_CD, other.p_CD, pose.R_CD, pose.p_CD)
    assert 0.1 < d @ np.linalg.solve(pose.covariance, d) < 1.0


def test_minima_are_the_same_two_however_large_the_noise_is_said_to_be():
    """20 m, 4 degrees: with 0.4 px they are two sigma apart, and still two."""
    R, p = tilted(4.0, 20.0)
    small, large = (solve_pose(pixels_of(R, p), RING, CAMERA, sigma_px=s, initial=(R, p)) for s in (0.05, 0.4))
    assert small.alternative is not None and large.alternative is not None
    np.testing.assert_allclose(large.alternative.R_CD, small.alternative.R_CD, atol=1e-4)
    np.testing.assert_allclose(large.alternative.p_CD, small.alternative.p_CD, atol=1e-3)
    d = error(large, large.alternative.R_CD, large.alternative.p_CD)
    assert 1.0 < d @ np.linalg.solve(large.covariance, d) < 9.0


def test_attitude_prior_removes_the_range_bias_of_the_frontal_ring():
    """At 20 m noise makes a frontal ring look tilted and so too near, by 23 mm; with 1 degree of prior it does not.

    Mean of 400 frames, standard error 1 mm; the sigma of one is 19 mm, and a bias below 0.3 of it is asked for.
    """
    rng = np.random.default_rng(46)
    (frontal, p), count, errors = tilted(0.0, 20.0), 400, np.empty((400, 2))
    loose = np.diag([1.0, np.deg2rad(1.0) ** 2, np.deg2rad(1.0) ** 2, 1e4, 1e4, 1e4])
    prior = PosePrior(R_CD=frontal, p_CD=p, covariance=loose)
    for i in range(count):
        R = exp(np.array([0.0, *np.deg2rad(rng.normal(size=2))])) @ frontal
        pixels = pixels_of(R, p) + 0.1 * rng.normal(size=(8, 2))
        alone = solve_pose(pixels, RING, CAMERA, initial=(R, p))
        errors[i] = alone.p_CD[0] - 20.0, solve_pose(pixels, RING, CAMERA, prior=prior).p_CD[0] - 20.0
    mean = errors.mean(axis=0)
    assert mean[0] < -0.015
    assert abs(mean[1]) < 0.3 * 0.019


@pytest.mark.parametrize("count", [4, 5, 6, 7])
def test_four_leds_are_enough_without_a_start(count):
    rng = np.random.default_rng(47)
    for R, p in random_poses(50, 2.0, 15.0):
        pixels = pixels_of(R, p)
        pixels[rng.permutation(8)[count:]] = np.nan
        estimate = solve_pose(pixels, RING, CAMERA)
        assert estimate.status is PoseStatus.CONVERGED
        assert np.isfinite(estimate.led_chi2).sum() == count
        np.testing.assert_allclose(error(estimate, R, p), 0.0, atol=1e-5)


def test_three_leds_need_a_start():
    R, p = tilted(15.0, 6.0)
    pixels = pixels_of(R, p)
    pixels[[1, 2, 4, 5, 7]] = np.nan
    assert solve_pose(pixels, RING, CAMERA).status is PoseStatus.TOO_FEW_LEDS
    estimate = solve_pose(pixels, RING, CAMERA, initial=(exp(np.full(3, 0.01)) @ R, p * 1.01))
    np.testing.assert_allclose(error(estimate, R, p), 0.0, atol=1e-6)


@pytest.mark.parametrize("initial", [None, (np.eye(3), np.array([8.0, 0.0, 0.0]))])
def test_two_leds_are_too_few_and_the_result_cannot_be_used_by_accident(initial):
    pixels = np.full((8, 2), np.nan)
    pixels[[0, 3]] = [[900.0, 500.0], [1000.0, 600.0]]
    estimate = solve_pose(pixels, RING, CAMERA, initial=initial)
    assert estimate.status is PoseStatus.TOO_FEW_LEDS
    assert np.isnan(estimate.covariance).all() and np.isnan(estimate.p_CD).all() and np.isnan(estimate.p_DC).all()


def test_start_behind_the_camera_is_a_status():
    R, p = tilted(5.0, 8.0)
    estimate = solve_pose(pixels_of(R, p), RING, CAMERA, initial=(R, -p))
    assert estimate.status is PoseStatus.BEHIND_CAMERA
    assert np.isnan(estimate.covariance).all()


def test_start_with_the_range_far_off_still_arrives():
    for R, p in random_poses(100, 5.0, 20.0):
        estimate = solve_pose(pixels_of(R, p), RING, CAMERA, initial=(R, 3.0 * p))
        assert estimate.status is PoseStatus.CONVERGED
        assert min(np.abs(error(e, R, p)).max() for e in (estimate, estimate.alternative or estimate)) < 1e-5


@pytest.mark.parametrize("count", [4, 6])
@pytest.mark.parametrize("with_start", [False, True])
def test_leds_on_a_line_are_degenerate(count, with_start):
    R, p = tilted(10.0, 8.0)
    points = np.outer(np.arange(count), [0.0, 0.1, 0.2])
    start = (R, p) if with_start else None
    estimate = solve_pose(pixels_of(R, p, points=points), points, CAMERA, initial=start)
    assert estimate.status is PoseStatus.DEGENERATE
    assert np.isnan(estimate.covariance).all()


@pytest.mark.parametrize("leds", [[0, 4, 0, 4], [2, 2, 2, 2], [0, 3, 5, 3, 0, 5]])
def test_an_led_that_comes_twice_counts_once(leds):
    R, p = tilted(10.0, 8.0)
    points = RING[leds]
    assert solve_pose(pixels_of(R, p, points=points), points, CAMERA).status is PoseStatus.TOO_FEW_LEDS
    with_start = solve_pose(pixels_of(R, p, points=points), points, CAMERA, initial=(R, p))
    three = len(set(leds)) == 3
    assert with_start.status is (PoseStatus.CONVERGED if three else PoseStatus.TOO_FEW_LEDS)


def test_frontal_ring_gives_the_same_minima_without_a_start_as_from_its_own_mirror_image():
    """25 m, 100 noisy frames: orthography guesses nearly the same pose twice; no second minimum is overlooked."""
    rng, (R, p), pairs = np.random.default_rng(48), tilted(0.0, 25.0), 0
    for _ in range(100):
        pixels = pixels_of(R, p) + 0.1 * rng.normal(size=(8, 2))
        estimate = solve_pose(pixels, RING, CAMERA)
        assert estimate.status is PoseStatus.CONVERGED
        again = solve_pose(pixels, RING, CAMERA, initial=(estimate.R_CD, estimate.p_CD))
        assert (again.alternative is None) == (estimate.alternative is None)
        if estimate.alternative is not None:
            pairs += 1
            assert estimate.ambiguous and again.alternative is not None
            assert again.alternative.cost == pytest.approx(estimate.alternative.cost, rel=1e-3)
    assert pairs > 60


def test_mirror_can_be_left_out_with_a_start_and_nothing_else_changes():
    R, p = tilted(10.0, 20.0)
    pixels = pixels_of(R, p) + 0.1 * np.random.default_rng(49).normal(size=(8, 2))
    both = solve_pose(pixels, RING, CAMERA, initial=(R, p))
    alone = solve_pose(pixels, RING, CAMERA, initial=(R, p), options=PoseOptions(mirror=False))
    assert both.alternative is not None and alone.alternative is None
    assert not alone.ambiguous and alone.reprojection_ratio == 0.0
    np.testing.assert_array_equal(alone.covariance, both.covariance)
    np.testing.assert_array_equal(alone.p_CD, both.p_CD)


def test_reprojection_ratio_and_ambiguity_follow_the_two_minima():
    """Near 1 for a far ring, small for a near one; ambiguous below a difference of 25 in cost, counted anew here."""
    rng = np.random.default_rng(50)
    far, near = tilted(5.0, 30.0), tilted(20.0, 8.0)
    ratios = []
    for R, p in (far, near):
        pose = solve_pose(pixels_of(R, p) + 0.1 * rng.normal(size=(8, 2)), RING, CAMERA)
        assert pose.alternative is not None
        rms = [
            np.sqrt(np.mean((pixels_of(e.R_CD, e.p_CD) - pixels_of(pose.R_CD, pose.p_CD)) ** 2))
            for e in (pose, pose.alternative)
        ]
        assert rms[0] == 0.0 < rms[1]
        assert pose.reprojection_ratio == pytest.approx(pose.rms_px / pose.alternative.rms_px)
        assert pose.ambiguous == (pose.alternative.chi2 - pose.chi2 < 25.0)
        ratios.append(pose.reprojection_ratio)
    assert ratios[0] > 0.9 > 0.2 > ratios[1] > 0.0


def test_two_minima_without_residuals_look_alike():
    pose = solve_pose(pixels_of(*tilted(5.0, 20.0)), RING, CAMERA)
    assert pose.alternative is not None
    exact, other = (replace(end, led_chi2=np.zeros(8)) for end in (pose, pose.alternative))
    assert replace(exact, alternative=other).reprojection_ratio == 1.0
    assert replace(exact, alternative=pose.alternative).reprojection_ratio == 0.0


def test_the_iterations_are_those_of_the_descent_that_led_to_the_pose():
    R, p = tilted(15.0, 6.0)
    for start in ((R, p), (exp(np.array([0.3, -0.2, 0.4])) @ R, 1.5 * p)):
        pose = solve_pose(pixels_of(R, p), RING, CAMERA, initial=start)
        assert pose.iterations == levenberg_marquardt(pose.measurement, *start).iterations > 0


@pytest.mark.parametrize(("more", "ambiguous"), [(24.9, True), (25.1, False), (-1000.0, True)])
def test_a_pose_is_ambiguous_unless_the_other_minimum_costs_25_more(more, ambiguous):
    """A start may have led to what costs far more than the other: then the other is the likelier one."""
    R, p = tilted(15.0, 15.0)
    pose = solve_pose(pixels_of(R, p), RING, CAMERA)
    assert pose.alternative is not None
    pose = replace(pose, alternative=replace(pose.alternative, cost=pose.cost + more))
    assert pose.ambiguous == ambiguous


def test_condition_is_that_of_the_pixel_jacobian_in_metres():
    """By NumPy: squared, since the information is its square; a frontal far ring stands out."""
    for range_m, tilt_deg, low, high in ((3.0, 20.0, 10.0, 300.0), (30.0, 1.0, 1e4, 1e6)):
        R, p = tilted(tilt_deg, range_m)
        estimate = solve_pose(pixels_of(R, p), RING, CAMERA, initial=(R, p))
        _, J = model.pixels(mrp_from_matrix(R), p, RING, lens_of(CAMERA), model.LOCAL)
        J = J.reshape(-1, 6) / np.array([0.25, 0.25, 0.25, 1.0, 1.0, 1.0])
        assert estimate.condition == pytest.approx(np.linalg.cond(J) ** 2, rel=1e-3)
        assert low < estimate.condition < high
    assert np.isnan(solve_pose(np.full((8, 2), np.nan), RING, CAMERA).condition)


def test_condition_of_part_of_the_ring_has_the_root_mean_square_radius_about_its_middle():
    (R, p), points = tilted(20.0, 3.0), RING[:4]
    estimate = solve_pose(pixels_of(R, p, points=points), points, CAMERA, initial=(R, p))
    _, J = model.pixels(mrp_from_matrix(R), p, points, lens_of(CAMERA), model.LOCAL)
    radius = np.sqrt(np.mean(np.sum((points - points.mean(axis=0)) ** 2, axis=1)))
    assert radius < 0.8 * 0.25
    J = J.reshape(-1, 6) / np.repeat([radius, 1.0], 3)
    assert estimate.condition == pytest.approx(np.linalg.cond(J) ** 2, rel=1e-3)


def test_a_descent_that_has_not_arrived_is_a_status_without_covariance_or_alternative():
    R, p = tilted(15.0, 6.0)
    start = exp(np.full(3, 0.01)) @ R, 1.002 * p
    estimate = solve_pose(pixels_of(R, p), RING, CAMERA, method="gradient", initial=start)
    assert estimate.status is PoseStatus.NOT_CONVERGED
    assert np.isnan(estimate.covariance).all() and estimate.alternative is None and not estimate.ambiguous


@pytest.mark.parametrize("camera", [CAMERA, LENS], ids=["pinhole", "distorted"])
def test_residuals_in_pixels_give_the_same_pose(camera):
    rng = np.random.default_rng(51)
    for R, p in random_poses(20, 2.0, 12.0):
        pixels = pixels_of(R, p, camera) + 0.1 * rng.normal(size=(8, 2))
        first = solve_pose(pixels, RING, camera)
        second = solve_pose(pixels, RING, camera, options=PoseOptions(residuals="pixels"))
        d = error(first, second.R_CD, second.p_CD)
        assert d @ np.linalg.solve(first.covariance, d) < 1e-4
        residual = pixels - pixels_of(second.R_CD, second.p_CD, camera)
        assert second.rms_px == pytest.approx(np.sqrt(np.mean(residual**2)), rel=1e-9)


def test_isotropic_weight_is_near_the_efficient_one_on_the_axis_and_worse_off_it():
    """At 20 degrees off the axis a pixel is worth cos^2 = 0.88 of one direction and cos of the other."""
    (R, p), isotropic, sigma = tilted(10.0, 5.0), PoseOptions(weight="isotropic"), np.linspace(0.1, 0.3, 8)
    sight = solve_pose(pixels_of(R, p), RING, CAMERA, sigma_px=sigma, options=isotropic).measurement
    assert sight is not None
    expected = np.eye(3) * (CAMERA.focal_length_px / sigma[:, None, None]) ** 2
    np.testing.assert_allclose(sight.weights, expected, rtol=1e-12)
    on_axis = [solve_pose(pixels_of(R, p), RING, CAMERA, options=o).covariance for o in (PoseOptions(), isotropic)]
    np.testing.assert_allclose(on_axis[1], on_axis[0], rtol=0.02, atol=0.02 * on_axis[0].max())
    p = 5.0 * np.array([1.0, 0.33, 0.0])
    ratio = np.divide(
        *[solve_pose(pixels_of(R, p), RING, CAMERA, options=o).covariance[3, 3] for o in (isotropic, PoseOptions())]
    )
    assert ratio > 1.1


def test_hubers_cost_is_the_square_up_to_k_and_linear_beyond():
    """r^2 up to k, 2 k r - k^2 beyond; chi2 stays the sum of squares."""
    R, p = tilted(15.0, 6.0)
    pixels = pixels_of(R, p) + 0.1 * np.random.default_rng(11).standard_normal((8, 2))
    pixels[2] += [0.0, 4.0]
    pose = solve_pose(pixels, RING, CAMERA, options=PoseOptions(huber_sigma=3.0))
    r = np.sqrt(pose.led_chi2)
    assert np.count_nonzero(r > 3.0) > 0 and np.count_nonzero(r < 3.0) > 0
    assert pose.cost == pytest.approx(np.where(r <= 3.0, r**2, 6.0 * r - 9.0).sum())
    assert pose.chi2 == pytest.approx((r**2).sum())


def test_hubers_loss_leaves_a_wrong_led_where_it_is_and_shows_it():
    rng, (R, p) = np.random.default_rng(52), tilted(15.0, 8.0)
    pixels = pixels_of(R, p) + 0.1 * rng.normal(size=(8, 2))
    pixels[5] += [6.0, -8.0]
    plain = solve_pose(pixels, RING, CAMERA, initial=(R, p))
    robust = solve_pose(pixels, RING, CAMERA, initial=(R, p), options=PoseOptions(huber_sigma=2.5))
    assert np.linalg.norm(error(robust, R, p)[3:]) < 0.3 * np.linalg.norm(error(plain, R, p)[3:])
    assert np.argmax(robust.led_chi2) == 5 and robust.led_chi2[5] > 5000.0 > plain.led_chi2.max() * 0.9
    assert robust.cost < robust.chi2


METHODS = ("lm", "glsdc", "levenberg", "gradient")
COORDINATES = st.one_of(st.floats(-1e6, 1e6), st.sampled_from([np.nan, np.inf, -np.inf, 1e300, 0.0, 1023.5]))


@settings(max_examples=300, deadline=None)
@given(
    st.lists(st.tuples(COORDINATES, COORDINATES), max_size=10),
    st.sampled_from(METHODS),
    st.sampled_from([CAMERA, LENS]),
    st.sampled_from(["none", "ahead", "behind", "at the camera", "attitude", "direction", "pose"]),
    st.sampled_from([PoseOptions(), PoseOptions(residuals="pixels"), PoseOptions(huber_sigma=1.0, weight="isotropic")]),
    st.lists(st.integers(0, 9), min_size=10, max_size=10),
)
@example(
    [(0.0, 0.0)] * 3, "lm", LENS, "attitude", PoseOptions(huber_sigma=1.0, weight="isotropic"), [5, 0, 4] + [0] * 7
)  # one pixel, three LEDs: a place 2500 km away, known to 600 000 km
def test_any_pixels_give_a_status_and_nan_covariance_unless_converged(pixels, method, camera, start, options, leds):
    """LEDs come twice, lie on a line, are too few; pixels are far out of the frame or none; starts are anywhere."""
    points = np.vstack([RING, [[0.0, 0.0, 0.0], [0.1, 0.2, 0.3]]])[leds[: len(pixels)]]
    x = np.array([1.0, 0.0, 0.0])
    initial = {"ahead": (np.eye(3), 8.0 * x), "behind": (np.eye(3), -8.0 * x), "at the camera": (np.eye(3), 0.0 * x)}
    prior = {
        "attitude": AttitudePrior.from_sigmas(np.eye(3), np.array([np.inf, 0.01, 0.01])),
        "direction": DirectionPrior(axis_C=x, axis_D=x, sigma_rad=0.01),
        "pose": PosePrior(R_CD=np.eye(3), p_CD=8.0 * x, covariance=0.01 * np.eye(6)),
    }
    estimate = solve_pose(
        np.array(pixels).reshape(-1, 2),
        points.reshape(-1, 3),
        camera,
        method="lm" if start in prior else method,
        initial=initial.get(start),
        prior=prior.get(start),
        options=options,
    )
    converged = estimate.status is PoseStatus.CONVERGED
    assert np.isfinite(estimate.covariance).all() == converged
    assert np.isfinite(estimate.condition) == converged
    if converged:
        assert np.isfinite(estimate.p_CD).all() and np.isfinite(estimate.R_CD).all()
        seen = np.isfinite(estimate.led_chi2)
        assert ((points @ estimate.R_CD.T + estimate.p_CD)[seen, 0] > 0.0).all()  # every LED used is ahead
        sigma = np.sqrt(np.diag(estimate.covariance))  # up to 1e6 m: unscaled, rounding is as large as the least root
        assert (np.linalg.eigvalsh(estimate.covariance / np.outer(sigma, sigma)) > 0.0).all()


@pytest.mark.parametrize(
    ("change", "where"),
    [
        ({"pixels": np.zeros((8, 3))}, "pixels"),
        ({"pixels": np.zeros(16)}, "pixels"),
        ({"points_D": RING[:7]}, "points_D"),
        ({"points_D": np.full((8, 3), np.nan)}, "points_D"),
        ({"sigma_px": 0.0}, "sigma_px"),
        ({"sigma_px": np.full(7, 0.1)}, "sigma_px"),
        ({"sigma_px": np.array([0.1] * 7 + [np.nan])}, "sigma_px"),
        ({"method": "epnp"}, "method"),
        ({"method": "glsdc", "prior": AttitudePrior(R_CD=np.eye(3), information=np.eye(3))}, "method"),
        ({"pixels": [[1.0, 2.0], [3.0]]}, "pixels, points_D"),
        ({"pixels": [["a", "b"]] * 8}, "pixels, points_D"),
        ({"points_D": np.zeros((8, 2))}, "points_D"),
        ({"sigma_px": "much"}, "sigma_px"),
        ({"initial": (np.eye(2), np.zeros(3))}, "initial"),
        ({"initial": (np.eye(3), np.zeros(2))}, "initial"),
        ({"initial": (np.full((3, 3), np.nan), np.array([8.0, 0.0, 0.0]))}, "initial"),
        ({"initial": (np.eye(3), np.array([np.nan, 0.0, 0.0]))}, "initial"),
    ],
)
def test_wrong_arguments_are_refused_by_name(change, where):
    arguments = {"pixels": np.zeros((8, 2)), "points_D": RING, "camera": CAMERA, **change}
    with pytest.raises(DockairError) as caught:
        solve_pose(**arguments)
    assert caught.value.where == where


@pytest.mark.parametrize(
    ("option", "where"),
    [
        ({"residuals": "mm"}, "options.residuals"),
        ({"weight": "none"}, "options.weight"),
        ({"huber_sigma": 0.0}, "options.huber_sigma"),
        ({"huber_sigma": np.nan}, "options.huber_sigma"),
    ],
)
def test_options_that_do_not_exist_are_refused_by_name(option, where):
    with pytest.raises(DockairError) as caught:
        PoseOptions(**option)
    assert caught.value.where == where
