"""Parameter sheets of the camera: one frozen dataclass a file of `assets/parameters`, same keys, units there."""

import math
from collections.abc import Mapping
from dataclasses import dataclass, fields
from typing import Any

import numpy as np

from dockair.errors import DockairError
from dockair.parameters import load_parameters
from dockair.rotations import Array

OUTPUTS_OF_BITS = {10: (2, 4, 8, 16), 12: (2, 4)}  #: CMV2000: the LVDS outputs that can read so many bits a pixel
OUTPUT_BIT_RATE_HZ = 480e6  #: CMV2000: the most that an output sends, 10 bits at 48 MHz or 12 at 40 MHz
_ANGLES = 181  # from the Sun, at which the sky's light must not be negative


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

    def __post_init__(self) -> None:
        """Refuse a band that ends before it begins, and one whose ramps meet below the sheet's transmittance."""
        if not self.cut_on_m < self.cut_off_m:
            expected = f"less than filter.cut_off_m = {self.cut_off_m} m"
            raise DockairError("filter.cut_on_m", expected=expected, got=self.cut_on_m)
        half_ramps_m = 0.5 * (self.cut_on_ramp_m + self.cut_off_ramp_m)
        if self.cut_off_m - self.cut_on_m < half_ramps_m:
            expected = (
                f"at least {self.cut_on_m + half_ramps_m:g} m, where filter.transmittance is reached between ramps"
            )
            raise DockairError("filter.cut_off_m", expected=expected, got=self.cut_off_m)


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

    def __post_init__(self) -> None:
        """Refuse what the sensor cannot do, however the values came together."""
        allowed = OUTPUTS_OF_BITS.get(self.converter_bits)
        if allowed is None:
            where, exist = "sensor.converter_bits", [str(bits) for bits in OUTPUTS_OF_BITS]
            raise DockairError(where, expected="a converter's depth", got=self.converter_bits, exists=exist)
        if self.outputs not in allowed:
            expected = f"a number of outputs that reads {self.converter_bits} bits"
            raise DockairError("sensor.outputs", expected=expected, got=self.outputs, exists=[str(n) for n in allowed])
        fastest_hz = OUTPUT_BIT_RATE_HZ / self.converter_bits
        if self.clock_hz > fastest_hz:
            expected = f"up to {fastest_hz:g} Hz, as fast as an output sends {self.converter_bits} bits"
            raise DockairError("sensor.clock_hz", expected=expected, got=self.clock_hz)
        nodes = np.asarray(self.wavelength_m)
        if nodes.shape != np.shape(self.quantum_efficiency) or not np.all(np.diff(nodes) > 0.0):
            expected = "rising wavelengths, one for each sensor.quantum_efficiency"
            raise DockairError("sensor.wavelength_m", expected=expected, got=nodes.tolist())


@dataclass(frozen=True, slots=True, kw_only=True)
class ExposureParameters:
    """Sheet `exposure`."""

    exposure_s: float  #: the first one; every one, if control is off
    shortest_s: float
    longest_s: float
    metered_pixel: int
    target_level: float
    clipped_level: float
    clipped_factor: float
    longest_step: float
    dead_band: float

    def __post_init__(self) -> None:
        """Refuse limits that exclude each other or the exposure, and steps that the dead band would swallow."""
        if not self.shortest_s < self.longest_s:
            expected = f"less than exposure.longest_s = {self.longest_s} s"
            raise DockairError("exposure.shortest_s", expected=expected, got=self.shortest_s)
        if not self.shortest_s <= self.exposure_s <= self.longest_s:
            expected = f"{self.shortest_s} to {self.longest_s} s (exposure.shortest_s, exposure.longest_s)"
            raise DockairError("exposure.exposure_s", expected=expected, got=self.exposure_s)
        if not self.target_level * (1.0 + self.dead_band) < self.clipped_level:
            expected = f"so that with dead_band it stays below exposure.clipped_level = {self.clipped_level}"
            raise DockairError("exposure.target_level", expected=expected, got=self.target_level)
        if not self.longest_step > 1.0 + self.dead_band:
            expected = f"more than 1 + exposure.dead_band = {1.0 + self.dead_band:g}, or dark frames change nothing"
            raise DockairError("exposure.longest_step", expected=expected, got=self.longest_step)


@dataclass(frozen=True, slots=True, kw_only=True)
class LedParameters:
    """Sheet `leds`."""

    rated_intensity_w_sr: float
    rated_current_a: float
    drive_current_a: float
    junction_temperature_c: float
    reference_temperature_c: float
    intensity_per_k: float
    wavelength_per_k: float
    bin_ratio: float
    pattern_exponent: float
    wavelength_m: float
    wavelength_fwhm_m: float
    die_size_m: float
    occlusion_clearance_m: float


