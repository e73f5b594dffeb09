"""Blobs in an image: wings, smear, windows."""

from dataclasses import replace

import numpy as np
import pytest

from dockair.calibration import Camera
from dockair.parameters import load_parameters
from dockair.sim.camera.optics import PointSpread
from dockair.sim.camera.point_spread import airy_px
from dockair.sim.camera.sheets import LensParameters, SensorParameters
from dockair.sim.camera.splat import FAINTEST_E, reach_window

LENS, SENSOR = load_parameters("lens", LensParameters), load_parameters("sensor", SensorParameters)
CAMERA = Camera()
LED_M = 850e-9
DIE_M = 1e-3
FOCUS_M = 10.0


def _spread(f_number: float = 8.0) -> PointSpread:
    lens = replace(LENS, f_number=f_number, focus_distance_m=FOCUS_M)
    return PointSpread(lens, SENSOR, CAMERA, LED_M)


def _blob(
    spread: PointSpread,
    at: tuple[float, float],
    electrons: float = 1e5,
    depth_m: float = FOCUS_M,
    size_m: float = 0.0,
    half: int = 60,
    smear: tuple[float, float] = (0.0, 0.0),
) -> np.ndarray:
    """One blob, (0, 0) in the middle of the image."""
    image = np.zeros((2 * half + 1, 2 * half + 1), dtype=np.float32)
    one = np.array([at]), np.array([electrons]), np.array([depth_m])
    spread.splat(image, (-half, -half), *one, size_m, np.array([smear]))
    return image


def _moments(image: np.ndarray) -> tuple[float, float, float, float]:
    """Sum, mean column, mean row, variance along columns; of an image with (0, 0) in the middle."""
    x = np.arange(image.shape[0]) - image.shape[0] // 2
    columns, rows = image.sum(0, dtype=float), image.sum(1, dtype=float)
    total = columns.sum()
    u = columns @ x / total
    return total, u, rows @ x / total, columns @ (x - u) ** 2 / total


@pytest.mark.parametrize("electrons,half", [(1.0, 30), (1e4, 30), (3e6, 120), (1e8, 380)])
def test_a_blob_holds_its_electrons_however_far_its_wings_reach(electrons: float, half: int) -> None:
    image = _blob(_spread(), (0.3, -0.2), electrons=electrons, half=half)
    assert image.sum(dtype=float) == pytest.approx(electrons, rel=1e-5)


@pytest.mark.parametrize("electrons", [1.5e5, 3e6])
@pytest.mark.parametrize("f_number", [8.0, 16.0])
def test_the_wings_fall_as_the_cube_of_the_distance_and_end_without_an_edge(f_number: float, electrons: float) -> None:
    """A E/r^3, A = q/pi^3, until FAINTEST_E; where they end, neighbours differ by less than that."""
    A = airy_px(replace(LENS, f_number=f_number, focus_distance_m=FOCUS_M), CAMERA, LED_M) / np.pi**3
    reach = (A * electrons / FAINTEST_E) ** (1.0 / 3.0)
    half = int(reach) + 10
    image = _blob(_spread(f_number), (0.3, 0.1), electrons=electrons, half=half)
    x = np.arange(-half, half + 1)
    r = np.hypot(x - 0.3, (x - 0.1)[:, None])
    assert (image >= 0.0).all()
    assert not image[r > reach].any()
    ring = (r > 0.4 * reach) & (r < 0.5 * reach)
    assert image[ring].mean() == pytest.approx((A * electrons / r[ring] ** 3).mean(), abs=6.0 * FAINTEST_E)
    outer = r > 0.85 * reach
    steps = np.abs(np.diff(image, axis=1))[outer[:, 1:] & outer[:, :-1]]
    assert steps.max() < 0.5 * FAINTEST_E


