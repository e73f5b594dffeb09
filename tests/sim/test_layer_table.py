"""What passes below: where it is seen from other places, that it stays there, and that a heading can be read off it."""

from dataclasses import replace

import cv2
import numpy as np
import pytest

from dockair.parameters import load_parameters
from dockair.rotations import exp, matrix_from_yaw_pitch_roll
from dockair.sim.camera.earth import columns_below, dip_sine, meet_sphere
from dockair.sim.camera.layer_table import NO_DECK, LayerTable, lay_under
from dockair.sim.camera.layer_tiles import SIDE, LayerTiles
from dockair.sim.camera.sheets import SkyParameters
from dockair.sim.camera.sky import Sky
from dockair.sim.camera.sky_radiance import SkyRadiance
from dockair.sim.camera.weather import Weather

SHEET = load_parameters("sky", SkyParameters)
ALTITUDE_M, RADIUS_M = 6000.0, 6.371e6
FOCAL_BLOCKS = 16e-3 / 11e-6
X, Y = ((np.arange(n) - 0.5 * (n - 1)) / FOCAL_BLOCKS for n in (1024, 544))
SUN = np.array([-0.35, 0.6, 0.72]) / np.linalg.norm([-0.35, 0.6, 0.72])
WAVE_M = 9000.0


def _waves(d: np.ndarray, key_m: np.ndarray) -> np.ndarray:
    """(n, 2) a smooth pattern in the plane, which depends on the place that a ray meets alone; transmittance 0.3."""
    _, distance, _ = meet_sphere(d[:, 2], RADIUS_M, ALTITUDE_M + key_m[2])
    x, y = key_m[0] + d[:, 0] * distance, key_m[1] + d[:, 1] * distance
    return np.column_stack([2.0 + np.sin(x / WAVE_M) * np.cos(y / WAVE_M), np.full(len(d), 0.3)])


def _ground(d: np.ndarray, key_m: np.ndarray) -> np.ndarray:
    return _waves(d, key_m)[:, :1]


def _table(channels: int) -> LayerTable:
    return LayerTable(_waves if channels == 2 else _ground, 32, channels, ALTITUDE_M, RADIUS_M)


def _rays(R: np.ndarray) -> np.ndarray:
    x, y = np.meshgrid(X[::9], Y[::7])
    d = np.stack([np.ones_like(x), -x, -y], axis=-1).reshape(-1, 3) @ R.T
    return d / np.linalg.norm(d, axis=1, keepdims=True)


@pytest.mark.parametrize("attitude", [(0.0, 0.2, 0.0), (1.0, 0.25, 0.5), (-2.5, 0.4, -0.4), (0.3, 1.3, 0.0)])
@pytest.mark.parametrize("place", [(0.0, 0.0, 0.0), (900.0, -700.0, 300.0), (123456.0, -65432.0, -1500.0)])
def test_a_point_of_the_plane_is_seen_where_its_ray_meets_the_sphere(
    attitude: tuple[float, float, float], place: tuple[float, float, float]
) -> None:
    """A pattern of 9 km waves, from anywhere, against the sphere met in double precision; up to 60 km away."""
    R, at = matrix_from_yaw_pitch_roll(*attitude), np.array(place)
    below, out = np.empty((len(Y), 2), dtype=np.int64), np.full((len(Y), len(X)), np.nan, dtype=np.float32)
    columns_below(R, X, Y, dip_sine(RADIUS_M, ALTITUDE_M + at[2]), below)
    ground = _table(1).nodes(at, R, X, Y, below)
    lay_under(out, R, X, Y, below, ground, NO_DECK)
    d = _rays(R)
    meets, distance, _ = meet_sphere(d[:, 2], RADIUS_M, ALTITUDE_M + at[2])
    near = meets & (distance < 60e3)
    assert near.sum() > 500
    x, y = at[0] + d[near, 0] * distance[near], at[1] + d[near, 1] * distance[near]
    wanted = 2.0 + np.sin(x / WAVE_M) * np.cos(y / WAVE_M)
    got = out[::7, ::9].ravel()[near]
    assert np.abs(got - wanted).max() < 0.02  # bilinear between nodes 1 mrad apart
    assert np.abs(got - wanted).mean() < 2e-3


