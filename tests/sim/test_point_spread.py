"""The spectrum of a point's image against closed forms, and the tabulated core."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.special import j1, roots_legendre

from dockair.calibration import Camera
from dockair.errors import DockairError
from dockair.parameters import load_parameters
from dockair.sim.camera.optics import PointSpread
from dockair.sim.camera.point_spread import Spread, airy_px, blur_px, core, spectrum, transfer
from dockair.sim.camera.sheets import LensParameters, SensorParameters

LENS = load_parameters("lens", LensParameters)
CAMERA = Camera()
LED_M = 850e-9
F_NUMBERS = (1.4, 2.8, 4.0, 5.6, 8.0, 16.0)
DEPTHS_M = (1.0, 2.0, 5.0, 20.0, 40.0)
#: Diameter [px] of the geometric disc, 16 mm lens focused at 10 m, 5.5 um pixels: f^2/N |1/x - 1/10|, one decimal.
DISC_PX = {
    1.4: (29.9, 13.3, 3.3, 1.7, 2.5),
    2.8: (15.0, 6.6, 1.7, 0.8, 1.2),
    4.0: (10.5, 4.6, 1.2, 0.6, 0.9),
    5.6: (7.5, 3.3, 0.8, 0.4, 0.6),
    8.0: (5.2, 2.3, 0.6, 0.3, 0.4),
    16.0: (2.6, 1.2, 0.3, 0.15, 0.2),
}


def _lens(f_number: float, shift_m: float = 0.0) -> LensParameters:
    return replace(LENS, f_number=f_number, focus_distance_m=10.0, near_infrared_focus_shift_m=shift_m)


@pytest.mark.parametrize("f_number", F_NUMBERS)
def test_the_defocused_disc_is_as_wide_as_the_table_of_geometric_optics_says(f_number: float) -> None:
    """To the table's last digit, once the lens's extension is taken out, which is 0.16 % when focused at 10 m."""
    extension = 10.0 / (10.0 - CAMERA.focal_length_m)
    got = np.abs(blur_px(_lens(f_number), CAMERA, 1.0 / np.array(DEPTHS_M))) / extension
    assert got == pytest.approx(np.array(DISC_PX[f_number]), rel=0.0, abs=0.055)


def test_the_disc_is_the_cone_of_rays_cut_by_the_sensor() -> None:
    """Similar triangles with thin-lens image distances; the shift moves the near-infrared image off the sensor."""
    lens = replace(_lens(2.8, shift_m=3e-5), focus_distance_m=4.0)
    F, aperture = CAMERA.focal_length_m, CAMERA.focal_length_m / 2.8
    for x in (1.0, 3.0, 25.0):
        image = F * x / (x - F) + 3e-5
        sensor = F * 4.0 / (4.0 - F)
        got = blur_px(lens, CAMERA, np.array([1.0 / x]))[0]
        assert got == pytest.approx(aperture * (image - sensor) / image / CAMERA.pixel_pitch_m, rel=1e-9)


def test_an_image_that_falls_behind_the_sensor_makes_farther_points_sharp() -> None:
    """A shift of 20 um uncovers 1/x = 1/x0 - shift/f^2: 45 m for a lens focused at 10 m."""
    x = 1.0 / (1.0 / 10.0 - 20e-6 / 0.016**2)
    assert abs(blur_px(_lens(1.4, shift_m=20e-6), CAMERA, np.array([1.0 / x]))[0]) < 0.02
    assert abs(blur_px(_lens(1.4, shift_m=20e-6), CAMERA, np.array([0.1]))[0]) > 1.5


def test_diffraction_is_wavelength_times_f_number_at_the_image_distance_of_the_focus() -> None:
    assert airy_px(_lens(8.0), CAMERA, LED_M) == pytest.approx(850e-9 * 8.0 / 5.5e-6 * 10.0 / (10.0 - 0.016), rel=1e-12)


@pytest.mark.parametrize("distance_m", [CAMERA.focal_length_m, 0.5 * CAMERA.focal_length_m])
def test_a_focus_not_beyond_the_focal_length_is_refused(distance_m: float) -> None:
    """A long lens of a camera file may have it, and its image is nowhere."""
    lens = replace(LENS, focus_distance_m=distance_m)
    refused = rf"lens.focus_distance_m: expected more than the camera's focal length, 0.016 m, got {distance_m}"
    with pytest.raises(DockairError, match=refused):
        PointSpread(lens, load_parameters("sensor", SensorParameters), CAMERA, LED_M)


def test_in_focus_the_transfer_function_is_the_round_apertures() -> None:
    f = np.linspace(0.0, 1.0, 301)
    g = np.minimum(f * 1.24, 1.0)
    closed = 2.0 / np.pi * (np.arccos(g) - g * np.sqrt(1.0 - g**2))
    assert transfer(f, 1.24, 0.0) == pytest.approx(closed, abs=1e-13)


@pytest.mark.parametrize("blur_in_airy", [0.3, 3.0, 7.9, 12.0, 60.0, 139.0, 300.0])
def test_the_intensity_on_the_axis_falls_with_defocus_as_sinc_squared(blur_in_airy: float) -> None:
    """Born & Wolf section 8.8.2: (sin(u/4)/(u/4))^2, u/4 = pi b/(8 q); the spectrum's integral, 8 Int T g dg."""
    x, weights = roots_legendre(600)
    g = 0.5 * (x + 1.0)
    on_axis = 8.0 * 0.5 * (weights * transfer(g, 1.0, blur_in_airy) * g).sum()
    assert on_axis == pytest.approx(np.sinc(blur_in_airy / 8.0) ** 2, abs=1e-9)


def test_a_wide_disc_has_the_transfer_function_of_geometric_optics() -> None:
    """2 J1(z)/z, z = pi b f, at frequencies far below diffraction's cut-off 1/q."""
    f = np.linspace(1e-4, 0.2, 200)
    z = np.pi * 30.0 * f
    assert transfer(f, 0.02, 30.0) == pytest.approx(2.0 * j1(z) / z, abs=6e-3)


@pytest.mark.parametrize("blur", [0.0, 1.5])
def test_the_spectrums_cusp_is_that_of_the_wings(blur: float) -> None:
    """1 - H = (4/pi) q f to first order, whatever the blurs: energy beyond r is 2 q/(pi^2 r)."""
    f = np.array([0.0, 1e-5])
    H = spectrum(f, Spread(airy=1.24, diffusion=0.3, blur=blur, die=0.5))
    assert H[0, 0] == pytest.approx(1.0, abs=1e-15)
    assert 1.0 - H[0, 1] == pytest.approx(4.0 / np.pi * 1.24 * 1e-5, rel=1e-2)


@pytest.mark.parametrize("airy,blur,die", [(1.24, 0.6, 0.3), (0.43, 6.6, 1.4), (2.48, 0.0, 3.0), (0.22, 0.0, 0.0)])
def test_core_and_wings_hold_all_energy_at_every_position_in_the_pixel(airy: float, blur: float, die: float) -> None:
    spread = Spread(airy=airy, diffusion=0.3, blur=blur, die=die)
    A, w = spread.wing
    sums = core(spread).sum((2, 3), dtype=float)
    assert sums + 2.0 * np.pi * A / w == pytest.approx(np.ones_like(sums), abs=1e-6)
