"""Parameter sheets of the camera: one frozen dataclass a file of `assets/parameters`, same keys, units there."""

from dataclasses import dataclass

from dockair.rotations import Array


@dataclass(frozen=True, slots=True, kw_only=True)
class LensParameters:
    """Sheet `lens`."""

    f_number: float
    focus_distance_m: float
    near_infrared_focus_shift_m: float
    transmittance: float


@dataclass(frozen=True, slots=True, kw_only=True)
class FilterParameters:
    """Sheets `filter_long_pass` and `filter_band_pass`."""

    cut_on_m: float
    cut_on_ramp_m: float
    cut_off_m: float
    cut_off_ramp_m: float
    transmittance: float
    effective_index: float


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class SensorParameters:
    """Sheet `sensor`."""

    wavelength_m: Array  #: (n,) nodes of the next
    quantum_efficiency: Array  #: (n,)
    diffusion_px: float
    full_well_e: float
    read_noise_e: float
    dark_current_e_s: float
    dark_reference_c: float
    dark_doubling_k: float
    temperature_c: float
    photo_response_nonuniformity: float
    dark_signal_nonuniformity_e: float
    column_pattern_e: float
    parasitic_light_sensitivity: float
    conversion_gain_dn_e: float
    black_level_dn: float
    converter_bits: int
    clock_hz: float
    outputs: int
    row_clocks: float
    overhead_setting: float
    transfer_s: float
    transfer_jitter_s: float


@dataclass(frozen=True, slots=True, kw_only=True)
class ExposureParameters:
    """Sheet `exposure`."""

    exposure_s: float
    shortest_s: float
    longest_s: float


@dataclass(frozen=True, slots=True, kw_only=True)
class LedParameters:
    """Sheet `leds`."""

    rated_intensity_w_sr: float
    rated_current_a: float
    drive_current_a: float
    junction_temperature_c: float
    intensity_per_k: float
    wavelength_per_k: float
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


@dataclass(frozen=True, slots=True, kw_only=True)
class GlareParameters:
    """Sheet `glare`."""

    veiling_glare: float
    veiling_decay_rad: float


@dataclass(frozen=True, slots=True, kw_only=True)
class SurfaceParameters:
    """Sheet `surfaces`."""

    specular_reflectance: float
    grazing_rad: float


@dataclass(frozen=True, slots=True, kw_only=True)
class SkyParameters:
    """Sheet `sky`."""

    zenith: float
    horizon: float


@dataclass(frozen=True, slots=True, kw_only=True)
class BackgroundParameters:
    """Sheet `background`."""

    reduction: int
