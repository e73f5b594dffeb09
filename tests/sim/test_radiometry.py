"""The photon budget by hand, and the laws that each kind of source follows."""

from dataclasses import replace

import numpy as np
import pytest

from dockair.calibration import Camera
from dockair.parameters import load_parameters
from dockair.sim.camera.radiometry import (
    CameraParameters,
    LedParameters,
    LightParameters,
    detection,
    led_electrons,
    responses,
    sun_detection,
)

CAMERA = load_parameters("camera", CameraParameters)
LEDS = load_parameters("leds", LedParameters)
LIGHT = load_parameters("light", LightParameters)
RESPONSE = responses(CAMERA, LEDS, LIGHT, Camera())
AFT = np.array([-1.0, 0.0, 0.0])


def _on_axis(range_m: float, intensity_w_sr: float = 1.0, axis_C: np.ndarray = AFT) -> float:
    p_CL = np.array([[range_m, 0.0, 0.0]])
    return float(led_electrons(RESPONSE, LEDS, np.array([intensity_w_sr]), p_CL, axis_C)[0])


@pytest.mark.parametrize("range_m", [3.0, 10.0, 30.0])
def test_led_electrons_are_the_hand_calculation(range_m: float) -> None:
    """One line at 850 nm: I (pi/4) (f/N)^2 / R^2 x T eta x t / (2.337e-19 J); the LED's 30 nm width costs 2 %."""
    watts = 0.02 * np.pi / 4.0 * (0.016 / 8.0) ** 2 / range_m**2
    by_hand = watts * 0.85 * 0.30 * 20e-6 / 2.337e-19
    assert _on_axis(range_m, 0.02) == pytest.approx(by_hand, rel=0.03)


def test_a_strong_led_ten_metres_off_makes_three_million_electrons_in_100_microseconds() -> None:
    longer = responses(replace(CAMERA, exposure_s=100e-6), LEDS, LIGHT, Camera())
    electrons = led_electrons(longer, LEDS, np.array([0.9]), np.array([[10.0, 0.0, 0.0]]), AFT)
    assert electrons[0] == pytest.approx(3.1e6, rel=0.03)


def test_sunlit_white_of_reflectance_0_7_makes_250_electrons_outside_the_atmosphere() -> None:
    assert 0.7 * RESPONSE.white_e / LIGHT.air_transmittance == pytest.approx(250.0, rel=0.02)


def test_the_suns_disc_is_far_over_full_well() -> None:
    assert RESPONSE.sun_disc_e / LIGHT.air_transmittance == pytest.approx(1.6e7, rel=0.05)


def test_the_suns_disc_and_a_white_surface_keep_the_ratio_of_their_solid_angles() -> None:
    """A white surface in normal sunlight has the radiance E/pi, the disc E/(pi a^2)."""
    ratio = RESPONSE.sun_disc_e / RESPONSE.white_e
    assert ratio == pytest.approx(1.0 / LIGHT.sun_angular_radius_rad**2, rel=1e-12)


def test_the_light_in_the_suns_image_is_the_light_that_enters_the_lens() -> None:
    """Energy: radiance x image's area = irradiance x aperture; the disc's radius is f a in small-angle optics."""
    camera = Camera()
    pixels = np.pi * (camera.focal_length_px * LIGHT.sun_angular_radius_rad) ** 2
    assert RESPONSE.sun_disc_e * pixels == pytest.approx(RESPONSE.sun_flux_e, rel=1e-12)


def test_the_sheet_holds_the_sun_of_astm_g173_between_800_and_1000_nm() -> None:
    wavelength = np.arange(800e-9, 1000.1e-9, 0.5e-9)
    irradiance = np.interp(wavelength, LIGHT.wavelength_m, LIGHT.sun_irradiance_w_m3)
    assert np.trapezoid(irradiance, wavelength) == pytest.approx(183.83, abs=0.2)


def test_the_long_pass_filter_halves_at_its_cut_on_and_blocks_below() -> None:
    below, half, above = detection(CAMERA, np.array([784e-9, 800e-9, 816e-9]))
    no_filter = detection(replace(CAMERA, filter_cut_on_m=700e-9), np.array([800e-9]))[0]
    assert below == 0.0
    assert half == pytest.approx(0.5 * no_filter, rel=1e-9)
    assert above > half


def test_a_longer_cut_on_takes_sunlight_away() -> None:
    assert sun_detection(replace(CAMERA, filter_cut_on_m=830e-9), LIGHT) < sun_detection(CAMERA, LIGHT)


def test_led_light_falls_with_the_square_of_the_range() -> None:
    assert _on_axis(5.0) / _on_axis(20.0) == pytest.approx(16.0, rel=1e-12)


@pytest.mark.parametrize("psi_deg", [10.0, 40.0, 70.0])
def test_the_pattern_is_a_power_of_the_cosine(psi_deg: float) -> None:
    psi = np.radians(psi_deg)
    turned = np.array([-np.cos(psi), np.sin(psi), 0.0])
    assert _on_axis(5.0, axis_C=turned) / _on_axis(5.0) == pytest.approx(np.cos(psi) ** LEDS.pattern_exponent, rel=1e-9)


def test_the_pattern_halves_at_the_data_sheets_40_degrees() -> None:
    psi = np.radians(40.0)
    turned = np.array([-np.cos(psi), 0.0, np.sin(psi)])
    assert _on_axis(5.0, axis_C=turned) / _on_axis(5.0) == pytest.approx(0.5, abs=0.002)


def test_an_led_that_shines_away_gives_nothing() -> None:
    assert _on_axis(5.0, axis_C=-AFT) == 0.0


def test_off_the_lenses_axis_the_aperture_is_foreshortened() -> None:
    angle = np.radians(15.0)
    p_CL = 8.0 * np.array([[np.cos(angle), np.sin(angle), 0.0]])
    toward_lens = -p_CL[0] / 8.0
    electrons = led_electrons(RESPONSE, LEDS, np.ones(1), p_CL, toward_lens)
    assert electrons[0] / _on_axis(8.0) == pytest.approx(np.cos(angle), rel=1e-12)
