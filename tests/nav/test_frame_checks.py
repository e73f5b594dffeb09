"""Which frames say nothing: their stamps, a picture that comes again, LEDs without numbers."""

import numpy as np
import pytest

from dockair.messages import CameraFrame, LedObservation, Window
from dockair.nav.frame_checks import FrameChecks, with_numbers

NOW_S = 7.0


def frame(pixels, time_s=NOW_S):
    window = Window(0, pixels.shape[0], 0, pixels.shape[1])
    return CameraFrame(time_stamp_s=time_s, pixels=pixels, window=window, exposure_s=2e-5, gain=0.02)


def leds(centroids_px, sigma_px=0.1, time_s=NOW_S):
    n = len(centroids_px)
    return LedObservation(
        time_stamp_s=time_s,
        led_numbers=np.arange(n),
        centroids_px=np.asarray(centroids_px, dtype=float).reshape(n, 2),
        sigma_px=np.broadcast_to(np.asarray(sigma_px, dtype=float), (n,)),
    )


def checks():
    return FrameChecks(ahead_s=0.02, buffer_s=0.45)


@pytest.mark.parametrize(
    ("after_s", "status"),
    [
        (0.0, None),
        (0.02, None),
        (0.021, "frame ahead of the clock"),
        (3600.0, "frame ahead of the clock"),
        (np.nan, "frame ahead of the clock"),
        (np.inf, "frame ahead of the clock"),
        (-0.45, None),
        (-0.451, "frame too old"),
        (-3600.0, "frame too old"),
    ],
)
def test_a_stamp_is_near_the_clock_or_refused(after_s, status):
    assert checks().refused(leds([[1.0, 2.0]], time_s=NOW_S + after_s), NOW_S) == status


@pytest.mark.parametrize("time_s", [1e6, 0.0, np.nan])
def test_before_the_first_sample_of_the_imu_no_stamp_can_be_judged(time_s):
    assert checks().refused(leds([[1.0, 2.0]], time_s=time_s), np.nan) == "no clock"


@pytest.mark.parametrize("row", [0, 1, 63, 64, 299])
def test_a_picture_that_comes_again_is_stuck_and_one_that_differs_in_a_pixel_is_not(row):
    kept, first = checks(), np.random.default_rng(0).integers(0, 4, (300, 200)).astype(np.uint8)
    other = first.copy()
    other[row, 17] += 1
    pictures = (first, other, other.copy(), other, first)
    statuses = [kept.refused(frame(pixels, NOW_S + 0.02 * k), NOW_S + 0.02 * k) for k, pixels in enumerate(pictures)]
    assert statuses == [None, None, "frame stuck", "frame stuck", None]


def test_leds_that_come_again_are_stuck_and_none_at_all_are_not():
    kept, seen = checks(), leds([[10.0, 20.0], [30.0, 40.0]])
    assert [kept.refused(each, NOW_S) for each in (seen, seen, leds([]), leds([]))] == [None, "frame stuck", None, None]
    assert kept.refused(leds([[10.0, 20.0]]), NOW_S) is None


def test_leds_that_come_again_are_stuck_though_one_of_them_has_no_numbers():
    kept, rows = checks(), [[10.0, 20.0], [np.nan, np.nan], [30.0, 40.0]]
    assert [kept.refused(leds(rows), NOW_S) for _ in range(3)] == [None, "frame stuck", "frame stuck"]
    assert kept.refused(leds([[10.0, 20.0], [np.nan, 25.0], [30.0, 40.0]]), NOW_S) is None


def test_a_frame_that_is_out_of_time_is_not_the_one_before():
    kept, seen = checks(), leds([[10.0, 20.0]])
    assert kept.refused(leds([[10.0, 20.0]], time_s=NOW_S + 5.0), NOW_S) == "frame ahead of the clock"
    assert kept.refused(seen, NOW_S) is None


def test_leds_without_numbers_are_left_out():
    centroids = np.arange(16.0).reshape(8, 2)
    centroids[1, 0], centroids[2, 1] = np.nan, np.inf
    sigma = np.full(8, 0.1)
    sigma[[3, 4, 5, 6]] = np.nan, np.inf, 0.0, -0.1
    kept = with_numbers(leds(centroids, sigma), 8)
    assert kept.led_numbers.tolist() == [0, 7]
    np.testing.assert_array_equal(kept.centroids_px, centroids[[0, 7]])
    np.testing.assert_array_equal(kept.sigma_px, [0.1, 0.1])
    whole = leds(np.ones((3, 2)))
    assert with_numbers(whole, 8) is whole and len(with_numbers(leds([]), 8).led_numbers) == 0


def test_pictures_that_are_written_into_one_buffer_are_told_apart():
    kept, rng, buffer, statuses = checks(), np.random.default_rng(0), np.zeros((300, 200), np.uint8), []
    for k in range(4):
        if k != 3:
            buffer[:] = rng.integers(0, 4, buffer.shape)
        statuses.append(kept.refused(frame(buffer, NOW_S + 0.02 * k), NOW_S + 0.02 * k))
    assert statuses == [None, None, None, "frame stuck"]


@pytest.mark.parametrize(
    ("numbers", "left"), [([0, 0, 3], [3]), ([-1, 2, 3], [2, 3]), ([7, 8, 9], [7]), ([5, 5, 5], []), ([8, 8, 1], [1])]
)
def test_leds_with_a_name_that_is_no_led_s_or_another_s_too_are_left_out(numbers, left):
    seen = LedObservation(
        time_stamp_s=NOW_S, led_numbers=np.array(numbers), centroids_px=np.ones((3, 2)), sigma_px=np.full(3, 0.1)
    )
    assert with_numbers(seen, 8).led_numbers.tolist() == left


def test_numbers_of_no_led_at_all_may_be_of_any_kind():
    seen = LedObservation(
        time_stamp_s=NOW_S, led_numbers=np.array([]), centroids_px=np.empty((0, 2)), sigma_px=np.array([])
    )
    assert with_numbers(seen, 8) is seen
