"""The background as a whole, with either way of drawing: against the pinhole, closed forms, and windows of itself."""

from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import cache
from typing import Any

import mujoco
import numpy as np
import pytest

from dockair.calibration import Camera
from dockair.errors import DockairError
from dockair.messages import Window
from dockair.sim.camera.background import Background
from dockair.sim.camera.coarse_grid import CoarseGrid, nodes_around
from dockair.sim.camera.sheets import BackgroundParameters

CAMERA = Camera(width_px=400, height_px=300, principal_point_px=(207.3, 141.8), focal_length_m=16e-3 / 5)
BENT = replace(CAMERA, distortion=(-0.25, 0.1, 0.004, -0.003, 0.02))  # moves the corners by 14 px
TALL = replace(CAMERA, width_px=300, height_px=400, principal_point_px=(158.2, 207.3))
FULL = CAMERA.full_window
AT_ORIGIN = (np.eye(3), np.zeros(3))
WINDOWS = [Window(101, 180, 155, 262), Window(0, 41, 0, 33), Window(251, 300, 333, 400), Window(60, 61, 70, 71)]
WHITE_E = 255.0


class PlainSky:
    """Radiance linear in the tangents; light of any strength."""

    def __init__(self, level: float = 0.2, slopes: tuple[float, float] = (0.0, 0.0)) -> None:
        self.level, self.slopes = level, slopes
        self.ambient, self.direct, self.air = 1.0, 0.0, 0.6

    def fill(self, out: np.ndarray, R_WC: np.ndarray, x: np.ndarray, y: np.ndarray, place_m: object = None) -> None:
        out[:] = self.level + self.slopes[0] * x + self.slopes[1] * y[:, None]

    def work_ahead(self, x: np.ndarray, y: np.ndarray) -> bool:
        return False

    def beam(self, directions_W: np.ndarray) -> np.ndarray:
        return np.full(len(directions_W), self.direct)

    def airlight(self, direction_W: np.ndarray) -> float:
        return self.air


def _scene(*geoms: dict[str, Any]) -> tuple[mujoco.MjModel, mujoco.MjData]:
    spec = mujoco.MjSpec()
    spec.worldbody.add_light(type=mujoco.mjtLightType.mjLIGHT_DIRECTIONAL, dir=[0.0, 0.0, -1.0])
    spec.stat.extent = 20.0
    for geom in geoms:
        spec.worldbody.add_geom(**geom)
    model = spec.compile()
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    return model, data


def _sphere(at: Any, radius: float, grey: float = 1.0, **more: Any) -> dict[str, Any]:
    return {
        "type": mujoco.mjtGeom.mjGEOM_SPHERE,
        "pos": at,
        "size": [radius, 0.0, 0.0],
        "rgba": [grey, grey, grey, 1.0],
    } | more


def _box(at: Any, half_sizes: Any, grey: float = 1.0) -> dict[str, Any]:
    return {"type": mujoco.mjtGeom.mjGEOM_BOX, "pos": at, "size": half_sizes, "rgba": [grey, grey, grey, 1.0]}


THREE_BALLS = (
    _sphere((10.0, 0.0, 0.0), 1.5, 0.88),
    _sphere((6.0, 1.0, 0.7), 0.4, 0.4),
    _sphere((8.0, -3.0, -2.0), 0.8, 0.6),
)


@pytest.fixture(params=[pytest.param("mujoco", marks=pytest.mark.gl), "analytic"])
def make(request: pytest.FixtureRequest) -> Iterator[Callable[..., Background]]:
    """make(model, camera=CAMERA, reduction=2, sky=PlainSky()), once with each way of drawing."""
    made = []

    def build(
        model: mujoco.MjModel, camera: Camera = CAMERA, reduction: int = 2, sky: PlainSky | None = None
    ) -> Background:
        sheet = BackgroundParameters(reduction=reduction)
        made.append(Background(model, camera, sheet, sky or PlainSky(), request.param, sun_radius_rad=0.0))
        return made[-1]

    yield build
    for background in made:
        background.close()


def _draw(background: Background, data: mujoco.MjData, window: Window = FULL, **more: Any) -> np.ndarray:
    return background.electrons(data, AT_ORIGIN, window, WHITE_E, **more)


