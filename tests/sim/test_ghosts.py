"""Ghosts of the Sun: where they stand, how much light they hold, what shape they have."""

import numpy as np
import pytest

from dockair.messages import Window
from dockair.sim.camera.coarse_grid import CoarseGrid, nodes_around
from dockair.sim.camera.ghosts import Ghosts
from dockair.sim.camera.iris import Iris

CENTRE = (1023.5, 543.5)
SUN = np.array([700.3, 400.6])
FULL = Window(0, 1088, 0, 2048)


def _one(blades: int, position: float, pupil_px: float, sun_px: float = 13.5) -> Ghosts:
    iris = Iris(blades=blades, angle_rad=0.3)
    return Ghosts(iris, np.array([position]), np.array([1e-4]), np.array([pupil_px]), sun_px, CENTRE)


def _coarse(ghosts: Ghosts, sun: np.ndarray = SUN, window: Window = FULL) -> CoarseGrid:
    first, shape = nodes_around(window)
    values = np.zeros(shape, dtype=np.float32)
    ghosts.add_to_grid(values, first, sun, 1e9)
    return CoarseGrid(values, first)


def _fine(ghosts: Ghosts, sun: np.ndarray = SUN, window: Window = FULL) -> np.ndarray:
    image = np.zeros(window.shape, dtype=np.float32)
    ghosts.add_to_pixels(image, (window.row_start, window.column_start), sun, 1e9)
    return image


def test_a_ghost_stands_on_the_line_from_the_sun_through_the_centre() -> None:
    ghosts = Ghosts(
        Iris(blades=6, angle_rad=0.0), np.array([1.0, 0.5, -0.4]), np.full(3, 1e-5), np.full(3, 50.0), 13.5, CENTRE
    )
    opposite, half, same = ghosts.places(SUN)
    assert opposite == pytest.approx(2.0 * np.array(CENTRE) - SUN)
    assert half == pytest.approx(1.5 * np.array(CENTRE) - 0.5 * SUN)
    assert same == pytest.approx(0.6 * np.array(CENTRE) + 0.4 * SUN)


@pytest.mark.parametrize("blades", [0, 3, 5, 6, 9])
@pytest.mark.parametrize(("position", "pupil_px"), [(0.2, 60.0), (1.0, 60.0), (1.4, 170.0), (0.7, 250.0)])
def test_a_large_ghosts_light_is_its_share_of_the_suns(blades: int, position: float, pupil_px: float) -> None:
    for shift in ([0.0, 0.0], [2.7, 5.1]):
        grid = _coarse(_one(blades, position, pupil_px), SUN + shift)
        assert 64.0 * grid.values.sum(dtype=float) == pytest.approx(1e-4 * 1e9, rel=5e-3)


@pytest.mark.parametrize("blades", [0, 3, 6])
@pytest.mark.parametrize(("position", "pupil_px"), [(0.25, 0.0), (0.02, 0.0), (0.55, 3.4), (1.0, 11.4), (0.3, 12.0)])
def test_a_compact_ghosts_light_is_its_share_of_the_suns(blades: int, position: float, pupil_px: float) -> None:
    for shift in ([0.0, 0.0], [0.7, 1.3]):
        ghosts = _one(blades, position, pupil_px)
        assert _fine(ghosts, SUN + shift).sum(dtype=float) == pytest.approx(1e5, rel=0.03 if position < 0.1 else 5e-3)
        assert not _coarse(ghosts, SUN + shift).values.any()  # and is not counted twice


@pytest.mark.parametrize(("position", "compact"), [(0.1, True), (0.5, False)])
def test_a_ghost_is_compact_if_its_edge_too_is_within_32_pixels(position: float, compact: bool) -> None:
    """A pupil of 29 px; the edge is the Sun's image in it, 1.4 or 6.8 px, times sqrt(5)/2."""
    ghosts = _one(0, position, 29.0)
    assert len(ghosts.compact(SUN, 1e9).pixels) == compact
    assert _fine(ghosts).any() == compact and _coarse(ghosts).values.any() != compact


