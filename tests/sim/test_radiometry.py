"""The photon budget by hand, the laws that each kind of source follows, the spectra against the standard's table."""

import math
from dataclasses import replace

import numpy as np
import pytest
from scipy import constants
from scipy.stats import norm

from dockair.calibration import Camera
from dockair.errors import DockairError
from dockair.parameters import load_parameters
from dockair.sim.camera.radiometry import (
    Responses,
    detection,
    direct_beam_w_m3,
    extinction_1_m,
    filter_transmittance,
    led_detection,
    led_electrons,
    led_intensity_w_sr,
    led_wavelength_m,
    relative_air_mass,
    responses,
    responses_in_flight,
    solar_spectrum,
    sun_detection,
)
from dockair.sim.camera.sheets import (
    CameraSheets,
    FilterParameters,
    LedParameters,
    LensParameters,
    LightParameters,
    SensorParameters,
)

LENS = load_parameters("lens", LensParameters)
LONG_PASS = load_parameters("filter_long_pass", FilterParameters)
BAND_PASS = load_parameters("filter_band_pass", FilterParameters)
SENSOR = load_parameters("sensor", SensorParameters)
LEDS = load_parameters("leds", LedParameters)
LIGHT = load_parameters("light", LightParameters)
RESPONSE = responses(LENS, LONG_PASS, SENSOR, LEDS, LIGHT, Camera())
NARROW = responses(LENS, BAND_PASS, SENSOR, LEDS, LIGHT, Camera())
AFT = np.array([-1.0, 0.0, 0.0])
EXPOSURE_S = 20e-6
FLAT = replace(SENSOR, wavelength_m=np.array([300e-9, 1200e-9]), quantum_efficiency=np.array([0.3, 0.3]))


def _led(p_CL: np.ndarray, response: Responses = RESPONSE, axis_C: np.ndarray = AFT, extinction: float = 0.0) -> float:
    """Electrons in one second of an LED of 1 W/sr."""
    return float(led_electrons(response, LEDS, np.ones(1), p_CL[None], axis_C, 1.0, extinction)[0])


def _on_axis(range_m: float, axis_C: np.ndarray = AFT, extinction: float = 0.0) -> float:
    return _led(np.array([range_m, 0.0, 0.0]), axis_C=axis_C, extinction=extinction)


def _at_angle(angle_rad: float, response: Responses = RESPONSE) -> float:
    """Off the lens's axis at 8 m, the LED turned toward the lens."""
    toward = np.array([np.cos(angle_rad), np.sin(angle_rad), 0.0])
    return _led(8.0 * toward, response, -toward)


def _irradiance(low_nm: float, high_nm: float, spectrum_w_m3: np.ndarray) -> float:
    nm = np.round(1e9 * solar_spectrum().wavelength_m, 6)
    inside = (nm >= low_nm) & (nm <= high_nm)
    return float(np.trapezoid(spectrum_w_m3[inside], 1e-9 * nm[inside]))


# --- photon budget


@pytest.mark.parametrize(("range_m", "by_hand"), [(3.0, 112_000.0), (10.0, 10_080.0), (30.0, 1120.0)])
def test_an_leds_electrons_are_the_hand_calculation_of_the_page(range_m: float, by_hand: float) -> None:
    """docs/models/radiometry.md: 0.015 W/sr, f/8, 20 us, and of the spectrum one mean quantum efficiency, 0.2955."""
    intensity = np.array([led_intensity_w_sr(LEDS)])
    p_CL = np.array([[range_m, 0.0, 0.0]])
    electrons = led_electrons(RESPONSE, LEDS, intensity, p_CL, AFT, EXPOSURE_S)[0]
    watts = 0.015 * np.pi / 4.0 * (0.016 / 8.0) ** 2 / range_m**2
    assert watts * 0.90 * 0.94 * 0.2955 * 20e-6 / 2.337e-19 == pytest.approx(by_hand, rel=1e-3)
    assert electrons == pytest.approx(by_hand, rel=0.01)


def test_a_strong_led_ten_metres_off_makes_three_million_electrons_in_100_microseconds() -> None:
    assert 0.9 * 100e-6 * _on_axis(10.0) == pytest.approx(3.1e6, rel=0.03)


