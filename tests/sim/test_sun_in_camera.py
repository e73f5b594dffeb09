"""The Sun as the camera shows it: disc, veil, glints. The parts by themselves are in test_glare.py."""

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from dockair.messages import Window
from dockair.parameters import load_parameters
from dockair.rotations import exp
from dockair.sim.camera.camera import CameraParameters, LedParameters, LightParameters, NearInfraredCamera
from dockair.sim.camera.radiometry import responses, sun_detection

PARAMETERS = load_parameters("camera", CameraParameters)
LEDS = load_parameters("leds", LedParameters)
LIGHT = load_parameters("light", LightParameters)
Made = tuple[Any, NearInfraredCamera]

pytestmark = pytest.mark.gl


def test_the_sun_in_view_is_a_saturated_disc_27_pixels_wide(make_camera: Callable[..., Made]) -> None:
    world, camera = make_camera()
    R_WC, _ = camera.pose(world.data)
    sun_C = world.as_built.camera.rays_from_pixels(np.array([[500.0, 400.0]]))[0]
    world, camera = make_camera(sun_W=R_WC @ sun_C)
    frame = camera.expose(world.data, 0.0, 0, None)
    bright = frame.pixels[340:460, 440:560] >= 254
    # the Gaussian edge still saturates 3 to 4 of its sigma outside the geometric disc
    assert 27.0 <= 2.0 * np.sqrt(bright.sum() / np.pi) <= 32.0
    rows, columns = np.nonzero(bright)
    assert (columns.mean() + 440, rows.mean() + 340) == pytest.approx((500.0, 400.0), abs=0.1)


def test_a_wing_before_the_sun_hides_disc_and_veil(make_camera: Callable[..., Made]) -> None:
    world, camera = make_camera()
    R_WC, p_WC = camera.pose(world.data)
    sun_W = R_WC @ world.as_built.camera.rays_from_pixels(np.array([[500.0, 400.0]]))[0]
    world, camera = make_camera(sun_W=sun_W)
    corner = Window(1000, 1088, 1900, 2048)
    free = camera.expected_electrons(world.data, corner).mean()
    world.put("tanker", p_WC + 20.0 * sun_W, exp(np.array([0.0, 0.0, np.pi / 4])))
    hidden = camera.expected_electrons(world.data, corner).mean()
    veil = (
        PARAMETERS.veiling_glare * responses(PARAMETERS, LEDS, LIGHT, world.as_built.camera).sun_flux_e / (2048 * 1088)
    )
    assert free - hidden == pytest.approx(veil, rel=0.05)
    assert camera.expected_electrons(world.data, Window(390, 410, 490, 510)).max() < PARAMETERS.full_well_e


def test_a_glint_has_the_place_of_the_mirror_point_and_the_light_of_the_spheres_curvature(
    make_camera: Callable[..., Made],
) -> None:
    """The hub's sphere, radius 0.1 m: I = E R r^2/4 and the law of reflection, by hand, against the picture."""
    world, camera = make_camera()
    R_WC, _ = camera.pose(world.data)
    sun_C = np.array([-0.9, 0.3, 0.3]) / np.linalg.norm([-0.9, 0.3, 0.3])
    lit_world, lit = make_camera(sun_W=R_WC @ sun_C)
    centre = np.array([8.5, 0.2, -0.1])
    toward_lens = -centre / np.linalg.norm(centre)
    n = (toward_lens + sun_C) / np.linalg.norm(toward_lens + sun_C)
    point = centre + 0.1 * n
    u, v = world.as_built.camera.pixels_from_points(point[None])[0]
    window = Window(round(v) - 45, round(v) + 46, round(u) - 45, round(u) + 46)  # the PSF's whole reach
    glint = lit.expected_electrons(lit_world.data, window) - camera.expected_electrons(world.data, window)
    rows, columns = np.indices(glint.shape)
    found = (
        (glint * columns).sum() / glint.sum() + window.column_start,
        (glint * rows).sum() / glint.sum() + window.row_start,
    )
    # the line of sight to the point and that to the centre differ by 0.004 rad, which moves the point by 0.2 mm
    assert found == pytest.approx((u, v), abs=0.1)
    sun_flux_e = responses(PARAMETERS, LEDS, LIGHT, world.as_built.camera).sun_flux_e  # S E times the aperture
    r = np.linalg.norm(point)
    by_hand = LIGHT.glint_reflectance * sun_flux_e * 0.1**2 / 4.0 * (point[0] / r) / r**2
    assert glint.sum() == pytest.approx(by_hand, rel=0.01)


@pytest.mark.parametrize("pixel", [(1020.0, 545.0), (60.0, 1000.0)])
def test_the_suns_disc_has_its_radiance_through_the_aperture_and_the_fourth_power_of_the_cosine(
    pixel: tuple[float, float], make_camera: Callable[..., Made]
) -> None:
    """Electrons in the disc's middle: S E/Omega (pi/4 N^2) p^2 t cos^4, the sky's and the veil's being 1e-4 of it."""
    world, camera = make_camera()
    as_built = world.as_built.camera
    sun_C = as_built.rays_from_pixels(np.array([pixel]))[0]
    world, camera = make_camera(sun_W=camera.pose(world.data)[0] @ sun_C)
    u, v = (round(x) for x in pixel)
    middle = camera.expected_electrons(world.data, Window(v - 1, v + 2, u - 1, u + 2)).mean()
    irradiance = sun_detection(PARAMETERS, LIGHT)  # electrons a second and square metre
    radiance = irradiance / (np.pi * LIGHT.sun_angular_radius_rad**2)
    on_axis = radiance * np.pi / (4.0 * PARAMETERS.f_number**2) * as_built.pixel_pitch_m**2 * PARAMETERS.exposure_s
    cos_t = 1.0 / np.sqrt(
        1.0 + np.sum(((np.array(pixel) - as_built.principal_point_px) / as_built.focal_length_px) ** 2)
    )
    assert middle == pytest.approx(on_axis * cos_t**4, rel=2e-3)
