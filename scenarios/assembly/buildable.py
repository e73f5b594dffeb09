"""Refuses, before anything is built, what building a flight would refuse, as far as that takes milliseconds.

A campaign asks it of every scenario that it is about to fly: what nothing can be flown of is said in one line, and not
once a flight. A flight asks it, too. What shows only with a world in hand is left to the flight: a physics rate that
hose and reel cannot bear, a receiver that cannot be trimmed, the Sun at the edge of the field of the camera as built.
"""

import numpy as np

from dockair.calibration import Camera, LedRing
from dockair.errors import DockairError
from dockair.nav.guidance.field_of_view import FieldOfView
from dockair.parameters import load_parameters
from dockair.scenarios.assembly.measured import require_measurable
from dockair.scenarios.assembly.mounting_parameters import MountingParameters
from dockair.scenarios.assembly.nominal_sheets import nominal_camera, nominal_ring
from dockair.scenarios.assembly.receiver import airframe
from dockair.scenarios.plug_in import navigator_class_of
from dockair.scenarios.schema import Scenario
from dockair.scenarios.tables.crew import OUR_NAVIGATOR
from dockair.sim.air.atmosphere import STANDARD_GRAVITY_M_S2, standard_atmosphere
from dockair.sim.air.turbulence import gust_sigma
from dockair.sim.aircraft.flight_control import FlightControlParameters
from dockair.sim.aircraft.trim import steady_trim
from dockair.sim.as_built import require_borne
from dockair.sim.basket import require_fit, require_leds
from dockair.sim.camera.camera_noise import CameraNoise
from dockair.sim.camera.defects import Defects
from dockair.sim.camera.electronics import OUTPUT_BITS, output_black, output_gain
from dockair.sim.camera.readout import row_time_s, shortest_period_s
from dockair.sim.camera.sheets import CameraSheets, LedParameters, SensorParameters
from dockair.sim.faults import Faults
from dockair.sim.hose.chain import DrogueParameters
from dockair.sim.hose.coupling import CouplingParameters
from dockair.sim.hose.reel import ReelParameters
from dockair.sim.outlines import TankerParameters, nose_x_m
from dockair.sim.skins import tanker_skins

_RANGES_M = np.linspace(0.0, 40.0, 81)  # as far off as a flight may begin


def require_buildable(scenario: Scenario) -> None:
    """Refuse a flight into the ground, gusts, rates, sheets, faults and places that do not fit, and no navigator.

    Raises:
        DockairError: one of them does not, or the navigator's class is none.
    """
    _check_altitude(scenario)
    _check_gusts(scenario)
    ring, own = nominal_ring(scenario), scenario.parameters
    drogue = load_parameters("drogue", DrogueParameters, own.get("drogue"))
    _check_ring(scenario, ring, drogue)
    _check_outlines(scenario)
    _check_turn(scenario)
    _check_take_in(scenario)
    require_fit(drogue, load_parameters("coupling", CouplingParameters, own.get("coupling")))
    faults = Faults([table.fault for table in scenario.faults], ring.count)
    camera = nominal_camera(scenario)  # which is built whoever navigates
    if scenario.navigation.is_truth:
        return
    _check_navigator(scenario.navigation.navigator)
    _check_view(scenario, camera)
    sheets = CameraSheets.load(scenario.camera.filter, scenario.parameters)
    _check_camera_rate(scenario.rates.camera_hz, camera, sheets)
    _check_full_scale(sheets.sensor)
    noise = CameraNoise.of(0)  # nothing is drawn
    Defects(camera, sheets.glare, sheets.exposure, faults, noise.dirt, noise.hot_pixels)
    if scenario.camera.sensing == "measurements":
        require_measurable(scenario)


def _check_navigator(name: str) -> None:
    try:
        navigator_class_of(name)
    except DockairError as error:
        got = f"{name}: {error.got}"
        raise DockairError("navigation.navigator", expected=error.expected, got=got) from error


def _check_altitude(scenario: Scenario) -> None:
    """A toboggan ends above the ground: from under it the camera sees no Earth."""
    flight, tanker = scenario.flight, scenario.tanker
    if tanker.manoeuvre != "toboggan":
        return
    descends_s = max(flight.duration_s - tanker.starts_s, 0.0)
    down_m = float(np.sin(np.radians(tanker.descent_deg))) * flight.airspeed_m_s * descends_s
    if not flight.altitude_m > down_m:
        expected = f"more than {down_m:.1f} m, as far as the tanker goes down in flight.duration_s"
        raise DockairError("flight.altitude_m", expected=expected, got=flight.altitude_m)


def _check_gusts(scenario: Scenario) -> None:
    """Of how strong gusts of an intensity are there is a table, of some altitudes."""
    turbulence = scenario.turbulence
    if turbulence.model == "none" or turbulence.intensity is None:
        return
    try:
        gust_sigma(turbulence.intensity, scenario.flight.altitude_m)
    except DockairError as error:
        raise error.at("flight.altitude_m") from None


def _check_ring(scenario: Scenario, ring: LedRing, drogue: DrogueParameters) -> None:
    """As many LEDs as the drogue carries, none too bright, sit on the rim that its sheet describes."""
    try:
        require_leds(ring)
        require_borne(ring, load_parameters("leds", LedParameters, scenario.parameters.get("leds")))
    except DockairError as error:
        raise error.at(f"{scenario.hardware.ring}: {error.where.partition('.')[2]}") from None
    if ring.diameter_m != drogue.ring_diameter_m:
        where, expected = "parameters.drogue.ring_diameter_m", f"the LED ring's own diameter, {ring.diameter_m} m"
        raise DockairError(where, expected=f"{expected} (hardware.ring)", got=drogue.ring_diameter_m)