@pytest.mark.parametrize("f_number", [1.4, 8.0, 16.0])
def test_no_pixel_expects_fewer_than_no_electrons(f_number: float) -> None:
    spread = _spread(f_number)
    for depth_m, electrons in [(1.3, 1e4), (3.0, 1e6), (10.0, 10.0), (30.0, 1e3), (np.inf, 1e5)]:
        assert _blob(spread, (0.37, -0.21), electrons, depth_m, DIE_M).min() >= 0.0


@pytest.mark.parametrize("smear", [(0.05, 0.0), (0.8, 0.0), (3.0, 0.0), (7.0, -5.0)])
def test_a_smear_widens_a_blob_by_the_variance_of_its_line(smear: tuple[float, float]) -> None:
    spread = _spread()
    still, moved = _moments(_blob(spread, (0.2, 0.4))), _moments(_blob(spread, (0.2, 0.4), smear=smear))
    assert moved[3] - still[3] == pytest.approx(smear[0] ** 2 / 12.0, rel=2e-3, abs=3e-4)
    assert moved[:3] == pytest.approx(still[:3], rel=1e-5, abs=2e-4)


@pytest.mark.parametrize(
    "f_number,smear", [(8.0, (0.3, 0.4)), (8.0, (6.0, -2.5)), (8.0, (14.0, 0.0)), (2.8, (2.0, 1.0)), (2.8, (0.1, 0.0))]
)
def test_a_smeared_blob_is_the_mean_of_the_blob_along_its_way(f_number: float, smear: tuple[float, float]) -> None:
    spread = _spread(f_number)
    along = (np.arange(200) + 0.5) / 200 - 0.5
    way = [_blob(spread, (0.2 + a * smear[0], -0.3 + a * smear[1]), half=40).astype(float) for a in along]
    expected = np.mean(way, axis=0)
    smeared = _blob(spread, (0.2, -0.3), half=40, smear=smear)
    assert smeared == pytest.approx(expected, rel=0.0, abs=5e-3 * expected.max())


def test_a_smear_below_a_fiftieth_of_a_pixel_is_none() -> None:
    spread = _spread()
    assert np.array_equal(_blob(spread, (0.2, 0.4), smear=(0.012, -0.015)), _blob(spread, (0.2, 0.4)))
    assert not np.array_equal(_blob(spread, (0.2, 0.4), smear=(0.02, -0.015)), _blob(spread, (0.2, 0.4)))


def test_a_windows_pixels_are_the_full_frames_bit_for_bit() -> None:
    """200 windows at random, which cut cores, wings and smears; blobs outside them too."""
    rng = np.random.default_rng(7)
    spread, n = _spread(), 24
    sources = (
        np.column_stack([rng.uniform(-15.0, 215.0, n), rng.uniform(-15.0, 165.0, n)]),
        10.0 ** rng.uniform(1.0, 6.0, n),
        rng.uniform(1.5, 40.0, n),
        DIE_M,
        rng.normal(0.0, 0.8, (n, 2)) * (rng.random((n, 1)) < 0.5),
    )
    background = rng.uniform(0.0, 300.0, (150, 200)).astype(np.float32)
    full = background.copy()
    spread.splat(full, (0, 0), *sources)
    for _ in range(200):
        r0, c0 = int(rng.integers(0, 149)), int(rng.integers(0, 199))
        r1, c1 = int(rng.integers(r0 + 1, 151)), int(rng.integers(c0 + 1, 201))
        part = background[r0:r1, c0:c1].copy()
        spread.splat(part, (r0, c0), *sources)
        assert np.array_equal(part, full[r0:r1, c0:c1])


def test_a_blob_moved_by_whole_pixels_is_the_same_blob() -> None:
    spread = _spread()
    assert np.array_equal(_blob(spread, (3.25, -5.5))[:-5, 3:], _blob(spread, (0.25, -0.5))[5:, :-3])


