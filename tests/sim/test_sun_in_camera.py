"""The Sun as the camera shows it: disc, veil, glints. The parts by themselves are in test_glare.py."""

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from dockair.messages import Window
from dockair.rotations import exp
from dockair.sim.camera.camera import NearInfraredCamera
from dockair.sim.camera.radiometry import Responses, responses
from dockair.sim.camera.sheets import CameraSheets
from dockair.sim.camera.sun_view import SunView

SHEETS = CameraSheets.load()
EXPOSURE_S = SHEETS.exposure.exposure_s
Made = tuple[Any, NearInfraredCamera]


def response_of(world: Any, sun_W: np.ndarray) -> Responses:
    s = SHEETS
    return responses(
        s.lens, s.filter, s.sensor, s.leds, s.light, world.as_built.camera,
        altitude_m=6000.0, sun_elevation_rad=float(np.arcsin(sun_W[2] / np.linalg.norm(sun_W))),
    )  # fmt: skip


def _sun_at(make_camera: Callable[..., Made], pixel: tuple[float, float]) -> tuple[Any, NearInfraredCamera, np.ndarray]:
    """A world whose Sun stands at a pixel; its direction (3,)."""
    world, camera = make_camera()
    sun_W = camera.pose(world.data)[0] @ world.as_built.camera.rays_from_pixels(np.array([pixel]))[0]
    return *make_camera(sun_W=sun_W), sun_W


def test_the_sun_in_view_is_a_disc_27_pixels_wide_in_a_saturated_glow(make_camera: Callable[..., Made]) -> None:
    world, camera, _ = _sun_at(make_camera, (500.0, 400.0))
    window = Window(340, 460, 440, 560)
    electrons = camera.expected_electrons(world.data, window)
    disc = electrons > 0.5 * electrons.max()
    # 2 f tan 0.2665 deg = 27.1 px on the axis; off it the picture's solid angle stretches by 1/cos^3
    wide = 27.1 * np.hypot(1.0, np.hypot(520.7, 145.1) / world.as_built.camera.focal_length_px) ** 1.5
    assert 2.0 * np.sqrt(disc.sum() / np.pi) == pytest.approx(wide, abs=0.4)
    rows, columns = np.nonzero(disc)
    assert (columns.mean() + 440, rows.mean() + 340) == pytest.approx((500.0, 400.0), abs=0.1)
    frame = camera.expose(world.data, 0.0, 0, window)
    assert frame is not None
    assert (frame.pixels[disc] == 255).all() or (frame.pixels[disc] >= 253).all()
    glow = (frame.pixels >= 253).sum()  # the halo and the diffraction's wing clip too: 1/1000 of the disc suffices
    assert disc.sum() < glow < 8 * disc.sum()


def test_a_sun_far_beside_the_frame_is_not_imaged_in_it_where_the_lenses_polynomial_folds_back(
    make_camera: Callable[..., Made],
) -> None:
    world, _ = make_camera()
    camera = replace(world.as_built.camera, distortion=(-4.2e-4, -7.7e-4, 0.0, 0.0, 0.0))
    for angle_deg in (*np.arange(30.0, 90.0, 0.1), 89.99, 89.9999, 90.0, 120.0, 180.0):
        angle = np.deg2rad(angle_deg)
        sun_W = np.array([np.cos(angle), np.sin(angle), 0.0])
        view = SunView(world.model, camera, _ClearSky(), sun_W, SHEETS.light.sun_angular_radius_rad, 6.0)
        assert view.patch(world.data, (np.eye(3), np.zeros(3))) is None


class _ClearSky:
    def beam(self, directions_W: np.ndarray) -> np.ndarray:
        return np.ones(len(directions_W))


def test_a_wing_before_the_sun_hides_disc_halo_and_veil(make_camera: Callable[..., Made]) -> None:
    world, camera, sun_W = _sun_at(make_camera, (500.0, 400.0))
    corner = Window(1000, 1088, 1900, 2048)
    free = camera.expected_electrons(world.data, corner).mean()
    world.put("tanker", camera.pose(world.data)[1] + 20.0 * sun_W, exp(np.array([0.0, 0.0, np.pi / 4])))
    hidden = camera.expected_electrons(world.data, corner).mean()
    without = camera.background_electrons(world.data, corner).mean()
    assert hidden == pytest.approx(without, rel=1e-6)
    flux_e = response_of(world, sun_W).sun_flux_e_s * EXPOSURE_S * (camera.pose(world.data)[0].T @ sun_W)[0]
    veil = SHEETS.glare.veiling_glare * flux_e / (2048 * 1088)
    assert veil < free - hidden < 2.0 * veil  # the halo's far wing adds to it
    assert camera.expected_electrons(world.data, Window(390, 410, 490, 510)).max() < SHEETS.sensor.full_well_e


