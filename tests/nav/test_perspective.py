"""The exact image of a tilted ring, fitted."""

import numpy as np
import pytest

from dockair.calibration import Camera, LedRing
from dockair.nav.identify.perspective import distorted, fit_ring, undistorted, undistorted_prediction
from dockair.rotations import matrix_from_yaw_pitch_roll

CAMERA = Camera()
TOLERANCES = {"tolerance_px": 0.5, "tolerance_per_radius": 0.005}


def fit(points, slots):
    return fit_ring(points, slots, CAMERA.focal_length_px, CAMERA.principal_point_px, **TOLERANCES)


def test_the_exact_image_of_a_tilted_ring_is_fitted_to_rounding(ring_scene):
    """Range in radii, centre and every LED of an exact projection come back from five LEDs or more."""
    rng = np.random.default_rng(23)
    for _ in range(100):
        scene = ring_scene(rng, visible=8, sigma_px=0.0)
        slots = np.full(8, -1)
        seen = rng.permutation(8)[: rng.integers(5, 9)]
        slots[seen] = [int(np.flatnonzero(scene.numbers == k)[0]) for k in seen]
        found = fit(scene.points, slots)
        assert found.count == 8  # the hidden ones are taken up again
        np.testing.assert_allclose(found.slots_px, scene.led_px, atol=5e-3)
        np.testing.assert_allclose(found.centre_px, scene.centre_px, atol=5e-3)
        assert found.radius_px == pytest.approx(scene.radius_px, rel=2e-4)


def test_the_tilt_is_that_between_the_axes(ring_scene):
    rng = np.random.default_rng(31)
    for _ in range(20):
        scene = ring_scene(rng, visible=8, sigma_px=0.0, range_m=(2.2, 4.0))  # near: the mirrored tilt fits worse
        found = fit(scene.points, np.argsort(scene.numbers))
        assert found.tilt_rad == pytest.approx(np.arccos(scene.R_CD[0, 0]), abs=2e-3)


def test_a_frontal_ring_has_no_tilt_however_it_is_turned():
    """Half of them have a cosine of the tilt above 1, by rounding."""
    for turn in np.linspace(0.0, 2.0 * np.pi, 50):
        p_CL = np.array([6.0, 0.0, 0.0]) + LedRing().positions_D @ matrix_from_yaw_pitch_roll(0.0, 0.0, turn).T
        assert fit(CAMERA.pixels_from_points(p_CL), np.arange(8)).tilt_rad < 1e-6


def test_an_impostor_in_a_slot_is_dropped_and_the_true_led_taken_up(ring_scene):
    rng = np.random.default_rng(32)
    for _ in range(30):
        scene = ring_scene(rng, visible=8, sigma_px=0.0, range_m=(2.2, 8.0))
        slots, points = np.argsort(scene.numbers), np.vstack([scene.points, [0.0, 0.0]])
        points[8] = points[slots[3]] + scene.radius_px * np.array([0.3, -0.2])
        mistaken = slots.copy()
        mistaken[3] = 8
        np.testing.assert_array_equal(fit(points, mistaken).candidate, slots)


def test_points_between_the_slots_lie_on_the_image_of_the_same_circle(ring_scene):
    """`image_px` at the slots' angles gives the slots; between them points of the ring in space, by the camera."""
    rng = np.random.default_rng(34)
    scene = ring_scene(rng, visible=8, sigma_px=0.0, range_m=(2.5, 6.0))
    found = fit(scene.points, np.argsort(scene.numbers))
    np.testing.assert_allclose(found.image_px(np.arange(8) * np.pi / 4), found.slots_px, atol=1e-9)
    angle = rng.uniform(0.0, 2.0 * np.pi, 5)
    p_DL = 0.25 * np.column_stack([np.zeros(5), np.cos(angle), np.sin(angle)])
    np.testing.assert_allclose(
        found.image_px(angle), CAMERA.pixels_from_points(scene.p_CD + p_DL @ scene.R_CD.T), atol=5e-3
    )


