"""Electrons per second from sources: LED, sunlit surface, Sun and glint, through one lens, filter and sensor.

A source of spectrum s (W per metre of wavelength) makes, per joule that enters the lens,

    S = Int s(l) T(l) eta(l) l/(h c) dl                            electrons (per J, or per m^2 s for irradiance)  (1)
    T = lens x filter,  eta = quantum efficiency x fill factor
    filter(l) = t x ramp up at the cut-on x ramp down at the cut-off
    filter(l; theta) = filter(l / sqrt(1 - (sin theta / n)^2))     incidence theta, effective index n              (2)

Point source of intensity I in W/sr at slant range r, angle t off the lens's axis, a = pi (f/2N)^2 its aperture:

    e = S I a cos t / r^2 x exp(-beta r)    (whole blob, per second)                                               (3)
    I = I_0 cos^m psi                       (LED, psi off the LED's axis; S at incidence t)                        (4)
    I_0 = I_rated (i/i_rated) exp(k (T_j - T_ref)),   centroid l = l_ref + q (T_j - T_ref)                         (5)
    I = E A                                 (glint: Sun's irradiance E, A in m^2/sr from its surface's shape)      (6)
    beta = ln(1/0.02)/V                     (haze of visibility V, Koschmieder: contrast 2 %)                      (7)

Extended source of radiance L, per pixel of side p:

    e = S L (pi / 4 N^2) p^2 cos^4 t,       L = rho E/pi (Lambertian),  L = E/Omega_sun (Sun's disc)               (8)

Direct sunlight at altitude h and air mass m, from the standard's columns E_0 (outside the air) and E_1.5 (sea level):

    E = E_0 exp(-(m/1.5) (tau_R exp(-h/H_gas) + (ln(E_0/E_1.5) - tau_R) exp(-h/H_low))),  tau_R at air mass 1.5    (9)

Not modelled: the filter's shift in (6) and (8): a Sun or a cloud in the field's corner would gain 11 % through the
band-pass and nothing through absorbing glass. The LED's loss of efficiency far below its rated current, and its heating
by it; (5) is linear within 2 % from 1 to 1.5 A. Haze's colour: (7) is right for fog and twice too strong at 850 nm in
clear air, where it takes 0.9 % in 50 m. Saturation of water vapour's lines in (9): at 6 km 0 to 2.5 % of the Sun's
electrons too many through the long-pass, 0.1 % through the band-pass.
Sources: EMVA 1288 release 3.1 section 2; W. J. Smith, Modern Optical Engineering, ch. "Optical coatings" for (2);
OSRAM SFH 4715AS for (5); ASTM G173-03 and Hansen & Travis 1974 eq. 2.30 (tau_R) for (9); Kasten & Young 1989.
"""

import math
from dataclasses import dataclass
from functools import cache
from importlib.resources import files

import numpy as np
from scipy import constants

from dockair.calibration import Camera
from dockair.errors import DockairError
from dockair.kernels import njit
from dockair.rotations import Array
from dockair.sim.camera.sheets import (
    CameraSheets,
    FilterParameters,
    LedParameters,
    LensParameters,
    LightParameters,
    SensorParameters,
)

_BAND_STEP_M = 0.1e-9  # of the integral (1), whose steepest factor is a filter's edge of some nanometres
_LED_SIGMAS = 6.0  # half width of the LED's integral
_COSINES = 1025  # nodes of the LED's response over the cosine of incidence; linear between, within 1e-4
_CONTRAST = 0.02  # of (7)
_TABLE_AIR_MASS = 1.5  # of the ASTM table


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class SolarSpectrum:
    """ASTM G173-03 as tabulated."""

    wavelength_m: Array  #: (n,)
    extraterrestrial_w_m3: Array  #: (n,) irradiance per metre of wavelength, outside the air
    global_tilt_w_m3: Array  #: (n,) on a surface tilted by 37 degrees, at air mass 1.5
    direct_w_m3: Array  #: (n,) normal to the beam, at air mass 1.5


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Responses:
    """What one second makes of each kind of source; the constant factors of Eqs. (3) to (8)."""

    led_e_m2_sr_w_s: float  #: electrons of a blob = this x I cos t / r^2, on axis
    led_transmission: Array  #: (n,) S at incidence over S on axis, at evenly spaced cosines from 0 to 1
    white_e_s: float  #: electrons per pixel, on axis, of a white Lambertian surface in normal sunlight
    sun_disc_e_s: float  #: electrons per pixel, on axis, of the Sun's disc
    sun_flux_e_s: float  #: electrons of all sunlight that enters the lens, Sun on axis
    glint_e_m2_s: float  #: electrons of a blob = this x A cos t / r^2, A [m^2/sr]


@cache
def solar_spectrum() -> SolarSpectrum:
    """Read the table."""
    path = files("dockair.assets").joinpath("reference", "astm_g173.csv")
    with path.open(encoding="utf-8") as lines:
        rows = np.loadtxt((line for line in lines if line[0].isdigit()), delimiter=",")
    rows *= 1e-9, 1e9, 1e9, 1e9
    rows.setflags(write=False)
    wavelength, extraterrestrial, global_tilt, direct = rows.T
    return SolarSpectrum(
        wavelength_m=wavelength,
        extraterrestrial_w_m3=extraterrestrial,
        global_tilt_w_m3=global_tilt,
        direct_w_m3=direct,
    )


