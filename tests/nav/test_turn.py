"""Turns from features whose places are known: over ground by closed form, near things, and what is too uncertain."""

from dataclasses import replace

import numpy as np
import pytest

from dockair.calibration import Camera
from dockair.nav.heading.features import Features
from dockair.nav.heading.turn import HeadingLine, TurnStatus, VisualSettings, _shared, turn_between
from dockair.nav.heading.visual import VisualHeading
from dockair.rotations import matrix_from_yaw_pitch_roll

DEGREE = np.pi / 180.0
CAMERA = Camera()
AIRCRAFT = VisualSettings.for_aircraft()
HEIGHT_M, TURN = 5000.0, 2.6 * DEGREE


def _features(pixels, numbers, R_HC=None):
    """Features whose descriptors are those of their numbers."""
    descriptors = np.stack([np.random.default_rng(int(n)).standard_normal(128) for n in numbers]).astype(np.float32)
    return Features(np.asarray(pixels), descriptors, R_HC, 0.5 * (CAMERA.width_px - 1))


def _over_ground(*, forward_m, left_m, turn=TURN, bank=-25.0 * DEGREE, count=500, noise_px=0.0):
    """Two images of points of a plane below, and what is seen of them, the camera banked and the nose 4 degrees up."""
    rng = np.random.default_rng(3)
    far = HEIGHT_M / np.tan(rng.uniform(1.0, 12.0, count) * DEGREE)
    azimuth = rng.uniform(-25.0, 25.0, count) * DEGREE
    points = np.column_stack([far * np.cos(azimuth), far * np.sin(azimuth), np.full(count, -HEIGHT_M)])
    level = matrix_from_yaw_pitch_roll(0.0, -4.0 * DEGREE, 0.0) @ matrix_from_yaw_pitch_roll(0.0, 0.0, bank)
    yaw = [matrix_from_yaw_pitch_roll(s * turn, 0.0, 0.0) for s in (-0.5, 0.5)]
    way = np.array([forward_m, left_m, 0.0])  # in axes along the heading halfway
    pixels = [
        CAMERA.pixels_from_points((points - p) @ Y @ level) for Y, p in zip(yaw, (-0.5 * way, 0.5 * way), strict=True)
    ]
    size = CAMERA.width_px, CAMERA.height_px
    inside = np.logical_and(*[((p >= 0.0) & (p < size)).all(axis=1) for p in pixels])
    assert inside.sum() > 60
    noisy = [p[inside] + noise_px * rng.standard_normal((int(inside.sum()), 2)) for p in pixels]
    return [_features(p, np.flatnonzero(inside), level) for p in noisy]


@pytest.mark.parametrize("turn_deg", [-2.6, 0.0, 2.6])
@pytest.mark.parametrize("left_m", [-20.0, 0.0, 20.0])
def test_the_way_over_ground_takes_nothing_of_the_turn(turn_deg, left_m):
    """360 m forward in 2 s, 3 degrees of drift to either side; the plane is seen 1 to 12 degrees below the level."""
    one, two = _over_ground(forward_m=360.0, left_m=left_m, turn=turn_deg * DEGREE)
    turn = turn_between(one, two, CAMERA, AIRCRAFT)
    assert turn.status is TurnStatus.MEASURED
    assert turn.turn_rad == pytest.approx(turn_deg * DEGREE, abs=0.01 * DEGREE)
    assert turn.shift_px == pytest.approx(CAMERA.focal_length_px * turn.turn_rad)


def test_without_the_model_of_the_ground_the_same_images_are_off_by_more():
    one, two = _over_ground(forward_m=720.0, left_m=-40.0)
    errors = [
        abs(turn_between(one, two, CAMERA, replace(AIRCRAFT, over_ground=over)).turn_rad - TURN)
        for over in (True, False)
    ]
    assert errors[0] < 0.01 * DEGREE < 0.03 * DEGREE < errors[1]


