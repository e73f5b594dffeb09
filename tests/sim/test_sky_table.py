"""The table of directions: right all round, complete whatever is asked first, and the same in every window."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from dockair.sim.camera.octahedron import directions_from_nodes
from dockair.sim.camera.sky_table import DirectionTable

TILES = 4


def _smooth(d: np.ndarray) -> np.ndarray:
    return 2.0 + d[:, 0] + 0.5 * d[:, 1] - 0.25 * d[:, 2] + 0.3 * d[:, 0] * d[:, 2]


def _wanted(R: np.ndarray, x: np.ndarray, y: np.ndarray) -> np.ndarray:
    d = np.stack(np.broadcast_arrays(1.0, -x[None, :], -y[:, None]), axis=-1) @ R.T
    return _smooth((d / np.linalg.norm(d, axis=-1, keepdims=True)).reshape(-1, 3)).reshape(len(y), len(x))


def _axes(rows: int, columns: int, step: float) -> tuple[np.ndarray, np.ndarray]:
    return (np.arange(columns) - 0.5 * columns) * step, (np.arange(rows) - 0.5 * rows) * step


LOOKS = [
    *(Rotation.from_euler("zyx", angles, degrees=True).as_matrix() for angles in ((0, 0, 0), (90, 0, 0), (180, 0, 0))),
    *(
        Rotation.from_euler("zyx", angles, degrees=True).as_matrix()
        for angles in ((0, 90, 0), (0, -90, 0), (178, 3, 45))
    ),
    *Rotation.random(10, random_state=3).as_matrix(),
]


@pytest.mark.parametrize("smooth", [False, True])
@pytest.mark.parametrize("R", LOOKS)
@pytest.mark.parametrize("step", [1e-3, 2e-2])
def test_a_smooth_function_comes_back_from_every_side(R: np.ndarray, step: float, smooth: bool) -> None:
    """To a quarter of the step between nodes, where a fold of the map crosses a cell; a tile left out is off by 1."""
    x, y = _axes(60, 90, step)
    out = np.full((60, 90), np.nan, dtype=np.float32)
    DirectionTable(_smooth, TILES, smooth=smooth).fill(out, R, x, y)
    assert np.abs(out - _wanted(R, x, y)).max() < 4e-3


@pytest.mark.parametrize("seed", range(8))
def test_no_tile_that_a_picture_reads_is_left_out(seed: int) -> None:
    """Pictures 5 tiles wide from a fresh table each; what is left out reads 0."""
    x, y = _axes(60, 90, 6e-3)
    for R in Rotation.random(8, random_state=seed).as_matrix():
        out = np.empty((60, 90), dtype=np.float32)
        DirectionTable(_smooth, 24).fill(out, R, x, y)
        assert np.abs(out - _wanted(R, x, y)).max() < 1e-3


def test_a_corner_of_the_square_that_only_slips_into_the_picture_is_there() -> None:
    """Straight aft the square's four corners meet; one of them shows in a triangle at the lower edge."""
    R = Rotation.from_euler("ZYX", (180, 0, 45), degrees=True).as_matrix()
    step = 6e-3
    x, y = (np.arange(90) - 45.5) * step, (np.arange(60) - 56.6) * step
    out = np.empty((60, 90), dtype=np.float32)
    DirectionTable(_smooth, 12).fill(out, R, x, y)
    assert np.abs(out - _wanted(R, x, y)).max() < 2e-3


def test_only_what_is_looked_at_is_computed() -> None:
    asked = []

    def counted(d: np.ndarray) -> np.ndarray:
        asked.append(d)
        return _smooth(d)

    table = DirectionTable(counted, 12)
    out = np.empty((20, 20), dtype=np.float32)
    table.fill(out, np.eye(3), *_axes(20, 20, 1e-3))
    first = len(asked)
    assert first < 20
    assert min(d[:, 0].min() for d in asked) > 0.5
    table.fill(out, np.eye(3), *_axes(20, 20, 1e-3))
    assert len(asked) == first


