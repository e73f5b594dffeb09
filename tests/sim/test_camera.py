"""The whole camera on a small world: receiver, drogue, tanker, and a box that can be moved into the way."""

import hashlib
from collections.abc import Callable
from typing import Any

import mujoco
import numpy as np
import pytest

from dockair.errors import DockairError
from dockair.messages import Window
from dockair.rotations import exp
from dockair.sim.as_built import AsBuilt
from dockair.sim.camera.camera import NearInfraredCamera
from dockair.sim.camera.radiometry import led_electrons, responses
from dockair.sim.camera.readout import readout_time_s
from dockair.sim.camera.sheets import CameraSheets
from dockair.sim.faults import ExposureStuck, StuckFrame

SHEETS = CameraSheets.load()
BEHIND = np.array([-0.8, 0.0, 0.6])
FULL = Window(0, 1088, 0, 2048)
NO_DECK = {"sky": {"deck_cover": 0.0}}
EXPOSURE_S = SHEETS.exposure.exposure_s
Made = tuple[Any, NearInfraredCamera]


def _around(pixel: np.ndarray, half: int) -> Window:
    u, v = np.round(pixel).astype(int)
    return Window(int(v) - half, int(v) + half + 1, int(u) - half, int(u) + half + 1)


def _led_pixels(built: AsBuilt, p_CD: np.ndarray, R_CD: np.ndarray) -> np.ndarray:
    return built.camera.pixels_from_points(p_CD + built.ring_positions_D @ R_CD.T)


@pytest.mark.parametrize("range_m", [3.0, 8.0, 30.0])
def test_a_noise_free_blobs_centroid_is_the_as_built_pinhole_projection(
    make_camera: Callable[..., Made], range_m: float
) -> None:
    """Within 0.01 px, whatever the sub-pixel phase; the background is taken off, not thresholded."""
    world, camera = make_camera(hub=False)
    p_CD, R_CD = np.array([range_m, 0.31, -0.17]), exp(np.array([0.3, 0.1, -0.15]))
    world.put_aside("drogue")
    dark = camera.expected_electrons(world.data, FULL).astype(float)
    world.put_drogue(camera, p_CD, R_CD)
    image = camera.expected_electrons(world.data, FULL).astype(float) - dark
    for pixel in _led_pixels(world.as_built, p_CD, R_CD):
        w = _around(pixel, 6 if range_m < 20.0 else 3)
        blob = np.clip(image[w.row_start : w.row_stop, w.column_start : w.column_stop], 0.0, None)
        # what neighbours' wings add is nearly even: the border's level is taken off
        blob = np.clip(blob - np.concatenate([blob[0], blob[-1], blob[:, 0], blob[:, -1]]).max(), 0.0, None)
        rows, columns = np.indices(blob.shape)
        u = (blob * columns).sum() / blob.sum() + w.column_start
        v = (blob * rows).sum() / blob.sum() + w.row_start
        assert (u, v) == pytest.approx(tuple(pixel), abs=0.01)


@pytest.mark.parametrize("phase_px", [(0.0, 0.0), (0.5, 0.5), (0.23, 0.71)])
@pytest.mark.parametrize("range_m", [3.0, 10.0, 30.0])
def test_the_electrons_in_the_picture_are_the_radiometric_sum(
    make_camera: Callable[..., Made], range_m: float, phase_px: tuple[float, float]
) -> None:
    """Before clipping, all eight blobs with their wings, wherever between pixels they fall: within 0.5 %."""
    world, camera = make_camera(hub=False)
    across = range_m / world.as_built.camera.focal_length_px
    p_CD, R_CD = np.array([range_m, phase_px[0] * across, phase_px[1] * across]), exp(np.array([0.0, 0.1, 0.2]))
    world.put_aside("drogue")
    dark = camera.expected_electrons(world.data, FULL).astype(float)
    world.put_drogue(camera, p_CD, R_CD)
    total = (camera.expected_electrons(world.data, FULL).astype(float) - dark).sum()
    assert total == pytest.approx(_predicted(world.as_built, p_CD, R_CD, EXPOSURE_S), rel=5e-3)


