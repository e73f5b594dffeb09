"""The ring after a turn of the camera, against the pinhole and against rotations written out."""

import numpy as np
import pytest

from dockair.calibration import Camera
from dockair.nav.track_kernels import ahead, innovation_squared, predicted, process_noise, turn, turned
from dockair.rotations import exp

CAMERA, RADIUS_M = Camera(), 0.25


@pytest.mark.parametrize("angle_rad", [0.0, 1e-9, 1e-3, 0.1])
@pytest.mark.parametrize("lever_C", [np.zeros(3), np.array([3.0, -0.5, 0.8])])
def test_a_ring_at_rest_is_seen_where_the_pinhole_puts_it_after_a_turn(angle_rad, lever_C):
    rng, f = np.random.default_rng(0), CAMERA.focal_length_px
    for _ in range(20):
        axis = rng.standard_normal(3)
        turn = angle_rad * axis / np.sqrt(axis @ axis)
        p_C = np.array([rng.uniform(3.0, 20.0), *rng.uniform(-0.5, 0.5, 2)])
        u, v = CAMERA.pixels_from_points(p_C)[0]
        after_C = exp(turn).T @ (p_C + lever_C) - lever_C
        state = np.array([u, v, f * RADIUS_M / p_C[0], 0.3, 0.0, 0.0, 0.0, 0.0])
        ours = turned(state, turn, f, CAMERA.principal_point_px, RADIUS_M, lever_C)
        np.testing.assert_allclose(ours[:2], CAMERA.pixels_from_points(after_C)[0], atol=1e-8)
        assert ours[2] == pytest.approx(f * RADIUS_M / after_C[0], rel=1e-12)


@pytest.mark.parametrize(("turn_rad", "after_m"), [(0.0, 0.5), (np.pi, 0.1)])
def test_a_ring_that_a_turn_brings_behind_the_lens_is_taken_to_be_just_ahead_of_it(turn_rad, after_m):
    """0.5 m ahead of a camera 3 m ahead of what it turns about: half a turn brings it 6.5 m behind."""
    optics, lever_C = (CAMERA.focal_length_px, CAMERA.principal_point_px, RADIUS_M), np.array([3.0, 0.0, 0.0])
    state = np.array([*CAMERA.principal_point_px, CAMERA.focal_length_px * RADIUS_M / 0.5, 0.0, 0.0, 0.0, 0.0, 0.0])
    r = turned(state, np.array([0.0, 0.0, turn_rad]), *optics, lever_C)[2]
    assert r == pytest.approx(CAMERA.focal_length_px * RADIUS_M / after_m)


def test_roll_about_the_boresight_turns_the_image_the_other_way():
    state = np.array([*CAMERA.principal_point_px, 100.0, 0.0, 0.0, 0.0, 0.0, 0.0])
    turn = np.array([0.02, 0.0, 0.0])
    u, v, r, roll = turned(state, turn, CAMERA.focal_length_px, CAMERA.principal_point_px, RADIUS_M, np.zeros(3))
    assert (u, v, r, roll) == pytest.approx((*CAMERA.principal_point_px, 100.0, -0.02))


@pytest.mark.parametrize("turn", [(0.0, 1e-3, 0.0), (0.0, 0.0, 1e-3), (5e-4, 1e-3, -7e-4)])
def test_off_the_axis_the_image_rolls_by_half_the_curl_of_its_flow(turn):
    """By central differences of the pinhole's pixels; what is left is of second order in the turn."""
    at = np.array([300.0, 900.0])

    def after(pixel):
        return CAMERA.pixels_from_points(CAMERA.rays_from_pixels(pixel[None]) @ exp(np.array(turn)))[0]

    along_u, along_v = (0.5 * (after(at + step) - after(at - step)) for step in np.eye(2))
    state = np.array([*at, 100.0, 0.0, 0.0, 0.0, 0.0, 0.0])
    optics = CAMERA.focal_length_px, CAMERA.principal_point_px, RADIUS_M
    assert turned(state, np.array(turn), *optics, np.zeros(3))[3] == pytest.approx(
        0.5 * (along_u[1] - along_v[0]), abs=2e-6
    )


def test_prediction_is_the_constant_velocity_model_written_out():
    rng, dt = np.random.default_rng(1), 0.02
    shape = rng.standard_normal((8, 8))
    x, P, Q = rng.standard_normal(8), shape @ shape.T, process_noise(80.0, dt, 0.01, 8.0, 4.0)
    F = np.eye(8) + dt * np.eye(8, k=4)
    places, sigma = predicted(x, P, dt, Q)
    np.testing.assert_allclose(places, (F @ x)[:4], rtol=1e-12)
    np.testing.assert_allclose(sigma**2, np.diag(F @ P @ F.T + Q)[:4], rtol=1e-12)
    np.testing.assert_allclose(Q[0, [0, 4]], [0.01 + 0.25 * dt**4 * 640.0**2, 0.5 * dt**3 * 640.0**2], rtol=1e-12)
    np.testing.assert_allclose(Q[3, [3, 7]], [0.01 / 6400.0 + 4.0 * dt**4, 8.0 * dt**3], rtol=1e-12)


def test_the_ring_of_the_next_window_is_predicted_first_and_turned_then():
    rng, dt, optics = np.random.default_rng(2), 0.02, (CAMERA.focal_length_px, CAMERA.principal_point_px, RADIUS_M)
    shape, noise, turn_C, lever_C = (
        rng.standard_normal((8, 8)),
        (0.01, 8.0, 4.0),
        np.array([0.02, 0.01, -0.03]),
        np.ones(3),
    )
    x, P = np.array([900.0, 500.0, 80.0, 0.3, 40.0, -30.0, 5.0, 0.2]), shape @ shape.T
    places, sigma = predicted(x, P, dt, process_noise(80.0, dt, *noise))
    u, v, r, ours = ahead(x, P, dt, noise, turn_C, *optics, lever_C)
    assert (u, v) == turned(places, turn_C, *optics, lever_C)[:2]
    assert r == places[2] and (ours == sigma).all()


def test_a_turn_about_the_boresight_turns_the_velocity_with_the_image():
    x = np.array([*CAMERA.principal_point_px, 100.0, 0.5, 30.0, 40.0, 0.0, 0.0])
    turn(x, np.array([0.02, 0.0, 0.0]), CAMERA.focal_length_px, CAMERA.principal_point_px, RADIUS_M, np.zeros(3))
    velocity = (30.0 + 40.0j) * np.exp(-0.02j)
    np.testing.assert_allclose(x[3:6], [0.48, velocity.real, velocity.imag], rtol=1e-12)


def test_the_innovation_s_square_is_that_of_centre_and_radius_alone():
    rng = np.random.default_rng(3)
    shape, x, z, variance = (
        rng.standard_normal((8, 8)),
        rng.standard_normal(8),
        rng.standard_normal(4),
        np.arange(1.0, 5.0),
    )
    P = shape @ shape.T
    S = P[:3, :3] + np.diag(variance[:3])
    assert innovation_squared(z, x, P, variance) == pytest.approx((z - x[:4])[:3] @ np.linalg.inv(S) @ (z - x[:4])[:3])
    assert np.isnan(innovation_squared(np.full(4, np.nan), x, P, variance))
    assert np.isnan(innovation_squared(z, x, np.full((8, 8), np.inf), variance))
