"""Visual heading: turns of rendered landscapes and of shifted pictures, what is refused, and what a user may give."""

import cv2
import numpy as np
import pytest

from dockair.calibration import Camera
from dockair.errors import DockairError
from dockair.nav.heading.visual import (
    HeadingLine,
    TurnStatus,
    VisualHeading,
    VisualSettings,
    fit_heading_line,
    measure_turn,
)
from dockair.rotations import matrix_from_yaw_pitch_roll
from dockair.scenarios.reproduce.heading.scene import random_landscape

DEGREE = np.pi / 180.0
FOCAL_PX = 900.0
LINE = HeadingLine.of_focal_length(FOCAL_PX)
CAMERA = Camera(
    focal_length_m=0.016, pixel_pitch_m=0.016 / 900.0, width_px=1280, height_px=480, principal_point_px=(639.5, 239.5)
)


@pytest.fixture(scope="module")
def landscape():
    return random_landscape(1, panels=90, distances_m=(100.0, 600.0))


@pytest.fixture(scope="module")
def ahead(landscape):
    return landscape.image(0.0, 0.0, 0.0)


def _texture(seed, shape):
    rng = np.random.default_rng(seed)
    grains = [cv2.resize(rng.uniform(0.0, 1.0, (shape[0] // g, shape[1] // g)), shape[::-1]) for g in (2, 6, 20)]
    return (60.0 * sum(grains)).astype(np.uint8)


@pytest.mark.parametrize("calibration", [LINE, CAMERA], ids=["line", "camera"])
@pytest.mark.parametrize("turn_deg", [-6.0, 4.0])
def test_a_known_turn_is_seen_to_a_fiftieth_of_a_degree(landscape, ahead, calibration, turn_deg):
    turn = measure_turn(ahead, landscape.image(0.0, 0.0, turn_deg * DEGREE), calibration)
    assert turn.status is TurnStatus.MEASURED
    assert turn.turn_rad == pytest.approx(turn_deg * DEGREE, abs=0.02 * DEGREE)
    assert np.sign(turn.shift_px) == np.sign(turn_deg)  # to the left moves what is seen to the right


def test_going_forward_between_two_pictures_of_a_turn_does_not_shorten_it():
    """Things 40 m to 400 m away, 2.5 m forward; the plain mean, with the line of a plain mean, is off by more."""
    scene = random_landscape(3, panels=120, distances_m=(40.0, 400.0))
    errors = {True: [], False: []}
    for start in np.radians([0.0, 120.0, 240.0]):
        ahead = scene.image(0.0, 0.0, float(start))
        place = 2.5 * np.cos(start), 2.5 * np.sin(start)
        later = scene.image(*place, float(start + 5.0 * DEGREE))
        for spreads, each in errors.items():
            each.append(measure_turn(ahead, later, LINE, VisualSettings(spreads=spreads)).turn_rad - 5.0 * DEGREE)
    rms = {spreads: float(np.sqrt(np.mean(np.square(each)))) for spreads, each in errors.items()}
    assert rms[True] < 0.25 * DEGREE
    assert rms[False] > 1.5 * rms[True]


def test_the_same_picture_twice_is_no_turn_to_the_bit(ahead):
    assert measure_turn(ahead, ahead, LINE).turn_rad == 0.0
    assert measure_turn(ahead, ahead, HeadingLine(slope_rad_px=1e-3, offset_rad=0.02)).turn_rad == pytest.approx(0.02)


def test_a_mirrored_pair_turns_the_other_way(landscape, ahead):
    other = landscape.image(0.0, 0.0, 4.0 * DEGREE)
    mirrored = [np.ascontiguousarray(picture[:, ::-1]) for picture in (ahead, other)]
    turns = [measure_turn(ahead, other, LINE).turn_rad, measure_turn(*mirrored, LINE).turn_rad]
    assert turns[0] == pytest.approx(-turns[1], abs=0.01 * DEGREE)


def test_a_banked_camera_sees_the_turn_of_its_heading():
    """A pure rotation is a homography: the second picture is warped, banked by 25 degrees and pitched by 3."""
    picture = _texture(4, (1088, 2048))
    camera = Camera()
    f, (u, v) = camera.focal_length_px, camera.principal_point_px
    from_axes = np.array(
        [[0.0, 0.0, 1.0], [-1.0, 0.0, 0.0], [0.0, -1.0, 0.0]]
    )  # camera's x y z from right, down, ahead
    K = np.array([[f, 0.0, u], [0.0, f, v], [0.0, 0.0, 1.0]])
    R_HC = matrix_from_yaw_pitch_roll(0.0, 3.0 * DEGREE, 25.0 * DEGREE)
    R_12 = R_HC.T @ matrix_from_yaw_pitch_roll(3.0 * DEGREE, 0.0, 0.0) @ R_HC  # from the second camera's axes
    H = K @ from_axes.T @ R_12.T @ from_axes @ np.linalg.inv(K)
    second = cv2.warpPerspective(picture, H, (2048, 1088))
    turn = measure_turn(picture, second, camera, attitudes_R_HC=(R_HC, R_HC))
    assert turn.turn_rad == pytest.approx(3.0 * DEGREE, abs=0.02 * DEGREE)
    unaware = measure_turn(picture, second, camera)
    assert abs(unaware.turn_rad - 3.0 * DEGREE) > 0.1 * DEGREE


def test_what_moves_with_the_camera_is_left_out_by_a_mask_and_misleads_without():
    far = _texture(5, (480, 1700))
    near = _texture(6, (440, 860))
    pictures = []
    for shift in (0, 60):
        picture = far[:, 200 - shift : 1480 - shift].copy()
        picture[20:460, 210:1070] = near
        pictures.append(picture)
    mask = np.ones((480, 1280), bool)
    mask[:, 200:1080] = False
    masked = measure_turn(*pictures, LINE, VisualSettings(spreads=False), masks=(mask, mask))
    assert masked.shift_px == pytest.approx(60.0, abs=0.3)
    assert measure_turn(*pictures, LINE, VisualSettings(spreads=False)).shift_px != pytest.approx(60.0, abs=5.0)


def test_pictures_of_different_places_are_refused():
    turn = measure_turn(_texture(7, (480, 1280)), _texture(8, (480, 1280)), LINE)
    assert turn.status in (TurnStatus.TOO_FEW, TurnStatus.DISAGREE)
    assert np.isnan(turn.turn_rad) and len(turn.pixels[0]) == 0


@pytest.mark.parametrize("level", [0, 255])
def test_pictures_without_structure_have_too_few_matches(level):
    flat = np.full((200, 300), level, np.uint8)
    assert measure_turn(flat, flat, LINE).status is TurnStatus.TOO_FEW


def test_key_frames_keep_a_still_camera_s_heading_from_wandering(ahead):
    """Twenty noisy pictures of one view: one key frame, and no walk."""
    rng, visual = np.random.default_rng(0), VisualHeading(LINE)
    for _ in range(20):
        visual.step(np.clip(ahead + rng.normal(0.0, 4.0, ahead.shape), 0, 255).astype(np.uint8))
    assert visual.key_frames == 1
    assert abs(visual.heading_rad) < 0.02 * DEGREE


def test_a_long_turn_adds_up_over_key_frames(landscape):
    visual = VisualHeading(LINE)
    for degrees in np.arange(0.0, 40.1, 4.0):
        visual.step(landscape.image(0.0, 0.0, float(degrees) * DEGREE))
    assert visual.key_frames >= 4
    assert visual.heading_rad == pytest.approx(40.0 * DEGREE, abs=0.1 * DEGREE)


def test_over_a_refused_picture_the_gyro_carries_the_heading(landscape, ahead):
    visual = VisualHeading(LINE)
    visual.step(ahead)
    refused = visual.step(np.zeros_like(ahead), predicted_turn_rad=0.05)
    assert refused.status is TurnStatus.TOO_FEW and visual.heading_rad == 0.05
    visual.step(landscape.image(0.0, 0.0, 0.1), predicted_turn_rad=0.05)  # the new key frame after the dark one
    visual.step(landscape.image(0.0, 0.0, 0.15), predicted_turn_rad=0.05)
    assert visual.heading_rad == pytest.approx(0.15, abs=5e-4)


def test_the_line_through_known_turns_is_the_least_squares_one():
    x = np.array([-80.0, -20.0, 10.0, 50.0, 100.0])
    exact = fit_heading_line(x, np.radians(0.0272 * x + 0.0272), with_offset=True)
    assert np.degrees(exact.slope_rad_px) == pytest.approx(0.0272)
    assert np.degrees(exact.turn_rad(100.0)) == pytest.approx(2.75, abs=0.003)  # the source's printed example
    through_zero, d = fit_heading_line(x, 1e-3 * x + 0.01), 1e-3 * x + 0.01
    assert through_zero.offset_rad == 0.0
    assert through_zero.slope_rad_px == pytest.approx((x * d).sum() / (x * x).sum(), rel=1e-9)


def test_a_dim_picture_s_structure_is_found_as_well(landscape, ahead):
    """A fifth of the contrast: exposure belongs to the LEDs and not to the landscape."""
    other = landscape.image(0.0, 0.0, 3.0 * DEGREE)
    dim = [picture // 5 + 10 for picture in (ahead, other)]
    turn = measure_turn(*dim, LINE)
    assert turn.turn_rad == pytest.approx(3.0 * DEGREE, abs=0.02 * DEGREE)
    assert turn.matches > 0.5 * measure_turn(ahead, other, LINE).matches


def test_sixteen_bit_pictures_are_seen_like_eight_bit_ones(landscape, ahead):
    other = landscape.image(0.0, 0.0, 3.0 * DEGREE)
    deep = [picture.astype(np.uint16) << 4 for picture in (ahead, other)]
    assert measure_turn(*deep, LINE).turn_rad == pytest.approx(measure_turn(ahead, other, LINE).turn_rad, abs=1e-4)


@pytest.mark.parametrize(
    ("where", "make"),
    [
        ("image", lambda: measure_turn(np.zeros((4, 4), np.uint8), np.zeros((4, 4), np.uint8), LINE)),
        ("image", lambda: measure_turn(np.zeros((40, 40)), np.zeros((40, 40)), LINE)),
        ("image", lambda: VisualHeading(LINE).step(np.zeros((40, 40, 3), np.uint8))),
        ("second", lambda: measure_turn(np.zeros((40, 40), np.uint8), np.zeros((40, 41), np.uint8), LINE)),
        ("mask", lambda: VisualHeading(LINE).step(np.zeros((40, 40), np.uint8), mask=np.ones((4, 4), bool))),
        ("mask", lambda: VisualHeading(LINE).step(np.zeros((40, 40), np.uint8), mask=np.ones((40, 40), int))),
        ("focal_length_px", lambda: HeadingLine.of_focal_length(0.0)),
        ("scale", lambda: VisualSettings(scale=0.0)),
        ("fewest_matches", lambda: VisualSettings(fewest_matches=0)),
        ("shifts_px", lambda: fit_heading_line([1.0, 2.0], [1.0])),
        ("shifts_px", lambda: fit_heading_line([0.0, 0.0], [1.0, 2.0])),
    ],
)
def test_what_cannot_be_is_refused_by_name(where, make):
    with pytest.raises(DockairError, match=where):
        make()
