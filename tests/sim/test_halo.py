"""The halo around the Sun: energy in closed form, and the grid with what is added to it against the law itself."""

import numpy as np
import pytest

from dockair.calibration import Camera
from dockair.messages import Window
from dockair.rotations import Array
from dockair.sim.camera.coarse_grid import CoarseGrid, nodes_around
from dockair.sim.camera.electronics import output_gain
from dockair.sim.camera.halo import Halo
from dockair.sim.camera.sheets import CameraSheets

SHARES, CORES, EXPONENTS = np.array([8e-4, 4e-3, 6e-3]), np.array([29.0, 87.0, 13.5]), np.array([1.25, 1.5, 1.5])
SUN_PX = 13.5
HALO = Halo(SHARES, CORES, EXPONENTS, SUN_PX)
EACH = np.array([1e9, 2e9, 3e9])  # electrons of each part, unlike so that none can stand in for another
CENTRE = (703.3, 402.7)


def _grid(window: Window, halo: Halo = HALO) -> CoarseGrid:
    first, shape = nodes_around(window)
    values = np.zeros(shape, dtype=np.float32)
    halo.add_to_grid(values, first, CENTRE, EACH)
    return CoarseGrid(values, first)


def _image(window: Window) -> Array:
    image = np.zeros(window.shape, dtype=np.float32)
    HALO.add_to_pixels(image, (window.row_start, window.column_start), CENTRE, EACH)
    return image


@pytest.mark.parametrize("sun_px", [0.5, 13.5, 40.0])
def test_each_parts_integral_over_the_plane_is_its_share(sun_px: float) -> None:
    r = np.geomspace(1e-3, 1e5, 40_000)
    density = Halo(SHARES, CORES, EXPONENTS, sun_px).densities(r)
    inside = np.trapezoid(2.0 * np.pi * r**2 * density, np.log(r), axis=1)
    beyond = SHARES * (1.0 + (r[-1] / CORES) ** 2) ** (1.0 - EXPONENTS)  # Eq. (2), the disc a point from there
    assert inside + beyond == pytest.approx(SHARES, rel=1e-4)
    assert beyond[0] > 0.01 * SHARES[0]  # the wide part is far from all inside: the closed form counts


def test_from_a_point_it_is_the_law_itself() -> None:
    r = np.array([0.0, 5.0, 29.0, 300.0])
    density = Halo(SHARES[:1], CORES[:1], EXPONENTS[:1], 1e-6).densities(r)[0]
    assert density == pytest.approx(8e-4 * 0.25 / (np.pi * 29.0**2) * (1.0 + (r / 29.0) ** 2) ** -1.25, rel=1e-9)


def test_around_a_disc_it_is_the_mean_of_the_law_over_the_disc() -> None:
    rng = np.random.default_rng(3)
    radius, angle = SUN_PX * np.sqrt(rng.uniform(size=400_000)), rng.uniform(0.0, 2.0 * np.pi, 400_000)
    for r in (0.0, 10.0, 20.0):
        d2 = (r + radius * np.cos(angle)) ** 2 + (radius * np.sin(angle)) ** 2
        sample = 6e-3 * 0.5 / (np.pi * 13.5**2) * (1.0 + d2 / 13.5**2) ** -1.5
        sigma = sample.std() / np.sqrt(sample.size)
        # 5 sigma: false alarm 6e-7
        assert abs(HALO.densities(np.array([r]))[2, 0] - sample.mean()) < 5.0 * sigma


def test_grid_and_pixels_together_are_the_law_at_every_distance() -> None:
    window = Window(0, 1088, 0, 2048)
    grid, image = _grid(window), _image(window)
    rng = np.random.default_rng(4)
    pixels = np.vstack([rng.integers(0, [2048, 1088], (2000, 2)), rng.integers([600, 300], [806, 505], (6000, 2))])
    got = grid.at(pixels.astype(float)) + image[pixels[:, 1], pixels[:, 0]]
    law = EACH @ HALO.densities(np.hypot(pixels[:, 0] - CENTRE[0], pixels[:, 1] - CENTRE[1]))
    error = np.abs(got / law - 1.0)
    assert error.max() < 0.025  # just outside r_b, where the grid is on its own
    assert np.sqrt(np.mean(error**2)) < 0.008


