"""Where directions are imaged, on the sensor and far beside it."""

from dataclasses import replace

import numpy as np
import pytest

from dockair.calibration import Camera
from dockair.sim.camera.image_point import image_point, image_points, in_field

# In the field it moves light by less than two pixels; from 81 degrees off the axis it would bring it into the frame
FOLDING = replace(Camera(), distortion=(-4.2e-4, -7.7e-4, 0.0, 0.0, 0.0))


def _off_axis(angle_deg: float, about_deg: float) -> np.ndarray:
    angle, about = np.deg2rad([angle_deg, about_deg])
    return np.array([np.cos(angle), np.sin(angle) * np.cos(about), np.sin(angle) * np.sin(about)])


@pytest.mark.parametrize("camera", [Camera(), FOLDING], ids=["pinhole", "distorted"])
@pytest.mark.parametrize("angle_deg", [0.0, 5.0, 20.0])
def test_in_the_field_it_is_the_cameras_own_pixel_to_the_bit(camera: Camera, angle_deg: float) -> None:
    direction = _off_axis(angle_deg, 160.0)
    assert np.array_equal(image_point(camera, direction), camera.pixels_from_points(direction[np.newaxis])[0])


def test_light_from_far_beside_the_axis_stays_far_beside_the_sensor() -> None:
    folded = 0
    for angle_deg in np.arange(30.0, 89.5, 0.05):
        for about_deg in (10.0, 100.0, 160.0, 280.0):
            direction = _off_axis(angle_deg, about_deg)
            u, v = FOLDING.pixels_from_points(direction[np.newaxis])[0]
            folded += 0 <= u < FOLDING.width_px and 0 <= v < FOLDING.height_px
            off_px = np.hypot(*(image_point(FOLDING, direction) - FOLDING.principal_point_px))
            assert off_px == pytest.approx(FOLDING.focal_length_px * np.tan(np.deg2rad(angle_deg)), rel=0.01)
    assert folded > 0  # what the polynomial alone would have shown


@pytest.mark.parametrize("camera", [Camera(), FOLDING], ids=["pinhole", "distorted"])
def test_many_points_are_imaged_as_each_by_itself(camera: Camera) -> None:
    ahead = 3.0 * np.array([_off_axis(angle, 4.0 * angle) for angle in (0.0, 10.0, 25.0, 30.0, 60.0, 81.0, 89.0)])
    pixels = image_points(camera, np.vstack([ahead, -ahead, [[0.0, 1.0, 0.5]]]))
    np.testing.assert_array_equal(pixels[:7], [image_point(camera, p) for p in ahead])
    assert np.isnan(pixels[7:]).all()


def test_the_margin_is_no_step() -> None:
    angles = np.arange(20.0, 40.0, 0.01)
    places = np.array([image_point(FOLDING, _off_axis(angle, 33.0)) for angle in angles])
    steps = np.linalg.norm(np.diff(places, axis=0), axis=1)
    assert np.all(np.abs(np.diff(steps)) < 1e-2)


def test_the_field_ends_a_third_beyond_the_corners() -> None:
    camera = Camera()
    corner = camera.rays_from_pixels(np.array([[0.0, 0.0]]))[0]
    corner_deg = np.degrees(np.arccos(corner[0]))
    about_deg = np.degrees(np.arctan2(corner[2], corner[1]))
    inside = [in_field(camera, _off_axis(angle, about_deg)) for angle in (0.0, corner_deg, corner_deg + 3.0)]
    assert inside == [True, True, True]
    assert not any(in_field(camera, _off_axis(angle, about_deg)) for angle in (corner_deg + 15.0, 89.9, 90.0, 120.0))


def test_the_field_reaches_the_corners_of_a_lens_that_distorts_much() -> None:
    """A barrel of 27 % sees a third farther out at the corners than a lens that does not distort."""
    camera = replace(Camera(), focal_length_m=0.005, distortion=(-0.15, 0.02, 0.0, 0.0, 0.0))
    corners = np.array([[0.0, 0.0], [2047.0, 0.0], [0.0, 1087.0], [2047.0, 1087.0]])
    rays = camera.rays_from_pixels(corners)
    bent = np.hypot(*(corners[0] - camera.principal_point_px)) / camera.focal_length_px
    assert np.hypot(rays[0, 1], rays[0, 2]) / rays[0, 0] > 1.31 * bent
    np.testing.assert_allclose(image_points(camera, 20.0 * rays), corners, rtol=0.0, atol=1e-3)
    assert in_field(camera, rays[0])


@pytest.mark.parametrize("kind", [list, np.array], ids=["list", "array"])
def test_a_sheet_of_lists_or_arrays_images_as_one_of_tuples(kind) -> None:  # type: ignore[no-untyped-def]
    told = Camera(principal_point_px=kind([1020.5, 540.0]), distortion=kind(FOLDING.distortion))
    camera, p = replace(FOLDING, principal_point_px=(1020.5, 540.0)), np.array([_off_axis(20.0, 30.0)])
    assert told == camera
    np.testing.assert_array_equal(image_points(told, p), image_points(camera, p))