@pytest.mark.parametrize("camera", [CAMERA, BENT], ids=["pinhole", "bent"])
@pytest.mark.parametrize("reduction", [1, 2, 3])
@pytest.mark.parametrize("place", [(10.0, 0.0, 0.0), (10.0, 2.1, -1.4), (7.0, -1.9, 1.0)])
def test_a_small_sphere_is_drawn_where_the_camera_puts_it(
    make: Callable[..., Background], place: tuple[float, float, float], reduction: int, camera: Camera
) -> None:
    """Mean over 16 phases of the area-weighted centre less that of the sphere's outline through the lens.

    One picture is 0.1 px a block off (1 sigma), as its edges are steps; the mean is bounded at 4 sigma.
    """
    model, data = _scene(_sphere(place, 0.25))
    background, errors = make(model, camera, reduction), []
    for phase in np.random.default_rng(3).uniform(-0.03, 0.03, (16, 3)):
        data.geom_xpos[0] = place + phase
        weight = np.clip(_draw(background, data) / _fall_off(camera) - 80.0, 0.0, None)
        rows, columns = np.indices(weight.shape)
        centre = np.array([(weight * columns).sum(), (weight * rows).sum()]) / weight.sum()
        errors.append(centre - _centre_of_outline(camera, data.geom_xpos[0], 0.25))
    assert np.abs(np.mean(errors, axis=0)).max() < 0.1 * reduction


@cache
def _fall_off(camera: Camera) -> np.ndarray:
    """Fourth power of the cosine off the axis, in every pixel."""
    v, u = np.indices((camera.height_px, camera.width_px))
    return camera.rays_from_pixels(np.column_stack([u.ravel(), v.ravel()]))[:, 0].reshape(u.shape) ** 4


def _centre_of_outline(camera: Camera, p: np.ndarray, radius: float) -> np.ndarray:
    """Centre of the area inside a sphere's outline: the circle in which a cone from the lens touches it."""
    distance = np.linalg.norm(p)
    sine = radius / distance
    across = np.linalg.svd(p[None] / distance)[2][1:]
    angle = 2.0 * np.pi * np.arange(180) / 180
    circle = np.column_stack([np.cos(angle), np.sin(angle)]) @ across
    outline = camera.pixels_from_points(p * (1.0 - sine**2) + radius * np.sqrt(1.0 - sine**2) * circle)
    u, v = (outline - outline.mean(axis=0)).T
    cross = u * np.roll(v, -1) - np.roll(u, -1) * v
    ends = np.column_stack([u + np.roll(u, -1), v + np.roll(v, -1)])
    return outline.mean(axis=0) + (cross @ ends) / (3.0 * cross.sum())


@pytest.mark.parametrize("camera", [CAMERA, BENT], ids=["pinhole", "bent"])
def test_a_straight_edge_lies_within_a_pixel_of_where_the_camera_puts_it(
    make: Callable[..., Background], camera: Camera
) -> None:
    """The left edge of a wall, all along its height: through the bent lens it is a curve, 4 px deep."""
    edge_y = 2.6
    model, data = _scene(_box((10.5, edge_y - 3.0, 0.0), (0.5, 3.0, 6.0)))
    image = _draw(make(model, camera), data)
    points = np.column_stack([np.full(400, 10.0), np.full(400, edge_y), np.linspace(-3.0, 3.0, 400)])
    pixels = camera.pixels_from_points(points)
    inside = (pixels[:, 1] >= 3.0) & (pixels[:, 1] <= 296.0)
    rays = camera.rays_from_pixels(np.column_stack([pixels[:, 0], np.round(pixels[:, 1])]))
    half = 0.6 * WHITE_E * rays[:, 0] ** 4  # between sky 0.2 and wall 1
    for (u, v), level in zip(pixels[inside], half[inside], strict=True):
        row = image[round(v)]
        right = int(np.argmax(row > level))
        crossing = right - (row[right] - level) / (row[right] - row[right - 1])
        assert abs(crossing - u) < 1.0, (u, v)