@dataclass(frozen=True, slots=True, kw_only=True)
class LightParameters:
    """Sheet `light`."""

    sun_angular_radius_rad: float
    gas_scale_height_m: float
    haze_scale_height_m: float


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class GlareParameters:
    """Sheet `glare`."""

    veiling_glare: float
    veiling_decay_rad: float
    halo_share: Array  #: (n,) of the parts of the halo
    halo_core_rad: Array  #: (n,)
    halo_exponent: Array  #: (n,)
    iris_blades: int
    iris_angle_rad: float
    spike_share: float
    spike_fan_rad: float
    ghost_position: Array  #: (m,) of the ghosts
    ghost_defocus_m: Array  #: (m,)
    ghost_share: Array  #: (m,)
    dirt_smallest_rad: float
    dirt_largest_rad: float
    dirt_darkest: float
    dirt_slope: float
    dirt_scatter: float

    def __post_init__(self) -> None:
        """Refuse smudges whose limits exclude each other."""
        if not self.dirt_smallest_rad <= self.dirt_largest_rad:
            expected = f"at most glare.dirt_largest_rad = {self.dirt_largest_rad} rad"
            raise DockairError("glare.dirt_smallest_rad", expected=expected, got=self.dirt_smallest_rad)


@dataclass(frozen=True, slots=True, kw_only=True)
class SurfaceParameters:
    """Sheet `surfaces`."""

    refractive_index: float
    metal_reflectance: float
    paint_share: float
    metal_share: float
    rubber_share: float
    glass_share: float
    paint_roughness_rad: float
    metal_roughness_rad: float
    rubber_roughness_rad: float
    glass_roughness_rad: float
    grazing_rad: float
    faintest_glint_m2_sr: float
    faintest_radiance: float
    patch_step_rad: float
    led_side_light: float
    led_seat_m: float
    faintest_reflection: float


@dataclass(frozen=True, slots=True, kw_only=True)
class SkyParameters:
    """Sheet `sky`."""

    zenith: float
    airlight: float
    aureole: float
    aureole_decay_1_rad: float
    molecular: float
    night: float
    cloud_height_m: float
    cloud_cell_m: float
    cloud_aspect: float
    cloud_spectral_exponent: float
    cloud_asymmetry: float
    droplet_radius_m: float
    wavelength_m: float
    deck_cover: float
    deck_top_m: float
    deck_cell_m: float
    deck_optical_depth: float
    ground_reflectance: float
    ground_contrast: float
    ground_cell_m: float
    water_cover: float
    water_reflectance: float
    coast_cell_m: float
    aerosol_optical_depth: float
    aerosol_scale_m: float
    haze_depth_m: float
    clear_visibility_m: float
    earth_radius_m: float

    def __post_init__(self) -> None:
        """Refuse a sky overhead that endless air could not make, and air that sends out less than no light."""
        if not self.zenith < self.airlight:
            raise DockairError("sky.zenith", expected=f"less than sky.airlight = {self.airlight}", got=self.zenith)
        if np.any(self.beyond_even(np.cos(np.linspace(0.0, np.pi, _ANGLES))) < -1.0):
            where, expected = "sky.aureole_decay_1_rad", "a decay that leaves light away from the Sun, for sky.aureole"
            raise DockairError(where, expected=f"{expected} = {self.aureole}", got=self.aureole_decay_1_rad)

    def beyond_even(self, cosine: Array) -> Array:
        """(n,) f - 1 of [sky_radiance, eq 1]: how much more a beam makes than light from all round.

        Args:
            cosine: (n,) of the angle from the Sun.
        """
        decay = self.aureole_decay_1_rad
        decayed = np.exp(-decay * np.arccos(cosine)) - math.exp(-0.5 * math.pi * decay)
        return np.asarray(self.aureole * decayed + self.molecular * cosine * cosine)


@dataclass(frozen=True, slots=True, kw_only=True)
class BackgroundParameters:
    """Sheet `background`."""

    reduction: int


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class CameraSheets:
    """All parameter sheets of a camera and of the light it works in; field names are the sheets'."""

    lens: LensParameters
    filter: FilterParameters
    sensor: SensorParameters
    exposure: ExposureParameters
    leds: LedParameters
    light: LightParameters
    glare: GlareParameters
    surfaces: SurfaceParameters
    sky: SkyParameters
    background: BackgroundParameters

    def __post_init__(self) -> None:
        """Refuse a filter that opens where the sensor's efficiency is not known; past its last node it is 0."""
        opens_m, first_m = self.filter.cut_on_m - 0.5 * self.filter.cut_on_ramp_m, float(self.sensor.wavelength_m[0])
        if first_m > opens_m:
            expected = f"the first at {opens_m:g} m or less, where the filter opens"
            raise DockairError("parameters.sensor.wavelength_m", expected=expected, got=first_m)

    @classmethod
    def load(
        cls, filter_name: str = "long_pass", overrides: Mapping[str, Mapping[str, Any]] | None = None
    ) -> "CameraSheets":
        """Read all sheets.

        Args:
            filter_name: "long_pass" or "band_pass".
            overrides: sheet -> key -> value instead of the sheet's.
        """
        loaded: dict[str, Any] = {}
        for entry in fields(cls):
            name = f"filter_{filter_name}" if entry.name == "filter" else entry.name
            loaded[entry.name] = load_parameters(name, entry.type, (overrides or {}).get(name))  # type: ignore[arg-type]
        return cls(**loaded)
