"""Makes the measurement model of a scenario's camera: the same sheets and hardware, no picture."""

import numpy as np

from dockair.calibration import Camera, Mounting
from dockair.errors import DockairError
from dockair.nav.navigator import NavigatorSettings
from dockair.parameters import load_parameters
from dockair.scenarios.measured_leds import MeasuredLeds, MeasurementParameters
from dockair.scenarios.mounting_parameters import MountingParameters
from dockair.scenarios.nominal_sheets import nominal_camera
from dockair.scenarios.schema import Scenario
from dockair.sim.as_built import AsBuilt
from dockair.sim.camera.camera import CameraNoise
from dockair.sim.camera.defects import Defects
from dockair.sim.camera.radiometry import extinction_1_m, responses
from dockair.sim.camera.sheets import CameraSheets
from dockair.sim.faults import Faults
from dockair.sim.world import World
from dockair.streams import random_stream

SHEET = "measurement_model"
_ATTITUDE_RAD = np.radians(5.0)  # of the body in W: trim, gusts


def measured_leds(scenario: Scenario, seed: int, as_built: AsBuilt, faults: Faults, world: World) -> MeasuredLeds:
    """Return what stands in place of the camera.

    Raises:
        DockairError: the scenario has something that acts through the picture alone.
    """
    refuse_unmodelled(scenario, as_built.camera, as_built.mounting)
    sheets, noise = CameraSheets.load(scenario.camera.filter, scenario.parameters), CameraNoise.of(seed)
    return MeasuredLeds(
        load_parameters(SHEET, MeasurementParameters, scenario.parameters.get(SHEET)),
        sheets,
        as_built,
        responses(sheets.lens, sheets.filter, sheets.sensor, sheets.leds, sheets.light, as_built.camera),
        world.model,
        rng=random_stream(seed, "measurements"),
        transfer=noise.transfer,
        defects=Defects(as_built.camera, sheets.glare, sheets.exposure, faults, noise.dirt, noise.hot_pixels),
        faults=faults,
        followed_s=NavigatorSettings().usable_age_s,
        extinction_1_m=extinction_1_m(scenario.weather.visibility_m),
        automatic_exposure=scenario.camera.exposure == "auto",
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
