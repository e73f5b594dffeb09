"""Which blobs reach into a window: against adding them all; their places against the lens's own formula."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from dockair.calibration import Camera
from dockair.sim.camera.blobs import Blobs, _image, _lens
from dockair.sim.camera.coarse_grid import CoarseGrid, nodes_around
from dockair.sim.camera.dirt import Dirt
from dockair.sim.camera.image_point import image_points
from dockair.sim.camera.lobes import ROW
from dockair.sim.camera.optics import PointSpread
from dockair.sim.camera.patches import add_patches
from dockair.sim.camera.point_sources import WIDE_PX, Sources
from dockair.sim.camera.sheets import CameraSheets

SHEETS = CameraSheets.load()
BENT = (-0.2, 0.05, 1e-3, -5e-4, 0.01)
FOLDING = (1e-3, -3.9e-3, 1e-5, -4e-5, 0.0)  # the polynomial brings light from 76 degrees off the axis into the frame
CAMERA = Camera(
    focal_length_m=0.016, pixel_pitch_m=5.5e-6, width_px=2048, height_px=1088, principal_point_px=(1020.0, 550.0)
)
LENS = SHEETS.lens
START, SHAPE = (400, 900), (120, 150)


def _spread(camera: Camera = CAMERA) -> PointSpread:
    return PointSpread(LENS, SHEETS.sensor, camera, 850e-9)


def _sources(rng: np.random.Generator, n: int, camera: Camera = CAMERA) -> Sources:
    """All over the picture and far beyond, most near the window; of all sizes, brightnesses and speeds; some behind."""
    x = rng.uniform(0.4, 40.0, n) * rng.choice([1.0, -1.0], n, p=[0.95, 0.05])
    middle = np.array([START[1] + 0.5 * SHAPE[1], START[0] + 0.5 * SHAPE[0]])
    away = rng.normal(0.0, 1.0, (n, 2)) * 10.0 ** rng.uniform(1.0, 3.0, (n, 1))
    ab = (middle + away - camera.principal_point_px) / camera.focal_length_px
    way_px = rng.normal(0.0, 1.0, (n, 2)) * 10.0 ** rng.uniform(-2.0, 1.5, (n, 1))
    way = np.column_stack([np.zeros(n), -way_px * np.abs(x)[:, None] / camera.focal_length_px])
    return Sources(
        p_C=np.column_stack([x, -ab * x[:, None]]),
        electrons=10.0 ** rng.uniform(-1.5, 7.0, n),
        size_m=rng.choice([0.0, 1e-3, 2e-3, 8e-3, 0.064, 0.5], n),
        way_C_m=way,
        patches_W=np.zeros((n, ROW)),
    )


def _all_seen(which: NDArray[np.intp]) -> NDArray[np.bool_]:
    return np.ones(len(which), dtype=np.bool_)


@pytest.mark.parametrize("distortion", [None, BENT])
def test_a_points_pixel_and_motion_are_those_of_the_calibrations_formula(distortion: Any) -> None:
    """To 1e-9 px; a place behind the lens has no pixel."""
    camera = replace(CAMERA, distortion=distortion)
    lens = _lens(camera)
    p, way = np.random.default_rng(1).uniform([1.0, -0.3, -0.2], [9.0, 0.3, 0.2], (200, 3)), np.full((200, 3), 0.01)
    p[:10, 0] *= -1.0
    pixels, smear, width = np.empty((200, 2)), np.empty((200, 2)), np.empty(200)
    _image(p, way, np.full(200, 0.1), lens, pixels, smear, width)
    np.testing.assert_allclose(pixels, camera.pixels_from_points(p), rtol=0.0, atol=1e-9)
    moved = camera.pixels_from_points(p + 0.5 * way) - camera.pixels_from_points(p - 0.5 * way)
    np.testing.assert_allclose(smear, moved, rtol=0.0, atol=1e-9)
    np.testing.assert_allclose(width[10:], 0.1 * camera.focal_length_px / p[10:, 0])
    assert np.isnan(pixels[:10]).all()


def _beside(slope: float, about_rad: Any) -> NDArray[np.float64]:
    """(n, 3) points 0.2 m ahead of the lens and `slope` times as far beside its axis."""
    about = np.atleast_1d(about_rad)
    return 0.2 * np.column_stack([np.ones(len(about)), slope * np.cos(about), slope * np.sin(about)])


@pytest.mark.parametrize("distortion", [None, FOLDING])
def test_far_off_the_axis_too_a_points_pixel_is_the_lenss(distortion: Any) -> None:
    camera = replace(CAMERA, distortion=distortion)
    p = np.vstack([_beside(slope, np.linspace(0.0, 6.0, 9)) for slope in (0.3, 0.5, 0.6, 2.0, 4.0, 30.0)])
    pixels, smear, width = np.empty((len(p), 2)), np.empty((len(p), 2)), np.empty(len(p))
    _image(p, np.zeros_like(p), np.zeros(len(p)), _lens(camera), pixels, smear, width)
    np.testing.assert_allclose(pixels, image_points(camera, p), rtol=0.0, atol=1e-8)


def test_no_light_from_far_beside_the_axis_is_folded_into_the_frame() -> None:
    """The probe's mast, 76 degrees off the axis and near, glints fifteen times as bright as an LED at 10 m."""
    camera = replace(CAMERA, distortion=FOLDING)
    p = np.vstack([_beside(slope, np.linspace(0.0, 6.2, 40)) for slope in np.arange(3.7, 4.3, 0.02)])
    u, v = camera.pixels_from_points(p).T
    assert ((u > 0.0) & (u < 2047.0) & (v > 0.0) & (v < 1087.0)).any()  # what the polynomial alone would show
    sources = Sources(
        p_C=p, electrons=np.full(len(p), 1.5e5), size_m=np.full(len(p), 2e-3), way_C_m=np.zeros_like(p),
        patches_W=np.zeros((len(p), ROW)),
    )  # fmt: skip
    image = np.zeros((1088, 2048), dtype=np.float32)
    Blobs(camera, _spread(camera)).add(image, (0, 0), sources, None, _all_seen)
    assert not image.any()