def test_a_ghosts_edge_has_the_width_of_the_suns_image_in_it() -> None:
    """Pupil 200 px, Sun 1.4 x 13.5 px: brightness along a radius falls with the variance of a disc, R^2/4."""
    grid = _coarse(_one(0, 1.4, 200.0))
    place = _one(0, 1.4, 200.0).places(SUN)[0]
    r = np.arange(150.0, 250.0, 0.5)
    e = grid.at(place + r[:, None] * np.array([0.6, 0.8]))
    law = -np.gradient(e, r) / e[0]
    mean = np.trapezoid(law * r, r)
    assert mean == pytest.approx(200.0, abs=0.5)
    bilinear = 64.0 / 6.0  # the grid's own blur
    assert np.trapezoid(law * (r - mean) ** 2, r) == pytest.approx((1.4 * 13.5) ** 2 / 4.0 + bilinear, rel=0.1)


@pytest.mark.parametrize("blades", [3, 5, 6])
def test_a_defocused_ghost_has_as_many_corners_as_the_iris_blades(blades: int) -> None:
    grid = _coarse(_one(blades, 0.2, 200.0))
    place = _one(blades, 0.2, 200.0).places(SUN)[0]
    angle = 0.3 + 2.0 * np.pi * np.arange(720) / 720  # from the first blade's normal
    apothem = Iris(blades=blades, angle_rad=0.0).inscribed_radius(200.0)
    beyond = 0.5 * (apothem + apothem / np.cos(np.pi / blades))  # outside at the blades, inside at the corners
    lit = grid.at(place + beyond * np.column_stack([np.cos(angle), np.sin(angle)])) > 0.5 * grid.values.max()
    assert not lit[0]
    assert np.sum(lit & ~np.roll(lit, 1)) == blades


def test_a_compact_ghost_is_told_with_its_place_light_and_size() -> None:
    ghosts = Ghosts(
        Iris(blades=6, angle_rad=0.3),
        np.array([0.25, 1.0]),
        np.array([2e-5, 1e-4]),
        np.array([0.0, 150.0]),
        13.5,
        CENTRE,
    )
    told = ghosts.compact(SUN, 1e9)
    assert told.electrons == pytest.approx([2e4])
    assert told.radius_px == pytest.approx([0.25 * 13.5])
    image = _fine(ghosts)
    rows, columns = np.indices(image.shape)
    total = image.sum(dtype=float)
    assert [(image * columns).sum() / total, (image * rows).sum() / total] == pytest.approx(told.pixels[0], abs=0.02)
    assert image.max() == pytest.approx(2e4 / (np.pi * (0.25 * 13.5) ** 2), rel=0.1)


def test_in_a_window_ghosts_are_the_full_frames_bit_for_bit() -> None:
    ghosts = Ghosts(
        Iris(blades=5, angle_rad=0.3),
        np.array([0.3, 0.9, 1.2]),
        np.array([2e-5, 1e-4, 1e-4]),
        np.array([2.0, 90.0, 150.0]),
        13.5,
        CENTRE,
    )
    grid, image = _coarse(ghosts), _fine(ghosts)
    rng = np.random.default_rng(7)
    u, v = ghosts.places(SUN)[0]
    for k in range(100):
        near = k % 2  # every second window cuts the compact ghost
        r = int(v + rng.integers(-12, 3)) if near else int(rng.integers(0, 1000))
        c = int(u + rng.integers(-12, 3)) if near else int(rng.integers(0, 1900))
        window = Window(r, r + int(rng.integers(1, 88)), c, c + int(rng.integers(1, 148)))
        assert np.array_equal(_fine(ghosts, SUN, window), image[r : window.row_stop, c : window.column_stop])
        part = _coarse(ghosts, SUN, window)
        (i, j), (m, n) = part.first, part.values.shape
        assert np.array_equal(part.values, grid.values[i : i + m, j : j + n])
