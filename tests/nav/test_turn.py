"""Turns from features whose places are known: over ground by closed form, near things, and what is too uncertain."""

from dataclasses import replace

import numpy as np
import pytest

from dockair.calibration import Camera
from dockair.nav.heading.features import Features, matched
from dockair.nav.heading.levelling import without_yaw
from dockair.nav.heading.turn import HeadingLine, TurnStatus, VisualSettings, _shared, turn_between
from dockair.nav.heading.visual import VisualHeading, _Seen
from dockair.rotations import exp, matrix_from_yaw_pitch_roll

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
    [(11, 0, 0.35, TurnStatus.TOO_FEW), (12, 0, 0.35, TurnStatus.MEASURED),
     (10, 4, 0.35, TurnStatus.DISAGREE), (12, 4, 0.35, TurnStatus.MEASURED), (28, 12, 0.72, TurnStatus.DISAGREE),
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
    assert _seen_heading(monkeypatch, images)[:2] == (pytest.approx(2.0 * DEGREE, abs=1e-6), 2)


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


@pytest.mark.parametrize("turn_deg", [-2.6, 2.6])
def test_the_way_back_is_the_turn_back(turn_deg):
    """Azimuths and depressions are halfway between both images, so that neither of them is the first."""
    one, two = _over_ground(forward_m=720.0, left_m=-40.0, turn=turn_deg * DEGREE)
    there, back = turn_between(one, two, CAMERA, AIRCRAFT), turn_between(two, one, CAMERA, AIRCRAFT)
    assert back.turn_rad == pytest.approx(-there.turn_rad, rel=1e-9)
    assert back.sigma_rad == pytest.approx(there.sigma_rad, rel=1e-6)


def test_a_spread_about_the_middle_takes_nothing_of_the_shift():
    """Eq. (13) with its own terms, of matches that all lie to one side."""
    rng, middle = np.random.default_rng(6), 0.5 * (CAMERA.width_px - 1)
    place = rng.uniform(middle, CAMERA.width_px, 100)
    shift = 17.0 + 0.02 * (place - middle) + 1e-5 * (place - middle) ** 2
    rows, numbers = rng.uniform(0.0, 1000.0, 100), np.arange(100)
    images = [_features(np.column_stack([place + s * shift, rows]), numbers) for s in (-0.5, 0.5)]
    turn = turn_between(*images, LINE, VisualSettings())
    assert turn.shift_px == pytest.approx(17.0, abs=1e-9) and turn.turn_rad == pytest.approx(0.017, abs=1e-12)
    assert turn_between(*images, LINE, VisualSettings(spreads=False)).shift_px > 22.0


def test_a_spread_of_azimuths_about_the_heading_takes_nothing_of_the_turn():
    """Eqs. (12) and (13): what lies at the azimuth a halfway has turned by d + k a, all of it to the left."""
    azimuth = np.random.default_rng(7).uniform(0.0, 20.0, 100) * DEGREE
    d = TURN + 0.05 * azimuth
    rays = [np.column_stack([np.cos(a), np.sin(a), np.full(100, 0.1)]) for a in (azimuth + 0.5 * d, azimuth - 0.5 * d)]
    images = [_features(CAMERA.pixels_from_points(ray), np.arange(100)) for ray in rays]
    assert turn_between(*images, CAMERA, VisualSettings()).turn_rad == pytest.approx(TURN, abs=1e-9)
    assert turn_between(*images, CAMERA, VisualSettings(spreads=False)).turn_rad > TURN + 0.3 * DEGREE


def test_sigma_of_a_line_s_turn_is_that_of_the_shift_times_its_slope():
    numbers = np.arange(100)
    noisy = PLACES[numbers] + SHIFT + np.random.default_rng(8).normal(0.0, 2.0, (100, 2))
    images = [_features(PLACES[numbers], numbers), _features(noisy, numbers)]
    for slope in (1e-3, -2e-3):
        turn = turn_between(*images, HeadingLine(slope_rad_px=slope), VisualSettings(spreads=False))
        assert turn.sigma_rad == pytest.approx(abs(slope) * 2.0 / 10.0, rel=0.25)  # a scatter's own is 7 %


@pytest.mark.parametrize(("nearest", "second", "clear"), [(0.74, 1.0, True), (0.76, 1.0, False), (1.0, 0.74, True)])
def test_a_match_is_nearer_than_three_quarters_of_the_second_nearest(nearest, second, clear):
    """Distances of one descriptor from two; a third is far from all."""
    one = Features(np.array([[1.0, 2.0], [3.0, 4.0]]), np.array([[0.0, 0.0], [9.0, 9.0]], np.float32), None, 0.0)
    others = np.array([[nearest, 0.0], [0.0, second], [9.0, 9.0]], np.float32)
    two = Features(np.array([[10.0, 0.0], [20.0, 0.0], [30.0, 0.0]]), others, None, 0.0)
    a, b = matched(one, two, 0.75)
    assert a.tolist() == [[1.0, 2.0]] * clear + [[3.0, 4.0]]
    assert b.tolist() == [[10.0 if nearest < second else 20.0, 0.0]] * clear + [[30.0, 0.0]]


def test_of_two_features_with_one_nearest_the_nearer_is_matched():
    one = Features(np.array([[1.0, 0.0], [2.0, 0.0]]), np.array([[0.2, 0.0], [0.1, 0.0]], np.float32), None, 0.0)
    two = Features(np.array([[5.0, 0.0], [6.0, 0.0]]), np.array([[0.0, 0.0], [9.0, 9.0]], np.float32), None, 0.0)
    a, b = matched(one, two, 0.75)
    assert a.tolist() == [[2.0, 0.0]] and b.tolist() == [[5.0, 0.0]]


def test_an_image_of_one_feature_has_no_second_nearest_and_no_match():
    one, two = _features([[1.0, 2.0]], [1]), _features([[1.0, 2.0], [3.0, 4.0]], [1, 2])
    for pair in ((one, two), (two, one), (one, one)):
        assert [pixels.shape for pixels in matched(*pair, 0.75)] == [(0, 2), (0, 2)]


@pytest.mark.parametrize(("turn_deg", "key_frames"), [(-5.1, 2), (-4.9, 1), (4.9, 1), (5.1, 2)])
def test_an_image_that_has_turned_by_five_degrees_to_either_side_is_the_next_key_frame(
    monkeypatch, turn_deg, key_frames
):
    numbers = np.arange(100)
    images = [(PLACES[numbers] + k * turn_deg * SHIFT, numbers) for k in (0, 1)]
    assert _seen_heading(monkeypatch, images)[1] == key_frames


def test_a_tilt_is_each_image_s_in_axes_along_its_own_heading():
    """Key frame and last image at other headings and attitudes; without attitudes nothing is to be tilted."""
    tilt, R_BC = np.array([0.02, -0.03, 0.0]), matrix_from_yaw_pitch_roll(0.1, 0.05, 0.35)
    visual = VisualHeading(CAMERA)
    visual.tilt(tilt, R_BC)
    seen = [(0.4, matrix_from_yaw_pitch_roll(0.0, -0.1, 0.02)), (2.0, matrix_from_yaw_pitch_roll(0.0, 0.05, -0.3))]
    for attitudes in ([R @ R_BC for _, R in seen], [None, None]):
        visual._key, visual._last = (
            _Seen(_features(PLACES[:3], range(3), R_HC), heading)
            for R_HC, (heading, _) in zip(attitudes, seen, strict=True)
        )
        visual.tilt(tilt, R_BC)
        for image, (heading, R_LB), R_HC in zip((visual._key, visual._last), seen, attitudes, strict=True):
            if R_HC is None:
                assert image.features.R_HC is None
                continue
            along = np.array([[np.cos(heading), np.sin(heading), 0.0], [-np.sin(heading), np.cos(heading), 0.0]])
            expected = without_yaw(exp(np.append(along @ tilt, 0.0)) @ R_LB) @ R_BC
            np.testing.assert_allclose(image.features.R_HC, expected, atol=1e-12)


def test_each_image_is_levelled_by_its_own_attitude():
    """Directions far away, seen in a bank to one side and then in one to the other."""
    rng, images = np.random.default_rng(9), []
    azimuth, slope = rng.uniform(-10.0, 10.0, 100) * DEGREE, rng.uniform(-0.08, 0.08, 100)
    far = np.column_stack([np.cos(azimuth), np.sin(azimuth), slope])
    for bank, yaw in ((-0.3, -0.5 * TURN), (0.1, 0.5 * TURN)):
        level = matrix_from_yaw_pitch_roll(0.0, 0.05, bank)
        pixels = CAMERA.pixels_from_points(far @ matrix_from_yaw_pitch_roll(yaw, 0.0, 0.0) @ level)
        images.append(_features(pixels, np.arange(100), level))
    assert turn_between(*images, CAMERA, VisualSettings()).turn_rad == pytest.approx(TURN, abs=1e-6)


def test_over_a_refused_image_the_gyro_goes_on_from_the_last_heading_not_the_key_frame_s(monkeypatch):
    numbers = np.arange(100), np.arange(100), np.arange(100, 200)
    images = [(PLACES[n] + k * SHIFT, n) for k, n in enumerate(numbers)]
    assert _seen_heading(monkeypatch, images)[0] == pytest.approx(DEGREE + 0.05, abs=1e-6)
