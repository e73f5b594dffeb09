"""Windows whose edge passes just by a reflection or a glint, against the full frame, in the whole scene."""

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from dockair.messages import Window
from dockair.sim.camera.camera import NearInfraredCamera
from dockair.sim.camera.camera_noise import CameraNoise
from dockair.sim.camera.sheets import CameraSheets

SUN_W = np.array([-0.7, -0.3, 0.65]) / np.linalg.norm([-0.7, -0.3, 0.65])
EXPOSURE_S = 1e-3
HEIGHT, WIDTH = 1088, 2048
EDGES_PX = (-60, -7, -1, 0, 1, 2, 7, 60)  # by which a window begins after the pixel of a source


def _windows(row: int, column: int) -> list[Window]:
    """That begin or end near a pixel, on each of its four sides."""
    found = []
    for by in EDGES_PX:
        for top, left in ((row + by, column - 20), (row - 20, column + by)):
            found.append(Window(top, top + 40, left, left + 40))
        for stop, right in ((row - by + 1, column + 20), (row + 20, column - by + 1)):
            found.append(Window(stop - 40, stop, right - 40, right))
    return [
        w for w in found if 0 <= w.row_start and w.row_stop <= HEIGHT and 0 <= w.column_start and w.column_stop <= WIDTH
    ]


@pytest.mark.parametrize("backend", [pytest.param("mujoco", marks=pytest.mark.gl), "analytic"])
def test_light_of_mirrors_at_a_windows_edge_is_the_full_frames(
    make_world: Callable[..., Any], small_world: Any, backend: str
) -> None:
    """To the bit; where OpenGL draws, whose edges may fall otherwise, before nothing."""
    world, built, sheets = make_world(p_PD_B=(2.5, 0.1, 0.1)), small_world.as_built, CameraSheets.load()
    polished = replace(sheets, surfaces=replace(sheets.surfaces, metal_share=0.9, faintest_reflection=1e-7))
    camera = NearInfraredCamera(
        polished, built, CameraNoise.of(3), world.model, sun_direction_W=SUN_W, background=backend
    )
    if backend == "mujoco":
        camera.background_electrons = _dark  # type: ignore[method-assign]
    full = camera.expected_electrons(world.data, camera.full_window, 0.0, EXPOSURE_S)
    sources = camera._sources.of(world.data, camera.pose(world.data), EXPOSURE_S, np.ones(8))
    pixels = built.camera.pixels_from_points(sources.p_C[8:])[sources.electrons[8:] > 1.0]
    inside = pixels[((pixels > 30.0) & (pixels < [WIDTH - 30.0, HEIGHT - 30.0])).all(axis=1)]
    assert len(inside) >= 4
    for u, v in inside[:: max(1, len(inside) // 5)]:
        for window in _windows(round(v), round(u)):
            part = camera.expected_electrons(world.data, window, 0.0, EXPOSURE_S)
            cut = full[window.row_start : window.row_stop, window.column_start : window.column_stop]
            assert np.array_equal(part, cut), window
    camera.close()


def _dark(data: Any, window: Window, *_: Any, **__: Any) -> np.ndarray:
    return np.zeros(window.shape, dtype=np.float32)