@pytest.mark.parametrize("smooth", [False, True])
@pytest.mark.parametrize("start", range(0, 33, 3))
def test_a_window_is_the_full_pictures_bit_for_bit(start: int, smooth: bool) -> None:
    """Every width from 1 to 40, from a table that no other picture has touched."""
    R = Rotation.from_euler("zyx", (10, 4, 15), degrees=True).as_matrix()
    x, y = _axes(50, 80, 2e-3)
    full = np.empty((50, 80), dtype=np.float32)
    DirectionTable(_smooth, TILES, smooth=smooth).fill(full, R, x, y)
    fresh = DirectionTable(_smooth, TILES, smooth=smooth)
    for width in range(1, 41):
        part = np.empty((7, width), dtype=np.float32)
        fresh.fill(part, R, x[start : start + width], y[start : start + 7])
        assert np.array_equal(part, full[start : start + 7, start : start + width])


@pytest.mark.parametrize("angles", [(0, 0, 0), (10, 4, 15), (-30, 15, -40)])
def test_between_the_coarse_places_a_smooth_function_is_that_of_the_nodes(angles: tuple[float, float, float]) -> None:
    """Clear of the map's folds, from the same nodes: 1 % of what the function changes over half a coarse step."""
    R = Rotation.from_euler("zyx", angles, degrees=True).as_matrix()
    x, y = _axes(60, 90, 7e-4)
    plain, smooth = (np.empty((60, 90), dtype=np.float32) for _ in range(2))
    DirectionTable(_smooth, 24).fill(plain, R, x, y)
    DirectionTable(_smooth, 24, smooth=True).fill(smooth, R, x, y)
    assert np.abs(plain - smooth).max() < 2e-5


def test_places_a_multiple_of_the_coarse_step_apart_read_the_table_itself() -> None:
    """Tangents that are multiples of 1/256 to the right and 1/512 down: nothing is interpolated there."""
    R = Rotation.from_euler("zyx", (10, 4, 15), degrees=True).as_matrix()
    x, y = np.arange(-20, 21) / 256.0, np.arange(-30, 31) / 512.0
    plain, smooth = (np.empty((61, 41), dtype=np.float32) for _ in range(2))
    DirectionTable(_smooth, TILES).fill(plain, R, x, y)
    DirectionTable(_smooth, TILES, smooth=True).fill(smooth, R, x, y)
    assert np.array_equal(plain, smooth)


def test_directions_of_nodes_are_unit_vectors_in_their_place() -> None:
    i, j = np.meshgrid(np.arange(9), np.arange(9), indexing="ij")
    d = directions_from_nodes(i.ravel(), j.ravel(), 10).reshape(9, 9, 3)
    assert np.linalg.norm(d, axis=-1) == pytest.approx(np.ones((9, 9)), abs=1e-15)
    assert d[4, 4] == pytest.approx([1, 0, 0])  # ahead
    assert d[0, 4] == pytest.approx([0, 0, 1])  # up
    assert d[4, 0] == pytest.approx([0, 1, 0])  # left
    for corner in (d[0, 0], d[0, 8], d[8, 0], d[8, 8]):
        assert corner == pytest.approx([-1, 0, 0])


def test_nodes_stand_two_nths_of_a_radian_apart_ahead_and_up_to_root_six_times_that_elsewhere() -> None:
    """Nowhere are they nearer than ahead; widest apart they stand in the middle of a face."""
    n = 302
    i, j = np.meshgrid(np.arange(n - 1), np.arange(n - 1), indexing="ij")
    d = directions_from_nodes(i.ravel(), j.ravel(), n).reshape(n - 1, n - 1, 3)
    down, right = (np.linalg.norm(np.diff(d, axis=axis), axis=-1) * (n - 2) / 2.0 for axis in (0, 1))
    middle = n // 2 - 1
    assert (down[middle, middle], right[middle, middle]) == pytest.approx((1.0, 1.0), abs=0.01)
    for apart in (down, right):
        assert apart.min() > 0.99
        assert apart.max() == pytest.approx(np.sqrt(6.0), abs=0.02)
