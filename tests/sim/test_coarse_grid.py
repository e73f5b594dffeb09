"""Quantities kept at every eighth pixel."""

import numpy as np
import pytest

from dockair.messages import Window
from dockair.sim.camera.coarse_grid import SPACING_PX, CoarseGrid, nodes_around


def test_between_nodes_a_plane_is_a_plane() -> None:
    first, shape = nodes_around(Window(37, 211, 805, 1001))
    i, j = np.indices(shape)
    values = 3.0 + 0.5 * SPACING_PX * (first[0] + i) - 0.25 * SPACING_PX * (first[1] + j)
    pixels = np.random.default_rng(1).uniform([805.0, 37.0], [1000.0, 210.0], size=(500, 2))
    got = CoarseGrid(values.astype(np.float32), first).at(pixels)
    assert got == pytest.approx(3.0 + 0.5 * pixels[:, 1] - 0.25 * pixels[:, 0], abs=1e-4)


def test_at_a_node_it_has_the_nodes_value_and_beyond_the_outermost_that_of_the_edge() -> None:
    values, first = np.random.default_rng(4).uniform(1.0, 2.0, (4, 6)).astype(np.float32), (3, 10)
    i, j = np.indices((8, 10)) - 2  # two nodes farther out on every side
    pixels = SPACING_PX * np.column_stack([(first[1] + j).ravel(), (first[0] + i).ravel()]).astype(float)
    nearest = values[np.clip(i, 0, 3), np.clip(j, 0, 5)]
    assert CoarseGrid(values, first).at(pixels) == pytest.approx(nearest.ravel(), rel=1e-12)


def test_the_nodes_around_a_window_enclose_every_pixel_and_no_ring_more() -> None:
    rng = np.random.default_rng(2)
    for _ in range(300):
        rows, columns = np.sort(rng.integers(0, 1088, 2)), np.sort(rng.integers(0, 2048, 2))
        window = Window(int(rows[0]), int(rows[1]) + 1, int(columns[0]), int(columns[1]) + 1)
        first, shape = nodes_around(window)
        for start, stop, node, count in (
            (window.row_start, window.row_stop, first[0], shape[0]),
            (window.column_start, window.column_stop, first[1], shape[1]),
        ):
            assert 0 <= start - SPACING_PX * node < SPACING_PX
            assert 0 < SPACING_PX * (node + count - 1) - (stop - 1) <= SPACING_PX
