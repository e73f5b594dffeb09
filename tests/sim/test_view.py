"""The third person's view: from where the world is seen, and what is seen of it."""

import mujoco
import numpy as np
import pytest

from dockair.sim.view import ThirdPersonView

pytestmark = pytest.mark.gl
WIDTH, HEIGHT = 320, 240
LOOK_AT_W = np.array([500.0, -20.0, 7.0])


def _seen(bodies, sites=(), *, is_lit=True):
    """Picture of grey balls (place from the middle, radius) and of sites (name, place), the light from straight above.

    Args:
        bodies: the balls.
        sites: as the LEDs are.
        is_lit: else it is dark.
    """
    spec = mujoco.MjSpec()
    light = spec.worldbody.add_light(type=mujoco.mjtLightType.mjLIGHT_DIRECTIONAL, dir=[0.0, 0.0, -1.0])
    light.ambient, light.diffuse, light.specular, light.active = [0.0] * 3, [0.8] * 3, [0.0] * 3, is_lit
    spec.visual.headlight.active = 0
    spec.stat.extent = 20.0  # what is drawn ends at fifty times that
    for place, radius_m in bodies:
        pos, size = LOOK_AT_W + place, [radius_m] * 3
        spec.worldbody.add_geom(type=mujoco.mjtGeom.mjGEOM_SPHERE, pos=pos, size=size, rgba=[0.5, 0.5, 0.5, 1.0])
    for name, place in sites:
        spec.worldbody.add_site(name=name, pos=LOOK_AT_W + place, size=[0.5] * 3)
    model = spec.compile()
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    view = ThirdPersonView(model, WIDTH, HEIGHT)
    try:
        return view.render(data, LOOK_AT_W).astype(int)
    finally:
        view.close()


def _centroid(picture):
    """Column and row of the middle of what is seen, from the picture's upper left pixel."""
    rows, columns = np.nonzero(picture.any(axis=2))
    return columns.mean(), rows.mean()


def _projected(place):
    """Column and row from nine metres behind the middle, 30 degrees to the left and 8 up: a pinhole of 45 degrees."""
    azimuth, elevation = np.radians([-30.0, -8.0])
    ahead = np.array([np.cos(azimuth) * np.cos(elevation), np.sin(azimuth) * np.cos(elevation), np.sin(elevation)])
    right = np.array([np.sin(azimuth), -np.cos(azimuth), 0.0])
    from_eye, focal_px = place + 9.0 * ahead, 0.5 * HEIGHT / np.tan(np.radians(22.5))
    column, row = focal_px * np.array([right @ from_eye, np.cross(ahead, right) @ from_eye]) / (ahead @ from_eye)
    return 0.5 * (WIDTH - 1) + column, 0.5 * (HEIGHT - 1) + row


@pytest.mark.parametrize("place", [(0.0, 0.0, 0.0), (1.0, 2.0, 1.0), (-2.0, -1.5, -1.0), (4.0, 1.0, -2.0)])
def test_the_eye_is_behind_to_the_left_and_above(place):
    place = np.array(place)
    for picture in (_seen([(place, 0.1)]), _seen([], [("led_3", place)])):
        np.testing.assert_allclose(_centroid(picture), _projected(place), atol=0.6)


def test_leds_shine_and_other_sites_are_not_seen():
    red, green, _ = _seen([], [("led_0", np.zeros(3))], is_lit=False).max(axis=(0, 1))
    assert red > 100 and red > 1.3 * green
    assert not _seen([], [("coupling", np.zeros(3))]).any()


def test_the_side_in_the_shadow_is_seen_too():
    picture = _seen([(np.zeros(3), 1.0)])
    column = picture[:, WIDTH // 2, 0]
    seen = column[column > 0]
    assert len(seen) == pytest.approx(2.0 * 0.5 * HEIGHT / np.tan(np.radians(22.5)) / 9.0, abs=2)  # a disc of 2 m
    assert 30 < seen[-3] < 0.8 * seen[2]