def test_sunlit_white_of_reflectance_0_7_makes_250_electrons_outside_the_atmosphere() -> None:
    assert 0.7 * RESPONSE.white_e_s * EXPOSURE_S == pytest.approx(250.0, rel=0.02)


def test_the_suns_disc_is_far_over_full_well() -> None:
    assert RESPONSE.sun_disc_e_s * EXPOSURE_S == pytest.approx(1.6e7, rel=0.05)


def test_the_suns_disc_and_a_white_surface_keep_the_ratio_of_their_solid_angles() -> None:
    """A white surface in normal sunlight has the radiance E/pi, the disc E/(pi a^2)."""
    ratio = RESPONSE.sun_disc_e_s / RESPONSE.white_e_s
    assert ratio == pytest.approx(1.0 / LIGHT.sun_angular_radius_rad**2, rel=1e-12)


def test_the_light_in_the_suns_image_is_the_light_that_enters_the_lens() -> None:
    """Energy: radiance x image's area = irradiance x aperture; the disc's radius is f a in small-angle optics."""
    camera = Camera()
    pixels = np.pi * (camera.focal_length_px * LIGHT.sun_angular_radius_rad) ** 2
    assert RESPONSE.sun_disc_e_s * pixels == pytest.approx(RESPONSE.sun_flux_e_s, rel=1e-12)


def test_a_mirror_ball_in_sunlight_is_as_bright_as_an_led_of_its_in_band_intensity() -> None:
    """All the Sun's light in the LED's line: a ball of radius 2 m and an LED of E r^2/4 W/sr give the same."""
    lens_area = np.pi / 4.0 * (Camera().focal_length_m / LENS.f_number) ** 2
    electrons_per_joule = float(led_detection(LENS, LONG_PASS, SENSOR, LEDS))
    in_line = RESPONSE.sun_flux_e_s / lens_area / electrons_per_joule  # W/m^2
    ball = RESPONSE.glint_e_m2_s * (2.0**2 / 4.0) / 50.0**2
    assert ball == pytest.approx(in_line * 2.0**2 / 4.0 * _on_axis(50.0), rel=1e-12)


def test_a_wider_stop_takes_light_with_its_area_and_a_longer_lens_keeps_a_surfaces_brightness() -> None:
    wide = responses(replace(LENS, f_number=4.0), LONG_PASS, SENSOR, LEDS, LIGHT, Camera())
    long = responses(LENS, LONG_PASS, SENSOR, LEDS, LIGHT, Camera(focal_length_m=0.032))
    assert wide.led_e_m2_sr_w_s == pytest.approx(4.0 * RESPONSE.led_e_m2_sr_w_s, rel=1e-12)
    assert wide.white_e_s == pytest.approx(4.0 * RESPONSE.white_e_s, rel=1e-12)
    assert long.led_e_m2_sr_w_s == pytest.approx(4.0 * RESPONSE.led_e_m2_sr_w_s, rel=1e-12)
    assert long.white_e_s == pytest.approx(RESPONSE.white_e_s, rel=1e-12)


# --- the LED


def test_led_light_falls_with_the_square_of_the_range() -> None:
    assert _on_axis(5.0) / _on_axis(20.0) == pytest.approx(16.0, rel=1e-12)


@pytest.mark.parametrize("psi_deg", [10.0, 40.0, 70.0])
def test_the_pattern_is_a_power_of_the_cosine(psi_deg: float) -> None:
    psi = np.radians(psi_deg)
    turned = np.array([-np.cos(psi), np.sin(psi), 0.0])
    assert _on_axis(5.0, turned) / _on_axis(5.0) == pytest.approx(np.cos(psi) ** LEDS.pattern_exponent, rel=1e-9)


def test_the_pattern_halves_at_the_data_sheets_40_degrees() -> None:
    psi = np.radians(40.0)
    assert _on_axis(5.0, np.array([-np.cos(psi), 0.0, np.sin(psi)])) / _on_axis(5.0) == pytest.approx(0.5, abs=0.002)


def test_an_led_that_shines_away_gives_nothing_nor_does_one_behind_the_camera() -> None:
    assert _on_axis(5.0, -AFT) == 0.0
    assert _led(np.array([-5.0, 0.0, 0.0]), axis_C=-AFT) == 0.0