def _predicted(built: AsBuilt, p_CD: np.ndarray, R_CD: np.ndarray, exposure_s: float) -> float:
    s = SHEETS
    response = responses(s.lens, s.filter, s.sensor, s.leds, s.light, built.camera)
    p_CL = p_CD + built.ring_positions_D @ R_CD.T
    return float(led_electrons(response, s.leds, built.led_intensity_w_sr, p_CL, -R_CD[:, 0], exposure_s).sum())


def _settled_peaks(world: Any, camera: NearInfraredCamera, p_CD: np.ndarray) -> tuple[np.ndarray, float]:
    """Peaks of the eight LEDs as parts of full scale, and the exposure, once the exposure control has settled."""
    world.put_drogue(camera, p_CD)
    for k in range(8):
        frame = camera.expose(world.data, 0.0, k, FULL)
        assert frame is not None
    black = round(SHEETS.sensor.black_level_dn / 4.0)
    peaks = []
    for pixel in camera.led_pixels(world.data):
        w = _around(pixel, 2)
        peaks.append(int(frame.pixels[w.row_start : w.row_stop, w.column_start : w.column_stop].max()) - black)
    return np.array(peaks) / (255.0 - black), frame.exposure_s


@pytest.mark.parametrize("range_m", [30.0, 22.0, 15.0, 10.0, 7.0, 5.0])
def test_with_exposure_control_the_leds_peaks_stay_between_30_and_85_percent(
    make_camera: Callable[..., Made], range_m: float
) -> None:
    """LEDs of a brightness bin +-30 % wide, the Sun behind; six places within a pixel.

    The bin spreads peaks 1.86:1 and the place 1.75:1, together 3.3:1, which is more than 85:30. So 45 of 48.
    """
    world, camera = make_camera(BEHIND, automatic_exposure=True, hub=False)
    peaks = []
    for k in range(6):
        p_CD = np.array([range_m, 0.02 + range_m * 1.3e-4 * k, -0.01 + range_m * 0.7e-4 * k])
        of_place, exposure_s = _settled_peaks(world, camera, p_CD)
        peaks.extend(of_place)
        assert SHEETS.exposure.shortest_s <= exposure_s <= SHEETS.exposure.longest_s
    within = sum(0.30 <= peak <= 0.85 for peak in peaks)
    assert within >= 45, sorted(peaks)
    assert min(peaks) >= 0.25 and max(peaks) <= 0.92


def test_nearer_than_5_metres_the_leds_clip_no_more_than_threefold(make_camera: Callable[..., Made]) -> None:
    """At the shortest exposure, from 5 m to where the probe is in the coupling."""
    world, camera = make_camera(automatic_exposure=True, hub=False)
    for range_m in (4.0, 3.0, 2.6):
        world.put_drogue(camera, np.array([range_m, 0.02, -0.01]))
        image = camera.expected_electrons(world.data, FULL, 0.0, SHEETS.exposure.shortest_s)
        assert image.max() <= 3.0 * SHEETS.sensor.full_well_e


WINDOWS = [
    Window(301, 700, 760, 1203),
    Window(0, 33, 0, 35),
    Window(1055, 1088, 2013, 2048),
    Window(437, 438, 1019, 1020),
]


@pytest.mark.parametrize("window", WINDOWS, ids=str)
def test_a_window_reads_what_the_full_frame_reads(make_camera: Callable[..., Made], window: Window) -> None:
    """LEDs, Sun, glare and noise bit for bit; of OpenGL's background at most 2 % of pixels differ, by one level."""
    world, camera = make_camera()
    in_view = camera.pose(world.data)[0] @ world.as_built.camera.rays_from_pixels(np.array([[900.0, 500.0]]))[0]
    world, camera = make_camera(sun_W=in_view)
    full = camera.expose(world.data, 1.0, 9, None)
    part = camera.expose(world.data, 1.0, 9, window)
    assert full is not None and part is not None
    cut = full.pixels[window.row_start : window.row_stop, window.column_start : window.column_stop]
    assert part.window == window and part.pixels.shape == window.shape
    difference = np.abs(part.pixels.astype(int) - cut.astype(int))
    if camera.background == "analytic":
        assert not difference.any()
    assert difference.max() <= 1
    assert (difference > 0).mean() <= 0.02


