"""The drawn scene against the pinhole model, and windows against the full frame."""

from dataclasses import replace

import mujoco
import numpy as np
import pytest

from dockair.calibration import Camera
from dockair.messages import Window
from dockair.sim.camera.background import Background

CAMERA = Camera(width_px=400, height_px=300, principal_point_px=(207.3, 141.8), focal_length_m=16e-3 / 5)
FULL = CAMERA.full_window
AT_ORIGIN = (np.eye(3), np.zeros(3))
pytestmark = pytest.mark.gl


def _scene(*spheres: tuple[tuple[float, float, float], float, float]) -> tuple[mujoco.MjModel, mujoco.MjData]:
    """Spheres (place, radius, grey) under a sky of grey 0.2, lit from all sides alike."""
    spec = mujoco.MjSpec()
    spec.visual.headlight.active = 0
    sky = spec.add_texture(name="sky", type=mujoco.mjtTexture.mjTEXTURE_SKYBOX, width=8, height=8)
    sky.builtin, sky.rgb1, sky.rgb2 = mujoco.mjtBuiltin.mjBUILTIN_FLAT, [0.2] * 3, [0.2] * 3
    spec.worldbody.add_light(
        type=mujoco.mjtLightType.mjLIGHT_DIRECTIONAL, ambient=[1.0] * 3, diffuse=[0.0] * 3, specular=[1.0] * 3
    )
    spec.stat.extent = 20.0
    for at, radius, grey in spheres:
        spec.worldbody.add_geom(
            type=mujoco.mjtGeom.mjGEOM_SPHERE, pos=at, size=[radius, 0, 0], rgba=[grey, grey, grey, 1.0]
        )
    model = spec.compile()
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    return model, data


def _draw(
    model: mujoco.MjModel,
    data: mujoco.MjData,
    window: Window = FULL,
    pose: tuple[np.ndarray, np.ndarray] = AT_ORIGIN,
    reduction: int = 2,
    white_e: float = 255.0,
    floor_e: float = 0.0,
) -> np.ndarray:
    drawn = Background(model, CAMERA, reduction)
    try:
        return drawn.electrons(data, pose, window, white_e, floor_e)
    finally:
        drawn.close()


@pytest.mark.parametrize("reduction", [1, 2, 3])
@pytest.mark.parametrize("place", [(10.0, 0.0, 0.0), (10.0, 2.1, -1.4), (7.0, -1.9, 1.0)])
def test_a_small_sphere_is_drawn_where_the_pinhole_puts_it(place: tuple[float, float, float], reduction: int) -> None:
    """Mean over 16 phases of the area-weighted centre less the projection.

    Without multisampling one picture is 0.1 px a block off (1 sigma); the mean is bounded at 4 sigma. A sphere off the
    axis is an ellipse, longer outward by 0.03 px here.
    """
    errors = []
    for phase in np.random.default_rng(3).uniform(-0.03, 0.03, (16, 3)):
        at = np.array(place) + phase
        image = _draw(*_scene((tuple(at), 0.25, 1.0)), reduction=reduction)
        weight = np.clip(image - 80.0, 0.0, None)
        rows, columns = np.indices(image.shape)
        centre = np.array([(weight * columns).sum(), (weight * rows).sum()]) / weight.sum()
        errors.append(centre - CAMERA.pixels_from_points(at)[0])
    assert np.abs(np.mean(errors, axis=0)).max() < 0.03 + 0.1 * reduction


def test_brightness_follows_grey_and_the_fourth_power_of_the_cosine() -> None:
    """Sky of grey 0.2 everywhere: 0.2 x white x cos^4 + floor, to the 8 bits it was drawn with."""
    image = _draw(*_scene(), white_e=300.0, floor_e=7.0)
    for v, u in ((142, 207), (0, 0), (299, 399)):
        ray = CAMERA.rays_from_pixels(np.array([[u, v]]))[0]
        assert image[v, u] == pytest.approx(0.2 * 300.0 * ray[0] ** 4 + 7.0, rel=1e-4)