def test_off_the_lenses_axis_the_aperture_is_foreshortened() -> None:
    assert _at_angle(np.radians(15.0)) / _at_angle(0.0) == pytest.approx(np.cos(np.radians(15.0)), rel=1e-12)


def test_twice_the_exposure_doubles_the_electrons() -> None:
    one, two = (led_electrons(RESPONSE, LEDS, np.ones(1), np.array([[9.0, 1.0, 2.0]]), AFT, t) for t in (1e-5, 2e-5))
    assert two[0] == pytest.approx(2.0 * one[0], rel=1e-15)


def test_intensity_is_proportional_to_the_current_and_falls_by_0_3_percent_a_kelvin() -> None:
    rated = replace(LEDS, drive_current_a=1.0)
    assert led_intensity_w_sr(rated) == pytest.approx(0.9, rel=1e-12)
    assert led_intensity_w_sr(replace(rated, drive_current_a=1.5)) == pytest.approx(1.33, rel=0.02)  # the data sheet's
    warmer, colder = (led_intensity_w_sr(replace(rated, junction_temperature_c=t)) for t in (26.0, 24.0))
    assert (warmer - colder) / (2.0 * 0.9) == pytest.approx(-0.003, rel=1e-5)
    assert led_intensity_w_sr(LEDS) == pytest.approx(0.015, rel=0.01)


def test_the_line_moves_to_the_red_with_temperature_and_keeps_its_energy() -> None:
    hot = replace(LEDS, junction_temperature_c=85.0)
    assert led_wavelength_m(hot) == pytest.approx(850e-9 + 60.0 * 0.28e-9, rel=1e-12)
    # a detector that counts photons of equal probability: electrons per joule follow the mean wavelength alone
    clear = replace(LONG_PASS, cut_on_m=400e-9)
    ratio = led_detection(LENS, clear, FLAT, hot) / led_detection(LENS, clear, FLAT, LEDS)
    assert ratio == pytest.approx(led_wavelength_m(hot) / 850e-9, rel=1e-9)


def test_haze_takes_light_by_beer_and_lambert_and_by_koschmieders_extinction() -> None:
    beta = extinction_1_m(50.0)
    assert beta == pytest.approx(3.912 / 50.0, rel=1e-4)
    assert _on_axis(20.0, extinction=beta) / _on_axis(20.0) == pytest.approx(np.exp(-beta * 20.0), rel=1e-12)
    assert extinction_1_m(np.inf) == 0.0


def test_haze_acts_along_the_slant_range() -> None:
    p_CL = np.array([12.0, 3.0, -4.0])
    assert _led(p_CL, extinction=0.1) / _led(p_CL) == pytest.approx(np.exp(-1.3), rel=1e-12)


@pytest.mark.parametrize("visibility_m", [0.0, -5.0, np.nan])
def test_no_visibility_is_refused(visibility_m: float) -> None:
    with pytest.raises(DockairError, match="visibility_m: expected a number > 0"):
        extinction_1_m(visibility_m)


# --- filters


def _mean_over_gaussian(start: float, mean: float, sigma: float) -> float:
    """E[X max(X - start, 0)] of a normal X, closed form."""
    z = (start - mean) / sigma
    first = sigma * norm.pdf(z) + (mean - start) * norm.sf(z)
    second = (sigma**2 + (mean - start) ** 2) * norm.sf(z) + (mean - start) * sigma * norm.pdf(z)
    return float(second + start * first)


def _closed_form(filter_: FilterParameters, angle_rad: float) -> float:
    """LED through a trapezoid of edges scaled by the blue shift, constant quantum efficiency; per joule."""
    shift = np.sqrt(1.0 - (np.sin(angle_rad) / filter_.effective_index) ** 2)
    sigma = LEDS.wavelength_fwhm_m / np.sqrt(8.0 * np.log(2.0))
    total = 0.0
    edges = ((filter_.cut_on_m, filter_.cut_on_ramp_m, 1.0), (filter_.cut_off_m, filter_.cut_off_ramp_m, -1.0))
    for centre, ramp, sign in edges:
        low, high = shift * (centre - 0.5 * ramp), shift * (centre + 0.5 * ramp)
        rise = _mean_over_gaussian(low, 850e-9, sigma) - _mean_over_gaussian(high, 850e-9, sigma)
        total += sign * rise / (high - low)
    return LENS.transmittance * filter_.transmittance * 0.3 * total / (constants.h * constants.c)


