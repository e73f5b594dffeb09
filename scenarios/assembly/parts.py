"""Makes a scenario's world, sensors and navigator: the only place where as-built and nominal values are both known."""

from dataclasses import dataclass, replace
from functools import partial
from typing import TypeVar

import numpy as np

from dockair.calibration import Mounting, NavigationSheets
from dockair.clock import Clock
from dockair.errors import DockairError
from dockair.messages import Navigates
from dockair.nav.guidance.announced_path import AnnouncedPathSettings
from dockair.nav.guidance.approach import GuidanceSettings
from dockair.nav.guidance.bow_wave_push import BowWavePush
from dockair.nav.guidance.guidance_settings import PredictiveSettings
from dockair.nav.guidance.phases import PhaseLimits
from dockair.nav.guidance.swing_model import SwingSettings
from dockair.nav.heading.own_heading import OwnHeadingSettings
from dockair.nav.navigator import Navigator, NavigatorSettings
from dockair.parameters import load_parameters
from dockair.rotations import Array
from dockair.scenarios.assembly import receiver as build_receiver
from dockair.scenarios.assembly.air import air_motion
from dockair.scenarios.assembly.buildable import require_buildable
from dockair.scenarios.assembly.measured import measured_leds
from dockair.scenarios.assembly.mounting_parameters import MountingParameters
from dockair.scenarios.assembly.nominal_sheets import nominal_ring, nominal_sheets
from dockair.scenarios.class_by_name import name_of
from dockair.scenarios.measured_leds import MeasuredLeds
from dockair.scenarios.navigator_recipe import NavigatorRecipe
from dockair.scenarios.path_keys import NAVIGATOR, absolute
from dockair.scenarios.schema import Scenario
from dockair.scenarios.truth_navigation import TruthNavigator
from dockair.sim.air.atmosphere import Air, standard_atmosphere
from dockair.sim.air.bow_wave import BowWaveParameters, bow_wave_coefficients
from dockair.sim.aircraft.announcer import Announcer, TankerSheet
from dockair.sim.aircraft.flight_control import FlightControlParameters
from dockair.sim.aircraft.receiver import Receiver
from dockair.sim.aircraft.tanker import TankerPath, TankerPathParameters
from dockair.sim.as_built import AsBuilt, AsBuiltParameters, draw_as_built
from dockair.sim.basket import place_leds
from dockair.sim.camera.camera import CameraNoise, NearInfraredCamera
from dockair.sim.camera.sheets import CameraSheets, LedParameters
from dockair.sim.faults import Faults
from dockair.sim.hose.chain import DrogueParameters, HoseParameters
from dockair.sim.hose.coupling import CouplingParameters
from dockair.sim.hose.fuel import FuelParameters
from dockair.sim.hose.pod_light import PodLight, PodLightParameters
from dockair.sim.hose.reel import ReelParameters
from dockair.sim.imu import Imu, ImuParameters
from dockair.sim.outlines import TankerParameters
from dockair.sim.world import World, WorldParameters, WorldStart
from dockair.streams import random_stream

SETTLE_S = 12.0  # hose and gusts run this long before the flight: several periods of the drogue's swing
#: Of an attempt, its hold apart: 5 s of approach, 3.5 until the hose is pushed in, 7.5 until the probe is clear again.
#: One begun so long before a flight's time is over still ends, unless its hold is long in coming to a green light.
ATTEMPT_S = 16.0
_NOMINAL = GuidanceSettings()
RESPONSE_S = {  # delay of the probe's tip forward, left, up, behind a command at 0.1-0.4 Hz, a control tick included
    "fighter": _NOMINAL.response_s,
    "unmanned": (0.40, 0.25, 0.10),
}
#: What of the tip's motion besides its commands is taken for straying. The unmanned airframe's answer sideways falls
#: off with frequency, and what it lacks does not die away: left 0.4 s ahead is foretold within 59 mm without, 61 with;
#: up 0.3 s ahead within 98 without, 52 with (moderate gusts, seeds 21500-21503, measured LEDs). Forward nothing is
#: gained, and on the probe it went in by 3.07 m, not 2.39, where 2.5 is the most (perfect navigation, seed 3).
STRAYING_LIMIT_M_S = {"fighter": _NOMINAL.predictive.straying_limit_m_s, "unmanned": (0.0, 0.0, 0.5)}
COMMANDED = 0.95  # of the accelerations that the flight control flies: what it cut off would be missing in guidance
FRAMES_STOP = 2.5  # periods of a slow camera without a frame: one that is late is no failure