@pytest.mark.parametrize(
    "window", [Window(101, 180, 155, 262), Window(0, 41, 0, 33), Window(251, 300, 333, 400), Window(60, 61, 70, 71)]
)
def test_a_windows_background_is_the_full_frames(window: Window) -> None:
    """Tolerance: edges may fall on the other side of a block's centre in 1 % of the pixels.

    No grey here is half-way between two of the 8-bit levels (0.9 would be): those round either way.
    """
    model, data = _scene(((10.0, 0.0, 0.0), 1.5, 0.88), ((6.0, 1.0, 0.7), 0.4, 0.4), ((8.0, -3.0, -2.0), 0.8, 0.6))
    full = _draw(model, data)[window.row_start : window.row_stop, window.column_start : window.column_stop]
    part = _draw(model, data, window)
    assert part.shape == window.shape
    assert (np.abs(part - full) > 0.5).mean() <= 0.01


def test_far_from_the_origin_the_picture_is_the_same() -> None:
    """70 km away single precision steps by 8 mm; at 2 m that is 2 px here."""
    far = np.array([70000.1237, -30000.7771, 5000.3139])
    near_scene = _scene(((2.0, 0.1, 0.05), 0.11, 1.0))
    far_scene = _scene((tuple(far + [2.0, 0.1, 0.05]), 0.11, 1.0))
    near, there = _draw(*near_scene), _draw(*far_scene, pose=(np.eye(3), far))
    assert (np.abs(near - there) > 0.5).mean() < 1e-4


def test_the_picture_turns_with_the_camera() -> None:
    """Yaw to the left moves the scene to the right; nose down moves it up."""
    model, data = _scene(((10.0, 0.0, 0.0), 0.3, 1.0))
    a = 0.08
    yaw = np.array([[np.cos(a), -np.sin(a), 0.0], [np.sin(a), np.cos(a), 0.0], [0.0, 0.0, 1.0]])
    pitch = np.array([[np.cos(a), 0.0, np.sin(a)], [0.0, 1.0, 0.0], [-np.sin(a), 0.0, np.cos(a)]])
    for R_WC in (yaw, pitch):
        image = _draw(model, data, pose=(R_WC, np.zeros(3)))
        (u, v) = CAMERA.pixels_from_points(np.array([[10.0, 0.0, 0.0]]) @ R_WC)[0]
        assert image[round(v), round(u)] > 150.0


def test_sites_and_hidden_groups_are_not_drawn() -> None:
    spec = mujoco.MjSpec()
    spec.stat.extent = 20.0
    spec.worldbody.add_site(pos=[5.0, 0.0, 0.0], size=[0.5, 0.5, 0.5], rgba=[1, 1, 1, 1])
    spec.worldbody.add_geom(
        type=mujoco.mjtGeom.mjGEOM_SPHERE, pos=[5.0, 0, 0], size=[0.5, 0, 0], rgba=[1, 1, 1, 1], group=3
    )
    model = spec.compile()
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    assert _draw(model, data).max() == 0.0


def test_drawing_leaves_the_world_as_it_was() -> None:
    model, data = _scene(((10.0, 0.0, 0.0), 0.3, 1.0))
    model.vis.quality.offsamples = 4
    before = np.empty(mujoco.mj_stateSize(model, mujoco.mjtState.mjSTATE_INTEGRATION))
    after = np.empty_like(before)
    mujoco.mj_getState(model, data, before, mujoco.mjtState.mjSTATE_INTEGRATION)
    _draw(model, data)
    mujoco.mj_getState(model, data, after, mujoco.mjtState.mjSTATE_INTEGRATION)
    assert np.array_equal(before, after)
    assert model.vis.quality.offsamples == 4


def test_a_picture_does_not_depend_on_those_drawn_before() -> None:
    model, data = _scene(((10.0, 0.0, 0.0), 1.5, 0.9))
    drawn = Background(model, CAMERA, 2)
    first = drawn.electrons(data, AT_ORIGIN, FULL, 255.0, 0.0)
    drawn.electrons(data, AT_ORIGIN, Window(10, 60, 10, 60), 255.0, 0.0)
    again = drawn.electrons(data, AT_ORIGIN, FULL, 255.0, 0.0)
    drawn.close()
    assert np.array_equal(first, again)
    drawn.close()  # twice is once


def test_the_as_built_principal_point_moves_the_picture() -> None:
    model, data = _scene(((10.0, 0.0, 0.0), 0.3, 1.0))
    moved = replace(CAMERA, principal_point_px=(CAMERA.principal_point_px[0] + 20.0, CAMERA.principal_point_px[1]))
    drawn = Background(model, moved, 1)
    image = drawn.electrons(data, AT_ORIGIN, FULL, 255.0, 0.0)
    drawn.close()
    assert np.allclose(image[:, 40:] > 150.0, _draw(model, data, reduction=1)[:, 20:-20] > 150.0)