@pytest.mark.parametrize("angle_deg", [0.0, 5.0, 10.0, 15.0, 20.0, 22.0])
@pytest.mark.parametrize("filter_", [LONG_PASS, BAND_PASS], ids=["long_pass", "band_pass"])
def test_led_light_through_a_tilted_filter_is_the_closed_form(filter_: FilterParameters, angle_deg: float) -> None:
    angle = np.radians(angle_deg)
    ours = float(led_detection(LENS, filter_, FLAT, LEDS, np.cos(angle)))
    assert ours == pytest.approx(_closed_form(filter_, angle), rel=5e-5)


def test_an_led_at_the_edge_of_the_field_is_dimmed_by_the_tilted_band_pass() -> None:
    flat = responses(LENS, BAND_PASS, FLAT, LEDS, LIGHT, Camera())
    angle = np.arctan2(0.5 * 2048, Camera().focal_length_px)
    tilted = _closed_form(BAND_PASS, angle) / _closed_form(BAND_PASS, 0.0)
    assert tilted == pytest.approx(0.69, abs=0.01)
    assert _at_angle(angle, flat) / _at_angle(0.0, flat) == pytest.approx(np.cos(angle) * tilted, rel=1e-4)


def test_on_the_axis_the_lens_transmits_what_the_tables_last_node_says() -> None:
    """And nothing beyond it is read: what lies there in memory is no number."""
    last = np.array([0.0, 0.25, 0.75, np.nan])[:3]
    assert _led(np.array([8.0, 0.0, 0.0]), replace(RESPONSE, led_transmission=last)) == 0.75 * _on_axis(8.0)


def test_absorbing_glass_does_not_mind_the_angle() -> None:
    assert np.allclose(RESPONSE.led_transmission, 1.0, rtol=0.0, atol=1e-9)


def test_an_interference_edge_moves_by_one_to_two_percent_at_20_degrees() -> None:
    wavelength = np.arange(780e-9, 840e-9, 0.01e-9)
    tilted = filter_transmittance(BAND_PASS, wavelength, np.cos(np.radians(20.0))) / BAND_PASS.transmittance
    edge = np.interp(0.5, tilted, wavelength)
    assert edge / 840e-9 - 1.0 == pytest.approx(np.sqrt(1.0 - (np.sin(np.radians(20.0)) / 2.0) ** 2) - 1.0, abs=1e-6)
    assert 0.01 < 1.0 - edge / 840e-9 < 0.02


def test_the_long_pass_filter_halves_at_its_cut_on_and_blocks_below() -> None:
    below, half, above = detection(LENS, LONG_PASS, SENSOR, np.array([784e-9, 800e-9, 816e-9]))
    no_filter = detection(LENS, replace(LONG_PASS, cut_on_m=700e-9), SENSOR, np.array([800e-9]))[0]
    assert below == 0.0
    assert half == pytest.approx(0.5 * no_filter, rel=1e-9)
    assert above > half


def test_the_band_pass_cuts_both_sides() -> None:
    outside = filter_transmittance(BAND_PASS, np.array([837e-9, 863e-9]))
    edges = filter_transmittance(BAND_PASS, np.array([840e-9, 860e-9]))
    assert np.array_equal(outside, [0.0, 0.0])
    assert edges == pytest.approx(0.5 * BAND_PASS.transmittance, rel=1e-9)


def test_a_filter_that_blocks_the_leds_line_leaves_the_led_dark_and_the_sun_as_bright_as_what_is_left() -> None:
    blocked = responses(LENS, replace(LONG_PASS, cut_on_m=1000e-9), SENSOR, LEDS, LIGHT, Camera())
    assert _led(np.array([8.0, 0.5, 0.2]), blocked) == 0.0
    assert 0.0 < blocked.white_e_s < 0.1 * RESPONSE.white_e_s