T = TypeVar("T")


@dataclass(frozen=True, slots=True, kw_only=True)
class Periods:
    """Physics ticks between two samples, control ticks, frames."""

    gyro: int
    control: int
    camera: int


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Parts:
    """What a flight is made of."""

    world: World
    camera: NearInfraredCamera | MeasuredLeds | None  #: None where the truth navigates
    imu: Imu
    faults: Faults
    navigator: Navigates
    recipe: NavigatorRecipe | None  #: how to make that navigator again, for a replay; None where frames are not its own
    sheets: NavigationSheets
    as_built: AsBuilt
    clock: Clock
    periods: Periods
    announcer: Announcer
    pod_light: PodLight


def build(scenario: Scenario, seed: int) -> Parts:
    """Return the parts of a flight.

    Args:
        scenario: what to fly.
        seed: of every random stream.

    Raises:
        DockairError: a parameter or sheet that does not fit.
        MachineError: no off-screen OpenGL for the camera.
    """
    require_buildable(scenario)
    clock = Clock(scenario.rates.physics_hz)
    air = standard_atmosphere(scenario.flight.altitude_m)
    mounting = _sheet(scenario, scenario.hardware.receiver_sheet("mounting"), MountingParameters).mounting()
    airframe = build_receiver.airframe(scenario, scenario.parameters)
    receiver = Receiver(
        airframe=airframe,
        flight_control=_sheet(scenario, scenario.hardware.receiver_sheet("flight_control"), FlightControlParameters),
        probe_B=mounting.p_BP,
        airspeed_m_s=scenario.flight.airspeed_m_s,
        air=air,
        step_s=clock.step_s,
        rng=random_stream(seed, "inertial_velocity"),
    )
    parameters = _world_parameters(scenario, air, mounting)
    sheets = nominal_sheets(scenario, parameters, _imu_parameters(scenario))
    faults = Faults([table.fault for table in scenario.faults], sheets.ring.count)
    offset = scenario.start.sigma_p_m * random_stream(seed, "start").normal(size=3)
    start = WorldStart(p_PD_B=scenario.start.p_PD_B + offset, settle_s=SETTLE_S)
    motion = air_motion(
        scenario,
        partial(_sheet, scenario),
        parameters,
        clock,
        random_stream(seed, "gust"),
        receiver_span_m=airframe.span_m,
        receiver_points_B=airframe.gust_points_m,
        settle_s=SETTLE_S,
    )
    path, announcer = _tanker_path(scenario, seed, parameters)
    pod_light = PodLight(faults.reel_seen_dead, parameters.reel, _sheet(scenario, "pod_light", PodLightParameters))
    world = World(parameters, receiver, motion, start, clock, faults.reel_locked, path, pod_light.is_red)
    place_leds(world.model, world.data, sheets.ring)
    as_built = _as_built(scenario, seed, sheets)
    if scenario.navigation.is_truth:
        camera: NearInfraredCamera | MeasuredLeds | None = None
        recipe = None
        navigator: Navigates = TruthNavigator(sheets, guidance_settings(scenario))
    else:
        recipe = _recipe(scenario, sheets)
        navigator = recipe.build()
        if isinstance(navigator, TruthNavigator):  # its results would not be marked
            raise DockairError("navigation.navigator", expected='"truth" for perfect navigation', got=recipe.class_name)
        measured = scenario.camera.sensing == "measurements"
        camera = (measured_leds if measured else _camera)(scenario, seed, as_built, faults, world)
    periods = Periods(
        gyro=clock.ticks_per(scenario.rates.gyro_hz, "rates.gyro_hz"),
        control=clock.ticks_per(scenario.rates.control_hz, "rates.control_hz"),
        camera=clock.ticks_per(scenario.rates.camera_hz, "rates.camera_hz"),
    )
    return Parts(
        world=world,
        camera=camera,
        imu=_imu(scenario, seed, as_built.mounting),
        faults=faults,
        as_built=as_built,
        navigator=navigator,
        recipe=None if isinstance(camera, MeasuredLeds) else recipe,
        sheets=sheets,
        clock=clock,
        periods=periods,
        announcer=announcer,
        pod_light=pod_light,
    )


