"""The Sun's disc: an ellipse whose light is counted, against rays traced back from the pixels."""

import numpy as np
import pytest

from dockair.calibration import Camera
from dockair.sim.camera.sun_disc import add_disc, image_of_disc

RADIUS_RAD = 4.65e-3
ELECTRONS = 1e6
STRAIGHT = Camera()
BENT = Camera(distortion=(-0.25, 0.08, 1e-3, -5e-4, 0.0))
PLACES = [(1023.5, 543.5), (60.3, 40.8), (2000.0, 700.5), (1500.25, 1040.75)]


def _sun(camera: Camera, place: tuple[float, float]) -> np.ndarray:
    return camera.rays_from_pixels(np.array([place]))[0]


def _picture(camera: Camera, place: tuple[float, float], sigma: float) -> tuple[np.ndarray, tuple[int, int]]:
    """100 x 100 pixels around a place."""
    start = int(place[1]) - 50, int(place[0]) - 50
    image = np.zeros((100, 100), dtype=np.float32)
    disc = image_of_disc(camera, _sun(camera, place), RADIUS_RAD)
    add_disc(image, start, disc, ELECTRONS, np.ones((100, 100)), start, sigma)
    return image, start


@pytest.mark.parametrize("camera", [STRAIGHT, BENT])
@pytest.mark.parametrize("place", PLACES)
@pytest.mark.parametrize("sigma", [0.5, 0.7, 2.0])
def test_all_the_light_of_the_disc_is_in_the_image(camera: Camera, place: tuple[float, float], sigma: float) -> None:
    image, _ = _picture(camera, place, sigma)
    assert image.sum(dtype=float) == pytest.approx(ELECTRONS, rel=5e-4)


@pytest.mark.parametrize("camera", [STRAIGHT, BENT])
@pytest.mark.parametrize("place", PLACES)
def test_the_disc_covers_the_pixels_whose_rays_meet_the_sun(camera: Camera, place: tuple[float, float]) -> None:
    """The inverse of the projection, 8 x 8 rays a pixel, against the ellipse; only edge pixels may differ."""
    image, start = _picture(camera, place, 0.05)  # next to no blur
    fine = (np.arange(800) + 0.5) / 8.0 - 0.5
    u, v = np.meshgrid(start[1] + fine, start[0] + fine)
    sun = _sun(camera, place)
    cos_angle = camera.rays_from_pixels(np.column_stack([u.ravel(), v.ravel()])) @ sun
    inside = (cos_angle >= np.cos(RADIUS_RAD)).reshape(100, 8, 100, 8).mean(axis=(1, 3))
    level = ELECTRONS / inside.sum()
    assert image.max() == pytest.approx(level, rel=2e-3)
    assert np.abs(image / level - inside).max() < 0.75  # a pixel at the edge is in or out in one, shared in the other
    whole = (inside == 0.0) | (inside == 1.0)
    assert np.mean(np.abs(image / level - inside)[whole] > 0.01) < 5e-4


@pytest.mark.parametrize("place", PLACES)
def test_its_brightness_falls_with_the_fourth_power_of_the_cosine(place: tuple[float, float]) -> None:
    """[radiometry, eq 5], which this module does not use: light F cos t over the ellipse's area."""
    sun = _sun(STRAIGHT, place)
    _, shape = image_of_disc(STRAIGHT, sun, RADIUS_RAD)
    on_axis = np.pi * (STRAIGHT.focal_length_px * RADIUS_RAD) ** 2
    level = sun[0] / (np.pi * np.linalg.det(shape))
    assert abs(level) == pytest.approx(sun[0] ** 4 / on_axis, rel=1e-6)


def test_on_the_axis_it_is_27_pixels_wide() -> None:
    image, _ = _picture(STRAIGHT, (1023.5, 543.5), 0.6)
    half = image > 0.5 * image.max()
    assert 2.0 * np.sqrt(half.sum() / np.pi) == pytest.approx(27.05, abs=0.1)


@pytest.mark.parametrize("camera", [STRAIGHT, BENT])
@pytest.mark.parametrize("place", PLACES)
def test_its_centre_is_where_the_lens_images_the_sun(camera: Camera, place: tuple[float, float]) -> None:
    image, start = _picture(camera, place, 0.7)
    rows, columns = np.indices(image.shape)
    total = image.sum(dtype=float)
    centre = (image * columns).sum() / total + start[1], (image * rows).sum() / total + start[0]
    assert centre == pytest.approx(place, abs=0.02)


def test_the_pixel_in_its_very_middle_is_as_bright_as_the_others() -> None:
    image, start = _picture(STRAIGHT, (1020.0, 540.0), 0.7)
    middle = image[540 - start[0], 1020 - start[1]]
    assert middle == pytest.approx(image[540 - start[0], 1022 - start[1]], rel=1e-6) and middle > 0.0


def test_its_edge_is_as_soft_as_asked() -> None:
    """Along a row through the middle the edge is the normal distribution's integral: 16 to 84 % is 2 sigma."""
    image, _ = _picture(STRAIGHT, (1023.5, 543.0), 2.5)
    row = image[50] / image[50, 50]
    at = np.interp([1.0 - 0.8413, 1.0 - 0.1587], 1.0 - row[50:80], np.arange(30))
    assert at[1] - at[0] == pytest.approx(5.0, rel=0.02)


def test_hidden_pixels_stay_dark_and_dimmed_ones_are_dimmed() -> None:
    disc = image_of_disc(STRAIGHT, _sun(STRAIGHT, (500.5, 400.0)), RADIUS_RAD)
    seen = np.zeros((60, 60))
    seen[:, 31:] = 0.25  # right of the middle, from column 501
    image = np.zeros((1088, 2048), dtype=np.float32)
    add_disc(image, (0, 0), disc, ELECTRONS, seen, (370, 470), 0.7)
    assert not image[:, :501].any()
    assert image.sum(dtype=float) == pytest.approx(0.125 * ELECTRONS, rel=1e-3)


def test_in_a_window_the_disc_is_the_full_frames_bit_for_bit() -> None:
    disc = image_of_disc(BENT, _sun(BENT, (500.3, 400.8)), RADIUS_RAD)
    seen = np.random.default_rng(1).uniform(size=(60, 60))

    def draw(start: tuple[int, int], shape: tuple[int, int]) -> np.ndarray:
        image = np.full(shape, 0.1, dtype=np.float32)
        add_disc(image, start, disc, ELECTRONS, seen, (371, 471), 0.7)
        return image

    full = draw((0, 0), (1088, 2048))
    for row in range(380, 420, 7):
        for column in range(475, 520, 5):
            assert np.array_equal(draw((row, column), (23, 17)), full[row : row + 23, column : column + 17])