def test_sigma_of_the_turn_over_ground_is_its_scatter():
    """100 noisy pairs: scatter of the scatter 7 %; bounds at three and a half of these."""
    exact = _over_ground(forward_m=360.0, left_m=0.0)
    rng, turns = np.random.default_rng(5), []
    for _ in range(100):
        noisy = [replace(f, pixels=f.pixels + 0.4 * rng.standard_normal(f.pixels.shape)) for f in exact]
        turns.append(turn_between(*noisy, CAMERA, AIRCRAFT))
    scatter, sigma = np.std([t.turn_rad for t in turns]), np.mean([t.sigma_rad for t in turns])
    assert 0.75 < scatter / sigma < 1.25


def test_the_way_sideways_alone_has_a_prior():
    """Where it is known there is none, the turn is surer; the way forward is 0.07 of the height, and free."""
    one, two = _over_ground(forward_m=360.0, left_m=0.0, noise_px=0.2)
    known, free = (turn_between(one, two, CAMERA, replace(AIRCRAFT, sideways=s)) for s in (1e-6, 1e3))
    assert known.turn_rad == pytest.approx(TURN, abs=0.02 * DEGREE)
    assert known.sigma_rad < 0.7 * free.sigma_rad


def test_what_stands_above_the_level_stays_and_shares_the_turn():
    """Clouds at any height beside the ground: all of them turn alike, and none is left out."""
    one, two = _over_ground(forward_m=360.0, left_m=0.0)
    rng, level = np.random.default_rng(8), one.R_HC
    azimuth, elevation = rng.uniform(-12.0, 12.0, 60) * DEGREE, rng.uniform(1.0, 5.0, 60) * DEGREE
    clouds = np.column_stack([np.cos(azimuth), np.sin(azimuth), np.tan(elevation)])
    both = []
    for features, sign in ((one, -0.5), (two, 0.5)):
        pixels = CAMERA.pixels_from_points(clouds @ matrix_from_yaw_pitch_roll(sign * TURN, 0.0, 0.0) @ level)
        more = _features(pixels, np.arange(1000, 1060))
        both.append(
            replace(
                features,
                pixels=np.vstack([features.pixels, more.pixels]),
                descriptors=np.vstack([features.descriptors, more.descriptors]),
            )
        )
    turn = turn_between(*both, CAMERA, AIRCRAFT)
    assert turn.turn_rad == pytest.approx(TURN, abs=0.01 * DEGREE)
    assert len(turn.pixels[0]) == turn.matches == len(both[0].pixels)


def test_of_a_plain_mean_those_within_three_robust_sigmas_count_and_sigma_is_the_mean_s():
    """Alternating +-1, whose robust sigma is 1.4826: 4.3 is within three of these, 4.6 is not."""
    values = np.concatenate([np.tile([1.0, -1.0], 20), [4.3, -4.3, 4.6, -4.6]])
    inside, mean, sigma = _shared(np.ones((44, 1)), values, 0.1, np.zeros((1, 1)))
    np.testing.assert_array_equal(inside, np.abs(values) < 4.5)
    assert mean == pytest.approx(0.0, abs=1e-12)
    assert sigma == pytest.approx(np.sqrt((40.0 + 2.0 * 4.3**2) / 41.0 / 42.0), rel=1e-9)


@pytest.mark.parametrize(
    ("share_it", "others", "least_share", "status"),
    [(10, 4, 0.35, TurnStatus.DISAGREE), (12, 4, 0.35, TurnStatus.MEASURED), (28, 12, 0.72, TurnStatus.DISAGREE),
     (28, 12, 0.68, TurnStatus.MEASURED)],
)  # fmt: skip
def test_matches_disagree_where_too_few_or_too_small_a_share_have_one_shift(share_it, others, least_share, status):
    numbers = np.arange(share_it + others)
    far = np.where(numbers < share_it, 0.0, 100.0 + 40.0 * numbers)
    images = [(PLACES[numbers], numbers), (PLACES[numbers] + SHIFT + far[:, None] * [1.0, 0.0], numbers)]
    settings = VisualSettings(spreads=False, least_share=least_share)
    turn = turn_between(*(_features(*image) for image in images), LINE, settings)
    assert turn.status is status and turn.matches == len(numbers)


