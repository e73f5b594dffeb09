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
EDGE_PX = 3  # how near an outline is too near to say on which side of it an LED lies
SILHOUETTE_E = 10.0  # a black solid is below, the darkest sky above


@pytest.fixture
def both(small_world: Any) -> Iterator[tuple[Any, NearInfraredCamera, NearInfraredCamera]]:
    """A world, and two cameras on it that differ in their background alone."""
    yield from _with_cameras(small_world)


@pytest.fixture
def silhouettes(small_world: Any) -> Iterator[tuple[Any, NearInfraredCamera, NearInfraredCamera]]:
    """The same with box and boom alone, both black: a solid in the picture stands before an LED, not behind."""
    for name in ("basket_hub", "tanker_wing"):  # these stand behind LEDs, too
        small_world.model.geom(name).group = 3
    small_world.model.geom_rgba[:, :3] = 0.0
    yield from _with_cameras(small_world)


def _with_cameras(world: Any) -> Iterator[tuple[Any, NearInfraredCamera, NearInfraredCamera]]:
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


def _put_box_before_an_led(world: Any, camera: NearInfraredCamera, rng: np.random.Generator) -> None:
    """The drogue at random, and the box half way to one of its LEDs, over it or a little beside it."""
    place, turn = _random_place(rng)
    world.put_drogue(camera, place, turn)
    R_WC, p_WC = camera.pose(world.data)
    beside = np.array([0.0, *rng.uniform(-0.07, 0.07, 2)])  # the box reaches 0.05 m to each side
    led_C = place + turn @ world.as_built.ring_positions_D[rng.integers(8)]
    world.put("box", p_WC + R_WC @ (0.5 * led_C + beside), R_WC)


def test_leds_have_the_same_electrons_to_the_bit_and_are_seen_alike(both) -> None:
    world, drawn, traced = both
    rng = np.random.default_rng(3)
    seen = 0
    for _ in range(POSES):
        _put_box_before_an_led(world, drawn, rng)
        factors = np.ones(8)
        one, other = (c._sources.of(world.data, c.pose(world.data), 2e-5, factors) for c in (drawn, traced))
        assert np.array_equal(one.electrons, other.electrons) and np.array_equal(one.p_C, other.p_C)
        visible = drawn.visible_leds(world.data)
        assert np.array_equal(visible, traced.visible_leds(world.data))
        assert np.array_equal(visible, one.electrons[:8] > 0.0)
        seen += int(visible.sum())
    assert POSES < seen < 8 * POSES - POSES // 4  # some are hidden, and some are not


def test_an_led_is_hidden_where_both_pictures_show_a_solid_before_it(silhouettes) -> None:
    """Black solids before the sky, judged where the pixels around an LED's place are all one or all the other."""
    world, drawn, traced = silhouettes
    rng = np.random.default_rng(4)
    hidden = seen = 0
    for _ in range(POSES):
        _put_box_before_an_led(world, drawn, rng)
        visible = drawn.visible_leds(world.data)
        for camera in (drawn, traced):
            solid = _solids_at_leds(camera, world)
            clear = ~np.isnan(solid)
            assert np.array_equal(solid[clear] == 0.0, visible[clear]), (camera.background, solid, visible)
            hidden, seen = hidden + int((solid == 1.0).sum()), seen + int((solid == 0.0).sum())
    assert hidden > POSES // 2 and seen > POSES, (hidden, seen)


def _solids_at_leds(camera: NearInfraredCamera, world: Any) -> np.ndarray:
    """(8,) 1 where the picture is black around the LED's place, 0 where it is sky; NaN at outlines, off the frame."""
    picture = camera.background_electrons(world.data, FULL, exposure_s=1e-4)
    solid = np.full(8, np.nan)
    for k, (u, v) in enumerate(camera.led_pixels(world.data)):
        r, c = round(v), round(u)
        if not (EDGE_PX <= r < 1088 - EDGE_PX and EDGE_PX <= c < 2048 - EDGE_PX):
            continue
        around = picture[r - EDGE_PX : r + EDGE_PX + 1, c - EDGE_PX : c + EDGE_PX + 1] < SILHOUETTE_E
        if around.all() or not around.any():
            solid[k] = float(around.all())
    return solid


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