def test_a_camera_that_works_ahead_between_frames_gives_the_same_frames(make_camera: Callable[..., Made]) -> None:
    """It comes nearer; windows that look below follow one on a piece of sky, and one that has moved a little."""
    hashes, near = [], (Window(400, 900, 300, 1200), Window(390, 895, 310, 1210))
    for most in (0, 1000):
        world, camera = make_camera(BEHIND, automatic_exposure=True)
        frames = []
        for k, window in enumerate((Window(0, 40, 0, 60), *near, FULL)):
            world.put_drogue(camera, np.array([6.0 - k, 0.3, -0.2]))
            frame = camera.expose(world.data, 0.0, k, window)
            assert frame is not None
            frames.append(hashlib.sha256(frame.pixels.tobytes()).hexdigest())
            done = sum(1 for _ in range(most) if camera.work_ahead())
            assert done < 1000 and (most == 0 or k > 0 or done > 0)
            assert most == 0 or not camera.work_ahead()
        hashes.append(frames)
    assert hashes[0] == hashes[1]


def test_a_box_in_front_of_an_led_hides_it_and_moved_away_shows_it_again(make_camera: Callable[..., Made]) -> None:
    world, camera = make_camera()
    R_WC, p_WC = camera.pose(world.data)
    p_CD = np.array([8.0, 0.2, -0.1])
    pixel = _led_pixels(world.as_built, p_CD, np.eye(3))[2]
    window = _around(pixel, 3)

    def peak() -> float:
        return float(camera.expected_electrons(world.data, window).max())

    assert camera.visible_leds(world.data).all() and peak() > 1000.0
    world.put("box", p_WC + R_WC @ (0.6 * (p_CD + world.as_built.ring_positions_D[2])), R_WC)
    assert list(np.flatnonzero(~camera.visible_leds(world.data))) == [2]
    assert peak() < 500.0
    world.put_aside("box")
    assert camera.visible_leds(world.data).all() and peak() > 1000.0


def test_the_probe_hides_the_leds_behind_it(make_camera: Callable[..., Made]) -> None:
    world, camera = make_camera()
    R_WC, p_WC = camera.pose(world.data)
    boom = world.data.geom("probe_boom").xpos
    behind_boom = 1.5 * R_WC.T @ (boom - p_WC)
    world.put_drogue(camera, behind_boom - world.as_built.ring_positions_D[0])
    assert not camera.visible_leds(world.data)[0]
    world.put_drogue(camera, behind_boom - world.as_built.ring_positions_D[0] + np.array([0.0, 1.0, 0.5]))
    assert camera.visible_leds(world.data).all()


def test_what_lies_behind_an_led_or_within_its_seat_does_not_hide_it(make_camera: Callable[..., Made]) -> None:
    world, camera = make_camera()
    R_WC, p_WC = camera.pose(world.data)
    led_W = p_WC + R_WC @ (np.array([8.0, 0.2, -0.1]) + world.as_built.ring_positions_D[5])
    half = world.model.geom("box").size[0]
    for x in (half + 0.002, half - 0.8 * SHEETS.leds.occlusion_clearance_m):
        world.put("box", led_W + x * R_WC[:, 0], R_WC)
        assert camera.visible_leds(world.data).all()


def test_invisible_geoms_hide_nothing(make_camera: Callable[..., Made]) -> None:
    for unseen, all_visible in (((), False), (("box",), True)):
        world, camera = make_camera(unseen=unseen)
        R_WC, p_WC = camera.pose(world.data)
        before_led = 0.6 * (np.array([8.0, 0.2, -0.1]) + world.as_built.ring_positions_D[2])
        world.put("box", p_WC + R_WC @ before_led, R_WC)
        assert camera.visible_leds(world.data).all() == all_visible


