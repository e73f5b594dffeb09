"""The Cramer-Rao bound of a ring: closed form, differences through the camera, the solver's own covariance."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from dockair.calibration import Camera, LedRing
from dockair.errors import DockairError
from dockair.nav.dop import DopStatus, dilution_of_precision, pose_bound
from dockair.nav.pose.estimate import solve_pose
from dockair.rotations import Array, exp

RING, CAMERA, ZERO = LedRing().positions_D, Camera(), np.zeros(3)
DISTORTED = replace(CAMERA, distortion=(-0.12, 0.06, 8e-4, -5e-4, -0.01))
DEEP = np.vstack([RING, [[0.2, 0.1, 0.0], [0.15, -0.05, 0.1]]])
R_CD, P_CD = exp(np.array([0.2, -0.3, 0.25])), np.array([4.0, 0.5, -0.2])


def by_differences(points: Array, R: Array, p: Array, camera: Camera, sigma: Array) -> Array:
    """(6, 6) bound of (phi, delta) from differences of the pixels."""
    columns, step = [], 1e-6
    for e in step * np.eye(6):
        ends = [camera.pixels_from_points(points @ (exp(s * e[:3]) @ R).T + p + s * e[3:]) for s in (1.0, -1.0)]
        columns.append(((ends[0] - ends[1]) / (2.0 * step * sigma[:, None])).ravel())
    H = np.column_stack(columns)
    return np.linalg.inv(H.T @ H)


@pytest.mark.parametrize("camera", [CAMERA, DISTORTED], ids=["pinhole", "distorted"])
@pytest.mark.parametrize("points", [RING, DEEP], ids=["flat", "deep"])
@pytest.mark.parametrize(
    ("R", "p"), [(R_CD, P_CD), (np.eye(3), np.array([9.0, 0.0, 0.0])), (exp(np.array([3.1, 0.0, 0.1])), P_CD)]
)
def test_bound_is_that_of_differences_through_the_camera(points, camera, R, p):
    sigma = np.linspace(0.05, 0.3, len(points))
    bound = pose_bound(points, R, p, camera, sigma)
    expected = by_differences(points, R, p, camera, sigma)
    scale = np.sqrt(np.diag(expected))
    assert bound.status is DopStatus.SOLVED and bound.seen.all()
    np.testing.assert_allclose(bound.covariance / np.outer(scale, scale), expected / np.outer(scale, scale), atol=2e-6)


@pytest.mark.parametrize("points", [RING, DEEP], ids=["flat", "deep"])
def test_solver_without_noise_reports_the_bound(points):
    pixels = DISTORTED.pixels_from_points(points @ R_CD.T + P_CD)
    pose = solve_pose(pixels, points, DISTORTED, sigma_px=0.2, initial=(R_CD, P_CD))
    bound = pose_bound(points, R_CD, P_CD, DISTORTED, 0.2)
    np.testing.assert_allclose(bound.covariance, pose.covariance, rtol=1e-6, atol=1e-14)


@pytest.mark.parametrize("range_m", [2.0, 10.0, 30.0])
def test_frontal_ring_is_the_closed_form(range_m):
    """X = range, n LEDs on radius a, k = sigma X/(sqrt(n) f): sigma of range k X/a, across k sqrt(2) each way, of tilt
    2 k X/a^2 each way, of roll k/a. At 10 m and 0.1 px: 4.86 mm along, 0.24 mm across, 3.2 deg.
    """
    n, a, sigma = 8, 0.25, 0.1
    k = sigma * range_m / (np.sqrt(n) * CAMERA.focal_length_px)
    bound = pose_bound(RING, np.eye(3), np.array([range_m, 0.0, 0.0]), CAMERA, sigma)
    assert bound.range_sigma_m == pytest.approx(k * range_m / a, rel=1e-9)
    assert bound.lateral_sigma_m == pytest.approx(2.0 * k, rel=1e-6)
    assert bound.attitude_sigma_rad == pytest.approx(k * np.hypot(1.0 / a, np.sqrt(8.0) * range_m / a**2), rel=1e-9)
    sideways = k * np.sqrt(2.0 + 4.0 * range_m**2 / a**2 + 4.0 * range_m**4 / a**4)
    assert bound.camera_lateral_sigma_m == pytest.approx(np.sqrt(2.0) * sideways, rel=1e-9)
    assert bound.camera_range_sigma_m == pytest.approx(bound.range_sigma_m, rel=1e-9)


def test_it_is_the_dilution_of_precision_times_the_error_on_the_focal_plane():
    """N is the drogue, the camera at its place and attitude; states in the other order."""
    sigma_px = 0.1
    R_DC = R_CD.T
    yaw, pitch = np.arctan2(R_DC[1, 0], R_DC[0, 0]), -np.arcsin(R_DC[2, 0])
    roll = np.arctan2(R_DC[2, 1], R_DC[2, 2])
    dop = dilution_of_precision(DEEP, -R_DC @ P_CD, np.array([roll, pitch, yaw]), CAMERA.focal_length_m)
    bound, sigma_m = pose_bound(DEEP, R_CD, P_CD, CAMERA, sigma_px), sigma_px * CAMERA.pixel_pitch_m
    swapped = np.roll(np.roll(bound.covariance, 3, axis=0), 3, axis=1)
    np.testing.assert_allclose(dop.landmarks_in_camera.covariance * sigma_m**2, swapped, rtol=1e-6, atol=1e-14)
    np.testing.assert_allclose(
        dop.covariance[:3, :3] * sigma_m**2, bound.camera_in_drogue[3:, 3:], rtol=1e-6, atol=1e-14
    )


def test_camera_in_the_drogue_is_the_other_way_round_of_each_error():
    """o = -R'p for small errors drawn from the bound: their covariance is camera_in_drogue, to 5 % of 40 000 draws."""
    bound = pose_bound(RING, R_CD, P_CD, CAMERA, 0.01)
    draws = np.random.default_rng(3).multivariate_normal(np.zeros(6), bound.covariance, 40_000)
    o = np.array([-(exp(x[:3]) @ R_CD).T @ (P_CD + x[3:]) for x in draws]) + R_CD.T @ P_CD
    sample = np.cov(np.hstack([draws[:, :3], o]).T)
    scale = np.sqrt(np.diag(bound.camera_in_drogue))
    np.testing.assert_allclose(
        sample / np.outer(scale, scale), bound.camera_in_drogue / np.outer(scale, scale), atol=0.05
    )
    along, left, up = np.sqrt(np.diag(sample)[3:])
    assert bound.camera_range_sigma_m == pytest.approx(along, rel=0.02)
    assert bound.camera_lateral_sigma_m == pytest.approx(np.hypot(left, up), rel=0.02)
    assert bound.camera_range_sigma_m > 2.0 * np.sqrt(bound.covariance[3, 3])  # the drogue's x is not the camera's