@pytest.mark.parametrize("height_m", [700.0, 120.0])
def test_a_camera_that_has_come_down_to_the_layer_sees_it_until_it_is_there(height_m: float) -> None:
    """As above, from less than half of what is between two keys at the start; up to ten heights away."""
    R, at = matrix_from_yaw_pitch_roll(0.5, 0.6, 0.0), np.array([900.0, -700.0, height_m - ALTITUDE_M])
    below, out = np.tile([0, len(X)], (len(Y), 1)), np.empty((len(Y), len(X)), dtype=np.float32)
    lay_under(out, R, X, Y, below, _table(1).nodes(at, R, X, Y, below), NO_DECK)
    d = _rays(R)
    _, distance, _ = meet_sphere(d[:, 2], RADIUS_M, height_m)
    near = distance < 10.0 * height_m
    assert near.all()
    x, y = at[0] + d[:, 0] * distance, at[1] + d[:, 1] * distance
    wanted = 2.0 + np.sin(x / WAVE_M) * np.cos(y / WAVE_M)
    assert np.ptp(wanted) > 0.02
    assert np.abs(out[::7, ::9].ravel() - wanted).max() < 1e-4


def test_the_columns_below_are_those_whose_rays_point_below_the_dip() -> None:
    sine = 0.0434
    for seed in range(60):
        R = exp(np.random.default_rng(seed).normal(0.0, 1.5, 3))
        below = np.empty((len(Y), 2), dtype=np.int64)
        first, stop, any_below = columns_below(R, X, Y, sine, below)
        x, y = np.meshgrid(X, Y)
        up = R[2, 0] - x * R[2, 1] - y * R[2, 2]
        wanted = up / np.sqrt(1.0 + x * x + y * y) < -sine
        column = np.arange(len(X))
        assert np.array_equal((column >= below[:, :1]) & (column < below[:, 1:]), wanted)
        others = np.flatnonzero(~wanted.all(axis=1))
        assert any_below == wanted.any()
        assert (first, stop) == ((others[0], others[-1] + 1) if len(others) else (0, 0))


def test_a_deck_lies_over_the_ground_by_its_light_and_transmittance() -> None:
    R, place = matrix_from_yaw_pitch_roll(0.0, 0.3, 0.0), np.array([100.0, 50.0, 0.0])
    below = np.tile([0, len(X)], (len(Y), 1))
    out, alone = (np.zeros((len(Y), len(X)), dtype=np.float32) for _ in range(2))
    ground, deck = _table(1).nodes(place, R, X, Y, below), _table(2).nodes(place, R, X, Y, below)
    lay_under(out, R, X, Y, below, ground, deck)
    lay_under(alone, R, X, Y, below, ground, NO_DECK)
    assert np.allclose(out, 1.3 * alone, atol=1e-5)


def _sky(**changes: float) -> Sky:
    return Sky(SkyRadiance(replace(SHEET, **changes), Weather(), SUN, ALTITUDE_M, 7))


class _Wave:
    """A texture without anything that nodes 1 mrad apart cannot hold."""

    def __init__(self, wave_m: float) -> None:
        self._wave_m = wave_m

    def at(self, x_m: np.ndarray, y_m: np.ndarray, footprint_m: np.ndarray) -> np.ndarray:
        return np.asarray(np.sin(x_m / self._wave_m) * np.cos(y_m / self._wave_m))


@pytest.mark.parametrize("place", [(0.0, 0.0, 0.0), (900.0, -700.0, 150.0), (-123456.0, 65432.0, -600.0)])
def test_the_ground_under_a_deck_stays_in_place_at_its_own_depth(place: tuple[float, float, float]) -> None:
    """Through a deck of no thickness and clear air: waves of 9 km, against the law asked from that place."""
    sheet = replace(SHEET, deck_cover=1.0, deck_optical_depth=0.0, aerosol_optical_depth=0.0, water_cover=0.0)
    law = SkyRadiance(sheet, Weather(), SUN, ALTITUDE_M, 7)
    law._ground = _Wave(9e3)  # type: ignore[assignment]
    R, at = matrix_from_yaw_pitch_roll(0.7, 0.5, 0.2), np.array(place)
    out = np.empty((len(Y[::7]), len(X[::9])), dtype=np.float32)
    Sky(law).fill(out, R, X[::9], Y[::7], at)
    wanted = law.below(_rays(R), at)[:, 0]
    assert law.has_deck and np.ptp(wanted) > 0.02
    assert np.abs(out.ravel() - wanted).max() < 1e-3


def _frame(sky: Sky, R: np.ndarray, place: np.ndarray | None = None) -> np.ndarray:
    out = np.empty((len(Y), len(X)), dtype=np.float32)
    sky.fill(out, R, X, Y, place)
    return out


