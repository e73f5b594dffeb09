"""Sunlight through cloud over the Sun's disc: its mean, and that solids, glints and stray light all have it."""

import math
from typing import Any

import numpy as np
import pytest

from dockair.calibration import Camera
from dockair.parameters import load_parameters
from dockair.sim.camera.sheets import LightParameters, SkyParameters
from dockair.sim.camera.sky_radiance import SkyRadiance
from dockair.sim.camera.solids import Lighting
from dockair.sim.camera.sun_beam import SunBeam
from dockair.sim.camera.sun_view import SunView
from dockair.sim.camera.weather import Weather

SHEET = load_parameters("sky", SkyParameters)
RADIUS_RAD = load_parameters("light", LightParameters).sun_angular_radius_rad
SUN_W = np.array([0.6, 0.0, 0.8])


class _HalfCloudedSky:
    """Thick cloud to the right of the plane through W's x and z that is shifted to the left by a part of the disc."""

    ambient = 0.2

    def __init__(self, radii: float) -> None:
        self._edge = math.sin(radii * RADIUS_RAD)

    def beam(self, directions_W: np.ndarray) -> np.ndarray:
        return (directions_W[:, 1] > self._edge).astype(float)


@pytest.mark.parametrize("radii", [-1.1, -0.5, 0.0, 0.5, 1.1])
def test_the_light_on_solids_is_the_share_of_the_disc_that_stands_clear_of_an_edge_of_cloud(radii: float) -> None:
    """Area of a circle beyond a chord at d radii: (arccos d - d sqrt(1 - d^2))/pi."""
    d = min(max(radii, -1.0), 1.0)
    clear = (math.acos(d) - d * math.sqrt(1.0 - d * d)) / math.pi
    sky = _HalfCloudedSky(radii)
    assert Lighting.toward(SUN_W, sky, RADIUS_RAD).direct == pytest.approx(clear, abs=0.03)
    assert SunBeam.of(sky, SUN_W, RADIUS_RAD).mean == Lighting.toward(SUN_W, sky, RADIUS_RAD).direct


@pytest.mark.parametrize("sun_W", [SUN_W, np.array([0.0, 0.0, 1.0]), np.array([-0.48, 0.8, 0.36])])
def test_the_rays_fill_the_disc_as_evenly_as_its_moments_tell(sun_W: np.ndarray) -> None:
    """Over a disc of radius R both axes have the variance R^2/4, no covariance, and the middle as their mean."""
    d = SunBeam.of(_HalfCloudedSky(0.0), sun_W, RADIUS_RAD).directions_W
    assert np.linalg.norm(d, axis=1) == pytest.approx(np.ones(len(d)), abs=1e-14)
    across = d - np.outer(d @ sun_W, sun_W)
    assert across.mean(axis=0) == pytest.approx(np.zeros(3), abs=1e-6 * RADIUS_RAD)
    plane = np.eye(3) - np.outer(sun_W, sun_W)
    assert across.T @ across / len(d) == pytest.approx(RADIUS_RAD**2 / 4.0 * plane, abs=1e-4 * RADIUS_RAD**2)


def test_solids_glints_and_stray_light_have_one_beam_under_broken_cloud(small_world: Any) -> None:
    """Twenty Suns; under 0.3 of cloud the ray to the middle alone is off by more than a quarter for some."""
    alone = []
    for azimuth in np.linspace(0.0, 6.0, 20):
        sun_W = np.array([math.cos(azimuth), math.sin(azimuth), 0.15]) / math.hypot(1.0, 0.15)
        sky = SkyRadiance(SHEET, Weather(cloud_cover=0.3), sun_W, 6000.0, 7)
        small_world.model.light_dir[0] = -sun_W
        view = SunView(small_world.model, Camera(), sky, sun_W, RADIUS_RAD, 6.0)
        assert Lighting.of(small_world.model, sky, RADIUS_RAD).direct == pytest.approx(view.beam, abs=1e-9)
        alone.append(abs(float(sky.beam(sun_W[None])[0]) - view.beam))
    assert max(alone) > 0.25


class _CloudAbove:
    """Thick cloud where rays of a camera that looks along W's x point above the rows from one on."""

    def __init__(self, row: float) -> None:
        self._slope = -(row - Camera().principal_point_px[1]) / Camera().focal_length_px

    def beam(self, directions_W: np.ndarray) -> np.ndarray:
        return (directions_W[:, 2] < self._slope * directions_W[:, 0]).astype(float)


@pytest.mark.parametrize("place", [(1023.5, 543.5), (60.0, 90.0), (-10.0, 500.0), (900.0, 1097.0), (2056.0, 3.0)])
def test_the_patch_around_the_disc_holds_all_of_it_and_each_pixels_own_cloud(
    small_world: Any, place: tuple[float, float]
) -> None:
    """Also where its middle is beside the frame. Drawn out by 1/cos^2 off the axis, with 6 px of blur."""
    sun_W = Camera().rays_from_pixels(np.array([place]))[0]
    view = SunView(small_world.model, Camera(), _CloudAbove(place[1] - 0.25), sun_W, RADIUS_RAD, 6.0)
    found = view.patch(small_world.data, (np.eye(3), np.array([0.0, 0.0, 500.0])))
    assert found is not None
    seen, (row, column) = found
    reach = (Camera().focal_length_px * math.tan(RADIUS_RAD) + 6.0) / sun_W[0] ** 2
    for first, count, middle in ((row, seen.shape[0], place[1]), (column, seen.shape[1], place[0])):
        assert first <= middle - reach and first + count - 1 >= middle + reach - 1.0
    rows = row + np.arange(len(seen))
    assert np.array_equal(seen, np.broadcast_to((rows > place[1] - 0.25)[:, None].astype(float), seen.shape))


def test_without_cloud_all_of_the_sunlight_comes_through_to_the_bit() -> None:
    sky = SkyRadiance(SHEET, Weather(), SUN_W, 6000.0, 7)
    assert Lighting.toward(SUN_W, sky, RADIUS_RAD).direct == 1.0
