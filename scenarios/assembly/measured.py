"""Makes the measurement model of a scenario's camera: the same sheets and hardware, no picture.

Of the scene's light it takes one number, what a white ball ahead sends back: `texture_light`.
"""

from dataclasses import dataclass
from functools import cache

import numpy as np

from dockair.calibration import Camera, Mounting
from dockair.errors import DockairError
from dockair.nav.navigator import NavigatorSettings
from dockair.parameters import load_parameters
from dockair.scenarios.assembly.mounting_parameters import MountingParameters
from dockair.scenarios.assembly.nominal_sheets import nominal_camera, nominal_ring
from dockair.scenarios.measured_leds import MeasuredLeds, MeasurementParameters, TextureLight
from dockair.scenarios.schema import Scenario, load_scenario
from dockair.sim.as_built import AsBuilt
from dockair.sim.camera.camera import CameraNoise
from dockair.sim.camera.defects import Defects
from dockair.sim.camera.radiometry import extinction_1_m, led_intensity_w_sr, responses_in_flight
from dockair.sim.camera.sheets import CameraSheets
from dockair.sim.camera.sky_radiance import SkyRadiance
from dockair.sim.camera.solids import Lighting
from dockair.sim.faults import Faults
from dockair.sim.world import World
from dockair.streams import random_stream

SHEET = "measurement_model"
FITTED_IN = "default"  #: the scenario whose light and filter the sheet was fitted in
_ATTITUDE_RAD = np.radians(5.0)  # of the body in W: trim, gusts
_AFT_W = np.array([-1.0, 0.0, 0.0])  # from what is ahead to the camera
_FAINTEST = 1e-6  # of the LEDs' light in the fit: where none passes the filter, none is named
_SKY_KEY = 0  # of deck and ground below, whose mean light is wanted: any


@dataclass(frozen=True, slots=True, kw_only=True)
class _Light:
    """What there is to be seen by, of a nominal camera in a scenario."""

    surface_e_s: float  #: Y of `measured_leds`: of a pixel on the axis, its surface the mean of a white ball
    led_e_m2_s: float  #: E: of the spot of the ring's mean LED on the axis, times its range squared
    extinction_1_m: float


def measured_leds(scenario: Scenario, seed: int, as_built: AsBuilt, faults: Faults, world: World) -> MeasuredLeds:
    """Return what stands in place of the camera.

    Raises:
        DockairError: the scenario has something that acts through the picture alone.
    """
    refuse_unmodelled(scenario, as_built.camera, as_built.mounting)
    sheets, noise = CameraSheets.load(scenario.camera.filter, scenario.parameters), CameraNoise.of(seed)
    parameters = load_parameters(SHEET, MeasurementParameters, scenario.parameters.get(SHEET))
    return MeasuredLeds(
        parameters,
        sheets,
        as_built,
        responses_in_flight(sheets, as_built.camera, scenario.flight.altitude_m, scenario.sun_W),
        world.model,
        rng=random_stream(seed, "measurements"),
        transfer=noise.transfer,
        defects=Defects(as_built.camera, sheets.glare, sheets.exposure, faults, noise.dirt, noise.hot_pixels),
        faults=faults,
        followed_s=NavigatorSettings().usable_age_s,
        extinction_1_m=extinction_1_m(scenario.weather.visibility_m),
        texture_light=texture_light(scenario, parameters.texture_exponent),
        automatic_exposure=scenario.camera.exposure == "auto",
    )


def texture_light(scenario: Scenario, texture_exponent: float) -> TextureLight:
    """Return what a scenario's light makes of the texture, Eq. (4) of `measured_leds`.

    Args:
        scenario: of the flight; clouds are left out.
        texture_exponent: q of the sheet.
    """
    here, fit = _light(scenario), _light_of_fit()
    leds = max(here.led_e_m2_s / fit.led_e_m2_s, _FAINTEST)
    return TextureLight(
        factor=here.surface_e_s / fit.surface_e_s * leds ** (texture_exponent - 1.0),
        extinction_1_m=here.extinction_1_m - fit.extinction_1_m,
    )


@cache
def _light_of_fit() -> _Light:
    return _light(load_scenario(FITTED_IN))


def _light(scenario: Scenario) -> _Light:
    sheets = CameraSheets.load(scenario.camera.filter, scenario.parameters)
    altitude_m, sun_W, weather = scenario.flight.altitude_m, scenario.sun_W, scenario.weather.as_seen
    response = responses_in_flight(sheets, nominal_camera(scenario), altitude_m, sun_W)  # nominal: alike in all seeds
    sky = SkyRadiance(sheets.sky, weather, sun_W, altitude_m, _SKY_KEY)
    lighting = Lighting.toward(scenario.sun.lit_from_W, sky, sheets.light.sun_angular_radius_rad)
    ring = nominal_ring(scenario)
    return _Light(
        surface_e_s=response.white_e_s * lighting.on_ball(_AFT_W),
        led_e_m2_s=response.led_e_m2_sr_w_s * led_intensity_w_sr(sheets.leds) * float(ring.relative_brightness.mean()),
        extinction_1_m=extinction_1_m(weather.visibility_m),
    )


def require_measurable(scenario: Scenario) -> None:
    """Refuse by the nominal sheets, before anything is built, what `measured_leds` would refuse.

    Raises:
        DockairError: the scenario has something that acts through the picture alone.
    """
    sheet = scenario.hardware.receiver_sheet("mounting")
    mounting = load_parameters(sheet, MountingParameters, scenario.parameters.get(sheet)).mounting()
    refuse_unmodelled(scenario, nominal_camera(scenario), mounting)


def refuse_unmodelled(scenario: Scenario, camera: Camera, mounting: Mounting) -> None:
    """Refuse what measurements without a picture would silently leave out.

    Args:
        scenario: that is to be flown so.
        camera: as it was built, or nominal before anything is built.
        mounting: of the camera, likewise.
    """
    reasons = {
        "hot pixels": any(table.kind == "hot_pixels" for table in scenario.faults),
        "clouds": scenario.weather.cloud_cover > 0.0,
        "the Sun in the camera's field": _sun_in_field(scenario, camera, mounting),
    }
    for reason, holds in reasons.items():
        if holds:
            expected = f'"frames": the scenario has what acts through the picture, {reason}'
            raise DockairError("camera.sensing", expected=expected, got="measurements")


def _sun_in_field(scenario: Scenario, camera: Camera, mounting: Mounting) -> bool:
    sun_W = scenario.sun_W
    if sun_W is None:
        return False
    half_px = 0.5 * np.hypot(camera.width_px, camera.height_px)
    half_field = float(np.arctan(half_px / camera.focal_length_px)) + _ATTITUDE_RAD
    return bool(sun_W @ mounting.R_BC[:, 0] > np.cos(half_field))
