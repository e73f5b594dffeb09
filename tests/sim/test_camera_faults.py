"""What breaks, seen in the picture: one test a fault of LEDs and camera."""

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from dockair.errors import DockairError
from dockair.messages import CameraFrame, Window
from dockair.sim import faults
from dockair.sim.camera.camera import NearInfraredCamera

Made = tuple[Any, NearInfraredCamera]
WINDOW = Window(350, 750, 820, 1220)
AFTER_S = 2.0  # faults begin here


def shot(made: Made, time_s: float, number: int = 0) -> CameraFrame:
    world, camera = made
    frame = camera.expose(world.data, time_s, number, WINDOW)
    assert frame is not None
    return frame


def led_electrons(made: Made, time_s: float) -> np.ndarray:
    """Electrons of each LED's surroundings over what is there when all are off."""
    world, camera = made
    image = camera.expected_electrons(world.data, WINDOW, time_s).astype(float)
    total = []
    for u, v in camera.led_pixels(world.data):
        r, c = round(v) - WINDOW.row_start, round(u) - WINDOW.column_start
        total.append(image[r - 6 : r + 7, c - 6 : c + 7].sum())
    return np.array(total)


def of_leds(make_camera: Callable[..., Made], fault: faults.Fault, time_s: float = AFTER_S + 1.0) -> np.ndarray:
    """What the fault leaves of each LED's light."""
    dark = led_electrons(make_camera(faults=(faults.LedOff(),), hub=False), time_s)
    sound = led_electrons(make_camera(hub=False), time_s)
    return (led_electrons(make_camera(faults=(fault,), hub=False), time_s) - dark) / (sound - dark)


def test_leds_that_are_off_are_missing_and_the_others_are_as_before(make_camera: Callable[..., Made]) -> None:
    fault = faults.LedOff(leds=(2, 5), start_s=AFTER_S)
    np.testing.assert_allclose(of_leds(make_camera, fault), [1, 1, 0, 1, 1, 0, 1, 1], atol=2e-3)
    np.testing.assert_allclose(of_leds(make_camera, fault, AFTER_S - 0.1), np.ones(8), atol=2e-3)


def test_dim_leds_have_the_asked_part_of_their_light(make_camera: Callable[..., Made]) -> None:
    left = of_leds(make_camera, faults.LedDim(leds=(0,), factor=0.3))
    np.testing.assert_allclose(left, [0.3, 1, 1, 1, 1, 1, 1, 1], atol=2e-3)


def test_flickering_leds_are_dark_in_the_second_part_of_each_period(make_camera: Callable[..., Made]) -> None:
    fault = faults.LedFlicker(leds=(1,), frequency_hz=10.0, duty=0.5, depth=0.8, start_s=AFTER_S)
    np.testing.assert_allclose(of_leds(make_camera, fault, AFTER_S + 0.025)[1], 1.0, atol=2e-3)
    np.testing.assert_allclose(of_leds(make_camera, fault, AFTER_S + 0.075)[1], 0.2, atol=2e-3)


def test_a_camera_that_has_dropped_out_sends_nothing_and_comes_back(make_camera: Callable[..., Made]) -> None:
    world, camera = make_camera(faults=(faults.CameraDropOut(start_s=AFTER_S, stop_s=AFTER_S + 0.5),))
    assert camera.expose(world.data, AFTER_S - 0.01, 0, WINDOW) is not None
    assert camera.expose(world.data, AFTER_S, 1, WINDOW) is None
    assert camera.expose(world.data, AFTER_S + 0.5, 2, WINDOW) is not None


def test_a_stuck_camera_sends_its_last_picture_with_new_stamps(make_camera: Callable[..., Made]) -> None:
    made = make_camera(faults=(faults.StuckFrame(start_s=AFTER_S, stop_s=AFTER_S + 0.5),))
    world, camera = made
    last = shot(made, AFTER_S - 0.02)
    world.put_drogue(camera, np.array([7.0, 0.0, 0.1]))
    stuck = [shot(made, AFTER_S + 0.02 * k, 1 + k) for k in range(3)]
    assert all(np.array_equal(frame.pixels, last.pixels) and frame.window == last.window for frame in stuck)
    assert [frame.time_stamp_s for frame in stuck] == [AFTER_S + 0.02 * k for k in range(3)]
    assert not np.array_equal(shot(made, AFTER_S + 0.5, 9).pixels, last.pixels)


def test_hot_pixels_are_white_at_the_same_places_in_every_frame_and_window(make_camera: Callable[..., Made]) -> None:
    made = make_camera(faults=(faults.HotPixels(count=3000, start_s=AFTER_S),))
    world, camera = made
    white = [shot(made, AFTER_S + 0.02 * k, k).pixels == 255 for k in range(3)]
    assert np.array_equal(white[0], white[1]) and np.array_equal(white[0], white[2])
    full = camera.expose(world.data, AFTER_S, 0, None)
    assert full is not None
    assert (full.pixels == 255).sum() == 3000
    part = full.pixels[WINDOW.row_start : WINDOW.row_stop, WINDOW.column_start : WINDOW.column_stop]
    assert np.array_equal(part == 255, white[0])
    assert not (shot(made, AFTER_S - 0.02).pixels == 255).any()


def test_a_dirty_window_takes_light_and_spreads_the_suns(make_camera: Callable[..., Made]) -> None:
    world, camera = make_camera()
    sun_W = camera.pose(world.data)[0] @ np.array([1.0, 0.25, 0.1])
    fault = faults.DirtyWindow(cover=0.5, start_s=AFTER_S)
    clean = make_camera(sun_W=sun_W)[1].expected_electrons(world.data, WINDOW, AFTER_S)
    dirty_camera = make_camera(sun_W=sun_W, faults=(fault,))[1]
    dirty = dirty_camera.expected_electrons(world.data, WINDOW, AFTER_S)
    assert np.array_equal(dirty_camera.expected_electrons(world.data, WINDOW, AFTER_S - 0.1), clean)
    assert np.median(dirty) > 1.02 * np.median(clean)  # the veil grows by more than the smudges take
    of_leds_left = of_leds(make_camera, fault, AFTER_S)
    assert of_leds_left.min() < 0.95 and of_leds_left.max() <= 1.0 + 1e-3


def test_the_same_smudges_lie_in_every_frame(make_camera: Callable[..., Made]) -> None:
    first, again = (make_camera(faults=(faults.DirtyWindow(cover=0.3),)) for _ in range(2))
    for k in range(2):
        assert np.array_equal(shot(first, 0.02 * k, k).pixels, shot(again, 0.02 * k, k).pixels)


def test_a_stuck_exposure_stays_whatever_the_picture(make_camera: Callable[..., Made]) -> None:
    made = make_camera(faults=(faults.ExposureStuck(exposure_s=400e-6, start_s=AFTER_S),), automatic_exposure=True)
    assert shot(made, AFTER_S - 0.02).exposure_s == pytest.approx(20e-6)
    frames = [shot(made, AFTER_S + 0.02 * k, k) for k in range(4)]
    assert [frame.exposure_s for frame in frames] == [400e-6] * 4
    assert frames[-1].pixels.max() == 255


def test_an_exposure_that_the_hardware_cannot_make_is_refused_with_its_limits(make_camera: Callable[..., Made]) -> None:
    with pytest.raises(DockairError, match=r"faults.exposure_us: expected 14 to 500 us, .* got 5000"):
        make_camera(faults=(faults.ExposureStuck(exposure_s=5e-3),))