def _matches(one: np.ndarray, other: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Places (n, 2) in both pictures of SIFT features that match, by Lowe's ratio."""
    grey = [np.clip(425.0 * image, 0.0, 255.0).astype(np.uint8) for image in (one, other)]
    sift = cv2.SIFT_create()
    (keys, features), (other_keys, other_features) = (sift.detectAndCompute(image, None) for image in grey)
    pairs = cv2.BFMatcher().knnMatch(features, other_features, k=2)
    good = [a for a, b in pairs if a.distance < 0.75 * b.distance]
    return np.array([keys[m.queryIdx].pt for m in good]), np.array([other_keys[m.trainIdx].pt for m in good])


def _tangents(pixels: np.ndarray) -> np.ndarray:
    middle = [0.5 * (len(X) - 1), 0.5 * (len(Y) - 1)]
    return np.asarray((pixels - middle) / FOCAL_BLOCKS)


@pytest.mark.parametrize("deck_cover", [0.0, 0.4, 0.9])
def test_a_yaw_of_four_degrees_can_be_read_off_the_deck_and_the_coasts(deck_cover: float) -> None:
    """Fifty matches and more within 3 px of f tan; their median column is 0.3 px off at most (a block is 2 px)."""
    sky, R = _sky(deck_cover=deck_cover), matrix_from_yaw_pitch_roll(np.deg2rad(4.0), 0.0, 0.0)
    before, after = _matches(_frame(sky, np.eye(3)), _frame(sky, R))
    x, y = _tangents(before).T
    d = np.column_stack([np.ones(len(x)), -x, -y]) @ R
    wanted = np.column_stack([-d[:, 1] / d[:, 0], -d[:, 2] / d[:, 0]])
    off_px = 2.0 * FOCAL_BLOCKS * (_tangents(after) - wanted)
    inliers = np.hypot(*off_px.T) < 3.0
    assert inliers.sum() >= 50
    assert inliers.mean() > 0.9
    assert np.median(np.abs(off_px[inliers, 0])) < 0.3
    assert abs(np.median(off_px[inliers, 0])) < 0.1


@pytest.mark.parametrize("way_m", [(360.0, 0.0, 0.0), (900.0, 500.0, -100.0)])
def test_features_stay_in_place_as_the_camera_flies_on(way_m: tuple[float, float, float]) -> None:
    """Two and five seconds on, across a change of key: ground without a deck, against its sphere; no swimming.

    Level ways stay; the sphere's top is under the camera.
    """
    sky, start = _sky(deck_cover=0.0), np.array([700.0, 0.0, 0.0])
    R = matrix_from_yaw_pitch_roll(0.0, 0.1, 0.0)
    before, after = _matches(_frame(sky, R, start), _frame(sky, R, start + way_m))
    x, y = _tangents(before).T
    d = np.column_stack([np.ones(len(x)), -x, -y]) @ R.T
    d /= np.linalg.norm(d, axis=1, keepdims=True)
    meets, distance, _ = meet_sphere(d[:, 2], RADIUS_M, ALTITUDE_M)
    level = d[:, :2] * distance[:, None] - way_m[:2]
    sag = RADIUS_M - np.sqrt(RADIUS_M**2 - (level**2).sum(axis=1))
    c = np.column_stack([level, -(ALTITUDE_M + way_m[2]) - sag]) @ R
    off_px = 2.0 * FOCAL_BLOCKS * (_tangents(after) + c[:, 1:] / c[:, :1])[meets]
    inliers = np.hypot(*off_px.T) < 4.0
    assert inliers.sum() >= 50
    assert np.abs(np.median(off_px[inliers], axis=0)).max() < 0.3


def test_the_picture_is_a_function_of_place_and_attitude_whatever_was_seen_before() -> None:
    R, place = exp(np.array([0.2, 0.1, -0.5])), np.array([5000.0, 1234.0, 50.0])
    travelled, fresh = _sky(), _sky()
    for step in range(4):
        _frame(travelled, R, step * np.array([1700.0, 0.0, 0.0]))
    assert np.array_equal(_frame(travelled, R, place), _frame(fresh, R, place))


def test_a_window_far_from_the_start_is_the_full_pictures_bit_for_bit() -> None:
    sky, R, place = _sky(), exp(np.array([0.3, 0.15, -0.5])), np.array([4321.0, -876.0, 120.0])
    whole = _frame(sky, R, place)
    for rows, columns in (
        (slice(0, 9), slice(0, 40)),
        (slice(250, 400), slice(500, 650)),
        (slice(540, 544), slice(7, 8)),
    ):
        part = np.empty((len(Y[rows]), len(X[columns])), dtype=np.float32)
        _sky().fill(part, R, X[columns], Y[rows], place)
        assert np.array_equal(part, whole[rows, columns])


@pytest.mark.parametrize("heading_m", [(20.0, 0.0, 0.0), (-4.0, 20.0, 0.0)])
def test_the_next_key_is_made_bit_by_bit_and_right(heading_m: tuple[float, float, float]) -> None:
    """Across a change of key, 20 m a frame: none makes more than a twentieth of the first frame's nodes.

    Each picture is that of a table which was never anywhere else, bit for bit.
    """
    made: list[int] = []

    def counted(d: np.ndarray, key_m: np.ndarray) -> np.ndarray:
        made.append(len(d))
        return _waves(d, key_m)

    R, below = matrix_from_yaw_pitch_roll(0.0, 0.2, 0.0), np.empty((len(Y), 2), dtype=np.int64)
    columns_below(R, X, Y, dip_sine(RADIUS_M, ALTITUDE_M), below)
    flown, of_frame = LayerTable(counted, 32, 2, ALTITUDE_M, RADIUS_M), []
    for step in range(100):
        made.clear()
        nodes = flown.nodes(step * np.array(heading_m), R, X, Y, below)
        of_frame.append(sum(made))
        if step % 20 == 10:
            at = step * np.array(heading_m)
            pictures = []
            for table in (nodes, _table(2).nodes(at, R, X, Y, below)):
                out = np.zeros((len(Y), len(X)), dtype=np.float32)
                lay_under(out, R, X, Y, below, _table(1).nodes(at, R, X, Y, below), table)
                pictures.append(out)
            assert np.array_equal(*pictures)
    assert max(of_frame[1:]) < of_frame[0] / 20
    assert sum(of_frame[1:]) > 0.9 * of_frame[0]


def test_of_what_is_planned_the_share_asked_for_is_made_and_another_key_begins_anew() -> None:
    """Half of two tiles is one, whatever was planned and made under the key before."""
    made: list[int] = []

    def counted(d: np.ndarray, key_m: np.ndarray) -> np.ndarray:
        made.append(len(d))
        return _ground(d, key_m)

    tiles = LayerTiles(counted, 32, 1)
    for key in ((0.0, 0.0, 0.0), (2000.0, 0.0, 0.0), (2000.0, 2000.0, 0.0)):
        tiles.restart(key)
        assert tiles.lacks_work and not tiles.is_known.any()
        tiles.plan([(31, 4), (31, 5)])
        made.clear()
        for _ in range(2):  # twice is once
            tiles.prepare(0.5)
            assert sum(made) == SIDE * SIDE
        assert not tiles.lacks_work and tiles.is_known.sum() == 1


def test_what_was_made_ahead_is_not_made_again_and_is_the_same() -> None:
    """With time between frames none makes a node: neither of a wider view than before, nor under the next key."""
    made: list[int] = []

    def counted(d: np.ndarray, key_m: np.ndarray) -> np.ndarray:
        made.append(len(d))
        return _waves(d, key_m)

    R, below = matrix_from_yaw_pitch_roll(0.0, 0.2, 0.0), np.empty((len(Y), 2), dtype=np.int64)
    columns_below(R, X, Y, dip_sine(RADIUS_M, ALTITUDE_M), below)
    narrow = np.where(np.arange(len(Y))[:, None] // 20 == 20, np.minimum(below, 100), 0)
    flown, at = LayerTable(counted, 32, 2, ALTITUDE_M, RADIUS_M), np.zeros(3)
    for step in range(80):
        at = step * np.array([20.0, 0.0, 0.0])
        made.clear()
        nodes = flown.nodes(at, R, X, Y, below if step in (20, 79) else narrow)
        assert step == 0 or not made
        while flown.work_ahead(at, R, X, Y, below):
            pass
    pictures = []
    for table in (nodes, _table(2).nodes(at, R, X, Y, below)):
        out = np.zeros((len(Y), len(X)), dtype=np.float32)
        lay_under(out, R, X, Y, below, _table(1).nodes(at, R, X, Y, below), table)
        pictures.append(out)
    assert np.array_equal(*pictures)


def test_a_new_key_changes_no_more_than_what_is_between_nodes() -> None:
    """Two places a metre apart, on either side of a change: as unlike as two of one key a metre apart, to a few."""
    sky, R = _sky(), matrix_from_yaw_pitch_roll(0.0, 0.1, 0.0)
    step = (ALTITUDE_M - SHEET.deck_top_m) / 3.0
    at = [0.5 * step - 1.5, 0.5 * step - 0.5, 0.5 * step + 0.5]
    frames = [_frame(sky, R, np.array([x, 0.0, 0.0])) for x in at]
    same, other = np.abs(frames[1] - frames[0]).mean(), np.abs(frames[2] - frames[1]).mean()
    assert other < 0.03
    assert abs(frames[2].mean() - frames[1].mean()) < 1e-3
    assert same < other