@pytest.mark.parametrize(("sun_px", "near_px"), [(0.5, 96.0), (13.5, 96.0), (24.0, 96.0), (40.0, 160.0)])
def test_pixel_by_pixel_it_is_drawn_as_far_as_96_pixels_or_four_radii_of_the_disc(
    sun_px: float, near_px: float
) -> None:
    assert Halo(SHARES, CORES, EXPONENTS, sun_px).near_px == near_px


def test_nothing_is_taken_away_pixel_by_pixel() -> None:
    """The grid alone never exceeds the law: what is left to add is positive and ends where it should."""
    image = _image(Window(0, 1088, 0, 2048))
    v, u = np.indices(image.shape)
    r = np.hypot(u - CENTRE[0], v - CENTRE[1])
    assert image.min() >= 0.0
    assert np.all(image[r < HALO.near_px - 2.0] > 0.0)
    assert not image[r > HALO.near_px + 0.1].any()


def test_the_grid_carries_the_parabola_that_continues_the_law_with_its_slope() -> None:
    """Its slope by a difference quotient of the law; nodes within r_b only."""
    b, step = HALO.near_px, 1e-3
    low, at_b, high = EACH @ HALO.densities(np.array([b - step, b, b + step]))
    grid = _grid(Window(0, 1088, 0, 2048))
    v, u = 8.0 * (np.indices(grid.values.shape) + np.reshape(grid.first, (2, 1, 1)))
    r = np.hypot(u - CENTRE[0], v - CENTRE[1])
    near = r < b - 2.0
    parabola = at_b + (high - low) / (2.0 * step) * (r[near] ** 2 - b**2) / (2.0 * b)
    assert near.sum() > 300
    np.testing.assert_allclose(grid.values[near], parabola, rtol=1e-4)


def test_far_out_each_part_falls_by_its_own_power() -> None:
    near, far = HALO.densities(np.array([3000.0, 6000.0])).T
    assert np.log2(near / far) == pytest.approx(2.0 * EXPONENTS, abs=2e-3)


def test_an_image_of_the_sun_far_outside_leaves_its_tail() -> None:
    first, shape = nodes_around(Window(0, 1088, 0, 2048))
    values = np.zeros(shape, dtype=np.float32)
    HALO.add_to_grid(values, first, (1e9, 500.0), EACH)
    assert np.all(np.isfinite(values))
    assert values.max() < 1e-3


def test_a_windows_halo_is_the_full_frames_bit_for_bit() -> None:
    full = Window(0, 1088, 0, 2048)
    grid, image = _grid(full), _image(full)
    rng = np.random.default_rng(5)
    for _ in range(60):
        r, c = int(rng.integers(280, 500)), int(rng.integers(560, 800))
        window = Window(r, r + int(rng.integers(1, 90)), c, c + int(rng.integers(1, 90)))
        part = _grid(window)
        i, j = part.first
        m, n = part.values.shape
        assert np.array_equal(part.values, grid.values[i : i + m, j : j + n])
        assert np.array_equal(_image(window), image[window.row_start : window.row_stop, c : window.column_stop])


def test_an_leds_halo_stays_below_a_grey_level() -> None:
    """The module leaves it out: 5e4 electrons, halo of surfaces and dust, 53 e- a grey level of eight bits."""
    led = Halo(SHARES[:2], CORES[:2], EXPONENTS[:2], 0.5).densities(np.array([0.0, 5.0])).sum(axis=0) * 5e4
    assert led.max() < 53.0 / 40.0


def test_the_halo_of_an_led_is_as_faint_as_stated() -> None:
    """Eq. (1) with the sheet's shares and cores: 5e4 e- make 0.008 e- in a pixel 5 px off, far below a grey level."""
    sheets = CameraSheets.load()
    glare, focal_px = sheets.glare, Camera().focal_length_px
    led = Halo(glare.halo_share, glare.halo_core_rad * focal_px, glare.halo_exponent, 0.0)
    electrons = 5e4 * float(led.densities(np.array([5.0])).sum())
    assert electrons == pytest.approx(0.0078, abs=5e-5)
    assert electrons * output_gain(sheets.sensor) == pytest.approx(1.5e-4, rel=0.05)