def test_the_band_pass_costs_45_percent_of_led_light_and_86_percent_of_the_suns() -> None:
    assert NARROW.led_e_m2_sr_w_s / RESPONSE.led_e_m2_sr_w_s == pytest.approx(0.546, abs=0.002)
    assert NARROW.white_e_s / RESPONSE.white_e_s == pytest.approx(0.137, abs=0.001)


def test_beyond_its_last_tabulated_wavelength_the_sensor_sees_nothing() -> None:
    cut = replace(SENSOR, wavelength_m=SENSOR.wavelength_m[:4], quantum_efficiency=SENSOR.quantum_efficiency[:4])
    inside, outside = detection(LENS, LONG_PASS, cut, np.array([900e-9, 901e-9]))
    assert inside > 0.0 and outside == 0.0


# --- sunlight


@pytest.mark.parametrize(
    ("low_nm", "high_nm", "expected_w_m2"),
    [(800, 1000, (183.83, 150.84, 140.63)), (840, 860, (19.92, 19.52, 18.11)), (800, 1050, (218.75, 185.55, 173.33))],
)
def test_the_data_hold_the_standards_irradiance(
    low_nm: float, high_nm: float, expected_w_m2: tuple[float, ...]
) -> None:
    table = solar_spectrum()
    columns = (table.extraterrestrial_w_m3, table.global_tilt_w_m3, table.direct_w_m3)
    assert [_irradiance(low_nm, high_nm, c) for c in columns] == pytest.approx(expected_w_m2, abs=0.006)


def test_the_table_that_all_share_cannot_be_written_to() -> None:
    table = solar_spectrum()
    for column in (table.wavelength_m, table.extraterrestrial_w_m3, table.global_tilt_w_m3, table.direct_w_m3):
        with pytest.raises(ValueError, match="read-only"):
            column[0] = 0.0


def test_the_suns_electrons_are_those_of_a_sum_over_the_tables_rows() -> None:
    table = solar_spectrum()
    nm = 1e9 * table.wavelength_m
    passed = np.clip((nm - 785.0) / 30.0, 0.0, 1.0) * np.interp(
        nm, 1e9 * SENSOR.wavelength_m, SENSOR.quantum_efficiency, right=0.0
    )
    photons = table.extraterrestrial_w_m3 * 1e-9 / (1.98644586e-16 / nm)  # h c = 1.98644586e-16 J nm
    rows = (nm >= 700.0) & (nm <= 1150.0)
    by_rows = 0.9 * 0.94 * float((photons * passed)[rows].sum())
    ours = sun_detection(LENS, LONG_PASS, SENSOR, table.extraterrestrial_w_m3)
    assert ours == pytest.approx(by_rows, rel=1e-3)


def test_direct_sunlight_is_the_standards_at_the_ground_and_outside_the_air() -> None:
    table = solar_spectrum()
    assert np.allclose(direct_beam_w_m3(LIGHT, 0.0, 1.5), table.direct_w_m3, rtol=1e-12)
    assert np.array_equal(direct_beam_w_m3(LIGHT, np.inf, 1.5), table.extraterrestrial_w_m3)


def test_along_one_path_transmittances_multiply() -> None:
    """Beer and Lambert: twice the air mass squares the transmittance, at every wavelength."""
    outside = solar_spectrum().extraterrestrial_w_m3
    one, two = (direct_beam_w_m3(LIGHT, 6000.0, m) / outside for m in (1.5, 3.0))
    assert np.allclose(two, one**2, rtol=1e-12)


def test_between_water_and_aerosol_the_clear_air_of_6_km_takes_rayleighs_share() -> None:
    """865 nm, overhead Sun: molecules 0.0153 at the ground; the low haze leaves a twentieth of its 0.04."""
    nm = np.round(1e9 * solar_spectrum().wavelength_m)
    taken = -np.log(direct_beam_w_m3(LIGHT, 6000.0, 1.0) / solar_spectrum().extraterrestrial_w_m3)[nm == 865.0][0]
    assert taken == pytest.approx(0.0155 * np.exp(-6.0 / 8.0) + 0.04 * np.exp(-3.0), abs=0.001)


