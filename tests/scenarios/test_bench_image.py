"""How the image bench counts what a detector finds, and which of OpenCV's parameters it takes."""

from types import SimpleNamespace

import numpy as np

from dockair.scenarios.bench import image

LEDS_PX = np.array([[10.0, 10.0], [50.0, 10.0], [90.0, 10.0]])
SHOT = SimpleNamespace(leds_px=LEDS_PX, visible=np.array([True, True, False]))


def _found(*points):
    return lambda shot: np.array(points, dtype=float).reshape(-1, 2)


def test_what_counts_are_leds_that_nothing_hides_within_two_pixels_and_blobs_on_none_count_against():
    assert image._score(_found((11.0, 11.0), (52.5, 10.0), (90.0, 10.0), (70.0, 70.0)), SHOT) == (1, 2)
    assert image._score(_found(), SHOT) == (0, 0)


def test_the_parameters_taken_find_most_leds_and_of_those_the_fewest_other_blobs():
    on_led, off = [tuple(led) for led in LEDS_PX], [(70.0, 70.0), (30.0, 90.0)]
    choices = {
        "one": _found(on_led[0]), "both, two others": _found(*on_led[:2], *off), "both": _found(*on_led[:2], off[0])
    }  # fmt: skip
    assert max(choices, key=lambda choice: image._merit(choices, [SHOT, SHOT], choice)) == "both"


def test_components_of_three_to_four_hundred_pixels_are_kept():
    mask = np.zeros((100, 100), np.uint8)
    for row, area in enumerate((2, 3, 20)):
        mask[4 * row, :area] = 255
    mask[20:40, :20] = 255  # 400
    mask[50:70, :20] = mask[70, :1] = 255  # 401
    np.testing.assert_allclose(image._centres_of_components(mask), [[1.0, 4.0], [9.5, 8.0], [9.5, 29.5]])


def test_a_plain_threshold_lies_above_the_frame_s_median_and_an_adaptive_one_above_the_neighbours_mean():
    pixels = np.full((80, 80), 50, np.uint8)
    pixels[40, 40:44] = 62
    shot = SimpleNamespace(frame=SimpleNamespace(pixels=pixels))
    for chain in (
        lambda above: image._plain_chain(shot, above, None),
        lambda above: image._adaptive_chain(shot, above),
    ):
        np.testing.assert_allclose(chain(8), [[41.5, 40.0]])
        assert chain(20).shape == (0, 2)