def test_the_bent_lens_of_these_tests_bends_by_many_pixels() -> None:
    corner = np.array([[0.0, 0.0]])
    straight, bent = CAMERA.rays_from_pixels(corner), BENT.rays_from_pixels(corner)
    assert np.linalg.norm(CAMERA.pixels_from_points(bent) - CAMERA.pixels_from_points(straight)) > 10.0


@pytest.mark.parametrize("camera", [CAMERA, BENT], ids=["pinhole", "bent"])
@pytest.mark.parametrize("reduction", [1, 2, 3, 8])
def test_a_linear_sky_is_linear_in_every_pixel(make: Callable[..., Background], camera: Camera, reduction: int) -> None:
    """0.3 + 0.2 x - 0.1 y, times the fourth power of the cosine off the axis.

    Linear interpolation keeps a linear function; of the fall-off's curvature it leaves 4/8 (k/f)^2 a level, of the bent
    tangents' as much as (k/f)^2.
    """
    model, data = _scene()
    image = _draw(make(model, camera, reduction, PlainSky(0.3, (0.2, -0.1))), data)
    v, u = np.indices(image.shape)
    rays = camera.rays_from_pixels(np.column_stack([u.ravel(), v.ravel()])).reshape(*image.shape, 3)
    x, y = -rays[..., 1] / rays[..., 0], -rays[..., 2] / rays[..., 0]
    expected = WHITE_E * (0.3 + 0.2 * x - 0.1 * y) * rays[..., 0] ** 4
    step = reduction / camera.focal_length_px
    assert np.abs(image - expected).max() < WHITE_E * (2.0 * step**2 + 1e-6)


def test_dirt_dims_the_scene_and_stray_light_is_added(make: Callable[..., Background]) -> None:
    """scene dirt + stray, both bilinear between their nodes, in every pixel."""
    model, data = _scene(*THREE_BALLS)
    background, rng = make(model), np.random.default_rng(8)
    first, shape = nodes_around(FULL)
    stray = CoarseGrid(rng.uniform(0.0, 50.0, shape).astype(np.float32), first)
    dirt = CoarseGrid(rng.uniform(0.2, 1.0, shape).astype(np.float32), first)
    v, u = np.indices((300, 400))
    pixels = np.column_stack([u.ravel(), v.ravel()]).astype(float)
    plain = _draw(background, data)
    expected = plain * dirt.at(pixels).reshape(plain.shape) + stray.at(pixels).reshape(plain.shape)
    assert np.allclose(_draw(background, data, stray=stray, dirt=dirt), expected, rtol=1e-5)
    assert np.allclose(_draw(background, data, stray=stray), plain + stray.at(pixels).reshape(plain.shape), rtol=1e-5)


@pytest.mark.parametrize("window", WINDOWS)
@pytest.mark.parametrize("reduction", [2, 3])
def test_sky_stray_light_and_dirt_of_a_window_are_the_full_frames_to_the_bit(
    make: Callable[..., Background], window: Window, reduction: int
) -> None:
    model, data = _scene()
    for camera in (CAMERA, BENT):
        background = make(model, camera, reduction, PlainSky(0.3, (0.21, -0.13)))
        full = _draw(background, data, stray=_grid(FULL, 40.0), dirt=_grid(FULL, 0.9))
        part = _draw(background, data, window, stray=_grid(window, 40.0), dirt=_grid(window, 0.9))
        assert np.array_equal(part, _crop(full, window))


@pytest.mark.parametrize("window", WINDOWS)
@pytest.mark.parametrize("camera", [CAMERA, BENT], ids=["pinhole", "bent"])
def test_a_windows_background_is_the_full_frames(
    make: Callable[..., Background], window: Window, camera: Camera
) -> None:
    """To the bit with rays. With OpenGL edges may fall on the other side of a block's centre in 1 % of the pixels.

    No grey here is half-way between two of the 8-bit levels (0.9 would be): those round either way.
    """
    model, data = _scene(*THREE_BALLS)
    background = make(model, camera)
    full, part = _crop(_draw(background, data), window), _draw(background, data, window)
    assert part.shape == window.shape and part.dtype == np.float32
    if background.backend == "analytic":
        assert np.array_equal(part, full)
    assert (np.abs(part - full) > 0.5).mean() <= 0.01


