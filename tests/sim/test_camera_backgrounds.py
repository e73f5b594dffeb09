"""The same camera with either background: what must not depend on who draws."""

from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest

from dockair.messages import Window
from dockair.rotations import exp
from dockair.sim.camera.camera import CameraNoise, NearInfraredCamera
from dockair.sim.camera.sheets import CameraSheets

pytestmark = pytest.mark.gl

FULL = Window(0, 1088, 0, 2048)
POSES = 200


@pytest.fixture
def both(small_world: Any) -> Iterator[tuple[Any, NearInfraredCamera, NearInfraredCamera]]:
    """A world, and two cameras on it that differ in their background alone."""
    world = small_world
    sun_W = np.array([0.2, 0.5, 0.84])
    cameras = [
        NearInfraredCamera(
            CameraSheets.load(),
            world.as_built,
            CameraNoise.of(5),
            world.model,
            sun_direction_W=sun_W / np.linalg.norm(sun_W),
            background=background,
        )
        for background in ("mujoco", "analytic")
    ]
    yield world, cameras[0], cameras[1]
    for camera in cameras:
        camera.close()


def _random_place(rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    range_m = rng.uniform(2.5, 30.0)
    return range_m * np.array([1.0, *rng.uniform(-0.12, 0.12, 2)]), exp(0.3 * rng.standard_normal(3))


def test_leds_have_the_same_electrons_to_the_bit_and_are_seen_alike(both) -> None:
    world, drawn, traced = both
    rng = np.random.default_rng(3)
    for _ in range(POSES):
        world.put_drogue(drawn, *_random_place(rng))
        factors = np.ones(8)
        one, other = (c._sources.of(world.data, c.pose(world.data), 2e-5, factors) for c in (drawn, traced))
        assert np.array_equal(one.electrons, other.electrons) and np.array_equal(one.p_C, other.p_C)
        assert np.array_equal(drawn.visible_leds(world.data), traced.visible_leds(world.data))


def test_whether_an_led_is_hidden_agrees_with_what_the_pictures_show(both) -> None:
    """A LED's place behind solids is where both backgrounds show a solid, away from outlines."""
    world, drawn, traced = both
    rng = np.random.default_rng(4)
    agree = total = 0
    for _ in range(60):
        place, turn = _random_place(rng)
        world.put_drogue(drawn, place, turn)
        R_WC, p_WC = drawn.pose(world.data)
        world.put("box", p_WC + R_WC @ (0.5 * (place + turn @ world.as_built.ring_positions_D[rng.integers(8)])), R_WC)
        visible = drawn.visible_leds(world.data)
        for camera in (drawn, traced):
            shown = _shows_led(camera, world)
            agree, total = agree + int((shown == visible).sum()), total + 8
    assert agree / total >= 0.995


def _shows_led(camera: NearInfraredCamera, world: Any) -> np.ndarray:
    """(8,) whether light of each LED is in the picture."""
    image = camera.expected_electrons(world.data, FULL)
    background = camera.background_electrons(world.data, FULL)
    shown = []
    for u, v in camera.led_pixels(world.data):
        r, c = round(v), round(u)
        inside = 0 <= r < 1088 and 0 <= c < 2048
        shown.append(inside and image[r, c] - background[r, c] > 20.0)
    return np.array(shown)


def test_both_pictures_show_the_same_scene(both) -> None:
    """Away from the outlines, which OpenGL draws as polygons, the expected electrons agree to 2 %."""
    world, drawn, traced = both
    one, other = (c.background_electrons(world.data, FULL) for c in (drawn, traced))
    near = np.isclose(one, other, rtol=0.02, atol=2.0)
    assert near.mean() > 0.985
    assert one.std() > 5.0  # there is something to agree on


def test_the_first_frame_of_a_reset_camera_is_a_fresh_cameras(both) -> None:
    for camera in both[1:]:
        world = both[0]
        first = camera.expose(world.data, 0.0, 0, None)
        for k in range(1, 4):
            camera.expose(world.data, 0.02 * k, k, Window(300, 700, 700, 1300))
        camera.reset()
        again = camera.expose(world.data, 0.0, 0, None)
        assert first is not None and again is not None
        assert again.exposure_s == first.exposure_s
        assert np.array_equal(again.pixels, first.pixels)


def test_the_camera_writes_nothing_into_the_model(both) -> None:
    world = both[0]
    before = world.model.light_dir.copy(), world.model.geom_rgba.copy()
    for camera in both[1:]:
        camera.expose(world.data, 0.0, 0, None)
    assert np.array_equal(world.model.light_dir, before[0]) and np.array_equal(world.model.geom_rgba, before[1])