def test_an_led_behind_the_camera_or_turned_away_leaves_the_picture_alone(make_camera: Callable[..., Made]) -> None:
    world, camera = make_camera(hub=False)
    world.put_drogue(camera, np.array([-8.0, 0.0, 0.0]))
    behind = camera.expected_electrons(world.data, FULL)
    world.put_drogue(camera, np.array([8.0, 0.0, 0.0]), exp(np.array([0.0, 0.0, np.pi])))
    assert np.array_equal(behind, camera.expected_electrons(world.data, FULL))


def _hash(world: Any, camera: NearInfraredCamera, frame: int = 0) -> str:
    return hashlib.sha256(camera.expose(world.data, 0.0, frame, None).pixels.tobytes()).hexdigest()


def test_the_same_key_makes_the_same_frame_and_another_key_or_frame_number_another(
    make_camera: Callable[..., Made],
) -> None:
    first, again, other = make_camera(BEHIND), make_camera(BEHIND), make_camera(BEHIND, seed=78)
    assert _hash(*first) == _hash(*again)
    assert _hash(*first) != _hash(*other)
    assert _hash(*first) != _hash(*first, 1)
    assert _hash(*first) == _hash(*first)


def test_the_message_says_when_how_long_and_how_much(make_camera: Callable[..., Made]) -> None:
    world, camera = make_camera()
    frame = camera.expose(world.data, 12.25, 0, None)
    assert frame.time_stamp_s == 12.25
    assert frame.exposure_s == EXPOSURE_S
    assert frame.gain == pytest.approx(0.075 / 4.0)
    assert frame.pixels.dtype == np.uint8 and frame.pixels.shape == (1088, 2048)
    assert not frame.pixels.flags.writeable
    latencies = np.array([camera.latency_s(frame) for _ in range(4000)])
    assert latencies.mean() == pytest.approx(10e-3, abs=1e-4)  # 6 standard errors
    assert latencies.std() == pytest.approx(1e-3, rel=0.08)


def test_no_frame_arrives_before_its_rows_are_read_after_the_shortest_exposure(
    make_camera: Callable[..., Made],
) -> None:
    """And where faults may send an old frame again, not before a frame without rows or exposure."""
    window, sensor = Window(100, 300, 0, 50), SHEETS.sensor
    _, sound = make_camera()
    _, faulty = make_camera(faults=(StuckFrame(start_s=3.0),))
    for asked, rows in ((window, 200), (None, 1088)):
        least_s = 0.5 * SHEETS.exposure.shortest_s + readout_time_s(rows, sensor) + sensor.transfer_s
        assert sound.least_latency_s(asked) == pytest.approx(least_s, rel=1e-12)
        assert faulty.least_latency_s(asked) == pytest.approx(readout_time_s(0, sensor) + sensor.transfer_s, rel=1e-12)


def test_jitter_that_has_been_drawn_is_not_drawn_again(make_camera: Callable[..., Made]) -> None:
    (world, camera), (_, other) = make_camera(), make_camera()
    frame = camera.expose(world.data, 0.0, 0, Window(0, 4, 0, 4))
    assert frame is not None
    first = camera.latency_s(frame, 0.25)
    assert camera.latency_s(frame, 0.0) == pytest.approx(first - 0.25, abs=1e-12)
    assert camera.transfer_jitter_s() == other.transfer_jitter_s()


def test_an_exposure_asked_for_is_of_that_frame_alone_and_within_the_hardwares_limits(
    make_camera: Callable[..., Made],
) -> None:
    """LEDs in view at 500 us clip; the control, had it metered that, would go down. A stuck exposure stays."""
    world, camera = make_camera(automatic_exposure=True)
    _, stuck = make_camera(faults=(ExposureStuck(exposure_s=5e-5),))
    longest_s, window = SHEETS.exposure.longest_s, Window(350, 750, 820, 1220)
    for asked_s, made_s in ((1e-4, 1e-4), (1.0, longest_s), (1e-9, SHEETS.exposure.shortest_s)):
        frame, held = (c.expose(world.data, 0.0, 0, window, asked_s) for c in (camera, stuck))
        assert frame is not None and frame.exposure_s == made_s
        assert held is not None and held.exposure_s == 5e-5
        assert camera.exposure_s() == EXPOSURE_S