def test_a_glint_has_the_place_of_the_mirror_point_and_the_light_of_the_spheres_curvature(
    make_camera: Callable[..., Made],
) -> None:
    """The hub's sphere, radius 0.1 m: I = E R r^2/4 and the law of reflection, by hand, against the picture."""
    world, dark = make_camera()
    R_WC, _ = dark.pose(world.data)
    sun_C = np.array([-0.9, 0.3, 0.3]) / np.linalg.norm([-0.9, 0.3, 0.3])
    lit_world, lit = make_camera(sun_W=R_WC @ sun_C)
    centre = np.array([8.5, 0.2, -0.1])
    toward_lens = -centre / np.linalg.norm(centre)
    n = (toward_lens + sun_C) / np.linalg.norm(toward_lens + sun_C)
    point = centre + 0.1 * n
    u, v = world.as_built.camera.pixels_from_points(point[None])[0]
    window = Window(round(v) - 45, round(v) + 46, round(u) - 45, round(u) + 46)  # the PSF's reach

    def glint(scene: Any, camera: NearInfraredCamera) -> np.ndarray:
        """Without LEDs: they and their own reflections are in both."""
        return camera.expected_electrons(scene.data, window).astype(float) - camera.background_electrons(
            scene.data, window
        )

    glints = glint(lit_world, lit) - glint(world, dark)
    rows, columns = np.indices(glints.shape)
    found = (
        (glints * columns).sum() / glints.sum() + window.column_start,
        (glints * rows).sum() / glints.sum() + window.row_start,
    )
    # the line of sight to the point and that to the centre differ by 0.004 rad, which moves the point by 0.2 mm
    assert found == pytest.approx((u, v), abs=0.1)
    r = np.linalg.norm(point)
    cosine = float(n @ sun_C)
    surfaces = SHEETS.surfaces
    reflectance = surfaces.metal_share * _metal(surfaces.metal_reflectance, cosine)
    flux_e = response_of(lit_world, R_WC @ sun_C).sun_flux_e_s * EXPOSURE_S
    by_hand = reflectance * flux_e * 0.1**2 / 4.0 * (point[0] / r) / r**2
    assert glints.sum() == pytest.approx(by_hand, rel=0.02)


def _metal(normal: float, cosine: float) -> float:
    """Schlick's reflectance of a metal."""
    return normal + (1.0 - normal) * (1.0 - cosine) ** 5


@pytest.mark.parametrize("pixel", [(1020.0, 545.0), (60.0, 90.0)])
def test_the_suns_disc_has_its_radiance_through_the_aperture_and_the_fourth_power_of_the_cosine(
    pixel: tuple[float, float], make_camera: Callable[..., Made]
) -> None:
    """Electrons in the disc's middle: S E/Omega (pi/4 N^2) p^2 t cos^4, less what diffraction takes out of it."""
    world, camera, sun_W = _sun_at(make_camera, pixel)
    as_built = world.as_built.camera
    u, v = (round(x) for x in pixel)
    middle = camera.expected_electrons(world.data, Window(v - 1, v + 2, u - 1, u + 2)).mean()
    on_axis = response_of(world, sun_W).sun_disc_e_s * EXPOSURE_S
    cos_t = 1.0 / np.sqrt(
        1.0 + np.sum(((np.array(pixel) - as_built.principal_point_px) / as_built.focal_length_px) ** 2)
    )
    assert middle == pytest.approx(on_axis * cos_t**4, rel=0.05)
    assert middle < on_axis * cos_t**4


def test_clouds_before_the_sun_dim_disc_and_veil_alike(make_camera: Callable[..., Made]) -> None:
    from dockair.sim.camera.weather import Weather

    world, camera, sun_W = _sun_at(make_camera, (700.0, 300.0))
    corner, disc = Window(1000, 1088, 1900, 2048), Window(295, 306, 695, 706)
    under = make_camera(sun_W=sun_W, weather=Weather(cloud_cover=1.0, cloud_optical_depth=3.0))[1]
    clear_e, cloudy_e = (c.expected_electrons(world.data, disc).mean() for c in (camera, under))
    assert cloudy_e < 0.3 * clear_e
    stray = [
        (c.expected_electrons(world.data, corner) - c.background_electrons(world.data, corner)).mean()
        for c in (camera, under)
    ]
    assert stray[1] < 0.3 * stray[0]


def test_at_night_there_is_nothing_but_the_leds(make_camera: Callable[..., Made]) -> None:
    from dockair.sim.camera.weather import Weather

    world, camera = make_camera(weather=Weather(night=True))
    image = camera.expected_electrons(world.data, Window(0, 1088, 0, 2048))
    assert np.median(image) < 0.5
    assert image.max() > 2000.0


def test_haze_takes_light_of_the_leds_by_koschmieders_law(make_camera: Callable[..., Made]) -> None:
    """Visibility 40 m, LEDs 8 m away: exp(-3.912 8/40) = 0.457 of their light."""
    from dockair.sim.camera.weather import Weather

    def leds(weather: Weather) -> np.ndarray:
        world, camera = make_camera(weather=weather, hub=False)
        image = camera.expected_electrons(world.data, Window(350, 750, 820, 1220)).astype(float)
        return image - camera.background_electrons(world.data, Window(350, 750, 820, 1220))

    left = leds(Weather(visibility_m=40.0)).sum() / leds(Weather(visibility_m=1e9)).sum()
    assert left == pytest.approx(np.exp(-3.912 * 8.0 / 40.0), rel=0.01)
