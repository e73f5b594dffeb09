"""Where a drogue must be for the camera to see it, checked by the pixels that the camera's own model gives."""

import numpy as np
import pytest

from dockair.calibration import Camera, Mounting
from dockair.nav.guidance.field_of_view import FieldOfView
from dockair.rotations import exp

CAMERA = Camera(principal_point_px=(1000.0, 560.0))
ARMS = {"p_BC": np.array([2.0, 0.3, 1.0]), "p_BP": np.array([5.0, -0.4, 0.6])}
MOUNTINGS = [Mounting(R_BC=exp(np.array(turn)), **ARMS) for turn in ((0.0, 0.0, 0.0), (0.1, -0.2, 0.15))]
LEFT, UPPER, RIGHT, LOWER = (-0.5, 543.5), (1023.5, -0.5), (2047.5, 543.5), (1023.5, 1087.5)


def place(mounting, pixel, depth_m):
    """(3,) from the probe's tip, of what a pixel shows at a depth."""
    ray_C = CAMERA.rays_from_pixels(np.array([pixel]))[0]
    return mounting.R_BC @ (ray_C * depth_m / ray_C[0]) + mounting.p_BC - mounting.p_BP


def pixel(mounting, p_PD_B):
    return CAMERA.pixels_from_points(mounting.R_BC.T @ (p_PD_B + mounting.p_BP - mounting.p_BC))[0]


@pytest.mark.parametrize("mounting", MOUNTINGS)
@pytest.mark.parametrize("depth_m", [3.0, 8.0, 30.0])
@pytest.mark.parametrize(
    ("at", "axis", "value"), [(LEFT, 0, -0.5), (UPPER, 1, -0.5), (RIGHT, 0, 2047.5), (LOWER, 1, 1087.5)]
)
def test_a_drogue_within_the_field_goes_out_by_the_shortest_way_over_the_edge_it_was_near_to(
    mounting, depth_m, at, axis, value
):
    field = FieldOfView(CAMERA, mounting)
    middle = np.array([1023.5, 543.5])
    edge = field.nearest_edge(place(mounting, middle + 0.95 * (np.array(at) - middle), depth_m))
    for share in (0.9, 0.3, -0.5):
        p_PD_B = place(mounting, middle + share * (np.array(at) - middle) + [7.0, -3.0], depth_m)
        out_m = field.out_m(p_PD_B, edge)
        assert pixel(mounting, p_PD_B + out_m)[axis] == pytest.approx(value, abs=1e-6)
        along_edge = place(mounting, np.array(at) + (50.0, 80.0)[axis] * np.eye(2)[1 - axis], depth_m)
        assert out_m @ (along_edge - place(mounting, at, depth_m)) == pytest.approx(0.0, abs=1e-9)


@pytest.mark.parametrize("mounting", MOUNTINGS)
def test_a_drogue_outside_has_no_way_to_go_whatever_edge_it_left_by(mounting):
    field = FieldOfView(CAMERA, mounting)
    for beyond in ((-20.0, 500.0), (2070.0, 500.0), (900.0, -20.0), (900.0, 1110.0)):
        for edge in range(4):
            np.testing.assert_array_equal(field.out_m(place(mounting, beyond, 6.0), edge), np.zeros(3))


def test_what_is_behind_the_camera_is_in_no_field():
    field = FieldOfView(CAMERA, MOUNTINGS[0])
    behind = -np.array([8.0, 0.0, 0.0]) + MOUNTINGS[0].p_BC - MOUNTINGS[0].p_BP
    assert not field.out_m(behind, 0).any()


def test_of_a_drogue_that_is_outside_already_the_edge_it_is_farthest_beyond_is_the_one():
    mounting = MOUNTINGS[1]
    field = FieldOfView(CAMERA, mounting)
    near = field.nearest_edge(place(mounting, (1023.5, 1080.0), 6.0))
    assert field.nearest_edge(place(mounting, (1500.0, 1400.0), 6.0)) == near
    assert field.nearest_edge(place(mounting, (20.0, 600.0), 6.0)) != near