def test_range_and_lateral_are_along_and_across_the_line_of_sight():
    bound = pose_bound(DEEP, R_CD, P_CD, CAMERA, 0.1)
    along = P_CD / np.linalg.norm(P_CD)
    total = np.trace(bound.covariance[3:, 3:])
    assert bound.range_sigma_m**2 == pytest.approx(along @ bound.covariance[3:, 3:] @ along)
    assert bound.lateral_sigma_m**2 == pytest.approx(total - bound.range_sigma_m**2)


def test_leds_off_the_sensor_or_behind_the_camera_do_not_count():
    p = np.array([1.2, 0.0, 0.0])  # the ring reaches 606 px up and down from the middle of 1088 rows
    bound, endless = (pose_bound(RING, np.eye(3), p, CAMERA, sensor_edges=edges) for edges in (True, False))
    assert bound.seen.tolist() == [True, True, False, True, True, True, False, True] and endless.seen.all()
    sigma = np.linspace(0.05, 0.3, 8)
    noisy = pose_bound(RING, np.eye(3), p, CAMERA, sigma)
    left = pose_bound(RING[bound.seen], np.eye(3), p, CAMERA, sigma[bound.seen])
    np.testing.assert_allclose(noisy.covariance, left.covariance, rtol=1e-9, atol=1e-18)
    assert np.isnan(bound.information[~bound.seen]).all() and np.isfinite(bound.information[bound.seen]).all()
    behind = pose_bound(RING, np.eye(3), np.array([-5.0, 0.0, 0.0]), CAMERA, sensor_edges=False)
    assert behind.status is DopStatus.BEHIND_CAMERA and np.isnan(behind.covariance).all() and not behind.seen.any()


