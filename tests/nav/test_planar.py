"""First guesses: both attitudes of a flat ring, the mirror image, the position for a known attitude."""

import cv2
import numpy as np
import pytest

from dockair.calibration import Camera, LedRing
from dockair.nav.pose.planar import mirrored, position_for_attitude, two_poses
from dockair.rotations import Array, exp, log, matrix_from_yaw_pitch_roll

RING, CAMERA = LedRing().positions_D, Camera()


def rays(R: Array, p: Array, points: Array = RING) -> Array:
    s = points @ R.T + p
    return s / np.linalg.norm(s, axis=1, keepdims=True)


def angle(R: Array, Q: Array) -> float:
    return float(np.linalg.norm(log(R @ Q.T)))


def from_axis(R: Array, p: Array) -> float:
    """Tilt of the ring against the line of sight to its middle."""
    return float(np.arccos(np.clip(R[:, 0] @ p / np.linalg.norm(p), -1.0, 1.0)))


def random_poses(count: int, low_m: float, high_m: float):
    rng = np.random.default_rng(31)
    for _ in range(count):
        R = matrix_from_yaw_pitch_roll(*rng.uniform(-0.6, 0.6, 3))
        yield R, rng.uniform(low_m, high_m) * np.array([1.0, *rng.uniform(-0.3, 0.3, 2)])


def test_one_of_the_two_is_the_true_pose_to_the_order_of_ring_over_range():
    """Scaled orthography neglects (radius / range): attitude and relative range are off by no more than a few of it."""
    for R, p in random_poses(300, 3.0, 30.0):
        attitudes, positions = two_poses(rays(R, p), RING)
        k = min(range(2), key=lambda k: angle(attitudes[k], R))
        order = 0.25 / np.linalg.norm(p)
        assert angle(attitudes[k], R) < 0.05 + order
        assert np.linalg.norm(positions[k] - p) < 0.5 * order * np.linalg.norm(p)


def test_far_away_both_are_exact_up_to_the_mirror_image():
    """At 10 km orthography is exact to 1e-5."""
    R, p = matrix_from_yaw_pitch_roll(0.3, -0.4, 0.2), 1e4 * np.array([1.0, 0.1, -0.05])
    attitudes, positions = two_poses(rays(R, p), RING)
    attitudes = sorted(attitudes, key=lambda Q: angle(Q, R))
    assert angle(attitudes[0], R) < 1e-4
    assert angle(attitudes[1], mirrored(R, p, RING)[0]) < 1e-4
    np.testing.assert_allclose(positions, [p, p], rtol=1e-4)