def direct_beam_w_m3(light: LightParameters, altitude_m: float, air_mass: float) -> Array:
    """(n,) sunlight normal to its beam, Eq. (9), at `solar_spectrum`'s wavelengths; altitude inf is outside the air."""
    table = solar_spectrum()
    um = 1e6 * table.wavelength_m
    rayleigh = _TABLE_AIR_MASS * 0.008569 * um**-4 * (1.0 + 0.0113 * um**-2 + 0.00013 * um**-4)
    low = np.log(table.extraterrestrial_w_m3 / table.direct_w_m3) - rayleigh
    thickness = rayleigh * np.exp(-altitude_m / light.gas_scale_height_m)
    thickness += low * np.exp(-altitude_m / light.haze_scale_height_m)
    return np.asarray(table.extraterrestrial_w_m3 * np.exp(-air_mass / _TABLE_AIR_MASS * thickness))


def relative_air_mass(elevation_rad: float) -> float:
    """Path through the air over that of an overhead Sun, Kasten & Young; below the horizon as on it (38)."""
    degrees = np.degrees(max(elevation_rad, 0.0))
    return float(1.0 / (np.sin(np.radians(degrees)) + 0.50572 * (degrees + 6.07995) ** -1.6364))


def extinction_1_m(visibility_m: float) -> float:
    """Extinction coefficient [1/m] of haze or fog, Eq. (7); visibility inf is no haze.

    Raises:
        DockairError: the visibility is not a number > 0.
    """
    if not visibility_m > 0.0:
        raise DockairError("visibility_m", expected="a number > 0", got=visibility_m)
    return float(np.log(1.0 / _CONTRAST) / visibility_m)


def led_intensity_w_sr(leds: LedParameters) -> float:
    """Nominal intensity on the LED's axis at its drive current and junction temperature, Eq. (5)."""
    warmer = leds.junction_temperature_c - leds.reference_temperature_c
    rated = leds.rated_intensity_w_sr * leds.drive_current_a / leds.rated_current_a
    return float(rated * np.exp(leds.intensity_per_k * warmer))


def led_wavelength_m(leds: LedParameters) -> float:
    """Centroid wavelength at the junction's temperature, Eq. (5)."""
    return leds.wavelength_m + leds.wavelength_per_k * (leds.junction_temperature_c - leds.reference_temperature_c)


def led_spectrum_1_m(leds: LedParameters, wavelength_m: Array) -> Array:
    """(n,) share of the LED's light per metre of wavelength: Gaussian of its full width at half maximum."""
    sigma = leds.wavelength_fwhm_m / (2.0 * np.sqrt(2.0 * np.log(2.0)))
    z = (wavelength_m - led_wavelength_m(leds)) / sigma
    return np.asarray(np.exp(-0.5 * z**2) / (sigma * np.sqrt(2.0 * np.pi)))


def filter_transmittance(filter_: FilterParameters, wavelength_m: Array, cosine: Array | float = 1.0) -> Array:
    """Transmittance at wavelengths [m] and cosines of incidence, Eq. (2); the two broadcast."""
    at_normal = wavelength_m / np.sqrt(1.0 - (1.0 - np.square(cosine)) / filter_.effective_index**2)
    up = (at_normal - filter_.cut_on_m) / filter_.cut_on_ramp_m + 0.5
    down = (filter_.cut_off_m - at_normal) / filter_.cut_off_ramp_m + 0.5
    return np.asarray(filter_.transmittance * np.clip(up, 0.0, 1.0) * np.clip(down, 0.0, 1.0))


def detection(
    lens: LensParameters,
    filter_: FilterParameters,
    sensor: SensorParameters,
    wavelength_m: Array,
    cosine: Array | float = 1.0,
) -> Array:
    """Electrons per joule of light of wavelengths [m] that enters the lens: T eta l/(h c) of Eq. (1)."""
    eta = np.interp(wavelength_m, sensor.wavelength_m, sensor.quantum_efficiency, right=0.0)
    passed = filter_transmittance(filter_, wavelength_m, cosine)
    return np.asarray(lens.transmittance * passed * eta * wavelength_m / (constants.h * constants.c))


def led_detection(
    lens: LensParameters,
    filter_: FilterParameters,
    sensor: SensorParameters,
    leds: LedParameters,
    cosine: Array | float = 1.0,
) -> Array:
    """Electrons per joule of LED light, Eq. (1), at the cosines of incidence given."""
    half = _LED_SIGMAS * leds.wavelength_fwhm_m / (2.0 * np.sqrt(2.0 * np.log(2.0)))
    wavelength = led_wavelength_m(leds) + np.arange(-half, half, _BAND_STEP_M)
    passed = detection(lens, filter_, sensor, wavelength, np.asarray(cosine)[..., None])
    return np.asarray(np.trapezoid(led_spectrum_1_m(leds, wavelength) * passed, wavelength, axis=-1))