def _grid(window: Window, scale: float) -> CoarseGrid:
    """Of numbers that depend on the node's place alone."""
    (i0, j0), (m, n) = nodes_around(window)
    i, j = np.arange(i0, i0 + m)[:, None], np.arange(j0, j0 + n)
    return CoarseGrid((scale * (0.5 + 0.4 * np.sin(1.7 * i + 2.3 * j))).astype(np.float32), (i0, j0))


def _crop(image: np.ndarray, window: Window) -> np.ndarray:
    return image[window.row_start : window.row_stop, window.column_start : window.column_stop]


def test_a_grid_that_does_not_hold_the_window_is_refused(make: Callable[..., Background]) -> None:
    model, data = _scene()
    background = make(model)
    for window in (Window(0, 80, 8, 80), Window(8, 80, 0, 80), Window(8, 90, 8, 80), Window(8, 80, 8, 90)):
        with pytest.raises(ValueError, match="does not hold"):
            _draw(background, data, window, stray=_grid(Window(8, 80, 8, 80), 1.0))


def test_haze_takes_the_solids_contrast_by_the_slant_range_and_leaves_the_sky(
    make: Callable[..., Background],
) -> None:
    """A wall of grey 0.5, 10 m ahead: 0.5 T + 0.6 (1 - T), T = exp(-r/20 m), to an 8-bit level."""
    model, data = _scene(_box((10.5, 3.0, 0.0), (0.5, 3.0, 6.0), 0.5))
    image = _draw(make(model), data, extinction_1_m=0.05)
    for u, v in ((20, 20), (150, 200), (60, 290)):
        cosine = CAMERA.rays_from_pixels(np.array([[u, v]]))[0, 0]
        clear = np.exp(-0.05 * 10.0 / cosine)
        expected = WHITE_E * cosine**4 * (0.5 * clear + 0.6 * (1.0 - clear))
        assert image[v, u] == pytest.approx(expected, abs=0.6)
    sky = CAMERA.rays_from_pixels(np.array([[350, 100]]))[0, 0]
    assert image[100, 350] == pytest.approx(WHITE_E * 0.2 * sky**4, rel=1e-5)


def test_the_sky_is_asked_for_haze_along_the_lenss_axis_and_for_its_picture_from_the_cameras_place(
    make: Callable[..., Background],
) -> None:
    class AskedSky(PlainSky):
        def fill(self, out: np.ndarray, R_WC: np.ndarray, x: np.ndarray, y: np.ndarray, place_m: object = None) -> None:
            super().fill(out, R_WC, x, y)
            asked["place"] = place_m

        def airlight(self, direction_W: np.ndarray) -> float:
            asked["axis"] = direction_W
            return self.air

    asked, (model, data), place_m = {}, _scene(), np.array([1.0, 2.0, 3.0])
    yaw = np.array([[0.8, -0.6, 0.0], [0.6, 0.8, 0.0], [0.0, 0.0, 1.0]])
    background, window = make(model, sky=AskedSky()), Window(10, 20, 10, 20)
    background.electrons(data, (yaw, np.zeros(3)), window, WHITE_E, extinction_1_m=0.05, place_m=place_m)
    assert np.array_equal(asked["axis"], [0.8, 0.6, 0.0]) and asked["place"] is place_m


def test_solids_take_their_light_from_the_sky(make: Callable[..., Background]) -> None:
    """A floor under the Sun at the zenith, a wall beside it: rho (ambient + direct), rho ambient; brighter than 1."""
    model, data = _scene(_box((10.0, 0.0, -2.0), (4.0, 6.0, 0.5), 0.9), _box((15.0, 0.0, 0.0), (0.5, 6.0, 6.0), 0.9))
    sky = PlainSky()
    sky.ambient, sky.direct = 0.3, 0.9
    image = _draw(make(model, sky=sky), data)
    (u, floor), (_, wall) = np.round(CAMERA.pixels_from_points(np.array([[10.0, 0.0, -1.5], [14.5, 0.0, 1.0]])))
    for v, level in ((floor, 0.9 * 1.2), (wall, 0.9 * 0.3)):
        cosine = CAMERA.rays_from_pixels(np.array([[u, v]]))[0, 0]
        assert image[int(v), int(u)] == pytest.approx(WHITE_E * cosine**4 * level, abs=0.7)