def test_an_led_counts_up_to_the_edge_of_the_last_pixel_on_all_four_sides():
    """Pixel centres are whole numbers, so that the sensor ends half a pixel beyond the first and the last."""
    width, height, within = CAMERA.width_px, CAMERA.height_px, 0.4
    for inside, outside in (
        ((-within, 500.0), (-1.0 + within, 500.0)),
        ((width - 1.0 + within, 500.0), (width - within, 500.0)),
        ((900.0, -within), (900.0, -1.0 + within)),
        ((900.0, height - 1.0 + within), (900.0, height - within)),
    ):
        points = 5.0 * CAMERA.rays_from_pixels(np.array([inside, outside]))
        assert pose_bound(points, np.eye(3), np.zeros(3), CAMERA).seen.tolist() == [True, False]


def test_leds_in_front_and_off_the_sensor_are_not_behind_the_camera_and_leave_what_is_known_beside_them():
    aside, prior = np.array([2.0, 1.5, 0.0]), np.diag([4.0, 4.0, 4.0, 1.0, 1.0, 1.0])
    off = pose_bound(RING, np.eye(3), aside, CAMERA)
    assert off.status is DopStatus.OFF_SENSOR and np.isnan(off.covariance).all() and not off.seen.any()
    assert pose_bound(RING, np.eye(3), aside, CAMERA, sensor_edges=False).status is DopStatus.SOLVED
    known = pose_bound(RING, np.eye(3), aside, CAMERA, prior_information=prior)
    assert known.status is DopStatus.SOLVED
    np.testing.assert_allclose(known.covariance, np.linalg.inv(prior), rtol=1e-12, atol=1e-15)


def test_a_prior_adds_its_information_and_lets_one_led_do():
    prior = np.diag([1.0 / np.deg2rad(3.0) ** 2] * 3 + [1.0 / 0.5**2] * 3)
    free, held = (
        pose_bound(RING, np.eye(3), P_CD, CAMERA),
        pose_bound(RING, np.eye(3), P_CD, CAMERA, prior_information=prior),
    )
    np.testing.assert_allclose(
        np.linalg.inv(held.covariance) - np.linalg.inv(free.covariance), prior, rtol=1e-3, atol=1.0
    )
    assert pose_bound(RING[:2], np.eye(3), P_CD, CAMERA).status is DopStatus.TOO_FEW_LANDMARKS
    assert pose_bound(RING[:3], np.eye(3), P_CD, CAMERA).status is DopStatus.SOLVED
    one = pose_bound(RING[:1], np.eye(3), P_CD, CAMERA, prior_information=prior)
    assert one.status is DopStatus.SOLVED and 0.4 < one.range_sigma_m <= 0.5 and one.lateral_sigma_m < 0.05


def test_leds_on_a_line_are_singular():
    line = np.column_stack([np.zeros(5), np.linspace(-0.25, 0.25, 5), np.zeros(5)])
    bound = pose_bound(line, R_CD, P_CD, CAMERA)
    assert bound.status is DopStatus.SINGULAR and np.isnan(bound.covariance).all()
    assert np.isnan([bound.range_sigma_m, bound.lateral_sigma_m, bound.attitude_sigma_rad]).all()


def test_any_line_is_singular_though_rounding_moves_leds_off_it():
    rng = np.random.default_rng(9)
    for _ in range(40):
        line = rng.uniform(-1.0, 1.0, 3) + rng.uniform(-0.3, 0.3, (6, 1)) * rng.uniform(-1.0, 1.0, 3)
        assert pose_bound(line, R_CD, 1.5 * P_CD, CAMERA, sensor_edges=False).status is DopStatus.SINGULAR