def sun_detection(
    lens: LensParameters, filter_: FilterParameters, sensor: SensorParameters, beam_w_m3: Array, cosine: float = 1.0
) -> float:
    """Electrons per second and square metre of lens facing the Sun, Eq. (1), for a beam of `direct_beam_w_m3`."""
    table = solar_spectrum().wavelength_m
    wavelength = np.arange(table[0], sensor.wavelength_m[-1], _BAND_STEP_M)
    irradiance = np.interp(wavelength, table, beam_w_m3)
    return float(np.trapezoid(irradiance * detection(lens, filter_, sensor, wavelength, cosine), wavelength))


def responses(
    lens: LensParameters,
    filter_: FilterParameters,
    sensor: SensorParameters,
    leds: LedParameters,
    light: LightParameters,
    camera: Camera,
    *,
    altitude_m: float = np.inf,
    sun_elevation_rad: float = np.pi / 2.0,
) -> Responses:
    """Return the constant factors of Eqs. (3) to (8) for one camera, in sunlight as at an altitude (inf: no air)."""
    aperture = np.pi * (camera.focal_length_m / (2.0 * lens.f_number)) ** 2
    pixel = np.pi / (4.0 * lens.f_number**2) * camera.pixel_pitch_m**2
    sun = sun_detection(
        lens, filter_, sensor, direct_beam_w_m3(light, altitude_m, relative_air_mass(sun_elevation_rad))
    )
    disc = np.pi * light.sun_angular_radius_rad**2
    led = led_detection(lens, filter_, sensor, leds, np.linspace(0.0, 1.0, _COSINES))
    transmission = led / led[-1] if led[-1] > 0.0 else np.zeros_like(led)
    transmission.setflags(write=False)
    return Responses(
        led_e_m2_sr_w_s=float(led[-1]) * aperture,
        led_transmission=transmission,
        white_e_s=sun / np.pi * pixel,
        sun_disc_e_s=sun / disc * pixel,
        sun_flux_e_s=sun * aperture,
        glint_e_m2_s=sun * aperture,
    )


def responses_in_flight(
    sheets: CameraSheets, camera: Camera, altitude_m: float, sun_direction_W: Array | None
) -> Responses:
    """Return the constant factors of Eqs. (3) to (8) in the sunlight of a flight.

    Args:
        sheets: of the camera and the light.
        camera: as built, or nominal.
        altitude_m: of the flight.
        sun_direction_W: (3,) unit vector toward the Sun; None is overhead.
    """
    return responses(
        sheets.lens,
        sheets.filter,
        sheets.sensor,
        sheets.leds,
        sheets.light,
        camera,
        altitude_m=altitude_m,
        sun_elevation_rad=np.pi / 2.0 if sun_direction_W is None else float(np.arcsin(sun_direction_W[2])),
    )


def led_electrons(
    response: Responses,
    leds: LedParameters,
    intensity_w_sr: Array,
    p_CL: Array,
    axis_C: Array,
    exposure_s: float,
    extinction_1_m: float = 0.0,
) -> Array:
    """(n,) electrons of each LED's whole blob, Eqs. (3) and (4); 0 for one that shines away or is behind the camera.

    Args:
        response: of `responses`.
        leds: the pattern's exponent.
        intensity_w_sr: (n,) intensity of each on its axis.
        p_CL: (n, 3) LEDs from the lens, camera axes [m].
        axis_C: (3,) unit vector along which they shine, camera axes.
        exposure_s: exposure.
        extinction_1_m: of the air between, from the function of that name.
    """
    out = np.empty(len(p_CL))
    lens = response.led_e_m2_sr_w_s * exposure_s, response.led_transmission, extinction_1_m
    _receive(p_CL, np.asarray(intensity_w_sr, dtype=float), np.asarray(axis_C), leds.pattern_exponent, lens, out)
    return out


@njit(cache=True, error_model="numpy")
def _receive(
    p_CL: Array, intensity_w_sr: Array, axis_C: Array, exponent: float, lens: tuple[float, Array, float], out: Array
) -> None:
    """Fill (n,) electrons; `lens` is electrons per m^2 W/sr on the axis, its transmission by cosine, the extinction."""
    on_axis, transmission, extinction = lens
    last = len(transmission) - 1
    for i in range(len(p_CL)):
        x, y, z = p_CL[i]
        r = math.sqrt(x * x + y * y + z * z)
        cos_psi = min(max(-(x * axis_C[0] + y * axis_C[1] + z * axis_C[2]) / r, 0.0), 1.0)
        cos_t = min(max(x / r, 0.0), 1.0)
        k = min(int(cos_t * last), last - 1)
        seen = transmission[k] + (cos_t * last - k) * (transmission[k + 1] - transmission[k])
        watts = intensity_w_sr[i] * cos_psi**exponent * cos_t * math.exp(-extinction * r) / r**2
        out[i] = on_axis * seen * watts