def test_at_night_a_solid_is_dark_and_still_hides_what_is_behind_it(make: Callable[..., Background]) -> None:
    model, data = _scene(_sphere((10.0, 0.0, 0.0), 1.0))
    sky = PlainSky(0.2)
    sky.ambient = sky.direct = 0.0
    image = _draw(make(model, sky=sky), data)
    u, v = CAMERA.pixels_from_points(np.array([10.0, 0.0, 0.0]))[0]
    assert image[round(v), round(u)] == 0.0
    assert image[0, 0] > 30.0


def test_far_from_the_origin_the_picture_is_the_same(make: Callable[..., Background]) -> None:
    """70 km away single precision steps by 8 mm; at 2 m that is 2 px here."""
    far = np.array([70000.1237, -30000.7771, 5000.3139])
    near_model, near_data = _scene(_sphere((2.0, 0.1, 0.05), 0.11))
    far_model, far_data = _scene(_sphere(tuple(far + [2.0, 0.1, 0.05]), 0.11))
    near = _draw(make(near_model), near_data)
    there = make(far_model).electrons(far_data, (np.eye(3), far), FULL, WHITE_E)
    assert (np.abs(near - there) > 0.5).mean() < 1e-4


def test_the_picture_turns_with_the_camera(make: Callable[..., Background]) -> None:
    """Yaw to the left moves the scene to the right; nose down moves it up."""
    model, data = _scene(_sphere((10.0, 0.0, 0.0), 0.3))
    background, a = make(model), 0.08
    yaw = np.array([[np.cos(a), -np.sin(a), 0.0], [np.sin(a), np.cos(a), 0.0], [0.0, 0.0, 1.0]])
    pitch = np.array([[np.cos(a), 0.0, np.sin(a)], [0.0, 1.0, 0.0], [-np.sin(a), 0.0, np.cos(a)]])
    for R_WC in (yaw, pitch):
        image = background.electrons(data, (R_WC, np.zeros(3)), FULL, WHITE_E)
        (u, v) = CAMERA.pixels_from_points(np.array([[10.0, 0.0, 0.0]]) @ R_WC)[0]
        assert image[round(v), round(u)] > 150.0


def test_sites_hidden_groups_and_the_transparent_are_not_drawn(make: Callable[..., Background]) -> None:
    spec = mujoco.MjSpec()
    spec.stat.extent = 20.0
    spec.worldbody.add_site(pos=[5.0, 0.0, 0.0], size=[0.5, 0.5, 0.5], rgba=[1, 1, 1, 1])
    spec.worldbody.add_geom(**_sphere([5.0, 0.0, 0.0], 0.5, group=3))
    spec.worldbody.add_geom(**_sphere([5.0, 0.0, 0.0], 0.5, rgba=[1, 1, 1, 0]))
    model = spec.compile()
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    assert _draw(make(model, sky=PlainSky(0.0)), data).max() == 0.0


def test_drawing_leaves_the_world_as_it_was(make: Callable[..., Background]) -> None:
    model, data = _scene(_sphere((10.0, 0.0, 0.0), 0.3))
    model.vis.quality.offsamples = 4
    before = np.empty(mujoco.mj_stateSize(model, mujoco.mjtState.mjSTATE_INTEGRATION))
    after = np.empty_like(before)
    mujoco.mj_getState(model, data, before, mujoco.mjtState.mjSTATE_INTEGRATION)
    colours, lights = model.geom_rgba.copy(), model.light_ambient.copy()
    _draw(make(model), data)
    mujoco.mj_getState(model, data, after, mujoco.mjtState.mjSTATE_INTEGRATION)
    assert np.array_equal(before, after)
    assert np.array_equal(colours, model.geom_rgba) and np.array_equal(lights, model.light_ambient)
    assert model.vis.quality.offsamples == 4


