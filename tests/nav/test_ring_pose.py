"""The least-squares pose of a ring and the candidates on it."""

import numpy as np
import pytest

from dockair.nav.identify.ring_pose import normal_equations, orthonormalise, project
from dockair.rotations import exp


def image_of(pose):
    image = np.empty((9, 2))
    project(pose, image)
    return image


def test_the_normal_equations_hold_the_derivatives_of_the_image():
    """Every derivative by central differences, shift and turn alike; an empty slot has none."""
    rng = np.random.default_rng(33)
    pose = np.vstack([[9.0, 0.8, -0.5], exp(np.array([0.3, -0.4, 0.5]))[:, 1:].T])
    orthonormalise(pose)
    points = image_of(pose)[:8] + 0.01 * rng.standard_normal((8, 2))
    candidate = np.array([0, 1, -1, 3, 4, 5, -1, 7])
    filled = np.flatnonzero(candidate >= 0)

    def image(step):
        moved = pose.copy()
        moved[0] += step[:3]
        moved[1:] = moved[1:] @ exp(step[3:]).T
        return image_of(moved)[filled].ravel()

    h = 1e-5
    J = np.column_stack([(image(e) - image(-e)) / (2.0 * h) for e in h * np.eye(6)])
    N, g = np.empty((6, 6)), np.empty((6, 1))
    normal_equations(points, candidate, pose, image_of(pose), N, g)
    np.testing.assert_allclose(np.triu(N), np.triu(J.T @ J), rtol=1e-6, atol=1e-9)
    np.testing.assert_allclose(g[:, 0], J.T @ (points[filled].ravel() - image(np.zeros(6))), rtol=1e-6, atol=1e-9)


def test_orthonormal_axes_stay_in_their_plane():
    rng = np.random.default_rng(36)
    for _ in range(20):
        pose = rng.standard_normal((3, 3))
        before = pose.copy()
        orthonormalise(pose)
        np.testing.assert_allclose(pose[1:] @ pose[1:].T, np.eye(2), atol=1e-12)
        np.testing.assert_allclose(np.cross(*pose[1:]) @ before[1:].T, 0.0, atol=1e-12)
        assert pose[1] @ before[1] > 0.0 and pose[2] @ before[2] > 0.0


def test_a_slot_behind_the_camera_has_an_image_far_off_and_none_that_is_mirrored():
    """A ring in the plane of the line of sight, half a radius ahead: slot 4 is half a radius behind the camera."""
    image = image_of(np.array([[0.5, 0.1, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]]))
    assert image[0, 0] == pytest.approx(-0.1 / 1.5)
    assert image[4, 0] < -1e4  # mirrored: 0.2
