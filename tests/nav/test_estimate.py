"""The pose from one frame: exact, at the bound, honest, and what it says when there is none."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.stats import chi2

from dockair.calibration import Camera, LedRing
from dockair.errors import DockairError
from dockair.nav.pose.descent import PosePrior
from dockair.nav.pose.estimate import PoseEstimate, PoseStatus, solve_pose
from dockair.rotations import Array, exp, log, matrix_from_yaw_pitch_roll

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
        estimate = solve_pose(pixels, RING, LENS, sigma_px=sigma, initial=(R, p))
        residual = pixels - pixels_of(estimate.R_CD, estimate.p_CD, LENS)
        assert estimate.rms_px == pytest.approx(np.sqrt(np.mean(residual**2)), rel=1e-3)
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
            assert sorted([again.chi2, again.alternative.chi2]) == pytest.approx(
                [first.chi2, first.alternative.chi2], rel=1e-3
            )
    assert both > 180


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


@pytest.mark.parametrize(
    "points", [RING[[0, 4, 0, 4]], RING[[2, 2, 2, 2]], np.outer([0.0, 1.0, 2.0, 3.0], [0.0, 0.1, 0.2])]
)
@pytest.mark.parametrize("with_start", [False, True])
def test_leds_on_a_line_are_degenerate(points, with_start):
    R, p = tilted(10.0, 8.0)
    start = (R, p) if with_start else None
    estimate = solve_pose(pixels_of(R, p, points=points), points, CAMERA, initial=start)
    assert estimate.status is PoseStatus.DEGENERATE
    assert np.isnan(estimate.covariance).all()


@settings(max_examples=200, deadline=None)
@given(
    st.lists(st.tuples(st.one_of(st.floats(-1e6, 1e6), st.just(np.nan)), st.floats(-1e6, 1e6)), min_size=8, max_size=8),
    st.booleans(),
    st.sampled_from(["lm", "glsdc"]),
)
def test_any_pixels_give_a_status_and_nan_covariance_unless_converged(pixels, with_start, method):
    start = (np.eye(3), np.array([8.0, 0.0, 0.0])) if with_start else None
    estimate = solve_pose(np.array(pixels), RING, CAMERA, method=method, initial=start)
    converged = estimate.status is PoseStatus.CONVERGED
    assert np.isfinite(estimate.covariance).all() == converged
    if converged:
        assert ((RING @ estimate.R_CD.T + estimate.p_CD) @ np.array([1.0, 0.0, 0.0]) > 0.0).any()
        assert (np.linalg.eigvalsh(estimate.covariance) > 0.0).all()


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
    ],
)
def test_wrong_arguments_are_refused_by_name(change, where):
    arguments = {"pixels": np.zeros((8, 2)), "points_D": RING, "camera": CAMERA, **change}
    with pytest.raises(DockairError) as caught:
        solve_pose(**arguments)
    assert caught.value.where == where