def test_of_two_poses_alike_the_one_within_the_tilt_is_taken():
    """18 deg off the axis, tilted 30 deg the other way, the mirrored pose is tilted by 66: noise must not choose it."""
    rng = np.random.default_rng(35)
    limit, number = np.deg2rad(40.0), np.array([0, 1, 2, 3, 4])
    p_CL = 28.0 * np.array([1.0, 0.33, 0.0]) + LedRing().positions_D @ matrix_from_yaw_pitch_roll(-0.52, 0.0, 0.4).T
    slots = np.full(8, -1)
    slots[number] = np.arange(5)
    free, bounded = [], []
    for _ in range(100):
        points = CAMERA.pixels_from_points(p_CL)[number] + 0.1 * rng.standard_normal((5, 2))
        free.append(fit(points, slots).tilt_rad)
        camera = CAMERA.focal_length_px, CAMERA.principal_point_px
        bounded.append(fit_ring(points, slots, *camera, **TOLERANCES, max_tilt_rad=limit).tilt_rad)
    assert (np.array(free) > limit).sum() >= 5  # the limit is needed
    assert (np.array(bounded) <= limit).all()


def test_the_rms_is_over_the_degrees_of_freedom_and_none_without_any(ring_scene):
    """Six are fitted: of eight LEDs ten are left, of four two, of three none."""
    scene = ring_scene(np.random.default_rng(34), visible=8)
    slots = np.argsort(scene.numbers)
    for leds, freedom in ((8, 10), (4, 2), (3, 0)):
        points = scene.points[slots[:leds]]
        found = fit(points, np.where(np.arange(8) < leds, np.arange(8), -1))
        assert found.count == leds
        squares = ((points - found.slots_px[:leds]) ** 2).sum()
        assert found.rms_px == pytest.approx(np.sqrt(squares / freedom) if freedom else 0.0)


def test_a_prediction_in_which_no_ray_makes_an_led_is_left_as_it_is():
    camera = Camera(distortion=(-0.3, 0.0, 0.0, 0.0, 0.0))
    near = np.array(camera.principal_point_px) + np.array([[300.0, 100.0], [-200.0, 50.0]])
    assert np.abs(undistorted_prediction(near, camera) - near).max() > 0.5
    beyond = np.vstack([near, np.array(camera.principal_point_px) + [20000.0, 0.0]])
    assert np.isnan(undistorted(beyond, camera)[2]).all()
    np.testing.assert_array_equal(undistorted_prediction(beyond, camera), beyond)


def test_a_pixel_whose_ray_runs_away_by_its_length_alone_is_not_finite_and_warns_of_nothing():
    """The squares of its slopes overflow, the slopes do not."""
    camera = Camera(distortion=(-0.09, 0.11, 5e-4, -3e-4, 0.0))
    far = np.array(camera.principal_point_px) + [[-5866.3, 0.0]]
    assert not np.isfinite(undistorted(far, camera)).any()


def test_the_tolerance_is_the_caller_s_and_the_ring_s_own_in_the_root_of_squares(ring_scene):
    scene = ring_scene(np.random.default_rng(40), visible=8, range_m=(3.0, 5.0))
    found = fit(scene.points, np.argsort(scene.numbers))
    assert found.tolerance_px == pytest.approx(np.hypot(0.5, 0.005 * found.radius_px), rel=1e-9)


def test_pixels_without_distortion_are_those_of_the_same_camera_without_it():
    """Both ways, for points all over the frame; a camera without distortion leaves the very pixels."""
    lens = Camera(distortion=(-0.15, 0.05, 1e-3, -5e-4, 0.01), principal_point_px=(1010.0, 550.0))
    pinhole = Camera(principal_point_px=lens.principal_point_px)
    rng = np.random.default_rng(41)
    p_CL = 7.0 * np.column_stack([np.ones(50), rng.uniform(-0.35, 0.35, 50), rng.uniform(-0.18, 0.18, 50)])
    bent, straight = lens.pixels_from_points(p_CL), pinhole.pixels_from_points(p_CL)
    assert np.abs(bent - straight).max() > 5.0
    np.testing.assert_allclose(undistorted(bent, lens), straight, atol=1e-6)
    np.testing.assert_allclose(distorted(straight, lens), bent, atol=1e-6)
    for convert in (undistorted, distorted):
        assert convert(straight, pinhole) is straight