@pytest.mark.parametrize("seed", range(4))
def test_what_is_left_out_would_have_left_every_pixel_as_it_is(seed: int) -> None:
    """What adding every source gives, but for single precision; many are not even asked for."""
    rng, spread = np.random.default_rng(seed), _spread()
    sources, asked = _sources(rng, 600), []

    def seen(which: NDArray[np.intp]) -> NDArray[np.bool_]:
        asked.extend(which)
        return _all_seen(which)

    image, every = np.ones((2, *SHAPE), dtype=np.float32)
    Blobs(CAMERA, spread).add(image, START, sources, None, seen)
    kept = np.flatnonzero((sources.p_C[:, 0] > 0.0) & (sources.electrons > 0.5))
    p, way, size, e = sources.p_C[kept], sources.way_C_m[kept], sources.size_m[kept], sources.electrons[kept]
    pixels = CAMERA.pixels_from_points(p)
    smear = CAMERA.pixels_from_points(p + 0.5 * way) - CAMERA.pixels_from_points(p - 0.5 * way)
    width = size * CAMERA.focal_length_px / p[:, 0]
    wide = width >= WIDE_PX
    add_patches(every, START, pixels[wide], e[wide], width[wide] / np.sqrt(12.0))
    for size_m in sorted(set(size[~wide])):
        of = ~wide & (size == size_m)
        spread.splat(every, START, pixels[of], e[of], p[of, 0], size_m, smear[of])
    np.testing.assert_allclose(image, every, rtol=3e-7)
    assert 50 < len(asked) < 0.8 * len(kept)