def test_the_bound_grows_as_leds_near_a_line_as_long_as_more_than_rounding_is_left():
    line, aside = np.linspace(-0.25, 0.25, 5)[:, None] * [0.0, 1.0, 0.3], np.eye(3)[[0, 2, 0, 1, 2]]
    near, far = (
        pose_bound(line + off_m * aside, R_CD, P_CD, CAMERA).attitude_sigma_rad * off_m for off_m in (1e-6, 1e-4)
    )
    assert near == pytest.approx(far, rel=1e-2)


def test_an_led_counts_on_an_endless_image_plane_until_its_line_of_sight_has_no_pixel():
    """A cosine of 0.1 to the boresight counts, one of 1e-10 does not, nor what is at the camera or beyond numbers."""
    aside = np.array([[0.1, 1.0, 0.0], [1e-10, 1.0, 0.0], [1e-60, 0.0, 0.0], [1e60, 0.0, 0.0]])
    assert pose_bound(aside, np.eye(3), ZERO, CAMERA, sensor_edges=False).seen.tolist() == [True, False, False, False]


def test_a_drogue_at_the_camera_has_no_line_of_sight_and_says_nothing_of_it():
    bound = pose_bound(RING + [4.0, 0.0, 0.0], np.eye(3), ZERO, CAMERA)
    assert bound.status is DopStatus.SOLVED and (bound.line_of_sight == 0.0).all()


def test_depth_ends_the_frontal_weakness():
    """Tilt moves an LED off the plane sideways, one in the plane along the line of sight, which is hardly seen."""
    p = np.array([10.0, 0.0, 0.0])
    flat, deep = (
        pose_bound(RING, np.eye(3), p, CAMERA),
        pose_bound(np.vstack([RING, [0.2, 0.1, 0.0]]), np.eye(3), p, CAMERA),
    )
    assert flat.attitude_sigma_rad > 20.0 * deep.attitude_sigma_rad
    assert flat.camera_lateral_sigma_m > 20.0 * deep.camera_lateral_sigma_m
    assert 1.0 < flat.range_sigma_m / deep.range_sigma_m < 1.1  # the bound; the bias of a flat ring is another matter


@settings(max_examples=120, deadline=None)
@given(
    st.integers(0, 6).flatmap(lambda n: arrays(float, (n, 3), elements=st.floats(-1.0, 1.0))),
    arrays(float, 3, elements=st.floats(-7.0, 7.0)),
    arrays(float, 3, elements=st.sampled_from([0.0, 1e-300, -3.0, 2.0, 1e6, 1e300])),
)
def test_any_pose_gives_a_status_and_nan_unless_solved(points, turn, p):
    bound = pose_bound(points, exp(turn), p, DISTORTED)
    if bound.status is DopStatus.SOLVED:
        assert np.isfinite(bound.covariance).all() and (np.diag(bound.covariance) > 0.0).all()
    else:
        assert np.isnan(bound.covariance).all()


@pytest.mark.parametrize(
    ("change", "where"),
    [
        ({"points_D": np.ones((3, 2))}, "points_D"),
        ({"R_CD": np.ones((3, 3))}, "R_CD"),
        ({"p_CD": [1.0, 2.0]}, "p_CD"),
        ({"sigma_px": 0.0}, "sigma_px"),
        ({"sigma_px": [0.1, 0.1]}, "sigma_px"),
        ({"sigma_px": np.nan}, "sigma_px"),
        ({"prior_information": np.eye(3)}, "prior_information"),
    ],
)
def test_wrong_arguments_are_refused_by_name(change, where):
    right = {"points_D": RING, "R_CD": R_CD, "p_CD": P_CD, "camera": CAMERA}
    with pytest.raises(DockairError, match=f"^{where}: expected"):
        pose_bound(**(right | change))