def test_a_blob_is_mirrored_when_its_place_is() -> None:
    spread = _spread(2.8)
    image = _blob(spread, (0.3125, -0.125), depth_m=4.0, size_m=DIE_M)
    assert np.array_equal(_blob(spread, (-0.3125, -0.125), depth_m=4.0, size_m=DIE_M), image[:, ::-1])
    assert np.array_equal(_blob(spread, (0.3125, 0.125), depth_m=4.0, size_m=DIE_M), image[::-1])
    assert _blob(spread, (-0.125, 0.3125), depth_m=4.0, size_m=DIE_M) == pytest.approx(image.T, rel=1e-5, abs=1e-3)


def test_what_is_behind_the_lens_dark_or_far_outside_adds_nothing() -> None:
    image = np.zeros((40, 50), dtype=np.float32)
    pixels = np.array([[np.nan, np.nan], [20.0, 20.0], [20.0, 20.0], [900.0, -300.0]])
    electrons = np.array([1e5, 0.0, -5.0, 1e5])
    _spread().splat(image, (0, 0), pixels, electrons, np.array([-3.0, 5.0, 5.0, 5.0]), DIE_M, np.zeros((4, 2)))
    assert not image.any()


def test_a_blob_just_outside_still_throws_its_wings_into_the_image() -> None:
    image = np.zeros((40, 50), dtype=np.float32)
    _spread().splat(image, (0, 0), np.array([[-20.0, 20.0]]), np.array([1e6]), np.array([10.0]), 0.0, np.zeros((1, 2)))
    A = airy_px(replace(LENS, f_number=8.0, focus_distance_m=FOCUS_M), CAMERA, LED_M) / np.pi**3
    assert image[20, 0] == pytest.approx(A * 1e6 / 20.0**3, rel=0.2)


def test_a_blob_reaches_every_pixel_that_it_adds_to_and_none_two_pixels_beyond_its_wings() -> None:
    """A window of one pixel; the blob at twentieths of a pixel around where its wings end."""
    spread, electrons = _spread(), 1e6
    A = airy_px(replace(LENS, f_number=8.0, focus_distance_m=FOCUS_M), CAMERA, LED_M) / np.pi**3
    r = (A * electrons / FAINTEST_E) ** (1.0 / 3.0) + np.arange(-3.0, 3.0, 0.05)
    pixels, still, zeros = np.column_stack([r, np.zeros(len(r))]), np.zeros((len(r), 2)), np.zeros(len(r))
    near = reach_window(
        (1, 1), (0, 0), pixels, still, zeros + electrons, 0.0, zeros, spread.widest_px, spread.wing
    )  # fmt: skip
    adds = []
    for k in range(len(r)):
        image = np.zeros((1, 1), dtype=np.float32)
        spread.splat(image, (0, 0), pixels, zeros + electrons, zeros + FOCUS_M, 0.0, still, np.array([k]))
        adds.append(image[0, 0] > 0.0)
    assert 40 < np.count_nonzero(adds) < len(r)
    assert np.isin(np.flatnonzero(adds), near).all()
    assert len(near) < np.count_nonzero(adds) + 2.0 / 0.05


@pytest.mark.parametrize("size_m", [0.0, DIE_M, 0.012, 0.03])
def test_some_of_many_points_are_added_as_if_there_were_no_others(size_m: float) -> None:
    """To the bit; sources above 5 mm are cut into squares."""
    rng, of = np.random.default_rng(12), np.array([3, 4, 11, 19])
    many = rng.uniform(10.0, 90.0, (20, 2)), 10.0 ** rng.uniform(2.0, 6.0, 20), rng.uniform(0.3, 20.0, 20)
    ways, (some, alone, every) = rng.normal(0.0, 2.0, (20, 2)), np.zeros((3, 100, 100), dtype=np.float32)
    _spread().splat(some, (0, 0), *many, size_m, ways, of)
    _spread().splat(alone, (0, 0), *(values[of] for values in many), size_m, ways[of])
    _spread().splat(every, (0, 0), *many, size_m, ways)
    assert some.sum() > 0.0 and np.array_equal(some, alone) and not np.array_equal(some, every)
