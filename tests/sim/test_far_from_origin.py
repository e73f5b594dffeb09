"""In a turn the scene leaves W's origin by kilometres: the pictures must not know."""

import mujoco
import numpy as np
import pytest

from dockair.rotations import exp
from dockair.sim.camera.weather import Weather
from dockair.sim.view import ThirdPersonView

FAR_M = np.array([-7000.0, 3000.0, -570.0])
PIXEL_SHARE = 0.02  # of a pixel, that the picture may move


def _moved(world, shift_m):
    for name in ("receiver", "drogue", "tanker", "box"):
        address = world.model.joint(name).qposadr[0]
        world.data.qpos[address : address + 3] += shift_m
    mujoco.mj_forward(world.model, world.data)


def _led_centroids(world, camera, pixels):
    """(8, 2) columns and rows of the LEDs' light in windows of 11 pixels about where they are."""
    R_WC, p_WC = camera.pose(world.data)
    drogue = world.data.body("drogue")
    leds_W = drogue.xpos + world.as_built.ring_positions_D @ drogue.xmat.reshape(3, 3).T
    found = []
    for u, v in np.rint(world.as_built.camera.pixels_from_points((leds_W - p_WC) @ R_WC)).astype(int):
        patch = pixels[v - 5 : v + 6, u - 5 : u + 6]
        light = np.clip(patch - np.median(patch) - 5.0, 0.0, None)
        rows, columns = np.indices(light.shape)
        found.append([u + np.average(columns, weights=light), v + np.average(rows, weights=light)])
    return np.array(found)


def test_leds_are_at_the_same_place_in_the_frame_seven_kilometres_away(make_camera):
    """In the night, so that nothing else shines; the noise is the same, the seed being fixed."""
    centroids = []
    for shift_m in (np.zeros(3), FAR_M):
        world, camera = make_camera(weather=Weather(night=True))
        _moved(world, shift_m)
        frame = camera.expose(world.data, 0.0, 0, None)
        centroids.append(_led_centroids(world, camera, frame.pixels.astype(float)))
    np.testing.assert_allclose(centroids[1], centroids[0], atol=PIXEL_SHARE)


@pytest.mark.gl
def test_third_person_view_is_the_same_seven_kilometres_away(small_world):
    view = ThirdPersonView(small_world.model, 160, 120)
    try:
        small_world.put("drogue", np.array([12.0, 2.0, 3.0]), exp(np.array([0.0, 0.1, 0.0])))
        here = view.render(small_world.data, np.array([6.0, 2.0, 3.0])).astype(int)
        _moved(small_world, FAR_M)
        there = view.render(small_world.data, np.array([6.0, 2.0, 3.0]) + FAR_M).astype(int)
    finally:
        view.close()
    assert here.std() > 3.0  # there is something to be seen
    assert np.abs(there - here).mean() < 0.02