def _check_outlines(scenario: Scenario) -> None:
    """Behind the probe's tip is room for a nose, and the hose's unit has something to hang on."""
    own, sheet = scenario.parameters, scenario.hardware.receiver_sheet("mounting")
    try:
        nose_x_m(load_parameters(sheet, MountingParameters, own.get(sheet)).mounting())
    except DockairError as error:
        raise error.at(f"parameters.{sheet}.probe_tip_m") from None
    tanker, pod = load_parameters("tanker", TankerParameters, own.get("tanker")), scenario.tanker.pod
    try:
        tanker_skins(tanker.at_pod(pod))
    except DockairError as error:
        key, place = ("exit_m", tanker.exit_m) if pod == "centreline" else ("wing_exit_m", tanker.wing_exit_m)
        raise DockairError(f"parameters.tanker.{key}", expected=error.expected, got=place.tolist()) from None


def _check_turn(scenario: Scenario) -> None:
    """The receiver can fly its tanker's turn, as far as its flight control lets it bank."""
    tanker, flight = scenario.tanker, scenario.flight
    if tanker.manoeuvre != "racetrack" or not tanker.starts_s < flight.duration_s:
        return
    sheet, air = scenario.hardware.receiver_sheet("flight_control"), standard_atmosphere(flight.altitude_m)
    control = load_parameters(sheet, FlightControlParameters, scenario.parameters.get(sheet))
    bank_rad = min(float(np.radians(tanker.bank_deg)), control.bank_limit_rad)
    turn_rate = STANDARD_GRAVITY_M_S2 * float(np.tan(bank_rad)) / flight.airspeed_m_s
    try:
        signed = turn_rate if tanker.turns == "left" else -turn_rate
        steady_trim(airframe(scenario, scenario.parameters), flight.airspeed_m_s, air, turn_rate_rad_s=signed)
    except DockairError:
        flown = f"at {flight.airspeed_m_s:g} m/s in air of {air.density_kg_m3:.3f} kg/m^3"
        expected = f"a bank at which the receiver can turn {flown}"
        raise DockairError("tanker.bank_deg", expected=expected, got=tanker.bank_deg) from None


def _check_take_in(scenario: Scenario) -> None:
    """As much hose as Dockair's guidance is to push in, the reel can wind in; nobody else is told of it."""
    if scenario.navigation.navigator not in ("truth", OUR_NAVIGATOR):
        return
    range_m = load_parameters("reel", ReelParameters, scenario.parameters.get("reel")).range_m
    if scenario.guidance.take_in_m > range_m:
        expected = f"at most parameters.reel.range_m = {range_m}, all that the reel winds in"
        raise DockairError("guidance.take_in_m", expected=expected, got=scenario.guidance.take_in_m)


def _check_view(scenario: Scenario, camera: Camera) -> None:
    """The camera is behind the probe's tip, and sees a ring ahead of that at some range."""
    sheet = scenario.hardware.receiver_sheet("mounting")
    mounting = load_parameters(sheet, MountingParameters, scenario.parameters.get(sheet)).mounting()
    where, got = f"parameters.{sheet}.camera_position_m", mounting.p_BC.tolist()
    if not mounting.p_BC[0] < mounting.p_BP[0]:
        expected = f"a place behind the probe's tip, of less than {mounting.p_BP[0]} m forward"
        raise DockairError(where, expected=expected, got=got)
    view, ahead = FieldOfView(camera, mounting), [np.array([range_m, 0.0, 0.0]) for range_m in _RANGES_M]
    if not any(view.holds(p_PD_B) for p_PD_B in [*ahead, scenario.start.p_PD_B]):
        expected = (
            f"a place from which the camera has a ring ahead of the probe in view, {_RANGES_M[-1]:g} m away at most"
        )
        raise DockairError(where, expected=expected, got=got)


def _check_camera_rate(camera_hz: int, camera: Camera, sheets: CameraSheets) -> None:
    """A full frame must be read before the next: the navigation may ask for one at any time."""
    sensor, longest_s = sheets.sensor, sheets.exposure.longest_s
    highest_hz = 1.0 / shortest_period_s(camera.height_px, sensor, longest_s)
    if camera_hz > highest_hz:
        at_which = f"at which the sensor's {sensor.outputs} outputs read full frames"
        if longest_s > camera.height_px * row_time_s(sensor):
            at_which = f"at which it can still expose for exposure.longest_s = {longest_s} s"
        expected = f"a rate up to {np.floor(10.0 * highest_hz) / 10.0:.1f} Hz, {at_which}"
        raise DockairError("rates.camera_hz", expected=expected, got=camera_hz)


def _check_full_scale(sensor: SensorParameters) -> None:
    """A full well must read full scale: that level is all by which a clipped LED is told from a whole one."""
    full_scale = 2.0**OUTPUT_BITS - 1.0
    if output_black(sensor) + output_gain(sensor) * sensor.full_well_e < full_scale:
        least_e = np.ceil((full_scale - output_black(sensor)) / output_gain(sensor))
        expected = f"at least {least_e:.0f} e-, which read full scale, by which clipped LEDs are known"
        raise DockairError("parameters.sensor.full_well_e", expected=expected, got=sensor.full_well_e)