def test_a_turn_whose_sigma_is_too_large_is_refused():
    one, two = _over_ground(forward_m=360.0, left_m=0.0, noise_px=0.5)
    sigma = turn_between(one, two, CAMERA, AIRCRAFT).sigma_rad
    refused = turn_between(one, two, CAMERA, replace(AIRCRAFT, largest_sigma_rad=0.9 * sigma))
    assert refused.status is TurnStatus.UNCERTAIN and np.isnan(refused.turn_rad)
    assert (
        turn_between(one, two, CAMERA, replace(AIRCRAFT, largest_sigma_rad=1.1 * sigma)).status is TurnStatus.MEASURED
    )


LINE, PLACES = HeadingLine.of_focal_length(1000.0), np.random.default_rng(0).uniform([200, 100], [1800, 900], (300, 2))
SHIFT = np.array([1000.0 * DEGREE, 0.0])  # of a degree


def _seen_heading(monkeypatch, images):
    """Heading after images (pixels, numbers), the key frames, and the last turn; the gyro says 0.05 rad an image."""
    features = iter([_features(*image) for image in images])
    monkeypatch.setattr("dockair.nav.heading.visual.features_of", lambda *_: next(features))
    visual = VisualHeading(LINE, VisualSettings(spreads=False))
    for _ in images:
        turn = visual.step(np.zeros((16, 16), np.uint8), predicted_turn_rad=0.05)
    return visual.heading_rad, visual.key_frames, turn


def test_an_image_that_shares_nothing_with_the_key_frame_is_measured_from_the_one_before(monkeypatch):
    numbers = [np.arange(first, first + 150) for first in (0, 75, 150)]
    images = [(PLACES[n] + k * SHIFT, n) for k, n in enumerate(numbers)]
    assert _seen_heading(monkeypatch, images)[0] == pytest.approx(2.0 * DEGREE, abs=1e-6)


def test_an_image_misled_against_the_key_frame_is_mended_by_the_one_before(monkeypatch):
    """Of 100 matches of the first and the third image 60 stand near and are 30 px off, 1.7 degrees; alone, they win.

    By Eq. (15) they count 60 x 0.36 against the 140 that the second and the third share.
    """
    numbers = [np.arange(200), np.arange(100, 300), np.r_[0:60, 160:300]]
    near = np.where(numbers[2][:, None] < 60, [30.0, 0.0], [0.0, 0.0])
    third = PLACES[numbers[2]] + 2.0 * SHIFT + near
    images = [(PLACES[numbers[0]], numbers[0]), (PLACES[numbers[1]] + SHIFT, numbers[1]), (third, numbers[2])]
    alone = turn_between(_features(*images[0]), _features(*images[2]), LINE, VisualSettings(spreads=False))
    assert alone.turn_rad == pytest.approx(2.0 * DEGREE + 0.03, abs=1e-6)
    heading, key_frames, turn = _seen_heading(monkeypatch, images)
    assert heading == pytest.approx(2.0 * DEGREE + 0.03 * 21.6 / 161.6, abs=1e-6)
    assert key_frames == 1
    assert turn.turn_rad == heading  # from the key frame, as both pairs have it


@pytest.mark.parametrize(("shared", "key_frames"), [(39, 2), (40, 1)])
def test_an_image_that_shares_too_little_with_the_key_frame_takes_its_place(monkeypatch, shared, key_frames):
    """Though it has turned by a degree alone."""
    numbers = np.arange(100), np.arange(100 - shared, 200 - shared)
    images = [(PLACES[numbers[0]], numbers[0]), (PLACES[numbers[1]] + SHIFT, numbers[1])]
    assert _seen_heading(monkeypatch, images)[:2] == (pytest.approx(DEGREE, abs=1e-6), key_frames)


def test_after_a_refused_image_the_next_is_measured_from_that_one(monkeypatch):
    numbers = np.arange(100), np.arange(100, 200), np.arange(100, 200)
    images = [(PLACES[n] + k * SHIFT, n) for k, n in enumerate(numbers)]
    heading, key_frames, _ = _seen_heading(monkeypatch, images)
    assert heading == pytest.approx(0.05 + DEGREE, abs=1e-6) and key_frames == 2