def test_opencvs_ippe_finds_the_same_pair():
    to_opencv = np.array([[0.0, -1.0, 0.0], [0.0, 0.0, -1.0], [1.0, 0.0, 0.0]])  # right, down, forward
    flat = RING @ np.array([[0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [1.0, 0.0, 0.0]]).T  # ring in its x-y plane
    compared = 0
    for R, p in random_poses(30, 8.0, 30.0):
        if from_axis(R, p) < 0.15:
            continue  # nearly frontal: IPPE's homography and orthography differ in what they neglect
        b = rays(R, p) @ to_opencv.T
        _, rotations, _, _ = cv2.solvePnPGeneric(
            flat, b[:, None, :2] / b[:, None, 2:], np.eye(3), None, flags=cv2.SOLVEPNP_IPPE
        )
        cycle = np.array([[0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [1.0, 0.0, 0.0]])
        theirs = [to_opencv.T @ cv2.Rodrigues(r)[0] @ cycle for r in rotations]
        ours, _ = two_poses(rays(R, p), RING)
        for Q in theirs:
            assert min(angle(Q, ours[0]), angle(Q, ours[1])) < 0.1
        compared += 1
    assert compared > 20


def test_frontal_ring_gives_one_attitude_twice_and_it_is_finite():
    R, p = exp(np.array([0.7, 0.0, 0.0])), np.array([10.0, 0.0, 0.0])
    attitudes, positions = two_poses(rays(R, p), RING)
    for k in range(2):
        assert angle(attitudes[k], R) < 1e-6
        np.testing.assert_allclose(positions[k], p, rtol=1e-2, atol=1e-12)


@pytest.mark.parametrize("leds", [[0, 1, 2, 3], [0, 2, 4, 6], [1, 4, 6], [0, 1, 2, 3, 4, 6, 7]])
def test_part_of_the_ring_is_enough(leds):
    R, p = matrix_from_yaw_pitch_roll(0.2, -0.3, 0.1), np.array([12.0, 1.0, -0.6])
    attitudes, positions = two_poses(rays(R, p, RING[leds]), RING[leds])
    k = min(range(2), key=lambda k: angle(attitudes[k], R))
    assert angle(attitudes[k], R) < 0.1
    np.testing.assert_allclose(positions[k], p, rtol=0.03, atol=0.02)


def test_attitudes_are_rotations():
    for R, p in random_poses(50, 1.0, 30.0):
        for Q in two_poses(rays(R, p), RING)[0]:
            np.testing.assert_allclose(Q @ Q.T, np.eye(3), atol=1e-9)
            assert np.linalg.det(Q) == pytest.approx(1.0)


@pytest.mark.parametrize("points", [RING[[0, 0, 0, 0]], RING[[0, 4, 0, 4]], np.outer([0.0, 1, 2, 3], [0.0, 0.1, 0.1])])
def test_leds_on_a_line_give_nan(points):
    _, positions = two_poses(rays(np.eye(3), np.array([8.0, 0.0, 0.0]), points), points)
    assert np.isnan(positions).all()


def test_mirror_image_keeps_the_tilt_turns_it_around_and_its_own_mirror_image_is_the_pose():
    for R, p in random_poses(50, 2.0, 30.0):
        Q, s = mirrored(R, p, RING)
        np.testing.assert_allclose(s, p, atol=1e-12)
        assert from_axis(Q, s) == pytest.approx(from_axis(R, p), abs=1e-7)
        middle = (R[:, 0] + Q[:, 0]) / np.linalg.norm(R[:, 0] + Q[:, 0])
        np.testing.assert_allclose(middle, p / np.linalg.norm(p), atol=1e-9)
        back, _ = mirrored(Q, s, RING)
        np.testing.assert_allclose(back, R, atol=1e-12)


@pytest.mark.parametrize("leds", [[0, 1, 2, 3], [1, 4, 6], [0, 1, 2, 3, 4]])
def test_mirror_image_of_part_of_the_ring_is_about_the_line_of_sight_to_the_middle_of_that_part(leds):
    """The middle m stays, the normal n is reflected about the line s to it: 2 (s'n) s - n."""
    points, middle_D = RING[leds], RING[leds].mean(axis=0)
    for R, p in random_poses(20, 2.0, 30.0):
        Q, s = mirrored(R, p, points)
        middle = R @ middle_D + p
        sight, normal = middle / np.linalg.norm(middle), R[:, 0]
        np.testing.assert_allclose(Q @ middle_D + s, middle, atol=1e-12)
        np.testing.assert_allclose(Q[:, 0], 2.0 * (sight @ normal) * sight - normal, atol=1e-12)


def test_mirror_image_looks_the_same_to_first_order():
    """Its LEDs are at most (radius/range)^2 away in the image, the pose's own tilt moves them by far more."""
    R, p = matrix_from_yaw_pitch_roll(0.0, 0.35, 0.0), np.array([20.0, 0.0, 0.0])
    Q, s = mirrored(R, p, RING)
    apart = CAMERA.pixels_from_points(RING @ R.T + p) - CAMERA.pixels_from_points(RING @ Q.T + s)
    assert 0.0 < np.abs(apart).max() < 2.0 * CAMERA.focal_length_px * (0.25 / 20.0) ** 2


def test_position_for_the_true_attitude_is_exact():
    for R, p in random_poses(50, 1.0, 30.0):
        np.testing.assert_allclose(position_for_attitude(rays(R, p), RING, R), p, rtol=1e-8)


def test_position_is_in_front_of_the_camera_also_when_the_attitude_is_upside_down():
    """Rolled half a turn the ring's LEDs are their opposites, and fit best as far behind the camera."""
    for R, p in random_poses(20, 1.0, 30.0):
        upside_down = R @ exp(np.array([np.pi, 0.0, 0.0]))
        np.testing.assert_allclose(position_for_attitude(rays(R, p), RING, upside_down), p, rtol=1e-8)


def test_position_is_finite_when_all_rays_are_one():
    b = np.tile([1.0, 0.0, 0.0], (4, 1))
    assert np.isfinite(position_for_attitude(b, RING[:4], np.eye(3))).all()


@pytest.mark.parametrize("leds", [[0, 1, 2, 3], [1, 4, 6], [0, 1, 2, 3, 4]])
def test_in_which_axes_the_flat_leds_are_given_does_not_matter(leds):
    """LEDs q = S q' + t: the same rays belong to R S, and to p + R t."""
    S, t = exp(np.array([0.7, -0.9, 0.4])), np.array([0.3, -0.2, 0.5])
    for R, p in random_poses(10, 2.0, 10.0):
        b, points = rays(R, p, RING[leds]), (RING[leds] - t) @ S
        attitudes, positions = two_poses(b, RING[leds])
        turned, moved = two_poses(b, points)
        for k in range(2):
            j = min(range(2), key=lambda j, k=k: angle(turned[j], attitudes[k] @ S))
            np.testing.assert_allclose(turned[j], attitudes[k] @ S, atol=1e-7)
            np.testing.assert_allclose(moved[j], positions[k] + attitudes[k] @ t, atol=1e-7)
        Q, s = mirrored(R, p, RING[leds])
        Q_turned, s_moved = mirrored(R @ S, p + R @ t, points)
        np.testing.assert_allclose(Q_turned, Q @ S, atol=1e-9)
        np.testing.assert_allclose(s_moved, s + Q @ t, atol=1e-9)


@pytest.mark.parametrize("leds", [[0, 1, 2, 3], [1, 4, 6], [0, 1, 2, 3, 4]])
def test_both_are_the_least_squares_fit_of_eq_1_also_near_by(leds):
    """By numpy: 1/d the larger singular value of A, and the LEDs' middle at d (1, m_0) along the mean line of sight."""
    points = RING[leds]
    for R, p in random_poses(10, 0.8, 2.0):
        b = rays(R, p, points)
        along = b.sum(axis=0) / np.linalg.norm(b.sum(axis=0))
        across = np.linalg.svd(along[np.newaxis])[2][1:]
        q = points[:, 1:] - points[:, 1:].mean(axis=0)
        fit = np.linalg.lstsq(np.column_stack([q, np.ones(len(q))]), b @ across.T / (b @ along)[:, np.newaxis])[0]
        d = 1.0 / np.linalg.svd(fit[:2])[1][0]
        middle = d * (along + fit[2] @ across)
        attitudes, positions = two_poses(b, points)
        for Q, s in zip(attitudes, positions, strict=True):
            np.testing.assert_allclose(s + Q @ points.mean(axis=0), middle, atol=1e-9)
            np.testing.assert_allclose(across @ Q[:, 1:], d * fit[:2].T, atol=1e-9)