def guidance_settings(scenario: Scenario) -> GuidanceSettings:
    """Return the guidance that the scenario asks for, with what the nominal sheets say of the receiver.

    Where the probe is mounted is measured on the ground, and goes in as the scenario sets it (`nominal_sheets`).
    """
    g, duration_s = scenario.guidance, scenario.flight.duration_s
    density = standard_atmosphere(scenario.flight.altitude_m).density_kg_m3
    pressure_pa = 0.5 * density * scenario.flight.airspeed_m_s**2
    mounting = _sheet(scenario, scenario.hardware.receiver_sheet("mounting"), MountingParameters)
    bow_wave = load_parameters(scenario.hardware.receiver_sheet("bow_wave"), BowWaveParameters)
    source_B = bow_wave_coefficients(bow_wave, mounting.probe_tip_m, scenario.flight.airspeed_m_s)[:3]
    x, y, z = (float(value) for value in source_B - mounting.probe_tip_m)
    control = load_parameters(scenario.hardware.receiver_sheet("flight_control"), FlightControlParameters)
    attempt_s = ATTEMPT_S + g.hold_s
    limits = PhaseLimits(
        rim_m=0.5 * nominal_ring(scenario).diameter_m,
        frames_stop_s=max(_NOMINAL.limits.frames_stop_s, FRAMES_STOP / scenario.rates.camera_hz),
        attempts_max=g.attempts_max,
        slot_s=duration_s - attempt_s if duration_s >= 2.0 * attempt_s else float("inf"),
        stabilise_s=g.stabilise_s,
        capture_radius_m=g.capture_radius_m,
        take_in_m=g.take_in_m,
        hold_s=g.hold_s,
    )
    acceleration_limit = _commanded(control.acceleration_limit_m_s2)
    push = BowWavePush(source_from_tip_m=(x, y, z), radius_m=bow_wave.radius_m).at_pressure(pressure_pa)
    return GuidanceSettings(
        controller=g.controller,
        closure_speed_m_s=g.closure_speed_m_s,
        closure_acceleration_m_s2=min(_NOMINAL.closure_acceleration_m_s2, acceleration_limit[0]),
        closing=_NOMINAL.closing.braked_at(acceleration_limit[0]),
        response_s=RESPONSE_S[scenario.hardware.airframe],
        acceleration_limit_m_s2=acceleration_limit,
        jerk_limit_m_s3=_commanded(control.jerk_limit_m_s3),
        predictive=PredictiveSettings(
            straying_limit_m_s=STRAYING_LIMIT_M_S[scenario.hardware.airframe], swing=SwingSettings().at(pressure_pa)
        ),
        bow_wave=push,
        path=AnnouncedPathSettings(airspeed_m_s=scenario.flight.airspeed_m_s),
        limits=limits,
    )


def _commanded(limits: Array) -> tuple[float, float, float]:
    forward, left, up = (COMMANDED * float(limit) for limit in limits)
    return forward, left, up


def _sheet(scenario: Scenario, name: str, cls: type[T]) -> T:
    return load_parameters(name, cls, scenario.parameters.get(name))


def _world_parameters(scenario: Scenario, air: Air, mounting: Mounting) -> WorldParameters:
    return WorldParameters(
        hose=_sheet(scenario, "hose", HoseParameters),
        drogue=_sheet(scenario, "drogue", DrogueParameters),
        reel=_sheet(scenario, "reel", ReelParameters),
        coupling=_sheet(scenario, "coupling", CouplingParameters),
        fuel=_sheet(scenario, "fuel", FuelParameters),
        tanker=_sheet(scenario, "tanker", TankerParameters).at_pod(scenario.tanker.pod),
        mounting=mounting,
        air=air,
        airspeed_m_s=scenario.flight.airspeed_m_s,
        sun_direction_W=scenario.sun.lit_from_W,
        receiver_outline=scenario.hardware.airframe,
    )