def test_sources_that_reach_no_further_than_the_edge_are_asked_for() -> None:
    """A faint point is looked at up to its core's reach of the window, and not a hundred pixels away."""
    asked: list[int] = []

    def seen(which: NDArray[np.intp]) -> NDArray[np.bool_]:
        asked.append(len(which))
        return _all_seen(which)

    spread, x = _spread(), 10.0
    for away in (5.0, 200.0):
        pixel = np.array([START[1] - away, START[0] + 10.0])
        ab = (pixel - CAMERA.principal_point_px) / CAMERA.focal_length_px
        source = Sources(
            p_C=x * np.array([[1.0, *-ab]]), electrons=np.array([5.0]), size_m=np.zeros(1),
            way_C_m=np.zeros((1, 3)), patches_W=np.zeros((1, ROW)),
        )  # fmt: skip
        Blobs(CAMERA, spread).add(np.zeros(SHAPE, dtype=np.float32), START, source, None, seen)
    assert asked == [1, 0]


def test_a_long_smear_reaches_into_a_window_that_its_middle_is_far_from() -> None:
    """300 px away and 590 px long: its end passes 5 px beside the first column."""
    spread, x, f = _spread(), 10.0, CAMERA.focal_length_px
    pixel, smear = np.array([[START[1] - 300.0, START[0] + 10.0]]), np.array([[590.0, 0.0]])
    ab = (pixel[0] - CAMERA.principal_point_px) / f
    source = Sources(
        p_C=x * np.array([[1.0, *-ab]]), electrons=np.array([1e6]), size_m=np.zeros(1),
        way_C_m=-x / f * np.array([[0.0, *smear[0]]]), patches_W=np.zeros((1, ROW)),
    )  # fmt: skip
    image, alone = np.zeros((2, *SHAPE), dtype=np.float32)
    Blobs(CAMERA, spread).add(image, START, source, None, _all_seen)
    spread.splat(alone, START, pixel, source.electrons, np.array([x]), 0.0, smear)
    assert alone.sum() > 10.0
    np.testing.assert_allclose(image, alone, rtol=1e-4, atol=1e-4)


def test_the_hidden_add_nothing_and_the_others_what_they_add_alone() -> None:
    sources, blobs = _sources(np.random.default_rng(9), 200), Blobs(CAMERA, _spread())
    odd, even, both = np.zeros((3, *SHAPE), dtype=np.float32)
    blobs.add(odd, START, sources, None, lambda which: which % 2 == 1)
    blobs.add(even, START, sources, None, lambda which: which % 2 == 0)
    blobs.add(both, START, sources, None, _all_seen)
    assert odd.sum() > 0.0 and even.sum() > 0.0
    np.testing.assert_allclose(odd + even, both, rtol=1e-5, atol=1e-6 * both.max())


def test_dirt_dims_a_blob_by_the_factor_at_its_place() -> None:
    """A smudge that takes half, over the left half of the sensor."""

    class Half(Dirt):
        def __init__(self) -> None:
            first, shape = nodes_around(CAMERA.full_window)
            values = np.ones(shape, dtype=np.float32)
            values[:, :60] = 0.5
            self.grid = CoarseGrid(values, first)

    blobs, dirt = Blobs(CAMERA, _spread()), Half()
    for u, factor in ((300.0, 0.5), (900.0, 1.0)):
        ab = (np.array([u, 500.0]) - CAMERA.principal_point_px) / CAMERA.focal_length_px
        source = Sources(
            p_C=5.0 * np.array([[1.0, *-ab]]), electrons=np.array([1e4]), size_m=np.zeros(1),
            way_C_m=np.zeros((1, 3)), patches_W=np.zeros((1, ROW)),
        )  # fmt: skip
        clean, dirty = np.zeros((2, 1088, 2048), dtype=np.float32)
        blobs.add(clean, (0, 0), source, None, _all_seen)
        blobs.add(dirty, (0, 0), source, dirt, _all_seen)
        assert dirty.sum() == pytest.approx(factor * clean.sum(), rel=1e-4)