def test_a_picture_does_not_depend_on_those_drawn_before(make: Callable[..., Background]) -> None:
    """Other windows, another pose, haze, and pictures of another background in between."""
    model, data = _scene(*THREE_BALLS)
    background, other = make(model), make(_scene(_sphere((9.0, 0.0, 0.0), 2.0))[0])
    first = _draw(background, data)
    background.electrons(data, (np.eye(3), np.array([-5.0, 1.0, 0.0])), Window(10, 60, 10, 60), WHITE_E)
    _draw(background, data, extinction_1_m=0.1)
    _draw(other, data)
    assert np.array_equal(_draw(background, data), first)
    background.close()
    assert np.array_equal(_draw(background, data), first)
    background.close()
    background.close()  # twice is once


def test_the_as_built_principal_point_moves_the_picture(make: Callable[..., Background]) -> None:
    model, data = _scene(_sphere((10.0, 0.0, 0.0), 0.3))
    moved = replace(CAMERA, principal_point_px=(CAMERA.principal_point_px[0] + 20.0, CAMERA.principal_point_px[1]))
    image = _draw(make(model, moved, 1), data)
    assert np.allclose(image[:, 40:] > 150.0, _draw(make(model, CAMERA, 1), data)[:, 20:-20] > 150.0)


@pytest.mark.parametrize("camera", [CAMERA, TALL], ids=["wide", "tall"])
def test_distortion_of_less_than_half_a_block_is_left_out_and_more_is_not(
    make: Callable[..., Background], camera: Camera
) -> None:
    """k1 moves the farthest corner by k1 r^2 times its longer side: 0.9 px and 1.1 px, a block being 2 px."""
    model, data = _scene(*THREE_BALLS)
    corner = (np.array(camera.principal_point_px) + 0.5) / camera.focal_length_px
    longer_px = camera.focal_length_px * corner.max() * (corner @ corner)
    plain, little, much = (
        _draw(make(model, replace(camera, distortion=(moved_px / longer_px, *[0.0] * 4))), data, camera.full_window)
        for moved_px in (0.0, 0.9, 1.1)
    )
    assert np.array_equal(plain, little)
    assert not np.array_equal(plain, much)


@pytest.mark.gl
@pytest.mark.parametrize("distance_m", [2.0, 6.0, 25.0])
def test_both_ways_of_drawing_agree_on_the_whole_scene(make_world: Callable[..., Any], distance_m: float) -> None:
    """Within 3 grey levels in 99 % of the pixels: what is left are edges that fall on either side of a block."""
    world = make_world(p_PD_B=(distance_m, 0.0, 0.0))
    R_WB, p_BC = world.truth.R_WB, world.parameters.mounting.p_BC
    pose = R_WB, world.truth.p_WB + R_WB @ p_BC
    sky = PlainSky()
    sky.ambient, sky.direct = 0.25, 0.75
    pictures = []
    for backend in ("mujoco", "analytic"):
        background = Background(
            world.model, Camera(), BackgroundParameters(reduction=2), sky, backend, sun_radius_rad=0.0
        )
        pictures.append(background.electrons(world.data, pose, Camera().full_window, 255.0))
        background.close()
    difference = np.abs(pictures[0] - pictures[1])
    solids = np.abs(pictures[1] / (255.0 * _fall_off(Camera())) - 0.2) > 1e-4
    assert solids.mean() > 0.05
    assert (difference <= 3.0).mean() >= 0.99
    assert np.median(difference[solids]) < 0.6  # half a level


def test_what_cannot_be_drawn_is_named_before_the_flight() -> None:
    spec = mujoco.MjSpec()
    spec.worldbody.add_geom(name="ground", type=mujoco.mjtGeom.mjGEOM_PLANE, size=[1.0, 1.0, 0.1])
    model = spec.compile()
    for backend in ("mujoco", "analytic"):
        with pytest.raises(DockairError, match="geom ground: expected a sphere, .*, got 'plane'"):
            Background(model, CAMERA, BackgroundParameters(reduction=2), PlainSky(), backend, sun_radius_rad=0.0)


def test_a_background_that_does_not_exist_is_refused_with_those_that_do() -> None:
    model, _ = _scene()
    with pytest.raises(DockairError, match="exists: auto, mujoco, analytic"):
        Background(model, CAMERA, BackgroundParameters(reduction=2), PlainSky(), "vulkan", sun_radius_rad=0.0)
