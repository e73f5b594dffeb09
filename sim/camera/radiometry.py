"""Electrons from sources: LED, sunlit surface, Sun and glint, through one lens, filter and sensor.

A source of spectrum s (W per metre of wavelength) makes, per joule that enters the lens,

    S = Int s(l) T(l) eta(l) l/(h c) dl                            electrons (per J, or per m^2 s for irradiance)  (1)
    T = transmittance x long-pass ramp,  eta = quantum efficiency x fill factor

Point source of intensity I in W/sr at slant range r, angle t off the lens's axis, a = pi (f/2N)^2 its aperture:

    e = S I a cos t / r^2  t_exp             (whole blob)                                                        (2)
    I = I_0 cos^m psi                        (LED, psi off the LED's axis)                                       (3)
    I = E R r1 r2 / 4                        (glint: Sun's irradiance E on a mirror-like convex surface with
                                              principal radii r1, r2 and reflectance R; any angle of incidence)  (4)

Extended source of radiance L, per pixel of side p:

    e = S L (pi / 4 N^2) p^2 cos^4 t  t_exp,    L = rho E/pi (Lambertian),  L = E/Omega_sun (Sun's disc)         (5)

Not modelled: LED temperature, absorption in air (0.5 % in 50 m), change of the filter's edge with incidence.
Eq. (4) holds for r1, r2 much smaller than the range.
Sources: EMVA 1288 release 3.1 section 2; (4) is the geometric-optics cross section pi r1 r2 of a convex body spread
over 4 pi, as in Knott, Shaeffer & Tuley, Radar Cross Section, ch. 5.
"""

from dataclasses import dataclass

import numpy as np
from scipy import constants

from dockair.calibration import Camera
from dockair.rotations import Array

_BAND_STEP_M = 0.5e-9  # of the integral (1); all tables are linear over 25 nm or more


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class CameraParameters:
    """Sheet `camera`: lens, filter, sensor, read-out. Units and sources are there."""

    f_number: float
    focus_distance_m: float
    transmittance: float
    filter_cut_on_m: float
    filter_ramp_m: float
    wavelength_m: Array  #: (n,) nodes of the next
    quantum_efficiency: Array  #: (n,)
    diffusion_px: float
    exposure_s: float
    full_well_e: float
    read_noise_e: float
    conversion_gain_dn_e: float
    black_level_dn: float
    converter_bits: int
    clock_hz: float
    outputs: int
    row_clocks: float
    overhead_setting: float
    transfer_s: float
    veiling_glare: float
    veiling_decay_rad: float
    background_reduction: int


@dataclass(frozen=True, slots=True, kw_only=True)
class LedParameters:
    """Sheet `leds`."""

    intensity_w_sr: float
    bin_ratio: float
    pattern_exponent: float
    wavelength_m: float
    wavelength_fwhm_m: float
    die_size_m: float
    occlusion_clearance_m: float


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class LightParameters:
    """Sheet `light`."""

    wavelength_m: Array  #: (n,) nodes of the next
    sun_irradiance_w_m3: Array  #: (n,)
    air_transmittance: float
    sun_angular_radius_rad: float
    glint_reflectance: float
    glint_grazing_rad: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Responses:
    """What one exposure makes of each kind of source; the constant factors of Eqs. (2) to (5)."""

    led_e_m2_sr_w: float  #: electrons of a blob = this x I cos t / r^2
    white_e: float  #: electrons per pixel, on axis, of a white Lambertian surface in normal sunlight
    sun_disc_e: float  #: electrons per pixel, on axis, of the Sun's disc
    sun_flux_e: float  #: electrons of all sunlight that enters the lens, Sun on axis
    glint_e: float  #: electrons of a blob = this x (r1 r2 / 4) cos t / r^2


def detection(parameters: CameraParameters, wavelength_m: Array) -> Array:
    """(n,) electrons per joule of light at wavelengths (n,) [m] that enters the lens: T eta l/(h c) of Eq. (1)."""
    start = parameters.filter_cut_on_m - 0.5 * parameters.filter_ramp_m
    passed = np.clip((wavelength_m - start) / parameters.filter_ramp_m, 0.0, 1.0)
    eta = np.interp(wavelength_m, parameters.wavelength_m, parameters.quantum_efficiency)
    return parameters.transmittance * passed * eta * wavelength_m / (constants.h * constants.c)


def led_detection(parameters: CameraParameters, leds: LedParameters) -> float:
    """Electrons per joule of LED light, Eq. (1), for a Gaussian spectrum of the LED's width."""
    wavelength = _band(parameters)
    sigma = leds.wavelength_fwhm_m / (2.0 * np.sqrt(2.0 * np.log(2.0)))
    spectrum = np.exp(-0.5 * ((wavelength - leds.wavelength_m) / sigma) ** 2) / (sigma * np.sqrt(2.0 * np.pi))
    return float(np.trapezoid(spectrum * detection(parameters, wavelength), wavelength))


def sun_detection(parameters: CameraParameters, light: LightParameters) -> float:
    """Electrons per second and square metre of lens facing the Sun, Eq. (1)."""
    wavelength = _band(parameters)
    irradiance = np.interp(wavelength, light.wavelength_m, light.sun_irradiance_w_m3, right=0.0)
    return light.air_transmittance * float(np.trapezoid(irradiance * detection(parameters, wavelength), wavelength))


def responses(parameters: CameraParameters, leds: LedParameters, light: LightParameters, camera: Camera) -> Responses:
    """Return the constant factors of Eqs. (2) to (5) for one camera and one exposure."""
    aperture = np.pi * (camera.focal_length_m / (2.0 * parameters.f_number)) ** 2
    pixel = np.pi / (4.0 * parameters.f_number**2) * camera.pixel_pitch_m**2 * parameters.exposure_s
    sun = sun_detection(parameters, light)
    disc = np.pi * light.sun_angular_radius_rad**2
    return Responses(
        led_e_m2_sr_w=led_detection(parameters, leds) * aperture * parameters.exposure_s,
        white_e=sun / np.pi * pixel,
        sun_disc_e=sun / disc * pixel,
        sun_flux_e=sun * aperture * parameters.exposure_s,
        glint_e=light.glint_reflectance * sun * aperture * parameters.exposure_s,
    )


def led_electrons(response: Responses, leds: LedParameters, intensity_w_sr: Array, p_CL: Array, axis_C: Array) -> Array:
    """(n,) electrons of each LED's whole blob, Eqs. (2) and (3); 0 for one that shines away from the camera.

    Args:
        response: of `responses`.
        leds: the pattern's exponent.
        intensity_w_sr: (n,) intensity of each on its axis.
        p_CL: (n, 3) LEDs from the lens, camera axes [m].
        axis_C: (3,) unit vector along which they shine, camera axes.
    """
    r = np.linalg.norm(p_CL, axis=1)
    cos_psi = np.clip(-(p_CL @ axis_C) / r, 0.0, 1.0)
    cos_t = np.clip(p_CL[:, 0] / r, 0.0, 1.0)
    return np.asarray(response.led_e_m2_sr_w * intensity_w_sr * cos_psi**leds.pattern_exponent * cos_t / r**2)


def _band(parameters: CameraParameters) -> Array:
    start = parameters.filter_cut_on_m - 0.5 * parameters.filter_ramp_m
    return np.arange(start, parameters.wavelength_m[-1] + 0.5 * _BAND_STEP_M, _BAND_STEP_M)
