"""What breaks, seen in the picture: one test a fault of LEDs and camera."""

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from dockair.calibration import Camera
from dockair.errors import DockairError
from dockair.messages import CameraFrame, Window
from dockair.sim import faults
from dockair.sim.camera.camera import CameraNoise, NearInfraredCamera
from dockair.sim.camera.defects import Defects
from dockair.sim.camera.dirt import Dirt
from dockair.sim.camera.sheets import CameraSheets

Made = tuple[Any, NearInfraredCamera]
WINDOW = Window(350, 750, 820, 1220)
AFTER_S = 2.0  # faults begin here
SEED = 77  # of the cameras that make_camera makes


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
    """What the fault leaves of each LED's light, its surroundings under the same fault taken off."""
    off = faults.LedOff()
    sound, dark, ill, ill_dark = (
        led_electrons(make_camera(faults=given, hub=False), time_s) for given in ((), (off,), (fault,), (fault, off))
    )
    return (ill - ill_dark) / (sound - dark)


def smudges(made: Made, cover: float) -> Dirt:
    """The dirt of the cameras made here."""
    return Dirt(CameraSheets.load().glare, made[0].as_built.camera, CameraNoise.of(SEED).dirt, cover)


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
    leds_left = smudges((world, camera), 0.5).at(camera.led_pixels(world.data))
    assert leds_left.min() < 0.8
    np.testing.assert_allclose(of_leds(make_camera, fault, AFTER_S), leds_left, atol=2e-3)


def test_smudges_dim_the_suns_disc(make_camera: Callable[..., Made]) -> None:
    """Its pixels hold 1e7 electrons, beside which stray light and sky are nothing."""
    world, camera = make_camera()
    sun_W = camera.pose(world.data)[0] @ np.array([1.0, -0.12, 0.05])
    s_C = sun_W @ camera.pose(world.data)[0]
    u, v = np.rint(world.as_built.camera.pixels_from_points(s_C[None])[0]).astype(int)
    disc = Window(v - 5, v + 6, u - 5, u + 6)
    clean, dirty = (
        make_camera(sun_W=sun_W, faults=given)[1].expected_electrons(world.data, disc)
        for given in ((), (faults.DirtyWindow(cover=0.9),))
    )
    left = smudges((world, camera), 0.9).over((11, 11), (v - 5, u - 5))
    assert clean.min() > 1e6 and left.mean() < 0.9
    np.testing.assert_allclose(dirty / clean, left, rtol=2e-3)


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
    with pytest.raises(DockairError, match=r"faults\[1\].exposure_us: expected 14 to 500 us, .* got 5000"):
        make_camera(faults=(faults.StuckFrame(), faults.ExposureStuck(exposure_s=5e-3)))


def test_more_hot_pixels_than_the_sensor_has_are_refused_before_the_flight(make_camera: Callable[..., Made]) -> None:
    """2048 x 1088 = 2 228 224; two faults of 1.2 million are too many only where they overlap."""
    half = faults.HotPixels(count=1_200_000, stop_s=AFTER_S)
    make_camera(faults=(half, replace(half, start_s=AFTER_S, stop_s=9.0)))
    with pytest.raises(DockairError, match=r"faults\[1\].count: expected up to 2228224 hot pixels .* got 2400000"):
        make_camera(faults=(half, replace(half, start_s=AFTER_S - 0.1, stop_s=9.0)))


def defects(*given: faults.Fault) -> Defects:
    sheets, noise = CameraSheets.load(), CameraNoise.of(SEED)
    return Defects(Camera(), sheets.glare, sheets.exposure, faults.Faults(given, 8), noise.dirt, noise.hot_pixels)


def test_faults_at_the_very_limits_of_the_camera_can_be_and_one_below_the_shortest_exposure_cannot() -> None:
    limits = CameraSheets.load().exposure
    defects(*(faults.ExposureStuck(exposure_s=t) for t in (limits.shortest_s, limits.longest_s)))
    defects(faults.HotPixels(count=2048 * 1088))
    with pytest.raises(DockairError, match=r"faults\[0\].exposure_us: expected 14 to 500 us, .* got 13"):
        defects(faults.ExposureStuck(exposure_s=13e-6))


def test_as_many_pixels_are_hot_as_the_faults_of_the_moment_ask_for() -> None:
    of_camera = defects()
    for count in (7, 30, 0, 7):
        pixels = np.zeros((1088, 2048), dtype=np.uint8)
        of_camera.whiten(pixels, Window(0, 1088, 0, 2048), count)
        assert (pixels == 255).sum() == count


def test_a_camera_that_is_reset_has_no_frame_to_be_stuck_at(make_camera: Callable[..., Made]) -> None:
    made = make_camera(faults=(faults.StuckFrame(start_s=AFTER_S),))
    world, camera = made
    last = shot(made, AFTER_S - 0.02)
    world.put_drogue(camera, np.array([7.0, 0.0, 0.1]))
    assert np.array_equal(shot(made, AFTER_S).pixels, last.pixels)
    camera.reset()
    assert not np.array_equal(shot(made, AFTER_S).pixels, last.pixels)


def test_frames_after_a_drop_out_arrive_as_late_as_without_one(make_camera: Callable[..., Made]) -> None:
    def latencies_s(fault: tuple[faults.Fault, ...]) -> list[float | None]:
        world, camera = make_camera(faults=fault)
        frames = (camera.expose(world.data, AFTER_S + 0.02 * k, k, WINDOW) for k in range(5))
        return [None if frame is None else camera.latency_s(frame) for frame in frames]

    gap = faults.CameraDropOut(start_s=AFTER_S + 0.03, stop_s=AFTER_S + 0.07)
    sound, dropped = latencies_s(()), latencies_s((gap,))
    assert dropped[2:4] == [None, None]
    assert dropped[:2] == sound[:2] and dropped[4] == sound[4]


def test_no_two_sources_of_a_cameras_noise_share_their_numbers() -> None:
    """Nor two seeds."""
    drawn = []
    for noise in (CameraNoise.of(SEED), CameraNoise.of(SEED + 1)):
        drawn += [noise.image, noise.fixed_pattern, noise.hot_pixels, noise.clouds]
        drawn += [int(stream.integers(2**62)) for stream in (noise.transfer, noise.dirt)]
    assert len(set(drawn)) == 12