@pytest.mark.parametrize("nm", [400.0, 550.0, 850.0, 1000.0])
def test_the_gas_scatters_as_much_as_its_molecules_by_rayleighs_cross_section(nm: float) -> None:
    """24 pi^3 F/(l^4 N^2) ((n^2 - 1)/(n^2 + 2))^2 a molecule, p/(m g) of them over the sea: within 1 %.

    n is Peck & Reeder's at 15 degC, F the King factor of a depolarisation of 0.0279. 100 m up low haze of 1 m is gone.
    """
    um, per_m3 = 1e-3 * nm, 2.54743e25
    n = 1.0 + 1e-8 * (8060.51 + 2480990.0 / (132.274 - um**-2) + 17455.7 / (39.32957 - um**-2))
    king = (6.0 + 3.0 * 0.0279) / (6.0 - 7.0 * 0.0279)
    of_one_m2 = 24.0 * np.pi**3 * king / ((1e-6 * um) ** 4 * per_m3**2) * ((n**2 - 1.0) / (n**2 + 2.0)) ** 2
    over_sea = of_one_m2 * 101325.0 * constants.N_A / (0.0289644 * constants.g)
    outside = solar_spectrum().extraterrestrial_w_m3
    seen = direct_beam_w_m3(replace(LIGHT, haze_scale_height_m=1.0), 100.0, 1.0) / outside
    row = np.argmin(np.abs(1e9 * solar_spectrum().wavelength_m - nm))
    assert -np.log(seen[row]) == pytest.approx(over_sea * np.exp(-100.0 / 8000.0), rel=0.01)


def test_at_refuelling_altitude_the_sun_has_94_to_99_percent_of_its_light() -> None:
    outside = sun_detection(LENS, LONG_PASS, SENSOR, solar_spectrum().extraterrestrial_w_m3)
    at_6_km, at_9_km = (
        sun_detection(LENS, LONG_PASS, SENSOR, direct_beam_w_m3(LIGHT, h, 1.5)) / outside for h in (6000.0, 9000.0)
    )
    assert 0.94 < at_6_km < at_9_km < 0.995
    flight = responses(
        LENS, LONG_PASS, SENSOR, LEDS, LIGHT, Camera(), altitude_m=6000.0, sun_elevation_rad=np.radians(41.75)
    )
    assert flight.white_e_s / RESPONSE.white_e_s == pytest.approx(at_6_km, rel=1e-4)
    assert flight.led_e_m2_sr_w_s == RESPONSE.led_e_m2_sr_w_s


@pytest.mark.parametrize(
    ("sun_W", "air_mass"), [(None, 0.9997), ((0.6, -0.5, math.sqrt(0.39)), 1.6), ((0.8, 0.6, 0.0), 37.92)]
)
def test_in_flight_sunlight_comes_down_to_the_altitude_along_the_suns_elevation(
    sun_W: tuple[float, float, float] | None, air_mass: float
) -> None:
    """None is overhead. The Sun's light alone changes; 1/0.6245 is the plane layers' air mass."""
    sheets, direction = CameraSheets.load(), None if sun_W is None else np.array(sun_W)
    flight = responses_in_flight(sheets, Camera(), 6000.0, direction)
    beam = direct_beam_w_m3(LIGHT, 6000.0, air_mass)
    outside = sun_detection(LENS, LONG_PASS, SENSOR, solar_spectrum().extraterrestrial_w_m3)
    share = sun_detection(LENS, LONG_PASS, SENSOR, beam) / outside
    for light in ("white_e_s", "sun_disc_e_s", "sun_flux_e_s", "glint_e_m2_s"):
        assert getattr(flight, light) / getattr(RESPONSE, light) == pytest.approx(share, rel=1e-3)
    assert flight.led_e_m2_sr_w_s == RESPONSE.led_e_m2_sr_w_s


@pytest.mark.parametrize(("elevation_deg", "published"), [(90.0, 0.9997), (30.0, 1.9943), (10.0, 5.5860), (0.0, 37.92)])
def test_air_mass_is_kasten_and_youngs(elevation_deg: float, published: float) -> None:
    assert relative_air_mass(np.radians(elevation_deg)) == pytest.approx(published, rel=1e-3)


def test_below_the_horizon_the_path_is_that_of_the_horizon() -> None:
    assert relative_air_mass(-0.2) == relative_air_mass(0.0)