def test_as_time_passes_the_ground_is_that_of_a_place_farther_along_the_x_of_w(
    make_camera: Callable[..., Made],
) -> None:
    """After 2 s at 200 m/s what is seen below is as from 400 m on, and not as from the start."""
    window = Window(1048, 1088, 0, 400)
    world, flown = make_camera(airspeed_m_s=200.0, overrides=NO_DECK)
    at_start = flown.background_electrons(world.data, window)
    world.data.time = 2.0
    passed = flown.background_electrons(world.data, window)
    moved_world, standing = make_camera(overrides=NO_DECK)
    for name in ("receiver", "drogue", "tanker", "box"):
        moved_world.data.qpos[moved_world.model.joint(name).qposadr[0]] += 400.0
    mujoco.mj_forward(moved_world.model, moved_world.data)
    moved = standing.background_electrons(moved_world.data, window)
    assert np.isclose(passed, moved, rtol=1e-3).mean() > 0.99
    assert np.isclose(at_start, moved, rtol=1e-3).mean() < 0.5


def test_the_gain_turns_grey_levels_back_into_electrons(make_camera: Callable[..., Made]) -> None:
    """The sky near the horizon, 0.08 of white: mean level above the black level over the gain.

    The exposure is long, so that the noise spreads over several grey levels and their rounding averages out.
    """
    world, camera = make_camera(overrides={"exposure": {"exposure_s": 500e-6}, "sensor": {"column_pattern_e": 0.0}})
    world.put_aside("drogue")
    window = Window(400, 800, 600, 1400)
    frame = camera.expose(world.data, 0.0, 3, window)
    expected = camera.expected_electrons(world.data, window).mean()
    black = (SHEETS.sensor.black_level_dn - 1.5) / 4.0  # the converter's lower two bits are cut off
    assert expected > 600.0  # 29 of noise are half a grey level
    assert (frame.pixels.mean() - black) / frame.gain == pytest.approx(expected, rel=1e-3)


@pytest.mark.parametrize(
    "window", [Window(-1, 10, 0, 10), Window(0, 1089, 0, 10), Window(5, 5, 0, 10), Window(0, 10, 2000, 2049)]
)
def test_a_window_outside_the_sensor_is_refused_with_the_sensors_limits(
    make_camera: Callable[..., Made], window: Window
) -> None:
    world, camera = make_camera()
    with pytest.raises(DockairError, match=r"camera.window.*row_stop=1088"):
        camera.expose(world.data, 0.0, 0, window)


def test_exposing_changes_nothing_in_the_world(make_camera: Callable[..., Made]) -> None:
    world, camera = make_camera(BEHIND)
    size = mujoco.mj_stateSize(world.model, mujoco.mjtState.mjSTATE_INTEGRATION)
    before, after = np.empty(size), np.empty(size)
    mujoco.mj_getState(world.model, world.data, before, mujoco.mjtState.mjSTATE_INTEGRATION)
    camera.expose(world.data, 0.0, 0, None)
    mujoco.mj_getState(world.model, world.data, after, mujoco.mjtState.mjSTATE_INTEGRATION)
    assert np.array_equal(before, after)


def test_the_camera_stands_and_looks_as_it_is_built_into_the_receiver(make_camera: Callable[..., Made]) -> None:
    """Place and axes by MuJoCo's own quaternions; without this every other test would turn with a wrong pose."""
    world, camera = make_camera()
    world.put("receiver", np.array([10.0, -20.0, 30.0]), exp(np.array([0.9, -0.7, 1.3])))
    body = world.data.body("receiver")
    built = world.as_built.mounting
    place = np.zeros(3)
    mujoco.mju_rotVecQuat(place, built.p_BC, body.xquat)
    R_WC, p_WC = camera.pose(world.data)
    np.testing.assert_allclose(p_WC, body.xpos + place, atol=1e-9)
    for axis in range(3):
        turned = np.zeros(3)
        mujoco.mju_rotVecQuat(turned, np.ascontiguousarray(built.R_BC[:, axis]), body.xquat)
        np.testing.assert_allclose(R_WC[:, axis], turned, atol=1e-9)