def _tanker_path(scenario: Scenario, seed: int, world: WorldParameters) -> tuple[TankerPath, Announcer]:
    sheet = _sheet(scenario, "tanker_path", TankerSheet)
    table = scenario.tanker
    flown = TankerPathParameters(
        manoeuvre=table.manoeuvre,
        starts_s=table.starts_s,
        leg_s=table.leg_s,
        bank_rad=float(np.radians(table.bank_deg)),
        turns_left=table.turns == "left",
        descent_rad=float(np.radians(table.descent_deg)),
        roll_rate_rad_s=sheet.roll_rate_rad_s,
        pull_over_rate_rad_s=sheet.pull_over_rate_rad_s,
    )
    path = TankerPath(flown, world.airspeed_m_s, -np.asarray(world.tanker.exit_m))
    return path, Announcer(path, sheet, random_stream(seed, "announcement"))


def _imu_parameters(scenario: Scenario) -> ImuParameters:
    return _sheet(scenario, f"imu_{scenario.hardware.imu}", ImuParameters)


def _imu(scenario: Scenario, seed: int, mounting: Mounting) -> Imu:
    return Imu(
        _imu_parameters(scenario),
        scenario.rates.gyro_hz,
        random_stream(seed, "gyro"),
        random_stream(seed, "accelerometer"),
        random_stream(seed, "imu_clock"),
        mounting.R_BI,
        mounting.p_BI,
    )


def _as_built(scenario: Scenario, seed: int, sheets: NavigationSheets) -> AsBuilt:
    """Draw the hardware as it was built."""
    leds, parameters = _sheet(scenario, "leds", LedParameters), _sheet(scenario, "as_built", AsBuiltParameters)
    return draw_as_built(sheets.camera, sheets.ring, sheets.mounting, parameters, leds, random_stream(seed, "as_built"))


def _camera(scenario: Scenario, seed: int, as_built: AsBuilt, faults: Faults, world: World) -> NearInfraredCamera:
    table, sheets = scenario.camera, camera_sheets(scenario)
    return NearInfraredCamera(
        sheets,
        as_built,
        CameraNoise.of(seed),
        world.model,
        sun_direction_W=scenario.sun_W,
        weather=scenario.weather.as_seen,
        altitude_m=scenario.flight.altitude_m,
        airspeed_m_s=scenario.flight.airspeed_m_s,
        faults=faults,
        automatic_exposure=table.exposure == "auto",
        background=table.background,
    )


def camera_sheets(scenario: Scenario) -> CameraSheets:
    """Return the camera's sheets with the scenario's own values."""
    return CameraSheets.load(scenario.camera.filter, scenario.parameters)


def _recipe(scenario: Scenario, sheets: NavigationSheets) -> NavigatorRecipe:
    """Our own navigator takes settings; anybody else's is made of its sheets alone."""
    name = absolute(NAVIGATOR, scenario.navigation.navigator)  # a replay may begin elsewhere
    ours = name == name_of(Navigator)
    settings = NavigatorSettings(guidance=guidance_settings(scenario), heading=_heading(scenario)) if ours else None
    return NavigatorRecipe(class_name=name, sheets=sheets, settings=settings)


def _heading(scenario: Scenario) -> OwnHeadingSettings | None:
    table = scenario.navigation
    if not table.heading:
        return None
    settings = OwnHeadingSettings(airspeed_m_s=scenario.flight.airspeed_m_s, every_s=table.heading_every_s)
    camera = camera_sheets(scenario).exposure  # by its exposure the frame that was asked for is known
    exposure_s = min(max(settings.exposure_s, camera.shortest_s), camera.longest_s)
    return replace(settings, exposure_s=exposure_s)
